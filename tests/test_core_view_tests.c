/* test_core_view_tests.c - the tests of the literature: what they allow, computed by hand, and where that is too
 * much.
 *
 * A counterexample is a sample and a point of a mesh, above or below it by what a test allows there, both put into
 * the picture: no part of the core takes part but the camera's projection. */
#include "test_core_support.h"

#include <math.h>

#define PI 3.14159265358979323846

static const double UP[3] = {0, 0, 1}, NORTH[3] = {0, 1, 0};

/* x east, y north, z up. */
static rqt_camera camera_at(const double eye[3], const double direction[3], double fovy, double width,
                            double height, double tau) {
    rqt_camera c = {.width = width, .height = height, .near = 0, .far = INFINITY, .tau = tau};
    rqt_message message;
    CHECK(rqt_camera_look(&c, eye, direction, UP, NORTH, fovy, &message) == RQT_OK, "%s", message.text);
    return c;
}

static rqt_view_piece piece_at(double x, double y, double z, double half, double half_height) {
    return (rqt_view_piece){
        .prism = {.centre = {x, y, z}, .up = {0, 0, 1}, .radius = half * sqrt(2), .half_height = half_height},
        .east = {1, 0, 0},
        .half_east = half,
        .half_north = half,
        .side = 1};
}

static rqt_view_bound bound_of(rqt_view_test test, const rqt_camera *c, const rqt_view_piece *p) {
    rqt_view_bound b;
    rqt_view_test_bound(test, c, p, &b);
    return b;
}

static double eps_at(rqt_view_test test, const rqt_camera *c, double x, double y, double z) {
    const rqt_view_piece p = piece_at(x, y, z, 0, 0);
    return bound_of(test, c, &p).eps;
}

static void near_to(double got, double wanted, const char *what) {
    CHECK(fabs(got - wanted) <= 1e-12 * fabs(wanted), "%s: %.17g, should be %.17g", what, got, wanted);
}

static void tests_have_names_and_metrics(void **state) {
    (void)state;
    static const char *const names[] = {"guaranteed", "ulrich", "node", "sphere", "lindstrom", "lodmap"};
    static const char *const metrics[] = {"exact", "local", "plane", "local", "local", "euclid"};
    for (int t = 0; t < RQT_VIEW_TESTS; t++) {
        assert_string_equal(rqt_view_test_name((rqt_view_test)t), names[t]);
        assert_string_equal(rqt_metric_name(rqt_view_test_metric((rqt_view_test)t)), metrics[t]);
    }
    assert_null(rqt_view_test_name((rqt_view_test)RQT_VIEW_TESTS));
    assert_int_equal(rqt_view_test_metric((rqt_view_test)RQT_VIEW_TESTS), RQT_METRIC_EXACT);
}

/* ---------------------------------------------------------------------------------------------- by hand -- */

/* Looking north from (0,0,0), fovy 2 atan 2, 1000 x 1000 pixels: f = 250; tau 2: 0.008 metres per metre. The piece
 * is around (0,100,-130): along the ground 90 .. 110 away, 120 .. 140 below. */
