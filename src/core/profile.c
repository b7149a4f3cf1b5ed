/* profile.c - the heights of a mesh along lines.
 *
 * A line is cut into pieces from point to point; after the last point of a line comes a piece without length, so
 * that a piece has its first end and not its last. For each triangle the pieces that come near are found in a tree
 * over their boxes, and each is cut by the triangle exactly, in integers: which corners lie on it, which edges it
 * crosses. What is found is an *event*, and two of a triangle are a *span* in which the mesh is there. An edge is
 * looked at from its corner in the north, west, whichever triangle asks, so both its triangles find the same event,
 * to the last bit, and one is dropped. Sorted along the line, events are the rows; where no span reaches from one
 * to the next there is a gap.
 *
 * Longitudes come round again: a piece is looked for on every turn that meets the raster, and its events on all
 * turns are of one line.
 */
#include "region_edges.h"

#include <math.h>

/* What an event's height is taken from; the first is preferred where several are at a point of the line. */
typedef enum event_source { ON_VERTEX, ON_EDGE, ON_PLANE } event_source;

typedef struct event {
    uint32_t point;
    bool at_point; /* at the first end of its piece; t is 0 then */
    event_source source;
    int32_t turn;
    double t;
    uint32_t from, to; /* the edge's vertices; twice the same: the vertex itself; at a point not looked at */
    double col, row, q;
} event;

typedef struct span {
    uint32_t point;
    double t0, t1;
} span;

typedef struct line_piece {
    region_piece at;
    uint32_t point;
    int32_t turn;
} line_piece;

typedef struct profile {
    const rqt_patch *patch;
    const rqt_profile_line *line;
    const rqt_allocator *allocator;
    line_piece *pieces;
    size_t piece_count, piece_capacity;
    region_box *tree;
    event *events;
    size_t event_count, event_capacity;
    span *spans;
    size_t span_count, span_capacity;
} profile;

/* ------------------------------------------------------------------------------------------------ pieces */

static bool add_piece(profile *p, size_t point, double turn, const region_box *raster) {
    const rqt_profile_line *line = p->line;
    const rqt_placement *at = &line->placement;
    const double *xy = line->xy + 2 * point, by = turn * line->period;
    const size_t next = line->ends[point] ? 0 : 2;
    line_piece new = {.point = (uint32_t)point, .turn = (int32_t)turn};
    new.at.a = (region_point){region_units(xy[0] + by, at->x0, at->dx), region_units(xy[1], at->y0, at->dy)};
    new.at.b =
        (region_point){region_units(xy[next] + by, at->x0, at->dx), region_units(xy[next + 1], at->y0, at->dy)};
    const region_box box = region_piece_box(&new.at);
    if (!region_boxes_touch(&box, raster)) return true;
    if (!memory_grow(p->allocator, (void **)&p->pieces, &p->piece_capacity, p->piece_count + 1, sizeof new))
        return false;
    p->pieces[p->piece_count++] = new;
    return true;
}

static bool make_pieces(profile *p, const rqt_lattice *lattice) {
    const rqt_profile_line *line = p->line;
    const rqt_placement *at = &line->placement;
    const region_box raster = {0, 0, (lattice->width - 1) * REGION_UNIT, (lattice->height - 1) * REGION_UNIT};
    const double end = at->x0 + (lattice->width - 1) * at->dx, low = fmin(at->x0, end), high = fmax(at->x0, end);
    for (size_t i = 0; i < line->points; i++) {
        const double a = line->xy[2 * i], b = line->ends[i] ? a : line->xy[2 * i + 2];
        double first = 0, last = 0;
        if (line->period > 0 && fabs(a) <= 3 * line->period && fabs(b) <= 3 * line->period) {
            first = fmin(0, ceil((low - fmax(a, b)) / line->period));
            last = fmax(0, floor((high - fmin(a, b)) / line->period));
        }
        /* Whole numbers. NOLINTNEXTLINE(clang-analyzer-security.FloatLoopCounter) */
        for (double turn = first; turn <= last; turn++)
            if (!add_piece(p, i, turn, &raster)) return false;
    }
    p->tree = memory_take(p->allocator, region_tree_size(p->piece_count) * sizeof *p->tree);
    if (!p->tree) return false;
    for (size_t i = 0; i < p->piece_count; i++) p->tree[i] = region_piece_box(&p->pieces[i].at);
    region_tree_build(p->tree, p->piece_count);
    return true;
}

