/* stream.c - heights -> saturated errors -> encoded blocks, band by band, all on the threads of the pool.
 *
 * Of a raster of any height two bands are in memory (core: rqt_sweep). For each band in turn: its heights are put
 * where the sweep wants them, its tiles are swept, and the tiles of the band before, which is final now, are cut
 * into blocks (core: rqt_build), encoded and put down (stage.c). The next rows are read meanwhile, by the reader's
 * own thread. Blocks coarser than a tile follow at the end. What a block holds depends on the samples alone, so the
 * tables are the same bytes for any number of threads, any size of tiles, and one reading or two.
 */
#include "parts.h"

#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#define ROWS_PER_ITEM 16

typedef struct tools { /* of one thread */
    rqt_codec *codec;
    rqt_block block;
    uint8_t *bytes;
    double *row;
} tools;

typedef struct streaming {
    const import_job *job;
    import_stream *s;
    tools *tools;
    double quantum;
    pthread_mutex_t lock;
    rqt_status failed;
    import_fill_reader *filled; /* NULL: nothing is */
    /* the task of the moment */
    rqt_band band;
    int level;
    const import_strip *strip; /* rows from `from` on go to q and valid */
    int32_t from, rows;
    int32_t *q;
    uint8_t *valid;
} streaming;

size_t import_stream_thread_bytes(int k) {
    /* A codec holds a payload and its compressed form, and zstd's tables: taken as four blocks and 4 MiB. */
    return rqt_block_bytes(k) + 4 * rqt_block_bound(k) + ((size_t)4 << 20);
}

static int64_t sample_count(const import_stream *s) {
    return (int64_t)s->lattice.width * s->lattice.height;
}

static void note_failure(streaming *w, rqt_status status) {
    pthread_mutex_lock(&w->lock);
    if (w->failed == RQT_OK) w->failed = status;
    pthread_mutex_unlock(&w->lock);
}

/* Has another item of this task failed? Then there is no use in going on. */
static bool has_failed(streaming *w) {
    pthread_mutex_lock(&w->lock);
    const bool failed = w->failed != RQT_OK;
    pthread_mutex_unlock(&w->lock);
    return failed;
}

/* Did the task that just ended go well? */
static bool went_well(const streaming *w) {
    switch (w->failed) {
    case RQT_OK:
        return true;
    case RQT_NO_MEMORY:
        return import_no_memory(w->job, "making blocks");
    case RQT_INTERRUPTED: /* a block could not be put down */
        return import_scratch_refuse(w->job, import_stage_scratch(w->s->stage));
    case RQT_READ_FAILED:
        return import_scratch_refuse(w->job, w->s->kept);
    default:
        return import_refuse(w->job, "blocks cannot be made (status %d)", (int)w->failed);
    }
}

/* -------------------------------------------------------------------------------------------------- blocks -- */
typedef struct maker {
    streaming *w;
    tools *tools;
    rqt_status failed;
} maker;

/* A block is made: encode it and put it down. */
static bool keep_block(void *context, rqt_block_number number, const rqt_summary *summary, const rqt_block *block) {
    maker *m = context;
    size_t size;
    /* NOLINTNEXTLINE(clang-analyzer-core.NullDereference): every worker has its tools */
    m->failed = rqt_block_encode(m->tools->codec, block, m->w->quantum, m->tools->bytes, &size);
    return m->failed == RQT_OK && import_stage_put(m->w->s->stage, number, summary, m->tools->bytes, size);
}

static void note_made(streaming *w, const maker *m, rqt_status status) {
    if (status == RQT_INTERRUPTED && m->failed != RQT_OK) status = m->failed;
    if (status != RQT_OK) note_failure(w, status);
}

static void build_tile(void *context, int worker, int32_t tile) {
    streaming *w = context;
    maker m = {.w = w, .tools = &w->tools[worker]};
    if (has_failed(w)) return;
    note_made(w, &m, rqt_build_tile(w->s->build, &w->band, tile, &m.tools->block, keep_block, &m));
}

static void build_coarse(void *context, int worker, int32_t cell) {
    streaming *w = context;
    maker m = {.w = w, .tools = &w->tools[worker]};
    if (has_failed(w)) return;
    note_made(w, &m, rqt_build_coarse(w->s->build, w->s->sweep, w->level, cell, &m.tools->block, keep_block, &m));
}

