/* test_store_faults.c - promises of the store when things go wrong: damage gives an error and never a partial
 * answer, hostile rows crash nothing, memory may run out anywhere, others may write, and nothing old is ever
 * served.
 *
 * SQLite's memory is replaced before its first use, by its own with a counter that can refuse: so that the whole
 * program runs on the allocator that test of memory needs. */
#include "test_store_support.h"

#include <pthread.h>

/* ------------------------------------------------------------------------------------------- failing memory */

static sqlite3_mem_methods real_memory;
static _Atomic long live_bytes;
static struct {
    bool on, all_later; /* refuse one request, or that and all later ones */
    long count, fail_at, refused;
} shortage; /* one thread only */

static bool refuse(void) {
    if (!shortage.on) return false;
    shortage.count++;
    const bool no = shortage.all_later ? shortage.count >= shortage.fail_at : shortage.count == shortage.fail_at;
    shortage.refused += no;
    return no;
}

static void *counting_malloc(int bytes) {
    void *p = refuse() ? NULL : real_memory.xMalloc(bytes);
    if (p) live_bytes += real_memory.xSize(p);
    return p;
}

static void counting_free(void *p) {
    live_bytes -= real_memory.xSize(p);
    real_memory.xFree(p);
}

static void *counting_realloc(void *p, int bytes) {
    if (refuse()) return NULL;
    const long before = real_memory.xSize(p);
    void *fresh = real_memory.xRealloc(p, bytes);
    if (fresh) live_bytes += real_memory.xSize(fresh) - before;
    return fresh;
}

static bool install_memory(void) {
    if (sqlite3_config(SQLITE_CONFIG_GETMALLOC, &real_memory) != SQLITE_OK) return false;
    sqlite3_mem_methods counting = real_memory;
    counting.xMalloc = counting_malloc;
    counting.xFree = counting_free;
    counting.xRealloc = counting_realloc;
    return sqlite3_config(SQLITE_CONFIG_MALLOC, &counting) == SQLITE_OK;
}

/* What a connection is asked while memory is short. Each step: SQLITE_OK with the right answer, or SQLITE_NOMEM. */
typedef struct expected {
    answer fine, coarse, closed;
    double height, mesh_height;
} expected;

static int read_everything(sqlite3 *db, const expected *right, const char **step) {
    store *s = NULL;
    const store_terrain *t = NULL;
    char *error = NULL;
    double metres;
    bool found;
    answer a;
    *step = "open";
    int code = store_open(db, &s);
    if (code != SQLITE_OK) return code;
    *step = "fine query";
    store_reads reads;
    a = query_store(s, "t", 0, by_threshold, &reads);
    code = a.code;
    if (code == SQLITE_OK && !same_answer(&a, &right->fine)) code = -1;
    store_reads_free(&reads);
    if (code == SQLITE_OK) {
        *step = "coarse query";
        a = query_store(s, "t", 8, by_threshold, NULL);
        code = a.code;
        if (code == SQLITE_OK && !same_answer(&a, &right->coarse)) code = -1;
    }
    if (code == SQLITE_OK) {
        *step = "closing query";
        a = query_store(s, "t", 3,
                        (store_query_options){.select = RQT_SELECT_BOTTOM_UP, .outline = RQT_OUTLINE_TOL}, NULL);
        code = a.code;
        if (code == SQLITE_OK && !same_answer(&a, &right->closed)) code = -1;
    }
    if (code == SQLITE_OK) {
        *step = "find";
        code = store_find(s, NULL, &t, &error);
    }
    if (code == SQLITE_OK) {
        *step = "height";
        code = store_height(s, t, 1003, 1998, -1, &metres, &found, &error);
        if (code == SQLITE_OK && (!found || metres != right->height)) code = -1;
    }
    if (code == SQLITE_OK) {
        *step = "height by eps";
        code = store_height(s, t, 1003, 1998, 2, &metres, &found, &error);
        if (code == SQLITE_OK && (!found || metres != right->mesh_height)) code = -1;
    }
    if (code == SQLITE_OK) {
        *step = "window";
        int32_t q[12];
        uint8_t valid[12];
        code = store_window(s, t, 3, 2, 4, 3, q, valid, &error);
    }
    if (code == SQLITE_OK) {
        *step = "normals";
        rqt_patch_vertex vertices[] = {{.col = 0, .row = 0}, {.col = 4, .row = 4}, {.col = 3, .row = 2}};
        const rqt_patch patch = {.vertices = vertices, .vertex_count = 3};
        float *normals = NULL;
        code = store_normals(s, t, &patch, &normals, &error);
        if (code == SQLITE_OK && !(normals[2] > 0 && normals[5] > 0 && normals[8] > 0)) code = -1;
        sqlite3_free(normals);
    }
    if (code == SQLITE_OK) {
        *step = "list";
        store_terrain *all;
        int count;
        code = store_terrains(s, &all, &count, &error);
        if (code == SQLITE_OK && count != 1) code = -1;
        if (code == SQLITE_OK) store_terrains_free(all, count);
    }
    sqlite3_free(error);
    store_close(s);
    return code;
}

