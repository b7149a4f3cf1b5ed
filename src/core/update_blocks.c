/* update_blocks.c - which blocks change when vertices and samples do, and what becomes of them.
 *
 * Bytes, fine to coarse. A block of stride 1 that holds a changed sample or vertex is made anew: new samples, new
 * errors. A coarser one is put together from its four quarters, as they are now: what it keeps errs more than its
 * floor, hence more than theirs, and is kept there too, but for the vertices at the quarters' corners, whose errors
 * are known otherwise. Where a block comes out as it was, what is above it does not hear of it. A vertex of scale s
 * is lattice to a block of side 2^(s+1) for the first time: before, it is a corner, and in no bytes.
 *
 * Summaries, coarse to fine. What a summary says, its parent's also says, or its own block: so a summary can only
 * change where a vertex at a corner changed, its block was made anew, or its parent's summary changed.
 */
#include "update.h"

static int32_t smaller(int32_t a, int32_t b) {
    return a < b ? a : b;
}

static size_t side_of(const update *u) {
    return ((size_t)1 << u->k) + 1;
}

/* --------------------------------------------------------------------------------------------------- items -- */

bool update_exists(const update *u, int level, int32_t i, int32_t j) {
    const int shift = u->lattice.K - level;
    return i >= 0 && j >= 0 && ((int64_t)i << shift) < (u->lattice.width > 1 ? u->lattice.width - 1 : 1) &&
           ((int64_t)j << shift) < (u->lattice.height > 1 ? u->lattice.height - 1 : 1);
}

static size_t slot_of(const update *u, rqt_block_number number) {
    size_t at = (size_t)(number * UINT64_C(0x9E3779B97F4A7C15) >> 32) & (u->slots - 1);
    while (u->table[at] && u->table[at]->number != number) at = (at + 1) & (u->slots - 1);
    return at;
}

static bool grow_table(update *u) {
    update_item **old = u->table;
    const size_t slots = u->slots;
    /* A table of pointers. NOLINTBEGIN(bugprone-sizeof-expression) */
    update_item **fresh = memory_take(u->allocator, (slots ? 2 * slots : 256) * sizeof *fresh);
    if (!fresh) return update_fail(u, RQT_NO_MEMORY);
    u->table = fresh;
    u->slots = slots ? 2 * slots : 256;
    memset(fresh, 0, u->slots * sizeof *fresh);
    /* NOLINTEND(bugprone-sizeof-expression) */
    for (size_t i = 0; i < slots; i++)
        if (old[i]) u->table[slot_of(u, old[i]->number)] = old[i];
    memory_drop(u->allocator, old);
    return true;
}

static update_item *find_item(const update *u, int level, int32_t i, int32_t j) {
    return u->slots ? u->table[slot_of(u, rqt_block_number_of(level, i, j))] : NULL;
}

update_item *update_take(update *u, int level, int32_t i, int32_t j) {
    const rqt_block_number number = rqt_block_number_of(level, i, j);
    if (u->last && u->last->number == number) return u->last;
    if (2 * (u->count + 1) > u->slots && !grow_table(u)) return NULL;
    const size_t at = slot_of(u, number);
    if (!u->table[at]) {
        update_item *item = memory_take(u->allocator, sizeof *item);
        if (!item) {
            (void)update_fail(u, RQT_NO_MEMORY);
            return NULL;
        }
        memset(item, 0, sizeof *item);
        item->number = number;
        (void)rqt_block_locate(&u->lattice, u->k, number, &item->place);
        item->next = u->items[level];
        u->items[level] = item;
        u->table[at] = item;
        u->count++;
    }
    return u->last = u->table[at];
}

void update_blocks_free(update *u) {
    for (size_t i = 0; i < u->slots; i++) {
        update_item *item = u->table[i];
        if (!item) continue;
        rqt_block_free(&item->block, u->allocator);
        memory_drop(u->allocator, item->valid);
        memory_drop(u->allocator, item);
    }
    memory_drop(u->allocator, u->table);
}

static bool take_block(update *u, update_item *item) {
    if (rqt_block_create(u->k, u->allocator, &item->block) != RQT_OK) return update_fail(u, RQT_NO_MEMORY);
    item->block.width = item->place.width;
    item->block.height = item->place.height;
    item->block.sparse = item->place.stride > 1;
    return true;
}

