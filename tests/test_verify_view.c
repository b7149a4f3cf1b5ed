/* test_verify_view.c - the verifier of views: known answers, faults that it has to find, and a slow check of random
 * scenes, which projects both points one after the other in long doubles. */
#include "test_verify_support.h"

/* A scene with its places and a camera. */
typedef struct view {
    scene s;
    verify_scene where;
    verify_camera camera;
    double origin[2], step, lift; /* linear: x, y of sample 0,0; metres a sample; metres a quantum */
    double radius;                /* not 0: a ball of that radius, step in radians */
    double nearest_void;          /* what is_promised goes by: samples with a smaller slack are promised */
    uint64_t asked;
} view;

static void place(void *context, const verify_corner *c, double xyz[3]) {
    const view *v = context;
    if (v->radius == 0) {
        xyz[0] = v->origin[0] + c->col * v->step;
        xyz[1] = v->origin[1] - c->row * v->step;
        xyz[2] = c->q * v->lift;
        return;
    }
    const double lon = v->origin[0] + c->col * v->step, lat = v->origin[1] - c->row * v->step,
                 r = v->radius + c->q * v->lift;
    xyz[0] = r * cos(lat) * cos(lon);
    xyz[1] = r * cos(lat) * sin(lon);
    xyz[2] = r * sin(lat);
}

static bool is_promised(void *context, int32_t col, int32_t row, double slack) {
    view *v = context;
    (void)col, (void)row;
    v->asked++;
    return slack < v->nearest_void;
}

/* Looks along the direction given by two angles; up is upward where that is possible. */
static void look(verify_camera *c, double yaw, double pitch) {
    const double forward[3] = {sin(yaw) * cos(pitch), cos(yaw) * cos(pitch), sin(pitch)};
    const double right[3] = {cos(yaw), -sin(yaw), 0};
    memcpy(c->forward, forward, sizeof forward);
    memcpy(c->right, right, sizeof right);
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        c->up[k] = right[i] * forward[j] - right[j] * forward[i];
    }
}

/* Samples 1 m apart about 0,0 in the middle; quanta of 1 m; an eye 100 m up that looks down, north on top. */
static void start_view(view *v, int32_t side) {
    memset(v, 0, sizeof *v);
    start_scene(&v->s, side, side);
    v->origin[0] = -(side - 1) / 2.0, v->origin[1] = (side - 1) / 2.0;
    v->step = v->lift = 1;
    v->nearest_void = INFINITY;
    v->where = (verify_scene){.place = place, .rise = 1, .is_promised = is_promised};
    v->camera = (verify_camera){.eye = {0, 0, 100}, .focal = 1000, .width = 1000, .height = 1000, .far = INFINITY};
    look(&v->camera, 0, -acos(0));
}

static verify_status try_view(view *v, verify_view_report *r) {
    v->s.samples.q = v->s.q, v->s.samples.valid = v->s.valid;
    v->where.context = v;
    return verify_view(&v->s.samples, &v->where, &v->camera, v->s.triangle, v->s.n, r);
}

static verify_view_report seen(view *v) {
    verify_view_report r = {0};
    assert_int_equal(try_view(v, &r), VERIFY_OK);
    return r;
}

static bool is_near(double a, double b) {
    return a == b || fabs(a - b) <= 1e-12 * fmax(fabs(a), fabs(b)) + 1e-12;
}

/* ------------------------------------------------------------------------------------------- known answers */

static void a_mesh_of_all_samples_is_off_by_nothing(void **state) {
    (void)state;
    view v;
    start_view(&v, 5);
    v.origin[0] = 2e6 / 3, v.origin[1] = 5.1e6 + 0.1; /* places are rounded, shifts are not */
    v.camera.eye[0] = v.origin[0] + 2, v.camera.eye[1] = v.origin[1] - 2;
    for (int i = 0; i < 25; i++) v.s.q[i] = i * i % 7;
    for (int32_t row = 0; row < 4; row++)
        for (int32_t col = 0; col < 4; col++) add_square(&v.s, col, row, 1);
    for (int round = 0; round < 2; round++) {
        verify_view_report r = seen(&v);
        assert_true(r.samples == 25 && r.drawn == 25 && r.uncovered == 0 && v.asked == 0);
        assert_true(r.max_pixels == 0 && r.rms_pixels == 0 && r.worst_col == 0 && r.worst_row == 0);
        v.where.rise = 0; /* by the places of the corners */
    }
}

