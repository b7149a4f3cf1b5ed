/* test_import_national.c - promises of imports of many tiles: thousands of sources in few descriptors, any order of
 * them, folders and lists, gaps and overlaps and conflicts told exactly (against a slow look at every sample), and
 * resuming: after a kill at any moment nothing that was read is read again, and no resume file, however damaged or
 * hostile, makes another terrain than reading everything does. What is filled is in test_import_fill.c. */
#define _GNU_SOURCE /* memmem */
#include "test_import_support.h"

#include <cjson/cJSON.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include "parts.h"
#include "spool.h"

/* ------------------------------------------------------------------------------------------------- tiles -- */
typedef struct tile {
    char path[300];
    int x, y, width, height;
    double *values; /* NaN: void */
} tile;

static tile tiles[2600];
static int count, epsg = 32633;
static const char *paths[2600];

static double hill(int x, int y) {
    return rint(300 + 90 * sin(x * 0.21) * cos(y * 0.17) + 31 * sin(x * 0.043 + y * 0.031) + (x * 7 + y * 13) % 5);
}

static void forget_tiles(void) {
    for (int i = 0; i < count; i++) free(tiles[i].values);
    count = 0;
}

/* A tile of hills; its file is written by write_tile. */
static tile *add_tile(const char *folder_name, int x, int y, int width, int height) {
    tile *t = &tiles[count];
    *t = (tile){.x = x, .y = y, .width = width, .height = height};
    snprintf(t->path, sizeof t->path, "%s/%st%04d.tif", folder, folder_name, count);
    t->values = malloc(sizeof(double) * (size_t)(width * height));
    for (int v = 0; v < height; v++)
        for (int u = 0; u < width; u++) t->values[v * width + u] = hill(x + u, y + v);
    paths[count++] = t->path;
    return t;
}

static void write_tile(const tile *t) {
    const double place[6] = {500000 + 10.0 * t->x, 10, 0, 4000000 - 10.0 * t->y, 0, -10};
    const size_t n = (size_t)t->width * (size_t)t->height;
    double *values = malloc(sizeof(double) * n);
    for (size_t i = 0; i < n; i++) values[i] = isnan(t->values[i]) ? -9999 : t->values[i];
    raster r = {.name = t->path + strlen(folder) + 1,
                .width = t->width,
                .height = t->height,
                .type = GDT_Int16,
                .nodata = "-9999",
                .epsg = epsg,
                .place = place};
    write_raster(&r, values);
    free(values);
}

static void write_tiles(void) {
    for (int i = 0; i < count; i++) write_tile(&tiles[i]);
}

static int64_t samples_of_tiles(void) {
    int64_t n = 0;
    for (int i = 0; i < count; i++) n += (int64_t)tiles[i].width * tiles[i].height;
    return n;
}

/* across x down tiles of side samples; neighbours share their border, or abut. */
static void make_grid(const char *folder_name, int across, int down, int side, bool shared) {
    const int step = shared ? side - 1 : side;
    for (int j = 0; j < down; j++)
        for (int i = 0; i < across; i++) add_tile(folder_name, i * step, j * step, side, side);
    write_tiles();
}

static import_report national;
static import_conflicts none;

static int import_forced(const char *const *sources, int n, const char *database, const import_options *o,
                         const import_force *force) {
    notices[0] = 0;
    return import_run_forced(sources, n, database, o, force, &national, message, sizeof message);
}

static void forced_fine(const char *const *sources, int n, const char *database, const import_options *o,
                        const import_force *force) {
    if (import_forced(sources, n, database, o, force)) fail_msg("%s", message);
}

static void says(const char *where, const char *phrase) {
    if (!strstr(where, phrase)) fail_msg("'%s' does not say '%s'", where, phrase);
}

static const char *spool_of(const char *database, const char *name) {
    static char path[400];
    snprintf(path, sizeof path, "%s.%s.rqt-import", database, name);
    return path;
}

