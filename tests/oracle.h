/* oracle.h - the definitions of a restricted quadtree terrain, computed the slow and obvious way.
 *
 * The oracle is what the fast core is tested against. It shares no code and no header with the core: it knows the
 * definitions only, and where the core is clever the oracle loops.
 *  - Errors are exact rationals of GMP from the samples to the last comparison; nothing is rounded before it is
 *    made a code.
 *  - The lattice is a full array of (2^K + 1)^2 vertices. Its dependency graph is read off the triangles of the
 *    bintree, which are enumerated recursively; no formula for parents, children or levels appears.
 *  - Saturation and closure repeat "a parent is at least its child" over the whole array until nothing changes.
 *  - A triangle is compared with every sample of its box; a window with a triangle by clipping polygons.
 * Costs: memory about 100 bytes a lattice vertex, time about 1 us per sample and depth of the bintree.
 * Out of memory ends the program: it is a test. */
#ifndef ORACLE_H
#define ORACLE_H

#include <gmp.h>
#include <stddef.h>

#define ORACLE_INFINITY 65535u /* the code of an infinite error */
#define ORACLE_LARGEST 65534u  /* the largest finite code */

typedef struct oracle_point {
    int x, y;
} oracle_point;

/* Lattice positions: the apex, then the two ends of the hypotenuse. */
typedef struct oracle_triangle {
    oracle_point corner[3];
    int depth; /* 0 for the two halves of the root square */
} oracle_triangle;

/* The samples and what their numbers mean. One quantum is |scale| * numerator / (denominator * d) metres. */
typedef struct oracle_terrain {
    int width, height;
    const int *q;               /* row by row */
    const unsigned char *valid; /* NULL: all are */
    double scale;
    long numerator, denominator, d;
    double cell, c; /* an outline triangle costs extent * cell / c metres */
} oracle_terrain;

typedef struct oracle_node {
    int level; /* 0 for the corners of the root square, K for the finest */
    int parent_count, child_count;
    oracle_point parent[2], child[4];
    mpq_t raw, saturated; /* e(P), e_sat(P) in metres; a root corner's infinity appears in its code only */
    int raw_outline, outline;
    unsigned raw_code, code;
} oracle_node;

typedef struct oracle {
    oracle_terrain terrain;
    int K, side;       /* side = 2^K + 1 vertices */
    oracle_node *node; /* side * side, row by row */
    mpq_t quantum;
} oracle;

typedef struct oracle_list {
    oracle_triangle *triangle;
    size_t count, capacity;
} oracle_list;

/* The arrays of the terrain must outlive the oracle. */
void oracle_create(oracle *o, const oracle_terrain *terrain);
/* Without the lattice, for rasters that are too large for it: then only functions of single triangles and of codes
 * may be called. */
void oracle_create_bare(oracle *o, const oracle_terrain *terrain);
void oracle_free(oracle *o);
const oracle_node *oracle_at(const oracle *o, int x, int y);
/* The sample that a lattice vertex stands for, and whether it has data. */
oracle_point oracle_clamp(const oracle *o, oracle_point p);
int oracle_is_valid(const oracle *o, oracle_point lattice);

/* Error codes: smallest code not below, largest code not above, value. m >= 0; results are finite codes. */
unsigned oracle_code_up(const mpq_t m);
unsigned oracle_code_down(const mpq_t m);
void oracle_code_value(mpq_t value, unsigned code);

/* Sets of lattice vertices: one byte a vertex, side * side, row by row. Root corners are always in. */
unsigned char *oracle_set_create(const oracle *o);
/* {P : code of e_sat(P) > eps, or `exact` and the saturated outline bit} */
void oracle_select(const oracle *o, unsigned eps, int exact, unsigned char *set);
/* The closure of {P : code of e(P) > eps, or `exact` and the outline bit of P's own diamond} */
void oracle_select_raw(const oracle *o, unsigned eps, int exact, unsigned char *set);
/* Adds parents until nothing changes. */
void oracle_close(const oracle *o, unsigned char *set);

/* All leaves of the mesh of a closed set that are kept: three valid vertices and an area. Appends. */
void oracle_leaves(const oracle *o, const unsigned char *set, oracle_list *list);
/* The two halves of the root square, and the two children of a triangle: 0 when it is a half cell of the lattice.
 */
oracle_triangle oracle_root_half(const oracle *o, int which);
int oracle_children(const oracle_triangle *t, oracle_triangle child[2]);
/* The finest triangles of the bintree that have an area: the unit half-cells of the raster. Appends. */
void oracle_unit_triangles(const oracle *o, oracle_list *list);
void oracle_list_free(oracle_list *list);

/* Twice the area of the clamped triangle, >= 0, in samples. */
long oracle_area(const oracle *o, const oracle_triangle *t);
/* What a triangle adds to its split vertex: its error in metres, the cost of an outline included; is it mixed? */
void oracle_triangle_error(const oracle *o, const oracle_triangle *t, mpq_t metres, int *mixed);
/* The largest deviation in metres over the valid samples of the closed clamped triangle. Its corners are valid. */
void oracle_deviation(const oracle *o, const oracle_triangle *t, mpq_t metres);

/* Coordinates of windows: integer multiples of 2^-20 of a sample. */
#define ORACLE_UNITS (1L << 20)
/* The nearest such multiple of a coordinate in samples. */
long oracle_round(double samples);
/* Does the interior of the clamped triangle meet the interior of the rectangle x0 < x1, y0 < y1? */
int oracle_meets_rectangle(const oracle *o, const oracle_triangle *t, const long rectangle[4]);
/* Does the closed clamped triangle (which has an area) meet the closed segment, which may be one point? */
int oracle_meets_segment(const oracle *o, const oracle_triangle *t, const long segment[4]);
/* Twice the area that two triangles of samples have in common; b has an area. */
void oracle_common_area(const oracle_point a[3], const oracle_point b[3], mpq_t area);

#endif
