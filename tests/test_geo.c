/* test_geo.c - geodesic circles and corridors. The independent implementation is PROJ's geodesic.h.
 * Links: geo.cpp, GeographicLib, PROJ, cmocka. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
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

/* ---------------------------------------------------------------------------------------------- helpers */

static uint64_t dice_state;
static double dice(double low, double high) {
    dice_state = dice_state * 6364136223846793005u + 1442695040888963407u;
    return low + (high - low) * ((double)(dice_state >> 11) * 0x1p-53);
}

static const geo_ellipsoid wgs84 = {6378137.0, 1 / 298.257223563};

static void start_dice(uint64_t seed) {
    const char *given = getenv("RQT_SEED");
    dice_state = given ? strtoull(given, NULL, 10) : seed;
    print_message("RQT_SEED=%llu\n", (unsigned long long)dice_state);
}

/* Is the point inside, on any turn? */
static bool holds(const geo_polygons *p, double lon, double lat) {
    for (int turn = -3; turn <= 3; turn++) {
        const double x = lon + 360 * turn, *ring = p->lonlat;
        bool odd = false, any = false;
        for (size_t r = 0; r < p->rings; ring += 2 * p->ring_points[r++]) {
            if (p->ring_is_shell[r]) any = any || odd, odd = false;
            const size_t n = p->ring_points[r];
            for (size_t i = 0; i < n; i++) {
                const double *a = ring + 2 * i, *b = ring + 2 * ((i + 1) % n);
                if ((a[1] <= lat) == (b[1] <= lat)) continue;
                if (a[0] + (lat - a[1]) / (b[1] - a[1]) * (b[0] - a[0]) > x) odd = !odd;
            }
        }
        if (any || odd) return true;
    }
    return false;
}

/* The distance of a point from the geodesic between two others, by looking along it; something that is more than
 * `beyond` when the distance is. */
static double distance_to_segment(const double *a, const double *b, double lon, double lat, double beyond) {
    struct geod_geodesicline line;
    double length;
    geod_inverse(&earth, a[1], a[0], b[1], b[0], &length, NULL, NULL);
    const double to_a = distance(a[0], a[1], lon, lat);
    if (length == 0 || to_a > length + beyond) return to_a;
    geod_inverseline(&line, &earth, a[1], a[0], b[1], b[0], GEOD_DISTANCE_IN | GEOD_LATITUDE | GEOD_LONGITUDE);
    double low = 0, high = length, best = INFINITY;
    for (int round = 0; round < 6; round++) {
        enum { N = 24 };
        int at = 0;
        best = INFINITY;
        for (int i = 0; i <= N; i++) {
            double y, x;
            geod_position(&line, low + (high - low) * i / N, &y, &x, NULL);
            const double d = distance(x, y, lon, lat);
            if (d < best) best = d, at = i;
        }
        const double step = (high - low) / N, middle = low + step * at;
        low = fmax(0, middle - step);
        high = fmin(length, middle + step);
    }
    return best;
}

static void make_circle(double lon, double lat, double radius, geo_polygons *p) {
    char message[200] = "untouched";
    if (geo_circle(lon, lat, radius, p, message, sizeof message))
        fail_msg("lon %.17g lat %.17g radius %.17g: %s", lon, lat, radius, message);
    assert_string_equal(message, "untouched");
    assert_int_equal(p->rings, 1);
    assert_int_equal(p->ring_points[0], p->points);
}

