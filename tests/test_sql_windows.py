#!/usr/bin/python3
"""All answers for one terrain and eps are parts of one mesh, bit for bit: windows, splits, block sizes, selections.

The triangles that a region asks for are found here by an exact test of their own, in integers.
"""
from collections import Counter

import sql_support as s
from sql_support import check, equal, rows, triangles

UNITS = 64  # regions lie on multiples of 1/64 of a sample, so that doubles hold them exactly


def separated(a, b, axis, touching_counts):
    """Does an axis keep two point sets apart? With touching_counts they must not even touch to be apart."""
    pa = [p[0] * axis[0] + p[1] * axis[1] for p in a]
    pb = [p[0] * axis[0] + p[1] * axis[1] for p in b]
    if touching_counts:
        return max(pa) < min(pb) or max(pb) < min(pa)
    return max(pa) <= min(pb) or max(pb) <= min(pa)


def normals(points):
    n = len(points)
    return [(points[i][1] - points[(i + 1) % n][1], points[(i + 1) % n][0] - points[i][0]) for i in range(n) if points[i] != points[(i + 1) % n]]


def meets(triangle, shape):
    """Interiors meet; for a shape of one or two points: the closed triangle meets it. Shapes are convex, in 1/64 samples."""
    t = [(int(p[0]) * UNITS, int(p[1]) * UNITS) for p in triangle]
    thin = len(shape) <= 2
    axes = normals(t) + normals(shape) + [(1, 0), (0, 1)]
    return not any(separated(t, shape, axis, thin) for axis in axes)


def wkt(shape):
    at = ["%r %r" % (x / UNITS, y / UNITS) for x, y in shape]
    if len(shape) == 1:
        return "POINT(%s)" % at[0]
    if len(shape) == 2:
        return "LINESTRING(%s)" % ", ".join(at)
    return "POLYGON((%s))" % ", ".join(at + at[:1])


def box(x0, y0, x1, y1):
    return [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]


