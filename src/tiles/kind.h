/* kind.h - what the kinds of tiles have in common.
 *
 *   tiles.c          kinds; a connection's tiles: the plan of its terrain, kept while nothing changes
 *   pyramid.c        to disk
 *   earth.c          places and directions in space
 *   seam.c           terrains that go around the Earth
 *   quantized_mesh/  each kind in a folder of its own, its parts told in its header
 *   blocks/          (3d-tiles)
 *   terrarium/
 */
#ifndef RQT_TILES_KIND_H
#define RQT_TILES_KIND_H

#include "geo.h"
#include "tiles.h"

/* A raster that goes once around the Earth at most meets the globe's 360 degrees in so many turns at most:
 * longitudes are the same modulo 360. */
enum { MOST_TURNS = 4 };

enum { KEPT_PLANS = 8 };
/* What a kind has worked out of a terrain in one state of the database. */
typedef struct kept_plan {
    const tile_kind *kind;
    char name[64];
    uint64_t state; /* store_state when it was made; 0: not to be kept */
    void *plan;     /* NULL: none */
    bool is_whole;  /* false: interrupted while it was made */
} kept_plan;
struct tiles {
    sqlite3 *db;
    store *store;
    const tile_kind *kind;        /* between begin and end */
    const store_terrain *terrain; /* likewise */
    void *plan;                   /* likewise: the kind's own */
    int last;                     /* likewise: of tiles_tell */
    bool is_kept;                 /* is what is worked out there the next time? */
    bool goes_on;                 /* was a search interrupted? */
    kept_plan kept[KEPT_PLANS];
    int next; /* place of the plan that goes next */
};

/* What a kind has to know. t has its terrain and, but for plan_create, its plan. */
typedef struct tile_functions {
    /* *plan: NULL, or what it has left there when it was interrupted; then it goes on from there. */
    int (*plan_create)(tiles *t, void **plan, char **error);
    void (*plan_free)(void *plan); /* NULL is passed over */
    int (*finest)(const tiles *t);
    int (*available)(tiles *t, int series, int z, const tile_range **ranges, size_t *count, char **error);
    int (*make)(tiles *t, int series, int z, int32_t x, int32_t y, tile_bytes *out, char **error);
    int (*document)(tiles *t, const char *root, int first, int last, tile_bytes *out, char **error);
} tile_functions;
extern const tile_kind quantized_mesh, tiles_3d, terrarium;

/* A sentence into *error; returns SQLITE_ERROR, or SQLITE_NOMEM. */
int tiles_fail(char **error, const char *format, ...) __attribute__((format(printf, 2, 3)));
int tiles_fail_database(char **error, sqlite3 *db, int code);
/* Is the terrain in longitude and latitude on WGS 84, north up? SQLITE_ERROR with a sentence if not. */
int tiles_check_place(const store_terrain *t, char **error);
/* Are its heights those above the ellipsoid, or above EGM96? Likewise. */
int tiles_check_heights(const store_terrain *t, bool *is_above_geoid, char **error);
geo_extent tiles_extent(const store_terrain *t);
/* Where the terrain came from, in one line, to be released with sqlite3_free; NULL: no memory. */
char *tiles_attribution(const store_terrain *t);
/* The same as "attribution" of a document. Clients take it for HTML, which names of files are not. */
struct cJSON;
void tiles_add_attribution(const store_terrain *t, struct cJSON *document);
/* Where the terrain lies, as "bounds" of a document; no further from the equator than most_latitude. Longitudes of
 * -180..180. Across the antimeridian it is all of them: clients know no other way to say it. */
void tiles_add_bounds(const store_terrain *t, double most_latitude, struct cJSON *document);
/* The document's text as the answer; releases it and the JSON. */
int tiles_print(struct cJSON *document, tile_bytes *out);
/* The union of boxes of samples: x0, x1, y0, y1 of each. */
int tiles_region(const tiles *t, const double (*boxes)[4], int count, rqt_region **region);
/* A terrain whose first and last columns are one. */
typedef struct tile_seam {
    int32_t *q;     /* heights of the first column; NULL: they are two */
    double merging; /* the last column's differ by no more: metres */
} tile_seam;
/* Are they one? *seam comes zeroed. */
int seam_read(tiles *t, tile_seam *seam, char **error);
void seam_free(tile_seam *seam);
/* If so: forces the vertices of either column on the other in the options' rule. */
int seam_close(tiles *t, double eps, const store_query_options *options, char **error);
/* ... gives vertices of the last column the heights of the first; by how much samples of either may be off by that:
 * metres. */
double seam_merge(const tiles *t, const tile_seam *seam, rqt_patch *patch);
/* Has the mesh of eps a triangle in a box of samples (west, east, north, south; cut at the raster's end)? *last: as
 * of store_mark. */
int tiles_has_triangle(tiles *t, const int32_t box[4], double eps, const store_query_options *options,
                       rqt_block_number *last, bool *is_there, char **error);
/* Ranges as they are found; items are to be released with sqlite3_free. */
typedef struct range_list {
    tile_range *items;
    size_t count, capacity;
} range_list;
int tiles_add_range(range_list *list, tile_range range);

#endif
