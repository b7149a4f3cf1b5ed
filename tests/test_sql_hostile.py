#!/usr/bin/python3
"""Databases edited by somebody who means harm, and hosts that do unusual things: a sentence or the right answer, never a crash, and
never the host's own work lost. Each attack runs in a process of its own, so that a crash is seen as one."""
import os
import shutil
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
    check("%s: no crash, nothing failed" % name.replace("_", " "), done.returncode == 0, done.stdout[-600:])
s.finish()
