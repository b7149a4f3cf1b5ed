/* block_predict.h - how the block codec turns heights and errors into small numbers, and back. block_predict.c */
#ifndef RQT_BLOCK_PREDICT_H
#define RQT_BLOCK_PREDICT_H

#include "internal.h"

#include <math.h>

#define INLINE static inline __attribute__((always_inline))

enum {
    LARGEST_N = (1 << RQT_MAX_BLOCK_K) + 1,
    LARGEST_COUNT = LARGEST_N * LARGEST_N,
};

/* Signed residuals as small unsigned numbers: 0, -1, 1, -2, 2 ... */
INLINE uint32_t zigzag32(uint32_t r) {
    return r << 1 ^ (0 - (r >> 31));
}
INLINE uint32_t unzigzag32(uint32_t v) {
    return v >> 1 ^ (0 - (v & 1));
}
INLINE uint16_t zigzag16(uint16_t r) {
    return (uint16_t)(r << 1 ^ (0 - (r >> 15)));
}
INLINE uint16_t unzigzag16(uint16_t v) {
    return (uint16_t)(v >> 1 ^ (0 - (v & 1)));
}

/* Residuals of one row of heights. above is NULL for the first row. */
void predict_height_row(const int32_t *row, const int32_t *above, int32_t width, uint32_t *residual);
/* All stored rows of a block, `side` apart, from `count` planes of residuals that are `stored` bytes apart. Returns
 * a number with its top bit set when a height is beyond RQT_HEIGHT_LIMIT. */
uint32_t restore_heights(const uint8_t *planes, size_t stored, int count, int32_t width, int32_t height,
                         int32_t side, int32_t *q);

/* n numbers from the planes that start at p and are `plane` bytes apart. */
INLINE void get_planes(const uint8_t *p, size_t plane, int planes, int32_t n, uint32_t *v) {
    const uint8_t *a = p, *b = a + plane, *c = b + plane, *d = c + plane;
    switch (planes) {
    case 0:
        for (int32_t i = 0; i < n; i++) v[i] = 0;
        break;
    case 1:
        for (int32_t i = 0; i < n; i++) v[i] = a[i];
        break;
    case 2:
        for (int32_t i = 0; i < n; i++) v[i] = (uint32_t)(a[i] | b[i] << 8);
        break;
    case 3:
        for (int32_t i = 0; i < n; i++) v[i] = (uint32_t)(a[i] | b[i] << 8 | c[i] << 16);
        break;
    default:
        for (int32_t i = 0; i < n; i++) v[i] = (uint32_t)(a[i] | b[i] << 8 | c[i] << 16) | (uint32_t)d[i] << 24;
        break;
    }
}

/* The code nearest above a float >= 0: 8 significant bits are the top 16 of its bits, with another bias. */
INLINE rqt_code code_near_above(float v) {
    uint32_t bits;
    memcpy(&bits, &v, 4);
    uint32_t code = ((bits + 0xFFFF) >> 16) + ((263 - 7 - 127) << 7);
    return (rqt_code)(bits ? code : 0);
}

/* What z differs from the midpoint of two heights with this sum: |2z - sum| times half, as a code. */
INLINE rqt_code midpoint_code(int32_t z, uint32_t sum, float half) {
    return code_near_above(fabsf((float)(int32_t)(2 * (uint32_t)z - sum)) * half);
}

INLINE uint32_t sum_of(int32_t a, int32_t b) {
    return (uint32_t)a + (uint32_t)b;
}

/* Half a quantum, less one part in 2^20: so that a product that is a code itself, and that rounding has lifted a
 * little, gives this code and not the next. Kept where no product overflows or denormalises. */
float half_of(double quantum);

/* What an outline costs at a scale, by what it costs at the finest: a triangle twice as wide costs twice as much.
 */
INLINE rqt_code ground_at(rqt_code ground, int scale) {
    const uint32_t code = ground + 128u * (uint32_t)scale;
    return (rqt_code)(code < RQT_CODE_INFINITY ? code : RQT_CODE_INFINITY);
}

/* ------------------------------------------------------------------------------ blocks that keep all vertices */

