/* verify_overlap.c - triangles that lie on each other, turn the wrong way, or have no area.
 *
 * Two triangles can only meet where their boxes do. Boxes are put in a stack of grids with cells of 1, 2, 4, ...
 * samples, each box in the finest grid whose cells are at least as wide and as high as itself, so in at most four
 * cells. A triangle is then compared with those in the cells its box touches in its own and all coarser grids. A
 * huge triangle beside a million tiny ones is in a few cells of a coarse grid, which each tiny one looks at once;
 * it never asks what is below it. The cells of all grids share one hash table, so memory depends on the triangles
 * alone.
 */
#include "verify_internal.h"

#include <stdlib.h>

enum {
    LEVELS = 23,    /* cells of 2^0 to 2^22 samples: no box is wider than 2^22 */
    CELL_BITS = 23, /* a cell's number along one axis */
};

typedef struct cell_entry {
    uint64_t cell;
    size_t triangle;
} cell_entry;

typedef struct grid_stack {
    const verify_box *boxes;
    bool (*meet)(const void *context, size_t a, size_t b);
    const void *context;
    size_t per_level[LEVELS]; /* how many boxes are in the grid of a level: empty ones are not looked at */
    unsigned hash_shift;
    size_t *bucket_start; /* per bucket and one more */
    cell_entry *entries;  /* by bucket */
} grid_stack;

static unsigned level_of(const verify_box *b) {
    uint32_t width = b->east - b->west + 1, height = b->south - b->north + 1;
    uint32_t extent = width > height ? width : height;
    unsigned level = 0;
    while (UINT32_C(1) << level < extent) {
        level++;
    }
    return level;
}

static uint64_t cell_key(unsigned level, uint32_t x, uint32_t y) {
    return ((uint64_t)level << CELL_BITS | y) << CELL_BITS | x;
}

static size_t bucket_of(const grid_stack *grids, uint64_t cell) {
    return (size_t)(cell * UINT64_C(0x9E3779B97F4A7C15) >> grids->hash_shift); /* Fibonacci hashing */
}

static uint32_t later(uint32_t a, uint32_t b) {
    return a > b ? a : b;
}

static bool boxes_meet(const verify_box *a, const verify_box *b) {
    return a->west <= b->east && b->west <= a->east && a->north <= b->south && b->north <= a->south;
}

/* How many triangles of one cell meet triangle t. Two boxes may share several cells: only the cell with the
 * north-west corner of what they have in common counts them. */
static uint64_t count_in_cell(const grid_stack *grids, size_t t, const verify_box *ours, unsigned our_level,
                              unsigned level, uint32_t x, uint32_t y, uint64_t room) {
    uint64_t cell = cell_key(level, x, y), found = 0;
    size_t bucket = bucket_of(grids, cell);
    for (size_t k = grids->bucket_start[bucket]; k < grids->bucket_start[bucket + 1] && found < room; k++) {
        const cell_entry *entry = &grids->entries[k];
        if (entry->cell != cell) continue;
        if (level == our_level && entry->triangle <= t) continue; /* the lower number asks */
        const verify_box *theirs = &grids->boxes[entry->triangle];
        if (!boxes_meet(ours, theirs)) continue;
        if (later(ours->west, theirs->west) >> level != x || later(ours->north, theirs->north) >> level != y)
            continue;
        found += grids->meet(grids->context, t, entry->triangle);
    }
    return found;
}

static bool has_area(const verify_box *box) {
    return box->west <= box->east;
}

static uint64_t count_pairs(const grid_stack *grids, size_t n) {
    uint64_t found = 0;
    for (size_t t = 0; t < n && found < VERIFY_COUNT_CAP; t++) {
        const verify_box *b = &grids->boxes[t];
        if (!has_area(b)) continue;
        unsigned our_level = level_of(b);
        for (unsigned level = our_level; level < LEVELS; level++) {
            if (grids->per_level[level] == 0) continue;
            for (uint32_t y = b->north >> level; y <= b->south >> level; y++) {
                for (uint32_t x = b->west >> level; x <= b->east >> level; x++) {
                    found += count_in_cell(grids, t, b, our_level, level, x, y, VERIFY_COUNT_CAP - found);
                }
            }
        }
    }
    return found;
}

/* Counts the entries of every bucket, or with `place` set stores them: bucket_start then moves from the start of
 * each bucket to its end. Returns how many there are. */
static size_t visit_cells(grid_stack *grids, size_t n, bool place) {
    size_t total = 0;
    for (size_t t = 0; t < n; t++) {
        const verify_box *b = &grids->boxes[t];
        if (!has_area(b)) continue;
        unsigned level = level_of(b);
        if (!place) grids->per_level[level]++;
        for (uint32_t y = b->north >> level; y <= b->south >> level; y++) {
            for (uint32_t x = b->west >> level; x <= b->east >> level; x++) {
                uint64_t cell = cell_key(level, x, y);
                size_t *slot = &grids->bucket_start[bucket_of(grids, cell)];
                if (place) grids->entries[*slot] = (cell_entry){.cell = cell, .triangle = t};
                ++*slot;
                total++;
            }
        }
    }
    return total;
}

