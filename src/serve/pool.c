/* pool.c - the workers: threads that take requests from one queue, in order.
 *
 * The queue is short: who would wait for longer than an answer may take is told so at once (503), and what is asked
 * stays little. A request whose time is over when its turn comes is not begun.
 */
#include "internal.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>

struct pool {
    service *service;
    pthread_mutex_t lock;
    pthread_cond_t asked;
    request *first, **last;
    int waiting, working, most;
    bool is_over;
    atomic_bool is_hurried;
    int count;
    struct seat {
        pool *pool;
        pthread_t thread;
        worker worker;
    } seats[];
};

static request *take(pool *p) {
    pthread_mutex_lock(&p->lock);
    while (!p->first && !p->is_over) pthread_cond_wait(&p->asked, &p->lock);
    request *r = p->first;
    if (r) {
        p->first = r->next;
        if (!p->first) p->last = &p->first;
        p->waiting--;
        p->working++;
    }
    pthread_mutex_unlock(&p->lock);
    return r;
}

static void *work(void *context) {
    struct seat *seat = context;
    pool *p = seat->pool;
    for (request *r; (r = take(p)) != NULL;) {
        const double deadline = r->received + p->service->options.max_seconds;
        databases_deadline(seat->worker.databases, seat->worker.database_count, deadline);
        if (now_seconds() > deadline)
            answer_problem(r, MHD_HTTP_SERVICE_UNAVAILABLE, "the service is busy: ask again");
        else
            endpoint_answer(&seat->worker, r);
        answer_compress(r);
        r->phase = REQUEST_ANSWERED;
        MHD_resume_connection(r->connection);
        /* Not before: while somebody works, the library must not be stopped. */
        pthread_mutex_lock(&p->lock);
        p->working--;
        pthread_mutex_unlock(&p->lock);
    }
    return NULL;
}

pool *pool_create(service *s, int workers, int queue) {
    pool *p = calloc(1, sizeof *p + (size_t)workers * sizeof *p->seats);
    if (!p) return NULL;
    p->service = s;
    p->most = queue;
    p->last = &p->first;
    pthread_mutex_init(&p->lock, NULL);
    pthread_cond_init(&p->asked, NULL);
    for (; p->count < workers; p->count++) {
        struct seat *seat = &p->seats[p->count];
        seat->pool = p;
        seat->worker = (worker){s, databases_create(s), s->options.database_count};
        if (seat->worker.databases && pthread_create(&seat->thread, NULL, work, seat) == 0) continue;
        databases_free(seat->worker.databases, s->options.database_count);
        pool_free(p);
        return NULL;
    }
    return p;
}

bool pool_ask(pool *p, request *r) {
    pthread_mutex_lock(&p->lock);
    const bool has_room = p->waiting < p->most;
    if (has_room) {
        r->next = NULL;
        *p->last = r;
        p->last = &r->next;
        p->waiting++;
        pthread_cond_signal(&p->asked);
    }
    pthread_mutex_unlock(&p->lock);
    return has_room;
}

void pool_load(pool *p, int *waiting, int *working) {
    pthread_mutex_lock(&p->lock);
    *waiting = p->waiting;
    *working = p->working;
    pthread_mutex_unlock(&p->lock);
}

void pool_hurry(pool *p) {
    atomic_store(&p->is_hurried, true);
}

bool pool_is_hurried(const pool *p) {
    return atomic_load(&p->is_hurried);
}

void pool_free(pool *p) {
    if (!p) return;
    pthread_mutex_lock(&p->lock);
    p->is_over = true;
    pthread_cond_broadcast(&p->asked);
    pthread_mutex_unlock(&p->lock);
    for (int i = 0; i < p->count; i++) {
        pthread_join(p->seats[i].thread, NULL);
        databases_free(p->seats[i].worker.databases, p->service->options.database_count);
    }
    pthread_cond_destroy(&p->asked);
    pthread_mutex_destroy(&p->lock);
    free(p);
}
