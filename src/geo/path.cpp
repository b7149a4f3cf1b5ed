/* path.cpp - geodesics as straight pieces in lon,lat, for walking over a grid.
 *
 * A geodesic is a curve in lon,lat. It is halved until its piece is off it by at most a small part of a cell,
 * looked at in three places; what remains is less than what the mesh itself knows of the ground.
 */
#include "internal.h"

#include <GeographicLib/Geodesic.hpp>
#include <GeographicLib/GeodesicLine.hpp>

#include <cmath>

namespace {

using point = geo_point;

using GeographicLib::Geodesic;
using GeographicLib::GeodesicLine;

struct builder {
    double cell_lon, cell_lat;
    std::vector<double> lonlat, metres;
    std::vector<unsigned char> own, ends;

    void add(point p, double at, bool is_own) {
        if (metres.size() >= GEO_PATH_POINTS) throw geo_refusal("the line is too long for cells this small");
        lonlat.push_back(p.lon);
        lonlat.push_back(p.lat);
        metres.push_back(at);
        own.push_back(is_own);
        ends.push_back(0);
    }

    /* In cells. */
    double off(point a, point b, point c) const {
        const double ux = (b.lon - a.lon) / cell_lon, uy = (b.lat - a.lat) / cell_lat;
        const double vx = (c.lon - a.lon) / cell_lon, vy = (c.lat - a.lat) / cell_lat;
        const double length = std::hypot(ux, uy);
        return length > 0 ? std::fabs(ux * vy - uy * vx) / length : std::hypot(vx, vy);
    }

    /* The inner points of the geodesic from s0 to s1. */
    point trace(const GeodesicLine &line, double from, double s0, point a, double s1, point b, int depth) {
        point between[3];
        b.lon = geo_unroll(b.lon, a.lon);
        for (int i = 0; i < 3; i++) {
            line.Position(s0 + (s1 - s0) * (i + 1) / 4, between[i].lat, between[i].lon);
            between[i].lon = geo_unroll(between[i].lon, i == 0 ? a.lon : between[i - 1].lon);
        }
        bool near = std::fabs(b.lon - a.lon) < 90;
        for (int i = 0; i < 3 && near; i++) near = off(a, b, between[i]) <= 0.9 * GEO_PATH_TOLERANCE;
        if (near || depth >= 40) return b;
        const double middle = (s0 + s1) / 2;
        const point m = trace(line, from, s0, a, middle, between[1], depth + 1);
        add(m, from + middle, false);
        return trace(line, from, middle, m, s1, b, depth + 1);
    }
};

} // namespace

extern "C" void geo_path_free(geo_path *path) {
    std::free(path->lonlat);
    std::free(path->metres);
    std::free(path->own);
    std::free(path->ends);
    std::free(path->line_points);
    *path = geo_path{};
}

extern "C" int geo_path_create(const geo_ellipsoid *ellipsoid, const double *lonlat, const size_t *line_points,
                               size_t lines, double cell_lon, double cell_lat, geo_path *out, char *message,
                               int message_size) {
    *out = geo_path{};
    const int code = geo_guard(message, message_size, [&] {
        const Geodesic earth(ellipsoid->a, ellipsoid->f);
        builder path{std::fabs(cell_lon), std::fabs(cell_lat), {}, {}, {}, {}};
        std::vector<std::size_t> counts;
        double gone = 0;
        for (std::size_t l = 0; l < lines; l++) {
            const std::size_t before = path.metres.size();
            point last{};
            for (std::size_t i = 0; i < line_points[l]; i++, lonlat += 2) {
                point p{lonlat[0], lonlat[1]};
                if (!(std::fabs(p.lat) <= 90)) throw geo_refusal("a latitude of the line is beyond 90");
                if (!(std::fabs(p.lon) <= 720)) throw geo_refusal("a longitude of the line is beyond 720");
                if (i > 0) {
                    p.lon = geo_unroll(p.lon, last.lon);
                    if (p.lon == last.lon && p.lat == last.lat) continue;
                    const GeodesicLine line = earth.InverseLine(last.lat, last.lon, p.lat, p.lon);
                    const point end = path.trace(line, gone, 0, last, line.Distance(), p, 0);
                    p.lon = end.lon; /* the turn on which the pieces have come there */
                    gone += line.Distance();
                }
                path.add(p, gone, true);
                last = p;
            }
            path.ends.back() = 1;
            counts.push_back(path.metres.size() - before);
        }
        out->lonlat = geo_hand_out(path.lonlat);
        out->metres = geo_hand_out(path.metres);
        out->own = geo_hand_out(path.own);
        out->ends = geo_hand_out(path.ends);
        out->line_points = geo_hand_out(counts);
        out->points = path.metres.size();
        out->lines = counts.size();
    });
    if (code != GEO_OK) geo_path_free(out);
    return code;
}

extern "C" double geo_distance(const geo_ellipsoid *ellipsoid, const double from[2], const double to[2]) {
    double metres = 0;
    try {
        const Geodesic earth(ellipsoid->a, ellipsoid->f);
        earth.Inverse(from[1], from[0], to[1], to[0], metres);
    } catch (...) {
        metres = NAN;
    }
    return metres;
}
