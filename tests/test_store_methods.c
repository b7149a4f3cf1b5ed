/* test_store_methods.c - metrics that are not stored: within their memory, given back with it, and minimal errors
 * beside a terrain. What the answers are is checked elsewhere (test_core_fans.c, test_sql_methods.py); here, what
 * happens around them. */
#include "test_store_support.h"

static sqlite3_mem_methods real_memory;
static struct {
    bool on, all_later;
    long count, fail_at, refused;
} shortage;

static bool refuse(void) {
    if (!shortage.on) return false;
    shortage.count++;
    const bool no = shortage.all_later ? shortage.count >= shortage.fail_at : shortage.count == shortage.fail_at;
    shortage.refused += no;
    return no;
}

static void *short_malloc(int bytes) {
    return refuse() ? NULL : real_memory.xMalloc(bytes);
}

static void *short_realloc(void *p, int bytes) {
    return refuse() ? NULL : real_memory.xRealloc(p, bytes);
}

static bool install_memory(void) {
    if (sqlite3_config(SQLITE_CONFIG_GETMALLOC, &real_memory) != SQLITE_OK) return false;
    sqlite3_mem_methods failing = real_memory;
    failing.xMalloc = short_malloc;
    failing.xRealloc = short_realloc;
    return sqlite3_config(SQLITE_CONFIG_MALLOC, &failing) == SQLITE_OK;
}

static answer by_metric(store *s, rqt_metric metric, double eps) {
    return query_store(s, "t", eps, (store_query_options){.metric = metric}, NULL);
}

/* ---------------------------------------------------------------------------------------------- memory */

static void too_little_memory_is_a_sentence_that_says_how_much(void **state) {
    (void)state;
    sqlite3 *db = memory_terrain(700, 600, 5, false);
    store *s;
    assert_int_equal(store_open(db, &s), SQLITE_OK);
    store_limit_methods(s, (size_t)2 << 20); /* heights and codes take 7 bytes a sample */
    for (int metric = RQT_METRIC_MINIMAL; metric < RQT_METRICS; metric++) {
        const answer a = by_metric(s, (rqt_metric)metric, 5);
        assert_int_equal(a.code, SQLITE_ERROR);
        assert_int_equal(a.triangles, 0);
        char wanted[64];
        snprintf(wanted, sizeof wanted, "metric \"%s\" of terrain t", rqt_metric_name((rqt_metric)metric));
        CHECK(strstr(a.error, wanted) && strstr(a.error, "MiB of memory; 2 are allowed"), "%s", a.error);
    }
    assert_int_equal(by_metric(s, RQT_METRIC_EXACT, 5).code, SQLITE_OK);
    /* What the sentence says is enough. */
    answer a = by_metric(s, RQT_METRIC_LOCAL, 5);
    const char *takes = strstr(a.error, "takes ");
    assert_non_null(takes);
    const long mib = strtol(takes + 6, NULL, 10);
    CHECK(mib > 2 && mib < 8, "%ld MiB", mib);
    store_limit_methods(s, (size_t)mib << 20);
    a = by_metric(s, RQT_METRIC_LOCAL, 5);
    CHECK(a.code == SQLITE_OK && a.triangles > 100, "%s", a.error);
    store_close(s);
    sqlite3_close(db);
}

static void metrics_make_room_for_each_other_within_the_limit(void **state) {
    (void)state;
    sqlite3 *db = memory_terrain(300, 300, 4, false);
    store *s;
    assert_int_equal(store_open(db, &s), SQLITE_OK);
    answer first[RQT_METRICS];
    for (int metric = 0; metric < RQT_METRICS; metric++) first[metric] = by_metric(s, (rqt_metric)metric, 5);
    const answer warm = by_metric(s, RQT_METRIC_EXACT, 0);
    (void)warm;
    store_limit_methods(s, (size_t)1400 << 10); /* one at a time */
    const sqlite3_int64 before = sqlite3_memory_used();
    sqlite3_memory_highwater(1);
    for (int round = 0; round < 3; round++)
        for (int metric = 0; metric < RQT_METRICS; metric++) {
            const answer a = by_metric(s, (rqt_metric)metric, 5);
            CHECK(same_answer(&a, &first[metric]), "round %d, %s: %s", round, rqt_metric_name((rqt_metric)metric),
                  a.error);
        }
    CHECK(sqlite3_memory_highwater(0) - before < 20 << 20, "%lld bytes at most",
          (long long)sqlite3_memory_highwater(0) - before);
    assert_true(sqlite3_memory_used() - before < (int64_t)12 << 20); /* blocks stay in their cache */
    store_close(s);
    sqlite3_close(db);
}