/* A pit of 3 m at 1 m east, 2 m south of the middle, under two large triangles. */
static void start_pit(view *v) {
    start_view(v, 9);
    v->s.q[at(&v->s, 5, 6)] = -3;
    add_square(&v->s, 0, 0, 8);
}

static void a_pit_below_the_eye_is_off_by_the_parallax(void **state) {
    (void)state;
    view v;
    start_pit(&v);
    for (int round = 0; round < 2; round++) {
        const verify_view_report r = seen(&v);
        const double pixels = 1000 * sqrt(5) * (1.0 / 100 - 1.0 / 103);
        assert_true(is_near(r.max_pixels, pixels) && r.worst_col == 5 && r.worst_row == 6);
        assert_true(r.samples == 81 && r.drawn == 81 && is_near(r.rms_pixels, pixels / 9));
        v.where.rise = 0;
    }
    v.camera.eye[0] = 1, v.camera.eye[1] = -2; /* straight above the pit nothing moves */
    assert_true(fabs(seen(&v).max_pixels) < 1e-12);
    look(&v.camera, 0.7, -acos(0)); /* turned about the line of sight: the same distance */
    v.camera.eye[0] = v.camera.eye[1] = 0;
    assert_true(is_near(seen(&v).max_pixels, 1000 * sqrt(5) * (1.0 / 100 - 1.0 / 103)));
}

static void a_pit_seen_from_the_side_is_off_by_its_depth(void **state) {
    (void)state;
    view v;
    start_pit(&v);
    v.camera.eye[1] = -52, v.camera.eye[2] = -1; /* 50 m south of the pit, looking north */
    look(&v.camera, 0, 0);
    assert_true(is_near(seen(&v).max_pixels, 1000.0 * 3 / 50));
    v.camera.focal = 1e7; /* through a long lens, the eye beside the line of sight to it */
    v.camera.eye[0] = 1;
    v.camera.width = v.camera.height = 1e7;
    assert_true(is_near(seen(&v).max_pixels, 1e7 * 3 / 50));
    v.where.rise = 0;
    assert_true(is_near(seen(&v).max_pixels, 1e7 * 3 / 50));
}

static void what_is_drawn_counts_and_nothing_else(void **state) {
    (void)state;
    view v;
    start_pit(&v);
    v.camera.width = v.camera.height = 30; /* 10 px a metre: 1.5 m to each side of the middle */
    verify_view_report r = seen(&v);
    assert_true(r.samples == 81 && r.drawn == 9 && r.max_pixels == 0);
    v.camera.height = 40.1; /* two metres up and down: the sample in the pit is drawn, 2 m south at 103 m */
    r = seen(&v);
    assert_true(r.drawn == 15 && r.max_pixels > 0 && r.worst_col == 5 && r.worst_row == 6);
    v.camera.height = 39; /* the mesh is outside the picture, the sample below it inside: 19.417 of 19.5 px */
    r = seen(&v);
    assert_true(r.drawn == 10 && r.max_pixels > 0);
    v.camera.height = 38.8; /* neither */
    assert_true(seen(&v).drawn == 9 && seen(&v).max_pixels == 0);
    v.s.q[at(&v.s, 5, 6)] = 3; /* a peak instead: now the mesh alone is inside */
    v.camera.height = 40.1;
    r = seen(&v);
    assert_true(r.drawn == 15 && r.max_pixels > 0);
    start_pit(&v);
    v.camera.near = 101; /* only the pit is as deep */
    r = seen(&v);
    assert_true(r.drawn == 1 && r.max_pixels > 0);
    v.camera.near = 0, v.camera.far = 100; /* only the plane, the pit's place on it, too */
    assert_true(seen(&v).drawn == 81 && seen(&v).max_pixels > 0);
    v.camera.far = 99;
    r = seen(&v);
    assert_true(r.drawn == 0 && r.max_pixels == 0 && r.rms_pixels == 0);
    start_pit(&v);
    v.camera.eye[2] = -5; /* below, looking down */
    assert_true(seen(&v).drawn == 0);
}

