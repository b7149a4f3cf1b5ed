/* options.c - the JSON object of options: which keys and values there are. */
#include "functions.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <string.h>

typedef struct choice {
    const char *key;
    const char *done; /* values that work, between blanks; "#n": an integer of n or more; "[": detail.c reads it;
                         "~": any text */
} choice;

static const choice choices[] = {
    {"mode", " cover snap border cut "},
    {"outline", " exact tol "},
    {"metric", " exact minimal local wedgie euclid plane "},
    {"select", " threshold topdown bottomup "},
    {"strip", " bintree fan "},
    {"detail", "["},
    {"max_vertices", "#4"},
    {"max_triangles", "#1"},
    {"previous", "~"},
    {"frame", " crs ecef enu "},
    {"cover", " picture terrain "},
    {"test", " guaranteed ulrich node sphere lindstrom lodmap "},
};

static bool holds(const char *words, const char *word) {
    const size_t n = strlen(word);
    if (n == 0 || strchr(word, ' ')) return false;
    for (const char *p = words; (p = strstr(p, word)) != NULL; p += n)
        if (p[-1] == ' ' && p[n] == ' ') return true;
    return false;
}

/* The value's number in the list of those that work. */
static int index_of(const choice *c, const char *value) {
    int n = 0;
    const char *const found = strstr(c->done, value);
    for (const char *p = c->done + 1; p < found; p++) n += *p == ' ';
    return n;
}

static int read_one(const cJSON *item, request *r, char **error) {
    const choice *c = NULL;
    for (size_t i = 0; i < sizeof choices / sizeof *choices; i++)
        if (strcmp(choices[i].key, item->string) == 0) c = &choices[i];
    if (!c) return fail(error, "unknown option \"%s\"", item->string);
    if (c->done[0] == '#') {
        const double n = cJSON_IsNumber(item) ? item->valuedouble : 0;
        if (!(n >= c->done[1] - '0' && n <= 9007199254740992.0 && n == floor(n)))
            return fail(error, "option \"%s\" must be an integer of %s or more", c->key, c->done + 1);
        *(strcmp(c->key, "max_vertices") == 0 ? &r->max_vertices : &r->max_triangles) = (int64_t)n;
        return SQLITE_OK;
    }
    if (c->done[0] == '~') {
        if (!cJSON_IsString(item)) return fail(error, "option \"%s\" must be a text", c->key);
        r->previous = sqlite3_mprintf("%s", item->valuestring);
        return r->previous ? SQLITE_OK : SQLITE_NOMEM;
    }
    if (c->done[0] == '[') {
        r->detail = cJSON_Duplicate(item, true);
        return r->detail ? SQLITE_OK : SQLITE_NOMEM;
    }
    if (!cJSON_IsString(item))
        return fail(error, "option \"%s\" must be a text: one of%.*s", c->key, (int)strlen(c->done) - 1, c->done);
    const char *value = item->valuestring;
    if (!holds(c->done, value))
        return fail(error, "option \"%s\" has no value \"%s\"; this version knows%.*s", c->key, value,
                    (int)strlen(c->done) - 1, c->done);
    /* The lists above are in the order of the enumerations. */
    if (strcmp(c->key, "mode") == 0) r->mode = (request_mode)index_of(c, value);
    if (strcmp(c->key, "frame") == 0) r->frame_kind = (frame_kind)index_of(c, value);
    if (strcmp(c->key, "outline") == 0) r->options.outline = (rqt_outline)index_of(c, value);
    if (strcmp(c->key, "select") == 0) r->options.select = (rqt_select)index_of(c, value);
    if (strcmp(c->key, "metric") == 0) r->options.metric = (rqt_metric)index_of(c, value), r->has_metric = true;
    if (strcmp(c->key, "cover") == 0) r->cover = (view_cover)index_of(c, value), r->has_cover = true;
    if (strcmp(c->key, "test") == 0) r->test = (rqt_view_test)index_of(c, value), r->has_test = true;
    if (strcmp(c->key, "strip") == 0) r->fans = strcmp(value, "fan") == 0;
    return SQLITE_OK;
}

int options_read(const char *json, request *r, char **error) {
    const char *end = NULL;
    cJSON *root = cJSON_ParseWithOpts(json, &end, true);
    /* cJSON does not tell bad text from no memory. A second try does, unless there is none for the sentence either.
     */
    if (!root) root = cJSON_ParseWithOpts(json, &end, true);
    if (!root) return fail(error, "options are not JSON, from here: %.40s", end ? end : json);
    int code = cJSON_IsObject(root) ? SQLITE_OK : fail(error, "options must be a JSON object");
    for (const cJSON *item = root->child; item && code == SQLITE_OK; item = item->next) {
        for (const cJSON *other = item->next; other && code == SQLITE_OK; other = other->next)
            if (strcmp(item->string, other->string) == 0)
                code = fail(error, "option \"%s\" is given twice", item->string);
        if (code == SQLITE_OK) code = read_one(item, r, error);
    }
    cJSON_Delete(root);
    return code;
}
