/* deviation.h - what the samples of one bintree triangle deviate from its plane. deviation.c */
#ifndef RQT_DEVIATION_H
#define RQT_DEVIATION_H

#include "internal.h"
#include "error_kernels.h"

enum { HAS_VALID = 1, HAS_VOID = 2 }; /* what samples a closed triangle holds */

/* A terrain, and those of its samples that are at hand: whole rows, or a window. */
typedef struct deviation_field {
    rqt_lattice lattice;
    int32_t width, height;
    int32_t first_row, first_column; /* of the terrain, the first sample of q and valid */
    size_t stride;                   /* from row to row of q and valid; the width where rows are whole */
    const int32_t *q;
    const uint8_t *valid; /* NULL: all */
    code_scale scale;
    rqt_void_cost cost;
    int64_t relief; /* largest difference of two valid heights */
    const error_kernels *kernels;
} deviation_field;

/* Samples, both ends included. */
typedef struct sample_window {
    int32_t x0, y0, x1, y1;
} sample_window;

/* A triangle of the lattice with the heights of its corners, which need not be at hand in the field. */
typedef struct plane_triangle {
    rqt_triangle t;
    int32_t apex, left, right; /* heights */
    bool has_plane;            /* all three are valid */
} plane_triangle;

typedef struct triangle_part {
    int state;     /* HAS_VALID | HAS_VOID of the samples looked at; 0 where there are none */
    rqt_code code; /* of their largest deviation; 0 where there is no plane */
} triangle_part;

static inline size_t sample_index(const deviation_field *s, int32_t x, int32_t y) {
    return (size_t)(y - s->first_row) * s->stride + (size_t)(x - s->first_column);
}

/* The sample of a lattice vertex, clamped, of those at hand. */
static inline size_t clamped_index(const deviation_field *s, int32_t x, int32_t y) {
    return sample_index(s, x < s->width ? x : s->width - 1, y < s->height ? y : s->height - 1);
}

static inline int32_t height_at(const deviation_field *s, int32_t x, int32_t y) {
    return s->q[clamped_index(s, x, y)];
}

static inline bool valid_at(const deviation_field *s, int32_t x, int32_t y) {
    return !s->valid || s->valid[clamped_index(s, x, y)] != 0;
}

static inline int state_at(const deviation_field *s, int32_t x, int32_t y) {
    return valid_at(s, x, y) ? HAS_VALID : HAS_VOID;
}

/* A clamped triangle: any triangle of samples, counter-clockwise or made so; its plane without division. */
typedef struct sample_triangle {
    rqt_vertex corner[4]; /* the first one again at the end */
    int64_t area;         /* twice */
    __int128 gx, gy;      /* gradients times `area` */
    int32_t base;         /* height of the first corner */
    bool in_doubles;      /* its plane is exact in doubles: every term and sum is below 2^53 */
} sample_triangle;
sample_triangle sample_triangle_of(const deviation_field *s, const plane_triangle *p);
typedef struct row_span {
    int32_t x0, x1; /* none where x0 > x1 */
} row_span;
/* Its samples in row y, of those from x0 to x1. */
row_span triangle_row(const sample_triangle *t, int32_t x0, int32_t x1, int32_t y);

/* Does the clamped triangle have an area? Those that have none cost nothing and are never mixed. */
bool triangle_has_area(const deviation_field *s, const rqt_triangle *t);
/* The triangle with the heights of its corners, all of which are in rows at hand. */
plane_triangle triangle_of_samples(const deviation_field *s, const rqt_triangle *t);
/* The part of a triangle with an area that lies in a window of rows at hand. Parts whose windows cover a triangle
 * add up to it: states by "or", codes by their maximum. */
triangle_part measure_triangle(const deviation_field *s, const plane_triangle *t, const sample_window *window);
/* What a mixed triangle costs at least. */
rqt_code outline_code(const deviation_field *s, const rqt_triangle *t);
/* A whole triangle in parts, for other metrics: the largest |height - plane| is deviation / denominator quanta, 0
 * where a corner is void; ground: what an outline costs, 0 unless mixed; code: the larger of both. */
typedef struct triangle_error {
    int state; /* HAS_VALID | HAS_VOID over the closed triangle */
    bool mixed;
    unsigned __int128 deviation;
    uint64_t denominator;
    rqt_code ground, code;
} triangle_error;
/* Of a triangle with an area that is mixed, or clamped, or both. known_state < 0: to be found out. */
triangle_error irregular_error(const deviation_field *s, const rqt_triangle *t, int known_state);
/* Of one inside the raster whose samples are all valid, the deviation as a multiple of 2^-*shift quanta. */
uint64_t regular_deviation(const deviation_field *s, const rqt_triangle *t, int *shift);
/* The mean distance, vertical, in quanta, of the valid samples of a triangle with an area from the plane fitted to
 * them by least squares; 0 where there are none. fit.c */
double fitted_distance(const deviation_field *s, const rqt_triangle *t);
/* The largest difference of two valid heights. */
int64_t relief_of(const rqt_grid *grid);

#endif
