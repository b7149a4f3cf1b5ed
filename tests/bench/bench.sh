#!/usr/bin/env bash
# bench.sh - `make bench`: rqt beside GDAL on a generated terrain of 4097 x 4097 samples.
#
# Needs the command and the extension (RQT, RQT_SO; default build/rqt and build/rqt.so), gcc, libgdal and libsqlite3. The
# terrain and the programs stay in build/bench for the next time, with the figures in bench.csv.
#   BENCH_K=12      2^K + 1 samples a side
#   BENCH_RUNS=5    of whole programs
#   BENCH_CPU=1     processor time in place of the clock's, but of whole programs
#   BENCH_LARGE=5   imports of 32769 x 16385 samples with --memory 256; 0: leave the large database out (it takes minutes
#                   and 2 GB of disk)
set -euo pipefail
cd "$(dirname "$0")/../.."
BUILD=${BUILD:-build}
RQT=${RQT:-$BUILD/rqt}
RQT_SO=${RQT_SO:-$BUILD/rqt.so}
K=${BENCH_K:-12}
RUNS=${BENCH_RUNS:-5}
LARGE=${BENCH_LARGE:-5}
OUT=$BUILD/bench
mkdir -p "$OUT"

for needed in "$RQT" "$RQT_SO"; do
    [[ -e $needed ]] || { echo "bench: $needed is missing; run make first" >&2; exit 2; }
done

# shellcheck source=tests/bench/common.sh
source tests/bench/common.sh
compile "$OUT/mirror_terrain" "" tests/bench/mirror_terrain.c
compile "$OUT/bench" "$(gdal-config --cflags) -lsqlite3 $(gdal-config --libs) -lm" \
    tests/bench/bench.c tests/bench/bench_options.c tests/bench/bench_sql.c tests/bench/bench_table.c
generate_tiff "$K"

times=$OUT/times.txt
echo "samples $((side * side))" >"$times"
timed() { # NAME COMMAND...
    local name=$1 begin=$EPOCHREALTIME end
    shift
    "$@" >"$OUT/log.txt" 2>&1 || { cat "$OUT/log.txt" >&2; exit 1; }
    end=$EPOCHREALTIME
    echo "$name $((${end/./} - ${begin/./}))e-6" >>"$times"
}
cog() { gdal_translate -q -of COG -co COMPRESS=ZSTD -co PREDICTOR=2 -co OVERVIEWS=AUTO "$@" "$raster" "$OUT/cog.tif"; }
cat "$raster" >/dev/null # all of them find it in the page cache
for ((run = 1; run <= RUNS; run++)); do
    [[ ! -t 2 ]] || printf '\rImport and COG, run %d of %d ' "$run" "$RUNS" >&2
    rm -f "$OUT"/fbm.gpkg "$OUT/cog.tif"
    timed import "$RQT" import --name fbm "$raster" "$OUT/fbm.gpkg"
    timed cog cog
    rm -f "$OUT/cog.tif"
    timed cog_threads cog -co NUM_THREADS=ALL_CPUS
done
# 64 x 64 samples become others, and what they were again: twice as many updates as imports.
square=(-srcwin $((side / 2)) $((side / 2)) 64 64)
gdal_translate -q "${square[@]}" "$raster" "$OUT/square_old.tif"
gdal_translate -q "${square[@]}" -scale 0 4000 400 4000 "$raster" "$OUT/square_new.tif"
for ((run = 1; run <= RUNS; run++)); do
    for square in new old; do timed update "$RQT" update "$OUT/square_$square.tif" "$OUT/fbm.gpkg"; done
done
[[ ! -t 2 ]] || printf '\r%40s\r' '' >&2
echo "database_bytes $(stat -c %s "$OUT/fbm.gpkg")" >>"$times"
echo "cog_bytes $(stat -c %s "$OUT/cog.tif")" >>"$times"

large=()
if ((LARGE > 0 && K == 12)); then
    big=$OUT/fbm_large.bin
    [[ -e $big && ! $raster -nt $big ]] || "$OUT/mirror_terrain" "$raster" "$side" 8 4 "$big"
    echo "large_samples $((32769 * 16385))" >>"$times"
    for ((run = 1; run <= LARGE; run++)); do
        [[ ! -t 2 ]] || printf '\rLarge import, run %d of %d ' "$run" "$LARGE" >&2
        rm -f "$OUT/large.gpkg"
        timed large_import /usr/bin/python3 tests/bench/peak.py "$RQT" import --memory 256 --name fbm "$big" "$OUT/large.gpkg"
        sed -n 's/^peak_kib /large_rss_kib /p' "$OUT/log.txt" >>"$times"
    done
    [[ ! -t 2 ]] || printf '\r%40s\r' '' >&2
    large=("$OUT/large.gpkg")
fi

data="generated fBm (H 0.9, seed 1), $side x $side int16, 30 m cells, 0 to 4000 m"
"$OUT/bench" "$OUT/fbm.gpkg" "$RQT_SO" "$tiff" "$times" "$OUT/bench.csv" "$(machine_name)" "$data" "${large[@]}"
if [[ -e $BUILD/librqt.a ]]; then
    core() { # NAME LIBRARIES: a program on librqt.a alone
        [[ ! $BUILD/librqt.a -nt $OUT/$1 ]] || rm -f "$OUT/$1"
        compile "$OUT/$1" "-Isrc/core $BUILD/librqt.a $2 -lzstd -lm" "tests/bench/$1.c" tests/bench/bench_table.c
    }
    core bench_errors ""
    core bench_walk ""
    core bench_field ""
    echo
    echo "Exact errors and saturation, one core (aim: 60 Msamples/s, the same bytes)"
    "$OUT/bench_errors" "$raster" "$side" "$RUNS"
    echo
    echo "The walk over decoded blocks in memory, one thread, beside RTIN's recursion in C over the same errors"
    echo "(aim: 120 Mtriangles/s, 1.5 times RTIN in C)"
    "$OUT/bench_walk" "$K" "$raster" | tee "$OUT/walk.txt"
    echo
    echo "What a field of an eye over the middle costs a query (aim: 20 us a block of 65 a side over one eps)"
    "$OUT/bench_field" "$K" "$raster"
    if [[ -d $BUILD/peers/node_modules/@mapbox/martini ]] && command -v node >/dev/null; then
        echo
        echo "Beside @mapbox/martini's getMesh on the same $side x $side samples (aim: 6 times)"
        node tests/bench/peers/martini.mjs "$BUILD/peers/node_modules" "$raster" "$side" 1,2,5,10,20 >"$OUT/martini.txt"
        awk 'NR == FNR { rate[$1] = $3; count[$1] = $2; next }
             $1 == "whole" { match($0, /strip [0-9.]+ Mtri/); ours = substr($0, RSTART + 6, RLENGTH - 11)
                 printf "  eps %2d: strip %6.1f Mtriangles/s; getMesh %6.1f (%d triangles): %.1f times\n", $3, ours, rate[$3], count[$3], ours / rate[$3] }' \
            "$OUT/martini.txt" "$OUT/walk.txt"
    else
        echo "(martini is not installed: make peers brings it)"
    fi
fi
echo
echo "Tiles for globes, of another fractal of as many samples"
RQT=$RQT RQT_SO=$RQT_SO /usr/bin/python3 tests/bench/bench_tiles.py "$side"
echo
echo "The same figures but of tiles: $OUT/bench.csv"
