"""Mutants of the skirts of 3D Tiles: see ../mutants.py."""

TILES = "test_tiles3d.py"
PLAN, TILE, SKIRT = ("src/tiles/blocks/%s.c" % name for name in ("plan", "tile", "skirt"))

MUTANTS = [
    ("skirts: walls are for neighbours of the same level", SKIRT, "while (line % 2 == 0) line /= 2, level--;", "", TILES, "so far down as their line's level has it"),
    ("skirts: walls are as deep as a level is off, by half", PLAN, "fmin(2 * (level->error", "fmin(0.25 * (level->error", TILES, "above the lower end of the other's wall"),
    ("skirts: walls hang straight", SKIRT, "if (fabs(*lean) < 2 * fabs(off)) *lean = -2 * off;", "", TILES, "apart, seen from above, their walls meet"),
    ("skirts: regions end where the surface does", TILE, " - block_skirt_depth(t, tile)", "", TILES, "and so do their skirts"),
    ("skirts: the antimeridian is an outline", SKIRT, "is_closed && s < 2 && level[s] == OUTLINE ? 1 : level[s]", "level[s]", TILES, "F28_earth: walls hang from the tile's edges"),
]
