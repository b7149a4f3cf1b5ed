#!/bin/bash
# test_cli.sh - the rqt command as its users meet it: exit status, help, sentences, what each command prints and writes,
# and that nothing half done is left behind, whenever it is stopped.
#
# $RQT names the command (default build/rqt), $RQT_SO the extension (default: rqt.so beside it). Makes its own rasters.
set -u
RQT=$(realpath "${RQT:-build/rqt}")
RQT_SO=${RQT_SO:-$(dirname "$RQT")/rqt.so}
ROOT=$(realpath "$(dirname "$0")/..")
T=$(mktemp -d)
trap 'chmod -R u+w "$T"; rm -rf "$T"' EXIT
cd "$T" || exit 1
mkdir bin && cp "$RQT" bin/rqt && cp "$RQT_SO" bin/rqt.so || exit 1 # a build beside us must not change them half-way
RQT=$T/bin/rqt RQT_SO=$T/bin/rqt.so
passed=0 failed=0

ok() { # what condition-status [why]
    if [ "$2" = 0 ]; then
        passed=$((passed + 1)); echo "ok      $1"
    else
        failed=$((failed + 1)); echo "FAILED  $1"
        [ -n "${3:-}" ] && echo "$3" | sed 's/^/          /' | head -12
    fi
}
# Runs the command: status in $status, stdout and stderr in out and err.
rqt() { "$RQT" "$@" >out 2>err </dev/null; status=$?; }
# What, expected status, part of stderr, arguments...
refuses() {
    local what=$1 expected=$2 phrase=$3
    shift 3
    rqt "$@"
    [ $status = "$expected" ] && [ ! -s out ] && grep -qF -- "$phrase" err
    ok "$what" $? "status $status, not $expected; stderr without '$phrase': $(cat err); stdout: $(head -c 300 out)"
}
prints() { # what, part of stdout, arguments...
    local what=$1 phrase=$2
    shift 2
    rqt "$@"
    [ $status = 0 ] && grep -qF -- "$phrase" out
    ok "$what" $? "status $status; stdout without '$phrase': $(head -c 600 out); stderr: $(cat err)"
}
sql() { sqlite3 -cmd ".load $RQT_SO" "$@"; }

# ------------------------------------------------------------------------------------------------------ rasters
# 70 x 50 samples of 10 units: a hill with ripples, and a hole of voids when asked for.
grid() { # file voids
    awk -v voids="$2" 'BEGIN {
        print "ncols 70\nnrows 50\nxllcorner 1000\nyllcorner 2000\ncellsize 10\nNODATA_value -9999"
        for (r = 0; r < 50; r++) for (c = 0; c < 70; c++) {
            z = 300 + 200 * exp(-((c - 40) ^ 2 + (r - 20) ^ 2) / 200) + 15 * sin(c / 3) * cos(r / 4)
            if (voids && (c - 20) ^ 2 + (r - 30) ^ 2 < 60) z = -9999
            printf "%d%s", z, c == 69 ? "\n" : " "
        } }' >"$1"
}
grid hill.asc 0
grid holes.asc 1
# Big enough to be caught in the act: 2000 x 2000 samples of noise.
head -c 8000000 /dev/urandom >big.bil
printf 'NROWS 2000\nNCOLS 2000\nNBANDS 1\nNBITS 16\nPIXELTYPE SIGNEDINT\nBYTEORDER I\nLAYOUT BIL\n' >big.hdr
printf 'not a raster\n' >text.txt

# -------------------------------------------------------------------------------------------------- help, usage
prints "rqt --help" "Commands:" --help
prints "rqt --version" "rqt 0." --version
for c in import update info check verify mesh chart; do
    prints "rqt --help lists $c" "  $c " --help
    prints "rqt $c --help has examples" "Examples:" $c --help
    n=$(sed -n '/^Examples:/,$p' out | grep -c "^  rqt $c")
    [ "$n" -ge 2 ]; ok "rqt $c --help has two examples or more" $? "$n"
    cp out by_option
    rqt help $c
    [ $status = 0 ] && cmp -s out by_option; ok "rqt help $c says the same" $?
    refuses "rqt $c: unknown option" 2 "there is no option --frobnicate" $c --frobnicate
    refuses "rqt $c: unknown short option" 2 "there is no option -Z" $c -Z
done
refuses "no command" 2 "a command is missing"
refuses "unknown command" 2 "there is no command dance" dance
refuses "unknown option before a command" 2 "there is no option --dance" --dance

# ------------------------------------------------------------------------------------------------------- import
refuses "import: nothing" 2 "a source and a database are missing" import
refuses "import: no database" 2 "the database is missing" import hill.asc
refuses "import: --block 9" 2 "--block 9: K is a whole number from 1 to 8" import --block 9 hill.asc x.gpkg
refuses "import: --block 5x" 2 "--block 5x" import --block 5x hill.asc x.gpkg
refuses "import: --block without a value" 2 "the option --block needs a value" import hill.asc x.gpkg --block
refuses "import: --replace with a value" 2 "the option --replace takes no value" import --replace=1 hill.asc x.gpkg
refuses "import: a bad name" 2 "a name has 1 to 63 letters" import --name 'a b' hill.asc x.gpkg
refuses "import: a bad nodata" 2 "--nodata none is not a number" import --nodata none hill.asc x.gpkg
refuses "import: a bad unit" 2 "--unit furlong: m, ft, us-ft" import --unit furlong hill.asc x.gpkg
refuses "import: a bad quantum" 2 "--quantum 0 is no height step" import --quantum 0 hill.asc x.gpkg
refuses "import: a bad void-tol" 2 "--void-tol -1" import --void-tol -1 hill.asc x.gpkg
refuses "import: bad jobs" 2 "--jobs 0" import --jobs 0 hill.asc x.gpkg
refuses "import: bad memory" 2 "--memory lots" import --memory lots hill.asc x.gpkg
rqt import text.txt x.gpkg; [ "$(cat err)" = "rqt import: text.txt is not a raster that GDAL reads" ]
ok "import: not a raster, in a plain sentence" $? "$(cat err)"
refuses "import: a missing source" 1 "No such file" import nothing.tif x.gpkg
refuses "import: not a raster" 1 "text.txt" import text.txt x.gpkg
refuses "import: too little memory" 1 "MiB of memory" import --memory 1 big.bil x.gpkg
if ! grep -q __asan_init "$RQT"; then # a sanitizer takes memory of its own
    peak=$(python3 -c 'import resource, subprocess, sys
subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, check=True)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss // 1024)' "$RQT" import big.bil peak.gpkg)
    rqt import --memory 1 big.bil x.gpkg
    need=$(sed -n 's/.* need \([0-9]*\) MiB.*/\1/p' err)
    [ "$peak" -gt 0 ] && [ "$peak" -le "$need" ]; ok "import takes no more memory than it says" $? "$peak MiB, not $need"
    rm -f peak.gpkg
