#!/usr/bin/python3
"""Geodesy in SQL: profiles, areas, corridors, regions on every turn of longitude, frames. Oracles are written here, in fractions
where things are exact, after textbooks (Vincenty) where they are on the ellipsoid."""
import math
import os
import struct
from fractions import Fraction

from sql_support import (DATA, WGS84, Dice, check, connect, equal, finish, import_terrain, one, raises, rough_grid, rows, run,
                         temp, write_grid)

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


# --------------------------------------------------------------------------------------------------------------------- areas

UTM = ('PROJCS["WGS 84 / UTM zone 32N",GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],'
       'PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],'
       'PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",9],PARAMETER["scale_factor",0.9996],'
       'PARAMETER["false_easting",500000],PARAMETER["false_northing",0],UNIT[%s],AUTHORITY["EPSG","32632"]]')
METRE, FOOT = '"metre",1', '"US survey foot",0.304800609601219'


def near(name, seen, expected, relative=1e-12):
    seen = seen if isinstance(seen, tuple) else (seen,)
    return check(name, all(abs(a - b) <= relative * max(abs(b), 1e-300) for a, b in zip(seen, expected)) and len(seen) == len(expected),
                 "%r instead of %r" % (seen, expected))


def clip(polygon, a, b):
    """What of a convex polygon of (x,y,z) lies to the left of a-b."""
    out = []
    for p, q in zip(polygon, polygon[1:] + polygon[:1]):
        sp, sq = cross(a, b, p), cross(a, b, q)
        if sp >= 0:
            out.append(p)
        if sp * sq < 0:
            t = sp / (sp - sq)
            out.append(tuple(p[i] + t * (q[i] - p[i]) for i in range(3)))
    return out


def areas_in_the_plane():
    path = temp("areas.gpkg")
    n = 33
    plane = [[3 * i + 2 * j + 100 for i in range(n)] for j in range(n)]
    cone = [[int(500 - 10 * math.hypot(i - 16, j - 16)) for i in range(n)] for j in range(n)]
    import_terrain(path, write_grid(temp("tilt.asc"), plane, x0=4e5, y0=5e6, cell=10, crs=UTM % METRE), name="tilt")
    import_terrain(path, write_grid(temp("feet.asc"), plane, x0=4e5, y0=5e6, cell=10, crs=UTM % FOOT), name="feet")
    import_terrain(path, write_grid(temp("cone.asc"), cone), name="cone", block=2)
    import_terrain(path, write_grid(temp("voids.asc"), rough_grid(14, 12, SEED, voids=60)), name="voids", block=2)
    db = connect(path)
    side = 320.0
    slope = math.sqrt(1 + 0.3 ** 2 + 0.2 ** 2)
    for eps in (0, 1000):
        near("areas: a tilted plane, eps %d" % eps, one(db, "SELECT * FROM rqt_area(NULL, ?, 'tilt')", eps),
             (side ** 2, side ** 2 * slope, side ** 2 * 180))
    foot = 1200 / 3937
    near("areas: feet on the ground, metres of height", one(db, "SELECT * FROM rqt_area(NULL, 0, 'feet')"),
         ((side * foot) ** 2, (side * foot) ** 2 * math.sqrt(1 + (0.3 / foot) ** 2 + (0.2 / foot) ** 2), (side * foot) ** 2 * 180),
         1e-11)
    # a region's own area, whatever the triangles; its corners are rounded to 2^-20 sample
    x, y = 400003.25, 5000001.5
    near("areas: of the region itself", one(db, "SELECT planimetric, volume FROM rqt_area(rqt_bbox(?, ?, ? + 101.5, ? + 33.25), "
                                            "0, 'tilt')", x, y, x, y),
         (101.5 * 33.25, 101.5 * 33.25 * (100 + 0.3 * (x + 50.75 - 4e5) + 0.2 * (5e6 + 320 - y - 33.25 / 2))), 1e-6)
    near("areas: whole triangles when the mode is cover",
         one(db, "SELECT planimetric FROM rqt_area('POINT(400001 5000002)', 0, 'tilt', '{\"mode\":\"cover\"}')"), (side ** 2 / 2,))
    for name, eps in (("cone", 0), ("cone", 5), ("voids", 0), ("voids", 12)):
        triangles = mesh(db, eps, name)
        a, b, c = (2.5, -9.25), (11.75, -7.5), (6.125, -1.25)
        total = [0.0, 0.0, 0.0]
        for t in triangles:
            polygon = clip(clip(clip(list(t), a, b), b, c), c, a)
            for q, r in zip(polygon[1:], polygon[2:]):
                p = polygon[0]
                u, v = [q[i] - p[i] for i in range(3)], [r[i] - p[i] for i in range(3)]
                n3 = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
                total[0] += n3[2] / 2
                total[1] += math.sqrt(sum(k * k for k in n3)) / 2
                total[2] += n3[2] / 6 * (p[2] + q[2] + r[2])
        near("areas: a triangle on %s at %d, triangle by triangle" % (name, eps),
             one(db, "SELECT * FROM rqt_area(?, ?, ?)", "POLYGON((%r %r, %r %r, %r %r, %r %r))" % (a + b + c + a), eps, name),
             total, 1e-8)
    for options, sentence in (('{"max_vertices":50}', 'option "max_vertices" does not go with mode "cut"'),
                              ('{"strip":"fan"}', 'option "strip":"fan" does not go with mode "cut"')):
        raises("areas: cut is the mode, and what does not go with it is refused: " + options, "rqt_area(): " + sentence,
               lambda: one(db, "SELECT * FROM rqt_area(NULL, 0, 'cone', ?)", options))
    check("areas: with another mode a budget works", one(db, "SELECT achieved_eps FROM rqt_area(NULL, 0, 'cone', "
                                                          "'{\"mode\":\"cover\",\"max_vertices\":50}')") > 0)
    equal("areas: outside", one(db, "SELECT * FROM rqt_area(rqt_bbox(-9, 1, -8, 2), 0, 'cone')"), (0.0, 0.0, 0.0))
    raises("areas: eps is checked", "rqt_area(): eps must be 0 or more", lambda: one(db, "SELECT * FROM rqt_area(NULL, -1, 'cone')"))
    db.enable_load_extension(True)
    db.load_extension("mod_spatialite")
    shape = "POLYGON((400020 5000030, 400290 5000011, 400200 5000300, 400020 5000030), (400180 5000050, 400200 5000060, 400190 5000090, 400180 5000050))"
    seen, theirs = one(db, "SELECT a.planimetric, ST_Area(ST_GeomFromText(?)) FROM rqt_area(?, 0, 'tilt') a", shape, shape)
    near("areas: SpatiaLite's ST_Area", (seen,), (theirs,), 1e-7)
    db.close()