static void a_point_behind_the_eye_is_infinitely_far_off(void **state) {
    (void)state;
    view v;
    start_pit(&v);
    v.camera.eye[0] = 1, v.camera.eye[1] = -2, v.camera.eye[2] = -1; /* in the pit */
    verify_view_report r = seen(&v);
    assert_true(isinf(r.max_pixels) && isinf(r.rms_pixels) && r.drawn == 1);
    assert_true(r.worst_col == 5 && r.worst_row == 6);
    look(&v.camera, 0, acos(0)); /* looking up: the mesh is drawn, the sample is behind */
    r = seen(&v);
    assert_true(isinf(r.max_pixels));
    v.camera.near = 2; /* and now it is too near to be drawn */
    r = seen(&v);
    assert_true(r.max_pixels == 0 && r.worst_row != 6);
    v.camera.near = 0;
    v.camera.eye[2] = -3; /* at the sample itself */
    r = seen(&v);
    assert_true(isinf(r.max_pixels) && r.worst_row == 6);
    v.camera.eye[2] = 0; /* at the mesh */
    look(&v.camera, 0, -acos(0));
    assert_true(isinf(seen(&v).max_pixels));
}

/* F31: with the eye on a sample that lies on the mesh without being a corner, rounding must not tear the two apart.
 */
static void F31_an_eye_on_a_coplanar_sample_sees_it_where_it_is(void **state) {
    (void)state;
    for (int k = 0; k < 64; k++) {
        view v;
        start_view(&v, 9);
        v.step = 10 + k / 7.0, v.lift = v.where.rise = 0.1 + k / 3.0;
        v.origin[0] = 5e6 / 3 + k, v.origin[1] = 5.3e6 / 7;
        for (int32_t i = 0; i < 81; i++) v.s.q[i] = 3 * (i % 9) + 5 * (i / 9);
        add_square(&v.s, 0, 0, 8);
        const verify_corner c = corner(&v.s, 1 + k % 7, 3);
        place(&v, &c, v.camera.eye);
        look(&v.camera, k, k % 2 ? 0.3 : -1.2);
        const verify_view_report r = seen(&v);
        assert_true(r.max_pixels == 0);
    }
}

static void voids_are_not_measured_and_holes_are_told(void **state) {
    (void)state;
    view v;
    start_pit(&v);
    v.s.valid[at(&v.s, 5, 6)] = 0;
    verify_view_report r = seen(&v);
    assert_true(r.samples == 80 && r.drawn == 80 && r.max_pixels == 0 && r.uncovered == 0);
    v.s.n = 1; /* the half north-west of the diagonal: 45 samples, and the void among the others */
    r = seen(&v);
    assert_true(r.samples == 45 && r.uncovered == 35 && v.asked == 35);
    v.camera.width = 31, v.camera.height = 31; /* the middle 3 by 3: 6 in the half */
    r = seen(&v);
    assert_true(r.drawn == 6 && r.uncovered == 3);
    /* 10 px are a metre in the middle, and a little less to its side, where the picture plane stretches more */
    v.where.slack = 10;
    v.nearest_void = 0.96;
    assert_int_equal(seen(&v).uncovered, 3 - 3);
    v.nearest_void = 1;
    assert_int_equal(seen(&v).uncovered, 3);
    v.where.is_promised = NULL;
    assert_int_equal(seen(&v).uncovered, 0);
}

