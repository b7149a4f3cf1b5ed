#!/bin/bash
# install.sh - puts the npm packages that package-lock.json names into build/web-tests, unless they are there.
set -eu
cd "$(dirname "$0")/../.."
packages=build/web-tests
mkdir -p "$packages"
if ! cmp -s tests/web/package-lock.json "$packages/installed.json"; then
    cp tests/web/package.json tests/web/package-lock.json tests/web/.npmrc "$packages/"
    if ! (cd "$packages" && npm ci --ignore-scripts --no-audit --no-fund >npm.log 2>&1); then
        cat "$packages/npm.log"
        echo "tests/web/install.sh: npm could not install playwright-core and gltf-validator"
        exit 1
    fi
    cp tests/web/package-lock.json "$packages/installed.json"
fi
