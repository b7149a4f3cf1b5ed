/* bench.c - what rqt costs beside what GDAL costs, in one run on one machine.
 *
 *     bench DATABASE EXTENSION GEOTIFF TIMES CSV MACHINE DATA [LARGE]
 *
 * DATABASE holds one terrain, the same raster as GEOTIFF; a table of places is added to it. TIMES has the times of
 * whole programs and the sizes of their files, measured by bench.sh: lines of a word and a number. LARGE is a
 * database whose terrain holds the same samples in its north-west corner and many more.
 *
 * Runs of what is compared alternate in short bursts, so that a busy machine is busy for both; the table shows the
 * median of all, the least and the most.
 */
#include "bench.h"

#include <gdal.h>
#include <sqlite3.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { WINDOW = 512, BURSTS = 7, BURST = 5, FRESH = 15, PLACES = 100000 };

static const double EPS[] = {5, 20};
enum { EPS_COUNT = sizeof EPS / sizeof *EPS };
static const bench_aim WARM_AIM[EPS_COUNT] = {{BENCH_AT_MOST, 0.7}, {BENCH_AT_MOST, 0.15}},
                       FRESH_AIM[EPS_COUNT] = {{BENCH_AT_MOST, 1.2}, {BENCH_AT_MOST, 0.5}};
static const bench_aim NO_AIM = {BENCH_NO_AIM, 0};

static const char *database_path, *extension_path, *raster_path;
static int col0, row0;  /* of the window */
static double box[4];   /* the window in CRS units: x0, y0, x1, y1 */
static double whole[4]; /* the terrain */

/* ------------------------------------------------------------------------------------------------ SQLite -- */
static sqlite3 *open_database(bool writable) {
    return bench_open(database_path, extension_path, writable);
}

/* ?1 .. ?4: the box, ?5: eps */
static void bind_window(sqlite3_stmt *statement, double eps) {
    for (int i = 0; i < 4; i++) sqlite3_bind_double(statement, i + 1, box[i]);
    sqlite3_bind_double(statement, 5, eps);
}

static void find_window(void) {
    sqlite3 *db = open_database(false);
    sqlite3_stmt *s = bench_prepare(db, "SELECT width, height, x0, y0, dx, dy FROM rqt_terrains");
    if (sqlite3_step(s) != SQLITE_ROW) bench_stop(database_path, "no terrain");
    const int width = sqlite3_column_int(s, 0), height = sqlite3_column_int(s, 1);
    const double x0 = sqlite3_column_double(s, 2), y0 = sqlite3_column_double(s, 3),
                 dx = sqlite3_column_double(s, 4), dy = sqlite3_column_double(s, 5);
    if (width <= WINDOW || height <= WINDOW) bench_stop(database_path, "the terrain is smaller than the window");
    col0 = (width - WINDOW) / 2;
    row0 = (height - WINDOW) / 2;
    const double corners[] = {x0 + col0 * dx, y0 + (row0 + WINDOW) * dy, x0 + (col0 + WINDOW) * dx, y0 + row0 * dy};
    memcpy(box, corners, sizeof box);
    const double all[] = {x0, y0 + (height - 1) * dy, x0 + (width - 1) * dx, y0};
    memcpy(whole, all, sizeof whole);
    sqlite3_finalize(s);
    sqlite3_close(db);
}

/* -------------------------------------------------------------------------------------------- the window -- */
/* GDAL reads the window's heights from a file that it has just opened: its block cache is empty. */
static void read_window(bench_times *read, bench_times *open_and_read) {
    static int16_t heights[(WINDOW + 1) * (WINDOW + 1)];
    const double begin = bench_now();
    GDALDatasetH raster = GDALOpen(raster_path, GA_ReadOnly);
    if (!raster) bench_stop(raster_path, "GDAL cannot open it");
    const double opened = bench_now();
    if (GDALRasterIO(GDALGetRasterBand(raster, 1), GF_Read, col0, row0, WINDOW + 1, WINDOW + 1, heights, WINDOW + 1,
                     WINDOW + 1, GDT_Int16, 0, 0) != CE_None)
        bench_stop(raster_path, "GDAL cannot read it");
    const double end = bench_now();
    GDALClose(raster);
    bench_add(read, end - opened);
    bench_add(open_and_read, end - begin);
}

