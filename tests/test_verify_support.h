/* test_verify_support.h - what the test programs of the verifier share: scenes, which are a small window of samples
 * and the triangles of a mesh over it, and a slow check of a scene. The slow check uses integers only and other
 * methods than the verifier: barycentric signs instead of row intervals, half-plane intersection instead of
 * separating edges, all pairs instead of grids. */
#ifndef TEST_VERIFY_SUPPORT_H
#define TEST_VERIFY_SUPPORT_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "verify.h"

enum { SIDE = 16, MOST = 200 };

/* A window of up to SIDE * SIDE samples and up to MOST triangles. */
typedef struct scene {
    int32_t q[SIDE * SIDE];
    uint8_t valid[SIDE * SIDE];
    verify_samples samples;
    verify_triangle triangle[MOST];
    size_t n;
} scene;

static inline void start_scene(scene *s, int32_t width, int32_t height) {
    memset(s, 0, sizeof *s);
    memset(s->valid, 1, sizeof s->valid);
    s->samples = (verify_samples){
        .width = width, .height = height, .q = s->q, .valid = s->valid, .quantum = 1, .cell_x = 1, .cell_y = -1};
}

static inline size_t at(const scene *s, int32_t col, int32_t row) {
    return (size_t)((row - s->samples.row0) * s->samples.width + (col - s->samples.col0));
}

static inline verify_corner corner(const scene *s, int32_t col, int32_t row) {
    return (verify_corner){.col = col, .row = row, .q = s->q[at(s, col, row)]};
}

/* Corners get the heights of their samples. The order is the caller's. */
static inline void add(scene *s, int32_t ac, int32_t ar, int32_t bc, int32_t br, int32_t cc, int32_t cr) {
    assert_true(s->n < MOST);
    s->triangle[s->n++] = (verify_triangle){{corner(s, ac, ar), corner(s, bc, br), corner(s, cc, cr)}};
}

/* Two triangles over the square with its north-west corner at col, row. */
static inline void add_square(scene *s, int32_t col, int32_t row, int32_t size) {
    add(s, col, row, col, row + size, col + size, row);
    add(s, col + size, row, col, row + size, col + size, row + size);
}

static inline verify_report verified(const scene *s) {
    verify_report report;
    memset(&report, 0xA5, sizeof report);
    assert_int_equal(verify_mesh(&s->samples, s->triangle, s->n, &report), VERIFY_OK);
    return report;
}

static inline bool promise_all(void *context, int32_t col, int32_t row) {
    (void)context, (void)col, (void)row;
    return true;
}

/* ---- the slow check ---- */

typedef struct slow_report {
    uint64_t samples, vertices, t_junctions, overlaps, uncovered, void_touched, twice_area;
    int64_t numerator, denominator; /* the largest error in quanta; 0 / 1 without samples */
    int32_t worst_col, worst_row;
    double square_sum;
} slow_report;

static inline int64_t turn(const verify_corner *a, const verify_corner *b, const verify_corner *c) {
    return (int64_t)(b->col - a->col) * (c->row - a->row) - (int64_t)(c->col - a->col) * (b->row - a->row);
}

/* The weights of p's place in t, which sum to D > 0; none is negative when p is in the closed triangle. */
static inline int64_t weigh(const verify_triangle *t, const verify_corner *p, int64_t weight[3]) {
    int64_t d = turn(&t->corner[0], &t->corner[1], &t->corner[2]), sign = d < 0 ? -1 : 1;
    weight[0] = sign * turn(p, &t->corner[1], &t->corner[2]);
    weight[1] = sign * turn(&t->corner[0], p, &t->corner[2]);
    weight[2] = sign * turn(&t->corner[0], &t->corner[1], p);
    return sign * d;
}

