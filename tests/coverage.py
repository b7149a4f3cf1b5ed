#!/usr/bin/python3
"""coverage.py BUILD - line coverage of the core after the tests of a --coverage build have run.

Writes BUILD/report.txt (a line per source of every room) and BUILD/missed.txt (each line of src/core that nothing ran), and compares
the latter with tests/coverage.txt: an entry there is a file, a line's text and the reason why no test reaches it. A line of the core that
is neither run nor listed is a failure; so is an entry whose line is run, or is not there any more. Lines are known by their text, so that
the list outlives edits elsewhere; an entry counts for every missed line of its file with that text.

Code is compiled more than once (each build of an object, headers in several objects): a line is run when any of them ran it."""
import collections
import json
import os
import subprocess
import sys


def read_counts(build):
    """{source: {line: runs}} over all objects that have run."""
    data = []
    for folder, _, names in os.walk(build):
        if not folder.endswith("/tests"):
            data += [os.path.join(folder, n) for n in names if n.endswith(".gcda")]
    counts = collections.defaultdict(lambda: collections.defaultdict(int))
    # Lines count for where they stand, also those of macros and of headers with code in them.
    for one in data:
        said = subprocess.run(["gcov", "--json-format", "--stdout", one], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                              universal_newlines=True).stdout
        for document in said.splitlines():
            if not document.startswith("{"):
                continue
            for f in json.loads(document)["files"]:
                name = os.path.normpath(f["file"])
                if name.startswith(("src/", "ext/")):
                    for line in f["lines"]:
                        counts[name][line["line_number"]] += line["count"]
    return counts


def read_list(path):
    """[(file, text, reason)] of entries `file: text` with the reason indented below."""
    entries = []
    with open(path, encoding="utf-8") as f:
        for n, line in enumerate(f, 1):
            line = line.rstrip("\n")
            if not line or line.startswith("#"):
                continue
            if line.startswith("    "):
                entries[-1][2] += line.strip() + " "
                continue
            file, colon, text = line.partition(": ")
            if not colon:
                sys.exit("%s:%d: neither `file: text` nor an indented reason" % (path, n))
            entries.append([file, text.strip(), ""])
    return entries


def main():
    build = sys.argv[1]
    counts = read_counts(build)
    missed, rooms = [], collections.defaultdict(lambda: [0, 0])
    with open(os.path.join(build, "report.txt"), "w", encoding="utf-8") as report:
        for name in sorted(counts):
            lines = counts[name]
            ran = sum(1 for c in lines.values() if c > 0)
            report.write("%6.2f %% %5d of %5d lines  %s\n" % (100 * ran / len(lines), ran, len(lines), name))
            room = name.rsplit("/", 1)[0]
            rooms[room][0] += ran
            rooms[room][1] += len(lines)
            if room == "src/core":
                with open(name, encoding="utf-8") as f:
                    text = [line.strip() for line in f]
                missed += [(name, n, text[n - 1]) for n in sorted(lines) if lines[n] == 0]
    with open(os.path.join(build, "missed.txt"), "w", encoding="utf-8") as f:
        for name, n, text in missed:
            f.write("%s:%d: %s\n" % (name, n, text))
    for room, (ran, lines) in sorted(rooms.items()):
        print("%-12s %6.2f %% of %5d lines" % (room, 100 * ran / lines, lines))
    if not rooms["src/core"][1]:
        sys.exit("no coverage of src/core in %s" % build)

    failed = 0
    entries = read_list("tests/coverage.txt")
    listed = {(file, text) for file, text, _ in entries}
    for name, n, text in missed:
        if (name, text) not in listed:
            failed += 1
            print("FAILED %s:%d: no test runs it, and tests/coverage.txt does not say why: %s" % (name, n, text))
    unreached = {(name, text) for name, _, text in missed}
    for file, text, reason in entries:
        if (file, text) not in unreached:
            failed += 1
            print("FAILED tests/coverage.txt: a test runs it, or it is no more: %s: %s" % (file, text))
        elif not reason:
            failed += 1
            print("FAILED tests/coverage.txt: no reason: %s: %s" % (file, text))
    print("core: %d of %d lines run, %d listed with a reason" % (rooms["src/core"][0], rooms["src/core"][1], len(missed)))
    print("%d passed, %d failed" % (0 if failed else 1, failed))
    return failed != 0


sys.exit(main())
