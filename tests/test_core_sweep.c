/* test_core_sweep.c - errors of a raster that passes by in bands equal those of the whole raster, at every vertex.
 *
 * For every small extent, every size of tiles, with and without voids, tiles in random order and by several
 * workers: band by band and at the end each lattice vertex has the code and the bit that rqt_errors_compute and
 * rqt_errors_saturate give it - and the oracle's. The plain kernels and the fast ones give equal bytes. */
#include "test_core_support.h"

#include <pthread.h>
#include <stdatomic.h>

#include "error_tile.h"

/* ------------------------------------------------------------------------------------------- one sweep -- */

static int32_t low_of(const raster *r, bool high) {
    int32_t out = 0;
    bool any = false;
    for (int n = 0; n < r->width * r->height; n++) {
        if (r->valid && !r->valid[n]) continue;
        if (!any || (high ? r->q[n] > out : r->q[n] < out)) out = r->q[n];
        any = true;
    }
    return out;
}

static rqt_sweep_plan plan_of(const raster *r, int b, int workers) {
    rqt_sweep_plan plan = {.unit = r->unit,
                           .cost = r->cost,
                           .min_q = low_of(r, false),
                           .max_q = low_of(r, true),
                           .has_voids = r->valid != NULL,
                           .b = b,
                           .workers = workers};
    assert_int_equal(rqt_lattice_init(&plan.lattice, r->width, r->height), RQT_OK);
    return plan;
}

/* What the whole raster says: saturated. */
typedef struct whole {
    const raster *r;
    rqt_errors errors;
    const oracle *o; /* NULL: none */
} whole;

static void check_vertex(const whole *w, int b, rqt_vertex v, unsigned code, bool outline, const char *where) {
    bool right_outline;
    unsigned right = rqt_errors_at(&w->errors, v, &right_outline);
    if (w->o) {
        const oracle_node *node = oracle_at(w->o, v.x, v.y);
        assert_true(node->code == right && (node->outline != 0) == right_outline);
    }
    if (code == right && outline == right_outline) return;
    raster_print(w->r);
    fail_msg("%s %dx%d, b=%d, %s: vertex (%d,%d) has code %u outline %d, should be %u %d", w->r->name, w->r->width,
             w->r->height, b, where, v.x, v.y, code, outline, right, right_outline);
}

static void check_band(const whole *w, const rqt_sweep *sweep, const rqt_sweep_plan *plan, int32_t band) {
    const int32_t side = 1 << plan->b, whole_side = 1 << plan->lattice.K;
    const bool last = band == rqt_sweep_bands(sweep) - 1;
    const rqt_band at = rqt_sweep_band(sweep, band);
    assert_int_equal(at.first_row, band * side);
    assert_true(at.first_row + at.rows == (last ? w->r->height : (band + 1) * side + 1));
    size_t n = (size_t)at.rows * (size_t)w->r->width, from = (size_t)at.first_row * (size_t)w->r->width;
    assert_memory_equal(at.q, w->r->q + from, n * sizeof *at.q);
    if (w->r->valid) assert_memory_equal(at.valid, w->r->valid + from, n);
    rqt_code *codes = malloc(((size_t)whole_side + 1) * sizeof *codes);
    uint8_t *bits = malloc((size_t)whole_side + 1);
    assert_true(codes && bits);
    /* The last band also knows what is past it. */
    for (int32_t y = band * side; y <= (last ? whole_side : (band + 1) * side); y++) {
        rqt_band_errors(&at, 0, y, 1, whole_side + 1, codes, bits);
        for (int32_t x = 0; x <= whole_side; x++) {
            const rqt_vertex v = {x, y};
            bool outline;
            assert_int_equal(rqt_band_error(&at, v, &outline), codes[x]);
            assert_int_equal(outline, bits[x]);
            if (((x | y) & (side - 1)) == 0)
                assert_true(codes[x] == 0 && !outline);
            else
                check_vertex(w, plan->b, v, codes[x], outline, "in a band");
        }
    }
    free(codes);
    free(bits);
}

