/* test_core_band.c - a view made for one camera is right for all cameras of its band.
 *
 * Cameras, pieces of a scene and cameras of the band by chance, many at the band's ends; a sample of the piece, a
 * point of a mesh as far from it as the piece that was grown is allowed; both are projected here, by the camera of
 * the band, with nothing but the definition of a picture. */
#include "test_core_support.h"

#include "rqt_view.h"

#include <math.h>

typedef struct vector {
    double c[3];
} vector;

static vector random_direction(void) {
    for (;;) {
        const vector v = {{2 * random_unit() - 1, 2 * random_unit() - 1, 2 * random_unit() - 1}};
        const double n = v.c[0] * v.c[0] + v.c[1] * v.c[1] + v.c[2] * v.c[2];
        if (n > 1 || n < 0.01) continue;
        return (vector){{v.c[0] / sqrt(n), v.c[1] / sqrt(n), v.c[2] / sqrt(n)}};
    }
}

/* 10^low .. 10^high */
static double random_size(double low, double high) {
    return pow(10, low + (high - low) * random_unit());
}

static rqt_camera random_camera(void) {
    static const double fovy[] = {0.01, 1, 20, 60, 60, 90, 150, 170};
    static const double near[] = {0, 0, 0, 1, 50}, far[] = {INFINITY, INFINITY, 1000, 1e6};
    rqt_camera camera = {.width = random_between(1, 2000), .height = random_between(1, 2000)};
    camera.near = near[random_between(0, 4)];
    camera.far = far[random_between(0, 3)];
    camera.tau = random_size(-1, 1);
    const double reach = random_between(0, 3) ? random_size(0, 4) : 6.4e6;
    const vector at = random_direction(), direction = random_direction(), up = random_direction(),
                 ahead = random_direction();
    const double eye[3] = {at.c[0] * reach, at.c[1] * reach, at.c[2] * reach};
    assert_int_equal(rqt_camera_look(&camera, eye, direction.c, up.c, ahead.c, fovy[random_between(0, 7)], NULL),
                     RQT_OK);
    return camera;
}

/* Turned around an axis by Rodrigues' formula: share of the band's turn. */
static vector turned(const double v[3], vector axis, double angle) {
    const double *k = axis.c, s = sin(angle), h = 2 * sin(angle / 2) * sin(angle / 2);
    const vector kv = {{k[1] * v[2] - k[2] * v[1], k[2] * v[0] - k[0] * v[2], k[0] * v[1] - k[1] * v[0]}};
    const vector kkv = {
        {k[1] * kv.c[2] - k[2] * kv.c[1], k[2] * kv.c[0] - k[0] * kv.c[2], k[0] * kv.c[1] - k[1] * kv.c[0]}};
    vector out;
    for (int c = 0; c < 3; c++) out.c[c] = v[c] + s * kv.c[c] + h * kkv.c[c];
    return out;
}

static rqt_camera random_neighbour(const rqt_camera *a, const rqt_view_band *band, double share) {
    rqt_camera b = *a;
    const vector move = random_direction(), axis = random_direction();
    const double angle = 2 * asin(band->turn / 2 * share);
    for (int c = 0; c < 3; c++) b.eye[c] += move.c[c] * band->move * share;
    memcpy(b.forward, turned(a->forward, axis, angle).c, sizeof b.forward);
    memcpy(b.right, turned(a->right, axis, angle).c, sizeof b.right);
    memcpy(b.up, turned(a->up, axis, angle).c, sizeof b.up);
    return b;
}

static double along(const rqt_camera *camera, const double axis[3], vector p) {
    double sum = 0;
    for (int c = 0; c < 3; c++) sum += axis[c] * (p.c[c] - camera->eye[c]);
    return sum;
}

/* 0: depth not above 0; 1: it has a place in the picture's plane; 2: it is drawn. */
static int look(const rqt_camera *camera, vector p, double xy[2]) {
    const double depth = along(camera, camera->forward, p);
    if (!(depth > 0)) return 0;
    xy[0] = camera->focal * along(camera, camera->right, p) / depth;
    xy[1] = camera->focal * along(camera, camera->up, p) / depth;
    return fabs(xy[0]) <= camera->width / 2 && fabs(xy[1]) <= camera->height / 2 && depth >= camera->near &&
                   depth <= camera->far
               ? 2
               : 1;
}

