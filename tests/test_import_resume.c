/* test_import_resume.c - promises of the resume file: after a kill at any moment nothing that was read is read
 * again, what has changed is, and no file, however damaged or hostile, makes another terrain than reading
 * everything does. */
#define _GNU_SOURCE /* memmem */
#include "test_import_tiles.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include "spool.h"
#include <zstd.h>

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

/* Frames that are sound, of strips that lie: more planes than a value has bytes, voids or values that are not
 * there, bytes that belong to nothing, an infinite height. */
static void F42_a_strip_that_lies_about_itself_is_refused(void **unused) {
    (void)unused;
    const import_options o = defaults();
    const import_job job = {&o, "x", message, sizeof message};
    enum { WIDTH = 10, ROWS = 4, N = WIDTH * ROWS };
    static const struct {
        uint8_t planes, voids;
        size_t bytes; /* behind the first eight */
        bool fine;
    } cases[] = {{2, 0, 2 * N, true},
                 {2, 1, 3 * N, true},
                 {0, 0, 0, true},
                 {5, 0, 5 * N, false},
                 {200, 0, 4 * N, false},
                 {1, 1, N, false},
                 {2, 0, 2 * N - 1, false},
                 {0, 0, 5, false},
                 {4, 0, 4 * N, false /* 0x7F.. twice makes an infinity */}};
    spool_codec *codec;
    assert_true(spool_codec_create(&job, IMPORT_F32, WIDTH, ROWS, &codec));
    for (size_t i = 0; i < LENGTH(cases); i++) {
        uint8_t plain[8 + 5 * N] = {cases[i].planes, cases[i].voids}, valid[N];
        float values[N];
        import_strip strip = {IMPORT_F32, WIDTH, 0, ROWS, values, valid};
        if (i + 1 == LENGTH(cases)) { /* the first value is 0xFF000000 / 2 = 0x7F800000, zigzag of an even number */
            plain[8 + 3 * N] = 0xFF;
        }
        const size_t size = 8 + cases[i].bytes;
        uint8_t packed[1000];
        const size_t n = ZSTD_compress(packed, sizeof packed, plain, size, 1);
        assert_false(ZSTD_isError(n));
        memcpy(spool_packed_room(codec, n), packed, n);
        if (spool_decode(codec, n, size, &strip, NULL, 0) != cases[i].fine) fail_msg("case %zu", i);
    }
    spool_codec_free(codec);
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

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(name) cmocka_unit_test_setup(name, begin_tiles)
        TEST(F49_after_a_kill_no_sample_is_read_twice),
        TEST(what_has_changed_is_read_again),
        TEST(conflicts_of_the_first_part_are_not_lost),
        TEST(F42_a_damaged_resume_file_changes_no_byte),
        TEST(F42_packed_strips_of_any_bytes_are_refused),
        TEST(F42_a_strip_that_lies_about_itself_is_refused),
        TEST(two_imports_do_not_share_a_resume_file),
        TEST(F50_a_full_disk_stops_the_resume_file_with_a_sentence),
        TEST(a_vrt_of_tiles_is_one_source),
    };
    alarm(600); /* threads that wait for each other for ever are a failure too */
    return cmocka_run_group_tests(tests, begin_all, end_all);
}
