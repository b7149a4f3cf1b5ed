/* region_squares.c - a union of squares whose sides are powers of two, at multiples of them: what a view may show.
 *
 * A linear quadtree (Gargantini, "An effective way to represent quadtrees", 1982): along the Morton curve a square
 * is an interval, and squares that do not overlap are intervals one after the other. A square is one number, the
 * code of its north-west corner with the logarithm of its side below it; all of them, in order, are an array, and
 * those in any larger square are a part of it, the begin of which a binary search finds. There is no tree to be
 * built, and no border: no edge has to be asked.
 *
 * Four brothers become their parent as they come, so a square is covered iff one of the array holds it: what has
 * been found to be neither that nor empty is across. A box is asked by the smallest square that holds it, and cut
 * along the middle of that where this square is across: most boxes are those of halves of cells, one or two squares
 * by themselves. Triangles go down in the same way, from quarters to quarters that they overlap. */
#include "region_squares.h"

#define LOG_BITS 5

/* A square by its place along the curve. */
typedef struct cell {
    int32_t x, y;
    int log;        /* of the side */
    uint64_t first; /* the code of its corner */
} cell;

static uint64_t area_of(int log) {
    return UINT64_C(1) << 2 * log;
}

static uint64_t first_of(uint64_t key) {
    return key >> LOG_BITS;
}

static uint64_t end_of(uint64_t key) {
    return first_of(key) + area_of((int)(key & ((1 << LOG_BITS) - 1)));
}

rqt_status region_squares_add(region_squares *squares, rqt_square square, const rqt_allocator *allocator) {
    const int32_t side = square.side;
    if (side < 1 || (side & (side - 1)) != 0 || side > 1 << RQT_MAX_K) return RQT_INVALID;
    if (square.x < 0 || square.y < 0 || square.x >= 1 << RQT_MAX_K || square.y >= 1 << RQT_MAX_K)
        return RQT_INVALID;
    if (((square.x | square.y) & (side - 1)) != 0) return RQT_INVALID;
    int log = __builtin_ctz((unsigned)side);
    uint64_t first = morton_code((uint32_t)square.x, (uint32_t)square.y);
    uint64_t *const keys = squares->keys;
    size_t n = squares->count;
    if (n > 0 && first_of(keys[n - 1]) <= first && first + area_of(log) <= end_of(keys[n - 1])) return RQT_OK;
    while (n > 0 && first_of(keys[n - 1]) >= first && end_of(keys[n - 1]) <= first + area_of(log)) n--;
    if (n > 0 && end_of(keys[n - 1]) > first) return RQT_INVALID;
    /* The fourth brother: are the three before it there? */
    while (n >= 3 && (first >> 2 * log & 3) == 3 &&
           keys[n - 3] == ((first - 3 * area_of(log)) << LOG_BITS | (unsigned)log) &&
           keys[n - 2] == ((first - 2 * area_of(log)) << LOG_BITS | (unsigned)log) &&
           keys[n - 1] == ((first - area_of(log)) << LOG_BITS | (unsigned)log)) {
        n -= 3;
        first -= 3 * area_of(log);
        log++;
    }
    if (!memory_grow(allocator, (void **)&squares->keys, &squares->capacity, n + 1, sizeof *keys))
        return RQT_NO_MEMORY;
    squares->keys[n] = first << LOG_BITS | (unsigned)log;
    squares->count = n + 1;
    return RQT_OK;
}

rqt_square region_squares_at(const region_squares *squares, size_t n) {
    const uint64_t key = squares->keys[n], first = first_of(key);
    return (rqt_square){(int32_t)morton_x(first), (int32_t)morton_x(first >> 1),
                        1 << (key & ((1 << LOG_BITS) - 1))};
}

/* A part of the array. */
typedef struct run {
    const uint64_t *begin, *end;
} run;

static const uint64_t *first_not_before(run r, uint64_t code) {
    size_t n = (size_t)(r.end - r.begin);
    while (n > 0) {
        const size_t half = n / 2;
        const bool before = first_of(r.begin[half]) < code;
        r.begin = before ? r.begin + half + 1 : r.begin;
        n = before ? n - half - 1 : half;
    }
    return r.begin;
}

/* How a cell lies to those of a run, which has all that overlap it; the run then begins with the first of them. */
static rqt_relation relation_of(const cell *c, run *r) {
    const uint64_t end = c->first + area_of(c->log);
    const uint64_t *const at = first_not_before(*r, c->first);
    if (at > r->begin && end_of(at[-1]) > c->first) return RQT_INSIDE;
    if (at == r->end || first_of(*at) >= end) return RQT_OUTSIDE;
    if (first_of(*at) == c->first && end_of(*at) >= end) return RQT_INSIDE;
    r->begin = at;
    return RQT_ACROSS;
}

