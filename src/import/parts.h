/* parts.h - what the files of the import share: how they refuse, how they tell, and the path that samples take.
 *
 *   sources.c   what the user named -> rasters: a file, a folder of them, a list
 *   source.c    one GDAL source, described: type, place, CRS, what is void            (crs.c, units.c help)
 *   mosaic.c    all sources on one grid, and the kind of number that holds them all
 *   cover.c     gaps that no source covers, sources that overlap                      (conflict.c: that disagree)
 *   report.c    all of that as sentences, and as a GeoJSON file
 *   plan.c      how much memory for what: one reading of the sources or two, the size of tiles, the buffers
 *   read.c      GDAL windows -> values + validity of some rows of the grid
 *   spool.c     the resume file: strips that were read, for the second reading and for another run (spool_codec.c)
 *   reader.c    a thread that reads ahead, strip by strip, from north to south
 *   survey.c    a look at all values: extremes, and which steps of height would hold them exactly
 *   quantise.c  that look -> rqt_unit; values -> int32 heights q
 *   fill.c      small voids filled, the sea put in, both noted down
 *   pool.c      threads that share the items of a task
 *   stream.c    heights -> saturated errors -> blocks, band by band               (core: rqt_sweep, rqt_build)
 *   stage.c     encoded blocks wait for their turn, in memory or on a scratch file (scratch.c)
 *   write.c     all of them into the store, in ascending order of number
 *   database.c  the SQLite file: opened, refused, committed or left as it was
 *   import.c    the whole
 *   update.c    another way through source.c to quantise.c: sources into a terrain that is there
 *
 * Only sources.c, source.c, crs.c and read.c know GDAL; database.c and write.c only know SQLite and the store.
 */
#ifndef RQT_IMPORT_PARTS_H
#define RQT_IMPORT_PARTS_H

#include "import.h"

/* What every part is handed: the wishes of the caller and the place for the sentence of a failure. */
typedef struct import_job {
    const import_options *options;
    const char *database; /* path */
    char *message;
    size_t message_size;
} import_job;

