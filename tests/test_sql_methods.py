#!/usr/bin/python3
"""Other metrics, ways of selecting, strips of fans, vertex budgets and stored minimal errors, from SQL."""
import json
import os
import shutil

import sql_support as s
from sql_support import check, equal, one, rows, triangles

METRICS = ["exact", "minimal", "local", "wedgie", "euclid", "plane"]
BOUNDS = ["exact", "minimal", "wedgie"]
EPS = [0, 1, 5, 20, 100, float("inf")]


def options(**keys):
    return json.dumps(keys)


def proof(db, eps, **keys):
    names = "samples vertices triangles max_error t_junctions overlaps uncovered void_touched area achieved_eps".split()
    return dict(zip(names, rows(db, "SELECT %s FROM rqt_verify(NULL, ?, NULL, ?)" % ", ".join(names), eps, options(**keys))[0]))


grids = {"hills": s.rough_grid(75, 61, 5), "lakes": s.rough_grid(66, 49, 6, 60), "flat": [[7] * 20 for _ in range(11)],
         "row": [list(range(0, 50, 3))], "square": s.rough_grid(65, 65, 8)}
databases = {}
for name, grid in grids.items():
    databases[name] = s.temp(name + ".gpkg")
    s.import_terrain(databases[name], s.write_grid(s.temp(name + ".asc"), grid), name="t", block=4 if name != "flat" else 2)
for name in ("SainteHelens.dem", "glarus_alpine_25m_161.tif"):
    databases[name] = s.temp(name + ".gpkg")
    s.import_terrain(databases[name], os.path.join(s.DATA, name), name="t")

