"""Tiles for globes: decoded from their bytes alone (tiles_support.py), and put beside the rasters that they are of.

Errors are measured at every sample, and places in space are computed here: nothing is asked of the program but tiles.
"""
import bisect
import json
import math
import os
import random
from fractions import Fraction

import serve_support as service
import sql_support as s
from tiles_support import A, B, E2, UNITS, Pyramid, bare_middles, coast, dot, files, listed, minus, pyramid, told_by, window

SEED = int(os.environ.get("RQT_SEED", "1"))
print("seed %d" % SEED)
RANDOM = random.Random(SEED)


def distance_to_triangle(p, a, b, c):
    """Of a point in space (Ericson, Real-Time Collision Detection, 5.1.5)."""
    ab, ac, ap = minus(b, a), minus(c, a), minus(p, a)
    d1, d2 = dot(ab, ap), dot(ac, ap)

    def to(base, way=None, t=0.0):
        q = base if way is None else tuple(base[k] + t * way[k] for k in range(3))
        return math.dist(p, q)
    if d1 <= 0 and d2 <= 0:
        return to(a)
    bp = minus(p, b)
    d3, d4 = dot(ab, bp), dot(ac, bp)
    if d3 >= 0 and d4 <= d3:
        return to(b)
    if d1 * d4 - d3 * d2 <= 0 <= d1 and d3 <= 0:
        return to(a, ab, d1 / (d1 - d3))
    cp = minus(p, c)
    d5, d6 = dot(ab, cp), dot(ac, cp)
    if d6 >= 0 and d5 <= d6:
        return to(c)
    if d5 * d2 - d1 * d6 <= 0 <= d2 and d6 <= 0:
        return to(a, ac, d2 / (d2 - d6))
    va = d3 * d6 - d5 * d4
    if va <= 0 and d4 >= d3 and d5 >= d6:
        return to(b, minus(c, b), (d4 - d3) / ((d4 - d3) + (d5 - d6)))
    vb, vc = d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    total = va + vb + vc
    if total == 0:
        return min(to(a), to(b), to(c))
    v, w = vb / total, vc / total
    return math.dist(p, tuple(a[k] + v * ab[k] + w * ac[k] for k in range(3)))


def measure(p, tile):
    """Every sample of the tile beside its mesh: the largest share of what is allowed above or below it, and in space; samples
    that lie well inside and have no mesh. Samples outside the mesh's outline count for nothing."""
    height, width = len(p.raster), len(p.raster[0])
    cols = [c for c in range(width) if 0 <= p.x0 + c * p.dx - tile.west <= tile.side]
    rows = [r for r in reversed(range(height)) if 0 <= p.y0 + r * p.dy - tile.south <= tile.side]
    us = [(p.x0 + c * p.dx - tile.west) / tile.side * UNITS for c in cols]
    vs = [(p.y0 + r * p.dy - tile.south) / tile.side * UNITS for r in rows]
    vertical, space, covered = 0.0, 0.0, set()
    allowed, error = tile.metadata["verticalError"], tile.metadata["error"]
    doubtful = []
    for a, b, c in tile.triangles:
        ua, va, ub, vb, uc, vc = tile.u[a], tile.v[a], tile.u[b], tile.v[b], tile.u[c], tile.v[c]
        area = (ub - ua) * (vc - va) - (uc - ua) * (vb - va)
        if area == 0:
            continue
        i0, i1 = bisect.bisect_left(us, min(ua, ub, uc)), bisect.bisect_right(us, max(ua, ub, uc))
        j0, j1 = bisect.bisect_left(vs, min(va, vb, vc)), bisect.bisect_right(vs, max(va, vb, vc))
        for j in range(j0, j1):
            v = vs[j]
            for i in range(i0, i1):
                u = us[i]
                wb = ((u - ua) * (vc - va) - (uc - ua) * (v - va)) / area
                wc = ((ub - ua) * (v - va) - (u - ua) * (vb - va)) / area
                if wb < -1e-9 or wc < -1e-9 or wb + wc > 1 + 1e-9:
                    continue
                z = p.raster[rows[j]][cols[i]]
                if z is None:
                    continue
                wa = 1 - wb - wc
                covered.add((cols[i], rows[j]))
                vertical = max(vertical, abs(wa * tile.places[a][2] + wb * tile.places[b][2] + wc * tile.places[c][2] - z) / allowed)
                xa, xb, xc = tile.xyz[a], tile.xyz[b], tile.xyz[c]
                d = math.dist(p.place(cols[i], rows[j]), [wa * xa[k] + wb * xb[k] + wc * xc[k] for k in range(3)])
                if d <= error:
                    space = max(space, d / error)
                else:
                    doubtful.append((cols[i], rows[j]))
    for col, row in doubtful: # nearer to another place of the mesh?
        q = p.place(col, row)
        space = max(space, min(distance_to_triangle(q, *(tile.xyz[k] for k in t)) for t in tile.triangles) / error)
    far = [(c, r) for i, c in enumerate(cols) for j, r in enumerate(rows)
           if 1 < us[i] < UNITS - 1 and 1 < vs[j] < UNITS - 1 and 0 < c < width - 1 and 0 < r < height - 1 and p.raster[r][c] is not None]
    unit = tile.side / UNITS
    inner = [(c, r) for c, r in far if min(c, width - 1 - c) * p.dx > unit and min(r, height - 1 - r) * -p.dy > unit]
    return vertical, space, sum(1 for q in inner if q not in covered), len(covered)


