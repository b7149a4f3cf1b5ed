/* test_import.c - promises of the import: what a raster holds is what the database gives back, and what cannot be
 * imported is refused with a sentence that leaves everything as it was. Rasters are made here with GDAL, databases
 * in a temporary folder. Links: import, store, core, GDAL, SQLite, cmocka. */
#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include <cmocka.h>

#include <cpl_conv.h>
#include <cpl_error.h>
#include <cpl_string.h>
#include <cpl_vsi.h>
#include <gdal.h>
#include <ogr_srs_api.h>

#include "import.h"

#define EPSG_NONE 0
#define LENGTH(a) (sizeof(a) / sizeof *(a))

/* ---------------------------------------------------------------------------------------- temporary files -- */
static char folder[] = "/tmp/rqt_test_import_XXXXXX";
static char notices[4096]; /* every notice of the last import, one a line */
static char message[1024];
static import_report report;

static const char *file(const char *name) {
    static char paths[64][256];
    static size_t next;
    char *path = paths[next++ % LENGTH(paths)];
    snprintf(path, sizeof paths[0], "%s/%s", folder, name);
    return path;
}

static int begin_all(void **state) {
    (void)state;
    GDALAllRegister();
    return mkdtemp(folder) ? chmod(folder, 0777) : -1;
}

static int end_all(void **state) {
    (void)state;
    return VSIRmdirRecursive(folder);
}

/* Every test starts in an empty folder. */
static int begin(void **state) {
    (void)state;
    char **names = VSIReadDir(folder);
    for (char **name = names; name && *name; name++)
        if (strcmp(*name, ".") && strcmp(*name, "..")) VSIRmdirRecursive(file(*name)), VSIUnlink(file(*name));
    CSLDestroy(names);
    notices[0] = message[0] = 0;
    return 0;
}

static bool exists(const char *path) {
    struct stat s;
    return stat(path, &s) == 0;
}

/* ---------------------------------------------------------------------------------------------- rasters -- */
static const double north_up[6] = {500000, 10, 0, 4000000, 0, -10};

typedef struct raster {
    const char *name, *driver; /* NULL: GTiff */
    int width, height, bands;  /* 0 bands: 1 */
    GDALDataType type;
    const double *place; /* NULL: north_up */
    bool no_place;
    int epsg; /* 0: 32633, -1: none */
    const char *nodata, *unit, *options[3];
    double scale, offset;
    const uint8_t *mask;
} raster;

/* Write a raster of doubles, which GDAL makes numbers of its type. Returns its path. */
static const char *write_raster(const raster *r, const double *values) {
    const char *path = file(r->name);
    const char *const options[] = {r->options[0], r->options[1], NULL};
    GDALDriverH driver = GDALGetDriverByName(r->driver ? r->driver : "GTiff");
    GDALDatasetH d = GDALCreate(driver, path, r->width, r->height, r->bands ? r->bands : 1, r->type,
                                (CSLConstList)(r->options[0] ? options : NULL));
    assert_non_null(d);
    if (!r->no_place) {
        double g[6];
        memcpy(g, r->place ? r->place : north_up, sizeof g);
        assert_int_equal(GDALSetGeoTransform(d, g), CE_None);
    }
    if (r->epsg >= 0) {
        OGRSpatialReferenceH crs = OSRNewSpatialReference(NULL);
        assert_int_equal(OSRImportFromEPSG(crs, r->epsg ? r->epsg : 32633), OGRERR_NONE);
        GDALSetSpatialRef(d, crs);
        OSRDestroySpatialReference(crs);
    }
    for (int b = 1; b <= (r->bands ? r->bands : 1); b++) {
        GDALRasterBandH band = GDALGetRasterBand(d, b);
        if (r->nodata && r->type == GDT_Int64)
            GDALSetRasterNoDataValueAsInt64(band, strtoll(r->nodata, NULL, 10));
        else if (r->nodata)
            GDALSetRasterNoDataValue(band, CPLAtof(r->nodata));
        if (r->unit) GDALSetRasterUnitType(band, r->unit);
        if (r->scale != 0) GDALSetRasterScale(band, r->scale), GDALSetRasterOffset(band, r->offset);
        assert_int_equal(GDALRasterIO(band, GF_Write, 0, 0, r->width, r->height, (void *)(uintptr_t)values,
                                      r->width, r->height, GDT_Float64, 0, 0),
                         CE_None);
        if (r->mask) {
            assert_int_equal(GDALCreateMaskBand(band, GMF_PER_DATASET), CE_None);
            assert_int_equal(GDALRasterIO(GDALGetMaskBand(band), GF_Write, 0, 0, r->width, r->height,
                                          (void *)(uintptr_t)r->mask, r->width, r->height, GDT_Byte, 0, 0),
                             CE_None);
        }
    }
    GDALClose(d);
    return path;
}

