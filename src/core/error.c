/* error.c - e(P) and the outline bit x(P) of every lattice vertex: exact, over all samples.
 *
 * One walk down the bintree from the two halves of the root, one visit per triangle, children before parents. What
 * a visit computes belongs to the triangle's split vertex, where the two triangles of a diamond meet in a maximum.
 *
 * Three ways to a triangle's deviation, all exact:
 *  - Inside the raster and without voids, the plane over a leg or hypotenuse of 2^m is a multiple of 2^-m at
 * samples: 2^m * (z - plane) is an integer, evaluated row by row by a loop that compilers turn into vector code; in
 * 32 bits where the terrain's relief allows, else in 64.
 *  - The triangles of a 2 by 2 cell, half of all, are written out.
 *  - Clamped at the raster's edge, or with voids, a triangle is any triangle: its samples are found by its three
 *    edges and the plane has the denominator of twice its area.
 *
 * Triangles of zero area (past the last column or row) cost nothing and are never mixed.
 */
#include "internal.h"

enum { HAS_VALID = 1, HAS_VOID = 2 };

typedef struct solver {
    int32_t width, height;
    const int32_t *q;
    const uint8_t *valid;
    code_scale scale;
    rqt_void_cost cost;
    int64_t relief; /* largest difference of two valid heights */
    rqt_errors *errors;
    bool (*progress)(void *, double);
    void *context;
    int report_below; /* log2 of the size of triangles after which progress is reported */
    double done, step;
    bool stopped;
} solver;

static int32_t height_at(const solver *s, int32_t x, int32_t y) {
    const int32_t cx = x < s->width ? x : s->width - 1, cy = y < s->height ? y : s->height - 1;
    return s->q[(size_t)cy * (size_t)s->width + (size_t)cx];
}

static bool valid_at(const solver *s, int32_t x, int32_t y) {
    if (!s->valid) return true;
    const int32_t cx = x < s->width ? x : s->width - 1, cy = y < s->height ? y : s->height - 1;
    return s->valid[(size_t)cy * (size_t)s->width + (size_t)cx] != 0;
}

static int state_at(const solver *s, int32_t x, int32_t y) {
    return valid_at(s, x, y) ? HAS_VALID : HAS_VOID;
}