fi
refuses "import: no folder" 1 "cannot be created" import hill.asc nowhere/x.gpkg
[ ! -e x.gpkg ]; ok "refused imports leave no database" $?

prints "import reports on stdout" "hill: 3 500 samples, none void" import hill.asc t.gpkg
grep -qE 'blocks?, .* bytes, .* bits per sample' out && grep -q 'Msamples/s' out; ok "import reports size and rate" $? "$(cat out)"
[ ! -s err ]; ok "import without a terminal shows no progress" $? "$(cat err)"
refuses "import: the terrain exists" 1 "--replace" import hill.asc t.gpkg
prints "import --replace" "hill: 3 500" import --replace hill.asc t.gpkg
prints "import --name, --block, voids" "void (" import --name my.hole-2 --block 3 holes.asc t.gpkg
prints "import --unit and --quantum" "feet:" import --name feet --unit ft --quantum 0.5 hill.asc u.gpkg
prints "import --nodata marks voids" "void (" import --name nd --nodata 300 hill.asc u.gpkg
printf 'no database at all, but long enough to be looked at: %0100d\n' 0 >bad.gpkg; cp bad.gpkg bad.copy
refuses "import into what is no database" 1 "not an SQLite database" import hill.asc bad.gpkg
cmp -s bad.gpkg bad.copy; ok "... leaves it as it was" $?
if ! script -qec true /dev/null >/dev/null 2>&1 </dev/null; then
    echo "skipped import on a terminal shows progress: script makes no pseudo-terminal here"
else
    script -qec "$RQT import --replace big.bil tty.gpkg" /dev/null >tty 2>&1 </dev/null
    grep -q $'\r.*%' tty && grep -q 'Msamples/s' tty; ok "import on a terminal shows progress" $? "$(head -c 300 tty)"
    rm -f tty.gpkg
fi

# ------------------------------------------------------------------------------------------------------- update
# 10 x 8 samples from column 20, row 10 of the hill on, and what was there.
window() { # file, what to add
    awk -v add="$2" 'NR > 6 + 10 && NR <= 6 + 18 { if (!n++) print "ncols 10\nnrows 8\nxllcorner 1200\nyllcorner 2320\ncellsize 10\nNODATA_value -9999"
        for (c = 21; c <= 30; c++) printf "%d%s", $c + add, c == 30 ? "\n" : " " }' hill.asc >"$1"
}
window back.asc 0
window patch.asc 25
rqt import --name hill hill.asc updated.gpkg
cp updated.gpkg original.gpkg
refuses "update: nothing" 2 "a source and a database are missing" update
refuses "update: no database" 2 "the database is missing" update patch.asc
refuses "update: a bad nodata" 2 "--nodata none is not a number" update --nodata none patch.asc updated.gpkg
refuses "update: a bad unit" 2 "--unit furlong: m, ft, us-ft" update --unit furlong patch.asc updated.gpkg
refuses "update: --voids with a value" 2 "the option --voids takes no value" update --voids=1 patch.asc updated.gpkg
refuses "update: a missing source" 1 "No such file" update nothing.tif updated.gpkg
refuses "update: a missing database" 1 "No such file" update patch.asc nothing.gpkg
refuses "update: an unknown terrain" 1 "there is no terrain dale; there is hill" update --terrain dale patch.asc updated.gpkg
cmp -s updated.gpkg original.gpkg; ok "update: what is refused changes no byte of the file" $?
prints "update says what was put in" "hill: 80 samples put in, 80 of them differ" update patch.asc updated.gpkg
[ ! -s err ]; ok "update is silent in a pipe" $? "$(cat err)"
prints "update: the database is sound" "hill: sound" check updated.gpkg
blocks='SELECT id, hex(summary), hex(data) FROM rqt_block_1'
[ "$(sqlite3 updated.gpkg "$blocks" | md5sum)" != "$(sqlite3 original.gpkg "$blocks" | md5sum)" ]; ok "update changes blocks" $?
prints "update: the same again writes nothing" "nothing written" update patch.asc updated.gpkg
rqt update back.asc updated.gpkg
[ "$(sqlite3 updated.gpkg "$blocks" | md5sum)" = "$(sqlite3 original.gpkg "$blocks" | md5sum)" ]; ok "update back restores the blocks" $?
mkdir -p delivery/deeper && cp patch.asc delivery/deeper && echo notes >delivery/readme.txt
rqt update delivery updated.gpkg; grep -q "80 of them differ" out; ok "update takes a folder" $? "$(cat out err)"
printf '# back\n\nback.asc\n' >back.txt
rqt update @back.txt updated.gpkg; grep -q "80 of them differ" out; ok "update takes a list" $? "$(cat out err)"
echo nothing.tif >>back.txt
refuses "update: a list names the line of what is missing" 1 "back.txt, line 4: nothing.tif: No such file" update @back.txt updated.gpkg

