#!/usr/bin/python3
"""Beside a database's own life: attached files, transactions, VACUUM, close, interrupts, other connections, re-imports."""
import os
import shutil
import sqlite3
import threading
import time

import sql_support as s
from sql_support import check, equal, one, rows, triangles

hill_grid, lake_grid = s.rough_grid(70, 60, 31), s.rough_grid(40, 40, 32, 50)
hill = s.write_grid(s.temp("hill.asc"), hill_grid)
lake = s.write_grid(s.temp("lake.asc"), lake_grid)
first, second = s.temp("first.gpkg"), s.temp("second.gpkg")
s.import_terrain(first, hill)
s.import_terrain(second, lake)
COUNT = "SELECT count(*) FROM rqt_range(NULL, 2)"

# --------------------------------------------------------------------------------------------------- attached files
db = s.connect(first)
alone = triangles(db, None, 2)
db.execute("ATTACH ? AS other", (second,))
equal("rqt_terrains shows the attached database's terrains", rows(db, "SELECT schema, name FROM rqt_terrains ORDER BY 1"),
      [("main", "hill"), ("other", "lake")])
s.raises("with two terrains and none named, the sentence lists both", "lake", lambda: rows(db, COUNT))
s.raises("... the other too", "hill", lambda: rows(db, COUNT))
equal("schema.name names one", triangles(db, None, 2, "main.hill"), alone)
equal("a name alone finds it where it is", triangles(db, None, 2, "hill"), alone)
d2 = s.connect(second)
equal("an attached terrain's mesh is that of its own database", triangles(db, None, 2, "other.lake"), triangles(d2, None, 2))
equal("so are its heights", one(db, "SELECT rqt_height(5.5, -7.25, 0, 'other.lake')"), one(d2, "SELECT rqt_height(5.5, -7.25, 0)"))
d2.close()
s.raises("a schema that is not there", "nowhere.lake", lambda: triangles(db, None, 2, "nowhere.lake"))
s.raises("a terrain of another schema", "main.lake", lambda: triangles(db, None, 2, "main.lake"))
third = s.temp("third.gpkg")
shutil.copy(first, third)
d3 = s.connect(third)
d3.execute("UPDATE rqt_terrain SET height_offset = 7")
d3.close()
db.execute("ATTACH ? AS \"a b\"", (third,))
equal("one name in two schemas is main's, as SQLite has it for tables", triangles(db, None, 2, "hill"), alone)
equal("a schema with a blank in its name", [t[0][2] for t in triangles(db, None, 2, "a b.hill")], [t[0][2] + 7 for t in alone])
db.execute("DETACH \"a b\"")
equal("detached: it is gone", triangles(db, None, 2, "hill"), alone)
db.execute("DETACH other")
equal("the only one again", triangles(db, None, 2), alone)
db.close()
db = s.connect()
equal("a database in memory without terrains has none", rows(db, "SELECT * FROM rqt_terrains"), [])
db.execute("ATTACH ? AS t", (first,))
equal("an attached one is enough", triangles(db, None, 2), alone)
db.close()

# ------------------------------------------------------------------------------------- transactions and stale caches
path = s.temp("changing.gpkg")
shutil.copy(first, path)
db = s.connect(path)
before = triangles(db, None, 2)
db.execute("BEGIN")
db.execute("UPDATE rqt_terrain SET height_offset = height_offset + 1000")
inside = triangles(db, None, 2)
equal("a change is seen inside its transaction", [p[2] for t in inside for p in t], [p[2] + 1000 for t in before for p in t])
db.execute("ROLLBACK")
equal("rolled back: the terrain is as it was", triangles(db, None, 2), before)
db.execute("BEGIN")
db.execute("UPDATE rqt_block_1 SET data = x'00'")
s.raises("blocks that a transaction has broken are an error inside it", "rqt_triangles(): ", lambda: triangles(db, None, 0))
db.execute("ROLLBACK")
equal("rolled back: no stale block", triangles(db, None, 2), before)
db.execute("SAVEPOINT one")
db.execute("DELETE FROM rqt_terrain")
s.raises("a deleted terrain is unknown", "rqt_range(): ", lambda: rows(db, COUNT))
db.execute("ROLLBACK TO one")
equal("back to the savepoint: there again", triangles(db, None, 2), before)
db.execute("RELEASE one")
db.execute("BEGIN")
db.execute("UPDATE rqt_block_1 SET data = substr(data, 1, length(data) - 1)")
db.execute("COMMIT")
s.raises("a committed change is not hidden by the cache", "rqt_triangles(): ", lambda: triangles(db, None, 0))
db.close()