for name, path in databases.items():
    db = s.connect(path)
    quantum_error = one(db, "SELECT quantum_error FROM rqt_terrains")
    whole, bounded, larger = [], [], []
    for eps in EPS:
        exact = proof(db, eps)
        for metric in METRICS:
            p = proof(db, eps, metric=metric)
            if (p["t_junctions"], p["overlaps"], p["uncovered"], p["void_touched"]) != (0, 0, 0, 0) or p["area"] != exact["area"]:
                whole.append((metric, eps, p))
            if metric in BOUNDS and not p["max_error"] <= max(eps, quantum_error):
                bounded.append((metric, eps, p["max_error"]))
            if metric == "minimal" and p["vertices"] > exact["vertices"] or metric == "wedgie" and p["vertices"] < exact["vertices"]:
                larger.append((metric, eps, p["vertices"], exact["vertices"]))
    equal(name + ": every metric's mesh is whole, at six eps", whole, [])
    equal(name + ": exact, minimal and wedgie keep the bound", bounded, [])
    equal(name + ": minimal has no more vertices than exact, wedgie no fewer", larger, [])
    different, parts, fans = [], [], []
    x0, y0, dx, dy, width, height = rows(db, "SELECT x0, y0, dx, dy, width, height FROM rqt_terrains")[0]
    xs, ys = sorted((x0 + 0.2 * width * dx, x0 + 0.7 * width * dx)), sorted((y0 + 0.1 * height * dy, y0 + 0.55 * height * dy))
    window = "POLYGON((%r %r, %r %r, %r %r, %r %r, %r %r))" % (xs[0], ys[0], xs[1], ys[0], xs[1], ys[1], xs[0], ys[1], xs[0], ys[0])
    for metric in METRICS:
        mesh = triangles(db, None, 5, None, options(metric=metric))
        for select in ("topdown", "bottomup"):
            if triangles(db, None, 5, None, options(metric=metric, select=select)) != mesh:
                different.append((metric, select))
        part = triangles(db, window, 5, None, options(metric=metric))
        if not set(part) <= set(mesh) or (mesh and len(part) == len(mesh) and len(mesh) > 100):
            parts.append((metric, len(part), len(mesh)))
        for region, wanted in ((None, mesh), (window, part)):
            strip = rows(db, "SELECT x, y, z FROM rqt_strip(?, 5, NULL, ?)", region, options(metric=metric, strip="fan"))
            if sorted(map(s.rotated, s.strip_triangles(strip))) != sorted(map(s.rotated, wanted)):
                fans.append((metric, region))
    equal(name + ": all ways of selecting give one mesh, by every metric", different, [])
    equal(name + ": a window's mesh is part of the whole, by every metric", parts, [])
    equal(name + ": a strip of fans is the same triangles, by every metric", fans, [])
    blob = one(db, "SELECT rqt_mesh(NULL, 5, 'strip', NULL, ?)", options(strip="fan", metric="local"))
    equal(name + ": so is the one of rqt_mesh", sorted(map(s.rotated, s.mesh_blob(blob)[1])),
          sorted(map(s.rotated, triangles(db, None, 5, None, options(metric="local")))))

    # a budget: the smallest eps that keeps it
    wrong = []
    for metric in METRICS:
        for region in (None, window):
            for floor in (0, 3):
                for budget in (40, 200, 1000, 10**9):
                    keys = options(metric=metric, max_vertices=budget)
                    try:
                        found = rows(db, "SELECT count(*), max(achieved_eps) FROM rqt_range(?, ?, NULL, ?)", region, floor, keys)[0]
                    except s.sqlite3.Error as error:
                        least = one(db, "SELECT count(*) FROM rqt_range(?, 9e999, NULL, ?)", region, options(metric=metric))
                        if "max_vertices" not in str(error) or least <= budget:
                            wrong.append((metric, region, budget, str(error)))
                        continue
                    count, eps = found
                    if eps is None:
                        if count or one(db, "SELECT count(*) FROM rqt_range(?, ?)", region, floor):
                            wrong.append((metric, region, floor, budget, "empty"))
                        continue
                    again = one(db, "SELECT count(*) FROM rqt_range(?, ?, NULL, ?)", region, eps, options(metric=metric))
                    before = one(db, "SELECT count(*) FROM rqt_range(?, ?, NULL, ?)", region, max(floor, eps * (1 - 2.0**-20)),
                                 options(metric=metric))
                    if count > budget or again != count or eps < floor or (eps > floor and before <= budget):
                        wrong.append((metric, region, floor, budget, count, eps, again, before))
    equal(name + ": a budget is kept, by the smallest eps that does", wrong[:3], [])
    budget = max(600, one(db, "SELECT count(*) FROM rqt_range(NULL, 9e999)") + 50)
    header = s.mesh_blob(one(db, "SELECT rqt_mesh(NULL, 0, 'indexed', NULL, ?)", options(max_vertices=budget)))[0]
    equal(name + ": the mesh header has the eps of the budget", header["eps"],
          one(db, "SELECT max(achieved_eps) FROM rqt_triangles(NULL, 0, NULL, ?)", options(max_vertices=budget)) or 0.0)
    seen = proof(db, 0, max_vertices=budget, metric="minimal")
    check(name + ": rqt_verify agrees with it", seen["vertices"] <= budget and seen["max_error"] <= max(seen["achieved_eps"], quantum_error),
          seen)
    explained = rows(db, "SELECT sum(bytes), min(why LIKE '%made in memory%'), min(achieved_eps) FROM rqt_explain(NULL, 5, NULL, ?)",
                     options(metric="euclid"))
    equal(name + ": rqt_explain reads nothing for what is in memory", explained, [(0, 1, 5.0)])
    db.close()

# ----------------------------------------------------------------------------------------------------- stored minimal
for name in ("hills", "lakes", "flat", "row", "SainteHelens.dem"):
    stored = s.temp(name + "_minimal.gpkg")
    source = s.temp(name + ".asc") if name in grids else os.path.join(s.DATA, name)
    s.import_terrain(stored, source, name="t", minimal=True, block=4 if name in grids and name != "flat" else 2)
    db, computed = s.connect(stored), s.connect(databases[name])
    wrong = []
    for eps in EPS:
        for columns in ("x, y, z, error, level", "col, row, q"):
            query = "SELECT %s FROM rqt_range(NULL, ?, NULL, ?)" % columns
            ours, theirs = (sorted(rows(d, query, eps, options(metric="minimal"))) for d in (db, computed))
            if ours != theirs:
                wrong.append((eps, len(ours), len(theirs)))
    equal(name + ": stored minimal errors give what computed ones give", wrong, [])
    read = rows(db, "SELECT why LIKE '%made in memory%', count(*) FROM rqt_explain(NULL, 5, NULL, ?) GROUP BY 1", options(metric="minimal"))
    check(name + ": nothing is made in memory", all(r[0] == 0 for r in read), read)
    equal(name + ": rqt_check finds nothing", rows(db, "SELECT * FROM rqt_check"), [])
    equal(name + ": both block tables are registered", rows(db, "SELECT table_name FROM gpkg_contents WHERE table_name LIKE 'rqt_block%' ORDER BY 1"),
          [("rqt_block_1",), ("rqt_block_1_minimal",)])
    db.close()
    computed.close()

