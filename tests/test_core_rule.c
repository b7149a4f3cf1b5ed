/* test_core_rule.c - rules: eps by place, eps lowered by rank, forced vertices, mode `border`, against their
 * definitions.
 *
 * The definitions are those of test_core_trial.h. */
#include "test_core_trial.h"

#include <limits.h>

static void rules_equal_their_definition_on_small_rasters(void **state) {
    (void)state;
    random_begin("small rules");
    for (int n = 0; n < 150; n++) {
        trial *t = trial_create(random_between(1, 12), random_between(1, 12), n % 2);
        check_trial(t);
        trial_free(t);
    }
}

static void rules_equal_their_definition_on_larger_rasters(void **state) {
    (void)state;
    random_begin("larger rules");
    for (int n = 0; n < 12; n++) {
        trial *t = trial_create(random_between(17, 40), random_between(17, 40), n % 2);
        check_trial(t);
        trial_free(t);
    }
}

/* Nothing but ranks: blocks are chosen from in one pass, not from their centres down. */
static void eps_lowered_by_rank_alone_is_its_definition(void **state) {
    (void)state;
    random_begin("lowered");
    for (int n = 0; n < 30; n++) {
        trial *t = trial_create(random_between(1, 36), random_between(1, 36), 0);
        const double step = t->eps * random_unit() / 4;
        t->places = t->forced_count = 0;
        for (int rank = 0; rank < RQT_RANKS; rank++) t->lowering[rank] = rank * step;
        check_trial(t);
        trial_free(t);
    }
}

/* Flat terrain and a coarse eps: what is selected is what the border forces. Cheap, so that rare cases come up:
 * clamped triangles that stick out of R' though their children do not, half cells that a line touches and no
 * polygon meets. */
static void borders_force_what_is_mixed_and_no_more(void **state) {
    (void)state;
    random_begin("forced by borders");
    static const int kinds[] = {SHAPE_RECTANGLE, SHAPE_RINGS, SHAPE_TRIANGLES,
                                SHAPE_TRIANGLES, SHAPE_BOTH,  SHAPE_BOTH};
    for (int n = 0; n < 300; n++) {
        const int width = random_between(2, 11), height = random_between(2, 11);
        trial *t = calloc(1, sizeof *t);
        if (!t) abort();
        model_create(&t->m, raster_make(SURFACE_CONSTANT, width, height, -1));
        t->eps = 1e9;
        t->has_border = 1;
        random_shape(&t->border, kinds[n % 6], width, height);
        t->grown = t->border;
        (void)shape_grow_rectangle(&t->grown);
        select_by_definition(t);
        core_rule c;
        core_rule_create(&c, t);
        for (int y = 0; y < t->m.o.side; y++)
            for (int x = 0; x < t->m.o.side; x++) {
                const bool got =
                    rqt_rule_selects(c.rule, (rqt_vertex){x, y},
                                     oracle_at(&t->m.o, x, y)->code > 65534 ? RQT_CODE_INFINITY : 0, false);
                if (got != t->set[y * t->m.o.side + x]) describe(t);
                CHECK(got == t->set[y * t->m.o.side + x], "(%d,%d) is %sselected", x, y, got ? "" : "not ");
            }
        core_rule_free(&c);
        free(t->set);
        trial_free(t);
    }
}

/* -------------------------------------------------------------------------------- of the catalogue -- */

static void give_border(trial *t, const char *text, int x0, int y0, int x1, int y1) {
    const int r[1][4] = {{x0, y0, x1, y1}};
    memset(&t->border, 0, sizeof t->border);
    t->has_border = 1;
    shape_polygon_of_rectangles(&t->border, r, 1);
    t->border.used = 0;
    if (text)
        shape_write(&t->border, "%s", text);
    else
        shape_write(&t->border, "POLYGON((%.17g %.17g, %.17g %.17g, %.17g %.17g, %.17g %.17g, %.17g %.17g))",
                    x0 / 4.0, y0 / 4.0, x1 / 4.0, y0 / 4.0, x1 / 4.0, y1 / 4.0, x0 / 4.0, y1 / 4.0, x0 / 4.0,
                    y0 / 4.0);
    t->grown = t->border;
    (void)shape_grow_rectangle(&t->grown);
}

