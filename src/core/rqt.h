/* rqt.h - the public header of librqt.a: terrain as restricted quadtrees.
 *
 * How to read this file: top to bottom, as a manual. A digital elevation model is a grid of *samples*.
 * Its samples are the vertices of a *lattice*; right triangles that are halved again and again (a *bintree*)
 * tile the lattice; a *closed* set of lattice vertices is the same thing as a crack-free mesh of such
 * triangles. Each vertex gets an exact *error*; the mesh for a tolerance eps is "all vertices with an error
 * above eps". Samples and errors are kept in square *blocks*, each of which stands alone: a *query* finds the
 * one block that answers each place, and walks it.
 *
 * Rules of this library
 *  - C11 and libc, libm, zstd. No file, no database, no printing, no global state that changes.
 *  - Memory comes from the rqt_allocator that is passed in. What a function allocates, its ..._free releases.
 *  - Functions that can fail return rqt_status; outputs are then left empty, so that ..._free is harmless.
 *  - Heights are integers q in a unit of the terrain's own (rqt_unit); errors are codes (rqt_code), integers
 *    whose order is the order of the errors. All decisions are made between integers.
 *  - Coordinates: x grows east (columns), y grows south (rows), (0,0) is the north-west sample.
 *
 * Sources named below: [RQT] Pajarola, "Large scale terrain visualization using the restricted quadtree
 * triangulation" (1998), for the lattice, Algorithms 1 and 2 and strips.
 */
#ifndef RQT_H
#define RQT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define RQT_VERSION "0.1.0"
#define RQT_FORMAT_VERSION 1 /* of everything stored; FORMAT.md */

typedef enum rqt_status {
    RQT_OK = 0,
    RQT_NO_MEMORY,   /* the allocator said no */
    RQT_CORRUPT,     /* stored bytes are not what their format promises */
    RQT_INVALID,     /* an argument is outside what the function accepts */
    RQT_UNSUPPORTED, /* understood, but not in this version */
    RQT_READ_FAILED, /* a callback of the caller failed; the caller knows why */
    RQT_INTERRUPTED  /* a callback of the caller asked to stop */
} rqt_status;

/* A sentence about a failure, without trailing newline. Functions that take one fill it when they fail. */
typedef struct rqt_message {
    char text[256];
} rqt_message;

/* realloc in one function: p NULL allocates, bytes 0 releases (and returns NULL), otherwise resizes.
 * Returns NULL when there is no memory; p then stays valid. */
typedef struct rqt_allocator {
    void *(*resize)(void *context, void *p, size_t bytes);
    void *context;
} rqt_allocator;

/* ------------------------------------------------------------------------------------------- lattice --
 * The root square has 2^K + 1 vertices a side, the smallest that holds the raster, anchored at sample (0,0).
 * Lattice vertex (x,y) IS the sample (min(x,width-1), min(y,height-1)): topology lives on the lattice,
 * geometry is clamped to the raster. A triangle of zero area then lies on the last column or row, and is
 * dropped. */
#define RQT_MAX_K 20 /* a side of 1,048,577 samples: more than any national 1 m grid is wide */

typedef struct rqt_vertex {
    int32_t x, y;
} rqt_vertex;

typedef struct rqt_lattice {
    int32_t width, height; /* samples, each 1 .. 2^RQT_MAX_K + 1 */
    int K;                 /* 0 .. RQT_MAX_K */
} rqt_lattice;

/* A triangle of the bintree: right angle at the apex, hypotenuse from left to right. Its split vertex is the
 * midpoint of the hypotenuse. */
typedef struct rqt_triangle {
    rqt_vertex apex, left, right;
} rqt_triangle;

/* RQT_INVALID when a side is less than 1 or more than 2^RQT_MAX_K + 1. */
rqt_status rqt_lattice_init(rqt_lattice *lattice, int64_t width, int64_t height);

/* log2 of the largest power of two that divides both coordinates; K for the four corners. */
int rqt_vertex_scale(const rqt_lattice *lattice, rqt_vertex v);
/* The level of a vertex: 0 for the corners, K for the finest ([RQT] section 3). */
int rqt_vertex_level(const rqt_lattice *lattice, rqt_vertex v);
#define RQT_RANKS (2 * RQT_MAX_K + 2)
/* 2 * scale for vertices on the sides of cells, 2 * scale + 1 for centres of cells (corners: K for their scale,
 * either way): the parents of a vertex have higher ranks than it. */
int rqt_vertex_rank(const rqt_lattice *lattice, rqt_vertex v);
/* The vertices that v depends on, at most two; returns their number: 0 for corners, 1 for a midpoint of the
 * root's border, 2 otherwise. */
int rqt_vertex_parents(const rqt_lattice *lattice, rqt_vertex v, rqt_vertex parents[2]);
/* The ends of the edge that v halves, which have higher scales than v; returns their number: 0 for corners, else 2.
 */
int rqt_vertex_ends(const rqt_lattice *lattice, rqt_vertex v, rqt_vertex ends[2]);
/* The vertices that depend on v, at most four; returns their number. */
int rqt_vertex_children(const rqt_lattice *lattice, rqt_vertex v, rqt_vertex children[4]);
/* The sample that a lattice vertex stands for. */
rqt_vertex rqt_vertex_clamp(const rqt_lattice *lattice, rqt_vertex v);

/* ----------------------------------------------------------------------------------- units and codes --
 * Metres of a height q: ((double)z0 + q / (double)d) * f + o, with
 * f = scale * (numerator / denominator). One double expression, evaluated in that order, never fused. */
typedef struct rqt_unit {
    int64_t z0;                     /* |z0| < 2^53 */
    int32_t d;                      /* quanta in one unit, 1 .. 2^20 */
    int32_t numerator, denominator; /* the unit in metres where it is a named one: 1/1, 381/1250, 1200/3937 */
    double scale;  /* band scale times the unit where that is a plain number; 2^-200 < |f|/d < 2^200 */
    double offset; /* metres, finite */
} rqt_unit;

#define RQT_HEIGHT_LIMIT (1 << 30) /* |q| < this */

bool rqt_unit_is_valid(const rqt_unit *unit);
double rqt_unit_factor(const rqt_unit *unit); /* f */
double rqt_unit_metres(const rqt_unit *unit, int32_t q);

/* An error as a small float of 8 significant bits in 16: code 0 is 0, code c > 0 is
 * (128 + (c & 127)) * 2^((c >> 7) - 263), 65535 is infinity. So every tolerance of at most 8 significant bits
 * (0.5, 5, 20, 100 ...) is a code itself, and selects exactly what real-valued errors would select. */
typedef uint16_t rqt_code;
#define RQT_CODE_INFINITY ((rqt_code)0xFFFF)
#define RQT_CODE_LARGEST ((rqt_code)0xFFFE) /* the largest finite code */

/* The value of a code, exactly; +infinity for RQT_CODE_INFINITY. */
double rqt_code_metres(rqt_code code);
/* The smallest code that is not below numerator/denominator height quanta, in metres: compared as exact
 * rationals, whatever the unit. Values above the largest finite code give it; a valid unit has
 * none such. denominator is 1 .. 2^42. */
rqt_code rqt_code_from_quanta(const rqt_unit *unit, uint64_t numerator_high, uint64_t numerator_low,
                              uint64_t denominator);
/* The smallest code that is not below extent*cell/c, exactly: what a void outline costs. extent >= 0 samples,
 * cell and c finite and > 0. */
rqt_code rqt_code_from_ground(int64_t extent, double cell, double c);
/* The largest code that is not above metres (metres >= 0; infinity gives RQT_CODE_LARGEST). */
rqt_code rqt_code_floor(double metres);
/* The code every comparison is made with: the largest code <= max(0, eps - quantum_error), the difference
 * rounded down. eps must not be NaN or negative. */
rqt_code rqt_code_eps(double eps, double quantum_error);

/* -------------------------------------------------------------------------------------- exact errors --
 * The error of a vertex P is the largest deviation, over ALL valid samples in the at most two closed clamped
 * triangles whose split vertex is P, of the sample from the triangle's plane: ALGORITHMS in src/README.md.
 * A triangle that holds valid and void samples is *mixed*: it counts as
 *     max(deviation of its valid samples if its three corners are valid, else 0; extent * cell / c)
 * where extent is the longer side of the clamped triangle's box in samples, and P gets the outline bit x. */
