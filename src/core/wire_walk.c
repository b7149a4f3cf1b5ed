/* wire_walk.c - the tables and the block at hand of the walk that wire_walk.h describes. */
#include "wire_walk.h"

/* --------------------------------------------------------------------------------------------- tables */

static void put(wire_table *table, const wire_entry *e) {
    size_t at = wire_key_place(e->key, table->size);
    while (table->entry[at].key) at = (at + 1) & (table->size - 1);
    table->entry[at] = *e;
}

/* Room for `more` further entries: never more than half full, so that a search ends. */
bool wire_table_reserve(const rqt_allocator *allocator, wire_table *table, size_t more) {
    size_t size = table->size ? table->size : 256;
    while (size / 2 < table->count + more) size *= 2;
    if (size == table->size) return true;
    wire_table wider = {memory_take(allocator, size * sizeof *wider.entry), size, table->count};
    if (!wider.entry) return false;
    memset(wider.entry, 0, size * sizeof *wider.entry);
    for (size_t i = 0; i < table->size; i++)
        if (table->entry[i].key) put(&wider, &table->entry[i]);
    memory_drop(allocator, table->entry);
    *table = wider;
    return true;
}

/* There is room, and v is not there. */
void wire_table_insert(wire_table *table, rqt_vertex v, int32_t q, uint32_t index) {
    const wire_entry e = {wire_key(v), q, index};
    put(table, &e);
    table->count++;
}

/* The lattice vertices of a patch with their heights, WIRE_CHOSEN; and their samples, where these are none. */
bool wire_prior_create(const rqt_allocator *allocator, const rqt_lattice *lattice, const rqt_patch *state,
                       wire_table *prior) {
    /* A vertex occurs in about six corners: let it grow. */
    for (size_t t = 0; t < state->triangle_count; t++) {
        const rqt_triangle *leaf = &state->leaves[t];
        const uint32_t *index = state->triangles + 3 * t;
        if (!wire_table_reserve(allocator, prior, 6)) return false;
        const rqt_vertex at[3] = {leaf->apex, leaf->left, leaf->right};
        for (int c = 0; c < 3; c++) {
            const rqt_vertex sample = rqt_vertex_clamp(lattice, at[c]);
            wire_entry *e = wire_table_find(prior, at[c]);
            if (e && e->index == WIRE_CHOSEN) continue;
            for (int i = 0; i < 3; i++) {
                const rqt_patch_vertex *v = &state->vertices[index[i]];
                if (v->col != sample.x || v->row != sample.y) continue;
                if (e)
                    e->index = WIRE_CHOSEN;
                else
                    wire_table_insert(prior, at[c], v->q, WIRE_CHOSEN);
                if (!wire_table_find(prior, sample)) wire_table_insert(prior, sample, v->q, WIRE_NONE);
                break;
            }
        }
    }
    return true;
}

/* ------------------------------------------------------------------------------------------- the walk */

rqt_status wire_walk_create(wire_walk *w, const rqt_lattice *lattice, int k, const rqt_allocator *allocator) {
    memset(w, 0, sizeof *w);
    w->lattice = *lattice;
    w->k = k;
    w->n = (1 << k) + 1;
    w->allocator = *allocator;
    const size_t places = (size_t)w->n * (size_t)w->n + 2;
    w->memo = memory_take(allocator, places * sizeof *w->memo);
    w->q = memory_take(allocator, places * sizeof *w->q);
    w->order = memory_take(allocator, (places + 6) * sizeof *w->order);
    w->list = memory_take(allocator, (places + 6) * sizeof *w->list);
    const size_t rows = (size_t)w->n / 2 + 2;
    w->slot = memory_take(allocator, 2 * (size_t)w->n * sizeof *w->slot);
    w->grid = memory_take(allocator, rows * sizeof *w->grid);
    w->centres = memory_take(allocator, rows * sizeof *w->centres);
    w->across = memory_take(allocator, rows * sizeof *w->across);
    w->down = memory_take(allocator, rows * sizeof *w->down);
    w->kind = memory_take(allocator, places);
    w->column = memory_take(allocator, places * sizeof *w->column);
    w->row = memory_take(allocator, places * sizeof *w->row);
    w->where = memory_take(allocator, places * sizeof *w->where);
    if (!w->memo || !w->q || !w->order || !w->list || !w->slot || !w->grid || !w->centres || !w->across ||
        !w->down || !w->kind || !w->column || !w->row || !w->where)
        return RQT_NO_MEMORY;
    memset(w->q, 0, places * sizeof *w->q);
    for (size_t p = 0; p < places; p++) {
        w->column[p] = (uint16_t)(p % (size_t)w->n);
        w->row[p] = (uint16_t)(p / (size_t)w->n);
        const uint32_t last = 1U << k, u = w->column[p], v = w->row[p];
        const bool is_side = u == 0 || v == 0 || u == last || v == last;
        w->where[p] = u | v << 9 | (uint32_t)__builtin_ctz(u | v | last) << 18 | (uint32_t)is_side << 22;
    }
    return RQT_OK;
}

