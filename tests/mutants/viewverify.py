"""Mutants of the proof on the screen: see ../mutants.py."""

MUTANTS = [
    ("view verifier: a point behind the eye is where its mirror image is", "src/verify/verify_view.c",
     "if (seen[2] <= 0 || moved[2] <= 0) return INFINITY;", "", "test_verify_view", "a_point_behind_the_eye_is_infinitely_far_off"),
    ("view verifier: looks at what the sample draws, not the mesh", "src/verify/verify_view.c",
     "if (!is_drawn(c, seen) && !is_drawn(c, moved)) return UNSEEN;", "if (!is_drawn(c, seen)) return UNSEEN;",
     "test_verify_view", "what_is_drawn_counts_and_nothing_else"),
    ("view verifier: forgets that depth changes", "src/verify/verify_view.c", "(shift[0] - seen[0] * (shift[2] / seen[2]))",
     "(shift[0])", "test_verify_view", "a_pit_below_the_eye_is_off_by_the_parallax"),
    ("view verifier: heights by the corners' places where they are linear", "src/verify/verify_view.c",
     "if (view->scene->rise != 0) {", "if (view->scene->rise > 1e9) {", "test_verify_view",
     "F31_an_eye_on_a_coplanar_sample_sees_it_where_it_is"),
    ("view verifier: a window begins anew", "src/verify/verify_view.c", "verify_view_report sum = *report;",
     "verify_view_report sum = {0};", "test_verify_view", "windows_add_up_in_any_order"),
    ("view verifier: skips the first row of a window", "src/verify/verify_view.c",
     "if (row < s->row0 || row > south) continue;", "if (row <= s->row0 || row > south) continue;", "test_verify_view",
     "random_views_agree_with_the_slow_check"),
    ("view verifier: the outline's metres as if the picture plane were a sphere", "src/verify/verify_view.c",
     "s / sqrt((1 + t * t) * (1 + (t + s) * (t + s)))", "s", "test_verify_view",
     "the_metres_of_a_slack_move_no_point_further"),
]
