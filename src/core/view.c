/* view.c - cameras, and the guaranteed test: rqt_view.h.
 *
 * What is to be shown: S in the piece, |S - M| <= eps, S or M drawn; then both have a depth > 0, and the pictures
 * of S and M are at most tau apart. Lengths in the picture in units of the focal length: s = tau / focal, and a
 * point is at the distance tan(a) from the picture's middle when the angle between its direction and `forward` is
 * a.
 *
 * From metres to an angle. Let A be the one of S and M that is drawn, B the other. The angle at the eye between two
 * points one of which is at most eps from the other is at most asin(eps / distance), of either's distance if that
 * is above eps. A is at least `near` away, for it has that depth; S is at least d away, d being the distance of the
 * piece. So the angle is at most asin(eps / max(d, near)): by A's distance when near is the larger one, else by
 * S's.
 *
 * From an angle to the picture. Let a point have the angle a < 90 degrees to the axis and another one be seen
 * within phi of it, a + phi < 90 degrees: a circle of directions, the picture of which is an ellipse with one axis
 * along the ray from the middle, of which tan(a - phi) and tan(a + phi) are the ends; its axis across is the
 * shorter one (a gnomonic picture stretches by 1 / cos^2 along that ray, by 1 / cos across). The first point's
 * picture is on the long axis, nearer to the inner end; a point of an ellipse is farthest from one on its long axis
 * at the farther end of that. So the pictures are at most tan(a + phi) - tan(a) apart, which is s for tan(phi) = s
 * / (1 + t (t + s)),  t = tan(a), sin(phi) = s / sqrt((1 + t^2) (1 + (t + s)^2)) = kappa(t), and the depth of both
 * is > 0. Nothing was given away: some point at that angle is exactly s away. kappa falls with t, so what holds for
 * the largest t holds for smaller ones. t may be
 *   - the picture's corner: take A for the first point;
 *   - the largest of any point of the piece: take S for the first point, drawn or not.
 * The smaller of both is used, and eps = kappa(t) max(d, near).
 *
 * Where meshes differ from the terrain upward and downward only, and one looks down on them, more is allowed. Let
 * the ray from the eye to S make an angle with the line through S and M whose sine is at most q. Twice the area of
 * the triangle eye, S, M is |ES| |SM| q at most, and it is |ES| |EM| times the sine of the angle at the eye, which
 * is eps q / |EM| then. With r = max(d, near) either M is drawn and at least near away, or |EM| >= |ES| - eps; in
 * both cases (as above) |EM| >= r - eps: kappa is kept for eps = kappa r / (q + kappa). That is below r, so the
 * angle at the eye, opposite to a side shorter than another one, is an acute one. The better of both is used, by
 * setting q + kappa to 1 where it is above.
 *
 * Where nothing of the piece can be drawn. The frustum, which is what is drawn, is convex and so is the piece; a
 * lower bound of their distance is how far they are apart along any unit vector. As long as eps is less, neither S
 * nor M is drawn. So eps may as well be that gap, whichever is larger, and the piece is not shown iff it is the
 * gap. M may be anywhere in a ball around S: in geocentric scenes verticals are not parallel, and the gap is so
 * much larger than kappa d just beside the frustum that more careful gaps would buy nothing.
 *
 * The same holds between samples: the piece is convex, and so is a ball; points of a mesh and of the terrain's
 * finest triangles at the same place are the same weighted mean of such M and S.
 *
 * Rounding. Eye and piece are doubles, their difference is exact to a 2^-53rd of itself; every length computed from
 * it is wrong by some of 2^-53 times |centre - eye| + radius + half_height, and a camera's vectors and `up` are
 * unit and at right angles up to as much. So lengths that matter (d and gap) are made smaller by SLACK of that sum:
 * a tenth of a micrometre at 10^7 m, ten of them at 10^9 m. What is a product of few factors, kappa, is right to
 * far less than RELATIVE, by which eps is made smaller; t is where it comes from subtracting, and is then used only
 * below 100 (89.4 degrees off the axis). A sum that is not a number (an eye at 10^300 m) gives eps 0, shown. */
#include "view_core.h"

#include <math.h>