typedef struct rqt_grid {
    rqt_lattice lattice;
    const int32_t *q;     /* width * height, row by row; the value where a sample is void does not matter */
    const uint8_t *valid; /* width * height, 0 or 1; NULL when every sample is valid */
} rqt_grid;

typedef struct rqt_void_cost {
    double cell; /* metres of ground that one sample step stands for */
    double c;    /* metres of outline that may be lost per metre of eps (--void-tol) */
} rqt_void_cost;

/* Errors of every lattice vertex that a block can ask for. Vertices past the raster's last sample sit in a few
 * extra columns and rows; only rqt_errors_at knows where. */
typedef struct rqt_errors {
    rqt_lattice lattice;
    int32_t columns, rows; /* of the arrays: samples plus extras */
    rqt_code *code;        /* columns * rows */
    uint8_t *outline;      /* columns * rows, 0 or 1: the bit x */
    bool any_outline;
} rqt_errors;

/* Bytes that rqt_errors_compute allocates, for a memory plan. */
size_t rqt_errors_bytes(const rqt_lattice *lattice);
/* e(P) and x(P) as defined above, raw: not yet propagated to ancestors. O(n log n).
 * progress, when not NULL, is called with the share done, and stops the work when it returns false. */
rqt_status rqt_errors_compute(const rqt_grid *grid, const rqt_unit *unit, const rqt_void_cost *cost,
                              const rqt_allocator *allocator, bool (*progress)(void *context, double done),
                              void *context, rqt_errors *errors);
/* e_sat and the saturated x, in place: each vertex gets the maximum over itself and all its descendants;
 * the four corners get RQT_CODE_INFINITY. O(n). */
void rqt_errors_saturate(rqt_errors *errors);
/* The code and bit of a lattice vertex, 0 <= x,y <= 2^K. */
rqt_code rqt_errors_at(const rqt_errors *errors, rqt_vertex v, bool *outline);
void rqt_errors_free(rqt_errors *errors, const rqt_allocator *allocator);

/* --------------------------------------------------------------------------------------------- sweep --
 * The same errors, saturated, of a raster that passes by in *bands*, for imports in bounded memory ([ALGORITHMS in
 * src/README.md, "Import"]). A tile is a cell of side 2^b of the lattice; band r holds the tiles of rows r*2^b to
 * (r+1)*2^b, both ends included, cut at the last row. The memory of two bands is all that the raster's height does
 * not change.
 *
 *   create
 *   first reading:   rqt_sweep_first for every row y with rqt_sweep_wants, in any order
 *   second reading, for each band r = 0, 1, ... rqt_sweep_bands - 1:
 *       rqt_sweep_begin: where the rows go that are not there yet; fill them
 *       rqt_sweep_tile for every tile of the band, in any order, on any threads
 *       rqt_sweep_end: band r - 1, and after the last one that one too, is final but for vertices of scale >= b;
 *       take it (rqt_sweep_band) before the next rqt_sweep_begin. begin and end are called by one thread, while no
 *       tile is at work
 *   rqt_sweep_finish: vertices of scale >= b are final: rqt_sweep_coarse
 *
 * Codes and outline bits equal those of rqt_errors_compute and rqt_errors_saturate, for every b and any number of
 * workers. */
typedef struct rqt_sweep rqt_sweep;

typedef struct rqt_sweep_plan {
    rqt_lattice lattice;
    rqt_unit unit;
    rqt_void_cost cost;
    int32_t min_q, max_q; /* of the valid samples */
    bool has_voids;       /* false: valid is not looked at, and no memory is taken for voids */
    int b;                /* 1 .. K (0 where K is); a tile takes (2^b + 1)^2 samples of working memory per worker */
    int workers;          /* threads that call rqt_sweep_tile at a time */
} rqt_sweep_plan;

/* Bytes that a sweep allocates. */
size_t rqt_sweep_bytes(const rqt_sweep_plan *plan);
rqt_status rqt_sweep_create(const rqt_sweep_plan *plan, const rqt_allocator *allocator, rqt_sweep **sweep);
void rqt_sweep_free(rqt_sweep *sweep);
int32_t rqt_sweep_bands(const rqt_sweep *sweep);
int32_t rqt_sweep_tiles(const rqt_sweep *sweep); /* in a band */

/* Does the first reading want row y (0 .. height-1)? */
bool rqt_sweep_wants(const rqt_sweep *sweep, int32_t y);
/* A whole row of the raster; valid may be NULL when all of it is. */
void rqt_sweep_first(rqt_sweep *sweep, int32_t y, const int32_t *q, const uint8_t *valid);

/* Rows *first .. *first + *count - 1 are to be written to *q and *valid (NULL without voids), rows of `width`
 * values without gaps; void samples need validity 0 and any q. */
void rqt_sweep_begin(rqt_sweep *sweep, int32_t band, int32_t *first, int32_t *count, int32_t **q, uint8_t **valid);
void rqt_sweep_tile(rqt_sweep *sweep, int worker, int32_t tile);
void rqt_sweep_end(rqt_sweep *sweep);

/* A band that is final but for its vertices of scale >= b. Reading it is thread-safe. */
typedef struct rqt_band {
    int32_t first_row, rows; /* samples: rows of q and valid */
    const int32_t *q;        /* rows * width */
    const uint8_t *valid;    /* NULL: all */
    const rqt_sweep *sweep;
    int32_t band;
} rqt_band;
rqt_band rqt_sweep_band(const rqt_sweep *sweep, int32_t band);
/* The code and bit of a lattice vertex in the closed band (0 <= x <= 2^K, band*2^b <= y <= (band+1)*2^b; the last
 * band also answers for what is past it, to y = 2^K); of one of scale >= b, 0. */
rqt_code rqt_band_error(const rqt_band *band, rqt_vertex v, bool *outline);
/* n codes and bits (outline may be NULL) of the vertices (x + i*step, y), quickly. */
void rqt_band_errors(const rqt_band *band, int32_t x, int32_t y, int32_t step, int32_t n, rqt_code *codes,
                     uint8_t *outline);
void rqt_sweep_finish(rqt_sweep *sweep);
/* The sample of a lattice vertex of scale >= b, known since the first reading; and, when finished, its code and
 * bit. *flags: RQT_VALID | RQT_OUTLINE. */
rqt_code rqt_sweep_coarse(const rqt_sweep *sweep, rqt_vertex v, int32_t *q, uint8_t *flags);

/* ----------------------------------------------------------------------------------------- selection --
 * A set of lattice vertices. Closed sets are exactly the crack-free meshes: with its four corners (always in,
 * never stored) and every parent of every member. */
typedef struct rqt_selection rqt_selection;

rqt_status rqt_selection_create(const rqt_lattice *lattice, const rqt_allocator *allocator,
                                rqt_selection **selection);
void rqt_selection_free(rqt_selection *selection);
bool rqt_selection_has(const rqt_selection *selection, rqt_vertex v);
size_t rqt_selection_count(const rqt_selection *selection); /* without the corners */
/* Insert v and, transitively, everything it depends on ([RQT] Algorithm 1, ResolveDependencies). */
rqt_status rqt_selection_add_resolved(rqt_selection *selection, rqt_vertex v);
/* Insert n vertices and close the set, one pass from the finest level to the coarsest, sides before centres
 * within a level ([RQT] Algorithm 2). Vertices already in the selection must be closed. */
rqt_status rqt_selection_add_bottom_up(rqt_selection *selection, const rqt_vertex *vertices, size_t n);
/* Algorithms 1 and 2 over a whole terrain: everything with error > eps or the outline bit, closed. They work
 * from raw errors and from saturated ones, and give the same set. */
rqt_status rqt_select_top_down(const rqt_errors *errors, rqt_code eps, rqt_selection *selection);
rqt_status rqt_select_bottom_up(const rqt_errors *errors, rqt_code eps, rqt_selection *selection);

