/* selection.c - closed sets of vertices, and the two ways of [RQT] section 4 to close one.
 *
 * The set is a hash table of coordinates, so it knows no block, no border and no corner of a block: parents come
 * from coordinates alone, and what is forced across a border is forced like anything else.
 *
 * Algorithm 1 adds a vertex and follows its dependencies until it meets what is there; Algorithm 2 takes the levels
 * from the finest to the coarsest, sides before centres, and marks the parents of what is in the set as it comes.
 * Both end in the same set, the smallest closed one that holds what was asked for.
 */
#include "internal.h"

struct rqt_selection {
    rqt_lattice lattice;
    rqt_allocator allocator;
    uint64_t *slot; /* vertex + 1, 0 is empty */
    size_t capacity, count;
};

#define FIRST_CAPACITY 256

static uint64_t key_of(rqt_vertex v) {
    return ((uint64_t)(uint32_t)v.y << 32 | (uint32_t)v.x) + 1;
}
static rqt_vertex vertex_of(uint64_t key) {
    return (rqt_vertex){(int32_t)(uint32_t)(key - 1), (int32_t)((key - 1) >> 32)};
}

static size_t place_of(uint64_t key, size_t capacity) {
    uint64_t h = key * UINT64_C(0x9E3779B97F4A7C15);
    h ^= h >> 29;
    h *= UINT64_C(0xBF58476D1CE4E5B9);
    return (size_t)(h >> 20) & (capacity - 1);
}

rqt_status rqt_selection_create(const rqt_lattice *lattice, const rqt_allocator *allocator,
                                rqt_selection **selection) {
    *selection = NULL;
    rqt_selection *s = memory_take(allocator, sizeof *s);
    if (!s) return RQT_NO_MEMORY;
    *s = (rqt_selection){.lattice = *lattice, .allocator = *allocator, .capacity = FIRST_CAPACITY};
    s->slot = memory_take(allocator, FIRST_CAPACITY * sizeof *s->slot);
    if (!s->slot) {
        memory_drop(allocator, s);
        return RQT_NO_MEMORY;
    }
    memset(s->slot, 0, FIRST_CAPACITY * sizeof *s->slot);
    *selection = s;
    return RQT_OK;
}

void rqt_selection_free(rqt_selection *selection) {
    if (!selection) return;
    const rqt_allocator allocator = selection->allocator;
    memory_drop(&allocator, selection->slot);
    memory_drop(&allocator, selection);
}

bool rqt_selection_has(const rqt_selection *s, rqt_vertex v) {
    if (lattice_is_corner(&s->lattice, v)) return true;
    const uint64_t key = key_of(v);
    for (size_t i = place_of(key, s->capacity);; i = (i + 1) & (s->capacity - 1)) {
        if (s->slot[i] == key) return true;
        if (s->slot[i] == 0) return false;
    }
}

size_t rqt_selection_count(const rqt_selection *selection) {
    return selection->count;
}

static void put(uint64_t *slot, size_t capacity, uint64_t key) {
    size_t i = place_of(key, capacity);
    while (slot[i]) i = (i + 1) & (capacity - 1);
    slot[i] = key;
}

/* *added: it was not there before. Corners are always there. */
static rqt_status insert(rqt_selection *s, rqt_vertex v, bool *added) {
    *added = false;
    if (rqt_selection_has(s, v)) return RQT_OK;
    if (2 * (s->count + 1) > s->capacity) {
        const size_t wider = s->capacity * 2;
        uint64_t *slot = memory_take(&s->allocator, wider * sizeof *slot);
        if (!slot) return RQT_NO_MEMORY;
        memset(slot, 0, wider * sizeof *slot);
        for (size_t i = 0; i < s->capacity; i++)
            if (s->slot[i]) put(slot, wider, s->slot[i]);
        memory_drop(&s->allocator, s->slot);
        s->slot = slot;
        s->capacity = wider;
    }
    put(s->slot, s->capacity, key_of(v));
    s->count++;
    *added = true;
    return RQT_OK;
}

rqt_status rqt_selection_add_resolved(rqt_selection *s, rqt_vertex v) {
    /* Depth first: parents are at most 2K levels up and at most two each, so 2K + 1 places are enough. */
    rqt_vertex stack[2 * RQT_MAX_K + 2];
    int depth = 0;
    bool added;
    rqt_status status = insert(s, v, &added);
    if (status != RQT_OK || !added) return status;
    stack[depth++] = v;
    while (depth > 0) {
        rqt_vertex parents[2];
        const int n = rqt_vertex_parents(&s->lattice, stack[--depth], parents);
        for (int i = 0; i < n; i++) {
            status = insert(s, parents[i], &added);
            if (status != RQT_OK) return status;
            if (added) stack[depth++] = parents[i];
        }
    }
    return RQT_OK;
}

