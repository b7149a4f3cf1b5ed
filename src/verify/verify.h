/* verify.h - the independent verifier: samples + triangles -> error, cracks, cover.
 *
 * It knows nothing of quadtrees, errors, selections or blocks, and shares no header with the code that makes meshes:
 * it takes a list of triangles in sample coordinates as the caller was given them, and the full-resolution samples, and
 * works out from these alone what is true of the mesh. Exact: integers, 128 bits where needed. Memory through malloc;
 * the library is linked into an extension, so it prints nothing and never exits.
 */
#ifndef RQT_VERIFY_H
#define RQT_VERIFY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct verify_corner {
    int32_t col, row; /* sample coordinates: col grows east, row grows south; |col|,|row| < 2^21 */
    int32_t q;        /* height in quanta, |q| < 2^30 */
} verify_corner;

typedef struct verify_triangle {
    verify_corner corner[3];
} verify_triangle;

/* The full-resolution samples of a window: the caller makes it large enough to hold every triangle. */
typedef struct verify_samples {
    int32_t col0, row0, width, height;
    const int32_t *q;     /* width * height, row by row */
    const uint8_t *valid; /* the same, 0 or 1; NULL when all are valid */
    double quantum;       /* metres per height quantum, > 0 */
    double cell_x, cell_y; /* CRS units per sample step, either sign: only |cell_x * cell_y| is used */
    /* Is this sample (inside the window) one that the mesh promised to cover? NULL: none is. Called once per sample. */
    bool (*is_promised)(void *context, int32_t col, int32_t row);
    void *context;
} verify_samples;

typedef struct verify_report {
    uint64_t samples;   /* valid samples that lie in a closed triangle, each counted once */
    uint64_t vertices;  /* distinct (col,row) among the corners */
    uint64_t triangles; /* as given */
    double max_error;   /* metres: the largest |sample - plane| over all valid samples in all closed triangles; 0 when none.
                           The double nearest to the exact value times quantum (computed so that an exact value <= eps never
                           reads > eps, for an eps that is a double) */
    double rms_error;   /* metres: over the counted samples, each with its largest deviation */
    int32_t worst_col, worst_row; /* where max_error is; the first in row order when there are ties */
    uint64_t t_junctions; /* pairs (vertex, edge) with the vertex strictly inside the edge of a triangle it is no corner of,
                             plus pairs of corners at one (col,row) with different q: a vertical crack */
    uint64_t overlaps;    /* pairs of triangles whose interiors meet, plus clockwise and zero-area triangles */
    uint64_t uncovered;   /* promised samples in no closed triangle */
    uint64_t void_touched; /* void samples that are a corner of a triangle */
    uint64_t twice_area;  /* twice the sum of the triangles' areas, in cells */
    double area;          /* the same, halved, in CRS units squared */
} verify_report;

typedef enum verify_status { VERIFY_OK = 0, VERIFY_NO_MEMORY, VERIFY_INVALID /* a corner outside the window */ } verify_status;

/* Counter-clockwise seen from above: with rows growing south, corner a, b, c have
 * (bx-ax)*(cy-ay) - (cx-ax)*(by-ay) < 0. */
verify_status verify_mesh(const verify_samples *samples, const verify_triangle *triangles, size_t n, verify_report *report);

#ifdef __cplusplus
}
#endif
#endif
