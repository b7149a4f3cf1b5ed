/* test_core_strip.c - one generalized strip is the patch: each triangle once, each with its own winding.
 *
 * A strip with a wrong child order still looks right on a screen, so what is compared is the multiset of wound
 * triangles. Patches come from queries, and from bare triangle lists that no query would give. */
#include "test_core_database.h"

static void check_strip(const rqt_patch *p, size_t *length) {
    uint32_t *strip = NULL;
    size_t n = 0, found = 0;
    assert_int_equal(rqt_strip_build(p, &test_allocator, &strip, &n), RQT_OK);
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
        CHECK(ordered_keys(&from_strip[t], &from_patch[t]) == 0,
              "strip has (%d %d %d) where the patch has (%d %d %d)", (int)from_strip[t].v[0],
              (int)from_strip[t].v[1], (int)from_strip[t].v[2], (int)from_patch[t].v[0], (int)from_patch[t].v[1],
              (int)from_patch[t].v[2]);
    free(from_strip);
    free(from_patch);
    (void)test_allocator.resize(test_allocator.context, strip, 0);
    *length = n;
}

static void F39_an_empty_patch_is_an_empty_strip(void **state) {
    (void)state;
    rqt_patch p = {.allocator = test_allocator};
    size_t n;
    check_strip(&p, &n);
    assert_int_equal(n, 0);
}

static void bare_triangles_in_any_order_make_a_strip(void **state) {
    (void)state;
    random_begin("bare triangles");
    rqt_patch_vertex vertices[60] = {0};
    uint32_t triangles[3 * 50] = {0, 1, 2};
    rqt_patch p = {.vertices = vertices,
                   .vertex_count = 3,
                   .triangles = triangles,
                   .triangle_count = 1,
                   .allocator = test_allocator};
    size_t n;
    check_strip(&p, &n);
    assert_int_equal(n, 3);
    for (int round = 0; round < 300; round++) {
        p.vertex_count = (size_t)random_between(3, 60);
        p.triangle_count = (size_t)random_between(1, 50);
        for (size_t v = 0; v < p.vertex_count; v++)
            vertices[v].col = (int32_t)v, vertices[v].row = (int32_t)(v * v);
        for (size_t t = 0; t < p.triangle_count; t++) {
            uint32_t *v = &triangles[3 * t];
            do
                for (int c = 0; c < 3; c++) v[c] = (uint32_t)random_between(0, (int)p.vertex_count - 1);
            while (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]);
        }
        check_strip(&p, &n);
    }
}

static void F39_strips_of_patches_are_the_patches(void **state) {
    (void)state;
    random_begin("strips");
    for (int round = 0; round < 120; round++) {
        model m;
        database d;
        const int most = round < 8 ? 2 : 34; /* one root's two triangles, whole and with a void corner */
        raster r = raster_make((surface)random_between(0, SURFACE_COUNT - 1), random_between(2, most),
                               random_between(2, most), round < 4 ? -1 : random_between(-1, 8));
        if (round % 3 == 0) raster_add_lake(&r);
        model_create(&m, r);
        assert_int_equal(
            database_create(&d, &m, random_between(smallest_k(&m.grid.lattice), m.grid.lattice.K), &test_allocator),
            RQT_OK);
        for (int w = 0; w < 6; w++) {
            window in =
                w < 2 ? window_all() : random_window(m.r.width, m.r.height, random_between(0, WINDOW_KINDS - 1));
            rqt_region *region = region_of(&in, &m.grid.lattice);
            rqt_patch patch;
            size_t n;
            unsigned code = oracle_at(&m.o, random_between(0, m.o.side - 1), random_between(0, m.o.side - 1))->code;
            rqt_code eps = w == 0 || code > RQT_CODE_LARGEST ? 0 : (rqt_code)code;
            assert_int_equal(database_query(&d, region, eps, RQT_SELECT_THRESHOLD, (rqt_outline)(w % 2),
                                            &test_allocator, &patch),
                             RQT_OK);
            check_strip(&patch, &n);
            rqt_patch_free(&patch);
            rqt_region_free(region);
        }
        database_free(&d, &test_allocator);
        model_free(&m);
    }
}

