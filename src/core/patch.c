/* patch.c - the patch grows: vertices, each once, triangles or the strip; and the memory that queries hand on.
 *
 * A vertex inside a block occurs in no other block: the memo of the block, by place, is enough. On the border of
 * the block the hash table is asked, once per block and vertex: when the block begins for what is there already,
 * when it ends for what it has added. Where the raster ends two lattice vertices may be one sample; there each
 * corner goes through the table. Samples of one patch are told apart by (col,row) alone.
 */
#include "walk.h"

/* ----------------------------------------------------------------------------------------------- scratch */

rqt_status rqt_scratch_create(const rqt_allocator *allocator, rqt_scratch **scratch) {
    *scratch = memory_take(allocator, sizeof **scratch);
    if (!*scratch) return RQT_NO_MEMORY;
    **scratch = (rqt_scratch){.allocator = *allocator, .k = -1};
    return RQT_OK;
}

static void drop_arrays(rqt_patch *patch, const rqt_allocator *a) {
    memory_drop(a, patch->vertices);
    memory_drop(a, patch->triangles);
    memory_drop(a, patch->leaves);
    memory_drop(a, patch->strip);
    memset(patch, 0, sizeof *patch);
}

static void drop_block_arrays(rqt_scratch *s) {
    memory_drop(&s->allocator, s->chosen);
    memory_drop(&s->allocator, s->memo);
    memory_drop(&s->allocator, s->order);
    memory_drop(&s->allocator, s->border);
    s->chosen = NULL;
    s->memo = s->order = NULL;
    s->border = NULL;
    s->k = -1;
}

static void drop_table(rqt_scratch *s) {
    memory_drop(&s->allocator, s->table);
    s->table = NULL;
    s->table_size = 0;
}

static void drop_all(rqt_scratch *s) {
    drop_block_arrays(s);
    drop_table(s);
    drop_arrays(&s->spare, &s->allocator);
}

void rqt_scratch_free(rqt_scratch *scratch) {
    if (!scratch) return;
    const rqt_allocator a = scratch->allocator;
    drop_all(scratch);
    memory_drop(&a, scratch);
}

static size_t patch_bytes(const rqt_patch *p) {
    return p->vertex_capacity * sizeof *p->vertices + p->triangle_capacity * 3 * sizeof *p->triangles +
           p->leaf_capacity * sizeof *p->leaves + p->strip_capacity * sizeof *p->strip;
}

#define KEEP(array, capacity, from)                           \
    if ((from)->capacity > scratch->spare.capacity) {         \
        void *const swap = scratch->spare.array;              \
        const size_t swap_capacity = scratch->spare.capacity; \
        scratch->spare.array = (from)->array;                 \
        scratch->spare.capacity = (from)->capacity;           \
        (from)->array = swap;                                 \
        (from)->capacity = swap_capacity;                     \
    }

void rqt_scratch_keep(rqt_scratch *scratch, rqt_patch *patch, size_t limit) {
    if (patch->allocator.resize == scratch->allocator.resize &&
        patch->allocator.context == scratch->allocator.context) {
        KEEP(vertices, vertex_capacity, patch)
        KEEP(triangles, triangle_capacity, patch)
        KEEP(leaves, leaf_capacity, patch)
        KEEP(strip, strip_capacity, patch)
    }
    rqt_patch_free(patch);
    if (scratch->table_size * sizeof *scratch->table > limit) drop_table(scratch);
    if (patch_bytes(&scratch->spare) + scratch->table_size * sizeof *scratch->table > limit)
        drop_arrays(&scratch->spare, &scratch->allocator);
}

void rqt_patch_free(rqt_patch *patch) {
    if (!patch->allocator.resize) return;
    const rqt_allocator a = patch->allocator;
    drop_arrays(patch, &a);
}

static bool take_block_arrays(rqt_scratch *s, int k) {
    if (s->k == k) return true;
    drop_block_arrays(s);
    const size_t n = ((size_t)1 << k) + 1, count = n * n;
    s->chosen = memory_take(&s->allocator, count);
    s->memo = memory_take(&s->allocator, count * sizeof *s->memo);
    s->order = memory_take(&s->allocator, (count + 6) * sizeof *s->order);
    s->border = memory_take(&s->allocator, 4 * n * sizeof *s->border);
    if (!s->chosen || !s->memo || !s->order || !s->border) {
        drop_block_arrays(s);
        return false;
    }
    s->k = k;
    return true;
}

bool patch_begin(walk *w) {
    rqt_scratch *s = w->scratch;
    if (!take_block_arrays(s, w->query->k)) return false;
    w->chosen = s->chosen;
    w->memo = s->memo;
    w->order = s->order;
    /* Once per query: so that whatever a damaged block says, an index is one of this patch. */
    memset(w->memo, 0, (size_t)w->n * (size_t)w->n * sizeof *w->memo);
    if (++s->stamp == 0) { /* once around: old entries would look new */
        if (s->table) memset(s->table, 0, s->table_size * sizeof *s->table);
        s->stamp = 1;
    }
    rqt_patch *patch = w->patch;
    const rqt_allocator allocator = patch->allocator;
    *patch = s->spare;
    patch->allocator = allocator;
    memset(&s->spare, 0, sizeof s->spare);
    return true;
}

