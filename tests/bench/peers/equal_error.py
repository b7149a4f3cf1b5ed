#!/usr/bin/python3
"""equal_error.py FOLDER... - the vertices of `exact` over those of the others at equal true error.

Reads the 1-error-vertices.csv of each folder. The vertices that a series needs for a true error are found on its front
(a mesh that has both more vertices and more error than another of the series does not count), between two of its
meshes by a straight line through the logarithms. A cell is empty where a series has no meshes on both sides.
"""
import csv
import math
import os
import statistics
import sys

ERRORS = [2, 5, 10, 20, 50]
OTHERS = ["minimal", "wedgie", "local", "euclid", "greedy TIN (delatin)", "RTIN (martini)"]


def pareto_front(meshes):
    """Of (size, error), sorted: those that no other is as small as with less error."""
    front = []
    for size, error in meshes:
        if error > 0 and (not front or error < front[-1][1]):
            front.append((size, error))
    return front


def value_at(front, error):
    """The size that a front has at an error; None outside it."""
    for (v0, e0), (v1, e1) in zip(front, front[1:]):
        if e1 <= error <= e0:
            t = (math.log(e0) - math.log(error)) / (math.log(e0) - math.log(e1))
            return math.exp(math.log(v0) + t * (math.log(v1) - math.log(v0)))
    return None


def read_front(rows, series):
    return pareto_front(sorted((int(r["vertices"]), float(r["max_error"])) for r in rows if r["series"] == series))


def main():
    all_rows = {}
    for folder in sys.argv[1:]:
        with open(os.path.join(folder, "1-error-vertices.csv"), newline="") as file:
            all_rows[os.path.basename(folder)] = list(csv.DictReader(file))
    present = [o for o in OTHERS if any(r["series"] == o for rows in all_rows.values() for r in rows)]
    ratios = {o: [] for o in present}
    print("Vertices of exact over those of the others at equal true error:\n")
    print("| DEM | true error, m | exact, vertices | " + " | ".join("over " + o for o in present) + " |")
    print("|---|--:|--:|" + "--:|" * len(present))
    for name, rows in all_rows.items():
        fronts = {o: read_front(rows, o) for o in ["exact"] + present}
        for error in ERRORS:
            exact = value_at(fronts["exact"], error)
            if exact is None:
                continue
            cells = []
            for other in present:
                peer = value_at(fronts[other], error)
                cells.append(f"{exact / peer:.2f}" if peer else "")
                if peer:
                    ratios[other].append(exact / peer)
            print(f"| {name} | {error} | {exact:.0f} | " + " | ".join(cells) + " |")
    cells = [f"{statistics.median(ratios[o]):.2f}" if ratios[o] else "" for o in present]
    print("| median of all | | | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
