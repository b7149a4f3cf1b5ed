/* test_fault_memory.c - F48: whichever request for memory is refused, once or from then on, every SQL function
 * gives the right answer or says that memory is out, an import leaves the database as it was or done, and nothing
 * leaks.
 *
 * Refused are requests of the store and of SQLite (through SQLite's memory methods), of the verifier and the import
 * (malloc and its kin: the linker's --wrap puts ours before them) and of cJSON (its hooks). What is asked is every
 * example of the function table, and more (test_fault_support.h). The core alone is test_core_memory.c's, the store
 * without SQL functions test_store_faults.c's. */
#include "test_fault_support.h"

#include <cjson/cJSON.h>
#include <limits.h>
#include <stdatomic.h>

/* ------------------------------------------------------------------------------------------ failing memory -- */
static bool starves_sqlite; /* from the first report of progress on */
/* Threads of an import ask, too. */
static struct {
    atomic_bool ours, sqlites; /* whose requests are counted */
    bool later;                /* the chosen one and all later ones */
    atomic_long count, refused;
    long at;
} shortage;

static void begin_shortage(long at, bool later, bool sqlites) {
    shortage.at = at;
    shortage.later = later;
    shortage.count = shortage.refused = 0;
    shortage.sqlites = sqlites;
    shortage.ours = true;
}

static void end_shortage(void) {
    starves_sqlite = shortage.ours = shortage.sqlites = false;
}

static bool refuses(bool on) {
    if (!on) return false;
    const long n = ++shortage.count;
    if (shortage.later ? n < shortage.at : n != shortage.at) return false;
    shortage.refused++;
    return true;
}

void *__real_malloc(size_t bytes);
void *__real_calloc(size_t n, size_t bytes);
void *__real_realloc(void *p, size_t bytes);
void *__wrap_malloc(size_t bytes);
void *__wrap_calloc(size_t n, size_t bytes);
void *__wrap_realloc(void *p, size_t bytes);

void *__wrap_malloc(size_t bytes) {
    return refuses(shortage.ours) ? NULL : __real_malloc(bytes);
}
void *__wrap_calloc(size_t n, size_t bytes) {
    return refuses(shortage.ours) ? NULL : __real_calloc(n, bytes);
}
void *__wrap_realloc(void *p, size_t bytes) {
    return refuses(shortage.ours) ? NULL : __real_realloc(p, bytes);
}

static sqlite3_mem_methods real_memory;

static void *sqlite_malloc(int bytes) {
    return refuses(shortage.sqlites) ? NULL : real_memory.xMalloc(bytes);
}
static void *sqlite_realloc(void *p, int bytes) {
    return refuses(shortage.sqlites) ? NULL : real_memory.xRealloc(p, bytes);
}

static bool install_memory(void) {
    static cJSON_Hooks hooks = {__wrap_malloc, free};
    cJSON_InitHooks(&hooks);
    if (sqlite3_config(SQLITE_CONFIG_GETMALLOC, &real_memory) != SQLITE_OK) return false;
    sqlite3_mem_methods failing = real_memory;
    failing.xMalloc = sqlite_malloc;
    failing.xRealloc = sqlite_realloc;
    /* Without lookaside every small request of SQLite's is one that can be refused. */
    return sqlite3_config(SQLITE_CONFIG_MALLOC, &failing) == SQLITE_OK &&
           sqlite3_config(SQLITE_CONFIG_LOOKASIDE, 0, 0) == SQLITE_OK;
}

static bool is_out_of_memory(int code) {
    return (code & 0xFF) == SQLITE_NOMEM || code == SQLITE_IOERR_NOMEM;
}

/* -------------------------------------------------------------------------------------------- SQL functions -- */
static sqlite3 *connect_to(const char *path) {
    sqlite3 *db = NULL;
    assert_int_equal(sqlite3_open_v2(path, &db, SQLITE_OPEN_READONLY, NULL), SQLITE_OK);
    assert_int_equal(sqlite3_rqt_init(db, NULL, NULL), SQLITE_OK);
    /* The schema is read here, once: SQLite's reading of it is the same for every statement. */
    assert_int_equal(ask_statement(db, "SELECT count(*) FROM sqlite_schema").code, SQLITE_OK);
    return db;
}

static void ask_with_shortage(sqlite3 *db, const char *sql, long at, bool later, const sql_answer *right) {
    begin_shortage(at, later, true);
    const sql_answer a = ask_statement(db, sql);
    end_shortage();
    CHECK(same_sql_answer(&a, right) || is_out_of_memory(a.code),
          "%s: request %ld refused%s: code %d, %s (%lld rows)", sql, at, later ? " and all later ones" : "", a.code,
          a.error, (long long)a.rows);
    CHECK(a.code == SQLITE_OK || shortage.refused > 0, "%s: no memory, though none was refused", sql);
}

static void disconnect(sqlite3 *db, const char *sql, long at, sqlite3_int64 used) {
    CHECK(sqlite3_close(db) == SQLITE_OK, "%s: request %ld refused: the connection does not close", sql, at);
    CHECK(sqlite3_memory_used() == used, "%s: request %ld refused: %lld bytes are left", sql, at,
          sqlite3_memory_used() - used);
}

/* The statement on a connection that has answered it before, and is to answer it after each refusal. */
static long starve_again(const char *path, const char *sql, const sql_answer *right) {
    const sqlite3_int64 used = sqlite3_memory_used();
    sqlite3 *db = connect_to(path);
    long at = 0;
    do {
        const sql_answer a = ask_statement(db, sql);
        CHECK(same_sql_answer(&a, right), "%s: after request %ld was refused: %d %s", sql, at, a.code, a.error);
        ask_with_shortage(db, sql, ++at, false, right);
    } while (shortage.refused > 0);
    disconnect(db, sql, at, used);
    return at - 1;
}

