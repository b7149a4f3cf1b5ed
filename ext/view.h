/* view.h - views: from a camera in JSON to a request that the mesh functions answer like any other.
 *
 *   camera.c      the JSON, and the camera that it makes in a scene
 *   scene.c       the scene of a terrain: where its samples are in space, and pieces of space that hold squares of
 * it view_field.c  scene and camera -> an eps for every square of ground (rqt_field), and the squares that may be
 * seen view.c        all of it, as a request: region = what may be seen, eps = infinity, rule = the field
 */
#ifndef RQT_EXT_VIEW_H
#define RQT_EXT_VIEW_H

#include "functions.h"

#include "geo.h"

/* ------------------------------------------------------------------------------------------------ scene */
/* The scene of a terrain (rqt_view.h). Without degrees: x and y of its CRS in metres, height * exaggeration upward.
 * In degrees: geocentric, the same height above the ellipsoid of its CRS. */
typedef struct scene {
    const store_terrain *terrain;
    double exaggeration; /* of heights, > 0 */
    double metre;        /* planar: metres in a unit of x and y */
    geo_frame *space;    /* NULL: planar */
    geo_ellipsoid ellipsoid;
    geo_geoid geoid; /* under the terrain; 0 where heights are taken as above the ellipsoid */
} scene;

/* geoid: heights of a terrain in degrees are above EGM96. */
int scene_create(scene *s, const store_terrain *t, double exaggeration, bool geoid, char **error);
void scene_free(scene *s);
/* A geocentric place as longitude, latitude and the height that the terrain would give it. `what`: for sentences.
 */
int scene_from_geocentric(const scene *s, double place[3], const char *what, char **error);
/* Where x, y of the terrain's CRS and a height in metres are in the scene. `exaggeration`: of this height. */
void scene_place(const scene *s, const double place[3], double exaggeration, double point[3]);
/* East and up there: unit; north is up x east. In a projected system grid east and grid north. */
void scene_axes(const scene *s, const double place[3], double east[3], double up[3]);
/* A piece of the scene that holds all samples of a square, as far as there is terrain, whose heights are lowest ..
 * highest (metres, not exaggerated). scene.c has the proof. */
void scene_piece(const scene *s, rqt_square square, double lowest, double highest, rqt_view_piece *piece);

/* ----------------------------------------------------------------------------------------------- camera */
typedef enum camera_position { CAMERA_CRS, CAMERA_LONLAT, CAMERA_ECEF } camera_position;
/* The JSON as it came, checked. Angles in degrees. */
typedef struct camera_words {
    camera_position position; /* of eye and at */
    double eye[3], at[3];
    bool has_at; /* else yaw and pitch say where it looks */
    double yaw, pitch, roll, fovy, width, height, tau, near, far, exaggeration;
} camera_words;

int camera_read(sqlite3_value *json, camera_words *words, char **error);
/* The camera in the scene; the connection transforms places. */
int camera_make(connection *c, const scene *s, const camera_words *words, rqt_camera *camera, char **error);

/* ------------------------------------------------------------------------------------------------- view */
struct view {
    camera_words words;
    scene scene;
    rqt_camera camera;
    rqt_view_test test;
    rqt_field *field;
    double achieved_tau; /* pixels */
    bool guaranteed;
};

/* A view of this camera, not yet of a terrain. */
int view_create(sqlite3_value *camera, view **out, char **error);
/* When the request's terrain and options are known: scene, camera and field, and the request's region. */
int view_place(request *r, char **error);
void view_free(view *v); /* NULL is fine */

/* The field of camera and test; and the squares in which something may be drawn, as a region. view_field.c */
int view_field(const request *r, view *v, rqt_region **region, char **error);

#endif
