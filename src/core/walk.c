/* walk.c - the walk over one half of a block.
 *
 * It keeps the order of a space-filling curve: each half is entered at one end of its hypotenuse and left at the
 * other, the children in the order that continues it. Neighbours in the list of triangles are neighbours on the
 * ground, which is what strips live on.
 *
 * Two ways. With care: every triangle is asked how it lies to the region, every leaf whether it is kept. Below a
 * triangle that the region wants as a whole, in a block without voids inside the raster, nothing is left to ask but
 * whether the split vertex is selected: there a loop with a stack of its own does the rest. It gives a vertex its
 * index as the triangle splits there, without a branch: the second triangle that splits at a vertex finds what the
 * first one has left.
 *
 * The strip in that loop. A leaf (A; L,R) is entered through an edge that holds L, its leg LA or its hypotenuse LR,
 * and left through one that holds R. Let b be the depth of the triangle whose two children meet there: the common
 * edge is a leg of the leaf if its depth less b is odd, else its hypotenuse. So the edges follow from the path: the
 * first child is left through a leg, the second one entered through a leg, and a further split turns leg and
 * hypotenuse about. The vertex that both edges share, the pivot, is said once more if it was the pivot before.
 */
#include "rule.h"
#include "walk.h"

typedef struct half {
    uint32_t a, l, r; /* places of apex, left, right */
    int splits;       /* how often it can be split on the block's grid */
    bool clockwise;
} half;

/* ----------------------------------------------------------------------------------------------- selection */

/* chosen = error > eps or a flag of the mask. Returns the flags that all of them have: corners of leaves are
 * vertices that are chosen, or corners of the block. */
VECTOR_CLONES
static uint8_t choose_by_error(const rqt_block *b, size_t count, rqt_code eps, uint8_t mask, uint8_t *chosen) {
    enum { STEP = 64 };
    const rqt_code *restrict const error = b->error;
    const uint8_t *restrict const flags = b->flags;
    uint8_t *restrict const out = chosen;
    uint8_t all = 0xFF;
    size_t i = 0;
    for (; i + STEP <= count; i += STEP) {
        /* The heights are wanted later, here and there: have them come while the errors stream by. */
        for (size_t line = 0; line < STEP; line += 16) __builtin_prefetch(b->q + i + line);
        for (size_t j = i; j < i + STEP; j++) {
            out[j] = (uint8_t)((error[j] > eps) | ((flags[j] & mask) != 0));
            all &= (uint8_t)(flags[j] | (out[j] - 1));
        }
    }
    for (; i < count; i++) {
        out[i] = (uint8_t)((error[i] > eps) | ((flags[i] & mask) != 0));
        all &= (uint8_t)(flags[i] | (out[i] - 1));
    }
    return all;
}

/* The same for one row of a block, with a threshold for each vertex. */
VECTOR_CLONES
static uint8_t choose_row(const rqt_code *restrict error, const uint8_t *restrict flags,
                          const int32_t *restrict threshold, size_t count, uint8_t mask, uint8_t *restrict out) {
    uint8_t all = 0xFF;
    for (size_t i = 0; i < count; i++) {
        out[i] = (uint8_t)((error[i] > threshold[i]) | ((flags[i] & mask) != 0));
        all &= (uint8_t)(flags[i] | (out[i] - 1));
    }
    return all;
}

/* By thresholds of ranks: what is selected is closed (rule.c), so nobody need go down to it. A vertex of the block
 * has the rank that the powers of two in its column and row give it, where the sides have as many as the block is
 * wide; corners alone may have more. So rows whose numbers have the same power of two in them have the same ranks.
 */
