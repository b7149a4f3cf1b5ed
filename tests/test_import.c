/* test_import.c - promises of the import about what comes in: what a raster holds is what the database gives back,
 * sample for sample - every extent and band type, voids, decimals, units, place and CRS, several sources as one
 * terrain, names and archives. */
#include "test_import_support.h"

#include <float.h>

/* The mesh of everything at eps. */
static rqt_patch mesh_of(const char *database, double eps) {
    terrain r = open_terrain(database, NULL);
    rqt_region *region = NULL;
    rqt_patch patch;
    char *error = NULL;
    store_query_options how = {.select = RQT_SELECT_THRESHOLD, .outline = RQT_OUTLINE_EXACT};
    assert_int_equal(rqt_region_create(NULL, &r.t->placement, &r.t->lattice, store_allocator(), &region), RQT_OK);
    if (store_query(r.store, r.t, region, eps, &how, &patch, NULL, &error)) fail_msg("%s", error);
    rqt_region_free(region);
    close_terrain(&r);
    return patch;
}

/* ---------------------------------------------------------------------------------------------- samples -- */
static void every_extent_reads_back_sample_for_sample(void **unused) {
    (void)unused;
    static const int extents[][2] = {{1, 1}, {2, 2}, {1, 5}, {5, 1}, {9, 9}, {10, 10}, {18, 7}, {65, 64}, {3, 70}};
    for (size_t i = 0; i < LENGTH(extents); i++) {
        for (int k = 1; k <= 8; k += k == 1 ? 2 : 5) {
            begin(NULL);
            int width = extents[i][0], height = extents[i][1];
            double values[65 * 64];
            fill(values, width, height, 1);
            import_options o = defaults();
            o.k = k;
            raster r = {.name = "a.tif", .width = width, .height = height, .type = GDT_Int16};
            import_fine(write_raster(&r, values), file("a.gpkg"), &o);
            assert_int_equal(report.samples, width * height);
            assert_int_equal(report.voids, 0);
            terrain t = open_terrain(file("a.gpkg"), "a");
            assert_int_equal(t.t->lattice.width, width);
            assert_int_equal(t.t->lattice.height, height);
            assert_true(t.t->complete);
            assert_int_equal(t.t->k, k < t.t->lattice.K ? k : t.t->lattice.K);
            assert_int_equal(t.t->blocks, report.blocks);
            assert_int_equal(t.t->bytes, report.bytes);
            expect_metres(&t, values);
            int32_t low = INT32_MAX, high = INT32_MIN;
            for (int s = 0; s < width * height; s++) {
                if ((int32_t)values[s] < low) low = (int32_t)values[s];
                if ((int32_t)values[s] > high) high = (int32_t)values[s];
            }
            assert_int_equal(t.t->min_q, low);
            assert_int_equal(t.t->max_q, high);
            close_terrain(&t);
        }
    }
}

static void every_band_type_reads_back(void **unused) {
    (void)unused;
    static const struct {
        GDALDataType type;
        double low, high;
        const char *option;
    } types[] = {{GDT_Byte, 0, 255, NULL},
                 {GDT_Byte, -128, 127, "PIXELTYPE=SIGNEDBYTE"},
                 {GDT_UInt16, 0, 65535, NULL},
                 {GDT_Int16, -32768, 32767, NULL},
                 {GDT_Int32, -1000000000, 1000000000, NULL},
                 {GDT_Int32, 1500000000, 2147483647, NULL},
                 {GDT_UInt32, 4000000000, 4294967295, NULL},
                 {GDT_Int64, 4503599627000000, 4503599627370495, NULL},
                 {GDT_UInt64, 4503599627000000, 4503599627370495, NULL},
                 {GDT_Float32, -16777216, 16777216, NULL},
                 {GDT_Float64, -1000000, 1000000, NULL}};
    for (size_t i = 0; i < LENGTH(types); i++) {
        begin(NULL);
        double values[10 * 6];
        for (int s = 0; s < 60; s++) values[s] = rint(types[i].low + (types[i].high - types[i].low) * s / 59.0);
        double written[10 * 6];
        for (int s = 0; s < 60; s++) written[s] = values[s] + (types[i].option && values[s] < 0 ? 256 : 0);
        import_options o = defaults();
        raster r = {.name = "a.tif", .width = 10, .height = 6, .type = types[i].type, .options = {types[i].option}};
        import_fine(write_raster(&r, written), file("a.gpkg"), &o);
        expect_file_metres(file("a.gpkg"), values);
        terrain t = open_terrain(file("a.gpkg"), NULL);
        assert_true(t.t->quantum_error == 0);
        assert_int_equal(t.t->unit.d, 1);
        assert_int_equal(t.t->unit.z0 == 0,
                         fabs(types[i].low) < RQT_HEIGHT_LIMIT && fabs(types[i].high) < RQT_HEIGHT_LIMIT);
        close_terrain(&t);
    }
}