static uint32_t state = 1;
static double uniform(void) {
    state = state * 1664525u + 1013904223u;
    return (state >> 8) / 16777216.0;
}

/* Hills with some roughness, whole numbers when step is 1. */
static void fill(double *values, int width, int height, double step) {
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++)
            values[y * width + x] = rint((300 + 90 * sin(x * 0.21) * cos(y * 0.17) + 8 * uniform()) / step) * step;
}

/* ---------------------------------------------------------------------------------------------- imports -- */
static void notice(void *context, const char *sentence) {
    (void)context;
    size_t n = strlen(notices);
    snprintf(notices + n, sizeof notices - n, "%s\n", sentence);
}

static import_options defaults(void) {
    import_options o;
    import_options_init(&o);
    o.notice = notice;
    o.k = 3;
    return o;
}

static int import_many(const char *const *sources, int count, const char *database, const import_options *o) {
    notices[0] = 0;
    return import_run(sources, count, database, o, &report, message, sizeof message);
}

static void import_fine(const char *source, const char *database, const import_options *o) {
    if (import_many(&source, 1, database, o)) fail_msg("%s", message);
    assert_string_equal(message, "");
}

static void import_refused(const char *source, const char *database, const import_options *o, const char *phrase) {
    assert_int_equal(import_many(&source, 1, database, o), 1);
    if (!strstr(message, phrase)) fail_msg("'%s' does not say '%s'", message, phrase);
}

/* ------------------------------------------------------------------------------------------ reading back -- */
typedef struct terrain {
    sqlite3 *db;
    store *store;
    const store_terrain *t;
    int32_t *q;
    uint8_t *valid;
} terrain;

static terrain open_terrain(const char *path, const char *name) {
    terrain r = {0};
    char *error = NULL;
    assert_int_equal(sqlite3_open_v2(path, &r.db, SQLITE_OPEN_READONLY, NULL), SQLITE_OK);
    assert_int_equal(store_open(r.db, &r.store), SQLITE_OK);
    if (store_find(r.store, name, &r.t, &error)) fail_msg("%s", error);
    size_t n = (size_t)r.t->lattice.width * (size_t)r.t->lattice.height;
    r.q = calloc(n, sizeof *r.q);
    r.valid = calloc(n, 1);
    if (store_window(r.store, r.t, 0, 0, r.t->lattice.width, r.t->lattice.height, r.q, r.valid, &error))
        fail_msg("%s", error);
    return r;
}

static void close_terrain(terrain *r) {
    free(r->q);
    free(r->valid);
    store_close(r->store);
    assert_int_equal(sqlite3_close(r->db), SQLITE_OK);
}

/* Metres of sample n, by the contract's expression written out here; NaN for a void. */
static double metres(const terrain *r, size_t n) {
    const rqt_unit *u = &r->t->unit;
    if (!r->valid[n]) return NAN;
    double f = u->scale * u->numerator / u->denominator;
    return ((double)u->z0 + r->q[n] / (double)u->d) * f + u->offset;
}

static void expect_metres(const terrain *r, const double *wanted) {
    size_t n = (size_t)r->t->lattice.width * (size_t)r->t->lattice.height;
    for (size_t i = 0; i < n; i++) {
        double z = metres(r, i);
        if (isnan(wanted[i]) ? !isnan(z) : z != wanted[i])
            fail_msg("sample %zu is %.17g and not %.17g", i, z, wanted[i]);
    }
}

