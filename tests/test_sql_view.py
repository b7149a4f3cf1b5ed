#!/usr/bin/python3
"""Views in SQL: the answer is one mesh on every path, closed, and no sample that is drawn is further than tau from its place in it,
by projection worked out here; cameras in any position; what is read; sentences."""
import json
import math
import sqlite3
import time

import sql_support as s
from sql_eye import Eye, is_whole, textbook_ecef
from sql_support import check, equal, one, raises, rows

DATA = s.DATA + "/"
BASE = s.temp("views.gpkg")
s.import_terrain(BASE, DATA + "SainteHelens.dem", name="helens")
s.import_terrain(BASE, s.DEMO, name="washington")
s.import_terrain(BASE, DATA + "glarus_alpine_25m_161.tif", name="alps", block=3)
s.import_terrain(BASE, DATA + "etopo1_1deg.tif", name="globe", block=4)
db = s.connect(BASE)
TERRAINS = {name: dict(zip("width height x0 y0 dx dy low high srid".split(), rest)) for name, *rest in
            rows(db, "SELECT name, width, height, x0, y0, dx, dy, min_z, max_z, srid FROM rqt_terrains")}


def camera(**given):
    view = {"fovy": 45, "width": 640, "height": 480}
    view.update(given)
    return json.dumps(view)


def place(terrain, u, v, z):
    """u, v of the way east and south across the terrain."""
    t = TERRAINS[terrain]
    return [t["x0"] + u * (t["width"] - 1) * t["dx"], t["y0"] + v * (t["height"] - 1) * t["dy"], z]


def triangles(view, terrain, options=None):
    found = rows(db, "SELECT x0, y0, z0, x1, y1, z1, x2, y2, z2 FROM rqt_view_triangles(?, ?, ?)", view, terrain, options)
    return [((r[0], r[1], r[2]), (r[3], r[4], r[5]), (r[6], r[7], r[8])) for r in found]


def samples(terrain):
    if "samples" not in TERRAINS[terrain]:
        TERRAINS[terrain]["samples"] = {(c, r): z for c, r, z in rows(
            db, "SELECT col, row, z FROM rqt_range(NULL, 0, ?, '{\"metric\":\"exact\"}')", terrain)}
    return TERRAINS[terrain]["samples"]


def worst(view, terrain, options=None, each=1):
    """Of `each`th sample: the worst displacement in pixels of any sample that is drawn, or is drawn by the mesh; and how many are drawn, and how many
    drawn samples no triangle holds. Samples that eps 0 leaves out lie in the plane of what it has: enough, for planes of pictures."""
    t = TERRAINS[terrain]
    degrees = t["srid"] == 4326
    given = json.loads(view)
    k = given.get("exaggeration", 1)
    of_eye = textbook_ecef if degrees else lambda x, y, z: (x, y, z)
    eye = Eye(view, of_eye, degrees)
    scene = lambda x, y, z: of_eye(x, y, z * k)
    height, known = samples(terrain), set()
    most, drawn = 0.0, 0
    for a, b, c in triangles(view, terrain, options):
        corners = [(round((p[0] - t["x0"]) / t["dx"]), round((p[1] - t["y0"]) / t["dy"])) for p in (a, b, c)]
        places = [scene(*p) for p in (a, b, c)]
        (xa, ya), (xb, yb), (xc, yc) = corners
        area = (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya)
        for row in range(min(ya, yb, yc), max(ya, yb, yc) + 1):
            for col in range(min(xa, xb, xc), max(xa, xb, xc) + 1):
                if (col, row) not in height or (7 * col + 3 * row) % each:
                    continue
                u = (col - xa) * (yc - ya) - (xc - xa) * (row - ya)
                v = (xb - xa) * (row - ya) - (col - xa) * (yb - ya)
                if u * area < 0 or v * area < 0 or abs(u + v) > abs(area):
                    continue
                known.add((col, row))
                weights = (1 - (u + v) / area, u / area, v / area)
                p = eye.project(scene(t["x0"] + col * t["dx"], t["y0"] + row * t["dy"], height[col, row]))
                q = eye.project(tuple(sum(w * corner[i] for w, corner in zip(weights, places)) for i in range(3)))
                if not p[3] and not q[3]:
                    continue
                drawn += 1
                most = max(most, math.hypot(p[0] - q[0], p[1] - q[1]) if p[2] > 0 and q[2] > 0 else math.inf)
    missed = 0
    for (col, row), z in height.items():
        if (7 * col + 3 * row) % each == 0 and (col, row) not in known and eye.project(scene(t["x0"] + col * t["dx"], t["y0"] + row * t["dy"], z))[3]:
            missed += 1
    return most, drawn, missed


