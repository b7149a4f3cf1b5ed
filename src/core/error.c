/* error.c - e(P) and the outline bit x(P) of every lattice vertex: exact, over all samples.
 *
 * One walk down the bintree from the two halves of the root, one visit per triangle, children before parents. What
 * a visit computes belongs to the triangle's split vertex, where the two triangles of a diamond meet in a maximum.
 * The triangles of a 2 by 2 cell, half of all, are written out; deviation.c knows all others.
 *
 * Triangles of zero area (past the last column or row) cost nothing and are never mixed.
 */
#include "deviation.h"

typedef struct solver {
    deviation_field field;
    rqt_errors *errors;
    bool (*progress)(void *, double);
    void *context;
    int report_below; /* log2 of the size of triangles after which progress is reported */
    double done, step;
    bool stopped;
} solver;

static void raise_error(solver *s, rqt_vertex v, rqt_code code, bool mixed) {
    const int32_t column = lattice_slot(v.x, s->field.width), row = lattice_slot(v.y, s->field.height);
    const size_t at = (size_t)row * (size_t)s->errors->columns + (size_t)column;
    if (code > s->errors->code[at]) s->errors->code[at] = code;
    if (mixed) {
        s->errors->outline[at] = 1;
        s->errors->any_outline = true;
    }
}

static int32_t smaller(int32_t a, int32_t b) {
    return a < b ? a : b;
}
static int32_t larger(int32_t a, int32_t b) {
    return a > b ? a : b;
}

/* ------------------------------------------------------------------------------------------------ the walk */

static rqt_vertex between(rqt_vertex a, rqt_vertex b) {
    return (rqt_vertex){(a.x + b.x) / 2, (a.y + b.y) / 2};
}

static int visit_irregular(solver *s, const rqt_triangle *t, rqt_vertex split, int known_state) {
    const triangle_error found = irregular_error(&s->field, t, known_state);
    raise_error(s, split, found.code, found.mixed);
    return found.state;
}

/* Half of a 2 by 2 cell inside the raster: its own split vertex is the cell's centre, those of its two children are
 * the midpoints of its legs, and its other samples are its corners. */
static int visit_small(solver *s, const rqt_triangle *t) {
    const rqt_vertex m = between(t->left, t->right), p = between(t->apex, t->left), n = between(t->apex, t->right);
    if (s->field.valid) {
        const int state = state_at(&s->field, t->apex.x, t->apex.y) | state_at(&s->field, t->left.x, t->left.y) |
                          state_at(&s->field, t->right.x, t->right.y) | state_at(&s->field, m.x, m.y) |
                          state_at(&s->field, p.x, p.y) | state_at(&s->field, n.x, n.y);
        if (state == HAS_VOID) return state;
        if (state != HAS_VALID) {
            (void)visit_irregular(s, &(rqt_triangle){m, t->left, t->apex}, p, -1);
            (void)visit_irregular(s, &(rqt_triangle){m, t->apex, t->right}, n, -1);
            return visit_irregular(s, t, m, state);
        }
    }
    const int64_t za = height_at(&s->field, t->apex.x, t->apex.y), zl = height_at(&s->field, t->left.x, t->left.y),
                  zr = height_at(&s->field, t->right.x, t->right.y);
    int64_t dm = 2 * (int64_t)height_at(&s->field, m.x, m.y) - zl - zr,
            dp = 2 * (int64_t)height_at(&s->field, p.x, p.y) - za - zl,
            dn = 2 * (int64_t)height_at(&s->field, n.x, n.y) - za - zr;
    dm = dm < 0 ? -dm : dm;
    dp = dp < 0 ? -dp : dp;
    dn = dn < 0 ? -dn : dn;
    const int64_t most = dm > dp ? (dm > dn ? dm : dn) : (dp > dn ? dp : dn);
    raise_error(s, p, code_of_binary(&s->field.scale, (uint64_t)dp, 1), false);
    raise_error(s, n, code_of_binary(&s->field.scale, (uint64_t)dn, 1), false);
    raise_error(s, m, code_of_binary(&s->field.scale, (uint64_t)most, 1), false);
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
    if (smaller(smaller(a.x, l.x), r.x) >= s->field.width - 1 ||
        smaller(smaller(a.y, l.y), r.y) >= s->field.height - 1)
        return 0;
    const bool clamped =
        larger(larger(a.x, l.x), r.x) >= s->field.width || larger(larger(a.y, l.y), r.y) >= s->field.height;
    if (size == 0) /* a half cell: nothing to split, and never clamped, or it would have no area */
        return state_at(&s->field, a.x, a.y) | state_at(&s->field, l.x, l.y) | state_at(&s->field, r.x, r.y);
    if (size == 2 && l.x != r.x && l.y != r.y && !clamped) return visit_small(s, t);
    const rqt_vertex m = between(l, r);
    const int state = visit(s, &(rqt_triangle){m, l, a}, size - 1) | visit(s, &(rqt_triangle){m, a, r}, size - 1);
    if (s->stopped) return 0;
    /* Clamped triangles do not nest: a child may reach over its parent's edge. */
    if (clamped) return visit_irregular(s, t, m, -1);
    if (state == HAS_VOID) return state;
    if (state != HAS_VALID) return visit_irregular(s, t, m, state);
    int shift;
    const uint64_t deviation = plane_deviation(&s->field, t, &shift);
    raise_error(s, m, code_of_binary(&s->field.scale, deviation, shift), false);
    return state;
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
    solver s = {.field = {.lattice = *lattice,
                          .width = lattice->width,
                          .height = lattice->height,
                          .q = grid->q,
                          .valid = grid->valid,
                          .cost = *cost,
                          .relief = relief_of(grid)},
                .errors = errors,
                .progress = progress,
                .context = context,
                .report_below = whole > 8 ? whole - 8 : -1,
                .step = 1.0 / 512};
    code_scale_init(&s.field.scale, unit);
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
