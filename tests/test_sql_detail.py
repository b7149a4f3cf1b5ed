#!/usr/bin/python3
"""options.detail (an eps of its own for places) and mode border, in SQL: every way to give them, and what must hold.

Deviations of samples and the area of half cells are worked out here, from the raster that was imported.
"""
import json
from fractions import Fraction

import sql_support as s
from sql_support import check, equal, one, raises, rows, triangles


def options(**given):
    return json.dumps(given)


def mesh(db, region, eps, **given):
    """The triangles of a mesh, in no order."""
    return sorted(s.rotated(t) for t in triangles(db, region, eps, None, options(**given)))


def box(x0, y0, x1, y1):
    return "POLYGON((%r %r, %r %r, %r %r, %r %r, %r %r))" % (x0, y0, x1, y0, x1, y1, x0, y1, x0, y0)


def proof(db, region, eps, **given):
    return rows(db, "SELECT max_error, t_junctions, overlaps, uncovered, vertices, void_touched, achieved_eps, twice_area_in_cells "
                "FROM rqt_verify(?, ?, NULL, ?)", region, eps, options(**given))[0]


def worst_within(grid, found, x0, y0, x1, y1):
    """The largest deviation of a valid sample of the closed box from a triangle that holds it; exact. y is minus the row."""
    worst = Fraction(0)
    for a, b, c in found:
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        for x in range(max(int(min(a[0], b[0], c[0])), x0), min(int(max(a[0], b[0], c[0])), x1) + 1):
            for y in range(max(int(min(a[1], b[1], c[1])), y0), min(int(max(a[1], b[1], c[1])), y1) + 1):
                if grid[-y][x] is None:
                    continue
                w = [(q[0] - x) * (r[1] - y) - (q[1] - y) * (r[0] - x) for q, r in ((b, c), (c, a), (a, b))]
                if min(w) < 0:
                    continue
                plane = sum(Fraction(int(v) * int(p[2])) for v, p in zip(w, (a, b, c))) / int(area)
                worst = max(worst, abs(plane - grid[-y][x]))
    return worst


WIDTH, HEIGHT = 97, 83
grid = s.rough_grid(WIDTH, HEIGHT, 7, 15)
database = s.temp("rough.gpkg")
s.import_terrain(database, s.write_grid(s.temp("rough.asc"), grid), name="rough", block=3)
db = s.connect(database)
EPS = 60

# ------------------------------------------------------------------------------------------------- an eps for places
places = [(box(20, -40, 30, -31), 2.5), ("LINESTRING(3 -80, 60 -5.5)", 9), ("POINT(90 -70)", 0), (box(40, -60, 60, -50), 500)]
listed = [[g, e] for g, e in places]
plain, detailed = mesh(db, None, EPS), mesh(db, None, EPS, detail=listed)
row = proof(db, None, EPS, detail=listed)
check("a mesh with detail keeps eps, without a crack", row[0] <= EPS and row[1:4] == (0, 0, 0) and row[5] == 0, row)
check("it has more triangles than the one without", len(detailed) > len(plain) > 0, (len(detailed), len(plain)))
found = triangles(db, None, EPS, None, options(detail=listed))
check("samples in a place are within its eps", 0 < worst_within(grid, found, 20, -40, 30, -31) <= Fraction(5, 2))
check("where no place is, eps alone holds", Fraction(9) < worst_within(grid, found, 0, -82, 96, 0) <= EPS)
equal("a sample that is a place is a vertex or exactly in a plane", worst_within(grid, found, 90, -70, 90, -70), 0)
equal("an eps above the mesh's own changes nothing", mesh(db, None, EPS, detail=listed[3:]), plain)
equal("detail without places changes nothing", mesh(db, None, EPS, detail=[]), plain)
equal("an EMPTY place is nowhere", mesh(db, None, EPS, detail=[["POLYGON EMPTY", 0]]), plain)
equal("a place over everything is the mesh of its eps", mesh(db, None, EPS, detail=[[box(-1, -99, 99, 9), 4]]), mesh(db, None, 4))
left, right = (mesh(db, box(a, -82, b, 0), EPS, detail=listed) for a, b in ((0, 33), (33, 96)))
equal("parts of a region are parts of one mesh", set(left) | set(right), set(detailed))

