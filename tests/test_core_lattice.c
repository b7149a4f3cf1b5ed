/* test_core_lattice.c - the dependency graph, the exact errors and the closed sets equal the oracle's.
 *
 * The oracle reads the graph off the triangles, sums errors over all samples in rationals, and closes sets by
 * repetition; the core may do none of that and must agree on every vertex. */
#include "test_core_support.h"

/* ----------------------------------------------------------------------------------------- lattice -- */

static void the_root_square_is_the_smallest_that_holds_the_raster(void **state) {
    (void)state;
    rqt_lattice l;
    for (int width = 1; width <= 70; width++) {
        for (int height = 1; height <= 70; height++) {
            int K = 0;
            while ((1 << K) + 1 < width || (1 << K) + 1 < height) K++;
            assert_int_equal(rqt_lattice_init(&l, width, height), RQT_OK);
            assert_int_equal(l.K, K);
            assert_int_equal(l.width, width);
            assert_int_equal(l.height, height);
        }
    }
    const int64_t most = (1 << RQT_MAX_K) + 1;
    assert_int_equal(rqt_lattice_init(&l, most, 1), RQT_OK);
    assert_int_equal(l.K, RQT_MAX_K);
    assert_int_equal(rqt_lattice_init(&l, 1, most), RQT_OK);
    assert_int_equal(l.K, RQT_MAX_K);
    assert_int_equal(rqt_lattice_init(&l, (1 << (RQT_MAX_K - 1)) + 1, 2), RQT_OK);
    assert_int_equal(l.K, RQT_MAX_K - 1);
    const int64_t bad[][2] = {{0, 1},        {1, 0},         {-1, 5},       {most + 1, 1},
                              {1, most + 1}, {INT64_MAX, 1}, {1, INT64_MIN}};
    for (size_t n = 0; n < sizeof bad / sizeof *bad; n++)
        assert_int_equal(rqt_lattice_init(&l, bad[n][0], bad[n][1]), RQT_INVALID);
}

static int holds(const rqt_vertex *list, int count, oracle_point p) {
    int found = 0;
    for (int n = 0; n < count; n++) found += list[n].x == p.x && list[n].y == p.y;
    return found;
}

/* Over all triangles: the ends of what the split vertex halves. */
static void check_ends(const rqt_lattice *l, const oracle_triangle *t) {
    oracle_triangle child[2];
    rqt_vertex ends[2];
    if (!oracle_children(t, child)) return;
    const oracle_point split = child[0].corner[0];
    assert_int_equal(rqt_vertex_ends(l, (rqt_vertex){split.x, split.y}, ends), 2);
    CHECK(holds(ends, 2, t->corner[1]) == 1 && holds(ends, 2, t->corner[2]) == 1, "the ends of (%d,%d)", split.x,
          split.y);
    for (int c = 0; c < 2; c++) check_ends(l, &child[c]);
}

static void a_vertex_halves_the_edge_between_its_ends(void **state) {
    (void)state;
    for (int K = 0; K <= 6; K++) {
        const int side = (1 << K) + 1;
        int *q = calloc((size_t)(side * side), sizeof *q);
        const oracle_terrain terrain = {side, side, q, NULL, 1.0, 1, 1, 1, 1.0, 1.0};
        oracle o;
        rqt_lattice l;
        rqt_vertex ends[2];
        oracle_create_bare(&o, &terrain);
        assert_int_equal(rqt_lattice_init(&l, side, side), RQT_OK);
        for (int half = 0; half < 2; half++) {
            const oracle_triangle t = oracle_root_half(&o, half);
            check_ends(&l, &t);
        }
        for (int c = 0; c < 4; c++)
            assert_int_equal(rqt_vertex_ends(&l, (rqt_vertex){c & 1 ? side - 1 : 0, c & 2 ? side - 1 : 0}, ends),
                             0);
        oracle_free(&o);
        free(q);
    }
}

