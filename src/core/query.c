/* query.c - region + eps -> patch: the walk over the blocks that answer.
 *
 * A block that answers holds every selected vertex of its cell, so both halves of its cell are walked without
 * looking at anything else, with one exception. Let p be the block's parent and A the block's corner in the middle
 * of a side of p. If A is not selected, the leaf there is the quarter of p on that side, of which the block has the
 * apex (the centre of p, always selected) and one end; the other end is the block's far vertex. Two siblings share
 * that quarter: the first of those present emits it.
 *
 * The walk keeps the order of a space-filling curve: each half is entered at one end of its hypotenuse and left at
 * the other, the children in the order that continues it. Neighbours in the list of triangles are neighbours on the
 * ground, which is what strip.c lives on. The winding is put right as triangles are emitted.
 */
#include "internal.h"

#define NONE UINT32_MAX

/* A corner of a leaf on its way into the patch. */
typedef struct corner {
    rqt_vertex at; /* lattice */
    int32_t q;
    rqt_code error;
    uint8_t flags;
    uint32_t *memo; /* where the index in the patch is remembered; NULL: nowhere */
} corner;

typedef struct walk {
    rqt_query *query;
    const rqt_allocator *allocator;
    rqt_patch *patch;
    size_t vertex_capacity, triangle_capacity, leaf_capacity;
    uint32_t *table; /* open addressing: index of a vertex of the patch, by sample */
    size_t table_size, table_count;
    rqt_selection *selection; /* NULL: by threshold */
    int fine_levels;          /* number of block levels, for the Morton order */
    /* the block at hand */
    rqt_block_place place;
    const rqt_block *block; /* NULL: its summary is enough */
    int n;                  /* vertices a side */
    uint8_t *chosen;        /* n * n: selected? */
    uint32_t *memo;         /* n * n: index in the patch, or NONE */
    bool clamped;           /* some of its vertices are past the last sample */
    bool plain;             /* not clamped, and without voids */
} walk;

/* ----------------------------------------------------------------------------------------- the patch grows */

static size_t table_place(int32_t col, int32_t row, size_t size) {
    uint64_t h = ((uint64_t)(uint32_t)row << 32 | (uint32_t)col) * UINT64_C(0x9E3779B97F4A7C15);
    return (size_t)(h >> 24) & (size - 1);
}

static bool table_grow(walk *w) {
    const size_t wider = w->table_size ? w->table_size * 2 : 1024;
    uint32_t *table = memory_take(w->allocator, wider * sizeof *table);
    if (!table) return false;
    memset(table, 0xFF, wider * sizeof *table);
    for (size_t i = 0; i < w->table_size; i++) {
        if (w->table[i] == NONE) continue;
        const rqt_patch_vertex *v = &w->patch->vertices[w->table[i]];
        size_t at = table_place(v->col, v->row, wider);
        while (table[at] != NONE) at = (at + 1) & (wider - 1);
        table[at] = w->table[i];
    }
    memory_drop(w->allocator, w->table);
    w->table = table;
    w->table_size = wider;
    return true;
}

/* Room for all that one block can add, so that nothing can fail while it is walked. */
static bool reserve(walk *w) {
    rqt_patch *patch = w->patch;
    const size_t vertices = (size_t)w->n * (size_t)w->n + 6, triangles = 2 * (size_t)w->n * (size_t)w->n + 2,
                 shared = 4 * (size_t)w->n + 6;
    if (patch->vertex_count + vertices >= NONE ||
        !memory_grow(w->allocator, (void **)&patch->vertices, &w->vertex_capacity, patch->vertex_count + vertices,
                     sizeof *patch->vertices) ||
        !memory_grow(w->allocator, (void **)&patch->triangles, &w->triangle_capacity,
                     patch->triangle_count + triangles, 3 * sizeof *patch->triangles))
        return false;
    if (w->query->wants_leaves && !memory_grow(w->allocator, (void **)&patch->leaves, &w->leaf_capacity,
                                               patch->triangle_count + triangles, sizeof *patch->leaves))
        return false;
    /* A block at the raster's edge may share more, up to all of its vertices, with its own aliases. */
    const size_t entries = w->table_count + (w->clamped ? vertices : shared);
    while (2 * (entries + 1) > w->table_size)
        if (!table_grow(w)) return false;
    return true;
}

