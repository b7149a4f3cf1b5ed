#!/bin/bash
# test_serve.sh [quiet] - the query service: against SQL's own answers, and against those who mean it harm. Ends with
# `N passed, N failed`. quiet: of what passed only how much.
set -u
cd "$(dirname "$0")/.." || exit 1
export RQT=${RQT:-$PWD/build/rqt} RQT_SO=${RQT_SO:-$PWD/build/rqt.so} PYTHONDONTWRITEBYTECODE=1
hidden='^[0-9]+ passed, [0-9]+ failed$'
[ "${1:-}" = quiet ] && hidden="$hidden|^ok"
passed=0 failed=0
for program in tests/test_serve.py tests/test_serve_hostile.py; do
    output=$("${PYTHON:-/usr/bin/python3}" "$program" 2>&1 </dev/null)
    status=$?
    grep -vE "$hidden" <<<"$output"
    counts=$(grep -E '^[0-9]+ passed, [0-9]+ failed$' <<<"$output" | tail -n 1)
    p=${counts%% *} f=${counts#*, }
    f=${f%% *}
    if [ -z "$counts" ] || { [ "$status" != 0 ] && [ "$f" = 0 ]; }; then
        echo "FAILED $program ended badly, with status $status"
        f=$((${f:-0} + 1))
    fi
    passed=$((passed + ${p:-0})) failed=$((failed + f))
done
echo "$passed passed, $failed failed"
[ "$failed" = 0 ]