/* Room for a pass over the errors of the largest block. code and residual are in coding order: FORMAT.md. */
typedef struct error_scratch {
    rqt_code code[LARGEST_COUNT];
    uint16_t residual[LARGEST_COUNT];
    int32_t heights[2][LARGEST_COUNT / 3]; /* of every 2nd, 4th .. row and column; more than a quarter of all */
    rqt_code grid[2][LARGEST_COUNT / 3];
} error_scratch;

/* What errors are predicted from. */
typedef struct error_field {
    int k;
    int32_t width, height; /* stored heights */
    const int32_t *q;      /* all heights, as the decoder will know them */
    const uint8_t *flags;  /* NULL: all valid, and no outline */
    rqt_code ground;       /* what an outline vertex of the finest scale errs; 0: not known */
    double quantum;
    bool finest_exact, others_exact; /* restoring: the residuals of the finest scale, of the others are all 0 */
} error_field;

/* error (row by row; the corners do not count) -> scratch->residual. */
void predict_errors(error_scratch *scratch, const error_field *field, const rqt_code *error);
/* scratch->residual -> error, that of the corners 0. */
void restore_errors(error_scratch *scratch, const error_field *field, rqt_code *error);

/* --------------------------------------------------------------------- validity and outline: block_flags.c */

enum { ROW_WORDS = (LARGEST_N + 63) / 64 };
typedef struct bit_grid {
    uint64_t row[LARGEST_N][ROW_WORDS];
} bit_grid;
typedef struct flag_scratch {
    bit_grid valid, outline, residual;
} flag_scratch;

/* Outline bits of flags, in which the corners have none, -> n*n residual bits, row by row. */
void predict_outline(flag_scratch *scratch, int k, int32_t width, int32_t height, const uint8_t *flags,
                     uint8_t *bits);

typedef struct flag_source {
    int k;
    int32_t width, height;
    bool all_void;
    const uint8_t *validity; /* bits of width*height; NULL: all alike */
    const uint8_t *outline;  /* residuals; NULL: none. After both, 16 more bytes may be read. */
} flag_source;
/* And back. False: validity bits that are all alike, no outline bit that comes out, or a corner's. */
bool restore_flags(flag_scratch *scratch, const flag_source *from, uint8_t *flags);

/* ------------------------------------------------------------------------------- sparse blocks: block_sparse.c */

enum { KEPT_CORNERS = 4 };

/* The kept vertices of a block, the corners first, then from coarse to fine. */
typedef struct kept_vertex {
    int32_t at; /* y * n + x */
    int16_t x, y;
} kept_vertex;
typedef struct kept_list {
    kept_vertex vertex[LARGEST_COUNT + 1];
    size_t count;
    int scales;                     /* of these, coarsest first: */
    size_t end[RQT_MAX_BLOCK_K][2]; /* where its centres end, where its sides end */
    size_t offered;                 /* bits */
    uint8_t bits[LARGEST_COUNT / 8 + 1];
    uint8_t kept[LARGEST_COUNT], seen[LARGEST_COUNT];
} kept_list;

/* From a block. False: what it keeps is not closed. */
bool kept_list_make(kept_list *list, const rqt_block *block);
/* From bits. False: not so many. */
bool kept_list_read(kept_list *list, int k, const uint8_t *bits, size_t bytes);

/* q -> count residuals. A void gets the height that is expected of it. */
void predict_kept_heights(const kept_list *list, int k, const uint8_t *flags, int32_t *q, uint32_t *residual);
/* The kept places of q. Returns a number with its top bit set when a height is beyond RQT_HEIGHT_LIMIT. */
uint32_t restore_kept_heights(const kept_list *list, int k, const uint32_t *residual, int32_t *q);

/* The least error of an outline vertex of the finest scale; 0: there is none. */
rqt_code kept_ground(const kept_list *list, const rqt_block *block);
/* block->error -> count - KEPT_CORNERS residuals. scratch: n*n. */
void predict_kept_errors(const kept_list *list, const rqt_block *block, const int32_t *q, double quantum,
                         rqt_code ground, rqt_code *scratch, uint16_t *residual);
/* Into block->error, which is 0 throughout. flagged: a vertex is void, or has the outline bit. False: a vertex is
 * kept without reason. */
bool restore_kept_errors(const kept_list *list, const rqt_block *block, bool flagged, double quantum,
                         rqt_code ground, uint16_t *residual);

#endif
