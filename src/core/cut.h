/* cut.h - what the two files of mode `cut` share, and what they ask of a region: cut.c goes through the leaves,
 * cut_faces.c keeps one leaf as faces. Private to the core.
 *
 * The grid. Everything happens on integers: a sample is 2^G units, G = 52 - K on a lattice of side 2^K. So a
 * coordinate is below 2^53 and is a double as it stands: the grid is as fine as doubles are at the far end of the
 * terrain. The grid of regions, 2^-20 sample, is part of it. Differences fit int64, products __int128. */
#ifndef RQT_CUT_H
#define RQT_CUT_H

#include "region_edges.h"

#define CUT_GRID_BITS(K) (52 - (K))

/* Rounded to nearest (halves up): n * part / whole, 0 <= part <= whole, 0 < whole < 2^126. Exact until then. */
uint64_t cut_share(uint64_t n, __int128 part, __int128 whole);

/* ------------------------------------------------------------------------------------------ cut_faces.c --
 * One leaf, divided: points, and faces between them, which tile the leaf at any time without T-junctions. */
#define CUT_NO_FACE UINT32_MAX

typedef struct cut_face {
    uint32_t corner[3]; /* points; region_side is above 0 */
    uint32_t next[3];   /* the face across the edge from corner[i] to corner[i + 1]; CUT_NO_FACE: the leaf's side */
    bool fixed[3];      /* a piece of border runs along that edge */
    uint32_t mark;
} cut_face;

/* An edge of a hole in the faces, with what is beyond. */
typedef struct cut_rim {
    uint32_t to;       /* point; it comes from the one before */
    uint32_t face;     /* CUT_NO_FACE: nothing */
    bool fixed, loose; /* loose: what was beyond goes too */
} cut_rim;

typedef struct cut_faces {
    rqt_allocator allocator;
    region_point *points; /* 0, 1, 2: the leaf's corners */
    uint32_t *face_of;    /* a face that has the point */
    cut_face *faces;
    size_t point_count, point_capacity, face_of_capacity, face_count, face_capacity;
    uint32_t last, mark, turn; /* where the last search ended; stamps; which edge it looks at first */
    size_t patience;           /* how many more crossings are followed: see cut_faces_fix */
    bool is_sound;             /* every segment is a union of edges */
    cut_rim *rim[2], *stack;
    size_t rim_count[2], rim_capacity[2], stack_capacity;
    uint32_t *hole, *pairs;
    size_t hole_count, hole_capacity, pair_count, pair_capacity;
} cut_faces;

void cut_faces_free(cut_faces *f);
/* A leaf of one face; the corners have region_side above 0. False: no memory (so below). */
bool cut_faces_begin(cut_faces *f, const region_point corner[3]);
/* The number of the point at a place of the closed leaf, a new one if need be. */
bool cut_faces_add(cut_faces *f, region_point place, uint32_t *point);
/* See to it that the segment between two points is a union of edges, but for rounding where it crosses others. */
bool cut_faces_fix(cut_faces *f, uint32_t from, uint32_t to);

/* -------------------------------------------------------------------------------------------- region.c -- */
/* floor + (x, y) / 2^bits in units of the region's grid, 0 <= x,y < 2^bits, bits 0 .. 40. */
typedef struct region_fine_point {
    region_point floor;
    int64_t x, y;
    int bits;
} region_fine_point;
/* False for regions of squares: nothing below may be asked of them. */
bool region_has_border(const rqt_region *region);
/* Is the point in a member with an area? On its border: yes or no. */
bool region_holds(const rqt_region *region, const region_fine_point *p);
/* Does a line or point of the region touch the closed triangle? */
bool region_thin_touches(const rqt_region *region, const region_triangle *t);
/* Borders of the members with an area: the pieces that touch a box, one after the other. */
typedef struct region_border_search {
    const rqt_region *region;
    region_box box;
    region_search polygons, pieces;
    size_t first; /* piece of the polygon at hand */
    int side;     /* of a rectangle: the next one; 4: done */
    region_box rectangle;
    bool is_open;
} region_border_search;
void region_border_begin(region_border_search *s, const rqt_region *region, const region_box *box);
bool region_border_next(region_border_search *s, region_piece *piece);

#endif