for given in ({"select": "topdown"}, {"select": "bottomup"}):
    equal("detail with %s gives the same mesh" % given, mesh(db, None, EPS, detail=listed, **given), detailed)
corners = rows(db, "SELECT x, y, z FROM rqt_strip(NULL, ?, NULL, ?)", EPS, options(detail=listed, strip="fan"))
equal("so does a strip of fans", sorted(map(s.rotated, s.strip_triangles(corners))), detailed)
readers = {"indexed": lambda d: s.mesh_blob(d)[1], "strip": lambda d: s.mesh_blob(d)[1], "obj": s.obj_triangles, "ply": s.ply_triangles,
           "wkb": s.wkb_triangles, "gpkg": lambda d: s.gpkg_triangles(d)[3], "spatialite": lambda d: s.spatialite_triangles(d)[2]}
for name, read in sorted(readers.items()):
    for given in ({"detail": listed}, {"detail": listed, "mode": "border"}):
        region = box(11, -55, 52, -20)
        data = one(db, "SELECT rqt_mesh(?, ?, ?, NULL, ?)", region, EPS, name, options(**given))
        equal("%s holds the triangles of %s" % (name, "+".join(given)), sorted(map(s.rotated, read(data))), mesh(db, region, EPS, **given))
wire = one(db, "SELECT rqt_mesh(NULL, ?, 'rqt', NULL, ?)", EPS, options(detail=listed))
equal("the wire has as many vertices and triangles", [int.from_bytes(wire[i:i + 8], "little") for i in (16, 24)], [row[4], len(detailed)])

# ----------------------------------------------------------------------------------------------------------- tables
db.execute("CREATE TABLE roads(id INTEGER PRIMARY KEY, the_geom, eps REAL, name TEXT)")
db.executemany("INSERT INTO roads(the_geom, eps) VALUES(?, ?)", places)
equal("a table gives the same mesh", mesh(db, None, EPS, detail="roads"), detailed)
equal("so does its name with the database's", mesh(db, None, EPS, detail="main.roads"), detailed)
db.execute("CREATE VIEW \"fine. roads\" AS SELECT eps AS EPS, the_geom AS Geometry FROM roads")
equal("so does a view, with a point and a blank in its name", mesh(db, None, EPS, detail="fine. roads"), detailed)
db.execute("ATTACH ':memory:' AS other")
db.execute("CREATE TABLE other.tracks(line LINESTRINGZ, shape TEXT, eps)")
db.execute("INSERT INTO other.tracks SELECT the_geom, 'not a geometry', eps FROM roads")
equal("a column declared as a geometry comes before a name", mesh(db, None, EPS, detail="other.tracks"), detailed)
equal("an attached table needs no database's name", mesh(db, None, EPS, detail="tracks"), detailed)
db.execute("CREATE TABLE blobs(a GEOMETRY, b GEOMETRY, eps)")
db.execute("INSERT INTO blobs VALUES(rqt_bbox(20, -40, 30, -31), 'nonsense', 2.5)")
raises("two columns of geometries are one too many", "rqt_range(): detail: blobs has several geometry columns",
       lambda: rows(db, "SELECT * FROM rqt_range(NULL, 5, NULL, ?)", options(detail="blobs")))