static void voids_are_what_is_declared_given_or_masked(void **unused) {
    (void)unused;
    static const struct {
        GDALDataType type;
        const char *nodata; /* declared */
        double given, mark; /* --nodata; what stands in the raster */
    } cases[] = {{GDT_Int16, "-32768", 0, -32768},
                 {GDT_Int16, NULL, -32767, -32767},
                 {GDT_Float32, NULL, 0, NAN},
                 {GDT_Float32, "nan", 0, NAN},
                 {GDT_Float32, "-9999", 0, -9999},
                 {GDT_Float32, "-3.40282346638529e+38", 0, -FLT_MAX},
                 {GDT_Float32, "-3.4028235e+38", 0, -FLT_MAX},
                 {GDT_Float32, "0.1", 0, 0.1},
                 {GDT_Float64, "-3.4028235e+38", 0, -(double)FLT_MAX},
                 {GDT_Float64, NULL, -1e34, -1e34},
                 {GDT_Float32, NULL, INFINITY, INFINITY},
                 {GDT_Int64, "-9223372036854775808", 0, -9223372036854775808.0}};
    for (size_t i = 0; i < LENGTH(cases); i++) {
        begin(NULL);
        double values[12 * 12], wanted[12 * 12];
        fill(values, 12, 12, 1);
        memcpy(wanted, values, sizeof values);
        for (int s = 0; s < 144; s += 5) values[s] = cases[i].mark, wanted[s] = NAN;
        import_options o = defaults();
        o.has_nodata = cases[i].given != 0;
        o.nodata = cases[i].given;
        raster r = {.name = "a.tif", .width = 12, .height = 12, .type = cases[i].type, .nodata = cases[i].nodata};
        import_fine(write_raster(&r, values), file("a.gpkg"), &o);
        assert_int_equal(report.voids, 29);
        assert_string_equal(notices, "");
        expect_file_metres(file("a.gpkg"), wanted);
    }
    /* A mask of the dataset, without any nodata value. */
    begin(NULL);
    double values[12 * 12], wanted[12 * 12];
    uint8_t mask[12 * 12];
    fill(values, 12, 12, 1);
    memcpy(wanted, values, sizeof values);
    memset(mask, 255, sizeof mask);
    for (int s = 0; s < 144; s += 7) mask[s] = 0, wanted[s] = NAN;
    raster r = {.name = "a.tif", .width = 12, .height = 12, .type = GDT_Int16, .mask = mask};
    import_options o = defaults();
    import_fine(write_raster(&r, values), file("a.gpkg"), &o);
    assert_int_equal(report.voids, 21);
    expect_file_metres(file("a.gpkg"), wanted);
}

static void a_raster_of_voids_is_a_terrain(void **unused) {
    (void)unused;
    double values[6 * 6], wanted[6 * 6];
    for (int s = 0; s < 36; s++) values[s] = -1, wanted[s] = NAN;
    raster r = {.name = "a.tif", .width = 6, .height = 6, .type = GDT_Int16, .nodata = "-1"};
    import_options o = defaults();
    import_fine(write_raster(&r, values), file("a.gpkg"), &o);
    assert_int_equal(report.voids, 36);
    assert_non_null(strstr(notices, "every sample is void"));
    expect_file_metres(file("a.gpkg"), wanted);
}

