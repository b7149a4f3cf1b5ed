/* around.cpp - circles and corridors: all points within a distance of a point or a line.
 *
 * A *capsule* is all that is near one geodesic segment. Its rim is four curves: the right side, points at the end
 * of a geodesic of length r that leaves the segment at a right angle; the far cap, where it leaves the end at any
 * azimuth from right over ahead to left; the left side; the near cap. A circle is a capsule of a segment without
 * length. These are the points at distance r as long as no shorter way leads to them: for r below a quarter of the
 * Earth's circumference, on the outside of a convex thing, none does.
 *
 * Each curve is halved until the straight side in lon,lat is near enough to it, looked at in three places, in the
 * metric of each place. So sides are short where parallels curve, near the poles, and long elsewhere. Longitudes
 * are unrolled from point to point; two neighbours are less than 90 degrees apart, so there is no doubt about the
 * turn. A rim that has then gone round once holds a pole, and is closed over it.
 *
 * A line is the union of its segments' capsules (by GEOS). Only the first has a near cap: where a later one begins,
 * the disc about that point is already there, by those before it.
 */
#include "internal.h"

#include <GeographicLib/Geodesic.hpp>
#include <GeographicLib/GeodesicLine.hpp>
#include <geos_c.h>

#include <algorithm>
#include <cmath>

namespace {

using point = geo_point;

using GeographicLib::Geodesic;
using GeographicLib::GeodesicLine;

constexpr double SMALLEST_RADIUS = 1e-3, LARGEST_CORRIDOR = 5e6, POLE_MARGIN = 1e-3;
constexpr double DEGREE = 0.017453292519943295, EARTH = 6378137; /* metres, near enough for a tolerance */
constexpr int DEEPEST = 40;

struct ring {
    std::vector<point> points;
};

/* ------------------------------------------------------------------------------------------------ tracing */

/* How far the curve's point c is from the side a-b, in metres about c. */
double off_side(point a, point b, point c) {
    const double scale = std::cos(c.lat * DEGREE);
    const double ux = (b.lon - a.lon) * scale, uy = b.lat - a.lat, vx = (c.lon - a.lon) * scale, vy = c.lat - a.lat;
    const double length = std::hypot(ux, uy);
    const double off = length > 0 ? std::fabs(ux * vy - uy * vx) / length : std::hypot(vx, vy);
    return off * DEGREE * EARTH;
}

/* Appends the curve from after t0 to t1, both ends known. */
template <class Curve>
void trace(const Curve &curve, double t0, point a, double t1, point b, double tolerance, int depth,
           std::vector<point> &out) {
    b.lon = geo_unroll(b.lon, a.lon);
    point between[3];
    bool near = std::fabs(b.lon - a.lon) < 90;
    for (int i = 0; i < 3; i++) {
        between[i] = curve(t0 + (t1 - t0) * (i + 1) / 4);
        between[i].lon = geo_unroll(between[i].lon, i == 0 ? a.lon : between[i - 1].lon);
        near = near && std::fabs(between[i].lon - a.lon) < 90;
    }
    for (int i = 0; i < 3 && near; i++) near = off_side(a, b, between[i]) <= tolerance;
    if (near || depth >= DEEPEST) {
        out.push_back(b);
        return;
    }
    const double middle = (t0 + t1) / 2;
    trace(curve, t0, a, middle, between[1], tolerance, depth + 1, out);
    trace(curve, middle, out.back(), t1, b, tolerance, depth + 1, out);
}

/* The curve from t0 to t1 in n equal parts, and finer. The first point is the ring's last, or the one given. */
template <class Curve>
void trace_parts(const Curve &curve, double t0, double t1, int n, double tolerance, std::vector<point> &out,
                 double lon) {
    point a = curve(t0);
    if (out.empty()) {
        a.lon = geo_unroll(a.lon, lon);
        out.push_back(a);
    }
    for (int i = 1; i <= n; i++) {
        const double from = t0 + (t1 - t0) * (i - 1) / n, to = t0 + (t1 - t0) * i / n;
        trace(curve, from, out.back(), to, curve(to), tolerance, 0, out);
    }
}

/* ----------------------------------------------------------------------------------------------- capsules */

class capsule {
  public:
    capsule(point from, point to, double metres, bool near_cap, int cap_parts)
        : earth(Geodesic::WGS84()), radius(metres) {
        double length = 0, azimuth_from = 90, azimuth_to = 90;
        const bool is_point = from.lon == to.lon && from.lat == to.lat;
        if (!is_point) earth.Inverse(from.lat, from.lon, to.lat, to.lon, length, azimuth_from, azimuth_to);
        line = earth.Line(from.lat, from.lon, azimuth_from);
        begin = {from, azimuth_from};
        end = {to, azimuth_to};
        if (length > 0) refuse_both_poles(length);
        const double tolerance = 0.9 * GEO_RIM_TOLERANCE * metres; /* three places are not all */
        std::vector<point> &p = rim.points;
        if (length == 0) { /* from the east to the left, once around */
            trace_parts([&](double t) { return leave(begin, begin.azimuth - 360 * t); }, 0, 1, 2 * cap_parts,
                        tolerance, p, from.lon);
        } else {
            const int parts = 1 + static_cast<int>(length / 1e5);
            trace_parts([&](double s) { return leave(at(s), at(s).azimuth + 90); }, 0, length, parts, tolerance, p,
                        from.lon);
            trace_parts([&](double t) { return leave(end, end.azimuth + 90 - 180 * t); }, 0, 1, cap_parts,
                        tolerance, p, from.lon);
            trace_parts([&](double s) { return leave(at(s), at(s).azimuth - 90); }, length, 0, parts, tolerance, p,
                        from.lon);
            if (near_cap)
                trace_parts([&](double t) { return leave(begin, begin.azimuth - 90 - 180 * t); }, 0, 1, cap_parts,
                            tolerance, p, from.lon);
            else
                p.push_back({geo_unroll(p.front().lon, p.back().lon), p.front().lat});
        }
        close();
    }

