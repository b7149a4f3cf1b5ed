/* bench.h - times, their medians, the table that shows them, and SQL that stops the bench where it fails. */
#ifndef RQT_BENCH_H
#define RQT_BENCH_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

enum { BENCH_MOST_RUNS = 1024 };

/* What one thing took, run by run. */
typedef struct bench_times {
    int runs;
    double value[BENCH_MOST_RUNS]; /* runs past the last one are not kept */
} bench_times;

typedef struct bench_summary {
    int runs;
    double median, low, high;
} bench_summary;

/* Seconds; of the processor where the environment has BENCH_CPU: for a machine that others use, too. */
double bench_now(void);
void bench_add(bench_times *times, double value);
bench_summary bench_summarise(const bench_times *times);

/* What a ratio should be; no aim: the number is shown for itself. */
typedef enum bench_sense { BENCH_NO_AIM, BENCH_AT_MOST, BENCH_AT_LEAST } bench_sense;
typedef struct bench_aim {
    bench_sense sense;
    double value;
} bench_aim;

typedef struct bench_table {
    FILE *csv;
    const char *machine, *data, *section;
} bench_table;

/* Opens the CSV file; NULL machine and data are not allowed. false: it cannot be written. */
bool bench_table_open(bench_table *table, const char *csv, const char *machine, const char *data);
/* A heading above the rows that follow. Columns: median, min, max, unit, runs, ratio, aim. ratio: what it is of;
 * "": there are none; NULL: rows of counts, which need no names of columns. */
void bench_table_section(bench_table *table, const char *section, const char *title, const char *ratio);
/* One row: the times scaled into the unit (factor * value, or factor / value when inverse), and the ratio of its
 * median to the peer's, where there is one (inverse: of the rates). */
void bench_table_row(bench_table *table, const char *what, const bench_times *times, const char *unit,
                     double factor, bool inverse, const char *peer_name, const bench_times *peer, bench_aim aim);
/* A single number that is counted, not timed. */
void bench_table_count(bench_table *table, const char *what, double value, const char *unit, const char *peer_name,
                       double peer, bench_aim aim);
/* false: the CSV file is not whole. */
bool bench_table_close(bench_table *table);

/* ---------------------------------------------------------------------------------------- SQL: bench_sql.c -- */
struct sqlite3;
struct sqlite3_stmt;
/* Says both on standard error, and ends the program. */
_Noreturn void bench_stop(const char *what, const char *why);
/* A new connection with the extension; the caller closes it. */
struct sqlite3 *bench_open(const char *path, const char *extension, bool writable);
struct sqlite3_stmt *bench_prepare(struct sqlite3 *db, const char *sql);
/* All rows; their number. The statement is reset. The first row's first column may be a BLOB, whose size goes to
 * *bytes (may be NULL). */
int64_t bench_run(struct sqlite3_stmt *statement, int64_t *bytes);

/* Rows of section "options": db may be written; boxes are x0, y0, x1, y1 in its coordinates. bench_options.c */
void bench_options(bench_table *table, struct sqlite3 *db, const double box[4], const double whole[4]);

#endif
