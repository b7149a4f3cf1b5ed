"""What the tests of tiles for globes have in common: a decoder of quantized-mesh, written from the format's description
(CesiumGS/quantized-mesh), places in space, and terrains with their tiles. Nothing is asked of the program but tiles."""
import gzip
import json
import math
import os
import struct
from fractions import Fraction

import sql_support as s

UNITS = 32767
A, F = 6378137.0, 1 / 298.257223563
B, E2 = A * (1 - F), F * (2 - F)


def ecef(lon, lat, h):
    lon, lat = math.radians(lon), math.radians(lat)
    n = A / math.sqrt(1 - E2 * math.sin(lat) ** 2)
    return (n + h) * math.cos(lat) * math.cos(lon), (n + h) * math.cos(lat) * math.sin(lon), (n * (1 - E2) + h) * math.sin(lat)


def minus(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


class Bytes:
    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, form):
        values = struct.unpack_from("<" + form, self.data, self.at)
        self.at += struct.calcsize("<" + form)
        return values


class Tile:
    """What a client reads of a tile. problem: the first thing that is not as the format has it."""

    def __init__(self, z, x, y, data):
        self.z, self.x, self.y, self.problem, self.size = z, x, y, None, len(data)
        self.side = 180 / 2**z
        self.west, self.south = -180 + x * self.side, -90 + y * self.side
        try:
            self.read(data)
        except (struct.error, ValueError, LookupError) as error:
            self.problem = repr(error)

    def read(self, data):
        b = Bytes(data)
        self.middle = b.take("3d")
        self.low, self.high = b.take("2f")
        self.centre, self.radius = b.take("3d"), b.take("d")[0]
        self.horizon = b.take("3d")
        self.count = b.take("I")[0]
        self.u, self.v, self.h = (self.differences(b) for _ in range(3))
        wide = self.count > 65536
        index, size = ("I", 4) if wide else ("H", 2)
        b.at += -b.at % size
        codes = b.take("%d%s" % (3 * b.take("I")[0], index))
        highest, self.triangles = 0, []
        for code in codes:
            if code > highest:
                self.problem = "an index below 0"
            self.triangles.append(highest - code)
            highest += code == 0
        if highest != self.count:
            self.problem = "%d vertices are used, %d are there" % (highest, self.count)
        self.triangles = [self.triangles[i:i + 3] for i in range(0, len(self.triangles), 3)]
        # Of one vertex each, where the tile has no terrain.
        self.specks = [t[0] for t in self.triangles if t[0] == t[1] == t[2]]
        self.triangles = [t for t in self.triangles if not t[0] == t[1] == t[2]]
        self.edges = [b.take("%d%s" % (b.take("I")[0], index)) for _ in range(4)]
        self.extensions = {}
        while b.at < len(data):
            number, length = b.take("BI")
            self.extensions[number] = data[b.at:b.at + length]
            b.at += length
        if b.at != len(data):
            self.problem = "%d bytes, and it says %d" % (len(data), b.at)
        length = struct.unpack("<I", self.extensions[4][:4])[0]
        self.metadata = json.loads(self.extensions[4][4:4 + length])
        step = (self.high - self.low) / UNITS
        self.step = step
        # As clients do: a linear interpolation.
        self.places = [(self.west + u * self.side / UNITS, self.south + v * self.side / UNITS, self.low + (self.high - self.low) * (h / UNITS))
                       for u, v, h in zip(self.u, self.v, self.h)]
        self.xyz = [ecef(*p) for p in self.places]

    def differences(self, b):
        value, values = 0, []
        for code in b.take("%dH" % self.count):
            value += (code >> 1) ^ -(code & 1)
            if not 0 <= value <= UNITS:
                self.problem = "a number out of range"
            values.append(value)
        return values

    def normal(self, i):
        x, y = (c / 255 * 2 - 1 for c in self.extensions[1][2 * i:2 * i + 2])
        z = 1 - abs(x) - abs(y)
        if z < 0:
            x, y = (1 - abs(y)) * (1 if x >= 0 else -1), (1 - abs(x)) * (1 if y >= 0 else -1)
        length = math.sqrt(x * x + y * y + z * z)
        return x / length, y / length, z / length

    def area(self):
        """Twice the sum of the areas, signed, in units."""
        u, v = self.u, self.v
        return sum((u[b] - u[a]) * (v[c] - v[a]) - (u[c] - u[a]) * (v[b] - v[a]) for a, b, c in self.triangles)


def clip(shape, axis, value, sign):
    """The part of a convex polygon of rational numbers where sign * (coordinate - value) >= 0."""
    part = []
    for p, q in zip(shape, shape[1:] + shape[:1]):
        a, b = sign * (p[axis] - value), sign * (q[axis] - value)
        if a >= 0:
            part.append(p)
        if a * b < 0:
            part.append(tuple(c + (d - c) * a / (a - b) for c, d in zip(p, q)))
    return part