static void expect_all_equal(const char *a, const char *b) {
    static const char *const queries[] = {"SELECT format, complete, width, height, k, x0, y0, dx, dy, z0, d, cell, "
                                          "voids, min_q, max_q, blocks, bytes, "
                                          "max_error FROM rqt_terrain"};
    expect_same_tables(a, b);
    for (size_t i = 0; i < LENGTH(queries); i++) {
        char *left = dump(a, queries[i]), *right = dump(b, queries[i]);
        if (strcmp(left, right)) fail_msg("%s differs:\n%s%s", queries[i], left, right);
        sqlite3_free(left);
        sqlite3_free(right);
    }
}

static const import_force two_readings = {.two_readings = true, .strip_rows = 5, .stage = -1, .kept = -1};

/* -------------------------------------------------------------------------------------------- many tiles -- */
static void expect_hills(const char *database, int width, int height) {
    double *wanted = malloc(sizeof(double) * (size_t)(width * height));
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) wanted[y * width + x] = hill(x, y);
    expect_file_metres(database, wanted);
    free(wanted);
}

static void thousands_of_tiles_need_few_descriptors(void **unused) {
    (void)unused;
    assert_int_equal(mkdir(file("many"), 0777), 0);
    epsg = -1; /* a CRS in each of them is most of what it takes to write and open them */
    make_grid("many/", 50, 50, 17, true);
    epsg = 32633;
    struct rlimit before, few;
    getrlimit(RLIMIT_NOFILE, &before);
    few = before;
    few.rlim_cur = 64;
    setrlimit(RLIMIT_NOFILE, &few);
    import_options o = defaults();
    const char *source = file("many");
    const import_force wide = {.two_readings = true, .stage = -1, .kept = -1};
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
static cJSON *read_json(const char *path) {
    FILE *f = fopen(path, "rb");
    assert_non_null(f);
    static char text[1 << 20];
    text[fread(text, 1, sizeof text - 1, f)] = 0;
    fclose(f);
    cJSON *json = cJSON_Parse(text);
    if (!json) fail_msg("no JSON: %.300s", text);
    return json;
}

static double number(const cJSON *o, const char *key) {
    const cJSON *n = cJSON_GetObjectItem(o, key);
    if (!cJSON_IsNumber(n)) fail_msg("%s is missing", key);
    return n->valuedouble;
}

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
    /* A report that cannot be written is a failure that changes nothing. */
    o.report = file("nowhere/faults.geojson");
    o.replace = true;
    char *before = dump(file("a.gpkg"), "SELECT * FROM rqt_terrain");
    assert_int_equal(import_many(paths, count, file("a.gpkg"), &o), 1);
    says(message, "nowhere/faults.geojson cannot be written: No such file");
    char *after = dump(file("a.gpkg"), "SELECT * FROM rqt_terrain");
    assert_string_equal(before, after);
    sqlite3_free(before);
    sqlite3_free(after);
    forget_tiles();
}

/* -------------------------------------------------------------------------------------------------- resuming -- */
typedef struct killer {
    const char *stage;
    int calls, seen;
} killer;

static bool die_at(void *context, const char *stage, double done, int64_t samples) {
    killer *k = context;
    (void)done;
    (void)samples;
    if (!strcmp(stage, k->stage) && ++k->seen == k->calls) raise(SIGKILL);
    return true;
}

/* An import in a process of its own that dies as by kill -9 at the n-th call of a stage. */
static void killed_import(const char *database, const import_options *o, const import_force *force,
                          const char *stage, int calls) {
    const pid_t child = fork();
    if (child == 0) {
        killer k = {.stage = stage, .calls = calls};
        import_options with = *o;
        with.progress = die_at;
        with.context = &k;
        with.notice = NULL;
        import_forced(paths, count, database, &with, force);
        _exit(0);
    }
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFSIGNALED(status));
}

