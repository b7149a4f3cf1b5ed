/* cut_faces.c - one leaf of a cut: a triangulation with edges that have to be there, on integers.
 *
 * A point goes where it belongs: into a face, which becomes three, or onto an edge, whose faces become two each;
 * then edges around it that need not stay are turned where that makes faces rounder. A segment between two points
 * is made an edge by taking out all faces that it passes through and filling the two holes on its sides: each is
 * bounded by a chain of edges every vertex of which sees the segment, so that a scan along the chain which closes
 * every corner that turns inward tiles it (Toussaint and Avis, "On a convex hull algorithm for polygons and its
 * application to triangulation problems", 1982). Where it meets a point on its way it goes on from there. Where it
 * crosses an edge that has to stay, both get a point at the crossing, rounded to the grid; the four parts then lead
 * there, a bit off their lines.
 *
 * Why rounding cannot break it. After every step the faces tile the leaf, share whole edges and have an area above
 * 0: steps are decided with the points as they are, never with the places they should have. What rounding moves is
 * where borders run, by about a unit per crossing. A crossing is kept off the leaf's sides, which neighbours share:
 * of the four grid points around it one at least is inside as far as one side goes; where two sides meet in an
 * angle so sharp that all four are out, the corner is as near.
 */
#include "cut.h"

/* n * part / whole; large ones by long multiplication and division at once, a bit of n at a time: no step exceeds
 * 2^127. */
uint64_t cut_share(uint64_t n, __int128 part, __int128 whole) {
    if (part >> (126 - 64 + __builtin_clzll(n | 1)) ==
        0) { /* the product is no more than 2^126 either: nearly always */
        const __int128 product = (__int128)n * part, share = product / whole;
        return (uint64_t)share + (2 * (product - share * whole) >= whole);
    }
    uint64_t quotient = 0;
    __int128 rest = 0;
    for (int bit = 63; bit >= 0; bit--) {
        quotient *= 2;
        rest *= 2;
        if (rest >= whole) {
            rest -= whole;
            quotient++;
        }
        if (n >> bit & 1) rest += part;
        if (rest >= whole) {
            rest -= whole;
            quotient++;
        }
    }
    return quotient + (2 * rest >= whole);
}

void cut_faces_free(cut_faces *f) {
    const rqt_allocator *a = &f->allocator;
    memory_drop(a, f->points);
    memory_drop(a, f->face_of);
    memory_drop(a, f->faces);
    memory_drop(a, f->rim[0]);
    memory_drop(a, f->rim[1]);
    memory_drop(a, f->stack);
    memory_drop(a, f->hole);
    memory_drop(a, f->pairs);
}

/* The array grown to hold `need` elements; it may move. */
#define ROOM(f, array, capacity, need) \
    memory_grow(&(f)->allocator, (void **)&(f)->array, &(f)->capacity, need, sizeof *(f)->array)

static bool new_point(cut_faces *f, region_point place, uint32_t *point) {
    if (!ROOM(f, points, point_capacity, f->point_count + 1) ||
        !ROOM(f, face_of, face_of_capacity, f->point_count + 1))
        return false;
    *point = (uint32_t)f->point_count;
    f->points[f->point_count++] = place;
    return true;
}

static int next_corner(int i) {
    return i == 2 ? 0 : i + 1;
}

/* Make a face of a place of the array; sides are set by the caller. */
static void put_face(cut_faces *f, uint32_t face, uint32_t a, uint32_t b, uint32_t c) {
    f->faces[face] = (cut_face){.corner = {a, b, c}, .next = {CUT_NO_FACE, CUT_NO_FACE, CUT_NO_FACE}};
    f->face_of[a] = f->face_of[b] = f->face_of[c] = face;
}

/* Side i of a face is the edge between it and `other` (CUT_NO_FACE: none); of the other face, which has the edge
 * already, the side is found. */
static void join(cut_faces *f, uint32_t face, int i, uint32_t other, bool fixed) {
    cut_face *t = &f->faces[face];
    t->next[i] = other;
    t->fixed[i] = fixed;
    if (other == CUT_NO_FACE) return;
    cut_face *o = &f->faces[other];
    const uint32_t from = t->corner[i], to = t->corner[next_corner(i)];
    for (int k = 0; k < 3; k++)
        if (o->corner[k] == to && o->corner[next_corner(k)] == from) {
            o->next[k] = face;
            o->fixed[k] = fixed;
        }
}