# --------------------------------------------------------------------------------------------- one mesh, all paths

VIEWS = {
    "helens": [camera(eye=place("helens", 0.1, 0.9, 2600), at=place("helens", 0.5, 0.5, 1500), tau=4),
               camera(eye=place("helens", 0.5, 0.5, 9000), yaw=30, pitch=-90, tau=3),
               camera(eye=place("helens", 0.7, 0.2, 2800), yaw=200, pitch=-12, roll=20, tau=6, exaggeration=2, near=500, far=9000)],
    "washington": [camera(eye=[-71.5, 44.1, 2500], at=[-71.3033, 44.2705, 1500], tau=8)],
    "alps": [camera(eye=place("alps", 0.2, 0.8, 3200), yaw=45, pitch=-20, tau=4, fovy=70)],
    "globe": [camera(eye=[10, 40, 8e6], yaw=20, pitch=-80, tau=2, exaggeration=10)],
}
# Samples in voids' neighbourhoods that bear no triangle are not drawn by any mesh.
for name, views in VIEWS.items():
    for n, view in enumerate(views):
        title = "%s %d: " % (name, n)
        found = triangles(view, name)
        check(title + "something is seen", len(found) > 50, len(found))
        as_set = sorted(s.rotated(t) for t in found)
        corners = [tuple(r) for r in rows(db, "SELECT x, y, z FROM rqt_view_strip(?, ?) ORDER BY seq", view, name)]
        equal(title + "the strip has the same triangles", sorted(s.rotated(t) for t in s.strip_triangles(corners)), as_set)
        equal(title + "the vertices are those of the triangles", sorted(rows(db, "SELECT x, y, z FROM rqt_view(?, ?)", view, name)),
              sorted({p for t in found for p in t}))
        for form in ("strip", "indexed"):
            head, mesh = s.mesh_blob(one(db, "SELECT rqt_view_mesh(?, ?, ?)", view, form, name))
            equal(title + form + " has the same triangles, and an infinite eps",
                  (sorted(s.rotated(t) for t in mesh), head["eps"]), (as_set, math.inf))
        equal(title + "obj has as many", one(db, "SELECT rqt_view_mesh(?, 'obj', ?)", view, name).count("\nf "), len(found))
        blob = one(db, "SELECT rqt_view_mesh(?, 'rqt', ?)", view, name)
        equal(title + "rqt has as many vertices and triangles", s.struct.unpack_from("<QQ", blob, 16),
              (one(db, "SELECT count(*) FROM rqt_view(?, ?)", view, name), len(found)))
        check(title + "no crack, no overlap", is_whole(found))
        again = s.connect(BASE)
        equal(title + "another connection says the same bytes", one(again, "SELECT rqt_view_mesh(?, 'rqt', ?)", view, name), blob)
        again.close()
        equal(title + "every row says what was kept", rows(
            db, "SELECT DISTINCT achieved_tau, guaranteed FROM rqt_view_triangles(?, ?)", view, name),
            [(json.loads(view)["tau"], 1)])

# ---------------------------------------------------------------------------------------------------- the promise

for name, n, each in (("helens", 0, 5), ("helens", 1, 5), ("helens", 2, 5), ("alps", 0, 1), ("globe", 0, 3)):
    view = VIEWS[name][n]
    tau = json.loads(view)["tau"]
    most, drawn, missed = worst(view, name, each=each)
    check("%s %d: what is drawn is within tau" % (name, n), drawn > 300 and most <= tau, (most, drawn))
    check("%s %d: and the tolerance is used" % (name, n), most > tau / 8, most)
    if name != "helens":  # which has voids
        equal("%s %d: every sample that is drawn has its triangle" % (name, n), missed, 0)
for test in ("ulrich", "node", "sphere", "lindstrom", "lodmap"):
    options = json.dumps({"test": test})
    found = triangles(VIEWS["alps"][0], "alps", options)
    check("test %s gives a mesh without cracks" % test, len(found) > 10 and is_whole(found), len(found))
    check("test %s gives a mesh of its own metric" % test, found != triangles(VIEWS["alps"][0], "alps") and rows(
        db, "SELECT DISTINCT why FROM rqt_view_explain(?, 'alps', ?)", VIEWS["alps"][0], options)[0][0].count("not stored") == 1)
    equal("test %s promises nothing" % test, one(db, "SELECT max(guaranteed) FROM rqt_view(?, 'alps', ?)", VIEWS["alps"][0], options), 0)
