#!/usr/bin/python3
"""mutants.py BUILD - breaks the code one line at a time and sees a named test go red.

A mutant is (what it breaks, file, text, replacement, test program, test). The first occurrence of the text is replaced in a copy of
the tree; the program is built and run there; the mutant is caught when the program fails and names that test (or hangs).
A text that is not found is a failure too: the list has to follow the code.
"""
import os
import shutil
import subprocess
import sys

MUTANTS = [
    # the bound
    ("bound: fewer samples count", "src/core/deviation.c",
     "if (d > most) most = d;", "if (d > most && i > 0) most = d;",
     "test_core_lattice", "errors_equal_the_oracles_on_adversarial_surfaces"),
    ("bound: 32 bits where they are too few", "src/core/deviation.c",
     "INT64_C(1) << (31 - (m < 31 ? m : 31))", "INT64_C(1) << (34 - (m < 31 ? m : 31))",
     "test_core_lattice", "errors_equal_the_oracles_on_adversarial_surfaces"),
    ("bound: a sample on two quarters counts for one", "src/core/error_kernels_cells.h",
     "RAISE(*east, DEVIATION(quarter_east));\n    }\n    if (right", "}\n    if (right",
     "test_core_lattice", "errors_equal_the_oracles_on_adversarial_surfaces"),
    ("bound: the end of a row is left out", "src/core/error_kernels_rows.h", "if (x < end) {", "if (false) {",
     "test_core_lattice", "errors_equal_the_oracles_on_adversarial_surfaces"),
    ("bound: the plane tilts the wrong way", "src/core/deviation.c", "        if (a.y == box->y0) gy = -gy;\n", "",
     "test_core_lattice", "a_plane_has_no_error_anywhere"),
    ("bound: clamped triangles taken for nested", "src/core/deviation.c",
     "if (!is_clamped(s, &t->t)) {", "if (true) {",
     "test_core_lattice", "errors_equal_the_oracles_for_every_small_extent"),
    ("bound: eps ignores what quantisation lost", "src/core/code.c",
     "if ((eps - rest) - quantum_error < 0) rest = nextafter(rest, 0);", "",
     "test_core_codes", "eps_gives_up_the_quantum_error_and_rounds_down"),
    ("voids: an outline costs nothing", "src/core/error_tile.c", "if (ground > code) code = ground;", "(void)ground;",
     "test_core_lattice", "errors_equal_the_oracles_for_every_small_extent"),
    ("voids: two valid corners are enough", "src/core/walk.c",
     "if (!(a->flags & b->flags & c->flags & RQT_VALID)) return false;",
     "if (!(a->flags & b->flags & RQT_VALID)) return false;",
     "test_core_query", "no_valid_sample_is_further_than_eps_and_exact_outlines_are_exact"),
    # the rounding direction
    ("rounding: doubles taken at their word", "src/core/code.c",
     "const rqt_code low = code_above_bits(bits - 64), high = code_above_bits(bits + 64);",
     "const rqt_code low = code_above_bits(bits), high = code_above_bits(bits);",
     "test_core_lattice", "errors_equal_the_oracles_in_feet_and_in_thousandths"),
    ("rounding: a large deviation to the nearest float", "src/core/error_kernels_cells.h",
     ".round = scale->exact ? 127 : 0,", ".round = 0,",
     "test_core_sweep", "errors_of_every_relief_equal_the_oracles"),
    ("rounding: a near product taken at its word", "src/core/error_kernels_cells.h",
     ".slack = scale->exact ? 0 : 8,", ".slack = 0,",
     "test_core_lattice", "errors_equal_the_oracles_in_feet_and_in_thousandths"),
    ("voids: a cell with a void is measured as if whole", "src/core/error_kernels_cells.h",
     "                most.center &= sound;\n", "",
     "test_core_lattice", "errors_equal_the_oracles_for_every_small_extent"),
    ("rounding: down instead of up", "src/core/code.c", "(((int64_t)1 << DROPPED) - 1)", "0",
     "test_core_codes", "errors_in_quanta_round_up_only_next_to_every_code"),
    # the closure
    ("closure: saturation misses two children", "src/core/saturate.c", "if (most > *c) *c = most;", "if (ab > *c) *c = ab;",
     "test_core_lattice", "errors_equal_the_oracles_for_every_small_extent"),
    ("closure: one step instead of all", "src/core/selection.c",
     "if (added) stack[depth++] = parents[i];", "if (added && depth == 0) stack[depth++] = parents[i];",
     "test_core_lattice", "closures_of_random_vertices_equal_the_oracles"),
    ("closure: centres before sides", "src/core/selection.c",
     "& (v.y >> scale) & 1) ? 1 : 0)", "& (v.y >> scale) & 1) ? 0 : 1)",
     "test_core_lattice", "closures_of_random_vertices_equal_the_oracles"),
    ("closure: >= instead of >", "src/core/selection.c", "if (code <= eps && !outline) continue;",
     "if (code < eps && !outline) continue;",
     "test_core_lattice", "algorithms_1_and_2_and_a_threshold_select_the_same"),
    ("closure: the diagonal of every cell the same", "src/core/lattice.c", ">> (scale + 1)) & 1) == 0;",
     ">> (scale + 1)) & 1) != 2;",
     "test_core_lattice", "parents_children_and_levels_equal_the_oracles_graph"),
    # other metrics
    ("minimal: one pass is enough", "src/core/minimal.c", "} while (f.changed);", "} while (0);",
     "test_core_metric", "minimal_errors_select_what_splitting_bad_leaves_gives"),
    ("minimal: a leaf that is not there is split", "src/core/minimal.c", "least(f->deviation[2 * at], apex0)", "f->deviation[2 * at]",
     "test_core_metric", "no_mesh_of_5_by_5_is_smaller_or_nearer_within_its_size"),
    ("wedgie: no bound at the raster's edge", "src/core/metric.c", "nested > least ? nested : least", "nested + 0 * least",
     "test_core_metric", "local_wedgie_and_euclid_are_their_definitions"),
    ("fans: a clockwise run begins where others do", "src/core/strip_fans.c", "(odd ? 1u : 0u)", "(0u * odd)",
     "test_core_fans", "every_metric_answers_alike_by_all_ways_and_blocks"),
    # the sweep
    ("sweep: tiles do not hear of each other", "src/core/sweep.c",
     "raise_to(code, sweep->right_code[right + y]);", "(void)code;",
     "test_core_sweep", "sweeps_equal_the_whole_for_every_small_extent"),
    ("sweep: a band does not hear of the next one", "src/core/sweep.c", "int32_t y1 = y0 + 2 * sweep->side;",
     "int32_t y1 = y0 + sweep->side;", "test_core_sweep", "sweeps_equal_the_whole_for_every_small_extent"),
    ("sweep: centres of tiles are not passed on", "src/core/sweep.c",
     "raise_to(&errors->code[at], from.code[x]);", "(void)from;",
     "test_core_sweep", "sweeps_equal_the_whole_for_every_small_extent"),
    # far heights and the interval pyramid
    ("far: the near corner instead", "src/core/pyramid.c", "summary_vertex(p, 2 * ax - cx, cy)", "summary_vertex(p, ax, cy)",
     "test_core_query", "blocks_and_summaries_hold_what_the_oracle_says"),
    ("pyramid: a block answers for its parent", "src/core/summary.c", "eps < interval->em_parent",
     "eps <= interval->em_parent", "test_core_query", "every_place_has_exactly_one_answering_block"),
    ("pyramid: outline bits below forgotten", "src/core/pyramid.c",
     "            block->outline |= outline;\n", "            (void)outline;\n",
     "test_core_query", "blocks_and_summaries_hold_what_the_oracle_says"),
    ("walk: a shared quarter twice", "src/core/query.c",
     "if (sibling < answer->number && has_answer(w, sibling)) continue;", "",
     "test_core_query", "parts_of_a_split_window_make_exactly_the_whole"),
    ("walk: a shared quarter never", "src/core/query.c",
     "if (sibling < answer->number && has_answer(w, sibling)) continue;", "if (has_answer(w, sibling)) continue;",
     "test_core_query", "queries_equal_the_global_walk_on_small_rasters"),
    ("walk: every half is walked", "src/core/query.c", "if (is_selected(w, apex.at, apex.error, apex.flags)) {", "if (true) {",
     "test_core_query", "queries_equal_the_global_walk_on_small_rasters"),
    ("walk: quarters of blocks that only touch are lost", "src/core/query.c",
     "/* center: the corner that is the parent's centre; c: the one opposite, a corner of the parent. */",
     "if (outside) return;",
     "test_core_query", "queries_equal_the_global_walk_on_small_rasters"),
    ("walk: blocks that only touch are read", "src/core/query.c", "if (!outside && rqt_summary_needs_block(",
     "if (rqt_summary_needs_block(", "test_core_strip", "blocks_that_only_touch_the_region_are_not_read"),
    ("walk: what the border adds is forgotten", "src/core/patch.c",
     "if (memo < w->live || memo >= KNOWN) continue;", "if (true) continue;",
     "test_core_query", "queries_equal_the_global_walk_on_larger_rasters"),
    ("walk: what earlier blocks left in the memo counts", "src/core/walk.c", "const bool fresh = left < live;",
     "const bool fresh = left == 0;", "test_core_query", "queries_equal_the_global_walk_on_larger_rasters"),
    ("strip: the pivot is not said again", "src/core/walk.c", "s += pivot == through;", "",
     "test_core_strip", "every_product_is_the_same_patch"),
    ("height: a leaf with a void corner", "src/core/leaf.c",
     "if (!(a->flags & l->flags & r->flags & RQT_VALID)) return RQT_FOUND_NOTHING;", "",
     "test_store", "a_height_is_the_one_of_the_patch_of_the_point"),
    ("height: the finest triangles do not split", "src/core/leaf.c", "splits > 0; splits--", "splits > 1; splits--",
     "test_store", "a_height_is_the_one_of_the_patch_of_the_point"),
    # the winding
    ("winding: strips do not turn", "src/core/strip.c", "s[count++] = even ? b : c;\n    s[count++] = even ? c : b;",
     "s[count++] = b;\n    s[count++] = c;", "test_core_strip", "strips_of_patches_are_the_patches"),
    ("winding: triangles do not turn with depth", "src/core/walk.c",
     "swap = (l ^ r) & (0 - (turn ^ (c.splits & 1)));", "swap = (l ^ r) & (0 - turn);",
     "test_core_query", "queries_equal_the_global_walk_on_small_rasters"),
    # regions
    ("region: coordinates cut off instead of rounded", "src/core/region.c", "return (int64_t)rint(units);",
     "return (int64_t)floor(units);", "test_core_query", "queries_equal_the_global_walk_on_small_rasters"),
    ("region: touching counts as crossing", "src/core/region_edges.c", "<= 0", "< 0", "test_region",
     "test_polygons_meet_as_the_oracle_says"),
    # stored bytes
    ("bytes: the checksum is not compared", "src/core/block_codec.c", "checksum64(bytes, size, AT_CHECKSUM)",
     "get64(bytes + AT_CHECKSUM)", "test_codec_block", "every_flipped_bit_of_a_block_is_noticed"),
    ("bytes: a short payload passes", "src/core/block_codec.c", "if (got != h->payload)", "if (got < h->payload)",
     "test_codec_block", "a_payload_that_lies_is_found_out_under_a_good_checksum"),
    ("bytes: the predictor slips by half a step", "src/core/block_predict.c", "0.5 - 0x1p-21", "0.5",
     "test_codec_format", "the_bytes_of_a_block_mean_what_the_format_says"),
    ("bytes: a sparse block drops what it must keep", "src/core/block_sparse.c", "(uint8_t)((b->error[i] > b->floor)",
     "(uint8_t)((b->error[i] > b->floor + 1)", "test_codec_block", "a_sparse_block_comes_back_as_far_as_it_is_kept"),
    ("bytes: a kept vertex needs no reason", "src/core/block_sparse.c", "*good &= outline | (own > e->floor);", "(void)good;",
     "test_codec_block", "a_payload_that_lies_is_found_out_under_a_good_checksum"),
    ("bytes: a sparse block's bits may be too many", "src/core/block_sparse.c", "return (list->offered + 7) / 8 == bytes &&",
     "return (list->offered + 7) / 8 <= bytes &&", "test_codec_block",
     "a_payload_that_lies_is_found_out_under_a_good_checksum"),
    ("pyramid: the floor is the parent's", "src/core/pyramid.c", "block->floor = block->sparse ? b->em : 0;",
     "block->floor = block->sparse ? summary->tol.em_parent : 0;", "test_core_query",
     "blocks_and_summaries_hold_what_the_oracle_says"),
    ("check: a vertex that a parent must keep", "src/store/check.c",
     "if ((kept || kept_there) && error > floor) count(&d->errors, at);", "(void)error, (void)floor;", "test_store",
     "every_damage_is_found_where_it_is"),
    # memory
    ("memory: a refused allocation passes for done", "src/core/selection.c", "if (!slot) return RQT_NO_MEMORY;",
     "if (!slot) return RQT_OK;", "test_core_memory", "one_refused_allocation_is_reported_and_nothing_leaks"),
    # the verifier
    ("verifier: rounds errors down", "src/verify/verify_error.c", "bool cut = rest != 0;", "bool cut = false;",
     "test_verify_random", "the_error_is_the_double_nearest_to_the_exact_value"),
    ("verifier: looks at one size of triangle only", "src/verify/verify_overlap.c", "level < LEVELS", "level <= our_level",
     "test_verify_random", "triangles_of_very_different_size_are_compared"),
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
    # import
    ("import: south-up rasters upside down", "src/import/mosaic.c", "if (!(off <= SLACK))", "if (false)",
     "test_import_faults", "sources_of_unlike_grids_are_refused"),
    ("import: heights far from zero", "src/import/quantise.c", "(int64_t)middle", "(int64_t)0",
     "test_import", "heights_far_from_zero_lose_nothing"),
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
    # the wire format
    ("wire: a guess stays where a height was sent", "src/core/wire_steps.h",
     "        settle(w, m, false);\n        return true;", "        return true;",
     "test_wire", "the_patch_of_the_query_comes_back_in_its_order"),
    ("wire: an increment of any mesh is taken", "src/core/wire_decode.c",
     "if (rqt_wire_digest(patch) != from)", "if (from == 0)",
     "test_wire", "increments_that_belong_elsewhere_are_refused_with_a_reason"),
    ("wire: heights beyond the limit", "src/core/wire_decode.c",
     "if (q > -RQT_HEIGHT_LIMIT && q < RQT_HEIGHT_LIMIT)", "if (q != INT64_MIN)",
     "test_wire", "hostile_bytes_are_refused_or_harmless"),
]


