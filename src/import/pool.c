/* pool.c - threads that share the items of a task.
 *
 * The caller hands out one task at a time and waits for all of its items; which thread takes which item is left to
 * chance, so no result may depend on it. The threads live as long as the pool: a task starts within microseconds.
 */
#include "parts.h"

#include <pthread.h>
#include <stdlib.h>

typedef struct worker {
    struct import_pool *pool;
    int number;
    pthread_t thread;
} worker;

struct import_pool {
    pthread_mutex_t lock;
    pthread_cond_t started, finished;
    import_task *task;
    void *context;
    int32_t next, count, done;
    bool stop;
    int workers;
    worker *worker;
};

static void *work(void *context) {
    const worker *w = context;
    import_pool *p = w->pool;
    pthread_mutex_lock(&p->lock);
    for (;;) {
        while (!p->stop && p->next >= p->count) pthread_cond_wait(&p->started, &p->lock);
        if (p->stop) break;
        const int32_t item = p->next++;
        import_task *task = p->task;
        void *own = p->context;
        pthread_mutex_unlock(&p->lock);
        task(own, w->number, item);
        pthread_mutex_lock(&p->lock);
        if (++p->done == p->count) pthread_cond_signal(&p->finished);
    }
    pthread_mutex_unlock(&p->lock);
    return NULL;
}

bool import_pool_create(const import_job *job, import_pool **pool) {
    const int jobs = job->options->jobs;
    import_pool *p = *pool = calloc(1, sizeof *p);
    if (!p) return import_no_memory(job, "starting threads");
    pthread_mutex_init(&p->lock, NULL);
    pthread_cond_init(&p->started, NULL);
    pthread_cond_init(&p->finished, NULL);
    p->worker = calloc((size_t)jobs, sizeof *p->worker);
    if (!p->worker) return import_no_memory(job, "starting threads");
    for (int i = 0; i < jobs; i++) {
        p->worker[i] = (worker){.pool = p, .number = i};
        if (pthread_create(&p->worker[i].thread, NULL, work, &p->worker[i]) != 0) break;
        p->workers++;
    }
    return p->workers > 0 || import_refuse(job, "no thread could be started");
}

void import_pool_free(import_pool *p) {
    if (!p) return;
    pthread_mutex_lock(&p->lock);
    p->stop = true;
    pthread_cond_broadcast(&p->started);
    pthread_mutex_unlock(&p->lock);
    for (int i = 0; i < p->workers; i++) pthread_join(p->worker[i].thread, NULL);
    free(p->worker);
    pthread_cond_destroy(&p->finished);
    pthread_cond_destroy(&p->started);
    pthread_mutex_destroy(&p->lock);
    free(p);
}

int import_pool_workers(const import_pool *pool) {
    return pool->workers;
}

void import_pool_run(import_pool *p, import_task *task, void *context, int32_t n) {
    if (n <= 0) return;
    pthread_mutex_lock(&p->lock);
    p->task = task;
    p->context = context;
    p->next = p->done = 0;
    p->count = n;
    pthread_cond_broadcast(&p->started);
    while (p->done < p->count) pthread_cond_wait(&p->finished, &p->lock);
    p->next = p->count = 0;
    pthread_mutex_unlock(&p->lock);
}
