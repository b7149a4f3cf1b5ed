/* view_tests.c - tests of the literature, by name: METHODS.md, "Views".
 *
 * A paper says for which vertices, triangles or nodes an error is too large on the screen. Turned round, its
 * inequality says how large the error may be at a place: eps, of the metric that the paper takes. All of them ask
 * for
 *
 *     eps = tau / f * a length that grows with the distance from the eye
 *
 * with f the focal length in pixels, and differ in that length, and in what it is measured to: the nearest point of
 * a piece where the paper asks vertices or boxes, the middle where it asks nodes or patches. As fields of squares
 * (rqt.h, "rules") they are crack-free whatever they ask for, which most were not as published, and a vertex gets
 * the least eps in reach of all that depends on it.
 *
 * Culling is one for all of them: a piece that lies beyond one of the frustum's planes is left out, as in the
 * papers, which test boxes or balls; the prism is a sharper body than both. Nothing is asked for there, and nothing
 * is done about what rises from there into the picture: that is the guaranteed test's business (view.c). */
#include "internal.h"

#include <math.h>

typedef struct span {
    double least, most;
} span;

/* A piece as it lies before the eye. */
typedef struct sight {
    double to_centre[3];
    span ground, height; /* distances from the eye that its points have: along the ground, and up or down */
} sight;

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static span span_around(double middle, double half) {
    return (span){fmax(0, middle - half), middle + half};
}

static sight sight_of(const rqt_camera *camera, const rqt_prism *prism) {
    sight s;
    for (int i = 0; i < 3; i++) s.to_centre[i] = prism->centre[i] - camera->eye[i];
    const double rise = dot(s.to_centre, prism->up);
    double along = 0;
    for (int i = 0; i < 3; i++) {
        const double part = s.to_centre[i] - rise * prism->up[i];
        along += part * part;
    }
    s.ground = span_around(sqrt(along), prism->radius);
    s.height = span_around(fabs(rise), prism->half_height);
    return s;
}

/* ---------------------------------------------------------------------------------------------- culling -- */

/* The largest n . (p - eye) that a point p of the prism has. */
static double furthest(const sight *s, const rqt_prism *prism, const double n[3]) {
    const double upward = dot(n, prism->up);
    return dot(n, s->to_centre) + prism->half_height * fabs(upward) +
           prism->radius * sqrt(fmax(0, dot(n, n) - upward * upward));
}

/* Is a part of it on the inner side of every plane of the frustum? */
static bool is_before(const sight *s, const rqt_prism *prism, const rqt_camera *camera) {
    double inward[3];
    for (int i = 0; i < 3; i++) inward[i] = -camera->forward[i];
    if (furthest(s, prism, inward) < -camera->far || furthest(s, prism, camera->forward) < camera->near)
        return false;
    for (int side = 0; side < 4; side++) {
        const double *const across = side < 2 ? camera->right : camera->up;
        const double half = (side < 2 ? camera->width : camera->height) / 2,
                     f = side & 1 ? -camera->focal : camera->focal;
        for (int i = 0; i < 3; i++) inward[i] = half * camera->forward[i] + f * across[i];
        if (furthest(s, prism, inward) < 0) return false;
    }
    return true;
}

/* ------------------------------------------------------------------------------------------- the lengths -- */

static double norm(double a, double b) {
    return sqrt(a * a + b * b);
}

static span euclidean(const sight *s) {
    return (span){norm(s->ground.least, s->height.least), norm(s->ground.most, s->height.most)};
}

/* The largest of three coordinate differences, to the box. */
static span chebyshev(const sight *s, const rqt_view_piece *piece) {
    const double *up = piece->prism.up, *east = piece->east;
    const double north[3] = {up[1] * east[2] - up[2] * east[1], up[2] * east[0] - up[0] * east[2],
                             up[0] * east[1] - up[1] * east[0]};
    const double *const axis[3] = {east, north, up};
    const double half[3] = {piece->half_east, piece->half_north, piece->prism.half_height};
    span all = {0, 0};
    for (int i = 0; i < 3; i++) {
        const span one = span_around(fabs(dot(s->to_centre, axis[i])), half[i]);
        all = (span){fmax(all.least, one.least), fmax(all.most, one.most)};
    }
    return all;
}

