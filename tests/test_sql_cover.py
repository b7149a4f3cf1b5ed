#!/usr/bin/python3
"""Views that cover the terrain, in SQL: the picture's mesh is in them, what is beside it is not drawn and is all there, counted here; what is
read is needed; budgets and sequences of cameras, too."""
import json

import sql_support as s
from sql_eye import Eye, is_whole, textbook_ecef
from sql_increment import Increment, Mesh
from sql_support import check, equal, one, raises, rows

BASE = s.temp("cover.gpkg")
GRID = s.rough_grid(130, 97, 7, voids=20)
s.import_terrain(BASE, s.write_grid(s.temp("hills.asc"), GRID, cell=10), name="hills", block=4)
s.import_terrain(BASE, s.write_grid(s.temp("whole.asc"), s.rough_grid(150, 97, 5), cell=10), name="whole", block=4)
s.import_terrain(BASE, s.write_grid(s.temp("lonlat.asc"), s.rough_grid(65, 65, 3), x0=10, y0=46, cell=0.01, crs=s.WGS84), name="lonlat",
                 block=4)
s.import_terrain(BASE, s.write_large(s.temp("large.bin"), 513, 7), name="large", block=5)
s.import_terrain(BASE, s.DATA + "/etopo1_1deg.tif", name="globe", block=4)
db = s.connect(BASE)
PLACE = {name: rest for name, *rest in rows(db, "SELECT name, x0, y0, dx, dy, srid, width, height FROM rqt_terrains")}


def camera(x, y, z, **more):
    view = {"eye": [x, y, z], "yaw": 20, "pitch": -40, "fovy": 40, "width": 400, "height": 300, "tau": 3}
    view.update(more)
    return json.dumps(view)


def options(cover=None, **given):
    return json.dumps(dict(given, cover=cover) if cover else given)


VIEWS = {
    "whole": [camera(300, -700, 400), camera(740, -480, 90, yaw=250, pitch=-12, roll=15, tau=6), camera(-3000, -480, 900, yaw=90, pitch=-14, fovy=8),
              camera(740, -480, 5000, yaw=0, pitch=-90, fovy=170), camera(740, -480, 200, pitch=40), camera(740, -480, -400, pitch=60)],
    "hills": [camera(300, -700, 400), camera(900, -300, 120, pitch=-5)],
    "lonlat": [camera(10.1, 46.1, 4000, yaw=40, tau=2), camera(10.3, 46.6, 900, yaw=180, pitch=-8, exaggeration=3)],
    "large": [camera(300, -700, 600, yaw=60, pitch=-50, fovy=20, tau=10)],
    "globe": [camera(10, 40, 8e6, yaw=20, pitch=-80, exaggeration=10, fovy=20), camera(-170, 80, 3e6, yaw=200, pitch=-60)],
}


def triangles(view, terrain, **given):
    found = rows(db, "SELECT x0, y0, z0, x1, y1, z1, x2, y2, z2 FROM rqt_view_triangles(?, ?, ?)", view, terrain, options(**given))
    return {s.rotated((r[0:3], r[3:6], r[6:9])) for r in found}


def half_cells(found, terrain):
    """The area in half cells of the grid."""
    x0, y0, dx, dy = PLACE[terrain][:4]
    twice = 0
    for t in found:
        (xa, ya), (xb, yb), (xc, yc) = ((round((p[0] - x0) / dx), round((p[1] - y0) / dy)) for p in t)
        twice += abs((xb - xa) * (yc - ya) - (xc - xa) * (yb - ya))
    return twice


def valid_half_cells(grid):
    """Of a grid with voids: those whose three corners are known, cells being cut from north-west to south-east where column + row is even."""
    count = 0
    for y in range(len(grid) - 1):
        for x in range(len(grid[0]) - 1):
            nw, ne, sw, se = (grid[b][a] is not None for b in (y, y + 1) for a in (x, x + 1))
            count += (nw and se) * (ne + sw) if (x + y) % 2 == 0 else (ne and sw) * (nw + se)
    return count


def drawn_of(found, view, terrain):
    """How many triangles have a point of a lattice over them, on the mesh, in the picture."""
    x0, y0, dx, dy, srid = PLACE[terrain][:5]
    given = json.loads(view)
    of_eye = textbook_ecef if srid == 4326 else lambda x, y, z: (x, y, z)
    eye, k, count = Eye(view, of_eye, srid == 4326), given.get("exaggeration", 1), 0
    for t in found:
        places = [of_eye(p[0], p[1], p[2] * k) for p in t]
        n = 5
        count += any(eye.project(tuple((i * a + j * b + (n - i - j) * c) / n for a, b, c in zip(*places)))[3]
                     for i in range(n + 1) for j in range(n + 1 - i))
    return count


# ------------------------------------------------------------------------------------------- what is in the answer

