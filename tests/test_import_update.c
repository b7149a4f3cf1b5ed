/* test_import_update.c - rqt update: the database is what an import of the changed raster writes, in every row and
 * BLOB; an update back restores the old ones; what cannot be put in is refused with a sentence, and then, or when
 * the update is stopped, killed or rolled back, everything is as it was. */
#include "test_import_support.h"

#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>

static import_update_report updated;

static int update_many(const char *const *sources, int count, const char *database, const import_options *o,
                       bool voids) {
    notices[0] = 0;
    return import_update(sources, count, database, o, voids, &updated, message, sizeof message);
}

static void update_fine(const char *source, const char *database, const import_options *o, bool voids) {
    if (update_many(&source, 1, database, o, voids)) fail_msg("%s", message);
    assert_string_equal(message, "");
}

static const char *const tables[] = {
    "SELECT id, summary, data FROM rqt_block_1 ORDER BY id",
    "SELECT * FROM rqt_index_1 ORDER BY id",
    "SELECT name, format, complete, width, height, k, x0, y0, dx, dy, z0, d, unit_numerator, unit_denominator, "
    "scale, "
    "height_offset, quantum_error, cell, void_tol, srid, lonlat, wgs84, crs, vertical, voids, min_q, max_q, "
    "blocks, bytes, "
    "max_error FROM rqt_terrain",
};

static bool are_same(const char *a, const char *b) {
    bool same = true;
    for (size_t i = 0; i < LENGTH(tables); i++) {
        char *left = dump(a, tables[i]), *right = dump(b, tables[i]);
        same = same && !strcmp(left, right);
        sqlite3_free(left);
        sqlite3_free(right);
    }
    return same;
}

static void expect_same(const char *a, const char *b, const char *what) {
    for (size_t i = 0; i < LENGTH(tables); i++) {
        char *left = dump(a, tables[i]), *right = dump(b, tables[i]);
        if (strcmp(left, right)) fail_msg("%s: %.40s ... differs", what, tables[i]);
        sqlite3_free(left);
        sqlite3_free(right);
    }
}

static void update_refused(const char *source, const char *database, const import_options *o, const char *phrase) {
    const char *before = file("before.gpkg");
    assert_int_equal(CPLCopyFile(before, database), 0);
    assert_int_equal(update_many(&source, 1, database, o, false), 1);
    if (!strstr(message, phrase)) fail_msg("'%s' does not say '%s'", message, phrase);
    expect_same(database, before, phrase);
}

static bool tell(void *context, const store_finding *finding) {
    (void)context;
    print_error("%s\n", finding->message);
    return true;
}

static bool count_finding(void *context, const store_finding *finding) {
    ++*(int *)context;
    return tell(NULL, finding);
}

static void expect_sound(const char *database) {
    terrain r = open_terrain(database, NULL);
    char *error = NULL;
    int findings = 0;
    assert_int_equal(store_check(r.store, r.t, count_finding, &findings, &error), SQLITE_OK);
    assert_int_equal(findings, 0);
    close_terrain(&r);
}

/* A window of a raster, as a file of its own on the same grid. */
static const char *write_window(const raster *whole, const char *name, int col, int row, int width, int height,
                                const double *values) {
    const double *g = whole->place ? whole->place : north_up;
    const double place[6] = {g[0] + col * g[1], g[1], 0, g[3] + row * g[5], 0, g[5]};
    raster part = *whole;
    part.name = name;
    part.width = width;
    part.height = height;
    part.place = place;
    double *own = malloc((size_t)(width * height) * sizeof *own);
    assert_non_null(own);
    for (int n = 0; n < width * height; n++) own[n] = values[(row + n / width) * whole->width + col + n % width];
    const char *path = write_raster(&part, own);
    free(own);
    return path;
}

static int below(int n) {
    return (int)(uniform() * n) % n;
}