static const char STRIP[] = "SELECT rqt_mesh(rqt_bbox(?1, ?2, ?3, ?4), ?5, 'strip')";

static void ask_fresh(double eps, bench_times *opening, bench_times *query) {
    const double begin = bench_now();
    sqlite3 *db = open_database(false);
    const double opened = bench_now();
    sqlite3_stmt *s = bench_prepare(db, STRIP);
    bind_window(s, eps);
    bench_run(s, NULL);
    bench_add(query, bench_now() - opened);
    bench_add(opening, opened - begin);
    sqlite3_finalize(s);
    sqlite3_close(db);
}

static double single(sqlite3 *db, const char *sql, double eps) {
    sqlite3_stmt *s = bench_prepare(db, sql);
    bind_window(s, eps);
    if (sqlite3_step(s) != SQLITE_ROW) bench_stop(sql, sqlite3_errmsg(db));
    const double value = sqlite3_column_double(s, 0);
    sqlite3_finalize(s);
    return value;
}

static void bench_window(bench_table *table) {
    static bench_times gdal, gdal_open, opening, warm[EPS_COUNT], fresh[EPS_COUNT];
    sqlite3 *db = open_database(false);
    sqlite3_stmt *s[EPS_COUNT];
    int64_t bytes[EPS_COUNT];
    for (int e = 0; e < EPS_COUNT; e++) {
        s[e] = bench_prepare(db, STRIP);
        bind_window(s[e], EPS[e]);
        bench_run(s[e], &bytes[e]);
    }
    for (int burst = 0; burst < BURSTS; burst++) {
        for (int i = 0; i < BURST; i++) read_window(&gdal, &gdal_open);
        for (int e = 0; e < EPS_COUNT; e++) {
            bench_run(s[e], NULL); /* the others have had the processor's caches */
            for (int i = 0; i < BURST; i++) {
                const double begin = bench_now();
                bench_run(s[e], NULL);
                bench_add(&warm[e], bench_now() - begin);
            }
        }
    }
    for (int i = 0; i < FRESH; i++)
        for (int e = 0; e < EPS_COUNT; e++) ask_fresh(EPS[e], &opening, &fresh[e]);

    bench_table_section(
        table, "window",
        "A 513 x 513 window from the middle: a strip BLOB through SQL, and GDAL's read of its heights", "of GDAL");
    bench_table_row(table, "GDAL, ZSTD GeoTIFF: read", &gdal, "ms", 1e3, false, NULL, NULL, NO_AIM);
    bench_table_row(table, "GDAL, ZSTD GeoTIFF: open and read", &gdal_open, "ms", 1e3, false, "GDAL read", &gdal,
                    NO_AIM);
    for (int e = 0; e < EPS_COUNT; e++) {
        char what[64];
        snprintf(what, sizeof what, "eps %g, warm", EPS[e]);
        bench_table_row(table, what, &warm[e], "ms", 1e3, false, "GDAL read", &gdal, WARM_AIM[e]);
        snprintf(what, sizeof what, "eps %g, first query of a connection", EPS[e]);
        bench_table_row(table, what, &fresh[e], "ms", 1e3, false, "GDAL read", &gdal, FRESH_AIM[e]);
    }
    bench_table_row(table, "open a connection and load rqt.so", &opening, "ms", 1e3, false, "GDAL read", &gdal,
                    NO_AIM);

    bench_table_section(table, "window size", "What those answers are", NULL);
    for (int e = 0; e < EPS_COUNT; e++) {
        static const struct {
            const char *what, *unit, *sql;
        } counts[] = {
            {"vertices", "", "SELECT count(*) FROM rqt_range(rqt_bbox(?1, ?2, ?3, ?4), ?5)"},
            {"triangles", "", "SELECT count(*) FROM rqt_triangles(rqt_bbox(?1, ?2, ?3, ?4), ?5)"},
            {"blocks that answer", "", "SELECT count(*) FROM rqt_explain(rqt_bbox(?1, ?2, ?3, ?4), ?5)"},
            {"blocks read", "", "SELECT count(nullif(bytes, 0)) FROM rqt_explain(rqt_bbox(?1, ?2, ?3, ?4), ?5)"},
            {"bytes read", "kB", "SELECT sum(bytes) / 1e3 FROM rqt_explain(rqt_bbox(?1, ?2, ?3, ?4), ?5)"},
        };
        char what[64];
        for (size_t c = 0; c < sizeof counts / sizeof *counts; c++) {
            snprintf(what, sizeof what, "eps %g: %s", EPS[e], counts[c].what);
            bench_table_count(table, what, single(db, counts[c].sql, EPS[e]), counts[c].unit, NULL, 1, NO_AIM);
        }
        snprintf(what, sizeof what, "eps %g: strip BLOB", EPS[e]);
        bench_table_count(table, what, (double)bytes[e] / 1e3, "kB", NULL, 1, NO_AIM);
        sqlite3_finalize(s[e]);
    }
    sqlite3_close(db);
}

