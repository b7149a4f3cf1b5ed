#!/usr/bin/python3
"""Normals on request, 'ply+normals' and 'rqt+normals': at every vertex the normal of the full-resolution grid, by the definition and
worked out here from the raster's own samples; the mesh beside them is the one without them."""
import math
import os
import struct

import sql_support as s
from sql_support import check, equal, one, raises, rows
from sql_wire import Wire


def ply_normals(data):
    """{(x, y): normal}."""
    head, body = data.split(b"end_header\n", 1)
    lines = head.decode().split("\n")
    names = [line.split()[1:] for line in lines if line.startswith("property")]
    assert names[:6] == [["double", c] for c in ("x", "y", "z")] + [["float", c] for c in ("nx", "ny", "nz")]
    count = int(next(line for line in lines if line.startswith("element vertex")).split()[2])
    return {v[:2]: v[3:] for v in (struct.unpack_from("<3d3f", body, 36 * i) for i in range(count))}


def ply_without(data):
    """The same file with the normals taken out."""
    head, body = data.split(b"end_header\n", 1)
    count = int(head.split(b"element vertex ")[1].split()[0])
    vertices = b"".join(body[36 * i:36 * i + 24] for i in range(count))
    for name in (b"nx", b"ny", b"nz"):
        head = head.replace(b"property float " + name + b"\n", b"")
    return head + b"end_header\n" + vertices + body[36 * count:]


def expected(z, col, row, east, north):
    """z[row][col] in metres, None for void; metres in a column and a row, east and north."""
    def at(c, r):
        return z[r][c] if 0 <= r < len(z) and 0 <= c < len(z[0]) else None

    def slope(before, after):
        own = at(col, row)
        if before is not None and after is not None:
            return (after - before) / 2
        return after - own if after is not None else own - before if before is not None else 0

    x = -slope(at(col - 1, row), at(col + 1, row)) / east if east else 0
    y = -slope(at(col, row - 1), at(col, row + 1)) / north
    length = math.sqrt(x * x + y * y + 1)
    return x / length, y / length, 1 / length


def degrees_in_metres(latitude):
    """Of a degree of longitude and one of latitude, on WGS 84, by the curve itself: the ellipse's arc and radius."""
    a, b = 6378137.0, 6378137.0 * (1 - 1 / 298.257223563)
    phi = math.radians(latitude)
    c, d = a * math.cos(phi), b * math.sin(phi)
    radius = a * a * math.cos(phi) / math.hypot(c, d)
    meridian = (a * b) ** 2 / (c * c + d * d) ** 1.5
    return math.radians(radius), math.radians(meridian)


def angle(a, b):
    return math.degrees(math.asin(min(1, math.dist(a, b) / 2)) * 2)


kinds = {"both sides": 0, "one side": 0, "no side": 0}


def compare(title, db, z, metres_in, region, eps):
    """metres_in(row): metres of a column and a row."""
    x0, y0, dx, dy = rows(db, "SELECT x0, y0, dx, dy FROM rqt_terrains")[0]
    vertices = rows(db, "SELECT col, row, x, y FROM rqt_range(?, ?)", region, eps)
    wanted = {}
    for col, row, x, y in vertices:
        wanted[col, row] = expected(z, col, row, *metres_in(row))
        for a, b in (((col - 1, row), (col + 1, row)), ((col, row - 1), (col, row + 1))):
            n = sum(0 <= c < len(z[0]) and 0 <= r < len(z) and z[r][c] is not None for c, r in (a, b))
            kinds[("no side", "one side", "both sides")[n]] += 1
    with_them, without = (one(db, "SELECT rqt_mesh(?, ?, ?)", region, eps, form) for form in ("ply+normals", "ply"))
    found = ply_normals(with_them)
    worst = max((angle(found[x, y], wanted[col, row]) for col, row, x, y in vertices), default=0)
    check("%s: %d normals of the ply" % (title, len(vertices)), len(found) == len(vertices) and worst < 1e-4, (len(found), worst))
    check(title + ": they are unit vectors, not downward", all(abs(math.hypot(*n) - 1) < 1e-6 and n[2] > 0 for n in found.values()))
    check(title + ": the ply is as without them else", ply_without(with_them) == without)
    with_them, without = (one(db, "SELECT rqt_mesh(?, ?, ?)", region, eps, form) for form in ("rqt+normals", "rqt"))
    wire = Wire(with_them)
    worst = max((angle(n, wanted[v[:2]]) for v, n in zip(wire.vertices, wire.normals)), default=0)
    check(title + ": those of the wire are within 0.56 degrees", len(wire.normals) == len(vertices) and worst < 0.56, (len(wire.normals), worst))
    plain = Wire(without)
    check(title + ": the mesh of the wire is the one without them", (wire.vertices, wire.triangles) == (plain.vertices, plain.triangles) and plain.normals is None
          and with_them[144:len(without)] == without[144:])
    return len(vertices)


# Metres, with voids and every block size's borders; cells that are not square cannot be written in ESRI ASCII.
for name, grid, options in (("hills", s.rough_grid(70, 45, 31), {"block": 2}), ("voids", s.rough_grid(37, 61, 32, 150), {"block": 1}),
                            ("islands", s.rough_grid(50, 40, 33, 700), {"block": 3}), ("feet", s.rough_grid(33, 65, 34, 20), {"block": 6, "unit": "ft"}),
                            ("default", s.rough_grid(133, 20, 35, 10), {})):
    path = s.temp(name + ".db")
    s.import_terrain(path, s.write_grid(s.temp(name + ".asc"), grid, cell=7.5), name=name, **options)
    db = s.connect(path)
    foot = 0.3048 if options.get("unit") else 1
    z = [[None if q is None else q * foot for q in line] for line in grid]
    for eps, region in ((0, None), (12, "POLYGON((30 -30, 200 -60, 150 -270, 30 -30))")):
        compare("%s, eps %g" % (name, eps), db, z, lambda row: (7.5, -7.5), region, eps)
    db.close()
