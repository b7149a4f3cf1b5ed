#!/usr/bin/python3
"""view.py DATABASE EXTENSION PICTURE.png - what a camera sees of a terrain in longitude and latitude: a view, drawn.

One statement gives the triangles; here they are projected and painted from back to front, the right half with their edges on
top, so that one sees how detail falls with distance. Needs python3-pil. For example, after `make demo`:

    examples/view.py build/demo/white-mountains.gpkg build/rqt.so build/demo/view.png
"""
import json
import math
import sqlite3
import sys

from PIL import Image, ImageDraw

CAMERA = {"eye": [-71.16, 44.19, 2600], "yaw": 311, "pitch": -10.5, "fovy": 32, "width": 1200, "height": 600, "tau": 3}
FINER = 2  # painted so many times as large, then reduced: smooth edges
LIGHT = (-0.64, 0.26, 0.72)  # east, north, up: from the west-north-west


def in_space(lon, lat, height):
    """Geocentric metres on WGS 84, which is where a view of a terrain in degrees is."""
    a, e2, lon, lat = 6378137.0, 0.0066943799901413165, math.radians(lon), math.radians(lat)
    n = a / math.sqrt(1 - e2 * math.sin(lat) ** 2)
    return ((n + height) * math.cos(lat) * math.cos(lon), (n + height) * math.cos(lat) * math.sin(lon),
            (n * (1 - e2) + height) * math.sin(lat))


def combine(*terms):
    return tuple(sum(f * v[i] for f, v in terms) for i in range(3))


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def colour(height, shade, haze):
    """Forest, rock above the tree line, paler with distance."""
    rock = min(1, max(0, (height - 1150) / 350))
    ground = [f + rock * (r - f) for f, r in zip((96, 122, 74), (176, 164, 146))]
    return tuple(round(g * shade * (1 - haze) + s * haze) for g, s in zip(ground, (205, 219, 232)))


database, extension, picture = sys.argv[1:]
db = sqlite3.connect(database)
db.enable_load_extension(True)
db.load_extension(extension)
triangles = db.execute("SELECT x0,y0,z0, x1,y1,z1, x2,y2,z2 FROM rqt_view_triangles(?)", (json.dumps(CAMERA),)).fetchall()

lon, lat, _ = CAMERA["eye"]
eye = in_space(*CAMERA["eye"])
sin, cos = math.sin, math.cos
x, y = math.radians(lon), math.radians(lat)
east, north, up = (-sin(x), cos(x), 0), (-sin(y) * cos(x), -sin(y) * sin(x), cos(y)), (cos(y) * cos(x), cos(y) * sin(x), sin(y))
yaw, pitch = math.radians(CAMERA["yaw"]), math.radians(CAMERA["pitch"])
forward = combine((cos(pitch) * sin(yaw), east), (cos(pitch) * cos(yaw), north), (sin(pitch), up))
right = cross(forward, up)
right = combine((1 / math.sqrt(dot(right, right)), right))
above = cross(right, forward)
light = combine((LIGHT[0], east), (LIGHT[1], north), (LIGHT[2], up))
width, height = CAMERA["width"] * FINER, CAMERA["height"] * FINER
focal = height / (2 * math.tan(math.radians(CAMERA["fovy"]) / 2))

drawn = []
for t in triangles:
    corners = [combine((1, in_space(*t[i:i + 3])), (-1, eye)) for i in (0, 3, 6)]
    depths = [dot(c, forward) for c in corners]
    if min(depths) <= 0:  # reaches behind the eye: nothing of this camera's ground does
        continue
    places = [(width / 2 + focal * dot(c, right) / d, height / 2 - focal * dot(c, above) / d) for c, d in zip(corners, depths)]
    normal = cross(combine((1, corners[1]), (-1, corners[0])), combine((1, corners[2]), (-1, corners[0])))
    shade = 0.35 + 0.75 * max(0, dot(normal, light) / math.sqrt(dot(normal, normal)))
    drawn.append((sum(depths) / 3, places, colour((t[2] + t[5] + t[8]) / 3, shade, 1 - math.exp(-max(depths) / 60000))))
drawn.sort(reverse=True)

pictures = []
for edges in (False, True):
    image = Image.new("RGB", (width, height))
    draw = ImageDraw.Draw(image)
    for row in range(height):
        sky = (round(a + (b - a) * row / height) for a, b in zip((128, 166, 204), (226, 234, 240)))
        draw.line([(0, row), (width, row)], fill=tuple(sky))
    for _, places, fill in drawn:
        draw.polygon(places, fill=fill, outline=tuple(c * 5 // 9 for c in fill) if edges else None)
    pictures.append(image.resize((CAMERA["width"], CAMERA["height"]), Image.LANCZOS))
middle = CAMERA["width"] // 2
pictures[0].paste(pictures[1].crop((middle, 0, CAMERA["width"], CAMERA["height"])), (middle, 0))
ImageDraw.Draw(pictures[0]).line([(middle, 0), (middle, CAMERA["height"])], fill=(250, 250, 250))
pictures[0].save(picture, optimize=True)
print(f"{picture}: {len(triangles)} triangles, no sample further than {CAMERA['tau']} pixels from its place")
