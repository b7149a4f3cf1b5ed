/* error_kernels.h - the inner loops of exact errors, for the machine at hand. error_kernels.c */
#ifndef RQT_ERROR_KERNELS_H
#define RQT_ERROR_KERNELS_H

#include "internal.h"

typedef struct error_kernels {
    /* max over n samples of |(z[i] - base) * 2^m - (start + i * slope)|, all modulo 2^32: for differences that are
     * known to be below 2^31. */
    uint32_t (*row_32)(const int32_t *z, int32_t n, uint32_t base, int m, uint32_t start, uint32_t slope);
    /* The same, where 64 bits are needed. */
    uint64_t (*row_64)(const int32_t *z, int32_t n, int64_t base, int m, int64_t start, int64_t slope);
    /* max of |(z[i] - base) * area - (start + i * slope)| where every term is below 2^53. */
    double (*row_double)(const int32_t *z, int32_t n, int32_t base, double area, double start, double slope);
} error_kernels;

/* The fastest that this processor runs; the plain ones, which give the same results. */
const error_kernels *error_kernels_best(void);
const error_kernels *error_kernels_plain(void);

#endif
