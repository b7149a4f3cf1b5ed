/* test_verify_free.c - the verifier's door for meshes between samples: on samples it says what the other door says;
 * on the same mesh drawn smaller, what does not depend on size. */
#include "test_verify_support.h"

static uint32_t chance = 20240611;

static int32_t below(uint32_t n) {
    chance = chance * 1664525u + 1013904223u;
    return (int32_t)((chance >> 8) % n);
}

/* Any triangles, over one another, clockwise, without area; or a square cut into a few that fit, one of them moved.
 */
static void random_scene(scene *s) {
    start_scene(s, 4 + below(SIDE - 3), 4 + below(SIDE - 3));
    s->samples.is_promised = promise_all;
    for (int i = 0; i < SIDE * SIDE; i++) {
        s->q[i] = below(2000) - 1000;
        s->valid[i] = below(8) > 0;
    }
    const uint32_t w = (uint32_t)s->samples.width, h = (uint32_t)s->samples.height;
    const int32_t count = 1 + below(40);
    for (int32_t t = 0; t < count; t++) {
        add(s, below(w), below(h), below(w), below(h), below(w), below(h));
        if (below(3) == 0) s->triangle[s->n - 1].corner[below(3)].q += below(3);
    }
    if (below(2)) {
        s->n = 0;
        for (int32_t y = 0; y + 2 < (int32_t)h; y += 2)
            for (int32_t x = 0; x + 2 < (int32_t)w; x += 2) add_square(s, x, y, 2);
        verify_corner *moved = &s->triangle[(uint32_t)below((uint32_t)s->n)].corner[below(3)];
        if (below(2) && moved->col + 1 < (int32_t)w) moved->col++;
    }
}

/* The scene 2^-bits as large about its first corner. */
static verify_report free_report(const scene *s, int bits) {
    verify_free_triangle t[MOST];
    for (size_t i = 0; i < s->n; i++)
        for (int k = 0; k < 3; k++) {
            const verify_corner *c = &s->triangle[i].corner[k];
            t[i].corner[k] = (verify_free_corner){ldexp(c->col, -bits), ldexp(c->row, -bits), c->q};
        }
    verify_report r;
    memset(&r, 0xA5, sizeof r);
    assert_int_equal(verify_free_mesh(&s->samples, t, s->n, &r), VERIFY_OK);
    return r;
}

static void on_samples_both_doors_agree(void **state) {
    (void)state;
    for (int n = 0; n < 3000; n++) {
        scene s;
        random_scene(&s);
        const verify_report a = verified(&s), b = free_report(&s, 0);
        assert_int_equal(a.samples, b.samples);
        assert_int_equal(a.vertices, b.vertices);
        assert_int_equal(a.triangles, b.triangles);
        assert_int_equal(a.t_junctions, b.t_junctions);
        assert_int_equal(a.overlaps, b.overlaps);
        assert_int_equal(a.uncovered, b.uncovered);
        assert_int_equal(a.void_touched, b.void_touched);
        assert_int_equal(a.twice_area, b.twice_area);
        assert_true(a.area == b.area);
        assert_true(b.max_error <= a.max_error && b.max_error >= a.max_error - 2 * VERIFY_FREE_ROUNDING);
        assert_true(fabs(a.rms_error - b.rms_error) <= 2 * VERIFY_FREE_ROUNDING);
    }
}

static void a_smaller_mesh_has_the_same_faults(void **state) {
    (void)state;
    for (int n = 0; n < 3000; n++) {
        scene s;
        random_scene(&s);
        const int bits = 1 + n % 30;
        const verify_report a = verified(&s), b = free_report(&s, bits);
        assert_int_equal(a.vertices, b.vertices);
        assert_int_equal(a.t_junctions, b.t_junctions);
        assert_int_equal(a.overlaps, b.overlaps);
        assert_true(b.area == ldexp(a.area, -2 * bits));
    }
}

