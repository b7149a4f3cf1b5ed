#!/usr/bin/env bash
# bench_data.sh DIRECTORY - `make bench-data DATA=dir`: real DEMs, sizes beside GDAL's COG and the wire format.
#
# For every int16 raster of a million samples or more: the COG (ZSTD, predictor 2, overviews) and the database with exact
# errors of all levels; then what their blocks weigh part by part, and the wire format's bytes and speed.
#   BLOCK=K   block size of the databases, when it is not to be the default
set -euo pipefail
data=$(realpath "${1:?usage: bench_data.sh DIRECTORY}")
cd "$(dirname "$0")/../.."
BUILD=${BUILD:-build}
RQT=${RQT:-$BUILD/rqt}
OUT=$BUILD/bench/data
mkdir -p "$OUT"
rasters=()
printf '%-24s %12s %12s %12s %8s\n' raster samples "COG bytes" "database" "of COG"
total_cog=0 total_database=0
for file in "$data"/*.tif "$data"/*.hgt.zip; do
    [[ -e $file ]] || continue
    info=$(gdalinfo "$file" 2>/dev/null) || continue
    grep -q 'Type=Int16' <<<"$info" || continue
    read -r width height < <(sed -n 's/^Size is \([0-9]*\), \([0-9]*\)$/\1 \2/p' <<<"$info")
    ((width * height >= 1000000)) || continue
    name=$(basename "$file")
    name=${name%%.*}
    gdal_translate -q -of COG -co COMPRESS=ZSTD -co PREDICTOR=2 -co OVERVIEWS=AUTO "$file" "$OUT/$name.tif"
    rm -f "$OUT/$name.gpkg" "$OUT/$name.tif.aux.xml"
    "$RQT" import ${BLOCK:+--block "$BLOCK"} --name "$name" "$file" "$OUT/$name.gpkg" >/dev/null 2>&1
    cog=$(stat -c %s "$OUT/$name.tif") database=$(stat -c %s "$OUT/$name.gpkg")
    printf '%-24s %12d %12d %12d %8s\n' "$name" $((width * height)) "$cog" "$database" \
        "$(awk "BEGIN { printf \"%.2f\", $database / $cog }")"
    total_cog=$((total_cog + cog)) total_database=$((total_database + database))
    rasters+=("$file")
done
((${#rasters[@]})) || { echo "bench_data: no int16 raster of a million samples in $data" >&2; exit 2; }
printf '%-24s %12s %12d %12d %8s  (aim: at most 1.0)\n' sum "" "$total_cog" "$total_database" \
    "$(awk "BEGIN { printf \"%.2f\", $total_database / $total_cog }")"
echo
# shellcheck disable=SC2046
gcc -std=gnu11 -O3 -ffp-contract=off -Isrc/core $(gdal-config --cflags) tests/bench/bench_codec.c "$BUILD/librqt.a" \
    $(gdal-config --libs) -lzstd -lm -o "$OUT/bench_codec"
"$OUT/bench_codec" -k 5,8 "${rasters[@]}"
echo
tests/bench/bench_wire.sh "$data"