def quarter(lat):
    """The area from the equator to a latitude, per radian of longitude."""
    e2 = F * (2 - F)
    e, s = math.sqrt(e2), math.sin(math.radians(lat))
    return (A * (1 - F)) ** 2 / 2 * (s / (1 - e2 * s * s) + math.atanh(e * s) / e)


def areas_on_the_ellipsoid():
    path = temp("shell.gpkg")
    import_terrain(path, write_grid(temp("shell.asc"), [[2000] * 361 for _ in range(181)], x0=-180, y0=-90, crs=WGS84), name="shell",
                   block=4)
    import_terrain(path, write_grid(temp("sea.asc"), [[0] * 361 for _ in range(181)], x0=0, y0=-90, crs=WGS84), name="sea", block=4)
    db = connect(path)
    for options, sentence in (('{"frame":"ecef"}', 'option "frame" does not go with mode "cut"'),
                              ('{"frame":"enu","mode":"cover"}', "areas are measured on the ellipsoid")):
        raises("areas: frames are refused, " + options, "rqt_area(): " + sentence,
               lambda: one(db, "SELECT * FROM rqt_area(NULL, 1e6, 'sea', ?)", options))
    whole = 4 * math.pi * quarter(90)
    seen = one(db, "SELECT * FROM rqt_area(NULL, 0, 'sea')")
    near("areas: the Earth at height 0", seen, (whole, whole, 0))
    near("areas: the Earth as GeographicLib has it", seen[:1], (510065621724088.5,))
    # Steiner: what is parallel to the ellipsoid at h, by its integral of mean curvature (2 pi (b + a^2/c asin(c/a)) for an oblate)
    h, b = 2000.0, A * (1 - F)
    c = math.sqrt(A * A - b * b)
    mean = 2 * math.pi * (b + A * A / c * math.asin(c / A))
    near("areas: a shell of 2 km about the Earth", one(db, "SELECT * FROM rqt_area(NULL, 0, 'shell')"),
         (whole, whole + 2 * h * mean + 4 * math.pi * h * h, whole * h + h * h * mean + 4 / 3 * math.pi * h ** 3))
    for w, s, e, n in ((3, 40.25, 17.5, 51), (-20, -90, 20, -60.5)):
        near("areas: a zone's part from %g to %g" % (s, n),
             one(db, "SELECT planimetric FROM rqt_area(rqt_bbox(?, ?, ?, ?), 0, 'sea')", w, s, e, n),
             (math.radians(e - w) * (quarter(n) - quarter(s)),), 1e-10)
    near("areas: a circle", one(db, "SELECT planimetric FROM rqt_area(rqt_circle(30, 50, 20000), 0, 'sea')"),
         (math.pi * 20000 ** 2 * math.sin(2 * math.pi / 256) * 128 / math.pi,), 1e-5)
    near("F28 areas: a polar cap", one(db, "SELECT planimetric FROM rqt_area(rqt_circle(0, 90, 111693.8647), 0, 'sea')"),
         (2 * math.pi * (quarter(90) - quarter(89)),), 2e-4)
    near("F25 areas: a box across the antimeridian",
         one(db, "SELECT planimetric FROM rqt_area(rqt_bbox(175, -5, -170, 5, 4326), 0, 'shell')"),
         (math.radians(15) * 2 * quarter(5),), 1e-10)
    # the terrain's own ellipsoid: a sphere
    sphere = WGS84.replace("WGS 84", "ball").replace("WGS_1984", "ball").replace("6378137,298.257223563", "6371000,0").replace(
        ',AUTHORITY["EPSG","7030"]', "").replace(',AUTHORITY["EPSG","6326"]', "").replace(',AUTHORITY["EPSG","4326"]', "")
    import_terrain(path, write_grid(temp("ball.asc"), [[0] * 21 for _ in range(21)], x0=10, y0=0, crs=sphere), name="ball")
    near("areas: on the terrain's own ellipsoid", one(db, "SELECT * FROM rqt_area(rqt_bbox(11, 0, 15, 20), 0, 'ball')"),
         (6371000 ** 2 * math.radians(4) * math.sin(math.radians(20)),) * 2 + (0,), 1e-9)
    near("profiles: on the terrain's own ellipsoid", one(db, "SELECT max(distance) FROM rqt_profile('LINESTRING(11 0, 15 0)', 0, 'ball')"),
         (6371000 * math.radians(4),))
    db.close()


