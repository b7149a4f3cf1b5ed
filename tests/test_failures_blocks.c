/* test_failures_blocks.c - F16 to F18, F21, F40, F43, F44 and F47: voids, extents, thresholds and blocks on which
 * meshes crack, lose their outline or read past their end.
 *
 * As in test_failures_heights.c: rasters made for the case, meshes of rqt, and the independent verifier's word. */
#include "test_failures_support.h"

static const double every_eps[] = {0, 3, 20, 100, 1e6, INFINITY};
enum { EVERY = sizeof every_eps / sizeof *every_eps };

static raster hills_of(int width, int height) {
    return raster_of(relief_hills, width, height, 40, 0, 0, 0, "hills");
}

/* Keys of all triangles of the patches of four windows that meet at (x,y), each once. */
static size_t quarters(terrain *t, double eps, int x, int y, key *keys) {
    const long across[3] = {-1, x, t->m.r.width}, down[3] = {-1, y, t->m.r.height};
    size_t count = 0, kept = 0;
    for (int part = 0; part < 4; part++) {
        const int i = part & 1, j = part >> 1;
        const long quarter[4] = {across[i] * ORACLE_UNITS, down[j] * ORACLE_UNITS, across[i + 1] * ORACLE_UNITS,
                                 down[j + 1] * ORACLE_UNITS};
        const window w = window_of(quarter);
        rqt_patch patch = terrain_ask(t, eps, RQT_OUTLINE_EXACT, &w);
        key *some = keys_of_patch(&patch, t->m.r.width);
        memcpy(keys + count, some, patch.triangle_count * sizeof *keys);
        count += patch.triangle_count;
        free(some);
        rqt_patch_free(&patch);
    }
    if (count) qsort(keys, count, sizeof *keys, ordered_keys);
    for (size_t n = 0; n < count; n++)
        if (n == 0 || ordered_keys(&keys[n], &keys[kept - 1])) keys[kept++] = keys[n];
    return kept;
}

/* Whole and in four windows that meet at a block corner, for blocks of every size. Takes the raster over. */
static void check_voids(raster r) {
    rqt_lattice l;
    assert_int_equal(rqt_lattice_init(&l, r.width, r.height), RQT_OK);
    for (int k = 1; k <= largest_k(&l); k++) {
        terrain t = terrain_create(raster_from_memory(r.width, r.height, r.q, r.valid, &r.unit, r.name), k);
        key *parts = calloc((size_t)(8 * r.width * r.height), sizeof *parts);
        if (!parts) abort();
        for (int e = 0; e < EVERY; e++) {
            (void)check_mesh(&t, every_eps[e]);
            rqt_patch whole = terrain_ask(&t, every_eps[e], RQT_OUTLINE_EXACT, NULL);
            key *all = keys_of_patch(&whole, r.width);
            const size_t count = quarters(&t, every_eps[e], 16, 16, parts);
            CHECK(count == whole.triangle_count, "%s, k %d, eps %g: neighbours have %zu triangles, the whole %zu",
                  r.name, k, every_eps[e], count, whole.triangle_count);
            if (count) assert_memory_equal(all, parts, count * sizeof *all);
            free(all);
            rqt_patch_free(&whole);
        }
        free(parts);
        terrain_free(&t);
    }
    raster_free(&r);
}

/* F16. The outline `exact` covers exactly the half-cells with three valid corners, touches no void, and neighbours
 * agree along it. */
static void F16_voids_at_block_corners_centres_and_borders_keep_the_exact_outline(void **state) {
    (void)state;
    random_begin("F16");
    static const int spots[][2] = {{16, 16}, {8, 8}, {16, 8}, {0, 0}, {32, 32}, {32, 16}, {20, 12}, {17, 16}};
    for (size_t n = 0; n < sizeof spots / sizeof *spots; n++) {
        raster r = hills_of(33, 33);
        raster_void(&r, spots[n][0], spots[n][1]);
        r.name = "one void";
        check_voids(r);
    }
    for (int line = 0; line < 4;
         line++) { /* whole rows and columns: of the raster's border, of a block's, beside it */
        static const int at[] = {0, 16, 32, 15};
        for (int down = 0; down < 2; down++) {
            raster r = hills_of(33, 33);
            r.name = "a line of voids";
            for (int i = 0; i < 33; i++) raster_void(&r, down ? at[line] : i, down ? i : at[line]);
            check_voids(r);
        }
    }
    raster r = hills_of(38, 27);
    for (int i = 0; i < 60; i++) raster_void(&r, random_between(0, 37), random_between(0, 26));
    check_voids(r);
}

