"""bench_tiles.py [SIDE] - what tiles for globes cost: a pyramid of SIDE x SIDE samples (default 4097) written with one and with
two workers, plain and compressed; and each level asked of the service, the first time and again.

The terrain is a fractal, at three seconds of arc. RQT names the command.
"""
import http.client
import json
import os
import resource
import shutil
import statistics
import subprocess
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import sql_support as s  # noqa: E402

SIDE = int(sys.argv[1]) if len(sys.argv) > 1 else 4097
ASKED = 60


def terrain():
    raw = s.write_large(s.temp("large.raw"), SIDE, 1)
    north, step = 48, 1 / 1200
    placed, database = s.temp("large.vrt"), s.temp("large.gpkg")
    corners = 6 - step / 2, north + step / 2, 6 + (SIDE - 0.5) * step, north - (SIDE - 0.5) * step
    s.run(["gdal_translate", "-q", "-of", "VRT", "-a_srs", "EPSG:4326", "-a_ullr", *map(repr, corners), raw, placed])
    s.import_terrain(database, placed, name="large")
    return database


def write(database, *options):
    folder = s.temp("tiles")
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([s.RQT, "tiles", database, "-o", folder, *options], check=True)
    seconds, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    sizes = [os.path.getsize(os.path.join(path, name)) for path, _, names in os.walk(folder) for name in names if name.endswith(".terrain")]
    print("  %-32s %6.2f s, %6.2f s of processors, %d tiles, %.0f a second, %.1f MB" %
          (" ".join(options), seconds, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, len(sizes), len(sizes) / seconds, sum(sizes) / 1e6))
    shutil.rmtree(folder)


def vertices_of(tile):
    """Of a tile's bytes: vertices, triangles, metadata."""
    count = int.from_bytes(tile[88:92], "little")
    at = 92 + 6 * count + (-(92 + 6 * count) % 4 if count > 65536 else 0)
    metadata = tile[tile.rindex(b'{"geometricError"'):]
    return count, int.from_bytes(tile[at:at + 4], "little"), json.loads(metadata)


def ask_all(database):
    service = subprocess.Popen([s.RQT, "serve", "--port", "0", database], stdout=subprocess.PIPE, text=True)
    connection = http.client.HTTPConnection("127.0.0.1", int(service.stdout.readline().rsplit(":", 1)[1].strip("/\n")))
    root = "/collections/large/tiles/quantized-mesh/"

    def ask(path):
        start = time.perf_counter()
        connection.request("GET", root + path)
        body = connection.getresponse().read()
        return 1000 * (time.perf_counter() - start), body
    try:
        layer = json.loads(ask("layer.json")[1])
        print("  level  asked  first ms  again ms  vertices  triangles    bytes  stated error m  taken by clients m")
        for z, ranges in enumerate(layer["available"]):
            tiles = ["%d/%d/%d.terrain" % (z, x, y) for r in ranges for y in range(r["startY"], r["endY"] + 1) for x in range(r["startX"], r["endX"] + 1)]
            tiles = tiles[len(tiles) // 2:][:ASKED]
            first = [ask(tile) for tile in tiles]
            again = [ask(tile) for _ in range(3) for tile in tiles]
            known = [vertices_of(body) for _, body in first]
            print("  %5d %6d %9.2f %9.2f %9.0f %10.0f %8.0f %15.3f %19.3f" %
                  (z, len(tiles), statistics.median(t for t, _ in first), statistics.median(t for t, _ in again), statistics.mean(k[0] for k in known),
                   statistics.mean(k[1] for k in known), statistics.mean(len(body) for _, body in first), max(k[2]["error"] for k in known),
                   known[0][2]["geometricError"]))
    finally:
        service.terminate()
        service.wait()


path = terrain()
print("A pyramid of %d x %d samples, written:" % (SIDE, SIDE))
for arguments in (["--jobs", "1"], ["--jobs", "2"], ["--jobs", "2", "--gzip"]):
    write(path, *arguments)
print("Live:")
ask_all(path)
