/* verify_tiles_quantized_mesh.cpp - the judge of a folder of quantized-mesh tiles: every tile of every level is
 * decoded and put beside the raster that it is of, at every sample.
 *
 * What is looked at:
 *
 *     space     no sample is further from the tile's flat triangles in space than the tile states ("error" of
 *               its metadata)
 *     height    ... or further above or below a triangle that covers it ("verticalError")
 *     cover     every sample of the terrain's mesh is covered; voids move the outline by the stated error on the
 *               ground (outline `tol`), quantisation by a unit of the tile's 32767
 *     edges     neighbours have the same vertices and normals on the side that they share, corners too. Where
 *               voids end at the side only one of them may have ground: then no vertex of it lies on an edge of
 *               the other
 *     children  what a tile covers its children cover: samples; and the quarter's area, exactly inside
 *     header    sphere, horizon point (thousands of cameras about where the tile sinks below it), heights, lists
 *               of sides
 *     normals   within a degree of the raster's central differences in space, which is what 2 x 8 bits can say
 *     water     the mask is the sea
 *     listed    layer.json lists the files that there are
 *
 * A table with a line a level goes to stdout.
 */
#include "verify_tiles.h"
#include "verify_tiles_decode.h"

#include <random>
#include <tuple>

namespace {

std::string name_of(const Tile &t) {
    return ::name_of(t.z, t.x, t.y);
}

/* What is kept of a tile when it has been looked at. */
struct SideVertex {
    int along;
    double degrees, height;
    uint16_t normal;
    bool operator<(const SideVertex &o) const {
        return std::tie(along, height, normal) < std::tie(o.along, o.height, o.normal);
    }
    bool operator==(const SideVertex &o) const {
        return along == o.along && degrees == o.degrees && height == o.height && normal == o.normal;
    }
};
struct Summary {
    std::vector<SideVertex> sides[SIDES];
    std::vector<std::pair<int, int>> segments[SIDES]; /* of a side, that triangles have */
    double area = 0,
           quarter[4] = {}; /* in units of this tile; of halves of them: south-west, -east, north-west, -east */
    bool is_whole[4] = {}, has_voids[4] = {}; /* the quarter lies in the raster; ... near voids */
};
using Key = std::pair<int, int>; /* x, y */

struct LevelFigures {
    size_t tiles = 0, vertices = 0, triangles = 0, samples = 0, rim = 0, sides = 0, turned = 0;
    double error = 0, space = 0, metres = 0, height = 0, normal = 0;
};

class Judge {
  public:
    Judge(const Raster &source, const std::string &tiles) : raster(source), folder(tiles) {}
    bool run();

  private:
    const Raster &raster;
    const std::string folder;
    Verdict verdict;
    std::map<Key, Summary> level, above;
    std::vector<uint8_t> cover, cover_above; /* 1: in a triangle, 2: a unit or less from one */
    LevelFigures figures;
    std::mt19937_64 random{1};
    double low = NAN, high = NAN;
    bool has_water = false;

    void judge_level(int z, const std::vector<Key> &keys);
    void judge_tile(const Tile &t);
    void judge_samples(const Tile &t, const std::vector<Vec> &places, int turn);
    void judge_rim(const Tile &t, const std::vector<Vec> &places, int turn);
    void judge_header(const Tile &t, const std::vector<Vec> &places);
    void judge_horizon(const Tile &t, const std::vector<Vec> &places);
    void judge_normals(const Tile &t, int turn);
    void judge_water(const Tile &t);
    void judge_neighbours(int z);
    void judge_children();
    void judge_cover(int z);
    Summary summarise(const Tile &t) const;
    std::map<int, std::vector<Key>> read_listed();