/* F17, but for blocks that are missing: test_store_faults. */
static void F17_void_blocks_and_checkerboards_of_voids_keep_the_exact_outline(void **state) {
    (void)state;
    random_begin("F17");
    for (int which = 0; which < 5; which++) {
        raster r = hills_of(which == 4 ? 40 : 33, 33);
        static const char *const names[] = {"a void block", "all void", "checkerboard of voids",
                                            "checkerboard of void blocks", "void past a power of two"};
        r.name = names[which];
        for (int y = 0; y < r.height; y++)
            for (int x = 0; x < r.width; x++)
                if (which == 0   ? x >= 16 && x <= 24 && y >= 8 && y <= 16
                    : which == 1 ? true
                    : which == 2 ? ((x ^ y) & 1) != 0
                    : which == 3 ? (((x >> 3) ^ (y >> 3)) & 1) != 0
                                 : x >= 32)
                    raster_void(&r, x, y);
        check_voids(r);
    }
}

/* F18. No half-cell has three valid corners: there is no triangle, at no eps. */
static void F18_single_valid_samples_and_strips_have_no_triangle(void **state) {
    (void)state;
    random_begin("F18");
    static const int spots[][2] = {{0, 0}, {16, 16}, {32, 32}, {5, 16}, {9, 20}};
    for (int which = 0; which < 8; which++) {
        raster r = hills_of(33, 33);
        r.name = which < 5 ? "one valid sample" : "a strip";
        for (int y = 0; y < 33; y++)
            for (int x = 0; x < 33; x++) {
                const bool valid = which < 5    ? x == spots[which][0] && y == spots[which][1]
                                   : which == 5 ? y == 16
                                   : which == 6 ? x == 7
                                                : x == y && x % 2 == 0;
                if (!valid) raster_void(&r, x, y);
            }
        assert_int_equal(halves_of(&r), 0);
        check_voids(r);
    }
    /* two samples wide: all of its half-cells, and nothing beside them */
    raster r = hills_of(33, 33);
    for (int i = 0; i < 33 * 33; i++)
        if (i / 33 < 15 || i / 33 > 16) raster_void(&r, i % 33, i / 33);
    assert_int_equal(halves_of(&r), 64);
    check_voids(r);
}

/* F21. A border vertex is stored by each block that has it: heights, errors and flags are the same bytes before and
 * after they were stored. A sparse block drops what is never selected in it: what two blocks keep is compared. */
static void F21_border_copies_are_equal_byte_for_byte(void **state) {
    (void)state;
    random_begin("F21");
    size_t compared = 0;
    for (int round = 0; round < 6; round++) {
        raster r = raster_make(round % 2 ? SURFACE_HILLS : SURFACE_NOISE, 33 + round, 33, -1);
        if (round >= 2) raster_add_lake(&r);
        const int width = r.width, side = 1 << (width > 33 ? 6 : 5);
        for (int k = 1; k <= 3; k++) {
            terrain t = terrain_create(raster_from_memory(width, 33, r.q, r.valid, &r.unit, r.name), k);
            const size_t n = (size_t)(side + 1) * (size_t)(side + 1), cells = (size_t)(1 << k) + 1;
            for (int level = 0; level <= t.d.lattice.K - k; level++) {
                rqt_patch_vertex *seen = calloc(n, sizeof *seen); /* level: 0 never seen, else flags + 1 */
                if (!seen) abort();
                for (size_t b = 0; b < t.d.count; b++) {
                    const stored *s = &t.d.block[b];
                    if (s->place.level != level) continue;
                    assert_int_equal(rqt_block_decode(t.d.codec, s->bytes, s->size, &t.d.scratch), RQT_OK);
                    rqt_block_set_corners(&t.d.scratch, &s->summary);
                    for (size_t i = 0; i < cells * cells; i++) {
                        const rqt_vertex v = {s->place.x + (int32_t)(i % cells) * s->place.stride,
                                              s->place.y + (int32_t)(i / cells) * s->place.stride};
                        const rqt_block *block = &t.d.scratch;
                        const bool kept =
                            !block->sparse || block->error[i] > block->floor || block->flags[i] & RQT_OUTLINE;
                        rqt_patch_vertex *before = &seen[(size_t)v.y * (size_t)(side + 1) + (size_t)v.x];
                        /* past the raster nobody asks */
                        if (!kept || v.x >= width || v.y >= 33) continue;
                        const int32_t q = block->flags[i] & RQT_VALID ? block->q[i] : 0;
                        if (before->level) {
                            compared++;
                            CHECK(before->q == q && before->error == block->error[i] &&
                                      before->level == block->flags[i] + 1,
                                  "k %d, level %d: (%d,%d) has two heights, errors or flags", k, level, v.x, v.y);
                        }
                        *before = (rqt_patch_vertex){
                            .q = q, .error = block->error[i], .level = (uint8_t)(block->flags[i] + 1)};
                    }
                }
                free(seen);
            }
            terrain_free(&t);
        }
        raster_free(&r);
    }
    assert_true(compared > 2000);
}

