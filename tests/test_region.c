/* test_region.c - mode `cover` is exact, and boxes never promise what triangles do not keep.
 *
 * Cases by hand for every kind of contact, then random shapes against the oracle of test_region_oracle.h. Random
 * numbers start from RQT_SEED for each test. */
#include "test_region_oracle.h"

/* ------------------------------------------------------------------------------------------- tests -- */
static void test_touching_is_not_meeting(void **state) {
    (void)state;
    static const char square[] = "POLYGON((10 10,20 10,20 20,10 20,10 10))";
    assert_true(hand_meets(square, 12, 12, 14, 12, 12, 14));
    assert_true(hand_meets(square, 0, 0, 100, 0, 0, 100));
    assert_true(hand_meets(square, 9, 9, 12, 9, 9, 12));      /* its long side passes the corner's inside */
    assert_false(hand_meets(square, 9, 9, 11, 9, 9, 11));     /* its long side touches the corner */
    assert_false(hand_meets(square, 20, 12, 22, 12, 20, 14)); /* shares a piece of a side */
    assert_false(hand_meets(square, 10, 10, 10, 20, 0, 15));
    assert_false(hand_meets(square, 20, 20, 25, 20, 20, 25)); /* shares a corner */
    assert_true(hand_meets(square, 10, 10, 20, 10, 10, 20));
    static const char slanted[] = "POLYGON((10 0,20 10,10 20,0 10,10 0))";
    assert_false(hand_meets(slanted, 0, 0, 10, 0, 0, 10));
    assert_true(hand_meets(slanted, 0, 0, 11, 0, 0, 11));
    assert_true(hand_meets(slanted, 9, 9, 11, 9, 9, 11));
    assert_false(hand_meets("POLYGON((10 10,10.0000001 10,10.0000001 20,10 20,10 10))", 20, 0, 30, 0, 20, 10));
    assert_true(
        hand_meets("POLYGON((10 10,10.000001 10,10.000001 20,10 20,10 10))", 10, 10, 12, 10, 10, 12)); /* thin */
    assert_false(hand_meets("POLYGON((10 10,10.000001 10,10.000001 20,10 20,10 10))", 10, 10, 8, 10, 10, 12));
    assert_false(
        hand_meets("POLYGON((0 0,30 0,30 30,0 30,0 0),(10 10,20 10,20 20,10 20,10 10))", 10, 10, 20, 10, 10, 20));
    assert_true(
        hand_meets("POLYGON((0 0,30 0,30 30,0 30,0 0),(10 10,20 10,20 20,10 20,10 10))", 10, 10, 21, 10, 10, 20));
}

static void test_points_and_lines_are_closed(void **state) {
    (void)state;
    assert_true(hand_meets("POINT(10 10)", 10, 10, 12, 10, 10, 12)); /* a corner */
    assert_true(hand_meets("POINT(11 10)", 10, 10, 12, 10, 10, 12)); /* a side */
    assert_true(hand_meets("POINT(11 11)", 10, 10, 12, 10, 10, 12)); /* the long side */
    assert_true(hand_meets("POINT(10.5 10.5)", 10, 10, 12, 10, 10, 12));
    assert_false(hand_meets("POINT(11 11.00001)", 10, 10, 12, 10, 10, 12));
    assert_true(hand_meets("POINT(11 11.0000001)", 10, 10, 12, 10, 10, 12)); /* rounds to the side */
    assert_true(hand_meets("POINT(11 9.9999999)", 10, 10, 12, 10, 10, 12));  /* from the other side too */
    assert_false(hand_meets("POINT(11 11.0000009)", 10, 10, 12, 10, 10, 12));
    assert_true(hand_meets("LINESTRING(0 10,100 10)", 10, 10, 12, 10, 10, 12));
    assert_true(hand_meets("LINESTRING(0 24,24 0)", 10, 10, 12, 12, 14, 10));
    assert_true(hand_meets("LINESTRING(10 14,14 10)", 10, 10, 12, 10, 12, 12)); /* through one corner */
    assert_false(hand_meets("LINESTRING(0 9.9999,100 9.9999)", 10, 10, 12, 10, 10, 12));
    assert_false(hand_meets("LINESTRING(0 0,9 9)", 10, 10, 12, 10, 10, 12));
    assert_true(hand_meets("LINESTRING(0 0,9 9,10.5 10.5)", 10, 10, 12, 10, 10, 12));
    assert_true(hand_meets("LINESTRING(11 10,11 10)", 10, 10, 12, 10, 10, 12)); /* no length */
    assert_true(hand_meets("MULTIPOINT(90 90,11 11)", 10, 10, 12, 10, 10, 12));
    assert_true(
        hand_meets("GEOMETRYCOLLECTION(POINT(90 90),POLYGON((80 80,90 80,80 90,80 80)),LINESTRING(11 0,11 10))", 10,
                   10, 12, 10, 10, 12));
}