/* -------------------------------------------------------------------------------------------- decimals -- */
static void decimals_are_kept_exactly(void **unused) {
    (void)unused;
    static const struct {
        GDALDataType type;
        double step;
        int d;
    } cases[] = {{GDT_Float32, 1, 1},        {GDT_Float32, 0.1, 10}, {GDT_Float32, 0.01, 100},
                 {GDT_Float32, 0.001, 1000}, {GDT_Float64, 0.1, 10}, {GDT_Float64, 0.01, 100},
                 {GDT_Float64, 0.001, 1000}};
    for (size_t i = 0; i < LENGTH(cases); i++) {
        begin(NULL);
        double values[20 * 20];
        for (int s = 0; s < 400; s++) values[s] = rint((uniform() * 900 - 300) * cases[i].d) / cases[i].d;
        raster r = {.name = "a.tif", .width = 20, .height = 20, .type = cases[i].type};
        import_options o = defaults();
        import_fine(write_raster(&r, values), file("a.gpkg"), &o);
        terrain t = open_terrain(file("a.gpkg"), NULL);
        assert_int_equal(t.t->unit.d, cases[i].d);
        assert_true(t.t->quantum_error == 0);
        expect_metres(&t, values); /* the decimal itself, not its float */
        close_terrain(&t);
    }
}

static void noise_is_rounded_and_says_so(void **unused) {
    (void)unused;
    double values[20 * 20];
    for (int s = 0; s < 400; s++) values[s] = uniform() * 1000 + uniform() / 3;
    for (int given = 0; given < 4; given++) {
        static const double quanta[] = {0, 0.01, 0.3, 5}, steps[] = {1. / 1024, 0.01, 0.3, 5};
        begin(NULL);
        raster r = {.name = "a.tif", .width = 20, .height = 20, .type = GDT_Float64};
        import_options o = defaults();
        o.quantum = quanta[given];
        import_fine(write_raster(&r, values), file("a.gpkg"), &o);
        terrain t = open_terrain(file("a.gpkg"), NULL);
        if (given == 0) assert_int_equal(t.t->unit.d, 1024);
        if (given == 1) assert_int_equal(t.t->unit.d, 100);
        if (given < 2)
            assert_true(t.t->quantum_error == steps[given] / 2);
        else
            assert_true(fabs(t.t->quantum_error - steps[given] / 2) < 1e-9);
        for (size_t s = 0; s < 400; s++) assert_true(fabs(metres(&t, s) - values[s]) <= t.t->quantum_error);
        close_terrain(&t);
    }
}

static void a_quantum_in_feet_is_a_step_in_feet(void **unused) {
    (void)unused;
    double values[20 * 20];
    for (int s = 0; s < 400; s++) values[s] = uniform() * 1000;
    raster r = {.name = "a.tif", .width = 20, .height = 20, .type = GDT_Float32, .unit = "ft"};
    import_options o = defaults();
    o.quantum = 2;
    import_fine(write_raster(&r, values), file("a.gpkg"), &o);
    terrain t = open_terrain(file("a.gpkg"), NULL);
    assert_true(fabs(t.t->quantum_error - 0.3048) < 1e-12);
    for (size_t s = 0; s < 400; s++) {
        assert_true(fabs(metres(&t, s) - (double)(float)values[s] * 0.3048) <= t.t->quantum_error);
        assert_true(fabs(remainder(metres(&t, s), 0.6096)) < 1e-9);
    }
    close_terrain(&t);
}

