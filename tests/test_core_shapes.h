/* test_core_shapes.h - regions as unions of triangles, for oracles of rules and of mode `border`.
 *
 * Shapes are drawn on a grid of quarters of a sample: rectangles, polygons of several rectangular rings whose
 * parities add up, triangles with a hole that touches their sides, lines, points. Beside the text that the core
 * reads, a shape knows its members as triangles that do not overlap: rings are never looked at again, and every
 * question is one of convex sets. */
#ifndef TEST_CORE_SHAPES_H
#define TEST_CORE_SHAPES_H

#include "test_core_walk.h"

enum { QUARTERS = 4, MOST_PIECES = 400, MOST_MEMBERS = 3, MOST_SEGMENTS = 4 };

typedef struct shape_piece {
    oracle_point corner[3]; /* quarters of a sample */
    int member;
} shape_piece;

typedef struct shape {
    char text[4096];
    size_t used;
    shape_piece piece[MOST_PIECES];
    int piece_count, member_count;
    oracle_point segment[MOST_SEGMENTS][2];
    int segment_count;
} shape;

static inline void shape_write(shape *s, const char *format, ...) __attribute__((format(printf, 2, 3)));
static inline void shape_write(shape *s, const char *format, ...) {
    va_list list;
    va_start(list, format);
    const int n = vsnprintf(s->text + s->used, sizeof s->text - s->used, format, list);
    va_end(list);
    if (n < 0 || (size_t)n >= sizeof s->text - s->used) abort();
    s->used += (size_t)n;
}

static inline void shape_ring(shape *s, const oracle_point *p, int n) {
    for (int i = 0; i <= n; i++)
        shape_write(s, "%s%.17g %.17g", i ? ", " : "(", p[i % n].x / 4.0, p[i % n].y / 4.0);
    shape_write(s, ")");
}

static inline void shape_add(shape *s, int member, oracle_point a, oracle_point b, oracle_point c) {
    if (s->piece_count == MOST_PIECES) abort();
    s->piece[s->piece_count++] = (shape_piece){{a, b, c}, member};
}

static inline int compare_ints(const void *a, const void *b) {
    return *(const int *)a - *(const int *)b;
}

/* A polygon of the rings of n rectangles (x0 y0 x1 y1): what an odd number of them holds. */
static inline void shape_polygon_of_rectangles(shape *s, const int (*r)[4], int n) {
    int x[16], y[16];
    shape_write(s, "(");
    for (int i = 0; i < n; i++) {
        const oracle_point ring[4] = {
            {r[i][0], r[i][1]}, {r[i][2], r[i][1]}, {r[i][2], r[i][3]}, {r[i][0], r[i][3]}};
        const oracle_point back[4] = {ring[0], ring[3], ring[2], ring[1]};
        if (i) shape_write(s, ", ");
        shape_ring(s, random_between(0, 1) ? ring : back, 4);
        x[2 * i] = r[i][0], x[2 * i + 1] = r[i][2];
        y[2 * i] = r[i][1], y[2 * i + 1] = r[i][3];
    }
    shape_write(s, ")");
    qsort(x, (size_t)(2 * n), sizeof *x, compare_ints);
    qsort(y, (size_t)(2 * n), sizeof *y, compare_ints);
    const int before = s->piece_count;
    for (int v = 0; v + 1 < 2 * n; v++)
        for (int u = 0; u + 1 < 2 * n; u++) {
            int odd = 0;
            if (x[u] == x[u + 1] || y[v] == y[v + 1]) continue;
            for (int i = 0; i < n; i++)
                odd ^= r[i][0] <= x[u] && x[u + 1] <= r[i][2] && r[i][1] <= y[v] && y[v + 1] <= r[i][3];
            if (!odd) continue;
            const oracle_point nw = {x[u], y[v]}, ne = {x[u + 1], y[v]}, sw = {x[u], y[v + 1]},
                               se = {x[u + 1], y[v + 1]};
            shape_add(s, s->member_count, nw, ne, se);
            shape_add(s, s->member_count, nw, se, sw);
        }
    if (s->piece_count > before) s->member_count++;
}

