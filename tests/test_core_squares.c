/* test_core_squares.c - regions of squares answer as the polygon of their cells does, and as a map of the cells.
 *
 * Sets of squares are random quadtrees, drawn into a map of unit cells: boxes are counted there, and the polygon
 * that has every cell for a ring, which region_edges.c reduces to its border, says which triangles belong. */
#include "region_edges.h"

#include "test_core_support.h"

enum { MOST = 32, MOST_SQUARES = 4096, TEXT = MOST * MOST * 64 };

typedef struct map {
    int side;
    bool cell[MOST][MOST]; /* [y][x] */
    rqt_square squares[MOST_SQUARES];
    size_t count;
} map;

static void add(map *m, rqt_square s) {
    if (m->count == MOST_SQUARES) abort();
    m->squares[m->count++] = s;
    for (int y = s.y; y < s.y + s.side; y++)
        for (int x = s.x; x < s.x + s.side; x++) m->cell[y][x] = true;
}

/* Of a hundred squares `split` are cut and `held` of the cut ones are there as a whole, too, after one of their
 * quarters. */
static void grow(map *m, rqt_square s, int split, int full, int held) {
    if (s.side == 1 || random_between(1, 100) > split) {
        if (random_between(1, 100) <= full) add(m, s);
        return;
    }
    const int half = s.side / 2, after = random_between(1, 100) <= held ? random_between(-1, 3) : 4;
    if (after < 0) add(m, s);
    for (int c = 0; c < 4; c++) {
        grow(m, (rqt_square){s.x + (c & 1) * half, s.y + (c >> 1) * half, half}, split, full, held);
        if (after == c) add(m, s);
    }
}

static map *random_map(void) {
    map *m = calloc(1, sizeof *m);
    if (!m) abort();
    m->side = 1 << random_between(0, 5);
    grow(m, (rqt_square){0, 0, m->side}, random_between(40, 100), random_between(5, 95), random_between(0, 2) * 10);
    return m;
}

static rqt_region *region_of_map(const map *m, const rqt_lattice *lattice) {
    rqt_region *region;
    assert_int_equal(rqt_region_of_squares(m->squares, m->count, lattice, &test_allocator, &region), RQT_OK);
    return region;
}

/* As far as the raster goes. */
static rqt_region *polygon_of_map(const map *m, const rqt_lattice *lattice) {
    static const rqt_placement samples = {0, 0, 1, 1};
    char *text = malloc(TEXT);
    if (!text) abort();
    int n = snprintf(text, TEXT, "POLYGON");
    const int start = n;
    for (int y = 0; y < m->side && y < lattice->height - 1; y++)
        for (int x = 0; x < m->side && x < lattice->width - 1; x++)
            if (m->cell[y][x])
                n += snprintf(text + n, (size_t)(TEXT - n), "%s(%d %d,%d %d,%d %d,%d %d,%d %d)",
                              n == start ? "(" : ",", x, y, x + 1, y, x + 1, y + 1, x, y + 1, x, y);
    n += snprintf(text + n, (size_t)(TEXT - n), n == start ? " EMPTY" : ")");
    rqt_geometry *geometry;
    rqt_region *region;
    rqt_message why;
    assert_int_equal(rqt_geometry_parse(text, (size_t)n, true, &test_allocator, &geometry, &why), RQT_OK);
    assert_int_equal(rqt_region_create(geometry, &samples, lattice, &test_allocator, &region), RQT_OK);
    rqt_geometry_free(geometry);
    free(text);
    return region;
}

static rqt_lattice raster_of(const map *m, bool whole) {
    rqt_lattice lattice;
    const int least = m->side / 2 + 2, most = m->side + 1;
    const int width = whole || least > most ? most : random_between(least, most),
              height = whole || least > most ? most : random_between(1, most);
    assert_int_equal(rqt_lattice_init(&lattice, width, height), RQT_OK);
    return lattice;
}

static rqt_relation counted(const map *m, int x0, int y0, int x1, int y1) {
    int in = 0;
    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x++) in += x >= 0 && y >= 0 && x < m->side && y < m->side && m->cell[y][x];
    return in == 0 ? RQT_OUTSIDE : in == (x1 - x0) * (y1 - y0) ? RQT_INSIDE : RQT_ACROSS;
}

/* ------------------------------------------------------------------------------------------------ tests -- */