static uint8_t choose_rows_by_rank(const walk *w, const int32_t by_rank[RQT_RANKS], uint8_t mask) {
    int32_t threshold[RQT_MAX_BLOCK_K + 1][(1 << RQT_MAX_BLOCK_K) + 1];
    const uint32_t n = (uint32_t)w->n, k = (uint32_t)w->query->k;
    const int32_t *const from = by_rank + 2 * __builtin_ctz((unsigned)w->place.stride);
    for (uint32_t power = 0; power <= k; power++)
        for (uint32_t u = 0; u < n; u++) {
            const uint32_t other = (uint32_t)__builtin_ctz(u | (n - 1));
            threshold[power][u] = from[2 * (power < other ? power : other) + (power == other)];
        }
    for (uint32_t u = 0; u < n; u += n - 1)
        threshold[k][u] = by_rank[rqt_vertex_rank(&w->query->lattice, place_vertex(w, (n - 1) * n + u))];
    uint8_t all = 0xFF;
    for (uint32_t v = 0; v < n; v++)
        all &= choose_row(w->block->error + n * v, w->block->flags + n * v, threshold[__builtin_ctz(v | (n - 1))],
                          n, mask, w->chosen + n * v);
    return all;
}

/* Are so many selected that going through all is quicker than going down to them? By a few of every second row and
 * column, centres of cells. */
static bool are_many(const walk *w, const int32_t by_rank[RQT_RANKS]) {
    enum { LOOKS = 4 };
    const uint32_t k = (uint32_t)w->query->k, n = (uint32_t)w->n, apart = n / LOOKS,
                   first = 2; /* n - 1 is 16 or more */
    if (k < 4) return true;
    const int32_t threshold = by_rank[2 * (__builtin_ctz((unsigned)w->place.stride) + 1) + 1];
    uint32_t count = 0;
    for (uint32_t i = 0; i < LOOKS * LOOKS; i++)
        count += w->block->error[(i / LOOKS * apart + first) * n + i % LOOKS * apart + first] > threshold;
    return count > LOOKS * LOOKS / 4;
}

static uint8_t choose_by_rank(const walk *w, uint8_t mask) {
    const int32_t *const by_rank = rule_thresholds(w->query->rule);
    return are_many(w, by_rank) ? choose_rows_by_rank(w, by_rank, mask)
                                : rule_choose(w->query->rule, &w->place, w->block, mask, w->chosen);
}

/* Where places or forced vertices are near: down from the block's centre, as far as they are selected. */
typedef struct choosing {
    const walk *w;
    rule_range range;
    uint8_t mask, all;
} choosing;

static bool choose_place(choosing *c, uint32_t place) {
    const walk *w = c->w;
    if (w->chosen[place]) return true;
    const rqt_code error = w->block->error[place];
    const uint8_t flags = w->block->flags[place];
    if (!(error > c->range.most || (flags & c->mask))) {
        if (error <= c->range.least && !c->range.forced) return false;
        if (!rqt_rule_selects(w->query->rule, place_vertex(w, place), error, false)) return false;
    }
    c->all &= flags;
    w->chosen[place] = 1;
    return true;
}

static void choose_below(choosing *c, uint32_t a, uint32_t l, uint32_t r, int splits) {
    const uint32_t m = (l + r) / 2;
    if (splits == 0 || !choose_place(c, m)) return;
    choose_below(c, m, l, a, splits - 1);
    choose_below(c, m, a, r, splits - 1);
}

static uint8_t choose_by_rule(const walk *w, uint8_t mask) {
    const uint32_t n = (uint32_t)w->n, last = n - 1, corners[4] = {0, last, last * n, last * n + last};
    const rqt_vertex centre = {w->place.x + w->place.side / 2, w->place.y + w->place.side / 2};
    choosing c = {w, rule_range_below(w->query->rule, centre), mask, 0xFF};
    if (c.range.least == c.range.most && c.range.least >= 0 && !c.range.forced)
        return choose_by_error(w->block, (size_t)n * n, (rqt_code)c.range.least, mask, w->chosen);
    const bool is_plain = !c.range.places && !c.range.forced;
    if (is_plain && !rule_field(w->query->rule)) return choose_by_rank(w, mask);
    if (is_plain) return rule_choose(w->query->rule, &w->place, w->block, mask, w->chosen);
    memset(w->chosen, 0, (size_t)n * n);
    /* The diagonal from one corner to the one across; query.c has the same cases. */
    const int from = w->place.level == 0 ? 0 : (w->place.i & 1) | (w->place.j & 1) << 1;
    choose_below(&c, corners[from ^ 1], corners[from], corners[3 - from], 2 * w->query->k);
    choose_below(&c, corners[from ^ 2], corners[3 - from], corners[from], 2 * w->query->k);
    return c.all;
}