check("slopes of one side and of none were among them", min(kinds.values()) > 20, kinds)

# Degrees: at the raster's rows, from the equator to the poles.
for name, source, eps in (("africa", "eastafrica.tif", 400), ("the globe", "etopo1_1deg.tif", 2500)):
    source = os.path.join(s.DATA, source)
    path = s.temp("degrees.db")
    s.import_terrain(path, source, name="degrees", replace=True)
    db = s.connect(path)
    z = s.read_raster(source)
    if name == "africa":
        equal("africa's rows are north to south", one(db, "SELECT sign(dy) FROM rqt_terrains"), -1.0)
    y0, dx, dy = rows(db, "SELECT y0, dx, dy FROM rqt_terrains")[0]

    def metres_in(row):
        lon, lat = degrees_in_metres(y0 + row * dy)
        return (0 if abs(abs(y0 + row * dy) - 90) < 1e-9 else dx * lon), dy * lat
    compare(name, db, z, metres_in, None, eps)
    for form, why in (("ply", "normals are those of the terrain's CRS"), ("rqt", 'format "rqt" holds samples')):
        raises("%s: no normals between samples (%s)" % (name, form), 'rqt_mesh(): format "%s+normals" holds whole samples' % form, lambda: one(
            db, "SELECT rqt_mesh('POLYGON((31 1, 32 1, 32 2, 31 1))', 100, ?, NULL, '{\"mode\": \"cut\"}')", form + "+normals"))
        raises("%s: no normals in another frame (%s)" % (name, form), "rqt_mesh(): " + why, lambda: one(
            db, "SELECT rqt_mesh('POINT(32 1)', 100, ?, NULL, '{\"frame\": \"enu\"}')", form + "+normals"))
    if name == "the globe":
        poles = {v: n for v, n in ply_normals(one(db, "SELECT rqt_mesh(NULL, 2500, 'ply+normals')")).items() if abs(v[1]) == 90}
        check("at a pole nothing slopes east or west", len(poles) > 1 and all(n[0] == 0 for n in poles.values()), len(poles))
    db.close()

# A projected CRS in feet of its own: heights in metres, ground in US feet.
grid = s.rough_grid(20, 20, 36)
crs = s.run(["gdalsrsinfo", "-o", "wkt1", "EPSG:2263"])[0].strip()  # New York, US survey feet
path = s.temp("newyork.db")
s.import_terrain(path, s.write_grid(s.temp("newyork.asc"), grid, cell=100, x0=980000, y0=190000, crs=crs), name="newyork", unit="m")
db = s.connect(path)
compare("ground in feet", db, grid, lambda row: (100 * 1200 / 3937, -100 * 1200 / 3937), None, 3)

# A plane: one normal everywhere, borders included.
plane = [[3 * i - 2 * j for i in range(9)] for j in range(9)]
path = s.temp("plane.db")
s.import_terrain(path, s.write_grid(s.temp("plane.asc"), plane, cell=2), name="plane")
db = s.connect(path)
n = set(ply_normals(one(db, "SELECT rqt_mesh(NULL, 0, 'ply+normals')")).values())
check("a plane has one normal, east and north as they are", len(n) == 1 and angle(n.pop(), tuple(c / math.hypot(-1.5, -1, 1) for c in (-1.5, -1, 1))) < 1e-4)

# What there is not
raises("formats without normals say so", 'rqt_mesh(): format "obj" has no normals; ply, glb and rqt have', lambda: one(db, "SELECT rqt_mesh(NULL, 0, 'obj+normals')"))
raises("... our own too", 'rqt_mesh(): format "strip" has no normals', lambda: one(db, "SELECT rqt_mesh(NULL, 0, 'strip+normals')"))
raises("an unknown format with normals", 'rqt_mesh(): unknown format "dxf+normals"', lambda: one(db, "SELECT rqt_mesh(NULL, 0, 'dxf+normals')"))
raises("normals of nothing", 'rqt_mesh(): unknown format "+normals"', lambda: one(db, "SELECT rqt_mesh(NULL, 0, '+normals')"))
equal("an empty mesh has none", (ply_normals(one(db, "SELECT rqt_mesh('POINT(99 99)', 0, 'ply+normals')")), Wire(one(db, "SELECT rqt_mesh('POINT(99 99)', 0, 'rqt+normals')")).normals), ({}, []))
equal("equal queries, equal bytes", *(one(db, "SELECT rqt_mesh(NULL, 1, 'rqt+normals', 'plane', ?)", o) for o in (None, '{"select":"bottomup"}')))
raises("a damaged block of heights is an error, with the block's number", "rqt_mesh(): terrain plane is damaged: block", lambda: [
    db.execute("UPDATE rqt_block_1 SET data = substr(data, 1, length(data) - 1) WHERE id = (SELECT max(id) FROM rqt_block_1)"), one(db, "SELECT rqt_mesh(NULL, 1, 'ply+normals')")])
db.close()
s.finish()
