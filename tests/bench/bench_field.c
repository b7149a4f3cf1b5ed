/* bench_field.c - what a field costs a query: no database, no bytes, every block of a terrain decoded in memory.
 *
 *     bench_field K RASTER.bin [RUNS [BLOCK_K [field]]]
 *
 * RASTER.bin is what make_terrain wrote: (2^K + 1)^2 little-endian int16 of metres, 30 m apart. The field is what
 * an eye over the middle asks for in all directions: eps in proportion to the distance, squares as fine as a share
 * of it. Beside it, over the same terrain: one eps that selects about as much. Which blocks answer, and their walk,
 * are timed apart; `field`: of it alone. One thread, processor time; the least of all runs; warm. */
#include "rqt.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

static const double CELL = 30, HEIGHT = 300, PIXELS = 4000, SHARE = 1.0 / 16;

static void stop(const char *why) {
    fprintf(stderr, "bench_field: %s\n", why);
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

static double now(void) {
    struct timespec t;
    (void)clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* ----------------------------------------------------------------------------------------------- terrain */
typedef struct entry {
    rqt_answer answer;
    rqt_block_place place;
    rqt_block block;
} entry;

typedef struct terrain {
    rqt_lattice lattice;
    int k;
    entry *entries;
    size_t count;
    size_t *by_cell[RQT_MAX_K + 1]; /* per level: entry of cell j * 2^level + i */
    size_t reads;
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
    rqt_pyramid *pyramid;
    if (rqt_pyramid_create(&grid, &errors, t->k, &ALLOCATOR, &pyramid) != RQT_OK) stop("no pyramid");
    t->count = rqt_pyramid_count(pyramid);
    t->entries = take(t->count * sizeof *t->entries);
    for (int level = 0; level <= K - t->k; level++)
        t->by_cell[level] = take(((size_t)1 << (2 * level)) * sizeof(size_t));
    for (size_t n = 0; n < t->count; n++) {
        entry *e = &t->entries[n];
        if (rqt_block_create(t->k, &ALLOCATOR, &e->block) != RQT_OK) stop("out of memory");
        rqt_pyramid_block(pyramid, n, &e->answer.number, &e->answer.summary, &e->block);
        (void)rqt_block_locate(&t->lattice, t->k, e->answer.number, &e->place);
        t->by_cell[e->place.level][((size_t)e->place.j << e->place.level) + (size_t)e->place.i] = n;
    }
    rqt_pyramid_free(pyramid);
    rqt_errors_free(&errors, &ALLOCATOR);
    free(q);
}

static const entry *entry_of(const terrain *t, rqt_block_number number) {
    rqt_block_place p;
    if (rqt_block_locate(&t->lattice, t->k, number, &p) != RQT_OK) return NULL;
    return &t->entries[t->by_cell[p.level][((size_t)p.j << p.level) + (size_t)p.i]];
}

static const rqt_block *read_block(void *context, rqt_block_number number) {
    terrain *t = context;
    t->reads++;
    return &entry_of(t, number)->block;
}

/* ------------------------------------------------------------------------------------------------- field */
static double distance(const rqt_lattice *l, rqt_square s) {
    const double middle = 0.5 * (1 << l->K) + 0.3;
    const double x = fmax(0, fmax(s.x - middle, middle - s.x - s.side)),
                 y = fmax(0, fmax(s.y - middle, middle - s.y - s.side));
    return sqrt(CELL * CELL * (x * x + y * y) + HEIGHT * HEIGHT);
}

static rqt_field_step decide(void *context, rqt_square square, double *eps) {
    const rqt_lattice *l = context;
    const double d = distance(l, square), middle = 0.5 * (1 << l->K) + 0.3, far = square.side;
    /* a wedge of 53 degrees to the south */
    const double x = fmax(0, fmax(square.x - middle, middle - square.x - far)), y = square.y + far - middle;
    if (x > 0.5 * fmax(0, y)) {
        *eps = INFINITY;
        return RQT_FIELD_LEAF;
    }
    if (square.side > 1 && square.side * CELL > SHARE * d) return RQT_FIELD_SPLIT;
    *eps = d / PIXELS;
    return RQT_FIELD_LEAF;
}

/* ------------------------------------------------------------------------------------------------- bench */
/* As the store does: from the blocks that answer the rule's own eps down. */
static void add_answers(const terrain *t, const rqt_rule *rule, const entry *e, rqt_answer *answers,
                        size_t *count) {
    if (rqt_rule_is_answered(rule, &e->place, &e->answer.summary, RQT_OUTLINE_TOL)) {
        answers[(*count)++] = e->answer;
        return;
    }
    for (int c = 0; c < 4; c++)
        add_answers(t, rule,
                    entry_of(t, rqt_block_number_of(e->place.level + 1, 2 * e->place.i + (c & 1),
                                                    2 * e->place.j + (c >> 1))),
                    answers, count);
}

static void run(terrain *t, const char *what, const rqt_rule *rule, rqt_code eps, int runs) {
    rqt_answer *answers = take(t->count * sizeof *answers);
    rqt_scratch *scratch;
    rqt_region *all;
    const rqt_placement at = {0, 0, 1, 1};
    if (rqt_scratch_create(&ALLOCATOR, &scratch) != RQT_OK ||
        rqt_region_create(NULL, &at, &t->lattice, &ALLOCATOR, &all) != RQT_OK)
        stop("out of memory");
    double best_find = 1e9, best_walk = 1e9;
    size_t count = 0, vertices = 0, triangles = 0, reads = 0;
    for (int n = 0; n < runs; n++) {
        const double begin = now();
        count = 0;
        if (rule)
            add_answers(t, rule, entry_of(t, 1), answers, &count);
        else
            for (size_t i = 0; i < t->count; i++)
                if (rqt_summary_answers(&t->entries[i].answer.summary, RQT_OUTLINE_TOL, eps))
                    answers[count++] = t->entries[i].answer;
        const double found = now();
        rqt_query query = {.lattice = t->lattice,
                           .k = t->k,
                           .region = all,
                           .eps = eps,
                           .rule = rule,
                           .outline = RQT_OUTLINE_TOL,
                           .scratch = scratch,
                           .answers = answers,
                           .answer_count = count,
                           .read_block = read_block,
                           .context = t};
        rqt_patch patch;
        t->reads = 0;
        if (rqt_query_run(&query, &ALLOCATOR, &patch) != RQT_OK) stop("the query failed");
        const double end = now();
        vertices = patch.vertex_count;
        triangles = patch.triangle_count;
        reads = t->reads;
        rqt_scratch_keep(scratch, &patch, SIZE_MAX);
        if (found - begin < best_find) best_find = found - begin;
        if (end - found < best_walk) best_walk = end - found;
    }
    printf("%-8s %8zu vertices %8zu triangles, %5zu blocks answer, %5zu read; found in %6.0f us, walk %8.0f us: "
           "%5.1f ns a vertex, %5.1f us a block read\n",
           what, vertices, triangles, count, reads, best_find * 1e6, best_walk * 1e6,
           best_walk * 1e9 / (double)vertices, best_walk * 1e6 / (double)reads);
    rqt_region_free(all);
    rqt_scratch_free(scratch);
    free(answers);
}

int main(int argc, char **argv) {
    const int K = argc >= 3 ? atoi(argv[1]) : 0, runs = argc > 3 ? atoi(argv[3]) : 15;
    terrain t = {.k = argc > 4 ? atoi(argv[4]) : 7};
    if (K < 10 || K > 14 || runs < 1 || t.k < 1 || t.k > RQT_MAX_BLOCK_K) {
        fprintf(stderr, "Usage: bench_field K RASTER.bin [RUNS [BLOCK_K [field]]]; K from 10 to 14\n");
        return 2;
    }
    read_terrain(&t, K, argv[2]);
    setvbuf(stdout, NULL, _IOLBF, 0);
    rqt_field *field = NULL;
    rqt_rule *rule, *uniform;
    double best = 1e9;
    for (int n = 0; n < runs; n++) {
        rqt_field_free(field);
        const double begin = now();
        if (rqt_field_create(&t.lattice, &ALLOCATOR, decide, &t.lattice, &field) != RQT_OK) stop("no field");
        if (now() - begin < best) best = now() - begin;
    }
    printf("field of %zu squares, made in %.0f us\n", rqt_field_count(field), best * 1e6);
    if (rqt_rule_create(&t.lattice, 0, &ALLOCATOR, &rule) != RQT_OK ||
        rqt_rule_create(&t.lattice, 0, &ALLOCATOR, &uniform) != RQT_OK)
        stop("out of memory");
    static const double EPS[] = {3, 5, 10};
    for (size_t e = 0; argc <= 5 && e < sizeof EPS / sizeof *EPS; e++) {
        char what[32];
        (void)snprintf(what, sizeof what, "eps %g", EPS[e]);
        run(&t, what, NULL, rqt_code_floor(EPS[e]), runs);
    }
    (void)rqt_rule_set_eps(uniform, 5);
    if (argc <= 5) run(&t, "rule 5", uniform, 0, runs);
    (void)rqt_rule_set_eps(rule, INFINITY);
    (void)rqt_rule_set_field(rule, field);
    run(&t, "field", rule, 0, runs);
    double lowering[RQT_RANKS] = {0};
    for (int rank = 0; rank < RQT_RANKS; rank++) lowering[rank] = 1e-9 * ldexp(1, rank);
    (void)rqt_rule_set_lowering(rule, lowering);
    run(&t, "lowered", rule, 0, runs);
    rqt_rule_free(rule);
    rqt_rule_free(uniform);
    rqt_field_free(field);
    for (size_t n = 0; n < t.count; n++) rqt_block_free(&t.entries[n].block, &ALLOCATOR);
    for (int level = 0; level <= K - t.k; level++) free(t.by_cell[level]);
    free(t.entries);
    return 0;
}