/* Random rasters and windows, new heights and voids, against a database made anew; and back again. */
static void F22_a_database_equals_its_rebuild_and_goes_back(void **unused) {
    (void)unused;
    const GDALDataType types[] = {GDT_Int16, GDT_Int32, GDT_Float32, GDT_Float64};
    state = 7;
    for (int round = 0; round < 24; round++) {
        const int width = 1 + below(70), height = 1 + below(70), n = width * height, kind = round % 4;
        const double step = kind < 2 ? 1 : 0.1;
        raster r = {.name = "whole.tif", .width = width, .height = height, .type = types[kind], .nodata = "-9999"};
        import_options o = defaults();
        o.k = 1 + below(5);
        o.name = "t";
        o.replace = true;
        /* One step that only tenths hold, so that a rebuild has the same unit. */
        if (kind >= 2) o.quantum = 0.1;
        double *values = malloc((size_t)n * sizeof *values), *fresh = malloc((size_t)n * sizeof *fresh);
        assert_true(values && fresh);
        fill(values, width, height, step);
        for (int i = 0; i < n && round % 3; i++)
            if (below(20) == 0) values[i] = -9999;
        const char *whole = write_raster(&r, values), *database = file("t.gpkg"), *rebuilt = file("rebuilt.gpkg"),
                   *old = file("old.gpkg");
        import_fine(whole, database, &o);
        assert_int_equal(CPLCopyFile(old, database), 0);

        const int col = below(width), row = below(height), w = 1 + below(width - col), h = 1 + below(height - row);
        const bool voids = round % 2;
        const char *back = write_window(&r, "back.tif", col, row, w, h, values);
        memcpy(fresh, values, (size_t)n * sizeof *fresh);
        for (int y = row; y < row + h; y++)
            for (int x = col; x < col + w; x++)
                fresh[y * width + x] = below(9) == 0 ? -9999 : rint((200 + 400 * uniform()) / step) * step;
        const char *patch = write_window(&r, "patch.tif", col, row, w, h, fresh);
        for (int i = 0; i < n && !voids; i++)
            if (fresh[i] == -9999) fresh[i] = values[i];
        update_fine(patch, database, &o, voids);
        r.name = "changed.tif";
        const char *changed = write_raster(&r, fresh);
        import_fine(changed, rebuilt, &o);
        expect_same(database, rebuilt, "update and rebuild");
        expect_sound(database);
        update_fine(back, database, &o, true);
        expect_same(database, old, "update back and forth");
        free(values);
        free(fresh);
        unlink(database);
        unlink(rebuilt);
    }
}

static const raster small = {.name = "small.tif", .width = 40, .height = 30, .type = GDT_Int16};
static double heights[1200];

static const char *import_small(const char *database, const import_options *o) {
    fill(heights, 40, 30, 1);
    import_fine(write_raster(&small, heights), database, o);
    return database;
}

static const char *shifted_window(const char *name, double dx, double dy, GDALDataType type, int epsg, double add) {
    const double place[6] = {500000 + dx, 10, 0, 4000000 - dy, 0, -10};
    const raster r = {.name = name, .width = 5, .height = 4, .type = type, .place = place, .epsg = epsg};
    double values[20];
    for (int i = 0; i < 20; i++) values[i] = 300 + i + add;
    return write_raster(&r, values);
}

static void what_does_not_fit_is_refused_with_a_sentence(void **unused) {
    (void)unused;
    import_options o = defaults();
    o.name = "t";
    const char *database = import_small(file("t.gpkg"), &o);
    update_refused(shifted_window("far.tif", 4000, 0, GDT_Int16, 0, 0), database, &o, "lies outside terrain t");
    update_refused(shifted_window("off.tif", 33, 0, GDT_Int16, 0, 0), database, &o, "no whole number");
    update_refused(shifted_window("crs.tif", 0, 0, GDT_Int16, 32632, 0), database, &o, "has the CRS");
    update_refused(shifted_window("nocrs.tif", 0, 0, GDT_Int16, -1, 0), database, &o, "has the CRS none");
    update_refused(shifted_window("half.tif", 50, 50, GDT_Float32, 0, 0.5), database, &o,
                   "the height at column 0, row 0 is 300.5 m, which is no whole number of steps of 1 m");
    update_refused(shifted_window("deep.tif", 50, 50, GDT_Float64, 0, 2e9), database, &o,
                   "too far from the others");
    update_refused(file("none.tif"), database, &o, "none.tif");
    const double coarse[6] = {500000, 20, 0, 4000000, 0, -20};
    const raster r = {.name = "coarse.tif", .width = 5, .height = 4, .type = GDT_Int16, .place = coarse};
    update_refused(write_raster(&r, heights), database, &o, "has cells of 20");
    const raster loose = {.name = "loose.tif", .width = 5, .height = 4, .type = GDT_Int16, .no_place = true};
    update_refused(write_raster(&loose, heights), database, &o, "no geotransform");
    const char *patch = shifted_window("fits.tif", 50, 50, GDT_Int16, 0, 0);
    o.name = "other";
    update_refused(patch, database, &o, "there is no terrain other; there is t");
    o.name = NULL;
    assert_int_equal(update_many(&patch, 1, file("nowhere.gpkg"), &o, false), 1);
    assert_non_null(strstr(message, "No such file"));
    assert_false(exists(file("nowhere.gpkg")));
    assert_int_equal(update_many(&patch, 1, file("fits.tif"), &o, false), 1);
    assert_non_null(strstr(message, "not an SQLite database"));
    o.unit = "furlong";
    update_refused(patch, database, &o, "the unit 'furlong'");
    o.unit = NULL;
    assert_int_equal(update_many(NULL, 0, database, &o, false), 1);
    assert_string_equal(message, "no source to update from");
    update_fine(patch, database, &o, false);
    assert_int_equal(updated.samples, 20);
}