def main():
    build = sys.argv[1] if len(sys.argv) > 1 else "build"
    only = sys.argv[2] if len(sys.argv) > 2 else ""
    tree = os.path.join(build, "mutants")
    shutil.rmtree(tree, ignore_errors=True)
    os.makedirs(tree)
    for name in ("src", "ext", "sql", "tests", "Makefile"):
        (shutil.copytree if os.path.isdir(name) else shutil.copy2)(name, os.path.join(tree, name))
    # Objects are up to date with the sources they came from: times are kept.
    shutil.copytree(build, os.path.join(tree, "build"),
                    ignore=shutil.ignore_patterns("mutants", "sanitized", "bench", "chart", "peers", "demo", "*.log"))
    environment = dict(os.environ, RQT_SEED="1", TMPDIR=os.path.abspath(tree))
    caught = missed = 0
    for what, path, old, new, program, test in MUTANTS:
        if only not in what:
            continue
        target = os.path.join(tree, path)
        with open(path, encoding="utf-8") as f:
            text = f.read()
        verdict = "not found in " + path
        if old in text:
            with open(target, "w", encoding="utf-8") as f:
                f.write(text.replace(old, new, 1))
            made = subprocess.run(["make", "-s", "-j2", "WARNINGS=", "build/tests/" + program], cwd=tree,
                                  capture_output=True, text=True)
            verdict = "does not build:\n" + made.stderr[-1500:]
            if made.returncode == 0:
                try:
                    ran = subprocess.run(["build/tests/" + program], cwd=tree, capture_output=True, text=True,
                                         errors="replace", timeout=120, env=environment)
                    output = ran.stdout + ran.stderr
                    named = any(test in line and ("FAILED" in line or "ERROR" in line) for line in output.splitlines())
                    red = ran.returncode != 0 and (named or ran.returncode < 0)
                    verdict = "" if red else "SURVIVED " + program + (
                        " (red, but not " + test + ")" if ran.returncode else "")
                except subprocess.TimeoutExpired:
                    verdict = ""
            shutil.copy2(path, target)
            os.utime(target)
        if verdict:
            missed += 1
            print("MISSED  %-48s %s" % (what, verdict), flush=True)
        else:
            caught += 1
            print("caught  %-48s by %s" % (what, test), flush=True)
    print("%d passed, %d failed" % (caught, missed))
    return missed != 0


sys.exit(main())