/* -------------------------------------------------------------------------------------------- blocks --
 * The block of level l at cell (i,j) covers the square of side 2^(K-l) at (i,j)*2^(K-l) with (2^k + 1)^2
 * vertices, neighbours 2^(K-l-k) samples apart (its stride). Levels run from 0, the root, to K-k, stride 1.
 * A block exists iff its north-west corner is before the last column and the last row (in a raster of one
 * column or row: iff it is the first). */
#define RQT_MAX_BLOCK_K 8

/* Number of a block: 4^level + the Morton code of (i,j), x in the even bits. Never 0; sorted by level. */
typedef uint64_t rqt_block_number;

typedef struct rqt_block_place {
    int level;
    int32_t i, j;          /* cell */
    int32_t x, y;          /* north-west corner, samples */
    int32_t side;          /* samples; x+side and y+side may lie past the raster */
    int32_t stride;        /* samples between neighbours of its grid */
    int32_t width, height; /* vertices of its grid up to the first that is at or past the last sample, 1 .. 2^k + 1;
                              the ones after it are the same sample again */
} rqt_block_place;

rqt_block_number rqt_block_number_of(int level, int32_t i, int32_t j);
/* RQT_INVALID when the terrain (lattice and k, 0 <= k <= min(RQT_MAX_BLOCK_K, K)) has no such block. */
rqt_status rqt_block_locate(const rqt_lattice *lattice, int k, rqt_block_number number, rqt_block_place *place);
/* How many levels of blocks there are: K - k + 1. */
int rqt_block_levels(const rqt_lattice *lattice, int k);

#define RQT_VALID 1   /* flag: the sample has data */
#define RQT_OUTLINE 2 /* flag: the bit x of the vertex */

/* A decoded block: three arrays of (2^k + 1)^2, row by row. Vertices past the last sample repeat its height
 * and validity, as the lattice does, and have errors and outline bits of their own. */
typedef struct rqt_block {
    int k;
    int32_t width, height; /* as in rqt_block_place: what is stored of heights and validity */
    int32_t *q;
    rqt_code *error; /* saturated */
    uint8_t *flags;  /* RQT_VALID | RQT_OUTLINE */
    /* A block of stride > 1 is *sparse*: it answers only where eps >= floor (its em for the outline `tol`), so a
     * vertex with error <= floor and without outline bit, other than a corner, is never selected in it. Such a
     * vertex is not kept: nothing of it is stored. Decoded it has q 0, error 0 and the flag RQT_VALID; encoding
     * does not look at it. */
    bool sparse;
    rqt_code floor; /* 0 unless sparse */
} rqt_block;

rqt_status rqt_block_create(int k, const rqt_allocator *allocator, rqt_block *block);
void rqt_block_free(rqt_block *block, const rqt_allocator *allocator);
/* Bytes of memory that a decoded block of this k takes. */
size_t rqt_block_bytes(int k);

/* A compressor or decompressor with its buffers, for one thread. Knows the largest block it can meet. */
typedef struct rqt_codec rqt_codec;
rqt_status rqt_codec_create(const rqt_allocator *allocator, rqt_codec **codec);
void rqt_codec_free(rqt_codec *codec);

/* The most bytes that an encoded block of this k can take. */
size_t rqt_block_bound(int k);
/* block -> bytes (FORMAT.md, "Block"). quantum is the metres of one height quantum, |f|/d, used to predict
 * errors from heights. bytes has room for rqt_block_bound(block->k). Equal blocks give equal bytes. */
rqt_status rqt_block_encode(rqt_codec *codec, const rqt_block *block, double quantum, uint8_t *bytes, size_t *size);
/* bytes -> block, which was created with the k that rqt_block_info tells. Trusts nothing: any input gives
 * RQT_OK or RQT_CORRUPT, without reading past size. The errors and outline bits of the four corners are not in the
 * bytes but in the block's summary: here they are 0, until rqt_block_set_corners. */
rqt_status rqt_block_decode(rqt_codec *codec, const uint8_t *bytes, size_t size, rqt_block *block);

typedef struct rqt_block_header {
    int version, k;
    int32_t width, height; /* stored heights */
    bool has_voids, all_void, has_outline, sparse;
    int height_planes, finest_planes,
        error_planes; /* bytes per residual: heights, errors of the finest scale, others */
    double quantum;
    rqt_code floor, ground; /* ground: what an outline vertex of the finest scale is expected to err */
    size_t kept;            /* vertices of a sparse block, corners included; else 0 */
    size_t payload;         /* bytes after decompression */
} rqt_block_header;

/* Header only, checked against size; the checksum is not computed. */
rqt_status rqt_block_info(const uint8_t *bytes, size_t size, rqt_block_header *header, rqt_message *message);
/* Full validation: decodes, and says what is wrong. */
rqt_status rqt_block_check(rqt_codec *codec, const uint8_t *bytes, size_t size, rqt_message *message);

/* What a query must know of a block before (and often instead of) reading it: FORMAT.md, "Block summary".
 * corner: north-west, north-east, south-west, south-east. far: the two vertices outside the block that complete
 * the parent's quarters; far[n] = 2*A - c, A the block's corner on the parent's border that is far_apex(n), c the
 * corner opposite the parent's centre. n = 0: A differs from c in x; n = 1: A differs from c in y. Unused, all
 * zero, at level 0. Positions are lattice positions, values those of the clamped sample. */
typedef struct rqt_summary_vertex {
    int32_t q;
    rqt_code error;
    uint8_t flags;
} rqt_summary_vertex;

/* The errors finer than the block's stride lie in an interval: the block answers eps iff em <= eps < em_parent.
 * One interval for the outline `tol`, one for `exact`, where an outline bit below counts as infinite. */
typedef struct rqt_interval {
    rqt_code em, em_parent;
} rqt_interval;

typedef struct rqt_summary {
    rqt_interval tol, exact;
    rqt_code center_error; /* 0 when k = 0: such a block has no centre */
    uint8_t center_flags;
    rqt_summary_vertex corner[4];
    rqt_summary_vertex far[2];
} rqt_summary;

/* What a decoded block lacks: the errors and outline bits of its corners. */
void rqt_block_set_corners(rqt_block *block, const rqt_summary *summary);

#define RQT_SUMMARY_BYTES 80
void rqt_summary_encode(const rqt_summary *summary, uint8_t bytes[RQT_SUMMARY_BYTES]);
rqt_status rqt_summary_decode(const uint8_t *bytes, size_t size, rqt_summary *summary);

/* The whole pyramid of one terrain from its samples and saturated errors, for the store to write. */
typedef struct rqt_pyramid rqt_pyramid;
/* grid and errors must outlive the pyramid. k as in rqt_block_locate. */
rqt_status rqt_pyramid_create(const rqt_grid *grid, const rqt_errors *saturated, int k,
                              const rqt_allocator *allocator, rqt_pyramid **pyramid);
void rqt_pyramid_free(rqt_pyramid *pyramid);
size_t rqt_pyramid_count(const rqt_pyramid *pyramid); /* blocks of all levels */
/* Block number n (0 .. count-1), in ascending order of block number. block may be NULL when only the summary is
 * wanted. Thread-safe: changes nothing. */
void rqt_pyramid_block(const rqt_pyramid *pyramid, size_t n, rqt_block_number *number, rqt_summary *summary,
                       rqt_block *block);

/* --------------------------------------------------------------------------------------------- build --
 * The same blocks out of the bands of a sweep, for an import in bounded memory: those of a side of up to 2^b tile
 * by tile as their band becomes final, the coarser ones at the end, out of a scratch file of every S-th vertex, S =
 * 2^(b-k+1). Blocks and summaries equal those of rqt_pyramid, for every b.
 *
 *   create
 *   for every final band, every tile of it, in any order, on any threads: rqt_build_tile
 *       when all tiles of the band are built: rqt_build_keep
 *   after rqt_sweep_finish, for each level from rqt_build_coarsest_in_tile - 1 down to 0, every cell of it, in any
 *       order, on any threads: rqt_build_coarse
 *   then, for every block: rqt_build_summary
 */
typedef struct rqt_build rqt_build;

/* A file of nothing but our own bytes. false: it failed, and the build stops with RQT_READ_FAILED. read is called
 * from several threads at once. */
typedef struct rqt_scratch_file {
    bool (*write)(void *context, uint64_t offset, const void *bytes, size_t size);
    bool (*read)(void *context, uint64_t offset, void *bytes, size_t size);
    void *context;
} rqt_scratch_file;