#define SLACK 1e-14
#define RELATIVE (1 - 1e-9)
#define STEEPEST 100.0

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
static double larger(double a, double b) {
    return a >= b ? a : b;
}
static double smaller(double a, double b) {
    return a < b ? a : b;
}
static double above_zero(double a) {
    return a > 0 ? a : 0;
}

/* --------------------------------------------------------------------------------------------- cameras -- */

static void cross(const double a[3], const double b[3], double out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Of length 1, whatever its length was; false when that was 0 or is no number. */
static bool make_unit(const double v[3], double out[3]) {
    const double most = larger(larger(fabs(v[0]), fabs(v[1])), fabs(v[2]));
    if (!(most > 0) || !isfinite(v[0]) || !isfinite(v[1]) || !isfinite(v[2])) return false;
    const double scaled[3] = {v[0] / most, v[1] / most, v[2] / most};
    const double length = sqrt(dot(scaled, scaled));
    for (int c = 0; c < 3; c++) out[c] = scaled[c] / length;
    return true;
}

/* Directions nearer to parallel than this have no plane worth the name: eye and target of a camera that looks
 * straight down may have been rounded. */
#define PARALLEL 1e-9

/* The camera's right and up: `vertical`, unit, as near to up as it can be. False: it is along `forward`. */
static bool roll(rqt_camera *camera, const double vertical[3]) {
    double side[3];
    cross(camera->forward, vertical, side);
    if (!(dot(side, side) > PARALLEL * PARALLEL)) return false;
    (void)make_unit(side, camera->right);
    /* What rounding made of short sides is taken off. */
    const double off = dot(camera->right, camera->forward);
    for (int c = 0; c < 3; c++) camera->right[c] -= off * camera->forward[c];
    (void)make_unit(camera->right, camera->right);
    cross(camera->right, camera->forward, camera->up);
    return make_unit(camera->up, camera->up);
}

static rqt_status refuse(rqt_message *message, const char *why) {
    sentence_begin(message, why);
    return RQT_INVALID;
}

rqt_status rqt_camera_look(rqt_camera *camera, const double eye[3], const double direction[3],
                           const double vertical[3], const double ahead[3], double fovy, rqt_message *message) {
    double upright[3], instead[3];
    if (!isfinite(eye[0]) || !isfinite(eye[1]) || !isfinite(eye[2]))
        return refuse(message, "the eye of the camera is not finite");
    memcpy(camera->eye, eye, sizeof camera->eye);
    if (!make_unit(direction, camera->forward))
        return refuse(message, "the camera looks nowhere: its direction is no vector, or of length 0");
    if (!make_unit(vertical, upright) || !make_unit(ahead, instead))
        return refuse(message, "the vertical of the camera is no vector, or of length 0");
    if (!(fovy > 0 && fovy < 180)) return refuse(message, "the field of view is not between 0 and 180 degrees");
    if (!(camera->width > 0 && camera->height > 0) || !isfinite(camera->width) || !isfinite(camera->height))
        return refuse(message, "the picture has no width or no height");
    if (!(camera->tau > 0) || !isfinite(camera->tau))
        return refuse(message, "the tolerance in pixels is not above 0, or not finite");
    if (!(camera->near >= 0 && camera->near < camera->far))
        return refuse(message, "near and far are not 0 <= near < far");
    camera->focal = camera->height / (2 * tan(fovy * (3.14159265358979323846 / 360)));
    if (!(camera->focal > 0) || !isfinite(camera->focal)) return refuse(message, "the field of view is too small");

    if (roll(camera, upright) || roll(camera, instead)) return RQT_OK;
    /* The axis that is farthest from parallel. */
    int least = 0;
    for (int c = 1; c < 3; c++)
        if (fabs(camera->forward[c]) < fabs(camera->forward[least])) least = c;
    const double other[3] = {least == 0, least == 1, least == 2};
    (void)roll(camera, other);
    return RQT_OK;
}

bool rqt_camera_project(const rqt_camera *camera, const double point[3], double xy[2]) {
    const double v[3] = {point[0] - camera->eye[0], point[1] - camera->eye[1], point[2] - camera->eye[2]};
    const double depth = dot(v, camera->forward);
    if (!(depth > 0)) {
        xy[0] = xy[1] = NAN;
        return false;
    }
    xy[0] = camera->width / 2 + camera->focal * (dot(v, camera->right) / depth);
    xy[1] = camera->height / 2 - camera->focal * (dot(v, camera->up) / depth);
    return depth >= camera->near && depth <= camera->far && xy[0] >= 0 && xy[0] <= camera->width && xy[1] >= 0 &&
           xy[1] <= camera->height;
}

/* ------------------------------------------------------------------------------------------- tolerance -- */

/* The sine of the angle that tau allows where the tangent of the angle to the axis is t. */
static double kappa(double s, double t) {
    return s / sqrt((1 + t * t) * (1 + (t + s) * (t + s)));
}

/* A prism as the camera sees it: mirrored so that its centre is neither to the left of the axis nor below it. */
typedef struct sight {
    double at[3], axis[3]; /* centre - eye and the prism's up, along right, up and forward */
    double along, across;  /* centre - eye along the prism's up, and how long the rest is */
    double radius, half_height;
    double ball,
        tangent;         /* the radius of the ball around it, how long a tangent is to that; 0: the eye is inside */
    double halfwidth[2]; /* of the picture, over the focal length: x, y */
} sight;

static sight see(const rqt_camera *camera, const rqt_prism *prism) {
    const double v[3] = {prism->centre[0] - camera->eye[0], prism->centre[1] - camera->eye[1],
                         prism->centre[2] - camera->eye[2]};
    sight s = {.at = {dot(v, camera->right), dot(v, camera->up), dot(v, camera->forward)},
               .axis = {dot(prism->up, camera->right), dot(prism->up, camera->up), dot(prism->up, camera->forward)},
               .along = dot(v, prism->up),
               .radius = prism->radius,
               .half_height = prism->half_height,
               .halfwidth = {camera->width / (2 * camera->focal), camera->height / (2 * camera->focal)}};
    const double rest[3] = {v[0] - s.along * prism->up[0], v[1] - s.along * prism->up[1],
                            v[2] - s.along * prism->up[2]};
    s.across = sqrt(dot(rest, rest));
    const double ball = s.radius * s.radius + s.half_height * s.half_height;
    s.ball = sqrt(ball);
    s.tangent = sqrt(above_zero(dot(v, v) - ball));
    for (int c = 0; c < 2; c++) {
        if (s.at[c] >= 0) continue;
        s.at[c] = -s.at[c];
        s.axis[c] = -s.axis[c];
    }
    return s;
}

/* How far the prism reaches from its centre along a unit vector that has this cosine with its axis. */
static double reach(const sight *s, double cosine) {
    return s->half_height * fabs(cosine) + s->radius * sqrt(above_zero(1 - cosine * cosine) + 4e-15);
}

/* How far the prism is beyond the frustum along some unit vectors: all of it, and its farthest point. */
typedef struct gap {
    double whole, farthest;
} gap;

static void widen(gap *g, double centre, double extent) {
    g->whole = larger(g->whole, centre - extent);
    g->farthest = larger(g->farthest, centre + extent);
}

static gap beyond(const rqt_camera *camera, const sight *s) {
    const double *const at = s->at, *const axis = s->axis, *const edge = s->halfwidth;
    gap g = {camera->near - at[2] - reach(s, axis[2]), camera->near - at[2] + reach(s, axis[2])};
    widen(&g, at[2] - camera->far, reach(s, axis[2]));
    for (int c = 0; c < 2; c++) {
        const double share = 1 / sqrt(1 + edge[c] * edge[c]);
        widen(&g, (at[c] - edge[c] * at[2]) * share, reach(s, (axis[c] - edge[c] * axis[2]) * share));
    }
    /* Along the prism's own axis: the sky above the terrain. The frustum's points of depth 1 are between low and
     * high there. */
    const double spread = edge[0] * fabs(axis[0]) + edge[1] * fabs(axis[1]),
                 rounding = 4e-15 * (1 + edge[0] + edge[1]), low = axis[2] - spread - rounding,
                 high = axis[2] + spread + rounding;
    widen(&g, (low < 0 ? camera->far : camera->near) * low - s->along, s->half_height);
    widen(&g, s->along - (high > 0 ? camera->far : camera->near) * high, s->half_height);
    return g;
}

/* Two angles of 0 to 180 degrees, each as a cosine and a sine, times the same length. */
typedef struct angles {
    double least[2], largest[2];
} angles;

/* Of the rays from the eye that hit the ball around the prism, with the axis along and across which its centre is:
 * not cut off at 0 and 180 degrees. The eye is not inside. */
static angles spread(const sight *s, double along, double across) {
    return (angles){{along * s->tangent + across * s->ball, across * s->tangent - along * s->ball},
                    {along * s->tangent - across * s->ball, across * s->tangent + along * s->ball}};
}

/* Lower and upper bounds of something, over a piece. */
typedef struct range {
    double least, largest;
} range;

/* The tangents of the angles to the camera's axis that drawn points of the ball around the prism can have. */
static range tangents(const sight *s, double corner) {
    range t = {0, corner};
    if (!(s->tangent > 0)) return t;
    const angles a = spread(s, s->at[2], sqrt(s->at[0] * s->at[0] + s->at[1] * s->at[1]));
    const double most = smaller(corner, STEEPEST);
    if (a.largest[0] > 0 && a.largest[1] < most * a.largest[0]) t.largest = a.largest[1] / a.largest[0];
    if (a.least[1] > 0) t.least = a.least[1] < t.largest * a.least[0] ? a.least[1] / a.least[0] : t.largest;
    return t;
}

/* The sines of the angles between rays to points of the prism and the direction in which a mesh may differ there.
 */
static range sines(const sight *s, double upright) {
    if (!(upright > 0)) return (range){1, 1};
    range r = {0, 1};
    if (!(s->tangent > 0)) return r;
    const angles a = spread(s, fabs(s->along), s->across);
    const double length = s->tangent * s->tangent + s->ball * s->ball,
                 tilt = sqrt(above_zero(1 - upright * upright)),
                 outer = a.largest[0] * upright - a.largest[1] * tilt;
    if (outer > 0) r.largest = smaller((a.largest[1] * upright + a.largest[0] * tilt) / length + SLACK, 1);
    r.least = smaller(above_zero((a.least[1] * upright - a.least[0] * tilt) / length), r.largest);
    return r;
}

/* eps at a distance, for the sine of the angle that tau allows and that of the angle between ray and difference. */
static double allowed(double kappa, double sine, double distance) {
    return distance * (kappa / smaller(sine + kappa, 1));
}

void view_tolerance(const rqt_camera *camera, const rqt_prism *place, const rqt_prism *picture,
                    rqt_view_bound *bound) {
    const sight s = see(camera, place), seen_as = place == picture ? s : see(camera, picture);
    const double corner = sqrt(s.halfwidth[0] * s.halfwidth[0] + s.halfwidth[1] * s.halfwidth[1]),
                 pixel = camera->tau / camera->focal,
                 slack =
                     SLACK * (fabs(s.at[0]) + fabs(s.at[1]) + fabs(s.at[2]) + seen_as.radius + seen_as.half_height);
    const double up = above_zero(fabs(s.along) - s.half_height - slack),
                 aside = above_zero(s.across - s.radius - slack), distance = sqrt(up * up + aside * aside);
    const range t = tangents(&seen_as, corner), sine = sines(&s, place->upright);
    const gap g = beyond(camera, &seen_as);
    const double drawn = RELATIVE * allowed(kappa(pixel, t.largest), sine.largest, larger(distance, camera->near)),
                 hidden = RELATIVE * (g.whole - slack);
    *bound = (rqt_view_bound){.eps = larger(drawn, hidden), .shown = !(hidden >= drawn), .distance = distance};

    /* The best that a part of it could have, far away and near the axis. Beyond the frustum more, which is of no
     * use where no part is drawn: there it only has to be no less than what the neighbours have. */
    const double deep = fabs(s.along) + s.half_height, wide = s.across + s.radius,
                 farthest = sqrt(deep * deep + wide * wide),
                 seen = allowed(kappa(pixel, t.least), sine.least, larger(farthest, camera->near)),
                 best = bound->shown ? larger(seen, g.farthest) : seen;
    bound->share = best > 0 ? smaller(bound->eps / best, 1) : 1;
    if (!(isfinite(slack) && isfinite(drawn) && isfinite(bound->eps) && bound->eps >= 0 && bound->share >= 0))
        *bound = (rqt_view_bound){.eps = 0, .shown = true, .distance = 0, .share = 0};
}

void rqt_view_tolerance(const rqt_camera *camera, const rqt_prism *prism, rqt_view_bound *bound) {
    view_tolerance(camera, prism, prism, bound);
}