# ----------------------------------------------------------------------------------------------------- info, check
for c in info check verify mesh; do refuses "$c: no database" 2 "a database is missing" $c; done
for c in info check; do
    refuses "$c: two databases" 2 "one database" $c a b
    refuses "$c: a missing file" 1 "missing.gpkg: No such file" $c missing.gpkg
    refuses "$c: a folder" 1 "is a folder" $c .
    refuses "$c: not a database" 1 "is not an SQLite database" $c bad.gpkg
done
[ ! -e missing.gpkg ]; ok "asking for a missing database does not make it" $?
prints "info lists the terrains" "my.hole-2" info t.gpkg
grep -q '^hill .*70 x 50' out && grep -q 'extent   x 1005 .. 1695, y 2005 .. 2495' out && grep -q 'source   hill.asc' out
ok "info shows size, extent, source" $? "$(cat out)"
prints "info --json" '"name"' info --json t.gpkg
python3 -c 'import json; a = json.load(open("out")); assert [t["name"] for t in a] == ["hill", "my.hole-2"], a
assert a[0]["width"] == 70 and a[0]["voids"] == 0 and a[1]["voids"] > 0 and a[0]["complete"] is True, a' 2>why
ok "info --json is JSON with the figures" $? "$(cat why)"
sqlite3 empty.db 'CREATE TABLE t(x)'
rqt info empty.db; [ $status = 0 ] && [ ! -s out ] && grep -q 'has no terrain' err; ok "info of a database without terrains" $? "$(cat err)"
prints "check: sound" "hill: sound" check t.gpkg
prints "check --terrain" "my.hole-2: sound" check --terrain my.hole-2 t.gpkg
refuses "check: an unknown terrain" 1 "nobody" check --terrain nobody t.gpkg
cp t.gpkg broken.gpkg
id=$(sqlite3 broken.gpkg "SELECT id FROM rqt_terrain WHERE name = 'hill'")
sqlite3 broken.gpkg "UPDATE rqt_block_$id SET data = substr(data, 1, length(data) - 1)"
rqt check broken.gpkg
[ $status = 1 ] && grep -q '^hill: error: block 1: ' out && grep -q '^my.hole-2: sound' out
ok "check of damaged blocks: status 1, and which" $? "$status $(cat out err)"
cp t.gpkg unfinished.gpkg; sqlite3 unfinished.gpkg "UPDATE rqt_terrain SET complete = 0 WHERE name = 'hill'"
prints "info shows an unfinished import" "INCOMPLETE" info unfinished.gpkg
rqt check unfinished.gpkg
[ $status = 1 ] && grep -q '^hill: error: terrain hill is incomplete' out
ok "check of an unfinished import: status 1, and it says so" $? "status $status $(cat out err)"
cp t.gpkg unusable.gpkg; sqlite3 unusable.gpkg "UPDATE rqt_terrain SET dx = 0 WHERE name = 'hill'"
rqt info unusable.gpkg
[ $status = 1 ] && grep -q 'hill: its row in rqt_terrain has an impossible placement' err && grep -q 'my.hole-2' out
ok "info of a damaged row: status 1, and the other terrain is shown" $? "status $status $(cat out err)"
refuses "verify of an unfinished import" 1 "hill" verify unfinished.gpkg --terrain hill --eps 1

# ---------------------------------------------------------------------------------------------------------- verify
refuses "verify: no eps" 2 "--eps is missing" verify t.gpkg
for e in x 1x '' 1, ,1 nan inf 1e999 '1 2'; do
    refuses "verify: --eps '$e'" 2 "is no tolerance" verify t.gpkg --eps "$e"
done
refuses "verify: --eps -1" 2 "a tolerance is not negative" verify t.gpkg --eps -1
refuses "verify: too many eps" 2 "at most" verify t.gpkg --eps 1,2,3,4,5,6,7,8,9,10,11,12,13
refuses "verify: two terrains and no name" 1 "my.hole-2" verify t.gpkg --eps 1
refuses "verify: a region of another SRID" 1 "SRID 2056" verify u.gpkg --terrain feet --eps 1 --region 'SRID=2056;POINT(0 0)'
refuses "verify: an unknown terrain" 1 "nobody" verify t.gpkg --eps 1 --terrain nobody
refuses "verify: a bad box" 2 "is not x0,y0,x1,y1" verify t.gpkg --terrain hill --eps 1 --region 1,2,3
refuses "verify: a bad number in a box" 2 "is not x0,y0,x1,y1" verify t.gpkg --terrain hill --eps 1 --region 1,2,3,x
refuses "verify: an empty region" 2 "--region is empty" verify t.gpkg --terrain hill --eps 1 --region ''
rqt verify t.gpkg --terrain hill --eps 1 --region 'POLYGON((0 0'
[ $status = 1 ] && [ -s err ] && ! grep -q 'rqt_verify()' err; ok "verify: an unreadable region" $? "$status $(cat err)"
prints "verify: a list of eps" "holds" verify t.gpkg --terrain hill --eps 0,1,5,20
[ "$(grep -c holds out)" = 4 ]; ok "... has a row for each" $? "$(cat out)"
row=$(awk '$1 == 5 { print NF ? $0 : "" }' out | tr -s ' ')
v=$(sql t.gpkg "SELECT vertices || ' ' || triangles FROM rqt_verify(NULL, 5, 'hill')")
[[ $(echo "$row" | tr -d ' ') == *"$(echo "$v" | tr -d ' ')"* ]]; ok "... has SQL's numbers" $? "$row; SQL: $v"
prints "verify: voids" "holds" verify t.gpkg --terrain my.hole-2 --eps 0,3
prints "verify: a box, given in any order" "holds" verify t.gpkg --terrain hill --eps 2 --region 1400,2400,1200,2200
cp out box; rqt verify t.gpkg --terrain hill --eps 2 --region 'POLYGON((1200 2200,1400 2200,1400 2400,1200 2400,1200 2200))'
cmp -s out box; ok "... is the same as its WKT" $?
prints "verify: a region outside is empty" "empty" verify t.gpkg --terrain hill --eps 2 --region 0,0,1,1
prints "verify: mode cut" "holds" verify t.gpkg --terrain hill --eps 0,2 --region 'POLYGON((1201.5 2200,1400 2210.25,1333 2400,1201.5 2200))' --mode cut
prints "verify: mode border" "holds" verify t.gpkg --terrain hill --eps 0,2,1000 --region 'POLYGON((1201.5 2200,1400 2210.25,1333 2400,1201.5 2200))' --mode border
prints "verify: mode snap" "holds" verify t.gpkg --terrain hill --eps 2 --region 1201,2203,1400,2400 --mode snap
prints "verify: outline tol" "holds" verify t.gpkg --terrain my.hole-2 --eps 0,3,1000 --outline tol
refuses "verify: an unknown mode" 2 "there is no such mode; there are" verify t.gpkg --eps 1 --mode x
refuses "verify: an unknown outline" 2 "there is no such outline" verify t.gpkg --eps 1 --outline x
prints "verify: rounded heights" "holds" verify u.gpkg --terrain feet --eps 0,1