shutil.copy(first, path)
reader = s.connect(path)
equal("a reader of another connection", triangles(reader, None, 2), before)
s.import_terrain(path, lake, name="hill", replace=True)
d2 = s.connect(second)
equal("sees the terrain that replaced it", triangles(reader, None, 2), triangles(d2, None, 2))
d2.close()
equal("the replaced terrain is sound", rows(reader, "SELECT * FROM rqt_check"), [])
reader.close()
said, status = s.run([s.RQT, "import", "--name", "hill", lake, path])
check("an existing terrain is not replaced unasked", status != 0 and "hill" in said, said)
s.import_terrain(path, hill, name="hill", replace=True)
db = s.connect(path)
equal("replaced back, the mesh is the old one", triangles(db, None, 2), before)
equal("and no table is left over", one(db, "SELECT count(*) FROM sqlite_schema WHERE name LIKE 'rqt_block_%' AND type = 'table'"), 1)
db.close()

# ------------------------------------------------------------------------------------------------ VACUUM, close, DDL
db = s.connect(path)
open_cursor = db.execute("SELECT * FROM rqt_triangles(NULL, 0)")
open_cursor.fetchone()
s.raises("F53 VACUUM while a query runs is SQLite's own refusal", "SQL statements in progress", lambda: db.execute("VACUUM"))
open_cursor.close()
rows(db, COUNT), one(db, "SELECT rqt_height(3, -3)"), one(db, "SELECT length(rqt_mesh(NULL, 1, 'ply'))")
db.execute("VACUUM")
equal("F53 VACUUM after use, and the same mesh after it", triangles(db, None, 2), before)
db.execute("CREATE TABLE notes(x)")
db.execute("DROP TABLE notes")
equal("the schema may change between queries", triangles(db, None, 2), before)
equal("PRAGMA journal_mode can change after use", rows(db, "PRAGMA journal_mode = WAL"), [("wal",)])
equal("and back", rows(db, "PRAGMA journal_mode = DELETE"), [("delete",)])
db.execute("DELETE FROM rqt_terrain")
number = one(db, "SELECT max(substr(name, 11)) FROM sqlite_schema WHERE name GLOB 'rqt_block_*'")
db.execute("DROP TABLE rqt_block_" + number)
db.execute("DROP TABLE rqt_index_" + number)
equal("a terrain's tables can be dropped after use", rows(db, "SELECT * FROM rqt_terrains"), [])
db.close()

# Closing: SQLite refuses while a statement lives, and Python then keeps the file open. It must be closed, and free.
def open_files(name):
    folder = "/proc/self/fd"
    return [f for f in os.listdir(folder) if os.path.exists(os.path.join(folder, f)) and os.path.realpath(os.path.join(folder, f)) == os.path.realpath(name)]


if os.path.isdir("/proc/self/fd"):
    for title, use in (("a table", lambda d: rows(d, COUNT)), ("a scalar", lambda d: one(d, "SELECT rqt_height(3, -3)")),
                       ("a mesh", lambda d: one(d, "SELECT rqt_mesh(NULL, 2, 'strip')")),
                       ("an error", lambda d: None),
                       ("an unfinished query", lambda d: d.execute("SELECT * FROM rqt_strip(NULL, 0)").fetchone()),
                       ("rqt_check", lambda d: rows(d, "SELECT * FROM rqt_check")), ("nothing", lambda d: None)):
        db = s.connect(first)
        use(db)
        if title == "an error":
            try:
                rows(db, "SELECT * FROM rqt_range('nonsense', 1)")
            except sqlite3.Error:
                pass
        db.close()
        equal("F53 the connection closes after use of %s, and lets go of the file" % title, open_files(first), [])

