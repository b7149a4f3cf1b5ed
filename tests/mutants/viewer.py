"""Mutants of the page's own modules: cameras, picking, the stream of questions, the address; see ../mutants.py."""

PAGE, STREAM = "web/page.test.mjs", "web/stream.test.mjs"

MUTANTS = [
    ("viewer: feet are metres", "src/web/scene.js", "{lonlat: false, metre: terrain.metre}", "{lonlat: false}", PAGE, "a CRS in feet is metres in the scene"),
    ("viewer: yaw goes the other way", "src/web/camera.js", "add(scaled(east, Math.sin(yaw)), north, Math.cos(yaw))", "add(scaled(east, -Math.sin(yaw)), north, Math.cos(yaw))", PAGE, "looks to the north"),
    ("viewer: the picture is square", "src/web/camera.js", "x: dot(from, right) / (tangent * this.width / this.height)", "x: dot(from, right) / tangent", PAGE, "a direction of the picture"),
    ("viewer: places are rounded to metres", "src/web/camera.js", "const [x, y, height] = this.place, digits = this.scene.isSpace ? 9 : 4;", "const [x, y, height] = this.place, digits = 4;", PAGE, "a camera is what its JSON says"),
    ("viewer: a tilt lets go", "src/web/orbit.js", "camera.hold(anchor, this.at);", "camera.hold(anchor, [0, 0]);", PAGE, "the ground that is held"),
    ("viewer: zooming is for the middle", "src/web/orbit.js", "camera.hold(point, held);", "camera.hold(point, [0, 0]);", PAGE, "the ground that is held"),
    ("viewer: zooming out has no end", "src/web/orbit.js", "Math.min(factor, most)", "factor", PAGE, "nobody gets lost"),
    ("viewer: every ellipsoid is that of WGS 84", "src/web/scene.js", "semiMajor: terrain.semi_major, inverseFlattening: terrain.inverse_flattening", "semiMajor: 6378137", PAGE, "a CRS in feet is metres in the scene"),
    ("viewer: the Earth is flat", "src/web/orbit.js", "    if (!scene.isSpace) {\n        camera.eye = add(eye, by);", "    if (true) {\n        camera.eye = add(eye, by);", PAGE, "level flight keeps its height"),
    ("viewer: the terrain may stick out", "src/web/camera.js", " && found[3] - found[2] < 1.8 * most * share", "", PAGE, "the whole terrain is in the picture"),
    ("viewer: the terrain stands low", "src/web/camera.js", "higher += (bottom + top) / 2", "higher += 0 * (bottom + top)", PAGE, "the whole terrain is in the picture"),
    ("viewer: behind a sheet", "src/web/camera.js", "< 1.8 * most * share", "< 1.8 * most", PAGE, "the whole terrain is in the picture"),
    ("viewer: boxes have no top", "src/web/geometry.js", "if (value > boxes[at + 3 + axis]) boxes[at + 3 + axis] = value;", "if (value > boxes[at + 3 + axis] && axis < 2) boxes[at + 3 + axis] = value;", PAGE, "picking"),
    ("viewer: the last triangle on the ray", "src/web/pick.js", "if (t < nearest) nearest = t;", "if (t < Infinity) nearest = t;", PAGE, "picking"),
    ("viewer: the ground is below only", "src/web/pick.js", "const above = 1e7;", "const above = 0;", PAGE, "picking"),
    ("viewer: an edge for each triangle", "src/web/geometry.js", "if (slots[slot] === key) continue;", "", PAGE, "edges: every side"),
    ("viewer: every wish is asked", "src/web/stream.js", "if (!this.isBusy) this.run();", "this.run();", STREAM, "while one is asked"),
    ("viewer: the oldest wish first", "src/web/stream.js", "        this.wanted = wish;\n", "        this.wanted ??= wish;\n", STREAM, "while one is asked"),
    ("viewer: edges are asked for", "src/web/stream.js", "const isKnown = wish.path === this.path;", "const isKnown = false;", STREAM, "what is shown otherwise"),
    ("viewer: nobody asks again", "src/web/service.js", "'The service does not answer. Is rqt serve still running?', true", "'The service does not answer. Is rqt serve still running?', false", STREAM, "a service that is gone"),
    ("viewer: eps is kept below what was rounded", "src/web/figures.js", "Math.max(answered, rounding)", "answered", PAGE, "what is proved"),
    ("viewer: no triangle is proved", "src/web/figures.js", "if (!mesh.triangleCount)", "if (false)", PAGE, "what is proved"),
    ("viewer: a void does not end a run", "src/web/profile.js", "if (row[3] === null) runs.push([]);", "if (row[3] === null) continue;", PAGE, "a void ends a run"),
    ("viewer: no number is zero", "src/web/state.js", ".map(text => number(text, -1e15, 1e15))", ".map(Number)", PAGE, "the address says"),
    ("viewer: a name in the address as it is", "src/web/state.js", "encodeURIComponent(value)", "value", PAGE, "the address says"),
]