static int check_everything(sqlite3 *db, const expected *right, const char **step) {
    (void)right;
    findings f = {0};
    store *s = NULL;
    const store_terrain *t;
    char *error = NULL;
    *step = "check";
    int code = store_open(db, &s);
    if (code == SQLITE_OK) code = store_find(s, "t", &t, &error);
    if (code == SQLITE_OK) code = store_check(s, t, add_finding, &f, &error);
    if (code == SQLITE_OK && f.count) code = -1;
    if (f.count) print_findings(&f);
    sqlite3_free(error);
    store_close(s);
    return code;
}

static int write_something(sqlite3 *db, const expected *right, const char **step) {
    (void)right;
    *step = "write";
    char *error = NULL;
    store_terrain info = {.name = "new",
                          .k = 0,
                          .placement = {0, 0, 1, -1},
                          .unit = test_unit,
                          .cost = {1, 1},
                          .crs = "",
                          .vertical = "",
                          .source = "",
                          .created = ""};
    (void)rqt_lattice_init(&info.lattice, 2, 2);
    store_writer *w = NULL;
    int code = sqlite3_exec(db, "BEGIN IMMEDIATE", NULL, NULL, NULL) & 0xFF;
    if (code == SQLITE_OK) code = store_make_geopackage(db, &error);
    if (code == SQLITE_OK) code = store_writer_begin(db, &info, true, &w, &error);
    const rqt_summary summary = {.tol = {0, RQT_CODE_INFINITY}, .exact = {0, RQT_CODE_INFINITY}};
    if (code == SQLITE_OK) code = store_writer_block(w, 1, &summary, (const uint8_t *)"bytes", 5, &error);
    if (code == SQLITE_OK) code = store_writer_finish(w, 0, &error);
    store_writer_free(w);
    sqlite3_free(error);
    shortage.on = false;
    if (code == SQLITE_OK &&
        strcmp(ask(db, "SELECT count(*) || (SELECT complete || blocks FROM rqt_terrain) FROM gpkg_contents"),
               "211"))
        code = -1;
    if (!sqlite3_get_autocommit(db)) run(db, "ROLLBACK"); /* without memory SQLite may have done it */
    return code;
}

static void starve(const char *path, const expected *right,
                   int (*work)(sqlite3 *db, const expected *right, const char **step)) {
    for (int later = 0; later < 2; later++) {
        for (long n = 1;; n++) {
            CHECK(n < 20000, "it never ends");
            const long before = live_bytes;
            const sqlite3_int64 used = sqlite3_memory_used();
            sqlite3 *db = open_database(path);
            const char *step = "";
            shortage.all_later = later;
            shortage.count = shortage.refused = 0;
            shortage.fail_at = n;
            shortage.on = true;
            const int code = work(db, right, &step);
            shortage.on = false;
            CHECK(code == SQLITE_OK || code == SQLITE_NOMEM, "request %ld refused%s: %s gives %d (%s)", n,
                  later ? ", and all later ones" : "", step, code,
                  code < 0 ? "a wrong answer" : sqlite3_errstr(code));
            CHECK(code == SQLITE_OK || shortage.refused > 0, "%s: no memory, though none was refused", step);
            assert_int_equal(sqlite3_close(db), SQLITE_OK);
            CHECK(live_bytes == before, "request %ld refused: %s leaves %ld bytes", n, step, live_bytes - before);
            assert_int_equal(sqlite3_memory_used(), used);
            if (!shortage.refused) break;
        }
    }
}

static void F48_memory_may_run_out_anywhere(void **state) {
    (void)state;
    char path[128];
    sqlite3 *db = open_database(scratch_file(path, "memory.db"));
    put_terrain(db, "t", 18, 11, 2, 1, false);
    expected right = {
        .fine = query_database(db, 0, by_threshold),
        .coarse = query_database(db, 8, by_threshold),
        .closed = query_database(
            db, 3, (store_query_options){.select = RQT_SELECT_BOTTOM_UP, .outline = RQT_OUTLINE_TOL})};
    store *s;
    const store_terrain *t;
    bool found;
    assert_int_equal(store_open(db, &s), SQLITE_OK);
    assert_int_equal(store_find(s, "t", &t, NULL), SQLITE_OK);
    assert_int_equal(store_height(s, t, 1003, 1998, -1, &right.height, &found, NULL), SQLITE_OK);
    assert_int_equal(store_height(s, t, 1003, 1998, 2, &right.mesh_height, &found, NULL), SQLITE_OK);
    assert_true(found && right.fine.triangles > right.coarse.triangles && right.closed.triangles > 0);
    store_close(s);
    sqlite3_close(db);
    starve(path, &right, read_everything);
    starve(path, &right, check_everything);
    remove_database(path);
    starve(":memory:", &right, write_something);
}