static void parents_children_and_levels_equal_the_oracles_graph(void **state) {
    (void)state;
    random_begin("graph");
    for (int K = 0; K <= 5; K++) {
        for (int clamped = 0; clamped < 2; clamped++) {
            int width = (1 << K) + 1, height = clamped ? random_between(1, width) : width;
            oracle o;
            oracle_terrain terrain = {width, height, NULL, NULL, 1.0, 1, 1, 1, 1.0, 1.0};
            int *q = calloc((size_t)(width * height), sizeof *q);
            terrain.q = q;
            oracle_create(&o, &terrain);
            rqt_lattice l;
            assert_int_equal(rqt_lattice_init(&l, width, height), RQT_OK);
            for (int y = 0; y < o.side; y++) {
                for (int x = 0; x < o.side; x++) {
                    const rqt_vertex v = {x, y};
                    const oracle_node *n = oracle_at(&o, x, y);
                    const oracle_point at = {x, y}, sample = oracle_clamp(&o, at);
                    rqt_vertex list[4];
                    CHECK(rqt_vertex_level(&l, v) == n->level, "K=%d: level of (%d,%d) is not %d", K, x, y,
                          n->level);
                    CHECK(rqt_vertex_scale(&l, v) == K - n->level, "K=%d: scale of (%d,%d)", K, x, y);
                    int count = rqt_vertex_parents(&l, v, list);
                    CHECK(count == n->parent_count, "K=%d: (%d,%d) has %d parents", K, x, y, count);
                    for (int m = 0; m < count; m++)
                        CHECK(holds(list, count, n->parent[m]) == 1, "K=%d: a parent of (%d,%d)", K, x, y);
                    count = rqt_vertex_children(&l, v, list);
                    CHECK(count == n->child_count, "K=%d: (%d,%d) has %d children, should be %d", K, x, y, count,
                          n->child_count);
                    for (int m = 0; m < count; m++)
                        CHECK(holds(list, count, n->child[m]) == 1, "K=%d: a child of (%d,%d)", K, x, y);
                    const rqt_vertex clamp = rqt_vertex_clamp(&l, v);
                    CHECK(clamp.x == sample.x && clamp.y == sample.y, "clamp of (%d,%d)", x, y);
                }
            }
            oracle_free(&o);
            free(q);
        }
    }
}

/* No oracle is that large; parents and children must agree with each other up to the largest lattice. */
static void F47_the_largest_lattice_is_consistent(void **state) {
    (void)state;
    random_begin("largest lattice");
    rqt_lattice l;
    const int32_t side = 1 << RQT_MAX_K;
    assert_int_equal(rqt_lattice_init(&l, side + 1, side + 1), RQT_OK);
    for (int n = 0; n < 100000; n++) {
        int grain = random_between(0, RQT_MAX_K);
        const rqt_vertex v = {random_between(0, side >> grain) << grain, random_between(0, side >> grain) << grain};
        rqt_vertex parent[2], child[4], back[4];
        int level = rqt_vertex_level(&l, v), parents = rqt_vertex_parents(&l, v, parent);
        assert_int_equal(rqt_vertex_scale(&l, v) + level, RQT_MAX_K);
        assert_true(level >= 0 && (level > 0) == (parents > 0));
        for (int m = 0; m < parents; m++) {
            const oracle_point self = {v.x, v.y};
            assert_true(rqt_vertex_level(&l, parent[m]) <= level);
            assert_int_equal(holds(back, rqt_vertex_children(&l, parent[m], back), self), 1);
        }
        int children = rqt_vertex_children(&l, v, child);
        for (int m = 0; m < children; m++) {
            const oracle_point self = {v.x, v.y};
            assert_int_equal(holds(back, rqt_vertex_parents(&l, child[m], back), self), 1);
        }
    }
}

/* ------------------------------------------------------------------------------------------ errors -- */

static void errors_equal_the_oracles_for_every_small_extent(void **state) {
    (void)state;
    random_begin("extents");
    const int voids[] = {-1, 3, 30, 90, 100};
    for (int width = 1; width <= 20; width++)
        for (int height = 1; height <= 20; height++)
            for (int n = 0; n < 5; n++)
                check_errors_equal_oracle(raster_make(SURFACE_NOISE, width, height, voids[n]));
}

static void errors_equal_the_oracles_on_adversarial_surfaces(void **state) {
    (void)state;
    random_begin("surfaces");
    const int sides[][2] = {{65, 65}, {33, 33}, {64, 65}, {40, 17}, {3, 50}};
    for (int s = 0; s < SURFACE_COUNT; s++) {
        for (size_t n = 0; n < sizeof sides / sizeof *sides; n++) {
            check_errors_equal_oracle(raster_make((surface)s, sides[n][0], sides[n][1], -1));
            raster r = raster_make((surface)s, sides[n][1], sides[n][0], n == 0 ? -1 : random_between(0, 5));
            raster_add_lake(&r);
            check_errors_equal_oracle(r);
        }
    }
}

