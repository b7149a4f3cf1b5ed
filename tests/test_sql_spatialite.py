#!/usr/bin/python3
"""SpatiaLite's functions on our geometries agree with ours: area, intersection, union, transformation, heights, validity.

Everything is asked twice, with mod_spatialite loaded before rqt.so and after it. What SpatiaLite computes is GEOS's and PROJ's
work; what it is compared with is rqt_verify's, this file's own, or GDAL's.
"""
import os

import sql_support as s
from sql_support import check, equal, one, rows

ALPINE = os.path.join(s.DATA, "glarus_alpine_25m_161.tif")
path = s.temp("spatial.db")
db = s.connect(path, load=False)
db.load_extension("mod_spatialite")
db.execute("SELECT InitSpatialMetadata(1)").fetchall()
db.close()
s.import_terrain(path, ALPINE, name="alpine")

# A rectangle between sample lines, a triangle, a polygon with a hole, two apart, a line.
REGIONS = ("POLYGON((2721010 1209007, 2721700 1209007, 2721700 1209444, 2721010 1209444, 2721010 1209007))",
           "POLYGON((2720900 1208900, 2722100 1209100, 2721700 1210200, 2720900 1208900))",
           "POLYGON((2721000 1209000, 2723000 1209000, 2723000 1211000, 2721000 1211000, 2721000 1209000),"
           "(2721500 1209500, 2722500 1209600, 2722000 1210500, 2721500 1209500))",
           "MULTIPOLYGON(((2721000 1209000, 2721300 1209000, 2721000 1209300, 2721000 1209000)),"
           "((2722000 1210000, 2722300 1210000, 2722000 1210300, 2722000 1210000)))",
           "LINESTRING(2720500 1208000, 2723500 1211000)")
WEST, EAST = ("POLYGON((%d 1209010, %d 1209010, %d 1210011, %d 1210011, %d 1209010))" % (a, b, b, a, a) for a, b in ((2721010, 2721530), (2721530, 2722060)))
BOTH = "POLYGON((2721010 1209010, 2722060 1209010, 2722060 1210011, 2721010 1210011, 2721010 1209010))"


def near(a, b, relative=1e-9):
    return a is not None and b is not None and abs(a - b) <= relative * max(abs(a), abs(b))


def triangle_length(t):
    return sum(sum((a - b) ** 2 for a, b in zip(t[i], t[i - 1])) ** 0.5 for i in range(3))


