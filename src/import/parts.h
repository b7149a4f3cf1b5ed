/* parts.h - what the files of the import share: how they refuse, how they tell, and the path that samples take.
 *
 *   source.c    one GDAL source, described: type, place, CRS, what is void            (crs.c, units.c help)
 *   mosaic.c    all sources on one grid, and the kind of number that holds them all
 *   read.c      GDAL windows -> values + validity of the whole grid
 *   quantise.c  values -> int32 heights q and the rqt_unit that makes metres of them  (survey.c looks at them
 * first) blocks.c    q + saturated errors -> encoded blocks, by threads, written in order database.c  the SQLite
 * file: opened, refused, committed or left as it was import.c    the whole
 *
 * Only source.c, crs.c and read.c know GDAL; database.c and blocks.c only know SQLite and the store.
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

/* --------------------------------------------------------------------------------- samples of the whole grid --
 * Values before they are quantised, in the narrowest number that holds those of every source. */
typedef enum import_kind { IMPORT_I32, IMPORT_I64, IMPORT_F32, IMPORT_F64 } import_kind;
size_t import_kind_bytes(import_kind kind);

typedef struct import_samples {
    import_kind kind;
    int32_t width, height;
    void *values;   /* width * height of the kind, row by row */
    uint8_t *valid; /* width * height, 0 or 1 */
    int64_t voids;
    int64_t overlap, overlap_differs;
} import_samples;

void import_samples_free(import_samples *samples);
/* Value n as a double. Exact but for I64 beyond 2^53. */
static inline double import_samples_at(const import_samples *samples, size_t n) {
    switch (samples->kind) {
    case IMPORT_I32:
        return ((const int32_t *)samples->values)[n];
    case IMPORT_I64:
        return (double)((const int64_t *)samples->values)[n];
    case IMPORT_F32:
        return (double)((const float *)samples->values)[n];
    case IMPORT_F64:
        break;
    }
    return ((const double *)samples->values)[n];
}

/* ------------------------------------------------------------------------------------------------ survey.c --
 * What the valid values are like: extremes, how often they occur, and the next value inwards. */
typedef struct import_survey {
    int64_t count; /* valid samples */
    double min, max;
    int64_t min_count, max_count;
    double next_min, next_max; /* smallest value above min, largest below max; NaN when there is one value only */
} import_survey;

void import_survey_take(const import_samples *samples, import_survey *survey);
/* Does the extreme look like the mark of a void that nobody declared? */
bool import_survey_min_is_suspicious(const import_survey *survey);
bool import_survey_max_is_suspicious(const import_survey *survey);

/* ---------------------------------------------------------------------------------------------- quantise.c -- */
typedef struct import_heights {
    int32_t *q;     /* the memory of samples->values, which they took over */
    uint8_t *valid; /* NULL when every sample is valid */
    rqt_unit unit;
    double quantum_error;
    int32_t min_q, max_q;
} import_heights;

/* How values become heights. Integers stay what they are: unit says what one is worth. Others are metres already,
 * and are rounded to a quantum. */
typedef struct import_scheme {
    rqt_unit unit;  /* of integer kinds: scale, numerator, denominator, offset; the rest is chosen */
    bool single;    /* a value counts as met when it is equal as a float (32 bits), not as a double */
    double quantum; /* metres, 0: chosen */
} import_scheme;

/* samples is empty afterwards, whatever the result. */
bool import_quantise(const import_job *job, import_samples *samples, const import_survey *survey,
                     const import_scheme *scheme, import_heights *heights);

/* ------------------------------------------------------------------------------------------------ blocks.c -- */
/* Encode every block of the pyramid with options->jobs threads and write them in ascending order of number.
 * quantum: metres of one quantum. Adds to report->blocks and ->bytes. */
bool import_blocks(const import_job *job, const rqt_pyramid *pyramid, int k, double quantum, store_writer *writer,
                   int64_t samples, import_report *report);
/* Bytes of memory that it takes for itself. */
size_t import_blocks_bytes(int k, int jobs);

/* ---------------------------------------------------------------------------------------------- database.c -- */
#define IMPORT_PAGE_CACHE_BYTES (32 << 20) /* the most that SQLite keeps of the database */

typedef struct import_database {
    sqlite3 *db;
    bool created;  /* the file is ours: it goes when the import fails */
    bool made_wal; /* it was not WAL before */
} import_database;

/* Everything that can be refused without the samples: not SQLite, read-only, locked, the terrain exists. Leaves no
 * trace. */
bool import_database_probe(const import_job *job, const char *terrain);
/* Open, create if needed, and begin the transaction. */
bool import_database_begin(const import_job *job, int k, import_database *database);
bool import_database_commit(const import_job *job, import_database *database);
/* Close. Without a commit before, the database is as it was, and a file that we created is gone. */
void import_database_close(const import_job *job, import_database *database);
/* The sentence for an SQLite failure; takes over detail (sqlite3_free), which may be NULL. False. */
bool import_database_refuse(const import_job *job, int code, char *detail);

#endif