def is_hidden(camera, point):
    """Does a client take it to be below the horizon? All scaled so that the Earth is a sphere of radius 1."""
    to = minus(point, camera)
    along, horizon = -dot(to, camera), dot(camera, camera) - 1
    square = dot(to, to)
    return along > horizon and (math.nan if math.isinf(square) else along * along / square) > horizon


def is_point_hidden(camera, point):
    """Truly, exactly enough: the sphere meets the line between the two."""
    length = math.sqrt(dot(point, point))
    if length < 1:
        point = tuple(c / length for c in point)
    way = minus(point, camera)
    t = max(0.0, min(1.0, -dot(camera, way) / dot(way, way)))
    nearest = tuple(camera[k] + t * way[k] for k in range(3))
    return dot(nearest, nearest) < 1 + 1e-12


def scaled(xyz):
    return xyz[0] / A, xyz[1] / A, xyz[2] / B


def horizon_fails(tile, cameras):
    """Cameras for which the tile counts as hidden and is not; and for how many it counts as hidden."""
    places = [scaled(q) for q in tile.xyz]
    wrong = hidden = 0
    centre = scaled(tile.centre)
    length = math.sqrt(dot(centre, centre))
    d = tuple(c / length for c in centre)
    side = (d[1], -d[0], 0) if abs(d[2]) < 0.9 else (0, d[2], -d[1])
    side = tuple(c / math.sqrt(dot(side, side)) for c in side)
    up = (d[1] * side[2] - d[2] * side[1], d[2] * side[0] - d[0] * side[2], d[0] * side[1] - d[1] * side[0])
    for _ in range(cameras):
        distance = 1 + 10 ** RANDOM.uniform(-5, 1)
        # Near the angle at which it sinks below the horizon.
        angle = math.acos(1 / distance) + (RANDOM.uniform(-0.02, 0.1) if RANDOM.random() < 0.8 else RANDOM.uniform(0, 3))
        turn = RANDOM.uniform(0, 2 * math.pi)
        way = tuple(math.cos(turn) * side[k] + math.sin(turn) * up[k] for k in range(3))
        camera = tuple(distance * (math.cos(angle) * d[k] + math.sin(angle) * way[k]) for k in range(3))
        if is_hidden(camera, tile.horizon):
            hidden += 1
            wrong += not all(is_point_hidden(camera, q) for q in places)
    return wrong, hidden


