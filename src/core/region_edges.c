/* region_edges.c - the odd pieces of polygon borders, the tree over them, and exact tests.
 *
 * Why odd pieces. A polygon's interior follows the even-odd rule over all its rings. Where two of its edges lie on
 * one another (a hole that shares a side with its shell, an antenna that goes out and comes back) the parity does
 * not change across them: no border is there. So once, when a region is made, the edges are grouped by the line
 * they lie on, and only what an odd number of them covers is kept. Along one line each edge flips the parity at
 * both its ends, so it is enough to sort all ends on the line, drop equal ones in pairs, and join the 1st that is
 * left to the 2nd, the 3rd to the 4th, and so on. That also joins edges that continue each other. The ends are
 * those of edges, integers: nothing is rounded. Pieces of different lines may still cross; that does no harm.
 *
 * What it gives: inside and outside lie on the two sides of every piece. So a piece that passes through an open
 * triangle proves that the interiors meet; and if none does, the triangle lies on one side of everything, and one
 * of its inner points decides.
 *
 * The tests separate convex sets: an open and a closed one are apart iff a line parallel to one of their sides has
 * them on its two sides, touching allowed; two closed ones iff it does so without touching. */
#include "region_edges.h"

/* ----------------------------------------------------------------------------------------------- tests -- */
bool region_triangle_init(region_triangle *t, rqt_vertex a, rqt_vertex b, rqt_vertex c) {
    region_point p = {a.x * REGION_UNIT, a.y * REGION_UNIT};
    region_point q = {b.x * REGION_UNIT, b.y * REGION_UNIT};
    region_point r = {c.x * REGION_UNIT, c.y * REGION_UNIT};
    __int128 area = region_side(p, q, r);
    if (area == 0) return false;
    *t = (region_triangle){.corner = {p, area > 0 ? q : r, area > 0 ? r : q}};
    /* not the centroid: this mean is an integer too */
    t->inner = (region_point){(2 * (int64_t)a.x + b.x + c.x) * (REGION_UNIT / 4),
                              (2 * (int64_t)a.y + b.y + c.y) * (REGION_UNIT / 4)};
    region_piece pq = {p, q}, rr = {r, r};
    region_box corner = region_piece_box(&rr);
    t->box = region_piece_box(&pq);
    region_box_add(&t->box, &corner);
    return true;
}

bool region_triangle_is_crossed(const region_triangle *t, const region_piece *piece) {
    for (int i = 0; i < 3; i++) {
        region_point p = t->corner[i], q = t->corner[(i + 1) % 3];
        if (region_side(p, q, piece->a) <= 0 && region_side(p, q, piece->b) <= 0) return false;
    }
    bool left = false, right = false; /* of the piece */
    for (int i = 0; i < 3; i++) {
        __int128 side = region_side(piece->a, piece->b, t->corner[i]);
        left |= side < 0;
        right |= side > 0;
    }
    /* a point has no line of its own: the sides of the triangle have decided */
    return (left && right) || (piece->a.x == piece->b.x && piece->a.y == piece->b.y);
}

bool region_triangle_is_touched(const region_triangle *t, const region_piece *piece) {
    for (int i = 0; i < 3; i++) {
        region_point p = t->corner[i], q = t->corner[(i + 1) % 3];
        if (region_side(p, q, piece->a) < 0 && region_side(p, q, piece->b) < 0) return false;
    }
    bool left = false, right = false;
    for (int i = 0; i < 3; i++) {
        __int128 side = region_side(piece->a, piece->b, t->corner[i]);
        left |= side <= 0;
        right |= side >= 0;
    }
    return left && right;
}

bool region_triangle_overlaps(const region_triangle *t, const region_box *box) {
    if (!region_boxes_overlap(&t->box, box)) return false;
    for (int i = 0; i < 3; i++) {
        region_point p = t->corner[i], q = t->corner[(i + 1) % 3];
        /* the corner of the box that lies furthest to the triangle's side of p to q */
        region_point far = {q.y > p.y ? box->x0 : box->x1, q.x > p.x ? box->y1 : box->y0};
        if (region_side(p, q, far) <= 0) return false;
    }
    return true;
}

