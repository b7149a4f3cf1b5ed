/* update_search.c - the largest deviation of a triangle, without looking at all of its samples.
 *
 * A triangle within a block of stride 1 is measured by its samples. For a larger one the blocks are a quadtree of
 * cells, and the summary of a block bounds its whole cell: both halves of it have the centre for their split
 * vertex, so every valid sample lies within e_sat(centre) of the half's plane, and between that plane and any other
 * one the largest distance is at a corner:
 *
 *     |z - plane of T|  <=  e_sat(centre) + max over the cell's corners of |z - plane of T|
 *
 * This holds for cells that reach over the raster's edge as well: clamped halves tile the clamped cell. The cells
 * that promise most are divided first, until none promises more than what has been found; cells of stride 1 are
 * measured by their samples. All in codes, which rounding up keeps in order: the result is the code of the exact
 * maximum.
 *
 * Voids. Where the centre has no outline bit, nothing in the cell is mixed, and a corner tells what all samples
 * are. Where it has one, a half with a void corner has no plane that would bound it: its cell is divided. And as
 * long as it is not known whether the triangle is mixed, so is every cell that may tell.
 *
 * The extremes of all heights are found alike, with "height" for "deviation". In a raster of one column or row,
 * which has no triangles, and in one of 2 x 2, where nothing is split, nothing bounds a height: all of it is looked
 * at.
 */
#include "update.h"

#include <math.h>

#define MUST INT64_MAX /* a bound that nothing can be measured against */

/* ------------------------------------------------------------------------------------------------ the heap -- */

/* The cell with the largest bound is first; among equals, any. */
static bool push(update *u, update_cell_key key) {
    if (!memory_grow(u->allocator, (void **)&u->heap, &u->heap_capacity, u->heap_count + 1, sizeof *u->heap))
        return update_fail(u, RQT_NO_MEMORY);
    size_t at = u->heap_count++;
    for (; at > 0 && u->heap[(at - 1) / 2].bound < key.bound; at = (at - 1) / 2)
        u->heap[at] = u->heap[(at - 1) / 2];
    u->heap[at] = key;
    return true;
}

static update_cell_key pop(update *u) {
    const update_cell_key first = u->heap[0], last = u->heap[--u->heap_count];
    size_t at = 0;
    for (size_t child; (child = 2 * at + 1) < u->heap_count; at = child) {
        if (child + 1 < u->heap_count && u->heap[child + 1].bound > u->heap[child].bound) child++;
        if (u->heap[child].bound <= last.bound) break;
        u->heap[at] = u->heap[child];
    }
    u->heap[at] = last;
    return first;
}

/* ------------------------------------------------------------------------------------- cells and their samples --
 */

/* A block's cell as it is now. */
typedef struct cell {
    rqt_vertex at[4]; /* clamped corners */
    int32_t q[4];
    bool valid[4];
    rqt_code error; /* of the centre */
    bool outline;
} cell;

static bool read_cell(update *u, int level, int32_t i, int32_t j, cell *c) {
    rqt_summary summary;
    if (!update_summary(u, level, i, j, &summary)) return false;
    const int32_t side = 1 << (u->lattice.K - level), x = i * side, y = j * side;
    u->result->cells++;
    for (int n = 0; n < 4; n++) {
        const rqt_vertex v = {x + (n & 1 ? side : 0), y + (n & 2 ? side : 0)};
        uint8_t valid = summary.corner[n].flags & RQT_VALID;
        c->at[n] = rqt_vertex_clamp(&u->lattice, v);
        c->q[n] = summary.corner[n].q;
        if (update_touches(u, c->at[n].x, c->at[n].y)) valid = update_sample(u, c->at[n].x, c->at[n].y, &c->q[n]);
        c->valid[n] = valid != 0;
    }
    c->error = summary.center_error;
    c->outline = (summary.center_flags & RQT_OUTLINE) != 0;
    const rqt_vertex center = {x + side / 2, y + side / 2};
    const updated_vertex *changed = side > 1 ? update_find(u, center) : NULL;
    if (changed) {
        c->error = changed->code;
        c->outline = changed->outline;
    }
    return true;
}

