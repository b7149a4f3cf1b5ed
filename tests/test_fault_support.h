/* test_fault_support.h - what the test programs of faults share: a small terrain on which every example of the
 * function table runs, statements and their answers as one number, and whole databases as one text.
 *
 * What is asked is the table of ext/functions.c itself: a new function is asked as soon as it has its example. */
#ifndef TEST_FAULT_SUPPORT_H
#define TEST_FAULT_SUPPORT_H

/* First: cmocka has a macro `fail`. */
#include "functions.h"
#include "rqt_extension.h"

#include "test_import_support.h"

#define CHECK(condition, ...)                        \
    do {                                             \
        if (!(condition)) {                          \
            print_error("failed: %s\n", #condition); \
            fail_msg(__VA_ARGS__);                   \
        }                                            \
    } while (0)

/* --------------------------------------------------------------------------------------------- terrains -- */
/* Hills where the examples look for them, on WGS 84: 29 x 25 samples with a hole in a corner. */
enum { DEMO_WIDTH = 29, DEMO_HEIGHT = 25 };

static inline const char *demo_raster(const char *name, double raised) {
    static const double place[6] = {-71.445, 0.01, 0, 44.395, 0, -0.01};
    double values[DEMO_WIDTH * DEMO_HEIGHT];
    state = 1;
    fill(values, DEMO_WIDTH, DEMO_HEIGHT, 1);
    for (int s = 0; s < DEMO_WIDTH * DEMO_HEIGHT; s++) values[s] += raised;
    for (int y = 20; y < 23; y++)
        for (int x = 22; x < 26; x++) values[y * DEMO_WIDTH + x] = -9999;
    raster r = {.name = name,
                .width = DEMO_WIDTH,
                .height = DEMO_HEIGHT,
                .type = GDT_Int16,
                .place = place,
                .epsg = 4326,
                .nodata = "-9999"};
    return write_raster(&r, values);
}

/* What writers report their progress to; NULL: nobody. */
static bool (*demo_progress)(void *context, const char *stage, double done, int64_t samples);

static inline import_options demo_options(void) {
    import_options o = defaults();
    o.name = "white_mountains";
    o.k = 3;
    o.jobs = 1;
    o.notice = NULL;
    o.progress = demo_progress;
    o.minimal = true;
    return o;
}

/* file() in a place of its own, for paths that are needed longer than it remembers them. */
typedef struct file_path {
    char text[256];
} file_path;

static inline file_path path_of(const char *name) {
    file_path p;
    snprintf(p.text, sizeof p.text, "%s", file(name));
    return p;
}

/* A new database with that terrain, and a table for the option detail. */
static inline file_path demo_database(const char *name) {
    const import_options o = demo_options();
    const file_path database = path_of(name);
    import_fine(demo_raster("demo.tif", 0), database.text, &o);
    sqlite3 *db = NULL;
    assert_int_equal(sqlite3_open(database.text, &db), SQLITE_OK);
    assert_int_equal(sqlite3_exec(db,
                                  "CREATE TABLE places(geom TEXT, eps REAL);"
                                  "INSERT INTO places VALUES ('POINT(-71.35 44.25)', 1), "
                                  "('LINESTRING(-71.4 44.2, -71.3 44.3)', 3.5)",
                                  NULL, NULL, NULL),
                     SQLITE_OK);
    assert_int_equal(sqlite3_close(db), SQLITE_OK);
    return database;
}

/* ------------------------------------------------------------------------------------------- statements -- */
/* What else is asked, beside the examples: formats, options, and what reads more than one block or none. */
static const char *const further_statements[] = {
    "SELECT rqt_mesh(NULL, 3, 'strip')",
    "SELECT rqt_mesh(NULL, 3, 'indexed')",
    "SELECT rqt_mesh(NULL, 3, 'rqt')",
    "SELECT rqt_mesh(rqt_bbox(-71.4, 44.2, -71.3, 44.3), 3, 'obj')",
    "SELECT rqt_mesh('LINESTRING(-71.4 44.2, -71.3 44.3)', 3, 'wkb')",
    "SELECT rqt_mesh('POINT(-71.4 44.2)', 3, 'gpkg')",
    "SELECT rqt_mesh(NULL, 30, 'spatialite')",
    "SELECT * FROM rqt_range(NULL, 3, 'white_mountains', '{\"metric\":\"minimal\"}')",
    "SELECT * FROM rqt_range(NULL, 3, NULL, '{\"metric\":\"local\"}')",
    "SELECT * FROM rqt_triangles(NULL, 3, NULL, '{\"select\":\"bottomup\"}')",
    "SELECT * FROM rqt_strip(NULL, 3, NULL, '{\"strip\":\"fan\",\"select\":\"topdown\"}')",
    "SELECT x, achieved_eps FROM rqt_range(NULL, 0, NULL, '{\"max_vertices\":300}')",
    "SELECT rqt_height(-71.33, 44.27, 2)",
    "SELECT r.error, t.name FROM rqt_terrains t, rqt_range('POINT(-71.4 44.2)', 1, t.name) r",
    "SELECT * FROM rqt_verify(NULL, 2)",
    "SELECT level, extent, why, bytes, selected FROM rqt_explain(NULL, 2)", /* cached is no part of the answer */
    "SELECT * FROM rqt_range(NULL, 30, NULL, '{\"detail\":[[\"POINT(-71.35 44.25)\",1],"
    "[\"POLYGON((-71.4 44.2, -71.3 44.2, -71.3 44.3, -71.4 44.2))\",3]]}')",
    "SELECT * FROM rqt_range(NULL, 30, NULL, '{\"detail\":\"places\"}')",
    "SELECT * FROM rqt_verify(NULL, 30, NULL, '{\"detail\":\"main.places\",\"mode\":\"border\"}')",
    "SELECT * FROM rqt_triangles('POLYGON((-71.4 44.2, -71.3 44.2, -71.3 44.3, -71.4 44.2))', 30, NULL, "
    "'{\"mode\":\"cut\"}')",
    "SELECT * FROM rqt_triangles('POINT(-71.3501 44.2501)', 30, NULL, '{\"mode\":\"snap\",\"outline\":\"tol\"}')",
    "SELECT rqt_mesh(rqt_bbox(-71.4, 44.2, -71.3, 44.3), 30, 'obj', NULL, '{\"frame\":\"ecef\"}')",
    "SELECT * FROM rqt_range(rqt_bbox(-71.4, 44.2, -71.3, 44.3), 30, NULL, '{\"frame\":\"enu\"}')",
    "SELECT rqt_mesh(rqt_bbox(-71.4, 44.2, -71.3, 44.3), 30, 'ply+normals')",
    "SELECT rqt_mesh(rqt_bbox(-71.4, 44.2, -71.3, 44.3), 30, 'rqt+normals+errors')",
    "SELECT * FROM rqt_answer(NULL, 3, 'ply', NULL, '{\"max_vertices\":300}')",
    "SELECT * FROM rqt_answer(NULL, 30, 'obj', NULL, '{\"mode\":\"cut\"}')",
    "SELECT * FROM rqt_view_answer('{\"eye\":[-71.4,44.2,3000],\"yaw\":30,\"pitch\":-20,\"fovy\":60,\"width\":64,"
    "\"height\":48,\"tau\":2}', 'increment', NULL, '{\"previous\":\"\",\"cover\":\"terrain\"}')",
    "SELECT mesh, token FROM rqt_view_answer('{\"eye\":[-71.4,44.2,3000],\"yaw\":30,\"pitch\":-20,\"fovy\":60,"
    "\"width\":64,\"height\":48,\"tau\":2}', 'rqt', NULL, '{\"previous\":\"\",\"max_triangles\":300}')",
};

static inline int statement_count(void) {
    return rqt_function_count + (int)LENGTH(further_statements);
}

static inline const char *statement_at(int n) {
    return n < rqt_function_count ? rqt_functions[n].example : further_statements[n - rqt_function_count];
}

typedef struct sql_answer {
    int code; /* primary */
    int64_t rows;
    uint64_t hash; /* over all values */
    char error[300];
} sql_answer;

static inline uint64_t hash_bytes(uint64_t h, const void *bytes, size_t n) {
    for (const unsigned char *p = bytes; n-- > 0; p++) h = (h ^ *p) * UINT64_C(0x100000001B3);
    return (h ^ 0xFF) * UINT64_C(0xC2B2AE3D27D4EB4F);
}

/* Runs one statement. Asks SQLite for no memory that the statement itself does not need. */
static inline sql_answer ask_statement(sqlite3 *db, const char *sql) {
    sql_answer a = {0};
    sqlite3_stmt *s = NULL;
    int code = sqlite3_prepare_v2(db, sql, -1, &s, NULL);
    while (code == SQLITE_OK || code == SQLITE_ROW) {
        code = sqlite3_step(s);
        if (code != SQLITE_ROW) break;
        a.rows++;
        for (int i = 0; i < sqlite3_column_count(s); i++) {
            const int type = sqlite3_column_type(s, i);
            a.hash = hash_bytes(a.hash, &type, sizeof type);
            const double real = type == SQLITE_FLOAT ? sqlite3_column_double(s, i) : 0;
            const sqlite3_int64 whole = type == SQLITE_INTEGER ? sqlite3_column_int64(s, i) : 0;
            a.hash = hash_bytes(hash_bytes(a.hash, &real, sizeof real), &whole, sizeof whole);
            if (type == SQLITE_TEXT || type == SQLITE_BLOB)
                a.hash = hash_bytes(a.hash, sqlite3_column_blob(s, i), (size_t)sqlite3_column_bytes(s, i));
        }
    }
    a.code = code == SQLITE_DONE ? SQLITE_OK : sqlite3_extended_errcode(db);
    if (code != SQLITE_DONE) snprintf(a.error, sizeof a.error, "%s", sqlite3_errmsg(db));
    sqlite3_finalize(s);
    return a;
}

static inline bool same_sql_answer(const sql_answer *a, const sql_answer *b) {
    return a->code == b->code && a->rows == b->rows && a->hash == b->hash;
}

/* -------------------------------------------------------------------------------------- whole databases -- */
/* Fails when rqt finds something in the database. */
static inline void expect_sound(const char *path) {
    sqlite3 *db;
    assert_int_equal(sqlite3_open_v2(path, &db, SQLITE_OPEN_READONLY, NULL), SQLITE_OK);
    assert_int_equal(sqlite3_rqt_init(db, NULL, NULL), SQLITE_OK);
    const sql_answer found = ask_statement(db, "SELECT * FROM rqt_check()");
    CHECK(found.code == SQLITE_OK && found.rows == 0, "rqt finds %s unsound: %s", path, found.error);
    assert_int_equal(sqlite3_close(db), SQLITE_OK);
}

/* Everything in the database but the time of the import, as a hash; 0 when there is no such file. Fails when SQLite
 * finds it unsound. */
static inline uint64_t database_state(const char *path) {
    if (!exists(path)) return 0;
    sqlite3 *db;
    uint64_t h = 1;
    assert_int_equal(sqlite3_open_v2(path, &db, SQLITE_OPEN_READWRITE, NULL), SQLITE_OK);
    sqlite3_stmt *tables;
    const sql_answer sound =
        ask_statement(db, "SELECT 1 FROM pragma_integrity_check WHERE integrity_check <> 'ok'");
    CHECK(sound.code == SQLITE_OK && sound.rows == 0, "SQLite finds %s unsound: %s", path, sound.error);
    assert_int_equal(sqlite3_prepare_v2(db,
                                        "SELECT name, sql FROM sqlite_schema WHERE type = 'table' AND "
                                        "sql NOT LIKE '%VIRTUAL%' ORDER BY name",
                                        -1, &tables, NULL),
                     SQLITE_OK);
    while (sqlite3_step(tables) == SQLITE_ROW) {
        const char *name = (const char *)sqlite3_column_text(tables, 0);
        sqlite3_stmt *rows;
        char *sql = sqlite3_mprintf("SELECT * FROM \"%w\"", name);
        h = hash_bytes(h, name, strlen(name));
        assert_int_equal(sqlite3_prepare_v2(db, sql, -1, &rows, NULL), SQLITE_OK);
        while (sqlite3_step(rows) == SQLITE_ROW)
            for (int i = 0; i < sqlite3_column_count(rows); i++) {
                const char *column = sqlite3_column_name(rows, i);
                if (!strcmp(column, "created") || !strcmp(column, "last_change") || !strcmp(column, "timestamp"))
                    continue;
                const void *bytes = sqlite3_column_blob(rows, i);
                h = hash_bytes(h, bytes, (size_t)sqlite3_column_bytes(rows, i));
            }
        assert_int_equal(sqlite3_finalize(rows), SQLITE_OK);
        sqlite3_free(sql);
    }
    assert_int_equal(sqlite3_finalize(tables), SQLITE_OK);
    assert_int_equal(sqlite3_close(db), SQLITE_OK);
    return h;
}

static inline void remove_file_and_company(const char *path) {
    static const char *const parts[] = {"", "-journal", "-wal", "-shm"};
    for (size_t i = 0; i < LENGTH(parts); i++) {
        char name[300];
        snprintf(name, sizeof name, "%s%s", path, parts[i]);
        unlink(name);
    }
}

static inline void copy_file(const char *from, const char *to) {
    remove_file_and_company(to);
    assert_int_equal(CPLCopyFile(to, from), 0);
}

/* ---------------------------------------------------------------------------------------------- writers -- */
/* What writes a database, for every kind of fault: a further command is a function and a line. */
typedef struct writer {
    const char *name;
    int (*run)(const char *database); /* 0, or 1 with a sentence in `message` */
    const char *before;               /* SQL that a demo database has met before; NULL: there is no database */
} writer;

static inline int write_new(const char *database) {
    const file_path source = path_of("second.tif");
    const char *sources[] = {source.text};
    const import_options o = demo_options();
    return import_many(sources, 1, database, &o);
}

static inline int write_over(const char *database) {
    const file_path source = path_of("second.tif");
    const char *sources[] = {source.text};
    import_options o = demo_options();
    o.minimal = false;
    o.replace = true;
    return import_many(sources, 1, database, &o);
}

/* A part of the terrain, in the middle of it, gets other heights. */
static inline int write_update(const char *database) {
    const file_path source = path_of("part.tif");
    const char *sources[] = {source.text};
    const import_options o = demo_options();
    import_update_report changed;
    return import_update(sources, 1, database, &o, false, &changed, message, sizeof message);
}

static const writer writers[] = {
    {"import into a new database", write_new, NULL},
    {"import that replaces", write_over, "PRAGMA journal_mode = delete"},
    {"import that replaces, WAL", write_over, "PRAGMA journal_mode = wal"},
    {"update", write_update, "PRAGMA journal_mode = delete"},
    {"update, WAL", write_update, "PRAGMA journal_mode = wal"},
};

/* The demo database that a writer finds, and the rasters that it reads. */
static inline file_path writer_origin(const writer *w) {
    static const double place[6] = {-71.375, 0.01, 0, 44.335, 0, -0.01};
    double part[6 * 5];
    for (int i = 0; i < 6 * 5; i++) part[i] = 200 + i * i % 17;
    const raster r = {.name = "part.tif", .width = 6, .height = 5, .type = GDT_Int16, .place = place, .epsg = 4326};
    write_raster(&r, part);
    demo_raster("second.tif", 7);
    const file_path origin = demo_database("origin.gpkg");
    sqlite3 *db;
    assert_int_equal(sqlite3_open(origin.text, &db), SQLITE_OK);
    if (w->before) assert_int_equal(sqlite3_exec(db, w->before, NULL, NULL, NULL), SQLITE_OK);
    assert_int_equal(sqlite3_close(db), SQLITE_OK);
    return origin;
}

/* Its state again, before the writer comes. */
static inline void writer_prepare(const writer *w, const char *origin, const char *database) {
    remove_file_and_company(database);
    if (w->before) copy_file(origin, database);
}

#endif
