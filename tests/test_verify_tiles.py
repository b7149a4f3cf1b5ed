"""The judge of tiles (tests/verify_tiles.py) is judged: a small terrain's tiles pass, and each thing that is spoiled in a copy of
them is seen, under its name."""
import json
import math
import os
import random
import shutil
import struct

import sql_support as s
import verify_tiles as v

UNITS = 32767
COUNT_AT = 88  # of vertices: behind the header


class Parts:
    """Where things are in a tile's bytes; small tiles, whose indices have 16 bits."""

    def __init__(self, data):
        self.data = bytearray(data)
        self.count = struct.unpack_from("<I", data, COUNT_AT)[0]
        self.triangles = COUNT_AT + 4 + 6 * self.count
        self.codes = self.triangles + 4
        at = self.codes + 6 * struct.unpack_from("<I", data, self.triangles)[0]
        self.sides = []
        for _ in range(4):
            self.sides.append(at)
            at += 4 + 2 * struct.unpack_from("<I", data, at)[0]
        self.extensions = {}
        while at < len(data):
            number, length = struct.unpack_from("<BI", data, at)
            self.extensions[number] = at + 5
            at += 5 + length

    def read(self, which):
        """u, v or h of all vertices: 0, 1, 2."""
        values, value = [], 0
        for code in struct.unpack_from("<%dH" % self.count, self.data, COUNT_AT + 4 + 2 * self.count * which):
            value += (code >> 1) ^ -(code & 1)
            values.append(value)
        return values

    def write(self, which, values):
        by = [b - a for a, b in zip([0] + values, values)]
        struct.pack_into("<%dH" % self.count, self.data, COUNT_AT + 4 + 2 * self.count * which, *[-2 * d - 1 if d < 0 else 2 * d for d in by])

    def scale(self, form, at, factor):
        struct.pack_into("<" + form, self.data, at, *[n * factor for n in struct.unpack_from("<" + form, self.data, at)])


def state(member, value):
    """The metadata's number becomes another one, in as many bytes."""
    def spoil(parts):
        begin = parts.data.index(b'"%s":' % member) + len(member) + 3
        end = min(parts.data.index(b, begin) for b in (b",", b"}") if b in parts.data[begin:])
        parts.data[begin:end] = value.ljust(end - begin, b"0")[:end - begin]
    return spoil