static void test_collapsed_polygons_are_lines(void **state) {
    (void)state;
    static const char *const lines[] = {
        "POLYGON((0 10,100 10,50 10,0 10))",                            /* drawn flat */
        "POLYGON((0 10,100 10,100 10.0000001,0 10.0000001,0 10))",      /* flattened by the rounding */
        "POLYGON((0 10,100 10,100 20,100 10,0 10))",                    /* there and back */
        "POLYGON((11 10,11 10,11 10,11 10))",                           /* a point */
        "POLYGON((11 10,11.0000001 10,11 10.0000001,11 10))",           /* nearly one */
        "POLYGON((0 10,100 10,50 10,0 10),(40 40,60 40,60 60,40 40))"}; /* what is a hole of a line? nothing */
    for (size_t i = 0; i < COUNT(lines); i++) {
        assert_true(hand_meets(lines[i], 10, 10, 12, 10, 10, 12));
        assert_true(hand_meets(lines[i], 10, 10, 12, 10, 10, 8));
        assert_false(hand_meets(lines[i], 10, 11, 12, 11, 10, 13));
        assert_false(hand_meets(lines[i], 45, 45, 70, 45, 45, 70));
    }
    rqt_region *region =
        region_of_text("POLYGON((0 0,30 0,30 30,0 30,0 0),(0 30,0 0,30 0,30 30,0 30))", &plain, 50, 50);
    assert_true(rqt_region_is_empty(region)); /* a hole that covers all */
    assert_false(rqt_region_meets(region, (rqt_vertex){1, 1}, (rqt_vertex){9, 1}, (rqt_vertex){1, 9}));
    assert_int_equal(rqt_region_box_relation(region, 0, 0, 40, 40), RQT_OUTSIDE);
    rqt_region_free(region);
}

static void test_polygons_meet_as_the_oracle_says(void **state) {
    (void)state;
    int hits = 0, rounds = 3000;
    for (int round = 0; round < rounds; round++) {
        shape s;
        static const int steps[] = {4, 4, 1, 2, 8};
        int step = steps[between(0, 4)];
        random_shape(&s, step, step == 8 ? 4 : 5 + 2 * between(0, 1), MAX_RINGS, between(3, 9));
        text_begin("POLYGON");
        text_add_shape(&s);
        rqt_region *region = region_here();
        for (int i = 0; i < 12; i++) {
            spot t[3];
            random_triangle(t, -1, 8);
            bool expected = oracle_meets(t, &s);
            hits += expected;
            if (meets(region, t) != expected) fail_shape(t, expected);
        }
        rqt_region_free(region);
    }
    assert_true(hits > rounds * 2 && hits < rounds * 11); /* the test says something */
}

static void test_members_are_a_union(void **state) {
    (void)state;
    for (int round = 0; round < 500; round++) {
        shape s[12];
        int n = between(2, 12);
        text_begin("MULTIPOLYGON(");
        for (int i = 0; i < n; i++) {
            random_shape(&s[i], 4, 7, 2, 5);
            if (i) text_add(",");
            text_add_shape(&s[i]);
        }
        text_add(")");
        rqt_region *region = region_here();
        for (int i = 0; i < 12; i++) {
            spot t[3];
            bool expected = false;
            random_triangle(t, -1, 8);
            for (int k = 0; k < n; k++) expected = expected || oracle_meets(t, &s[k]);
            if (meets(region, t) != expected) fail_shape(t, expected);
        }
        rqt_region_free(region);
    }
}