db.execute("INSERT INTO gpkg_contents(table_name, data_type, identifier, srs_id) VALUES('blobs', 'features', 'blobs', 0)")
db.execute("INSERT INTO gpkg_geometry_columns VALUES('blobs', 'a', 'GEOMETRY', 0, 0, 0)")
equal("the one that GeoPackage knows is taken, with BLOBs", mesh(db, None, EPS, detail="blobs"), mesh(db, None, EPS, detail=listed[:1]))
db.execute("CREATE TABLE other.geometry_columns(f_table_name, f_geometry_column)")
db.execute("INSERT INTO other.geometry_columns VALUES('TRACKS', 'LINE')")
db.execute("CREATE TEMP TABLE roads(geom, eps)")
equal("a temporary table hides another one", mesh(db, None, EPS, detail="roads"), plain)
equal("the one that SpatiaLite knows is taken", mesh(db, None, EPS, detail="other.tracks"), detailed)
db.execute("DROP TABLE temp.roads")

# What a connection keeps of a table is never old. `same` asks twice, so that the second answer may be a kept one.
def same(title, table, given, connection=None):
    expected = mesh(db, None, EPS, detail=[list(p) for p in given])
    for turn in ("", ", kept"):
        equal("kept places: " + title + turn, mesh(connection or db, None, EPS, detail=table), expected)


db.execute("CREATE TABLE lanes(geom, eps)")
db.executemany("INSERT INTO lanes VALUES(?, ?)", places)
db.commit()
same("a table as it is", "lanes", places)
db.execute("DELETE FROM lanes WHERE eps = 9")
same("a row is gone, before the commit", "lanes", places[:1] + places[2:])
db.commit()
same("a row is gone", "lanes", places[:1] + places[2:])
db.execute("BEGIN")
db.execute("INSERT INTO lanes VALUES(?, ?)", places[1])
same("an inserted row, to be rolled back", "lanes", places)
db.rollback()
same("rolled back", "lanes", places[:1] + places[2:])
db.execute("BEGIN")
db.execute("UPDATE lanes SET eps = 1")
db.rollback()
same("rolled back, not asked meanwhile", "lanes", places[:1] + places[2:])
db.execute("UPDATE lanes SET eps = 5 WHERE eps = 2.5")
db.commit()
same("an eps is another", "lanes", [(places[0][0], 5)] + places[2:])
other = s.connect(database)
same("another connection", "lanes", [(places[0][0], 5)] + places[2:], other)
db.execute("UPDATE lanes SET eps = 2.5 WHERE eps = 5")
db.commit()
same("another connection has committed", "lanes", places[:1] + places[2:], other)
other.execute("DELETE FROM lanes WHERE eps > 0")
other.commit()
same("... and this one", "lanes", places[2:3])
other.close()
db.execute("CREATE TEMP TABLE lanes(geom, eps)")
same("a table of temp hides it", "lanes", [])
same("the hidden one has its name", "main.lanes", places[2:3])
db.execute("INSERT INTO temp.lanes VALUES(?, ?)", places[0])
same("a row of temp", "lanes", places[:1])
db.commit()
db.execute("UPDATE temp.lanes SET eps = 9")
db.commit()
same("temp changes unseen", "lanes", [(places[0][0], 9)])
db.execute("DROP TABLE temp.lanes")
same("nothing hides it", "lanes", places[2:3])
db.execute("DROP TABLE lanes")
db.commit()
raises("kept places: a table that is gone", "rqt_triangles(): detail: this connection has no table or view lanes", lambda: mesh(db, None, EPS, detail="lanes"))
for given in (places[:1], places[1:2]):
    db.execute("ATTACH ':memory:' AS passing")
    db.execute("CREATE TABLE passing.lanes(geom, eps)")
    db.executemany("INSERT INTO passing.lanes VALUES(?, ?)", given)
    db.commit()
    same("a database that comes and goes", "lanes", given)
    db.execute("DETACH passing")
