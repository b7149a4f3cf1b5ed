/* test_geo.c - geodesic circles. The independent implementation is PROJ's geodesic.h.
 * Links: geo.cpp, GeographicLib, PROJ, cmocka. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include <geodesic.h>

#include "geo.h"

static struct geod_geodesic earth;

static int set_up(void **state) {
    (void)state;
    geod_init(&earth, 6378137, 1 / 298.257223563);
    return 0;
}

static double distance(double lon0, double lat0, double lon1, double lat1) {
    double metres;
    geod_inverse(&earth, lat0, lon0, lat1, lon1, &metres, NULL, NULL);
    return metres;
}

/* Every point at the radius, no jump anywhere, and once around to the left. */
static void check_circle(double lon, double lat, double radius, int n) {
    double *p = malloc(sizeof *p * 2 * (size_t)n);
    assert_non_null(p);
    char message[200] = "untouched";
    int status = geo_circle(lon, lat, radius, n, p, message, sizeof message);
    if (status) fail_msg("lon %g lat %g radius %g n %d: %s", lon, lat, radius, n, message);
    assert_string_equal(message, "untouched");

    double twice_area = 0, turned = 0;
    for (int i = 0; i < n; i++) {
        const double *a = p + 2 * i, *b = p + 2 * ((i + 1) % n);
        double off = fabs(distance(lon, lat, a[0], a[1]) - radius);
        if (off > 1e-7)
            fail_msg("lon %g lat %g radius %g point %d of %d: off by %g m", lon, lat, radius, i, n, off);
        assert_true(fabs(a[0] - lon) < 180);
        assert_true(fabs(a[1]) < 90);
        assert_true(fabs(b[0] - a[0]) < 180); /* far less, unless the circle passes close by a pole */
        twice_area += (a[0] - lon) * (b[1] - lat) - (b[0] - lon) * (a[1] - lat);

        double azimuth_a, azimuth_b;
        geod_inverse(&earth, lat, lon, a[1], a[0], NULL, &azimuth_a, NULL);
        geod_inverse(&earth, lat, lon, b[1], b[0], NULL, &azimuth_b, NULL);
        double turn = remainder(azimuth_a - azimuth_b, 360);
        assert_true(turn > 0); /* azimuths are clockwise, so a counter-clockwise ring has them fall */
        if (n > 2000 || radius < 1) continue; /* the azimuth of a point a nanometre off is not that sharp */
        assert_true(fabs(turn - 360.0 / n) < 1e-6);
        turned += turn;
    }
    assert_true(twice_area > 0);
    if (n <= 2000 && radius >= 1) assert_true(fabs(turned - 360) < 1e-6);
    free(p);
}

static void test_points_are_at_the_radius(void **state) {
    (void)state;
    static const double lons[] = {0, 7.4386, -77.03, 123.456, -180, 180, 179.9999, -360, 360, 200};
    static const double lats[] = {0, 46.95, -33.9, 71.3, -89, 1e-9};
    static const double radii[] = {0.5, 10, 1234.5, 100e3};
    for (size_t i = 0; i < sizeof lons / sizeof *lons; i++)
        for (size_t j = 0; j < sizeof lats / sizeof *lats; j++)
            for (size_t k = 0; k < sizeof radii / sizeof *radii; k++)
                for (int n = 3; n < 200; n = n * 3 + 1) check_circle(lons[i], lats[j], radii[k], n);
}

static void test_random_circles(void **state) {
    (void)state;
    srand(7);
    for (int i = 0; i < 500; i++) {
        double lon = rand() / (double)RAND_MAX * 720 - 360, lat = rand() / (double)RAND_MAX * 178 - 89;
        double limit = distance(lon, lat, lon, copysign(90, lat));
        check_circle(lon, lat, limit * (0.001 + 0.998 * (rand() / (double)RAND_MAX)), 16 + rand() % 100);
    }
}

static void test_first_point_is_east(void **state) {
    (void)state;
    double p[8];
    assert_int_equal(geo_circle(10, 0, 1000, 4, p, NULL, 0), 0);
    assert_true(p[0] > 10.008 && fabs(p[1]) < 1e-9);       /* east */
    assert_true(fabs(p[2] - 10) < 1e-12 && p[3] > 0.009);  /* north */
    assert_true(p[4] < 9.992 && fabs(p[5]) < 1e-9);        /* west */
    assert_true(fabs(p[6] - 10) < 1e-12 && p[7] < -0.009); /* south */
}