equal("test guaranteed is what views use", triangles(VIEWS["alps"][0], "alps", '{"test":"guaranteed"}'),
      triangles(VIEWS["alps"][0], "alps"))

summit = [(c, r, z) for (c, r), z in samples("alps").items()]
top = max(summit, key=lambda p: p[2])
at_top = [TERRAINS["alps"]["x0"] + top[0] * 25, TERRAINS["alps"]["y0"] - top[1] * 25, top[2]]
for title, given in (
        ("F31 eye below ground", dict(eye=place("alps", 0.5, 0.5, -500), yaw=10, pitch=30, tau=8)),
        ("F31 eye inside the terrain's box", dict(eye=place("alps", 0.5, 0.5, 1800), yaw=10, pitch=-5, tau=8)),
        ("F31 eye on a vertex", dict(eye=at_top, yaw=10, pitch=-30, tau=8)),
        ("F31 eye at infinity", dict(eye=place("alps", 0.5, 0.5, 1e9), yaw=0, pitch=-90, fovy=0.01, tau=0.01)),
        ("F32 field of view of 0.01 degrees", dict(eye=place("alps", 0, 1, 1e6), at=place("alps", 0.5, 0.5, 1500), fovy=0.01, tau=2)),
        ("F32 field of view of 170 degrees", dict(eye=place("alps", 0.3, 0.6, 3000), yaw=60, pitch=-40, fovy=170, tau=2)),
        ("turned by 35 degrees in its picture", dict(eye=place("alps", 0.5, 0.9, 4500), yaw=10, pitch=-40, roll=35, width=150, height=600, tau=4)),
        ("F33 straight down", dict(eye=place("alps", 0.5, 0.5, 5000), yaw=77, pitch=-90, tau=3)),
        ("F33 at what is straight below", dict(eye=place("alps", 0.5, 0.5, 5000), at=place("alps", 0.5, 0.5, 0), tau=3))):
    most, drawn, missed = worst(camera(**given), "alps", each=2)
    check(title, most <= given["tau"] and missed == 0 and is_whole(triangles(camera(**given), "alps")), (most, drawn, missed))

# -------------------------------------------------------------------------------------------------------- cameras

db.load_extension("mod_spatialite")
TO_CRS = ("SELECT ST_X(p), ST_Y(p) FROM (SELECT ST_Transform(MakePoint(?, ?, 4326), 2056, NULL, 'EPSG:4326', 'EPSG:2056') p)")
eye, at = [9.02, 47.02, 3500], [9.03, 47.03, 1000]
same = [camera(eye=[*one(db, TO_CRS, *p[:2]), p[2]], at=[*one(db, TO_CRS, *q[:2]), q[2]], tau=2) for p, q in [(eye, at)]]
same += [camera(eye=eye, at=at, tau=2, position="lonlat"),
         camera(eye=textbook_ecef(*eye), at=textbook_ecef(*at), tau=2, position="ecef")]
found = [triangles(view, "alps") for view in same]
check("places in lon/lat and geocentric ones are those of the CRS", found[0] == found[1] == found[2] and len(found[0]) > 100,
      [len(f) for f in found])
eye, at = [-71.5, 44.1, 2500], [-71.3033, 44.2705, 1500]
found = [triangles(camera(tau=9, **given), "washington") for given in (
    dict(eye=eye, at=at), dict(eye=eye, at=at, position="lonlat"),
    dict(eye=textbook_ecef(*eye), at=textbook_ecef(*at), position="ecef"))]
check("in degrees, too", found[0] == found[1] == found[2] and len(found[0]) > 100, [len(f) for f in found])
plain = s.connect(BASE)
raises("lon/lat on a projected terrain needs SpatiaLite", "load mod_spatialite", lambda: rows(
    plain, "SELECT * FROM rqt_view(?, 'alps')", same[1]))
