/* import.c - the whole: options, sources, plan, probe, a first reading, voids, errors and blocks, the database.
 *
 * The order is chosen by price: what can be refused without samples is refused before one is read, and the database
 * is only locked, and only created, when everything that goes into it is there.
 */
#include "source.h"

#include <cpl_conv.h>
#include <cpl_error.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

/* ------------------------------------------------------------------------------ what the parts call back -- */
bool import_refuse(const import_job *job, const char *format, ...) {
    va_list list;
    va_start(list, format);
    if (job->message && job->message_size) vsnprintf(job->message, job->message_size, format, list);
    va_end(list);
    return false;
}

bool import_no_memory(const import_job *job, const char *what) {
    return import_refuse(job, "out of memory while %s", what);
}

void import_notice(const import_job *job, const char *format, ...) {
    if (!job->options->notice) return;
    char sentence[1024];
    va_list list;
    va_start(list, format);
    vsnprintf(sentence, sizeof sentence, format, list);
    va_end(list);
    job->options->notice(job->options->context, sentence);
}

bool import_progress(const import_job *job, const char *stage, double done, int64_t samples) {
    const import_options *o = job->options;
    if (!o->progress || o->progress(o->context, stage, done, samples)) return true;
    return import_refuse(job, "stopped while %s; the database is as it was",
                         !strcmp(stage, "reading")  ? "reading"
                         : !strcmp(stage, "errors") ? "computing errors"
                         : !strcmp(stage, "voids")  ? "filling voids"
                                                    : "writing blocks");
}

static void *resize(void *context, void *p, size_t bytes) {
    (void)context;
    if (bytes) return realloc(p, bytes);
    free(p);
    return NULL;
}

const rqt_allocator *import_allocator(void) {
    static const rqt_allocator allocator = {resize, NULL};
    return &allocator;
}

const char *import_gdal_version(void) {
    return GDALVersionInfo("RELEASE_NAME");
}

void import_options_init(import_options *options) {
    long cores = sysconf(_SC_NPROCESSORS_ONLN), pages = sysconf(_SC_PHYS_PAGES), page = sysconf(_SC_PAGE_SIZE);
    int64_t half = pages > 0 && page > 0 ? (int64_t)pages * page / 2 : INT64_MAX;
    *options = (import_options){.k = 7,
                                .void_tol = 1,
                                .jobs = cores < 1    ? 1
                                        : cores > 64 ? 64
                                                     : (int)cores,
                                .memory = half < (int64_t)4 << 30 ? half : (int64_t)4 << 30};
}

/* ------------------------------------------------------------------------------------------------- options -- */
static bool check_options(const import_job *job, int count) {
    const import_options *o = job->options;
    import_unit unit;
    if (count < 1) return import_refuse(job, "no source to import");
    if (o->name && !store_name_is_valid(o->name))
        return import_refuse(job, "'%s' is no name for a terrain: 1 to 63 letters, digits, _ . -, but not . or ..",
                             o->name);
    if (o->k < 1 || o->k > RQT_MAX_BLOCK_K)
        return import_refuse(job, "blocks of 2^%d + 1 samples a side: the exponent is 1 to %d", o->k,
                             RQT_MAX_BLOCK_K);
    if (o->unit && !import_unit_parse(o->unit, &unit))
        return import_refuse(job, "the unit '%s' is not m, ft, us-ft or a number of metres", o->unit);
    if (!(o->quantum >= 0 && o->quantum < 1e9))
        return import_refuse(job, "a quantum of %g is no height step: a positive number", o->quantum);
    if (!(o->void_tol > 0 && isfinite(o->void_tol)))
        return import_refuse(job, "a void tolerance of %g: a positive number of metres per metre of eps",
                             o->void_tol);
    if (o->fill < 0 || o->fill > IMPORT_MOST_FILL)
        return import_refuse(job, "voids of radius %d cannot be filled: 0 to %d", o->fill, IMPORT_MOST_FILL);
    if (o->has_sea && !isfinite(o->sea)) return import_refuse(job, "the sea lies at a finite number of metres");
    if (o->jobs < 1 || o->jobs > 1024) return import_refuse(job, "%d jobs: 1 to 1024", o->jobs);
    return true;
}

