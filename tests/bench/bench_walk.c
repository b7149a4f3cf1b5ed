/* bench_walk.c - the walk alone: no database, no bytes, every block of a terrain decoded in memory.
 *
 *     bench_walk K RASTER.bin [RUNS [EPS]]
 *
 * RASTER.bin is what make_terrain wrote: (2^K + 1)^2 little-endian int16. For the whole terrain and for a window of
 * 513 x 513 samples, at each eps: millions of triangles a second as a strip, as an index list and as vertices
 * alone, beside a plain recursion over the same saturated errors in one array, which is what RTIN does (Martini's
 * two passes: count and number the vertices, then write them and the triangles). Both give the same number of
 * triangles and vertices, or the bench stops. One thread; the least time of all runs, the ways alternate; warm.
 */
#include "bench.h"
#include "rqt.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { BLOCK_K = 7, WINDOW_SIDE = 512 };

static const double EPS[] = {1, 2, 5, 10, 20};

static void stop(const char *why) {
    fprintf(stderr, "bench_walk: %s\n", why);
    exit(1);
}

static void *take(size_t bytes) {
    void *p = calloc(bytes, 1);
    if (!p) stop("out of memory");
    return p;
}

static void *resize(void *context, void *p, size_t bytes) {
    (void)context;
    if (bytes) return realloc(p, bytes);
    free(p);
    return NULL;
}
static const rqt_allocator ALLOCATOR = {resize, NULL};

/* --------------------------------------------------------------------------------------------- the terrain */
typedef struct entry {
    rqt_answer answer;
    rqt_block_place place;
    rqt_block block;
} entry;

typedef struct terrain {
    rqt_lattice lattice;
    entry *entries;
    size_t count;
    size_t *by_cell[RQT_MAX_K + 1]; /* per level: entry of cell j * 2^level + i */
    rqt_code *errors;               /* of all vertices, row by row */
} terrain;

static void read_terrain(terrain *t, int K, const char *path) {
    const size_t side = ((size_t)1 << K) + 1, samples = side * side;
    FILE *in = fopen(path, "rb");
    int16_t *raw = take(samples * sizeof *raw);
    int32_t *q = take(samples * sizeof *q);
    if (!in || fread(raw, sizeof *raw, samples, in) != samples) stop("the raster cannot be read");
    fclose(in);
    for (size_t i = 0; i < samples; i++) q[i] = raw[i];
    free(raw);
    const rqt_unit metre = {.d = 1, .numerator = 1, .denominator = 1, .scale = 1};
    const rqt_void_cost cost = {1, 1};
    rqt_grid grid = {.q = q};
    rqt_errors errors;
    if (rqt_lattice_init(&grid.lattice, (int64_t)side, (int64_t)side) != RQT_OK ||
        rqt_errors_compute(&grid, &metre, &cost, &ALLOCATOR, NULL, NULL, &errors) != RQT_OK)
        stop("no errors");
    rqt_errors_saturate(&errors);
    t->lattice = grid.lattice;
    t->errors = take(samples * sizeof *t->errors);
    bool outline;
    for (size_t i = 0; i < samples; i++)
        t->errors[i] = rqt_errors_at(&errors, (rqt_vertex){(int32_t)(i % side), (int32_t)(i / side)}, &outline);
    rqt_pyramid *pyramid;
    if (rqt_pyramid_create(&grid, &errors, BLOCK_K, &ALLOCATOR, &pyramid) != RQT_OK) stop("no pyramid");
    t->count = rqt_pyramid_count(pyramid);
    t->entries = take(t->count * sizeof *t->entries);
    for (int level = 0; level <= K - BLOCK_K; level++)
        t->by_cell[level] = take(((size_t)1 << (2 * level)) * sizeof(size_t));
    for (size_t n = 0; n < t->count; n++) {
        entry *e = &t->entries[n];
        if (rqt_block_create(BLOCK_K, &ALLOCATOR, &e->block) != RQT_OK) stop("out of memory");
        rqt_pyramid_block(pyramid, n, &e->answer.number, &e->answer.summary, &e->block);
        (void)rqt_block_locate(&t->lattice, BLOCK_K, e->answer.number, &e->place);
        t->by_cell[e->place.level][((size_t)e->place.j << e->place.level) + (size_t)e->place.i] = n;
    }
    rqt_pyramid_free(pyramid);
    rqt_errors_free(&errors, &ALLOCATOR);
    free(q);
}

static const rqt_block *read_block(void *context, rqt_block_number number) {
    const terrain *t = context;
    rqt_block_place p;
    if (rqt_block_locate(&t->lattice, BLOCK_K, number, &p) != RQT_OK) return NULL;
    return &t->entries[t->by_cell[p.level][((size_t)p.j << p.level) + (size_t)p.i]].block;
}

/* A square: the whole, or one cell of the quadtree. */
typedef struct square {
    const char *name;
    int32_t x, y, side;
    rqt_region *region;
} square;

