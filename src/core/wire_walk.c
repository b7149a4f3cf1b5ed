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
void wire_table_insert(wire_table *table, rqt_vertex v, int32_t q) {
    const wire_entry e = {wire_key(v), q, WIRE_NONE};
    put(table, &e);
    table->count++;
}

/* The lattice vertices of a patch with their heights. */
bool wire_prior_create(const rqt_allocator *allocator, const rqt_lattice *lattice, const rqt_patch *state,
                       wire_table *prior) {
    /* A vertex occurs in about six corners: let it grow. */
    for (size_t t = 0; t < state->triangle_count; t++) {
        const rqt_triangle *leaf = &state->leaves[t];
        const uint32_t *index = state->triangles + 3 * t;
        if (!wire_table_reserve(allocator, prior, 3)) return false;
        const rqt_vertex at[3] = {leaf->apex, leaf->left, leaf->right};
        for (int c = 0; c < 3; c++) {
            const rqt_vertex sample = rqt_vertex_clamp(lattice, at[c]);
            if (wire_table_find(prior, at[c])) continue;
            for (int i = 0; i < 3; i++) {
                const rqt_patch_vertex *v = &state->vertices[index[i]];
                if (v->col != sample.x || v->row != sample.y) continue;
                wire_table_insert(prior, at[c], v->q);
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
    w->state = memory_take(allocator, places * sizeof *w->state);
    w->kind = memory_take(allocator, places);
    w->column = memory_take(allocator, places * sizeof *w->column);
    w->row = memory_take(allocator, places * sizeof *w->row);
    w->scale = memory_take(allocator, places);
    if (!w->memo || !w->q || !w->state || !w->kind || !w->column || !w->row || !w->scale) return RQT_NO_MEMORY;
    memset(w->q, 0, places * sizeof *w->q);
    for (size_t p = 0; p < places; p++) {
        w->column[p] = (uint16_t)(p % (size_t)w->n);
        w->row[p] = (uint16_t)(p / (size_t)w->n);
        w->scale[p] = (uint8_t)__builtin_ctz((unsigned)(w->column[p] | w->row[p]) | 1U << k);
    }
    return RQT_OK;
}

void wire_walk_free(wire_walk *w) {
    const rqt_allocator *a = &w->allocator;
    memory_drop(a, w->memo);
    memory_drop(a, w->q);
    memory_drop(a, w->state);
    memory_drop(a, w->kind);
    memory_drop(a, w->column);
    memory_drop(a, w->row);
    memory_drop(a, w->scale);
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
    w->streams = WIRE_BY_CLASS + WIRE_PER_CLASS * (2 * w->shift - 1);
    w->u_rim = first_on_rim(place->x, w->shift, w->lattice.width - 1, w->n);
    w->v_rim = first_on_rim(place->y, w->shift, w->lattice.height - 1, w->n);
    w->clamped = w->u_rim < w->n || w->v_rim < w->n;
    if (w->clamped || !w->kind_is_plain) {
        mark_kinds(w);
        w->kind_is_plain = !w->clamped;
    }
    memset(w->memo, 0xFF, places * sizeof *w->memo);
    memset(w->state, WIRE_UNKNOWN, places * sizeof *w->state);
    return wire_table_reserve(&w->allocator, &w->table, w->clamped ? places + 2 : 4 * (size_t)w->n + 2);
}

/* The vertex at a place gets an index: that of its sample, if that has one. */
void wire_vertex_append(wire_walk *w, uint32_t p) {
    const rqt_vertex at = wire_at(w, p), sample = wire_sample(w, at);
    const uint8_t level = (uint8_t)rqt_vertex_level(&w->lattice, at);
    wire_entry *e = w->kind[p] ? wire_table_find(&w->table, sample) : NULL;
    if (e && e->index != WIRE_NONE) {
        rqt_patch_vertex *v = &w->vertices[e->index];
        if (level < v->level) v->level = level;
        w->memo[p] = e->index;
        return;
    }
    w->memo[p] = (uint32_t)w->vertex_count;
    if (e) e->index = w->memo[p];
    w->vertices[w->vertex_count++] =
        (rqt_patch_vertex){.col = sample.x, .row = sample.y, .q = w->q[p], .level = level};
}

static inline uint32_t give_index(uint32_t *memo, rqt_patch_vertex *vertices, uint32_t *next, uint32_t p) {
    const uint32_t i = memo[p];
    const bool is_new = i == WIRE_NONE;
    const uint32_t index = is_new ? *next : i;
    memo[p] = index;
    vertices[*next].col = (int32_t)p;
    *next += is_new;
    return index;
}

void wire_settle_plain(wire_walk *w) {
    uint32_t *const memo = w->memo;
    rqt_patch_vertex *const vertices = w->vertices;
    const size_t first = w->vertex_count;
    uint32_t next = (uint32_t)first;
    if (w->leaves)
        for (size_t t = w->settled; t < w->triangle_count; t++) {
            const uint32_t *p = w->triangles + 3 * t;
            w->leaves[t] = (rqt_triangle){wire_at(w, p[0] & ~WIRE_CLOCKWISE), wire_at(w, p[1]), wire_at(w, p[2])};
        }
    /* New vertices are a matter of chance: no branch. What is written for an old one is overwritten by the next.
     * The walk leaves a leaf where it enters the next, so its left is the right of the one before, unless leaves
     * are missing. */
    uint32_t before = WIRE_NONE, before_index = 0;
    for (size_t t = w->settled; t < w->triangle_count; t++) {
        uint32_t *out = w->triangles + 3 * t;
        const uint32_t clockwise = out[0] >> 31, a = out[0] & ~WIRE_CLOCKWISE, l = out[1], r = out[2];
        const uint32_t ia = give_index(memo, vertices, &next, a);
        const uint32_t il = l == before ? before_index : give_index(memo, vertices, &next, l);
        const uint32_t ir = give_index(memo, vertices, &next, r);
        before = r;
        before_index = ir;
        out[0] = ia;
        out[2 - clockwise] = il;
        out[1 + clockwise] = ir;
    }
    const uint8_t finest = (uint8_t)(w->lattice.K - w->shift);
    for (size_t i = first; i < next; i++) {
        const uint32_t p = (uint32_t)vertices[i].col;
        if (w->kind[p]) {
            /* Its step may be larger than the block's. */
            w->vertex_count = i;
            w->memo[p] = WIRE_NONE;
            wire_vertex_append(w, p);
            continue;
        }
        vertices[i] = (rqt_patch_vertex){.col = w->place.x + (w->column[p] << w->shift),
                                         .row = w->place.y + (w->row[p] << w->shift),
                                         .q = w->q[p],
                                         .level = (uint8_t)(finest - w->scale[p])};
    }
    w->vertex_count = next;
    w->settled = w->triangle_count;
}
