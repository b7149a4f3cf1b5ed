#!/usr/bin/python3
"""rqt_answer and rqt_view_answer: the bytes are those of rqt_mesh and rqt_view_mesh, and what stands beside them is what rows of the same mesh
say and what counting them gives."""
import json
import sqlite3

import sql_support as s
from sql_increment import Increment, Mesh
from sql_support import check, equal, one, raises, rows

BASE = s.temp("answer.gpkg")
s.import_terrain(BASE, s.write_grid(s.temp("hills.asc"), s.rough_grid(130, 97, 7, voids=20), cell=10), name="hills", block=4)
s.import_terrain(BASE, s.DATA + "/etopo1_1deg.tif", name="globe", block=4)
FEET = ('PROJCS["NAD27 / California zone I",GEOGCS["NAD27",DATUM["North_American_Datum_1927",SPHEROID["Clarke 1866",6378206.4,294.978698213898]],'
        'PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],PROJECTION["Lambert_Conformal_Conic_2SP"],PARAMETER["latitude_of_origin",39.33],'
        'PARAMETER["central_meridian",-122],PARAMETER["standard_parallel_1",41.66],PARAMETER["standard_parallel_2",40],'
        'PARAMETER["false_easting",2000000],PARAMETER["false_northing",0],UNIT["US survey foot",0.304800609601219]]')
s.import_terrain(BASE, s.write_grid(s.temp("feet.asc"), s.rough_grid(33, 33, 7), crs=FEET), name="feet", block=4)
CLARKE = 'GEOGCS["NAD27",DATUM["North_American_Datum_1927",SPHEROID["Clarke 1866",6378206.4,294.978698213898]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]]'
s.import_terrain(BASE, s.write_grid(s.temp("clarke.asc"), s.rough_grid(33, 33, 7), x0=-100, y0=40, cell=0.01, crs=CLARKE), name="clarke", block=4)
db = s.connect(BASE)
FORMATS = ("strip", "indexed", "rqt", "rqt+normals", "obj", "ply", "ply+normals", "glb", "rqt+normals+errors", "wkb", "gpkg", "spatialite")
FREE = ("obj", "ply", "wkb", "gpkg", "spatialite")  # of meshes whose vertices are no samples
PART = "POLYGON((200 -200, 900 -300, 500 -800, 200 -200))"
VIEW = json.dumps({"eye": [300, -700, 400], "yaw": 20, "pitch": -40, "fovy": 60, "width": 400, "height": 300, "tau": 3})
EARTH = json.dumps({"eye": [10, 40, 8e6], "yaw": 20, "pitch": -80, "fovy": 50, "width": 400, "height": 300, "tau": 3})
CASES = [("hills", PART, 8, {}), ("hills", None, 1, {"max_vertices": 3000}), ("hills", PART, 5, {"mode": "cut"}), ("hills", PART, 5, {"mode": "border"}),
         ("hills", "POINT(9999 9999)", 5, {}), ("hills", None, 8, {"strip": "fan"}), ("hills", None, float("inf"), {"outline": "tol"}),
         ("globe", None, 1000, {}), ("globe", None, 1000, {"frame": "ecef"})]
VIEWS = [("hills", VIEW, {}), ("hills", VIEW, {"cover": "terrain"}), ("hills", VIEW, {"max_triangles": 300}), ("hills", VIEW, {"previous": ""}),
         ("hills", VIEW, {"test": "ulrich"}), ("hills", VIEW, {"cover": "terrain", "max_triangles": 300, "previous": ""}),
         ("globe", EARTH, {"frame": "ecef", "cover": "terrain"})]
TOLD = "vertices, triangles, achieved_eps"
VIEW_TOLD = "vertices, triangles, achieved_tau, guaranteed, token"

