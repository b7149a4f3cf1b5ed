"""The judges of 3D Tiles and of Terrarium (tests/verify_tiles.py) are judged: a small terrain's tiles pass, and each thing that is
spoiled in a copy of them is seen, under its name."""
import json
import math
import os
import shutil
import struct
import zlib

import numpy as np

import sql_support as s
import verify_tiles as v

# Steep, with a lake of voids and some more.
window = s.temp("window.tif")
s.run(["gdal_translate", "-q", "-srcwin", "30", "40", "85", "73", os.path.join(s.DATA, "glarus_1arc_native_161.tif"), window])
grid = s.read_raster(window)
for row in range(73):
    for col in range(85):
        if math.hypot(col - 50, row - 30) < 11 + 3 * math.sin(row) or (row * 85 + col) % 1511 == 7:
            grid[row][col] = None
RASTER = s.write_grid(s.temp("lake.asc"), grid, 8.97, 46.93, 1 / 3600, s.WGS84)
DATABASE = s.temp("lake.gpkg")
s.import_terrain(DATABASE, RASTER, name="t", block=3)
PROMISES = {"3d-tiles": 23, "terrarium": 12}
FOLDERS = {kind: s.temp(kind) for kind in PROMISES}
for kind, folder in FOLDERS.items():
    s.equal(kind + ": rqt tiles", s.run([s.RQT, "tiles", DATABASE, "--kind", kind, "-o", folder]), ("", 0))
    told, status = v.judge(kind, RASTER, folder)
    wrong = [line for line in told.splitlines() if line.startswith("FAILED") or line.startswith("    ")]
    s.check(kind + ": the judge finds nothing", status == 0 and not wrong, wrong[:4] or told[-300:])
    # Nothing that it asks for was left out.
    s.check(kind + ": ... and looked at every promise", told.count("\nok ") == PROMISES[kind] and " (0 looked at" not in told, told)
    served, missing, faults = v.judge_service(kind, DATABASE, "t", folder)
    s.check("%s: the service has what is there, and nothing else (%d, %d)" % (kind, served, missing), served > 10 and missing > 10 and not faults, faults[:3])
    s.equal(kind + ": compressed tiles are the same, unpacked", v.judge_compressed(kind, DATABASE, folder), [])


def read(path):
    with open(path, "rb") as f:
        return f.read()


def write(path, data):
    os.remove(path)  # it may be the same file in two folders
    with open(path, "wb") as f:
        f.write(data)


def copy_of(kind):
    copy = s.temp("copy")
    shutil.copytree(FOLDERS[kind], copy, copy_function=os.link)
    return copy


def sees(kind, spoil, *expected):
    """The judge names each promise when a copy of the folder is spoiled, and exits with 1. expected: what is wrong, promise, ..."""
    copy = copy_of(kind)
    spoil(copy)
    told, status = v.judge(kind, RASTER, copy)
    shutil.rmtree(copy)
    failed = [line for line in told.splitlines() if line.startswith("FAILED")]
    for what, promise in zip(expected[::2], expected[1::2]):
        named = any(line.startswith("FAILED " + promise) for line in failed)
        s.check("spoiled: %s: %s: the judge sees it" % (kind, what), status == 1 and named, failed or told[-300:])


def in_document(kind, change):
    def spoil(folder):
        path = os.path.join(folder, v.KINDS[kind][0])
        document = json.loads(read(path))
        change(document)
        write(path, json.dumps(document).encode())
    return spoil


# -------------------------------------------------------------------------------------------------------------- 3D Tiles


