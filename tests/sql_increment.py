"""Increments of views, read again by FORMAT.md ("View increment") alone, with libzstd: what a client does."""
import ctypes
import ctypes.util
import struct

ZSTD = ctypes.CDLL(ctypes.util.find_library("zstd") or "libzstd.so.1")
ZSTD.ZSTD_decompress.restype = ctypes.c_size_t
ZSTD.ZSTD_decompress.argtypes = [ctypes.c_char_p, ctypes.c_size_t, ctypes.c_char_p, ctypes.c_size_t]
MASK = 2**64 - 1


def spread(v):
    return sum((v >> bit & 1) << 2 * bit for bit in range(21))


def gather(code):
    return sum((code >> 2 * bit & 1) << bit for bit in range(21))


def code_of(col, row):
    return spread(col) | spread(row) << 1


def fold(h, w):
    v = ((h ^ w) & MASK) * 0xC2B2AE3D27D4EB4F & MASK
    return (v << 29 | v >> 35) & MASK


def finished(h):
    h = (h ^ h >> 32) * 0xFF51AFD7ED558CCD & MASK
    return h ^ h >> 29


def checksum(data):
    h = 0x9E3779B97F4A7C15 ^ len(data) * 0xFF51AFD7ED558CCD & MASK
    data = data[:8] + bytes(8) + data[16:]
    data += bytes(-len(data) % 8)
    for word in struct.unpack("<%dQ" % (len(data) // 8), data):
        h = fold(h, word)
    return finished(h)


class Mesh:
    """vertices: (col, row, q) by Morton code; triangles: indices, sorted."""

    def __init__(self, vertices=(), triangles=()):
        self.vertices, self.triangles = list(vertices), list(triangles)

    @staticmethod
    def of(vertices, triangles):
        """Vertices in any order, triangles as indices into them."""
        order = sorted(range(len(vertices)), key=lambda i: code_of(*vertices[i][:2]))
        number = {old: new for new, old in enumerate(order)}
        return Mesh([vertices[i] for i in order], sorted(tuple(number[i] for i in t) for t in triangles))

    def __eq__(self, other):
        return self.vertices == other.vertices and self.triangles == other.triangles

    def digest(self):
        h = 0x9E3779B97F4A7C15 ^ len(self.vertices) * 0xFF51AFD7ED558CCD & MASK
        for col, row, q in self.vertices:
            h = fold(fold(h, row << 32 | col), q & 0xFFFFFFFF)
        for a, b, c in self.triangles:
            h = fold(fold(h, b << 32 | a), 1 << 32 | c)
        return finished(h)


class Increment:
    def __init__(self, blob):
        (magic, version, flags, zero, check, self.begins, self.ends, self.vertices, self.triangles, note,
         payload) = struct.unpack_from("<4sBBHQQQIIII", blob)
        assert magic == b"RQTI" and version == 1 and zero == 0 and check == checksum(blob)
        at = 48
        self.frame = None
        if flags & 1:
            self.frame = struct.unpack_from("<4dqiiiiddd", blob, at)
            at += 80
        self.token = blob[at:at + note].decode()
        at += note
        self.payload = b""
        if payload:
            room = ctypes.create_string_buffer(payload)
            assert ZSTD.ZSTD_decompress(room, payload, blob[at:], len(blob) - at) == payload
            self.payload = room.raw
        else:
            assert at == len(blob) and self.begins == self.ends

    @property
    def is_unchanged(self):
        return not self.payload

    def apply(self, old):
        assert self.begins == old.digest(), "an increment of another mesh"
        if self.is_unchanged:
            return old
        bytes_left = iter(self.payload)

        def number():
            v = shift = 0
            for byte in bytes_left:
                v |= (byte & 127) << shift
                shift += 7
                if byte < 128:
                    return v
            raise AssertionError("cut off")

        def signed():
            v = number()
            return v >> 1 ^ -(v & 1)

        def ascending(n):
            out, last = [], -1
            for _ in range(n):
                last += 1 + number()
                out.append(last)
            return out

        gone, come, gone_triangles, come_triangles = number(), number(), number(), number()
        gone, codes = set(ascending(gone)), ascending(come)
        stays = [(code_of(*v[:2]), v, i) for i, v in enumerate(old.vertices) if i not in gone]
        fresh = [(code, None, None) for code in codes]
        now, vertices, last = {}, [], 0
        for code, v, i in sorted(stays + fresh, key=lambda item: item[0]):
            if v is None:
                v = (gather(code), gather(code >> 1), last + signed())
            else:
                now[i] = len(vertices)
            vertices.append(v)
            last = v[2]
        dropped = set(ascending(gone_triangles))
        triangles = [tuple(now[i] for i in t) for n, t in enumerate(old.triangles)
                     if n not in dropped and all(i in now for i in t)]
        first = 0
        for _ in range(come_triangles):
            first += number()
            triangles.append((first, first + signed(), first + signed()))
        assert next(bytes_left, None) is None
        mesh = Mesh(vertices, sorted(triangles))
        assert (len(mesh.vertices), len(mesh.triangles)) == (self.vertices, self.triangles)
        assert mesh.digest() == self.ends, "it does not lead where it promises"
        return mesh
