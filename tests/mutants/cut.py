"""Mutants of modes snap and cut, outline tol in SQL, and transformed regions: see ../mutants.py."""

MUTANTS = [
    # cut: faces
    ("cut: shares are rounded down", "src/core/cut_faces.c", "return quotient + (2 * rest >= whole);", "return quotient;",
     "test_core_cut", "shares_are_the_nearest"),
    ("cut: a point on an edge is taken for one inside", "src/core/cut_faces.c", "if (on >= 0)", "if (on > 2)",
     "test_core_cut", "faces_tile_the_leaf_whatever_rounding_does"),
    ("cut: holes are closed over corners that turn out", "src/core/cut_faces.c",
     "region_side(f->points[s[n - 3].to], f->points[s[n - 2].to], f->points[s[n - 1].to]) > 0)", "true)",
     "test_core_cut", "faces_tile_the_leaf_whatever_rounding_does"),
    ("cut: edges that a hole's rim runs along twice stay apart", "src/core/cut_faces.c",
     "if (rim->loose) return join_loose(f, face, i);", "", "test_core_cut", "a_segment_passes_below_a_hanging_edge"),
    ("cut: crossings may lie on the leaf's side", "src/core/cut_faces.c",
     "if (region_side(f->points[i], f->points[next_corner(i)], p) <= 0) return false;",
     "if (region_side(f->points[i], f->points[next_corner(i)], p) < 0) return false;",
     "test_core_cut", "faces_tile_the_leaf_whatever_rounding_does"),
    # cut: leaves
    ("cut: edges that have to stay do not", "src/core/cut_faces.c", "if (f->faces[face].fixed[e]) {",
     "if (f->faces[face].fixed[e] && f->mark == 0) {", "test_core_cut", "F26_polygons_of_all_kinds_are_cut_to_their_area"),
    ("cut: the neighbour does not get a side's points", "src/core/cut.c", "if (c->near.count == 0) return keep_whole(c, triangle);",
     "if (c->near.count < 2) return keep_whole(c, triangle);", "test_core_cut", "F26_polygons_of_all_kinds_are_cut_to_their_area"),
    ("cut: heights on sides come from the wrong end", "src/core/cut.c",
     "return u->q + share * ((double)v->q - u->q);", "return v->q + share * ((double)u->q - v->q);",
     "test_core_cut", "F26_polygons_of_all_kinds_are_cut_to_their_area"),
    ("cut: every face is kept", "src/core/cut.c", "const bool held = holds_face(c, &faces[largest]);", "(void)holds_face(c, &faces[largest]); const bool held = true;",
     "test_core_cut", "F26_polygons_of_all_kinds_are_cut_to_their_area"),
    ("cut: a square is clear though a border touches it", "src/core/cut.c", "if (is_touched_by_border(c, &square)) break;", "",
     "test_core_cut", "F26_polygons_of_all_kinds_are_cut_to_their_area"),
    ("cut: what is finer than the region's grid is not looked at", "src/core/region.c", "if (whole != 0) return whole > 0 ? 1 : -1;",
     "return (whole > 0) - (whole < 0);", "test_core_cut", "the_region_holds_points_finer_than_its_grid"),
    # snap
    ("snap: squares are a quarter of the region's side", "src/core/region_snap.c", "while (side <= longer / 16) side *= 2;",
     "while (side <= longer / 8) side *= 2;", "test_sql_cut.py", "mode snap is cover of the squares"),
    ("snap: a square that a line ends at is left out", "src/core/region_snap.c", "box[i] -= box[i] > 0;", "box[i] -= 0;",
     "test_sql_cut.py", "mode snap is cover of the squares"),
    # outline tol
    ("tol: the proof promises what exact does", "ext/promise.c", "return r->options.outline == RQT_OUTLINE_TOL && r->terrain->voids > 0;",
     "return false;", "test_sql_cut.py", "outline tol: within eps"),
    ("tol: the option is read and forgotten", "ext/options.c", "r->options.outline = (rqt_outline)index_of(c, value);", ";",
     "test_sql_cut.py", "outline tol left samples out"),
    # transformed regions
    ("srid: a transformed region is not", "ext/geometry.c", "*geometry = transformed;", "rqt_geometry_free(transformed);",
     "test_sql_cut.py", "transformed"),
    ("srid: a number is always EPSG's", "ext/geometry.c", "char *from = own_system(db, srid);", "char *from = NULL; (void)own_system;",
     "test_sql_cut.py", "a system that its tables alone know"),
    # the verifier between samples
    ("verifier: a vertex beside an edge is in it", "src/verify/verify_free.c", "if (cross(a, b, p) != 0) return false;",
     "if (cross(a, b, p) > 1 << 30) return false;", "test_verify_free", "junctions_between_samples_are_exact"),
    ("verifier: a sample just outside is covered", "src/verify/verify_free.c", "if (at % step < 0) end--;", "",
     "test_verify_free", "on_samples_both_doors_agree"),
]
