/* test_failures_import.c - F14, F15 and F41: what a raster can hold and where it can lie, through the import and
 * back.
 *
 * Extremes of the band types, as data and as marks of voids; and a terrain so far from its CRS's origin, with cells
 * so small, that an index in single precision would lose blocks at the border of a window. */
#include "test_import_support.h"

static int ask(const terrain *t, const char *wkt, double eps, rqt_patch *patch) {
    rqt_geometry *geometry = NULL;
    rqt_region *region = NULL;
    rqt_message why;
    char *error = NULL;
    store_query_options how = {.select = RQT_SELECT_THRESHOLD, .outline = RQT_OUTLINE_EXACT};
    if (wkt)
        assert_int_equal(rqt_geometry_parse(wkt, strlen(wkt), true, store_allocator(), &geometry, &why), RQT_OK);
    assert_int_equal(rqt_region_create(geometry, &t->t->placement, &t->t->lattice, store_allocator(), &region),
                     RQT_OK);
    const int code = store_query(t->store, t->t, region, eps, &how, patch, NULL, &error);
    if (code) fail_msg("%s: %s", wkt ? wkt : "all", error);
    rqt_geometry_free(geometry);
    rqt_region_free(region);
    return code;
}

/* The vertices of the mesh at eps 0 and infinity: their heights are the samples' own, in metres. */
static void expect_vertices(const terrain *t, const double *wanted) {
    for (int finite = 0; finite < 2; finite++) {
        rqt_patch patch;
        ask(t, NULL, finite ? 0 : INFINITY, &patch);
        assert_true(patch.vertex_count >= 4);
        for (size_t v = 0; v < patch.vertex_count; v++) {
            const rqt_patch_vertex *p = &patch.vertices[v];
            const double z = rqt_unit_metres(&t->t->unit, p->q),
                         right = wanted[p->row * t->t->lattice.width + p->col];
            if (z != right) fail_msg("vertex (%d,%d) is %.17g, the sample %.17g", p->col, p->row, z, right);
        }
        rqt_patch_free(&patch);
    }
}

/* F14. -32768 is a height, unless the raster or the user says that it marks voids. */
static void F14_int16_extremes_are_heights_unless_declared_void(void **unused) {
    (void)unused;
    double values[12 * 12], wanted[12 * 12];
    for (int s = 0; s < 144; s++) values[s] = s % 3 ? s % 2 ? 32767 : -32767 : 100 * s - 5000;
    values[77] = values[78] = values[0] = -32768;
    for (int way = 0; way < 3; way++) {
        begin(NULL);
        memcpy(wanted, values, sizeof values);
        for (int s = 0; way && s < 144; s++)
            if (values[s] == -32768) wanted[s] = NAN;
        import_options o = defaults();
        o.has_nodata = way == 2;
        o.nodata = -32768;
        raster r = {
            .name = "a.tif", .width = 12, .height = 12, .type = GDT_Int16, .nodata = way == 1 ? "-32768" : NULL};
        import_fine(write_raster(&r, values), file("a.gpkg"), &o);
        assert_int_equal(report.voids, way ? 3 : 0);
        terrain t = open_terrain(file("a.gpkg"), NULL);
        expect_metres(&t, wanted);
        expect_vertices(&t, wanted);
        close_terrain(&t);
    }
}

/* F15. Heights may lie anywhere in int32 as long as they span no more than 2^31 - 4; else a sentence, and no
 * database. */
static void F15_int32_extremes_are_exact_or_refused(void **unused) {
    (void)unused;
    static const struct {
        double low, high;
        bool fits;
    } cases[] = {{-2147483648.0, -2147483648.0 + 2147483644.0, true},
                 {0, 2147483644, true},
                 {-2147483648.0, -2147483648.0, true},
                 {2147483647, 2147483647, true},
                 {2147483640, 2147483647, true},
                 {-1073741823, 1073741823, true},
                 {-2147483648.0, 2147483647, false},
                 {-2147483648.0, 0, false}};
    for (size_t i = 0; i < LENGTH(cases); i++) {
        begin(NULL);
        double values[9 * 11];
        for (int s = 0; s < 99; s++) values[s] = s % 2 ? cases[i].low : cases[i].high;
        for (int s = 0; s < 99; s += 5) values[s] = floor(cases[i].low / 2 + cases[i].high / 2);
        import_options o = defaults();
        raster r = {.name = "a.tif", .width = 9, .height = 11, .type = GDT_Int32};
        write_raster(&r, values);
        if (!cases[i].fits) {
            import_refused(file("a.tif"), file("a.gpkg"), &o, "too wide");
            assert_false(exists(file("a.gpkg")));
            continue;
        }
        import_fine(file("a.tif"), file("a.gpkg"), &o);
        terrain t = open_terrain(file("a.gpkg"), NULL);
        expect_metres(&t, values);
        expect_vertices(&t, values);
        close_terrain(&t);
    }
}

/* Does the closed triangle hold the sample? */
static bool holds(const rqt_patch *p, size_t triangle, int64_t x, int64_t y) {
    const rqt_patch_vertex *v[3];
    for (size_t c = 0; c < 3; c++) v[c] = &p->vertices[p->triangles[3 * triangle + c]];
    for (int c = 0; c < 3; c++) {
        const rqt_patch_vertex *a = v[c], *b = v[(c + 1) % 3];
        if ((b->col - a->col) * (y - a->row) - (x - a->col) * (b->row - a->row) > 0) return false;
    }
    return true;
}

