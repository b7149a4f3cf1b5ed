/* deviation.c - how far the samples of one bintree triangle lie from its plane: exact, over all of them.
 *
 * Two ways, both exact:
 *  - Inside the raster and without voids, the plane over a leg or hypotenuse of 2^m is a multiple of 2^-m at
 * samples: 2^m * (z - plane) is an integer, evaluated row by row by a loop that compilers turn into vector code; in
 * 32 bits where the terrain's relief allows, else in 64.
 *  - Clamped at the raster's edge, or with voids, a triangle is any triangle: its samples are found by its three
 *    edges and the plane has the denominator of twice its area.
 */
#include "deviation.h"

/* ------------------------------------------------------------------------------------- rows of a plane --
 * max over n samples of |(z[i] - base) * 2^m - (start + i * slope)|. */
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(RQT_SCALAR)
#define VECTOR_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define VECTOR_CLONES
#endif

VECTOR_CLONES static uint32_t row_deviation_32(const int32_t *z, int32_t n, uint32_t base, int m, uint32_t start,
                                               uint32_t slope) {
    uint32_t most = 0;
    for (int32_t i = 0; i < n; i++) {
        const int32_t d = (int32_t)((((uint32_t)z[i] - base) << m) - start - (uint32_t)i * slope);
        const uint32_t size = d < 0 ? 0u - (uint32_t)d : (uint32_t)d;
        most = size > most ? size : most;
    }
    return most;
}

VECTOR_CLONES static uint64_t row_deviation_64(const int32_t *z, int32_t n, int64_t base, int m, int64_t start,
                                               int64_t slope) {
    int64_t most = 0;
    for (int32_t i = 0; i < n; i++) {
        const int64_t d = (z[i] - base) * ((int64_t)1 << m) - start - i * slope;
        const int64_t size = d < 0 ? -d : d;
        most = size > most ? size : most;
    }
    return (uint64_t)most;
}

static int32_t smaller(int32_t a, int32_t b) {
    return a < b ? a : b;
}
static int32_t larger(int32_t a, int32_t b) {
    return a > b ? a : b;
}

/* A triangle of the lattice inside the raster, all valid: its deviation as a multiple of 2^-m. */
uint64_t plane_deviation(const deviation_field *s, const rqt_triangle *t, int *shift) {
    const rqt_vertex a = t->apex, l = t->left, r = t->right;
    const int32_t zl = height_at(s, l.x, l.y), zr = height_at(s, r.x, r.y), za = height_at(s, a.x, a.y);
    const int32_t x0 = smaller(smaller(a.x, l.x), r.x), x1 = larger(larger(a.x, l.x), r.x);
    const int32_t y0 = smaller(smaller(a.y, l.y), r.y), y1 = larger(larger(a.y, l.y), r.y);
    /* Gradients times 2^m, and the sample that the plane is written about: (x0 or so, where z is known). */
    int64_t gx, gy;
    int m;
    const bool legs_on_axes = l.x != r.x && l.y != r.y;
    if (legs_on_axes) {
        m = __builtin_ctz((unsigned)(x1 - x0));
        const bool l_along_x = l.y == a.y;
        const int64_t zx = l_along_x ? zl : zr, zy = l_along_x ? zr : zl;
        gx = a.x == x0 ? zx - za : za - zx;
        gy = a.y == y0 ? zy - za : za - zy;
    } else if (l.y == r.y) { /* hypotenuse along x */
        m = __builtin_ctz((unsigned)(x1 - x0));
        gx = l.x < r.x ? (int64_t)zr - zl : (int64_t)zl - zr;
        gy = 2 * (int64_t)za - zl - zr;
        if (a.y == y0) gy = -gy;
    } else { /* along y */
        m = __builtin_ctz((unsigned)(y1 - y0));
        gy = l.y < r.y ? (int64_t)zr - zl : (int64_t)zl - zr;
        gx = 2 * (int64_t)za - zl - zr;
        if (a.x == x0) gx = -gx;
    }
    *shift = m;
    const bool narrow = s->relief < (INT64_C(1) << (29 - (m < 29 ? m : 29)));
    uint64_t most = 0;
    for (int32_t y = y0; y <= y1; y++) {
        int32_t xa = x0, xb = x1;
        const int32_t from_top = y - y0, from_bottom = y1 - y;
        if (legs_on_axes) { /* full beside the apex, one sample at the far end of the vertical leg */
            const int32_t cut = a.y == y0 ? from_top : from_bottom;
            if (a.x == x0)
                xb -= cut;
            else
                xa += cut;
        } else if (l.y == r.y) {
            const int32_t cut = a.y == y0 ? from_bottom : from_top;
            xa += cut;
            xb -= cut;
        } else {
            const int32_t reach = smaller(from_top, from_bottom);
            if (a.x == x0)
                xa = x1 - reach;
            else
                xb = x0 + reach;
        }
        const int32_t *z = s->q + (size_t)y * (size_t)s->width + (size_t)xa;
        const int64_t start = gx * (xa - a.x) + gy * (y - a.y);
        uint64_t d;
        if (narrow)
            d = row_deviation_32(z, xb - xa + 1, (uint32_t)za, m, (uint32_t)start, (uint32_t)gx);
        else
            d = row_deviation_64(z, xb - xa + 1, za, m, start, gx);
        if (d > most) most = d;
    }
    return most;
}