for name, views in sorted(VIEWS.items()):
    width, height = PLACE[name][5:]
    for n, view in enumerate(views):
        title = "%s %d: " % (name, n)
        picture, terrain = triangles(view, name), triangles(view, name, cover="terrain")
        equal(title + "picture is what views cover", triangles(view, name, cover="picture"), picture)
        check(title + "the picture's triangles are the terrain's", picture <= terrain, len(picture - terrain))
        check(title + "there are others, where there is more", len(terrain) > len(picture) or half_cells(picture, name) == 2 * (width - 1) * (height - 1),
              (len(picture), len(terrain)))
        equal(title + "none of which is drawn", drawn_of(terrain - picture, view, name), 0)
        if picture:
            check(title + "as some of the picture's are", drawn_of(picture, view, name) > 0)
        if name != "hills":
            equal(title + "its area is the terrain's", half_cells(terrain, name), 2 * (width - 1) * (height - 1))
        check(title + "without cracks", is_whole(terrain))
        seen = one(db, "SELECT max_pixels, t_junctions, overlaps, uncovered, guaranteed, triangles FROM rqt_view_verify(?, ?, ?)", view, name,
                   options("terrain"))
        check(title + "proved", seen[0] <= json.loads(view)["tau"] and seen[1:] == (0, 0, 0, 1, len(terrain)), seen)
        corners = [tuple(r) for r in rows(db, "SELECT x, y, z FROM rqt_view_strip(?, ?, ?) ORDER BY seq", view, name, options("terrain"))]
        equal(title + "the strip has the same triangles", {s.rotated(t) for t in s.strip_triangles(corners)}, terrain)
        equal(title + "the vertices are theirs", set(rows(db, "SELECT x, y, z FROM rqt_view(?, ?, ?)", view, name, options("terrain"))),
              {p for t in terrain for p in t})
        for form in ("strip", "indexed"):
            equal(title + form + " has them, too", {s.rotated(t) for t in s.mesh_blob(one(
                db, "SELECT rqt_view_mesh(?, ?, ?, ?)", view, form, name, options("terrain")))[1]}, terrain)
        equal(title + "rqt has as many", s.struct.unpack_from("<Q", one(
            db, "SELECT rqt_view_mesh(?, 'rqt', ?, ?)", view, name, options("terrain")), 24)[0], len(terrain))
away = camera(300, -4000, 400, yaw=180, pitch=10)
check("who looks away has the terrain all the same, and coarse", triangles(away, "whole") == set() and len(triangles(away, "whole", cover="terrain")) < 200
      and half_cells(triangles(away, "whole", cover="terrain"), "whole") == 2 * 149 * 96, len(triangles(away, "whole", cover="terrain")))
for n, view in enumerate(VIEWS["hills"]):
    exact = triangles(view, "hills", cover="terrain", outline="exact")
    equal("hills %d: with voids and outline exact the area is that of what is known" % n, half_cells(exact, "hills"), valid_half_cells(GRID))
for test in ("ulrich", "node", "sphere", "lindstrom", "lodmap"):
    view = VIEWS["whole"][0]
    found = triangles(view, "whole", cover="terrain", test=test)
    check("test %s covers it, too" % test, triangles(view, "whole", test=test) <= found and is_whole(found)
          and half_cells(found, "whole") == 2 * 149 * 96, len(found))
    equal("what a test of the literature promises (%s)" % test, one(db, "SELECT guaranteed FROM rqt_view_answer(?, 'rqt', 'whole', ?)", view,
                                                                    options("terrain", test=test)), 0)
closed = rows(db, "SELECT x0, y0, z0, x1, y1, z1, x2, y2, z2 FROM rqt_view_triangles(?, 'globe', '{\"frame\":\"ecef\",\"cover\":\"terrain\"}')", VIEWS["globe"][0])
edges = {}
for r in closed:
    for a, b in ((r[0:3], r[3:6]), (r[3:6], r[6:9]), (r[6:9], r[0:3])):
        edges[a, b] = edges.get((a, b), 0) + 1
check("the whole Earth is one closed surface, wherever one looks", len(closed) > 100 and all(n == 1 and (b, a) in edges for (a, b), n in edges.items()), len(closed))

# ------------------------------------------------------------------------------------------------- what is read


def cell_of(number):
    """A block's level and cell, by FORMAT.md."""
    level = 0
    while 4 ** (level + 1) <= number:
        level += 1
    code = number - 4 ** level
    i = sum((code >> 2 * b & 1) << b for b in range(21))
    j = sum((code >> 2 * b + 1 & 1) << b for b in range(21))
    return level, i, j


