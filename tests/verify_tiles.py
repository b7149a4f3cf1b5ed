#!/usr/bin/python3
"""verify_tiles.py RASTER... - `make verify-tiles DATA=dir`: the proof of tiles over whole rasters, as Markdown tables.

Each raster (tif, hgt.zip, dem, asc, or all of a directory) becomes a terrain of a temporary database, and its tiles of each kind a folder,
by `rqt tiles`. tests/verify_tiles.cpp, which shares no code with what makes them, decodes every tile of every level and puts it beside
the raster at every sample. Then `rqt serve` is asked for every file of the folder, which are all that are listed, and for tiles beside
them; and compressed tiles are unpacked. Terrains that have no tiles (projected ones) must say so. A raster that import refuses is skipped.
Exits with 1 when anything is not as promised.
  KIND=3d-tiles   one kind only
  SEA=0           every void is imported as sea of this height, which the water masks must have
"""
import glob
import gzip
import json
import os
import re
import shutil
import subprocess
import sys
import time

import serve_support as service
import sql_support as s

JUDGE = os.path.abspath(os.path.join(os.environ.get("BUILD", os.path.join(s.ROOT, "build")), "tests", "verify_tiles"))
NO_TILES = "has no tiles: "
# Of each kind: its document, the media type of each kind of file.
KINDS = {"quantized-mesh": ("layer.json", {"json": "application/json", "terrain": "application/vnd.quantized-mesh"}),
         "3d-tiles": ("tileset.json", {"json": "application/json", "glb": "model/gltf-binary", "subtree": "application/octet-stream"}),
         "terrarium": ("tile.json", {"json": "application/json", "png": "image/png"})}
# As CesiumJS and cesium-native ask for the first kind; browsers for the others.
CLIENTS = {"quantized-mesh": ("?extensions=octvertexnormals-metadata&v=1.0.0",
                              "application/vnd.quantized-mesh;extensions=octvertexnormals-metadata,application/octet-stream;q=0.9,*/*;q=0.01"),
           "3d-tiles": ("", "*/*"), "terrarium": ("", "image/avif,image/webp,image/png,*/*;q=0.8")}
REFUSED, FINE, WRONG = range(3)


def rasters(arguments):
    for given in arguments:
        if os.path.isdir(given):
            for ending in ("tif", "hgt.zip", "dem", "asc"):
                yield from sorted(glob.glob(os.path.join(given, "*." + ending)))
        else:
            yield given