static bool same_patch(const rqt_patch *a, const rqt_patch *b) {
    if (a->triangle_count != b->triangle_count || a->vertex_count != b->vertex_count) return false;
    for (size_t v = 0; v < a->vertex_count; v++)
        if (a->vertices[v].col != b->vertices[v].col || a->vertices[v].row != b->vertices[v].row) return false;
    for (size_t i = 0; i < 3 * a->triangle_count; i++)
        if (a->triangles[i] != b->triangles[i]) return false;
    return true;
}

/* F41. Windows that end on, just before and just after the borders of blocks find the same blocks at northings of
 * 1e7 with cells of 0.25 m as at the origin, and a sample at a block's corner all triangles round it. Single
 * precision knows northings there to a metre. */
static void F41_far_northings_and_small_cells_lose_no_block_at_the_border(void **unused) {
    (void)unused;
    enum { SIDE = 70, CELLS = SIDE - 1 };
    static const double utm[6] = {833978.125, 0.25, 0, 9999999.875, 0, -0.25}, origin[6] = {-0.5, 1, 0, 0.5, 0, -1};
    static double values[SIDE * SIDE];
    fill(values, SIDE, SIDE, 1);
    terrain t[2];
    for (int far = 0; far < 2; far++) {
        raster r = {.name = far ? "far.tif" : "near.tif",
                    .width = SIDE,
                    .height = SIDE,
                    .type = GDT_Int16,
                    .place = far ? utm : origin,
                    .epsg = 32733};
        import_options o = defaults();
        import_fine(write_raster(&r, values), file(far ? "far.gpkg" : "near.gpkg"), &o);
        t[far] = open_terrain(file(far ? "far.gpkg" : "near.gpkg"), NULL);
    }
    const rqt_placement *p = &t[1].t->placement;
    assert_true(p->x0 == 833978.25 && p->y0 == 9999999.75 && p->dx == 0.25 && p->dy == -0.25);
    const double all_eps[] = {0, 5, 40};
    size_t corners = 0;
    for (size_t e = 0; e < LENGTH(all_eps); e++) {
        rqt_patch whole;
        ask(&t[0], NULL, all_eps[e], &whole);
        for (int n = 0; n < 12 * 12; n++) {
            /* corners of the blocks of 8 x 8 cells, or so near to them that only a double can tell */
            static const double beside[] = {0, -0.015625, 0.015625, 0.5};
            const double x = 8 * (n % 12) > CELLS ? CELLS : 8 * (n % 12),
                         y = 8 * (n / 12) > CELLS ? CELLS : 8 * (n / 12);
            for (size_t b = 0; b < LENGTH(beside); b++) {
                const double u = x + beside[b], w = y + beside[(b + (size_t)n) % LENGTH(beside)];
                rqt_patch patch[2], point[2];
                for (int far = 0; far < 2; far++) {
                    const rqt_placement at = t[far].t->placement;
                    char text[400];
                    const double x0 = at.x0 + u * at.dx, x1 = at.x0 + (u + 8) * at.dx;
                    const double y0 = at.y0 + w * at.dy, y1 = at.y0 + (w + 3) * at.dy;
                    snprintf(text, sizeof text,
                             "POLYGON((%.17g %.17g, %.17g %.17g, %.17g %.17g, %.17g %.17g, %.17g %.17g))", x0, y0,
                             x1, y0, x1, y1, x0, y1, x0, y0);
                    ask(&t[far], text, all_eps[e], &patch[far]);
                    snprintf(text, sizeof text, "POINT(%.17g %.17g)", x0, y0);
                    ask(&t[far], text, all_eps[e], &point[far]);
                }
                if (!same_patch(&patch[0], &patch[1]) || !same_patch(&point[0], &point[1]))
                    fail_msg("eps %g, from (%.17g,%.17g): %zu triangles at the origin, %zu far from it", all_eps[e],
                             u, w, patch[0].triangle_count, patch[1].triangle_count);
                if (u == x && w == y) {
                    size_t round = 0;
                    for (size_t i = 0; i < whole.triangle_count; i++)
                        round += holds(&whole, i, (int64_t)x, (int64_t)y);
                    if (point[1].triangle_count != round || !round)
                        fail_msg("eps %g, corner (%g,%g): %zu triangles, of the whole %zu", all_eps[e], x, y,
                                 point[1].triangle_count, round);
                    corners++;
                }
                for (int far = 0; far < 2; far++) rqt_patch_free(&patch[far]), rqt_patch_free(&point[far]);
            }
        }
        rqt_patch_free(&whole);
    }
    assert_true(corners > 100);
    close_terrain(&t[0]);
    close_terrain(&t[1]);
}

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(name) cmocka_unit_test_setup(name, begin)
        TEST(F14_int16_extremes_are_heights_unless_declared_void),
        TEST(F15_int32_extremes_are_exact_or_refused),
        TEST(F41_far_northings_and_small_cells_lose_no_block_at_the_border),
    };
    return cmocka_run_group_tests_name("failures: imports", tests, begin_all, end_all);
}
