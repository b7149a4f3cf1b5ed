#!/usr/bin/python3
"""rqt.so in its hosts: the sqlite3 shell, beside mod_spatialite in either order, OGR; and every kind of database as target."""
import json
import os
import re
import sqlite3

import sql_support as s
from sql_support import check, equal, one, rows

ALPINE = os.path.join(s.DATA, "glarus_alpine_25m_161.tif")
OGR = {"OGR_SQLITE_LOAD_EXTENSIONS": s.RQT_SO}


def shell(database, script, *loads):
    """Lines that the sqlite3 shell prints."""
    said, status = s.run(["sqlite3", "-batch", "-bail", database], text="".join(".load %s\n" % l for l in loads) + script)
    return said.splitlines()


def ogr(*command, **environment):
    return s.run(list(command), environment=environment)[0]


def layers(said):
    return sorted(re.findall(r"^\d+: (\S+)", said, re.M))


path = s.temp("alpine.gpkg")
s.import_terrain(path, ALPINE, name="alpine")
db = s.connect(path)
expected = rows(db, "SELECT count(*), sum(z) FROM rqt_range(NULL, 10)")[0]

# --------------------------------------------------------------------------------------------- the sqlite3 shell
equal("the sqlite3 shell loads it by its file's name", shell(path, "SELECT count(*) FROM rqt_range(NULL, 10);", s.RQT_SO), [str(expected[0])])
equal("without its suffix too", shell(path, "SELECT count(*) FROM rqt_range(NULL, 10);", s.RQT_SO[:-3]), [str(expected[0])])
equal("twice does no harm", shell(path, "SELECT count(*) FROM rqt_range(NULL, 10);", s.RQT_SO, s.RQT_SO), [str(expected[0])])
said = shell(path, "SELECT * FROM rqt_range(NULL, -1);", s.RQT_SO)
check("the shell shows the sentence of an error", len(said) >= 1 and "rqt_range(): eps must be 0 or more" in said[0], said)
dump = shell(path, ".dump", s.RQT_SO)
copy = s.temp("dumped.db")
shell(copy, "\n".join(dump) + "\n")
d2 = s.connect(copy)
equal("a database that .dump wrote and the shell read has the same terrain", rows(d2, "SELECT count(*), sum(z) FROM rqt_range(NULL, 10)"), [expected])
d2.close()

# ---------------------------------------------------------------------------------------- beside mod_spatialite
spatial = s.temp("spatial.db")
shell(spatial, """SELECT InitSpatialMetadata(1);
CREATE TABLE places(id INTEGER PRIMARY KEY, name TEXT);
SELECT AddGeometryColumn('places', 'geom', 2056, 'POINT', 'XY');
INSERT INTO places VALUES (1, 'summit', MakePoint(2721000, 1209000, 2056)), (2, 'meadow', MakePoint(2722500, 1210000, 2056));
SELECT CreateSpatialIndex('places', 'geom');
""", "mod_spatialite")
CONTENT = "SELECT id, name, hex(geom) FROM places; SELECT count(*) FROM spatial_ref_sys; SELECT * FROM geometry_columns;"
before = shell(spatial, CONTENT), ogr("ogrinfo", "-ro", "-al", spatial)
s.import_terrain(spatial, ALPINE, name="alpine")
equal("import into a SpatiaLite database leaves its content untouched", (shell(spatial, CONTENT), ogr("ogrinfo", "-ro", "-al", spatial)), before)
check("ogrinfo reads it with its layer, and no table of ours", layers(ogr("ogrinfo", "-ro", spatial)) == ["places"], ogr("ogrinfo", "-ro", spatial))
equal("SpatiaLite's own check of its metadata", shell(spatial, "SELECT CheckSpatialMetaData(); SELECT CheckSpatialIndex('places', 'geom');", "mod_spatialite"), ["3", "1"])

