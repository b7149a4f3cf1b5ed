/* read.c - GDAL windows -> values and validity of the whole grid.
 *
 * A source is read in strips of whole rows, as tall as GDAL's own blocks or taller, so that every compressed block
 * is decoded once; each strip is then merged into the grid, turned north-up and west-first on the way. A sample is
 * void when it is a declared or given nodata value, NaN, or masked. A void never replaces data; data replaces
 * earlier data, and while that happens bits in `valid` remember it, so that three sources over one place count it
 * once.
 */
#include "source.h"

#include <cpl_conv.h>
#include <cpl_error.h>
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define HAS_DATA 1
#define OVERLAPS 2
#define DIFFERS 4

static size_t strip_rows(const import_source *s) {
    size_t row = (size_t)s->width * sizeof(double), block = s->block_rows > 0 ? (size_t)s->block_rows : 1;
    size_t rows = IMPORT_STRIP_BYTES / row / block * block;
    if (rows < block) rows = block;
    return rows < (size_t)s->height ? rows : (size_t)s->height;
}

size_t import_read_bytes(const import_source *sources, int count) {
    size_t largest = 0;
    for (int i = 0; i < count; i++) {
        /* Values and mask of a strip; the same again for the row of blocks that GDAL decodes it from. */
        size_t bytes = strip_rows(&sources[i]) * (size_t)sources[i].width * (2 * sizeof(double) + 1);
        if (bytes > largest) largest = bytes;
    }
    return largest;
}

/* ------------------------------------------------------------------------------------------------- voids -- */
typedef struct voids {
    int count;
    double value[2], slack[2];
    int64_t integer[2];
} voids;

static void voids_add(voids *v, const import_source *s, double value, int64_t integer) {
    /* A nodata value has been through decimal text: in float32 it may be an ulp or two off, as GDAL has it; one as
     * large as the largest floats is often cut to a few digits, and no height is that large. */
    double slack = 0;
    if (fabs(value) > 1e30)
        slack = isinf(value) ? 0 : 1e-5 * fabs(value);
    else if (s->is_float && s->is_single)
        slack = 4 * (double)FLT_EPSILON * fabs(value);
    v->value[v->count] = value;
    v->slack[v->count] = slack;
    v->integer[v->count++] = integer;
}

static voids voids_of(const import_source *s, const import_options *o) {
    voids v = {0};
    if (s->has_nodata) voids_add(&v, s, s->nodata, s->nodata_integer);
    bool whole = fabs(o->nodata) < 9e15 && o->nodata == rint(o->nodata);
    if (o->has_nodata && (s->is_float || whole)) voids_add(&v, s, o->nodata, whole ? (int64_t)o->nodata : 0);
    return v;
}

static inline bool is_void_integer(const voids *v, int64_t value) {
    for (int i = 0; i < v->count; i++)
        if (value == v->integer[i]) return true;
    return false;
}

static inline bool is_void_real(const voids *v, double value) {
    if (isnan(value)) return true;
    for (int i = 0; i < v->count; i++)
        if (value == v->value[i] || fabs(value - v->value[i]) <= v->slack[i]) return true;
    return false;
}

/* ------------------------------------------------------------------------------------------------- merge -- */
/* One row of a source on its way into the grid. */
typedef struct merge {
    import_samples *grid;
    const import_source *source;
    voids voids;
    rqt_unit unit;
    double factor;
    bool scaled;
    size_t target;     /* of the row's first sample in file order */
    ptrdiff_t forward; /* 1, or -1 for columns that run west */
} merge;

static inline uint8_t merged(uint8_t before, bool differs) {
    if (!before) return HAS_DATA;
    return (uint8_t)(before | OVERLAPS | (differs ? DIFFERS : 0));
}

static void merge_i32(const merge *m, const int32_t *row, const uint8_t *mask) {
    int32_t *values = m->grid->values;
    uint8_t *valid = m->grid->valid;
    size_t n = m->target;
    for (int32_t i = 0; i < m->source->width; i++, n = (size_t)((ptrdiff_t)n + m->forward)) {
        int32_t value = row[i];
        if (m->source->is_signed_byte && value > 127) value -= 256;
        if ((mask && !mask[i]) || is_void_integer(&m->voids, value)) continue;
        valid[n] = merged(valid[n], values[n] != value);
        values[n] = value;
    }
}