/* Every point at the radius, no jump anywhere, once around to the left; and the sides are near the rim. */
static void check_circle(double lon, double lat, double radius) {
    geo_polygons c;
    make_circle(lon, lat, radius, &c);
    const double *p = c.lonlat;
    const size_t n = c.points;
    assert_true(n >= 256);
    double twice_area = 0, turned = 0;
    for (size_t i = 0; i < n; i++) {
        const double *a = p + 2 * i, *b = p + 2 * ((i + 1) % n);
        const double off = fabs(distance(lon, lat, a[0], a[1]) - radius);
        if (off > 1e-7)
            fail_msg("lon %g lat %g radius %g point %zu of %zu: off by %g m", lon, lat, radius, i, n, off);
        assert_true(fabs(a[0] - lon) < 180.000001);
        assert_true(fabs(b[0] - a[0]) < 90);
        twice_area += (a[0] - lon) * (b[1] - lat) - (b[0] - lon) * (a[1] - lat);
        if (radius < 1) continue; /* the azimuth of a point a nanometre off is not that sharp */
        for (int k = 1; k < 8; k++) {
            const double x = a[0] + (b[0] - a[0]) * k / 8, y = a[1] + (b[1] - a[1]) * k / 8;
            const double side = fabs(distance(lon, lat, x, y) - radius);
            if (side > GEO_RIM_TOLERANCE * radius + 1e-7)
                fail_msg("lon %g lat %g radius %g side %zu: off by %g m", lon, lat, radius, i, side);
        }
        double azimuth_a, azimuth_b;
        geod_inverse(&earth, lat, lon, a[1], a[0], NULL, &azimuth_a, NULL);
        geod_inverse(&earth, lat, lon, b[1], b[0], NULL, &azimuth_b, NULL);
        const double turn = remainder(azimuth_a - azimuth_b, 360);
        if (!(turn > -1e-9)) fail_msg("turn %g at %zu", turn, i); /* azimuths are clockwise, so they fall */
        turned += turn;
    }
    assert_true(twice_area > 0);
    if (radius >= 1) assert_true(fabs(turned - 360) < 1e-6);
    geo_polygons_free(&c);
}

static void circles_points_are_at_the_radius_and_sides_near_it(void **state) {
    (void)state;
    static const double lons[] = {7.4386, -180, 179.9999, -360, 200};
    static const double lats[] = {0, 46.95, 71.3, -89, 1e-9};
    static const double radii[] = {0.5, 1234.5, 100e3};
    for (size_t i = 0; i < sizeof lons / sizeof *lons; i++)
        for (size_t j = 0; j < sizeof lats / sizeof *lats; j++)
            for (size_t k = 0; k < sizeof radii / sizeof *radii; k++) check_circle(lons[i], lats[j], radii[k]);
}

static void random_circles_are_circles(void **state) {
    (void)state;
    start_dice(7);
    for (int i = 0; i < 60; i++) {
        const double lon = dice(-360, 360), lat = dice(-89, 89);
        const double limit = distance(lon, lat, lon, copysign(90, lat));
        check_circle(lon, lat, limit * dice(0.001, 0.999));
    }
}

static void circles_begin_in_the_east_and_go_left(void **state) {
    (void)state;
    geo_polygons c;
    make_circle(10, 0, 1000, &c);
    assert_int_equal(c.points, 256);
    const double *p = c.lonlat;
    assert_true(p[0] > 10.008 && fabs(p[1]) < 1e-9);                       /* east */
    assert_true(fabs(p[2 * 64] - 10) < 1e-12 && p[2 * 64 + 1] > 0.009);    /* north */
    assert_true(p[2 * 128] < 9.992 && fabs(p[2 * 128 + 1]) < 1e-9);        /* west */
    assert_true(fabs(p[2 * 192] - 10) < 1e-12 && p[2 * 192 + 1] < -0.009); /* south */
    geo_polygons_free(&c);
}

static void F25_circles_across_the_antimeridian_are_continuous(void **state) {
    (void)state;
    static const double lons[] = {179.99, 180, -180, -179.99, 180.01};
    geo_polygons p, q;
    make_circle(0, 60, 50e3, &q);
    for (size_t i = 0; i < sizeof lons / sizeof *lons; i++) {
        make_circle(lons[i], 60, 50e3, &p);
        assert_int_equal(p.points, q.points);
        for (size_t j = 0; j < p.points; j++) { /* the same ring, moved, on the turn of the centre */
            assert_true(fabs(p.lonlat[2 * j] - lons[i] - q.lonlat[2 * j]) < 1e-9);
            assert_true(fabs(p.lonlat[2 * j + 1] - q.lonlat[2 * j + 1]) < 1e-12);
        }
        geo_polygons_free(&p);
    }
    geo_polygons_free(&q);
}

