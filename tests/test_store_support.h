/* test_store_support.h - what the test programs of the store share: terrains made in memory through the core and
 * the writer, findings as a list, and tools that damage a stored terrain in a chosen place and leave its checksums
 * right.
 *
 * Terrains are small and rough: hash noise on a slope, so that every vertex has an error and a lost or stale block
 * changes an answer. */
#ifndef TEST_STORE_SUPPORT_H
#define TEST_STORE_SUPPORT_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include <math.h>
#include <unistd.h>

#include "../src/store/internal.h"

#include "../src/core/internal.h"

#define CHECK(condition, ...)                        \
    do {                                             \
        if (!(condition)) {                          \
            print_error("failed: %s\n", #condition); \
            fail_msg(__VA_ARGS__);                   \
        }                                            \
    } while (0)

/* ------------------------------------------------------------------------------------------------- SQL */

static inline sqlite3 *open_database(const char *file) {
    sqlite3 *db = NULL;
    assert_int_equal(sqlite3_open(file, &db), SQLITE_OK);
    sqlite3_busy_timeout(db, 5000);
    return db;
}

static inline void run(sqlite3 *db, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    char *sql = sqlite3_vmprintf(format, arguments);
    va_end(arguments);
    assert_non_null(sql);
    const int code = sqlite3_exec(db, sql, NULL, NULL, NULL);
    CHECK(code == SQLITE_OK, "%s: %s", sql, sqlite3_errmsg(db));
    sqlite3_free(sql);
}

/* The first column of the first row as text, in a buffer that the next call reuses; "" when there is none. */
static inline const char *ask(sqlite3 *db, const char *sql) {
    static char text[512];
    sqlite3_stmt *s = NULL;
    text[0] = 0;
    CHECK(sqlite3_prepare_v2(db, sql, -1, &s, NULL) == SQLITE_OK, "%s: %s", sql, sqlite3_errmsg(db));
    if (sqlite3_step(s) == SQLITE_ROW && sqlite3_column_text(s, 0))
        snprintf(text, sizeof text, "%s", (const char *)sqlite3_column_text(s, 0));
    sqlite3_finalize(s);
    return text;
}

/* A directory for database files. */
static char scratch[64];

static inline int make_scratch(void **state) {
    (void)state;
    const char *base = getenv("TMPDIR");
    snprintf(scratch, sizeof scratch, "%s/test_store_XXXXXX", base && strlen(base) < 40 ? base : "/tmp");
    return mkdtemp(scratch) ? 0 : -1;
}

static inline int drop_scratch(void **state) {
    (void)state;
    return rmdir(scratch);
}

static inline char *scratch_file(char path[128], const char *name) {
    snprintf(path, 128, "%s/%s", scratch, name);
    return path;
}

static inline void remove_database(const char *path) {
    char other[512];
    unlink(path);
    snprintf(other, sizeof other, "%s-wal", path);
    unlink(other);
    snprintf(other, sizeof other, "%s-shm", path);
    unlink(other);
}

/* -------------------------------------------------------------------------------------------- terrains */

typedef struct raster {
    int width, height;
    int32_t *q;
    uint8_t *valid; /* NULL: all are */
} raster;

static inline uint32_t noise(uint32_t x, uint32_t y, uint32_t seed) {
    uint32_t h = x * 0x9E3779B1u ^ y * 0x85EBCA6Bu ^ seed * 0xC2B2AE35u;
    h = (h ^ h >> 15) * 0x2C1B3C6Du;
    h = (h ^ h >> 12) * 0x297A2D39u;
    return h ^ h >> 15;
}

static inline raster make_raster(int width, int height, uint32_t seed, bool voids) {
    raster r = {width, height, malloc(sizeof(int32_t) * (size_t)(width * height)), NULL};
    assert_non_null(r.q);
    if (voids) {
        r.valid = malloc((size_t)(width * height));
        assert_non_null(r.valid);
    }
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            r.q[y * width + x] = 3 * x - 2 * y + (int32_t)(noise((uint32_t)x, (uint32_t)y, seed) % 64);
            const int dx = x - width / 3, dy = y - height / 3;
            if (voids)
                r.valid[y * width + x] = dx * dx + dy * dy > 9 && noise((uint32_t)x, (uint32_t)y, ~seed) % 97 != 0;
        }
    }
    return r;
}

