#!/bin/bash
# lint.sh - clang-tidy (.clang-tidy says what it looks for, and why not for the rest) and cppcheck over src and ext; ends with
# `N passed, N failed`, a pass being a source without a finding. FLAGS: as the sources are compiled.
#
# A finding that is none: for clang-tidy, a comment in place with its reason, `reason. NOLINT(check)`; for cppcheck, a line with its reason in
# tests/cppcheck.txt.
set -u
cd "$(dirname "$0")/.." || exit 1
export FLAGS
BUILD=${BUILD:-build}
logs=$BUILD/lint
rm -rf "$logs" && mkdir -p "$logs"
export logs

tidy() {
    local standard=gnu11 log=$logs/${1//\//_}.log
    [[ $1 == *.cpp ]] && standard=c++17
    # shellcheck disable=SC2086
    if clang-tidy-14 --quiet "$1" -- -std=$standard $FLAGS >"$log" 2>"$log.err"; then
        echo "ok $1"
    else
        echo "FAILED $1"
        grep -E '(error|warning): ' "$log" "$log.err" | sed -e "s|$PWD/||" -e 's/,-warnings-as-errors//' -e 's/^[^:]*\.log\(\.err\)\?://' -e 's/^/    /' | sort -u | head -n 20
    fi
}
export -f tidy
sources=$(ls src/*/*.c src/tiles/*/*.c src/geo/*.cpp ext/*.c)
said=$({
    # The largest first. cppcheck is one more source: it takes as long as a few.
    # shellcheck disable=SC2086
    ls -S $sources
} | xargs -P 2 -n 1 bash -c 'tidy "$0"')
grep -v '^ok' <<<"$said"
passed=$(grep -c '^ok' <<<"$said") failed=$(grep -c '^FAILED' <<<"$said")

# shellcheck disable=SC2086
if cppcheck --enable=warning,performance,portability --inline-suppr --quiet -j 2 --std=c11 --language=c --error-exitcode=1 \
    --suppressions-list=tests/cppcheck.txt --suppress=unmatchedSuppression \
    -DSQLITE_CORE -D__x86_64__ -D__GNUC__ $(printf '%s\n' $FLAGS | grep -E '^-I(src|ext|build)') src/*/*.c src/tiles/*/*.c ext/*.c >"$logs/cppcheck.log" 2>&1; then
    passed=$((passed + 1))
else
    failed=$((failed + 1))
    echo "FAILED cppcheck"
    grep -E '(error|warning|style|performance|portability): ' "$logs/cppcheck.log" | sed 's/^/    /' | sort -u
fi
echo "$passed passed, $failed failed"
[ "$failed" = 0 ]
