/* promise.c - what an outline promises.
 *
 * Outline `exact`: a sample inside the region is promised when it is a corner of a unit half cell with three valid
 * corners.
 *
 * Outline `tol`: of these, the samples from which every void is further than `reach` in columns or in rows, where
 * reach is the largest extent whose cost, extent * cell / c metres as a code, is not above the code of eps. So the
 * outline moves by at most reach * cell <= c * eps metres of ground, along either axis. Proof. Let s be a corner of
 * the valid unit half cell h, and T the leaf that holds h. If T is kept, s is covered. Else T has a void corner v;
 * so T is not h, but larger, and has a split vertex, which is not selected: its error is not above eps. But T holds
 * s, which is valid, and v, which is not: it is mixed, and the error of its split vertex is at least the cost of
 * T's extent. So the extent of T is at most reach; and s and v lie in T's box. Every metric counts mixed triangles
 * so (METHODS.md), and a selection by anything larger only has more vertices.
 *
 * In a view eps differs from place to place, and so does reach. What is used of eps is that the split vertex of T
 * is not selected, so any eps of a place that s lies in will do; a drawn sample S that is further than c * eps in
 * that sense from all voids, for the eps that moves its place in the picture by tau, has to be covered.
 *
 * Voids are looked for as far as the window goes around its box; where reach is more, they are taken to be just
 * beyond.
 */
#include "promise.h"

#include <string.h>

#define MOST_REACH 1024
#define ROWS_REACH 256 /* of a view: its rows are read once for those beside them */

int promise_mesh_take(request *r, promise_mesh *mesh, char **error) {
    rqt_patch patch;
    *mesh = (promise_mesh){NULL, 0};
    int code = request_patch(r, RQT_PRODUCT_TRIANGLES, &patch, NULL, error);
    if (code != SQLITE_OK) return code;
    mesh->triangles = sqlite3_malloc64((patch.triangle_count + 1) * sizeof *mesh->triangles);
    if (!mesh->triangles) code = SQLITE_NOMEM;
    for (size_t i = 0; code == SQLITE_OK && i < 3 * patch.triangle_count; i++) {
        const rqt_patch_vertex *v = &patch.vertices[patch.triangles[i]];
        mesh->triangles[i / 3].corner[i % 3] = (verify_corner){v->col, v->row, v->q};
    }
    if (code == SQLITE_OK) mesh->count = patch.triangle_count;
    store_keep(r->store, &patch);
    return code;
}

static bool is_valid(const promise *p, int32_t col, int32_t row) {
    if (col < p->col || row < p->row || col >= p->col + p->width || row >= p->row + p->height) return false;
    return p->valid[(size_t)(row - p->row) * (size_t)p->width + (size_t)(col - p->col)] != 0;
}

/* The largest extent, in samples, that eps allows a mixed leaf. */
static int32_t reach_of(const store_terrain *t, double metres) {
    const rqt_code eps = rqt_code_eps(metres, t->quantum_error);
    int32_t low = 0, high = (1 << t->lattice.K) + 1; /* low is allowed, high is too much or cannot be */
    while (high - low > 1) {
        const int32_t middle = low + (high - low) / 2;
        if (rqt_code_from_ground(middle, t->cost.cell, t->cost.c) <= eps)
            low = middle;
        else
            high = middle;
    }
    return low;
}

static int count_voids(promise *p) {
    const size_t across = (size_t)p->width + 1;
    p->voids = sqlite3_malloc64(across * ((size_t)p->height + 1) * sizeof *p->voids);
    if (!p->voids) return SQLITE_NOMEM;
    memset(p->voids, 0, across * sizeof *p->voids);
    for (size_t y = 0; y < (size_t)p->height; y++) {
        uint32_t *above = p->voids + y * across, *here = above + across, row = 0;
        here[0] = 0;
        for (size_t x = 0; x < (size_t)p->width; x++) {
            row += !p->valid[y * (size_t)p->width + x];
            here[x + 1] = above[x + 1] + row;
        }
    }
    return SQLITE_OK;
}

static bool has_reach(const request *r) {
    return r->options.outline == RQT_OUTLINE_TOL && r->terrain->voids > 0;
}

