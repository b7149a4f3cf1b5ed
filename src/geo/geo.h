/* geo.h - geodesy by GeographicLib behind a C door. The only room in C++; no exception leaves it. */
#ifndef RQT_GEO_H
#define RQT_GEO_H
#ifdef __cplusplus
extern "C" {
#endif

#define GEO_CIRCLE_POINTS 1000000 /* the most points that a circle may have */

/* Points of a geodesic circle on WGS 84: n pairs lon,lat in degrees, each at the geodesic distance radius (metres)
 * from (lon,lat). Counter-clockwise seen from above, beginning in the east; the first point is not repeated at the
 * end.
 *
 * Longitudes are continuous: a circle that crosses the antimeridian leaves [-180,180] rather than jump. All of them
 * are less than 180 degrees from lon, on the turn that lon was given on: around lon 179 they run past 180, around
 * lon -181 they lie about -181.
 *
 * A circle that reaches or encloses a pole is no ring in lon,lat and is refused; so the largest radius is the
 * distance to the nearer pole: 10002 km on the equator, 112 km at lat 89, none at lat 90. A circle below a
 * millimetre is finer than longitudes in double, and is refused too.
 *
 * lon is -360 .. 360, lat -90 .. 90, n 3 .. GEO_CIRCLE_POINTS. Returns 0; or 1, with a sentence (no newline, cut to
 * message_size; message may be NULL) and lonlat unspecified, when the arguments do not make such a circle. */
int geo_circle(double lon, double lat, double radius, int n, double *lonlat, char *message, int message_size);

/* GeographicLib's version, as text of static life. */
const char *geo_version(void);

#ifdef __cplusplus
}
#endif
#endif