static void what_lies_outside_is_left_out_and_told(void **unused) {
    (void)unused;
    import_options o = defaults();
    const char *database = import_small(file("t.gpkg"), &o);
    /* Columns -2 .. 2 and rows 28 .. 31 of a terrain of 30 rows: 3 * 2 samples of 20. */
    update_fine(shifted_window("over.tif", -20, 280, GDT_Int16, 0, 1000), database, &o, false);
    assert_int_equal(updated.samples, 6);
    assert_int_equal(updated.left_out, 14);
    assert_non_null(strstr(notices, "14 of its samples lie outside"));
    for (int i = 0; i < 20; i++) {
        const int x = i % 5 - 2, y = 28 + i / 5;
        if (x >= 0 && y < 30) heights[y * 40 + x] = 1300 + i;
    }
    expect_file_metres(database, heights);
    expect_sound(database);
}

static void a_later_source_wins_and_provenance_says_what_was_put_in(void **unused) {
    (void)unused;
    import_options o = defaults();
    const char *database = import_small(file("t.gpkg"), &o);
    char *created = dump(database, "SELECT created FROM rqt_terrain");
    const char *const sources[] = {shifted_window("one.tif", 0, 0, GDT_Int16, 0, 0),
                                   shifted_window("two.tif", 20, 20, GDT_Int32, 0, 100)};
    assert_int_equal(update_many(sources, 2, database, &o, false), 0);
    for (int i = 0; i < 20; i++) heights[i / 5 * 40 + i % 5] = 300 + i;
    for (int i = 0; i < 20; i++) heights[(i / 5 + 2) * 40 + i % 5 + 2] = 400 + i;
    expect_file_metres(database, heights);
    terrain r = open_terrain(database, NULL);
    assert_string_equal(r.t->source, "small.tif\none.tif\ntwo.tif");
    close_terrain(&r);
    assert_int_equal(update_many(sources, 1, database, &o, false), 0);
    r = open_terrain(database, NULL);
    assert_string_equal(r.t->source, "small.tif\ntwo.tif\none.tif");
    close_terrain(&r);
    char *now = dump(database, "SELECT created FROM rqt_terrain");
    assert_string_equal(created, now);
    sqlite3_free(created);
    sqlite3_free(now);
    /* The same again changes nothing, and touches nothing. */
    char *before = dump(database, "SELECT * FROM rqt_terrain, gpkg_contents ORDER BY table_name");
    assert_int_equal(update_many(sources, 1, database, &o, false), 0);
    assert_int_equal(updated.changed, 0);
    char *after = dump(database, "SELECT * FROM rqt_terrain, gpkg_contents ORDER BY table_name");
    assert_string_equal(before, after);
    sqlite3_free(before);
    sqlite3_free(after);
}

/* A folder's rasters go in in the order of their paths; those that are no terrain's or lie elsewhere are passed
 * over.
 */