static void errors_equal_the_oracles_in_feet_and_in_thousandths(void **state) {
    (void)state;
    random_begin("units");
    const rqt_unit units[] = {UNIT_METRE, UNIT_FOOT, UNIT_SURVEY_FOOT, UNIT_MILLIMETRE, UNIT_ODD};
    for (int u = 0; u < 5; u++) {
        for (int n = 0; n < 6; n++) {
            raster r = raster_make(SURFACE_HILLS, random_between(10, 40), random_between(10, 40), n == 0 ? -1 : 0);
            r.unit = units[u];
            if (n % 2) raster_add_lake(&r);
            check_errors_equal_oracle(r);
        }
    }
}

static void errors_past_the_last_sample_are_exact(void **state) {
    (void)state;
    random_begin("past");
    /* just over a power of two: half of the lattice lies past the raster, and wide triangles straddle its end */
    const int sides[][2] = {{34, 34}, {34, 3}, {2, 34}, {18, 33}, {66, 5}, {67, 35}, {1, 40}, {40, 1}, {48, 7}};
    for (size_t n = 0; n < sizeof sides / sizeof *sides; n++)
        for (int voids = -1; voids <= 9; voids += 5)
            for (int s = 0; s < 2; s++)
                check_errors_equal_oracle(
                    raster_make(s ? SURFACE_EXTREMES : SURFACE_HILLS, sides[n][0], sides[n][1], voids));
}

static void errors_of_long_and_narrow_rasters_are_exact(void **state) {
    (void)state;
    random_begin("narrow");
    /* the widest triangles that the oracle can take: clamped ones have the square of their width as denominator */
    check_errors_equal_oracle(raster_make(SURFACE_EXTREMES, 270, 4, -1));
    check_errors_equal_oracle(raster_make(SURFACE_HILLS, 3, 200, 0));
}

/* The diamond of a triangle's split vertex is the triangle and its mirror image in the hypotenuse. */
static void check_diamond(const oracle *o, const rqt_errors *raw, const oracle_triangle *t) {
    const oracle_point l = t->corner[1], r = t->corner[2];
    oracle_triangle other = *t;
    mpq_t error, part;
    int mixed, other_mixed = 0;
    bool outline;
    mpq_inits(error, part, NULL);
    oracle_triangle_error(o, t, error, &mixed);
    other.corner[0] = (oracle_point){l.x + r.x - t->corner[0].x, l.y + r.y - t->corner[0].y};
    if (other.corner[0].x >= 0 && other.corner[0].y >= 0 && other.corner[0].x < o->side &&
        other.corner[0].y < o->side)
        oracle_triangle_error(o, &other, part, &other_mixed);
    if (mpq_cmp(part, error) > 0) mpq_set(error, part);
    const rqt_vertex m = {(l.x + r.x) / 2, (l.y + r.y) / 2};
    unsigned code = rqt_errors_at(raw, m, &outline), right = oracle_code_up(error);
    CHECK(code == right && outline == (mixed || other_mixed),
          "%dx%d: (%d,%d) has code %u outline %d, should be %u %d", o->terrain.width, o->terrain.height, m.x, m.y,
          code, outline, right, mixed || other_mixed);
    mpq_clears(error, part, NULL);
}

static void check_large_raster(raster r, int descents, int first_depth) {
    const oracle_terrain terrain = {r.width,          r.height,           r.q,      r.valid,     r.unit.scale,
                                    r.unit.numerator, r.unit.denominator, r.unit.d, r.cost.cell, r.cost.c};
    oracle o;
    rqt_errors raw;
    rqt_grid grid = {.q = r.q, .valid = r.valid};
    oracle_create_bare(&o, &terrain);
    assert_int_equal(rqt_lattice_init(&grid.lattice, r.width, r.height), RQT_OK);
    assert_int_equal(rqt_errors_compute(&grid, &r.unit, &r.cost, &test_allocator, NULL, NULL, &raw), RQT_OK);
    int s = o.side - 1;
    for (int n = 0; n < descents; n++) {
        oracle_triangle t = {{{s, 0}, {0, 0}, {s, s}}, 0};
        if (random_between(0, 1)) t = (oracle_triangle){{{0, s}, {s, s}, {0, 0}}, 0};
        for (; t.depth < 2 * o.K; t.depth++) {
            if (n == 0 || t.depth >= first_depth) check_diamond(&o, &raw, &t);
            const oracle_point m = {(t.corner[1].x + t.corner[2].x) / 2, (t.corner[1].y + t.corner[2].y) / 2};
            const oracle_triangle child[2] = {{{m, t.corner[0], t.corner[1]}, t.depth},
                                              {{m, t.corner[2], t.corner[0]}, t.depth}};
            int which = random_between(0, 1);
            t = child[oracle_area(&o, &child[which]) != 0 ? which : !which]; /* stay over the raster */
        }
    }
    rqt_errors_free(&raw, &test_allocator);
    oracle_free(&o);
    raster_free(&r);
}

