/* tiles.h - terrain as tiles for globes and maps, in the kinds that their clients know, with a proven error.
 *
 *   quantized-mesh  quantized-mesh 1.0 (CesiumGS/quantized-mesh), cut from the terrain's own mesh. Tiles are
 * squares of 180 / 2^z degrees, x from -180 degrees on, y from the south (TMS, global geodetic).
 *   3d-tiles        3D Tiles 1.1: an implicit tileset, glTF in geocentric coordinates. Tiles are the cells of the
 * terrain's own blocks, x from the west, y from the south.
 *   terrarium       heights as colours of PNG, in Web Mercator (Mapzen, AWS; MapLibre, deck.gl). 2^z by 2^z tiles
 * of 256 x 256 pixels, y from the north.
 *
 * A kind is one or more series of tiles, each with levels of ranges of them, and one document that tells clients of
 * them. The bytes of a tile are a function of the terrain alone: the service and the command give the same.
 *
 * Results are SQLite's codes; with anything but SQLITE_OK *error may hold a sentence, to be released with
 * sqlite3_free. One `tiles` per connection; different ones may be used by different threads.
 */
#ifndef RQT_TILES_H
#define RQT_TILES_H

#include "store.h"

enum { TILES_LEVELS = 25 }; /* 0 .. 24 */

/* Tiles x0..x1 by y0..y1 of a level. */
typedef struct tile_range {
    int32_t x0, x1, y0, y1;
} tile_range;

typedef struct tile_bytes {
    uint8_t *bytes; /* to be released with sqlite3_free */
    size_t size;    /* 0: there is no such tile */
} tile_bytes;

typedef struct tile_series {
    const char *folder; /* tiles are at FOLDER z/x/y SUFFIX below their kind's: "", or a name and a slash */
    const char *suffix;
    const char *media_type;
    bool is_packed; /* compressed as it is: gzip has nothing to gain */
} tile_series;

enum { MOST_SERIES = 2 };
typedef struct tile_kind {
    const char *name;     /* of its folder in the service's paths, and for people: "quantized-mesh" */
    const char *document; /* "layer.json"; application/json */
    bool is_whole;        /* levels are there all or not at all */
    bool has_addresses;   /* clients want whole ones in the document */
    int series_count;
    tile_series series[MOST_SERIES];
    const struct tile_functions *functions;
} tile_kind;
/* NULL after the last one. */
extern const tile_kind *const tile_kinds[];
const tile_kind *tiles_kind(const char *name);

typedef struct tiles tiles;
int tiles_open(sqlite3 *db, tiles **out);
/* Before the connection is closed. */
void tiles_close(tiles *t);
/* As store_limits: of the mesh of one tile. */
void tiles_limit(tiles *t, int64_t triangles);

/* Between tiles_begin and tiles_end one state of the terrain is seen (NULL: the only one), as tiles of a kind. A
 * terrain that has none of the kind, as it is not in longitude and latitude on WGS 84, is SQLITE_ERROR with a
 * sentence that says so. */
int tiles_begin(tiles *t, const tile_kind *kind, const char *terrain, char **error);
void tiles_end(tiles *t);
/* The last level, which has the resolution of the raster. */
int tiles_finest(const tiles *t);
/* Until tiles_end, tiles that tell which others there are leave out levels beyond `last`. */
void tiles_tell(tiles *t, int last);
/* The tiles of a level: those that have something in them, each in one range, by y0, then by x0. Good until the
 * next tiles_begin. */
int tiles_available(tiles *t, int series, int z, const tile_range **ranges, size_t *count, char **error);
/* The description of levels first..last for clients; what addresses in it begin with ("": they are relative to it).
 */
int tiles_document(tiles *t, const char *root, int first, int last, tile_bytes *out, char **error);
/* One of these, or tiles_begin, has ended with SQLITE_INTERRUPT: what it has found is kept while the terrain stays
 * as it is, and it goes on from there when it is called again, after tiles_begin. */
bool tiles_goes_on(const tiles *t);
/* One tile. Any z, x, y may be asked for. */
int tiles_make(tiles *t, int series, int z, int32_t x, int32_t y, tile_bytes *out, char **error);

/* ------------------------------------------------------------------------------------------------- to disk -- */
enum { MOST_WORKERS = 64 };
typedef struct tiles_job {
    const tile_kind *kind;
    const char *database, *terrain, *folder;
    int first, last; /* levels; last beyond the finest: the finest */
    const char *url; /* where the folder will be, with a slash at its end; NULL: addresses are relative */
    bool gzip;
    int workers; /* 1 .. MOST_WORKERS */
    /* A connection for a worker, with the SQL functions or without; NULL after a sentence of its own. */
    sqlite3 *(*connect)(void *context);
    /* So many tiles of so many are there; false stops (SQLITE_INTERRUPT). Called by one thread. May be NULL. */
    bool (*progress)(void *context, int64_t done, int64_t all);
    void *context;
} tiles_job;
typedef struct tiles_report {
    int64_t tiles, written; /* of the levels; those that were not there before */
    int64_t bytes;          /* written */
    int finest;             /* level that was written last */
} tiles_report;
/* Writes the series, and at last the document, each file whole or not at all. A folder of the same
 * job that did not finish is gone on with; one of another terrain, state or of other options is refused, and one
 * with files that are not of a job. */
int tiles_write(const tiles_job *job, tiles_report *report, char **error);

#endif
