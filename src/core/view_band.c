/* view_band.c - how far a camera may go before its view has to be made anew.
 *
 * Let A and B be cameras with one lens (all but eye and directions equal), the eyes at most `move` apart; the
 * rotation that takes A's directions to B's turns by an angle a, turn = 2 sin(a/2).
 *
 * Moved. Let C be at B's eye and look as A does. C sees a point p where A sees p - d, d the shift from eye to eye:
 * so it sees a piece as A sees one that is somewhere in the piece grown by `move`. Distances from the eye and
 * angles between rays and the terrain's verticals are the same for both.
 *
 * Turned. B is C, turned around its own eye: for those distances and angles that changes nothing. B sees p where C
 * sees what the rotation back makes of p, which is at most r * turn away, r the distance of p from the eye, no more
 * than move + the distance from A's eye. So B sees a piece as A sees one in the piece grown by move + turn * (move
 * + the distance of its furthest point): depths, places in the picture and what the frustum misses are the same.
 *
 * The tolerance (view.c) takes distances and angles to verticals for themselves, and the picture for itself: so it
 * asks the piece grown by `move` for the former, and the piece grown by all for the latter. What comes out holds
 * for every such B. When nothing of the piece grown by all is shown, B shows nothing of the piece.
 *
 * The rotation takes forward, right, up to others; the sum of the squares of how far the three ends move is
 * 8 sin^2(a/2), the squared norm of the matrix R - 1. So 2 sin(a/2) comes without an arc cosine, which loses all
 * that is small.
 *
 * How large a band? A piece at a distance d loses about the share move / d of its eps: with move = s * (the nearest
 * that is shown) no more than s, 1.4 times as much where it is seen slantwise and grows sideways and upward. What
 * is shown grows by turn = s, and by move seen from the eye, on each side. For long lenses s is less than the usual
 * 1/16. */
#include "view_core.h"

#include <math.h>

static const double LARGEST_SHARE = 1.0 / 16;
static const double SHARE_OF_PICTURE = 1.0 / 16; /* of half the shorter side */
/* Of all lengths and coordinates that are at hand: what doubles round away, of directions that are not quite unit
 * or not quite at right angles too. */
static const double ROUNDING = 0x1p-44;
/* A jitter of some ulps is within any band. */
static const double JITTER = 0x1p-40;

static double distance_of(const double a[3], const double b[3]) {
    return hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
}

static double size_of(const double a[3]) {
    return fmax(fmax(fabs(a[0]), fabs(a[1])), fabs(a[2]));
}

rqt_view_band rqt_camera_band(const rqt_camera *camera, double nearest) {
    const double shorter = fmin(camera->width, camera->height);
    const double share = fmin(LARGEST_SHARE, SHARE_OF_PICTURE * shorter / (2 * camera->focal));
    const double jitter = JITTER * (1 + size_of(camera->eye));
    return (rqt_view_band){.move = fmax(share * fmax(nearest, camera->near), jitter), .turn = fmax(share, JITTER)};
}

bool rqt_camera_holds(const rqt_camera *anchor, const rqt_view_band *band, const rqt_camera *camera) {
    if (camera->width != anchor->width || camera->height != anchor->height || camera->focal != anchor->focal ||
        camera->near != anchor->near || camera->far != anchor->far || camera->tau != anchor->tau)
        return false;
    const double f = distance_of(camera->forward, anchor->forward), r = distance_of(camera->right, anchor->right),
                 u = distance_of(camera->up, anchor->up);
    return distance_of(camera->eye, anchor->eye) <= band->move && sqrt((f * f + r * r + u * u) / 2) <= band->turn;
}

static rqt_prism grown(const rqt_prism *prism, double by) {
    rqt_prism p = *prism;
    p.radius += by;
    p.half_height += by;
    return p;
}

void rqt_view_tolerance_in_band(const rqt_camera *anchor, const rqt_view_band *band, const rqt_prism *prism,
                                rqt_view_bound *bound) {
    const double furthest =
        distance_of(prism->centre, anchor->eye) + hypot(prism->radius, prism->half_height) + band->move;
    const double rounding = ROUNDING * (furthest + size_of(prism->centre) + size_of(anchor->eye));
    const rqt_prism place = grown(prism, band->move + rounding),
                    picture = grown(prism, band->move + band->turn * furthest + rounding);
    view_tolerance(anchor, &place, &picture, bound);
}

/* The pyramid of the picture, each side turned outward by the turn and shifted outward by the move, which is the
 * pyramid of an eye further back. Nothing is proved by it. */
rqt_camera rqt_camera_widen(const rqt_camera *anchor, const rqt_view_band *band) {
    rqt_camera wide = *anchor;
    const double turn = 2 * asin(fmin(band->turn / 2, 1)), most = M_PI / 2 * 0.999;
    const double across = fmin(atan(anchor->width / (2 * anchor->focal)) + turn, most),
                 upward = fmin(atan(anchor->height / (2 * anchor->focal)) + turn, most);
    const double back = band->move / sin(fmin(across, upward));
    wide.width = 2 * anchor->focal * tan(across);
    wide.height = 2 * anchor->focal * tan(upward);
    for (int c = 0; c < 3; c++) wide.eye[c] -= back * anchor->forward[c];
    wide.near = fmax(anchor->near - back, 0);
    wide.far = anchor->far + 2 * back;
    return wide;
}
