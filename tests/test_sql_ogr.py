#!/usr/bin/python3
"""ogr2ogr turns queries into layers: what it writes is what SQL says, coordinate by coordinate, bit for bit.

Triangles (POLYGON Z), meshes (MULTIPOLYGON Z) and vertices (POINT Z), out of a GeoPackage, a plain SQLite database and a
SpatiaLite database, into GeoPackage, GeoJSON and Shapefile. What was written is read by OGR again, into a GeoPackage, and
that one's WKB is read here.
"""
import json
import os
import sqlite3
import struct

import sql_support as s
from sql_support import check, equal, one, rows

ALPINE = os.path.join(s.DATA, "glarus_alpine_25m_161.tif")
AFRICA = os.path.join(s.DATA, "eastafrica.tif")
OGR = {"OGR_SQLITE_LOAD_EXTENSIONS": s.RQT_SO}
FORMATS = (("GPKG", "gpkg", []), ("GeoJSON", "geojson", ["-lco", "SIGNIFICANT_FIGURES=17"]), ("ESRI Shapefile", "shp", []))


def ogr2ogr(*arguments):
    return s.run(["ogr2ogr"] + list(arguments), OGR)


def sqlite(database, script, *loads):
    said, status = s.run(["sqlite3", "-batch", "-bail", database], text="".join(".load %s\n" % l for l in loads) + script)
    if status:
        raise RuntimeError(said)


# ------------------------------------------------------------------------------------------------ WKB, read here

def geometry(data, at):
    """(type, points): a point, the corners of a triangle, or a list of triangles; and where it ends."""
    order, kind = struct.unpack_from("<BI", data, at)
    assert order == 1 and kind in (1001, 1003, 1006), "little-endian, with Z"
    at += 5
    if kind == 1001:
        return ("POINT Z", struct.unpack_from("<3d", data, at)), at + 24
    count, = struct.unpack_from("<I", data, at)
    at += 4
    if kind == 1006:
        parts = []
        for _ in range(count):
            part, at = geometry(data, at)
            parts.append(part[1])
        return ("MULTIPOLYGON Z", parts), at
    points, = struct.unpack_from("<I", data, at)
    assert (count, points) == (1, 4), "one ring of a triangle"
    return ("POLYGON Z", s.ring_triangle([struct.unpack_from("<3d", data, at + 4 + 24 * i) for i in range(4)])), at + 4 + 96


def layer(path):
    """Of a GeoPackage's only layer: EPSG code, extent, [(type, points)] by fid."""
    db = sqlite3.connect(path)
    table, column = db.execute("SELECT table_name, column_name FROM gpkg_geometry_columns").fetchone()
    code = db.execute("SELECT organization || ':' || organization_coordsys_id FROM gpkg_spatial_ref_sys s, gpkg_geometry_columns g "
                      "WHERE g.srs_id = s.srs_id").fetchone()[0]
    extent = db.execute("SELECT min_x, min_y, max_x, max_y FROM gpkg_contents WHERE table_name = ?", (table,)).fetchone()
    found = []
    for blob, in db.execute('SELECT "%s" FROM "%s" ORDER BY rowid' % (column, table)):
        shape, end = geometry(blob, 8 + (0, 32, 48, 48, 64)[blob[3] >> 1 & 7])
        assert end == len(blob), "nothing after the geometry"
        found.append(shape)
    db.close()
    return code, extent, found


def points_of(shape):
    kind, points = shape
    return [points] if kind == "POINT Z" else list(points) if kind == "POLYGON Z" else [p for t in points for p in t]


def unordered(shape):
    """Rings begin anywhere, and a Shapefile's run clockwise: a triangle is its three corners."""
    kind, points = shape
    if kind == "POLYGON Z":
        points = tuple(sorted(points))
    elif kind == "MULTIPOLYGON Z":
        points = sorted(tuple(sorted(t)) for t in points)
    return kind, points


def rounded(shape):
    kind, points = shape
    return kind, [tuple(round(c, 12) for c in p) for p in points]


def convert(title, database, sql, wanted, code, more=()):
    """The query in every format; wanted: the shapes in their order."""
    points = [p for shape in wanted for p in points_of(shape)]
    extent = (min(p[0] for p in points), min(p[1] for p in points), max(p[0] for p in points), max(p[1] for p in points))
    for driver, ending, options in FORMATS:
        name = "%s to %s" % (title, driver)
        out, back = s.temp("out." + ending), s.temp("back.gpkg")
        for left in (out, back):
            if os.path.exists(left):
                os.remove(left)
        said, status = ogr2ogr("-f", driver, *options, *more, "-nln", "out", out, database, "-sql", sql)
        if not check(name + ": ogr2ogr writes it without a word", status == 0 and said == "", said):
            continue
        if driver != "GPKG":
            said, status = s.run(["ogr2ogr", "-f", "GPKG", back, out])
            if not check(name + ": OGR reads it again", status == 0, said):
                continue
        try:
            seen = layer(out if driver == "GPKG" else back)
        except (AssertionError, struct.error, TypeError, sqlite3.Error) as error:
            check(name + ": is what it says", False, repr(error))
            continue
        equal(name + ": as many features", len(seen[2]), len(wanted))
        # A Shapefile knows no multipolygons: one of a single part comes back as a polygon.
        found = [("MULTIPOLYGON Z", [p]) if w[0] == "MULTIPOLYGON Z" and k == "POLYGON Z" else (k, p)
                 for (k, p), w in zip(seen[2], wanted)]
        found, expected = [unordered(f) for f in found], [unordered(w) for w in wanted]
        if driver == "GeoJSON" and code == "EPSG:4326":  # OGR's GeoJSON drops the last digits of what looks rounded
            equal(name + ": every coordinate, to 12 decimals", list(map(rounded, found)), list(map(rounded, expected)))
        else:
            equal(name + ": every coordinate, Z too, bit for bit", found, expected)
        # The extent has been text in between.
        equal(name + ": CRS and extent", (seen[0], ["%.14g" % c for c in seen[1]]), (code, ["%.14g" % c for c in extent]))