/* ------------------------------------------------------------------------------------ any triangle at all */

static int64_t floor_divide(int64_t a, int64_t b) {
    return a / b - (a % b != 0 && (a % b < 0) != (b < 0));
}

typedef struct scan {
    int state;                   /* HAS_VALID | HAS_VOID over the closed triangle */
    unsigned __int128 deviation; /* largest |denominator * (z - plane)| over its valid samples */
    uint64_t denominator;        /* twice its area */
} scan;

/* Every sample of the clamped triangle, by its three edges. measure: its corners are valid, so there is a plane. */
static scan scan_triangle(const deviation_field *s, rqt_vertex a, rqt_vertex l, rqt_vertex r, bool measure) {
    scan out = {0, 0, 0};
    int64_t area = (int64_t)(l.x - a.x) * (r.y - a.y) - (int64_t)(r.x - a.x) * (l.y - a.y);
    if (area < 0) {
        const rqt_vertex swap = l;
        l = r;
        r = swap;
        area = -area;
    }
    out.denominator = (uint64_t)area;
    const int32_t za = height_at(s, a.x, a.y), zl = height_at(s, l.x, l.y), zr = height_at(s, r.x, r.y);
    const int64_t dl = (int64_t)zl - za, dr = (int64_t)zr - za;
    const __int128 gx = (__int128)dl * (r.y - a.y) - (__int128)dr * (l.y - a.y);
    const __int128 gy = (__int128)dr * (l.x - a.x) - (__int128)dl * (r.x - a.x);
    const rqt_vertex corner[4] = {a, l, r, a};
    const int32_t x0 = smaller(smaller(a.x, l.x), r.x), x1 = larger(larger(a.x, l.x), r.x);
    const int32_t y0 = smaller(smaller(a.y, l.y), r.y), y1 = larger(larger(a.y, l.y), r.y);
    /* |area * dz| + |gx * dx| + |gy * dy| in 64 bits? Both gradients are at most 2 * relief * leg. */
    const int64_t leg = larger(x1 - x0, y1 - y0);
    const bool narrow = (__int128)s->relief * leg * leg * 5 < ((__int128)1 << 62);
    for (int32_t y = y0; y <= y1; y++) {
        int64_t xa = x0, xb = x1;
        for (int e = 0; e < 3; e++) { /* inside: dx*(y-py) - dy*(x-px) >= 0 */
            const int64_t dx = corner[e + 1].x - corner[e].x, dy = corner[e + 1].y - corner[e].y;
            const int64_t c = dx * (y - corner[e].y) + dy * corner[e].x;
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
        const size_t row = (size_t)y * (size_t)s->width;
        for (int64_t x = xa; x <= xb; x++) {
            if (s->valid && !s->valid[row + (size_t)x]) {
                out.state |= HAS_VOID;
                continue;
            }
            out.state |= HAS_VALID;
            if (!measure) continue;
            const int64_t dz = (int64_t)s->q[row + (size_t)x] - za;
            unsigned __int128 size;
            if (narrow) {
                const int64_t d = area * dz - (int64_t)gx * (x - a.x) - (int64_t)gy * (y - a.y);
                size = (unsigned __int128)(d < 0 ? -d : d);
            } else {
                const __int128 d = (__int128)area * dz - gx * (x - a.x) - gy * (y - a.y);
                size = (unsigned __int128)(d < 0 ? -d : d);
            }
            if (size > out.deviation) out.deviation = size;
        }
    }
    return out;
}

static rqt_code scan_code(const deviation_field *s, const scan *found) {
    return rqt_code_from_quanta(&s->scale.unit, (uint64_t)(found->deviation >> 64), (uint64_t)found->deviation,
                                found->denominator);
}

static rqt_code outline_code(const deviation_field *s, rqt_vertex a, rqt_vertex l, rqt_vertex r) {
    const int32_t across = larger(larger(a.x, l.x), r.x) - smaller(smaller(a.x, l.x), r.x);
    const int32_t down = larger(larger(a.y, l.y), r.y) - smaller(smaller(a.y, l.y), r.y);
    return rqt_code_from_ground(larger(across, down), s->cost.cell, s->cost.c);
}

triangle_error irregular_error(const deviation_field *s, const rqt_triangle *t, int known_state) {
    const rqt_vertex a = rqt_vertex_clamp(&s->lattice, t->apex), l = rqt_vertex_clamp(&s->lattice, t->left),
                     r = rqt_vertex_clamp(&s->lattice, t->right);
    const bool has_plane = valid_at(s, a.x, a.y) && valid_at(s, l.x, l.y) && valid_at(s, r.x, r.y);
    scan found = {known_state, 0, 1};
    if (known_state < 0 || has_plane) found = scan_triangle(s, a, l, r, has_plane);
    triangle_error out = {.state = found.state, .denominator = 1};
    if (has_plane) {
        out.code = scan_code(s, &found);
        out.deviation = found.deviation;
        out.denominator = found.denominator;
    }
    out.mixed = found.state == (HAS_VALID | HAS_VOID);
    if (out.mixed) {
        out.ground = outline_code(s, a, l, r);
        if (out.ground > out.code) out.code = out.ground;
    }
    return out;
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
