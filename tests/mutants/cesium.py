"""Mutants of the page /cesium and of what Cesium needs of the tiles: see ../mutants.py."""

CESIUM, TILES, FOLDER, SERVE = "web/cesium.test.mjs", "test_tiles.py", "test_tiles_folder.py", "test_serve.py"
LAYER, ENCODE, KIND, SPECK, MESH = ("src/tiles/quantized_mesh/%s.c" % name for name in ("layer", "encode", "quantized_mesh", "speck", "mesh"))
PYRAMID = "src/tiles/pyramid.c"
GLOBE, TILESET = ("src/web/cesium/%s.js" % name for name in ("globe", "tileset"))

MUTANTS = [
    # tiles as Cesium takes them
    ("cesium: clients are not told who tells of tiles", LAYER, 'if (first == 0) cJSON_AddNumberToObject(layer, "metadataAvailability", last + 1);', "", CESIUM, "africa: sampleTerrainMostDetailed"),
    ("cesium: one tile of level 0", LAYER, "(tile_range){0, 1, 0, 0}", "(tile_range){0, 0, 0, 0}", TILES, "both tiles of level 0"),
    ("cesium: an empty tile is none", KIND, "(mesh.cut.triangle_count > 0 || z == 0)", "(mesh.cut.triangle_count > 0)", TILES, "listed and there are the same"),
    ("cesium: a tile tells of the other half", LAYER, "add_ranges(ranges, count, x << z, ((x + 1) << z) - 1, list);", "add_ranges(ranges, count, 0, (2 << z) - 1, list);", TILES, "each tells of those below it"),
    ("cesium: tiles tell of levels that are not there", PYRAMID, "    tiles_tell(t, p->last);\n", "", FOLDER, "tell of no others than there are"),
    ("cesium: heights are a step too high", ENCODE, "put_float(w, (float)plan->lowest);", "put_float(w, (float)(plan->lowest + 3));", CESIUM, "africa: sampleTerrainMostDetailed"),
    # specks
    ("cesium: no specks", MESH, "        specks_add(mesh);\n", "", CESIUM, "Cesium with its checks"),
    ("cesium: specks that nobody needs", SPECK, "if (has_vertex[cell] || !is_bare(mesh, &s)) continue;", "if (has_vertex[cell] && !is_bare(mesh, &s) && cell) continue;", TILES, "a speck where, and only where"),
    ("cesium: specks are on the ground of the terrain", SPECK, "count > 0 ? mesh->h[0] : 0", "0", TILES, "at a height that the tile has"),
    # the page
    ("cesium: 3D Tiles are not drawn", TILESET, "scene.primitives.add(this.tileset);", "", CESIUM, "3D Tiles: they"),
    ("cesium: the sun's tables are asked for", GLOBE, "    Transforms.iau2006XysData = new Iau2006XysData({totalSamples: 0}); // no tables\n", "", CESIUM, "world: a picture"),
    ("cesium: no light of the normals, no terrain", GLOBE, "this.globe.material = paint(this.heights, this.spacing);", "this.globe.show = false;", CESIUM, "world: a picture"),
    ("cesium: without npm nothing is said", "src/web/cesium/bundle.sh", 'cp "$here/../without.js" "$out/$script.js"', ': >"$out/$script.js"', CESIUM, "without npm"),
    # files, gzipped once
    ("cesium: what is gzipped is gzipped", "src/serve/negotiate.c", "if (a->coding == CODING_GZIP && a->is_gzipped) return;", "", SERVE, "is gzipped already: gzip is"),
    ("cesium: zstd is liked where gzip is at hand", "src/serve/endpoints.c", "a->is_gzipped ? CODING_GZIP : CODING_ZSTD", "CODING_ZSTD", SERVE, "is gzipped already: gzip, zstd"),
    ("cesium: who takes no gzip gets it", "src/serve/page.c", "        unpack(file, &a->body);", "        buffer_add(&a->body, file->bytes, (size_t)(file->end - file->bytes));", SERVE, "openapi.json is the document"),
]