static void test_antimeridian_is_continuous(void **state) {
    (void)state;
    static const double lons[] = {179.99, 180, -180, -179.99, 540 - 360 + 0.01};
    enum { N = 360 };
    double p[2 * N], q[2 * N];
    for (size_t i = 0; i < sizeof lons / sizeof *lons; i++) {
        assert_int_equal(geo_circle(lons[i], 60, 50e3, N, p, NULL, 0), 0);
        double low = p[0], high = p[0];
        for (int j = 0; j < N; j++) {
            low = fmin(low, p[2 * j]);
            high = fmax(high, p[2 * j]);
            assert_true(fabs(p[2 * j] - p[2 * ((j + 1) % N)]) < 0.1);
        }
        assert_true(low < lons[i] && lons[i] < high && high - low < 2); /* on the turn of the centre, both sides */
        /* The same ring, moved, as one that is nowhere near the antimeridian. */
        assert_int_equal(geo_circle(0, 60, 50e3, N, q, NULL, 0), 0);
        for (int j = 0; j < N; j++) {
            assert_true(fabs(p[2 * j] - lons[i] - q[2 * j]) < 1e-9);
            assert_true(fabs(p[2 * j + 1] - q[2 * j + 1]) < 1e-12);
        }
    }
}

static void refused(double lon, double lat, double radius, int n, const char *word) {
    char message[256] = "";
    double p[2 * 100];
    assert_int_equal(geo_circle(lon, lat, radius, n, p, message, sizeof message), 1);
    if (!strstr(message, word)) fail_msg("'%s' does not say '%s'", message, word);
    assert_null(strchr(message, '\n'));
    assert_true(strlen(message) < 120);
    assert_int_equal(geo_circle(lon, lat, radius, n, p, NULL, 0), 1);
    assert_int_equal(geo_circle(lon, lat, radius, n, p, message, 0), 1);
    char cut[8];
    memset(cut, 'x', sizeof cut);
    assert_int_equal(geo_circle(lon, lat, radius, n, p, cut, 5), 1);
    assert_int_equal(strlen(cut), 4);
    assert_int_equal(cut[5], 'x');
}

static void test_refusals(void **state) {
    (void)state;
    refused(NAN, 0, 1, 8, "longitude");
    refused(INFINITY, 0, 1, 8, "longitude");
    refused(-INFINITY, 0, 1, 8, "longitude");
    refused(360.001, 0, 1, 8, "longitude");
    refused(0, NAN, 1, 8, "latitude");
    refused(0, INFINITY, 1, 8, "latitude");
    refused(0, 90.001, 1, 8, "latitude");
    refused(0, 0, NAN, 8, "radius");
    refused(0, 0, INFINITY, 8, "radius");
    refused(0, 0, -INFINITY, 8, "radius");
    refused(0, 0, -1, 8, "radius");
    refused(0, 0, 0, 8, "radius");
    refused(0, 0, -0.0, 8, "radius");
    refused(0, 0, 1e-9, 8, "millimetre");
    refused(0, 0, 5e-324, 8, "millimetre");
    refused(0, 0, 1e308, 8, "pole");
    refused(0, 0, 1, 2, "points");
    refused(0, 0, 1, 0, "points");
    refused(0, 0, 1, -5, "points");
    refused(0, 0, 1, GEO_CIRCLE_POINTS + 1, "points");
    refused(0, 0, 1, INT32_MAX, "points");
}

static void test_poles_are_refused(void **state) {
    (void)state;
    refused(0, 90, 1, 8, "pole");
    refused(0, -90, 1, 8, "pole");
    static const double lats[] = {0, 1, 45, 80, 89, 89.999};
    for (size_t i = 0; i < sizeof lats / sizeof *lats; i++)
        for (int south = 0; south < 2; south++) {
            double lat = south ? -lats[i] : lats[i];
            double limit = distance(25, lat, 25, copysign(90, lat));
            refused(25, lat, limit, 8, "pole");
            refused(25, lat, limit + 1, 8, "pole");
            refused(25, lat, limit * 2, 8, "pole");
            check_circle(25, lat, limit - 1, 360); /* a metre short of it */
            check_circle(25, lat, limit * 0.999, 64);
        }
}

static void test_tiny_and_big(void **state) {
    (void)state;
    static const double lats[] = {0, -12.3, 47, 85};
    for (size_t i = 0; i < sizeof lats / sizeof *lats; i++) {
        check_circle(8.5, lats[i], 0.001, 16);
        check_circle(8.5, lats[i], 0.01, 64);
        check_circle(-179.999999, lats[i], 0.25, 64);
    }
    check_circle(0, 0, 10001e3, 720); /* all but the equator's quarter meridian */
    check_circle(170, 20, 7700e3, 720);
    check_circle(170, -20, 7700e3, 7200);
}

static void test_version(void **state) {
    (void)state;
    int major = 0, minor = 0;
    assert_int_equal(sscanf(geo_version(), "%d.%d", &major, &minor), 2);
    assert_true(major >= 2);
    assert_ptr_equal(geo_version(), geo_version());
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_points_are_at_the_radius),
        cmocka_unit_test(test_random_circles),
        cmocka_unit_test(test_first_point_is_east),
        cmocka_unit_test(test_antimeridian_is_continuous),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_poles_are_refused),
        cmocka_unit_test(test_tiny_and_big),
        cmocka_unit_test(test_version),
    };
    return cmocka_run_group_tests(tests, set_up, NULL);
}