bool cut_faces_begin(cut_faces *f, const region_point corner[3]) {
    f->point_count = 0;
    f->face_count = 1;
    f->last = 0;
    f->patience = 64;
    f->is_sound = true;
    uint32_t p;
    for (int i = 0; i < 3; i++)
        if (!new_point(f, corner[i], &p)) return false;
    if (!ROOM(f, faces, face_capacity, 1)) return false;
    put_face(f, 0, 0, 1, 2);
    return true;
}

/* ---------------------------------------------------------------------------------------------- points */

/* How many sides of the face have the place on their other side; *side: one of them. */
static bool is_beyond(const cut_faces *f, const cut_face *t, region_point place, int first, int *side) {
    for (int n = 0, i = first; n < 3; n++, i = next_corner(i)) {
        if (region_side(f->points[t->corner[i]], f->points[t->corner[next_corner(i)]], place) >= 0) continue;
        *side = i;
        return true;
    }
    return false;
}

/* A face whose closed triangle holds the place. From face to face towards it: which of two sides is tried first
 * changes, so that nothing goes round in circles for long; and if it does, all are looked at. */
static uint32_t find_face(cut_faces *f, region_point place) {
    uint32_t face = f->last;
    int side = 0;
    for (size_t steps = 0; steps < 4 * f->face_count + 8; steps++) {
        f->turn = f->turn * 1664525u + 1013904223u;
        const cut_face *t = &f->faces[face];
        if (!is_beyond(f, t, place, (int)((f->turn >> 16) % 3), &side)) return face;
        if (t->next[side] == CUT_NO_FACE) break;
        face = t->next[side];
    }
    for (face = 0; face < f->face_count; face++)
        if (!is_beyond(f, &f->faces[face], place, 0, &side)) return face;
    return CUT_NO_FACE;
}

/* A face becomes two by a point on its side i; what is beyond that side is joined by the caller. *second: the part
 * behind the point. */
static void halve(cut_faces *f, uint32_t face, int i, uint32_t point, uint32_t second) {
    const cut_face old = f->faces[face];
    const int j = next_corner(i), k = next_corner(j);
    const uint32_t a = old.corner[i], b = old.corner[j], c = old.corner[k];
    put_face(f, face, a, point, c);
    put_face(f, second, point, b, c);
    join(f, face, 2, old.next[k], old.fixed[k]);
    join(f, second, 1, old.next[j], old.fixed[j]);
    join(f, face, 1, second, false);
}

static void split_edge(cut_faces *f, uint32_t face, int i, uint32_t point) {
    const uint32_t beyond = f->faces[face].next[i], second = (uint32_t)f->face_count++;
    const bool fixed = f->faces[face].fixed[i];
    const uint32_t a = f->faces[face].corner[i];
    uint32_t far = CUT_NO_FACE;
    if (beyond != CUT_NO_FACE) {
        int m = 0;
        while (f->faces[beyond].corner[next_corner(m)] != a || f->faces[beyond].next[m] != face) m++;
        far = (uint32_t)f->face_count++;
        halve(f, beyond, m, point, far); /* beyond: from the edge's end to the point; far: from the point to a */
    }
    halve(f, face, i, point, second);
    join(f, face, 0, far, fixed);
    join(f, second, 0, beyond, fixed);
}

static void split_face(cut_faces *f, uint32_t face, uint32_t point) {
    const cut_face old = f->faces[face];
    const uint32_t part[3] = {face, (uint32_t)f->face_count, (uint32_t)f->face_count + 1};
    f->face_count += 2;
    for (int i = 0; i < 3; i++) put_face(f, part[i], old.corner[i], old.corner[next_corner(i)], point);
    for (int i = 0; i < 3; i++) {
        join(f, part[i], 0, old.next[i], old.fixed[i]);
        join(f, part[i], 1, part[next_corner(i)], false);
    }
}