static void F10_millimetres_far_from_zero_are_not_lost(void **unused) {
    (void)unused;
    double near[40 * 40], far[40 * 40];
    fill(near, 40, 40, 0.001);
    for (int s = 0; s < 1600; s++) {
        near[s] = rint(near[s] * 1000) / 1000;
        far[s] = 1e7 + near[s];
    }
    raster a = {.name = "near.tif", .width = 40, .height = 40, .type = GDT_Float64};
    raster b = {.name = "far.tif", .width = 40, .height = 40, .type = GDT_Float64};
    import_options o = defaults();
    import_fine(write_raster(&a, near), file("near.gpkg"), &o);
    import_fine(write_raster(&b, far), file("far.gpkg"), &o);
    terrain t = open_terrain(file("far.gpkg"), NULL);
    assert_int_equal(t.t->unit.d, 1000);
    assert_in_range(t.t->unit.z0, 10000000, 10000600);
    assert_true(t.t->quantum_error == 0);
    expect_metres(&t, far);
    close_terrain(&t);
    static const double eps[] = {0, 0.0005, 0.5, 5, 20};
    for (size_t i = 0; i < LENGTH(eps); i++) {
        rqt_patch one = mesh_of(file("near.gpkg"), eps[i]), two = mesh_of(file("far.gpkg"), eps[i]);
        assert_int_equal(one.vertex_count, two.vertex_count);
        for (size_t v = 0; v < one.vertex_count; v++)
            assert_true(one.vertices[v].col == two.vertices[v].col && one.vertices[v].row == two.vertices[v].row &&
                        one.vertices[v].error == two.vertices[v].error);
        assert_int_equal(one.triangle_count, two.triangle_count);
        assert_memory_equal(one.triangles, two.triangles, 3 * one.triangle_count * sizeof *one.triangles);
        rqt_patch_free(&one);
        rqt_patch_free(&two);
    }
}

/* ------------------------------------------------------------------------------------------------ units -- */
static void metres_follow_unit_scale_and_offset(void **unused) {
    (void)unused;
    static const struct {
        const char *band, *given;
        double scale, offset, plain, numerator, denominator;
    } cases[] = {{NULL, NULL, 0, 0, 1, 1, 1},          {"m", NULL, 0, 0, 1, 1, 1},
                 {"ft", NULL, 0, 0, 1, 381, 1250},     {"US survey foot", NULL, 0, 0, 1, 1200, 3937},
                 {"us-ft", NULL, 0, 0, 1, 1200, 3937}, {"metre", "ft", 0, 0, 1, 381, 1250},
                 {NULL, "us-ft", 0, 0, 1, 1200, 3937}, {NULL, "0.7", 0, 0, 0.7, 1, 1},
                 {NULL, NULL, 0.1, -100, 1, 1, 1},     {"feet", NULL, 0.25, 1000, 1, 381, 1250},
                 {"ft", "2.5", -0.5, 7, 2.5, 1, 1},    {"ft", "m", 0.5, 7, 1, 1, 1}};
    for (size_t i = 0; i < LENGTH(cases); i++) {
        begin(NULL);
        double values[11 * 9], wanted[11 * 9];
        fill(values, 11, 9, 1);
        double scale = cases[i].scale != 0 ? cases[i].scale : 1;
        double f = scale * cases[i].plain * cases[i].numerator / cases[i].denominator;
        double o = cases[i].offset * cases[i].plain * cases[i].numerator / cases[i].denominator;
        for (int s = 0; s < 99; s++) wanted[s] = values[s] * f + o;
        raster r = {.name = "a.tif",
                    .width = 11,
                    .height = 9,
                    .type = GDT_Int16,
                    .unit = cases[i].band,
                    .scale = cases[i].scale,
                    .offset = cases[i].offset};
        import_options with = defaults();
        with.unit = cases[i].given;
        import_fine(write_raster(&r, values), file("a.gpkg"), &with);
        assert_string_equal(notices, "");
        expect_file_metres(file("a.gpkg"), wanted);
        terrain t = open_terrain(file("a.gpkg"), NULL);
        assert_int_equal(t.t->unit.numerator, (int)cases[i].numerator);
        assert_true(t.t->unit.scale == scale * cases[i].plain);
        close_terrain(&t);
        /* The same in floating point: metres come first, and the quantum is of metres. */
        begin(NULL);
        r.type = GDT_Float64;
        import_fine(write_raster(&r, values), file("a.gpkg"), &with);
        t = open_terrain(file("a.gpkg"), NULL);
        assert_true(t.t->unit.scale == 1 && t.t->unit.offset == 0 && t.t->unit.numerator == 1);
        for (size_t s = 0; s < 99; s++) assert_true(fabs(metres(&t, s) - wanted[s]) <= t.t->quantum_error);
        close_terrain(&t);
    }
}