# ------------------------------------------------------------------------------------------- readers and a writer; WAL
shutil.copy(first, path)
db, writer = s.connect(path), s.connect(path)
db.execute("PRAGMA journal_mode = WAL")
db.execute("BEGIN")
equal("a reader's snapshot", triangles(db, None, 2), before)
writer.execute("UPDATE rqt_terrain SET height_offset = height_offset + 5")
equal("F51 a snapshot stays what it was while another connection commits", triangles(db, None, 2), before)
db.execute("COMMIT")
equal("and is new in the next transaction", [t[0][2] for t in triangles(db, None, 2)], [t[0][2] + 5 for t in before])
db.close()
writer.close()
readonly = sqlite3.connect("file:%s?mode=ro" % first, uri=True)
readonly.enable_load_extension(True)
readonly.load_extension(s.RQT_SO)
equal("a file opened read-only is read", triangles(readonly, None, 2), before)
readonly.execute("PRAGMA query_only = ON")
equal("and with query_only", one(readonly, "SELECT max_error <= 2 FROM rqt_verify(NULL, 2)"), 1)
readonly.close()

# ------------------------------------------------------------------------------------------------ interrupt of a query
large = s.temp("large.gpkg")
s.import_terrain(large, s.write_large(s.temp("large.img"), 1025, 7), name="large")
# Cold, blocks are read by statements, which SQLite stops itself; warm, only the walk over them can notice.
db = s.connect(large)
WARM = "SELECT length(rqt_mesh(NULL, 0, 'indexed'))"
one(db, WARM)
begun = time.monotonic()
one(db, WARM)
whole, early, seen = time.monotonic() - begun, False, []
for attempt in range(20):
    timer = threading.Timer(whole * (0.3 - 0.012 * attempt), db.interrupt)
    begun = time.monotonic()
    timer.start()
    try:
        one(db, WARM)
        seen.append("it finished")
    except sqlite3.OperationalError as error:
        seen.append(str(error))
    took = time.monotonic() - begun
    timer.join()
    early = "interrupted" in seen[-1] and took < whole * 0.7
    seen[-1] += " in %.3f s of %.3f s" % (took, whole)
    if early:
        break
check("F54 a query whose blocks are all cached can be interrupted, and then stops early", early, seen)
db.close()

for title, sql in (("rqt_triangles", "SELECT * FROM rqt_triangles(NULL, 0)"), ("rqt_verify", "SELECT * FROM rqt_verify(NULL, 0)"),
                   ("rqt_mesh", "SELECT length(rqt_mesh(NULL, 0, 'strip'))")):
    db = s.connect(large)
    begun = time.monotonic()
    whole = len(rows(db, "SELECT count(*) FROM (%s)" % sql)) and time.monotonic() - begun
    db.close()
    seen, answers, early = [], [], False
    for attempt in range(8):  # cold each time; early in the work, then earlier still
        db = s.connect(large)
        timer = threading.Timer(whole / 4 / 1.5 ** attempt, db.interrupt)
        begun = time.monotonic()
        timer.start()
        try:
            rows(db, "SELECT count(*) FROM (%s)" % sql)
            seen.append("it finished")
        except sqlite3.OperationalError as error:
            seen.append(str(error))
        took = time.monotonic() - begun
        timer.cancel()
        timer.join()
        stopped = seen[-1] == "interrupted" or seen[-1].endswith(": interrupted")
        early = early or (stopped and took < whole * 0.9)
        answers.append(one(db, "SELECT count(*) FROM rqt_triangles(NULL, 9e999)"))
        db.close()
        if early:
            break
    check("F54 %s can be interrupted, and then stops early" % title, early, seen)
    equal("F54 %s: the same connection answers the next query" % title, answers, [2] * len(answers))

for name in (first, second, path, large):
    db = s.connect(name)
    equal("%s is sound at the end" % os.path.basename(name), rows(db, "PRAGMA quick_check"), [("ok",)])
    db.close()
s.finish()
