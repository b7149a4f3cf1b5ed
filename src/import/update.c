/* update.c - sources into a terrain that is there.
 *
 * Which rasters are meant, what a source is, where it lies and what is void in it, is found out as for an import.
 * Each is read by itself, from north to south, and put in before the next one is opened: so a later one wins, and
 * memory does not grow with their number. Rows are read in strips that end where the terrain's blocks do.
 *
 * Heights become what the terrain holds. Whole numbers of the terrain's own unit are kept as they are; all others
 * are metres first, and rounded to the terrain's quantum. Where the terrain promises that nothing was rounded
 * (quantum_error 0), what does not come back from its height is refused; where it was imported with rounding, the
 * same rounding is done again.
 */
#include "source.h"

#include <cpl_error.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define STRIP_SAMPLES (4 << 20) /* read at once */

typedef struct update_work {
    import_job job;
    bool voids;
    const store_terrain *terrain;
    import_source grid; /* the terrain as if it were a source */
    char grid_name[80];
    import_paths paths;
    char *names;     /* of the sources that were put in, a line each */
    int64_t outside; /* rasters of folders that were not */
    store_update *store;
    import_database database;
    import_update_report *report;
} update_work;

/* One source on its way. */
typedef struct placed_source {
    import_source source;
    import_mosaic mosaic;   /* of it alone */
    int64_t column, row;    /* of the terrain, where it begins */
    int32_t x0, y0, x1, y1; /* what of it lies in the terrain, in its own samples, ends excluded */
    bool is_raw;            /* its numbers are the terrain's */
} placed_source;

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + (double)t.tv_nsec * 1e-9;
}

/* --------------------------------------------------------------------------------------------------------- place
 * -- */

static bool describe_grid(update_work *w) {
    const store_terrain *t = w->terrain;
    snprintf(w->grid_name, sizeof w->grid_name, "terrain %s", t->name);
    w->grid = (import_source){
        .path = w->grid_name, .width = t->lattice.width, .height = t->lattice.height, .placement = t->placement};
    if (!*t->crs) return true;
    w->grid.crs = OSRNewSpatialReference(t->crs);
    if (!w->grid.crs) return import_refuse(&w->job, "the CRS of terrain %s cannot be read", t->name);
    OSRSetAxisMappingStrategy(w->grid.crs, OAMS_TRADITIONAL_GIS_ORDER);
    return true;
}

static int32_t within(int64_t x, int64_t low, int64_t high) {
    return (int32_t)(x < low ? low : x > high ? high : x);
}

static bool place(update_work *w, placed_source *p) {
    const import_source *s = &p->source;
    const rqt_placement *grid = &w->terrain->placement;
    const bool unplaced = grid->x0 == 0 && grid->y0 == 0 && grid->dx == 1 && grid->dy == -1;
    if (!import_crs_is_same(w->grid.crs, s->crs))
        return import_refuse(&w->job, "%s has the CRS %s, %s has %s: a source of an update has its terrain's",
                             s->path, import_crs_name(s->crs), w->grid_name, import_crs_name(w->grid.crs));
    if (!s->placed && !unplaced)
        return import_refuse(&w->job, "%s has no geotransform: it cannot be placed in %s", s->path, w->grid_name);
    if (!import_mosaic_align(&w->job, &w->grid, s, false, &p->column) ||
        !import_mosaic_align(&w->job, &w->grid, s, true, &p->row))
        return false;
    p->x0 = within(-p->column, 0, s->width);
    p->y0 = within(-p->row, 0, s->height);
    p->x1 = within(w->grid.width - p->column, 0, s->width);
    p->y1 = within(w->grid.height - p->row, 0, s->height);
    return true;
}

static bool is_outside(const placed_source *p) {
    return p->x0 >= p->x1 || p->y0 >= p->y1;
}

/* ------------------------------------------------------------------------------------------------------- heights
 * -- */

static bool is_raw(const placed_source *p, const rqt_unit *unit) {
    const rqt_unit own = import_source_unit(&p->source);
    return !p->mosaic.is_metres && unit->d == 1 && own.scale == unit->scale && own.offset == unit->offset &&
           own.numerator == unit->numerator && own.denominator == unit->denominator;
}

