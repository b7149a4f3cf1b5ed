"""Mutants of what deck.gl needs of the tiles: see ../mutants.py."""

DECKGL, KNOWS = "web/deckgl.test.mjs", "Tile3DLayer: it knows"
GLB, SUBTREE = ("src/tiles/blocks/%s.c" % name for name in ("glb", "subtree"))

MUTANTS = [
    ("deck.gl: the origin is left to floats", GLB, 'add_numbers(node, "matrix", matrix, 16);', 'add_numbers(node, "translation", matrix + 12, 3);', DECKGL, KNOWS),
    ("deck.gl: tiles beyond the end of a subtree", SUBTREE, "is_constant(&s->tiles) && is_constant(&s->below);", "is_constant(&s->tiles);", DECKGL, KNOWS),
]