static void test_lines_meet_as_the_oracle_says(void **state) {
    (void)state;
    for (int round = 0; round < 3000; round++) {
        spot line[40];
        int n = between(1, 40), step = between(1, 4);
        bool points = n == 1 || between(0, 1) == 0;
        text_begin(points ? "MULTIPOINT(" : "LINESTRING(");
        for (int i = 0; i < n; i++) {
            line[i] = (spot){step * between(0, 12), step * between(0, 12)};
            if (i && !points && between(0, 1)) line[i] = (spot){line[i - 1].x + step, line[i - 1].y - step};
            if (i) text_add(",");
            text_add_spot(line[i]);
        }
        text_add(")");
        rqt_region *region = region_here();
        for (int i = 0; i < 10; i++) {
            spot t[3];
            bool expected = false;
            random_triangle(t, -2, 13);
            for (int k = 0; k + !points < n; k++)
                expected = expected || oracle_line_touches(t, line[k], line[points ? k : k + 1]);
            if (meets(region, t) != expected) fail_shape(t, expected);
        }
        int x0 = between(-2, 10), y0 = between(-2, 10), x1 = x0 + between(1, 4), y1 = y0 + between(1, 4);
        const spot half[2][3] = {{{4 * x0, 4 * y0}, {4 * x1, 4 * y0}, {4 * x0, 4 * y1}},
                                 {{4 * x1, 4 * y1}, {4 * x1, 4 * y0}, {4 * x0, 4 * y1}}};
        rqt_relation relation = rqt_region_box_relation(region, x0, y0, x1, y1);
        bool touched = meets(region, half[0]) || meets(region, half[1]);
        assert_int_equal(relation, touched ? RQT_ACROSS : RQT_OUTSIDE);
        rqt_region_free(region);
    }
}

static void test_boxes_promise_what_triangles_keep(void **state) {
    (void)state;
    int answers[3] = {0, 0, 0};
    for (int round = 0; round < 3000; round++) {
        shape s[3];
        int n = between(1, 3), step = between(1, 2) * 4;
        text_begin("MULTIPOLYGON(");
        for (int i = 0; i < n; i++) {
            random_shape(&s[i], step, 32 / step + 4, 3, 5);
            if (i) text_add(",");
            text_add_shape(&s[i]);
        }
        text_add(")");
        rqt_region *region = region_here();
        for (int i = 0; i < 8; i++) {
            int x0 = between(-1, 9), y0 = between(-1, 9), x1 = x0 + between(1, 5), y1 = y0 + between(1, 5);
            rqt_relation relation = rqt_region_box_relation(region, x0, y0, x1, y1);
            answers[relation]++;
            for (int k = 0; k < 6 && relation != RQT_ACROSS; k++) {
                spot t[3];
                bool expected = false;
                do
                    for (int c = 0; c < 3; c++) t[c] = (spot){4 * between(x0, x1), 4 * between(y0, y1)};
                while (side(t[0], t[1], t[2]) == 0);
                for (int m = 0; m < n; m++) expected = expected || oracle_meets(t, &s[m]);
                if (expected != (relation == RQT_INSIDE)) fail_shape(t, expected);
            }
            if (n > 1) continue;
            /* One polygon: the answer is the sharpest one. Its even-odd sum with the box is what the box lacks. */
            shape lacks = s[0];
            lacks.spots[lacks.rings] = 4;
            const spot corner[4] = {{4 * x0, 4 * y0}, {4 * x1, 4 * y0}, {4 * x1, 4 * y1}, {4 * x0, 4 * y1}};
            memcpy(lacks.at[lacks.rings++], corner, sizeof corner);
            const spot half[2][3] = {{corner[0], corner[1], corner[2]}, {corner[0], corner[3], corner[2]}};
            shape shell = s[0];
            shell.rings = 1;
            if (!oracle_areas_meet(everywhere, &shell)) continue; /* thin */
            bool some = oracle_areas_meet(half[0], &s[0]) || oracle_areas_meet(half[1], &s[0]);
            bool rest = oracle_areas_meet(half[0], &lacks) || oracle_areas_meet(half[1], &lacks);
            rqt_relation expected = !some ? RQT_OUTSIDE : rest ? RQT_ACROSS : RQT_INSIDE;
            if (relation != expected)
                fail_msg("%d, not %d: %d %d %d %d %s", relation, expected, x0, y0, x1, y1, text);
        }
        assert_int_equal(rqt_region_box_relation(region, 3, 3, 3, 5), RQT_OUTSIDE); /* no area */
        rqt_region_free(region);
    }
    for (int i = 0; i < 3; i++) assert_true(answers[i] > 1000);
}