static inline void raster_free(raster *r) {
    free(r->q);
    free(r->valid);
}

static const rqt_unit test_unit = {.z0 = 100, .d = 4, .numerator = 1, .denominator = 1, .scale = 1, .offset = 0};
static const double test_quantum = 0.25;

static inline store_terrain describe(const raster *r, const char *name, int k) {
    store_terrain t = {.k = k,
                       .placement = {1000, 2000, 10, -10},
                       .unit = test_unit,
                       .cost = {10, 1},
                       .crs = "",
                       .vertical = "",
                       .source = "noise",
                       .created = "2000-01-01T00:00:00Z"};
    snprintf(t.name, sizeof t.name, "%s", name);
    assert_int_equal(rqt_lattice_init(&t.lattice, r->width, r->height), RQT_OK);
    bool any = false;
    for (int i = 0; i < r->width * r->height; i++) {
        if (r->valid && !r->valid[i]) {
            t.voids++;
            continue;
        }
        if (!any || r->q[i] < t.min_q) t.min_q = r->q[i];
        if (!any || r->q[i] > t.max_q) t.max_q = r->q[i];
        any = true;
    }
    return t;
}

/* The whole of a terrain, in a transaction that is begun. With anything but SQLITE_OK *error may hold a sentence.
 */
static inline int write_terrain(sqlite3 *db, const raster *r, const char *name, int k, bool replace, bool finish,
                                char **error) {
    const rqt_allocator *allocator = store_allocator();
    const store_terrain info = describe(r, name, k);
    const rqt_grid grid = {info.lattice, r->q, r->valid};
    store_writer *writer = NULL;
    int code = store_writer_begin(db, &info, replace, &writer, error);
    if (code != SQLITE_OK) return code;
    rqt_errors errors;
    rqt_pyramid *pyramid;
    rqt_codec *codec;
    rqt_block block;
    assert_int_equal(rqt_errors_compute(&grid, &info.unit, &info.cost, allocator, NULL, NULL, &errors), RQT_OK);
    rqt_errors_saturate(&errors);
    assert_int_equal(rqt_pyramid_create(&grid, &errors, k, allocator, &pyramid), RQT_OK);
    assert_int_equal(rqt_codec_create(allocator, &codec), RQT_OK);
    assert_int_equal(rqt_block_create(k, allocator, &block), RQT_OK);
    uint8_t *bytes = malloc(rqt_block_bound(k));
    assert_non_null(bytes);
    rqt_code largest = 0;
    for (int i = 0; i < errors.columns * errors.rows; i++)
        if (errors.code[i] != RQT_CODE_INFINITY && errors.code[i] > largest) largest = errors.code[i];
    for (size_t n = 0; n < rqt_pyramid_count(pyramid) && code == SQLITE_OK; n++) {
        rqt_block_number number;
        rqt_summary summary;
        size_t size;
        rqt_pyramid_block(pyramid, n, &number, &summary, &block);
        assert_int_equal(rqt_block_encode(codec, &block, test_quantum, bytes, &size), RQT_OK);
        code = store_writer_block(writer, number, &summary, bytes, size, error);
    }
    if (code == SQLITE_OK && finish) code = store_writer_finish(writer, largest, error);
    store_writer_free(writer);
    free(bytes);
    rqt_block_free(&block, allocator);
    rqt_codec_free(codec);
    rqt_pyramid_free(pyramid);
    rqt_errors_free(&errors, allocator);
    return code;
}

/* A terrain of noise in a transaction of its own, instead of one that has the name. */
static inline void put_terrain(sqlite3 *db, const char *name, int width, int height, int k, uint32_t seed,
                               bool voids) {
    raster r = make_raster(width, height, seed, voids);
    char *error = NULL;
    run(db, "BEGIN IMMEDIATE");
    const int code = write_terrain(db, &r, name, k, true, true, &error);
    CHECK(code == SQLITE_OK, "%d: %s", code, error ? error : "");
    run(db, "COMMIT");
    raster_free(&r);
}