/* The same query in every way that it can be asked: with the leaves, which takes the careful walk throughout, and
 * as triangles, strip or vertices alone, with memory of its own and with what the last query left. The triangles
 * are the same in the same order, turned alike; the strip is the one that is made of the triangles; each vertex is
 * there once, with the same error and level. */
static void check_products(database *d, const rqt_region *region, rqt_code eps, rqt_select select,
                           rqt_outline outline, rqt_scratch *scratch) {
    rqt_patch careful;
    assert_int_equal(database_query_as(d, region, eps, select, outline, RQT_PRODUCT_TRIANGLES, true, NULL,
                                       &test_allocator, &careful),
                     RQT_OK);
    for (int way = 0; way < 6; way++) {
        const rqt_product product = (rqt_product)(way % 3);
        rqt_patch p;
        assert_int_equal(database_query_as(d, region, eps, select, outline, product, false,
                                           way < 3 ? NULL : scratch, &test_allocator, &p),
                         RQT_OK);
        assert_int_equal(p.vertex_count, careful.vertex_count);
        assert_int_equal(p.triangle_count, careful.triangle_count);
        assert_true((product == RQT_PRODUCT_TRIANGLES || !p.triangles) &&
                    (product == RQT_PRODUCT_STRIP || !p.strip));
        assert_null(p.leaves);
        if (product == RQT_PRODUCT_TRIANGLES)
            for (size_t i = 0; i < 3 * p.triangle_count; i++) {
                assert_true(p.triangles[i] < p.vertex_count);
                const rqt_patch_vertex *a = &p.vertices[p.triangles[i]],
                                       *b = &careful.vertices[careful.triangles[i]];
                CHECK(a->col == b->col && a->row == b->row && a->q == b->q && a->error == b->error &&
                          a->level == b->level,
                      "corner %zu of triangle %zu is (%d,%d), not (%d,%d)", i % 3, i / 3, a->col, a->row, b->col,
                      b->row);
            }
        if (product == RQT_PRODUCT_STRIP) {
            rqt_patch list;
            uint32_t *strip;
            size_t n;
            assert_int_equal(database_query_as(d, region, eps, select, outline, RQT_PRODUCT_TRIANGLES, false, NULL,
                                               &test_allocator, &list),
                             RQT_OK);
            assert_int_equal(rqt_strip_build(&list, &test_allocator, &strip, &n), RQT_OK);
            assert_int_equal(n, p.strip_count);
            if (n) assert_memory_equal(strip, p.strip, n * sizeof *strip);
            for (size_t v = 0; v < p.vertex_count; v++)
                assert_memory_equal(&list.vertices[v].col, &p.vertices[v].col, 2 * sizeof(int32_t));
            (void)test_allocator.resize(test_allocator.context, strip, 0);
            rqt_patch_free(&list);
        }
        if (way < 3)
            rqt_patch_free(&p);
        else
            rqt_scratch_keep(scratch, &p, way == 4 ? 0 : 1 << 20);
    }
    rqt_patch_free(&careful);
}

static void every_product_is_the_same_patch(void **state) {
    (void)state;
    random_begin("products");
    rqt_scratch *scratch;
    assert_int_equal(rqt_scratch_create(&test_allocator, &scratch), RQT_OK);
    for (int round = 0; round < 100; round++) {
        model m;
        database d;
        const int most = round % 10 == 0 ? 70 : 40;
        raster r = raster_make((surface)random_between(0, SURFACE_COUNT - 1), random_between(2, most),
                               random_between(2, most), round % 2 ? -1 : random_between(0, 8));
        if (round % 5 == 1) raster_add_lake(&r);
        model_create(&m, r);
        assert_int_equal(
            database_create(&d, &m, random_between(smallest_k(&m.grid.lattice), m.grid.lattice.K), &test_allocator),
            RQT_OK);
        for (int w = 0; w < 8; w++) {
            window in =
                w < 2 ? window_all() : random_window(m.r.width, m.r.height, random_between(0, WINDOW_KINDS - 1));
            rqt_region *region = region_of(&in, &m.grid.lattice);
            unsigned code = oracle_at(&m.o, random_between(0, m.o.side - 1), random_between(0, m.o.side - 1))->code;
            rqt_code eps = w % 4 == 0 || code > RQT_CODE_LARGEST ? 0 : (rqt_code)code;
            check_products(&d, region, eps, (rqt_select)(w % 5 == 4 ? 1 : 0), (rqt_outline)(w % 2), scratch);
            rqt_region_free(region);
        }
        database_free(&d, &test_allocator);
        model_free(&m);
    }
    rqt_scratch_free(scratch);
}

