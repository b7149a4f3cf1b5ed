/* read.c - GDAL windows -> values and validity of some rows of the grid.
 *
 * A strip is read from every source that meets its rows, turned north-up and west-first on the way. A sample is
 * void when it is a declared or given nodata value, NaN, or masked. A void never replaces data; data replaces
 * earlier data, and while that happens bits in `valid` remember it, so that three sources over one place count it
 * once. Beside each value stands the source that it is from, so that two which disagree can be named (conflict.c).
 *
 * A source is open while strips meet it, so that the rows of a GDAL block which a strip leaves over come out of
 * GDAL's cache, and every compressed block is decoded once.
 */
#include "source.h"

#include <cpl_conv.h>
#include <cpl_error.h>
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#define HAS_DATA 1
#define OVERLAPS 2
#define DIFFERS 4

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
    import_strip *grid;
    const import_source *source;
    voids voids;
    rqt_unit unit;
    double factor;
    bool scaled;
    size_t target;     /* of the row's first sample in file order */
    ptrdiff_t forward; /* 1, or -1 for columns that run west */
    int32_t index;     /* of the source */
    int32_t *owner;    /* of each value of the grid, the source it is from */
    import_conflicts *conflicts;
    bool failed; /* no memory for a conflict */
} merge;

/* There is a value already. */
static void meet(merge *m, size_t n, double difference) {
    uint8_t *valid = &m->grid->valid[n];
    *valid |= OVERLAPS;
    if (difference == 0) return;
    *valid |= DIFFERS;
    const int32_t row = m->grid->first_row + (int32_t)(n / (size_t)m->grid->width),
                  column = (int32_t)(n % (size_t)m->grid->width);
    const import_conflict one = {m->owner[n], m->index, 1, fabs(difference), column, row, column, row};
    if (!import_conflicts_add(m->conflicts, &one)) m->failed = true;
}

static void merge_i32(merge *m, const int32_t *row, const uint8_t *mask) {
    int32_t *values = m->grid->values;
    uint8_t *valid = m->grid->valid;
    size_t n = m->target;
    for (int32_t i = 0; i < m->source->width; i++, n = (size_t)((ptrdiff_t)n + m->forward)) {
        int32_t value = row[i];
        if (m->source->is_signed_byte && value > 127) value -= 256;
        if ((mask && !mask[i]) || is_void_integer(&m->voids, value)) continue;
        if (valid[n]) meet(m, n, (double)value - (double)values[n]);
        valid[n] |= HAS_DATA;
        values[n] = value;
        m->owner[n] = m->index;
    }
}

/* Integers that differ by less than a double tells do differ. */
static double difference_i64(int64_t a, int64_t b) {
    const double d = (double)a - (double)b;
    return a != b && d == 0 ? 1 : d;
}

static void merge_i64(merge *m, const int64_t *row, const uint8_t *mask) {
    int64_t *values = m->grid->values;
    uint8_t *valid = m->grid->valid;
    size_t n = m->target;
    for (int32_t i = 0; i < m->source->width; i++, n = (size_t)((ptrdiff_t)n + m->forward)) {
        int64_t value = row[i];
        if (m->source->is_signed_byte && value > 127) value -= 256;
        if ((mask && !mask[i]) || is_void_integer(&m->voids, value)) continue;
        if (valid[n]) meet(m, n, difference_i64(value, values[n]));
        valid[n] |= HAS_DATA;
        values[n] = value;
        m->owner[n] = m->index;
    }
}

/* Both return the column (of the file) of an infinite height, or -1. */
static int32_t merge_f32(merge *m, const float *row, const uint8_t *mask) {
    float *values = m->grid->values;
    uint8_t *valid = m->grid->valid;
    size_t n = m->target;
    for (int32_t i = 0; i < m->source->width; i++, n = (size_t)((ptrdiff_t)n + m->forward)) {
        float value = row[i];
        if (m->source->is_signed_byte && value > 127) value -= 256;
        if ((mask && !mask[i]) || is_void_real(&m->voids, value)) continue;
        if (isinf(value)) return i;
        if (valid[n]) meet(m, n, (double)value - (double)values[n]);
        valid[n] |= HAS_DATA;
        values[n] = value;
        m->owner[n] = m->index;
    }
    return -1;
}