QUERIES = """SELECT p.name, count(*) FROM places p, rqt_triangles(ST_Buffer(p.geom, 500), 5) GROUP BY 1;
SELECT p.name, v.max_error <= 5, v.t_junctions, v.overlaps, v.uncovered FROM places p, rqt_verify(ST_Buffer(p.geom, 500), 5) v;
SELECT count(*), sum(abs(ST_Area(rqt_mesh(ST_Buffer(p.geom, 500), 5, 'spatialite')) - v.area) > 1e-6 * v.area), min(v.area) > 700000
  FROM places p, rqt_verify(ST_Buffer(p.geom, 500), 5) v;
SELECT abs(ST_Area(GeomFromGPB(rqt_mesh(b, 5, 'gpkg'))) - v.area) < 1e-3, abs(ST_Area(CastAutomagic(rqt_mesh(b, 5, 'gpkg'))) - v.area) < 1e-3,
  abs(ST_Area(GeomFromWKB(rqt_mesh(b, 5, 'wkb'))) - v.area) < 1e-3,
  ST_SRID(CastAutomagic(rqt_mesh(b, 5, 'gpkg'))), ST_SRID(rqt_mesh(b, 5, 'spatialite')), ST_GeometryType(rqt_mesh(b, 5, 'spatialite')),
  ST_NumGeometries(rqt_mesh(b, 5, 'spatialite')) = v.triangles, ST_NDims(rqt_mesh(b, 5, 'spatialite'))
  FROM (SELECT BuildMbr(2721000, 1209000, 2722000, 1209500, 2056) AS b), rqt_verify(b, 5) v;
SELECT count(*) = (SELECT count(*) FROM rqt_range(BuildMbr(2721000, 1209000, 2722000, 1209500, 2056), 5)),
  sum(b = rqt_bbox(2721000, 1209000, 2722000, 1209500, 2056)) FROM (SELECT AsGPB(BuildMbr(2721000, 1209000, 2722000, 1209500, 2056)) AS b), rqt_range(b, 5);
SELECT ST_Area(GeomFromGPB(rqt_bbox(0, 0, 3, 4, 2056))), ST_SRID(GeomFromGPB(rqt_circle(7, 46, 10))), ST_IsValid(GeomFromGPB(rqt_circle(7, 46, 10)));
SELECT ST_IsEmpty(rqt_mesh('POINT(0 0)', 5, 'spatialite')), ST_IsEmpty(rqt_mesh('POINT(0 0)', 5, 'gpkg'));
SELECT count(*) > 0 FROM rqt_triangles(ST_Collect(MakePoint(2721000, 1209000, 2056), MakePoint(2722500, 1210000, 2056)), 5);
SELECT (SELECT count(*) FROM rqt_triangles(CompressGeometry(ST_Buffer(geom, 500)), 5)) = (SELECT count(*) FROM rqt_triangles(ST_Buffer(geom, 500), 5)) FROM places;
SELECT count(*) > 200, count(*) = (SELECT count(*) FROM rqt_range(ST_Buffer(g, 500), 5)) FROM (SELECT geom AS g FROM places WHERE id = 1), rqt_range(ST_Transform(ST_Buffer(g, 500), 4326), 5);
"""
answers = {}
for title, loads in (("before rqt.so", ("mod_spatialite", s.RQT_SO)), ("after rqt.so", (s.RQT_SO, "mod_spatialite"))):
    said = answers[title] = [l.split("|") for l in shell(spatial, QUERIES, *loads)]
    if check("mod_spatialite loaded %s: every query answers" % title, len(said) >= 12, said):
        check("%s: regions out of ST_Buffer" % title, [r[0] for r in said[:2]] == ["meadow", "summit"] and all(int(r[1]) > 50 for r in said[:2]), said[:2])
        equal("%s: rqt_verify proves them" % title, [r[1:] for r in said[2:4]], [["1", "0", "0", "0"]] * 2)
        equal("%s: ST_Area of the SpatiaLite mesh is rqt_verify's area" % title, said[4], ["2", "0", "1"])
        equal("%s: GeoPackage, WKB and SpatiaLite meshes are read for what they are" % title, said[5],
              ["1", "1", "1", "2056", "2056", "MULTIPOLYGON Z", "1", "3"])
        equal("%s: AsGPB's geometry is a region like BuildMbr's" % title, said[6][0], "1")
        equal("%s: rqt_bbox and rqt_circle are geometries to it" % title, said[7], ["12.0", "4326", "1"])
        equal("%s: an empty mesh is an empty geometry" % title, said[8][0], "1")
        equal("%s: a multipoint, and compressed geometries" % title, said[9:12], [["1"], ["1"], ["1"]])
        equal("%s: a region in degrees is transformed, and is the same" % title, said[-1], ["1", "1"])
