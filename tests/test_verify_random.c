/* test_verify_random.c - what the verifier promises beyond meshes made by hand: exact at the ends of the
 * coordinates and heights, the error the double nearest to the exact value, agreement with the slow check on random
 * triangles and triangulations, and an end at the caps and beyond memory. */
#include "test_verify_support.h"

__extension__ typedef __int128 wide;

/* ---- the limits ---- */

/* From one end of the coordinates to the other, and from the lowest height to the highest. */
static void the_longest_triangle_is_exact(void **state) {
    (void)state;
    enum { END = (1 << 21) - 1, TOP = (1 << 30) - 1 };
    int32_t width = 2 * END + 1;
    int32_t *q = calloc(2 * (size_t)width, sizeof *q);
    assert_non_null(q);
    for (int upright = 0; upright < 2; upright++) {
        verify_samples samples = {.col0 = upright ? -1 : -END,
                                  .row0 = upright ? -END : -1,
                                  .width = upright ? 2 : width,
                                  .height = upright ? width : 2,
                                  .q = q,
                                  .quantum = 0.5,
                                  .cell_x = 2,
                                  .cell_y = 3};
        verify_triangle t = {{{END, 0, TOP}, {END, -1, TOP}, {-END, -1, -TOP}}};
        if (upright) t = (verify_triangle){{{-1, END, TOP}, {0, END, TOP}, {-1, -END, -TOP}}};
        memset(q, 0, 2 * (size_t)width * sizeof *q);
        /* The sample one before the end of the line from -TOP to TOP: the plane there is TOP - TOP / END. */
        q[upright ? 2 * (2 * END - 1) : 2 * END - 1] = INT32_MIN;
        verify_report r;
        assert_int_equal(verify_mesh(&samples, &t, 1, &r), VERIFY_OK);
        assert_int_equal(r.samples, (uint64_t)width + 1);
        assert_int_equal(r.twice_area, 2 * END);
        assert_int_equal(r.overlaps, 0);
        /* (2^31 + TOP - TOP / END) / 2, with TOP / END = 512 + 511 / END. */
        wide numerator = ((wide)1 << 31) * END + (wide)TOP * END - TOP;
        assert_true(r.max_error == (double)numerator / (2.0 * END)); /* both exact, so rounded once */
        assert_int_equal(upright ? r.worst_row : r.worst_col, END - 1);
        assert_int_equal(upright ? r.worst_col : r.worst_row, -1);
    }
    free(q);
}

/* Boxes of 2^20 cells and more are measured with 128 bits: one just below that and one just above must be measured
 * alike. */
static void large_triangles_are_measured_like_small_ones(void **state) {
    (void)state;
    enum { HIGH = (1 << 30) - 1, LENGTH = 1 << 14 };
    for (size_t k = 0; k < 2; k++) {
        int32_t length = LENGTH, rows = k == 0 ? 64 : 65; /* 63 and 64 cells high */
        int32_t *q = malloc((size_t)(length + 1) * (size_t)rows * sizeof *q);
        uint8_t *valid = malloc((size_t)(length + 1) * (size_t)rows);
        assert_non_null(q);
        assert_non_null(valid);
        for (size_t j = 0; j < (size_t)(length + 1) * (size_t)rows; j++) {
            q[j] = -HIGH;
            valid[j] = 1;
        }
        int32_t west = -((1 << 21) - 1);
        verify_samples samples = {.col0 = west,
                                  .row0 = 7,
                                  .width = length + 1,
                                  .height = rows,
                                  .q = q,
                                  .valid = valid,
                                  .quantum = 1,
                                  .cell_x = 1,
                                  .cell_y = 1};
        int32_t north = 7, south = 7 + rows - 1, east = west + length;
        verify_triangle t = {{{west, north, -HIGH}, {west, south, -HIGH}, {east, north, -HIGH}}};
        verify_report r;
        size_t second_row = (size_t)(length + 1);
        q[second_row + 5] = INT32_MAX; /* off by more than 2^31 */
        q[second_row + 6] = INT32_MIN;
        valid[second_row + 6] = 0;
        assert_int_equal(verify_mesh(&samples, &t, 1, &r), VERIFY_OK);
        double off = (double)INT32_MAX + HIGH;
        assert_true(r.max_error == off);
        assert_int_equal(r.worst_col, west + 5);
        assert_int_equal(r.worst_row, 8);
        assert_true(fabs(r.rms_error / (off / sqrt((double)r.samples)) - 1) < 1e-12);
        /* Row by row floor(length * (1 - row / last)) + 1 samples, one of them void. */
        uint64_t expected = 0;
        for (int64_t row = 0; row < rows; row++) {
            expected += (uint64_t)((int64_t)length * (rows - 1 - row) / (rows - 1)) + 1;
        }
        assert_int_equal(r.samples, expected - 1);
        free(q);
        free(valid);
    }
}

