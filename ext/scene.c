/* scene.c - the scene of a terrain, and the pieces of it that hold its squares.
 *
 * *Planar* (projected, or no CRS): a square is a box; its prism the cylinder around it. A mesh differs from a
 * sample along the axis.
 *
 * *Geocentric* (degrees): on the ellipsoid of the terrain's CRS. Heights are taken as above it, unless the answer
 * is to be in space too (option frame) and they are above a geoid: then the scene is where the answer is. Let E be
 * the ellipsoid, n its normal, c the middle of the square in longitude and latitude, a and b the halves of its
 * sides there in radians, and C the largest cosine of a latitude in it. The sample of height h at a place of it is
 * p = E + h n, and lo <= h <= hi, |h| <= H. Let g be the angle from n(c) to n; by the haversine formula
 *
 *     (2 sin(g/2))^2 = (2 sin(dlat/2))^2 + cos cos (2 sin(dlon/2))^2 <= a^2 + C^2 b^2 =: u^2
 *
 * so g <= G = 2 asin(u/2), 1 - cos g <= u^2/2 =: v and sin g <= u. On the way from c to the place
 * along the great circle of normals, E moves by L t dg, t the direction of the way and L symmetric in the plane at
 * a right angle to n, with the two principal radii of curvature for its values: none above R, that of the poles. So
 *
 *     |E - E(c)| <= R g,      0 <= -(E - E(c)) . n(c) = integral of sin(g) (t . L t) dg <= R (1 - cos g) <= R v
 *
 * Along n(c), p is between lo - H v - R v and hi + H v from E(c) (h cos g is within |h| v of h); across it, no
 * further than R G + H u. The prism about E(c) + ((lo + hi - R v)/2) n(c) therefore has
 *
 *     half_height = (hi - lo)/2 + R v/2 + H v,      radius = R G + H u.
 *
 * A mesh differs from a sample along n and, for its triangles are flat, in any direction: nothing is said of it
 * (upright 0).
 *
 * The box. Along east at c, p is (N + h) cos(lat) sin(dlon) away, at most (R + H) C b. Along north: from c to the
 * same longitude R a and H a at most, and from there (N + h) cos(lat) (1 - cos dlon) times a sine: (R + H) C b^2/2.
 *
 * With a geoid G, heights are h + G, and E(c) is raised by G(c): lo and hi become lower and higher by as much as G
 * can change from c to the place, by its slopes, and H larger by the largest |G|.
 *
 * All is widened by what doubles round away. */
#include "view.h"

#include <math.h>
#include <string.h>

#define DEGREE 0.017453292519943295

int scene_create(scene *s, const store_terrain *t, double exaggeration, bool geoid, char **error) {
    *s = (scene){.terrain = t, .exaggeration = exaggeration, .metre = 1, .ellipsoid = GEO_WGS84};
    if (!t->lonlat) {
        s->metre = terrain_metre(t);
        return SQLITE_OK;
    }
    if (!t->wgs84 && !geo_ellipsoid_of_wkt(t->crs, &s->ellipsoid))
        return fail(error, "the CRS of terrain %s names no ellipsoid", t->name);
    char why[256] = "";
    const int status = geo_frame_create(GEO_ECEF, &s->ellipsoid, 0, 0, geoid, &s->space, why, sizeof why);
    if (status != GEO_OK) return status == GEO_NO_MEMORY ? SQLITE_NOMEM : fail(error, "%s", why);
    const rqt_placement *at = &t->placement;
    const double x = at->x0 + (t->lattice.width - 1) * at->dx, y = at->y0 + (t->lattice.height - 1) * at->dy;
    const geo_extent extent = {
        .west = fmin(at->x0, x), .east = fmax(at->x0, x), .south = fmin(at->y0, y), .north = fmax(at->y0, y)};
    s->geoid = geo_frame_geoid(s->space, &extent);
    return SQLITE_OK;
}

void scene_free(scene *s) {
    geo_frame_free(s->space);
    s->space = NULL;
}

void scene_place(const scene *s, const double place[3], double exaggeration, double point[3]) {
    if (s->space) {
        geo_frame_place(s->space, (const double[3]){place[0], place[1], place[2] * exaggeration}, point);
    } else {
        point[0] = place[0] * s->metre;
        point[1] = place[1] * s->metre;
        point[2] = place[2] * exaggeration;
    }
}

void scene_axes(const scene *s, const double place[3], double east[3], double up[3]) {
    if (s->space) {
        const double lon = place[0] * DEGREE, lat = place[1] * DEGREE;
        east[0] = -sin(lon), east[1] = cos(lon), east[2] = 0;
        up[0] = cos(lat) * cos(lon), up[1] = cos(lat) * sin(lon), up[2] = sin(lat);
    } else {
        memcpy(east, (const double[3]){1, 0, 0}, 3 * sizeof *east);
        memcpy(up, (const double[3]){0, 0, 1}, 3 * sizeof *up);
    }
}

