/* test_verify.c - what the verifier promises: known answers on meshes made by hand, and agreement with a slow check
 * on random ones. The slow check uses integers only and other methods than the verifier: barycentric signs instead
 * of row intervals, half-plane intersection instead of separating edges, all pairs instead of grids. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <math.h>
#include <cmocka.h>

#include "verify.h"

__extension__ typedef __int128 wide;

enum { SIDE = 16, MOST = 200 };

/* A window of up to SIDE * SIDE samples and up to MOST triangles. */
typedef struct scene {
    int32_t q[SIDE * SIDE];
    uint8_t valid[SIDE * SIDE];
    verify_samples samples;
    verify_triangle triangle[MOST];
    size_t n;
} scene;

static void start_scene(scene *s, int32_t width, int32_t height) {
    memset(s, 0, sizeof *s);
    memset(s->valid, 1, sizeof s->valid);
    s->samples = (verify_samples){
        .width = width, .height = height, .q = s->q, .valid = s->valid, .quantum = 1, .cell_x = 1, .cell_y = -1};
}

static size_t at(const scene *s, int32_t col, int32_t row) {
    return (size_t)((row - s->samples.row0) * s->samples.width + (col - s->samples.col0));
}

static verify_corner corner(const scene *s, int32_t col, int32_t row) {
    return (verify_corner){.col = col, .row = row, .q = s->q[at(s, col, row)]};
}

/* Corners get the heights of their samples. The order is the caller's. */
static void add(scene *s, int32_t ac, int32_t ar, int32_t bc, int32_t br, int32_t cc, int32_t cr) {
    assert_true(s->n < MOST);
    s->triangle[s->n++] = (verify_triangle){{corner(s, ac, ar), corner(s, bc, br), corner(s, cc, cr)}};
}

/* Two triangles over the square with its north-west corner at col, row. */
static void add_square(scene *s, int32_t col, int32_t row, int32_t size) {
    add(s, col, row, col, row + size, col + size, row);
    add(s, col + size, row, col, row + size, col + size, row + size);
}

static verify_report verified(const scene *s) {
    verify_report report;
    memset(&report, 0xA5, sizeof report);
    assert_int_equal(verify_mesh(&s->samples, s->triangle, s->n, &report), VERIFY_OK);
    return report;
}

static bool promise_all(void *context, int32_t col, int32_t row) {
    (void)context, (void)col, (void)row;
    return true;
}

/* ---- known answers ---- */

static void a_flat_square_is_without_fault(void **state) {
    (void)state;
    scene s;
    start_scene(&s, 5, 5);
    s.samples.is_promised = promise_all;
    add_square(&s, 0, 0, 4);
    verify_report r = verified(&s);
    assert_int_equal(r.samples, 25);
    assert_int_equal(r.vertices, 4);
    assert_int_equal(r.triangles, 2);
    assert_true(r.max_error == 0 && r.rms_error == 0);
    assert_int_equal(r.worst_col, 0);
    assert_int_equal(r.worst_row, 0);
    assert_int_equal(r.t_junctions, 0);
    assert_int_equal(r.overlaps, 0);
    assert_int_equal(r.uncovered, 0);
    assert_int_equal(r.void_touched, 0);
    assert_int_equal(r.twice_area, 32);
    assert_true(r.area == 16);
}

static void a_tilted_plane_has_no_error(void **state) {
    (void)state;
    scene s;
    start_scene(&s, 9, 9);
    for (int32_t k = 0; k < 81; k++) {
        s.q[k] = 7 * (k % 9) - 5 * (k / 9) - 100;
    }
    add_square(&s, 0, 0, 8);
    assert_true(verified(&s).max_error == 0);
}

static void a_missed_pit_is_found_where_it_is(void **state) {
    (void)state;
    scene s;
    start_scene(&s, 5, 5);
    s.samples.col0 = -7;
    s.samples.row0 = 20;
    s.samples.quantum = 0.25;
    s.q[at(&s, -4, 21)] = -10;
    add_square(&s, -7, 20, 4);
    verify_report r = verified(&s);
    assert_true(r.max_error == 2.5);
    assert_int_equal(r.worst_col, -4);
    assert_int_equal(r.worst_row, 21);
    assert_true(fabs(r.rms_error - 0.5) < 1e-12); /* sqrt(2.5^2 / 25) */
}

