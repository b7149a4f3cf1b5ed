/* reader.c - a thread that reads ahead.
 *
 * Reading waits for the disk and decompresses on one core, while the pool works on what was read before. The strips
 * are a ring, or windows of the whole grid when that is kept. GDAL's datasets belong to this thread alone, and so
 * do its list of error handlers and the resume file.
 */
#include "source.h"

#include <cpl_error.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

struct import_reader {
    import_job own; /* with a message of its own: the caller may be writing his */
    char message[2048];
    const import_job *job;
    import_reader_options options;
    import_reading *reading;
    import_strip *ring;
    int32_t length, strips; /* of the ring; of the grid */
    pthread_mutex_t lock;
    pthread_cond_t filled, emptied;
    int32_t read, taken, released; /* strips */
    bool failed, stop, running;
    import_counts counts;
    import_strip current;
    pthread_t thread;
};

static size_t bytes_of(const import_reader *r) {
    return import_kind_bytes(r->options.mosaic->kind);
}

/* The strip of this number, with its place in memory. */
static import_strip strip_of(const import_reader *r, int32_t number) {
    const rqt_lattice *lattice = &r->options.mosaic->lattice;
    const int32_t first = number * r->options.strip_rows, rest = lattice->height - first;
    import_strip s = {.kind = r->options.mosaic->kind, .width = lattice->width, .first_row = first};
    s.rows = rest < r->options.strip_rows ? rest : r->options.strip_rows;
    if (r->options.all) {
        const size_t at = (size_t)first * (size_t)lattice->width;
        s.values = (char *)r->options.all->values + at * bytes_of(r);
        s.valid = r->options.all->valid + at;
    } else {
        s.values = r->ring[number % r->length].values;
        s.valid = r->ring[number % r->length].valid;
    }
    return s;
}

/* A strip, from the resume file if it has it, else from the sources. */
static bool fetch(import_reader *r, int32_t n, import_strip *strip) {
    import_spool *spool = r->options.spool;
    if (spool && n < import_spool_strips(spool) &&
        import_spool_read(spool, n, strip, &r->counts, r->options.conflicts))
        return true;
    import_counts own = {0};
    if (!import_reading_strip(r->reading, strip, &own)) return false;
    const import_conflicts *conflicts = import_reading_conflicts(r->reading);
    if (spool && !import_spool_append(&r->own, spool, strip, &own, conflicts)) return false;
    for (size_t i = 0; r->options.conflicts && i < conflicts->count; i++)
        if (!import_conflicts_add(r->options.conflicts, &conflicts->pair[i]))
            return import_no_memory(&r->own, "comparing the sources");
    r->counts.voids += own.voids;
    r->counts.overlap += own.overlap;
    r->counts.overlap_differs += own.overlap_differs;
    r->counts.samples += own.samples;
    return true;
}

static void *read_all(void *context) {
    import_reader *r = context;
    CPLPushErrorHandler(CPLQuietErrorHandler);
    bool ok = true;
    for (int32_t n = 0; n < r->strips && ok; n++) {
        pthread_mutex_lock(&r->lock);
        while (!r->stop && !r->options.all && n >= r->released + r->length)
            pthread_cond_wait(&r->emptied, &r->lock);
        const bool stop = r->stop;
        pthread_mutex_unlock(&r->lock);
        if (stop) break;
        import_strip strip = strip_of(r, n);
        ok = fetch(r, n, &strip);
        pthread_mutex_lock(&r->lock);
        r->read += ok;
        r->failed = !ok;
        pthread_cond_signal(&r->filled);
        pthread_mutex_unlock(&r->lock);
    }
    import_reading_close(r->reading);
    r->reading = NULL;
    CPLPopErrorHandler();
    return NULL;
}

static bool ring_create(import_reader *r) {
    const size_t n = (size_t)r->options.strip_rows * (size_t)r->options.mosaic->lattice.width;
    r->length = r->options.strips < r->strips ? r->options.strips : r->strips;
    r->ring = calloc((size_t)r->length, sizeof *r->ring);
    for (int32_t i = 0; r->ring && i < r->length; i++) {
        r->ring[i].values = malloc(n * bytes_of(r));
        r->ring[i].valid = malloc(n);
        if (!r->ring[i].values || !r->ring[i].valid) return false;
    }
    return r->ring != NULL;
}

bool import_reader_start(const import_job *job, const import_reader_options *options, import_reader **reader) {
    import_reader *r = *reader = calloc(1, sizeof *r);
    if (!r) return import_no_memory(job, "reading the sources");
    r->job = job;
    r->own = *job;
    r->own.message = r->message;
    r->own.message_size = sizeof r->message;
    r->options = *options;
    r->strips = (options->mosaic->lattice.height + options->strip_rows - 1) / options->strip_rows;
    pthread_mutex_init(&r->lock, NULL);
    pthread_cond_init(&r->filled, NULL);
    pthread_cond_init(&r->emptied, NULL);
    if (!options->all && !ring_create(r)) return import_no_memory(job, "reading the sources");
    if (!import_reading_open(&r->own, options->sources, options->count, options->mosaic, options->strip_rows,
                             &r->reading))
        return import_refuse(job, "%s", r->message);
    r->running = pthread_create(&r->thread, NULL, read_all, r) == 0;
    return r->running || import_refuse(job, "no thread could be started to read the sources");
}

const import_strip *import_reader_next(import_reader *r) {
    pthread_mutex_lock(&r->lock);
    while (r->read <= r->taken && !r->failed) pthread_cond_wait(&r->filled, &r->lock);
    const bool there = r->read > r->taken;
    pthread_mutex_unlock(&r->lock);
    if (!there) {
        import_refuse(r->job, "%s", r->message);
        return NULL;
    }
    r->current = strip_of(r, r->taken++);
    return &r->current;
}

void import_reader_release(import_reader *r) {
    pthread_mutex_lock(&r->lock);
    r->released++;
    pthread_cond_signal(&r->emptied);
    pthread_mutex_unlock(&r->lock);
}

void import_reader_extent(const import_reader *r, int32_t *width, int32_t *height) {
    *width = r->options.mosaic->lattice.width;
    *height = r->options.mosaic->lattice.height;
}

import_counts import_reader_counts(const import_reader *r) {
    return r->counts;
}

void import_reader_free(import_reader *r) {
    if (!r) return;
    pthread_mutex_lock(&r->lock);
    r->stop = true;
    pthread_cond_signal(&r->emptied);
    pthread_mutex_unlock(&r->lock);
    if (r->running) pthread_join(r->thread, NULL);
    import_reading_close(r->reading);
    for (int32_t i = 0; r->ring && i < r->length; i++) {
        free(r->ring[i].values);
        free(r->ring[i].valid);
    }
    free(r->ring);
    pthread_cond_destroy(&r->emptied);
    pthread_cond_destroy(&r->filled);
    pthread_mutex_destroy(&r->lock);
    free(r);
}