/* Is called with each block that is made. summary: complete but for the intervals and for vertices of scale >= b;
 * keep it for rqt_build_summary. false stops. */
typedef bool rqt_build_emit(void *context, rqt_block_number number, const rqt_summary *summary,
                            const rqt_block *block);

size_t rqt_build_bytes(const rqt_lattice *lattice, int k, int b);
/* k <= b <= K as in the sweep. file may be NULL when K == b. */
rqt_status rqt_build_create(const rqt_lattice *lattice, int k, int b, const rqt_scratch_file *file,
                            const rqt_allocator *allocator, rqt_build **build);
void rqt_build_free(rqt_build *build);
size_t rqt_build_count(const rqt_build *build); /* blocks of all levels */
/* block: room for one of this k, for this thread. */
rqt_status rqt_build_tile(rqt_build *build, const rqt_band *band, int32_t tile, rqt_block *block,
                          rqt_build_emit *emit, void *context);
rqt_status rqt_build_keep(rqt_build *build, const rqt_band *band);
/* The level of the largest blocks that a tile holds. */
int rqt_build_coarsest_in_tile(const rqt_build *build);
int32_t rqt_build_cells(const rqt_build *build, int level); /* blocks of a level */
rqt_status rqt_build_coarse(rqt_build *build, const rqt_sweep *sweep, int level, int32_t cell, rqt_block *block,
                            rqt_build_emit *emit, void *context);
/* What was missing in the summary of the block: its vertices of scale >= b and its intervals. */
void rqt_build_summary(const rqt_build *build, const rqt_sweep *sweep, rqt_block_number number,
                       rqt_summary *summary);
/* The largest finite error of the terrain, when all is built. */
rqt_code rqt_build_max_error(const rqt_build *build);

/* -------------------------------------------------------------------------------------------- update --
 * New samples for a rectangle of a terrain whose blocks are kept somewhere: which blocks and summaries become
 * others, and what they become. That is what a build over the changed raster gives, bit for bit. What it takes
 * grows with the rectangle, and for coarser vertices near it with what a branch and bound over summaries has to
 * look at; not with the terrain. */
typedef struct rqt_statistics {
    int64_t voids;
    int32_t min_q, max_q; /* of the valid samples; both 0 when there are none */
    rqt_code max_error;   /* rqt_build_max_error */
} rqt_statistics;

typedef struct rqt_update {
    rqt_lattice lattice;
    int k;
    rqt_unit unit;
    rqt_void_cost cost;
    rqt_statistics before;
    int32_t x, y, width, height; /* the rectangle, inside the raster */
    const int32_t *q;            /* width * height, |q| < RQT_HEIGHT_LIMIT; anything where void */
    const uint8_t *valid;        /* 0 or 1; NULL: all */
    /* The blocks as they are: decoded with their corners (rqt_block_set_corners), valid until the next call. NULL
     * and false: the update stops with RQT_READ_FAILED. Only blocks that exist are asked for, and none after it has
     * been written. */
    const rqt_block *(*read_block)(void *context, rqt_block_number number);
    bool (*read_summary)(void *context, rqt_block_number number, rqt_summary *summary);
    /* A block that changes, each once, in ascending order of number within a level, when everything is known. block
     * NULL: its bytes stay as they are. before and after may be equal. false stops with RQT_READ_FAILED. */
    bool (*write)(void *context, rqt_block_number number, const rqt_summary *before, const rqt_summary *after,
                  const rqt_block *block);
    bool (*is_interrupted)(void *context); /* may be NULL */
    void *context;
} rqt_update;

typedef struct rqt_update_result {
    rqt_statistics after;
    int64_t changed;  /* samples of the rectangle that are others now; 0: nothing has been written */
    int64_t measured; /* samples that triangles were measured by, each time */
    int64_t cells;    /* summaries that the branch and bound has looked at */
} rqt_update_result;

/* RQT_INVALID when the rectangle is not in the raster, or a height not within the limit. RQT_CORRUPT when what is
 * read cannot be. Memory: about 15 bytes a sample of the rectangle, and the blocks that change, decoded. */
rqt_status rqt_update_run(const rqt_update *update, const rqt_allocator *allocator, rqt_update_result *result);

/* ------------------------------------------------------------------------------------------- regions --
 * A geometry as it came (WKT or EWKT text, GeoPackage or SpatiaLite bytes), in its own coordinates; and a
 * region: the same in sample coordinates, each rounded to the nearest 2^-20 sample, exact integers after that.
 * Interiors of polygons follow the even-odd rule over all rings, whatever their order or direction; a
 * multipolygon or a collection is the union of its members. */
typedef struct rqt_geometry rqt_geometry;
typedef struct rqt_region rqt_region;

/* text: n characters of WKT or EWKT; else n bytes of a GeoPackage or SpatiaLite geometry, WKB or EWKB. Z and M are
 * read and ignored. RQT_INVALID with a sentence for anything unreadable, not finite, or empty where it must not be;
 * RQT_UNSUPPORTED for curves and surfaces. An EMPTY geometry is valid and meets nothing. */
rqt_status rqt_geometry_parse(const void *bytes, size_t n, bool text, const rqt_allocator *allocator,
                              rqt_geometry **geometry, rqt_message *message);
/* Lines of counts[i] points x,y, one line after the other; a line of one point is a point. RQT_INVALID when a
 * coordinate is not finite. */
rqt_status rqt_geometry_of_lines(const double *xy, const size_t *counts, size_t lines, int32_t srid,
                                 const rqt_allocator *allocator, rqt_geometry **geometry);
void rqt_geometry_free(rqt_geometry *geometry);
/* 0 when the geometry names none (GeoPackage's 0 and -1 count as none). */
int32_t rqt_geometry_srid(const rqt_geometry *geometry);
/* How many members it has; and the coordinates x,y of member n with the number of its points, if it is a line or a
 * point: NULL when it is a polygon. */
size_t rqt_geometry_members(const rqt_geometry *geometry);
const double *rqt_geometry_line(const rqt_geometry *geometry, size_t n, size_t *points);
/* Adds to every member its copies at each multiple of `period` that, added to its x, puts its box on [low, high]:
 * longitudes are the same modulo 360. A member with coordinates beyond three periods gets none. */
rqt_status rqt_geometry_repeat(rqt_geometry *geometry, double period, double low, double high);
bool rqt_geometry_is_empty(const rqt_geometry *geometry);
/* As well-known binary, x and y only: one member as what it is, several as a collection. *bytes is released with
 * allocator->resize(context, bytes, 0). */
rqt_status rqt_geometry_wkb(const rqt_geometry *geometry, const rqt_allocator *allocator, uint8_t **bytes,
                            size_t *size);

/* Where the samples of a terrain lie: sample (col,row) is at (x0 + col*dx, y0 + row*dy). dx, dy finite, not 0. */
typedef struct rqt_placement {
    double x0, y0, dx, dy;
} rqt_placement;

/* geometry NULL: everything. Coordinates further than 2^40 samples from the terrain are taken as that far. */
rqt_status rqt_region_create(const rqt_geometry *geometry, const rqt_placement *placement,
                             const rqt_lattice *lattice, const rqt_allocator *allocator, rqt_region **region);
typedef struct rqt_square {
    int32_t x, y, side; /* lattice; side a power of two, x and y multiples of it */
} rqt_square;
/* The union of squares: the region that their rings would make, but quicker to make and to ask. They come in Morton
 * order; one that holds others may come anywhere among those. RQT_INVALID for squares in another order or such as
 * are none. What has no area on the raster is left out, and what reaches past it stays as it is. */
rqt_status rqt_region_of_squares(const rqt_square *squares, size_t n, const rqt_lattice *lattice,
                                 const rqt_allocator *allocator, rqt_region **region);
void rqt_region_free(rqt_region *region);
size_t rqt_region_bytes(const rqt_region *region); /* of memory that it takes */
bool rqt_region_is_all(const rqt_region *region);
bool rqt_region_is_empty(const rqt_region *region);
/* The region's box grown outward to whole samples and clamped to the raster. false when it misses the raster. */
bool rqt_region_box(const rqt_region *region, int32_t *x0, int32_t *y0, int32_t *x1, int32_t *y1);