def agree(title, db):
    def named(name):
        return "%s: %s" % (title, name)

    # Areas
    found = rows(db, "SELECT ST_Area(rqt_mesh(r.value, e.value, 'spatialite')), (SELECT sum(ST_Area(CastAutomagic(t.gpkg))) FROM rqt_triangles(r.value, e.value) t), "
                     "v.area FROM json_each(?) r, json_each('[0, 3, 20, 200]') e, rqt_verify(r.value, e.value) v", s.json.dumps(REGIONS))
    check(named("ST_Area of a mesh, and of its triangles, is rqt_verify's area: %d of them" % len(found)),
          len(found) == 20 and all(near(a, c) and near(b, c) and c > 5e4 for a, b, c in found), found)
    for eps in (0, 10):
        a, b, v = rows(db, "SELECT ST_Area(ST_UnaryUnion(rqt_mesh(?1, ?2, 'spatialite'))), ST_IsValid(ST_UnaryUnion(rqt_mesh(?1, ?2, 'spatialite'))), "
                           "(SELECT area FROM rqt_verify(?1, ?2))", REGIONS[2], eps)[0]
        check(named("the triangles of eps %d overlap nowhere: their union has the sum of their areas, and is valid" % eps), near(a, v) and b == 1, (a, b, v))

    # Neighbouring windows
    for eps in (0, 7, 60):
        a, b = (set(r[0] for r in rows(db, "SELECT gpkg FROM rqt_triangles(?, ?)", region, eps)) for region in (WEST, EAST))
        both = set(r[0] for r in rows(db, "SELECT gpkg FROM rqt_triangles(?, ?)", BOTH, eps))
        equal(named("eps %d: patches of neighbouring windows are parts of their union's, byte for byte" % eps), a | b, both)
        common = "SELECT gpkg FROM rqt_triangles('%s', %d) INTERSECT SELECT gpkg FROM rqt_triangles('%s', %d)" % (WEST, eps, EAST, eps)
        area, shared, mine = rows(db, "WITH common(geom) AS MATERIALIZED (%s), west AS (SELECT ST_UnaryUnion(ST_Collect(CastAutomagic(geom))) AS g FROM "
                                      "(SELECT gpkg AS geom FROM rqt_triangles(?1, ?3) EXCEPT SELECT geom FROM common)), "
                                      "east AS (SELECT ST_UnaryUnion(rqt_mesh(?2, ?3, 'spatialite')) AS g) "
                                      "SELECT ST_Area(ST_Intersection(west.g, east.g)), (SELECT count(*) FROM common), ST_Area(west.g) FROM west, east" % common, WEST, EAST, eps)[0]
        check(named("eps %d: but for the triangles that both have, they meet in no area" % eps), (area or 0) == 0 and shared > 0 and mine > 3e5, (area, shared, mine))
        u, v = rows(db, "SELECT ST_Area(ST_Union(ST_UnaryUnion(rqt_mesh(?1, ?3, 'spatialite')), ST_UnaryUnion(rqt_mesh(?2, ?3, 'spatialite')))), "
                        "(SELECT area FROM rqt_verify(?4, ?3))", WEST, EAST, eps, BOTH)[0]
        check(named("eps %d: ST_Union of both is the mesh of both, without a gap" % eps), near(u, v), (u, v))
        inside = one(db, "SELECT ST_Area(ST_Difference(ST_GeomFromText(?1), ST_UnaryUnion(rqt_mesh(?1, ?2, 'spatialite'))))", BOTH, eps)
        check(named("eps %d: nothing of the region is left over" % eps), (inside or 0) < 1e-3, inside)

    # Each triangle, each vertex
    t = s.triangles(db, REGIONS[1], 10)
    found = rows(db, "SELECT ST_IsValid(g), ST_NDims(g), ST_SRID(g), ST_GeometryType(g), ST_NumPoints(ST_ExteriorRing(g)), ST_MinZ(g), ST_MaxZ(g), "
                     "ST_3DLength(ST_ExteriorRing(g)) FROM (SELECT CastAutomagic(gpkg) AS g FROM rqt_triangles(?, 10))", REGIONS[1])
    equal(named("every triangle is a valid POLYGON Z of four points, with its SRID"), set(r[:5] for r in found), {(1, 3, 2056, "POLYGON Z", 4)})
    equal(named("ST_MinZ and ST_MaxZ of every triangle"), [r[5:7] for r in found], [(min(p[2] for p in c), max(p[2] for p in c)) for c in t])
    check(named("ST_3DLength of every triangle's ring"), len(found) == len(t) and all(near(r[7], triangle_length(c), 1e-12) for r, c in zip(found, t)))
    equal(named("ST_X, ST_Y, ST_Z of every vertex are its x, y, z"),
          rows(db, "SELECT count(*), sum(ST_X(g) = x AND ST_Y(g) = y AND ST_Z(g) = z AND ST_SRID(g) = 2056) FROM (SELECT x, y, z, CastAutomagic(gpkg) AS g FROM rqt_range(?, 10))", REGIONS[1]),
          [(one(db, "SELECT count(*) FROM rqt_range(?, 10)", REGIONS[1]),) * 2])
    equal(named("... and its triangles are those that it touches"), rows(db, "SELECT min(n) >= 1, max(n) <= 8 FROM (SELECT (SELECT count(*) FROM rqt_triangles(g, 10)) AS n FROM "
                                                                         "(SELECT CastAutomagic(gpkg) AS g FROM rqt_range(?, 10) LIMIT 60))", REGIONS[1]), [(1, 1)])

    # Another CRS: PROJ by SpatiaLite's hand, beside PROJ by GDAL's. To degrees on the same datum: between datums PROJ offers
    # several ways, some centimetres apart, and the two choose differently.
    vertices = rows(db, "SELECT x, y, z, ST_X(g), ST_Y(g), ST_Z(g), ST_SRID(g) FROM (SELECT x, y, z, ST_Transform(CastAutomagic(gpkg), 4150) AS g FROM rqt_range(?, 40))", REGIONS[1])
    said, status = s.run(["gdaltransform", "-s_srs", "EPSG:2056", "-t_srs", "EPSG:4150", "-output_xy"], text="".join("%r %r\n" % r[:2] for r in vertices))
    expected = [tuple(map(float, line.split())) for line in said.splitlines()] if status == 0 else []
    check(named("ST_Transform of the vertices is GDAL's to a tenth of a millimetre, heights untouched"),
          len(expected) == len(vertices) > 30 and all(abs(r[3] - e[0]) < 1e-9 and abs(r[4] - e[1]) < 1e-9 and r[5] == r[2] and r[6] == 4150
                                                      for r, e in zip(vertices, expected)), (vertices[:1], expected[:1], said[:200]))
    mesh = rows(db, "SELECT ST_NumGeometries(g), ST_SRID(g), ST_MinZ(g), ST_MaxZ(g), ST_Area(g) FROM (SELECT ST_Transform(rqt_mesh(?, 40, 'spatialite'), 32632) AS g)", REGIONS[1])[0]
    z = [p[2] for c in s.triangles(db, REGIONS[1], 40) for p in c]
    check(named("a mesh transformed keeps its triangles and heights, and its area within the projections' scale"),
          mesh[:4] == (len(z) // 3, 32632, min(z), max(z)) and near(mesh[4], one(db, "SELECT area FROM rqt_verify(?, 40)", REGIONS[1]), 2e-3), mesh)

    # A layer of SpatiaLite's own
    db.execute("BEGIN")
    db.execute("CREATE TABLE surface(id INTEGER PRIMARY KEY)")
    made = rows(db, "SELECT AddGeometryColumn('surface', 'geom', 2056, 'POLYGON', 'XYZ')")
    db.execute("INSERT INTO surface SELECT id, CastAutomagic(gpkg) FROM rqt_triangles(?, 10)", (REGIONS[1],))
    indexed = rows(db, "SELECT CreateSpatialIndex('surface', 'geom'), CheckSpatialIndex('surface', 'geom')")
    equal(named("triangles go into a SpatiaLite layer, XYZ, and its index is sound"), (made, indexed, one(db, "SELECT count(*) FROM surface")), ([(1,)], [(1, 1)], len(t)))
    equal(named("its index finds the triangle over a place, and ST_Contains agrees with rqt_triangles"),
          rows(db, "SELECT id, geom = CastAutomagic(t) FROM surface, (SELECT gpkg AS t FROM rqt_triangles('POINT(2721403.3 1209401.7)', 10)) WHERE surface.rowid IN (SELECT rowid FROM SpatialIndex "
                   "WHERE f_table_name = 'surface' AND search_frame = MakePoint(2721403.3, 1209401.7, 2056)) AND ST_Contains(geom, MakePoint(2721403.3, 1209401.7, 2056))")[0][1:], (1,))
    db.execute("ROLLBACK")


for title, libraries in (("mod_spatialite first", ("mod_spatialite", s.RQT_SO)), ("rqt.so first", (s.RQT_SO, "mod_spatialite"))):
    db = s.connect(path, load=False)
    for library in libraries:
        db.load_extension(library)
    agree(title, db)
    db.close()
s.finish()