/* ------------------------------------------------------------------------------------------------ events */

typedef struct meeting {
    profile *p;
    const line_piece *piece;
    double low, high; /* of t, of what was found in the triangle at hand */
    bool full;        /* no memory */
} meeting;

static void reach(meeting *m, double t) {
    m->low = fmin(m->low, t);
    m->high = fmax(m->high, t);
}

static void add_event(meeting *m, event e) {
    profile *p = m->p;
    reach(m, e.t);
    if (!memory_grow(p->allocator, (void **)&p->events, &p->event_capacity, p->event_count + 1, sizeof e)) {
        m->full = true;
        return;
    }
    e.point = m->piece->point;
    e.turn = m->piece->turn;
    p->events[p->event_count++] = e;
}

static region_point point_of(const rqt_patch_vertex *v) {
    return (region_point){v->col * REGION_UNIT, v->row * REGION_UNIT};
}

static bool is_same(region_point a, region_point b) {
    return a.x == b.x && a.y == b.y;
}

/* A corner on the line of the piece. */
static void meet_vertex(meeting *m, uint32_t vertex) {
    const rqt_patch_vertex *v = &m->p->patch->vertices[vertex];
    const region_point at = point_of(v), a = m->piece->at.a, b = m->piece->at.b;
    const region_box box = region_piece_box(&m->piece->at), here = {at.x, at.y, at.x, at.y};
    if (!region_box_is_within(&here, &box)) return;
    if (is_same(at, b) && !is_same(a, b)) {
        reach(m, 1); /* the next piece has the row */
        return;
    }
    const int64_t dx = b.x - a.x, dy = b.y - a.y;
    const bool along_x = (dx < 0 ? -dx : dx) >= (dy < 0 ? -dy : dy);
    const bool first = is_same(at, a);
    const double t = first ? 0 : along_x ? (double)(at.x - a.x) / (double)dx : (double)(at.y - a.y) / (double)dy;
    add_event(m, (event){.at_point = first,
                         .source = ON_VERTEX,
                         .t = t,
                         .from = vertex,
                         .to = vertex,
                         .col = v->col,
                         .row = v->row,
                         .q = v->q});
}

/* An edge whose corners lie on both sides of the line of the piece. */
static void meet_edge(meeting *m, uint32_t i, uint32_t j) {
    const rqt_patch_vertex *v = m->p->patch->vertices;
    if (v[j].row < v[i].row || (v[j].row == v[i].row && v[j].col < v[i].col)) {
        const uint32_t swap = i;
        i = j;
        j = swap;
    }
    const region_point p = point_of(&v[i]), q = point_of(&v[j]), a = m->piece->at.a, b = m->piece->at.b;
    const __int128 of_a = region_side(p, q, a), of_b = region_side(p, q, b);
    if ((of_a > 0 && of_b > 0) || (of_a < 0 && of_b < 0)) return;
    if (of_b == 0) {
        reach(m, 1);
        return;
    }
    const __int128 of_p = region_side(a, b, p), of_q = region_side(a, b, q);
    const double u = (double)of_p / (double)(of_p - of_q);
    add_event(m, (event){.at_point = of_a == 0,
                         .source = ON_EDGE,
                         .t = of_a == 0 ? 0 : (double)of_a / (double)(of_a - of_b),
                         .from = i,
                         .to = j,
                         .col = v[i].col + u * (v[j].col - v[i].col),
                         .row = v[i].row + u * (v[j].row - v[i].row),
                         .q = v[i].q + u * ((double)v[j].q - v[i].q)});
}

/* A point of the line inside a triangle, or on it when it is all of a piece. */
static void meet_inside(meeting *m, const uint32_t *corner, region_point at) {
    const rqt_patch_vertex *v[3];
    for (int i = 0; i < 3; i++) v[i] = &m->p->patch->vertices[corner[i]];
    const region_point p[3] = {point_of(v[0]), point_of(v[1]), point_of(v[2])};
    double weight[3], q = 0;
    const double area = (double)region_side(p[0], p[1], p[2]);
    for (int i = 0; i < 3; i++) {
        weight[i] = (double)region_side(p[(i + 1) % 3], p[(i + 2) % 3], at) / area;
        q += weight[i] * v[i]->q;
    }
    add_event(m, (event){.at_point = true,
                         .source = ON_PLANE,
                         .from = corner[0],
                         .to = corner[1],
                         .col = (double)at.x / (double)REGION_UNIT,
                         .row = (double)at.y / (double)REGION_UNIT,
                         .q = q});
}

