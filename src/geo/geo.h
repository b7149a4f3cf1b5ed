/* geo.h - geodesy by GeographicLib behind a C door. The only room in C++; no exception leaves it.
 *
 * Angles in degrees, lengths in metres. Functions that can fail return GEO_OK, GEO_NO_MEMORY, or GEO_REFUSED with a
 * sentence (no newline, cut to message_size; message may be NULL); outputs are then left empty. */
#ifndef RQT_GEO_H
#define RQT_GEO_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { GEO_OK = 0, GEO_REFUSED = 1, GEO_NO_MEMORY = 2 };

/* An ellipsoid of revolution: equatorial radius and flattening. */
typedef struct geo_ellipsoid {
    double a, f;
} geo_ellipsoid;
#define GEO_WGS84 ((geo_ellipsoid){6378137.0, 1 / 298.257223563})

/* The ellipsoid of a CRS in WKT 1 or 2: its first SPHEROID or ELLIPSOID. false when there is none that makes sense.
 */
int geo_ellipsoid_of_wkt(const char *wkt, geo_ellipsoid *out);

/* ------------------------------------------------------------------------------------- circle, corridor --
 * Polygons in lon,lat: rings one after the other, not closed, in points of two doubles. A ring with
 * ring_is_shell begins a polygon, those behind it are its holes. */
typedef struct geo_polygons {
    double *lonlat;
    size_t points;
    size_t *ring_points;
    unsigned char *ring_is_shell;
    size_t rings;
} geo_polygons;
void geo_polygons_free(geo_polygons *polygons);

/* The corners of the polygons lie on the rim; their sides, straight in lon,lat, are off it by at most this share of
 * the radius. */
#define GEO_RIM_TOLERANCE 1e-4

/* All points within `metres` of (lon,lat) on WGS 84: one ring, counter-clockwise seen from above, beginning in the
 * east, of 256 points and more where they are needed.
 *
 * Longitudes are continuous: a circle that crosses the antimeridian leaves [-180,180] rather than jump; it lies
 * about lon on the turn that lon was given on. A circle that holds a pole is the band between its rim and the
 * pole: a ring of 360 degrees whose last two points are at latitude 90 or -90.
 *
 * Refused: a rim nearer than a millimetre to a pole, a circle that reaches both poles, a radius below a millimetre
 * (finer than longitudes in double), longitudes beyond 360. */
int geo_circle(double lon, double lat, double metres, geo_polygons *out, char *message, int message_size);

/* All points within `metres` of lines whose points are joined by geodesics: `lines` of them, line i of
 * line_points[i] points (1 or more), one after the other in lonlat. Polygons that do not overlap, but where
 * corridors over a pole meet others on another turn.
 *
 * From point to point a line goes the shorter way round, and its longitudes go on: 170, then -170, is 170, then
 * 190. Refused: what is for a circle; a radius of more than 5000 km; more than GEO_CORRIDOR_POINTS points. */
#define GEO_CORRIDOR_POINTS 100000
int geo_corridor(const double *lonlat, const size_t *line_points, size_t lines, double metres, geo_polygons *out,
                 char *message, int message_size);

/* ------------------------------------------------------------------------------------------------ paths --
 * Lines joined by geodesics, as straight pieces in lon,lat that are near them. Lines as for geo_corridor. */
typedef struct geo_path {
    double *lonlat;      /* points, lines one after the other; a line of equal points has one */
    double *metres;      /* of each point, along the lines from the very first; from line to line none are added */
    unsigned char *own;  /* is the point one of the line's own? */
    unsigned char *ends; /* is it the last of its line? */
    size_t *line_points; /* of each line */
    size_t points, lines;
} geo_path;
void geo_path_free(geo_path *path);
#define GEO_PATH_TOLERANCE 1e-3 /* of a cell: the most that a piece is off its geodesic */
#define GEO_PATH_POINTS 1000000
/* cell_lon, cell_lat: a cell's sides, degrees. Longitudes go on as for geo_corridor. A geodesic over a pole goes
 * along it, latitude 90, from one meridian to the other. */
int geo_path_create(const geo_ellipsoid *ellipsoid, const double *lonlat, const size_t *line_points, size_t lines,
                    double cell_lon, double cell_lat, geo_path *out, char *message, int message_size);
/* The geodesic distance of two points. */
double geo_distance(const geo_ellipsoid *ellipsoid, const double from[2], const double to[2]);

/* ----------------------------------------------------------------------------------------------- areas -- */
typedef struct geo_measure {
    double planimetric, surface, volume; /* square metres at height 0; square metres; cubic metres above height 0 */
} geo_measure;
/* Of a triangle with corners lon, lat, height above the ellipsoid, straight in all three: surface.cpp. */
geo_measure geo_measure_triangle(const geo_ellipsoid *ellipsoid, const double lonlath[3][3]);

/* ---------------------------------------------------------------------------------------------- frames --
 * Places on WGS 84 as points in space: geocentric (EPSG:4978), or east, north, up about an origin on the ellipsoid.
 */
typedef enum geo_frame_kind { GEO_ECEF, GEO_ENU } geo_frame_kind;
typedef struct geo_frame geo_frame;

/* Where a grid of heights lies: degrees, steps of a sample in degrees, heights in metres. */
typedef struct geo_extent {
    double west, east, south, north, lon_step, lat_step, lowest, highest;
} geo_extent;

/* geoid: heights are above EGM96, which PROJ's grid egm96_15.gtx tells (refused when it is not there); else above
 * the ellipsoid. The origin of GEO_ENU is (lon,lat), height 0. */
int geo_frame_create(geo_frame_kind kind, const geo_ellipsoid *ellipsoid, double lon, double lat, int geoid,
                     geo_frame **out, char *message, int message_size);
void geo_frame_free(geo_frame *frame);
/* Finite, unless the geoid has no value there. */
void geo_frame_place(const geo_frame *frame, const double lonlath[3], double xyz[3]);
/* The height above the ellipsoid; not finite where the geoid has no value. */
double geo_frame_height(const geo_frame *frame, const double lonlath[3]);
/* Back. */
void geo_frame_lonlath(const geo_frame *frame, const double xyz[3], double lonlath[3]);

/* The geoid over an extent, which is looked at for longitudes and latitudes alone: metres per degree, at most,
 * along each, and the largest |undulation|. All 0 without one. */
typedef struct geo_geoid {
    double lon_slope, lat_slope, most;
} geo_geoid;
geo_geoid geo_frame_geoid(const geo_frame *frame, const geo_extent *extent);

/* How far a mesh in space may be from what it is in lon,lat,height: for each rank of split vertices (2 * scale for
 * the midpoint of a side of 2^(scale+1) samples, 2 * scale + 1 for the centre of such a square), an upper bound, in
 * metres, of the distance between any place of a triangle that is straight in lon,lat,height and the same place of
 * the flat triangle with its corners: frame.cpp has the proof. Does not fall with rank. */
void geo_frame_sag(const geo_frame *frame, const geo_extent *extent, int ranks, double *metres);

/* GeographicLib's version, as text of static life. */
const char *geo_version(void);

#ifdef __cplusplus
}
#endif
#endif