static void an_error_between_corners_is_a_fraction(void **state) {
    (void)state;
    scene s;
    start_scene(&s, 4, 4);
    s.q[at(&s, 3, 0)] = 1; /* the plane is 1/3 at column 1 and 2/3 at column 2 */
    add(&s, 0, 0, 0, 3, 3, 0);
    verify_report r = verified(&s);
    assert_true(r.max_error == 2.0 / 3.0);
    assert_int_equal(r.worst_col, 2);
    assert_int_equal(r.worst_row, 0);
}

static void of_equal_errors_the_first_in_row_order_is_named(void **state) {
    (void)state;
    scene s;
    start_scene(&s, 9, 5);
    s.q[at(&s, 6, 1)] = 5;
    s.q[at(&s, 1, 1)] = -5;
    s.q[at(&s, 2, 3)] = 5;
    add_square(&s, 4, 0, 4); /* the later place is measured first */
    add_square(&s, 0, 0, 4);
    verify_report r = verified(&s);
    assert_true(r.max_error == 5);
    assert_int_equal(r.worst_col, 1);
    assert_int_equal(r.worst_row, 1);

    s.q[at(&s, 1, 1)] = 0;
    s.q[at(&s, 6, 1)] = -5; /* now (6,1) comes before (2,3), which is measured later */
    r = verified(&s);
    assert_int_equal(r.worst_col, 6);
    assert_int_equal(r.worst_row, 1);
}

static void a_sample_of_two_triangles_counts_once_with_its_larger_error(void **state) {
    (void)state;
    scene s;
    start_scene(&s, 5, 5);
    s.q[at(&s, 2, 2)] = 6; /* on the edge both share */
    add_square(&s, 0, 0, 4);
    for (int k = 0; k < 2; k++) { /* one of them 2 quanta higher everywhere: errors 2 there, 4 and 6 on the edge */
        for (int j = 0; j < 3; j++) {
            s.triangle[k].corner[j].q += k == 1 ? 2 : 0;
        }
    }
    verify_report r = verified(&s);
    assert_int_equal(r.samples, 25);
    assert_true(r.max_error == 6);
    /* 15 samples in the raised triangle have 2, but for the middle one, which has 6 from the other. */
    assert_true(fabs(r.rms_error - sqrt((14 * 4 + 36) / 25.0)) < 1e-12);
}

static void voids_have_no_error_and_touching_one_is_counted(void **state) {
    (void)state;
    scene s;
    start_scene(&s, 5, 5);
    s.samples.is_promised = promise_all;
    add_square(&s, 0, 0, 4);
    s.valid[at(&s, 1, 1)] = 0;
    s.q[at(&s, 1, 1)] = INT32_MIN;
    verify_report r = verified(&s);
    assert_int_equal(r.samples, 24);
    assert_int_equal(r.void_touched, 0);
    assert_int_equal(r.uncovered, 0);
    assert_true(r.max_error == 0);

    s.valid[at(&s, 4, 0)] = 0; /* a corner of both triangles is one sample */
    r = verified(&s);
    assert_int_equal(r.void_touched, 1);
    assert_int_equal(r.samples, 23);
}

static void a_t_junction_is_found_once(void **state) {
    (void)state;
    scene s;
    start_scene(&s, 9, 5);
    add_square(&s, 0, 0, 4);
    add(&s, 4, 0, 4, 2, 8, 0); /* the east side of the square is met at (4,2) */
    add(&s, 8, 0, 4, 2, 8, 4);
    add(&s, 4, 2, 4, 4, 8, 4);
    verify_report r = verified(&s);
    assert_int_equal(r.t_junctions, 1);
    assert_int_equal(r.overlaps, 0);
    assert_int_equal(r.vertices, 7);
}

static void a_t_junction_on_a_shared_edge_is_found_once(void **state) {
    (void)state;
    scene s;
    start_scene(&s, 9, 9);
    add_square(&s, 0, 0, 6); /* the diagonal has both its triangles, and passes (2,4) */
    add(&s, 2, 4, 2, 5, 3, 4);
    assert_int_equal(verified(&s).t_junctions, 1);
}

