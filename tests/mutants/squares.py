"""Mutants of regions of squares (src/core/region_squares.c), and of choosing among squares that are not cut: see ../mutants.py."""

BOXES = "boxes_lie_to_squares_as_cells_are_counted"
TRIANGLES = "triangles_belong_to_squares_as_to_the_polygon_of_their_cells"
TOUCH = "what_touches_squares_and_is_in_them_is_what_cells_say"
CHOSEN = "what_is_chosen_in_a_block_is_what_rules_select"
REFUSED = "squares_that_are_none_or_out_of_order_are_refused"
FILE = "src/core/region_squares.c"
REGION = "src/core/region.c"

MUTANTS = [
    ("squares: the last quarter of a cell is the cell", FILE, "if (first_of(*at) == c->first && end_of(*at) >= end)",
     "if (end_of(*at) >= end)", "test_core_squares", BOXES),
    ("squares: a larger one before a cell is not looked at", FILE, "if (at > r->begin && end_of(at[-1]) > c->first) return RQT_INSIDE;", "",
     "test_core_squares", BOXES),
    ("squares: what comes after a cell is in it", FILE, "if (at == r->end || first_of(*at) >= end)", "if (at == r->end || first_of(*at) > end)",
     "test_core_squares", BOXES),
    ("squares: three brothers are their parent", FILE, "keys[n - 3] == ", "keys[n - 3] != ", "test_core_squares", BOXES),
    ("squares: brothers stay apart", FILE, "while (n >= 3 && ", "while (n >= 3 && n < 3 && ", "test_core_squares", BOXES),
    ("squares: one that holds others does not take their place", FILE, "end_of(keys[n - 1]) <= first + area_of(log)) n--;",
     "end_of(keys[n - 1]) < first) n--;", "test_core_squares", REFUSED),
    ("squares: in any order", FILE, "if (n > 0 && end_of(keys[n - 1]) > first) return RQT_INVALID;", "", "test_core_squares", REFUSED),
    ("squares: at any place", FILE, "if (((square.x | square.y) & (side - 1)) != 0) return RQT_INVALID;", "", "test_core_squares", REFUSED),
    ("squares: a box past the root is inside", FILE, "relation == RQT_INSIDE && !is_within", "relation == RQT_INSIDE && is_within",
     "test_core_squares", BOXES),
    ("squares: a box is asked as the cell around it", FILE, "if (whole != RQT_ACROSS || ", "if (whole == RQT_ACROSS || ", "test_core_squares", BOXES),
    ("squares: a triangle belongs by its box", FILE, "    if (!region_triangle_overlaps(t, &box)) return false;\n", "", "test_core_squares", TRIANGLES),
    ("squares: a triangle is looked for in a cell too small", FILE, ">> (c.log - 1) == 0) c.log--;", ">> c.log == 0) c.log--;",
     "test_core_squares", TRIANGLES),
    ("squares: three quarters are asked about a triangle", FILE, "        if (cell_meets(&part, r, t)) return true;", "        if (i < 3 && cell_meets(&part, r, t)) return true;",
     "test_core_squares", TRIANGLES),
    ("squares: one without an area on the raster counts", REGION, "if (s.x < lattice->width - 1 && s.y < lattice->height - 1)", "if (s.x < lattice->width)",
     "test_core_squares", "boxes_of_squares_are_those_of_their_polygon"),
    ("squares: touching is overlapping", REGION, "clamp_sample(-floor_sample(-box->x0) - 1, end)", "clamp_sample(-floor_sample(-box->x0), end)",
     "test_core_squares", TOUCH),
    ("squares: mode cut takes them", "src/core/cut.c", "    if (!region_has_border(region)) return RQT_INVALID;\n", "", "test_core_squares", "mode_cut_refuses_squares"),
    ("squares: a middle of a side among leaves has one quarter's codes", "src/core/rule_choose.c", "{lesser(two[0], two[1]), ", "{two[0], ",
     "test_core_field", CHOSEN),
    ("squares: around a quarter among leaves the same column is there twice", "src/core/rule_choose.c", "const int x = i & 1 ? 0 : 1,", "const int x = i & 1 ? 1 : 0,",
     "test_core_field", CHOSEN),
    ("squares: nine of which some are cut are leaves", "src/core/field.c", "cut |= n->kind == SPLIT;", "cut = n->kind == SPLIT;",
     "test_core_field", CHOSEN),
    ("squares: a rule that lowers takes codes as they are", "src/core/rule.c", "return !rule->lowers && !(rule->quantum_error > 0);", "return !(rule->quantum_error > 0);",
     "test_core_field", CHOSEN),
]
