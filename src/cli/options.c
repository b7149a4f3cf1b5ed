/* options.c - the command line read with care: what is not exactly a number, a list or a region is refused. */
#include "cli.h"
#include "format.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int cli_option(int argc, char **argv, const char *shorts, const struct option *longs) {
    char with_colon[64] = ":"; /* makes a missing argument ':' instead of '?' */
    strncat(with_colon, shorts, sizeof with_colon - 2);
    opterr = 0;
    const int at = optind ? optind : 1;
    const int option = getopt_long(argc, argv, with_colon, longs, NULL);
    if (option != '?' && option != ':') return option;
    /* For a long option the word before optind is it; for a short one optopt. */
    const char *word = argv[optind > at ? optind - 1 : at];
    const bool is_long = word && !strncmp(word, "--", 2);
    char letter[3] = {'-', (char)optopt, 0};
    const char *name = is_long ? word : letter;
    const int length = (int)strcspn(name, "=");
    if (option == ':') {
        cli_usage("the option %.*s needs a value", length, name);
        return '?';
    }
    int alike = 0;
    bool exact = false;
    for (const struct option *o = longs; is_long && o->name; o++) {
        if (strncmp(o->name, name + 2, (size_t)length - 2)) continue;
        alike++;
        exact = exact || strlen(o->name) == (size_t)length - 2;
    }
    if (exact || alike == 1)
        cli_usage("the option %.*s takes no value", length, name);
    else if (alike > 1)
        cli_usage("the option %.*s is not complete: several begin so", length, name);
    else
        cli_usage("there is no option %.*s", length, name);
    return '?';
}

bool cli_number(const char *text, double *value) {
    char *end;
    if (!*text || isspace((unsigned char)*text)) return false;
    *value = strtod(text, &end);
    return !*end && isfinite(*value);
}

bool cli_integer(const char *text, int64_t low, int64_t high, int64_t *value) {
    char *end;
    if (!*text || isspace((unsigned char)*text)) return false;
    errno = 0;
    long long n = strtoll(text, &end, 10);
    *value = n;
    return !errno && !*end && n >= low && n <= high;
}

/* The next number of a list and its end; false when there is none. Spaces around numbers do no harm. */
static bool list_number(const char **text, double *value) {
    char *end;
    while (isspace((unsigned char)**text)) ++*text;
    if (!**text) return false;
    *value = strtod(*text, &end);
    if (end == *text || !isfinite(*value)) return false;
    while (isspace((unsigned char)*end)) end++;
    *text = end;
    return true;
}

int cli_eps(const char *text, double eps[CLI_MAX_EPS]) {
    const char *at = text;
    for (int count = 0; count < CLI_MAX_EPS; at++) {
        if (!list_number(&at, &eps[count]) || (*at && *at != ',')) {
            cli_usage("--eps %s is no tolerance in metres: a number like 5, or a list like 1,2,5", text);
            return 0;
        }
        if (eps[count] < 0) {
            cli_usage("--eps %s: a tolerance is not negative", text);
            return 0;
        }
        if (eps[count] == 0) eps[count] = 0; /* no minus zero in captions */
        count++;
        if (!*at) return count;
    }
    cli_usage("--eps %s: at most %d tolerances", text, CLI_MAX_EPS);
    return 0;
}

static int set_word(const char **field, const char *option, const char *const *words, const char *word) {
    for (int i = 0; words[i]; i++)
        if (strcmp(words[i], word) == 0) {
            *field = words[i];
            return CLI_OK;
        }
    char known[64] = "";
    for (int i = 0; words[i]; i++) {
        if (i) strncat(known, words[i + 1] ? ", " : " and ", sizeof known - strlen(known) - 1);
        strncat(known, words[i], sizeof known - strlen(known) - 1);
    }
    return cli_usage("--%s %s: there is no such %s; there are %s", option, word, option, known);
}

int cli_set_mode(cli_answer_options *options, const char *mode) {
    static const char *const modes[] = {"cover", "snap", "border", "cut", NULL};
    return set_word(&options->mode, "mode", modes, mode);
}

int cli_set_outline(cli_answer_options *options, const char *outline) {
    static const char *const outlines[] = {"exact", "tol", NULL};
    return set_word(&options->outline, "outline", outlines, outline);
}

const char *cli_options_json(cli_answer_options *options) {
    snprintf(options->json, sizeof options->json, "{\"mode\":\"%s\",\"outline\":\"%s\"}",
             options->mode ? options->mode : "cover", options->outline ? options->outline : "exact");
    return options->json;
}

static char *box_wkt(const double box[4]) {
    static const int corner[] = {0, 1, 2, 1, 2, 3, 0, 3, 0, 1};
    char *wkt = malloc(400), *end = wkt;
    if (!wkt) return NULL;
    end += sprintf(end, "POLYGON((");
    for (int i = 0; i < 10; i++) {
        char number[32];
        format_double(box[corner[i]], number);
        end += sprintf(end, "%s%s", i == 0 ? "" : i % 2 ? " " : ",", number);
    }
    sprintf(end, "))");
    return wkt;
}

char *cli_region(const char *text) {
    const char *at = text;
    while (isspace((unsigned char)*at)) at++;
    char *wkt;
    if (*at && (isdigit((unsigned char)*at) || strchr("+-.", *at))) {
        double box[4];
        for (int i = 0; i < 4; i++) {
            const bool ends_well = list_number(&at, &box[i]) && *at == (i < 3 ? ',' : '\0');
            if (!ends_well) {
                cli_usage("--region %s is not x0,y0,x1,y1: four numbers with commas", text);
                return NULL;
            }
            if (i < 3) at++;
        }
        const double in_order[4] = {fmin(box[0], box[2]), fmin(box[1], box[3]), fmax(box[0], box[2]),
                                    fmax(box[1], box[3])};
        wkt = box_wkt(in_order);
    } else {
        if (!*at) {
            cli_usage("--region is empty: WKT, or x0,y0,x1,y1");
            return NULL;
        }
        wkt = strdup(text);
    }
    if (!wkt) cli_fail("out of memory");
    return wkt;
}