static void errors_of_rasters_beyond_the_oracles_lattice_are_exact_where_we_look(void **state) {
    (void)state;
    random_begin("large");
    /* sums of 2^31 times the square of a leg need more than 64 bits only where legs are long */
    check_large_raster(raster_make(SURFACE_EXTREMES, 40000, 2, -1), 8, 0);
    check_large_raster(raster_make(SURFACE_EXTREMES, 3, 33000, -1), 6, 0);
    check_large_raster(raster_make(SURFACE_HILLS, 20000, 3, 0), 6, 0);
    check_large_raster(raster_make(SURFACE_EXTREMES, 513, 513, -1), 40, 5);
    raster r = raster_make(SURFACE_HILLS, 700, 450, -1);
    raster_add_lake(&r);
    check_large_raster(r, 40, 5);
}

static void F2_planes_of_odd_slopes_have_no_error_anywhere(void **state) {
    (void)state;
    random_begin("plane");
    for (int n = 0; n < 60; n++) {
        raster r =
            raster_make(n % 4 ? SURFACE_PLANE : SURFACE_CONSTANT, random_between(1, 70), random_between(1, 70), -1);
        rqt_errors errors;
        rqt_grid grid = {.q = r.q};
        assert_int_equal(rqt_lattice_init(&grid.lattice, r.width, r.height), RQT_OK);
        assert_int_equal(rqt_errors_compute(&grid, &r.unit, &r.cost, &test_allocator, NULL, NULL, &errors), RQT_OK);
        rqt_errors_saturate(&errors);
        int side = 1 << grid.lattice.K;
        for (int y = 0; y <= side; y++) {
            for (int x = 0; x <= side; x++) {
                bool outline, corner = x % side == 0 && y % side == 0;
                rqt_code code = rqt_errors_at(&errors, (rqt_vertex){x, y}, &outline);
                CHECK(code == (corner ? RQT_CODE_INFINITY : 0) && !outline, "%dx%d: (%d,%d) has code %u", r.width,
                      r.height, x, y, code);
            }
        }
        rqt_errors_free(&errors, &test_allocator);
        raster_free(&r);
    }
}

static void values_at_voids_do_not_matter(void **state) {
    (void)state;
    random_begin("void values");
    for (int n = 0; n < 20; n++) {
        raster r = raster_make(SURFACE_HILLS, random_between(2, 30), random_between(2, 30), 20);
        rqt_errors one, two;
        rqt_grid grid = {.q = r.q, .valid = r.valid};
        assert_int_equal(rqt_lattice_init(&grid.lattice, r.width, r.height), RQT_OK);
        assert_int_equal(rqt_errors_compute(&grid, &r.unit, &r.cost, &test_allocator, NULL, NULL, &one), RQT_OK);
        for (int m = 0; m < r.width * r.height; m++)
            if (!r.valid[m]) r.q[m] = n % 2 ? INT32_MIN : INT32_MAX;
        assert_int_equal(rqt_errors_compute(&grid, &r.unit, &r.cost, &test_allocator, NULL, NULL, &two), RQT_OK);
        size_t count = (size_t)one.columns * (size_t)one.rows;
        assert_memory_equal(one.code, two.code, count * sizeof *one.code);
        assert_memory_equal(one.outline, two.outline, count);
        rqt_errors_free(&one, &test_allocator);
        rqt_errors_free(&two, &test_allocator);
        raster_free(&r);
    }
}

typedef struct watch {
    double done;
    int calls, stop_at;
} watch;

static bool watch_progress(void *context, double done) {
    watch *w = context;
    w->calls++;
    CHECK(done >= w->done && done <= 1, "progress went from %.17g to %.17g", w->done, done);
    w->done = done;
    return w->calls != w->stop_at;
}

