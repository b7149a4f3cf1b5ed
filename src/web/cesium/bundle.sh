#!/bin/sh
# bundle.sh [--with-checks] OUT PACKAGES WORKER... - puts the page /cesium of rqt serve together: OUT/cesium.html, cesium.css, cesium.js,
# WORKER.js, which are those of Cesium's workers that terrain needs, and cesium-licence.md, from the modules beside this
# script and the npm packages of package-lock.json, which are kept in the directory PACKAGES.
#
# --with-checks: with Cesium's checks for developers, which its releases come without; for tests, as whoever puts Cesium's
# modules together with tools of their own has them.
#
# Where node, npm or the registry is missing, the page says so (../without.js), and so does this script; all else of the
# service is the same. The next `make` tries again.
set -eu
kind=released
if [ "$1" = --with-checks ]; then kind=engine; shift; fi
out=$1 packages=$2
shift 2
here=$(cd "$(dirname "$0")" && pwd)
workers=$*
files="$out/cesium.html $out/cesium.css $out/cesium.js $out/cesium-licence.md"
for worker in $workers; do files="$files $out/$worker.js"; done
mkdir -p "$out" "$packages"
cp "$here/cesium.html" "$here/cesium.css" "$out/"

without() {
    echo "bundle.sh: $1; rqt serve goes without its page /cesium" >&2
    for script in cesium $workers; do
        cp "$here/../without.js" "$out/$script.js"
    done
    echo "This rqt was built without Cesium." >"$out/cesium-licence.md"
    touch -d 2000-01-01 $files
    exit 0
}

# Cesium's sources have checks for developers, between marks, that its own releases come without; and so does this: a copy
# beside the package, where it finds the packages that it needs.
strip() {
    rm -rf "$2"
    mkdir "$2"
    cp -R "$1/Source" "$1/index.js" "$1/package.json" "$2/"
    find "$2/Source" -name '*.js' -exec sed -i '/^ *\/\/>>includeStart(.debug/,/^ *\/\/>>includeEnd(.debug/d' {} +
}
command -v node >/dev/null 2>&1 && command -v npm >/dev/null 2>&1 || without "node or npm is missing (Debian: nodejs, npm)"
if ! cmp -s "$here/package-lock.json" "$packages/installed.json" || [ ! -d "$packages/node_modules/@cesium/released" ]; then
    cp "$here/package.json" "$here/package-lock.json" "$here/.npmrc" "$packages/"
    (cd "$packages" && npm ci --ignore-scripts --no-audit --no-fund >npm.log 2>&1) ||
        without "npm cannot install @cesium/engine and esbuild ($packages/npm.log)"
    strip "$packages/node_modules/@cesium/engine" "$packages/node_modules/@cesium/released"
    cp "$here/package-lock.json" "$packages/installed.json"
fi
# Modules are looked for beside the packages, so that none need lie in the source tree. Each worker is one file, as a
# browser loads it.
engine=$packages/node_modules/@cesium/$kind
bundle() {
    NODE_PATH=$packages/node_modules node "$packages/node_modules/esbuild/bin/esbuild" "$@" --bundle --minify --format=iife --target=es2020 \
        --charset=utf8 --legal-comments=eof --log-level=error --outdir="$out" \
        --alias:@cesium/engine=@cesium/$kind --alias:meshoptimizer="$here/without_wasm.js" --alias:@spz-loader/core="$here/without_wasm.js"
}
for worker in $workers; do
    bundle "$engine/Source/Workers/$worker.js"
done
cp "$packages/node_modules/@cesium/engine/LICENSE.md" "$out/cesium-licence.md"
bundle cesium="$here/main.js"
# To make they are one: as old as each other.
touch -r "$out/cesium.js" $files
