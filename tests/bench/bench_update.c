/* bench_update.c - what an update of a small square costs, in terrains of any size.
 *
 *     bench_update DATABASE [SIDE [RUNS]]
 *
 * DATABASE holds one terrain, and is changed and changed back: RUNS squares of SIDE samples at random places get a
 * bump of a tenth of the terrain's relief, and lose it again. Each is a transaction; what is timed is the update,
 * from looking for the terrain to its row, and apart from it the commit. Medians; a share of the machine is told by
 * the time that the processor spent. */
#include "store.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static double seconds(clockid_t clock) {
    struct timespec t;
    clock_gettime(clock, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void stop(const char *what, const char *why) {
    fprintf(stderr, "bench_update: %s: %s\n", what, why ? why : "no reason");
    exit(1);
}

static void execute(sqlite3 *db, const char *sql) {
    if (sqlite3_exec(db, sql, NULL, NULL, NULL) != SQLITE_OK) stop(sql, sqlite3_errmsg(db));
}

static uint64_t state = 20240229;
static int random_below(int n) {
    state = state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (int)((state >> 33) % (uint64_t)n);
}

enum { UPDATE, PROCESSOR, COMMIT, READ, WRITTEN, SUMMARIES, MEASURED, CELLS, FIGURES };
static double *figure[FIGURES];
static int figures;

static void update(sqlite3 *db, int col, int row, int side, const int32_t *q, const uint8_t *what) {
    store_update *u;
    const store_terrain *t;
    char *error = NULL;
    execute(db, "BEGIN IMMEDIATE");
    const double wall = seconds(CLOCK_MONOTONIC), processor = seconds(CLOCK_PROCESS_CPUTIME_ID);
    if (store_update_begin(db, NULL, &u, &t, &error) != SQLITE_OK ||
        store_update_samples(u, col, row, side, side, q, what, NULL, NULL, &error) != SQLITE_OK ||
        store_update_finish(u, "bench", NULL, NULL, &error) != SQLITE_OK)
        stop("update", error);
    const store_update_report r = *store_update_told(u);
    store_update_free(u);
    const double end = seconds(CLOCK_MONOTONIC);
    const double values[FIGURES] = {1e3 * (end - wall),
                                    1e3 * (seconds(CLOCK_PROCESS_CPUTIME_ID) - processor),
                                    0,
                                    (double)r.blocks_read,
                                    (double)r.blocks,
                                    (double)r.summaries,
                                    (double)r.measured,
                                    (double)r.cells};
    execute(db, "COMMIT");
    for (int f = 0; f < FIGURES; f++) figure[f][figures] = values[f];
    figure[COMMIT][figures++] = 1e3 * (seconds(CLOCK_MONOTONIC) - end);
}

static int compare(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

int main(int argc, char **argv) {
    if (argc < 2) stop("usage", "bench_update DATABASE [SIDE [RUNS]]");
    const int runs = argc > 3 ? atoi(argv[3]) : 20;
    int side = argc > 2 ? atoi(argv[2]) : 64;
    sqlite3 *db;
    if (sqlite3_open_v2(argv[1], &db, SQLITE_OPEN_READWRITE, NULL) != SQLITE_OK) stop(argv[1], sqlite3_errmsg(db));
    store *s;
    const store_terrain *t;
    char *error = NULL;
    if (store_open(db, &s) != SQLITE_OK || store_find(s, NULL, &t, &error) != SQLITE_OK) stop(argv[1], error);
    const int width = t->lattice.width, height = t->lattice.height, relief = t->max_q - t->min_q;
    if (side > width || side > height) side = width < height ? width : height;
    const size_t n = (size_t)side * (size_t)side;
    int32_t *old = malloc(n * sizeof *old), *q = malloc(n * sizeof *q);
    uint8_t *valid = malloc(n), *what = malloc(n);
    for (int f = 0; f < FIGURES; f++) figure[f] = malloc((size_t)runs * 2 * sizeof **figure);
    if (!old || !q || !valid || !what) stop("memory", NULL);
    for (int run = 0; run < runs; run++) {
        const int col = random_below(width - side + 1), row = random_below(height - side + 1);
        if (store_find(s, NULL, &t, &error) != SQLITE_OK ||
            store_window(s, t, col, row, side, side, old, valid, &error) != SQLITE_OK)
            stop("window", error);
        for (size_t i = 0; i < n; i++) {
            const double x = 2.0 * (double)(i % (size_t)side) / side - 1,
                         y = 2.0 * (double)(i / (size_t)side) / side - 1;
            const double bump = 1 - x * x - y * y;
            what[i] = valid[i] ? STORE_HEIGHT : STORE_KEEP;
            q[i] = old[i] + (bump > 0 ? (int32_t)(bump * relief / 10) : 0);
        }
        update(db, col, row, side, q, what);
        update(db, col, row, side, old, what);
    }
    printf("%d x %d, %d x %d samples, %d updates (median, most):\n", width, height, side, side, figures);
    static const char *const name[FIGURES] = {
        "ms update",      "ms of processor", "ms commit",        "blocks read",
        "blocks written", "summaries",       "samples measured", "cells"};
    for (int f = 0; f < FIGURES; f++) {
        qsort(figure[f], (size_t)figures, sizeof **figure, compare);
        printf("  %-18s %10.2f %10.2f\n", name[f], figure[f][figures / 2], figure[f][figures - 1]);
        free(figure[f]);
    }
    store_close(s);
    sqlite3_close(db);
    free(old);
    free(q);
    free(valid);
    free(what);
    return 0;
}
