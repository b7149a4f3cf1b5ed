/* bench_views.h - cameras of the benches of views, and what they ask. */
#ifndef RQT_BENCH_VIEWS_H
#define RQT_BENCH_VIEWS_H

#include "bench.h"

#include <stddef.h>

typedef struct view_camera {
    double x, y, z;          /* of the eye, in the terrain's coordinates; metres */
    double yaw, pitch, fovy; /* degrees: clockwise from north, upward, the picture's height */
    int width, height;       /* pixels */
    double tau;              /* pixels */
    double far;              /* metres; 0: no end */
    double exaggeration;
} view_camera;

enum { VIEW_TEXT = 512 };
/* The JSON that the view functions take. */
void view_write(const view_camera *camera, char text[VIEW_TEXT]);
/* Binds it as ?1. */
void view_bind(struct sqlite3_stmt *statement, const view_camera *camera);
/* fovy of a camera whose picture's width is seen under `degrees`. */
double view_fovy(double degrees, int width, int height);
/* The first column of the first row, the camera being ?1. */
double view_single(struct sqlite3 *db, const char *sql, const view_camera *camera);

/* What a BLOB of format 'strip' holds. Triangles: those that are no joins. */
typedef struct view_strip {
    size_t bytes, vertices, triangles;
} view_strip;
view_strip view_strip_read(struct sqlite3_stmt *statement); /* the statement is on its row */

/* A follower asks view after view for what has changed (option previous). Begin with one of zeros. */
typedef struct view_follower {
    struct sqlite3_stmt *statement;
    char token[2048]; /* of the last answer */
    size_t bytes;     /* of the last increment */
    bool is_unchanged;
} view_follower;
void view_follow(struct sqlite3 *db, view_follower *follower, const view_camera *camera);

/* Section "fly-over": 1000 frames along a line (as in [RQT], table 3) and on a circle (as in HyperBlock-QuadTIN); a
 * row a frame goes to the CSV files of `folder`. import_seconds: of the circle's terrain. bench_flight.c */
void bench_flight(bench_table *table, const char *folder, const char *extension, double import_seconds);

#endif