# ----------------------------------------------------------------------------------------------------------- regions, wrapped

def regions_on_every_turn(db):
    """A region is where it is, modulo 360: the answers are the terrain's own coordinates."""
    path = temp("pacific.gpkg")
    grid = [[round(100 * math.sin(i / 7) + 80 * math.cos(j / 5) + dice.below(40) + 0.25 * (i % 4), 2) for i in range(73)]
            for j in range(37)]
    import_terrain(path, write_grid(temp("pacific.asc"), grid, x0=0, y0=-90, cell=5, crs=WGS84), name="pacific", block=3)
    other = connect(path)

    def triangles(base, terrain, region):
        return sorted(r[1:] for r in rows(base, "SELECT * FROM rqt_triangles(%s, 20, ?)" % region, terrain))

    for base, terrain, pairs in (
            (db, "globe", (("rqt_bbox(190, -10, 200, 10)", "rqt_bbox(-170, -10, -160, 10)"),
                           ("rqt_bbox(-370, 0, -350, 5)", "rqt_bbox(-10, 0, 10, 5)"),
                           ("'MULTIPOLYGON(((170 -10, 180 -10, 180 10, 170 10, 170 -10)),((-180 -10, -170 -10, -170 10, -180 10, -180 -10)))'",
                            "rqt_bbox(170, -10, 190, 10)"),
                           ("rqt_bbox(170, -10, -170, 10, 4326)", "rqt_bbox(170, -10, 190, 10)"),
                           ("rqt_bbox(530, -10, 550, 10)", "rqt_bbox(170, -10, 190, 10)"))),
            (other, "pacific", (("rqt_bbox(-170, -20, -150, 20)", "rqt_bbox(190, -20, 210, 20)"),
                                ("rqt_bbox(-20, 40, 20, 50)",
                                 "'MULTIPOLYGON(((340 40, 360 40, 360 50, 340 50, 340 40)),((0 40, 20 40, 20 50, 0 50, 0 40)))'"),
                                ("rqt_bbox(20, -5, -20, 5, 4326)",
                                 "rqt_bbox(20, -5, 340, 5)")))):
        for a, b in pairs:
            seen = triangles(base, terrain, a)
            check("F25 regions on %s: %s" % (terrain, a), seen == triangles(base, terrain, b) and seen, len(seen))
    low, high = one(other, "SELECT min(x), max(x) FROM rqt_range(rqt_bbox(-20, 40, 20, 50), 20)")
    check("F25 regions: coordinates are never wrapped", (low, high) == (0, 360), (low, high))
    both = rows(db, "SELECT DISTINCT x FROM rqt_range('POINT(180 7)', 0, 'globe') ORDER BY x")
    check("F25 regions: a terrain that has a meridian twice answers both", both[0][0] == -180 and both[-1][0] == 180, both)
    for x, y in ((190.25, 3.5), (-169.75, 3.5), (550.25, 3.5)):
        equal("heights on every turn: %g" % x, one(db, "SELECT rqt_height(?, ?, 0, 'globe')", x, y),
              one(db, "SELECT rqt_height(-169.75, ?, 0, 'globe')", y))
        equal("heights on every turn, 0..360: %g" % x, one(other, "SELECT rqt_height(?, ?)", x, y),
              one(other, "SELECT rqt_height(190.25, ?)", y))
    raises("F25 a box from east to west without SRID", "rqt_bbox(): x0 is greater than x1", lambda: one(db, "SELECT rqt_bbox(170, 0, -170, 1)"))
    raises("F25 a box upside down", "rqt_bbox(): y0 is greater than y1", lambda: one(db, "SELECT rqt_bbox(170, 2, -170, 1, 4326)"))
    # F28: a circle that holds a pole holds all meridians
    for lat, pole in ((89.2, 90), (-88.9, -90), (90, 90)):
        seen = one(db, "SELECT count(DISTINCT x) > 90, min(x), max(x) FROM rqt_range(rqt_circle(100, ?, 400000), 0, 'globe') WHERE y = ?",
                   lat, pole)
        equal("F28 a circle over the pole, from %g" % lat, seen, (1, -180.0, 180.0))
    v = rows(db, "SELECT samples, max_error, t_junctions, overlaps, uncovered FROM rqt_verify(rqt_circle(100, 88, 400000), 50, 'globe')")[0]
    check("F28 a circle over the pole is a sound patch", v[0] > 1000 and v[1] <= 50 and v[2:] == (0, 0, 0), v)
    v = rows(db, "SELECT samples, max_error, t_junctions, overlaps, uncovered FROM rqt_verify(rqt_corridor("
             "'LINESTRING(170 50, -170 60)', 300000), 50, 'globe')")[0]
    check("F25 a corridor across the antimeridian is a sound patch", v[0] > 100 and v[1] <= 50 and v[2:] == (0, 0, 0), v)
    other.close()


