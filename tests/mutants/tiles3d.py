"""Mutants of 3D Tiles: see ../mutants.py."""

TILES = "test_tiles3d.py"
PLAN, TILE, MESH, NORMALS, GLB, SUBTREE, TILESET = ("src/tiles/blocks/%s.c" % name for name in ("plan", "tile", "mesh", "normals", "glb", "subtree", "tileset"))
RELIEF = "src/store/relief.c"

MUTANTS = [
    # errors
    ("3d-tiles: the mesh is too coarse", MESH, "level[tile.level].error, &options, patch", "level[tile.level].error * 1.1, &options, patch", TILES, "no sample is further"),
    ("3d-tiles: curvature takes nothing", MESH, ": l == plan->finest ? error : sag;", ": l == plan->finest ? error : 0;", TILES, "africa: no sample is further"),
    ("3d-tiles: rank by rank curvature takes any share", MESH, "sag + terrain->quantum_error <= error;", "sag * 0 + terrain->quantum_error <= error;", TILES, "no sample is further"),
    ("3d-tiles: a tile forgets the curvature of its halves", TILE, "rqt_code_metres(relief->error) + level->centre;", "rqt_code_metres(relief->error);", TILES, "no sample is further"),
    ("3d-tiles: a tile forgets its own errors", TILE, "rqt_code_metres(relief->error) + level->centre;", "level->centre;", TILES, "no sample is further"),
    ("3d-tiles: the last level leaves out what half a metre allows", MESH, ": l == plan->finest ? error : sag;", ": sag;", TILES, "goes through every sample"),
    ("3d-tiles: every level states the first one's error", TILE, "block_plan_of(t)->level[tile.level];\n    const double own", "block_plan_of(t)->level[0];\n    const double own", TILES, "is not idle"),
    ("3d-tiles: a level is off by what the one above is", PLAN, "fmax(em[l + FINER], fmin(em[l], ground));", "fmax(em[l + FINER], fmin(em[l], ground)) * (l == 1 ? 8 : 1);", TILES, "no tile has a larger error"),
    ("3d-tiles: the root's error is its own", TILESET, "most = fmax(most, ldexp(", "most = fmax(most, ldexp(l > 0 ? 0 : 1, 0) * (", TILES, "halved level by level"),
    # seams
    ("3d-tiles: corners are not forced", MESH, "corner < 4 && status", "corner < 0 && status", TILES, "covers its cell"),
    ("3d-tiles: places are rounded from each tile's origin on", MESH, "(int32_t)(rint(xyz[3 * i + k] * steps) - from[k]);", "(int32_t)rint(xyz[3 * i + k] * steps - from[k] - 0.3 * (double)(count % 3));", TILES, "within half a step"),
    ("3d-tiles: origins are between steps", MESH, "origin[k] = rint((low[k] + high[k]) / 2 / unit) * unit + 0.0;", "origin[k] = (low[k] + high[k]) / 2;", TILES, "within half a step"),
    ("3d-tiles: steps are too fine for floats", PLAN, "while (", "while (level->step < ldexp(1, -12) && ", TILES, "as the formats have them"),
    ("3d-tiles: normals are those of glTF's other axis", GLB, "*p++ = (uint8_t)n[2];", "*p++ = (uint8_t)n[1];", TILES, "normals"),
    ("3d-tiles: stars end at the sides of tiles", NORMALS, "part = 0; part < BLOCK_PARTS", "part = 1; part < BLOCK_PARTS", TILES, "stars'"),
    ("3d-tiles: cells next to a tile's are not those of its level", MESH, "if (block_exists(t, near)) code", "if (n == 4) code", TILES, "stars'"),
    ("3d-tiles: at a pole normals are nowhere", NORMALS, "n[2] *= (EARTH_A / EARTH_B) * (EARTH_A / EARTH_B);", "n[2] = 0;", TILES, "stars'"),
    ("3d-tiles: around the Earth a seam is left open", MESH, "if (code == SQLITE_OK && plan->seam.q) code", "if (code == SQLITE_OK && plan->seam.q && !error) code", TILES, "both ends are one"),
    ("3d-tiles: stars end where the terrain closes", NORMALS, "part = 0; part < BLOCK_PARTS", "part = 0; part < 1", TILES, "both ends are one"),
    # places
    ("3d-tiles: rows count from the north", TILE, "(INT64_C(1) << level) - 1 - y", "y", TILES, "as the formats have them"),
    ("3d-tiles: regions do not sink with their chords", TILE, "region[4] = relief->lowest + low - moved - block_skirt_depth(t, tile);", "region[4] = relief->lowest + low - block_skirt_depth(t, tile);", TILES, "and so do their skirts"),
    ("3d-tiles: regions do not bulge to the pole", TILE, "box[3] + bulge, region", "box[3], region", TILES, "lie in their regions"),
    ("3d-tiles: a tile knows no more than the terrain", SUBTREE, "int code = block_relief(t, tile, relief, error);", "int code = SQLITE_OK;", TILES, "a tile tells the error"),
    ("3d-tiles: heights are the geoid's", MESH, "geo_frame_height(block_plan_of(t)->frame, place)", "place[2]", TILES, "geoid: every vertex is a sample"),
    ("3d-tiles: regions are the geoid's", TILE, "region[5] = relief->highest + high + moved;", "region[5] = relief->highest + moved;", TILES, "geoid: tiles lie in their regions"),
    ("3d-tiles: longitudes go on beyond 180", TILE, "if (east > 180) east", "if (east > 1000) east", TILES, "regions are on the globe"),
    # availability
    ("3d-tiles: every tile has content", TILE, "return relief->is_mixed ? block_has_triangle(t, tile, has, error) : SQLITE_OK;", "const int code = relief->is_mixed ? block_has_triangle(t, tile, has, error) : SQLITE_OK;\n    *has = true;\n    return code;", TILES, "holes"),
    ("3d-tiles: no mixed tile has content", TILE, "return relief->is_mixed ? block_has_triangle(t, tile, has, error) : SQLITE_OK;", "const int code = relief->is_mixed ? block_has_triangle(t, tile, has, error) : SQLITE_OK;\n    *has = *has && !relief->is_mixed;\n    return code;", TILES, "holes"),
    ("3d-tiles: blocks without voids have nothing", "src/store/query.c", ".all = !header.has_voids", ".all = header.has_voids", TILES, "holes: subtrees and tiles"),
    ("3d-tiles: a cell without an outline is all valid", RELIEF, "relief->is_valid = summary->corner[0].flags & RQT_VALID;", "relief->is_valid = true;", TILES, "holes"),
    ("3d-tiles: bits are counted from the other end", SUBTREE, "(uint8_t)(1 << i % 8)", "(uint8_t)(128 >> i % 8)", TILES, "as the formats have them"),
    ("3d-tiles: x and y change places", SUBTREE, "x |= (m >> 2 * bit & 1) << bit;", "x |= (m >> (2 * bit + 1) & 1) << bit;", TILES, "as the formats have them"),
    ("3d-tiles: subtrees end after the first", SUBTREE, "if (block_exists(t, tile_below(root, LEVELS, m))) set_bit(&s->below, m);", "", TILES, "what is listed"),
    ("3d-tiles: the largest error below is the smallest", RELIEF, "above > end[level]) end[level] = above;", "(end[level] == 0 || above < end[level])) end[level] = above;", TILES, "what their vertices say"),
    ("3d-tiles: levels are one off", RELIEF, "largest[l] = (rqt_code)end[l + 1];", "largest[l] = (rqt_code)end[l];", TILES, "what their vertices say"),
]