said = [9]
db.create_function("said", 0, lambda: said[0])
db.execute("CREATE VIEW spoken AS SELECT the_geom AS geom, said() AS eps FROM roads WHERE eps = 9")
db.execute("CREATE VIEW lanes AS SELECT * FROM roads WHERE eps = 9")
db.commit()
same("a view", "lanes", places[1:2])
same("a view over a function", "spoken", places[1:2])
said[0] = 2.5
same("... that says something else", "spoken", [(places[1][0], 2.5)])
db.execute("DROP VIEW lanes")
db.execute("DROP VIEW spoken")
db.commit()
# SQLite tells an authorizer which columns are read, when a statement is made.
db.execute("CREATE TABLE lanes(geom, eps)")
db.executemany("INSERT INTO lanes VALUES(?, ?)", places)
db.commit()
read = []
db.set_authorizer(lambda action, a, b, c, d: read.append((a, b)) or 0)
counts = []
for turn in range(3):
    del read[:]
    equal("kept places: of a table that has not changed", mesh(db, None, EPS, detail="lanes"), detailed)
    counts.append(read.count(("lanes", "geom")))
db.set_authorizer(None)
equal("kept places: a table that has not changed is read once", counts, [1, 0, 0])
db.execute("DROP TABLE lanes")
db.commit()

# ----------------------------------------------------------------------------------------------------------- border
def half_cells(inside):
    """Half cells with three valid corners whose centre of gravity is inside; twice the area in cells."""
    count = 0
    for y in range(HEIGHT - 1):
        for x in range(WIDTH - 1):
            nw, ne, sw, se = (x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)
            for t in ((nw, ne, se), (nw, sw, se)) if (x + y) % 2 == 0 else ((nw, ne, sw), (ne, sw, se)):
                count += all(grid[b][a] is not None for a, b in t) and inside(sum(p[0] for p in t) / 3, sum(p[1] for p in t) / 3)
    return count


for title, region, inside in (
        ("F27_border_on_odd_coordinates: area", box(13, -61, 57, -17), lambda x, y: 13 < x < 57 and 17 < y < 61),
        ("a rectangle grows outward to samples", box(13.4, -60.2, 56.5, -17.1), lambda x, y: 13 < x < 57 and 17 < y < 61),
        ("and is cut at the terrain", box(-9.5, -20, 20.5, 30), lambda x, y: x < 21 and y < 20),
        ("F26_a_hole_is_left_out: area", "POLYGON((10 -10,50 -10,50 -50,10 -50,10 -10),(21 -21,35 -21,35 -33,21 -33,21 -21))",
         lambda x, y: 10 < x < 50 and 10 < y < 50 and not (21 < x < 35 and 21 < y < 33)),
        ("all of the terrain", None, lambda x, y: True)):
    for eps in (0, EPS, 1e6):
        row = proof(db, region, eps, mode="border")
        equal("%s at eps %g" % (title, eps), row[7], half_cells(inside))
        check("... within eps, no crack, nothing uncovered", row[0] <= eps and row[1:4] == (0, 0, 0) and row[5] == 0, row)
hole = "POLYGON((10 -10,50 -10,50 -50,10 -50,10 -10),(10 -10,50 -10,50 -50,10 -50,10 -10))"
equal("F26_a_hole_that_covers_all_leaves_nothing", (mesh(db, hole, 5), mesh(db, hole, 5, mode="border")), ([], []))
for title, region in (("a point", "POINT(33.5 -20.25)"), ("a line", "LINESTRING(3 -3, 70 -70.5)")):
    equal("F24_lines_and_points_are_covered: %s" % title, mesh(db, region, EPS, mode="border"), mesh(db, region, EPS))
