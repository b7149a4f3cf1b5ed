/* test_core_field.c - an eps for every square of a field: the tree of squares, and what rules make of it, against
 * the definitions of test_core_trial.h; and the thresholds that are painted for a block, against those that are
 * asked for. */
#include "rule.h"

#include "test_core_trial.h"

static void fields_equal_their_definition_on_small_rasters(void **state) {
    (void)state;
    random_begin("small fields");
    for (int n = 0; n < 200; n++) {
        trial *t = trial_create(random_between(1, 12), random_between(1, 12), n % 4 == 3);
        if (n % 2) t->places = 0;
        if (n % 3) t->forced_count = 0;
        if (n % 3 != 1) t->eps = n % 2 ? INFINITY : 1e12;
        if (n % 5 == 0) t->factor = random_unit() + 0.5;
        give_field(t, 1, random_between(30, 100));
        check_trial(t);
        trial_free(t);
    }
}

static void fields_equal_their_definition_on_larger_rasters(void **state) {
    (void)state;
    random_begin("larger fields");
    for (int n = 0; n < 16; n++) {
        trial *t = trial_create(random_between(17, 40), random_between(17, 40), 0);
        if (n % 4) t->places = t->forced_count = 0;
        t->eps = INFINITY;
        give_field(t, 1 << random_between(0, 3), random_between(50, 100));
        check_trial(t);
        trial_free(t);
    }
}

/* Four squares of very different eps around a corner of blocks of every size, one of them nothing. */
static void F19_four_squares_at_a_block_corner_meet_without_t_junctions(void **state) {
    (void)state;
    random_begin("F19 squares");
    for (int n = 0; n < 4; n++) {
        trial *t =
            trial_over(raster_make(n % 2 ? SURFACE_TAKAGI : SURFACE_HILLS, 65, n < 2 ? 65 : 50, -1), INFINITY);
        const double most = rqt_code_metres((rqt_code)oracle_at(&t->m.o, 32, 32)->code);
        t->square = calloc(4, sizeof *t->square);
        if (!t->square) abort();
        for (int c = 0; c < 4; c++) {
            const double eps[4] = {most / 100, INFINITY, 0, most / 3};
            t->square[t->squares++] = (square){c % 2 * 32, c / 2 * 32, 32, eps[(c + n) % 4], 0};
            t->square[c].used = eps_of_square(t, &t->square[c]);
        }
        check_trial(t);
        trial_free(t);
    }
}

static void a_field_of_one_square_is_the_mesh_of_its_eps(void **state) {
    (void)state;
    random_begin("one square");
    for (int n = 0; n < 24; n++) {
        trial *t = trial_over(raster_make((surface)random_between(0, SURFACE_COUNT - 1), random_between(1, 40),
                                          random_between(1, 40), random_between(-1, 2)),
                              INFINITY);
        const double eps = random_metres(&t->m);
        give_field(t, t->m.o.side, 0);
        assert_int_equal(t->squares, 1);
        t->square[0].eps = eps;
        core_rule c;
        core_rule_create(&c, t);
        for (int k = smallest_k(&t->m.grid.lattice); k <= largest_k(&t->m.grid.lattice); k++) {
            size_t plain_count, count;
            key *plain = keys_of_rule(t, k, NULL, rqt_code_eps(eps, 0), &plain_count);
            key *with = keys_of_rule(t, k, c.rule, 0, &count);
            CHECK(count == plain_count && (count == 0 || memcmp(with, plain, count * sizeof *plain) == 0),
                  "%zu triangles by the field, %zu by eps", count, plain_count);
            free(plain);
            free(with);
        }
        core_rule_free(&c);
        trial_free(t);
    }
}

/* ------------------------------------------------------------------------------------------ the tree -- */