/* The default name: the first source's file name up to its first dot, with _ for what a name may not have. */
static bool name_of(const import_job *job, const char *first, char name[64]) {
    if (job->options->name) {
        snprintf(name, 64, "%s", job->options->name);
        return true;
    }
    char *base = import_base_of(first);
    if (!base) return import_no_memory(job, "naming the terrain");
    size_t n = strcspn(base, ".");
    if (n > 63) n = 63;
    memcpy(name, base, n);
    name[n] = 0;
    free(base);
    for (size_t i = 0; i < n; i++) {
        char c = name[i];
        bool fine =
            (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
        if (!fine) name[i] = '_';
    }
    if (!n) snprintf(name, 64, "terrain");
    return true;
}

/* ------------------------------------------------------------------------------------------------ the whole -- */
typedef struct import_work {
    import_job job;
    const import_force *force; /* for tests; NULL */
    import_paths paths;
    import_source *sources;
    int count; /* that are described */
    import_mosaic mosaic;
    import_cover cover;
    import_conflicts conflicts;
    import_crs crs;
    int k;
    import_plan plan;
    import_pool *pool;
    import_strip all; /* all values, when they are kept */
    char *spool_path;
    import_spool *spool; /* NULL: all is read once and kept */
    import_reader *reader;
    import_coarse coarse;
    import_heights heights;
    import_fill *fill; /* NULL: voids stay */
    rqt_void_cost cost;
    import_stream stream;
    import_database database;
    import_report *report;
} import_work;

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + (double)t.tv_nsec * 1e-9;
}

static int64_t sample_count(const import_work *m) {
    return (int64_t)m->mosaic.lattice.width * m->mosaic.lattice.height;
}

/* Folders and lists become rasters, and rasters descriptions. */
static bool describe_all(import_work *m, const char *const *arguments, int count) {
    import_paths *paths = &m->paths;
    if (!import_paths_find(&m->job, arguments, count, paths)) return false;
    m->sources = calloc((size_t)paths->count + 1, sizeof *m->sources);
    if (!m->sources) return import_no_memory(&m->job, "describing the sources");
    for (int i = 0; i < paths->count; i++) {
        import_source *s = &m->sources[m->count];
        if (import_paths_describe(&m->job, paths, i, s)) {
            if (m->count++) import_source_share_crs(s, &m->sources[0]);
        } else if (!paths->path[i].passed) {
            return false;
        }
    }
    import_paths_tell_passed(&m->job, paths);
    return m->count > 0 || import_refuse(&m->job, "%s holds no raster of one band", arguments[0]);
}

/* The report replaces a file: not one that is read, nor the database, which may not be there yet. That it cannot be
 * written is said before the sources are read, which may take hours, and not after. */
static bool check_report(const import_work *m) {
    const char *report = m->job.options->report;
    if (!report) return true;
    bool same = import_is_same_file(report, m->job.database);
    for (int i = 0; i < m->count && !same; i++) same = import_is_same_file(report, m->sources[i].path);
    if (same) return import_refuse(&m->job, "%s is the database or a source, and cannot be the report too", report);
    return import_findings_probe(&m->job);
}

