#!/usr/bin/env bash
# peers.sh - charts of real DEMs, with a greedy TIN (delatin) and RTIN (@mapbox/martini) beside the methods of rqt, and
# the vertices of `exact` over those of the others at equal true error.
#
#     peers.sh [RASTER...]        default: the six DEMs of the directory DATA with the largest usable crops
#
# Peers take squares of 2^k + 1 samples without voids, so that is cut from every raster, and imported: all programs see
# the same heights, and one verifier finds all true errors. Where node, npm or the registry is missing, the charts and the
# table go without peers, and say so.
#   OUT=build/chart             a directory per DEM is made in it, and equal-error.txt
#   DATA=tests/data             where the rasters are
#   CROP_K=10                   crops have at most 2^CROP_K + 1 samples a side
#   EPS=1,2,...                 tolerances of rqt (at most 12)
#   PEER_ERRORS=0.5,...         errors that peers are asked for
set -euo pipefail
cd "$(dirname "$0")/../.."
BUILD=${BUILD:-build}
RQT=${RQT:-$BUILD/rqt}
OUT=${OUT:-$BUILD/chart}
DATA=${DATA:-tests/data}
MOST=6
EPS=${EPS:-0.5,1,2,3,5,10,15,20,30,50,100,150}
PEER_ERRORS=${PEER_ERRORS:-0.5,0.7,1,1.5,2,3,4,5,7,10,14,20,28,40,56,80,110,150}
PEERS=$BUILD/peers
mkdir -p "$OUT" "$PEERS"
[[ -e $RQT ]] || { echo "peers: $RQT is missing; run make first" >&2; exit 2; }

compile() { # OUTPUT SOURCE FLAGS...
    local output=$1 source=$2
    shift 2
    [[ -e $output && ! $source -nt $output ]] ||
        gcc -std=gnu11 -O3 -ffp-contract=off -Wall -Wextra -Wconversion -Wshadow -Werror "$source" "$@" -o "$output"
}
# shellcheck disable=SC2046
compile "$PEERS/find_crop" tests/bench/peers/find_crop.c $(gdal-config --cflags) $(gdal-config --libs)
compile "$PEERS/verify_peers" tests/bench/peers/verify_peers.c -Isrc/verify src/verify/*.c -lm

# The two packages, once. What keeps them away is said, and no failure.
have_peers() {
    [[ -d $PEERS/node_modules/delatin && -d $PEERS/node_modules/@mapbox/martini ]] && command -v node >/dev/null && return
    command -v node >/dev/null && command -v npm >/dev/null ||
        { echo "peers: node or npm is missing (Debian: nodejs, npm): going on without peers" >&2; return 1; }
    (cd "$PEERS" && npm install --no-audit --no-fund --no-save delatin@0.2.0 @mapbox/martini@0.2.0 >npm.log 2>&1) ||
        { echo "peers: npm cannot install delatin and @mapbox/martini ($PEERS/npm.log): going on without peers" >&2
          return 1; }
}
peers=; ! have_peers || peers=yes

crop_of() { "$PEERS/find_crop" "$1" "${CROP_K:-10}" 2>/dev/null; } # COL ROW SIDE
files=("$@")
if ((${#files[@]} == 0)); then
    shopt -s nullglob
    mapfile -t files < <(for file in "$DATA"/*.zip "$DATA"/*.tif "$DATA"/*.dem "$DATA"/*.hgt; do
        crop=$(crop_of "$file") && echo "${crop##* } $file"
    done | sort -k1,1nr -s | head -n $MOST | cut -d' ' -f2-)
fi
((${#files[@]} > 0)) || { echo "peers: $DATA has no raster with a square of whole heights without voids" >&2; exit 2; }

folders=()
for file in "${files[@]}"; do
    name=$(basename "$file"); name=${name%%.*}
    folder=$OUT/$name
    crop=$(crop_of "$file") || { echo "peers: $file has no square without voids" >&2; exit 1; }
    read -r col row side <<<"$crop"
    echo "$name: $side x $side samples, from column $col, row $row" >&2
    mkdir -p "$folder"
    gdal_translate -q -of ENVI -ot Int32 -a_nodata none -srcwin "$col" "$row" "$side" "$side" "$file" "$folder/crop.bin"
    "$RQT" import --replace --name "$name" "$folder/crop.bin" "$folder/$name.gpkg" >"$folder/import.txt"
    arguments=()
    if [[ -n $peers ]]; then
        node tests/bench/peers/peers.mjs "$PEERS/node_modules" "$folder/crop.bin" "$side" "$folder/meshes.bin" "$PEER_ERRORS"
        "$PEERS/verify_peers" "$folder/crop.bin" "$side" "$folder/meshes.bin" >"$folder/peers.csv"
        rm -f "$folder/meshes.bin"
        arguments=(--peers "$folder/peers.csv")
    fi
    "$RQT" chart "$folder/$name.gpkg" -o "$folder" --eps "$EPS" "${arguments[@]}"
    folders+=("$folder")
done
python3 tests/bench/peers/equal_error.py "${folders[@]}" | tee "$OUT/equal-error.txt"
