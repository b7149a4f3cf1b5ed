"""Mutants of the tiles: see ../mutants.py."""

COMMON, TILES, COVERED = "src/tiles/tiles.c", "test_tiles.py", "boxes_are_covered_as_the_mesh_covers_them"
PLAN, MESH, GLOBE, WATER, ENCODE, LAYER = ("src/tiles/quantized_mesh/%s.c" % name for name in ("plan", "mesh", "globe", "water", "encode", "layer"))
PYRAMID, EARTH = "src/tiles/pyramid.c", "src/tiles/earth.c"

MUTANTS = [
    # errors
    ("tiles: the mesh is too coarse", MESH, "region, plan_of(t)->level", "region, 1.5 * plan_of(t)->level", TILES,
     "no sample is further above or below"),
    ("tiles: curvature takes nothing", PLAN, "if (status == RQT_OK) status = rqt_rule_set_lowering(*rule, plan_of(t)->lowering);", "", TILES, "africa: no sample is further from a tile in space"),
    ("tiles: vertices do not move", MESH, "mesh->error = eps + moved * (1 + 1e-9) + 1e-7;", "mesh->error = eps + 0 * moved;", TILES, "no sample is further from a tile in space"),
    ("tiles: slopes do not count", MESH, "eps + mesh->move[2] + sloping * (1 + 1e-9) + 1e-7;", "eps + mesh->move[2] + 0 * sloping;", TILES, "no sample is further above or below"),
    ("tiles: quantisation takes no part of a level's error", PLAN, "level->eps = level->geometric_error - move;", "level->eps = level->geometric_error;", TILES,
     "no more than what clients take"),
    ("tiles: the last level is finer than need be", PLAN, "#define LAST_EPS 0.625", "#define LAST_EPS 0.5", TILES, "1.1 times the vertices"),
    ("tiles: what heights were rounded by ends no level", PLAN, "fmax(2 * move, plan->rounded + move)", "2 * move", TILES, "steps: what is stated is no more than what clients take"),
    # neighbours
    ("tiles: heights begin at each tile's own", ENCODE, "put_float(w, (float)plan->lowest);", "put_float(w, (float)globe->centre[0]);", TILES, "one range of heights"),
    ("tiles: steps of any size", PLAN, "plan->step = ldexp(1, FIRST_STEP);", "plan->step = 0.001;", TILES, "32767 steps of a power of two"),
    ("tiles: sides are rounded as the rest is", MESH, "if (fabs(at - high) < ON_SIDE) return TILE_UNITS;", "", TILES, "shared edges decode to identical"),
    ("tiles: what is near a side is on it", MESH, "n < 1 ? 1 : n > TILE_UNITS - 1 ? TILE_UNITS - 1 : n", "n < 20 ? 0 : n > TILE_UNITS - 20 ? TILE_UNITS : n", TILES, "holes: what is stated is no more than what clients take"),
    ("tiles: v grows south", MESH, "quantise(v->row, turn->south, turn->north, turn->cut[3], turn->cut[2])", "quantise(v->row, turn->north, turn->south, turn->cut[2], turn->cut[3])", TILES,
     "tiles of every level cover the raster"),
    ("tiles: the north side is not listed", MESH, "const uint16_t there = side == WEST || side == SOUTH ? 0 : TILE_UNITS;", "const uint16_t there = side == WEST || side == SOUTH ? 0 : TILE_UNITS - (side == NORTH);",
     TILES, "lists of sides"),
    ("tiles: vertices of a side in one place go by their numbers", MESH, "if (p->place != q->place) return p->place < q->place ? -1 : 1;", "", TILES, "steps: shared edges decode to identical"),
    # space
    ("tiles: the sphere is a hair too small", GLOBE, "globe->radius = sqrt(most) * (1 + 1e-9) + 1e-6;", "globe->radius = sqrt(most) * (1 - 1e-7);", TILES, "spheres hold every vertex"),
    ("tiles: heights do not rise over the horizon", GLOBE, "(along - across * sqrt(m2 - 1)) / sqrt(m2)", "along", TILES, "below the horizon"),
    ("tiles: the horizon's point is the centre", GLOBE, "if (exists && 1 / cosine > most) most = 1 / cosine;", "most = 1;", TILES, "below the horizon"),
    ("tiles: normals are not turned into space", GLOBE, "earth_turn(&globe->angles[i].lon, &globe->angles[i].lat, enu, n);", "memcpy(n, enu, sizeof n);", TILES, "normals are the terrain's"),
    ("tiles: directions are mirrored about the equator", EARTH, "lat->cosine * enu[2] - lat->sine * enu[1];", "lat->cosine * enu[2] + lat->sine * enu[1];", TILES, "normals are the terrain's"),
    ("tiles: normals of a side are one sample's", GLOBE, "if (weight <= 0) continue;", "if (weight <= 0 || a.count > 0) continue;", TILES, "the mean of those around"),
    ("tiles: heights are the geoid's", PLAN, "    if (is_above_geoid)\n        plan->geoid = frame;\n    else\n        geo_frame_free(frame);", "    geo_frame_free(frame);", TILES, "geoid: no sample"),
    # bytes
    ("tiles: the cut numbers corners as it meets them", "src/core/cut.c",
     "!take_point(c, l, face->corner[2], &q) ||\n            !take_point(c, l, face->corner[1], &r)", "!take_point(c, l, face->corner[1], &r) ||\n            !take_point(c, l, face->corner[2], &q)",
     TILES, "as the format has it"),
    ("tiles: an extension has another length", ENCODE, "put_number(w, size + 4, 4);", "put_number(w, size, 4);", TILES, "as the format has it"),
    ("tiles: the water mask begins in the south", WATER, "mask + j * WATER_SIDE", "mask + (WATER_SIDE - 1 - j) * WATER_SIDE", TILES, "the water mask is the sea"),
    ("tiles: water masks are whole", WATER, "== 0 ? 1 :", "== 0 ? WATER_SIDE * WATER_SIDE :", TILES, "one byte of it"),
    # which there are
    ("tiles: rows of layer.json begin one further north", LAYER, 'cJSON_AddNumberToObject(range, "startY", ranges[i].y0);', 'cJSON_AddNumberToObject(range, "startY", ranges[i].y0 + 1);', TILES, "the same tiles"),
    ("tiles: tiles of voids are listed", COMMON, "*is_there = code == SQLITE_TOOBIG || patch.triangle_count > 0;", "*is_there = true;", TILES, "the same tiles"),
    ("tiles: squares of tiles are there when one is", LAYER, "if (cover == STORE_COVER_UNKNOWN && (r->x0", "if (false && (r->x0", TILES, "no others"),
    ("tiles: squares are a row short", LAYER, "y1 - y < SQUARE ? y1 : y + SQUARE - 1", "y1 - y < SQUARE ? y1 : y + SQUARE - 2", TILES, "no others"),
    ("covers: blocks with voids cover all", "src/store/query.c", "!header.has_voids && !header.all_void && all", "!header.all_void && all", "test_store_cover", COVERED),
    ("covers: blocks with voids cover nothing", "src/store/query.c", "header.all_void) *cover", "(header.all_void || header.has_voids)) *cover", "test_store_cover", COVERED),
    ("covers: corners beyond a block have data", "src/store/query.c", "i < 2 && answer->number > 1", "i < 0 && answer->number > 1", "test_store_cover", COVERED),
    ("covers: one block speaks for all", "src/store/query.c", "if (one != *cover) *cover = STORE_COVER_UNKNOWN;", "", "test_store_cover", COVERED),
    ("covers: blocks answer as without a rule", "src/store/query.c", "if (code == SQLITE_OK && options->rule && rqt_rule_set_eps(options->rule, eps) == RQT_OK)", "if (!options)",
     "test_store_cover", COVERED),
    ("rules: all ranks of a block go down by one threshold", "src/core/rule_choose.c", "return c->by_rank[rank];", "return c->by_rank[0];", "test_core_rule", "eps_lowered_by_rank_alone_is_its_definition"),
    ("rules: rows of a block have the ranks of its first", "src/core/walk.c", "threshold[__builtin_ctz(v | (n - 1))]", "threshold[0]", "test_core_rule", "eps_lowered_by_rank_alone_is_its_definition"),
    ("normals: a row's metres are those of another", "src/store/normals.c", "if (k->row != row) {", "if (k->row < 0) {", "test_sql_normals.py", "normal"),
    ("tiles: longitudes count once", PLAN, "*last = (int)ceil((e.east + 180) / 360);", "*last = 0;", TILES, "358.5"),
    ("tiles: a tile that touches the raster is listed", PLAN, "return (from > 0 ? from : 0) < (to < last ? to : last);", "return (from > 0 ? from : 0) <= (to < last ? to : last) + (1 << UNIT_BITS);", TILES,
     "the same tiles"),
    # to disk
    ("tiles: all is made again", PYRAMID, "if (lstat(path, &there) == 0 && S_ISREG(there.st_mode) && there.st_size > 0) return SQLITE_OK;", "(void)there;", TILES, "without making again"),
    ("tiles: anybody's folder will do", PYRAMID, "if ((size_t)n == size && memcmp(there, description, size) == 0) return SQLITE_OK;", "return SQLITE_OK;", TILES, "are not mixed in"),
    ("tiles: what nobody says anything of is ours", PYRAMID, "if (n == 0) code = check_empty(job->folder, error);", "if (n < 0) code = check_empty(job->folder, error);", TILES, "says nothing of its files"),
    ("tiles: two commands write into one folder", PYRAMID, "if (flock(*file, LOCK_EX | LOCK_NB))", "if (flock(*file, LOCK_UN))", TILES, "by one command at a time"),
    ("tiles: gzip is not asked for", PYRAMID, "if (p->job->gzip && !series->is_packed) code = pack(&tile);", "", TILES, "all tiles are compressed"),
    ("tiles: numbers of paths may begin with 0", "src/serve/endpoints.c", "|| (digits > 1 && *segment == '0')", "", TILES, "no tile at 00/1/0"),
    ("tiles: what is behind a number does not matter", "src/serve/endpoints.c", "return strlen(segment + digits) == rest && memcmp(segment + digits, close + 1, rest) == 0;", "return rest + 1 > 0;", TILES,
     "no tile at 0/1/0x"),
]