static bool describe(import_work *m, const char *const *arguments, int count) {
    if (!describe_all(m, arguments, count)) return false;
    m->report->sources = m->count;
    if (!import_mosaic_plan(&m->job, m->sources, m->count, &m->mosaic)) return false;
    if (!import_cover_find(&m->job, m->sources, m->count, &m->mosaic, &m->cover)) return false;
    if (!import_crs_describe(m->sources[0].crs, &m->crs)) return import_no_memory(&m->job, "describing the CRS");
    m->k = m->job.options->k < m->mosaic.lattice.K ? m->job.options->k : m->mosaic.lattice.K;
    m->cost =
        (rqt_void_cost){.cell = import_crs_cell(&m->crs, &m->mosaic.placement), .c = m->job.options->void_tol};
    if (!check_report(m)) return false;
    m->spool_path = import_spool_path(m->job.database, m->report->name);
    if (!m->spool_path) return import_no_memory(&m->job, "opening the resume file");
    /* What an earlier run has read is used, whatever fits in memory now. */
    const bool spools = m->job.options->resumable || access(m->spool_path, F_OK) == 0;
    return import_plan_make(&m->job, m->sources, m->count, &m->mosaic, m->k, spools, m->force, &m->plan);
}

/* ------------------------------------------------------------------------------------------ the resume file -- */
/* What the sources are, for the resume file to compare. */
static import_spool_key *keys_of(const import_work *m) {
    import_spool_key *keys = calloc((size_t)m->count, sizeof *keys);
    for (int i = 0; keys && i < m->count; i++) {
        const import_source *s = &m->sources[i];
        const rqt_unit unit = import_source_unit(s);
        const int64_t whole[] = {
            m->mosaic.column[i], m->mosaic.row[i], s->width,         s->height,          s->type,
            s->flip_rows,        s->flip_columns,  s->has_nodata,    s->nodata_integer,  s->has_mask,
            s->is_signed_byte,   unit.numerator,   unit.denominator, m->mosaic.is_metres};
        const double real[] = {s->has_nodata ? s->nodata : 0, unit.scale, unit.offset};
        uint64_t place = import_mix(0, s->opened, strlen(s->opened));
        place = import_mix(import_mix(place, whole, sizeof whole), real, sizeof real);
        keys[i] = (import_spool_key){place, s->content, m->mosaic.row[i], 0};
    }
    return keys;
}

static bool open_spool(import_work *m) {
    const import_options *o = m->job.options;
    if (!m->plan.spools) return true;
    const double nodata[2] = {o->has_nodata, o->has_nodata ? o->nodata : 0};
    const import_spool_grid grid = {.kind = m->mosaic.kind,
                                    .width = m->mosaic.lattice.width,
                                    .height = m->mosaic.lattice.height,
                                    .strip_rows = m->plan.strip_rows,
                                    .sources = m->count,
                                    .options = import_mix(0, nodata, sizeof nodata)};
    import_spool_key *keys = keys_of(m);
    const bool ok = keys ? import_spool_open(&m->job, m->spool_path, &grid, keys, &m->spool)
                         : import_no_memory(&m->job, "opening the resume file");
    free(keys);
    if (ok && import_spool_found(m->spool) > 0)
        import_notice(&m->job, "goes on after row %lld of %d: what was read before is in %s",
                      (long long)import_spool_found(m->spool) * m->plan.strip_rows <= grid.height
                          ? (long long)import_spool_found(m->spool) * m->plan.strip_rows
                          : (long long)grid.height,
                      grid.height, m->spool_path);
    return ok;
}

/* An import that ends before its time says what is left of it. */
static void tell_spool(import_work *m, bool kept) {
    char *said = kept && m->job.message ? strdup(m->job.message) : NULL;
    if (said)
        import_refuse(&m->job, "%s; what was read is in %s: the same command goes on from there", said,
                      m->spool_path);
    free(said);
}

static void tell_extreme(const import_work *m, double value, int64_t times) {
    const rqt_unit unit = import_source_unit(&m->sources[0]);
    double raw = m->mosaic.is_metres ? (value - unit.offset) / rqt_unit_factor(&unit) : value;
    import_notice(
        &m->job,
        "%lld samples have the value %.10g, which stands apart from all others: if it marks voids, import "
        "again with --nodata %.10g",
        (long long)times, raw, raw);
}

