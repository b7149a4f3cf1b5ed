#!/usr/bin/python3
"""verify_views.py RASTER... - `make verify-views DATA=dir`: the proof of views over whole rasters, as Markdown tables.

Each raster (tif, hgt.zip, dem, asc, or all of a directory) becomes a terrain of a temporary database. Of each: CAMERAS views (default
200) of every kind of tests/sql_views.py, every sample of the terrain projected by rqt_view_verify, and the worst displacement over
tau, a line a kind; then ordinary views by every test of options.test: triangles, displacement, and the time of rqt_view_mesh's strip.
A raster that import refuses is skipped. Exits with 1 when a guaranteed view breaks its promise.
  CAMERAS=200 RUNS=3 RQT_SEED=1   cameras a terrain, repetitions of a time, beginning of the random numbers
"""
import glob
import json
import math
import os
import statistics
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import sql_support as s  # noqa: E402
import sql_views as v  # noqa: E402

COUNT, RUNS, SEED = (int(os.environ.get(n, d)) for n, d in (("CAMERAS", "200"), ("RUNS", "3"), ("RQT_SEED", "1")))
TESTS = ("guaranteed", "ulrich", "node", "sphere", "lindstrom", "lodmap")
ORDINARY = (v.overlook, v.straight_down, v.along_a_line, v.far_outside)


def rasters(arguments):
    for given in arguments:
        if os.path.isdir(given):
            for ending in ("tif", "hgt.zip", "dem", "asc"):
                yield from sorted(glob.glob(os.path.join(given, "*." + ending)))
        else:
            yield given


def open_terrain(path):
    """None: import refuses it."""
    database = s.temp("views.gpkg")
    if os.path.exists(database):
        os.remove(database)
    try:
        s.import_terrain(database, path, name="t")
    except RuntimeError as error:
        print("%s is skipped: %s" % (os.path.basename(path), str(error).strip().splitlines()[-1]), file=sys.stderr)
        return None
    return v.Terrain(s.connect(database))


def milliseconds(db, camera, options):
    times = []
    for _ in range(RUNS + 1):  # the first one reads
        start = time.perf_counter()
        db.execute("SELECT rqt_view_mesh(?, 'strip', NULL, ?)", (camera, options)).fetchone()
        times.append(1e3 * (time.perf_counter() - start))
    return statistics.median(times[1:])


def kinds_of(t, broken):
    """kind -> (cameras, those that draw something, triangles, worst displacement over tau)."""
    table = {}
    for kind, camera in v.cameras(t, s.Dice(SEED), COUNT):
        seen = v.prove(t.db, camera)
        if v.faults(t, seen):
            broken.append("%s: %s of %s" % (kind, v.faults(t, seen), json.dumps(camera)))
        table.setdefault(kind, []).append((1, seen["drawn"] > 0, seen["triangles"], seen["ratio"]))
    return {kind: tuple(map(sum, list(zip(*found))[:3])) + (max(r[3] for r in found),) for kind, found in table.items()}


def tests_of(t):
    """test -> (triangles, worst displacement over tau, guaranteed, milliseconds of all), of the same ordinary views."""
    dice, cameras = s.Dice(SEED + 1), []
    for kind in ORDINARY:
        for _ in range(3):
            cameras.append(dict(kind(t, dice), fovy=45, width=1280, height=800, tau=1))
    table = {}
    for test in TESTS:
        found = []
        for camera in cameras:
            seen = v.prove(t.db, camera, {"test": test})
            found.append((seen["triangles"], seen["ratio"], seen["guaranteed"],
                          milliseconds(t.db, json.dumps(camera), json.dumps({"test": test}))))
        table[test] = (sum(f[0] for f in found), max(f[1] for f in found), found[0][2], statistics.median(f[3] for f in found))
    return table


def ratio_text(ratio):
    return "behind the eye" if math.isinf(ratio) else "%.4g" % ratio if ratio < 1000 else "%.0f" % ratio


def main():
    titles, kinds, tests, broken = [], [], [], []
    for path in rasters(sys.argv[1:] or [s.DATA]):
        t = open_terrain(path)
        if t is None:
            continue
        titles.append("%s, %d x %d" % (os.path.basename(path).split(".")[0], t.width, t.height))
        print("verify-views: " + titles[-1], file=sys.stderr)
        found = []
        kinds.append(kinds_of(t, found))
        broken += ["%s: %s" % (titles[-1], b) for b in found]
        tests.append(tests_of(t))
        t.db.close()
    if not titles:
        sys.exit("verify-views: nothing could be imported")
    print("The worst displacement over tau of %d cameras a terrain, and how many of them draw something:\n" % COUNT)
    print("| camera | %s |\n|---|%s" % (" | ".join(titles), "---:|" * len(titles)))
    for kind in v.KINDS:
        cells = ["%s (%d of %d)" % (ratio_text(k[3]), k[1], k[0]) for k in (table.get(kind.__name__, (0, 0, 0, 0)) for table in kinds)]
        print("| %s | %s |" % (kind.__name__.replace("_", " "), " | ".join(cells)))
    print("| all | %s |" % " | ".join("%s" % ratio_text(max(k[3] for k in table.values())) for table in kinds))
    print("\n%d ordinary views of each, 1280 x 800 pixels, tau 1, by every test of options.test:\n" % (3 * len(ORDINARY)))
    print("| terrain | test | triangles | worst displacement / tau | guaranteed | median ms |\n|---|---|---:|---:|---|---:|")
    for title, table in zip(titles, tests):
        for test in TESTS:
            triangles, ratio, guaranteed, ms = table[test]
            print("| %s | %s | %d | %s | %s | %.2f |" % (title, test, triangles, ratio_text(ratio), "yes" if guaranteed else "no", ms))
    for b in broken:
        print("BROKEN " + b, file=sys.stderr)
    sys.exit(1 if broken else 0)


main()
