#!/bin/bash
# test_cli_national.sh - imports of many tiles as a user meets them: hundreds of tiles within few descriptors and the
# memory that is promised, Ctrl-C, kill -9 and a full disk that cost nothing that was read, what the options say.
#
# $RQT names the command (default build/rqt), $RQT_SO the extension (default: rqt.so beside it). Makes its own rasters.
set -u
RQT=$(realpath "${RQT:-build/rqt}")
RQT_SO=${RQT_SO:-$(dirname "$RQT")/rqt.so}
ROOT=$(realpath "$(dirname "$0")/..")
T=$(mktemp -d)
trap 'rm -rf "$T"' EXIT
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
rqt() { "$RQT" "$@" >out 2>err </dev/null; status=$?; }
refuses() { # what, expected status, part of stderr, arguments...
    local what=$1 expected=$2 phrase=$3
    shift 3
    rqt "$@"
    [ $status = "$expected" ] && [ ! -s out ] && grep -qF -- "$phrase" err
    ok "$what" $? "status $status, not $expected; stderr without '$phrase': $(cat err)"
}
tables() { # what a terrain's tables hold, as one number
    sqlite3 "$1" "SELECT quote(summary), quote(data) FROM rqt_block_1; SELECT * FROM rqt_index_1;
        SELECT width, height, k, x0, y0, dx, dy, voids, min_q, max_q, blocks, bytes, max_error FROM rqt_terrain" | cksum
}

# ------------------------------------------------------------------------------------------------------- options
/usr/bin/python3 - <<'PY'
import math, os, struct
def write(name, x, y, width, height, z):
    with open(name + ".bil", "wb") as f:
        for v in range(height):
            f.write(struct.pack("<%dh" % width, *[z(x + u, y + v) for u in range(width)]))
    with open(name + ".hdr", "w") as f:
        f.write("NROWS %d\nNCOLS %d\nNBANDS 1\nNBITS 16\nPIXELTYPE SIGNEDINT\nBYTEORDER I\nLAYOUT BIL\nNODATA -9999\n"
                "ULXMAP %d\nULYMAP %d\nXDIM 10\nYDIM 10\n" % (height, width, 10 * x, -10 * y))
hill = lambda x, y: int(400 + 90 * math.sin(x * .02) * math.cos(y * .03)) + (x * 7 + y * 13) % 5
os.mkdir("tiles")
for j in range(30):
    for i in range(30):
        write("tiles/t%02d-%02d" % (j, i), 16 * i, 16 * j, 17, 17, hill)
write("whole", 0, 0, 481, 481, hill)
write("holes", 0, 0, 60, 50, lambda x, y: -9999 if (20 <= x < 25 and 20 <= y < 25) or x + y < 15 else hill(x, y))
PY
for bad in 0 -1 256 2.5 x; do refuses "import: --fill $bad" 2 "--fill $bad: a radius in samples" import --fill $bad whole.bil x.gpkg; done
refuses "import: --sea deep" 2 "--sea deep is no height in metres" import --sea deep whole.bil x.gpkg
refuses "import: --report without a name" 2 "--report needs the name of a file" import --report '' whole.bil x.gpkg
refuses "import: a folder without rasters" 1 "bin is a folder without rasters" import bin x.gpkg
refuses "import: a list that is not there" 1 "nothing.txt, a list of sources, cannot be read" import @nothing.txt x.gpkg
printf 'whole.bil\ntiles/absent.bil\n' >list.txt
refuses "import: a list names the line of what is missing" 1 "list.txt, line 2: tiles/absent.bil: No such file" import @list.txt x.gpkg
refuses "import: a report in a folder that is not there" 1 "cannot be written" import --report nowhere/r.geojson whole.bil x.gpkg
refuses "import: a report that would be the database" 1 "./x.gpkg is the database or a source" import --report ./x.gpkg whole.bil x.gpkg
mkfifo pipe.geojson
refuses "import: a report in place of a device" 1 "pipe.geojson cannot be written: it is a device" import --report pipe.geojson whole.bil x.gpkg
[ -p pipe.geojson ] && [ ! -e pipe.geojson.part ]; ok "... which stays one" $?
refuses "import: a report in place of a folder" 1 "tiles cannot be written: it is a folder" import --report tiles whole.bil x.gpkg
[ ! -e x.gpkg ]; ok "refused imports leave no database" $?
printf '\357\273\277whole.bil\r\n' >windows.txt
rqt import @windows.txt x.gpkg
[ $status = 0 ] && rm -f x.gpkg; ok "a list from Windows, with its byte order mark" $? "$(cat err)"

