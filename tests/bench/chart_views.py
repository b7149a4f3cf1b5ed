#!/usr/bin/python3
"""chart_views.py EXTENSION DATABASE... - views by every test of options.test, measured: CSV, then tables on standard output.

Of each database's terrain three cameras look (low flight, high, straight down), with each test at each tolerance. The true
error of a view is how far a sample of the terrain is from its place in the mesh, in pixels of the picture, the worst of all
that are drawn, by the verifier behind rqt_view_verify. Rows go to DATABASE's folder as views.csv, a row a camera, and as
views-TEST.dat for gnuplot, a line a tolerance: the three cameras together, their worst error, their triangles and times added.
Environment: TAUS (of `node`: eighths of them), TESTS, RUNS; BENCH_CPU: processor time, for a machine that others use, too.
"""
import json
import os
import sqlite3
import statistics
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "peers"))
from equal_error import pareto_front, value_at  # noqa: E402

TESTS = os.environ.get("TESTS", "guaranteed ulrich node sphere lindstrom lodmap").split()
TAUS = [float(t) for t in os.environ.get("TAUS", "0.5 1 2 4 8").split()]
now = time.process_time if os.environ.get("BENCH_CPU") else time.perf_counter
RUNS = int(os.environ.get("RUNS", "3"))
SCALE = {"node": 0.125}  # of the tolerances: its own are not pixels
PIXELS = [0.5, 1, 2, 4]
CAMERAS = [("low flight", 300, -5), ("high", 8000, -30), ("straight down", 20000, -90)]
PICTURE = {"fovy": 45, "width": 1280, "height": 800}


def open_database(path, extension):
    db = sqlite3.connect(f"file:{path}?mode=ro", uri=True)
    db.enable_load_extension(True)
    db.load_extension(extension)
    return db


def cameras_of(db):
    x, y = db.execute("SELECT x0 + 0.4 * width * dx, y0 + 0.7 * height * dy FROM rqt_terrains").fetchone()
    ground = db.execute("SELECT coalesce(rqt_height(?, ?), max_z) FROM rqt_terrains", (x, y)).fetchone()[0]
    for name, above, pitch in CAMERAS:
        yield name, {"eye": [x, y, ground + above], "yaw": 30, "pitch": pitch, **PICTURE}


def measure(db, camera, options):
    arguments = (json.dumps(camera), json.dumps(options))
    row = db.execute("SELECT vertices, triangles, max_pixels, rms_pixels, t_junctions, overlaps, guaranteed "
                     "FROM rqt_view_verify(?, NULL, ?)", arguments).fetchone()
    if row[4] or row[5]:
        sys.exit(f"chart_views: {options} with {camera}: {row[4]} T-junctions, {row[5]} overlaps")
    times = []
    for _ in range(RUNS + 1):
        begin = now()
        db.execute("SELECT rqt_view_mesh(?, 'strip', NULL, ?)", arguments).fetchone()
        times.append(now() - begin)
    return row[:4] + (row[6], 1e3 * statistics.median(times[1:]))


def measure_all(db, folder):
    """test -> [(tau, triangles, worst pixels, ms)] of the three cameras together."""
    together = {test: [] for test in TESTS}
    with open(os.path.join(folder, "views.csv"), "w") as file:
        print("test,tau,camera,vertices,triangles,max_pixels,rms_pixels,guaranteed,ms", file=file)
        for test in TESTS:
            for tau in (t * SCALE.get(test, 1) for t in TAUS):
                rows = []
                for name, camera in cameras_of(db):
                    rows.append(measure(db, {**camera, "tau": tau}, {"test": test}))
                    vertices, triangles, worst, rms, guaranteed, ms = rows[-1]
                    print(f"{test},{tau:g},{name},{vertices},{triangles},{worst:.6g},{rms:.6g},{guaranteed},{ms:.3f}",
                          file=file, flush=True)
                together[test].append((tau, sum(r[1] for r in rows), max(r[2] for r in rows), sum(r[5] for r in rows)))
            with open(os.path.join(folder, f"views-{test}.dat"), "w") as data:
                for line in together[test]:
                    print(*line, file=data)
    return together


def main():
    everything = {}
    for path in sys.argv[2:]:
        db = open_database(path, sys.argv[1])
        everything[os.path.basename(os.path.dirname(path))] = measure_all(db, os.path.dirname(path))
        db.close()
    others = [t for t in TESTS if t != "guaranteed"]
    print("Triangles of the guaranteed test over those of the others at equal true error, three cameras together:\n")
    print("| terrain | worst error, px | guaranteed, triangles | " + " | ".join("over " + o for o in others) + " |")
    print("|---|--:|--:|" + "--:|" * len(others))
    for name, together in everything.items():
        fronts = {test: pareto_front(sorted((r[1], r[2]) for r in rows)) for test, rows in together.items()}
        for pixels in PIXELS:
            ours = value_at(fronts["guaranteed"], pixels)
            if ours is None:
                continue
            theirs = [value_at(fronts[o], pixels) for o in others]
            print(f"| {name} | {pixels:g} | {ours:.0f} | " + " | ".join(f"{ours / t:.2f}" if t else "" for t in theirs) + " |")
    print("\nTrue worst error over the tolerance asked for, the worst of all tolerances:\n")
    print("| terrain | " + " | ".join(TESTS) + " |")
    print("|---|" + "--:|" * len(TESTS))
    for name, together in everything.items():
        print(f"| {name} | " + " | ".join(f"{max(r[2] / r[0] for r in together[t]):.2f}" for t in TESTS) + " |")


main()