static void merge_i64(const merge *m, const int64_t *row, const uint8_t *mask) {
    int64_t *values = m->grid->values;
    uint8_t *valid = m->grid->valid;
    size_t n = m->target;
    for (int32_t i = 0; i < m->source->width; i++, n = (size_t)((ptrdiff_t)n + m->forward)) {
        int64_t value = row[i];
        if (m->source->is_signed_byte && value > 127) value -= 256;
        if ((mask && !mask[i]) || is_void_integer(&m->voids, value)) continue;
        valid[n] = merged(valid[n], values[n] != value);
        values[n] = value;
    }
}

/* Both return the column (of the file) of an infinite height, or -1. */
static int32_t merge_f32(const merge *m, const float *row, const uint8_t *mask) {
    float *values = m->grid->values;
    uint8_t *valid = m->grid->valid;
    size_t n = m->target;
    for (int32_t i = 0; i < m->source->width; i++, n = (size_t)((ptrdiff_t)n + m->forward)) {
        float value = row[i];
        if (m->source->is_signed_byte && value > 127) value -= 256;
        if ((mask && !mask[i]) || is_void_real(&m->voids, value)) continue;
        if (isinf(value)) return i;
        valid[n] = merged(valid[n], !(values[n] == value));
        values[n] = value;
    }
    return -1;
}

static int32_t merge_f64(const merge *m, const double *row, const uint8_t *mask) {
    double *values = m->grid->values;
    uint8_t *valid = m->grid->valid;
    size_t n = m->target;
    for (int32_t i = 0; i < m->source->width; i++, n = (size_t)((ptrdiff_t)n + m->forward)) {
        double value = row[i];
        if (m->source->is_signed_byte && value > 127) value -= 256;
        if ((mask && !mask[i]) || is_void_real(&m->voids, value)) continue;
        if (m->scaled) value = value * m->factor + m->unit.offset;
        if (isinf(value)) return i;
        valid[n] = merged(valid[n], !(values[n] == value));
        values[n] = value;
    }
    return -1;
}

static int32_t merge_row(const merge *m, const char *row, const uint8_t *mask) {
    switch (m->grid->kind) {
    case IMPORT_I32:
        merge_i32(m, (const int32_t *)(const void *)row, mask);
        return -1;
    case IMPORT_I64:
        merge_i64(m, (const int64_t *)(const void *)row, mask);
        return -1;
    case IMPORT_F32:
        return merge_f32(m, (const float *)(const void *)row, mask);
    case IMPORT_F64:
        break;
    }
    return merge_f64(m, (const double *)(const void *)row, mask);
}

/* ------------------------------------------------------------------------------------------------- source -- */
typedef struct reading {
    const import_job *job;
    import_samples *grid;
    int64_t before, total; /* samples of the sources: read before this one, in all */
    int64_t whole;         /* samples of the grid, for the progress */
} reading;

static bool read_strips(const reading *r, const import_source *s, GDALRasterBandH band, int32_t column, int32_t row,
                        char *strip, uint8_t *mask) {
    static const GDALDataType types[] = {GDT_Int32, GDT_Int64, GDT_Float32, GDT_Float64};
    size_t element = import_kind_bytes(r->grid->kind), tall = strip_rows(s);
    GDALRasterBandH mask_band = s->has_mask ? GDALGetMaskBand(band) : NULL;
    merge m = {.grid = r->grid, .source = s, .voids = voids_of(s, r->job->options), .unit = import_source_unit(s)};
    m.factor = rqt_unit_factor(&m.unit);
    m.scaled = m.factor != 1 || m.unit.offset != 0;
    m.forward = s->flip_columns ? -1 : 1;
    int first = s->flip_columns ? s->width - 1 : 0;
    for (int32_t top = 0; top < s->height; top += (int32_t)tall) {
        int rows = s->height - top < (int32_t)tall ? s->height - top : (int32_t)tall;
        CPLErrorReset();
        CPLErr failed =
            GDALRasterIO(band, GF_Read, 0, top, s->width, rows, strip, s->width, rows, types[r->grid->kind], 0, 0);
        if (failed == CE_None && mask_band)
            failed = GDALRasterIO(mask_band, GF_Read, 0, top, s->width, rows, mask, s->width, rows, GDT_Byte, 0, 0);
        if (failed != CE_None)
            return import_refuse(r->job, "%s: rows %d to %d cannot be read: %s", s->path, top, top + rows - 1,
                                 CPLGetLastErrorMsg());
        for (int y = 0; y < rows; y++) {
            int32_t from = top + y, to = row + (s->flip_rows ? s->height - 1 - from : from);
            m.target = (size_t)to * (size_t)r->grid->width + (size_t)(column + first);
            int32_t infinite = merge_row(&m, strip + (size_t)y * (size_t)s->width * element,
                                         mask_band ? mask + (size_t)y * (size_t)s->width : NULL);
            if (infinite >= 0)
                return import_refuse(r->job,
                                     "%s: the height at column %d, row %d is infinite; if infinity marks voids "
                                     "there, say --nodata inf (or -inf)",
                                     s->path, infinite, from);
        }
        double done = (double)(r->before + (int64_t)(top + rows) * s->width) / (double)r->total;
        if (!import_progress(r->job, "reading", done, r->whole)) return false;
    }
    return true;
}

