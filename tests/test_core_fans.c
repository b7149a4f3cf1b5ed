/* test_core_fans.c - queries over errors of other metrics, and strips that go round the centres of blocks.
 *
 * A metric's errors, made into a pyramid, must answer as stored errors do: the threshold and both closing
 * algorithms give one mesh, that of the oracle's leaves over {error > eps}. A strip of fans is the patch: each
 * triangle once, with its own winding. */
#include "test_core_database.h"

static rqt_status query_leaves(database *d, const rqt_region *region, rqt_code eps, rqt_select select,
                               rqt_outline outline, rqt_patch *patch) {
    rqt_answer *answers = calloc(d->count ? d->count : 1, sizeof *answers);
    if (!answers) abort();
    rqt_query query = {.lattice = d->lattice,
                       .k = d->k,
                       .region = region,
                       .eps = eps,
                       .select = select,
                       .outline = outline,
                       .wants_leaves = true,
                       .answers = answers,
                       .answer_count = database_answers(d, region, eps, outline, answers),
                       .read_block = database_read,
                       .context = d};
    d->asking = &query;
    rqt_status status = rqt_query_run(&query, &test_allocator, patch);
    free(answers);
    return status;
}

static double check_fans(const rqt_patch *p) {
    uint32_t *strip = NULL;
    size_t n = 0, found = 0;
    assert_int_equal(rqt_strip_build_fans(p, &test_allocator, &strip, &n), RQT_OK);
    assert_true(p->triangle_count > 0 || n == 0);
    key *from_strip = calloc(n + 1, sizeof *from_strip), *from_patch = calloc(p->triangle_count + 1, sizeof(key));
    if (!from_strip || !from_patch) abort();
    for (size_t i = 0; i + 2 < n; i++) {
        uint32_t a = strip[i], b = strip[i + 1], c = strip[i + 2];
        assert_true(a < p->vertex_count && b < p->vertex_count && c < p->vertex_count);
        if (a == b || b == c || c == a) continue;
        from_strip[found++] = i % 2 ? key_wound(a, c, b) : key_wound(a, b, c);
    }
    for (size_t t = 0; t < p->triangle_count; t++)
        from_patch[t] = key_wound(p->triangles[3 * t], p->triangles[3 * t + 1], p->triangles[3 * t + 2]);
    if (found) qsort(from_strip, found, sizeof *from_strip, ordered_keys);
    if (p->triangle_count) qsort(from_patch, p->triangle_count, sizeof *from_patch, ordered_keys);
    CHECK(found == p->triangle_count, "the strip has %zu triangles, the patch %zu", found, p->triangle_count);
    for (size_t t = 0; t < found; t++)
        CHECK(ordered_keys(&from_strip[t], &from_patch[t]) == 0, "triangle %zu is not the patch's", t);
    free(from_strip);
    free(from_patch);
    (void)test_allocator.resize(test_allocator.context, strip, 0);
    return p->triangle_count ? (double)n / (double)p->triangle_count : 0;
}

/* Leaves of {error > eps}, by the oracle's walk. */
static void leaves_of(const model *m, const rqt_errors *e, rqt_code eps, rqt_outline outline, oracle_list *leaves) {
    unsigned char *set = oracle_set_create(&m->o);
    for (int n = 0; n < m->o.side * m->o.side; n++) {
        bool bit;
        const rqt_code code = rqt_errors_at(e, (rqt_vertex){n % m->o.side, n / m->o.side}, &bit);
        set[n] = code > eps || (outline == RQT_OUTLINE_EXACT && bit);
    }
    oracle_leaves(&m->o, set, leaves);
    free(set);
}