static bool build_band(streaming *w, int32_t band) {
    w->band = rqt_sweep_band(w->s->sweep, band);
    import_pool_run(w->s->pool, build_tile, w, rqt_sweep_tiles(w->s->sweep));
    if (went_well(w)) note_made(w, &(maker){0}, rqt_build_keep(w->s->build, &w->band));
    return went_well(w);
}

/* -------------------------------------------------------------------------------------------------- heights -- */
static void put_rows(void *context, int worker, int32_t item) {
    const streaming *w = context;
    const size_t width = (size_t)w->strip->width;
    const int32_t first = item * ROWS_PER_ITEM, rest = w->rows - first;
    for (int32_t y = first; y < first + (rest < ROWS_PER_ITEM ? rest : ROWS_PER_ITEM); y++) {
        const size_t to = (size_t)y * width, at = (size_t)(w->from + y) * width;
        import_quantise(w->strip, at, width, &w->s->heights->steps, w->tools[worker].row, w->q + to);
        if (w->valid) memcpy(w->valid + to, w->strip->valid + at, width);
    }
}

/* Rows first .. first + count - 1, which follow those of the call before. */
static bool put_heights(streaming *w, int32_t first, int32_t count, int32_t *q, uint8_t *valid) {
    import_stream *s = w->s;
    const size_t width = (size_t)s->lattice.width;
    for (int32_t y = first; y < first + count; y += w->rows) {
        if (s->all)
            w->strip = s->all;
        else if (!w->strip && !(w->strip = import_reader_next(s->reader)))
            return false;
        w->from = y - w->strip->first_row;
        const int32_t end = w->strip->rows - w->from, wanted = first + count - y;
        w->rows = end < wanted ? end : wanted;
        w->q = q + (size_t)(y - first) * width;
        w->valid = valid ? valid + (size_t)(y - first) * width : NULL;
        import_pool_run(s->pool, put_rows, w, (w->rows + ROWS_PER_ITEM - 1) / ROWS_PER_ITEM);
        for (int32_t i = 0; w->filled && i < w->rows; i++)
            if (!import_fill_apply(w->job, w->filled, y + i, w->q + (size_t)i * width,
                                   w->valid ? w->valid + (size_t)i * width : NULL))
                return false;
        if (s->all || w->from + w->rows < w->strip->rows) continue;
        w->strip = NULL;
        import_reader_release(s->reader);
    }
    return true;
}

/* ------------------------------------------------------------------------------------------------ the bands -- */
static void sweep_tile(void *context, int worker, int32_t tile) {
    const streaming *w = context;
    rqt_sweep_tile(w->s->sweep, worker, tile);
}

static bool stream_bands(streaming *w) {
    rqt_sweep *sweep = w->s->sweep;
    const int32_t bands = rqt_sweep_bands(sweep);
    for (int32_t band = 0; band < bands; band++) {
        int32_t first, count, *q;
        uint8_t *valid;
        if (!import_progress(w->job, "errors", (double)band / bands, sample_count(w->s))) return false;
        rqt_sweep_begin(sweep, band, &first, &count, &q, &valid);
        if (!put_heights(w, first, count, q, valid)) return false;
        import_pool_run(w->s->pool, sweep_tile, w, rqt_sweep_tiles(sweep));
        rqt_sweep_end(sweep);
        if (band > 0 && !build_band(w, band - 1)) return false;
    }
    if (!build_band(w, bands - 1)) return false;
    rqt_sweep_finish(sweep);
    for (w->level = rqt_build_coarsest_in_tile(w->s->build) - 1; w->level >= 0; w->level--) {
        import_pool_run(w->s->pool, build_coarse, w, rqt_build_cells(w->s->build, w->level));
        if (!went_well(w)) return false;
    }
    return import_progress(w->job, "errors", 1, sample_count(w->s));
}

