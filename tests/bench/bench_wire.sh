#!/usr/bin/env bash
# bench_wire.sh DIRECTORY - the wire format on the DEMs of a directory: bytes a vertex, vertices decoded a second.
#
# Needs the command and the extension (RQT, RQT_SO; default build/rqt and build/rqt.so), gcc, libsqlite3 and libzstd.
set -euo pipefail
data=$(realpath "${1:?usage: bench_wire.sh DIRECTORY}")
cd "$(dirname "$0")/../.."
BUILD=${BUILD:-build}
RQT=${RQT:-$BUILD/rqt}
RQT_SO=${RQT_SO:-$PWD/$BUILD/rqt.so}
OUT=$BUILD/bench/wire
mkdir -p "$OUT"
gcc -std=gnu11 -O3 -Wall -Wextra -Wconversion -Wshadow -Werror -Isrc/core tests/bench/bench_wire.c "$BUILD/librqt.a" \
    -o "$OUT/bench_wire" -lsqlite3 -lzstd -lm
databases=()
for dem in S33W071.tif N44W072.hgt.zip N42E001.hgt.zip glarus_1arc.tif; do
    name=${dem%%.*}
    [[ -e $data/$dem ]] || continue
    "$RQT" import --replace --name "$name" "$data/$dem" "$OUT/$name.gpkg" >/dev/null 2>&1
    databases+=("$OUT/$name.gpkg")
done
"$OUT/bench_wire" "$RQT_SO" "${databases[@]}"
