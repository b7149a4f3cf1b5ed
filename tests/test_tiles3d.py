"""3D Tiles: subtrees and glTF read here from their bytes alone, and put beside the rasters that they are of.

The readers are written from the specifications (3D Tiles 1.1, glTF 2.0); places in space are computed here, and errors are
measured at every sample, on every level. Nothing is asked of the program but tiles.
"""
import json
import math
import os
import struct

import serve_support as service
import sql_support as s

A, F = 6378137.0, 1 / 298.257223563
E2 = F * (2 - F)


def ecef(lon, lat, h):
    lon, lat = math.radians(lon), math.radians(lat)
    n = A / math.sqrt(1 - E2 * math.sin(lat) ** 2)
    return (n + h) * math.cos(lat) * math.cos(lon), (n + h) * math.cos(lat) * math.sin(lon), (n * (1 - E2) + h) * math.sin(lat)


def geodetic(x, y, z):
    """Longitude and latitude in radians, height above the ellipsoid."""
    flat = math.hypot(x, y)
    lat = math.atan2(z, flat * (1 - E2))
    for _ in range(6):
        lat = math.atan2(z + E2 * A / math.sqrt(1 - E2 * math.sin(lat) ** 2) * math.sin(lat), flat)
    return math.atan2(y, x), lat, flat * math.cos(lat) + z * math.sin(lat) - A * math.sqrt(1 - E2 * math.sin(lat) ** 2)