/* Somewhere in front of the camera, mostly: near its axis, at the picture's rim, or anywhere. */
static rqt_prism random_prism(const rqt_camera *camera, double distance) {
    rqt_prism prism;
    const double x = (random_unit() - 0.5) * 1.4 * camera->width / camera->focal,
                 y = (random_unit() - 0.5) * 1.4 * camera->height / camera->focal;
    const vector any = random_direction(), up = random_direction();
    const bool anywhere = random_between(0, 9) == 0;
    const double size = distance * random_size(-3, 0);
    for (int c = 0; c < 3; c++)
        prism.centre[c] =
            camera->eye[c] +
            distance * (anywhere ? any.c[c] : camera->forward[c] + x * camera->right[c] + y * camera->up[c]);
    memcpy(prism.up, up.c, sizeof prism.up);
    prism.radius = size * random_unit();
    prism.half_height = size * random_unit();
    prism.upright = random_between(0, 2) ? random_between(0, 1) : 0.9 + 0.1 * random_unit();
    return prism;
}

static vector random_sample(const rqt_prism *p) {
    const vector any = random_direction();
    const double *up = p->up;
    double dot = any.c[0] * up[0] + any.c[1] * up[1] + any.c[2] * up[2];
    const double height = (2 * random_unit() - 1) * p->half_height;
    vector flat, s;
    for (int c = 0; c < 3; c++) flat.c[c] = any.c[c] - dot * up[c];
    const double length = sqrt(flat.c[0] * flat.c[0] + flat.c[1] * flat.c[1] + flat.c[2] * flat.c[2]);
    const double radius = p->radius * (random_between(0, 1) ? 1 : sqrt(random_unit()));
    for (int c = 0; c < 3; c++)
        s.c[c] = p->centre[c] + (length > 1e-3 ? flat.c[c] / length * radius : 0) + up[c] * height;
    return s;
}

typedef struct tally {
    long drawn, hidden;
    double worst; /* in tau */
} tally;

/* A direction in which a mesh may differ from the sample: any, or not further from the piece's axis than upright
 * has it. */
static vector random_difference(const rqt_prism *p) {
    const vector any = random_direction();
    if (p->upright <= 0) return any;
    const double dot = any.c[0] * p->up[0] + any.c[1] * p->up[1] + any.c[2] * p->up[2],
                 sign = random_between(0, 1) ? 1 : -1;
    vector flat;
    for (int c = 0; c < 3; c++) flat.c[c] = any.c[c] - dot * p->up[c];
    const double length = sqrt(flat.c[0] * flat.c[0] + flat.c[1] * flat.c[1] + flat.c[2] * flat.c[2]);
    const double tilt =
        length > 1e-3 ? sqrt(fmax(0, 1 - p->upright * p->upright)) * (random_between(0, 1) ? 1 : random_unit()) : 0;
    vector out;
    for (int c = 0; c < 3; c++)
        out.c[c] = sign * sqrt(1 - tilt * tilt) * p->up[c] + (tilt > 0 ? tilt * flat.c[c] / length : 0);
    return out;
}

static void check_neighbour(const rqt_camera *b, const rqt_prism *prism, const rqt_view_bound *bound, tally *sum) {
    const vector s = random_sample(prism), away = random_difference(prism);
    const double off = fmin(bound->eps, 1e12) * (random_between(0, 1) ? 1 : random_unit());
    const vector m = {{s.c[0] + away.c[0] * off, s.c[1] + away.c[1] * off, s.c[2] + away.c[2] * off}};
    double one[2] = {0, 0}, other[2] = {0, 0};
    const int drawn = look(b, s, one), drawn_mesh = look(b, m, other);
    if (drawn < 2 && drawn_mesh < 2) {
        sum->hidden++;
        return;
    }
    CHECK(bound->shown, "what the band does not show is drawn");
    CHECK(drawn > 0 && drawn_mesh > 0, "one is drawn, the other behind the camera");
    const double apart = hypot(one[0] - other[0], one[1] - other[1]) / b->tau;
    sum->drawn++;
    if (apart > sum->worst) sum->worst = apart;
    CHECK(apart <= 1 + 1e-6, "%g tau apart, eps %g", apart, bound->eps);
}