static int corner_of(const cut_face *t, uint32_t point) {
    return t->corner[0] == point ? 0 : t->corner[1] == point ? 1 : 2;
}

/* ---------------------------------------------------------------------------------------------- shape */

/* Is p well within the circle through a, b, c? In doubles: a wrong answer costs beauty only. */
static bool is_in_circle(region_point a, region_point b, region_point c, region_point p) {
    const double ax = (double)(a.x - p.x), ay = (double)(a.y - p.y), bx = (double)(b.x - p.x),
                 by = (double)(b.y - p.y), cx = (double)(c.x - p.x), cy = (double)(c.y - p.y);
    const double one = (ax * ax + ay * ay) * (bx * cy - cx * by), two = (bx * bx + by * by) * (cx * ay - ax * cy),
                 three = (cx * cx + cy * cy) * (ax * by - bx * ay);
    const double size = (one < 0 ? -one : one) + (two < 0 ? -two : two) + (three < 0 ? -three : three);
    return one + two + three > 1e-9 * size;
}

/* The edge opposite to a new point, if it need not stay, gives way to the other diagonal where that makes rounder
 * faces (Lawson). *other: the face beyond, when it did. */
static bool flip(cut_faces *f, uint32_t face, uint32_t point, uint32_t *other) {
    const cut_face t = f->faces[face];
    const int k = corner_of(&t, point), i = next_corner(k), j = next_corner(i);
    if (t.fixed[i] || t.next[i] == CUT_NO_FACE) return false;
    *other = t.next[i];
    const cut_face n = f->faces[*other];
    const uint32_t a = t.corner[i], b = t.corner[j];
    const int from_a = corner_of(&n, a), from_o = next_corner(from_a);
    const uint32_t o = n.corner[from_o];
    const region_point *p = f->points;
    if (region_side(p[a], p[o], p[point]) <= 0 || region_side(p[o], p[b], p[point]) <= 0) return false;
    if (!is_in_circle(p[a], p[b], p[point], p[o])) return false;
    put_face(f, face, a, o, point);
    put_face(f, *other, o, b, point);
    join(f, face, 0, n.next[from_a], n.fixed[from_a]);
    join(f, face, 2, t.next[k], t.fixed[k]);
    join(f, *other, 0, n.next[from_o], n.fixed[from_o]);
    join(f, *other, 1, t.next[j], t.fixed[j]);
    join(f, face, 1, *other, false);
    return true;
}

/* Slivers make long ways through many faces, and ugly meshes. Faces that have the new point are in f->pairs; how
 * often is bounded, as doubles could go round in circles. */
static bool make_round(cut_faces *f, uint32_t point) {
    for (int flips = 0; f->pair_count > 0 && flips < 256;) {
        const uint32_t face = f->pairs[--f->pair_count];
        uint32_t other;
        if (!flip(f, face, point, &other)) continue;
        flips++;
        if (!ROOM(f, pairs, pair_capacity, f->pair_count + 2)) return false;
        f->pairs[f->pair_count++] = face;
        f->pairs[f->pair_count++] = other;
    }
    return true;
}

bool cut_faces_add(cut_faces *f, region_point place, uint32_t *point) {
    const uint32_t face = find_face(f, place);
    *point = 0;
    if (face == CUT_NO_FACE) return true; /* no caller asks for a place outside */
    f->last = face;
    const cut_face *t = &f->faces[face];
    int on = -1;
    for (int i = 0; i < 3; i++) {
        const region_point *p = &f->points[t->corner[i]];
        if (p->x == place.x && p->y == place.y) {
            *point = t->corner[i];
            return true;
        }
        if (region_side(*p, f->points[t->corner[next_corner(i)]], place) == 0) on = i;
    }
    if (!ROOM(f, faces, face_capacity, f->face_count + 2) || !ROOM(f, pairs, pair_capacity, 4) ||
        !new_point(f, place, point))
        return false;
    f->pair_count = 0;
    f->pairs[f->pair_count++] = face;
    const uint32_t beyond = on >= 0 ? f->faces[face].next[on] : CUT_NO_FACE;
    if (beyond != CUT_NO_FACE) f->pairs[f->pair_count++] = beyond;
    uint32_t fresh = (uint32_t)f->face_count;
    if (on >= 0)
        split_edge(f, face, on, *point);
    else
        split_face(f, face, *point);
    while (fresh < f->face_count) f->pairs[f->pair_count++] = fresh++;
    return make_round(f, *point);
}

