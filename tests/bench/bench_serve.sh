#!/usr/bin/env bash
# bench_serve.sh - the query service under wrk, beside nginx that sends the same bytes from files: requests a second and
# the 99th percentile, SECONDS=5 each, 16 connections, everything (wrk too) on two cores.
#
# Each kind of request is asked in 64 variants over the demo terrain in turn, so that no answer follows itself; nginx has
# the 64 answers as files (sendfile, no log). Needs wrk and nginx (install-packages.sh bench).
set -euo pipefail
cd "$(dirname "$0")/../.."
BUILD=${BUILD:-build}
SECONDS_EACH=${SECONDS_EACH:-5}
CONNECTIONS=${CONNECTIONS:-16}
OUT=$PWD/$BUILD/bench/serve
rm -rf "$OUT"
mkdir -p "$OUT/www"
on_two=(taskset -c 0,1)

"$BUILD/rqt" import --name hills examples/N44W072.hgt.zip "$OUT/hills.gpkg" >/dev/null 2>&1
"${on_two[@]}" "$BUILD/rqt" serve --port 0 --workers 2 "$OUT/hills.gpkg" >"$OUT/url" &
service=$!
nginx=
trap 'kill $service $nginx 2>/dev/null; wait 2>/dev/null' EXIT
until [ -s "$OUT/url" ]; do sleep 0.05; done
url=$(cat "$OUT/url")

cat >"$OUT/nginx.conf" <<CONF
worker_processes 2; daemon off; pid $OUT/nginx.pid; error_log $OUT/nginx.log; user root;
events { worker_connections 256; }
http { access_log off; sendfile on; tcp_nopush on; keepalive_requests 1000000000; open_file_cache max=1000;
  client_body_temp_path $OUT/t1; proxy_temp_path $OUT/t2; fastcgi_temp_path $OUT/t3; uwsgi_temp_path $OUT/t4; scgi_temp_path $OUT/t5;
  server { listen 127.0.0.1:18099; root $OUT/www; } }
CONF
"${on_two[@]}" nginx -c "$OUT/nginx.conf" &
nginx=$!

# The 64 variants of a kind: places on a grid of 8 x 8 over the terrain.
variants() { # kind
    /usr/bin/python3 - "$1" <<'PY'
import json, sys, urllib.parse
kind = sys.argv[1]
for i in range(64):
    x, y = -71.9 + i % 8 * 0.1, 44.1 + i // 8 * 0.1
    box = "%.3f,%.3f,%.3f,%.3f" % (x, y, x + 0.1, y + 0.08)
    camera = json.dumps({"eye": [x, y, 2500], "at": [x + 0.1, y + 0.1, 500], "fovy": 45, "width": 1024, "height": 768, "tau": 4})
    query = {"rqt": {"bbox": box, "eps": 10, "f": "rqt"}, "obj": {"bbox": box, "eps": 10, "f": "obj"}, "json": {"bbox": box, "eps": 10},
             "strip": {"bbox": box, "eps": 10, "f": "strip"}, "view": {"camera": camera, "f": "rqt"}, "height": {"x": x, "y": y}}[kind]
    path = {"view": "view", "height": "height"}.get(kind, "range")
    print("/collections/hills/%s?%s" % (path, urllib.parse.urlencode(query)))
PY
}

measure() { # url file-of-paths headers...: requests a second, p99 in milliseconds, failures
    cat >"$OUT/ask.lua" <<LUA
local paths, n = {}, 0
for line in io.lines("$2") do paths[#paths + 1] = line end
function request() n = n % #paths + 1; return wrk.format("GET", paths[n]) end
LUA
    "${on_two[@]}" wrk -t1 -c"$CONNECTIONS" -d"${SECONDS_EACH}s" --latency -s "$OUT/ask.lua" "${@:3}" "$1" >"$OUT/wrk.txt"
    awk '/Requests\/sec/ { rps = $2 } $1 == "99%" { p = $2 } /Non-2xx/ { bad = $NF } /Socket errors/ { bad = bad " " $0 }
         END { v = p + 0; if (p ~ /us$/) v /= 1000; else if (p !~ /ms$/) v *= 1000; printf "%d %.2f %s\n", rps, v, bad }' "$OUT/wrk.txt"
}

# shellcheck disable=SC2046
row() { # title rqt-figures nginx-figures bytes
    printf '%-34s %9s %9s %9s %9s %9s %s\n' "$@"
}
row "request" "bytes" "req/s" "p99 ms" "nginx/s" "p99 ms" ""
for kind in height rqt strip obj json view; do
    variants "$kind" >"$OUT/paths"
    mkdir "$OUT/www/$kind" # nginx keeps files open by their names
    n=0
    while read -r path; do
        curl -sf "${url%/}$path" -o "$OUT/www/$kind/$n"
        echo "/$kind/$n"
        n=$((n + 1))
    done <"$OUT/paths" >"$OUT/files"
    bytes=$(($(cat "$OUT/www/$kind"/* | wc -c) / n))
    read -r rps p99 bad < <(measure "${url%/}" "$OUT/paths")
    read -r static static99 static_bad < <(measure http://127.0.0.1:18099 "$OUT/files")
    case $kind in height) what="a height" ;; view) what="a view, tau 4 px, rqt" ;; *) what="range 8 km, eps 10 m, $kind" ;; esac
    row "$what" "$bytes" "$rps" "$p99" "$static" "$static99" "$bad$static_bad"
done
head -n 1 "$OUT/paths" >"$OUT/one"
etag=$(curl -sI "${url%/}$(cat "$OUT/one")" | tr -d '\r' | sed -n 's/^ETag: //p')
read -r rps p99 bad < <(measure "${url%/}" "$OUT/one" -H "If-None-Match: $etag")
row "the last one again, not modified" 0 "$rps" "$p99" "-" "-" ""
grep -m1 'model name' /proc/cpuinfo | sed 's/.*: /two cores of /'
