/* request.c - region, eps, terrain and options out of SQL values: one reading of them for every function. */
#include "functions.h"

#include <math.h>
#include <string.h>

bool request_number(sqlite3_value *value, const char *what, double *number, char **error) {
    const int type = value ? sqlite3_value_numeric_type(value) : SQLITE_NULL;
    *number = 0;
    if (type == SQLITE_INTEGER || type == SQLITE_FLOAT) {
        *number = sqlite3_value_double(value) + 0.0; /* -0.0 is 0: increments compare eps bit for bit */
        if (!isnan(*number)) return true;
    }
    (void)fail(error, "%s must be a number; it is %s", what,
               type == SQLITE_NULL ? "NULL" : (type == SQLITE_BLOB ? "a BLOB" : "text"));
    return false;
}

int request_terrain(store *s, sqlite3_value *name, const store_terrain **terrain, char **error) {
    const char *text = NULL;
    if (name && sqlite3_value_type(name) != SQLITE_NULL) {
        if (sqlite3_value_type(name) != SQLITE_TEXT) return fail(error, "terrain must be a name");
        text = (const char *)sqlite3_value_text(name);
        if (!text) return SQLITE_NOMEM;
    }
    return store_find(s, text, terrain, error);
}

int request_geometry(sqlite3_value *value, const char *what, rqt_geometry **geometry, char **error) {
    *geometry = NULL;
    const int type = value ? sqlite3_value_type(value) : SQLITE_NULL;
    if (type == SQLITE_INTEGER || type == SQLITE_FLOAT)
        return fail(error, "%s must be WKT text, a geometry or NULL; it is a number", what);
    if (type == SQLITE_NULL) return SQLITE_OK;
    const void *bytes = type == SQLITE_TEXT ? (const void *)sqlite3_value_text(value) : sqlite3_value_blob(value);
    const size_t n = (size_t)sqlite3_value_bytes(value);
    if (!bytes && n > 0) return SQLITE_NOMEM;
    rqt_message why = {""};
    const rqt_status status =
        rqt_geometry_parse(bytes ? bytes : "", n, type == SQLITE_TEXT, store_allocator(), geometry, &why);
    if (status == RQT_NO_MEMORY) return SQLITE_NOMEM;
    return status == RQT_OK ? SQLITE_OK : fail(error, "%s: %s", what, why.text);
}

int lines_read(sqlite3_value *value, line_set *lines, char **error) {
    *lines = (line_set){0};
    rqt_geometry *geometry;
    int code = request_geometry(value, "line", &geometry, error);
    if (code != SQLITE_OK) return code;
    const size_t members = geometry ? rqt_geometry_members(geometry) : 0;
    if (members == 0) {
        code = fail(error, geometry ? "line is empty" : "line must be WKT text or a geometry; it is NULL");
    } else {
        const double *xy;
        size_t n;
        for (size_t i = 0; i < members && code == SQLITE_OK; i++) {
            if (!rqt_geometry_line(geometry, i, &n)) code = fail(error, "line is a polygon, or holds one");
            lines->points += n;
        }
        if (code == SQLITE_OK) {
            lines->srid = rqt_geometry_srid(geometry);
            lines->xy = sqlite3_malloc64(2 * lines->points * sizeof *lines->xy);
            lines->counts = sqlite3_malloc64(members * sizeof *lines->counts);
            code = lines->xy && lines->counts ? SQLITE_OK : SQLITE_NOMEM;
        }
        for (size_t i = 0, at = 0; i < members && code == SQLITE_OK; i++, at += 2 * n) {
            xy = rqt_geometry_line(geometry, i, &n);
            memcpy(lines->xy + at, xy, 2 * n * sizeof *xy);
            lines->counts[lines->count++] = n;
        }
    }
    rqt_geometry_free(geometry);
    if (code != SQLITE_OK) lines_free(lines);
    return code;
}

void lines_free(line_set *lines) {
    sqlite3_free(lines->xy);
    sqlite3_free(lines->counts);
    *lines = (line_set){0};
}

