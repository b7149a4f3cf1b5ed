"""Mutants of the page as it is seen in a browser: see ../mutants.py."""

TERRAINS, FLIGHT, PICK = "web/viewer_terrains.test.mjs", "web/viewer_flight.test.mjs", "web/viewer_pick.test.mjs"
CONTROLS, FAULTS, PICTURE = "web/viewer_controls.test.mjs", "web/viewer_faults.test.mjs", "web/picture.test.mjs"

MUTANTS = [
    ("browser: it warns", "src/web/viewer.js", "        this.layer.show(stage, performance.now());\n", "        this.layer.show(stage, performance.now());\n        console.warn('a mesh');\n",
     TERRAINS, "metres on a phone"),
    ("browser: it asks a stranger", "src/web/viewer.js", "        this.layer.show(stage, performance.now());\n",
     "        this.layer.show(stage, performance.now());\n        fetch('http://127.0.0.2:9/').catch(() => {});\n", TERRAINS, "metres on a phone"),
    ("browser: a triangle is not counted", "src/web/viewer.js", "triangles: stage.mesh.triangleCount,", "triangles: stage.mesh.triangleCount - 1,", TERRAINS, "metres on a phone"),
    ("browser: tau is taken for eps", "src/web/service.js", "achievedTau: header('RQT-Achieved-Tau'),", "achievedTau: header('RQT-Achieved-Eps'),", TERRAINS, "metres on a phone"),
    ("browser: the last triangles are not drawn", "src/web/terrain_layer.js", "new BufferAttribute(index, 1)", "new BufferAttribute(index.slice(0, -3 * (index.length >> 4)), 1)", FLIGHT, "flying over metres"),
    ("browser: only the picture is asked for", "src/web/service.js", "cover: 'terrain'", "cover: 'picture'", TERRAINS, "metres on a phone"),
    ("browser: nothing morphs", "src/web/decoder.js", "const isMoving = withMorph &&", "const isMoving = false &&", FLIGHT, "a geomorph has pictures"),
    ("browser: a morph stays as it ended", "src/web/terrain_layer.js", "            this.use(this.stage.geometry);\n", "            this.uniforms.t.value = 0.97;\n", FLIGHT, "a geomorph has pictures"),
    ("browser: clicks are two pixels off", "src/web/controls.js", "2 * px / clientWidth - 1", "2 * (px + 2) / clientWidth - 1", PICK, "30 clicks on metres"),
    ("browser: heights are of a coarse mesh", "src/web/service.js", "'height', {x, y})", "'height', {x, y, eps: 20})", PICK, "30 clicks on metres"),
    ("browser: profiles are of a coarse mesh", "src/web/service.js", "by})`, eps: 0", "by})`, eps: 20", PICK, "two make a profile: desktop"),
    ("browser: no help", "src/web/keys.js", "'?': ", "'!': ", CONTROLS, "keys fly"),
    ("browser: the address forgets edges", "src/web/state.js", "wires: given.has('wires')", "wires: given.has('wire')", CONTROLS, "an address keeps a view"),
    ("browser: a button without a name", "src/web/index.html", ' title="Back to north (N)" aria-label="Back to north"', "", CONTROLS, "names: every control"),
    ("browser: pale words", "src/web/viewer.css", "--quiet: #626a73;", "--quiet: #9aa2ab;", CONTROLS, "in the dark, on a desktop"),
    ("browser: not by Tab", "src/web/index.html", '<input id="tau" type="range"', '<input id="tau" tabindex="-1" type="range"', CONTROLS, "every control is reached"),
    ("browser: the sheet hides the terrain", "src/web/viewer.css", "translateY(calc((var(--grip) - var(--sheet)) / 2))", "none", CONTROLS, "on a phone the open sheet"),
    ("browser: the card is asked for what it lost", "src/web/picture.js", "            this.forget();\n", "", FAULTS, "the graphics card takes"),
    ("browser: pins are seen through mountains", "src/web/viewer.js", "depth < 0.98 * depth", "depth < 0 * depth", PICK, "a height behind"),
    ("browser: a claim of nothing", "src/web/viewer.js", "        this.figures.showNothing();\n", "", FAULTS, "more than the service gives"),
    ("browser: damaged bytes are not told", "src/web/stream.js", "if (data.problem) reject(new Error(data.problem));", "if (data.problem) resolve(null);", FAULTS, "damaged answers"),
    ("gaps: a neighbour is enough", "tests/web/picture.mjs", "[-apart(step), apart(step)].every(", "[-apart(step), apart(step)].some(", PICTURE, "a silhouette along the lines"),
    ("gaps: the bottom is no terrain", "tests/web/picture.mjs", "first[other] < step && step < last[other]", "first[other] < step && step + 30 < last[other]", PICTURE, "a pixel inside is a gap"),
    ("gaps: lines are columns always", "tests/web/picture.mjs", "    if (vanishing) {", "    if (vanishing && !vanishing) {", PICTURE, "looking down or up"),
    ("pictures: PNG lines guess by their left", "tests/web/picture.mjs", "l <= u && l <= c ? left : u <= c ? up : corner", "left", PICTURE, "a PNG with every filter"),
]
