"""bench_tiles.py [SIDE] - what tiles for globes cost, and what they are worth: a pyramid of SIDE x SIDE samples (default 4097)
written with one and with two workers, plain and compressed; each level asked of the service, the first time and again; and
the true error of its tiles, decoded here, beside grids of 65 x 65 heights of the same tiles.

The terrain is a fractal, at three seconds of arc. RQT names the command. numpy and GDAL's Python come with gdal-bin.

True errors are above or below the mesh in longitude, latitude and height, as clients ask for heights, at every sample of the
tiles that are measured. (In space, with the Earth's curvature, tests/test_tiles.py and make verify-tiles measure them.)

The grids stand for cesium-terrain-builder, which is not packaged: for every tile GDAL resamples the raster to 65 x 65
heights, of which the outermost lie on the tile's sides; they are kept as heightmap-1.0 has them, in steps of 0.2 m, and
clients draw two triangles between four of them. Of GDAL's `average` (that program's default) and `bilinear` the one that is
less off counts, tile by tile. Left out: its overviews, out of which it resamples coarse levels, its water mask, and its
time. Only tiles that lie wholly in the raster are taken; where none does, there is no figure.

Last the same of Terrarium: what is stated of some tiles, and what the samples in them, half a pixel from their sides and more, are off
from bilinear interpolation of the pixels, as clients have it.
"""
import gzip
import http.client
import json
import os
import resource
import shutil
import statistics
import subprocess
import sys
import time

import numpy
from osgeo import gdal

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import sql_support as s  # noqa: E402

SIDE = int(sys.argv[1]) if len(sys.argv) > 1 else 4097
ASKED, MEASURED, AT_ONCE = 60, 6, 1 << 20
UNITS, GRID = 32767, 65
NORTH, WEST, STEP = 48, 6, 1 / 1200
gdal.UseExceptions()


def terrain():
    raw = s.write_large(s.temp("large.raw"), SIDE, 1)
    placed, database = s.temp("large.vrt"), s.temp("large.gpkg")
    corners = WEST - STEP / 2, NORTH + STEP / 2, WEST + (SIDE - 0.5) * STEP, NORTH - (SIDE - 0.5) * STEP
    s.run(["gdal_translate", "-q", "-of", "VRT", "-a_srs", "EPSG:4326", "-a_ullr", *map(repr, corners), raw, placed])
    s.import_terrain(database, placed, name="large")
    return database, placed


def write(database, *options):
    folder = s.temp("tiles")
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([s.RQT, "tiles", database, "-o", folder, *options], check=True)
    seconds, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    sizes = [os.path.getsize(os.path.join(path, name)) for path, _, names in os.walk(folder) for name in names if name.endswith((".terrain", ".png"))]
    print("  %-32s %6.2f s, %6.2f s of processors, %d tiles, %.0f a second, %.1f MB" %
          (" ".join(options), seconds, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, len(sizes), len(sizes) / seconds, sum(sizes) / 1e6))
    shutil.rmtree(folder)


# ------------------------------------------------------------------------------------------------- a tile's true error

class Samples:
    """The raster's samples in a tile: their heights, and where they are in it, 0 to 1 from the south-west."""

    def __init__(self, heights, z, x, y):
        self.side = 180 / 2**z
        self.west, self.south = -180 + x * self.side, -90 + y * self.side
        col = (self.west - WEST) / STEP, (self.west + self.side - WEST) / STEP
        row = (NORTH - self.south - self.side) / STEP, (NORTH - self.south) / STEP
        cols, rows = (numpy.arange(max(0, numpy.ceil(a)), min(SIDE - 1, numpy.floor(b)) + 1, dtype=int) for a, b in (col, row))
        self.is_whole = min(col[0], row[0]) >= 0 and max(col[1], row[1]) <= SIDE - 1
        self.u, self.v = (WEST + cols * STEP - self.west) / self.side, (NORTH - rows[::-1] * STEP - self.south) / self.side
        self.heights = heights[rows[0]:rows[-1] + 1, cols[0]:cols[-1] + 1][::-1]


