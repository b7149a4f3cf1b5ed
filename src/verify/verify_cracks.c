/* verify_cracks.c - the corners of a mesh: how many there are, and where triangles that touch fail to share them.
 *
 * A corner is a lattice point, so "is there a corner here" is a question to a hash table, and a corner strictly
 * inside an edge can only be at the edge's lattice points, a whole number of steps (dx/g, dy/g) from its end. Every
 * edge of every triangle is walked; the walks of a triangle's edges visit fewer points than its samples, so this
 * never costs more than measuring the error, whatever the triangles are. Samples are not needed, but to say which
 * corners are void.
 */
#include "verify_internal.h"

#include <stdlib.h>

/* A corner that has another height than the first one seen at the same place. */
typedef struct odd_height {
    size_t index;
    int32_t q;
} odd_height;

/* A corner strictly inside an edge, all as indices of the window; low < high. */
typedef struct junction {
    size_t vertex, low, high;
} junction;

/* A place where there is a corner, and the height of the first one seen there. */
typedef struct corner_place {
    size_t after; /* the index in the window plus 1; 0: no place */
    int32_t height;
} corner_place;

typedef struct crack_search {
    const verify_samples *samples;
    corner_place *places; /* a hash table, at most half full */
    size_t place_count;
    unsigned place_bits; /* log2 of its size */
    odd_height *odd;
    size_t odd_count, odd_room;
    junction *junctions;
    size_t junction_count, junction_room;
    bool junctions_capped;
} crack_search;

/* Where the place is in the table, or belongs. */
static corner_place *find_place(corner_place *places, unsigned bits, size_t index) {
    const size_t last = ((size_t)1 << bits) - 1;
    size_t slot = (size_t)((index + 1) * UINT64_C(0x9E3779B97F4A7C15) >> (64 - bits)); /* Fibonacci hashing */
    while (places[slot].after != 0 && places[slot].after != index + 1) slot = (slot + 1) & last;
    return &places[slot];
}

static bool has_corner(const crack_search *search, size_t index) {
    return find_place(search->places, search->place_bits, index)->after != 0;
}

/* Room for one more place; false when there is no memory. */
static bool make_place(crack_search *search) {
    if (search->places != NULL && search->place_count < (size_t)1 << (search->place_bits - 1)) return true;
    const unsigned bits = search->places != NULL ? search->place_bits + 1 : 10;
    corner_place *places = calloc((size_t)1 << bits, sizeof *places);
    if (places == NULL) return false;
    for (size_t k = 0; search->places != NULL && k < (size_t)1 << search->place_bits; k++) {
        const corner_place *old = &search->places[k];
        if (old->after != 0) *find_place(places, bits, old->after - 1) = *old;
    }
    free(search->places);
    search->places = places;
    search->place_bits = bits;
    return true;
}

/* Makes room for one more element in a malloced array; NULL, with the array untouched, when there is no memory. */
static void *grow(void *array, size_t count, size_t *room, size_t size) {
    if (count < *room) return array;
    size_t wanted = *room == 0 ? 1024 : *room * 2;
    if (wanted > SIZE_MAX / size) return NULL;
    void *grown = realloc(array, wanted * size);
    if (grown != NULL) *room = wanted;
    return grown;
}

static int compare_size(size_t a, size_t b) {
    return (a > b) - (a < b);
}

static int compare_odd(const void *left, const void *right) {
    const odd_height *a = left, *b = right;
    int order = compare_size(a->index, b->index);
    return order != 0 ? order : (a->q > b->q) - (a->q < b->q);
}

static int compare_junction(const void *left, const void *right) {
    const junction *a = left, *b = right;
    int order = compare_size(a->vertex, b->vertex);
    if (order == 0) order = compare_size(a->low, b->low);
    return order != 0 ? order : compare_size(a->high, b->high);
}

static bool note_corner(crack_search *search, const verify_corner *corner, verify_report *report) {
    size_t index = verify_index(search->samples, corner->col, corner->row);
    if (!make_place(search)) return false;
    corner_place *place = find_place(search->places, search->place_bits, index);
    if (place->after == 0) {
        *place = (corner_place){.after = index + 1, .height = corner->q};
        search->place_count++;
        report->vertices++;
        const uint8_t *valid = search->samples->valid;
        if (valid != NULL && !valid[index]) report->void_touched++;
        return true;
    }
    if (place->height == corner->q) return true;
    odd_height *odd = grow(search->odd, search->odd_count, &search->odd_room, sizeof *odd);
    if (odd == NULL) return false;
    search->odd = odd;
    odd[search->odd_count++] = (odd_height){.index = index, .q = corner->q};
    return true;
}

