#!/usr/bin/env bash
# chart_views.sh - `make chart-views`: views by the guaranteed test beside the tests of the literature, drawn. All of it in
# build/chart.
#
# Charts 7 to 9 of the largest squares of 2^k + 1 samples without voids, as charts 1 to 4, of two real DEMs (of the project;
# DATA=dir: of the first two in there) and of one generated terrain; 10 and 11 of the fly-overs of bench_views.sh, where it has
# been run. Tables at equal true error go to views.txt.
#   TESTS="..." TAUS="..." RUNS=3 BENCH_CPU=1   as chart_views.py
#   CROP_K=10       squares have at most 2^CROP_K + 1 samples a side
#   DRAW_ONLY=1     draw what has been measured before
#   DOCS=dir        copy the pictures there, as NAME-CHART.png (examples/charts, for examples/CHARTS.md)
set -euo pipefail
cd "$(dirname "$0")/../.."
BUILD=${BUILD:-build}
RQT=${RQT:-$BUILD/rqt}
RQT_SO=${RQT_SO:-$PWD/$BUILD/rqt.so}
PYTHON=${PYTHON:-/usr/bin/python3}
CROP_K=${CROP_K:-10}
CHARTS=$BUILD/chart
OUT=$BUILD/bench
mkdir -p "$CHARTS/views" "$OUT"
for needed in "$RQT" "$RQT_SO"; do
    [[ -e $needed ]] || { echo "chart-views: $needed is missing; run make first" >&2; exit 2; }
done
# shellcheck source=tests/bench/common.sh
source tests/bench/common.sh

