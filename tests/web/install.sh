#!/bin/bash
# install.sh - puts what the tests of the page take from npm into build/web-tests, unless it is there: the packages that
# package-lock.json names, and deck.gl.
#
# Of deck.gl it is the script that pages load, all in one, and the worker and the decoders of its loaders: three files of
# two packages, whose sums are in deckgl.sha512, without the hundred and forty packages that those name.
set -eu
cd "$(dirname "$0")/../.."
packages=build/web-tests deckgl=build/web-tests/deckgl
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
if ! cmp -s tests/web/deckgl.sha512 "$deckgl/installed.sha512"; then
    rm -rf "$deckgl"
    mkdir "$deckgl"
    sums=$PWD/tests/web/deckgl.sha512
    unpack() { # package, files
        local archive=$1
        shift
        tar -xzf "$archive"-*.tgz --strip-components=1 "${@/#/package/}" && rm "$archive"-*.tgz
    }
    (
        cd "$deckgl" && npm pack deck.gl@9.4.0 @loaders.gl/terrain@4.4.3 && sha512sum -c "$sums" &&
            unpack deck.gl dist.min.js && unpack loaders.gl-terrain dist/dist.min.js dist/terrain-worker.js
    ) >"$packages/npm.log" 2>&1 || fail deck.gl
    cp tests/web/deckgl.sha512 "$deckgl/installed.sha512"
fi