static void F28_circles_over_a_pole_hold_it_and_what_is_near(void **state) {
    (void)state;
    start_dice(28);
    static const double lats[] = {90, 89.999, 89, 70, 20, 1};
    for (size_t i = 0; i < sizeof lats / sizeof *lats; i++)
        for (int south = 0; south < 2; south++) {
            const double lat = south ? -lats[i] : lats[i], lon = dice(-360, 360);
            const double to_pole = distance(lon, lat, lon, south ? -90 : 90);
            const double to_far = distance(lon, lat, lon, south ? 90 : -90);
            const double radii[] = {to_pole + 0.1, to_pole + 1000, to_pole + 0.3 * (to_far - to_pole),
                                    to_far - 1000};
            for (size_t k = 0; k < 4; k++) {
                geo_polygons c;
                make_circle(lon, lat, radii[k], &c);
                assert_true(holds(&c, dice(-180, 180), south ? -89.9999999 : 89.9999999));
                for (int n = 0; n < 300; n++) {
                    const double x = dice(-180, 180), y = n % 2 ? dice(-90, 90) : copysign(90 - dice(0, 1), lat);
                    const double d = distance(lon, lat, x, y);
                    if (fabs(d - radii[k]) <= GEO_RIM_TOLERANCE * radii[k]) continue;
                    if (holds(&c, x, y) != (d < radii[k]))
                        fail_msg("lat %g radius %g: %g %g at %g", lat, radii[k], x, y, d);
                }
                geo_polygons_free(&c);
            }
        }
}

static void refused(double lon, double lat, double radius, const char *word) {
    char message[256] = "";
    geo_polygons p;
    assert_int_equal(geo_circle(lon, lat, radius, &p, message, sizeof message), GEO_REFUSED);
    assert_null(p.lonlat);
    if (!strstr(message, word)) fail_msg("'%s' does not say '%s'", message, word);
    assert_null(strchr(message, '\n'));
    assert_true(strlen(message) < 120);
    assert_int_equal(geo_circle(lon, lat, radius, &p, NULL, 0), GEO_REFUSED);
    assert_int_equal(geo_circle(lon, lat, radius, &p, message, 0), GEO_REFUSED);
    char cut[8];
    memset(cut, 'x', sizeof cut);
    assert_int_equal(geo_circle(lon, lat, radius, &p, cut, 5), GEO_REFUSED);
    assert_int_equal(strlen(cut), 4);
    assert_int_equal(cut[5], 'x');
}

static void what_is_no_circle_is_refused(void **state) {
    (void)state;
    refused(NAN, 0, 1, "longitude");
    refused(INFINITY, 0, 1, "longitude");
    refused(-INFINITY, 0, 1, "longitude");
    refused(360.001, 0, 1, "longitude");
    refused(0, NAN, 1, "latitude");
    refused(0, INFINITY, 1, "latitude");
    refused(0, 90.001, 1, "latitude");
    refused(0, 0, NAN, "radius");
    refused(0, 0, INFINITY, "radius");
    refused(0, 0, -INFINITY, "radius");
    refused(0, 0, -1, "radius");
    refused(0, 0, 0, "radius");
    refused(0, 0, -0.0, "radius");
    refused(0, 0, 1e-9, "millimetre");
    refused(0, 0, 5e-324, "millimetre");
    refused(0, 0, 1e308, "both poles");
    refused(0, 0, 10001967, "both poles");
    static const double lats[] = {1, 45, 80, 89, 89.999};
    for (size_t i = 0; i < sizeof lats / sizeof *lats; i++)
        for (int south = 0; south < 2; south++) {
            const double lat = south ? -lats[i] : lats[i];
            const double limit = distance(25, lat, 25, copysign(90, lat));
            refused(25, lat, limit, "through a pole");
            refused(25, lat, distance(25, lat, 25, copysign(90, -lat)) + 1, "both poles");
            check_circle(25, lat, limit - 1); /* a metre short of it */
        }
}

static void tiny_and_big_circles_are_circles(void **state) {
    (void)state;
    static const double lats[] = {0, -12.3, 47, 85};
    for (size_t i = 0; i < sizeof lats / sizeof *lats; i++) {
        check_circle(8.5, lats[i], 0.001);
        check_circle(-179.999999, lats[i], 0.25);
    }
    check_circle(0, 0, 10001e3); /* all but the equator's quarter meridian */
    check_circle(170, -20, 7700e3);
}

