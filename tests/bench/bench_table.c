/* bench_table.c - medians, and one table that people read on the terminal and programs in a CSV file. */
#include "bench.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

double bench_now(void) {
    static int clock = -1;
    if (clock < 0) clock = getenv("BENCH_CPU") ? CLOCK_PROCESS_CPUTIME_ID : CLOCK_MONOTONIC;
    struct timespec t;
    clock_gettime(clock, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

void bench_add(bench_times *times, double value) {
    if (times->runs < BENCH_MOST_RUNS) times->value[times->runs++] = value;
}

static int ascending(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

bench_summary bench_summarise(const bench_times *times) {
    const int n = times->runs;
    if (n == 0) return (bench_summary){0, NAN, NAN, NAN};
    double sorted[BENCH_MOST_RUNS];
    memcpy(sorted, times->value, (size_t)n * sizeof *sorted);
    qsort(sorted, (size_t)n, sizeof *sorted, ascending);
    return (bench_summary){n, (sorted[(n - 1) / 2] + sorted[n / 2]) / 2, sorted[0], sorted[n - 1]};
}

bool bench_table_open(bench_table *table, const char *csv, const char *machine, const char *data) {
    *table = (bench_table){fopen(csv, "w"), machine, data, ""};
    if (!table->csv) return false;
    fprintf(table->csv, "section,what,unit,runs,median,min,max,peer,ratio,aim,met,machine,data\n");
    return true;
}

void bench_table_section(bench_table *table, const char *section, const char *title, const char *ratio) {
    table->section = section;
    printf("\n%s\n", title);
    if (ratio)
        printf("  %-46s %10s %10s %10s  %-7s %5s %9s%s\n", "", "median", "min", "max", "", "runs", ratio,
               *ratio ? "  aim" : "");
}

/* Four digits that say something, whatever the size. */
static const char *number(double value, char text[32]) {
    const double size = fabs(value);
    const int decimals = size >= 1000 ? 0 : size >= 100 ? 1 : size >= 10 ? 2 : 3;
    snprintf(text, 32, "%.*f", decimals, value);
    return text;
}

static void write_row(bench_table *table, const char *what, const char *unit, const bench_summary *s,
                      const char *peer_name, double ratio, bench_aim aim) {
    char a[32], b[32], c[32], r[32] = "", wanted[48] = "", runs[16] = "";
    const bool met = aim.sense == BENCH_AT_MOST ? ratio <= aim.value : ratio >= aim.value;
    if (peer_name) snprintf(r, sizeof r, "%.2f", ratio);
    if (aim.sense != BENCH_NO_AIM)
        snprintf(wanted, sizeof wanted, "%s %g: %s", aim.sense == BENCH_AT_MOST ? "<=" : ">=", aim.value,
                 met ? "met" : "missed");
    const bool many = s->runs > 1;
    if (many) snprintf(runs, sizeof runs, "%d", s->runs);
    printf("  %-46s %10s %10s %10s  %-7s %5s %9s  %s\n", what, number(s->median, a), many ? number(s->low, b) : "",
           many ? number(s->high, c) : "", unit, runs, r, wanted);
    fprintf(table->csv, "%s,\"%s\",%s,%d,%.9g,%.9g,%.9g,\"%s\",", table->section, what, unit, s->runs, s->median,
            s->low, s->high, peer_name ? peer_name : "");
    if (peer_name) fprintf(table->csv, "%.6g", ratio);
    if (aim.sense != BENCH_NO_AIM)
        fprintf(table->csv, ",%s %g,%s", aim.sense == BENCH_AT_MOST ? "<=" : ">=", aim.value, met ? "yes" : "no");
    else
        fprintf(table->csv, ",,");
    fprintf(table->csv, ",\"%s\",\"%s\"\n", table->machine, table->data);
}

void bench_table_row(bench_table *table, const char *what, const bench_times *times, const char *unit,
                     double factor, bool inverse, const char *peer_name, const bench_times *peer, bench_aim aim) {
    const bench_summary raw = bench_summarise(times);
    bench_summary s = raw;
    s.median = inverse ? factor / raw.median : factor * raw.median;
    s.low = inverse ? factor / raw.high : factor * raw.low;
    s.high = inverse ? factor / raw.low : factor * raw.high;
    double ratio = NAN;
    if (peer) {
        const double other = bench_summarise(peer).median;
        ratio = inverse ? other / raw.median : raw.median / other;
    }
    write_row(table, what, unit, &s, peer ? peer_name : NULL, ratio, aim);
}

void bench_table_count(bench_table *table, const char *what, double value, const char *unit, const char *peer_name,
                       double peer, bench_aim aim) {
    const bench_summary s = {1, value, value, value};
    write_row(table, what, unit, &s, peer_name, value / peer, aim);
}

bool bench_table_close(bench_table *table) {
    const bool failed = ferror(table->csv) || fflush(table->csv);
    return fclose(table->csv) == 0 && !failed;
}
