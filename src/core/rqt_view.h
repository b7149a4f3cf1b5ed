/* rqt_view.h - cameras, and what they ask of a terrain: the rest of rqt.h.
 *
 * A view is a camera and a tolerance in pixels. It becomes a field (rqt.h, "rules"): each square of ground gets the
 * eps that keeps what is drawn there within the tolerance on the screen. view.c has the proof.
 *
 * *Scene*: a space in metres, in which camera and terrain are: heights are exaggerated in it already. What makes a
 * scene of a terrain's coordinates is the caller's business; here are only points.
 *
 * Sources: [ULRICH] "Rendering massive terrains using chunked level of detail control" and its predecessor on
 * adaptive quadtrees (2000); [LINDSTROM] "Real-time, continuous level of detail rendering of height fields" (1996);
 * [RQT] as in rqt.h; METHODS.md has the definitions of all named tests.
 */
#ifndef RQT_VIEW_H
#define RQT_VIEW_H

#include "rqt.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct rqt_camera {
    double eye[3];
    double forward[3], right[3], up[3]; /* unit, at right angles to each other; right = forward x up */
    double width, height;               /* of the picture, pixels */
    double focal;                       /* height / (2 tan(fovy / 2)), pixels */
    double near, far; /* what is drawn has a depth along `forward` in near .. far; 0 <= near < far,
                         far may be infinite */
    double tau;       /* tolerance, pixels, > 0 */
} rqt_camera;

/* A camera at `eye` that looks along `direction` (any length but 0), rolled so that `vertical` (any length but 0)
 * points upward in the picture; where the two are parallel (to 10^-9), `ahead` does instead (any length but 0), and
 * gives way to any other direction where it is parallel too. fovy: degrees, 0 < fovy < 180. Everything else is
 * taken as it is: near, far, width, height, tau must have been set. RQT_INVALID, with a sentence, when the camera
 * is none: an eye or a direction that is not finite, 0 pixels, a tau that is not above 0, near >= far, a fovy so
 * small that focal overflows. */
rqt_status rqt_camera_look(rqt_camera *camera, const double eye[3], const double direction[3],
                           const double vertical[3], const double ahead[3], double fovy, rqt_message *message);

/* Where a point of the scene is in the picture: x to the right, y downward, pixels, (0,0) the upper left corner.
 * False when it is not drawn: its depth is not in near .. far, or not above 0, or it is outside the picture. xy is
 * its place in the (infinite) picture plane whenever its depth is above 0, drawn or not; else not a number. */
bool rqt_camera_project(const rqt_camera *camera, const double point[3], double xy[2]);

/* A piece of the scene: all points p with |(p - centre) . up| <= half_height, and the rest of p - centre no longer
 * than radius. It must hold the samples of its ground; whoever computes it in doubles makes it larger by what that
 * rounds. Where radius is large against the planet, up is no vertical any more: half_height has to cover that. */
typedef struct rqt_prism {
    double centre[3], up[3]; /* up: unit */
    double radius, half_height;
    double upright; /* the least cosine of the angle between the line along which a mesh differs from a sample and
                       up: 1 where heights are counted along up (eps is then larger where one looks down on the
                       piece), 0: in any direction, which is always safe */
} rqt_prism;

/* What the tolerance allows the terrain whose samples are all in a piece. */
typedef struct rqt_view_bound {
    double eps;      /* metres of the scene: how far the mesh may be from a sample there; never not a number */
    bool shown;      /* false: nothing of the terrain there, nor of a mesh within eps of it, is drawn */
    double distance; /* a lower bound of how far the samples are from the eye */
    double
        share; /* 0 .. 1: eps over the most that any part of the piece could get. What is less than 1 was lost
                  to the piece's being large: against its distance, sideways or upward, across the frustum's
                  border, or in its angles to the axis and to up. Well below 1 it is worth splitting; at 1 nothing
                  is to be won. Where nothing is shown: over the most that could be of use, what drawn pieces as far
                  away as its farthest point have. 0 around an eye, whatever the size: stop somewhere. */
} rqt_view_bound;

/* The guaranteed test. For every point S of the piece and every point M of a mesh with |S - M| <= eps, in any
 * direction that `upright` admits: when S or M is drawn (near .. far, inside the picture), their places in the
 * picture (of the infinite picture plane; both have a depth > 0) are at most tau apart. Where nothing is drawn eps
 * says how far M has to stay from the frustum: it is finite, but large beside what is drawn. Of use are cameras of
 * rqt_camera_look; numbers that are not finite, or too large to be squared, give eps 0. */