/* ------------------------------------------------------------------------------------------ first reading -- */
static bool start_reader(import_work *m, bool first) {
    const import_reader_options options = {.sources = m->sources,
                                           .count = m->count,
                                           .mosaic = &m->mosaic,
                                           .all = m->plan.in_memory ? &m->all : NULL,
                                           .strips = m->plan.strips,
                                           .strip_rows = m->plan.strip_rows,
                                           .spool = m->spool,
                                           .conflicts = first ? &m->conflicts : NULL};
    import_reader_free(m->reader);
    m->reader = NULL;
    return import_reader_start(&m->job, &options, &m->reader);
}

static bool take_all(import_work *m) {
    const rqt_lattice *l = &m->mosaic.lattice;
    const size_t n = (size_t)sample_count(m);
    m->all = (import_strip){.kind = m->mosaic.kind, .width = l->width, .rows = l->height};
    m->all.values = malloc(n * import_kind_bytes(m->mosaic.kind));
    m->all.valid = malloc(n);
    return (m->all.values && m->all.valid) || import_no_memory(&m->job, "reading the sources");
}

static bool tell_counts(import_work *m) {
    import_report *report = m->report;
    const import_counts counts = import_reader_counts(m->reader);
    report->samples = sample_count(m);
    report->voids = counts.voids;
    report->overlap = counts.overlap;
    report->overlap_differs = counts.overlap_differs;
    report->samples_read = counts.samples;
    report->samples_resumed = counts.resumed;
    report->spooled = m->spool ? (int64_t)import_spool_bytes(m->spool) : 0;
    const import_findings findings = {.sources = m->sources,
                                      .count = m->count,
                                      .mosaic = &m->mosaic,
                                      .crs = &m->crs,
                                      .cover = &m->cover,
                                      .conflicts = &m->conflicts,
                                      .report = report};
    import_findings_tell(&m->job, &findings);
    if (report->voids == report->samples) import_notice(&m->job, "every sample is void");
    return import_findings_write(&m->job, &findings);
}

/* Looks at the samples, the first of which reads them, until it is clear how they become heights. */
static bool choose_heights(import_work *m) {
    const import_kind kind = m->mosaic.kind;
    const import_scheme *scheme = &m->mosaic.scheme;
    import_look look = import_look_begin(kind, scheme);
    import_pass pass = {.pool = m->pool, .reader = m->reader, .keep = m->plan.in_memory, .coarse = &m->coarse};
    import_decision decision = IMPORT_LOOK_AGAIN;
    for (bool first = true; decision == IMPORT_LOOK_AGAIN; first = false) {
        if (!first && !m->plan.in_memory && !start_reader(m, false)) return false;
        pass.reader = m->reader;
        if (!import_look_at_all(&m->job, &pass, &look)) return false;
        if (first && !tell_counts(m)) return false;
        decision = import_decide(&m->job, kind, scheme, &look, &m->heights);
        if (first && import_survey_min_is_suspicious(&look.survey))
            tell_extreme(m, look.survey.min, look.survey.min_count);
        if (first && import_survey_max_is_suspicious(&look.survey))
            tell_extreme(m, look.survey.max, look.survey.max_count);
        pass.coarse = NULL;
        if (m->plan.in_memory) pass.all = &m->all;
    }
    return decision == IMPORT_DECIDED;
}

static bool read_first(import_work *m) {
    const import_job *job = &m->job;
    double start = now();
    if (!import_progress(job, "reading", 0, sample_count(m))) return false;
    if (m->plan.in_memory && !take_all(m)) return false;
    if (!import_coarse_create(job, &m->mosaic.lattice, m->mosaic.kind, m->plan.b, &m->coarse) ||
        !start_reader(m, true) || !choose_heights(m))
        return false;
    if (!rqt_unit_is_valid(&m->heights.unit))
        return import_refuse(job, "%s: its unit, scale (%g) and offset (%g) make no heights in metres",
                             m->sources[0].path, m->sources[0].scale, m->sources[0].offset);
    m->report->seconds_read = now() - start;
    return true;
}

/* ------------------------------------------------------------------------------------------------------ voids --
 */
