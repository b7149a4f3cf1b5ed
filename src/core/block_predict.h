/* block_predict.h - how the block codec turns heights and errors into small numbers, and back. block_predict.c */
#ifndef RQT_BLOCK_PREDICT_H
#define RQT_BLOCK_PREDICT_H

#include "internal.h"

enum {
    LARGEST_N = (1 << RQT_MAX_BLOCK_K) + 1,
    LARGEST_COUNT = LARGEST_N * LARGEST_N,
};

/* Signed residuals as small unsigned numbers: 0, -1, 1, -2, 2 ... */
static inline uint32_t zigzag32(uint32_t r) {
    return r << 1 ^ (0 - (r >> 31));
}
static inline uint32_t unzigzag32(uint32_t v) {
    return v >> 1 ^ (0 - (v & 1));
}
static inline uint16_t zigzag16(uint16_t r) {
    return (uint16_t)(r << 1 ^ (0 - (r >> 15)));
}
static inline uint16_t unzigzag16(uint16_t v) {
    return (uint16_t)(v >> 1 ^ (0 - (v & 1)));
}

/* Residuals of one row of heights. above is NULL for the first row. */
void predict_height_row(const int32_t *row, const int32_t *above, int32_t width, uint32_t *residual);
/* The row from its residuals. Returns a number with its top bit set when a height is beyond RQT_HEIGHT_LIMIT. */
uint32_t restore_height_row(const uint32_t *residual, const int32_t *above, int32_t width, int32_t *row);

/* Room for a pass over the errors of the largest block. code and residual are in coding order: FORMAT.md. */
typedef struct error_scratch {
    rqt_code code[LARGEST_COUNT];
    uint16_t residual[LARGEST_COUNT];
    int32_t heights[2][LARGEST_COUNT / 3]; /* of every 2nd, 4th .. row and column; more than a quarter of all */
    rqt_code grid[2][LARGEST_COUNT / 3];
} error_scratch;

/* error (row by row) -> scratch->residual. q: the heights as the decoder will know them. */
void predict_errors(error_scratch *scratch, int k, const int32_t *q, double quantum, const rqt_code *error);
/* scratch->residual -> error */
void restore_errors(error_scratch *scratch, int k, const int32_t *q, double quantum, rqt_code *error);

#endif