/* Vertices of one rank: a parent's is always higher. */
typedef struct bucket {
    uint64_t *key;
    size_t count, capacity;
} bucket;

static rqt_status mark(rqt_selection *s, bucket *buckets, rqt_vertex v) {
    bool added;
    const rqt_status status = insert(s, v, &added);
    if (status != RQT_OK || !added) return status;
    bucket *b = &buckets[rqt_vertex_rank(&s->lattice, v)];
    if (!memory_grow(&s->allocator, (void **)&b->key, &b->capacity, b->count + 1, sizeof *b->key))
        return RQT_NO_MEMORY;
    b->key[b->count++] = key_of(v);
    return RQT_OK;
}

rqt_status rqt_selection_add_bottom_up(rqt_selection *s, const rqt_vertex *vertices, size_t n) {
    bucket buckets[RQT_RANKS] = {{0}};
    rqt_status status = RQT_OK;
    for (size_t i = 0; i < n && status == RQT_OK; i++) status = mark(s, buckets, vertices[i]);
    for (int rank = 0; rank < RQT_RANKS && status == RQT_OK; rank++) {
        for (size_t i = 0; i < buckets[rank].count && status == RQT_OK; i++) {
            rqt_vertex parents[2];
            const int count = rqt_vertex_parents(&s->lattice, vertex_of(buckets[rank].key[i]), parents);
            for (int p = 0; p < count && status == RQT_OK; p++) status = mark(s, buckets, parents[p]);
        }
    }
    for (int rank = 0; rank < RQT_RANKS; rank++) memory_drop(&s->allocator, buckets[rank].key);
    return status;
}

/* ------------------------------------------------------------------------------------- whole terrains */

/* Call add for every selected vertex of a scale. Vertices further out than errors reach are never selected. */
static rqt_status for_selected(const rqt_errors *errors, rqt_code eps, int scale,
                               rqt_status (*add)(void *context, rqt_vertex v), void *context) {
    const rqt_lattice *lattice = &errors->lattice;
    const int32_t side = 1 << lattice->K, q = 1 << scale;
    const int64_t x_end = (int64_t)lattice->width + 3 * (int64_t)q,
                  y_end = (int64_t)lattice->height + 3 * (int64_t)q;
    for (int64_t y = 0; y <= side && y < y_end; y += q) {
        const bool odd_row = (y >> scale) & 1;
        for (int64_t x = odd_row ? 0 : q; x <= side && x < x_end; x += odd_row ? q : 2 * q) {
            const rqt_vertex v = {(int32_t)x, (int32_t)y};
            bool outline;
            const rqt_code code = rqt_errors_at(errors, v, &outline);
            if (code <= eps && !outline) continue;
            const rqt_status status = add(context, v);
            if (status != RQT_OK) return status;
        }
    }
    return RQT_OK;
}

static rqt_status add_resolved(void *context, rqt_vertex v) {
    return rqt_selection_add_resolved(context, v);
}

rqt_status rqt_select_top_down(const rqt_errors *errors, rqt_code eps, rqt_selection *selection) {
    for (int scale = errors->lattice.K - 1; scale >= 0; scale--) {
        const rqt_status status = for_selected(errors, eps, scale, add_resolved, selection);
        if (status != RQT_OK) return status;
    }
    return RQT_OK;
}

typedef struct list {
    const rqt_allocator *allocator;
    rqt_vertex *vertex;
    size_t count, capacity;
} list;

static rqt_status append(void *context, rqt_vertex v) {
    list *l = context;
    if (!memory_grow(l->allocator, (void **)&l->vertex, &l->capacity, l->count + 1, sizeof *l->vertex))
        return RQT_NO_MEMORY;
    l->vertex[l->count++] = v;
    return RQT_OK;
}

rqt_status rqt_select_bottom_up(const rqt_errors *errors, rqt_code eps, rqt_selection *selection) {
    list found = {.allocator = &selection->allocator};
    rqt_status status = RQT_OK;
    for (int scale = 0; scale < errors->lattice.K && status == RQT_OK; scale++)
        status = for_selected(errors, eps, scale, append, &found);
    if (status == RQT_OK) status = rqt_selection_add_bottom_up(selection, found.vertex, found.count);
    memory_drop(&selection->allocator, found.vertex);
    return status;
}
