/* test_failures_support.h - the catalogue of inputs that break published methods, and what every mesh of rqt owes
 * on them.
 *
 * Inputs F1 to F9 and F16 to F18, numbered as in the tests' names, as rasters of whole metres; a terrain is one of
 * them with its blocks, made by any metric, and is asked through the core's query as a store would ask. Whatever
 * comes back is rasterised by src/verify, which knows nothing of how meshes are made. The same inputs are what
 * `make stability` shows other methods. */
#ifndef TEST_FAILURES_SUPPORT_H
#define TEST_FAILURES_SUPPORT_H

#include "test_core_database.h"

#include "verify.h"

/* ------------------------------------------------------------------------------------------ inputs -- */
typedef int32_t relief(int x, int y, const int parameter[4]);

static inline raster raster_of(relief *height, int width, int rows, int a, int b, int c, int d, const char *name) {
    const int parameter[4] = {a, b, c, d};
    raster r = raster_from_memory(width, rows, NULL, NULL, &UNIT_METRE, name);
    for (int y = 0; y < rows; y++)
        for (int x = 0; x < width; x++) r.q[y * width + x] = height(x, y, parameter);
    return r;
}

/* F1, F2: slopes a and b in metres a sample, c at the origin. */
static inline int32_t relief_plane(int x, int y, const int p[4]) {
    return p[0] * x + p[1] * y + p[2];
}
/* F3: tents over tents, each half as wide as the one before and as high: b metres; a: the side of the largest, a
 * power of two that divides b. */
static inline int32_t relief_takagi(int x, int y, const int p[4]) {
    int32_t z = 0;
    for (int period = p[0]; period >= 2; period /= 2) {
        const int u = x % period, v = y % period;
        z += ((u < period - u ? u : period - u) + (v < period - v ? v : period - v)) * (2 * p[1] / period);
    }
    return z;
}
/* F4: -a .. a, from the test's random numbers. */
static inline int32_t relief_noise(int x, int y, const int p[4]) {
    (void)x, (void)y;
    return random_between(-p[0], p[0]);
}
/* F5, F6: c metres at sample (a,b), 0 elsewhere. */
static inline int32_t relief_spike(int x, int y, const int p[4]) {
    return x == p[0] && y == p[1] ? p[2] : 0;
}
/* F7: a fall of d metres across the line a*x + b*y = c. */
static inline int32_t relief_cliff(int x, int y, const int p[4]) {
    return p[0] * x + p[1] * y > p[2] ? p[3] : 0;
}
/* F8: each cell a saddle of a metres, from column b on of c: the two diagonals of every cell fit equally ill. */
static inline int32_t relief_saddle(int x, int y, const int p[4]) {
    return ((x ^ y) & 1) * (x < p[1] ? p[0] : p[2]);
}
/* F9: a ridge of slope b along the secondary (a = 0) or the main diagonal (a = 1) of a square of side c, d: noise.
 */
static inline int32_t relief_ridge(int x, int y, const int p[4]) {
    return -abs(p[0] ? x - y : x + y - p[2]) * p[1] + (p[3] ? random_between(0, p[3]) : 0);
}
/* F16 to F18: ground for voids: hills of a metres, shifted by (b,c). */
static inline int32_t relief_hills(int x, int y, const int p[4]) {
    const int u = x + p[1], v = y + p[2];
    return p[0] * (takagi(u, v, 32) + takagi(u + 5, v + 11, 8) * 2) / 16 + random_between(0, 3);
}

static inline void raster_void(raster *r, int x, int y) {
    if (!r->valid) {
        r->valid = malloc((size_t)(r->width * r->height));
        if (!r->valid) abort();
        memset(r->valid, 1, (size_t)(r->width * r->height));
    }
    if (x >= 0 && y >= 0 && x < r->width && y < r->height) r->valid[y * r->width + x] = 0;
}