    double column(double lon, int turn) const { return (lon + 360 * turn - raster.x0) / raster.dx; }
    double row(double lat) const { return (lat - raster.y0) / raster.dy; }
    /* Turns of longitude by which the tile's west..east lies on the raster. */
    std::vector<int> turns_of(const Tile &t) const {
        std::vector<int> turns;
        const int first = (int)std::floor((raster.x0 - 180) / 360);
        const int last = (int)std::ceil((raster.x0 + raster.width * raster.dx + 180) / 360);
        for (int turn = first; turn <= last; turn++) /* the sides too, but for a rounding */
            if (column(t.west + t.side, turn) >= -1e-9 && column(t.west, turn) <= raster.width - 1 + 1e-9)
                turns.push_back(turn);
        return turns;
    }
};

/* ------------------------------------------------------------------------------------------------- samples -- */

int first_in(double from) {
    return (int)std::ceil(std::max(from, 0.0) - 1e-9);
}
int last_in(double to, int count) {
    return (int)std::floor(std::min(to, count - 1.0) + 1e-9);
}

void Judge::judge_samples(const Tile &t, const std::vector<Vec> &places, int turn) {
    Promise &space = verdict.of("space: no sample is further from a tile in space than it states");
    Promise &height = verdict.of("height: no sample is further above or below a tile than it states");
    std::unique_ptr<Tree> tree; /* made when a sample may be nearer to another triangle than to the one above it */
    std::vector<double> cs(t.count()), rs(t.count()), hs(t.count());
    for (size_t i = 0; i < t.count(); i++)
        cs[i] = column(t.lon(i), turn), rs[i] = row(t.lat(i)), hs[i] = t.height(i);
    for (size_t i = 0; i < t.triangles.size(); i += 3) {
        const uint32_t a = t.triangles[i], b = t.triangles[i + 1], c = t.triangles[i + 2];
        const double area = (cs[b] - cs[a]) * (rs[c] - rs[a]) - (cs[c] - cs[a]) * (rs[b] - rs[a]);
        if (area == 0) continue;
        const int c0 = first_in(std::min({cs[a], cs[b], cs[c]})),
                  c1 = last_in(std::max({cs[a], cs[b], cs[c]}), raster.width);
        const int r0 = first_in(std::min({rs[a], rs[b], rs[c]})),
                  r1 = last_in(std::max({rs[a], rs[b], rs[c]}), raster.height);
        for (int r = r0; r <= r1; r++)
            for (int k = c0; k <= c1; k++) {
                const double wb = ((k - cs[a]) * (rs[c] - rs[a]) - (cs[c] - cs[a]) * (r - rs[a])) / area;
                const double wc = ((cs[b] - cs[a]) * (r - rs[a]) - (k - cs[a]) * (rs[b] - rs[a])) / area;
                if (wb < -1e-9 || wc < -1e-9 || wb + wc > 1 + 1e-9) continue;
                const size_t s = raster.index(k, r);
                cover[s] = 1;
                if (!raster.is_valid(k, r)) continue;
                const double off = std::fabs((1 - wb - wc) * hs[a] + wb * hs[b] + wc * hs[c] - raster.sample(s));
                const Vec p = raster.place(k, r);
                double d = length(p - nearest_of_triangle(p, places[a], places[b], places[c]));
                if (d > space.worst * t.error || d > figures.space * t.error) {
                    if (!tree) tree = std::make_unique<Tree>(places, t.triangles);
                    d = tree->distance(p);
                }
                const double share = d / t.error, share_above = off / t.vertical_error;
                space.worst = std::max(space.worst, share);
                height.worst = std::max(height.worst, share_above);
                if (share > figures.space) figures.space = share, figures.metres = d;
                figures.height = std::max(figures.height, share_above);
                verdict.see(space, share <= 1, [&] {
                    return name_of(t) + ": sample " + std::to_string(k) + "," + std::to_string(r) + " is " +
                           std::to_string(d) + " m off, and it states " + std::to_string(t.error);
                });
                verdict.see(height, share_above <= 1, [&] {
                    return name_of(t) + ": sample " + std::to_string(k) + "," + std::to_string(r) + " is " +
                           std::to_string(off) + " m above or below, and it states " +
                           std::to_string(t.vertical_error);
                });
            }
    }
}

/* Samples of the terrain's mesh that no triangle covers: are they at its outline, which rounding moves? */
void Judge::judge_rim(const Tile &t, const std::vector<Vec> &places, int turn) {
    Promise &space = verdict.of("space: no sample is further from a tile in space than it states");
    std::unique_ptr<Tree> tree, plan_tree;
    std::vector<Vec> plan;
    const int c0 = first_in(column(t.west, turn)), c1 = last_in(column(t.west + t.side, turn), raster.width);
    const int r0 = first_in(row(t.south + t.side)), r1 = last_in(row(t.south), raster.height);
    for (int r = r0; r <= r1; r++)
        for (int c = c0; c <= c1; c++) {
            const size_t s = raster.index(c, r);
            if (cover[s] || !raster.must_be_covered(s, t.error)) continue;
            if (!tree) {
                for (size_t i = 0; i < t.count(); i++) plan.push_back({(double)t.u[i], (double)t.v[i], 0});
                tree = std::make_unique<Tree>(places, t.triangles);
                plan_tree = std::make_unique<Tree>(plan, t.triangles);
            }
            const Vec here = {(raster.x0 + c * raster.dx - 360 * turn - t.west) / t.side * UNITS,
                              (raster.y0 + r * raster.dy - t.south) / t.side * UNITS, 0};
            if (plan_tree->distance(here) > 1) continue;
            cover[s] = 2;
            const double share = tree->distance(raster.place(c, r)) / t.error;
            space.worst = std::max(space.worst, share);
            verdict.see(space, share <= 1, [&] {
                return name_of(t) + ": sample " + std::to_string(c) + "," + std::to_string(r) +
                       " at the outline is " + std::to_string(share * t.error) + " m off, and it states " +
                       std::to_string(t.error);
            });
        }
}

void Judge::judge_cover(int z) {
    Promise &covered = verdict.of("cover: tiles of a level cover every sample of the terrain's mesh");
    Promise &kept = verdict.of("children: samples that a tile covers are covered by its children");
    for (int r = 0; r < raster.height; r++)
        for (int c = 0; c < raster.width; c++) {
            const size_t s = raster.index(c, r);
            figures.samples += cover[s] == 1;
            figures.rim += cover[s] == 2;
            if (!raster.must_be_covered(s, figures.error)) continue;
            const auto where = [&] {
                return "level " + std::to_string(z) + ": sample " + std::to_string(c) + "," + std::to_string(r);
            };
            verdict.see(covered, cover[s] != 0, where);
            if (!above.empty() && cover_above[s]) verdict.see(kept, cover[s] != 0, where);
        }
}

/* ---------------------------------------------------------------------------------- neighbours and children -- */

/* Area of the part of a triangle where x and y, each turned by a sign, are no less than 0. */
double clipped_area(std::vector<std::array<double, 2>> shape) {
    for (int axis = 0; axis < 2; axis++) {
        std::vector<std::array<double, 2>> kept;
        for (size_t i = 0; i < shape.size(); i++) {
            const auto a = shape[i], b = shape[(i + 1) % shape.size()];
            const double da = a[(size_t)axis], db = b[(size_t)axis];
            if (da >= 0) kept.push_back(a);
            if ((da > 0 && db < 0) || (da < 0 && db > 0)) {
                const double w = da / (da - db);
                kept.push_back({a[0] + w * (b[0] - a[0]), a[1] + w * (b[1] - a[1])});
            }
        }
        shape = kept;
    }
    double twice = 0;
    for (size_t i = 0; i < shape.size(); i++) {
        const auto a = shape[i], b = shape[(i + 1) % shape.size()];
        twice += a[0] * b[1] - b[0] * a[1];
    }
    return twice / 2;
}

Summary Judge::summarise(const Tile &t) const {
    Summary s;
    for (int side = 0; side < SIDES; side++) {
        const bool upright = side == WEST || side == EAST;
        const std::vector<int> &across = upright ? t.u : t.v, &along = upright ? t.v : t.u;
        const int there = side == WEST || side == SOUTH ? 0 : UNITS;
        for (size_t i = 0; i < t.count(); i++)
            if (across[i] == there)
                s.sides[side].push_back({along[i], upright ? t.lat(i) : t.lon(i), t.height(i),
                                         (uint16_t)(t.normals[2 * i] | t.normals[2 * i + 1] << 8)});
        std::sort(s.sides[side].begin(), s.sides[side].end());
        s.sides[side].erase(std::unique(s.sides[side].begin(), s.sides[side].end()), s.sides[side].end());
        for (size_t i = 0; i < t.triangles.size(); i++) {
            const uint32_t a = t.triangles[i], b = t.triangles[i % 3 == 2 ? i - 2 : i + 1];
            if (across[a] == there && across[b] == there)
                s.segments[side].emplace_back(std::min(along[a], along[b]), std::max(along[a], along[b]));
        }
    }
    for (size_t i = 0; i < t.triangles.size(); i += 3) {
        double x[3], y[3];
        for (size_t k = 0; k < 3; k++)
            x[k] = 2 * t.u[t.triangles[i + k]] - UNITS, y[k] = 2 * t.v[t.triangles[i + k]] - UNITS;
        const double twice = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]);
        s.area += twice / 8;
        for (int q = 0; q < 4; q++) {
            const double fx = q & 1 ? 1 : -1, fy = q & 2 ? 1 : -1;
            if (std::max({fx * x[0], fx * x[1], fx * x[2]}) <= 0 ||
                std::max({fy * y[0], fy * y[1], fy * y[2]}) <= 0)
                continue;
            if (std::min({fx * x[0], fx * x[1], fx * x[2]}) >= 0 &&
                std::min({fy * y[0], fy * y[1], fy * y[2]}) >= 0) {
                s.quarter[q] += twice / 2;
                continue;
            }
            s.quarter[q] +=
                fx * fy * clipped_area({{fx * x[0], fy * y[0]}, {fx * x[1], fy * y[1]}, {fx * x[2], fy * y[2]}});
        }
    }
    const int reach = (int)std::min(1e6, t.error / raster.cell() + 2);
    for (int q = 0; q < 4; q++)
        for (int turn : turns_of(t)) {
            const double west = t.west + (q & 1) * t.side / 2, south = t.south + (q >> 1) * t.side / 2;
            const double c0 = column(west, turn), c1 = column(west + t.side / 2, turn),
                         r0 = row(south + t.side / 2), r1 = row(south);
            s.is_whole[q] =
                s.is_whole[q] || (c0 >= 0 && r0 >= 0 && c1 <= raster.width - 1 && r1 <= raster.height - 1);
            if (c1 < 0 || r1 < 0 || c0 > raster.width - 1 || r0 > raster.height - 1) continue;
            s.has_voids[q] =
                s.has_voids[q] || raster.voids((int)std::max(-1.0, c0) - reach, (int)std::max(-1.0, r0) - reach,
                                               (int)std::min(c1, 1e6) + reach, (int)std::min(r1, 1e6) + reach) > 0;
        }
    return s;
}