static bool read_source(const reading *r, const import_source *s, int32_t column, int32_t row) {
    size_t n = strip_rows(s) * (size_t)s->width;
    char *strip = malloc(n * import_kind_bytes(r->grid->kind));
    uint8_t *mask = s->has_mask ? malloc(n) : NULL;
    CPLErrorReset();
    GDALDatasetH dataset =
        GDALOpenEx(s->opened, GDAL_OF_RASTER | GDAL_OF_READONLY | GDAL_OF_VERBOSE_ERROR, NULL, NULL, NULL);
    bool ok = false;
    if (!strip || (s->has_mask && !mask))
        import_no_memory(r->job, "reading a source");
    else if (!dataset || GDALGetRasterXSize(dataset) != s->width || GDALGetRasterYSize(dataset) != s->height)
        import_refuse(r->job, "%s has changed while it was imported%s%s", s->path, dataset ? "" : ": ",
                      dataset ? "" : CPLGetLastErrorMsg());
    else
        ok = read_strips(r, s, GDALGetRasterBand(dataset, 1), column, row, strip, mask);
    if (dataset) GDALClose(dataset);
    free(strip);
    free(mask);
    return ok;
}

/* Bits of the merge -> 0 and 1, and the counts. */
static void settle(import_samples *grid) {
    size_t n = (size_t)grid->width * (size_t)grid->height;
    int64_t data = 0, overlap = 0, differs = 0;
    for (size_t i = 0; i < n; i++) {
        uint8_t bits = grid->valid[i];
        data += bits & HAS_DATA;
        overlap += (bits & OVERLAPS) != 0;
        differs += (bits & DIFFERS) != 0;
        grid->valid[i] = bits & HAS_DATA;
    }
    grid->voids = (int64_t)n - data;
    grid->overlap = overlap;
    grid->overlap_differs = differs;
}

bool import_read(const import_job *job, const import_source *sources, int count, const import_mosaic *mosaic,
                 import_samples *samples) {
    size_t n = (size_t)mosaic->lattice.width * (size_t)mosaic->lattice.height;
    *samples =
        (import_samples){.kind = mosaic->kind, .width = mosaic->lattice.width, .height = mosaic->lattice.height};
    samples->values = calloc(n, import_kind_bytes(mosaic->kind));
    samples->valid = calloc(n, 1);
    if (!samples->values || !samples->valid) return import_no_memory(job, "reading the sources");
    reading r = {.job = job, .grid = samples, .whole = (int64_t)n};
    for (int i = 0; i < count; i++) r.total += (int64_t)sources[i].width * sources[i].height;
    for (int i = 0; i < count; i++) {
        if (!read_source(&r, &sources[i], mosaic->column[i], mosaic->row[i])) return false;
        r.before += (int64_t)sources[i].width * sources[i].height;
    }
    settle(samples);
    return true;
}

size_t import_kind_bytes(import_kind kind) {
    return kind == IMPORT_I32 || kind == IMPORT_F32 ? 4 : 8;
}

void import_samples_free(import_samples *samples) {
    free(samples->values);
    free(samples->valid);
    *samples = (import_samples){0};
}