static void boxes_lie_to_squares_as_cells_are_counted(void **state) {
    (void)state;
    random_begin("boxes");
    int seen[3] = {0};
    for (int round = 0; round < 1500; round++) {
        map *m = random_map();
        const rqt_lattice lattice = raster_of(m, true);
        rqt_region *region = region_of_map(m, &lattice);
        assert_int_equal(rqt_region_is_empty(region), counted(m, 0, 0, m->side, m->side) == RQT_OUTSIDE);
        for (int i = 0; i < 100; i++) {
            int x0 = random_between(-3, m->side), y0 = random_between(-3, m->side);
            int x1 = random_between(x0 + 1, m->side + 4), y1 = random_between(y0 + 1, m->side + 4);
            if (i % 2) { /* what the walk asks for: a cell, or two side by side */
                const int side = 1 << random_between(0, 4);
                x0 = random_between(0, m->side) & -side;
                y0 = random_between(0, m->side) & -side;
                x1 = x0 + side * random_between(1, 2);
                y1 = y0 + side;
            }
            const rqt_relation expected = counted(m, x0, y0, x1, y1),
                               is = rqt_region_box_relation(region, x0, y0, x1, y1);
            CHECK(is == expected && region_area_relation(region, x0, y0, x1, y1) == expected,
                  "round %d: [%d,%d] x [%d,%d] is %d, should be %d", round, x0, x1, y0, y1, (int)is, (int)expected);
            seen[expected]++;
        }
        rqt_region_free(region);
        free(m);
    }
    for (int i = 0; i < 3; i++) assert_true(seen[i] > 15000); /* the test says something */
}

static void triangles_belong_to_squares_as_to_the_polygon_of_their_cells(void **state) {
    (void)state;
    random_begin("triangles");
    int met = 0, asked = 0;
    for (int round = 0; round < 600; round++) {
        map *m = random_map();
        const rqt_lattice lattice = raster_of(m, round % 2);
        rqt_region *region = region_of_map(m, &lattice), *polygon = polygon_of_map(m, &lattice);
        const int last_x = lattice.width - 1, last_y = lattice.height - 1;
        for (int i = 0; i < 60; i++) {
            rqt_vertex v[3];
            for (int c = 0; c < 3; c++) v[c] = (rqt_vertex){random_between(0, last_x), random_between(0, last_y)};
            if (i % 3) { /* near the first corner, where leaves are small */
                for (int c = 1; c < 3; c++) {
                    v[c].x = v[0].x + random_between(-2, 2);
                    v[c].y = v[0].y + random_between(-2, 2);
                    v[c] = rqt_vertex_clamp(&lattice, v[c]);
                    if (v[c].x < 0) v[c].x = 0;
                    if (v[c].y < 0) v[c].y = 0;
                }
            }
            const bool expected = rqt_region_meets(polygon, v[0], v[1], v[2]);
            CHECK(rqt_region_meets(region, v[0], v[1], v[2]) == expected &&
                      region_area_meets(region, v[0], v[1], v[2]) == expected,
                  "round %d: (%d,%d) (%d,%d) (%d,%d) %s", round, v[0].x, v[0].y, v[1].x, v[1].y, v[2].x, v[2].y,
                  expected ? "belongs" : "does not belong");
            met += expected;
            asked++;
        }
        rqt_region_free(region);
        rqt_region_free(polygon);
        free(m);
    }
    assert_true(met > asked / 5 && met < asked * 4 / 5);
}

static void triangles_that_reach_beyond_the_root_belong_as_well(void **state) {
    (void)state;
    rqt_lattice lattice;
    rqt_region *region;
    const rqt_square s[2] = {{0, 0, 1}, {8, 8, 8}};
    assert_int_equal(rqt_lattice_init(&lattice, 17, 17), RQT_OK);
    assert_int_equal(rqt_region_of_squares(s, 2, &lattice, &test_allocator, &region), RQT_OK);
    assert_true(rqt_region_meets(region, (rqt_vertex){-5, -5}, (rqt_vertex){9, -5}, (rqt_vertex){-5, 9}));
    assert_false(rqt_region_meets(region, (rqt_vertex){-5, -5}, (rqt_vertex){5, -5}, (rqt_vertex){-5, 5}));
    assert_true(
        rqt_region_meets(region, (rqt_vertex){12, 12}, (rqt_vertex){INT32_MAX, 12}, (rqt_vertex){12, INT32_MAX}));
    assert_false(
        rqt_region_meets(region, (rqt_vertex){16, 12}, (rqt_vertex){INT32_MAX, 12}, (rqt_vertex){16, INT32_MAX}));
    assert_int_equal(rqt_region_box_relation(region, -1, -1, 1, 1), RQT_ACROSS);
    assert_int_equal(rqt_region_box_relation(region, -9, -9, 0, 0), RQT_OUTSIDE);
    assert_int_equal(rqt_region_box_relation(region, 12, 12, INT32_MAX, INT32_MAX), RQT_ACROSS);
    assert_int_equal(rqt_region_box_relation(region, 16, 16, INT32_MAX, INT32_MAX), RQT_OUTSIDE);
    rqt_region_free(region);
}