void wire_walk_free(wire_walk *w) {
    const rqt_allocator *a = &w->allocator;
    memory_drop(a, w->memo);
    memory_drop(a, w->q);
    memory_drop(a, w->order);
    memory_drop(a, w->list);
    memory_drop(a, w->slot);
    memory_drop(a, w->grid);
    memory_drop(a, w->centres);
    memory_drop(a, w->across);
    memory_drop(a, w->down);
    memory_drop(a, w->kind);
    memory_drop(a, w->column);
    memory_drop(a, w->row);
    memory_drop(a, w->where);
    memory_drop(a, w->table.entry);
    memory_drop(a, w->prior.entry);
    memory_drop(a, w->vertices);
    memory_drop(a, w->triangles);
    memory_drop(a, w->leaves);
}

/* The first of n grid lines that is at or past the last sample. */
static int32_t first_on_rim(int32_t from, int shift, int32_t last, int32_t n) {
    const int64_t u = ((int64_t)last - from + (1 << shift) - 1) >> shift;
    return u < 0 ? 0 : u < n ? (int32_t)u : n;
}

static void mark_kinds(wire_walk *w) {
    const int32_t n = w->n;
    uint8_t *kind = w->kind;
    for (int32_t v = 0; v < n; v++)
        for (int32_t u = 0; u < n; u++, kind++) {
            *kind = (u == 0 || v == 0 || u == n - 1 || v == n - 1) ? WIRE_EDGE : 0;
            if (u == 0 || v == 0) *kind |= WIRE_NORTH_WEST;
            if (u >= w->u_rim || v >= w->v_rim) *kind |= WIRE_RIM;
        }
}

bool wire_block_begin(wire_walk *w, const rqt_block_place *place) {
    const size_t places = (size_t)w->n * (size_t)w->n;
    w->place = *place;
    w->shift = __builtin_ctz((unsigned)place->stride);
    w->u_rim = first_on_rim(place->x, w->shift, w->lattice.width - 1, w->n);
    w->v_rim = first_on_rim(place->y, w->shift, w->lattice.height - 1, w->n);
    w->clamped = w->u_rim < w->n || w->v_rim < w->n;
    if (w->clamped || !w->kind_is_plain) {
        mark_kinds(w);
        w->kind_is_plain = !w->clamped;
    }
    memset(w->memo, 0xFF, places * sizeof *w->memo);
    if (w->clamped) memset(w->slot, 0, 2 * (size_t)w->n * sizeof *w->slot);
    w->first = w->vertex_count;
    return wire_table_reserve(&w->allocator, &w->table, 6 * (size_t)w->n + 8);
}

/* ------------------------------------------------------------------------------------- vertices and leaves */

/* A vertex whose sample may have an index as another lattice vertex. */
static uint32_t index_by_sample(wire_walk *w, uint32_t p) {
    const uint32_t places = (uint32_t)(w->n * w->n);
    const rqt_vertex at = wire_at(w, p), sample = wire_sample(w, at);
    const uint8_t level = (uint8_t)rqt_vertex_level(&w->lattice, at);
    bool shared = true;
    uint32_t none = WIRE_CHOSEN, *index = &none;
    if (p < places) {
        const int32_t u = w->column[p], v = w->row[p], cu = u < w->u_rim ? u : w->u_rim,
                      cv = v < w->v_rim ? v : w->v_rim;
        index = &w->slot[u >= w->u_rim ? cv : w->n + u].index;
        shared = w->kind[cv * w->n + cu] & WIRE_EDGE;
    }
    if (*index == WIRE_CHOSEN && shared) {
        const wire_entry *e = wire_table_find(&w->table, sample);
        if (e) *index = e->index;
    }
    if (*index != WIRE_CHOSEN) {
        rqt_patch_vertex *v = &w->vertices[*index];
        if (level < v->level) v->level = level;
        return *index;
    }
    *index = (uint32_t)w->vertex_count;
    w->order[w->vertex_count - w->first] = WIRE_NONE;
    w->vertices[w->vertex_count++] =
        (rqt_patch_vertex){.col = sample.x, .row = sample.y, .q = w->q[p], .level = level};
    if (shared) wire_table_insert(&w->table, sample, w->q[p], *index);
    return *index;
}