static void bounds_are_the_papers_computed_by_hand(void **state) {
    (void)state;
    const double eye[3] = {0, 0, 0};
    const rqt_camera c = camera_at(eye, NORTH, 360 / PI * atan(2), 1000, 1000, 2);
    near_to(c.focal, 250, "focal length");
    rqt_view_piece p = piece_at(0, 100, -130, 0, 10);
    p.prism.radius = 10;
    p.half_east = 4;
    p.half_north = 3;
    rqt_view_bound b = bound_of(RQT_VIEW_ULRICH, &c, &p);
    assert_true(b.shown);
    near_to(b.eps, 0.008 * 120, "ulrich: the height is the largest difference");
    near_to(b.share, 120.0 / 140, "ulrich: share");
    near_to(b.distance, 150, "distance: 90 and 120");

    b = bound_of(RQT_VIEW_SPHERE, &c, &p);
    near_to(b.eps, 150 * 2 * (2 * atan(2)) / 1000, "sphere: radians of the field of view by pixels");
    near_to(b.share, 150 / sqrt(110 * 110 + 140 * 140), "sphere: share");

    b = bound_of(RQT_VIEW_NODE, &c, &p);
    near_to(b.eps, 0.008 * sqrt(100 * 100 + 130 * 130), "node: the distance of the centre");
    near_to(b.share, 150 / sqrt(110 * 110 + 140 * 140), "node: share");

    b = bound_of(RQT_VIEW_LINDSTROM, &c, &p);
    near_to(b.eps, 0.008 * (110 + 120 * 120 / 110.0), "lindstrom: least at the far end of the ground");
    near_to(b.share, (110 + 120 * 120 / 110.0) / (90 + 140 * 140 / 90.0), "lindstrom: share");

    const double distance = sqrt(100 * 100 + 130 * 130);
    b = bound_of(RQT_VIEW_LODMAP, &c, &p);
    near_to(b.eps, 0.008 * distance / ((1 + 100 / distance) / 2), "lodmap: ahead counts more");
    assert_true(b.share == 1);
    p.side = RQT_VIEW_PATCH;
    assert_true(bound_of(RQT_VIEW_LODMAP, &c, &p).share == 1);
    p.side = 2 * RQT_VIEW_PATCH;
    assert_true(bound_of(RQT_VIEW_LODMAP, &c, &p).share == 0 && bound_of(RQT_VIEW_LODMAP, &c, &p).eps == 0);

    /* lindstrom, the least inside: at r = h = 95 it is 2 h; and straight ahead, where there is no height, r. */
    p = piece_at(0, 100, -100, 0, 5);
    p.prism.radius = 10;
    near_to(bound_of(RQT_VIEW_LINDSTROM, &c, &p).eps, 0.008 * 190, "lindstrom: least where r = h");
    near_to(bound_of(RQT_VIEW_LINDSTROM, &c, &p).share, 190 / (90 + 105 * 105 / 90.0), "lindstrom: share");
    p = piece_at(0, 100, -3, 0, 5);
    p.prism.radius = 10;
    near_to(bound_of(RQT_VIEW_LINDSTROM, &c, &p).eps, 0.008 * 90, "lindstrom: level with the eye");
    /* Below the eye it asks for nothing; at the eye for everything. */
    assert_true(eps_at(RQT_VIEW_LINDSTROM, &c, 0, 0, 0) == 0);
    const double down[3] = {0, 0, -1};
    const rqt_camera d = camera_at(eye, down, 90, 1000, 1000, 2);
    assert_true(eps_at(RQT_VIEW_LINDSTROM, &d, 0, 0, -100) == INFINITY);
    /* ulrich: each direction can be the largest, and the box is turned with the terrain. */
    p = piece_at(60, 80, -20, 5, 5);
    near_to(bound_of(RQT_VIEW_ULRICH, &c, &p).eps, 0.008 * 75, "ulrich: north");
    p = piece_at(60, 40, -20, 5, 5);
    near_to(bound_of(RQT_VIEW_ULRICH, &c, &p).eps, 0.008 * 55, "ulrich: east");
    p = piece_at(60, 80, -20, 5, 5);
    p.east[0] = 0.6;
    p.east[1] = 0.8;
    near_to(bound_of(RQT_VIEW_ULRICH, &c, &p).eps, 0.008 * 95, "ulrich: a box that looks at the eye");
    /* The eye in the box: the published difference would be negative. */
    p = piece_at(0, 1, 0, 5, 5);
    assert_true(bound_of(RQT_VIEW_ULRICH, &c, &p).eps == 0);
}

