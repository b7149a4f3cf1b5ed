/* metric.c - the errors that others have proposed, and the deviations that minimal errors are made of.
 *
 * One walk down the bintree, children before parents, as in error.c; what a triangle gets depends on the metric. A
 * triangle inside the raster without voids is *regular*: its samples are a sum over rows, the hypotenuse's midpoint
 * is a mean. The others (clamped at the raster's edge, or with voids) go through irregular_error, and what holds
 * only for nested triangles (the sum of the wedgie) is made safe there by the exact deviation.
 */
#include "metric.h"

#include "deviation.h"

#include <math.h>

typedef struct solver {
    deviation_field field;
    rqt_metric metric;
    bool mixed_is_infinite; /* minimal, outline exact */
    rqt_errors *errors;
    rqt_code *deviation; /* minimal: 2 for each place of errors' arrays */
    bool (*progress)(void *, double);
    void *context;
    int report_below;
    double done, step;
    bool stopped;
} solver;

/* What a visit tells the triangle above. */
typedef struct part {
    int state;      /* HAS_VALID | HAS_VOID; 0 where the area is zero */
    uint64_t wedge; /* the nested sum, in half quanta */
} part;

static int32_t smaller(int32_t a, int32_t b) {
    return a < b ? a : b;
}
static int32_t larger(int32_t a, int32_t b) {
    return a > b ? a : b;
}
static rqt_vertex between(rqt_vertex a, rqt_vertex b) {
    return (rqt_vertex){(a.x + b.x) / 2, (a.y + b.y) / 2};
}

static void put(solver *s, rqt_vertex apex, rqt_vertex split, rqt_code code, bool mixed) {
    rqt_errors *e = s->errors;
    const int32_t column = lattice_slot(split.x, s->field.width), row = lattice_slot(split.y, s->field.height);
    const size_t at = (size_t)row * (size_t)e->columns + (size_t)column;
    if (s->deviation) {
        s->deviation[2 * at + (size_t)apex_number(apex, split)] =
            mixed && s->mixed_is_infinite ? RQT_CODE_INFINITY : code;
        return;
    }
    if (code > e->code[at]) e->code[at] = code;
    if (mixed) {
        e->outline[at] = 1;
        e->any_outline = true;
    }
}

/* ------------------------------------------------------------------------------------- one triangle's number */

/* The larger one of a clamped triangle's two gradients may take 2^31 quanta times 2^20 samples. */
typedef struct plane {
    int64_t area; /* twice, with its sign: > 0 turns from x to y */
    __int128 gx, gy;
    int32_t za;
    rqt_vertex a;
} plane;

static plane plane_of(const deviation_field *f, rqt_vertex a, rqt_vertex l, rqt_vertex r) {
    const int64_t za = height_at(f, a.x, a.y), dl = height_at(f, l.x, l.y) - za, dr = height_at(f, r.x, r.y) - za;
    return (plane){.area = (int64_t)(l.x - a.x) * (r.y - a.y) - (int64_t)(r.x - a.x) * (l.y - a.y),
                   .gx = (__int128)dl * (r.y - a.y) - (__int128)dr * (l.y - a.y),
                   .gy = (__int128)dr * (l.x - a.x) - (__int128)dl * (r.x - a.x),
                   .za = (int32_t)za,
                   .a = a};
}

/* A vertical deviation of numerator / denominator quanta as a distance in space: every sample of a triangle has the
 * same factor, the cosine of the plane's slope. In doubles: their errors are far below 2^-44, which is added. */
static rqt_code tilt(const solver *s, const plane *p, double deviation, double denominator) {
    if (!(deviation > 0)) return 0;
    const double quantum = s->field.scale.factor, step = quantum / s->field.cost.cell / (double)p->area;
    const double east = (double)p->gx * step, south = (double)p->gy * step;
    return code_above(deviation / denominator * quantum / sqrt(1 + (east * east + south * south)) * (1 + 0x1p-44));
}

static rqt_code fitted_code(const solver *s, const rqt_triangle *t) {
    return code_above(fitted_distance(&s->field, t) * s->field.scale.factor);
}