for name in ("large", "whole"):
    width, height = PLACE[name][5:]
    big_k = 0
    while (1 << big_k) + 1 < max(width, height):
        big_k += 1
    for view in VIEWS[name]:
        read = rows(db, "SELECT block FROM rqt_view_explain(?, ?, ?)", view, name, options("terrain"))
        vertices = set(rows(db, "SELECT col, row FROM rqt_view(?, ?, ?)", view, name, options("terrain")))
        needless = []
        for (number,) in read:
            level, i, j = cell_of(number)
            side = 1 << big_k >> level
            # The block of twice the side would have done if nothing had asked for more than its grid: then its centre is not in the mesh.
            x, y = (i // 2 * 2 + 1) * side, (j // 2 * 2 + 1) * side
            if level > 0 and (min(x, width - 1), min(y, height - 1)) not in vertices:
                needless.append(number)
        equal("%s: no block is read where a coarser one would have done" % name, needless, [])
        few = {b for b, in rows(db, "SELECT block FROM rqt_view_explain(?, ?)", view, name)}
        check("%s: and what the picture reads is read" % name, few <= {b for b, in read}, (few, read))
total = one(db, "SELECT blocks FROM rqt_terrains WHERE name = 'large'")
read = one(db, "SELECT count(*) FROM rqt_view_explain(?, 'large', ?)", VIEWS["large"][0], options("terrain"))
check("far fewer than there are", read < total / 2, (read, total))

# ---------------------------------------------------------------------------------------------- budgets and sequences

view = VIEWS["whole"][0]
count, tau = one(db, "SELECT count(*), max(achieved_tau) FROM rqt_view_triangles(?, 'whole', ?)", view, options("terrain", max_triangles=300))
plain = one(db, "SELECT max(achieved_tau) FROM rqt_view_triangles(?, 'whole', ?)", view, options(max_triangles=300))
check("a budget is one for all of the mesh", 100 < count <= 300 and tau > plain > 3, (count, tau, plain))
wanted = {"cover": "terrain", "max_triangles": 300}
seen = one(db, "SELECT max_pixels, achieved_tau, uncovered FROM rqt_view_verify(?, 'whole', ?)", view, json.dumps(wanted))
check("within which it is proved", seen[0] <= seen[1] == tau and seen[2] == 0, seen)
equal("and still covers the terrain", half_cells(triangles(view, "whole", **wanted), "whole"), 2 * 149 * 96)


def follow(view, token, connection=db, cover="terrain"):
    blob, said = one(connection, "SELECT mesh, token FROM rqt_view_answer(?, 'increment', 'whole', ?)", view, options(cover, previous=token))
    return Increment(blob), said


mesh, token, kept = Mesh(), "", 0
for step in range(12):
    view = camera(300 + 25 * step, -700 + 20 * step, 300, yaw=20 + step)
    change, said = follow(view, token)
    kept += said == token
    mesh, token = change.apply(mesh), said
    x0, y0, dx, dy = PLACE["whole"][:4]
    area = sum(abs((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])) for a, b, c in (
        [mesh.vertices[i] for i in t] for t in mesh.triangles))
    equal("following, step %d: the terrain's area" % step, area, 2 * 149 * 96)
    seen = one(db, "SELECT max_pixels, achieved_tau, uncovered FROM rqt_view_verify(?, 'whole', ?)", view, options("terrain", previous=token))
    check("following, step %d: proved" % step, seen[0] <= seen[1] == 3 and seen[2] == 0, seen)
change, again = follow(view, token)
check("nothing changes while the camera stays", again == token and change.is_unchanged)
other = s.connect(BASE)
change, again = follow(view, token, other)
check("nor on another connection, which has to ask", again == token and change.is_unchanged)
change, again = follow(view, token, cover="picture")
check("a token is one of what is covered: of the picture the answer is from nothing", again != token and change.apply(Mesh()) is not None)
change, said = follow(view, again)
check("and back", said == token and change.apply(Mesh()) == mesh)
moves = rows(db, "SELECT z, z_from, weight FROM rqt_view(?, 'whole', ?)", VIEWS["whole"][0], options("terrain"))
check("vertices come from a coarser mesh of the terrain", sum(1 for m in moves if m[2] == 0) > 20 and all(
    m[1] is not None for m in moves), len(moves))

# ------------------------------------------------------------------------------------------------------- sentences

raises("cover is for views", 'rqt_range(): option "cover" is for views', lambda: rows(db, "SELECT * FROM rqt_range(NULL, 1, 'whole', '{\"cover\":\"picture\"}')"))
raises("what it can be", 'option "cover" has no value "all"; this version knows picture terrain', lambda: rows(
    db, "SELECT * FROM rqt_view(?, 'whole', '{\"cover\":\"all\"}')", view))
raises("and that it is a text", 'option "cover" must be a text', lambda: rows(db, "SELECT * FROM rqt_view(?, 'whole', '{\"cover\":true}')", view))
s.finish()