SIDES = [("u", 0), ("v", 0), ("u", UNITS), ("v", UNITS)]


def edge_of(tile, side):
    """Decoded places and normals of the vertices of an edge, without the coordinate that the edge fixes: that is a double of
    its own in each tile, and equal for powers of two."""
    return [(tile.places[i], bytes(tile.extensions[1][2 * i:2 * i + 2])) for i in tile.edges[side]]


def check_pyramid(p, is_whole, vertices_too=True):
    name, tiles = p.name, p.tiles
    every = list(tiles.values())
    if not s.equal(name + ": every tile is as the format has it", [(t.z, t.x, t.y, t.problem) for t in every if t.problem], []):
        s.finish()
    s.equal(name + ": listed and there are the same tiles, each once", sorted(listed(p.layer)), sorted([*tiles, *p.empty]))
    roots = {t.x: t for t in [*every, *p.empty.values()] if t.z == 0}
    s.equal(name + ": both tiles of level 0 are there, one without terrain has specks alone", (sorted(roots), [t.count for t in p.empty.values()]), ([0, 1], [16] * len(p.empty)))
    s.equal(name + ": a speck where, and only where, no triangle comes near the middle of a sixteenth",
            [(t.z, t.x, t.y) for t in [*every, *p.empty.values()] if [(t.u[i], t.v[i]) for i in t.specks] != bare_middles(t)], [])
    s.check(name + ": ... at a height that the tile has", all(t.h[i] in t.h[:t.count - len(t.specks)] for t in every for i in t.specks))
    s.equal(name + ": ... and each tells of those below it, so that all that are there are told of", sorted(told_by(roots)), sorted(k for k in tiles if k[0] > 0))
    s.equal(name + ": ... as clients are told that they do", p.layer["metadataAvailability"], len(p.layer["available"]))
    s.equal(name + ": every tile has a triangle", [(t.z, t.x, t.y) for t in every if not t.triangles], [])
    wrong = [(t.z, t.x, t.y, side) for t in every for side, (axis, value) in enumerate(SIDES)
             if sorted(t.edges[side]) != [i for i, n in enumerate(getattr(t, axis)) if n == value]]
    s.equal(name + ": the lists of sides are the vertices at 0 and 32767", wrong, [])
    # One step for all; its ends are floats.
    heads = {(t.low, t.high) for t in every}
    step = every[0].step
    s.check(name + ": all tiles have one range of heights, 32767 steps of a power of two",
            len(heads) == 1 and math.frexp(step)[0] == 0.5 and step == every[0].metadata["heightStep"], heads)
    s.check(name + ": what is stated is no more than what clients take the level to be off",
            all(t.metadata["error"] <= t.metadata["geometricError"] == 77067.339779958624 / 2**t.z for t in every))
    # Errors, by brute force.
    worst_vertical = worst_space = 0.0
    holes = covered = 0
    for t in every:
        vertical, space, bare, seen = measure(p, t)
        worst_vertical, worst_space = max(worst_vertical, vertical), max(worst_space, space)
        holes, covered = holes + bare, covered + seen
    s.check(name + ": no sample is further above or below a tile than it states (%d looked at, worst %.3f of it)" % (covered, worst_vertical),
            covered > 0 and 0 < worst_vertical <= 1, worst_vertical)
    s.check(name + ": no sample is further from a tile in space, between chords, than it states (worst %.3f)" % worst_space,
            0 < worst_space <= 1, worst_space)
    if is_whole:
        s.equal(name + ": tiles of every level cover the raster", holes, 0)
    # Neighbours.
    different = compared = 0
    for (z, x, y), t in tiles.items():
        for side, other, theirs in ((2, (z, x + 1, y), 0), (3, (z, x, y + 1), 1)):
            if other in tiles:
                compared += 1
                different += edge_of(t, side) != edge_of(tiles[other], theirs)
    s.check(name + ": shared edges decode to identical vertices and normals (%d)" % compared, compared > 0 and different == 0, different)
    # Children: their areas are the parent's but for what the outline moves by, half a unit on either side.
    finest = max(z for z, _, _ in tiles)
    lost = []
    for (z, x, y), t in tiles.items():
        if z == finest or not is_whole:
            continue
        children = [tiles.get((z + 1, 2 * x + i, 2 * y + j)) for i in (0, 1) for j in (0, 1)]
        whole, parts = t.area() / 2, sum(c.area() / 2 / 4 for c in children if c)
        if abs(whole - parts) > (0 if whole == UNITS**2 and all(children) else 8 * UNITS):
            lost.append((z, x, y, whole, parts))
    s.equal(name + ": children cover their parent", lost, [])
    if is_whole:
        full = [t for t in every if t.west >= p.x0 and t.west + t.side <= p.x0 + (len(p.raster[0]) - 1) * p.dx and
                t.south + t.side <= p.y0 and t.south >= p.y0 + (len(p.raster) - 1) * p.dy]
        s.equal(name + ": triangles of a tile inside have its area, exactly (%d)" % len(full), [t.area() for t in full if t.area() != 2 * UNITS**2], [])
    flipped = sum(1 for t in every for a, b, c in t.triangles
                  if (t.u[b] - t.u[a]) * (t.v[c] - t.v[a]) - (t.u[c] - t.u[a]) * (t.v[b] - t.v[a]) < 0)
    print("%s: %d tiles, %d vertices, %d of %d triangles turned by rounding" %
          (name, len(every), sum(t.count for t in every), flipped, sum(len(t.triangles) for t in every)))
    # Space.
    s.equal(name + ": spheres hold every vertex",
            [(t.z, t.x, t.y) for t in every if max(math.dist(t.centre, q) for q in t.xyz) > t.radius], [])
    some = RANDOM.sample(every, min(len(every), 40))
    fails = [horizon_fails(t, 50) for t in some]
    s.check(name + ": what counts as below the horizon is (%d times)" % sum(h for _, h in fails),
            sum(w for w, _ in fails) == 0 and sum(h for _, h in fails) > 0, fails)


