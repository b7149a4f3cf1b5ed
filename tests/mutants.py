#!/usr/bin/python3
"""mutants.py BUILD [WORD] - breaks the code one line at a time and sees a named test go red.

WORD: only the mutants whose description holds it. A mutant, in tests/mutants/*.py, is (what it breaks, file, text, replacement,
program, test): the first occurrence of the text is replaced in a copy of the tree, the program is built and run there, and the
mutant is caught when it fails and names that test (or hangs). The program is one of build/tests, or a script tests/*.py, which
runs with the mutant's command and extension. A text that is not found is a failure too: the list has to follow the code.
"""
import glob
import os
import shutil
import subprocess
import sys


def read_mutants():
    """The lists of tests/mutants/*.py, one file a subject."""
    mutants = []
    for path in sorted(glob.glob(os.path.join("tests", "mutants", "*.py"))):
        scope = {}
        with open(path, encoding="utf-8") as f:
            exec(compile(f.read(), path, "exec"), scope)
        mutants += scope["MUTANTS"]
    return mutants


def main():
    build = sys.argv[1] if len(sys.argv) > 1 else "build"
    only = sys.argv[2] if len(sys.argv) > 2 else ""
    tree = os.path.join(build, "mutants")
    shutil.rmtree(tree, ignore_errors=True)
    os.makedirs(tree)
    for name in ("src", "ext", "sql", "tests", "examples", "Makefile"):
        (shutil.copytree if os.path.isdir(name) else shutil.copy2)(name, os.path.join(tree, name))
    # Objects are up to date with the sources they came from: times are kept.
    shutil.copytree(build, os.path.join(tree, "build"),
                    ignore=shutil.ignore_patterns("mutants", "sanitized", "threads", "coverage", "fuzz", "lint", "bench", "chart", "peers", "demo", "*.log"))
    absolute = os.path.abspath(tree)
    environment = dict(os.environ, RQT_SEED="1", TMPDIR=absolute, RQT=absolute + "/build/rqt",
                       RQT_SO=absolute + "/build/rqt.so")
    caught = missed = 0
    for what, path, old, new, program, test in read_mutants():
        if only not in what:
            continue
        target = os.path.join(tree, path)
        with open(path, encoding="utf-8") as f:
            text = f.read()
        verdict = "not found in " + path
        if old in text:
            with open(target, "w", encoding="utf-8") as f:
                f.write(text.replace(old, new, 1))
            script = program.endswith(".py")
            goal = "products" if script else "build/tests/" + program
            made = subprocess.run(["make", "-s", "-j2", "WARNINGS=", goal], cwd=tree, capture_output=True, text=True)
            verdict = "does not build:\n" + made.stderr[-1500:]
            if made.returncode == 0:
                try:
                    command = ["/usr/bin/python3", "tests/" + program] if script else ["build/tests/" + program]
                    ran = subprocess.run(command, cwd=tree, capture_output=True, text=True, errors="replace",
                                         timeout=300 if script else 120, env=environment)
                    output = ran.stdout + ran.stderr
                    named = any(test in line and ("FAILED" in line or "ERROR" in line) for line in output.splitlines())
                    red = ran.returncode != 0 and (named or ran.returncode < 0)
                    verdict = "" if red else "SURVIVED " + program + (
                        " (red, but not " + test + ")" if ran.returncode else "")
                except subprocess.TimeoutExpired:
                    verdict = ""
            shutil.copy2(path, target)
            os.utime(target)
        if verdict:
            missed += 1
            print("MISSED  %-48s %s" % (what, verdict), flush=True)
        else:
            caught += 1
            print("caught  %-48s by %s" % (what, test), flush=True)
    print("%d passed, %d failed" % (caught, missed))
    return missed != 0


sys.exit(main())
