"""Mutants of the import and its blocks: see ../mutants.py."""

MUTANTS = [
    # import
    ("import: south-up rasters upside down", "src/import/mosaic.c", "if (!(off <= SLACK))", "if (false)",
     "test_import_faults", "sources_of_unlike_grids_are_refused"),
    ("import: heights far from zero", "src/import/quantise.c", "(int64_t)middle", "(int64_t)0",
     "test_import", "F10_millimetres_far_from_zero_are_not_lost"),
    ("import: voids of the first band everywhere", "src/import/stream.c",
     "if (w->valid) memcpy(w->valid + to, w->strip->valid + at, width);",
     "if (w->valid) memcpy(w->valid + to, w->strip->valid + (size_t)y * width, width);",
     "test_import_stream", "every_way_gives_the_same_tables_with_voids"),
    ("import: decimals tried from zero only", "src/import/quantise.c", "if (z0 == t->steps.z0) return true;",
     "if (z0 == t->steps.z0 || z0 > 0) return true;",
     "test_import_stream", "every_way_gives_the_same_tables_of_decimals"),
    # blocks out of bands
    ("build: a parent does not hear of its children's own", "src/core/build.c",
     "most = error[u] > most ? error[u] : most;", "(void)error;",
     "test_core_build", "blocks_of_bands_are_those_of_the_pyramid"),
    ("build: the far vertex on the wrong side", "src/core/build.c", "{2 * ax - cx, cy}", "{2 * ax - cx, ay}",
     "test_core_build", "blocks_of_bands_are_those_of_the_pyramid"),
    ("build: kept rows end with the band", "src/core/build.c", "(first + per_band + 1 == w->rows ? 1 : 0)", "0",
     "test_core_build", "blocks_of_bands_are_those_of_the_pyramid"),
    ("past: vertices without area are taken at their word", "src/core/internal.h",
     "return v.x - q < lattice->width - 1 && v.y - q < lattice->height - 1;", "return true;",
     "test_core_build", "blocks_of_bands_are_those_of_the_pyramid"),
]
