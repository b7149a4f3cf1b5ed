#!/usr/bin/python3
"""F12, F17 and F18 of the catalogue of failures, where the promise is one of the SQL functions."""
import os

import sql_support as s
from sql_support import check, equal, one, rows

INFINITY = float("inf")
grid = s.rough_grid(45, 38, 12)
path = s.temp("hills.gpkg")
s.import_terrain(path, s.write_grid(s.temp("hills.asc"), grid), name="t", block=3)
db = s.connect(path)

# ------------------------------------------------------------------------------------------------- F12: odd values of eps
CALLS = ["SELECT count(*) FROM rqt_range(NULL, {})", "SELECT count(*) FROM rqt_triangles(NULL, {})",
         "SELECT count(*) FROM rqt_strip(NULL, {})", "SELECT count(*) FROM rqt_explain(NULL, {})",
         "SELECT max_error FROM rqt_verify(NULL, {})", "SELECT length(rqt_mesh(NULL, {}, 'indexed'))",
         "SELECT length(rqt_mesh(NULL, {}, 'rqt'))", "SELECT rqt_height(3, -4, {})", "SELECT length(rqt_delta(NULL, {}, 0))",
         "SELECT length(rqt_delta(NULL, 9e999, {}))"]
wrong = []
for call in CALLS:
    name = call[call.index("rqt_"):].split("(")[0]
    for value, why in (("'nan'", "a number"), ("9e999 - 9e999", "a number"), ("-1", "0 or more"), ("-1e-300", "0 or more"), ("-9e999", "0 or more")):
        try:
            wrong.append((call, value, rows(db, call.format(value))))
        except s.sqlite3.Error as error:
            if name + "(): eps" not in str(error) or (why not in str(error) and name != "rqt_delta"):
                wrong.append((call, value, str(error)))
equal("F12_nan_and_negative_eps_are_refused_by_name", wrong, [])
relief = max(map(max, grid)) - min(map(min, grid))
wrong = []
for call in CALLS[:-2]:
    seen = [rows(db, call.format(value)) for value in ("9e999", "1e308", "1e12", repr(2.0 * relief))]
    if seen[1:] != seen[:-1]:
        wrong.append((call, seen))
equal("F12_eps_above_the_range_is_infinite_eps", wrong, [])
names = "samples, triangles, vertices, max_error, t_junctions, overlaps, uncovered, area"
samples, count, vertices, worst, *faults, area = rows(db, "SELECT %s FROM rqt_verify(NULL, 9e999)" % names)[0]
equal("F12_infinite_eps_is_the_corners", (samples, count, vertices, faults, area), (45 * 38, 2, 4, [0, 0, 0], 44.0 * 37))
check("F12_infinite_eps_errs_no_more_than_the_range", 0 < worst <= relief, (worst, relief))
equal("F12_eps_minus_zero_is_eps_0", s.triangles(db, None, -0.0), s.triangles(db, None, 0.0))
db.close()

# ----------------------------------------------------------------------------- F17: a block that is not there is no hole
db = s.connect(path)
whole = {eps: s.triangles(db, None, eps) for eps in (0, 10, 60)}
blocks = [row[0] for row in rows(db, "SELECT id FROM rqt_block_1")]
needed, wrong = 0, []
for block in blocks:
    for broken in ("DELETE FROM rqt_index_1 WHERE id = %d" % block, "DELETE FROM rqt_block_1 WHERE id = %d" % block,
                   "UPDATE rqt_block_1 SET data = x'' WHERE id = %d" % block):
        db.execute("SAVEPOINT s")
        db.execute(broken)
        for eps, mesh in whole.items():
            try:
                if s.triangles(db, None, eps) != mesh:
                    wrong.append((broken, eps))
            except s.sqlite3.Error as error:
                needed += 1
                if "t is damaged" not in str(error):
                    wrong.append((broken, eps, str(error)))
        db.execute("ROLLBACK TO s")
        db.execute("RELEASE s")
equal("F17_a_missing_block_is_an_error_and_never_a_hole", wrong, [])
check("F17_missing_blocks_were_needed", needed > len(blocks), (needed, len(blocks)))
db.close()

# ------------------------------------------------------------- F18: samples in no triangle keep their full-resolution height
islands = [[None] * 21 for _ in range(19)]
for col, row in ((0, 0), (20, 18), (8, 8), (13, 5)):
    islands[row][col] = 100 + col
for col in range(21):
    islands[12][col] = 7 * col % 31
path = s.temp("islands.gpkg")
s.import_terrain(path, s.write_grid(s.temp("islands.asc"), islands), name="t", block=2)
db = s.connect(path)
known = [(i, j) for j in range(19) for i in range(21) if islands[j][i] is not None]
equal("F18_islands_and_strips_have_no_triangle",
      [one(db, "SELECT count(*) FROM rqt_triangles(NULL, ?)", eps) for eps in (0, 5, INFINITY)], [0, 0, 0])
# write_grid puts the first sample at 0,0 and rows southward
equal("F18_islands_and_strips_have_heights", [one(db, "SELECT rqt_height(?, ?)", i, -j) for i, j in known],
      [float(islands[j][i]) for i, j in known])
equal("F18_voids_have_none", [one(db, "SELECT rqt_height(?, ?)", i, -j) for i, j in ((1, 0), (9, 8), (8, 9), (0, 11))], [None] * 4)
db.close()
s.finish()
