/* scene.c - the scene of a terrain, and the pieces of it that hold its squares.
 *
 * *Planar* (projected, or no CRS): a square is a box; its prism the cylinder around it.
 *
 * *Geocentric* (degrees). Let E be the ellipsoid, n its normal, c the middle of the square in longitude and
 * latitude, a and b the halves of its sides there in radians, and C the largest cosine of a latitude in it. The
 * sample of height h at a place of it is p = E + h n, and lo <= h <= hi, |h| <= H. Let g be the angle from n(c) to
 * n; by the haversine formula
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
 * All is widened by what doubles round away. */
#include "view.h"

#include <math.h>
#include <string.h>

#define DEGREE 0.017453292519943295

int scene_create(scene *s, const store_terrain *t, double exaggeration, char **error) {
    *s = (scene){.terrain = t, .exaggeration = exaggeration, .metre = 1, .ellipsoid = GEO_WGS84};
    if (!t->lonlat) {
        s->metre = terrain_metre(t);
        return SQLITE_OK;
    }
    if (!t->wgs84 && !geo_ellipsoid_of_wkt(t->crs, &s->ellipsoid))
        return fail(error, "the CRS of terrain %s names no ellipsoid", t->name);
    char why[256] = "";
    const int status = geo_frame_create(GEO_ECEF, &s->ellipsoid, 0, 0, false, &s->space, why, sizeof why);
    if (status == GEO_OK) return SQLITE_OK;
    return status == GEO_NO_MEMORY ? SQLITE_NOMEM : fail(error, "%s", why);
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

void scene_axes(const scene *s, const double place[3], double east[3], double north[3], double up[3]) {
    const double lon = place[0] * DEGREE, lat = place[1] * DEGREE;
    const double axes[2][3][3] = {
        {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
        {{-sin(lon), cos(lon), 0},
         {-sin(lat) * cos(lon), -sin(lat) * sin(lon), cos(lat)},
         {cos(lat) * cos(lon), cos(lat) * sin(lon), sin(lat)}},
    };
    memcpy(east, axes[s->space != NULL][0], 3 * sizeof *east);
    memcpy(north, axes[s->space != NULL][1], 3 * sizeof *north);
    memcpy(up, axes[s->space != NULL][2], 3 * sizeof *up);
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

/* -------------------------------------------------------------------------------------------------- prisms -- */

/* Of numbers of this size, a dozen operations. */
static double rounding(double size) {
    return size * 0x1p-46;
}

static void planar_prism(const scene *s, const double low[3], const double high[3], rqt_prism *prism) {
    double middle[3], size = 0;
    for (int i = 0; i < 3; i++) {
        middle[i] = low[i] / 2 + high[i] / 2;
        size += fabs(low[i]) + fabs(high[i]);
    }
    scene_place(s, middle, s->exaggeration, prism->centre);
    memcpy(prism->up, (const double[3]){0, 0, 1}, sizeof prism->up);
    const double slack = rounding(size * fmax(s->metre, s->exaggeration));
    prism->radius = hypot(high[0] - low[0], high[1] - low[1]) / 2 * s->metre + slack;
    prism->half_height = (high[2] - low[2]) / 2 * s->exaggeration + slack;
}

static void geocentric_prism(const scene *s, const double low[3], const double high[3], rqt_prism *prism) {
    const double polar = s->ellipsoid.a / (1 - s->ellipsoid.f); /* a^2 / b: R */
    const double lo = low[2] * s->exaggeration, hi = high[2] * s->exaggeration, most = fmax(fabs(lo), fabs(hi));
    const double nearest = low[1] <= 0 && high[1] >= 0 ? 0 : fmin(fabs(low[1]), fabs(high[1]));
    const double cosine = fmin(1, fabs(cos(nearest * DEGREE)) + 1e-12);
    const double a = (high[1] - low[1]) / 2 * DEGREE, b = (high[0] - low[0]) / 2 * DEGREE;
    const double u = fmin(2, hypot(a, cosine * b) * (1 + 1e-12)), angle = 2 * asin(u / 2), v = u * u / 2;
    const double middle[3] = {low[0] / 2 + high[0] / 2, low[1] / 2 + high[1] / 2, 0};
    double east[3], north[3];
    scene_place(s, middle, 1, prism->centre);
    scene_axes(s, middle, east, north, prism->up);
    for (int i = 0; i < 3; i++) prism->centre[i] += (lo + hi - polar * v) / 2 * prism->up[i];
    const double slack = rounding(polar + most);
    prism->radius = polar * angle + most * u + slack;
    prism->half_height = (hi - lo) / 2 + polar * v / 2 + most * v + slack;
}

void scene_prism(const scene *s, int32_t x0, int32_t y0, int32_t x1, int32_t y1, const double range[2],
                 rqt_prism *prism) {
    const rqt_placement *at = &s->terrain->placement;
    const double xa = at->x0 + x0 * at->dx, xb = at->x0 + x1 * at->dx;
    const double ya = at->y0 + y0 * at->dy, yb = at->y0 + y1 * at->dy;
    const double low[3] = {fmin(xa, xb), fmin(ya, yb), range[0]}, high[3] = {fmax(xa, xb), fmax(ya, yb), range[1]};
    if (s->space)
        geocentric_prism(s, low, high, prism);
    else
        planar_prism(s, low, high, prism);
}