/* Is a place of a side on an edge that a tile has there? */
bool is_on(const std::vector<std::pair<int, int>> &segments, int along) {
    return std::any_of(segments.begin(), segments.end(),
                       [&](auto &s) { return s.first <= along && along <= s.second; });
}

void Judge::judge_neighbours(int z) {
    Promise &edges = verdict.of("edges: neighbours have the same vertices and normals on their side");
    Promise &corners = verdict.of("edges: ... and at their corner");
    const int columns = 2 << z;
    for (const auto &[key, mine] : level) {
        const auto name = [&, &k = key] { return ::name_of(z, k.first, k.second); };
        const int east = (key.first + 1) % columns;
        const struct {
            Key key;
            int my_side, its_side;
        } others[2] = {{{east, key.second}, EAST, WEST}, {{key.first, key.second + 1}, NORTH, SOUTH}};
        for (const auto &o : others) {
            const auto found = level.find(o.key);
            if (found == level.end()) continue;
            const auto &a = mine.sides[o.my_side], &b = found->second.sides[o.its_side];
            std::vector<SideVertex> only_a, only_b;
            std::set_difference(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(only_a));
            std::set_difference(b.begin(), b.end(), a.begin(), a.end(), std::back_inserter(only_b));
            bool same = true;
            for (const SideVertex &v : only_a) same = same && !is_on(found->second.segments[o.its_side], v.along);
            for (const SideVertex &v : only_b) same = same && !is_on(mine.segments[o.my_side], v.along);
            if (only_a.empty() && only_b.empty()) /* degrees too, which the order does not look at */
                same = a == b;
            figures.sides++;
            verdict.see(edges, same, [&] {
                return name() + (o.my_side == EAST ? ", east: " : ", north: ") + std::to_string(only_a.size()) +
                       " of its " + std::to_string(a.size()) + " vertices are not the neighbour's, " +
                       std::to_string(only_b.size()) + " of the neighbour's " + std::to_string(b.size()) +
                       " are not there";
            });
        }
        /* The neighbour across the corner; its two sides of the corner may be no tile's. */
        for (int up = -1; up <= 1; up += 2) {
            const auto found = level.find({east, key.second + up});
            if (found == level.end()) continue;
            const auto at_end = [](const std::vector<SideVertex> &side, int end) {
                std::set<double> heights;
                for (const SideVertex &v : side)
                    if (v.along == end) heights.insert(v.height);
                return heights;
            };
            const auto a = at_end(mine.sides[EAST], up > 0 ? UNITS : 0),
                       b = at_end(found->second.sides[WEST], up > 0 ? 0 : UNITS);
            verdict.see(corners, a.empty() || b.empty() || a == b, name);
        }
    }
}