/* --------------------------------------------------------------------------------------------- corridors */

/* Random points about the line lie in the polygons when their distance says so, but within the tolerance. */
static void check_corridor(const double *line, const size_t *counts, size_t lines, double metres, int points) {
    geo_polygons c;
    char message[200] = "";
    if (geo_corridor(line, counts, lines, metres, &c, message, sizeof message)) fail_msg("%s", message);
    int inside = 0, outside = 0;
    for (int n = 0; n < points; n++) {
        size_t total = 0;
        for (size_t l = 0; l < lines; l++) total += counts[l];
        const double *near = line + 2 * (size_t)dice(0, (double)total - 1e-9);
        double x, y;
        if (n % 2 == 0) {
            geod_direct(&earth, near[1], near[0], dice(0, 360), metres * dice(0.7, 1.3), &y, &x, NULL);
        } else { /* beside some place of its segment */
            const double *next = near + (near + 2 < line + 2 * total ? 2 : 0), t = dice(0, 1);
            geod_direct(&earth, near[1] + t * (next[1] - near[1]), near[0] + t * remainder(next[0] - near[0], 360),
                        dice(0, 360), metres * dice(0, 2), &y, &x, NULL);
        }
        double least = INFINITY;
        const double *p = line;
        for (size_t l = 0; l < lines; l++) {
            if (counts[l] == 1) least = fmin(least, distance(p[0], p[1], x, y));
            for (size_t i = 0; i + 1 < counts[l]; i++)
                least = fmin(least, distance_to_segment(p + 2 * i, p + 2 * i + 2, x, y, 3 * metres));
            p += 2 * counts[l];
        }
        if (fabs(least - metres) <= GEO_RIM_TOLERANCE * metres) continue;
        const bool right = least < metres;
        right ? inside++ : outside++;
        if (holds(&c, x, y) != right)
            fail_msg("%.12g %.12g is %.9g m from the line; metres %g; inside %d", x, y, least, metres, !right);
    }
    assert_true(inside > points / 10 && outside > points / 10);
    geo_polygons_free(&c);
}

static void corridors_hold_what_is_near_and_nothing_else(void **state) {
    (void)state;
    start_dice(11);
    for (int i = 0; i < 24; i++) { /* roads: many points nearer to one another than the corridor is wide, or not */
        enum { N = 12 };
        double line[2 * N];
        const double step = i % 3 == 0 ? 0.002 : i % 3 == 1 ? 0.05 : 2;
        line[0] = dice(-180, 180), line[1] = dice(-70, 70);
        for (int n = 1; n < N; n++) {
            line[2 * n] = line[2 * n - 2] + dice(-step, step);
            line[2 * n + 1] = fmax(-80, fmin(80, line[2 * n - 1] + dice(-step, step)));
        }
        const size_t whole[] = {N}, parts[] = {5, 1, 6};
        const double metres = i % 2 ? 300 : 5000;
        check_corridor(line, i % 4 < 2 ? whole : parts, i % 4 < 2 ? 1 : 3, metres, 120);
    }
    const double far[] = {-71, 44, 30, 60, 100, -10}; /* geodesics, not rhumb lines */
    const size_t three[] = {3};
    check_corridor(far, three, 1, 50e3, 200);
    check_corridor(far, three, 1, 2e6, 200);
    const double same[] = {7, 46, 7, 46, 7.01, 46};
    check_corridor(same, three, 1, 500, 100);
}

static void F25_corridors_across_the_antimeridian_go_on(void **state) {
    (void)state;
    start_dice(12);
    const double line[] = {179, -17, -179.5, -16, 179.7, -15};
    const size_t n = 3;
    check_corridor(line, &n, 1, 20e3, 300);
    geo_polygons c;
    assert_int_equal(geo_corridor(line, &n, 1, 20e3, &c, NULL, 0), GEO_OK);
    assert_int_equal(c.rings, 1);
    for (size_t i = 0; i < c.points; i++) assert_true(c.lonlat[2 * i] > 178 && c.lonlat[2 * i] < 182);
    geo_polygons_free(&c);
}