/* How many levels lie between the coarsest and the finest block that answers. */
static int levels_between(const trial *t, int k) {
    core_rule c;
    database d;
    int low = 99, high = 0;
    core_rule_create(&c, t);
    assert_int_equal(database_create(&d, &t->m, k, &test_allocator), RQT_OK);
    for (size_t n = 0; n < d.count; n++) {
        const rqt_block_place *p = &d.block[n].place;
        if (!rqt_rule_is_answered(c.rule, p, &d.block[n].summary, RQT_OUTLINE_EXACT) ||
            rqt_rule_is_answered_above(c.rule, p, &d.block[n].summary, RQT_OUTLINE_EXACT))
            continue;
        if (p->level < low) low = p->level;
        if (p->level > high) high = p->level;
    }
    database_free(&d, &test_allocator);
    core_rule_free(&c);
    return high - low;
}

static void F19_four_eps_at_a_block_corner_meet_without_t_junctions(void **state) {
    (void)state;
    random_begin("F19");
    for (int n = 0; n < 2; n++) {
        trial *t = trial_over(raster_make(n ? SURFACE_TAKAGI : SURFACE_HILLS, 129, 129 - 32 * n, -1), 1e9);
        const double most = rqt_code_metres((rqt_code)oracle_at(&t->m.o, 64, 64)->code);
        const int x = 64, y = n ? 32 : 64; /* a corner of blocks of every size up to 32 */
        place_rectangle(t, most / 100, x, y, 70, y + 5);
        place_rectangle(t, most / 12, x - 7, y, x, y + 4);
        place_rectangle(t, most / 4, x, y - 9, x + 3, y);
        place_rectangle(t, 0, x, y, x + 1, y + 1);
        CHECK(levels_between(t, 1) >= 3, "only %d levels apart", levels_between(t, 1));
        check_trial(t);
        trial_free(t);
    }
}

static void F20_closure_is_transitive_across_blocks(void **state) {
    (void)state;
    random_begin("F20");
    for (int n = 0; n < 8; n++) {
        /* nothing but the forced vertices and what they depend on, directly or not */
        trial *t = trial_over(raster_make(SURFACE_CONSTANT, 33, 30, -1), 5);
        static const oracle_point deep[8] = {{1, 1}, {31, 2},  {16, 15}, {17, 16},
                                             {8, 7}, {32, 31}, {15, 0},  {5, 27}};
        t->forced[t->forced_count++] = deep[n];
        check_trial(t);
        core_rule c;
        core_rule_create(&c, t);
        database d;
        rqt_patch patch;
        assert_int_equal(database_create(&d, &t->m, 2, &test_allocator), RQT_OK);
        d.rule = c.rule;
        const window all = window_all();
        rqt_region *region = region_of(&all, &t->m.grid.lattice);
        assert_int_equal(
            database_query(&d, region, 0, RQT_SELECT_THRESHOLD, RQT_OUTLINE_EXACT, &test_allocator, &patch),
            RQT_OK);
        CHECK(patch.vertex_count > 8, "a vertex of level 5 depends on more than %d", (int)patch.vertex_count);
        rqt_patch_free(&patch);
        rqt_region_free(region);
        database_free(&d, &test_allocator);
        core_rule_free(&c);
        trial_free(t);
    }
}

static void F24_regions_thinner_than_a_cell_have_a_border_or_are_covered(void **state) {
    (void)state;
    random_begin("F24");
    for (int n = 0; n < 12; n++) {
        trial *t = trial_create(random_between(2, 14), random_between(2, 14), 1);
        const int x = random_between(0, 4 * t->m.r.width), y = random_between(0, 4 * t->m.r.height);
        switch (n % 4) {
        case 0:
            give_border(t, NULL, x, y, x + 1, y + random_between(1, 30)); /* a quarter of a sample wide */
            break;
        case 1: /* on a sample line; shapes of lines and points are covered */
            memset(&t->border, 0, sizeof t->border);
            shape_write(&t->border, "LINESTRING(%d %d, %d %d)", x / 4, y / 4, x / 4, y / 4 + 5);
            t->border.segment[0][0] = (oracle_point){x & -4, y & -4};
            t->border.segment[0][1] = (oracle_point){x & -4, (y & -4) + 20};
            t->border.segment_count = 1;
            t->grown = t->border;
            break;
        case 2:
            random_shape(&t->border, SHAPE_POINT, t->m.r.width, t->m.r.height);
            t->grown = t->border;
            break;
        default:
            give_border(t, NULL, 4 * t->m.r.width - 3, y, 4 * t->m.r.width + 9, y + 4); /* outside */
        }
        check_trial(t);
        trial_free(t);
    }
}