/* The samples of a block of stride 1, and where they are. near: it stays at hand. */
static bool samples_of_block(update *u, int32_t i, int32_t j, bool near, deviation_field *field,
                             sample_window *window) {
    const int32_t side = 1 << u->k, x = i * side, y = j * side;
    const size_t n = (size_t)side + 1;
    *window = (sample_window){x, y, x + side < u->lattice.width ? x + side : u->lattice.width - 1,
                              y + side < u->lattice.height ? y + side : u->lattice.height - 1};
    *field = u->field;
    field->first_column = x;
    field->first_row = y;
    field->stride = n;
    const sample_window *a = &u->area;
    if (near || (a->x0 <= window->x1 && a->x1 >= x && a->y0 <= window->y1 && a->y1 >= y)) {
        const update_item *item = update_load(u, i, j);
        if (!item) return false;
        field->q = item->block.q;
        field->valid = item->valid;
        return true;
    }
    const rqt_block *block = u->given->read_block(u->given->context, rqt_block_number_of(u->levels - 1, i, j));
    if (!block) return update_fail(u, RQT_READ_FAILED);
    field->q = block->q;
    if (u->has_voids) {
        for (size_t at = 0; at < n * n; at++) u->mask[at] = block->flags[at] & RQT_VALID;
        field->valid = u->mask;
    }
    return true;
}

static bool is_leaf(const update *u, int level) {
    return level == u->levels - 1;
}

/* ----------------------------------------------------------------------------------------------- one triangle --
 */

typedef struct question {
    plane_triangle p;
    sample_triangle exact;
    bool clamped;
    int state; /* HAS_VALID | HAS_VOID of what has been seen */
    rqt_code code;
    bool mixed;
} question;

/* A state has been seen: the triangle may have become mixed, and cost what an outline costs. */
static void see(const update *u, question *q, int state) {
    q->state |= state;
    if (q->state != (HAS_VALID | HAS_VOID) || q->mixed) return;
    const rqt_code ground = outline_code(&u->field, &q->p.t);
    q->mixed = true;
    if (ground > q->code) q->code = ground;
}

/* (next - p) x (v - p): above 0 inside, 0 on the edge. */
static int64_t beside_edge(const sample_triangle *t, int edge, rqt_vertex v) {
    const rqt_vertex p = t->corner[edge], next = t->corner[edge + 1];
    return (int64_t)(next.x - p.x) * (v.y - p.y) - (int64_t)(next.y - p.y) * (v.x - p.x);
}

static bool holds(const sample_triangle *t, rqt_vertex v) {
    return beside_edge(t, 0, v) >= 0 && beside_edge(t, 1, v) >= 0 && beside_edge(t, 2, v) >= 0;
}

/* Do the interiors of triangle and cell meet? Two convex shapes do not where a side of one of them is between them.
 */
static bool meets(const sample_triangle *t, const cell *c) {
    int32_t x0 = INT32_MAX, x1 = INT32_MIN, y0 = INT32_MAX, y1 = INT32_MIN;
    for (int n = 0; n < 3; n++) {
        const rqt_vertex v = t->corner[n];
        x0 = v.x < x0 ? v.x : x0, x1 = v.x > x1 ? v.x : x1;
        y0 = v.y < y0 ? v.y : y0, y1 = v.y > y1 ? v.y : y1;
    }
    if (x1 <= c->at[0].x || x0 >= c->at[3].x || y1 <= c->at[0].y || y0 >= c->at[3].y) return false;
    for (int edge = 0; edge < 3; edge++) {
        bool beyond = true;
        for (int n = 0; n < 4; n++) beyond = beyond && beside_edge(t, edge, c->at[n]) <= 0;
        if (beyond) return false;
    }
    return true;
}

/* |z - plane| at a corner of a cell, rounded up. */
static rqt_code corner_deviation(const update *u, const question *q, const cell *c, int n) {
    const sample_triangle *t = &q->exact;
    const __int128 d = (__int128)t->area * ((int64_t)c->q[n] - t->base) - t->gx * (c->at[n].x - t->corner[0].x) -
                       t->gy * (c->at[n].y - t->corner[0].y);
    const unsigned __int128 size = (unsigned __int128)(d < 0 ? -d : d);
    return rqt_code_from_quanta(&u->field.scale.unit, (uint64_t)(size >> 64), (uint64_t)size, (uint64_t)t->area);
}

/* A code that no sample of the cell can exceed. Without an error at the centre it is met by a corner, and exact. */
static int64_t bound_of(const update *u, const question *q, const cell *c) {
    rqt_code most = 0;
    for (int n = 0; n < 4; n++) {
        const rqt_code code = corner_deviation(u, q, c, n);
        if (code > most) most = code;
    }
    if (c->error == 0 || most == 0) return c->error > most ? c->error : most;
    return code_above(nextafter(rqt_code_metres(c->error) + rqt_code_metres(most), INFINITY));
}

