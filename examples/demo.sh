#!/bin/bash
# demo.sh - what rqt does, on a real DEM: the one-degree SRTM tile of Mount Washington (New Hampshire), 1201 x 1201 samples.
#
# Shows each command before it runs. Everything it makes is in build/demo.
set -eu
cd "$(dirname "$0")/.."
build=${BUILD:-build}
out=$build/demo
rm -rf "$out"
mkdir -p "$out"
PATH=$PWD/$build:$PATH

bold= plain=
if [ -t 1 ]; then bold=$(printf '\033[1m') plain=$(printf '\033[0m'); fi
say() { printf '\n%s# %s%s\n' "$bold" "$1" "$plain"; }
run() { printf '%s$ %s%s\n' "$bold" "$*" "$plain"; "$@"; }
sql() { # one statement in the sqlite3 shell, with the extension loaded
    printf '%ssqlite> %s%s\n' "$bold" "$1" "$plain"
    sqlite3 "$out/white-mountains.gpkg" -cmd ".load $build/rqt.so" -cmd '.mode column' "$1"
}

say 'A DEM into a database (a GeoPackage)'
run rqt import --name white_mountains examples/N44W072.hgt.zip "$out/white-mountains.gpkg"

say 'The terrain'
sql 'SELECT name, srid, width, height, min_z, max_z, voids, blocks, bytes FROM rqt_terrains;'

say 'Vertices of one region, 5 km around the summit, for five tolerances; 13 354 samples lie under its mesh at 5 m'
circle='rqt_circle(-71.3033, 44.2705, 5000)'
sql "SELECT e.value AS eps, count(*) AS vertices FROM json_each('[1,2,5,10,20]') e, rqt_range($circle, e.value) GROUP BY 1;"

say 'The proof: every triangle rasterised over every sample, by code that knows nothing of how the mesh was made'
sql "SELECT e.value AS eps, v.samples, v.triangles, v.max_error, round(v.rms_error, 3) AS rms, v.t_junctions AS cracks, v.overlaps, v.uncovered FROM json_each('[1,2,5,10,20]') e, rqt_verify($circle, e.value) v;"

say 'What the query read: blocks by level'
sql "SELECT level, count(*) AS blocks, sum(bytes) AS bytes, sum(selected) AS selected FROM rqt_explain($circle, 5) GROUP BY level;"

say 'One triangle strip, ready for a graphics card'
sql "SELECT count(*) AS indices, (SELECT count(*) FROM rqt_triangles($circle, 20)) AS triangles FROM rqt_strip($circle, 20);"
sql "SELECT seq, x, y, z FROM rqt_strip($circle, 20) LIMIT 4;"

say 'Heights: the summit, full resolution and on the 20 m mesh'
sql 'SELECT round(rqt_height(-71.3033, 44.2705), 2) AS full, round(rqt_height(-71.3033, 44.2705, 20), 2) AS mesh_20_m;'

say 'Mesh files'
box='-71.40,44.20,-71.20,44.34'
run rqt mesh "$out/white-mountains.gpkg" --eps 10 --region "$box" -o "$out/mount-washington.ply"
run rqt mesh "$out/white-mountains.gpkg" --eps 10 --region "$box" -o "$out/mount-washington.gpkg"

say 'Pictures: shaded relief, the mesh over it, three tolerances side by side'
run rqt mesh "$out/white-mountains.gpkg" --eps 10,40,160 --region "$box" -o "$out/mount-washington.png"
run rqt mesh "$out/white-mountains.gpkg" --eps 10,40,160 --region "$box" -o "$out/mount-washington.svg"

say 'Is the database sound?'
run rqt check "$out/white-mountains.gpkg"

echo
ls -l "$out" | awk 'NR > 1 { printf "%10d  %s\n", $5, "'"$out"'/" $9 }'
cat <<END

Look at $out/mount-washington.png. Then ask the database yourself:
  sqlite3 $out/white-mountains.gpkg -cmd '.load $build/rqt.so'
  sqlite> SELECT * FROM rqt_help;
Or see it in a browser, at http://127.0.0.1:8080/ after this, until Ctrl-C (make serve-demo is short for it):
  $build/rqt serve $out/white-mountains.gpkg
END
