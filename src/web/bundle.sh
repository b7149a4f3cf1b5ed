#!/bin/sh
# bundle.sh OUT PACKAGES - puts the page of rqt serve together: OUT/index.html, viewer.css, viewer.js and decoder.js, from
# the modules beside this script and the npm packages of package-lock.json, which are kept in the directory PACKAGES.
#
# Where node, npm or the registry is missing, the page says so in place of the viewer (without.js), and so does this
# script; all else of the service is the same. The next `make` tries again.
set -eu
out=$1 packages=$2
here=$(dirname "$0")
files="$out/index.html $out/viewer.css $out/viewer.js $out/decoder.js"
mkdir -p "$out" "$packages"
cp "$here/index.html" "$here/viewer.css" "$out/"

without() {
    echo "bundle.sh: $1; rqt serve goes without its viewer" >&2
    for script in viewer decoder; do
        cp "$here/without.js" "$out/$script.js"
    done
    touch -d 2000-01-01 $files
    exit 0
}

command -v node >/dev/null 2>&1 && command -v npm >/dev/null 2>&1 || without "node or npm is missing (Debian: nodejs, npm)"
if ! cmp -s "$here/package-lock.json" "$packages/installed.json"; then
    cp "$here/package.json" "$here/package-lock.json" "$here/.npmrc" "$packages/"
    (cd "$packages" && npm ci --ignore-scripts --no-audit --no-fund >npm.log 2>&1) ||
        without "npm cannot install three and esbuild ($packages/npm.log)"
    cp "$here/package-lock.json" "$packages/installed.json"
fi
# Modules are looked for beside the packages, so that none need lie in the source tree.
NODE_PATH=$packages/node_modules node "$packages/node_modules/esbuild/bin/esbuild" viewer="$here/main.js" decoder="$here/decoder.js" \
    --bundle --minify --format=iife --target=es2020 --charset=utf8 --legal-comments=eof --log-level=warning --outdir="$out"
# To make they are one: as old as each other.
touch -r "$out/viewer.js" $files
