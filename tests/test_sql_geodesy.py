#!/usr/bin/python3
"""Geodesy in SQL: profiles, areas, corridors, regions on every turn of longitude, frames. Oracles are written here, in fractions
where things are exact, after textbooks (Vincenty) where they are on the ellipsoid."""
import math
import os
import struct
from fractions import Fraction

from sql_support import (DATA, WGS84, Dice, check, connect, equal, finish, import_terrain, one, raises, rough_grid, rows, temp,
                         write_grid)

SEED = int(os.environ.get("RQT_SEED", "41"))
print("RQT_SEED=%d" % SEED)
dice = Dice(SEED)

A, F = 6378137.0, 1 / 298.257223563


def vincenty(lon0, lat0, lon1, lat1):
    """Geodesic distance in metres; good to a millimetre where the points are not nearly antipodal."""
    b = A * (1 - F)
    u0, u1 = (math.atan((1 - F) * math.tan(math.radians(v))) for v in (lat0, lat1))
    long = lam = math.radians(math.remainder(lon1 - lon0, 360))
    for _ in range(200):
        s = math.hypot(math.cos(u1) * math.sin(lam), math.cos(u0) * math.sin(u1) - math.sin(u0) * math.cos(u1) * math.cos(lam))
        if s == 0:
            return 0.0
        c = math.sin(u0) * math.sin(u1) + math.cos(u0) * math.cos(u1) * math.cos(lam)
        sigma = math.atan2(s, c)
        sin_a = math.cos(u0) * math.cos(u1) * math.sin(lam) / s
        cos2 = 1 - sin_a ** 2
        m = c - 2 * math.sin(u0) * math.sin(u1) / cos2 if cos2 else 0
        k = F / 16 * cos2 * (4 + F * (4 - 3 * cos2))
        before, lam = lam, long + (1 - k) * F * sin_a * (sigma + k * s * (m + k * c * (2 * m * m - 1)))
        if abs(lam - before) < 1e-14:
            break
    q = cos2 * (A * A - b * b) / (b * b)
    k0 = 1 + q / 16384 * (4096 + q * (-768 + q * (320 - 175 * q)))
    k1 = q / 1024 * (256 + q * (-128 + q * (74 - 47 * q)))
    d = k1 * s * (m + k1 / 4 * (c * (2 * m * m - 1) - k1 / 6 * m * (4 * s * s - 3) * (4 * m * m - 3)))
    return b * k0 * (sigma - d)


# ------------------------------------------------------------------------------------------------------------------ profiles

def mesh(db, eps, terrain=None):
    """Triangles as ((x,y,z),(x,y,z),(x,y,z))."""
    return [((t[1], t[2], t[3]), (t[4], t[5], t[6]), (t[7], t[8], t[9]))
            for t in rows(db, "SELECT * FROM rqt_triangles(NULL, ?, ?)", eps, terrain)]


def cross(o, a, b):
    return (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0])


def height_in(triangles, p):
    """The height of a place on the mesh, by the first triangle that holds it."""
    for t in triangles:
        if not (min(v[0] for v in t) <= p[0] <= max(v[0] for v in t) and min(v[1] for v in t) <= p[1] <= max(v[1] for v in t)):
            continue
        w = [cross(t[(i + 1) % 3], t[(i + 2) % 3], p) for i in range(3)]
        if min(w) >= 0:
            return sum(w[i] * Fraction(t[i][2]) for i in range(3)) / sum(w)
    return None


def exact(triangles):
    return [tuple((Fraction(v[0]), Fraction(v[1]), v[2]) for v in t) for t in triangles]


def oracle(triangles, line):
    """Places on the mesh along the line: its points, edges crossed, ends of edges run along; and is there mesh between."""
    edges = {}
    for t in triangles:
        for i in range(3):
            p, q = sorted((t[i][:2], t[(i + 1) % 3][:2]))
            edges[p, q] = 1
    places = []  # (piece, t, point)
    for n, (a, b) in enumerate(zip(line, line[1:] + [line[-1]])):
        found = {Fraction(0): a} if height_in(triangles, a) is not None else {}
        d = (b[0] - a[0], b[1] - a[1])
        length = d[0] ** 2 + d[1] ** 2
        for p, q in edges if length else ():
            sp, sq = cross(a, b, p), cross(a, b, q)
            if sp * sq > 0:
                continue
            ends = [p, q] if sp == sq == 0 else [tuple(p[i] + sp / (sp - sq) * (q[i] - p[i]) for i in (0, 1))]
            for e in ends:
                t = ((e[0] - a[0]) * d[0] + (e[1] - a[1]) * d[1]) / length
                if 0 <= t < 1:
                    found[t] = e
        places += [(n, t, found[t]) for t in sorted(found)]
    answer = []
    for i, (n, t, p) in enumerate(places):
        if i:
            m, s, q = places[i - 1]
            corners = [(m, s, q)] + [(j, Fraction(0), line[j]) for j in range(m + 1, n + 1)] + [(n, t, p)]
            middles = [((u[0] + v[0]) / 2, (u[1] + v[1]) / 2) for (_, _, u), (_, _, v) in zip(corners, corners[1:])]
            if any(height_in(triangles, x) is None for x in middles):
                answer += [(q, None), (p, None)]
        answer.append((p, height_in(triangles, p)))
    return answer


