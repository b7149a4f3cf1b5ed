/* chart_measure.c - one point of a chart: the true error, the size, the bytes and the time of one mesh, through
 * SQL.
 *
 * Errors and counts are rqt_verify()'s, bytes rqt_explain()'s, times those of rqt_mesh(..., 'strip', ...) from the
 * step of a prepared statement to the BLOB: warm (the median of several runs on a connection that has asked before)
 * and fresh (the first query of a new connection; opening it does not count).
 */
#include "chart.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ENOUGH_SECONDS 0.2 /* of runs of one query, after which there is no other */
enum { MOST_RUNS = 99 };

/* ----------------------------------------------------------------------------------------------- points -- */
bool chart_points_add(chart_points *points, const chart_point *point) {
    if (points->count == points->capacity) {
        const int capacity = points->capacity ? 2 * points->capacity : 64;
        chart_point *rows = realloc(points->rows, (size_t)capacity * sizeof *rows);
        if (!rows) {
            cli_fail("out of memory");
            return false;
        }
        points->rows = rows;
        points->capacity = capacity;
    }
    points->rows[points->count++] = *point;
    return true;
}

void chart_points_free(chart_points *points) {
    free(points->rows);
    *points = (chart_points){0};
}

static bool is_dominated(const chart_point *p, const chart_point *by) {
    return by->ms <= p->ms && by->max_error <= p->max_error && by->vertices <= p->vertices &&
           (by->ms < p->ms || by->max_error < p->max_error || by->vertices < p->vertices);
}

void chart_mark_front(chart_points *points) {
    for (int i = 0; i < points->count; i++) {
        chart_point *p = &points->rows[i];
        p->is_front = p->ms >= 0;
        for (int j = 0; j < points->count && p->is_front; j++)
            p->is_front = points->rows[j].ms < 0 || !is_dominated(p, &points->rows[j]);
    }
}

/* ---------------------------------------------------------------------------------------------- methods -- */
/* Is the text, up to its end or a stop character, one of the words (NULL-terminated)? Returns it, or NULL. */
static const char *find_word(const char *text, size_t length, const char *const *words) {
    for (; *words; words++)
        if (strlen(*words) == length && !strncmp(*words, text, length)) return *words;
    return NULL;
}

static bool read_method(const char *text, size_t length, chart_method *method) {
    static const char *const metrics[] = {"exact", "minimal", "local", "wedgie", "euclid", NULL};
    static const char *const selects[] = {"threshold", "topdown", "bottomup", NULL};
    const char *slash = memchr(text, '/', length);
    const size_t first = slash ? (size_t)(slash - text) : length;
    const char *metric = find_word(text, first, metrics);
    const char *select = slash ? find_word(slash + 1, length - first - 1, selects) : selects[0];
    if (!metric || !select) {
        cli_usage("--methods: there is no method %.*s: exact, minimal, local, wedgie or euclid, alone or followed "
                  "by /threshold, /topdown or /bottomup",
                  (int)length, text);
        return false;
    }
    method->is_selected_otherwise = select != selects[0];
    snprintf(method->name, sizeof method->name, method->is_selected_otherwise ? "%s/%s" : "%s", metric, select);
    snprintf(method->options, sizeof method->options, "{\"metric\":\"%s\",\"select\":\"%s\"}", metric, select);
    return true;
}

int chart_methods(const char *text, chart_method methods[CHART_MAX_METHODS]) {
    int count = 0;
    for (const char *at = text;; at++) {
        const size_t length = strcspn(at, ",");
        chart_method next;
        if (!read_method(at, length, &next)) return 0;
        for (int i = 0; i < count; i++)
            if (!strcmp(methods[i].name, next.name)) {
                cli_usage("--methods: %s is given twice", next.name);
                return 0;
            }
        methods[count++] = next; /* there are no more than 15 different ones */
        at += length;
        if (!*at) return count;
    }
}

/* -------------------------------------------------------------------------------------------- measuring -- */
static sqlite3_stmt *prepare(sqlite3 *db, const char *sql, const chart_query *q, const chart_method *method,
                             double eps) {
    sqlite3_stmt *statement = cli_prepare(db, sql);
    if (!statement) return NULL;
    cli_bind_query(statement, q->region, eps, q->terrain);
    sqlite3_bind_text(statement, 4, method->options, -1, SQLITE_STATIC);
    return statement;
}

/* A failure of a query is the method's own unless the file or the memory is at fault. */
static chart_answer explain_failure(sqlite3 *db, const chart_method *method) {
    const int code = sqlite3_errcode(db) & 0xFF;
    if (code != SQLITE_ERROR) {
        cli_fail_database(db);
        return CHART_BROKEN;
    }
    const char *text = sqlite3_errmsg(db), *colon = strncmp(text, "rqt_", 4) ? NULL : strstr(text, "(): ");
    cli_say("the method %s is left out: %s", method->name, colon ? colon + 4 : text);
    return CHART_REFUSED;
}