/* A triangle at even quarters, with the hole between the middles of its sides or without. */
static inline void shape_polygon_of_triangle(shape *s, const oracle_point t[3], int hole) {
    const oracle_point middle[3] = {{(t[1].x + t[2].x) / 2, (t[1].y + t[2].y) / 2},
                                    {(t[0].x + t[2].x) / 2, (t[0].y + t[2].y) / 2},
                                    {(t[0].x + t[1].x) / 2, (t[0].y + t[1].y) / 2}};
    shape_write(s, "(");
    shape_ring(s, t, 3);
    if (hole) {
        shape_write(s, ", ");
        shape_ring(s, middle, 3);
        for (int c = 0; c < 3; c++) shape_add(s, s->member_count, t[c], middle[(c + 1) % 3], middle[(c + 2) % 3]);
    } else {
        shape_add(s, s->member_count, t[0], t[1], t[2]);
    }
    shape_write(s, ")");
    s->member_count++;
}

static inline int random_quarter(int samples, int grain) {
    return random_between(-2 * QUARTERS / grain, (samples + 1) * QUARTERS / grain) * grain;
}

static inline void random_quarters(int width, int height, int r[4]) {
    static const int grains[] = {1, 2, 4};
    const int grain = grains[random_between(0, 2)];
    do {
        for (int n = 0; n < 4; n++) r[n] = random_quarter(n % 2 ? height : width, grain);
        for (int n = 0; n < 2; n++)
            if (r[n] > r[n + 2]) {
                const int swap = r[n];
                r[n] = r[n + 2];
                r[n + 2] = swap;
            }
    } while (r[0] == r[2] || r[1] == r[3]);
}

static inline void shape_line(shape *s, int width, int height) {
    const int n = random_between(1, MOST_SEGMENTS);
    oracle_point at = {random_quarter(width, 1), random_quarter(height, 1)};
    shape_write(s, "LINESTRING(%.17g %.17g", at.x / 4.0, at.y / 4.0);
    for (int i = 0; i < n; i++) {
        oracle_point to = {random_quarter(width, 1), random_quarter(height, 1)};
        if (random_between(0, 2) == 0) to.x = at.x;
        if (random_between(0, 2) == 0) to.y = at.y;
        shape_write(s, ", %.17g %.17g", to.x / 4.0, to.y / 4.0);
        s->segment[i][0] = at;
        s->segment[i][1] = to;
        at = to;
    }
    shape_write(s, ")");
    s->segment_count = n;
}

static inline void shape_triangle(shape *s, int width, int height) {
    oracle_point t[3];
    do
        for (int c = 0; c < 3; c++) t[c] = (oracle_point){random_quarter(width, 2), random_quarter(height, 2)};
    while ((t[1].x - t[0].x) * (t[2].y - t[0].y) == (t[2].x - t[0].x) * (t[1].y - t[0].y));
    shape_polygon_of_triangle(s, t, random_between(0, 1));
}

enum {
    SHAPE_RECTANGLE,
    SHAPE_RINGS,
    SHAPE_TRIANGLES,
    SHAPE_COVERED,
    SHAPE_LINE,
    SHAPE_POINT,
    SHAPE_BOTH,
    SHAPE_KINDS
};

static inline void random_shape(shape *s, int kind, int width, int height) {
    int r[4][4], n = 1;
    memset(s, 0, sizeof *s);
    for (int i = 0; i < 4; i++) random_quarters(width, height, r[i]);
    switch (kind) {
    case SHAPE_RINGS: /* holes and islands, inside, across and outside of the shell, some sharing corners and sides
                       */
        n = random_between(2, 4);
        for (int i = 1; i < n; i++)
            for (int c = 0; c < 4; c++)
                if (random_between(0, 3) == 0 && (c < 2 ? r[i - 1][c] < r[i][c + 2] : r[i - 1][c] > r[i][c - 2]))
                    r[i][c] = r[i - 1][c];
        /* fall through */
    case SHAPE_RECTANGLE:
        shape_write(s, "POLYGON");
        shape_polygon_of_rectangles(s, (const int(*)[4])r, n);
        break;
    case SHAPE_COVERED: /* a hole that covers all */
        memcpy(r[1], r[0], sizeof r[0]);
        shape_write(s, "POLYGON");
        shape_polygon_of_rectangles(s, (const int(*)[4])r, 2);
        break;
    case SHAPE_TRIANGLES:
        shape_write(s, "MULTIPOLYGON(");
        shape_triangle(s, width, height);
        if (random_between(0, 1)) {
            shape_write(s, ", ");
            shape_triangle(s, width, height);
        }
        shape_write(s, ")");
        break;
    case SHAPE_LINE:
        shape_line(s, width, height);
        break;
    case SHAPE_POINT:
        shape_write(s, "POINT(%.17g %.17g)", r[0][0] / 4.0, r[0][1] / 4.0);
        s->segment[0][0] = s->segment[0][1] = (oracle_point){r[0][0], r[0][1]};
        s->segment_count = 1;
        break;
    default:
        shape_write(s, "GEOMETRYCOLLECTION(");
        shape_line(s, width, height);
        shape_write(s, ", POLYGON");
        shape_polygon_of_rectangles(s, (const int(*)[4])r, 1);
        shape_write(s, ")");
    }
}

