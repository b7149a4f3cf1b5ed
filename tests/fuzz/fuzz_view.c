/* fuzz_view.c - cameras and pieces of a scene that come in: any doubles, and sensible ones. */
#include "fuzz.h"

#include "rqt_view.h"

static void take_vector(input *in, double v[3]) {
    for (int c = 0; c < 3; c++) v[c] = take_double(in);
}

static double product(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* A camera of rqt_camera_look, or any numbers. */
static bool take_camera(input *in, rqt_camera *c) {
    double eye[3], direction[3], vertical[3], ahead[3];
    take_vector(in, eye);
    take_vector(in, direction);
    take_vector(in, vertical);
    take_vector(in, ahead);
    const bool tame = take_between(in, 0, 3) != 0;
    *c = (rqt_camera){.width = tame ? take_between(in, 1, 4000) : take_double(in),
                      .height = tame ? take_between(in, 1, 4000) : take_double(in),
                      .near = tame ? take_between(in, 0, 64) / 8.0 : take_double(in),
                      .far = tame ? INFINITY : take_double(in),
                      .tau = tame ? take_between(in, 1, 80) / 8.0 : take_double(in)};
    const double fovy = tame ? take_between(in, 1, 17900) / 100.0 : take_double(in);
    rqt_message message = {""};
    const rqt_status status =
        rqt_camera_look(c, eye, direction, vertical, ahead, fovy, take_between(in, 0, 1) ? &message : NULL);
    HOLD(status == RQT_OK || status == RQT_INVALID, "status %d", (int)status);
    if (status == RQT_OK) {
        HOLD(message.text[0] == '\0', "%s", message.text);
        const double *const axis[3] = {c->right, c->up, c->forward};
        for (int a = 0; a < 3; a++)
            for (int b = a; b < 3; b++)
                HOLD(fabs(product(axis[a], axis[b]) - (a == b)) < 1e-14, "axes %d, %d: %g", a, b,
                     product(axis[a], axis[b]));
        HOLD(c->focal > 0 && isfinite(c->focal), "focal %g", c->focal);
        return true;
    }
    take_vector(in, c->eye);
    take_vector(in, c->forward);
    take_vector(in, c->right);
    take_vector(in, c->up);
    c->focal = take_double(in);
    return false;
}

/* In the band of any camera numbers are numbers, and nothing is allowed that the camera itself is not. */
static void in_band(input *in, const rqt_camera *camera, const rqt_prism *prism, const rqt_view_bound *alone,
                    bool sound) {
    const double nearest = fabs(take_double(in));
    const rqt_view_band band = rqt_camera_band(camera, isfinite(nearest) ? nearest : 0);
    rqt_view_bound b;
    rqt_view_tolerance_in_band(camera, &band, prism, &b);
    HOLD(b.eps >= 0 && isfinite(b.eps) && b.share >= 0 && b.share <= 1, "eps %g, share %g", b.eps, b.share);
    (void)rqt_camera_widen(camera, &band);
    if (!sound) return;
    HOLD(band.move > 0 && band.turn > 0 && rqt_camera_holds(camera, &band, camera), "move %g, turn %g", band.move,
         band.turn);
    if (prism->radius >= 0)
        HOLD(b.eps <= alone->eps * (1 + 1e-9) || !(alone->eps > 1e-300), "eps %g, alone %g", b.eps, alone->eps);
    /* What is shown alone for what may rise from it may be hidden in the band, where less may. */
    if (prism->radius >= 0)
        HOLD(b.shown || !alone->shown || b.eps < alone->eps || alone->eps == 0, "not shown in the band, but alone");
}

const long fuzz_runs = 40000;

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    input in = {data, size};
    rqt_camera camera;
    const bool sound = take_camera(&in, &camera);

    double point[3], xy[2];
    take_vector(&in, point);
    if (rqt_camera_project(&camera, point, xy))
        HOLD(xy[0] >= 0 && xy[0] <= camera.width && xy[1] >= 0 && xy[1] <= camera.height, "(%g,%g)", xy[0], xy[1]);

    rqt_prism prism = {.radius = fabs(take_double(&in)), .half_height = fabs(take_double(&in)), .up = {0, 0, 1}};
    take_vector(&in, prism.centre);
    if (take_between(&in, 0, 1)) take_vector(&in, prism.up);
    /* Up is unit; what is not is any numbers. */
    const double length = sqrt(product(prism.up, prism.up));
    if (length > 0 && isfinite(length))
        for (int c = 0; c < 3; c++) prism.up[c] /= length;
    if (take_between(&in, 0, 7) == 0) prism.radius = -prism.radius;
    prism.upright = take_between(&in, 0, 1) ? take_between(&in, 0, 8) / 8.0 : take_double(&in);
    rqt_view_bound b;
    rqt_view_tolerance(&camera, &prism, &b);
    HOLD(b.eps >= 0 && isfinite(b.eps), "eps %g", b.eps);
    HOLD(b.distance >= 0 && isfinite(b.distance), "distance %g", b.distance);
    HOLD(b.share >= 0 && b.share <= 1, "share %g", b.share);
    in_band(&in, &camera, &prism, &b, sound && length > 0 && prism.upright <= 1);
    /* The piece's middle, and what is eps above it. */
    if (!sound || !(prism.radius >= 0) || !(length > 0) || !(prism.upright <= 1)) return 0;
    bool drawn = rqt_camera_project(&camera, prism.centre, xy);
    HOLD(!drawn || b.shown, "the middle is drawn, the piece is not shown");
    double above[3], there[2];
    for (int c = 0; c < 3; c++) above[c] = prism.centre[c] + b.eps * prism.up[c];
    drawn |= rqt_camera_project(&camera, above, there);
    /* Doubles, so only where they do not round too much. */
    double far = 1;
    for (int c = 0; c < 3; c++) far = fmax(far, fmax(fabs(prism.centre[c]), fabs(camera.eye[c])));
    if (!drawn || far > 1e6 || !(b.eps > 1e-6)) return 0;
    HOLD(hypot(xy[0] - there[0], xy[1] - there[1]) <= camera.tau * (1 + 1e-3), "(%g,%g) and (%g,%g)", xy[0], xy[1],
         there[0], there[1]);
    return 0;
}
