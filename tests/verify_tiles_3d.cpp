/* verify_tiles_3d.cpp - the judge of a folder of 3D Tiles: every tile of every level is decoded as clients do and
 * put beside the raster that it is of, at every sample.
 *
 * A tile is a cell of the lattice: level l divides the smallest square of 2^K + 1 samples a side that holds the
 * raster, whose north-west it shares, into 2^l by 2^l. Its vertices are samples, which are found by where they lie
 * (GeographicLib's inverse); so triangles are drawn among columns and rows in integers.
 *
 * What is looked at:
 *
 *     space     no valid sample under a triangle is further from the tile's triangles in space than the tile's
 *               geometric error
 *     vertices  each is a sample of the tile's cell, but for half a step of positions
 *     turned    triangles are counter-clockwise from above, and have an area
 *     cover     a cell without voids is covered, exactly: and so children cover their parents. With voids: every
 *               sample of the terrain's mesh (a corner of a half cell of the grid with three valid corners) that is
 *               further from voids than the tile's error, on the ground
 *     last      the last level has those half cells and nothing else, and goes through every sample
 *     edges     neighbours have the same places and normals on the side that they share, and at their corner. Where
 *               voids end at the side only one of them may have ground: then no vertex of it lies on an edge of the
 *               other
 *     skirt     what hangs from the sides that neighbours have, as a second surface: upper ends are the ground's
 *               own vertices and normals, lower ones no further down than the content says, and at least twice
 *               what the tile states, in the region
 *     normals   on the last level within a degree of the raster's central differences in space; on the others, of
 *               the mean of the triangles around the vertex by their areas: inside of cells by the tile alone
 *     regions   vertices, the middles of triangles and of their sides, and regions of children lie in them; the
 *               root's, divided again and again, has the vertices of each tile
 *     errors    do not grow from a tile to its children; clients without metadata reckon with no less; a content
 *               tells its tile's
 *     tiles     are the cells that have a part of the raster, in all levels
 *     listed    contents and subtrees that availability tells are the files that there are
 */
#include "verify_tiles_implicit.h"

#include <GeographicLib/Geocentric.hpp>

namespace {

enum Side { WEST, SOUTH, EAST, NORTH, SIDES };

/* A vertex as the sample that it is. */
struct Spot {
    int col = 0, row = 0;
    bool at_pole = false; /* of any column */
    bool at_seam = false; /* of the first column and of the last one */
    Vec geodetic;         /* longitude and latitude in degrees, height */
};
struct Cell {
    int c0 = 0, c1 = 0, r0 = 0, r1 = 0;
    bool holds(int c, int r) const { return c >= c0 && c <= c1 && r >= r0 && r <= r1; }
};
struct SideVertex {
    int along = 0;
    Vec place, normal;
    std::array<double, 7> all() const {
        return {(double)along, place.x, place.y, place.z, normal.x, normal.y, normal.z};
    }
    bool operator<(const SideVertex &o) const { return all() < o.all(); }
    bool operator==(const SideVertex &o) const { return all() == o.all(); }
};
/* What is kept of a tile when it has been looked at. */
struct Summary {
    std::vector<SideVertex> sides[SIDES];
    std::vector<std::pair<int, int>> segments[SIDES]; /* of a side, that triangles have */
};

struct LevelFigures {
    size_t tiles = 0, bare = 0, vertices = 0, triangles = 0, samples = 0, sides = 0, skirts = 0;
    double states = 0, metres = 0, space = 0, normal = 0;
};

/* ------------------------------------------------------------------------------------------------- regions -- */

constexpr double TURN = 2 * M_PI;

/* How far east of a meridian: 0 .. a turn. */
double east_of(double west, double lon) {
    const double by = std::fmod(lon - west, TURN);
    return by < 0 ? by + TURN : by;
}
double width_of(const Region &r) {
    return r[2] >= r[0] ? r[2] - r[0] : r[2] - r[0] + TURN;
}
/* Radians by which a longitude is beyond a region's. */
double beyond(const Region &r, double lon) {
    const double away = east_of(r[0], lon), width = width_of(r);
    return away <= width ? 0 : std::min(away - width, TURN - away);
}
bool holds(const Region &outer, const Region &inner) {
    const double tiny = 1e-12, west = east_of(outer[0] - tiny, inner[0]);
    const bool goes_round = width_of(outer) >= TURN - tiny;
    return (goes_round || west + width_of(inner) <= width_of(outer) + 2 * tiny) && inner[1] >= outer[1] - tiny &&
           inner[3] <= outer[3] + tiny && inner[4] >= outer[4] - 1e-9 && inner[5] <= outer[5] + 1e-9;
}
bool is_on_globe(const Region &r) {
    return std::fabs(r[0]) <= M_PI && std::fabs(r[2]) <= M_PI && r[1] >= -M_PI / 2 && r[1] <= r[3] &&
           r[3] <= M_PI / 2 && r[4] <= r[5];
}

/* --------------------------------------------------------------------------------------------------- judge -- */

class Judge {
  public:
    Judge(const Raster &source, const std::string &tiles) : raster(source), folder(tiles), set(tiles) {
        while (side < std::max(raster.width, raster.height) - 1) side *= 2;
    }
    bool run();