/* Metres of the sea as a height. */
static bool choose_sea(import_work *m, int32_t *sea) {
    const import_heights *h = &m->heights;
    const double metres = m->job.options->sea, factor = rqt_unit_factor(&h->unit);
    const double value = (metres - h->unit.offset) / factor,
                 q = nearbyint((value - (double)h->unit.z0) * h->unit.d);
    if (!(fabs(q) < RQT_HEIGHT_LIMIT))
        return import_refuse(&m->job, "the sea at %.10g m is too far from the terrain's heights", metres);
    *sea = (int32_t)q;
    const double real = ((double)h->unit.z0 + q / h->unit.d) * factor + h->unit.offset;
    if (fabs(real - metres) > 1e-9 * fmax(1, fabs(metres)))
        import_notice(&m->job, "the sea lies at %.10g m: the terrain's heights are steps of %.10g m", real,
                      fabs(factor) / h->unit.d);
    return true;
}

static bool fill_strip(import_work *m, const import_strip *strip, double *values, int32_t *q) {
    const size_t width = (size_t)strip->width;
    for (int32_t y = 0; y < strip->rows; y++) {
        const size_t at = (size_t)y * width;
        import_quantise(strip, at, width, &m->heights.steps, values, q);
        if (!import_fill_row(&m->job, m->fill, q, strip->valid + at)) return false;
    }
    return import_progress(&m->job, "voids", (double)(strip->first_row + strip->rows) / m->mosaic.lattice.height,
                           sample_count(m));
}

/* All samples once more, for voids that are to become heights. */
static bool fill_all(import_work *m) {
    const rqt_lattice *l = &m->mosaic.lattice;
    double *values = malloc((size_t)l->width * sizeof *values);
    int32_t *q = malloc((size_t)l->width * sizeof *q);
    bool ok = (values && q) || import_no_memory(&m->job, "filling voids");
    if (ok && !m->plan.in_memory) ok = start_reader(m, false);
    if (ok && m->plan.in_memory) ok = fill_strip(m, &m->all, values, q);
    for (int32_t end = 0; ok && !m->plan.in_memory && end < l->height;) {
        const import_strip *strip = import_reader_next(m->reader);
        ok = strip && fill_strip(m, strip, values, q);
        if (!ok) break;
        end = strip->first_row + strip->rows;
        import_reader_release(m->reader);
    }
    free(values);
    free(q);
    return ok && import_fill_end(&m->job, m->fill);
}

static bool fill_voids(import_work *m) {
    const import_options *o = m->job.options;
    import_report *r = m->report;
    import_heights *h = &m->heights;
    if (!r->voids || !(o->fill || o->has_sea)) return true;
    double start = now();
    import_fill_options options = {.width = m->mosaic.lattice.width,
                                   .height = m->mosaic.lattice.height,
                                   .radius = o->fill,
                                   .sea = o->has_sea,
                                   .memory = m->plan.fill};
    if (o->has_sea && !choose_sea(m, &options.sea_q)) return false;
    if (!import_fill_create(&m->job, &options, &m->fill) || !fill_all(m)) return false;
    r->filled = import_fill_filled(m->fill);
    r->sea = import_fill_sea(m->fill);
    const bool none = r->voids == r->samples;
    r->voids -= r->filled + r->sea;
    if (r->sea && (none || options.sea_q < h->min_q)) h->min_q = options.sea_q;
    if (r->sea && (none || options.sea_q > h->max_q)) h->max_q = options.sea_q;
    r->seconds_read += now() - start;
    return true;
}

/* ----------------------------------------------------------------------------------- errors, blocks, database --
 */
static bool make_blocks(import_work *m) {
    double start = now();
    if (!m->plan.in_memory && !start_reader(m, false)) return false;
    m->stream = (import_stream){.lattice = m->mosaic.lattice,
                                .cost = m->cost,
                                .k = m->k,
                                .plan = &m->plan,
                                .heights = &m->heights,
                                .has_voids = m->report->voids > 0,
                                .fill = m->fill,
                                .pool = m->pool,
                                .coarse = &m->coarse,
                                .all = m->plan.in_memory ? &m->all : NULL,
                                .reader = m->reader};
    bool ok = import_stream_run(&m->job, &m->stream);
    /* What only the way here needed makes room for SQLite. */
    import_reader_free(m->reader);
    m->reader = NULL;
    free(m->all.values);
    free(m->all.valid);
    m->all = (import_strip){0};
    m->report->seconds_errors = now() - start;
    return ok;
}