static void a_t_junction_on_a_steep_edge_is_found(void **state) {
    (void)state;
    scene s;
    start_scene(&s, 16, 16);
    add(&s, 0, 0, 6, 15, 15, 0);  /* the west edge passes (2,5) and (4,10) */
    add(&s, 0, 5, 4, 10, 2, 5);   /* both are corners here */
    add(&s, 10, 5, 10, 6, 12, 5); /* (10,5) is inside, but on no edge; (12,5) is on the east edge: 15 - 9/15*5 */
    verify_report r = verified(&s);
    assert_int_equal(r.t_junctions, 3);
}

static void the_third_corner_of_a_flat_triangle_is_no_t_junction(void **state) {
    (void)state;
    scene s;
    start_scene(&s, 5, 5);
    add(&s, 0, 0, 2, 0, 4, 0);
    assert_int_equal(verified(&s).t_junctions, 0);
    add(&s, 1, 0, 1, 1, 2, 0); /* (1,0) is in two of its edges */
    assert_int_equal(verified(&s).t_junctions, 2);
    add(&s, 0, 0, 0, 4, 4, 0); /* and here (1,0) and (2,0) are in the long one, once more only for the second */
    assert_int_equal(verified(&s).t_junctions, 3);
}

static void a_vertical_crack_is_counted(void **state) {
    (void)state;
    scene s;
    start_scene(&s, 5, 5);
    add_square(&s, 0, 0, 4);
    s.triangle[1].corner[0].q = 3;
    assert_int_equal(verified(&s).t_junctions, 1);
    s.triangle[1].corner[1].q = -3;
    assert_int_equal(verified(&s).t_junctions, 2);
    add(&s, 4, 0, 3, 2, 4, 4);
    s.triangle[2].corner[0].q = 9; /* 0, 3, 9 at one place: three pairs, and one at the other place */
    assert_int_equal(verified(&s).t_junctions, 4);
    add(&s, 4, 0, 3, 2, 4, 4);
    s.triangle[3].corner[0].q = 9; /* a height seen before makes no new pair */
    assert_int_equal(verified(&s).t_junctions, 4);
}

static void overlapping_triangles_are_counted_in_pairs(void **state) {
    (void)state;
    scene s;
    start_scene(&s, 16, 16);
    add(&s, 0, 0, 0, 8, 8, 0);
    add(&s, 1, 1, 1, 9, 9, 1);
    assert_int_equal(verified(&s).overlaps, 1);
    add(&s, 0, 0, 0, 8, 8, 0); /* the first once more: with the first, and with the second */
    assert_int_equal(verified(&s).overlaps, 3);
    add(&s, 1, 12, 1, 14, 3, 12); /* apart */
    assert_int_equal(verified(&s).overlaps, 3);
    add(&s, 8, 0, 0, 8, 8, 8); /* the other half of the first's square: only the second is in its way */
    assert_int_equal(verified(&s).overlaps, 4);
}

static void a_small_triangle_in_a_large_one_overlaps_it(void **state) {
    (void)state;
    scene s;
    start_scene(&s, 16, 16);
    add(&s, 0, 0, 0, 15, 15, 0);
    add(&s, 4, 4, 4, 5, 5, 4);       /* no edges cross */
    add(&s, 14, 14, 14, 15, 15, 14); /* in the large one's box, not in it */
    assert_int_equal(verified(&s).overlaps, 1);
}

static void triangles_that_cross_without_a_common_sample_overlap(void **state) {
    (void)state;
    scene s;
    start_scene(&s, 8, 8);
    add(&s, 0, 0, 7, 6, 1, 0);
    add(&s, 0, 2, 1, 2, 7, 1);
    verify_report r = verified(&s);
    assert_int_equal(r.overlaps, 1);
    assert_int_equal(r.samples, 8 + 3); /* none is in both */
}

