/* plan.c - bytes for everything, within the memory that the user allows.
 *
 * When all values fit, they are read once and kept. Else they are read twice, the second time from the resume file,
 * and of the raster only two bands, a few strips and the coarse lattice are in memory. The larger the tiles, the
 * less work and the more memory; the first of these choices that fits is taken, and what is left then goes where it
 * saves a file or a wait.
 *
 * Counted is the worst case: everything that any moment of the import may hold at once.
 */
#include "source.h"
#include "spool.h"

#include <math.h>

#define MIB ((int64_t)1 << 20)
#define BEST_B 8              /* tiles of 256: 128 and 512 are as fast, within what a busy machine can tell */
#define STRIP_BYTES (4 * MIB) /* of values that are read at once */
#define LEAST_CACHE (8 * MIB) /* of GDAL's */
#define LEAST_PAGES (4 * MIB) /* of SQLite's */
#define MOST_PAGES (32 * MIB)
#define MOST_STAGE (512 * MIB)
#define MOST_STRIP 256 /* rows */
#define FILL_NOTES (8 * MIB)
#define SOURCE_BYTES 1024 /* its description, with its names */

typedef struct needs {
    const import_job *job;
    const import_source *sources;
    int count;
    const import_mosaic *mosaic;
    int k;
    bool spools;
} needs;

static int64_t row_bytes(const needs *n) {
    return (int64_t)n->mosaic->lattice.width * (int64_t)(import_kind_bytes(n->mosaic->kind) + 1);
}

/* Bytes of the lattice that the build keeps in its scratch: 8 a vertex, every 2^(b-k+1)-th of every such row. */
static int64_t kept_bytes(const needs *n, int b) {
    const rqt_lattice *l = &n->mosaic->lattice;
    const int64_t across = ((((int64_t)l->width - 1) >> b) + 1) << n->k,
                  down = ((((int64_t)l->height - 1) >> b) + 1) << n->k;
    return b < l->K ? (across / 2 + 2) * (down / 2 + 2) * 8 : 0;
}

/* The same for any memory: a resume file is of strips. */
static int32_t strip_rows(const needs *n) {
    const int64_t rows = STRIP_BYTES / row_bytes(n), most = n->mosaic->lattice.height;
    const int64_t chosen = rows < 1 ? 1 : rows > MOST_STRIP ? MOST_STRIP : rows;
    return (int32_t)(chosen < most ? chosen : most);
}

/* A plan for tiles of this size with as little of everything else as will do. */
static import_plan least(const needs *n, bool in_memory, int b) {
    import_plan p = {.in_memory = in_memory, .b = b, .strip_rows = strip_rows(n), .strips = 2};
    p.spools = n->spools || !in_memory;
    p.fill = n->job->options->fill || n->job->options->has_sea ? (uint64_t)FILL_NOTES : 0;
    const int64_t cache = import_reading_cache(n->sources, n->count, n->mosaic, p.strip_rows);
    p.gdal_cache = cache + cache / 8 + LEAST_CACHE;
    p.page_cache = LEAST_PAGES;
    p.stage = p.kept = 0;
    return p;
}

/* All that a plan takes. */
static int64_t bytes_of(const needs *n, const import_plan *p) {
    const rqt_lattice *l = &n->mosaic->lattice;
    const int64_t samples = (int64_t)l->width * l->height;
    const int jobs = n->job->options->jobs;
    const rqt_sweep_plan sweep = {.lattice = *l,
                                  .unit = {.d = 1, .numerator = 1, .denominator = 1, .scale = 1},
                                  .cost = {1, 1},
                                  .min_q = -RQT_HEIGHT_LIMIT + 1,
                                  .max_q = RQT_HEIGHT_LIMIT - 1,
                                  .has_voids = true,
                                  .b = p->b,
                                  .workers = jobs};
    const int64_t kind = (int64_t)import_kind_bytes(n->mosaic->kind);
    int64_t bytes = IMPORT_PROCESS_BYTES + p->page_cache + (int64_t)(p->stage + p->kept);
    bytes += p->in_memory ? samples * (kind + 1) : p->strips * p->strip_rows * row_bytes(n);
    /* A small raster does not fill GDAL's cache. */
    const int64_t raster = samples * kind;
    bytes += p->gdal_cache < raster ? p->gdal_cache : raster;
    bytes += (int64_t)import_reading_bytes(n->sources, n->count, n->mosaic, p->strip_rows);
    bytes += (int64_t)import_coarse_bytes(l, n->mosaic->kind, p->b);
    if (p->spools) bytes += (int64_t)spool_codec_bytes(n->mosaic->kind, l->width, p->strip_rows);
    if (p->fill)
        bytes += (int64_t)(p->fill + import_fill_bytes(l->width, n->job->options->fill)) + row_bytes(n) * 2;
    bytes += (int64_t)n->count * SOURCE_BYTES;
    bytes += (int64_t)rqt_sweep_bytes(&sweep) + (int64_t)rqt_build_bytes(l, n->k, p->b);
    bytes += (int64_t)import_stage_bytes(l, n->k);
    if (n->job->options->minimal) bytes += (int64_t)store_minimal_bytes(l, n->k, true);
    bytes += jobs * ((int64_t)import_stream_thread_bytes(n->k) + (int64_t)sizeof(double) * l->width);
    return bytes;
}