static void squares_come_in_order_and_boxes_find_the_least(void **state) {
    (void)state;
    random_begin("squares");
    size_t nothing = 0, something = 0;
    for (int n = 0; n < 60; n++) {
        trial *t = trial_over(
            raster_make(SURFACE_CONSTANT, random_between(1, 40), random_between(1, 40) / (n % 7 ? 1 : 40) + 1, -1),
            0);
        if (n % 3 == 0) t->factor = random_unit() * 3 + 0.01;
        give_field(t, 1 << random_between(0, 2), random_between(40, 100));
        /* random_metres finds no errors here */
        for (square *s = t->square; s < t->square + t->squares; s++) {
            s->eps = random_between(0, 4) ? random_unit() * 100 : random_between(0, 1) ? INFINITY : 0;
            s->used = eps_of_square(t, s);
        }
        rqt_field *field = core_field_create(t);
        rqt_square at;
        double eps;
        assert_int_equal(rqt_field_count(field), t->squares);
        for (int i = 0; i < t->squares; i++) {
            const square *s = &t->square[i];
            assert_true(rqt_field_square(field, (size_t)i, &at, &eps));
            CHECK(at.x == s->x && at.y == s->y && at.side == s->side && eps == s->used,
                  "square %d is (%d,%d), side %d, eps %.17g; should be (%d,%d), %d, %.17g", i, at.x, at.y, at.side,
                  eps, s->x, s->y, s->side, s->used);
        }
        assert_false(rqt_field_square(field, (size_t)t->squares, &at, &eps));
        for (int i = 0; i < 200; i++) {
            const int side = t->m.o.side - 1, x0 = random_between(-5, side + 3), y0 = random_between(-5, side + 3),
                      x1 = x0 + random_between(i % 8 ? 1 : -2, side / 2 + 2),
                      y1 = y0 + random_between(1, side / 2 + 2);
            double least = INFINITY;
            for (const square *s = t->square; s < t->square + t->squares && x0 < x1; s++)
                if (s->x < x1 && s->x + s->side > x0 && s->y < y1 && s->y + s->side > y0 && s->used < least)
                    least = s->used;
            const double got = rqt_field_least(field, x0, y0, x1, y1);
            CHECK(got == least, "(%d,%d) to (%d,%d): the least is %.17g, should be %.17g", x0, y0, x1, y1, got,
                  least);
            nothing += isinf(least) != 0;
            something += !isinf(least);
        }
        rqt_field_free(field);
        trial_free(t);
    }
    CHECK(nothing > 100 && something > 3000, "%zu boxes without an eps, %zu with one", nothing, something);
}

static rqt_field_step decide_one(void *context, rqt_square s, double *eps) {
    (void)s;
    *eps = *(const double *)context;
    return RQT_FIELD_LEAF;
}

/* A code is 2^-7 of itself wide, so that the last bit of a product seldom shows: products just beside codes. */
static void a_scaled_eps_is_rounded_down(void **state) {
    (void)state;
    random_begin("scaled");
    const rqt_lattice lattice = {2, 2, 0};
    mpq_t exact, factor_exact;
    mpq_inits(exact, factor_exact, NULL);
    size_t exactly = 0;
    for (int n = 0; n < 4000; n++) {
        rqt_field *field;
        const double code = rqt_code_metres((rqt_code)random_between(32000, 35000));
        double eps = (float)(random_unit() * 1000 + 1e-3), factor = code / eps;
        for (int step = random_between(-1, 1); step != 0; step = 0)
            factor = nextafter(factor, step < 0 ? 0 : INFINITY);
        if (n % 9 == 0) eps = code, factor = 1;
        if (n % 9 == 1) eps = nextafter(code, 0), factor = 1;
        if (n % 9 == 2) eps = 1e300, factor = 1e-200; /* no float is as large */
        assert_int_equal(rqt_field_create(&lattice, &test_allocator, decide_one, &eps, &field), RQT_OK);
        assert_int_equal(rqt_field_scale(field, factor), RQT_OK);
        float f = (float)eps;
        if (f > eps) f = nextafterf(f, 0);
        mpq_set_d(exact, f);
        mpq_set_d(factor_exact, factor);
        mpq_mul(exact, exact, factor_exact);
        const double want = rqt_code_metres((rqt_code)oracle_code_down(exact)),
                     got = rqt_field_least(field, 0, 0, 1, 1);
        CHECK(got == want, "%.17g times %.17g is %.17g, should be %.17g", eps, factor, got, want);
        exactly += want == code;
        rqt_field_free(field);
    }
    mpq_clears(exact, factor_exact, NULL);
    CHECK(exactly > 500 && exactly < 3500, "%zu products of 4000 are a code", exactly);
}

typedef struct answering {
    rqt_field_step step[2]; /* of larger squares, of those of side 1 */
    double eps;
} answering;

static rqt_field_step answer_with(void *context, rqt_square s, double *eps) {
    const answering *a = context;
    *eps = a->eps;
    return a->step[s.side == 1];
}

