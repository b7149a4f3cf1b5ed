/* test_region_oracle.h - shapes on a coarse grid, and an oracle for what a triangle and a shape have in common.
 *
 * The oracle shares no idea with the core: it cuts the plane into vertical slabs at every corner and every crossing
 * of every edge, as exact fractions, sorts the edges in the middle of each slab, and walks up through them counting
 * parities; an area between two edges that is inside both the triangle and the polygon decides. It wants small
 * whole numbers, so its unit is a quarter of a sample, and shapes are drawn on that grid (coarsely, so that edges
 * often lie on one another). Lines are clipped against the triangle with fractions. */
#ifndef TEST_REGION_ORACLE_H
#define TEST_REGION_ORACLE_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "rqt.h"

#define COUNT(array) (sizeof(array) / sizeof *(array))

/* --------------------------------------------------------------------------------- heap and chance -- */
typedef struct heap {
    size_t live, calls, fail_at; /* fail_at: the call that is refused, counted from 1; 0: none */
} heap;

static void *heap_resize(void *context, void *p, size_t bytes) {
    heap *h = context;
    if (bytes == 0) {
        h->live--;
        free(p);
        return NULL;
    }
    if (++h->calls == h->fail_at) return NULL;
    if (!p) h->live++;
    return realloc(p, bytes);
}

static heap test_heap;
static const rqt_allocator allocator = {heap_resize, &test_heap};
static uint64_t seed, chance;

static int begin_test(void **state) {
    (void)state;
    memset(&test_heap, 0, sizeof test_heap);
    chance = seed;
    return 0;
}

static int end_test(void **state) {
    (void)state;
    return test_heap.live == 0 ? 0 : -1;
}

static int between(int low, int high) {
    uint64_t z = chance += 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    z ^= z >> 31;
    return low + (int)(z % (uint64_t)(high - low + 1));
}

/* ------------------------------------------------------------------------------------------ shapes -- */
typedef struct spot { /* in quarters of a sample */
    int x, y;
} spot;

#define MAX_RINGS 4
#define MAX_SPOTS 16

typedef struct shape { /* one polygon; rings are not closed here: the last spot joins the first */
    int rings, spots[MAX_RINGS];
    spot at[MAX_RINGS][MAX_SPOTS];
} shape;

/* Where the terrain lies in most tests: nothing is trivial, all is exact. */
static const rqt_placement shifted = {500000.25, 5200000.5, 0.5, -0.25};
static const rqt_placement plain = {0, 0, 1, 1};

static char *text; /* WKT under construction */
static size_t text_n, text_room;

static void text_begin(const char *start) {
    text_n = 0;
    if (!text) text = malloc(text_room = 1 << 24);
    assert_non_null(text);
    text_n = (size_t)snprintf(text, text_room, "%s", start);
}

static void text_add(const char *more) {
    assert_true(text_n + strlen(more) + 1 < text_room);
    text_n += (size_t)snprintf(text + text_n, text_room - text_n, "%s", more);
}

static void text_add_spot(spot s) {
    char numbers[100];
    (void)snprintf(numbers, sizeof numbers, "%.17g %.17g", shifted.x0 + s.x / 4.0 * shifted.dx,
                   shifted.y0 + s.y / 4.0 * shifted.dy);
    text_add(numbers);
}

static void text_add_shape(const shape *s) {
    for (int r = 0; r < s->rings; r++) {
        text_add(r ? ",(" : "((");
        for (int i = 0; i <= s->spots[r]; i++) {
            if (i) text_add(",");
            text_add_spot(s->at[r][i % s->spots[r]]);
        }
        text_add(")");
    }
    text_add(")");
}

static rqt_region *region_of_text(const char *wkt, const rqt_placement *placement, int width, int height) {
    rqt_geometry *g;
    rqt_region *region;
    rqt_message message = {""};
    const rqt_lattice lattice = {width, height, 11};
    if (rqt_geometry_parse(wkt, strlen(wkt), true, &allocator, &g, &message) != RQT_OK)
        fail_msg("%s", message.text);
    assert_int_equal(rqt_region_create(g, placement, &lattice, &allocator, &region), RQT_OK);
    rqt_geometry_free(g);
    return region;
}