/* ---- an error against a threshold ---- */

static uint64_t random_state;

static uint32_t any(uint32_t below) {
    random_state = random_state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)((random_state >> 33) % below);
}

static int32_t between(int32_t low, int32_t high) {
    return low + (int32_t)any((uint32_t)(high - low + 1));
}

static void the_error_is_the_double_nearest_to_the_exact_value(void **state) {
    (void)state;
    random_state = 1;
    for (int k = 0; k < 20000; k++) {
        scene s;
        start_scene(&s, SIDE, SIDE);
        /* The only sample that is not void is at column x of row 0, under an edge that falls from `fall` to 0. */
        memset(s.valid, 0, sizeof s.valid);
        int32_t width = between(1, SIDE - 1), x = between(0, width), fall = between(-1000, 1000);
        s.valid[x] = 1;
        s.q[x] = between(-1000, 1000);
        s.samples.quantum = ldexp(1.0 + any(1u << 30) * 0x1p-30 + any(1u << 22) * 0x1p-52, between(-300, 300));
        if (k % 4 == 0) s.samples.quantum = (double)between(1, 1000) / 1000;
        s.triangle[0] = (verify_triangle){{{0, 0, fall}, {0, 1, 0}, {width, 0, 0}}};
        s.n = 1;
        double found = verified(&s).max_error;

        int64_t numerator = (int64_t)s.q[x] * width - (int64_t)fall * (width - x);
        if (numerator < 0) numerator = -numerator;
        if (numerator == 0) {
            assert_true(found == 0);
            continue;
        }
        /* found = f * 2^b and quantum = m * 2^e with 53-bit integers f and m: compare in units of half a last
         * place. */
        int b, e;
        int64_t f = (int64_t)ldexp(frexp(found, &b), 53), m = (int64_t)ldexp(frexp(s.samples.quantum, &e), 53);
        wide exact = (wide)numerator * m, rounded = (wide)f * width, half = width;
        assert_in_range(b - e + 40, 0, 80);
        /* Twice the distance is at most one last place, which is `half` here. */
        wide distance = b >= e ? exact - (rounded << (b - e)) : (exact << (e - b)) - rounded;
        if (b >= e) half <<= b - e;
        if (distance < 0) distance = -distance;
        assert_true(2 * distance <= half);
    }
}

static void an_error_equal_to_the_threshold_never_reads_above_it(void **state) {
    (void)state;
    /* 7/7 of a quantum in sevenths is exactly one quantum, 21/7 three: also for a quantum like 0.1. */
    for (int32_t width = 1; width < SIDE; width++) {
        for (int32_t height = 1; height < 100; height++) {
            scene s;
            start_scene(&s, SIDE, SIDE);
            memset(s.valid, 0, sizeof s.valid);
            s.samples.quantum = 0.1;
            s.valid[width - 1] = 1; /* the plane is `height` there, the sample 0 */
            s.triangle[0] = (verify_triangle){{{0, 0, height * width}, {0, 1, 0}, {width, 0, 0}}};
            s.n = 1;
            assert_true(verified(&s).max_error == 0.1 * height);
        }
    }
}

/* ---- against the slow check ---- */

/* Heights of a few steps make ties; of many, large fractions. */
static void start_random_scene(scene *s, uint32_t height_range, uint32_t void_share) {
    start_scene(s, between(2, SIDE), between(2, SIDE));
    s->samples.col0 = between(-20, 20);
    s->samples.row0 = between(-20, 20);
    s->samples.quantum = 0.125;
    s->samples.is_promised = promise_all;
    for (size_t k = 0; k < SIDE * SIDE; k++) {
        s->q[k] = (int32_t)any(height_range) - (int32_t)(height_range / 2);
        s->valid[k] = any(100) >= void_share;
    }
}

static verify_corner random_corner(const scene *s, int32_t around_col, int32_t around_row, int32_t reach) {
    const verify_samples *w = &s->samples;
    int32_t col = between(around_col - reach, around_col + reach),
            row = between(around_row - reach, around_row + reach);
    col = col < w->col0 ? w->col0 : col >= w->col0 + w->width ? w->col0 + w->width - 1 : col;
    row = row < w->row0 ? w->row0 : row >= w->row0 + w->height ? w->row0 + w->height - 1 : row;
    return corner(s, col, row);
}