/* What the query did not ask for goes back to the scratch. */
void patch_end(walk *w, rqt_status status) {
    rqt_patch *patch = w->patch;
    rqt_scratch *s = w->scratch;
    if (status != RQT_OK) {
        rqt_patch_free(patch);
        return;
    }
    patch->strip_count = w->strip.count;
    if (w->query->product != RQT_PRODUCT_TRIANGLES) {
        s->spare.triangles = patch->triangles;
        s->spare.triangle_capacity = patch->triangle_capacity;
        patch->triangles = NULL;
        patch->triangle_capacity = 0;
    }
    if (w->query->product != RQT_PRODUCT_STRIP) {
        s->spare.strip = patch->strip;
        s->spare.strip_capacity = patch->strip_capacity;
        patch->strip = NULL;
        patch->strip_capacity = 0;
    }
    if (!w->query->wants_leaves) {
        s->spare.leaves = patch->leaves;
        s->spare.leaf_capacity = patch->leaf_capacity;
        patch->leaves = NULL;
        patch->leaf_capacity = 0;
    }
}

/* ------------------------------------------------------------------------------------------- shared vertices */

/* The topmost bits of the product: those below do not depend on the row. size is a power of two. */
static size_t table_slot(int32_t col, int32_t row, size_t size) {
    const uint64_t h = ((uint64_t)(uint32_t)row << 32 | (uint32_t)col) * UINT64_C(0x9E3779B97F4A7C15);
    return (size_t)(h >> (__builtin_clzll(size) + 1));
}

/* The entry of a sample, or the free one where it belongs; looks from `slot` on. */
static shared_vertex *table_find(const walk *w, size_t slot, int32_t col, int32_t row) {
    const rqt_scratch *s = w->scratch;
    for (;; slot = (slot + 1) & (s->table_size - 1)) {
        shared_vertex *v = &s->table[slot];
        if (v->stamp != s->stamp || (v->col == col && v->row == row)) return v;
    }
}

static void table_enter(walk *w, shared_vertex *at, int32_t col, int32_t row, uint32_t index) {
    *at = (shared_vertex){col, row, index, w->scratch->stamp};
    w->table_count++;
}

static bool table_grow(walk *w) {
    rqt_scratch *s = w->scratch;
    const size_t old_size = s->table_size, size = old_size ? old_size * 2 : 1024;
    shared_vertex *old = s->table, *table = memory_take(w->allocator, size * sizeof *table);
    if (!table) return false;
    memset(table, 0, size * sizeof *table);
    s->table = table;
    s->table_size = size;
    for (size_t i = 0; i < old_size; i++)
        if (old[i].stamp == s->stamp)
            *table_find(w, table_slot(old[i].col, old[i].row, size), old[i].col, old[i].row) = old[i];
    memory_drop(w->allocator, old);
    return true;
}

bool patch_reserve(walk *w) {
    rqt_patch *patch = w->patch;
    const size_t vertices = (size_t)w->n * (size_t)w->n + 6, triangles = 2 * (size_t)w->n * (size_t)w->n + 2,
                 shared = 4 * (size_t)w->n + 6;
    if (patch->vertex_count + vertices >= INDEX ||
        !memory_grow(w->allocator, (void **)&patch->vertices, &patch->vertex_capacity,
                     patch->vertex_count + vertices, sizeof *patch->vertices))
        return false;
    if (w->query->product == RQT_PRODUCT_TRIANGLES &&
        !memory_grow(w->allocator, (void **)&patch->triangles, &patch->triangle_capacity,
                     patch->triangle_count + triangles, 3 * sizeof *patch->triangles))
        return false;
    if (w->query->product == RQT_PRODUCT_STRIP) {
        if (!memory_grow(w->allocator, (void **)&patch->strip, &patch->strip_capacity,
                         w->strip.count + STRIP_MOST_PER_TRIANGLE * (triangles + 1), sizeof *patch->strip))
            return false;
        w->strip.s = patch->strip;
    }
    if (w->query->wants_leaves && !memory_grow(w->allocator, (void **)&patch->leaves, &patch->leaf_capacity,
                                               patch->triangle_count + triangles, sizeof *patch->leaves))
        return false;
    /* A block at the raster's edge may share more, up to all of its vertices, with its own aliases. */
    const size_t entries = w->table_count + (w->aliased ? vertices : shared);
    while (2 * (entries + 1) > w->scratch->table_size)
        if (!table_grow(w)) return false;
    return true;
}

/* --------------------------------------------------------------------------------------- vertices of a block */

/* Look up what is selected on the border: the vertices that the patch holds go into the memo. Blocks come in Morton
 * order, so the neighbours to the east and to the south have not been walked yet, and but for the corners what lies
 * there is new. */
