"""bench_tiles3d.py [SIDE] - what 3D Tiles cost: a tileset of SIDE x SIDE samples (default 2049) written with one and with two
workers; by level, how many tiles there are, their triangles, bytes and what they are off at most; and tiles asked of the
service, the first time and again.

The terrain is a fractal, at three seconds of arc. RQT names the command.
"""
import http.client
import json
import os
import resource
import shutil
import statistics
import struct
import subprocess
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import sql_support as s  # noqa: E402

SIDE = int(sys.argv[1]) if len(sys.argv) > 1 else 2049
ASKED, AGAIN, STEP = 40, 5, 1 / 1200


def terrain():
    raw, placed, database = s.write_large(s.temp("large.raw"), SIDE, 1), s.temp("large.vrt"), s.temp("large.gpkg")
    corners = 6 - STEP / 2, 48 + STEP / 2, 6 + (SIDE - 0.5) * STEP, 48 - (SIDE - 0.5) * STEP
    s.run(["gdal_translate", "-q", "-of", "VRT", "-a_srs", "EPSG:4326", "-a_ullr", *map(repr, corners), raw, placed])
    s.import_terrain(database, placed, name="large")
    return database


def write(database, jobs):
    """Bytes and triangles of every tile, z/x/y, by what its glTF says."""
    folder = s.temp("tiles")
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([s.RQT, "tiles", database, "--kind", "3d-tiles", "-o", folder, "--jobs", str(jobs)], check=True)
    seconds, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    tiles = {}
    for path, _, names in os.walk(os.path.join(folder, "content")):
        for name in names:
            with open(os.path.join(path, name), "rb") as f:
                head = f.read(20)
                text = json.loads(f.read(struct.unpack_from("<I", head, 12)[0]))
            place = tuple(map(int, os.path.relpath(os.path.join(path, name[:-4]), os.path.join(folder, "content")).split("/")))
            tiles[place] = struct.unpack_from("<I", head, 8)[0], text["accessors"][2]["count"] // 3, text["asset"]["extras"]["rqt"]["error"]
    shutil.rmtree(folder)
    print("  --jobs %d %8.2f s, %6.2f s of processors, %d tiles, %.0f a second, %.1f MB" %
          (jobs, seconds, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, len(tiles), len(tiles) / seconds, sum(t[0] for t in tiles.values()) / 1e6))
    return tiles


def ask(database, tiles):
    """By level: milliseconds, the first time and again."""
    service = subprocess.Popen([s.RQT, "serve", "--port", "0", database], stdout=subprocess.PIPE, text=True)
    try:
        connection = http.client.HTTPConnection(service.stdout.readline().strip().split("/")[2])

        def get(place):
            start = time.perf_counter()
            connection.request("GET", "/collections/large/tiles/3d-tiles/content/%d/%d/%d.glb" % place)
            connection.getresponse().read()
            return 1000 * (time.perf_counter() - start)
        for z in sorted({place[0] for place in tiles}):
            level = sorted(place for place in tiles if place[0] == z)
            some = level[::max(1, len(level) // ASKED)]
            first = [get(place) for place in some]
            for _ in range(AGAIN): # each worker of the service has what it has read
                for place in some:
                    get(place)
            again = [statistics.median(get(place) for _ in range(AGAIN)) for place in some]
            of = [tiles[place] for place in level]
            print("  %5d %6d %10.0f %9.0f %9.2f %9.2f %9.2f %9.2f" % (z, len(level), statistics.mean(t[1] for t in of), statistics.mean(t[0] for t in of),
                                                                       max(t[2] for t in of), statistics.median(first), statistics.median(again), max(again)))
    finally:
        service.terminate()
        service.wait()


made = terrain()
print("3D Tiles of %d x %d samples, written:" % (SIDE, SIDE))
write(made, 1)
every = write(made, 2)
print("  level  tiles  triangles     bytes    off, m  first ms  again ms     worst")
ask(made, every)