for terrain, region, eps, given in CASES:
    options = json.dumps(given)
    title = "%s %s, eps %g: " % (terrain, options, eps)
    arguments = (region, eps, terrain, options)
    vertices, triangles = (one(db, "SELECT count(*) FROM %s(?, ?, ?, ?)" % f, *arguments) for f in ("rqt_range", "rqt_triangles"))
    achieved = one(db, "SELECT max(achieved_eps) FROM rqt_range(?, ?, ?, ?)", *arguments)
    told = (vertices, triangles, eps if achieved is None else achieved)
    for function in ("rqt_range", "rqt_triangles", "rqt_strip"):
        equal(title + function + " tells in each row what the whole is", rows(db, "SELECT DISTINCT %s FROM %s(?, ?, ?, ?)" % (TOLD, function), *arguments),
              [told] if triangles else [])
    free = "frame" in given or given.get("mode") == "cut"
    for form in FREE if free else FORMATS:
        seen = rows(db, "SELECT * FROM rqt_answer(?, ?, ?, ?, ?)", region, eps, form, terrain, options)
        mesh = one(db, "SELECT rqt_mesh(?, ?, ?, ?, ?)", region, eps, form, terrain, options)
        check(title + form + ": one row, with rqt_mesh's bytes", len(seen) == 1 and seen[0][0] == mesh and isinstance(seen[0][0], type(mesh)))
        equal(title + form + ": and what they are the mesh of", seen[0][1:], told)
check("a budget achieves more than eps", one(db, "SELECT achieved_eps FROM rqt_answer(NULL, 1, 'rqt', 'hills', '{\"max_vertices\":3000}')") > 1)
poles = rows(db, "SELECT x0, y0, z0, x1, y1, z1, x2, y2, z2 FROM rqt_triangles(NULL, 1000, 'globe', '{\"frame\":\"ecef\"}')")
check("none of the Earth's triangles is one of two places", all(len({r[0:3], r[3:6], r[6:9]}) == 3 for r in poles))
check("and a pole is one vertex", [n for n, in rows(db, "SELECT count(*) FROM rqt_range(NULL, 1000, 'globe', '{\"frame\":\"ecef\"}') WHERE +row IN (0, 180) GROUP BY +row")]
      == [1, 1])

for terrain, view, given in VIEWS:
    options = json.dumps(given)
    title = "view of %s %s: " % (terrain, options)
    arguments = (view, terrain, options)
    vertices, triangles = (one(db, "SELECT count(*) FROM %s(?, ?, ?)" % f, *arguments) for f in ("rqt_view", "rqt_view_triangles"))
    told = (vertices, triangles) + one(db, "SELECT max(achieved_tau), max(guaranteed), max(token) FROM rqt_view(?, ?, ?)", *arguments)
    check(title + "has a token where there is a next one", (told[4] is not None) == ("previous" in given), told)
    for function in ("rqt_view", "rqt_view_triangles", "rqt_view_strip"):
        equal(title + function + " tells in each row what the whole is", rows(db, "SELECT DISTINCT %s FROM %s(?, ?, ?)" % (VIEW_TOLD, function), *arguments), [told])
    for form in FREE if "frame" in given else FORMATS:
        seen = rows(db, "SELECT * FROM rqt_view_answer(?, ?, ?, ?)", view, form, terrain, options)
        mesh = one(db, "SELECT rqt_view_mesh(?, ?, ?, ?)", view, form, terrain, options)
        check(title + form + ": one row, with rqt_view_mesh's bytes", len(seen) == 1 and seen[0][0] == mesh and isinstance(seen[0][0], type(mesh)))
        equal(title + form + ": and what they promise", seen[0][1:], told)