static void an_unknown_unit_is_told_and_taken_as_metres(void **unused) {
    (void)unused;
    double values[4] = {1, 2, 3, 4};
    raster r = {.name = "a.tif", .width = 2, .height = 2, .type = GDT_Int16, .unit = "fathom"};
    import_options o = defaults();
    import_fine(write_raster(&r, values), file("a.gpkg"), &o);
    assert_non_null(strstr(notices, "'fathom'"));
    expect_file_metres(file("a.gpkg"), values);
    o.unit = "fathom";
    import_refused(file("a.tif"), file("b.gpkg"), &o, "the unit 'fathom'");
}

/* ------------------------------------------------------------------------------------------------ place -- */
static void expect_place(const char *database, double x0, double y0, double dx, double dy) {
    terrain t = open_terrain(database, NULL);
    const rqt_placement *p = &t.t->placement;
    if (p->x0 != x0 || p->y0 != y0 || p->dx != dx || p->dy != dy)
        fail_msg("placed at %.17g %.17g by %.17g %.17g", p->x0, p->y0, p->dx, p->dy);
    close_terrain(&t);
}

static void south_up_and_mirrored_rasters_equal_north_up(void **unused) {
    (void)unused;
    enum { W = 13, H = 9 };
    double values[W * H], turned[W * H];
    fill(values, W, H, 1);
    raster r = {.name = "n.tif", .width = W, .height = H, .type = GDT_Int16, .nodata = "310"};
    import_options o = defaults();
    o.name = "same";
    import_fine(write_raster(&r, values), file("n.gpkg"), &o);
    expect_place(file("n.gpkg"), 500005, 3999995, 10, -10);
    for (int turn = 1; turn < 4; turn++) {
        bool rows = turn & 1, columns = turn & 2;
        double place[6] = {500000, 10, 0, 4000000, 0, -10};
        if (rows) place[3] -= 10 * H, place[5] = 10;
        if (columns) place[0] += 10 * W, place[1] = -10;
        for (int y = 0; y < H; y++)
            for (int x = 0; x < W; x++)
                turned[(rows ? H - 1 - y : y) * W + (columns ? W - 1 - x : x)] = values[y * W + x];
        raster t = {.name = "t.tif", .width = W, .height = H, .type = GDT_Int16, .place = place, .nodata = "310"};
        o.replace = true;
        import_fine(write_raster(&t, turned), file("t.gpkg"), &o);
        expect_place(file("t.gpkg"), 500005, 3999995, 10, -10);
        VSIUnlink(file("n.gpkg"));
        import_fine(file("n.tif"), file("n.gpkg"), &o);
        expect_same_tables(file("n.gpkg"), file("t.gpkg"));
        VSIUnlink(file("t.gpkg"));
    }
}

static void pixels_that_are_points_lie_where_they_say(void **unused) {
    (void)unused;
    double values[4 * 4];
    fill(values, 4, 4, 1);
    import_options o = defaults();
    for (int point = 0; point < 2; point++) {
        begin(NULL);
        raster r = {.name = "a.tif", .width = 4, .height = 4, .type = GDT_Int16};
        write_raster(&r, values);
        if (point) {
            /* The same tie point, now the place of a sample: written without GDAL's half cell, read with it. */
            CPLSetConfigOption("GTIFF_POINT_GEO_IGNORE", "TRUE");
            GDALDatasetH d = GDALOpen(file("a.tif"), GA_Update);
            GDALSetMetadataItem(d, "AREA_OR_POINT", "Point", NULL);
            GDALSetGeoTransform(d, (double *)(uintptr_t)north_up);
            GDALClose(d);
            CPLSetConfigOption("GTIFF_POINT_GEO_IGNORE", NULL);
        }
        import_fine(file("a.tif"), file("a.gpkg"), &o);
        expect_place(file("a.gpkg"), point ? 500000 : 500005, point ? 4000000 : 3999995, 10, -10);
    }
    /* An ESRI grid that names the centre of its corner cell, by hand. */
    begin(NULL);
    VSILFILE *f = VSIFOpenL(file("c.asc"), "wb");
    const char *text = "ncols 2\nnrows 2\nxllcenter 100\nyllcenter 200\ncellsize 10\n1 2\n3 4\n";
    VSIFWriteL(text, 1, strlen(text), f);
    VSIFCloseL(f);
    import_fine(file("c.asc"), file("c.gpkg"), &o);
    expect_place(file("c.gpkg"), 100, 210, 10, -10);
    expect_file_metres(file("c.gpkg"), (const double[]){1, 2, 3, 4});
}