# ------------------------------------------------------------------------------------ three databases, three layers
REGION = "POLYGON((2720900 1208900, 2722100 1209100, 2721700 1210200, 2720900 1208900))"
databases = {"a GeoPackage": s.temp("alpine.gpkg"), "a plain database": s.temp("plain.db"), "a SpatiaLite database": s.temp("spatial.db")}
sqlite(databases["a plain database"], "CREATE TABLE notes(note);")
sqlite(databases["a SpatiaLite database"], "SELECT InitSpatialMetadata(1);", "mod_spatialite")
for path in databases.values():
    s.import_terrain(path, ALPINE, name="alpine")
db = s.connect(databases["a GeoPackage"])
TRIANGLES = [("POLYGON Z", t) for t in s.triangles(db, REGION, 10)]
VERTICES = [("POINT Z", p) for p in rows(db, "SELECT x, y, z FROM rqt_range(?, 10)", REGION)]
check("there is something to convert", len(TRIANGLES) > 500 and len(VERTICES) > 250, (len(TRIANGLES), len(VERTICES)))
db.close()
for kind, path in databases.items():
    # OGR knows GeoPackage's geometry in a GeoPackage only; SpatiaLite, which it brings along, makes its own of it elsewhere.
    geom, form, more = ("+gpkg", "gpkg", ()) if kind == "a GeoPackage" else ("CastAutomagic(gpkg)", "spatialite", ())
    if kind == "a plain database":
        more = ("-a_srs", "EPSG:2056")  # its results carry no CRS
    convert("triangles of " + kind, path, "SELECT id, %s AS geom FROM rqt_triangles('%s', 10)" % (geom, REGION), TRIANGLES, "EPSG:2056", more)
    convert("vertices of " + kind, path, "SELECT level, %s AS geom FROM rqt_range('%s', 10)" % (geom, REGION), VERTICES, "EPSG:2056", more)
    convert("the mesh of " + kind, path, "SELECT 1 AS id, rqt_mesh('%s', 10, '%s') AS geom" % (REGION, form),
            [("MULTIPOLYGON Z", [t[1] for t in TRIANGLES])], "EPSG:2056", more)

# Degrees: their coordinates are no short decimals.
africa = s.temp("africa.gpkg")
s.import_terrain(africa, AFRICA, name="africa")
db = s.connect(africa)
CUT = "POLYGON((31.01 1.02, 32.34 1.11, 32.2 2.07, 31.01 1.02))", 100, None, '{"mode": "cut"}'
expected = [("POLYGON Z", t) for t in s.triangles(db, *CUT)]
equal("mode cut: gpkg is the clipped triangle", [geometry(blob, 40)[0] for blob, in rows(db, "SELECT gpkg FROM rqt_triangles(?, ?, ?, ?)", *CUT)], expected)
equal("mode cut: gpkg is the vertex between samples", [geometry(blob, 8)[0][1] for blob, in rows(db, "SELECT gpkg FROM rqt_range(?, ?, ?, ?)", *CUT)],
      rows(db, "SELECT x, y, z FROM rqt_range(?, ?, ?, ?)", *CUT))
for frame, srid in (("ecef", 4978), ("enu", 0)):
    options = '{"frame": "%s"}' % frame
    expected = s.triangles(db, "POINT(30.01 0.02)", 100, None, options)
    equal("frame %s: gpkg is where the triangle is, with its SRID" % frame, [(struct.unpack_from("<i", blob, 4)[0], geometry(blob, 40)[0]) for blob, in rows(
        db, "SELECT gpkg FROM rqt_triangles('POINT(30.01 0.02)', 100, NULL, ?)", options)], [(srid or -1, ("POLYGON Z", t)) for t in expected])
wanted = [("POLYGON Z", t) for t in s.triangles(db, "POINT(30.01 0.02)", 0) + s.triangles(db, "LINESTRING(31 1, 33 2)", 50)]
db.close()
check("coordinates that need 17 digits are among them", any(float("%.15g" % p[0]) != p[0] for w in wanted for p in points_of(w)))
convert("degrees", africa, "SELECT +gpkg AS geom FROM rqt_triangles('POINT(30.01 0.02)', 0) UNION ALL "
                           "SELECT +gpkg FROM rqt_triangles('LINESTRING(31 1, 33 2)', 50)", wanted, "EPSG:4326")

