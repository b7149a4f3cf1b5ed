/* conflict.c - which sources disagree where they meet: for each pair, in how many samples, by how much, and where.
 *
 * A sample that several sources have is compared as they come: each with the one whose value stood there before.
 * What is kept of a pair is a sum, a maximum and a first place, so it is the same for strips of any height, and
 * parts of it (of one strip, in the resume file) add up.
 */
#include "parts.h"

#include <stdlib.h>
#include <string.h>

/* Earlier in the order of rows. */
static bool is_before(int32_t row, int32_t column, int32_t other_row, int32_t other_column) {
    return row != other_row ? row < other_row : column < other_column;
}

static void merge_pair(import_conflict *into, const import_conflict *from) {
    into->differ += from->differ;
    if (from->largest > into->largest ||
        (from->largest == into->largest && is_before(from->row, from->column, into->row, into->column))) {
        into->largest = from->largest;
        into->row = from->row;
        into->column = from->column;
    }
    if (is_before(from->first_row, from->first_column, into->first_row, into->first_column)) {
        into->first_row = from->first_row;
        into->first_column = from->first_column;
    }
}

static size_t place_of(const import_conflicts *c, int32_t a, int32_t b) {
    const uint64_t key = (uint64_t)(uint32_t)a << 32 | (uint32_t)b;
    size_t at = (size_t)(key * 0x9E3779B97F4A7C15U >> 20) & (c->slots - 1);
    while (c->slot[at] && (c->pair[c->slot[at] - 1].a != a || c->pair[c->slot[at] - 1].b != b))
        at = (at + 1) & (c->slots - 1);
    return at;
}

/* Room for one pair more. */
static bool grow(import_conflicts *c) {
    if (c->count < c->slots / 2) return true;
    const size_t slots = c->slots ? 2 * c->slots : 64;
    import_conflict *pair = realloc(c->pair, slots / 2 * sizeof *pair);
    if (pair) c->pair = pair;
    uint32_t *slot = calloc(slots, sizeof *slot);
    if (!pair || !slot) {
        free(slot);
        return false;
    }
    free(c->slot);
    c->slot = slot;
    c->slots = slots;
    for (size_t i = 0; i < c->count; i++) c->slot[place_of(c, c->pair[i].a, c->pair[i].b)] = (uint32_t)i + 1;
    return true;
}

bool import_conflicts_add(import_conflicts *c, const import_conflict *one) {
    if (c->last < c->count && c->pair[c->last].a == one->a && c->pair[c->last].b == one->b) {
        merge_pair(&c->pair[c->last], one);
        return true;
    }
    if (!grow(c)) return false;
    const size_t at = place_of(c, one->a, one->b);
    if (c->slot[at]) {
        c->last = c->slot[at] - 1;
        merge_pair(&c->pair[c->last], one);
    } else {
        c->last = c->count++;
        c->pair[c->last] = *one;
        c->slot[at] = (uint32_t)c->count;
    }
    return true;
}

void import_conflicts_clear(import_conflicts *c) {
    if (c->count) memset(c->slot, 0, c->slots * sizeof *c->slot);
    c->count = c->last = 0;
}

void import_conflicts_free(import_conflicts *c) {
    free(c->pair);
    free(c->slot);
    *c = (import_conflicts){0};
}