static void F26_polygons_with_holes_touching_themselves_or_covered(void **state) {
    (void)state;
    random_begin("F26");
    static const int kinds[] = {SHAPE_RINGS, SHAPE_TRIANGLES, SHAPE_COVERED};
    for (int n = 0; n < 36; n++) {
        trial *t = trial_create(random_between(3, 18), random_between(3, 18), 1);
        random_shape(&t->border, kinds[n % 3], t->m.r.width, t->m.r.height);
        t->grown = t->border;
        (void)shape_grow_rectangle(&t->grown);
        if (n % 2) { /* mode cover: the same region over a mesh that knows nothing of it */
            t->has_border = 0;
            if (t->places == 0) place_rectangle(t, t->eps / 2, 0, 0, 2, 2);
            t->place[0] = t->border;
        }
        check_trial(t);
        trial_free(t);
    }
}

/* The vertex of a patch of all by mode border: its area told by the verifier. */
static void F27_border_on_odd_coordinates_has_the_regions_area(void **state) {
    (void)state;
    random_begin("F27");
    for (int n = 0; n < 12; n++) {
        const int width = random_between(12, 40), height = random_between(12, 40);
        trial *t = trial_over(raster_make(n % 3 ? SURFACE_HILLS : SURFACE_CONSTANT, width, height, -1),
                              n % 2 ? 1e6 : 3); /* coarse all around */
        const int x0 = random_between(0, 4) * 2 + 1, y0 = random_between(0, 4) * 2 + 1,
                  x1 = x0 + random_between(2, width), y1 = y0 + random_between(2, height);
        const int off = n % 4 == 3; /* between samples: grown outward */
        give_border(t, NULL, 4 * x0 + off, 4 * y0 + 2 * off, 4 * x1 - off, 4 * y1 - 3 * off);
        const int right = x1 < width - 1 ? x1 : width - 1, bottom = y1 < height - 1 ? y1 : height - 1;
        CHECK(area_of_border(t) == 2L * (right - x0) * (bottom - y0), "the oracle's area is %ld",
              area_of_border(t));
        check_trial(t);
        trial_free(t);
    }
}

/* ------------------------------------------------------------------------------- meshes beside meshes -- */

static void detail_changes_nothing_beyond_its_reach(void **state) {
    (void)state;
    random_begin("reach");
    size_t same = 0, other = 0;
    for (int n = 0; n < 60; n++) {
        trial *t = trial_create(random_between(8, 40), random_between(8, 40), 0);
        t->forced_count = 0;
        memset(t->lowering, 0, sizeof t->lowering);
        core_rule c;
        core_rule_create(&c, t);
        const int k = random_between(1, t->m.o.K < 5 ? t->m.o.K : 5);
        size_t plain_count, count;
        key *plain = keys_of_rule(t, k, NULL, rqt_code_eps(t->eps, t->quantum_error), &plain_count);
        key *with = keys_of_rule(t, k, c.rule, 0, &count);
        /* a leaf of the plain mesh that is not in the other was split: its split vertex was in reach of a place */
        for (size_t i = 0, j = 0; i < plain_count; i++) {
            while (j < count && ordered_keys(&with[j], &plain[i]) < 0) j++;
            if (j < count && ordered_keys(&with[j], &plain[i]) == 0) {
                same++;
                continue;
            }
            other++;
            long x0 = LONG_MAX, y0 = LONG_MAX, x1 = 0, y1 = 0;
            for (int v = 0; v < 3; v++) {
                const long x = plain[i].v[v] % t->m.r.width, y = plain[i].v[v] / t->m.r.width;
                if (x < x0) x0 = x;
                if (x > x1) x1 = x;
                if (y < y0) y0 = y;
                if (y > y1) y1 = y;
            }
            /* the half-width of its box is at most three times the longer side of a clamped leaf at the raster's
             * edge may be cut, so take the lattice's: the next power of two */
            long side = 1, reach = 0;
            while (side < x1 - x0 || side < y1 - y0) side *= 2;
            if (x1 == t->m.r.width - 1 || y1 == t->m.r.height - 1) side = t->m.o.side;
            reach = 4 * side;
            int near = 0;
            for (int p = 0; p < t->places; p++)
                near |= t->place_eps[p] < t->eps &&
                        shape_touches(&t->place[p], x0 - reach, y0 - reach, x1 + reach, y1 + reach);
            if (!near) describe(t);
            CHECK(near, "a leaf far from every place has changed");
        }
        free(plain);
        free(with);
        core_rule_free(&c);
        trial_free(t);
    }
    CHECK(same > 100 && other > 20, "%zu leaves stayed and %zu changed: no test of either", same, other);
}

