#!/usr/bin/env bash
# chart.sh - `make chart`: speed against accuracy, drawn. All of it in build/chart.
#
# Charts 1 to 4 of three real DEMs (of the project; DATA=dir: of the six with the largest crops in there), with peers where
# they can be had (peers.sh), and the table of vertices at equal true error. Charts 5 and 6 of two generated families: one
# terrain under more and more white noise, and crops of one terrain that grow around the same window.
#   CHART_K=13      the largest terrain of the family of sizes has 2^K + 1 samples a side
#   NOISE="0 ..."   amplitudes in metres
#   DOCS=dir        copy the pictures there, as NAME-CHART.png (examples/charts, for examples/CHARTS.md)
set -euo pipefail
cd "$(dirname "$0")/../.."
BUILD=${BUILD:-build}
RQT=${RQT:-$BUILD/rqt}
OUT=$BUILD/chart
K=${CHART_K:-13}
SMALLEST_K=10
NOISE=${NOISE:-0 0.5 1 1.5 2 2.5 3 3.5 4 5 6 8}
mkdir -p "$OUT/families"
[[ -e $RQT ]] || { echo "chart: $RQT is missing; run make first" >&2; exit 2; }

if [[ -n ${DATA:-} ]]; then
    OUT=$OUT DATA=$DATA tests/bench/peers.sh
else
    OUT=$OUT tests/bench/peers.sh examples/N44W072.hgt.zip tests/data/N41E001.hgt.zip tests/data/SainteHelens.dem
fi

families=$OUT/families/families.gpkg
work=$(mktemp -d "$OUT/families/work-XXXXXX")
trap 'rm -rf "$work"' EXIT
gcc -std=gnu11 -O3 -ffp-contract=off -Wall -Wextra -Wconversion -Wshadow -Werror tests/bench/make_terrain.c -o "$work/make_terrain"
rm -f "$families"
import() { # NAME RASTER COL ROW SIDE
    gdal_translate -q -of ENVI -srcwin "$3" "$4" "$5" "$5" "$2" "$work/crop.bin"
    "$RQT" import --name "$1" "$work/crop.bin" "$families" >"$work/import.txt" 2>&1 || { cat "$work/import.txt" >&2; exit 1; }
    rm -f "$work"/crop.*
}
for amplitude in $NOISE; do
    "$work/make_terrain" 9 "$work/noise.bin" 1 "$amplitude" 100 # hills of 100 m: the noise must show
    import "fbm_noise_$amplitude" "$work/noise.bin" 0 0 513
    rm -f "$work"/noise.*
done
# The middle of every crop is the middle of the whole, and their quadrants nest: the window's mesh is the same in all.
"$work/make_terrain" "$K" "$work/whole.bin"
for ((k = SMALLEST_K; k <= K; k++)); do
    from=$(((1 << K >> 1) - (1 << k >> 1)))
    import "fbm_size_$(((1 << k) + 1))" "$work/whole.bin" $from $from $(((1 << k) + 1))
done
"$RQT" chart "$families" -o "$OUT/families" --runs 25
if [[ -n ${DOCS:-} ]]; then
    mkdir -p "$DOCS"
    for picture in "$OUT"/*/[1-6]-*.png; do
        folder=$(basename "$(dirname "$picture")")
        cp "$picture" "$DOCS/$folder-$(basename "$picture")"
    done
fi
echo "The charts: $OUT/*/*.png"
