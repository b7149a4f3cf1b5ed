/* geo.h - geodesy by GeographicLib behind a C door. The only room in C++; no exception leaves it. */
#ifndef RQT_GEO_H
#define RQT_GEO_H
#ifdef __cplusplus
extern "C" {
#endif

/* Points of a geodesic circle on WGS 84: n pairs lon,lat (degrees), counter-clockwise seen from above, the first not
 * repeated at the end. Longitudes are continuous: they may leave [-180,180] rather than jump, centred on lon's own turn.
 * radius in metres, > 0, at most a quarter of the meridian short of either pole (a circle around a pole is no ring in
 * lon/lat). Returns 0, or 1 and a sentence in message when the arguments do not make such a circle. */
int geo_circle(double lon, double lat, double radius, int n, double *lonlat, char *message, int message_size);

/* GeographicLib's version, as text of static life. */
const char *geo_version(void);

#ifdef __cplusplus
}
#endif
#endif