static bool fill_grids(grid_stack *grids, size_t n) {
    unsigned bits = 4;
    while (bits < 40 && (size_t)1 << bits < n) {
        bits++;
    }
    size_t buckets = (size_t)1 << bits;
    grids->hash_shift = 64 - bits;
    grids->bucket_start = calloc(buckets + 1, sizeof *grids->bucket_start);
    if (grids->bucket_start == NULL) return false;
    size_t total = visit_cells(grids, n, false);
    if (total >= SIZE_MAX / sizeof *grids->entries) return false;
    grids->entries = malloc((total + 1) * sizeof *grids->entries);
    if (grids->entries == NULL) return false;

    size_t start = 0;
    for (size_t k = 0; k < buckets; k++) {
        size_t count = grids->bucket_start[k];
        grids->bucket_start[k] = start;
        start += count;
    }
    visit_cells(grids, n, true);
    /* Each element is now the end of its bucket, which is the start of the next one. */
    for (size_t k = buckets; k > 0; k--) {
        grids->bucket_start[k] = grids->bucket_start[k - 1];
    }
    grids->bucket_start[0] = 0;
    return true;
}

verify_status verify_count_pairs(const verify_box *boxes, size_t n,
                                 bool (*meet)(const void *context, size_t a, size_t b), const void *context,
                                 uint64_t *found) {
    grid_stack grids = {.boxes = boxes, .meet = meet, .context = context};
    const bool filled = fill_grids(&grids, n);
    if (filled) *found = count_pairs(&grids, n);
    free(grids.bucket_start);
    free(grids.entries);
    return filled ? VERIFY_OK : VERIFY_NO_MEMORY;
}

/* ------------------------------------------------------------------------------------ triangles of samples -- */

static verify_box box_of(const verify_triangle *triangle) {
    /* without an area, no inside, and a box that may be less than a square */
    if (verify_cross(&triangle->corner[0], &triangle->corner[1], &triangle->corner[2]) == 0)
        return (verify_box){.west = 1};
    int32_t west = triangle->corner[0].col, east = west;
    int32_t north = triangle->corner[0].row, south = north;
    for (int k = 1; k < 3; k++) {
        const verify_corner *c = &triangle->corner[k];
        if (c->col < west) west = c->col;
        if (c->col > east) east = c->col;
        if (c->row < north) north = c->row;
        if (c->row > south) south = c->row;
    }
    return (verify_box){.west = (uint32_t)(west - VERIFY_GRID_ORIGIN),
                        .north = (uint32_t)(north - VERIFY_GRID_ORIGIN),
                        .east = (uint32_t)(east - VERIFY_GRID_ORIGIN - 1),
                        .south = (uint32_t)(south - VERIFY_GRID_ORIGIN - 1)};
}

/* Is the whole of t on or outside the line of one of s's edges? Two convex sets with insides that do not meet
 * always have such a line, and for polygons one of the edges will do. */
static bool edge_separates(const verify_corner *s, const verify_corner *t) {
    bool turned = verify_cross(&s[0], &s[1], &s[2]) < 0;
    for (int k = 0; k < 3; k++) {
        const verify_corner *a = &s[k], *b = &s[(k + 1) % 3];
        bool outside = true;
        for (int j = 0; j < 3 && outside; j++) {
            int64_t side = verify_cross(a, b, &t[j]);
            outside = turned ? side >= 0 : side <= 0;
        }
        if (outside) return true;
    }
    return false;
}

static bool triangles_meet(const void *context, size_t a, size_t b) {
    const verify_triangle *triangles = context;
    const verify_corner *s = triangles[a].corner, *t = triangles[b].corner;
    return !edge_separates(s, t) && !edge_separates(t, s);
}

verify_status verify_measure_overlaps(const verify_triangle *triangles, size_t n, verify_report *report) {
    uint64_t turned = 0, pairs = 0;
    verify_box *boxes = malloc((n + 1) * sizeof *boxes);
    if (boxes == NULL) return VERIFY_NO_MEMORY;
    for (size_t t = 0; t < n; t++) {
        const verify_corner *c = triangles[t].corner;
        turned += verify_cross(&c[0], &c[1], &c[2]) >= 0;
        boxes[t] = box_of(&triangles[t]);
    }
    const verify_status status = verify_count_pairs(boxes, n, triangles_meet, triangles, &pairs);
    free(boxes);
    report->overlaps = turned + pairs;
    return status;
}