/* ------------------------------------------------------------------------------------------------ edges */

static bool is_ahead(region_point a, region_point b, region_point p) {
    return (__int128)(b.x - a.x) * (p.x - a.x) + (__int128)(b.y - a.y) * (p.y - a.y) > 0;
}

/* How a segment leaves the point it begins at. */
typedef struct departure {
    uint32_t face;
    int at;         /* which corner of the face the point is */
    uint32_t along; /* the point that an edge in its direction leads to; CUT_NO_FACE: it passes between two */
} departure;

static departure depart(const cut_faces *f, uint32_t from, uint32_t to) {
    const region_point a = f->points[from], b = f->points[to];
    const uint32_t first = f->face_of[from];
    uint32_t face = first;
    bool back = false; /* the leaf's side was met going one way round: now the other */
    for (;;) {
        const cut_face *t = &f->faces[face];
        const int i = corner_of(t, from), j = next_corner(i), k = next_corner(j);
        const region_point l = f->points[t->corner[j]], r = f->points[t->corner[k]];
        const __int128 left = region_side(a, l, b), right = region_side(a, r, b);
        if (left == 0 && is_ahead(a, b, l)) return (departure){face, i, t->corner[j]};
        if (right == 0 && is_ahead(a, b, r)) return (departure){face, i, t->corner[k]};
        if (left > 0 && right < 0) return (departure){face, i, CUT_NO_FACE};
        uint32_t next = t->next[back ? i : k];
        if (next == CUT_NO_FACE && !back) {
            back = true;
            const cut_face *s = &f->faces[first];
            next = s->next[corner_of(s, from)];
        }
        face = next;
    }
}

static void set_fixed(cut_faces *f, uint32_t from, uint32_t to, bool fixed) {
    const departure d = depart(f, from, to);
    if (d.along != to) return; /* there is no such edge any more */
    cut_face *t = &f->faces[d.face];
    const int i = t->corner[next_corner(d.at)] == to ? d.at : next_corner(next_corner(d.at));
    join(f, d.face, i, t->next[i], fixed);
}

static bool push_rim(cut_faces *f, int which, uint32_t to, const cut_face *t, int side) {
    if (!ROOM(f, rim[which], rim_capacity[which], f->rim_count[which] + 1)) return false;
    f->rim[which][f->rim_count[which]++] = (cut_rim){.to = to, .face = t->next[side], .fixed = t->fixed[side]};
    return true;
}

/* What stopped the way of a segment. */
typedef struct arrival {
    uint32_t point; /* it reached this point; CUT_NO_FACE: it crosses the edge l-r, which has to stay */
    uint32_t l, r;
} arrival;

/* Follow a segment from face to face; the faces and the rims of the hole they leave are noted. */
static bool follow(cut_faces *f, uint32_t from, uint32_t to, const departure *d, arrival *end) {
    const region_point a = f->points[from], b = f->points[to];
    uint32_t face = d->face;
    int e = next_corner(d->at); /* the side that is crossed */
    f->hole_count = f->rim_count[0] = f->rim_count[1] = 0;
    const cut_face *t = &f->faces[face];
    uint32_t l = t->corner[e], r = t->corner[next_corner(e)];
    if (!ROOM(f, hole, hole_capacity, 1)) return false;
    f->hole[f->hole_count++] = face;
    if (!push_rim(f, 0, l, t, d->at) || !push_rim(f, 1, r, t, next_corner(e))) return false;
    for (;;) {
        if (f->faces[face].fixed[e]) {
            *end = (arrival){CUT_NO_FACE, l, r};
            return true;
        }
        const uint32_t next = f->faces[face].next[e];
        t = &f->faces[next];
        const int shared = corner_of(t, r), to_o = next_corner(shared), from_o = next_corner(to_o);
        const uint32_t o = t->corner[from_o];
        if (!ROOM(f, hole, hole_capacity, f->hole_count + 1)) return false;
        f->hole[f->hole_count++] = next;
        const __int128 side = region_side(a, b, f->points[o]);
        face = next;
        if (side <= 0 && !push_rim(f, 0, o, t, to_o)) return false;
        if (side >= 0 && !push_rim(f, 1, o, t, from_o)) return false;
        if (side == 0) {
            *end = (arrival){o, l, r};
            return true;
        }
        e = side < 0 ? from_o : to_o;
        if (side < 0)
            l = o;
        else
            r = o;
    }
}

