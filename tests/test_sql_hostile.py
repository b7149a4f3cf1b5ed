#!/usr/bin/python3
"""Databases edited by somebody who means harm, and hosts that do unusual things: a sentence or the right answer, never a crash, and
never the host's own work lost. Each attack runs in a process of its own, so that a crash is seen as one."""
import os
import shutil
import sqlite3
import subprocess
import sys

import sql_support as s
from sql_support import check, equal, one, rows

ATTACK = sys.argv[1] if len(sys.argv) > 1 else None
hill = s.temp("hill.asc")
database = s.temp("hill.gpkg")


def fresh(name, *statements):
    path = s.temp(name + ".gpkg")
    shutil.copy(database, path)
    db = s.connect(path, load=False)
    for statement in statements:
        db.execute(statement)
    db.close()
    return path


INDEX_VIEW = ("CREATE TABLE idx AS SELECT * FROM rqt_index_1", "DROP TABLE rqt_index_1",
              "CREATE VIEW rqt_index_1 AS SELECT id, x0, x1, y0, y1, tol0, tol1, exact0, "
              "exact1 + 0 * ifnull(rqt_height(8.5, -8.5, 0), 0) AS exact1 FROM idx")
BLOCK_VIEW = ("ALTER TABLE rqt_block_1 RENAME TO blk",
              "CREATE VIEW rqt_block_1 AS SELECT id, summary, CASE WHEN rqt_height(0, 0, 0, 'nosuch') THEN data END AS data FROM blk")


def view_that_calls_back(path, begin=False):
    db = s.connect(path)
    if begin:
        db.execute("BEGIN IMMEDIATE")
    s.raises("a view that calls rqt is refused", "already at work", lambda: rows(db, "SELECT count(*) FROM rqt_range(NULL, 0)"))


def attack_index_view():
    view_that_calls_back(fresh("index_view", *INDEX_VIEW))


def attack_block_view():
    view_that_calls_back(fresh("block_view", *BLOCK_VIEW))


def attack_block_view_in_a_transaction():
    view_that_calls_back(fresh("block_view_too", *BLOCK_VIEW), begin=True)


def attack_shadowed_pragma():
    db = s.connect(fresh("pragma", "CREATE TABLE pragma_database_list(seq, name)"))
    equal("a table named like a pragma hides no terrain", one(db, "SELECT count(*) FROM rqt_terrains"), 1)


def attack_one_bad_row():
    columns = [c[1] for c in rows(s.connect(database), "PRAGMA table_info(rqt_terrain)") if c[1] != "id"]
    copied = ", ".join("'other'" if c == "name" else "99" if c == "format" else c for c in columns)
    db = s.connect(fresh("bad_row", "INSERT INTO rqt_terrain(%s) SELECT %s FROM rqt_terrain" % (", ".join(columns), copied)))
    check("a row that cannot be read keeps nobody from the others", one(db, "SELECT count(*) FROM rqt_range(NULL, 5, 'hill')") > 3)
    s.raises("it is named when it is asked for", "format 99", lambda: rows(db, "SELECT * FROM rqt_range(NULL, 5, 'other')"))
    equal("it is listed", rows(db, "SELECT name, width FROM rqt_terrains WHERE name = 'other'"), [("other", None)])
    check("the check says why", "format 99" in one(db, "SELECT message FROM rqt_check('other')"))


def attack_foreign_table():
    db = s.connect(database)
    db.execute("ATTACH ':memory:' AS x")
    db.execute("CREATE TABLE x.rqt_terrain(id, title)")
    check("another program's table of that name is not ours", one(db, "SELECT count(*) FROM rqt_range(NULL, 5)") > 3)


def attack_overlapping_index():
    """One block twice and its neighbour never: the areas add up, the places do not."""
    path = fresh("overlap", "CREATE TABLE idx AS SELECT * FROM rqt_index_1", "DROP TABLE rqt_index_1",
                 "ALTER TABLE idx RENAME TO rqt_index_1",
                 "UPDATE rqt_index_1 SET id = 1024, x0 = (SELECT x0 FROM rqt_index_1 WHERE id = 1024), "
                 "x1 = (SELECT x1 FROM rqt_index_1 WHERE id = 1024) WHERE id = 1025")
    db = s.connect(path)
    s.raises("blocks over one another", "damaged", lambda: rows(db, "SELECT count(*) FROM rqt_range(NULL, 0)"))


