#!/bin/bash
# install.sh - puts what the tests of the page take from npm into build/web-tests, unless it is there: the packages that
# package-lock.json names, and deck.gl.
#
# Of deck.gl it is the script that pages load, all in one, and the worker that this script loads: two packages without the
# hundred and forty that they name, from which the script was made. Their sums are in deckgl.sha512.
set -eu
cd "$(dirname "$0")/../.."
packages=build/web-tests
mkdir -p "$packages"
fail() {
    cat "$packages/npm.log"
    echo "tests/web/install.sh: npm could not install $1"
    exit 1
}
if ! cmp -s tests/web/package-lock.json "$packages/installed.json"; then
    cp tests/web/package.json tests/web/package-lock.json tests/web/.npmrc "$packages/"
    (cd "$packages" && npm ci --ignore-scripts --no-audit --no-fund >npm.log 2>&1) || fail "playwright-core and gltf-validator"
    cp tests/web/package-lock.json "$packages/installed.json"
fi
if ! cmp -s tests/web/deckgl.sha512 "$packages/deckgl/installed.sha512"; then
    rm -rf "$packages/deckgl"
    mkdir "$packages/deckgl"
    cp tests/web/deckgl.sha512 tests/web/.npmrc "$packages/deckgl/"
    (
        unpack() { mkdir "$1" && tar -xzf "$1"-*.tgz -C "$1" --strip-components=1; }
        cd "$packages/deckgl" && npm pack deck.gl@9.4.0 @loaders.gl/terrain@4.4.3 && sha512sum -c deckgl.sha512 &&
            unpack deck.gl && unpack loaders.gl-terrain
    ) >"$packages/npm.log" 2>&1 || fail deck.gl
    mv "$packages/deckgl/deckgl.sha512" "$packages/deckgl/installed.sha512"
fi