/* |height - plane| of the clamped split vertex, as numerator / denominator quanta; 0 where a corner or it is void.
 */
static unsigned __int128 split_distance(const deviation_field *f, const rqt_triangle *t, uint64_t *denominator) {
    const rqt_vertex a = rqt_vertex_clamp(&f->lattice, t->apex), l = rqt_vertex_clamp(&f->lattice, t->left),
                     r = rqt_vertex_clamp(&f->lattice, t->right),
                     m = rqt_vertex_clamp(&f->lattice, between(t->left, t->right));
    *denominator = 1;
    if (!valid_at(f, a.x, a.y) || !valid_at(f, l.x, l.y) || !valid_at(f, r.x, r.y) || !valid_at(f, m.x, m.y))
        return 0;
    const plane p = plane_of(f, a, l, r);
    const __int128 d =
        (__int128)p.area * ((int64_t)height_at(f, m.x, m.y) - p.za) - p.gx * (m.x - a.x) - p.gy * (m.y - a.y);
    *denominator = (uint64_t)(p.area < 0 ? -p.area : p.area);
    return (unsigned __int128)(d < 0 ? -d : d);
}

static uint64_t half_quanta(unsigned __int128 numerator, uint64_t denominator) {
    return (uint64_t)((2 * numerator + (denominator - 1)) / denominator);
}

static rqt_code quotient_code(const solver *s, unsigned __int128 numerator, uint64_t denominator) {
    return rqt_code_from_quanta(&s->field.scale.unit, (uint64_t)(numerator >> 64), (uint64_t)numerator,
                                denominator);
}

/* Clamped, or with voids, or both. known_state < 0: to be found out. children: the larger wedge of the two halves.
 */
static part visit_irregular(solver *s, const rqt_triangle *t, rqt_vertex split, int known_state,
                            uint64_t children) {
    const triangle_error found = irregular_error(&s->field, t, known_state);
    part out = {found.state, 0};
    rqt_code code = found.code;
    uint64_t denominator;
    if (s->metric == RQT_METRIC_LOCAL) {
        const unsigned __int128 distance = split_distance(&s->field, t, &denominator);
        code = quotient_code(s, distance, denominator);
    } else if (s->metric == RQT_METRIC_WEDGIE) {
        /* A clamped triangle's halves need not cover it, and below a void nothing is added up. */
        const unsigned __int128 distance = split_distance(&s->field, t, &denominator);
        const uint64_t nested = half_quanta(distance, denominator) + children,
                       least = half_quanta(found.deviation, found.denominator);
        out.wedge = nested > least ? nested : least;
        code = code_of_binary(&s->field.scale, out.wedge, 1);
    } else if (s->metric == RQT_METRIC_EUCLID) {
        const plane p =
            plane_of(&s->field, rqt_vertex_clamp(&s->field.lattice, t->apex),
                     rqt_vertex_clamp(&s->field.lattice, t->left), rqt_vertex_clamp(&s->field.lattice, t->right));
        code = tilt(s, &p, (double)found.deviation, (double)found.denominator);
    } else if (s->metric == RQT_METRIC_PLANE) {
        code = fitted_code(s, t);
    }
    if (found.ground > code) code = found.ground;
    put(s, t->apex, split, code, found.mixed);
    return out;
}

/* The split vertex from the middle of the hypotenuse, in half quanta. */
static uint64_t midpoint_distance(const deviation_field *f, const rqt_triangle *t, rqt_vertex m) {
    const int64_t d = 2 * (int64_t)height_at(f, m.x, m.y) - height_at(f, t->left.x, t->left.y) -
                      height_at(f, t->right.x, t->right.y);
    return (uint64_t)(d < 0 ? -d : d);
}

