#!/usr/bin/python3
"""Every format of rqt_mesh holds the triangles of rqt_triangles, bit for bit, each with the same winding."""
import os
from collections import Counter

import sql_support as s
from sql_support import check, equal, one, rows, triangles


def multiset(found):
    return Counter(map(s.rotated, found))


def box_of(found):
    points = [p for t in found for p in t]
    return (min(p[0] for p in points), min(p[1] for p in points), max(p[0] for p in points), max(p[1] for p in points))


def guarded(name, call):
    """A reader's complaint is a failed check."""
    try:
        return call()
    except (AssertionError, ValueError, IndexError, KeyError, TypeError, AttributeError, s.struct.error) as error:
        check(name + " can be read", False, repr(error))
        return None


def compare(title, db, region, eps, srid):
    expected = triangles(db, region, eps)
    def mesh(form):
        return one(db, "SELECT rqt_mesh(?, ?, ?)", region, eps, form)
    for form, kind in (("strip", 1), ("indexed", 2)):
        name = "%s: %s" % (title, form)
        answer = guarded(name, lambda: s.mesh_blob(mesh(form)))
        if answer:
            head, found = answer
            equal(name + " holds the triangles", multiset(found), multiset(expected))
            equal(name + " says what it is", (head["kind"], head["eps"], head["srid"], head["zero"], head["vertices"]),
                  (kind, float(eps), srid, 0, one(db, "SELECT count(*) FROM rqt_range(?, ?)", region, eps)))
            if form == "indexed":
                equal(name + " keeps the order of the list", list(map(s.rotated, found)), list(map(s.rotated, expected)))
            else:
                equal(name + " has rqt_strip's length", head["indices"], one(db, "SELECT count(*) FROM rqt_strip(?, ?)", region, eps))
    for form, read in (("obj", s.obj_triangles), ("ply", s.ply_triangles), ("wkb", s.wkb_triangles)):
        name = "%s: %s" % (title, form)
        found = guarded(name, lambda: read(mesh(form)))
        if found is not None:
            equal(name + " holds the triangles", multiset(found), multiset(expected))
    equal(title + ": a ply says its CRS to QGIS", b"\ncomment crs: EPSG:%d\n" % srid in mesh("ply").split(b"end_header")[0], srid != 0)
    name = title + ": gpkg"
    answer = guarded(name, lambda: s.gpkg_triangles(mesh("gpkg")))
    if answer:
        number, empty, envelope, found = answer
        equal(name + " holds the triangles", multiset(found), multiset(expected))
        b = box_of(expected) if expected else None
        equal(name + " has SRID, flag of emptiness and envelope", (number, empty, envelope),
              (srid or -1, not expected, (b[0], b[2], b[1], b[3]) if b else None))
    name = title + ": spatialite"
    answer = guarded(name, lambda: s.spatialite_triangles(mesh("spatialite")))
    if answer:
        number, box, found = answer
        equal(name + " holds the triangles", multiset(found), multiset(expected))
        equal(name + " has SRID and box", (number, box if expected else None), (srid, box_of(expected) if expected else None))
    return len(expected)


def data(name):
    return os.path.join(s.DATA, name)


sizes = []
# Rounded floats; degrees; feet and voids far from the origin.
path = s.temp("forms.gpkg")
s.import_terrain(path, data("glarus_alpine_25m_161.tif"), name="alpine")
db = s.connect(path)
for eps, region in ((0, "POLYGON((2720500 1209000, 2721200 1209000, 2721200 1210000, 2720500 1210000, 2720500 1209000))"),
                    (5, None), (float("inf"), None), (20, "POINT(2721000 1209000)"), (20, "POINT(0 0)")):
    sizes.append(compare("alpine, eps %g, %s" % (eps, region and region[:7]), db, region, eps, 2056))
db.close()

path = s.temp("degrees.gpkg")
s.import_terrain(path, data("eastafrica.tif"), name="africa")
db = s.connect(path)
sizes.append(compare("africa, eps 100", db, None, 100, 4326))
sizes.append(compare("africa, a circle", db, one(db, "SELECT rqt_circle(30, 0, 100000)"), 10, 4326))
db.close()

path = s.temp("feet.db")
s.import_terrain(path, s.write_grid(s.temp("feet.asc"), s.rough_grid(37, 29, 21, 80), x0=1e7, y0=-3.25, cell=0.25), name="feet", unit="us-ft")
db = s.connect(path)
for eps in (0, 1, 3.0):
    sizes.append(compare("US feet with voids and no CRS, eps %g" % eps, db, None, eps, 0))
z0, d, f, o = rows(db, "SELECT z0, d, scale * unit_numerator / unit_denominator, height_offset FROM rqt_terrain")[0]
equal("metres are the one expression of the contract", [r for r in rows(db, "SELECT q, z FROM rqt_range(NULL, 0)")
                                                        if (float(z0) + r[0] / float(d)) * f + o != r[1]], [])
check("and the unit is the US foot", f == 1200 / 3937, f)
equal("coordinates are x0 + col*dx and y0 + row*dy, in double",
      [r for r in rows(db, "SELECT col, row, x, y, t.x0, t.y0, t.dx, t.dy FROM rqt_range(NULL, 0), rqt_terrains t")
       if r[4] + r[0] * r[6] != r[2] or r[5] + r[1] * r[7] != r[3]], [])
equal("the grid is where it was written", rows(db, "SELECT x0, y0 + 28 * dy, dx, dy FROM rqt_terrains"), [(1e7, -3.25, 0.25, -0.25)])
db.close()

path = s.temp("empty.gpkg")
s.import_terrain(path, s.write_grid(s.temp("line.asc"), [[1, 2, 3, 5]]), name="row")
s.import_terrain(path, s.write_grid(s.temp("void.asc"), [[1, None, 3], [None, 2, None], [4, None, 5]]), name="islands")
db = s.connect(path)
for name in ("row", "islands"):
    equal("%s has no triangle, hence an empty mesh" % name, triangles(db, None, 0, name), [])
    for form, read in (("strip", s.mesh_blob), ("obj", s.obj_triangles), ("ply", s.ply_triangles), ("wkb", s.wkb_triangles)):
        found = guarded("%s: %s" % (name, form), lambda: read(one(db, "SELECT rqt_mesh(NULL, 0, ?, ?)", form, name)))
        equal("%s: %s is a valid empty file" % (name, form), found[1] if form == "strip" else found, [])
equal("the database is sound", rows(db, "PRAGMA quick_check"), [("ok",)])
db.close()
for name, grid, places in (("row", [[1, 2, 3, 5]], [(0, 0, 1.0), (3, 0, 5.0), (1.5, 0, 2.5), (3.5, 0, None)]),
                           ("islands", [[1, None, 3], [None, 2, None], [4, None, 5]], [(0, 0, 1.0), (1, -1, 2.0), (1, 0, None), (0.5, -0.5, 1.5), (0.5, -0.25, None)])):
    path = s.temp(name + ".db")
    s.import_terrain(path, s.write_grid(s.temp(name + ".asc"), grid), name=name)
    db = s.connect(path)
    equal("%s has no triangle, but heights" % name, [one(db, "SELECT rqt_height(?, ?)", x, y) for x, y, z in places], [z for x, y, z in places])
    db.close()
check("the meshes compared were of many sizes", 0 in sizes and 2 in sizes and max(sizes) > 1000, sizes)
s.finish()