rqt import --fill 2 --sea -3 holes.bil holes.gpkg
[ $status = 0 ] && grep -q '25 void samples filled' out && grep -q '120 void samples made sea' out
ok "import says what was filled" $? "$(cat out err)"
rqt info holes.gpkg
grep -q 'filled   25 void samples' out && grep -q 'sea      120 void samples' out; ok "info says it too" $? "$(cat out err)"
rqt info --json holes.gpkg; grep -q '"filled":.*25' out && grep -q '"sea":.*120' out; ok "... and in JSON" $? "$(cat out)"
rqt check holes.gpkg; [ $status = 0 ]; ok "check: sound" $? "$(cat out err)"
[ "$(sqlite3 holes.gpkg 'SELECT sum(col1 - col0 + 1) FROM rqt_fill_1 WHERE kind = 1')" = 25 ]; ok "SQL finds what was filled" $?
# A clear view of the sea through SQL: its height, and that nothing is void.
sqlite3 holes.gpkg -cmd ".load $RQT_SO" 'SELECT rqt_height(0, 0), voids FROM rqt_terrains' >out; [ "$(cat out)" = '-3.0|0' ]
ok "the sea lies where it was wished" $? "$(cat out)"
rqt import --void-tol 4 holes.bil tol.gpkg
[ "$(sqlite3 tol.gpkg 'SELECT void_tol FROM rqt_terrain')" = 4.0 ]; ok "--void-tol is stored" $?

# --------------------------------------------------------------------------------------- 900 tiles, 64 descriptors
rqt import whole.bil whole.gpkg
want=$(tables whole.gpkg)
(ulimit -n 64; exec "$RQT" import --report faults.geojson tiles tiles.gpkg) >out 2>err; status=$?
[ $status = 0 ] && grep -q '260 100 samples read from 900 sources' out; ok "900 tiles with 64 descriptors" $? "$(cat out err)"
[ "$(tables tiles.gpkg)" = "$want" ]; ok "... make the terrain of the whole raster" $?
! grep -q Feature\" faults.geojson && grep -q '"samples_read":260100' faults.geojson; ok "... without faults" $? "$(head -c 400 faults.geojson)"
if ! grep -q __asan_init "$RQT"; then # a sanitizer takes memory of its own
    rqt import --memory 1 tiles x.gpkg # describes them, and says what it needs
    need=$(sed -n 's/.* need \([0-9]*\) MiB.*/\1/p' err)
    rm -f x.gpkg
    peak=$(/usr/bin/python3 -c 'import resource, subprocess, sys
subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, check=True)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss // 1024)' "$RQT" import --memory "$need" tiles x.gpkg)
    [ "$peak" -gt 0 ] && [ "$peak" -le "$need" ]; ok "900 tiles take no more memory than is said" $? "$peak MiB, not $need"
    rm -f x.gpkg
fi

# ------------------------------------------------------------------------------------- stopped, killed, a full disk
# 1500 x 1500 samples of noise in 9 tiles, so that a strip weighs something.
mkdir noise
head -c 501000 /dev/urandom >seed
for j in 0 1 2; do
    for i in 0 1 2; do
        tail -c +$((1 + 2 * (j * 3 + i))) seed | head -c 500000 >noise/n$j$i.bil
        printf 'NROWS 500\nNCOLS 500\nNBANDS 1\nNBITS 16\nPIXELTYPE SIGNEDINT\nBYTEORDER I\nLAYOUT BIL\nULXMAP %d\nULYMAP %d\nXDIM 10\nYDIM 10\n' \
            $((5000 * i)) $((-5000 * j)) >noise/n$j$i.hdr
    done
