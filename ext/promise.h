/* promise.h - what a proof looks at: the triangles of an answer, a window of samples, and which of those the mesh
 * has promised to cover. promise.c */
#ifndef RQT_PROMISE_H
#define RQT_PROMISE_H

#include "functions.h"

#include "verify.h"

/* The triangles of an answer as the verifier takes them, to be released with sqlite3_free; on failure there are
 * none. */
typedef struct promise_mesh {
    verify_triangle *triangles;
    size_t count;
} promise_mesh;
int promise_mesh_take(request *r, promise_mesh *mesh, char **error);

typedef struct promise {
    int32_t col, row, width, height; /* of the window */
    int32_t *q;
    uint8_t *valid;
    store *store;
    const store_terrain *terrain;
    const rqt_region *region;
    uint32_t asked;  /* of promise_holds */
    int code;        /* why it has stopped, and what it told is worth nothing; else SQLITE_OK */
    int32_t reach;   /* outline tol: samples this near to a void are not promised; 0: all are */
    bool ends[4];    /* the window's west, north, east, south is the raster's */
    uint32_t *voids; /* (width + 1) * (height + 1): voids north-west of each; NULL without voids, or for `exact` */
} promise;

/* The samples of a box (both ends included) and around it what the promise depends on. Releases nothing on failure
 * that promise_free would not. */
int promise_begin(promise *p, const request *r, const int32_t box[4], char **error);
/* Rows first .. last instead, of a view: promise_holds_within. */
int promise_begin_rows(promise *p, const request *r, int32_t first, int32_t last, char **error);
void promise_free(promise *p);
/* For verify_samples; context: a promise. */
bool promise_holds(void *context, int32_t col, int32_t row);
/* Wherever the region is: has a mesh to cover this sample whose outline is allowed `metres` of height there? */
bool promise_holds_within(const promise *p, int32_t col, int32_t row, double metres);
/* Unit half cells with three valid corners in the window: what the outline `exact` covers, no more and no less. */
int64_t promise_half_cells(const promise *p);

#endif
