/* region_squares.h - a union of squares whose sides are powers of two: region_squares.c. Private to the core. */
#ifndef RQT_REGION_SQUARES_H
#define RQT_REGION_SQUARES_H

#include "region_edges.h"

typedef struct region_squares {
    uint64_t *keys; /* of squares that do not overlap, no four of them a larger one; ascending */
    size_t count, capacity;
} region_squares;

/* Begin with one of zeros; what it holds, the caller releases, also on failure. Squares come along the Morton
 * curve, one that holds others anywhere among them; RQT_INVALID for other squares, and such as are none. */
rqt_status region_squares_add(region_squares *squares, rqt_square square, const rqt_allocator *allocator);
rqt_square region_squares_at(const region_squares *squares, size_t n);

/* How an open box of samples that is not empty lies to the union. Exact: INSIDE, it is in the closed union;
 * OUTSIDE, it has no point in common with the interior of a square. */
rqt_relation region_squares_relation(const region_squares *squares, int32_t x0, int32_t y0, int32_t x1, int32_t y1);
/* The interiors share a point. */
bool region_squares_meet(const region_squares *squares, const region_triangle *t);

#endif