# ------------------------------------------------------------------------------------------------------------ mesh
M="mesh t.gpkg --terrain hill"
refuses "mesh: no eps" 2 "--eps is missing" $M -o a.obj
refuses "mesh: no output" 2 "-o is missing" $M --eps 1
refuses "mesh: an obj cannot be quantized" 2 "a.obj is not quantized; a .glb can be" $M --eps 1 --quantized -o a.obj
refuses "mesh: an unknown ending" 2 "the file ends in" $M --eps 1 -o a.xyz
refuses "mesh: no ending" 2 "the file ends in" $M --eps 1 -o .obj
refuses "mesh: an unknown outline" 2 "there is no such outline; there are exact and tol" $M --eps 1 --outline x -o a.obj
refuses "mesh: an unknown mode" 2 "there is no such mode" $M --eps 1 --mode x -o a.obj
refuses "mesh: a list of eps for a model" 2 "--eps takes one number" $M --eps 1,2 -o a.obj
refuses "mesh: normals in a file that holds none" 2 "a.obj holds no normals; a .ply or a .glb does" $M --eps 1 --normals -o a.obj
refuses "mesh: too narrow" 2 "--width 100" $M --eps 1 --width 100 -o a.png
refuses "mesh: the database itself" 2 "is the database itself" $M --eps 1 -o ./t.gpkg
ln -s t.gpkg link.gpkg
refuses "mesh: the database by another name" 2 "is the database itself" $M --eps 1 -o link.gpkg
mkdir folder.obj
refuses "mesh: a folder" 2 "is a folder" $M --eps 1 -o folder.obj
mkfifo pipe.obj; refuses "mesh: a device" 2 "is a device" $M --eps 1 -o pipe.obj
refuses "mesh: a folder that is not there" 1 "cannot be written" $M --eps 1 -o nowhere/a.obj
for kind in obj ply glb gpkg svg png; do
    refuses "mesh: unknown terrain, .$kind" 1 "nobody" mesh t.gpkg --terrain nobody --eps 1 -o "a.$kind"
    refuses "mesh: unreadable region, .$kind" 1 "rqt mesh: " $M --eps 1 --region 'CIRCLE(1)' -o "a.$kind"
done
refuses "mesh: damaged blocks" 1 "rqt mesh: " mesh broken.gpkg --terrain hill --eps 0 -o a.obj
refuses "mesh: a picture of nothing" 1 "nothing to draw" $M --eps 1 --region 0,0,1,1 -o a.png
left=$(ls -A | grep '^a\.\|\.part-'); [ -z "$left" ]; ok "refused meshes leave no file" $? "$left"