def exact_range(p, z):
    """Tiles that overlap the raster, in rational numbers."""
    side = Fraction(180, 2**z)
    x0, x1 = Fraction(p.x0), Fraction(p.x0) + (len(p.raster[0]) - 1) * Fraction(p.dx)
    y0, y1 = Fraction(p.y0) + (len(p.raster) - 1) * Fraction(p.dy), Fraction(p.y0)
    near = [math.floor(float((a + b) / side)) for a, b in ((x0, 180), (x1, 180), (y0, 90), (y1, 90))]
    return {(z, x, y) for x in range(max(0, near[0] - 2), min(2 << z, near[1] + 3)) for y in range(max(0, near[2] - 2), min(1 << z, near[3] + 3))
            if -180 + x * side < x1 and -180 + (x + 1) * side > x0 and -90 + y * side < y1 and -90 + (y + 1) * side > y0}


# ------------------------------------------------------------------------------------------------------------- terrains

def listed_exactly(p, is_whole):
    """Listed iff it has a triangle: by areas in rational numbers; where samples are void, by asking for the triangles."""
    asked = [(z, x, y) for z in range(len(p.layer["available"])) for _, x, y in sorted(exact_range(p, z))]
    if is_whole:
        s.equal(p.name + ": the tiles that overlap the raster are listed", sorted(p.tiles), sorted(asked))
        return
    db = s.connect(p.database)
    options = json.dumps({"outline": "tol", "frame": "ecef"})
    there = []
    for z, x, y in asked:
        side = 180 / 2**z
        box = -180 + x * side, -90 + y * side, -180 + (x + 1) * side, -90 + (y + 1) * side
        if s.one(db, "SELECT count(*) FROM rqt_triangles(rqt_bbox(?, ?, ?, ?), ?, NULL, ?)", *box, p.layer["eps"][z], options):
            there.append((z, x, y))
    db.close()
    s.check(p.name + ": the tiles that have a triangle are listed, and no others (%d of %d)" % (len(there), len(asked)),
            sorted(p.tiles) == sorted(there) and len(there) < len(asked), sorted(set(there) ^ set(p.tiles))[:5])