/* -------------------------------------------------------------------------------------------- four corners -- */
/* A raster of 2 by 2 samples, or less, has no vertex but its corners, and is no matter for a sweep: one block. */
static bool only_corners(streaming *w) {
    import_stream *s = w->s;
    int32_t q[4];
    uint8_t valid[4];
    rqt_pyramid *pyramid = NULL;
    rqt_errors errors;
    rqt_block_number number;
    rqt_summary summary;
    if (!put_heights(w, 0, s->lattice.height, q, valid)) return false;
    const rqt_grid grid = {.lattice = s->lattice, .q = q, .valid = valid};
    rqt_status status =
        rqt_errors_compute(&grid, &s->heights->unit, &s->cost, import_allocator(), NULL, NULL, &errors);
    if (status == RQT_OK) {
        rqt_errors_saturate(&errors);
        status = rqt_pyramid_create(&grid, &errors, s->k, import_allocator(), &pyramid);
    }
    if (status == RQT_OK) {
        maker m = {.w = w, .tools = &w->tools[0]};
        rqt_pyramid_block(pyramid, 0, &number, &summary, &m.tools->block);
        if (!keep_block(&m, number, &summary, &m.tools->block)) status = m.failed ? m.failed : RQT_INTERRUPTED;
    }
    rqt_pyramid_free(pyramid);
    rqt_errors_free(&errors, import_allocator());
    if (status != RQT_OK) note_failure(w, status);
    return went_well(w) && import_progress(w->job, "errors", 1, sample_count(s));
}

/* ----------------------------------------------------------------------------------------------- the whole -- */
static bool kept_write(void *context, uint64_t offset, const void *bytes, size_t size) {
    return import_scratch_write(context, offset, bytes, size);
}

static bool kept_read(void *context, uint64_t offset, void *bytes, size_t size) {
    return import_scratch_read(context, offset, bytes, size);
}

static bool create_sweep(const import_job *job, import_stream *s) {
    const rqt_sweep_plan plan = {.lattice = s->lattice,
                                 .unit = s->heights->unit,
                                 .cost = s->cost,
                                 .min_q = s->heights->min_q,
                                 .max_q = s->heights->max_q,
                                 .has_voids = s->has_voids,
                                 .b = s->plan->b,
                                 .workers = import_pool_workers(s->pool)};
    if (!import_scratch_create(job, s->plan->kept, &s->kept)) return false;
    const rqt_scratch_file file = {kept_write, kept_read, s->kept};
    rqt_status status = rqt_sweep_create(&plan, import_allocator(), &s->sweep);
    if (status == RQT_OK)
        status = rqt_build_create(&s->lattice, s->k, plan.b, &file, import_allocator(), &s->build);
    if (status == RQT_NO_MEMORY) return import_no_memory(job, "computing errors");
    if (status != RQT_OK) return import_refuse(job, "errors cannot be computed (status %d)", (int)status);
    return import_coarse_give(job, s->coarse, &s->heights->steps, s->has_voids, s->fill, s->sweep);
}

static bool create_tools(streaming *w, int workers) {
    w->tools = calloc((size_t)workers, sizeof *w->tools);
    bool ok = w->tools != NULL;
    for (int i = 0; ok && i < workers; i++) {
        tools *t = &w->tools[i];
        t->bytes = malloc(rqt_block_bound(w->s->k));
        t->row = malloc((size_t)w->s->lattice.width * sizeof *t->row);
        ok = t->bytes && t->row && rqt_codec_create(import_allocator(), &t->codec) == RQT_OK &&
             rqt_block_create(w->s->k, import_allocator(), &t->block) == RQT_OK;
    }
    return ok || import_no_memory(w->job, "making blocks");
}

static void free_tools(streaming *w, int workers) {
    for (int i = 0; w->tools && i < workers; i++) {
        rqt_codec_free(w->tools[i].codec);
        rqt_block_free(&w->tools[i].block, import_allocator());
        free(w->tools[i].bytes);
        free(w->tools[i].row);
    }
    free(w->tools);
}

bool import_stream_run(const import_job *job, import_stream *s) {
    const rqt_unit *unit = &s->heights->unit;
    streaming w = {.job = job, .s = s, .quantum = fabs(rqt_unit_factor(unit)) / unit->d};
    const int workers = import_pool_workers(s->pool);
    pthread_mutex_init(&w.lock, NULL);
    bool ok = import_stage_create(job, &s->lattice, s->k, s->plan->stage, &s->stage) && create_tools(&w, workers);
    if (ok && s->fill) ok = import_fill_reader_create(job, s->fill, &w.filled);
    if (ok) ok = s->lattice.K == 0 ? only_corners(&w) : create_sweep(job, s) && stream_bands(&w);
    free_tools(&w, workers);
    import_fill_reader_free(w.filled);
    pthread_mutex_destroy(&w.lock);
    return ok;
}

void import_stream_free(import_stream *s) {
    rqt_build_free(s->build);
    rqt_sweep_free(s->sweep);
    import_stage_free(s->stage);
    import_scratch_free(s->kept);
}