static void every_metric_answers_alike_by_all_ways_and_blocks(void **state) {
    (void)state;
    random_begin("metric queries");
    for (int round = 0; round < 80; round++) {
        model m;
        raster r = raster_make((surface)(round % SURFACE_COUNT), random_between(2, 30), random_between(2, 30),
                               round % 4 == 0 ? random_between(0, 8) : -1);
        if (round % 5 == 0) raster_add_lake(&r);
        model_create(&m, r);
        const rqt_metric metric = (rqt_metric)(round % RQT_METRICS);
        const rqt_outline outline = (rqt_outline)(round / RQT_METRICS % 2);
        const rqt_errors exact = m.saturated;
        assert_int_equal(rqt_metric_compute(&m.grid, &r.unit, &r.cost, metric, outline, &test_allocator, NULL, NULL,
                                            &m.saturated),
                         RQT_OK);
        for (int k = smallest_k(&m.grid.lattice); k <= largest_k(&m.grid.lattice); k++) {
            database d;
            assert_int_equal(database_create(&d, &m, k, &test_allocator), RQT_OK);
            for (int step = 0; step < 6; step++) {
                const window in = step < 2
                                      ? window_all()
                                      : random_window(m.r.width, m.r.height, random_between(0, WINDOW_KINDS - 1));
                rqt_region *region = region_of(&in, &m.grid.lattice);
                bool bit;
                rqt_code eps = rqt_errors_at(
                    &m.saturated, (rqt_vertex){random_between(0, m.o.side - 1), random_between(0, m.o.side - 1)},
                    &bit);
                if (eps > RQT_CODE_LARGEST) eps = RQT_CODE_LARGEST;
                if (step == 0) eps = 0;
                oracle_list leaves = {0};
                leaves_of(&m, &m.saturated, eps, outline, &leaves);
                key *expected = calloc(leaves.count + 1, sizeof *expected);
                if (!expected) abort();
                size_t count = 0;
                for (size_t n = 0; n < leaves.count; n++) {
                    int64_t v[3];
                    if (!window_meets(&in, &m.o, &leaves.triangle[n])) continue;
                    for (int c = 0; c < 3; c++) {
                        const oracle_point at = oracle_clamp(&m.o, leaves.triangle[n].corner[c]);
                        v[c] = (int64_t)at.y * m.r.width + at.x;
                    }
                    expected[count++] = key_unwound(v[0], v[1], v[2]);
                }
                if (count) qsort(expected, count, sizeof *expected, ordered_keys);
                for (int way = 0; way < 3; way++) {
                    rqt_patch patch;
                    assert_int_equal(query_leaves(&d, region, eps, (rqt_select)way, outline, &patch), RQT_OK);
                    key *keys = keys_of_patch(&patch, m.r.width);
                    CHECK(patch.triangle_count == count, "%s, way %d, k %d, %s: %zu triangles, should be %zu",
                          rqt_metric_name(metric), way, k, in.kind, patch.triangle_count, count);
                    for (size_t n = 0; n < count; n++)
                        CHECK(ordered_keys(&keys[n], &expected[n]) == 0, "%s, way %d, k %d: another triangle",
                              rqt_metric_name(metric), way, k);
                    check_fans(&patch);
                    free(keys);
                    rqt_patch_free(&patch);
                }
                free(expected);
                oracle_list_free(&leaves);
                rqt_region_free(region);
            }
            database_free(&d, &test_allocator);
        }
        rqt_errors_free(&m.saturated, &test_allocator);
        m.saturated = exact;
        model_free(&m);
    }
}

static void an_empty_patch_has_no_fans_and_a_patch_needs_leaves(void **state) {
    (void)state;
    rqt_patch p = {.allocator = test_allocator};
    (void)check_fans(&p);
    rqt_patch_vertex vertices[3] = {{.col = 0, .row = 0}, {.col = 1, .row = 0}, {.col = 0, .row = 1}};
    uint32_t triangle[3] = {0, 2, 1}, *strip;
    size_t n;
    p = (rqt_patch){.vertices = vertices,
                    .vertex_count = 3,
                    .triangles = triangle,
                    .triangle_count = 1,
                    .allocator = test_allocator};
    assert_int_equal(rqt_strip_build_fans(&p, &test_allocator, &strip, &n), RQT_INVALID);
    assert_true(!strip && n == 0);
}

