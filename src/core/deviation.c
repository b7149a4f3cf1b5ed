/* deviation.c - how far the samples of one bintree triangle lie from its plane: exact, over all of them.
 *
 * Two ways, both exact:
 *  - Inside the raster and without voids, the plane over a leg or hypotenuse of 2^m is a multiple of 2^-m at
 *    samples: 2^m * (z - plane) is an integer, in 32 bits where the terrain's relief allows, else in a double.
 *  - Clamped at the raster's edge, or with voids, a triangle is any triangle: its samples are found by its three
 *    edges and the plane has the denominator of twice its area; in doubles where that is exact, else in 128 bits.
 */
#include "deviation.h"

static int32_t smaller(int32_t a, int32_t b) {
    return a < b ? a : b;
}
static int32_t larger(int32_t a, int32_t b) {
    return a > b ? a : b;
}

/* ---------------------------------------------------------------------------------------------- triangles */

bool triangle_has_area(const deviation_field *s, const rqt_triangle *t) {
    return smaller(smaller(t->apex.x, t->left.x), t->right.x) < s->width - 1 &&
           smaller(smaller(t->apex.y, t->left.y), t->right.y) < s->height - 1;
}

static bool is_clamped(const deviation_field *s, const rqt_triangle *t) {
    return larger(larger(t->apex.x, t->left.x), t->right.x) >= s->width ||
           larger(larger(t->apex.y, t->left.y), t->right.y) >= s->height;
}

plane_triangle triangle_of_samples(const deviation_field *s, const rqt_triangle *t) {
    plane_triangle out = {.t = *t, .has_plane = true};
    const rqt_vertex corner[3] = {t->apex, t->left, t->right};
    int32_t *const height[3] = {&out.apex, &out.left, &out.right};
    for (int i = 0; i < 3; i++) {
        const rqt_vertex at = rqt_vertex_clamp(&s->lattice, corner[i]);
        const size_t index = sample_index(s, at.x, at.y);
        *height[i] = s->q[index];
        if (s->valid && !s->valid[index]) out.has_plane = false;
    }
    return out;
}

/* -------------------------------------------------------------------------- inside the raster, without voids */

static sample_window box_of(rqt_vertex a, rqt_vertex l, rqt_vertex r) {
    return (sample_window){smaller(smaller(a.x, l.x), r.x), smaller(smaller(a.y, l.y), r.y),
                           larger(larger(a.x, l.x), r.x), larger(larger(a.y, l.y), r.y)};
}

/* The rows of a triangle that is not clamped, in a window: one piece, or two where its hypotenuse is upright. */
static int spans_of(const rqt_triangle *t, const sample_window *box, const sample_window *window, int32_t y[2],
                    row_spans out[2]) {
    const bool upright = t->left.x == t->right.x, west = t->apex.x == box->x0, north = t->apex.y == box->y0;
    const int32_t half = (box->y1 - box->y0) / 2;
    int pieces = 0;
    for (int piece = 0; piece <= upright; piece++) {
        int32_t first = piece ? box->y0 + half + 1 : box->y0, last = upright && !piece ? box->y0 + half : box->y1;
        row_spans s = {0, box->x0, 0, box->x1, 0, window->x0, window->x1};
        if (upright) { /* wider towards the middle */
            const int32_t at = piece ? half - 1 : 0, step = piece ? -1 : 1;
            if (west)
                s.left = box->x1 - at, s.left_step = -step;
            else
                s.right = box->x0 + at, s.right_step = step;
        } else if (t->left.y == t->right.y) { /* one sample at the apex, all at the other end */
            const int32_t cut = north ? box->y1 - box->y0 : 0, step = north ? -1 : 1;
            s.left += cut, s.left_step = step;
            s.right -= cut, s.right_step = -step;
        } else { /* legs on axes: all beside the apex, one sample at the far end of the vertical leg */
            const int32_t cut = north ? 0 : box->y1 - box->y0, step = north ? 1 : -1;
            if (west)
                s.right -= cut, s.right_step = -step;
            else
                s.left += cut, s.left_step = step;
        }
        if (first < window->y0) {
            s.left += (window->y0 - first) * s.left_step;
            s.right += (window->y0 - first) * s.right_step;
            first = window->y0;
        }
        last = smaller(last, window->y1);
        if (first > last) continue;
        s.rows = last - first + 1;
        y[pieces] = first;
        out[pieces++] = s;
    }
    return pieces;
}

