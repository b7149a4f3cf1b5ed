/* quantized_mesh.h - the parts of the kind quantized-mesh.
 *
 *   quantized_mesh.c  the kind
 *   plan.c            levels and their tolerances, heights, where tiles lie on the raster
 *   mesh.c            the terrain's mesh, cut to a tile and quantised; what it is off
 *   speck.c           what a tile has where it has no terrain
 *   globe.c           places in space: bounding sphere, horizon, normals
 *   water.c           the water mask
 *   encode.c          bytes
 *   layer.c           which tiles there are; layer.json
 */
#ifndef RQT_TILES_QUANTIZED_MESH_H
#define RQT_TILES_QUANTIZED_MESH_H

#include "earth.h"
#include "kind.h"

enum { TILE_UNITS = 32767 }; /* a tile's side, and the range of heights, in what is stored */

typedef struct tile_level {
    double geometric_error; /* what clients take the level to be off, metres */
    double eps;             /* of the mesh, in space, before it is quantised */
    rqt_rule *rule;         /* NULL: the plan's */
} tile_level;

typedef struct layer_search layer_search;
/* What is known of the largest eps that leaves a triangle (plan.c). */
typedef struct tile_ground {
    double eps;            /* the one that is asked for; 0: none yet */
    rqt_block_number last; /* of store_mark */
    bool is_known;
} tile_ground;

typedef struct sea_run {
    int32_t row, first, last;
} sea_run;

/* What all tiles of a terrain have in common. */
typedef struct tile_plan {
    int finest;
    tile_level level[TILES_LEVELS];
    tile_ground ground;
    double lowest, step; /* a height n is lowest + n * step metres, 0 <= n <= TILE_UNITS; step a power of two */
    double radius;       /* no radius of curvature, and height above it, is larger: metres */
    double rounded;      /* the terrain's quantum_error */
    double lowering[RQT_RANKS]; /* what curvature takes of eps */
    rqt_rule *rule;             /* with it */
    tile_seam seam;
    geo_frame *geoid; /* NULL: heights are the ellipsoid's */
    geo_geoid undulation;
    bool has_sea;
    sea_run *sea;
    size_t sea_count;
    tile_range *ranges[TILES_LEVELS]; /* NULL: not yet asked for */
    size_t range_count[TILES_LEVELS];
    layer_search *search[TILES_LEVELS]; /* NULL: not begun, or at its end */
} tile_plan;

static inline tile_plan *plan_of(const tiles *t) {
    return t->plan;
}
int plan_create(tiles *t, void **out, char **error);
void plan_free(void *plan);

/* A tile on the raster: in samples, not rounded, for each time that it meets the raster (longitudes are the same
 * modulo 360). */
typedef struct tile_turn {
    double west, east, north, south; /* samples */
    int64_t box[4];                  /* the same in 2^-20 samples, as regions have it: west, east, north, south */
    double cut[4];                   /* the same in samples: where the mesh ends */
} tile_turn;
typedef struct tile_place {
    int z;
    int32_t x, y;
    double west, south, side; /* degrees */
    tile_turn turn[MOST_TURNS];
    int turns; /* 0: the tile misses the raster */
} tile_place;
/* False: there is no such tile, whatever the terrain. */
bool plan_place(const tiles *t, int z, int32_t x, int32_t y, tile_place *place);
/* The tiles of a level that meet the raster, as ranges that do not meet each other, at most MOST_TURNS. */
int plan_ranges(const tiles *t, int z, tile_range ranges[MOST_TURNS]);
/* The turns on which the globe's 360 degrees may meet the raster. */
typedef struct turn_range {
    int first, last;
} turn_range;
turn_range plan_turns(const tiles *t);
/* Tiles of a range of plan_ranges that meet the raster on a turn, and the lines between them, cut at its end: in
 * 2^-20 samples, x from the west, y from the north on, one more than there are tiles. False: there are none. */
bool plan_cells(const tiles *t, int z, int turn, tile_range *range, int64_t *x, int64_t *y);
/* The place's rectangle as a region. */
int plan_region(const tiles *t, const tile_place *place, rqt_region **region);
/* The options of every query of a level. */
store_query_options plan_options(const tiles *t, int z);

typedef struct tile_mesh {
    rqt_cut cut;         /* vertices in samples */
    uint32_t specks;     /* vertices behind those of the cut, each a triangle without area */
    uint16_t *u, *v, *h; /* of each vertex */
    double *lonlath;     /* what a client reads of them: degrees and metres above the ellipsoid */
    uint32_t *edge[4];   /* vertices on the tile's west, south, east, north side, from south or west on */
    uint32_t edge_count[4];
    double move[3];        /* the most that a vertex was moved: degrees, degrees, metres */
    double merged;         /* the last of them, as far as the seam has done it */
    double error;          /* no sample is further from the mesh in space: metres */
    double vertical_error; /* ... above or below it in longitude, latitude, height, where the outline is not near */
} tile_mesh;
enum { MOST_SPECKS = 16 };
static inline size_t mesh_vertices(const tile_mesh *mesh) {
    return mesh->cut.vertex_count + mesh->specks;
}
/* Its cut is without a triangle, when the tile has none. */
int mesh_make(tiles *t, const tile_place *place, tile_mesh *mesh, char **error);
void mesh_free(tile_mesh *mesh);
/* Where the tile has no terrain; u, v, h have room for MOST_SPECKS more. */
void specks_add(tile_mesh *mesh);

/* Where a vertex is on the globe. */
typedef struct tile_angles {
    earth_angle lon, lat;
} tile_angles;
typedef struct tile_globe {
    double *xyz;         /* geocentric, of each vertex */
    tile_angles *angles; /* likewise */
    double centre[3], radius;
    double horizon[3];
} tile_globe;
int globe_make(const tile_mesh *mesh, tile_globe *globe);
void globe_free(tile_globe *globe);
/* Two bytes a vertex: oct-encoded normals of the terrain, geocentric. */
int globe_normals(tiles *t, const tile_mesh *mesh, const tile_globe *globe, uint8_t *packed, char **error);

enum { WATER_SIDE = 256 };
int water_read(tiles *t, tile_plan *plan, char **error);
/* Pixels from the north-west on; how many of them there are: 1 where all are the same. */
size_t water_mask(const tiles *t, const tile_place *place, uint8_t mask[WATER_SIDE * WATER_SIDE]);

/* Interrupted, it goes on from there when it is called again. */
int layer_available(tiles *t, int z, const tile_range **ranges, size_t *count, char **error);
/* The tiles below one of level 0, as JSON: a list of ranges for each level from 1 on, to be released with
 * sqlite3_free. */
int layer_below(tiles *t, int32_t x, char **text, char **error);
void layer_search_free(layer_search *search); /* NULL is passed over */
int layer_make(tiles *t, int first, int last, tile_bytes *out, char **error);

int encode_tile(tiles *t, const tile_place *place, const tile_mesh *mesh, tile_bytes *out, char **error);

#endif