static const rqt_block *read_block(update *u, const update_item *item) {
    const rqt_block *block = u->given->read_block(u->given->context, item->number);
    if (!block) {
        (void)update_fail(u, RQT_READ_FAILED);
        return NULL;
    }
    const bool fits = block->k == u->k && block->width == item->place.width && block->height == item->place.height;
    if (!fits) (void)update_fail(u, RQT_CORRUPT);
    return fits ? block : NULL;
}

/* The new samples of a block, at all of its places that are one of them. */
static void put_samples(const update *u, update_item *item) {
    const int32_t n = (int32_t)side_of(u);
    for (int32_t v = 0; v < n; v++) {
        const int32_t y = smaller(item->place.y + v, u->lattice.height - 1);
        if (y < u->area.y0 || y > u->area.y1) continue;
        for (int32_t c = 0; c < n; c++) {
            const int32_t x = smaller(item->place.x + c, u->lattice.width - 1);
            const size_t at = (size_t)v * (size_t)n + (size_t)c;
            if (x < u->area.x0 || x > u->area.x1) continue;
            item->block.flags[at] =
                (uint8_t)((item->block.flags[at] & ~RQT_VALID) | update_sample(u, x, y, &item->block.q[at]));
        }
    }
    for (size_t at = 0; item->valid && at < side_of(u) * side_of(u); at++)
        item->valid[at] = item->block.flags[at] & RQT_VALID;
}

update_item *update_load(update *u, int32_t i, int32_t j) {
    update_item *item = update_take(u, u->levels - 1, i, j);
    if (!item || item->block.q) return item;
    const size_t n = side_of(u);
    const rqt_block *old = read_block(u, item);
    if (!old || !take_block(u, item)) return NULL;
    memcpy(item->block.q, old->q, n * n * sizeof *old->q);
    memcpy(item->block.error, old->error, n * n * sizeof *old->error);
    memcpy(item->block.flags, old->flags, n * n);
    if (u->has_voids) {
        item->valid = memory_take(u->allocator, n * n);
        if (!item->valid) {
            (void)update_fail(u, RQT_NO_MEMORY);
            return NULL;
        }
    }
    put_samples(u, item);
    return item;
}

bool update_summary(update *u, int level, int32_t i, int32_t j, rqt_summary *summary) {
    return u->given->read_summary(u->given->context, rqt_block_number_of(level, i, j), summary) ||
           update_fail(u, RQT_READ_FAILED);
}

static bool know_before(update *u, update_item *item) {
    if (item->has_before) return true;
    item->has_before = true;
    return update_summary(u, item->place.level, item->place.i, item->place.j, &item->before);
}

/* ------------------------------------------------------------------------------------------- what is concerned --
 */

/* Mark the blocks of a level whose closed cells hold a vertex of scale `scale`. */
static bool mark_around(update *u, rqt_vertex v, int level, bool remake) {
    const int shift = u->lattice.K - level;
    const int32_t i1 = v.x >> shift, j1 = v.y >> shift;
    const int32_t i0 = i1 << shift == v.x ? i1 - 1 : i1, j0 = j1 << shift == v.y ? j1 - 1 : j1;
    for (int32_t j = j0; j <= j1; j++)
        for (int32_t i = i0; i <= i1; i++) {
            if (!update_exists(u, level, i, j)) continue;
            update_item *item = update_take(u, level, i, j);
            if (!item) return false;
            item->summarize = true;
            item->remake = item->remake || remake;
        }
    return true;
}

/* The blocks of stride 1 take the vertex's new error. */
static bool put_error(update *u, rqt_vertex v, const updated_vertex *now) {
    const int32_t i1 = v.x >> u->k, j1 = v.y >> u->k, n = (int32_t)side_of(u);
    const int32_t i0 = i1 << u->k == v.x ? i1 - 1 : i1, j0 = j1 << u->k == v.y ? j1 - 1 : j1;
    for (int32_t j = j0; j <= j1; j++)
        for (int32_t i = i0; i <= i1; i++) {
            if (!update_exists(u, u->levels - 1, i, j)) continue;
            update_item *item = update_load(u, i, j);
            if (!item) return false;
            const size_t at = (size_t)(v.y - item->place.y) * (size_t)n + (size_t)(v.x - item->place.x);
            item->remake = item->summarize = true;
            item->block.error[at] = now->code;
            item->block.flags[at] =
                (uint8_t)((item->block.flags[at] & RQT_VALID) | (now->outline ? RQT_OUTLINE : 0));
        }
    return true;
}