static void it_agrees_with_the_slow_check_on_random_triangles(void **state) {
    (void)state;
    random_state = 2;
    for (int k = 0; k < 3000; k++) {
        scene s;
        start_random_scene(&s, k % 3 == 0 ? 3 : 1 << 20, k % 2 == 0 ? 0 : 20);
        s.n = any(13);
        for (size_t t = 0; t < s.n; t++) {
            int32_t reach = between(0, SIDE);
            verify_corner middle = random_corner(&s, s.samples.col0, s.samples.row0, SIDE);
            for (int j = 0; j < 3; j++) {
                s.triangle[t].corner[j] = random_corner(&s, middle.col, middle.row, reach);
                if (any(20) == 0) s.triangle[t].corner[j].q += between(-1, 1);
            }
        }
        assert_agrees(&s);
    }
}

/* Replaces triangle t, whose edge from corner k to the next holds p or which holds p inside, by two or three. */
static void split_triangle(scene *s, size_t t, const verify_corner *p) {
    verify_triangle old = s->triangle[t];
    bool replaced = false;
    for (int k = 0; k < 3; k++) {
        verify_triangle part = {{old.corner[k], old.corner[(k + 1) % 3], *p}};
        if (turn(&part.corner[0], &part.corner[1], &part.corner[2]) == 0) continue;
        assert_true(s->n < MOST);
        if (replaced) s->triangle[s->n++] = part;
        if (!replaced) s->triangle[t] = part;
        replaced = true;
    }
}

static void insert_corner(scene *s, const verify_corner *p) {
    size_t n = s->n;
    for (size_t t = 0; t < n; t++) {
        int64_t weight[3];
        weigh(&s->triangle[t], p, weight);
        int zeros = (weight[0] == 0) + (weight[1] == 0) + (weight[2] == 0);
        bool inside = weight[0] >= 0 && weight[1] >= 0 && weight[2] >= 0;
        if (inside && zeros < 2) split_triangle(s, t, p);
    }
}

static void start_random_triangulation(scene *s) {
    start_random_scene(s, 1 << 16, 0);
    const verify_samples *w = &s->samples;
    int32_t west = w->col0, east = west + w->width - 1, north = w->row0, south = north + w->height - 1;
    add(s, west, north, west, south, east, north);
    add(s, east, north, west, south, east, south);
    for (uint32_t k = any(20); k > 0; k--) {
        verify_corner p = random_corner(s, west + w->width / 2, north + w->height / 2, SIDE);
        insert_corner(s, &p);
    }
}

static void a_random_triangulation_is_without_fault_until_it_is_damaged(void **state) {
    (void)state;
    random_state = 3;
    for (int k = 0; k < 1500; k++) {
        scene s;
        start_random_triangulation(&s);
        assert_agrees(&s);
        verify_report r = verified(&s);
        uint64_t cells = (uint64_t)(s.samples.width - 1) * (uint64_t)(s.samples.height - 1);
        assert_int_equal(r.t_junctions, 0);
        assert_int_equal(r.overlaps, 0);
        assert_int_equal(r.uncovered, 0);
        assert_int_equal(r.twice_area, 2 * cells);
        assert_int_equal(r.samples, s.samples.width * s.samples.height);

        size_t t = any((uint32_t)s.n);
        verify_corner *c = &s.triangle[t].corner[any(3)];
        switch (k % 4) {
        case 0: /* a hole */
            s.triangle[t] = s.triangle[--s.n];
            break;
        case 1: /* a corner of one triangle moved */
            *c = random_corner(&s, c->col, c->row, 3);
            break;
        case 2: /* a triangle twice, under the other one's number */
            s.triangle[t] = s.triangle[any((uint32_t)s.n)];
            break;
        default: /* one side of an edge split, the other not */
            split_triangle(&s, t, &(verify_corner){c->col, c->row + (c->row == s.samples.row0), c->q});
        }
        assert_agrees(&s);
    }
}