static uint32_t append_vertex(walk *w, const corner *c, rqt_vertex sample, uint8_t level) {
    rqt_patch *patch = w->patch;
    patch->vertices[patch->vertex_count] =
        (rqt_patch_vertex){.col = sample.x, .row = sample.y, .q = c->q, .error = c->error, .level = level};
    return (uint32_t)patch->vertex_count++;
}

/* May another block, or another lattice vertex, be the same sample? */
static bool is_shared(const walk *w, rqt_vertex v) {
    const rqt_block_place *p = &w->place;
    return v.x <= p->x || v.y <= p->y || v.x >= p->x + p->side || v.y >= p->y + p->side ||
           v.x >= w->query->lattice.width - 1 || v.y >= w->query->lattice.height - 1;
}

/* The index of a corner in the patch. Vertices inside a block occur in no other block: for them the memo is enough.
 */
static uint32_t intern(walk *w, const corner *c) {
    if (c->memo && *c->memo != NONE) return *c->memo;
    const rqt_vertex sample = rqt_vertex_clamp(&w->query->lattice, c->at);
    const uint8_t level = (uint8_t)rqt_vertex_level(&w->query->lattice, c->at);
    uint32_t index = NONE;
    if (!is_shared(w, c->at)) {
        index = append_vertex(w, c, sample, level);
    } else {
        size_t at = table_place(sample.x, sample.y, w->table_size);
        for (; w->table[at] != NONE; at = (at + 1) & (w->table_size - 1)) {
            rqt_patch_vertex *v = &w->patch->vertices[w->table[at]];
            if (v->col != sample.x || v->row != sample.y) continue;
            index = w->table[at]; /* the same sample, perhaps as another lattice vertex */
            if (c->error > v->error) v->error = c->error;
            if (level < v->level) v->level = level;
            break;
        }
        if (index == NONE) {
            index = append_vertex(w, c, sample, level);
            w->table[at] = index;
            w->table_count++;
        }
    }
    if (c->memo) *c->memo = index;
    return index;
}

static bool keeps(const walk *w, const corner *a, const corner *b, const corner *c) {
    if (!(a->flags & b->flags & c->flags & RQT_VALID)) return false;
    const int32_t last_x = w->query->lattice.width - 1, last_y = w->query->lattice.height - 1;
    if (a->at.x >= last_x && b->at.x >= last_x && c->at.x >= last_x) return false;
    return !(a->at.y >= last_y && b->at.y >= last_y && c->at.y >= last_y);
}

/* A leaf whose apex, left and right turn clockwise in (col,row): counter-clockwise from above, for rows grow south.
 */
static void put_triangle(walk *w, uint32_t a, uint32_t l, uint32_t r, bool clockwise) {
    uint32_t *out = w->patch->triangles + 3 * w->patch->triangle_count++;
    out[0] = a;
    out[1] = clockwise ? l : r;
    out[2] = clockwise ? r : l;
}

/* A leaf that may be void, without area, or none of the region's. */
static void emit(walk *w, const corner *a, const corner *l, const corner *r, bool inside) {
    if (!keeps(w, a, l, r)) return;
    if (!inside) {
        const rqt_lattice *lattice = &w->query->lattice;
        if (!rqt_region_meets(w->query->region, rqt_vertex_clamp(lattice, a->at), rqt_vertex_clamp(lattice, l->at),
                              rqt_vertex_clamp(lattice, r->at)))
            return;
    }
    const int64_t cross =
        (int64_t)(l->at.x - a->at.x) * (r->at.y - a->at.y) - (int64_t)(r->at.x - a->at.x) * (l->at.y - a->at.y);
    const uint32_t i = intern(w, a), j = intern(w, l), k = intern(w, r);
    if (w->query->wants_leaves) w->patch->leaves[w->patch->triangle_count] = (rqt_triangle){a->at, l->at, r->at};
    put_triangle(w, i, j, k, cross < 0);
}

/* ------------------------------------------------------------------------------------------ inside a block */

static bool is_selected(const walk *w, rqt_vertex v, rqt_code error, uint8_t flags) {
    if (w->selection) return rqt_selection_has(w->selection, v);
    return error > w->query->eps || (w->query->outline == RQT_OUTLINE_EXACT && (flags & RQT_OUTLINE));
}

/* The vertex at place i of the block's arrays. */
static corner block_corner(const walk *w, uint32_t i) {
    const int32_t stride = w->place.stride, u = (int32_t)i % w->n, v = (int32_t)i / w->n;
    return (corner){.at = {w->place.x + u * stride, w->place.y + v * stride},
                    .q = w->block->q[i],
                    .error = w->block->error[i],
                    .flags = w->block->flags[i],
                    .memo = &w->memo[i]};
}