static void a_clockwise_triangle_is_a_fault(void **state) {
    (void)state;
    scene s;
    start_scene(&s, 5, 5);
    add(&s, 0, 0, 4, 0, 0, 4);
    s.q[at(&s, 1, 1)] = 8;
    verify_report r = verified(&s);
    assert_int_equal(r.overlaps, 1);
    assert_int_equal(r.samples, 15); /* measured and covered all the same */
    assert_true(r.max_error == 8);
    assert_int_equal(r.twice_area, 16);
    add(&s, 0, 0, 0, 4, 4, 0); /* on it, the right way round */
    assert_int_equal(verified(&s).overlaps, 2);
}

static void a_triangle_of_no_area_is_a_fault_and_covers_nothing(void **state) {
    (void)state;
    scene s;
    start_scene(&s, 5, 5);
    s.samples.is_promised = promise_all;
    add(&s, 0, 0, 2, 2, 4, 4);
    add(&s, 3, 3, 3, 3, 3, 3);
    verify_report r = verified(&s);
    assert_int_equal(r.overlaps, 2);
    assert_int_equal(r.uncovered, 25);
    assert_int_equal(r.samples, 0);
    assert_int_equal(r.twice_area, 0);
    add_square(&s, 0, 0, 4); /* no interior, so it is on nobody's */
    assert_int_equal(verified(&s).overlaps, 2);
}

typedef struct promise {
    int asked[SIDE * SIDE];
    int32_t col0, row0, width;
} promise;

static bool promise_even_columns(void *context, int32_t col, int32_t row) {
    promise *p = context;
    p->asked[(row - p->row0) * p->width + col - p->col0]++;
    return col % 2 == 0;
}

static void promised_samples_outside_all_triangles_are_uncovered(void **state) {
    (void)state;
    scene s;
    start_scene(&s, 7, 7);
    s.samples.col0 = 10;
    s.samples.row0 = -30;
    promise p = {.col0 = 10, .row0 = -30, .width = 7};
    s.samples.is_promised = promise_even_columns;
    s.samples.context = &p;
    add(&s, 10, -30, 10, -24, 16, -30); /* the half with the diagonal; the other one is missing */
    verify_report r = verified(&s);
    /* Below the diagonal in columns 0, 2, 4, 6 of the window: 0 + 2 + 4 + 6. */
    assert_int_equal(r.uncovered, 12);
    for (int k = 0; k < 49; k++) {
        assert_int_equal(p.asked[k], 1);
    }
    s.valid[at(&s, 16, -24)] = 0; /* promised is promised, void or not */
    assert_int_equal(verified(&s).uncovered, 12);
    s.samples.is_promised = NULL;
    assert_int_equal(verified(&s).uncovered, 0);
}

static void the_area_is_in_crs_units_whatever_the_signs_of_the_cell(void **state) {
    (void)state;
    scene s;
    start_scene(&s, 5, 5);
    add_square(&s, 0, 0, 4);
    add(&s, 0, 0, 0, 1, 1, 0);
    for (int k = 0; k < 4; k++) {
        s.samples.cell_x = k % 2 == 0 ? 0.5 : -0.5;
        s.samples.cell_y = k / 2 == 0 ? 30 : -30;
        verify_report r = verified(&s);
        assert_int_equal(r.twice_area, 33);
        assert_true(r.area == 16.5 * 15);
    }
}

static void an_empty_mesh_covers_nothing(void **state) {
    (void)state;
    scene s;
    start_scene(&s, 3, 2);
    s.samples.is_promised = promise_all;
    verify_report r;
    assert_int_equal(verify_mesh(&s.samples, NULL, 0, &r), VERIFY_OK);
    assert_int_equal(r.uncovered, 6);
    assert_int_equal(r.samples, 0);
    assert_true(r.max_error == 0 && r.rms_error == 0 && r.area == 0);
    s.samples.width = 0;
    s.samples.q = NULL;
    assert_int_equal(verify_mesh(&s.samples, NULL, 0, &r), VERIFY_OK);
    assert_int_equal(r.uncovered, 0);
}

static void assert_invalid(const scene *s) {
    static const verify_report zeros;
    verify_report r;
    memset(&r, 0xA5, sizeof r);
    assert_int_equal(verify_mesh(&s->samples, s->triangle, s->n, &r), VERIFY_INVALID);
    assert_memory_equal(&r, &zeros, sizeof r);
}