static uint64_t visit_regular(solver *s, const rqt_triangle *t, rqt_vertex split, uint64_t children) {
    uint64_t number;
    int shift = 1;
    if (s->metric == RQT_METRIC_PLANE) {
        put(s, t->apex, split, fitted_code(s, t), false);
        return 0;
    }
    if (s->metric == RQT_METRIC_LOCAL || s->metric == RQT_METRIC_WEDGIE) {
        number = midpoint_distance(&s->field, t, split);
        if (s->metric == RQT_METRIC_WEDGIE) number += children;
    } else {
        number = regular_deviation(&s->field, t, &shift);
    }
    rqt_code code;
    if (s->metric == RQT_METRIC_EUCLID) {
        const plane p = plane_of(&s->field, t->apex, t->left, t->right);
        code = tilt(s, &p, (double)number, (double)(UINT64_C(1) << shift));
    } else {
        code = code_of_binary(&s->field.scale, number, shift);
    }
    put(s, t->apex, split, code, false);
    return number; /* the wedge, where it is one */
}

/* ---------------------------------------------------------------------------------------------- the walk */

/* Half of a 2 by 2 cell inside the raster, all valid, for minimal: two half cells and the triangle itself, whose
 * samples beside its corners are three midpoints of its sides. */
static bool visit_small(solver *s, const rqt_triangle *t) {
    const deviation_field *f = &s->field;
    const rqt_vertex m = between(t->left, t->right), p = between(t->apex, t->left), n = between(t->apex, t->right);
    if (f->valid && !(valid_at(f, t->apex.x, t->apex.y) && valid_at(f, t->left.x, t->left.y) &&
                      valid_at(f, t->right.x, t->right.y) && valid_at(f, m.x, m.y) && valid_at(f, p.x, p.y) &&
                      valid_at(f, n.x, n.y)))
        return false;
    const rqt_triangle first = {m, t->left, t->apex}, second = {m, t->apex, t->right};
    const uint64_t dm = midpoint_distance(f, t, m), dp = midpoint_distance(f, &first, p),
                   dn = midpoint_distance(f, &second, n);
    const uint64_t most = dm > dp ? (dm > dn ? dm : dn) : (dp > dn ? dp : dn);
    put(s, m, p, code_of_binary(&f->scale, dp, 1), false);
    put(s, m, n, code_of_binary(&f->scale, dn, 1), false);
    put(s, t->apex, m, code_of_binary(&f->scale, most, 1), false);
    return true;
}

/* size: log2 of the triangle's area in half cells. */
static part visit(solver *s, const rqt_triangle *t, int size) {
    const rqt_vertex a = t->apex, l = t->left, r = t->right;
    const deviation_field *f = &s->field;
    if (s->stopped) return (part){0, 0};
    if (size == s->report_below && s->progress) {
        s->done += s->step;
        if (!s->progress(s->context, s->done < 1 ? s->done : 1)) {
            s->stopped = true;
            return (part){0, 0};
        }
    }
    if (smaller(smaller(a.x, l.x), r.x) >= f->width - 1 || smaller(smaller(a.y, l.y), r.y) >= f->height - 1)
        return (part){0, 0};
    const bool clamped = larger(larger(a.x, l.x), r.x) >= f->width || larger(larger(a.y, l.y), r.y) >= f->height;
    if (size == 0) return (part){state_at(f, a.x, a.y) | state_at(f, l.x, l.y) | state_at(f, r.x, r.y), 0};
    if (size == 2 && l.x != r.x && l.y != r.y && !clamped && s->metric == RQT_METRIC_MINIMAL && visit_small(s, t))
        return (part){HAS_VALID, 0};
    const rqt_vertex m = between(l, r);
    const part one = visit(s, &(rqt_triangle){m, l, a}, size - 1),
               two = visit(s, &(rqt_triangle){m, a, r}, size - 1);
    if (s->stopped) return (part){0, 0};
    const uint64_t children = one.wedge > two.wedge ? one.wedge : two.wedge;
    const int state = one.state | two.state;
    if (clamped)
        return visit_irregular(s, t, m, -1, children); /* these do not nest: the state has to be found out */
    if (state == HAS_VOID) return (part){state, 0};
    if (state != HAS_VALID) return visit_irregular(s, t, m, state, children);
    return (part){state, visit_regular(s, t, m, children)};
}

/* -------------------------------------------------------------------------------------------- the whole */