static inline void slow_samples(const scene *s, slow_report *slow) {
    const verify_samples *w = &s->samples;
    slow->denominator = 1;
    for (int32_t row = w->row0; row < w->row0 + w->height; row++) {
        for (int32_t col = w->col0; col < w->col0 + w->width; col++) {
            verify_corner p = corner(s, col, row);
            int64_t top = -1, bottom = 1; /* this sample's largest error */
            bool is_corner = false;
            for (size_t t = 0; t < s->n; t++) {
                const verify_corner *c = s->triangle[t].corner;
                for (int k = 0; k < 3; k++) {
                    is_corner = is_corner || (c[k].col == col && c[k].row == row);
                }
                int64_t weight[3], d = weigh(&s->triangle[t], &p, weight);
                if (d == 0 || weight[0] < 0 || weight[1] < 0 || weight[2] < 0) continue;
                int64_t off = weight[0] * c[0].q + weight[1] * c[1].q + weight[2] * c[2].q - d * p.q;
                off = off < 0 ? -off : off;
                if (off * bottom > top * d) {
                    top = off;
                    bottom = d;
                }
            }
            slow->vertices += is_corner;
            slow->uncovered += top < 0;
            bool valid = s->valid[at(s, col, row)] != 0;
            slow->void_touched += is_corner && !valid;
            if (top < 0 || !valid) continue;
            if (slow->samples == 0 || top * slow->denominator > slow->numerator * bottom) {
                slow->numerator = top;
                slow->denominator = bottom;
                slow->worst_col = col;
                slow->worst_row = row;
            }
            slow->samples++;
            slow->square_sum += (double)(top * top) / (double)(bottom * bottom);
        }
    }
}

static inline bool same_place(const verify_corner *a, const verify_corner *b) {
    return a->col == b->col && a->row == b->row;
}

static inline bool strictly_inside(const verify_corner *v, const verify_corner *a, const verify_corner *b) {
    int64_t along = (int64_t)(v->col - a->col) * (b->col - v->col) + (int64_t)(v->row - a->row) * (b->row - v->row);
    return turn(a, b, v) == 0 && along > 0;
}

static inline const verify_corner *nth_corner(const scene *s, size_t k) {
    return &s->triangle[k / 3].corner[k % 3];
}

/* Is (corner v, edge e) a junction? Edge e runs from corner e of the list to the next one of its triangle. */
static inline bool is_junction(const scene *s, size_t v, size_t e) {
    const verify_corner *from = nth_corner(s, e), *to = nth_corner(s, e % 3 == 2 ? e - 2 : e + 1);
    const verify_corner *third = nth_corner(s, e % 3 == 0 ? e + 2 : e - 1), *vertex = nth_corner(s, v);
    return strictly_inside(vertex, from, to) && !same_place(vertex, third);
}

static inline bool same_edge(const scene *s, size_t e, size_t f) {
    const verify_corner *a = nth_corner(s, e), *b = nth_corner(s, e % 3 == 2 ? e - 2 : e + 1);
    const verify_corner *c = nth_corner(s, f), *d = nth_corner(s, f % 3 == 2 ? f - 2 : f + 1);
    return (same_place(a, c) && same_place(b, d)) || (same_place(a, d) && same_place(b, c));
}

static inline void slow_cracks(const scene *s, slow_report *slow) {
    for (size_t v = 0; v < 3 * s->n; v++) {
        bool new_place = true, new_height = true;
        for (size_t u = 0; u < v; u++) {
            if (!same_place(nth_corner(s, u), nth_corner(s, v))) continue;
            new_place = false;
            new_height = new_height && nth_corner(s, u)->q != nth_corner(s, v)->q;
        }
        if (new_height) { /* a pair with each different height of the place before it */
            for (size_t u = 0; u < v; u++) {
                bool first = same_place(nth_corner(s, u), nth_corner(s, v));
                for (size_t r = 0; r < u && first; r++) {
                    first = !same_place(nth_corner(s, r), nth_corner(s, u)) ||
                            nth_corner(s, r)->q != nth_corner(s, u)->q;
                }
                slow->t_junctions += first;
            }
        }
        for (size_t e = 0; e < 3 * s->n && new_place; e++) {
            bool found = is_junction(s, v, e);
            for (size_t f = 0; f < e && found; f++) {
                found = !(same_edge(s, e, f) && is_junction(s, v, f));
            }
            slow->t_junctions += found;
        }
    }
}

