#!/bin/bash
# run.sh SECONDS FUZZER... - runs each fuzzer of build/fuzz for so long, two at a time; ends with `N passed, N failed`. Inputs
# that reached new code are kept in build/fuzz/corpus and taken up again; one that is a finding is build/fuzz/FUZZER-crash-*.
set -u
BUILD=${BUILD:-build}
export seconds=$1 directory=$BUILD/fuzz
shift
run_one() {
    local name=$1 log=$directory/$1.log
    mkdir -p "$directory/corpus/$name"
    if "$directory/tests/fuzz/$name" -max_total_time="$seconds" -max_len=4096 -timeout=60 -rss_limit_mb=4096 -print_final_stats=1 \
        -artifact_prefix="$directory/$name-" "$directory/corpus/$name" >"$log" 2>&1; then
        echo "ok      $name: $(sed -n 's/^stat::number_of_executed_units: //p' "$log") inputs, $(sed -n 's/.*cov: \([0-9]*\).*/\1/p' "$log" | tail -n 1) edges"
    else
        echo "FAILED  $name, see $log"
        grep -E 'does not hold|ERROR|runtime error|SUMMARY|Test unit written' "$log" | head -n 8 | sed 's/^/          /'
    fi
}
export -f run_one
export ASAN_OPTIONS=detect_leaks=1:allocator_may_return_null=1
said=$(printf '%s\0' "$@" | xargs -0 -P 2 -n 1 bash -c 'run_one "$0"' | tee /dev/stderr)
failed=$(grep -c '^FAILED' <<<"$said")
echo "$(grep -c '^ok' <<<"$said") passed, $failed failed"
[ "$failed" = 0 ]