static void F28_corridors_over_a_pole_hold_it(void **state) {
    (void)state;
    start_dice(13);
    const double over[] = {10, 80, -170, 85}, near[] = {10, 80, 150, 88}, past[] = {10, -89, 120, -89, 240, -89};
    const size_t two = 2, three = 3;
    check_corridor(over, &two, 1, 50e3, 300);
    check_corridor(near, &two, 1, 50e3, 300);
    check_corridor(near, &two, 1, 500e3, 300);
    check_corridor(past, &three, 1, 30e3, 300);
    check_corridor(past, &three, 1, 300e3, 300);
    char message[200] = "";
    geo_polygons c;
    const double all[] = {10, 89, 10, -89};
    assert_int_equal(geo_corridor(all, &two, 1, 300e3, &c, message, sizeof message), GEO_REFUSED);
    assert_non_null(strstr(message, "both poles"));
}

static void what_is_no_corridor_is_refused(void **state) {
    (void)state;
    const double line[] = {7, 46, 8, 46}, off[] = {7, 46, 8, 91};
    const size_t two = 2;
    geo_polygons c;
    char message[200] = "";
    static const struct {
        double metres;
        const char *word;
    } bad[] = {{0, "radius"},        {-1, "radius"},       {NAN, "radius"},
               {INFINITY, "radius"}, {1e-4, "millimetre"}, {6e6, "5000 km"}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_int_equal(geo_corridor(line, &two, 1, bad[i].metres, &c, message, sizeof message), GEO_REFUSED);
        assert_non_null(strstr(message, bad[i].word));
    }
    assert_int_equal(geo_corridor(off, &two, 1, 10, &c, message, sizeof message), GEO_REFUSED);
    assert_non_null(strstr(message, "latitude"));
    const size_t many = GEO_CORRIDOR_POINTS + 1;
    assert_int_equal(geo_corridor(line, &many, 1, 10, &c, message, sizeof message), GEO_REFUSED);
    assert_non_null(strstr(message, "points"));
}

/* --------------------------------------------------------------------------------------------- ellipsoid */

static void ellipsoids_are_read_out_of_wkt(void **state) {
    (void)state;
    geo_ellipsoid e;
    assert_true(
        geo_ellipsoid_of_wkt("GEOGCS[\"WGS 84\",DATUM[\"WGS_1984\",SPHEROID[\"WGS 84\",6378137,298.257223563,"
                             "AUTHORITY[\"EPSG\",\"7030\"]]]]",
                             &e));
    assert_true(e.a == GEO_WGS84.a && e.f == GEO_WGS84.f);
    assert_true(geo_ellipsoid_of_wkt("ELLIPSOID[\"Moon SPHEROID[\",1737400,0,LENGTHUNIT[\"metre\",1]]", &e));
    assert_true(e.a == 1737400 && e.f == 0);
    static const char *const bad[] = {"",
                                      "SPHEROID[",
                                      "SPHEROID[\"x\"",
                                      "SPHEROID[\"x\",",
                                      "SPHEROID[\"x\",6378137",
                                      "SPHEROID[\"x\",0,298]",
                                      "SPHEROID[\"x\",6378137,1]",
                                      "SPHEROID[\"x\",-1,298]"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) assert_false(geo_ellipsoid_of_wkt(bad[i], &e));
}

/* ------------------------------------------------------------------------------------- areas and paths */