/* ------------------------------------------------------------------------------------------- damaged blobs */

static void F42_every_byte_of_a_block_and_of_a_summary_counts(void **state) {
    (void)state;
    sqlite3 *db = memory_terrain(5, 5, 2, false);
    const answer right = query_database(db, 0, by_threshold);
    assert_int_equal(right.code, SQLITE_OK);
    assert_true(right.triangles > 0);
    static const char *const columns[] = {"data", "summary"};
    store *s; /* one for all: what it keeps must not outlive a change */
    assert_int_equal(store_open(db, &s), SQLITE_OK);
    for (int c = 0; c < 2; c++) {
        size_t size;
        uint8_t *bytes = get_bytes(db, columns[c], 1, &size);
        for (size_t i = 0; i < size; i++) {
            for (int bit = 0; bit < 8; bit += 1 + c) {
                bytes[i] ^= (uint8_t)(1 << bit);
                set_bytes(db, columns[c], 1, bytes, size);
                const answer a = query_store(s, "t", 0, by_threshold, NULL);
                CHECK(a.code == SQLITE_CORRUPT_VTAB && a.triangles == 0, "%s, byte %zu, bit %d: %d, %zu triangles",
                      columns[c], i, bit, a.code, a.triangles);
                CHECK(strstr(a.error, "block 1") && strstr(a.error, "damaged"), "it says: %s", a.error);
                bytes[i] ^= (uint8_t)(1 << bit);
            }
        }
        for (size_t length = 0; length < size; length++) {
            set_bytes(db, columns[c], 1, bytes, length);
            const answer a = query_store(s, "t", 0, by_threshold, NULL);
            CHECK(a.code == SQLITE_CORRUPT_VTAB && a.triangles == 0, "%s cut at %zu: %d", columns[c], length,
                  a.code);
        }
        set_bytes(db, columns[c], 1, bytes, size);
        const answer a = query_store(s, "t", 0, by_threshold, NULL);
        assert_true(same_answer(&a, &right));
        free(bytes);
    }
    store_close(s);
    sqlite3_close(db);
}