equal("the order of loading changes nothing", answers["before rqt.so"], answers["after rqt.so"])

# ------------------------------------------------------------------------------------------------------------ OGR
count = ogr("ogrinfo", "-q", path, "-sql", "SELECT count(*) AS n FROM rqt_range(NULL, 10)", **OGR)
check("ogrinfo asks a GeoPackage by SQL", "n (Integer) = %d" % expected[0] in count, count)
count = ogr("ogrinfo", "-q", spatial, "-sql", "SELECT count(*) AS n FROM rqt_range(NULL, 10)", **OGR)
check("and a SpatiaLite database", "n (Integer) = %d" % expected[0] in count, count)
listed = ogr("ogrinfo", "-ro", path)
equal("ogrinfo lists the terrains' tables as attributes, and no table of the index", layers(listed), ["rqt_block_1", "rqt_terrain"])
equal("the same with rqt.so loaded", layers(ogr("ogrinfo", "-ro", path, **OGR)), layers(listed))
described = ogr("ogrinfo", "-ro", "-al", "-so", path)
check("ogrinfo reads them without a warning", "ERROR" not in described and "Warning" not in described, described)
said = ogr("ogrinfo", "-q", path, "-sql", "SELECT * FROM rqt_range(NULL, -1)", **OGR)
check("OGR shows the sentence of an error", "rqt_range(): eps must be 0 or more" in said, said)

out = s.temp("points.csv")
said = ogr("ogr2ogr", "-f", "CSV", out, path, "-sql", "SELECT x, y, z FROM rqt_range(NULL, 10)", **OGR)
with open(out) as stream:
    lines = stream.read().split()
check("ogr2ogr writes the vertices", len(lines) == expected[0] + 1 and lines[0].lower() == "x,y,z", (said, lines[:2]))
out = s.temp("mesh.geojson")
said = ogr("ogr2ogr", "-f", "GeoJSON", "-lco", "COORDINATE_PRECISION=3", out, path, "-sql",
           "SELECT 1 AS id, rqt_mesh('POINT(2721000 1209000)', 100, 'gpkg') AS geom", **OGR)
try:
    with open(out) as stream:
        shape = json.load(stream)["features"][0]["geometry"]
    equal("ogr2ogr reads rqt_mesh's GeoPackage geometry", (shape["type"], len(shape["coordinates"]), len(shape["coordinates"][0][0][0])),
          ("MultiPolygon", one(db, "SELECT count(*) FROM rqt_triangles('POINT(2721000 1209000)', 100)"), 3))
except (OSError, KeyError, IndexError, TypeError, ValueError) as error:
    check("ogr2ogr reads rqt_mesh's GeoPackage geometry", False, (said, repr(error)))
db.close()

# -------------------------------------------------------------------------------- what import finds, it leaves as it was
existing = s.temp("existing.gpkg")
with open(s.temp("towns.csv"), "w") as stream:
    stream.write("name,x,y\nGlarus,2723500,1211000\nElm,2732000,1197000\n")
said = ogr("ogr2ogr", "-f", "GPKG", existing, s.temp("towns.csv"), "-oo", "X_POSSIBLE_NAMES=x", "-oo", "Y_POSSIBLE_NAMES=y", "-a_srs", "EPSG:2056", "-nln", "towns")
CONTENT = "SELECT fid, name, hex(geom) FROM towns; SELECT * FROM gpkg_contents WHERE table_name = 'towns'; " \
          "SELECT * FROM gpkg_geometry_columns; SELECT * FROM gpkg_spatial_ref_sys; PRAGMA application_id; PRAGMA user_version;"
