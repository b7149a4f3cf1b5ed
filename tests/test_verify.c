/* test_verify.c - what the verifier promises on meshes made by hand, where the answer is known: errors and where
 * they are, T-junctions, cracks, overlaps, promised samples that nothing covers, voids, areas, and unsound input,
 * which is refused with an empty report. */
#include "test_verify_support.h"

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
    };
    return cmocka_run_group_tests_name("verify", tests, NULL, NULL);
}
