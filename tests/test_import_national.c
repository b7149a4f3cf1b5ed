/* test_import_national.c - promises of imports of many tiles: thousands of sources in few descriptors, any order of
 * them, folders and lists, gaps and overlaps and conflicts told exactly (against a slow look at every sample).
 * Resuming is in test_import_resume.c, what is filled in test_import_fill.c. */
#include "test_import_tiles.h"

#include <sys/resource.h>

/* -------------------------------------------------------------------------------------------- many tiles -- */
static void thousands_of_tiles_need_few_descriptors(void **unused) {
    (void)unused;
    assert_int_equal(mkdir(file("many"), 0777), 0);
    epsg = -1; /* a CRS in each of them is most of what it takes to write and open them */
    make_grid("many/", 50, 50, 17, true);
    epsg = 32633;
    struct rlimit before, few;
    getrlimit(RLIMIT_NOFILE, &before);
    few = before;
    few.rlim_cur = 48; /* fewer than tiles in a row */
    setrlimit(RLIMIT_NOFILE, &few);
    import_options o = defaults();
    const char *source = file("many");
    const import_force wide = {.two_readings = true, .strip_rows = 100, .stage = -1, .kept = -1};
    forced_fine(&source, 1, file("a.gpkg"), &o, &wide);
    setrlimit(RLIMIT_NOFILE, &before);
    assert_int_equal(national.sources, 2500);
    assert_int_equal(national.samples_read, 2500 * 17 * 17);
    assert_int_equal(national.overlap_differs, 0);
    assert_string_equal(national.name, "many");
    expect_hills(file("a.gpkg"), 801, 801);
    /* The same as a list of all of them, which is in memory. */
    FILE *list = fopen(file("tiles.txt"), "w");
    fputs("# tiles\n\n", list);
    for (int i = 0; i < count; i++) fprintf(list, "  many/%s \r\n", strrchr(paths[i], '/') + 1);
    fclose(list);
    char argument[300];
    snprintf(argument, sizeof argument, "@%s", file("tiles.txt"));
    const char *at = argument;
    assert_int_equal(import_many(&at, 1, file("b.gpkg"), &o), 0);
    assert_string_equal(report.name, "tiles");
    assert_int_equal(report.spooled, 0);
    expect_all_equal(file("a.gpkg"), file("b.gpkg"));
    char *source_text =
        dump(file("b.gpkg"), "SELECT source FROM rqt_terrain WHERE source = 'tiles.txt (2500 rasters)'");
    assert_true(strlen(source_text) > 0);
    sqlite3_free(source_text);
    forget_tiles();
}

static void tiles_that_abut_are_tiles_that_share(void **unused) {
    (void)unused;
    import_options o = defaults();
    make_grid("", 4, 3, 12, false);
    forced_fine(paths, count, file("a.gpkg"), &o, &two_readings);
    assert_int_equal(national.voids, 0);
    assert_int_equal(national.overlap, 0);
    assert_string_equal(notices, "");
    expect_hills(file("a.gpkg"), 48, 36);
    forget_tiles();
}

/* Tiles that agree, in any order, with coordinates that differ in their last digits. */
static void F44_the_order_of_sources_changes_no_byte(void **unused) {
    (void)unused;
    const int seed = getenv("RQT_SEED") ? atoi(getenv("RQT_SEED")) : 1;
    print_message("RQT_SEED=%d\n", seed);
    state = (uint32_t)seed;
    import_options o = defaults();
    o.name = "a";
    make_grid("", 4, 5, 9, true);
    for (int i = 0; i < count; i++) {
        GDALDatasetH d = GDALOpen(tiles[i].path, GA_Update);
        double g[6];
        GDALGetGeoTransform(d, g);
        g[0] += (uniform() - 0.5) * 1e-6;
        g[3] += (uniform() - 0.5) * 1e-6;
        g[1] *= 1 + (uniform() - 0.5) * 1e-9;
        GDALSetGeoTransform(d, g);
        GDALClose(d);
    }
    forced_fine(paths, count, file("a.gpkg"), &o, &two_readings);
    for (int turn = 0; turn < 6; turn++) {
        for (int i = count - 1; i > 0; i--) {
            const int j = (int)(uniform() * (i + 1));
            const char *swap = paths[i];
            paths[i] = paths[j];
            paths[j] = swap;
        }
        VSIUnlink(file("b.gpkg"));
        forced_fine(paths, count, file("b.gpkg"), &o, turn % 2 ? &two_readings : NULL);
        expect_all_equal(file("a.gpkg"), file("b.gpkg"));
    }
    forget_tiles();
}