static void F55_a_damaged_terrain_gives_an_error_or_the_right_answer(void **state) {
    (void)state;
    static const char *const damages[] = {
        "DELETE FROM rqt_block_1 WHERE id = 268",
        "DELETE FROM rqt_block_1 WHERE id = 67",
        "DELETE FROM rqt_block_1 WHERE id = 1",
        "DELETE FROM rqt_block_1",
        "DELETE FROM rqt_index_1 WHERE id = 268",
        "DELETE FROM rqt_index_1 WHERE id = 67",
        "DELETE FROM rqt_index_1 WHERE id = 1",
        "DELETE FROM rqt_index_1",
        "DROP TABLE rqt_block_1",
        "DROP TABLE rqt_index_1",
        "UPDATE rqt_index_1 SET tol1 = 65535, exact1 = 65535 WHERE id = 268",
        "UPDATE rqt_index_1 SET tol0 = 0, exact0 = 0",
        "UPDATE rqt_index_1 SET x1 = x0",
        "INSERT INTO rqt_block_1 SELECT id + 100000, summary, data FROM rqt_block_1;"
        "INSERT INTO rqt_index_1 SELECT id + 100000, 0, 39, 0, 32, 0, 65535, 0, 65535 FROM rqt_index_1",
        "INSERT INTO rqt_block_1 SELECT id - 100000, summary, data FROM rqt_block_1;"
        "INSERT INTO rqt_index_1 SELECT id - 100000, 0, 39, 0, 32, 0, 65535, 0, 65535 FROM rqt_index_1",
        "UPDATE rqt_block_1 SET data = (SELECT data FROM rqt_block_1 WHERE id = 1)", /* other widths */
        "UPDATE rqt_block_1 SET summary = (SELECT summary FROM rqt_block_1 WHERE id = 1)",
        "UPDATE rqt_block_1 SET summary = 'text'",
        "UPDATE rqt_block_1 SET data = 17",
        "UPDATE rqt_block_1 SET data = zeroblob(100000)",
        "UPDATE rqt_index_1_node SET data = zeroblob(length(data))",
        "UPDATE rqt_index_1_node SET data = randomblob(10)",
        "DELETE FROM rqt_index_1_node",
        "UPDATE rqt_terrain SET k = 3",
        /* from here on harmless: too much is found, and what is too much is not used */
        "UPDATE rqt_index_1 SET x0 = 0, x1 = 39, y0 = 0, y1 = 32",
        "UPDATE rqt_index_1 SET x0 = -2147483648, x1 = 2147483647",
        "INSERT INTO rqt_index_1 SELECT id + 100000, 0, 39, 0, 32, 0, 65535, 0, 65535 FROM rqt_index_1",
    };
    const size_t harmless = sizeof damages / sizeof *damages - 3;
    static const double eps[] = {0, 2, 13, 25, 50, 100, 1e6}; /* block 67 answers 25 */
    static const char *const regions[] = {NULL, "POLYGON((1150 1910, 1220 1910, 1220 1810, 1150 1810, 1150 1910))"};
    store *right_store, *s;
    sqlite3 *sound = memory_terrain(40, 33, 2, true);
    assert_int_equal(store_open(sound, &right_store), SQLITE_OK);
    for (size_t n = 0; n < sizeof damages / sizeof *damages; n++) {
        sqlite3 *db = memory_terrain(40, 33, 2, true);
        int errors = 0;
        run(db, "%s", damages[n]);
        assert_int_equal(store_open(db, &s), SQLITE_OK);
        for (size_t e = 0; e < sizeof eps / sizeof *eps; e++)
            for (int way = 0; way < 12; way++) {
                const store_query_options options = {.select = (rqt_select)(way % 3),
                                                     .outline = (rqt_outline)(way / 3 % 2)};
                const answer right = query_region(right_store, "t", regions[way / 6], eps[e], options, NULL);
                const answer a = query_region(s, "t", regions[way / 6], eps[e], options, NULL);
                if (a.code != SQLITE_OK) {
                    errors++;
                    assert_int_equal(a.triangles, 0);
                    CHECK(a.error[0], "%s: an error without a sentence", damages[n]);
                } else {
                    CHECK(same_answer(&a, &right), "%s: eps %g, way %d: %zu triangles, not %zu", damages[n], eps[e],
                          way, a.triangles, right.triangles);
                }
            }
        CHECK((errors > 0) == (n < harmless), "%s: %d errors", damages[n], errors);
        store_close(s);
        assert_int_equal(sqlite3_close(db), SQLITE_OK);
    }
    store_close(right_store);
    sqlite3_close(sound);
}

/* A region without area: the box of a point on a sample, or of a line along samples, has none either. */
static void a_hole_in_the_index_is_noticed_by_points_and_lines(void **state) {
    (void)state;
    static const char *const regions[] = {"POINT(1100 1900)", "LINESTRING(1090 1900, 1110 1900)",
                                          "LINESTRING(1100 1890, 1100 1910)"};
    sqlite3 *db = memory_terrain(40, 33, 2, false);
    for (int broken = 0; broken < 2; broken++) {
        store *s;
        const store_terrain *t;
        if (broken) run(db, "DELETE FROM rqt_index_1");
        assert_int_equal(store_open(db, &s), SQLITE_OK);
        for (int n = 0; n < 3; n++) {
            const answer a = query_region(s, "t", regions[n], 0, by_threshold, NULL);
            CHECK(a.code == (broken ? SQLITE_CORRUPT_VTAB : SQLITE_OK), "%s, %s index: %d, %zu triangles",
                  regions[n], broken ? "empty" : "whole", a.code, a.triangles);
            assert_int_equal(a.triangles == 0, broken);
        }
        assert_int_equal(store_find(s, "t", &t, NULL), SQLITE_OK);
        double metres;
        bool found;
        char *error = NULL;
        const int code = store_height(s, t, 1100, 1900, 1, &metres, &found, &error);
        assert_int_equal(code, broken ? SQLITE_CORRUPT_VTAB : SQLITE_OK);
        assert_int_equal(found, !broken);
        sqlite3_free(error);
        store_close(s);
    }
    sqlite3_close(db);
}