equal("F24_outside_there_is_nothing", mesh(db, box(200, 5, 300, 9), EPS, mode="border"), [])
thin = proof(db, box(30.3, -50, 30.4, -20), 1e6, mode="border")
equal("F24_a_rectangle_thinner_than_a_cell_is_grown_to_one", thin[7], half_cells(lambda x, y: 30 < x < 31 and 20 < y < 50))
both = proof(db, box(13, -61, 57, -17), EPS, mode="border", detail=listed)
check("border and detail go together", both[0] <= EPS and both[1:4] == (0, 0, 0) and both[7] == half_cells(lambda x, y: 13 < x < 57 and 17 < y < 61), both)
for given in ({"mode": "cut"}, {"mode": "snap"}, {"outline": "tol"}, {"mode": "border", "outline": "tol"}, {"mode": "cut", "outline": "tol"}):
    row = proof(db, "POLYGON((13.25 -61, 57 -60.5, 40.5 -17, 13.25 -61))", EPS, detail=listed, **given)
    check("detail keeps eps with %s" % given, 0 < row[0] <= EPS and row[1:4] == (0, 0, 0) and row[4] > 100, row)
for metric in ("exact", "wedgie"):
    row = proof(db, box(13, -61, 57, -17), EPS, mode="border", metric=metric, detail=listed)
    check("so they do with metric %s" % metric, row[0] <= EPS and row[1:4] == (0, 0, 0), row)

# ---------------------------------------------------------------------------------------------------------- budgets
for given in ({"detail": listed}, {"mode": "border"}, {"detail": listed, "mode": "border"}):
    region = box(13, -61, 57, -17)
    few = proof(db, region, 1e6, **given)[4]
    budget = few + 150
    row = proof(db, region, 1, max_vertices=budget, **given)
    check("a budget with %s is kept" % "+".join(given), row[4] <= budget and row[0] <= row[6] and row[6] > 1 and row[1:4] == (0, 0, 0), row)
    equal("... by the mesh of the eps that it says", mesh(db, region, 1, max_vertices=budget, **given), mesh(db, region, row[6], **given))
    raises("... and refused where no eps keeps it", "max_vertices", lambda: proof(db, region, 1, max_vertices=few - 1, **given))

# ---------------------------------------------------------------------------------------------------------- explain
def explained(**given):
    return rows(db, "SELECT level, block, bytes, selected, why FROM rqt_explain(NULL, ?, NULL, ?)", EPS, options(**given))


def cell(level, block):
    morton, i, j = block - 4**level, 0, 0
    for bit in range(level):
        i |= (morton >> 2 * bit & 1) << bit
        j |= (morton >> 2 * bit + 1 & 1) << bit
    side = 128 >> level
    return i * side, j * side, side


for given in ({"detail": listed}, {"mode": "border"}, {"detail": listed, "mode": "border"}):
    blocks, area = explained(**given), 0
    for level, block, size, selected, why in blocks:
        x, y, side = cell(level, block)
        area += (min(x + side, WIDTH - 1) - x) * (min(y + side, HEIGHT - 1) - y)
    equal("blocks that answer %s tile the terrain" % "+".join(given), area, (WIDTH - 1) * (HEIGHT - 1))
    check("... are said to answer more than eps", all("answers every eps" in b[4] for b in blocks))
    check("... and say whether their bytes were read", all((b[2] > 0) == ("walked" in b[4]) for b in blocks))
coarse, fine = ({b[1] for b in explained(detail=d)} for d in ([], listed))
check("with detail smaller blocks answer, but not everywhere", coarse & fine and fine - coarse, (len(coarse), len(fine)))
wanted = min(fine - coarse)
db.execute("BEGIN")
db.execute("DELETE FROM rqt_block_1 WHERE id = ?", (wanted,))
raises("a block that is missing below is no crack but an error", "terrain rough is damaged: block %d is missing" % wanted,
       lambda: mesh(db, None, EPS, detail=listed))
db.execute("ROLLBACK")

# ------------------------------------------------------------------------------------------------------- sentences
def refused(title, sentence, **given):
    raises(title, "rqt_range(): " + sentence, lambda: rows(db, "SELECT * FROM rqt_range(NULL, 5, NULL, ?)", options(**given)))