plain.close()
few, many = (len(triangles(camera(eye=place("alps", 0.5, 0.9, 2500), yaw=0, pitch=-20, tau=t), "alps")) for t in (16, 2))
check("a smaller tau needs more", few < many, (few, many))
few, many = (len(triangles(camera(eye=place("alps", 0.5, 0.9, 15000), yaw=0, pitch=-80, tau=4, exaggeration=k), "alps")) for k in (1, 4))
check("more exaggeration needs more", few < many, (few, many))
away = triangles(camera(eye=place("alps", 0.5, -0.2, 9000), yaw=0, pitch=20), "alps")
equal("who looks away sees nothing", away, [])
equal("nothing is a valid empty file", s.mesh_blob(one(db, "SELECT rqt_view_mesh(?, 'strip', 'alps')", camera(
    eye=place("alps", 0.5, -0.2, 9000), yaw=0, pitch=20)))[1], [])

# -------------------------------------------------------------------------------------------------------- options

view = VIEWS["alps"][0]
inside = "POLYGON((%s))" % ", ".join("%r %r" % tuple(place("alps", u, v, 0)[:2]) for u, v in ((.3, .3), (.4, .3), (.4, .4), (.3, .4), (.3, .3)))
more = triangles(view, "alps", json.dumps({"detail": [[inside, 0.0]]}))
check("detail adds where it is, and nothing is lost by it", len(more) > len(triangles(view, "alps")) and is_whole(more), len(more))
fan = [tuple(r) for r in rows(db, "SELECT x, y, z FROM rqt_view_strip(?, 'alps', '{\"strip\":\"fan\"}')", view)]
equal("strip fan: the same triangles", sorted(s.rotated(t) for t in s.strip_triangles(fan)),
      sorted(s.rotated(t) for t in triangles(view, "alps")))
check("metric wedgie is a bound, too", worst(view, "alps", '{"metric":"wedgie"}')[0] <= 4)
for select in ("topdown", "bottomup"):
    equal("select %s: the same mesh" % select, triangles(view, "alps", '{"select":"%s"}' % select), triangles(view, "alps"))
tol, exact = (one(db, "SELECT count(*) FROM rqt_view(?, 'helens', ?)", camera(
    eye=place("helens", 0.5, 0.5, 30000), yaw=0, pitch=-90, tau=8), o) for o in (None, '{"outline":"exact"}'))
check("outlines are tol unless options say exact", tol < exact / 2, (tol, exact))
flat = VIEWS["globe"][0]
framed = {r[3:]: r[:3] for r in rows(db, "SELECT x, y, z, col, row FROM rqt_view(?, 'globe', '{\"frame\":\"ecef\"}')", flat)}
plainly = {r[3:]: r[:3] for r in rows(db, "SELECT x, y, z, col, row FROM rqt_view(?, 'globe')", flat)}
check("frame ecef: vertices are where the textbook has them", len(framed) > 50 and all(
    math.dist(framed[v], textbook_ecef(*p)) < 1e-6 for v, p in plainly.items() if 0 < v[0] < 360 and 0 < v[1] < 180))
far = camera(eye=[-170, 80, 6e7], at=[0, 0, -6378137], tau=2)
whole = [tuple(r) for r in rows(db, "SELECT x0, y0, z0, x1, y1, z1, x2, y2, z2 FROM rqt_view_triangles(?, 'globe', '{\"frame\":\"ecef\"}')", far)]
edges = {}
for r in whole:
    corners = (r[0:3], r[3:6], r[6:9])
    for i in range(3):
        edges[corners[i], corners[(i + 1) % 3]] = edges.get((corners[i], corners[(i + 1) % 3]), 0) + 1
check("F28 the whole Earth is one closed surface", len(whole) > 100 and all(n == 1 and (b, a) in edges for (a, b), n in edges.items()), len(whole))

# ----------------------------------------------------------------------------------------------------- what is read

big = s.temp("large.gpkg")
s.import_terrain(big, s.write_large(s.temp("large.bin"), 1025, 7), name="large")
db2 = s.connect(big)
view = camera(eye=[300, -700, one(db2, "SELECT max_z FROM rqt_terrains")], yaw=60, pitch=-50, fovy=20, tau=60)
read = rows(db2, "SELECT level, extent, why, bytes, cached, selected, block, guaranteed FROM rqt_view_explain(?)", view)
total = one(db2, "SELECT blocks FROM rqt_terrains")
check("explain: far fewer blocks than there are", 3 < len(read) < total / 2, (len(read), total))
check("explain: says why", all("view" in r[2] for r in read))
vertices = set(rows(db2, "SELECT col, row FROM rqt_view(?)", view))


