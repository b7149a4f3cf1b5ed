#!/usr/bin/python3
"""rqt_mesh(..., 'rqt') and rqt_delta, read by a decoder written from src/core/FORMAT.md alone: the vertices of rqt_range come back, in the
order in which triangles name them, and the triangles of rqt_triangles in theirs; increments, applied step by step, end in the mesh as asked for at once."""
import os
import struct

import sql_support as s
from sql_support import check, equal, one, raises, rows
from sql_wire import Wire


def indexed(blob):
    """The triangles of format 'indexed', as they stand there."""
    n, m = struct.unpack_from("<QQ", blob, 16)
    v = [struct.unpack_from("<iii", blob, 128 + 12 * i) for i in range(n)]
    index = struct.unpack_from("<%dI" % m, blob, 128 + 12 * n)
    return [tuple(v[i] for i in index[t:t + 3]) for t in range(0, m, 3)]


def compare(title, wire, db, region, eps):
    equal(title + ": the vertices of rqt_range", sorted(wire.vertices),
          sorted(rows(db, "SELECT col, row, q, level FROM rqt_range(?, ?)", region, eps)))
    apex_first = {}
    for t in wire.triangles:
        for corner in sorted(t):
            apex_first.setdefault(corner, len(apex_first))
    check(title + ": each vertex where a triangle first names it", all(i == n for i, n in apex_first.items()) and len(apex_first) == len(wire.vertices))
    equal(title + ": triangles in the order of the walk", wire.positions(), indexed(one(db, "SELECT rqt_mesh(?, ?, 'indexed')", region, eps)))
    equal(title + ": its eps", wire.eps, float(eps))


sizes = []
chains = 0
grids = (("plain", s.rough_grid(70, 70, 11), 3, None), ("voids", s.rough_grid(37, 61, 12, 90), 2, None), ("clamped", s.rough_grid(34, 18, 13), 4, None),
         ("islands", s.rough_grid(50, 40, 14, 700), 3, None), ("feet", s.rough_grid(33, 65, 15, 20), 6, "us-ft"), ("row", [[1, 2, 3, 5]], None, None))
for name, grid, block, unit in grids:
    path = s.temp(name + ".db")
    options = {"name": name}
    if block:
        options["block"] = block
    if unit:
        options["unit"] = unit
    s.import_terrain(path, s.write_grid(s.temp(name + ".asc"), grid), **options)
    db = s.connect(path)
    windows = (None, "POLYGON((3.2 -9.7, 21.4 -9.7, 21.4 -30.1, 3.2 -30.1, 3.2 -9.7))", "LINESTRING(1 -1, 30 -17)", "POINT(9 -9)", "POLYGON((-9 50, -8 50, -8 51, -9 50))")
    for region in windows:
        title = "%s, %s" % (name, region and region[:12])
        before = None
        for eps in (float("inf"), 30, 10, 4, 1, 0):
            blob = one(db, "SELECT rqt_mesh(?, ?, 'rqt')", region, eps)
            whole = Wire(blob)
            sizes.append(len(whole.triangles))
            compare("%s, eps %g" % (title, eps), whole, db, region, eps)
            if before:
                step = Wire(one(db, "SELECT rqt_delta(?, ?, ?)", region, before.eps, eps), before)
                compare("%s, eps %g to %g" % (title, before.eps, eps), step, db, region, eps)
                before = step
                chains += 1
            else:
                before = whole
    db.close()
check("the meshes were of many sizes", 0 in sizes and max(sizes) > 5000 and chains > 100, (max(sizes), chains))

path = s.temp("alpine.gpkg")
s.import_terrain(path, os.path.join(s.DATA, "glarus_alpine_25m_161.tif"), name="alpine")
db = s.connect(path)
blob = one(db, "SELECT rqt_mesh(NULL, 2, 'rqt')")
compare("alpine, eps 2", Wire(blob), db, None, 2)
n = one(db, "SELECT count(*) FROM rqt_range(NULL, 2)")
check("it takes less than a twelfth of format indexed", 12 * len(blob) < len(one(db, "SELECT rqt_mesh(NULL, 2, 'indexed')")), (len(blob), n))
nothing = len(one(db, "SELECT rqt_delta(NULL, 2, 2)"))
check("an increment of nothing is small", nothing < 400, nothing)
check("an increment is less than the mesh", len(one(db, "SELECT rqt_delta(NULL, 5, 2)")) < len(blob))
equal("equal meshes are equal bytes", one(db, "SELECT rqt_mesh(NULL, 2, 'rqt', 'alpine', '{\"select\":\"bottomup\"}')"), blob)
equal("eps -0.0 is 0, in the bytes too", one(db, "SELECT rqt_mesh(NULL, ?, 'rqt')", -0.0), one(db, "SELECT rqt_mesh(NULL, 0, 'rqt')"))
raises("eps_from below eps_to", "rqt_delta(): eps_from must not be less than eps_to; it is 1.0", lambda: one(db, "SELECT rqt_delta(NULL, 1.0, 2)"))
raises("eps_to below zero", "rqt_delta(): eps_to must be 0 or more; it is -1.0", lambda: one(db, "SELECT rqt_delta(NULL, 1, -1.0)"))
raises("eps_from is no number", "rqt_delta(): eps_from must be a number; it is NULL", lambda: one(db, "SELECT rqt_delta(NULL, NULL, 1)"))
raises("an unknown terrain", "rqt_delta()", lambda: one(db, "SELECT rqt_delta(NULL, 2, 1, 'nowhere')"))
db.close()
s.finish()