/* F40. 2 x 2, one row, one column, 2^k + 1 and its neighbours, long and short: the mesh ends where the raster ends.
 */
static void F40_meshes_of_every_extent_end_with_the_raster(void **state) {
    (void)state;
    random_begin("F40");
    const double eps[] = {0, 5, 40, 300};
    for (int width = 1; width <= 18; width++)
        for (int height = 1; height <= 18; height++) check_raster(hills_of(width, height), eps, 4);
    static const int extents[][2] = {{31, 32}, {32, 32}, {32, 34}, {34, 34}, {35, 2}, {1, 70}, {65, 66}, {66, 64}};
    for (size_t n = 0; n < sizeof extents / sizeof *extents; n++)
        check_raster(hills_of(extents[n][0], extents[n][1]), eps, 4);
}

/* F43. Selected is what errs more than eps: at a stored error itself its vertices are out, a double below it they
 * are in. The number of vertices is counted from the errors, not by a query. */
static void F43_eps_below_at_and_above_every_stored_error(void **state) {
    (void)state;
    random_begin("F43");
    for (int round = 0; round < 3; round++) {
        terrain t = terrain_create(hills_of(33, 33), 2 + round);
        const rqt_errors *errors = &t.m.saturated;
        uint8_t *is_there = calloc(65536, 1);
        if (!is_there) abort();
        for (int i = 0; i < 33 * 33; i++)
            is_there[rqt_errors_at(errors, (rqt_vertex){i % 33, i / 33}, &(bool){false})] = 1;
        for (unsigned code = 0; code < RQT_CODE_INFINITY; code++) {
            if (!is_there[code]) continue;
            const double stored_error = rqt_code_metres((rqt_code)code);
            for (int side = code ? -1 : 0; side <= 1; side++) {
                const double eps = side ? nextafter(stored_error, side < 0 ? 0 : INFINITY) : stored_error;
                size_t wanted = 0;
                for (int i = 0; i < 33 * 33; i++)
                    wanted +=
                        rqt_code_metres(rqt_errors_at(errors, (rqt_vertex){i % 33, i / 33}, &(bool){false})) > eps;
                const size_t seen = check_mesh(&t, eps);
                CHECK(seen == wanted, "eps %.17g beside %.17g: %zu vertices, should be %zu", eps, stored_error,
                      seen, wanted);
            }
        }
        free(is_there);
        terrain_free(&t);
    }
}

/* F44, block order. Whatever order an index lists its blocks in, the patch is the same to the order of its rows.
 * Jobs and sources: test_import_faults, test_import. */
static void F44_blocks_in_any_order_give_the_same_rows(void **state) {
    (void)state;
    random_begin("F44");
    for (int round = 0; round < 6; round++) {
        raster r = hills_of(60, 41);
        if (round % 2) raster_add_lake(&r);
        terrain t = terrain_create(r, 2);
        rqt_patch first = terrain_ask(&t, 10, RQT_OUTLINE_EXACT, NULL);
        for (int again = 0; again < 8; again++) { /* database_answers shuffles */
            rqt_patch other = terrain_ask(&t, 10, RQT_OUTLINE_EXACT, NULL);
            assert_int_equal(first.vertex_count, other.vertex_count);
            assert_int_equal(first.triangle_count, other.triangle_count);
            assert_memory_equal(first.triangles, other.triangles, 12 * first.triangle_count);
            for (size_t v = 0; v < first.vertex_count; v++)
                assert_true(first.vertices[v].col == other.vertices[v].col &&
                            first.vertices[v].row == other.vertices[v].row &&
                            first.vertices[v].error == other.vertices[v].error);
            rqt_patch_free(&other);
        }
        rqt_patch_free(&first);
        terrain_free(&t);
    }
}

