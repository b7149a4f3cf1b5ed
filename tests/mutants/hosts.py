"""Mutants of what GIS hosts read of us, and of normals: see ../mutants.py."""

MUTANTS = [
    # layers
    ("hosts: a row's geometry has no SRID", "ext/mesh_tables.c", ".srid = request_srid(&r)};", ".srid = 0};",
     "test_sql_ogr.py", "CRS and extent"),
    ("hosts: a vertex's geometry says that it is empty", "src/format/geometry.c", "put_gpkg_head(bytes, GPKG_PLAIN",
     "put_gpkg_head(bytes, GPKG_EMPTY", "test_format", "test_point_gpkg"),
    ("hosts: a ply does not say its CRS", "src/format/format.c", "if (mesh->srid > 0) {", "if (mesh->srid > INT32_MAX - 1) {",
     "test_sql_formats.py", "a ply says its CRS"),
    ("hosts: an empty mesh does not say that it is", "src/format/geometry.c", "count ? GPKG_BOXED : GPKG_EMPTY", "GPKG_BOXED",
     "test_sql_formats.py", "flag of emptiness"),
    # normals
    ("normals: the difference with one side is halved", "src/store/normals.c", "return (double)c->q[high] - c->q[OWN];",
     "return ((double)c->q[high] - c->q[OWN]) / 2;", "test_store_normals",
     "normals_are_those_of_the_grid_and_each_block_is_read_once"),
    ("normals: the western block is not asked", "src/store/normals.c", "if (side == EAST) continue;",
     "if (side == EAST || side == WEST) continue;", "test_store_normals", "the_order_of_vertices_does_not_matter"),
    ("normals: a void counts as a height", "src/store/normals.c", "if (!(block->flags[at] & RQT_VALID)) continue;", "",
     "test_store_normals", "normals_are_those_of_the_grid_and_each_block_is_read_once"),
    ("normals: meridians do not meet", "src/store/normals.c", "/ sqrt(w) * cos(phi) : 0", "/ sqrt(w) : 0",
     "test_sql_normals.py", "africa"),
    ("normals: steps are cut off, not rounded", "src/core/wire_normals.c", "(int8_t)rint(", "(int8_t)trunc(", "test_wire_normals",
     "normals_come_back_beside_an_unchanged_mesh"),
    ("normals: a byte that is no step is taken", "src/core/wire_normals.c",
     "good &= packed[0] >= -STEPS && packed[1] >= -STEPS;", "", "test_wire_normals", "hostile_normals_are_refused_or_harmless"),
    ("normals: bytes may follow them", "src/core/wire.c", "return at == size;", "return at <= size;", "test_wire_normals",
     "normals_come_back_beside_an_unchanged_mesh"),
]
