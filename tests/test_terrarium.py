"""Terrarium tiles: GDAL reads the pictures, and what is drawn between four pixels is put beside every sample of the raster.

Where pixels lie, what they mean and what bilinear interpolation is are worked out here, from the formats' descriptions; nothing is asked
of the program but tiles (and, in one place that says so, rqt_height).
"""
import glob
import json
import math
import os
import shutil
import struct
import subprocess
import zlib

import numpy as np
from osgeo import gdal

import serve_support as service
import sql_support as s

gdal.UseExceptions()
DICE = np.random.default_rng(service.seed())
WGS84 = 'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]]'


class Raster:
    """Samples with their longitudes and latitudes, as GDAL has them."""

    def __init__(self, path):
        d = gdal.Open(path)
        band, g = d.GetRasterBand(1), d.GetGeoTransform()
        self.z = band.ReadAsArray().astype(float)
        self.valid = np.isfinite(self.z)
        if band.GetNoDataValue() is not None:
            self.valid &= self.z != band.GetNoDataValue()
        self.lon = g[0] + (np.arange(self.z.shape[1]) + 0.5) * g[1]
        self.lat = g[3] + (np.arange(self.z.shape[0]) + 0.5) * g[5]


def make_raster(name, z, west, north, cell, void=None):
    path = s.temp(name + ".tif")
    d = gdal.GetDriverByName("GTiff").Create(path, z.shape[1], z.shape[0], 1, gdal.GDT_Float32)
    d.SetGeoTransform((west - cell / 2, cell, 0, north + cell / 2, 0, -cell))
    d.SetProjection(WGS84)
    if void is not None:
        d.GetRasterBand(1).SetNoDataValue(-9999)
        z = np.where(void, -9999, z)
    d.GetRasterBand(1).WriteArray(z.astype("float32"))
    return path


def lat_of(y):
    """Of a share of the world's square, from the north."""
    return math.degrees(math.atan(math.sinh(math.pi * (1 - 2 * y))))


def y_of(lat):
    return (1 - np.arcsinh(np.tan(np.radians(np.clip(lat, -89.9, 89.9)))) / math.pi) / 2


