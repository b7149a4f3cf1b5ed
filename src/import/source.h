/* source.h - one raster, described. Opened again for reading, so that a thousand tiles need no thousand open files.
 */
#ifndef RQT_IMPORT_SOURCE_H
#define RQT_IMPORT_SOURCE_H

#include "parts.h"

#include <gdal.h>
#include <ogr_srs_api.h>

typedef struct import_source {
    const char *path; /* as the user gave it */
    char *opened;     /* as GDAL opens it: path, or the member of an archive */
    char *base;       /* file name without directories: what is stored of where the samples came from */
    GDALDataType type;
    bool is_float, is_single; /* single: every value is exact in 32-bit floating point */
    bool is_wide;             /* an integer that int32 does not hold */
    bool is_signed_byte;      /* GDAL before 3.7 calls int8 Byte, with a note */
    int32_t width, height;
    int32_t block_rows, block_columns; /* what GDAL decodes at once */
    bool placed;                       /* has a geotransform */
    bool flip_rows, flip_columns;      /* file order to north-first, west-first */
    rqt_placement placement;           /* of the north-west sample; dx > 0, dy < 0 */
    OGRSpatialReferenceH crs;          /* NULL: none */
    double scale, offset;              /* of the band */
    import_unit unit;
    bool has_nodata;
    double nodata;
    int64_t nodata_integer; /* the same for integer bands */
    bool has_mask;          /* a mask band beside nodata */
    uint64_t content;       /* a hash of size and time of its files: has it changed? */
} import_source;

bool import_source_describe(const import_job *job, const char *path, import_source *source);
void import_source_free(import_source *source);
/* Thousands of tiles have one CRS: keep it once. */
void import_source_share_crs(import_source *source, const import_source *other);
/* Metres of a raw value: raw * factor + offset, as rqt_unit_metres has it for z0 = 0, d = 1. */
rqt_unit import_source_unit(const import_source *source);

/* ------------------------------------------------------------------------------------------------ sources.c --
 * The rasters behind what the user named. */
typedef struct import_path {
    char *path;
    int32_t argument; /* the name that it comes from */
    int32_t line;     /* of the list that it stands in; 0: none */
    bool found;       /* in a folder: it was not named, so what is no terrain is passed over */
    bool passed;      /* and it was */
} import_path;
typedef struct import_paths {
    const char *const *argument;
    int arguments;
    import_path *path;
    int count;
    size_t room;
    int64_t passed; /* files in folders that are no rasters */
} import_paths;

bool import_paths_find(const import_job *job, const char *const *arguments, int count, import_paths *paths);
/* Describes path n. False when it is passed over (its `passed` says so, and a notice has told why), or is refused:
 * then the sentence stands, with the line of the list before it. */
bool import_paths_describe(const import_job *job, const import_paths *paths, int n, import_source *source);
/* Where path n stands in a list, its line goes before the sentence that stands. */
void import_paths_place_sentence(const import_job *job, const import_paths *paths, int n);
/* A notice of the files that are no rasters. */
void import_paths_tell_passed(const import_job *job, const import_paths *paths);
void import_paths_free(import_paths *paths);
bool import_is_folder(const char *path);
/* Of two names that are not there yet, too: are they one place? */
bool import_is_same_file(const char *a, const char *b);
/* The last part of a path, without slashes at its end: for the terrain's name. free(). NULL: out of memory */
char *import_base_of(const char *argument);

/* ---------------------------------------------------------------------------------------------------- crs.c -- */
typedef struct import_crs {
    char *wkt;      /* "" for none */
    char *vertical; /* "" for none */
    int32_t srid;   /* EPSG code of the horizontal part, 0 for none */
    bool lonlat, wgs84;
    double metres; /* of ground, in one unit of the coordinates; along the equator where they are angles */
} import_crs;