int scene_from_geocentric(const scene *s, double place[3], const char *what, char **error) {
    const bool geoid = terrain_is_above_geoid(s->terrain);
    const geo_ellipsoid earth = s->space ? s->ellipsoid : GEO_WGS84;
    geo_frame *frame;
    double lonlath[3];
    char why[256] = "";
    const int status = geo_frame_create(GEO_ECEF, &earth, 0, 0, geoid, &frame, why, sizeof why);
    if (status != GEO_OK)
        return status == GEO_NO_MEMORY ? SQLITE_NOMEM : fail(error, "camera: \"%s\": %s", what, why);
    geo_frame_lonlath(frame, place, lonlath);
    geo_frame_free(frame);
    if (!isfinite(lonlath[2])) return fail(error, "camera: \"%s\" has no place on the Earth", what);
    memcpy(place, lonlath, sizeof lonlath);
    return SQLITE_OK;
}

/* -------------------------------------------------------------------------------------------------- pieces -- */

/* Of numbers of this size, a dozen operations. */
static double rounding(double size) {
    return size * 0x1p-46;
}

static void planar_piece(const scene *s, const double low[3], const double high[3], rqt_view_piece *piece) {
    rqt_prism *prism = &piece->prism;
    double middle[3], size = 0;
    for (int i = 0; i < 3; i++) {
        middle[i] = low[i] / 2 + high[i] / 2;
        size += fabs(low[i]) + fabs(high[i]);
    }
    scene_place(s, middle, s->exaggeration, prism->centre);
    scene_axes(s, middle, piece->east, prism->up);
    const double slack = rounding(size * fmax(s->metre, s->exaggeration));
    piece->half_east = (high[0] - low[0]) / 2 * s->metre + slack;
    piece->half_north = (high[1] - low[1]) / 2 * s->metre + slack;
    prism->radius = sqrt(piece->half_east * piece->half_east + piece->half_north * piece->half_north) + slack;
    prism->half_height = (high[2] - low[2]) / 2 * s->exaggeration + slack;
    prism->upright = s->terrain->voids == 0; /* outlines of voids move sideways by as much as heights move */
}

static void geocentric_piece(const scene *s, const double low[3], const double high[3], rqt_view_piece *piece) {
    rqt_prism *prism = &piece->prism;
    const double polar = s->ellipsoid.a / (1 - s->ellipsoid.f); /* a^2 / b: R */
    const double wave = s->geoid.lon_slope * (high[0] - low[0]) / 2 + s->geoid.lat_slope * (high[1] - low[1]) / 2;
    const double lo = low[2] * s->exaggeration - wave, hi = high[2] * s->exaggeration + wave;
    const double most = fmax(fabs(lo), fabs(hi)) + s->geoid.most;
    const double nearest = low[1] <= 0 && high[1] >= 0 ? 0 : fmin(fabs(low[1]), fabs(high[1]));
    const double cosine = fmin(1, fabs(cos(nearest * DEGREE)) + 1e-12);
    const double a = (high[1] - low[1]) / 2 * DEGREE, b = (high[0] - low[0]) / 2 * DEGREE;
    const double u = fmin(2, hypot(a, cosine * b) * (1 + 1e-12)), angle = 2 * asin(u / 2), v = u * u / 2;
    const double middle[3] = {low[0] / 2 + high[0] / 2, low[1] / 2 + high[1] / 2, 0};
    scene_place(s, middle, 1, prism->centre);
    scene_axes(s, middle, piece->east, prism->up);
    for (int i = 0; i < 3; i++) prism->centre[i] += (lo + hi - polar * v) / 2 * prism->up[i];
    const double slack = rounding(polar + most);
    prism->radius = polar * angle + most * u + slack;
    prism->half_height = (hi - lo) / 2 + polar * v / 2 + most * v + slack;
    prism->upright = 0;
    piece->half_east = fmin((polar + most) * cosine * fmin(b, 1) + slack, prism->radius);
    piece->half_north = fmin((polar + most) * (a + cosine * b * b / 2) + slack, prism->radius);
}

void scene_piece(const scene *s, rqt_square square, double lowest, double highest, rqt_view_piece *piece) {
    const rqt_placement *at = &s->terrain->placement;
    const rqt_vertex end =
        rqt_vertex_clamp(&s->terrain->lattice, (rqt_vertex){square.x + square.side, square.y + square.side});
    const double xa = at->x0 + square.x * at->dx, xb = at->x0 + end.x * at->dx;
    const double ya = at->y0 + square.y * at->dy, yb = at->y0 + end.y * at->dy;
    const double low[3] = {fmin(xa, xb), fmin(ya, yb), lowest}, high[3] = {fmax(xa, xb), fmax(ya, yb), highest};
    piece->side = square.side;
    if (s->space)
        geocentric_piece(s, low, high, piece);
    else
        planar_piece(s, low, high, piece);
}