static int32_t merge_f64(merge *m, const double *row, const uint8_t *mask) {
    double *values = m->grid->values;
    uint8_t *valid = m->grid->valid;
    size_t n = m->target;
    for (int32_t i = 0; i < m->source->width; i++, n = (size_t)((ptrdiff_t)n + m->forward)) {
        double value = row[i];
        if (m->source->is_signed_byte && value > 127) value -= 256;
        if ((mask && !mask[i]) || is_void_real(&m->voids, value)) continue;
        if (m->scaled) value = value * m->factor + m->unit.offset;
        if (isinf(value)) return i;
        if (valid[n]) meet(m, n, (double)value - (double)values[n]);
        valid[n] |= HAS_DATA;
        values[n] = value;
        m->owner[n] = m->index;
    }
    return -1;
}

static int32_t merge_row(merge *m, const char *row, const uint8_t *mask) {
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

/* ------------------------------------------------------------------------------------------------- strips -- */
#define MOST_OPEN 200  /* sources; beyond, each is closed after every strip */
#define OTHER_FILES 32 /* that a process has open: streams, libraries, the database */

struct import_reading {
    const import_job *job;
    const import_source *sources;
    const import_mosaic *mosaic;
    int count, open, most_open;
    GDALDatasetH *dataset; /* of each source; NULL: closed */
    int32_t *owner;        /* see merge */
    import_conflicts conflicts;
    char *rows; /* of a source, as they are in its file */
    uint8_t *mask;
};

static const GDALDataType gdal_types[] = {GDT_Int32, GDT_Int64, GDT_Float32, GDT_Float64};

static int32_t smaller(int32_t a, int32_t b) {
    return a < b ? a : b;
}

static void widest(const import_source *sources, int count, int32_t strip_rows, size_t *samples, size_t *masked) {
    *samples = *masked = 0;
    for (int i = 0; i < count; i++) {
        const size_t n = (size_t)sources[i].width * (size_t)smaller(sources[i].height, strip_rows);
        if (n > *samples) *samples = n;
        if (sources[i].has_mask && n > *masked) *masked = n;
    }
}

size_t import_reading_bytes(const import_source *sources, int count, const import_mosaic *mosaic,
                            int32_t strip_rows) {
    size_t samples, masked;
    widest(sources, count, strip_rows, &samples, &masked);
    return samples * import_kind_bytes(mosaic->kind) + masked +
           (size_t)mosaic->lattice.width * (size_t)strip_rows * sizeof(int32_t);
}

/* Sources that may be open at once: a dataset has a file, and often one beside it. */
int import_reading_most_open(void) {
    struct rlimit files;
    if (getrlimit(RLIMIT_NOFILE, &files) || files.rlim_cur == RLIM_INFINITY) return MOST_OPEN;
    const int64_t half = ((int64_t)files.rlim_cur - OTHER_FILES) / 2;
    return half < 1 ? 1 : half < MOST_OPEN ? (int)half : MOST_OPEN;
}

/* Bytes that come and go with a source, when strips move south. */
typedef struct change {
    int32_t row;
    int64_t bytes;
} change;

static int by_row(const void *a, const void *b) {
    const change *x = a, *y = b;
    if (x->row != y->row) return x->row < y->row ? -1 : 1;
    return (x->bytes > y->bytes) - (x->bytes < y->bytes); /* what goes, first */
}

int64_t import_reading_cache(const import_source *sources, int count, const import_mosaic *mosaic,
                             int32_t strip_rows) {
    change *changes = malloc(2 * (size_t)count * sizeof *changes);
    if (!changes) return INT64_MAX / 4; /* no plan fits */
    for (int i = 0; i < count; i++) {
        /* A row of blocks of each source that a strip may meet. */
        const import_source *s = &sources[i];
        const int64_t across = (s->width + s->block_columns - 1) / s->block_columns;
        const int64_t bytes =
            across * s->block_columns * s->block_rows * (GDALGetDataTypeSizeBytes(s->type) + (s->has_mask ? 1 : 0));
        changes[2 * i] = (change){mosaic->row[i] - strip_rows + 1, bytes};
        changes[2 * i + 1] = (change){mosaic->row[i] + s->height, -bytes};
    }
    qsort(changes, 2 * (size_t)count, sizeof *changes, by_row);
    int64_t most = 0, bytes = 0;
    for (int i = 0; i < 2 * count; i++) {
        bytes += changes[i].bytes;
        if (bytes > most) most = bytes;
    }
    free(changes);
    return most;
}

bool import_reading_open(const import_job *job, const import_source *sources, int count,
                         const import_mosaic *mosaic, int32_t strip_rows, import_reading **reading) {
    size_t samples, masked;
    widest(sources, count, strip_rows, &samples, &masked);
    import_reading *r = *reading = calloc(1, sizeof *r);
    if (r) {
        *r = (import_reading){.job = job,
                              .sources = sources,
                              .count = count,
                              .mosaic = mosaic,
                              .most_open = import_reading_most_open()};
        r->owner = malloc((size_t)mosaic->lattice.width * (size_t)strip_rows * sizeof *r->owner);
        r->dataset = calloc((size_t)count, sizeof(GDALDatasetH));
        /* NOLINTNEXTLINE(clang-analyzer-optin.portability.UnixAPI): a source has samples */
        r->rows = malloc(samples * import_kind_bytes(mosaic->kind));
        r->mask = malloc(masked ? masked : 1);
    }
    return (r && r->dataset && r->rows && r->mask && r->owner) || import_no_memory(job, "reading the sources");
}

static void shut(import_reading *r, int source) {
    if (!r->dataset[source]) return;
    GDALClose(r->dataset[source]);
    r->dataset[source] = NULL;
    r->open--;
}

void import_reading_close(import_reading *r) {
    if (!r) return;
    for (int i = 0; r->dataset && i < r->count; i++) shut(r, i);
    free(r->dataset);
    free(r->rows);
    free(r->mask);
    free(r->owner);
    import_conflicts_free(&r->conflicts);
    free(r);
}

static bool opened(import_reading *r, int source) {
    const import_source *s = &r->sources[source];
    if (r->dataset[source]) return true;
    CPLErrorReset();
    GDALDatasetH d =
        GDALOpenEx(s->opened, GDAL_OF_RASTER | GDAL_OF_READONLY | GDAL_OF_VERBOSE_ERROR, NULL, NULL, NULL);
    r->dataset[source] = d;
    r->open += d != NULL;
    return (d && GDALGetRasterXSize(d) == s->width && GDALGetRasterYSize(d) == s->height) ||
           import_refuse(r->job, "%s has changed while it was imported%s%s", s->path, d ? "" : ": ",
                         d ? "" : CPLGetLastErrorMsg());
}

static bool unreadable(const import_reading *r, const import_source *s, int32_t top, int32_t rows) {
    return import_refuse(r->job, "%s: rows %d to %d cannot be read: %s", s->path, top, top + rows - 1,
                         CPLGetLastErrorMsg());
}

/* The only source of a whole strip, integers in the order of the grid: straight into the strip. Returns the number
 * of voids, or -1. */
static int64_t read_directly(import_reading *r, int source, import_strip *strip) {
    const import_source *s = &r->sources[source];
    const size_t n = (size_t)strip->rows * (size_t)strip->width;
    const int32_t *values = strip->values;
    uint8_t *valid = strip->valid;
    const voids v = voids_of(s, r->job->options);
    CPLErrorReset();
    if (GDALRasterIO(GDALGetRasterBand(r->dataset[source], 1), GF_Read, 0, strip->first_row, s->width, strip->rows,
                     strip->values, s->width, strip->rows, GDT_Int32, 0, 0) != CE_None) {
        (void)unreadable(r, s, strip->first_row, strip->rows);
        return -1;
    }
    if (v.count == 0) {
        memset(valid, HAS_DATA, n);
        return 0;
    }
    int64_t found = 0;
    for (size_t y = 0; y < (size_t)strip->rows; y++) {
        const int32_t *from = values + y * (size_t)strip->width;
        uint8_t *to = valid + y * (size_t)strip->width;
        uint32_t marks = 0;
        if (v.count == 1 && v.integer[0] == (int32_t)v.integer[0]) {
            const int32_t mark = (int32_t)v.integer[0];
            for (int32_t i = 0; i < strip->width; i++) to[i] = from[i] != mark;
        } else {
            for (int32_t i = 0; i < strip->width; i++) to[i] = !is_void_integer(&v, from[i]);
        }
        for (int32_t i = 0; i < strip->width; i++) marks += !to[i];
        found += marks;
    }
    return found;
}

/* rows: of the file, from top on. The strip's row of the first one and the direction from there. */
static bool read_merging(import_reading *r, int source, int32_t top, int32_t rows, import_strip *strip,
                         int32_t row) {
    const import_source *s = &r->sources[source];
    GDALRasterBandH band = GDALGetRasterBand(r->dataset[source], 1);
    const size_t element = import_kind_bytes(strip->kind);
    merge m = {.grid = strip,
               .source = s,
               .voids = voids_of(s, r->job->options),
               .unit = import_source_unit(s),
               .index = source,
               .owner = r->owner,
               .conflicts = &r->conflicts};
    m.factor = rqt_unit_factor(&m.unit);
    m.scaled = m.factor != 1 || m.unit.offset != 0;
    m.forward = s->flip_columns ? -1 : 1;
    const int32_t first = r->mosaic->column[source] + (s->flip_columns ? s->width - 1 : 0);
    CPLErrorReset();
    CPLErr failed =
        GDALRasterIO(band, GF_Read, 0, top, s->width, rows, r->rows, s->width, rows, gdal_types[strip->kind], 0, 0);
    if (failed == CE_None && s->has_mask)
        failed = GDALRasterIO(GDALGetMaskBand(band), GF_Read, 0, top, s->width, rows, r->mask, s->width, rows,
                              GDT_Byte, 0, 0);
    if (failed != CE_None) return unreadable(r, s, top, rows);
    for (int32_t y = 0; y < rows; y++) {
        const int32_t to = s->flip_rows ? row + rows - 1 - y : row + y;
        m.target = (size_t)to * (size_t)strip->width + (size_t)first;
        const int32_t infinite = merge_row(&m, r->rows + (size_t)y * (size_t)s->width * element,
                                           s->has_mask ? r->mask + (size_t)y * (size_t)s->width : NULL);
        if (infinite >= 0)
            return import_refuse(r->job,
                                 "%s: the height at column %d, row %d is infinite; if infinity marks voids there, "
                                 "say --nodata inf (or -inf)",
                                 s->path, infinite, top + y);
    }
    return !m.failed || import_no_memory(r->job, "comparing the sources");
}

/* Bits of the merge -> 0 and 1, and the counts. */
static void settle(import_strip *strip, import_counts *counts) {
    const size_t n = (size_t)strip->width * (size_t)strip->rows;
    int64_t data = 0, overlap = 0, differs = 0;
    for (size_t i = 0; i < n; i++) {
        const uint8_t bits = strip->valid[i];
        data += bits & HAS_DATA;
        overlap += (bits & OVERLAPS) != 0;
        differs += (bits & DIFFERS) != 0;
        strip->valid[i] = bits & HAS_DATA;
    }
    counts->voids += (int64_t)n - data;
    counts->overlap += overlap;
    counts->overlap_differs += differs;
}

/* Can it be read without merging? */
static bool is_direct(const import_reading *r, int source, const import_strip *strip) {
    const import_source *s = &r->sources[source];
    return r->count == 1 && strip->kind == IMPORT_I32 && !s->has_mask && !s->is_signed_byte && !s->flip_rows &&
           !s->flip_columns;
}

/* What the strip wants of one source. */
static bool merge_source(import_reading *r, int source, import_strip *strip, import_counts *counts) {
    const import_source *s = &r->sources[source];
    const int32_t row = r->mosaic->row[source];
    const int32_t from = row > strip->first_row ? row : strip->first_row;
    const int32_t to = smaller(row + s->height, strip->first_row + strip->rows);
    if (from >= to) return true;
    const int32_t top = s->flip_rows ? row + s->height - to : from - row;
    if (!opened(r, source) || !read_merging(r, source, top, to - from, strip, from - strip->first_row))
        return false;
    counts->samples += (int64_t)(to - from) * s->width;
    if (to == row + s->height || r->open > r->most_open) shut(r, source);
    return true;
}

const import_conflicts *import_reading_conflicts(const import_reading *r) {
    return &r->conflicts;
}

bool import_reading_strip(import_reading *r, import_strip *strip, import_counts *counts) {
    import_conflicts_clear(&r->conflicts);
    if (is_direct(r, 0, strip)) {
        const int64_t found = opened(r, 0) ? read_directly(r, 0, strip) : -1;
        if (found < 0) return false;
        counts->voids += found;
        counts->samples += (int64_t)strip->rows * strip->width;
        return true;
    }
    memset(strip->valid, 0, (size_t)strip->rows * (size_t)strip->width);
    for (int i = 0; i < r->count; i++)
        if (!merge_source(r, i, strip, counts)) return false;
    settle(strip, counts);
    return true;
}

size_t import_kind_bytes(import_kind kind) {
    return kind == IMPORT_I32 || kind == IMPORT_F32 ? 4 : 8;
}
