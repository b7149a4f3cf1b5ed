/* cells.c - in which cells of a grid a mesh has triangles, without making the mesh.
 *
 * Down the bintree of each block that answers, and no further than marks are lacking: a triangle whose box has no
 * cell without a mark is passed over with all that is below it. So where nearly every leaf is kept it takes one
 * path down for each cell, and where none is it takes one walk for all cells. Below a triangle within one cell
 * nothing is left to ask but whether a leaf is kept.
 *
 * What is asked of a leaf depends on it alone, so that a leaf of two blocks (query.c) may be asked twice, and each
 * block stands for itself. All is decided between integers.
 */
#include "rule.h"

enum { UNIT = 20 }; /* a line is so many bits finer than a sample */

/* Cells x0 .. x1 - 1 by y0 .. y1 - 1. */
typedef struct span {
    int32_t x0, x1, y0, y1;
} span;

typedef struct marking {
    const rqt_query *query;
    const rqt_block *block; /* NULL: its summary is enough */
    rqt_block_place place;
    rule_range range; /* of the block's vertices; least is most without a rule */
    uint8_t mask;     /* flags that select */
    rqt_cells *cells;
} marking;

/* A coordinate as the raster's end clamps it. */
static int32_t cut_at(int32_t at, int32_t samples) {
    return at < samples ? at : samples - 1;
}

/* Those of a span that have inner points in a box of samples. */
static span narrow(const rqt_cells *cells, span s, int32_t x0, int32_t x1, int32_t y0, int32_t y1) {
    const int64_t one = INT64_C(1) << UNIT;
    while (s.x0 < s.x1 && cells->x[s.x0 + 1] <= x0 * one) s.x0++;
    while (s.x0 < s.x1 && cells->x[s.x1 - 1] >= x1 * one) s.x1--;
    while (s.y0 < s.y1 && cells->y[s.y0 + 1] <= y0 * one) s.y0++;
    while (s.y0 < s.y1 && cells->y[s.y1 - 1] >= y1 * one) s.y1--;
    return s;
}

static span span_of_block(const rqt_cells *cells, const rqt_lattice *lattice, const rqt_block_place *place) {
    const rqt_vertex end = rqt_vertex_clamp(lattice, (rqt_vertex){place->x + place->side, place->y + place->side});
    return narrow(cells, (span){0, cells->columns, 0, cells->rows}, place->x, end.x, place->y, end.y);
}

static uint8_t *mark_of(const rqt_cells *cells, int32_t x, int32_t y) {
    return &cells->marks[(size_t)y * (size_t)cells->columns + (size_t)x];
}

static bool lacks(const rqt_cells *cells, span s) {
    for (int32_t y = s.y0; y < s.y1; y++)
        for (int32_t x = s.x0; x < s.x1; x++)
            if (!*mark_of(cells, x, y)) return true;
    return false;
}

bool rqt_cells_lack(const rqt_cells *cells, const rqt_lattice *lattice, const rqt_block_place *place) {
    return lacks(cells, span_of_block(cells, lattice, place));
}

void rqt_cells_fill(rqt_cells *cells, const rqt_lattice *lattice, const rqt_block_place *place) {
    const span s = span_of_block(cells, lattice, place);
    for (int32_t y = s.y0; y < s.y1; y++)
        for (int32_t x = s.x0; x < s.x1; x++) *mark_of(cells, x, y) = 1;
}

/* ---------------------------------------------------------------------------------------------- triangles -- */

typedef struct mark_corner {
    rqt_vertex at; /* lattice */
    uint8_t flags;
} mark_corner;

static int32_t least_of(int32_t a, int32_t b, int32_t c) {
    const int32_t least = a < b ? a : b;
    return least < c ? least : c;
}

static int32_t most_of(int32_t a, int32_t b, int32_t c) {
    const int32_t most = a > b ? a : b;
    return most > c ? most : c;
}

/* Is all of a cell on the outer side of the edge from p to q, or on it? turn: +1 where the triangle lies on the
 * side of positive products, -1 on the other. An edge is at most 2^RQT_MAX_K samples in each coordinate, a cell at
 * most 2^(RQT_MAX_K + 20) units away: both products are below 2^61. */