def count_vertices(p):
    """Vertices of all tiles of a level beside those of exact, cut, at the error that each tile states. That error is in space;
    how many times as many exact needs for it as in longitude, latitude and height shows in mode cover, which knows both."""
    db = s.connect(p.database)
    table = []
    for z in range(len(p.layer["available"])):
        mine = theirs = 0
        for (level, x, y), t in p.tiles.items():
            if level != z:
                continue
            mine += t.count - len(t.specks)
            cut, cover, space = (
                s.one(db, "SELECT count(*) FROM rqt_range(rqt_bbox(?, ?, ?, ?), ?, NULL, ?)", t.west, t.south, t.west + t.side, t.south + t.side,
                      t.metadata["error"], json.dumps(dict(options, outline="tol")))
                for options in ({"mode": "cut"}, {}, {"frame": "ecef"}))
            theirs += cut * max(1, space / cover)
        table.append((z, mine, theirs))
    db.close()
    print(p.name + ": level, vertices, those of exact: " + ", ".join("%d %d %.0f" % row for row in table))
    s.equal(p.name + ": no level has more than 1.1 times the vertices of exact, cut, at the same error", [r for r in table if r[1] > 1.1 * r[2]], [])


def check_normals(p):
    """At the finest level: by differences of the raster, turned into space here; between samples, on the sides of tiles, the mean
    of those around by nearness."""
    finest = max(z for z, _, _ in p.tiles)
    known = {}

    def normal(c, r):
        if (c, r) not in known:
            east, west, north, south = (p.place(c + a, r + b) for a, b in ((1, 0), (-1, 0), (0, -1), (0, 1)))
            x, y = minus(east, west), minus(north, south)
            n = (x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0])
            length = math.sqrt(dot(n, n))
            known[c, r] = tuple(k / length for k in n)
        return known[c, r]
    worst, seen = [0.0, 0.0], [0, 0]
    for (z, _, _), t in p.tiles.items():
        if z != finest:
            continue
        for i, (lon, lat, _) in enumerate(t.places):
            col, row = (lon - p.x0) / p.dx, (lat - p.y0) / p.dy
            is_between = any(i in t.edges[side] for side in range(4))
            if not is_between:
                col, row = round(col), round(row)
            c, r = math.floor(col), math.floor(row)
            if not (0 < c < len(p.raster[0]) - 2 and 0 < r < len(p.raster) - 2):
                continue
            weights = [(a, b, (col - c if a else 1 - col + c) * (row - r if b else 1 - row + r)) for a in (0, 1) for b in (0, 1)]
            n = [sum(w * normal(c + a, r + b)[k] for a, b, w in weights if w) for k in range(3)]
            angle = math.acos(min(1, dot(n, t.normal(i)) / math.sqrt(dot(n, n))))
            worst[is_between] = max(worst[is_between], math.degrees(angle))
            seen[is_between] += 1
    s.check("%s: normals are the terrain's, from its full resolution (%d, worst %.2f degrees)" % (p.name, seen[0], worst[0]), seen[0] > 100 and worst[0] < 1, worst)
    s.check("%s: ... and between samples the mean of those around (%d, worst %.2f degrees)" % (p.name, seen[1], worst[1]), seen[1] > 50 and worst[1] < 1.5, worst)


ALPS = pyramid("alps", window("alps", "glarus_1arc_native_161.tif", 30, 40, 85, 73))
check_pyramid(ALPS, True)
listed_exactly(ALPS, True)
count_vertices(ALPS)
check_normals(ALPS)

