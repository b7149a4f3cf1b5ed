#!/bin/bash
# check_readme.sh - the session in the README is what the demo prints today; only times may differ.
set -u
times='s/[0-9.]* s (reading.*Msamples\/s/TIMES/'
wanted=$(sed -n '/^```$/,/^```$/p' README.md | grep -v '^```$' | sed "$times")
got=$(./examples/demo.sh 2>&1 | sed -n '/^# A DEM/,/^white_mountains: sound/p' | sed "$times")
if [ "$wanted" = "$got" ]; then echo "the session in README.md is what the demo prints"; exit 0; fi
diff <(echo "$wanted") <(echo "$got")
echo "README.md shows another session than the demo prints"
exit 1
