/* mesh_tables.c - rqt_range, rqt_triangles, rqt_strip, and rqt_view, rqt_view_triangles, rqt_view_strip: one patch,
 * three ways to say it in rows. Functions of views have columns of their own behind those that all have. */
#include "view.h"

#include "format.h"

#include <math.h>
#include <string.h>

typedef struct mesh {
    rqt_patch patch;
    bool is_cut; /* then vertices and triangles are those of `cut`, the strip is in patch all the same */
    rqt_cut cut;
    format_frame frame;
    double factor; /* rqt_unit_factor */
    store *store;  /* lives as long as the table does */
    mesh_told told;
    double *from;   /* of a view, if asked for: heights in quanta that vertices come from, NaN: they do not move */
    uint32_t *ends; /* and the ends of the edges that they halve */
    double *xyz;    /* of each vertex, in a frame of its own; NULL: the terrain's CRS */
} mesh;

static void release(void *data) {
    mesh *m = data;
    store_keep(m->store, &m->patch);
    sqlite3_free(m->xyz);
    sqlite3_free(m->told.token);
    sqlite3_free(m->from);
    sqlite3_free(m->ends);
    rqt_cut_free(&m->cut);
    sqlite3_free(m);
}

static double metres(const mesh *m, double q) {
    const rqt_unit *unit = &m->frame.unit;
    return ((double)unit->z0 + q / (double)unit->d) * m->factor + unit->offset;
}

/* As format_coordinates says them, but only the one. */
static double coordinate(const mesh *m, uint32_t vertex, int which) {
    const rqt_placement *at = &m->frame.placement;
    double col, row, q;
    if (m->xyz) return m->xyz[3 * (size_t)vertex + (size_t)which];
    if (m->is_cut) {
        const rqt_cut_vertex *v = &m->cut.vertices[vertex];
        col = v->col, row = v->row, q = v->q;
    } else {
        const rqt_patch_vertex *v = &m->patch.vertices[vertex];
        col = v->col, row = v->row, q = v->q;
    }
    if (which == 0) return at->x0 + col * at->dx;
    if (which == 1) return at->y0 + row * at->dy;
    return metres(m, q);
}

static void put_coordinate(const mesh *m, uint32_t vertex, int which, sqlite3_context *result) {
    sqlite3_result_double(result, coordinate(m, vertex, which));
}

/* A vertex as POINT Z, or the three of a triangle as POLYGON Z, in GeoPackage's bytes. */
static void put_geometry(const mesh *m, const uint32_t *vertices, int count, sqlite3_context *result) {
    double xyz[3][3];
    uint8_t bytes[FORMAT_TRIANGLE_BYTES];
    for (int i = 0; i < 3 * count; i++) xyz[i / 3][i % 3] = coordinate(m, vertices[i / 3], i % 3);
    const size_t size = count == 1 ? format_point_gpkg(xyz[0], m->frame.srid, bytes)
                                   : format_triangle_gpkg((const double(*)[3])xyz, m->frame.srid, bytes);
    sqlite3_result_blob(result, bytes, (int)size, SQLITE_TRANSIENT);
}

/* The strip of a cut, where a patch has its own. */
static int make_cut(request *r, rqt_product product, mesh *m, char **error) {
    m->is_cut = true;
    const int code = request_cut(r, &m->cut, error);
    if (code != SQLITE_OK || product != RQT_PRODUCT_STRIP) return code;
    const rqt_patch triangles = {.triangles = m->cut.triangles, .triangle_count = m->cut.triangle_count};
    m->patch.allocator = *store_allocator();
    if (rqt_strip_build(&triangles, store_allocator(), &m->patch.strip, &m->patch.strip_count) != RQT_OK)
        return SQLITE_NOMEM;
    m->patch.strip_capacity = m->patch.strip_count;
    return SQLITE_OK;
}

/* The mesh of the arguments, not yet as rows. */
#define MORPH_COLUMNS (UINT32_C(15) << 9) /* of rqt_view: parent_a, parent_b, z_from, weight */

