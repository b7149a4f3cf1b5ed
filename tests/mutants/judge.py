"""Mutants of what the judge of tiles found, and of what it alone looks at: see ../mutants.py."""

JUDGE, KINDS = "test_verify_tiles.py", "test_verify_tiles_kinds.py"
SEAM, PLAN, GLOBE, MESH = "src/tiles/seam.c", *("src/tiles/quantized_mesh/%s.c" % name for name in ("plan", "globe", "mesh"))
TILES, ENDPOINTS = "src/tiles/tiles.c", "src/serve/endpoints.c"

MUTANTS = [
    ("judge: the antimeridian has vertices of one side", SEAM, "if (on[y] == on[h + y] || forced[lacks * h + y]) continue;", "if (y >= 0) continue;", JUDGE, "F28_a_ring_of_rough"),
    ("judge: ... heights of its own on either side", SEAM, "v->q = seam->q[v->row];", "", JUDGE, "F28_a_terrain_around_the_earth"),
    ("judge: ... and what they differ by is not stated", SEAM, "most = seam->merging;", "most = 0;", JUDGE, "F28_a_ring_of_rough"),
    ("judge: normals of the antimeridian are one side's", GLOBE, "const bool is_seam = plan_of(t)->seam.q &&", "const bool is_seam = false &&", JUDGE, "F28_a_terrain_around_the_earth"),
    ("judge: terrains of voids have no first tile", PLAN, "if (is_there || plan->ground.eps <= cell / 2) break;", "if (plan) break;", JUDGE, "F18_one_valid_half_cell"),
    ("judge: terrains may go around twice", TILES, "e.east - e.west > 360 * most", "e.east - e.west > 3600 * most", JUDGE, "it goes around the Earth more than once"),
    ("judge: there is land beyond the pole", TILES, "e.north > 90 * most", "e.north > 900 * most", JUDGE, "it has latitudes beyond a pole"),
    ("judge: the horizon point is exact, and then rounded", GLOBE, "most * (1 + 1e-7)", "most * (1 - 1e-6)", JUDGE, "the judge finds nothing"),
    ("judge: the mesh is a little too coarse", MESH, "region, plan_of(t)->level[place->z].eps", "region, 1.1 * plan_of(t)->level[place->z].eps", JUDGE, "the judge finds nothing"),
    ("judge: clients may not say which extensions they want", ENDPOINTS, '" extensions v ", answer_tile', '" ", answer_tile', JUDGE, "the service has what is listed"),
    ("judge: a tile of 3D Tiles states less than it is off", "src/tiles/blocks/tile.c", "return fmin(level->error, own)", "return 0.9 * fmin(level->error, own)", KINDS, "3d-tiles: the judge finds nothing"),
    ("judge: the root's region has a row more", "src/tiles/blocks/tileset.c", "block_rectangle(at->x0, at->y0 + side * at->dy,", "block_rectangle(at->x0, at->y0 + (side + 1) * at->dy,", KINDS, "3d-tiles: the judge finds nothing"),
    ("judge: pixels are rounded to a side", "src/tiles/terrarium/pixels.c", "(metres - LOWEST) * g->per_step + 0.5, most", "(metres - LOWEST) * g->per_step + 0.25, most", KINDS, "terrarium: the judge finds nothing"),
]