    ring rim;

  private:
    struct place {
        point p;
        double azimuth;
    };
    const Geodesic &earth;
    GeodesicLine line;
    double radius;
    place begin, end;

    place at(double s) const {
        place q{};
        line.Position(s, q.p.lat, q.p.lon, q.azimuth);
        return q;
    }
    point leave(const place &q, double azimuth) const {
        point r{};
        earth.Direct(q.p.lat, q.p.lon, azimuth, radius, r.lat, r.lon);
        return r;
    }

    void refuse_both_poles(double length) const {
        const int n = 1 + static_cast<int>(length / 5e4);
        bool near[2] = {false, false};
        for (int i = 0; i <= n; i++) {
            const place q = at(length * i / n);
            for (int south = 0; south < 2; south++)
                if ((90 - (south ? -q.p.lat : q.p.lat)) * DEGREE * 6.3e6 < radius + 5e4) near[south] = true;
        }
        if (near[0] && near[1]) throw geo_refusal("a segment of the line reaches both poles");
    }

    /* The last point is the first again; if it is one turn on, the rim goes round a pole. */
    void close() {
        std::vector<point> &p = rim.points;
        double most = 0;
        for (const point &q : p) most = std::max(most, std::fabs(q.lat));
        if ((90 - most) * DEGREE * EARTH < POLE_MARGIN)
            throw geo_refusal("the rim passes through a pole: make the radius a little smaller or larger");
        const double turn = p.back().lon - p.front().lon;
        p.back() = {p.front().lon + 360 * std::nearbyint(turn / 360), p.front().lat};
        if (std::fabs(turn) < 180) {
            p.pop_back();
            return;
        }
        const double pole = turn > 0 ? 90 : -90; /* east about the north pole is to the left */
        p.push_back({p.back().lon, pole});
        p.push_back({p.front().lon, pole});
    }
};

void check_point(double lon, double lat) {
    /* Written so that NaN fails. */
    if (!(std::fabs(lon) <= 360)) throw geo_refusal("the longitude must be a number from -360 to 360");
    if (!(std::fabs(lat) <= 90)) throw geo_refusal("the latitude must be a number from -90 to 90");
}

void check_radius(double metres) {
    if (!(metres > 0) || std::isinf(metres)) throw geo_refusal("the radius must be a positive number of metres");
    if (metres < SMALLEST_RADIUS) throw geo_refusal("the radius must be at least a millimetre");
}

/* -------------------------------------------------------------------------------------------------- union */

struct collector {
    std::vector<double> lonlat;
    std::vector<std::size_t> ring_points;
    std::vector<unsigned char> is_shell;

    void add(const std::vector<point> &points, bool shell) {
        for (const point &p : points) {
            lonlat.push_back(p.lon);
            lonlat.push_back(p.lat);
        }
        ring_points.push_back(points.size());
        is_shell.push_back(shell);
    }
    void hand_out(geo_polygons *out) const {
        *out = geo_polygons{};
        try {
            out->lonlat = geo_hand_out(lonlat);
            out->ring_points = geo_hand_out(ring_points);
            out->ring_is_shell = geo_hand_out(is_shell);
        } catch (...) {
            geo_polygons_free(out);
            throw;
        }
        out->points = lonlat.size() / 2;
        out->rings = ring_points.size();
    }
};

/* GEOS behind its own context; what it makes is released with it. */
class geos {
  public:
    geos() : context(GEOS_init_r()) {
        if (!context) throw std::bad_alloc();
    }
    ~geos() {
        for (GEOSGeometry *g : owned) GEOSGeom_destroy_r(context, g);
        if (all) GEOSGeom_destroy_r(context, all);
        GEOS_finish_r(context);
    }
    geos(const geos &) = delete;
    geos &operator=(const geos &) = delete;

