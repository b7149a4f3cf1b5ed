/* query.c - parameters, as what statements are bound to. Texts go to SQL as they came, bound and never pasted;
 * numbers are read here, because SQL would take "1e" or "0x10" for text with a number in it.
 *
 * Options may be given as SQL has them, one JSON object, or each as a parameter of its own:
 * `options={"mode":"cut"}` or `mode=cut`. Which there are and what values they have, SQL says.
 */
#include "internal.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *skip_digits(const char *p) {
    while (isdigit((unsigned char)*p)) p++;
    return p;
}

bool number_read(const char *text, double *value) {
    const char *p = text + (*text == '-' || *text == '+'), *digits = p;
    p = skip_digits(p);
    size_t count = (size_t)(p - digits);
    if (*p == '.') {
        digits = ++p;
        p = skip_digits(p);
        count += (size_t)(p - digits);
    }
    if (count == 0) return false;
    if (*p == 'e' || *p == 'E') {
        digits = p += 1 + (p[1] == '-' || p[1] == '+');
        p = skip_digits(p);
        if (p == digits) return false;
    }
    if (*p) return false;
    *value = strtod(text, NULL);
    return true;
}

static bool refuse(request *r, const char *name, const char *what) {
    answer_problem(r, MHD_HTTP_BAD_REQUEST, "the parameter %s must be %s", name, what);
    return false;
}

static bool check_numbers(request *r) {
    static const char *const numbers[] = {"eps", "eps_from", "eps_to", "x", "y"};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        const char *text = request_parameter(r, numbers[i]);
        double value;
        if (text && !number_read(text, &value)) return refuse(r, numbers[i], "a number");
    }
    return true;
}

/* --------------------------------------------------------------------------------------------------- options -- */

static bool is_option(const char *name) {
    static const char names[] = " " VIEW_OPTION_NAMES;
    const size_t n = strlen(name);
    for (const char *p = names; (p = strstr(p, name)) != NULL; p += n)
        if (p[-1] == ' ' && p[n] == ' ') return strcmp(name, "options") != 0;
    return false;
}

/* A parameter's value as the option wants it: a number of vertices, places in JSON, else a text. */
static cJSON *option_value(const char *name, const char *value) {
    double number;
    if (strncmp(name, "max_", 4) == 0 && number_read(value, &number)) return cJSON_CreateNumber(number);
    if (strcmp(name, "detail") == 0 && *value == '[') {
        cJSON *json = cJSON_ParseWithOpts(value, NULL, true);
        if (json) return json;
    }
    return cJSON_CreateString(value);
}

static bool read_options(request *r, query *q) {
    const char *whole = request_parameter(r, "options");
    bool has_single = false;
    for (int i = 0; i < r->parameter_count; i++) has_single |= is_option(r->parameters[i].name);
    if (!has_single) {
        q->options = whole ? strdup(whole) : NULL;
        return !whole || q->options || (r->answer.body.no_memory = true, false);
    }
    cJSON *json = whole ? cJSON_ParseWithOpts(whole, NULL, true) : cJSON_CreateObject();
    if (!cJSON_IsObject(json)) {
        cJSON_Delete(json);
        return refuse(r, "options", "a JSON object");
    }
    for (int i = 0; i < r->parameter_count; i++) {
        const parameter *p = &r->parameters[i];
        if (!is_option(p->name)) continue;
        if (cJSON_GetObjectItemCaseSensitive(json, p->name)) {
            answer_problem(r, MHD_HTTP_BAD_REQUEST, "the option %s is given in options and on its own", p->name);
            cJSON_Delete(json);
            return false;
        }
        cJSON_AddItemToObject(json, p->name, option_value(p->name, p->value));
    }
    q->options = cJSON_PrintUnformatted(json);
    cJSON_Delete(json);
    r->answer.body.no_memory |= !q->options;
    return q->options != NULL;
}

/* ---------------------------------------------------------------------------------------------------- region -- */

/* "x0,y0,x1,y1" -> four numbers. */
static bool read_box(const char *text, double box[4]) {
    for (int i = 0; i < 4; i++) {
        char number[64];
        const size_t n = strcspn(text, ",");
        if (n == 0 || n >= sizeof number || (text[n] == ',') != (i < 3)) return false;
        memcpy(number, text, n);
        number[n] = 0;
        if (!number_read(number, &box[i]) || !isfinite(box[i])) return false;
        text += n + 1;
    }
    return true;
}