def corridors(db):
    text = "'LINESTRING(-71.4 44.2, -71.3 44.27, -71.35 44.31)'"
    db.load_extension("mod_spatialite")
    for cast in (text, "ST_GeomFromText(%s, 4326)" % text, "AsGPB(ST_GeomFromText(%s, 4326))" % text, "'SRID=4326;' || " + text):
        equal("corridors: of %.40s" % cast, one(db, "SELECT hex(rqt_corridor(%s, 300)) = hex(rqt_corridor(%s, 300))" % (cast, text)), 1)
    spatial = connect()
    spatial.load_extension("mod_spatialite")
    spatial.execute("SELECT InitSpatialMetaData(1, 'WGS84_ONLY')")
    valid, area = one(spatial, "SELECT ST_IsValid(GeomFromGPB(g)), ST_Area(GeomFromGPB(g), 1) FROM (SELECT rqt_corridor(%s, 300) AS g)"
                      % text)
    spatial.close()
    check("corridors: valid for SpatiaLite", valid == 1, valid)
    mine = one(db, "SELECT planimetric FROM rqt_area(rqt_corridor(%s, 300), 50, 'land')" % text)
    near("corridors: SpatiaLite's geodesic area, as near as its method comes", mine, (area,), 1e-5)
    for value, metres, sentence in (("NULL", "1", "line must be WKT text or a geometry; it is NULL"), ("rqt_bbox(0,0,1,1)", "1", "polygon"),
                                    (text, "NULL", "metres must be a number; it is NULL"), (text, "0", "radius"),
                                    (text, "-5", "radius"), ("'SRID=3857;LINESTRING(0 0, 1 1)'", "1", "line must be in SRID 4326"),
                                    ("'LINESTRING(0 0, 0 91)'", "1", "latitude")):
        raises("corridors: %s, %s is refused" % (value[:30], metres), sentence, lambda: one(db, "SELECT rqt_corridor(%s, %s)" % (value, metres)))


# -------------------------------------------------------------------------------------------------------------------- frames