/* A point on the picture plane is moved by no more than the slack that its metres stand for, in any direction. */
static void the_metres_of_a_slack_move_no_point_further(void **state) {
    (void)state;
    view v;
    for (int k = 0; k < 2000; k++) {
        start_view(&v, 1);
        const double pixels = pow(10, k % 5 - 1), away = 1 + k % 37, side = away * (k % 41) / 10;
        v.camera.eye[2] = away, v.camera.eye[0] = side;
        v.camera.focal = pow(10, k % 3 + 1), v.camera.width = v.camera.height = 1e9;
        v.where.slack = pixels;
        double low = 0, high = 1e9; /* what the verifier asks for, by bisection */
        for (int step = 0; step < 80; step++) {
            v.nearest_void = (low + high) / 2;
            if (seen(&v).uncovered)
                high = v.nearest_void;
            else
                low = v.nearest_void;
        }
        /* a shift of that length, straight out and towards the eye as it hurts most */
        double worst = 0;
        for (int turn = 0; turn < 360; turn++) {
            const double a = turn * acos(0) / 90, x = side + low * cos(a), z = away + low * sin(a);
            if (z <= 0) worst = INFINITY;
            worst = fmax(worst, v.camera.focal * fabs(x / z - side / away));
        }
        assert_true(worst <= pixels * (1 + 1e-6));
        /* and no smaller than need be: along the ray that touches the ball on the outside */
        const double a = atan(side / away) + asin(low / hypot(side, away));
        assert_true(fabs(v.camera.focal * (tan(a) - side / away) - pixels) <= 1e-6 * pixels);
    }
}

static void windows_add_up_in_any_order(void **state) {
    (void)state;
    view v;
    start_pit(&v);
    v.s.q[at(&v.s, 2, 1)] = 2;
    v.s.valid[40] = 0;
    const verify_view_report whole = seen(&v);
    for (int order = 0; order < 2; order++) {
        verify_view_report sum = {0};
        for (int part = 0; part < 3; part++) {
            const int32_t at_row = 3 * (order ? 2 - part : part);
            verify_samples rows = v.s.samples;
            rows.row0 = at_row, rows.height = 3, rows.q = v.s.q + at_row * 9, rows.valid = v.s.valid + at_row * 9;
            assert_int_equal(verify_view(&rows, &v.where, &v.camera, v.s.triangle, v.s.n, &sum), VERIFY_OK);
        }
        assert_true(sum.samples == whole.samples && sum.drawn == whole.drawn && sum.uncovered == whole.uncovered);
        assert_true(sum.max_pixels == whole.max_pixels && is_near(sum.rms_pixels, whole.rms_pixels));
        assert_true(sum.worst_col == whole.worst_col && sum.worst_row == whole.worst_row);
    }
}

