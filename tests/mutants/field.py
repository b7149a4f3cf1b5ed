"""Mutants of fields: the tree of squares, the thresholds that it gives, and what they choose in a block: see ../mutants.py."""

DEFINITION = "fields_equal_their_definition_on_small_rasters"
CHOSEN = "what_is_chosen_in_a_block_is_what_rules_select"
TREE = "squares_come_in_order_and_boxes_find_the_least"

MUTANTS = [
    ("fields: squares count by their sides", "src/core/field.c", "return s.x < box->x1 && s.x + s.side > box->x0",
     "return s.x <= box->x1 && s.x + s.side > box->x0", "test_core_field", TREE),
    ("fields: a square on the last column is asked for", "src/core/field.c", "s.x < lattice->width - 1)", "s.x < lattice->width)",
     "test_core_field", DEFINITION),
    ("fields: the least of a square is that of its first quarters", "src/core/field.c", "if (made->least < whole.least) whole.least", "if (c < 3 && made->least < whole.least) whole.least",
     "test_core_field", TREE),
    ("fields: an eps is rounded up", "src/core/field.c", "rqt_code_floor(eps);", "(rqt_code)(rqt_code_floor(eps) + 1);",
     "test_core_field", "an_eps_is_rounded_down"),
    ("fields: no number is an eps", "src/core/field.c", "if (!(eps >= 0)) return RQT_INVALID;", "if (eps < 0) return RQT_INVALID;",
     "test_core_field", "bad_answers_and_fields_are_refused"),
    ("fields: of another raster", "src/core/rule.c", "if (field && !field_is_over(field, &rule->lattice)) return RQT_INVALID;", "",
     "test_core_field", "bad_answers_and_fields_are_refused"),
    ("fields: blocks answer without them", "src/core/rule.c", "    if (error > threshold_without_places(rule, v, rank)) return true;\n", "",
     "test_core_field", DEFINITION),
    ("fields: the reach of a centre is that of a side", "src/core/rule.c", "const int32_t half = (rank & 1 ? 3 : 2) << rank / 2;",
     "const int32_t half = 2 << rank / 2;", "test_core_field", DEFINITION),
    ("fields: a block has one threshold", "src/core/rule.c", "range.most = rule_field_threshold(rule, square, 0);", "range.most = range.least; (void)square;",
     "test_core_field", DEFINITION),
    ("fields: a quarter's centre in a block reaches as a side does", "src/core/rule_choose.c", "LEAST3(of, 1, quarter[0])",
     "LEAST3(of, 1, across)", "test_core_field", CHOSEN),
    ("fields: a side in a block reaches to its own cell only", "src/core/rule_choose.c", "LEAST4(of, 1, north)",
     "LEAST4(of, 1, across)", "test_core_field", CHOSEN),
    ("fields: centres in a block are lowered as sides are", "src/core/rule_choose.c", "choose_place(c, at->centre[i], codes->quarter[i], rank - 2)",
     "choose_place(c, at->centre[i], codes->quarter[i], rank - 1)", "test_core_field", CHOSEN),
    ("fields: a cell in a block ends one code too early", "src/core/rule_choose.c",
     "threshold_of(c, least, rank - 1)", "threshold_of(c, least, rank - 1) + 1", "test_core_field", CHOSEN),
    ("fields: beyond the root is the root", "src/core/field.c", "if (x < 0 || y < 0 || x >= end || y >= end) return NOWHERE;",
     "if (x < 0 || y < 0 || x >= end || y >= end) return 0;", "test_core_field", CHOSEN),
    ("fields: the quarters of a square change places", "src/core/field.c", "least[2 * u + (c & 1)][2 * v + (c >> 1)] =",
     "least[2 * u + (c >> 1)][2 * v + (c & 1)] =", "test_core_field", CHOSEN),
    ("fields: places beside one do not count in a block", "src/core/walk.c", "is_plain = !c.range.places && !c.range.forced;",
     "is_plain = !c.range.forced;", "test_core_field", DEFINITION),
    ("fields: forced vertices beside one do not count in a block", "src/core/walk.c", "is_plain = !c.range.places && !c.range.forced;",
     "is_plain = !c.range.places;", "test_core_field", DEFINITION),
    ("fields: a fuzzer sees a square that is not the least", "src/core/field.c", "if (n->least >= least || !square_meets(s, box)) return least;",
     "if (!square_meets(s, box)) return least;", "fuzz/fuzz_rule", "the least is"),
]