static void folders_and_lists_are_taken_as_imports_take_them(void **unused) {
    (void)unused;
    import_options o = defaults();
    const char *database = file("t.gpkg");
    assert_int_equal(mkdir(file("in"), 0777) | mkdir(file("in/deep"), 0777) | mkdir(file("away"), 0777), 0);
    shifted_window("in/b.tif", 20, 20, GDT_Int16, 0, 100);
    shifted_window("in/a.tif", 0, 0, GDT_Int16, 0, 0);
    shifted_window("in/deep/c.tif", 200, 100, GDT_Int16, 0, 50);
    shifted_window("away/d.tif", 40000, 0, GDT_Int16, 0, 0);
    assert_int_equal(CPLCopyFile(file("in/far.tif"), file("away/d.tif")), 0);
    const double colours[3] = {1, 2, 3};
    write_raster(&(raster){.name = "in/colours.tif", .width = 1, .height = 1, .bands = 3, .type = GDT_Byte},
                 colours);
    FILE *list = fopen(file("list.txt"), "w");
    assert_non_null(list);
    fputs("# what came in May\n\nin\n", list);
    fclose(list);
    char argument[300];
    snprintf(argument, sizeof argument, "@%s", file("list.txt"));
    const char *const sources[] = {file("in"), argument};
    for (int round = 0; round < 2; round++) {
        unlink(database);
        import_small(database, &o);
        notices[0] = 0;
        for (int i = 0; i < 20; i++) heights[i / 5 * 40 + i % 5] = 300 + i;
        for (int i = 0; i < 20; i++) heights[(i / 5 + 2) * 40 + i % 5 + 2] = 400 + i;
        for (int i = 0; i < 20; i++) heights[(i / 5 + 10) * 40 + i % 5 + 20] = 350 + i;
        if (update_many(&sources[round], 1, database, &o, false)) fail_msg("%s", message);
        assert_int_equal(updated.samples, 60);
        expect_file_metres(database, heights);
        if (!strstr(notices, "colours.tif is passed over: it has 3 bands")) fail_msg("%s", notices);
        if (!strstr(notices, "1 raster in folders lies outside terrain")) fail_msg("%s", notices);
    }
    terrain r = open_terrain(database, NULL);
    assert_string_equal(r.t->source, "small.tif\na.tif\nb.tif\nc.tif");
    close_terrain(&r);
    expect_sound(database);
    update_refused(file("away"), database, &o, "away holds no raster of one band that meets terrain");
    update_refused(file("away/d.tif"), database, &o, "lies outside terrain");
    assert_int_equal(mkdir(file("empty"), 0777), 0);
    update_refused(file("empty"), database, &o, "empty is a folder without rasters");
}

static void heights_keep_the_terrains_unit_and_steps(void **unused) {
    (void)unused;
    import_options o = defaults();
    double values[1200];
    /* Feet into feet stay what they are; whole metres in floats are whole metres. */
    fill(values, 40, 30, 1);
    o.unit = "ft";
    raster r = small;
    import_fine(write_raster(&r, values), file("feet.gpkg"), &o);
    update_fine(write_window(&r, "feet.tif", 3, 3, 9, 9, values), file("feet.gpkg"), &o, false);
    assert_int_equal(updated.changed, 0);
    o.unit = NULL;
    import_fine(write_raster(&r, values), file("metres.gpkg"), &o);
    r.type = GDT_Float32;
    update_fine(write_window(&r, "metres.tif", 3, 3, 9, 9, values), file("metres.gpkg"), &o, false);
    assert_int_equal(updated.changed, 0);
    update_refused(file("feet.tif"), file("feet.gpkg"), &o, "which is no whole number of steps of 0.3048 m");
    /* A terrain that was rounded is rounded again, alike. */
    for (int i = 0; i < 1200; i++) values[i] = 100 + uniform();
    import_fine(write_raster(&r, values), file("rounded.gpkg"), &o);
    update_fine(write_window(&r, "rounded.tif", 0, 0, 40, 30, values), file("rounded.gpkg"), &o, false);
    assert_int_equal(updated.changed, 0);
    assert_int_equal(updated.samples, 1200);
    values[7] += 0.3;
    update_fine(write_window(&r, "rounded.tif", 0, 0, 40, 30, values), file("rounded.gpkg"), &o, false);
    assert_int_equal(updated.changed, 1);
}

