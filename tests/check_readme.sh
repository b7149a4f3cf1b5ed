#!/bin/bash
# check_readme.sh - the README tells the truth: its session is what the demo prints today (only times may differ), its
# picture is the demo's, and every sh, sql and python block of it runs.
set -u
BUILD=${BUILD:-build}
times='s/[0-9.]* s (reading.*Msamples\/s/TIMES/'
blocks() { awk -v kind="$1" '$0 == "```" kind { on = 1; next } /^```/ { if (on) print ""; on = 0 } on' README.md; }
wanted=$(blocks text | sed "$times")
got=$(./examples/demo.sh 2>&1 | sed -n '/^# A DEM/,/^white_mountains: sound/p' | sed "$times")
if [ "$wanted" != "$got" ]; then
    diff <(echo "$wanted") <(echo "$got")
    echo "README.md shows another session than the demo prints"
    exit 1
fi
echo "the session in README.md is what the demo prints"
cmp examples/mount-washington.png "$BUILD/demo/mount-washington.png" || exit 1
echo "so is its picture"

rm -f build/terrain.gpkg build/pyrenees.gpkg build/mesh.gpkg
rm -rf build/www
run() { # kind, command that reads it
    local kind=$1
    shift
    if ! blocks "$kind" | "$@" >"$BUILD/readme.log" 2>&1; then
        cat "$BUILD/readme.log"
        echo "the $kind blocks of README.md do not run"
        exit 1
    fi
    echo "its $kind blocks run"
}
run sh bash -eu
run sql sqlite3 -bail build/terrain.gpkg -cmd '.load build/rqt.so'
run python /usr/bin/python3
