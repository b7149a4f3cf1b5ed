/* http.c - libmicrohttpd's callbacks.
 *
 * One thread of the library holds all connections, by poll: with epoll, 0.9.75 does not see an end of the stream
 * that came with the last bytes. A request whose headers are complete is either answered there (what needs no
 * database) or suspended and handed to the workers; a worker resumes it when its answer is whole. So a slow answer
 * holds up nobody who asks for a quick one, but for its worker.
 *
 * Slow clients. The library's own timeout counts from the last byte, so that one byte every few seconds holds a
 * connection for ever. Therefore each connection is known here as a peer with the time since when it has been in
 * its present phase: too long in sending its request (or idle), or in taking its answer at less than a modem's
 * speed, and its socket is shut down, which the library sees as the end.
 */
#include "internal.h"

#include <arpa/inet.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/socket.h>
#include <unistd.h>

/* Seconds without a byte; and for taking an answer: so many, and one more for each so many bytes. */
enum { IDLE_SECONDS = 30, TAKING_SECONDS = 30, TAKING_BYTES = 8192 };
/* Bytes of an answer that is always sent. */
enum { SMALL_ANSWER = 65536 };

typedef struct peer {
    struct peer *next, **link;
    int socket;
    enum { PEER_SENDS, PEER_WAITS, PEER_TAKES } phase;
    double until; /* when its time is over; of PEER_WAITS it is the worker's to end */
} peer;

struct peers {
    pthread_mutex_t lock;
    peer *first;
    int connections, requests;
    int asked;       /* requests whose connection is suspended, or was and has not been looked at since */
    size_t held;     /* bytes of answers on their way */
    bool is_closing; /* every answer is its connection's last */
    bool is_shut;    /* nothing is asked any more */
};

/* ------------------------------------------------------------------------------------------------------ peers --
 */

static peer *peer_of(struct MHD_Connection *connection) {
    const union MHD_ConnectionInfo *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT);
    return info ? info->socket_context : NULL;
}

static void set_phase(peers *all, struct MHD_Connection *connection, int phase, double seconds, int requests) {
    peer *p = peer_of(connection);
    pthread_mutex_lock(&all->lock);
    all->requests += requests;
    if (p) {
        p->phase = phase;
        p->until = now_seconds() + seconds;
    }
    pthread_mutex_unlock(&all->lock);
}

static void on_connection(void *context, struct MHD_Connection *connection, void **slot,
                          enum MHD_ConnectionNotificationCode what) {
    service *s = context;
    peers *all = s->peers;
    if (what == MHD_CONNECTION_NOTIFY_STARTED) {
        const union MHD_ConnectionInfo *info =
            MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
        peer *p = malloc(sizeof *p);
        *slot = p;
        if (!p) return; /* then nobody hurries it but the library */
        *p = (peer){.socket = info->connect_fd, .until = now_seconds() + s->options.header_seconds};
        pthread_mutex_lock(&all->lock);
        p->next = all->first;
        p->link = &all->first;
        if (p->next) p->next->link = &p->next;
        all->first = p;
        all->connections++;
        pthread_mutex_unlock(&all->lock);
        return;
    }
    peer *p = *slot;
    *slot = NULL;
    if (!p) return;
    pthread_mutex_lock(&all->lock);
    *p->link = p->next;
    if (p->next) p->next->link = p->link;
    all->connections--;
    pthread_mutex_unlock(&all->lock);
    free(p);
}

void http_count(service *s, int *connections, int *requests) {
    pthread_mutex_lock(&s->peers->lock);
    *connections = s->peers->connections;
    *requests = s->peers->requests;
    pthread_mutex_unlock(&s->peers->lock);
}

/* May a connection be suspended? Then it counts until end_asking. */
static bool begin_asking(request *r) {
    peers *all = r->service->peers;
    pthread_mutex_lock(&all->lock);
    r->is_asked = !all->is_shut;
    all->asked += r->is_asked;
    pthread_mutex_unlock(&all->lock);
    return r->is_asked;
}

static void end_asking(request *r) {
    peers *all = r->service->peers;
    pthread_mutex_lock(&all->lock);
    all->asked -= r->is_asked;
    r->is_asked = false;
    pthread_mutex_unlock(&all->lock);
}

/* Is there room for the answer beside those that clients have not taken yet? Small ones are let pass: the number
 * of connections bounds them. */
