/* mesh_tables.c - rqt_range, rqt_triangles, rqt_strip: one patch, three ways to say it in rows. */
#include "functions.h"

#include "format.h"

#include <string.h>

typedef struct mesh {
    rqt_patch patch;
    format_frame frame;
    uint32_t *strip;
    double achieved_eps;
} mesh;

static void release(void *data) {
    mesh *m = data;
    rqt_patch_free(&m->patch);
    sqlite3_free(m->strip);
    sqlite3_free(m);
}

static void put_coordinate(const mesh *m, uint32_t vertex, int which, sqlite3_context *result) {
    double xyz[3];
    format_coordinates(&m->frame, &m->patch.vertices[vertex], xyz);
    sqlite3_result_double(result, xyz[which]);
}

/* The mesh of the arguments, not yet as rows. */
static int make_mesh(connection *c, sqlite3_value **arguments, bool strip, row_set *rows, mesh **out,
                     char **error) {
    request r;
    int code = request_read(c, arguments[0], arguments[1], arguments[2], arguments[3], &r, error);
    if (code != SQLITE_OK) return code;
    mesh *m = sqlite3_malloc(sizeof *m);
    code = m ? SQLITE_OK : SQLITE_NOMEM;
    if (m) {
        memset(m, 0, sizeof *m);
        m->frame = (format_frame){.placement = r.terrain->placement, .unit = r.terrain->unit, .eps = r.eps};
        code = request_patch(&r, &m->patch, NULL, error);
        m->achieved_eps = r.achieved_eps;
    }
    size_t indices = 0;
    if (code == SQLITE_OK && strip) code = request_strip(&r, &m->patch, &m->strip, &indices);
    request_free(&r);
    if (code != SQLITE_OK) {
        if (m) release(m);
        return code;
    }
    rows->data = m;
    rows->release = release;
    rows->count = indices;
    *out = m;
    return SQLITE_OK;
}

static void range_column(void *data, size_t row, int column, sqlite3_context *result) {
    const mesh *m = data;
    const rqt_patch_vertex *v = &m->patch.vertices[row];
    if (column < 3)
        put_coordinate(m, (uint32_t)row, column, result);
    else if (column == 3)
        sqlite3_result_double(result, rqt_code_metres(v->error));
    else if (column == 4)
        sqlite3_result_int(result, v->level);
    else if (column == 8)
        sqlite3_result_double(result, m->achieved_eps);
    else
        sqlite3_result_int(result, column == 5 ? v->col : column == 6 ? v->row : v->q);
}

int fill_range(connection *c, sqlite3_value **arguments, row_set *rows, char **error) {
    mesh *m;
    const int code = make_mesh(c, arguments, false, rows, &m, error);
    if (code != SQLITE_OK) return code;
    rows->count = m->patch.vertex_count;
    rows->column = range_column;
    return SQLITE_OK;
}

static void triangles_column(void *data, size_t row, int column, sqlite3_context *result) {
    const mesh *m = data;
    if (column == 0)
        sqlite3_result_int64(result, (sqlite3_int64)row + 1);
    else if (column == 10)
        sqlite3_result_double(result, m->achieved_eps);
    else
        put_coordinate(m, m->patch.triangles[3 * row + (size_t)(column - 1) / 3], (column - 1) % 3, result);
}

int fill_triangles(connection *c, sqlite3_value **arguments, row_set *rows, char **error) {
    mesh *m;
    const int code = make_mesh(c, arguments, false, rows, &m, error);
    if (code != SQLITE_OK) return code;
    rows->count = m->patch.triangle_count;
    rows->column = triangles_column;
    return SQLITE_OK;
}

static void strip_column(void *data, size_t row, int column, sqlite3_context *result) {
    const mesh *m = data;
    if (column == 0)
        sqlite3_result_int64(result, (sqlite3_int64)row);
    else if (column == 4)
        sqlite3_result_double(result, m->achieved_eps);
    else
        put_coordinate(m, m->strip[row], column - 1, result);
}

int fill_strip(connection *c, sqlite3_value **arguments, row_set *rows, char **error) {
    mesh *m;
    const int code = make_mesh(c, arguments, true, rows, &m, error);
    if (code == SQLITE_OK) rows->column = strip_column;
    return code;
}
