/* order.h - the order that increments number a mesh by. order.c */
#ifndef RQT_ORDER_H
#define RQT_ORDER_H

#include "internal.h"

/* A vertex's place in the order; below 2^(2 * (RQT_MAX_K + 1)), and back. */
uint64_t order_key(int32_t col, int32_t row);
rqt_vertex order_place(uint64_t key);
/* Of triangles: below 0, 0, above 0. */
int order_compare(const uint32_t a[3], const uint32_t b[3]);

#endif