    void add(const ring &rim) {
        std::vector<double> xy;
        for (const point &p : rim.points) xy.insert(xy.end(), {p.lon, p.lat});
        xy.insert(xy.end(), {rim.points[0].lon, rim.points[0].lat});
        owned.push_back(nullptr);
        GEOSCoordSequence *s =
            GEOSCoordSeq_copyFromBuffer_r(context, xy.data(), static_cast<unsigned>(xy.size() / 2), 0, 0);
        GEOSGeometry *shell = s ? GEOSGeom_createLinearRing_r(context, s) : nullptr;
        GEOSGeometry *polygon = shell ? GEOSGeom_createPolygon_r(context, shell, nullptr, 0) : nullptr;
        if (!polygon) throw geo_refusal("GEOS could not make a polygon");
        owned.back() = polygon;
    }

    void unite(collector &out) {
        GEOSGeometry *many = GEOSGeom_createCollection_r(context, GEOS_MULTIPOLYGON, owned.data(),
                                                         static_cast<unsigned>(owned.size()));
        if (!many) throw geo_refusal("GEOS could not unite the corridor's segments");
        owned.clear();
        all = many;
        GEOSGeometry *united = GEOSUnaryUnion_r(context, many);
        if (!united) throw geo_refusal("GEOS could not unite the corridor's segments");
        GEOSGeom_destroy_r(context, all);
        all = united;
        const int n = GEOSGetNumGeometries_r(context, united);
        for (int i = 0; i < n; i++) {
            const GEOSGeometry *polygon = GEOSGetGeometryN_r(context, united, i);
            take(GEOSGetExteriorRing_r(context, polygon), true, out);
            const int holes = GEOSGetNumInteriorRings_r(context, polygon);
            for (int h = 0; h < holes; h++) take(GEOSGetInteriorRingN_r(context, polygon, h), false, out);
        }
    }

  private:
    GEOSContextHandle_t context;
    std::vector<GEOSGeometry *> owned;
    GEOSGeometry *all = nullptr;

    void take(const GEOSGeometry *line, bool shell, collector &out) const {
        const GEOSCoordSequence *s = line ? GEOSGeom_getCoordSeq_r(context, line) : nullptr;
        unsigned n = 0;
        if (!s || !GEOSCoordSeq_getSize_r(context, s, &n) || n < 4) throw geo_refusal("GEOS lost a ring");
        std::vector<point> points(n);
        if (!GEOSCoordSeq_copyToBuffer_r(context, s, &points[0].lon, 0, 0)) throw geo_refusal("GEOS lost a ring");
        points.pop_back();
        out.add(points, shell);
    }
};

} // namespace

extern "C" void geo_polygons_free(geo_polygons *polygons) {
    std::free(polygons->lonlat);
    std::free(polygons->ring_points);
    std::free(polygons->ring_is_shell);
    *polygons = geo_polygons{};
}

extern "C" int geo_circle(double lon, double lat, double metres, geo_polygons *out, char *message,
                          int message_size) {
    *out = geo_polygons{};
    return geo_guard(message, message_size, [&] {
        check_point(lon, lat);
        check_radius(metres);
        double to_pole = 0;
        Geodesic::WGS84().Inverse(lat, lon, lat > 0 ? -90 : 90, lon, to_pole);
        if (metres > to_pole - POLE_MARGIN)
            throw geo_refusal("the circle reaches both poles: the radius is too large");
        collector rings;
        rings.add(capsule({lon, lat}, {lon, lat}, metres, true, 128).rim.points, true);
        rings.hand_out(out);
    });
}

extern "C" int geo_corridor(const double *lonlat, const size_t *line_points, size_t lines, double metres,
                            geo_polygons *out, char *message, int message_size) {
    *out = geo_polygons{};
    return geo_guard(message, message_size, [&] {
        check_radius(metres);
        if (metres > LARGEST_CORRIDOR) throw geo_refusal("the distance must be at most 5000 km");
        std::size_t points = 0;
        for (std::size_t l = 0; l < lines; l++) points += line_points[l];
        if (points > GEO_CORRIDOR_POINTS)
            throw geo_refusal("the line has more than 100000 points: simplify it first");
        std::vector<ring> rims;
        const double *p = lonlat;
        for (std::size_t l = 0; l < lines; l++) {
            check_point(p[0], p[1]);
            point from{p[0], p[1]};
            bool first = true;
            for (std::size_t i = 1; i <= line_points[l]; i++, p += 2) {
                const bool lone = i == line_points[l]; /* the last point: a circle when no segment was there */
                if (lone && !first) continue;
                point to = from;
                if (!lone) {
                    check_point(p[2], p[3]);
                    to = {geo_unroll(p[2], from.lon), p[3]};
                    if (to.lon == from.lon && to.lat == from.lat) continue;
                }
                rims.push_back(capsule(from, to, metres, first, 4).rim);
                first = false;
                from = to;
            }
        }
        collector rings;
        if (rims.size() == 1) {
            rings.add(rims[0].points, true);
        } else if (rims.size() > 1) {
            geos g;
            for (const ring &r : rims) g.add(r);
            g.unite(rings);
        }
        rings.hand_out(out);
    });
}
