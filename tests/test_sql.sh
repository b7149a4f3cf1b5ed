#!/bin/bash
# test_sql.sh - the SQL functions in their hosts: scripts of statements with expected rows (tests/sql/*.sql), and programs that
# check answers against computations of their own (tests/test_sql_*.py). Ends with `N passed, N failed`.
#
# RQT and RQT_SO name the command and the extension (default: build/rqt, build/rqt.so). Needs sqlite3, gdal-bin,
# mod_spatialite and a python3 whose sqlite3 loads extensions: Debian's, not any that is first in the PATH.
set -u
cd "$(dirname "$0")/.." || exit 1
export RQT=${RQT:-$PWD/build/rqt} RQT_SO=${RQT_SO:-$PWD/build/rqt.so}
PYTHON=${PYTHON:-/usr/bin/python3}
temporary=$(mktemp -d) || exit 1
trap 'rm -rf "$temporary"' EXIT
export TMPDIR=$temporary PYTHONDONTWRITEBYTECODE=1
passed=0 failed=0

for file in "$RQT" "$RQT_SO"; do
    [ -e "$file" ] && continue
    echo "FAILED $file is missing: make builds it"
    echo "0 passed, 1 failed"
    exit 1
done

run() { # title command...
    local title=$1 status counts p f start=$SECONDS
    shift
    "$@" >"$temporary/log" 2>&1 </dev/null
    status=$?
    # The sum at the end is for us; more than one such line in our output would count twice.
    counts=$(grep -E '^[0-9]+ passed, [0-9]+ failed$' "$temporary/log" | tail -n 1)
    grep -vE '^[0-9]+ passed, [0-9]+ failed$' "$temporary/log"
    p=${counts%% *} f=${counts#*, }
    f=${f%% *}
    if [ -z "$counts" ] || { [ "$status" != 0 ] && [ "$f" = 0 ]; }; then
        echo "FAILED $title ended badly, with status $status"
        f=$((${f:-0} + 1))
    fi
    passed=$((passed + ${p:-0})) failed=$((failed + f))
    echo "-- $title: ${p:-0} passed, $f failed in $((SECONDS - start)) s"
}

run "tests/sql" "$PYTHON" tests/sql_runner.py tests/sql/*.sql
run "sql" "$PYTHON" tests/sql_runner.py sql/views.sql sql/layer.sql sql/recipes/*.sql
for program in tests/test_sql_*.py; do
    run "$program" "$PYTHON" "$program"
done
echo "$passed passed, $failed failed"
[ "$failed" = 0 ]
