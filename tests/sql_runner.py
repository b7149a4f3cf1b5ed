#!/usr/bin/python3
"""sql_runner.py SCRIPT... - runs SQL scripts through rqt.so in Python's sqlite3 and compares.

After a statement stand the rows it gives, or a part of the sentence it fails with; a statement with nothing after it gives
no row:
    SELECT 1, 'a', NULL, 2.5, x'00ff';
    --> 1|a|NULL|2.5|x'00ff'
    SELECT * FROM rqt_range(NULL, -1);
    --! rqt_range(): eps must be
Reals are written with the shortest digits that read back equal; * stands for any value. Before the statements:
    --# database NAME    a fresh copy of this database (DATABASES below) for what follows

Every script runs several times: the answers do not depend on the block size, nor on trusted_schema. But for the scripts of the demo's
terrain, "demo", which is large: sql/ and sql/recipes/. Those run once more in the sqlite3 shell, as people run them.
"""
import os
import shutil
import sqlite3
import sys

import sql_support as s

# A pyramid of 5 x 5 with a summit of 8 m: at eps 1 its mesh is the four faces.
TENT = [[8 - 4 * max(abs(i - 2), abs(j - 2)) for i in range(5)] for j in range(5)]
# Flat but for one spike, and one void corner.
SPIKE = [[0 if (i, j) != (3, 2) else 10 for i in range(9)] for j in range(7)]
SPIKE[6][8] = None
RAMP = [[i + j for i in range(9)] for j in range(9)]

DATABASES = {
    "tent": [("tent", TENT, {}, None)],
    "spike": [("spike", SPIKE, {"cell": 10, "x0": 1000, "y0": 2000}, None)],
    "two": [("ramp", RAMP, {}, None), ("tent", TENT, {}, None)],
    "degrees": [("degrees", TENT, {"x0": 10, "y0": 46, "cell": 0.5}, s.WGS84)],
    "none": [],
}

SETTINGS = [("blocks as imported", {}, ""), ("blocks of 3^2, trusted_schema off", {"block": 1}, "PRAGMA trusted_schema = OFF"),
            ("blocks of 5^2, WAL", {"block": 2}, "PRAGMA journal_mode = WAL")]


def make(name, options):
    if name == "demo":
        path = s.temp("demo.gpkg")
        if not os.path.exists(path):
            s.import_terrain(path, s.DEMO, name="white_mountains")
        return path
    path = s.temp("%s_%s.gpkg" % (name, options.get("block", "default")))
    if not os.path.exists(path):
        for terrain, grid, place, crs in DATABASES[name]:
            s.import_terrain(path, s.write_grid(s.temp(terrain + ".asc"), grid, crs=crs, **place), name=terrain, **options)
            for left in (".asc", ".prj"):
                if os.path.exists(s.temp(terrain + left)):
                    os.remove(s.temp(terrain + left))
        if not DATABASES[name]:
            sqlite3.connect(path).execute("CREATE TABLE other(x)")
    return path


def shown(value):
    if value is None:
        return "NULL"
    if isinstance(value, bytes):
        return "x'%s'" % value.hex()
    return repr(value) if isinstance(value, float) else str(value)


def statements(path):
    """(line, what, text, expected): what is 'database', 'rows' or 'error'."""
    found, text, first = [], "", 0
    with open(path) as script:
        for number, line in enumerate(script, 1):
            if line.startswith("--# database "):
                found.append([number, "database", line.split()[2], []])
            elif line.startswith("--> ") or line.startswith("--! "):
                if text.strip():
                    raise SyntaxError("%s:%d: the statement above has no end" % (path, number))
                found[-1][3].append(line[4:].rstrip("\n"))
                if line.startswith("--! "):
                    found[-1][1] = "error"
            elif text or (line.strip() and not line.startswith("--")):
                first = first if text else number
                text += line
                if sqlite3.complete_statement(text):
                    found.append([first, "rows", text.strip(), []])
                    text = ""
    if text:
        raise SyntaxError("%s:%d: a statement without an end" % (path, first))
    return found


def is_as_expected(seen, expected):
    """Row by row; a * in a row stands for any value."""
    return len(seen) == len(expected) and all(
        a == b or ("*" in b.split("|") and len(a.split("|")) == len(b.split("|")) and all(q in (p, "*") for p, q in zip(a.split("|"), b.split("|"))))
        for a, b in zip(seen, expected))


def run_in_shell(path):
    """The whole script, as people run it: every row that it gives."""
    copy = s.temp("shell.gpkg")
    shutil.copy(make("demo", {}), copy)
    with open(path) as script:
        said, status = s.run(["sqlite3", "-batch", "-bail", copy, "-cmd", ".load " + s.RQT_SO], text=script.read())
    rows = [row for _, what, _, expected in statements(path) if what == "rows" for row in expected]
    s.check("%s in the sqlite3 shell" % os.path.basename(path), status == 0 and is_as_expected(said.splitlines(), rows), said[:400])


def run_one(db, what, text, expected):
    """None when it is as expected, else what was seen."""
    try:
        seen = ["|".join(shown(v) for v in row) for row in db.execute(text)]
        if what == "rows" and is_as_expected(seen, expected):
            return None
        return "gives %.400r" % (seen,)
    except (sqlite3.Error, sqlite3.Warning) as error:
        if what == "error" and expected[0] in str(error):
            return None
        return "fails: %s" % error


def run_script(path, title, options, pragma):
    db, name = None, os.path.basename(path)
    count = 0
    for line, what, text, expected in statements(path):
        if what == "database":
            if db:
                db.close()
            copy = s.temp("copy.gpkg")
            for end in ("", "-wal", "-shm"):
                if os.path.exists(copy + end):
                    os.remove(copy + end)
            shutil.copy(make(text, options), copy)
            db = s.connect(copy)
            db.execute(pragma).fetchall()
            continue
        seen = run_one(db, what, text, expected)
        count += 1
        if seen is not None:
            s.check("%s:%d (%s)" % (name, line, title), False,
                    "%s\n    %s\n    instead of %.400r" % (text, seen, expected))
        else:
            s.passed += 1
    s.equal("%s (%s): %d statements, and the file is sound" % (name, title, count), s.rows(db, "PRAGMA quick_check"), [("ok",)])
    db.close()


for script in sys.argv[1:]:
    demo = any(what == "database" and name == "demo" for _, what, name, _ in statements(script))
    for setting in SETTINGS[:1] if demo else SETTINGS:
        run_script(script, *setting)
    if demo:
        run_in_shell(script)
s.finish()
