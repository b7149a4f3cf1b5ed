/* surface.cpp - areas and volume of a triangle of terrain over an ellipsoid.
 *
 * A triangle is straight in longitude, latitude and height, as the mesh is. With the radii of curvature M along the
 * meridian and N across it, the point at height h has the metric (M+h) dlat, (N+h) cos(lat) dlon, dh; so,
 * integrated over the triangle in lon,lat:
 *
 *   planimetric   M N cos(lat), at height 0
 *   surface       the square root of (M+h)^2 (N+h)^2 cos^2 + (M+h)^2 h_lon^2 + (N+h)^2 cos^2 h_lat^2
 *   volume        the integral of (M+k) (N+k) cos(lat) over k from 0 to h: cos (M N h + (M+N) h^2/2 + h^3/3)
 *
 * by the rule of seven points that is exact for polynomials of degree 5, over parts of at most half a degree: what
 * it leaves off is below 1e-12 of the whole. Nothing is taken for a plane.
 */
#include "internal.h"

#include <algorithm>
#include <cmath>

namespace {

constexpr double DEGREE = 0.017453292519943295, LARGEST_PART = 0.5;

struct corner {
    double lon, lat, h;
};

corner middle(const corner &a, const corner &b) {
    return {(a.lon + b.lon) / 2, (a.lat + b.lat) / 2, (a.h + b.h) / 2};
}

struct measurer {
    double a, e2;
    double h_lon, h_lat; /* the triangle's slope, metres per radian */
    geo_measure sum;

    void point(double weight, double lat, double h) {
        const double sine = std::sin(lat * DEGREE), cosine = std::cos(lat * DEGREE);
        const double w2 = 1 - e2 * sine * sine, n = a / std::sqrt(w2), m = n * (1 - e2) / w2;
        const double mh = m + h, nh = (n + h) * cosine;
        sum.planimetric += weight * m * n * cosine;
        sum.surface += weight * std::sqrt(mh * mh * nh * nh + mh * mh * h_lon * h_lon + nh * nh * h_lat * h_lat);
        sum.volume += weight * cosine * h * (m * n + (m + n) * h / 2 + h * h / 3);
    }

    void part(const corner &p, const corner &q, const corner &r) {
        const double pq = std::hypot(q.lon - p.lon, q.lat - p.lat), qr = std::hypot(r.lon - q.lon, r.lat - q.lat),
                     rp = std::hypot(p.lon - r.lon, p.lat - r.lat), longest = std::max(pq, std::max(qr, rp));
        if (longest > LARGEST_PART) { /* halve the longest side */
            const corner *a0 = &p, *b0 = &q, *c0 = &r;
            if (longest == qr)
                a0 = &q, b0 = &r, c0 = &p;
            else if (longest == rp)
                a0 = &r, b0 = &p, c0 = &q;
            const corner m = middle(*a0, *b0);
            part(*a0, m, *c0);
            part(m, *b0, *c0);
            return;
        }
        const double area =
            std::fabs((q.lon - p.lon) * (r.lat - p.lat) - (r.lon - p.lon) * (q.lat - p.lat)) / 2 * DEGREE * DEGREE;
        static const double root = std::sqrt(15.0);
        static const double near[2] = {(6 - root) / 21, (6 + root) / 21};
        static const double weight[2] = {(155 - root) / 1200, (155 + root) / 1200};
        point(area * 9 / 40, (p.lat + q.lat + r.lat) / 3, (p.h + q.h + r.h) / 3);
        for (int k = 0; k < 2; k++) {
            const double s = near[k], t = 1 - 2 * s;
            point(area * weight[k], t * p.lat + s * q.lat + s * r.lat, t * p.h + s * q.h + s * r.h);
            point(area * weight[k], s * p.lat + t * q.lat + s * r.lat, s * p.h + t * q.h + s * r.h);
            point(area * weight[k], s * p.lat + s * q.lat + t * r.lat, s * p.h + s * q.h + t * r.h);
        }
    }
};

} // namespace

extern "C" geo_measure geo_measure_triangle(const geo_ellipsoid *ellipsoid, const double lonlath[3][3]) {
    corner c[3];
    for (int i = 0; i < 3; i++) c[i] = {lonlath[i][0], lonlath[i][1], lonlath[i][2]};
    measurer m{ellipsoid->a, ellipsoid->f * (2 - ellipsoid->f), 0, 0, {0, 0, 0}};
    const double ux = (c[1].lon - c[0].lon) * DEGREE, uy = (c[1].lat - c[0].lat) * DEGREE, uh = c[1].h - c[0].h;
    const double vx = (c[2].lon - c[0].lon) * DEGREE, vy = (c[2].lat - c[0].lat) * DEGREE, vh = c[2].h - c[0].h;
    const double twice = ux * vy - vx * uy;
    if (twice == 0 || !std::isfinite(twice)) return m.sum;
    m.h_lon = (uh * vy - vh * uy) / twice;
    m.h_lat = (ux * vh - vx * uh) / twice;
    m.part(c[0], c[1], c[2]);
    return m.sum;
}
