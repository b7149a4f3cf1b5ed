"""Mutants of the store and the SQL functions: see ../mutants.py."""

MUTANTS = [
    # the store
    ("store: what a rollback undid stays cached", "src/store/store.c", "s->known = !writing;", "s->known = true;",
     "test_store_faults", "rows_that_we_change_and_roll_back_are_not_remembered"),
    ("store: a query holds no state of the database", "src/store/store.c", "if (s->holders++ > 0) return SQLITE_OK;",
     "if (s->holders++ >= 0) return SQLITE_OK;",
     "test_store_faults", "a_commit_in_the_middle_of_a_query_is_not_mixed_in"),
    ("store: an interval too long by one", "src/store/writer.c", "interval.em_parent - 1", "interval.em_parent",
     "test_store", "sound_terrains_have_no_findings"),
    ("check: errors of parent and child differ", "src/store/check.c", "if ((f->block.error[above] < error || outline) &&",
     "if (outline &&", "test_store", "every_damage_is_found_where_it_is"),
]