/* F47. The number of a block by its definition, bit by bit, on all levels that there are. */
static void F47_numbers_of_blocks_of_twenty_levels_are_morton_codes(void **state) {
    (void)state;
    random_begin("F47 numbers");
    rqt_lattice l;
    const int32_t side = 1 << RQT_MAX_K;
    assert_int_equal(rqt_lattice_init(&l, side + 1, side + 1), RQT_OK);
    for (int n = 0; n < 20000; n++) {
        const int k = random_between(0, RQT_MAX_BLOCK_K), level = random_between(0, RQT_MAX_K - k);
        const int32_t last = (1 << level) - 1;
        const int32_t i = n % 7 ? random_between(0, last) : last, j = n % 5 ? random_between(0, last) : last;
        uint64_t number = 1;
        for (int bit = level - 1; bit >= 0; bit--)
            number = number * 4 + (uint64_t)(j >> bit & 1) * 2 + (uint64_t)(i >> bit & 1);
        CHECK(rqt_block_number_of(level, i, j) == number, "level %d, cell (%d,%d): number %llu, should be %llu",
              level, i, j, (unsigned long long)rqt_block_number_of(level, i, j), (unsigned long long)number);
        rqt_block_place place;
        assert_int_equal(rqt_block_locate(&l, k, number, &place), RQT_OK);
        CHECK(place.level == level && place.i == i && place.j == j && place.side == side >> level &&
                  place.x == i * (side >> level) && place.y == j * (side >> level) &&
                  place.stride == place.side >> k,
              "block %llu is not where it should be", (unsigned long long)number);
    }
}

/* F47. The largest terrain there is, one cell high: all of 20 levels, with heights where its blocks end. Blocks are
 * made, encoded and found by number as they are asked for; the windows lie at both ends and over the middle. */
typedef struct long_terrain {
    rqt_pyramid *pyramid;
    rqt_lattice lattice;
    int k;
    rqt_block block;
    size_t reads;
} long_terrain;