def bare_middles(tile):
    """The middles of the sixteenths about which no triangle comes within three eighths of a sixteenth's side."""
    bare, side, reach = [], 8192, 3072
    for v in range(side // 2, 4 * side, side):
        for u in range(side // 2, 4 * side, side):
            for corners in tile.triangles:
                shape = [(Fraction(tile.u[i]), Fraction(tile.v[i])) for i in corners]
                if max(p[0] for p in shape) < u - reach or min(p[0] for p in shape) > u + reach or max(p[1] for p in shape) < v - reach or min(p[1] for p in shape) > v + reach:
                    continue
                for axis, middle in enumerate((u, v)):
                    for sign in (1, -1):
                        shape = clip(shape, axis, middle - sign * reach, sign)
                if shape:
                    break
            else:
                bare.append((u, v))
    return bare


def listed(layer):
    """Every tile that layer.json has, z,x,y; some twice, if it has them so."""
    return [(z, x, y) for z, ranges in enumerate(layer["available"]) for r in ranges
            for y in range(r["startY"], r["endY"] + 1) for x in range(r["startX"], r["endX"] + 1)]


def told_by(roots):
    """Every tile that those of level 0 tell of: z,x,y; -1,x,y when it is in the other half of the globe."""
    found = []
    for half, root in roots.items():
        for z, ranges in enumerate(root.metadata["available"], 1):
            found += [(z if x >> z == half else -1, x, y) for r in ranges
                      for y in range(r["startY"], r["endY"] + 1) for x in range(r["startX"], r["endX"] + 1)]
    return found


def files(folder):
    found = {}
    for path, _, names in os.walk(folder):
        for name in names:
            full = os.path.join(path, name)
            with open(full, "rb") as f:
                found[os.path.relpath(full, folder)] = f.read()
    return found


class Pyramid:
    def __init__(self, name, database, raster, x0, y0, dx, dy, options=()):
        self.name, self.folder, self.database = name, s.temp(name + ".tiles"), database
        self.x0, self.y0, self.dx, self.dy, self.raster = x0, y0, dx, dy, raster
        out, status = s.run([s.RQT, "tiles", database, "-o", self.folder, *options])
        s.equal(name + ": rqt tiles says nothing in a pipe", (out, status), ("", 0))
        with open(os.path.join(self.folder, "layer.json"), encoding="utf-8") as f:
            self.layer = json.load(f)
        self.tiles, self.empty = {}, {} # those with terrain in them, and those of level 0 without
        if "--gzip" in options:
            if not s.equal(name + ": all tiles are compressed", {data[:2] for path, data in files(self.folder).items() if path.endswith(".terrain")}, {b"\x1f\x8b"}):
                s.finish()
        for path, data in files(self.folder).items():
            if path.endswith(".terrain"):
                z, x, y = map(int, path[:-len(".terrain")].split("/"))
                tile = Tile(z, x, y, gzip.decompress(data) if "--gzip" in options else data)
                (self.empty if z == 0 and tile.problem is None and not tile.triangles else self.tiles)[z, x, y] = tile
        self.space = {}

    def sample(self, col, row):
        z = self.raster[row][col]
        return None if z is None else (self.x0 + col * self.dx, self.y0 + row * self.dy, z)

    def place(self, col, row):
        key = col, row
        if key not in self.space:
            self.space[key] = ecef(*self.sample(col, row))
        return self.space[key]


def pyramid(name, path, source=None, options=(), **imports):
    """The tiles of a terrain of this raster, with the heights that its source has."""
    database = s.temp(name + ".gpkg")
    s.import_terrain(database, path, name=name, **imports)
    db = s.connect(database)
    at = s.rows(db, "SELECT x0, y0, dx, dy FROM rqt_terrain")[0]
    db.close()
    return Pyramid(name, database, source or s.read_raster(path), *at, options=options)


def window(name, source, *box):
    path = s.temp(name + ".tif")
    s.run(["gdal_translate", "-q", "-srcwin", *map(str, box), os.path.join(s.DATA, source), path])
    return path


def coast():
    """A terrain of 140 x 120 samples with a sea beside it: its pyramid, and its raster with None for the sea."""
    sea = s.rough_grid(140, 120, 3, relief=200)
    for row in range(120):
        for col in range(140):
            if math.hypot(col - 10, row - 20) > 52 + 8 * math.sin(row / 5) or (col - 20) ** 2 + (row - 30) ** 2 < 30:
                sea[row][col] = None
    land = [[0 if z is None else z for z in row] for row in sea]
    return pyramid("coast", s.write_grid(s.temp("coast.asc"), sea, 5.01, 43.02, 1 / 1200, s.WGS84), land, sea=0), sea