static void boxes_of_squares_are_those_of_their_polygon(void **state) {
    (void)state;
    random_begin("box");
    int empty = 0;
    for (int round = 0; round < 500; round++) {
        map *m = random_map();
        const rqt_lattice lattice = raster_of(m, round % 4 == 0);
        rqt_region *region = region_of_map(m, &lattice), *polygon = polygon_of_map(m, &lattice);
        int32_t a[4], b[4];
        const bool is = rqt_region_box(region, &a[0], &a[1], &a[2], &a[3]),
                   expected = rqt_region_box(polygon, &b[0], &b[1], &b[2], &b[3]);
        CHECK(is == expected && (!is || memcmp(a, b, sizeof a) == 0), "round %d", round);
        assert_int_equal(rqt_region_is_empty(region), rqt_region_is_empty(polygon));
        assert_false(rqt_region_is_all(region));
        assert_true(rqt_region_bytes(region) > 0);
        empty += !is;
        rqt_region_free(region);
        rqt_region_free(polygon);
        free(m);
    }
    assert_true(empty > 10 && empty < 400);
}

static void what_touches_squares_and_is_in_them_is_what_cells_say(void **state) {
    (void)state;
    random_begin("touching");
    int touched = 0, held = 0, asked = 0;
    for (int round = 0; round < 300; round++) {
        map *m = random_map();
        const rqt_lattice lattice = raster_of(m, true);
        rqt_region *region = region_of_map(m, &lattice);
        for (int i = 0; i < 60; i++) {
            const int64_t unit = REGION_UNIT, x = random_between(-2, m->side + 1) * unit,
                          y = random_between(-2, m->side + 1) * unit;
            const region_box box = {x + random_between(-1, 1), y + random_between(-1, 1),
                                    x + random_between(0, 1) * unit + 1 + random_between(0, 1),
                                    y + random_between(0, 1) * unit + 1 + random_between(0, 1)};
            bool expected = false, inside = true;
            for (int v = 0; v < m->side; v++)
                for (int u = 0; u < m->side; u++)
                    expected |= m->cell[v][u] && box.x0 <= (u + 1) * unit && box.x1 >= u * unit &&
                                box.y0 <= (v + 1) * unit && box.y1 >= v * unit;
            assert_int_equal(region_touches(region, &box), expected);
            const rqt_vertex sample = {random_between(0, m->side), random_between(0, m->side)};
            for (int c = 0; c < 4; c++)
                inside &= counted(m, sample.x - (c & 1), sample.y - (c >> 1), sample.x - (c & 1) + 1,
                                  sample.y - (c >> 1) + 1) == RQT_INSIDE;
            assert_int_equal(rqt_region_contains(region, sample), inside);
            touched += expected;
            held += inside;
            asked++;
        }
        rqt_region_free(region);
        free(m);
    }
    assert_true(touched > asked / 5 && touched < asked * 4 / 5 && held > asked / 20 && held < asked * 4 / 5);
}

static void the_largest_root_has_room_for_its_squares(void **state) {
    (void)state;
    const int32_t side = 1 << RQT_MAX_K, half = side / 2;
    rqt_lattice lattice;
    rqt_region *region;
    assert_int_equal(rqt_lattice_init(&lattice, side + 1, side + 1), RQT_OK);
    const rqt_square s[] = {{0, 0, half}, {half, 0, half}, {0, half, half}, {side - 1, side - 1, 1}};
    assert_int_equal(rqt_region_of_squares(s, 4, &lattice, &test_allocator, &region), RQT_OK);
    assert_int_equal(rqt_region_box_relation(region, 0, 0, side, half), RQT_INSIDE);
    assert_int_equal(rqt_region_box_relation(region, half, half, side - 1, side), RQT_OUTSIDE);
    assert_int_equal(rqt_region_box_relation(region, side - 1, side - 1, side, side), RQT_INSIDE);
    assert_int_equal(rqt_region_box_relation(region, 0, 0, side, side), RQT_ACROSS);
    assert_true(
        rqt_region_meets(region, (rqt_vertex){half, side}, (rqt_vertex){side, half}, (rqt_vertex){side, side}));
    assert_false(
        rqt_region_meets(region, (rqt_vertex){half, half}, (rqt_vertex){side - 1, half}, (rqt_vertex){half, side}));
    rqt_region_free(region);
    assert_int_equal(rqt_region_of_squares(&(rqt_square){0, 0, side}, 1, &lattice, &test_allocator, &region),
                     RQT_OK);
    assert_int_equal(rqt_region_box_relation(region, 0, 0, side, side), RQT_INSIDE);
    rqt_region_free(region);
}

