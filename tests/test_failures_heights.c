/* test_failures_heights.c - F1 to F9, F11 and F15: surfaces and tolerances on which published errors do not bound.
 *
 * Each test is a case of the catalogue: rasters made for it, meshes of rqt at eps on both sides of what decides,
 * and the independent verifier's word on them. What other methods give on the same rasters: examples/STABILITY.md.
 */
#include "test_failures_support.h"

/* F1. Whatever the extent and the blocks: two triangles, without an error. */
static void F1_constants_and_planes_are_two_triangles_at_eps_0(void **state) {
    (void)state;
    static const int extents[][2] = {{2, 2}, {3, 3}, {33, 33}, {34, 33}, {5, 40}, {32, 32}, {2, 31}};
    for (size_t n = 0; n < sizeof extents / sizeof *extents; n++) {
        for (int tilt = 0; tilt < 3; tilt++) {
            raster r = raster_of(relief_plane, extents[n][0], extents[n][1], tilt * 2, tilt * -6, 40, 0,
                                 tilt ? "plane" : "constant");
            rqt_lattice l;
            assert_int_equal(rqt_lattice_init(&l, r.width, r.height), RQT_OK);
            for (int k = smallest_k(&l); k <= largest_k(&l); k++) {
                terrain t = terrain_create(raster_from_memory(r.width, r.height, r.q, NULL, &r.unit, r.name), k);
                rqt_patch patch = terrain_ask(&t, 0, RQT_OUTLINE_EXACT, NULL);
                const verify_report v = prove(&r, &patch);
                CHECK(patch.triangle_count == 2 && patch.vertex_count == 4, "%s %dx%d: %zu triangles", r.name,
                      r.width, r.height, patch.triangle_count);
                assert_true(v.max_error == 0 && v.twice_area == halves_of(&r));
                assert_int_equal(t.d.reads, 0); /* index rows are enough */
                rqt_patch_free(&patch);
                terrain_free(&t);
            }
            raster_free(&r);
        }
    }
}

/* F3. The local error of every vertex is the height of one tent: at that eps nothing is selected by it, and all the
 * smaller tents are missed. */
static void F3_takagis_surface_is_within_eps_where_local_errors_miss_tents(void **state) {
    (void)state;
    const double eps[] = {0, 16, 63, 64, 127, 128, 129, 200, 400};
    check_raster(raster_of(relief_takagi, 65, 65, 64, 64, 0, 0, "takagi"), eps, sizeof eps / sizeof *eps);
    terrain t = terrain_create_as(raster_of(relief_takagi, 65, 65, 64, 64, 0, 0, "takagi"), 4, RQT_METRIC_LOCAL,
                                  RQT_OUTLINE_EXACT);
    rqt_patch patch = terrain_ask(&t, 128, RQT_OUTLINE_EXACT, NULL);
    const verify_report local = prove(&t.m.r, &patch);
    CHECK(local.max_error > 3 * 128, "local errors give %g", local.max_error);
    rqt_patch_free(&patch);
    terrain_free(&t);
}

/* F4. Single triangles err by up to twice the amplitude, though no sample is further than that from 0. */
static void F4_white_noise_is_within_eps_and_minimal_is_no_larger(void **state) {
    (void)state;
    random_begin("F4");
    const double eps[] = {100, 101, 125, 150, 175, 199, 200};
    for (int round = 0; round < 3; round++) {
        raster r = raster_of(relief_noise, 65, round ? 65 : 52, 100, 0, 0, 0, "noise");
        raster copy = raster_from_memory(r.width, r.height, r.q, NULL, &r.unit, r.name);
        terrain exact = terrain_create(r, 4);
        terrain minimal = terrain_create_as(copy, 4, RQT_METRIC_MINIMAL, RQT_OUTLINE_EXACT);
        for (size_t e = 0; e < sizeof eps / sizeof *eps; e++) {
            const size_t least = check_mesh(&minimal, eps[e]), seen = check_mesh(&exact, eps[e]);
            CHECK(least <= seen, "eps %g: minimal has %zu vertices, exact %zu", eps[e], least, seen);
        }
        terrain_free(&exact);
        terrain_free(&minimal);
    }
}

static void check_spike(int x, int y, int side, int height) {
    const double eps[] = {nextafter(abs(height), 0), abs(height), abs(height) + 1};
    for (int k = 1; k <= 5; k += 2) {
        terrain t = terrain_create(raster_of(relief_spike, side, side, x, y, height, 0, "spike"), k);
        for (int e = 0; e < 3; e++) {
            (void)check_mesh(&t, eps[e]);
            rqt_patch patch = terrain_ask(&t, eps[e], RQT_OUTLINE_EXACT, NULL);
            const bool corner = x % (side - 1) == 0 && y % (side - 1) == 0;
            CHECK(patch_has(&patch, x, y) == (corner || e == 0), "spike (%d,%d) of %d, eps %.17g, k %d", x, y,
                  height, eps[e], k);
            CHECK(e == 0 || patch.vertex_count == 4, "spike (%d,%d) of %d, eps %.17g: %zu vertices", x, y, height,
                  eps[e], patch.vertex_count);
            rqt_patch_free(&patch);
        }
        terrain_free(&t);
    }
}

