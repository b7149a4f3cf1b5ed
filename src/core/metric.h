/* metric.h - what the files about other metrics share. */
#ifndef RQT_METRIC_H
#define RQT_METRIC_H

#include "internal.h"

/* A triangle is known by its split vertex and by which of that vertex' two parents is its apex: number 0 or 1, in
 * the order of rqt_vertex_parents for a vertex that has both. */
static inline int apex_number(rqt_vertex apex, rqt_vertex split) {
    if (apex.y == split.y) return apex.x > split.x;
    if (apex.x == split.x) return apex.y > split.y;
    return apex.x < split.x;
}

/* s of every vertex: the least fixed point over the deviations (2 codes for each place of s's arrays: the triangles
 * of apex number 0 and 1; RQT_CODE_INFINITY for one that no mesh may have). s comes zeroed. minimal.c */
void minimal_solve(rqt_errors *s, const rqt_code *deviation);

#endif