/* Heights of one row of a strip; false with a sentence. row: of the source. */
static bool quantise_row(const update_work *w, const placed_source *p, int32_t row, const double *values,
                         const uint8_t *valid, int32_t n, int32_t *q) {
    const store_terrain *t = w->terrain;
    const rqt_unit *unit = &t->unit, own = import_source_unit(&p->source);
    const double factor = rqt_unit_factor(unit), own_factor = rqt_unit_factor(&own);
    const import_steps steps = {unit->z0, unit->d, p->is_raw ? 1 : factor};
    const bool single = p->mosaic.scheme.single, exact = t->quantum_error == 0 && !p->is_raw;
    for (int32_t i = 0; i < n; i++) {
        if (!valid[i]) continue;
        double metres = values[i]; /* or raw ones */
        if (!p->is_raw && !p->mosaic.is_metres) metres = metres * own_factor + own.offset;
        const double steps_off = p->is_raw ? metres : metres - unit->offset;
        const double far = steps_off / steps.scale * steps.d - (double)steps.z0 * steps.d;
        if (!(fabs(far) + 1 < RQT_HEIGHT_LIMIT))
            return import_refuse(&w->job,
                                 "%s: the height at column %d, row %d is %.10g%s, too far from the others for %s, "
                                 "which counts 2^30 steps of %.10g m from %.10g m; if it marks voids, say --nodata",
                                 p->source.path, p->x0 + i, row, metres, p->is_raw ? "" : " m", w->grid_name,
                                 fabs(factor) / unit->d, rqt_unit_metres(unit, 0));
        q[i] = (int32_t)import_height(&steps, steps_off);
        if (!exact) continue;
        const double back = rqt_unit_metres(unit, q[i]);
        if (single ? (float)back != (float)metres : back != metres)
            return import_refuse(
                &w->job,
                "%s: the height at column %d, row %d is %.10g m, which is no whole number of steps of "
                "%.10g m, in which %s is kept without rounding; round the source, or import the terrain "
                "again with --quantum",
                p->source.path, p->x0 + i, row, metres, fabs(factor) / unit->d, w->grid_name);
    }
    return true;
}

/* ------------------------------------------------------------------------------------------------- samples, strips
 * -- */

typedef struct updating {
    update_work *work;
    double done, share;
    int64_t samples;
} updating;

static bool on_progress(void *context, double done) {
    const updating *u = context;
    return import_progress(&u->work->job, "updating", u->done + done * u->share, u->samples);
}

static bool fail_store(const update_work *w, int code, char *detail) {
    if (code == SQLITE_INTERRUPT && !detail) return false; /* the sentence is there */
    return import_database_refuse(&w->job, code, detail);
}

/* Samples with data that lie beside the terrain. */
static int64_t count_outside(const placed_source *p, const import_strip *strip) {
    int64_t outside = 0;
    for (int32_t y = 0; y < strip->rows; y++) {
        const int32_t row = strip->first_row + y;
        const uint8_t *valid = strip->valid + (size_t)y * (size_t)strip->width;
        const bool beside = row < p->y0 || row >= p->y1;
        for (int32_t x = 0; x < strip->width; x++) outside += valid[x] && (beside || x < p->x0 || x >= p->x1);
    }
    return outside;
}

static bool put_strip(update_work *w, const placed_source *p, const import_strip *strip, double *values, int32_t *q,
                      uint8_t *state) {
    const int32_t first = strip->first_row > p->y0 ? strip->first_row : p->y0, width = p->x1 - p->x0;
    const int32_t end = strip->first_row + strip->rows < p->y1 ? strip->first_row + strip->rows : p->y1;
    w->report->left_out += count_outside(p, strip);
    for (int32_t y = first; y < end; y++) {
        const size_t from = (size_t)(y - strip->first_row) * (size_t)strip->width + (size_t)p->x0;
        const size_t to = (size_t)(y - first) * (size_t)width;
        import_strip_doubles(strip, from, (size_t)width, values);
        if (!quantise_row(w, p, y, values, strip->valid + from, width, q + to)) return false;
        for (int32_t x = 0; x < width; x++) {
            state[to + (size_t)x] = strip->valid[from + (size_t)x] ? STORE_HEIGHT
                                    : w->voids                     ? STORE_VOID
                                                                   : STORE_KEEP;
            w->report->samples += state[to + (size_t)x] != STORE_KEEP;
        }
    }
    if (first >= end) return true;
    updating u = {w, (double)(first - p->y0) / (p->y1 - p->y0), (double)(end - first) / (p->y1 - p->y0),
                  (int64_t)width * (p->y1 - p->y0)};
    char *detail = NULL;
    const double start = now();
    const int code = store_update_samples(w->store, (int32_t)(p->column + p->x0), (int32_t)(p->row + first), width,
                                          end - first, q, state, on_progress, &u, &detail);
    w->report->seconds_update += now() - start;
    return code == SQLITE_OK || fail_store(w, code, detail);
}

