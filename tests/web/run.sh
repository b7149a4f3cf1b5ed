#!/bin/bash
# run.sh [FILE...] - the tests of the page: runs node's test runner over tests/web/*.test.mjs (or over FILEs) and ends with
# `N passed, N failed`.
#
# What the tests draw is in build/web-shots, that of failed tests under its test's name; it is listed at the end.
set -u
cd "$(dirname "$0")/../.." || exit 1
packages=build/web-tests
export WEB_SHOTS=$PWD/build/web-shots
mkdir -p "$packages" && rm -rf "$WEB_SHOTS" && mkdir -p "$WEB_SHOTS"

./tests/web/install.sh || { echo "0 passed, 1 failed"; exit 1; }
[ $# != 0 ] || set -- tests/web/*.test.mjs
node --test --test-reporter=spec --test-reporter-destination=stdout --test-reporter=tap \
    --test-reporter-destination="$packages/results.tap" "$@"
status=$?
ls -l "$WEB_SHOTS" | awk 'NR > 1 { printf "%10d  build/web-shots/%s\n", $5, $9 }'
# The sums at the end of the runner's report. A run that ends badly without naming a test, or in which none ran, has failed.
count() { sed -n "s/^# $1 \([0-9]*\)\$/\1/p" "$packages/results.tap" | tail -n 1; }
passed=$(count pass) failed=$(($(count fail) + $(count cancelled)))
if [ $failed = 0 ] && { [ $status != 0 ] || [ "${passed:-0}" = 0 ]; }; then failed=1; fi
echo "${passed:-0} passed, $failed failed"
[ $failed = 0 ]
