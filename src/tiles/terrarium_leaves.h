/* terrarium_leaves.h - blocks as triangles among the pixels of a tile: what drawing and proving have in common. */
#ifndef RQT_TILES_TERRARIUM_LEAVES_H
#define RQT_TILES_TERRARIUM_LEAVES_H

#include "terrarium.h"

/* Samples by which a pixel may be beyond a leaf's side and be taken for in it, so that none falls between two. */
#define SLACK 0x1p-30

/* A vertex of a block. */
typedef struct corner {
    double col, row, metres;
    bool valid;
    int i, j; /* on the block's lattice */
} corner;

enum { MOST_SIDE = (1 << RQT_MAX_BLOCK_K) + 1 };
/* A block on the turn that is at hand. */
typedef struct lattice {
    pixel_grid *g;
    const rqt_block *block;
    int n;                                          /* vertices a side */
    double col[MOST_SIDE], row[MOST_SIDE];          /* of its columns and rows, in samples */
    int first_col[MOST_SIDE], first_row[MOST_SIDE]; /* the pixels that are at them or next beyond */
} lattice;

/* The block is read. */
int lattice_read(tiles *t, const rqt_block_place *place, rqt_block_number number, lattice *l, char **error);
/* Both halves: apex, left, right each. */
void lattice_halves(const lattice *l, const rqt_block_place *place, corner halves[2][3]);
/* Is the triangle's split vertex kept? Then it is the apex of both children. */
bool lattice_split(const lattice *l, const corner triangle[3], corner children[2][3]);
bool lattice_keeps(const lattice *l, size_t vertex);

/* A triangle's box: columns and rows of the lattice. */
typedef struct lattice_box {
    int west, east, north, south;
} lattice_box;
lattice_box lattice_box_of(const corner triangle[3]);
/* Has it no area, or nothing between the outermost pixels? */
bool lattice_misses(const lattice *l, const corner triangle[3]);
/* Extent in columns of what a triangle has between two rows; false: nothing. */
bool triangle_span(const corner triangle[3], double from, double to, double *west, double *east);
/* Height on a triangle's plane at a place: at + by_col * col + by_row * row. False: it has no area. */
typedef struct plane {
    double at, by_col, by_row;
} plane;
bool triangle_plane(const corner triangle[3], plane *p);

/* Calls visit for all blocks of a level that meet the pixels, turn by turn. */
typedef int visit_block(tiles *t, const rqt_block_place *place, rqt_block_number number, int turn, void *context,
                        char **error);
int lattice_visit(tiles *t, int level, pixel_grid *g, visit_block *visit, void *context, char **error);

/* When all is drawn by the blocks of a level: the error. terrarium_proof.c */
int leaves_prove(tiles *t, int level, pixel_grid *g, char **error);

#endif
