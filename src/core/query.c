/* query.c - region + eps -> patch: the walk over the blocks that answer.
 *
 * A block that answers holds every selected vertex of its cell, so both halves of its cell are walked without
 * looking at anything else, with one exception. Let p be the block's parent and A the block's corner in the middle
 * of a side of p. If A is not selected, the leaf there is the quarter of p on that side, of which the block has the
 * apex (the centre of p, always selected) and one end; the other end is the block's far vertex. Two siblings share
 * that quarter: the first of those present emits it. The sibling answers as a block too: below it nothing is
 * selected, for its centre depends on A.
 *
 * Which block answers where, and why this holds for rules (rqt_rule) as for one eps: rule.c.
 *
 * A block whose bytes are not needed, because nothing inside is selected or because it only touches the region, is
 * not read: its summary says all that there is to say.
 */
#include "walk.h"

bool rqt_query_selects(const rqt_query *query, rqt_vertex v, rqt_code error, uint8_t flags) {
    const bool outline = query->outline == RQT_OUTLINE_EXACT && (flags & RQT_OUTLINE);
    return query->rule ? rqt_rule_selects(query->rule, v, error, outline) : error > query->eps || outline;
}

static bool is_selected(const walk *w, rqt_vertex v, rqt_code error, uint8_t flags) {
    return w->selection ? rqt_selection_has(w->selection, v) : rqt_query_selects(w->query, v, error, flags);
}

/* summary.c: nothing but the corners is selected where the centre is not. */
static bool selects_inside(const rqt_query *query, const rqt_block_place *p, const rqt_summary *summary) {
    const rqt_vertex centre = {p->x + p->side / 2, p->y + p->side / 2};
    return query->k > 0 && rqt_query_selects(query, centre, summary->center_error, summary->center_flags);
}

bool rqt_query_selects_inside(const rqt_query *query, const rqt_answer *answer) {
    rqt_block_place place;
    return rqt_block_locate(&query->lattice, query->k, answer->number, &place) != RQT_OK ||
           selects_inside(query, &place, &answer->summary);
}

/* How the closed cell of a block, as far as there are samples, lies to the region. */
static rqt_relation block_relation(const rqt_query *query, const rqt_block_place *p) {
    const rqt_vertex end = rqt_vertex_clamp(&query->lattice, (rqt_vertex){p->x + p->side, p->y + p->side});
    return rqt_region_box_relation(query->region, p->x, p->y, end.x, end.y);
}