static void without_a_geotransform_samples_are_columns_and_rows(void **unused) {
    (void)unused;
    double values[6 * 5];
    fill(values, 6, 5, 1);
    raster r = {.name = "a.tif", .width = 6, .height = 5, .type = GDT_Int16, .no_place = true, .epsg = -1};
    import_options o = defaults();
    import_fine(write_raster(&r, values), file("a.gpkg"), &o);
    expect_place(file("a.gpkg"), 0, 0, 1, -1);
    expect_file_metres(file("a.gpkg"), values);
    terrain t = open_terrain(file("a.gpkg"), NULL);
    assert_int_equal(t.t->srid, 0);
    assert_string_equal(t.t->crs, "");
    assert_true(t.t->cost.cell == 1);
    assert_false(t.t->lonlat);
    close_terrain(&t);
}

static void the_crs_is_told(void **unused) {
    (void)unused;
    static const double degrees[6] = {10, 1 / 1200.0, 0, 50, 0, -1 / 1200.0}, feet[6] = {1e6, 20, 0, 2e6, 0, -30};
    static const struct {
        int epsg;
        const double *place;
        int srid;
        bool lonlat, wgs84;
        double cell;
        const char *vertical;
    } cases[] = {{32633, north_up, 32633, false, false, 10, ""},
                 {4326, degrees, 4326, true, true, 1 / 1200.0 * M_PI / 180 * 6378137, ""},
                 {4258, degrees, 4258, true, false, 1 / 1200.0 * M_PI / 180 * 6378137, ""},
                 {2263, feet, 2263, false, false, 30 * 1200. / 3937, ""},
                 {9707, degrees, 4326, true, true, 1 / 1200.0 * M_PI / 180 * 6378137, "EGM96 height"}};
    for (size_t i = 0; i < LENGTH(cases); i++) {
        begin(NULL);
        double values[4 * 4];
        fill(values, 4, 4, 1);
        raster r = {.name = "a.tif",
                    .width = 4,
                    .height = 4,
                    .type = GDT_Int16,
                    .place = cases[i].place,
                    .epsg = cases[i].epsg};
        import_options o = defaults();
        o.void_tol = 2.5;
        import_fine(write_raster(&r, values), file("a.gpkg"), &o);
        terrain t = open_terrain(file("a.gpkg"), NULL);
        assert_int_equal(t.t->srid, cases[i].srid);
        assert_int_equal(t.t->lonlat, cases[i].lonlat);
        assert_int_equal(t.t->wgs84, cases[i].wgs84);
        if (fabs(t.t->cost.cell - cases[i].cell) > 1e-9 * cases[i].cell) fail_msg("cell %.17g", t.t->cost.cell);
        assert_true(t.t->cost.c == 2.5);
        assert_string_equal(t.t->vertical, cases[i].vertical);
        assert_true(strlen(t.t->crs) > 100);
        assert_string_equal(t.t->source, "a.tif");
        close_terrain(&t);
    }
}

/* --------------------------------------------------------------------------------------- several sources -- */
static void cut(const double *from, int width, int x, int y, int w, int h, double *to) {
    for (int r = 0; r < h; r++) memcpy(to + r * w, from + (y + r) * width + x, (size_t)w * sizeof *to);
}

