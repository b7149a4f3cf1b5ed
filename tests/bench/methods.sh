#!/usr/bin/env bash
# methods.sh [RASTER...] - the table of METHODS.md: for each raster and metric, at eps 1, 2, 5, 10, 20 m, the vertices and how
# far the mesh really is from the data, by rqt_verify; and how long each metric takes to compute.
#
# Needs the command and the extension (RQT, RQT_SO; default build/rqt and build/rqt.so) and a python3 whose sqlite3 loads
# extensions (PYTHON; default /usr/bin/python3). The databases go to a temporary directory.
set -euo pipefail
cd "$(dirname "$0")/../.."
BUILD=${BUILD:-build}
export RQT=${RQT:-$BUILD/rqt} RQT_SO=${RQT_SO:-$PWD/$BUILD/rqt.so}
PYTHON=${PYTHON:-/usr/bin/python3}
for needed in "$RQT" "$RQT_SO"; do
    [[ -e $needed ]] || { echo "methods: $needed is missing; run make first" >&2; exit 2; }
done
[[ $# -gt 0 ]] || set -- examples/N44W072.hgt.zip
export DIRECTORY
DIRECTORY=$(mktemp -d)
trap 'rm -rf "$DIRECTORY"' EXIT
for raster; do
    name=$(basename "${raster%%.*}")
    "$RQT" import --name t "$raster" "$DIRECTORY/$name.gpkg" >"$DIRECTORY/log" 2>&1 || { cat "$DIRECTORY/log" >&2; exit 1; }
done
"$PYTHON" - "$@" <<'PROGRAM'
import json
import os
import sqlite3
import sys
import time

METRICS = ["exact", "minimal", "local", "wedgie", "euclid", "plane"]
EPS = [1, 2, 5, 10, 20]
print("vertices, times those of `minimal`; true maximum error, times eps\n")
print("| raster | eps | " + " | ".join(METRICS) + " |")
print("|---|---:|" + "---:|" * len(METRICS))
times = {}
for raster in sys.argv[1:]:
    name = os.path.basename(raster).split(".")[0]
    db = sqlite3.connect(os.path.join(os.environ["DIRECTORY"], name + ".gpkg"))
    db.enable_load_extension(True)
    db.load_extension(os.environ["RQT_SO"])
    samples = db.execute("SELECT width * height FROM rqt_terrains").fetchone()[0]
    for eps in EPS:
        seen = {}
        for metric in METRICS:
            seen[metric] = db.execute("SELECT vertices, max_error FROM rqt_verify(NULL, ?, NULL, ?)",
                                      (eps, json.dumps({"metric": metric}))).fetchone()
        least = seen["minimal"][0]
        cells = ["%.3f; %.2f" % (v / least, e / eps) if m != "minimal" else "%d; %.2f" % (v, e / eps)
                 for m, (v, e) in seen.items()]
        print("| %s | %d | %s |" % (name, eps, " | ".join(cells)))
    db.close()
    # A fresh connection computes anew: the coarsest mesh costs nothing beside it.
    for metric in METRICS[1:]:
        best = 1e9
        for _ in range(3):
            db = sqlite3.connect(os.path.join(os.environ["DIRECTORY"], name + ".gpkg"))
            db.enable_load_extension(True)
            db.load_extension(os.environ["RQT_SO"])
            begin = time.time()
            db.execute("SELECT count(*) FROM rqt_range(NULL, 9e999, NULL, ?)", (json.dumps({"metric": metric}),)).fetchone()
            best = min(best, time.time() - begin)
            db.close()
        times[name, metric] = samples / best / 1e6
print("\nfirst query of a connection by a metric that is not stored (heights read, errors, pyramid), Msamples/s, best of 3\n")
print("| raster | " + " | ".join(METRICS[1:]) + " |")
print("|---|" + "---:|" * (len(METRICS) - 1))
for raster in sys.argv[1:]:
    name = os.path.basename(raster).split(".")[0]
    print("| %s | %s |" % (name, " | ".join("%.1f" % times[name, m] for m in METRICS[1:])))
PROGRAM
