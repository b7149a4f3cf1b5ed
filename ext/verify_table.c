/* verify_table.c - rqt_verify: hands the returned triangles and the stored samples to the independent verifier. */
#include "functions.h"

#include "verify.h"

#include <math.h>
#include <string.h>

typedef struct window {
    int32_t col, row, width, height;
    int32_t *q;
    uint8_t *valid;
    const rqt_region *region;
} window;

typedef struct proof {
    verify_report report;
    int64_t half_cells; /* valid ones of the whole raster; -1 when the region is less */
    double x, y;
    double achieved_eps;
} proof;

static bool is_valid(const window *w, int32_t col, int32_t row) {
    if (col < w->col || row < w->row || col >= w->col + w->width || row >= w->row + w->height) return false;
    return w->valid[(size_t)(row - w->row) * (size_t)w->width + (size_t)(col - w->col)] != 0;
}

/* The outline's promise: a sample inside the region that is a corner of a unit half cell with three valid corners.
 * The window has a margin of one sample, so that all cells around are known. */
static bool is_promised(void *context, int32_t col, int32_t row) {
    const window *w = context;
    if (!is_valid(w, col, row) || !rqt_region_contains(w->region, (rqt_vertex){col, row})) return false;
    for (int cell = 0; cell < 4; cell++) {
        const int32_t x = col - (cell & 1), y = row - (cell >> 1); /* the cell's north-west corner */
        const bool nw = is_valid(w, x, y), ne = is_valid(w, x + 1, y), sw = is_valid(w, x, y + 1),
                   se = is_valid(w, x + 1, y + 1);
        const int voids = !nw + !ne + !sw + !se;
        if (voids == 0) return true;
        if (voids > 1) continue;
        /* With one void corner, the half without it survives if that corner is off the diagonal; its three corners
         * are then all the valid ones, this sample among them. */
        const bool main_diagonal = ((x + y) & 1) == 0;
        if (main_diagonal ? nw && se : ne && sw) return true;
    }
    return false;
}

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

/* Unit half cells with three valid corners in the window: what the outline `exact` covers, no more and no less. */
static int64_t count_half_cells(const window *w) {
    int64_t count = 0;
    for (int32_t y = w->row; y < w->row + w->height - 1; y++)
        for (int32_t x = w->col; x < w->col + w->width - 1; x++) {
            const bool nw = is_valid(w, x, y), ne = is_valid(w, x + 1, y), sw = is_valid(w, x, y + 1),
                       se = is_valid(w, x + 1, y + 1);
            const bool main_diagonal = ((x + y) & 1) == 0;
            if (main_diagonal ? nw && se : ne && sw) count += main_diagonal ? ne + sw : nw + se;
        }
    return count;
}

/* The box of everything that is asked about: region and patch, with a margin of one. */
static bool find_window(const request *r, const rqt_patch *patch, window *w) {
    int32_t x0, y0, x1, y1;
    if (!rqt_region_box(r->region, &x0, &y0, &x1, &y1)) return false;
    for (size_t i = 0; i < patch->vertex_count; i++) {
        const rqt_patch_vertex *v = &patch->vertices[i];
        if (v->col < x0) x0 = v->col;
        if (v->col > x1) x1 = v->col;
        if (v->row < y0) y0 = v->row;
        if (v->row > y1) y1 = v->row;
    }
    const rqt_lattice *lattice = &r->terrain->lattice;
    x0 -= x0 > 0;
    y0 -= y0 > 0;
    x1 += x1 < lattice->width - 1;
    y1 += y1 < lattice->height - 1;
    *w = (window){.col = x0, .row = y0, .width = x1 - x0 + 1, .height = y1 - y0 + 1, .region = r->region};
    return true;
}

static int prove(request *r, proof *p, char **error) {
    rqt_patch patch;
    int code = request_patch(r, RQT_PRODUCT_TRIANGLES, &patch, NULL, error);
    if (code != SQLITE_OK) return code;
    p->achieved_eps = r->achieved_eps;
    window w;
    if (!find_window(r, &patch, &w)) return SQLITE_OK; /* outside the terrain: nothing is claimed */
    const sqlite3_uint64 samples = (sqlite3_uint64)w.width * (sqlite3_uint64)w.height;
    w.q = sqlite3_malloc64(samples * sizeof *w.q);
    w.valid = sqlite3_malloc64(samples);
    verify_triangle *triangles = sqlite3_malloc64((patch.triangle_count + 1) * sizeof *triangles);
    code = w.q && w.valid && triangles ? SQLITE_OK : SQLITE_NOMEM;
    if (code == SQLITE_OK)
        code = store_window(r->store, r->terrain, w.col, w.row, w.width, w.height, w.q, w.valid, error);
    if (code == SQLITE_OK) {
        for (size_t i = 0; i < 3 * patch.triangle_count; i++) {
            const rqt_patch_vertex *v = &patch.vertices[patch.triangles[i]];
            triangles[i / 3].corner[i % 3] = (verify_corner){v->col, v->row, v->q};
        }
        if (rqt_region_is_all(r->region)) p->half_cells = count_half_cells(&w);
        const store_terrain *t = r->terrain;
        const verify_samples given = {.col0 = w.col,
                                      .row0 = w.row,
                                      .width = w.width,
                                      .height = w.height,
                                      .q = w.q,
                                      .valid = w.valid,
                                      .quantum = fabs(rqt_unit_factor(&t->unit)) / (double)t->unit.d,
                                      .cell_x = t->placement.dx,
                                      .cell_y = t->placement.dy,
                                      .is_promised = is_promised,
                                      .context = &w};
        const verify_status status = verify_mesh(&given, triangles, patch.triangle_count, &p->report);
        if (status == VERIFY_NO_MEMORY) code = SQLITE_NOMEM;
        if (status == VERIFY_INVALID) code = fail(error, "the mesh leaves the raster");
        p->x = t->placement.x0 + p->report.worst_col * t->placement.dx;
        p->y = t->placement.y0 + p->report.worst_row * t->placement.dy;
    }
    sqlite3_free(w.q);
    sqlite3_free(w.valid);
    sqlite3_free(triangles);
    store_keep(r->store, &patch);
    return code;
}

int fill_verify(connection *c, sqlite3_value **arguments, row_set *rows, char **error) {
    request r;
    int code = request_read(c, arguments[0], arguments[1], arguments[2], arguments[3], &r, error);
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