void Judge::judge_children() {
    Promise &area = verdict.of("children: away from voids a quarter of a tile and its child have the same area");
    Promise &none = verdict.of("children: where no child is listed the parent has no ground");
    for (const auto &[key, parent] : above)
        for (int q = 0; q < 4; q++) {
            if (parent.has_voids[q]) continue;
            const auto child = level.find({2 * key.first + (q & 1), 2 * key.second + (q >> 1)});
            const double theirs = child == level.end() ? 0 : child->second.area;
            const double off = std::fabs(parent.quarter[q] - theirs),
                         allowed = parent.is_whole[q] ? 0.5 : 6.0 * UNITS;
            verdict.see(child == level.end() ? none : area, off <= allowed, [&, &k = key] {
                return "parent " + std::to_string(k.first) + "/" + std::to_string(k.second) + ", quarter " +
                       std::to_string(q) + ": " + std::to_string(parent.quarter[q]) + " of " +
                       std::to_string(UNITS) + "^2, the child " + std::to_string(theirs);
            });
        }
}

/* -------------------------------------------------------------------------------------------------- header -- */

void Judge::judge_horizon(const Tile &t, const std::vector<Vec> &places) {
    Promise &hides = verdict.of("header: from where the horizon point is hidden every vertex is");
    Promise &exists = verdict.of(
        "header: tiles of less than 45 degrees have a horizon point, hidden from the other side of the Earth");
    const double far = std::hypot(t.horizon.x, t.horizon.y, t.horizon.z); /* its square may be no double */
    const Vec d = t.horizon * (1 / far), other = std::fabs(d.z) < 0.9 ? Vec{0, 0, 1} : Vec{1, 0, 0};
    Vec side = cross(d, other);
    side = side * (1 / length(side));
    const Vec up = cross(d, side);
    std::vector<Vec> points;
    for (const Vec &p : places) points.push_back(scaled(p));
    if (t.side < 45) verdict.see(exists, client_hides(d * -1.5, t.horizon), [&] { return name_of(t); });
    std::uniform_real_distribution<double> uniform(0, 1);
    const size_t cameras = std::clamp(400000 / points.size(), (size_t)30, (size_t)1000);
    for (size_t i = 0; i < cameras; i++) {
        const double distance = 1 + std::pow(10, -6 + 7.5 * uniform(random));
        const double sinks = std::acos(1 / distance) + (far > 1 ? std::acos(1 / far) : 0),
                     turn = 2 * M_PI * uniform(random);
        const double angle = std::min(M_PI, sinks + std::pow(10, -8 + 7 * uniform(random)));
        const Vec way = side * std::cos(turn) + up * std::sin(turn),
                  camera = (d * std::cos(angle) + way * std::sin(angle)) * distance;
        if (!client_hides(camera, t.horizon)) continue;
        verdict.see(hides,
                    std::all_of(points.begin(), points.end(), [&](const Vec &p) { return is_hidden(camera, p); }),
                    [&] { return name_of(t); });
    }
}