/* The planimetric area of triangles, with their straight sides as many short geodesics, by PROJ. */
static void planimetric_areas_are_those_of_geodesic_polygons(void **state) {
    (void)state;
    start_dice(14);
    for (int n = 0; n < 30; n++) {
        double c[3][3];
        const double size = n % 3 == 0 ? 0.001 : n % 3 == 1 ? 1 : 20, lon = dice(-180, 180), lat = dice(-60, 60);
        for (int i = 0; i < 3; i++) {
            c[i][0] = lon + dice(-size, size);
            c[i][1] = lat + dice(-size, size);
            c[i][2] = dice(-100, 4000);
        }
        struct geod_polygon polygon;
        geod_polygon_init(&polygon, 0);
        enum { PARTS = 1000 };
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < PARTS; k++) {
                const double t = k / (double)PARTS, *a = c[i], *b = c[(i + 1) % 3];
                geod_polygon_addpoint(&earth, &polygon, a[1] + t * (b[1] - a[1]), a[0] + t * (b[0] - a[0]));
            }
        double area;
        geod_polygon_compute(&earth, &polygon, 0, 1, &area, NULL);
        const geo_measure m = geo_measure_triangle(&wgs84, (const double(*)[3])c);
        if (fabs(m.planimetric - fabs(area)) > 1e-6 * fabs(area) + 0.01)
            fail_msg("size %g at %g: %.12g, PROJ %.12g", size, lat, m.planimetric, fabs(area));
        assert_true(m.surface >= m.planimetric * (1 - 100 / 6.3e6) * (1 - 1e-9));
    }
}

/* Points of a path lie on the geodesic at their distance, pieces are within a thousandth of a cell. */
static void paths_follow_geodesics(void **state) {
    (void)state;
    start_dice(15);
    for (int n = 0; n < 40; n++) {
        double line[6];
        const double size = n % 2 ? 3 : 60, cell = n % 2 ? 1.0 / 1200 : 0.5;
        line[0] = dice(-180, 180), line[1] = dice(-65, 65);
        for (int i = 2; i < 6; i += 2) {
            line[i] = line[i - 2] + dice(-size, size);
            line[i + 1] = fmax(-84, fmin(84, line[i - 1] + dice(-size, size)));
        }
        geo_path p;
        const size_t three = 3;
        char message[200] = "";
        assert_int_equal(geo_path_create(&wgs84, line, &three, 1, cell, -cell, &p, message, sizeof message),
                         GEO_OK);
        assert_int_equal(p.lines, 1);
        assert_int_equal(p.line_points[0], p.points);
        int own = -1;
        struct geod_geodesicline along;
        double begun = 0, worst = 0;
        for (size_t i = 0; i < p.points; i++) {
            const double *at = p.lonlat + 2 * i;
            assert_int_equal(p.ends[i] != 0, i + 1 == p.points);
            if (p.own[i]) {
                own++;
                assert_true(distance(at[0], at[1], line[2 * own], line[2 * own + 1]) < 1e-6);
                begun = p.metres[i];
                if (own < 2)
                    geod_inverseline(&along, &earth, line[2 * own + 1], line[2 * own], line[2 * own + 3],
                                     line[2 * own + 2], GEOD_DISTANCE_IN | GEOD_LATITUDE | GEOD_LONGITUDE);
            }
            if (i + 1 == p.points) break;
            assert_true(p.metres[i + 1] > p.metres[i]);
            for (int k = 1; k < 8; k++) {
                const double s = p.metres[i] + (p.metres[i + 1] - p.metres[i]) * k / 8 - begun;
                double y, x;
                geod_position(&along, s, &y, &x, NULL);
                x = at[0] + remainder(x - at[0], 360);
                const double ux = at[2] - at[0], uy = at[3] - at[1], vx = x - at[0], vy = y - at[1];
                worst = fmax(worst, fabs(ux * vy - uy * vx) / hypot(ux, uy) / cell);
            }
        }
        assert_int_equal(own, 2);
        if (worst > GEO_PATH_TOLERANCE) fail_msg("off by %g of a cell", worst);
        geo_path_free(&p);
    }
    geo_path p;
    char message[200] = "";
    const double off[] = {0, 0, 0, 91}, wide[] = {0, 0, 1e9, 0}, world[] = {0, 50, 179, 50};
    const size_t two = 2;
    assert_int_equal(geo_path_create(&wgs84, off, &two, 1, 1, 1, &p, message, sizeof message), GEO_REFUSED);
    assert_non_null(strstr(message, "latitude"));
    assert_int_equal(geo_path_create(&wgs84, wide, &two, 1, 1, 1, &p, message, sizeof message), GEO_REFUSED);
    assert_non_null(strstr(message, "longitude"));
    assert_int_equal(geo_path_create(&wgs84, world, &two, 1, 1e-13, 1e-13, &p, message, sizeof message),
                     GEO_REFUSED);
    assert_non_null(strstr(message, "too long"));
}