/* What a cell can still tell: a bound above q->code, MUST, or 0 for nothing. */
static int64_t promise_of(const update *u, question *q, const cell *c) {
    const bool complete = q->state == (HAS_VALID | HAS_VOID);
    const bool all = c->valid[0] && c->valid[1] && c->valid[2] && c->valid[3];
    if (!c->outline) { /* all alike */
        const int state = c->valid[0] ? HAS_VALID : HAS_VOID;
        if ((q->state & state) == 0) {
            /* A sliver can pass between the samples of a cell. */
            bool inside = !q->clamped;
            for (int n = 0; n < 4 && !inside; n++) inside = holds(&q->exact, c->at[n]);
            if (!inside) return MUST;
            see(u, q, state);
        }
        return all && q->p.has_plane ? bound_of(u, q, c) : 0;
    }
    if (!complete) return MUST;
    if (!q->p.has_plane) return 0;
    return all ? bound_of(u, q, c) : MUST;
}

static bool offer(update *u, question *q, int level, int32_t i, int32_t j) {
    cell c;
    if (!update_exists(u, level, i, j)) return true;
    if (!read_cell(u, level, i, j, &c)) return false;
    if (!meets(&q->exact, &c)) return true;
    const int64_t promise = promise_of(u, q, &c);
    return promise <= q->code || push(u, (update_cell_key){promise, level, i, j});
}

static bool offer_quarters(update *u, question *q, int level, int32_t i, int32_t j) {
    for (int n = 0; n < 4; n++)
        if (!offer(u, q, level + 1, 2 * i + (n & 1), 2 * j + (n >> 1))) return false;
    return true;
}

static bool measure_leaf(update *u, question *q, int32_t i, int32_t j) {
    deviation_field field;
    sample_window window;
    if (!samples_of_block(u, i, j, false, &field, &window)) return false;
    const triangle_part part = measure_triangle(&field, &q->p, &window);
    u->result->measured += (int64_t)(window.x1 - window.x0 + 1) * (window.y1 - window.y0 + 1);
    if (part.code > q->code) q->code = part.code;
    see(u, q, part.state);
    return true;
}

/* q: a question about a triangle in the cell of level and (i,j), but for its samples. */
static bool search(update *u, question *q, int level, int32_t i, int32_t j) {
    u->heap_count = 0;
    if (!offer_quarters(u, q, level, i, j)) return false;
    while (u->heap_count > 0 && u->heap[0].bound > q->code) {
        const update_cell_key first = pop(u);
        if (first.bound == MUST) { /* perhaps no longer */
            cell c;
            if (!read_cell(u, first.level, first.i, first.j, &c)) return false;
            if (promise_of(u, q, &c) <= q->code) continue;
        }
        if (!(is_leaf(u, first.level) ? measure_leaf(u, q, first.i, first.j)
                                      : offer_quarters(u, q, first.level, first.i, first.j)))
            return false;
    }
    return true;
}

/* The triangle with its corners' heights: all are corners of its cell, or its centre. */
static bool ask(update *u, const rqt_triangle *t, int level, int32_t i, int32_t j, question *q) {
    cell whole, first;
    if (!read_cell(u, level, i, j, &whole) || !read_cell(u, level + 1, 2 * i, 2 * j, &first)) return false;
    const int32_t side = 1 << (u->lattice.K - level), x = i * side, y = j * side;
    q->p = (plane_triangle){.t = *t, .has_plane = true};
    const rqt_vertex corner[3] = {t->apex, t->left, t->right};
    int32_t *const height[3] = {&q->p.apex, &q->p.left, &q->p.right};
    for (int n = 0; n < 3; n++) {
        const rqt_vertex v = corner[n];
        const bool is_center = v.x == x + side / 2;
        const cell *c = is_center ? &first : &whole;
        const int which = is_center ? 3 : (v.x > x) | (v.y > y) << 1;
        *height[n] = c->q[which];
        q->p.has_plane = q->p.has_plane && c->valid[which];
        q->state |= c->valid[which] ? HAS_VALID : HAS_VOID;
        q->clamped = q->clamped || v.x >= u->lattice.width || v.y >= u->lattice.height;
    }
    q->exact = sample_triangle_of(&u->field, &q->p);
    see(u, q, 0);
    return true;
}