static size_t find_answers(const terrain *t, const square *s, rqt_code eps, rqt_answer *answers) {
    size_t count = 0;
    for (size_t n = 0; n < t->count; n++) {
        const rqt_block_place *p = &t->entries[n].place;
        if (p->x > s->x + s->side || p->y > s->y + s->side || p->x + p->side < s->x || p->y + p->side < s->y)
            continue;
        if (rqt_summary_answers(&t->entries[n].answer.summary, RQT_OUTLINE_EXACT, eps))
            answers[count++] = t->entries[n].answer;
    }
    return count;
}

/* ------------------------------------------------------------------------------------- RTIN, as Martini does it */
typedef struct rtin {
    int size;
    const rqt_code *errors;
    rqt_code eps;
    uint32_t *indices; /* size * size */
    uint16_t *vertices;
    uint32_t *triangles;
    size_t vertex_count, triangle_count, written;
} rtin;

static void rtin_count(rtin *m, int ax, int ay, int bx, int by, int cx, int cy) {
    const int mx = (ax + bx) >> 1, my = (ay + by) >> 1;
    if (abs(ax - cx) + abs(ay - cy) > 1 && m->errors[my * m->size + mx] > m->eps) {
        rtin_count(m, cx, cy, ax, ay, mx, my);
        rtin_count(m, bx, by, cx, cy, mx, my);
    } else {
        uint32_t *a = &m->indices[ay * m->size + ax], *b = &m->indices[by * m->size + bx],
                 *c = &m->indices[cy * m->size + cx];
        if (!*a) *a = (uint32_t)++m->vertex_count;
        if (!*b) *b = (uint32_t)++m->vertex_count;
        if (!*c) *c = (uint32_t)++m->vertex_count;
        m->triangle_count++;
    }
}

static void rtin_write(rtin *m, int ax, int ay, int bx, int by, int cx, int cy) {
    const int mx = (ax + bx) >> 1, my = (ay + by) >> 1;
    if (abs(ax - cx) + abs(ay - cy) > 1 && m->errors[my * m->size + mx] > m->eps) {
        rtin_write(m, cx, cy, ax, ay, mx, my);
        rtin_write(m, bx, by, cx, cy, mx, my);
    } else {
        const uint32_t a = m->indices[ay * m->size + ax] - 1, b = m->indices[by * m->size + bx] - 1,
                       c = m->indices[cy * m->size + cx] - 1;
        m->vertices[2 * a] = (uint16_t)ax, m->vertices[2 * a + 1] = (uint16_t)ay;
        m->vertices[2 * b] = (uint16_t)bx, m->vertices[2 * b + 1] = (uint16_t)by;
        m->vertices[2 * c] = (uint16_t)cx, m->vertices[2 * c + 1] = (uint16_t)cy;
        m->triangles[m->written++] = a;
        m->triangles[m->written++] = b;
        m->triangles[m->written++] = c;
    }
}

static void rtin_mesh(rtin *m) {
    const int last = m->size - 1;
    m->vertex_count = m->triangle_count = m->written = 0;
    memset(m->indices, 0, (size_t)m->size * (size_t)m->size * sizeof *m->indices);
    rtin_count(m, 0, 0, last, last, last, 0);
    rtin_count(m, last, last, 0, 0, 0, last);
    rtin_write(m, 0, 0, last, last, last, 0);
    rtin_write(m, last, last, 0, 0, 0, last);
}

/* ------------------------------------------------------------------------------------------------ the bench */
enum { WAYS = 4 };
static const char *const WAY[WAYS] = {"strip", "index list", "vertices", "RTIN in C"};

static double run_query(const terrain *t, const square *s, rqt_code eps, rqt_product product, rqt_scratch *scratch,
                        rqt_answer *answers, size_t *triangles, size_t *vertices, size_t *indices) {
    rqt_query query = {.lattice = t->lattice,
                       .k = BLOCK_K,
                       .region = s->region,
                       .eps = eps,
                       .product = product,
                       .scratch = scratch,
                       .answers = answers,
                       .answer_count = find_answers(t, s, eps, answers),
                       .read_block = read_block,
                       .context = (void *)(uintptr_t)t};
    rqt_patch patch;
    const double begin = bench_now();
    if (rqt_query_run(&query, &ALLOCATOR, &patch) != RQT_OK) stop("the query failed");
    const double end = bench_now();
    *triangles = patch.triangle_count;
    *vertices = patch.vertex_count;
    *indices = patch.strip_count;
    rqt_scratch_keep(scratch, &patch, SIZE_MAX);
    return end - begin;
}