static void test_contains_is_the_interior(void **state) {
    (void)state;
    for (int round = 0; round < 1500; round++) {
        shape s;
        random_shape(&s, 4, 6, 3, 6);
        text_begin("POLYGON");
        text_add_shape(&s);
        rqt_region *region = region_here();
        shape shell = s;
        shell.rings = 1;
        bool thin = !oracle_areas_meet(everywhere, &shell);
        for (int y = -1; y <= 7; y++) {
            for (int x = -1; x <= 7; x++) {
                /* inside means: nothing is lacking in a box around it, so small that no other edge comes near */
                shape lacks = s;
                for (int r = 0; r < s.rings; r++)
                    for (int i = 0; i < s.spots[r]; i++)
                        lacks.at[r][i] = (spot){(s.at[r][i].x - 4 * x) * 16, (s.at[r][i].y - 4 * y) * 16};
                const spot corner[4] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
                lacks.spots[lacks.rings] = 4;
                memcpy(lacks.at[lacks.rings++], corner, sizeof corner);
                const spot half[2][3] = {{corner[0], corner[1], corner[2]}, {corner[0], corner[3], corner[2]}};
                bool expected = !thin && !oracle_areas_meet(half[0], &lacks) && !oracle_areas_meet(half[1], &lacks);
                if (rqt_region_contains(region, (rqt_vertex){x, y}) != expected)
                    fail_msg("%d %d should %sbe in %s", x, y, expected ? "" : "not ", text);
            }
        }
        rqt_region_free(region);
    }
}

static rqt_region *rectangle(double x0, double y0, double x1, double y1, const rqt_placement *placement) {
    char wkt[400];
    (void)snprintf(wkt, sizeof wkt, "POLYGON((%.17g %.17g,%.17g %.17g,%.17g %.17g,%.17g %.17g,%.17g %.17g))", x0,
                   y0, x1, y0, x1, y1, x0, y1, x0, y0);
    return region_of_text(wkt, placement, 101, 101);
}

/* Parts of a cut select what the whole does: the cut has no inverse in binary, the placement neither. */
static void test_cover_distributes_over_cuts(void **state) {
    (void)state;
    const rqt_placement odd = {7.1, 47.3, 1.0 / 3600, -1.0 / 3600};
    for (int round = 0; round < 4000; round++) {
        double x[3], y[2];
        for (int i = 0; i < 3; i++)
            x[i] = odd.x0 + (between(0, 1) ? between(0, 300) / 3.0 : between(0, 100)) / 3600;
        for (int i = 0; i < 2; i++)
            y[i] = odd.y0 - (between(0, 1) ? between(0, 300) / 3.0 : between(0, 100)) / 3600;
        double low = fmin(fmin(x[0], x[1]), x[2]), high = fmax(fmax(x[0], x[1]), x[2]);
        double cut = fmax(fmin(x[0], x[1]), fmin(fmax(x[0], x[1]), x[2])); /* the middle one */
        if (low == cut || cut == high || y[0] == y[1]) continue;
        rqt_region *whole = rectangle(low, y[0], high, y[1], &odd);
        rqt_region *left = rectangle(low, y[0], cut, y[1], &odd), *right = rectangle(cut, y[0], high, y[1], &odd);
        for (int i = 0; i < 20; i++) {
            spot t[3];
            random_triangle(t, 0, 100);
            if (i % 2) {
                t[1] = (spot){t[0].x + 4 * between(1, 3), t[0].y};
                t[2] = (spot){t[0].x, t[0].y + 4 * between(1, 3)};
            }
            if (meets(whole, t) != (meets(left, t) || meets(right, t)))
                fail_msg("seed %llu: %.17g %.17g %.17g x %.17g %.17g, triangle %d %d %d %d %d %d",
                         (unsigned long long)seed, low, cut, high, y[0], y[1], t[0].x, t[0].y, t[1].x, t[1].y,
                         t[2].x, t[2].y);
        }
        rqt_region_free(whole);
        rqt_region_free(left);
        rqt_region_free(right);
    }
}