static chart_answer ask_verifier(const chart_query *q, const chart_method *method, double eps, chart_point *p) {
    sqlite3_stmt *row =
        prepare(q->db, "SELECT max_error, rms_error, samples, vertices, triangles FROM rqt_verify(?1, ?2, ?3, ?4)",
                q, method, eps);
    if (!row) return CHART_BROKEN;
    chart_answer answer = CHART_MEASURED;
    if (sqlite3_step(row) == SQLITE_ROW) {
        p->max_error = sqlite3_column_double(row, 0);
        p->rms_error = sqlite3_column_double(row, 1);
        p->samples = sqlite3_column_int64(row, 2);
        p->vertices = sqlite3_column_int64(row, 3);
        p->triangles = sqlite3_column_int64(row, 4);
    } else {
        answer = explain_failure(q->db, method);
    }
    sqlite3_finalize(row);
    return answer;
}

static chart_answer ask_bytes(const chart_query *q, const chart_method *method, double eps, chart_point *p) {
    sqlite3_stmt *row =
        prepare(q->db, "SELECT ifnull(sum(bytes), 0), count(*) FROM rqt_explain(?1, ?2, ?3, ?4)", q, method, eps);
    if (!row) return CHART_BROKEN;
    chart_answer answer = CHART_MEASURED;
    if (sqlite3_step(row) == SQLITE_ROW) {
        p->bytes = sqlite3_column_int64(row, 0);
        p->blocks = sqlite3_column_int64(row, 1);
    } else {
        answer = explain_failure(q->db, method);
    }
    sqlite3_finalize(row);
    return answer;
}

static int compare_times(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Pages that SQLite read from the file since the last call. Their number times their size is what a query cost the
 * disk, or the system's cache of it: index and tables included. */
static int64_t pages_read(sqlite3 *db) {
    int now = 0, highest = 0;
    sqlite3_db_status(db, SQLITE_DBSTATUS_CACHE_MISS, &now, &highest, 1);
    return now;
}

static int64_t page_size(sqlite3 *db) {
    sqlite3_stmt *row = cli_prepare(db, "PRAGMA page_size");
    const int64_t size = row && sqlite3_step(row) == SQLITE_ROW ? sqlite3_column_int64(row, 0) : 0;
    sqlite3_finalize(row);
    return size;
}

/* Milliseconds of one run; -1 when it failed. */
static double run_once(sqlite3_stmt *statement) {
    const double begin = cli_seconds();
    const bool ok = sqlite3_step(statement) == SQLITE_ROW && sqlite3_column_blob(statement, 0);
    const double spent = cli_seconds() - begin;
    sqlite3_reset(statement);
    return ok ? 1000 * spent : -1;
}

static const char MESH[] = "SELECT rqt_mesh(?1, ?2, 'strip', ?3, ?4)";

static chart_answer time_warm(const chart_query *q, const chart_method *method, double eps, chart_point *p) {
    sqlite3_stmt *mesh = prepare(q->db, MESH, q, method, eps);
    if (!mesh) return CHART_BROKEN;
    chart_answer answer = CHART_MEASURED;
    double times[MOST_RUNS];
    const double begin = cli_seconds();
    for (p->runs = 0; p->runs < q->runs && p->runs < MOST_RUNS; p->runs++) {
        times[p->runs] = run_once(mesh);
        if (times[p->runs] < 0) {
            answer = explain_failure(q->db, method);
            break;
        }
        /* An odd number, so that the median is a time that was measured. */
        if (p->runs % 2 == 0 && cli_seconds() - begin > ENOUGH_SECONDS) {
            p->runs++;
            break;
        }
    }
    sqlite3_finalize(mesh);
    if (answer != CHART_MEASURED) return answer;
    qsort(times, (size_t)p->runs, sizeof *times, compare_times);
    p->ms = times[p->runs / 2];
    return CHART_MEASURED;
}

static chart_answer time_fresh(const chart_query *q, const chart_method *method, double eps, chart_point *p) {
    double times[MOST_RUNS];
    int runs = 0;
    for (const double begin = cli_seconds(); runs < q->runs && runs < MOST_RUNS; runs++) {
        if (runs % 2 && cli_seconds() - begin > ENOUGH_SECONDS) break;
        sqlite3 *db = cli_open(q->path);
        sqlite3_stmt *mesh = db ? prepare(db, MESH, q, method, eps) : NULL;
        chart_answer answer = mesh ? CHART_MEASURED : CHART_BROKEN;
        if (mesh) (void)pages_read(db);
        if (mesh && (times[runs] = run_once(mesh)) < 0) answer = explain_failure(db, method);
        if (answer == CHART_MEASURED) p->fresh_bytes = pages_read(db) * page_size(db);
        sqlite3_finalize(mesh);
        sqlite3_close(db);
        if (answer != CHART_MEASURED) return answer;
    }
    qsort(times, (size_t)runs, sizeof *times, compare_times);
    p->fresh_ms = times[runs / 2];
    return CHART_MEASURED;
}

chart_answer chart_measure(const chart_query *q, const chart_method *method, double eps, chart_point *point) {
    *point = (chart_point){.is_selected_otherwise = method->is_selected_otherwise, .eps = eps};
    snprintf(point->series, sizeof point->series, "%s", method->name);
    snprintf(point->terrain, sizeof point->terrain, "%s", q->terrain ? q->terrain : "");
    /* The verifier's query warms the connection for the others. */
    chart_answer answer = ask_verifier(q, method, eps, point);
    if (answer == CHART_MEASURED) answer = ask_bytes(q, method, eps, point);
    if (answer == CHART_MEASURED) answer = time_warm(q, method, eps, point);
    if (answer == CHART_MEASURED) answer = time_fresh(q, method, eps, point);
    return answer;
}