/* ------------------------------------------------------------------------------------------------ frames */

static void textbook_ecef(const double p[3], double xyz[3]) {
    const double a = 6378137, f = 1 / 298.257223563, e2 = f * (2 - f), degree = 0.017453292519943295;
    const double sine = sin(p[1] * degree), cosine = cos(p[1] * degree), n = a / sqrt(1 - e2 * sine * sine);
    xyz[0] = (n + p[2]) * cosine * cos(p[0] * degree);
    xyz[1] = (n + p[2]) * cosine * sin(p[0] * degree);
    xyz[2] = (n * (1 - e2) + p[2]) * sine;
}

static void places_in_space_are_the_textbooks(void **state) {
    (void)state;
    start_dice(16);
    geo_frame *ecef, *enu;
    assert_int_equal(geo_frame_create(GEO_ECEF, &wgs84, 0, 0, 0, &ecef, NULL, 0), GEO_OK);
    const double origin[3] = {dice(-180, 180), dice(-89, 89), 0};
    assert_int_equal(geo_frame_create(GEO_ENU, &wgs84, origin[0], origin[1], 0, &enu, NULL, 0), GEO_OK);
    double o[3];
    textbook_ecef(origin, o);
    for (int n = 0; n < 1000; n++) {
        const double p[3] = {dice(-540, 540), dice(-90, 90), dice(-11000, 9000)};
        double mine[3], right[3], local[3];
        geo_frame_place(ecef, p, mine);
        textbook_ecef(p, right);
        for (int i = 0; i < 3; i++) assert_true(fabs(mine[i] - right[i]) < 1e-7);
        /* east, north, up by the scalar product */
        const double degree = 0.017453292519943295, sl = sin(origin[0] * degree), cl = cos(origin[0] * degree),
                     sp = sin(origin[1] * degree), cp = cos(origin[1] * degree);
        const double axes[3][3] = {{-sl, cl, 0}, {-sp * cl, -sp * sl, cp}, {cp * cl, cp * sl, sp}};
        geo_frame_place(enu, p, local);
        for (int i = 0; i < 3; i++) {
            double v = 0;
            for (int k = 0; k < 3; k++) v += axes[i][k] * (right[k] - o[k]);
            assert_true(fabs(local[i] - v) < 1e-6);
        }
    }
    geo_frame_free(ecef);
    geo_frame_free(enu);
}

/* Brute force: no place of any triangle of a rank, clamped ones too, is further from where it is drawn than the
 * bound says; and the bound is not idle. */