/* The same heights, turned by 90 degrees. */
static inline raster raster_turned(const raster *r) {
    raster t = raster_from_memory(r->height, r->width, NULL, NULL, &r->unit, r->name);
    for (int y = 0; y < r->height; y++)
        for (int x = 0; x < r->width; x++) t.q[x * t.width + (t.width - 1 - y)] = r->q[y * r->width + x];
    return t;
}

/* ---------------------------------------------------------------------------------------- terrains -- */
typedef struct terrain {
    model m; /* without the oracle */
    database d;
} terrain;

/* Takes the raster over. outline: matters to `minimal` alone. */
static inline terrain terrain_create_as(raster r, int k, rqt_metric metric, rqt_outline outline) {
    terrain t = {.m = {.r = r, .grid = {.q = r.q, .valid = r.valid}}};
    model *m = &t.m;
    assert_int_equal(rqt_lattice_init(&m->grid.lattice, r.width, r.height), RQT_OK);
    if (metric == RQT_METRIC_EXACT) {
        assert_int_equal(rqt_errors_compute(&m->grid, &r.unit, &r.cost, &test_allocator, NULL, NULL, &m->saturated),
                         RQT_OK);
        rqt_errors_saturate(&m->saturated);
    } else {
        assert_int_equal(rqt_metric_compute(&m->grid, &r.unit, &r.cost, metric, outline, &test_allocator, NULL,
                                            NULL, &m->saturated),
                         RQT_OK);
    }
    assert_int_equal(database_create(&t.d, m, k, &test_allocator), RQT_OK);
    return t;
}

static inline terrain terrain_create(raster r, int k) {
    return terrain_create_as(r, k, RQT_METRIC_EXACT, RQT_OUTLINE_EXACT);
}

static inline void terrain_free(terrain *t) {
    database_free(&t->d, &test_allocator);
    rqt_errors_free(&t->m.saturated, &test_allocator);
    raster_free(&t->m.r);
}

/* The mesh of the whole, or of one window, at eps metres. */
static inline rqt_patch terrain_ask(terrain *t, double eps, rqt_outline outline, const window *in) {
    const window all = window_all();
    rqt_region *region = region_of(in ? in : &all, &t->m.grid.lattice);
    rqt_patch patch;
    assert_int_equal(
        database_query(&t->d, region, rqt_code_eps(eps, 0), RQT_SELECT_THRESHOLD, outline, &test_allocator, &patch),
        RQT_OK);
    rqt_region_free(region);
    return patch;
}

static inline bool patch_has(const rqt_patch *p, int col, int row) {
    for (size_t v = 0; v < p->vertex_count; v++)
        if (p->vertices[v].col == col && p->vertices[v].row == row) return true;
    return false;
}

/* ------------------------------------------------------------------------------------------- proof -- */
/* The finest triangles of cell (x,y): corners of the two halves, for x and y of equal parity, whose diagonal is the
 * main one, and of different parity. */
static const int half_corner[2][2][3][2] = {{{{0, 0}, {0, 1}, {1, 1}}, {{0, 0}, {1, 1}, {1, 0}}},
                                            {{{0, 0}, {0, 1}, {1, 0}}, {{1, 0}, {0, 1}, {1, 1}}}};

static inline bool half_is_valid(const raster *r, int x, int y, int half) {
    for (int c = 0; c < 3 && r->valid; c++) {
        const int *at = half_corner[(x ^ y) & 1][half][c];
        if (!r->valid[(y + at[1]) * r->width + x + at[0]]) return false;
    }
    return true;
}

static inline uint64_t halves_of(const raster *r) {
    uint64_t count = 0;
    for (int y = 0; y + 1 < r->height; y++)
        for (int x = 0; x + 1 < r->width; x++)
            count += (uint64_t)half_is_valid(r, x, y, 0) + half_is_valid(r, x, y, 1);
    return count;
}