static void expect_file_metres(const char *database, const double *wanted) {
    terrain r = open_terrain(database, NULL);
    expect_metres(&r, wanted);
    close_terrain(&r);
}

/* Every value of a query as one text, so that tables can be compared byte for byte. */
static char *dump(const char *database, const char *sql) {
    sqlite3 *db;
    sqlite3_stmt *s;
    assert_int_equal(sqlite3_open_v2(database, &db, SQLITE_OPEN_READONLY, NULL), SQLITE_OK);
    assert_int_equal(sqlite3_prepare_v2(db, sql, -1, &s, NULL), SQLITE_OK);
    sqlite3_str *out = sqlite3_str_new(NULL);
    while (sqlite3_step(s) == SQLITE_ROW) {
        for (int i = 0; i < sqlite3_column_count(s); i++) {
            const unsigned char *bytes = sqlite3_column_blob(s, i);
            int n = sqlite3_column_bytes(s, i);
            for (int b = 0; b < n; b++) sqlite3_str_appendf(out, "%02x", bytes[b]);
            sqlite3_str_appendchar(out, 1, ' ');
        }
        sqlite3_str_appendchar(out, 1, '\n');
    }
    assert_int_equal(sqlite3_finalize(s), SQLITE_OK);
    sqlite3_close(db);
    char *text = sqlite3_str_finish(out);
    return text ? text : sqlite3_mprintf("");
}

static void expect_same_tables(const char *a, const char *b) {
    static const char *const queries[] = {
        "SELECT id, summary, data FROM rqt_block_1 ORDER BY id", "SELECT * FROM rqt_index_1 ORDER BY id",
        "SELECT width, height, k, blocks, bytes, max_error, voids FROM rqt_terrain"};
    for (size_t i = 0; i < LENGTH(queries); i++) {
        char *left = dump(a, queries[i]), *right = dump(b, queries[i]);
        assert_true(strlen(left) > 0);
        if (strcmp(left, right)) fail_msg("%s differs", queries[i]);
        sqlite3_free(left);
        sqlite3_free(right);
    }
}