/* The tiles' files keep size and time, but hold something else: whoever reads them now is found out. */
static void spoil(const tile *t) {
    struct stat before;
    assert_int_equal(stat(t->path, &before), 0);
    FILE *f = fopen(t->path, "r+b");
    const size_t size = (size_t)t->width * (size_t)t->height * 2;
    fseek(f, (long)before.st_size - (long)size, SEEK_SET);
    char *bytes = malloc(size);
    fseek(f, 0, SEEK_SET);
    /* GTiff: the pixels are one contiguous piece somewhere; the header is far smaller. */
    char *whole = malloc((size_t)before.st_size);
    assert_int_equal(fread(whole, 1, (size_t)before.st_size, f), (size_t)before.st_size);
    int16_t first[3] = {(int16_t)t->values[0], (int16_t)t->values[1], (int16_t)t->values[2]};
    char *at = memmem(whole, (size_t)before.st_size, first, sizeof first);
    assert_non_null(at);
    memset(bytes, 1, size);
    fseek(f, (long)(at - whole), SEEK_SET);
    fwrite(bytes, 1, size, f);
    fclose(f);
    free(bytes);
    free(whole);
    const struct timespec times[2] = {before.st_atim, before.st_mtim};
    assert_int_equal(utimensat(AT_FDCWD, t->path, times, 0), 0);
}

static void F49_after_a_kill_no_sample_is_read_twice(void **unused) {
    (void)unused;
    static const struct {
        const char *stage;
        int calls;
    } moments[] = {{"reading", 2}, {"reading", 4}, {"reading", 6}, {"reading", 8},
                   {"errors", 1},  {"errors", 3},  {"blocks", 2}};
    import_options o = defaults();
    o.name = "a";
    o.k = 2;
    o.jobs = 2;
    make_grid("", 3, 5, 9, true);
    forced_fine(paths, count, file("whole.gpkg"), &o, NULL);
    const int64_t all = samples_of_tiles();
    assert_int_equal(national.samples_read, all);
    /* Rows 0..40 in strips of 5. */
    import_force force = two_readings;
    force.strips = 2;
    force.b = 3;
    for (size_t i = 0; i < LENGTH(moments); i++) {
        const char *database = file("a.gpkg");
        VSIUnlink(database);
        write_tiles();
        killed_import(database, &o, &force, moments[i].stage, moments[i].calls);
        assert_true(exists(spool_of(database, "a")));
        if (exists(database)) {
            char *tables = dump(database, "SELECT count(*) FROM sqlite_schema");
            assert_string_equal(tables, "30 \n");
            sqlite3_free(tables);
        }
        /* The call after strip n - 1 kills; then that strip, and perhaps those read ahead, are in the file. */
        const int rows = !strcmp(moments[i].stage, "reading") ? 5 * (moments[i].calls - 1) : 41;
        for (int t = 0; t < count; t++)
            if (tiles[t].y + 9 <= rows) spoil(&tiles[t]);
        forced_fine(paths, count, database, &o, &force);
        assert_true(national.samples_resumed >= (rows < 41 ? 27 * rows : all));
        assert_int_equal(national.samples_read + national.samples_resumed, all);
        if (rows == 41) assert_int_equal(national.samples_read, 0);
        expect_all_equal(file("whole.gpkg"), database);
        assert_false(exists(spool_of(database, "a")));
    }
    forget_tiles();
}

static bool stop_at(void *context, const char *stage, double done, int64_t samples) {
    killer *k = context;
    (void)done;
    (void)samples;
    return strcmp(stage, k->stage) || ++k->seen < k->calls;
}

static void stopped_import(const char *database, const import_options *o, const import_force *force, int calls) {
    killer k = {.stage = "reading", .calls = calls};
    import_options with = *o;
    with.progress = stop_at;
    with.context = &k;
    assert_int_equal(import_forced(paths, count, database, &with, force), 1);
}