static inline rqt_region *region_of_shape(const shape *s, const rqt_lattice *lattice) {
    rqt_geometry *geometry = NULL;
    rqt_region *region = NULL;
    rqt_message message = {""};
    CHECK(rqt_geometry_parse(s->text, s->used, true, &test_allocator, &geometry, &message) == RQT_OK, "%s: %s",
          s->text, message.text);
    assert_int_equal(rqt_region_create(geometry, &AT_ORIGIN, lattice, &test_allocator, &region), RQT_OK);
    rqt_geometry_free(geometry);
    return region;
}

/* --------------------------------------------------------------------------------------- questions -- */

/* Is the closed convex set of n points (1, 2 or 3) apart from the closed box x0 y0 x1 y1? A line along a side of
 * one of them then parts them. */
static inline int apart_from_box(const oracle_point *p, int n, const long box[4]) {
    long x0 = p[0].x, x1 = p[0].x, y0 = p[0].y, y1 = p[0].y;
    for (int i = 1; i < n; i++) {
        if (p[i].x < x0) x0 = p[i].x;
        if (p[i].x > x1) x1 = p[i].x;
        if (p[i].y < y0) y0 = p[i].y;
        if (p[i].y > y1) y1 = p[i].y;
    }
    if (x1 < box[0] || x0 > box[2] || y1 < box[1] || y0 > box[3]) return 1;
    for (int i = 0; n > 1 && i < n; i++) {
        const long dx = p[(i + 1) % n].x - p[i].x, dy = p[(i + 1) % n].y - p[i].y;
        long least = 0, most = 0, low = 0, high = 0;
        for (int c = 0; c < n; c++) {
            const long side = dx * (p[c].y - p[i].y) - dy * (p[c].x - p[i].x);
            if (side < least) least = side;
            if (side > most) most = side;
        }
        for (int c = 0; c < 4; c++) {
            const long side = dx * (box[c & 2 ? 3 : 1] - p[i].y) - dy * (box[c & 1 ? 2 : 0] - p[i].x);
            if (c == 0 || side < low) low = side;
            if (c == 0 || side > high) high = side;
        }
        if ((dx || dy) && (high < least || low > most)) return 1;
    }
    return 0;
}

/* Does the closed shape share a point with the closed box, in samples? */
static inline int shape_touches(const shape *s, long x0, long y0, long x1, long y1) {
    const long box[4] = {QUARTERS * x0, QUARTERS * y0, QUARTERS * x1, QUARTERS * y1};
    for (int i = 0; i < s->piece_count; i++)
        if (!apart_from_box(s->piece[i].corner, 3, box)) return 1;
    for (int i = 0; i < s->segment_count; i++)
        if (!apart_from_box(s->segment[i], 2, box)) return 1;
    return 0;
}

/* Twice the area in square quarters that a triangle of samples and a member (-1: any, the first that shares one)
 * have in common. */
static inline void common_area(const shape *s, int member, const oracle_point samples[3], mpq_t area) {
    oracle_point t[3];
    mpq_t part;
    mpq_init(part);
    mpq_set_ui(area, 0, 1);
    for (int c = 0; c < 3; c++) t[c] = (oracle_point){QUARTERS * samples[c].x, QUARTERS * samples[c].y};
    for (int i = 0; i < s->piece_count; i++) {
        const oracle_point *p = s->piece[i].corner;
        long box[4] = {p[0].x, p[0].y, p[0].x, p[0].y};
        for (int c = 1; c < 3; c++) {
            if (p[c].x < box[0]) box[0] = p[c].x;
            if (p[c].y < box[1]) box[1] = p[c].y;
            if (p[c].x > box[2]) box[2] = p[c].x;
            if (p[c].y > box[3]) box[3] = p[c].y;
        }
        if ((member >= 0 && s->piece[i].member != member) || apart_from_box(t, 3, box)) continue;
        oracle_common_area(t, p, part);
        mpq_add(area, area, part);
        if (member < 0 && mpq_sgn(area) != 0) break;
    }
    mpq_clear(part);
}

