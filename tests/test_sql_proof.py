#!/usr/bin/python3
"""The bound, on every terrain of tests/data: rqt_verify's proof, the area that it must have, heights, and what is read."""
import math
import os

import sql_support as s
from sql_support import check, equal, one, rows

INFINITY = float("inf")
EPS = [0, 0.5, 1, 2, 5, 10, 20, 50, 100, INFINITY]


def halves(i, j):
    """The two halves of cell (i,j), each as its three corners: the diagonal turns with the parity of the cell."""
    if (i + j) % 2 == 0:
        return ((i, j), (i, j + 1), (i + 1, j + 1)), ((i, j), (i + 1, j + 1), (i + 1, j))
    return ((i, j), (i, j + 1), (i + 1, j)), ((i + 1, j), (i, j + 1), (i + 1, j + 1))


def count_halves(grid):
    """Unit half cells with three valid corners."""
    count = 0
    for j in range(len(grid) - 1):
        upper, lower = grid[j], grid[j + 1]
        if None not in upper and None not in lower:
            count += 2 * (len(upper) - 1)
            continue
        for i in range(len(upper) - 1):
            for half in halves(i, j):
                count += all(grid[y][x] is not None for x, y in half)
    return count


def plane_height(grid, col, row):
    """The height on the half cell that holds a place given in samples, or None."""
    i, j = min(int(col), len(grid[0]) - 2), min(int(row), len(grid) - 2)
    u, v = col - i, row - j
    nw, ne, sw, se = grid[j][i], grid[j][i + 1], grid[j + 1][i], grid[j + 1][i + 1]
    if (i + j) % 2 == 0:
        corners = (nw, sw, se) if v > u else (nw, se, ne)
        if None in corners:
            return None
        return nw + (se - sw) * u + (sw - nw) * v if v > u else nw + (ne - nw) * u + (se - ne) * v
    corners = (nw, sw, ne) if u + v < 1 else (ne, sw, se)
    if None in corners:
        return None
    return nw + (ne - nw) * u + (sw - nw) * v if u + v < 1 else se + (sw - se) * (1 - u) + (ne - se) * (1 - v)