void Judge::judge_header(const Tile &t, const std::vector<Vec> &places) {
    Promise &sphere = verdict.of("header: the sphere holds every vertex, and the middle is in it");
    Promise &lists = verdict.of("header: the lists of sides are the vertices at 0 and 32767");
    Promise &range = verdict.of("header: all tiles have one range of heights, in steps of a power of two");
    Promise &ends = verdict.of("header: the metadata's lowest and highest are those of the vertices");
    Promise &truth = verdict.of("header: what a tile states is no more than what clients take its level to be off");
    double most = length(t.middle - t.centre);
    for (const Vec &p : places) most = std::max(most, length(p - t.centre));
    verdict.see(sphere, most <= t.radius,
                [&] { return name_of(t) + ": " + std::to_string(most - t.radius) + " m beyond it"; });
    for (int side = 0; side < SIDES; side++) {
        const std::vector<int> &across = side == WEST || side == EAST ? t.u : t.v;
        const int there = side == WEST || side == SOUTH ? 0 : UNITS;
        std::vector<uint32_t> mine, theirs = t.edges[(size_t)side];
        for (uint32_t i = 0; i < t.count(); i++)
            if (across[i] == there) mine.push_back(i);
        std::sort(theirs.begin(), theirs.end());
        verdict.see(lists, mine == theirs, [&] { return name_of(t) + ", side " + std::to_string(side); });
    }
    if (std::isnan(low)) low = t.low, high = t.high;
    int exponent;
    verdict.see(range,
                t.low == low && t.high == high && std::frexp(t.step, &exponent) == 0.5 &&
                    (high - low) / UNITS == t.step,
                [&] { return name_of(t); });
    double lowest = HUGE_VAL, highest = -HUGE_VAL;
    for (size_t i = 0; i < t.count(); i++)
        lowest = std::min(lowest, t.height(i)), highest = std::max(highest, t.height(i));
    verdict.see(ends, lowest == t.lowest && highest == t.highest, [&] { return name_of(t); });
    const double level_error = EQUATOR * 2 * M_PI * 0.25 / (65 * 2) / std::ldexp(1, t.z);
    verdict.see(truth,
                t.error <= level_error * (1 + 1e-15) && std::fabs(t.geometric_error / level_error - 1) < 1e-14,
                [&] { return name_of(t) + ": " + std::to_string(t.error); });
    judge_horizon(t, places);
}