static void detail_over_everything_is_the_mesh_of_its_eps(void **state) {
    (void)state;
    random_begin("everything");
    for (int n = 0; n < 30; n++) {
        trial *t = trial_over(raster_make((surface)random_between(0, SURFACE_COUNT - 1), random_between(1, 40),
                                          random_between(1, 40), random_between(-1, 2)),
                              0);
        t->eps = random_metres(&t->m);
        const double eps = t->eps * random_unit(), above = t->eps * 2;
        place_rectangle(t, eps, -1, -1, t->m.o.side, t->m.o.side);
        place_rectangle(t, above, 0, 0, 5, 5); /* coarser than all: nothing */
        core_rule c;
        core_rule_create(&c, t);
        for (int k = smallest_k(&t->m.grid.lattice); k <= largest_k(&t->m.grid.lattice); k++) {
            size_t plain_count, count;
            key *plain = keys_of_rule(t, k, NULL, rqt_code_eps(eps, 0), &plain_count);
            key *with = keys_of_rule(t, k, c.rule, 0, &count);
            CHECK(count == plain_count && (count == 0 || memcmp(with, plain, count * sizeof *plain) == 0),
                  "%zu triangles by detail, %zu by eps", count, plain_count);
            free(plain);
            free(with);
        }
        core_rule_free(&c);
        trial_free(t);
    }
}

static void bad_arguments_are_refused(void **state) {
    (void)state;
    random_begin("refused");
    rqt_rule *rule;
    const rqt_lattice lattice = {9, 9, 3};
    double lowering[RQT_RANKS] = {0};
    assert_int_equal(rqt_rule_create(&lattice, 0, &test_allocator, &rule), RQT_OK);
    const double bad[] = {-1, NAN, -INFINITY};
    for (size_t n = 0; n < sizeof bad / sizeof *bad; n++) {
        rqt_rule_place place = {NULL, bad[n]};
        assert_int_equal(rqt_rule_set_eps(rule, bad[n]), RQT_INVALID);
        assert_int_equal(rqt_rule_set_places(rule, &place, 1), RQT_INVALID);
        lowering[3] = bad[n];
        assert_int_equal(rqt_rule_set_lowering(rule, lowering), RQT_INVALID);
    }
    lowering[3] = 1; /* falls after it */
    assert_int_equal(rqt_rule_set_lowering(rule, lowering), RQT_INVALID);
    for (int n = 4; n < RQT_RANKS; n++) lowering[n] = 2;
    assert_int_equal(rqt_rule_set_lowering(rule, lowering), RQT_OK);
    assert_int_equal(rqt_rule_set_eps(rule, 1.5), RQT_OK);
    assert_int_equal(rqt_rule_threshold(rule, (rqt_vertex){1, 0}), rqt_code_floor(1.5));
    assert_int_equal(rqt_rule_threshold(rule, (rqt_vertex){2, 2}), rqt_code_floor(0.5));
    assert_int_equal(rqt_rule_threshold(rule, (rqt_vertex){4, 0}), -1);
    assert_true(rqt_rule_selects(rule, (rqt_vertex){4, 0}, 0, false));
    assert_int_equal(rqt_rule_set_eps(rule, INFINITY), RQT_OK);
    assert_int_equal(rqt_rule_threshold(rule, (rqt_vertex){4, 0}), RQT_CODE_LARGEST);
    assert_int_equal(rqt_rule_force(rule, (rqt_vertex){9, 0}), RQT_INVALID);
    assert_int_equal(rqt_rule_force(rule, (rqt_vertex){0, -1}), RQT_INVALID);
    rqt_rule_free(rule);
    rqt_rule_free(NULL);
}

/* A code is 2^-8 of itself wide, so that a double's last bit seldom shows: eps just above a code, and the
 * difference in the middle between it and the double below. */
static void a_lowered_eps_is_rounded_down(void **state) {
    (void)state;
    const rqt_lattice lattice = {9, 9, 3};
    double lowering[RQT_RANKS];
    rqt_rule *rule;
    assert_int_equal(rqt_rule_create(&lattice, 0, &test_allocator, &rule), RQT_OK);
    for (int n = 0; n < RQT_RANKS; n++) lowering[n] = 0x1p-70;
    assert_int_equal(rqt_rule_set_lowering(rule, lowering), RQT_OK);
    for (int code = 1000; code < RQT_CODE_LARGEST; code += 977) {
        const double eps = rqt_code_metres((rqt_code)code);
        if (eps < 0x1p-10 || eps > 1e9) continue;
        assert_int_equal(rqt_rule_set_eps(rule, eps), RQT_OK); /* less a little: no longer this code */
        CHECK(rqt_rule_threshold(rule, (rqt_vertex){1, 1}) == code - 1, "eps %.17g less 2^-70 is code %d, not %d",
              eps, (int)rqt_rule_threshold(rule, (rqt_vertex){1, 1}), code - 1);
    }
    rqt_rule_free(rule);
}