/* ---------------------------------------------------------------------------------- the large database -- */
enum { OVERVIEW_TRIANGLES = 10000 };

/* The eps of the whole terrain's mesh of about so many triangles: halving. */
static double overview_eps(sqlite3 *db) {
    double low = 1, high = 4000;
    sqlite3_stmt *s = bench_prepare(db, "SELECT count(*) FROM rqt_triangles(NULL, ?1)");
    for (int i = 0; i < 12; i++) {
        const double middle = (low + high) / 2;
        sqlite3_bind_double(s, 1, middle);
        if (sqlite3_step(s) != SQLITE_ROW) bench_stop("overview", sqlite3_errmsg(db));
        *(sqlite3_column_int64(s, 0) > OVERVIEW_TRIANGLES ? &low : &high) = middle;
        sqlite3_reset(s);
    }
    sqlite3_finalize(s);
    return high;
}

static void bench_large(bench_table *table, const char *large_path) {
    static bench_times small[EPS_COUNT], large[EPS_COUNT], overview;
    sqlite3 *db[2] = {open_database(false), bench_open(large_path, extension_path, false)};
    bench_table_section(table, "large", "The same window out of a database 32 times as large", "of small");
    for (int e = 0; e < EPS_COUNT; e++) {
        sqlite3_stmt *s[2];
        for (int d = 0; d < 2; d++) {
            s[d] = bench_prepare(db[d], STRIP);
            bind_window(s[d], EPS[e]);
        }
        for (int burst = 0; burst < BURSTS; burst++)
            for (int d = 0; d < 2; d++) {
                bench_run(s[d], NULL);
                for (int i = 0; i < BURST; i++) {
                    const double begin = bench_now();
                    bench_run(s[d], NULL);
                    bench_add(d ? &large[e] : &small[e], bench_now() - begin);
                }
            }
        sqlite3_finalize(s[0]);
        sqlite3_finalize(s[1]);
        char what[64];
        snprintf(what, sizeof what, "eps %g, warm, small database", EPS[e]);
        bench_table_row(table, what, &small[e], "ms", 1e3, false, NULL, NULL, NO_AIM);
        snprintf(what, sizeof what, "eps %g, warm, large database", EPS[e]);
        bench_table_row(table, what, &large[e], "ms", 1e3, false, "small", &small[e],
                        (bench_aim){BENCH_AT_MOST, 1.3});
    }
    const double eps = overview_eps(db[1]);
    sqlite3_stmt *s = bench_prepare(db[1], "SELECT rqt_mesh(NULL, ?1, 'strip')");
    sqlite3_bind_double(s, 1, eps);
    bench_run(s, NULL);
    for (int i = 0; i < BURSTS * BURST; i++) {
        const double begin = bench_now();
        bench_run(s, NULL);
        bench_add(&overview, bench_now() - begin);
    }
    sqlite3_finalize(s);
    char what[64];
    snprintf(what, sizeof what, "overview of %d triangles (eps %.0f)", OVERVIEW_TRIANGLES, eps);
    bench_table_row(table, what, &overview, "ms", 1e3, false, NULL, NULL, NO_AIM);
    sqlite3_close(db[0]);
    sqlite3_close(db[1]);
}

/* ------------------------------------------------------------------------------------- whole programs -- */
static bench_times imports, large_imports;
static double large_samples, large_rss;
static bench_times cog, cog_threads, updates;
static double database_bytes, cog_bytes, samples;

