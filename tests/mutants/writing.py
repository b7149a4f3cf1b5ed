"""Mutants of the writing side, where its parts meet: see ../mutants.py."""

UPDATE = "test_import_update"
FOLDERS = "folders_and_lists_are_taken_as_imports_take_them"

MUTANTS = [
    ("update: what a folder holds elsewhere is refused", "src/import/update.c",
     "path->passed = path->found && is_outside(p);", "path->passed = false;", UPDATE, FOLDERS),
    ("update: a named source elsewhere is passed over", "src/import/update.c",
     "path->passed = path->found && is_outside(p);", "path->passed = is_outside(p);", UPDATE, "what_does_not_fit_is_refused_with_a_sentence"),
    ("update: a folder with nothing for the terrain is fine", "src/import/update.c",
     "    if (w->names) {\n", "    if (w->names || w->outside) {\n", UPDATE, FOLDERS),
]