AFRICA = pyramid("africa", window("africa", "eastafrica.tif", 40, 60, 90, 110))
check_pyramid(AFRICA, True)
listed_exactly(AFRICA, True)
count_vertices(AFRICA)

# All of the Earth: flat triangles dive under it by kilometres.
EARTH = pyramid("earth", os.path.join(s.DATA, "etopo1_1deg.tif"), options=["--gzip"])
check_pyramid(EARTH, True)

# What closes the Earth is read along both columns, more than any tile has.
server = service.Service(EARTH.database, "--max-triangles", "500")
answer = server.ask("/collections/earth/tiles/quantized-mesh/layer.json")
s.equal("limits are those of answers, not of what closes the Earth", (answer.status, answer.body), (200, files(EARTH.folder)["layer.json"]))
server.process.terminate()
s.equal("... and the service ends well", server.process.wait(30), 0)

# Voids, and none of them the border of anything.
hole = s.rough_grid(150, 130, 7, relief=300)
for row in range(130):
    for col in range(150):
        if (col - 100) ** 2 + (row - 60) ** 2 > 70**2 or (col - 90) ** 2 + (row - 60) ** 2 < 20**2 or (col * 7919 + row * 104729) % 997 == 0:
            hole[row][col] = None
HOLES = pyramid("holes", s.write_grid(s.temp("holes.asc"), hole, 12.3, 45.6, 1 / 1200, s.WGS84), hole)
check_pyramid(HOLES, False)
listed_exactly(HOLES, False)

# As high as more tiles than are asked together, in small blocks: some squares of tiles are whole, some empty.
tall = s.rough_grid(70, 1150, 5, relief=40)
for row in range(1150):
    for col in range(70):
        if row % 200 > 90 + col or (col - 30) ** 2 + (row - 480) ** 2 < 60:
            tall[row][col] = None
TALL = pyramid("tall", s.write_grid(s.temp("tall.asc"), tall, 30.01, 44.02, 1 / 1200, s.WGS84), tall, block=3)
s.equal("tall: layer.json lists the same tiles", sorted(listed(TALL.layer)), sorted([*TALL.tiles, *TALL.empty]))
listed_exactly(TALL, False)
# ... and as wide as more of them.
wide = s.rough_grid(1150, 70, 6, relief=40)
for row in range(70):
    for col in range(1150):
        if col % 200 > 90 + row or (row - 30) ** 2 + (col - 480) ** 2 < 60:
            wide[row][col] = None
WIDE = pyramid("wide", s.write_grid(s.temp("wide.asc"), wide, 30.01, 44.02, 1 / 1200, s.WGS84), wide, block=3)
listed_exactly(WIDE, False)

# Longitudes beyond 180: the same places by another name.
hill = s.rough_grid(90, 70, 11, relief=500)
NEAR = pyramid("near", s.write_grid(s.temp("near.asc"), hill, -1.5, 50.25, 1 / 64, s.WGS84), hill)
FAR = pyramid("far", s.write_grid(s.temp("far.asc"), hill, 358.5, 50.25, 1 / 64, s.WGS84), hill)
s.equal("a terrain at 358.5 degrees has the tiles of one at -1.5", files(FAR.folder + "/3"), files(NEAR.folder + "/3"))
s.equal("... at every level", sorted(FAR.tiles), sorted(NEAR.tiles))
ACROSS = pyramid("across", s.write_grid(s.temp("across.asc"), hill, 179.5, 50.25, 1 / 64, s.WGS84), hill)
s.check("a terrain across the antimeridian has tiles on both ends of a level",
        {0, 1} == {x for z, x, _ in ACROSS.tiles if z == 0} and ACROSS.layer["bounds"][0] == -180 and ACROSS.layer["bounds"][2] == 180, sorted(ACROSS.tiles)[:4])