/* What the outline `exact` promises to cover: corners of half-cells with three valid corners. */
static inline bool is_in_a_half(void *context, int32_t col, int32_t row) {
    const raster *r = context;
    for (int n = 0; n < 8; n++) { /* the halves of the four cells that have the sample for a corner */
        const int x = col - (n & 1), y = row - (n >> 1 & 1), half = n >> 2;
        if (x < 0 || y < 0 || x + 1 >= r->width || y + 1 >= r->height || !half_is_valid(r, x, y, half)) continue;
        for (int c = 0; c < 3; c++) {
            const int *at = half_corner[(x ^ y) & 1][half][c];
            if (x + at[0] == col && y + at[1] == row) return true;
        }
    }
    return false;
}

static inline verify_report prove_triangles(const raster *r, const verify_triangle *triangles, size_t n) {
    const verify_samples samples = {.width = r->width,
                                    .height = r->height,
                                    .q = r->q,
                                    .valid = r->valid,
                                    .quantum = fabs(rqt_unit_factor(&r->unit)) / r->unit.d,
                                    .cell_x = 1,
                                    .cell_y = -1,
                                    .is_promised = is_in_a_half,
                                    .context = (void *)(uintptr_t)r};
    verify_report report;
    assert_int_equal(verify_mesh(&samples, triangles, n, &report), VERIFY_OK);
    return report;
}

static inline verify_report prove(const raster *r, const rqt_patch *p) {
    verify_triangle *triangles = calloc(p->triangle_count + 1, sizeof *triangles);
    if (!triangles) abort();
    for (size_t i = 0; i < 3 * p->triangle_count; i++) {
        const rqt_patch_vertex *v = &p->vertices[p->triangles[i]];
        triangles[i / 3].corner[i % 3] = (verify_corner){.col = v->col, .row = v->row, .q = v->q};
    }
    const verify_report report = prove_triangles(r, triangles, p->triangle_count);
    free(triangles);
    return report;
}

/* The three promises of a whole mesh with the outline `exact`: within eps, one piece, all of what is to be covered
 * and nothing else. Returns the number of its vertices. */
static inline size_t check_mesh(terrain *t, double eps) {
    const raster *r = &t->m.r;
    rqt_patch patch = terrain_ask(t, eps, RQT_OUTLINE_EXACT, NULL);
    const verify_report v = prove(r, &patch);
    const size_t vertices = patch.vertex_count;
    rqt_patch_free(&patch);
    if (!(v.max_error <= eps) || v.t_junctions || v.overlaps || v.uncovered || v.void_touched ||
        v.twice_area != halves_of(r)) {
        raster_print(r);
        fail_msg("%s %dx%d, k %d, eps %.17g: off by %.17g at (%d,%d), %llu T-junctions, %llu overlaps, %llu "
                 "uncovered, %llu voids touched, %llu half-cells of %llu",
                 r->name, r->width, r->height, t->d.k, eps, v.max_error, v.worst_col, v.worst_row,
                 (unsigned long long)v.t_junctions, (unsigned long long)v.overlaps, (unsigned long long)v.uncovered,
                 (unsigned long long)v.void_touched, (unsigned long long)v.twice_area,
                 (unsigned long long)halves_of(r));
    }
    return vertices;
}

/* The same for a raster, which is taken over, in blocks of several sizes: they give one mesh. */
static inline void check_raster(raster r, const double *eps, size_t count) {
    size_t vertices[16] = {0};
    rqt_lattice l;
    assert_int_equal(rqt_lattice_init(&l, r.width, r.height), RQT_OK);
    assert_true(count <= 16);
    for (int k = smallest_k(&l); k <= largest_k(&l); k += 2) {
        terrain t = terrain_create(raster_from_memory(r.width, r.height, r.q, r.valid, &r.unit, r.name), k);
        for (size_t e = 0; e < count; e++) {
            const size_t seen = check_mesh(&t, eps[e]);
            CHECK(k == smallest_k(&l) || seen == vertices[e],
                  "%s, eps %g: %zu vertices in blocks of k %d, else %zu", r.name, eps[e], seen, k, vertices[e]);
            vertices[e] = seen;
        }
        terrain_free(&t);
    }
    raster_free(&r);
}

#endif
