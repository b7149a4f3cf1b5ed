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
} import_source;

bool import_source_describe(const import_job *job, const char *path, import_source *source);
void import_source_free(import_source *source);
/* Metres of a raw value: raw * factor + offset, as rqt_unit_metres has it for z0 = 0, d = 1. */
rqt_unit import_source_unit(const import_source *source);

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

/* --------------------------------------------------------------------------------------------------- read.c -- */
typedef struct import_reading import_reading;

/* strip_rows: the most rows of a strip. */
bool import_reading_open(const import_job *job, const import_source *sources, int count,
                         const import_mosaic *mosaic, int32_t strip_rows, import_reading **reading);
void import_reading_close(import_reading *reading);
/* Rows first_row .. first_row + rows - 1 of the grid into the strip's arrays, from all sources that meet them.
 * Strips come from north to south. Adds to counts. */
bool import_reading_strip(import_reading *reading, import_strip *strip, import_counts *counts);
/* Bytes of the buffers that reading strips takes beside them, and of the cache in which GDAL keeps each of its
 * blocks until all of its rows have been asked for. */
size_t import_reading_bytes(const import_source *sources, int count, import_kind kind, int32_t strip_rows);
int64_t import_reading_cache(const import_source *sources, int count, const import_mosaic *mosaic,
                             int32_t strip_rows);

#endif