static void what_has_changed_is_read_again(void **unused) {
    (void)unused;
    import_options o = defaults();
    o.name = "a";
    make_grid("", 3, 5, 9, true);
    const char *database = file("a.gpkg");
    stopped_import(database, &o, &two_readings, 7);
    says(message, "stopped while reading; the database is as it was; what was read is in ");
    says(message, "a.gpkg.a.rqt-import: the same command goes on from there");
    assert_false(exists(database));
    /* A tile of rows 16 to 24, which is in the file: strips 0 to 2 (rows 0 to 14) can be used. */
    for (int s = 0; s < 81; s++) tiles[7].values[s] += 1;
    VSIUnlink(tiles[7].path);
    write_tile(&tiles[7]);
    const struct timespec later[2] = {{.tv_sec = 2000000000}, {.tv_sec = 2000000000}};
    utimensat(AT_FDCWD, tiles[7].path, later, 0);
    forced_fine(paths, count, database, &o, &two_readings);
    says(notices, "is of a source that has changed");
    says(notices, "the first 3 are used");
    assert_int_equal(national.samples_read + national.samples_resumed, samples_of_tiles());
    assert_int_equal(national.samples_resumed, 27 * 15 + 27 * 1);
    forced_fine(paths, count, file("whole.gpkg"), &o, NULL);
    expect_all_equal(file("whole.gpkg"), database);
    /* Another --nodata, other sources, another grid: anew. */
    for (int way = 0; way < 3; way++) {
        VSIUnlink(database);
        stopped_import(database, &o, &two_readings, 7);
        import_options other = o;
        import_force force = two_readings;
        const int sources = way == 1 ? count - 3 : count;
        if (way == 0) other.has_nodata = true, other.nodata = 300;
        if (way == 2) force.strip_rows = 4;
        forced_fine(paths, sources, database, &other, &force);
        says(notices, "reading begins anew");
        says(notices, way == 0 ? "another --nodata" : way == 1 ? "is of other sources" : "another grid");
        assert_int_equal(national.samples_resumed, 0);
        VSIUnlink(file("whole.gpkg"));
        forced_fine(paths, sources, file("whole.gpkg"), &other, NULL);
        expect_all_equal(file("whole.gpkg"), database);
    }
    /* What fits in memory now goes on all the same. */
    VSIUnlink(database);
    stopped_import(database, &o, &two_readings, 7);
    const import_force in_memory = {.in_memory = true, .strip_rows = 5, .stage = -1, .kept = -1};
    forced_fine(paths, count, database, &o, &in_memory);
    assert_true(national.samples_resumed > 0 && national.samples_read > 0);
    assert_false(exists(spool_of(database, "a")));
    forget_tiles();
}

static void conflicts_of_the_first_part_are_not_lost(void **unused) {
    (void)unused;
    import_options o = defaults();
    o.name = "a";
    make_grid("", 3, 5, 9, true);
    for (int t = 0; t < count; t += 4) {
        for (int s = 0; s < 81; s++) tiles[t].values[s] += 3;
        write_tile(&tiles[t]);
    }
    o.report = file("whole.geojson");
    forced_fine(paths, count, file("whole.gpkg"), &o, NULL);
    o.report = file("parts.geojson");
    stopped_import(file("a.gpkg"), &o, &two_readings, 5);
    forced_fine(paths, count, file("a.gpkg"), &o, &two_readings);
    assert_true(national.samples_resumed > 0);
    cJSON *whole = read_json(file("whole.geojson")), *parts = read_json(file("parts.geojson"));
    assert_true(cJSON_GetArraySize(cJSON_GetObjectItem(whole, "features")) > 4);
    assert_true(
        cJSON_Compare(cJSON_GetObjectItem(whole, "features"), cJSON_GetObjectItem(parts, "features"), true));
    assert_true(number(cJSON_GetObjectItem(parts, "import"), "samples_resumed") ==
                (double)national.samples_resumed);
    cJSON_Delete(whole);
    cJSON_Delete(parts);
    forget_tiles();
}

/* --------------------------------------------------------------------------------------------- hostile files -- */
static uint8_t *read_bytes(const char *path, size_t *size) {
    FILE *f = fopen(path, "rb");
    assert_non_null(f);
    uint8_t *bytes = malloc(1 << 20);
    *size = fread(bytes, 1, 1 << 20, f);
    fclose(f);
    return bytes;
}

static void write_bytes(const char *path, const uint8_t *bytes, size_t size) {
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    fwrite(bytes, 1, size, f);
    fclose(f);
}