/* Big ones, so that trees have several floors: a skyline of a thousand columns is the union of its columns. */
static void test_long_borders_are_searched_right(void **state) {
    (void)state;
    for (int round = 0; round < 6; round++) {
        int height[1000];
        text_begin("POLYGON((");
        text_add_spot((spot){0, 0});
        for (int i = 0; i < 1000; i++) {
            height[i] = round == 0 ? 12 : between(1, 120);
            text_add(",");
            text_add_spot((spot){4 * i, height[i]});
            text_add(",");
            text_add_spot((spot){4 * i + 4, height[i]});
        }
        text_add(",");
        text_add_spot((spot){4000, 0});
        text_add(",");
        text_add_spot((spot){0, 0});
        text_add("))");
        rqt_region *region = region_here();
        for (int i = 0; i < 4000; i++) {
            spot t[3];
            int x = between(-3, 1000), y = between(-3, 32), x0 = x < 0 ? 0 : x, x1 = x0;
            bool expected = false;
            do
                for (int k = 0; k < 3; k++) t[k] = (spot){4 * (x + between(0, 4)), 4 * (y + between(0, 4))};
            while (side(t[0], t[1], t[2]) == 0);
            for (x1 = x + 4; x0 < x1 && x0 < 1000 && !expected; x0++) {
                int l = 4 * (x0 - x), h = height[x0] - 4 * y;
                shape column = {1, {4}, {{{l, -4 * y}, {l + 4, -4 * y}, {l + 4, h}, {l, h}}}};
                spot near[3];
                for (int k = 0; k < 3; k++) near[k] = (spot){t[k].x - 4 * x, t[k].y - 4 * y};
                expected = oracle_areas_meet(near, &column);
            }
            if (meets(region, t) != expected) fail_shape(t, expected);
            int low = 1000, high = 0, from = between(0, 998), to = between(from + 1, 999), top = between(1, 30);
            for (int k = from; k < to; k++) {
                if (height[k] < low) low = height[k];
                if (height[k] > high) high = height[k];
            }
            assert_int_equal(rqt_region_box_relation(region, from, 0, to, top),
                             4 * top <= low ? RQT_INSIDE : RQT_ACROSS);
            assert_int_equal(rqt_region_box_relation(region, from, top, to, top + 5), 4 * top >= high ? RQT_OUTSIDE
                                                                                      : 4 * top + 20 <= low
                                                                                          ? RQT_INSIDE
                                                                                          : RQT_ACROSS);
        }
        rqt_region_free(region);
    }
}

static void test_many_members_are_searched_right(void **state) {
    (void)state;
    static bool taken[60][60];
    text_begin("GEOMETRYCOLLECTION(POLYGON EMPTY");
    for (int y = 0; y < 60; y++) {
        for (int x = 0; x < 60; x++) {
            taken[y][x] = between(0, 3) == 0;
            const shape cell = {
                1, {4}, {{{4 * x, 4 * y}, {4 * x, 4 * y + 4}, {4 * x + 4, 4 * y + 4}, {4 * x + 4, 4 * y}}}};
            if (taken[y][x]) {
                text_add(",POLYGON");
                text_add_shape(&cell);
            }
        }
    }
    text_add(")");
    rqt_region *region = region_here();
    for (int i = 0; i < 20000; i++) {
        int x = between(0, 58), y = between(0, 58), w = between(1, 59 - x), h = between(1, 59 - y);
        bool any = false, all = true;
        for (int r = y; r < y + h; r++)
            for (int c = x; c < x + w; c++) taken[r][c] ? (any = true) : (all = false);
        rqt_relation relation = rqt_region_box_relation(region, x, y, x + w, y + h);
        assert_int_equal(relation == RQT_OUTSIDE, !any);
        assert_true(relation != RQT_INSIDE || all);
        assert_int_equal(
            rqt_region_meets(region, (rqt_vertex){x, y}, (rqt_vertex){x + 1, y}, (rqt_vertex){x, y + 1}),
            taken[y][x]);
    }
    rqt_region_free(region);
}

static void expect_box(const char *wkt, const rqt_placement *placement, int x0, int y0, int x1, int y1) {
    int32_t b[4];
    rqt_region *region = region_of_text(wkt, placement, 101, 51);
    bool hit = rqt_region_box(region, &b[0], &b[1], &b[2], &b[3]);
    rqt_region_free(region);
    assert_int_equal(hit, x0 <= x1);
    if (hit && (b[0] != x0 || b[1] != y0 || b[2] != x1 || b[3] != y1))
        fail_msg("%s: %d %d %d %d", wkt, (int)b[0], (int)b[1], (int)b[2], (int)b[3]);
}

