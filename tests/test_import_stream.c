/* test_import_stream.c - promises of the import about its own ways: however it goes about a raster - one reading or
 * two, tiles of any size, any number of threads, blocks waiting in memory or on a scratch file - the tables hold
 * the same bytes as when everything is computed at once in memory, which is done here. */
#include "test_import_support.h"

#include <signal.h>
#include <sys/resource.h>

#include "parts.h"

typedef struct grid {
    int width, height;
    double *values; /* NaN: void */
    /* what the heights should be */
    int64_t z0;
    int32_t d;
    double quantum_error, f;
} grid;

/* ---------------------------------------------------------------------------------------------- the reference */
static void check(int code, char *error) {
    if (code != SQLITE_OK) fail_msg("%s", error ? error : sqlite3_errstr(code));
}

static rqt_code write_reference(store_writer *writer, const rqt_grid *samples, const store_terrain *info) {
    const rqt_allocator *a = store_allocator();
    rqt_errors errors;
    rqt_pyramid *pyramid = NULL;
    rqt_codec *codec = NULL;
    rqt_block block;
    rqt_code most = 0;
    char *error = NULL;
    uint8_t *bytes = malloc(rqt_block_bound(info->k));
    assert_int_equal(rqt_errors_compute(samples, &info->unit, &info->cost, a, NULL, NULL, &errors), RQT_OK);
    rqt_errors_saturate(&errors);
    assert_int_equal(rqt_pyramid_create(samples, &errors, info->k, a, &pyramid), RQT_OK);
    assert_int_equal(rqt_codec_create(a, &codec), RQT_OK);
    assert_int_equal(rqt_block_create(info->k, a, &block), RQT_OK);
    for (size_t n = 0; n < rqt_pyramid_count(pyramid); n++) {
        rqt_block_number number;
        rqt_summary summary;
        size_t size, side = ((size_t)1 << info->k) + 1;
        rqt_pyramid_block(pyramid, n, &number, &summary, &block);
        for (size_t i = 0; i < side * side; i++)
            if (block.error[i] != RQT_CODE_INFINITY && block.error[i] > most) most = block.error[i];
        const double f = info->unit.scale * info->unit.numerator / info->unit.denominator;
        assert_int_equal(rqt_block_encode(codec, &block, fabs(f) / info->unit.d, bytes, &size), RQT_OK);
        check(store_writer_block(writer, number, &summary, bytes, size, &error), error);
    }
    rqt_block_free(&block, a);
    rqt_codec_free(codec);
    rqt_pyramid_free(pyramid);
    rqt_errors_free(&errors, a);
    free(bytes);
    return most;
}

/* A database with the terrain that `like` has, made of g. */
static void make_reference(const char *path, const char *like, const grid *g) {
    terrain t = open_terrain(like, NULL);
    store_terrain info = *t.t;
    const size_t n = (size_t)g->width * (size_t)g->height;
    int32_t *q = calloc(n, sizeof *q), low = INT32_MAX, high = INT32_MIN;
    uint8_t *valid = calloc(n, 1);
    char *error = NULL;
    store_writer *writer = NULL;
    sqlite3 *db;
    info.voids = 0;
    for (size_t i = 0; i < n; i++) {
        valid[i] = (uint8_t)(isnan(g->values[i]) ? 0 : 1);
        info.voids += !valid[i];
        if (!valid[i]) continue;
        q[i] = (int32_t)lrint((g->values[i] - (double)g->z0) * g->d);
        low = q[i] < low ? q[i] : low;
        high = q[i] > high ? q[i] : high;
    }
    assert_int_equal(rqt_lattice_init(&info.lattice, g->width, g->height), RQT_OK);
    info.unit = (rqt_unit){.z0 = g->z0, .d = g->d, .numerator = 1, .denominator = 1, .scale = g->f};
    info.quantum_error = g->quantum_error;
    info.min_q = low <= high ? low : 0;
    info.max_q = low <= high ? high : 0;
    assert_int_equal(sqlite3_open(path, &db), SQLITE_OK);
    assert_int_equal(sqlite3_exec(db, "BEGIN IMMEDIATE", NULL, NULL, NULL), SQLITE_OK);
    check(store_make_geopackage(db, &error), error);
    check(store_writer_begin(db, &info, false, &writer, &error), error);
    const rqt_grid samples = {.lattice = info.lattice, .q = q, .valid = info.voids ? valid : NULL};
    const rqt_code most = write_reference(writer, &samples, &info);
    check(store_writer_finish(writer, most, &error), error);
    store_writer_free(writer);
    assert_int_equal(sqlite3_exec(db, "COMMIT", NULL, NULL, NULL), SQLITE_OK);
    sqlite3_close(db);
    close_terrain(&t);
    free(q);
    free(valid);
}

