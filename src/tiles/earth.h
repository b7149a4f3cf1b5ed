/* earth.h - WGS 84, for tiles: its numbers, and places and directions in space. Geocentric coordinates in metres.
 */
#ifndef RQT_TILES_EARTH_H
#define RQT_TILES_EARTH_H

#define DEGREE 0.017453292519943295 /* radians */
#define EARTH_A 6378137.0           /* equatorial radius */
#define EARTH_F (1 / 298.257223563) /* flattening */
#define EARTH_B (EARTH_A * (1 - EARTH_F))
#define EARTH_CURVED 6399593.7 /* the largest radius of curvature, at the poles */

typedef struct earth_angle {
    double degrees, sine, cosine;
    double across; /* of a latitude: the radius of curvature across the meridian */
} earth_angle;

/* Vertices of a tile have few longitudes and latitudes: each is kept for the next that has it. */
enum { EARTH_KEPT = 1024 };
typedef struct earth_angles {
    earth_angle kept[EARTH_KEPT];
} earth_angles;
void earth_angles_clear(earth_angles *angles);
/* number: any, 0 or more, by which angles that differ are likely to do so. */
const earth_angle *earth_angle_of(earth_angles *angles, int number, double degrees);

/* height: above the ellipsoid. */
void earth_place(const earth_angle *lon, const earth_angle *lat, double height, double xyz[3]);
/* A direction by east, north and up at a place. */
void earth_turn(const earth_angle *lon, const earth_angle *lat, const double enu[3], double xyz[3]);

#endif
