/* serve.c - the service's life: a socket that listens, the parts, signals, and the end.
 *
 * The main thread waits for a signal and looks after slow clients meanwhile. At the first SIGINT or SIGTERM nothing
 * new is accepted and what is under way is answered; at the second, or when that takes longer than any answer may,
 * what still runs is told to stop, which it does with a 503.
 */
#include "internal.h"

#include <errno.h>
#include <netdb.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

/* Requests that wait, for each worker. */
enum { QUEUE_PER_WORKER = 64, BACKLOG = 511 };
enum { SWEEP_MILLISECONDS = 250, LEAVING_MILLISECONDS = 10, GRACE_SECONDS = 5 };

double now_seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + (double)t.tv_nsec * 1e-9;
}

/* The signal that came, or 0. */
static int wait_for_signal(const sigset_t *set, long milliseconds) {
    const struct timespec wait = {milliseconds / 1000, milliseconds % 1000 * 1000000};
    const int number = sigtimedwait(set, NULL, &wait);
    return number > 0 ? number : 0;
}

static int fail(char *why, size_t size, int listening, struct addrinfo *found, const char *address, int port) {
    snprintf(why, size, "%s port %d: %s%s", address, port, strerror(errno),
             errno == EADDRINUSE ? " (--port 0 takes one that is free)" : "");
    if (listening >= 0) close(listening);
    freeaddrinfo(found);
    return -1;
}

/* A socket that listens; where, as a URL. -1 after a sentence. */
static int listen_at(const char *address, int port, char url[128], char *why, size_t size) {
    char name[8], host[64];
    const struct addrinfo wanted = {.ai_family = AF_UNSPEC,
                                    .ai_socktype = SOCK_STREAM,
                                    .ai_flags = AI_NUMERICHOST | AI_NUMERICSERV | AI_PASSIVE};
    struct addrinfo *found = NULL;
    snprintf(name, sizeof name, "%d", port);
    if (getaddrinfo(address, name, &wanted, &found)) {
        snprintf(why, size, "%s is no numeric address", address);
        return -1;
    }
    const int yes = 1, listening = socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    struct sockaddr_storage bound;
    socklen_t length = sizeof bound;
    if (listening < 0 || setsockopt(listening, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes) ||
        bind(listening, found->ai_addr, found->ai_addrlen) || listen(listening, BACKLOG) ||
        getsockname(listening, (struct sockaddr *)&bound, &length))
        return fail(why, size, listening, found, address, port);
    freeaddrinfo(found);
    getnameinfo((struct sockaddr *)&bound, length, host, sizeof host, name, sizeof name,
                NI_NUMERICHOST | NI_NUMERICSERV);
    const bool is_v6 = bound.ss_family == AF_INET6;
    snprintf(url, 128, "http://%s%s%s:%s/", is_v6 ? "[" : "", host, is_v6 ? "]" : "", name);
    return listening;
}

/* Lets what is under way finish, if it does in time. */
static void leave(service *s, const sigset_t *signals) {
    http_quiesce(s);
    const double hurry = now_seconds() + s->options.max_seconds, end = hurry + GRACE_SECONDS;
    for (;;) {
        int waiting, working;
        const double now = now_seconds();
        /* A suspended connection must be resumed before the library may stop, and who resumes it must be done with
         * that: so much is always waited for. */
        const bool is_shut = http_shut(s, now > end);
        pool_load(s->pool, &waiting, &working);
        if (is_shut && working == 0) break;
        if (now > hurry || wait_for_signal(signals, LEAVING_MILLISECONDS)) pool_hurry(s->pool);
        if (now > hurry) (void)wait_for_signal(signals, LEAVING_MILLISECONDS);
        http_sweep(s);
    }
}

bool serve_run(const serve_options *options, serve_tell *tell, void *context, char *why, size_t size) {
    service s = {.options = *options};
    char url[128];
    sigset_t signals;
    sigemptyset(&signals);
    sigaddset(&signals, SIGINT);
    sigaddset(&signals, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &signals, NULL); /* in all threads that come from this one */
    signal(SIGPIPE, SIG_IGN);
    sqlite3_hard_heap_limit64(options->memory);
    const int listening = listen_at(options->address, options->port, url, why, size);
    if (listening < 0) return false;
    s.metrics = metrics_create();
    s.pool = s.metrics ? pool_create(&s, options->workers, options->workers * QUEUE_PER_WORKER) : NULL;
    if (!s.pool) snprintf(why, size, "out of memory or threads");
    const bool ok = s.pool && http_begin(&s, listening, why, size);
    if (ok) {
        tell(context, url);
        while (!wait_for_signal(&signals, SWEEP_MILLISECONDS)) http_sweep(&s);
        leave(&s, &signals);
    } else {
        close(listening);
    }
    http_end(&s);
    pool_free(s.pool);
    metrics_free(s.metrics);
    return ok;
}