static void unsound_input_is_refused_with_an_empty_report(void **state) {
    (void)state;
    static const int32_t outside[][2] = {{-1, 0}, {0, -1}, {5, 0}, {0, 5}, {INT32_MAX, 0}, {0, INT32_MIN}};
    scene good, s;
    start_scene(&good, 5, 5);
    add_square(&good, 0, 0, 4);
    verified(&good);
    for (size_t k = 0; k < sizeof outside / sizeof outside[0]; k++) {
        s = good;
        s.samples.q = s.q;
        s.triangle[1].corner[2].col = outside[k][0];
        s.triangle[1].corner[2].row = outside[k][1];
        assert_invalid(&s);
    }
    s = good;
    s.triangle[0].corner[0].q = 1 << 30;
    assert_invalid(&s);
    s = good;
    s.samples.col0 = s.triangle[0].corner[0].col = 1 << 21;
    assert_invalid(&s);
    s = good;
    s.samples.quantum = 0;
    assert_invalid(&s);
    s.samples.quantum = (double)NAN;
    assert_invalid(&s);
    s = good;
    s.samples.q = NULL;
    assert_invalid(&s);
    s = good;
    s.samples.width = -5;
    assert_invalid(&s);
    s = good;
    s.samples.col0 = INT32_MAX - 2;
    assert_invalid(&s);
    assert_int_equal(verify_mesh(NULL, good.triangle, good.n, &(verify_report){0}), VERIFY_INVALID);
}

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

typedef struct slow_report {
    uint64_t samples, vertices, t_junctions, overlaps, uncovered, void_touched, twice_area;
    int64_t numerator, denominator; /* the largest error in quanta; 0 / 1 without samples */
    int32_t worst_col, worst_row;
    double square_sum;
} slow_report;

static int64_t turn(const verify_corner *a, const verify_corner *b, const verify_corner *c) {
    return (int64_t)(b->col - a->col) * (c->row - a->row) - (int64_t)(c->col - a->col) * (b->row - a->row);
}

/* The weights of p's place in t, which sum to D > 0; none is negative when p is in the closed triangle. */
static int64_t weigh(const verify_triangle *t, const verify_corner *p, int64_t weight[3]) {
    int64_t d = turn(&t->corner[0], &t->corner[1], &t->corner[2]), sign = d < 0 ? -1 : 1;
    weight[0] = sign * turn(p, &t->corner[1], &t->corner[2]);
    weight[1] = sign * turn(&t->corner[0], p, &t->corner[2]);
    weight[2] = sign * turn(&t->corner[0], &t->corner[1], p);
    return sign * d;
}

static void slow_samples(const scene *s, slow_report *slow) {
    const verify_samples *w = &s->samples;
    slow->denominator = 1;
    for (int32_t row = w->row0; row < w->row0 + w->height; row++) {
        for (int32_t col = w->col0; col < w->col0 + w->width; col++) {
            verify_corner p = corner(s, col, row);
            int64_t top = -1, bottom = 1; /* this sample's largest error */
            bool is_corner = false;
            for (size_t t = 0; t < s->n; t++) {
                const verify_corner *c = s->triangle[t].corner;
                for (int k = 0; k < 3; k++) {
                    is_corner = is_corner || (c[k].col == col && c[k].row == row);
                }
                int64_t weight[3], d = weigh(&s->triangle[t], &p, weight);
                if (d == 0 || weight[0] < 0 || weight[1] < 0 || weight[2] < 0) continue;
                int64_t off = weight[0] * c[0].q + weight[1] * c[1].q + weight[2] * c[2].q - d * p.q;
                off = off < 0 ? -off : off;
                if (off * bottom > top * d) {
                    top = off;
                    bottom = d;
                }
            }
            slow->vertices += is_corner;
            slow->uncovered += top < 0;
            bool valid = s->valid[at(s, col, row)] != 0;
            slow->void_touched += is_corner && !valid;
            if (top < 0 || !valid) continue;
            if (slow->samples == 0 || top * slow->denominator > slow->numerator * bottom) {
                slow->numerator = top;
                slow->denominator = bottom;
                slow->worst_col = col;
                slow->worst_row = row;
            }
            slow->samples++;
            slow->square_sum += (double)(top * top) / (double)(bottom * bottom);
        }
    }
}