static size_t selected(const char *database, double eps) {
    terrain r = open_terrain(database, NULL);
    rqt_region *region = NULL;
    rqt_patch patch;
    char *error = NULL;
    store_query_options how = {RQT_SELECT_THRESHOLD, RQT_OUTLINE_EXACT};
    assert_int_equal(rqt_region_create(NULL, &r.t->placement, &r.t->lattice, store_allocator(), &region), RQT_OK);
    if (store_query(r.store, r.t, region, eps, &how, &patch, NULL, &error)) fail_msg("%s", error);
    size_t n = patch.vertex_count;
    rqt_patch_free(&patch);
    rqt_region_free(region);
    close_terrain(&r);
    return n;
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

static void infinity_is_refused_with_its_place(void **unused) {
    (void)unused;
    double values[8 * 8];
    fill(values, 8, 8, 1);
    values[3 * 8 + 5] = -INFINITY;
    raster r = {.name = "a.tif", .width = 8, .height = 8, .type = GDT_Float32};
    import_options o = defaults();
    import_refused(write_raster(&r, values), file("a.gpkg"), &o, "column 5, row 3 is infinite");
    assert_false(exists(file("a.gpkg")));
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

static void heights_far_from_zero_lose_nothing(void **unused) {
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
    for (size_t i = 0; i < LENGTH(eps); i++)
        assert_int_equal(selected(file("near.gpkg"), eps[i]), selected(file("far.gpkg"), eps[i]));
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

static void tiles_that_share_a_row_equal_one_raster(void **unused) {
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

static void sources_of_unlike_grids_are_refused(void **unused) {
    (void)unused;
    static const double far[6] = {500100, 10, 0, 4000000, 0, -10}, wide[6] = {500100, 10.01, 0, 4000000, 0, -10},
                        off[6] = {500104, 10, 0, 4000000, 0, -10}, remote[6] = {5e7, 10, 0, 4000000, 0, -10};
    static const struct {
        raster second;
        const char *phrase, *figure;
    } cases[] = {
        {{.name = "b.tif", .width = 4, .height = 4, .type = GDT_Int16, .place = far, .epsg = 32632},
         "CRS",
         "zone 32N"},
        {{.name = "b.tif", .width = 4, .height = 4, .type = GDT_Int16, .place = far, .epsg = -1}, "CRS", "none"},
        {{.name = "b.tif", .width = 4, .height = 4, .type = GDT_Int16, .place = wide}, "cells of", "10.01"},
        {{.name = "b.tif", .width = 4, .height = 4, .type = GDT_Int16, .place = off}, "no whole number", "10.4"},
        {{.name = "b.tif", .width = 4, .height = 4, .type = GDT_Int16, .place = remote},
         "a terrain has at most",
         "4950004"},
        {{.name = "b.tif", .width = 4, .height = 4, .type = GDT_Int16, .no_place = true},
         "no geotransform",
         "beside"}};
    double values[16];
    fill(values, 4, 4, 1);
    raster first = {.name = "a.tif", .width = 4, .height = 4, .type = GDT_Int16};
    import_options o = defaults();
    for (size_t i = 0; i < LENGTH(cases); i++) {
        begin(NULL);
        const char *sources[] = {write_raster(&first, values), write_raster(&cases[i].second, values)};
        assert_int_equal(import_many(sources, 2, file("a.gpkg"), &o), 1);
        if (!strstr(message, cases[i].phrase) || !strstr(message, cases[i].figure) || !strstr(message, "a.tif"))
            fail_msg("%s", message);
        assert_false(exists(file("a.gpkg")));
    }
}

/* -------------------------------------------------------------------------------------------- refusals -- */
static void bad_sources_get_a_sentence(void **unused) {
    (void)unused;
    double values[16];
    fill(values, 4, 4, 1);
    import_options o = defaults();
    const char *db = file("a.gpkg");
    import_refused(file("absent.tif"), db, &o, "absent.tif: No such file");
    import_refused(folder, db, &o, "is a folder");
    VSILFILE *f = VSIFOpenL(file("text.tif"), "wb");
    VSIFWriteL("hello", 1, 5, f);
    VSIFCloseL(f);
    import_refused(file("text.tif"), db, &o, "not a raster that GDAL reads");
    raster two = {.name = "two.tif", .width = 4, .height = 4, .type = GDT_Int16, .bands = 2};
    import_refused(write_raster(&two, values), db, &o, "has 2 bands");
    raster complex = {.name = "complex.tif", .width = 4, .height = 4, .type = GDT_CFloat32};
    import_refused(write_raster(&complex, values), db, &o, "complex");
    static const double turned[6] = {0, 1, 0.5, 0, 0.5, -1}, none[6] = {7, 0, 0, 7, 0, -1};
    raster rotated = {.name = "rotated.tif", .width = 4, .height = 4, .type = GDT_Int16, .place = turned};
    import_refused(write_raster(&rotated, values), db, &o, "is rotated");
    raster flat = {.name = "flat.vrt", .driver = "VRT", .width = 4, .height = 4, .type = GDT_Int16, .place = none};
    const char *path = file("flat.vrt");
    f = VSIFOpenL(path, "wb");
    const char *text = "<VRTDataset rasterXSize='4' rasterYSize='4'><GeoTransform>7,0,0,7,0,-1</GeoTransform>"
                       "<VRTRasterBand dataType='Int16' band='1'/></VRTDataset>";
    VSIFWriteL(text, 1, strlen(text), f);
    VSIFCloseL(f);
    (void)flat;
    import_refused(path, db, &o, "cell size is 0");
    raster floats = {.name = "wide.tif", .width = 4, .height = 4, .type = GDT_Float64};
    values[0] = 1e9;
    values[1] = -1e9 + 0.3;
    import_refused(write_raster(&floats, values), db, &o, "too wide for the quantum");
    raster longs = {.name = "long.tif", .width = 4, .height = 4, .type = GDT_Int64};
    values[0] = 1e16;
    import_refused(write_raster(&longs, values), db, &o, "too wide for the quantum");
    raster ints = {.name = "int.tif", .width = 4, .height = 4, .type = GDT_Int32};
    values[0] = 2e9;
    values[1] = -2e9;
    import_refused(write_raster(&ints, values), db, &o, "too wide for the quantum");
    assert_false(exists(db));
}

static void bad_options_get_a_sentence(void **unused) {
    (void)unused;
    double values[16];
    fill(values, 4, 4, 1);
    raster r = {.name = "a.tif", .width = 4, .height = 4, .type = GDT_Int16};
    const char *source = write_raster(&r, values), *db = file("a.gpkg");
    import_options o = defaults();
    o.name = "no spaces";
    import_refused(source, db, &o, "no name for a terrain");
    o = defaults();
    o.k = 9;
    import_refused(source, db, &o, "1 to 8");
    o = defaults();
    o.void_tol = 0;
    import_refused(source, db, &o, "void tolerance");
    o = defaults();
    o.quantum = -1;
    import_refused(source, db, &o, "quantum");
    o = defaults();
    o.jobs = 0;
    import_refused(source, db, &o, "jobs");
    o = defaults();
    o.memory = 1 << 20;
    import_refused(source, db, &o, "MiB of memory to import; --memory allows 1");
    assert_false(exists(db));
}

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

/* -------------------------------------------------------------------------------------------- databases -- */
static void execute(const char *database, const char *sql) {
    sqlite3 *db;
    assert_int_equal(sqlite3_open(database, &db), SQLITE_OK);
    assert_int_equal(sqlite3_exec(db, sql, NULL, NULL, NULL), SQLITE_OK);
    sqlite3_close(db);
}

static const char *small_raster(const char *name, double first) {
    double values[10 * 10];
    fill(values, 10, 10, 1);
    values[0] = first;
    raster r = {.name = name, .width = 10, .height = 10, .type = GDT_Int16};
    return write_raster(&r, values);
}

/* A slow writer: the threads run ahead until their ring is full. */
static bool dawdle(void *context, const char *stage, double done, int64_t samples) {
    (void)context;
    (void)done;
    (void)samples;
    if (!strcmp(stage, "blocks")) usleep(5000);
    return true;
}

static void jobs_do_not_change_a_byte(void **unused) {
    (void)unused;
    static double values[140 * 120];
    fill(values, 140, 120, 1);
    raster r = {.name = "a.tif", .width = 140, .height = 120, .type = GDT_Int16, .nodata = "303"};
    write_raster(&r, values);
    for (int jobs = 1; jobs <= 5; jobs += 1 + jobs / 2) {
        import_options o = defaults();
        o.jobs = jobs;
        o.k = 2;
        if (jobs > 1) o.progress = dawdle;
        VSIUnlink(file("b.gpkg"));
        import_fine(file("a.tif"), file(jobs == 1 ? "a.gpkg" : "b.gpkg"), &o);
        if (jobs > 1) expect_same_tables(file("a.gpkg"), file("b.gpkg"));
    }
}

static void an_existing_terrain_stays_unless_it_is_to_be_replaced(void **unused) {
    (void)unused;
    import_options o = defaults();
    o.name = "x";
    import_fine(small_raster("a.tif", 11), file("a.gpkg"), &o);
    char *before = dump(file("a.gpkg"), "SELECT * FROM rqt_terrain, rqt_block_1");
    small_raster("b.tif", 12);
    import_refused(file("b.tif"), file("a.gpkg"), &o, "has a terrain 'x' already");
    char *after = dump(file("a.gpkg"), "SELECT * FROM rqt_terrain, rqt_block_1");
    assert_string_equal(before, after);
    sqlite3_free(before);
    sqlite3_free(after);
    o.replace = true;
    import_fine(file("b.tif"), file("a.gpkg"), &o);
    terrain t = open_terrain(file("a.gpkg"), NULL);
    assert_int_equal(t.q[0], 12);
    close_terrain(&t);
    o.replace = false;
    o.name = "y";
    import_fine(file("a.tif"), file("a.gpkg"), &o);
    t = open_terrain(file("a.gpkg"), "y");
    assert_int_equal(t.q[0], 11);
    close_terrain(&t);
    t = open_terrain(file("a.gpkg"), "x");
    assert_int_equal(t.q[0], 12);
    close_terrain(&t);
}

static void a_new_file_is_a_geopackage_and_an_old_one_stays_what_it_is(void **unused) {
    (void)unused;
    static const char *const modes[] = {"delete", "wal"};
    import_options o = defaults();
    import_fine(small_raster("a.tif", 1), file("new.gpkg"), &o);
    char *id = dump(file("new.gpkg"), "PRAGMA application_id");
    char *contents = dump(file("new.gpkg"), "SELECT count(*) FROM gpkg_contents WHERE data_type = 'attributes'");
    assert_string_equal(id, "31313936343434343837 \n"); /* 'GPKG' as a decimal */
    assert_string_not_equal(contents, "30 \n");
    sqlite3_free(id);
    sqlite3_free(contents);
    for (size_t i = 0; i < LENGTH(modes); i++) {
        char sql[200];
        snprintf(sql, sizeof sql, "PRAGMA journal_mode=%s; CREATE TABLE mine(a); INSERT INTO mine VALUES(7)",
                 modes[i]);
        execute(file(modes[i]), sql);
        import_fine(file("a.tif"), file(modes[i]), &o);
        char *mine = dump(file(modes[i]), "SELECT a FROM mine"),
             *mode = dump(file(modes[i]), "PRAGMA journal_mode");
        char *tables = dump(file(modes[i]), "SELECT count(*) FROM sqlite_schema WHERE name LIKE 'gpkg%'");
        assert_string_equal(mine, "37 \n");
        assert_string_equal(mode, i ? "77616c \n" : "64656c657465 \n");
        assert_string_equal(tables, "30 \n");
        sqlite3_free(mine);
        sqlite3_free(mode);
        sqlite3_free(tables);
    }
    /* An empty file is a new one. */
    VSIFCloseL(VSIFOpenL(file("empty.gpkg"), "wb"));
    import_fine(file("a.tif"), file("empty.gpkg"), &o);
    terrain t = open_terrain(file("empty.gpkg"), "a");
    close_terrain(&t);
}

static void databases_that_cannot_be_written_get_a_sentence(void **unused) {
    (void)unused;
    import_options o = defaults();
    const char *source = small_raster("a.tif", 1);
    import_refused(source, file("absent/a.gpkg"), &o, "cannot be created");
    import_refused(source, folder, &o, "is a folder");
    import_refused(source, "", &o, "not the name of a file");
    import_refused(source, source, &o, "cannot be the database");
    VSILFILE *f = VSIFOpenL(file("words"), "wb");
    for (int i = 0; i < 1000; i++) VSIFWriteL("no database ", 1, 12, f);
    VSIFCloseL(f);
    import_refused(source, file("words"), &o, "is not an SQLite database");
    struct stat words;
    assert_int_equal(stat(file("words"), &words), 0);
    assert_int_equal(words.st_size, 12000);

    /* Root may write what is read-only: become nobody for a moment. */
    execute(file("closed.db"), "CREATE TABLE mine(a)");
    chmod(file("closed.db"), 0444);
    uid_t me = geteuid();
    if (me == 0) assert_int_equal(seteuid(65534), 0);
    import_refused(source, file("closed.db"), &o, "is read-only");
    if (me == 0) assert_int_equal(seteuid(0), 0);

    execute(file("busy.db"), "CREATE TABLE mine(a)");
    sqlite3 *other;
    assert_int_equal(sqlite3_open(file("busy.db"), &other), SQLITE_OK);
    assert_int_equal(sqlite3_exec(other, "BEGIN IMMEDIATE", NULL, NULL, NULL), SQLITE_OK);
    import_refused(source, file("busy.db"), &o, "is locked");
    sqlite3_close(other);
    import_fine(source, file("busy.db"), &o);
}

static void a_full_disk_leaves_nothing(void **unused) {
    (void)unused;
    static double values[300 * 300];
    for (size_t s = 0; s < LENGTH(values); s++) values[s] = rint(uniform() * 30000);
    raster r = {.name = "a.tif", .width = 300, .height = 300, .type = GDT_Int16};
    write_raster(&r, values);
    execute(file("old.db"), "CREATE TABLE mine(a)");
    import_options o = defaults();
    struct rlimit before, small;
    getrlimit(RLIMIT_FSIZE, &before);
    small = before;
    small.rlim_cur = 100000;
    signal(SIGXFSZ, SIG_IGN);
    setrlimit(RLIMIT_FSIZE, &small);
    import_refused(file("a.tif"), file("new.gpkg"), &o, "new.gpkg");
    char sentence[1024];
    snprintf(sentence, sizeof sentence, "%s", message);
    import_refused(file("a.tif"), file("old.db"), &o, "old.db");
    setrlimit(RLIMIT_FSIZE, &before);
    if (!strstr(sentence, "full") && !strstr(sentence, "disk I/O")) fail_msg("%s", sentence);
    assert_false(exists(file("new.gpkg")));
    assert_false(exists(file("new.gpkg-journal")));
    char *tables = dump(file("old.db"), "SELECT count(*) FROM sqlite_schema");
    assert_string_equal(tables, "31 \n");
    sqlite3_free(tables);
}

/* Stop at the n-th call of a stage. */
typedef struct stopper {
    const char *stage;
    int calls, seen;
    double last;
} stopper;

static bool stop_at(void *context, const char *stage, double done, int64_t samples) {
    stopper *s = context;
    assert_true(samples == 140 * 120);
    assert_true(done >= 0 && done <= 1);
    if (strcmp(stage, s->stage)) return true;
    assert_true(done >= s->last);
    s->last = done;
    return ++s->seen < s->calls;
}

static void a_stopped_import_leaves_the_database_as_it_was(void **unused) {
    (void)unused;
    static const char *const stages[] = {"reading", "errors", "blocks"};
    static double values[140 * 120];
    fill(values, 140, 120, 1);
    raster r = {.name = "a.tif", .width = 140, .height = 120, .type = GDT_Int16};
    write_raster(&r, values);
    small_raster("old.tif", 5);
    import_options o = defaults();
    o.k = 2;
    o.name = "a";
    o.notice = NULL;
    import_fine(file("old.tif"), file("old.gpkg"), &o);
    char *before = dump(file("old.gpkg"), "SELECT * FROM rqt_terrain, rqt_block_1");
    for (size_t i = 0; i < LENGTH(stages); i++) {
        for (int old = 0; old < 2; old++) {
            stopper s = {.stage = stages[i], .calls = 2};
            import_options with = o;
            with.progress = stop_at;
            with.context = &s;
            with.replace = old;
            import_refused(file("a.tif"), file(old ? "old.gpkg" : "new.gpkg"), &with, "as it was");
            assert_int_equal(s.seen, 2);
            assert_false(exists(file("new.gpkg")));
            assert_false(exists(file("new.gpkg-journal")));
        }
        char *after = dump(file("old.gpkg"), "SELECT * FROM rqt_terrain, rqt_block_1");
        assert_string_equal(before, after);
        sqlite3_free(after);
        char *tables = dump(file("old.gpkg"), "SELECT count(*) FROM sqlite_schema WHERE name LIKE 'rqt_block%'");
        assert_string_equal(tables, "31 \n");
        sqlite3_free(tables);
    }
    sqlite3_free(before);
    /* Each stage goes to its end when nobody stops it. */
    for (size_t i = 0; i < LENGTH(stages); i++) {
        stopper s = {.stage = stages[i], .calls = 1 << 30};
        import_options with = o;
        with.progress = stop_at;
        with.context = &s;
        with.replace = true;
        import_fine(file("a.tif"), file("new.gpkg"), &with);
        assert_true(s.last == 1);
    }
}

/* Die, as by kill -9, at the n-th call of a stage. */
static bool die_at(void *context, const char *stage, double done, int64_t samples) {
    stopper *s = context;
    (void)done;
    (void)samples;
    if (!strcmp(stage, s->stage) && ++s->seen == s->calls) raise(SIGKILL);
    return true;
}

static void a_killed_import_leaves_no_terrain_that_looks_whole(void **unused) {
    (void)unused;
    static const stopper moments[] = {{.stage = "reading", .calls = 1},
                                      {.stage = "errors", .calls = 1},
                                      {.stage = "blocks", .calls = 1},
                                      {.stage = "blocks", .calls = 5},
                                      {.stage = "blocks", .calls = 20}};
    static double values[140 * 120];
    fill(values, 140, 120, 1);
    raster r = {.name = "a.tif", .width = 140, .height = 120, .type = GDT_Int16};
    write_raster(&r, values);
    small_raster("old.tif", 5);
    import_options o = defaults();
    o.k = 2;
    o.notice = NULL;
    for (size_t i = 0; i < LENGTH(moments); i++) {
        for (int old = 0; old < 2; old++) {
            const char *database = file("b.gpkg");
            VSIUnlink(database);
            if (old) import_fine(file("old.tif"), database, &o);
            pid_t child = fork();
            if (child == 0) {
                stopper s = moments[i];
                const char *source = file("a.tif");
                import_options with = o;
                with.progress = die_at;
                with.context = &s;
                import_many(&source, 1, database, &with);
                _exit(0);
            }
            int status;
            assert_int_equal(waitpid(child, &status, 0), child);
            assert_true(WIFSIGNALED(status));
            if (old) {
                char *names =
                    dump(database, "SELECT count(*), sum(complete), count(*) FROM rqt_terrain WHERE name = 'old'");
                char *all = dump(database, "SELECT count(*), sum(complete), count(*) FROM rqt_terrain");
                assert_string_equal(names, "31 31 31 \n");
                assert_string_equal(all, names);
                sqlite3_free(names);
                sqlite3_free(all);
            } else if (exists(database)) {
                char *tables = dump(database, "SELECT count(*) FROM sqlite_schema");
                assert_string_equal(tables, "30 \n");
                sqlite3_free(tables);
            }
            /* And nothing stands in the way of the next one. */
            import_fine(file("a.tif"), database, &o);
            terrain t = open_terrain(database, "a");
            expect_metres(&t, values);
            close_terrain(&t);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(name) cmocka_unit_test_setup(name, begin)
        TEST(every_extent_reads_back_sample_for_sample),
        TEST(every_band_type_reads_back),
        TEST(voids_are_what_is_declared_given_or_masked),
        TEST(a_raster_of_voids_is_a_terrain),
        TEST(infinity_is_refused_with_its_place),
        TEST(decimals_are_kept_exactly),
        TEST(noise_is_rounded_and_says_so),
        TEST(a_quantum_in_feet_is_a_step_in_feet),
        TEST(heights_far_from_zero_lose_nothing),
        TEST(metres_follow_unit_scale_and_offset),
        TEST(an_unknown_unit_is_told_and_taken_as_metres),
        TEST(south_up_and_mirrored_rasters_equal_north_up),
        TEST(pixels_that_are_points_lie_where_they_say),
        TEST(without_a_geotransform_samples_are_columns_and_rows),
        TEST(the_crs_is_told),
        TEST(tiles_that_share_a_row_equal_one_raster),
        TEST(the_later_source_wins_and_a_void_never_does),
        TEST(sources_of_unlike_kinds_meet_in_metres),
        TEST(sources_of_unlike_grids_are_refused),
        TEST(bad_sources_get_a_sentence),
        TEST(bad_options_get_a_sentence),
        TEST(names_come_from_the_first_file),
        TEST(an_archive_with_one_raster_is_that_raster),
        TEST(an_undeclared_mark_is_noticed),
        TEST(jobs_do_not_change_a_byte),
        TEST(an_existing_terrain_stays_unless_it_is_to_be_replaced),
        TEST(a_new_file_is_a_geopackage_and_an_old_one_stays_what_it_is),
        TEST(databases_that_cannot_be_written_get_a_sentence),
        TEST(a_full_disk_leaves_nothing),
        TEST(a_stopped_import_leaves_the_database_as_it_was),
        TEST(a_killed_import_leaves_no_terrain_that_looks_whole),
    };
    alarm(300); /* threads that wait for each other for ever are a failure too */
    return cmocka_run_group_tests(tests, begin_all, end_all);
}