# Increments: the counts are those of the mesh that they end in.
for cover in ("picture", "terrain"):
    mesh, token = Mesh(), ""
    for step in range(6):
        seen = json.loads(VIEW)
        seen["eye"][0] += 40 * (step // 2)
        options = json.dumps({"previous": token, "cover": cover})
        for connection in (db, s.connect(BASE)):
            blob, *told = one(connection, "SELECT * FROM rqt_view_answer(?, 'increment', 'hills', ?)", json.dumps(seen), options)
            change = Increment(blob)
            after = change.apply(mesh)
            equal("increment %d (%s): vertices and triangles of the whole" % (step, cover), told[:2], [len(after.vertices), len(after.triangles)])
            equal("increment %d (%s): unchanged every other time" % (step, cover), change.is_unchanged, step % 2 == 1)
            equal("increment %d (%s): the token is the rows'" % (step, cover), told[4], one(
                connection, "SELECT max(token) FROM rqt_view(?, 'hills', ?)", json.dumps(seen), options))
            equal("increment %d (%s): and the mesh that of any format with that token" % (step, cover), s.struct.unpack_from("<QQ", one(
                connection, "SELECT mesh FROM rqt_view_answer(?, 'rqt', 'hills', ?)", json.dumps(seen), options), 16), tuple(told[:2]))
        mesh, token = after, told[4]

equal("in a join, each row has its own", rows(db, "SELECT e.value, a.achieved_eps, length(a.mesh) > 0 FROM json_each('[4,8,16]') e, rqt_answer(NULL, e.value, 'rqt', 'hills') a"),
      [(4, 4.0, 1), (8, 8.0, 1), (16, 16.0, 1)])
equal("bytes outlive their row", one(db, "SELECT max(mesh) = rqt_mesh(NULL, 4, 'rqt', 'hills') FROM rqt_answer(NULL, 4, 'rqt', 'hills')"), 1)
equal("and their query", one(db, "SELECT length((SELECT mesh FROM rqt_answer(NULL, 4, 'obj', 'hills'))) = length(rqt_mesh(NULL, 4, 'obj', 'hills'))"), 1)
for title, sentence, sql in (("an unknown format", 'rqt_answer(): unknown format "x"', "SELECT * FROM rqt_answer(NULL, 1, 'x', 'hills')"),
                             ("no format", "rqt_answer(): format is missing; use rqt_answer(region, eps, format [, terrain [, options]])", "SELECT * FROM rqt_answer(NULL, 1)"),
                             ("NULL as format", "rqt_answer(): format must be a text", "SELECT * FROM rqt_answer(NULL, 1, NULL, 'hills')"),
                             ("an eps that is none", "rqt_answer(): eps must be a number; it is text", "SELECT * FROM rqt_answer(NULL, 'x', 'obj', 'hills')"),
                             ("an argument too many", "too many arguments on rqt_answer", "SELECT * FROM rqt_answer(NULL, 1, 'obj', 'hills', '{}', 1)"),
                             ("no camera", "rqt_view_answer(): camera must be a JSON object, as text", "SELECT * FROM rqt_view_answer(NULL, 'obj', 'hills')"),
                             ("an increment of nothing", 'rqt_view_answer(): format "increment" is for views with option "previous"',
                              "SELECT * FROM rqt_view_answer('%s', 'increment', 'hills')" % VIEW),
                             ("an increment of a region", 'rqt_answer(): format "increment" is for views', "SELECT * FROM rqt_answer(NULL, 1, 'increment', 'hills')")):
    raises("refused: " + title, sentence, lambda: rows(db, sql))
first = s.connect(BASE)
first.execute("SELECT rqt_limit('triangles', 100)")
raises("limits hold", "rqt_answer(): the mesh has more than 100 triangles", lambda: rows(first, "SELECT * FROM rqt_answer(NULL, 0, 'rqt', 'hills')"))
try:
    rows(first, "SELECT * FROM rqt_view_answer(?, 'obj', 'hills')", VIEW)
except sqlite3.Error as error:
    check("of views, too", "rqt_view_answer(): the mesh has more than 100 triangles" in str(error), error)
equal("lonlat, metre, semi_major, inverse_flattening, crs_name", rows(
    db, "SELECT name, lonlat, round(metre, 12), semi_major, inverse_flattening, crs_name FROM rqt_terrains ORDER BY name"),
    [("clarke", 1, None, 6378206.4, 294.978698213898, "NAD27"), ("feet", 0, round(1200 / 3937, 12), None, None, "NAD27 / California zone I"),
     ("globe", 1, None, 6378137.0, 298.257223563, "WGS 84"), ("hills", 0, 1.0, None, None, None)])
s.finish()