static void expect_all_equal(const char *a, const char *b, const char *how) {
    static const char *const queries[] = {
        "SELECT id, format, complete, width, height, k, z0, d, unit_numerator, unit_denominator, scale, "
        "height_offset, "
        "quantum_error, cell, void_tol, voids, min_q, max_q, blocks, bytes, max_error FROM rqt_terrain",
        "SELECT name, x0, y0, dx, dy, srid, lonlat, wgs84, crs, vertical, source FROM rqt_terrain",
        "SELECT * FROM rqt_block_1 ORDER BY id", "SELECT * FROM rqt_index_1 ORDER BY id",
        "SELECT table_name, data_type, identifier, description FROM gpkg_contents ORDER BY table_name"};
    for (size_t i = 0; i < LENGTH(queries); i++) {
        char *left = dump(a, queries[i]), *right = dump(b, queries[i]);
        if (!strlen(left) || strcmp(left, right))
            fail_msg("%s: %s differs:\n%.400s\n%.400s", how, queries[i], left, right);
        sqlite3_free(left);
        sqlite3_free(right);
    }
}

/* ------------------------------------------------------------------------------------------------- every way */
static void import_in_a_way(const char *const *sources, int count, const char *database, const import_options *o,
                            const import_force *force) {
    notices[0] = 0;
    if (import_run_forced(sources, count, database, o, force, &report, message, sizeof message))
        fail_msg("%s", message);
}

/* The same sources in every mode and with every size of tiles; threads, strips and scratches change along. */
static void expect_every_way(const char *name, const char *const *sources, int count, const grid *g) {
    static const int strip_rows[] = {1, 5, 64, 3, 1000}, strips[] = {1, 2, 3, 5};
    unsigned way = 0;
    for (int k = 1; k <= 3; k += 2) {
        import_options o = defaults();
        o.k = k;
        o.name = "a";
        VSIUnlink(file("plain.gpkg"));
        VSIUnlink(file("reference.gpkg"));
        import_in_a_way(sources, count, file("plain.gpkg"), &o, NULL);
        make_reference(file("reference.gpkg"), file("plain.gpkg"), g);
        expect_all_equal(file("plain.gpkg"), file("reference.gpkg"), name);
        rqt_lattice lattice;
        assert_int_equal(rqt_lattice_init(&lattice, g->width, g->height), RQT_OK);
        const int lowest = k < lattice.K ? k : lattice.K;
        for (int b = lowest > 1 ? lowest : 1; b <= (lattice.K > 1 ? lattice.K : 1); b++) {
            for (int two = 0; two < 2; two++, way++) {
                const import_force force = {.in_memory = !two,
                                            .two_readings = two,
                                            .b = b,
                                            .strip_rows = strip_rows[way % LENGTH(strip_rows)],
                                            .strips = strips[way % LENGTH(strips)],
                                            .stage = way % 3 ? -1 : 0,
                                            .kept = way % 7 < 3 ? -1 : 0};
                char how[200];
                o.jobs = 1 + (int)(way % 4);
                snprintf(how, sizeof how, "%s: k %d, b %d, %d readings, %d jobs, strips of %d", name, k, b, two + 1,
                         o.jobs, force.strip_rows);
                VSIUnlink(file("way.gpkg"));
                import_in_a_way(sources, count, file("way.gpkg"), &o, &force);
                expect_all_equal(file("way.gpkg"), file("reference.gpkg"), how);
            }
        }
    }
}

