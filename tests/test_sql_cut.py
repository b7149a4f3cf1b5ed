#!/usr/bin/python3
"""Modes snap and cut, outline tol, and regions in another SRID, through SQL.

Areas of polygons are computed here as fractions, squares and promises by looking at every one of them.
"""
import os
import random
import sqlite3
from collections import Counter
from fractions import Fraction

import sql_support as s
from sql_support import check, equal, one, raises, rows, triangles

SEED = int(os.environ.get("RQT_SEED", "20260711"), 0)
print("RQT_SEED=%d" % SEED)
dice = random.Random(SEED)
CUT, SNAP, TOL = '{"mode":"cut"}', '{"mode":"snap"}', '{"outline":"tol"}'
PROOF = "SELECT max_error <= ?2, t_junctions, overlaps, uncovered FROM rqt_verify(?1, ?2, NULL, ?3)"


def attempt(sql, *arguments):
    """Rows, or the sentence of an error."""
    try:
        return rows(db, sql, *arguments)
    except sqlite3.Error as error:
        return str(error)


# ------------------------------------------------------------------------------------------------------ even-odd areas

def union_area(members):
    """Exact area of a union of polygons, each a list of rings, each by the even-odd rule; coordinates are integers."""
    edges = [(a, b, m) for m, rings in enumerate(members) for ring in rings for a, b in zip(ring, ring[1:] + ring[:1])]
    cuts = {Fraction(p[1]) for a, b, _ in edges for p in (a, b)}
    for i, (a, b, _) in enumerate(edges):
        for c, d, _ in edges[:i]:
            below = (b[0] - a[0]) * (d[1] - c[1]) - (b[1] - a[1]) * (d[0] - c[0])
            if below:
                share = Fraction((c[0] - a[0]) * (d[1] - c[1]) - (c[1] - a[1]) * (d[0] - c[0]), below)
                if 0 <= share <= 1:
                    cuts.add(a[1] + share * (b[1] - a[1]))
    cuts = sorted(cuts)
    area = Fraction(0)
    for low, high in zip(cuts, cuts[1:]):
        y, spans = (low + high) / 2, []
        for m in range(len(members)):
            at = sorted(a[0] + Fraction(b[0] - a[0]) * (y - a[1]) / (b[1] - a[1])
                        for a, b, of in edges if of == m and (a[1] < y) != (b[1] < y))
            spans += list(zip(at[::2], at[1::2]))
        end = None
        for x0, x1 in sorted(spans):
            x0 = x0 if end is None else max(x0, end)
            if x1 > x0:
                area += (x1 - x0) * (high - low)
                end = x1
    return area


UNITS = 64  # regions lie on multiples of 1/64 of a sample


def multipolygon(members):
    def ring(r):
        return "(%s)" % ", ".join("%r %r" % (x / UNITS, y / UNITS) for x, y in r + r[:1])
    return "MULTIPOLYGON(%s)" % ", ".join("(%s)" % ", ".join(map(ring, m)) for m in members)