static inline sqlite3 *memory_terrain(int width, int height, int k, bool voids) {
    sqlite3 *db = open_database(":memory:");
    put_terrain(db, "t", width, height, k, 1, voids);
    return db;
}

/* --------------------------------------------------------------------------------------------- findings */

typedef struct findings {
    int count, most; /* most: stop after so many; 0: never */
    struct {
        char severity[16];
        rqt_block_number block;
        char message[240];
    } list[200];
} findings;

static inline bool add_finding(void *context, const store_finding *finding) {
    findings *f = context;
    if (f->count < 200) {
        snprintf(f->list[f->count].severity, sizeof f->list[0].severity, "%s", finding->severity);
        snprintf(f->list[f->count].message, sizeof f->list[0].message, "%s", finding->message);
        f->list[f->count].block = finding->block;
    }
    f->count++;
    return f->count != f->most;
}

/* Check the first terrain that there is, incomplete ones too. */
static inline int check_terrain(sqlite3 *db, findings *f) {
    store *s;
    store_terrain *all;
    int count;
    char *error = NULL;
    memset(f, 0, sizeof *f);
    assert_int_equal(store_open(db, &s), SQLITE_OK);
    int code = store_terrains(s, &all, &count, &error);
    if (code == SQLITE_OK && count > 0) code = store_check(s, &all[0], add_finding, f, &error);
    sqlite3_free(error);
    if (code == SQLITE_OK) store_terrains_free(all, count);
    store_close(s);
    return code;
}

static inline bool has_finding(const findings *f, rqt_block_number block, const char *says) {
    for (int i = 0; i < f->count && i < 200; i++)
        if (f->list[i].block == block && strstr(f->list[i].message, says)) return true;
    return false;
}

static inline void print_findings(const findings *f) {
    for (int i = 0; i < f->count && i < 40; i++)
        print_error("  %s %llu: %s\n", f->list[i].severity, (unsigned long long)f->list[i].block,
                    f->list[i].message);
}

/* ---------------------------------------------------------------------------------------------- damage */

/* The bytes of a column of a block's row, malloced. */
static inline uint8_t *get_bytes(sqlite3 *db, const char *column, rqt_block_number number, size_t *size) {
    char *sql = sqlite3_mprintf("SELECT %s FROM rqt_block_1 WHERE id = %llu", column, number);
    sqlite3_stmt *s = NULL;
    assert_int_equal(sqlite3_prepare_v2(db, sql, -1, &s, NULL), SQLITE_OK);
    CHECK(sqlite3_step(s) == SQLITE_ROW, "no block %llu", (unsigned long long)number);
    *size = (size_t)sqlite3_column_bytes(s, 0);
    uint8_t *bytes = malloc(*size + 1);
    assert_non_null(bytes);
    memcpy(bytes, sqlite3_column_blob(s, 0), *size);
    sqlite3_finalize(s);
    sqlite3_free(sql);
    return bytes;
}

static inline void set_bytes(sqlite3 *db, const char *column, rqt_block_number number, const uint8_t *bytes,
                             size_t size) {
    char *sql = sqlite3_mprintf("UPDATE rqt_block_1 SET %s = ?1 WHERE id = %llu", column, number);
    sqlite3_stmt *s = NULL;
    assert_int_equal(sqlite3_prepare_v2(db, sql, -1, &s, NULL), SQLITE_OK);
    sqlite3_bind_blob64(s, 1, bytes, size, SQLITE_STATIC);
    assert_int_equal(sqlite3_step(s), SQLITE_DONE);
    assert_int_equal(sqlite3_changes(db), 1);
    sqlite3_finalize(s);
    sqlite3_free(sql);
}