static void F42_a_damaged_resume_file_changes_no_byte(void **unused) {
    (void)unused;
    const int seed = getenv("RQT_SEED") ? atoi(getenv("RQT_SEED")) : 1;
    print_message("RQT_SEED=%d\n", seed);
    state = (uint32_t)seed + 5;
    import_options o = defaults();
    o.name = "a";
    make_grid("", 2, 3, 9, true);
    for (int s = 0; s < 81; s += 5) tiles[3].values[s] = NAN;
    for (int s = 0; s < 81; s++) tiles[1].values[s] += 1;
    write_tile(&tiles[3]);
    write_tile(&tiles[1]);
    char database[300], path[400]; /* file() remembers 64 names */
    snprintf(database, sizeof database, "%s", file("a.gpkg"));
    forced_fine(paths, count, file("whole.gpkg"), &o, NULL);
    stopped_import(database, &o, &two_readings, 5);
    snprintf(path, sizeof path, "%s", spool_of(database, "a"));
    size_t size;
    uint8_t *sound = read_bytes(path, &size);
    uint8_t *bytes = malloc(size + 100);
    int resumed = 0;
    for (int turn = 0; turn < 80; turn++) {
        size_t n = size;
        memcpy(bytes, sound, size);
        if (turn % 4 == 0) { /* cut, with or without something behind */
            n = 8 + (size_t)(uniform() * (double)(size - 8));
            if (turn % 8 == 0)
                for (int i = 0; i < 40; i++) bytes[n++] = (uint8_t)(uniform() * 256);
        } else if (turn % 4 == 1) { /* one bit */
            bytes[8 + (size_t)(uniform() * (double)(size - 8))] ^= (uint8_t)(1 << (int)(uniform() * 8));
        } else if (turn % 4 == 2) { /* a length or a number that lies */
            const size_t at = 8 + ((size_t)(uniform() * (double)(size - 16)) & ~(size_t)3);
            memset(bytes + at, turn % 3 ? 0xFF : 0x7F, 4);
        } else { /* a piece twice */
            const size_t at = 8 + (size_t)(uniform() * (double)(size / 2 - 8));
            memmove(bytes + at + 16, bytes + at, size - at - 16);
        }
        write_bytes(path, bytes, n);
        VSIUnlink(database);
        forced_fine(paths, count, database, &o, &two_readings);
        resumed += national.samples_resumed > 0;
        expect_all_equal(file("whole.gpkg"), database);
        assert_false(exists(path));
    }
    assert_true(resumed > 10);
    /* What is not ours is not touched; nor is what is in use. */
    memcpy(bytes, sound, size);
    bytes[0] ^= 1;
    write_bytes(path, bytes, size);
    VSIUnlink(database);
    assert_int_equal(import_forced(paths, count, database, &o, &two_readings), 1);
    says(message, "is in the way: it is no resume file of an import");
    size_t left;
    uint8_t *after = read_bytes(path, &left);
    assert_true(left == size && !memcmp(after, bytes, size));
    free(after);
    free(bytes);
    free(sound);
    forget_tiles();
}