# Heights above EGM96 become heights above the ellipsoid, as clients have them.
geoid = s.temp("geoid.tif")
s.run(["gdal_translate", "-q", "-a_srs", "EPSG:4326+5773", s.temp("near.asc"), geoid])
db_path = s.temp("geoid.gpkg")
s.import_terrain(db_path, geoid, name="geoid")


def height_above_ellipsoid(x, y, z):
    """Bowring, again and again."""
    flat = math.hypot(x, y)
    lat = math.atan2(z, flat * (1 - E2))
    for _ in range(5):
        n = A / math.sqrt(1 - E2 * math.sin(lat) ** 2)
        lat = math.atan2(z + E2 * n * math.sin(lat), flat)
    return flat * math.cos(lat) + z * math.sin(lat) - A * math.sqrt(1 - E2 * math.sin(lat) ** 2)


db = s.connect(db_path)
placed = s.rows(db, "SELECT x0, y0, dx, dy FROM rqt_terrain")[0]
raised = [[None] * 90 for _ in range(70)]
both = s.rows(db, "SELECT x, y, z FROM rqt_range(NULL, 0, NULL, '{\"frame\": \"ecef\"}')")
for x, y, z in both:
    lon, lat = math.degrees(math.atan2(y, x)), math.degrees(math.atan2(z, math.hypot(x, y) * (1 - E2)))
    raised[round((lat - placed[1]) / placed[3])][round((lon - placed[0]) / placed[2])] = height_above_ellipsoid(x, y, z)
db.close()
s.check("every sample of the rough terrain is a vertex of its finest mesh", all(z is not None for row in raised for z in row))
GEOID = Pyramid("geoid", db_path, raised, *placed)
check_pyramid(GEOID, True)
s.check("heights are lifted by the geoid, which lies some 50 m above the ellipsoid there",
        all(30 < raised[r][c] - hill[r][c] < 60 for r in range(70) for c in range(90)))

# --------------------------------------------------------------------------------------------------------------- water

COAST, sea = coast()
check_pyramid(COAST, True)
wrong, sizes = [], set()
for key, t in COAST.tiles.items():
    mask = t.extensions[2]
    sizes.add((len(mask), max(mask)))
    for n in range(0, 65536, 37):
        lon, lat = t.west + (n % 256 + 0.5) / 256 * t.side, t.south + t.side - (n // 256 + 0.5) / 256 * t.side
        col, row = math.floor((lon - COAST.x0) / COAST.dx + 0.5), math.floor((lat - COAST.y0) / COAST.dy + 0.5)
        is_sea = 0 <= col < 140 and 0 <= row < 120 and sea[row][col] is None
        if mask[n if len(mask) > 1 else 0] != (255 if is_sea else 0):
            wrong.append((key, n))
s.equal("the water mask is the sea, north-west first", wrong[:3], [])
s.check("tiles of land and of water have one byte of it, others 256 x 256", sizes == {(1, 0), (1, 255), (65536, 255)}, sizes)
s.equal("layer.json has the extensions that tiles have", (COAST.layer["extensions"], ALPS.layer["extensions"], set(ALPS.tiles[0, 1, 0].extensions)),
        (["octvertexnormals", "metadata", "watermask"], ["octvertexnormals", "metadata"], {1, 4}))

# Heights rounded to steps that are larger than what clients take the finest tiles to be off: levels end before those.
steps = s.rough_grid(70, 60, 13, relief=300)
STEPS = pyramid("steps", s.write_grid(s.temp("steps.asc"), [[z + 0.25 for z in row] for row in steps], 7.0306, 46.4058, 1 / 50000, s.WGS84),
                [[z + 0.25 for z in row] for row in steps], quantum=10)
check_pyramid(STEPS, True)
last = STEPS.layer["geometricErrors"]
s.check("steps: levels end where 5 m of rounding would be more than clients take them to be off", 5 < last[-1] < 2 * 5.2, last[-2:])

s.finish()
