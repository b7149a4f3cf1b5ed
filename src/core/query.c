/* query.c - region + eps -> patch: the walk over the blocks that answer.
 *
 * A block that answers holds every selected vertex of its cell, so both halves of its cell are walked without looking at
 * anything else, with one exception. Let p be the block's parent and A the block's corner in the middle of a side of
 * p. If A is not selected, the leaf there is the quarter of p on that side, of which the block has the apex (the centre of
 * p, always selected) and one end; the other end is the block's far vertex. Two siblings share that quarter: the first of
 * those present emits it.
 *
 * The walk keeps the order of a space-filling curve: each half is entered at one end of its hypotenuse and left at the
 * other, the children in the order that continues it. Neighbours in the list of triangles are neighbours on the
 * ground, which is what strip.c lives on. The winding is put right as triangles are emitted.
 */
#include "internal.h"

#include <limits.h>

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
    size_t vertex_capacity, triangle_capacity;
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
    rqt_status status;
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

static uint32_t append_vertex(walk *w, const corner *c, rqt_vertex sample, uint8_t level) {
    rqt_patch *patch = w->patch;
    if (patch->vertex_count >= NONE - 1 ||
        !memory_grow(w->allocator, (void **)&patch->vertices, &w->vertex_capacity, patch->vertex_count + 1,
                     sizeof *patch->vertices)) {
        w->status = RQT_NO_MEMORY;
        return NONE;
    }
    patch->vertices[patch->vertex_count] =
        (rqt_patch_vertex){.col = sample.x, .row = sample.y, .q = c->q, .error = c->error, .level = level};
    return (uint32_t)patch->vertex_count++;
}

/* The index of a corner in the patch. Vertices inside a block occur in no other block: for them the memo is enough. */
static uint32_t intern(walk *w, const corner *c, bool shared) {
    if (c->memo && *c->memo != NONE) return *c->memo;
    const rqt_vertex sample = rqt_vertex_clamp(&w->query->lattice, c->at);
    const uint8_t level = (uint8_t)rqt_vertex_level(&w->query->lattice, c->at);
    uint32_t index = NONE;
    if (!shared) {
        index = append_vertex(w, c, sample, level);
    } else {
        if (2 * (w->table_count + 1) > w->table_size && !table_grow(w)) {
            w->status = RQT_NO_MEMORY;
            return NONE;
        }
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
            if (index == NONE) return NONE;
            w->table[at] = index;
            w->table_count++;
        }
    }
    if (c->memo) *c->memo = index;
    return index;
}

/* Is this lattice vertex the only one of its sample, and of no other block? */
static bool is_shared(const walk *w, rqt_vertex v) {
    const rqt_block_place *p = &w->place;
    return v.x <= p->x || v.y <= p->y || v.x >= p->x + p->side || v.y >= p->y + p->side ||
           v.x >= w->query->lattice.width - 1 || v.y >= w->query->lattice.height - 1;
}

static bool keeps(const walk *w, const corner *a, const corner *b, const corner *c) {
    if (!(a->flags & b->flags & c->flags & RQT_VALID)) return false;
    const int32_t last_x = w->query->lattice.width - 1, last_y = w->query->lattice.height - 1;
    if (a->at.x >= last_x && b->at.x >= last_x && c->at.x >= last_x) return false;
    return !(a->at.y >= last_y && b->at.y >= last_y && c->at.y >= last_y);
}

/* A leaf. inside: the region is known to want it. */
static void emit(walk *w, const corner *a, const corner *b, const corner *c, bool inside) {
    if (w->status != RQT_OK || !keeps(w, a, b, c)) return;
    if (!inside) {
        const rqt_lattice *lattice = &w->query->lattice;
        if (!rqt_region_meets(w->query->region, rqt_vertex_clamp(lattice, a->at), rqt_vertex_clamp(lattice, b->at),
                              rqt_vertex_clamp(lattice, c->at)))
            return;
    }
    const uint32_t i = intern(w, a, is_shared(w, a->at)), j = intern(w, b, is_shared(w, b->at)),
                   k = intern(w, c, is_shared(w, c->at));
    if (w->status != RQT_OK) return;
    rqt_patch *patch = w->patch;
    if (!memory_grow(w->allocator, (void **)&patch->triangles, &w->triangle_capacity, patch->triangle_count + 1,
                     3 * sizeof *patch->triangles)) {
        w->status = RQT_NO_MEMORY;
        return;
    }
    /* Rows grow south, so counter-clockwise from above is clockwise in (col,row). */
    const int64_t cross = (int64_t)(b->at.x - a->at.x) * (c->at.y - a->at.y) -
                          (int64_t)(c->at.x - a->at.x) * (b->at.y - a->at.y);
    uint32_t *out = patch->triangles + 3 * patch->triangle_count++;
    out[0] = i;
    out[1] = cross < 0 ? j : k;
    out[2] = cross < 0 ? k : j;
}

/* ------------------------------------------------------------------------------------------ inside a block */

static bool is_selected(const walk *w, rqt_vertex v, rqt_code error, uint8_t flags) {
    if (w->selection) return rqt_selection_has(w->selection, v);
    return error > w->query->eps || (w->query->outline == RQT_OUTLINE_EXACT && (flags & RQT_OUTLINE));
}