def ecef(lon, lat, h):
    e2 = F * (2 - F)
    # exact where it matters, at the poles and on the seam
    sp, cp = (math.copysign(1, lat), 0.0) if abs(lat) == 90 else (math.sin(math.radians(lat)), math.cos(math.radians(lat)))
    n = A / math.sqrt(1 - e2 * sp * sp)
    return ((n + h) * cp * math.cos(math.radians(lon)), (n + h) * cp * math.sin(math.radians(lon)), (n * (1 - e2) + h) * sp)


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def minus(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def distance(p, t):
    """Of a point from a triangle in space."""
    a, b, c = t
    u, v, w = minus(b, a), minus(c, a), minus(p, a)
    n = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
    uu, uv, vv, wu, wv = dot(u, u), dot(u, v), dot(v, v), dot(w, u), dot(w, v)
    d = uu * vv - uv * uv
    s, r = (vv * wu - uv * wv) / d, (uu * wv - uv * wu) / d
    if s >= 0 and r >= 0 and s + r <= 1:
        return abs(dot(w, n)) / math.sqrt(dot(n, n))
    best = math.inf
    for x, y in ((a, b), (b, c), (c, a)):
        e, f = minus(y, x), minus(p, x)
        k = max(0.0, min(1.0, dot(e, f) / dot(e, e)))
        g = minus(f, (k * e[0], k * e[1], k * e[2]))
        best = min(best, math.sqrt(dot(g, g)))
    return best


def prove_in_space(db, eps, terrain, heights, place, step=1):
    """Of a whole mesh and every step-th sample: the largest distance of a sample from the triangle over it, the longest edge, and what does not close."""
    options = '{"frame":"ecef"}'
    spot = {r[:3]: r[3:] for r in rows(db, "SELECT x, y, z, col, row FROM rqt_range(NULL, ?, ?, ?)", eps, terrain, options)}
    triangles = [(r[1:4], r[4:7], r[7:10]) for r in rows(db, "SELECT * FROM rqt_triangles(NULL, ?, ?, ?)", eps, terrain, options)]
    width, last = len(heights[0]), len(heights) - 1
    worst = longest = 0.0
    edges, seen, polar = {}, set(), []
    for t in triangles:
        for i in range(3):
            edge = t[i], t[(i + 1) % 3]
            edges[edge] = edges.get(edge, 0) + 1
            longest = max(longest, math.sqrt(dot(minus(*edge), minus(*edge))))
        c = [spot[v] for v in t]
        if place(*c[0])[1] in (90, -90) or place(*c[1])[1] in (90, -90) or place(*c[2])[1] in (90, -90):
            polar.append(t)
            continue
        if max(v[0] for v in c) - min(v[0] for v in c) > width // 2 and place(width - 1, 0)[0] - place(0, 0)[0] == 360:
            c = [(v[0] + (width - 1 if v[0] == 0 else 0), v[1]) for v in c]
        for row in range(min(v[1] for v in c), max(v[1] for v in c) + 1):
            for col in range(min(v[0] for v in c), max(v[0] for v in c) + 1):
                if (col + row) % step:
                    continue
                w = [cross(c[i], c[(i + 1) % 3], (col, row)) for i in range(3)]
                if max(w) <= 0 and heights[row][col] is not None:
                    worst = max(worst, distance(ecef(*place(col, row), heights[row][col]), t))
                    seen.add((col, row))
    lone = sum(edges.get((b, a), 0) != n or n != 1 for (a, b), n in edges.items())
    return worst, longest, lone, len(triangles), len(spot), seen, polar, len(edges)


def frames():
    path = temp("space.gpkg")
    flat = [[500] * 65 for _ in range(65)]
    hills = [[int(900 + 300 * math.sin(i / 11) * math.cos(j / 13) + dice.below(3)) for i in range(97)] for j in range(97)]
    wide = [[int(1500 + 1500 * math.sin(i / 9) * math.cos(j / 7)) for i in range(65)] for j in range(65)]
    second, ends = 1 / 3600, []
    grids = {"flat": (flat, 0.01, 8, 46), "tile": (hills, second, -71.5, 44.25), "wide": (wide, 0.25, 100, -60)}
    for name, (grid, cell, x0, y0) in grids.items():
        import_terrain(path, write_grid(temp(name + ".asc"), grid, x0=x0, y0=y0, cell=cell, crs=WGS84), name=name, block=3)
    compound = ('COMPD_CS["WGS 84 + EGM96 height",%s,VERT_CS["EGM96 height",VERT_DATUM["EGM96 geoid",2005,AUTHORITY["EPSG","5171"]],'
                'UNIT["metre",1,AUTHORITY["EPSG","9001"]],AXIS["Gravity-related height",UP],AUTHORITY["EPSG","5773"]]]' % WGS84)
    import_terrain(path, write_grid(temp("geoid.asc"), hills, x0=8, y0=46, cell=0.02, crs=compound), name="geoid", block=3)
    import_terrain(path, write_grid(temp("navd.asc"), flat, x0=8, y0=46, cell=0.01, crs=compound.replace("EGM96", "NAVD88")), name="navd")
    import_terrain(path, os.path.join(DATA, "etopo1_1deg.tif"), name="globe", block=4)
    db = connect(path)
    for name, eps, most in (("flat", 1, 512), ("flat", 20, 32), ("tile", 3, 4700), ("tile", 8, 1500), ("wide", 500, 1024)):
        grid, cell, x0, y0 = grids[name]
        x, y, dx, dy = one(db, "SELECT x0, y0, dx, dy FROM rqt_terrains WHERE name = ?", name)
        worst, longest, _, triangles, vertices, seen, _, _ = prove_in_space(db, eps, name, grid, lambda c, r: (x + c * dx, y + r * dy))
        check("F29 %s: every sample within %g m in space" % (name, eps), worst <= eps and len(seen) == len(grid) * len(grid[0]),
              (worst, longest, len(seen)))
        ends.append(longest)
        print("   %s at %g m: worst %.4g m, longest edge %.0f m, %d triangles" % (name, eps, worst, longest, triangles))
        check("F29 %s: no more triangles than curvature needs at %g" % (name, eps), triangles <= most, triangles)
    check("F29 edges from hundreds of metres to a hundred kilometres", min(ends) < 1500 and max(ends) > 1e5, ends)
    grid, cell, x0, y0 = grids["flat"]
    equal("F29 without curvature two triangles would do", one(db, "SELECT count(*) FROM rqt_triangles(NULL, 1, 'flat')"), 2)
    # enu is ecef, turned and moved: the same mesh, the origin where the file says
    a = rows(db, "SELECT x, y, z FROM rqt_range(NULL, 20, 'flat', '{\"frame\":\"enu\"}')")
    b = rows(db, "SELECT x, y, z FROM rqt_range(NULL, 20, 'flat', '{\"frame\":\"ecef\"}')")
    off = max(abs(math.dist(a[0], p) - math.dist(b[0], q)) for p, q in zip(a, b))
    check("frame enu: the same shape as ecef", len(a) == len(b) and off < 1e-6, off)
    text = one(db, "SELECT rqt_mesh(NULL, 20, 'obj', 'flat', '{\"frame\":\"enu\"}')")
    check("frame enu: the file tells its origin", "# terrain flat, frame enu about longitude 8.32 latitude 46.32 height 0\n" in text, text[:90])
    up = ecef(8.32, 46.32, 500)
    middle = min(b, key=lambda p: math.dist(p, up))
    check("frame enu: up is z", abs(a[b.index(middle)][2] - 500) < 1 and all(p[2] < 501 for p in a), a[b.index(middle)])
    equal("frame ecef: obj has the vertices of rqt_range", text.count("\nv "), len(a))
    blob = one(db, "SELECT rqt_mesh(NULL, 20, 'gpkg', 'flat', '{\"frame\":\"ecef\"}')")
    equal("frame ecef: its SRID", struct.unpack("<i", blob[4:8])[0], 4978)
    for form in ("strip", "indexed", "rqt"):
        raises("frame: %s is refused" % form, "rqt_mesh(): format \"%s\" holds samples" % form,
               lambda: one(db, "SELECT rqt_mesh(NULL, 20, ?, 'flat', '{\"frame\":\"enu\"}')", form))
    strip = rows(db, "SELECT x, y, z FROM rqt_strip(NULL, 1, 'flat', '{\"frame\":\"ecef\"}')")
    listed = {frozenset((r[1:4], r[4:7], r[7:10])) for r in rows(db, "SELECT * FROM rqt_triangles(NULL, 1, 'flat', '{\"frame\":\"ecef\"}')")}
    equal("frame ecef: the strip has the same triangles", {frozenset(t) for t in zip(strip, strip[1:], strip[2:]) if len(set(t)) == 3}, listed)
    # parts of one mesh
    parts = [set(rows(db, "SELECT x0,y0,z0,x1,y1,z1,x2,y2,z2 FROM rqt_triangles(%s, 8, 'tile', '{\"frame\":\"ecef\"}')" % region))
             for region in ("NULL", "rqt_bbox(-71.49, 44.26, -71.48, 44.27)", "rqt_bbox(-71.483, 44.26, -71.47, 44.27)")]
    check("frame ecef: answers are parts of one mesh", parts[1] < parts[0] and parts[2] < parts[0] and parts[1] & parts[2])
    # the geoid
    x, y, dx, dy = one(db, "SELECT x0, y0, dx, dy FROM rqt_terrains WHERE name = 'geoid'")
    some = rows(db, "SELECT x, y, z, col, row FROM rqt_range(NULL, 50, 'geoid', '{\"frame\":\"ecef\"}')")[::9]
    given = "\n".join("%r %r %r" % (x + c * dx, y + r * dy, float(hills[r][c])) for _, _, _, c, r in some)
    said, status = run(["gdaltransform", "-s_srs", "EPSG:4326+5773", "-t_srs", "EPSG:4978"], text=given)
    theirs = [tuple(map(float, line.split())) for line in said.splitlines()]
    off = max((math.dist(p[:3], q) for p, q in zip(some, theirs)), default=9)
    check("frames: heights above EGM96, as gdaltransform has them", len(theirs) == len(some) and off < 1e-3, (off, said[:80]))

    def undulated(c, r):
        return x + c * dx, y + r * dy
    said, status = run(["gdaltransform", "-s_srs", "EPSG:4326+5773", "-t_srs", "EPSG:4979"], text="\n".join(
        "%r %r 0" % undulated(c, r) for r in range(97) for c in range(97)))
    numbers = [float(line.split()[2]) for line in said.splitlines()]
    under = [[hills[r][c] + numbers[97 * r + c] for c in range(97)] for r in range(97)]
    for eps in (20,):
        worst, longest, _, _, _, seen, _, _ = prove_in_space(db, eps, "geoid", under, undulated)
        check("F29 above the geoid: every sample within %d m in space" % eps, worst <= eps and len(seen) == 97 * 97, (worst, longest))
    empty = temp("no-proj")
    os.mkdir(empty)
    code = ("import sys; sys.path.insert(0, %r)\nfrom sql_support import *\ndb = connect(%r)\ntry:\n  one(db, \"SELECT count(*) FROM "
            "rqt_range(NULL, 50, 'geoid', '{\\\"frame\\\":\\\"ecef\\\"}')\")\nexcept Exception as e: print(e)" % (os.path.dirname(os.path.abspath(__file__)), path))
    said, status = run(["/usr/bin/python3", "-c", code], {"PROJ_DATA": empty, "PROJ_LIB": empty})
    check("frames: without PROJ's grid, a sentence", "egm96_15.gtx" in said and "rqt_range(): option" in said, said)
    raises("frames: other vertical datums are refused", 'the heights of terrain navd are "NAVD88 height"',
           lambda: one(db, "SELECT count(*) FROM rqt_range(NULL, 50, 'navd', '{\"frame\":\"ecef\"}')"))
    raises("frames: terrains that are not on WGS 84 are refused", "is for terrains in longitude and latitude on WGS 84",
           lambda: one(connect(temp("areas.gpkg")), "SELECT count(*) FROM rqt_range(NULL, 50, 'tilt', '{\"frame\":\"ecef\"}')"))
    raises("frames: an unknown one is refused", 'option "frame" has no value "mars"',
           lambda: one(db, "SELECT count(*) FROM rqt_range(NULL, 50, 'flat', '{\"frame\":\"mars\"}')"))
    equal("frames: crs is the default", rows(db, "SELECT * FROM rqt_range(NULL, 5, 'tile', '{\"frame\":\"crs\"}')"),
          rows(db, "SELECT * FROM rqt_range(NULL, 5, 'tile')"))
    # the whole Earth: one closed surface
    x, y, dx, dy = one(db, "SELECT x0, y0, dx, dy FROM rqt_terrains WHERE name = 'globe'")
    globe = [[None] * 361 for _ in range(181)]
    for c, r, z in rows(db, "SELECT col, row, z FROM rqt_range(NULL, 0, 'globe')"):
        globe[r][c] = z
    for eps in (150, 1500):
        worst, longest, lone, triangles, vertices, seen, polar, edges = prove_in_space(
            db, eps, "globe", globe, lambda c, r: (x + c * dx, y + r * dy), 5)
        check("F29 the Earth: every sample within %d m in space" % eps, worst <= eps and len(seen) > 5000, (worst, longest, len(seen)))
        equal("F28 the Earth at %d: closed at seam and poles, every edge between two triangles" % eps, lone, 0)
        equal("F28 the Earth at %d: one sphere (Euler)" % eps, vertices - edges // 2 + triangles, 2)
        equal("F28 the Earth at %d: a pole is one vertex" % eps,
              rows(db, "SELECT count(*), min(z), max(z) FROM rqt_range(NULL, ?, 'globe', '{\"frame\":\"ecef\"}') WHERE abs(x) < 1e-3 "
                   "AND abs(y) < 1e-3", eps)[0][0], 2)
        slivers = sum(len(set(t)) < 3 for t in polar)
        check("F28 the Earth at %d: no slivers at the poles" % eps, slivers == 0 and polar, slivers)
    # relief on one side of the seam only: what it asks for there, the other side must have too
    own = Dice(SEED + 1)
    for amplitude in (60000, 30000):
        name = "lopsided%d" % amplitude
        grid = [[own.below(2 * amplitude) - amplitude if 60 < i < 72 and 0 < j < 36 and (7 * j + i) % 5 == 0 else 0 for i in range(73)]
                for j in range(37)]
        import_terrain(path, write_grid(temp(name + ".asc"), grid, x0=-180, y0=-90, cell=5, crs=WGS84), name=name, block=3)
        for eps in (60000, 120000, 200000):
            _, _, lone, triangles, vertices, _, _, edges = prove_in_space(db, eps, name, grid, lambda c, r: (c * 5 - 180, 90 - r * 5), 50)
            equal("F28 relief beside the seam, %s at %d: closed, a sphere" % (name, eps), (lone, vertices - edges // 2 + triangles), (0, 2))
            check("F28 relief beside the seam, %s at %d: not all of the grid" % (name, eps), vertices < 1500, vertices)
    near_seam = "rqt_bbox(170, -10, -170, 10, 4326)"
    whole = set(rows(db, "SELECT x0,y0,z0,x1,y1,z1,x2,y2,z2 FROM rqt_triangles(NULL, 400, 'globe', '{\"frame\":\"ecef\"}')"))
    east = set(rows(db, "SELECT x0,y0,z0,x1,y1,z1,x2,y2,z2 FROM rqt_triangles(rqt_bbox(170, -10, 180, 10), 400, 'globe', '{\"frame\":\"ecef\"}')"))
    both = set(rows(db, "SELECT x0,y0,z0,x1,y1,z1,x2,y2,z2 FROM rqt_triangles(%s, 400, 'globe', '{\"frame\":\"ecef\"}')" % near_seam))
    check("F28 regions at the seam are parts of the closed mesh", east < both < whole and east)
    raises("F28 copies of the seam that differ by more than eps are refused", "differ by up to 1.0 metres; eps must be at least that",
           lambda: one(db, "SELECT count(*) FROM rqt_range(NULL, 0.5, 'globe', '{\"frame\":\"ecef\"}')"))
    raises("F28 so is a place of detail with so small an eps", "eps must be at least that",
           lambda: one(db, "SELECT count(*) FROM rqt_range(NULL, 50, 'globe', '{\"frame\":\"ecef\",\"detail\":[[\"POINT(0 0)\",0.5]]}')"))
    fine, coarse = (one(db, "SELECT count(*) FROM rqt_range(NULL, 2000, 'globe', ?)", '{"frame":"ecef"%s}' % more) for more in
                    (',"detail":[["POINT(10 50)",100]]', ""))
    check("frames: places of detail are finer in space too", fine > coarse, (fine, coarse))
    raises("frames: not with mode cut", 'option "frame" does not go with mode "cut"',
           lambda: one(db, "SELECT count(*) FROM rqt_range(NULL, 50, 'globe', '{\"frame\":\"ecef\",\"mode\":\"cut\"}')"))
    for more in ('"metric":"local"', '"metric":"minimal"', '"metric":"euclid"'):
        raises("frames: not with %s, which proves nothing of them" % more, 'option "frame" needs the metric exact or wedgie',
               lambda: one(db, "SELECT count(*) FROM rqt_range(NULL, 50, 'tile', ?)", '{"frame":"ecef",%s}' % more))
    raises("frames: no budget where the Earth closes", 'option "max_vertices" does not go with option "frame"',
           lambda: one(db, "SELECT count(*) FROM rqt_range(NULL, 50, 'globe', '{\"frame\":\"ecef\",\"max_vertices\":1000}')"))
    check("frames: a budget elsewhere", one(db, "SELECT count(*) FROM rqt_range(NULL, 0, 'tile', "
                                            "'{\"frame\":\"ecef\",\"max_vertices\":100}')") <= 100)
    # 14 rows of 180/13 degrees: the first comes out as 90.00000000000003
    import_terrain(path, write_grid(temp("past.asc"), [[5] * 14 for _ in range(14)], y0=-90, cell=180 / 13, crs=WGS84), name="past",
                   block=2)
    check("F28 a row beyond the pole by a rounding, to begin with", one(db, "SELECT y0 FROM rqt_terrains WHERE name = 'past'") > 90)
    try:
        seen = one(db, "SELECT count(*), min(abs(z)) > 6356000 FROM rqt_range(NULL, 1e6, 'past', '{\"frame\":\"ecef\"}') "
                       "WHERE abs(x) < 1e-3 AND abs(y) < 1e-3")
    except Exception as error:
        seen = str(error)
    equal("F28 a row beyond the pole by a rounding is the pole", seen, (2, 1))
    db.close()


def main():
    areas_in_the_plane()
    areas_on_the_ellipsoid()
    frames()
    profiles_in_the_plane()
    path = temp("earth.gpkg")
    import_terrain(path, os.path.join(os.path.dirname(DATA), "..", "examples", "N44W072.hgt.zip"), name="land")
    import_terrain(path, os.path.join(DATA, "etopo1_1deg.tif"), name="globe", block=4)
    db = connect(path)
    profiles_on_the_ellipsoid(db)
    F25_profiles_across_the_antimeridian(db)
    regions_on_every_turn(db)
    corridors(db)
    finish()


main()