/* Records whose checksums are right, and whose contents are not: what spool_decode makes of any bytes. */
static void F42_packed_strips_of_any_bytes_are_refused(void **unused) {
    (void)unused;
    state = 9;
    const import_options o = defaults();
    const import_job job = {&o, "x", message, sizeof message};
    static const import_kind kinds[] = {IMPORT_I32, IMPORT_I64, IMPORT_F32, IMPORT_F64};
    for (size_t k = 0; k < LENGTH(kinds); k++) {
        const int width = 37, rows = 6, n = width * rows;
        const size_t element = import_kind_bytes(kinds[k]);
        uint8_t values[37 * 6 * 8], back[37 * 6 * 8], valid[37 * 6], there[37 * 6];
        spool_codec *codec;
        assert_true(spool_codec_create(&job, kinds[k], width, rows, &codec));
        for (int turn = 0; turn < 300; turn++) {
            const int have = turn % 5 ? rows : 1 + turn % rows;
            import_strip strip = {kinds[k], width, 0, have, values, valid},
                         out = {kinds[k], width, 0, have, back, there};
            for (size_t i = 0; i < (size_t)n * element; i++)
                values[i] = (uint8_t)(turn % 3 ? uniform() * 256 : turn % 2 ? 255 : 0);
            for (int i = 0; i < n; i++) {
                valid[i] = turn % 4 ? uniform() < 0.8 : 1;
                if (kinds[k] == IMPORT_F32 && !isfinite(((float *)(void *)values)[i])) valid[i] = 0;
                if (kinds[k] == IMPORT_F64 && !isfinite(((double *)(void *)values)[i])) valid[i] = 0;
            }
            const char more[] = "what goes along";
            char along[sizeof more] = "";
            const spool_bytes b = spool_encode(codec, &strip, more, sizeof more);
            assert_non_null(b.packed);
            uint8_t *packed = malloc(b.size);
            memcpy(packed, b.packed, b.size);
            memcpy(spool_packed_room(codec, b.size), packed, b.size);
            assert_true(spool_decode(codec, b.size, b.plain, &out, along, sizeof more));
            assert_string_equal(along, more);
            assert_memory_equal(valid, there, (size_t)(width * have));
            for (int i = 0; i < width * have; i++)
                if (valid[i])
                    assert_memory_equal(values + (size_t)i * element, back + (size_t)i * element, element);
            /* Cut, bent, or of another length: refused or the same, never read beyond. */
            const size_t cut = (size_t)(uniform() * (double)b.size);
            memcpy(spool_packed_room(codec, b.size), packed, b.size);
            assert_false(spool_decode(codec, cut, b.plain, &out, along, sizeof more));
            memcpy(spool_packed_room(codec, b.size), packed, b.size);
            assert_false(spool_decode(codec, b.size, b.plain + 1, &out, along, sizeof more));
            memcpy(spool_packed_room(codec, b.size), packed, b.size);
            spool_packed_room(codec, b.size)[cut] ^= 0x10;
            (void)spool_decode(codec, b.size, b.plain, &out, along, sizeof more);
            free(packed);
        }
        spool_codec_free(codec);
    }
}

static void two_imports_do_not_share_a_resume_file(void **unused) {
    (void)unused;
    import_options o = defaults();
    o.name = "a";
    make_grid("", 2, 2, 9, true);
    const char *database = file("a.gpkg");
    stopped_import(database, &o, &two_readings, 3);
    const import_job job = {&o, database, message, sizeof message};
    import_spool *held;
    const import_spool_grid grid = {IMPORT_I32, 17, 17, 5, 4, 0};
    const import_spool_key keys[4] = {{0}};
    char path[400];
    snprintf(path, sizeof path, "%s", spool_of(database, "a"));
    assert_true(import_spool_open(&job, path, &grid, keys, &held));
    assert_int_equal(import_forced(paths, count, database, &o, &two_readings), 1);
    says(message, "is in use: another import into");
    assert_true(exists(path));
    assert_false(import_spool_close(held, true)); /* it is empty */
    assert_false(exists(path));
    import_conflicts_free(&none);
    forget_tiles();
}

static void F50_a_full_disk_stops_the_resume_file_with_a_sentence(void **unused) {
    (void)unused;
    import_options o = defaults();
    o.name = "a";
    for (int j = 0; j < 4; j++) {
        tile *t = add_tile("", 0, j * 60, 60, 60);
        for (int s = 0; s < 3600; s++) t->values[s] = rint(uniform() * 30000);
    }
    write_tiles();
    const char *database = file("a.gpkg");
    struct rlimit before, small;
    getrlimit(RLIMIT_FSIZE, &before);
    small = before;
    small.rlim_cur = 20000;
    signal(SIGXFSZ, SIG_IGN);
    setrlimit(RLIMIT_FSIZE, &small);
    assert_int_equal(import_forced(paths, count, database, &o, &two_readings), 1);
    setrlimit(RLIMIT_FSIZE, &before);
    says(message, "a.gpkg.a.rqt-import cannot be written: the disk is full: ");
    says(message, "the same command goes on from there");
    assert_false(exists(database));
    forced_fine(paths, count, database, &o, &two_readings);
    assert_true(national.samples_resumed > 5000);
    assert_int_equal(national.samples_read + national.samples_resumed, samples_of_tiles());
    forced_fine(paths, count, file("whole.gpkg"), &o, NULL);
    expect_all_equal(file("whole.gpkg"), database);
    /* With no room for anything there is nothing left either. */
    VSIUnlink(database);
    small.rlim_cur = 100;
    setrlimit(RLIMIT_FSIZE, &small);
    assert_int_equal(import_forced(paths, count, database, &o, &two_readings), 1);
    setrlimit(RLIMIT_FSIZE, &before);
    says(message, "the disk is full");
    assert_false(exists(spool_of(database, "a")));
    forget_tiles();
}