static void check_coarse(const whole *w, const rqt_sweep *sweep, const rqt_sweep_plan *plan) {
    const int32_t side = 1 << plan->b, whole_side = 1 << plan->lattice.K;
    for (int32_t y = 0; y <= whole_side; y += side)
        for (int32_t x = 0; x <= whole_side; x += side) {
            int32_t q;
            uint8_t flags;
            const rqt_vertex v = {x, y}, sample = rqt_vertex_clamp(&plan->lattice, v);
            const int index = sample.y * w->r->width + sample.x;
            unsigned code = rqt_sweep_coarse(sweep, v, &q, &flags);
            check_vertex(w, plan->b, v, code, (flags & RQT_OUTLINE) != 0, "coarse");
            assert_int_equal((flags & RQT_VALID) != 0, !w->r->valid || w->r->valid[index]);
            if (flags & RQT_VALID) assert_int_equal(q, w->r->q[index]);
        }
}

static void pass_band(const raster *r, rqt_sweep *sweep, const rqt_sweep_plan *plan, int32_t band) {
    int32_t first, count, *q;
    uint8_t *valid;
    rqt_sweep_begin(sweep, band, &first, &count, &q, &valid);
    assert_true(count >= 0 && first + count <= r->height);
    const size_t from = (size_t)first * (size_t)r->width, n = (size_t)count * (size_t)r->width;
    memcpy(q, r->q + from, n * sizeof *q);
    if (r->valid) memcpy(valid, r->valid + from, n);
    int tiles = rqt_sweep_tiles(sweep);
    int *order = malloc((size_t)tiles * sizeof *order);
    assert_non_null(order);
    for (int i = 0; i < tiles; i++) order[i] = i;
    for (int i = tiles - 1; i > 0; i--) {
        int other = random_between(0, i), swap = order[i];
        order[i] = order[other];
        order[other] = swap;
    }
    for (int i = 0; i < tiles; i++) rqt_sweep_tile(sweep, random_between(0, plan->workers - 1), order[i]);
    free(order);
    rqt_sweep_end(sweep);
}

static void check_sweep(const whole *w, int b, const error_kernels *kernels) {
    const raster *r = w->r;
    const rqt_sweep_plan plan = plan_of(r, b, random_between(1, 3));
    rqt_sweep *sweep;
    size_t before = test_heap.live;
    assert_int_equal(sweep_create(&plan, kernels, &test_allocator, &sweep), RQT_OK);
    CHECK(test_heap.live - before <= rqt_sweep_bytes(&plan), "%zu bytes, %zu announced", test_heap.live - before,
          rqt_sweep_bytes(&plan));
    for (int y = r->height - 1; y >= 0; y--)
        if (rqt_sweep_wants(sweep, y))
            rqt_sweep_first(sweep, y, r->q + y * r->width, r->valid ? r->valid + y * r->width : NULL);
    int32_t bands = rqt_sweep_bands(sweep);
    for (int32_t band = 0; band < bands; band++) {
        pass_band(r, sweep, &plan, band);
        if (band > 0) check_band(w, sweep, &plan, band - 1);
    }
    check_band(w, sweep, &plan, bands - 1);
    rqt_sweep_finish(sweep);
    check_coarse(w, sweep, &plan);
    rqt_sweep_free(sweep);
}

static void whole_create(whole *w, const raster *r, const oracle *o) {
    const rqt_grid grid = {plan_of(r, 0, 1).lattice, r->q, r->valid};
    w->r = r;
    w->o = o;
    assert_int_equal(rqt_errors_compute(&grid, &r->unit, &r->cost, &test_allocator, NULL, NULL, &w->errors),
                     RQT_OK);
    rqt_errors_saturate(&w->errors);
}

static void check_sweeps(raster r, int b, bool ask_oracle) {
    const oracle_terrain terrain = {r.width,          r.height,           r.q,      r.valid,     r.unit.scale,
                                    r.unit.numerator, r.unit.denominator, r.unit.d, r.cost.cell, r.cost.c};
    oracle o;
    whole w;
    if (ask_oracle) oracle_create(&o, &terrain);
    whole_create(&w, &r, ask_oracle ? &o : NULL);
    const int K = w.errors.lattice.K, least = K > 0 ? 1 : 0;
    for (int n = b ? b : least; n <= (b ? b : K) && n <= K; n++) check_sweep(&w, n, error_kernels_best());
    rqt_errors_free(&w.errors, &test_allocator);
    if (ask_oracle) oracle_free(&o);
    raster_free(&r);
}

/* --------------------------------------------------------------------------------------------- the tests -- */