static bool same_place(const verify_corner *a, const verify_corner *b) {
    return a->col == b->col && a->row == b->row;
}

static bool strictly_inside(const verify_corner *v, const verify_corner *a, const verify_corner *b) {
    int64_t along = (int64_t)(v->col - a->col) * (b->col - v->col) + (int64_t)(v->row - a->row) * (b->row - v->row);
    return turn(a, b, v) == 0 && along > 0;
}

static const verify_corner *nth_corner(const scene *s, size_t k) {
    return &s->triangle[k / 3].corner[k % 3];
}

/* Is (corner v, edge e) a junction? Edge e runs from corner e of the list to the next one of its triangle. */
static bool is_junction(const scene *s, size_t v, size_t e) {
    const verify_corner *from = nth_corner(s, e), *to = nth_corner(s, e % 3 == 2 ? e - 2 : e + 1);
    const verify_corner *third = nth_corner(s, e % 3 == 0 ? e + 2 : e - 1), *vertex = nth_corner(s, v);
    return strictly_inside(vertex, from, to) && !same_place(vertex, third);
}

static bool same_edge(const scene *s, size_t e, size_t f) {
    const verify_corner *a = nth_corner(s, e), *b = nth_corner(s, e % 3 == 2 ? e - 2 : e + 1);
    const verify_corner *c = nth_corner(s, f), *d = nth_corner(s, f % 3 == 2 ? f - 2 : f + 1);
    return (same_place(a, c) && same_place(b, d)) || (same_place(a, d) && same_place(b, c));
}

static void slow_cracks(const scene *s, slow_report *slow) {
    for (size_t v = 0; v < 3 * s->n; v++) {
        bool new_place = true, new_height = true;
        for (size_t u = 0; u < v; u++) {
            if (!same_place(nth_corner(s, u), nth_corner(s, v))) continue;
            new_place = false;
            new_height = new_height && nth_corner(s, u)->q != nth_corner(s, v)->q;
        }
        if (new_height) { /* a pair with each different height of the place before it */
            for (size_t u = 0; u < v; u++) {
                bool first = same_place(nth_corner(s, u), nth_corner(s, v));
                for (size_t r = 0; r < u && first; r++) {
                    first = !same_place(nth_corner(s, r), nth_corner(s, u)) ||
                            nth_corner(s, r)->q != nth_corner(s, u)->q;
                }
                slow->t_junctions += first;
            }
        }
        for (size_t e = 0; e < 3 * s->n && new_place; e++) {
            bool found = is_junction(s, v, e);
            for (size_t f = 0; f < e && found; f++) {
                found = !(same_edge(s, e, f) && is_junction(s, v, f));
            }
            slow->t_junctions += found;
        }
    }
}

typedef struct homogeneous {
    int64_t x, y, w; /* the point (x / w, y / w), w > 0 */
} homogeneous;

/* Do the interiors meet? The two triangles are six half-planes a*x + b*y + c >= 0. What they have in common has an
 * inside when three points of it, each where two of the lines cross, are not in line. */
static bool interiors_meet(const verify_triangle *t, const verify_triangle *u) {
    int64_t line[6][3];
    homogeneous point[15];
    int points = 0;
    for (int k = 0; k < 6; k++) {
        const verify_triangle *from = k < 3 ? t : u;
        const verify_corner *p = &from->corner[k % 3], *r = &from->corner[(k + 1) % 3];
        int64_t d = turn(&from->corner[0], &from->corner[1], &from->corner[2]), sign = d < 0 ? -1 : 1;
        if (d == 0) return false;
        line[k][0] = sign * (p->row - r->row);
        line[k][1] = sign * (r->col - p->col);
        line[k][2] = -(line[k][0] * p->col + line[k][1] * p->row);
    }
    for (int k = 0; k < 6; k++) {
        for (int j = 0; j < k; j++) {
            const int64_t *l = line[k], *m = line[j];
            homogeneous h = {l[1] * m[2] - m[1] * l[2], l[2] * m[0] - m[2] * l[0], l[0] * m[1] - m[0] * l[1]};
            if (h.w == 0) continue;
            if (h.w < 0) h = (homogeneous){-h.x, -h.y, -h.w};
            bool inside = true;
            for (int i = 0; i < 6 && inside; i++) {
                inside = line[i][0] * h.x + line[i][1] * h.y + line[i][2] * h.w >= 0;
            }
            if (inside) point[points++] = h;
        }
    }
    for (int k = 0; k < points; k++) {
        for (int j = 0; j < k; j++) {
            for (int i = 0; i < j; i++) {
                const homogeneous *a = &point[i], *b = &point[j], *c = &point[k];
                if (a->x * (b->y * c->w - c->y * b->w) - b->x * (a->y * c->w - c->y * a->w) +
                        c->x * (a->y * b->w - b->y * a->w) !=
                    0) {
                    return true;
                }
            }
        }
    }
    return false;
}