static corner block_corner(const walk *w, int u, int v) {
    const size_t i = (size_t)v * (size_t)w->n + (size_t)u;
    const int32_t stride = w->place.stride;
    return (corner){.at = {w->place.x + u * stride, w->place.y + v * stride},
                    .q = w->block->q[i],
                    .error = w->block->error[i],
                    .flags = w->block->flags[i],
                    .memo = &w->memo[i]};
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

/* The triangle with apex (au,av) and hypotenuse from (lu,lv) to (ru,rv), in grid places of the block. */
static void walk_triangle(walk *w, int au, int av, int lu, int lv, int ru, int rv, bool inside) {
    if (!inside) {
        const rqt_block_place *p = &w->place;
        const int32_t s = p->stride;
        const rqt_relation relation = relation_of(w, (rqt_vertex){p->x + au * s, p->y + av * s},
                                                  (rqt_vertex){p->x + lu * s, p->y + lv * s},
                                                  (rqt_vertex){p->x + ru * s, p->y + rv * s});
        if (relation == RQT_OUTSIDE) return;
        inside = relation == RQT_INSIDE;
    }
    if (!((lu + ru) & 1) && !((lv + rv) & 1)) {
        const int mu = (lu + ru) / 2, mv = (lv + rv) / 2;
        if (w->chosen[(size_t)mv * (size_t)w->n + (size_t)mu]) {
            walk_triangle(w, mu, mv, lu, lv, au, av, inside);
            walk_triangle(w, mu, mv, au, av, ru, rv, inside);
            return;
        }
    }
    const corner a = block_corner(w, au, av), l = block_corner(w, lu, lv), r = block_corner(w, ru, rv);
    emit(w, &a, &l, &r, inside);
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

/* One half of the block's cell: apex at corner `a`, hypotenuse from corner `from` to corner `to` (0 NW, 1 NE, 2 SW, 3 SE). */
static void walk_half(walk *w, const rqt_summary *summary, int a, int from, int to) {
    const rqt_block_place *p = &w->place;
    if (w->block) {
        const int last = w->n - 1;
        walk_triangle(w, a & 1 ? last : 0, a & 2 ? last : 0, from & 1 ? last : 0, from & 2 ? last : 0,
                      to & 1 ? last : 0, to & 2 ? last : 0, false);
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
                if (child + 1 < end && morton_order(w, a[child].number) < morton_order(w, a[child + 1].number)) child++;
                if (morton_order(w, a[root].number) >= morton_order(w, a[child].number)) break;
                const rqt_answer swap = a[root];
                a[root] = a[child];
                a[child] = swap;
                root = child;
            }
        }
    }
}

/* The closed set that the answers hold, by the closing algorithms: they look at errors of these blocks only, and reach
 * whatever else a vertex depends on, across blocks, by coordinates. */
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
        if (rqt_summary_needs_block(&answer->summary, place.level, query->outline, query->eps)) {
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

static void choose(walk *w) {
    const size_t count = (size_t)w->n * (size_t)w->n;
    memset(w->memo, 0xFF, count * sizeof *w->memo);
    for (size_t i = 0; i < count; i++) {
        const rqt_vertex at = {w->place.x + (int32_t)(i % (size_t)w->n) * w->place.stride,
                               w->place.y + (int32_t)(i / (size_t)w->n) * w->place.stride};
        w->chosen[i] = is_selected(w, at, w->block->error[i], w->block->flags[i]);
    }
}

static rqt_status run(walk *w) {
    rqt_query *query = w->query;
    sort_answers(w);
    for (size_t b = 0; b < query->answer_count; b++)
        if (rqt_block_locate(&query->lattice, query->k, query->answers[b].number, &w->place) != RQT_OK)
            return RQT_CORRUPT;
    if (query->select != RQT_SELECT_THRESHOLD) {
        const rqt_status status = close_selection(w);
        if (status != RQT_OK) return status;
    }
    for (size_t b = 0; b < query->answer_count && w->status == RQT_OK; b++) {
        const rqt_answer *answer = &query->answers[b];
        if (query->is_interrupted && query->is_interrupted(query->context)) return RQT_INTERRUPTED;
        (void)rqt_block_locate(&query->lattice, query->k, answer->number, &w->place);
        w->block = NULL;
        if (rqt_summary_needs_block(&answer->summary, w->place.level, query->outline, query->eps)) {
            w->block = query->read_block(query->context, answer->number);
            if (!w->block) return RQT_READ_FAILED;
            if (w->block->k != query->k) return RQT_CORRUPT;
            choose(w);
        }
        walk_block(w, answer);
    }
    return w->status;
}

rqt_status rqt_query_run(rqt_query *query, const rqt_allocator *allocator, rqt_patch *patch) {
    memset(patch, 0, sizeof *patch);
    patch->allocator = *allocator;
    if (query->k < 0 || query->k > RQT_MAX_BLOCK_K || query->k > query->lattice.K) return RQT_INVALID;
    walk w = {.query = query,
              .allocator = allocator,
              .patch = patch,
              .fine_levels = rqt_block_levels(&query->lattice, query->k),
              .n = (1 << query->k) + 1,
              .status = RQT_OK};
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
    memset(patch, 0, sizeof *patch);
}