static bool mark_vertex(update *u, rqt_vertex v, int scale, const updated_vertex *now) {
    if (scale < u->k) return put_error(u, v, now);
    for (int shift = u->k; shift <= scale; shift++) /* a corner */
        if (!mark_around(u, v, u->lattice.K - shift, false)) return false;
    return scale == u->lattice.K || mark_around(u, v, u->lattice.K - scale - 1, true);
}

static bool mark_vertices(update *u) {
    for (int scale = 0; scale <= u->lattice.K; scale++) {
        const update_level *l = &u->level[scale];
        for (int32_t j = 0; j < l->rows; j++)
            for (int32_t i = 0; i < l->columns; i++) {
                const updated_vertex *now = &l->vertex[(size_t)j * (size_t)l->columns + (size_t)i];
                const rqt_vertex v = {(l->i0 + i) << scale, (l->j0 + j) << scale};
                if (now->changed && !mark_vertex(u, v, scale, now)) return false;
            }
    }
    return true;
}

/* All blocks of stride 1 that hold a sample of the area, in their closed cells. */
static bool mark_samples(update *u) {
    const sample_window *a = &u->area;
    for (int32_t j = (a->y0 - 1) >> u->k; j <= a->y1 >> u->k; j++)
        for (int32_t i = (a->x0 - 1) >> u->k; i <= a->x1 >> u->k; i++) {
            if (!update_exists(u, u->levels - 1, i, j)) continue;
            update_item *item = update_load(u, i, j);
            if (!item) return false;
            item->remake = item->summarize = true;
        }
    return true;
}

/* ------------------------------------------------------------------------------------------ what is in summaries
 * -- */

static void amend_vertex(const update *u, rqt_vertex v, int32_t *q, rqt_code *error, uint8_t *flags) {
    const rqt_vertex s = rqt_vertex_clamp(&u->lattice, v);
    if (update_touches(u, s.x, s.y)) *flags = (uint8_t)((*flags & ~RQT_VALID) | update_sample(u, s.x, s.y, q));
    const updated_vertex *now = update_find(u, v);
    if (!now) return;
    *error = now->code;
    *flags = (uint8_t)((*flags & RQT_VALID) | (now->outline ? RQT_OUTLINE : 0));
}

/* Everything but the intervals. */
static rqt_summary amended(const update *u, const update_item *item) {
    rqt_summary s = item->before;
    const rqt_block_place *p = &item->place;
    for (int n = 0; n < 4; n++) {
        rqt_summary_vertex *c = &s.corner[n];
        amend_vertex(u, (rqt_vertex){p->x + (n & 1 ? p->side : 0), p->y + (n & 2 ? p->side : 0)}, &c->q, &c->error,
                     &c->flags);
    }
    if (u->k > 0) {
        int32_t q;
        amend_vertex(u, (rqt_vertex){p->x + p->side / 2, p->y + p->side / 2}, &q, &s.center_error, &s.center_flags);
    }
    if (p->level == 0) return s;
    /* The corners of its parent beside the one that is its own. */
    const int32_t px = p->i / 2 * 2 * p->side, py = p->j / 2 * 2 * p->side;
    for (int n = 0; n < 2; n++) {
        const bool east = (p->i & 1) != (n == 0), south = (p->j & 1) != (n == 1);
        rqt_summary_vertex *f = &s.far[n];
        amend_vertex(u, (rqt_vertex){px + (east ? 2 * p->side : 0), py + (south ? 2 * p->side : 0)}, &f->q,
                     &f->error, &f->flags);
    }
    return s;
}

/* ------------------------------------------------------------------------------------------------------- bytes --
 */

static bool is_corner(size_t at, size_t n) {
    return at == 0 || at == n - 1 || at == n * (n - 1) || at == n * n - 1;
}

static bool is_kept(const rqt_block *b, size_t at, size_t n) {
    return !b->sparse || b->error[at] > b->floor || (b->flags[at] & RQT_OUTLINE) || is_corner(at, n);
}

