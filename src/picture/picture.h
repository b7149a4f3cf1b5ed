/* picture.h - pictures of a terrain and its meshes: shaded relief, the mesh over it for each eps, its true error.
 *
 * Everything is asked of the SQL functions of a connection, but for the samples under the window, which the store
 * gives. Results are SQLite's codes; with anything but SQLITE_OK *error may hold a sentence, to be released with
 * sqlite3_free. Good for several threads, each with a connection of its own.
 */
#ifndef RQT_PICTURE_H
#define RQT_PICTURE_H

#include "sqlite.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct picture_request {
    const char *region; /* WKT in the terrain's coordinates; NULL: everything */
    const double *eps;  /* a panel of each */
    int count;
    const char *terrain, *options; /* as SQL has them; NULL: the only one, none */
    int width;                     /* of the page: pixels, or units of an SVG */
    bool svg;                      /* else PNG */
} picture_request;

/* Takes the next bytes; false ends it. */
typedef bool picture_put(void *context, const void *bytes, size_t size);

int picture_write(sqlite3 *db, const picture_request *request, picture_put *put, void *context, char **error);

/* What rqt_verify() says. */
typedef struct picture_proof {
    int64_t samples, vertices, triangles;
    double max_error, rms_error;
    bool has_worst;
    double x, y;
    int64_t t_junctions, overlaps, uncovered;
} picture_proof;
int picture_proof_read(sqlite3 *db, const char *region, double eps, const char *terrain, const char *options,
                       picture_proof *proof, char **error);
/* Does the proof hold for a tolerance, on a terrain whose heights are rounded by quantum_error? */
bool picture_proof_holds(const picture_proof *proof, double eps, double quantum_error);

#endif
