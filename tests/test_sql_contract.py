#!/usr/bin/python3
"""The SQL functions are those of the contract: names, columns, purity; and every example of rqt_help runs."""
import math
import sqlite3
import struct

import sql_support as s
from sql_support import check, equal, one, rows

MESH = ["region", "eps", "terrain", "options"]
VIEW = ["camera", "terrain", "options"]
TABLES = {  # visible columns, then the arguments
    "rqt_help": (None, []),
    "rqt_terrains": ("name srid width height cell_x cell_y min_z max_z quantum voids blocks bytes max_error", []),
    "rqt_range": ("x y z error level", MESH),
    "rqt_triangles": ("id x0 y0 z0 x1 y1 z1 x2 y2 z2", MESH),
    "rqt_strip": ("seq x y z", MESH),
    "rqt_answer": ("mesh vertices triangles achieved_eps", ["region", "eps", "format", "terrain", "options"]),
    "rqt_view_answer": ("mesh vertices triangles achieved_tau guaranteed token", ["camera", "format", "terrain", "options"]),
    "rqt_verify": ("samples vertices triangles max_error rms_error x y t_junctions overlaps uncovered area", MESH),
    "rqt_explain": ("level extent why bytes cached selected", MESH),
    "rqt_view": ("x y z error level", VIEW),
    "rqt_view_triangles": ("id x0 y0 z0 x1 y1 z1 x2 y2 z2", VIEW),
    "rqt_view_strip": ("seq x y z", VIEW),
    "rqt_view_explain": ("level extent why bytes cached selected", VIEW),
    "rqt_view_verify": ("samples drawn vertices triangles max_pixels rms_pixels x y z t_junctions overlaps", VIEW),
    "rqt_profile": ("distance x y z", ["line", "eps", "terrain"]),
    "rqt_area": ("planimetric surface volume", MESH),
    "rqt_check": ("severity block message", ["terrain"]),
}
SCALARS = {  # argument counts, deterministic
    "rqt_version": ([0], True),
    "rqt_build_info": ([0], None),
    "rqt_mesh": ([3, 4, 5], False),
    "rqt_view_mesh": ([2, 3, 4], False),
    "rqt_height": ([2, 3, 4], False),
    "rqt_bbox": ([4, 5], True),
    "rqt_circle": ([3], True),
    "rqt_corridor": ([2], True),
    "rqt_delta": ([3, 4], False),
    "rqt_block_info": ([1], True),
    "rqt_block_check": ([1], True),
    "rqt_block_dump": ([1], True),
    "rqt_limit": ([1, 2], False),
}
DETERMINISTIC, DIRECTONLY, INNOCUOUS = 0x800, 0x80000, 0x200000

db = s.connect()

help_rows = rows(db, "SELECT name, kind, arguments, returns, purpose, example FROM rqt_help")
equal("rqt_help has a row for every function of this version", sorted(r[0] for r in help_rows), sorted(list(TABLES) + list(SCALARS)))
check("rqt_help leaves nothing empty", all(all(text for text in r[3:]) for r in help_rows))
for name, kind, arguments, returns, purpose, example in help_rows:
    equal("rqt_help says what %s is" % name, kind, "table" if name in TABLES else "scalar")
    check("the example of %s uses it" % name, name in example, example)

for name, (columns, arguments) in TABLES.items():
    found = rows(db, "SELECT name, hidden FROM pragma_table_xinfo(?)", name)
    visible = [n for n, hidden in found if not hidden]
    if columns:
        equal("%s has the contract's columns" % name, visible, columns.split())
    hidden = [n for n, h in found if h]
    equal("the arguments of %s come first among its hidden columns" % name, hidden[:len(arguments)], arguments)

listed = {}
for name, builtin, kind, encoding, arguments, flags in rows(db, "SELECT * FROM pragma_function_list WHERE name LIKE 'rqt%'"):
    listed.setdefault(name, []).append((arguments, flags))
