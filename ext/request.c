/* request.c - region and eps, or a camera, with terrain and options out of SQL values: one reading of them for
 * every function. */
#include "view.h"

#include <cjson/cJSON.h>
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

int request_region(const request *r, rqt_geometry *geometry, const char *what, rqt_region **region, char **error) {
    const store_terrain *t = r->terrain;
    const double first = t->placement.x0, last = first + (t->lattice.width - 1) * t->placement.dx;
    rqt_status status = RQT_OK;
    if (geometry && t->lonlat) status = rqt_geometry_repeat(geometry, 360, fmin(first, last), fmax(first, last));
    if (status == RQT_OK)
        status = rqt_region_create(geometry, &t->placement, &t->lattice, store_allocator(), region);
    if (status == RQT_OK) return SQLITE_OK;
    return status == RQT_NO_MEMORY ? SQLITE_NOMEM : fail(error, "%s cannot be placed on terrain %s", what, t->name);
}

static int read_region(request *r, sqlite3_value *value, char **error) {
    const store_terrain *t = r->terrain;
    int code = request_geometry(r->connection, t, value, "region", &r->geometry, error);
    if (code != SQLITE_OK) return code;
    code = request_region(r, r->geometry, "region", &r->region, error);
    if (code != SQLITE_OK || r->mode != REQUEST_SNAP) return code;
    rqt_region *drawn = r->region;
    const rqt_status status = rqt_region_snap(drawn, &t->lattice, store_allocator(), &r->region);
    rqt_region_free(drawn);
    return status == RQT_OK ? SQLITE_OK : SQLITE_NOMEM;
}

/* Options and terrain; what is asked for comes next. */
static int begin(connection *c, sqlite3_value *terrain, sqlite3_value *options, request *r, char **error) {
    r->options = (store_query_options){.select = RQT_SELECT_THRESHOLD,
                                       .outline = r->view ? RQT_OUTLINE_TOL : RQT_OUTLINE_EXACT};
    r->achieved_eps = r->eps;
    int code = SQLITE_OK;
    if (options && sqlite3_value_type(options) != SQLITE_NULL) {
        const char *json = (const char *)sqlite3_value_text(options);
        code = json ? options_read(json, r, error) : SQLITE_NOMEM;
    }
    if (code == SQLITE_OK && r->mode == REQUEST_CUT && (r->max_vertices > 0 || r->fans))
        code =
            fail(error, "option \"%s\" does not go with mode \"cut\"", r->fans ? "strip\":\"fan" : "max_vertices");
    if (code == SQLITE_OK && r->mode == REQUEST_CUT && r->frame_kind != FRAME_CRS)
        code = fail(error, "option \"frame\" does not go with mode \"cut\"");
    const char *of_views = r->has_test            ? "test"
                           : r->has_cover         ? "cover"
                           : r->max_triangles > 0 ? "max_triangles"
                           : r->previous          ? "previous"
                                                  : NULL;
    if (code == SQLITE_OK && of_views && !r->view) code = fail(error, "option \"%s\" is for views", of_views);
    if (code == SQLITE_OK) code = connection_store(c, &r->store, error);
    if (code == SQLITE_OK) r->connection = c;
    if (code == SQLITE_OK) code = request_terrain(r->store, terrain, &r->terrain, error);
    return code;
}

/* What selects, when it is known what is asked for. */
static int finish(request *r, int code, char **error) {
    if (code == SQLITE_OK) code = rule_read(r, error);
    if (code == SQLITE_OK) code = frame_read(r, error);
    if (code != SQLITE_OK) request_free(r);
    return code;
}

int request_read(connection *c, sqlite3_value *region, sqlite3_value *eps, sqlite3_value *terrain,
                 sqlite3_value *options, request_mode usual, request *r, char **error) {
    *r = (request){.mode = usual};
    if (!request_number(eps, "eps", &r->eps, error)) return *error ? SQLITE_ERROR : SQLITE_NOMEM;
    if (r->eps < 0) return fail(error, "eps must be 0 or more; it is %!.15g", r->eps);
    int code = begin(c, terrain, options, r, error);
    if (code == SQLITE_OK) code = read_region(r, region, error);
    return finish(r, code, error);
}

int request_read_view(connection *c, sqlite3_value *camera, sqlite3_value *terrain, sqlite3_value *options,
                      request *r, char **error) {
    return request_follow_view(c, camera, terrain, options, VIEW_ANSWER, r, error);
}

int request_follow_view(connection *c, sqlite3_value *camera, sqlite3_value *terrain, sqlite3_value *options,
                        view_wants wants, request *r, char **error) {
    *r = (request){.mode = REQUEST_COVER, .eps = INFINITY};
    int code = view_create(camera, &r->view, error);
    if (code == SQLITE_OK) code = begin(c, terrain, options, r, error);
    if (code == SQLITE_OK) code = view_place(r, error);
    if (code == SQLITE_OK) code = view_settle(r, wants, error);
    if (code != SQLITE_OK) request_free(r);
    return code;
}

static void free_selection(request *r) {
    frame_free(r->frame);
    rule_free(r);
    rqt_region_free(r->region);
    r->frame = NULL;
    r->region = NULL;
}

int request_select_view(request *r, char **error) {
    free_selection(r);
    int code = view_field(r, error);
    if (code == SQLITE_OK) code = rule_read(r, error);
    return code == SQLITE_OK ? frame_read(r, error) : code;
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

int32_t request_srid(const request *r) {
    return r->frame_kind == FRAME_CRS ? r->terrain->srid : r->frame_kind == FRAME_ECEF ? 4978 : 0;
}

void request_free(request *r) {
    free_selection(r);
    view_free(r->view);
    cJSON_Delete(r->detail);
    sqlite3_free(r->previous);
    rqt_geometry_free(r->geometry);
    if (r->connection) connection_done(r->connection);
    *r = (request){0};
}