/* Where a strip that begins with this row ends: after some rows, before a row of blocks begins. */
static int32_t strip_end(const update_work *w, const placed_source *p, int32_t first, int32_t rows) {
    const int64_t block = (int64_t)1 << w->terrain->k, at = p->row + first;
    int64_t end = first + rows;
    if (rows > block && at >= 0) end -= (p->row + end) % block;
    if (end <= first) end = first + rows;
    return (int32_t)(end < p->source.height ? end : p->source.height);
}

static bool put_strips(update_work *w, const placed_source *p, import_reading *reading, import_strip *strip,
                       int32_t rows, double *values, int32_t *q, uint8_t *state) {
    import_counts counts = {0};
    for (int32_t first = 0, end; first < p->source.height; first = end) {
        end = strip_end(w, p, first, rows);
        strip->first_row = first;
        strip->rows = end - first;
        const double start = now();
        if (!import_progress(&w->job, "reading", (double)first / p->source.height,
                             (int64_t)p->source.width * p->source.height) ||
            !import_reading_strip(reading, strip, &counts))
            return false;
        w->report->seconds_read += now() - start;
        if (!put_strip(w, p, strip, values, q, state)) return false;
    }
    return true;
}

static bool put_samples(update_work *w, placed_source *p) {
    const import_source *s = &p->source;
    const int64_t fits = STRIP_SAMPLES / s->width, block = (int64_t)1 << w->terrain->k;
    const int32_t rows = within(fits, block, s->height > block ? s->height : block);
    const size_t n = (size_t)rows * (size_t)s->width, width = (size_t)(p->x1 - p->x0);
    import_strip strip = {.kind = p->mosaic.kind, .width = s->width};
    import_reading *reading = NULL;
    strip.values = malloc(n * import_kind_bytes(strip.kind));
    strip.valid = malloc(n);
    double *values = malloc(width * sizeof *values);
    int32_t *q = calloc((size_t)rows * width, sizeof *q);
    uint8_t *state = malloc((size_t)rows * width);
    bool ok =
        (strip.values && strip.valid && values && q && state) || import_no_memory(&w->job, "reading the sources");
    ok = ok && import_reading_open(&w->job, s, 1, &p->mosaic, rows, &reading) &&
         put_strips(w, p, reading, &strip, rows, values, q, state);
    import_reading_close(reading);
    free(strip.values);
    free(strip.valid);
    free(values);
    free(q);
    free(state);
    return ok;
}

static bool add_name(update_work *w, const char *base) {
    char *longer = sqlite3_mprintf("%s%s%s", w->names ? w->names : "", w->names ? "\n" : "", base);
    if (!longer) return import_no_memory(&w->job, "naming the sources");
    sqlite3_free(w->names);
    w->names = longer;
    return true;
}

static bool put_described(update_work *w, placed_source *p) {
    const int64_t left_out = w->report->left_out;
    p->is_raw = is_raw(p, &w->terrain->unit);
    if (!put_samples(w, p)) return false;
    if (w->report->left_out > left_out)
        import_notice(&w->job, "%s: %lld of its samples lie outside %s and are left out", p->source.path,
                      (long long)(w->report->left_out - left_out), w->grid_name);
    return add_name(w, p->source.base);
}

/* Where does it lie? What is named must meet the terrain; what is only found in a folder may lie elsewhere: a
 * delivery is often larger than the terrain. */
static bool find_place(update_work *w, placed_source *p, import_path *path) {
    if (!import_mosaic_plan(&w->job, &p->source, 1, &p->mosaic) || !place(w, p)) return false;
    path->passed = path->found && is_outside(p);
    w->outside += path->passed;
    if (path->passed || !is_outside(p)) return true;
    return import_refuse(&w->job, "%s lies outside %s: none of its %lld samples is one of the terrain's %d x %d",
                         path->path, w->grid_name, (long long)p->source.width * p->source.height, w->grid.width,
                         w->grid.height);
}