done
rqt import noise noise.gpkg; want=$(tables noise.gpkg)
spool=n.gpkg.noise.rqt-import
# Starts an import and sends it a signal when the resume file has a strip or two; $status, out, err.
interrupted() { # signal
    rm -f n.gpkg
    "$RQT" import --resumable noise n.gpkg >out 2>err </dev/null &
    local import=$!
    while kill -0 $import 2>/dev/null && [ "$(cat $spool 2>/dev/null | wc -c)" -lt 500000 ]; do :; done
    kill -"$1" $import 2>/dev/null
    wait $import 2>/dev/null
    status=$?
    # The signal may come when all is written, on a busy machine: then the import was quicker.
    [ ! -s n.gpkg ] || [ "$(sqlite3 n.gpkg 'SELECT count(*) FROM rqt_terrain' 2>/dev/null)" != 1 ] || status=0
}
resumes() { # what
    rqt import --resumable noise n.gpkg
    local read earlier
    read=$(sed -n 's/^  \([0-9 ]*\) samples read from.*/\1/p' out | tr -d ' ')
    earlier=$(sed -n 's/.*sources; \([0-9 ]*\) from an earlier run/\1/p' out | tr -d ' ')
    [ $status = 0 ] && [ "${earlier:-0}" -gt 0 ] && [ $((read + earlier)) = 2250000 ]
    ok "$1: nothing is read twice" $? "$read and $earlier; $(cat out err)"
    grep -q "goes on after row .* of 1500" err; ok "$1: it says where it goes on" $? "$(cat err)"
    [ "$(tables n.gpkg)" = "$want" ] && [ ! -e $spool ]; ok "$1: the same terrain, and no file is left" $?
}
interrupted INT
if [ $status = 0 ]; then
    echo "skipped Ctrl-C: the import was quicker"
else
    [ $status = 1 ] && grep -q "stopped while .*; the database is as it was; what was read is in $spool: the same command goes on from there" err && [ ! -e n.gpkg ]
    ok "Ctrl-C keeps what was read and says so" $? "status $status: $(cat out err)"
    resumes "after Ctrl-C"
fi
interrupted KILL
if [ $status = 0 ]; then echo "skipped kill -9: the import was quicker"; else resumes "after kill -9"; fi
rm -f n.gpkg
(ulimit -f 2000; exec "$RQT" import --resumable noise n.gpkg) >out 2>err; status=$?
[ $status = 1 ] && grep -q "the resume file $spool cannot be written: the disk is full" err && [ ! -e n.gpkg ]
ok "a full disk gets a sentence" $? "status $status: $(cat out err)"
resumes "after a full disk"
rm -f n.gpkg
echo precious >$spool
refuses "a file of another kind is not touched" 1 "$spool is in the way" import --resumable noise n.gpkg
[ "$(cat $spool)" = precious ]; ok "... and holds what it held" $?
rm -f $spool

# ------------------------------------------------------------------------------------------------------ the example
if command -v gdal_translate >/dev/null && command -v gdalbuildvrt >/dev/null; then
    OUT=$T/national "$ROOT/examples/national-import.sh" >out 2>err; status=$?
    [ $status = 0 ] && [ "$(grep -c 'pyrenees: sound' out)" = 2 ] && grep -q 'the same command goes on from there' out &&
        grep -q '; 926 481 from an earlier run' out && grep -q '80 189 samples put in' out && grep -q 'conflict │ 6 ' out && grep -q 'gap      │ 1 ' out &&
        grep -q 'a gap inside the terrain: no source covers columns 800 to 999, rows 1400 to 1599' err
    ok "examples/national-import.sh runs" $? "status $status: $(cat out err)"
    (cd national && RQT=$RQT RQT_SO=$RQT_SO "$ROOT/examples/national-import.sh" mended small.gpkg --name two) >out 2>err; status=$?
    [ $status = 0 ] && grep -q 'two: sound' out && [ -s national/small.gpkg ] && [ -s national/small-faults.geojson ]
    ok "... with a folder and a database of one's own, from where one stands" $? "status $status: $(cat out err)"
    (cd national && RQT=$RQT RQT_SO=$RQT_SO "$ROOT/examples/national-import.sh" mended small.gpkg --name two) >out 2>err; status=$?
    [ $status = 1 ] && grep -q 'already' err && [ "$(sqlite3 national/small.gpkg 'SELECT name FROM rqt_terrain')" = two ]
    ok "... and leaves a database alone that is there" $? "status $status: $(cat out err)"
fi
echo "$passed passed, $failed failed"
[ $failed = 0 ]
