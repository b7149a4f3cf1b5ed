#!/usr/bin/python3
"""Errors of vertices on request, 'rqt+errors' and 'rqt+normals+errors', read by a decoder written from src/core/FORMAT.md alone: the
doubles of rqt_range's column error, bit for bit; the mesh and the normals before them are those without them."""
import struct

import sql_support as s
from sql_support import check, equal, one, raises, rows
from sql_wire import Wire

seen = {"codes": set(), "meshes": 0}


def bits(errors):
    return {v: struct.pack("<d", e) for v, e in errors}


def compare(title, wire, expected):
    """expected: rows col, row, error."""
    equal(title + ": errors are those of the column, bit for bit", bits((v[:2], e) for v, e in zip(wire.vertices, wire.errors)), bits(((c, r), e) for c, r, e in expected))
    check(title + ": the least is told", wire.least == min(wire.errors, default=0))
    seen["codes"].update(wire.errors)
    seen["meshes"] += len(wire.vertices) > 4


def body(blob):
    """All but flags and checksum."""
    return blob[:7] + blob[16:]


grids = (("plain", s.rough_grid(50, 50, 41), {"block": 3}), ("voids", s.rough_grid(37, 61, 42, 90), {"block": 2}), ("whole", s.rough_grid(33, 33, 43), {"block": 4}),
         ("clamped", s.rough_grid(34, 18, 44), {"block": 4}), ("islands", s.rough_grid(50, 40, 45, 700), {"block": 3}), ("smallest", s.rough_grid(19, 26, 46, 30), {"block": 1}),
         ("feet", s.rough_grid(33, 65, 47, 20), {"block": 6, "unit": "us-ft"}), ("default", s.rough_grid(133, 20, 48, 10), {}), ("row", [[1, 2, 3, 5]], {}))
for name, grid, options in grids:
    path = s.temp(name + ".db")
    s.import_terrain(path, s.write_grid(s.temp(name + ".asc"), grid), name=name, **options)
    db = s.connect(path)
    for region in (None, "POLYGON((3.2 -9.7, 21.4 -9.7, 21.4 -15.1, 3.2 -15.1, 3.2 -9.7))", "POLYGON((-9 50, -8 50, -8 51, -9 50))"):
        for eps in (float("inf"), 10, 3, 0) if region else (20, 0):
            title = "%s, %s, eps %g" % (name, region and region[:12], eps)
            plain, with_errors, normals, both = (one(db, "SELECT rqt_mesh(?, ?, ?)", region, eps, f)
                                                 for f in ("rqt", "rqt+errors", "rqt+normals", "rqt+normals+errors"))
            wire = Wire(with_errors)
            compare(title, wire, rows(db, "SELECT col, row, error FROM rqt_range(?, ?)", region, eps))
            check(title + ": the mesh is as without them", body(with_errors)[:len(body(plain))] == body(plain) and with_errors[7] == 2)
            check(title + ": mesh, normals, errors in this order", body(both) == body(normals) + with_errors[len(plain):] and both[7] == 3)
            if eps == 20:
                equal(title + ": they are read with normals too", (Wire(both).errors, Wire(both).normals), (wire.errors, Wire(normals).normals))
    # what else chooses vertices: forced ones, another outline, places of their own eps
    for further in ('{"mode":"border"}', '{"mode":"snap"}', '{"outline":"tol"}', '{"detail":[["POINT(9 -9)",0]]}'):
        region = "POLYGON((3.2 -9.7, 21.4 -9.7, 21.4 -15.1, 3.2 -15.1, 3.2 -9.7))"
        blob = one(db, "SELECT rqt_mesh(?, 12, 'rqt+errors', NULL, ?)", region, further)
        compare("%s, %s" % (name, further), Wire(blob), rows(db, "SELECT col, row, error FROM rqt_range(?, 12, NULL, ?)", region, further))
    db.close()
check("errors of all kinds were among them: none, infinite, many", {0.0, float("inf")} <= seen["codes"] and len(seen["codes"]) > 200 and seen["meshes"] > 50,
      (len(seen["codes"]), seen["meshes"]))

