/* chart.h - the parts of rqt chart: points are measured (chart_measure.c), peers' points are read (chart_peers.c),
 * charts are drawn (chart_draw.c); command_chart.c says which.
 *
 * A point is one mesh: of a series (a method of ours, or a peer) at one tolerance. What was not measured is -1.
 */
#ifndef RQT_CHART_H
#define RQT_CHART_H

#include "cli.h"

#define CHART_NAME 40
#define CHART_TEXT 512

typedef struct chart_point {
    char series[CHART_NAME]; /* "exact", "local/topdown", "greedy TIN (delatin)" */
    char terrain[64];
    bool is_peer;
    bool is_selected_otherwise;  /* of a method whose mesh is the same as another's: only its time differs */
    bool is_front;               /* no other point is as good in time, error and vertices, and better in one */
    double eps;                  /* what was asked for, metres */
    double max_error, rms_error; /* what the verifier found, metres */
    int64_t samples, vertices, triangles;
    int64_t bytes, blocks; /* of blocks that the answer needs */
    int64_t fresh_bytes;   /* of the pages that the first query of a new connection reads */
    double ms, fresh_ms;   /* median of warm queries; the first query of a new connection */
    int runs;
    double amplitude; /* charts 5 and 6: of the noise; samples a side */
    int64_t side;
} chart_point;

typedef struct chart_points {
    chart_point *rows;
    int count, capacity;
} chart_points;

/* False after a sentence: out of memory. */
bool chart_points_add(chart_points *points, const chart_point *point);
void chart_points_free(chart_points *points);

/* ------------------------------------------------------------------------------------ methods, measuring -- */
#define CHART_MAX_METHODS 15
typedef struct chart_method {
    char name[CHART_NAME]; /* metric, or metric/select */
    char options[80];      /* the JSON of rqt_mesh() and the others */
    bool is_selected_otherwise;
} chart_method;

/* "exact,minimal,local/topdown"; their count, 0 after a sentence (CLI_USAGE is due). */
int chart_methods(const char *text, chart_method methods[CHART_MAX_METHODS]);

typedef struct chart_query {
    sqlite3 *db;
    const char *path; /* of the database, for fresh connections */
    const char *region, *terrain;
    int runs; /* at most; slow queries are run fewer times */
} chart_query;

typedef enum chart_answer { CHART_MEASURED, CHART_REFUSED, CHART_BROKEN } chart_answer;
/* CHART_REFUSED, after a sentence: SQL does not do this method on this terrain; CHART_BROKEN, after a sentence: the
 * database is damaged, or there is no memory. */
chart_answer chart_measure(const chart_query *query, const chart_method *method, double eps, chart_point *point);
/* Marks the points that are on the front of time, error and vertices. */
void chart_mark_front(chart_points *points);

/* ----------------------------------------------------------------------------------------------- peers -- */
/* Adds the rows of a file of peers' meshes (tests/bench/verify_peers.c writes it). Rows of another number of
 * samples than `samples` are of another raster: they are left out with a sentence. False after a sentence: no such
 * file. */
bool chart_read_peers(const char *path, int64_t samples, chart_points *points);

/* --------------------------------------------------------------------------------------------- drawing -- */
typedef enum chart_kind {
    CHART_ERROR_VERTICES,
    CHART_ERROR_EPS,
    CHART_TIME_ERROR,
    CHART_FRONT,
    CHART_NOISE,
    CHART_SIZE,
    CHART_ALL /* rows.csv: every column, no picture */
} chart_kind;

typedef struct chart_sheet {
    const char *folder;
    char title[CHART_TEXT]; /* what was measured */
    char note[CHART_TEXT];  /* on which machine */
    bool has_gnuplot;       /* set to false, with one sentence, when it is found missing */
    int pictures;           /* drawn so far */
} chart_sheet;

/* NAME.csv, and with gnuplot NAME.svg and NAME.png, drawn by NAME.gp, which stays. False after a sentence. */
bool chart_draw(chart_sheet *sheet, chart_kind kind, const chart_points *points);

#endif