def random_shape(dice, width, height):
    kind = dice.below(8)
    grid = 64 if dice.below(2) else 1  # half of them on sample lines, where touching is decided
    def place(margin=2):
        return ((dice.below(UNITS * (width + 2 * margin) // grid) * grid - margin * UNITS),
                -(dice.below(UNITS * (height + 2 * margin) // grid) * grid - margin * UNITS))
    if kind == 0:
        return [place()]
    a, b = place(), place()
    if kind == 1:
        return [a, b] if a != b else [a]
    if kind == 2:  # a triangle, counter-clockwise or not
        c = place()
        if (b[0] - a[0]) * (c[1] - a[1]) != (b[1] - a[1]) * (c[0] - a[0]):
            return [a, b, c]
    if kind == 3:  # thinner than a cell
        b = (a[0] + 1, b[1])
    x0, x1, y0, y1 = min(a[0], b[0]), max(a[0], b[0]), min(a[1], b[1]), max(a[1], b[1])
    return box(x0, y0, max(x1, x0 + 1), max(y1, y0 + 1))


def windows_of(title, database, whole, eps, count, dice, width, height):
    """Random windows hold exactly the whole's triangles that they meet."""
    db = s.connect(database)
    wrong, filled, outside = [], 0, 0
    for _ in range(count):
        shape = random_shape(dice, width, height)
        expected = Counter(t for t in whole if meets(t, shape))
        answer = Counter(triangles(db, wkt(shape), eps))
        filled += bool(expected)
        outside += not expected
        if answer != expected:
            wrong.append((wkt(shape), len(answer), sum(expected.values())))
    check("%s, eps %g: %d random windows are exactly the part of the whole that they meet" % (title, eps, count), not wrong, wrong[:2])
    db.close()
    return filled, outside


# --------------------------------------------------------------- odd extents, with and without voids, every block size
total = [0, 0]
for width, height, voids, seed in ((61, 43, 0, 1), (50, 70, 60, 2), (33, 33, 20, 3), (18, 2, 0, 4), (7, 65, 100, 5)):
    source = s.write_grid(s.temp("grid.asc"), s.rough_grid(width, height, seed, voids))
    files = {}
    for k in range(1, 9):
        files[k] = s.temp("grid_%dx%d_%d.gpkg" % (width, height, k))
        s.import_terrain(files[k], source, name="grid", block=k)
    title = "%d x %d%s" % (width, height, ", voids" if voids else "")
    dice = s.Dice(seed)
    for eps in (0, 3, 12, float("inf")):
        meshes = {}
        for k, path in files.items():
            db = s.connect(path)
            meshes[k] = (triangles(db, None, eps), rows(db, "SELECT x, y, z, error, level FROM rqt_range(NULL, ?)", eps))
            db.close()
        whole = meshes[6][0]
        check("%s, eps %g: triangles wind counter-clockwise, each once" % (title, eps),
              all(s.counter_clockwise(t) for t in whole) and len(set(map(s.rotated, whole))) == len(whole))
        equal("%s, eps %g: blocks of every size give the same triangles" % (title, eps),
              [k for k in meshes if Counter(meshes[k][0]) != Counter(whole)], [])
        equal("%s, eps %g: and the same vertices, errors and levels" % (title, eps),
              [k for k in meshes if Counter(meshes[k][1]) != Counter(meshes[6][1])], [])
        equal("%s, eps %g: the vertices are the corners of the triangles, each once" % (title, eps),
              Counter(r[:3] for r in meshes[6][1]), Counter(set(p for t in whole for p in t)))
        for k in (1, 3, 6, 8):
            filled, outside = windows_of("%s, blocks of 2^%d" % (title, k), files[k], whole, eps, 12, dice, width, height)
            total[0] += filled
            total[1] += outside
check("the windows were not all full or empty", total[0] > 500 and total[1] > 50, total)

# ----------------------------------------------------------------------------------- parts of a split are the whole
path = s.temp("split.gpkg")
s.import_terrain(path, s.write_grid(s.temp("split.asc"), s.rough_grid(100, 80, 9, 10)), block=3)
db = s.connect(path)
dice = s.Dice(10)
for eps in (0, 2, 7.5, 30):
    whole = triangles(db, None, eps)
    for _ in range(3):
        xs = [0] + sorted(dice.below(99 * UNITS) for _ in range(3)) + [99 * UNITS]
        ys = [0] + sorted(-dice.below(79 * UNITS) for _ in range(3))[::-1] + [-79 * UNITS]
        parts = set()
        for x0, x1 in zip(xs, xs[1:]):
            for y0, y1 in zip(ys, ys[1:]):
                if x0 < x1 and y1 < y0:
                    parts.update(triangles(db, wkt(box(x0, y1, x1, y0)), eps))
        equal("eps %g: a split into boxes at %s, %s has the whole's triangles and no other" % (eps, xs[1:-1], ys[1:-1]),
              parts, set(whole))
    pieces = [box(10 * UNITS, -30 * UNITS, 20 * UNITS, -5 * UNITS), [(2000, -100), (4000, -3000), (6000, -900)],
              [(5000, -4000), (5001, -4000), (5001, -5000)]]
    multi = "MULTIPOLYGON(%s)" % ", ".join(wkt(p)[7:] for p in pieces)
    equal("eps %g: a multipolygon is the union of its members" % eps, set(triangles(db, multi, eps)),
          set().union(*(triangles(db, wkt(p), eps) for p in pieces)))
    ring, hole = box(640, -3200, 4480, -640), box(1280, -2560, 3840, -1280)
    holed = "POLYGON(%s, %s)" % (wkt(ring)[8:-1], wkt(hole)[8:-1])
    frame = [box(640, -3200, 1280, -640), box(3840, -3200, 4480, -640), box(1280, -3200, 3840, -2560), box(1280, -1280, 3840, -640)]
    equal("eps %g: a hole is not asked for" % eps, set(triangles(db, holed, eps)),
          set().union(*(triangles(db, wkt(p), eps) for p in frame)))

# -------------------------------------------------------------------------- three selections, one order; strips too
for eps in (0, 1, 2.5, 6, 20, float("inf")):
    for region in (None, wkt(box(700, -3000, 4000, -900)), "POINT(50 -40)", "LINESTRING(0 0, 99 -79)"):
        where = region[:10] if region else "everything"
        for table, columns in (("rqt_range", "x,y,z,error,level"), ("rqt_triangles", "*"), ("rqt_strip", "*")):
            answers = [rows(db, "SELECT %s FROM %s(?, ?, NULL, ?)" % (columns, table), region, eps, '{"select":"%s"}' % how)
                       for how in ("threshold", "topdown", "bottomup")]
            check("eps %g, %s: %s gives the same rows in the same order by threshold, topdown and bottomup" % (eps, where, table),
                  answers[0] == answers[1] == answers[2] and len(answers[0]) > 0, [len(a) for a in answers])
        plain = rows(db, "SELECT x, y, z FROM rqt_strip(?, ?)", region, eps)
        equal("eps %g, %s: the strip is the list, by option bintree too" % (eps, where), rows(
            db, "SELECT x, y, z FROM rqt_strip(?, ?, NULL, '{\"strip\":\"bintree\"}')", region, eps), plain)
        equal("eps %g, %s: the strip's triangles are the list's, with its winding" % (eps, where),
              Counter(map(s.rotated, s.strip_triangles(plain))), Counter(map(s.rotated, triangles(db, region, eps))))
equal("the database is sound", rows(db, "PRAGMA quick_check"), [("ok",)])
db.close()
s.finish()