/* Change a decoded block, and store it with the checksum that it then has. The row's sum of bytes follows. */
static inline void edit_block(sqlite3 *db, rqt_block_number number, int k, void (*edit)(rqt_block *block),
                              double quantum) {
    rqt_codec *codec;
    rqt_block block;
    size_t size;
    uint8_t *bytes = get_bytes(db, "data", number, &size);
    assert_int_equal(rqt_codec_create(store_allocator(), &codec), RQT_OK);
    assert_int_equal(rqt_block_create(k, store_allocator(), &block), RQT_OK);
    assert_int_equal(rqt_block_decode(codec, bytes, size, &block), RQT_OK);
    if (edit) edit(&block);
    bytes = realloc(bytes, rqt_block_bound(k));
    assert_int_equal(rqt_block_encode(codec, &block, quantum, bytes, &size), RQT_OK);
    set_bytes(db, "data", number, bytes, size);
    run(db, "UPDATE rqt_terrain SET bytes = (SELECT sum(length(summary) + length(data)) FROM rqt_block_1)");
    free(bytes);
    rqt_block_free(&block, store_allocator());
    rqt_codec_free(codec);
}

static inline void edit_summary(sqlite3 *db, rqt_block_number number, void (*edit)(rqt_summary *summary)) {
    rqt_summary summary;
    size_t size;
    uint8_t *bytes = get_bytes(db, "summary", number, &size);
    assert_int_equal(rqt_summary_decode(bytes, size, &summary), RQT_OK);
    edit(&summary);
    rqt_summary_encode(&summary, bytes);
    set_bytes(db, "summary", number, bytes, size);
    free(bytes);
}

/* --------------------------------------------------------------------------------------------- queries */

static const store_query_options by_threshold = {.select = RQT_SELECT_THRESHOLD, .outline = RQT_OUTLINE_EXACT};

/* What a query gave, small enough to compare: a hash over triangles as samples with heights, in order. */
typedef struct answer {
    int code;
    size_t triangles;
    uint64_t hash;
    char error[256];
} answer;

static inline void keep_error(answer *a, char *error) {
    snprintf(a->error, sizeof a->error, "%s", error ? error : "");
    sqlite3_free(error);
}

/* wkt: the region; NULL is everything. reads may be NULL. */
static inline answer query_region(store *s, const char *name, const char *wkt, double eps,
                                  store_query_options options, store_reads *reads) {
    answer a = {0};
    const store_terrain *t;
    char *error = NULL;
    rqt_geometry *geometry = NULL;
    rqt_region *region = NULL;
    rqt_status status = RQT_OK;
    rqt_message why;
    rqt_patch patch = {0};
    if (reads) memset(reads, 0, sizeof *reads);
    a.code = store_find(s, name, &t, &error);
    if (a.code == SQLITE_OK) {
        if (wkt) status = rqt_geometry_parse(wkt, strlen(wkt), true, store_allocator(), &geometry, &why);
        if (status == RQT_OK)
            status = rqt_region_create(geometry, &t->placement, &t->lattice, store_allocator(), &region);
        a.code = store_fail_core(&error, status, "region");
    }
    if (a.code == SQLITE_OK) a.code = store_query(s, t, region, eps, &options, &patch, reads, &error);
    a.triangles = patch.triangle_count;
    for (size_t i = 0; i < 3 * patch.triangle_count; i++) {
        const rqt_patch_vertex *v = &patch.vertices[patch.triangles[i]];
        const uint64_t parts[] = {(uint64_t)v->col, (uint64_t)v->row, (uint64_t)(int64_t)v->q, v->error};
        for (int n = 0; n < 4; n++) a.hash = (a.hash ^ parts[n]) * UINT64_C(0x9E3779B97F4A7C15) + (a.hash >> 31);
    }
    rqt_patch_free(&patch);
    rqt_region_free(region);
    rqt_geometry_free(geometry);
    keep_error(&a, error);
    return a;
}

static inline answer query_store(store *s, const char *name, double eps, store_query_options options,
                                 store_reads *reads) {
    return query_region(s, name, NULL, eps, options, reads);
}

static inline answer query_database(sqlite3 *db, double eps, store_query_options options) {
    store *s;
    assert_int_equal(store_open(db, &s), SQLITE_OK);
    const answer a = query_store(s, "t", eps, options, NULL);
    store_close(s);
    return a;
}

static inline bool same_answer(const answer *a, const answer *b) {
    return a->code == b->code && a->triangles == b->triangles && a->hash == b->hash;
}

#endif
