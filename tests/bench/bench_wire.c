/* bench_wire.c RQT_SO DATABASE... - the wire format: bytes a vertex and vertices decoded a second.
 *
 * For each terrain, whole and in its middle window of 513 x 513, and each eps: the mesh in format 'rqt', decoded
 * from memory (the fastest of many runs), beside what the same mesh takes otherwise: int32 x, y, z a vertex and a
 * uint32 index a corner, and that compressed by zstd -19. One line each, on stdout.
 */
#include "rqt.h"

#include <malloc.h>
#include <sqlite3.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <zstd.h>

static void *resize(void *context, void *p, size_t bytes) {
    (void)context;
    if (bytes) return realloc(p, bytes);
    free(p);
    return NULL;
}
static const rqt_allocator heap = {resize, NULL};

static void stop(const char *what) {
    fprintf(stderr, "bench_wire: %s\n", what);
    exit(1);
}

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* A BLOB of the first column, copied. */
static uint8_t *blob(sqlite3 *db, const char *sql, size_t *size) {
    sqlite3_stmt *s;
    if (sqlite3_prepare_v2(db, sql, -1, &s, NULL) != SQLITE_OK || sqlite3_step(s) != SQLITE_ROW)
        stop(sqlite3_errmsg(db));
    *size = (size_t)sqlite3_column_bytes(s, 0);
    uint8_t *bytes = malloc(*size);
    if (!bytes) stop("out of memory");
    memcpy(bytes, sqlite3_column_blob(s, 0), *size);
    sqlite3_finalize(s);
    return bytes;
}

static void measure(sqlite3 *db, const char *name, const char *where, const char *region, double eps) {
    char sql[512];
    size_t size, indexed_size;
    snprintf(sql, sizeof sql, "SELECT rqt_mesh(%s, %g, 'rqt') FROM rqt_terrains", region, eps);
    uint8_t *bytes = blob(db, sql, &size);
    snprintf(sql, sizeof sql, "SELECT rqt_mesh(%s, %g, 'indexed') FROM rqt_terrains", region, eps);
    uint8_t *indexed = blob(db, sql, &indexed_size);
    const size_t bound = ZSTD_compressBound(indexed_size);
    uint8_t *packed = malloc(bound);
    if (!packed) stop("out of memory");
    const size_t zstd = indexed_size <= 16 << 20 ? ZSTD_compress(packed, bound, indexed, indexed_size, 19) : 0;
    double least = 1e9, spent = 0;
    size_t vertices = 0, triangles = 0;
    for (int run = 0; run < 7 || (spent < 0.5 && run < 2000); run++) {
        rqt_wire_header header;
        rqt_patch patch;
        rqt_message why;
        const double begin = now();
        if (rqt_wire_decode(bytes, size, false, &heap, &header, &patch, &why) != RQT_OK) stop(why.text);
        const double took = now() - begin;
        if (took < least) least = took;
        spent += took;
        vertices = patch.vertex_count;
        triangles = patch.triangle_count;
        rqt_patch_free(&patch);
    }
    const double v = (double)vertices;
    printf("%-12s %-6s %5g %8zu %8zu %10zu %8.3f %8.1f %8.2f %8.2f\n", name, where, eps, vertices, triangles, size,
           (double)size / v, v / least * 1e-6, (double)indexed_size / v, (double)zstd / v);
    free(packed);
    free(indexed);
    free(bytes);
}

int main(int count, char **arguments) {
    static const double eps[] = {0, 1, 2, 5, 10, 20, 50};
    (void)mallopt(M_MMAP_THRESHOLD, 1 << 30);
    (void)mallopt(M_TRIM_THRESHOLD, INT32_MAX);
    if (count < 3) stop("usage: bench_wire RQT_SO DATABASE...");
    printf("%-12s %-6s %5s %8s %8s %10s %8s %8s %8s %8s\n", "terrain", "part", "eps", "vertices", "triangl.",
           "bytes", "B/vertex", "Mvert/s", "indexed", "zstd-19");
    for (int i = 2; i < count; i++) {
        sqlite3 *db;
        if (sqlite3_open_v2(arguments[i], &db, SQLITE_OPEN_READONLY, NULL) != SQLITE_OK) stop(sqlite3_errmsg(db));
        sqlite3_enable_load_extension(db, 1);
        if (sqlite3_load_extension(db, arguments[1], NULL, NULL) != SQLITE_OK) stop(sqlite3_errmsg(db));
        size_t n;
        uint8_t *name = blob(db, "SELECT CAST(name AS BLOB) FROM rqt_terrains", &n);
        char title[65] = "";
        memcpy(title, name, n < 64 ? n : 64);
        free(name);
        for (size_t e = 0; e < sizeof eps / sizeof *eps; e++) measure(db, title, "whole", "NULL", eps[e]);
        for (size_t e = 0; e < sizeof eps / sizeof *eps; e++)
            measure(db, title, "513^2",
                    "rqt_bbox(x0 + dx * (width / 2 - 256),"
                    " y0 + dy * (height / 2 + 256), x0 + dx * (width / 2 + 256), y0 + dy * (height / 2 - 256))",
                    eps[e]);
        sqlite3_close(db);
    }
    return 0;
}
