/* test_fault_io.c - F50: whatever the file system refuses, at whichever call, a query gives the right answer or a
 * sentence, and an import leaves the database as it was or wholly done; without faults it then goes on.
 *
 * Every call of SQLite's file system fails once, and then that and all later ones; once more with writes that find
 * a full disk and locks that others hold. The writers are those of test_fault_support.h. */
#include "fault_vfs.h"
#include "test_fault_support.h"

/* Three ways to fail; from-then-on and softly together is a disk that stays full, or a lock that stays. */
static const struct {
    const char *name;
    bool later, softly;
} ways[] = {{"once", false, false},
            {"from then on", true, false},
            {"full or busy once", false, true},
            {"full or busy from then on", true, true}};

/* ---------------------------------------------------------------------------------------------- queries -- */
/* A connection, one statement, and out again: *answer; the code when there was no connection. */
static sql_answer query_anew(const char *path, const char *sql) {
    sqlite3 *db = NULL;
    sql_answer a = {0};
    a.code = sqlite3_open_v2(path, &db, SQLITE_OPEN_READONLY, NULL);
    if (a.code == SQLITE_OK) a.code = sqlite3_rqt_init(db, NULL, NULL);
    if (a.code == SQLITE_OK)
        a = ask_statement(db, sql);
    else
        snprintf(a.error, sizeof a.error, "%s", sqlite3_errmsg(db));
    const int closed = sqlite3_close(db);
    CHECK(closed == SQLITE_OK, "%s: the connection does not close: %d", sql, closed);
    return a;
}

static bool is_io_error(int code) {
    switch (code & 0xFF) {
    case SQLITE_IOERR:
    case SQLITE_CANTOPEN:
    case SQLITE_FULL:
    case SQLITE_BUSY:
    case SQLITE_PROTOCOL:
        return true;
    default:
        return false;
    }
}

static void F50_a_query_survives_every_failing_call_of_the_file_system(void **unused) {
    (void)unused;
    const file_path database = demo_database("io.gpkg");
    const char *const path = database.text;
    long calls = 0, errors = 0;
    for (int n = 0; n < statement_count(); n++) {
        const char *sql = statement_at(n);
        const sql_answer right = query_anew(path, sql);
        CHECK(right.code == SQLITE_OK, "%s: %s", sql, right.error);
        const sqlite3_int64 used = sqlite3_memory_used();
        for (size_t w = 0; w < 3; w++) /* nothing is written: the disk cannot be full */
            for (long at = 1;; at++) {
                fault_vfs_begin(at, ways[w].later, ways[w].softly);
                const sql_answer a = query_anew(path, sql);
                fault_vfs_end();
                if (fault_vfs.hits == 0) break;
                CHECK(same_sql_answer(&a, &right) || (is_io_error(a.code) && a.error[0]),
                      "%s: call %ld (%s) fails %s: code %d, %s", sql, at, fault_vfs.call, ways[w].name, a.code,
                      a.error);
                CHECK(sqlite3_memory_used() == used, "%s: call %ld (%s) fails %s: %lld bytes are left", sql, at,
                      fault_vfs.call, ways[w].name, sqlite3_memory_used() - used);
                calls++;
                errors += a.code != SQLITE_OK;
            }
    }
    printf("%ld calls failed, %ld of them an error\n", calls, errors);
    assert_true(calls > 1000 && errors > calls / 4);
}