static uint32_t index_of(wire_walk *w, uint32_t p) {
    if (p >= (uint32_t)(w->n * w->n) || (w->kind[p] & WIRE_RIM)) return index_by_sample(w, p);
    if (w->memo[p] == WIRE_CHOSEN) {
        w->order[w->vertex_count - w->first] = p;
        w->memo[p] = (uint32_t)w->vertex_count++;
    }
    return w->memo[p];
}

void wire_leaf(wire_walk *w, uint32_t a, uint32_t l, uint32_t r, uint32_t clockwise) {
    uint32_t *out = w->triangles + 3 * w->triangle_count;
    if (w->leaves) w->leaves[w->triangle_count] = (rqt_triangle){wire_at(w, a), wire_at(w, l), wire_at(w, r)};
    w->triangle_count++;
    out[0] = index_of(w, a);
    out[2 - clockwise] = index_of(w, l);
    out[1 + clockwise] = index_of(w, r);
}

/* A second child that waits for its turn, in one number: places are below 2^17. Its left end is where the first one
 * is left. */
enum { PLACE_BITS = 17, PLACE_MASK = (1 << PLACE_BITS) - 1 };

/* New vertices are a matter of chance: no branch. What is written for an old one is overwritten by the next. */
static inline uint32_t give_index(uint32_t *restrict memo, uint32_t *restrict order, uint32_t *next, uint32_t first,
                                  uint32_t p) {
    const uint32_t i = memo[p];
    const bool fresh = i == WIRE_CHOSEN;
    const uint32_t index = fresh ? *next : i;
    memo[p] = index;
    order[*next - first] = p;
    *next += fresh;
    return index;
}

void wire_list(wire_walk *w, uint32_t a, uint32_t l, uint32_t r, int depth, uint32_t clockwise) {
    uint64_t stack[2 * RQT_MAX_BLOCK_K + 1], *top = stack;
    uint32_t *restrict const memo = w->memo, *restrict const order = w->order;
    uint32_t *restrict out = w->triangles + 3 * w->triangle_count;
    uint32_t next = (uint32_t)w->vertex_count, splits = (uint32_t)depth, il = WIRE_NONE;
    const uint32_t first = (uint32_t)w->first, turn = clockwise ^ (splits & 1);
    for (;;) {
        for (;;) {
            const uint32_t m = (l + r) / 2;
            if (splits == 0 || memo[m] == WIRE_NONE) break;
            splits--;
            *top++ =
                m | (uint64_t)a << PLACE_BITS | (uint64_t)r << 2 * PLACE_BITS | (uint64_t)splits << 3 * PLACE_BITS;
            r = a;
            a = m;
        }
        const uint32_t ia = give_index(memo, order, &next, first, a);
        if (il == WIRE_NONE) il = give_index(memo, order, &next, first, l);
        const uint32_t ir = give_index(memo, order, &next, first, r);
        const uint32_t swap = (il ^ ir) & (0 - (turn ^ (splits & 1)));
        out[0] = ia;
        out[1] = ir ^ swap;
        out[2] = il ^ swap;
        out += 3;
        if (top == stack) break;
        il = ir; /* a leaf is entered where the one before is left */
        const uint64_t later = *--top;
        a = later & PLACE_MASK;
        l = later >> PLACE_BITS & PLACE_MASK;
        r = later >> 2 * PLACE_BITS & PLACE_MASK;
        splits = (uint32_t)(later >> 3 * PLACE_BITS);
    }
    w->vertex_count = next;
    w->triangle_count = (size_t)(out - w->triangles) / 3;
}

/* The records of the vertices that the block has added; those on its sides are for other blocks to find. */
void wire_block_end(wire_walk *w) {
    const uint8_t finest = (uint8_t)(w->lattice.K - w->shift);
    const size_t count = w->vertex_count - w->first;
    rqt_patch_vertex *out = w->vertices + w->first;
    for (size_t i = 0; i < count; i++, out++) {
        const uint32_t p = w->order[i];
        if (p == WIRE_NONE) continue;
        const uint32_t where = w->where[p];
        *out = (rqt_patch_vertex){.col = w->place.x + (int32_t)((where & 0x1FF) << w->shift),
                                  .row = w->place.y + (int32_t)((where >> 9 & 0x1FF) << w->shift),
                                  .q = w->q[p],
                                  .level = (uint8_t)(finest - (where >> 18 & 15))};
        if (!(where >> 22)) continue;
        const rqt_vertex at = {out->col, out->row};
        out->level = (uint8_t)rqt_vertex_level(&w->lattice, at); /* its step may be larger than the block's */
        wire_table_insert(&w->table, at, out->q, (uint32_t)(w->first + i));
    }
}