static void F44_tiles_in_either_order_equal_one_raster(void **unused) {
    (void)unused;
    enum { W = 33, H = 41 };
    double values[W * H], part[W * H];
    fill(values, W, H, 1);
    import_options o = defaults();
    o.name = "same";
    raster whole = {.name = "whole.tif", .width = W, .height = H, .type = GDT_Int16};
    import_fine(write_raster(&whole, values), file("whole.gpkg"), &o);
    double place[6];
    memcpy(place, north_up, sizeof place);
    raster north = {.name = "north.tif", .width = W, .height = 21, .type = GDT_Int16, .place = place};
    raster south = {.name = "south.tif", .width = W, .height = 21, .type = GDT_Int16, .place = place};
    cut(values, W, 0, 0, W, 21, part);
    const char *sources[2] = {write_raster(&north, part), NULL};
    place[3] -= 20 * 10;
    cut(values, W, 0, 20, W, 21, part);
    sources[1] = write_raster(&south, part);
    for (int order = 0; order < 2; order++) {
        const char *database = file(order ? "b.gpkg" : "a.gpkg");
        if (import_many(sources, 2, database, &o)) fail_msg("%s", message);
        assert_int_equal(report.overlap, W);
        assert_int_equal(report.overlap_differs, 0);
        assert_string_equal(notices, "");
        expect_same_tables(file("whole.gpkg"), database);
        expect_place(database, 500005, 3999995, 10, -10);
        const char *first = sources[0];
        sources[0] = sources[1];
        sources[1] = first;
    }
    terrain t = open_terrain(file("a.gpkg"), NULL);
    assert_string_equal(t.t->source, "north.tif\nsouth.tif");
    close_terrain(&t);
}

static void the_later_source_wins_and_a_void_never_does(void **unused) {
    (void)unused;
    static const double a[] = {1, 2, 3, 4, 5, 6, 7, 8, 9}, b[] = {5, 60, -1, 9, 10, 11};
    double place[6];
    memcpy(place, north_up, sizeof place);
    raster first = {.name = "a.tif", .width = 3, .height = 3, .type = GDT_Int16};
    const char *sources[] = {write_raster(&first, a), NULL, NULL};
    place[0] += 10;
    place[3] -= 10;
    raster second = {.name = "b.tif", .width = 3, .height = 2, .type = GDT_Int16, .nodata = "-1", .place = place};
    sources[1] = write_raster(&second, b);
    sources[2] = sources[1];
    import_options o = defaults();
    /* b covers columns 1..3, rows 1..2; its first row is 5 60 void, over 5 6; its second 9 10 11, over 8 9. */
    if (import_many(sources, 2, file("a.gpkg"), &o)) fail_msg("%s", message);
    assert_int_equal(report.overlap, 4);
    assert_int_equal(report.overlap_differs, 3);
    assert_non_null(strstr(notices, "3 of 4 samples"));
    expect_file_metres(file("a.gpkg"), (const double[]){1, 2, 3, NAN, 4, 5, 60, NAN, 7, 9, 10, 11});
    /* The other way round; and a third source counts a place once. */
    const char *turned[] = {sources[1], sources[0], sources[0]};
    if (import_many(turned, 3, file("b.gpkg"), &o)) fail_msg("%s", message);
    assert_int_equal(report.overlap, 9);
    assert_int_equal(report.overlap_differs, 3);
    expect_file_metres(file("b.gpkg"), (const double[]){1, 2, 3, NAN, 4, 5, 6, NAN, 7, 8, 9, 11});
}

static void sources_of_unlike_kinds_meet_in_metres(void **unused) {
    (void)unused;
    static const double a[] = {1, 2, 3, 4}, b[] = {0.5, 1.25, 2, 1000};
    double place[6];
    memcpy(place, north_up, sizeof place);
    raster first = {.name = "a.tif", .width = 2, .height = 2, .type = GDT_Int16, .unit = "ft"};
    const char *sources[] = {write_raster(&first, a), NULL};
    place[0] += 20;
    raster second = {.name = "b.tif", .width = 2, .height = 2, .type = GDT_Float32, .place = place};
    sources[1] = write_raster(&second, b);
    import_options o = defaults();
    if (import_many(sources, 2, file("a.gpkg"), &o)) fail_msg("%s", message);
    terrain t = open_terrain(file("a.gpkg"), NULL);
    static const double wanted[] = {0.3048, 0.6096, 0.5, 1.25, 0.9144, 1.2192, 2, 1000};
    for (size_t s = 0; s < 8; s++) assert_true(fabs(metres(&t, s) - wanted[s]) <= t.t->quantum_error + 1e-12);
    close_terrain(&t);
}