/* Do the interiors of a triangle of samples with an area and of the shape's members share a point? */
static inline int shape_meets_area(const shape *s, const oracle_point samples[3]) {
    mpq_t area;
    mpq_init(area);
    common_area(s, -1, samples, area);
    const int meets = mpq_sgn(area) != 0;
    mpq_clear(area);
    return meets;
}

/* Is the box of samples inside one of the members? */
static inline int shape_holds_box(const shape *s, int x0, int y0, int x1, int y1) {
    const oracle_point half[2][3] = {{{x0, y0}, {x1, y0}, {x1, y1}}, {{x0, y0}, {x1, y1}, {x0, y1}}};
    mpq_t area, part;
    int holds = 0;
    mpq_inits(area, part, NULL);
    for (int m = 0; m < s->member_count && !holds; m++) {
        common_area(s, m, half[0], area);
        common_area(s, m, half[1], part);
        mpq_add(area, area, part);
        holds = mpq_cmp_si(area, 2L * QUARTERS * QUARTERS * (x1 - x0) * (y1 - y0), 1) == 0;
    }
    mpq_clears(area, part, NULL);
    return holds;
}

static inline int shape_meets_box(const shape *s, int x0, int y0, int x1, int y1) {
    const oracle_point half[2][3] = {{{x0, y0}, {x1, y0}, {x1, y1}}, {{x0, y0}, {x1, y1}, {x0, y1}}};
    return x0 < x1 && y0 < y1 && (shape_meets_area(s, half[0]) || shape_meets_area(s, half[1]));
}

/* Mode `cover`: does the leaf belong to the region? */
static inline int shape_meets_leaf(const shape *s, const oracle *o, const oracle_triangle *t) {
    oracle_point p[3];
    for (int c = 0; c < 3; c++) p[c] = oracle_clamp(o, t->corner[c]);
    if (shape_meets_area(s, p)) return 1;
    for (int i = 0; i < s->segment_count; i++) {
        const long unit = ORACLE_UNITS / QUARTERS;
        const long segment[4] = {s->segment[i][0].x * unit, s->segment[i][0].y * unit, s->segment[i][1].x * unit,
                                 s->segment[i][1].y * unit};
        if (oracle_meets_segment(o, t, segment)) return 1;
    }
    return 0;
}

/* A shape that is one rectangle, as mode `border` takes it: grown outward to sample lines. */
static inline int shape_grow_rectangle(shape *s) {
    int x0 = INT32_MAX, y0 = INT32_MAX, x1 = INT32_MIN, y1 = INT32_MIN;
    long area = 0;
    if (s->member_count != 1 || s->segment_count > 0) return 0;
    for (int i = 0; i < s->piece_count; i++) {
        const oracle_point *p = s->piece[i].corner;
        area += labs((long)(p[1].x - p[0].x) * (p[2].y - p[0].y) - (long)(p[2].x - p[0].x) * (p[1].y - p[0].y));
        for (int c = 0; c < 3; c++) {
            if (p[c].x < x0) x0 = p[c].x;
            if (p[c].y < y0) y0 = p[c].y;
            if (p[c].x > x1) x1 = p[c].x;
            if (p[c].y > y1) y1 = p[c].y;
        }
    }
    if (area != 2L * (x1 - x0) * (y1 - y0)) return 0;
    const int r[1][4] = {
        {x0 & -QUARTERS, y0 & -QUARTERS, (x1 + QUARTERS - 1) & -QUARTERS, (y1 + QUARTERS - 1) & -QUARTERS}};
    char text[sizeof s->text];
    memcpy(text, s->text, sizeof text);
    memset(s, 0, sizeof *s);
    shape_polygon_of_rectangles(s, r, 1);
    memcpy(s->text, text, sizeof text);
    s->used = strlen(text);
    return 1;
}

#endif
