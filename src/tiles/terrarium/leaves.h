/* leaves.h - blocks as meshes among the pixels of a tile: what drawing and proving have in common. */
#ifndef RQT_TILES_TERRARIUM_LEAVES_H
#define RQT_TILES_TERRARIUM_LEAVES_H

#include "terrarium.h"

/* Samples by which a pixel may be beyond a triangle's side and be taken for in it, so that none falls between two.
 */
#define SLACK 0x1p-30

enum { MOST_SIDE = (1 << RQT_MAX_BLOCK_K) + 1 };
enum { HAS_HEIGHT = 1, IS_SAMPLE = 2 }; /* of a vertex: see lattice */

/* A block on the turn that is at hand: the mesh of its leaves as heights at all vertices of its lattice. A vertex
 * that the block keeps is a sample; any other has the height of the leaf that it is in. So two triangles in each
 * cell of the lattice are the mesh (lattice_height has them), but for leaves that lattice_straddles tells. */
typedef struct lattice {
    pixel_grid *g;
    const rqt_block *block; /* until another one is read */
    int n;                  /* vertices a side */
    double stride;          /* samples from one to the next, where it is not squeezed */
    int turned;             /* 1: the diagonals are the other way around, as in a block of one cell */
    bool is_squeezed;       /* reaches beyond the raster */
    bool has_voids;         /* at vertices in the box */
    double floor;           /* metres: samples in leaves with three corners are no further off */
    double col[MOST_SIDE], row[MOST_SIDE];          /* of its columns and rows, in samples */
    int first_col[MOST_SIDE], first_row[MOST_SIDE]; /* the pixels that are at them or next beyond */
    int cell_col[MOST_SIDE], cell_row[MOST_SIDE]; /* the pixels that are at them or before; < 0: there is no cell */
    double u[MOST_SIDE], v[MOST_SIDE];            /* how far beyond those they are, 0 .. 1 of a cell */
    int at_col[GRID], at_row[GRID];               /* the cell of the lattice that each pixel of the window is in */
    double fx[GRID], fy[GRID];                    /* where in it, 0 .. 1 */
    double metres[MOST_SIDE * MOST_SIDE];
    uint8_t what[MOST_SIDE * MOST_SIDE];
} lattice;

/* A box of the lattice: columns and rows, the last ones too. */
typedef struct lattice_box {
    int west, east, north, south;
} lattice_box;
/* The block is read, placed, and filled where the box and what is near the pixels have something in common: that is
 * what box becomes. (Triangles of which something is inside it are filled at their corners and split vertices.) */
int lattice_read(tiles *t, const rqt_block_place *place, rqt_block_number number, lattice *l, lattice_box *box,
                 char **error);

/* What a box has between the outermost pixels: lines of the lattice, without those that are the one before again,
 * and lines of pixels. */
typedef struct lattice_window {
    lattice_box lines, pixels; /* empty: west after east, north after south */
} lattice_window;
lattice_window lattice_window_of(const lattice *l, const lattice_box *box);

/* The height at a place in a cell of the lattice, if its half cell has a height. */
static inline bool lattice_height(const lattice *l, int x, int y, double fx, double fy, double *metres) {
    const size_t nw = (size_t)y * (size_t)l->n + (size_t)x, ne = nw + 1, sw = nw + (size_t)l->n, se = sw + 1;
    const double *h = l->metres;
    uint8_t all;
    if ((x + y + l->turned) % 2 == 0) { /* diagonal from north-west to south-east */
        const size_t side = fx > fy ? ne : sw;
        all = l->what[nw] & l->what[se] & l->what[side];
        *metres = fx > fy ? h[nw] + fx * (h[ne] - h[nw]) + fy * (h[se] - h[ne])
                          : h[nw] + fy * (h[sw] - h[nw]) + fx * (h[se] - h[sw]);
    } else {
        const size_t side = fx + fy < 1 ? nw : se;
        all = l->what[ne] & l->what[sw] & l->what[side];
        *metres = fx + fy < 1 ? h[nw] + fx * (h[ne] - h[nw]) + fy * (h[sw] - h[nw])
                              : h[se] + (1 - fx) * (h[sw] - h[se]) + (1 - fy) * (h[ne] - h[se]);
    }
    return all & HAS_HEIGHT;
}

/* A vertex of a block. */
typedef struct corner {
    double col, row, metres;
    bool valid;
    int i, j; /* on the block's lattice */
} corner;
corner lattice_corner(const lattice *l, int i, int j);
/* Both halves of the block: apex, left, right each. */
void lattice_halves(const lattice *l, const rqt_block_place *place, corner halves[2][3]);
/* Is the triangle's split vertex kept? Then it is the apex of both children. */
bool lattice_split(const lattice *l, const corner triangle[3], corner children[2][3]);

/* A triangle's. */
lattice_box lattice_box_of(const corner triangle[3]);
/* Has it no area, or nothing between the outermost pixels? */
bool lattice_misses(const lattice *l, const corner triangle[3]);
/* Does it reach beyond the raster, and was squeezed into it, so that cells of the lattice are not its parts? */
bool lattice_straddles(const lattice *l, const rqt_block_place *place, const corner triangle[3]);
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

/* When all is drawn by the blocks of a level: the error. proof.c */
int leaves_prove(tiles *t, int level, pixel_grid *g, char **error);

#endif