/* Gradients of a plane times 2^m. */
typedef struct slopes {
    int64_t gx, gy;
    int m;
} slopes;

static slopes slopes_of(const plane_triangle *p, const sample_window *box) {
    const rqt_vertex a = p->t.apex, l = p->t.left, r = p->t.right;
    const int64_t za = p->apex, zl = p->left, zr = p->right;
    int64_t gx, gy;
    if (l.x != r.x && l.y != r.y) { /* legs on axes */
        const bool l_along_x = l.y == a.y;
        const int64_t zx = l_along_x ? zl : zr, zy = l_along_x ? zr : zl;
        gx = a.x == box->x0 ? zx - za : za - zx;
        gy = a.y == box->y0 ? zy - za : za - zy;
        return (slopes){gx, gy, __builtin_ctz((unsigned)(box->x1 - box->x0))};
    }
    if (l.y == r.y) { /* hypotenuse along x */
        gx = l.x < r.x ? zr - zl : zl - zr;
        gy = 2 * za - zl - zr;
        if (a.y == box->y0) gy = -gy;
        return (slopes){gx, gy, __builtin_ctz((unsigned)(box->x1 - box->x0))};
    }
    gy = l.y < r.y ? zr - zl : zl - zr;
    gx = 2 * za - zl - zr;
    if (a.x == box->x0) gx = -gx;
    return (slopes){gx, gy, __builtin_ctz((unsigned)(box->y1 - box->y0))};
}

/* The deviation of a triangle inside the raster, all of whose samples in the window are valid, as a multiple of
 * 2^-*shift. */
static uint64_t plane_deviation(const deviation_field *s, const plane_triangle *p, const sample_window *window,
                                int *shift) {
    const rqt_vertex a = p->t.apex;
    const sample_window box = box_of(a, p->t.left, p->t.right);
    const slopes g = slopes_of(p, &box);
    const int m = g.m;
    *shift = m;
    const bool narrow = s->relief < (INT64_C(1) << (31 - (m < 31 ? m : 31)));
    row_spans spans[2];
    int32_t first[2];
    uint64_t most = 0;
    const int pieces = spans_of(&p->t, &box, window, first, spans);
    for (int i = 0; i < pieces; i++) {
        const int32_t *z = s->q + sample_index(s, s->first_column, first[i]);
        row_spans here = spans[i]; /* counted from the first column at hand */
        here.left -= s->first_column;
        here.right -= s->first_column;
        here.low -= s->first_column;
        here.high -= s->first_column;
        /* times 2^m, at that column of the first row */
        const int64_t start =
            p->apex * ((int64_t)1 << m) - g.gx * (a.x - s->first_column) + g.gy * (first[i] - a.y);
        const uint64_t d =
            narrow ? s->kernels->rows_32(z, s->stride, &here, m, (uint32_t)start, (uint32_t)g.gx, (uint32_t)g.gy)
                   : s->kernels->rows_64(z, s->stride, &here, m, start, g.gx, g.gy);
        if (d > most) most = d;
    }
    return most;
}

/* What samples there are in the window of a triangle that is not clamped. */
static int state_in(const deviation_field *s, const rqt_triangle *t, const sample_window *window) {
    const sample_window box = box_of(t->apex, t->left, t->right);
    row_spans spans[2];
    int32_t first[2];
    int state = 0;
    const int pieces = spans_of(t, &box, window, first, spans);
    for (int i = 0; i < pieces; i++)
        for (int32_t k = 0; k < spans[i].rows && state != (HAS_VALID | HAS_VOID); k++) {
            const int32_t xa = larger(spans[i].left + k * spans[i].left_step, window->x0);
            const int32_t xb = smaller(spans[i].right + k * spans[i].right_step, window->x1);
            if (xa > xb) continue;
            if (!s->valid) return HAS_VALID;
            const uint8_t *valid = s->valid + sample_index(s, xa, first[i] + k);
            if (memchr(valid, 0, (size_t)(xb - xa + 1))) state |= HAS_VOID;
            if (memchr(valid, 1, (size_t)(xb - xa + 1))) state |= HAS_VALID;
        }
    return state;
}