static bool hold(request *r, size_t size) {
    peers *all = r->service->peers;
    pthread_mutex_lock(&all->lock);
    const bool fits = size <= SMALL_ANSWER || all->held + size <= (uint64_t)r->service->options.memory;
    if (fits) {
        all->held += size;
        r->held += size;
    }
    pthread_mutex_unlock(&all->lock);
    return fits;
}

static void let_go(request *r) {
    peers *all = r->service->peers;
    pthread_mutex_lock(&all->lock);
    all->held -= r->held;
    pthread_mutex_unlock(&all->lock);
    r->held = 0;
}

bool http_shut(service *s, bool late) {
    peers *all = s->peers;
    pthread_mutex_lock(&all->lock);
    if (all->asked == 0 && (all->requests == 0 || late)) all->is_shut = true;
    const bool is_shut = all->is_shut;
    pthread_mutex_unlock(&all->lock);
    return is_shut;
}

void http_sweep(service *s) {
    const double now = now_seconds();
    pthread_mutex_lock(&s->peers->lock);
    /* A peer of the list has an open socket: the library closes it after on_connection has taken it out. */
    for (const peer *p = s->peers->first; p; p = p->next)
        if (p->phase != PEER_WAITS && now > p->until) shutdown(p->socket, SHUT_RDWR);
    pthread_mutex_unlock(&s->peers->lock);
}

/* ---------------------------------------------------------------------------------------------------- answers --
 */

static const char METHODS[] = "GET, HEAD, OPTIONS";
static const char EXPOSED[] =
    "ETag, RQT-Vertices, RQT-Triangles, RQT-Achieved-Eps, RQT-Achieved-Tau, RQT-Guaranteed, RQT-Token";

static void put(struct MHD_Response *response, const char *name, const char *value) {
    if (value) (void)MHD_add_response_header(response, name, value);
}

static void put_caching(struct MHD_Response *response, const request *r) {
    const answer *a = &r->answer;
    char value[64] = "no-store";
    if (a->is_lasting && r->service->options.max_age > 0)
        snprintf(value, sizeof value, "public, max-age=%d", r->service->options.max_age);
    else if (a->is_lasting)
        snprintf(value, sizeof value, "public, no-cache"); /* may be kept, and is asked for each time */
    put(response, MHD_HTTP_HEADER_CACHE_CONTROL, value);
    if (*a->etag) put(response, MHD_HTTP_HEADER_ETAG, a->etag);
    put(response, MHD_HTTP_HEADER_VARY, a->varies);
}

static void put_headers(struct MHD_Response *response, const request *r) {
    const answer *a = &r->answer;
    put(response, MHD_HTTP_HEADER_ACCESS_CONTROL_ALLOW_ORIGIN, "*");
    put(response, "X-Content-Type-Options", "nosniff");
    put_caching(response, r);
    if (a->status == MHD_HTTP_NO_CONTENT || a->status == MHD_HTTP_METHOD_NOT_ALLOWED)
        put(response, MHD_HTTP_HEADER_ALLOW, METHODS);
    if (a->status == MHD_HTTP_NO_CONTENT) {
        put(response, MHD_HTTP_HEADER_ACCESS_CONTROL_ALLOW_METHODS, METHODS);
        put(response, MHD_HTTP_HEADER_ACCESS_CONTROL_ALLOW_HEADERS, "Accept, If-None-Match");
        put(response, MHD_HTTP_HEADER_ACCESS_CONTROL_MAX_AGE, "86400");
        return;
    }
    put(response, MHD_HTTP_HEADER_ACCESS_CONTROL_EXPOSE_HEADERS, EXPOSED);
    put(response, MHD_HTTP_HEADER_RETRY_AFTER, a->retry);
    if (a->status == MHD_HTTP_NOT_MODIFIED) return;
    put(response, MHD_HTTP_HEADER_CONTENT_TYPE, a->type);
    for (int i = 0; i < TOLD_HEADERS; i++)
        if (*a->told[i]) put(response, told_headers[i], a->told[i]);
    if (a->coding != CODING_IDENTITY) put(response, MHD_HTTP_HEADER_CONTENT_ENCODING, coding_name(a->coding));
    if (a->is_page)
        put(response, "Content-Security-Policy",
            "default-src 'self'; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; "
            "worker-src 'self' blob:; object-src 'none'; base-uri 'none'; frame-ancestors 'self'");
}

