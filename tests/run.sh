#!/bin/bash
# run.sh [quick|programs] - runs every test program and script, two at a time, and ends with `N passed, N failed`.
#
# A cmocka program says `[  PASSED  ] n` and `[  FAILED  ] n`, a script `N passed, N failed`; both are counted. One that
# ends badly without naming a failed test, or runs none, counts as one failure. Output goes to build/tests/*.log; of what
# failed the telling lines are shown. Without `quick`, the programs run a second time as built with ASan and UBSan. With `programs`, only those
# that PROGRAMS lists, as they are built.
set -u
BUILD=${BUILD:-build}
mode=${1:-full}
export logs=$BUILD/tests
mkdir -p "$logs"
rm -f "$logs"/*.log "$logs"/*.sum

run_one() { # name command...: a line for people, and passed, failed, name for the sum
    local name=$1 log status p f start=$SECONDS
    shift
    log=$logs/${name// /_}.log
    "$@" >"$log" 2>&1 </dev/null
    status=$?
    p=$(sed -n 's/^\[  PASSED  \] \([0-9]*\) test.*/\1/p; s/^\([0-9]*\) passed, [0-9]* failed$/\1/p' "$log" | awk '{s+=$1} END {print s+0}')
    f=$(sed -n 's/^\[  FAILED  \] \([0-9]*\) test.*/\1/p; s/^[0-9]* passed, \([0-9]*\) failed$/\1/p' "$log" | awk '{s+=$1} END {print s+0}')
    if [ "$f" = 0 ] && { [ $status != 0 ] || [ "$p" = 0 ]; }; then f=1; fi
    echo "$p $f $name" >"$logs/${name// /_}.sum"
    if [ "$f" = 0 ]; then
        printf '  %-44s %4d passed  %3d s\n' "$name" "$p" $((SECONDS - start))
    else
        printf '  %-44s %4d passed, %d FAILED, status %d, see %s\n' "$name" "$p" "$f" $status "$log"
        grep -E -A4 'FAILED|ERROR|Error|Traceback' "$log" | grep -vE '^[0-9]+ passed, ' | head -n 40 | sed 's/^/      /'
    fi
}
export -f run_one

export RQT=$PWD/$BUILD/rqt RQT_SO=$PWD/$BUILD/rqt.so
# Random tests begin from this number, so that a run can be repeated; any other one asks other questions.
export RQT_SEED=${RQT_SEED:-1}
export ASAN_OPTIONS=detect_leaks=1:allocator_may_return_null=1
export TSAN_OPTIONS=suppressions=$PWD/tests/threads.supp
if [ "$mode" = programs ]; then
    for name in $PROGRAMS; do printf '%s\0' "$name|$BUILD/tests/$name"; done
else
    # The longest first, so that none is left over at the end.
    for script in tests/test_*.sh; do printf '%s\0' "$(basename "$script")|bash|$script"; done
    if [ "$mode" = full ]; then
        for source in tests/test_core_*.c tests/test_*.c; do
            name=$(basename "$source" .c)
            # The real DEMs in every size of block: the same calls as on random terrains, many times over.
            [ "$name" = test_core_dems ] && continue
            printf '%s\0' "$name sanitized|$BUILD/sanitized/tests/$name"
        done | awk 'BEGIN { RS = ORS = "\0" } !seen[$0]++'
        for source in tests/fuzz/fuzz_*.c; do # once, where a sanitizer looks
            name=$(basename "$source" .c)
            printf '%s\0' "$name sanitized|$BUILD/sanitized/tests/fuzz/$name"
        done
    fi
    for source in tests/test_*.c; do
        name=$(basename "$source" .c)
        printf '%s\0' "$name|$BUILD/tests/$name"
    done
fi | xargs -0 -P 2 -n 1 bash -c 'IFS="|" read -r -a command <<<"$0"; run_one "${command[@]}"'
awk '$2 > 0 { printf "FAILED %s\n", $3 } { passed += $1; failed += $2 } END { printf "%d passed, %d failed\n", passed, failed; exit failed > 0 }' "$logs"/*.sum