static void F55_absurd_rows_crash_nothing(void **state) {
    (void)state;
    static const char *const columns[] = {"id",
                                          "name",
                                          "format",
                                          "complete",
                                          "width",
                                          "height",
                                          "k",
                                          "x0",
                                          "y0",
                                          "dx",
                                          "dy",
                                          "z0",
                                          "d",
                                          "unit_numerator",
                                          "unit_denominator",
                                          "scale",
                                          "height_offset",
                                          "quantum_error",
                                          "cell",
                                          "void_tol",
                                          "srid",
                                          "lonlat",
                                          "wgs84",
                                          "crs",
                                          "vertical",
                                          "source",
                                          "created",
                                          "voids",
                                          "min_q",
                                          "max_q",
                                          "blocks",
                                          "bytes",
                                          "max_error"};
    static const char *const values[] = {"-1",
                                         "0",
                                         "1",
                                         "2",
                                         "7",
                                         "255",
                                         "65535",
                                         "1048577",
                                         "2147483647",
                                         "-2147483648",
                                         "4294967297",
                                         "9223372036854775807",
                                         "-9223372036854775808",
                                         "1e308",
                                         "-1e308",
                                         "1e-320",
                                         "9e999",
                                         "'text'",
                                         "x'00ff'",
                                         "printf('%.*c', 100000, 'a')"};
    sqlite3 *db = memory_terrain(18, 7, 2, true);
    int refused = 0;
    for (size_t c = 0; c < sizeof columns / sizeof *columns; c++) {
        for (size_t v = 0; v < sizeof values / sizeof *values; v++) {
            run(db, "SAVEPOINT before");
            char *sql = sqlite3_mprintf("UPDATE rqt_terrain SET %s = %s", columns[c], values[v]);
            const bool taken = sqlite3_exec(db, sql, NULL, NULL, NULL) == SQLITE_OK; /* id only takes integers */
            sqlite3_free(sql);
            if (!taken) assert_string_equal(columns[c], "id");
            store *s;
            const store_terrain *t = NULL;
            char *error = NULL;
            assert_int_equal(store_open(db, &s), SQLITE_OK);
            const int code = store_find(s, NULL, &t, &error);
            CHECK(code == SQLITE_OK || error, "%s = %s: an error without a sentence", columns[c], values[v]);
            refused += code != SQLITE_OK;
            if (code == SQLITE_OK) {
                int32_t q[4];
                uint8_t valid[4];
                double metres;
                bool found;
                for (int e = 0; e < 3; e++) {
                    const answer a = query_store(s, NULL, e * e, by_threshold, NULL);
                    CHECK(a.code == SQLITE_OK || a.error[0], "%s = %s: no sentence", columns[c], values[v]);
                }
                assert_int_equal(store_find(s, NULL, &t, &error), SQLITE_OK);
                (void)store_window(s, t, t->lattice.width - 1, t->lattice.height - 1, 1, 1, q, valid, NULL);
                (void)store_height(s, t, 1003, 1998, -1, &metres, &found, NULL);
                (void)store_height(s, t, 1003, 1998, 1, &metres, &found, NULL);
                /* sizes that are right for other terrains make check look for a million blocks: let it stop soon */
                findings f = {.most = 20};
                (void)store_check(s, t, add_finding, &f, &error);
            }
            sqlite3_free(error);
            store_close(s);
            run(db, "ROLLBACK TO before");
            run(db, "RELEASE before");
        }
    }
    assert_true(refused > 100);
    sqlite3_close(db);
}

/* ---------------------------------------------------------------------------------------- others, and time */

static void a_change_by_another_connection_is_seen_at_once(void **state) {
    (void)state;
    for (int wal = 0; wal < 2; wal++) {
        char path[128];
        sqlite3 *ours = open_database(scratch_file(path, "foreign.db"));
        if (wal) assert_string_equal(ask(ours, "PRAGMA journal_mode = wal"), "wal");
        put_terrain(ours, "t", 18, 7, 2, 1, false);
        sqlite3 *theirs = open_database(path);
        store *s;
        assert_int_equal(store_open(ours, &s), SQLITE_OK);
        answer last = query_store(s, "t", 0, by_threshold, NULL);
        assert_int_equal(last.code, SQLITE_OK);
        for (uint32_t round = 2; round < 8; round++) {
            if (round % 2) {
                put_terrain(theirs, "t", 18, 7, 2, round, false);
            } else { /* in place: the terrain and its tables stay, the blocks change */
                char *error = NULL;
                sqlite3 *mine = open_database(":memory:");
                put_terrain(mine, "t", 18, 7, 2, round, false);
                assert_null(error);
                run(mine, "ATTACH %Q AS f", path);
                const int id = atoi(ask(mine, "SELECT id FROM f.rqt_terrain"));
                run(mine,
                    "BEGIN; DELETE FROM f.rqt_block_%d; INSERT INTO f.rqt_block_%d SELECT * FROM main.rqt_block_1;"
                    "DELETE FROM f.rqt_index_%d; INSERT INTO f.rqt_index_%d SELECT * FROM main.rqt_index_1; COMMIT",
                    id, id, id, id);
                sqlite3_close(mine);
            }
            const answer now = query_store(s, "t", 0, by_threshold, NULL);
            const answer right = query_database(theirs, 0, by_threshold);
            CHECK(now.code == SQLITE_OK, "round %u: %s", round, now.error);
            CHECK(same_answer(&now, &right), "round %u, %s: an old answer", round, wal ? "WAL" : "journal");
            assert_true(now.hash != last.hash);
            last = now;
        }
        store_close(s);
        assert_int_equal(sqlite3_close(ours), SQLITE_OK);
        assert_int_equal(sqlite3_close(theirs), SQLITE_OK);
        remove_database(path);
    }
}

