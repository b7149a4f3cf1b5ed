#!/usr/bin/env bash
# bench_views.sh - `make bench-views`: what views cost, beside one eps for all, GDAL and the papers' figures.
#
# Needs the command and the extension (RQT, RQT_SO; default build/rqt and build/rqt.so), gcc, libgdal and libsqlite3. Terrains
# stay in build/bench/views for the next time, with the figures in views.csv and those of each frame in flight-*.csv.
#   BENCH_CPU=1     processor time, for a machine that others use, too
#   BENCH_FRAMES=1000  how many of the 1000 frames are flown
#   ETOPO5=file     the 5-minute grid of Debian's ferret-datasets; without it the view over a network is left out
set -euo pipefail
cd "$(dirname "$0")/../.."
BUILD=${BUILD:-build}
RQT=${RQT:-$BUILD/rqt}
RQT_SO=${RQT_SO:-$BUILD/rqt.so}
ETOPO5=${ETOPO5:-/usr/share/ferret-vis/data/etopo5.cdf}
OUT=$BUILD/bench
VIEWS=$OUT/views
mkdir -p "$VIEWS"
for needed in "$RQT" "$RQT_SO"; do
    [[ -e $needed ]] || { echo "bench-views: $needed is missing; run make first" >&2; exit 2; }
done
# shellcheck source=tests/bench/common.sh
source tests/bench/common.sh
compile "$OUT/bench_views" "$(gdal-config --cflags) -lsqlite3 $(gdal-config --libs) -lm" \
    tests/bench/bench_views.c tests/bench/bench_flight.c tests/bench/bench_sql.c tests/bench/bench_table.c

import() { # NAME SOURCE...
    local name=$1
    shift
    rm -f "$VIEWS/$name.gpkg"
    "$RQT" import --name "$name" "$@" "$VIEWS/$name.gpkg" >"$VIEWS/log.txt" 2>&1 || { cat "$VIEWS/log.txt" >&2; exit 1; }
}
generate 11
begin=$EPOCHREALTIME
import fbm_2049 "$raster"
end=$EPOCHREALTIME
generate_tiff 12
ln -sf "$(realpath "$tiff")" "$VIEWS/fbm_4097.tif"
import fbm_4097 "$raster"

# The grid is on whole minutes from 0 to 360 degrees, its longitudes in single precision: two halves, placed exactly, so that
# Greenwich is no border.
if [[ -e $ETOPO5 ]]; then
    halves=()
    while read -r col west; do
        half=$VIEWS/etopo5_$west.tif
        # shellcheck disable=SC2046
        gdal_translate -q -ot Int16 -a_nodata none -a_srs EPSG:4326 -srcwin "$col" 0 2160 2161 \
            -a_ullr $(awk -v w="$west" 'BEGIN { h = 1 / 24; printf "%.15f %.15f %.15f %.15f", w - h, 90 + h, w + 180 - h, -90 - h }') \
            "$ETOPO5" "$half" 2>"$VIEWS/log.txt" || { cat "$VIEWS/log.txt" >&2; exit 1; }
        halves+=("$half")
    done <<<$'2160 -180\n0 0'
    import etopo5 "${halves[@]}"
else
    rm -f "$VIEWS/etopo5.gpkg"
fi

"$OUT/bench_views" "$VIEWS" "$RQT_SO" "$(awk "BEGIN { print ${end} - ${begin} }")" "$(machine_name)" \
    "generated fBm (H 0.9, seed 1), 4097 x 4097 and 2049 x 2049 int16, 30 m cells, 0 to 4000 m; ETOPO5 (NGDC)"
echo
echo "The same figures: $VIEWS/views.csv; every frame: $VIEWS/flight-line.csv, flight-circle.csv"
