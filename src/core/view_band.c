/* view_band.c - how far a camera may go before its view has to be made anew.
 *
 * Let A and B be cameras with one lens (all but eye and directions equal). The rotation that takes A's directions
 * to B's, around A's eye, and the shift of A's eye to B's make one rigid motion that takes A to B; call its inverse
 * g. B sees a point p where A sees g(p): depths, places in the picture and distances from the eye are the same. So
 * a mesh is within the tolerance for B iff what g makes of mesh and samples is for A, and g keeps distances: |S -
 * M| <= eps is |g(S) - g(M)| <= eps.
 *
 * Let the eyes be at most `move` apart and the rotation's angle be a, turn = 2 sin(a/2). A rotation by a moves a
 * point at a distance r from its centre by at most r * turn: so g moves a point at a distance r from A's eye by at
 * most move + (r + move) * turn. So g takes the samples of a piece into the piece grown by that much, r the
 * distance of its furthest point. What the tolerance allows the piece that was grown, for A (rqt_view_tolerance),
 * it allows the piece itself, for every such B; where the former is not shown, nor is the latter. That is all:
 * nothing here knows how tolerances come about.
 *
 * The rotation takes forward, right, up to others; the sum of the squares of how far the three ends move is
 * 8 sin^2(a/2), the squared norm of the matrix R - 1. So 2 sin(a/2) comes without an arc cosine, which loses all
 * that is small.
 *
 * How large a band? A piece at a distance d loses about the share (move + d * turn) / d of its eps. With move = s *
 * (the nearest that is shown) and turn = s that is at most 2s: an eighth, for s = 1/16 (1.4 times as much where a
 * piece is seen slantwise: it grows sideways and upward). What is shown grows by s seen from the eye, on each side,
 * twice: for long lenses s is less. */
#include "internal.h"

#include <math.h>

static const double LARGEST_SHARE = 1.0 / 16;
static const double SHARE_OF_PICTURE = 1.0 / 8; /* of half the shorter side */
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

void rqt_prism_grow(const rqt_camera *anchor, const rqt_view_band *band, rqt_prism *prism) {
    const double furthest =
        distance_of(prism->centre, anchor->eye) + hypot(prism->radius, prism->half_height) + band->move;
    const double most =
        band->move + band->turn * furthest + ROUNDING * (furthest + size_of(prism->centre) + size_of(anchor->eye));
    prism->radius += most;
    prism->half_height += most;
}