void walk_choose(walk *w) {
    const uint32_t n = (uint32_t)w->n, last = n - 1;
    const uint8_t mask = w->query->outline == RQT_OUTLINE_EXACT ? RQT_OUTLINE : 0, *const flags = w->block->flags;
    uint8_t all = 0xFF;
    if (w->selection)
        for (uint32_t i = 0; i < n * n; i++) {
            w->chosen[i] = rqt_selection_has(w->selection, place_vertex(w, i));
            if (w->chosen[i]) all &= flags[i];
        }
    else if (w->query->rule)
        all = choose_by_rule(w, mask);
    else
        all = choose_by_error(w->block, (size_t)n * n, w->query->eps, mask, w->chosen);
    all &= flags[0] & flags[last] & flags[last * n] & flags[last * n + last];
    w->plain = (all & RQT_VALID) && !w->clamped && !w->aliased && !w->query->wants_leaves;
}

/* ------------------------------------------------------------------------------------------- without care */

/* A second child that waits for its turn. state: twice the splits it has left, and 1 if it is left by a leg. */
typedef struct later {
    uint32_t a, l, r, state;
} later;

/* Where the loop stands. Choices are made of masks: as branches nobody could foresee them. */
typedef struct cursor {
    uint32_t a, l, r;
    uint32_t splits;
    uint32_t by_leg_in, by_leg_out; /* 1: entered, left by a leg; 0: by the hypotenuse */
    uint64_t next; /* the vertex that comes next, with FRESH; above it, how many splits there were */
} cursor;

#define ONE_SPLIT (UINT64_C(1) << 32)

static inline __attribute__((always_inline)) uint32_t choose(uint32_t one, uint32_t yes, uint32_t no) {
    return no ^ ((yes ^ no) & (0 - one));
}

/* Down along the first children to a leaf. Returns the top of the stack. */
static inline __attribute__((always_inline)) later *descend(const walk *w, cursor *c, later *top) {
    const uint8_t *restrict const chosen = w->chosen;
    uint32_t *restrict const memo = w->memo, *restrict const order = w->order;
    const uint32_t live = w->live, first = (uint32_t)w->first | FRESH;
    for (;;) {
        const uint32_t m = (c->l + c->r) / 2;
        if (!(chosen[m] & (uint8_t)(c->splits != 0))) return top;
        const uint32_t left = memo[m], next = (uint32_t)c->next;
        const bool fresh = left < live;
        memo[m] = fresh ? next : left;
        order[next - first] = m;
        c->next += ONE_SPLIT + fresh;
        c->splits--;
        *top++ = (later){m, c->a, c->r, 2 * c->splits + (c->by_leg_out ^ 1)};
        c->r = c->a;
        c->a = m;
        c->by_leg_in ^= 1;
        c->by_leg_out = 1;
    }
}

static inline __attribute__((always_inline)) void take_later(cursor *c, const later *top) {
    c->a = top->a;
    c->l = top->l;
    c->r = top->r;
    c->splits = top->state / 2;
    c->by_leg_in = 1;
    c->by_leg_out = top->state & 1;
}

#define MOST_SPLITS (2 * RQT_MAX_BLOCK_K)

static cursor list_triangles(const walk *w, cursor c, bool clockwise, uint32_t *restrict out) {
    later stack[MOST_SPLITS], *top = stack;
    const uint32_t *const memo = w->memo, turn = clockwise ^ (c.splits & 1);
    for (;;) {
        top = descend(w, &c, top);
        const uint32_t l = memo[c.l] & INDEX, r = memo[c.r] & INDEX, swap = (l ^ r) & (0 - (turn ^ (c.splits & 1)));
        out[0] = memo[c.a] & INDEX;
        out[1] = r ^ swap;
        out[2] = l ^ swap;
        out += 3;
        if (top == stack) return c;
        take_later(&c, --top);
    }
}

static cursor visit_vertices(const walk *w, cursor c) {
    later stack[MOST_SPLITS], *top = stack;
    for (;;) {
        top = descend(w, &c, top);
        if (top == stack) return c;
        take_later(&c, --top);
    }
}