void rqt_view_tolerance(const rqt_camera *camera, const rqt_prism *prism, rqt_view_bound *bound);

/* -------------------------------------------------------------------------------------------------- bands --
 * A view that is also right for cameras near the one it was made for: view_band.c has the proof. */
typedef struct rqt_view_band {
    double move; /* how far the eye may go, metres of the scene */
    double turn; /* how far the camera may turn, around any axis: 2 sin(half the angle) */
} rqt_view_band;

/* A band that costs about a sixteenth of the tolerance (where pieces are seen slantwise a tenth), and some ground
 * beside what the camera sees: nearest is how far what is nearest of the terrain is from the eye, about (wrong, the
 * band is still right, but too dear or too narrow). move and turn are > 0. */
rqt_view_band rqt_camera_band(const rqt_camera *camera, double nearest);
/* Is a camera within the band of another? One lens, tau and range of depths are needed: all that is not eye and
 * directions must be equal. */
bool rqt_camera_holds(const rqt_camera *anchor, const rqt_view_band *band, const rqt_camera *camera);
/* A camera that sees about what those of the band see together: where to look more closely. */
rqt_camera rqt_camera_widen(const rqt_camera *anchor, const rqt_view_band *band);
/* rqt_view_tolerance that holds for every camera of the band. */
void rqt_view_tolerance_in_band(const rqt_camera *anchor, const rqt_view_band *band, const rqt_prism *prism,
                                rqt_view_bound *bound);

/* ---------------------------------------------------------------------------------------------- other tests --
 * Tests of the literature, by name, for comparing: they guarantee nothing on the screen. Each says how large the
 * error of its own metric may be in a piece; METHODS.md, "Views", has definitions, sources and what was mended. */
typedef enum rqt_view_test {
    RQT_VIEW_GUARANTEED,
    RQT_VIEW_ULRICH,    /* seed of chunked quadtrees: error against the Chebyshev distance to the piece's box */
    RQT_VIEW_NODE,      /* size over distance, weighed by a plane fitted to the node */
    RQT_VIEW_SPHERE,    /* error spheres */
    RQT_VIEW_LINDSTROM, /* the vertical segment on the screen */
    RQT_VIEW_LODMAP     /* [RQT]: one eps per patch, by distance and direction from the eye */
} rqt_view_test;
#define RQT_VIEW_TESTS 6

/* What the tests see of a square of ground: the prism that holds its samples, and a box that does, which lies in
 * the terrain's own directions: all points p with |(p - centre) . east| <= half_east, |(p - centre) . (up x east)|
 * <= half_north and |(p - centre) . up| <= half_height, where centre, up and half_height are the prism's. */
typedef struct rqt_view_piece {
    rqt_prism prism;
    double east[3]; /* unit, at right angles to prism.up */
    double half_east, half_north;
    int32_t side; /* of the square, in sample steps */
} rqt_view_piece;

/* The squares that have one eps each in RQT_VIEW_LODMAP: sides in sample steps. [RQT] has patches of 161 x 161
 * samples; this is the power of two next to that. */
#define RQT_VIEW_PATCH 128

/* "guaranteed", "ulrich", "node", "sphere", "lindstrom", "lodmap"; NULL when there is none. */
const char *rqt_view_test_name(rqt_view_test test);
/* The metric whose errors the test is about. Only RQT_METRIC_EXACT is stored. */
rqt_metric rqt_view_test_metric(rqt_view_test test);
/* The bound of any test; of RQT_VIEW_GUARANTEED that of rqt_view_tolerance. For the others eps is infinite and
 * `shown` false where the prism misses the frustum; else eps is what the test allows the piece, and share the least
 * over the most that it allows its points. In RQT_VIEW_LODMAP squares larger than a patch get eps 0 and share 0,
 * for they are to be split; patches and what is smaller have the share 1. eps may be 0 or infinite, never not a
 * number. */
void rqt_view_test_bound(rqt_view_test test, const rqt_camera *camera, const rqt_view_piece *piece,
                         rqt_view_bound *bound);

#ifdef __cplusplus
}
#endif
#endif