def minus(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def distance_to_triangle(p, a, b, c):
    """Of a point in space: to the plane where its foot lies inside, else to the nearest side."""
    ab, ac, ap = minus(b, a), minus(c, a), minus(p, a)
    n = ab[1] * ac[2] - ab[2] * ac[1], ab[2] * ac[0] - ab[0] * ac[2], ab[0] * ac[1] - ab[1] * ac[0]
    square = dot(n, n)
    if square > 0:
        wc = dot((ab[1] * ap[2] - ab[2] * ap[1], ab[2] * ap[0] - ab[0] * ap[2], ab[0] * ap[1] - ab[1] * ap[0]), n) / square
        wb = dot((ap[1] * ac[2] - ap[2] * ac[1], ap[2] * ac[0] - ap[0] * ac[2], ap[0] * ac[1] - ap[1] * ac[0]), n) / square
        if wb >= 0 and wc >= 0 and wb + wc <= 1:
            return abs(dot(n, ap)) / math.sqrt(square)

    def to_side(u, v):
        w, q = minus(v, u), minus(p, u)
        length = dot(w, w)
        t = max(0.0, min(1.0, dot(w, q) / length)) if length else 0.0
        return math.dist(p, [u[k] + t * w[k] for k in range(3)])
    return min(to_side(a, b), to_side(b, c), to_side(c, a))


# --------------------------------------------------------------------------------------------------------------- readers

def chunks(data):
    """JSON and buffer of a GLB."""
    magic, version, size = struct.unpack_from("<4sII", data)
    assert (magic, version, size) == (b"glTF", 2, len(data)), (magic, version, size)
    found, at = {}, 12
    while at < len(data):
        length, name = struct.unpack_from("<I4s", data, at)
        assert length % 4 == 0
        found[name] = data[at + 8:at + 8 + length]
        at += 8 + length
    return json.loads(found[b"JSON"]), found[b"BIN\0"]


TYPES = {5120: "b", 5121: "B", 5122: "h", 5123: "H", 5125: "I", 5126: "f"}


def accessor(gltf, buffer, number):
    a = gltf["accessors"][number]
    view = gltf["bufferViews"][a["bufferView"]]
    width = {"SCALAR": 1, "VEC3": 3}[a["type"]]
    form = "<%d%s" % (width, TYPES[a["componentType"]])
    stride = view.get("byteStride", struct.calcsize(form))
    start = view.get("byteOffset", 0) + a.get("byteOffset", 0)
    values = [struct.unpack_from(form, buffer, start + i * stride) for i in range(a["count"])]
    if "min" in a:
        assert [min(v[k] for v in values) for k in range(width)] == a["min"], "min"
        assert [max(v[k] for v in values) for k in range(width)] == a["max"], "max"
    return values


class Tile:
    """A tile's content: decoded as a client does, the sum of what the node's matrix moves by and the positions, z up."""

    def __init__(self, data):
        gltf, buffer = chunks(data)
        primitive = gltf["meshes"][0]["primitives"][0]
        *turn, tx, ty, tz, one = gltf["nodes"][0]["matrix"]
        assert (*turn, one) == (1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1)
        places = [(tx + x, ty + y, tz + z) for x, y, z in accessor(gltf, buffer, primitive["attributes"]["POSITION"])]
        self.xyz = [(x, -z, y) for x, y, z in places]
        self.normals = [(x, -z, y) for x, y, z in accessor(gltf, buffer, primitive["attributes"]["NORMAL"])]
        indices = [i for i, in accessor(gltf, buffer, primitive["indices"])]
        self.triangles = list(zip(indices[::3], indices[1::3], indices[2::3]))
        self.told = gltf["asset"]["extras"]["rqt"]
        assert [set(p.get("extras", {})) for p in gltf["meshes"][0]["primitives"]] in ([set()], [set(), {"skirt"}]), gltf["meshes"]
        self.walls, self.depth = [], 0
        for skirt in gltf["meshes"][0]["primitives"][1:]:
            self.depth = skirt["extras"]["skirt"]
            ends = [(tx + x, -(tz + z), ty + y) for x, y, z in accessor(gltf, buffer, skirt["attributes"]["POSITION"])]
            normals = [(x, -z, y) for x, y, z in accessor(gltf, buffer, skirt["attributes"]["NORMAL"])]
            corners = [i for i, in accessor(gltf, buffer, skirt["indices"])]
            of_place = dict(zip(self.xyz, self.normals))
            for u, below_u, below_v, again, too, v in zip(*(corners[k::6] for k in range(6))):
                assert (again, too, below_u, below_v) == (u, below_v, u + 1, v + 1), "a wall is two triangles"
                assert all(normals[i] == normals[i + 1] for i in (u, v)) and (len(of_place) < len(self.xyz) or all(of_place[ends[i]] == normals[i] for i in (u, v)))
                self.walls.append(tuple(ends[i] for i in (u, v, below_u, below_v)))
            assert set(corners) == set(range(len(ends))) and len(corners) % 6 == 0


class Subtree:
    def __init__(self, data, schema, levels):
        magic, version, text, binary = struct.unpack_from("<4sIQQ", data)
        assert (magic, version, len(data)) == (b"subt", 1, 24 + text + binary) and text % 8 == 0 and binary % 8 == 0
        self.json, self.buffer, self.levels = json.loads(data[24:24 + text]), data[24 + text:], levels
        assert self.json["buffers"] == [{"byteLength": binary}]
        tiles = (4**levels - 1) // 3
        self.tiles = self.bits(self.json["tileAvailability"], tiles)
        self.contents = self.bits(self.json["contentAvailability"][0], tiles)
        self.below = self.bits(self.json["childSubtreeAvailability"], 4**levels)
        table = self.json["propertyTables"][self.json["tileMetadata"]]
        assert table["count"] == sum(self.tiles), (table["count"], sum(self.tiles))
        self.values = {}
        for name, p in schema["classes"][table["class"]]["properties"].items():
            assert (p["type"], p["componentType"]) == ("SCALAR", "FLOAT64")
            width = p["count"] if p.get("array") else 1
            view = self.view(table["properties"][name]["values"])
            numbers = struct.unpack("<%dd" % (table["count"] * width), view)
            self.values[p["semantic"]] = [numbers[i:i + width] for i in range(0, len(numbers), width)]

    def view(self, number):
        v = self.json["bufferViews"][number]
        assert v["byteOffset"] % 8 == 0
        return self.buffer[v["byteOffset"]:v["byteOffset"] + v["byteLength"]]

    def bits(self, available, count):
        if "constant" in available:
            return [available["constant"]] * count
        view = self.view(available["bitstream"])
        assert len(view) == (count + 7) // 8
        bits = [view[i // 8] >> i % 8 & 1 for i in range(count)]
        assert sum(bits) == available["availableCount"]
        return bits

    def walk(self, level, x, y):
        """level, x, y, has content, metadata of every tile that is there."""
        row = first = 0
        for depth in range(self.levels):
            for m in range(4**depth):
                if self.tiles[first + m]:
                    u, v = morton(m)
                    yield (level + depth, (x << depth) + u, (y << depth) + v), self.contents[first + m], {k: v[row] for k, v in self.values.items()}
                    row += 1
                else:
                    assert not self.contents[first + m]
            first += 4**depth
        assert row == sum(self.tiles)


def morton(m):
    return sum((m >> 2 * b & 1) << b for b in range(16)), sum((m >> 2 * b + 1 & 1) << b for b in range(16))


class Tileset:
    """As a client finds it from tileset.json on. read: the bytes of an address, None when there are none."""

    def __init__(self, read):
        self.json = json.loads(read("tileset.json"))
        root = self.json["root"]
        tiling = root["implicitTiling"]
        assert self.json["asset"]["version"] == "1.1" and tiling["subdivisionScheme"] == "QUADTREE"
        self.levels, self.error, self.region = tiling["availableLevels"], root["geometricError"], root["boundingVolume"]["region"]
        self.there, self.contents, self.subtrees = {}, {}, set()
        waiting = [(0, 0, 0)]
        while waiting:
            level, x, y = place = waiting.pop()
            self.subtrees.add(place)
            subtree = Subtree(read(address(tiling["subtrees"]["uri"], place)), self.json["schema"], tiling["subtreeLevels"])
            for tile, has_content, metadata in subtree.walk(*place):
                self.there[tile] = metadata["TILE_GEOMETRIC_ERROR"][0], metadata["TILE_BOUNDING_REGION"]
                if has_content:
                    self.contents[tile] = read(address(root["content"]["uri"], tile))
            depth = tiling["subtreeLevels"]
            waiting += [(level + depth, (x << depth) + u, (y << depth) + v) for u, v in map(morton, (m for m, bit in enumerate(subtree.below) if bit))]


def address(template, place):
    for name, value in zip(("level", "x", "y"), place):
        template = template.replace("{%s}" % name, str(value))
    return template


def reader(folder):
    def read(path):
        with open(os.path.join(folder, path), "rb") as f:
            return f.read()
    return read


# -------------------------------------------------------------------------------------------------------------- terrains

class Terrain:
    def __init__(self, name, path, raster=None, **imports):
        self.name, self.folder, self.database = name, s.temp(name + ".3d"), s.temp(name + ".gpkg")
        s.import_terrain(self.database, path, name=name, **imports)
        db = s.connect(self.database)
        self.x0, self.y0, self.dx, self.dy = s.rows(db, "SELECT x0, y0, dx, dy FROM rqt_terrain")[0]
        db.close()
        self.raster = raster or s.read_raster(path)
        self.height, self.width = len(self.raster), len(self.raster[0])
        # Does it go once around the Earth? Then its last column is its first, whose heights both have.
        self.closes = abs((self.width - 1) * self.dx - 360) < 1e-6
        self.side = 1
        while self.side < max(self.height, self.width) - 1:
            self.side *= 2
        s.equal(name + ": rqt tiles says nothing in a pipe", s.run([s.RQT, "tiles", self.database, "--kind", "3d-tiles", "-o", self.folder]), ("", 0))
        try:
            self.set = Tileset(reader(self.folder))
            self.tiles = {place: Tile(data) for place, data in self.set.contents.items()}
        except (AssertionError, LookupError, OSError, ValueError, struct.error) as error:
            s.check(name + ": subtrees and tiles are as the formats have them, and what is listed is there", False, repr(error))
            s.finish()
        self.space = {}

    def place(self, col, row):
        if (col, row) not in self.space:
            self.space[col, row] = ecef(self.x0 + col * self.dx, self.y0 + row * self.dy, self.raster[row][col])
        return self.space[col, row]

    def vertex_place(self, col, row):
        return ecef(self.x0, self.y0 + row * self.dy, self.raster[row][0]) if self.closes and col == self.width - 1 else self.place(col, row)

    def cell(self, level, x, y):
        """Columns and rows of a tile, clamped."""
        side = self.side >> level
        row = ((1 << level) - 1 - y) * side
        return x * side, min(self.width - 1, (x + 1) * side), row, min(self.height - 1, row + side)

    def samples_of(self, tile, cell):
        """Of each vertex the column and row; the column is None at a pole."""
        found = []
        for p in tile.xyz:
            lon, lat, _ = geodetic(*p)
            row = round((math.degrees(lat) - self.y0) / self.dy)
            if math.hypot(p[0], p[1]) < 1:
                found.append((None, row))
                continue
            col = (math.degrees(lon) - self.x0) / self.dx
            turn = 360 / self.dx
            col = round(col + turn * round(((cell[0] + cell[1]) / 2 - col) / turn))
            # The antimeridian is at both ends of a cell that goes round.
            if col < cell[0] and abs(col + turn - cell[1]) < 0.1:
                col = cell[1]
            found.append((col, row))
        if self.closes and cell[:2] == (0, self.width - 1):
            # Both ends are in the tile, and one place: by the columns of what a vertex is joined to.
            ends = {v for v, (col, _) in enumerate(found) if col in (0, cell[1])}
            for triangle in tile.triangles:
                others = [found[v][0] for v in triangle if v not in ends and found[v][0] is not None]
                for v in ends.intersection(triangle) if others else ():
                    found[v] = (cell[1] if sum(others) > len(others) * cell[1] / 2 else 0), found[v][1]
        return found


def measure(t, place, tile, samples, error):
    """Every sample of the cell beside the mesh: the largest share of what is stated, in space; the samples that have a mesh over
    them; and the most that one is above or below it where longitude, latitude and height are straight."""
    c0, c1, r0, r1 = t.cell(*place)
    left = {(c, r) for c in range(c0, c1 + 1) for r in range(r0, r1 + 1) if t.raster[r][c] is not None}
    covered, doubtful, worst, vertical = set(), set(), 0.0, 0.0
    for triangle in tile.triangles:
        if any(samples[v][0] is None for v in triangle):
            continue
        (ac, ar), (bc, br), (cc, cr) = (samples[v] for v in triangle)
        area = (bc - ac) * (cr - ar) - (cc - ac) * (br - ar)
        a, b, c = (tile.xyz[v] for v in triangle)
        za, zb, zc = t.raster[ar][ac], t.raster[br][bc], t.raster[cr][cc]
        for row in range(min(ar, br, cr), max(ar, br, cr) + 1):
            for col in range(min(ac, bc, cc), max(ac, bc, cc) + 1):
                nb, nc = (col - ac) * (cr - ar) - (cc - ac) * (row - ar), (bc - ac) * (row - ar) - (col - ac) * (br - ar)
                if area < 0:
                    nb, nc = -nb, -nc
                if nb < 0 or nc < 0 or nb + nc > abs(area) or (col, row) not in left:
                    continue
                covered.add((col, row))
                wb, wc = nb / abs(area), nc / abs(area)
                wa = 1 - wb - wc
                vertical = max(vertical, abs(wa * za + wb * zb + wc * zc - t.raster[row][col]))
                d = math.dist(t.place(col, row), (wa * a[0] + wb * b[0] + wc * c[0], wa * a[1] + wb * b[1] + wc * c[1], wa * a[2] + wb * b[2] + wc * c[2]))
                worst = max(worst, d / error) if d <= error else worst
                if d > error:
                    doubtful.add((col, row))
    poles = [v for v in range(len(samples)) if samples[v][0] is None]
    for col, row in doubtful | (left - covered if poles else set()):
        q = t.place(col, row)
        worst = max(worst, min(distance_to_triangle(q, *(tile.xyz[v] for v in triangle)) for triangle in tile.triangles) / error)
    return worst, left if poles else covered, vertical


def exact_cover(t, cell):
    """Unit triangles with three valid corners in a cell: the samples that they hold, and how many they are. The diagonal of a
    square goes from the north-west to the south-east where its column and row are both even or both odd."""
    c0, c1, r0, r1 = cell
    found, count = set(), 0
    for r in range(r0, r1):
        for c in range(c0, c1):
            nw, ne, sw, se = (c, r), (c + 1, r), (c, r + 1), (c + 1, r + 1)
            for corners in (((nw, ne, se), (nw, se, sw)) if (c + r) % 2 == 0 else ((nw, ne, sw), (ne, se, sw))):
                if all(t.raster[y][x] is not None for x, y in corners):
                    found |= set(corners)
                    count += 1
    return found, count


def span(lon, west, east):
    """How far a longitude is outside: radians."""
    width = east - west if east >= west else east - west + 2 * math.pi
    away = (lon - west) % (2 * math.pi)
    return 0.0 if away <= width else min(away - width, 2 * math.pi - away)


def outside(region, p):
    """By how many metres, about, a place is out of a region."""
    lon, lat, h = geodetic(*p)
    return max(span(lon, region[0], region[2]) * A * math.cos(lat), (region[1] - lat) * A, (lat - region[3]) * A, region[4] - h, h - region[5])


def holds(outer, inner):
    """Does a region hold another? To a billionth of a radian, and of a metre."""
    def width(r):
        return r[2] - r[0] if r[2] >= r[0] else r[2] - r[0] + 2 * math.pi
    west = (inner[0] - outer[0] + 1e-9) % (2 * math.pi)
    return (width(outer) >= 2 * math.pi - 1e-9 or west + width(inner) <= width(outer) + 2e-9) and inner[1] >= outer[1] - 1e-9 and \
        inner[3] <= outer[3] + 1e-9 and inner[4] >= outer[4] - 1e-9 and inner[5] <= outer[5] + 1e-9


def check_terrain(t, is_whole):
    name, there, tiles = t.name, t.set.there, t.tiles
    finest = t.set.levels - 1
    files = {os.path.relpath(os.path.join(path, n), t.folder) for path, _, names in os.walk(t.folder) for n in names} - {".rqt-tiles"}
    listed = {"content/%d/%d/%d.glb" % p for p in tiles} | {"subtrees/%d/%d/%d.subtree" % p for p in t.set.subtrees} | {"tileset.json"}
    s.equal(name + ": what is listed is there, and nothing else (%d tiles)" % len(tiles), files ^ listed, set())
    cells = {(level, x, y) for level in range(finest + 1) for x in range(1 << level) for y in range(1 << level)
             if t.cell(level, x, y)[0] < t.width - 1 and t.cell(level, x, y)[2] < t.height - 1}
    s.equal(name + ": tiles are the cells that have a part of the raster, to a depth of one level", set(there), cells)
    stated = [(p, tile.told["error"], there[p][0]) for p, tile in tiles.items() if tile.told["error"] != there[p][0] or tile.told["level"] != p[0]]
    s.equal(name + ": a tile tells the error that its subtree tells", stated, [])
    grow = [p for p in there if p[0] > 0 and there[p][0] > there[p[0] - 1, p[1] // 2, p[2] // 2][0]]
    s.equal(name + ": no tile has a larger error than the one above", grow, [])
    s.equal(name + ": the root's error, halved level by level, is nowhere less than a tile's",
            [p for p in there if there[p][0] > t.set.error / 2**p[0]], [])
    # Errors and vertices, by brute force.
    worst, level_worst, seen, lossy = 0.0, [0.0] * (finest + 1), 0, 0.0
    strangers, bare, turned, misses = [], [], [], []
    for p, tile in tiles.items():
        cell = t.cell(*p)
        samples = t.samples_of(tile, cell)
        step = tile.told["step"]
        for v, (col, row) in enumerate(samples):
            at = cell[0] if col is None else col
            if not (cell[0] <= at <= cell[1] and cell[2] <= row <= cell[3]) or t.raster[row][at] is None or \
                    max(abs(d) for d in minus(tile.xyz[v], t.vertex_place(at, row))) > step / 2 + 1e-6:
                strangers.append((p, col, row))
        share, covered, vertical = measure(t, p, tile, samples, there[p][0])
        worst, level_worst[p[0]], seen = max(worst, share), max(level_worst[p[0]], share), seen + len(covered)
        area = sum((samples[b][0] - samples[a][0]) * (samples[c][1] - samples[a][1]) - (samples[c][0] - samples[a][0]) * (samples[b][1] - samples[a][1])
                   for a, b, c in tile.triangles if None not in (samples[a][0], samples[b][0], samples[c][0]))
        turned += [p for a, b, c in tile.triangles if None not in (samples[a][0], samples[b][0], samples[c][0]) and
                   (samples[b][0] - samples[a][0]) * (samples[c][1] - samples[a][1]) - (samples[c][0] - samples[a][0]) * (samples[b][1] - samples[a][1]) >= 0]
        has_pole = any(col is None for col, _ in samples)
        if is_whole and not has_pole and -area != 2 * (cell[1] - cell[0]) * (cell[3] - cell[2]):
            bare.append((p, area))
        if p[0] == finest and not has_pole:
            expected, count = exact_cover(t, cell)
            lossy = max(lossy, vertical)
            if covered != expected or -area != count:
                misses.append((p, len(covered), len(expected), -area, count))
    s.check("%s: no sample is further from a tile in space than it states (%d samples, worst %.3f of it)" % (name, seen, worst), seen > 0 and worst <= 1, level_worst)
    s.check(name + ": and what is stated is not idle: half of it is met on some level", worst > 0.5, level_worst)
    s.equal(name + ": every vertex is a sample, within half a step", strangers[:5], [])
    s.equal(name + ": triangles are counter-clockwise from above, none without an area", turned[:5], [])
    if is_whole:
        s.equal(name + ": every tile covers its cell, and so children their parent", bare[:5], [])
    s.equal(name + ": the last level has the unit triangles with three valid corners, all of them and no others", misses[:5], [])
    if name != "geoid": # which is not straight between samples
        s.check(name + ": and goes through every sample of theirs", lossy < 1e-6, lossy)
    empty = [p for p in there if p not in tiles and p[0] == finest and exact_cover(t, t.cell(*p))[1]]
    s.equal(name + ": no tile of the last level that has such a triangle is left out", empty, [])
    check_seams(t)
    check_stars(t)
    check_skirts(t)
    # Regions.
    s.equal(name + ": regions lie in those above", [p for p in there if p[0] > 0 and not holds(there[p[0] - 1, p[1] // 2, p[2] // 2][1], there[p][1])][:5], [])
    most = hanging = 0.0
    for p, tile in tiles.items():
        region, slack = there[p][1], tile.told["step"]
        inner = [[sum(tile.xyz[v][k] for v in corners) / len(corners) for k in range(3)] for a, b, c in tile.triangles for corners in ((a, b), (b, c), (a, b, c))]
        most = max([most] + [outside(region, q) - slack for q in tile.xyz + inner if math.hypot(q[0], q[1]) > 1])
        # Ends of walls are rounded twice.
        hanging = max([hanging] + [outside(region, q) - 2 * slack for _, _, u, v in tile.walls for q in (u, v, [(a + b) / 2 for a, b in zip(u, v)]) if math.hypot(q[0], q[1]) > 1e6])
    s.check(name + ": tiles lie in their regions, chords and all", most <= 0, most)
    s.check(name + ": and so do their skirts", hanging <= 0, hanging)
    valid = all(-math.pi <= r[0] <= math.pi and -math.pi <= r[2] <= math.pi and -math.pi / 2 <= r[1] <= r[3] <= math.pi / 2 and r[4] <= r[5]
                for r in [t.set.region] + [r for _, r in there.values()])
    s.check(name + ": regions are on the globe", valid)


def check_normals(t):
    """On the last level: by differences of the raster, turned into space here."""
    worst, seen = 0.0, 0
    for p, tile in t.tiles.items():
        if p[0] < t.set.levels - 1:
            continue
        for v, (col, row) in enumerate(t.samples_of(tile, t.cell(*p))):
            if not (0 < col < t.width - 1 and 0 < row < t.height - 1):
                continue
            east, west, north, south = (t.place(col + a, row + b) for a, b in ((1, 0), (-1, 0), (0, -1), (0, 1)))
            x, y = minus(east, west), minus(north, south)
            n = (x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0])
            cosine = dot(n, tile.normals[v]) / math.sqrt(dot(n, n) * dot(tile.normals[v], tile.normals[v]))
            worst, seen = max(worst, math.degrees(math.acos(min(1, cosine)))), seen + 1
    s.check("%s: normals are the terrain's, from its full resolution (%d, worst %.2f degrees)" % (t.name, seen, worst), seen > 1000 and worst < 0.7, worst)


def plus(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def off_by(normal, n):
    """A normal in 127ths beside a vector of any length: the most that a number of it is off."""
    length = math.hypot(*n)
    return max(abs(a - 127 * b / length) for a, b in zip(normal, n))


def check_stars(t):
    """On the others: at each vertex the sum of the area vectors of all triangles of the level that have it, whatever tiles they are
    of. In whole steps, which are Python's integers; of a star without area, the ellipsoid's."""
    wrong, seen, shared, lone = [], 0, 0, 0
    for level in range(t.set.levels - 1):
        sums, of = {}, {}
        tiles = {p: tile for p, tile in t.tiles.items() if p[0] == level}
        for p, tile in tiles.items():
            # A pole's samples are one place, so these are nobody else's; of those at a corner of the tile half the star is next to it.
            of[p] = [(p, v) if col is None else (0 if t.closes and col == t.width - 1 else col, row) for v, (col, row) in enumerate(t.samples_of(tile, t.cell(*p)))]
            places = [tuple(round(x / tile.told["step"]) for x in xyz) for xyz in tile.xyz]
            for triangle in tile.triangles:
                (ax, ay, az), (bx, by, bz), (cx, cy, cz) = (places[v] for v in triangle)
                ux, uy, uz, vx, vy, vz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
                n = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
                for v in triangle:
                    sums[of[p][v]] = plus(sums.get(of[p][v], (0, 0, 0)), n)
        for p, tile in tiles.items():
            c0, c1, r0, r1 = t.cell(*p)
            for v, sample in enumerate(of[p]):
                stars = [sums[sample]]
                if sample[0] is p:
                    stars += [plus(stars[0], n) for key, n in sums.items() if isinstance(key[0], tuple) and key != sample]
                lone += stars[0] == (0, 0, 0)
                off = min(off_by(tile.normals[v], n if n != (0, 0, 0) else (tile.xyz[v][0], tile.xyz[v][1], tile.xyz[v][2] / (1 - F) ** 2)) for n in stars)
                seen, shared = seen + 1, shared + (sample[0] in (c0, c1) or sample[1] in (r0, r1))
                if off > 0.5 + 1e-6:
                    wrong.append((p, sample, tile.normals[v], off))
    s.check("%s: normals of coarser levels are the stars' (%d vertices, %d of them at sides, %d without a star)" % (t.name, seen, shared, lone),
            seen > 0 and not wrong, (len(wrong), wrong[:3]))


def check_seams(t):
    """What two tiles of a level share: the same places, bit by bit, and the same normals."""
    compared, different = 0, []
    for (level, x, y), tile in t.tiles.items():
        cell = t.cell(level, x, y)
        own = t.samples_of(tile, cell)
        for other, axis, at in (((level, x + 1, y), 0, cell[1]), ((level, x, y - 1), 1, cell[3])):
            if other not in t.tiles:
                continue
            theirs = t.samples_of(t.tiles[other], t.cell(*other))
            border = [{(tile.xyz[v], tile.normals[v]) for v, place in enumerate(places) if place[axis] == at}
                      for tile, places in ((tile, own), (t.tiles[other], theirs))]
            compared += len(border[0])
            normals = [dict(side) for side in border]
            different += [(level, x, y, other, p) for p in set(normals[0]) & set(normals[1]) if normals[0][p] != normals[1][p]]
            if border[0] != border[1] and t.is_whole:
                different.append((level, x, y, other))
            if not t.is_whole and {a for a, _ in border[0]} != {a for a, _ in border[1]}:
                # A vertex of the outline may be in triangles on one side alone.
                both = {p for side in border for p, _ in side}
                lone = [p for p in both if sum(any(p == q for q, _ in side) for side in border) == 1]
                different += [(level, x, y, other, p) for p in lone if not is_at_outline(t, p)]
    s.check("%s: what neighbours share is decoded to the same doubles (%d vertices)" % (t.name, compared), compared > 0 and not different, different[:5])


def check_closed(t):
    """Around the Earth: the first and the last column of each level have the same places, bit by bit, and the same normals."""
    compared, different = 0, []
    for level in range(t.set.levels):
        ends = [set(), set()]
        for p, tile in t.tiles.items():
            for v, (col, _) in enumerate(t.samples_of(tile, t.cell(*p)) if p[0] == level else ()):
                if col in (0, t.width - 1):
                    ends[col > 0].add((tile.xyz[v], tile.normals[v]))
        compared += len(ends[0])
        different += [(level, len(ends[0] - ends[1]), len(ends[1] - ends[0]), sorted(ends[0] ^ ends[1])[:2])] if ends[0] != ends[1] else []
    s.check("%s: both ends are one (%d vertices)" % (t.name, compared), t.closes and compared > 0 and not different, different)


def frame_at(p):
    """East, north and up."""
    lon, lat, _ = geodetic(*p)
    return (-math.sin(lon), math.cos(lon), 0.0), (-math.sin(lat) * math.cos(lon), -math.sin(lat) * math.sin(lon), math.cos(lat)), \
        (math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat))


def lines_of(t, place):
    """Of a cell's sides beside which tiles may be: (is it a row, which, on this side of the tile, how deep walls are)."""
    c0, c1, r0, r1 = t.cell(*place)
    is_around = abs((t.width - 1) * t.dx - 360) < 1e-6 and place[0] > 0
    for is_row, at, end, sign in ((0, c0, t.width - 1, -1), (0, c1, t.width - 1, 1), (1, r0, t.height - 1, -1), (1, r1, t.height - 1, 1)):
        if 0 < at < end or (is_around and not is_row):
            level = 1 if at in (0, end) else next(level for level in range(1, 32) if at % (t.side >> level) == 0)
            yield is_row, at, sign, t.set.json["extras"]["rqt"]["skirts"][level]


def check_skirts(t):
    """Walls hang from the sides of tiles, straight enough, deep enough; and beside a tile of any other level there is no gap."""
    told = t.set.json["extras"]["rqt"]
    s.check(t.name + ": walls of a level are twice as deep as what it is off, and roundings",
            all(2 * e <= w <= 2 * e + 6 * step or w > 3e6 for e, step, w in zip(told["errors"], told["steps"], told["skirts"])), told)
    wrong, skew, turned, marked, sides = [], [], [], [], {}
    for place, tile in t.tiles.items():
        cell, step = t.cell(*place), tile.told["step"]
        sample = dict(zip(tile.xyz, t.samples_of(tile, cell)))
        lines = list(lines_of(t, place))
        on = {p: {(is_row, at) for is_row, at, _, _ in lines if sample[p][is_row] == at} for p in sample}
        hung = {(u, v) for u, v, _, _ in tile.walls if None not in (sample[u][0], sample[v][0])}
        wanted = {(tile.xyz[u], tile.xyz[v]) for a, b, c in tile.triangles for u, v in ((a, b), (b, c), (c, a))
                  if on[tile.xyz[u]] & on[tile.xyz[v]] and None not in (sample[tile.xyz[u]][0], sample[tile.xyz[v]][0])}
        if hung != wanted:
            wrong.append((place, len(hung), len(wanted), list(hung ^ wanted)[:2]))
        deepest = max([depth for is_row, at, _, depth in lines if any((is_row, at) in on[u] & on[v] for u, v in wanted)], default=0)
        if wanted and not math.isclose(tile.depth, deepest, rel_tol=1e-14):
            marked.append((place, tile.depth, deepest))
        for top, below in {pair for u, v, bu, bv in tile.walls for pair in ((u, bu), (v, bv))}:
            if sample[top][0] is None:
                continue
            east, north, up = frame_at(top)
            depth = max(depth for is_row, at, _, depth in lines if (is_row, at) in on[top])
            away = minus(below, top)
            if abs(dot(away, up) + depth) > step + 1e-6 * depth or abs(dot(away, east)) > step + 1e-6 * depth or abs(dot(away, north)) > depth + step:
                skew.append((place, sample[top], dot(away, up), depth, dot(away, east), dot(away, north)))
        for is_row, at, sign, depth in lines:
            along = [(sample[u][1 - is_row], sample[v][1 - is_row], u, v, bu, bv) for u, v, bu, bv in tile.walls
                     if (is_row, at) in on[u] & on[v] and None not in (sample[u][0], sample[v][0])]
            for _, _, u, v, below_u, below_v in along:
                (ax, ay, az), (bx, by, bz) = minus(below_u, u), minus(below_v, u)
                east, north, _ = frame_at(u)
                if sign * dot((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx), [-x for x in north] if is_row else east) <= 0:
                    turned.append((place, is_row, at))
            line = (is_row, at % (t.width - 1) if not is_row else at, depth)
            sides.setdefault(line, {-1: [], 1: []})[sign].append((place, step, sorted(w if w[0] < w[1] else (w[1], w[0], w[3], w[2], w[5], w[4]) for w in along)))
    s.equal(t.name + ": walls hang from the tile's edges on lines that other tiles may end at, and from no others", wrong[:3], [])
    s.equal(t.name + ": so far down as their line's level has it, along the normal", skew[:3], [])
    s.equal(t.name + ": and the skirt says how far that is", marked[:3], [])
    s.equal(t.name + ": walls face outwards", turned[:3], [])
    pairs, short, slits = 0, [], []
    for (is_row, at, depth), line in sides.items():
        for before in line[1]:
            for after in line[-1]:
                seen = walls_beside(before[2], after[2])
                pairs += before[0][0] != after[0][0] and bool(seen)
                for place, a, b in seen if depth < 3e6 else ():
                    east, north, up = frame_at(a[0])
                    outward, slack = [-x for x in north] if is_row else east, 2 * (before[1] + after[1])
                    if min(dot(minus(b[0], a[1]), up), dot(minus(a[0], b[1]), up)) < 0:
                        short.append((before[0], after[0], place))
                    if dot(minus(b[0], a[0]), outward) > slack and dot(minus(b[1], a[1]), outward) > slack:
                        slits.append((before[0], after[0], place, dot(minus(b[0], a[0]), outward), dot(minus(b[1], a[1]), outward)))
    s.check("%s: beside a tile of any level the surface lies above the lower end of the other's wall (%d pairs of two levels)" % (t.name, pairs),
            not short and pairs > 0, short[:3])
    s.equal(t.name + ": where sides are apart, seen from above, their walls meet", slits[:3], [])


def walls_beside(one, other):
    """Places along a line, and what two tiles have there: (top, lower end) of each; at what bends in either, and half way."""
    found, i, j = [], 0, 0
    while i < len(one) and j < len(other):
        low, high = max(one[i][0], other[j][0]), min(one[i][1], other[j][1])
        for at in (low, (low + high) / 2, high) if low < high else ():
            both = []
            for first, last, u, v, below_u, below_v in (one[i], other[j]):
                w = (at - first) / (last - first)
                both.append([[p[k] + w * (q[k] - p[k]) for k in range(3)] for p, q in ((u, v), (below_u, below_v))])
            found.append((at, *both))
        if one[i][1] < other[j][1]:
            i += 1
        else:
            j += 1
    return found


def is_at_outline(t, p):
    lon, lat, _ = geodetic(*p)
    col, row = round((math.degrees(lon) - t.x0) / t.dx), round((math.degrees(lat) - t.y0) / t.dy)
    reach = 24
    return any(t.raster[r][c] is None for r in range(max(0, row - reach), min(t.height, row + reach + 1)) for c in range(max(0, col - reach), min(t.width, col + reach + 1)))


def check_levels(t, k):
    """What levels are off, from the errors of all vertices: half a metre, and what is there beyond the grids of the blocks."""
    db = s.connect(t.database)
    errors = s.rows(db, "SELECT level, error FROM rqt_range(NULL, 0) WHERE error < 9e999")
    db.close()
    told, steps = t.set.json["extras"]["rqt"]["errors"], t.set.json["extras"]["rqt"]["steps"]
    em = [max([e for level, e in errors if level > l + k], default=0) for l in range(len(told) + 2)]
    cell = math.radians(max(t.dx, -t.dy)) * A
    wanted = [0.5 + max(em[l + 2], min(em[l], cell * 2**(len(told) - 1 - l) / 4)) + steps[l] * math.sqrt(3) / 2 for l in range(len(told) - 1)]
    s.check(t.name + ": levels are off by what their vertices say", len(told) > 4 and max(abs(a - b) for a, b in zip(told, wanted)) < 1e-5, (told, wanted))


def window(name, source, *box):
    path = s.temp(name + ".tif")
    s.run(["gdal_translate", "-q", "-srcwin", *map(str, box), os.path.join(s.DATA, source), path])
    return path


def terrain(name, path, is_whole=True, raster=None, **imports):
    t = Terrain(name, path, raster, **imports)
    t.is_whole = is_whole
    check_terrain(t, is_whole)
    return t


ALPS = terrain("alps", window("alps", "glarus_1arc_native_161.tif", 30, 40, 85, 73), block=3)
check_normals(ALPS)
check_levels(ALPS, 3)
AFRICA = terrain("africa", window("africa", "eastafrica.tif", 40, 60, 90, 110), block=4)
zipped = s.temp("n42")
s.run(["unzip", "-q", "-o", os.path.join(s.DATA, "N42E001.hgt.zip"), "-d", zipped])
PYRENEES = terrain("pyrenees", window("pyrenees", os.path.join(zipped, "N42E001.hgt"), 300, 500, 97, 65), block=4,
                   is_whole=all(z is not None for row in s.read_raster(s.temp("pyrenees.tif")) for z in row))

# All of the Earth, every sixth degree: both poles, the antimeridian twice.
earth = [row[::6] for row in s.read_raster(os.path.join(s.DATA, "etopo1_1deg.tif"))[::6]]
EARTH = terrain("F28_earth", s.write_grid(s.temp("earth.asc"), earth, -180, -90, 6, s.WGS84), raster=earth, block=3)

check_closed(EARTH)
# Rough ground that goes around, its ends a metre apart here and there, begins anywhere, and has no poles.
around = [row + [row[0] + y % 3 - 1] for y, row in enumerate(s.rough_grid(96, 33, 17, relief=4000))]
ROUND = terrain("F28_round", s.write_grid(s.temp("round.asc"), around, 33.5, -60, 3.75, s.WGS84), raster=around, block=4)
check_closed(ROUND)

# Voids, and an odd size.
hole = s.rough_grid(75, 67, 7, relief=300)
for row in range(67):
    for col in range(75):
        if (col - 50) ** 2 + (row - 30) ** 2 > 35**2 or (col - 45) ** 2 + (row - 30) ** 2 < 10**2 or (col * 7919 + row * 104729) % 499 == 0:
            hole[row][col] = None
HOLES = terrain("holes", s.write_grid(s.temp("holes.asc"), hole, 12.3, 45.6, 1 / 1200, s.WGS84), False, hole, block=3)
s.check("holes: some tiles are there and have no content", len(HOLES.tiles) < len(HOLES.set.there), len(HOLES.tiles))

# A lone void, which only the finest blocks have: those that answer for coarse tiles have none, though their cells have one.
lone = [[None if (col, row) == (37, 21) else 3 * col + 2 * row for col in range(65)] for row in range(65)]
LONE = terrain("lone", s.write_grid(s.temp("lone.asc"), lone, 8, 46, 1 / 1200, s.WGS84), False, lone, block=3)
s.equal("lone: a void leaves no tile out", set(LONE.set.there) - set(LONE.tiles), set())

# Across the antimeridian; and a plain by the sea, which has few triangles, and a tiny error.
hill = s.rough_grid(41, 30, 11, relief=500)
terrain("across", s.write_grid(s.temp("across.asc"), hill, 179.75, 50.25, 1 / 64, s.WGS84), raster=hill, block=3)
flat = [[0 if col < 40 else 3 * (col - 39) for col in range(65)] for _ in range(65)]
PLAIN = terrain("plain", s.write_grid(s.temp("plain.asc"), flat, 5, 43, 1 / 3600, s.WGS84), raster=flat, block=4)
s.equal("plain: a tile of sea has two triangles, and states centimetres",
        [(len(PLAIN.tiles[2, 0, 0].triangles), PLAIN.set.there[2, 0, 0][0] < 0.1)], [(2, True)])
# Two planes that meet where cells do: a star there knows where the triangles next to the cell end.
bent = [[3 * max(0, col - 32) for col in range(65)] for _ in range(65)]
terrain("bent", s.write_grid(s.temp("bent.asc"), bent, 5, 43, 1 / 3600, s.WGS84), raster=bent, block=3)
# Heights above EGM96 are in space where GDAL has them, above the ellipsoid.
geoid = s.temp("geoid.tif")
s.run(["gdal_translate", "-q", "-a_srs", "EPSG:4326+5773", s.write_grid(s.temp("sea.asc"), hill, 7, 46, 1 / 64, s.WGS84), geoid])
lifted = s.run(["gdaltransform", "-s_srs", "EPSG:4326+5773", "-t_srs", "EPSG:4979"],
               text="".join("%r %r %r\n" % (7 + col / 64, 46 + (29 - row) / 64, hill[row][col]) for row in range(30) for col in range(41)))[0].split("\n")
raised = [[float(lifted[row * 41 + col].split()[2]) for col in range(41)] for row in range(30)]
s.check("the geoid is some 50 m above the ellipsoid there", all(40 < raised[r][c] - hill[r][c] < 60 for r in range(30) for c in range(41)))
terrain("geoid", geoid, raster=raised, block=3)

# Heights of millimetres: less than curvature may take, and not left out for that.
gentle = [[z / 1000 for z in row[:33]] for row in s.rough_grid(33, 33, 5, relief=400)]
terrain("gentle", s.write_grid(s.temp("gentle.asc"), gentle, 8, 46, 1 / 300, s.WGS84), raster=gentle, block=3)
terrain("sliver", s.write_grid(s.temp("sliver.asc"), [row[:2] for row in hill], 7, 47, 1 / 1200, s.WGS84), raster=[row[:2] for row in hill], block=2)

# ------------------------------------------------------------------------------------------------------------ the service

live = service.Service(ALPS.database, HOLES.database, EARTH.database)
types = {}


def read_live(name):
    def read(path):
        answer = live.ask("/collections/%s/tiles/3d-tiles/%s" % (name, path))
        types[path.rsplit(".")[-1]] = answer.content_type
        return answer.body if answer.status == 200 else None
    return read


for t in (ALPS, HOLES, EARTH):
    served = Tileset(read_live(t.name))
    s.check(t.name + ": the service gives the same bytes", served.contents == t.set.contents and served.there == t.set.there and served.json == t.set.json)
s.equal("media types are those of JSON, glTF and bytes", types, {"json": "application/json", "glb": "model/gltf-binary", "subtree": "application/octet-stream"})
bare = next(p for p in HOLES.set.there if p not in HOLES.tiles)
for name, path in (("holes", "content/%d/%d/%d.glb" % bare), ("alps", "content/9/0/0.glb"), ("alps", "content/0/1/0.glb"), ("alps", "subtrees/1/0/0.subtree"),
                   ("alps", "content/1/99999999/0.glb"), ("alps", "subtrees/24/0/0.subtree")):
    answer = live.ask("/collections/%s/tiles/3d-tiles/%s" % (name, path))
    s.equal("no tile: " + name + " " + path, (answer.status, "tileset.json" in answer.detail()), (404, True))
s.equal("the service ends well", live.stop(), (0, ""))

out, status = s.run([s.RQT, "tiles", ALPS.database, "--kind", "3d-tiles", "--levels", "1-2", "-o", s.temp("part")])
s.check("levels are there all or not at all", status == 1 and "has all levels" in out, out)
s.import_terrain(s.temp("metric.gpkg"), os.path.join(s.DATA, "glarus_alpine_25m_161.tif"), name="metric")
out, status = s.run([s.RQT, "tiles", s.temp("metric.gpkg"), "--kind", "3d-tiles", "-o", s.temp("metric")])
s.check("a terrain that is not in degrees has none, and is told why", status == 1 and "longitude and latitude on WGS 84" in out, out)
s.equal("and nothing is left of it", os.path.exists(s.temp("metric")), False)
s.run([s.RQT, "tiles", ALPS.database, "--kind", "3d-tiles", "--jobs", "1", "-o", s.temp("again")])
s.equal("one worker writes what two write", Tileset(reader(s.temp("again"))).contents, ALPS.set.contents)

s.finish()