static int32_t least(int32_t a, int32_t b) {
    return a < b ? a : b;
}
static int32_t most(int32_t a, int32_t b) {
    return a > b ? a : b;
}

/* x0 < x1, y0 < y1, none of it before 0. */
static rqt_relation relation_of_box(run r, int32_t x0, int32_t y0, int32_t x1, int32_t y1) {
    const uint32_t differing = (uint32_t)((x0 ^ (x1 - 1)) | (y0 ^ (y1 - 1)));
    const int log = differing ? 32 - __builtin_clz(differing) : 0;
    const int32_t side = 1 << log, x = x0 & -side, y = y0 & -side;
    const cell c = {x, y, log, morton_code((uint32_t)x, (uint32_t)y)};
    const rqt_relation whole = relation_of(&c, &r);
    if (whole != RQT_ACROSS || (x1 - x0 == side && y1 - y0 == side)) return whole;
    const int32_t xs[3] = {x0, most(x0, least(x1, x + side / 2)), x1},
                  ys[3] = {y0, most(y0, least(y1, y + side / 2)), y1};
    bool inside = false, outside = false;
    for (int i = 0; i < 4; i++) {
        const int u = i & 1, v = i >> 1;
        if (xs[u] >= xs[u + 1] || ys[v] >= ys[v + 1]) continue;
        const rqt_relation part = relation_of_box(r, xs[u], ys[v], xs[u + 1], ys[v + 1]);
        inside |= part != RQT_OUTSIDE;
        outside |= part != RQT_INSIDE;
        if (inside && outside) return RQT_ACROSS;
    }
    return inside ? RQT_INSIDE : RQT_OUTSIDE;
}

rqt_relation region_squares_relation(const region_squares *squares, int32_t x0, int32_t y0, int32_t x1,
                                     int32_t y1) {
    const int32_t end = 1 << RQT_MAX_K;
    if (squares->count == 0 || x1 <= 0 || y1 <= 0 || x0 >= end || y0 >= end) return RQT_OUTSIDE;
    const rqt_relation relation = relation_of_box((run){squares->keys, squares->keys + squares->count}, most(x0, 0),
                                                  most(y0, 0), least(x1, end), least(y1, end));
    const bool is_within = x0 >= 0 && y0 >= 0 && x1 <= end && y1 <= end;
    return relation == RQT_INSIDE && !is_within ? RQT_ACROSS : relation;
}

static bool cell_meets(const cell *c, run r, const region_triangle *t) {
    const int32_t side = 1 << c->log;
    const region_box box = {c->x * REGION_UNIT, c->y * REGION_UNIT, (c->x + side) * REGION_UNIT,
                            (c->y + side) * REGION_UNIT};
    if (!region_triangle_overlaps(t, &box)) return false;
    const rqt_relation relation = relation_of(c, &r);
    if (relation != RQT_ACROSS) return relation == RQT_INSIDE;
    for (int i = 0; i < 4; i++) {
        const cell part = {c->x + (i & 1 ? side / 2 : 0), c->y + (i & 2 ? side / 2 : 0), c->log - 1,
                           c->first + (uint64_t)i * area_of(c->log - 1)};
        if (cell_meets(&part, r, t)) return true;
    }
    return false;
}

bool region_squares_meet(const region_squares *squares, const region_triangle *t) {
    /* From the smallest cell that holds its box: triangles are of whole samples. */
    const region_box *box = &t->box;
    const int64_t end = INT64_C(1) << RQT_MAX_K;
    cell c = {0, 0, RQT_MAX_K, 0};
    if (box->x0 >= 0 && box->y0 >= 0 && box->x1 <= end * REGION_UNIT && box->y1 <= end * REGION_UNIT) {
        const uint64_t x0 = (uint64_t)(box->x0 / REGION_UNIT), x1 = (uint64_t)(box->x1 / REGION_UNIT) - 1,
                       y0 = (uint64_t)(box->y0 / REGION_UNIT), y1 = (uint64_t)(box->y1 / REGION_UNIT) - 1;
        while (c.log > 0 && ((x0 ^ x1) | (y0 ^ y1)) >> (c.log - 1) == 0) c.log--;
        c.x = (int32_t)(x0 >> c.log << c.log);
        c.y = (int32_t)(y0 >> c.log << c.log);
        c.first = morton_code((uint32_t)c.x, (uint32_t)c.y);
    }
    return squares->count > 0 && cell_meets(&c, (run){squares->keys, squares->keys + squares->count}, t);
}
