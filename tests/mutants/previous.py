"""Mutants of views that follow a camera: bands, geomorphs, increments. See ../mutants.py."""

BAND = "src/core/view_band.c"
MORPH = "src/core/morph.c"
ORDER = "src/core/order.c"
INCREMENT = "src/core/increment.c"
F35 = "F35_a_geomorph_begins_on_one_mesh_ends_on_the_other_and_stays_within_both_tolerances"
F35_END = "F35_where_the_raster_ends_within_the_lattice_the_tolerances_hold"
FOLLOW = "an_increment_makes_one_mesh_of_another_whatever_they_are"
F42 = "F42_payloads_that_lie_are_refused"
MUTANTS = [
    ("previous: pieces do not grow sideways", BAND, "    p.radius += by;\n", "", "test_core_band",
     "F36_a_view_is_right_for_every_camera_of_its_band"),
    ("previous: pieces do not grow upward", BAND, "    p.half_height += by;\n", "", "test_core_band",
     "F36_a_view_is_right_for_every_camera_of_its_band"),
    ("previous: a turn moves nothing", BAND, "band->move + band->turn * furthest + rounding", "band->move + rounding", "test_core_band",
     "F36_a_view_is_right_for_every_camera_of_its_band"),
    ("previous: the eye comes no nearer", BAND, "grown(prism, band->move + rounding)", "grown(prism, rounding)", "test_core_band",
     "F36_a_view_is_right_for_every_camera_of_its_band"),
    ("previous: turned any way it holds", BAND, " && sqrt((f * f + r * r + u * u) / 2) <= band->turn", "", "test_core_band",
     "F36_an_ulp_of_jitter_stays_in_the_band_a_teleport_does_not"),
    ("previous: no band at a height of 0", BAND, "fmax(share * fmax(nearest, camera->near), jitter)", "share * nearest", "test_core_band",
     "F36_an_ulp_of_jitter_stays_in_the_band_a_teleport_does_not"),
    ("previous: another focal length is the same lens", BAND, " || camera->focal != anchor->focal", "", "test_core_band",
     "another_lens_is_another_camera"),
    ("geomorph: an edge's height at a third", MORPH, "height = (one + other) / 2;", "height = (2 * one + other) / 4 + other / 4 + one / 8;",
     "test_core_morph", F35),
    ("geomorph: what is in both meshes moves", MORPH, "n->flags |= FROM | HEIGHT;", "n->flags |= HEIGHT;", "test_core_morph", F35),
    ("geomorph: past the raster's end it moves, too", MORPH, "    if (is_near_end(m->lattice, v)) {\n", "    if (false) {\n", "test_core_morph", F35_END),
    ("geomorph: only what is next to the end jumps", MORPH, "(rank & 1 ? 3 : 2) << rank / 2", "(rank & 1 ? 1 : 1) << rank / 2", "test_core_morph", F35_END),
    ("geomorph: under a leaf there is nothing", MORPH, "yes = is_covered(m, apex, i);", "yes = false;", "test_core_morph", F35),
    ("lattice: the ends of diagonals are the apexes", "src/core/lattice.c", "x_odd && !main_diagonal ? -q : q", "x_odd && main_diagonal ? -q : q",
     "test_core_lattice", "a_vertex_halves_the_edge_between_its_ends"),
    ("increment: triangles of one vertex in any order", ORDER, "at > first && order_compare", "at > first + 1 && order_compare", "test_core_increment",
     FOLLOW),
    ("increment: another height is the same vertex", INCREMENT, "own == key && o->q == v->q", "own == key", "test_core_increment",
     "what_has_not_changed_takes_a_header"),
    ("increment: any mesh will do", INCREMENT, "if (header->from != rqt_increment_digest(old))", "if (false)", "test_core_increment",
     "an_increment_of_another_mesh_is_refused"),
    ("increment: the result is not looked at", INCREMENT, "rqt_increment_digest(mesh) != header->to", "false", "test_core_increment", F42),
    ("increment: rows past the last sample", INCREMENT, "at.x > LAST_SAMPLE ||\n                at.y > LAST_SAMPLE", "at.x > LAST_SAMPLE", "test_core_increment",
     F42),
    ("increment: corners past the last vertex", INCREMENT, "third < 0 || third > most", "third < 0", "test_core_increment", F42),
    ("increment: more comes than its bytes can be", INCREMENT, "come > left / LEAST_VERTEX", "false", "test_core_increment", F42),
    ("previous: after a jump the last camera still counts", "ext/follow.c", "        v->camera = camera;\n", "", "test_sql_previous.py",
     "F37_a_teleport_equals_a_fresh_query"),
    ("budget: the step above the one that fits will do", "ext/budget.c", "high - low > 1", "high - low > 2", "test_sql_previous.py",
     "F38_the_smallest_tolerance_that_keeps_the_budget"),
]
