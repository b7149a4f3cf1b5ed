#!/usr/bin/python3
"""Views of random terrains by random cameras: odd sizes, spikes and cliffs, blocks of any size, metres, feet and degrees; eyes on, in and below
the ground. No sample that is drawn is further than tau from its place in the mesh, or without a triangle; no edge is used twice or has a vertex
in it; another connection gives the same bytes."""
import json
import math
import os
import random

import sql_support as s
from sql_support import check, one, rows

SEED = int(os.environ.get("RQT_SEED", "2026"))
print("RQT_SEED=%d" % SEED)
dice = random.Random(SEED)
A, F = 6378137.0, 1 / 298.257223563
FEET = 'PROJCS["feet",GEOGCS["g",DATUM["d",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],' \
       'PROJECTION["Transverse_Mercator"],PARAMETER["central_meridian",9],UNIT["foot",0.3048]]'
SYSTEMS = {"none": (None, 1), "feet": (FEET, 0.3048), "degrees": (s.WGS84, None)}


def ecef(lon, lat, h):
    e2, u, v = F * (2 - F), math.radians(lon), math.radians(lat)
    n = A / math.sqrt(1 - e2 * math.sin(v) ** 2)
    return ((n + h) * math.cos(v) * math.cos(u), (n + h) * math.cos(v) * math.sin(u), (n * (1 - e2) + h) * math.sin(v))


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def mix(a, p, b, q):
    return tuple(a * x + b * y for x, y in zip(p, q))


def projection(given, scene, degrees):
    """Of a point of the scene: x and y in pixels from the middle, depth, and is it drawn? The camera has yaw and pitch."""
    eye, (lon, lat) = scene(*given["eye"]), (math.radians(c) for c in given["eye"][:2])
    east = (-math.sin(lon), math.cos(lon), 0) if degrees else (1, 0, 0)
    up = (math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)) if degrees else (0, 0, 1)
    yaw, pitch, fovy = (math.radians(given[key]) for key in ("yaw", "pitch", "fovy"))
    right = mix(math.cos(yaw), east, -math.sin(yaw), cross(up, east))
    ahead = mix(math.sin(yaw), east, math.cos(yaw), cross(up, east))
    forward, above = mix(math.cos(pitch), ahead, math.sin(pitch), up), mix(-math.sin(pitch), ahead, math.cos(pitch), up)
    focal = given["height"] / (2 * math.tan(fovy / 2))

    def project(p):
        v = mix(1, p, -1, eye)
        depth = dot(v, forward)
        if depth <= 0:
            return 0, 0, depth, False
        x, y = focal * dot(v, right) / depth, focal * dot(v, above) / depth
        return x, y, depth, (abs(x) < given["width"] / 2 - 1e-6 and abs(y) < given["height"] / 2 - 1e-6
                             and given["near"] < depth < given["far"])
    return project