static bool is_beyond(const rqt_cells *cells, int32_t x, int32_t y, rqt_vertex p, rqt_vertex q, int turn) {
    const int64_t one = INT64_C(1) << UNIT, dx = turn * (q.x - p.x), dy = turn * (q.y - p.y);
    const int64_t at_x = cells->x[dy < 0 ? x + 1 : x] - p.x * one, at_y = cells->y[dx > 0 ? y + 1 : y] - p.y * one;
    return dx * at_y - dy * at_x <= 0; /* of the corner that is furthest inside */
}

/* A leaf, which lies in no other cells than the span's. */
static void mark_leaf(const marking *m, const mark_corner *a, const mark_corner *l, const mark_corner *r, span s) {
    if (!(a->flags & l->flags & r->flags & RQT_VALID)) return;
    const rqt_lattice *lattice = &m->query->lattice;
    const rqt_vertex v[3] = {rqt_vertex_clamp(lattice, a->at), rqt_vertex_clamp(lattice, l->at),
                             rqt_vertex_clamp(lattice, r->at)};
    const int64_t area =
        (int64_t)(v[1].x - v[0].x) * (v[2].y - v[0].y) - (int64_t)(v[2].x - v[0].x) * (v[1].y - v[0].y);
    if (area == 0) return;
    const int turn = area > 0 ? 1 : -1;
    s = narrow(m->cells, s, least_of(v[0].x, v[1].x, v[2].x), most_of(v[0].x, v[1].x, v[2].x),
               least_of(v[0].y, v[1].y, v[2].y), most_of(v[0].y, v[1].y, v[2].y));
    for (int32_t y = s.y0; y < s.y1; y++)
        for (int32_t x = s.x0; x < s.x1; x++) {
            uint8_t *mark = mark_of(m->cells, x, y);
            if (*mark || is_beyond(m->cells, x, y, v[0], v[1], turn) ||
                is_beyond(m->cells, x, y, v[1], v[2], turn) || is_beyond(m->cells, x, y, v[2], v[0], turn))
                continue;
            *mark = 1;
        }
}

/* ---------------------------------------------------------------------------------------------- the block -- */

typedef struct step {
    int32_t u, v; /* of the block's grid */
} step;

static rqt_vertex vertex_at(const marking *m, step at) {
    return (rqt_vertex){m->place.x + at.u * m->place.stride, m->place.y + at.v * m->place.stride};
}

static uint32_t place_of(const marking *m, step at) {
    return (uint32_t)at.v * ((UINT32_C(1) << m->query->k) + 1) + (uint32_t)at.u;
}

static bool is_chosen(const marking *m, uint32_t place) {
    const rqt_code error = m->block->error[place];
    if (error > m->range.most || (m->block->flags[place] & m->mask)) return true;
    if (error <= m->range.least && !m->range.forced) return false;
    const int32_t n = (1 << m->query->k) + 1;
    const step at = {(int32_t)place % n, (int32_t)place / n};
    return rqt_rule_selects(m->query->rule, vertex_at(m, at), error, false);
}

/* Is one of the leaves of a triangle kept? a, l, r: places in the block's arrays. */
static bool keeps_any(const marking *m, uint32_t a, uint32_t l, uint32_t r, int splits) {
    const uint8_t *flags = m->block->flags;
    const uint32_t middle = (l + r) / 2;
    if (splits > 0 && is_chosen(m, middle))
        return keeps_any(m, middle, l, a, splits - 1) || keeps_any(m, middle, a, r, splits - 1);
    return flags[a] & flags[l] & flags[r] & RQT_VALID;
}

static mark_corner corner_at(const marking *m, step at) {
    return (mark_corner){vertex_at(m, at), m->block->flags[place_of(m, at)]};
}

/* Does a triangle lie in one cell, so that its leaves can be asked for no more than whether they are kept? Cells
 * end with the raster: it is not clamped then. */
static bool is_within(const rqt_cells *cells, span s, int32_t x0, int32_t x1, int32_t y0, int32_t y1) {
    const int64_t one = INT64_C(1) << UNIT;
    return s.x1 - s.x0 == 1 && s.y1 - s.y0 == 1 && x0 * one >= cells->x[s.x0] && x1 * one <= cells->x[s.x1] &&
           y0 * one >= cells->y[s.y0] && y1 * one <= cells->y[s.y1];
}

