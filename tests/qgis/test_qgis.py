#!/usr/bin/python3
"""test_qgis.py DIRECTORY - what rqt writes, opened by QGIS without a screen: layers, coordinates, heights, and what is drawn.

`make test-qgis` runs it (QGIS is not installed for `make test`). Pictures are left in DIRECTORY, for people; what is checked of
them is where there are pixels, where there are none, and that heights have their colours.
"""
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
import sql_support as s  # noqa: E402

# Before QGIS begins: no screen, no settings of whoever runs this, and rqt's functions in every database that OGR opens.
os.environ.update(QT_QPA_PLATFORM="offscreen", QGIS_CUSTOM_CONFIG_PATH=s.temp("profile"), OGR_SQLITE_LOAD_EXTENSIONS=s.RQT_SO,
                  XDG_RUNTIME_DIR=s.TEMP)
from qgis.core import (QgsApplication, QgsColorRampShader, QgsFillSymbol, QgsMapRendererSequentialJob, QgsMapSettings, QgsMesh,  # noqa: E402
                       QgsMeshDatasetIndex, QgsMeshLayer, QgsPointXY, QgsProperty, QgsRectangle, QgsSingleSymbolRenderer,
                       QgsSymbolLayer, QgsVectorLayer, QgsWkbTypes)
from qgis.PyQt.QtCore import QSize  # noqa: E402
from qgis.PyQt.QtGui import QColor  # noqa: E402

from sql_support import check, equal, one, rows  # noqa: E402

PICTURES = os.path.abspath(sys.argv[1])
os.makedirs(PICTURES, exist_ok=True)
WHITE = QColor(255, 255, 255)
# Heights of the legend, and their colours: green valleys, brown slopes, white summits.
COLOURS = ((0.0, "#3d7a46"), (0.35, "#c9c27a"), (0.7, "#8a6242"), (1.0, "#f4f1ee"))


def box_of(points):
    return QgsRectangle(min(p[0] for p in points), min(p[1] for p in points), max(p[0] for p in points), max(p[1] for p in points))


def corners(box):
    return [box.xMinimum(), box.yMinimum(), box.xMaximum(), box.yMaximum()]


def draw(name, layer, shown):
    """The layer over white, a picture that shows the box; its pixels as rows of colours."""
    settings = QgsMapSettings()
    settings.setLayers([layer])
    settings.setDestinationCrs(layer.crs())
    settings.setExtent(shown)
    settings.setOutputSize(QSize(800, round(800 * shown.height() / shown.width())))
    settings.setBackgroundColor(WHITE)
    job = QgsMapRendererSequentialJob(settings)
    job.start()
    job.waitForFinished()
    image = job.renderedImage()
    image.save(os.path.join(PICTURES, name + ".png"))
    return [[image.pixel(x, y) & 0xFFFFFF for x in range(image.width())] for y in range(image.height())]


def check_picture(name, layer, box):
    """Drawn with a margin of an eighth: full of colours in the box, and nothing beyond."""
    margin = box.width() / 8
    pixels = draw(name, layer, QgsRectangle(box.xMinimum() - margin, box.yMinimum() - margin, box.xMaximum() + margin, box.yMaximum() + margin))
    height, width, edge = len(pixels), len(pixels[0]), 80
    inside = [p for row in pixels[edge + 2:height - edge - 2] for p in row[edge + 2:width - edge - 2]]
    beyond = [p for y, row in enumerate(pixels) for x, p in enumerate(row)
              if x < edge - 2 or x >= width - edge + 2 or y < edge - 2 or y >= height - edge + 2]
    painted = sum(p != 0xFFFFFF for p in inside)
    check("%s: every pixel of the mesh's box is painted" % name, painted == len(inside), "%d of %d" % (painted, len(inside)))
    check("%s: in many colours" % name, len(set(inside)) > 100, len(set(inside)))
    equal("%s: and none beyond" % name, set(beyond), {0xFFFFFF})
    return pixels


def colour_of(height, low, high):
    """Of the legend, as three channels."""
    at = (height - low) / (high - low)
    for (a, first), (b, second) in zip(COLOURS, COLOURS[1:]):
        if at <= b:
            one, two = QColor(first), QColor(second)
            return [p + (q - p) * (at - a) / (b - a) for p, q in zip(one.getRgb()[:3], two.getRgb()[:3])]
    return list(QColor(COLOURS[-1][1]).getRgb()[:3])