static int make_mesh(connection *c, bool is_view, sqlite3_value **arguments, rqt_product product, row_set *rows,
                     mesh **out, char **error) {
    request r;
    const bool morphs = is_view && product == RQT_PRODUCT_VERTICES && rows->used & MORPH_COLUMNS;
    int code =
        is_view ? request_follow_view(c, arguments[0], arguments[1], arguments[2],
                                      morphs ? VIEW_MORPH : VIEW_ANSWER, &r, error)
                : request_read(c, arguments[0], arguments[1], arguments[2], arguments[3], REQUEST_COVER, &r, error);
    if (code != SQLITE_OK) return code;
    mesh *m = sqlite3_malloc(sizeof *m);
    code = m ? SQLITE_OK : SQLITE_NOMEM;
    if (m) {
        memset(m, 0, sizeof *m);
        m->frame =
            (format_frame){.placement = r.terrain->placement, .unit = r.terrain->unit, .srid = request_srid(&r)};
        m->factor = rqt_unit_factor(&m->frame.unit);
        m->store = r.store;
        /* At a pole triangles vanish, which only those that are listed can. */
        if (r.frame && product == RQT_PRODUCT_VERTICES) product = RQT_PRODUCT_TRIANGLES;
        code = r.mode == REQUEST_CUT ? make_cut(&r, product, m, error)
                                     : request_patch(&r, product, &m->patch, NULL, error);
        if (code == SQLITE_OK) code = request_tell(&r, m->is_cut ? NULL : &m->patch, &m->told, error);
        if (code == SQLITE_OK && morphs && !r.frame) code = view_morph(&r, &m->patch, &m->from, &m->ends, error);
        if (code == SQLITE_OK && r.frame) {
            code = frame_merge(r.frame, &m->patch);
            if (code == SQLITE_OK) code = frame_places(r.frame, &m->patch, &m->xyz, error);
        }
        m->told.vertices = m->is_cut ? m->cut.vertex_count : m->patch.vertex_count;
        m->told.triangles = m->is_cut ? m->cut.triangle_count : m->patch.triangle_count;
    }
    request_free(&r);
    if (code != SQLITE_OK) {
        if (m) release(m);
        return code;
    }
    rows->data = m;
    rows->release = release;
    rows->count = m->patch.strip_count;
    *out = m;
    return SQLITE_OK;
}

/* Of which a vertex that is no sample of the mesh has no level, and places and heights that are not whole. */
static void cut_column(const mesh *m, size_t row, int column, sqlite3_context *result) {
    const rqt_cut_vertex *v = &m->cut.vertices[row];
    const bool is_sample = v->level >= 0;
    if (column == 3)
        sqlite3_result_double(result, rqt_code_metres(v->error));
    else if (column == 4 && is_sample)
        sqlite3_result_int(result, v->level);
    else if (column >= 5) {
        const double value = column == 5 ? v->col : column == 6 ? v->row : v->q;
        if (is_sample)
            sqlite3_result_int(result, (int)value);
        else
            sqlite3_result_double(result, value);
    }
}

static void patch_column(const mesh *m, size_t row, int column, sqlite3_context *result) {
    const rqt_patch_vertex *v = &m->patch.vertices[row];
    if (column == 3)
        sqlite3_result_double(result, rqt_code_metres(v->error));
    else
        sqlite3_result_int(result, column == 4 ? v->level : column == 5 ? v->col : column == 6 ? v->row : v->q);
}

/* parent_a, parent_b, z_from, weight: NULL in a frame of its own. */
static void morph_column(const mesh *m, size_t row, int which, sqlite3_context *result) {
    if (!m->from) return;
    const double own = m->patch.vertices[row].q, from = isnan(m->from[row]) ? own : m->from[row];
    if (which < 2 && m->ends[2 * row + (size_t)which] != RQT_NO_VERTEX)
        sqlite3_result_int64(result, (sqlite3_int64)m->ends[2 * row + (size_t)which] + 1);
    else if (which == 2)
        sqlite3_result_double(result, metres(m, from));
    else if (which == 3)
        sqlite3_result_int(result, from == own);
}