/* Do two blocks of one place have the same bytes? Errors and outline bits of corners are in none. */
static bool is_same(const rqt_block *a, const rqt_block *b) {
    const size_t n = ((size_t)1 << a->k) + 1;
    if (a->sparse != b->sparse || a->floor != b->floor) return false;
    for (size_t at = 0; at < n * n; at++) {
        const bool corner = is_corner(at, n), kept = is_kept(a, at, n);
        if (kept != is_kept(b, at, n)) return false;
        if (!kept) continue;
        if (!corner && (a->error[at] != b->error[at] || a->flags[at] != b->flags[at])) return false;
        if ((a->flags[at] ^ b->flags[at]) & RQT_VALID) return false;
        if ((a->flags[at] & RQT_VALID) && a->q[at] != b->q[at]) return false;
    }
    return true;
}

/* Errors of vertices without area are made of the others in the block. */
static void settle_past(const update *u, update_item *item) {
    const int32_t n = (int32_t)side_of(u);
    rqt_block *b = &item->block;
    if (b->width == n && b->height == n) return;
    for (int32_t v = 0; v < n; v++)
        for (int32_t c = 0; c < n; c++) {
            const size_t at = (size_t)v * (size_t)n + (size_t)c;
            const rqt_vertex here = {item->place.x + c * item->place.stride,
                                     item->place.y + v * item->place.stride};
            if (lattice_has_area(&u->lattice, here)) continue;
            b->error[at] = 0;
            b->flags[at] &= RQT_VALID;
        }
    block_settle_past(b);
}

static bool remake_finest(update *u, update_item *item) {
    settle_past(u, item);
    const rqt_block *old = read_block(u, item);
    if (!old) return false;
    item->differs = !is_same(&item->block, old);
    return true;
}

/* The larger of em and what errs at vertices that the parent's grid lacks. */
static void fold(const rqt_block *child, rqt_code em, bool outline, update_item *parent) {
    const size_t n = ((size_t)1 << child->k) + 1;
    uint8_t flags = 0;
    for (size_t v = 0; v < n; v++)
        for (size_t c = v & 1 ? 0 : 1; c < n; c += v & 1 ? 1 : 2) {
            if (child->error[v * n + c] > em) em = child->error[v * n + c];
            flags |= child->flags[v * n + c];
        }
    if (em > parent->em) parent->em = em;
    parent->outline = parent->outline || outline || flags & RQT_OUTLINE;
}

/* Every second vertex of a quarter; `known` are those that it keeps. */
static void gather(update *u, const rqt_block *child, size_t c0, size_t v0, rqt_block *b) {
    const size_t n = side_of(u);
    for (size_t v = 0; v < n; v += 2)
        for (size_t c = 0; c < n; c += 2) {
            const size_t from = v * n + c, to = (v0 + v / 2) * n + c0 + c / 2;
            if (!is_kept(child, from, n)) continue;
            b->q[to] = child->q[from];
            b->error[to] = child->error[from];
            b->flags[to] = child->flags[from];
            u->known[to] = 1;
        }
}

/* A sample of the raster as it is now. */
static bool find_sample(update *u, rqt_vertex s, int32_t *q, uint8_t *valid) {
    int32_t i = s.x >> u->k, j = s.y >> u->k;
    if (!update_exists(u, u->levels - 1, i, 0)) i--;
    if (!update_exists(u, u->levels - 1, 0, j)) j--;
    if (update_touches(u, s.x, s.y)) {
        *valid = update_sample(u, s.x, s.y, q);
        return true;
    }
    const rqt_block *block = u->given->read_block(u->given->context, rqt_block_number_of(u->levels - 1, i, j));
    if (!block) return update_fail(u, RQT_READ_FAILED);
    const size_t at = (size_t)(s.y - (j << u->k)) * side_of(u) + (size_t)(s.x - (i << u->k));
    *q = block->q[at];
    *valid = block->flags[at] & RQT_VALID;
    return true;
}

/* Vertices past the raster that are kept for others' sake, and are in no quarter: their sample is that of others in
 * their row or column, one of which is likely to be known. */