for region in '' 1200,2200,1400,2400; do
    where=NULL; [ -n "$region" ] && where='rqt_bbox(1200,2200,1400,2400)'
    want=$(sql t.gpkg "SELECT (SELECT count(*) FROM rqt_range($where, 2, 'hill')) || ' ' ||
                              (SELECT count(*) FROM rqt_triangles($where, 2, 'hill'))")
    what=${region:-everything}
    rqt $M --eps 2 ${region:+--region $region} -o m.obj
    got="$(grep -c '^v ' m.obj) $(grep -c '^f ' m.obj)"
    [ $status = 0 ] && [ ! -s out ] && [ ! -s err ] && [ "$got" = "$want" ]
    ok "obj of $what has SQL's vertices and faces" $? "$got, not $want; $(cat err)"
    rqt $M --eps 2 ${region:+--region $region} -o m.ply
    got="$(sed -n 's/^element vertex //p' <(head -c 600 m.ply | tr -d '\0')) $(sed -n 's/^element face //p' <(head -c 600 m.ply | tr -d '\0'))"
    [ $status = 0 ] && [ "$got" = "$want" ]; ok "ply of $what has SQL's vertices and faces" $? "$got, not $want; $(cat err)"
    rqt $M --eps 2 ${region:+--region $region} -o m.gpkg
    got=$(sqlite3 m.gpkg 'SELECT count(*) FROM hill')
    [ $status = 0 ] && [ "$got" = "${want#* }" ]; ok "gpkg of $what has a row for each triangle" $? "$got, not $want; $(cat err)"
    if command -v ogrinfo >/dev/null; then
        ogrinfo -so -al m.gpkg >ogr 2>&1
        grep -q 'Geometry: 3D Polygon' ogr && grep -q "Feature Count: ${want#* }" ogr && ! grep -qi 'warning\|error' ogr
        ok "ogrinfo reads it: 3D Polygon, count" $? "$(cat ogr)"
    fi
    rm -f m.*
done
rqt $M --eps 2 --region 0,0,1,1 -o none.obj; [ $status = 0 ] && ! grep -q '^[vf] ' none.obj; ok "obj of nothing is an empty obj" $? "$(cat err)"
rqt $M --eps 2 --region 0,0,1,1 -o none.gpkg; [ $status = 0 ] && [ "$(sqlite3 none.gpkg 'SELECT count(*) FROM hill')" = 0 ]
ok "gpkg of nothing is an empty layer" $? "$(cat err)"
rqt $M --eps 2 --mode cover -o x.obj; cp x.obj first.obj; echo old >x.obj
rqt $M --eps 2 -o x.obj; cmp -s x.obj first.obj; ok "mesh replaces a file, and gives the same bytes again" $?
rqt $M --eps 2 -o X.OBJ; [ $status = 0 ] && cmp -s X.OBJ first.obj; ok "mesh: endings in capitals" $?
triangle='POLYGON((1203.5 2204,1390 2211.5,1290.25 2399,1203.5 2204))'
want=$(sql t.gpkg "SELECT count(*) FROM rqt_triangles('$triangle', 2, 'hill', '{\"mode\":\"cut\",\"outline\":\"tol\"}')")
for kind in obj ply gpkg svg png; do
    rqt $M --eps 2 --region "$triangle" --mode cut --outline tol -o cut.$kind
    case $kind in
        obj) got=$(grep -c '^f ' cut.obj) ;;
        ply) got=$(sed -n 's/^element face //p' <(head -c 600 cut.ply | tr -d '\0')) ;;
        gpkg) got=$(sqlite3 cut.gpkg 'SELECT count(*) FROM hill') ;;
        *) got=$want ;;
    esac
    [ $status = 0 ] && [ -s cut.$kind ] && [ "$got" = "$want" ] && [ "$want" -gt 20 ]
    ok "mesh: mode cut as .$kind" $? "$got, not $want; $(cat err)"
done
rqt $M --eps 2 --normals -o n.ply
sqlite3 t.gpkg -cmd ".load $RQT_SO" "SELECT writefile('sql.ply', rqt_mesh(NULL, 2, 'ply+normals', 'hill'))" >/dev/null 2>&1
[ -s n.ply ] && cmp -s n.ply sql.ply && grep -aq 'property float nz' n.ply; ok "mesh --normals: SQL's bytes, with normals" $? "$(cat err)"
if command -v gdal_translate >/dev/null; then
    gdal_translate -q -a_srs EPSG:32633 hill.asc utm.tif 2>/dev/null
    rqt import utm.tif utm.gpkg
    rqt mesh utm.gpkg --eps 2 -o crs.gpkg; ogrinfo -so -al crs.gpkg >ogr 2>&1
    grep -q 'UTM zone 33N' ogr; ok "gpkg carries the terrain's CRS" $? "$(cat ogr)"
fi

size_of() { od -An -tu1 -j16 -N8 "$1" | awk '{ print (($1 * 256 + $2) * 256 + $3) * 256 + $4, (($5 * 256 + $6) * 256 + $7) * 256 + $8 }'; }
rqt $M --eps 1,5,20 -o three.png
read -r w h <<<"$(size_of three.png)"
[ $status = 0 ] && [ ! -s out ] && [ ! -s err ] && [ "$(head -c 4 three.png | tail -c 3)" = PNG ] && [ "$w" = 1800 ] && [ "$h" -gt 400 ]
ok "png: 1800 wide" $? "$w x $h; $(cat err)"
rqt $M --eps 5 --width 1200 --region 1200,2200,1400,2400 -o one.png; read -r w h <<<"$(size_of one.png)"
[ $status = 0 ] && [ "$w" = 1200 ]; ok "png: --width 1200, a region" $? "$w x $h; $(cat err)"
rqt $M --eps 1,5,20 -o three.svg
[ $status = 0 ] && python3 - >why 2>&1 <<'PY'
import xml.dom.minidom as x
d = x.parse("three.svg").documentElement
assert d.tagName == "svg" and d.getAttribute("width").startswith("1800"), d.getAttribute("width")
assert d.getElementsByTagName("image") and d.getElementsByTagName("path")
PY
ok "svg: XML, 1800 wide, relief and lines" $? "$(cat why err)"
# libxml2, and with it librsvg, refuses 10 MB.
small_svg() { # what, arguments...
    local what=$1 size
    shift
    rqt mesh "$@" -o large.svg
    size=$(stat -c %s large.svg)
    [ $status = 0 ] && [ "$size" -lt 8000000 ] && tail -c 7 large.svg | grep -q '</svg>'
    ok "svg of $what has less than 8 000 000 bytes" $? "$size bytes; $(cat err)"
    if command -v xmllint >/dev/null; then xmllint --noout large.svg 2>why; ok "... xmllint reads it" $? "$(head -c 300 why)"; fi
    rm -f large.svg
}
rqt import --name ea "$ROOT/tests/data/eastafrica.tif" tiles.gpkg
rqt import --name mw "$ROOT/examples/N44W072.hgt.zip" tiles.gpkg
small_svg "East Africa, eps 50" tiles.gpkg --terrain ea --eps 50
small_svg "a full tile, eps 160" tiles.gpkg --terrain mw --eps 160
small_svg "a full tile, eps 20" tiles.gpkg --terrain mw --eps 20
small_svg "a full tile, six panels, 4000 wide" tiles.gpkg --terrain mw --eps 1,5,10,20,40,160 --width 4000
prints "info gives large cells in km" " km x " info tiles.gpkg
for region in 'POINT(1300 2300)' 'LINESTRING(1100 2100,1500 2400)' \
    'MULTIPOLYGON(((1100 2100,1200 2100,1200 2200,1100 2100)),((1400 2300,1500 2300,1500 2400,1400 2300)))'; do
    rqt $M --eps 2 --region "$region" -o r.png; read -r w h <<<"$(size_of r.png)"
    [ $status = 0 ] && [ "$w" = 1800 ]; ok "png of ${region%%(*}" $? "$w x $h; $(cat err)"