def true_error(tile, samples):
    """Of the triangles over the samples: the largest difference, and how many samples have a triangle."""
    u, v, h = (n / UNITS for n in tile.uvh)
    h = tile.low + (tile.high - tile.low) * h
    most, seen = 0.0, numpy.zeros(samples.heights.shape, dtype=bool)
    for a, b, c in tile.triangles:
        area = (u[b] - u[a]) * (v[c] - v[a]) - (u[c] - u[a]) * (v[b] - v[a])
        if area == 0:
            continue
        corner = [a, b, c]
        i0, i1 = numpy.searchsorted(samples.u, [u[corner].min(), u[corner].max() + 1e-12])
        j0, end = numpy.searchsorted(samples.v, [v[corner].min(), v[corner].max() + 1e-12])
        band = max(1, AT_ONCE // max(1, i1 - i0))
        for j in range(j0, end, band):
            j1 = min(end, j + band)
            du, dv = samples.u[None, i0:i1] - u[a], samples.v[j:j1, None] - v[a]
            wb, wc = (du * (v[c] - v[a]) - (u[c] - u[a]) * dv) / area, ((u[b] - u[a]) * dv - du * (v[b] - v[a])) / area
            inside = (wb >= -1e-9) & (wc >= -1e-9) & (wb + wc <= 1 + 1e-9)
            off = numpy.abs(h[a] + wb * (h[b] - h[a]) + wc * (h[c] - h[a]) - samples.heights[j:j1, i0:i1])[inside]
            most = max(most, off.max(initial=0))
            seen[j:j1, i0:i1] |= inside
    return most, seen.mean()


class Tile:
    """Read of its bytes alone (CesiumGS/quantized-mesh)."""

    def __init__(self, data):
        count = int.from_bytes(data[88:92], "little")
        codes = numpy.frombuffer(data, "<u2", 3 * count, 92).reshape(3, count).astype(int)
        self.low, self.high = map(float, numpy.frombuffer(data, "<f4", 2, 24))
        self.uvh = numpy.cumsum((codes >> 1) ^ -(codes & 1), axis=1)
        index = 4 if count > 65536 else 2
        at = 92 + 6 * count
        at += -at % index
        triangles = int.from_bytes(data[at:at + 4], "little")
        codes = numpy.frombuffer(data, "<u%d" % index, 3 * triangles, at + 4).astype(int)
        fresh = codes == 0
        self.triangles = (numpy.cumsum(fresh) - fresh - codes).reshape(triangles, 3)
        self.metadata = json.loads(data[data.rindex(b'{"geometricError"'):])


def grid_error(raster, samples):
    """What is off, of the better of two grids of heights, and its bytes."""
    half, best = samples.side / (GRID - 1) / 2, None
    bounds = samples.west - half, samples.south - half, samples.west + samples.side + half, samples.south + samples.side + half
    for method in ("average", "bilinear"):
        warped = gdal.Warp("", raster, format="MEM", outputType=gdal.GDT_Float64, outputBounds=bounds, width=GRID, height=GRID, resampleAlg=method)
        steps = numpy.clip(numpy.round((warped.ReadAsArray() + 1000) * 5), 0, 65535)
        grid = steps[::-1] / 5 - 1000
        x, y = samples.u[None, :] * (GRID - 1), samples.v[:, None] * (GRID - 1)
        i, j = numpy.minimum(x.astype(int), GRID - 2), numpy.minimum(y.astype(int), GRID - 2)
        x, y = x - i, y - j
        south_west, south_east, north_west, north_east = grid[j, i], grid[j, i + 1], grid[j + 1, i], grid[j + 1, i + 1]
        upper = north_west + x * (north_east - north_west) - (1 - y) * (north_west - south_west)
        lower = south_west + x * (south_east - south_west) + y * (north_east - south_east)
        error = numpy.abs(numpy.where(y >= x, upper, lower) - samples.heights).max()
        if best is None or error < best[0]:
            best = error, len(gzip.compress(steps.astype("<u2").tobytes() + b"\x0f\x00", mtime=0))
    return best


def exact_vertices(db, tile, samples):
    """How many vertices `exact` has, cut to the tile, for the error that it states. That error is in space, and there is no cut
    in space: what curvature adds shows in mode cover, which knows both."""
    cut, cover, space = (
        s.one(db, "SELECT count(*) FROM rqt_range(rqt_bbox(?, ?, ?, ?), ?, NULL, ?)", samples.west, samples.south, samples.west + samples.side,
              samples.south + samples.side, tile.metadata["error"], json.dumps(dict(options, outline="tol")))
        for options in ({"mode": "cut"}, {}, {"frame": "ecef"}))
    return cut * max(1, space / cover)


# ----------------------------------------------------------------------------------------------------------- the tables

def ask_all(database):
    """Prints what they took; some of each level, their bytes by (z, x, y)."""
    service = subprocess.Popen([s.RQT, "serve", "--port", "0", database], stdout=subprocess.PIPE, text=True)
    connection = http.client.HTTPConnection("127.0.0.1", int(service.stdout.readline().rsplit(":", 1)[1].strip("/\n")))
    root, kept = "/collections/large/tiles/quantized-mesh/", {}

    def ask(path):
        start = time.perf_counter()
        connection.request("GET", root + path)
        body = connection.getresponse().read()
        return 1000 * (time.perf_counter() - start), body
    try:
        layer = json.loads(ask("layer.json")[1])
        print("  level  asked  first ms  again ms  (worst)  a second")
        for z, ranges in enumerate(layer["available"]):
            tiles = [(z, x, y) for r in ranges for y in range(r["startY"], r["endY"] + 1) for x in range(r["startX"], r["endX"] + 1)]
            tiles = tiles[len(tiles) // 2:][:ASKED]
            first = [ask("%d/%d/%d.terrain" % tile) for tile in tiles]
            again = [[ask("%d/%d/%d.terrain" % tile)[0] for _ in range(3)] for tile in tiles]
            medians = [statistics.median(times) for times in again]
            print("  %5d %6d %9.2f %9.2f %8.2f %9.0f" %
                  (z, len(tiles), statistics.median(t for t, _ in first), statistics.median(medians), max(medians), 1000 / statistics.mean(medians)))
            for tile, (_, body) in list(zip(tiles, first))[::max(1, len(tiles) // MEASURED)]:
                kept[tile] = body
    finally:
        service.terminate()
        service.wait()
    return kept


def measure(database, placed, kept):
    db = s.connect(database)
    raster = gdal.Open(placed)
    heights = raster.ReadAsArray().astype(float)
    print("  level  tiles  vertices  of exact  triangles    bytes  gzip  true m  stated m  clients take  |  grid: triangles  gzip  true m")
    for z in sorted({tile[0] for tile in kept}):
        rows, grids = [], []
        for name, body in kept.items():
            if name[0] != z:
                continue
            tile = Tile(body)
            if not len(tile.triangles):
                continue # of level 0 both are there
            samples = Samples(heights, *name)
            error, share = true_error(tile, samples)
            if share < 0.9:
                raise SystemExit("%s: its triangles are over %.0f %% of its samples" % (name, 100 * share))
            rows.append((error, len(body), len(gzip.compress(body, mtime=0)), tile, exact_vertices(db, tile, samples)))
            if samples.is_whole:
                grids.append(grid_error(raster, samples))
        tiles = [row[3] for row in rows]
        vertices = statistics.mean(tile.uvh.shape[1] for tile in tiles)
        print("  %5d %6d %9.0f %9.2f %10.0f %8.0f %5.0f %7.2f %9.2f %13.2f  | %s" %
              (z, len(rows), vertices, vertices / statistics.mean(row[4] for row in rows), statistics.mean(len(tile.triangles) for tile in tiles),
               statistics.mean(row[1] for row in rows), statistics.mean(row[2] for row in rows), max(row[0] for row in rows),
               max(tile.metadata["verticalError"] for tile in tiles), tiles[0].metadata["geometricError"],
               "%15d %5.0f %7.2f" % (2 * (GRID - 1)**2, statistics.mean(g[1] for g in grids), max(g[0] for g in grids)) if grids else "%15s" % "-"))
    db.close()


class Maps:
    """Terrarium: each level live, and the errors of some of its tiles."""

    def __init__(self, database, placed):
        service = subprocess.Popen([s.RQT, "serve", "--port", "0", database], stdout=subprocess.PIPE, text=True)
        self.connection = http.client.HTTPConnection("127.0.0.1", int(service.stdout.readline().rsplit(":", 1)[1].strip("/\n")))
        try:
            levels = self.ask_levels()
        finally:
            service.terminate()
            service.wait()
        self.heights = gdal.Open(placed).ReadAsArray().astype(float)
        print("  level  asked  first ms  again ms  (worst)    bytes  true m  stated m")
        for z, names, first, again in levels:
            errors = [self.errors(z, *name, body) for name, (_, body) in list(zip(names, first))[:MEASURED]]
            print("  %5d %6d %9.2f %9.2f %8.2f %8.0f %7.2f %9.2f" %
                  (z, len(names), statistics.median(t for t, _ in first), statistics.median(again), max(again), statistics.mean(len(body) for _, body in first), *max(errors)))

    def ask(self, path):
        start = time.perf_counter()
        self.connection.request("GET", "/collections/large/tiles/terrarium/" + path)
        body = self.connection.getresponse().read()
        return 1000 * (time.perf_counter() - start), body

    def ask_levels(self):
        document, levels = json.loads(self.ask("tile.json")[1]), []
        west, south, east, north = document["bounds"]
        for z in range(document["minzoom"], document["maxzoom"] + 1):
            x0, x1, y0, y1 = (int(share * 2**z) for share in ((west + 180) / 360, (east + 180) / 360, self.row(north), self.row(south)))
            names = [(x, y) for y in range(y0, y1 + 1) for x in range(x0, x1 + 1)]
            names = names[len(names) // 2:][:ASKED // 3]
            first = [self.ask("%d/%d/%d.png" % (z, *name)) for name in names]
            levels.append((z, names, first, [min(self.ask("%d/%d/%d.png" % (z, *name))[0] for _ in range(3)) for name in names]))
        return levels

    @staticmethod
    def row(latitude):
        """A share of the world's square, from the north."""
        return (1 - numpy.arcsinh(numpy.tan(numpy.radians(latitude))) / numpy.pi) / 2

    def errors(self, z, x, y, body):
        gdal.FileFromMemBuffer("/vsimem/tile.png", body)
        picture = gdal.Open("/vsimem/tile.png")
        red, green, blue = picture.ReadAsArray().astype(float)
        pixels, stated = red * 256 + green + blue / 256 - 32768, float(picture.GetMetadataItem("error_metres"))
        index = numpy.arange(SIDE)
        col, row = (((WEST + index * STEP + 180) / 360 * 2**z) - x) * 256 - 0.5, (self.row(NORTH - index * STEP) * 2**z - y) * 256 - 0.5
        cols, rows = (col >= 0) & (col < 255), (row >= 0) & (row < 255)
        i, j = numpy.floor(col[cols]).astype(int), numpy.floor(row[rows]).astype(int)
        u, v = col[cols] - i, (row[rows] - j)[:, None]
        four = [pixels[numpy.ix_(j + b, i + a)] for b in (0, 1) for a in (0, 1)]
        off = numpy.abs((four[0] * (1 - u) + four[1] * u) * (1 - v) + (four[2] * (1 - u) + four[3] * u) * v - self.heights[numpy.ix_(rows, cols)])
        return off[numpy.all([h != 0 for h in four], axis=0)].max(initial=0), stated


path, source = terrain()
print("A pyramid of %d x %d samples, written (aim: 6 s on two processors):" % (SIDE, SIDE))
for arguments in (["--jobs", "1"], ["--jobs", "2"], ["--jobs", "2", "--gzip"]):
    write(path, *arguments)
print("  (cesium-terrain-builder, as others have published it and not measured here: 12 s for 4097 x 4097, no bound on the error, millions of files)")
print("Live (aim: 5 ms again):")
asked = ask_all(path)
print("True error, above or below at every sample of the tiles (some of each level), beside grids of 65 x 65 heights of the same tiles:")
measure(path, source, asked)
print("Terrarium, for maps (aim: 5 ms again):")
write(path, "--kind", "terrarium", "--jobs", "2")
Maps(path, source)
