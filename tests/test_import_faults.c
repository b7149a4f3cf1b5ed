/* test_import_faults.c - promises of the import when something is in the way: what cannot be imported is refused
 * with a sentence that leaves everything as it was; a database that is locked, read-only or no database, a full
 * disk, a stop and a kill leave no terrain that looks whole; an existing terrain is replaced only when asked; and
 * the number of jobs does not change a byte. */
#include "test_import_support.h"

#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>

/* -------------------------------------------------------------------------------------------- refusals -- */
static void F13_infinity_is_refused_and_not_a_number_is_void(void **unused) {
    (void)unused;
    double values[8 * 8];
    fill(values, 8, 8, 1);
    values[3 * 8 + 5] = -INFINITY;
    raster r = {.name = "a.tif", .width = 8, .height = 8, .type = GDT_Float32};
    import_options o = defaults();
    import_refused(write_raster(&r, values), file("a.gpkg"), &o, "column 5, row 3 is infinite");
    assert_false(exists(file("a.gpkg")));
    values[3 * 8 + 5] = NAN; /* declared or not: a void, and counted */
    for (int declared = 0; declared < 2; declared++) {
        r.nodata = declared ? "nan" : NULL;
        VSIUnlink(file("a.gpkg"));
        import_fine(write_raster(&r, values), file("a.gpkg"), &o);
        assert_int_equal(report.voids, 1);
        expect_file_metres(file("a.gpkg"), values);
    }
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
    o.name = "..";
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

static void F44_jobs_do_not_change_a_byte(void **unused) {
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

static void F50_databases_that_cannot_be_written_get_a_sentence(void **unused) {
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

static void F50_a_full_disk_leaves_nothing(void **unused) {
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

static void F49_a_killed_import_leaves_no_terrain_that_looks_whole(void **unused) {
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
        TEST(F13_infinity_is_refused_and_not_a_number_is_void),
        TEST(sources_of_unlike_grids_are_refused),
        TEST(bad_sources_get_a_sentence),
        TEST(bad_options_get_a_sentence),
        TEST(F44_jobs_do_not_change_a_byte),
        TEST(an_existing_terrain_stays_unless_it_is_to_be_replaced),
        TEST(a_new_file_is_a_geopackage_and_an_old_one_stays_what_it_is),
        TEST(F50_databases_that_cannot_be_written_get_a_sentence),
        TEST(F50_a_full_disk_leaves_nothing),
        TEST(a_stopped_import_leaves_the_database_as_it_was),
        TEST(F49_a_killed_import_leaves_no_terrain_that_looks_whole),
    };
    alarm(300); /* threads that wait for each other for ever are a failure too */
    return cmocka_run_group_tests(tests, begin_all, end_all);
}