  private:
    const Raster &raster;
    const std::string folder;
    const Tileset set;
    int side = 1;           /* of the root, in samples */
    bool is_square = false; /* the root's region is that; else it reaches beyond the globe */
    Verdict verdict;
    const GeographicLib::Geocentric globe{EQUATOR, FLATTENING};
    std::map<Place, Summary> level;
    std::vector<uint8_t> cover;
    LevelFigures figures;

    void judge_tileset();
    void judge_level(int l);
    void judge_tile(Place p, const ImplicitTile &info);
    std::vector<Spot> find_samples(Place p, const Cell &cell, const Surface &s, double step);
    void judge_samples(Place p, const Cell &cell, const Surface &s, const std::vector<Spot> &spots, double error);
    void judge_poles(Place p, const Cell &cell, const Tree &tree, double error);
    void judge_normals(Place p, const Cell &cell, const Surface &s, const std::vector<Spot> &spots);
    void judge_region(Place p, const Surface &s, const std::vector<Spot> &spots, const Region &region, double step);
    void judge_skirt(Place p, const ImplicitTile &info, const Cell &cell, const Gltf &gltf,
                     const std::vector<Spot> &spots);
    void summarise(Place p, const Cell &cell, const Surface &s, const std::vector<Spot> &spots);
    void judge_cover(int l);
    void judge_neighbours();
    void judge_corner(Place p, Place other, const Summary &mine, int up);