class Pictures:
    """A folder of tiles: {(x, y): array of heights} of each level, and what the tiles say of themselves."""

    def __init__(self, name, source, *options, jobs=1):
        self.name, self.raster, self.database, self.folder = name, Raster(source), s.temp(name + ".gpkg"), s.temp(name + "_tiles")
        s.run([s.RQT, "import", "--name", name, *options, source, self.database])
        s.run([s.RQT, "tiles", self.database, "-o", self.folder, "--kind", "terrarium", "--jobs", str(jobs)])
        self.json = json.load(open(os.path.join(self.folder, "tile.json")))
        self.levels = {}
        for path in glob.glob(self.folder + "/*/*/*.png"):
            z, x, y = (int(part) for part in path[:-4].split("/")[-3:])
            self.levels.setdefault(z, {})[x, y] = self.read(path)

    def read(self, path):
        d = gdal.Open(path)
        r, g, b = d.ReadAsArray().astype(float)
        told = d.GetMetadata()
        return r * 256 + g + b / 256 - 32768, float(told["error_metres"]), int(told["void_pixels"])

    def mosaic(self, z):
        """All pixels of a level and a tile around, wrapped at the antimeridian; the column and row of its first one."""
        tiles, n = self.levels[z], 1 << z
        x0, x1 = min(x for x, _ in tiles) - 1, max(x for x, _ in tiles) + 1
        y0, y1 = min(y for _, y in tiles) - 1, max(y for _, y in tiles) + 1
        all_ = np.zeros(((y1 - y0 + 1) * 256, (x1 - x0 + 1) * 256))
        for x in range(x0, x1 + 1):
            for y in range(y0, y1 + 1):
                if (x % n, y) in tiles:
                    all_[(y - y0) * 256:(y - y0 + 1) * 256, (x - x0) * 256:(x - x0 + 1) * 256] = tiles[x % n, y][0]
        return all_, 256 * x0, 256 * y0

    def measure(self, z):
        """{tile: (what is stated, the worst of the samples in its square, how many of them have four pixels, how many there are)}"""
        pixels, col0, row0 = self.mosaic(z)
        found, count = {}, 256 << z
        for turn in (-360, 0, 360):
            col, row = (self.raster.lon + turn + 180) / 360 * count, y_of(self.raster.lat) * count
            cols, rows = (col >= 0) & (col < count), (row >= 0) & (row < count)
            if not cols.any() or not rows.any():
                continue
            here = np.ix_(rows, cols)
            across, down = col[cols] - 0.5 - col0, row[rows] - 0.5 - row0
            i, j = np.floor(across).astype(int), np.floor(down).astype(int)
            u, v = across - i, (down - j)[:, None]
            four = [pixels[np.ix_(j + b, i + a)] for b in (0, 1) for a in (0, 1)]
            counts = self.raster.valid[here] & np.all([p != 0 for p in four], axis=0)
            drawn = (four[0] * (1 - u) + four[1] * u) * (1 - v) + (four[2] * (1 - u) + four[3] * u) * v
            off = np.where(counts, np.abs(drawn - self.raster.z[here]), 0)
            xs, ys = (col[cols] // 256).astype(int), (row[rows] // 256).astype(int)
            for y in np.unique(ys):
                for x in np.unique(xs):
                    part = np.ix_(ys == y, xs == x)
                    before = found.get((x, y), (0, 0, 0))
                    found[x, y] = (max(before[0], off[part].max()), before[1] + counts[part].sum(), before[2] + self.raster.valid[here][part].sum())
        return {key: (self.levels[z][key][1] if key in self.levels[z] else -1, *value) for key, value in found.items()}

    def expected(self, z):
        """The tiles that overlap the rectangle of the samples."""
        n, r = 1 << z, self.raster
        return {(x % n, y) for y in range(n) if lat_of(y / n) > r.lat[-1] and lat_of((y + 1) / n) < r.lat[0]
                for x in range(-n, 2 * n) if -180 + x / n * 360 < r.lon[-1] and -180 + (x + 1) / n * 360 > r.lon[0]}


def judge(p, most_ratio):
    wrong, loose, seen = [], [], 0
    for z in sorted(p.levels):
        for key, (stated, worst, counted, _) in p.measure(z).items():
            seen += counted
            if counted and worst > stated:
                wrong.append((z, key, stated, worst))
            if counted and stated > most_ratio * worst + 1.01 * p.json["steps"][z] + 0.01:
                loose.append((z, key, stated, worst))
    s.equal("%s: at every sample of all %d levels the stated error holds" % (p.name, len(p.levels)), wrong, [])
    s.equal("%s: it is no more than %g times the true one" % (p.name, most_ratio), loose, [])
    s.check("%s: ... of many samples" % p.name, seen > 0.8 * p.raster.valid.sum(), seen)
    s.equal("%s: the tiles are those that meet the raster" % p.name, [z for z, tiles in p.levels.items() if set(tiles) != p.expected(z)], [])
    s.equal("%s: the levels are those of tile.json" % p.name, sorted(p.levels), list(range(p.json["minzoom"], p.json["maxzoom"] + 1)))
    s.equal("%s: void pixels are counted" % p.name, [(z, key) for z, tiles in p.levels.items() for key, t in tiles.items() if (t[0] == 0).sum() != t[2]], [])
    last = p.json["maxzoom"]
    wide, high = 360 / (256 << last), 360 / (256 << last) * math.cos(math.radians(0 if p.raster.lat[-1] <= 0 <= p.raster.lat[0] else np.abs(p.raster.lat).min()))
    cell = p.raster.lon[1] - p.raster.lon[0]
    s.check("%s: pixels of the last level are no wider than samples, those before are" % p.name,
            max(wide, high) <= cell * (1 + 1e-9) < 2 * max(wide, high), (wide, high, cell))


def inside(p, z, key):
    """Which pixels' centres are in the rectangle of the samples."""
    n, (x, y), r = 256 << z, key, p.raster
    lon = (256 * x + np.arange(256) + 0.5) * 360 / n - 180
    lat = np.array([lat_of((256 * y + j + 0.5) / n) for j in range(256)])
    cols = np.any([(lon + turn >= r.lon[0]) & (lon + turn <= r.lon[-1]) for turn in (-360, 0, 360)], axis=0)
    return np.outer((lat <= r.lat[0]) & (lat >= r.lat[-1]), cols), lon, lat


def no_holes(p):
    s.equal("%s: pixels in the raster, and no others, have a height" % p.name,
            [(z, key) for z, tiles in p.levels.items() for key, t in tiles.items() if ((t[0] != 0) != inside(p, z, key)[0]).any()], [])


def on_the_mesh(p):
    """Pixels of the last levels against rqt_height."""
    db, wrong, voids, seen = s.connect(p.database), [], 0, 0
    for z in list(sorted(p.levels))[-2:]:
        for key, (heights, _, _) in p.levels[z].items():
            where, lon, lat = inside(p, z, key)
            if not where.any():
                continue
            rows, cols = np.nonzero(where)
            for k in DICE.choice(len(rows), min(len(rows), 60), replace=False):
                there, told = s.one(db, "SELECT rqt_height(?1, ?2)", float(lon[cols[k]]), float(lat[rows[k]])), heights[rows[k], cols[k]]
                seen, voids = seen + 1, voids + (there is None)
                if (there is None) != (told == 0) or (there is not None and abs(there - told) > (1.51 if abs(there) < 1 else 0.501) * p.json["steps"][z]):
                    wrong.append((z, key, there, told))
    s.check("%s: pixels of the last levels are rqt_height's, to half a step" % p.name, seen > 50 and not wrong, (seen, wrong[:3]))
    return voids


# ----------------------------------------------------------------------------------------------------- real terrain
subprocess.run(["unzip", "-qo", os.path.join(s.DATA, "N42E001.hgt.zip"), "-d", s.TEMP], check=True)
ALPS = Pictures("alps", os.path.join(s.DATA, "glarus_1arc_native_161.tif"))
AFRICA = Pictures("africa", os.path.join(s.DATA, "eastafrica.tif"))
VOIDS = Pictures("voids", s.temp("N42E001.hgt"), jobs=2)
WORLD = Pictures("world", os.path.join(s.DATA, "etopo1_1deg.tif"))
for p in (ALPS, AFRICA, VOIDS, WORLD):
    judge(p, 1.3)
for p in (ALPS, AFRICA):
    no_holes(p)
    on_the_mesh(p)
s.check("voids: some of those are void", on_the_mesh(VOIDS) > 0)
on_the_mesh(WORLD)
last = VOIDS.measure(VOIDS.json["maxzoom"]).values()
s.check("voids: what is near none is all there", sum(t[2] for t in last) > 0.98 * sum(t[3] for t in last), [t[1:] for t in last])

# ------------------------------------------------------------------------------------------------------ made terrain
x, y = np.meshgrid(np.arange(331), np.arange(203))
rough = np.cumsum(np.cumsum(DICE.normal(0, 1, (203, 331)), 0), 1) * 2
NORTH = Pictures("north", make_raster("north", rough, 14.03, 79.97, 0.0125, (x - 150) ** 2 + (y - 90) ** 2 < 500))
judge(NORTH, 1.3)
NOISE = Pictures("noise", make_raster("noise", DICE.integers(-400, 400, (301, 301)), -7.5, 3.1, 1 / 64, DICE.random((301, 301)) < 0.0005))
judge(NOISE, 1.6)
spike = np.zeros((257, 400))
spike[100, 170] = 5000
SPIKE = Pictures("F5_F6_spike_and_pit", make_raster("spike", spike - 3000 * (x[:1, :1] + np.pad([[1]], ((31, 225), (60, 339)))), 100, -20, 1 / 100))
judge(SPIKE, 1.3)
# Spikes beside voids that are corners of four leaves, at one stride each: the leaves are not kept, and nothing is known of the spikes.
islands, holes = 100 + DICE.normal(0, 0.2, (321, 321)), np.zeros((321, 321), bool)
for n, j in enumerate(range(32, 300, 32)):
    for i in range(4 << n % 3, 300, 32):
        holes[j, i], islands[j, i + 1] = True, 3000
ISLANDS = Pictures("F16_F17_islands", make_raster("islands", islands, 20.001, 30.003, 1 / 100, holes))
judge(ISLANDS, 1.3)
wave = 1500 * np.sin(np.radians(np.arange(0, 360.1, 0.75)))[None, :] * np.cos(np.radians(np.arange(75, -75.1, -0.75)))[:, None] + DICE.normal(0, 40, (201, 481))
wave[:, -1] = wave[:, 0]
TURNED = Pictures("turned", make_raster("turned", wave, 0, 75, 0.75))
judge(TURNED, 1.3)
no_holes(TURNED)
s.check("turned: both halves of the globe are there", {(0, 0), (1, 0), (0, 1), (1, 1)} <= set(TURNED.levels[1]))
FLAT = Pictures("flat", make_raster("flat", np.where(x[:90] < 200, 0, 0.25), 5, 50, 0.01, y[:90] > 80))
judge(FLAT, 1.3)
told = {h for tiles in FLAT.levels.values() for t in tiles.values() for h in np.unique(t[0])}
s.check("flat: land at 0 m is a step above 0, void and beyond are 0",
        {FLAT.json["steps"][z] for z in FLAT.levels} <= told and 0 in told and min(told) == 0, sorted(told))
DEEP = Pictures("deep", make_raster("deep", np.where(x < 100, -40000, 40000), 5, 50, 0.01))
s.check("deep: what no colour can tell is the nearest one, and the error says so",
        all(t[1] >= 40000 - 32768 for t in DEEP.levels[DEEP.json["maxzoom"]].values() if t[2] < 65536), [t[1] for t in DEEP.levels[5].values()])
nearest = min(t[1] for t in DEEP.levels[DEEP.json["maxzoom"]].values() if t[2] < 65536)
s.check("deep: ... but no more than it has to", nearest <= 40000 - 32768 + 1.5, nearest)

# ---------------------------------------------------------------------------------------------------------- the files


def chunks(data):
    at = 8
    while at < len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        body = data[at + 8:at + 8 + size]
        yield kind.decode(), body, struct.unpack_from(">I", data, at + 8 + size)[0] == zlib.crc32(kind + body)
        at += 12 + size


def files(folder):
    return {path[len(folder) + 1:]: open(path, "rb").read() for path in sorted(glob.glob(folder + "/*/*/*.png") + [folder + "/tile.json"])}


whole = files(ALPS.folder)
bad = []
for name, data in whole.items():
    if name.endswith(".png"):
        parts = list(chunks(data))
        right = [kind for kind, _, _ in parts] == ["IHDR", "tEXt", "tEXt", "IDAT", "IEND"] and all(fine for _, _, fine in parts)
        if not right or data[:8] != b"\x89PNG\r\n\x1a\n" or parts[0][1] != struct.pack(">IIBBBBB", 256, 256, 8, 2, 0, 0, 0) or len(zlib.decompress(parts[3][1])) != 256 * 769:
            bad.append(name)
s.equal("pictures are RGB of 256 x 256 without alpha or gaps between chunks", bad, [])
again = s.temp("again")
s.run([s.RQT, "tiles", ALPS.database, "-o", again, "--kind", "terrarium", "--jobs", "3", "--gzip"])
s.equal("F44_number_of_workers: equal bytes, which --gzip leaves alone", files(again) == whole, True)
s.equal("tile.json is TileJSON 3 for a raster-dem source", {k: ALPS.json[k] for k in ("tilejson", "scheme", "tiles", "minzoom", "encoding", "tileSize")},
        {"tilejson": "3.0.0", "scheme": "xyz", "tiles": ["{z}/{x}/{y}.png"], "minzoom": 0, "encoding": "terrarium", "tileSize": 256})
s.check("... with the terrain's bounds", np.allclose(ALPS.json["bounds"], [ALPS.raster.lon[0], ALPS.raster.lat[-1], ALPS.raster.lon[-1], ALPS.raster.lat[0]], atol=1e-9), ALPS.json["bounds"])
s.equal("... those of the world end where Mercator's square does", [round(b, 6) for b in WORLD.json["bounds"]], [-180, -85.051129, 180, 85.051129])
named = s.temp("<b>&amp;.tif")
shutil.copy(os.path.join(s.DATA, "glarus_1arc_native_161.tif"), named)
hostile = s.temp("hostile.gpkg")
s.run([s.RQT, "import", "--name", "h", named, hostile])
s.run([s.RQT, "tiles", hostile, "-o", s.temp("hostile"), "--kind", "terrarium", "--levels", "0"])
attribution = json.load(open(s.temp("hostile/tile.json")))["attribution"]
s.check("names of files are no HTML in the attribution", "&#60;b&#62;&#38;amp;" in attribution and "<" not in attribution, attribution)

s.run([s.RQT, "tiles", hostile, "-o", s.temp("deep/er/placed"), "--kind", "terrarium", "--levels", "0", "--url", "https://example.org/maps"])
s.equal("addresses are whole where the folder's is told, and folders are made", json.load(open(s.temp("deep/er/placed/tile.json")))["tiles"], ["https://example.org/maps/{z}/{x}/{y}.png"])
for url in ("ftp://example.org/", "https://", "example.org", 'https://a"b/', "https://a/?b"):
    refused = subprocess.run([s.RQT, "tiles", hostile, "-o", s.temp("deep"), "--kind", "terrarium", "--url", url], capture_output=True, text=True)
    s.check("no address: " + url, refused.returncode == 2 and "--url" in refused.stderr, refused.stderr)

# --------------------------------------------------------------------------------------------------------- the service
plane = s.temp("plane.gpkg")
s.run([s.RQT, "import", "--name", "plane", os.path.join(s.DATA, "glarus_gentle_25m_161.tif"), plane])
refused = subprocess.run([s.RQT, "tiles", plane, "-o", s.temp("refused"), "--kind", "terrarium"], capture_output=True, text=True)
s.check("a terrain in other coordinates is refused", refused.returncode == 1 and "longitude and latitude on WGS 84" in refused.stderr, refused)
server = service.Service(ALPS.database, plane)
root = "/collections/alps/tiles/terrarium/"
s.equal("every tile is served, with the bytes of the command", [name for name, data in whole.items() if name.endswith(".png") and server.ask(root + name).body != data], [])
key = max(name for name in whole if name.endswith(".png"))
answer = server.ask(root + key, headers={"Accept-Encoding": "gzip, zstd"})
s.equal("... as pictures, packed once", (answer.status, answer.content_type, answer.content_encoding), (200, "image/png", None))
s.equal("... and not again when they have it", server.ask(root + key, headers={"If-None-Match": answer.etag}).status, 304)
around = {(z, x + i, y + j) for z, tiles in ALPS.levels.items() for x, y in tiles for i in (-1, 0, 1) for j in (-1, 0, 1)} - {(z, *k) for z, tiles in ALPS.levels.items() for k in tiles}
s.equal("tiles that do not meet the raster are not there", [t for t in sorted(around) if min(t) >= 0 and server.ask(root + "%d/%d/%d.png" % t).status != 404], [])
for path in ("14/8603/5722.png", "0/0/0.terrain", "0/0/0", "1/2/0.png", "00/0/0.png", "layer.json"):
    s.equal("nothing at " + path, server.ask(root + path).status, 404)


def addresses(**headers):
    return server.ask(root + "tile.json", headers={k.replace("_", "-"): v for k, v in headers.items()}).json()["tiles"]


s.equal("addresses in tile.json are whole", addresses(), ["http://127.0.0.1:%d%s{z}/{x}/{y}.png" % (server.port, root)])
s.equal("... as the client has named the host", addresses(Host="example.org:81"), ["http://example.org:81%s{z}/{x}/{y}.png" % root])
s.equal("... as a server before us says", addresses(X_Forwarded_Proto="https", X_Forwarded_Host="example.org, inner", X_Forwarded_Prefix="/dem/"),
        ["https://example.org/dem%s{z}/{x}/{y}.png" % root])
s.equal("... but what is no host's name is none", addresses(Host='a"><b>'), ["{z}/{x}/{y}.png"])
other = server.ask(root + "tile.json", headers={"X-Forwarded-Host": "example.org"})
again = server.ask(root + "tile.json", headers={"If-None-Match": other.etag})
s.check("... and what a store between us was told under one name is not what another name gets",
        again.status == 200 and again.json()["tiles"] == addresses() and "X-Forwarded-Host" in (other.vary or ""), (other.etag, again.status, other.vary))
s.equal("... while the same name is not told twice", server.ask(root + "tile.json", headers={"X-Forwarded-Host": "example.org", "If-None-Match": other.etag}).status, 304)
told = server.ask(root + "tile.json").json()
s.equal("all else is the command's", {**told, "tiles": 0}, {**ALPS.json, "tiles": 0})
answer = server.ask("/collections/plane/tiles/terrarium/tile.json")
s.check("a terrain without tiles says why", answer.status == 400 and "longitude and latitude on WGS 84" in answer.detail(), answer.detail())


def tiles_linked(name):
    hrefs = [link["href"] for link in server.ask("/collections/" + name).json()["links"] if "/tiles/" in link["href"]]
    return [href.rsplit("/tiles/")[1] for href in hrefs if server.ask(href[href.index("/collections"):]).status == 200]


s.equal("a terrain's document links to its tiles", tiles_linked(ALPS.name), ["quantized-mesh/layer.json", "3d-tiles/tileset.json", "terrarium/tile.json"])
s.equal("... where it has any", tiles_linked("plane"), [])
s.equal("the service ends well", server.stop()[0], 0)

s.finish()