static void touch(const char *name, const char *text) {
    FILE *f = fopen(file(name), "w");
    fputs(text, f);
    fclose(f);
}

static void folders_and_lists_give_their_rasters(void **unused) {
    (void)unused;
    import_options o = defaults();
    mkdir(file("empty"), 0777);
    import_refused(file("empty"), file("a.gpkg"), &o, "empty is a folder without rasters");
    mkdir(file("land.v2"), 0777);
    mkdir(file("land.v2/north"), 0777);
    import_refused(file("land.v2"), file("a.gpkg"), &o, "is a folder without rasters");
    add_tile("land.v2/", 0, 8, 9, 9);
    add_tile("land.v2/north/", 0, 0, 9, 9);
    write_tiles();
    touch("land.v2/readme.txt", "tiles");
    touch("land.v2/.hidden.tif", "nothing");
    touch("land.v2/t0000.tif.aux.xml", "<PAMDataset></PAMDataset>");
    double three[9 * 9 * 3] = {0};
    raster picture = {.name = "land.v2/view.tif", .width = 9, .height = 9, .bands = 3, .type = GDT_Byte};
    write_raster(&picture, three);
    symlink("..", file("land.v2/loop"));
    import_fine(file("land.v2"), file("land.v2/a.gpkg"), &o);
    assert_string_equal(report.name, "land");
    assert_int_equal(report.sources, 2);
    says(notices, "view.tif is passed over: it has 3 bands");
    char *stored = dump(file("land.v2/a.gpkg"), "SELECT 1 FROM rqt_terrain WHERE source = 'land.v2 (2 rasters)'");
    assert_string_equal(stored, "31 \n");
    sqlite3_free(stored);
    expect_hills(file("land.v2/a.gpkg"), 9, 17);
    /* The database that lies there is no source. */
    o.replace = true;
    import_fine(file("land.v2"), file("land.v2/a.gpkg"), &o);
    assert_int_equal(report.sources, 2);

    touch("list.txt", "# two\nland.v2/t0000.tif\n\nland.v2/absent.tif\n");
    char argument[300];
    snprintf(argument, sizeof argument, "@%s", file("list.txt"));
    import_refused(argument, file("b.gpkg"), &o, "list.txt, line 4: ");
    says(message, "absent.tif: No such file");
    touch("list.txt", "land.v2/north\nempty\n");
    import_refused(argument, file("b.gpkg"), &o, "list.txt, line 2: ");
    says(message, "empty is a folder without rasters");
    touch("list.txt", "# nothing\n");
    import_refused(argument, file("b.gpkg"), &o, "list.txt lists no sources");
    snprintf(argument, sizeof argument, "@%s", file("nowhere.txt"));
    import_refused(argument, file("b.gpkg"), &o, "nowhere.txt, a list of sources, cannot be read");
    assert_false(exists(file("b.gpkg")));
    /* A file that is a raster by its head and cannot be read is no reason to pass it over. */
    touch("land.v2/cut.tif", "II*");
    FILE *f = fopen(file("land.v2/cut.tif"), "wb");
    fwrite("II*\0\x08\0\0\0\x01\0", 1, 10, f);
    fclose(f);
    import_refused(file("land.v2"), file("b.gpkg"), &o, "cut.tif");
    says(notices, "a.gpkg is passed over: it holds no raster");
    forget_tiles();
}

