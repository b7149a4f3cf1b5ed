#!/bin/bash
# national-import.sh [FOLDER [DATABASE [OPTION...]]] - loads a tiled national DEM: report, resume, check, mend, query.
#
# FOLDER holds the tiles (in subfolders too), or is @FILE, a list of them. Without it, the repository's own SRTM of the
# Pyrenees is cut into 72 tiles as they come from agencies: some share their border row and column, others only abut;
# one is missing, and one is 7 m too high. OPTION... go to `rqt import` (--fill, --nodata, --memory ...).
#
#   examples/national-import.sh
#   examples/national-import.sh ~/dem25 country.gpkg --nodata -9999
set -eu
demo=
root=$(cd "$(dirname "$0")/.." && pwd)
case " ${1:-} " in *" -h "* | *" --help "*) sed -n '2,9s/^# \{0,1\}//p' "$0"; exit ;; esac
rqt=${RQT:-$root/build/rqt} so=${RQT_SO:-$root/build/rqt.so}
[ -x "$rqt" ] || rqt=$(command -v rqt) || { echo "national-import.sh: run make first" >&2; exit 1; }
show() { printf '\n$ rqt'; printf ' %s' "$@"; echo; "$rqt" "$@"; }

if [ $# = 0 ]; then
    out=${OUT:-$root/build/national}
    mkdir -p "$out"
    cd "$out"
    rm -rf tiles && mkdir tiles
    cut() { gdal_translate -q -co COMPRESS=DEFLATE "$@" 2>/dev/null; }
    gdalbuildvrt -q all.vrt "$root/tests/data/N42E001.hgt.zip" "$root/tests/data/N41E001.hgt.zip"
    # 6 x 12 tiles of 1201 x 2401 samples. West: 201 x 201, neighbours have a row or column in common. East: 200 x 200,
    # the next tile begins with the next sample.
    for r in {00..11}; do
        for c in {0..5}; do
            w=201 h=201
            [ "$c" -lt 3 ] || { w=200 h=200; }
            [ "$c" != 5 ] || w=201
            [ "$r" != 11 ] || h=201
            cut -srcwin $((c * 200)) $((10#$r * 200)) $w $h all.vrt "tiles/row$r-col$c.tif"
        done
    done
    rm -rf mended && mkdir mended
    mv tiles/row07-col4.tif tiles/row04-col1.tif mended
    cut -scale 0 1000 7 1007 mended/row04-col1.tif tiles/row04-col1.tif
    set -- tiles pyrenees.gpkg --name pyrenees --fill 4
    rm -f pyrenees.gpkg*
    demo=yes
fi
tiles=$1 database=${2:-national.gpkg}
shift $(($# > 1 ? 2 : 1))
faults=${database%.*}-faults.geojson
if [ "$demo" ]; then
    echo "# Onto a disk that is full after 1 MB (ulimit -f): the import stops half-way, and keeps what it has read"
    (ulimit -f 1000; show import --resumable "$@" "$tiles" "$database" 2>&1) && { echo "... but it did not" >&2; exit 1; }
    ls -s --block-size=1 "$database"* | sed 's/^ */  /'
    echo
    echo "# With room again the same command goes on, as it would after kill -9: what was read is not read again."
    echo "# All faults of the tiles go into a layer for QGIS"
else
    echo "# Should it be stopped, killed or run out of disk, the same command goes on from there"
fi
show import --resumable --report "$faults" "$@" "$tiles" "$database"

echo
echo "# What is in that layer"
sqlite3 -box :memory: "SELECT value ->> '$.properties.kind' AS fault, count(*) AS places, sum(value ->> '$.properties.samples') AS samples,
    sum(value ->> '$.properties.differ') AS differ, max(value ->> '$.properties.largest') AS most_metres
    FROM json_each(CAST(readfile('$faults') AS TEXT), '$.features') GROUP BY 1 ORDER BY 1"
show check "$database"
show info "$database"

echo
if [ "$demo" ]; then
    echo "# The agency sends the missing tile, and the high one as it should be"
    show update mended "$database"
    show check "$database"
    echo
fi
echo "# 10 km in the middle, at 20 m: the mesh, and its proof"
sqlite3 -box "$database" -cmd ".load $so" "
    WITH middle AS (SELECT x0 + width / 2 * dx AS x, y0 + height / 2 * dy AS y, lonlat FROM rqt_terrain),
         area AS (SELECT iif(lonlat, rqt_circle(x, y, 5000), rqt_bbox(x - 5000, y - 5000, x + 5000, y + 5000)) AS region FROM middle)
    SELECT samples, vertices, triangles, max_error, t_junctions AS cracks, overlaps, uncovered FROM area, rqt_verify(area.region, 20)"