static void the_guaranteed_test_is_the_tolerance(void **state) {
    (void)state;
    const double eye[3] = {0, 0, 0};
    const rqt_camera c = camera_at(eye, NORTH, 60, 1000, 700, 1);
    const rqt_view_piece p = piece_at(10, 300, -20, 8, 3);
    const rqt_view_bound b = bound_of(RQT_VIEW_GUARANTEED, &c, &p);
    rqt_view_bound right;
    rqt_view_tolerance(&c, &p.prism, &right);
    assert_memory_equal(&b, &right, sizeof b);
}

/* -------------------------------------------------------------------------------------------- distances -- */

static void eps_grows_with_distance_as_each_paper_says(void **state) {
    (void)state;
    random_begin("distance");
    const double eye[3] = {500, -200, 1000};
    for (int round = 0; round < 400; round++) {
        const double yaw = 2 * PI * random_unit(), pitch = PI * (random_unit() - 0.5) * 0.9;
        const double to[3] = {sin(yaw) * cos(pitch), cos(yaw) * cos(pitch), sin(pitch)};
        const rqt_camera c = camera_at(eye, to, 80, 1000, 800, 1 + random_unit());
        for (int t = RQT_VIEW_ULRICH; t < RQT_VIEW_TESTS; t++) {
            const double one =
                eps_at((rqt_view_test)t, &c, eye[0] + 100 * to[0], eye[1] + 100 * to[1], eye[2] + 100 * to[2]);
            for (double times = 2; times < 1e6; times *= 2) {
                const double d = 100 * times;
                const double more =
                    eps_at((rqt_view_test)t, &c, eye[0] + d * to[0], eye[1] + d * to[1], eye[2] + d * to[2]);
                CHECK(fabs(more / (one * times) - 1) < 1e-9, "%s: %g times as far: %g, not %g",
                      rqt_view_test_name((rqt_view_test)t), times, more, one * times);
            }
        }
        /* In which direction it grows. sphere and node do not care; ulrich asks for more along diagonals;
         * lindstrom for less from above, and is the same all around. */
        const double d = 100, per = c.tau / c.focal;
        near_to(eps_at(RQT_VIEW_NODE, &c, eye[0] + d * to[0], eye[1] + d * to[1], eye[2] + d * to[2]) / (per * d),
                1, "node");
        const double largest = fmax(fmax(fabs(to[0]), fabs(to[1])), fabs(to[2]));
        CHECK(fabs(eps_at(RQT_VIEW_ULRICH, &c, eye[0] + d * to[0], eye[1] + d * to[1], eye[2] + d * to[2]) /
                       (per * d * largest) -
                   1) < 1e-12,
              "ulrich at yaw %g, pitch %g", yaw, pitch);
        CHECK(fabs(eps_at(RQT_VIEW_LINDSTROM, &c, eye[0] + d * to[0], eye[1] + d * to[1], eye[2] + d * to[2]) /
                       (per * d / cos(pitch)) -
                   1) < 1e-12,
              "lindstrom at yaw %g, pitch %g", yaw, pitch);
        /* lodmap: ahead the distance; aside more. */
        CHECK(fabs(eps_at(RQT_VIEW_LODMAP, &c, eye[0] + d * to[0], eye[1] + d * to[1], eye[2] + d * to[2]) /
                       (per * d) -
                   1) < 1e-12,
              "lodmap ahead");
        double before = per * d;
        for (double angle = 0.05; angle < 0.6; angle += 0.05) {
            double side[3];
            for (int i = 0; i < 3; i++)
                side[i] = eye[i] + d * (cos(angle) * c.forward[i] + sin(angle) * c.right[i]);
            const double more = eps_at(RQT_VIEW_LODMAP, &c, side[0], side[1], side[2]);
            CHECK(more > before && fabs(more / (2 * per * d / (1 + cos(angle))) - 1) < 1e-12, "lodmap, %g aside",
                  angle);
            before = more;
        }
    }
}

