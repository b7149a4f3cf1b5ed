/* test_core_memory.c - when memory runs out anywhere, the core says so, leaves nothing behind and harms nothing.
 *
 * One scenario goes through everything that allocates. It is run with the n-th request for memory refused, for
 * every n until none is reached, and again with that and all later ones refused. Each run gives RQT_NO_MEMORY, or
 * the right answer where the core could do without; afterwards no byte is alive. */
#include "test_core_database.h"

static const rqt_vertex FORCED[] = {{3, 5}, {17, 9}, {30, 1}, {0, 31}, {21, 21}, {32, 7}};

/* What a run is compared by. */
typedef struct outcome {
    size_t resolved, swept, top_down, bottom_up, blocks, triangles, strip;
} outcome;

/* Must not be left where it was by a call that fails. */
#define NOWHERE ((void *)(uintptr_t)16)

static bool failed(rqt_status status, rqt_status *first) {
    CHECK(status == RQT_OK || status == RQT_NO_MEMORY, "status %d", (int)status);
    if (status != RQT_OK && *first == RQT_OK) *first = status;
    return status != RQT_OK;
}

static void run_selections(const model *m, const rqt_allocator *a, outcome *out, rqt_status *first) {
    for (int way = 0; way < 4 && *first == RQT_OK; way++) {
        rqt_selection *s = NOWHERE;
        if (failed(rqt_selection_create(&m->grid.lattice, a, &s), first)) {
            assert_null(s);
            rqt_selection_free(s);
            return;
        }
        rqt_status status = RQT_OK;
        if (way == 0)
            for (size_t n = 0; n < sizeof FORCED / sizeof *FORCED && status == RQT_OK; n++)
                status = rqt_selection_add_resolved(s, FORCED[n]);
        else if (way == 1)
            status = rqt_selection_add_bottom_up(s, FORCED, sizeof FORCED / sizeof *FORCED);
        else
            status = (way == 2 ? rqt_select_top_down : rqt_select_bottom_up)(&m->raw, 0, s);
        (void)failed(status, first);
        size_t *const count[] = {&out->resolved, &out->swept, &out->top_down, &out->bottom_up};
        *count[way] = rqt_selection_count(s);
        rqt_selection_free(s);
    }
}

static void run_query(const model *m, const rqt_allocator *a, rqt_select select, outcome *out, rqt_status *first) {
    const char text[] = "MULTIPOLYGON(((1 1, 25.5 2, 22 30, 3 28, 1 1), (8 8, 12 8, 12 12, 8 12, 8 8)),"
                        "((27 3, 31 3, 31 9, 27 9, 27 3)))";
    database d;
    rqt_geometry *geometry = NOWHERE;
    rqt_region *region = NULL;
    rqt_patch patch;
    rqt_message message;
    uint32_t *strip = NOWHERE;
    size_t n = 1;
    if (failed(database_create(&d, m, 3, a), first)) return;
    out->blocks += d.count;
    if (failed(rqt_geometry_parse(text, sizeof text - 1, true, a, &geometry, &message), first)) {
        assert_null(geometry);
    } else {
        region = NOWHERE;
        if (failed(rqt_region_create(geometry, &AT_ORIGIN, &m->grid.lattice, a, &region), first))
            assert_null(region);
    }
    rqt_geometry_free(geometry);
    if (*first == RQT_OK) {
        memset(&patch, 0xA5, sizeof patch);
        if (failed(database_query(&d, region, 0, select, RQT_OUTLINE_EXACT, a, &patch), first)) {
            assert_true(patch.vertex_count == 0 && patch.triangle_count == 0);
        } else if (failed(rqt_strip_build(&patch, a, &strip, &n), first)) {
            assert_true(strip == NULL && n == 0);
        } else {
            out->triangles += patch.triangle_count;
            out->strip += n;
            (void)a->resize(a->context, strip, 0);
        }
        rqt_patch_free(&patch);
    }
    rqt_scratch *scratch = NULL;
    if (*first == RQT_OK && failed(rqt_scratch_create(a, &scratch), first)) assert_null(scratch);
    for (int again = 0; again < 2 && *first == RQT_OK;
         again++) { /* with memory of its own, and with what it left */
        if (!failed(database_query_as(&d, region, 0, select, RQT_OUTLINE_EXACT, RQT_PRODUCT_STRIP, false, scratch,
                                      a, &patch),
                    first))
            assert_int_equal(patch.strip_count, n);
        rqt_scratch_keep(scratch, &patch, SIZE_MAX);
    }
    rqt_scratch_free(scratch);
    rqt_region_free(region);
    database_free(&d, a);
}