/* only: one eps, 0 for all of them */
static void bench_square(const terrain *t, const square *s, int runs, double only) {
    const int size = s->side + 1;
    const size_t samples = (size_t)size * (size_t)size, side = ((size_t)1 << t->lattice.K) + 1;
    rqt_code *errors = take(samples * sizeof *errors);
    for (int y = 0; y < size; y++)
        memcpy(errors + (size_t)y * (size_t)size, t->errors + (size_t)(s->y + y) * side + (size_t)s->x,
               (size_t)size * sizeof *errors);
    rtin m = {.size = size,
              .errors = errors,
              .indices = take(samples * sizeof(uint32_t)),
              .vertices = take(2 * samples * sizeof(uint16_t)),
              .triangles = take(6 * samples * sizeof(uint32_t))};
    rqt_answer *answers = take(t->count * sizeof *answers);
    rqt_scratch *scratch;
    if (rqt_scratch_create(&ALLOCATOR, &scratch) != RQT_OK) stop("out of memory");
    for (size_t e = 0; e < sizeof EPS / sizeof *EPS; e++) {
        if (only > 0 && EPS[e] != only) continue;
        double best[WAYS] = {1e9, 1e9, 1e9, 1e9};
        size_t indices = 0, none;
        m.eps = rqt_code_floor(EPS[e]);
        for (int run = 0; run < runs; run++) {
            static const rqt_product product[3] = {RQT_PRODUCT_STRIP, RQT_PRODUCT_TRIANGLES, RQT_PRODUCT_VERTICES};
            for (int way = 0; way < WAYS; way++) {
                double took;
                size_t triangles, vertices;
                if (way < 3) {
                    took = run_query(t, s, m.eps, product[way], scratch, answers, &triangles, &vertices,
                                     way == 0 ? &indices : &none);
                } else {
                    const double begin = bench_now();
                    rtin_mesh(&m);
                    took = bench_now() - begin;
                    triangles = m.triangle_count;
                    vertices = m.vertex_count;
                }
                if (way > 0 && (triangles != m.triangle_count || vertices != m.vertex_count) && run > 0)
                    stop("the meshes differ");
                if (took < best[way]) best[way] = took;
            }
        }
        printf("%-9s eps %2g %8zu triangles, %.3f indices each in the strip;", s->name, EPS[e], m.triangle_count,
               (double)indices / (double)m.triangle_count);
        for (int way = 0; way < WAYS; way++)
            printf(" %s %.1f Mtri/s%s", WAY[way], (double)m.triangle_count / best[way] / 1e6,
                   way < WAYS - 1 ? "," : "");
        printf("; strip %.2f, list %.2f times RTIN\n", best[3] / best[0], best[3] / best[1]);
    }
    rqt_scratch_free(scratch);
    free(answers);
    free(errors);
    free(m.indices);
    free(m.vertices);
    free(m.triangles);
}

static rqt_region *region_of(const terrain *t, const square *s) {
    char text[256];
    const int x0 = s->x, y0 = s->y, x1 = s->x + s->side, y1 = s->y + s->side;
    const int n = snprintf(text, sizeof text, "POLYGON((%d %d, %d %d, %d %d, %d %d, %d %d))", x0, y0, x1, y0, x1,
                           y1, x0, y1, x0, y0);
    rqt_geometry *geometry;
    rqt_region *region;
    rqt_message why;
    const rqt_placement at = {0, 0, 1, 1};
    if (rqt_geometry_parse(text, (size_t)n, true, &ALLOCATOR, &geometry, &why) != RQT_OK ||
        rqt_region_create(geometry, &at, &t->lattice, &ALLOCATOR, &region) != RQT_OK)
        stop("no region");
    rqt_geometry_free(geometry);
    return region;
}

int main(int argc, char **argv) {
    const int K = argc >= 3 ? atoi(argv[1]) : 0, runs = argc > 3 ? atoi(argv[3]) : 7;
    if (K < 10 || K > 14 || runs < 1) {
        fprintf(stderr, "Usage: bench_walk K RASTER.bin [RUNS [EPS]]; K from 10 to 14\n");
        return 2;
    }
    const double only = argc > 4 ? atof(argv[4]) : 0;
    terrain t = {0};
    read_terrain(&t, K, argv[2]);
    square whole = {.name = "whole", .side = 1 << K};
    /* a cell near the middle whose diagonal runs as the root's does */
    const int32_t at = ((1 << K) / WINDOW_SIDE / 2 - 1) * WINDOW_SIDE;
    square window = {.name = "513 x 513", .x = at, .y = at, .side = WINDOW_SIDE};
    window.region = region_of(&t, &window);
    whole.region = region_of(&t, &whole);
    setvbuf(stdout, NULL, _IOLBF, 0);
    bench_square(&t, &window, 5 * runs, only);
    bench_square(&t, &whole, runs, only);
    rqt_region_free(window.region);
    rqt_region_free(whole.region);
    for (size_t n = 0; n < t.count; n++) rqt_block_free(&t.entries[n].block, &ALLOCATOR);
    for (int level = 0; level <= K - BLOCK_K; level++) free(t.by_cell[level]);
    free(t.entries);
    free(t.errors);
    return 0;
}