static size_t place_in_pyramid(const long_terrain *t, rqt_block_number number) {
    size_t low = 0, high = rqt_pyramid_count(t->pyramid);
    while (low < high) {
        const size_t middle = (low + high) / 2;
        rqt_block_number at;
        rqt_summary summary;
        rqt_pyramid_block(t->pyramid, middle, &at, &summary, NULL);
        if (at < number)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

static const rqt_block *read_long(void *context, rqt_block_number number) {
    long_terrain *t = context;
    rqt_block_number told;
    rqt_summary summary;
    rqt_pyramid_block(t->pyramid, place_in_pyramid(t, number), &told, &summary, &t->block);
    assert_true(told == number);
    rqt_block_set_corners(&t->block, &summary);
    t->reads++;
    return &t->block;
}

static void F47_a_terrain_of_twenty_levels_answers_at_both_ends(void **state) {
    (void)state;
    random_begin("F47 terrain");
    const int32_t width = (1 << RQT_MAX_K) + 1;
    raster r = raster_from_memory(width, 2, NULL, NULL, &UNIT_METRE, "longest");
    for (int32_t x = 0; x < width; x++) /* tents over tents, so that every level has errors of its own */
        for (int32_t y = 0; y < 2; y++) r.q[y * width + x] = takagi(x, y, 1 << 12) + x / 1000;
    long_terrain t = {.k = 5};
    rqt_grid grid = {.q = r.q};
    rqt_errors errors;
    assert_int_equal(rqt_lattice_init(&t.lattice, width, 2), RQT_OK);
    assert_int_equal(t.lattice.K, RQT_MAX_K);
    grid.lattice = t.lattice;
    assert_int_equal(rqt_errors_compute(&grid, &r.unit, &r.cost, &test_allocator, NULL, NULL, &errors), RQT_OK);
    rqt_errors_saturate(&errors);
    assert_int_equal(rqt_pyramid_create(&grid, &errors, t.k, &test_allocator, &t.pyramid), RQT_OK);
    assert_int_equal(rqt_block_create(t.k, &test_allocator, &t.block), RQT_OK);
    const size_t count = rqt_pyramid_count(t.pyramid);
    assert_int_equal(count, (2u << (RQT_MAX_K - t.k)) - 1);
    rqt_answer *answers = malloc(count * sizeof *answers);
    verify_triangle *triangles = NULL;
    if (!answers) abort();
    const double all_eps[] = {0, 50, 1000, 1e9};
    const int32_t from[] = {0, width - 3000, width / 2 - 1500};
    for (int e = 0; e < 4; e++) {
        const rqt_code eps = rqt_code_eps(all_eps[e], 0);
        size_t answering = 0;
        for (size_t b = 0; b < count; b++) {
            rqt_answer a;
            rqt_pyramid_block(t.pyramid, b, &a.number, &a.summary, NULL);
            if (rqt_summary_answers(&a.summary, RQT_OUTLINE_EXACT, eps)) answers[answering++] = a;
        }
        for (int w = 0; w < 3; w++) {
            const long box[4] = {from[w] * ORACLE_UNITS, -ORACLE_UNITS, (from[w] + 2999L) * ORACLE_UNITS,
                                 2 * ORACLE_UNITS};
            const window in = window_of(box);
            rqt_region *region = region_of(&in, &t.lattice);
            rqt_query query = {.lattice = t.lattice,
                               .k = t.k,
                               .region = region,
                               .eps = eps,
                               .outline = RQT_OUTLINE_EXACT,
                               .answers = malloc(answering * sizeof *answers),
                               .read_block = read_long,
                               .context = &t};
            rqt_patch patch;
            if (!query.answers) abort();
            for (size_t a = 0; a < answering; a++) { /* what an index would list */
                rqt_block_place p;
                assert_int_equal(rqt_block_locate(&t.lattice, t.k, answers[a].number, &p), RQT_OK);
                if (p.x <= from[w] + 2999 && p.x + (int64_t)p.side >= from[w])
                    query.answers[query.answer_count++] = answers[a];
            }
            assert_int_equal(rqt_query_run(&query, &test_allocator, &patch), RQT_OK);
            /* the window of samples that the patch reaches over */
            int32_t left = width, right = 0;
            triangles = calloc(patch.triangle_count + 1, sizeof *triangles);
            if (!triangles) abort();
            for (size_t i = 0; i < 3 * patch.triangle_count; i++) {
                const rqt_patch_vertex *v = &patch.vertices[patch.triangles[i]];
                triangles[i / 3].corner[i % 3] = (verify_corner){.col = v->col, .row = v->row, .q = v->q};
                left = v->col < left ? v->col : left;
                right = v->col > right ? v->col : right;
            }
            const int32_t span = right - left + 1;
            int32_t *q = malloc(2 * (size_t)span * sizeof *q);
            if (!q) abort();
            for (int row = 0; row < 2; row++)
                memcpy(q + (size_t)row * (size_t)span, r.q + (size_t)row * (size_t)width + left,
                       (size_t)span * sizeof *q);
            const verify_samples samples = {
                .col0 = left, .width = span, .height = 2, .q = q, .quantum = 1, .cell_x = 1, .cell_y = 1};
            verify_report v;
            assert_int_equal(verify_mesh(&samples, triangles, patch.triangle_count, &v), VERIFY_OK);
            CHECK(v.max_error <= all_eps[e] && v.t_junctions == 0 && v.overlaps == 0 && v.samples >= 2 * 3000,
                  "eps %g from %d: off by %g, %llu T-junctions, %llu overlaps, %llu samples", all_eps[e], from[w],
                  v.max_error, (unsigned long long)v.t_junctions, (unsigned long long)v.overlaps,
                  (unsigned long long)v.samples);
            free(q);
            free(triangles);
            free(query.answers);
            rqt_patch_free(&patch);
            rqt_region_free(region);
        }
    }
    assert_true(t.reads > 100);
    free(answers);
    rqt_block_free(&t.block, &test_allocator);
    rqt_pyramid_free(t.pyramid);
    rqt_errors_free(&errors, &test_allocator);
    raster_free(&r);
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(F16_voids_at_block_corners_centres_and_borders_keep_the_exact_outline),
        TEST(F17_void_blocks_and_checkerboards_of_voids_keep_the_exact_outline),
        TEST(F18_single_valid_samples_and_strips_have_no_triangle),
        TEST(F21_border_copies_are_equal_byte_for_byte),
        TEST(F40_meshes_of_every_extent_end_with_the_raster),
        TEST(F43_eps_below_at_and_above_every_stored_error),
        TEST(F44_blocks_in_any_order_give_the_same_rows),
        TEST(F47_numbers_of_blocks_of_twenty_levels_are_morton_codes),
        TEST(F47_a_terrain_of_twenty_levels_answers_at_both_ends),
    };
    return cmocka_run_group_tests_name("failures: voids, extents and blocks", tests, NULL, NULL);
}
