"""What a camera sees, worked out here from its JSON and a textbook: places in space, projection; and whether a mesh has cracks."""
import json
import math


def textbook_ecef(lon, lat, h):
    a, f = 6378137.0, 1 / 298.257223563
    e2, u, v = f * (2 - f), math.radians(lon), math.radians(lat)
    n = a / math.sqrt(1 - e2 * math.sin(v) ** 2)
    return ((n + h) * math.cos(v) * math.cos(u), (n + h) * math.cos(v) * math.sin(u), (n * (1 - e2) + h) * math.sin(v))


def minus(a, b):
    return tuple(p - q for p, q in zip(a, b))


def dot(a, b):
    return sum(p * q for p, q in zip(a, b))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def unit(a):
    length = math.sqrt(dot(a, a))
    return tuple(p / length for p in a)


class Eye:
    """A camera of our own reading of the JSON: eye and at, or yaw and pitch, in a scene that a function makes."""

    def __init__(self, text, scene, degrees):
        given = json.loads(text)
        self.k = given.get("exaggeration", 1)
        self.tau, self.w, self.h = given.get("tau", 1), given["width"], given["height"]
        self.near, self.far = given.get("near", 0), given.get("far", math.inf)
        self.focal = self.h / (2 * math.tan(math.radians(given["fovy"]) / 2))
        eye = given["eye"]
        self.eye = scene(*eye)
        east, north, up = (1, 0, 0), (0, 1, 0), (0, 0, 1)
        if degrees:
            u, v = math.radians(eye[0]), math.radians(eye[1])
            east, up = (-math.sin(u), math.cos(u), 0), (math.cos(v) * math.cos(u), math.cos(v) * math.sin(u), math.sin(v))
            north = cross(up, east)
        yaw, pitch = math.radians(given.get("yaw", 0)), math.radians(given.get("pitch", 0))
        ahead = tuple(math.sin(yaw) * e + math.cos(yaw) * n for e, n in zip(east, north))
        if "at" in given:
            self.forward = unit(minus(scene(*given["at"]), self.eye))
        else:
            self.forward = unit(tuple(math.cos(pitch) * a + math.sin(pitch) * b for a, b in zip(ahead, up)))
        side = cross(self.forward, up)
        self.right = unit(side if dot(side, side) > 1e-18 else cross(self.forward, ahead))
        self.up = cross(self.right, self.forward)
        roll = math.radians(given.get("roll", 0))
        self.right, self.up = (tuple(math.cos(roll) * r - math.sin(roll) * u for r, u in zip(self.right, self.up)),
                               tuple(math.cos(roll) * u + math.sin(roll) * r for r, u in zip(self.right, self.up)))

    def project(self, p):
        """x, y, depth; drawn?"""
        v = minus(p, self.eye)
        depth = dot(v, self.forward)
        if depth <= 0:
            return 0, 0, depth, False
        x, y = self.focal * dot(v, self.right) / depth, self.focal * dot(v, self.up) / depth
        drawn = abs(x) <= self.w / 2 and abs(y) <= self.h / 2 and self.near <= depth <= self.far
        return x, y, depth, drawn


def is_whole(found):
    """Each edge is in at most two triangles, once each way; and no vertex lies inside an edge that only one has (a T-junction), but
    where the region ends: returned are those edges with such a vertex."""
    edges = {}
    for t in found:
        for i in range(3):
            edge = (t[i][:2], t[(i + 1) % 3][:2])
            if edge in edges:
                return False
            edges[edge] = True
    rim = [e for e in edges if (e[1], e[0]) not in edges]
    vertices = {p for e in rim for p in e}
    by_x, by_y = {}, {}
    for x, y in vertices:
        by_x.setdefault(x, set()).add(y)
        by_y.setdefault(y, set()).add(x)
    for (xa, ya), (xb, yb) in rim:
        low, high = min(ya, yb), max(ya, yb)
        if xa == xb and any(low < y < high for y in by_x[xa]):
            return False
        low, high = min(xa, xb), max(xa, xb)
        if ya == yb and any(low < x < high for x in by_y[ya]):
            return False
        middle = ((xa + xb) / 2, (ya + yb) / 2)
        if xa != xb and ya != yb and middle in vertices:
            return False
    return True
