# shellcheck shell=bash
# common.sh - what the benches share; to be sourced at the root of the repository, with OUT, the folder of their programs and
# terrains, set.

compile() { # OUTPUT FLAGS SOURCES...
    local output=$1 flags=$2 s
    shift 2
    for s in "$@" tests/bench/bench.h; do
        if [[ ! -e $output || $s -nt $output ]]; then
            # shellcheck disable=SC2086
            gcc -std=gnu11 -O3 -ffp-contract=off -Wall -Wextra -Wconversion -Wshadow -Werror "$@" -o "$output" $flags
            return
        fi
    done
}

# The generated terrain of (2^K + 1)^2 samples, made when it is missing or of another make_terrain: its path to the variable
# `raster`, samples a side to `side`.
generate() { # K
    side=$(((1 << $1) + 1))
    raster=$OUT/fbm_$side.bin
    compile "$OUT/make_terrain" "" tests/bench/make_terrain.c
    if [[ ! -e $raster || $OUT/make_terrain -nt $raster ]]; then
        echo "Generating $side x $side samples ..." >&2
        "$OUT/make_terrain" "$1" "$raster"
    fi
}

# As a GeoTIFF beside it: its path to the variable `tiff`.
generate_tiff() { # K
    generate "$1"
    tiff=${raster%.bin}.tif
    [[ $tiff -nt $raster ]] || gdal_translate -q -co TILED=YES -co COMPRESS=ZSTD -co PREDICTOR=2 "$raster" "$tiff"
}

machine_name() { echo "$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1), $(nproc) cores"; }