/* F5. Corners of the root are in every mesh; anywhere else the spike is kept iff it is higher than eps, and at eps
 * equal to it the mesh is two triangles again. */
static void F5_a_spike_is_kept_iff_it_is_higher_than_eps(void **state) {
    (void)state;
    static const int places[][2] = {{0, 0},  {32, 32}, {32, 0}, {7, 0},   {0, 21}, {32, 5},  {16, 32}, {8, 8},
                                    {16, 8}, {16, 16}, {24, 4}, {13, 19}, {1, 1},  {31, 30}, {9, 8},   {2, 12}};
    for (size_t n = 0; n < sizeof places / sizeof *places; n++) {
        check_spike(places[n][0], places[n][1], 33, 40);
        check_spike(places[n][0], places[n][1], 33, -1);
    }
}

/* F6. Everything above is flat: a search that stops at the first vertex that fits never gets there. */
static void F6_a_pit_of_one_sample_is_never_skipped(void **state) {
    (void)state;
    for (int width = 17; width <= 18; width++) {
        for (int n = 0; n < width * 17; n++) {
            const int x = n % width, y = n / width;
            terrain t = terrain_create(raster_of(relief_spike, width, 17, x, y, -9, 0, "pit"), 1 + n % 4);
            (void)check_mesh(&t, 8);
            rqt_patch patch = terrain_ask(&t, 8, RQT_OUTLINE_EXACT, NULL);
            CHECK(patch_has(&patch, x, y), "the pit at (%d,%d) of %d x 17 is not in the mesh", x, y, width);
            rqt_patch_free(&patch);
            terrain_free(&t);
        }
    }
}

/* F7. */
static void F7_cliffs_of_any_direction_are_within_eps(void **state) {
    (void)state;
    static const int lines[][3] = {{1, 0, 15}, {1, 0, 16}, {1, 0, 17}, {0, 1, 12},  {1, 1, 33},   {1, -1, 0},
                                   {1, -1, 3}, {1, 2, 40}, {3, 1, 50}, {5, -7, 11}, {13, 1, 300}, {1, -17, -90}};
    const double eps[] = {0, 30, 62, 80, 99, 100, 124, 150, 180, 220, 250, 300, 350, 400, 499, 500};
    for (size_t n = 0; n < sizeof lines / sizeof *lines; n++)
        check_raster(
            raster_of(relief_cliff, n % 2 ? 33 : 47, 33, lines[n][0], lines[n][1], lines[n][2], 500, "cliff"), eps,
            sizeof eps / sizeof *eps);
}

/* The keys of the whole mesh. */
static key *mesh_of(terrain *t, double eps, rqt_select select, size_t *count) {
    const window all = window_all();
    rqt_region *region = region_of(&all, &t->m.grid.lattice);
    rqt_patch patch;
    assert_int_equal(
        database_query(&t->d, region, rqt_code_eps(eps, 0), select, RQT_OUTLINE_EXACT, &test_allocator, &patch),
        RQT_OK);
    key *keys = keys_of_patch(&patch, t->m.r.width);
    *count = patch.triangle_count;
    rqt_patch_free(&patch);
    rqt_region_free(region);
    return keys;
}

/* F8. Both diagonals of every cell are as good: the lattice decides, not the data, nor the blocks, nor the way of
 * selecting. */
static void F8_a_checkerboard_saddle_has_one_mesh_and_keeps_the_bound(void **state) {
    (void)state;
    static const int extents[][2] = {{33, 33}, {40, 25}, {21, 34}};
    const double eps[] = {0, 38.5, 40, 60, 76, 77};
    for (int n = 0; n < 3; n++) {
        const int width = extents[n][0], height = extents[n][1];
        check_raster(raster_of(relief_saddle, width, height, 77, 19, 40, 0, "saddle"), eps, 6);
        for (int e = 0; e < 6; e++) {
            key *first = NULL;
            size_t first_count = 0;
            for (int k = 1; k <= 5; k++) {
                terrain t = terrain_create(raster_of(relief_saddle, width, height, 77, 19, 40, 0, "saddle"), k);
                for (int select = 0; select < 3; select++) {
                    size_t count;
                    key *keys = mesh_of(&t, eps[e], (rqt_select)select, &count);
                    if (!first) {
                        first = keys;
                        first_count = count;
                        continue;
                    }
                    CHECK(count == first_count, "eps %g, k %d, select %d: %zu triangles, else %zu", eps[e], k,
                          select, count, first_count);
                    assert_memory_equal(keys, first, count * sizeof *keys);
                    free(keys);
                }
                terrain_free(&t);
            }
            free(first);
        }
    }
}