/* In degrees on WGS 84 a box may go across the antimeridian, which rqt_bbox knows when it is told so. */
static bool make_box(request *r, const terrain *t, const double box[4], query *q) {
    const bool lonlat = t->srid == 4326;
    sqlite3_stmt *make = lonlat ? database_prepare(t->database, r, "SELECT rqt_bbox(?1, ?2, ?3, ?4, 4326)")
                                : database_prepare(t->database, r, "SELECT rqt_bbox(?1, ?2, ?3, ?4)");
    if (!make) return false;
    for (int i = 0; i < 4; i++) sqlite3_bind_double(make, i + 1, box[i]);
    const int code = sqlite3_step(make);
    if (code != SQLITE_ROW) {
        database_failed(t->database, r, code, NULL);
        return false;
    }
    const void *bytes = sqlite3_column_blob(make, 0);
    q->size = sqlite3_column_bytes(make, 0);
    q->box = malloc((size_t)q->size + 1);
    if (q->box && bytes) memcpy(q->box, bytes, (size_t)q->size);
    r->answer.body.no_memory |= !q->box;
    sqlite3_reset(make);
    return q->box != NULL;
}

static bool read_region(request *r, const terrain *t, query *q) {
    const char *bbox = request_parameter(r, "bbox");
    double box[4];
    q->region = request_parameter(r, "wkt");
    if (!bbox) return true;
    if (q->region) {
        answer_problem(r, MHD_HTTP_BAD_REQUEST, "bbox and wkt are two regions: one of them");
        return false;
    }
    if (!read_box(bbox, box)) return refuse(r, "bbox", "four numbers: x0,y0,x1,y1");
    snprintf(q->outline, sizeof q->outline,
             "POLYGON((%.17g %.17g,%.17g %.17g,%.17g %.17g,%.17g %.17g,%.17g %.17g))", box[0], box[1], box[2],
             box[1], box[2], box[3], box[0], box[3], box[0], box[1]);
    q->region = q->outline;
    return make_box(r, t, box, q);
}

bool query_read(request *r, const terrain *t, query *q) {
    *q = (query){.request = r};
    if (check_numbers(r) && read_region(r, t, q) && read_options(r, q)) return true;
    query_free(q);
    return false;
}

void query_bind(const query *q, sqlite3_stmt *statement) {
    static const char *const texts[] = {"line", "camera"}, *const numbers[] = {"eps", "eps_from", "eps_to", "x",
                                                                               "y"};
    const request *r = q->request;
    for (int i = 1, n = sqlite3_bind_parameter_count(statement); i <= n; i++) {
        const char *name = sqlite3_bind_parameter_name(statement, i) + 1, *value = request_parameter(r, name);
        double number = 0;
        if (strcmp(name, "region") == 0 && q->box)
            sqlite3_bind_blob(statement, i, q->box, q->size, SQLITE_STATIC);
        else if (strcmp(name, "region") == 0)
            sqlite3_bind_text(statement, i, q->region, -1, SQLITE_STATIC);
        else if (strcmp(name, "terrain") == 0)
            sqlite3_bind_text(statement, i, r->terrain, -1, SQLITE_STATIC);
        else if (strcmp(name, "options") == 0)
            sqlite3_bind_text(statement, i, q->options, -1, SQLITE_STATIC);
        else if (strcmp(name, "format") == 0)
            sqlite3_bind_text(statement, i, q->format, -1, SQLITE_STATIC);
        for (size_t k = 0; k < sizeof texts / sizeof *texts; k++)
            if (strcmp(name, texts[k]) == 0) sqlite3_bind_text(statement, i, value, -1, SQLITE_STATIC);
        for (size_t k = 0; k < sizeof numbers / sizeof *numbers; k++)
            if (strcmp(name, numbers[k]) == 0 && (!value || number_read(value, &number)))
                sqlite3_bind_double(statement, i, number); /* one that may be left out is 0 then */
    }
}

void query_free(query *q) {
    free(q->box);
    cJSON_free(q->options);
    *q = (query){0};
}