def raise_vertex(is_on_side, by):
    """One vertex of the eastern side but not of a corner, or one of none."""
    def spoil(parts):
        u, w, h = (parts.read(k) for k in range(3))
        found = [i for i in range(parts.count) if (u[i] == UNITS and 0 < w[i] < UNITS if is_on_side else 0 < u[i] < UNITS and 0 < w[i] < UNITS)]
        h[found[len(found) // 2]] += by
        parts.write(2, h)
    return spoil


def drop_triangle(parts):
    """The last one that makes no vertex loses its area: the third corner becomes the second."""
    count = struct.unpack_from("<I", parts.data, parts.triangles)[0]
    for i in reversed(range(count)):
        codes = struct.unpack_from("<3H", parts.data, parts.codes + 6 * i)
        if 0 not in codes:
            struct.pack_into("<H", parts.data, parts.codes + 6 * i + 4, codes[1])
            return


def bend_normals(parts):
    at = parts.extensions[1] + 2 * (parts.count // 2)
    parts.data[at] ^= 0x20


def turn_water(parts):
    parts.data[parts.extensions[2] + 30000] ^= 0xFF


def change_index(parts):
    parts.data[parts.codes] = 7


def change_side(parts):
    """The west side's list begins with a vertex that is none of it."""
    u = parts.read(0)
    struct.pack_into("<H", parts.data, parts.sides[0] + 4, next(i for i in range(parts.count) if u[i] != 0))


def cut_off(parts):
    del parts.data[len(parts.data) // 2:]


# ------------------------------------------------------------------------------------------------------------ terrain

# Steep, with a lake of voids, which is an outline in one terrain and water in the other.
window = s.temp("window.tif")
s.run(["gdal_translate", "-q", "-srcwin", "30", "40", "85", "73", os.path.join(s.DATA, "glarus_1arc_native_161.tif"), window])
grid = s.read_raster(window)
for row in range(73):
    for col in range(85):
        if math.hypot(col - 50, row - 30) < 11 + 3 * math.sin(row) or (row * 85 + col) % 1511 == 7:
            grid[row][col] = None
RASTER = s.write_grid(s.temp("lake.asc"), grid, 8.97, 46.93, 1 / 3600, s.WGS84)


def terrain(tile):
    return "%d/%d/%d.terrain" % tile


def tiles_of(files):
    return sorted(p[1:4] for p in map(v.place_of, files) if p)


def make(name, sea):
    database, folder = s.temp(name + ".gpkg"), s.temp(name)
    s.import_terrain(database, RASTER, name="t", **({} if sea is None else {"sea": sea}))
    s.equal(name + ": rqt tiles", s.run([s.RQT, "tiles", database, "-o", folder]), ("", 0))
    told, status = v.judge("quantized-mesh", RASTER, folder, sea)
    wrong = [line for line in told.splitlines() if line.startswith("FAILED") or line.startswith("    ")]
    s.check(name + ": the judge finds nothing", status == 0 and not wrong, wrong[:4])
    # Nothing that it asks for was left out.
    s.check(name + ": ... and looked at every promise", told.count("\nok ") >= 19 and " (0 looked at" not in told, told)
    served, missing, faults = v.judge_service("quantized-mesh", database, "t", folder)
    s.check(name + ": the service has what is listed, and nothing else (%d, %d)" % (served, missing), served > 10 and missing > 10 and not faults, faults[:3])
    s.equal(name + ": compressed tiles are the same, unpacked", v.judge_compressed("quantized-mesh", database, folder), [])
    return database, folder


make("voids", None)
DATABASE, FOLDER = make("lake", 0)
FILES = v.read_files(FOLDER)
TILES = tiles_of(FILES)
FINEST = max(TILES)[0]
# A tile in the middle of the finest level that has neighbours.
INNER = max((t for t in TILES if t[0] == FINEST and (FINEST, t[1] + 1, t[2]) in TILES), key=lambda t: len(FILES[terrain(t)]))


def sees(what, promise, spoil, sea=0):
    """The judge names the promise when a copy of the folder is spoiled, and exits with 1."""
    copy = s.temp("copy")
    shutil.copytree(FOLDER, copy)
    spoil(copy)
    told, status = v.judge("quantized-mesh", RASTER, copy, sea)
    shutil.rmtree(copy)
    named = any(line.startswith("FAILED " + promise) for line in told.splitlines())
    s.check("spoiled: %s: the judge sees it" % what, status == 1 and named, [line for line in told.splitlines() if line.startswith("FAILED")] or told[-300:])


def in_tile(spoil, tile=INNER):
    def in_folder(folder):
        path = os.path.join(folder, terrain(tile))
        with open(path, "rb") as f:
            parts = Parts(f.read())
        before = bytes(parts.data)
        spoil(parts)
        assert parts.data != before
        with open(path, "wb") as f:
            f.write(parts.data)
    return in_folder


sees("what a tile states in space is less than the truth", "space: no sample is further", in_tile(state(b"error", b"0.01")))
sees("what it states above or below is", "height: no sample is further", in_tile(state(b"verticalError", b"0.01")))
sees("a vertex is too high", "height: no sample is further", in_tile(raise_vertex(False, 3000)))
sees("... in space", "space: no sample is further", in_tile(raise_vertex(False, 3000)))
sees("a vertex of a side is a step higher than the neighbour's", "edges: neighbours have", in_tile(raise_vertex(True, 1)))
sees("a triangle is missing", "children: away from voids", in_tile(drop_triangle))
sees("the sphere is too small", "header: the sphere", in_tile(lambda p: p.scale("d", 56, 0.999)))
sees("the horizon point is too low", "header: from where", in_tile(lambda p: p.scale("3d", 64, 0.9999)))
sees("there is none", "header: tiles of less than 45", in_tile(lambda p: p.scale("3d", 64, 1e200)))
sees("heights have a range of their own", "header: all tiles have one range", in_tile(lambda p: p.scale("f", 28, 2)))
sees("the highest is another", "header: the metadata's", in_tile(state(b"maximumHeight", b"9999")))
sees("more is stated than clients take", "header: what a tile states", in_tile(state(b"error", b"99999")))
sees("a side's list", "header: the lists of sides", in_tile(change_side))
sees("a normal", "normals: ", in_tile(bend_normals))
sees("a pixel of water", "water: ", in_tile(turn_water, next(t for t in reversed(TILES) if len(FILES[terrain(t)]) > 65536)))
sees("an index", "format: ", in_tile(change_index))
sees("half a tile", "format: ", in_tile(cut_off))
sees("a tile is listed and not there", "listed: ", lambda folder: os.remove(os.path.join(folder, terrain(INNER))))
sees("a tile is there and not listed", "listed: ", lambda folder: shutil.copy(os.path.join(folder, terrain(INNER)), os.path.join(folder, "0/1/7.terrain")))


def unlist(folder):
    path = os.path.join(folder, "layer.json")
    with open(path, encoding="utf-8") as f:
        layer = json.load(f)
    layer["available"][FINEST] = [r for r in layer["available"][FINEST] for r in [dict(r, endX=r["endX"] - 1)] if r["startX"] <= r["endX"]]
    with open(path, "w", encoding="utf-8") as f:
        json.dump(layer, f)


sees("the last column of tiles is not listed", "cover: ", unlist)
sees("... so children do not cover their parents", "children: samples", unlist)
sees("... and these have ground there", "children: where no child", unlist)
# The service and --gzip beside a folder that is not theirs.
copy = s.temp("copy")
shutil.copytree(FOLDER, copy)
in_tile(turn_water, next(t for t in reversed(TILES) if len(FILES[terrain(t)]) > 65536))(copy)
s.check("spoiled: a byte of a tile: the service has another", any("is served as" in f for f in v.judge_service("quantized-mesh", DATABASE, "t", copy)[2]))
s.check("... and so has --gzip", len(v.judge_compressed("quantized-mesh", DATABASE, copy)) == 1)
os.remove(os.path.join(copy, terrain(INNER)))
s.check("spoiled: a tile is not there: the service has it", any("is not there, and the service answers" in f for f in v.judge_service("quantized-mesh", DATABASE, "t", copy)[2]))

# ------------------------------------------------------------------------------------------- the Earth, and hardly anything


def judged(name, raster):
    database, folder = s.temp(name + ".gpkg"), s.temp(name)
    s.import_terrain(database, raster, name="t")
    s.run([s.RQT, "tiles", database, "-o", folder])
    told, status = v.judge("quantized-mesh", raster, folder)
    return told, status, tiles_of(v.read_files(folder))


# Both columns at 180 degrees are there, and differ by a metre in some rows.
told, status, tiles = judged("earth", os.path.join(s.DATA, "etopo1_1deg.tif"))
s.check("F28_a_terrain_around_the_earth_closes_at_180_degrees", status == 0 and len(tiles) == 42 and "neighbours have the same vertices and normals on their side (70 looked at" in told, told)
# Relief beyond all measure, so that the first levels have vertices that one side alone would not; the last column is off by up to 300 m.
ring = s.rough_grid(721, 40, 5, relief=60000)
for row in range(40):
    ring[row][720] = ring[row][0] + 100 * (row % 7 - 3)
told, status, tiles = judged("ring", s.write_grid(s.temp("ring.asc"), ring, -180, 20, 0.5, s.WGS84))
s.check("F28_a_ring_of_rough_terrain_closes_and_states_what_its_ends_differ_by", status == 0 and len(tiles) > 20, told)
# Clients who find nothing at the first level look no further: there is a triangle, however little of a raster is valid. And they
# look for both tiles of that level.
little = [[None] * 200 for _ in range(200)]
for row, col in ((101, 101), (102, 102), (101, 102)):
    little[row][col] = 5
told, status, tiles = judged("little", s.write_grid(s.temp("little.asc"), little, 7, 46, 0.01, s.WGS84))
s.check("F18_one_valid_half_cell_has_a_tile_at_every_level", status == 0 and [z for z, _, _ in tiles] == [0, *range(max(tiles)[0] + 1)], (tiles, told))

# What has no tiles says so.
for name, grid, place, sentence in (("flat", s.rough_grid(9, 9, 1), (), "in longitude and latitude on WGS 84"),
                                    ("twice", s.rough_grid(90, 9, 1), (-180, 0, 5, s.WGS84), "it goes around the Earth more than once"),
                                    ("beyond", s.rough_grid(9, 90, 1), (0, 50, 1, s.WGS84), "it has latitudes beyond a pole")):
    database = s.temp(name + ".gpkg")
    s.import_terrain(database, s.write_grid(s.temp(name + ".asc"), grid, *place), name="t")
    said, status = s.run([s.RQT, "tiles", database, "-o", s.temp(name)])
    s.check("a terrain without tiles says so, and so does the service: " + sentence, status == 1 and sentence in said and v.judge_refusal("quantized-mesh", database, said) == [], said)

s.finish()
