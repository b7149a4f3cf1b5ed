/* verify_tiles_space.h - places and distances in space, by textbook means: what is checked shares none of it.
 *
 * Ellipsoid WGS 84; distances of points from triangles by regions (Ericson, Real-Time Collision Detection, 5.1.5),
 * the nearest of many by a tree of boxes; what hides behind the ellipsoid by whether a line of sight meets it.
 */
#ifndef VERIFY_TILES_SPACE_H
#define VERIFY_TILES_SPACE_H

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <numeric>
#include <string>
#include <vector>

static constexpr double RADIAN = 0.017453292519943295, EQUATOR = 6378137.0, FLATTENING = 1 / 298.257223563;
static constexpr double POLE = EQUATOR * (1 - FLATTENING), E2 = FLATTENING * (2 - FLATTENING);

struct Vec {
    double x = 0, y = 0, z = 0;
};
static inline Vec operator-(Vec a, Vec b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
static inline Vec operator+(Vec a, Vec b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}
static inline Vec operator*(Vec a, double f) {
    return {a.x * f, a.y * f, a.z * f};
}
static inline double dot(Vec a, Vec b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
static inline Vec cross(Vec a, Vec b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
static inline double length(Vec a) {
    return std::sqrt(dot(a, a));
}

struct Angle {
    double sine, cosine;
    explicit Angle(double degrees) : sine(std::sin(degrees * RADIAN)), cosine(std::cos(degrees * RADIAN)) {}
};

static inline Vec ecef(const Angle &lon, const Angle &lat, double h) {
    const double n = EQUATOR / std::sqrt(1 - E2 * lat.sine * lat.sine);
    return {(n + h) * lat.cosine * lon.cosine, (n + h) * lat.cosine * lon.sine, (n * (1 - E2) + h) * lat.sine};
}

/* The place of triangle a, b, c that is nearest to p. */
static inline Vec nearest_of_triangle(Vec p, Vec a, Vec b, Vec c) {
    const Vec ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
    const double d1 = dot(ab, ap), d2 = dot(ac, ap), d3 = dot(ab, bp), d4 = dot(ac, bp), d5 = dot(ab, cp),
                 d6 = dot(ac, cp);
    if (d1 <= 0 && d2 <= 0) return a;
    if (d3 >= 0 && d4 <= d3) return b;
    const double vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + ab * (d1 / (d1 - d3));
    if (d6 >= 0 && d5 <= d6) return c;
    const double vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + ac * (d2 / (d2 - d6));
    const double va = d3 * d6 - d5 * d4;
    if (va <= 0 && d4 >= d3 && d5 >= d6) return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    const double total = va + vb + vc;
    return total == 0 ? a : a + ab * (vb / total) + ac * (vc / total);
}

/* A tree of boxes over the triangles of a tile. */
class Tree {
  public:
    Tree(const std::vector<Vec> &places, const std::vector<uint32_t> &corners)
        : place(places), corner(corners), order(corners.size() / 3) {
        std::iota(order.begin(), order.end(), 0U);
        if (!order.empty()) build(0, order.size());
    }
    double distance(Vec p) const {
        double best = HUGE_VAL;
        if (!nodes.empty()) search(0, p, best);
        return std::sqrt(best);
    }

  private:
    struct Node {
        Vec low, high;
        size_t from, to, left, right; /* left 0: a leaf with the triangles from .. to of order */
    };
    const std::vector<Vec> &place;
    const std::vector<uint32_t> &corner;
    std::vector<uint32_t> order;
    std::vector<Node> nodes;

    Vec of(uint32_t triangle, int k) const { return place[corner[3 * (size_t)triangle + (size_t)k]]; }
    size_t build(size_t from, size_t to) {
        Vec low = {HUGE_VAL, HUGE_VAL, HUGE_VAL}, high = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
        for (size_t i = from; i < to; i++)
            for (int k = 0; k < 3; k++) {
                const Vec p = of(order[i], k);
                low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
                high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
            }
        const size_t me = nodes.size();
        nodes.push_back({low, high, from, to, 0, 0});
        if (to - from <= 4) return me;
        const Vec wide = high - low;
        double Vec::*axis = wide.x >= wide.y && wide.x >= wide.z ? &Vec::x : wide.y >= wide.z ? &Vec::y : &Vec::z;
        const size_t middle = (from + to) / 2;
        const auto first = order.begin();
        std::nth_element(first + (long)from, first + (long)middle, first + (long)to, [&](uint32_t a, uint32_t b) {
            return (of(a, 0) + of(a, 1) + of(a, 2)).*axis < (of(b, 0) + of(b, 1) + of(b, 2)).*axis;
        });
        const size_t left = build(from, middle), right = build(middle, to);
        nodes[me].left = left;
        nodes[me].right = right;
        return me;
    }
    static double square_to(const Node &n, Vec p) {
        const Vec d = {std::max({n.low.x - p.x, 0.0, p.x - n.high.x}),
                       std::max({n.low.y - p.y, 0.0, p.y - n.high.y}),
                       std::max({n.low.z - p.z, 0.0, p.z - n.high.z})};
        return dot(d, d);
    }
    void search(size_t me, Vec p, double &best) const {
        const Node &n = nodes[me];
        if (n.left == 0) {
            for (size_t i = n.from; i < n.to; i++) {
                const Vec d = p - nearest_of_triangle(p, of(order[i], 0), of(order[i], 1), of(order[i], 2));
                best = std::min(best, dot(d, d));
            }
            return;
        }
        const double to_left = square_to(nodes[n.left], p), to_right = square_to(nodes[n.right], p);
        const size_t near = to_left <= to_right ? n.left : n.right, far = near == n.left ? n.right : n.left;
        if (std::min(to_left, to_right) < best) search(near, p, best);
        if (std::max(to_left, to_right) < best) search(far, p, best);
    }
};

/* ------------------------------------------------------------------------------------------------- horizon -- */

/* All scaled so that the ellipsoid is a sphere of radius 1. */
static inline Vec scaled(Vec p) {
    return {p.x / EQUATOR, p.y / EQUATOR, p.z / POLE};
}

/* Do clients take a tile with this horizon point to be hidden? As CesiumJS does (EllipsoidalOccluder,
 * isScaledSpacePointVisible). */
static inline bool client_hides(Vec camera, Vec point) {
    const Vec to = point - camera;
    const double horizon = dot(camera, camera) - 1, along = -dot(to, camera);
    return along > horizon && along * along / dot(to, to) > horizon;
}

/* Truly: the line of sight goes through the sphere. A point below it is taken as if it were on it. */
static inline bool is_hidden(Vec camera, Vec point) {
    if (dot(point, point) < 1) point = point * (1 / length(point));
    const Vec way = point - camera;
    const double t = std::clamp(-dot(camera, way) / dot(way, way), 0.0, 1.0);
    const Vec nearest = camera + way * t;
    return dot(nearest, nearest) < 1 + 1e-12;
}

#endif
