"""Mutants of fields: the tree of squares, the thresholds that it gives, and those painted for a block: see ../mutants.py."""

DEFINITION = "fields_equal_their_definition_on_small_rasters"
LIMITS = "painted_limits_are_the_thresholds_that_are_asked_for"
TREE = "squares_come_in_order_and_boxes_find_the_least"

MUTANTS = [
    ("fields: squares count by their sides", "src/core/field.c", "return s.x < box->x1 && s.x + s.side > box->x0",
     "return s.x <= box->x1 && s.x + s.side > box->x0", "test_core_field", TREE),
    ("fields: a square on the last column is asked for", "src/core/field.c", "s.x < lattice->width - 1)", "s.x < lattice->width)",
     "test_core_field", DEFINITION),
    ("fields: the least of a square is that of its first quarters", "src/core/field.c", "n->kind == SPLIT && c < 4; c++", "n->kind == SPLIT && c < 3; c++",
     "test_core_field", TREE),
    ("fields: an eps is rounded to the nearest float", "src/core/field.c", "if ((double)f > eps) {", "if ((double)f > 2 * eps) {",
     "test_core_field", "a_scaled_eps_is_rounded_down"),
    ("fields: a scaled eps is rounded to the nearest", "src/core/field.c", "return (one - sum) + other < 0 ? nextafter(sum, 0) : sum;",
     "return sum;", "test_core_field", "a_scaled_eps_is_rounded_down"),
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
    ("fields: a painted centre reaches as a side does", "src/core/rule_limits.c", "d = windows[i + 2 * n + 2];", "d = windows[i];",
     "test_core_field", LIMITS),
    ("fields: painted centres are lowered as sides are", "src/core/rule_limits.c", "if (rule_lowers(rule)) {", "if (!rule) {",
     "test_core_field", LIMITS),
    ("fields: what is painted is cut at the grid's west side", "src/core/field.c", "left = s.x > box->x0 ? (s.x - box->x0) >> scale : 0",
     "left = s.x > box->x0 ? (s.x - box->x0) >> scale : 1", "test_core_field", LIMITS),
    ("fields: places beside one do not count in a block", "src/core/walk.c", "if (w->limits && !c.range.places && !c.range.forced) {",
     "if (w->limits && !c.range.forced) {", "test_core_field", DEFINITION),
    ("fields: forced vertices beside one do not count in a block", "src/core/walk.c", "if (w->limits && !c.range.places && !c.range.forced) {",
     "if (w->limits && !c.range.places) {", "test_core_field", DEFINITION),
    ("fields: the limits of a query are never released", "src/core/patch.c", "    memory_drop(&s->allocator, s->limits);\n", "",
     "test_core_field", "without_memory_nothing_is_lost"),
    ("fields: a fuzzer sees a square that is not the least", "src/core/field.c", "if (n->least >= least || !square_meets(s, box)) return least;",
     "if (!square_meets(s, box)) return least;", "fuzz/fuzz_rule", "the least is"),
]
