/* error_kernels.h - the inner loops of exact errors, for the machine at hand. error_kernels.c
 *
 * Two kinds of loop. Of a large triangle the samples of a row stand side by side in a vector. Of small ones the
 * same sample of eight cells does: a strip of samples is laid out anew so that they are neighbours
 * (error_kernels_cells.h).
 */
#ifndef RQT_ERROR_KERNELS_H
#define RQT_ERROR_KERNELS_H

#include "internal.h"

/* Rows of samples from `left` to `right`, both of which move by a step a row, cut to low .. high. */
typedef struct row_spans {
    int32_t rows;
    int32_t left, left_step, right, right_step;
    int32_t low, high;
} row_spans;

enum {
    CELL_LEVELS = 4,               /* cells of sides 2, 4, 8 and 16 are small */
    STRIP_ROWS = 1 << CELL_LEVELS, /* of a strip of cells, and one more */
    STRIP_COLUMNS = 256,           /* and one more */
};
/* Differences of heights that small cells are measured in 32 bits for. */
#define CELL_RELIEF (INT64_C(1) << 26)

/* The cells of sides 2 .. 2^levels in a strip of 2^levels rows of cells, or samples as far as there are any. */
typedef struct cell_strip {
    const int32_t *z; /* the first sample; rows are `stride` apart */
    const uint8_t *valid;
    size_t stride;
    int32_t columns, rows; /* of samples: at most STRIP_COLUMNS + 1, 2^levels + 1 */
    int32_t x, y;          /* of the first sample, in the lattice */
    int levels;            /* 1 .. CELL_LEVELS */
    rqt_code
        *code; /* the errors are raised to what the cells without voids, all of whose samples are there, give */
    size_t code_stride;
} cell_strip;

typedef struct error_kernels {
    /* Over all samples (x, k) of the spans, z at row k starting at z + k*stride, the largest
     * |z * 2^m - (start + x * gx + k * gy)|, modulo 2^32: for differences that are known to be below 2^31. */
    uint32_t (*rows_32)(const int32_t *z, size_t stride, const row_spans *spans, int m, uint32_t start, uint32_t gx,
                        uint32_t gy);
    /* The same where 64 bits are needed. */
    uint64_t (*rows_64)(const int32_t *z, size_t stride, const row_spans *spans, int m, int64_t start, int64_t gx,
                        int64_t gy);
    /* max over n samples of |(z[i] - base) * area - (start + i * slope)| where every term is below 2^53. */
    double (*row_double)(const int32_t *z, int32_t n, int32_t base, double area, double start, double slope);
    void (*cells)(const cell_strip *strip, const code_scale *scale);
} error_kernels;

/* The fastest that this processor runs; the plain ones, which give the same results. */
const error_kernels *error_kernels_best(void);
const error_kernels *error_kernels_plain(void);

#endif