/* What is left: first so that reading can run a band ahead, then pages of SQLite, then blocks and the kept lattice.
 */
static void spend(const needs *n, import_plan *p, int64_t left) {
    const int64_t strip = p->strip_rows * row_bytes(n);
    const int64_t band = (((int64_t)1 << p->b) + p->strip_rows - 1) / p->strip_rows + 1;
    if (!p->in_memory && band > p->strips) {
        const int64_t more = left / 2 / strip < band - p->strips ? left / 2 / strip : band - p->strips;
        p->strips += (int)more;
        left -= more * strip;
    }
    const int64_t pages = left / 3 < MOST_PAGES - LEAST_PAGES ? left / 3 : MOST_PAGES - LEAST_PAGES;
    p->page_cache += pages;
    left -= pages;
    const int64_t kept = kept_bytes(n, p->b) / MIB * MIB + MIB;
    if (kept <= left / 2) {
        p->kept = (uint64_t)kept;
        left -= kept;
    }
    p->stage = (uint64_t)(left < MOST_STAGE ? left : MOST_STAGE);
}

static void apply(const import_force *f, import_plan *p) {
    if (f->strip_rows > 0) p->strip_rows = f->strip_rows;
    if (f->strips > 0) p->strips = f->strips;
    if (f->stage >= 0) p->stage = (uint64_t)f->stage;
    if (f->kept >= 0) p->kept = (uint64_t)f->kept;
}

/* Minimal errors need everything in memory. */
static bool check_minimal(const needs *n) {
    const rqt_lattice *l = &n->mosaic->lattice;
    if (!n->job->options->minimal) return true;
    const double minimal = (double)store_minimal_bytes(l, n->k, true), allowed = (double)STORE_METHOD_MEMORY;
    return minimal <= allowed ||
           import_refuse(n->job,
                         "%d x %d samples: their minimal errors take %.0f MiB of memory, and %.0f are allowed; "
                         "import without --minimal",
                         l->width, l->height, ceil(minimal / (double)MIB), allowed / (double)MIB);
}

bool import_plan_make(const import_job *job, const import_source *sources, int count, const import_mosaic *mosaic,
                      int k, bool spools, const import_force *force, import_plan *plan) {
    const needs n = {job, sources, count, mosaic, k, spools};
    const int K = mosaic->lattice.K, lowest = k > 1 ? k : 1;
    int highest = BEST_B > lowest ? BEST_B : lowest, from = lowest;
    if (highest > K) highest = K;
    if (force && force->b) highest = from = force->b;
    int64_t smallest = INT64_MAX;
    if (!check_minimal(&n)) return false;
    for (int way = 0; way < 2; way++) {
        const bool in_memory = way == 0;
        if (force && (in_memory ? force->two_readings : force->in_memory)) continue;
        for (int b = highest; b >= from || b == highest; b--) {
            *plan = least(&n, in_memory, b);
            const int64_t bytes = bytes_of(&n, plan);
            if (bytes < smallest) smallest = bytes;
            if (bytes > job->options->memory) continue;
            spend(&n, plan, job->options->memory - bytes);
            if (force) apply(force, plan);
            return true;
        }
    }
    return import_refuse(job, "%d x %d samples need %.0f MiB of memory to import; --memory allows %.0f",
                         mosaic->lattice.width, mosaic->lattice.height, ceil((double)smallest / (double)MIB),
                         floor((double)job->options->memory / (double)MIB));
}