static void a_change_of_the_database_gives_the_memory_back(void **state) {
    (void)state;
    sqlite3 *db = memory_terrain(400, 300, 6, true);
    store *s;
    assert_int_equal(store_open(db, &s), SQLITE_OK);
    (void)by_metric(s, RQT_METRIC_EXACT, 1e6);
    const sqlite3_int64 before = sqlite3_memory_used();
    const answer a = by_metric(s, RQT_METRIC_MINIMAL, 1e6);
    const sqlite3_int64 with = sqlite3_memory_used();
    assert_true(with - before > 400 * 300 * 8);
    run(db, "CREATE TABLE other(x); INSERT INTO other VALUES(1)");
    (void)by_metric(s, RQT_METRIC_EXACT, 1e6);
    CHECK(sqlite3_memory_used() - before < 100000, "%lld bytes remain",
          (long long)(sqlite3_memory_used() - before));
    put_terrain(db, "t2", 20, 20, 2, 2, false);
    const answer b = by_metric(s, RQT_METRIC_MINIMAL, 1e6);
    assert_true(same_answer(&a, &b));
    store_close(s);
    sqlite3_close(db);
}

/* ----------------------------------------------------------------------------------------- short of memory */

static answer expected_answer[RQT_METRICS];

static int within(store *s, int64_t most, char **error) {
    const store_terrain *t;
    rqt_region *region = NULL;
    rqt_patch patch = {0};
    store_reads reads = {0};
    double achieved;
    int code = store_find(s, "t", &t, error);
    if (code == SQLITE_OK)
        code = store_fail_core(
            error, rqt_region_create(NULL, &t->placement, &t->lattice, store_allocator(), &region), "region");
    const store_query_options options = {.metric = RQT_METRIC_LOCAL, .wants_leaves = true};
    if (code == SQLITE_OK)
        code = store_query_within(s, t, region, 0, &options, most, &achieved, &patch, &reads, error);
    if (code == SQLITE_OK && (patch.vertex_count > (size_t)most || patch.vertex_count < 20 || achieved <= 0))
        code = -1;
    store_reads_free(&reads);
    rqt_patch_free(&patch);
    rqt_region_free(region);
    return code;
}

static int ask_all(sqlite3 *db, const char **step) {
    store *s = NULL;
    char *error = NULL;
    *step = "open";
    int code = store_open(db, &s);
    for (int metric = RQT_METRIC_MINIMAL; metric < RQT_METRICS && code == SQLITE_OK; metric++) {
        *step = rqt_metric_name((rqt_metric)metric);
        const answer a = by_metric(s, (rqt_metric)metric, 3);
        code = a.code;
        if (code == SQLITE_OK && !same_answer(&a, &expected_answer[metric])) code = -1;
    }
    *step = "budget";
    if (code == SQLITE_OK) code = within(s, 60, &error);
    sqlite3_free(error);
    store_close(s);
    return code;
}

static int store_minimal_errors(sqlite3 *db, const char **step) {
    char *error = NULL;
    *step = "write";
    int code = sqlite3_exec(db, "BEGIN IMMEDIATE", NULL, NULL, NULL) & 0xFF;
    if (code == SQLITE_OK) code = store_write_minimal(db, "t", NULL, NULL, &error);
    sqlite3_free(error);
    shortage.on = false;
    if (!sqlite3_get_autocommit(db)) run(db, "ROLLBACK");
    return code;
}

static int check_minimal_errors(sqlite3 *db, const char **step) {
    findings f = {0};
    store *s = NULL;
    const store_terrain *t;
    char *error = NULL;
    *step = "check";
    int code = store_open(db, &s);
    if (code == SQLITE_OK) code = store_find(s, "t", &t, &error);
    if (code == SQLITE_OK) code = store_check(s, t, add_finding, &f, &error);
    if (code == SQLITE_OK && f.count) code = -1;
    sqlite3_free(error);
    store_close(s);
    return code;
}

static void starve(const char *path, int (*work)(sqlite3 *db, const char **step)) {
    for (int later = 0; later < 2; later++) {
        for (long n = 1;; n++) {
            CHECK(n < 20000, "it never ends");
            const sqlite3_int64 used = sqlite3_memory_used();
            sqlite3 *db = open_database(path);
            const char *step = "";
            shortage.all_later = later;
            shortage.count = shortage.refused = 0;
            shortage.fail_at = n;
            shortage.on = true;
            const int code = work(db, &step);
            shortage.on = false;
            CHECK(code == SQLITE_OK || code == SQLITE_NOMEM, "request %ld refused%s: %s gives %d (%s)", n,
                  later ? ", and all later ones" : "", step, code,
                  code < 0 ? "a wrong answer" : sqlite3_errstr(code));
            assert_int_equal(sqlite3_close(db), SQLITE_OK);
            CHECK(sqlite3_memory_used() == used, "request %ld refused: %s leaves memory", n, step);
            if (!shortage.refused) break;
        }
    }
}

