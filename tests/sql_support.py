"""What the SQL tests share: checks, a temporary directory, rasters, databases, and a reading of meshes of its own.

RQT and RQT_SO name the command and the extension (default: build/rqt, build/rqt.so). Nothing but Python's standard library.
"""
import array
import atexit
import json
import os
import shutil
import sqlite3
import struct
import subprocess
import sys
import tempfile

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
DATA = os.path.join(ROOT, "tests", "data")
RQT = os.path.abspath(os.environ.get("RQT", os.path.join(ROOT, "build", "rqt")))
RQT_SO = os.path.abspath(os.environ.get("RQT_SO", os.path.join(ROOT, "build", "rqt.so")))
DEMO = os.path.abspath(os.environ.get("RQT_DEMO", os.path.join(ROOT, "examples", "N44W072.hgt.zip")))
TEMP = tempfile.mkdtemp(prefix="rqt_sql_")
atexit.register(shutil.rmtree, TEMP, True)

passed = failed = 0


def check(name, fine, seen=""):
    """One line a check; `seen` says what was there instead."""
    global passed, failed
    if fine:
        passed += 1
        print("ok " + name)
    else:
        failed += 1
        print("FAILED %s%s" % (name, ": %s" % (seen,) if seen != "" else ""))
    sys.stdout.flush()
    return fine


def equal(name, seen, expected):
    return check(name, seen == expected, "%.300r instead of %.300r" % (seen, expected))


def raises(name, sentence, call):
    """The call fails, and says this sentence."""
    try:
        seen = "no error, but %.200r" % (call(),)
    except sqlite3.Error as error:
        seen = str(error)
        if sentence in seen:
            return check(name, True)
    return check(name, False, seen)


def finish():
    print("%d passed, %d failed" % (passed, failed))
    sys.exit(1 if failed else 0)


# ------------------------------------------------------------------------------------------- processes and databases

def temp(name):
    return os.path.join(TEMP, name)


def run(command, environment=None, text=None):
    """stdout and stderr together, and the exit status."""
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, input=text, universal_newlines=True,
                          env=dict(os.environ, **(environment or {})))
    return done.stdout, done.returncode


def import_terrain(database, *sources, **options):
    """rqt import; options as name="x", block=3, replace=True."""
    command = [RQT, "import"]
    for key, value in options.items():
        if value is False:
            continue
        command.append("--" + key.replace("_", "-"))
        if value is not True:
            command.append(str(value))
    said, status = run(command + list(sources) + [database])
    if status != 0:
        raise RuntimeError("import of %s: %s" % (sources, said))
    return said


def connect(database=":memory:", load=True):
    db = sqlite3.connect(database, isolation_level=None, check_same_thread=False)
    db.enable_load_extension(True)
    if load:
        db.load_extension(RQT_SO)
    return db


def one(db, sql, *arguments):
    row = db.execute(sql, arguments).fetchone()
    return row[0] if row and len(row) == 1 else row


def rows(db, sql, *arguments):
    return db.execute(sql, arguments).fetchall()


# -------------------------------------------------------------------------------------------------------- rasters

class Dice:
    """A small generator of random numbers, the same on every machine and in every version of Python."""

    def __init__(self, seed):
        self.state = seed

    def below(self, n):
        self.state = (self.state * 6364136223846793005 + 1442695040888963407) % 2**64
        return (self.state >> 33) % n


def write_grid(path, grid, x0=0, y0=None, cell=1, crs=None):
    """ESRI ASCII; None is a void. The centre of the first sample of the last row is at x0,y0, so that with the
    default the first sample is at 0,0."""
    if y0 is None:
        y0 = -(len(grid) - 1) * cell
    with open(path, "w") as out:
        out.write("ncols %d\nnrows %d\nxllcenter %r\nyllcenter %r\ncellsize %r\nNODATA_value -9999\n"
                  % (len(grid[0]), len(grid), x0, y0, cell))
        for row in grid:
            out.write(" ".join("-9999" if z is None else str(z) for z in row) + "\n")
    if crs:
        with open(os.path.splitext(path)[0] + ".prj", "w") as out:
            out.write(crs)
    return path


WGS84 = ('GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563,AUTHORITY["EPSG","7030"]],'
         'AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433],AUTHORITY["EPSG","4326"]]')