static void read_times(const char *path) {
    FILE *in = fopen(path, "r");
    if (!in) bench_stop(path, "cannot be read");
    char what[32];
    double value;
    while (fscanf(in, "%31s %lf", what, &value) == 2) {
        if (!strcmp(what, "import")) bench_add(&imports, value);
        if (!strcmp(what, "large_import")) bench_add(&large_imports, value);
        if (!strcmp(what, "large_samples")) large_samples = value;
        if (!strcmp(what, "large_rss_kib") && value > large_rss) large_rss = value;
        if (!strcmp(what, "update")) bench_add(&updates, value);
        if (!strcmp(what, "cog")) bench_add(&cog, value);
        if (!strcmp(what, "cog_threads")) bench_add(&cog_threads, value);
        if (!strcmp(what, "database_bytes")) database_bytes = value;
        if (!strcmp(what, "cog_bytes")) cog_bytes = value;
        if (!strcmp(what, "samples")) samples = value;
    }
    fclose(in);
    if (!imports.runs || !cog.runs || !(cog_bytes > 0)) bench_stop(path, "times are missing");
}

static void show_import(bench_table *table) {
    static const char peer[] = "COG";
    bench_table_section(table, "import",
                        "Import, and GDAL writing a COG (ZSTD, predictor 2, overviews) of the same raster",
                        "of COG");
    bench_table_row(table, "gdal_translate to COG", &cog, "s", 1, false, NULL, NULL, NO_AIM);
    bench_table_row(table, "gdal_translate to COG, NUM_THREADS=ALL_CPUS", &cog_threads, "s", 1, false, peer, &cog,
                    NO_AIM);
    bench_table_row(table, "rqt import", &imports, "s", 1, false, peer, &cog, (bench_aim){BENCH_AT_MOST, 1});
    bench_table_row(table, "rqt import", &imports, "Msamp/s", samples / 1e6, true, peer, &cog, NO_AIM);
    bench_table_row(table, "rqt update of 64 x 64 samples, the whole program", &updates, "s", 1, false, "import",
                    &imports, NO_AIM);
    if (large_imports.runs) {
        static bench_times small_rate, large_rate; /* seconds a sample */
        for (int i = 0; i < imports.runs; i++) bench_add(&small_rate, imports.value[i] / samples);
        for (int i = 0; i < large_imports.runs; i++) bench_add(&large_rate, large_imports.value[i] / large_samples);
        bench_table_row(table, "32769 x 16385 samples, --memory 256", &large_rate, "Msamp/s", 1e-6, true, "4097^2",
                        &small_rate, (bench_aim){BENCH_AT_LEAST, 0.65});
        bench_table_count(table, "peak resident memory of that", large_rss / 1024, "MiB", "256 MiB", 256,
                          (bench_aim){BENCH_AT_MOST, 1});
    }
    bench_table_count(table, "COG size", cog_bytes / 1e6, "MB", NULL, 1, NO_AIM);
    bench_table_count(table, "database size, errors of all levels included", database_bytes / 1e6, "MB", peer,
                      cog_bytes / 1e6, (bench_aim){BENCH_AT_MOST, 1});
}

/* --------------------------------------------------------- an empty table-valued function of five columns -- */
typedef struct empty_cursor {
    sqlite3_vtab_cursor base;
    sqlite3_int64 row, rows;
} empty_cursor;

