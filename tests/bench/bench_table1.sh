#!/usr/bin/env bash
# bench_table1.sh - `make bench-table1`: how many of the vertices a tolerance keeps, beside the table of the paper.
#
# Pajarola, "Large scale terrain visualization using the restricted quadtree triangulation" (1998), table 1: grids of
# 161 x 161 samples of 25 m, hilly and alpine. Here: the samples of that size in tests/data, and in the directory DATA if
# it is given. Ours are exact errors over all samples, kept where error > eps; the paper's are local errors, kept where
# error >= eps, so that at eps 0 it keeps all by definition.
#   DATA=dir        more 161 x 161 rasters, *_161.tif
#   RQT, RQT_SO     default build/rqt, build/rqt.so
set -euo pipefail
cd "$(dirname "$0")/../.."
BUILD=${BUILD:-build}
RQT=${RQT:-$BUILD/rqt}
RQT_SO=${RQT_SO:-$BUILD/rqt.so}
EPS=(0 1 2 5 10)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

for needed in "$RQT" "$RQT_SO"; do
    [[ -e $needed ]] || { echo "bench-table1: $needed is missing; run make first" >&2; exit 2; }
done
shopt -s nullglob
files=(tests/data/*_161.tif)
[[ -z ${DATA:-} ]] || files+=("$DATA"/*_161.tif)
((${#files[@]} > 0)) || { echo "bench-table1: no *_161.tif in tests/data; give a directory: DATA=dir" >&2; exit 2; }

row() { # NAME SAMPLES TRUE-ERRORS SHARES...
    local name=$1 from=$2 share
    shift 2
    printf '  %-28s %-18s' "$name" "$from"
    for share in "$@"; do printf ' %6s' "$share"; done
    echo
}

echo "Vertices kept, per cent of the samples:"
row "eps, metres" "" "${EPS[@]}"
row "paper: hilly" "161 x 161, 25 m" 100 76 45 18 7
row "paper: alpine" "161 x 161, 25 m" 100 87 66 40 25
declare -A seen
for file in "${files[@]}"; do
    name=$(basename "$file" .tif)
    [[ -z ${seen[$name]:-} ]] || continue
    seen[$name]=1
    rm -f "$work/t.gpkg"
    "$RQT" import --name t "$file" "$work/t.gpkg" >"$work/log.txt" 2>&1 || { cat "$work/log.txt" >&2; exit 1; }
    list=$(IFS=,; echo "${EPS[*]}")
    mapfile -t lines < <(sqlite3 -bail -noheader -separator '|' "$work/t.gpkg" ".load ${RQT_SO%.so}" "
        SELECT width || ' x ' || height || ', ' || CASE WHEN cell_x < 0.1 THEN round(cell_x * 3600, 2) || '\"'
               ELSE printf('%g', cell_x) || ' m' END FROM rqt_terrains;
        SELECT printf('%.1f', 100.0 * (SELECT count(*) FROM rqt_range(NULL, e.value)) / (width * height))
        FROM rqt_terrains, json_each('[$list]') e ORDER BY e.key;")
    ((${#lines[@]} == ${#EPS[@]} + 1)) || { echo "bench-table1: $file: no answer" >&2; exit 1; }
    row "$name" "${lines[0]}" "${lines[@]:1}"
done