def attack_transaction():
    db = s.connect(fresh("transaction", "CREATE TABLE mine(x)"))
    db.execute("BEGIN")
    db.execute("INSERT INTO mine VALUES(1)")
    db.execute("DELETE FROM rqt_block_1 WHERE id = 1030")
    s.raises("a damaged terrain is an error", "damaged", lambda: rows(db, "SELECT count(*) FROM rqt_range(NULL, 0)"))
    db.execute("INSERT INTO mine VALUES(2)")
    db.execute("COMMIT")
    equal("but the host's transaction goes on", one(db, "SELECT sum(x) FROM mine"), 3)


def attack_loaded_twice():
    db = s.connect(database)
    before = one(db, "SELECT rqt_height(10, -10)")
    db.load_extension(s.RQT_SO)
    equal("the extension may be loaded twice", one(db, "SELECT rqt_height(10, -10)"), before)
    check("tables too", one(db, "SELECT count(*) FROM rqt_range(NULL, 5)") > 3)
    db.close()


def attack_detach_and_attach():
    raised = fresh("raised", "UPDATE rqt_terrain SET z0 = z0 + 1000")
    db = s.connect()
    heights = []
    for path in (database, raised, database, raised):
        db.execute("ATTACH ? AS x", (path,))
        heights.append(one(db, "SELECT rqt_height(10, -10)"))
        db.execute("DETACH x")
    equal("another file under the same name is another terrain", heights[1] - heights[0], 1000)
    equal("and back again", heights, heights[:2] * 2)


# ------------------------------------------------------------------------------------- schemas of an enemy, trusted or not
QUESTIONS = ("SELECT * FROM rqt_triangles(NULL, 3)", "SELECT * FROM rqt_range('LINESTRING(3 -3, 60 -40)', 0)",
             "SELECT rqt_height(8.5, -8.5), rqt_height(8.5, -8.5, 4)", "SELECT max_error, area FROM rqt_verify(NULL, 2)",
             "SELECT rqt_mesh(NULL, 4, 'rqt')", "SELECT rqt_delta(NULL, 9, 3)", "SELECT level, bytes FROM rqt_explain(NULL, 5)",
             "SELECT * FROM rqt_range(NULL, 1, NULL, '{\"metric\":\"wedgie\"}')", "SELECT * FROM rqt_check", "SELECT name, width, blocks FROM rqt_terrains")