static void F29_flat_triangles_are_off_by_no_more_than_the_bound(void **state) {
    (void)state;
    start_dice(29);
    enum { RANKS = 30 };
    double idle = 0;
    for (int n = 0; n < 400; n++) {
        geo_frame *f;
        const int geoid = n % 4 == 3;
        assert_int_equal(geo_frame_create(GEO_ECEF, &wgs84, 0, 0, geoid, &f, NULL, 0), GEO_OK);
        const double step = n % 3 == 0 ? 1.0 / 3600 : n % 3 == 1 ? 0.01 : 0.5, samples = 8 + floor(dice(0, 120));
        geo_extent e = {.west = dice(-180, 180), .lon_step = step * dice(0.5, 2), .lat_step = step};
        e.south = dice(-90, 90 - samples * e.lat_step);
        if (geoid) { /* its slope changes at multiples of a quarter degree: in the middle, for all triangles */
            e.west = rint(e.west * 4) / 4 - floor(samples / 2) * e.lon_step;
            e.south = rint(fmin(e.south, 60) * 4) / 4;
        }
        e.north = e.south + samples * e.lat_step;
        e.east = e.west + samples * e.lon_step;
        e.lowest = dice(-8000, 1000);
        e.highest = e.lowest + (n % 2 ? 1 : dice(0, 4000));
        double metres[RANKS];
        geo_frame_sag(f, &e, RANKS, metres);
        for (int rank = 0; rank < RANKS; rank++) {
            assert_true(metres[rank] >= (rank ? metres[rank - 1] : 0));
            const double q = ldexp(1, rank / 2);
            if (2 * q > samples) break;
            for (int t = 0; t < 6; t++) {
                /* in units of q: half a square, or half of that, turned somehow, then clamped */
                static const double shapes[4][3][2] = {{{0, 0}, {2, 0}, {2, 2}},
                                                       {{0, 0}, {0, 2}, {2, 2}},
                                                       {{0, 0}, {2, 0}, {1, 1}},
                                                       {{0, 0}, {0, 2}, {1, 1}}};
                const int shape = rank % 2 ? t % 2 : 2 + t % 2;
                const double u = geoid ? floor(samples / 2) - q : floor(dice(0, samples - 2 * q + 1));
                const double v = floor(dice(0, samples - 2 * q + 1));
                const double clamp = t < 4 ? samples : u + dice(q, 2 * q);
                double c[3][3], at[3][3];
                for (int i = 0; i < 3; i++) {
                    c[i][0] = e.west + fmin(clamp, u + q * shapes[shape][i][0]) * e.lon_step;
                    c[i][1] = e.south + (v + q * shapes[shape][i][1]) * e.lat_step;
                    c[i][2] = t % 3 ? (i % 2 ? e.lowest : e.highest) : dice(e.lowest, e.highest);
                    geo_frame_place(f, c[i], at[i]);
                }
                for (int k = 0; k < 12; k++) {
                    double w[3] = {dice(0, 1), dice(0, 1), dice(0, 1)}, p[3], there[3], off = 0;
                    if (k < 3) w[k] = 0; /* on a side: there it is largest */
                    if (k < 3) w[(k + 1) % 3] = w[(k + 2) % 3] = 1;
                    const double sum = w[0] + w[1] + w[2];
                    for (int i = 0; i < 3; i++) p[i] = (w[0] * c[0][i] + w[1] * c[1][i] + w[2] * c[2][i]) / sum;
                    geo_frame_place(f, p, there);
                    for (int i = 0; i < 3; i++) {
                        const double flat = (w[0] * at[0][i] + w[1] * at[1][i] + w[2] * at[2][i]) / sum;
                        off += (there[i] - flat) * (there[i] - flat);
                    }
                    off = sqrt(off);
                    if (off > metres[rank])
                        fail_msg("rank %d, step %g at %g: off by %g, bound %g", rank, step, e.south, off,
                                 metres[rank]);
                    if (off > 0.01) idle = fmax(idle, off / metres[rank]);
                }
            }
        }
        geo_frame_free(f);
    }
    print_message("the bound is met to %.0f %%\n", 100 * idle);
    assert_true(idle > 0.7);
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
        cmocka_unit_test(circles_points_are_at_the_radius_and_sides_near_it),
        cmocka_unit_test(random_circles_are_circles),
        cmocka_unit_test(circles_begin_in_the_east_and_go_left),
        cmocka_unit_test(F25_circles_across_the_antimeridian_are_continuous),
        cmocka_unit_test(F28_circles_over_a_pole_hold_it_and_what_is_near),
        cmocka_unit_test(what_is_no_circle_is_refused),
        cmocka_unit_test(tiny_and_big_circles_are_circles),
        cmocka_unit_test(corridors_hold_what_is_near_and_nothing_else),
        cmocka_unit_test(F25_corridors_across_the_antimeridian_go_on),
        cmocka_unit_test(F28_corridors_over_a_pole_hold_it),
        cmocka_unit_test(what_is_no_corridor_is_refused),
        cmocka_unit_test(ellipsoids_are_read_out_of_wkt),
        cmocka_unit_test(planimetric_areas_are_those_of_geodesic_polygons),
        cmocka_unit_test(paths_follow_geodesics),
        cmocka_unit_test(places_in_space_are_the_textbooks),
        cmocka_unit_test(F29_flat_triangles_are_off_by_no_more_than_the_bound),
        cmocka_unit_test(test_version),
    };
    return cmocka_run_group_tests(tests, set_up, NULL);
}
