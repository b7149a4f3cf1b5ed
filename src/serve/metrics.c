/* metrics.c - what has been asked and how long it took, in Prometheus's text format, version 0.0.4. */
#include "internal.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const unsigned STATUSES[] = {200, 204, 304, 400, 404, 405, 406, 413, 414, 500, 503};
enum { STATUS_COUNT = sizeof STATUSES / sizeof *STATUSES };
static const double BOUNDS[] = {0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10};
enum { BOUND_COUNT = sizeof BOUNDS / sizeof *BOUNDS };

typedef struct counts {
    uint64_t statuses[STATUS_COUNT], within[BOUND_COUNT], all, bytes;
    double seconds;
} counts;

struct metrics {
    pthread_mutex_t lock;
    double begun;
    counts of[]; /* of each endpoint, and of what is none */
};

metrics *metrics_create(void) {
    metrics *m = calloc(1, sizeof *m + ((size_t)endpoint_count + 1) * sizeof *m->of);
    if (!m) return NULL;
    pthread_mutex_init(&m->lock, NULL);
    m->begun = now_seconds();
    return m;
}

void metrics_free(metrics *m) {
    if (!m) return;
    pthread_mutex_destroy(&m->lock);
    free(m);
}

void metrics_count(metrics *m, const request *r, double seconds, uint64_t bytes) {
    counts *c = &m->of[r->endpoint ? r->endpoint - endpoints : endpoint_count];
    pthread_mutex_lock(&m->lock);
    for (int i = 0; i < STATUS_COUNT; i++) c->statuses[i] += STATUSES[i] == r->answer.status;
    for (int i = 0; i < BOUND_COUNT; i++) c->within[i] += seconds <= BOUNDS[i];
    c->all++;
    c->bytes += bytes;
    c->seconds += seconds;
    pthread_mutex_unlock(&m->lock);
}

static void gauge(buffer *b, const char *name, const char *help, double value) {
    buffer_format(b, "# HELP %s %s\n# TYPE %s gauge\n%s ", name, help, name, name);
    buffer_number(b, value);
    buffer_text(b, "\n");
}

static const char *name_of(int i) {
    return i < endpoint_count ? endpoints[i].name : "other";
}

static void write_requests(buffer *b, const metrics *m) {
    buffer_text(b, "# HELP rqt_requests_total Requests answered.\n# TYPE rqt_requests_total counter\n");
    for (int i = 0; i <= endpoint_count; i++)
        for (int j = 0; j < STATUS_COUNT; j++)
            if (m->of[i].statuses[j])
                buffer_format(b, "rqt_requests_total{endpoint=\"%s\",code=\"%u\"} %llu\n", name_of(i), STATUSES[j],
                              (unsigned long long)m->of[i].statuses[j]);
    buffer_text(b, "# HELP rqt_response_bytes_total Bytes of bodies, compressed where they were.\n"
                   "# TYPE rqt_response_bytes_total counter\n");
    for (int i = 0; i <= endpoint_count; i++)
        if (m->of[i].all)
            buffer_format(b, "rqt_response_bytes_total{endpoint=\"%s\"} %llu\n", name_of(i),
                          (unsigned long long)m->of[i].bytes);
}

static void write_seconds(buffer *b, const metrics *m) {
    buffer_text(b, "# HELP rqt_request_seconds From a request's headers to its answer.\n"
                   "# TYPE rqt_request_seconds histogram\n");
    for (int i = 0; i <= endpoint_count; i++) {
        const counts *c = &m->of[i];
        if (!c->all) continue;
        for (int j = 0; j < BOUND_COUNT; j++)
            buffer_format(b, "rqt_request_seconds_bucket{endpoint=\"%s\",le=\"%g\"} %llu\n", name_of(i), BOUNDS[j],
                          (unsigned long long)c->within[j]);
        buffer_format(b, "rqt_request_seconds_bucket{endpoint=\"%s\",le=\"+Inf\"} %llu\n", name_of(i),
                      (unsigned long long)c->all);
        buffer_format(b, "rqt_request_seconds_sum{endpoint=\"%s\"} %.9g\n", name_of(i), c->seconds);
        buffer_format(b, "rqt_request_seconds_count{endpoint=\"%s\"} %llu\n", name_of(i),
                      (unsigned long long)c->all);
    }
}

void answer_metrics(worker *w, request *r) {
    (void)w;
    service *s = r->service;
    metrics *m = s->metrics;
    answer *a = &r->answer;
    int waiting, working, connections, requests;
    pool_load(s->pool, &waiting, &working);
    http_count(s, &connections, &requests);
    a->status = MHD_HTTP_OK;
    a->type = "text/plain; version=0.0.4; charset=utf-8";
    pthread_mutex_lock(&m->lock);
    write_requests(&a->body, m);
    write_seconds(&a->body, m);
    const double up = now_seconds() - m->begun;
    pthread_mutex_unlock(&m->lock);
    gauge(&a->body, "rqt_connections", "Connections that are open.", connections);
    gauge(&a->body, "rqt_requests_waiting", "Requests in the queue.", waiting);
    gauge(&a->body, "rqt_requests_working", "Requests that a worker answers.", working);
    gauge(&a->body, "rqt_workers", "Workers.", s->options.workers);
    gauge(&a->body, "rqt_sqlite_bytes", "Memory that SQLite and the blocks it keeps take.",
          (double)sqlite3_memory_used());
    gauge(&a->body, "rqt_uptime_seconds", "Since the service began.", up);
}

void answer_health(worker *w, request *r) {
    (void)w;
    r->answer.status = MHD_HTTP_OK;
    r->answer.type = "application/json";
    buffer_text(&r->answer.body, "{\"status\":\"ok\"}\n");
}