static uint32_t place_index(walk *w, uint32_t i) {
    if (w->memo[i] != NONE) return w->memo[i];
    const corner c = block_corner(w, i);
    return intern(w, &c);
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

/* Below a triangle that the region wants as a whole, in a block without voids inside the raster: nothing is left to
 * ask but whether the split vertex is selected. a, l, r: places in the block's arrays; the midpoint of two places
 * is their mean. splits: how often the triangle can be split on the block's grid. */
static void walk_plain(walk *w, uint32_t a, uint32_t l, uint32_t r, int splits, bool clockwise) {
    const uint32_t m = (l + r) / 2;
    if (splits > 0 && w->chosen[m]) {
        walk_plain(w, m, l, a, splits - 1, !clockwise);
        walk_plain(w, m, a, r, splits - 1, !clockwise);
        return;
    }
    const uint32_t i = place_index(w, a), j = place_index(w, l), k = place_index(w, r);
    put_triangle(w, i, j, k, clockwise);
}

static void walk_triangle(walk *w, uint32_t a, uint32_t l, uint32_t r, int splits, bool inside, bool clockwise) {
    if (!inside || !w->plain) {
        const corner ca = block_corner(w, a), cl = block_corner(w, l), cr = block_corner(w, r);
        if (!inside) {
            const rqt_relation relation = relation_of(w, ca.at, cl.at, cr.at);
            if (relation == RQT_OUTSIDE) return;
            inside = relation == RQT_INSIDE;
        }
        const uint32_t m = (l + r) / 2;
        if (splits == 0 || !w->chosen[m]) {
            emit(w, &ca, &cl, &cr, inside);
            return;
        }
        walk_triangle(w, m, l, a, splits - 1, inside, !clockwise);
        walk_triangle(w, m, a, r, splits - 1, inside, !clockwise);
        return;
    }
    walk_plain(w, a, l, r, splits, clockwise);
}

static uint64_t morton_order(const walk *w, rqt_block_number number) {
    const int level = (63 - __builtin_clzll(number)) / 2;
    return (number ^ (UINT64_C(1) << (2 * level))) << (2 * (w->fine_levels - 1 - level));
}

static bool has_answer(const walk *w, rqt_block_number number) {
    const uint64_t key = morton_order(w, number);
    size_t low = 0, high = w->query->answer_count;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (morton_order(w, w->query->answers[middle].number) < key)
            low = middle + 1;
        else
            high = middle;
    }
    return low < w->query->answer_count && w->query->answers[low].number == number;
}

static corner summary_corner(const rqt_summary_vertex *v, int32_t x, int32_t y) {
    return (corner){.at = {x, y}, .q = v->q, .error = v->error, .flags = v->flags, .memo = NULL};
}

/* One half of the block's cell: apex at corner `a`, hypotenuse from corner `from` to corner `to` (0 NW, 1 NE, 2 SW,
 * 3 SE). */
static void walk_half(walk *w, const rqt_summary *summary, int a, int from, int to) {
    const rqt_block_place *p = &w->place;
    if (w->block) {
        const uint32_t n = (uint32_t)w->n, last = n - 1, at[4] = {0, last, last * n, last * n + last};
        /* In (col,row), from x x to: which way do apex, from, to turn? */
        const int ax = a & 1, ay = a >> 1, fx = from & 1, fy = from >> 1, tx = to & 1, ty = to >> 1;
        const bool clockwise = (fx - ax) * (ty - ay) - (tx - ax) * (fy - ay) < 0;
        walk_triangle(w, at[a], at[from], at[to], 2 * w->query->k, false, clockwise);
        return;
    }
    corner c[3];
    const int which[3] = {a, from, to};
    for (int i = 0; i < 3; i++)
        c[i] = summary_corner(&summary->corner[which[i]], p->x + (which[i] & 1 ? p->side : 0),
                              p->y + (which[i] & 2 ? p->side : 0));
    emit(w, &c[0], &c[1], &c[2], false);
}

