#!/bin/bash
# check_catalogue.sh [list] - every case of tests/catalogue.txt has a test named after it, and something that fails it.
#
# A test carries a case when its name begins with the number: F6_a_pit_..., in a C program's list of tests, a check of a
# script, or an SQL script. What fails it is a mutant (tests/mutants/*.py) that such a test has to notice, or a published
# method that `make stability` shows to fail. With `list`: all of it as Markdown. Ends with `N passed, N failed`.
set -u
cd "$(dirname "$0")/.." || exit 1
stability=${STABILITY:-examples/STABILITY.md}

tests() { # lines: name of a test, and where
    grep -oHE '(TEST|cmocka_unit_test[a-z_]*)\(F[0-9]+_[A-Za-z0-9_]+' tests/test_*.c | sed -E 's/^tests\/(.*):.*\((F.*)$/\2 \1/'
    grep -oHE "[\"' ]F[0-9]+_[A-Za-z0-9_]+" tests/test_*.py tests/test_*.sh tests/sql/*.sql | sed -E "s/^tests\/(.*):.(F.*)$/\2 \1/"
}
mutants() { # lines: name of the test that has to notice, and what is broken
    /usr/bin/python3 - <<'PYTHON'
import glob
for path in sorted(glob.glob("tests/mutants/*.py")):
    scope = {}
    exec(open(path, encoding="utf-8").read(), scope)
    for what, _, _, _, _, test in scope["MUTANTS"]:
        print(test, what)
PYTHON
}
published() { # lines: case and method
    grep -E '^\| F[0-9]+ .*\*\*fails:\*\*' "$stability" 2>/dev/null | awk -F' *[|] *' '{ print $2, $5 }'
}

awk -v list="${1:-}" '
    function unique(text, more) { return index("; " text "; ", "; " more "; ") ? text : text (text == "" ? "" : "; ") more }
    function case_of(name) { sub(/_.*/, "", name); return name }
    FILENAME == "tests/catalogue.txt" {
        if ($0 !~ /^#/) { order[++count] = $1; what[$1] = substr($0, length($1) + 2) }
        next
    }
    kind == "test" { carried[case_of($1)] = unique(carried[case_of($1)], $1 " (" $2 ")") }
    kind == "mutant" && /^F[0-9]+_/ { n = case_of($1); sub(/^[^ ]+ /, ""); broken[n] = unique(broken[n], $0) }
    kind == "published" { n = $1; sub(/^[^ ]+ /, ""); method[n] = unique(method[n], $0) }
    END {
        if (list != "") print "| case | what | tests | mutants that they notice | published methods that fail |\n|---|---|---|---|---|"
        for (i = 1; i <= count; i++) {
            n = order[i]
            fine = carried[n] != "" && (broken[n] != "" || method[n] != "")
            good += fine
            if (list != "") {
                gsub(/[|]/, "\\|", broken[n]); gsub(/; /, "<br>", carried[n]); gsub(/; /, "<br>", broken[n]); gsub(/; /, ", ", method[n])
                print "| " n " | " what[n] " | " carried[n] " | " broken[n] " | " method[n] " |"
            } else if (!fine)
                print "FAILED " n ", " what[n] ": " (carried[n] == "" ? "no test is named after it" : "nothing is known to fail it")
        }
        if (list == "") print good + 0 " passed, " count - good " failed"
        exit good != count
    }' tests/catalogue.txt kind=test <(tests) kind=mutant <(mutants) kind=published <(published)