static void test_boxes_grow_outward_and_stay_in_the_raster(void **state) {
    (void)state;
    expect_box("POLYGON((10.5 10.5,20.5 10.5,20.5 20.5,10.5 10.5))", &plain, 10, 10, 21, 21);
    expect_box("POLYGON((10 10,20 10,20 20,10 10))", &plain, 10, 10, 20, 20);
    expect_box("LINESTRING(-5.5 -7,500 12.25)", &plain, 0, 0, 100, 13);
    expect_box("GEOMETRYCOLLECTION(POINT(3 4),POLYGON((10 10,20 10,20 20,10 10)))", &plain, 3, 4, 20, 20);
    expect_box("POINT(100 50)", &plain, 100, 50, 100, 50);
    expect_box("POINT(100.1 50)", &plain, 1, 0, 0, 0);
    expect_box("POINT(5 -0.5)", &plain, 1, 0, 0, 0);
    expect_box("POLYGON EMPTY", &plain, 1, 0, 0, 0);
    expect_box("POLYGON((-5 -5,-1 -5,-1 -1,-5 -5))", &plain, 1, 0, 0, 0);
    expect_box("POLYGON((-1e300 -1e300,1e300 -1e300,1e300 1e300,-1e300 1e300,-1e300 -1e300))", &plain, 0, 0, 100,
               50);
    const rqt_placement up = {1000, 2000, 30, -30};
    expect_box("POINT(1090 1940)", &up, 3, 2, 3, 2);
    expect_box("POLYGON((1000 2000,1031 2000,1031 1969,1000 1969,1000 2000))", &up, 0, 0, 2, 2);
}

static void test_far_coordinates_are_taken_as_far(void **state) {
    (void)state;
    const rqt_placement tiny = {-1.7e308, 1.7e308, 1e-300, -1e-300};
    const spot t[3] = {{0, 0}, {40, 0}, {0, 40}};
    static const char huge[] = "POLYGON((-1e300 -1e300,1e300 -1e300,1e300 1e300,-1e300 1e300,-1e300 -1e300),"
                               "(2 2,4 2,4 4,2 4,2 2))";
    rqt_region *region = region_of_text(huge, &plain, 101, 101);
    assert_true(meets(region, t));
    assert_int_equal(rqt_region_box_relation(region, 2, 2, 4, 4), RQT_OUTSIDE);
    assert_int_equal(rqt_region_box_relation(region, 5, 5, 100, 100), RQT_INSIDE);
    assert_int_equal(rqt_region_box_relation(region, 1, 1, 3, 3), RQT_ACROSS);
    assert_true(rqt_region_contains(region, (rqt_vertex){50, 50}));
    rqt_region_free(region);
    region = region_of_text("POLYGON((-1e300 0,0 1e300,1e300 0,0 -1e300,-1e300 0))", &plain, 101, 101);
    assert_true(meets(region, t)); /* slanted, at the limit of the numbers */
    assert_int_equal(rqt_region_box_relation(region, 0, 0, INT32_MAX, INT32_MAX), RQT_INSIDE);
    assert_int_equal(rqt_region_box_relation(region, INT32_MIN, INT32_MIN, 0, 0), RQT_INSIDE);
    rqt_region_free(region);
    region = region_of_text("POLYGON((0 0,1e308 0,1e308 -1e308,0 0))", &tiny, 101, 101);
    assert_false(meets(region, t)); /* infinite after the division */
    assert_false(rqt_region_is_empty(region));
    rqt_region_free(region);
    region = region_of_text("LINESTRING(-1e300 -1e300,1e300 1e300)", &plain, 101, 101);
    assert_true(meets(region, t));
    assert_int_equal(rqt_region_box_relation(region, 0, 1, 1, 2), RQT_ACROSS);
    assert_int_equal(rqt_region_box_relation(region, 0, 2, 1, 3), RQT_OUTSIDE);
    rqt_region_free(region);
}