done
rqt mesh t.gpkg --terrain my.hole-2 --eps 2,9 -o v.png; [ $status = 0 ]; ok "png with voids" $? "$(cat err)"
if [ -w /dev/full ]; then
    "$RQT" info t.gpkg >/dev/full 2>err; [ $? = 1 ] && grep -q 'stdout' err; ok "F50 a full disk under stdout is a failure" $? "$(cat err)"
fi
[ -z "$(ls -A | grep '\.part-')" ]; ok "no temporary file is left" $?

# ----------------------------------------------------------------------------------------------------------- chart
C="chart t.gpkg --terrain hill"
refuses "chart: no database" 2 "a database is missing" chart -o c
refuses "chart: no folder" 2 "-o is missing" $C
refuses "chart: a file as folder" 2 "is not a folder" $C -o hill.asc
refuses "chart: a folder in a folder that is not there" 1 "cannot be made" $C -o nowhere/c
refuses "chart: a bad eps" 2 "is no tolerance" $C -o c --eps x
refuses "chart: a bad --at" 2 "--at -1 is no tolerance" $C -o c --at -1
refuses "chart: a bad number of runs" 2 "--runs 0 is no number from 1 to 99" $C -o c --runs 0
for m in best exact/ /topdown exact,,local exactly exact/fan ''; do
    refuses "chart: --methods '$m'" 2 "there is no method" $C -o c --methods "$m"
done
refuses "chart: a method twice" 2 "exact is given twice" $C -o c --methods exact,local,exact/threshold
[ ! -e c ]; ok "refused charts make no folder" $?
refuses "chart: two terrains and no name" 1 "my.hole-2" chart t.gpkg -o c
refuses "chart: an unknown terrain" 1 "nobody" chart t.gpkg -o c --terrain nobody
refuses "chart: a region outside" 1 "holds no sample of hill" $C -o c --region 0,0,1,1 --runs 1
refuses "chart: an unreadable region" 1 "no method could be measured" $C -o c --region 'CIRCLE(1)'
refuses "chart: damaged blocks" 1 "rqt chart: " chart broken.gpkg --terrain hill -o c --eps 0
refuses "chart: peers that are not there" 1 "nowhere.csv" $C -o c --runs 1 --eps 5 --methods exact --peers nowhere.csv
# The same figures as SQL's, in the order of eps, equal ones once; nothing on stdout.
mkdir nothing # a PATH without gnuplot
PATH=$PWD/nothing rqt $C -o c --eps 5,1,20,5 --runs 1 --methods exact,exact/topdown
[ $status = 0 ] && [ ! -s out ] && grep -q 'pictures need gnuplot' err && grep -q 'no meshes of peers' err &&
    [ "$(grep -c 'need gnuplot' err)" = 1 ] && [ -z "$(ls c | grep -v 'csv$\|gp$')" ]
ok "chart without gnuplot: CSV, one sentence, status 0" $? "$status $(cat out err; ls c)"
want="series,eps,max_error,rms_error,vertices,triangles
$(sql -csv t.gpkg "SELECT m.value, e.value, 1.0 * max_error, rms_error, vertices, triangles FROM json_each('[\"exact\",\"exact/topdown\"]') m,
     json_each('[1,5,20]') e, rqt_verify(NULL, e.value, 'hill') ORDER BY m.key, e.key" | tr -d '\r"')"
rounded() { awk -F, -v OFS=, 'NR > 1 { $3 = sprintf("%.9g", $3); $4 = sprintf("%.9g", $4) } { print }'; }
[ "$(rounded <c/1-error-vertices.csv)" = "$(rounded <<<"$want")" ]
ok "chart 1 has rqt_verify's numbers" $? "$(diff <(rounded <c/1-error-vertices.csv) <(rounded <<<"$want"))"
rqt import --block 3 --name hill hill.asc small.gpkg
rqt chart small.gpkg -o small --runs 1 --eps 5 --methods exact
bytes=$(sql small.gpkg "SELECT count(*) || ',' || sum(bytes) FROM rqt_explain(NULL, 5, 'hill')")
[ "$(awk -F, '$1 == "exact" { print $7 "," $8 }' small/3-time-error.csv)" = "$bytes" ] && [ "${bytes%,*}" -gt 10 ]
ok "chart 3 has rqt_explain's bytes" $? "$bytes; $(cat small/3-time-error.csv)"
awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) at[$i] = i; next } { n++; if (!($at["ms"] > 0 && $at["fresh_ms"] > 0 && $at["fresh_bytes"] > 0 && $at["runs"] == 1)) bad++ }
    END { exit !(n == 6 && !bad) }' c/rows.csv
ok "rows.csv has times and bytes" $? "$(cat c/rows.csv)"
# The front, worked out again.
awk -F, 'NR > 1 { ms[NR] = $3; e[NR] = $4; v[NR] = $5; front[NR] = $6; last = NR }
    END { for (i = 2; i <= last; i++) { best = 1
              for (j = 2; j <= last; j++) if (ms[j] <= ms[i] && e[j] <= e[i] && v[j] <= v[i] && (ms[j] < ms[i] || e[j] < e[i] || v[j] < v[i])) best = 0
              if (best != front[i]) wrong++ } exit wrong > 0 || last != 7 }' c/4-front.csv