typedef enum rqt_relation {
    RQT_OUTSIDE, /* no triangle within the box belongs to the region */
    RQT_INSIDE,  /* every triangle with an area within the box does */
    RQT_ACROSS   /* ask for the triangle */
} rqt_relation;

/* How the closed box of samples [x0,x1] x [y0,y1] lies to the region. May answer RQT_ACROSS where a closer look
 * would tell more, never the other way. */
rqt_relation rqt_region_box_relation(const rqt_region *region, int32_t x0, int32_t y0, int32_t x1, int32_t y1);
/* Mode `border`: a region that is one axis-parallel rectangle grows outward to sample lines. Others stay. */
void rqt_region_grow_rectangle(rqt_region *region);
/* Mode `cover`: does the triangle (sample coordinates, any winding, with an area) belong to the region? For a
 * member with an area: interior meets interior. For lines and points, and polygons that the rounding collapsed:
 * the closed triangle meets it. Exact. */
bool rqt_region_meets(const rqt_region *region, rqt_vertex a, rqt_vertex b, rqt_vertex c);
/* Mode `snap`: the union of all squares of a grid that the region meets, clipped to the raster: a square belongs
 * when its interior meets the interior of a member with an area, or when a line or point touches it. The grid is
 * anchored at sample (0,0); its side is the largest power of two of samples that is not above an eighth of the
 * longer side of the region's box (rqt_region_box), at least 1: so no region has more than 18 squares a side.
 * Everything stays everything. */
rqt_status rqt_region_snap(const rqt_region *region, const rqt_lattice *lattice, const rqt_allocator *allocator,
                           rqt_region **snapped);
int32_t rqt_region_snap_side(const rqt_region *region);
/* Is the sample in the interior of a member with an area? */
bool rqt_region_contains(const rqt_region *region, rqt_vertex sample);

/* --------------------------------------------------------------------------------------------- rules --
 * Selection where one eps is not enough: an eps of its own for places, an eps that falls with the size of
 * triangles, vertices that must be there. A vertex P is selected iff
 *
 *     e_sat(P) > threshold(P), or P is forced or an ancestor of a forced vertex, or (outline exact) it has the bit
 * x threshold(P) = the code of the least eps - lowering(rank of P), eps: that of the rule and those of all places
 *                    whose closed region meets the closed box of P (and of a field's squares, below); -1 where that
 *                    is below 0
 *     box(P)       = the square around P of half-width 3q for the centre of a cell of side 2q, else 2q, where q is
 * the largest power of two that divides both coordinates; it may reach past the raster
 *
 * which is a closed set: rule.c has the proof. No valid sample of a kept leaf is further off than eps -
 * lowering(rank of the leaf's split vertex) for the least eps of all places that hold the sample, nor than the
 * rule's own. One rule gives one mesh: answers of any regions are parts of it. */
typedef struct rqt_rule rqt_rule;

typedef struct rqt_rule_place {
    const rqt_region *region; /* must outlive the rule; an empty one is nowhere */
    double eps;               /* metres, not NaN, >= 0 */
} rqt_rule_place;

/* A rule of eps 0 for all vertices: set what is different. quantum_error as in rqt_code_eps, metres. */
rqt_status rqt_rule_create(const rqt_lattice *lattice, double quantum_error, const rqt_allocator *allocator,
                           rqt_rule **rule);
void rqt_rule_free(rqt_rule *rule);
/* eps where no place says less: metres, not NaN, >= 0 (else RQT_INVALID). Cheap. */
rqt_status rqt_rule_set_eps(rqt_rule *rule, double eps);
/* What is taken from every eps, by rank: metres, finite, >= 0, and not less for a higher rank (else RQT_INVALID).
 */
rqt_status rqt_rule_set_lowering(rqt_rule *rule, const double metres[RQT_RANKS]);
/* Instead of the places there were. Thousands are quick: there is a tree over their boxes. */
rqt_status rqt_rule_set_places(rqt_rule *rule, const rqt_rule_place *places, size_t n);
/* Force a vertex, and with it all that it depends on. */
rqt_status rqt_rule_force(rqt_rule *rule, rqt_vertex v);
/* Mode `border`: force whatever makes the border of R' a union of edges, where R' is the union of the unit half
 * cells whose interior meets that of R, the members of the region with an area. The leaves that meet R then tile
 * R'. See border.c. is_interrupted may be NULL; RQT_INTERRUPTED: some are forced, and the rule is of no use. */
rqt_status rqt_rule_force_border(rqt_rule *rule, const rqt_region *region, bool (*is_interrupted)(void *context),
                                 void *context);

/* An eps for every place: a *field* cuts the root square into quarters of quarters, as finely as it is told to, and
 * has an eps in each square that is left. To a rule its squares are places, but open ones: threshold(P) takes in
 * the least eps of all squares that have a point in common with the interior of box(P), beside the rule's own eps
 * and its other places. A sample on the side of a square so gets the least eps of all squares there. Views
 * (rqt_view.h) are such fields. */
typedef struct rqt_field rqt_field;

typedef enum rqt_field_step { RQT_FIELD_LEAF, RQT_FIELD_SPLIT, RQT_FIELD_FAIL } rqt_field_step;
/* What becomes of a square: *eps (metres, not NaN, >= 0; infinity: nothing is asked for there) for all of it, or
 * its quarters are asked for, each at once with all that is in it, in Morton order. A square of side 1 cannot be
 * split: RQT_FIELD_SPLIT is an error there. Squares exist where blocks do: those whose north-west corner is on or
 * past the last column or row are not asked for (in a raster of one column or row: all but the first), for what
 * they share with the raster is on the side of another. */
typedef rqt_field_step rqt_field_decide(void *context, rqt_square square, double *eps);
/* RQT_READ_FAILED after RQT_FIELD_FAIL; RQT_INVALID for an eps that is none, or side 1 split. 16 to 32
 * bytes a square. */
rqt_status rqt_field_create(const rqt_lattice *lattice, const rqt_allocator *allocator, rqt_field_decide *decide,
                            void *context, rqt_field **field);
void rqt_field_free(rqt_field *field);
/* The squares that are left, in Morton order; false: there is no nth. eps is rounded down to a code, as used. O(K).
 */
size_t rqt_field_count(const rqt_field *field);
bool rqt_field_square(const rqt_field *field, size_t n, rqt_square *square, double *eps);
/* The least eps of the squares that have a point in common with the open box; infinity where there is none. */
double rqt_field_least(const rqt_field *field, int32_t x0, int32_t y0, int32_t x1, int32_t y1);
/* The field must outlive the rule, or the next call of this; NULL: none. RQT_INVALID for a field over another
 * raster. */
rqt_status rqt_rule_set_field(rqt_rule *rule, const rqt_field *field);

/* The largest code that an error may have without the vertex being selected for it; -1: none. */
int32_t rqt_rule_threshold(const rqt_rule *rule, rqt_vertex v);
/* outline: the vertex has the bit x, and it counts. */
bool rqt_rule_selects(const rqt_rule *rule, rqt_vertex v, rqt_code error, bool outline);

/* ----------------------------------------------------------------------------------- query and patch --
 * The mesh that answers a query. Vertices are samples, each once, in the order of the walk. */
typedef struct rqt_patch_vertex {
    int32_t col, row;
    int32_t q;
    rqt_code error; /* the largest among the lattice vertices that are this sample and in the patch */
    uint8_t level;  /* the smallest among them */
} rqt_patch_vertex;

typedef struct rqt_patch {
    rqt_patch_vertex *vertices;
    size_t vertex_count;
    uint32_t
        *triangles; /* 3 * triangle_count indices, counter-clockwise seen from above, in the order of the walk */
    size_t triangle_count;
    rqt_triangle *leaves; /* NULL unless the query asked: the same triangles by lattice vertices, unclamped */
    rqt_allocator allocator;
    uint32_t *strip; /* NULL unless the query asked: what rqt_strip_build makes of the triangles */
    size_t strip_count;
    size_t vertex_capacity, triangle_capacity, leaf_capacity, strip_capacity; /* elements there is room for */
} rqt_patch;