/* A VRT is one source, but its tiles are its content. */
static void a_vrt_of_tiles_is_one_source(void **unused) {
    (void)unused;
    import_options o = defaults();
    o.name = "a";
    make_grid("", 3, 3, 9, true);
    FILE *f = fopen(file("all.vrt"), "w");
    fputs("<VRTDataset rasterXSize='25' rasterYSize='25'><GeoTransform>500000,10,0,4000000,0,-10</GeoTransform>"
          "<VRTRasterBand dataType='Int16' band='1'><NoDataValue>-9999</NoDataValue>\n",
          f);
    for (int i = 0; i < count; i++)
        fprintf(f,
                "<SimpleSource><SourceFilename relativeToVRT='1'>%s</SourceFilename><SourceBand>1</SourceBand>"
                "<SrcRect xOff='0' yOff='0' xSize='9' ySize='9'/><DstRect xOff='%d' yOff='%d' xSize='9' ySize='9'/>"
                "</SimpleSource>\n",
                strrchr(paths[i], '/') + 1, tiles[i].x, tiles[i].y);
    fputs("</VRTRasterBand></VRTDataset>\n", f);
    fclose(f);
    const char *vrt = file("all.vrt"), *database = file("a.gpkg");
    killer k = {.stage = "reading", .calls = 4};
    import_options with = o;
    with.progress = stop_at;
    with.context = &k;
    assert_int_equal(import_forced(&vrt, 1, database, &with, &two_readings), 1);
    forced_fine(&vrt, 1, database, &o, &two_readings);
    assert_true(national.samples_resumed > 0);
    assert_int_equal(national.samples_read + national.samples_resumed, 25 * 25);
    expect_hills(database, 25, 25);
    /* One of them changes: it is a part of the first source, so nothing is left. */
    VSIUnlink(database);
    k.seen = 0;
    assert_int_equal(import_forced(&vrt, 1, database, &with, &two_readings), 1);
    const struct timespec later[2] = {{.tv_sec = 2000000000}, {.tv_sec = 2000000000}};
    utimensat(AT_FDCWD, tiles[8].path, later, 0);
    forced_fine(&vrt, 1, database, &o, &two_readings);
    says(notices, "a source that has changed");
    assert_int_equal(national.samples_resumed, 0);
    expect_hills(database, 25, 25);
    forget_tiles();
}

static int begin_tiles(void **unused) {
    forget_tiles();
    return begin(unused);
}

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(name) cmocka_unit_test_setup(name, begin_tiles)
        TEST(thousands_of_tiles_need_few_descriptors),
        TEST(tiles_that_abut_are_tiles_that_share),
        TEST(F44_the_order_of_sources_changes_no_byte),
        TEST(folders_and_lists_give_their_rasters),
        TEST(gaps_overlaps_and_conflicts_are_those_of_every_sample),
        TEST(the_worst_are_told_in_sentences),
        TEST(F49_after_a_kill_no_sample_is_read_twice),
        TEST(what_has_changed_is_read_again),
        TEST(conflicts_of_the_first_part_are_not_lost),
        TEST(F42_a_damaged_resume_file_changes_no_byte),
        TEST(F42_packed_strips_of_any_bytes_are_refused),
        TEST(two_imports_do_not_share_a_resume_file),
        TEST(F50_a_full_disk_stops_the_resume_file_with_a_sentence),
        TEST(a_vrt_of_tiles_is_one_source),
    };
    alarm(600); /* threads that wait for each other for ever are a failure too */
    return cmocka_run_group_tests(tests, begin_all, end_all);
}
