/* terrarium.h - the parts of the kind terrarium.
 *
 *   terrarium.c  levels, which tiles there are, tile.json
 *   pixels.c     where pixels lie; their heights, void ones, what is between them
 *   samples.c    heights where the mesh has every sample, and how far the samples are from what is drawn
 *   lattice.c    blocks as heights at the vertices of their lattice, among the pixels
 *   leaves.c     heights where the mesh is coarser
 *   proof.c      how far the samples are from what is drawn, there
 *   png.c        bytes
 */
#ifndef RQT_TILES_TERRARIUM_H
#define RQT_TILES_TERRARIUM_H

#include "kind.h"

enum { PIXELS = 256, GRID = PIXELS + 2 };

typedef struct terrarium_plan {
    int finest;
    int shift[TILES_LEVELS];   /* the mesh of a level has vertices 2^shift samples apart, at least */
    double step[TILES_LEVELS]; /* metres between heights that are told apart: a power of two, 1/256 .. 1 */
    tile_range ranges[TILES_LEVELS][MOST_TURNS];
    int range_count[TILES_LEVELS];
} terrarium_plan;

/* A pixel's height as it is told: 256ths of a metre above -32768. */
#define NO_HEIGHT 0x800000 /* 0 m, which no height of terrain is told as */
#define UNKNOWN (-1)       /* not looked at yet, in the making */

/* The pixels of a tile and one around it, which are the neighbours'. */
typedef struct pixel_grid {
    const store_terrain *terrain;
    int z;
    int32_t code_step;             /* between heights that are told apart, in codes */
    double per_step, most_steps;   /* of them in a metre; the last one's number */
    double lon[GRID], lat[GRID];   /* of pixels' centres, degrees; longitudes as they come, from below -180 on */
    double col[GRID], row[GRID];   /* the same in samples, on the turn that is at hand: both grow */
    double per_col, per_row[GRID]; /* 1 / distance to the next pixel; per_row[GRID - 1] is not used */
    int32_t code[GRID * GRID];
    double height[GRID * GRID];    /* what clients make of the code, metres */
    uint8_t is_whole[GRID * GRID]; /* are the pixel, the ones right of it, below and both of terrain? */
    double error; /* no sample between four pixels of terrain is further from what is drawn: metres */
} pixel_grid;

/* Places; nothing is known of heights, but that they are told in steps of so many metres, a power of two. */
void pixels_place(const tiles *t, int z, int32_t x, int32_t y, double step, pixel_grid *g);
/* The turns of 360 degrees on which some pixel may be in the raster. */
void pixels_turns(const pixel_grid *g, int *first, int *last);
/* col and per_col for a turn; false: no pixel is in the raster's columns and rows. */
bool pixels_turn(pixel_grid *g, int turn);
/* Metres as a code. */
int32_t pixels_code(const pixel_grid *g, double metres);
/* When all codes are known or are not to be: heights, and which are whole. */
void pixels_close(pixel_grid *g);
/* What bilinear interpolation gives right of and below pixel at, u and v from it to the next ones. */
static inline double pixels_between(const pixel_grid *g, size_t at, double u, double v) {
    const double *h = g->height + at;
    const double above = h[0] + u * (h[1] - h[0]), below = h[GRID] + u * (h[GRID + 1] - h[GRID]);
    return above + v * (below - above);
}

/* As fmax and fmin, which are calls. */
static inline double larger(double a, double b) {
    return a > b ? a : b;
}
static inline double smaller(double a, double b) {
    return a < b ? a : b;
}

/* Codes, and the error. */
int samples_draw(tiles *t, pixel_grid *g, char **error);
int leaves_draw(tiles *t, int shift, pixel_grid *g, char **error);

int png_write(const pixel_grid *g, tile_bytes *out);

#endif