void rqt_patch_free(rqt_patch *patch);

typedef enum rqt_select { RQT_SELECT_THRESHOLD, RQT_SELECT_TOP_DOWN, RQT_SELECT_BOTTOM_UP } rqt_select;
typedef enum rqt_outline { RQT_OUTLINE_EXACT, RQT_OUTLINE_TOL } rqt_outline;

typedef struct rqt_answer { /* a block that answers the query and whose extent meets the region's box */
    rqt_block_number number;
    rqt_summary summary;
} rqt_answer;

/* What a patch is to hold beside its vertices. triangle_count is told in any case. */
typedef enum rqt_product { RQT_PRODUCT_TRIANGLES, RQT_PRODUCT_STRIP, RQT_PRODUCT_VERTICES } rqt_product;

/* Memory that one query leaves to the next, so that not every query has to ask for it and touch it anew. For one
 * thread. */
typedef struct rqt_scratch rqt_scratch;
rqt_status rqt_scratch_create(const rqt_allocator *allocator, rqt_scratch **scratch);
void rqt_scratch_free(rqt_scratch *scratch);
/* Instead of rqt_patch_free: the patch's memory goes to the next query. What is kept is at most `limit` bytes, the
 * rest is released. */
void rqt_scratch_keep(rqt_scratch *scratch, rqt_patch *patch, size_t limit);

typedef struct rqt_query {
    rqt_lattice lattice;
    int k;
    const rqt_region *region;
    rqt_code eps;
    const rqt_rule *rule; /* NULL: eps alone; else eps is not looked at */
    rqt_select select;
    rqt_outline outline;
    rqt_product product;
    bool wants_leaves;    /* fill patch->leaves; with RQT_PRODUCT_TRIANGLES only */
    rqt_scratch *scratch; /* NULL: none; made with the same allocator as the query is run with */
    rqt_answer *answers;  /* in any order; sorted into Morton order by the query */
    size_t answer_count;
    /* The decoded block of a number, valid until the next call. NULL: the query stops with RQT_READ_FAILED. */
    const rqt_block *(*read_block)(void *context, rqt_block_number number);
    bool (*is_interrupted)(void *context); /* may be NULL; asked once per block */
    void *context;
} rqt_query;

/* Does a block with this summary answer eps? */
bool rqt_summary_answers(const rqt_summary *summary, rqt_outline outline, rqt_code eps);
/* Does a block hold all that a rule selects in its cell? If not its four children are to be asked, those there are;
 * at stride 1 it always does. A block that does not answer the rule's own eps because em is above never does. */
bool rqt_rule_is_answered(const rqt_rule *rule, const rqt_block_place *place, const rqt_summary *summary,
                          rqt_outline outline);
/* The same of its parent, of which the summary knows em: a block answers iff it is answered and this is false.
 * False for the root. */
bool rqt_rule_is_answered_above(const rqt_rule *rule, const rqt_block_place *place, const rqt_summary *summary,
                                rqt_outline outline);
/* Does a block with this summary have selected vertices beside its corners, at this eps? */
bool rqt_summary_needs_block(const rqt_summary *summary, rqt_outline outline, rqt_code eps);
/* Does the query select this vertex, on account of its own error? */
bool rqt_query_selects(const rqt_query *query, rqt_vertex v, rqt_code error, uint8_t flags);
/* Does it select vertices of an answer beside its corners? If not the summary is enough. */
bool rqt_query_selects_inside(const rqt_query *query, const rqt_answer *answer);
/* Does this query need an answer's bytes? Not where the summary is enough, nor where the block only touches the
 * region. Queries that close their selection (rqt_select) look at all that summaries leave open. */
bool rqt_query_needs_block(const rqt_query *query, const rqt_answer *answer);
/* The patch of a query (mode `cover`): each kept leaf that belongs to the region, once. */
rqt_status rqt_query_run(rqt_query *query, const rqt_allocator *allocator, rqt_patch *patch);

/* The leaf that a point lies inside, without a patch. */
typedef enum rqt_found {
    RQT_FOUND_LEAF,    /* that one, and none else of the mesh */
    RQT_FOUND_NOTHING, /* the point is in no kept leaf */
    RQT_FOUND_UNSURE   /* on an edge, at the raster's end, or somewhere else: make the patch of the point */
} rqt_found;
typedef struct rqt_leaf_corner {
    int32_t col, row, q;
} rqt_leaf_corner;
/* x, y: the point in 2^-20 samples. answer: a block that answers the query (lattice, k, eps, select, outline are
 * read) and holds the point; block: its bytes, decoded, or NULL where rqt_summary_needs_block says no. leaf: the
 * corners as the patch of the point has them, in its order. */
rqt_found rqt_query_leaf_at(const rqt_query *query, const rqt_answer *answer, const rqt_block *block, int64_t x,
                            int64_t y, rqt_leaf_corner leaf[3]);

/* Where a mesh has triangles: cells of a grid in the raster's rectangle, which has an area. All is the caller's. */
typedef struct rqt_cells {
    /* Lines in 2^-20 samples, from 0 to the last sample: columns + 1, rows + 1 of them, each further than the one
     * before. */
    const int64_t *x, *y;
    int32_t columns, rows; /* 1 or more */
    uint8_t *marks;        /* of each cell, row by row: 1, a triangle has inner points in it; 0 to begin with */
} rqt_cells;
/* Has a cell that has inner points in the cell of a block, as far as there are samples, no mark yet? */
bool rqt_cells_lack(const rqt_cells *cells, const rqt_lattice *lattice, const rqt_block_place *place);
/* Marks all of those. */
void rqt_cells_fill(rqt_cells *cells, const rqt_lattice *lattice, const rqt_block_place *place);
/* Marks the cells in which the leaves of an answer have inner points. Of the query lattice, k, eps, rule, outline
 * are read; select is threshold. block: as for rqt_query_leaf_at, where rqt_query_selects_inside says so; one of
 * another k, or an answer that is no block of the lattice, marks nothing. When all answers that have points in
 * common with a cell have been asked, its mark is right. Exact. */
void rqt_query_mark(const rqt_query *query, const rqt_answer *answer, const rqt_block *block, rqt_cells *cells);

/* ----------------------------------------------------------------------------------------------- cut --
 * Mode `cut`: the patch clipped to the region. Its triangles tile what the region and the leaves of the patch have
 * in common; they have an area, turn counter-clockwise and share whole edges. Vertices on the region's border are
 * samples no longer, but places between samples, with heights on the leaf's plane: in quanta, not whole ones. */
typedef struct rqt_cut_vertex {
    double col, row; /* multiples of 2^(lattice.K - 52) sample: exact */
    double q;
    rqt_code error; /* as in the patch; 0 where the vertex is no sample of it: the mesh needs it for no height */
    int16_t level;  /* as in the patch; -1 there */
} rqt_cut_vertex;

typedef struct rqt_cut {
    rqt_cut_vertex *vertices; /* each once, in the order of the triangles */
    size_t vertex_count;
    uint32_t *triangles; /* as in rqt_patch */
    size_t triangle_count;
    rqt_allocator allocator;
    size_t vertex_capacity, triangle_capacity;
} rqt_cut;

/* patch: what a query has made of region, with triangles. Of members without an area (lines, points), whole leaves
 * stay. is_interrupted may be NULL. RQT_INTERRUPTED, RQT_NO_MEMORY, RQT_INVALID (for a region of squares): cut is
 * empty. */
rqt_status rqt_cut_make(const rqt_patch *patch, const rqt_region *region, const rqt_lattice *lattice,
                        const rqt_allocator *allocator, bool (*is_interrupted)(void *context), void *context,
                        rqt_cut *cut);
void rqt_cut_free(rqt_cut *cut);

/* One generalized strip of a patch: n indices; triangle i is (s[i], s[i+1], s[i+2]), its last two swapped for odd
 * i, counter-clockwise; a triangle with two equal vertices is a join. An empty patch gives n = 0.
 * Release with allocator->resize(context, strip, 0). */
rqt_status rqt_strip_build(const rqt_patch *patch, const rqt_allocator *allocator, uint32_t **strip, size_t *n);
/* The same as rqt_strip_build, by the walk of [RQT] section 7: round the centres of quadtree blocks. Needs
 * patch->leaves (RQT_INVALID without). */
