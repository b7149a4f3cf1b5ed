/* leaf.c - the one leaf that holds a point, straight down the bintree of one block.
 *
 * The patch of a point holds every leaf whose closed triangle meets it: one, unless the point lies on an edge. Here
 * only that common case is answered; whoever asks makes the patch where it is not. A triangle that the raster's end
 * clamps is not the union of its children, so nothing is said about those either. Where both agree to answer, they
 * answer alike: the same corners in the same order.
 */
#include "internal.h"

#define UNIT 20 /* a coordinate is so many bits finer than a sample */

/* Twice the area of a, b, p, in samples times 2^-20 samples. An edge is at most 2^RQT_MAX_K samples in each
 * coordinate, p at most 2^(RQT_MAX_K + 20) units away: both products are below 2^61. */
static int64_t side_of(rqt_vertex a, rqt_vertex b, int64_t x, int64_t y) {
    return (b.x - a.x) * (y - (int64_t)a.y * (1 << UNIT)) - (b.y - a.y) * (x - (int64_t)a.x * (1 << UNIT));
}

static bool is_chosen(const rqt_query *query, rqt_code error, uint8_t flags) {
    return error > query->eps || (query->outline == RQT_OUTLINE_EXACT && (flags & RQT_OUTLINE));
}

typedef struct leaf_corner {
    rqt_vertex at;
    int32_t q;
    uint8_t flags;
} leaf_corner;

/* The leaf itself: does it hold the point inside, and is it kept? */
static rqt_found finish(const leaf_corner *a, const leaf_corner *l, const leaf_corner *r, int64_t x, int64_t y,
                        rqt_leaf_corner leaf[3]) {
    const int64_t al = side_of(a->at, l->at, x, y), lr = side_of(l->at, r->at, x, y),
                  ra = side_of(r->at, a->at, x, y);
    const bool clockwise = al < 0;
    if (al == 0 || lr == 0 || ra == 0 || (lr < 0) != clockwise || (ra < 0) != clockwise) return RQT_FOUND_UNSURE;
    if (!(a->flags & l->flags & r->flags & RQT_VALID)) return RQT_FOUND_NOTHING;
    const leaf_corner *const corner[3] = {a, clockwise ? l : r, clockwise ? r : l};
    for (int c = 0; c < 3; c++) leaf[c] = (rqt_leaf_corner){corner[c]->at.x, corner[c]->at.y, corner[c]->q};
    return RQT_FOUND_LEAF;
}

static leaf_corner cell_corner(const rqt_block_place *p, const rqt_summary *summary, int c) {
    return (leaf_corner){{p->x + (c & 1 ? p->side : 0), p->y + (c & 2 ? p->side : 0)},
                         summary->corner[c].q,
                         summary->corner[c].flags};
}

static leaf_corner place_corner(const rqt_block_place *p, const rqt_block *block, int32_t u, int32_t v) {
    const size_t at = (size_t)v * (((size_t)1 << block->k) + 1) + (size_t)u;
    return (leaf_corner){{p->x + u * p->stride, p->y + v * p->stride}, block->q[at], block->flags[at]};
}

/* Down from a half, in steps of the block's grid. */
static rqt_found descend(const rqt_query *query, const rqt_block_place *p, const rqt_block *block, rqt_vertex a,
                         rqt_vertex l, rqt_vertex r, int64_t x, int64_t y, rqt_leaf_corner leaf[3]) {
    const size_t n = ((size_t)1 << block->k) + 1;
    /* in grid steps from the block's corner: units of the point shrink by the stride instead */
    for (int splits = 2 * block->k; splits > 0; splits--) {
        const rqt_vertex m = {(l.x + r.x) / 2, (l.y + r.y) / 2};
        const size_t at = (size_t)m.y * n + (size_t)m.x;
        if (!is_chosen(query, block->error[at], block->flags[at])) break;
        const rqt_vertex from = {p->x + a.x * p->stride, p->y + a.y * p->stride},
                         to = {p->x + m.x * p->stride, p->y + m.y * p->stride},
                         left = {p->x + l.x * p->stride, p->y + l.y * p->stride};
        const int64_t point = side_of(from, to, x, y),
                      same = side_of(from, to, (int64_t)left.x * (1 << UNIT), (int64_t)left.y * (1 << UNIT));
        if (point == 0) return RQT_FOUND_UNSURE;
        if ((point < 0) == (same < 0))
            r = a;
        else
            l = a;
        a = m;
    }
    const leaf_corner ca = place_corner(p, block, a.x, a.y), cl = place_corner(p, block, l.x, l.y),
                      cr = place_corner(p, block, r.x, r.y);
    return finish(&ca, &cl, &cr, x, y, leaf);
}

rqt_found rqt_query_leaf_at(const rqt_query *query, const rqt_answer *answer, const rqt_block *block, int64_t x,
                            int64_t y, rqt_leaf_corner leaf[3]) {
    rqt_block_place p;
    if (query->select != RQT_SELECT_THRESHOLD || query->rule || (block && block->k != query->k) ||
        rqt_block_locate(&query->lattice, query->k, answer->number, &p) != RQT_OK)
        return RQT_FOUND_UNSURE;
    if (p.x + p.side >= query->lattice.width || p.y + p.side >= query->lattice.height) return RQT_FOUND_UNSURE;
    const rqt_summary *summary = &answer->summary;
    /* The diagonal, and an apex on each side of it; query.c has the same cases. */
    const int c = (p.i & 1) | (p.j & 1) << 1, from = p.level == 0 ? 0 : c, to = 3 - from;
    const leaf_corner f = cell_corner(&p, summary, from), t = cell_corner(&p, summary, to);
    const int64_t point = side_of(f.at, t.at, x, y);
    if (point == 0) return RQT_FOUND_UNSURE;
    for (int h = 0; h < 2; h++) {
        const int which = from ^ (h + 1);
        const leaf_corner apex = cell_corner(&p, summary, which);
        const int64_t same =
            side_of(f.at, t.at, (int64_t)apex.at.x * (1 << UNIT), (int64_t)apex.at.y * (1 << UNIT));
        if ((point < 0) != (same < 0)) continue;
        if (p.level > 0 && !is_chosen(query, summary->corner[which].error, summary->corner[which].flags)) {
            const rqt_summary_vertex *v = &summary->far[h];
            const leaf_corner far = {{2 * apex.at.x - f.at.x, 2 * apex.at.y - f.at.y}, v->q, v->flags};
            if (far.at.x >= query->lattice.width || far.at.y >= query->lattice.height) return RQT_FOUND_UNSURE;
            return finish(&t, &f, &far, x, y, leaf);
        }
        /* apex, left, right as query.c walks them: the first half from the parent's centre, the second back */
        const bool out = p.level == 0 ? h == 0 : h == 1;
        const leaf_corner *const l = out ? &f : &t, *const r = out ? &t : &f;
        if (!block) return finish(&apex, l, r, x, y, leaf);
        const rqt_vertex corner[3] = {{(apex.at.x - p.x) / p.stride, (apex.at.y - p.y) / p.stride},
                                      {(l->at.x - p.x) / p.stride, (l->at.y - p.y) / p.stride},
                                      {(r->at.x - p.x) / p.stride, (r->at.y - p.y) / p.stride}};
        return descend(query, &p, block, corner[0], corner[1], corner[2], x, y, leaf);
    }
    return RQT_FOUND_UNSURE;
}
