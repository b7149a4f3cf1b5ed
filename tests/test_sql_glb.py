#!/usr/bin/python3
"""Format glb, parsed here from the specification of glTF 2.0 with struct and json alone: every triangle of rqt_triangles, in its
order and showing the same side, its places within what the file says of itself; normals, quantized positions, views, frames,
nothing at all."""
import json
import math
import os
import struct

import sql_support as s
from sql_support import check, equal, one, raises, rows

FORMS = ("glb", "glb+normals", "glb+quantized", "glb+quantized+normals")
COMPONENTS = {5122: ("h", 2), 5123: ("H", 2), 5125: ("I", 4), 5126: ("f", 4)}
WIDTH = {"SCALAR": 1, "VEC3": 3}


class Glb:
    """A file, with every rule that it has to keep asserted."""

    def __init__(self, data):
        magic, version, size, text_size, text_kind = struct.unpack_from("<4sIII4s", data)
        assert (magic, version, size, text_kind) == (b"glTF", 2, len(data), b"JSON") and text_size % 4 == 0
        text = data[20:20 + text_size]
        assert len(text) - len(text.rstrip(b" ")) < 4 and text.rstrip(b" ").endswith(b"}"), "padded with blanks"
        self.json = json.loads(text.decode(), parse_constant=lambda name: 1 / 0)
        self.buffer = None
        if 20 + text_size < len(data):
            at = 28 + text_size
            size, kind = struct.unpack_from("<I4s", data, 20 + text_size)
            used = self.json["buffers"][0]["byteLength"]
            assert kind == b"BIN\0" and at + size == len(data) and 0 <= size - used < 4 and size % 4 == 0
            assert not any(data[at + used:]), "padded with zeros"
            self.buffer = data[at:at + used]
        assert self.json["asset"]["version"] == "2.0" and self.json["scene"] == 0
        self.extras = self.json["asset"]["extras"]["rqt"]
        if "nodes" not in self.json:
            assert self.json["scenes"] == [{}] and self.buffer is None and "meshes" not in self.json and "accessors" not in self.json
            self.positions, self.triangles, self.normals = [], [], None
            return
        self.node, = self.json["nodes"]
        assert self.json["scenes"] == [{"nodes": [0]}] and self.node["extras"]["rqt"] == self.extras
        self.primitive, = self.json["meshes"][0]["primitives"]
        assert self.primitive["mode"] == 4
        end = 0
        for view in self.json["bufferViews"]:
            assert view["byteOffset"] == end and end % 4 == 0
            end += view["byteLength"]
        assert end == len(self.buffer)
        self.scale, self.move = self.node.get("scale", [1, 1, 1]), self.node.get("translation", [0, 0, 0])
        self.kept, accessor = self.read(self.primitive["attributes"]["POSITION"])
        self.kind = accessor["componentType"]
        for k in range(3):
            along = [p[k] for p in self.kept]
            assert (accessor["min"][k], accessor["max"][k]) == (min(along), max(along)), "min and max"
        self.positions = [tuple(self.move[k] + p[k] * self.scale[k] for k in range(3)) for p in self.kept]
        corners, accessor = self.read(self.primitive["indices"])
        self.index_kind = accessor["componentType"]
        assert max(corners) < len(self.kept) and len(corners) % 3 == 0
        self.triangles = list(zip(corners[0::3], corners[1::3], corners[2::3]))
        self.normals = None
        if "NORMAL" in self.primitive["attributes"]:
            kept, accessor = self.read(self.primitive["attributes"]["NORMAL"])
            unit = 32767 if accessor["componentType"] == 5122 else 1
            assert accessor.get("normalized", False) == (unit > 1)
            self.normal_kind = accessor["componentType"]
            assert all(abs(math.hypot(*n) / unit - 1) < 1e-4 for n in kept), "unit normals"
            self.normals = [direction(n[k] / self.scale[k] for k in range(3)) for n in kept]

    def read(self, number):
        accessor = self.json["accessors"][number]
        view = self.json["bufferViews"][accessor["bufferView"]]
        letter, size = COMPONENTS[accessor["componentType"]]
        n, count = WIDTH[accessor["type"]], accessor["count"]
        stride = view.get("byteStride", n * size)
        assert count > 0 and count * stride == view["byteLength"] and stride >= n * size
        assert view["target"] == (34963 if n == 1 else 34962) and (n == 1 or stride % 4 == 0)
        values = [struct.unpack_from("<%d%s" % (n, letter), self.buffer, view["byteOffset"] + stride * i) for i in range(count)]
        return ([v[0] for v in values] if n == 1 else values), accessor

    def places(self):
        """x, y, z of the vertices, as the extras say how to come back to them."""
        (ox, oy, oz), metre = self.extras["origin"], self.extras["metre"]
        return [(ox + p[0] / metre, oy - p[2] / metre, oz + p[1]) for p in self.positions]