for metric in ("minimal", "local", "euclid", "plane"):
    refused("metric %s and detail" % metric, 'option "detail" needs the metric exact or wedgie', detail=[], metric=metric)
    refused("metric %s and border" % metric, 'mode "border" needs the metric exact or wedgie', mode="border", metric=metric)
refused("detail a number", 'option "detail" must be a list of [geometry as text, eps], or the name of a table', detail=5)
refused("detail an object", 'option "detail" must be a list', detail={"a": 1})
for pair in (5, [], ["POINT(1 1)"], ["POINT(1 1)", "2"], ["POINT(1 1)", 2, 3], [3, 2], ["POINT(1 1)", None]):
    refused("%r is no place" % (pair,), "detail 2 must be [geometry as text, eps]", detail=[["POINT(1 1)", 1], pair])
refused("a negative eps", "detail 1: eps must be 0 or more; it is -0.5", detail=[["POINT(1 1)", -0.5]])
refused("an unreadable geometry", "detail 1: ", detail=[["POINT(1", 1]])
refused("another SRID", "detail 1 has SRID 32633", detail=[["SRID=32633;POINT(1 1)", 1]])
refused("no such table", "detail: this connection has no table or view lanes", detail="lanes")
refused("no name", "detail: this connection has no table or view ", detail="")
db.execute("CREATE TABLE bare(geom)")
refused("no eps", "detail: bare has no column eps", detail="bare")
db.execute("CREATE TABLE flat(eps, place)")
refused("no geometry", "detail: flat has no geometry column", detail="flat")
for title, values, sentence in (("a NULL geometry is not everything", (None, 1), "the geometry is NULL"), ("a number", (7, 1), "the geometry is a number"),
                                ("a NULL eps", ("POINT(1 1)", None), "eps must be a number; it is NULL"),
                                ("an eps as text", ("POINT(1 1)", "1"), "eps must be a number; it is text"),
                                ("a BLOB as eps", ("POINT(1 1)", b"1"), "eps must be a number; it is a BLOB"),
                                ("a negative eps", ("POINT(1 1)", -1), "eps must be 0 or more; it is -1"),
                                ("bytes that are no geometry", (b"GP", 1), ""), ("text that is none", ("here", 1), "")):
    db.execute("DROP TABLE IF EXISTS wrong")
    db.execute("CREATE TABLE wrong(geom, eps)")
    db.execute("INSERT INTO wrong VALUES('POINT(3 -3)', 1)")
    db.execute("INSERT INTO wrong VALUES(?, ?)", values)
    refused("in a table: " + title, "detail: row 2 of wrong: " + sentence, detail="wrong")
db.execute("CREATE VIEW loops AS SELECT 'POINT(1 -1)' AS geom, x AS eps FROM rqt_range(NULL, 5)")
refused("a view that calls rqt", "detail: reading loops: rqt_range(): rqt is already at work", detail="loops")
db.execute("CREATE VIEW broken AS SELECT geom, eps FROM gone")
raises("a view that does not work", "no such table: main.gone", lambda: rows(db, "SELECT * FROM rqt_range(NULL, 5, NULL, ?)", options(detail="broken")))
equal("after all that it still works", mesh(db, None, EPS, detail=listed), detailed)
db.close()

# ------------------------------------------------------------------------------------------------- the command passes it on
region = box(13, -61, 57, -17)
for ending, read in (("obj", lambda d: s.obj_triangles(d.decode())), ("ply", s.ply_triangles)):
    out = s.temp("border." + ending)
    said, status = s.run([s.RQT, "mesh", database, "--eps", str(EPS), "--region", region, "--mode", "border", "-o", out])
    equal("rqt mesh --mode border works", status, 0)
    with open(out, "rb") as stream:
        data = stream.read()
    db = s.connect(database)
    equal("rqt mesh --mode border writes it as " + ending, sorted(map(s.rotated, read(data))), mesh(db, region, EPS, mode="border"))
    db.close()
s.finish()
