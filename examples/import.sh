#!/bin/bash
# import.sh FOLDER DATABASE [NAME] - imports a folder of tiles that share one grid (SRTM .hgt, GeoTIFF, ...) as one terrain.
#
# Tiles are found by their endings, in subfolders too, and handed over in the order of their names: where two
# overlap and disagree, the later name wins, and the import says how many samples that concerns.
#
#   examples/import.sh ~/srtm/pyrenees pyrenees.gpkg
#   examples/import.sh ~/dem25 country.gpkg dem25 && rqt info country.gpkg
set -eu
if [ $# -lt 2 ] || [ $# -gt 3 ]; then
    sed -n '2,8s/^# \{0,1\}//p' "$0" >&2
    exit 2
fi
folder=$1 database=$2
name=${3:-$(basename "$folder" | tr -c 'A-Za-z0-9_.\n-' '_' | cut -c1-63)}
rqt=$(command -v rqt || echo "$(dirname "$0")/../build/rqt")
[ -d "$folder" ] || { echo "import.sh: $folder is no folder" >&2; exit 1; }

tiles=()
while IFS= read -r -d '' tile; do tiles+=("$tile"); done < <(
    find "$folder" -type f \( -iname '*.hgt' -o -iname '*.hgt.zip' -o -iname '*.tif' -o -iname '*.tiff' -o -iname '*.dem' \
        -o -iname '*.asc' -o -iname '*.img' -o -iname '*.vrt' \) -print0 | sort -z)
[ ${#tiles[@]} -gt 0 ] || { echo "import.sh: no tiles in $folder" >&2; exit 1; }
echo "${#tiles[@]} tiles -> terrain $name in $database" >&2
exec "$rqt" import --name "$name" "${tiles[@]}" "$database"