bool import_crs_describe(OGRSpatialReferenceH crs, import_crs *out); /* false: no memory */
/* Metres of ground that one sample step stands for: the cell of rqt_void_cost. */
double import_crs_cell(const import_crs *crs, const rqt_placement *placement);
void import_crs_free(import_crs *crs);
bool import_crs_is_same(OGRSpatialReferenceH a, OGRSpatialReferenceH b);
/* For sentences: "none" for NULL. */
const char *import_crs_name(OGRSpatialReferenceH crs);

/* ------------------------------------------------------------------------------------------------- mosaic.c -- */
typedef struct import_mosaic {
    rqt_lattice lattice; /* of the union of the sources */
    rqt_placement placement;
    int32_t *column, *row; /* where each source begins */
    import_kind kind;
    bool is_metres; /* values become metres while they are read: floats, and integers of unlike units */
    import_scheme scheme;
} import_mosaic;

bool import_mosaic_plan(const import_job *job, const import_source *sources, int count, import_mosaic *mosaic);
void import_mosaic_free(import_mosaic *mosaic);
/* The cell of the first source's grid at which another one begins, in x or in y; refused unless it shares the grid.
 */
bool import_mosaic_align(const import_job *job, const import_source *first, const import_source *s, bool rows,
                         int64_t *cell);

/* -------------------------------------------------------------------------------------------------- cover.c -- */
typedef struct import_window { /* of samples, both ends included */
    int32_t column0, row0, column1, row1;
} import_window;
int64_t import_window_samples(const import_window *window);

typedef struct import_gap {
    import_window window;
    size_t hole; /* while they are looked for: one of those that it touches */
    bool inside; /* the hole that it is part of does not reach the edge */
} import_gap;

typedef struct import_overlap {
    int32_t a, b; /* a < b */
    import_window window;
} import_overlap;

/* The worst first. */
typedef struct import_cover {
    import_gap *gap; /* rectangles that do not overlap, and leave nothing out */
    size_t gaps;
    import_overlap *overlap; /* pairs that share at least 2 x 2 samples */
    size_t overlaps;
} import_cover;

bool import_cover_find(const import_job *job, const import_source *sources, int count, const import_mosaic *mosaic,
                       import_cover *cover);
void import_cover_free(import_cover *cover);

/* ------------------------------------------------------------------------------------------------- report.c -- */
typedef struct import_findings {
    const import_source *sources;
    int count;
    const import_mosaic *mosaic;
    const import_crs *crs;
    const import_cover *cover;
    import_conflicts *conflicts;
    const import_report *report;
} import_findings;

/* The worst of each kind, as sentences. Puts the conflicts into the order of the report. */
void import_findings_tell(const import_job *job, const import_findings *findings);
/* Can options->report be written? It is a new file, or takes a file's place. */
bool import_findings_probe(const import_job *job);
/* All of them into options->report. */
bool import_findings_write(const import_job *job, const import_findings *findings);

/* --------------------------------------------------------------------------------------------------- read.c -- */
typedef struct import_reading import_reading;

/* strip_rows: the most rows of a strip. */
bool import_reading_open(const import_job *job, const import_source *sources, int count,
                         const import_mosaic *mosaic, int32_t strip_rows, import_reading **reading);
void import_reading_close(import_reading *reading);
/* Rows first_row .. first_row + rows - 1 of the grid into the strip's arrays, from all sources that meet them.
 * Strips come from north to south. Adds to counts. */
bool import_reading_strip(import_reading *reading, import_strip *strip, import_counts *counts);
/* Sources that disagree in the strip read last. */
const import_conflicts *import_reading_conflicts(const import_reading *reading);
int import_reading_most_open(void); /* datasets that may be open at once */
/* Bytes of the buffers that reading strips takes beside them, and of the cache in which GDAL keeps each of its
 * blocks until all of its rows have been asked for. */
size_t import_reading_bytes(const import_source *sources, int count, const import_mosaic *mosaic,
                            int32_t strip_rows);
int64_t import_reading_cache(const import_source *sources, int count, const import_mosaic *mosaic,
                             int32_t strip_rows);

#endif