path = s.temp("hills_minimal.gpkg")
damage = {
    "a block's bytes": "UPDATE rqt_block_1_minimal SET data = x'00' WHERE id = 1",
    "a block's bytes, those of another": "UPDATE rqt_block_1_minimal SET data = (SELECT data FROM rqt_block_1 b WHERE b.id = rqt_block_1_minimal.id)",
    "a summary": "UPDATE rqt_block_1_minimal SET summary = (SELECT summary FROM rqt_block_1_minimal WHERE id = 1) WHERE id = 5",
    "a missing block": "DELETE FROM rqt_block_1_minimal WHERE id = (SELECT max(id) FROM rqt_block_1_minimal)",
    "a block too many": "INSERT INTO rqt_block_1_minimal SELECT 9999, summary, data FROM rqt_block_1_minimal WHERE id = 1",
    "an index row": "UPDATE rqt_index_1_minimal SET exact0 = exact0 - 1 WHERE id = %d",
    "an index row too many": "INSERT INTO rqt_index_1_minimal VALUES(9999, 0, 1, 0, 1, 0, 1, 0, 1)",
}
for what, sql in damage.items():
    broken = s.temp("broken.gpkg")
    shutil.copy(path, broken)
    db = s.connect(broken)
    db.execute(sql.replace("%d", str(one(db, "SELECT max(id) FROM rqt_index_1_minimal"))))
    found = rows(db, "SELECT severity, message FROM rqt_check")
    check("rqt_check finds " + what, found and all(r[0] == "error" and "minimal errors" in r[1] for r in found), found[:2])
    db.close()
s.import_terrain(path, s.temp("hills.asc"), name="t", replace=True)
db = s.connect(path)
equal("--replace without --minimal takes the tables away", rows(db, "SELECT name FROM sqlite_schema WHERE name LIKE '%minimal%'"), [])
equal("... and out of the GeoPackage", rows(db, "SELECT table_name FROM gpkg_contents WHERE table_name LIKE '%minimal%'"), [])
equal("... and the metric works without them", one(db, "SELECT count(*) > 100 FROM rqt_range(NULL, 1, NULL, ?)", options(metric="minimal")), 1)

# ---------------------------------------------------------------------- too large a terrain is refused before anything is done
wide, nowhere = s.temp("wide.tif"), s.temp("wide.gpkg")
s.run(["gdal_create", "-outsize", "9000", "6000", "-bands", "1", "-co", "SPARSE_OK=TRUE", "-co", "TILED=YES", wide])
said, status = s.run([s.RQT, "import", "--memory", "4096", "--minimal", wide, nowhere])
check("rqt import --minimal says how much it would take, and leaves nothing", status != 0 and "minimal errors take" in said
      and "512 are allowed" in said and not os.path.exists(nowhere), said)

# ------------------------------------------------------------------- what is computed is forgotten when the database changes
before = triangles(db, None, 5, "t", options(metric="local"))
s.import_terrain(path, s.temp("square.asc"), name="t", replace=True)
after = triangles(db, None, 5, "t", options(metric="local"))
check("another connection's import is seen", before != after and len(after) > 0)
db.execute("BEGIN")
db.execute("DELETE FROM rqt_block_%d WHERE id = (SELECT max(id) FROM rqt_block_%d)" % ((one(db, "SELECT max(id) FROM rqt_terrain"),) * 2))
s.raises("a missing block is an error, not another mesh", "is missing", lambda: triangles(db, None, 5, "t", options(metric="wedgie")))
db.execute("ROLLBACK")
equal("rolled back: as before", triangles(db, None, 5, "t", options(metric="local")), after)
db.execute("ATTACH ? AS other", (databases["lakes"],))
lakes = s.connect(databases["lakes"])
for terrain, own in (("other.t", lakes), ("main.t", None), ("other.t", lakes)):
    equal("terrains take turns in memory: " + terrain, triangles(db, None, 5, terrain, options(metric="euclid")),
          triangles(own or db, None, 5, "t" if own else "t", options(metric="euclid")))
lakes.close()
db.close()
s.finish()