static void range_column(void *data, size_t row, int column, sqlite3_context *result) {
    const mesh *m = data;
    if (column > 8 + told_columns(m->told.is_view))
        morph_column(m, row, column - 9 - told_columns(m->told.is_view), result);
    else if (column < 3)
        put_coordinate(m, (uint32_t)row, column, result);
    else if (column == 8 + told_columns(m->told.is_view))
        put_geometry(m, &(const uint32_t){(uint32_t)row}, 1, result);
    else if (column >= 8)
        put_told(&m->told, column - 8, result);
    else if (m->is_cut)
        cut_column(m, row, column, result);
    else
        patch_column(m, row, column, result);
}

static int fill_vertices(connection *c, bool is_view, sqlite3_value **arguments, row_set *rows, char **error) {
    mesh *m;
    const int code = make_mesh(c, is_view, arguments, RQT_PRODUCT_VERTICES, rows, &m, error);
    if (code != SQLITE_OK) return code;
    rows->count = m->is_cut ? m->cut.vertex_count : m->patch.vertex_count;
    rows->column = range_column;
    return SQLITE_OK;
}

int fill_range(connection *c, sqlite3_value **arguments, row_set *rows, char **error) {
    return fill_vertices(c, false, arguments, rows, error);
}

int fill_view(connection *c, sqlite3_value **arguments, row_set *rows, char **error) {
    return fill_vertices(c, true, arguments, rows, error);
}

static void triangles_column(void *data, size_t row, int column, sqlite3_context *result) {
    const mesh *m = data;
    const uint32_t *corners = (m->is_cut ? m->cut.triangles : m->patch.triangles) + 3 * row;
    if (column == 0)
        sqlite3_result_int64(result, (sqlite3_int64)row + 1);
    else if (column < 10)
        put_coordinate(m, corners[(column - 1) / 3], (column - 1) % 3, result);
    else if (column == 10 + told_columns(m->told.is_view))
        put_geometry(m, corners, 3, result);
    else
        put_told(&m->told, column - 10, result);
}

static int fill_faces(connection *c, bool is_view, sqlite3_value **arguments, row_set *rows, char **error) {
    mesh *m;
    const int code = make_mesh(c, is_view, arguments, RQT_PRODUCT_TRIANGLES, rows, &m, error);
    if (code != SQLITE_OK) return code;
    rows->count = m->is_cut ? m->cut.triangle_count : m->patch.triangle_count;
    rows->column = triangles_column;
    return SQLITE_OK;
}

int fill_triangles(connection *c, sqlite3_value **arguments, row_set *rows, char **error) {
    return fill_faces(c, false, arguments, rows, error);
}

int fill_view_triangles(connection *c, sqlite3_value **arguments, row_set *rows, char **error) {
    return fill_faces(c, true, arguments, rows, error);
}

static void strip_column(void *data, size_t row, int column, sqlite3_context *result) {
    const mesh *m = data;
    if (column == 0)
        sqlite3_result_int64(result, (sqlite3_int64)row);
    else if (column >= 4)
        put_told(&m->told, column - 4, result);
    else
        put_coordinate(m, m->patch.strip[row], column - 1, result);
}

static int fill_joined(connection *c, bool is_view, sqlite3_value **arguments, row_set *rows, char **error) {
    mesh *m;
    const int code = make_mesh(c, is_view, arguments, RQT_PRODUCT_STRIP, rows, &m, error);
    if (code == SQLITE_OK) rows->column = strip_column;
    return code;
}

int fill_strip(connection *c, sqlite3_value **arguments, row_set *rows, char **error) {
    return fill_joined(c, false, arguments, rows, error);
}

int fill_view_strip(connection *c, sqlite3_value **arguments, row_set *rows, char **error) {
    return fill_joined(c, true, arguments, rows, error);
}
