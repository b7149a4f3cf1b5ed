/* bench_errors.c - how fast exact errors and their saturation are, on one core.
 *
 *     bench_errors RASTER.bin SIDE [RUNS]
 *
 * RASTER.bin: SIDE * SIDE little-endian int16, as make_terrain writes them. For the fast kernels and the plain
 * ones, and for the raster as a whole and as a sweep in bands: million samples per second of processor time, the
 * best and the median of RUNS runs; then the minimal errors. The four ways take turns, so that a busy machine is
 * fair to all. Fails when they disagree.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "error_tile.h"

#define WAYS 4
#define MOST_RUNS 99

static const char *const names[WAYS] = {"whole, fast kernels", "sweep, fast kernels", "whole, plain kernels",
                                        "sweep, plain kernels"};

static void *resize(void *context, void *p, size_t bytes) {
    (void)context;
    if (bytes) return realloc(p, bytes);
    free(p);
    return NULL;
}
static const rqt_allocator allocator = {resize, NULL};

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + (double)t.tv_nsec * 1e-9;
}

static void fail(const char *what) {
    fprintf(stderr, "bench_errors: %s\n", what);
    exit(1);
}

static rqt_grid grid_read(const char *path, int32_t side) {
    const size_t n = (size_t)side * (size_t)side;
    rqt_grid grid = {.valid = NULL};
    unsigned char *bytes = malloc(2 * n);
    int32_t *q = malloc(n * sizeof *q);
    FILE *in = fopen(path, "rb");
    if (!in || !bytes || !q || fread(bytes, 2, n, in) != n) fail("the raster cannot be read");
    fclose(in);
    for (size_t i = 0; i < n; i++) q[i] = (int16_t)(bytes[2 * i] | bytes[2 * i + 1] << 8);
    free(bytes);
    grid.q = q;
    if (rqt_lattice_init(&grid.lattice, side, side) != RQT_OK) fail("bad side");
    return grid;
}

/* A sum over codes that are finite: the same for all ways. */
static uint64_t sum_of(const rqt_code *codes, size_t n) {
    uint64_t sum = 0;
    for (size_t i = 0; i < n; i++) sum += codes[i] == RQT_CODE_INFINITY ? 0 : codes[i];
    return sum;
}

static double run_whole(const rqt_grid *grid, const rqt_unit *unit, const error_kernels *kernels, uint64_t *sum) {
    const rqt_void_cost cost = {30, 1};
    const int b = grid->lattice.K < 8 ? grid->lattice.K : 8;
    rqt_errors errors;
    const double start = now();
    if (errors_compute(grid, unit, &cost, b, kernels, &allocator, NULL, NULL, &errors) != RQT_OK) fail("no memory");
    rqt_errors_saturate(&errors);
    const double seconds = now() - start;
    *sum = sum_of(errors.code, (size_t)errors.columns * (size_t)errors.rows);
    rqt_errors_free(&errors, &allocator);
    return seconds;
}

static uint64_t sum_of_band(const rqt_sweep *sweep, const rqt_grid *grid, int32_t band, int b, rqt_code *codes) {
    const rqt_band at = rqt_sweep_band(sweep, band);
    uint64_t sum = 0;
    for (int32_t y = band << b; y <= (band + 1) << b && y < grid->lattice.height; y++) {
        if (band > 0 && y == band << b) continue;
        rqt_band_errors(&at, 0, y, 1, grid->lattice.width, codes, NULL);
        sum += sum_of(codes, (size_t)grid->lattice.width);
    }
    return sum;
}