static void test_no_geometry_is_everything(void **state) {
    (void)state;
    const rqt_lattice lattice = {30, 20, 5};
    rqt_region *all;
    int32_t b[4];
    assert_int_equal(rqt_region_create(NULL, &shifted, &lattice, &allocator, &all), RQT_OK);
    assert_true(rqt_region_is_all(all) && !rqt_region_is_empty(all));
    assert_true(rqt_region_box(all, &b[0], &b[1], &b[2], &b[3]));
    assert_true(b[0] == 0 && b[1] == 0 && b[2] == 29 && b[3] == 19);
    assert_int_equal(rqt_region_box_relation(all, 0, 0, 32, 32), RQT_INSIDE);
    assert_true(rqt_region_contains(all, (rqt_vertex){0, 0}));
    assert_true(rqt_region_meets(all, (rqt_vertex){0, 0}, (rqt_vertex){1, 0}, (rqt_vertex){0, 1}));
    rqt_region_free(all);
    rqt_region *none = region_of_text("GEOMETRYCOLLECTION(POINT EMPTY,POLYGON EMPTY)", &plain, 30, 20);
    assert_true(rqt_region_is_empty(none) && !rqt_region_is_all(none));
    assert_false(rqt_region_meets(none, (rqt_vertex){0, 0}, (rqt_vertex){1, 0}, (rqt_vertex){0, 1}));
    assert_false(rqt_region_contains(none, (rqt_vertex){0, 0}));
    assert_int_equal(rqt_region_box_relation(none, 0, 0, 32, 32), RQT_OUTSIDE);
    rqt_region_free(none);
    rqt_region_free(NULL);
    static const rqt_placement bad[] = {{0, 0, 0, 1},         {0, 0, 1, 0},   {0, 0, INFINITY, 1},
                                        {0, 0, 1, -INFINITY}, {NAN, 0, 1, 1}, {0, INFINITY, 1, 1}};
    for (size_t i = 0; i < COUNT(bad); i++) {
        assert_int_equal(rqt_region_create(NULL, &bad[i], &lattice, &allocator, &all), RQT_INVALID);
        assert_null(all);
    }
}

static void test_every_refused_allocation_is_reported(void **state) {
    (void)state;
    static const char wkt[] = "GEOMETRYCOLLECTION(POINT(1 1),POLYGON((0 0,9 0,9 9,0 0),(1 1,2 1,2 2,1 1)),"
                              "POLYGON((0 0,5 0,9 0,0 0)))";
    const rqt_lattice lattice = {30, 20, 5};
    rqt_geometry *g;
    rqt_region *region;
    assert_int_equal(rqt_geometry_parse(wkt, strlen(wkt), true, &allocator, &g, NULL), RQT_OK);
    size_t live = test_heap.live, fail = 1;
    for (;; fail++) {
        test_heap.calls = 0;
        test_heap.fail_at = fail;
        rqt_status status = rqt_region_create(g, &plain, &lattice, &allocator, &region);
        if (status == RQT_OK) break;
        assert_int_equal(status, RQT_NO_MEMORY);
        assert_null(region);
        assert_int_equal(test_heap.live, live);
    }
    assert_true(fail > 6);
    rqt_region_free(region);
    rqt_geometry_free(g);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, begin_test, end_test)

int main(void) {
    const char *chosen = getenv("RQT_SEED");
    seed = chosen ? strtoull(chosen, NULL, 0) : (uint64_t)time(NULL);
    printf("RQT_SEED=%llu\n", (unsigned long long)seed);
    const struct CMUnitTest tests[] = {
        TEST(test_touching_is_not_meeting),
        TEST(test_points_and_lines_are_closed),
        TEST(test_collapsed_polygons_are_lines),
        TEST(test_polygons_meet_as_the_oracle_says),
        TEST(test_members_are_a_union),
        TEST(test_lines_meet_as_the_oracle_says),
        TEST(test_boxes_promise_what_triangles_keep),
        TEST(test_contains_is_the_interior),
        TEST(test_cover_distributes_over_cuts),
        TEST(test_long_borders_are_searched_right),
        TEST(test_many_members_are_searched_right),
        TEST(test_boxes_grow_outward_and_stay_in_the_raster),
        TEST(test_far_coordinates_are_taken_as_far),
        TEST(test_no_geometry_is_everything),
        TEST(test_every_refused_allocation_is_reported),
    };
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    free(text);
    return failed;
}