/* The corners of the box on the two sides of a piece that lies obliquely. */
static void box_sides(const region_box *box, const region_piece *piece, __int128 *least, __int128 *most) {
    region_point a = piece->a, b = piece->b;
    region_point low = {b.y > a.y ? box->x1 : box->x0, b.x > a.x ? box->y0 : box->y1};
    region_point high = {b.y > a.y ? box->x0 : box->x1, b.x > a.x ? box->y1 : box->y0};
    *least = region_side(a, b, low);
    *most = region_side(a, b, high);
}

bool region_box_is_crossed(const region_box *box, const region_piece *piece) {
    region_box own = region_piece_box(piece);
    if (!region_boxes_overlap(&own, box)) return false;
    if (own.x0 == own.x1 || own.y0 == own.y1) return true; /* the piece is its own box */
    __int128 least, most;
    box_sides(box, piece, &least, &most);
    return least < 0 && most > 0;
}

bool region_box_is_touched(const region_box *box, const region_piece *piece) {
    region_box own = region_piece_box(piece);
    if (!region_boxes_touch(&own, box)) return false;
    if (own.x0 == own.x1 || own.y0 == own.y1) return true;
    __int128 least, most;
    box_sides(box, piece, &least, &most);
    return least <= 0 && most >= 0;
}

/* ------------------------------------------------------------------------------------------ odd pieces -- */
bool region_pieces_add(region_pieces *pieces, region_piece piece, const rqt_allocator *allocator) {
    void *p = pieces->items;
    if (!memory_grow(allocator, &p, &pieces->capacity, pieces->count + 1, sizeof piece)) return false;
    pieces->items = p;
    pieces->items[pieces->count++] = piece;
    return true;
}

/* One end of an edge: its place, and the line through it. Later one piece: from `place` along `along`. */
typedef struct edge_end {
    region_point place;
    region_point along; /* the edge, pointing to larger x, or to larger y where x does not change */
    size_t order;       /* 2 * edge + which end: different for all */
} edge_end;

/* Below 0, 0 or above: the lines of p and q in some order, 0 for the same line. Directions lie in a half circle, so
 * their cross product orders them; parallel lines are ordered by the side that one has the other on. */
static int compare_lines(const edge_end *p, const edge_end *q) {
    region_point zero = {0, 0};
    __int128 s = region_side(zero, q->along, p->along);
    if (s == 0) {
        region_point ahead = {p->place.x + p->along.x, p->place.y + p->along.y};
        s = region_side(p->place, ahead, q->place);
    }
    return (s > 0) - (s < 0);
}

static int compare_ends(const edge_end *p, const edge_end *q) {
    int line = compare_lines(p, q);
    if (line) return line;
    if (p->place.x != q->place.x) return p->place.x < q->place.x ? -1 : 1;
    return (p->place.y > q->place.y) - (p->place.y < q->place.y);
}

static int compare_order(const edge_end *p, const edge_end *q) {
    return (p->order > q->order) - (p->order < q->order);
}

/* Merge sort with room for as many again: libc's qsort would allocate behind the allocator's back. */
static void sort_ends(edge_end *items, edge_end *room, size_t n,
                      int (*compare)(const edge_end *, const edge_end *)) {
    edge_end *from = items, *to = room;
    for (size_t run = 1; run < n; run *= 2) {
        for (size_t start = 0; start < n; start += 2 * run) {
            size_t middle = n - start < run ? n : start + run;
            size_t end = n - start < 2 * run ? n : start + 2 * run;
            size_t i = start, j = middle;
            for (size_t k = start; k < end; k++) {
                bool left = j == end || (i < middle && compare(&from[i], &from[j]) <= 0);
                to[k] = from[left ? i++ : j++];
            }
        }
        edge_end *swap = from;
        from = to;
        to = swap;
    }
    if (from != items) memcpy(items, from, n * sizeof *items);
}