/* A random camera in the scene, sometimes a strange one. */
static rqt_camera random_camera(void) {
    const double eye[3] = {1000 * (random_unit() - 0.5), 1000 * (random_unit() - 0.5),
                           1000 * (random_unit() - 0.5)};
    const int kind = random_between(0, 9);
    double direction[3] = {random_unit() - 0.5, random_unit() - 0.5, random_unit() - 0.5};
    if (kind == 0) direction[0] = direction[1] = 0, direction[2] = -1;
    const double fovy = kind == 1 ? 170 : kind == 2 ? 0.01 : 1 + 150 * random_unit();
    rqt_camera c = camera_at(eye, direction, fovy, 200 + random_between(0, 1000), 200 + random_between(0, 1000),
                             0.25 + 4 * random_unit());
    if (kind == 3) c.near = 100 * random_unit();
    if (kind == 4) c.far = 1 + 500 * random_unit();
    return c;
}

static rqt_view_piece random_piece(const rqt_camera *c) {
    const double away = 500 * random_unit() * random_unit(), size = away * random_unit() * random_unit();
    double at[3];
    for (int i = 0; i < 3; i++)
        at[i] = c->eye[i] + away * (c->forward[i] + 2 * (random_unit() - 0.5) * c->right[i] +
                                    2 * (random_unit() - 0.5) * c->up[i]);
    rqt_view_piece p = piece_at(at[0], at[1], at[2], size, size * random_unit());
    const double turn = 2 * PI * random_unit();
    p.east[0] = cos(turn);
    p.east[1] = sin(turn);
    return p;
}

static void random_point(const rqt_view_piece *p, double out[3]) {
    const double *const east = p->east, north[3] = {-east[1], east[0], 0};
    const double e = p->half_east * (2 * random_unit() - 1), n = p->half_north * (2 * random_unit() - 1),
                 h = p->prism.half_height * (2 * random_unit() - 1);
    for (int i = 0; i < 3; i++) out[i] = p->prism.centre[i] + e * east[i] + n * north[i] + (i == 2 ? h : 0);
}

/* Vertices and boxes are asked at the nearest point, and never for more than their share; what the picture holds is
 * shown. */
static void a_piece_gets_the_least_of_its_points_and_is_shown_with_one(void **state) {
    (void)state;
    random_begin("pieces");
    static const rqt_view_test tests[] = {RQT_VIEW_ULRICH, RQT_VIEW_SPHERE, RQT_VIEW_LINDSTROM};
    int hidden = 0, drawn = 0;
    for (int round = 0; round < 30000; round++) {
        const rqt_camera c = random_camera();
        rqt_view_piece p = random_piece(&c);
        double at[3], xy[2];
        random_point(&p, at);
        const bool seen = rqt_camera_project(&c, at, xy);
        for (int t = RQT_VIEW_ULRICH; t < RQT_VIEW_TESTS; t++) {
            const rqt_view_bound b = bound_of((rqt_view_test)t, &c, &p);
            CHECK(b.eps >= 0 && b.share >= 0 && b.share <= 1 && b.distance >= 0, "%s",
                  rqt_view_test_name((rqt_view_test)t));
            CHECK(b.shown || !seen, "%s: a drawn point is left out", rqt_view_test_name((rqt_view_test)t));
            CHECK(b.shown || (b.eps == INFINITY && b.share == 1), "%s: something is asked for what is left out",
                  rqt_view_test_name((rqt_view_test)t));
            hidden += !b.shown;
            drawn += seen;
            const double v[3] = {at[0] - c.eye[0], at[1] - c.eye[1], at[2] - c.eye[2]};
            CHECK(b.distance <= sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) * (1 + 1e-12), "distance");
        }
        if (!seen) continue;
        for (int i = 0; i < 3; i++) {
            const rqt_view_bound b = bound_of(tests[i], &c, &p);
            rqt_view_piece point = p;
            memcpy(point.prism.centre, at, sizeof at);
            point.prism.radius = point.prism.half_height = point.half_east = point.half_north = 0;
            const double own = bound_of(tests[i], &c, &point).eps;
            /* A point on the picture's very rim may be left out by rounding, and then asks for nothing. */
            CHECK(b.eps <= own * (1 + 1e-12), "%s: %g for all, %g for a point of it", rqt_view_test_name(tests[i]),
                  b.eps, own);
            CHECK(own == INFINITY || b.eps * (1 + 1e-12) >= b.share * own, "%s: share %g of %g, but %g",
                  rqt_view_test_name(tests[i]), b.share, own, b.eps);
        }
    }
    printf("%d left out, %d drawn\n", hidden, drawn);
    assert_true(hidden > 5000 && drawn > 5000);
}