void Judge::judge_normals(const Tile &t, int turn) {
    Promise &p = verdict.of("normals: they are the terrain's at full resolution");
    p.unit = " degrees";
    if (t.side / UNITS > 0.2 * std::min(raster.dx, -raster.dy))
        return; /* a vertex might be of either of two samples */
    for (size_t i = 0; i < t.count(); i++) {
        double c = column(t.lon(i), turn), r = row(t.lat(i));
        const bool is_between = t.u[i] == 0 || t.v[i] == 0 || t.u[i] == UNITS || t.v[i] == UNITS;
        if (is_between && t.side / UNITS > 0.02 * std::min(raster.dx, -raster.dy)) continue; /* rounding turns it */
        if (!is_between) c = std::rint(c), r = std::rint(r);
        const int col = (int)std::floor(c), rows = (int)std::floor(r);
        Vec sum, n;
        bool known = true;
        for (int k = 0; k < 4 && known; k++) { /* between samples: the mean of those around by nearness */
            const double weight = (k & 1 ? c - col : 1 - c + col) * (k & 2 ? r - rows : 1 - r + rows);
            if (weight < 1e-3) continue;
            known = raster.normal(col + (k & 1), rows + (k >> 1), n);
            if (known) sum = sum + n * weight;
        }
        if (!known || std::fabs(t.height(i)) > 20000) continue; /* the terrain's are of the ellipsoid's ground */
        const Vec theirs = t.normal(i);
        const double angle = std::atan2(length(cross(sum, theirs)), dot(sum, theirs)) / RADIAN;
        p.worst = std::max(p.worst, angle);
        figures.normal = std::max(figures.normal, angle);
        verdict.see(p, angle < (is_between ? 1.5 : 1), [&] {
            return name_of(t) + ": vertex " + std::to_string(i) + ", " + std::to_string(angle) + " degrees";
        });
    }
}

void Judge::judge_water(const Tile &t) {
    Promise &p = verdict.of("water: the mask is the sea, and there is one iff there is a sea");
    verdict.see(p, t.water.empty() != raster.has_sea,
                [&] { return name_of(t) + ": " + std::to_string(t.water.size()) + " bytes"; });
    const auto turns = turns_of(t);
    for (size_t n = 0; n < 65536 && !t.water.empty(); n++) {
        const double lon = t.west + t.side * ((double)(n % 256) + 0.5) / 256,
                     lat = t.south + t.side * (1 - ((double)(n / 256) + 0.5) / 256);
        const bool is_water = t.water[t.water.size() == 1 ? 0 : n] == 255;
        bool is_sea = false, is_doubtful = false; /* half-way between samples */
        for (int turn : turns) {
            const double c = column(lon, turn), r = row(lat);
            if (c < -1 || r < -1 || c > raster.width || r > raster.height) continue;
            is_sea = is_sea || raster.is_sea((int)std::rint(c), (int)std::rint(r));
            is_doubtful = is_doubtful || std::fabs(c - std::floor(c) - 0.5) < 1e-6 ||
                          std::fabs(r - std::floor(r) - 0.5) < 1e-6;
        }
        verdict.see(p, is_doubtful || is_water == is_sea, [&] {
            return name_of(t) + ": pixel " + std::to_string(n % 256) + "," + std::to_string(n / 256);
        });
    }
}