/* ----------------------------------------------------------------------------------- names and archives -- */
static void names_come_from_the_first_file(void **unused) {
    (void)unused;
    double values[16];
    fill(values, 4, 4, 1);
    raster r = {.name = "Mt Foo (1).v2.tif", .width = 4, .height = 4, .type = GDT_Int16};
    import_options o = defaults();
    import_fine(write_raster(&r, values), file("a.gpkg"), &o);
    assert_string_equal(report.name, "Mt_Foo__1_");
}

static void an_archive_with_one_raster_is_that_raster(void **unused) {
    (void)unused;
    double values[16];
    fill(values, 4, 4, 1);
    raster r = {.name = "a.tif", .width = 4, .height = 4, .type = GDT_Int16};
    const char *source = write_raster(&r, values);
    import_options o = defaults();
    for (int n = 0; n < 3; n++) {
        char inside[300];
        if (n < 2) {
            snprintf(inside, sizeof inside, "/vsizip/%s/%s", file("b.zip"), n ? "a.tif" : "folder/readme.txt");
            VSILFILE *from = VSIFOpenL(n ? source : "/dev/null", "rb"), *to = VSIFOpenL(inside, "wb");
            char buffer[65536];
            size_t got = VSIFReadL(buffer, 1, sizeof buffer, from);
            VSIFWriteL(got ? buffer : "words", 1, got ? got : 5, to);
            VSIFCloseL(from);
            VSIFCloseL(to);
        }
        if (n == 0) import_refused(file("b.zip"), file("a.gpkg"), &o, "holds no raster");
    }
    import_fine(file("b.zip"), file("a.gpkg"), &o);
    expect_file_metres(file("a.gpkg"), values);
    terrain t = open_terrain(file("a.gpkg"), "b");
    assert_string_equal(t.t->source, "b.zip");
    close_terrain(&t);
}

static void an_undeclared_mark_is_noticed(void **unused) {
    (void)unused;
    double values[30 * 30];
    import_options o = defaults();
    raster r = {.name = "a.tif", .width = 30, .height = 30, .type = GDT_Int16};
    fill(values, 30, 30, 1);
    o.replace = true;
    import_fine(write_raster(&r, values), file("a.gpkg"), &o);
    assert_string_equal(notices, "");
    for (int s = 0; s < 300; s++) values[s * 3] = -32767;
    import_fine(write_raster(&r, values), file("a.gpkg"), &o);
    assert_non_null(strstr(notices, "300 samples"));
    assert_non_null(strstr(notices, "--nodata -32767"));
    fill(values, 30, 30, 1);
    values[77] = 31000; /* one only, and no usual mark */
    import_fine(write_raster(&r, values), file("a.gpkg"), &o);
    assert_non_null(strstr(notices, "--nodata 31000"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(name) cmocka_unit_test_setup(name, begin)
        TEST(every_extent_reads_back_sample_for_sample),
        TEST(every_band_type_reads_back),
        TEST(voids_are_what_is_declared_given_or_masked),
        TEST(a_raster_of_voids_is_a_terrain),
        TEST(decimals_are_kept_exactly),
        TEST(noise_is_rounded_and_says_so),
        TEST(a_quantum_in_feet_is_a_step_in_feet),
        TEST(F10_millimetres_far_from_zero_are_not_lost),
        TEST(metres_follow_unit_scale_and_offset),
        TEST(an_unknown_unit_is_told_and_taken_as_metres),
        TEST(south_up_and_mirrored_rasters_equal_north_up),
        TEST(pixels_that_are_points_lie_where_they_say),
        TEST(without_a_geotransform_samples_are_columns_and_rows),
        TEST(the_crs_is_told),
        TEST(F44_tiles_in_either_order_equal_one_raster),
        TEST(the_later_source_wins_and_a_void_never_does),
        TEST(sources_of_unlike_kinds_meet_in_metres),
        TEST(names_come_from_the_first_file),
        TEST(an_archive_with_one_raster_is_that_raster),
        TEST(an_undeclared_mark_is_noticed),
    };
    alarm(300); /* threads that wait for each other for ever are a failure too */
    return cmocka_run_group_tests(tests, begin_all, end_all);
}