static void assert_agrees(const scene *s) {
    slow_report slow = {0};
    slow_samples(s, &slow);
    slow_cracks(s, &slow);
    for (size_t t = 0; t < s->n; t++) {
        int64_t d = turn(&s->triangle[t].corner[0], &s->triangle[t].corner[1], &s->triangle[t].corner[2]);
        slow.twice_area += (uint64_t)(d < 0 ? -d : d);
        slow.overlaps += d >= 0;
        for (size_t u = 0; u < t; u++) {
            slow.overlaps += interiors_meet(&s->triangle[t], &s->triangle[u]);
        }
    }
    verify_report r = verified(s);
    assert_int_equal(r.samples, slow.samples);
    assert_int_equal(r.vertices, slow.vertices);
    assert_int_equal(r.triangles, s->n);
    assert_int_equal(r.t_junctions, slow.t_junctions);
    assert_int_equal(r.overlaps, slow.overlaps);
    assert_int_equal(r.uncovered, slow.uncovered);
    assert_int_equal(r.void_touched, slow.void_touched);
    assert_int_equal(r.twice_area, slow.twice_area);
    /* The quantum is a power of two, so this is the exact value rounded once. */
    assert_true(r.max_error == (double)slow.numerator / (double)slow.denominator * s->samples.quantum);
    assert_int_equal(r.worst_col, slow.worst_col);
    assert_int_equal(r.worst_row, slow.worst_row);
    double rms = slow.samples == 0 ? 0 : sqrt(slow.square_sum / (double)slow.samples) * s->samples.quantum;
    assert_true(fabs(r.rms_error - rms) <= 1e-12 * rms);
}

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
        cmocka_unit_test(a_flat_square_is_without_fault),
        cmocka_unit_test(a_tilted_plane_has_no_error),
        cmocka_unit_test(a_missed_pit_is_found_where_it_is),
        cmocka_unit_test(an_error_between_corners_is_a_fraction),
        cmocka_unit_test(of_equal_errors_the_first_in_row_order_is_named),
        cmocka_unit_test(a_sample_of_two_triangles_counts_once_with_its_larger_error),
        cmocka_unit_test(voids_have_no_error_and_touching_one_is_counted),
        cmocka_unit_test(a_t_junction_is_found_once),
        cmocka_unit_test(a_t_junction_on_a_shared_edge_is_found_once),
        cmocka_unit_test(a_t_junction_on_a_steep_edge_is_found),
        cmocka_unit_test(the_third_corner_of_a_flat_triangle_is_no_t_junction),
        cmocka_unit_test(a_vertical_crack_is_counted),
        cmocka_unit_test(overlapping_triangles_are_counted_in_pairs),
        cmocka_unit_test(a_small_triangle_in_a_large_one_overlaps_it),
        cmocka_unit_test(triangles_that_cross_without_a_common_sample_overlap),
        cmocka_unit_test(a_clockwise_triangle_is_a_fault),
        cmocka_unit_test(a_triangle_of_no_area_is_a_fault_and_covers_nothing),
        cmocka_unit_test(promised_samples_outside_all_triangles_are_uncovered),
        cmocka_unit_test(the_area_is_in_crs_units_whatever_the_signs_of_the_cell),
        cmocka_unit_test(an_empty_mesh_covers_nothing),
        cmocka_unit_test(unsound_input_is_refused_with_an_empty_report),
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
    return cmocka_run_group_tests_name("verify", tests, NULL, NULL);
}