/* Put the sentence of a failure down; always false, so that a part can `return import_refuse(...)`. */
bool import_refuse(const import_job *job, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* The same for "out of memory while ..." */
bool import_no_memory(const import_job *job, const char *what);
/* Tell the caller something that does not stop the import. */
void import_notice(const import_job *job, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* Report progress; false (with the sentence) when the caller wants to stop. */
bool import_progress(const import_job *job, const char *stage, double done, int64_t samples);

/* malloc as the core's memory: SQLite's, which the store uses, stops at 2 GiB. */
const rqt_allocator *import_allocator(void);

/* ------------------------------------------------------------------------------------------------ units.c --
 * A unit of height in metres is plain * numerator / denominator: a named unit has plain 1, a number 1/1. */
typedef struct import_unit {
    double plain;
    int32_t numerator, denominator;
} import_unit;

/* The unit of this name ("" and NULL are the metre). False when it is neither a known name nor a number; the unit
 * is then the metre. */
bool import_unit_parse(const char *text, import_unit *unit);
/* The named unit of that many metres, within what a file's rounding may have done to it, else a plain number. */
import_unit import_unit_of_metres(double metres);

/* ------------------------------------------------------------------------------------------ rows of samples --
 * Values before they are quantised, in the narrowest number that holds those of every source. */
typedef enum import_kind { IMPORT_I32, IMPORT_I64, IMPORT_F32, IMPORT_F64 } import_kind;
size_t import_kind_bytes(import_kind kind);

/* Some rows of the grid, or all of them. */
typedef struct import_strip {
    import_kind kind;
    int32_t width;
    int32_t first_row, rows;
    void *values;   /* rows * width of the kind, row by row; anything where void */
    uint8_t *valid; /* rows * width, 0 or 1 */
} import_strip;

typedef struct import_counts {
    int64_t voids, overlap, overlap_differs;
    int64_t samples; /* asked of the sources; where they overlap, of each */
    int64_t resumed; /* the same, that an earlier run has asked for */
} import_counts;

/* -------------------------------------------------------------------------------------------- conflict.c --
 * Two sources that disagree where both have data. Order of the sources: a < b. */
typedef struct import_conflict {
    int32_t a, b;
    int64_t differ;      /* samples */
    double largest;      /* difference, in the unit of the values */
    int32_t column, row; /* the first place, in the order of rows, with the largest */
    int32_t first_column, first_row;
} import_conflict;

typedef struct import_conflicts {
    import_conflict *pair; /* each pair once; in no order that means anything */
    size_t count, last;
    uint32_t *slot; /* hash of the pairs, 1 + index */
    size_t slots;
} import_conflicts;

bool import_conflicts_add(import_conflicts *conflicts, const import_conflict *one); /* false: out of memory */
void import_conflicts_clear(import_conflicts *conflicts);
void import_conflicts_free(import_conflicts *conflicts);

/* n values of a strip, from index `at` on, as doubles. Exact but for I64 beyond 2^53. survey.c */
void import_strip_doubles(const import_strip *strip, size_t at, size_t n, double *out);

/* ------------------------------------------------------------------------------------------------ pool.c -- */
typedef struct import_pool import_pool;
/* One item of a task, 0 .. n-1, on thread `worker`, 0 .. jobs-1. */
typedef void import_task(void *context, int worker, int32_t item);

bool import_pool_create(const import_job *job, import_pool **pool); /* options->jobs threads */
void import_pool_free(import_pool *pool);
int import_pool_workers(const import_pool *pool);
/* All n items, in any order. */
void import_pool_run(import_pool *pool, import_task *task, void *context, int32_t n);

/* ------------------------------------------------------------------------------------------------ survey.c --
 * What the valid values are like: extremes, how often they occur, and the next value inwards. */
typedef struct import_survey {
    int64_t count; /* valid samples */
    double min, max;
    int64_t min_count, max_count;
    double next_min, next_max; /* smallest value above min, largest below max; NaN when there is one value only */
} import_survey;

/* Does the extreme look like the mark of a void that nobody declared? */
bool import_survey_min_is_suspicious(const import_survey *survey);
bool import_survey_max_is_suspicious(const import_survey *survey);

/* How values are counted: q = round((v / scale - z0) * d). */
typedef struct import_steps {
    int64_t z0;
    int32_t d;
    double scale;
} import_steps;

/* The height of a value: to the nearest whole number, halves to even, as lrint does. Right below 2^51, which
 * whoever chooses the steps sees to. Written so that it vectorises. */
static inline double import_height(const import_steps *s, double v) {
    const double large = 6755399441055744.0; /* 1.5 * 2^52 */
    return ((v / s->scale - (double)s->z0) * s->d + large) - large;
}

/* Steps that may be chosen, put to every sample. */
typedef struct import_trial {
    import_steps steps;
    bool possible; /* no value is out of range */
    bool exact;    /* every sample comes back from its height */
    bool wants_rounding, knows_rounding;
    double rounding; /* the largest distance of a sample from its height */
} import_trial;

#define IMPORT_TRIALS 5

/* A look at all samples. Some looks at parts of them, merged in any order, are the same as one look at all. */
typedef struct import_look {
    import_survey survey;
    bool wants_survey;
    bool single; /* a value counts as met when it is equal as a float (32 bits), not as a double */
    int trials;
    import_trial trial[IMPORT_TRIALS]; /* from coarse to fine; the first exact one is taken, else the last */
} import_look;

/* Rows of a strip, 0 .. strip->rows. row: room for a row of doubles. */
void import_look_rows(import_look *look, const import_strip *strip, int32_t first, int32_t rows, double *row);
/* A look that has seen nothing yet, with the questions of this one. */
import_look import_look_empty(const import_look *look);
void import_look_merge(import_look *into, const import_look *from);

/* ---------------------------------------------------------------------------------------------- quantise.c -- */
typedef struct import_heights {
    import_steps steps;
    rqt_unit unit;
    double quantum_error;
    int32_t min_q, max_q;
} import_heights;

/* How values become heights. Integers stay what they are: unit says what one is worth. Others are metres already,
 * and are rounded to a quantum. */
typedef struct import_scheme {
    rqt_unit unit;  /* of integer kinds: scale, numerator, denominator, offset; the rest is chosen */
    bool single;    /* see import_look */
    double quantum; /* metres, 0: chosen */
} import_scheme;

/* What to look for in a first look. */
import_look import_look_begin(import_kind kind, const import_scheme *scheme);

typedef enum import_decision {
    IMPORT_REFUSED, /* the sentence is there */
    IMPORT_DECIDED,
    IMPORT_LOOK_AGAIN /* the look is set up for what another one must find out */
} import_decision;

import_decision import_decide(const import_job *job, import_kind kind, const import_scheme *scheme,
                              import_look *look, import_heights *heights);
/* Heights of n samples of a strip from index `at` on, 0 where void. values: room for n doubles. */
void import_quantise(const import_strip *strip, size_t at, size_t n, const import_steps *steps, double *values,
                     int32_t *q);

/* ----------------------------------------------------------------------------------------------- scratch.c --
 * Bytes at offsets: up to `memory` of them in memory, the others in a file without a name beside the database. */
typedef struct import_scratch import_scratch;

bool import_scratch_create(const import_job *job, uint64_t memory, import_scratch **scratch);
void import_scratch_free(import_scratch *scratch);
/* Thread-safe for ranges that do not overlap. false: import_scratch_failure knows why. */
bool import_scratch_write(import_scratch *scratch, uint64_t offset, const void *bytes, size_t size);
bool import_scratch_read(import_scratch *scratch, uint64_t offset, void *bytes, size_t size);
/* The sentence; always false. */
bool import_scratch_refuse(const import_job *job, const import_scratch *scratch);

/* ------------------------------------------------------------------------------------------------- stage.c --
 * Encoded blocks, put down in any order by any thread, taken by number. */
typedef struct import_stage import_stage;

bool import_stage_create(const import_job *job, const rqt_lattice *lattice, int k, uint64_t memory,
                         import_stage **stage);
void import_stage_free(import_stage *stage);
size_t import_stage_bytes(const rqt_lattice *lattice, int k); /* of memory, beside that of its scratch */
bool import_stage_put(import_stage *stage, rqt_block_number number, const rqt_summary *summary,
                      const uint8_t *bytes, size_t size);
/* bytes has room for rqt_block_bound(k). */
bool import_stage_take(import_stage *stage, rqt_block_number number, rqt_summary *summary, uint8_t *bytes,
                       size_t *size);
import_scratch *import_stage_scratch(import_stage *stage);

/* -------------------------------------------------------------------------------------------------- plan.c --
 * Bytes for everything, within options->memory. */
typedef struct import_plan {
    bool in_memory; /* all values are kept */
    bool spools;    /* what is read goes into a resume file; so it does when it is not kept */
    int b;          /* tiles of 2^b */
    int32_t strip_rows;
    int strips; /* of the reader's ring, when not in memory */
    int64_t gdal_cache, page_cache;
    uint64_t stage, kept, fill; /* memory of the scratches: of blocks, of the build's lattice, of what was filled */
} import_plan;

/* For tests: what the plan would otherwise choose. 0, or -1 for `stage` and `kept`: chosen. */
typedef struct import_force {
    bool in_memory, two_readings;
    int b, strip_rows, strips;
    int64_t stage, kept;
} import_force;

struct import_source;
struct import_mosaic;
#define IMPORT_PROCESS_BYTES ((int64_t)58 << 20) /* measured: code, GDAL with its drivers, PROJ, SQLite */
/* spools: in any case. */
bool import_plan_make(const import_job *job, const struct import_source *sources, int count,
                      const struct import_mosaic *mosaic, int k, bool spools, const import_force *force,
                      import_plan *plan);

int import_run_forced(const char *const *sources, int count, const char *database, const import_options *options,
                      const import_force *force, import_report *report, char *message, size_t message_size);

/* ------------------------------------------------------------------------------------------------- spool.c -- */
typedef struct import_spool import_spool;

/* What a resume file is of: where each source is on the grid, and what it is. */
typedef struct import_spool_key {
    uint64_t place;   /* of what must be alike: name, place, type */
    uint64_t content; /* of size and time of its files */
    int32_t row, zero;
} import_spool_key;

typedef struct import_spool_grid {
    import_kind kind;
    int32_t width, height, strip_rows, sources;
    uint64_t options; /* of those that change values */
} import_spool_grid;

/* A hash that goes on: 0 begins. */
uint64_t import_mix(uint64_t hash, const void *bytes, size_t size);
/* DATABASE.TERRAIN.rqt-import; free(). NULL: out of memory. */
char *import_spool_path(const char *database, const char *terrain);
/* Take up the file where it is of these sources, else begin anew; says which, when there was a file. Refuses one
 * that is not ours or that another import uses. */
bool import_spool_open(const import_job *job, const char *path, const import_spool_grid *grid,
                       const import_spool_key *keys, import_spool **spool);
int32_t import_spool_strips(const import_spool *spool); /* that it has */
int32_t import_spool_found(const import_spool *spool);  /* of them, from an earlier run */
uint64_t import_spool_bytes(const import_spool *spool);
/* Strip n with its values, counts and conflicts (NULL: not wanted). False: it is not sound; it and all behind it
 * are forgotten. */
bool import_spool_read(import_spool *spool, int32_t n, import_strip *strip, import_counts *counts,
                       import_conflicts *conflicts);
/* The strip after the last one. */
bool import_spool_append(const import_job *job, import_spool *spool, const import_strip *strip,
                         const import_counts *counts, const import_conflicts *conflicts);
/* keep: the file stays, for another run, if there is anything in it. Did it? */
bool import_spool_close(import_spool *spool, bool keep);

/* ------------------------------------------------------------------------------------------------ reader.c --
 * The rows of the grid from north to south, as often as they are wanted. */
typedef struct import_reader import_reader;

typedef struct import_reader_options {
    const struct import_source *sources;
    int count;
    const struct import_mosaic *mosaic;
    import_strip *all; /* everything goes here and stays; or NULL: */
    int strips;        /* so many at a time */
    int32_t strip_rows;
    import_spool *spool;         /* strips that it has come from there, the others go there; or NULL */
    import_conflicts *conflicts; /* to be added to; or NULL */
} import_reader_options;

bool import_reader_start(const import_job *job, const import_reader_options *options, import_reader **reader);
/* The strip that begins with the row after the one before; NULL when it cannot be read (the sentence is there).
 * At the end it is an error to ask. */
const import_strip *import_reader_next(import_reader *reader);
/* The strip is no longer needed. */
void import_reader_release(import_reader *reader);
void import_reader_extent(const import_reader *reader, int32_t *width, int32_t *height);
import_counts import_reader_counts(const import_reader *reader); /* after the last strip */
void import_reader_free(import_reader *reader);

/* -------------------------------------------------------------------------------------------------- fill.c --
 * Voids that the user wants to be heights: see there. Rows go in from north to south; what was filled comes out in
 * the same order, as often as wanted. */
typedef struct import_fill import_fill;

typedef struct import_fill_options {
    int32_t width, height;
    int radius; /* of voids that are filled, 0: none */
    bool sea;   /* every void that is left becomes sea_q */
    int32_t sea_q;
    uint64_t memory; /* of what is noted down; the rest is in a scratch file */
} import_fill_options;

size_t import_fill_bytes(int32_t width, int radius); /* of memory, beside options->memory */
bool import_fill_create(const import_job *job, const import_fill_options *options, import_fill **fill);
void import_fill_free(import_fill *fill);
/* The next row. */
bool import_fill_row(const import_job *job, import_fill *fill, const int32_t *q, const uint8_t *valid);
bool import_fill_end(const import_job *job, import_fill *fill); /* after the last one */
int64_t import_fill_filled(const import_fill *fill);            /* samples */
int64_t import_fill_sea(const import_fill *fill);

/* What is noted down, read again. */
typedef struct import_fill_run {
    int32_t row, first, last;
    bool sea;
    const int32_t *q; /* of each sample; of the sea NULL. Valid until the next call */
} import_fill_run;
typedef struct import_fill_reader import_fill_reader;
bool import_fill_reader_create(const import_job *job, import_fill *fill, import_fill_reader **reader);
void import_fill_reader_free(import_fill_reader *reader);
/* false: the end, or it cannot be read: then *failed. */
bool import_fill_next(const import_job *job, import_fill_reader *reader, import_fill_run *run, bool *failed);
/* Put what was filled of this row into it; valid may be NULL. Rows come in ascending order. */
bool import_fill_apply(const import_job *job, import_fill_reader *reader, int32_t row, int32_t *q, uint8_t *valid);

/* ------------------------------------------------------------------------------------------------ coarse.c --
 * What the first reading keeps for the second: every 2^b-th value of every 2^b-th row, and the last ones. */
typedef struct import_coarse {
    int b;
    int32_t width, height, columns, rows;
    import_strip kept; /* columns * rows */
} import_coarse;

size_t import_coarse_bytes(const rqt_lattice *lattice, import_kind kind, int b);
bool import_coarse_create(const import_job *job, const rqt_lattice *lattice, import_kind kind, int b,
                          import_coarse *coarse);
void import_coarse_free(import_coarse *coarse);
void import_coarse_keep(import_coarse *coarse, const import_strip *strip);
/* All of it into the sweep. */
bool import_coarse_give(const import_job *job, const import_coarse *coarse, const import_steps *steps,
                        bool has_voids, import_fill *fill, rqt_sweep *sweep);

/* -------------------------------------------------------------------------------------------------- pass.c -- */
typedef struct import_pass {
    import_pool *pool;
    const import_strip *all; /* all values, when they are in memory already; else NULL: */
    import_reader *reader;
    bool keep;             /* do not give the reader's strips back */
    import_coarse *coarse; /* to be filled from the reader's strips; may be NULL */
} import_pass;

/* One look at all samples by all threads; asks and answers as `look` says. */
bool import_look_at_all(const import_job *job, const import_pass *pass, import_look *look);

/* ------------------------------------------------------------------------------------------------ stream.c -- */
typedef struct import_stream {
    rqt_lattice lattice;
    rqt_void_cost cost;
    int k;
    const import_plan *plan;
    const import_heights *heights;
    bool has_voids;    /* that are left when all is filled that is to be */
    import_fill *fill; /* NULL: nothing is filled */
    import_pool *pool;
    const import_coarse *coarse;
    const import_strip *all; /* the values; NULL: they come from the reader */
    import_reader *reader;
    /* what comes of it */
    rqt_sweep *sweep;
    rqt_build *build;
    import_stage *stage;
    import_scratch *kept;
} import_stream;

/* Errors and blocks of the whole. Fill in the upper part; the lower is import_stream_free's. */
bool import_stream_run(const import_job *job, import_stream *stream);
/* Bytes of memory that one thread takes for itself. */
size_t import_stream_thread_bytes(int k);
void import_stream_free(import_stream *stream);

/* ------------------------------------------------------------------------------------------------- write.c -- */
/* Every block of the stream into the store, in ascending order of number. Adds to report->blocks and ->bytes. */
bool import_write(const import_job *job, const import_stream *stream, store_writer *writer, import_report *report);

/* ---------------------------------------------------------------------------------------------- database.c -- */
typedef struct import_database {
    sqlite3 *db;
    bool created;  /* the file is ours: it goes when the import fails */
    bool made_wal; /* it was not WAL before */
} import_database;

/* Everything that can be refused without the samples: not SQLite, read-only, locked, the terrain exists. Leaves no
 * trace. */
bool import_database_probe(const import_job *job, const char *terrain);
/* Open, create if needed, and begin the transaction. page_cache: the most bytes that SQLite keeps of the database.
 */
bool import_database_begin(const import_job *job, int k, int64_t page_cache, import_database *database);
/* Open one that is there, for changes to it: journal and pages stay as they are. Begins the transaction. */
bool import_database_change(const import_job *job, import_database *database);
bool import_database_commit(const import_job *job, import_database *database);
/* Close. Without a commit before, the database is as it was, and a file that we created is gone. */
void import_database_close(const import_job *job, import_database *database);
/* The sentence for an SQLite failure; takes over detail (sqlite3_free), which may be NULL. False. */
bool import_database_refuse(const import_job *job, int code, char *detail);

#endif
