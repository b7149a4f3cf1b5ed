/* scratch.c - bytes at offsets, in memory up to a limit, beyond it in a file that nobody sees.
 *
 * The file is beside the database, where there must be room for as much anyway, and loses its name as soon as it is
 * open: however the process ends, nothing is left. Memory is taken by the chunk, when it is first written to.
 */
#include "parts.h"

#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define CHUNK ((uint64_t)1 << 20)

struct import_scratch {
    pthread_mutex_t lock;
    uint64_t memory; /* offsets below are in memory; whole chunks */
    uint8_t **chunk;
    char *path; /* the database's */
    int file;   /* -1: not open yet */
    int failed; /* errno of the first failure, 0: none */
};

bool import_scratch_create(const import_job *job, uint64_t memory, import_scratch **scratch) {
    import_scratch *s = *scratch = calloc(1, sizeof *s);
    if (!s) return import_no_memory(job, "making a scratch file");
    pthread_mutex_init(&s->lock, NULL);
    s->file = -1;
    s->memory = memory / CHUNK * CHUNK;
    s->path = strdup(job->database);
    s->chunk = calloc((size_t)(s->memory / CHUNK) + 1, sizeof *s->chunk);
    return (s->path && s->chunk) || import_no_memory(job, "making a scratch file");
}

void import_scratch_free(import_scratch *s) {
    if (!s) return;
    for (uint64_t i = 0; s->chunk && i < s->memory / CHUNK; i++) free(s->chunk[i]);
    if (s->file >= 0) close(s->file);
    pthread_mutex_destroy(&s->lock);
    free(s->chunk);
    free(s->path);
    free(s);
}

bool import_scratch_refuse(const import_job *job, const import_scratch *s) {
    if (s->failed == ENOMEM) return import_no_memory(job, "keeping blocks");
    const char *full = s->failed == ENOSPC || s->failed == EFBIG || s->failed == EDQUOT ? "the disk is full: " : "";
    return import_refuse(job, "the scratch file beside %s: %s%s", job->database, full,
                         s->failed ? strerror(s->failed) : "a block is missing");
}

static bool fail(import_scratch *s, int why) {
    pthread_mutex_lock(&s->lock);
    if (!s->failed) s->failed = why ? why : EIO;
    pthread_mutex_unlock(&s->lock);
    return false;
}

/* A file without a name in the database's folder. -1 with errno. */
static int open_file(const char *database) {
    static const char tail[] = "-scratch-XXXXXX";
    const size_t n = strlen(database);
    char *name = malloc(n + sizeof tail);
    if (!name) return -1;
    memcpy(name, database, n);
    memcpy(name + n, tail, sizeof tail);
    const int file = mkstemp(name);
    const int why = errno;
    if (file >= 0) unlink(name);
    free(name);
    errno = why;
    return file;
}

static int file_of(import_scratch *s) {
    pthread_mutex_lock(&s->lock);
    if (s->file < 0) s->file = open_file(s->path);
    const int file = s->file, why = errno;
    pthread_mutex_unlock(&s->lock);
    errno = why;
    return file;
}

static uint8_t *chunk_of(import_scratch *s, uint64_t offset) {
    uint8_t **chunk = &s->chunk[offset / CHUNK];
    pthread_mutex_lock(&s->lock);
    if (!*chunk) *chunk = malloc(CHUNK);
    uint8_t *found = *chunk;
    pthread_mutex_unlock(&s->lock);
    return found;
}

/* The part of a range that is in one piece: in one chunk, or in the file. */
static size_t piece(const import_scratch *s, uint64_t offset, size_t size) {
    if (offset >= s->memory) return size;
    const uint64_t rest = CHUNK - offset % CHUNK;
    return size < rest ? size : (size_t)rest;
}

bool import_scratch_write(import_scratch *s, uint64_t offset, const void *bytes, size_t size) {
    const uint8_t *from = bytes;
    while (size) {
        size_t n = piece(s, offset, size);
        if (offset < s->memory) {
            uint8_t *chunk = chunk_of(s, offset);
            if (!chunk) return fail(s, ENOMEM);
            memcpy(chunk + offset % CHUNK, from, n);
        } else {
            const int file = file_of(s);
            const ssize_t written = file < 0 ? -1 : pwrite(file, from, n, (off_t)(offset - s->memory));
            if (written <= 0 && errno != EINTR) return fail(s, errno);
            n = written > 0 ? (size_t)written : 0;
        }
        offset += n;
        from += n;
        size -= n;
    }
    return true;
}

bool import_scratch_read(import_scratch *s, uint64_t offset, void *bytes, size_t size) {
    uint8_t *to = bytes;
    while (size) {
        size_t n = piece(s, offset, size);
        if (offset < s->memory) {
            const uint8_t *chunk = chunk_of(s, offset);
            if (!chunk) return fail(s, ENOMEM);
            memcpy(to, chunk + offset % CHUNK, n);
        } else {
            const int file = file_of(s);
            const ssize_t got = file < 0 ? -1 : pread(file, to, n, (off_t)(offset - s->memory));
            if (got == 0) return fail(s, EIO);
            if (got < 0 && errno != EINTR) return fail(s, errno);
            n = got > 0 ? (size_t)got : 0;
        }
        offset += n;
        to += n;
        size -= n;
    }
    return true;
}