static void F36_a_view_is_right_for_every_camera_of_its_band(void **state) {
    (void)state;
    random_begin("bands");
    tally sum = {0, 0, 0};
    for (int n = 0; n < 20000; n++) {
        const rqt_camera a = random_camera();
        const double distance = random_size(0, 5);
        const rqt_prism prism = random_prism(&a, distance);
        const rqt_view_band band = rqt_camera_band(&a, distance * random_size(-2, 0.3));
        rqt_view_bound bound;
        rqt_view_tolerance_in_band(&a, &band, &prism, &bound);
        for (int k = 0; k < 8; k++) {
            const rqt_camera b = random_neighbour(&a, &band, random_between(0, 2) ? 1 - 1e-12 : random_unit());
            check_neighbour(&b, &prism, &bound, &sum);
        }
    }
    CHECK(sum.drawn > 20000 && sum.hidden > 20000 && sum.worst > 0.9, "%ld drawn, %ld hidden, worst %g", sum.drawn,
          sum.hidden, sum.worst);
}

static void F36_an_ulp_of_jitter_stays_in_the_band_a_teleport_does_not(void **state) {
    (void)state;
    random_begin("jitter");
    for (int n = 0; n < 2000; n++) {
        const rqt_camera a = random_camera();
        const rqt_view_band band = rqt_camera_band(&a, random_between(0, 1) ? 0 : random_size(-3, 9));
        rqt_camera b = a;
        assert_true(band.move > 0 && band.turn > 0);
        assert_true(rqt_camera_holds(&a, &band, &a));
        for (int c = 0; c < 3; c++) {
            b.eye[c] = nextafter(b.eye[c], random_between(0, 1) ? INFINITY : -INFINITY);
            b.forward[c] = nextafter(b.forward[c], random_between(0, 1) ? INFINITY : -INFINITY);
            b.right[c] = nextafter(b.right[c], random_between(0, 1) ? INFINITY : -INFINITY);
            b.up[c] = nextafter(b.up[c], random_between(0, 1) ? INFINITY : -INFINITY);
        }
        assert_true(rqt_camera_holds(&a, &band, &b));
        b = random_neighbour(&a, &band, 0.999);
        assert_true(rqt_camera_holds(&a, &band, &b));
        b = random_neighbour(&a, &(rqt_view_band){band.move, 0}, 1.001);
        assert_false(rqt_camera_holds(&a, &band, &b));
        b = random_neighbour(&a, &(rqt_view_band){0, band.turn}, 1.001);
        assert_false(rqt_camera_holds(&a, &band, &b));
    }
}

static void another_lens_is_another_camera(void **state) {
    (void)state;
    random_begin("lenses");
    const rqt_camera a = random_camera();
    const rqt_view_band band = rqt_camera_band(&a, 100);
    for (int n = 0; n < 6; n++) {
        rqt_camera b = a;
        double *const of_the_lens[] = {&b.width, &b.height, &b.focal, &b.near, &b.far, &b.tau};
        *of_the_lens[n] = *of_the_lens[n] == INFINITY ? 1e9 : nextafter(*of_the_lens[n], INFINITY);
        assert_false(rqt_camera_holds(&a, &band, &b));
    }
}

/* What a band takes from the tolerance, of what is no nearer than the nearest: an eighth; of pieces seen slantwise,
 * which grow sideways and upward, 1.4 times as much. */
static void a_band_takes_little(void **state) {
    (void)state;
    random_begin("price of bands");
    for (int n = 0; n < 5000; n++) {
        const rqt_camera a = random_camera();
        const double nearest = fmax(random_size(0, 5), 10 * a.near), distance = nearest * random_size(0.1, 2);
        rqt_prism point = random_prism(&a, distance);
        const rqt_view_band band = rqt_camera_band(&a, nearest);
        rqt_view_bound plain, bound;
        point.radius = point.half_height = 0;
        rqt_view_tolerance(&a, &point, &plain);
        rqt_view_tolerance_in_band(&a, &band, &point, &bound);
        if (!plain.shown) continue;
        CHECK(bound.distance >= 0.91 * plain.distance - 1e-3, "%g m of %g m", bound.distance, plain.distance);
    }
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(F36_a_view_is_right_for_every_camera_of_its_band),
        TEST(F36_an_ulp_of_jitter_stays_in_the_band_a_teleport_does_not),
        TEST(another_lens_is_another_camera),
        TEST(a_band_takes_little),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
