/* command_sources.c - what `rqt import` and `rqt update` share: command_sources.h. */
#include "command_sources.h"

#include <getopt.h>
#include <math.h>
#include <signal.h>
#include <string.h>
#include <strings.h>

int sources_set_nodata(import_options *options) {
    double number;
    /* Values like -3.4028235e38 and nan mark voids in real rasters. */
    if (!cli_number(optarg, &number)) {
        if (strcasecmp(optarg, "nan")) return cli_usage("--nodata %s is not a number", optarg);
        number = (double)NAN;
    }
    options->has_nodata = true;
    options->nodata = number;
    return CLI_OK;
}

int sources_set_unit(import_options *options) {
    double number;
    if (strcmp(optarg, "m") && strcmp(optarg, "ft") && strcmp(optarg, "us-ft") &&
        !(cli_number(optarg, &number) && number > 0))
        return cli_usage("--unit %s: m, ft, us-ft or a number of metres", optarg);
    options->unit = optarg;
    return CLI_OK;
}

/* Set by the signal; the progress callback hands it on. */
static volatile sig_atomic_t stopped;

static void stop(int number) {
    (void)number;
    stopped = 1;
}

static bool on_progress(void *context, const char *stage, double done, int64_t samples) {
    cli_progress_show(context, stage, done, samples);
    return !stopped;
}

static void on_notice(void *context, const char *sentence) {
    cli_progress_wipe(context);
    cli_say("%s", sentence);
}

void sources_watch(import_options *options, cli_progress *progress) {
    cli_progress_begin(progress);
    options->progress = on_progress;
    options->notice = on_notice;
    options->context = progress;
    const struct sigaction action = {.sa_handler = stop, .sa_flags = (int)SA_RESETHAND};
    (void)sigaction(SIGINT, &action, NULL);
    (void)sigaction(SIGTERM, &action, NULL);
    /* A limit on the size of files (ulimit -f) is a full disk, of which we and SQLite know how to tell. */
    (void)signal(SIGXFSZ, SIG_IGN);
}