# ------------------------------------------------------------------------------------------------ beside other layers
parcels = {"meadow": "POLYGON((2721000 1209000, 2721400 1209000, 2721400 1209300, 2721000 1209000))",
           "forest": "POLYGON((2722000 1210000, 2722300 1210000, 2722300 1210500, 2722000 1210000))"}
with open(s.temp("parcels.geojson"), "w") as stream:
    json.dump({"type": "FeatureCollection", "crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::2056"}}, "features": [
        {"type": "Feature", "properties": {"name": name, "eps": eps}, "geometry": {"type": "Polygon", "coordinates": [
            [[float(c) for c in p.split()] for p in wkt[9:-2].split(", ")]]}}
        for (name, wkt), eps in zip(parcels.items(), (5, 20))]}, stream)
path = databases["a GeoPackage"]
said, status = s.run(["ogr2ogr", "-update", path, s.temp("parcels.geojson"), "-nln", "parcels"])
check("a layer of parcels in the same GeoPackage", status == 0, said)
db = s.connect(path)
wanted = [("POLYGON Z", t) for name, eps in (("meadow", 5), ("forest", 20)) for t in s.triangles(db, parcels[name], eps)]
JOIN = "SELECT p.name, t.id AS triangle, +t.gpkg AS geom FROM parcels p, rqt_triangles(p.geom, p.eps) t"
convert("triangles of every parcel, at its eps", path, JOIN, wanted, "EPSG:2056")
with_names = s.temp("named.csv")
ogr2ogr("-f", "CSV", with_names, path, "-sql", "SELECT p.name, count(*) AS n FROM parcels p, rqt_triangles(p.geom, p.eps) t GROUP BY 1 ORDER BY p.eps")
with open(with_names) as stream:
    equal("attributes of the other layer come along", stream.read().replace('"', "").split(), ["name,n"] + ["%s,%d" % (n, len(s.triangles(db, parcels[n], e))) for n, e in (("meadow", 5), ("forest", 20))])
db.close()

# --------------------------------------------------------------------- into the file itself, and what others see of it
said, status = ogr2ogr("-update", path, path, "-nln", "triangles", "-sql", JOIN)
check("a layer of triangles into the terrain's own GeoPackage", status == 0 and said == "", said)
listed = s.run(["ogrinfo", "-ro", "-al", "-so", path, "triangles"])[0]
check("OGR without rqt.so reads it", "Feature Count: %d" % len(wanted) in listed and "3D Polygon" in listed, listed)
check("its index finds what lies in a box", "Feature Count: 0" not in s.run(["ogrinfo", "-ro", "-so", "-spat", "2721100", "1209000", "2721200", "1209050", path, "triangles"])[0])
db = s.connect(path)
equal("the terrain is as sound as before", rows(db, "SELECT * FROM rqt_check") + rows(db, "PRAGMA quick_check"), [("ok",)])
equal("no view over our functions is in the file", rows(db, "SELECT name FROM sqlite_schema WHERE type IN ('view', 'trigger') AND sql LIKE '%rqt\\_%(%' ESCAPE '\\'"), [])

# ------------------------------------------------------------------------------------------------ what `gpkg` is
equal("gpkg of a triangle is its corners, closed, with the terrain's SRID and its box",
      [(blob[:8], geometry(blob, 40)[0], struct.unpack_from("<4d", blob, 8)) for blob, in rows(db, "SELECT gpkg FROM rqt_triangles(?, 10)", REGION)],
      [(b"GP\0\3" + struct.pack("<i", 2056), t, (min(p[0] for p in t[1]), max(p[0] for p in t[1]), min(p[1] for p in t[1]), max(p[1] for p in t[1]))) for t in TRIANGLES])
equal("gpkg of a vertex is a point without a box",
      [(blob[:8], geometry(blob, 8)[0], len(blob)) for blob, in rows(db, "SELECT gpkg FROM rqt_range(?, 10)", REGION)],
      [(b"GP\0\1" + struct.pack("<i", 2056), p, 37) for p in VERTICES])
equal("a triangle's geometry is a region itself: those of the mesh that it is in",
      rows(db, "SELECT min(n), max(n) FROM (SELECT (SELECT count(*) FROM rqt_triangles(t.gpkg, 10)) AS n FROM rqt_triangles(?, 10) t LIMIT 50)", REGION), [(1, 1)])
equal("gpkg does not show in SELECT *", len(db.execute("SELECT * FROM rqt_triangles('POINT(2721000 1209000)', 10)").description), 10)
db.close()
nowhere = s.temp("nowhere.db")
s.import_terrain(nowhere, s.write_grid(s.temp("nowhere.asc"), [[1, 2], [3, 4]]), name="nowhere")
db = s.connect(nowhere)
equal("without a CRS its SRID is undefined, -1", rows(db, "SELECT DISTINCT substr(hex(gpkg), 9, 8) FROM rqt_triangles(NULL, 0)"), [("FFFFFFFF",)])
db.close()
s.finish()