def rough_grid(width, height, seed, voids=0, relief=40):
    """Hills with noise; `voids` per mille of the samples are missing, half of them in patches."""
    dice = Dice(seed)
    coarse = [[dice.below(relief * 4) for _ in range(width // 8 + 2)] for _ in range(height // 8 + 2)]
    grid = []
    for j in range(height):
        line = []
        for i in range(width):
            a, b, u, v = i // 8, j // 8, i % 8, j % 8
            z = ((coarse[b][a] * (8 - u) + coarse[b][a + 1] * u) * (8 - v)
                 + (coarse[b + 1][a] * (8 - u) + coarse[b + 1][a + 1] * u) * v) // 64
            line.append(z + dice.below(relief // 4 + 1))
        grid.append(line)
    for _ in range(width * height * voids // 4000):
        i, j = dice.below(width), dice.below(height)
        grid[j][i] = None
        for b in range(j, min(j + 2, height)):
            for a in range(i, min(i + 3, width)):
                grid[b][a] = None if dice.below(2) else grid[b][a]
    return grid


def write_large(path, side, seed):
    """int16 raw with an ENVI header: mirrored copies of one fractal tile of 257^2, side = 256*n + 1."""
    dice, n = Dice(seed), 257
    tile = [[0] * n for _ in range(n)]
    step, roughness = 256, 600
    for y in (0, 256):
        for x in (0, 256):
            tile[y][x] = dice.below(roughness)
    while step > 1:
        half = step // 2
        for y in range(half, n, step):
            for x in range(half, n, step):
                tile[y][x] = (tile[y - half][x - half] + tile[y - half][x + half] + tile[y + half][x - half]
                              + tile[y + half][x + half]) // 4 + dice.below(roughness) - roughness // 2
        for y in range(0, n, half):
            for x in range(half if y % step == 0 else 0, n, step):
                around = [tile[b][a] for a, b in ((x - half, y), (x + half, y), (x, y - half), (x, y + half))
                          if 0 <= a < n and 0 <= b < n]
                tile[y][x] = sum(around) // len(around) + dice.below(roughness) - roughness // 2
        step, roughness = half, max(roughness * 45 // 100, 1)
    copies = (side - 1) // 256
    with open(path, "wb") as out:
        for j in range(side):
            c, v = divmod(j, 256)
            line = tile[v if c % 2 == 0 else 256 - v]
            back = line[::-1]
            whole = array.array("h", line)
            for i in range(1, copies):
                whole.extend((back if i % 2 else line)[1:])
            if sys.byteorder == "big":
                whole.byteswap()
            out.write(whole.tobytes())
    with open(os.path.splitext(path)[0] + ".hdr", "w") as out:
        out.write("ENVI\nsamples = %d\nlines = %d\nbands = 1\ndata type = 2\ninterleave = bsq\nbyte order = 0\n"
                  "map info = {Arbitrary, 1, 1, 0, 0, 1, 1}\n" % (side, side))
    return path


def read_raster(source):
    """A raster's heights by GDAL's own tools: rows of floats, None for void."""
    raw = temp("raw.img")
    said, status = run(["gdal_translate", "-q", "-ot", "Float64", "-of", "ENVI", source, raw])
    if status != 0:
        raise RuntimeError(said)
    described = run(["gdalinfo", "-json", source])[0]
    described = json.loads(described)
    width, height = described["size"]
    nodata = described["bands"][0].get("noDataValue")
    values = array.array("d")
    with open(raw, "rb") as stream:
        values.frombytes(stream.read())
    # Not-a-number never equals itself.
    return [[None if z == nodata or z != z else z for z in values[width * j:width * (j + 1)]] for j in range(height)]


# --------------------------------------------------------------------------------------------- meshes, read again

def checksum(data, at):
    """The checksum of src/core/FORMAT.md over data whose checksum field is at `at`."""
    mask = 2**64 - 1
    data = data[:at] + b"\0" * 8 + data[at + 8:]
    h = 0x9E3779B97F4A7C15 ^ (len(data) * 0xFF51AFD7ED558CCD & mask)
    data += b"\0" * (-len(data) % 8)
    for word in struct.unpack("<%dQ" % (len(data) // 8), data):
        h = (h ^ word) * 0xC2B2AE3D27D4EB4F & mask
        h = (h << 29 | h >> 35) & mask
    h = (h ^ h >> 32) * 0xFF51AFD7ED558CCD & mask
    return h ^ h >> 29


def rotated(triangle):
    """The same triangle from its least corner on: equal for equal winding, and only then."""
    a, b, c = triangle
    return min((a, b, c), (b, c, a), (c, a, b))


def strip_triangles(corners):
    """The triangles of a strip, without the joins."""
    found = []
    for i in range(len(corners) - 2):
        a, b, c = corners[i:i + 3]
        if a != b and b != c and a != c:
            found.append((a, b, c) if i % 2 == 0 else (a, c, b))
    return found


def mesh_blob(data):
    """'strip' and 'indexed': header as a dict, and triangles of coordinates."""
    head = struct.unpack_from("<4sBBHQQQ4dqiiiiddd", data)
    names = ("magic version kind zero checksum vertices indices x0 y0 dx dy z0 d numerator denominator srid scale offset "
             "eps").split()
    h = dict(zip(names, head))
    assert h["magic"] == b"RQTM" and h["version"] == 1 and data[112:128] == b"\0" * 16
    assert len(data) == 128 + 12 * h["vertices"] + 4 * h["indices"], "size"
    assert h["checksum"] == checksum(data, 8), "checksum"
    f = h["scale"] * h["numerator"] / h["denominator"]
    points = []
    for i in range(h["vertices"]):
        col, row, q = struct.unpack_from("<3i", data, 128 + 12 * i)
        points.append((h["x0"] + col * h["dx"], h["y0"] + row * h["dy"],
                       (float(h["z0"]) + q / float(h["d"])) * f + h["offset"]))
    assert len(set(points)) == len(points), "each vertex once"
    indices = struct.unpack_from("<%dI" % h["indices"], data, 128 + 12 * h["vertices"])
    corners = [points[i] for i in indices]
    if h["kind"] == 1:
        return h, strip_triangles(corners)
    return h, [tuple(corners[i:i + 3]) for i in range(0, len(corners), 3)]


def obj_triangles(text):
    points, found = [], []
    for line in text.splitlines():
        words = line.split()
        if words and words[0] == "v":
            points.append(tuple(float(w) for w in words[1:]))
        elif words and words[0] == "f":
            found.append(tuple(points[int(w) - 1] for w in words[1:]))
    return found


def ply_triangles(data):
    head, body = data.split(b"end_header\n", 1)
    words = head.decode().split()
    assert words[:3] == ["ply", "format", "binary_little_endian"]
    vertices, faces = int(words[words.index("vertex") + 1]), int(words[words.index("face") + 1])
    points = [struct.unpack_from("<3d", body, 24 * i) for i in range(vertices)]
    assert len(body) == 24 * vertices + 13 * faces
    found = []
    for i in range(faces):
        n, a, b, c = struct.unpack_from("<B3i", body, 24 * vertices + 13 * i)
        assert n == 3
        found.append((points[a], points[b], points[c]))
    return found


def ring_triangle(points):
    assert len(points) == 4 and points[0] == points[3], "a closed ring of four points"
    return tuple(points[:3])


def wkb_triangles(data, at=0):
    """ISO WKB MULTIPOLYGON Z."""
    order, kind, count = struct.unpack_from("<BII", data, at)
    assert (order, kind) == (1, 1006)
    at += 9
    found = []
    for _ in range(count):
        assert struct.unpack_from("<BIII", data, at) == (1, 1003, 1, 4)
        found.append(ring_triangle([struct.unpack_from("<3d", data, at + 13 + 24 * i) for i in range(4)]))
        at += 13 + 96
    assert at == len(data), "nothing after the geometry"
    return found


def gpkg_triangles(data):
    """SRID, is it flagged as empty, envelope or None, triangles."""
    magic, version, flags, srid = struct.unpack_from("<2sBBi", data)
    assert magic == b"GP" and version == 0 and flags & 1, "little-endian GeoPackage header"
    doubles = {0: 0, 1: 4, 2: 6, 3: 6, 4: 8}[flags >> 1 & 7]
    envelope = struct.unpack_from("<%dd" % doubles, data, 8) if doubles else None
    return srid, bool(flags & 16), envelope, wkb_triangles(data, 8 + 8 * doubles)


def spatialite_triangles(data):
    start, order, srid, x0, y0, x1, y1, mark, kind, count = struct.unpack_from("<BBi4dBII", data)
    assert (start, order, mark, kind) == (0, 1, 0x7C, 1006)
    at, found = 47, []
    for _ in range(count):
        assert struct.unpack_from("<BIII", data, at) == (0x69, 1003, 1, 4)
        found.append(ring_triangle([struct.unpack_from("<3d", data, at + 13 + 24 * i) for i in range(4)]))
        at += 13 + 96
    assert data[at:] == b"\xfe"
    return srid, (x0, y0, x1, y1), found


def triangles(db, region, eps, terrain=None, options=None):
    """rqt_triangles as triples of points, in its order."""
    return [((r[0], r[1], r[2]), (r[3], r[4], r[5]), (r[6], r[7], r[8])) for r in
            db.execute("SELECT x0,y0,z0, x1,y1,z1, x2,y2,z2 FROM rqt_triangles(?,?,?,?)", (region, eps, terrain, options))]


def counter_clockwise(t):
    (ax, ay, _), (bx, by, _), (cx, cy, _) = t
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) > 0
