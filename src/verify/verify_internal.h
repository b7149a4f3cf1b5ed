/* verify_internal.h - what the verifier's own files share. No other part of the program includes it. */
#ifndef RQT_VERIFY_INTERNAL_H
#define RQT_VERIFY_INTERNAL_H

#include "verify.h"

__extension__ typedef __int128 verify_wide;
__extension__ typedef unsigned __int128 verify_uwide;

enum {
    VERIFY_CORNER_LIMIT =
        1 << 21, /* |col|, |row| are below it, so differences are below 2^22 and areas below 2^45 */
    VERIFY_HEIGHT_LIMIT = 1 << 30,
    VERIFY_COUNT_CAP = 1000000, /* pairs are counted up to here: see verify.h */
};

/* The index of a sample known to be inside the window. */
static inline size_t verify_index(const verify_samples *samples, int32_t col, int32_t row) {
    return (size_t)((int64_t)row - samples->row0) * (size_t)samples->width + (size_t)((int64_t)col - samples->col0);
}

/* (b-a) x (c-a): twice the signed area. With rows growing south it is negative when a, b, c run counter-clockwise.
 */
static inline int64_t verify_cross(const verify_corner *a, const verify_corner *b, const verify_corner *c) {
    return ((int64_t)b->col - a->col) * ((int64_t)c->row - a->row) -
           ((int64_t)c->col - a->col) * ((int64_t)b->row - a->row);
}

/* Is the window one that verify.h allows? */
bool verify_samples_are_sound(const verify_samples *samples);

/* A triangle turned so that it lies where (dx * (y - ay) - dy * (x - ax)) >= 0 for each of its edges. */
typedef struct verify_plane {
    verify_corner corner[3];
    int64_t twice_area;       /* > 0 */
    int64_t slope_x, slope_y; /* D times the plane's rise per column and per row; below 2^55 */
    int64_t first_row, last_row;
    bool narrow; /* 64 bits are enough */
} verify_plane;

/* False for a triangle of no area: it has no plane, and covers nothing. */
bool verify_plane_of(const verify_triangle *triangle, verify_plane *p);
/* The columns [*first, *last] of one of the triangle's rows, first_row .. last_row, that are in the closed
 * triangle; none when *first > *last. */
void verify_row_interval(const verify_plane *p, int64_t row, int64_t *first, int64_t *last);

/* Fills samples, max_error, rms_error, worst_col, worst_row and uncovered. */
verify_status verify_measure_error(const verify_samples *samples, const verify_triangle *triangles, size_t n,
                                   verify_report *report);

/* Fills vertices, void_touched and t_junctions. */
verify_status verify_measure_cracks(const verify_samples *samples, const verify_triangle *triangles, size_t n,
                                    verify_report *report);

/* The unit squares of a triangle's box, ends included and counted from VERIFY_GRID_ORIGIN. Boxes whose open insides
 * are apart share none, so triangles that merely touch along a line of the grid are never compared. */
enum { VERIFY_GRID_ORIGIN = -(1 << 21) }; /* no corner is west or north of it */
typedef struct verify_box {
    uint32_t west, north, east, south; /* west > east: the triangle has no area, and meets nothing */
} verify_box;

/* Counts the pairs of triangles that `meet` confirms, of those whose boxes do; up to VERIFY_COUNT_CAP. */
verify_status verify_count_pairs(const verify_box *boxes, size_t n,
                                 bool (*meet)(const void *context, size_t a, size_t b), const void *context,
                                 uint64_t *found);

/* What deviations say, one per sample of the window in quanta, below zero where it is in no triangle: fills
 * samples, uncovered and rms_error. */
void verify_sum_deviations(const verify_samples *samples, const double *deviation, verify_report *report);

/* Fills overlaps. */
verify_status verify_measure_overlaps(const verify_triangle *triangles, size_t n, verify_report *report);

#endif