static void unsound_input_is_refused(void **state) {
    (void)state;
    enum { KINDS = 24 };
    for (int k = 0; k < KINDS; k++) {
        view v;
        start_pit(&v);
        verify_camera *c = &v.camera;
        verify_scene *w = &v.where;
        switch (k) {
        case 0:
            c->eye[1] = (double)NAN;
            break;
        case 1:
            c->focal = 0;
            break;
        case 2:
            c->width = -1;
            break;
        case 3:
            c->height = INFINITY;
            break;
        case 4:
            c->near = -1;
            break;
        case 5:
            c->far = 0;
            break;
        case 6:
            c->far = (double)NAN;
            break;
        case 7:
            c->forward[0] += 0.01;
            break;
        case 8:
            c->up[2] = 2;
            break;
        case 9:
            memcpy(c->up, c->right, sizeof c->up);
            break;
        case 10:
            w->place = NULL;
            break;
        case 11:
            w->rise = INFINITY;
            break;
        case 12:
            w->slack = -1;
            break;
        case 13:
            v.origin[0] = INFINITY;
            break;
        case 14:
            v.s.triangle[0].corner[2].q = 1 << 30;
            break;
        case 15:
            v.s.triangle[1].corner[0].col = 1 << 21;
            break;
        case 16:
            v.s.samples.width = -1;
            break;
        case 17:
            v.s.samples.row0 = (1 << 21) - 8;
            break;
        case 18:
            v.s.samples.col0 = -(1 << 21);
            break;
        case 19:
            c->near = c->far = 5;
            break;
        case 20:
            c->focal = INFINITY;
            break;
        case 21:
            v.lift = INFINITY, w->rise = 0;
            break;
        case 22:
            c->near = (double)NAN;
            break;
        default:
            w->slack = (double)NAN;
            break;
        }
        verify_view_report r = {.samples = 7, .max_pixels = 3};
        const verify_view_report before = r;
        assert_int_equal(try_view(&v, &r), VERIFY_INVALID);
        assert_memory_equal(&r, &before, sizeof r);
    }
    view v;
    start_pit(&v);
    verify_view_report r = {0};
    assert_int_equal(verify_view(NULL, &v.where, &v.camera, NULL, 0, &r), VERIFY_INVALID);
    assert_int_equal(verify_view(&v.s.samples, &v.where, &v.camera, NULL, 1, &r), VERIFY_INVALID);
    v.s.samples.q = NULL;
    assert_int_equal(verify_view(&v.s.samples, &v.where, &v.camera, NULL, 0, &r), VERIFY_INVALID);
    v.s.samples.width = 0;
    assert_int_equal(verify_view(&v.s.samples, &v.where, &v.camera, NULL, 0, &r), VERIFY_OK);
}

/* ------------------------------------------------------------------------------------------- the slow check */

static uint32_t chance = 20261126;

static int32_t below(uint32_t n) {
    chance = chance * 1664525u + 1013904223u;
    return (int32_t)((chance >> 8) % n);
}

static double between(double low, double high) {
    return low + (high - low) * below(1 << 20) / (1 << 20);
}

/* false: not before the eye; *drawn as well. */
static bool project(const verify_camera *c, const long double p[3], long double xy[2], bool *drawn) {
    long double right = 0, up = 0, depth = 0;
    for (int k = 0; k < 3; k++) {
        right += (p[k] - c->eye[k]) * c->right[k];
        up += (p[k] - c->eye[k]) * c->up[k];
        depth += (p[k] - c->eye[k]) * c->forward[k];
    }
    *drawn = false;
    if (depth <= 0) return false;
    xy[0] = c->focal * right / depth, xy[1] = c->focal * up / depth;
    *drawn = depth >= c->near && depth <= c->far && fabsl(xy[0]) <= c->width / 2 && fabsl(xy[1]) <= c->height / 2;
    return true;
}

static verify_view_report slow_report_of(view *v) {
    verify_view_report r = {0};
    const verify_samples *w = &v->s.samples;
    for (int32_t row = w->row0; row < w->row0 + w->height; row++)
        for (int32_t col = w->col0; col < w->col0 + w->width; col++) {
            const verify_corner sample = corner(&v->s, col, row);
            if (!v->s.valid[at(&v->s, col, row)]) continue;
            double there[3];
            long double s[3], s_xy[2] = {0}, largest = -1;
            place(v, &sample, there);
            for (int k = 0; k < 3; k++) s[k] = there[k];
            bool covered = false, s_drawn;
            const bool s_before = project(&v->camera, s, s_xy, &s_drawn);
            for (size_t t = 0; t < v->s.n; t++) {
                int64_t weight[3];
                const int64_t whole = weigh(&v->s.triangle[t], &sample, weight);
                if (whole == 0 || weight[0] < 0 || weight[1] < 0 || weight[2] < 0) continue;
                covered = true;
                long double m[3] = {0}, m_xy[2] = {0};
                for (int k = 0; k < 3; k++) {
                    place(v, &v->s.triangle[t].corner[k], there);
                    for (int axis = 0; axis < 3; axis++)
                        m[axis] += (long double)weight[k] / (long double)whole * there[axis];
                }
                bool m_drawn;
                const bool m_before = project(&v->camera, m, m_xy, &m_drawn);
                if (!s_drawn && !m_drawn) continue;
                const long double off =
                    s_before && m_before ? hypotl(s_xy[0] - m_xy[0], s_xy[1] - m_xy[1]) : INFINITY;
                if (off > largest) largest = off;
            }
            r.samples += covered;
            r.uncovered += !covered && s_drawn;
            if (largest < 0) continue;
            if (r.drawn++ == 0 || (double)largest > r.max_pixels) {
                r.max_pixels = (double)largest;
                r.worst_col = col, r.worst_row = row;
            }
            r.squares += (double)(largest * largest);
        }
    r.rms_pixels = r.drawn ? sqrt(r.squares / (double)r.drawn) : 0;
    return r;
}