def direction(v):
    v = tuple(v)
    length = math.hypot(*v)
    return tuple(c / length for c in v)


def dot(a, b):
    return sum(p * q for p, q in zip(a, b))


def angle(a, b):
    return math.degrees(math.asin(min(1, math.dist(a, b) / 2)) * 2)


def cross_up(t):
    """The up of a model's triangle, twice its area on the ground."""
    a, b, c = t
    return (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2])


def axes(lon, lat):
    """East, north and up, geocentric."""
    a, b = math.radians(lon), math.radians(lat)
    return ((-math.sin(a), math.cos(a), 0), (-math.sin(b) * math.cos(a), -math.sin(b) * math.sin(a), math.cos(b)),
            (math.cos(b) * math.cos(a), math.cos(b) * math.sin(a), math.sin(b)))


def geocentric(lon, lat, h):
    """On WGS 84: the point of the ellipse with that normal, and on along it."""
    a, b = 6378137.0, 6378137.0 * (1 - 1 / 298.257223563)
    c, t = math.cos(math.radians(lat)), math.sin(math.radians(lat))
    w = math.hypot(a * c, b * t)
    r, z = a * a * c / w + h * c, b * b * t / w + h * t
    return r * math.cos(math.radians(lon)), r * math.sin(math.radians(lon)), z


def enu(place, lonlath):
    """Metres east, north and up of a place."""
    away = [p - q for p, q in zip(geocentric(*lonlath), geocentric(*place))]
    return tuple(dot(axis, away) for axis in axes(place[0], place[1]))


def parsed(name, ask):
    """What `ask` gives; None and a failed check when it gives no such file."""
    try:
        return Glb(ask())
    except (s.sqlite3.Error, AssertionError, ValueError, IndexError, KeyError, TypeError, ZeroDivisionError, struct.error) as error:
        check(name + " can be read", False, repr(error))
        return None


seen = {"float": 0, "steps": 0, "parts": 0, "short index": 0, "long index": 0, "short normals": 0, "float normals": 0, "exact": 0}