/* More than the store puts in at once. */
static void a_long_window_goes_in_parts(void **unused) {
    (void)unused;
    import_options o = defaults();
    o.k = 4;
    o.name = "t";
    const int n = 2100 * 20;
    double *values = malloc((size_t)n * sizeof *values);
    assert_non_null(values);
    raster r = {.name = "long.tif", .width = 2100, .height = 20, .type = GDT_Int16};
    fill(values, 2100, 20, 1);
    import_fine(write_raster(&r, values), file("long.gpkg"), &o);
    for (int i = 0; i < n; i++) values[i] += i % 7;
    const char *changed = write_raster(&r, values);
    update_fine(changed, file("long.gpkg"), &o, false);
    import_fine(changed, file("rebuilt.gpkg"), &o);
    expect_same(file("long.gpkg"), file("rebuilt.gpkg"), "in parts");
    free(values);
}

static void stored_minimal_errors_are_made_anew(void **unused) {
    (void)unused;
    import_options o = defaults();
    o.name = "t";
    o.minimal = true;
    const char *database = import_small(file("t.gpkg"), &o);
    update_fine(shifted_window("patch.tif", 100, 100, GDT_Int16, 0, 77), database, &o, false);
    assert_true(updated.minimal);
    assert_non_null(strstr(notices, "minimal errors"));
    for (int i = 0; i < 20; i++) heights[(10 + i / 5) * 40 + 10 + i % 5] = 377 + i;
    import_fine(write_raster(&small, heights), file("rebuilt.gpkg"), &o);
    expect_same(database, file("rebuilt.gpkg"), "exact");
    static const char *const minimal[] = {
        "SELECT id, summary, data FROM rqt_block_1_minimal ORDER BY id",
        "SELECT * FROM rqt_index_1_minimal ORDER BY id",
        "SELECT table_name, data_type, identifier, description FROM gpkg_contents"};
    for (size_t i = 0; i < LENGTH(minimal); i++) {
        char *left = dump(database, minimal[i]), *right = dump(file("rebuilt.gpkg"), minimal[i]);
        assert_true(strlen(left) > 0);
        assert_string_equal(left, right);
        sqlite3_free(left);
        sqlite3_free(right);
    }
    expect_sound(database);
}

/* ------------------------------------------------------------------------------------------ others, and the end --
 */

static void execute(sqlite3 *db, const char *sql) {
    if (sqlite3_exec(db, sql, NULL, NULL, NULL) != SQLITE_OK) fail_msg("%s: %s", sql, sqlite3_errmsg(db));
}

/* Runs of filled samples end where data was put in. */
static void what_was_filled_is_so_no_longer_where_there_is_data(void **unused) {
    (void)unused;
    import_options o = defaults();
    const char *database = import_small(file("t.gpkg"), &o);
    sqlite3 *db;
    assert_int_equal(sqlite3_open(database, &db), SQLITE_OK);
    execute(
        db,
        "CREATE TABLE rqt_fill_1(id INTEGER PRIMARY KEY, row INTEGER, col0 INTEGER, col1 INTEGER, kind INTEGER);"
        "INSERT INTO rqt_fill_1(row, col0, col1, kind) VALUES (4,0,39,1), (5,0,4,2), (5,12,14,1), (6,7,8,1), "
        "(9,0,39,2), (20,3,3,1)");
    sqlite3_close(db);
    /* Columns 5 .. 9, rows 5 .. 8; and 11 .. 15, 3 .. 6. */
    update_fine(shifted_window("a.tif", 50, 50, GDT_Int16, 0, 0), database, &o, false);
    update_fine(shifted_window("b.tif", 110, 30, GDT_Int16, 0, 0), database, &o, false);
    char *runs =
        dump(database, "SELECT group_concat(id || ':' || row || ':' || col0 || '-' || col1 || ':' || kind, ' ') "
                       "FROM (SELECT * FROM rqt_fill_1 ORDER BY id)");
    char *wanted = dump(database, "SELECT '1:4:0-10:1 2:4:16-39:1 3:5:0-4:2 4:9:0-39:2 5:20:3-3:1'");
    assert_string_equal(runs, wanted);
    sqlite3_free(runs);
    sqlite3_free(wanted);
}

static int32_t height_of(store *s) {
    const store_terrain *t;
    int32_t q;
    uint8_t valid;
    char *error = NULL;
    if (store_find(s, NULL, &t, &error) || store_window(s, t, 12, 11, 1, 1, &q, &valid, &error))
        fail_msg("%s", error);
    return q;
}

