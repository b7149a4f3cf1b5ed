/* pyramid.c - the blocks of all levels of one terrain, out of its samples and saturated errors.
 *
 * The interval pyramid: a block of stride t answers eps when no vertex strictly finer than t in its closed cell is
 * selected, but one strictly finer than 2t in its parent's is: em <= eps < em_parent. em grows from child to
 * parent, so of the blocks over one place exactly one answers. A block shares its border rows with its neighbours,
 * and carries two vertices of its parent's border that it lacks (far): what a query reads of a block is all it
 * needs.
 */
#include "internal.h"

typedef struct node {
    rqt_block_number number;
    rqt_code em;  /* largest code strictly finer than the stride in the closed cell */
    bool outline; /* one of those vertices has the outline bit */
} node;

struct rqt_pyramid {
    rqt_allocator allocator;
    const rqt_grid *grid;
    const rqt_errors *errors;
    int k;
    size_t count;
    node *nodes; /* ascending number: level by level */
    size_t level_begin[RQT_MAX_K + 2];
};

static const node *find(const rqt_pyramid *p, rqt_block_number number) {
    size_t low = 0, high = p->count;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (p->nodes[middle].number < number)
            low = middle + 1;
        else
            high = middle;
    }
    return low < p->count && p->nodes[low].number == number ? &p->nodes[low] : NULL;
}

static bool exists(const rqt_lattice *lattice, int level, int64_t i, int64_t j) {
    const int shift = lattice->K - level;
    return (i << shift) < (lattice->width > 1 ? lattice->width - 1 : 1) &&
           (j << shift) < (lattice->height > 1 ? lattice->height - 1 : 1);
}

/* Depth first through the cells of one level in Morton order. */
static size_t list_level(const rqt_pyramid *p, int level, int depth, int32_t i, int32_t j, node *out) {
    if (!exists(&p->grid->lattice, depth, i, j)) return 0;
    if (depth == level) {
        if (out) *out = (node){.number = rqt_block_number_of(level, i, j)};
        return 1;
    }
    size_t n = 0;
    for (int child = 0; child < 4; child++)
        n += list_level(p, level, depth + 1, 2 * i + (child & 1), 2 * j + (child >> 1), out ? out + n : NULL);
    return n;
}

/* The stored error of a vertex. */
static rqt_code stored_error(const rqt_errors *errors, rqt_vertex v, bool *outline) {
    *outline = false;
    return lattice_has_area(&errors->lattice, v) ? rqt_errors_at(errors, v, outline) : 0;
}

/* em of a block from its four quarters: what their own grids add between their stride and this one's, and their em.
 */
static void find_em(const rqt_pyramid *p, node *block) {
    const rqt_lattice *lattice = &p->grid->lattice;
    rqt_block_place place;
    (void)rqt_block_locate(lattice, p->k, block->number, &place);
    if (place.stride == 1) return;
    for (int child = 0; child < 4; child++) {
        const int32_t i = 2 * place.i + (child & 1), j = 2 * place.j + (child >> 1);
        const node *c = find(p, rqt_block_number_of(place.level + 1, i, j));
        if (!c) continue;
        if (c->em > block->em) block->em = c->em;
        block->outline |= c->outline;
    }
    const int32_t half = place.stride / 2, n = 2 << p->k;
    for (int32_t v = 0; v <= n; v++) {
        for (int32_t u = v & 1 ? 0 : 1; u <= n; u += v & 1 ? 1 : 2) {
            bool outline;
            const rqt_vertex at = {place.x + u * half, place.y + v * half};
            const rqt_code code = stored_error(p->errors, at, &outline);
            if (code > block->em) block->em = code;
            block->outline |= outline;
        }
    }
}

rqt_status rqt_pyramid_create(const rqt_grid *grid, const rqt_errors *saturated, int k,
                              const rqt_allocator *allocator, rqt_pyramid **pyramid) {
    *pyramid = NULL;
    if (k < 0 || k > RQT_MAX_BLOCK_K || k > grid->lattice.K || (k == 0 && grid->lattice.K > 0)) return RQT_INVALID;
    rqt_pyramid *p = memory_take(allocator, sizeof *p);
    if (!p) return RQT_NO_MEMORY;
    *p = (rqt_pyramid){.allocator = *allocator, .grid = grid, .errors = saturated, .k = k};
    const int levels = rqt_block_levels(&grid->lattice, k);
    for (int level = 0; level < levels; level++) {
        p->level_begin[level] = p->count;
        p->count += list_level(p, level, 0, 0, 0, NULL);
    }
    p->level_begin[levels] = p->count;
    p->nodes = memory_take(allocator, p->count * sizeof *p->nodes);
    if (!p->nodes) {
        memory_drop(allocator, p);
        return RQT_NO_MEMORY;
    }
    for (int level = 0; level < levels; level++)
        (void)list_level(p, level, 0, 0, 0, p->nodes + p->level_begin[level]);
    for (size_t n = p->count; n-- > 0;) find_em(p, &p->nodes[n]);
    *pyramid = p;
    return RQT_OK;
}