/* The leaf that the cursor is at, counter-clockwise. */
static void leaf_at(const walk *w, const cursor *c, bool clockwise, uint32_t triangle[3]) {
    triangle[0] = w->memo[c->a] & INDEX;
    triangle[1] = w->memo[clockwise ? c->l : c->r] & INDEX;
    triangle[2] = w->memo[clockwise ? c->r : c->l] & INDEX;
}

static cursor strip_triangles(const walk *w, cursor c, bool clockwise, strip_writer *strip) {
    later stack[MOST_SPLITS], *top = stack;
    const uint32_t *const memo = w->memo;
    const bool turn = clockwise ^ (c.splits & 1);
    uint32_t leaf[3];
    top = descend(w, &c, top);
    leaf_at(w, &c, turn ^ (c.splits & 1), leaf);
    if (top > stack) {
        /* The first leaf: how it was entered, the waiting triangle knows; how it is left, we do. */
        if (strip->waits) strip_say(strip, strip->waiting, leaf);
        const uint32_t right = memo[c.r] & INDEX, other = memo[c.by_leg_out ? c.a : c.l] & INDEX;
        strip_say(strip, leaf, (const uint32_t[3]){right, other, other});
        uint32_t *restrict s = strip->s + strip->count, pivot = s[-2];
        for (;;) {
            take_later(&c, --top);
            top = descend(w, &c, top);
            if (top == stack) break;
            const uint32_t by_leg = choose(c.by_leg_out, c.a, c.l);
            const uint32_t through = memo[choose(c.by_leg_in, by_leg, c.r)] & INDEX;
            *s = pivot;
            s += pivot == through;
            *s++ = memo[choose(c.by_leg_in, c.r, c.a)] & INDEX;
            pivot = through;
        }
        strip->count = (size_t)(s - strip->s);
        strip->waits = false;
        leaf_at(w, &c, turn ^ (c.splits & 1), leaf);
    }
    /* How the last leaf is left, the next triangle knows. */
    strip_put(strip, leaf);
    return c;
}

static void walk_plain(walk *w, const half *h) {
    rqt_patch *patch = w->patch;
    (void)patch_place(w, h->a);
    (void)patch_place(w, h->l);
    (void)patch_place(w, h->r);
    cursor c = {.a = h->a,
                .l = h->l,
                .r = h->r,
                .splits = (uint32_t)h->splits,
                .next = (uint32_t)patch->vertex_count | FRESH};
    if (w->query->product == RQT_PRODUCT_TRIANGLES)
        c = list_triangles(w, c, h->clockwise, patch->triangles + 3 * patch->triangle_count);
    else if (w->query->product == RQT_PRODUCT_STRIP)
        c = strip_triangles(w, c, h->clockwise, &w->strip);
    else
        c = visit_vertices(w, c);
    patch->triangle_count += (size_t)(c.next / ONE_SPLIT) + 1;
    patch->vertex_count = (uint32_t)c.next & ~FRESH;
}

/* ----------------------------------------------------------------------------------------------- with care */

static bool keeps(const walk *w, const corner *a, const corner *b, const corner *c) {
    if (!(a->flags & b->flags & c->flags & RQT_VALID)) return false;
    const int32_t last_x = w->query->lattice.width - 1, last_y = w->query->lattice.height - 1;
    if (a->at.x >= last_x && b->at.x >= last_x && c->at.x >= last_x) return false;
    return !(a->at.y >= last_y && b->at.y >= last_y && c->at.y >= last_y);
}

void walk_emit(walk *w, const corner *a, const corner *l, const corner *r, bool inside) {
    if (!keeps(w, a, l, r)) return;
    if (!inside) {
        const rqt_lattice *lattice = &w->query->lattice;
        if (!rqt_region_meets(w->query->region, rqt_vertex_clamp(lattice, a->at), rqt_vertex_clamp(lattice, l->at),
                              rqt_vertex_clamp(lattice, r->at)))
            return;
    }
    const int64_t cross =
        (int64_t)(l->at.x - a->at.x) * (r->at.y - a->at.y) - (int64_t)(r->at.x - a->at.x) * (l->at.y - a->at.y);
    const uint32_t i = patch_vertex(w, a), j = patch_vertex(w, l), k = patch_vertex(w, r);
    if (w->query->wants_leaves) w->patch->leaves[w->patch->triangle_count] = (rqt_triangle){a->at, l->at, r->at};
    patch_triangle(w, i, j, k, cross < 0);
}