static void a_transaction_of_our_own_is_seen_and_its_rollback_too(void **state) {
    (void)state;
    for (int file = 0; file < 2; file++) {
        char path[128];
        sqlite3 *db = open_database(file ? scratch_file(path, "rollback.db") : ":memory:");
        put_terrain(db, "t", 18, 7, 2, 1, false);
        sqlite3 *other = open_database(":memory:");
        put_terrain(other, "t", 18, 7, 2, 2, false);
        const answer old = query_database(db, 0, by_threshold), fresh = query_database(other, 0, by_threshold);
        sqlite3_close(other);
        store *s;
        assert_int_equal(store_open(db, &s), SQLITE_OK);
        raster r = make_raster(18, 7, 2, false);
        for (int keep = 0; keep < 2; keep++) {
            char *error = NULL;
            answer a = query_store(s, "t", 0, by_threshold, NULL);
            assert_true(same_answer(&a, &old));
            run(db, "BEGIN IMMEDIATE");
            assert_int_equal(write_terrain(db, &r, "t", 2, true, true, &error), SQLITE_OK);
            a = query_store(s, "t", 0, by_threshold, NULL);
            CHECK(same_answer(&a, &fresh), "inside the transaction: %d %s", a.code, a.error);
            run(db, "SAVEPOINT inner; DELETE FROM rqt_block_%s", ask(db, "SELECT id FROM rqt_terrain"));
            a = query_store(s, "t", 0, by_threshold, NULL);
            assert_int_equal(a.code, SQLITE_CORRUPT_VTAB);
            run(db, "ROLLBACK TO inner");
            a = query_store(s, "t", 0, by_threshold, NULL);
            CHECK(same_answer(&a, &fresh), "after the savepoint: %d %s", a.code, a.error);
            run(db, keep ? "COMMIT" : "ROLLBACK");
            a = query_store(s, "t", 0, by_threshold, NULL);
            CHECK(same_answer(&a, keep ? &fresh : &old), "after the end: %d %s", a.code, a.error);
        }
        raster_free(&r);
        store_close(s);
        assert_int_equal(sqlite3_close(db), SQLITE_OK);
        if (file) remove_database(path);
    }
}

/* A rollback of rows alone changes no schema and no version: only that nothing is kept while we write helps. */
static void rows_that_we_change_and_roll_back_are_not_remembered(void **state) {
    (void)state;
    sqlite3 *db = open_database(":memory:");
    put_terrain(db, "t", 18, 7, 2, 1, false);
    store *s;
    assert_int_equal(store_open(db, &s), SQLITE_OK);
    double heights[3];
    const char *const before[3] = {
        "SELECT 1", "BEGIN IMMEDIATE; UPDATE rqt_terrain SET height_offset = height_offset + 1000", "ROLLBACK"};
    for (int step = 0; step < 3; step++) {
        const store_terrain *t;
        char *error = NULL;
        bool found;
        run(db, before[step]);
        assert_int_equal(store_find(s, "t", &t, &error), SQLITE_OK);
        const double x = t->placement.x0 + 3 * t->placement.dx, y = t->placement.y0 + 2 * t->placement.dy;
        assert_int_equal(store_height(s, t, x, y, -1, &heights[step], &found, &error), SQLITE_OK);
        assert_true(found);
    }
    assert_true(heights[1] == heights[0] + 1000);
    assert_true(heights[2] == heights[0]);
    store_close(s);
    assert_int_equal(sqlite3_close(db), SQLITE_OK);
}

static void F53_vacuum_and_close_succeed_after_queries(void **state) {
    (void)state;
    char path[128];
    sqlite3 *db = open_database(scratch_file(path, "vacuum.db"));
    put_terrain(db, "t", 40, 33, 2, 1, false);
    store *s;
    assert_int_equal(store_open(db, &s), SQLITE_OK);
    const answer before = query_store(s, "t", 0, by_threshold, NULL);
    assert_int_equal(before.code, SQLITE_OK);
    run(db, "VACUUM");
    answer after = query_store(s, "t", 0, by_threshold, NULL);
    assert_true(same_answer(&before, &after));
    run(db, "UPDATE rqt_block_1 SET data = x'00'");
    after = query_store(s, "t", 0, by_threshold, NULL); /* an error leaves no cursor open either */
    assert_int_equal(after.code, SQLITE_CORRUPT_VTAB);
    run(db, "VACUUM");
    run(db, "DROP TABLE rqt_index_1");
    store_release(s);
    assert_ptr_equal(sqlite3_next_stmt(db, NULL), NULL);
    store_release(s);
    assert_int_equal(sqlite3_close(db), SQLITE_OK);
    store_close(s); /* the order of a host that closes its connection first: nothing of it is left to finalise */
    remove_database(path);
}

