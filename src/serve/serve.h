/* serve.h - the query service: what SQL answers, over HTTP.
 *
 * The door of the room. Behind it: one thread of libmicrohttpd reads requests and sends answers, and workers, each
 * with read-only connections of its own, make the answers by asking SQL functions (internal.h has the map). An
 * answer is whole before its first byte is sent, so its status is true.
 */
#ifndef RQT_SERVE_H
#define RQT_SERVE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct serve_options {
    const char *const *databases; /* paths; they are looked at again with every request */
    int database_count;
    const char *address; /* numeric, IPv4 or IPv6 */
    int port;            /* 0: one that is free */
    int workers;
    int connections;       /* open at a time, at most */
    int64_t max_triangles; /* of an answer, and vertices: 413 beyond */
    int64_t max_samples;   /* under a mesh that is verified: 413 beyond */
    int64_t max_bytes;     /* of an answer before compression: 413 beyond */
    int64_t memory;        /* bytes that SQLite, blocks and answers in the making may take: 503 beyond */
    double max_seconds;    /* from the request to its answer: 503 beyond */
    double header_seconds; /* that a client may take to send its request */
    int max_age;           /* seconds that caches may answer without asking again */
} serve_options;

/* Tells, once it listens, where (address as a URL). */
typedef void serve_tell(void *context, const char *url);

/* Serves until SIGINT or SIGTERM, then lets the answers under way finish. Returns false, and a sentence in `why`
 * (`size` bytes), when it could not begin. Blocks the two signals in the calling thread for good. */
bool serve_run(const serve_options *options, serve_tell *tell, void *context, char *why, size_t size);

#endif