static rqt_region *region_here(void) {
    return region_of_text(text, &shifted, 1001, 1001);
}

/* ------------------------------------------------------------------------------------------ oracle -- */
typedef struct fraction { /* below: > 0 */
    int64_t above, below;
} fraction;

static int compare_fractions(const void *p, const void *q) {
    const fraction *a = p, *b = q;
    __int128 d = (__int128)a->above * b->below - (__int128)b->above * a->below;
    return (d > 0) - (d < 0);
}

typedef struct oracle_edge {
    spot a, b;
    int of; /* 0 the triangle, 1 the polygon */
} oracle_edge;

typedef struct crossing {
    fraction y;
    int of;
} crossing;

static int compare_crossings(const void *p, const void *q) {
    return compare_fractions(&((const crossing *)p)->y, &((const crossing *)q)->y);
}

#define MAX_EDGES (3 + (MAX_RINGS + 1) * MAX_SPOTS)

static fraction make_fraction(int64_t above, int64_t below) {
    return below < 0 ? (fraction){-above, -below} : (fraction){above, below};
}

/* Do the interiors share an area? t in quarters too. */
static bool oracle_areas_meet(const spot t[3], const shape *s) {
    static fraction cuts[MAX_EDGES * MAX_EDGES];
    oracle_edge edges[MAX_EDGES];
    size_t n = 0, cut_count = 0;
    for (int i = 0; i < 3; i++) edges[n++] = (oracle_edge){t[i], t[(i + 1) % 3], 0};
    for (int r = 0; r < s->rings; r++)
        for (int i = 0; i < s->spots[r]; i++)
            edges[n++] = (oracle_edge){s->at[r][i], s->at[r][(i + 1) % s->spots[r]], 1};
    for (size_t i = 0; i < n; i++) {
        cuts[cut_count++] = (fraction){edges[i].a.x, 1};
        for (size_t j = 0; j < i; j++) {
            int64_t rx = edges[i].b.x - edges[i].a.x, ry = edges[i].b.y - edges[i].a.y;
            int64_t sx = edges[j].b.x - edges[j].a.x, sy = edges[j].b.y - edges[j].a.y;
            int64_t px = edges[j].a.x - edges[i].a.x, py = edges[j].a.y - edges[i].a.y;
            int64_t below = rx * sy - ry * sx, above = px * sy - py * sx;
            /* crossings of the whole lines: cuts too many do no harm */
            if (below) cuts[cut_count++] = make_fraction(edges[i].a.x * below + rx * above, below);
        }
    }
    qsort(cuts, cut_count, sizeof *cuts, compare_fractions);
    for (size_t c = 0; c + 1 < cut_count; c++) {
        if (compare_fractions(&cuts[c], &cuts[c + 1]) == 0) continue;
        fraction x = {cuts[c].above * cuts[c + 1].below + cuts[c + 1].above * cuts[c].below,
                      2 * cuts[c].below * cuts[c + 1].below};
        crossing crossings[MAX_EDGES];
        size_t m = 0;
        for (size_t i = 0; i < n; i++) {
            const spot a = edges[i].a, b = edges[i].b;
            bool a_left = a.x * x.below < x.above, b_left = b.x * x.below < x.above;
            if (a_left == b_left) continue;
            int64_t dx = b.x - a.x, dy = b.y - a.y;
            crossings[m++] = (crossing){
                make_fraction(a.y * dx * x.below + dy * (x.above - a.x * x.below), dx * x.below), edges[i].of};
        }
        qsort(crossings, m, sizeof *crossings, compare_crossings);
        bool inside[2] = {false, false};
        for (size_t i = 0; i + 1 < m; i++) {
            inside[crossings[i].of] = !inside[crossings[i].of];
            if (inside[0] && inside[1] && compare_crossings(&crossings[i], &crossings[i + 1]) != 0) return true;
        }
    }
    return false;
}

static int64_t side(spot a, spot b, spot p) {
    return (int64_t)(b.x - a.x) * (p.y - a.y) - (int64_t)(b.y - a.y) * (p.x - a.x);
}

/* Does the closed segment share a point with the closed triangle? Cuts the segment's parameter range by each side.
 */
