/* import.c - the whole: options, sources, plan, probe, a first reading, errors and blocks, the database.
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
        return import_refuse(job, "'%s' is no name for a terrain: 1 to 63 letters, digits, _ . -", o->name);
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
    if (o->jobs < 1 || o->jobs > 1024) return import_refuse(job, "%d jobs: 1 to 1024", o->jobs);
    return true;
}

/* The default name: the file name up to its first dot, with _ for what a name may not have. */
static void name_of(const import_options *o, const import_source *first, char name[64]) {
    if (o->name) {
        snprintf(name, 64, "%s", o->name);
        return;
    }
    size_t n = strcspn(first->base, ".");
    if (n > 63) n = 63;
    memcpy(name, first->base, n);
    name[n] = 0;
    for (size_t i = 0; i < n; i++) {
        char c = name[i];
        bool fine =
            (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
        if (!fine) name[i] = '_';
    }
    if (!n) snprintf(name, 64, "terrain");
}

/* ------------------------------------------------------------------------------------------------ the whole -- */
typedef struct import_work {
    import_job job;
    const import_force *force; /* for tests; NULL */
    import_source *sources;
    int count, described;
    import_mosaic mosaic;
    import_crs crs;
    int k;
    import_plan plan;
    import_pool *pool;
    import_strip all; /* all values, when they are kept */
    import_reader *reader;
    import_coarse coarse;
    import_heights heights;
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

static bool describe(import_work *m, const char *const *paths) {
    m->sources = calloc((size_t)m->count, sizeof *m->sources);
    if (!m->sources) return import_no_memory(&m->job, "describing the sources");
    for (int i = 0; i < m->count; i++) {
        m->described = i + 1;
        if (!import_source_describe(&m->job, paths[i], &m->sources[i])) return false;
    }
    if (!import_mosaic_plan(&m->job, m->sources, m->count, &m->mosaic)) return false;
    if (!import_crs_describe(m->sources[0].crs, &m->crs)) return import_no_memory(&m->job, "describing the CRS");
    m->k = m->job.options->k < m->mosaic.lattice.K ? m->job.options->k : m->mosaic.lattice.K;
    m->cost =
        (rqt_void_cost){.cell = import_crs_cell(&m->crs, &m->mosaic.placement), .c = m->job.options->void_tol};
    return import_plan_make(&m->job, m->sources, m->count, &m->mosaic, m->k, m->force, &m->plan);
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
static bool start_reader(import_work *m) {
    const import_reader_options options = {.sources = m->sources,
                                           .count = m->count,
                                           .mosaic = &m->mosaic,
                                           .all = m->plan.in_memory ? &m->all : NULL,
                                           .strips = m->plan.strips,
                                           .strip_rows = m->plan.strip_rows};
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

static void tell_counts(import_work *m) {
    import_report *report = m->report;
    const import_counts counts = import_reader_counts(m->reader);
    report->samples = sample_count(m);
    report->voids = counts.voids;
    report->overlap = counts.overlap;
    report->overlap_differs = counts.overlap_differs;
    if (report->overlap_differs > 0)
        import_notice(&m->job, "%lld of %lld samples that several sources have differ: the later source won",
                      (long long)report->overlap_differs, (long long)report->overlap);
    if (report->voids == report->samples) import_notice(&m->job, "every sample is void");
}

/* Looks at the samples, the first of which reads them, until it is clear how they become heights. */
static bool choose_heights(import_work *m) {
    const import_kind kind = m->mosaic.kind;
    const import_scheme *scheme = &m->mosaic.scheme;
    import_look look = import_look_begin(kind, scheme);
    import_pass pass = {.pool = m->pool, .reader = m->reader, .keep = m->plan.in_memory, .coarse = &m->coarse};
    import_decision decision = IMPORT_LOOK_AGAIN;
    for (bool first = true; decision == IMPORT_LOOK_AGAIN; first = false) {
        if (!first && !m->plan.in_memory && !start_reader(m)) return false;
        pass.reader = m->reader;
        if (!import_look_at_all(&m->job, &pass, &look)) return false;
        if (first) tell_counts(m);
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
    if (!import_coarse_create(job, &m->mosaic.lattice, m->mosaic.kind, m->plan.b, &m->coarse) || !start_reader(m) ||
        !choose_heights(m))
        return false;
    if (!rqt_unit_is_valid(&m->heights.unit))
        return import_refuse(job, "%s: its unit, scale (%g) and offset (%g) make no heights in metres",
                             m->sources[0].path, m->sources[0].scale, m->sources[0].offset);
    m->report->seconds_read = now() - start;
    return true;
}

/* ----------------------------------------------------------------------------------- errors, blocks, database --
 */
static bool make_blocks(import_work *m) {
    double start = now();
    if (!m->plan.in_memory && !start_reader(m)) return false;
    m->stream = (import_stream){.lattice = m->mosaic.lattice,
                                .cost = m->cost,
                                .k = m->k,
                                .plan = &m->plan,
                                .heights = &m->heights,
                                .has_voids = m->report->voids > 0,
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

/* File names, one a line. */
static char *provenance(const import_work *m) {
    size_t size = 1;
    for (int i = 0; i < m->count; i++) size += strlen(m->sources[i].base) + 1;
    char *text = malloc(size), *end = text;
    for (int i = 0; text && i < m->count; i++) end += sprintf(end, "%s%s", i ? "\n" : "", m->sources[i].base);
    return text;
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

int import_run_forced(const char *const *sources, int count, const char *database, const import_options *options,
                      const import_force *force, import_report *report, char *message, size_t message_size) {
    import_work m = {
        .job = {options, database, message, message_size}, .force = force, .count = count, .report = report};
    *report = (import_report){0};
    if (message && message_size) message[0] = 0;
    GDALAllRegister();
    /* GDAL's words belong into our sentences, not onto the terminal. */
    CPLPushErrorHandler(CPLQuietErrorHandler);
    GIntBig cache = GDALGetCacheMax64();

    bool ok = check_options(&m.job, count) && describe(&m, sources);
    if (ok) name_of(options, &m.sources[0], report->name);
    if (ok) GDALSetCacheMax64(m.plan.gdal_cache);
    ok = ok && import_database_probe(&m.job, report->name) && import_pool_create(&m.job, &m.pool) &&
         read_first(&m) && make_blocks(&m) && write_database(&m);

    import_database_close(&m.job, &m.database);
    import_reader_free(m.reader);
    import_stream_free(&m.stream);
    import_coarse_free(&m.coarse);
    import_pool_free(m.pool);
    free(m.all.values);
    free(m.all.valid);
    import_crs_free(&m.crs);
    import_mosaic_free(&m.mosaic);
    for (int i = 0; i < m.described; i++) import_source_free(&m.sources[i]);
    free(m.sources);
    GDALSetCacheMax64(cache);
    CPLPopErrorHandler();
    return ok ? 0 : 1;
}

int import_run(const char *const *sources, int count, const char *database, const import_options *options,
               import_report *report, char *message, size_t message_size) {
    return import_run_forced(sources, count, database, options, NULL, report, message, message_size);
}