/* --------------------------------------------------------------------------------------------------- whole -- */

void Judge::judge_tile(const Tile &t) {
    std::vector<Vec> places;
    for (size_t i = 0; i < t.count(); i++) places.push_back(ecef(Angle(t.lon(i)), Angle(t.lat(i)), t.height(i)));
    figures.tiles++;
    figures.vertices += t.count();
    figures.triangles += t.triangles.size() / 3;
    figures.error = std::max(figures.error, t.error);
    for (size_t i = 0; i < t.triangles.size(); i += 3) {
        const uint32_t a = t.triangles[i], b = t.triangles[i + 1], c = t.triangles[i + 2];
        figures.turned +=
            (long)(t.u[b] - t.u[a]) * (t.v[c] - t.v[a]) - (long)(t.u[c] - t.u[a]) * (t.v[b] - t.v[a]) < 0;
    }
    for (int turn : turns_of(t)) judge_samples(t, places, turn);
    for (int turn : turns_of(t)) judge_rim(t, places, turn);
    for (int turn : turns_of(t)) judge_normals(t, turn);
    judge_header(t, places);
    judge_water(t);
    level[{t.x, t.y}] = summarise(t);
}

void Judge::judge_level(int z, const std::vector<Key> &keys) {
    Promise &format = verdict.of("format: every tile is as quantized-mesh 1.0 has it");
    figures = {};
    cover_above.swap(cover);
    cover.assign((size_t)raster.width * (size_t)raster.height, 0);
    above.swap(level);
    level.clear();
    for (const auto &[x, y] : keys) {
        const std::vector<uint8_t> bytes = read_file(folder + "/" + ::name_of(z, x, y) + ".terrain");
        const Decoder decoder(bytes, z, x, y);
        verdict.see(format, decoder.tile.problem.empty(),
                    [&] { return name_of(decoder.tile) + ": " + decoder.tile.problem; });
        if (decoder.tile.problem.empty() && decoder.tile.count() > 0) judge_tile(decoder.tile);
    }
    judge_cover(z);
    judge_neighbours(z);
    judge_children();
    std::printf("| %d | %zu | %zu | %zu | %zu | %zu | %.3f | %.3f | %.4f | %.4f | %zu | %.2f | %zu |\n", z,
                figures.tiles, figures.vertices, figures.triangles, figures.samples, figures.rim, figures.error,
                figures.metres, figures.space, figures.height, figures.sides, figures.normal, figures.turned);
    std::fflush(stdout);
}

/* Tiles of layer.json by level; beside those that are files. */
std::map<int, std::vector<Key>> Judge::read_listed() {
    Promise &listed = verdict.of("listed: what is listed are the files that there are, each once");
    std::map<int, std::vector<Key>> keys;
    std::set<std::string> names;
    const std::vector<uint8_t> text = read_file(folder + "/layer.json");
    cJSON *layer = cJSON_ParseWithLength((const char *)text.data(), text.size());
    const cJSON *all = cJSON_GetObjectItem(layer, "available"), *ranges, *range;
    int z = 0;
    cJSON_ArrayForEach(ranges, all) {
        cJSON_ArrayForEach(range, ranges) {
            const auto number = [&](const char *name) {
                return (int)cJSON_GetNumberValue(cJSON_GetObjectItem(range, name));
            };
            for (int y = number("startY"); y <= number("endY"); y++)
                for (int x = number("startX"); x <= number("endX"); x++) {
                    const std::string name = ::name_of(z, x, y) + ".terrain";
                    verdict.see(listed, names.insert(name).second, [&] { return name + " is listed twice"; });
                    keys[z].emplace_back(x, y);
                }
        }
        z++;
    }
    cJSON_Delete(layer);
    names.insert("layer.json");
    judge_files(verdict, folder, names);
    return keys;
}

bool Judge::run() {
    const auto keys = read_listed();
    std::printf("| level | tiles | vertices | triangles | samples covered | at the outline | states, m | worst in "
                "space, m | of what it states | above or below | sides | normals | turned |\n");
    std::printf("|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|\n");
    for (const auto &[z, list] : keys) judge_level(z, list);
    std::printf("\n");
    Promise &some = verdict.of("listed: there are tiles");
    verdict.see(some, !keys.empty(), [&] { return folder; });
    return verdict.report();
}

} // namespace

bool judge_quantized_mesh(const Raster &raster, const std::string &folder) {
    return Judge(raster, folder).run();
}
