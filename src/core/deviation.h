/* deviation.h - what one bintree triangle of a raster deviates from its samples. deviation.c */
#ifndef RQT_DEVIATION_H
#define RQT_DEVIATION_H

#include "internal.h"

enum { HAS_VALID = 1, HAS_VOID = 2 }; /* what samples a closed triangle holds */

typedef struct deviation_field {
    rqt_lattice lattice;
    int32_t width, height;
    const int32_t *q;
    const uint8_t *valid; /* NULL: all */
    code_scale scale;
    rqt_void_cost cost;
    int64_t relief; /* largest difference of two valid heights */
} deviation_field;

static inline int32_t height_at(const deviation_field *s, int32_t x, int32_t y) {
    const int32_t cx = x < s->width ? x : s->width - 1, cy = y < s->height ? y : s->height - 1;
    return s->q[(size_t)cy * (size_t)s->width + (size_t)cx];
}

static inline bool valid_at(const deviation_field *s, int32_t x, int32_t y) {
    if (!s->valid) return true;
    const int32_t cx = x < s->width ? x : s->width - 1, cy = y < s->height ? y : s->height - 1;
    return s->valid[(size_t)cy * (size_t)s->width + (size_t)cx] != 0;
}

static inline int state_at(const deviation_field *s, int32_t x, int32_t y) {
    return valid_at(s, x, y) ? HAS_VALID : HAS_VOID;
}

typedef struct triangle_error {
    int state;     /* HAS_VALID | HAS_VOID over the closed triangle */
    rqt_code code; /* the larger of deviation and ground */
    bool mixed;
    /* The parts: the largest |height - plane| is deviation / denominator quanta, 0 where a corner is void; what an
     * outline costs, 0 unless mixed. */
    unsigned __int128 deviation;
    uint64_t denominator;
    rqt_code ground;
} triangle_error;

/* The deviation of a triangle inside the raster whose samples are all valid, as a multiple of 2^-*shift quanta. */
uint64_t plane_deviation(const deviation_field *s, const rqt_triangle *t, int *shift);
/* A triangle that is mixed, or clamped, or both, with an area. known_state < 0: to be found out. */
triangle_error irregular_error(const deviation_field *s, const rqt_triangle *t, int known_state);
/* The largest difference of two valid heights. */
int64_t relief_of(const rqt_grid *grid);

#endif