static void walk_block(walk *w, const rqt_answer *answer) {
    const rqt_block_place *p = &w->place;
    const rqt_summary *summary = &answer->summary;
    if (p->level == 0) { /* the root: its diagonal runs from north-west to south-east */
        walk_half(w, summary, 1, 0, 3);
        walk_half(w, summary, 2, 3, 0);
        return;
    }
    /* center: the corner that is the parent's centre; c: the one opposite, a corner of the parent. */
    const int c = (p->i & 1) | (p->j & 1) << 1, center = 3 - c;
    for (int h = 0; h < 2; h++) {
        const int a = h == 0 ? c ^ 1 : c ^ 2;
        const rqt_summary_vertex *apex = &summary->corner[a];
        const rqt_vertex at = {p->x + (a & 1 ? p->side : 0), p->y + (a & 2 ? p->side : 0)};
        if (is_selected(w, at, apex->error, apex->flags)) {
            walk_half(w, summary, a, h == 0 ? center : c, h == 0 ? c : center);
            continue;
        }
        const rqt_block_number sibling =
            rqt_block_number_of(p->level, h == 0 ? p->i ^ 1 : p->i, h == 0 ? p->j : p->j ^ 1);
        if (sibling < answer->number && has_answer(w, sibling)) continue;
        const int32_t cx = p->x + (c & 1 ? p->side : 0), cy = p->y + (c & 2 ? p->side : 0);
        const corner top = summary_corner(&summary->corner[center], p->x + (center & 1 ? p->side : 0),
                                          p->y + (center & 2 ? p->side : 0));
        const corner near = summary_corner(&summary->corner[c], cx, cy);
        const corner far = summary_corner(&summary->far[h], 2 * at.x - cx, 2 * at.y - cy);
        emit(w, &top, &near, &far, false);
    }
}

/* --------------------------------------------------------------------------------------------- the whole */

/* Heapsort: in place, no allocation, no recursion. */
static void sort_answers(walk *w) {
    rqt_answer *a = w->query->answers;
    const size_t n = w->query->answer_count;
    for (size_t phase = 0; phase < 2; phase++) {
        for (size_t step = phase ? n : n / 2; step-- > 0;) {
            size_t root = phase ? 0 : step;
            const size_t end = phase ? step : n;
            if (phase) {
                const rqt_answer swap = a[0];
                a[0] = a[step];
                a[step] = swap;
            }
            for (;;) {
                size_t child = 2 * root + 1;
                if (child >= end) break;
                if (child + 1 < end && morton_order(w, a[child].number) < morton_order(w, a[child + 1].number))
                    child++;
                if (morton_order(w, a[root].number) >= morton_order(w, a[child].number)) break;
                const rqt_answer swap = a[root];
                a[root] = a[child];
                a[child] = swap;
                root = child;
            }
        }
    }
}

/* The closed set that the answers hold, by the closing algorithms: they look at errors of these blocks only, and
 * reach whatever else a vertex depends on, across blocks, by coordinates. */
static rqt_status close_selection(walk *w) {
    rqt_query *query = w->query;
    const rqt_allocator *allocator = w->allocator;
    rqt_selection *closed;
    rqt_status status = rqt_selection_create(&query->lattice, allocator, &closed);
    if (status != RQT_OK) return status;
    rqt_vertex *found = NULL;
    size_t count = 0, capacity = 0;
    for (size_t b = 0; b < query->answer_count && status == RQT_OK; b++) {
        const rqt_answer *answer = &query->answers[b];
        rqt_block_place place;
        status = rqt_block_locate(&query->lattice, query->k, answer->number, &place);
        if (status != RQT_OK) break;
        const rqt_block *block = NULL;
        if (rqt_summary_needs_block(&answer->summary, query->outline, query->eps)) {
            block = query->read_block(query->context, answer->number);
            if (!block) status = RQT_READ_FAILED;
        }
        const int n = block ? w->n : 2;
        for (int i = 0; i < n * n && status == RQT_OK; i++) {
            const int u = i % n, v = i / n;
            const int32_t step = place.side / (n - 1);
            const rqt_vertex at = {place.x + u * step, place.y + v * step};
            const rqt_code error = block ? block->error[i] : answer->summary.corner[i].error;
            const uint8_t flags = block ? block->flags[i] : answer->summary.corner[i].flags;
            if (!is_selected(w, at, error, flags)) continue;
            if (query->select == RQT_SELECT_TOP_DOWN) {
                status = rqt_selection_add_resolved(closed, at);
            } else if (memory_grow(allocator, (void **)&found, &capacity, count + 1, sizeof *found)) {
                found[count++] = at;
            } else {
                status = RQT_NO_MEMORY;
            }
        }
    }
    if (status == RQT_OK && count > 0) status = rqt_selection_add_bottom_up(closed, found, count);
    memory_drop(allocator, found);
    if (status == RQT_OK)
        w->selection = closed;
    else
        rqt_selection_free(closed);
    return status;
}