static void bad_answers_and_fields_are_refused(void **state) {
    (void)state;
    static const struct {
        answering answer;
        rqt_status status;
    } cases[] = {
        {{{RQT_FIELD_LEAF, RQT_FIELD_LEAF}, 1}, RQT_OK},
        {{{RQT_FIELD_SPLIT, RQT_FIELD_LEAF}, 0}, RQT_OK},
        {{{RQT_FIELD_SPLIT, RQT_FIELD_SPLIT}, 1}, RQT_INVALID},
        {{{RQT_FIELD_SPLIT, RQT_FIELD_FAIL}, 1}, RQT_READ_FAILED},
        {{{RQT_FIELD_FAIL, RQT_FIELD_LEAF}, 1}, RQT_READ_FAILED},
        {{{RQT_FIELD_LEAF, RQT_FIELD_LEAF}, NAN}, RQT_INVALID},
        {{{RQT_FIELD_SPLIT, RQT_FIELD_LEAF}, -1}, RQT_INVALID},
        {{{(rqt_field_step)7, RQT_FIELD_LEAF}, 1}, RQT_INVALID},
    };
    const rqt_lattice lattice = {8, 5, 3}, wider = {9, 5, 3};
    for (size_t n = 0; n < sizeof cases / sizeof *cases; n++) {
        answering a = cases[n].answer;
        rqt_field *field = (rqt_field *)&a;
        CHECK(rqt_field_create(&lattice, &test_allocator, answer_with, &a, &field) == cases[n].status, "case %zu",
              n);
        assert_true((field != NULL) == (cases[n].status == RQT_OK));
        if (field) {
            static const double bad[] = {0, -1, NAN, INFINITY};
            for (size_t i = 0; i < 4; i++) assert_int_equal(rqt_field_scale(field, bad[i]), RQT_INVALID);
            assert_true(rqt_field_least(field, 0, 0, 8, 8) == a.eps);
            rqt_rule *rule;
            assert_int_equal(rqt_rule_create(&wider, 0, &test_allocator, &rule), RQT_OK);
            assert_int_equal(rqt_rule_set_field(rule, field), RQT_INVALID);
            rqt_rule_free(rule);
            assert_int_equal(rqt_rule_create(&lattice, 0, &test_allocator, &rule), RQT_OK);
            assert_int_equal(rqt_rule_set_eps(rule, 9), RQT_OK);
            assert_int_equal(rqt_rule_set_field(rule, field), RQT_OK);
            assert_int_equal(rqt_rule_threshold(rule, (rqt_vertex){1, 2}), rqt_code_floor(a.eps));
            assert_int_equal(rqt_field_scale(field, 2), RQT_OK);
            assert_int_equal(rqt_rule_threshold(rule, (rqt_vertex){1, 2}), rqt_code_floor(2 * a.eps));
            assert_int_equal(rqt_rule_set_field(rule, NULL), RQT_OK);
            assert_int_equal(rqt_rule_threshold(rule, (rqt_vertex){1, 2}), rqt_code_floor(9));
            rqt_rule_free(rule);
        }
        rqt_field_free(field);
    }
    rqt_field_free(NULL);
}

/* --------------------------------------------------------------------------------------------- blocks -- */

typedef struct scattering {
    int share, finest;
    double eps;
} scattering;

/* Squares of any size, eps over some octaves, here and there 0 or nothing. */
static rqt_field_step scatter(void *context, rqt_square s, double *eps) {
    const scattering *sc = context;
    if (s.side > sc->finest && random_between(0, 99) < sc->share) return RQT_FIELD_SPLIT;
    *eps = random_between(0, 9) ? sc->eps * (0.1 + random_unit()) : random_between(0, 1) ? INFINITY : 0;
    return RQT_FIELD_LEAF;
}

