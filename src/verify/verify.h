/* verify.h - the independent verifier: samples + triangles -> error, cracks, cover.
 *
 * It knows nothing of quadtrees, errors, selections or blocks, and shares no header with the code that makes
 * meshes: it takes a list of triangles in sample coordinates as the caller was given them, and the full-resolution
 * samples, and works out from these alone what is true of the mesh. Exact: integers, 128 bits where needed. Memory
 * through malloc; the library is linked into an extension, so it prints nothing and never exits.
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
    int32_t col0, row0, width, height; /* col0 + width and row0 + height are int32_t too */
    const int32_t *q;      /* width * height, row by row; any int32_t will do, and a void's is not read */
    const uint8_t *valid;  /* the same, 0 or 1; NULL when all are valid */
    double quantum;        /* metres per height quantum, > 0 */
    double cell_x, cell_y; /* CRS units per sample step, either sign: only |cell_x * cell_y| is used */
    /* Is this sample (inside the window) one that the mesh promised to cover? NULL: none is. Called once per
     * sample. */
    bool (*is_promised)(void *context, int32_t col, int32_t row);
    void *context;
} verify_samples;

typedef struct verify_report {
    /* Valid samples that lie in a closed triangle, each counted once. A triangle of no area contains none. */
    uint64_t samples;
    uint64_t vertices;  /* distinct (col,row) among the corners */
    uint64_t triangles; /* as given */
    /* Metres: the largest |sample - plane| over all valid samples in all closed triangles; 0 when there are none.
     * It is the double nearest to the exact value times quantum, rounded once, so that for an eps that is a double
     * an exact value <= eps never reads > eps. */
    double max_error;
    double rms_error; /* metres: over the counted samples, each with its largest deviation; in ordinary doubles */
    /* Where max_error is; the first in row order when there are ties, also when all are 0. 0, 0 without samples. */
    int32_t worst_col, worst_row;
    /* Pairs (vertex, edge) with the vertex strictly inside the edge of a triangle it is no corner of, plus pairs of
     * different heights at one (col,row): a vertical crack. A vertex is a place, an edge two places in either
     * order, a height a number: what several triangles share is one. The pairs (vertex, edge) are counted up to
     * 1000000. */
    uint64_t t_junctions;
    /* Pairs of triangles whose interiors meet, counted up to 1000000, plus clockwise and zero-area triangles. The
     * interior of a clockwise triangle counts, and a triangle given twice is a pair. */
    uint64_t overlaps;
    uint64_t uncovered;    /* promised samples, valid or not, in no closed triangle */
    uint64_t void_touched; /* void samples that are a corner of a triangle, each counted once */
    uint64_t twice_area;   /* twice the sum of the triangles' areas, in cells; clockwise ones count as positive */
    double area;           /* the same, halved, in CRS units squared */
} verify_report;

typedef enum verify_status {
    VERIFY_OK = 0,
    VERIFY_NO_MEMORY,
    VERIFY_INVALID /* a corner outside the window or the limits above; a missing array; a quantum that is not > 0 */
} verify_status;

/* Unless it returns VERIFY_OK the report is all zeros.
 *
 * Counter-clockwise seen from above: with rows growing south, corner a, b, c have
 * (bx-ax)*(cy-ay) - (cx-ax)*(by-ay) < 0.
 *
 * Memory: 8 bytes per sample of the window, and up to some 300 per triangle. Time: in step with the samples in all
 * triangles, plus the triangles whose boxes are alike in size and place. */
verify_status verify_mesh(const verify_samples *samples, const verify_triangle *triangles, size_t n,
                          verify_report *report);

/* What is true of the triangles alone, and needs no window: vertices, triangles, t_junctions, overlaps and
 * twice_area of the report; the rest of it is zeros. Memory: up to some 300 bytes per triangle. */
verify_status verify_topology(const verify_triangle *triangles, size_t n, verify_report *report);