static bool know_sample(update *u, update_item *item, size_t c, size_t v) {
    const size_t n = side_of(u), width = (size_t)item->place.width, height = (size_t)item->place.height;
    rqt_block *b = &item->block;
    const size_t at = v * n + c;
    const bool past_x = c + 1 >= width, past_y = v + 1 >= height;
    for (size_t y = past_y ? height - 1 : v; y < (past_y ? n : v + 1); y++)
        for (size_t x = past_x ? width - 1 : c; x < (past_x ? n : c + 1); x++) {
            const size_t other = y * n + x;
            const rqt_vertex here = {item->place.x + (int32_t)x * item->place.stride,
                                     item->place.y + (int32_t)y * item->place.stride};
            const rqt_vertex mine = {item->place.x + (int32_t)c * item->place.stride,
                                     item->place.y + (int32_t)v * item->place.stride};
            const rqt_vertex s = rqt_vertex_clamp(&u->lattice, here), t = rqt_vertex_clamp(&u->lattice, mine);
            if (!u->known[other] || s.x != t.x || s.y != t.y) continue;
            b->q[at] = b->q[other];
            b->flags[at] = (uint8_t)((b->flags[at] & RQT_OUTLINE) | (b->flags[other] & RQT_VALID));
            return true;
        }
    uint8_t valid = 0;
    const rqt_vertex v_at = {item->place.x + (int32_t)c * item->place.stride,
                             item->place.y + (int32_t)v * item->place.stride};
    if (!find_sample(u, rqt_vertex_clamp(&u->lattice, v_at), &b->q[at], &valid)) return false;
    b->flags[at] = (uint8_t)((b->flags[at] & RQT_OUTLINE) | valid);
    return true;
}

static bool know_samples(update *u, update_item *item) {
    const size_t n = side_of(u);
    for (size_t v = 0; v < n; v++)
        for (size_t c = 0; c < n; c++)
            if (!u->known[v * n + c] && is_kept(&item->block, v * n + c, n) && !know_sample(u, item, c, v))
                return false;
    return true;
}

/* One quarter into the block: as it is now, or as it was. */
static bool add_quarter(update *u, update_item *item, int quarter) {
    const int level = item->place.level + 1;
    const int32_t i = 2 * item->place.i + (quarter & 1), j = 2 * item->place.j + (quarter >> 1);
    const size_t half = (size_t)1 << u->k >> 1, c0 = quarter & 1 ? half : 0, v0 = quarter >> 1 ? half : 0;
    if (!update_exists(u, level, i, j)) return true;
    const update_item *child = find_item(u, level, i, j);
    if (child && child->remake) {
        fold(&child->block, child->em, child->outline, item);
        gather(u, &child->block, c0, v0, &item->block);
        return true;
    }
    rqt_summary summary;
    const rqt_block *block = NULL;
    if (!update_summary(u, level, i, j, &summary)) return false;
    block = u->given->read_block(u->given->context, rqt_block_number_of(level, i, j));
    if (!block) return update_fail(u, RQT_READ_FAILED);
    fold(block, summary.tol.em, summary.exact.em == RQT_CODE_INFINITY, item);
    gather(u, block, c0, v0, &item->block);
    return true;
}

/* What the quarters' corners err is in summaries. */
static void put_corner_errors(const update *u, update_item *item) {
    const int32_t half = 1 << u->k >> 1, n = (int32_t)side_of(u);
    for (int32_t v = 0; v < n; v += half)
        for (int32_t c = 0; c < n; c += half) {
            const rqt_vertex here = {item->place.x + c * item->place.stride,
                                     item->place.y + v * item->place.stride};
            const updated_vertex *now = update_find(u, here);
            const size_t at = (size_t)v * (size_t)n + (size_t)c;
            if (!now) continue;
            item->block.error[at] = now->code;
            item->block.flags[at] =
                (uint8_t)((item->block.flags[at] & RQT_VALID) | (now->outline ? RQT_OUTLINE : 0));
        }
}

static bool remake_coarse(update *u, update_item *item) {
    const size_t n = side_of(u), at[4] = {0, n - 1, n * (n - 1), n * n - 1};
    if (!know_before(u, item) || !take_block(u, item)) return false;
    rqt_block *b = &item->block;
    memset(b->flags, RQT_VALID, n * n);
    memset(u->known, 0, n * n);
    for (int quarter = 0; quarter < 4; quarter++)
        if (!add_quarter(u, item, quarter)) return false;
    put_corner_errors(u, item);
    const rqt_summary summary = amended(u, item);
    for (int c = 0; c < 4; c++) {
        b->q[at[c]] = summary.corner[c].q;
        b->flags[at[c]] = summary.corner[c].flags & RQT_VALID;
        u->known[at[c]] = 1;
    }
    rqt_block_set_corners(b, &summary);
    b->floor = item->em;
    settle_past(u, item);
    rqt_block_set_corners(b, &summary);
    if (!know_samples(u, item)) return false;
    const rqt_block *old = read_block(u, item);
    if (!old) return false;
    item->differs = !is_same(b, old);
    return true;
}