static void raise_error(solver *s, rqt_vertex v, rqt_code code, bool mixed) {
    const int32_t column = lattice_slot(v.x, s->width), row = lattice_slot(v.y, s->height);
    const size_t at = (size_t)row * (size_t)s->errors->columns + (size_t)column;
    if (code > s->errors->code[at]) s->errors->code[at] = code;
    if (mixed) {
        s->errors->outline[at] = 1;
        s->errors->any_outline = true;
    }
}

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
static uint64_t plane_deviation(const solver *s, const rqt_triangle *t, int *shift) {
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
static scan scan_triangle(const solver *s, rqt_vertex a, rqt_vertex l, rqt_vertex r, bool measure) {
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

static rqt_code scan_code(const solver *s, const scan *found) {
    return rqt_code_from_quanta(&s->scale.unit, (uint64_t)(found->deviation >> 64), (uint64_t)found->deviation,
                                found->denominator);
}

static rqt_code outline_code(const solver *s, rqt_vertex a, rqt_vertex l, rqt_vertex r) {
    const int32_t across = larger(larger(a.x, l.x), r.x) - smaller(smaller(a.x, l.x), r.x);
    const int32_t down = larger(larger(a.y, l.y), r.y) - smaller(smaller(a.y, l.y), r.y);
    return rqt_code_from_ground(larger(across, down), s->cost.cell, s->cost.c);
}

/* ------------------------------------------------------------------------------------------------ the walk */

static rqt_vertex between(rqt_vertex a, rqt_vertex b) {
    return (rqt_vertex){(a.x + b.x) / 2, (a.y + b.y) / 2};
}

/* A triangle that is mixed, or clamped, or both. known_state < 0: to be found out. */
static int visit_irregular(solver *s, const rqt_triangle *t, rqt_vertex split, int known_state) {
    const rqt_lattice *lattice = &s->errors->lattice;
    const rqt_vertex a = rqt_vertex_clamp(lattice, t->apex), l = rqt_vertex_clamp(lattice, t->left),
                     r = rqt_vertex_clamp(lattice, t->right);
    const bool has_plane = valid_at(s, a.x, a.y) && valid_at(s, l.x, l.y) && valid_at(s, r.x, r.y);
    scan found = {known_state, 0, 1};
    if (known_state < 0 || has_plane) found = scan_triangle(s, a, l, r, has_plane);
    rqt_code code = has_plane ? scan_code(s, &found) : 0;
    const bool mixed = found.state == (HAS_VALID | HAS_VOID);
    if (mixed) {
        const rqt_code ground = outline_code(s, a, l, r);
        if (ground > code) code = ground;
    }
    raise_error(s, split, code, mixed);
    return found.state;
}

/* Half of a 2 by 2 cell inside the raster: its own split vertex is the cell's centre, those of its two children are
 * the midpoints of its legs, and its other samples are its corners. */
static int visit_small(solver *s, const rqt_triangle *t) {
    const rqt_vertex m = between(t->left, t->right), p = between(t->apex, t->left), n = between(t->apex, t->right);
    if (s->valid) {
        const int state = state_at(s, t->apex.x, t->apex.y) | state_at(s, t->left.x, t->left.y) |
                          state_at(s, t->right.x, t->right.y) | state_at(s, m.x, m.y) | state_at(s, p.x, p.y) |
                          state_at(s, n.x, n.y);
        if (state == HAS_VOID) return state;
        if (state != HAS_VALID) {
            (void)visit_irregular(s, &(rqt_triangle){m, t->left, t->apex}, p, -1);
            (void)visit_irregular(s, &(rqt_triangle){m, t->apex, t->right}, n, -1);
            return visit_irregular(s, t, m, state);
        }
    }
    const int64_t za = height_at(s, t->apex.x, t->apex.y), zl = height_at(s, t->left.x, t->left.y),
                  zr = height_at(s, t->right.x, t->right.y);
    int64_t dm = 2 * (int64_t)height_at(s, m.x, m.y) - zl - zr, dp = 2 * (int64_t)height_at(s, p.x, p.y) - za - zl,
            dn = 2 * (int64_t)height_at(s, n.x, n.y) - za - zr;
    dm = dm < 0 ? -dm : dm;
    dp = dp < 0 ? -dp : dp;
    dn = dn < 0 ? -dn : dn;
    const int64_t most = dm > dp ? (dm > dn ? dm : dn) : (dp > dn ? dp : dn);
    raise_error(s, p, code_of_binary(&s->scale, (uint64_t)dp, 1), false);
    raise_error(s, n, code_of_binary(&s->scale, (uint64_t)dn, 1), false);
    raise_error(s, m, code_of_binary(&s->scale, (uint64_t)most, 1), false);
    return HAS_VALID;
}

/* size: log2 of the triangle's area in half cells. Returns what samples the closed triangle holds; 0 where its area
 * is zero. */
static int visit(solver *s, const rqt_triangle *t, int size) {
    const rqt_vertex a = t->apex, l = t->left, r = t->right;
    if (s->stopped) return 0;
    if (size == s->report_below && s->progress) {
        s->done += s->step;
        if (!s->progress(s->context, s->done < 1 ? s->done : 1)) {
            s->stopped = true;
            return 0;
        }
    }
    if (smaller(smaller(a.x, l.x), r.x) >= s->width - 1 || smaller(smaller(a.y, l.y), r.y) >= s->height - 1)
        return 0;
    const bool clamped = larger(larger(a.x, l.x), r.x) >= s->width || larger(larger(a.y, l.y), r.y) >= s->height;
    if (size == 0) /* a half cell: nothing to split, and never clamped, or it would have no area */
        return state_at(s, a.x, a.y) | state_at(s, l.x, l.y) | state_at(s, r.x, r.y);
    if (size == 2 && l.x != r.x && l.y != r.y && !clamped) return visit_small(s, t);
    const rqt_vertex m = between(l, r);
    const int state = visit(s, &(rqt_triangle){m, l, a}, size - 1) | visit(s, &(rqt_triangle){m, a, r}, size - 1);
    if (s->stopped) return 0;
    /* Clamped triangles do not nest: a child may reach over its parent's edge. */
    if (clamped) return visit_irregular(s, t, m, -1);
    if (state == HAS_VOID) return state;
    if (state != HAS_VALID) return visit_irregular(s, t, m, state);
    int shift;
    const uint64_t deviation = plane_deviation(s, t, &shift);
    raise_error(s, m, code_of_binary(&s->scale, deviation, shift), false);
    return state;
}

static int64_t relief_of(const rqt_grid *grid) {
    int32_t low = INT32_MAX, high = INT32_MIN;
    const size_t n = (size_t)grid->lattice.width * (size_t)grid->lattice.height;
    for (size_t i = 0; i < n; i++) {
        if (grid->valid && !grid->valid[i]) continue;
        low = smaller(low, grid->q[i]);
        high = larger(high, grid->q[i]);
    }
    return low > high ? 0 : (int64_t)high - low;
}

size_t rqt_errors_bytes(const rqt_lattice *lattice) {
    return (size_t)lattice_slots(lattice, lattice->width) * (size_t)lattice_slots(lattice, lattice->height) *
           (sizeof(rqt_code) + 1);
}

rqt_status rqt_errors_compute(const rqt_grid *grid, const rqt_unit *unit, const rqt_void_cost *cost,
                              const rqt_allocator *allocator, bool (*progress)(void *context, double done),
                              void *context, rqt_errors *errors) {
    memset(errors, 0, sizeof *errors);
    if (!rqt_unit_is_valid(unit) || !(cost->cell > 0) || !(cost->c > 0)) return RQT_INVALID;
    const rqt_lattice *lattice = &grid->lattice;
    errors->lattice = *lattice;
    errors->columns = lattice_slots(lattice, lattice->width);
    errors->rows = lattice_slots(lattice, lattice->height);
    const size_t n = (size_t)errors->columns * (size_t)errors->rows;
    errors->code = memory_take(allocator, n * sizeof *errors->code);
    errors->outline = memory_take(allocator, n);
    if (!errors->code || !errors->outline) {
        rqt_errors_free(errors, allocator);
        return RQT_NO_MEMORY;
    }
    memset(errors->code, 0, n * sizeof *errors->code);
    memset(errors->outline, 0, n);
    const int whole = 2 * lattice->K;
    solver s = {.width = lattice->width,
                .height = lattice->height,
                .q = grid->q,
                .valid = grid->valid,
                .cost = *cost,
                .relief = relief_of(grid),
                .errors = errors,
                .progress = progress,
                .context = context,
                .report_below = whole > 8 ? whole - 8 : -1,
                .step = 1.0 / 512};
    code_scale_init(&s.scale, unit);
    const int32_t side = 1 << lattice->K;
    const rqt_vertex nw = {0, 0}, ne = {side, 0}, sw = {0, side}, se = {side, side};
    (void)visit(&s, &(rqt_triangle){ne, nw, se}, whole);
    (void)visit(&s, &(rqt_triangle){sw, se, nw}, whole);
    if (s.stopped) {
        rqt_errors_free(errors, allocator);
        return RQT_INTERRUPTED;
    }
    return RQT_OK;
}

void rqt_errors_free(rqt_errors *errors, const rqt_allocator *allocator) {
    memory_drop(allocator, errors->code);
    memory_drop(allocator, errors->outline);
    memset(errors, 0, sizeof *errors);
}

rqt_code rqt_errors_at(const rqt_errors *errors, rqt_vertex v, bool *outline) {
    const int32_t column = lattice_slot(v.x, errors->lattice.width),
                  row = lattice_slot(v.y, errors->lattice.height);
    *outline = false;
    if (column < 0 || row < 0) return 0;
    const size_t at = (size_t)row * (size_t)errors->columns + (size_t)column;
    *outline = errors->outline[at] != 0;
    return errors->code[at];
}