def compare(title, db, region, eps, terrain=None, options=None, camera=None, degrees=False, srid=None, metre=1, above=True, eps_said=True):
    """degrees: the model is east, north and up of its place."""
    def ask(form):
        if camera:
            return one(db, "SELECT rqt_view_mesh(?, ?, ?, ?)", camera, form, terrain, options)
        return one(db, "SELECT rqt_mesh(?, ?, ?, ?, ?)", region, eps, form, terrain, options)
    head, = [ask("ply").split(b"end_header\n")]
    exact = s.ply_triangles(ask("ply"))
    count = int(head[0].split(b"element vertex ")[1].split()[0])
    where = [struct.unpack_from("<3d", head[1], 24 * i) for i in range(count)]
    table = s.triangles(db, region, eps, terrain, options) if not camera else [
        (r[0:3], r[3:6], r[6:9]) for r in rows(db, "SELECT x0,y0,z0, x1,y1,z1, x2,y2,z2 FROM rqt_view_triangles(?,?,?)", camera, terrain, options)]
    equal(title + ": the table has the same triangles", [s.rotated(t) for t in exact], [s.rotated(t) for t in table])
    framed = options and "frame" in options
    cell = 0 if framed else metre * one(db, "SELECT cell_x FROM rqt_terrains WHERE name = ? OR ? IS NULL", terrain, terrain)
    forms = [f for f in FORMS if not ((framed or (options and "cut" in options)) and "normals" in f)]
    for form in forms:
        name = "%s: %s" % (title, form)
        g = parsed(name, lambda: ask(form))
        if not g:
            continue
        e, quantized = g.extras, "quantized" in form
        equal(name + " asks for its extension", [g.json.get(k) for k in ("extensionsUsed", "extensionsRequired")], [["KHR_mesh_quantization"] if quantized and exact else None] * 2)
        equal(name + " has every triangle, in the same order", len(g.triangles), len(exact))
        equal(name + " says what it is of", (e["terrain"], e.get("srid"), e["eps"], e["quantum"]),
              (terrain or one(db, "SELECT name FROM rqt_terrains"), srid, eps if not camera and not math.isinf(eps) else None,
               one(db, "SELECT quantum FROM rqt_terrains WHERE name = ? OR ? IS NULL", terrain, terrain)))
        if camera:
            t, sure = one(db, "SELECT max(achieved_tau), max(guaranteed) FROM rqt_view(?, ?, ?)", camera, terrain, options)
            equal(name + " says the view's tolerance", (e["tau"], e["guaranteed"]), (t, bool(sure)) if exact else (2, True))
        else:
            check(name + " is of no view", "tau" not in e and "guaranteed" not in e)
        if not exact:
            continue
        equal(name + " is in metres, and says how", (e["metre"], e["frame"], "place" in e),
              (metre, json.loads(options)["frame"] if framed else "enu" if degrees else "crs", degrees or bool(framed and "enu" in options)))
        wanted = [enu(e["place"], p) for p in where] if degrees else where
        if degrees:
            equal(name + " has its origin at its place", e["origin"], [0, 0, 0])
            check(name + " is about the middle of the mesh", all(
                abs(e["place"][k] - (min(p[k] for p in where) + max(p[k] for p in where)) / 2) < 1e-9 for k in range(3)), e["place"])
        # Coordinates are doubles of up to 2^23 metres, a few operations away.
        slack = 2e-8 if degrees or framed else 1e-9 * metre
        scales = (metre, metre, 1)
        places = g.places()
        worst = [max(abs(p[k] - w[k]) * scales[k] for p, w in zip(places, wanted)) for k in range(3)]
        check(name + " is within what it says", len(places) == len(wanted) and all(worst[k] <= e["deviation"][k] + slack for k in range(3)), (worst, e["deviation"]))
        check(name + " says no more than it is off", all(e["deviation"][k] <= worst[k] + slack for k in range(3)), (worst, e["deviation"]))
        equal(name + " has the corners of each triangle", [tuple(wanted[i] for i in t) for t in g.triangles],
              [tuple(enu(e["place"], p) for p in t) for t in exact] if degrees else exact)
        if above:
            up = [cross_up([g.positions[i] for i in t]) for t in g.triangles]
            check(name + " shows its upper side", min(up) > 0 or (quantized and min(up) >= 0), min(up))
        equal(name + " has short indices where they suffice", g.index_kind, 5123 if len(where) <= 65535 else 5125)
        seen["short index" if g.index_kind == 5123 else "long index"] += 1
        extent = [max(p[k] for p in g.positions) - min(p[k] for p in g.positions) for k in range(3)]
        deviation = (e["deviation"][0], e["deviation"][2], e["deviation"][1])
        if quantized:
            equal(name + " has 16 bits", g.kind, 5123)
            check(name + " uses them", all(d <= x / 65535 * 0.51 + slack or d <= slack for d, x in zip(deviation, extent)), (deviation, extent))
        else:
            equal(name + " has floats, and no transformation", (g.kind, "scale" in g.node, "translation" in g.node), (5126, False, False))
            biggest = [max(abs(p[k]) for p in g.positions) for k in range(3)]
            check(name + " is off by a float's rounding at most", all(d <= b * 2.0**-24 for d, b in zip(deviation, biggest)), (deviation, biggest))
            check(name + " has its origin amid", degrees or all(b <= (x + c) / 2 * (1 + 2.0**-23) for b, x, c in zip(biggest, extent, (cell, e["quantum"], cell))), (biggest, extent))
            seen["float"] += 1
            seen["exact"] += not any(deviation)
        if quantized and not (degrees or framed or (options and "cut" in options)):
            samples = rows(db, "SELECT col, row, q FROM rqt_range(?, ?, ?, ?)", region, eps, terrain, options) if not camera else rows(
                db, "SELECT col, row, q FROM rqt_view(?, ?, ?)", camera, terrain, options)
            for k, axis in ((0, 0), (1, 2), (2, 1)):
                low = min(v[axis] for v in samples)
                fits = max(v[axis] for v in samples) - low <= 65535
                seen["steps" if fits else "parts"] += 1
                if fits:
                    equal("%s counts %s" % (name, ("columns", "heights", "rows")[k]), [p[k] for p in g.kept], [v[axis] - low for v in samples])
                    check("%s is exact along %s" % (name, "XYZ"[k]), deviation[k] <= slack, deviation[k])
                else:
                    equal("%s divides the extent along %s" % (name, "XYZ"[k]), max(p[k] for p in g.kept), 65535)
        if "normals" in form:
            data = ask("ply+normals").split(b"end_header\n", 1)[1]
            ply = [struct.unpack_from("<3f", data, 36 * i + 24) for i in range(count)]
            if degrees:
                middle = axes(*e["place"][:2])
                turned = []
                for n, p in zip(ply, where):
                    own = axes(p[0], p[1])
                    space = [sum(n[i] * own[i][k] for i in range(3)) for k in range(3)]
                    turned.append(tuple(dot(space, axis) for axis in middle))
                ply = turned
            off = max(angle(n, (p[0], p[2], -p[1])) for n, p in zip(g.normals, ply))
            ratio = max(g.scale) / min(g.scale)
            short = quantized and ratio <= 256
            check(name + ": normals are those of the ply", len(g.normals) == len(ply) and off < (math.degrees(0.87 / 32767) * ratio + 1e-4 if short else 1e-3), (off, ratio))
            equal(name + ": normals have 16 bits where these are enough", g.normal_kind, 5122 if short else 5126)
            seen["short normals" if short else "float normals"] += 1
    return len(exact)