static void what_is_behind_the_eye_is_left_out(void **state) {
    (void)state;
    const double eye[3] = {0, 0, 0};
    rqt_camera c = camera_at(eye, NORTH, 60, 1000, 1000, 1);
    for (int t = RQT_VIEW_ULRICH; t < RQT_VIEW_TESTS; t++) {
        const rqt_view_test test = (rqt_view_test)t;
        assert_true(eps_at(test, &c, 0, -100, -5) == INFINITY);
        assert_true(eps_at(test, &c, 100, 100, -5) == INFINITY);
        assert_true(eps_at(test, &c, -100, 100, -5) == INFINITY);
        assert_true(eps_at(test, &c, 0, 100, -70) == INFINITY);
        assert_true(eps_at(test, &c, 0, 100, 70) == INFINITY);
        assert_true(isfinite(eps_at(test, &c, 50, 100, -50)));
        assert_true(isfinite(eps_at(test, &c, -50, 100, 50)));
    }
    c.near = 90, c.far = 110;
    for (int t = RQT_VIEW_ULRICH; t < RQT_VIEW_TESTS; t++) {
        assert_true(eps_at((rqt_view_test)t, &c, 0, 89, -5) == INFINITY);
        assert_true(eps_at((rqt_view_test)t, &c, 0, 111, -5) == INFINITY);
        assert_true(isfinite(eps_at((rqt_view_test)t, &c, 0, 100, -5)));
    }
    /* lodmap, all the way behind an eye in the middle of a piece that reaches ahead of it. */
    c = camera_at(eye, NORTH, 60, 1000, 1000, 1);
    const rqt_view_piece behind = piece_at(0, -10, 0, 100, 5);
    const rqt_view_bound b = bound_of(RQT_VIEW_LODMAP, &c, &behind);
    assert_true(b.shown && b.eps == INFINITY);
    assert_true(eps_at(RQT_VIEW_LODMAP, &c, 0, 0, 0) == 0);
}

/* An eye in a box, on a vertex, below ground, 10^9 m away, without end: a number. */
static void F31_strange_eyes_get_a_number(void **state) {
    (void)state;
    const double eyes[][3] = {{0, 0, 0},         {0, 0, -5},    {0, 0, 1e9},
                              {1e9, -1e9, 1e-9}, {1e300, 0, 0}, {1e300, 1e300, 1e300},
                              {0, 0, 5e-324}};
    for (size_t e = 0; e < sizeof eyes / sizeof *eyes; e++) {
        const double directions[][3] = {{0, 0, -1}, {0, 1, 0}, {-1, 1, 0}, {0, 0, 1}};
        for (int d = 0; d < 4; d++) {
            rqt_camera c = camera_at(eyes[e], directions[d], 170, 1000, 1000, 1);
            for (int t = 0; t < RQT_VIEW_TESTS; t++)
                for (int size = 0; size < 3; size++) {
                    const rqt_view_piece p = piece_at(0, 0, 0,
                                                      size == 0   ? 0
                                                      : size == 1 ? 10
                                                                  : 1e300,
                                                      size == 2 ? 1e300 : 1);
                    const rqt_view_bound b = bound_of((rqt_view_test)t, &c, &p);
                    CHECK(b.eps >= 0 && b.share >= 0 && b.share <= 1 && b.distance >= 0,
                          "%s, eye %zu, direction %d, size %d: eps %g, share %g, distance %g",
                          rqt_view_test_name((rqt_view_test)t), e, d, size, b.eps, b.share, b.distance);
                }
        }
    }
    /* In the box, everything is asked for. */
    const double eye[3] = {3, 4, 0};
    const rqt_camera c = camera_at(eye, NORTH, 60, 1000, 1000, 1);
    const rqt_view_piece p = piece_at(0, 0, 0, 10, 1);
    assert_true(bound_of(RQT_VIEW_ULRICH, &c, &p).eps == 0 && bound_of(RQT_VIEW_SPHERE, &c, &p).eps == 0);
    assert_true(bound_of(RQT_VIEW_LINDSTROM, &c, &p).eps == 0);
}

