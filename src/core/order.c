/* order.c - one numbering of a mesh's vertices and triangles, whatever way it came about: two ends that know the
 * same mesh speak of its parts by number (increment.c).
 *
 * Vertices go along the curve that goes round the quarters of quarters: by Morton code, column in the even bits,
 * row in the odd ones. Numbers of neighbours are near each other, and of two meshes what both have comes in the
 * same order. Triangles go by the number of their first vertex, the apex, then of the second and the third. */
#include "order.h"

static uint64_t spread(uint32_t v) {
    uint64_t x = v;
    x = (x | x << 16) & UINT64_C(0x0000FFFF0000FFFF);
    x = (x | x << 8) & UINT64_C(0x00FF00FF00FF00FF);
    x = (x | x << 4) & UINT64_C(0x0F0F0F0F0F0F0F0F);
    x = (x | x << 2) & UINT64_C(0x3333333333333333);
    return (x | x << 1) & UINT64_C(0x5555555555555555);
}

static int32_t gather(uint64_t x) {
    x &= UINT64_C(0x5555555555555555);
    x = (x | x >> 1) & UINT64_C(0x3333333333333333);
    x = (x | x >> 2) & UINT64_C(0x0F0F0F0F0F0F0F0F);
    x = (x | x >> 4) & UINT64_C(0x00FF00FF00FF00FF);
    x = (x | x >> 8) & UINT64_C(0x0000FFFF0000FFFF);
    return (int32_t)(uint32_t)(x | x >> 16);
}

uint64_t order_key(int32_t col, int32_t row) {
    return spread((uint32_t)col) | spread((uint32_t)row) << 1;
}

rqt_vertex order_place(uint64_t key) {
    return (rqt_vertex){gather(key), gather(key >> 1)};
}

int order_compare(const uint32_t a[3], const uint32_t b[3]) {
    for (int c = 0; c < 3; c++)
        if (a[c] != b[c]) return a[c] < b[c] ? -1 : 1;
    return 0;
}

typedef struct keyed {
    uint64_t key;
    uint32_t index;
} keyed;

enum { DIGIT = 11, DIGITS = 4, VALUES = 1 << DIGIT };
_Static_assert(DIGIT *DIGITS >= 2 * (RQT_MAX_K + 1), "digits make up a key");
_Static_assert(DIGITS % 2 == 0, "the last pass ends where the first began");

/* Digit by digit, from the lowest. */
static void sort_keys(keyed *keys, keyed *room, size_t n) {
    for (int shift = 0; shift < DIGITS * DIGIT; shift += DIGIT) {
        uint32_t start[VALUES] = {0}, sum = 0;
        for (size_t i = 0; i < n; i++) start[keys[i].key >> shift & (VALUES - 1)]++;
        for (size_t d = 0; d < VALUES; d++) {
            const uint32_t count = start[d];
            start[d] = sum;
            sum += count;
        }
        for (size_t i = 0; i < n; i++) room[start[keys[i].key >> shift & (VALUES - 1)]++] = keys[i];
        keyed *const swap = keys;
        keys = room;
        room = swap;
    }
}

/* order: the triangles' numbers, sorted. Few have the same first vertex: those are sorted by inserting. start: one
 * more than there are vertices. */
static void sort_triangles(const rqt_patch *patch, uint32_t *start, uint32_t *order) {
    const uint32_t *t = patch->triangles;
    memset(start, 0, (patch->vertex_count + 1) * sizeof *start);
    for (size_t i = 0; i < patch->triangle_count; i++) start[t[3 * i] + 1]++;
    for (size_t v = 0; v < patch->vertex_count; v++) start[v + 1] += start[v];
    for (size_t i = 0; i < patch->triangle_count; i++) order[start[t[3 * i]]++] = (uint32_t)i;
    for (size_t v = 0; v < patch->vertex_count; v++) /* start[v] is where its triangles end */
        for (uint32_t first = v ? start[v - 1] : 0, i = first; i < start[v]; i++) {
            const uint32_t own = order[i];
            uint32_t at = i;
            for (; at > first && order_compare(&t[3 * (size_t)order[at - 1]], &t[3 * (size_t)own]) > 0; at--)
                order[at] = order[at - 1];
            order[at] = own;
        }
}

/* The arrays in a new order; false: no memory, and the old ones stay. */
static bool take_order(rqt_patch *patch, const keyed *keys, const uint32_t *order) {
    const rqt_allocator *a = &patch->allocator;
    const size_t vertices = patch->vertex_count, triangles = patch->triangle_count;
    rqt_patch_vertex *v = memory_take(a, vertices * sizeof *v);
    uint32_t *t = memory_take(a, 3 * triangles * sizeof *t);
    rqt_triangle *leaves = patch->leaves ? memory_take(a, triangles * sizeof *leaves) : NULL;
    if (!v || !t || (patch->leaves && !leaves)) {
        memory_drop(a, v);
        memory_drop(a, t);
        memory_drop(a, leaves);
        return false;
    }
    for (size_t i = 0; i < vertices; i++) v[i] = patch->vertices[keys[i].index];
    for (size_t i = 0; i < triangles; i++) {
        memcpy(&t[3 * i], &patch->triangles[3 * (size_t)order[i]], 3 * sizeof *t);
        if (leaves) leaves[i] = patch->leaves[order[i]];
    }
    memory_drop(a, patch->vertices);
    memory_drop(a, patch->triangles);
    memory_drop(a, patch->leaves);
    patch->vertices = v;
    patch->triangles = t;
    patch->leaves = leaves;
    patch->vertex_capacity = vertices;
    patch->triangle_capacity = triangles;
    patch->leaf_capacity = leaves ? triangles : 0;
    return true;
}

rqt_status rqt_patch_sort(rqt_patch *patch) {
    const rqt_allocator a = patch->allocator;
    const size_t vertices = patch->vertex_count, triangles = patch->triangle_count;
    if (vertices == 0) return RQT_OK; /* nor is there an allocator, where nothing was asked for */
    keyed *keys = memory_take(&a, 2 * vertices * sizeof *keys);
    uint32_t *number = memory_take(&a, (vertices + 1) * sizeof *number),
             *order = memory_take(&a, triangles * sizeof *order);
    rqt_status status = RQT_NO_MEMORY;
    if (keys && number && order) {
        for (size_t i = 0; i < vertices; i++)
            keys[i] = (keyed){order_key(patch->vertices[i].col, patch->vertices[i].row), (uint32_t)i};
        sort_keys(keys, keys + vertices, vertices);
        for (size_t i = 0; i < vertices; i++) number[keys[i].index] = (uint32_t)i;
        for (size_t i = 0; i < 3 * triangles; i++) patch->triangles[i] = number[patch->triangles[i]];
        sort_triangles(patch, number, order);
        if (take_order(patch, keys, order)) status = RQT_OK;
    }
    if (status != RQT_OK) rqt_patch_free(patch); /* its triangles have new numbers already */
    memory_drop(&a, keys);
    memory_drop(&a, number);
    memory_drop(&a, order);
    return status;
}
