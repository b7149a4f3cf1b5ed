/* fuzz_view_tests.c - the tests of the literature: cameras and pieces of any numbers.
 *
 * Whatever comes in, what comes out is a number. Where the numbers are those of a scene, what is in the picture is
 * not left out, and smaller pieces get no less than the whole they are of. */
#include "fuzz.h"

static bool take_camera(input *in, rqt_camera *c) {
    double eye[3], direction[3], vertical[3] = {0, 0, 1};
    const double ahead[3] = {0, 1, 0};
    for (int i = 0; i < 3; i++) {
        eye[i] = take_double(in);
        direction[i] = take_double(in);
    }
    if (take_between(in, 0, 3) == 0) vertical[2] = take_double(in);
    *c = (rqt_camera){.width = take_between(in, 0, 4000),
                      .height = take_between(in, 0, 4000),
                      .near = take_between(in, 0, 1) ? 0 : take_double(in),
                      .far = take_between(in, 0, 1) ? INFINITY : take_double(in),
                      .tau = fabs(take_double(in))};
    rqt_message message = {""};
    const rqt_status status = rqt_camera_look(c, eye, direction, vertical, ahead, take_double(in), &message);
    HOLD(status == RQT_OK || (status == RQT_INVALID && message.text[0]), "status %d: %s", (int)status,
         message.text);
    return status == RQT_OK;
}

static rqt_view_piece take_piece(input *in) {
    const double turn = take_between(in, 0, 255) / 40.0;
    rqt_view_piece p = {.prism = {.centre = {take_double(in), take_double(in), take_double(in)},
                                  .up = {0, 0, 1},
                                  .half_height = fabs(take_double(in))},
                        .east = {cos(turn), sin(turn), 0},
                        .half_east = fabs(take_double(in)),
                        .half_north = fabs(take_double(in)),
                        .side = 1 << take_between(in, 0, RQT_MAX_K)};
    p.prism.radius = sqrt(p.half_east * p.half_east + p.half_north * p.half_north);
    return p;
}

/* Of a size that doubles can tell apart from the eye: what is asserted of points needs that. */
static bool is_scene(const rqt_camera *c, const rqt_view_piece *p) {
    double most = p->prism.radius + p->prism.half_height, least = fmin(p->half_east, p->half_north);
    for (int i = 0; i < 3; i++) most = fmax(most, fmax(fabs(c->eye[i]), fabs(p->prism.centre[i])));
    return most < 1e9 && least > 1e-3 && p->prism.half_height > 1e-3 && c->tau < 1e6 && c->tau > 1e-6 &&
           c->focal < 1e9 && c->focal > 1e-3;
}

/* One in the middle half of the box. */
static void take_point(input *in, const rqt_view_piece *p, double out[3]) {
    const double e = p->half_east * take_between(in, -64, 64) / 128.0,
                 n = p->half_north * take_between(in, -64, 64) / 128.0,
                 h = p->prism.half_height * take_between(in, -64, 64) / 128.0;
    out[0] = p->prism.centre[0] + e * p->east[0] - n * p->east[1];
    out[1] = p->prism.centre[1] + e * p->east[1] + n * p->east[0];
    out[2] = p->prism.centre[2] + h;
}

const long fuzz_runs = 20000;

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    input in = {data, size};
    rqt_camera camera;
    if (!take_camera(&in, &camera)) return 0;
    const rqt_view_piece piece = take_piece(&in);
    const bool sound = is_scene(&camera, &piece);
    for (int t = 0; t < RQT_VIEW_TESTS; t++) {
        const rqt_view_test test = (rqt_view_test)t;
        rqt_view_bound b, direct;
        rqt_view_test_bound(test, &camera, &piece, &b);
        HOLD(rqt_view_test_name(test) && rqt_metric_name(rqt_view_test_metric(test)), "test %d", t);
        HOLD(b.eps >= 0 && b.share >= 0 && b.share <= 1, "%s: eps %g, share %g", rqt_view_test_name(test), b.eps,
             b.share);
        HOLD(b.distance >= 0, "%s: distance %g", rqt_view_test_name(test), b.distance);
        if (test == RQT_VIEW_GUARANTEED) {
            rqt_view_tolerance(&camera, &piece.prism, &direct);
            HOLD(memcmp(&direct, &b, sizeof b) == 0, "guaranteed is the tolerance");
        } else {
            HOLD(b.shown || b.eps == INFINITY, "%s: %g though nothing is shown", rqt_view_test_name(test), b.eps);
        }
        if (!sound) continue;
        double at[3], xy[2];
        take_point(&in, &piece, at);
        if (!rqt_camera_project(&camera, at, xy)) continue;
        HOLD(b.shown, "%s: a drawn point is left out", rqt_view_test_name(test));
        if (test == RQT_VIEW_NODE || test == RQT_VIEW_LODMAP) continue; /* these go by the middle */
        rqt_view_piece part = piece;
        memcpy(part.prism.centre, at, sizeof at);
        part.prism.radius /= 4, part.prism.half_height /= 4, part.half_east /= 4, part.half_north /= 4;
        rqt_view_test_bound(test, &camera, &part, &direct);
        HOLD(direct.eps >= b.eps * (1 - 1e-6) - 1e-6, "%s: a part of it gets %g, all of it %g",
             rqt_view_test_name(test), direct.eps, b.eps);
    }
    return 0;
}