bool update_measure(update *u, const rqt_triangle *t, int scale, rqt_code *code, bool *mixed) {
    const int32_t x = t->left.x < t->right.x ? t->left.x : t->right.x,
                  y = t->left.y < t->right.y ? t->left.y : t->right.y;
    const int32_t west = x < t->apex.x ? x : t->apex.x, north = y < t->apex.y ? y : t->apex.y;
    if (scale < u->k) {
        deviation_field field;
        sample_window window;
        if (!samples_of_block(u, west >> u->k, north >> u->k, true, &field, &window)) return false;
        const plane_triangle p = triangle_of_samples(&field, t);
        const triangle_part part = measure_triangle(&field, &p, &window);
        u->result->measured += (int64_t)1 << (2 * scale + 1);
        *mixed = part.state == (HAS_VALID | HAS_VOID);
        const rqt_code ground = *mixed ? outline_code(&field, t) : 0;
        if (part.code > *code) *code = part.code;
        if (ground > *code) *code = ground;
        return true;
    }
    const int level = u->lattice.K - scale - 1;
    const int32_t i = west >> (scale + 1), j = north >> (scale + 1);
    question q = {.code = *code};
    if (!ask(u, t, level, i, j, &q) || !search(u, &q, level, i, j)) return false;
    *code = q.code;
    *mixed = q.mixed;
    return true;
}

/* ------------------------------------------------------------------------------------------- extremes of heights
 * -- */

typedef struct extreme {
    int sign;
    int64_t most; /* sign * height of the most extreme valid sample so far */
    bool any;
} extreme;

/* No height in the cell has more than this, times sign; INT64_MIN where there are none. */
static int64_t extreme_bound(const update *u, const extreme *e, const cell *c) {
    const bool all = c->valid[0] && c->valid[1] && c->valid[2] && c->valid[3];
    if (u->lattice.width == 1 || u->lattice.height == 1 || u->k == 0) return MUST;
    if (!c->outline && !all) return INT64_MIN;
    if (!all) return MUST;
    int64_t most = INT64_MIN;
    for (int n = 0; n < 4; n++)
        if (e->sign * (int64_t)c->q[n] > most) most = e->sign * (int64_t)c->q[n];
    const double quanta = rqt_code_metres(c->error) / u->field.scale.factor * (1 + 0x1p-40);
    return quanta < 0x1p40 ? most + (int64_t)ceil(quanta) : MUST;
}

static bool offer_extreme(update *u, const extreme *e, int level, int32_t i, int32_t j) {
    cell c;
    if (!update_exists(u, level, i, j)) return true;
    if (!read_cell(u, level, i, j, &c)) return false;
    const int64_t bound = extreme_bound(u, e, &c);
    return bound == INT64_MIN || (e->any && bound <= e->most) || push(u, (update_cell_key){bound, level, i, j});
}

static bool extreme_leaf(update *u, extreme *e, int32_t i, int32_t j) {
    deviation_field field;
    sample_window w;
    if (!samples_of_block(u, i, j, false, &field, &w)) return false;
    u->result->measured += (int64_t)(w.x1 - w.x0 + 1) * (w.y1 - w.y0 + 1);
    for (int32_t y = w.y0; y <= w.y1; y++)
        for (int32_t x = w.x0; x <= w.x1; x++) {
            if (!valid_at(&field, x, y)) continue;
            const int64_t value = e->sign * (int64_t)height_at(&field, x, y);
            if (!e->any || value > e->most) e->most = value;
            e->any = true;
        }
    return true;
}

bool update_extreme(update *u, int sign, int32_t *q, bool *any) {
    extreme e = {.sign = sign};
    u->heap_count = 0;
    if (!offer_extreme(u, &e, 0, 0, 0)) return false;
    while (u->heap_count > 0 && (!e.any || u->heap[0].bound > e.most)) {
        const update_cell_key first = pop(u);
        if (is_leaf(u, first.level)) {
            if (!extreme_leaf(u, &e, first.i, first.j)) return false;
            continue;
        }
        for (int n = 0; n < 4; n++)
            if (!offer_extreme(u, &e, first.level + 1, 2 * first.i + (n & 1), 2 * first.j + (n >> 1))) return false;
    }
    *any = e.any;
    if (e.any) *q = (int32_t)(sign * e.most);
    return true;
}