static void put_one(sqlite3 *db, int32_t q) {
    store_update *u;
    const store_terrain *t;
    const uint8_t state_of = STORE_HEIGHT;
    char *error = NULL;
    if (store_update_begin(db, NULL, &u, &t, &error) ||
        store_update_samples(u, 12, 11, 1, 1, &q, &state_of, NULL, NULL, &error) ||
        store_update_finish(u, "by hand", NULL, NULL, &error))
        fail_msg("%s", error);
    store_update_free(u);
}

static void F52_a_rollback_leaves_no_block_of_the_update_behind(void **unused) {
    (void)unused;
    import_options o = defaults();
    const char *database = import_small(file("t.gpkg"), &o);
    sqlite3 *db;
    store *s;
    assert_int_equal(sqlite3_open(database, &db), SQLITE_OK);
    assert_int_equal(store_open(db, &s), SQLITE_OK);
    const int32_t old = height_of(s);
    execute(db, "BEGIN IMMEDIATE");
    put_one(db, old + 50);
    assert_int_equal(height_of(s), old + 50);
    execute(db, "ROLLBACK");
    assert_int_equal(height_of(s), old);
    execute(db, "BEGIN IMMEDIATE; SAVEPOINT a");
    put_one(db, old + 60);
    assert_int_equal(height_of(s), old + 60);
    execute(db, "ROLLBACK TO a");
    assert_int_equal(height_of(s), old);
    put_one(db, old + 70);
    execute(db, "COMMIT");
    assert_int_equal(height_of(s), old + 70);
    store_close(s);
    sqlite3_close(db);
    expect_sound(database);
}

static void F51_others_see_the_old_state_or_the_new_one(void **unused) {
    (void)unused;
    for (int wal = 0; wal < 2; wal++) {
        import_options o = defaults();
        o.replace = true;
        const char *database = import_small(file("t.gpkg"), &o);
        sqlite3 *db, *other;
        store *s;
        assert_int_equal(sqlite3_open(database, &db), SQLITE_OK);
        if (wal) execute(db, "PRAGMA journal_mode = WAL");
        assert_int_equal(sqlite3_open(database, &other), SQLITE_OK);
        assert_int_equal(store_open(other, &s), SQLITE_OK);
        const int32_t old = height_of(s);
        execute(db, "BEGIN IMMEDIATE");
        put_one(db, old + 9);
        assert_int_equal(height_of(s), old);
        /* Nobody else writes meanwhile: a sentence, not a wait for ever. */
        const char *patch = shifted_window("patch.tif", 0, 0, GDT_Int16, 0, 0);
        assert_int_equal(update_many(&patch, 1, database, &o, false), 1);
        assert_non_null(strstr(message, "is locked"));
        execute(db, "COMMIT");
        assert_int_equal(height_of(s), old + 9);
        update_fine(patch, database, &o, false);
        char *mode = dump(database, "PRAGMA journal_mode");
        assert_string_equal(mode, wal ? "77616c \n" : "64656c657465 \n");
        sqlite3_free(mode);
        store_close(s);
        sqlite3_close(other);
        sqlite3_close(db);
        expect_sound(database);
        unlink(database);
    }
}

static bool stop_now(void *context, const char *stage, double done, int64_t samples) {
    (void)context, (void)done, (void)samples;
    return strcmp(stage, "updating") != 0;
}

static void F50_a_stop_and_a_full_disk_leave_everything_as_it_was(void **unused) {
    (void)unused;
    import_options o = defaults();
    o.k = 5;
    const raster r = {.name = "r.tif", .width = 300, .height = 300, .type = GDT_Int16};
    double *values = malloc(90000 * sizeof *values);
    assert_non_null(values);
    fill(values, 300, 300, 1);
    const char *whole = write_raster(&r, values), *database = file("t.gpkg"), *before = file("before.gpkg");
    import_fine(whole, database, &o);
    assert_int_equal(CPLCopyFile(before, database), 0);
    for (int i = 0; i < 90000; i++) values[i] = below(3000);
    raster rough = r;
    rough.name = "rough.tif";
    const char *noise = write_raster(&rough, values);
    o.progress = stop_now;
    assert_int_equal(update_many(&noise, 1, database, &o, false), 1);
    assert_non_null(strstr(message, "the database is as it was"));
    expect_same(database, before, "stopped");
    o.progress = NULL;
    const pid_t child = fork();
    if (child == 0) {
        struct stat size;
        const bool known = stat(database, &size) == 0;
        const struct rlimit limit = {known ? (rlim_t)size.st_size : 0, RLIM_INFINITY};
        signal(SIGXFSZ, SIG_IGN);
        setrlimit(RLIMIT_FSIZE, &limit);
        const int failed = update_many(&noise, 1, database, &o, false);
        _exit(failed && strstr(message, "t.gpkg: ") ? 3 : 4);
    }
    int status = 0;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 3);
    expect_same(database, before, "full disk");
    assert_int_equal(chmod(database, 0444), 0);
    if (access(database, W_OK) != 0) {
        assert_int_equal(update_many(&noise, 1, database, &o, false), 1);
        assert_non_null(strstr(message, "read-only"));
    }
    free(values);
}