/* A huge triangle beside many small ones, and small ones under it: every size of grid cell is asked. */
static void triangles_of_very_different_size_are_compared(void **state) {
    (void)state;
    enum { WIDTH = 600, CELLS = WIDTH - 1 };
    int32_t *q = calloc((size_t)WIDTH * WIDTH, sizeof *q);
    verify_triangle *t = malloc(2 * (size_t)WIDTH * sizeof *t);
    assert_non_null(q);
    assert_non_null(t);
    for (int32_t north = 0; north <= 300; north += 50) {
        size_t n = 0;
        t[n++] = (verify_triangle){{{0, 0, 0}, {0, CELLS, 0}, {CELLS, 0, 0}}};
        /* A row of unit triangles; those west of the long edge are under the huge one. */
        for (int32_t col = 0; col < CELLS; col++) {
            t[n++] = (verify_triangle){{{col, north, 0}, {col, north + 1, 0}, {col + 1, north, 0}}};
        }
        verify_samples samples = {.width = WIDTH, .height = WIDTH, .q = q, .quantum = 1, .cell_x = 1, .cell_y = 1};
        verify_report r;
        assert_int_equal(verify_mesh(&samples, t, n, &r), VERIFY_OK);
        assert_int_equal(r.overlaps, CELLS - north);
        /* On the huge one's edges: the first of each row below the first, its lower end, and where the long edge
         * passes the row's upper and lower side; for the first row all between its ends, its lower end, and one at
         * the lower side. */
        assert_int_equal(r.t_junctions, north == 0 ? CELLS - 1 + 1 + 1 : 4);
    }
    free(q);
    free(t);
}

static void everything_in_one_place_stops_at_the_cap(void **state) {
    (void)state;
    enum { COUNT = 3000 };
    scene s;
    start_scene(&s, 16, 16);
    verify_triangle *t = malloc(COUNT * sizeof *t);
    assert_non_null(t);
    for (size_t k = 0; k < COUNT; k++) {
        t[k] = (verify_triangle){{{0, 0, 0}, {0, 9, 0}, {9, 0, 0}}};
    }
    verify_report r;
    assert_int_equal(verify_mesh(&s.samples, t, 1000, &r), VERIFY_OK);
    assert_int_equal(r.overlaps, 1000 * 999 / 2);
    t[0] = (verify_triangle){{{0, 0, 0}, {9, 0, 0}, {0, 9, 0}}};
    assert_int_equal(verify_mesh(&s.samples, t, COUNT, &r), VERIFY_OK);
    assert_int_equal(r.overlaps, 1000000 + 1);
    assert_int_equal(r.t_junctions, 0);
    free(t);
}

static void repeated_t_junctions_are_one_and_stop_at_the_cap(void **state) {
    (void)state;
    enum { LONGEST = 1500, TIMES = 3 };
    int32_t *q = calloc(2 * (LONGEST + 1), sizeof *q);
    verify_triangle *t = malloc((size_t)LONGEST * TIMES * sizeof *t);
    assert_non_null(q);
    assert_non_null(t);
    verify_samples samples = {.width = LONGEST + 1, .height = 2, .q = q, .quantum = 1, .cell_x = 1, .cell_y = 1};
    /* All have an edge from (0,0) along row 0, to 1, 2, 3, ...: each such edge holds the ends of the shorter ones.
     * Three times over, that is more than fits without merging what repeats. */
    static const int32_t lengths[] = {1414, LONGEST};
    for (size_t k = 0; k < 2; k++) {
        size_t n = 0;
        for (int32_t length = 1; length <= lengths[k]; length++) {
            for (int time = 0; time < TIMES; time++) {
                t[n++] = (verify_triangle){{{0, 0, 0}, {0, 1, 0}, {length, 0, 0}}};
            }
        }
        verify_report r;
        assert_int_equal(verify_mesh(&samples, t, n, &r), VERIFY_OK);
        assert_int_equal(r.t_junctions, k == 0 ? 1414 * 1413 / 2 : 1000000);
    }
    free(q);
    free(t);
}

static void a_window_beyond_memory_is_no_memory(void **state) {
    (void)state;
    int32_t q = 0;
    verify_samples samples = {.width = INT32_MAX, .height = INT32_MAX, .q = &q, .quantum = 1};
    verify_report r;
    assert_int_equal(verify_mesh(&samples, NULL, 0, &r), VERIFY_NO_MEMORY);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_longest_triangle_is_exact),
        cmocka_unit_test(large_triangles_are_measured_like_small_ones),
        cmocka_unit_test(the_error_is_the_double_nearest_to_the_exact_value),
        cmocka_unit_test(an_error_equal_to_the_threshold_never_reads_above_it),
        cmocka_unit_test(it_agrees_with_the_slow_check_on_random_triangles),
        cmocka_unit_test(a_random_triangulation_is_without_fault_until_it_is_damaged),
        cmocka_unit_test(triangles_of_very_different_size_are_compared),
        cmocka_unit_test(everything_in_one_place_stops_at_the_cap),
        cmocka_unit_test(repeated_t_junctions_are_one_and_stop_at_the_cap),
        cmocka_unit_test(a_window_beyond_memory_is_no_memory),
    };
    return cmocka_run_group_tests_name("verify_random", tests, NULL, NULL);
}