rqt_status rqt_strip_build_fans(const rqt_patch *patch, const rqt_allocator *allocator, uint32_t **strip,
                                size_t *n);

/* ---------------------------------------------------------------------------------------- other metrics --
 * Other answers to the question "how wrong is a mesh without this vertex", for comparing, and the one that gives
 * the smallest meshes: METHODS.md beside this file has the definitions, the proofs, and what each costs. Every
 * triangle T of the bintree gets a number; a vertex gets the larger number of its diamond; saturation does the
 * rest, as for the exact errors, which are the metric `exact`. `minimal` alone is made otherwise: it is closed by
 * nature. */
typedef enum rqt_metric {
    RQT_METRIC_EXACT,   /* the largest vertical distance of a sample of T from T's plane: a bound */
    RQT_METRIC_MINIMAL, /* the least closed set no leaf of which has a larger one: a bound, and the smallest mesh */
    RQT_METRIC_LOCAL,   /* of the split vertex alone from the hypotenuse: no bound */
    RQT_METRIC_WEDGIE,  /* that, plus the larger number of the two halves: a bound, not a tight one */
    RQT_METRIC_EUCLID,  /* the largest distance of a sample of T from T's plane in space: no bound of heights */
    RQT_METRIC_PLANE    /* the mean distance of T's samples from the plane fitted to them: no bound */
} rqt_metric;
#define RQT_METRICS 6

/* "exact", "minimal" ...; NULL when there is none. */
const char *rqt_metric_name(rqt_metric metric);
/* Is the mesh of eps nowhere further than eps from a sample, vertically? */
bool rqt_metric_is_bound(rqt_metric metric);
/* The most bytes that rqt_metric_compute holds at a time, its result included. */
size_t rqt_metric_bytes(const rqt_lattice *lattice, rqt_metric metric);
/* The metric of every vertex, closed, and the outline bits, so that a threshold selects: for rqt_pyramid_create.
 * minimal depends on the outline, because a mixed triangle that has to go takes others along: with
 * RQT_OUTLINE_EXACT, codes of vertices that are in every mesh are RQT_CODE_LARGEST, with the bit. Codes are rounded
 * up: exactly, except for euclid, which may be one code further up where it is within 2^-40 of a code, wedgie,
 * whose parts at the raster's edge and at voids are rounded up to half a quantum each, and plane, which is computed
 * in doubles and 0 below 2^-40 of the terrain's relief. O(n log n) time. progress as in rqt_errors_compute. */
rqt_status rqt_metric_compute(const rqt_grid *grid, const rqt_unit *unit, const rqt_void_cost *cost,
                              rqt_metric metric, rqt_outline outline, const rqt_allocator *allocator,
                              bool (*progress)(void *context, double done), void *context, rqt_errors *closed);

/* ------------------------------------------------------------------------------------------ profiles --
 * The heights of a mesh along lines: between two rows the mesh is a plane. */
typedef struct rqt_profile_line {
    const double *xy;        /* points x,y, lines one after the other */
    const uint8_t *ends;     /* is the point the last of its line? */
    const uint8_t *own;      /* does the point get a row? Where a line only bends to follow a curve it does not */
    size_t points;           /* below 2^32 */
    rqt_placement placement; /* of the samples */
    double period;           /* 0, or: the lines count at each multiple of it, added to x, that meets the raster */
} rqt_profile_line;

typedef struct rqt_profile_row {
    uint32_t point;     /* on the piece of the line from this point to the next */
    int32_t turn;       /* of the period */
    double t;           /* where on the piece, 0 .. 1 */
    bool at_point;      /* it is the point */
    bool after_gap;     /* somewhere between the row before and this one there is no mesh, or the line was lifted */
    double col, row, q; /* place and height on the mesh, in samples and quanta, between integers */
} rqt_profile_row;

/* A row for every place where a line meets an edge of the patch's triangles in a point (a vertex counts once), for
 * both ends of what of an edge it runs along, and for its own points on the patch; in the order of the lines. Which
 * rows there are is decided exactly, with the lines' points rounded to 2^-20 sample as those of regions are; where
 * a line crosses an edge depends on the two alone. Release rows with allocator->resize(context, rows, 0). */
rqt_status rqt_profile_build(const rqt_patch *patch, const rqt_lattice *lattice, const rqt_profile_line *line,
                             const rqt_allocator *allocator, rqt_profile_row **rows, size_t *count);

/* --------------------------------------------------------------------------------------- mesh formats --
 * The formats of our own that stand alone (FORMAT.md, "Mesh"): 'strip' and 'indexed'. */
typedef enum rqt_mesh_kind { RQT_MESH_STRIP = 1, RQT_MESH_INDEXED = 2 } rqt_mesh_kind;

typedef struct rqt_mesh_header {
    rqt_mesh_kind kind;
    uint64_t vertex_count, index_count;
    rqt_placement placement;
    rqt_unit unit;
    double eps;
    int32_t srid;
} rqt_mesh_header;

#define RQT_MESH_HEADER_BYTES 128
/* Bytes of the encoded mesh: header, 12 per vertex, 4 per index. */
size_t rqt_mesh_bytes(const rqt_mesh_header *header);
/* indices: the strip's, or 3 per triangle. bytes has room for rqt_mesh_bytes(header). */
void rqt_mesh_encode(const rqt_mesh_header *header, const rqt_patch_vertex *vertices, const uint32_t *indices,
                     uint8_t *bytes);
/* Checks everything, indices included. vertices and indices point into bytes: int32 col,row,q and uint32. They
 * may be unaligned: copy before use. */
rqt_status rqt_mesh_decode(const uint8_t *bytes, size_t size, rqt_mesh_header *header, const uint8_t **vertices,
                           const uint8_t **indices);

/* ---------------------------------------------------------------------------------------------- wire --
 * A patch in about a byte a vertex, to send and to keep: topology as decisions of the walk, heights as residuals
 * (FORMAT.md, "Wire"). What is decoded is the patch of the query with leaves (wants_leaves: without, the same
 * vertices may be numbered otherwise): the same vertices and triangles in the same order; the errors of vertices
 * read 0 unless they were sent too (rqt_wire_add_errors). Mesh to memory in ten lines:
 *
 *   rqt_wire_header header;
 *   rqt_patch patch;
 *   rqt_message why;
 *   if (rqt_wire_decode(blob, blob_size, false, &allocator, &header, &patch, &why) != RQT_OK) complain(why.text);
 *   for (size_t i = 0; i < patch.vertex_count; i++) {
 *       const rqt_patch_vertex *v = &patch.vertices[i];
 *       put_vertex(header.placement.x0 + v->col * header.placement.dx, header.placement.y0 + v->row *
 *                  header.placement.dy, rqt_unit_metres(&header.unit, v->q));
 *   }
 *   put_indices(patch.triangles, 3 * patch.triangle_count); // counter-clockwise from above
 *   rqt_patch_free(&patch);
 *
 * An *increment* (rqt_delta) brings such a mesh from one eps to a smaller one: it holds the vertices with errors in
 * (eps, eps_from]. Whatever the steps, the mesh of an eps is the same, bit for bit. */
#define RQT_WIRE_HEADER_BYTES 144

typedef struct rqt_wire_header {
    bool is_delta;
    bool has_normals; /* rqt_wire_normals has something to give; never for an increment */
    bool has_errors;  /* those of the decoded vertices are the query's; never for an increment */
    rqt_lattice lattice;
    int k;                                 /* block size of the terrain: the order of the walk depends on it */
    uint64_t vertex_count, triangle_count; /* of the mesh; of an increment: of the mesh that it ends in */
    rqt_placement placement;
    rqt_unit unit;
    double eps;
    int32_t srid;
    double eps_from; /* of an increment; else 0 */
    uint64_t from;   /* of an increment: rqt_wire_digest of the mesh that it begins from; else 0 */
} rqt_wire_header;

