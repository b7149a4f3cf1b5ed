/* bench_options.c - what options and functions beside the plain mesh cost, each beside the plain query that it is
 * most like, warm, in turns. */
#include "bench.h"

#include <math.h>
#include <sqlite3.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { TURNS = 15, ROADS = 5000, ROAD_POINTS = 20, CORNERS = 256 };

/* A table of short roads all over the terrain, with half a metre each. */
static void make_roads(sqlite3 *db, const double whole[4]) {
    sqlite3_stmt *s;
    uint64_t state = 1;
    if (sqlite3_exec(db, "BEGIN; DROP TABLE IF EXISTS bench_road; CREATE TABLE bench_road(geom, eps)", NULL, NULL,
                     NULL) != SQLITE_OK ||
        sqlite3_prepare_v2(db, "INSERT INTO bench_road VALUES(?1, 0.5)", -1, &s, NULL) != SQLITE_OK)
        bench_stop("bench_road", sqlite3_errmsg(db));
    for (int road = 0; road < ROADS; road++) {
        char text[ROAD_POINTS * 48 + 16];
        size_t n = (size_t)snprintf(text, sizeof text, "LINESTRING(");
        double at[2], step[2];
        for (int c = 0; c < 4; c++) {
            state = state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
            const double share = (double)(state >> 11) * 0x1p-53;
            if (c < 2)
                at[c] = whole[c] + share * (whole[c + 2] - whole[c]);
            else
                step[c - 2] = (share - 0.5) / 1000 * (whole[c] - whole[c - 2]);
        }
        for (int i = 0; i < ROAD_POINTS; i++)
            n += (size_t)snprintf(text + n, sizeof text - n, "%s%.3f %.3f", i ? "," : "", at[0] + i * step[0],
                                  at[1] + i * step[1] + (i % 3) * step[0] / 2);
        snprintf(text + n, sizeof text - n, ")");
        sqlite3_bind_text(s, 1, text, -1, SQLITE_TRANSIENT);
        if (sqlite3_step(s) != SQLITE_DONE) bench_stop("bench_road", sqlite3_errmsg(db));
        sqlite3_reset(s);
    }
    sqlite3_finalize(s);
    if (sqlite3_exec(db, "COMMIT", NULL, NULL, NULL) != SQLITE_OK) bench_stop("bench_road", sqlite3_errmsg(db));
}

typedef struct question {
    const char *what, *sql, *options; /* ?1: region, ?2: eps, ?3: options */
    const char *region;
    double eps;
    int peer; /* question; -1: none */
} question;

static void ask(sqlite3 *db, sqlite3_stmt *s, bench_times *times) {
    const double begin = bench_now();
    if (sqlite3_step(s) != SQLITE_ROW) bench_stop(sqlite3_sql(s), sqlite3_errmsg(db));
    sqlite3_reset(s);
    if (times) bench_add(times, bench_now() - begin);
}

void bench_options(bench_table *table, sqlite3 *db, const double box[4], const double whole[4]) {
    char window[256], polygon[CORNERS * 48 + 64], line[128], road[192];
    const double cx = (box[0] + box[2]) / 2, cy = (box[1] + box[3]) / 2, r = (box[2] - box[0]) / 2;
    snprintf(window, sizeof window, "POLYGON((%.3f %.3f,%.3f %.3f,%.3f %.3f,%.3f %.3f,%.3f %.3f))", box[0], box[1],
             box[2], box[1], box[2], box[3], box[0], box[3], box[0], box[1]);
    size_t n = (size_t)snprintf(polygon, sizeof polygon, "POLYGON((");
    for (int i = 0; i <= CORNERS; i++) {
        const double turn = 6.283185307179586 * (i % CORNERS) / CORNERS;
        n += (size_t)snprintf(polygon + n, sizeof polygon - n, "%s%.3f %.3f", i ? "," : "", cx + r * cos(turn),
                              cy + r * sin(turn));
    }
    snprintf(polygon + n, sizeof polygon - n, "))");
    snprintf(line, sizeof line, "LINESTRING(%.3f %.3f,%.3f %.3f)", box[0], box[1] + r / 3, box[2], cy);
    snprintf(road, sizeof road, "{\"detail\":[[\"%s\",0.5]]}", line);
    make_roads(db, whole);
#define TRIANGLES "SELECT count(*) FROM rqt_triangles(?1, ?2, NULL, ?3)"
    const question questions[] = {
        {"triangles of the window, eps 5", TRIANGLES, NULL, window, 5, -1},
        {"... detail: one road across at 0.5 m", TRIANGLES, road, window, 5, 0},
        {"... detail: a table of 5,000 roads", TRIANGLES, "{\"detail\":\"bench_road\"}", window, 5, 0},
        {"a polygon of 256 corners as wide, eps 5", TRIANGLES, NULL, polygon, 5, -1},
        {"... mode border", TRIANGLES, "{\"mode\":\"border\"}", polygon, 5, 3},
        {"... mode cut", TRIANGLES, "{\"mode\":\"cut\"}", polygon, 5, 3},
        {"overview, eps 200, outline exact", TRIANGLES, NULL, NULL, 200, -1},
        {"... outline tol", TRIANGLES, "{\"outline\":\"tol\"}", NULL, 200, 6},
        {"profile along the line, eps 5", "SELECT count(*) FROM rqt_profile(?1, ?2) WHERE ?3 IS NULL", NULL, line,
         5, 0},
    };
    enum { QUESTIONS = sizeof questions / sizeof *questions };
    static bench_times times[QUESTIONS];
    sqlite3_stmt *s[QUESTIONS];
    for (int q = 0; q < QUESTIONS; q++) {
        const question *o = &questions[q];
        s[q] = bench_prepare(db, o->sql);
        sqlite3_bind_text(s[q], 1, o->region, -1, SQLITE_STATIC);
        sqlite3_bind_double(s[q], 2, o->eps);
        sqlite3_bind_text(s[q], 3, o->options, -1, SQLITE_STATIC);
        ask(db, s[q], NULL);
    }
    for (int turn = 0; turn < TURNS; turn++)
        for (int q = 0; q < QUESTIONS; q++) ask(db, s[q], &times[q]);
    bench_table_section(table, "options", "Options and further functions beside the plain query, warm", "of plain");
    for (int q = 0; q < QUESTIONS; q++) {
        const int peer = questions[q].peer;
        bench_table_row(table, questions[q].what, &times[q], "ms", 1e3, false, peer < 0 ? NULL : "plain",
                        peer < 0 ? NULL : &times[peer], (bench_aim){BENCH_NO_AIM, 0});
        sqlite3_finalize(s[q]);
    }
}