/* Two faces of the hole may share an edge that both holes' rims run along, there and back: each comes before or
 * after the other, so the first to come waits. */
static bool join_loose(cut_faces *f, uint32_t face, int i) {
    const uint32_t from = f->faces[face].corner[i], to = f->faces[face].corner[next_corner(i)];
    for (size_t n = f->pair_count; n-- > 0;) {
        const uint32_t *pair = f->pairs + 2 * n;
        const cut_face *t = &f->faces[pair[0]];
        if (t->corner[pair[1]] != to || t->corner[next_corner((int)pair[1])] != from) continue;
        join(f, face, i, pair[0], f->faces[face].fixed[i]);
        memmove(f->pairs + 2 * n, f->pairs + 2 * n + 2, 2 * (f->pair_count - n - 1) * sizeof *f->pairs);
        f->pair_count--;
        return true;
    }
    if (!ROOM(f, pairs, pair_capacity, 2 * (f->pair_count + 1))) return false;
    f->pairs[2 * f->pair_count] = face;
    f->pairs[2 * f->pair_count + 1] = (uint32_t)i;
    f->pair_count++;
    return true;
}

static bool join_rim(cut_faces *f, uint32_t face, int i, const cut_rim *rim) {
    f->faces[face].fixed[i] = rim->fixed;
    if (rim->loose) return join_loose(f, face, i);
    join(f, face, i, rim->face, rim->fixed);
    return true;
}

/* Fill one side: the chain from a point along `rim`, whose last edge leads back to the hole's other end. *used: how
 * many faces of the hole are taken again. *base: the face at the segment. */
static bool fill(cut_faces *f, uint32_t start, const cut_rim *rim, size_t count, size_t *used, uint32_t *base) {
    if (!ROOM(f, stack, stack_capacity, count + 1)) return false;
    cut_rim *s = f->stack;
    size_t n = 0;
    s[n++] = (cut_rim){.to = start};
    for (size_t i = 0; i < count; i++) {
        s[n++] = rim[i];
        while (n >= 3 && region_side(f->points[s[n - 3].to], f->points[s[n - 2].to], f->points[s[n - 1].to]) > 0) {
            const uint32_t face = f->hole[(*used)++];
            const cut_rim second = s[n - 1], first = s[n - 2];
            put_face(f, face, s[n - 3].to, first.to, second.to);
            if (!join_rim(f, face, 0, &first) || !join_rim(f, face, 1, &second)) return false;
            s[n - 2] = (cut_rim){.to = second.to, .face = face};
            n--;
        }
    }
    *base = s[1].face;
    return true;
}

/* The rim's faces that are of the hole themselves. */
static void mark_loose(cut_faces *f) {
    f->mark++;
    for (size_t i = 0; i < f->hole_count; i++) f->faces[f->hole[i]].mark = f->mark;
    for (int which = 0; which < 2; which++)
        for (size_t i = 0; i < f->rim_count[which]; i++) {
            cut_rim *rim = &f->rim[which][i];
            rim->loose = rim->face != CUT_NO_FACE && f->faces[rim->face].mark == f->mark;
        }
}

/* The segment from `from` to `to`, which passes through the faces noted, becomes an edge. */
static bool make_edge(cut_faces *f, uint32_t from, uint32_t to) {
    mark_loose(f);
    f->pair_count = 0;
    /* The rim on the right runs from the far end back: turn it round, and with it what its edges lead to. */
    cut_rim *right = f->rim[1];
    const size_t n = f->rim_count[1];
    for (size_t i = 0, j = n - 1; i < j; i++, j--) {
        const cut_rim swap = right[i];
        right[i] = right[j];
        right[j] = swap;
    }
    for (size_t i = 0; i + 1 < n; i++) right[i].to = right[i + 1].to;
    right[n - 1].to = from;
    size_t used = 0;
    uint32_t left_base = 0, right_base = 0;
    if (!fill(f, from, f->rim[0], f->rim_count[0], &used, &left_base) || !fill(f, to, right, n, &used, &right_base))
        return false;
    join(f, left_base, 2, right_base, true);
    f->last = left_base;
    return true;
}