static void errors_can_be_stopped_and_leave_nothing(void **state) {
    (void)state;
    random_begin("stop");
    raster r = raster_make(SURFACE_HILLS, 65, 65, -1);
    rqt_grid grid = {.q = r.q};
    rqt_errors errors;
    watch w = {0, 0, 0};
    assert_int_equal(rqt_lattice_init(&grid.lattice, 65, 65), RQT_OK);
    assert_int_equal(rqt_errors_compute(&grid, &r.unit, &r.cost, &test_allocator, watch_progress, &w, &errors),
                     RQT_OK);
    rqt_errors_free(&errors, &test_allocator);
    assert_true(w.calls > 0);
    for (int stop = 1; stop <= w.calls; stop++) {
        watch again = {0, 0, stop};
        assert_int_equal(
            rqt_errors_compute(&grid, &r.unit, &r.cost, &test_allocator, watch_progress, &again, &errors),
            RQT_INTERRUPTED);
        assert_int_equal(again.calls, stop);
        assert_int_equal(test_heap.live, 0);
        rqt_errors_free(&errors, &test_allocator);
    }
    raster_free(&r);
}

/* --------------------------------------------------------------------------------------- selection -- */

static void check_selection(const model *m, const rqt_selection *selection, const unsigned char *set,
                            const char *how, unsigned eps) {
    size_t count = 0;
    for (int y = 0; y < m->o.side; y++) {
        for (int x = 0; x < m->o.side; x++) {
            bool has = rqt_selection_has(selection, (rqt_vertex){x, y}), right = set[y * m->o.side + x] != 0;
            if (has != right) raster_print(&m->r);
            CHECK(has == right, "%s, eps code %u: (%d,%d) is %s", how, eps, x, y, has ? "in" : "not in");
            count += right;
        }
    }
    CHECK(rqt_selection_count(selection) == count - 4, "%s: count is %zu, should be %zu", how,
          rqt_selection_count(selection), count - 4);
}

static int ordered_codes(const void *a, const void *b) {
    return (int)*(const unsigned *)a - (int)*(const unsigned *)b;
}

/* eps at, just below and just above stored errors, 0 and infinity. Returns how many. */
static int eps_of(const model *m, unsigned eps[16]) {
    int count = 0;
    eps[count++] = 0;
    eps[count++] = ORACLE_LARGEST;
    for (int n = 0; n < 4; n++) {
        unsigned code = oracle_at(&m->o, random_between(0, m->o.side - 1), random_between(0, m->o.side - 1))->code;
        if (code == 0 || code > ORACLE_LARGEST) continue;
        eps[count++] = code;
        eps[count++] = code - 1;
        if (code < ORACLE_LARGEST) eps[count++] = code + 1;
    }
    qsort(eps, (size_t)count, sizeof *eps, ordered_codes);
    return count;
}

static void check_all_selections_agree(raster r) {
    model m;
    model_create(&m, r);
    /* Without its outline bits, a threshold on errors alone is what `tol` selects. */
    unsigned eps[16];
    int count = eps_of(&m, eps);
    unsigned char *threshold = oracle_set_create(&m.o), *closed = oracle_set_create(&m.o);
    for (int n = 0; n < count; n++) {
        oracle_select(&m.o, eps[n], 1, threshold);
        oracle_select_raw(&m.o, eps[n], 1, closed);
        assert_memory_equal(threshold, closed, (size_t)(m.o.side * m.o.side));
        for (int way = 0; way < 4; way++) {
            rqt_selection *s;
            const rqt_errors *errors = way & 1 ? &m.saturated : &m.raw;
            assert_int_equal(rqt_selection_create(&m.grid.lattice, &test_allocator, &s), RQT_OK);
            assert_int_equal((way & 2 ? rqt_select_bottom_up : rqt_select_top_down)(errors, (rqt_code)eps[n], s),
                             RQT_OK);
            const char *const names[] = {"top down, raw", "top down, saturated", "bottom up, raw",
                                         "bottom up, saturated"};
            check_selection(&m, s, closed, names[way], eps[n]);
            rqt_selection_free(s);
        }
    }
    free(threshold);
    free(closed);
    model_free(&m);
}

static void algorithms_1_and_2_and_a_threshold_select_the_same(void **state) {
    (void)state;
    random_begin("selections");
    for (int n = 0; n < 250; n++) {
        int side = n % 10 == 0 ? 40 : 20;
        check_all_selections_agree(raster_make((surface)random_between(0, SURFACE_COUNT - 1),
                                               random_between(1, side), random_between(1, side),
                                               random_between(-1, 10)));
    }
    check_all_selections_agree(raster_make(SURFACE_TAKAGI, 65, 65, -1));
    check_all_selections_agree(raster_make(SURFACE_NOISE, 65, 50, 1));
}