/* Of k different heights at one place any two make a crack. The first one seen is not in the list, the others are,
 * some of them repeatedly: the j-th different one of a place makes a pair with each of the j before it. */
static uint64_t count_height_pairs(crack_search *search) {
    uint64_t pairs = 0, different = 0;
    if (search->odd_count == 0) return 0;
    qsort(search->odd, search->odd_count, sizeof *search->odd, compare_odd);
    for (size_t k = 0; k < search->odd_count; k++) {
        const odd_height *here = &search->odd[k];
        if (k == 0 || here[-1].index != here->index) {
            different = 1;
        } else if (here[-1].q != here->q) {
            different++;
        } else {
            continue;
        }
        pairs += different;
    }
    return pairs;
}

/* Both triangles of an edge find the same junctions: sort them and keep one of each. */
static void merge_junctions(crack_search *search) {
    size_t kept = 0;
    if (search->junction_count == 0) return;
    qsort(search->junctions, search->junction_count, sizeof *search->junctions, compare_junction);
    for (size_t k = 0; k < search->junction_count; k++) {
        if (kept > 0 && compare_junction(&search->junctions[kept - 1], &search->junctions[k]) == 0) continue;
        search->junctions[kept++] = search->junctions[k];
    }
    search->junction_count = kept;
}

static bool note_junction(crack_search *search, size_t vertex, size_t from, size_t to) {
    if (search->junction_count == 2 * (size_t)VERIFY_COUNT_CAP) {
        merge_junctions(search);
        if (search->junction_count >= VERIFY_COUNT_CAP) {
            search->junctions_capped = true;
            return true;
        }
    }
    junction *junctions =
        grow(search->junctions, search->junction_count, &search->junction_room, sizeof *junctions);
    if (junctions == NULL) return false;
    search->junctions = junctions;
    junctions[search->junction_count++] =
        (junction){.vertex = vertex, .low = from < to ? from : to, .high = from < to ? to : from};
    return true;
}

static int64_t common_divisor(int64_t a, int64_t b) {
    a = a < 0 ? -a : a;
    b = b < 0 ? -b : b;
    while (b != 0) {
        int64_t rest = a % b;
        a = b;
        b = rest;
    }
    return a;
}

/* `third`, the triangle's other corner, is inside the edge only in a triangle of no area, and is then no junction.
 */
static bool walk_edge(crack_search *search, const verify_corner *a, const verify_corner *b,
                      const verify_corner *third) {
    int64_t dx = (int64_t)b->col - a->col, dy = (int64_t)b->row - a->row;
    int64_t steps = common_divisor(dx, dy);
    if (steps < 2) return true;
    size_t from = verify_index(search->samples, a->col, a->row);
    size_t to = verify_index(search->samples, b->col, b->row);
    size_t other = verify_index(search->samples, third->col, third->row);
    int64_t stride = dy / steps * search->samples->width + dx / steps;
    int64_t at = (int64_t)from;
    for (int64_t k = 1; k < steps && !search->junctions_capped; k++) {
        at += stride;
        if (!has_corner(search, (size_t)at) || (size_t)at == other) continue;
        if (!note_junction(search, (size_t)at, from, to)) return false;
    }
    return true;
}

static verify_status search_cracks(crack_search *search, const verify_triangle *triangles, size_t n,
                                   verify_report *report) {
    for (size_t t = 0; t < n; t++) {
        for (int k = 0; k < 3; k++) {
            if (!note_corner(search, &triangles[t].corner[k], report)) return VERIFY_NO_MEMORY;
        }
    }
    for (size_t t = 0; t < n; t++) {
        const verify_corner *c = triangles[t].corner;
        for (int k = 0; k < 3; k++) {
            if (!walk_edge(search, &c[k], &c[(k + 1) % 3], &c[(k + 2) % 3])) return VERIFY_NO_MEMORY;
        }
    }
    merge_junctions(search);
    uint64_t inside = search->junction_count < VERIFY_COUNT_CAP ? search->junction_count : VERIFY_COUNT_CAP;
    report->t_junctions = inside + count_height_pairs(search);
    return VERIFY_OK;
}

verify_status verify_measure_cracks(const verify_samples *samples, const verify_triangle *triangles, size_t n,
                                    verify_report *report) {
    if (n == 0) return VERIFY_OK;
    crack_search search = {.samples = samples};
    const verify_status status = search_cracks(&search, triangles, n, report);
    free(search.places);
    free(search.odd);
    free(search.junctions);
    return status;
}