/* ------------------------------------------------------------------------------------------------- findings -- */
static int index_of(const cJSON *o, const char *key) {
    const char *path = cJSON_GetStringValue(cJSON_GetObjectItem(o, key));
    for (int i = 0; i < count; i++)
        if (path && !strcmp(path, tiles[i].path)) return i;
    fail_msg("%s is no tile", path ? path : key);
    return -1;
}

#define SIDE 64
typedef struct pair {
    int differ, worst_x, worst_y, first_x, first_y;
    double largest;
} pair;

/* What a look at every sample finds, against every line of the report. */
static void expect_findings(const char *path, int left, int top, int width, int height) {
    static int owner[SIDE][SIDE];
    static double value[SIDE][SIDE];
    static pair pairs[12][12];
    static int covered[SIDE][SIDE];
    memset(pairs, 0, sizeof pairs);
    memset(covered, 0, sizeof covered);
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++) owner[y][x] = -1;
    for (int i = 0; i < count; i++)
        for (int v = 0; v < tiles[i].height; v++)
            for (int u = 0; u < tiles[i].width; u++) {
                const int x = tiles[i].x + u - left, y = tiles[i].y + v - top;
                const double z = tiles[i].values[v * tiles[i].width + u];
                covered[y][x] = 1;
                if (isnan(z)) continue;
                const int before = owner[y][x];
                const double off = before < 0 ? 0 : fabs(z - value[y][x]);
                if (off > 0) {
                    pair *p = &pairs[before][i];
                    if (!p->differ++ || y < p->first_y || (y == p->first_y && x < p->first_x))
                        p->first_y = y, p->first_x = x;
                    if (off > p->largest ||
                        (off == p->largest && (y < p->worst_y || (y == p->worst_y && x < p->worst_x))))
                        p->largest = off, p->worst_y = y, p->worst_x = x;
                }
                owner[y][x] = i;
                value[y][x] = z;
            }
    /* Samples that no source covers, and from which one gets to the edge through others like them. */
    static bool outside[SIDE][SIDE];
    memset(outside, 0, sizeof outside);
    for (bool more = true; more;) {
        more = false;
        for (int y = 0; y < height; y++)
            for (int x = 0; x < width; x++) {
                if (covered[y][x] || outside[y][x]) continue;
                outside[y][x] = x == 0 || y == 0 || x == width - 1 || y == height - 1 || outside[y - 1][x] ||
                                outside[y + 1][x] || outside[y][x - 1] || outside[y][x + 1];
                more = more || outside[y][x];
            }
    }
    cJSON *json = read_json(path), *feature;
    static int overlaps[12][12];
    memset(overlaps, 0, sizeof overlaps);
    cJSON_ArrayForEach(feature, cJSON_GetObjectItem(json, "features")) {
        const cJSON *p = cJSON_GetObjectItem(feature, "properties");
        const char *kind = cJSON_GetStringValue(cJSON_GetObjectItem(p, "kind"));
        const int c0 = (int)number(p, "column0"), c1 = (int)number(p, "column1"), r0 = (int)number(p, "row0"),
                  r1 = (int)number(p, "row1");
        assert_true(0 <= c0 && c0 <= c1 && c1 < width && 0 <= r0 && r0 <= r1 && r1 < height);
        assert_true((int)number(p, "samples") == (c1 - c0 + 1) * (r1 - r0 + 1));
        const cJSON *ring =
            cJSON_GetArrayItem(cJSON_GetObjectItem(cJSON_GetObjectItem(feature, "geometry"), "coordinates"), 0);
        assert_true(cJSON_GetArraySize(ring) == 5);
        /* Samples are 10 units apart, the first one 5 inside its pixel. */
        const double west = cJSON_GetArrayItem(cJSON_GetArrayItem(ring, 0), 0)->valuedouble,
                     south = cJSON_GetArrayItem(cJSON_GetArrayItem(ring, 0), 1)->valuedouble;
        assert_true(fabs(west - (500000 + 10.0 * (left + c0))) < 1e-6);
        assert_true(fabs(south - (4000000 - 10.0 * (top + r1 + 1))) < 1e-6);
        if (!strcmp(kind, "gap")) {
            assert_true(cJSON_IsTrue(cJSON_GetObjectItem(p, "inside")) == !outside[r0][c0]);
            for (int y = r0; y <= r1; y++)
                for (int x = c0; x <= c1; x++)
                    if (covered[y][x]++) fail_msg("gap at %d, %d: covered, or told twice", x, y);
        } else if (!strcmp(kind, "overlap")) {
            const int a = index_of(p, "source_a"), b = index_of(p, "source_b");
            assert_true(a < b && !overlaps[a][b]);
            overlaps[a][b] = 1;
            assert_true(c0 == (int)fmax(tiles[a].x, tiles[b].x) - left);
            assert_true(r0 == (int)fmax(tiles[a].y, tiles[b].y) - top);
            assert_true(c1 == (int)fmin(tiles[a].x + tiles[a].width, tiles[b].x + tiles[b].width) - 1 - left);
            assert_true(r1 == (int)fmin(tiles[a].y + tiles[a].height, tiles[b].y + tiles[b].height) - 1 - top);
            assert_true(c1 > c0 && r1 > r0);
        } else {
            assert_string_equal(kind, "conflict");
            const int a = index_of(p, "source_a"), b = index_of(p, "source_b");
            pair *q = &pairs[a][b];
            assert_int_equal((int)number(p, "differ"), q->differ);
            assert_true(number(p, "largest") == q->largest);
            assert_int_equal((int)number(p, "worst_column"), q->worst_x);
            assert_int_equal((int)number(p, "worst_row"), q->worst_y);
            assert_int_equal((int)number(p, "first_column"), q->first_x);
            assert_int_equal((int)number(p, "first_row"), q->first_y);
            q->differ = 0;
        }
    }
    cJSON_Delete(json);
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++)
            if (!covered[y][x]) fail_msg("the gap at %d, %d is not told", x, y);
    for (int a = 0; a < count; a++)
        for (int b = a + 1; b < count; b++) {
            if (pairs[a][b].differ) fail_msg("tiles %d and %d differ: not told", a, b);
            const double w = fmin(tiles[a].x + tiles[a].width, tiles[b].x + tiles[b].width) -
                             fmax(tiles[a].x, tiles[b].x),
                         h = fmin(tiles[a].y + tiles[a].height, tiles[b].y + tiles[b].height) -
                             fmax(tiles[a].y, tiles[b].y);
            if ((w > 1 && h > 1) != (overlaps[a][b] == 1)) fail_msg("overlap of %d and %d", a, b);
        }
}