/* The whole numbers below and above the place that a share of a way leads to. */
static void share_between(int64_t from, int64_t to, __int128 part, __int128 whole, int64_t *nearest) {
    const uint64_t way = (uint64_t)(to > from ? to - from : from - to), share = cut_share(way, part, whole);
    *nearest = to > from ? from + (int64_t)share : from - (int64_t)share;
}

static bool is_strictly_inside(const cut_faces *f, region_point p) {
    for (int i = 0; i < 3; i++)
        if (region_side(f->points[i], f->points[next_corner(i)], p) <= 0) return false;
    return true;
}

static int64_t distance(region_point p, region_point q) {
    const int64_t x = p.x > q.x ? p.x - q.x : q.x - p.x, y = p.y > q.y ? p.y - q.y : q.y - p.y;
    return x > y ? x : y;
}

/* The point for the crossing of segment a-b with the edge c-d, which it crosses inside both. */
static bool add_crossing(cut_faces *f, uint32_t a, uint32_t b, uint32_t c, uint32_t d, uint32_t *point) {
    const region_point p = f->points[a], q = f->points[b];
    __int128 part = region_side(f->points[c], f->points[d], p), rest = region_side(f->points[c], f->points[d], q);
    if (part < 0) part = -part;
    if (rest < 0) rest = -rest;
    region_point nearest;
    share_between(p.x, q.x, part, part + rest, &nearest.x);
    share_between(p.y, q.y, part, part + rest, &nearest.y);
    /* The place itself is less than a unit away: the four grid points around it are among these nine. */
    static const int step[9][2] = {{0, 0}, {1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, -1}, {1, -1}, {-1, 1}};
    for (int i = 0; i < 9; i++) {
        const region_point place = {nearest.x + step[i][0], nearest.y + step[i][1]};
        if (is_strictly_inside(f, place)) return cut_faces_add(f, place, point);
    }
    *point = 0;
    for (uint32_t i = 1; i < 3; i++)
        if (distance(f->points[i], nearest) < distance(f->points[*point], nearest)) *point = i;
    return true;
}

static bool fix(cut_faces *f, uint32_t from, uint32_t to, int depth) {
    while (from != to) {
        const departure d = depart(f, from, to);
        if (d.along != CUT_NO_FACE) {
            set_fixed(f, from, d.along, true);
            from = d.along;
            continue;
        }
        arrival end;
        if (!follow(f, from, to, &d, &end)) return false;
        if (end.point != CUT_NO_FACE) {
            if (!make_edge(f, from, end.point)) return false;
            from = end.point;
            continue;
        }
        if (f->patience == 0 || depth == 0) {
            f->is_sound = false;
            return true;
        }
        f->patience--;
        uint32_t at;
        if (!add_crossing(f, from, to, end.l, end.r, &at)) return false;
        if (at != end.l && at != end.r) { /* the edge that has to stay goes by the point instead */
            set_fixed(f, end.l, end.r, false);
            if (!fix(f, end.l, at, depth - 1) || !fix(f, at, end.r, depth - 1)) return false;
        }
        if (at == from) continue;
        if (!fix(f, from, at, depth - 1)) return false;
        from = at;
    }
    return true;
}

/* Each crossing adds a point, or leads a segment over one that is there. That it ends after as many as there are
 * crossings of pieces, and the few that rounding adds, is what happens, not what is proved: so it stops when it has
 * followed many more, or deeper ones, than that. The faces are sound then as at any time; a border is not an edge
 * everywhere. */
bool cut_faces_fix(cut_faces *f, uint32_t from, uint32_t to) {
    f->patience += f->point_count + 64;
    return fix(f, from, to, 40);
}