def prove(title, db, grid):
    t = dict(zip(("x0", "y0", "dx", "dy", "quantum_error", "width", "height", "voids", "min_z", "max_z"), rows(
        db, "SELECT x0, y0, dx, dy, quantum_error, width, height, voids, min_z, max_z FROM rqt_terrains")[0]))
    equal(title + ": the terrain has the raster's size and voids", (t["width"], t["height"], t["voids"]),
          (len(grid[0]), len(grid), sum(row.count(None) for row in grid)))
    known = [z for row in grid for z in row if z is not None]
    check(title + ": the least and the greatest height are the raster's", abs(t["min_z"] - min(known)) <= t["quantum_error"]
          and abs(t["max_z"] - max(known)) <= t["quantum_error"], (t["min_z"], t["max_z"], min(known), max(known)))
    area = count_halves(grid) * abs(t["dx"] * t["dy"]) / 2
    bad, areas, last = [], [], INFINITY
    for eps in EPS:
        seen = dict(zip(("samples", "vertices", "triangles", "max_error", "rms_error", "t", "o", "u", "area", "void_touched"), rows(
            db, "SELECT samples, vertices, triangles, max_error, rms_error, t_junctions, overlaps, uncovered, area, void_touched"
                " FROM rqt_verify(NULL, ?)", eps)[0]))
        if (seen["t"], seen["o"], seen["u"], seen["void_touched"]) != (0, 0, 0, 0) or not seen["max_error"] <= max(eps, t["quantum_error"]):
            bad.append((eps, seen))
        if not seen["rms_error"] <= seen["max_error"] or seen["vertices"] > last:
            bad.append((eps, seen))
        last = seen["vertices"]
        if not math.isclose(seen["area"], area, rel_tol=1e-12):
            areas.append((eps, seen["area"], area))
    equal(title + ": within eps, no T-junction, no overlap, nothing uncovered, no void touched, at ten eps", bad, [])
    equal(title + ": covers exactly the unit half cells with three valid corners, at ten eps", areas, [])
    equal(title + ": rqt_check finds nothing", rows(db, "SELECT * FROM rqt_check"), [])

    # heights: at samples, and at random places off the edges of half cells
    dice, wrong, voids = s.Dice(77), [], 0
    tolerance = t["quantum_error"] + 1e-6 * max(map(abs, known))
    for n in range(300):
        col = dice.below(t["width"] - 1) + (dice.below(98) + 1.3) / 100
        row = dice.below(t["height"] - 1) + (dice.below(98) + 1.7) / 101
        if n >= 250:  # beside voids or the border, where the outline runs
            j = dice.below(t["height"] - 1)
            col, row = [(i + 0.3, j + 0.6) for i in range(t["width"] - 1) if i in (0, t["width"] - 2) or (grid[j][i] is None) != (grid[j][i + 1] is None)][0]
        expected = plane_height(grid, col, row)
        seen = one(db, "SELECT rqt_height(?, ?)", t["x0"] + col * t["dx"], t["y0"] + row * t["dy"])
        voids += expected is None
        if (seen is None) != (expected is None) or (seen is not None and abs(seen - expected) > tolerance):
            wrong.append((col, row, seen, expected))
    equal(title + ": rqt_height is the plane of the half cell at 300 places", wrong[:3], [])
    wrong = []
    for eps in (0, 1, 10, 100):
        for _ in range(40):
            i, j = dice.below(t["width"]), dice.below(t["height"])
            seen = one(db, "SELECT rqt_height(?, ?, ?)", t["x0"] + i * t["dx"], t["y0"] + j * t["dy"], eps)
            if grid[j][i] is not None and seen is not None and abs(seen - grid[j][i]) > max(eps, t["quantum_error"]) + 1e-9 * abs(seen):
                wrong.append((eps, i, j, seen, grid[j][i]))
            if grid[j][i] is None and seen is not None:
                wrong.append((eps, i, j, seen, None))
    equal(title + ": rqt_height at samples is within eps of them, NULL over void", wrong[:3], [])
    x1, y1 = t["x0"] + (t["width"] - 1) * t["dx"], t["y0"] + (t["height"] - 1) * t["dy"]
    around = abs((t["width"] - 1) * t["dx"]) >= 360 and one(db, "SELECT srid FROM rqt_terrains") == 4326  # then no longitude is outside
    outside = [(t["x0"], t["y0"] - t["dy"])] * 2 if around else [(t["x0"] - t["dx"] / 100, t["y0"]), (x1 + t["dx"] / 100, y1)]
    outside += [(t["x0"], t["y0"] - t["dy"] / 100), (x1, y1 + t["dy"] / 100)]
    equal(title + ": rqt_height is NULL outside", [one(db, "SELECT rqt_height(?, ?)", *p) for p in outside], [None] * 4)
    return voids


in_voids = 0
for name in sorted(os.listdir(s.DATA)):
    if name.endswith((".md", ".xml")):
        continue
    path = s.temp("proof.gpkg")
    s.import_terrain(path, os.path.join(s.DATA, name), name="t", replace=os.path.exists(path))
    source = os.path.join(s.DATA, name)
    db = s.connect(path)
    in_voids += prove(name, db, s.read_raster(source))
    db.close()
check("some of the places were in voids", in_voids > 20, in_voids)

# ------------------------------------------------------------------------------- a float raster, and its quantum_error
path = s.temp("alpine.gpkg")
s.import_terrain(path, os.path.join(s.DATA, "glarus_alpine_25m_161.tif"), name="alpine")
db = s.connect(path)
quantum, error = rows(db, "SELECT quantum, quantum_error FROM rqt_terrains")[0]
check("rounded heights say by how much: half a quantum", error == quantum / 2 and error > 0, (quantum, error))
db.close()