/* Rough hills with a cliff and a plain, in steps of 1/d about z0. */
static double *hills(int width, int height, double z0, double d) {
    double *values = calloc((size_t)width * (size_t)height, sizeof *values);
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            double v = 300 + 90 * sin(x * 0.21) * cos(y * 0.17) + 8 * uniform() + (x > width / 2 ? 77 : 0);
            if (y > height / 3 && y < height / 2 && x < width / 3) v = 250;
            values[y * width + x] = z0 + rint(v * d) / d;
        }
    return values;
}

static void expect_raster(const char *name, raster r, grid *g) {
    begin(NULL);
    const size_t n = (size_t)g->width * (size_t)g->height;
    double *written = malloc(n * sizeof *written);
    r.name = "a.tif";
    r.width = g->width;
    r.height = g->height;
    for (size_t i = 0; i < n; i++) written[i] = isnan(g->values[i]) ? CPLAtof(r.nodata) : g->values[i];
    char path[300];
    const char *source = path;
    snprintf(path, sizeof path, "%s", write_raster(&r, written));
    expect_every_way(name, &source, 1, g);
    free(written);
    free(g->values);
}

static void every_way_gives_the_same_tables_for_every_extent(void **unused) {
    (void)unused;
    static const int extents[][2] = {{1, 1},   {2, 2},   {1, 40},  {40, 1},  {3, 3},  {33, 33},
                                     {34, 33}, {70, 45}, {20, 90}, {97, 18}, {2, 65}, {64, 64}};
    for (size_t i = 0; i < LENGTH(extents); i++) {
        grid g = {.width = extents[i][0], .height = extents[i][1], .d = 1, .f = 1};
        char name[60];
        snprintf(name, sizeof name, "%d x %d", g.width, g.height);
        g.values = hills(g.width, g.height, 0, 1);
        expect_raster(name, (raster){.type = GDT_Int16}, &g);
    }
}

static void every_way_gives_the_same_tables_with_voids(void **unused) {
    (void)unused;
    static const int extents[][2] = {{33, 33}, {57, 40}, {18, 70}};
    for (size_t i = 0; i < LENGTH(extents); i++) {
        grid g = {.width = extents[i][0], .height = extents[i][1], .d = 1, .f = 1};
        g.values = hills(g.width, g.height, 0, 1);
        for (int y = 0; y < g.height; y++)
            for (int x = 0; x < g.width; x++)
                if (hypot(x - 20, y - 12) < 7 || uniform() < 0.01 || y < 2) g.values[y * g.width + x] = NAN;
        expect_raster("voids", (raster){.type = GDT_Int16, .nodata = "-32768"}, &g);
    }
    grid g = {.width = 21, .height = 35, .d = 1, .f = 1};
    g.values = hills(g.width, g.height, 0, 1);
    for (int i = 0; i < 21 * 35; i++) g.values[i] = NAN;
    expect_raster("all void", (raster){.type = GDT_Int16, .nodata = "-32768"}, &g);
}