static bool oracle_line_touches(const spot t[3], spot p, spot q) {
    fraction from = {0, 1}, to = {1, 1};
    int64_t turn = side(t[0], t[1], t[2]) > 0 ? 1 : -1;
    for (int i = 0; i < 3; i++) {
        int64_t at_p = turn * side(t[i], t[(i + 1) % 3], p), at_q = turn * side(t[i], t[(i + 1) % 3], q);
        if (at_p < 0 && at_q < 0) return false;
        if (at_p >= 0 && at_q >= 0) continue;
        fraction cut = make_fraction(at_p, at_p - at_q);
        if (at_p < 0 && compare_fractions(&cut, &from) > 0) from = cut;
        if (at_p >= 0 && compare_fractions(&cut, &to) < 0) to = cut;
    }
    return compare_fractions(&from, &to) <= 0;
}

static const spot everywhere[3] = {{-100, -2}, {170, -2}, {35, 200}}; /* every shape */

/* The whole rule for a polygon: a shell without an area is the lines it is drawn with. */
static bool oracle_meets(const spot t[3], const shape *s) {
    shape shell = *s;
    shell.rings = 1;
    if (oracle_areas_meet(everywhere, &shell)) return oracle_areas_meet(t, s);
    for (int i = 0; i < s->spots[0]; i++)
        if (oracle_line_touches(t, s->at[0][i], s->at[0][(i + 1) % s->spots[0]])) return true;
    return false;
}

/* ----------------------------------------------------------------------------------------- helpers -- */
static bool meets(const rqt_region *region, const spot t[3]) {
    rqt_vertex v[3];
    for (int i = 0; i < 3; i++) v[i] = (rqt_vertex){t[i].x / 4, t[i].y / 4};
    bool first = rqt_region_meets(region, v[0], v[1], v[2]);
    assert_int_equal(rqt_region_meets(region, v[0], v[2], v[1]), first); /* any winding */
    assert_int_equal(rqt_region_meets(region, v[2], v[0], v[1]), first);
    return first;
}

/* A triangle with an area in low .. high samples; half of them as a bintree has them. */
static void random_triangle(spot t[3], int low, int high) {
    do {
        for (int i = 0; i < 3; i++) t[i] = (spot){4 * between(low, high), 4 * between(low, high)};
        if (between(0, 1)) t[1] = (spot){t[0].x, t[2].y};
    } while (side(t[0], t[1], t[2]) == 0);
}

/* step: distance of its grid, in quarters. A coarse one makes corners and edges coincide. */
static void random_shape(shape *s, int step, int cells, int max_rings, int max_spots) {
    s->rings = between(1, max_rings);
    for (int r = 0; r < s->rings; r++) {
        s->spots[r] = between(3, max_spots);
        int kind = between(0, 3);
        spot p = {step * between(0, cells), step * between(0, cells)};
        for (int i = 0; i < s->spots[r]; i++) {
            s->at[r][i] = p;
            spot next = {step * between(0, cells), step * between(0, cells)};
            if (kind == 0) next = i % 2 ? (spot){p.x, next.y} : (spot){next.x, p.y}; /* along the axes */
            p = next;
        }
        if (kind == 1 && s->spots[r] >= 4) { /* a rectangle, here or there turned the other way */
            spot a = s->at[r][0], b = s->at[r][2];
            s->at[r][1] = (spot){b.x, a.y};
            s->at[r][3] = (spot){a.x, b.y};
            s->spots[r] = 4;
        }
    }
}

static void fail_shape(const spot t[3], bool expected) {
    fail_msg("seed %llu: triangle (%g %g, %g %g, %g %g) should %smeet %s", (unsigned long long)seed, t[0].x / 4.0,
             t[0].y / 4.0, t[1].x / 4.0, t[1].y / 4.0, t[2].x / 4.0, t[2].y / 4.0, expected ? "" : "not ", text);
}

/* By hand: a region in sample coordinates, and one triangle. */
static bool hand_meets(const char *wkt, int ax, int ay, int bx, int by, int cx, int cy) {
    const spot t[3] = {{4 * ax, 4 * ay}, {4 * bx, 4 * by}, {4 * cx, 4 * cy}};
    rqt_region *region = region_of_text(wkt, &plain, 101, 101);
    bool result = meets(region, t);
    rqt_region_free(region);
    return result;
}

#endif