/* F9. A ridge along one diagonal is along the triangles' edges, along the other across them. */
static void F9_a_ridge_along_either_diagonal_and_turned_is_within_eps(void **state) {
    (void)state;
    random_begin("F9");
    const double eps[] = {0, 5, 13, 19, 26, 39, 40, 60, 65, 80, 100, 120, 150, 200, 260, 400};
    for (int diagonal = 0; diagonal < 2; diagonal++) {
        for (int n = 0; n < 3; n++) {
            raster r = raster_of(relief_ridge, n == 2 ? 29 : 33, 33, diagonal, 13, n == 2 ? 25 : 32, n == 1 ? 6 : 0,
                                 "ridge");
            raster turned = raster_turned(&r);
            check_raster(r, eps, 16);
            check_raster(turned, eps, 16);
        }
    }
}

/* F11. */
static void F11_an_eps_below_the_unit_bounds_and_eps_0_is_lossless(void **state) {
    (void)state;
    random_begin("F11");
    const rqt_unit units[] = {UNIT_METRE, UNIT_FOOT, UNIT_MILLIMETRE, UNIT_SURVEY_FOOT};
    for (int u = 0; u < 4; u++) {
        const double quantum = fabs(rqt_unit_factor(&units[u])) / units[u].d;
        /* planes but for a quantum here and there: what a fraction of the unit decides */
        raster r = raster_of(relief_plane, 33, 30, 3, -1, 7, 0, "nearly a plane");
        r.unit = units[u];
        for (int n = 0; n < r.width * r.height; n++) r.q[n] += random_between(0, 5) == 0;
        const double eps[] = {0, quantum * 0x1p-30, quantum / 4, quantum / 2, nextafter(quantum, 0), quantum};
        terrain t = terrain_create(raster_from_memory(r.width, r.height, r.q, NULL, &r.unit, r.name), 3);
        rqt_patch patch = terrain_ask(&t, 0, RQT_OUTLINE_EXACT, NULL);
        const verify_report v = prove(&r, &patch);
        assert_true(v.max_error == 0);
        rqt_patch_free(&patch);
        const size_t most = check_mesh(&t, eps[1]), least = check_mesh(&t, quantum);
        CHECK(least < most, "a quantum decides nothing: %zu and %zu vertices", least, most);
        terrain_free(&t);
        check_raster(r, eps, sizeof eps / sizeof *eps);
    }
}

/* F15. Sums of squares of legs times the largest heights there are; UBSan is the judge of what overflows. */
static void F15_the_largest_heights_overflow_nothing(void **state) {
    (void)state;
    random_begin("F15");
    static const int extents[][2] = {{33, 33}, {50, 21}, {2, 300}, {257, 3}};
    for (size_t n = 0; n < sizeof extents / sizeof *extents; n++) {
        raster r = raster_of(relief_plane, extents[n][0], extents[n][1], 0, 0, 0, 0, "extremes");
        for (int i = 0; i < r.width * r.height; i++)
            r.q[i] = random_between(0, 1) ? RQT_HEIGHT_LIMIT - 1 : 1 - RQT_HEIGHT_LIMIT;
        const double range = 2.0 * (RQT_HEIGHT_LIMIT - 1), eps[] = {0, 1, range / 2, range - 1, range, 2 * range};
        check_raster(r, eps, 6);
    }
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(F1_constants_and_planes_are_two_triangles_at_eps_0),
        TEST(F3_takagis_surface_is_within_eps_where_local_errors_miss_tents),
        TEST(F4_white_noise_is_within_eps_and_minimal_is_no_larger),
        TEST(F5_a_spike_is_kept_iff_it_is_higher_than_eps),
        TEST(F6_a_pit_of_one_sample_is_never_skipped),
        TEST(F7_cliffs_of_any_direction_are_within_eps),
        TEST(F8_a_checkerboard_saddle_has_one_mesh_and_keeps_the_bound),
        TEST(F9_a_ridge_along_either_diagonal_and_turned_is_within_eps),
        TEST(F11_an_eps_below_the_unit_bounds_and_eps_0_is_lossless),
        TEST(F15_the_largest_heights_overflow_nothing),
    };
    return cmocka_run_group_tests_name("failures: heights and eps", tests, NULL, NULL);
}