/* 1 inside, 0 on the border, -1 outside. */
static int place_in(const region_point c[3], region_point at) {
    int inside = 0;
    for (int i = 0; i < 3; i++) {
        const __int128 side = region_side(c[i], c[(i + 1) % 3], at);
        if (side < 0) return -1;
        inside += side > 0;
    }
    return inside == 3;
}

static bool meet_triangle(profile *p, const uint32_t *corner, const line_piece *piece) {
    meeting m = {.p = p, .piece = piece, .low = INFINITY, .high = -INFINITY};
    region_point c[3];
    for (int i = 0; i < 3; i++) c[i] = point_of(&p->patch->vertices[corner[i]]);
    if (region_side(c[0], c[1], c[2]) < 0) {
        const region_point swap = c[1];
        c[1] = c[2];
        c[2] = swap;
    }
    /* Pieces come from points. NOLINTNEXTLINE(clang-analyzer-core.NullDereference) */
    const region_point a = piece->at.a, b = piece->at.b;
    const int of_a = place_in(c, a), of_b = place_in(c, b);
    const bool own = p->line->own[piece->point] != 0;
    int side[3];
    for (int i = 0; i < 3; i++) {
        const __int128 s = region_side(a, b, point_of(&p->patch->vertices[corner[i]]));
        side[i] = (s > 0) - (s < 0);
    }
    for (int i = 0; i < 3; i++) {
        if (side[i] == 0) meet_vertex(&m, corner[i]);
        if (side[i] * side[(i + 1) % 3] < 0) meet_edge(&m, corner[i], corner[(i + 1) % 3]);
    }
    /* A point that is not the line's own has a row where it lies on an edge, as any other place; pieces without
     * length, whose corners are all "on their line", are seen to here. */
    if (of_a == 1 ? own : of_a == 0 && (own || is_same(a, b))) meet_inside(&m, corner, a);
    if (of_a >= 0) reach(&m, 0);
    if (of_b >= 0) reach(&m, 1);
    if (m.low < m.high && !m.full) {
        if (!memory_grow(p->allocator, (void **)&p->spans, &p->span_capacity, p->span_count + 1, sizeof(span)))
            return false;
        p->spans[p->span_count++] = (span){piece->point, m.low, m.high};
    }
    return !m.full;
}

/* ----------------------------------------------------------------------------------------------- sorting */

static int compare_events(const void *first, const void *second) {
    const event *a = first, *b = second;
    if (a->point != b->point) return a->point < b->point ? -1 : 1;
    if (a->at_point != b->at_point) return a->at_point ? -1 : 1;
    if (a->t != b->t) return a->t < b->t ? -1 : 1;
    if (a->turn != b->turn) return a->turn < b->turn ? -1 : 1;
    if (a->source != b->source) return a->source < b->source ? -1 : 1;
    if (a->from != b->from) return a->from < b->from ? -1 : 1;
    return (a->to > b->to) - (a->to < b->to);
}

static int compare_spans(const void *first, const void *second) {
    const span *a = first, *b = second;
    if (a->point != b->point) return a->point < b->point ? -1 : 1;
    if (a->t0 != b->t0) return a->t0 < b->t0 ? -1 : 1;
    return (a->t1 > b->t1) - (a->t1 < b->t1);
}

/* Heapsort: in place, no allocation, no recursion. */
static void sort(void *array, size_t n, size_t size, int (*compare)(const void *, const void *)) {
    char *const a = array;
    char swap[sizeof(event) > sizeof(span) ? sizeof(event) : sizeof(span)];
    for (size_t phase = 0; phase < 2; phase++)
        for (size_t step = phase ? n : n / 2; step-- > 0;) {
            size_t root = phase ? 0 : step;
            const size_t end = phase ? step : n;
            if (phase) {
                memcpy(swap, a, size);
                memcpy(a, a + step * size, size);
                memcpy(a + step * size, swap, size);
            }
            for (size_t child; (child = 2 * root + 1) < end; root = child) {
                if (child + 1 < end && compare(a + child * size, a + (child + 1) * size) < 0) child++;
                if (compare(a + root * size, a + child * size) >= 0) break;
                memcpy(swap, a + root * size, size);
                memcpy(a + root * size, a + child * size, size);
                memcpy(a + child * size, swap, size);
            }
        }
}