/* A scene and the same 10^7 m further north and east: what is near the eye is told as exactly. */
static void F34_far_from_the_origin_a_test_says_the_same(void **state) {
    (void)state;
    random_begin("far off");
    const double far_off[3] = {1e7, 1e7, 4000};
    for (int round = 0; round < 2000; round++) {
        rqt_camera c = random_camera();
        const rqt_view_piece p = random_piece(&c);
        rqt_camera there = c;
        rqt_view_piece moved = p;
        for (int i = 0; i < 3; i++) {
            there.eye[i] += far_off[i];
            moved.prism.centre[i] += far_off[i];
        }
        for (int t = 0; t < RQT_VIEW_TESTS; t++) {
            const rqt_view_bound a = bound_of((rqt_view_test)t, &c, &p),
                                 b = bound_of((rqt_view_test)t, &there, &moved);
            if (a.shown != b.shown || t == RQT_VIEW_LINDSTROM) continue; /* on the frustum's border; over the eye */
            CHECK(a.eps == b.eps || fabs(a.eps - b.eps) <= 1e-6 * (1 + a.eps + a.distance),
                  "%s: %.17g, and far off %.17g", rqt_view_test_name((rqt_view_test)t), a.eps, b.eps);
        }
    }
}

/* ------------------------------------------------------------------------------------- counterexamples -- */

/* Pixels from a sample to a point at `rise` metres above it; infinite where that is behind the eye. */
static double moved(const rqt_camera *c, const double s[3], double rise) {
    const double m[3] = {s[0], s[1], s[2] + rise};
    double a[2], b[2];
    assert_true(rqt_camera_project(c, s, a));
    (void)rqt_camera_project(c, m, b);
    return isnan(b[0]) ? INFINITY : sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]));
}

/* What a test lets a sample move in the picture, over tau: the piece is p, the sample in it s. */
static double worst_move(rqt_view_test test, const rqt_camera *c, const rqt_view_piece *p, const double s[3]) {
    const double eps = bound_of(test, c, p).eps;
    if (eps == INFINITY) return INFINITY;
    return fmax(moved(c, s, eps), moved(c, s, -eps)) / c->tau;
}

/* Fields of view of 30, 60, 90, 120 and 170 degrees, 16 by 9, from straight down to level: the corner of the
 * picture, a piece of a thousandth of its distance there. All of the papers count pixels as in the middle of the
 * picture. */