static void sweeps_equal_the_whole_for_every_small_extent(void **state) {
    (void)state;
    random_begin("extents");
    for (int width = 1; width <= 40; width++)
        for (int height = 1; height <= 40; height++)
            for (int voids = 0; voids < 2; voids++)
                check_sweeps(raster_make((surface)random_between(0, SURFACE_COUNT - 1), width, height,
                                         voids ? random_between(0, 12) : -1),
                             random_between(1, 4), false);
}

static void sweeps_equal_the_oracle(void **state) {
    (void)state;
    random_begin("oracle");
    for (int n = 0; n < 120; n++) {
        raster r = raster_make((surface)(n % SURFACE_COUNT), random_between(1, 36), random_between(1, 36),
                               n % 3 ? -1 : random_between(0, 5));
        if (n % 5 == 0) raster_add_lake(&r);
        check_sweeps(r, 0, true);
    }
}

static void sweeps_of_larger_rasters_equal_the_whole(void **state) {
    (void)state;
    random_begin("larger");
    const int sides[][2] = {{257, 257}, {258, 130}, {129, 300}, {33, 513}, {700, 65}, {514, 2}, {3, 600}, {1, 70}};
    for (size_t n = 0; n < sizeof sides / sizeof *sides; n++)
        for (int lake = 0; lake < 2; lake++) {
            raster r = raster_make(n % 2 ? SURFACE_HILLS : SURFACE_NOISE, sides[n][0], sides[n][1], -1);
            if (lake) raster_add_lake(&r);
            check_sweeps(r, 0, false);
        }
    check_sweeps(raster_make(SURFACE_EXTREMES, 300, 280, -1), 5, false);
}

/* Tiles of a band on threads, which take the next one when they are through with theirs. */
typedef struct crew {
    rqt_sweep *sweep;
    atomic_int *next;
    int worker;
} crew;

static void *measure_some(void *argument) {
    const crew *c = argument;
    for (int tile; (tile = atomic_fetch_add(c->next, 1)) < rqt_sweep_tiles(c->sweep);)
        rqt_sweep_tile(c->sweep, c->worker, tile);
    return NULL;
}

static void tiles_of_a_band_may_be_measured_at_once(void **state) {
    (void)state;
    random_begin("threads");
    enum { THREADS = 3 };
    raster r = raster_make(SURFACE_HILLS, 1100, 200, -1);
    raster_add_lake(&r);
    whole w;
    whole_create(&w, &r, NULL);
    const rqt_sweep_plan plan = plan_of(&r, 4, THREADS);
    rqt_sweep *sweep;
    assert_int_equal(rqt_sweep_create(&plan, &test_allocator, &sweep), RQT_OK);
    for (int y = 0; y < r.height; y++)
        if (rqt_sweep_wants(sweep, y)) rqt_sweep_first(sweep, y, r.q + y * r.width, r.valid + y * r.width);
    for (int32_t band = 0; band < rqt_sweep_bands(sweep); band++) {
        int32_t first, count, *q;
        uint8_t *valid;
        rqt_sweep_begin(sweep, band, &first, &count, &q, &valid);
        memcpy(q, r.q + first * r.width, (size_t)(count * r.width) * sizeof *q);
        memcpy(valid, r.valid + first * r.width, (size_t)(count * r.width));
        atomic_int next = 0;
        pthread_t thread[THREADS];
        crew member[THREADS];
        for (int i = 0; i < THREADS; i++) {
            member[i] = (crew){sweep, &next, i};
            assert_int_equal(pthread_create(&thread[i], NULL, measure_some, &member[i]), 0);
        }
        for (int i = 0; i < THREADS; i++) assert_int_equal(pthread_join(thread[i], NULL), 0);
        rqt_sweep_end(sweep);
        if (band > 0) check_band(&w, sweep, &plan, band - 1);
    }
    check_band(&w, sweep, &plan, rqt_sweep_bands(sweep) - 1);
    rqt_sweep_finish(sweep);
    check_coarse(&w, sweep, &plan);
    rqt_sweep_free(sweep);
    rqt_errors_free(&w.errors, &test_allocator);
    raster_free(&r);
}

