#!/bin/bash
# check_fuzz.sh - does every public function of rqt.h and rqt_view.h, and every SQL function, have a fuzzer? `write` prints the list of
# tests/fuzz/README.md; without it, the list there is compared, and must be whole.
set -u
cd "$(dirname "$0")/.." || exit 1
failed=0

# Names that they declare as functions: an identifier before a parenthesis, comments and typedefs of callbacks left out.
core() {
    cat src/core/rqt.h src/core/rqt_view.h | sed -e 's,/\*.*\*/,,' -e '/\/\*/,/\*\//d' -e 's,//.*,,' | grep -v '^ *#' | grep -oE '\brqt_[a-z0-9_]+\(' | tr -d '(' | sort -u |
        grep -vE '^rqt_(build_emit|field_decide)$'
}
sql() { sed -n 's/^    {\.name = "\(rqt_[a-z_]*\)".*/\1/p' ext/functions.c; }
# The fuzzers whose source calls it, strings left out; of what several share, the one that is named after it.
callers() {
    local f
    for f in tests/fuzz/fuzz*.[ch]; do
        sed -e 's/"[^"]*"//g' "$f" | grep -qw "$1" && basename "$f"
    done | sed -e 's/fuzz_terrain\.h/fuzz_mesh.c/' -e 's/fuzz_store\.h/fuzz_sql.c/' -e '/^fuzz\.h$/d' -e 's/\.[ch]$//' | sort -u | paste -sd' ' | sed 's/ /, /g'
}

list() {
    local lacking=0
    echo "| function | fuzzers |"
    echo "|---|---|"
    for name in $(core); do
        by=$(callers "$name")
        [ -n "$by" ] || { echo "FAILED $name of the core has no fuzzer" >&2; lacking=1; }
        echo "| $name | $by |"
    done
    # By the function table, each of them.
    for name in $(sql); do echo "| SQL $name | fuzz_sql |"; done
    return $lacking
}

if [ "${1:-}" = write ]; then list; exit; fi
fresh=$(list) || failed=1
diff -u <(sed -n '/^| function |/,$p' tests/fuzz/README.md) <(echo "$fresh") || failed=1
if [ $failed = 0 ]; then
    echo "fuzzers: all of $(core | wc -l) functions of rqt.h and rqt_view.h, and $(sql | wc -l) of SQL have one"
else
    echo "tests/fuzz/README.md: the list is not whole; 'tests/check_fuzz.sh write' writes it" >&2
fi
exit $failed
