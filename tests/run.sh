#!/bin/bash
# run.sh [quick] - runs every test program and script, and ends with `N passed, N failed`.
#
# A cmocka program says `[  PASSED  ] n` and `[  FAILED  ] n`, a script `N passed, N failed`; both are counted. A program that
# ends badly without naming a failed test counts as one failure. Output goes to build/tests/*.log; that of a failed
# one is shown. Without `quick`, the programs run a second time as built with ASan and UBSan.
set -u
BUILD=${BUILD:-build}
mode=${1:-full}
passed=0 failed=0
logs=$BUILD/tests
mkdir -p "$logs"

count() { # log status name
    local p f
    p=$(sed -n 's/^\[  PASSED  \] \([0-9]*\) test.*/\1/p; s/^\([0-9]*\) passed, [0-9]* failed.*/\1/p' "$1" | awk '{s+=$1} END {print s+0}')
    f=$(sed -n 's/^\[  FAILED  \] \([0-9]*\) test.*/\1/p; s/^[0-9]* passed, \([0-9]*\) failed.*/\1/p' "$1" | awk '{s+=$1} END {print s+0}')
    if [ "$2" != 0 ] && [ "$f" = 0 ]; then f=1; fi
    if [ "$2" = 0 ] && [ "$p" = 0 ]; then echo "  $3 ran no test"; f=1; fi
    passed=$((passed + p)) failed=$((failed + f))
    if [ "$f" != 0 ]; then
        echo "FAILED $3: $f failed"
        grep -E -A4 "FAILED|ERROR|Error|Traceback" "$1" | head -n 40; tail -n 15 "$1"
    else
        printf '  %-44s %4d passed  %3d s\n' "$3" "$p" "$4"
    fi
}

run() { # name command...
    local name=$1 log start status
    shift
    log=$logs/$(echo "$name" | tr ' /' '__').log
    start=$SECONDS
    "$@" >"$log" 2>&1 </dev/null
    status=$?
    count "$log" "$status" "$name" $((SECONDS - start))
}

for source in tests/test_*.c; do
    name=$(basename "$source" .c)
    run "$name" "$BUILD/tests/$name"
done
export RQT=$PWD/$BUILD/rqt RQT_SO=$PWD/$BUILD/rqt.so
for script in tests/test_*.sh; do
    [ -e "$script" ] && run "$(basename "$script")" bash "$script"
done
if [ "$mode" = full ]; then
    export ASAN_OPTIONS=detect_leaks=1:allocator_may_return_null=1
    for source in tests/test_*.c; do
        name=$(basename "$source" .c)
        # Exhaustive arithmetic gains nothing from a sanitizer that a tenth of it does not show.
        RQT_QUICK=1 run "$name sanitized" "$BUILD/sanitized/tests/$name"
    done
fi
echo "$passed passed, $failed failed"
[ "$failed" = 0 ]
