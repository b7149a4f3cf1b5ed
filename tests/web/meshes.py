#!/usr/bin/python3
"""meshes.py OUT WHAT - meshes of terrains as the bytes that SQL gives, for the tests of src/web.

OUT holds records: 1 byte what ('M' a mesh in wire format, 'D' an increment of rqt_delta on the one before, 'I' an increment of a view, 'X' the
mesh before in format indexed, 'Z' a zstd frame, 'P' what the one before stands for, 'J' JSON), 4 bytes each the sizes of name and bytes, the name, the bytes.
"""
import ctypes
import ctypes.util
import json
import os
import struct
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import sql_support as s  # noqa: E402
from sql_support import one  # noqa: E402

out = open(sys.argv[1], "wb")


def put(what, name, blob):
    name = name.encode()
    out.write(what.encode() + struct.pack("<II", len(name), len(blob)) + name + blob)


def terrain(name, source, **options):
    path = s.temp(name + ".db")
    s.import_terrain(path, source, name=name, **options)
    return s.connect(path)


def grid_terrain(name, grid, crs=None, x0=0, y0=None, cell=1, **options):
    return terrain(name, s.write_grid(s.temp(name + ".asc"), grid, x0, y0, cell, crs), **options)


def camera(x, y, z, **more):
    return json.dumps(dict({"eye": [x, y, z], "yaw": 20, "pitch": -40, "fovy": 60, "width": 400, "height": 300, "tau": 2}, **more))


def wire():
    """Terrains of many sizes and blocks; whole and in windows, with normals, as views, and what makes them finer."""
    for width, height, block, voids in ((1, 1, None, 0), (2, 3, None, 0), (4, 1, None, 0), (5, 17, 1, 0), (17, 5, 2, 0), (100, 37, 3, 0), (100, 37, 5, 60),
                                        (37, 61, 2, 90), (34, 18, 4, 0), (65, 65, 6, 0), (130, 97, 7, 20), (50, 40, 3, 700), (33, 65, 1, 5)):
        name = "%dx%d k%s v%d" % (width, height, block, voids)
        options = {} if block is None else {"block": block}
        db = grid_terrain(name.replace(" ", "_"), s.rough_grid(width, height, width + height, voids), **options)
        windows = (None, "POLYGON((3.2 -9.7, 21.4 -9.7, 21.4 -30.1, 3.2 -30.1, 3.2 -9.7))", "LINESTRING(1 -1, 30 -17)", "POINT(9 -9)",
                   "POLYGON((-9 50, -8 50, -8 51, -9 50))")
        for number, region in enumerate(windows):
            before = None
            for eps in (float("inf"), 50, 10, 3, 0):
                title = "%s window %d eps %g" % (name, number, eps)
                if before is not None and number < 2:
                    put("D", title, one(db, "SELECT rqt_delta(?, ?, ?)", region, before, eps))
                if before is None or number > 1:
                    put("M", title, one(db, "SELECT rqt_mesh(?, ?, 'rqt')", region, eps))
                before = eps
        for extra in ("normals", "errors", "normals+errors"):
            put("M", "%s %s" % (name, extra), one(db, "SELECT rqt_mesh(NULL, 4, ?)", "rqt+" + extra))
        if width > 30:
            for eps in (2, 40):
                for what, form in (("M", "rqt"), ("X", "indexed")):
                    put(what, "%s tol %d" % (name, eps), one(db, "SELECT rqt_mesh(NULL, ?, ?, NULL, '{\"outline\":\"tol\"}')", eps, form))
    for file, block in (("glarus_1arc_native_161.tif", 5), ("glarus_alpine_25m_161.tif", 7), ("SainteHelens.dem", 7), ("N42E001.hgt.zip", 8)):
        db = terrain(file.split(".")[0], os.path.join(s.DATA, file), block=block)
        for eps in (0, 5, 50) if not file.startswith("N4") else (10, 50):
            put("M", "%s eps %d" % (file, eps), one(db, "SELECT rqt_mesh(NULL, ?, 'rqt')", eps))
        x0, y0, dx, dy, width, height, top = one(db, "SELECT x0, y0, dx, dy, width, height, max_z FROM rqt_terrains")
        for n in range(4):
            view = camera(x0 + dx * width * (n + 1) / 5, y0 + dy * height * .9, top + 300 + 500 * n, yaw=40 * n - 60, pitch=-15 - 5 * n)
            put("M", "%s view %d" % (file, n), one(db, "SELECT rqt_view_mesh(?, 'rqt')", view))


def views():
    """Cameras one after the other: increments from the first to the last, and after each the same mesh in the formats rqt and indexed."""
    for name, width, height, voids, block, options in (("plain", 65, 65, 0, 4, {}), ("clamped", 90, 67, 20, 4, {"cover": "terrain"}), ("void", 70, 70, 400, 3, {})):
        db = grid_terrain(name, s.rough_grid(width, height, 7, voids), cell=10, block=block)
        token = ""
        for n in range(20):
            view = camera(200 + 20 * n, -500 + 20 * n, 400 - 10 * n, yaw=20 + 9 * n, pitch=-40 + n, tau=2 if n < 10 else 4)
            given = json.dumps(dict(options, previous=token))
            blob, after = (one(db, "SELECT rqt_view_mesh(?, ?, ?, ?)", view, what, name, given) for what in ("increment", "rqt"))
            put("I", "%s %d" % (name, n), blob)
            put("M", "%s %d" % (name, n), after)
            size = struct.unpack_from("<I", blob, 40)[0]
            at = 48 + 80 * blob[5]
            token = blob[at:at + size].decode()