/* A child updates there and back for ever; it is killed, and what it leaves is one of the two states, and sound. */
static void F49_a_killed_update_leaves_the_old_state_or_the_new_one(void **unused) {
    (void)unused;
    state = (uint32_t)time(NULL) | 1;
    print_message("kills from %u\n", state);
    import_options o = defaults();
    o.k = 2;
    o.name = "t";
    const char *database = import_small(file("t.gpkg"), &o), *old = file("old.gpkg"), *fresh = file("fresh.gpkg");
    const char *back = write_window(&small, "back.tif", 5, 5, 20, 20, heights);
    double values[1200];
    for (int i = 0; i < 1200; i++) values[i] = 100 + below(900);
    const char *patch = write_window(&small, "patch.tif", 5, 5, 20, 20, values);
    assert_int_equal(CPLCopyFile(old, database), 0);
    update_fine(patch, database, &o, false);
    assert_int_equal(CPLCopyFile(fresh, database), 0);
    int seen[2] = {0, 0};
    struct timespec begin_at, end_at;
    clock_gettime(CLOCK_MONOTONIC, &begin_at);
    update_fine(back, database, &o, false);
    update_fine(patch, database, &o, false);
    clock_gettime(CLOCK_MONOTONIC, &end_at);
    const double both =
        1e6 * (double)(end_at.tv_sec - begin_at.tv_sec) + 1e-3 * (double)(end_at.tv_nsec - begin_at.tv_nsec);
    for (int kill_number = 0; kill_number < 24; kill_number++) {
        const pid_t child = fork();
        if (child == 0) {
            for (;;) {
                const char *const sources[] = {back, patch};
                if (update_many(sources, 1, database, &o, false) ||
                    update_many(sources + 1, 1, database, &o, false))
                    _exit(9);
            }
        }
        usleep((useconds_t)fmin(3 * both * uniform(), 400000));
        assert_int_equal(kill(child, SIGKILL), 0);
        int status = 0;
        assert_int_equal(waitpid(child, &status, 0), child);
        assert_true(WIFSIGNALED(status));
        /* Whoever opens it next rolls back what is half there. */
        sqlite3 *db;
        assert_int_equal(sqlite3_open(database, &db), SQLITE_OK);
        execute(db, "BEGIN IMMEDIATE; ROLLBACK");
        sqlite3_close(db);
        const bool is_old = are_same(database, old), is_new = are_same(database, fresh);
        assert_true(is_old || is_new);
        seen[is_new]++;
    }
    print_message("old %d times, new %d times\n", seen[0], seen[1]);
    expect_sound(database);
}

#undef TEST
#define TEST(f) cmocka_unit_test_setup(f, begin)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(F22_a_database_equals_its_rebuild_and_goes_back),
        TEST(what_does_not_fit_is_refused_with_a_sentence),
        TEST(what_lies_outside_is_left_out_and_told),
        TEST(a_later_source_wins_and_provenance_says_what_was_put_in),
        TEST(folders_and_lists_are_taken_as_imports_take_them),
        TEST(heights_keep_the_terrains_unit_and_steps),
        TEST(a_long_window_goes_in_parts),
        TEST(stored_minimal_errors_are_made_anew),
        TEST(what_was_filled_is_so_no_longer_where_there_is_data),
        TEST(F52_a_rollback_leaves_no_block_of_the_update_behind),
        TEST(F51_others_see_the_old_state_or_the_new_one),
        TEST(F50_a_stop_and_a_full_disk_leave_everything_as_it_was),
        TEST(F49_a_killed_update_leaves_the_old_state_or_the_new_one),
    };
    return cmocka_run_group_tests(tests, begin_all, end_all);
}