/* verify_mesh for meshes whose vertices lie between samples, as clipping makes them. Places are doubles and taken
 * at their word: turning, overlaps, T-junctions and which samples a triangle covers are exact, and need all places
 * to be multiples of one power of two (below 2^53 of it; else VERIFY_INVALID). Heights are doubles, and so is what
 * is computed of them: a deviation counts less VERIFY_FREE_ROUNDING quanta, which is what rounding may make of a
 * sample that lies on its plane. twice_area is rounded to whole cells, area is not. */
typedef struct verify_free_corner {
    double col, row; /* sample coordinates, |col|, |row| < 2^21 */
    double q;        /* height in quanta, |q| < 2^30 */
} verify_free_corner;

typedef struct verify_free_triangle {
    verify_free_corner corner[3];
} verify_free_triangle;

#define VERIFY_FREE_ROUNDING 0x1p-20

/* As verify_mesh. Time: in step with the samples in all triangles and the cells along all edges. */
verify_status verify_free_mesh(const verify_samples *samples, const verify_free_triangle *triangles, size_t n,
                               verify_report *report);
/* ------------------------------------------------------------------------------------------------ views --
 * How far a mesh is from the samples in a picture. Each valid sample S in a closed triangle has its place on it, M:
 * the corners' places with the sample's weights among the corners. Where S or M is drawn, the distance of the two
 * on the picture plane counts, which has no end; it is infinite when one of them is not before the eye. Points are
 * drawn when their depth is above 0 and in near .. far, and they are inside the picture. Projection is plain double
 * arithmetic of differences: a coplanar sample is off by 0 exactly where `rise` says how heights add up. */
typedef struct verify_camera {
    double eye[3];                      /* metres of the scene */
    double forward[3], right[3], up[3]; /* unit, at right angles to each other */
    double focal, width, height;        /* pixels, > 0: a point at depth z and x to the right is x * focal / z right
                                           of the middle */
    double near, far;                   /* 0 <= near < far; far may be infinite */
} verify_camera;

typedef struct verify_scene {
    /* Where a sample or a corner is, metres. The same for the same corner. */
    void (*place)(void *context, const verify_corner *corner, double xyz[3]);
    /* Where places are linear in column, row and height: how much the third coordinate grows by a quantum, and the
     * other two do not depend on heights. Else 0. */
    double rise;
    /* Asked of valid samples that are drawn and in no triangle: does the mesh have to cover this one, when its
     * outline may be off by `slack` metres of the scene? NULL: never. */
    bool (*is_promised)(void *context, int32_t col, int32_t row, double slack);
    double slack; /* how far the outline may be off, pixels. In metres it is asked for as the radius of the largest
                     ball about the sample no point of which is further than that from it in the picture */
    void *context;
} verify_scene;

/* Windows are added up. Zeros, to begin with. */
typedef struct verify_view_report {
    uint64_t samples;   /* valid samples in a closed triangle, each counted once */
    uint64_t drawn;     /* of them: S is drawn, or M is, on one triangle at least */
    double max_pixels;  /* the largest distance; 0 when nothing is drawn */
    double rms_pixels;  /* over the drawn samples, each with its largest distance */
    double squares;     /* the sum of their squares */
    uint64_t uncovered; /* promised samples that are drawn, and in no closed triangle */
    /* Where max_pixels is: the first in row order of equal ones, if windows come in row order */
    int32_t worst_col, worst_row;
} verify_view_report;

/* One window of samples (q, valid and where they are; the rest is not read) and all triangles of the mesh, which
 * may reach over it. Windows must not overlap. Any other result than VERIFY_OK leaves the report as it was:
 * VERIFY_INVALID for what verify_mesh refuses but corners outside the window, for a camera that is none, and a
 * place that is not finite. Memory: 8 bytes per sample of the window. Time: in step with the window's samples, and
 * the triangles. */
verify_status verify_view(const verify_samples *samples, const verify_scene *scene, const verify_camera *camera,
                          const verify_triangle *triangles, size_t n, verify_view_report *report);

#ifdef __cplusplus
}
#endif
#endif