/* The most bytes that rqt_wire_encode can write. */
size_t rqt_wire_bound(size_t vertex_count, size_t triangle_count, size_t block_count);
/* The patch of a query with leaves (mode `cover`) as bytes, which have room for rqt_wire_bound. numbers: the blocks
 * of the query's answers, as rqt_query_run has sorted them. state NULL: the whole mesh; else an increment from the
 * patch `state` (with leaves, same terrain and region, header->eps_from >= header->eps). The counts, is_delta and
 * from of the header are filled in. RQT_INVALID when patch is not what the walk over these blocks gives, or not
 * finer than state. Equal patches give equal bytes. */
rqt_status rqt_wire_encode(const rqt_wire_header *header, const rqt_block_number *numbers, size_t block_count,
                           const rqt_patch *patch, const rqt_patch *state, const rqt_allocator *allocator,
                           uint8_t *bytes, size_t *size);
/* Header only; the checksum of all bytes is compared. */
rqt_status rqt_wire_info(const uint8_t *bytes, size_t size, rqt_wire_header *header, rqt_message *message);
/* bytes -> patch, to be released with rqt_patch_free. wants_leaves: fill patch->leaves, which increments need.
 * Trusts nothing: any input gives RQT_OK, RQT_CORRUPT, RQT_INVALID for an increment, or RQT_NO_MEMORY; the memory
 * taken is bounded by the size of the payload, which is at most 2^15 times that of the bytes. */
rqt_status rqt_wire_decode(const uint8_t *bytes, size_t size, bool wants_leaves, const rqt_allocator *allocator,
                           rqt_wire_header *header, rqt_patch *patch, rqt_message *message);
/* The patch `state` (decoded with leaves, or the result of an apply) and its header, made finer by an increment.
 * The new patch has leaves. RQT_INVALID with a sentence for an increment that belongs to another mesh. */
rqt_status rqt_wire_apply(const rqt_wire_header *state_header, const rqt_patch *state, const uint8_t *bytes,
                          size_t size, const rqt_allocator *allocator, rqt_wire_header *header, rqt_patch *patch,
                          rqt_message *message);
/* Normals beside a mesh: unit vectors of the terrain at its vertices, x east, y north, z up, z > 0 but for
 * rounding; two bytes each. _pack: to the nearest of its 255 x 255 directions, 0.56 degrees off at worst, straight
 * up exactly; _unpack: a unit vector. */
void rqt_normal_pack(const float normal[3], int8_t packed[2]);
void rqt_normal_unpack(const int8_t packed[2], float normal[3]);
/* Appends them, 3 floats a vertex in the patch's order, to what rqt_wire_encode wrote; bytes has room for
 * rqt_wire_normals_bound more. RQT_INVALID for an increment, another number of vertices, or a mesh that has some,
 * or has errors, which come last. */
size_t rqt_wire_normals_bound(size_t vertex_count);
rqt_status rqt_wire_add_normals(const float *normals, size_t vertex_count, const rqt_allocator *allocator,
                                uint8_t *bytes, size_t *size);
/* The normals of a mesh that rqt_wire_decode has read, which has vertex_count vertices; normals has room for three
 * floats each. Trusts nothing, as rqt_wire_decode; RQT_INVALID when they are none, or of another number of
 * vertices. */
rqt_status rqt_wire_normals(const uint8_t *bytes, size_t size, size_t vertex_count, const rqt_allocator *allocator,
                            float *normals, rqt_message *message);
/* Appends the errors of the patch that rqt_wire_encode, and rqt_wire_add_normals if these are wanted, wrote: their
 * codes, which rqt_wire_decode puts back into its vertices, in a tenth to half a byte a vertex (FORMAT.md,
 * "Errors"). bytes has room for rqt_wire_errors_bound more. RQT_INVALID for an increment, another number of
 * vertices, or a mesh that has some. Equal patches give equal bytes. */
size_t rqt_wire_errors_bound(size_t vertex_count);
rqt_status rqt_wire_add_errors(const rqt_patch *patch, const rqt_allocator *allocator, uint8_t *bytes,
                               size_t *size);
/* What an increment knows a mesh by: its vertices, their levels and heights, and its leaves, in their order. */
uint64_t rqt_wire_digest(const rqt_patch *patch);

/* ------------------------------------------------------------------------------------------ geomorphs --
 * From one mesh of a terrain to another without a jump: over the mesh of the union of their vertices (the mesh of
 * the field with the lesser eps at each place), each vertex moves from its height on the one to that on the other.
 * At the time t, 0 .. 1, each sample is within (1-t) times what the one mesh allows and t times what the other
 * does, wherever both have a mesh; at the ends it is the one and the other, exactly, except near the raster's last
 * column and row where these are not the lattice's: there vertices do not move. See morph.c. */
#define RQT_NO_VERTEX UINT32_MAX

/* The heights, in quanta, of the vertices of a patch on the mesh `from` (with leaves), a patch of the same terrain:
 * exact, and NaN where `from` has no mesh. (NaN too where one depends on a vertex near the raster's end that is in
 * neither patch, which happens at the patch's rim.) ends, unless NULL: two per vertex, the indices of the ends of
 * the edge that it halves, RQT_NO_VERTEX for one that is not in the patch and for vertices near the raster's end.
 * RQT_INVALID when `from` has no leaves. */
rqt_status rqt_morph_heights(const rqt_lattice *lattice, const rqt_patch *from, const rqt_patch *patch,
                             const rqt_allocator *allocator, double *heights, uint32_t *ends);

/* --------------------------------------------------------------------------------------- increments --
 * What turns one mesh into another, for views that follow a camera (FORMAT.md, "View increment"): vertices and
 * triangles that go, and those that come. Both ends number a mesh in one way, so that neither has to know how the
 * other came by it: rqt_patch_sort. Of vertices only col, row and q count. */
#define RQT_INCREMENT_HEADER_BYTES 48

typedef struct rqt_increment_header {
    uint64_t from, to;                     /* rqt_increment_digest of the meshes that it begins from and ends in */
    uint64_t vertex_count, triangle_count; /* of the mesh that it ends in */
    bool is_unchanged;
    const void *note; /* bytes of the sender's own, which travel along */
    size_t note_size; /* below 2^31 */
    /* What makes places and metres of a mesh: told with an increment from nothing. */
    bool has_frame;
    rqt_placement placement;
    rqt_unit unit;
    double eps;
    int32_t srid;
} rqt_increment_header;

/* Vertices along the Morton curve (column in the even bits), triangles by the numbers of their vertices, first to
 * third; leaves go with their triangles; there is no strip. Samples are told apart by col and row. RQT_NO_MEMORY:
 * the patch is freed. */
rqt_status rqt_patch_sort(rqt_patch *patch);
/* What an increment knows a sorted mesh by: col, row and q of its vertices, its triangles. */
uint64_t rqt_increment_digest(const rqt_patch *sorted);
/* The most bytes that rqt_increment_encode can write. old NULL: from nothing. */
size_t rqt_increment_bound(const rqt_patch *old, const rqt_patch *fresh, size_t note_size);
/* Both sorted. Of the header note, placement, unit, eps and srid are read. Equal meshes give equal bytes. old ==
 * fresh: that nothing changes, in RQT_INCREMENT_HEADER_BYTES and the note; without a frame. RQT_INVALID for more
 * than 2^32 bytes. */
rqt_status rqt_increment_encode(const rqt_increment_header *header, const rqt_patch *old, const rqt_patch *fresh,
                                const rqt_allocator *allocator, uint8_t *bytes, size_t *size);
/* Header only; the checksum of all bytes is compared. header->note points into bytes. */
rqt_status rqt_increment_info(const uint8_t *bytes, size_t size, rqt_increment_header *header,
                              rqt_message *message);
/* The mesh that an increment makes of `old` (sorted; NULL: nothing), sorted: the sender's vertices and triangles,
 * with errors and levels 0. Trusts nothing: any input gives RQT_OK, RQT_CORRUPT, RQT_INVALID for an increment from
 * another mesh, or RQT_NO_MEMORY; the memory taken is bounded by old and by the size of the payload, at most 2^15
 * times that of the bytes. */
rqt_status rqt_increment_apply(const rqt_patch *old, const uint8_t *bytes, size_t size,
                               const rqt_allocator *allocator, rqt_increment_header *header, rqt_patch *mesh,
                               rqt_message *message);

#ifdef __cplusplus
}
#endif

#include "rqt_view.h"

#endif