typedef struct homogeneous {
    int64_t x, y, w; /* the point (x / w, y / w), w > 0 */
} homogeneous;

/* Do the interiors meet? The two triangles are six half-planes a*x + b*y + c >= 0. What they have in common has an
 * inside when three points of it, each where two of the lines cross, are not in line. */
static inline bool interiors_meet(const verify_triangle *t, const verify_triangle *u) {
    int64_t line[6][3];
    homogeneous point[15];
    int points = 0;
    for (int k = 0; k < 6; k++) {
        const verify_triangle *from = k < 3 ? t : u;
        const verify_corner *p = &from->corner[k % 3], *r = &from->corner[(k + 1) % 3];
        int64_t d = turn(&from->corner[0], &from->corner[1], &from->corner[2]), sign = d < 0 ? -1 : 1;
        if (d == 0) return false;
        line[k][0] = sign * (p->row - r->row);
        line[k][1] = sign * (r->col - p->col);
        line[k][2] = -(line[k][0] * p->col + line[k][1] * p->row);
    }
    for (int k = 0; k < 6; k++) {
        for (int j = 0; j < k; j++) {
            const int64_t *l = line[k], *m = line[j];
            homogeneous h = {l[1] * m[2] - m[1] * l[2], l[2] * m[0] - m[2] * l[0], l[0] * m[1] - m[0] * l[1]};
            if (h.w == 0) continue;
            if (h.w < 0) h = (homogeneous){-h.x, -h.y, -h.w};
            bool inside = true;
            for (int i = 0; i < 6 && inside; i++) {
                inside = line[i][0] * h.x + line[i][1] * h.y + line[i][2] * h.w >= 0;
            }
            if (inside) point[points++] = h;
        }
    }
    for (int k = 0; k < points; k++) {
        for (int j = 0; j < k; j++) {
            for (int i = 0; i < j; i++) {
                const homogeneous *a = &point[i], *b = &point[j], *c = &point[k];
                if (a->x * (b->y * c->w - c->y * b->w) - b->x * (a->y * c->w - c->y * a->w) +
                        c->x * (a->y * b->w - b->y * a->w) !=
                    0) {
                    return true;
                }
            }
        }
    }
    return false;
}

static inline void assert_agrees(const scene *s) {
    slow_report slow = {0};
    slow_samples(s, &slow);
    slow_cracks(s, &slow);
    for (size_t t = 0; t < s->n; t++) {
        int64_t d = turn(&s->triangle[t].corner[0], &s->triangle[t].corner[1], &s->triangle[t].corner[2]);
        slow.twice_area += (uint64_t)(d < 0 ? -d : d);
        slow.overlaps += d >= 0;
        for (size_t u = 0; u < t; u++) {
            slow.overlaps += interiors_meet(&s->triangle[t], &s->triangle[u]);
        }
    }
    verify_report r = verified(s);
    assert_int_equal(r.samples, slow.samples);
    assert_int_equal(r.vertices, slow.vertices);
    assert_int_equal(r.triangles, s->n);
    assert_int_equal(r.t_junctions, slow.t_junctions);
    assert_int_equal(r.overlaps, slow.overlaps);
    assert_int_equal(r.uncovered, slow.uncovered);
    assert_int_equal(r.void_touched, slow.void_touched);
    assert_int_equal(r.twice_area, slow.twice_area);
    /* The quantum is a power of two, so this is the exact value rounded once. */
    assert_true(r.max_error == (double)slow.numerator / (double)slow.denominator * s->samples.quantum);
    assert_int_equal(r.worst_col, slow.worst_col);
    assert_int_equal(r.worst_row, slow.worst_row);
    double rms = slow.samples == 0 ? 0 : sqrt(slow.square_sum / (double)slow.samples) * s->samples.quantum;
    assert_true(fabs(r.rms_error - rms) <= 1e-12 * rms);
}

#endif
