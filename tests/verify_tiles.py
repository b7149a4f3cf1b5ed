#!/usr/bin/python3
"""verify_tiles.py RASTER... - `make verify-tiles DATA=dir`: the proof of tiles over whole rasters, as Markdown tables.

Each raster (tif, hgt.zip, dem, asc, or all of a directory) becomes a terrain of a temporary database, and its tiles a folder, by
`rqt tiles`. tests/verify_tiles.cpp, which shares no code with what makes them, decodes every tile of every level and puts it beside
the raster at every sample. Then `rqt serve` is asked for every tile that layer.json lists, and for those beside them; and compressed
tiles are unpacked. Terrains that have no tiles (projected ones) must say so. A raster that import refuses is skipped.
Exits with 1 when anything is not as promised.
  SEA=0   every void is imported as sea of this height, which the water masks must have
"""
import glob
import gzip
import json
import os
import shutil
import subprocess
import sys
import time

import serve_support as service
import sql_support as s

JUDGE = os.path.abspath(os.path.join(os.environ.get("BUILD", os.path.join(s.ROOT, "build")), "tests", "verify_tiles"))
NO_TILES = "has no tiles: "


def rasters(arguments):
    for given in arguments:
        if os.path.isdir(given):
            for ending in ("tif", "hgt.zip", "dem", "asc"):
                yield from sorted(glob.glob(os.path.join(given, "*." + ending)))
        else:
            yield given


def judge(raster, folder, sea=None):
    """What the judge says, and its exit status."""
    done = subprocess.run([JUDGE, raster, folder] + ([] if sea is None else [str(sea)]), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
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


def listed(layer):
    """Every tile that layer.json has: z, x, y."""
    return [(z, x, y) for z, ranges in enumerate(layer["available"]) for r in ranges
            for y in range(r["startY"], r["endY"] + 1) for x in range(r["startX"], r["endX"] + 1)]


def path_of(tile):
    return "%d/%d/%d.terrain" % tile


def judge_service(database, terrain, folder):
    """The service has the folder's bytes, and no tile beside those that are listed. A sentence a fault."""
    files, faults = read_files(folder), []
    server = service.Service(database)
    root = "/collections/%s/tiles/quantized-mesh/" % terrain
    answer = server.ask(root + "layer.json")
    if answer.status != 200 or answer.body != files["layer.json"]:
        faults.append("the service's layer.json is not the folder's")
    tiles = set(listed(json.loads(files["layer.json"])))
    for tile in sorted(tiles):
        answer = server.ask(root + path_of(tile))
        if answer.status != 200 or answer.body != files.get(path_of(tile)) or answer.content_type != "application/vnd.quantized-mesh":
            faults.append("%s is served as %d bytes of %s, status %d" % (path_of(tile), len(answer.body), answer.content_type, answer.status))
    # As CesiumJS and cesium-native ask for it.
    any_tile = max(tiles)
    answer = server.ask(root + path_of(any_tile) + "?extensions=octvertexnormals-metadata&v=1.0.0", headers={
        "Accept": "application/vnd.quantized-mesh;extensions=octvertexnormals-metadata,application/octet-stream;q=0.9,*/*;q=0.01", "Accept-Encoding": "gzip"})
    if answer.status != 200 or answer.content_encoding != "gzip" or gzip.decompress(answer.body) != files.get(path_of(any_tile)):
        faults.append("%s with the extensions that clients ask for: status %d" % (path_of(any_tile), answer.status))
    deepest = any_tile[0]
    beside = {(z, x + i, y + j) for z, x, y in tiles for i in (-1, 0, 1) for j in (-1, 0, 1)} | {(z, x, y) for z in range(4) for x in range(2 << z) for y in range(1 << z)}
    beside |= {(deepest + 1, 2 * x, 2 * y) for z, x, y in tiles if z == deepest}
    for tile in sorted(t for t in beside - tiles if min(t) >= 0):
        if server.ask(root + path_of(tile)).status != 404:
            faults.append(path_of(tile) + " is not listed, and the service answers")
    status, said = server.stop()
    if status != 0:
        faults.append("the service ended with %d: %s" % (status, said))
    return len(tiles), len(beside - tiles), faults


def judge_compressed(database, folder):
    """Unpacked, what --gzip writes is what is written without."""
    packed = folder + ".gz"
    said, status = s.run([s.RQT, "tiles", database, "-o", packed, "--gzip"])
    if status != 0:
        return [said]
    theirs, mine = read_files(packed), read_files(folder)
    shutil.rmtree(packed)
    return [path for path in sorted(set(theirs) | set(mine))
            if path not in theirs or path not in mine or (theirs[path] if path == "layer.json" else gzip.decompress(theirs[path])) != mine[path]]


def judge_refusal(database, said):
    """A terrain without tiles: the command and the service say why."""
    server = service.Service(database)
    answer = server.ask("/collections/t/tiles/quantized-mesh/layer.json")
    server.stop()
    return [] if NO_TILES in said and answer.status == 400 and NO_TILES in answer.detail() else [said, answer.detail()]


def judge_raster(path, sea):
    """Prints its table; False when something is not as promised. None: import refuses the raster."""
    name = os.path.basename(path).split(".")[0]
    database, folder = s.temp("tiles.gpkg"), s.temp("tiles")
    shutil.rmtree(folder, ignore_errors=True)
    if os.path.exists(database):
        os.remove(database)
    try:
        s.import_terrain(database, path, name="t", **({} if sea is None else {"sea": sea}))
    except RuntimeError as error:
        print("%s is skipped: %s" % (name, str(error).strip().splitlines()[-1]), file=sys.stderr)
        return None
    start = time.perf_counter()
    said, status = s.run([s.RQT, "tiles", database, "-o", folder])
    seconds = time.perf_counter() - start
    if status != 0:
        faults = judge_refusal(database, said)
        print("\n%s: %s" % (name, said.strip()))
    else:
        print("\n%s: %d tiles in %.1f s\n" % (name, len(read_files(folder)) - 1, seconds), flush=True)
        told, status = judge(path, folder, sea)
        print(told, end="")
        served, missing, faults = judge_service(database, "t", folder)
        print("%s service: it has the %d tiles that are listed, byte for byte, and none of %d others" % ("FAILED" if faults else "ok", served, missing))
        differing = judge_compressed(database, folder)
        print("%s gzip: unpacked, compressed tiles are the same" % ("FAILED" if differing else "ok"))
        faults += differing
        if status != 0:
            faults.append("the judge ended with %d" % status)
    for fault in faults[:5]:
        print("    " + fault)
    sys.stdout.flush()
    return not faults


def main():
    if not os.path.exists(JUDGE):
        sys.exit("verify-tiles: %s is not there: make verify-tiles builds it" % JUDGE)
    sea = os.environ.get("SEA")
    verdicts = {path: judge_raster(path, sea) for path in rasters(sys.argv[1:] or [s.DATA])}
    looked_at = [fine for fine in verdicts.values() if fine is not None]
    if not looked_at:
        sys.exit("verify-tiles: nothing could be imported")
    print("\n%d rasters, %d not as promised%s" % (len(looked_at), looked_at.count(False), "".join(
        ": " + os.path.basename(path) for path, fine in verdicts.items() if fine is False)))
    sys.exit(1 if False in looked_at else 0)


if __name__ == "__main__":
    main()
