/* store.h - terrains and blocks in an SQLite database.
 *
 * Reading: one `store` per connection finds terrains by name, answers queries from the index and a cache of decoded
 * blocks, and never writes. Writing: a `store_writer` adds one terrain inside one transaction.
 *
 * The query side needs two things of an engine only: "the blocks of this terrain that meet this box and answer this
 * eps" (query.c, find_answers) and "the bytes of block n" (blocks.c). Nothing else here knows SQL.
 *
 * Results are SQLite's codes; damage to a terrain's own bytes is SQLITE_CORRUPT_VTAB, because plain SQLITE_CORRUPT
 * would make SQLite give up the host's transaction. With anything but SQLITE_OK, *error may hold a sentence, to be
 * released with sqlite3_free; without a sentence sqlite3_errstr(code) is the sentence (out of memory, interrupted).
 */
#ifndef RQT_STORE_H
#define RQT_STORE_H

#include "rqt.h"
#include "sqlite.h"

#ifdef __cplusplus
extern "C" {
#endif

/* SQLite's memory as the core's. Static life. */
const rqt_allocator *store_allocator(void);

typedef struct store_terrain {
    int64_t id;      /* N of rqt_block_N, rqt_index_N */
    char name[64];   /* [A-Za-z0-9_.-]{1,63} */
    char schema[64]; /* of the connection: "main" or an attached database's name */
    char *problem; /* NULL, or a sentence: its row cannot be used; then nothing else is known but name and schema */
    bool complete; /* false: an import did not finish; queries refuse it */
    rqt_lattice lattice;
    int k;
    rqt_placement placement;
    rqt_unit unit;
    double quantum_error; /* metres: half a quantum where float heights were rounded, else 0 */
    rqt_void_cost cost;
    int32_t srid;          /* 0: none known */
    bool lonlat;           /* coordinates are degrees of longitude and latitude */
    bool wgs84;            /* ... on WGS 84, whatever the SRID says: what EPSG:4326 regions meet */
    char *crs;             /* WKT, "" for none */
    char *vertical;        /* vertical datum as the source names it, "" for none */
    char *source;          /* where it came from: file names, one a line */
    char *created;         /* ISO 8601, UTC */
    int64_t voids;         /* void samples */
    int32_t min_q, max_q;  /* of the valid samples; both 0 when there are none */
    int64_t blocks, bytes; /* of the block table: rows, and bytes of BLOBs and summaries */
    rqt_code max_error;    /* the largest finite error of any vertex */
    const char *suffix;    /* of the names of its block table and index: "" (static) */
} store_terrain;

/* ---------------------------------------------------------------------------------------------- reading */
typedef struct store store;

int store_open(sqlite3 *db, store **out);
/* Finalise the statements that it keeps, so that the connection can close; they are prepared again when needed. */
void store_release(store *s);
void store_close(store *s);

/* Between store_begin and store_end every call sees one state of the databases, whatever other connections commit
 * (the functions below do it for themselves, each alone). Nests. */
int store_begin(store *s, char **error);
void store_end(store *s);

/* The terrain of this name ("schema.name" reaches into attached databases); NULL: the only one of all. SQLITE_ERROR
 * with a sentence that lists what there is when it is unknown, ambiguous or incomplete. Valid until the next call
 * of store_find on this store. */
int store_find(store *s, const char *name, const store_terrain **terrain, char **error);
/* After store_find, between store_begin and store_end: a number that stays while everything in every database of
 * the connection but temp does, and comes no second time; 0: this connection writes, and nothing may be kept. */
uint64_t store_state(const store *s);
/* Does the name mean this terrain? 2: by its own name; 1: as "schema.name"; 0: no. */
int store_name_means(const store_terrain *terrain, const char *name);
/* All terrains, incomplete ones too, by schema and name. *count entries; release with store_terrains_free. */
int store_terrains(store *s, store_terrain **terrains, int *count, char **error);
void store_terrains_free(store_terrain *terrains, int count);

typedef struct store_query_options {
    rqt_select select;
    rqt_outline outline;
    rqt_metric metric;   /* exact is what is stored; minimal may be; the others are computed, see methods.c */
    rqt_product product; /* what the patch holds */
    /* NULL, or what else selects: the store sets its eps. Only for metrics whose mesh stays right when vertices are
     * added: exact, local, wedgie, euclid; minimal is SQLITE_ERROR. */
    rqt_rule *rule;
    bool wants_leaves; /* fill patch->leaves; with RQT_PRODUCT_TRIANGLES only */
    bool only_numbers; /* of reads: number alone, the rest 0. To say what each was takes as long as the query */
} store_query_options;

/* One row per block that answered, in Morton order. */
typedef struct store_read {
    rqt_block_number number;
    bool needs_bytes; /* false: answered from its index row alone */
    bool computed;    /* not stored: made in memory from the heights of the whole terrain */
    bool outside;     /* its cell only touches the region: nothing in it is asked for */
    bool cached;      /* its decoded bytes were in the cache */
    int64_t bytes;    /* of the BLOB, read now or before; 0 when not needed */
    int64_t selected; /* vertices of its grid that eps selects, corners of the block included */
} store_read;
typedef struct store_reads {
    store_read *rows;
    size_t count;
} store_reads;
void store_reads_free(store_reads *reads);

/* The patch of region at eps (metres; checked here: NaN and negative are SQLITE_ERROR). reads may be NULL. */
int store_query(store *s, const store_terrain *t, const rqt_region *region, double eps,
                const store_query_options *options, rqt_patch *patch, store_reads *reads, char **error);
/* Marks the cells in which that mesh has triangles. eps: 0 or more; options: those of metric exact and select
 * threshold. *last: 0, or, with the marks as they are, what a call that was interrupted has left: this one goes on
 * from there, while the terrain is as it was. */
int store_mark(store *s, const store_terrain *t, double eps, const store_query_options *options, rqt_cells *cells,
               rqt_block_number *last, char **error);
/* A query within a budget: the mesh of the smallest eps' >= eps that has at most max_vertices (>= 4) vertices in
 * the patch. *achieved: eps' in metres, eps itself when that fits. SQLITE_ERROR when even infinite eps needs more.
 */
int store_query_within(store *s, const store_terrain *t, const rqt_region *region, double eps,
                       const store_query_options *options, int64_t max_vertices, double *achieved, rqt_patch *patch,
                       store_reads *reads, char **error);
/* Was sqlite3_interrupt called? *code says how to end. */
bool store_is_interrupted(store *s, int *code);
/* The same for functions of the core, which take a function and a context. */
typedef struct store_wait {
    store *store;
    int code; /* how to end */
} store_wait;
bool store_wait_is_over(void *wait);
/* Instead of rqt_patch_free: the store keeps the memory for its next query, up to a limit. */
void store_keep(store *s, rqt_patch *patch);
/* What one answer may be at most, for those who answer strangers: vertices and triangles, each, of a mesh; samples
 * of a proof. 0: any number. Beyond it is SQLITE_TOOBIG with a sentence, and the walk has stopped at the block that
 * went over. The store's own, to be changed at any time between calls. */
typedef struct store_limits {
    int64_t triangles, samples;
} store_limits;
store_limits *store_limits_of(store *s);
/* Memory that a metric which is not stored may take, heights included. */
#define STORE_METHOD_MEMORY ((size_t)512 << 20)
void store_limit_methods(store *s, size_t bytes);
/* A block, decoded, with its corners: what it answers with for its own em, which is block->floor (0 at stride 1).
 * Between store_begin and store_end; valid until the next call that reads blocks. */
int store_read_block(store *s, const store_terrain *t, rqt_block_number number, const rqt_block **block,
                     char **error);
/* Full-resolution samples of a window inside the raster, for width*height values each, row by row. */
int store_window(store *s, const store_terrain *t, int32_t col, int32_t row, int32_t width, int32_t height,
                 int32_t *q, uint8_t *valid, char **error);
/* Unit normals of the terrain at the vertices of a patch, from the full-resolution samples around each (normals.c
 * has the definition): x east, y north, z up, three floats a vertex, released with sqlite3_free. Vertices have to
 * be samples of the raster. */
int store_normals(store *s, const store_terrain *t, const rqt_patch *patch, float **normals, char **error);
/* Height in metres at CRS coordinates on the mesh of eps (eps < 0: full resolution). *found = false over void or
 * outside. */
int store_height(store *s, const store_terrain *t, double x, double y, double eps, double *metres, bool *found,
                 char **error);

/* What is known of the samples of a square without reading a block; relief.c has the proof. */
typedef struct store_relief {
    double lowest,
        highest;    /* metres: no valid sample is beyond; of heights as they were before they were rounded */
    rqt_code error; /* no vertex but the square's corners has a larger one */
    bool is_mixed;  /* there may be samples and voids in it; else is_valid tells which */
    bool is_valid;
} store_relief;
/* Of the whole terrain. */
store_relief store_relief_of_all(const store_terrain *t);
/* Of a block's cell: *relief is that of the cell around it (or of all), and is narrowed. Between store_begin and
 * store_end. SQLITE_CORRUPT_VTAB when the two have no height in common. */
int store_find_relief(store *s, const store_terrain *t, rqt_block_number number, store_relief *relief,
                      char **error);

/* largest[l], for each level l of blocks: no vertex finer than the grids of that level has a larger error (outline
 * `tol`), and one has that. By the index alone, all of which is read. largest has room for RQT_MAX_K + 1. */
int store_level_errors(store *s, const store_terrain *t, rqt_code *largest, char **error);

/* How far check has come, and what it found: severity (so far always "error"), block 0 when it is not about one. */
typedef struct store_finding {
    const char *severity;
    rqt_block_number block;
    const char *message;
} store_finding;
/* Everything that can be checked without the source: see check.c. tell returns false to stop. */
int store_check(store *s, const store_terrain *t, bool (*tell)(void *context, const store_finding *finding),
                void *context, char **error);

/* A number that two states of a terrain have in common when its row, its blocks and what was filled are the same,
 * and, as numbers of 64 bits go, only then. Reads a page of each block. Not the index, which follows from the
 * blocks, nor minimal errors that are stored beside them. */
int store_digest(store *s, const store_terrain *t, uint64_t *digest, char **error);

/* How many samples of the terrain were no data: [0] STORE_FILLED, [1] STORE_SEA. */
int store_fill_counts(store *s, const store_terrain *t, int64_t counts[2], char **error);

/* ---------------------------------------------------------------------------------------------- writing */
/* Create what a new, empty database needs: a GeoPackage (application id, core tables). Harmless on one that is a
 * GeoPackage already; leaves every other database as it is. Inside the caller's transaction. */
int store_make_geopackage(sqlite3 *db, char **error);

typedef struct store_writer store_writer;
/* Begin one terrain, inside a transaction that the caller has begun (BEGIN IMMEDIATE) and will commit or roll back.
 * info: all fields but id, schema, blocks, bytes, max_error, complete. An existing terrain of the name is
 * an error unless replace. In a GeoPackage the tables are registered as attributes. */
int store_writer_begin(sqlite3 *db, const store_terrain *info, bool replace, store_writer **writer, char **error);
/* One block, in ascending order of number. */
int store_writer_block(store_writer *w, rqt_block_number number, const rqt_summary *summary, const uint8_t *bytes,
                       size_t size, char **error);
/* Samples first .. last of a row, which were no data: STORE_FILLED between neighbours, STORE_SEA. Runs come in the
 * order of rows, and of columns in them. */
enum { STORE_FILLED = 1, STORE_SEA = 2 };
int store_writer_fill(store_writer *w, int32_t row, int32_t first, int32_t last, int kind, char **error);
/* Mark the terrain complete. */
int store_writer_finish(store_writer *w, rqt_code max_error, char **error);
/* Release, finished or not. */
void store_writer_free(store_writer *w);

/* New samples for parts of a terrain of main, inside the caller's write transaction (BEGIN IMMEDIATE), which he
 * will commit or roll back. What is there afterwards is, in every row and BLOB of its tables and in the statistics
 * of its row, what an import of the changed raster in the same unit writes; only rows that differ are written.
 * While it goes on, the connection's other stores see each part as soon as it is done. */
typedef struct store_update store_update;

enum { STORE_KEEP, STORE_HEIGHT, STORE_VOID }; /* what becomes of a sample */

typedef struct store_update_report {
    int64_t changed;                  /* samples that are others now */
    int64_t blocks, summaries, bytes; /* rows written: with their blocks, summary alone; bytes */
    int64_t blocks_read, bytes_read;  /* blocks that had to be decoded */
    int64_t measured, cells;          /* rqt_update_result */
    bool minimal;                     /* minimal errors were stored, and have been computed anew */
} store_update_report;

/* name as in store_find. *terrain is as it was; valid until store_update_free. */
int store_update_begin(sqlite3 *db, const char *name, store_update **update, const store_terrain **terrain,
                       char **error);
/* A window inside the raster, width * height values each; q is looked at where the state is STORE_HEIGHT. progress,
 * when not NULL, gets the share done and returns false to stop (SQLITE_INTERRUPT; the caller rolls back). */
int store_update_samples(store_update *u, int32_t col, int32_t row, int32_t width, int32_t height, const int32_t *q,
                         const uint8_t *state, bool (*progress)(void *context, double done), void *context,
                         char **error);
/* When all parts are in: the terrain's row, with these names (one a line) put behind those of its sources that it
 * had from elsewhere, and the stored minimal errors, if there are any. Nothing has changed: nothing is written. */
int store_update_finish(store_update *u, const char *sources, bool (*progress)(void *context, double done),
                        void *context, char **error);
const store_update_report *store_update_told(const store_update *u);
void store_update_free(store_update *u);

/* Store the minimal errors of a terrain of main that is complete, so that queries need not compute them: in tables
 * like its own (FORMAT.md, "Tables"), inside the caller's transaction. All heights are read back: what that takes
 * (store_minimal_bytes) must be within STORE_METHOD_MEMORY, else SQLITE_ERROR with a sentence and nothing written.
 * progress, when not NULL, returns false to stop (SQLITE_INTERRUPT; the caller rolls back). */
int store_write_minimal(sqlite3 *db, const char *name, bool (*progress)(void *context, double done), void *context,
                        char **error);
size_t store_minimal_bytes(const rqt_lattice *lattice, int k, bool has_voids);

/* Is this a name a terrain may have? Not `.` and `..`: in a URL they are no names. */
bool store_name_is_valid(const char *name);

#ifdef __cplusplus
}
#endif
#endif
