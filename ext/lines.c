/* lines.c - lines as arguments, and what a metre is on a terrain. */
#include "functions.h"

#include <math.h>
#include <string.h>

static int take_lines(const rqt_geometry *geometry, line_set *lines, char **error) {
    const size_t members = rqt_geometry_members(geometry);
    size_t n;
    if (members == 0) return fail(error, "line is empty");
    for (size_t i = 0; i < members; i++) {
        if (!rqt_geometry_line(geometry, i, &n)) return fail(error, "line is a polygon, or holds one");
        lines->points += n;
    }
    lines->srid = rqt_geometry_srid(geometry);
    lines->xy = sqlite3_malloc64(2 * lines->points * sizeof *lines->xy);
    lines->counts = sqlite3_malloc64(members * sizeof *lines->counts);
    if (!lines->xy || !lines->counts) return SQLITE_NOMEM;
    for (size_t i = 0, at = 0; i < members; i++, at += 2 * n) {
        const double *xy = rqt_geometry_line(geometry, i, &n);
        memcpy(lines->xy + at, xy, 2 * n * sizeof *xy);
        lines->counts[lines->count++] = n;
    }
    return SQLITE_OK;
}

static int parse(sqlite3_value *value, rqt_geometry **geometry, char **error) {
    const bool text = sqlite3_value_type(value) == SQLITE_TEXT;
    const void *bytes = text ? (const void *)sqlite3_value_text(value) : sqlite3_value_blob(value);
    const size_t n = (size_t)sqlite3_value_bytes(value);
    if (!bytes && n > 0) return SQLITE_NOMEM;
    rqt_message why = {""};
    const rqt_status status = rqt_geometry_parse(bytes ? bytes : "", n, text, store_allocator(), geometry, &why);
    if (status == RQT_OK) return SQLITE_OK;
    return status == RQT_NO_MEMORY ? SQLITE_NOMEM : fail(error, "line: %s", why.text);
}

int lines_read(connection *c, const store_terrain *t, sqlite3_value *value, line_set *lines, char **error) {
    *lines = (line_set){0};
    const int type = value ? sqlite3_value_type(value) : SQLITE_NULL;
    if (type != SQLITE_TEXT && type != SQLITE_BLOB)
        return fail(error, "line must be WKT text or a geometry; it is %s",
                    type == SQLITE_NULL ? "NULL" : "a number");
    rqt_geometry *geometry = NULL;
    int code = t ? request_geometry(c, t, value, "line", &geometry, error) : parse(value, &geometry, error);
    if (code == SQLITE_OK) code = take_lines(geometry, lines, error);
    rqt_geometry_free(geometry);
    if (code != SQLITE_OK) lines_free(lines);
    return code;
}

void lines_free(line_set *lines) {
    sqlite3_free(lines->xy);
    sqlite3_free(lines->counts);
    *lines = (line_set){0};
}

double terrain_metre(const store_terrain *t) {
    return t->cost.cell / fmax(fabs(t->placement.dx), fabs(t->placement.dy));
}