void rqt_pyramid_free(rqt_pyramid *pyramid) {
    if (!pyramid) return;
    const rqt_allocator allocator = pyramid->allocator;
    memory_drop(&allocator, pyramid->nodes);
    memory_drop(&allocator, pyramid);
}

size_t rqt_pyramid_count(const rqt_pyramid *pyramid) {
    return pyramid->count;
}

static int32_t sample(const rqt_grid *grid, rqt_vertex v, uint8_t *flags) {
    const rqt_vertex s = rqt_vertex_clamp(&grid->lattice, v);
    const size_t at = (size_t)s.y * (size_t)grid->lattice.width + (size_t)s.x;
    *flags = !grid->valid || grid->valid[at] ? RQT_VALID : 0;
    return *flags ? grid->q[at] : 0; /* what lies under a void is nobody's business */
}

static rqt_summary_vertex summary_vertex(const rqt_pyramid *p, int32_t x, int32_t y) {
    const rqt_vertex v = {x, y};
    rqt_summary_vertex out;
    bool outline;
    out.q = sample(p->grid, v, &out.flags);
    out.error = stored_error(p->errors, v, &outline);
    if (outline) out.flags |= RQT_OUTLINE;
    return out;
}

static rqt_interval interval(rqt_code em, bool outline, const node *parent, bool exact) {
    rqt_interval out = {em, RQT_CODE_INFINITY};
    if (exact && outline) out.em = RQT_CODE_INFINITY;
    if (parent) out.em_parent = exact && parent->outline ? RQT_CODE_INFINITY : parent->em;
    return out;
}

static void summarize(const rqt_pyramid *p, const node *b, const rqt_block_place *place, rqt_summary *summary) {
    memset(summary, 0, sizeof *summary);
    const node *parent = place->level > 0 ? find(p, b->number >> 2) : NULL;
    summary->tol = interval(b->em, b->outline, parent, false);
    summary->exact = interval(b->em, b->outline, parent, true);
    const int32_t x = place->x, y = place->y, side = place->side;
    if (p->k > 0) {
        bool outline;
        uint8_t flags;
        const rqt_vertex center = {x + side / 2, y + side / 2};
        summary->center_error = stored_error(p->errors, center, &outline);
        (void)sample(p->grid, center, &flags);
        summary->center_flags = (uint8_t)(flags | (outline ? RQT_OUTLINE : 0));
    }
    for (int c = 0; c < 4; c++)
        summary->corner[c] = summary_vertex(p, x + (c & 1 ? side : 0), y + (c & 2 ? side : 0));
    if (!parent) return;
    /* c: the block's corner that is a corner of the parent; the parent's centre is opposite. */
    const int32_t cx = place->i & 1 ? x + side : x, ax = place->i & 1 ? x : x + side;
    const int32_t cy = place->j & 1 ? y + side : y, ay = place->j & 1 ? y : y + side;
    summary->far[0] = summary_vertex(p, 2 * ax - cx, cy);
    summary->far[1] = summary_vertex(p, cx, 2 * ay - cy);
}

void rqt_pyramid_block(const rqt_pyramid *p, size_t n, rqt_block_number *number, rqt_summary *summary,
                       rqt_block *block) {
    const node *b = &p->nodes[n];
    rqt_block_place place;
    (void)rqt_block_locate(&p->grid->lattice, p->k, b->number, &place);
    *number = b->number;
    summarize(p, b, &place, summary);
    if (!block) return;
    const int32_t side = (1 << p->k) + 1;
    block->k = p->k;
    block->width = place.width;
    block->height = place.height;
    block->sparse = place.stride > 1;
    block->floor = block->sparse ? b->em : 0;
    for (int32_t v = 0; v < side; v++) {
        for (int32_t u = 0; u < side; u++) {
            const rqt_vertex at = {place.x + u * place.stride, place.y + v * place.stride};
            const size_t i = (size_t)v * (size_t)side + (size_t)u;
            uint8_t flags;
            bool outline;
            block->q[i] = sample(p->grid, at, &flags);
            block->error[i] = stored_error(p->errors, at, &outline);
            block->flags[i] = (uint8_t)(flags | (outline ? RQT_OUTLINE : 0));
        }
    }
    block_settle_past(block);
}