static void random_view(view *v) {
    start_view(v, 3 + below(6));
    const uint32_t side = (uint32_t)v->s.samples.width;
    v->s.samples.col0 = below(2000) - 1000, v->s.samples.row0 = below(2000) - 1000;
    for (int i = 0; i < SIDE * SIDE; i++) {
        v->s.q[i] = below(200) - 100;
        v->s.valid[i] = below(8) > 0;
    }
    const int32_t count = 1 + below(8), col0 = v->s.samples.col0, row0 = v->s.samples.row0;
    for (int32_t t = 0; t < count; t++) {
        int32_t c[6];
        for (int k = 0; k < 6; k++) c[k] = (k % 2 ? row0 : col0) + below(side);
        add(&v->s, c[0], c[1], c[2], c[3], c[4], c[5]);
        if (below(3) == 0) v->s.triangle[v->s.n - 1].corner[below(3)].q += below(30);
    }
    v->step = between(0.5, 20), v->lift = v->where.rise = between(0.01, 2);
    if (below(2)) {
        v->radius = 1000, v->where.rise = 0;
        v->step = between(0.001, 0.02);
    }
    /* about a sample, near to it or far off */
    const verify_corner middle = corner(&v->s, v->s.samples.col0 + below(side), v->s.samples.row0 + below(side));
    double to[3];
    place(v, &middle, to);
    const double away = pow(10, between(-1, 4)), yaw = between(0, 6.28), pitch = between(-1.57, 1.57);
    look(&v->camera, yaw, pitch);
    for (int k = 0; k < 3; k++) v->camera.eye[k] = to[k] - away * v->camera.forward[k] + between(-1, 1);
    v->camera.width = 1 + below(4000), v->camera.height = 1 + below(4000);
    v->camera.focal = v->camera.height / 2 / tan(between(0.0001, 1.48));
    if (below(2)) v->camera.near = away * between(0, 1.1);
    if (below(2)) v->camera.far = v->camera.near + away * between(0.01, 2);
}

static void random_views_agree_with_the_slow_check(void **state) {
    (void)state;
    size_t infinite = 0, drawn = 0, bare = 0;
    for (int k = 0; k < 20000; k++) {
        view v;
        random_view(&v);
        const verify_view_report slow = slow_report_of(&v), r = seen(&v);
        assert_int_equal(r.samples, slow.samples);
        assert_int_equal(r.drawn, slow.drawn);
        assert_int_equal(r.uncovered, slow.uncovered);
        infinite += slow.max_pixels == INFINITY, drawn += slow.drawn > 0, bare += slow.uncovered > 0;
        if (isinf(slow.max_pixels)) {
            assert_true(isinf(r.max_pixels) && isinf(r.rms_pixels));
            continue;
        }
        assert_true(fabs(r.max_pixels - slow.max_pixels) <= 1e-6 * slow.max_pixels + 1e-6);
        assert_true(fabs(r.rms_pixels - slow.rms_pixels) <= 1e-6 * slow.max_pixels + 1e-6);
        /* the place is the same unless another one is as far off, but for rounding */
        if (r.worst_col == slow.worst_col && r.worst_row == slow.worst_row) continue;
        assert_true(fabs(r.max_pixels - slow.max_pixels) <= 1e-9 * slow.max_pixels + 1e-6);
    }
    assert_true(infinite > 500 && drawn > 5000 && bare > 2000);
}