/* Fine to coarse. */
static bool remake_all(update *u) {
    for (int level = u->levels - 1; level >= 0; level--)
        for (update_item *item = u->items[level]; item; item = item->next) {
            if (!item->remake) continue;
            if (!(item->place.stride == 1 ? know_before(u, item) && remake_finest(u, item)
                                          : remake_coarse(u, item)))
                return false;
            const bool outline = item->before.exact.em == RQT_CODE_INFINITY;
            if (level == 0 || (!item->differs && item->outline == outline)) continue;
            update_item *parent = update_take(u, level - 1, item->place.i / 2, item->place.j / 2);
            if (!parent) return false;
            parent->remake = parent->summarize = true;
        }
    return true;
}

/* The largest finite error, which the root knows. */
static void settle_max_error(update *u) {
    const update_item *root = u->items[0];
    const size_t n = side_of(u);
    if (!root || !root->remake) return;
    rqt_code most = root->em;
    for (size_t at = 0; at < n * n; at++)
        if (root->block.error[at] > most && root->block.error[at] != RQT_CODE_INFINITY)
            most = root->block.error[at];
    u->result->after.max_error = most;
}

/* --------------------------------------------------------------------------------------------------- summaries --
 */

static rqt_code exact_em(const update_item *item) {
    return item->outline ? RQT_CODE_INFINITY : item->em;
}

static rqt_summary summary_now(const update *u, const update_item *item) {
    rqt_summary s = amended(u, item);
    const update_item *parent =
        item->place.level > 0 ? find_item(u, item->place.level - 1, item->place.i / 2, item->place.j / 2) : NULL;
    if (item->remake) {
        s.tol.em = item->em;
        s.exact.em = exact_em(item);
    }
    if (parent && parent->remake) {
        s.tol.em_parent = parent->em;
        s.exact.em_parent = exact_em(parent);
    }
    return s;
}

static bool write_item(update *u, update_item *item) {
    uint8_t before[RQT_SUMMARY_BYTES], after[RQT_SUMMARY_BYTES];
    if (!know_before(u, item)) return false;
    const rqt_summary summary = summary_now(u, item);
    rqt_summary_encode(&item->before, before);
    rqt_summary_encode(&summary, after);
    const bool differs = memcmp(before, after, sizeof before) != 0;
    for (int child = 0; child < 4 && differs && item->place.level + 1 < u->levels; child++) {
        const int32_t i = 2 * item->place.i + (child & 1), j = 2 * item->place.j + (child >> 1);
        if (!update_exists(u, item->place.level + 1, i, j)) continue;
        update_item *below = update_take(u, item->place.level + 1, i, j);
        if (!below) return false;
        below->summarize = true;
    }
    if (!differs && !item->differs) return true;
    return u->given->write(u->given->context, item->number, &item->before, &summary,
                           item->differs ? &item->block : NULL) ||
           update_fail(u, RQT_READ_FAILED);
}

/* In ascending order, as a table wants it. */
static update_item *sorted(update_item *list) {
    if (!list || !list->next) return list;
    update_item *half[2] = {NULL, NULL};
    for (int side = 0; list; side ^= 1) {
        update_item *next = list->next;
        list->next = half[side];
        half[side] = list;
        list = next;
    }
    update_item *a = sorted(half[0]), *b = sorted(half[1]), *first = NULL, **end = &first;
    while (a || b) {
        update_item **from = !b || (a && a->number < b->number) ? &a : &b;
        *end = *from;
        *from = (*from)->next;
        end = &(*end)->next;
    }
    *end = NULL;
    return first;
}

static bool write_all(update *u) {
    for (int level = 0; level < u->levels; level++) {
        u->items[level] = sorted(u->items[level]);
        for (update_item *item = u->items[level]; item; item = item->next)
            if (item->summarize && !write_item(u, item)) return false;
    }
    return true;
}

bool update_blocks(update *u) {
    if (!mark_samples(u) || !mark_vertices(u) || !remake_all(u)) return false;
    settle_max_error(u);
    return write_all(u);
}