def database(name, source, **options):
    path = s.temp(name + ".db")
    s.import_terrain(path, source, name=name, **options)
    return s.connect(path)


def camera(eye, at, **more):
    return json.dumps(dict({"eye": eye, "at": at, "fovy": 45, "width": 320, "height": 240, "tau": 2}, **more))


sizes = []
# Metres, far from the origin of EPSG:2056; float heights in steps of 2^-10.
db = database("alpine", os.path.join(s.DATA, "glarus_alpine_25m_161.tif"))
BOX = "POLYGON((2720500 1209000, 2721200 1209000, 2721200 1210000, 2720500 1210000, 2720500 1209000))"
CUT = '{"mode":"cut"}'
for title, region, eps, options in (("a box", BOX, 0, None), ("all", None, 8, None), ("the coarsest", None, math.inf, None), ("a point", "POINT(2721000 1209000)", 20, None),
                                    ("nothing", "POINT(0 0)", 20, None), ("cut", BOX, 5, CUT), ("snap", BOX, 5, '{"mode":"snap"}')):
    sizes.append(compare("alpine, " + title, db, region, eps, options=options, srid=2056))
sizes.append(compare("alpine, a view", db, None, math.inf, camera=camera([2720200, 1207000, 2600], [2722000, 1209500, 1500]), srid=2056))
sizes.append(compare("alpine, a view of the sky", db, None, math.inf, camera=camera([2720200, 1207000, 9000], [2720200, 1207001, 90000]), srid=2056))
raises("a frame is for degrees", 'option "frame":"enu" is for terrains in longitude and latitude', lambda: one(db, "SELECT rqt_mesh(NULL, 9, 'glb', NULL, '{\"frame\":\"enu\"}')"))
db.close()

# Degrees; heights in metres, integers.
db = database("africa", os.path.join(s.DATA, "eastafrica.tif"))
CIRCLE = one(db, "SELECT rqt_circle(30, 0, 100000)")
sizes.append(compare("africa", db, None, 400, degrees=True, srid=4326))
sizes.append(compare("africa, a circle", db, CIRCLE, 50, degrees=True, srid=4326))
sizes.append(compare("africa, a circle cut", db, CIRCLE, 200, options=CUT, degrees=True, srid=4326))
sizes.append(compare("africa, nowhere", db, "POINT(80 0)", 200, degrees=True, srid=4326))
sizes.append(compare("africa, a view", db, None, math.inf, camera=camera([29, -1, 20000], [30, 0.5, 1000], far=300000), degrees=True, srid=4326))
for frame, number in (("ecef", 4978), ("enu", 4326)):
    for region in (CIRCLE, "POINT(80 0)"):
        # s.triangles are the table's in that frame too.
        sizes.append(compare("africa, frame " + frame, db, region, 200, options='{"frame":"%s"}' % frame, srid=number, above=frame == "enu"))
g = Glb(one(db, "SELECT rqt_mesh(?, 200, 'glb', NULL, '{\"frame\":\"enu\"}')", CIRCLE))
x, y, dx, dy, w, h = rows(db, "SELECT x0, y0, dx, dy, width, height FROM rqt_terrains")[0]
equal("frame enu is about the terrain's middle", g.extras["place"], [x + (w - 1) / 2 * dx, y + (h - 1) / 2 * dy, 0])
db.close()

# The whole globe, poles too.
db = database("globe", os.path.join(s.DATA, "etopo1_1deg.tif"))
sizes.append(compare("the globe", db, None, 2500, degrees=True, srid=4326, above=False))
sizes.append(compare("a pole", db, "POLYGON((-30 70, 30 70, 30 90, -30 90, -30 70))", 100, degrees=True, srid=4326, above=False))
db.close()