static void check_plain_equals_best(raster r) {
    const rqt_grid grid = {plan_of(&r, 0, 1).lattice, r.q, r.valid};
    const int K = grid.lattice.K;
    rqt_errors one, two;
    for (int b = K > 0 ? 1 : 0; b <= K && b <= 8; b++) {
        assert_int_equal(
            errors_compute(&grid, &r.unit, &r.cost, b, error_kernels_plain(), &test_allocator, NULL, NULL, &one),
            RQT_OK);
        assert_int_equal(errors_compute(&grid, &r.unit, &r.cost, K < 8 ? K : 8, error_kernels_best(),
                                        &test_allocator, NULL, NULL, &two),
                         RQT_OK);
        size_t n = (size_t)one.columns * (size_t)one.rows;
        assert_memory_equal(one.code, two.code, n * sizeof *one.code);
        assert_memory_equal(one.outline, two.outline, n);
        rqt_errors_free(&one, &test_allocator);
        rqt_errors_free(&two, &test_allocator);
    }
    raster_free(&r);
}

static void plain_and_fast_kernels_give_equal_bytes(void **state) {
    (void)state;
    random_begin("kernels");
    for (int s = 0; s < SURFACE_COUNT; s++)
        for (int n = 0; n < 4; n++) {
            raster r = raster_make((surface)s, n == 0 ? 257 : random_between(2, 150),
                                   n == 0 ? 257 : random_between(2, 150), -1);
            if (n == 3) raster_add_lake(&r);
            check_plain_equals_best(r);
        }
}

/* Small and large differences take different ways to their deviations, and deviations of more than 24 bits another
 * one to their codes. */
static void errors_of_every_relief_equal_the_oracles(void **state) {
    (void)state;
    random_begin("relief");
    for (int bits = 1; bits <= 30; bits++)
        for (int n = 0; n < 4; n++) {
            raster r = raster_make(SURFACE_CONSTANT, random_between(17, 40), random_between(17, 40), -1);
            for (int i = 0; i < r.width * r.height; i++) {
                r.q[i] = random_between(-(1 << (bits - 1)) + 1, (1 << (bits - 1)) - 1);
                if (n == 3) { /* a few spikes, just above errors that are codes themselves */
                    bool spike = bits > 8 && random_between(0, 19) == 0;
                    r.q[i] = spike ? (random_between(128, 255) << (bits - 8)) + 1 : 0;
                }
            }
            if (n == 1) raster_add_lake(&r);
            if (n != 2) r.unit = UNIT_METRE;
            check_errors_equal_oracle(r);
        }
}

static void bad_plans_are_refused(void **state) {
    (void)state;
    random_begin("plans");
    raster r = raster_make(SURFACE_HILLS, 20, 10, -1);
    const rqt_sweep_plan right = plan_of(&r, 3, 1);
    for (int n = 0; n < 8; n++) {
        rqt_sweep_plan plan = right;
        rqt_sweep *sweep = (rqt_sweep *)(uintptr_t)16;
        if (n == 1) plan.b = 0;
        if (n == 2) plan.b = 6;
        if (n == 3) plan.workers = 0;
        if (n == 4) plan.lattice.K = 6;
        if (n == 5) plan.lattice.width = 0;
        if (n == 6) plan.unit.d = 0;
        if (n == 7) plan.cost.c = 0;
        assert_int_equal(rqt_sweep_create(&plan, &test_allocator, &sweep), n == 0 ? RQT_OK : RQT_INVALID);
        assert_int_equal(sweep != NULL, n == 0);
        rqt_sweep_free(sweep);
    }
    rqt_sweep *sweep = NULL;
    for (size_t refused = 1; refused == 1 || !sweep; refused++) {
        test_heap = (heap){.fail_from = refused, .fail_to = refused};
        rqt_status status = rqt_sweep_create(&right, &test_allocator, &sweep);
        assert_int_equal(status, sweep ? RQT_OK : RQT_NO_MEMORY);
        if (!sweep) assert_int_equal(test_heap.live, 0);
    }
    rqt_sweep_free(sweep);
    raster_free(&r);
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(sweeps_equal_the_whole_for_every_small_extent),
        TEST(sweeps_equal_the_oracle),
        TEST(sweeps_of_larger_rasters_equal_the_whole),
        TEST(plain_and_fast_kernels_give_equal_bytes),
        TEST(tiles_of_a_band_may_be_measured_at_once),
        TEST(errors_of_every_relief_equal_the_oracles),
        TEST(bad_plans_are_refused),
    };
    return cmocka_run_group_tests_name("sweep", tests, NULL, NULL);
}