static int empty_connect(sqlite3 *db, void *client, int argc, const char *const *argv, sqlite3_vtab **out,
                         char **error) {
    (void)client, (void)argc, (void)argv, (void)error;
    *out = sqlite3_malloc(sizeof **out);
    if (!*out) return SQLITE_NOMEM;
    memset(*out, 0, sizeof **out);
    return sqlite3_declare_vtab(db, "CREATE TABLE x(x, y, z, error, level, rows HIDDEN)");
}
static int empty_disconnect(sqlite3_vtab *table) {
    sqlite3_free(table);
    return SQLITE_OK;
}
static int empty_best_index(sqlite3_vtab *table, sqlite3_index_info *info) {
    (void)table;
    for (int i = 0; i < info->nConstraint; i++)
        if (info->aConstraint[i].iColumn == 5 && info->aConstraint[i].usable) {
            info->aConstraintUsage[i].argvIndex = 1;
            info->aConstraintUsage[i].omit = 1;
            return SQLITE_OK;
        }
    return SQLITE_CONSTRAINT;
}
static int empty_open(sqlite3_vtab *table, sqlite3_vtab_cursor **out) {
    (void)table;
    empty_cursor *c = sqlite3_malloc(sizeof *c);
    if (!c) return SQLITE_NOMEM;
    memset(c, 0, sizeof *c);
    *out = &c->base;
    return SQLITE_OK;
}
static int empty_close(sqlite3_vtab_cursor *cursor) {
    sqlite3_free(cursor);
    return SQLITE_OK;
}
static int empty_filter(sqlite3_vtab_cursor *cursor, int index, const char *text, int argc, sqlite3_value **argv) {
    (void)index, (void)text, (void)argc;
    ((empty_cursor *)cursor)->row = 0;
    ((empty_cursor *)cursor)->rows = sqlite3_value_int64(argv[0]);
    return SQLITE_OK;
}
static int empty_next(sqlite3_vtab_cursor *cursor) {
    ((empty_cursor *)cursor)->row++;
    return SQLITE_OK;
}
static int empty_eof(sqlite3_vtab_cursor *cursor) {
    return ((empty_cursor *)cursor)->row >= ((empty_cursor *)cursor)->rows;
}
static int empty_column(sqlite3_vtab_cursor *cursor, sqlite3_context *result, int n) {
    if (n < 4)
        sqlite3_result_double(result, (double)((empty_cursor *)cursor)->row);
    else
        sqlite3_result_int(result, n);
    return SQLITE_OK;
}
static int empty_rowid(sqlite3_vtab_cursor *cursor, sqlite3_int64 *id) {
    *id = ((empty_cursor *)cursor)->row;
    return SQLITE_OK;
}
static const sqlite3_module EMPTY = {.xConnect = empty_connect,
                                     .xBestIndex = empty_best_index,
                                     .xDisconnect = empty_disconnect,
                                     .xOpen = empty_open,
                                     .xClose = empty_close,
                                     .xFilter = empty_filter,
                                     .xNext = empty_next,
                                     .xEof = empty_eof,
                                     .xColumn = empty_column,
                                     .xRowid = empty_rowid};

/* Steps through all rows; all of it to *total, what follows the first row to *stepping. */
static void step_rows(sqlite3_stmt *s, bench_times *total, bench_times *stepping) {
    const double begin = bench_now();
    if (sqlite3_step(s) != SQLITE_ROW) bench_stop(sqlite3_sql(s), sqlite3_errmsg(sqlite3_db_handle(s)));
    const double first = bench_now();
    bench_run(s, NULL);
    const double end = bench_now();
    bench_add(total, end - begin);
    bench_add(stepping, end - first);
}

static void bench_rows(bench_table *table) {
    static bench_times range, range_steps, empty, empty_steps;
    sqlite3 *db = open_database(false);
    if (sqlite3_create_module(db, "bench_empty", &EMPTY, NULL) != SQLITE_OK)
        bench_stop("bench_empty", sqlite3_errmsg(db));
    sqlite3_stmt *asked = bench_prepare(db, "SELECT * FROM rqt_range(rqt_bbox(?1, ?2, ?3, ?4), ?5)");
    sqlite3_stmt *given = bench_prepare(db, "SELECT * FROM bench_empty(?1)");
    bind_window(asked, 1);
    const int64_t rows = bench_run(asked, NULL);
    sqlite3_bind_int64(given, 1, rows);
    for (int burst = 0; burst < BURSTS; burst++) {
        step_rows(asked, &range, &range_steps);
        step_rows(given, &empty, &empty_steps);
    }
    char title[128];
    snprintf(title, sizeof title, "rqt_range, %lld rows (the window at eps 1, warm), stepped from C",
             (long long)rows);
    bench_table_section(table, "rows", title, "of empty");
    const double millions = (double)rows / 1e6;
    bench_table_row(table, "an empty table-valued function of five columns", &empty, "Mrows/s", millions, true,
                    NULL, NULL, NO_AIM);
    bench_table_row(table, "rqt_range, the query included", &range, "Mrows/s", millions, true, "empty", &empty,
                    (bench_aim){BENCH_AT_LEAST, 0.6});
    bench_table_row(table, "rqt_range, after the first row", &range_steps, "Mrows/s", millions, true, "empty",
                    &empty_steps, NO_AIM);
    sqlite3_finalize(asked);
    sqlite3_finalize(given);
    sqlite3_close(db);
}