/* A mesh of all samples, then one corner is moved by a quantum, or one triangle is missing: told, whichever it is.
 */
static void planted_faults_are_found(void **state) {
    (void)state;
    for (int k = 0; k < 2000; k++) {
        view v;
        start_view(&v, 6);
        for (int i = 0; i < 36; i++) v.s.q[i] = below(30);
        for (int32_t row = 0; row < 5; row++)
            for (int32_t col = 0; col < 5; col++) add_square(&v.s, col, row, 1);
        v.camera.eye[0] = between(-9, 9), v.camera.eye[1] = between(-9, 9);
        assert_true(seen(&v).max_pixels == 0 && seen(&v).drawn == 36);
        verify_corner *moved = &v.s.triangle[below((uint32_t)v.s.n)].corner[below(3)];
        moved->q += below(2) ? 1 : -1;
        verify_view_report r = seen(&v);
        assert_true(r.max_pixels > 0 && r.worst_col == moved->col && r.worst_row == moved->row);
        v.s.n--; /* the last corner is in no other */
        assert_int_equal(seen(&v).uncovered, 1);
    }
}

/* Faults of the triangles alone need no window, wherever they are. */
static void without_samples_the_faults_are_the_same(void **state) {
    (void)state;
    for (int n = 0; n < 3000; n++) {
        view v;
        random_view(&v);
        const verify_report a = verified(&v.s);
        const int32_t end = n % 3 == 0 ? 0 : n % 3 == 1 ? (1 << 21) - 1100 : -(1 << 21) + 1100;
        for (size_t i = 0; i < 3 * v.s.n; i++) {
            v.s.triangle[i / 3].corner[i % 3].col += end;
            v.s.triangle[i / 3].corner[i % 3].row -= end;
        }
        verify_report b, zeros = {0};
        memset(&b, 0xA5, sizeof b);
        assert_int_equal(verify_topology(v.s.triangle, v.s.n, &b), VERIFY_OK);
        assert_true(b.vertices == a.vertices && b.triangles == a.triangles && b.twice_area == a.twice_area);
        assert_true(b.t_junctions == a.t_junctions && b.overlaps == a.overlaps);
        b.vertices = b.triangles = b.t_junctions = b.overlaps = b.twice_area = 0;
        assert_memory_equal(&b, &zeros, sizeof b);
        v.s.triangle[0].corner[1].row = n % 2 ? 1 << 21 : -(1 << 21);
        assert_int_equal(verify_topology(v.s.triangle, v.s.n, &b), VERIFY_INVALID);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_mesh_of_all_samples_is_off_by_nothing),
        cmocka_unit_test(a_pit_below_the_eye_is_off_by_the_parallax),
        cmocka_unit_test(a_pit_seen_from_the_side_is_off_by_its_depth),
        cmocka_unit_test(what_is_drawn_counts_and_nothing_else),
        cmocka_unit_test(a_point_behind_the_eye_is_infinitely_far_off),
        cmocka_unit_test(F31_an_eye_on_a_coplanar_sample_sees_it_where_it_is),
        cmocka_unit_test(voids_are_not_measured_and_holes_are_told),
        cmocka_unit_test(the_metres_of_a_slack_move_no_point_further),
        cmocka_unit_test(windows_add_up_in_any_order),
        cmocka_unit_test(unsound_input_is_refused),
        cmocka_unit_test(random_views_agree_with_the_slow_check),
        cmocka_unit_test(planted_faults_are_found),
        cmocka_unit_test(without_samples_the_faults_are_the_same),
    };
    return cmocka_run_group_tests_name("verify_view", tests, NULL, NULL);
}
