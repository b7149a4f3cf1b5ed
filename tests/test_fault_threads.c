/* test_fault_threads.c - F51: two readers and a writer. Readers ask through the SQL functions, each on a connection
 * of its own; the writer is an import that replaces the terrain, with threads of its own, again and again. No
 * reader ever sees half a terrain, an older one after a newer one, or two in one transaction. `make test-threads`
 * runs this under ThreadSanitizer. */
#include "test_fault_support.h"

#include "parts.h"

#include <pthread.h>
#include <stdatomic.h>

enum { READERS = 2, VERSIONS = 8, QUESTIONS = 3 };

static const char *const questions[QUESTIONS] = {
    "SELECT * FROM rqt_triangles(NULL, 0)",
    "SELECT max_error <= 3, t_junctions, overlaps, uncovered, vertices, x, y FROM rqt_verify(NULL, 3)",
    "SELECT rqt_mesh(rqt_bbox(-71.4, 44.2, -71.25, 44.3), 2, 'rqt'), rqt_height(-71.3033, 44.2705)"};

static atomic_bool writing;

typedef struct reader {
    pthread_t thread;
    const char *path;
    const sql_answer (*right)[QUESTIONS]; /* of each version */
    int reads, wrong, versions_seen;
    char error[600];
} reader;

static void *read_on(void *context) {
    reader *r = context;
    sqlite3 *db = NULL;
    int last = -1;
    if (sqlite3_open_v2(r->path, &db, SQLITE_OPEN_READONLY, NULL) != SQLITE_OK ||
        sqlite3_rqt_init(db, NULL, NULL) != SQLITE_OK)
        r->wrong++;
    sqlite3_busy_timeout(db, 10000);
    for (bool more = true; more && r->wrong == 0; r->reads++) {
        more = writing; /* the last time after the writer's last commit */
        sqlite3_exec(db, "BEGIN", NULL, NULL, NULL);
        int version = -1;
        for (int q = 0; q < QUESTIONS; q++) {
            const sql_answer a = ask_statement(db, questions[q]);
            int v = q > 0 ? version : VERSIONS - 1;
            while (v >= 0 && !same_sql_answer(&a, &r->right[v][q])) v--;
            if (v < 0 || v < last || (q > 0 && v != version)) {
                r->wrong++;
                snprintf(r->error, sizeof r->error, "version %d after %d, question %d: code %d %s", v, last, q,
                         a.code, a.error);
            }
            version = v;
        }
        sqlite3_exec(db, "COMMIT", NULL, NULL, NULL);
        r->versions_seen += version != last;
        last = version;
    }
    if (r->wrong == 0 && last != VERSIONS - 1) {
        r->wrong++;
        snprintf(r->error, sizeof r->error, "the last version read is %d", last);
    }
    sqlite3_close(db);
    return NULL;
}

static void write_version(const char *path, int version) {
    import_options o = demo_options();
    o.minimal = false;
    o.jobs = 2;
    o.replace = version > 0;
    import_fine(demo_raster("version.tif", 10 * version), path, &o);
}

static void F51_two_readers_and_an_import_never_see_half_a_terrain(void **unused) {
    (void)unused;
    static sql_answer right[VERSIONS][QUESTIONS];
    const file_path single = path_of("single.gpkg"), shared = path_of("shared.gpkg");
    for (int v = 0; v < VERSIONS; v++) {
        sqlite3 *db;
        remove_file_and_company(single.text);
        write_version(single.text, 0);
        if (v > 0) write_version(single.text, v);
        assert_int_equal(sqlite3_open(single.text, &db), SQLITE_OK);
        assert_int_equal(sqlite3_rqt_init(db, NULL, NULL), SQLITE_OK);
        for (int q = 0; q < QUESTIONS; q++) {
            right[v][q] = ask_statement(db, questions[q]);
            CHECK(right[v][q].code == SQLITE_OK, "%s", right[v][q].error);
        }
        sqlite3_close(db);
    }

    write_version(shared.text, 0);
    sqlite3 *db;
    assert_int_equal(sqlite3_open(shared.text, &db), SQLITE_OK);
    assert_int_equal(sqlite3_exec(db, "PRAGMA journal_mode = wal", NULL, NULL, NULL), SQLITE_OK);
    reader readers[READERS] = {{0}};
    writing = true;
    for (int n = 0; n < READERS; n++) {
        readers[n].path = shared.text;
        readers[n].right = (const sql_answer(*)[QUESTIONS])right;
        assert_int_equal(pthread_create(&readers[n].thread, NULL, read_on, &readers[n]), 0);
    }
    for (int v = 1; v < VERSIONS; v++) {
        write_version(shared.text, v);
        usleep(20000);
    }
    writing = false;
    for (int n = 0; n < READERS; n++) {
        pthread_join(readers[n].thread, NULL);
        printf("reader %d: %d times, %d versions\n", n, readers[n].reads, readers[n].versions_seen);
        CHECK(readers[n].wrong == 0, "reader %d: %s", n, readers[n].error);
        assert_true(readers[n].versions_seen > 1);
    }
    sqlite3_close(db);
}

/* Reader, workers and the writer, with buffers so small that they wait for each other: in memory, and read twice.
 */
static void the_threads_of_an_import_make_the_bytes_of_one(void **unused) {
    (void)unused;
    enum { WIDTH = 61, HEIGHT = 47 };
    static double values[WIDTH * HEIGHT];
    fill(values, WIDTH, HEIGHT, 1);
    raster r = {.name = "many.tif", .width = WIDTH, .height = HEIGHT, .type = GDT_Int16, .nodata = "303"};
    const file_path one = path_of("one.gpkg"), many = path_of("many.gpkg");
    const char *source = write_raster(&r, values);
    import_options o = demo_options();
    o.minimal = false;
    import_fine(source, one.text, &o);
    for (int twice = 0; twice < 2; twice++) {
        const import_force force = {.in_memory = !twice,
                                    .two_readings = twice,
                                    .b = 4,
                                    .strip_rows = 4,
                                    .strips = 3,
                                    .stage = -1,
                                    .kept = -1};
        o.jobs = 3;
        remove_file_and_company(many.text);
        CHECK(import_run_forced(&source, 1, many.text, &o, &force, &report, message, sizeof message) == 0, "%s",
              message);
        expect_same_tables(one.text, many.text);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(F51_two_readers_and_an_import_never_see_half_a_terrain, begin),
        cmocka_unit_test_setup(the_threads_of_an_import_make_the_bytes_of_one, begin),
    };
    alarm(300);
    return cmocka_run_group_tests_name("threads", tests, begin_all, end_all);
}