/* The answer is whole: into libmicrohttpd's hands. */
static enum MHD_Result send_answer(request *r) {
    answer *a = &r->answer;
    peers *all = r->service->peers;
    if (a->body.no_memory) answer_problem(r, MHD_HTTP_SERVICE_UNAVAILABLE, "out of memory");
    if (!hold(r, a->body.size))
        answer_problem(r, MHD_HTTP_SERVICE_UNAVAILABLE, "the service is busy with answers on their way: ask again");
    const size_t size = a->body.size;
    metrics_count(r->service->metrics, r, now_seconds() - r->received, size);
    struct MHD_Response *response = MHD_create_response_from_buffer(
        size, size ? a->body.bytes : (void *)"", size ? MHD_RESPMEM_MUST_FREE : MHD_RESPMEM_PERSISTENT);
    if (!response) return MHD_NO;
    if (size)
        a->body = (buffer){0};
    else
        buffer_free(&a->body);
    put_headers(response, r);
    pthread_mutex_lock(&all->lock);
    if (all->is_closing || r->has_body) put(response, MHD_HTTP_HEADER_CONNECTION, "close");
    pthread_mutex_unlock(&all->lock);
    set_phase(all, r->connection, PEER_TAKES, TAKING_SECONDS + (double)size / TAKING_BYTES, 0);
    r->phase = REQUEST_SENT;
    const enum MHD_Result result = MHD_queue_response(r->connection, a->status, response);
    MHD_destroy_response(response);
    return result;
}

/* --------------------------------------------------------------------------------------------------- requests --
 */

static const char *header(struct MHD_Connection *connection, const char *name) {
    return MHD_lookup_connection_value(connection, MHD_HEADER_KIND, name);
}

static void *on_target(void *context, const char *target, struct MHD_Connection *connection) {
    request *r = calloc(1, sizeof *r);
    if (!r) return NULL;
    r->service = context;
    r->connection = connection;
    answer_clear(r);
    r->target = strdup(target);
    if (r->target) return r;
    free(r);
    return NULL;
}

static void on_completed(void *context, struct MHD_Connection *connection, void **slot,
                         enum MHD_RequestTerminationCode why) {
    service *s = context;
    request *r = *slot;
    (void)why;
    *slot = NULL;
    if (!r) return;
    set_phase(s->peers, connection, PEER_SENDS, s->options.header_seconds, r->phase == REQUEST_NEW ? 0 : -1);
    end_asking(r);
    let_go(r);
    buffer_free(&r->answer.body);
    free(r->decoded);
    free(r->target);
    free(r);
}

/* The name of a header, whatever blanks stand before its colon: there are servers that pass over them. */
static bool is_header(const char *given, const char *name) {
    const size_t n = strlen(name);
    return strncasecmp(given, name, n) == 0 && !given[n + strspn(given + n, " \t")];
}

static enum MHD_Result look_for_body(void *found, enum MHD_ValueKind kind, const char *name, const char *value) {
    (void)kind;
    const bool is_length = is_header(name, MHD_HTTP_HEADER_CONTENT_LENGTH) && (!value || strcmp(value, "0") != 0);
    if (is_length || is_header(name, MHD_HTTP_HEADER_TRANSFER_ENCODING)) *(bool *)found = true;
    return MHD_YES;
}

/* Of any of several headers: a server before us may have gone by another one than the library does. */
static bool has_body(const request *r) {
    bool found = false;
    MHD_get_connection_values(r->connection, MHD_HEADER_KIND, look_for_body, &found);
    return found;
}

/* The headers are complete. An answer now ends the connection, for the library cannot know what of a body there is
 * still to come; so what has a body is answered now, and all else when the library calls again at once. */
static enum MHD_Result begin(request *r, const char *method) {
    struct MHD_Connection *connection = r->connection;
    r->received = now_seconds();
    r->method = method;
    r->accept = header(connection, MHD_HTTP_HEADER_ACCEPT);
    r->accept_encoding = header(connection, MHD_HTTP_HEADER_ACCEPT_ENCODING);
    r->if_none_match = header(connection, MHD_HTTP_HEADER_IF_NONE_MATCH);
    r->phase = REQUEST_READ;
    set_phase(r->service->peers, connection, PEER_WAITS, 0, 1);
    r->has_body = has_body(r);
    if (!r->has_body) return MHD_YES;
    answer_problem(
        r, strcmp(method, "GET") && strcmp(method, "HEAD") ? MHD_HTTP_METHOD_NOT_ALLOWED : MHD_HTTP_BAD_REQUEST,
        "requests have no body here: GET, HEAD and OPTIONS are what is answered");
    return send_answer(r);
}