def judge(kind, raster, folder, sea=None):
    """What the judge says, and its exit status."""
    done = subprocess.run([JUDGE, kind, raster, folder] + ([] if sea is None else [str(sea)]), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    return done.stdout, done.returncode


def read_files(folder):
    """path -> bytes of what a client may ask for."""
    found = {}
    for path, _, names in os.walk(folder):
        for name in names:
            if not name.startswith("."):
                full = os.path.join(path, name)
                with open(full, "rb") as f:
                    found[os.path.relpath(full, folder)] = f.read()
    return found


def place_of(path):
    """Series, level, column, row and ending of a tile's path."""
    found = re.fullmatch(r"(.*?)(\d+)/(\d+)/(\d+)(\.\w+)", path)
    return found and (found[1], int(found[2]), int(found[3]), int(found[4]), found[5])


def path_of(place):
    return "%s%d/%d/%d%s" % place


def beside(places):
    """Tiles that are around these, above the first ones and below the last ones, and are not among them."""
    found = set()
    for series, ending in {(p[0], p[4]) for p in places}:
        mine = {p[1:4] for p in places if p[0] == series}
        deepest = max(mine)[0]
        near = {(z, x + i, y + j) for z, x, y in mine for i in (-1, 0, 1) for j in (-1, 0, 1)} | {(z, x, y) for z in range(4) for x in range(2 << z) for y in range(1 << z)}
        near |= {(deepest + 1, 2 * x, 2 * y) for z, x, y in mine if z == deepest}
        found |= {(series, *place, ending) for place in near - mine if min(place) >= 0}
    return found


def is_document(kind, mine, theirs):
    """Terrarium's has whole addresses where it is served."""
    mine, theirs = json.loads(mine), json.loads(theirs)
    return {**mine, "tiles": 0} == {**theirs, "tiles": 0} if kind == "terrarium" else mine == theirs


def judge_service(kind, database, terrain, folder):
    """The service has the folder's bytes, and no tile beside those. A sentence a fault."""
    files, faults = read_files(folder), []
    server = service.Service(database)
    root = "/collections/%s/tiles/%s/" % (terrain, kind)
    document, types = KINDS[kind]
    for path, mine in sorted(files.items()):
        answer = server.ask(root + path)
        is_same = answer.status == 200 and (is_document(kind, mine, answer.body) if path == document else answer.body == mine)
        if not is_same or answer.content_type != types.get(path.rsplit(".")[-1]):
            faults.append("%s is served as %d bytes of %s, status %d" % (path, len(answer.body), answer.content_type, answer.status))
    places = {place_of(path) for path in files} - {None}
    query, accepted = CLIENTS[kind]
    any_tile = path_of(max(places))
    answer = server.ask(root + any_tile + query, headers={"Accept": accepted, "Accept-Encoding": "gzip"})
    body = gzip.decompress(answer.body) if answer.content_encoding == "gzip" else answer.body
    if answer.status != 200 or (answer.content_encoding is None) != (kind == "terrarium") or body != files.get(any_tile):
        faults.append("%s as clients ask for it: status %d, %s" % (any_tile, answer.status, answer.content_encoding))
    others = beside(places)
    for place in sorted(others):
        if server.ask(root + path_of(place)).status != 404:
            faults.append(path_of(place) + " is not there, and the service answers")
    status, said = server.stop()
    if status != 0:
        faults.append("the service ended with %d: %s" % (status, said))
    return len(places), len(others), faults


def judge_compressed(kind, database, folder):
    """Unpacked, what --gzip writes is what is written without."""
    packed = folder + ".gz"
    said, status = s.run([s.RQT, "tiles", database, "--kind", kind, "-o", packed, "--gzip"])
    if status != 0:
        return [said]
    theirs, mine = read_files(packed), read_files(folder)
    shutil.rmtree(packed)
    is_packed = {path: data[:2] == b"\x1f\x8b" for path, data in theirs.items()}
    return [path for path in sorted(set(theirs) | set(mine))
            if path not in theirs or path not in mine or (gzip.decompress(theirs[path]) if is_packed[path] else theirs[path]) != mine[path] or
            is_packed[path] != (path.rsplit(".")[-1] not in ("json", "png"))]


def judge_refusal(kind, database, said):
    """A terrain without tiles: the command and the service say why."""
    server = service.Service(database)
    answer = server.ask("/collections/t/tiles/%s/%s" % (kind, KINDS[kind][0]))
    server.stop()
    return [] if NO_TILES in said and answer.status == 400 and NO_TILES in answer.detail() else [said, answer.detail()]


def judge_kind(kind, raster, database, sea):
    """Prints its table. WRONG when something is not as promised, REFUSED when the terrain has no such tiles, and says so."""
    name, folder = os.path.basename(raster).split(".")[0], s.temp("tiles")
    shutil.rmtree(folder, ignore_errors=True)
    start = time.perf_counter()
    said, status = s.run([s.RQT, "tiles", database, "--kind", kind, "-o", folder])
    seconds, was_made = time.perf_counter() - start, status == 0
    if not was_made:
        faults = judge_refusal(kind, database, said)
        print("\n%s, %s: %s" % (name, kind, said.strip()))
    else:
        print("\n%s, %s: %d tiles in %.1f s\n" % (name, kind, len(read_files(folder)) - 1, seconds), flush=True)
        told, status = judge(kind, raster, folder, sea)
        print(told, end="")
        served, missing, faults = judge_service(kind, database, "t", folder)
        print("%s service: it has the %d tiles that there are, byte for byte, and none of %d others" % ("FAILED" if faults else "ok", served, missing))
        differing = judge_compressed(kind, database, folder)
        print("%s gzip: unpacked, compressed tiles are the same" % ("FAILED" if differing else "ok"))
        faults += differing
        if status != 0:
            faults.append("the judge ended with %d" % status)
    for fault in faults[:5]:
        print("    " + fault)
    sys.stdout.flush()
    return WRONG if faults else FINE if was_made else REFUSED


def judge_raster(path, kinds, sea):
    """The worst of its kinds; REFUSED when there is none, or import refuses the raster."""
    database = s.temp("tiles.gpkg")
    if os.path.exists(database):
        os.remove(database)
    try:
        s.import_terrain(database, path, name="t", **({} if sea is None else {"sea": sea}))
    except RuntimeError as error:
        print("%s is skipped: %s" % (os.path.basename(path), str(error).strip().splitlines()[-1]), file=sys.stderr)
        return REFUSED
    return max(judge_kind(kind, path, database, sea) for kind in kinds)


def main():
    if not os.path.exists(JUDGE):
        sys.exit("verify-tiles: %s is not there: make verify-tiles builds it" % JUDGE)
    sea, kind = os.environ.get("SEA"), os.environ.get("KIND")
    if kind and kind not in KINDS:
        sys.exit("verify-tiles: KIND=%s is none of %s" % (kind, ", ".join(KINDS)))
    verdicts = {path: judge_raster(path, [kind] if kind else list(KINDS), sea) for path in rasters(sys.argv[1:] or [s.DATA])}
    found = {verdict: [os.path.basename(path) for path, v in verdicts.items() if v == verdict] for verdict in (REFUSED, FINE, WRONG)}
    print("\n%d rasters judged, %d not as promised%s%s" % (
        len(found[FINE]) + len(found[WRONG]), len(found[WRONG]), "".join(": " + name for name in found[WRONG]),
        "; %d without tiles: %s" % (len(found[REFUSED]), ", ".join(found[REFUSED])) if found[REFUSED] else ""))
    if len(found[REFUSED]) == len(verdicts):
        sys.exit("verify-tiles: no raster has tiles")
    sys.exit(1 if found[WRONG] else 0)


if __name__ == "__main__":
    main()