bool rqt_query_needs_block(const rqt_query *query, const rqt_answer *answer) {
    rqt_block_place place;
    if (!rqt_query_selects_inside(query, answer)) return false;
    if (query->select != RQT_SELECT_THRESHOLD) return true;
    return rqt_block_locate(&query->lattice, query->k, answer->number, &place) != RQT_OK ||
           block_relation(query, &place) != RQT_OUTSIDE;
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

/* Corner c (0 NW, 1 NE, 2 SW, 3 SE) of the block's cell. */
static corner summary_corner(const walk *w, const rqt_summary *summary, int c) {
    const rqt_block_place *p = &w->place;
    const rqt_summary_vertex *v = &summary->corner[c];
    const uint32_t n = (uint32_t)w->n, last = n - 1, at[4] = {0, last, last * n, last * n + last};
    return (corner){.at = {p->x + (c & 1 ? p->side : 0), p->y + (c & 2 ? p->side : 0)},
                    .q = v->q,
                    .error = v->error,
                    .flags = v->flags,
                    .place = w->block ? at[c] : NO_PLACE};
}

/* One half of the block's cell: apex at corner `a`, hypotenuse from corner `from` to corner `to`. */
static void walk_half(walk *w, const rqt_summary *summary, int a, int from, int to) {
    const corner apex = summary_corner(w, summary, a), left = summary_corner(w, summary, from),
                 right = summary_corner(w, summary, to);
    if (!w->block) {
        walk_emit(w, &apex, &left, &right, false);
        return;
    }
    /* In (col,row), from x x to: which way do apex, from, to turn? */
    const int ax = a & 1, ay = a >> 1, fx = from & 1, fy = from >> 1, tx = to & 1, ty = to >> 1;
    const bool clockwise = (fx - ax) * (ty - ay) - (tx - ax) * (fy - ay) < 0;
    walk_half_block(w, apex.place, left.place, right.place, clockwise);
}

/* outside: nothing within the block is the region's; a quarter that reaches over it may be. */
static void walk_block(walk *w, const rqt_answer *answer, bool outside) {
    const rqt_block_place *p = &w->place;
    const rqt_summary *summary = &answer->summary;
    if (p->level == 0) { /* the root: its diagonal runs from north-west to south-east */
        if (outside) return;
        walk_half(w, summary, 1, 0, 3);
        walk_half(w, summary, 2, 3, 0);
        return;
    }
    /* center: the corner that is the parent's centre; c: the one opposite, a corner of the parent. */
    const int c = (p->i & 1) | (p->j & 1) << 1, center = 3 - c;
    for (int h = 0; h < 2; h++) {
        const int a = h == 0 ? c ^ 1 : c ^ 2;
        const corner apex = summary_corner(w, summary, a);
        if (is_selected(w, apex.at, apex.error, apex.flags)) {
            if (!outside) walk_half(w, summary, a, h == 0 ? center : c, h == 0 ? c : center);
            continue;
        }
        const rqt_block_number sibling =
            rqt_block_number_of(p->level, h == 0 ? p->i ^ 1 : p->i, h == 0 ? p->j : p->j ^ 1);
        if (sibling < answer->number && has_answer(w, sibling)) continue;
        const corner top = summary_corner(w, summary, center), near = summary_corner(w, summary, c);
        const rqt_summary_vertex *f = &summary->far[h];
        const corner far = {.at = {2 * apex.at.x - near.at.x, 2 * apex.at.y - near.at.y},
                            .q = f->q,
                            .error = f->error,
                            .flags = f->flags,
                            .place = NO_PLACE};
        walk_emit(w, &top, &near, &far, false);
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
        if (selects_inside(query, &place, &answer->summary)) {
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

static rqt_status run_block(walk *w, const rqt_answer *answer) {
    rqt_query *query = w->query;
    if (query->is_interrupted && query->is_interrupted(query->context)) return RQT_INTERRUPTED;
    (void)rqt_block_locate(&query->lattice, query->k, answer->number, &w->place);
    const rqt_block_place *p = &w->place;
    const int32_t last_x = query->lattice.width - 1, last_y = query->lattice.height - 1,
                  side = 1 << query->lattice.K;
    const bool outside = block_relation(query, p) == RQT_OUTSIDE;
    w->block = NULL;
    if (!outside && selects_inside(query, p, &answer->summary)) {
        w->block = query->read_block(query->context, answer->number);
        if (!w->block) return RQT_READ_FAILED;
        if (w->block->k != query->k) return RQT_CORRUPT;
    }
    w->clamped = p->x + p->side > last_x || p->y + p->side > last_y;
    w->aliased = (last_x < side && p->x + p->side >= last_x) || (last_y < side && p->y + p->side >= last_y);
    if (!patch_reserve(w)) return RQT_NO_MEMORY;
    if (w->block) {
        walk_choose(w);
        patch_enter_block(w);
    }
    walk_block(w, answer, outside);
    if (w->block) patch_leave_block(w);
    return RQT_OK;
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
        const rqt_status status = run_block(w, &query->answers[b]);
        if (status != RQT_OK) return status;
    }
    strip_finish(&w->strip);
    return RQT_OK;
}

rqt_status rqt_query_run(rqt_query *query, const rqt_allocator *allocator, rqt_patch *patch) {
    memset(patch, 0, sizeof *patch);
    patch->allocator = *allocator;
    if (query->k < 0 || query->k > RQT_MAX_BLOCK_K || query->k > query->lattice.K) return RQT_INVALID;
    if (query->wants_leaves && query->product != RQT_PRODUCT_TRIANGLES) return RQT_INVALID;
    rqt_scratch *own = NULL;
    if (!query->scratch && rqt_scratch_create(allocator, &own) != RQT_OK) return RQT_NO_MEMORY;
    walk w = {.query = query,
              .allocator = allocator,
              .patch = patch,
              .scratch = own ? own : query->scratch,
              .fine_levels = rqt_block_levels(&query->lattice, query->k),
              .n = (1 << query->k) + 1};
    w.inverse = (UINT64_C(1) << 32) / (uint64_t)w.n + 1; /* places are below 2^17 */
    const rqt_status status = patch_begin(&w) ? run(&w) : RQT_NO_MEMORY;
    rqt_selection_free(w.selection);
    patch_end(&w, status);
    rqt_scratch_free(own);
    return status;
}