static void mark_below(const marking *m, step a, step l, step r, int splits, span s) {
    const rqt_lattice *lattice = &m->query->lattice;
    const rqt_block_place *p = &m->place;
    const int32_t x0 = p->x + least_of(a.u, l.u, r.u) * p->stride, x1 = p->x + most_of(a.u, l.u, r.u) * p->stride,
                  y0 = p->y + least_of(a.v, l.v, r.v) * p->stride, y1 = p->y + most_of(a.v, l.v, r.v) * p->stride;
    s = narrow(m->cells, s, cut_at(x0, lattice->width), cut_at(x1, lattice->width), cut_at(y0, lattice->height),
               cut_at(y1, lattice->height));
    if (!lacks(m->cells, s)) return;
    if (is_within(m->cells, s, x0, x1, y0, y1)) {
        if (keeps_any(m, place_of(m, a), place_of(m, l), place_of(m, r), splits))
            *mark_of(m->cells, s.x0, s.y0) = 1;
        return;
    }
    const step middle = {(l.u + r.u) / 2, (l.v + r.v) / 2};
    if (splits > 0 && is_chosen(m, place_of(m, middle))) {
        mark_below(m, middle, l, a, splits - 1, s);
        mark_below(m, middle, a, r, splits - 1, s);
        return;
    }
    const mark_corner ca = corner_at(m, a), cl = corner_at(m, l), cr = corner_at(m, r);
    mark_leaf(m, &ca, &cl, &cr, s);
}

static mark_corner summary_corner(const marking *m, const rqt_summary *summary, int c) {
    const rqt_block_place *p = &m->place;
    return (mark_corner){{p->x + (c & 1 ? p->side : 0), p->y + (c & 2 ? p->side : 0)}, summary->corner[c].flags};
}

static void mark_half(const marking *m, const rqt_summary *summary, int a, int l, int r, span s) {
    const int32_t last = 1 << m->query->k;
    if (m->block) {
        const step corner[4] = {{0, 0}, {last, 0}, {0, last}, {last, last}};
        mark_below(m, corner[a], corner[l], corner[r], 2 * m->query->k, s);
        return;
    }
    const mark_corner ca = summary_corner(m, summary, a), cl = summary_corner(m, summary, l),
                      cr = summary_corner(m, summary, r);
    mark_leaf(m, &ca, &cl, &cr, s);
}

/* The block's vertices by one question for most of them (rule_range_below). */
static rule_range range_of(const rqt_query *query, const rqt_block_place *p) {
    if (query->rule) return rule_range_below(query->rule, (rqt_vertex){p->x + p->side / 2, p->y + p->side / 2});
    return (rule_range){.least = query->eps, .most = query->eps};
}

void rqt_query_mark(const rqt_query *query, const rqt_answer *answer, const rqt_block *block, rqt_cells *cells) {
    marking m = {.query = query,
                 .block = block,
                 .mask = query->outline == RQT_OUTLINE_EXACT ? RQT_OUTLINE : 0,
                 .cells = cells};
    if ((block && block->k != query->k) ||
        rqt_block_locate(&query->lattice, query->k, answer->number, &m.place) != RQT_OK)
        return;
    const rqt_summary *summary = &answer->summary;
    const rqt_block_place *p = &m.place;
    const span all = {0, cells->columns, 0, cells->rows};
    m.range = range_of(query, p);
    /* query.c has the same cases. */
    const int c = (p->i & 1) | (p->j & 1) << 1, from = p->level == 0 ? 0 : c, to = 3 - from;
    for (int h = 0; h < 2; h++) {
        const int which = from ^ (h + 1);
        const mark_corner apex = summary_corner(&m, summary, which), near = summary_corner(&m, summary, from),
                          top = summary_corner(&m, summary, to);
        if (p->level == 0 ||
            rqt_query_selects(query, apex.at, summary->corner[which].error, summary->corner[which].flags)) {
            mark_half(&m, summary, which, from, to, all);
            continue;
        }
        const mark_corner far = {{2 * apex.at.x - near.at.x, 2 * apex.at.y - near.at.y}, summary->far[h].flags};
        mark_leaf(&m, &top, &near, &far, all);
    }
}