def judge(found, grid, at, scene, project, k, tau):
    """The worst displacement over tau, how many samples are drawn, what is wrong with edges, how many are missed."""
    x0, y0, dx, dy = at
    known, edges, worst, drawn = set(), set(), 0.0, 0
    spot = lambda c, r: scene(x0 + c * dx, y0 + r * dy, grid[r][c] * k)
    for row in found:
        (xa, ya), (xb, yb), (xc, yc) = corners = [(round((row[i] - x0) / dx), round((row[i + 1] - y0) / dy)) for i in (0, 3, 6)]
        area = (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya)
        for i in range(3):
            edge = corners[i], corners[(i + 1) % 3]
            if edge in edges:
                return math.inf, 0, "an edge twice", 0
            edges.add(edge)
        places = [spot(*c) for c in corners]
        for r in range(min(ya, yb, yc), max(ya, yb, yc) + 1):
            for c in range(min(xa, xb, xc), max(xa, xb, xc) + 1):
                u, v = (c - xa) * (yc - ya) - (xc - xa) * (r - ya), (xb - xa) * (r - ya) - (c - xa) * (yb - ya)
                if u * area < 0 or v * area < 0 or abs(u + v) > abs(area):
                    continue
                known.add((c, r))
                p = project(spot(c, r))
                q = project(mix(1 - (u + v) / area, places[0], 1, mix(u / area, places[1], v / area, places[2])))
                if (c, r) not in corners and (p[3] or q[3]):
                    drawn += 1
                    worst = max(worst, math.hypot(p[0] - q[0], p[1] - q[1]) / tau if p[2] > 0 and q[2] > 0 else math.inf)
    rim = [e for e in edges if (e[1], e[0]) not in edges]
    ends = {p for e in rim for p in e}
    for (xa, ya), (xb, yb) in rim:
        steps = math.gcd(xb - xa, yb - ya)
        if any((xa + (xb - xa) // steps * i, ya + (yb - ya) // steps * i) in ends for i in range(1, steps)):
            return worst, drawn, "a vertex in an edge", 0
    missed = sum((c, r) not in known and project(spot(c, r))[3] for r in range(len(grid)) for c in range(len(grid[0])))
    return worst, drawn, "", missed


used = 0
for n in range(14):
    system = ("none", "feet", "degrees")[n % 3]
    crs, metre = SYSTEMS[system]
    w, h = dice.choice((2, 5, 17, 33, dice.randint(3, 40))), dice.choice((2, 9, 17, dice.randint(3, 40)))
    cell = 10 ** dice.uniform(-4, -2) if crs == s.WGS84 else 10 ** dice.uniform(0, 2)
    kind = dice.randrange(3)
    grid = [[(1500 if dice.random() < 0.03 else 0) if kind == 0 else (800 if c + 2 * r > w else 0) + dice.randrange(4) if kind == 1 else
             round(200 * math.sin(c / 5) + 150 * math.cos(r / 7 + c / 9)) for c in range(w)] for r in range(h)]
    x0, y0 = (9.0, 47.0) if crs == s.WGS84 else (500000.0, 4000.0)
    base = s.temp("attack%d.gpkg" % n)
    s.import_terrain(base, s.write_grid(s.temp("attack%d.asc" % n), grid, x0, y0, cell, crs), name="t", block=dice.randint(1, 5))
    db = s.connect(base)
    at = one(db, "SELECT x0, y0, dx, dy FROM rqt_terrains")
    scene = ecef if crs == s.WGS84 else lambda x, y, z: (x * metre, y * metre, z)
    size = max(w, h) * cell * (111000 if crs == s.WGS84 else metre)
    for m in range(8):
        k = dice.choice((1, 1, 0.2, 5))
        c, r = dice.randrange(w), dice.randrange(h)
        low, high = (k * f(map(f, grid)) for f in (min, max))
        z = dice.choice((grid[r][c] * k + dice.choice((0.5, 20)), high + size * 10 ** dice.uniform(-1, 1), dice.uniform(low, high), low - 50))
        given = dict(eye=[at[0] + (c + dice.choice((0, 0.3))) * at[2], at[1] + r * at[3], z], yaw=dice.uniform(0, 360),
                     pitch=dice.choice((-90, -60, -20, 0, dice.uniform(-90, 90))), fovy=dice.choice((10, 45, 90, 150)), width=640, height=480,
                     tau=10 ** dice.uniform(-1, 2), near=dice.choice((0, size / 20)), far=dice.choice((1e12, size)), exaggeration=k)
        view = json.dumps(given)
        found = rows(db, "SELECT x0, y0, z0, x1, y1, z1, x2, y2, z2 FROM rqt_view_triangles(?)", view)
        seen = judge(found, grid, at, scene, projection(given, scene, crs == s.WGS84), k, given["tau"])
        used += seen[1]
        if seen[0] > 1 or seen[2] or seen[3]:
            check("terrain %d (%s, %d x %d), view %d: (worst/tau, drawn, edges, missed)" % (n, system, w, h, m), False, (seen, view))
        if m == 0:
            fresh = s.connect(base)
            check("terrain %d: another connection says the same" % n, one(db, "SELECT rqt_view_mesh(?, 'rqt')", view)
                  == one(fresh, "SELECT rqt_view_mesh(?, 'rqt')", view))
            fresh.close()
    db.close()
check("views of random terrains: samples that are no vertices were drawn", used > 3000, used)
s.finish()