    /* Is a vertex on a side of its cell? */
    static bool is_on_side(const Spot &spot, const Cell &cell, int k) {
        if (k == NORTH || k == SOUTH) return spot.row == (k == NORTH ? cell.r0 : cell.r1);
        return !spot.at_pole && spot.col == (k == WEST ? cell.c0 : cell.c1);
    }
    static std::string name(Place p) { return name_of(p.level, p.x, p.y); }
    Cell cell_of(Place p) const {
        const int wide = side >> p.level, first = ((1 << p.level) - 1 - p.y) * wide;
        return {p.x * wide, std::min(raster.width - 1, (p.x + 1) * wide), first,
                std::min(raster.height - 1, first + wide)};
    }
    Vec reverse(Vec place) const { /* longitude and latitude in degrees, height */
        Vec g;
        globe.Reverse(place.x, place.y, place.z, g.y, g.x, g.z);
        return g;
    }
    /* Half cells of the grid, in a tile's cell, with three valid corners. */
    long half_cells(const Cell &cell) const {
        long count = 0;
        for (int r = cell.r0; r < cell.r1; r++)
            for (int c = cell.c0; c < cell.c1; c++) count += raster.half_cells(c, r);
        return count;
    }
};

void Judge::judge_tileset() {
    Promise &there = verdict.of("tiles: they are the cells that have a part of the raster, in all levels");
    Promise &grow = verdict.of("errors: none is larger than the one above");
    Promise &halved = verdict.of("errors: the root's, halved level by level, is nowhere less than a tile's");
    Promise &nested = verdict.of("regions: they lie in those above, and on the globe");
    Promise &square = verdict.of("regions: the root's in tileset.json is the square of its samples");
    const double south = (raster.y0 + side * raster.dy) * RADIAN, north = raster.y0 * RADIAN;
    is_square = side * raster.dx <= 360 && south >= -M_PI / 2 && north <= M_PI / 2;
    const double off =
        std::max({std::fabs(std::sin(set.root[0] - raster.x0 * RADIAN)), std::fabs(set.root[1] - south),
                  std::fabs(width_of(set.root) - side * raster.dx * RADIAN), std::fabs(set.root[3] - north)});
    if (is_square) verdict.see(square, off < 1e-9, [&] { return "it is " + std::to_string(off) + " radians off"; });
    size_t cells = 0;
    for (int l = 0; l < set.levels; l++) {
        const size_t wide = (size_t)(side >> l);
        cells += ((size_t)(raster.width - 2) / wide + 1) * ((size_t)(raster.height - 2) / wide + 1);
    }
    verdict.see(there, cells == set.tiles.size(), [&] {
        return std::to_string(set.tiles.size()) + " tiles, and " + std::to_string(cells) + " cells";
    });
    for (const auto &[p, tile] : set.tiles) {
        const auto where = [&, &q = p] { return name(q); };
        const Cell cell = cell_of(p);
        verdict.see(there, cell.c0 < cell.c1 && cell.r0 < cell.r1, where);
        verdict.see(halved, tile.error <= std::ldexp(set.root_error, -p.level), where);
        verdict.see(nested, is_on_globe(tile.region), where);
        if (p.level == 0) {
            verdict.see(nested, is_on_globe(set.root), where);
            verdict.see(grow, tile.error <= set.root_error && set.root_error <= set.error, where);
            continue;
        }
        const ImplicitTile &above = set.tiles.at({p.level - 1, p.x / 2, p.y / 2});
        verdict.see(nested, holds(above.region, tile.region), where);
        verdict.see(grow, tile.error <= above.error, where);
    }
}

/* ------------------------------------------------------------------------------------------------- samples -- */

std::vector<Spot> Judge::find_samples(Place p, const Cell &cell, const Surface &s, double step) {
    Promise &vertices = verdict.of("vertices: each is a sample of its cell, within half a step");
    const double turn = 360 / raster.dx, middle = (cell.c0 + cell.c1) / 2.0,
                 off = step / 2 + raster.rounding + 2e-6;
    std::vector<Spot> spots;
    for (const Vec &v : s.places) {
        const Vec g = reverse(v);
        Spot spot;
        spot.geodetic = g;
        double col = (g.x - raster.x0) / raster.dx;
        col += turn * std::rint((middle - col) / turn);
        spot.at_pole = std::hypot(v.x, v.y) < 1;
        spot.at_seam =
            cell.c1 - cell.c0 > turn - 0.1 && std::min(std::fabs(col - cell.c0), std::fabs(col - cell.c1)) < 0.1;
        spot.col = spot.at_pole ? cell.c0 : (int)std::rint(col);
        spot.row = (int)std::rint((g.y - raster.y0) / raster.dy);
        if (spot.at_seam) { /* the end that has this height */
            const auto off_of = [&](int c) {
                return cell.holds(c, spot.row) && raster.is_valid(c, spot.row)
                           ? length(v - raster.place(c, spot.row))
                           : HUGE_VAL;
            };
            spot.col = off_of(cell.c0) <= off_of(cell.c1) ? cell.c0 : cell.c1;
        }
        const bool is_there = cell.holds(spot.col, spot.row) && raster.is_valid(spot.col, spot.row);
        const Vec d = is_there ? v - raster.place(spot.col, spot.row) : Vec{};
        verdict.see(vertices, is_there && std::max({std::fabs(d.x), std::fabs(d.y), std::fabs(d.z)}) <= off, [&] {
            return name(p) + ": vertex " + std::to_string(spots.size()) + " at column " + std::to_string(col) +
                   ", row " + std::to_string(spot.row) +
                   (is_there ? " is off by " + std::to_string(length(d)) + " m" : "");
        });
        if (!is_there) return {};
        spots.push_back(spot);
    }
    return spots;
}

void Judge::judge_samples(Place p, const Cell &cell, const Surface &s, const std::vector<Spot> &spots,
                          double error) {
    Promise &space = verdict.of("space: no sample is further from a tile in space than it states");
    Promise &turned = verdict.of("turned: triangles are counter-clockwise from above, none without an area");
    Promise &covered =
        verdict.of("cover: cells without voids are covered exactly, and so children cover their parents");
    Promise &last = verdict.of("last: it is the half cells of the grid with three valid corners, in every cell");
    Promise &through = verdict.of("last: it goes through every sample of theirs");
    std::unique_ptr<Tree> made; /* when a sample may be nearer to another triangle than to the one above it */
    const auto tree = [&]() -> const Tree & {
        if (!made) made = std::make_unique<Tree>(s.places, s.triangles);
        return *made;
    };
    const bool is_last = p.level == set.levels - 1;
    const int turn = (int)std::rint(360 / raster.dx);
    bool has_pole = false;
    long twice = 0;
    for (size_t i = 0; i < s.triangles.size(); i += 3) {
        const uint32_t corner[3] = {s.triangles[i], s.triangles[i + 1], s.triangles[i + 2]};
        const Spot *spot[3] = {&spots[corner[0]], &spots[corner[1]], &spots[corner[2]]};
        if (spot[0]->at_pole || spot[1]->at_pole || spot[2]->at_pole) {
            has_pole = true;
            continue;
        }
        long col[3];
        for (int k = 0; k < 3; k++) { /* at the end of a cell that goes round that is nearer to another corner */
            col[k] = spot[k]->col;
            for (const Spot *other : spot)
                if (spot[k]->at_seam && !other->at_seam)
                    col[k] += turn * std::lrint((double)(other->col - col[k]) / turn);
        }
        const long ac = col[0], ar = spot[0]->row, bc = col[1], br = spot[1]->row, cc = col[2], cr = spot[2]->row;
        const long area = (cc - ac) * (br - ar) - (bc - ac) * (cr - ar);
        verdict.see(turned, area > 0, [&] { return name(p) + ": triangle " + std::to_string(i / 3); });
        if (area <= 0) continue;
        twice += area;
        const Vec a = s.places[corner[0]], b = s.places[corner[1]], c = s.places[corner[2]];
        const double h[3] = {raster.source(raster.index((int)ac, (int)ar)),
                             raster.source(raster.index((int)bc, (int)br)),
                             raster.source(raster.index((int)cc, (int)cr))};
        for (long r = std::min({ar, br, cr}); r <= std::max({ar, br, cr}); r++)
            for (long k = std::min({ac, bc, cc}); k <= std::max({ac, bc, cc}); k++) {
                const long nb = (cc - ac) * (r - ar) - (k - ac) * (cr - ar),
                           nc = (k - ac) * (br - ar) - (bc - ac) * (r - ar);
                if (nb < 0 || nc < 0 || nb + nc > area) continue;
                const size_t sample = raster.index((int)k, (int)r);
                cover[sample] = 1;
                if (!raster.is_valid((int)k, (int)r)) continue;
                const Vec q = raster.place((int)k, (int)r);
                double d = length(q - nearest_of_triangle(q, a, b, c));
                if (d > figures.space * error) d = tree().distance(q);
                const double share = d / error;
                if (share > figures.space) figures.space = share, figures.metres = d;
                const auto where = [&] {
                    return name(p) + ": sample " + std::to_string(k) + "," + std::to_string(r);
                };
                verdict.see(space, share <= 1, [&] {
                    return where() + " is " + std::to_string(d) + " m off, and it states " + std::to_string(error);
                });
                if (!is_last) continue;
                const double wb = (double)nb / (double)area, wc = (double)nc / (double)area;
                const double above = (1 - wb - wc) * h[0] + wb * h[1] + wc * h[2] - raster.source(sample);
                verdict.see(through, std::fabs(above) <= 1e-6 + 2 * raster.rounding,
                            [&] { return where() + " is " + std::to_string(above) + " m below"; });
            }
    }
    space.worst = std::max(space.worst, figures.space);
    if (has_pole) return judge_poles(p, cell, tree(), error);
    const auto areas = [&] {
        return name(p) + " has an area of " + std::to_string(twice) + " half cells of the grid";
    };
    if (raster.voids(cell.c0, cell.r0, cell.c1, cell.r1) == 0)
        verdict.see(covered, twice == 2L * (cell.c1 - cell.c0) * (cell.r1 - cell.r0), areas);
    if (is_last) verdict.see(last, twice == half_cells(cell), areas);
}

/* All columns have one place at a pole: so what samples lie under the triangles there is not known. */
void Judge::judge_poles(Place p, const Cell &cell, const Tree &tree, double error) {
    Promise &space = verdict.of("space: no sample is further from a tile in space than it states");
    for (int r = cell.r0; r <= cell.r1; r++)
        for (int c = cell.c0; c <= cell.c1; c++) {
            const size_t s = raster.index(c, r);
            if (cover[s] || !raster.must_be_covered(s, error)) continue;
            const double share = tree.distance(raster.place(c, r)) / error;
            cover[s] = 1;
            space.worst = std::max(space.worst, share);
            if (share > figures.space) figures.space = share, figures.metres = share * error;
            verdict.see(space, share <= 1, [&] {
                return name(p) + ": sample " + std::to_string(c) + "," + std::to_string(r) + " by the pole is " +
                       std::to_string(share) + " of what it states off";
            });
        }
}

void Judge::judge_cover(int l) {
    Promise &covered = verdict.of("cover: every sample of the terrain's mesh, but near voids");
    Promise &last = verdict.of("last: it is the half cells of the grid with three valid corners, in every cell");
    for (auto tile = set.tiles.lower_bound({l, 0, 0}); tile != set.tiles.end() && tile->first.level == l; ++tile) {
        const Cell cell = cell_of(tile->first);
        for (int r = cell.r0; r <= cell.r1; r++)
            for (int c = cell.c0; c <= cell.c1; c++) {
                const size_t s = raster.index(c, r);
                const auto where = [&] {
                    return name(tile->first) + ": sample " + std::to_string(c) + "," + std::to_string(r);
                };
                if (raster.must_be_covered(s, tile->second.error)) verdict.see(covered, cover[s] != 0, where);
                if (l == set.levels - 1) verdict.see(last, cover[s] == raster.is_promised(s), where);
            }
    }
    for (const uint8_t is_covered : cover) figures.samples += is_covered;
}

void Judge::judge_normals(Place p, const Cell &cell, const Surface &s, const std::vector<Spot> &spots) {
    Promise &normals = verdict.of("normals: they are the terrain's at full resolution, or of the triangles around");
    normals.unit = " degrees";
    const bool is_last = p.level == set.levels - 1;
    std::vector<Vec> stars(spots.size());
    for (size_t i = 0; i < s.triangles.size(); i += 3) {
        const uint32_t *corner = &s.triangles[i];
        const Vec a = s.places[corner[0]], b = s.places[corner[1]], c = s.places[corner[2]];
        for (int k = 0; k < 3; k++) stars[corner[k]] = stars[corner[k]] + cross(b - a, c - a);
    }
    for (size_t i = 0; i < spots.size(); i++) {
        Vec n = stars[i];
        bool is_inside = true;
        for (int k = 0; k < SIDES; k++) is_inside = is_inside && !is_on_side(spots[i], cell, k);
        if (spots[i].at_pole || !(is_last ? raster.normal(spots[i].col, spots[i].row, n) : is_inside)) continue;
        const double angle = std::atan2(length(cross(n, s.normals[i])), dot(n, s.normals[i])) / RADIAN;
        figures.normal = std::max(figures.normal, angle);
        verdict.see(normals, angle < 1, [&] {
            return name(p) + ": column " + std::to_string(spots[i].col) + ", row " + std::to_string(spots[i].row) +
                   ", " + std::to_string(angle) + " degrees";
        });
    }
    normals.worst = std::max(normals.worst, figures.normal);
}

/* Metres by which a triangle with such a side, which is flat in space, leaves the box of its corners, at most:
 * downward, and towards the pole. */
double bulge(Vec a, Vec b, Vec c, double lat) {
    const double longest = std::max({dot(a - b, a - b), dot(b - c, b - c), dot(c - a, c - a)});
    return std::fabs(lat) < 80 ? longest / (8 * 6.3e6) * 7 : HUGE_VAL; /* tan 81 degrees is 6.3 */
}

void Judge::judge_region(Place p, const Surface &s, const std::vector<Spot> &spots, const Region &region,
                         double step) {
    Promise &inside = verdict.of("regions: tiles lie in them, chords and all");
    Promise &divided = verdict.of("regions: the root's, divided as clients without metadata do, has all vertices");
    /* How far inside, in metres: of longitude, and of latitude and height. */
    const auto look = [&](Vec v, Vec g) {
        const double flat = std::hypot(v.x, v.y), beside = flat > 1 ? beyond(region, g.x * RADIAN) * flat : 0;
        const double lat = g.y * RADIAN, within = std::min({(lat - region[1]) * POLE, (region[3] - lat) * POLE,
                                                            g.z - region[4], region[5] - g.z});
        verdict.see(inside, beside <= step && within >= -1e-6, [&] {
            return name(p) + ": " + std::to_string(g.x) + ", " + std::to_string(g.y) + ", " + std::to_string(g.z) +
                   " m";
        });
        return within;
    };
    std::vector<double> within;
    for (size_t i = 0; i < spots.size(); i++) {
        const Vec g = spots[i].geodetic;
        within.push_back(look(s.places[i], g));
        if (!is_square) continue;
        const double width = width_of(set.root) / (1 << p.level),
                     height = (set.root[3] - set.root[1]) / (1 << p.level), off = step / POLE + 1e-9,
                     aside = off / std::max(std::cos(g.y * RADIAN), 1e-9),
                     east = east_of(set.root[0] + p.x * width - aside, g.x * RADIAN),
                     north = g.y * RADIAN - (set.root[1] + p.y * height);
        verdict.see(divided,
                    (spots[i].at_pole || east <= width + 2 * aside) && north >= -off && north <= height + off &&
                        g.z >= set.root[4] && g.z <= set.root[5],
                    [&] {
                        return name(p) + ": column " + std::to_string(spots[i].col) + ", row " +
                               std::to_string(spots[i].row);
                    });
    }
    for (size_t i = 0; i < s.triangles.size(); i += 3) {
        const uint32_t *corner = &s.triangles[i];
        const Vec a = s.places[corner[0]], b = s.places[corner[1]], c = s.places[corner[2]];
        if (bulge(a, b, c, spots[corner[0]].geodetic.y) <
            std::min({within[corner[0]], within[corner[1]], within[corner[2]]}))
            continue;
        for (const Vec &v : {(a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5, (a + b + c) * (1.0 / 3)})
            look(v, reverse(v));
    }
}

/* -------------------------------------------------------------------------------------------------- sides -- */

void Judge::summarise(Place p, const Cell &cell, const Surface &s, const std::vector<Spot> &spots) {
    Summary &summary = level[p];
    for (int k = 0; k < SIDES; k++) {
        const bool upright = k == WEST || k == EAST;
        const auto along = [&](uint32_t v) { return upright ? spots[v].row : spots[v].col; };
        const auto is_there = [&](uint32_t v) { return is_on_side(spots[v], cell, k); };
        for (uint32_t v = 0; v < spots.size(); v++)
            if (is_there(v)) summary.sides[k].push_back({along(v), s.places[v], s.normals[v]});
        std::sort(summary.sides[k].begin(), summary.sides[k].end());
        for (size_t i = 0; i < s.triangles.size(); i++) {
            const uint32_t a = s.triangles[i], b = s.triangles[i % 3 == 2 ? i - 2 : i + 1];
            if (is_there(a) && is_there(b))
                summary.segments[k].emplace_back(std::min(along(a), along(b)), std::max(along(a), along(b)));
        }
    }
}

/* Is a place of a side on an edge that a tile has there? */
bool is_on(const std::vector<std::pair<int, int>> &segments, int along) {
    return std::any_of(segments.begin(), segments.end(),
                       [&](auto &s) { return s.first <= along && along <= s.second; });
}

void Judge::judge_corner(Place p, Place other, const Summary &mine, int up) {
    Promise &corners = verdict.of("edges: ... and at their corner");
    const auto found = level.find(other);
    if (found == level.end()) return;
    const Cell cell = cell_of(p);
    const int row = up > 0 ? cell.r0 : cell.r1;
    const auto at = [&](const std::vector<SideVertex> &all) {
        std::vector<SideVertex> there;
        for (const SideVertex &v : all)
            if (v.along == row) there.push_back(v);
        return there;
    };
    const auto a = at(mine.sides[EAST]), b = at(found->second.sides[WEST]);
    verdict.see(corners, a.empty() || b.empty() || a == b, [&] { return name(p); });
}

void Judge::judge_neighbours() {
    Promise &edges = verdict.of("edges: neighbours have the same places and normals on their side");
    for (const auto &[p, mine] : level) {
        const struct {
            Place place;
            int my_side, its_side;
        } others[2] = {{{p.level, p.x + 1, p.y}, EAST, WEST}, {{p.level, p.x, p.y + 1}, NORTH, SOUTH}};
        for (const auto &o : others) {
            const auto found = level.find(o.place);
            if (found == level.end()) continue;
            const auto &a = mine.sides[o.my_side], &b = found->second.sides[o.its_side];
            std::vector<SideVertex> only_a, only_b;
            std::set_difference(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(only_a));
            std::set_difference(b.begin(), b.end(), a.begin(), a.end(), std::back_inserter(only_b));
            bool same = true;
            for (const SideVertex &v : only_a) same = same && !is_on(found->second.segments[o.its_side], v.along);
            for (const SideVertex &v : only_b) same = same && !is_on(mine.segments[o.my_side], v.along);
            figures.sides++;
            verdict.see(edges, same, [&, &q = p] {
                return name(q) + (o.my_side == EAST ? ", east: " : ", north: ") + std::to_string(only_a.size()) +
                       " of its " + std::to_string(a.size()) + " vertices are not the neighbour's, " +
                       std::to_string(only_b.size()) + " of the neighbour's " + std::to_string(b.size()) +
                       " are not there";
            });
        }
        for (int up = -1; up <= 1; up += 2) judge_corner(p, {p.level, p.x + 1, p.y + up}, mine, up);
    }
}

/* Vertices come in pairs: one of the ground, and the one below. */
void Judge::judge_skirt(Place p, const ImplicitTile &info, const Cell &cell, const Gltf &gltf,
                        const std::vector<Spot> &spots) {
    Promise &hangs = verdict.of("skirt: it hangs from the ground's sides, as far as it says");
    Promise &all = verdict.of("skirt: all edges of sides that neighbours have");
    const Surface &ground = gltf.surfaces[0], &skirt = gltf.surfaces[1];
    const double round = gltf.step * 1.8; /* two ends, half a diagonal each */
    std::map<std::array<double, 6>, uint32_t> tops;
    std::vector<uint32_t> top_of;
    std::set<std::pair<uint32_t, uint32_t>> edges;
    const auto key_of = [](const Surface &s, uint32_t i) {
        const Vec a = s.places[i], n = s.normals[i];
        return std::array<double, 6>{a.x, a.y, a.z, n.x, n.y, n.z};
    };
    for (uint32_t i = 0; i < spots.size(); i++)
        for (int k = 0; k < SIDES; k++)
            if (is_on_side(spots[i], cell, k)) tops[key_of(ground, i)] = i;
    for (uint32_t i = 0; i < skirt.places.size(); i++) {
        const auto found = tops.find(key_of(skirt, i - i % 2));
        const bool is_there = found != tops.end() && skirt.places.size() % 2 == 0;
        const auto where = [&] { return name(p) + ": vertex " + std::to_string(i) + " of the skirt"; };
        verdict.see(hangs, is_there, where);
        if (!is_there) return;
        top_of.push_back(found->second);
        if (i % 2 == 0) continue;
        const Vec at = reverse(skirt.places[i]), above = spots[found->second].geodetic;
        const Angle lon(above.x), lat(above.y);
        const Vec up = {lat.cosine * lon.cosine, lat.cosine * lon.sine, lat.sine},
                  d = skirt.places[i - 1] - skirt.places[i];
        const double down = dot(d, up), aside = length(d - up * down);
        verdict.see(hangs,
                    down <= skirt.skirt + round && down >= std::min(2 * info.error, POLE / 2) - round &&
                        aside <= down + round && at.z >= info.region[4] && at.y * RADIAN >= info.region[1] &&
                        at.y * RADIAN <= info.region[3],
                    [&] {
                        return where() + " is " + std::to_string(down) + " m down, it says " +
                               std::to_string(skirt.skirt);
                    });
    }
    for (size_t i = 0; i < skirt.triangles.size(); i++) {
        const uint32_t a = skirt.triangles[i], b = skirt.triangles[i % 3 == 2 ? i - 2 : i + 1];
        if (a % 2 == 0 && b % 2 == 0) edges.insert(std::minmax(top_of[a], top_of[b]));
    }
    const Place beside[SIDES] = {
        {p.level, p.x - 1, p.y}, {p.level, p.x, p.y - 1}, {p.level, p.x + 1, p.y}, {p.level, p.x, p.y + 1}};
    for (int k = 0; k < SIDES; k++) {
        if (set.tiles.count(beside[k]) == 0) continue;
        for (size_t i = 0; i < ground.triangles.size(); i++) {
            const uint32_t a = ground.triangles[i], b = ground.triangles[i % 3 == 2 ? i - 2 : i + 1];
            if (is_on_side(spots[a], cell, k) && is_on_side(spots[b], cell, k))
                verdict.see(all, edges.count(std::minmax(a, b)) == 1,
                            [&] { return name(p) + ", side " + std::to_string(k); });
        }
    }
}

/* --------------------------------------------------------------------------------------------------- whole -- */

void Judge::judge_tile(Place p, const ImplicitTile &info) {
    Promise &format = verdict.of("format: every content is as glTF 2.0 has it, of one surface and its skirt");
    Promise &told = verdict.of("errors: a content tells its tile's, and its level");
    const Gltf gltf(read_file(folder + "/" + set.content(p)));
    const std::vector<Surface> &all = gltf.surfaces;
    const bool is_ground = !all.empty() && std::isnan(all[0].skirt),
               has_skirt = all.size() == 2 && all[1].skirt > 0;
    verdict.see(format, gltf.problem.empty() && is_ground && (all.size() == 1 || has_skirt),
                [&] { return name(p) + ": " + gltf.problem; });
    if (!gltf.problem.empty()) return;
    verdict.see(told, gltf.error == info.error && gltf.level == p.level, [&] {
        return name(p) + ": " + std::to_string(gltf.error) + ", level " + std::to_string(gltf.level);
    });
    const Surface &s = all[0];
    const Cell cell = cell_of(p);
    figures.vertices += s.places.size();
    figures.triangles += s.triangles.size() / 3;
    const std::vector<Spot> spots = find_samples(p, cell, s, gltf.step);
    if (spots.empty()) return;
    judge_samples(p, cell, s, spots, info.error);
    judge_normals(p, cell, s, spots);
    judge_region(p, s, spots, info.region, gltf.step);
    summarise(p, cell, s, spots);
    if (has_skirt) judge_skirt(p, info, cell, gltf, spots);
    figures.skirts += has_skirt;
}

void Judge::judge_level(int l) {
    figures = {};
    level.clear();
    cover.assign((size_t)raster.width * (size_t)raster.height, 0);
    for (auto tile = set.tiles.lower_bound({l, 0, 0}); tile != set.tiles.end() && tile->first.level == l; ++tile) {
        figures.tiles++;
        figures.bare += !tile->second.has_content;
        figures.states = std::max(figures.states, tile->second.error);
        if (tile->second.has_content) judge_tile(tile->first, tile->second);
    }
    judge_cover(l);
    judge_neighbours();
    std::printf("| %d | %zu | %zu | %zu | %zu | %zu | %.3f | %.3f | %.4f | %zu | %zu | %.2f |\n", l, figures.tiles,
                figures.bare, figures.vertices, figures.triangles, figures.samples, figures.states, figures.metres,
                figures.space, figures.sides, figures.skirts, figures.normal);
    std::fflush(stdout);
}

bool Judge::run() {
    Promise &format = verdict.of("format: tileset.json and subtrees are as 3D Tiles 1.1 has them");
    verdict.see(format, set.problem.empty(), [&] { return set.problem; });
    judge_files(verdict, folder, set.names);
    if (!set.problem.empty()) return verdict.report();
    judge_tileset();
    std::printf(
        "| level | tiles | without content | vertices | triangles | samples covered | states at most, m | worst in "
        "space, m | of what it states | sides | skirts | normals |\n");
    std::printf("|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|\n");
    for (int l = 0; l < set.levels; l++) judge_level(l);
    std::printf("\n");
    return verdict.report();
}

} // namespace

bool judge_3d_tiles(const Raster &raster, const std::string &folder) {
    return Judge(raster, folder).run();
}