class Glb:
    """A content, to be changed: positions in glTF's axes, normals as bytes, triangles; written again in place."""

    def __init__(self, data):
        self.data = bytearray(data)
        length = struct.unpack_from("<I", data, 12)[0]
        self.json = json.loads(data[20:20 + length])
        self.buffer = 28 + length
        self.counts = [a["count"] for a in self.json["accessors"]]
        self.at = [self.buffer + view["byteOffset"] for view in self.json["bufferViews"]]
        x, y, z = self.json["nodes"][0]["matrix"][12:15]
        self.up = [d / math.hypot(x, y, z) for d in (x, y, z)]

    def position(self, i):
        return struct.unpack_from("<3f", self.data, self.at[0] + 12 * i)

    def move(self, i, by):
        """Upward."""
        struct.pack_into("<3f", self.data, self.at[0] + 12 * i, *(p + by * u for p, u in zip(self.position(i), self.up)))

    def triangles(self):
        return [struct.unpack_from("<3H", self.data, self.at[2] + 6 * i) for i in range(self.counts[2] // 3)]

    def set_triangle(self, i, corners):
        struct.pack_into("<3H", self.data, self.at[2] + 6 * i, *corners)

    def free(self):
        """The tile's ends in its JSON are no longer true when a vertex moves: without them it is as good a glTF for the judge."""
        text = json.dumps({**self.json, "accessors": [{k: a[k] for k in a if k not in ("min", "max")} for a in self.json["accessors"]]}).encode()
        length = self.buffer - 28
        assert len(text) <= length + 200
        text += b" " * (-len(text) % 4)
        return struct.pack("<4sIIII", b"glTF", 2, len(self.data) - length + len(text), len(text), 0x4E4F534A) + text + bytes(self.data[20 + length:])


FILES = v.read_files(FOLDERS["3d-tiles"])
CONTENTS = sorted(p for p in map(v.place_of, FILES) if p and p[4] == ".glb")
FINEST = CONTENTS[-1][1]


def has_voids(place):
    """Of a tile's cell of the last level: 8 samples a side, rows from the south."""
    col, row = 8 * place[2], 8 * ((1 << FINEST) - 1 - place[3])
    return any(z is None for line in grid[row:row + 9] for z in line[col:col + 9])


def content(place):
    return "content/%d/%d/%d.glb" % place


WHOLE = next((z, x, y) for _, z, x, y, _ in CONTENTS if z == FINEST and x == 2 and not has_voids((z, z, x, y)))
TORN = next((z, x, y) for _, z, x, y, _ in CONTENTS if z == FINEST and has_voids((z, z, x, y)) and len(FILES[content((z, x, y))]) > 2500)


def in_content(spoil, place=WHOLE):
    def in_folder(folder):
        path = os.path.join(folder, content(place))
        glb = Glb(read(path))
        before = glb.free()
        spoil(glb)
        assert before != glb.free()
        write(path, glb.free())
    return in_folder


def on_rim(glb):
    """Vertices that are in fewer than six triangles: of the sides, and of others where the mesh is coarse."""
    uses = [sum(i in t for t in glb.triangles()) for i in range(glb.counts[0])]
    return [i for i, n in enumerate(uses) if n <= 3], [i for i, n in enumerate(uses) if n >= 4]


def raise_inner(glb):
    glb.move(on_rim(glb)[1][0], 20)


def raise_side(glb):
    for i in on_rim(glb)[0]:
        glb.move(i, 1 / 1024)


def bend(which):
    def spoil(glb):
        for i in on_rim(glb)[which]:
            glb.data[glb.at[1] + 4 * i] ^= 0x08
    return spoil


def drop(glb):
    count = glb.counts[2] // 3
    glb.set_triangle(count - 1, glb.triangles()[0])  # twice there, and one is missing
    a, b, c = glb.triangles()[0]
    glb.set_triangle(0, (a, b, b))


def turn(glb):
    a, b, c = glb.triangles()[3]
    glb.set_triangle(3, (a, c, b))


def leave_out(glb):
    """A vertex with four triangles around it goes: two over its square are left."""
    all_ = glb.triangles()
    for m in range(glb.counts[0]):
        around = [i for i, t in enumerate(all_) if m in t]
        after = {}
        for i in around:
            k = all_[i].index(m)
            after[all_[i][(k + 1) % 3]] = all_[i][(k + 2) % 3]
        if len(around) == 4 and len(after) == 4 and set(after) == set(after.values()):
            a = min(after)
            b, c, d = after[a], after[after[a]], after[after[after[a]]]
            glb.set_triangle(around[0], (a, b, c))
            glb.set_triangle(around[1], (a, c, d))
            for i in around[2:]:
                glb.set_triangle(i, all_[next(k for k in range(len(all_)) if k not in around)])
            return


def change_index(glb):
    glb.set_triangle(1, (0, 1, 60000))


def in_subtrees(change, chosen=lambda level: True):
    """change(bytes, offset of the errors, how many, offset of the regions, JSON): of every subtree of such a level."""
    def spoil(folder):
        for path in (p for p in FILES if p.endswith(".subtree") and chosen(v.place_of(p)[1])):
            data = bytearray(read(os.path.join(folder, path)))
            length = struct.unpack_from("<Q", data, 8)[0]
            told = json.loads(data[24:24 + length])
            table, views = told["propertyTables"][0], told["bufferViews"]
            at = [24 + length + views[table["properties"][name]["values"]]["byteOffset"] for name in ("error", "region")]
            change(data, at[0], table["count"], at[1], told)
            write(os.path.join(folder, path), data)
    return spoil


def scale(data, at, count, factor):
    struct.pack_into("<%dd" % count, data, at, *[n * factor for n in struct.unpack_from("<%dd" % count, data, at)])


def lower_roof(data, errors, count, regions, told):
    for i in range(count):
        scale(data, regions + 48 * i + 40, 1, 0.5)


def shift_second(data, errors, count, regions, told):
    """Its west."""
    scale(data, regions + 48, 1, 0.999)


def hide_content(data, errors, count, regions, told):
    """Of the last tile that has one."""
    content = told["contentAvailability"][0]
    if "constant" in content:
        return
    view = told["bufferViews"][content["bitstream"]]
    at = 24 + struct.unpack_from("<Q", data, 8)[0] + view["byteOffset"]
    bit = max(i for i in range(8 * view["byteLength"]) if data[at + i // 8] >> i % 8 & 1)
    data[at + bit // 8] ^= 1 << bit % 8
    old, new = (b'"availableCount":%d' % (content["availableCount"] - less) for less in (0, 1))
    begin = data.index(old, data.index(b'"contentAvailability"'))
    data[begin:begin + len(old)] = new.ljust(len(old))


def widen(document):
    document["root"]["boundingVolume"]["region"][3] += 1e-5


BLOCKS = "3d-tiles"
sees(BLOCKS, in_subtrees(lambda d, e, n, r, t: scale(d, e, n, 0.5)), "a tile states less than the truth", "space: ")
sees(BLOCKS, in_subtrees(lambda d, e, n, r, t: scale(d, e, n, 1.5)), "... than its content says", "errors: a content tells")
sees(BLOCKS, in_subtrees(lambda d, e, n, r, t: scale(d, e + 8 * (n - 1), 1, 1e6)), "the last tiles state more than those above", "errors: none is larger")
sees(BLOCKS, in_document(BLOCKS, lambda d: d["root"].update(geometricError=d["root"]["geometricError"] / 2)), "the root states too little for clients who halve it", "errors: the root's")
sees(BLOCKS, in_content(raise_inner), "a vertex is 20 m too high", "vertices: ", "... in space", "space: ")
sees(BLOCKS, in_content(raise_side), "vertices of a side are a millimetre higher than the neighbour's", "edges: neighbours have", "... at the corner", "edges: ... and at their corner")
sees(BLOCKS, in_content(bend(0)), "a normal of a side is another", "edges: neighbours have")
sees(BLOCKS, in_content(bend(1)), "a normal is another", "normals: ")
sees(BLOCKS, in_content(drop), "a triangle is missing", "cover: cells without voids")
sees(BLOCKS, in_content(drop, TORN), "... by a void, on the last level", "last: it is the half cells")
sees(BLOCKS, in_content(turn), "a triangle is turned", "turned: ")
sees(BLOCKS, in_content(leave_out), "a vertex of the last level is left out", "last: it goes through")
sees(BLOCKS, in_content(change_index), "an index", "format: every content")
sees(BLOCKS, lambda folder: write(os.path.join(folder, content(WHOLE)), FILES[content(WHOLE)][:700]), "half a content", "format: every content")
sees(BLOCKS, lambda folder: write(os.path.join(folder, "subtrees/0/0/0.subtree"), FILES["subtrees/0/0/0.subtree"][:700]), "half a subtree", "format: tileset.json")
sees(BLOCKS, in_document(BLOCKS, lambda d: d["root"]["implicitTiling"].pop("subtrees")), "tileset.json has no subtrees", "format: tileset.json")
sees(BLOCKS, in_document(BLOCKS, lambda d: d["root"]["implicitTiling"].update(availableLevels=FINEST)), "it has a level less", "format: tileset.json")
sees(BLOCKS, in_document(BLOCKS, lambda d: d["root"]["implicitTiling"].update(availableLevels=FINEST + 2)), "it has a level more", "tiles: ")
sees(BLOCKS, in_subtrees(lower_roof), "heights of regions are half", "regions: tiles lie")
sees(BLOCKS, in_subtrees(shift_second, lambda level: level == 0), "a region reaches out of the one above", "regions: they lie")
sees(BLOCKS, in_document(BLOCKS, widen), "the root's region is no square", "regions: the root's in", "... and its parts have other places", "regions: the root's, divided")
sees(BLOCKS, in_subtrees(hide_content, lambda level: level == 4), "a content is said not to be there", "cover: every sample", "... and is", "listed: ")
sees(BLOCKS, lambda folder: os.remove(os.path.join(folder, content(WHOLE))), "a content is not there", "listed: ")


def shorten(glb):
    glb.json["meshes"][0]["primitives"][1]["extras"]["skirt"] /= 4


def pull_up(glb):
    """The last vertex is a lower end: it goes to its upper one."""
    last = glb.at[3] + 12 * (glb.counts[3] - 1)
    glb.data[last:last + 12] = glb.data[last - 12:last]


def unhook(glb):
    """The last upper end is no longer the ground's."""
    struct.pack_into("<f", glb.data, glb.at[3] + 12 * (glb.counts[3] - 2), 1.0)


def open_wall(glb):
    """All triangles but the first two are the first."""
    for i in range(12, 2 * glb.counts[5], 2):
        glb.data[glb.at[5] + i:glb.at[5] + i + 2] = glb.data[glb.at[5]:glb.at[5] + 2]


sees(BLOCKS, in_content(shorten), "a skirt hangs further down than it says", "skirt: it hangs")
sees(BLOCKS, in_content(pull_up), "it does not hang down", "skirt: it hangs")
sees(BLOCKS, in_content(unhook), "it hangs in the air", "skirt: it hangs")
sees(BLOCKS, in_content(open_wall), "it has a gap", "skirt: all edges")

# ------------------------------------------------------------------------------------------------------------- Terrarium


def chunk(name, data):
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


class Picture:
    """Codes of 256 x 256 pixels and the two texts."""

    def __init__(self, data):
        self.texts, at, packed = {}, 8, b""
        while at < len(data):
            size, name = struct.unpack_from(">I4s", data, at)
            body = data[at + 8:at + 8 + size]
            if name == b"tEXt":
                key, value = body.split(b"\0")
                self.texts[key] = value
            packed += body if name == b"IDAT" else b""
            at += 12 + size
        rows = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(256, 769)
        assert (rows[:, 0] == 2).all()  # filter Up
        rgb = np.cumsum(rows[:, 1:], axis=0, dtype=np.uint8).reshape(65536, 3).astype(np.int32)
        self.codes = rgb[:, 0] << 16 | rgb[:, 1] << 8 | rgb[:, 2]

    def bytes(self):
        rgb = np.stack([self.codes >> shift & 255 for shift in (16, 8, 0)], axis=1).astype(np.uint8).reshape(256, 768)
        rows = np.hstack([np.zeros((256, 1), np.uint8), rgb]).tobytes()
        return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 256, 256, 8, 2, 0, 0, 0)) + b"".join(
            chunk(b"tEXt", key + b"\0" + value) for key, value in self.texts.items()) + chunk(b"IDAT", zlib.compress(rows, 1)) + chunk(b"IEND", b"")


MAPS, ZERO = "terrarium", 0x800000
PNGS = sorted(p for p in map(v.place_of, v.read_files(FOLDERS[MAPS])) if p)
STEPS = json.loads(read(os.path.join(FOLDERS[MAPS], "tile.json")))["steps"]


def fullest(level):
    return max((p for p in PNGS if p[1] == level), key=lambda p: os.path.getsize(os.path.join(FOLDERS[MAPS], v.path_of(p))))


LAST, COARSE = fullest(PNGS[-1][1]), fullest(PNGS[-1][1] - 3)


def in_picture(spoil, place=LAST):
    def in_folder(folder):
        path = os.path.join(folder, v.path_of(place))
        picture = Picture(read(path))
        spoil(picture, round(STEPS[place[1]] * 256))
        write(path, picture.bytes())
    return in_folder


def inner(picture):
    """The pixels in the middle of nine that all have heights."""
    known = (picture.codes != ZERO).reshape(256, 256)
    whole = known[1:-1, 1:-1].copy()
    for a in range(3):
        for b in range(3):
            whole &= known[a:a + 254, b:b + 254]
    rows, cols = np.nonzero(whole)
    return (rows + 1) * 256 + cols + 1


def raise_pixels(by):
    """By so many steps."""
    def spoil(picture, step):
        picture.codes[picture.codes != ZERO] += by * step
    return spoil


def lose_pixel(picture, step):
    picture.codes[inner(picture)[-1]] = ZERO


def shift_pixel(picture, step):
    picture.codes[inner(picture)[0]] += 1


def say(key, change):
    def spoil(picture, step):
        picture.texts[key] = b"%.6f" % change(float(picture.texts[key]))
    return spoil


def fill_void(picture, step):
    """All that have none: beyond the raster, and in it."""
    picture.codes[picture.codes == ZERO] += 100 * step


sees(MAPS, in_picture(say(b"error_metres", lambda e: 0.9 * e)), "a tile says less than the truth", "error: ")
sees(MAPS, in_picture(say(b"error_metres", lambda e: 0.5 * e), COARSE), "... on a level of coarser pixels", "error: ")
sees(MAPS, in_picture(say(b"error_metres", lambda e: 3 * e + 10)), "it says far more", "idle: ")
sees(MAPS, in_picture(raise_pixels(1)), "heights are a step too high", "heights: ")
sees(MAPS, in_picture(raise_pixels(8000)), "they are far too high", "error: ")
sees(MAPS, in_picture(lose_pixel), "a pixel has none", "voids: pixels have none where")
sees(MAPS, in_picture(lose_pixel, COARSE), "... on a level of coarser pixels", "voids: pixels have a height where no void")
sees(MAPS, in_picture(lose_pixel), "... and is not counted", "voids: a picture says")
sees(MAPS, in_picture(fill_void), "voids have a height", "voids: pixels have none where", "... beyond the raster", "voids: pixels have no height beyond")
sees(MAPS, in_picture(shift_pixel), "a height is between steps", "steps: ")
sees(MAPS, lambda folder: write(os.path.join(folder, v.path_of(LAST)), read(os.path.join(folder, v.path_of(LAST)))[:200]), "half a picture", "format: ")
sees(MAPS, lambda folder: os.remove(os.path.join(folder, v.path_of(LAST))), "a picture is not there", "listed: ")
sees(MAPS, lambda folder: shutil.copy(os.path.join(folder, v.path_of(LAST)), os.path.join(folder, "0/0/1.png")), "there is another", "listed: ")
sees(MAPS, in_document(MAPS, lambda d: d["bounds"].__setitem__(2, d["bounds"][2] + 0.001)), "bounds are others", "document: ")
sees(MAPS, in_document(MAPS, lambda d: d.update(encoding="mapbox")), "heights mean something else", "document: ")
sees(MAPS, in_document(MAPS, lambda d: d.update(maxzoom=d["maxzoom"] - 1, steps=d["steps"][:-1])), "the last level is not told of", "tiles: ")

# The service and --gzip beside folders that are not theirs.
for kind, path, first in ((BLOCKS, content(WHOLE), content((0, 0, 0))), (MAPS, v.path_of(LAST), "0/0/0.png")):
    copy = copy_of(kind)
    data = bytearray(read(os.path.join(copy, path)))
    data[len(data) // 2] ^= 1
    write(os.path.join(copy, path), data)
    s.check("spoiled: %s: a byte of a tile: the service has another" % kind, any("is served as" in f for f in v.judge_service(kind, DATABASE, "t", copy)[2]))
    s.equal("... and so has --gzip", v.judge_compressed(kind, DATABASE, copy), [path])
    os.remove(os.path.join(copy, first))
    s.check("spoiled: %s: a tile is not there: the service has it" % kind, any("is not there, and the service answers" in f for f in v.judge_service(kind, DATABASE, "t", copy)[2]))
    shutil.rmtree(copy)

s.finish()