static bool minimal_progress(void *context, double done) {
    const import_work *m = context;
    return import_progress(&m->job, "minimal errors", done, sample_count(m));
}

static bool write_minimal(import_work *m) {
    char *detail = NULL;
    const int code = store_write_minimal(m->database.db, m->report->name, minimal_progress, m, &detail);
    if (code == SQLITE_INTERRUPT) return false;
    return code == SQLITE_OK || import_database_refuse(&m->job, code, detail);
}

/* What was named, one a line; of a folder and of a list also how many rasters it stands for. */
static char *provenance(const import_work *m) {
    const import_paths *p = &m->paths;
    char *text = NULL;
    size_t size = 0;
    bool whole = true;
    FILE *out = open_memstream(&text, &size);
    for (int a = 0, i = 0; out && a < p->arguments; a++) {
        int rasters = 0;
        bool itself = false;
        for (; i < p->count && p->path[i].argument == a; i++, rasters += !p->path[i - 1].passed)
            itself = !p->path[i].line && !p->path[i].found;
        char *base = import_base_of(p->argument[a]);
        whole = whole && base;
        fprintf(out, "%s%s", a ? "\n" : "", base ? base : "");
        if (!itself) fprintf(out, " (%d raster%s)", rasters, rasters == 1 ? "" : "s");
        free(base);
    }
    if (out && !fclose(out) && whole) return text;
    free(text);
    return NULL;
}

/* What was filled, into its table. */
static bool write_fill(import_work *m, store_writer *writer) {
    import_fill_reader *reader = NULL;
    import_fill_run run;
    bool failed = false, ok = import_fill_reader_create(&m->job, m->fill, &reader);
    while (ok && import_fill_next(&m->job, reader, &run, &failed)) {
        char *detail = NULL;
        const int code =
            store_writer_fill(writer, run.row, run.first, run.last, run.sea ? STORE_SEA : STORE_FILLED, &detail);
        ok = code == SQLITE_OK || import_database_refuse(&m->job, code, detail);
    }
    import_fill_reader_free(reader);
    return ok && !failed;
}

static bool write_terrain(import_work *m, store_terrain *info) {
    const import_job *job = &m->job;
    store_writer *writer = NULL;
    char *detail = NULL;
    bool ok = import_database_begin(job, m->k, m->plan.page_cache, &m->database);
    if (ok) {
        int code = store_writer_begin(m->database.db, info, job->options->replace, &writer, &detail);
        if (code != SQLITE_OK) ok = import_database_refuse(job, code, detail);
    }
    ok = ok && import_write(job, &m->stream, writer, m->report);
    if (ok && m->fill) ok = write_fill(m, writer);
    if (ok) {
        const rqt_code max_error = m->stream.build ? rqt_build_max_error(m->stream.build) : 0;
        int code = store_writer_finish(writer, max_error, &detail);
        if (code != SQLITE_OK) ok = import_database_refuse(job, code, detail);
    }
    store_writer_free(writer);
    if (ok && job->options->minimal) ok = write_minimal(m);
    return ok && import_database_commit(job, &m->database);
}