static double run_sweep(const rqt_grid *grid, const rqt_unit *unit, const error_kernels *kernels, uint64_t *sum) {
    const size_t width = (size_t)grid->lattice.width;
    const rqt_sweep_plan plan = {.lattice = grid->lattice,
                                 .unit = *unit,
                                 .cost = {30, 1},
                                 .min_q = 0,
                                 .max_q = 4000,
                                 .b = grid->lattice.K < 8 ? grid->lattice.K : 8,
                                 .workers = 1};
    rqt_sweep *sweep;
    rqt_code *codes = malloc(width * sizeof *codes);
    if (!codes || sweep_create(&plan, kernels, &allocator, &sweep) != RQT_OK) fail("no memory");
    double seconds = 0;
    *sum = 0;
    for (int32_t y = 0; y < grid->lattice.height; y++)
        if (rqt_sweep_wants(sweep, y)) rqt_sweep_first(sweep, y, grid->q + (size_t)y * width, NULL);
    const int32_t bands = rqt_sweep_bands(sweep);
    for (int32_t band = 0; band < bands; band++) {
        int32_t first, count, *q;
        uint8_t *valid;
        rqt_sweep_begin(sweep, band, &first, &count, &q, &valid);
        memcpy(q, grid->q + (size_t)first * width, (size_t)count * width * sizeof *q);
        const double start = now();
        for (int32_t tile = 0; tile < rqt_sweep_tiles(sweep); tile++) rqt_sweep_tile(sweep, 0, tile);
        rqt_sweep_end(sweep);
        seconds += now() - start;
        if (band > 0) *sum += sum_of_band(sweep, grid, band - 1, plan.b, codes);
    }
    *sum += sum_of_band(sweep, grid, bands - 1, plan.b, codes);
    rqt_sweep_finish(sweep);
    for (int32_t y = 0; y < grid->lattice.height; y += 1 << plan.b)
        for (int32_t x = 0; x < grid->lattice.width; x += 1 << plan.b) {
            int32_t height;
            uint8_t flags;
            const rqt_code code = rqt_sweep_coarse(sweep, (rqt_vertex){x, y}, &height, &flags);
            *sum += sum_of(&code, 1);
        }
    rqt_sweep_free(sweep);
    free(codes);
    return seconds;
}

static int ordered(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return x < y ? -1 : x > y;
}

int main(int argc, char **argv) {
    const int32_t side = argc == 3 || argc == 4 ? atoi(argv[2]) : 0;
    const int runs = argc == 4 ? atoi(argv[3]) : 5;
    if (side < 2 || runs < 1 || runs > MOST_RUNS) {
        fprintf(stderr, "Usage: bench_errors RASTER.bin SIDE [RUNS]; side * side int16 samples\n");
        return 2;
    }
    const rqt_unit unit = {.d = 1, .numerator = 1, .denominator = 1, .scale = 1};
    const rqt_grid grid = grid_read(argv[1], side);
    double seconds[WAYS][MOST_RUNS];
    uint64_t sum = 0, first = 0;
    for (int run = 0; run < runs; run++)
        for (int way = 0; way < WAYS; way++) {
            const error_kernels *kernels = way < 2 ? error_kernels_best() : error_kernels_plain();
            seconds[way][run] = (way % 2 ? run_sweep : run_whole)(&grid, &unit, kernels, &sum);
            if (run + way == 0) first = sum;
            if (sum != first) fail("the results differ");
        }
    for (int way = 0; way < WAYS; way++) {
        qsort(seconds[way], (size_t)runs, sizeof(double), ordered);
        const double samples = (double)side * side * 1e-6;
        printf("%-21s  %7.1f Msamples/s (median %.1f)\n", names[way], samples / seconds[way][0],
               samples / seconds[way][runs / 2]);
    }
    const rqt_void_cost cost = {30, 1};
    double least = 1e9;
    for (int run = 0; run < 3; run++) {
        rqt_errors errors;
        const double start = now();
        if (rqt_metric_compute(&grid, &unit, &cost, RQT_METRIC_MINIMAL, RQT_OUTLINE_EXACT, &allocator, NULL, NULL,
                               &errors) != RQT_OK)
            fail("no memory");
        const double took = now() - start;
        least = took < least ? took : least;
        rqt_errors_free(&errors, &allocator);
    }
    printf("%-21s  %7.1f Msamples/s\n", "minimal (aim: 5)", (double)side * side * 1e-6 / least);
    free((void *)(uintptr_t)grid.q);
    return 0;
}