files=(examples/N44W072.hgt.zip tests/data/N41E001.hgt.zip)
if [[ -n ${DATA:-} ]]; then
    shopt -s nullglob
    files=("$DATA"/*.hgt.zip "$DATA"/*.tif "$DATA"/*.dem)
    files=("${files[@]:0:2}")
    ((${#files[@]})) || { echo "chart-views: no raster in $DATA" >&2; exit 2; }
fi
compile "$OUT/find_crop" "$(gdal-config --cflags) $(gdal-config --libs)" tests/bench/peers/find_crop.c
generate "$CROP_K"
files+=("$raster")
databases=()
for file in "${files[@]}"; do
    name=$(basename "$file"); name=${name%%.*}
    database=$CHARTS/$name/$name-views.gpkg
    mkdir -p "$CHARTS/$name"
    [[ -z ${DRAW_ONLY:-} ]] || continue
    crop=$("$OUT/find_crop" "$file" "$CROP_K" 2>/dev/null) || { echo "chart-views: $file has no square without voids" >&2; exit 1; }
    read -r col row width <<<"$crop"
    gdal_translate -q -srcwin "$col" "$row" "$width" "$width" "$file" "$CHARTS/$name/views-crop.tif"
    "$RQT" import --replace --name "$name" "$CHARTS/$name/views-crop.tif" "$database" >"$CHARTS/views/import.txt" 2>&1 ||
        { cat "$CHARTS/views/import.txt" >&2; exit 1; }
    databases+=("$database")
done
[[ -n ${DRAW_ONLY:-} ]] || "$PYTHON" tests/bench/chart_views.py "$RQT_SO" "${databases[@]}" | tee "$CHARTS/views.txt"

if ! command -v gnuplot >/dev/null; then
    echo "gnuplot is missing: figures, but no pictures" >&2
    exit 0
fi
STYLE="set encoding utf8
set border 3 lc rgb '#444444'
set tics nomirror
set grid lt 1 dt 1 lc rgb '#e4e4e4' lw 0.7
set key noenhanced samplen 2.5 spacing 1.15
set label 3 '$(machine_name)' at screen 0.99,0.02 right noenhanced font ',8' textcolor rgb '#777777'"
picture() { # FILE HEIGHT: the script comes on standard input
    { echo "set terminal pngcairo size 900,$2 font 'DejaVu Sans,12' background '#ffffff'"; echo "set output '$1'"; echo "$STYLE"; cat; } |
        gnuplot || { echo "chart-views: gnuplot cannot draw $1" >&2; exit 1; }
}
declare -A looks=([guaranteed]="lc rgb '#0072b2' lw 4 pt 7 ps 1.2" [ulrich]="lc rgb '#e69f00' lw 1.6 pt 9 ps 1.1"
    [node]="lc rgb '#d55e00' lw 1.6 pt 11 ps 1.1" [sphere]="lc rgb '#cc79a7' lw 1.6 pt 13 ps 1.2"
    [lindstrom]="lc rgb '#009e73' lw 1.6 pt 5 ps 0.9" [lodmap]="lc rgb '#000000' lw 1.6 pt 15 ps 1.1")
lines() { # FOLDER COLUMNS: what to plot, the guaranteed test last and so on top
    local test begins="plot "
    for test in ${TESTS:-ulrich node sphere lindstrom lodmap guaranteed}; do
        echo -n "$begins'$1/views-$test.dat' using $2 with linespoints ${looks[$test]} title '$test'"
        begins=", "
    done
    echo
}
FRAME="set tmargin 4.5
set bmargin 5
set logscale xy
set format '%g'
set ylabel 'true worst error on the screen, pixels'"
for file in "${files[@]}"; do
    name=$(basename "$file"); name=${name%%.*}
    heading() { echo "set label 1 '$1' at graph 0.5,screen 0.96 center noenhanced font ',14'
set label 2 '$name; 1280 x 800 pixels; low flight, high and straight down together' at graph 0.5,screen 0.915 center noenhanced font ',10' textcolor rgb '#444444'
$FRAME"; }
    { heading "True error on the screen against triangles"
      echo "set xlabel 'triangles of the three views'; set format x '%.0s%c'; set key top right"
      lines "$CHARTS/$name" 2:3; } | picture "$CHARTS/$name/7-view-triangles.png" 640
    { heading "True error on the screen over the tolerance asked for"
      echo "set xlabel 'tolerance asked for, pixels'; set key top left"
      echo "$(lines "$CHARTS/$name" 1:3), x with lines lc rgb '#444444' lw 1.2 dt 2 title 'the promise'"; } |
        picture "$CHARTS/$name/8-view-tolerance.png" 640
    { heading "True error on the screen against time"
      echo "set xlabel 'milliseconds for the strips of the three views, warm'; set key top right"
      lines "$CHARTS/$name" 4:3; } | picture "$CHARTS/$name/9-view-time.png" 640
done
chart=10
for flight in line circle; do
    csv=$OUT/views/flight-$flight.csv
    [[ -e $csv ]] || { echo "(no $csv: make bench-views flies)"; continue; }
    [[ $flight = line ]] && what="1000 m/s along a line, 38 frames a second" || what="a circle around the centre"
    picture "$CHARTS/views/$chart-$flight.png" 1000 <<PLOT
set datafile separator ','
set label 1 'Fly-over of 1000 frames: $what' at screen 0.5,0.975 center font ',14'
set lmargin 11
set rmargin 4
set xrange [0:1000]
set key outside above right horizontal
set multiplot
set size 1,0.31
set origin 0,0.64
set yrange [0:*]
set ylabel 'triangles, thousands'
plot '$csv' every ::1 using 1:(\$2/1e3) with lines lc rgb '#0072b2' lw 2 title 'triangles of a frame'
unset label 1
unset label 3
set origin 0,0.335
set logscale y
set format y '%g'
set yrange [*:*]
set ylabel 'milliseconds'
plot '$csv' every ::1 using 1:6 with lines lc rgb '#0072b2' lw 1.5 title 'fresh: strip', \\
     '$csv' every ::1 using 1:8 with points lc rgb '#d55e00' pt 7 ps 0.4 title 'increment against the last answer'
set origin 0,0.03
set ylabel 'kilobytes'
set xlabel 'frame'
plot '$csv' every ::1 using 1:(\$9/1e3) with lines lc rgb '#0072b2' lw 1.5 title 'strip', \\
     '$csv' every ::1 using 1:(\$10/1e3) with lines lc rgb '#009e73' lw 1.5 title 'wire format', \\
     '$csv' every ::1 using 1:(\$11/1e3) with points lc rgb '#d55e00' pt 7 ps 0.4 title 'increment'
unset multiplot
PLOT
    chart=$((chart + 1))
done
if [[ -n ${DOCS:-} ]]; then
    mkdir -p "$DOCS"
    for file in "${files[@]}" views; do
        name=$(basename "$file"); name=${name%%.*}
        for picture in "$CHARTS/$name"/[7-9]-view-*.png "$CHARTS/$name"/1[01]-*.png; do
            [[ ! -e $picture ]] || cp "$picture" "$DOCS/$name-$(basename "$picture")"
        done
    done
fi
echo "The charts: $CHARTS/*/*-view-*.png, $CHARTS/views/*.png"