ok "chart 4's front is what nothing beats" $? "$(cat c/4-front.csv)"
# Peers: rows of the same samples are added, others are not.
head='series,asked,max_error,rms_error,samples,vertices,triangles,ms'
printf '%s\nTIN,5,4.5,1.25,3500,40,60,0.5\nTIN,5,4.5,1.25,3501,40,60,0.5\n' "$head" >peers.csv
rqt $C -o c --eps 5 --runs 1 --methods exact --peers peers.csv
[ $status = 0 ] && grep -q 'meshes of 3 501 samples, and here are 3 500' err &&
    [ "$(grep -c '^TIN,' c/1-error-vertices.csv)" = 1 ] && grep -qx 'TIN,5,4.5,1.25,40,60' c/1-error-vertices.csv
ok "chart: peers of the same samples are in it" $? "$status $(cat err c/1-error-vertices.csv)"
printf '%s\nlarge,5,0.01,0.01,3500,9999,9999,0\n' "$head" >peers.csv
rqt $C -o c --eps 5 --runs 1 --methods exact --peers peers.csv
[ "$(cut -d, -f1,6 c/4-front.csv | tr '\n' ' ')" = "series,front exact,1 large,1 " ]; ok "chart 4: fewer vertices are on the front" $? "$(cat c/4-front.csv)"
printf '%s\nbest,5,0.01,0.01,3500,9,9,0\n' "$head" >peers.csv
rqt $C -o c --eps 5 --runs 1 --methods exact --peers peers.csv
[ "$(cut -d, -f1,6 c/4-front.csv | tr '\n' ' ')" = "series,front exact,0 best,1 " ]; ok "chart 4: what is worse in all is not" $? "$(cat c/4-front.csv)"
for row in 'TIN,5,4.5,1.25,3500,40,60' 'TIN,5,4.5,1.25,3500,40,60,0.5,1' 'TIN,x,4.5,1.25,3500,40,60,0.5' ',5,4.5,1.25,3500,40,60,0.5' \
    'TIN,5,-1,1.25,3500,40,60,0.5' "T'IN,5,4.5,1.25,3500,40,60,0.5"; do
    printf '%s\n%s\n' "$head" "$row" >peers.csv
    refuses "chart: peers' row $row" 1 "line 2 is no row of a peer" $C -o c --eps 5 --runs 1 --methods exact --peers peers.csv
done
echo 'a,b' >peers.csv; refuses "chart: a file of something else" 1 "is no file of peers" $C -o c --eps 5 --runs 1 --methods exact --peers peers.csv
# Families: charts 5 and 6 alone, members in the order of their numbers.
for i in 2 0.5 10; do rqt import --name "h_noise_$i" hill.asc f.gpkg; done
for i in 9 70; do rqt import --name "h_size_$i" hill.asc f.gpkg; done
rqt chart f.gpkg -o f --runs 1 --at 3 --methods exact,exact/bottomup
[ $status = 0 ] && grep -q 'charts 1 to 4 are left out' err && [ ! -e f/1-error-vertices.csv ]
ok "chart of families only" $? "$status $(cat err; ls f)"
[ "$(cut -d, -f1-4 f/5-noise.csv | tail -n +2 | tr '\n' ' ')" = "exact,h_noise_0.5,0.5,3 exact,h_noise_2,2,3 exact,h_noise_10,10,3 " ]
ok "chart 5 has a row for each noise" $? "$(cat f/5-noise.csv)"
want=$(sql f.gpkg "SELECT vertices FROM rqt_verify(rqt_bbox(1177.5, 2127.5, 1522.5, 2372.5), 3, 'h_size_9')")
[ "$(cut -d, -f5 f/6-size.csv | tail -n +2 | sort -u)" = "$want" ] && [ "$(grep -c h_size f/6-size.csv)" = 2 ]
ok "chart 6 is of the middle of what all have" $? "$want; $(cat f/6-size.csv)"
rqt import --name other hill.asc f.gpkg
rqt chart f.gpkg -o f --runs 1 --eps 3 --methods exact
[ $status = 0 ] && grep -q '^exact,3,' f/1-error-vertices.csv; ok "chart: the only terrain outside families is the one" $? "$status $(cat err)"
if command -v gnuplot >/dev/null; then
    [ ! -s out ] && ! grep -qvE '^rqt chart: ' err
    ok "gnuplot has nothing to say" $? "$(cat err)"
    for name in 1-error-vertices 2-error-eps 3-time-error 4-front 5-noise 6-size; do
        read -r w h <<<"$(size_of f/$name.png)"
        [ "$w" -ge 1100 ] && [ "$h" = 704 ] && tail -c 8 f/$name.svg | grep -q '</svg>'; ok "chart: $name.png and .svg" $? "$w x $h"
    done
fi
printf 'ncols 5\nnrows 5\nxllcorner 0\nyllcorner 0\ncellsize 1\n%s' "$(for i in 1 2 3 4 5; do echo 7 7 7 7 7; done)" >flat.asc
rqt import flat.asc flat.gpkg
rqt chart flat.gpkg -o flat --runs 1; [ $status = 0 ] && [ "$(grep -c 'no mesh has an error' err)" = 4 ] && [ -s flat/1-error-vertices.csv ]
ok "chart of a flat terrain: CSV, no pictures" $? "$status $(cat err)"