def wkt(line):
    return "LINESTRING(" + ", ".join("%r %r" % (float(x), float(y)) for x, y in line) + ")"


def profiles_in_the_plane():
    grid = rough_grid(14, 12, SEED, voids=60)
    path = temp("plane.gpkg")
    import_terrain(path, write_grid(temp("plane.asc"), grid), block=2)
    db = connect(path)
    lines = {
        "along a sample line": [(-3, -4), (25, -4)],
        "along a column, up": [(7, -14), (7, 3)],
        "along a diagonal": [(0, 0), (11, -11)],
        "along the other diagonal": [(0, -11), (11, 0)],
        "along the border": [(0, 0), (13, 0), (13, -11), (0, -11), (0, 0)],
        "closed": [(2, -2), (9, -3), (5, -11), (2, -2)],
        "there and back": [(2.5, -2.25), (11, -9), (2.5, -2.25)],
        "from vertex to vertex": [(4, -4), (12, -8), (8, -12), (3, -5)],
        "a point twice": [(4.25, -4.5), (4.25, -4.5)],
        "outside": [(-5, 5), (-1, 3)],
        "touching a corner": [(-1, -1), (1, 1)],
        "with a point within a triangle twice over": [(4.25, -4.5), (4.25, -4.5), (9, -4.5)],
    }
    for i in range(20):
        lines["random %d" % i] = [(Fraction(dice.below(17 * 64) - 96, 64), Fraction(96 - dice.below(15 * 64), 64))
                                  for _ in range(2 + i % 3)]
    wrong, gaps = [], 0
    for eps in (0, 12):
        triangles = exact(mesh(db, eps))
        for name, line in lines.items():
            line = [(Fraction(x), Fraction(y)) for x, y in line]
            clean = [p for i, p in enumerate(line) if i == 0 or p != line[i - 1]]
            right = oracle(triangles, clean)
            seen = rows(db, "SELECT x, y, z, distance FROM rqt_profile(?, ?)", wkt(line), eps)
            fine = len(seen) == len(right)
            for (x, y, z, _), ((px, py), pz) in zip(seen, right):
                fine = fine and abs(x - px) < 1e-9 and abs(y - py) < 1e-9
                fine = fine and (z is None) == (pz is None) and (z is None or abs(z - pz) < 1e-9)
            distances = [r[3] for r in seen]
            fine = fine and distances == sorted(distances)
            gaps += sum(r[2] is None for r in seen)
            if not fine:
                wrong.append((eps, name, len(seen), len(right)))
    equal("profiles in the plane have every edge crossed, heights of the mesh, and gaps", wrong, [])
    check("profiles: gaps were met", gaps > 10, gaps)
    # as rqt_height says, where its rounding to 2^-20 sample allows
    worst = 0
    for x, y, z in rows(db, "SELECT x, y, z FROM rqt_profile('LINESTRING(0.3 -0.7, 12.1 -10.2)', 6) WHERE z IS NOT NULL"):
        h = one(db, "SELECT rqt_height(?, ?, 6)", x, y)
        if h is not None:
            worst = max(worst, abs(h - z))
    check("profiles: z is rqt_height's", worst < 300 * 2 ** -20, worst)
    equal("profiles: the row of a zero-length line", rows(db, "SELECT distance, x, y, z = rqt_height(x, y, 0) FROM "
          "rqt_profile('LINESTRING(4.25 -4.5, 4.25 -4.5)', 0)"), [(0.0, 4.25, -4.5, 1)])
    equal("profiles: lines of several parts are lifted between, and no distance is added",
          [r[0] for r in rows(db, "SELECT distance FROM rqt_profile('MULTILINESTRING((4 -4, 5 -4), (10 -4, 11 -4))', 1e9)")][-1],
          2.0)
    for value, sentence in (("NULL", "line must be WKT text or a geometry; it is NULL"), ("3", "line must be WKT text or a geometry; it is a number"),
                            ("'LINESTRING EMPTY'", "line is empty"), ("rqt_bbox(0,0,1,1)", "line is a polygon"),
                            ("'SRID=4326;LINESTRING(0 0, 1 1)'", "line has SRID 4326")):
        raises("profiles: %s is refused" % value, "rqt_profile(): " + sentence,
               lambda: rows(db, "SELECT * FROM rqt_profile(%s, 1)" % value))
    raises("profiles: eps must be a number", "rqt_profile(): eps must be",
           lambda: rows(db, "SELECT * FROM rqt_profile('LINESTRING(0 0, 1 1)', NULL)"))
    raises("profiles: eps must not be negative", "rqt_profile(): eps must be 0 or more",
           lambda: rows(db, "SELECT * FROM rqt_profile('LINESTRING(0 0, 1 1)', -1)"))
    db.close()


