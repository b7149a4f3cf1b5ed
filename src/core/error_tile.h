/* error_tile.h - the exact errors that one tile of a raster knows of. error_tile.c
 *
 * A tile is a cell of side 2^b of the lattice. A bintree triangle whose split vertex has a scale below b lies in
 * one tile; the others, the *upper* triangles, cover tiles, wholly or by half, and are put together from parts. */
#ifndef RQT_ERROR_TILE_H
#define RQT_ERROR_TILE_H

#include "deviation.h"

/* --------------------------------------------------------------------------------------------- the coarse lattice
 * -- The vertices of scale >= b, numbered by tiles: vertex (X,Y) is lattice vertex (X*2^b, Y*2^b). Their samples
 * are known before the first tile is. */
typedef struct coarse_lattice {
    const deviation_field *field;
    int b;
    int32_t columns, rows; /* of tile corners that are in the raster, or clamped to its edge */
    int32_t *q;            /* columns * rows */
    uint8_t *valid;        /* NULL: all */
    rqt_errors errors;     /* of the lattice of tile corners */
    uint8_t *states; /* as errors.code: HAS_VALID and HAS_VOID of the two triangles of a diamond, 2 bits each */
} coarse_lattice;

/* What a tile adds to the upper triangles of the cell of one level that it lies in: two halves, and the quarters at
 * the north, the east, the south and the west side. */
enum { CELL_HALVES = 2, CELL_TRIANGLES = 6 };
typedef struct upper_part {
    rqt_code code[CELL_TRIANGLES];
    uint8_t state[CELL_TRIANGLES];
} upper_part;

/* Tiles along a side of `samples`: in a raster of one column the first one is the only one. */
int32_t tile_count(int32_t samples, int b);

size_t coarse_bytes(const rqt_lattice *lattice, int b, bool has_voids);
rqt_status coarse_create(coarse_lattice *coarse, const deviation_field *field, int b, bool has_voids,
                         const rqt_allocator *allocator);
void coarse_free(coarse_lattice *coarse, const rqt_allocator *allocator);
/* Row y of the raster, when it holds samples of the coarse lattice. */
bool coarse_wants(const coarse_lattice *coarse, int32_t y);
void coarse_take(coarse_lattice *coarse, int32_t y, const int32_t *q, const uint8_t *valid);
/* Adds the parts of tile (i,j), K - b of them, finest cell first. */
void coarse_add(coarse_lattice *coarse, int32_t i, int32_t j, const upper_part *parts);
/* All tiles are in: mixed triangles are known now. Errors are raw. */
void coarse_complete(coarse_lattice *coarse);

/* --------------------------------------------------------------------------------------------------- one tile --
 */
typedef struct error_tile {
    const deviation_field *field;
    const coarse_lattice *coarse;
    int b;
    int32_t x, y;      /* its first lattice vertex */
    size_t stride;     /* of the arrays: 2^b + 1 */
    rqt_code *code;    /* raw errors of the vertices of scale < b; its border vertices know this tile's side only */
    uint8_t *outline;  /* NULL without voids */
    bool any_outline;  /* is there a bit in it? */
    upper_part *upper; /* K - b parts */
} error_tile;

size_t tile_bytes(const rqt_lattice *lattice, int b, bool has_voids);
rqt_status tile_create(error_tile *tile, const coarse_lattice *coarse, const rqt_allocator *allocator);
void tile_free(error_tile *tile, const rqt_allocator *allocator);
/* Errors of tile (i,j), whose rows are at hand in the field. */
void tile_measure(error_tile *tile, int32_t i, int32_t j);

/* The six triangles of the cell of side 2^n at (x,y): two halves, then the quarters north, east, south, west. */
void cell_triangles(int32_t x, int32_t y, int n, rqt_triangle out[CELL_TRIANGLES]);

/* rqt_sweep_create and rqt_errors_compute with kernels, and tiles of a side 2^b, of one's own. sweep.c, error.c */
rqt_status sweep_create(const rqt_sweep_plan *plan, const error_kernels *kernels, const rqt_allocator *allocator,
                        rqt_sweep **sweep);
rqt_status errors_compute(const rqt_grid *grid, const rqt_unit *unit, const rqt_void_cost *cost, int b,
                          const error_kernels *kernels, const rqt_allocator *allocator,
                          bool (*progress)(void *context, double done), void *context, rqt_errors *errors);

static inline rqt_vertex split_vertex(const rqt_triangle *t) {
    return (rqt_vertex){(t->left.x + t->right.x) / 2, (t->left.y + t->right.y) / 2};
}

#endif
