/* blocks.h - the parts of the kind 3d-tiles: 3D Tiles 1.1, an implicit quadtree whose tiles are the cells of the
 * stored blocks.
 *
 *   plan.c     levels and their tolerances, steps of positions
 *   tile.c     one tile by the index alone: is it there, what is it off, where does it lie
 *   mesh.c     the terrain's mesh of a cell, in space
 *   normals.c  its normals
 *   skirt.c    walls that hang from its sides
 *   glb.c      both as glTF
 *   subtree.c  availability and metadata of some levels of tiles
 *   tileset.c  the kind; tileset.json
 */
#ifndef RQT_TILES_BLOCKS_H
#define RQT_TILES_BLOCKS_H

#include "kind.h"

enum { SUBTREE_LEVELS = 4 };
enum { CONTENT, SUBTREES, BLOCK_SERIES };

typedef struct block_level {
    double error;   /* no valid sample is further from the mesh in space, before positions are rounded: metres */
    double centre;  /* what curvature takes from the two triangles that a cell is at least made of */
    double step;    /* positions are whole ones: a power of two */
    double round;   /* what rounding moves a vertex by, at most; and what a seam does */
    double wall;    /* how far walls hang down from sides of the level's cells (skirt.c) */
    rqt_rule *rule; /* its mesh, in the cells that were asked for; NULL: none was */
} block_level;

/* What all tiles of a terrain have in common. */
typedef struct block_plan {
    int finest;
    block_level level[TILES_LEVELS];
    double sag[RQT_RANKS + 2]; /* what curvature takes from a triangle, by the rank of its split vertex + 2: [1] is
                                  that of half a square of one sample, which has none */
    tile_seam seam;
    geo_frame *frame;                               /* geocentric, geoid included */
    geo_geoid geoid;                                /* zeros without one */
    tile_range *ranges[BLOCK_SERIES][TILES_LEVELS]; /* NULL: not yet asked for */
    size_t range_count[BLOCK_SERIES][TILES_LEVELS];
} block_plan;
double block_sag(const block_plan *plan, int rank);
int block_plan_create(tiles *t, void **plan, char **error);
void block_plan_free(void *plan);
static inline block_plan *block_plan_of(const tiles *t) {
    return t->plan;
}

/* A tile. In 3D Tiles rows count from the south. */
typedef struct block_tile {
    int level;
    int32_t i, j; /* the block's cell: from the west, from the north */
} block_tile;
block_tile block_tile_of(int level, int32_t x, int32_t y);
/* Its samples, as far as there are any. */
typedef struct block_cell {
    rqt_vertex from, to; /* both are in it */
} block_cell;
block_cell block_cell_of(const tiles *t, block_tile tile);
/* Is its block stored? */
bool block_exists(const tiles *t, block_tile tile);
/* What the index knows of a tile, given what it knows of the one above; of the whole terrain, for the root's. */
int block_relief(tiles *t, block_tile tile, store_relief *relief, char **error);
/* The same, from the root on. */
int block_relief_from_root(tiles *t, block_tile tile, store_relief *relief, char **error);
/* Has its mesh a triangle? The tile exists. */
int block_has_content(tiles *t, block_tile tile, const store_relief *relief, bool *has, char **error);
/* No valid sample in a kept leaf is further from the tile's mesh in space: metres. No tile below has a larger one.
 */
double block_error(const tiles *t, block_tile tile, const store_relief *relief);
/* As 3D Tiles has regions: west, south, east, north in radians, lowest, highest in metres above the ellipsoid; the
 * tile's mesh and its skirt lie in it, and so do the regions of the tiles below. */
void block_region(const tiles *t, block_tile tile, const store_relief *relief, double region[6]);
/* A box of longitudes and latitudes in degrees, as such a region's first four: longitudes in -180..180, west beyond
 * east across the antimeridian. */
void block_rectangle(double west, double south, double east, double north, double region[4]);

/* Has the mesh of a tile a triangle? By the blocks that answer. */
int block_has_triangle(tiles *t, block_tile tile, bool *has, char **error);

typedef struct block_mesh {
    rqt_patch patch;
    double origin[3]; /* geocentric: whole metres, and whole steps */
    int32_t *offset;  /* three a vertex: steps from there, less than 2^24 */
    int8_t *normal;   /* three a vertex, geocentric: 127ths */
} block_mesh;
/* Without a triangle where the tile has no content. */
int block_mesh_make(tiles *t, block_tile tile, block_mesh *mesh, char **error);
void block_mesh_free(tiles *t, block_mesh *mesh);
/* Triangles of the level's mesh of which some have a vertex of the tile, at a part of its sides: those around it;
 * and where the terrain closes and the tile is at an end, those at the other end, where the tile's vertices are
 * those of the other column. */
enum { AROUND_CELL, AT_LAST_COLUMN, AT_FIRST_COLUMN, BLOCK_PARTS };
int block_mesh_around(tiles *t, block_tile tile, int part, rqt_patch *patch, char **error);
/* Of a sample: columns that are one meridian have the same. */
double block_longitude(const tiles *t, int32_t col);
/* Places of a level's vertices, as a block_mesh has them; origin: chosen here, unless it has one. */
int block_places(const tiles *t, const rqt_patch *patch, double step, double *origin, bool has_origin,
                 int32_t **offset, char **error);
/* The mesh has all else. */
int block_normals(tiles *t, block_tile tile, block_mesh *mesh, char **error);

/* The walls of a tile: no part of the mesh, of whose error they know nothing. */
typedef struct block_skirt {
    size_t vertex_count, triangle_count; /* 0: it has none */
    int32_t *offset;                     /* as a mesh's; in turn a vertex of the mesh, and the one below it */
    int8_t *normal;                      /* likewise: the mesh's, twice */
    uint32_t *triangles;                 /* counter-clockwise seen from outside */
    double depth;                        /* metres; of the deepest */
} block_skirt;
int block_skirt_make(const tiles *t, block_tile tile, const block_mesh *mesh, block_skirt *skirt);
void block_skirt_free(block_skirt *skirt);
/* No wall of the tile, or of those below, hangs further down: metres. */
double block_skirt_depth(const tiles *t, block_tile tile);

/* The mesh is the first primitive; the skirt, if there is one, the second. */
int block_glb_make(tiles *t, block_tile tile, const block_mesh *mesh, const block_skirt *skirt, tile_bytes *out,
                   char **error);
/* The subtree whose root is the tile, which exists. */
int subtree_make(tiles *t, block_tile tile, tile_bytes *out, char **error);

#endif