def profiles_on_the_ellipsoid(db):
    for name, line in (("land", [(-71.9, 44.1), (-71.05, 44.93)]), ("bent", [(-71.5, 44.1), (-71.4, 44.8), (-71.9, 44.5)])):
        seen = rows(db, "SELECT distance, x, y, z FROM rqt_profile(?, 20, 'land')", wkt(line))
        total = sum(vincenty(*a, *b) for a, b in zip(line, line[1:]))
        check("profiles on the ellipsoid: length, %s" % name, abs(seen[-1][0] - total) < 1e-3, (seen[-1][0], total))
        worst = max(abs(r[0] - vincenty(*line[0], r[1], r[2])) for r in seen if r[0] < vincenty(*line[0], *line[1]))
        check("profiles on the ellipsoid: distances are geodesic, %s" % name, worst < 1e-3, worst)
        # on the geodesic within a thousandth of a cell: the two ways round are no longer than the geodesic
        leg = vincenty(*line[0], *line[1])
        off = max(math.sqrt(max(0, (vincenty(*line[0], r[1], r[2]) + vincenty(r[1], r[2], *line[1])) ** 2 - leg ** 2)) / 2
                  for r in seen if 1000 < r[0] < leg - 1000)
        check("profiles on the ellipsoid: on the geodesic, %s" % name, off < 25, off)
        steps = [rows(db, "SELECT rqt_height(?, ?, 20, 'land')", (a[1] + b[1]) / 2, (a[2] + b[2]) / 2)[0][0] - (a[3] + b[3]) / 2
                 for a, b in zip(seen[::40], seen[1::40])]
        check("profiles on the ellipsoid: a plane between two rows, %s" % name, max(map(abs, steps)) < 0.05, steps)


def F25_profiles_across_the_antimeridian(db):
    across = rows(db, "SELECT distance, x, y, z FROM rqt_profile('LINESTRING(175 10, -175 12)', 0, 'globe')")
    equal("F25 profile across the antimeridian: no gap", sum(r[3] is None for r in across), 0)
    check("F25 profile across the antimeridian: the terrain's own coordinates",
          across[0][1] == 175 and across[-1][1] == -175 and all(-180 <= r[1] <= 180 for r in across), across[-1])
    other = rows(db, "SELECT distance, x, y, z FROM rqt_profile('LINESTRING(535 10, 545 12)', 0, 'globe')")
    check("F25 profile on another turn: the same", len(other) == len(across) and
          all(abs(a - b) < 1e-6 for p, q in zip(across, other) for a, b in zip(p, q)))
    both = [r for r in across if abs(r[1]) == 180]
    check("F25 profile: both copies of the meridian", len(both) == 2 and both[0][1] == -both[1][1] and
          abs(both[0][0] - both[1][0]) < 1e-6, both)
    pole = rows(db, "SELECT distance, x, y, z FROM rqt_profile('LINESTRING(10 88, -170 88)', 0, 'globe')")
    check("F28 profile over the pole", max(r[2] for r in pole) == 90 and not any(r[3] is None for r in pole) and
          abs(pole[-1][0] - vincenty(10, 88, -170, 88)) < 1e-3, pole[-1])


def main():
    profiles_in_the_plane()
    path = temp("earth.gpkg")
    import_terrain(path, os.path.join(os.path.dirname(DATA), "..", "examples", "N44W072.hgt.zip"), name="land")
    import_terrain(path, os.path.join(DATA, "etopo1_1deg.tif"), name="globe", block=4)
    db = connect(path)
    profiles_on_the_ellipsoid(db)
    F25_profiles_across_the_antimeridian(db)
    finish()


main()