static void squares_that_are_none_or_out_of_order_are_refused(void **state) {
    (void)state;
    static const struct {
        rqt_square s[2];
        rqt_status status;
    } cases[] = {{{{0, 0, 2}, {2, 0, 2}}, RQT_OK},
                 {{{0, 0, 2}, {0, 0, 2}}, RQT_OK},
                 {{{2, 0, 2}, {0, 0, 4}}, RQT_OK},
                 {{{0, 0, 4}, {2, 0, 2}}, RQT_OK},
                 {{{2, 0, 2}, {0, 0, 2}}, RQT_INVALID},
                 {{{0, 2, 2}, {2, 0, 2}}, RQT_INVALID},
                 {{{0, 0, 1}, {0, 0, 3}}, RQT_INVALID},
                 {{{0, 0, 1}, {0, 0, 0}}, RQT_INVALID},
                 {{{0, 0, 1}, {1, 0, -1}}, RQT_INVALID},
                 {{{0, 0, 1}, {1, 2, 2}}, RQT_INVALID},
                 {{{0, 0, 1}, {2, 1, 2}}, RQT_INVALID},
                 {{{0, 0, 1}, {-2, 0, 2}}, RQT_INVALID},
                 {{{0, 0, 1}, {0, -2, 2}}, RQT_INVALID},
                 {{{0, 0, 1}, {0, 0, INT32_MIN}}, RQT_INVALID},
                 {{{0, 0, 1}, {0, 0, 2 << RQT_MAX_K}}, RQT_INVALID}};
    rqt_lattice lattice;
    assert_int_equal(rqt_lattice_init(&lattice, 9, 9), RQT_OK);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        rqt_region *region;
        const rqt_status status = rqt_region_of_squares(cases[i].s, 2, &lattice, &test_allocator, &region);
        CHECK(status == cases[i].status && !region == (status != RQT_OK), "case %zu: %d", i, (int)status);
        rqt_region_free(region);
    }
    assert_int_equal(test_heap.live, 0);
}

static void mode_cut_refuses_squares(void **state) {
    (void)state;
    rqt_lattice lattice;
    rqt_region *region;
    rqt_patch patch = {.allocator = test_allocator};
    rqt_cut cut;
    assert_int_equal(rqt_lattice_init(&lattice, 9, 9), RQT_OK);
    assert_int_equal(rqt_region_of_squares(&(rqt_square){0, 0, 4}, 1, &lattice, &test_allocator, &region), RQT_OK);
    assert_int_equal(rqt_cut_make(&patch, region, &lattice, &test_allocator, NULL, NULL, &cut), RQT_INVALID);
    assert_int_equal(cut.triangle_count, 0);
    rqt_region_free(region);
}

static void every_refused_allocation_is_told(void **state) {
    (void)state;
    random_begin("memory");
    map *m = calloc(1, sizeof *m);
    if (!m) abort();
    m->side = MOST;
    grow(m, (rqt_square){0, 0, m->side}, 100, 50, 0); /* more keys than the first array has */
    const rqt_lattice lattice = raster_of(m, true);
    size_t calls = 0;
    for (size_t n = 1; calls == 0; n++) {
        rqt_region *region;
        test_heap = (heap){.fail_from = n, .fail_to = n};
        const rqt_status status = rqt_region_of_squares(m->squares, m->count, &lattice, &test_allocator, &region);
        if (status == RQT_OK) calls = n;
        CHECK(status == (test_heap.failures ? RQT_NO_MEMORY : RQT_OK), "request %zu: %d", n, (int)status);
        rqt_region_free(region);
        assert_int_equal(test_heap.live, 0);
    }
    assert_true(calls > 4);
    test_heap = (heap){0};
    free(m);
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {TEST(boxes_lie_to_squares_as_cells_are_counted),
                                       TEST(triangles_belong_to_squares_as_to_the_polygon_of_their_cells),
                                       TEST(triangles_that_reach_beyond_the_root_belong_as_well),
                                       TEST(boxes_of_squares_are_those_of_their_polygon),
                                       TEST(what_touches_squares_and_is_in_them_is_what_cells_say),
                                       TEST(the_largest_root_has_room_for_its_squares),
                                       TEST(squares_that_are_none_or_out_of_order_are_refused),
                                       TEST(mode_cut_refuses_squares),
                                       TEST(every_refused_allocation_is_told)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