/* A window that ends on the border between two blocks has nothing of the one behind it. */
static void blocks_that_only_touch_the_region_are_not_read(void **state) {
    (void)state;
    random_begin("touching");
    model m;
    database d;
    model_create(&m, raster_make(SURFACE_NOISE, 65, 65, -1));
    assert_int_equal(database_create(&d, &m, 3, &test_allocator), RQT_OK);
    const long inner[4] = {16 * ORACLE_UNITS, 16 * ORACLE_UNITS, 32 * ORACLE_UNITS, 40 * ORACLE_UNITS};
    window in = window_of(inner);
    rqt_region *region = region_of(&in, &m.grid.lattice);
    rqt_patch patch;
    assert_int_equal(
        database_query(&d, region, 0, RQT_SELECT_THRESHOLD, RQT_OUTLINE_EXACT, &test_allocator, &patch), RQT_OK);
    assert_true(patch.triangle_count > 16 * 24); /* all of 2 * 16 * 24 but where the noise is flat */
    assert_int_equal(d.reads, 2 * 3);
    rqt_patch_free(&patch);
    rqt_region_free(region);
    database_free(&d, &test_allocator);
    model_free(&m);
}

static void a_full_mesh_costs_less_than_one_and_three_quarter_indices_a_triangle(void **state) {
    (void)state;
    random_begin("strip length");
    const surface surfaces[] = {SURFACE_NOISE, SURFACE_HILLS, SURFACE_NOISE};
    for (int n = 0; n < 3; n++) {
        raster r = raster_make(surfaces[n], 129, n == 2 ? 100 : 129, -1);
        rqt_errors errors;
        model m = {.r = r, .grid = {.q = r.q}};
        database d;
        rqt_patch patch;
        size_t length;
        /* the oracle has nothing to say here, and is slow at this size */
        assert_int_equal(rqt_lattice_init(&m.grid.lattice, r.width, r.height), RQT_OK);
        assert_int_equal(rqt_errors_compute(&m.grid, &r.unit, &r.cost, &test_allocator, NULL, NULL, &errors),
                         RQT_OK);
        rqt_errors_saturate(&errors);
        m.saturated = errors;
        assert_int_equal(database_create(&d, &m, 5, &test_allocator), RQT_OK);
        window all = window_all();
        rqt_region *region = region_of(&all, &m.grid.lattice);
        for (int round = 0; round < 2; round++) {
            rqt_code eps =
                round == 0 ? 0
                           : rqt_code_floor(
                                 rqt_code_metres(rqt_errors_at(&errors, (rqt_vertex){31, 33}, &(bool){false})) / 2);
            assert_int_equal(
                database_query(&d, region, eps, RQT_SELECT_THRESHOLD, RQT_OUTLINE_EXACT, &test_allocator, &patch),
                RQT_OK);
            assert_true(patch.triangle_count > 5000);
            check_strip(&patch, &length);
            double each = (double)length / (double)patch.triangle_count;
            printf("%s %dx%d eps code %d: %.3f indices a triangle\n", r.name, r.width, r.height, eps, each);
            CHECK(each < 1.75, "%.3f indices a triangle", each);
            rqt_patch_free(&patch);
        }
        rqt_region_free(region);
        database_free(&d, &test_allocator);
        rqt_errors_free(&errors, &test_allocator);
        raster_free(&r);
    }
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(F39_an_empty_patch_is_an_empty_strip),
        TEST(bare_triangles_in_any_order_make_a_strip),
        TEST(F39_strips_of_patches_are_the_patches),
        TEST(every_product_is_the_same_patch),
        TEST(blocks_that_only_touch_the_region_are_not_read),
        TEST(a_full_mesh_costs_less_than_one_and_three_quarter_indices_a_triangle),
    };
    return cmocka_run_group_tests_name("strips", tests, NULL, NULL);
}