/* A sample between the corners of a triangle that has none of its own. */
static void samples_inside_are_measured(void **state) {
    (void)state;
    scene s;
    start_scene(&s, 5, 5);
    for (int i = 0; i < 25; i++) s.q[i] = 100;
    s.q[12] = 107; /* col 2, row 2 */
    verify_free_triangle t = {{{1.5, 1.5, 100}, {1.75, 2.75, 100}, {2.75, 1.75, 100}}};
    verify_report r;
    assert_int_equal(verify_free_mesh(&s.samples, &t, 1, &r), VERIFY_OK);
    assert_int_equal(r.samples, 1);
    assert_true(r.max_error == 7 - VERIFY_FREE_ROUNDING && r.worst_col == 2 && r.worst_row == 2);
    assert_true(r.area == 0.75 && r.vertices == 3 && r.overlaps == 0 && r.t_junctions == 0 && r.void_touched == 0);
    /* the plane through it: nothing but rounding is left */
    t = (verify_free_triangle){{{1.5, 1.5, 105.5}, {1.5, 2.75, 107.25}, {3.25, 1.5, 106.5625}}};
    s.q[12] = 106;
    for (int k = 0; k < 3; k++) t.corner[k].q = 100 + t.corner[k].col + 2 * t.corner[k].row;
    assert_int_equal(verify_free_mesh(&s.samples, &t, 1, &r), VERIFY_OK);
    assert_true(r.samples == 1 && r.max_error == 0);
    /* just past the sample: it is not in the triangle */
    t = (verify_free_triangle){{{2 + 0x1p-40, 1.5, 0}, {2 + 0x1p-40, 2.5, 0}, {2.75, 2, 0}}};
    assert_int_equal(verify_free_mesh(&s.samples, &t, 1, &r), VERIFY_OK);
    assert_int_equal(r.samples, 0);
    t.corner[0].col = t.corner[1].col = 2;
    assert_int_equal(verify_free_mesh(&s.samples, &t, 1, &r), VERIFY_OK);
    assert_int_equal(r.samples, 1);
}

/* Two triangles of which one has a vertex in the middle of the other's edge, by 2^-40 beside it or not. */
static void junctions_between_samples_are_exact(void **state) {
    (void)state;
    scene s;
    start_scene(&s, 5, 5);
    verify_free_triangle t[2] = {{{{1, 1, 0}, {1, 3, 0}, {3, 1, 0}}},
                                 {{{2, 2, 0}, {1.5, 3.5, 0}, {3.25, 3.25, 0}}}};
    verify_report r;
    assert_int_equal(verify_free_mesh(&s.samples, t, 2, &r), VERIFY_OK);
    assert_true(r.t_junctions == 1 && r.overlaps == 0);
    t[1].corner[0].col = 2 + 0x1p-40;
    assert_int_equal(verify_free_mesh(&s.samples, t, 2, &r), VERIFY_OK);
    assert_true(r.t_junctions == 0 && r.overlaps == 0);
    t[1].corner[0].col = 2 - 0x1p-40;
    assert_int_equal(verify_free_mesh(&s.samples, t, 2, &r), VERIFY_OK);
    assert_true(r.t_junctions == 0 && r.overlaps == 1);
    t[1] = (verify_free_triangle){{{1, 3, 0x1p-30}, {2, 4, 0}, {3, 1, 0}}}; /* one height differs by a hair */
    assert_int_equal(verify_free_mesh(&s.samples, t, 2, &r), VERIFY_OK);
    assert_true(r.t_junctions == 1 && r.overlaps == 0);
}

static void unsound_meshes_are_refused(void **state) {
    (void)state;
    const double bad[] = {NAN, INFINITY, -INFINITY, -0.5, 4.5, 1e300, 1e-300, 0x1p-53, 3e6};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        for (int which = 0; which < 3; which++) {
            scene s;
            start_scene(&s, 5, 5);
            verify_free_triangle t = {{{1, 1, 0}, {1, 3, 0}, {3, 1, 0}}};
            if (which == 2 && fabs(bad[i]) < 1e9) continue; /* any height will do */
            *(which == 0 ? &t.corner[1].col : which == 1 ? &t.corner[2].row : &t.corner[0].q) = bad[i];
            verify_report r;
            memset(&r, 0xA5, sizeof r);
            assert_int_equal(verify_free_mesh(&s.samples, &t, 1, &r), VERIFY_INVALID);
            assert_int_equal(r.triangles, 0);
        }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(on_samples_both_doors_agree), cmocka_unit_test(a_smaller_mesh_has_the_same_faults),
        cmocka_unit_test(samples_inside_are_measured), cmocka_unit_test(junctions_between_samples_are_exact),
        cmocka_unit_test(unsound_meshes_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