# The rounding of a step can put the last row beyond the pole.
beyond = 0
for n in (7, 11, 13, 14, 21, 23):
    source = s.write_grid(s.temp("caps%d.asc" % n), s.rough_grid(n + 1, n + 1, n), x0=-60, y0=-90, cell=180 / n, crs=s.WGS84)
    db = database("caps%d" % n, source)
    beyond += one(db, "SELECT max(abs(y)) > 90 FROM rqt_range(NULL, 0)")
    sizes.append(compare("%d steps from pole to pole" % n, db, None, 0, degrees=True, srid=4326, above=False))
    db.close()
check("some of these go beyond a pole", beyond > 0, beyond)

# No CRS, voids, feet up; ground in feet, heights in metres.
db = database("plain", s.write_grid(s.temp("plain.asc"), s.rough_grid(37, 29, 21, 80), x0=1e7, y0=-3.25, cell=0.25), unit="us-ft")
for eps in (0, 3):
    sizes.append(compare("no CRS, eps %g" % eps, db, None, eps))
db.close()
crs = s.run(["gdalsrsinfo", "-o", "wkt1", "EPSG:2263"])[0].strip()  # New York, US survey feet
db = database("newyork", s.write_grid(s.temp("newyork.asc"), s.rough_grid(40, 30, 36), cell=100, x0=980000, y0=190000, crs=crs), unit="m")
said = Glb(one(db, "SELECT rqt_mesh(NULL, 0, 'glb')")).extras["metre"]
check("a foot of the ground is one of the US", abs(said / (1200 / 3937) - 1) < 1e-15, said)
sizes.append(compare("ground in feet", db, None, 3, srid=2263, metre=said))
db.close()

# Indices of 16 bits number 65535 vertices; every sample is needed here.
dice = s.Dice(65535)
for width, height in ((257, 255), (256, 256)):
    db = database("odd", s.write_grid(s.temp("odd.asc"), [[dice.below(10**6) for _ in range(width)] for _ in range(height)]))
    equal("%d x %d samples are all needed" % (width, height), one(db, "SELECT count(*) FROM rqt_range(NULL, 0)"), width * height)
    g = parsed("%d x %d" % (width, height), lambda: one(db, "SELECT rqt_mesh(NULL, 0, 'glb')"))
    equal("%d vertices have their indices" % (width * height), (g.index_kind, len(g.triangles), max(map(max, g.triangles))),
          (5123 if width == 257 else 5125, 2 * (width - 1) * (height - 1), width * height - 1))
    seen["short index" if g.index_kind == 5123 else "long index"] += 1
    db.close()
    os.remove(s.temp("odd.db"))

# More columns than 16 bits count; heights of one value.
db = database("long", s.write_grid(s.temp("long.asc"), [[i % 7 for i in range(70000)] for j in range(3)], cell=2))
sizes.append(compare("70000 columns", db, None, 7))
db.close()
db = database("flat", s.write_grid(s.temp("flat.asc"), [[5] * 9 for _ in range(9)]))
sizes.append(compare("flat ground", db, None, 0))
equal("flat ground is one height", [p[1] for p in Glb(one(db, "SELECT rqt_mesh(NULL, 0, 'glb+quantized')")).kept], [0] * 4)
equal("equal queries, equal bytes", *(one(db, "SELECT rqt_mesh(NULL, 0, 'glb', NULL, ?)", o) for o in (None, '{"select":"bottomup"}')))
db.close()
# The command.
for form in FORMS:
    options = form.replace("+", " --").split()[1:]
    said, status = s.run([s.RQT, "mesh", s.temp("newyork.db"), "--eps", "3", *options, "-o", s.temp("model.glb")])
    written = open(s.temp("model.glb"), "rb").read() if status == 0 else said
    db = s.connect(s.temp("newyork.db"))
    check("rqt mesh writes the bytes of " + form, written == one(db, "SELECT rqt_mesh(NULL, 3, ?)", form), said)
    db.close()
# No triangle, though samples.
db = database("row", s.write_grid(s.temp("row.asc"), [[1, 2, 3, 5]]))
sizes.append(compare("a row of samples", db, None, 0))
db.close()

check("the meshes compared were of many sizes", 0 in sizes and 2 in sizes and max(sizes) > 3000, sizes)
check("of every kind there were some", min(seen.values()) > 0, seen)
s.finish()
