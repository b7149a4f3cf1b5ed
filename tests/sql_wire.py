"""A decoder of the wire format, written from src/core/FORMAT.md alone: rqt_mesh(..., 'rqt'), with normals and errors or without, and rqt_delta."""
import ctypes
import ctypes.util
import struct

import sql_support as s

ZSTD = ctypes.CDLL(ctypes.util.find_library("zstd") or "libzstd.so.1")
ZSTD.ZSTD_decompress.restype = ctypes.c_size_t
ZSTD.ZSTD_decompress.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p, ctypes.c_size_t)
ZSTD.ZSTD_getFrameContentSize.restype = ctypes.c_ulonglong
ZSTD.ZSTD_getFrameContentSize.argtypes = (ctypes.c_void_p, ctypes.c_size_t)
ZSTD.ZSTD_findFrameCompressedSize.restype = ctypes.c_size_t
ZSTD.ZSTD_findFrameCompressedSize.argtypes = (ctypes.c_void_p, ctypes.c_size_t)
NONE, ALL, PART, QUARTER = range(4)


class Wire:
    """The mesh of a BLOB; before: the Wire that an increment begins from."""

    def __init__(self, data, before=None):
        magic, version, kind, self.k, flags = struct.unpack_from("<4s4B", data)
        assert (magic, version) == (b"RQTW", 1) and flags < (1 if before else 4) and kind == (2 if before else 1)
        assert struct.unpack_from("<Q", data, 8)[0] == s.checksum(data, 8)
        self.counts = struct.unpack_from("<QQ", data, 16)
        self.identity = data[32:104] + data[112:120]
        self.eps, self.width, self.height, payload, self.eps_from, self.digest = struct.unpack_from("<dIIQdQ", data, 104)
        if before:
            assert self.identity == before.identity and self.eps_from == before.eps
        self.prior = dict(before.lattice) if before else {}
        self.before = {self.sample(v): q for v, q in self.prior.items()}
        frames, end = [], 144
        while end < len(data):
            begin, end = end, end + ZSTD.ZSTD_findFrameCompressedSize(data[end:], len(data) - end)
            frames.append(data[begin:end])
        assert end == len(data) and len(frames) == 1 + (flags & 1) + (flags >> 1)
        self.streams(self.inflate(frames[0], payload))
        self.K = 0
        while (1 << self.K) + 1 < max(self.width, self.height):
            self.K += 1
        self.vertices, self.triangles, self.lattice = [], [], {}
        self.index, self.last = {}, 0
        self.cell(0, 0, 0)
        for i, (p, bits) in self.stream.items():
            used = self.at[i]
            assert used == len(p) if not bits else (used + 7) // 8 == len(p), ("stream", i, used, len(p))
        assert self.counts == (len(self.vertices), len(self.triangles))
        self.normals = self.read_normals(self.inflate(frames[1], 2 * self.counts[0])) if flags & 1 else None
        self.errors = self.read_errors(self.inflate(frames[-1], None), data) if flags & 2 else None

    @staticmethod
    def inflate(frame, size):
        """size None: as the frame says."""
        if size is None:
            size = ZSTD.ZSTD_getFrameContentSize(frame, len(frame))
        plain = ctypes.create_string_buffer(size)
        assert ZSTD.ZSTD_decompress(plain, size, frame, len(frame)) == size
        return plain.raw

    def read_normals(self, plain):
        """Of every vertex, in their order."""
        n, at, found = self.counts[0], [0, 0], []
        for i in range(n):
            for plane in range(2):
                at[plane] = (at[plane] + plain[plane * n + i]) % 256
            u, v = ((b - 256 if b > 127 else b) / 127 for b in at)
            assert -1 <= u <= 1 and -1 <= v <= 1
            x, y = (u + v) / 2, (u - v) / 2
            z = 1 - abs(x) - abs(y)
            length = (x * x + y * y + z * z) ** 0.5
            found.append((x / length, y / length, z / length))
        return found

    def read_errors(self, plain, data):
        """Metres of every vertex, in their order."""
        n, d, above, below = self.counts[0], *struct.unpack_from("<3i", data, 72)
        f = struct.unpack_from("<d", data, 88)[0] * (above / below)
        least, list_at = plain[0] + 256 * plain[1], 2 + (n + 7) // 8
        bits = [plain[2 + i // 8] >> i % 8 & 1 for i in range(8 * (list_at - 2))]
        m = sum(bits)
        assert len(plain) == list_at + 2 * m and not any(bits[n:])
        residuals = [plain[list_at + i] + 256 * plain[list_at + m + i] for i in range(m)]
        assert 0 not in residuals

        def kind(v):
            s = 1
            while s < 1 << self.K and v[0] % (2 * s) == v[1] % (2 * s) == 0:
                s *= 2
            return s, v[0] // s % 2 + 2 * (v[1] // s % 2)  # which of the two are odd

        place = [v[:2] for v in self.vertices]
        at = {v: i for i, v in enumerate(place)}
        codes, children, told = [None] * n, [0] * n, iter(residuals)
        order = sorted(range(n), key=lambda i: (kind(place[i])[0], kind(place[i])[1] == 3, i))
        for bit, i in zip(bits, order):
            x, y = place[i]
            s, odd = kind(place[i])
            across, along, main, other = (((x - a * s, y - b * s), (x + a * s, y + b * s)) for a, b in ((1, 0), (0, 1), (1, 1), (1, -1)))
            ends, parents = (across, along) if odd == 1 else (along, across) if odd == 2 else (main, other) if (x + y) // (2 * s) % 2 else (other, main)
            corner = {x, y} <= {0, 1 << self.K}
            guess = max(least, children[i])
            if not corner and ends[0] in at and ends[1] in at:
                v = abs(2 * self.vertices[i][2] - sum(self.vertices[at[e]][2] for e in ends)) * abs(f) / (2 * d)
                guess = max(guess, self.code_of(v))
            codes[i] = (guess + (next(told) if bit else 0)) % 65536
            for p in () if corner else parents:
                if p in at:
                    assert codes[at[p]] is None
                    children[at[p]] = max(children[at[p]], codes[i])
        self.least = self.metres_of(least)
        return [self.metres_of(c) for c in codes]

    @staticmethod
    def code_of(v):
        """The smallest that is not below v, by search."""
        low, high = (0, 0) if v == 0 else (1, 65534)
        while low < high:
            middle = (low + high) // 2
            low, high = (low, middle) if Wire.metres_of(middle) >= v else (middle + 1, high)
        return low

    @staticmethod
    def metres_of(code):
        return 0.0 if code == 0 else float("inf") if code == 65535 else (128 + (code & 127)) * 2.0 ** ((code >> 7) - 263)

    def streams(self, plain):
        first, number = plain[0], plain[1]
        names = list(range(6)) + [(c, i) for c in range(first, first + number) for i in range(2)]
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
            bits = name in (3, 4, "R") or (isinstance(name, tuple) and name[1] == 1)
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
        self.box, self.q, self.samples = (i * side, j * side, side), {}, {}
        x0, y0, stride = i * side, j * side, side >> self.k
        corner = [(x0, y0), (x0 + side, y0), (x0, y0 + side), (x0 + side, y0 + side)]
        for v in corner:
            self.take(v, self.last, 2, True)
            self.last = self.q[v]
        step = side
        while step > stride:
            half = step // 2
            level_of = 2 * (half.bit_length() - 1)
            cells = [(x0 + half + step * c, y0 + half + step * r) for r in range(side // step) for c in range(side // step)]
            self.scale(cells, ((-half, -half), (half, -half), (-half, half), (half, half)), level_of + 1)
            rows = [(x0 + (half if r % 2 == 0 else 0) + step * c, y0 + half * r) for r in range(2 * side // step + 1) for c in range(side // step + r % 2)]
            self.scale(rows, ((-half, 0), (half, 0), (0, -half), (0, half)), level_of)
            step = half
        c = (i & 1) + 2 * (j & 1)
        center = 3 - c
        halves = ((1, 0, 3), (2, 3, 0)) if level == 0 else ((c ^ 1, center, c), (c ^ 2, c, center))
        for (a, start, end), amount in zip(halves, amounts):
            if amount == QUARTER:
                far = (2 * corner[a][0] - corner[c][0], 2 * corner[a][1] - corner[c][1])
                if self.sample(far) in self.index:
                    self.q[far] = self.vertices[self.index[self.sample(far)]][2]
                else:
                    self.q[far] = self.before[self.sample(far)] if self.sample(far) in self.before else self.height_of(2, self.q[corner[c]])
                self.number((corner[center], corner[c], far))
            else:
                self.enter(amount, corner[a], corner[start], corner[end], stride)

    def scale(self, places, around, kind):
        """Which of the places are vertices, and their heights."""
        x0, y0, side = self.box
        waiting = []
        for v in places:
            four = [(v[0] + dx, v[1] + dy) for dx, dy in around]
            here = [u for u in four if x0 <= u[0] <= x0 + side and y0 <= u[1] <= y0 + side]
            if any(u not in self.q for u in here):
                continue
            edge = len(here) < 4
            if edge:  # only the two along the side count
                here = [u for u in here if (u[0] == v[0] if v[0] in (x0, x0 + side) else u[1] == v[1])]
            north_west = v[0] == x0 or v[1] == y0
            found = north_west and not self.on_rim(v) and v in self.index
            if not found and v not in self.prior:
                if not self.bits((3 if north_west else 4) if edge else (kind, 1), 1):
                    continue
                if not edge and not self.on_rim(v):
                    waiting.append((v, here))
                    continue
            self.take(v, sum(self.q[u] for u in here) * (4 // len(here)) >> 2, 5, north_west)
        for v, here in waiting:
            self.q[v] = self.height_of((kind, 0), sum(self.q[u] for u in here) >> 2)

    def take(self, v, guess, stream, known):
        x0, y0, side = self.box
        p = self.sample(v)
        if not (self.on_rim(v) and p in self.samples):
            # north-west: also when an earlier grid line of the block has the sample
            stride = side >> self.k
            first = [o + max(0, -(-(last - o) // stride)) * stride if c >= last else c
                     for c, o, last in ((v[0], x0, self.width - 1), (v[1], y0, self.height - 1))]
            known = known or first[0] == x0 or first[1] == y0
            if known and p in self.index:
                height = self.vertices[self.index[p]][2]
            elif p in self.before:
                height = self.before[p]
            else:
                height = self.height_of(stream, guess)
            self.samples[p] = height
        self.q[v] = self.samples[p]

    def enter(self, amount, a, l, r, stride):
        if amount == NONE:
            return
        assert not self.flat(a, l, r)
        if amount == ALL:
            self.walk(a, l, r, stride)
            return
        m = ((l[0] + r[0]) // 2, (l[1] + r[1]) // 2)
        assert m in self.q
        symbol = self.byte(1)
        assert 1 <= symbol <= 8 and symbol != 4
        order = (NONE, ALL, PART)
        self.enter(order[symbol // 3], m, l, a, stride)
        self.enter(order[symbol % 3], m, a, r, stride)

    def walk(self, a, l, r, stride):
        if self.flat(a, l, r):
            return
        m = ((l[0] + r[0]) // 2, (l[1] + r[1]) // 2)
        finest = max(abs(l[0] - r[0]), abs(l[1] - r[1])) == stride and a[0] in (l[0], r[0]) and a[1] in (l[1], r[1])
        if finest or m not in self.q:
            self.number((a, l, r))
            return
        self.walk(m, l, a, stride)
        self.walk(m, a, r, stride)

    def number(self, leaf):
        places = []
        for v in leaf:
            p = self.sample(v)
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