# A view: the eps of its mesh is infinite, and says nothing of its errors.
path = s.temp("view.db")
s.import_terrain(path, s.write_grid(s.temp("view.asc"), s.rough_grid(90, 80, 49, 4), cell=10), name="view", minimal=True)
db = s.connect(path)
camera = '{"eye":[-200,-400,300],"at":[400,-400,0],"fovy":50,"width":640,"height":480,"tau":%s}'
for tau in (1, 4, 40):
    wire = Wire(one(db, "SELECT rqt_view_mesh(?, 'rqt+errors')", camera % tau))
    compare("view, tau %d" % tau, wire, rows(db, "SELECT col, row, error FROM rqt_view(?)", camera % tau))
    equal("view, tau %d: with normals" % tau, Wire(one(db, "SELECT rqt_view_mesh(?, 'rqt+normals+errors')", camera % tau)).errors, wire.errors)
compare("a budget", Wire(one(db, "SELECT rqt_mesh(NULL, 0, 'rqt+errors', NULL, '{\"max_vertices\":500}')")),
        rows(db, "SELECT col, row, error FROM rqt_range(NULL, 0, NULL, '{\"max_vertices\":500}')"))
check("a view of more than a few vertices", len(Wire(one(db, "SELECT rqt_view_mesh(?, 'rqt')", camera % 1)).vertices) > 1000)
compare("minimal errors", Wire(one(db, "SELECT rqt_mesh(NULL, 5, 'rqt+errors', NULL, '{\"metric\":\"minimal\"}')")),
        rows(db, "SELECT col, row, error FROM rqt_range(NULL, 5, NULL, '{\"metric\":\"minimal\"}')"))
step = Wire(one(db, "SELECT rqt_delta(NULL, 20, 5)"), Wire(one(db, "SELECT rqt_mesh(NULL, 20, 'rqt+errors')")))
equal("a mesh with errors is as good a begin of increments, which have none", (step.errors, step.vertices, step.triangles),
      (None, *(lambda w: (w.vertices, w.triangles))(Wire(one(db, "SELECT rqt_mesh(NULL, 5, 'rqt')")))))

plain, with_errors = (one(db, "SELECT rqt_mesh(NULL, 0, ?)", f) for f in ("rqt", "rqt+errors"))
count = len(Wire(plain).vertices)
check("they take less than half a byte a vertex here", 0 < len(with_errors) - len(plain) < count / 2, (len(with_errors) - len(plain), count))
equal("equal queries, equal bytes", *(one(db, "SELECT rqt_mesh(NULL, 1, 'rqt+errors', 'view', ?)", o) for o in (None, '{"select":"bottomup"}')))

# What there is not
raises("formats without errors say so", 'rqt_mesh(): format "ply" has no errors of vertices; rqt has', lambda: one(db, "SELECT rqt_mesh(NULL, 0, 'ply+errors')"))
raises("... with normals too", 'rqt_mesh(): format "ply" has no errors of vertices; rqt has', lambda: one(db, "SELECT rqt_mesh(NULL, 0, 'ply+normals+errors')"))
raises("... our own too", 'rqt_mesh(): format "indexed" has no errors of vertices', lambda: one(db, "SELECT rqt_mesh(NULL, 0, 'indexed+errors')"))
raises("... and increments of views", 'rqt_view_mesh(): format "increment" has no errors of vertices', lambda: one(
    db, "SELECT rqt_view_mesh(?, 'increment+errors', NULL, '{\"previous\":\"\"}')", camera % 4))
for text in ("rqt+errors+normals", "rqt+errors+errors", "+errors", "rqt+error"):
    raises("there is no format %s" % text, 'rqt_mesh(): unknown format "%s"; there are strip indexed rqt' % text, lambda: one(db, "SELECT rqt_mesh(NULL, 0, ?)", text))
raises("no errors between samples", 'rqt_mesh(): format "rqt+normals+errors" holds whole samples', lambda: one(
    db, "SELECT rqt_mesh('POLYGON((31 -1, 32 -1, 32 -2, 31 -1))', 100, 'rqt+normals+errors', NULL, '{\"mode\":\"cut\"}')"))
s.finish()