def morph():
    """Of each terrain meshes of several eps, the first exact; and views."""
    window = "POLYGON((13.2 -9.7, 51.4 -9.7, 41.4 -40.1, 13.2 -40.1, 13.2 -9.7))"
    for name, width, height, block, voids, region in (("square", 33, 33, 3, 0, None), ("large", 65, 65, 5, 0, None), ("oblong", 61, 37, 3, 0, None),
                                                      ("wide", 40, 35, 4, 0, None), ("thin", 5, 47, 2, 0, None), ("void", 33, 33, 3, 90, None),
                                                      ("clamped void", 50, 40, 4, 60, None), ("window", 65, 65, 4, 0, window), ("tiny", 2, 3, None, 0, None)):
        options = {} if block is None else {"block": block}
        db = grid_terrain(name.replace(" ", "_"), s.rough_grid(width, height, width + 3 * height, voids), **options)
        for eps in (0, 2, 8, 25, 1000):
            put("M", "%s eps %d" % (name, eps), one(db, "SELECT rqt_mesh(?, ?, 'rqt', NULL, '{\"outline\":\"tol\"}')", region, eps))
        for n in range(3 if width > 30 else 0):
            view = camera(20 + 10 * n, -height - 20, 150, yaw=20 * n - 20, pitch=-35, tau=6 - n)
            put("M", "%s view %d" % (name, n), one(db, "SELECT rqt_view_mesh(?, 'rqt')", view))


def small():
    """Meshes and first increments of a few hundred bytes, to be spoiled."""
    window = "POLYGON((3.2 -3.7, 15.4 -3.7, 15.4 -12.1, 3.2 -12.1, 3.2 -3.7))"
    for width, height, block, voids in ((1, 1, None, 0), (2, 3, None, 0), (5, 17, 1, 0), (17, 17, 4, 0), (34, 18, 4, 0), (25, 31, 2, 90), (30, 20, 3, 60)):
        name = "%dx%d_%s" % (width, height, block)
        options = {} if block is None else {"block": block}
        db = grid_terrain(name, s.rough_grid(width, height, 5 * width + height, voids), **options)
        for region in (None, window):
            for eps in (float("inf"), 20, 3, 0):
                put("M", "%s eps %g" % (name, eps), one(db, "SELECT rqt_mesh(?, ?, 'rqt')", region, eps))
            for extra in ("normals", "errors", "normals+errors"):
                put("M", "%s %s" % (name, extra), one(db, "SELECT rqt_mesh(?, 6, ?)", region, "rqt+" + extra))
        if width > 10:
            put("I", name, one(db, "SELECT rqt_view_mesh(?, 'increment', NULL, '{\"previous\":\"\"}')", camera(width / 2, -height - 9, 90, tau=6, yaw=0)))


def places():
    """Meshes, and behind each where SQL puts its vertices, as JSON: [[col, row, x, y, z] ...], space for longitude and latitude."""
    for name, options in (("lonlat", dict(x0=10, y0=46, cell=0.01, crs=s.WGS84)), ("south", dict(x0=-179.99, y0=-89.5, cell=0.004, crs=s.WGS84)),
                          ("plane", dict(x0=612345.5, y0=5000000.25, cell=25))):
        db = grid_terrain(name, s.rough_grid(30, 41, 9), **options)
        put("M", name, one(db, "SELECT rqt_mesh(NULL, 3, 'rqt')"))
        frame = None if name == "plane" else json.dumps({"frame": "ecef"})
        put("J", name, json.dumps(db.execute("SELECT col, row, x, y, z FROM rqt_range(NULL, 3, NULL, ?)", (frame,)).fetchall()).encode())


def zstd():
    """Frames by libzstd, each with what it stands for behind it."""
    library = ctypes.CDLL(ctypes.util.find_library("zstd") or "libzstd.so.1")
    library.ZSTD_compress.restype = library.ZSTD_compressBound.restype = ctypes.c_size_t
    library.ZSTD_compressBound.argtypes = [ctypes.c_size_t]
    library.ZSTD_compress.argtypes = [ctypes.c_char_p, ctypes.c_size_t, ctypes.c_char_p, ctypes.c_size_t, ctypes.c_int]
    dice = s.Dice(3)
    text = open(os.path.join(s.ROOT, "src", "core", "FORMAT.md"), "rb").read()
    contents = {"nothing": b"", "one byte": b"a", "one byte often": b"x" * 400000, "text": text, "page": text[:6000], "noise": bytes(dice.below(256) for _ in range(140000)),
                "two letters": bytes(97 + dice.below(2) for _ in range(3000)), "slope": bytes(min(dice.below(30) for _ in range(4)) for _ in range(20000)),
                "repeats": b"".join(text[at:at + 3 + dice.below(70)] for at in (dice.below(9000) for _ in range(400))),
                "short": b"hello hello hello hello world", "runs": b"".join(bytes([dice.below(4)]) * (1 + dice.below(300)) for _ in range(200))}
    for name, content in contents.items():
        for level in (-5, 1, 3, 9, 19):
            room = ctypes.create_string_buffer(library.ZSTD_compressBound(len(content)))
            size = library.ZSTD_compress(room, len(room), content, len(content), level)
            put("Z", "%s, level %d" % (name, level), room.raw[:size])
            put("P", name, content)


{"wire": wire, "views": views, "morph": morph, "places": places, "small": small, "zstd": zstd}[sys.argv[2]]()