/* ------------------------------------------------------------------------------------ any triangle at all */

static int64_t floor_divide(int64_t a, int64_t b) {
    return a / b - (a % b != 0 && (a % b < 0) != (b < 0));
}

sample_triangle sample_triangle_of(const deviation_field *s, const plane_triangle *p) {
    const rqt_vertex a = rqt_vertex_clamp(&s->lattice, p->t.apex);
    rqt_vertex l = rqt_vertex_clamp(&s->lattice, p->t.left), r = rqt_vertex_clamp(&s->lattice, p->t.right);
    int64_t dl = (int64_t)p->left - p->apex, dr = (int64_t)p->right - p->apex;
    int64_t area = (int64_t)(l.x - a.x) * (r.y - a.y) - (int64_t)(r.x - a.x) * (l.y - a.y);
    if (area < 0) {
        const rqt_vertex swap = l;
        const int64_t difference = dl;
        l = r;
        r = swap;
        dl = dr;
        dr = difference;
        area = -area;
    }
    const sample_window box = box_of(a, l, r);
    const int64_t leg = larger(box.x1 - box.x0, box.y1 - box.y0);
    /* |area * dz| + |gx * dx| + |gy * dy|, where both gradients are at most 2 * relief * leg. */
    const bool in_doubles = (__int128)s->relief * leg * leg * 5 < (__int128)1 << 53;
    return (sample_triangle){.corner = {a, l, r, a},
                             .area = area,
                             .gx = (__int128)dl * (r.y - a.y) - (__int128)dr * (l.y - a.y),
                             .gy = (__int128)dr * (l.x - a.x) - (__int128)dl * (r.x - a.x),
                             .base = p->apex,
                             .in_doubles = in_doubles};
}

/* By the three edges. */
row_span triangle_row(const sample_triangle *t, int32_t x0, int32_t x1, int32_t y) {
    int64_t xa = x0, xb = x1;
    for (int e = 0; e < 3; e++) { /* inside: dx*(y-py) - dy*(x-px) >= 0 */
        const rqt_vertex p = t->corner[e], next = t->corner[e + 1];
        const int64_t dx = next.x - p.x, dy = next.y - p.y;
        const int64_t c = dx * (y - p.y) + dy * p.x;
        if (dy > 0) {
            const int64_t most = floor_divide(c, dy);
            if (most < xb) xb = most;
        } else if (dy < 0) {
            const int64_t least = -floor_divide(c, -dy);
            if (least > xa) xa = least;
        } else if (c < 0) {
            xb = xa - 1;
        }
    }
    return xa > xb ? (row_span){1, 0} : (row_span){(int32_t)xa, (int32_t)xb};
}

typedef struct scan {
    int state;
    unsigned __int128 deviation; /* largest |area * (z - plane)| over the valid samples */
} scan;

/* n valid samples from (x,y) on. */
static unsigned __int128 run_deviation(const deviation_field *s, const sample_triangle *t, int32_t x, int32_t y,
                                       int32_t n) {
    const rqt_vertex a = t->corner[0];
    const int32_t *z = s->q + sample_index(s, x, y);
    if (t->in_doubles) {
        const double gx = (double)(int64_t)t->gx, gy = (double)(int64_t)t->gy;
        const double start = gx * (x - a.x) + gy * (y - a.y);
        return (unsigned __int128)s->kernels->row_double(z, n, t->base, (double)t->area, start, gx);
    }
    unsigned __int128 most = 0;
    for (int32_t i = 0; i < n; i++) {
        const __int128 d =
            (__int128)t->area * ((int64_t)z[i] - t->base) - t->gx * (x + i - a.x) - t->gy * (y - a.y);
        const unsigned __int128 size = (unsigned __int128)(d < 0 ? -d : d);
        if (size > most) most = size;
    }
    return most;
}