static bool stop_at_once(void *context) {
    ++*(int *)context;
    return true;
}

static void a_long_border_can_be_interrupted(void **state) {
    (void)state;
    static const char text[] = "POLYGON((3.5 2, 30000 700, 22000 29000, 3.5 2))";
    const rqt_lattice lattice = {32769, 32769, 15};
    rqt_geometry *geometry;
    rqt_region *region;
    rqt_rule *rule;
    rqt_message why;
    int asked = 0;
    assert_int_equal(rqt_geometry_parse(text, sizeof text - 1, true, &test_allocator, &geometry, &why), RQT_OK);
    assert_int_equal(rqt_region_create(geometry, &AT_ORIGIN, &lattice, &test_allocator, &region), RQT_OK);
    assert_int_equal(rqt_rule_create(&lattice, 0, &test_allocator, &rule), RQT_OK);
    assert_int_equal(rqt_rule_force_border(rule, region, stop_at_once, &asked), RQT_INTERRUPTED);
    assert_int_equal(asked, 1);
    rqt_rule_free(rule);
    rqt_region_free(region);
    rqt_geometry_free(geometry);
}

/* Every request for memory refused, once and from then on. */
static void without_memory_nothing_is_lost(void **state) {
    (void)state;
    random_begin("memory");
    for (int lasting = 0; lasting < 2; lasting++)
        for (size_t at = 1;; at++) {
            const rqt_lattice lattice = {40, 33, 6};
            static const char text[] = "POLYGON((3.5 2, 30 7, 22 29, 3.5 2))";
            rqt_geometry *geometry = NULL;
            rqt_region *region = NULL;
            rqt_rule *rule = NULL;
            rqt_message why;
            test_heap.fail_from = 0;
            assert_int_equal(rqt_geometry_parse(text, sizeof text - 1, true, &test_allocator, &geometry, &why),
                             RQT_OK);
            assert_int_equal(rqt_region_create(geometry, &AT_ORIGIN, &lattice, &test_allocator, &region), RQT_OK);
            rqt_rule_place places[20];
            for (int n = 0; n < 20; n++) places[n] = (rqt_rule_place){region, n};
            test_heap.calls = test_heap.failures = 0;
            test_heap.fail_from = at;
            test_heap.fail_to = lasting ? SIZE_MAX : at;
            rqt_status status = rqt_rule_create(&lattice, 0, &test_allocator, &rule);
            assert_true((status == RQT_OK) == (rule != NULL));
            if (status == RQT_OK) status = rqt_rule_set_places(rule, places, 20);
            if (status == RQT_OK) status = rqt_rule_force_border(rule, region, NULL, NULL);
            assert_int_equal(status, test_heap.failures ? RQT_NO_MEMORY : RQT_OK);
            const bool reached = test_heap.failures > 0;
            test_heap.fail_from = 0;
            rqt_rule_free(rule);
            rqt_region_free(region);
            rqt_geometry_free(geometry);
            assert_int_equal(test_heap.live, 0);
            if (!reached) break;
        }
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(rules_equal_their_definition_on_small_rasters),
        TEST(rules_equal_their_definition_on_larger_rasters),
        TEST(eps_lowered_by_rank_alone_is_its_definition),
        TEST(borders_force_what_is_mixed_and_no_more),
        TEST(F19_four_eps_at_a_block_corner_meet_without_t_junctions),
        TEST(F20_closure_is_transitive_across_blocks),
        TEST(F24_regions_thinner_than_a_cell_have_a_border_or_are_covered),
        TEST(F26_polygons_with_holes_touching_themselves_or_covered),
        TEST(F27_border_on_odd_coordinates_has_the_regions_area),
        TEST(detail_changes_nothing_beyond_its_reach),
        TEST(detail_over_everything_is_the_mesh_of_its_eps),
        TEST(bad_arguments_are_refused),
        TEST(a_lowered_eps_is_rounded_down),
        TEST(a_long_border_can_be_interrupted),
        TEST(without_memory_nothing_is_lost),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
