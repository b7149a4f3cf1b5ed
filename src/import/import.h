/* import.h - GDAL raster -> terrain. The only room that knows GDAL; nothing of GDAL is in this header. */
#ifndef RQT_IMPORT_H
#define RQT_IMPORT_H

#include "store.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct import_options {
    const char *name; /* NULL: from the first source's file name, up to its first dot, other characters become _ */
    int k;            /* block size: 2^k + 1 samples a side; 1..8 */
    bool has_nodata;
    double nodata;    /* --nodata, beside what the bands declare */
    const char *unit; /* NULL: the band's; m, ft, us-ft or a number of metres */
    double quantum;   /* --quantum: height step in the source's unit for float bands, 0: chosen */
    double void_tol;  /* c of the outline, > 0 */
    int jobs;         /* threads that work on the samples; another one reads */
    int64_t memory;   /* bytes that the import may take */
    bool replace;
    bool minimal; /* store minimal errors, too */
    int fill;     /* voids within a square of 2 * fill + 1 samples become heights; 0: none */
    bool has_sea;
    double sea;         /* metres that every void which is left gets */
    bool resumable;     /* a resume file even where all fits in memory */
    const char *report; /* a GeoJSON file of gaps, overlaps and conflicts; NULL: none */
    /* Progress: share 0..1 of one stage ("reading", "errors" - and blocks made of them -, "blocks" written,
     * "minimal errors"); samples of the whole. NULL: silent. False stops the import, which leaves the database as
     * it was. */
    bool (*progress)(void *context, const char *stage, double done, int64_t samples);
    /* A sentence for the user: what was noticed and done (overlaps that differ, suspicious extremes ...). NULL:
     * none. */
    void (*notice)(void *context, const char *sentence);
    void *context;
} import_options;

void import_options_init(import_options *options); /* the defaults */

typedef struct import_report {
    char name[64];
    int64_t samples, voids, blocks, bytes;
    int64_t sources;                  /* rasters */
    int64_t overlap, overlap_differs; /* samples that more than one source has, and those where they disagree */
    int64_t filled, sea;              /* voids that became heights: not among the voids */
    int64_t samples_read;             /* from the sources, by this run; where they overlap, from each */
    int64_t samples_resumed;          /* read from them by an earlier run, and now from its resume file */
    int64_t spooled;                  /* bytes of the resume file when all was read, 0: none was needed */
    double seconds_read;              /* the first reading */
    double seconds_errors;            /* errors and blocks, with the second reading where there is one */
    double seconds_blocks;            /* writing them */
} import_report;

#define IMPORT_MOST_FILL 255

/* Import the sources (one grid, one terrain) into the database file, which is created as a GeoPackage when it does
 * not exist or is empty. A source is a raster, a folder of rasters, or @FILE, a list of them, one a line. Returns
 * 0, or 1 with a sentence in message: the database is then as it was (a file that the import created is gone). When
 * what was read so far is in a resume file, the sentence says so, and the same import goes on from there. */
int import_run(const char *const *sources, int count, const char *database, const import_options *options,
               import_report *report, char *message, size_t message_size);

typedef struct import_update_report {
    char name[64];                       /* of the terrain */
    int64_t samples;                     /* of the sources that were put in: heights, and voids where they count */
    int64_t left_out;                    /* samples with data outside the terrain */
    int64_t changed;                     /* samples of the terrain that are others now */
    int64_t blocks, summaries, bytes;    /* rows written: with their blocks, their summary alone; bytes */
    int64_t blocks_read, bytes_read;     /* to find out */
    int64_t measured, cells;             /* samples and summaries that errors were found by */
    bool minimal;                        /* minimal errors were computed anew */
    double seconds_read, seconds_update; /* the sources; the terrain */
} import_update_report;

/* Put sources (rasters, folders and lists, as for an import; those of folders in the order of their paths) into a
 * terrain of a database file, one after the other, in one transaction: each must lie on the terrain's grid and in
 * its CRS, and meet it unless a folder holds it, and its heights must be ones that the terrain's unit can hold. Of
 * the options count name (the terrain; NULL: the only one), nodata, unit, progress ("reading", "updating", "minimal
 * errors") and notice. voids: void samples of a source make voids, too; else the terrain keeps what it has there.
 * Returns 0, or 1 with a sentence in message: the database is then as it was. */
int import_update(const char *const *sources, int count, const char *database, const import_options *options,
                  bool voids, import_update_report *report, char *message, size_t message_size);

/* GDAL's version, as text. */
const char *import_gdal_version(void);

#ifdef __cplusplus
}
#endif
#endif