static void every_way_gives_the_same_tables_of_decimals(void **unused) {
    (void)unused;
    static const struct {
        const char *name;
        GDALDataType type;
        double z0, step; /* of the values */
        int64_t origin;  /* 0, or whatever the import has to find */
        int32_t d;
    } cases[] = {{"metres", GDT_Float32, 0, 1, 0, 1},
                 {"centimetres", GDT_Float32, 0, 100, 0, 100},
                 {"millimetres", GDT_Float64, 0, 1000, 0, 1000},
                 {"millimetres far away", GDT_Float64, 10000000, 1000, 1, 1000},
                 {"whole numbers far away", GDT_Int32, 2000000000, 1, 1, 1}};
    for (size_t i = 0; i < LENGTH(cases); i++) {
        grid g = {.width = 45, .height = 38, .d = cases[i].d, .f = 1};
        g.values = hills(g.width, g.height, cases[i].z0, cases[i].step);
        for (int s = 0; s < g.width * g.height; s++)
            if (cases[i].type == GDT_Float32) g.values[s] = (double)(float)g.values[s];
        if (cases[i].origin) {
            double low = INFINITY, high = -INFINITY;
            for (int s = 0; s < g.width * g.height; s++) {
                low = fmin(low, g.values[s]);
                high = fmax(high, g.values[s]);
            }
            g.z0 = (int64_t)floor(low / 2 + high / 2);
        }
        expect_raster(cases[i].name, (raster){.type = cases[i].type}, &g);
    }
}

/* No decimals; and decimals, or voids, for a while, so that the import must look a second time. */
static void every_way_gives_the_same_tables_of_rounded_heights(void **unused) {
    (void)unused;
    for (int first = 0; first < 4; first++) {
        grid g = {.width = 45, .height = 38, .d = 1024, .quantum_error = 0.5 / 1024, .f = 1};
        g.values = hills(g.width, g.height, 0, first == 1 ? 1 : 10);
        for (int s = first ? g.width * 20 : 0; s < g.width * g.height; s++) g.values[s] += uniform() / 3;
        for (int s = 0; first == 3 && s < g.width * 20; s++) g.values[s] = NAN;
        expect_raster("noise", (raster){.type = GDT_Float64, .nodata = first == 3 ? "-1" : NULL}, &g);
    }
}

static void every_way_gives_the_same_tables_of_mosaics(void **unused) {
    (void)unused;
    /* Sources over each other, beside each other, apart; north-up, south-up, with voids. */
    static const struct {
        int x, y, width, height;
        bool south_up;
    } parts[] = {{10, 5, 30, 20, false},
                 {0, 12, 25, 30, true},
                 {33, 0, 20, 45, false},
                 {2, 30, 50, 9, true},
                 {60, 40, 8, 20, false}};
    const int width = 68, height = 60;
    begin(NULL);
    grid g = {.width = width, .height = height, .d = 1, .f = 1};
    g.values = malloc(sizeof(double) * (size_t)(width * height));
    for (int s = 0; s < width * height; s++) g.values[s] = NAN;
    const char *sources[LENGTH(parts)];
    char paths[LENGTH(parts)][300];
    static const char *const names[] = {"a.tif", "b.tif", "c.tif", "d.tif", "e.tif"};
    int64_t twice = 0, differ = 0;
    static uint8_t seen[68 * 60];
    for (size_t i = 0; i < LENGTH(parts); i++) {
        const int w = parts[i].width, h = parts[i].height;
        double values[50 * 45], turned[50 * 45],
            place[6] = {500000 + 10.0 * parts[i].x, 10, 0, 4000000 - 10.0 * parts[i].y, 0, -10};
        fill(values, w, h, 1);
        for (int s = 0; s < w * h; s++)
            if (uniform() < 0.1) values[s] = -5;
        for (int y = 0; y < h; y++)
            for (int x = 0; x < w; x++) {
                const int at = (parts[i].y + y) * width + parts[i].x + x;
                const double v = values[y * w + x];
                if (v == -5) continue;
                if (seen[at] & 1) seen[at] |= (uint8_t)(2 | (v != g.values[at] ? 4 : 0));
                seen[at] |= 1;
                g.values[at] = v;
            }
        if (parts[i].south_up) {
            for (int y = 0; y < h; y++)
                memcpy(turned + y * w, values + (h - 1 - y) * w, sizeof(double) * (size_t)w);
            place[3] = 4000000 - 10.0 * (parts[i].y + h);
            place[5] = 10;
        }
        raster r = {.name = names[i], .width = w, .height = h, .type = GDT_Int16, .nodata = "-5", .place = place};
        snprintf(paths[i], sizeof paths[i], "%s", write_raster(&r, parts[i].south_up ? turned : values));
        sources[i] = paths[i];
    }
    for (int s = 0; s < width * height; s++) {
        twice += (seen[s] & 2) != 0;
        differ += (seen[s] & 4) != 0;
    }
    expect_every_way("mosaic", sources, (int)LENGTH(sources), &g);
    assert_int_equal(report.overlap, twice);
    assert_int_equal(report.overlap_differs, differ);
    free(g.values);
}