/* The vertex at a place of the block's arrays. */
static corner block_corner(const walk *w, uint32_t place) {
    return (corner){.at = place_vertex(w, place),
                    .q = w->block->q[place],
                    .error = w->block->error[place],
                    .flags = w->block->flags[place],
                    .place = place};
}

static rqt_relation relation_of(const walk *w, rqt_vertex a, rqt_vertex b, rqt_vertex c) {
    const rqt_lattice *lattice = &w->query->lattice;
    const rqt_vertex p = rqt_vertex_clamp(lattice, a), q = rqt_vertex_clamp(lattice, b),
                     r = rqt_vertex_clamp(lattice, c);
    const int32_t x0 = p.x < q.x ? (p.x < r.x ? p.x : r.x) : (q.x < r.x ? q.x : r.x);
    const int32_t y0 = p.y < q.y ? (p.y < r.y ? p.y : r.y) : (q.y < r.y ? q.y : r.y);
    const int32_t x1 = p.x > q.x ? (p.x > r.x ? p.x : r.x) : (q.x > r.x ? q.x : r.x);
    const int32_t y1 = p.y > q.y ? (p.y > r.y ? p.y : r.y) : (q.y > r.y ? q.y : r.y);
    return rqt_region_box_relation(w->query->region, x0, y0, x1, y1);
}

/* All of it is the region's, and of its leaves those are kept whose corners are valid. */
static void walk_valid(walk *w, const half *from) {
    half stack[MOST_SPLITS + 1], *top = stack, h = *from;
    const uint8_t *const chosen = w->chosen, *const flags = w->block->flags;
    const bool is_list = w->query->product == RQT_PRODUCT_TRIANGLES;
    uint32_t *const out = w->patch->triangles;
    for (;;) {
        const uint32_t m = (h.l + h.r) / 2;
        if (h.splits > 0 && chosen[m]) {
            *top++ = (half){m, h.a, h.r, h.splits - 1, !h.clockwise};
            h = (half){m, h.l, h.a, h.splits - 1, !h.clockwise};
            continue;
        }
        if (flags[h.a] & flags[h.l] & flags[h.r] & RQT_VALID) {
            const uint32_t a = patch_place(w, h.a), l = patch_place(w, h.l), r = patch_place(w, h.r);
            if (is_list) {
                uint32_t *const t = out + 3 * w->patch->triangle_count++;
                t[0] = a;
                t[1] = h.clockwise ? l : r;
                t[2] = h.clockwise ? r : l;
            } else {
                patch_triangle(w, a, l, r, h.clockwise);
            }
        }
        if (top == stack) return;
        h = *--top;
    }
}

/* Is there nothing left to ask but what is selected, and valid? */
static bool walk_whole(walk *w, const half *h) {
    if (w->plain)
        walk_plain(w, h);
    else if (!w->clamped && !w->aliased && !w->query->wants_leaves)
        walk_valid(w, h);
    else
        return false;
    return true;
}

static void walk_triangle(walk *w, const half *h, bool inside) {
    if (inside && walk_whole(w, h)) return;
    const corner a = block_corner(w, h->a), l = block_corner(w, h->l), r = block_corner(w, h->r);
    if (!inside) {
        const rqt_relation relation = relation_of(w, a.at, l.at, r.at);
        if (relation == RQT_OUTSIDE) return;
        inside = relation == RQT_INSIDE;
        if (inside && walk_whole(w, h)) return;
    }
    const uint32_t m = (h->l + h->r) / 2;
    if (h->splits == 0 || !w->chosen[m]) {
        walk_emit(w, &a, &l, &r, inside);
        return;
    }
    walk_triangle(w, &(half){m, h->l, h->a, h->splits - 1, !h->clockwise}, inside);
    walk_triangle(w, &(half){m, h->a, h->r, h->splits - 1, !h->clockwise}, inside);
}

void walk_half_block(walk *w, uint32_t a, uint32_t l, uint32_t r, bool clockwise) {
    walk_triangle(w, &(half){a, l, r, 2 * w->query->k, clockwise}, false);
}