static void look_up_border(walk *w) {
    rqt_scratch *s = w->scratch;
    const uint8_t *const chosen = w->chosen;
    const uint32_t n = (uint32_t)w->n, last = n - 1, corners[4] = {0, last, last * n, last * n + last};
    border_vertex *border = s->border;
    size_t old = 4, count;
    for (size_t c = 0; c < 4; c++) border[c].place = corners[c];
    for (uint32_t i = 1; i < last; i++) {
        border[old].place = i;
        old += chosen[i];
        border[old].place = i * n;
        old += chosen[i * n];
    }
    count = old;
    for (uint32_t i = 1; i < last; i++) {
        border[count].place = last * n + i;
        count += chosen[last * n + i];
        border[count].place = i * n + last;
        count += chosen[i * n + last];
    }
    for (size_t b = 0; b < count; b++) { /* the table is large and lies all over memory */
        const rqt_vertex at = place_vertex(w, border[b].place);
        border[b].slot = table_slot(at.x, at.y, s->table_size);
        __builtin_prefetch(&s->table[border[b].slot]);
    }
    for (size_t b = 0; b < old; b++) {
        const uint32_t place = border[b].place;
        const rqt_vertex at = place_vertex(w, place);
        const shared_vertex *v = table_find(w, border[b].slot, at.x, at.y);
        w->memo[place] = v->stamp == s->stamp ? v->index | KNOWN : 0;
    }
    w->border_count = count;
}

static void forget_memo(walk *w) {
    memset(w->memo, 0, (size_t)w->n * (size_t)w->n * sizeof *w->memo);
}

void patch_enter_block(walk *w) {
    w->first = w->patch->vertex_count;
    w->live = (uint32_t)w->first | FRESH;
    if (w->aliased)
        forget_memo(w);
    else
        look_up_border(w);
}

/* The records of the vertices that the walk has put in order. */
static void fill_records(walk *w) {
    const rqt_block *b = w->block;
    const int K = w->query->lattice.K;
    const size_t count = w->patch->vertex_count - w->first;
    rqt_patch_vertex *out = w->patch->vertices + w->first;
    const uint32_t *order = w->order;
    for (size_t i = 0; i < count; i++, out++) {
        const uint32_t place = order[i];
        if (place == NO_PLACE) continue;
        const rqt_vertex at = place_vertex(w, place);
        *out =
            (rqt_patch_vertex){.col = at.x,
                               .row = at.y,
                               .q = b->q[place],
                               .error = b->error[place],
                               .level = (uint8_t)(K - __builtin_ctz((uint32_t)(at.x | at.y) | UINT32_C(1) << K))};
    }
}

void patch_leave_block(walk *w) {
    if (w->aliased) {
        forget_memo(w);
        return;
    }
    fill_records(w);
    const border_vertex *border = w->scratch->border;
    for (size_t b = 0; b < w->border_count; b++) {
        const uint32_t memo = w->memo[border[b].place];
        if (memo < w->live || memo >= KNOWN) continue;
        const rqt_patch_vertex *v = &w->patch->vertices[memo & INDEX];
        table_enter(w, table_find(w, border[b].slot, v->col, v->row), v->col, v->row, memo & INDEX);
    }
}

uint32_t patch_vertex(walk *w, const corner *c) {
    const bool has_place = c->place != NO_PLACE;
    if (has_place && !w->aliased) return patch_place(w, c->place);
    if (has_place && w->memo[c->place] >= w->live) return w->memo[c->place] & INDEX;
    const rqt_vertex sample = rqt_vertex_clamp(&w->query->lattice, c->at);
    const uint8_t level = (uint8_t)rqt_vertex_level(&w->query->lattice, c->at);
    rqt_patch *patch = w->patch;
    shared_vertex *at = table_find(w, table_slot(sample.x, sample.y, w->scratch->table_size), sample.x, sample.y);
    uint32_t index = at->index;
    if (at->stamp == w->scratch->stamp) { /* the same sample, perhaps as another lattice vertex */
        rqt_patch_vertex *v = &patch->vertices[index];
        if (c->error > v->error) v->error = c->error;
        if (level < v->level) v->level = level;
    } else {
        index = (uint32_t)patch->vertex_count++;
        patch->vertices[index] =
            (rqt_patch_vertex){.col = sample.x, .row = sample.y, .q = c->q, .error = c->error, .level = level};
        if (w->block && !w->aliased) w->order[index - w->first] = NO_PLACE;
        table_enter(w, at, sample.x, sample.y, index);
    }
    if (has_place) w->memo[c->place] = index | KNOWN;
    return index;
}

void patch_triangle(walk *w, uint32_t a, uint32_t l, uint32_t r, bool clockwise) {
    const uint32_t triangle[3] = {a, clockwise ? l : r, clockwise ? r : l};
    rqt_patch *patch = w->patch;
    if (w->query->product == RQT_PRODUCT_TRIANGLES)
        memcpy(patch->triangles + 3 * patch->triangle_count, triangle, sizeof triangle);
    else if (w->query->product == RQT_PRODUCT_STRIP)
        strip_put(&w->strip, triangle);
    patch->triangle_count++;
}
