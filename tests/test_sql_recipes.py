#!/usr/bin/python3
"""What the recipes of sql/ compute, beside computations of another kind. (That they give the rows that stand in them, tests/sql_runner.py sees.)"""
import math
import os
import shutil
import sqlite3

import sql_support as s
from sql_support import check, equal, one, rows

DEMO = s.temp("demo.gpkg")
s.import_terrain(DEMO, s.DEMO, name="white_mountains")


def after(script, database=DEMO, change=None):
    """A connection in which the script has run, on a copy of the database; change: (text, other text)."""
    copy = s.temp(os.path.basename(script) + ".gpkg")
    shutil.copy(database, copy)
    with open(os.path.join(s.ROOT, "sql", script)) as stream:
        text = stream.read()
    for old, new in change or ():
        if old not in text:
            raise RuntimeError("%s has no %r" % (script, old))
        text = text.replace(old, new)
    db = s.connect(copy)
    db.executescript(text)
    return db


# ------------------------------------------------------------------------------------------------- cut and fill
def inside(ring, x, y):
    crossings = 0
    for (x0, y0), (x1, y1) in zip(ring, ring[1:]):
        if (y0 > y) != (y1 > y) and x < x0 + (y - y0) * (x1 - x0) / (y1 - y0):
            crossings += 1
    return crossings % 2 == 1


def by_columns(db, wkt, design, metres_x, metres_y, n):
    """Cut and fill as a sum over columns on a grid of n x n over the polygon's box, heights by rqt_height."""
    ring = [tuple(map(float, p.split())) for p in wkt[9:-2].split(",")]
    x0, x1 = min(p[0] for p in ring), max(p[0] for p in ring)
    y0, y1 = min(p[1] for p in ring), max(p[1] for p in ring)
    area = (x1 - x0) / n * metres_x * (y1 - y0) / n * metres_y
    cut = fill = 0.0
    for i in range(n):
        for j in range(n):
            x, y = x0 + (i + 0.5) * (x1 - x0) / n, y0 + (j + 0.5) * (y1 - y0) / n
            if inside(ring, x, y):
                h = one(db, "SELECT rqt_height(?, ?)", x, y) - design
                cut, fill = cut + max(h, 0) * area, fill + max(-h, 0) * area
    return cut, fill


def near(a, b, relative):
    return abs(a - b) <= relative * max(abs(a), abs(b))


db = after("recipes/cut_and_fill.sql")
wkt, design = rows(db, "SELECT area, design FROM site")[0]
cut, fill, area = rows(db, "SELECT sum(above), sum(above - net), sum(area) FROM volumes")[0]
phi = math.radians(44.26)
w = 1 - 0.00669437999014132 * math.sin(phi) ** 2
wanted = by_columns(db, wkt, design, math.radians(1) * 6378137 * math.cos(phi) / math.sqrt(w), math.radians(1) * 6378137 * (1 - 0.00669437999014132) / w ** 1.5, 200)
check("cut and fill in degrees are those of a sum over columns", near(cut, wanted[0], 5e-3) and near(fill, wanted[1], 5e-3) and min(wanted) > 1e6, ((cut, fill), wanted))
check("its area is rqt_area's", near(area, one(db, "SELECT planimetric FROM rqt_area(?, 0)", wkt), 1e-6), area)
db.close()

# A plane through the design height, over a rectangle off the samples: what is above is half a prism.
plane = s.temp("plane.gpkg")
s.import_terrain(plane, s.write_grid(s.temp("plane.asc"), [[2 * i for i in range(9)] for _ in range(9)]), name="plane")
site = "POLYGON((1.25 -6.5, 6.75 -6.5, 6.75 -1.5, 1.25 -1.5, 1.25 -6.5))"
db = after("recipes/cut_and_fill.sql", plane, (("'POLYGON((-71.4480 44.2560, -71.4400 44.2560, -71.4400 44.2620, -71.4450 44.2640, -71.4480 44.2560))'", "'%s'" % site), ("506.0 AS design", "8.0 AS design")))
cut, fill, area = rows(db, "SELECT sum(above), sum(above - net), sum(area) FROM volumes")[0]
check("a plane cut by the design height: both sides are prisms", near(cut, 5 * 2.75 * 5.5 / 2, 1e-12) and near(fill, 5 * 2.75 * 5.5 / 2, 1e-12) and near(area, 5.5 * 5, 1e-12), (cut, fill, area))
db.close()

# ---------------------------------------------------------------------------------------------- profile and roads
db = after("recipes/profile.sql")
along = rows(db, "SELECT distance, x, y, z FROM profile ORDER BY distance")
off = [abs(z - one(db, "SELECT rqt_height(?, ?, 5)", x, y)) for _, x, y, z in along[1:-1]]
check("the profile's rows are on the mesh", len(along) > 300 and max(off) < 1e-3, max(off))
check("and within eps of the full resolution", max(abs(z - one(db, "SELECT rqt_height(?, ?)", x, y)) for _, x, y, z in along) <= 5)
db.close()
db = after("recipes/roads.sql", change=(("CREATE TEMP TABLE roads(", "CREATE TABLE roads("),))
found = rows(db, "SELECT id, count(*), max(distance) FROM along GROUP BY id")
check("every road has its rows", [r[0] for r in found] == [1, 2] and all(r[1] > 50 for r in found), found)
db.close()

# ------------------------------------------------------------------------------------------------ layer and views
db = after("layer.sql")
layer = db.execute("PRAGMA database_list").fetchone()[2]
equal("the layer holds rqt_triangles' geometries", rows(db, "SELECT geom FROM terrain_mesh ORDER BY fid"), rows(db, "SELECT gpkg FROM rqt_triangles(rqt_bbox(-71.40, 44.20, -71.20, 44.34), 20)"))
equal("nothing of ours is in a view or trigger of the file", rows(db, "SELECT name FROM sqlite_schema WHERE type IN ('view', 'trigger')"), [])
equal("the file is sound, and so is the terrain", rows(db, "PRAGMA quick_check") + rows(db, "SELECT * FROM rqt_check"), [("ok",)])
db.close()
said = s.run(["ogrinfo", "-ro", "-al", "-so", layer, "terrain_mesh"])[0]
check("OGR reads it, without rqt.so", "3D Polygon" in said and "Feature Count: 8741" in said and 'ID["EPSG",4326]' in said and "ERROR" not in said and "Warning" not in said, said)
with open(os.path.join(s.ROOT, "sql", "layer.sql")) as stream:
    again, status = s.run(["sqlite3", "-batch", "-bail", layer, "-cmd", ".load " + s.RQT_SO], text=stream.read())
equal("run again, it replaces the layer", (status, sqlite3.connect(layer).execute("SELECT count(*) FROM gpkg_contents WHERE table_name = 'terrain_mesh'").fetchone()), (0, (1,)))
db = after("views.sql")
name = db.execute("PRAGMA database_list").fetchone()[2]
equal("a terrain's frame is its region", rows(db, "SELECT (SELECT count(*) FROM rqt_range(geom, 200)) = (SELECT count(*) FROM rqt_range(NULL, 200)) FROM terrain_frames"), [(1,)])
db.close()
equal("the views are gone with the session", sqlite3.connect(name).execute("SELECT count(*) FROM sqlite_schema WHERE type = 'view'").fetchone(), (0,))
s.finish()