/* Method, target and parameters are in order; false: what there is to say is the answer. */
static bool check(request *r) {
    if (strcmp(r->method, "OPTIONS") == 0) {
        r->answer.status = MHD_HTTP_NO_CONTENT;
        return false;
    }
    if (strcmp(r->method, "GET") != 0 && strcmp(r->method, "HEAD") != 0) {
        answer_problem(r, MHD_HTTP_METHOD_NOT_ALLOWED, "the method is none of GET, HEAD and OPTIONS");
        return false;
    }
    return target_read(r) && endpoint_find(r);
}

static enum MHD_Result ask(request *r) {
    if (!check(r)) return send_answer(r);
    if (r->endpoint && r->endpoint->is_direct) {
        r->endpoint->answer(NULL, r);
        return send_answer(r);
    }
    if (!begin_asking(r)) {
        answer_problem(r, MHD_HTTP_SERVICE_UNAVAILABLE, "the service ends");
        return send_answer(r);
    }
    /* Suspended first: the worker may be done before this returns. */
    r->phase = REQUEST_ASKED;
    MHD_suspend_connection(r->connection);
    if (pool_ask(r->service->pool, r)) return MHD_YES;
    answer_problem(r, MHD_HTTP_SERVICE_UNAVAILABLE, "the service is busy: ask again");
    r->phase = REQUEST_ANSWERED;
    MHD_resume_connection(r->connection);
    return MHD_YES;
}

static enum MHD_Result on_request(void *context, struct MHD_Connection *connection, const char *url,
                                  const char *method, const char *version, const char *upload, size_t *upload_size,
                                  void **slot) {
    (void)context, (void)connection, (void)url, (void)version, (void)upload;
    request *r = *slot;
    if (!r) return MHD_NO; /* there was no memory for it */
    if (*upload_size) *upload_size = 0;
    switch (r->phase) {
    case REQUEST_NEW:
        return begin(r, method);
    case REQUEST_READ:
        return ask(r);
    case REQUEST_ANSWERED:
        end_asking(r);
        return send_answer(r);
    default:
        return MHD_YES;
    }
}

/* ------------------------------------------------------------------------------------------------------- life --
 */

static void be_silent(void *context, const char *format, va_list list) {
    (void)context, (void)format, (void)list;
}

bool http_begin(service *s, int listening, char *why, size_t size) {
    s->peers = calloc(1, sizeof *s->peers);
    if (!s->peers) {
        snprintf(why, size, "out of memory");
        return false;
    }
    pthread_mutex_init(&s->peers->lock, NULL);
    s->daemon = MHD_start_daemon(
        MHD_USE_POLL_INTERNAL_THREAD | MHD_ALLOW_SUSPEND_RESUME | MHD_USE_ERROR_LOG, 0, NULL, NULL, on_request, s,
        MHD_OPTION_EXTERNAL_LOGGER, be_silent, NULL, MHD_OPTION_LISTEN_SOCKET, listening,
        MHD_OPTION_CONNECTION_LIMIT, (unsigned)s->options.connections, MHD_OPTION_CONNECTION_TIMEOUT,
        (unsigned)IDLE_SECONDS, MHD_OPTION_CONNECTION_MEMORY_LIMIT, (size_t)CONNECTION_MEMORY,
        MHD_OPTION_STRICT_FOR_CLIENT, 1, MHD_OPTION_URI_LOG_CALLBACK, on_target, s, MHD_OPTION_NOTIFY_COMPLETED,
        on_completed, s, MHD_OPTION_NOTIFY_CONNECTION, on_connection, s, MHD_OPTION_END);
    if (!s->daemon) snprintf(why, size, "the HTTP server could not be started");
    return s->daemon != NULL;
}

void http_quiesce(service *s) {
    pthread_mutex_lock(&s->peers->lock);
    s->peers->is_closing = true;
    pthread_mutex_unlock(&s->peers->lock);
    const MHD_socket listening = MHD_quiesce_daemon(s->daemon);
    if (listening != MHD_INVALID_SOCKET) close(listening);
}

void http_end(service *s) {
    if (s->daemon) MHD_stop_daemon(s->daemon);
    if (s->peers) pthread_mutex_destroy(&s->peers->lock);
    free(s->peers);
}