static bool put_source(update_work *w, int n) {
    placed_source p = {0};
    import_path *path = &w->paths.path[n];
    if (!import_paths_describe(&w->job, &w->paths, n, &p.source)) return path->passed;
    bool ok = find_place(w, &p, path);
    if (!ok) import_paths_place_sentence(&w->job, &w->paths, n);
    if (ok && !path->passed) ok = put_described(w, &p);
    import_mosaic_free(&p.mosaic);
    import_source_free(&p.source);
    return ok;
}

static bool put_all(update_work *w) {
    for (int n = 0; n < w->paths.count; n++)
        if (!put_source(w, n)) return false;
    import_paths_tell_passed(&w->job, &w->paths);
    if (w->names) {
        if (w->outside)
            import_notice(&w->job, "%lld raster%s in folders lie%s outside %s: passed over", (long long)w->outside,
                          w->outside == 1 ? "" : "s", w->outside == 1 ? "s" : "", w->grid_name);
        return true;
    }
    return import_refuse(&w->job, "%s holds no raster of one band%s%s", w->paths.argument[0],
                         w->outside ? " that meets " : "", w->outside ? w->grid_name : "");
}

/* ----------------------------------------------------------------------------------------------------- the whole
 * -- */

static bool minimal_progress(void *context, double done) {
    const update_work *w = context;
    return import_progress(&w->job, "minimal errors", done,
                           (int64_t)w->terrain->lattice.width * w->terrain->lattice.height);
}

static bool finish(update_work *w) {
    char *detail = NULL;
    const double start = now();
    const int code = store_update_finish(w->store, w->names, minimal_progress, w, &detail);
    if (code != SQLITE_OK) return fail_store(w, code, detail);
    const store_update_report *told = store_update_told(w->store);
    import_update_report *r = w->report;
    r->changed = told->changed;
    r->blocks = told->blocks;
    r->summaries = told->summaries;
    r->bytes = told->bytes;
    r->blocks_read = told->blocks_read;
    r->bytes_read = told->bytes_read;
    r->measured = told->measured;
    r->cells = told->cells;
    r->minimal = told->minimal;
    if (told->minimal)
        import_notice(&w->job, "the minimal errors stored with %s have been computed anew, all of them",
                      w->grid_name);
    store_update_free(w->store); /* its statements would keep the transaction open */
    w->store = NULL;
    const bool ok = import_database_commit(&w->job, &w->database);
    r->seconds_update += now() - start;
    return ok;
}

static bool begin(update_work *w) {
    char *detail = NULL;
    if (!import_database_change(&w->job, &w->database)) return false;
    const int code = store_update_begin(w->database.db, w->job.options->name, &w->store, &w->terrain, &detail);
    if (code == SQLITE_ERROR && detail) { /* of the database, not of SQLite: which terrain, incomplete */
        import_refuse(&w->job, "%s", detail);
        sqlite3_free(detail);
        return false;
    }
    if (code != SQLITE_OK) return fail_store(w, code, detail);
    snprintf(w->report->name, sizeof w->report->name, "%s", w->terrain->name);
    return describe_grid(w);
}

int import_update(const char *const *sources, int count, const char *database, const import_options *options,
                  bool voids, import_update_report *report, char *message, size_t message_size) {
    update_work w = {.job = {options, database, message, message_size}, .voids = voids, .report = report};
    *report = (import_update_report){0};
    if (message && message_size) message[0] = 0;
    GDALAllRegister();
    CPLPushErrorHandler(CPLQuietErrorHandler);
    import_unit unit;
    bool ok = count > 0 || import_refuse(&w.job, "no source to update from");
    if (ok && options->unit && !import_unit_parse(options->unit, &unit))
        ok = import_refuse(&w.job, "the unit '%s' is not m, ft, us-ft or a number of metres", options->unit);
    ok = ok && import_paths_find(&w.job, sources, count, &w.paths) && begin(&w) && put_all(&w) && finish(&w);
    store_update_free(w.store);
    import_database_close(&w.job, &w.database);
    if (w.grid.crs) OSRDestroySpatialReference(w.grid.crs);
    sqlite3_free(w.names);
    import_paths_free(&w.paths);
    CPLPopErrorHandler();
    return ok ? 0 : 1;
}