static int countdown;

static int interrupt_soon(void *db) {
    if (--countdown == 0) sqlite3_interrupt(db);
    return 0;
}

/* As a query runs inside a host: a statement is under way all the time, or SQLite forgets the interrupt. */
static void F54_an_interrupt_stops_a_query_and_leaves_nothing_behind(void **state) {
    (void)state;
    sqlite3 *db = memory_terrain(65, 65, 2, false);
    const answer right = query_database(db, 0, by_threshold);
    store *s;
    assert_int_equal(store_open(db, &s), SQLITE_OK);
    int interrupted = 0, n = 1;
    for (;; n += 1 + n / 8) {
        sqlite3_stmt *outer;
        assert_int_equal(sqlite3_prepare_v2(db, "SELECT 1 UNION ALL SELECT 2", -1, &outer, NULL), SQLITE_OK);
        assert_int_equal(sqlite3_step(outer), SQLITE_ROW);
        countdown = n;
        sqlite3_progress_handler(db, 1, interrupt_soon, db);
        const answer a = query_store(s, "t", 0, by_threshold, NULL);
        sqlite3_progress_handler(db, 0, NULL, NULL);
        sqlite3_finalize(outer);
        CHECK(a.code == SQLITE_OK || a.code == SQLITE_INTERRUPT, "interrupted after %d: %d %s", n, a.code, a.error);
        if (a.code == SQLITE_OK) {
            assert_true(same_answer(&a, &right));
            if (countdown > 0) break;
        } else {
            interrupted++;
            assert_int_equal(a.triangles, 0);
        }
    }
    assert_true(interrupted > 20);
    const answer a = query_store(s, "t", 0, by_threshold, NULL);
    assert_true(same_answer(&a, &right));
    store_close(s);
    assert_int_equal(sqlite3_close(db), SQLITE_OK);
}

static struct {
    int countdown;
    sqlite3 *theirs;
} foreign;

/* Commits new blocks through the other connection, once. */
static int commit_soon(void *context) {
    (void)context;
    if (--foreign.countdown == 0)
        run(foreign.theirs,
            "BEGIN; DELETE FROM rqt_block_1; INSERT INTO rqt_block_1 SELECT * FROM fresh.rqt_block_1;"
            "DELETE FROM rqt_index_1; INSERT INTO rqt_index_1 SELECT * FROM fresh.rqt_index_1; COMMIT");
    return 0;
}

/* Without a transaction of the caller's: a query still is one moment, or an error. */
static void a_commit_in_the_middle_of_a_query_is_not_mixed_in(void **state) {
    (void)state;
    char path[2][128];
    for (uint32_t n = 0; n < 2; n++) {
        sqlite3 *db = open_database(scratch_file(path[n], n ? "fresh.db" : "mixed.db"));
        assert_string_equal(ask(db, "PRAGMA journal_mode = wal"), "wal");
        put_terrain(db, "t", 18, 7, 2, n + 1, false);
        sqlite3_close(db);
    }
    sqlite3 *fresh_db = open_database(path[1]), *old_db = open_database(":memory:");
    put_terrain(old_db, "t", 18, 7, 2, 1, false);
    const answer old = query_database(old_db, 0, by_threshold), fresh = query_database(fresh_db, 0, by_threshold);
    sqlite3_close(old_db);
    sqlite3_close(fresh_db);
    int mixed = 0, n = 1;
    for (;; n += 1 + n / 16) {
        char copy[128];
        sqlite3 *db = open_database(scratch_file(copy, "copy.db"));
        assert_string_equal(ask(db, "PRAGMA journal_mode = wal"), "wal");
        put_terrain(db, "t", 18, 7, 2, 1, false);
        foreign.theirs = open_database(copy);
        run(foreign.theirs, "ATTACH %Q AS fresh", path[1]);
        foreign.countdown = n;
        store *s;
        assert_int_equal(store_open(db, &s), SQLITE_OK);
        sqlite3_progress_handler(db, 1, commit_soon, NULL);
        const answer a = query_store(s, "t", 0, by_threshold, NULL);
        sqlite3_progress_handler(db, 0, NULL, NULL);
        mixed += a.code == SQLITE_OK && !same_answer(&a, &old) && !same_answer(&a, &fresh);
        store_close(s);
        assert_int_equal(sqlite3_close(db), SQLITE_OK);
        assert_int_equal(sqlite3_close(foreign.theirs), SQLITE_OK);
        remove_database(copy);
        if (foreign.countdown > 0) break;
    }
    for (int i = 0; i < 2; i++) remove_database(path[i]);
    CHECK(n > 50, "the query takes no more than %d steps", n);
    CHECK(mixed == 0, "%d answers are neither the old nor the new terrain", mixed);
}