/* A whole cell on its own: round the centre once, as the paper's sequence has it. */
static void eight_triangles_round_a_centre_are_the_papers_sequence(void **state) {
    (void)state;
    static const int rim[8][2] = {{0, 0}, {0, 1}, {0, 2}, {1, 2}, {2, 2}, {2, 1}, {2, 0}, {1, 0}};
    rqt_patch_vertex vertices[9] = {{.col = 1, .row = 1}};
    uint32_t triangles[24], *strip;
    rqt_triangle leaves[8];
    size_t n;
    for (uint32_t i = 0; i < 8; i++) {
        vertices[i + 1].col = rim[i][0], vertices[i + 1].row = rim[i][1];
        triangles[3 * i] = 0, triangles[3 * i + 1] = i + 1, triangles[3 * i + 2] = (i + 1) % 8 + 1;
        leaves[i] = (rqt_triangle){{1, 1}, {rim[i][0], rim[i][1]}, {rim[(i + 1) % 8][0], rim[(i + 1) % 8][1]}};
    }
    rqt_patch p = {.vertices = vertices,
                   .vertex_count = 9,
                   .triangles = triangles,
                   .triangle_count = 8,
                   .leaves = leaves,
                   .allocator = test_allocator};
    assert_int_equal(rqt_strip_build_fans(&p, &test_allocator, &strip, &n), RQT_OK);
    static const uint32_t expected[] = {1, 2, 0, 3, 0, 4, 0, 5, 0, 6, 0, 7, 0, 8, 1};
    assert_int_equal(n, sizeof expected / sizeof *expected);
    assert_memory_equal(strip, expected, sizeof expected);
    (void)test_allocator.resize(test_allocator.context, strip, 0);
    (void)check_fans(&p);
}

static void a_full_mesh_of_fans_costs_less_than_two_indices_a_triangle(void **state) {
    (void)state;
    random_begin("fan length");
    model m;
    model_create(&m, raster_make(SURFACE_HILLS, 65, 65, -1));
    database d;
    assert_int_equal(database_create(&d, &m, 5, &test_allocator), RQT_OK);
    const window all = window_all();
    rqt_region *region = region_of(&all, &m.grid.lattice);
    for (int step = 0; step < 4; step++) {
        rqt_patch patch;
        bool bit;
        const rqt_code eps =
            step ? (rqt_code)(rqt_errors_at(&m.saturated, (rqt_vertex){31, 33}, &bit) - 100 * step) : 0;
        assert_int_equal(query_leaves(&d, region, eps, RQT_SELECT_THRESHOLD, RQT_OUTLINE_EXACT, &patch), RQT_OK);
        const double each = check_fans(&patch);
        printf("%zu triangles: %.3f indices a triangle\n", patch.triangle_count, each);
        assert_true(each < 2);
        for (size_t fail = 1; step == 0 && fail < 4; fail++) {
            uint32_t *strip;
            size_t n;
            test_heap.calls = 0;
            test_heap.fail_from = test_heap.fail_to = fail;
            assert_int_equal(rqt_strip_build_fans(&patch, &test_allocator, &strip, &n), RQT_NO_MEMORY);
            assert_null(strip);
            test_heap.fail_from = test_heap.fail_to = 0;
        }
        rqt_patch_free(&patch);
    }
    rqt_region_free(region);
    database_free(&d, &test_allocator);
    model_free(&m);
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(every_metric_answers_alike_by_all_ways_and_blocks),
        TEST(an_empty_patch_has_no_fans_and_a_patch_needs_leaves),
        TEST(eight_triangles_round_a_centre_are_the_papers_sequence),
        TEST(a_full_mesh_of_fans_costs_less_than_two_indices_a_triangle),
    };
    return cmocka_run_group_tests_name("metrics, queries and fans", tests, NULL, NULL);
}