static void painted_limits_are_the_thresholds_that_are_asked_for(void **state) {
    (void)state;
    random_begin("limits");
    size_t all = 0, kinds[3] = {0};
    for (int n = 0; n < 60; n++) {
        rqt_lattice lattice;
        rqt_field *field;
        rqt_rule *rule;
        const int K = random_between(1, 10), side = 1 << K;
        assert_int_equal(
            rqt_lattice_init(&lattice, side / 2 + random_between(2, side / 2 + 1), side / (1 << n % 3) + 1),
            RQT_OK);
        scattering sc = {random_between(60, 97), 1 << random_between(0, K < 6 ? K : 5), random_unit() * 50};
        assert_int_equal(rqt_field_create(&lattice, &test_allocator, scatter, &sc, &field), RQT_OK);
        const double quantum_error = n % 4 ? 0 : sc.eps * random_unit() / 8;
        assert_int_equal(rqt_rule_create(&lattice, quantum_error, &test_allocator, &rule), RQT_OK);
        assert_int_equal(rqt_rule_set_eps(rule, n % 5 ? INFINITY : sc.eps * 0.7), RQT_OK);
        assert_int_equal(rqt_rule_set_field(rule, field), RQT_OK);
        if (n % 3 == 0) {
            double lowering[RQT_RANKS];
            for (int rank = 0; rank < RQT_RANKS; rank++) lowering[rank] = sc.eps * rank * random_unit() / 40;
            for (int rank = 1; rank < RQT_RANKS; rank++)
                if (lowering[rank] < lowering[rank - 1]) lowering[rank] = lowering[rank - 1];
            assert_int_equal(rqt_rule_set_lowering(rule, lowering), RQT_OK);
        }
        for (int time = 0; time < 8; time++) {
            const int k = random_between(0, lattice.K < RQT_MAX_BLOCK_K ? lattice.K : RQT_MAX_BLOCK_K),
                      level = random_between(0, lattice.K - k), across = (1 << k) + 1;
            rqt_block_place p;
            if (rqt_block_locate(&lattice, k,
                                 rqt_block_number_of(level, random_between(0, (1 << level) - 1),
                                                     random_between(0, (1 << level) - 1)),
                                 &p) != RQT_OK)
                continue;
            /* exactly the room there is: the sanitizer sees what is written past it */
            uint16_t *limits = calloc((size_t)(across * across), sizeof *limits),
                     *room = malloc(rule_limits_room(k) * sizeof *room);
            if (!limits || !room) abort();
            rule_limits(rule, &p, k, limits, room);
            for (int i = 0; i < across * across; i++) {
                const int u = i % across, v = i / across;
                if ((u == 0 || u == across - 1) && (v == 0 || v == across - 1)) continue;
                const rqt_vertex at = {p.x + u * p.stride, p.y + v * p.stride};
                const int32_t want = rqt_rule_threshold(rule, at);
                CHECK(limits[i] == want + 1,
                      "K %d, k %d, block at (%d,%d), stride %d, vertex (%d,%d): %d, should be %d", lattice.K, k,
                      p.x, p.y, p.stride, u, v, limits[i], want + 1);
                all++;
                kinds[want < 0 ? 0 : want == RQT_CODE_LARGEST ? 1 : 2]++;
            }
            free(limits);
            free(room);
        }
        rqt_rule_free(rule);
        rqt_field_free(field);
    }
    CHECK(all > 100000 && kinds[0] > 100 && kinds[1] > 100 && kinds[2] > 10000,
          "%zu vertices: %zu below 0, %zu of no bound, %zu others", all, kinds[0], kinds[1], kinds[2]);
}

/* Every request for memory refused, once and from then on: a field, and a query with it. */
static void without_memory_nothing_is_lost(void **state) {
    (void)state;
    random_begin("memory of fields");
    for (int lasting = 0; lasting < 2; lasting++)
        for (size_t at = 1;; at++) {
            random_begin("memory of fields");
            trial *t = trial_over(raster_make(SURFACE_HILLS, 20, 17, -1), INFINITY);
            give_field(t, 1, 90);
            database d;
            rqt_rule *rule = NULL;
            rqt_field *field = NULL;
            rqt_patch patch = {0};
            const window all = window_all();
            test_heap.fail_from = 0;
            rqt_region *region = region_of(&all, &t->m.grid.lattice);
            assert_int_equal(database_create(&d, &t->m, 3, &test_allocator), RQT_OK);
            assert_int_equal(rqt_rule_create(&t->m.grid.lattice, 0, &test_allocator, &rule), RQT_OK);
            assert_int_equal(rqt_rule_set_eps(rule, INFINITY), RQT_OK);
            deciding said = {t, 0, 0};
            test_heap.calls = test_heap.failures = 0;
            test_heap.fail_from = at;
            test_heap.fail_to = lasting ? SIZE_MAX : at;
            rqt_status status = rqt_field_create(&t->m.grid.lattice, &test_allocator, decide_square, &said, &field);
            assert_true((status == RQT_OK) == (field != NULL));
            if (status == RQT_OK) {
                assert_int_equal(rqt_rule_set_field(rule, field), RQT_OK);
                d.rule = rule;
                status =
                    database_query(&d, region, 0, RQT_SELECT_THRESHOLD, RQT_OUTLINE_EXACT, &test_allocator, &patch);
            }
            assert_int_equal(status, test_heap.failures ? RQT_NO_MEMORY : RQT_OK);
            const bool reached = test_heap.failures > 0;
            test_heap.fail_from = 0;
            if (status == RQT_OK) assert_true(patch.triangle_count > 0);
            rqt_patch_free(&patch);
            rqt_field_free(field);
            rqt_rule_free(rule);
            rqt_region_free(region);
            database_free(&d, &test_allocator);
            trial_free(t);
            assert_int_equal(test_heap.live, 0);
            if (!reached) break;
        }
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(fields_equal_their_definition_on_small_rasters),
        TEST(fields_equal_their_definition_on_larger_rasters),
        TEST(F19_four_squares_at_a_block_corner_meet_without_t_junctions),
        TEST(a_field_of_one_square_is_the_mesh_of_its_eps),
        TEST(squares_come_in_order_and_boxes_find_the_least),
        TEST(a_scaled_eps_is_rounded_down),
        TEST(bad_answers_and_fields_are_refused),
        TEST(painted_limits_are_the_thresholds_that_are_asked_for),
        TEST(without_memory_nothing_is_lost),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