static bool write_database(import_work *m) {
    double start = now();
    char created[32];
    time_t seconds = time(NULL);
    struct tm utc;
    gmtime_r(&seconds, &utc);
    strftime(created, sizeof created, "%Y-%m-%dT%H:%M:%SZ", &utc);
    store_terrain info = {.lattice = m->mosaic.lattice,
                          .k = m->k,
                          .placement = m->mosaic.placement,
                          .unit = m->heights.unit,
                          .quantum_error = m->heights.quantum_error,
                          .cost = m->cost,
                          .srid = m->crs.srid,
                          .lonlat = m->crs.lonlat,
                          .wgs84 = m->crs.wgs84,
                          .crs = m->crs.wkt,
                          .vertical = m->crs.vertical,
                          .source = provenance(m),
                          .created = created,
                          .voids = m->report->voids,
                          .min_q = m->heights.min_q,
                          .max_q = m->heights.max_q};
    memcpy(info.name, m->report->name, sizeof info.name);
    bool ok = info.source ? write_terrain(m, &info) : import_no_memory(&m->job, "naming the sources");
    free(info.source);
    m->report->seconds_blocks = now() - start;
    return ok;
}

#define READDIR "GDAL_DISABLE_READDIR_ON_OPEN"
#define POOL "GDAL_MAX_DATASET_POOL_SIZE"

/* For each dataset GDAL reads its whole folder, to see what stands beside; among thousands of tiles it does better
 * to ask for the names that it looks for. And a VRT keeps a hundred tiles open, if it may. What the user has set
 * stays. begin: or put back. */
static void tune_gdal(const char *const *sources, int count, bool begin, bool set[2]) {
    bool many = count > 32;
    for (int i = 0; i < count && !many; i++) many = *sources[i] == '@' || import_is_folder(sources[i]);
    if (begin) {
        set[0] = many && !CPLGetConfigOption(READDIR, NULL);
        set[1] = !CPLGetConfigOption(POOL, NULL);
    }
    char most[16];
    snprintf(most, sizeof most, "%d", import_reading_most_open() < 100 ? import_reading_most_open() : 100);
    if (set[0]) CPLSetConfigOption(READDIR, begin ? "TRUE" : NULL);
    if (set[1]) CPLSetConfigOption(POOL, begin ? most : NULL);
}

int import_run_forced(const char *const *sources, int count, const char *database, const import_options *options,
                      const import_force *force, import_report *report, char *message, size_t message_size) {
    import_work m = {.job = {options, database, message, message_size}, .force = force, .report = report};
    *report = (import_report){0};
    if (message && message_size) message[0] = 0;
    GDALAllRegister();
    /* GDAL's words belong into our sentences, not onto the terminal. */
    CPLPushErrorHandler(CPLQuietErrorHandler);
    GIntBig cache = GDALGetCacheMax64();
    bool tuned[2];
    tune_gdal(sources, count, true, tuned);

    bool ok =
        check_options(&m.job, count) && name_of(&m.job, sources[0], report->name) && describe(&m, sources, count);
    if (ok) GDALSetCacheMax64(m.plan.gdal_cache);
    ok = ok && import_database_probe(&m.job, report->name) && open_spool(&m) &&
         import_pool_create(&m.job, &m.pool) && read_first(&m) && fill_voids(&m) && make_blocks(&m) &&
         write_database(&m);

    import_database_close(&m.job, &m.database);
    import_reader_free(m.reader);
    tell_spool(&m, import_spool_close(m.spool, !ok));
    free(m.spool_path);
    import_stream_free(&m.stream);
    import_coarse_free(&m.coarse);
    import_fill_free(m.fill);
    import_pool_free(m.pool);
    free(m.all.values);
    free(m.all.valid);
    import_crs_free(&m.crs);
    import_conflicts_free(&m.conflicts);
    import_cover_free(&m.cover);
    import_mosaic_free(&m.mosaic);
    for (int i = 0; i < m.count; i++) import_source_free(&m.sources[i]);
    free(m.sources);
    import_paths_free(&m.paths);
    GDALSetCacheMax64(cache);
    tune_gdal(sources, count, false, tuned);
    CPLPopErrorHandler();
    return ok ? 0 : 1;
}

int import_run(const char *const *sources, int count, const char *database, const import_options *options,
               import_report *report, char *message, size_t message_size) {
    return import_run_forced(sources, count, database, options, NULL, report, message, message_size);
}
