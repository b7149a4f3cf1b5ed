#!/usr/bin/python3
"""rqt_mesh(..., 'rqt') and rqt_delta, read by a decoder written from src/core/FORMAT.md alone: the vertices of rqt_range come back, in the
order in which triangles name them, and the triangles of rqt_triangles in theirs; increments, applied step by step, end in the mesh as asked for at once."""
import ctypes
import ctypes.util
import os
import struct

import sql_support as s
from sql_support import check, equal, one, raises, rows

ZSTD = ctypes.CDLL(ctypes.util.find_library("zstd") or "libzstd.so.1")
ZSTD.ZSTD_decompress.restype = ctypes.c_size_t
ZSTD.ZSTD_decompress.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p, ctypes.c_size_t)
UNKNOWN, FORCED, NOT, VERTEX, GUESS = range(5)
NONE, ALL, PART, QUARTER = range(4)


class Wire:
    """The mesh of a BLOB; before: the Wire that an increment begins from."""

    def __init__(self, data, before=None):
        magic, version, kind, self.k, zero = struct.unpack_from("<4s4B", data)
        assert (magic, version, zero) == (b"RQTW", 1, 0) and kind == (2 if before else 1)
        assert struct.unpack_from("<Q", data, 8)[0] == s.checksum(data, 8)
        self.counts = struct.unpack_from("<QQ", data, 16)
        self.identity = data[32:104] + data[112:120]
        self.eps, self.width, self.height, payload, self.eps_from, self.digest = struct.unpack_from("<dIIQdQ", data, 104)
        if before:
            assert self.identity == before.identity and self.eps_from == before.eps
        self.prior = dict(before.lattice) if before else {}
        plain = ctypes.create_string_buffer(payload)
        assert ZSTD.ZSTD_decompress(plain, payload, data[144:], len(data) - 144) == payload
        self.streams(plain.raw)
        self.K = 0
        while (1 << self.K) + 1 < max(self.width, self.height):
            self.K += 1
        self.vertices, self.triangles, self.lattice = [], [], {}
        self.index, self.known, self.last = {}, {}, 0
        self.cell(0, 0, 0)
        for i, (p, bits) in self.stream.items():
            used = self.at[i]
            assert used == len(p) if not bits else (used + 7) // 8 == len(p), ("stream", i, used, len(p))
        assert self.counts == (len(self.vertices), len(self.triangles))

    def streams(self, plain):
        first, number = plain[0], plain[1]
        names = [0, 1, 2, 3, 4] + [(c, i) for c in range(first, first + number) for i in range(4)]
        at, lengths = 2, []
        for _ in names:
            v = shift = 0
            while True:
                byte = plain[at]
                at += 1
                v |= (byte & 127) << shift
                shift += 7
                if byte < 128:
                    break
            lengths.append(v)
        self.stream, self.at = {}, {}
        for name, length in zip(names + ["R"], lengths + [len(plain)]):
            bits = name in (3, 4, "R") or (isinstance(name, tuple) and name[1] >= 2)
            self.stream[name] = (plain[at:at + length], bits)
            self.at[name] = 0
            at += length

    def byte(self, name):
        self.at[name] += 1
        return self.stream[name][0][self.at[name] - 1]

    def bits(self, name, count):
        v = 0
        for i in range(count):
            at = self.at[name]
            v |= (self.stream[name][0][at >> 3] >> (at & 7) & 1) << i
            self.at[name] += 1
        return v

    def height_of(self, name, guess):
        t = self.byte(name)
        v = t
        if t >= 64:
            b = (t - 64) // 4 + 4
            v = ((4 + (t & 3)) << b) + self.bits("R", b)
        return guess + (v // 2 if v % 2 == 0 else -(v + 1) // 2)

    # vertices are lattice vertices (x, y) here
    def sample(self, v):
        return (min(v[0], self.width - 1), min(v[1], self.height - 1))

    def on_rim(self, v):
        return v[0] >= self.width - 1 or v[1] >= self.height - 1

    def on_side(self, v):
        x0, y0, side = self.box
        return v[0] <= x0 or v[1] <= y0 or v[0] >= x0 + side or v[1] >= y0 + side

    def is_special(self, v):
        return self.on_side(v) or self.on_rim(v)

    def state_of(self, v):
        return self.state.get(v, UNKNOWN)

    def flat(self, *t):
        return all(v[0] >= self.width - 1 for v in t) or all(v[1] >= self.height - 1 for v in t)

    def cell(self, level, i, j):
        side = 1 << (self.K - level)
        if i * side >= max(self.width - 1, 1) or j * side >= max(self.height - 1, 1):
            return
        symbol = self.byte(0)
        if symbol == 1:
            assert level < self.K - self.k
            for c in range(4):
                self.cell(level + 1, 2 * i + (c & 1), 2 * j + (c >> 1))
        elif symbol:
            self.block(level, i, j, side, ((symbol - 2) & 3, (symbol - 2) >> 2))

    def block(self, level, i, j, side, amounts):
        self.box, self.stride, self.state, self.q = (i * side, j * side, side), side >> self.k, {}, {}
        corner = [(i * side, j * side), ((i + 1) * side, j * side), (i * side, (j + 1) * side), ((i + 1) * side, (j + 1) * side)]
        for v in corner:
            self.q[v], self.state[v] = self.last, GUESS
            if not self.on_rim(v) and self.sample(v) in self.known:
                self.last = self.q[v] = self.known[self.sample(v)]
                self.state[v] = VERTEX
        c = (i & 1) + 2 * (j & 1)
        center = 3 - c
        halves = ((1, 0, 3), (2, 3, 0)) if level == 0 else ((c ^ 1, center, c), (c ^ 2, c, center))
        for (a, start, end), amount in zip(halves, amounts):
            self.leaves = []
            if amount == QUARTER:
                far = (2 * corner[a][0] - corner[c][0], 2 * corner[a][1] - corner[c][1])
                self.settle(corner[c])
                self.q[far], self.state[far] = self.q[corner[c]], GUESS
                self.leaves.append((corner[center], corner[c], far))
            else:
                self.enter(amount, corner[a], corner[start], corner[end])
            for leaf in self.leaves:
                self.number(leaf)

    def settle(self, v):
        if self.state_of(v) == VERTEX:
            return
        special = self.is_special(v)
        if special and self.sample(v) in self.known:
            self.q[v] = self.known[self.sample(v)]
        else:
            if v in self.prior:
                self.q[v] = self.prior[v]
            else:
                self.last = self.q[v] = self.height_of(2, self.q[v])
            if special:
                self.known[self.sample(v)] = self.q[v]
        self.state[v] = VERTEX

    def enter(self, amount, a, l, r):
        if amount == NONE:
            return
        assert not self.flat(a, l, r)
        if amount == ALL:
            for v in (a, l, r):
                if not self.on_rim(v):
                    self.settle(v)
            self.walk(a, l, r)
            return
        m = ((l[0] + r[0]) // 2, (l[1] + r[1]) // 2)
        if self.state_of(m) in (UNKNOWN, FORCED):
            self.q[m], self.state[m] = (self.q[l] + self.q[r]) >> 1, GUESS
            across = (l[0] + r[0] - a[0], l[1] + r[1] - a[1])
            if not self.on_side(m) and self.state_of(across) == UNKNOWN:
                self.state[across] = FORCED
            if self.on_side(m) and not self.on_rim(m) and m in self.known:
                self.q[m], self.state[m] = self.known[m], VERTEX
        symbol = self.byte(1)
        assert 1 <= symbol <= 8 and symbol != 4
        order = (NONE, ALL, PART)
        self.enter(order[symbol // 3], m, l, a)
        self.enter(order[symbol % 3], m, a, r)

    def splits(self, a, l, r, m):
        state = self.state_of(m)
        if state in (VERTEX, NOT):
            return state == VERTEX
        if state == GUESS:
            if not self.on_rim(m):
                self.settle(m)
            return True
        inside, special = not self.on_side(m), self.is_special(m)
        across = (l[0] + r[0] - a[0], l[1] + r[1] - a[1])
        other = self.state_of(across) if inside else UNKNOWN
        step = (m[0] | m[1]) & -(m[0] | m[1])
        kind = 2 * (step.bit_length() - 1) + (1 if (m[0] & m[1] & step) else 0)
        height = None
        if m in self.prior:
            height = self.known.setdefault(self.sample(m), self.prior[m]) if special else self.prior[m]
        elif self.on_side(m) and not self.on_rim(m) and m in self.known:
            height = self.known[m]
        elif state == UNKNOWN:
            if inside and other == NOT:
                bit = 0
            elif special:
                north_west = m[0] == self.box[0] or m[1] == self.box[1]
                bit = self.bits(3 if north_west else 4, 1)
            else:
                bit = self.bits((kind, 3 if other in (VERTEX, GUESS) else 2), 1)
            if not bit:
                self.state[m] = NOT
                return False
        if inside and other == UNKNOWN:
            self.state[across] = FORCED
        if height is not None:
            self.q[m] = height
        elif self.on_rim(m):
            self.q[m], self.state[m] = (self.q[l] + self.q[r]) >> 1, GUESS
            return True
        else:
            pair = other in (VERTEX, GUESS)
            guess = (self.q[l] + self.q[r] + self.q[a] + self.q[across]) >> 2 if pair else (self.q[l] + self.q[r]) >> 1
            self.q[m] = self.height_of((kind, 1 if pair else 0), guess)
            if special:
                self.known[self.sample(m)] = self.q[m]
        self.state[m] = VERTEX
        return True

    def walk(self, a, l, r):
        if self.flat(a, l, r):
            return
        m = ((l[0] + r[0]) // 2, (l[1] + r[1]) // 2)
        finest = max(abs(l[0] - r[0]), abs(l[1] - r[1])) == self.stride and a[0] in (l[0], r[0]) and a[1] in (l[1], r[1])
        if finest or not self.splits(a, l, r, m):
            self.leaves.append((a, l, r))
            return
        self.walk(m, l, a)
        self.walk(m, a, r)

    def number(self, leaf):
        places = []
        for v in leaf:
            p = self.sample(v)
            self.settle(v)
            if p not in self.index:
                self.index[p] = len(self.vertices)
                self.vertices.append((p[0], p[1], self.q[v], self.K))
            at = self.index[p]
            scale = self.K if v == (0, 0) else ((v[0] | v[1]) & -(v[0] | v[1])).bit_length() - 1
            old = self.vertices[at]
            self.vertices[at] = old[:3] + (min(old[3], self.K - scale),)
            self.lattice[v] = old[2]
            places.append(at)
        a, l, r = (self.sample(v) for v in leaf)
        if (l[0] - a[0]) * (r[1] - a[1]) - (r[0] - a[0]) * (l[1] - a[1]) > 0:
            places[1], places[2] = places[2], places[1]
        self.triangles.append(tuple(places))

    def positions(self):
        return [tuple(self.vertices[i][:3] for i in t) for t in self.triangles]


def indexed(blob):
    """The triangles of format 'indexed', as they stand there."""
    n, m = struct.unpack_from("<QQ", blob, 16)
    v = [struct.unpack_from("<iii", blob, 128 + 12 * i) for i in range(n)]
    index = struct.unpack_from("<%dI" % m, blob, 128 + 12 * n)
    return [tuple(v[i] for i in index[t:t + 3]) for t in range(0, m, 3)]


def compare(title, wire, db, region, eps):
    equal(title + ": the vertices of rqt_range", sorted(wire.vertices),
          sorted(rows(db, "SELECT col, row, q, level FROM rqt_range(?, ?)", region, eps)))
    apex_first = {}
    for t in wire.triangles:
        for corner in sorted(t):
            apex_first.setdefault(corner, len(apex_first))
    check(title + ": each vertex where a triangle first names it", all(i == n for i, n in apex_first.items()) and len(apex_first) == len(wire.vertices))
    equal(title + ": triangles in the order of the walk", wire.positions(), indexed(one(db, "SELECT rqt_mesh(?, ?, 'indexed')", region, eps)))
    equal(title + ": its eps", wire.eps, float(eps))


sizes = []
chains = 0
grids = (("plain", s.rough_grid(70, 70, 11), 3, None), ("voids", s.rough_grid(37, 61, 12, 90), 2, None), ("clamped", s.rough_grid(34, 18, 13), 4, None),
         ("islands", s.rough_grid(50, 40, 14, 700), 3, None), ("feet", s.rough_grid(33, 65, 15, 20), 6, "us-ft"), ("row", [[1, 2, 3, 5]], None, None))
for name, grid, block, unit in grids:
    path = s.temp(name + ".db")
    options = {"name": name}
    if block:
        options["block"] = block
    if unit:
        options["unit"] = unit
    s.import_terrain(path, s.write_grid(s.temp(name + ".asc"), grid), **options)
    db = s.connect(path)
    windows = (None, "POLYGON((3.2 -9.7, 21.4 -9.7, 21.4 -30.1, 3.2 -30.1, 3.2 -9.7))", "LINESTRING(1 -1, 30 -17)", "POINT(9 -9)", "POLYGON((-9 50, -8 50, -8 51, -9 50))")
    for region in windows:
        title = "%s, %s" % (name, region and region[:12])
        before = None
        for eps in (float("inf"), 30, 10, 4, 1, 0):
            blob = one(db, "SELECT rqt_mesh(?, ?, 'rqt')", region, eps)
            whole = Wire(blob)
            sizes.append(len(whole.triangles))
            compare("%s, eps %g" % (title, eps), whole, db, region, eps)
            if before:
                step = Wire(one(db, "SELECT rqt_delta(?, ?, ?)", region, before.eps, eps), before)
                compare("%s, eps %g to %g" % (title, before.eps, eps), step, db, region, eps)
                before = step
                chains += 1
            else:
                before = whole
    db.close()
check("the meshes were of many sizes", 0 in sizes and max(sizes) > 5000 and chains > 100, (max(sizes), chains))

path = s.temp("alpine.gpkg")
s.import_terrain(path, os.path.join(s.DATA, "glarus_alpine_25m_161.tif"), name="alpine")
db = s.connect(path)
blob = one(db, "SELECT rqt_mesh(NULL, 2, 'rqt')")
compare("alpine, eps 2", Wire(blob), db, None, 2)
n = one(db, "SELECT count(*) FROM rqt_range(NULL, 2)")
check("it takes less than a twelfth of format indexed", 12 * len(blob) < len(one(db, "SELECT rqt_mesh(NULL, 2, 'indexed')")), (len(blob), n))
check("an increment of nothing is small", len(one(db, "SELECT rqt_delta(NULL, 2, 2)")) < 400)
check("an increment is less than the mesh", len(one(db, "SELECT rqt_delta(NULL, 5, 2)")) < len(blob))
equal("equal meshes are equal bytes", one(db, "SELECT rqt_mesh(NULL, 2, 'rqt', 'alpine', '{\"select\":\"bottomup\"}')"), blob)
raises("eps_from below eps_to", "rqt_delta(): eps_from must not be less than eps_to; it is 1.0", lambda: one(db, "SELECT rqt_delta(NULL, 1.0, 2)"))
raises("eps_to below zero", "rqt_delta(): eps_to must be 0 or more; it is -1.0", lambda: one(db, "SELECT rqt_delta(NULL, 1, -1.0)"))
raises("eps_from is no number", "rqt_delta(): eps_from must be a number; it is NULL", lambda: one(db, "SELECT rqt_delta(NULL, NULL, 1)"))
raises("an unknown terrain", "rqt_delta()", lambda: one(db, "SELECT rqt_delta(NULL, 2, 1, 'nowhere')"))
db.close()
s.finish()