/* Sources whose GDAL blocks are taller than the strips, tiled, compressed and masked. */
static void every_way_gives_the_same_tables_of_tiled_sources(void **unused) {
    (void)unused;
    grid g = {.width = 150, .height = 131, .d = 1, .f = 1};
    g.values = hills(g.width, g.height, 0, 1);
    expect_raster("tiles", (raster){.type = GDT_Int16, .options = {"TILED=YES", "COMPRESS=DEFLATE"}}, &g);
    g.values = hills(g.width, g.height, 0, 1);
    uint8_t *mask = malloc(150 * 131);
    for (int s = 0; s < 150 * 131; s++) mask[s] = uniform() < 0.03 ? 0 : 255;
    double *whole = malloc(sizeof(double) * 150 * 131);
    memcpy(whole, g.values, sizeof(double) * 150 * 131);
    for (int s = 0; s < 150 * 131; s++)
        if (!mask[s]) g.values[s] = NAN;
    begin(NULL);
    raster r = {.name = "a.tif", .width = 150, .height = 131, .type = GDT_Int16, .mask = mask};
    char path[300];
    const char *source = path;
    snprintf(path, sizeof path, "%s", write_raster(&r, whole));
    expect_every_way("masked", &source, 1, &g);
    free(g.values);
    free(whole);
    free(mask);
}

/* -------------------------------------------------------------------------------------------------- failures */
static void a_full_disk_stops_the_scratch_file_too(void **unused) {
    (void)unused;
    begin(NULL);
    static double values[200 * 200];
    for (size_t s = 0; s < LENGTH(values); s++) values[s] = rint(uniform() * 30000);
    raster r = {.name = "a.tif", .width = 200, .height = 200, .type = GDT_Int16};
    const char *source = write_raster(&r, values);
    struct rlimit before, small;
    getrlimit(RLIMIT_FSIZE, &before);
    small = before;
    signal(SIGXFSZ, SIG_IGN);
    for (int kept = 0; kept < 2; kept++) {
        const import_force force = {.in_memory = true, .b = 3, .stage = kept ? -1 : 0, .kept = kept ? 0 : -1};
        const import_options o = defaults();
        small.rlim_cur = kept ? 2000 : 20000;
        setrlimit(RLIMIT_FSIZE, &small);
        const int failed =
            import_run_forced(&source, 1, file("new.gpkg"), &o, &force, &report, message, sizeof message);
        setrlimit(RLIMIT_FSIZE, &before);
        assert_int_equal(failed, 1);
        if (!strstr(message, "scratch file beside") || !strstr(message, "the disk is full"))
            fail_msg("%s", message);
        assert_false(exists(file("new.gpkg")));
        char **names = VSIReadDir(folder);
        for (char **name = names; name && *name; name++)
            if (strstr(*name, "scratch")) fail_msg("%s is left", *name);
        CSLDestroy(names);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(name) cmocka_unit_test_setup(name, begin)
        TEST(every_way_gives_the_same_tables_for_every_extent),
        TEST(every_way_gives_the_same_tables_with_voids),
        TEST(every_way_gives_the_same_tables_of_decimals),
        TEST(every_way_gives_the_same_tables_of_rounded_heights),
        TEST(every_way_gives_the_same_tables_of_mosaics),
        TEST(every_way_gives_the_same_tables_of_tiled_sources),
        TEST(a_full_disk_stops_the_scratch_file_too),
    };
    alarm(300); /* threads that wait for each other for ever are a failure too */
    return cmocka_run_group_tests(tests, begin_all, end_all);
}
