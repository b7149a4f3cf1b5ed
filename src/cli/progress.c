/* progress.c - one line on a terminal, rewritten: stage, bar, per cent, rate, time left. Nothing anywhere else. */
#include "cli.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

#define BETWEEN 0.1 /* seconds from one redrawing to the next */
#define SETTLE 0.5  /* seconds before a rate is worth showing */

double cli_seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + (double)t.tv_nsec * 1e-9;
}

void cli_progress_begin(cli_progress *progress) {
    const char *terminal = getenv("TERM");
    *progress =
        (cli_progress){.shown = isatty(STDERR_FILENO) && !(terminal && !strcmp(terminal, "dumb")), .last = -1};
}

static int bar_width(void) {
    struct winsize window;
    const int columns = ioctl(STDERR_FILENO, TIOCGWINSZ, &window) == 0 && window.ws_col ? window.ws_col : 80;
    const int rest = columns - 56; /* what stands beside the bar */
    return rest < 4 ? 0 : rest > 40 ? 40 : rest;
}

void cli_progress_show(cli_progress *p, const char *stage, double done, int64_t count) {
    if (!p->shown) return;
    const double now = cli_seconds();
    if (strncmp(p->stage, stage, sizeof p->stage - 1)) {
        snprintf(p->stage, sizeof p->stage, "%s", stage);
        p->start = now;
        p->last = -1;
    }
    if (now - p->last < BETWEEN) return;
    p->last = now;
    p->dirty = true;
    done = done < 0 ? 0 : done > 1 ? 1 : done;
    const double spent = now - p->start;
    const int width = bar_width(), full = (int)(done * width);
    fprintf(stderr, "\r%-8.8s ", stage);
    if (width) {
        fputc('[', stderr);
        for (int i = 0; i < width; i++) fputc(i < full ? '#' : '.', stderr);
        fputs("] ", stderr);
    }
    fprintf(stderr, "%3.0f %%", floor(done * 100));
    if (spent > SETTLE && done > 0) {
        const double left = spent / done * (1 - done);
        const double rate = (double)count * done / spent;
        fprintf(stderr, "  %.1f %s/s", p->unit ? rate : rate / 1e6, p->unit ? p->unit : "Msamples");
        if (left < 360000) fprintf(stderr, "  %d:%02d left", (int)left / 60, (int)left % 60);
    }
    fputs("\033[K", stderr);
    fflush(stderr);
}

void cli_progress_wipe(cli_progress *p) {
    if (!p->dirty) return;
    fputs("\r\033[K", stderr);
    fflush(stderr);
    p->dirty = false;
}