BLOCKS = "CREATE TABLE blk AS SELECT * FROM rqt_block_1; DROP TABLE rqt_block_1; "
INDEX = "CREATE TABLE idx AS SELECT * FROM rqt_index_1; DROP TABLE rqt_index_1; "
TERRAIN = "CREATE TABLE ter AS SELECT * FROM rqt_terrain; DROP TABLE rqt_terrain; "
COLUMNS = "id, x0, x1, y0, y1, tol0, tol1, exact0, exact1"
# What is done, and what the answers are: "right" all of them, "error" none of the first (which needs all blocks), or "either".
SCHEMAS = {
    "a view for the blocks": (BLOCKS + "CREATE VIEW rqt_block_1 AS SELECT * FROM blk", "right"),
    "a table without a key for the index": (INDEX + "ALTER TABLE idx RENAME TO rqt_index_1", "right"),
    "an R-tree of floats for the index": (INDEX + "CREATE VIRTUAL TABLE rqt_index_1 USING rtree(%s); INSERT INTO rqt_index_1 SELECT * FROM idx"
                                          % COLUMNS, "right"),
    "a view for the terrains": (TERRAIN + "CREATE VIEW rqt_terrain AS SELECT * FROM ter", "either"),
    "generated columns": (BLOCKS + "CREATE TABLE rqt_block_1(id INTEGER PRIMARY KEY, s, d, summary GENERATED ALWAYS AS (s), data GENERATED ALWAYS "
                          "AS (CASE WHEN id % 2 THEN d ELSE zeroblob(9) END)); INSERT INTO rqt_block_1(id, s, d) SELECT * FROM blk", "error"),
    "a view in a circle": ("DROP TABLE rqt_block_1; CREATE VIEW rqt_block_1 AS SELECT id, summary, data FROM rqt_block_1", "error"),
    "two views in a circle": ("DROP TABLE rqt_block_1; CREATE VIEW a AS SELECT * FROM rqt_block_1; CREATE VIEW rqt_block_1 AS SELECT * FROM a", "error"),
    "a view on a table that is gone": (BLOCKS + "CREATE VIEW rqt_block_1 AS SELECT * FROM blk; DROP TABLE blk", "error"),
    "rows twice": (BLOCKS + "CREATE VIEW rqt_block_1 AS SELECT * FROM blk UNION ALL SELECT * FROM blk", "either"),
    "an index that knows everything": (INDEX + "CREATE VIEW rqt_index_1 AS SELECT id, 0 AS x0, 89 AS x1, 0 AS y0, 69 AS y1, 0 AS tol0, 65535 AS tol1, "
                                       "0 AS exact0, 65535 AS exact1 FROM idx", "either"),
    "an index of text": (INDEX + "CREATE TABLE rqt_index_1(%s); INSERT INTO rqt_index_1 SELECT id, 'a', 'b', 'c', 'd', 'e', 'f', 'g', 'h' FROM idx"
                         % COLUMNS, "error"),
    "an index of infinities": (INDEX + "CREATE TABLE rqt_index_1(%s); INSERT INTO rqt_index_1 SELECT id, -9e999, 9e999, -9e999, 9e999, -9e999, 9e999, "
                               "-9e999, 9e999 FROM idx" % COLUMNS, "either"),
    "numbers of blocks that are text": (BLOCKS + "CREATE TABLE rqt_block_1(id TEXT, summary, data); INSERT INTO rqt_block_1 SELECT * FROM blk", "either"),
    "triggers": ("CREATE TRIGGER t1 AFTER UPDATE ON rqt_terrain BEGIN DELETE FROM rqt_block_1; END; "
                 "CREATE TRIGGER t2 AFTER INSERT ON rqt_block_1 BEGIN DELETE FROM rqt_terrain; END", "right"),
    "a full-text table for the blocks": ("DROP TABLE rqt_block_1; CREATE VIRTUAL TABLE rqt_block_1 USING fts5(id, summary, data)", "error"),
    "cells that are no numbers": ("UPDATE rqt_terrain SET dx = 'wide', cell = x'00'", "error"),
    "a size beyond all": ("UPDATE rqt_terrain SET width = 9223372036854775807, height = 9e999", "error"),
    "a CRS of a megabyte": ("UPDATE rqt_terrain SET crs = printf('%.*c', 1000000, 'x')", "right"),
}


def answers(db):
    """Of each question: its rows, or the sentence of its error."""
    found = []
    for sql in QUESTIONS:
        try:
            found.append(rows(db, sql))
        except sqlite3.Error as error:
            found.append(str(error))
    return found


def attack_schemas():
    right = answers(s.connect(database))
    equal("F55 the questions have answers", [a for a in right if isinstance(a, str)], [])
    for n, (what, (script, expected)) in enumerate(sorted(SCHEMAS.items())):
        path = fresh("schema%d" % n)
        db = s.connect(path, load=False)
        db.executescript(script)
        db.close()
        with open(path, "rb") as f:
            bytes_before = f.read()
        for trusted in (0, 1):
            db = s.connect(path)
            db.execute("PRAGMA trusted_schema = %d" % trusted)
            seen = answers(db)
            name = "F55 %s, trusted_schema %d" % (what, trusted)
            about_itself = 2  # rqt_check and rqt_terrains say what is stored
            wrong = [(q, str(a)[:200]) for q, a, r in zip(QUESTIONS, seen[:-about_itself], right) if a != r and not (isinstance(a, str) and len(a) > 10)]
            equal(name + ": each answer is right or a sentence", wrong, [])
            if expected == "right":
                equal(name + ": all are right", [a for a in seen[:-about_itself] if isinstance(a, str)], [])
            if expected == "error":
                check(name + ": the mesh is refused", isinstance(seen[0], str), seen[0])
            equal(name + ": nothing has changed", db.total_changes, 0)
            db.close()
        with open(path, "rb") as f:
            equal("F55 %s: not a byte of the file has changed" % what, f.read() == bytes_before, True)


