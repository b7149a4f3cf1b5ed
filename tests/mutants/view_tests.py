"""Mutants of the tests of the literature, and of the metric `plane`: see ../mutants.py."""

HAND = "bounds_are_the_papers_computed_by_hand"
PIECES = "a_piece_gets_the_least_of_its_points_and_is_shown_with_one"
BEHIND = "what_is_behind_the_eye_is_left_out"
DISTANCE = "eps_grows_with_distance_as_each_paper_says"
TESTS = "src/core/view_tests.c"
FIT = "a_fitted_plane_is_its_definition"

MUTANTS = [
    ("tests of views: ulrich's box is not clamped at the eye", TESTS,
     "return (span){fmax(0, middle - half), middle + half};", "return (span){middle - half, middle + half};",
     "test_core_view_tests", PIECES),
    ("tests of views: ulrich takes the smallest difference", TESTS,
     "fmax(all.least, one.least), fmax(all.most, one.most)", "fmin(all.least, one.least), fmax(all.most, one.most)",
     "test_core_view_tests", HAND),
    ("tests of views: ulrich's box is not turned", TESTS,
     "fabs(dot(s->to_centre, axis[i]))", "fabs(s->to_centre[i])", "test_core_view_tests", HAND),
    ("tests of views: lindstrom at the near end of the ground", TESTS,
     "fmin(fmax(s->height.least, s->ground.least), s->ground.most)", "s->ground.least", "test_core_view_tests", HAND),
    ("tests of views: F33 lindstrom without foreshortening", TESTS,
     "if (r > 0) return r + h * h / r;", "if (r > 0) return sqrt(r * r + h * h);",
     "test_core_view_tests", "F33_lindstrom_asks_nothing_straight_down"),
    ("tests of views: spheres count pixels by the tangent", TESTS,
     "per_length = camera->tau * 2 * atan(camera->height / (2 * camera->focal)) / camera->height;", "",
     "test_core_view_tests", HAND),
    ("tests of views: a node is as far as its nearest point", TESTS,
     "        asked = sqrt(dot(s.to_centre, s.to_centre));\n", "        asked = length.least;\n",
     "test_core_view_tests", "a_middle_is_not_where_a_piece_is_nearest"),
    ("tests of views: the LOD map looks the other way", TESTS,
     "(1 + dot(to, camera->forward) / distance) / 2", "(1 - dot(to, camera->forward) / distance) / 2",
     "test_core_view_tests", DISTANCE),
    ("tests of views: patches of any size", TESTS, "piece->side > RQT_VIEW_PATCH", "piece->side < 0",
     "test_core_view_tests", HAND),
    ("tests of views: one side of the frustum is open", TESTS, "side < 4", "side < 3", "test_core_view_tests", BEHIND),
    ("tests of views: the frustum is tested by the centre", TESTS,
     "prism->radius * sqrt(fmax(0, dot(n, n) - upward * upward))", "0", "test_core_view_tests", PIECES),
    ("tests of views: there is no far end", TESTS,
     "if (furthest(s, prism, inward) < -camera->far || furthest", "if (furthest", "test_core_view_tests", BEHIND),
    ("tests of views: F31 what is not a number is passed on", TESTS,
     "if (!(bound->eps >= 0)) bound->eps = 0;", "", "test_core_view_tests", "F31_strange_eyes_get_a_number"),
    ("tests of views: F32 the guaranteed test is another's", TESTS,
     "    if (test == RQT_VIEW_GUARANTEED) {\n", "    if (test == RQT_VIEW_GUARANTEED) test = RQT_VIEW_SPHERE;\n    if (test == RQT_VIEW_GUARANTEED) {\n",
     "test_core_view_tests", "F32_named_tests_break_tau_off_the_axis"),
    ("tests of views: F34 the eye is subtracted in single precision", TESTS,
     "prism->centre[i] - camera->eye[i]", "(double)((float)prism->centre[i] - (float)camera->eye[i])",
     "test_core_view_tests", "F34_far_from_the_origin_a_test_says_the_same"),
    # the fitted plane
    ("fit: planes do not tilt south", "src/core/fit.c", "f.gy = (f.yz * f.xx - f.xz * f.xy) / area;", "f.gy = f.yz / f.yy;",
     "test_core_metric", FIT),
    ("fit: means are the first corner's", "src/core/fit.c", "f.mz = (double)f.z / (double)f.n;", "f.mz = 0;", "test_core_metric", FIT),
    ("fit: void samples count", "src/core/fit.c", "s->valid ? s->valid + sample_index(s, 0, y) : NULL", "NULL", "test_core_metric", FIT),
    ("fit: samples in a row are fitted level", "src/core/fit.c", "} else if (length > 0) {", "} else if (length < 0) {",
     "test_core_metric", FIT),
    ("fit: rounding is relief", "src/core/fit.c", "return mean < 0x1p-40 * (double)s->relief ? 0 : mean;", "return mean;",
     "test_core_metric", FIT),
]