def check_colours(name, pixels, box, height_at, low, high):
    """Heights have the legend's colours, but where an edge of the mesh lies over them."""
    dice, right, asked = s.Dice(11), 0, 400
    for _ in range(asked):
        x, y = 82 + dice.below(len(pixels[0]) - 164), 82 + dice.below(len(pixels) - 164)
        scale = box.width() / (len(pixels[0]) - 160)
        place = box.xMinimum() + (x + 0.5 - 80) * scale, box.yMaximum() - (y + 0.5 - 80) * scale
        wanted, seen = colour_of(height_at(*place), low, high), [pixels[y][x] >> shift & 255 for shift in (16, 8, 0)]
        right += all(abs(a - b) <= 8 for a, b in zip(wanted, seen))
    check("%s: heights have their colours" % name, right > asked * 2 // 3, "%d of %d" % (right, asked))


def style_triangles(layer, low, high):
    """Each triangle in the colour of its mean height, with a thin outline."""
    z = "(z(point_n($geometry, 1)) + z(point_n($geometry, 2)) + z(point_n($geometry, 3))) / 3"
    ramp = "create_ramp(map(%s))" % ", ".join("%g, '%s'" % c for c in COLOURS)
    symbol = QgsFillSymbol.createSimple({"outline_width": "0.05", "outline_color": "60,50,40,160", "joinstyle": "round"})
    symbol.symbolLayer(0).setDataDefinedProperty(QgsSymbolLayer.PropertyFillColor, QgsProperty.fromExpression(
        "ramp_color(%s, scale_linear(%s, %r, %r, 0, 1))" % (ramp, z, low, high)))
    layer.setRenderer(QgsSingleSymbolRenderer(symbol))


def style_mesh(layer, low, high):
    """Heights in colours, and the mesh's own edges over them."""
    settings = layer.rendererSettings()
    scalar = settings.scalarSettings(0)
    scalar.setClassificationMinimumMaximum(low, high)
    shader = QgsColorRampShader(low, high)
    shader.setColorRampItemList([QgsColorRampShader.ColorRampItem(low + (high - low) * at, QColor(colour)) for at, colour in COLOURS])
    scalar.setColorRampShader(shader)
    settings.setScalarSettings(0, scalar)
    edges = settings.nativeMeshSettings()
    edges.setEnabled(True)
    edges.setColor(QColor(60, 50, 40, 120))
    edges.setLineWidth(0.05)
    settings.setNativeMeshSettings(edges)
    settings.setActiveScalarDatasetGroup(0)
    layer.setRendererSettings(settings)


def triangles_of(layer):
    found = []
    for feature in layer.getFeatures():
        ring = [(p.x(), p.y(), p.z()) for p in feature.geometry().vertices()]
        found.append(tuple(ring[:3]) if len(ring) == 4 and ring[0] == ring[3] else ring)
    return found


def check_triangles(name, layer, wanted, crs, low, high):
    if not check("%s: a layer to QGIS" % name, layer.isValid(), layer.error().message()):
        return
    equal("%s: its CRS" % name, layer.crs().authid(), crs)
    equal("%s: POLYGON Z" % name, QgsWkbTypes.displayString(layer.wkbType()), "PolygonZ")
    equal("%s: every triangle, bit for bit" % name, triangles_of(layer), wanted)
    box = box_of([p for t in wanted for p in t])
    equal("%s: its extent" % name, ["%.14g" % c for c in corners(layer.extent())], ["%.14g" % c for c in corners(box)])
    style_triangles(layer, low, high)
    check_picture(name, layer, box)


def check_mesh(name, path, db, eps, wanted, crs, low, high):
    layer = QgsMeshLayer(path, name, "mdal")
    if not check("%s: a mesh layer to QGIS" % name, layer.isValid(), layer.error().message()):
        return
    equal("%s: its CRS" % name, layer.crs().authid(), crs)
    mesh = QgsMesh()
    layer.dataProvider().populateMesh(mesh)
    points = [(p.x(), p.y(), p.z()) for p in (mesh.vertex(i) for i in range(mesh.vertexCount()))]
    equal("%s: every triangle, bit for bit" % name, [tuple(points[i] for i in mesh.face(f)) for f in range(mesh.faceCount())], wanted)
    box = box_of(points)
    equal("%s: its extent" % name, corners(layer.extent()), corners(box))
    draw(name, layer, box)  # makes the mesh that values are read from
    dice, worst, asked = s.Dice(5), 0.0, 0
    for _ in range(200):
        x = box.xMinimum() + box.width() * dice.below(100000) / 100000
        y = box.yMinimum() + box.height() * dice.below(100000) / 100000
        value, height = layer.datasetValue(QgsMeshDatasetIndex(0, 0), QgsPointXY(x, y)).scalar(), one(db, "SELECT rqt_height(?, ?, ?)", x, y, eps)
        if height is not None and value == value:
            worst, asked = max(worst, abs(value - height)), asked + 1
    check("%s: heights between its vertices are rqt_height's" % name, asked == 200 and worst < 1e-3, (asked, worst))
    style_mesh(layer, low, high)
    check_colours(name, check_picture(name, layer, box), box, lambda x, y: one(db, "SELECT rqt_height(?, ?, ?)", x, y, eps), low, high)


application = QgsApplication([], False)
application.initQgis()

# The demo's mountain, in degrees, and an alpine valley on the Swiss grid; whole rectangles, so that every pixel counts.
MOUNTAIN = (-71.40, 44.20, -71.20, 44.34)
for title, source, crs, eps, box in (("mountain", s.DEMO, "EPSG:4326", 20, MOUNTAIN),
                                     ("alpine", os.path.join(s.DATA, "glarus_alpine_25m_161.tif"), "EPSG:2056", 10, None)):
    database = s.temp(title + ".gpkg")
    s.import_terrain(database, source, name=title)
    db = s.connect(database)
    region = box and one(db, "SELECT rqt_bbox(?, ?, ?, ?)", *box)
    if box:  # to a box of whole cells of 16, which is covered without fringes
        x0, y0, dx, dy = rows(db, "SELECT x0, y0, dx, dy FROM rqt_terrains")[0]
        col0, col1 = (round((x - x0) / dx / 16) * 16 for x in (box[0], box[2]))
        row0, row1 = (round((y - y0) / dy / 16) * 16 for y in (box[3], box[1]))
        box = (x0 + col0 * dx, y0 + row1 * dy, x0 + col1 * dx, y0 + row0 * dy)
    region = "%r,%r,%r,%r" % box if box else None
    bbox = one(db, "SELECT rqt_bbox(?, ?, ?, ?)", *box) if box else None
    wanted = s.triangles(db, bbox, eps)
    heights = [p[2] for t in wanted for p in t]
    low, high = min(heights), max(heights)
    for ending in ("gpkg", "ply"):
        said, status = s.run([s.RQT, "mesh", database, "--eps", str(eps), "-o", s.temp("%s-mesh.%s" % (title, ending))] + (["--region", region] if region else []))
        check("%s: rqt mesh writes %s" % (title, ending), status == 0, said)
    check_triangles(title + "-layer", QgsVectorLayer("%s|layername=%s" % (s.temp(title + "-mesh.gpkg"), title), title, "ogr"), wanted, crs, low, high)
    check_mesh(title + "-mesh", s.temp(title + "-mesh.ply"), db, eps, wanted, crs, low, high)
    said, status = s.run([s.RQT, "mesh", database, "--eps", str(eps), "--normals", "-o", s.temp(title + "-normals.ply")] + (["--region", region] if region else []))
    check("%s: rqt mesh writes ply with normals" % title, status == 0, said)
    check_mesh(title + "-normals", s.temp(title + "-normals.ply"), db, eps, wanted, crs, low, high)
    query = "SELECT id, +gpkg AS geom FROM rqt_triangles(%s, %d)" % ("rqt_bbox(%r, %r, %r, %r)" % box if box else "NULL", eps)
    check_triangles(title + "-query", QgsVectorLayer("%s|layername=rqt_terrain|subset=%s" % (database, query), title, "ogr"), wanted, crs, low, high)
    db.close()
application.exitQgis()
s.finish()