static int begin(promise *p, const request *r, const int32_t box[4], int32_t around, char **error) {
    const rqt_lattice *lattice = &r->terrain->lattice;
    const int32_t last_col = lattice->width - 1, last_row = lattice->height - 1;
    const int32_t x0 = box[0] > around ? box[0] - around : 0, y0 = box[1] > around ? box[1] - around : 0,
                  x1 = last_col - box[2] > around ? box[2] + around : last_col,
                  y1 = last_row - box[3] > around ? box[3] + around : last_row;
    *p = (promise){.col = x0,
                   .row = y0,
                   .width = x1 - x0 + 1,
                   .height = y1 - y0 + 1,
                   .store = r->store,
                   .terrain = r->terrain,
                   .region = r->region,
                   .ends = {x0 == 0, y0 == 0, x1 == last_col, y1 == last_row}};
    const sqlite3_uint64 samples = (sqlite3_uint64)p->width * (sqlite3_uint64)p->height;
    const sqlite3_int64 most = store_limits_of(r->store)->samples;
    if (most > 0 && samples > (sqlite3_uint64)most) {
        (void)fail(error, "there are more than %lld samples under the mesh, the limit here", most);
        return *error ? SQLITE_TOOBIG : SQLITE_NOMEM;
    }
    p->q = sqlite3_malloc64(samples * sizeof *p->q);
    p->valid = sqlite3_malloc64(samples);
    int code = p->q && p->valid ? SQLITE_OK : SQLITE_NOMEM;
    if (code == SQLITE_OK)
        code = store_window(r->store, r->terrain, p->col, p->row, p->width, p->height, p->q, p->valid, error);
    if (code == SQLITE_OK && has_reach(r)) code = count_voids(p);
    return code;
}

int promise_begin(promise *p, const request *r, const int32_t box[4], char **error) {
    const int32_t reach = has_reach(r) ? reach_of(r->terrain, r->achieved_eps) : 0;
    const int code = begin(p, r, box, reach < MOST_REACH ? reach + 1 : MOST_REACH, error);
    p->reach = reach;
    return code;
}

int promise_begin_rows(promise *p, const request *r, int32_t first, int32_t last, char **error) {
    const int32_t box[4] = {0, first, r->terrain->lattice.width - 1, last};
    return begin(p, r, box, has_reach(r) ? ROWS_REACH : 1, error);
}

void promise_free(promise *p) {
    sqlite3_free(p->q);
    sqlite3_free(p->valid);
    sqlite3_free(p->voids);
    *p = (promise){0};
}

/* Is a void within reach, or may there be one past the window? */
static bool is_near_void(const promise *p, int32_t col, int32_t row, int32_t reach) {
    const int64_t x0 = (int64_t)col - p->col - reach, y0 = (int64_t)row - p->row - reach,
                  x1 = (int64_t)col - p->col + reach + 1, y1 = (int64_t)row - p->row + reach + 1;
    const bool past[4] = {x0<0, y0<0, x1> p->width, y1> p->height};
    for (int i = 0; i < 4; i++)
        if (past[i] && !p->ends[i]) return true;
    const size_t across = (size_t)p->width + 1, left = (size_t)(past[0] ? 0 : x0),
                 right = (size_t)(past[2] ? p->width : x1);
    const uint32_t *above = p->voids + (size_t)(past[1] ? 0 : y0) * across,
                   *below = p->voids + (size_t)(past[3] ? p->height : y1) * across;
    return below[right] - below[left] - above[right] + above[left] > 0;
}

static bool is_in_half_cell(const promise *p, int32_t col, int32_t row) {
    for (int cell = 0; cell < 4; cell++) {
        const int32_t x = col - (cell & 1), y = row - (cell >> 1); /* the cell's north-west corner */
        const bool nw = is_valid(p, x, y), ne = is_valid(p, x + 1, y), sw = is_valid(p, x, y + 1),
                   se = is_valid(p, x + 1, y + 1);
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

enum { ASKED_AT_A_TIME = 256 }; /* samples between two questions whether to go on */

bool promise_holds(void *context, int32_t col, int32_t row) {
    promise *p = context;
    /* A region of thousands of edges takes its time for each sample. */
    if (p->code != SQLITE_OK || (++p->asked % ASKED_AT_A_TIME == 0 && store_is_interrupted(p->store, &p->code)))
        return false;
    if (!is_valid(p, col, row) || !rqt_region_contains(p->region, (rqt_vertex){col, row})) return false;
    return is_in_half_cell(p, col, row) && (p->reach == 0 || !is_near_void(p, col, row, p->reach));
}

bool promise_holds_within(const promise *p, int32_t col, int32_t row, double metres) {
    if (!is_valid(p, col, row) || !is_in_half_cell(p, col, row)) return false;
    return !p->voids || !is_near_void(p, col, row, reach_of(p->terrain, metres));
}

int64_t promise_half_cells(const promise *p) {
    int64_t count = 0;
    for (int32_t y = p->row; y < p->row + p->height - 1; y++)
        for (int32_t x = p->col; x < p->col + p->width - 1; x++) {
            const bool nw = is_valid(p, x, y), ne = is_valid(p, x + 1, y), sw = is_valid(p, x, y + 1),
                       se = is_valid(p, x + 1, y + 1);
            const bool main_diagonal = ((x + y) & 1) == 0;
            if (main_diagonal ? nw && se : ne && sw) count += main_diagonal ? ne + sw : nw + se;
        }
    return count;
}