/* The statement on a fresh connection, from request `at` on, every stride-th. */
static long starve_first(const char *path, const char *sql, bool later, long at, long stride,
                         const sql_answer *right) {
    const sqlite3_int64 used = sqlite3_memory_used();
    for (long refused = 0;; refused++, at += stride) {
        sqlite3 *db = connect_to(path);
        ask_with_shortage(db, sql, at, later, right);
        disconnect(db, sql, at, used);
        if (shortage.refused == 0) return refused;
    }
}

/* Where a connection is fresh, most requests are SQLite's own, for the same statements of the store each time, and
 * test_store_faults.c refuses them all: here each statement refuses others of them. RQT_STRIDE=1 refuses every one.
 */
static void F48_every_function_survives_every_refused_request(void **unused) {
    (void)unused;
    const file_path database = demo_database("memory.gpkg");
    const char *wanted = getenv("RQT_STRIDE");
    const long fresh = wanted ? strtol(wanted, NULL, 10) : 13, later = wanted ? fresh : 29;
    assert_true(fresh > 0);
    for (int n = 0; n < statement_count(); n++) {
        const char *sql = statement_at(n);
        sqlite3 *db = connect_to(database.text);
        const sql_answer right = ask_statement(db, sql);
        CHECK(right.code == SQLITE_OK, "%s: %s", sql, right.error);
        assert_int_equal(sqlite3_close(db), SQLITE_OK);
        const long again = starve_again(database.text, sql, &right),
                   once = starve_first(database.text, sql, false, 1 + n % fresh, fresh, &right),
                   all = starve_first(database.text, sql, true, 1 + n % later, later, &right);
        printf("%5ld %5ld %5ld requests refused: %s\n", again, once, all, sql);
        assert_true(again > 2);
    }
}

static void F48_loading_the_extension_survives_every_refused_request(void **unused) {
    (void)unused;
    for (int later = 0; later < 2; later++)
        for (long at = 1;; at++) {
            sqlite3 *db = NULL;
            char *error = NULL;
            const sqlite3_int64 used = sqlite3_memory_used();
            assert_int_equal(sqlite3_open(":memory:", &db), SQLITE_OK);
            begin_shortage(at, later, true);
            const int code = sqlite3_rqt_init(db, &error, NULL);
            end_shortage();
            const long hits = shortage.refused;
            CHECK(code == SQLITE_OK || is_out_of_memory(code), "request %ld refused: %d %s", at, code, error);
            CHECK((code == SQLITE_OK) == (hits == 0), "request %ld refused: loaded all the same", at);
            sqlite3_free(error);
            assert_int_equal(sqlite3_close(db), SQLITE_OK);
            assert_int_equal(sqlite3_memory_used(), used);
            if (hits == 0) break;
        }
}

/* ------------------------------------------------------------------------------------------------ writers -- */
/* SQLite's memory runs short only when the sources are described: PROJ keeps its definitions in SQLite, too. */
static bool starve_sqlite(void *context, const char *stage, double done, int64_t samples) {
    (void)context, (void)stage, (void)done, (void)samples;
    shortage.sqlites = starves_sqlite;
    return true;
}

static void starve_writer(const writer *w, const char *origin, bool sqlites, bool later, long stride) {
    const file_path work = path_of("work.gpkg");
    const char *const path = work.text;
    writer_prepare(w, origin, path);
    const uint64_t before = database_state(path);
    starves_sqlite = sqlites;
    begin_shortage(LONG_MAX, later, false);
    CHECK(w->run(path) == 0, "%s", message);
    end_shortage();
    const uint64_t after = database_state(path);
    expect_sound(path);
    assert_true(before != after);
    long old = 0, at = 1;
    for (;; at += stride) {
        writer_prepare(w, origin, path);
        starves_sqlite = sqlites;
        begin_shortage(at, later, false);
        const int status = w->run(path);
        end_shortage();
        const long hits = shortage.refused;
        const uint64_t now = database_state(path);
        CHECK(now == (status ? before : after), "%s: request %ld refused%s: %s; the database is %s", w->name, at,
              later ? " and all later ones" : "", status ? message : "done",
              now == before  ? "as before"
              : now == after ? "done"
                             : "neither as before nor done");
        CHECK(status == 0 || strstr(message, "memory"), "%s: request %ld refused: it says '%s'", w->name, at,
              message);
        old += status;
        if (hits == 0) {
            CHECK(status == 0, "%s: nothing was refused, and yet: %s", w->name, message);
            break;
        }
    }
    printf("%s: %ld of %ld requests refused were noticed\n", w->name, old, (at - 1) / stride);
    assert_true(old > 10);
    remove_file_and_company(path);
}

static void F48_a_writer_survives_every_refused_request(void **unused) {
    (void)unused;
    demo_progress = starve_sqlite;
    for (size_t n = 0; n < LENGTH(writers); n++) {
        const file_path origin = writer_origin(&writers[n]);
        for (int later = 0; later < 2; later++) {
            if (!writers[n].before) starve_writer(&writers[n], origin.text, false, later, 1);
            starve_writer(&writers[n], origin.text, true, later, later ? 101 : 47);
        }
        remove_file_and_company(origin.text);
    }
}

int main(void) {
    if (!install_memory()) return 1;
    const struct CMUnitTest tests[] = {
#define TEST(name) cmocka_unit_test_setup(name, begin)
        TEST(F48_every_function_survives_every_refused_request),
        TEST(F48_loading_the_extension_survives_every_refused_request),
        TEST(F48_a_writer_survives_every_refused_request),
    };
    alarm(600);
    return cmocka_run_group_tests_name("faults of memory", tests, begin_all, end_all);
}