def extent_of(wkt):
    numbers = [float(n) for n in wkt[len("POLYGON(("):-2].replace(",", " ").split()]
    return min(numbers[0::2]), -max(numbers[1::2]), max(numbers[0::2]), -min(numbers[1::2])


for r in read:
    if r[3] == 0:
        continue
    x0, y0, x1, y1 = extent_of(r[1])
    if not any(x0 <= c <= x1 and y0 <= v <= y1 for c, v in vertices):
        check("explain: a block is read for what is in the answer", False, r)
        break
else:
    check("explain: a block is read for what is in the answer", True)
first = s.connect(big)
start = time.process_time()
one(first, "SELECT length(rqt_view_mesh(?, 'strip'))", view)
fresh, start = time.process_time() - start, time.process_time()
for _ in range(5):
    one(first, "SELECT length(rqt_view_mesh(?, 'strip'))", view)
print("   %d vertices: the first view of a connection %.2f ms, the next ones %.2f ms" % (
    len(vertices), fresh * 1e3, (time.process_time() - start) * 200))

# ------------------------------------------------------------------------------------------------------- sentences

good = json.loads(camera(eye=place("alps", 0.5, 0.9, 2500), yaw=0, pitch=-20))


def refuses(sentence, change, options=None, drop=()):
    given = {k: v for k, v in dict(good, **change).items() if k not in drop}
    raises("refused: " + sentence[:60], "rqt_view(): " + sentence, lambda: rows(
        db, "SELECT * FROM rqt_view(?, 'alps', ?)", json.dumps(given), options))


refuses('camera: "eye" is missing', {}, drop=("eye",))
refuses('camera: "fovy" is missing', {}, drop=("fovy",))
refuses('camera: "width" is missing', {}, drop=("width",))
refuses("camera: it looks nowhere", {}, drop=("yaw",))
refuses('camera: "at" does not go with "yaw" and "pitch"', {"at": [0, 0, 0]})
refuses('camera: "eye" must be three numbers', {"eye": [1, 2]})
refuses('camera: "eye" must be three numbers', {"eye": [1, 2, "3"]})
refuses('camera: "eye" must be three numbers', {"eye": [1, 2, 3, 4]})
refuses('camera: "eye" must be three numbers', {"eye": [1, 2, 1e300]})
refuses('camera: "fovy" must be degrees, above 0 and below 180', {"fovy": 180})
refuses('camera: "tau" must be a number above 0', {"tau": 0})
refuses('camera: "near" must be a number, 0 or more', {"near": -1})
refuses('camera: "near" must be less than "far"', {"near": 5, "far": 5})
refuses('camera: "exaggeration" must be a number above 0', {"exaggeration": 0})
refuses('camera: "roll" must be a number', {"roll": "x"})
refuses('camera: "position" must be crs, lonlat or ecef', {"position": "moon"})
refuses('camera: unknown key "zoom"; there are eye, at', {"zoom": 2})
refuses("camera: the camera looks nowhere", {"at": good["eye"]}, drop=("yaw", "pitch"))
refuses('camera: "eye": there is no latitude 91', {"eye": [9, 91, 0], "position": "lonlat"})
refuses('option "mode" of a view must be cover', {}, '{"mode":"cut"}')
refuses('option "max_vertices" does not go with a view', {}, '{"max_vertices":100}')
refuses("a view needs the metric exact or wedgie", {}, '{"metric":"local"}')
refuses('option "metric" does not go with "test":"ulrich"', {}, '{"metric":"exact","test":"ulrich"}')
refuses('option "test" has no value "best"', {}, '{"test":"best"}')
for title, value, sentence in (("text that is no JSON", "{eye", "camera is not JSON, from here"), ("no object", "[1]", "camera must be a JSON object"),
                               ("NULL", None, "camera must be a JSON object, as text"), ("a number", 5, "camera must be a JSON object, as text"),
                               ("a key twice", '{"eye":[0,0,0],"eye":[0,0,0]}', 'camera: "eye" is given twice')):
    raises("refused: " + title, "rqt_view(): " + sentence, lambda: rows(db, "SELECT * FROM rqt_view(?, 'alps')", value))
raises("test is for views", 'rqt_range(): option "test" is for views', lambda: rows(
    db, "SELECT * FROM rqt_range(NULL, 1, 'alps', '{\"test\":\"ulrich\"}')"))
raises("a format that is none", 'rqt_view_mesh(): unknown format "x"', lambda: one(db, "SELECT rqt_view_mesh(?, 'x', 'alps')", json.dumps(good)))
s.finish()