/* ---------------------------------------------------------------------------------------- readers and writer */

enum { VERSIONS = 25, READERS = 2 };

typedef struct reader {
    pthread_t thread;
    const char *path;
    const answer *right; /* of each version */
    int reads, wrong, versions_seen;
    char error[256];
} reader;

static _Atomic bool writing;

static void *read_on(void *context) {
    reader *r = context;
    sqlite3 *db = NULL;
    store *s = NULL;
    int last = -1;
    if (sqlite3_open(r->path, &db) != SQLITE_OK || store_open(db, &s) != SQLITE_OK) r->wrong++;
    sqlite3_busy_timeout(db, 5000);
    for (bool more = true; s && more;) {
        more = writing;
        sqlite3_exec(db, "BEGIN", NULL, NULL, NULL);
        const answer a = query_store(s, "t", 0, by_threshold, NULL), b = query_store(s, "t", 0, by_threshold, NULL);
        sqlite3_exec(db, "COMMIT", NULL, NULL, NULL);
        int version = VERSIONS - 1;
        while (version >= 0 && !same_answer(&a, &r->right[version])) version--;
        if (version < last || version < 0 || !same_answer(&a, &b)) {
            r->wrong++;
            snprintf(r->error, sizeof r->error, "version %d after %d: %d %.200s", version, last, a.code, a.error);
        }
        r->versions_seen += version != last;
        last = version;
        r->reads++;
    }
    if (last != VERSIONS - 1) r->wrong++; /* the last read began after the last commit */
    store_close(s);
    sqlite3_close(db);
    return NULL;
}

static void F51_two_readers_and_a_writer_never_see_half_a_terrain(void **state) {
    (void)state;
    char path[128];
    answer right[VERSIONS];
    for (uint32_t v = 0; v < VERSIONS; v++) {
        sqlite3 *db = open_database(":memory:");
        put_terrain(db, "t", 40, 33, 2, v, false);
        right[v] = query_database(db, 0, by_threshold);
        sqlite3_close(db);
    }
    sqlite3 *db = open_database(scratch_file(path, "wal.db"));
    assert_string_equal(ask(db, "PRAGMA journal_mode = wal"), "wal");
    run(db, "PRAGMA synchronous = off");
    put_terrain(db, "t", 40, 33, 2, 0, false);
    reader readers[READERS] = {0};
    writing = true;
    for (int n = 0; n < READERS; n++) {
        readers[n].path = path;
        readers[n].right = right;
        assert_int_equal(pthread_create(&readers[n].thread, NULL, read_on, &readers[n]), 0);
    }
    for (uint32_t v = 1; v < VERSIONS; v++) {
        put_terrain(db, "t", 40, 33, 2, v, false);
        sqlite3_sleep(10);
    }
    writing = false;
    for (int n = 0; n < READERS; n++) {
        pthread_join(readers[n].thread, NULL);
        CHECK(readers[n].wrong == 0, "reader %d: %d of %d reads are wrong: %s", n, readers[n].wrong,
              readers[n].reads, readers[n].error);
        assert_true(readers[n].versions_seen > 2);
    }
    assert_int_equal(sqlite3_close(db), SQLITE_OK);
    remove_database(path);
}

int main(void) {
    if (!install_memory()) return 1;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(F48_memory_may_run_out_anywhere),
        cmocka_unit_test(F42_every_byte_of_a_block_and_of_a_summary_counts),
        cmocka_unit_test(F55_a_damaged_terrain_gives_an_error_or_the_right_answer),
        cmocka_unit_test(a_hole_in_the_index_is_noticed_by_points_and_lines),
        cmocka_unit_test(F55_absurd_rows_crash_nothing),
        cmocka_unit_test(a_change_by_another_connection_is_seen_at_once),
        cmocka_unit_test(a_transaction_of_our_own_is_seen_and_its_rollback_too),
        cmocka_unit_test(rows_that_we_change_and_roll_back_are_not_remembered),
        cmocka_unit_test(F53_vacuum_and_close_succeed_after_queries),
        cmocka_unit_test(F54_an_interrupt_stops_a_query_and_leaves_nothing_behind),
        cmocka_unit_test(a_commit_in_the_middle_of_a_query_is_not_mixed_in),
        cmocka_unit_test(F51_two_readers_and_a_writer_never_see_half_a_terrain),
    };
    return cmocka_run_group_tests_name("store faults", tests, make_scratch, drop_scratch);
}