/* Is b, which comes next after a, nothing new? */
static bool is_again(const event *a, const event *b) {
    if (a->point != b->point || a->turn != b->turn || a->at_point != b->at_point) return false;
    return a->at_point || (a->from == b->from && a->to == b->to && a->t == b->t);
}

/* ------------------------------------------------------------------------------------------------- whole */

/* Follows the spans along the line, as far as they go without a gap. */
typedef struct follower {
    const profile *p;
    size_t next;
} follower;

/* Does the mesh reach from t0 to t1 on a piece? Asked in the order of the line. */
static bool is_covered(follower *f, uint32_t point, double t0, double t1) {
    const profile *p = f->p;
    while (f->next < p->span_count && p->spans[f->next].point < point) f->next++;
    double reached = t0;
    for (size_t i = f->next;
         reached < t1 && i < p->span_count && p->spans[i].point == point && p->spans[i].t0 <= reached; i++) {
        if (p->spans[i].t1 > reached) reached = p->spans[i].t1;
        if (p->spans[i].t1 <= t0 && i == f->next) f->next++; /* over, for all that is to come */
    }
    return reached >= t1;
}

static bool is_gap(follower *f, const event *a, const event *b) {
    if (a->point == b->point) return !is_covered(f, a->point, a->t, b->t);
    const rqt_profile_line *line = f->p->line;
    if (line->ends[a->point] || !is_covered(f, a->point, a->t, 1)) return true;
    for (uint32_t point = a->point + 1; point < b->point; point++) {
        if (line->ends[point] || !is_covered(f, point, 0, 1)) return true;
    }
    return b->t > 0 && !is_covered(f, b->point, 0, b->t);
}

static rqt_status make_rows(profile *p, rqt_profile_row **rows, size_t *count) {
    sort(p->events, p->event_count, sizeof *p->events, compare_events);
    sort(p->spans, p->span_count, sizeof *p->spans, compare_spans);
    rqt_profile_row *out = memory_take(p->allocator, p->event_count * sizeof *out);
    if (!out) return RQT_NO_MEMORY;
    follower f = {.p = p};
    const event *last = NULL;
    for (size_t i = 0; i < p->event_count; i++) {
        const event *e = &p->events[i];
        if (last && is_again(last, e)) continue;
        out[(*count)++] = (rqt_profile_row){.point = e->point,
                                            .turn = e->turn,
                                            .t = e->t,
                                            .at_point = e->at_point,
                                            .after_gap = last && is_gap(&f, last, e),
                                            .col = e->col,
                                            .row = e->row,
                                            .q = e->q};
        last = e;
    }
    *rows = out;
    return RQT_OK;
}

rqt_status rqt_profile_build(const rqt_patch *patch, const rqt_lattice *lattice, const rqt_profile_line *line,
                             const rqt_allocator *allocator, rqt_profile_row **rows, size_t *count) {
    *rows = NULL;
    *count = 0;
    if (line->points > UINT32_MAX) return RQT_INVALID;
    profile p = {.patch = patch, .line = line, .allocator = allocator};
    rqt_status status = make_pieces(&p, lattice) ? RQT_OK : RQT_NO_MEMORY;
    for (size_t t = 0; t < patch->triangle_count && status == RQT_OK; t++) {
        const uint32_t *corner = patch->triangles + 3 * t;
        region_box box = {INT64_MAX, INT64_MAX, INT64_MIN, INT64_MIN};
        for (int i = 0; i < 3; i++) {
            const region_point at = point_of(&patch->vertices[corner[i]]);
            const region_box one = {at.x, at.y, at.x, at.y};
            region_box_add(&box, &one);
        }
        region_search s;
        region_search_begin(&s, p.tree, p.piece_count, &box);
        for (size_t i; status == RQT_OK && region_search_next(&s, &i);)
            if (!meet_triangle(&p, corner, &p.pieces[i])) status = RQT_NO_MEMORY;
    }
    if (status == RQT_OK) status = make_rows(&p, rows, count);
    memory_drop(allocator, p.pieces);
    memory_drop(allocator, p.tree);
    memory_drop(allocator, p.events);
    memory_drop(allocator, p.spans);
    return status;
}