def attack_function_in_a_view():
    """A function of the host's, which the host calls dangerous in a schema that it does not trust."""
    path = fresh("harm", "ALTER TABLE rqt_block_1 RENAME TO blk")
    db = s.connect(path, load=False)
    db.create_function("harm", 1, lambda data: data)
    db.execute("CREATE VIEW rqt_block_1 AS SELECT id, summary, harm(data) AS data FROM blk")
    db.close()
    right = answers(s.connect(database))
    for trusted in (0, 1):
        called = []
        db = s.connect(path)
        db.create_function("harm", 1, lambda data: called.append(1) or data)
        db.execute("PRAGMA trusted_schema = %d" % trusted)
        seen = answers(db)
        if trusted:
            check("F55 trusted, the view's function is called", len(called) > 0)
            equal("F55 and the answer is right", seen[0], right[0])
        else:
            equal("F55 untrusted, the view's function is not called", called, [])
            check("F55 and the sentence says so", "unsafe use of harm()" in seen[0], seen[0])
        db.close()


def attack_endless_view():
    path = fresh("endless", "DROP TABLE rqt_block_1", "CREATE VIEW rqt_block_1 AS WITH RECURSIVE r(n) AS (SELECT 1 UNION ALL SELECT n FROM r) "
                 "SELECT n AS id, zeroblob(80) AS summary, zeroblob(80) AS data FROM r WHERE n < 0")
    db = s.connect(path)
    calls = [0]

    def patience():
        calls[0] += 1
        return calls[0] > 50

    for sql in QUESTIONS[:-1]:
        calls[0] = 0
        db.set_progress_handler(patience, 1000)
        try:
            rows(db, sql)
            ended = "no error"
        except sqlite3.Error as error:
            ended = str(error)
        check("F55 a view without end can be interrupted: " + sql[:40], "interrupted" in ended or "damaged" in ended, ended)
    db.set_progress_handler(None, 0)
    equal("F55 the connection goes on", one(db, "SELECT 1"), 1)
    db.close()


def attack_views_on_us():
    path = fresh("views", "PRAGMA writable_schema = 0")
    db = s.connect(path)
    db.execute("CREATE VIEW mesh AS SELECT * FROM rqt_triangles(NULL, 3)")
    db.execute("CREATE VIEW top AS SELECT rqt_height(8.5, -8.5) AS z, rqt_bbox(1, -3, 3, -1) AS box")
    db.execute("PRAGMA trusted_schema = 0")
    equal("F55 views on rqt's functions work untrusted", len(rows(db, "SELECT * FROM mesh")), len(rows(db, QUESTIONS[0])))
    equal("F55 scalars too", one(db, "SELECT z FROM top"), one(db, "SELECT rqt_height(8.5, -8.5)"))
    db.close()


ATTACKS = {name[7:]: value for name, value in list(globals().items()) if name.startswith("attack_")}

s.import_terrain(database, s.write_grid(hill, s.rough_grid(90, 70, 33)), block=2, name="hill")
if ATTACK:
    ATTACKS[ATTACK]()
    s.finish()
for name in sorted(ATTACKS):
    done = subprocess.run([sys.executable, os.path.abspath(__file__), name], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          universal_newlines=True, timeout=120)
    for line in done.stdout.splitlines():
        if line.startswith(("ok ", "FAILED", "    ")):
            print("%s: %s" % (name, line) if not line.startswith(("ok ", "FAILED")) else line)
    check("F55 %s: no crash, nothing failed" % name.replace("_", " "), done.returncode == 0, done.stdout[-600:])
s.finish()
