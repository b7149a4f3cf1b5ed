/* blocks.c - q and errors -> encoded blocks -> store.
 *
 * A ring of slots between `jobs` encoding threads and the calling thread, which alone talks to SQLite. A thread
 * takes the next number, waits until its slot is free, fills it; the caller empties the slots in order. Encoding
 * depends on the block alone, so the tables are the same bytes for any number of threads.
 */
#include "parts.h"

#include <pthread.h>
#include <stdlib.h>

#define SLOTS_PER_JOB 16

typedef struct slot {
    bool ready;
    rqt_block_number number;
    rqt_summary summary;
    size_t size;
    uint8_t *bytes;
} slot;

typedef struct ring {
    pthread_mutex_t lock;
    pthread_cond_t filled, emptied;
    const rqt_pyramid *pyramid;
    int k;
    double quantum;
    slot *slots;
    size_t length, count; /* slots; blocks */
    size_t next, written; /* block that the next thread takes; blocks that are written */
    bool stop;
    rqt_status failed;
} ring;

static size_t ring_length(int jobs) {
    return (size_t)jobs * SLOTS_PER_JOB;
}

size_t import_blocks_bytes(int k, int jobs) {
    /* A codec holds a payload and its compressed form, and zstd's tables: taken as four blocks and 4 MiB. */
    size_t thread = rqt_block_bytes(k) + 4 * rqt_block_bound(k) + ((size_t)4 << 20);
    return (size_t)jobs * thread + ring_length(jobs) * (rqt_block_bound(k) + sizeof(slot));
}

/* The next block for a thread, once its slot is free. False: nothing left to do. */
static bool take(ring *r, size_t *n) {
    pthread_mutex_lock(&r->lock);
    while (!r->stop && r->next < r->count && r->next >= r->written + r->length)
        pthread_cond_wait(&r->emptied, &r->lock);
    bool more = !r->stop && r->next < r->count;
    if (more) *n = r->next++;
    pthread_mutex_unlock(&r->lock);
    return more;
}

static void *encode(void *context) {
    ring *r = context;
    rqt_codec *codec = NULL;
    rqt_block block = {0};
    rqt_status status = rqt_codec_create(import_allocator(), &codec);
    if (status == RQT_OK) status = rqt_block_create(r->k, import_allocator(), &block);
    size_t n;
    while (status == RQT_OK && take(r, &n)) {
        slot *s = &r->slots[n % r->length];
        rqt_pyramid_block(r->pyramid, n, &s->number, &s->summary, &block);
        status = rqt_block_encode(codec, &block, r->quantum, s->bytes, &s->size);
        if (status != RQT_OK) break;
        pthread_mutex_lock(&r->lock);
        s->ready = true;
        pthread_cond_signal(&r->filled);
        pthread_mutex_unlock(&r->lock);
    }
    if (status != RQT_OK) {
        pthread_mutex_lock(&r->lock);
        r->failed = status;
        r->stop = true;
        pthread_cond_broadcast(&r->emptied);
        pthread_cond_signal(&r->filled);
        pthread_mutex_unlock(&r->lock);
    }
    rqt_block_free(&block, import_allocator());
    rqt_codec_free(codec);
    return NULL;
}

/* The slots in order, as they fill. */
static bool write_all(const import_job *job, ring *r, store_writer *writer, int64_t samples,
                      import_report *report) {
    for (size_t n = 0; n < r->count; n++) {
        slot *s = &r->slots[n % r->length];
        pthread_mutex_lock(&r->lock);
        while (!s->ready && r->failed == RQT_OK) pthread_cond_wait(&r->filled, &r->lock);
        rqt_status failed = s->ready ? RQT_OK : r->failed;
        pthread_mutex_unlock(&r->lock);
        if (failed == RQT_NO_MEMORY) return import_no_memory(job, "encoding blocks");
        if (failed != RQT_OK)
            return import_refuse(job, "block %zu of %zu cannot be encoded (status %d)", n + 1, r->count,
                                 (int)failed);
        char *detail = NULL;
        int code = store_writer_block(writer, s->number, &s->summary, s->bytes, s->size, &detail);
        if (code != SQLITE_OK) return import_database_refuse(job, code, detail);
        report->blocks++;
        report->bytes += (int64_t)s->size + RQT_SUMMARY_BYTES;
        pthread_mutex_lock(&r->lock);
        s->ready = false;
        r->written++;
        pthread_cond_broadcast(&r->emptied);
        pthread_mutex_unlock(&r->lock);
        if ((n + 1) % 64 == 0 || n + 1 == r->count)
            if (!import_progress(job, "blocks", (double)(n + 1) / (double)r->count, samples)) return false;
    }
    return true;
}

static bool ring_create(ring *r, int jobs) {
    r->length = ring_length(jobs);
    r->slots = calloc(r->length, sizeof *r->slots);
    if (!r->slots) return false;
    for (size_t i = 0; i < r->length; i++) {
        r->slots[i].bytes = malloc(rqt_block_bound(r->k));
        if (!r->slots[i].bytes) return false;
    }
    return true;
}

static void ring_free(ring *r) {
    for (size_t i = 0; r->slots && i < r->length; i++) free(r->slots[i].bytes);
    free(r->slots);
}

bool import_blocks(const import_job *job, const rqt_pyramid *pyramid, int k, double quantum, store_writer *writer,
                   int64_t samples, import_report *report) {
    int jobs = job->options->jobs;
    ring r = {.pyramid = pyramid, .k = k, .quantum = quantum, .count = rqt_pyramid_count(pyramid)};
    pthread_t *threads = calloc((size_t)jobs, sizeof *threads);
    bool ok = false;
    pthread_mutex_init(&r.lock, NULL);
    pthread_cond_init(&r.filled, NULL);
    pthread_cond_init(&r.emptied, NULL);
    if (!threads || !ring_create(&r, jobs)) {
        import_no_memory(job, "encoding blocks");
    } else {
        int started = 0;
        while (started < jobs && pthread_create(&threads[started], NULL, encode, &r) == 0) started++;
        if (started > 0)
            ok = write_all(job, &r, writer, samples, report);
        else
            import_refuse(job, "no thread could be started to encode blocks");
        pthread_mutex_lock(&r.lock);
        r.stop = true;
        pthread_cond_broadcast(&r.emptied);
        pthread_mutex_unlock(&r.lock);
        for (int i = 0; i < started; i++) pthread_join(threads[i], NULL);
    }
    ring_free(&r);
    free(threads);
    pthread_cond_destroy(&r.emptied);
    pthread_cond_destroy(&r.filled);
    pthread_mutex_destroy(&r.lock);
    return ok;
}