/* A vertical segment at a distance r along the ground and h in height is seen under the angle length * r / (r^2 +
 * h^2). */
static double foreshortened(double r, double h) {
    if (r > 0) return r + h * h / r;
    return h > 0 ? INFINITY : 0;
}

/* It is convex in r, with its least at r = h, and grows with h. */
static span vertical_segment(const sight *s) {
    const double best = fmin(fmax(s->height.least, s->ground.least), s->ground.most);
    return (span){foreshortened(best, s->height.least), fmax(foreshortened(s->ground.least, s->height.most),
                                                             foreshortened(s->ground.most, s->height.most))};
}

/* Ahead the distance, behind infinite: where eps is the same are cardioids, the eye in their cusp. */
static double by_direction(const rqt_camera *camera, const double to[3]) {
    const double distance = sqrt(dot(to, to));
    if (!(distance > 0)) return 0;
    const double weight = (1 + dot(to, camera->forward) / distance) / 2;
    return weight > 0 ? distance / weight : INFINITY;
}

/* ------------------------------------------------------------------------------------------------- tests -- */

const char *rqt_view_test_name(rqt_view_test test) {
    static const char *const names[RQT_VIEW_TESTS] = {"guaranteed", "ulrich",    "node",
                                                      "sphere",     "lindstrom", "lodmap"};
    return (unsigned)test < RQT_VIEW_TESTS ? names[test] : NULL;
}

rqt_metric rqt_view_test_metric(rqt_view_test test) {
    static const rqt_metric metrics[RQT_VIEW_TESTS] = {RQT_METRIC_EXACT, RQT_METRIC_LOCAL, RQT_METRIC_PLANE,
                                                       RQT_METRIC_LOCAL, RQT_METRIC_LOCAL, RQT_METRIC_EUCLID};
    return (unsigned)test < RQT_VIEW_TESTS ? metrics[test] : RQT_METRIC_EXACT;
}

/* Least over most, where there is nothing to be won 1. */
static double share_of(span length) {
    return length.least < length.most ? length.least / length.most : 1;
}

void rqt_view_test_bound(rqt_view_test test, const rqt_camera *camera, const rqt_view_piece *piece,
                         rqt_view_bound *bound) {
    if (test == RQT_VIEW_GUARANTEED) {
        rqt_view_tolerance(camera, &piece->prism, bound);
        return;
    }
    const sight s = sight_of(camera, &piece->prism);
    span length = euclidean(&s);
    *bound = (rqt_view_bound){.eps = INFINITY, .distance = length.least, .share = 1};
    if (!is_before(&s, &piece->prism, camera)) return;
    bound->shown = true;
    double per_length = camera->tau / camera->focal;
    double asked;
    switch (test) {
    case RQT_VIEW_ULRICH:
        length = chebyshev(&s, piece);
        asked = length.least;
        break;
    case RQT_VIEW_LINDSTROM:
        length = vertical_segment(&s);
        asked = length.least;
        break;
    case RQT_VIEW_NODE:
        asked = sqrt(dot(s.to_centre, s.to_centre));
        break;
    case RQT_VIEW_LODMAP:
        asked = piece->side > RQT_VIEW_PATCH ? 0 : by_direction(camera, s.to_centre);
        length = piece->side > RQT_VIEW_PATCH ? (span){0, 1} : (span){1, 1};
        break;
    default: /* the sphere: the field of view over the picture's height, radians per pixel */
        per_length = camera->tau * 2 * atan(camera->height / (2 * camera->focal)) / camera->height;
        asked = length.least;
    }
    bound->eps = asked * per_length;
    if (!(bound->eps >= 0)) bound->eps = 0; /* of coordinates without end */
    bound->share = share_of(length);
}
