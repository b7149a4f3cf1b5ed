/* verify_table.c - rqt_verify: hands the returned triangles and the stored samples to the independent verifier. */
#include "promise.h"

#include <math.h>
#include <string.h>

typedef struct proof {
    verify_report report;
    int64_t half_cells; /* valid ones of the whole raster; -1 when the region is less */
    double x, y;
    double achieved_eps;
} proof;

static void column(void *data, size_t row, int n, sqlite3_context *result) {
    (void)row;
    const proof *p = data;
    const verify_report *r = &p->report;
    switch (n) {
    case 0:
        sqlite3_result_int64(result, (sqlite3_int64)r->samples);
        break;
    case 1:
        sqlite3_result_int64(result, (sqlite3_int64)r->vertices);
        break;
    case 2:
        sqlite3_result_int64(result, (sqlite3_int64)r->triangles);
        break;
    case 3:
        sqlite3_result_double(result, r->max_error);
        break;
    case 4:
        sqlite3_result_double(result, r->rms_error);
        break;
    case 5:
        if (r->samples) sqlite3_result_double(result, p->x);
        break;
    case 6:
        if (r->samples) sqlite3_result_double(result, p->y);
        break;
    case 7:
        sqlite3_result_int64(result, (sqlite3_int64)r->t_junctions);
        break;
    case 8:
        sqlite3_result_int64(result, (sqlite3_int64)r->overlaps);
        break;
    case 9:
        sqlite3_result_int64(result, (sqlite3_int64)r->uncovered);
        break;
    case 10:
        sqlite3_result_double(result, r->area);
        break;
    case 11:
        sqlite3_result_int64(result, (sqlite3_int64)r->void_touched);
        break;
    case 12:
        sqlite3_result_int64(result, (sqlite3_int64)r->twice_area);
        break;
    case 14:
        sqlite3_result_double(result, p->achieved_eps);
        break;
    default:
        if (p->half_cells >= 0) sqlite3_result_int64(result, p->half_cells);
        break;
    }
}

static void grow_box(int32_t box[4], double col, double row) {
    if (col < box[0]) box[0] = (int32_t)floor(col);
    if (row < box[1]) box[1] = (int32_t)floor(row);
    if (col > box[2]) box[2] = (int32_t)ceil(col);
    if (row > box[3]) box[3] = (int32_t)ceil(row);
}

/* The triangles as the verifier takes them, one way or the other. */
typedef struct evidence {
    verify_triangle *triangles;
    verify_free_triangle *free_triangles; /* mode cut */
    size_t count;
    int32_t box[4]; /* of region and mesh: west, north, east, south */
} evidence;

static int take_patch(request *r, evidence *e, char **error) {
    promise_mesh mesh;
    const int code = promise_mesh_take(r, &mesh, error);
    e->count = mesh.count;
    e->triangles = mesh.triangles;
    for (size_t i = 0; i < 3 * e->count; i++) {
        const verify_corner *v = &e->triangles[i / 3].corner[i % 3];
        grow_box(e->box, v->col, v->row);
    }
    return code;
}

static int take_cut(request *r, evidence *e, char **error) {
    rqt_cut cut;
    int code = request_cut(r, &cut, error);
    if (code != SQLITE_OK) return code;
    e->count = cut.triangle_count;
    e->free_triangles = sqlite3_malloc64((e->count + 1) * sizeof *e->free_triangles);
    if (!e->free_triangles) code = SQLITE_NOMEM;
    for (size_t i = 0; code == SQLITE_OK && i < 3 * e->count; i++) {
        const rqt_cut_vertex *v = &cut.vertices[cut.triangles[i]];
        e->free_triangles[i / 3].corner[i % 3] = (verify_free_corner){v->col, v->row, v->q};
        grow_box(e->box, v->col, v->row);
    }
    rqt_cut_free(&cut);
    return code;
}

static int judge(const request *r, const evidence *e, proof *p, char **error) {
    const store_terrain *t = r->terrain;
    promise window;
    const int code = promise_begin(&window, r, e->box, error);
    verify_status status = VERIFY_OK;
    if (code == SQLITE_OK) {
        if (rqt_region_is_all(r->region)) p->half_cells = promise_half_cells(&window);
        const verify_samples given = {.col0 = window.col,
                                      .row0 = window.row,
                                      .width = window.width,
                                      .height = window.height,
                                      .q = window.q,
                                      .valid = window.valid,
                                      .quantum = fabs(rqt_unit_factor(&t->unit)) / (double)t->unit.d,
                                      .cell_x = t->placement.dx,
                                      .cell_y = t->placement.dy,
                                      .is_promised = promise_holds,
                                      .context = &window};
        status = e->free_triangles ? verify_free_mesh(&given, e->free_triangles, e->count, &p->report)
                                   : verify_mesh(&given, e->triangles, e->count, &p->report);
        p->x = t->placement.x0 + p->report.worst_col * t->placement.dx;
        p->y = t->placement.y0 + p->report.worst_row * t->placement.dy;
    }
    const int stopped = window.code;
    promise_free(&window);
    if (status == VERIFY_NO_MEMORY) return SQLITE_NOMEM;
    if (stopped != SQLITE_OK) return stopped;
    return status == VERIFY_INVALID ? fail(error, "the mesh leaves the raster") : code;
}

static int prove(request *r, proof *p, char **error) {
    evidence e = {0};
    /* outside the terrain nothing is claimed */
    const bool meets = rqt_region_box(r->region, &e.box[0], &e.box[1], &e.box[2], &e.box[3]);
    int code = r->mode == REQUEST_CUT ? take_cut(r, &e, error) : take_patch(r, &e, error);
    p->achieved_eps = r->achieved_eps;
    if (code == SQLITE_OK && meets) code = judge(r, &e, p, error);
    sqlite3_free(e.triangles);
    sqlite3_free(e.free_triangles);
    return code;
}

int fill_verify(connection *c, sqlite3_value **arguments, row_set *rows, char **error) {
    request r;
    int code = request_read(c, arguments[0], arguments[1], arguments[2], arguments[3], REQUEST_COVER, &r, error);
    if (code != SQLITE_OK) return code;
    proof *p = sqlite3_malloc(sizeof *p);
    code = p ? SQLITE_OK : SQLITE_NOMEM;
    if (p) {
        memset(p, 0, sizeof *p);
        p->half_cells = -1;
        code = prove(&r, p, error);
    }
    request_free(&r);
    if (code != SQLITE_OK) {
        sqlite3_free(p);
        return code;
    }
    *rows = (row_set){.count = 1, .data = p, .column = column, .release = sqlite3_free};
    return SQLITE_OK;
}