def random_members(width, height):
    """Rings of any order; squares with a hole that may stick out; triangles over one another."""
    grid = dice.choice((1, 16, 64))
    def place():
        return (dice.randrange(UNITS * width // grid) * grid, -dice.randrange(UNITS * height // grid) * grid)
    def ring():
        if dice.random() < 0.4:
            (x0, y0), (x1, y1) = place(), place()
            if x0 != x1 and y0 != y1:
                r = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
                return r if dice.random() < 0.5 else r[::-1]
        return [place() for _ in range(dice.randrange(3, 7))]
    while True:
        members = [[ring() for _ in range(dice.choice((1, 1, 2)))] for _ in range(dice.choice((1, 2, 3)))]
        if all(union_area([[m[0]]]) > 0 for m in members):
            return members


# ------------------------------------------------------------------------------------------------------------ mode cut
width, height = 61, 43
path = s.temp("rough.gpkg")
s.import_terrain(path, s.write_grid(s.temp("rough.asc"), s.rough_grid(width, height, 3)), name="rough", block=3)
db = s.connect(path)
wrong, apart = [], []
for n in range(60):
    members = random_members(width - 1, height - 1)
    text, eps = multipolygon(members), dice.choice((0, 3, 12, 60, float("inf")))
    proof = rows(db, PROOF, text, eps, CUT)[0]
    area, mesh = one(db, "SELECT area FROM rqt_verify(?, ?, NULL, ?)", text, eps, CUT), triangles(db, text, eps, None, CUT)
    wanted = float(union_area(members)) / UNITS ** 2
    if proof != (1, 0, 0, 0) or abs(area - wanted) > 1e-9:
        wrong.append((text, eps, proof, area, wanted))
    if n % 6 == 0:
        as_sets = [Counter(map(s.rotated, t)) for t in (
            mesh, s.obj_triangles(one(db, "SELECT rqt_mesh(?, ?, 'obj', NULL, ?)", text, eps, CUT)),
            s.ply_triangles(one(db, "SELECT rqt_mesh(?, ?, 'ply', NULL, ?)", text, eps, CUT)),
            s.wkb_triangles(one(db, "SELECT rqt_mesh(?, ?, 'wkb', NULL, ?)", text, eps, CUT)),
            s.gpkg_triangles(one(db, "SELECT rqt_mesh(?, ?, 'gpkg', NULL, ?)", text, eps, CUT))[3],
            s.spatialite_triangles(one(db, "SELECT rqt_mesh(?, ?, 'spatialite', NULL, ?)", text, eps, CUT))[2],
            s.strip_triangles(rows(db, "SELECT x, y, z FROM rqt_strip(?, ?, NULL, ?)", text, eps, CUT)))]
        points = rows(db, "SELECT x, y, z FROM rqt_range(?, ?, NULL, ?)", text, eps, CUT)
        if any(a != as_sets[0] for a in as_sets) or Counter(points) != Counter({p for t in mesh for p in t}):
            apart.append((text, eps))
equal("F26_polygons_are_cut_to_their_area: proof and exact area of 60 multipolygons", wrong[:2], [])
equal("mode cut: rows, strip, obj, ply, wkb, gpkg and spatialite hold the same triangles, rqt_range their corners", apart, [])

hole = "POLYGON((2 -2, 40 -2, 40 -30, 2 -30, 2 -2), (1 -1, 41 -1, 41 -31, 1 -31, 1 -1))"
outer = one(db, "SELECT area FROM rqt_verify(?, 12, NULL, ?)", hole, CUT)
equal("F26_hole_larger_than_its_shell: by even-odd the rim between them is left", outer, 40 * 30 - 38 * 28.0)
equal("F26_hole_covering_all: nothing is left",
      rows(db, "SELECT * FROM rqt_range('POLYGON((2 -2, 9 -2, 9 -9, 2 -2), (2 -2, 9 -2, 9 -9, 2 -2))', 12, NULL, ?)", CUT), [])
cover, cut = (set(map(s.rotated, triangles(db, "POLYGON((8 -8, 24 -8, 24 -24, 8 -24, 8 -8))", 0, None, o))) for o in (None, CUT))
equal("mode cut along sample lines at eps 0 is cover", cut, cover)
equal("mode cut of everything is everything", triangles(db, None, 12, None, CUT), triangles(db, None, 12))
for thin in ("POINT(20.3 -11.2)", "LINESTRING(1 -1, 50.5 -33.25)"):
    equal("mode cut of a %s is its cover" % thin.split("(")[0].lower(), set(map(s.rotated, triangles(db, thin, 12, None, CUT))),
          set(map(s.rotated, triangles(db, thin, 12))))
left, right = "POLYGON((3.3 -3, 20 -3, 27.7 -30.1, 3.3 -30, 3.3 -3))", "POLYGON((20 -3, 50 -4, 50 -31, 27.7 -30.1, 20 -3))"
def border(region):
    """Vertices on the common border, in samples."""
    found = set()
    for x, y, z in rows(db, "SELECT x, y, z FROM rqt_range(?, 12, NULL, ?)", region, CUT):
        if abs((27.7 - 20) * (y + 3) - (-30.1 + 3) * (x - 20)) < 1e-4:  # regions are rounded to 2^-20 sample
            found.add((x, y, z))
    return found
check("mode cut: neighbours that share a border share its vertices, heights included", border(left) == border(right) and
      len(border(left)) > 10, (len(border(left)), len(border(right)), sorted(border(left) ^ border(right))[:4]))
equal("mode cut outside the terrain is empty", triangles(db, "POLYGON((-9 9, -5 9, -5 5, -9 9))", 1, None, CUT), [])
equal("mode cut: a vertex between samples has no level, error 0, and places that are not whole",
      rows(db, "SELECT count(*) > 0, max(error), count(col) = count(*), max(typeof(q)) FROM rqt_range(?, 12, NULL, ?) WHERE level IS NULL",
           left, CUT), [(1, 0.0, 1, "real")])
db.close()

# voids, odd extents, blocks of every size: the mesh of one region is the same
for w, h, voids in ((50, 70, 60), (18, 2, 0), (7, 65, 100)):
    grid = s.rough_grid(w, h, 5, voids)
    text = multipolygon(random_members(w - 1, h - 1))
    seen = []
    for k in (1, 3, 6):
        path = s.temp("cut_%d_%d.gpkg" % (w, k))
        s.import_terrain(path, s.write_grid(s.temp("cut.asc"), grid), name="cut", block=k)
        db = s.connect(path)
        for eps in (0, 5, 40):
            equal("F26_cut_with_voids: %d x %d, blocks of 2^%d, eps %g: proof" % (w, h, k, eps), rows(db, PROOF, text, eps, CUT), [(1, 0, 0, 0)])
            seen.append((eps, frozenset(map(s.rotated, triangles(db, text, eps, None, CUT)))))
        db.close()
    equal("%d x %d: the cut does not depend on the blocks" % (w, h), len(set(seen)), 3)

# ----------------------------------------------------------------------------------------------------------- mode snap

def separated(a, b, axis, touching):
    pa, pb = [p[0] * axis[0] + p[1] * axis[1] for p in a], [p[0] * axis[0] + p[1] * axis[1] for p in b]
    return (max(pa) < min(pb) or max(pb) < min(pa)) if touching else (max(pa) <= min(pb) or max(pb) <= min(pa))


def meets(a, b, touching=False):
    """Interiors of convex shapes meet; touching: the closed ones do."""
    axes = [(1, 0), (0, 1)]
    for p in (a, b):
        axes += [(p[i - 1][1] - p[i][1], p[i][0] - p[i - 1][0]) for i in range(len(p)) if p[i - 1] != p[i]]
    return not any(separated(a, b, axis, touching) for axis in axes)


path = s.temp("snap.gpkg")
s.import_terrain(path, s.write_grid(s.temp("snap.asc"), s.rough_grid(75, 60, 8, 10)), name="snap", block=3)
db = s.connect(path)
wrong, sides = [], Counter()


def unit_cells(t):
    """The unit cells that the interior of a triangle meets."""
    p = [(int(q[0]), int(q[1])) for q in t]
    xs, ys = [q[0] for q in p], [q[1] for q in p]
    return [(i, -j) for i in range(min(xs), max(xs)) for j in range(min(ys) + 1, max(ys) + 1)
            if meets(p, [(i, j), (i + 1, j), (i + 1, j - 1), (i, j - 1)])]


whole = {eps: triangles(db, None, eps) for eps in (3, 8, 40)}
cells = {eps: [(t, unit_cells(t)) for t in mesh] for eps, mesh in whole.items()}
for n in range(40):
    grid = dice.choice((1, 64))
    shape = [(dice.randrange(-UNITS * 4, UNITS * 78) // grid * grid, -(dice.randrange(-UNITS * 4, UNITS * 63) // grid * grid))
             for _ in range(dice.choice((1, 2, 3, 3, 3)))]
    if n % 4 == 0:
        (x0, y0), (x1, y1) = shape[0], (shape[0][0] + dice.randrange(1, 4000), shape[0][1] - dice.randrange(1, 3000))
        shape = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    if len(shape) == 3 and (shape[1][0] - shape[0][0]) * (shape[2][1] - shape[0][1]) == (shape[1][1] - shape[0][1]) * (shape[2][0] - shape[0][0]):
        continue
    at = ["%r %r" % (x / UNITS, y / UNITS) for x, y in shape]
    text = "POINT(%s)" % at[0] if len(shape) == 1 else "LINESTRING(%s)" % ", ".join(at) if len(shape) == 2 else "POLYGON((%s))" % ", ".join(at + at[:1])
    xs, ys = [x / UNITS for x, _ in shape], [-y / UNITS for _, y in shape]
    outside = max(xs) < 0 or max(ys) < 0 or min(xs) > 74 or min(ys) > 59
    box = [min(max(int(v // 1), 0), last) for v, last in ((min(xs), 74), (min(ys), 59), (-(-max(xs) // 1), 74), (-(-max(ys) // 1), 59))]
    longer, side = max(box[2] - box[0], box[3] - box[1]), 1
    while 2 * side <= longer / 8:
        side *= 2
    squares = set()  # as unit cells
    for j in range(0, 59, side):
        for i in range(0, 74, side):
            square = [(UNITS * x, -UNITS * y) for x, y in ((i, j), (min(i + side, 74), j), (min(i + side, 74), min(j + side, 59)), (i, min(j + side, 59)))]
            if not outside and meets(square, shape, len(shape) < 3):
                squares |= {(x, y) for x in range(i, min(i + side, 74)) for y in range(j, min(j + side, 59))}
    sides[side] += bool(squares)
    for eps, mesh in cells.items():
        expected = {t for t, of in mesh if any(c in squares for c in of)}
        seen = triangles(db, text, eps, None, SNAP)
        if set(seen) != expected or len(seen) != len(expected):
            wrong.append((text, eps, side, len(seen), len(expected)))
equal("mode snap is cover of the squares that the region meets, for 40 regions", wrong[:3], [])
check("the squares were of several sizes", len(sides) >= 3, sides)
equal("mode snap of everything is everything", triangles(db, None, 8, None, SNAP), whole[8])
equal("mode snap: proof", rows(db, PROOF, "POLYGON((5.5 -3, 60 -20, 30 -50, 5.5 -3))", 8, SNAP), [(1, 0, 0, 0)])
parts = set()
for x0 in range(0, 74, 13):
    for y0 in range(0, 59, 17):
        parts |= set(triangles(db, "POLYGON((%g %g, %g %g, %g %g, %g %g, %g %g))" % (
            x0, -y0, x0 + 13, -y0, x0 + 13, -y0 - 17, x0, -y0 - 17, x0, -y0), 8, None, dice.choice((None, SNAP))))
equal("answers by cover and by snap are parts of one mesh", parts, set(whole[8]))
small = one(db, "SELECT length(rqt_mesh('POLYGON((5.5 -3, 60 -20, 30 -50, 5.5 -3))', 8, 'rqt', NULL, ?))", SNAP)
check("mode snap as wire", small > 144, small)
equal("mode snap within a budget", attempt(
    "SELECT count(*) <= 60, max(achieved_eps) > 8 FROM rqt_range('POLYGON((5.5 -3, 60 -20, 30 -50, 5.5 -3))', 8, NULL, "
    "'{\"mode\":\"snap\",\"outline\":\"tol\",\"max_vertices\":60}')"), [(1, 1)])
db.close()

# --------------------------------------------------------------------------------------------------------- outline tol

def halves(i, j):
    if (i + j) % 2 == 0:
        return ((i, j), (i, j + 1), (i + 1, j + 1)), ((i, j), (i + 1, j + 1), (i + 1, j))
    return ((i, j), (i, j + 1), (i + 1, j)), ((i + 1, j), (i, j + 1), (i + 1, j + 1))


def covered_samples(mesh):
    found = set()
    for t in mesh:
        p = [(int(x), -int(y)) for x, y, _ in t]
        for y in range(min(q[1] for q in p), max(q[1] for q in p) + 1):
            for x in range(min(q[0] for q in p), max(q[0] for q in p) + 1):
                turns = [(b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) for a, b in zip(p, p[1:] + p[:1])]
                if min(turns) >= 0 or max(turns) <= 0:
                    found.add((x, y))
    return found


def holes(kind, w, h):
    grid = [[(i * 7 + j * 13 + i * j // 5) % 23 + (i // 9) * 4 for i in range(w)] for j in range(h)]
    def dig(x0, y0, x1, y1):
        for j in range(max(y0, 0), min(y1 + 1, h)):
            for i in range(max(x0, 0), min(x1 + 1, w)):
                grid[j][i] = None
    if kind == "F16_corner_centre_row":  # of a block, and a whole row of its border
        dig(8, 8, 8, 8)
        dig(4, 4, 4, 4)
        dig(0, 16, w, 16)
    elif kind == "F17_void_block":
        dig(8, 8, 16, 16)
    elif kind == "F17_checkerboard":
        for j in range(h):
            for i in range(w):
                if (i + j) % 2 and i < w // 2:
                    grid[j][i] = None
    elif kind == "F16_lone_void":  # on flat ground, where leaves are as large as their cost allows
        grid = [[5] * w for _ in range(h)]
        dig(16, 16, 16, 16)
    elif kind == "F18_strips":  # one-wide strips and lone samples
        dig(0, 0, w, h)
        for i in range(w):
            grid[h // 2][i] = grid[h // 2 + 1][i] = 9
            grid[3][i] = 5
        grid[9][9] = 7
    else:  # lakes of all sizes
        for _ in range(7):
            x, y, r = dice.randrange(w), dice.randrange(h), dice.randrange(5)
            dig(x, y, x + r, y + dice.randrange(r + 1))
    return grid


beyond = closest = fewer = 0
for kind in ("F16_corner_centre_row", "F17_void_block", "F17_checkerboard", "F18_strips", "F16_lone_void", "lakes"):
    for void_tol in (1, 3, 20):
        w, h = dice.choice(((33, 33), (41, 30), (29, 44)))
        grid = holes(kind, w, h)
        path = s.temp("voids.gpkg")
        if os.path.exists(path):
            os.remove(path)
        s.import_terrain(path, s.write_grid(s.temp("voids.asc"), grid), name="voids", block=3, void_tol=void_tol)
        db = s.connect(path)
        void = [(i, j) for j in range(h) for i in range(w) if grid[j][i] is None]
        inside = {p for j in range(h - 1) for i in range(w - 1) for half in halves(i, j)
                  if all(grid[y][x] is not None for x, y in half) for p in half}
        bad = []
        for eps in (0, 0.2, 1, 2.5, 8, 1e6):
            mesh = triangles(db, None, eps, None, TOL)
            proof = rows(db, PROOF, None, eps, TOL)[0]
            touched = [p for t in mesh for p in t if grid[-int(p[1])][int(p[0])] is None]
            covered = covered_samples(mesh)
            # the promise, sample by sample: cell is 1 m here, so an extent of e samples costs e / void_tol metres
            reach = eps * void_tol
            for x, y in inside:
                far = min(max(abs(x - i), abs(y - j)) for i, j in void)
                if far > reach and (x, y) not in covered:
                    bad.append((eps, x, y, far))
                beyond += (x, y) not in covered
                closest = max(closest, far / reach if (x, y) not in covered else 0)
            if proof != (1, 0, 0, 0) or touched:
                bad.append((eps, proof, touched[:2]))
            parts = set()
            for x0 in (0, 11, 22):
                parts |= set(triangles(db, "POLYGON((%g 1, %g 1, %g -50, %g -50, %g 1))" % (x0, x0 + 11 + 30 * (x0 == 22),
                                                                                       x0 + 11 + 30 * (x0 == 22), x0, x0), eps, None, TOL))
            if parts != set(mesh):
                bad.append((eps, "parts", len(parts), len(mesh)))
            fewer += one(db, "SELECT count(*) FROM rqt_range(NULL, ?)", eps) > one(
                db, "SELECT count(*) FROM rqt_range(NULL, ?, NULL, ?)", eps, TOL)
        equal("%s, --void-tol %g, outline tol: within eps, no cracks, parts of one mesh, no void touched, all promised samples "
              "covered, at six eps" % (kind, void_tol), bad[:3], [])
        for metric in ("minimal", "local", "wedgie", "euclid", "plane"):
            options = '{"outline":"tol","metric":"%s"}' % metric
            proof = rows(db, PROOF, None, 2.5, options)[0]
            check("%s, --void-tol %g, metric %s keeps the promise of tol" % (kind, void_tol, metric),
                  proof[1:] == (0, 0, 0) and (proof[0] == 1 or metric in ("local", "euclid")), proof)
        budget = attempt("SELECT count(*) <= 40, max(achieved_eps) > 0 FROM rqt_range(NULL, 0, NULL, '{\"outline\":\"tol\",\"max_vertices\":40}')")
        check("%s, --void-tol %g: a budget of 40 vertices is kept" % (kind, void_tol), isinstance(budget, list) and budget[0][0] == 1, budget)
        equal("%s, --void-tol %g: rqt_height is of the full resolution, or of the outline exact" % (kind, void_tol),
              rows(db, "SELECT rqt_height(9.25, -3.5), rqt_height(9.25, -3.5, 1e6) IS NULL"),
              rows(db, "SELECT rqt_height(9.25, -3.5), NOT EXISTS (SELECT * FROM rqt_triangles('POINT(9.25 -3.5)', 1e6))"))
        db.close()
check("outline tol left samples out, up to its reach, and saved vertices", beyond > 100 and 0.8 < closest <= 1 and fewer > 10, (beyond, closest, fewer))

# a real outline: a third of the raster is void
path = s.temp("helens.gpkg")
s.import_terrain(path, os.path.join(s.DATA, "SainteHelens.dem"), name="helens")
db = s.connect(path)
for eps in (5, 50, 200, 1000):
    equal("Saint Helens, eps %g, outline tol: proof" % eps, rows(db, PROOF, None, eps, TOL), [(1, 0, 0, 0)])
    for mode in ("cover", "cut", "snap"):
        region = "POLYGON((560000 5112000, 565000 5110000, 563000 5120000, 560000 5112000))"
        equal("Saint Helens, eps %g, outline tol, mode %s: proof" % (eps, mode),
              rows(db, PROOF, region, eps, '{"outline":"tol","mode":"%s"}' % mode), [(1, 0, 0, 0)])
def read(eps, outline):
    return rows(db, "SELECT count(*), sum(bytes) FROM rqt_explain(NULL, ?, NULL, ?)", eps, '{"outline":"%s"}' % outline)[0]
check("an overview with outline tol reads less", read(1000, "tol")[1] * 4 < read(1000, "exact")[1], (read(1000, "tol"), read(1000, "exact")))
db.close()

# ------------------------------------------------------------------------------------------------------------- SRID
SITE = "POLYGON((2721003 1209007, 2722503 1209007, 2722003 1210507, 2721003 1209007))"  # off the sample lines
AS_DEGREES = ("ST_Transform(GeomFromText(?, 2056), 4326, NULL, 'EPSG:2056', 'EPSG:4326')")
alpine = os.path.join(s.DATA, "glarus_alpine_25m_161.tif")


def asks_for_another_system(title, path):
    db = s.connect(path)
    raises(title + ": without mod_spatialite a sentence says what is missing", "rqt_range(): region has SRID 4326, terrain alpine has "
           "SRID 2056; load mod_spatialite in this connection", lambda: rows(db, "SELECT * FROM rqt_range('SRID=4326;POINT(9 47)', 5)"))
    db.load_extension("mod_spatialite")
    wanted = rows(db, "SELECT x, y, z FROM rqt_range(?, 5)", SITE)
    check(title + ": there is something to find", len(wanted) > 300, len(wanted))
    for kind, sql in (("SpatiaLite geometry", AS_DEGREES), ("GeoPackage geometry", "AsGPB(%s)" % AS_DEGREES),
                      ("EWKT", "AsEWKT(%s)" % AS_DEGREES)):
        seen = rows(db, "SELECT x, y, z FROM rqt_range(%s, 5)" % sql, SITE)
        # EWKT has 15 digits: still far below a sample
        equal("%s: a region in degrees as %s is transformed" % (title, kind), seen, wanted)
    equal(title + ": several members", one(db, "SELECT area FROM rqt_verify(ST_Collect(%s, MakePoint(9.1, 46.8, 4326)), 5, NULL, ?)" % AS_DEGREES,
                                           SITE, CUT) > 1.12e6, True)
    near = one(db, "SELECT area FROM rqt_verify(%s, 5, NULL, ?)" % AS_DEGREES, SITE, CUT)
    check(title + ": its cut has the region's area", abs(near - 1125000) < 1, near)
    equal(title + ": SpatiaLite's area of the cut mesh, as it comes and joined, is its area of the region",
          rows(db, "SELECT abs(ST_Area(m) - ST_Area(g)) < 1e-6 * ST_Area(g), abs(ST_Area(ST_UnaryUnion(m)) - ST_Area(g)) < 1e-6 * ST_Area(g), "
                   "ST_NumGeometries(m) > 500 FROM (SELECT GeomFromText(?1, 2056) AS g, rqt_mesh(?1, 5, 'spatialite', NULL, ?2) AS m)", SITE, CUT),
          [(1, 1, 1)])
    raises(title + ": a system that nobody knows", "region has SRID 987654, terrain alpine has SRID 2056, and SpatiaLite's ST_Transform fails",
           lambda: rows(db, "SELECT * FROM rqt_range('SRID=987654;POINT(9 47)', 5)"))
    equal(title + ": an empty region of another system is empty", rows(db, "SELECT * FROM rqt_range('SRID=4326;POLYGON EMPTY', 5)"), [])
    raises(title + ": errors of the options are told all the same", "unknown option",
           lambda: rows(db, "SELECT * FROM rqt_range('SRID=4326;POINT(9 47)', 5, NULL, '{\"x\":1}')"))
    db.close()


path = s.temp("alpine.gpkg")
s.import_terrain(path, alpine, name="alpine")
asks_for_another_system("GeoPackage", path)
db = s.connect(path)
db.load_extension("mod_spatialite")
db.execute("INSERT INTO gpkg_spatial_ref_sys(srs_name, srs_id, organization, organization_coordsys_id, definition) "
           "SELECT 'ours', 777777, 'NONE', 777777, crs FROM rqt_terrain")
equal("GeoPackage: a system that its tables alone know", attempt("SELECT x, y, z FROM rqt_range('SRID=777777;' || ?, 5)", SITE), rows(db, "SELECT x, y, z FROM rqt_range(?, 5)", SITE))
db.execute("UPDATE rqt_terrain SET srid = 0")
equal("a terrain whose system has no number", rows(db, "SELECT count(*) FROM rqt_range(%s, 5)" % AS_DEGREES, SITE),
      rows(db, "SELECT count(*) FROM rqt_range(?, 5)", SITE))
db.execute("UPDATE rqt_terrain SET crs = ''")
raises("a terrain without a system", "region has SRID 4326, terrain alpine has no coordinate system to transform it to",
       lambda: rows(db, "SELECT * FROM rqt_range('SRID=4326;POINT(9 47)', 5)"))
db.close()
for title, setup in (("plain database", "SELECT 1"), ("SpatiaLite database", "SELECT InitSpatialMetaData(1)")):
    path = s.temp(title.split()[0] + ".db")
    db = s.connect(path, False)
    db.load_extension("mod_spatialite")
    db.execute("CREATE TABLE first(x)")
    db.execute(setup)
    db.close()
    s.import_terrain(path, alpine, name="alpine")
    asks_for_another_system(title, path)
s.finish()