equal("no scalar function beside those of the contract", sorted(listed), sorted(SCALARS))
for name, (counts, deterministic) in SCALARS.items():
    equal("%s takes the contract's numbers of arguments" % name, sorted(a for a, f in listed.get(name, [])), counts)
    flags = [f for a, f in listed.get(name, [(0, 0)])]
    if name == "rqt_limit":
        check("rqt_limit changes the connection, and is for no view or trigger", all(f & DIRECTONLY for f in flags), flags)
    else:
        check("%s reads nothing but this connection's databases, and says so" % name,
              all(f & INNOCUOUS and not f & DIRECTONLY for f in flags), flags)
    if deterministic is not None:
        check("%s is %sdeterministic" % (name, "" if deterministic else "not "),
              all(bool(f & DETERMINISTIC) == deterministic for f in flags), flags)
modules = [r[0] for r in rows(db, "SELECT name FROM pragma_module_list WHERE name LIKE 'rqt%'")]
equal("no table-valued function beside those of the contract", sorted(modules), sorted(TABLES))
check("rqt_version is a version", len(one(db, "SELECT rqt_version()").split(".")) >= 2)
check("rqt_build_info names version and SQLite",
      one(db, "SELECT rqt_version()") in one(db, "SELECT rqt_build_info()") and sqlite3.sqlite_version in one(db, "SELECT rqt_build_info()"),
      one(db, "SELECT rqt_build_info()"))
for name in TABLES:
    s.raises("%s cannot be written" % name, "may not be modified", lambda: db.execute("DELETE FROM %s" % name))
db.close()

# ------------------------------------------------------------------------------- the examples, in the demo's database
path = s.temp("demo.gpkg")
s.import_terrain(path, s.DEMO)
demo = s.connect(path)
equal("the import names the terrain after its file", rows(demo, "SELECT name FROM rqt_terrains"), [("N44W072",)])
for name, kind, arguments, returns, purpose, example in help_rows:
    try:
        answer = rows(demo, example)
        check("the example of %s gives an answer" % name, len(answer) > 0 and all(v is not None for v in answer[0]), answer[:1])
    except sqlite3.Error as error:
        check("the example of %s runs" % name, False, "%s: %s" % (example, error))
equal("the example of rqt_verify proves what it claims",
      rows(demo, next(r[5] for r in help_rows if r[0] == "rqt_verify")), [(1, 0, 0, 0)])
equal("the demo's database passes rqt_check", rows(demo, "SELECT * FROM rqt_check"), [])
equal("and SQLite's own check", rows(demo, "PRAGMA quick_check"), [("ok",)])

# the circle of 5 km around a summit: geometry
circle = one(demo, "SELECT rqt_circle(-71.3033, 44.2705, 5000)")
magic, version, flags, srid, x0, x1, y0, y1, order, kind, rings, points = struct.unpack_from("<2sBBi4dBIII", circle)
equal("rqt_circle is a GeoPackage polygon of SRID 4326", (magic, version, flags & 1, srid, order, kind, rings), (b"GP", 0, 1, 4326, 1, 3, 1))
ring = [struct.unpack_from("<2d", circle, 53 + 16 * i) for i in range(points)]
check("its ring is closed", points == 257 and ring[0] == ring[-1], points)


def distance(lon, lat):
    """Metres on the ellipsoid from the summit, good to some parts in a million for such short ones."""
    a, f = 6378137.0, 1 / 298.257223563
    e2 = f * (2 - f)
    middle = math.radians((lat + 44.2705) / 2)
    w = math.sqrt(1 - e2 * math.sin(middle) ** 2)
    north = math.radians(lat - 44.2705) * a * (1 - e2) / w ** 3
    east = math.radians(lon + 71.3033) * a / w * math.cos(middle)
    return math.hypot(north, east)


off = max(abs(distance(*p) - 5000) for p in ring)
check("all its points are 5000 m from the centre", off < 0.05, off)
check("its envelope holds it exactly", (x0, x1, y0, y1) == (min(p[0] for p in ring), max(p[0] for p in ring),
                                                            min(p[1] for p in ring), max(p[1] for p in ring)))
counts = [one(demo, "SELECT count(*) FROM rqt_range(rqt_circle(-71.3033, 44.2705, 5000), ?)", e)
          for e in (0, 0.5, 1, 2, 5, 10, 20, 50, 100, 1e9, float("inf"))]
check("a larger eps never gives more vertices", counts == sorted(counts, reverse=True), counts)
demo.close()
s.finish()