int request_place(int32_t srid, const char *what, const store_terrain *t, char **error) {
    if (srid != 0 && srid != t->srid && !(srid == 4326 && t->wgs84))
        return fail(error,
                    "%s has SRID %d, terrain %s has SRID %d; transforming between them is not in this version",
                    what, srid, t->name, t->srid);
    return SQLITE_OK;
}

double terrain_metre(const store_terrain *t) {
    return t->cost.cell / fmax(fabs(t->placement.dx), fabs(t->placement.dy));
}

int request_turn(rqt_geometry *geometry, const store_terrain *t) {
    if (!t->lonlat) return SQLITE_OK;
    const double first = t->placement.x0, last = first + (t->lattice.width - 1) * t->placement.dx;
    return rqt_geometry_repeat(geometry, 360, fmin(first, last), fmax(first, last)) == RQT_OK ? SQLITE_OK
                                                                                              : SQLITE_NOMEM;
}

static int read_region(request *r, sqlite3_value *value, char **error) {
    int code = request_geometry(value, "region", &r->geometry, error);
    if (code == SQLITE_OK && r->geometry)
        code = request_place(rqt_geometry_srid(r->geometry), "region", r->terrain, error);
    if (code == SQLITE_OK && r->geometry) code = request_turn(r->geometry, r->terrain);
    if (code != SQLITE_OK) return code;
    const rqt_status status =
        rqt_region_create(r->geometry, &r->terrain->placement, &r->terrain->lattice, store_allocator(), &r->region);
    if (status == RQT_OK) return SQLITE_OK;
    return status == RQT_NO_MEMORY ? SQLITE_NOMEM
                                   : fail(error, "region cannot be placed on terrain %s", r->terrain->name);
}

int request_read(connection *c, sqlite3_value *region, sqlite3_value *eps, sqlite3_value *terrain,
                 sqlite3_value *options, request *r, char **error) {
    memset(r, 0, sizeof *r);
    if (!request_number(eps, "eps", &r->eps, error)) return *error ? SQLITE_ERROR : SQLITE_NOMEM;
    if (r->eps < 0) return fail(error, "eps must be 0 or more; it is %!.15g", r->eps);
    r->options = (store_query_options){.select = RQT_SELECT_THRESHOLD, .outline = RQT_OUTLINE_EXACT};
    r->achieved_eps = r->eps;
    int code = SQLITE_OK;
    if (options && sqlite3_value_type(options) != SQLITE_NULL) {
        const char *json = (const char *)sqlite3_value_text(options);
        code = json ? options_read(json, r, error) : SQLITE_NOMEM;
    }
    if (code == SQLITE_OK) code = connection_store(c, &r->store, error);
    if (code == SQLITE_OK) r->connection = c;
    if (code == SQLITE_OK) code = request_terrain(r->store, terrain, &r->terrain, error);
    if (code == SQLITE_OK) code = read_region(r, region, error);
    if (code != SQLITE_OK) request_free(r);
    return code;
}

int request_patch(request *r, rqt_product product, rqt_patch *patch, store_reads *reads, char **error) {
    const bool fans = r->fans && product == RQT_PRODUCT_STRIP;
    r->options.product = fans ? RQT_PRODUCT_TRIANGLES : product;
    r->options.wants_leaves = fans;
    int code = r->max_vertices == 0
                   ? store_query(r->store, r->terrain, r->region, r->eps, &r->options, patch, reads, error)
                   : store_query_within(r->store, r->terrain, r->region, r->eps, &r->options, r->max_vertices,
                                        &r->achieved_eps, patch, reads, error);
    if (code != SQLITE_OK || !fans) return code;
    const rqt_status status = rqt_strip_build_fans(patch, store_allocator(), &patch->strip, &patch->strip_count);
    patch->strip_capacity = patch->strip_count;
    return status == RQT_OK ? SQLITE_OK : SQLITE_NOMEM;
}

void request_free(request *r) {
    rqt_region_free(r->region);
    rqt_geometry_free(r->geometry);
    if (r->connection) connection_done(r->connection);
    *r = (request){0};
}