/* Which vertices of the block are selected, and whether it needs care. */
static void choose(walk *w) {
    const size_t count = (size_t)w->n * (size_t)w->n;
    const rqt_code eps = w->query->eps, *error = w->block->error;
    const uint8_t mask = w->query->outline == RQT_OUTLINE_EXACT ? RQT_OUTLINE : 0, *flags = w->block->flags;
    memset(w->memo, 0xFF, count * sizeof *w->memo);
    uint8_t *restrict const chosen = w->chosen; /* bytes alias everything else unless they promise not to */
    uint8_t all = RQT_VALID;
    for (size_t i = 0; i < count; i++) {
        chosen[i] = (uint8_t)((error[i] > eps) | ((flags[i] & mask) != 0));
        all &= flags[i];
    }
    w->plain = all && !w->clamped && !w->query->wants_leaves;
    if (!w->selection) return;
    for (size_t i = 0; i < count; i++) {
        const rqt_vertex at = {w->place.x + (int32_t)(i % (size_t)w->n) * w->place.stride,
                               w->place.y + (int32_t)(i / (size_t)w->n) * w->place.stride};
        w->chosen[i] = rqt_selection_has(w->selection, at);
    }
}

static rqt_status run(walk *w) {
    rqt_query *query = w->query;
    sort_answers(w);
    for (size_t b = 0; b < query->answer_count; b++)
        if (rqt_block_locate(&query->lattice, query->k, query->answers[b].number, &w->place) != RQT_OK)
            return RQT_CORRUPT;
    /* The caller sums their areas; that they are disjoint too makes them a partition. */
    for (size_t b = 1; b < query->answer_count; b++) {
        const rqt_block_number before = query->answers[b - 1].number;
        const int level = (63 - __builtin_clzll(before)) / 2;
        if (morton_order(w, query->answers[b].number) - morton_order(w, before) <
            UINT64_C(1) << (2 * (w->fine_levels - 1 - level)))
            return RQT_CORRUPT;
    }
    if (query->select != RQT_SELECT_THRESHOLD) {
        const rqt_status status = close_selection(w);
        if (status != RQT_OK) return status;
    }
    for (size_t b = 0; b < query->answer_count; b++) {
        const rqt_answer *answer = &query->answers[b];
        if (query->is_interrupted && query->is_interrupted(query->context)) return RQT_INTERRUPTED;
        (void)rqt_block_locate(&query->lattice, query->k, answer->number, &w->place);
        w->block = NULL;
        if (rqt_summary_needs_block(&answer->summary, query->outline, query->eps)) {
            w->block = query->read_block(query->context, answer->number);
            if (!w->block) return RQT_READ_FAILED;
            if (w->block->k != query->k) return RQT_CORRUPT;
        }
        w->clamped = w->place.x + w->place.side > query->lattice.width - 1 ||
                     w->place.y + w->place.side > query->lattice.height - 1;
        if (!reserve(w)) return RQT_NO_MEMORY;
        if (w->block) choose(w);
        walk_block(w, answer);
    }
    return RQT_OK;
}

rqt_status rqt_query_run(rqt_query *query, const rqt_allocator *allocator, rqt_patch *patch) {
    memset(patch, 0, sizeof *patch);
    patch->allocator = *allocator;
    if (query->k < 0 || query->k > RQT_MAX_BLOCK_K || query->k > query->lattice.K) return RQT_INVALID;
    walk w = {.query = query,
              .allocator = allocator,
              .patch = patch,
              .fine_levels = rqt_block_levels(&query->lattice, query->k),
              .n = (1 << query->k) + 1};
    const size_t count = (size_t)w.n * (size_t)w.n;
    w.chosen = memory_take(allocator, count);
    w.memo = memory_take(allocator, count * sizeof *w.memo);
    rqt_status status = w.chosen && w.memo ? run(&w) : RQT_NO_MEMORY;
    memory_drop(allocator, w.chosen);
    memory_drop(allocator, w.memo);
    memory_drop(allocator, w.table);
    rqt_selection_free(w.selection);
    if (status != RQT_OK) rqt_patch_free(patch);
    return status;
}

void rqt_patch_free(rqt_patch *patch) {
    if (!patch->allocator.resize) return;
    memory_drop(&patch->allocator, patch->vertices);
    memory_drop(&patch->allocator, patch->triangles);
    memory_drop(&patch->allocator, patch->leaves);
    memset(patch, 0, sizeof *patch);
}