/* raster in, strip out; the first status that was not RQT_OK. */
static rqt_status run(const raster *r, const rqt_allocator *a, outcome *out) {
    rqt_status first = RQT_OK;
    model m = {.r = *r, .grid = {.q = r->q, .valid = r->valid}};
    memset(out, 0, sizeof *out);
    assert_int_equal(rqt_lattice_init(&m.grid.lattice, r->width, r->height), RQT_OK);
    memset(&m.raw, 0xA5, sizeof m.raw);
    if (!failed(rqt_errors_compute(&m.grid, &r->unit, &r->cost, a, NULL, NULL, &m.raw), &first)) {
        run_selections(&m, a, out, &first);
        if (first == RQT_OK) {
            m.saturated = m.raw;
            rqt_errors_saturate(&m.saturated);
            run_query(&m, a, RQT_SELECT_THRESHOLD, out, &first);
            if (first == RQT_OK) run_query(&m, a, RQT_SELECT_TOP_DOWN, out, &first);
            if (first == RQT_OK) run_query(&m, a, RQT_SELECT_BOTTOM_UP, out, &first);
        }
    }
    rqt_errors_free(&m.raw, a);
    return first;
}

static void check_failures(bool from_then_on) {
    random_begin("memory");
    raster r = raster_make(SURFACE_HILLS, 33, 30, -1);
    raster_add_lake(&r);
    outcome right, out;
    assert_int_equal(run(&r, &test_allocator, &right), RQT_OK);
    assert_int_equal(test_heap.live, 0);
    assert_true(right.triangles > 0 && right.strip > 0 && right.resolved > 0 && right.blocks > 0);
    size_t calls = test_heap.calls, refused = 0;
    assert_true(calls > 10);
    printf("%zu requests for memory\n", calls);
    for (size_t n = 1; n <= calls; n++) {
        memset(&test_heap, 0, sizeof test_heap);
        test_heap.fail_from = n;
        test_heap.fail_to = from_then_on ? SIZE_MAX : n;
        random_begin("memory answers");
        rqt_status status = run(&r, &test_allocator, &out);
        CHECK(test_heap.live == 0, "request %zu refused: %zu bytes leaked", n, test_heap.live);
        CHECK(test_heap.failures > 0, "request %zu was never made", n);
        CHECK(status == RQT_NO_MEMORY || memcmp(&out, &right, sizeof out) == 0,
              "request %zu refused: RQT_OK and a wrong answer", n);
        refused += status == RQT_NO_MEMORY;
    }
    CHECK(refused > calls / 2, "only %zu of %zu refusals were reported", refused, calls);
    memset(&test_heap, 0, sizeof test_heap);
    raster_free(&r);
}

static void F48_one_refused_allocation_is_reported_and_nothing_leaks(void **state) {
    (void)state;
    check_failures(false);
}

static void F48_refused_from_then_on_is_reported_and_nothing_leaks(void **state) {
    (void)state;
    check_failures(true);
}

static void errors_take_the_memory_that_was_announced(void **state) {
    (void)state;
    random_begin("announced");
    for (int n = 0; n < 40; n++) {
        raster r = raster_make(SURFACE_HILLS, random_between(1, 70), random_between(1, 70), n % 2 ? 3 : -1);
        rqt_grid grid = {.q = r.q, .valid = r.valid};
        rqt_errors errors;
        assert_int_equal(rqt_lattice_init(&grid.lattice, r.width, r.height), RQT_OK);
        assert_int_equal(rqt_errors_compute(&grid, &r.unit, &r.cost, &test_allocator, NULL, NULL, &errors), RQT_OK);
        CHECK(test_heap.live <= rqt_errors_bytes(&grid.lattice), "%dx%d: %zu bytes, %zu announced", r.width,
              r.height, test_heap.live, rqt_errors_bytes(&grid.lattice));
        rqt_errors_free(&errors, &test_allocator);
        rqt_errors_free(&errors, &test_allocator); /* twice is harmless */
        assert_int_equal(test_heap.live, 0);
        raster_free(&r);
    }
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(F48_one_refused_allocation_is_reported_and_nothing_leaks),
        TEST(F48_refused_from_then_on_is_reported_and_nothing_leaks),
        TEST(errors_take_the_memory_that_was_announced),
    };
    return cmocka_run_group_tests_name("memory", tests, NULL, NULL);
}