/* One connection for all: what a fault has left in the cache must not be wrong later. */
static void F50_a_connection_goes_on_after_a_failing_call(void **unused) {
    (void)unused;
    const file_path database = demo_database("io.gpkg");
    const char *const path = database.text;
    static const char *const sql[] = {"SELECT * FROM rqt_triangles(NULL, 0)",
                                      "SELECT rqt_height(-71.3033, 44.2705, 1)",
                                      "SELECT * FROM rqt_range(NULL, 4, NULL, '{\"metric\":\"minimal\"}')"};
    for (size_t n = 0; n < LENGTH(sql); n++) {
        const sql_answer right = query_anew(path, sql[n]);
        sqlite3 *db = NULL;
        long at = 1, failed = 0;
        for (;; at++) {
            /* A small cache, emptied by a change of the schema's cookie through another connection. */
            if (!db) {
                assert_int_equal(sqlite3_open_v2(path, &db, SQLITE_OPEN_READONLY, NULL), SQLITE_OK);
                assert_int_equal(sqlite3_rqt_init(db, NULL, NULL), SQLITE_OK);
                assert_int_equal(sqlite3_exec(db, "PRAGMA cache_size = 1", NULL, NULL, NULL), SQLITE_OK);
            }
            fault_vfs_begin(at, false, false);
            const sql_answer hit = ask_statement(db, sql[n]);
            fault_vfs_end();
            const long hits = fault_vfs.hits;
            failed += hit.code != SQLITE_OK;
            CHECK(same_sql_answer(&hit, &right) || (is_io_error(hit.code) && hit.error[0]),
                  "%s: call %ld (%s): %d %s", sql[n], at, fault_vfs.call, hit.code, hit.error);
            const sql_answer after = ask_statement(db, sql[n]);
            CHECK(same_sql_answer(&after, &right), "%s: after call %ld (%s) had failed: %d %s, %lld rows", sql[n],
                  at, fault_vfs.call, after.code, after.error, (long long)after.rows);
            assert_int_equal(sqlite3_close(db), SQLITE_OK);
            db = NULL;
            if (hits == 0) break;
        }
        assert_true(failed > 5);
    }
}

/* ---------------------------------------------------------------------------------------------- writers -- */
static void write_under_faults(const writer *w, const char *origin) {
    const file_path work = path_of("work.gpkg");
    const char *const path = work.text;
    writer_prepare(w, origin, path);
    const uint64_t before = w->before ? database_state(path) : 0;
    CHECK(w->run(path) == 0, "%s: %s", w->name, message);
    const uint64_t after = database_state(path);
    expect_sound(path);
    assert_true(after != before && after != 0);
    for (size_t way = 0; way < LENGTH(ways); way++) {
        long at = 1, old = 0, done = 0, unclear = 0;
        for (;; at += ways[way].later ? 3 : 1) {
            writer_prepare(w, origin, path);
            const sqlite3_int64 used = sqlite3_memory_used();
            fault_vfs_begin(at, ways[way].later, ways[way].softly);
            const int status = w->run(path);
            fault_vfs_end();
            const long hits = fault_vfs.hits;
            const char *call = fault_vfs.call;
            CHECK(sqlite3_memory_used() == used, "%s: call %ld (%s) fails %s: %lld bytes are left", w->name, at,
                  call, ways[way].name, sqlite3_memory_used() - used);
            CHECK(status == 0 || message[0], "%s: call %ld (%s) fails %s: no sentence", w->name, at, call,
                  ways[way].name);
            const uint64_t now = database_state(path);
            CHECK(now == before || now == after,
                  "%s: call %ld (%s) fails %s: neither as before nor done; it said: %s", w->name, at, call,
                  ways[way].name, message);
            CHECK(status != 0 || now == after, "%s: call %ld (%s) fails %s: it said nothing, and nothing is done",
                  w->name, at, call, ways[way].name);
            unclear += status != 0 && now == after;
            old += now == before;
            done += now == after;
            if (hits == 0) {
                CHECK(status == 0, "%s: no call failed, and yet: %s", w->name, message);
                break;
            }
        }
        printf("%s, %s: %ld calls, %ld times as before, %ld done (%ld of them with a sentence)\n", w->name,
               ways[way].name, at - 1, old, done, unclear);
        assert_true(at > 10 && old > 0 && done > 0);
    }
    remove_file_and_company(path);
}

static void F50_a_writer_leaves_the_database_as_it_was_or_done(void **unused) {
    (void)unused;
    for (size_t n = 0; n < LENGTH(writers); n++) {
        const file_path origin = writer_origin(&writers[n]);
        write_under_faults(&writers[n], origin.text);
        remove_file_and_company(origin.text);
    }
}

int main(void) {
    if (!fault_vfs_install()) return 1;
    const struct CMUnitTest tests[] = {
#define TEST(name) cmocka_unit_test_setup(name, begin)
        TEST(F50_a_query_survives_every_failing_call_of_the_file_system),
        TEST(F50_a_connection_goes_on_after_a_failing_call),
        TEST(F50_a_writer_leaves_the_database_as_it_was_or_done),
    };
    alarm(600);
    return cmocka_run_group_tests_name("faults of the file system", tests, begin_all, end_all);
}