static void closures_of_random_vertices_equal_the_oracles(void **state) {
    (void)state;
    random_begin("closures");
    for (int n = 0; n < 300; n++) {
        model m;
        model_create(&m, raster_make(SURFACE_CONSTANT, random_between(1, 40), random_between(1, 40), -1));
        unsigned char *set = oracle_set_create(&m.o);
        rqt_selection *resolved, *swept;
        assert_int_equal(rqt_selection_create(&m.grid.lattice, &test_allocator, &resolved), RQT_OK);
        assert_int_equal(rqt_selection_create(&m.grid.lattice, &test_allocator, &swept), RQT_OK);
        oracle_close(&m.o, set);
        check_selection(&m, resolved, set, "nothing", 0);
        for (int batch = 0; batch < 3; batch++) { /* the second and third add to a closed set */
            rqt_vertex some[12];
            int count = random_between(0, 12);
            for (int v = 0; v < count; v++) {
                some[v] = (rqt_vertex){random_between(0, m.o.side - 1), random_between(0, m.o.side - 1)};
                if (v > 0 && random_between(0, 5) == 0) some[v] = some[v - 1]; /* twice is once */
                set[some[v].y * m.o.side + some[v].x] = 1;
                assert_int_equal(rqt_selection_add_resolved(resolved, some[v]), RQT_OK);
            }
            assert_int_equal(rqt_selection_add_bottom_up(swept, some, (size_t)count), RQT_OK);
            oracle_close(&m.o, set);
            check_selection(&m, resolved, set, "resolved", 0);
            check_selection(&m, swept, set, "bottom up", 0);
        }
        rqt_selection_free(resolved);
        rqt_selection_free(swept);
        free(set);
        model_free(&m);
    }
}

static void selections_grow_as_eps_shrinks_and_hold_every_bit_at_infinity(void **state) {
    (void)state;
    random_begin("nested");
    for (int n = 0; n < 20; n++) {
        model m;
        raster r = raster_make(SURFACE_HILLS, random_between(10, 40), random_between(10, 40), -1);
        raster_add_lake(&r);
        model_create(&m, r);
        unsigned eps[16];
        int count = eps_of(&m, eps);
        size_t before = (size_t)(m.o.side * m.o.side);
        for (int e = 0; e < count; e++) {
            rqt_selection *s;
            assert_int_equal(rqt_selection_create(&m.grid.lattice, &test_allocator, &s), RQT_OK);
            assert_int_equal(rqt_select_top_down(&m.raw, (rqt_code)eps[e], s), RQT_OK);
            assert_true(rqt_selection_count(s) <= before);
            before = rqt_selection_count(s);
            for (int v = 0; v < m.o.side * m.o.side; v++)
                if (m.o.node[v].outline)
                    assert_true(rqt_selection_has(s, (rqt_vertex){v % m.o.side, v / m.o.side}));
            rqt_selection_free(s);
        }
        model_free(&m);
    }
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(the_root_square_is_the_smallest_that_holds_the_raster),
        TEST(parents_children_and_levels_equal_the_oracles_graph),
        TEST(a_vertex_halves_the_edge_between_its_ends),
        TEST(F47_the_largest_lattice_is_consistent),
        TEST(errors_equal_the_oracles_for_every_small_extent),
        TEST(errors_equal_the_oracles_on_adversarial_surfaces),
        TEST(errors_equal_the_oracles_in_feet_and_in_thousandths),
        TEST(errors_past_the_last_sample_are_exact),
        TEST(errors_of_long_and_narrow_rasters_are_exact),
        TEST(errors_of_rasters_beyond_the_oracles_lattice_are_exact_where_we_look),
        TEST(F2_planes_of_odd_slopes_have_no_error_anywhere),
        TEST(values_at_voids_do_not_matter),
        TEST(errors_can_be_stopped_and_leave_nothing),
        TEST(algorithms_1_and_2_and_a_threshold_select_the_same),
        TEST(closures_of_random_vertices_equal_the_oracles),
        TEST(selections_grow_as_eps_shrinks_and_hold_every_bit_at_infinity),
    };
    return cmocka_run_group_tests_name("lattice, errors and selections", tests, NULL, NULL);
}