static void F32_named_tests_break_tau_off_the_axis(void **state) {
    (void)state;
    const double fovy[] = {30, 60, 90, 120, 170}, eye[3] = {0, 0, 0};
    double worst[RQT_VIEW_TESTS][5] = {{0}};
    for (int f = 0; f < 5; f++)
        for (double pitch = -90; pitch <= 0; pitch += 7.5)
            for (int corner = 0; corner < 4; corner++) {
                const double direction[3] = {0, cos(pitch * PI / 180), sin(pitch * PI / 180)};
                const rqt_camera c = camera_at(eye, direction, fovy[f], 1600, 900, 1);
                double s[3];
                const double x = (corner & 1 ? 799 : -799) / c.focal, y = (corner & 2 ? 449 : -449) / c.focal;
                for (int i = 0; i < 3; i++) s[i] = 1000 * (c.forward[i] + x * c.right[i] + y * c.up[i]);
                const rqt_view_piece p = piece_at(s[0], s[1], s[2], 1, 1);
                for (int t = 0; t < RQT_VIEW_TESTS; t++)
                    worst[t][f] = fmax(worst[t][f], worst_move((rqt_view_test)t, &c, &p, s));
            }
    for (int t = 0; t < RQT_VIEW_TESTS; t++)
        printf("%-10s %6.2f %6.2f %6.2f %6.2f %8.2f tau at %g .. %g degrees\n",
               rqt_view_test_name((rqt_view_test)t), worst[t][0], worst[t][1], worst[t][2], worst[t][3],
               worst[t][4], fovy[0], fovy[4]);
    for (int f = 0; f < 5; f++) CHECK(worst[RQT_VIEW_GUARANTEED][f] <= 1, "%g", worst[RQT_VIEW_GUARANTEED][f]);
    for (int t = RQT_VIEW_ULRICH; t < RQT_VIEW_TESTS; t++)
        CHECK(worst[t][2] > 1.5 && worst[t][4] > 10, "%s keeps tau: %g, %g", rqt_view_test_name((rqt_view_test)t),
              worst[t][2], worst[t][4]);
}

/* 100 m above the ground, 60 degrees. From above a vertical segment is a point; not so the ground beside it, nor as
 * it comes nearer. */
static void F33_lindstrom_asks_nothing_straight_down(void **state) {
    (void)state;
    const double eye[3] = {0, 0, 100}, down[3] = {0, 0, -1}, s[3] = {0.05, 0, 0};
    const rqt_camera c = camera_at(eye, down, 60, 1000, 1000, 1);
    const rqt_view_piece p = piece_at(0.05, 0, 0, 0.01, 0);
    const double eps = bound_of(RQT_VIEW_LINDSTROM, &c, &p).eps;
    printf("5 cm beside the eye's foot: eps %.1f m, the eye is at 100 m\n", eps);
    assert_true(eps > 100 && worst_move(RQT_VIEW_LINDSTROM, &c, &p, s) == INFINITY);
    assert_true(worst_move(RQT_VIEW_GUARANTEED, &c, &p, s) <= 1);
}

/* One distance for all of a patch or a node is not that of its nearest sample: 90 m before the eye it is as if
 * 1000 m away. */
static void a_middle_is_not_where_a_piece_is_nearest(void **state) {
    (void)state;
    const double eye[3] = {0, 0, 0};
    const rqt_camera c = camera_at(eye, NORTH, 60, 1000, 1000, 1);
    rqt_view_piece p = piece_at(0, 1000, 0, 910, 5);
    p.side = RQT_VIEW_PATCH;
    const double s[3] = {0, 90, 0};
    for (int i = 0; i < 2; i++) {
        const rqt_view_test test = i ? RQT_VIEW_LODMAP : RQT_VIEW_NODE;
        const double most = worst_move(test, &c, &p, s);
        CHECK(fabs(most - 1000 / 90.0) < 1e-9, "%s: %g tau", rqt_view_test_name(test), most);
    }
    assert_true(worst_move(RQT_VIEW_GUARANTEED, &c, &p, s) <= 1);
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(tests_have_names_and_metrics),
        TEST(bounds_are_the_papers_computed_by_hand),
        TEST(the_guaranteed_test_is_the_tolerance),
        TEST(eps_grows_with_distance_as_each_paper_says),
        TEST(a_piece_gets_the_least_of_its_points_and_is_shown_with_one),
        TEST(what_is_behind_the_eye_is_left_out),
        TEST(F31_strange_eyes_get_a_number),
        TEST(F34_far_from_the_origin_a_test_says_the_same),
        TEST(F32_named_tests_break_tau_off_the_axis),
        TEST(F33_lindstrom_asks_nothing_straight_down),
        TEST(a_middle_is_not_where_a_piece_is_nearest),
    };
    return cmocka_run_group_tests_name("tests of the literature", tests, NULL, NULL);
}