static void F48_memory_may_run_out_anywhere(void **state) {
    (void)state;
    char path[128];
    sqlite3 *db = open_database(scratch_file(path, "methods.db"));
    put_terrain(db, "t", 18, 11, 2, 1, false);
    store *s;
    assert_int_equal(store_open(db, &s), SQLITE_OK);
    for (int metric = 0; metric < RQT_METRICS; metric++)
        expected_answer[metric] = by_metric(s, (rqt_metric)metric, 3);
    store_close(s);
    sqlite3_close(db);
    starve(path, ask_all);
    starve(path, store_minimal_errors);
    db = open_database(path);
    run(db, "BEGIN");
    assert_int_equal(store_write_minimal(db, "t", NULL, NULL, NULL), SQLITE_OK);
    run(db, "COMMIT");
    sqlite3_close(db);
    starve(path, ask_all);
    starve(path, check_minimal_errors);
    remove_database(path);
}

/* ----------------------------------------------------------------------------------------- minimal, stored */

static bool stop_at_half(void *context, double done) {
    ++*(int *)context;
    return done < 0.5;
}

static void minimal_errors_are_stored_once_whole_or_not_at_all(void **state) {
    (void)state;
    sqlite3 *db = memory_terrain(70, 50, 3, true);
    char *error = NULL;
    int calls = 0;
    run(db, "BEGIN");
    assert_int_equal(store_write_minimal(db, "t", stop_at_half, &calls, &error), SQLITE_INTERRUPT);
    assert_true(calls > 5);
    run(db, "ROLLBACK");
    assert_string_equal(ask(db, "SELECT count(*) FROM sqlite_schema WHERE name LIKE '%minimal%'"), "0");
    assert_int_equal(store_write_minimal(db, "u", NULL, NULL, &error), SQLITE_ERROR);
    assert_non_null(strstr(error, "no terrain u"));
    sqlite3_free(error);
    error = NULL;
    const answer computed = query_database(db, 4, (store_query_options){.metric = RQT_METRIC_MINIMAL}),
                 tol = query_database(
                     db, 4, (store_query_options){.metric = RQT_METRIC_MINIMAL, .outline = RQT_OUTLINE_TOL});
    assert_int_equal(store_write_minimal(db, "t", NULL, NULL, &error), SQLITE_OK);
    assert_int_equal(store_write_minimal(db, "t", NULL, NULL, &error), SQLITE_ERROR);
    assert_non_null(strstr(error, "stored already"));
    sqlite3_free(error);
    const answer stored = query_database(db, 4, (store_query_options){.metric = RQT_METRIC_MINIMAL}),
                 stored_tol = query_database(
                     db, 4, (store_query_options){.metric = RQT_METRIC_MINIMAL, .outline = RQT_OUTLINE_TOL});
    assert_true(computed.triangles > 100 && same_answer(&computed, &stored));
    /* of the outline tol they are computed still: the stored ones are those of the outline exact */
    assert_true(same_answer(&tol, &stored_tol) && tol.hash != stored.hash);
    sqlite3_close(db);
}

static int countdown;

static int interrupt_soon(void *db) {
    if (--countdown == 0) sqlite3_interrupt(db);
    return 0;
}

static void an_interrupt_stops_computing(void **state) {
    (void)state;
    sqlite3 *db = memory_terrain(129, 129, 3, false);
    const answer right = query_database(db, 4, (store_query_options){.metric = RQT_METRIC_LOCAL});
    int interrupted = 0;
    for (int n = 1;; n += 1 + n / 4) {
        store *s;
        sqlite3_stmt *outer;
        assert_int_equal(store_open(db, &s), SQLITE_OK);
        assert_int_equal(sqlite3_prepare_v2(db, "SELECT 1 UNION ALL SELECT 2", -1, &outer, NULL), SQLITE_OK);
        assert_int_equal(sqlite3_step(outer), SQLITE_ROW);
        countdown = n;
        sqlite3_progress_handler(db, 1, interrupt_soon, db);
        const answer a = by_metric(s, RQT_METRIC_LOCAL, 4);
        sqlite3_progress_handler(db, 0, NULL, NULL);
        sqlite3_finalize(outer);
        store_close(s);
        CHECK(a.code == SQLITE_OK || a.code == SQLITE_INTERRUPT, "interrupted after %d: %d %s", n, a.code, a.error);
        if (a.code == SQLITE_OK) assert_true(same_answer(&a, &right));
        interrupted += a.code == SQLITE_INTERRUPT;
        if (countdown > 0) break;
    }
    assert_true(interrupted > 10);
    assert_int_equal(sqlite3_close(db), SQLITE_OK);
}

int main(void) {
    if (!install_memory()) return 1;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(too_little_memory_is_a_sentence_that_says_how_much),
        cmocka_unit_test(metrics_make_room_for_each_other_within_the_limit),
        cmocka_unit_test(a_change_of_the_database_gives_the_memory_back),
        cmocka_unit_test(F48_memory_may_run_out_anywhere),
        cmocka_unit_test(minimal_errors_are_stored_once_whole_or_not_at_all),
        cmocka_unit_test(an_interrupt_stops_computing),
    };
    return cmocka_run_group_tests_name("methods", tests, make_scratch, drop_scratch);
}