static void gaps_overlaps_and_conflicts_are_those_of_every_sample(void **unused) {
    (void)unused;
    const int seed = getenv("RQT_SEED") ? atoi(getenv("RQT_SEED")) : 1;
    print_message("RQT_SEED=%d\n", seed);
    state = (uint32_t)seed + 77;
    for (int turn = 0; turn < 25; turn++) {
        begin(NULL);
        int left = SIDE, top = SIDE, right = 0, bottom = 0;
        const int n = 2 + (int)(uniform() * 8);
        for (int i = 0; i < n; i++) {
            const int w = 2 + (int)(uniform() * 20), h = 2 + (int)(uniform() * 20);
            tile *t = add_tile("", (int)(uniform() * (SIDE - w)), (int)(uniform() * (SIDE - h)), w, h);
            for (int s = 0; s < w * h; s++) {
                if (uniform() < 0.05) t->values[s] += rint(uniform() * 9 - 4);
                if (uniform() < 0.05) t->values[s] = NAN;
            }
            left = t->x < left ? t->x : left;
            top = t->y < top ? t->y : top;
            right = t->x + w > right ? t->x + w : right;
            bottom = t->y + h > bottom ? t->y + h : bottom;
        }
        write_tiles();
        import_options o = defaults();
        const char *faults = file("faults.geojson");
        o.report = faults;
        import_force force = two_readings;
        force.strip_rows = 1 + turn % 7;
        forced_fine(paths, count, file("a.gpkg"), &o, turn % 3 ? &force : NULL);
        expect_findings(faults, left, top, right - left, bottom - top);
        forget_tiles();
    }
}