/* ------------------------------------------------------------------------------------------------ heights -- */
static double uniform(uint64_t *state) {
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (double)(*state >> 11) * 0x1p-53;
}

/* bench_place: x, y anywhere in the terrain, wx, wy anywhere in the window. */
static void make_places(void) {
    sqlite3 *db = open_database(true);
    char *why = NULL;
    if (sqlite3_exec(db, "BEGIN; DROP TABLE IF EXISTS bench_place; CREATE TABLE bench_place(x, y, wx, wy)", NULL,
                     NULL, &why))
        bench_stop("bench_place", why);
    sqlite3_stmt *s = bench_prepare(db, "INSERT INTO bench_place VALUES(?1, ?2, ?3, ?4)");
    uint64_t state = 1;
    for (int i = 0; i < PLACES; i++) {
        for (int c = 0; c < 4; c++) {
            const double *in = c < 2 ? whole : box;
            sqlite3_bind_double(s, c + 1, in[c % 2] + uniform(&state) * (in[c % 2 + 2] - in[c % 2]));
        }
        bench_run(s, NULL);
    }
    sqlite3_finalize(s);
    if (sqlite3_exec(db, "COMMIT", NULL, NULL, &why)) bench_stop("bench_place", why);
    sqlite3_close(db);
}

static void bench_heights(bench_table *table) {
    static const struct {
        const char *what, *sql;
    } asks[] = {{"in the window, full resolution", "SELECT sum(rqt_height(wx, wy)) FROM bench_place"},
                {"in the window, eps 5", "SELECT sum(rqt_height(wx, wy, 5)) FROM bench_place"},
                {"in the whole terrain, full resolution", "SELECT sum(rqt_height(x, y)) FROM bench_place"}};
    enum { ASKS = sizeof asks / sizeof *asks };
    make_places();
    static bench_times times[ASKS];
    sqlite3 *db = open_database(false);
    for (int a = 0; a < ASKS; a++) {
        sqlite3_stmt *s = bench_prepare(db, asks[a].sql);
        bench_run(s, NULL);
        for (int i = 0; i < BURST; i++) {
            const double begin = bench_now();
            bench_run(s, NULL);
            bench_add(&times[a], bench_now() - begin);
        }
        sqlite3_finalize(s);
    }
    sqlite3_close(db);
    bench_table_section(table, "heights",
                        "rqt_height at 100,000 random places from a table of the same database, warm", "");
    for (int a = 0; a < ASKS; a++)
        bench_table_row(table, asks[a].what, &times[a], "k/s", PLACES / 1e3, true, NULL, NULL, NO_AIM);
}

int main(int argc, char **argv) {
    if (argc != 8 && argc != 9) {
        fprintf(stderr, "Usage: bench DATABASE EXTENSION GEOTIFF TIMES CSV MACHINE DATA [LARGE]\n");
        return 2;
    }
    database_path = argv[1];
    extension_path = argv[2];
    raster_path = argv[3];
    bench_table table;
    if (!bench_table_open(&table, argv[5], argv[6], argv[7])) bench_stop(argv[5], "cannot be written");
    setvbuf(stdout, NULL, _IOLBF, 0);
    printf("Machine: %s\nData: %s\nMedians; a ratio is of medians.\n", argv[6], argv[7]);
    GDALAllRegister();
    read_times(argv[4]);
    find_window();
    bench_window(&table);
    show_import(&table);
    bench_rows(&table);
    bench_heights(&table);
    sqlite3 *db = open_database(true);
    bench_options(&table, db, box, whole);
    sqlite3_close(db);
    if (argc == 9) bench_large(&table, argv[8]);
    if (!bench_table_close(&table)) bench_stop(argv[5], "cannot be written");
    return 0;
}
