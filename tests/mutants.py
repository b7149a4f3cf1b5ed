#!/usr/bin/python3
"""mutants.py BUILD [WORD] - breaks the code one line at a time and sees a named test go red.

WORD: only the mutants whose description holds it. A mutant, in tests/mutants/*.py, is (what it breaks, file, text, replacement,
program, test): the first occurrence of the text is replaced in a copy of the tree, the program is built and run there, and the
mutant is caught when it fails and names that test (or hangs). The program is one of build/tests, or a script tests/*.py or
tests/web/*.test.mjs, which runs with the mutant's command and extension. A text that is not found is a failure too: the list has to follow the code.

RQT_MUTANTS_SECONDS: no mutant is begun after so long; how many were left out is said. For where there is a limit of time.

As many workers as there are processors, each with a copy of the tree; mutants of one program follow each other in one of them,
whose objects are then mostly up to date. What was missed is said again at the end.
"""
import contextlib
import glob
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from queue import Queue

LONGEST = 300  # seconds of a test's run


def read_mutants():
    """The lists of tests/mutants/*.py, one file a subject."""
    mutants = []
    for path in sorted(glob.glob(os.path.join("tests", "mutants", "*.py"))):
        scope = {}
        with open(path, encoding="utf-8") as f:
            exec(compile(f.read(), path, "exec"), scope)
        mutants += scope["MUTANTS"]
    return mutants


def copy_tree(build, tree):
    """The sources and what was built of them, with their times: nothing is built again that did not change."""
    os.makedirs(tree)
    for name in ("src", "ext", "sql", "tests", "examples", "Makefile"):
        (shutil.copytree if os.path.isdir(name) else shutil.copy2)(name, os.path.join(tree, name))
    shutil.copytree(build, os.path.join(tree, "build"),
                    ignore=shutil.ignore_patterns("mutants", "sanitized", "threads", "coverage", "fuzz", "lint", "bench", "chart", "peers", "demo", "web-shots", "*.log"))


def kill_group(leader):
    with contextlib.suppress(ProcessLookupError):
        os.killpg(leader, signal.SIGKILL)


def run_until_named(command, tree, environment, test, is_page):
    """"" when a line says that the test is red, when the program dies and when it hangs; otherwise what there was instead.

    What it would say after that line is not waited for: a code that is not 0 follows. But a page's browser outlives its test when
    that is killed.
    """
    with subprocess.Popen(command, cwd=tree, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", env=environment,
                          start_new_session=True) as ran:
        late = threading.Event()

        def end():
            late.set()
            kill_group(ran.pid)

        timer = threading.Timer(LONGEST, end)
        timer.start()
        is_named, others = False, []
        try:
            for line in ran.stdout:
                if "FAILED" not in line and "ERROR" not in line and not line.startswith("not ok"):
                    continue
                is_named |= test in line
                others.append(line.rstrip())
                if is_named and not is_page:
                    end()
            code = ran.wait()
            if late.is_set() or code < 0 or (code and is_named):
                return ""
            return "SURVIVED" if code == 0 else "\n".join(["red, but not " + test, *others[:5]])
        finally:
            timer.cancel()
            kill_group(ran.pid)  # services that it left


def run_mutant(tree, mutant):
    """What is wrong with it, or "" when it was caught."""
    what, path, old, new, program, test = mutant
    target = os.path.join(tree, path)
    with open(path, encoding="utf-8") as f:
        text = f.read()
    if old not in text:
        return "not found in " + path
    absolute = os.path.abspath(tree)
    temporary = os.path.join(absolute, "temporary")
    os.makedirs(temporary, exist_ok=True)
    environment = dict(os.environ, RQT_SEED="1", TMPDIR=temporary, RQT=absolute + "/build/rqt",
                       RQT_SO=absolute + "/build/rqt.so")
    with open(target, "w", encoding="utf-8") as f:
        f.write(text.replace(old, new, 1))
    try:
        page = program.endswith(".mjs")
        script = page or program.endswith(".py")
        goal = "products" if script else "build/tests/" + program
        made = subprocess.run(["make", "-s", "WARNINGS=", goal], cwd=tree, capture_output=True, text=True)
        if made.returncode:
            return "does not build:\n" + made.stderr[-1500:]
        runner = ["node", "--test", "--test-reporter=tap", "--test-name-pattern=" + re.escape(test)] if page else ["/usr/bin/python3", "-u"]
        command = runner + ["tests/" + program] if script else ["build/tests/" + program]
        verdict = run_until_named(command, tree, environment, test, page)
        return verdict and program + ": " + verdict
    finally:
        shutil.copy2(path, target)
        os.utime(target)
        shutil.rmtree(temporary, ignore_errors=True)


def main():
    build = sys.argv[1] if len(sys.argv) > 1 else "build"
    only = sys.argv[2] if len(sys.argv) > 2 else ""
    folder = os.path.join(build, "mutants")
    shutil.rmtree(folder, ignore_errors=True)
    groups = {}
    for mutant in read_mutants():
        if only in mutant[0]:
            groups.setdefault((mutant[4], mutant[1]), []).append(mutant)
    trees = Queue()
    for i in range(os.cpu_count() or 1):
        tree = os.path.join(folder, str(i))
        copy_tree(build, tree)
        trees.put(tree)
    missed, left_out = [], []
    end = time.monotonic() + float(os.environ.get("RQT_MUTANTS_SECONDS", "inf"))

    def run_group(group):
        tree = trees.get()
        for mutant in group:
            begun = time.monotonic()
            if begun > end:
                left_out.append(mutant)
                continue
            verdict = run_mutant(tree, mutant)
            if verdict:
                missed.append("MISSED  %-48s %s" % (mutant[0], verdict))
            print(missed[-1] if verdict else "caught  %-48s by %s, %.0f s" % (mutant[0], mutant[5], time.monotonic() - begun), flush=True)
        trees.put(tree)
        return len(group)

    with ThreadPoolExecutor(trees.qsize()) as workers:
        total = sum(workers.map(run_group, groups.values()))
    for line in missed:
        print(line)
    if left_out:
        print("time is up: %d of %d mutants were not looked at" % (len(left_out), total))
    print("%d passed, %d failed" % (total - len(missed) - len(left_out), len(missed)))
    return bool(missed)


sys.exit(main())