/* A bay of two rectangles: the northern one does not reach the edge, and is not inside all the same. */
static void a_hole_that_opens_to_the_edge_is_not_inside(void **unused) {
    (void)unused;
    static const int parts[][4] = {{0, 0, 20, 5}, {0, 0, 5, 20}, {15, 0, 5, 20}, {5, 15, 4, 5}};
    for (size_t i = 0; i < LENGTH(parts); i++) add_tile("", parts[i][0], parts[i][1], parts[i][2], parts[i][3]);
    write_tiles();
    import_options o = defaults();
    const char *faults = file("faults.geojson");
    o.report = faults;
    forced_fine(paths, count, file("a.gpkg"), &o, NULL);
    expect_findings(faults, 0, 0, 20, 20);
    says(notices, "no source covers 130 samples at the edge of the terrain (2 rectangles)");
}

static void the_worst_are_told_in_sentences(void **unused) {
    (void)unused;
    import_options o = defaults();
    const int step = 8;
    for (int j = 0; j < 5; j++)
        for (int i = 0; i < 5; i++)
            if (!((i == 2 && j == 2) || (i == 4 && j == 0))) {
                tile *t = add_tile("", i * step, j * step, 9, 9);
                if (i == 1 && j == 3)
                    for (int s = 0; s < 81; s++) t->values[s] += 2;
                if (i == 1 && j == 3) t->values[8] += 3; /* (16, 24): 5 m, but where four tiles meet */
            }
    add_tile("", 27, 27, 9, 9);
    write_tiles();
    o.report = file("faults.geojson");
    assert_int_equal(import_many(paths, count, file("a.gpkg"), &o), 0);
    says(notices,
         "a gap inside the terrain: no source covers columns 17 to 23, rows 17 to 23 (x 500175 to 500235, y "
         "3999765 to 3999825)");
    says(notices, "no source covers 64 samples at the edge of the terrain (1 rectangle): voids");
    says(notices, "overlap by 6 x 6 samples, from (500275, 3999725)");
    says(notices, "of the 9 samples that they share, most by");
    says(notices, "; and 1 more");
    o.replace = true;
    o.report = tiles[3].path;
    assert_int_equal(import_many(paths, count, file("a.gpkg"), &o), 1);
    says(message, "is the database or a source, and cannot be the report too");
    o.report = file("a.gpkg");
    assert_int_equal(import_many(paths, count, file("a.gpkg"), &o), 1);
    says(message, "is the database or a source, and cannot be the report too");
    /* A report that cannot be written is a failure that changes nothing. */
    o.report = file("nowhere/faults.geojson");
    char *before = dump(file("a.gpkg"), "SELECT * FROM rqt_terrain");
    assert_int_equal(import_many(paths, count, file("a.gpkg"), &o), 1);
    says(message, "nowhere/faults.geojson cannot be written: No such file");
    char *after = dump(file("a.gpkg"), "SELECT * FROM rqt_terrain");
    assert_string_equal(before, after);
    sqlite3_free(before);
    sqlite3_free(after);
    forget_tiles();
}

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(name) cmocka_unit_test_setup(name, begin_tiles)
        TEST(thousands_of_tiles_need_few_descriptors),
        TEST(tiles_that_abut_are_tiles_that_share),
        TEST(F44_the_order_of_sources_changes_no_byte),
        TEST(folders_and_lists_give_their_rasters),
        TEST(gaps_overlaps_and_conflicts_are_those_of_every_sample),
        TEST(a_hole_that_opens_to_the_edge_is_not_inside),
        TEST(the_worst_are_told_in_sentences),
    };
    alarm(600); /* threads that wait for each other for ever are a failure too */
    return cmocka_run_group_tests(tests, begin_all, end_all);
}