bool region_odd_pieces(const region_piece *edges, size_t n, region_work *work, region_pieces *out,
                       const rqt_allocator *allocator) {
    if (n > SIZE_MAX / 4 || !memory_grow(allocator, &work->bytes, &work->capacity, 4 * n, sizeof(edge_end)))
        return false;
    edge_end *ends = work->bytes, *room = ends + 2 * n;
    size_t count = 0;
    for (size_t i = 0; i < n; i++) {
        region_point a = edges[i].a, b = edges[i].b;
        if (a.x == b.x && a.y == b.y) continue; /* the rounding took its length */
        bool ahead = a.x != b.x ? a.x < b.x : a.y < b.y;
        region_point along = {ahead ? b.x - a.x : a.x - b.x, ahead ? b.y - a.y : a.y - b.y};
        ends[count++] = (edge_end){a, along, 2 * i};
        ends[count++] = (edge_end){b, along, 2 * i + 1};
    }
    sort_ends(ends, room, count, compare_ends);
    /* Equal neighbours cancel. Each line has an even number of ends, so an even number is left of each. */
    size_t kept = 0;
    for (size_t i = 0; i < count; i++) {
        if (kept > 0 && compare_ends(&ends[kept - 1], &ends[i]) == 0)
            kept--;
        else
            ends[kept++] = ends[i];
    }
    for (size_t i = 0; i < kept / 2; i++) {
        edge_end a = ends[2 * i], b = ends[2 * i + 1];
        ends[i] = (edge_end){a.place, {b.place.x - a.place.x, b.place.y - a.place.y}, a.order};
    }
    sort_ends(ends, room, kept / 2, compare_order); /* back along the rings, where neighbours are near */
    for (size_t i = 0; i < kept / 2; i++) {
        region_point a = ends[i].place, b = {a.x + ends[i].along.x, a.y + ends[i].along.y};
        if (!region_pieces_add(out, (region_piece){a, b}, allocator)) return false;
    }
    return true;
}

/* ------------------------------------------------------------------------------------------------ tree -- */
#define FAMILY 8

size_t region_tree_size(size_t count) {
    size_t size = count;
    while (count > FAMILY) {
        count = (count + FAMILY - 1) / FAMILY;
        size += count;
    }
    return size;
}

void region_tree_build(region_box *nodes, size_t count) {
    while (count > FAMILY) {
        region_box *parents = nodes + count;
        size_t parent_count = (count + FAMILY - 1) / FAMILY;
        for (size_t i = 0; i < parent_count; i++) {
            parents[i] = nodes[i * FAMILY];
            for (size_t j = i * FAMILY + 1; j < count && j < (i + 1) * FAMILY; j++)
                region_box_add(&parents[i], &nodes[j]);
        }
        nodes = parents;
        count = parent_count;
    }
}

void region_search_begin(region_search *s, const region_box *nodes, size_t count, const region_box *box) {
    s->nodes = nodes;
    s->box = *box;
    s->top = 0;
    s->first[0] = 0;
    s->count[0] = count;
    while (count > FAMILY) {
        s->first[s->top + 1] = s->first[s->top] + count;
        count = (count + FAMILY - 1) / FAMILY;
        s->count[++s->top] = count;
    }
    s->level = s->top;
    s->index = 0;
    s->end = count;
}

bool region_search_next(region_search *s, size_t *item) {
    for (;;) {
        if (s->index == s->end) { /* the family is done: go on behind its parent */
            if (s->level == s->top) return false;
            size_t parent = (s->end - 1) / FAMILY;
            s->level++;
            s->index = parent + 1;
            s->end = (parent / FAMILY + 1) * FAMILY;
            if (s->level == s->top || s->end > s->count[s->level]) s->end = s->count[s->level];
            continue;
        }
        size_t i = s->index++;
        if (!region_boxes_touch(&s->nodes[s->first[s->level] + i], &s->box)) continue;
        if (s->level == 0) {
            *item = i;
            return true;
        }
        s->level--;
        s->index = i * FAMILY;
        s->end = s->index + FAMILY;
        if (s->end > s->count[s->level]) s->end = s->count[s->level];
    }
}