before = shell(existing, CONTENT), ogr("ogrinfo", "-ro", "-al", existing, "towns")
check("a GeoPackage of OGR's to begin with", "Glarus" in before[1], said + before[1])
s.import_terrain(existing, ALPINE, name="alpine")
after = shell(existing, CONTENT), ogr("ogrinfo", "-ro", "-al", existing, "towns")
equal("import into a GeoPackage leaves its layer untouched", after, before)
equal("OGR lists the layer and the terrain", layers(ogr("ogrinfo", "-ro", existing)), ["rqt_block_1", "rqt_terrain", "towns"])
check("a layer of the file is a region of its terrain", int(shell(
    existing, "SELECT count(*) FROM towns, rqt_triangles(towns.geom, 5) WHERE name = 'Glarus';", s.RQT_SO)[0]) in range(1, 9))
said = ogr("ogrinfo", "-q", existing, "-sql", "SELECT name, (SELECT count(*) FROM rqt_triangles(geom, 5)) AS n FROM towns", **OGR)
check("through OGR, too", "n (Integer) = 0" in said and "ERROR" not in said, said)
edited, status = s.run(["ogr2ogr", "-append", "-f", "GPKG", existing, s.temp("towns.csv"), "-oo", "X_POSSIBLE_NAMES=x", "-oo", "Y_POSSIBLE_NAMES=y",
                        "-a_srs", "EPSG:2056", "-nln", "towns"], environment=OGR)
check("OGR still writes to the layer", status == 0 and "4" in shell(existing, "SELECT count(*) FROM towns;"), edited)

plain = s.temp("plain.db")
shell(plain, "CREATE TABLE notes(id INTEGER PRIMARY KEY, note TEXT); INSERT INTO notes VALUES (1, 'kept'), (7, 'too'); "
             "CREATE INDEX by_note ON notes(note); CREATE VIEW loud AS SELECT upper(note) FROM notes; PRAGMA user_version = 42;")
CONTENT = "SELECT * FROM notes; SELECT * FROM loud; PRAGMA user_version; PRAGMA application_id; " \
          "SELECT type, name, sql FROM sqlite_schema WHERE name NOT LIKE 'rqt%' AND name NOT LIKE 'sqlite%' AND name NOT LIKE '%\\_rqt\\_%' ESCAPE '\\';"
before = shell(plain, CONTENT)
s.import_terrain(plain, ALPINE, name="alpine")
equal("import into a plain database leaves its content, and what it is", shell(plain, CONTENT), before)
equal("no GeoPackage tables in it", shell(plain, "SELECT count(*) FROM sqlite_schema WHERE name LIKE 'gpkg%';"), ["0"])
check("ogrinfo reads its table", "kept" in ogr("ogrinfo", "-ro", "-al", plain, "notes"))
for name in ("plain.db", "existing.gpkg", "spatial.db", "alpine.gpkg"):
    with open(s.temp(name), "rb") as stream:
        bytes_before = stream.read()
    said, status = s.run([s.RQT, "import", "--name", "alpine", ALPINE, s.temp(name)])
    with open(s.temp(name), "rb") as stream:
        check("an import that is refused leaves %s as it was, byte for byte" % name, status != 0 and stream.read() == bytes_before, said)

meshes = []
for name in ("plain.db", "existing.gpkg", "spatial.db", "alpine.gpkg"):
    d2 = s.connect(s.temp(name))
    meshes.append(rows(d2, "SELECT * FROM rqt_triangles(NULL, 5)"))
    equal("%s: rqt_check and quick_check" % name, rows(d2, "SELECT * FROM rqt_check") + rows(d2, "PRAGMA quick_check"), [("ok",)])
    d2.close()
check("the terrain is the same in all of them", all(m == meshes[0] for m in meshes) and len(meshes[0]) > 1000)
fresh = sqlite3.connect(path)
equal("what import creates is a GeoPackage, in journal mode delete", (one(fresh, "PRAGMA application_id"), one(fresh, "PRAGMA journal_mode")), (0x47504B47, "delete"))
equal("its terrains are registered as attributes", rows(fresh, "SELECT table_name, data_type FROM gpkg_contents ORDER BY 1"),
      [("rqt_block_1", "attributes"), ("rqt_terrain", "attributes")])
fresh.close()
s.finish()
