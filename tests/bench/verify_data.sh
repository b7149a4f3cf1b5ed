#!/usr/bin/env bash
# verify_data.sh - `make verify-data DATA=dir`: every raster of a directory, imported, and its promises proven.
#
# Each raster (tif, hgt.zip, dem, asc) becomes a terrain of a temporary database. For every eps: rqt_verify's true error
# is within eps (or the quantum error, where that is more); no T-junction, no overlap, nothing bare that the outline
# promises, no void touched; the covered area is that of eps 0; and strip, indexed, rqt_triangles and rqt_range hold the
# same mesh, counter-clockwise. A raster that import refuses is skipped, and its sentence shown.
#   DATA=dir        or the directories and files as arguments; default tests/data
#   EPS="0 1 5"     default 0 0.5 1 2 5 10 20 50 100
#   RQT, RQT_SO     default build/rqt, build/rqt.so
set -euo pipefail
cd "$(dirname "$0")/../.."
BUILD=${BUILD:-build}
RQT=${RQT:-$BUILD/rqt}
RQT_SO=${RQT_SO:-$BUILD/rqt.so}
read -ra eps <<<"${EPS:-0 0.5 1 2 5 10 20 50 100}"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

for needed in "$RQT" "$RQT_SO"; do
    [[ -e $needed ]] || { echo "verify-data: $needed is missing; run make first" >&2; exit 2; }
done
tool=$BUILD/bench/verify_data
mkdir -p "$BUILD/bench"
[[ $tool -nt tests/bench/verify_data.c ]] ||
    gcc -std=gnu11 -O3 -ffp-contract=off -Wall -Wextra -Wconversion -Wshadow -Werror tests/bench/verify_data.c -o "$tool" \
        -lsqlite3 -lm

(($# > 0)) || set -- "${DATA:-tests/data}"
shopt -s nullglob nocaseglob
files=()
for given in "$@"; do
    if [[ -d $given ]]; then
        files+=("$given"/*.tif "$given"/*.hgt.zip "$given"/*.dem "$given"/*.asc)
    else
        files+=("$given")
    fi
done
((${#files[@]} > 0)) || { echo "verify-data: no raster in $*" >&2; exit 2; }

passed=0 failed=0 skipped=0
for file in "${files[@]}"; do
    basename "$file"
    rm -f "$work"/t.gpkg*
    if ! "$RQT" import --name t "$file" "$work/t.gpkg" >"$work/log.txt" 2>&1; then
        skipped=$((skipped + 1))
        echo "  skipped, import refuses it: $(tail -n 1 "$work/log.txt")"
        continue
    fi
    status=0
    "$tool" "$work/t.gpkg" "$RQT_SO" "${eps[@]}" >"$work/out.txt" || status=$?
    if read -r p f < <(tail -n 1 "$work/out.txt") && [[ $p$f =~ ^[0-9]+$ ]]; then
        head -n -1 "$work/out.txt"
    else # it did not come to its last line
        cat "$work/out.txt"
        echo "  FAILED: it ended with status $status"
        p=0 f=1
    fi
    passed=$((passed + p)) failed=$((failed + f))
done
((skipped == 0)) || echo "$skipped skipped"
((passed > 0 || failed > 0)) || { echo "verify-data: nothing could be imported" >&2; exit 1; }
echo "$passed passed, $failed failed"
((failed == 0))