const char *rqt_metric_name(rqt_metric metric) {
    static const char *const names[RQT_METRICS] = {"exact", "minimal", "local", "wedgie", "euclid", "plane"};
    return (unsigned)metric < RQT_METRICS ? names[metric] : NULL;
}

bool rqt_metric_is_bound(rqt_metric metric) {
    return metric == RQT_METRIC_EXACT || metric == RQT_METRIC_MINIMAL || metric == RQT_METRIC_WEDGIE;
}

static size_t slots(const rqt_lattice *lattice) {
    return (size_t)lattice_slots(lattice, lattice->width) * (size_t)lattice_slots(lattice, lattice->height);
}

size_t rqt_metric_bytes(const rqt_lattice *lattice, rqt_metric metric) {
    if (metric == RQT_METRIC_EXACT) return rqt_errors_bytes(lattice);
    const size_t kept = slots(lattice) * (sizeof(rqt_code) + 1);
    return metric == RQT_METRIC_MINIMAL ? kept + slots(lattice) * 2 * sizeof(rqt_code) : kept;
}

static void walk_all(solver *s) {
    const int whole = 2 * s->field.lattice.K;
    s->report_below = whole > 8 ? whole - 8 : -1;
    s->step = 1.0 / 512;
    const int32_t side = 1 << s->field.lattice.K;
    const rqt_vertex nw = {0, 0}, ne = {side, 0}, sw = {0, side}, se = {side, side};
    (void)visit(s, &(rqt_triangle){ne, nw, se}, whole);
    (void)visit(s, &(rqt_triangle){sw, se, nw}, whole);
}

rqt_status rqt_metric_compute(const rqt_grid *grid, const rqt_unit *unit, const rqt_void_cost *cost,
                              rqt_metric metric, rqt_outline outline, const rqt_allocator *allocator,
                              bool (*progress)(void *context, double done), void *context, rqt_errors *closed) {
    memset(closed, 0, sizeof *closed);
    if (!rqt_metric_name(metric) || !rqt_unit_is_valid(unit) || !(cost->cell > 0) || !(cost->c > 0))
        return RQT_INVALID;
    if (metric == RQT_METRIC_EXACT) {
        const rqt_status status = rqt_errors_compute(grid, unit, cost, allocator, progress, context, closed);
        if (status == RQT_OK) rqt_errors_saturate(closed);
        return status;
    }
    const size_t n = slots(&grid->lattice);
    const bool minimal = metric == RQT_METRIC_MINIMAL;
    *closed = (rqt_errors){.lattice = grid->lattice,
                           .columns = lattice_slots(&grid->lattice, grid->lattice.width),
                           .rows = lattice_slots(&grid->lattice, grid->lattice.height),
                           .code = memory_take(allocator, n * sizeof *closed->code),
                           .outline = memory_take(allocator, n)};
    solver s = {.field = {.lattice = grid->lattice,
                          .width = grid->lattice.width,
                          .height = grid->lattice.height,
                          .stride = (size_t)grid->lattice.width,
                          .q = grid->q,
                          .valid = grid->valid,
                          .cost = *cost,
                          .relief = relief_of(grid),
                          .kernels = error_kernels_best()},
                .metric = metric,
                .mixed_is_infinite = outline == RQT_OUTLINE_EXACT,
                .errors = closed,
                .deviation = minimal ? memory_take(allocator, 2 * n * sizeof *s.deviation) : NULL,
                .progress = progress,
                .context = context};
    rqt_status status = closed->code && closed->outline && (s.deviation || !minimal) ? RQT_OK : RQT_NO_MEMORY;
    if (status == RQT_OK) {
        code_scale_init(&s.field.scale, unit);
        memset(closed->code, 0, n * sizeof *closed->code);
        memset(closed->outline, 0, n);
        if (minimal) memset(s.deviation, 0, 2 * n * sizeof *s.deviation);
        walk_all(&s);
        if (s.stopped)
            status = RQT_INTERRUPTED;
        else if (minimal)
            minimal_solve(closed, s.deviation);
        else
            rqt_errors_saturate(closed);
    }
    memory_drop(allocator, s.deviation);
    if (status != RQT_OK) rqt_errors_free(closed, allocator);
    return status;
}