/* The samples of a triangle in a window. measure: there is a plane. */
static scan scan_triangle(const deviation_field *s, const sample_triangle *t, const sample_window *window,
                          bool measure) {
    scan out = {0, 0};
    const sample_window box = box_of(t->corner[0], t->corner[1], t->corner[2]);
    const int32_t x0 = larger(box.x0, window->x0), x1 = smaller(box.x1, window->x1);
    const int32_t y0 = larger(box.y0, window->y0), y1 = smaller(box.y1, window->y1);
    for (int32_t y = y0; y <= y1; y++) {
        const row_span span = triangle_row(t, x0, x1, y);
        for (int32_t x = span.x0; x <= span.x1;) { /* run by run of valid samples */
            int32_t n = span.x1 - x + 1;
            if (s->valid) {
                const uint8_t *valid = s->valid + sample_index(s, x, y);
                const uint8_t *const end = memchr(valid, *valid ? 0 : 1, (size_t)n);
                if (end) n = (int32_t)(end - valid);
                out.state |= *valid ? HAS_VALID : HAS_VOID;
                if (!*valid) {
                    x += n;
                    continue;
                }
            } else {
                out.state |= HAS_VALID;
            }
            const unsigned __int128 size = measure ? run_deviation(s, t, x, y, n) : 0;
            if (size > out.deviation) out.deviation = size;
            x += n;
        }
    }
    return out;
}

triangle_part measure_triangle(const deviation_field *s, const plane_triangle *t, const sample_window *window) {
    triangle_part out = {0, 0};
    if (!is_clamped(s, &t->t)) {
        out.state = state_in(s, &t->t, window);
        if (out.state == HAS_VOID || out.state == 0 || !t->has_plane) return out;
        if (out.state == HAS_VALID) {
            int shift;
            const uint64_t deviation = plane_deviation(s, t, window, &shift);
            out.code = code_of_binary(&s->scale, deviation, shift);
            return out;
        }
    }
    /* Clamped triangles do not nest, and have no power of two as their denominator. */
    const sample_triangle clamped = sample_triangle_of(s, t);
    const scan found = scan_triangle(s, &clamped, window, t->has_plane);
    out.state = found.state;
    if (t->has_plane)
        out.code = rqt_code_from_quanta(&s->scale.unit, (uint64_t)(found.deviation >> 64),
                                        (uint64_t)found.deviation, (uint64_t)clamped.area);
    return out;
}

rqt_code outline_code(const deviation_field *s, const rqt_triangle *t) {
    const sample_window box = box_of(rqt_vertex_clamp(&s->lattice, t->apex), rqt_vertex_clamp(&s->lattice, t->left),
                                     rqt_vertex_clamp(&s->lattice, t->right));
    return rqt_code_from_ground(larger(box.x1 - box.x0, box.y1 - box.y0), s->cost.cell, s->cost.c);
}

static const sample_window everywhere = {0, 0, INT32_MAX, INT32_MAX};

triangle_error irregular_error(const deviation_field *s, const rqt_triangle *t, int known_state) {
    const plane_triangle p = triangle_of_samples(s, t);
    triangle_error out = {.state = known_state, .denominator = 1};
    if (known_state < 0 || p.has_plane) {
        const sample_triangle clamped = sample_triangle_of(s, &p);
        const scan found = scan_triangle(s, &clamped, &everywhere, p.has_plane);
        out.state = found.state;
        if (p.has_plane) {
            out.deviation = found.deviation;
            out.denominator = (uint64_t)clamped.area;
            out.code = rqt_code_from_quanta(&s->scale.unit, (uint64_t)(found.deviation >> 64),
                                            (uint64_t)found.deviation, out.denominator);
        }
    }
    out.mixed = out.state == (HAS_VALID | HAS_VOID);
    if (out.mixed) {
        out.ground = outline_code(s, t);
        if (out.ground > out.code) out.code = out.ground;
    }
    return out;
}

uint64_t regular_deviation(const deviation_field *s, const rqt_triangle *t, int *shift) {
    const plane_triangle p = triangle_of_samples(s, t);
    return plane_deviation(s, &p, &everywhere, shift);
}

int64_t relief_of(const rqt_grid *grid) {
    int32_t low = INT32_MAX, high = INT32_MIN;
    const size_t n = (size_t)grid->lattice.width * (size_t)grid->lattice.height;
    for (size_t i = 0; i < n; i++) {
        if (grid->valid && !grid->valid[i]) continue;
        low = smaller(low, grid->q[i]);
        high = larger(high, grid->q[i]);
    }
    return low > high ? 0 : (int64_t)high - low;
}
