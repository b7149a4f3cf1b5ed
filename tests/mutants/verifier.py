"""Mutants of the independent verifier: see ../mutants.py."""

MUTANTS = [
    # the verifier
    ("verifier: rounds errors down", "src/verify/verify_error.c", "bool cut = rest != 0;", "bool cut = false;",
     "test_verify_random", "the_error_is_the_double_nearest_to_the_exact_value"),
    ("verifier: looks at one size of triangle only", "src/verify/verify_overlap.c", "level < LEVELS", "level <= our_level",
     "test_verify_random", "triangles_of_very_different_size_are_compared"),
]
