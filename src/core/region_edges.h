/* region_edges.h - integer geometry beneath region.c: points on a grid of 2^-20 sample, pieces of polygon borders,
 * a tree that finds them, and the exact questions a triangle or a box can ask of them. Private to the core.
 *
 * Coordinates of regions are at most 2^60 away from 0, those of triangles and boxes 2^51 (int32 samples). So every
 * difference fits int64, every product __int128. Nothing here rounds. */
#ifndef RQT_REGION_EDGES_H
#define RQT_REGION_EDGES_H

#include "internal.h"

#include <math.h>

#define REGION_UNIT ((int64_t)1 << 20) /* of a sample */
#define REGION_LIMIT ((int64_t)1 << 60)

typedef struct region_point {
    int64_t x, y;
} region_point;

typedef struct region_box { /* closed; empty when x0 > x1 */
    int64_t x0, y0, x1, y1;
} region_box;

typedef struct region_piece { /* a closed segment; a point when both ends are equal */
    region_point a, b;
} region_piece;

/* A coordinate in units from the first sample. */
static inline int64_t region_units(double v, double origin, double step) {
    double samples = (v - origin) / step;
    double units = samples * (double)REGION_UNIT; /* a power of two: exact, or infinite */
    if (units >= (double)REGION_LIMIT) return REGION_LIMIT;
    if (units <= -(double)REGION_LIMIT) return -REGION_LIMIT;
    return (int64_t)rint(units);
}

static inline region_box region_piece_box(const region_piece *p) {
    bool right = p->a.x <= p->b.x, down = p->a.y <= p->b.y;
    return (region_box){right ? p->a.x : p->b.x, down ? p->a.y : p->b.y, right ? p->b.x : p->a.x,
                        down ? p->b.y : p->a.y};
}
static inline void region_box_add(region_box *box, const region_box *other) {
    if (other->x0 < box->x0) box->x0 = other->x0;
    if (other->y0 < box->y0) box->y0 = other->y0;
    if (other->x1 > box->x1) box->x1 = other->x1;
    if (other->y1 > box->y1) box->y1 = other->y1;
}
/* Closed boxes share a point. */
static inline bool region_boxes_touch(const region_box *p, const region_box *q) {
    return p->x0 <= q->x1 && q->x0 <= p->x1 && p->y0 <= q->y1 && q->y0 <= p->y1;
}
/* The closed p (perhaps without an area) shares a point with the interior of q. */
static inline bool region_boxes_overlap(const region_box *p, const region_box *q) {
    return p->x0 < q->x1 && q->x0 < p->x1 && p->y0 < q->y1 && q->y0 < p->y1;
}
static inline bool region_box_is_within(const region_box *p, const region_box *q) {
    return p->x0 >= q->x0 && p->x1 <= q->x1 && p->y0 >= q->y0 && p->y1 <= q->y1;
}

/* Twice the area of a, b, c: above 0 when c lies on one side of the line a to b, below on the other, 0 on it. */
static inline __int128 region_side(region_point a, region_point b, region_point c) {
    return (__int128)(b.x - a.x) * (c.y - a.y) - (__int128)(b.y - a.y) * (c.x - a.x);
}

/* A triangle with an area, its corners turned so that its interior has region_side above 0. */
typedef struct region_triangle {
    region_point corner[3];
    region_point inner; /* a point of its interior */
    region_box box;
} region_triangle;

/* False when the three samples lie on a line. */
bool region_triangle_init(region_triangle *t, rqt_vertex a, rqt_vertex b, rqt_vertex c);
/* The piece shares a point with the triangle's interior. */
bool region_triangle_is_crossed(const region_triangle *t, const region_piece *piece);
/* The piece shares a point with the closed triangle. */
bool region_triangle_is_touched(const region_triangle *t, const region_piece *piece);
/* The interiors of a triangle and of a box with an area share a point. */
bool region_triangle_overlaps(const region_triangle *t, const region_box *box);
/* The same two questions for a box; for the first it needs an area. */
bool region_box_is_crossed(const region_box *box, const region_piece *piece);
bool region_box_is_touched(const region_box *box, const region_piece *piece);

/* ------------------------------------------------------------------------------------------ odd pieces -- */
typedef struct region_pieces {
    region_piece *items;
    size_t count, capacity;
} region_pieces;

bool region_pieces_add(region_pieces *pieces, region_piece piece, const rqt_allocator *allocator);

/* Append to `out` what the n edges cover an odd number of times: see region_edges.c. work is scratch that a caller
 * keeps between calls, and releases. False: no memory. */
typedef struct region_work {
    void *bytes;
    size_t capacity;
} region_work;

bool region_odd_pieces(const region_piece *edges, size_t n, region_work *work, region_pieces *out,
                       const rqt_allocator *allocator);

/* ------------------------------------------------------------------------------------------------ tree -- */
/* A packed tree over boxes in an order in which neighbours are near each other: level 0 the boxes themselves, then
 * one box around each 8 of them, until at most 8 are left. All in one array, found by counting. */
typedef struct region_search {
    const region_box *nodes;
    region_box box;
    size_t first[24], count[24]; /* of each level; 8^24 is more than can be counted */
    int level, top;
    size_t index, end; /* the next node of this level, and the end of its family */
} region_search;

size_t region_tree_size(size_t count); /* boxes in the array */
/* nodes[0 .. count-1] are filled in; builds the rest. */
void region_tree_build(region_box *nodes, size_t count);
/* Search a built tree for boxes that touch `box`; next gives the number of one after the other. */
void region_search_begin(region_search *s, const region_box *nodes, size_t count, const region_box *box);
bool region_search_next(region_search *s, size_t *item);

/* ------------------------------------------------------------------------------------------- region.c --
 * What rules ask of a region beside the questions of rqt.h. */
/* A box around all of it; false when it is empty. */
bool region_extent(const rqt_region *region, region_box *box);
/* Does the closed region share a point with the closed box? A polygon is the closure of its interior. */
bool region_touches(const rqt_region *region, const region_box *box);
/* rqt_region_box_relation and rqt_region_meets for the members with an area alone. */
rqt_relation region_area_relation(const rqt_region *region, int32_t x0, int32_t y0, int32_t x1, int32_t y1);
bool region_area_meets(const rqt_region *region, rqt_vertex a, rqt_vertex b, rqt_vertex c);

#endif