# ---------------------------------------------------------------------------- a large terrain: no more than is needed
large = s.temp("large.gpkg")
s.import_terrain(large, s.write_large(s.temp("large.img"), 2049, 5), name="large")
db = s.connect(large)
equal("large: the whole has the bound at eps 20", rows(
    db, "SELECT max_error <= 20, max_error > 10, t_junctions, overlaps, uncovered, area FROM rqt_verify(NULL, 20)"), [(1, 1, 0, 0, 0, 2048.0 * 2048)])
db.close()

db = s.connect(large)
x0, y0, total = rows(db, "SELECT x0, y0, blocks FROM rqt_terrains")[0]
shares, kinds = [], {}
for i, (col, row) in enumerate([(300, 300), (1000, 1000), (1023, 1023), (1700, 120), (1843, 1843), (0, 0), (37, 1500), (960, 640)]):
    box = "rqt_bbox(%r, %r, %r, %r)" % (x0 + col, y0 - row - 204.8, x0 + col + 204.8, y0 - row)
    read = rows(db, "SELECT level, extent, why, bytes, cached, selected, block FROM rqt_explain(%s, 20)" % box)
    shares.append(len([r for r in read if r[3]]) / total)
    again = rows(db, "SELECT bytes, cached, block FROM rqt_explain(%s, 20)" % box)
    stored = dict(rows(db, "SELECT id, length(data) FROM rqt_block_1"))
    for r in read:
        kinds.setdefault("answers", []).append(r[6] in stored)
        if r[3]:
            kinds.setdefault("length", []).append(stored.get(r[6]) == r[3])
        kinds.setdefault("cached", []).append(r[4])
        kinds.setdefault("selected", []).append(r[5] >= 0 and (r[5] > 4 or not r[3]))
        kinds.setdefault("level", []).append(4 ** r[0] <= r[6] < 2 * 4 ** r[0])
        kinds.setdefault("why", []).append(("bytes are walked" in r[2]) == (r[3] > 0))
    kinds.setdefault("again", []).append([(r[3], r[6]) for r in read] == [(r[0], r[2]) for r in again] and
                                         all(r[1] == 1 for r in again if r[0]))
    kinds.setdefault("order", []).append(len(set(r[6] for r in read)) == len(read))
    kinds.setdefault("first", []).append(i > 0 or all(r[4] == 0 for r in read))
check("a window of 1 %% of a large terrain reads under 5 %% of its blocks at eps 20", 0 < max(shares) < 0.05, [round(x, 4) for x in shares])
check("rqt_explain's blocks are stored", all(kinds["answers"]))
check("with the lengths that it tells", all(kinds["length"]) and len(kinds["length"]) > 8)
check("none is cached before it is read", all(kinds["first"]))
check("all are cached the second time", all(kinds["again"]))
check("no block twice, each of the level that it tells", all(kinds["order"]) and all(kinds["level"]))
check("a block whose bytes are read has something selected", all(kinds["selected"]))
check("why says whether bytes were read", all(kinds["why"]))
few = rows(db, "SELECT count(*), sum(bytes) FROM rqt_explain(NULL, 9e999)")
equal("at infinite eps the root's index row is enough", few, [(1, 0)])
# every place has one answering block: the extents tile the raster
extents = rows(db, "SELECT extent FROM rqt_explain(NULL, 20)")
area = 0.0
for (extent,) in extents:
    points = [tuple(float(v) for v in p.split()) for p in extent[9:-2].split(",")]
    area += (max(p[0] for p in points) - min(p[0] for p in points)) * (max(p[1] for p in points) - min(p[1] for p in points))
equal("the extents of the answering blocks add up to the raster", area, 2048.0 * 2048)
check("the extent is a region itself", one(db, "SELECT count(*) FROM (SELECT extent FROM rqt_explain(NULL, 20) LIMIT 1) e, rqt_range(e.extent, 20)") > 0)
equal("large: the database is sound", rows(db, "PRAGMA quick_check"), [("ok",)])
db.close()
s.finish()