# ------------------------------------------------------------------------------------------------- read-only, locked
if [ "$(id -u)" != 0 ]; then
    chmod a-w u.gpkg; refuses "import: a read-only database" 1 "read-only" import hill.asc u.gpkg; chmod u+w u.gpkg
fi
python3 - t.gpkg <<'PY' &
import sqlite3, sys, time
db = sqlite3.connect(sys.argv[1], isolation_level=None)
db.execute("BEGIN IMMEDIATE"); open("locked", "w").close(); time.sleep(8)
PY
locker=$!
until [ -e locked ]; do sleep 0.05; done
refuses "F50 import: a locked database" 1 "locked" import --replace hill.asc t.gpkg
prints "info while another program writes" "hill" info t.gpkg
kill $locker; wait $locker 2>/dev/null

# --------------------------------------------------------------------------------------------- stopped and killed
# After a stop the database has the terrains it had before, sound, and none that looks whole and is not.
is_as_before() { # file, terrains expected
    local names
    if [ ! -e "$1" ]; then [ "$2" = "" ]; return; fi
    names=$(sqlite3 "$1" "SELECT group_concat(name) FROM (SELECT name FROM rqt_terrain WHERE complete ORDER BY name)" 2>/dev/null)
    [ "$names" = "$2" ] && "$RQT" check "$1" >check.out 2>&1
}
start=$(date +%s%N); rqt import big.bil whole.gpkg; took=$((($(date +%s%N) - start) / 1000000))
rm -f whole.gpkg
# After `wait` some time of the import has passed: parts of the whole in per cent, and the first block's writing.
stop_at() { # signal, moment, database
    "$RQT" import --name big big.bil "$3" >stop.out 2>stop.err </dev/null &
    local pid=$!
    if [ "$2" = writing ]; then
        until [ -e "$3-journal" ] || [ -e "$3-wal" ] || ! kill -0 $pid 2>/dev/null; do sleep 0.005; done
    else
        sleep "$(awk -v t="$took" -v p="$2" 'BEGIN { print t * p / 100000 }')"
    fi
    kill "-$1" $pid 2>/dev/null
    wait $pid 2>/dev/null
    status=$?
}
has_big() { [ -e "$1" ] && [ "$(sqlite3 "$1" "SELECT count(*) FROM rqt_terrain WHERE name = 'big' AND complete" 2>/dev/null)" = 1 ]; }
for moment in 10 40 70 writing; do
    for signal in INT KILL; do
        for kind in new old; do
            rm -f k.gpkg*; before=
            if [ $kind = old ]; then "$RQT" import hill.asc k.gpkg >/dev/null; before=hill; fi
            stop_at $signal $moment k.gpkg
            # It was faster than the signal, or was killed between its commit and its end.
            if [ $status = 0 ] || { [ $signal = KILL ] && has_big k.gpkg; }; then before=big${before:+,$before}; fi
            case $signal in
            INT) { [ $status = 0 ] || { [ $status = 1 ] && grep -q 'stopped while' stop.err && [ ! -s stop.out ]; }; } &&
                { [ $status = 0 ] || [ $kind = old ] || [ ! -e k.gpkg ]; } ;;
            KILL) [ $status = 0 ] || [ $status = 137 ] ;;
            esac
            ok "F49 SIG$signal at $moment, $kind database: status and sentence" $? "$status $(cat stop.err)"
            rqt info k.gpkg
            ! grep -q '^big' out || [[ $before == *big* ]]; ok "... info shows no half terrain" $? "$(cat out)"
            is_as_before k.gpkg "$before"; ok "F49 ... what was there is there, and sound" $? "expected '$before'; $(ls -l k.gpkg* 2>&1; cat check.out 2>/dev/null)"
        done
    done
done
python3 - t.gpkg <<'PY'
import shutil, sqlite3, sys # a writer that was killed when part of what it wrote was in the file
shutil.copy(sys.argv[1], "writing.gpkg")
db = sqlite3.connect("writing.gpkg", isolation_level=None)
db.executescript("PRAGMA journal_mode = DELETE; PRAGMA cache_size = 1; BEGIN; DELETE FROM rqt_terrain; CREATE TABLE x AS "
                 "WITH RECURSIVE c(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM c WHERE i < 1000) SELECT randomblob(1000) FROM c")
shutil.copy("writing.gpkg", "hot.gpkg"); shutil.copy("writing.gpkg-journal", "hot.gpkg-journal")
PY
prints "info of a database whose writer was killed rolls back" "my.hole-2" info hot.gpkg
[ ! -e hot.gpkg-journal ]; ok "... and leaves no journal" $? "$(ls -l hot*)"
rm -f f.gpkg*; (ulimit -f 2000; "$RQT" import --memory 4000 big.bil f.gpkg >out 2>err)
[ $? = 1 ] && grep -q 'f.gpkg' err && [ -z "$(ls | grep '^f.gpkg')" ]
ok "F50 import beyond the limit of file sizes: a sentence, and nothing left" $? "$(cat out err; ls -l f.gpkg* 2>&1)"
rqt import --name big --replace big.bil k.gpkg; [ $status = 0 ]; ok "importing again works after all that" $? "$(cat err)"
rqt check k.gpkg; [ $status = 0 ] && grep -q '^big: sound' out; ok "... and is sound" $? "$(cat out err)"
"$RQT" mesh k.gpkg --terrain big --eps 0 -o stopped.gpkg 2>/dev/null & pid=$!
until ls stopped.gpkg.part-* >/dev/null 2>&1 || ! kill -0 $pid 2>/dev/null; do sleep 0.01; done
kill -TERM $pid 2>/dev/null; wait $pid 2>/dev/null
left=$(ls -A | grep '^stopped'); [ -z "$left" ]; ok "mesh stopped half-way leaves no file" $? "$left"

echo "$passed passed, $failed failed"
[ "$failed" = 0 ]
