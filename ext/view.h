/* view.h - views: from a camera in JSON to a request that the mesh functions answer like any other.
 *
 *   camera.c      the JSON, and the camera that it makes in a scene
 *   scene.c       where samples are in space, and pieces of space that hold squares
 *   view_field.c  scene and camera -> an eps for every square, and what may be seen
 *   view.c        all of it, as a request: region, eps infinite, the field as rule
 *   budget.c      the best view within a number of triangles
 *   token.c       what one answer tells the next of itself
 *   follow.c      views that follow a camera: what stays, and what changes a mesh
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

/* ------------------------------------------------------------------------------------------------ token */
/* What an answer to option previous is known by, and made again from by any connection. token.c has its text. */
typedef struct view_token {
    uint64_t terrain;     /* view_terrain_number */
    uint64_t options;     /* view_options_number: of all that selects beside the camera */
    uint64_t fingerprint; /* view_fingerprint of the answer */
    rqt_camera camera;    /* the anchor, in its scene */
    double exaggeration;
    double tau;  /* pixels, achieved: camera.tau or more */
    double move; /* of its band */
    double turn;
} view_token;

/* As text, to be released with sqlite3_free; NULL: no memory. */
char *token_write(const view_token *token);
/* SQLITE_ERROR with a sentence when the text is no token, or one that no answer can have had. */
int token_read(const char *text, view_token *token, char **error);
uint64_t view_terrain_number(const store_terrain *t);
/* SQLITE_NOMEM when there is none. */
int view_options_number(const request *r, uint64_t *number);
/* Of the samples and heights of a patch's vertices, whatever their order. */
uint64_t view_fingerprint(const rqt_patch *patch);

/* ------------------------------------------------------------------------------------------------- view */
struct view {
    camera_words words;
    scene scene;
    rqt_camera camera; /* of the answer: that of the words, or the one whose band holds it */
    rqt_view_test test;
    rqt_field *field;
    double achieved_tau; /* pixels: camera.tau, or more to keep within max_triangles */
    bool guaranteed;     /* no sample that is drawn, its height as kept, is off by more than achieved_tau */
    /* Of option previous; follow.c. */
    bool has_band;
    rqt_view_band band; /* the answer is right for all cameras of it */
    bool has_token;     /* of the last answer, when this one is of the same terrain and options */
    view_token last;
    bool is_unchanged;                             /* this answer is the last one */
    uint8_t unchanged[RQT_INCREMENT_HEADER_BYTES]; /* then, the increment that says so, if one is wanted */
    rqt_patch
        last_mesh; /* of the last answer, sorted, with leaves, if an increment or a geomorph is wanted from it */
    bool has_last_mesh;
};

/* A view of this camera, not yet of a terrain. */
int view_create(sqlite3_value *camera, view **out, char **error);
/* When the request's terrain and options are known: scene and camera. */
int view_place(request *r, char **error);
/* What selects: of the last answer, if its band holds the camera; else within what max_triangles allows. follow.c
 */
int view_settle(request *r, view_wants wants, char **error);
void view_free(view *v); /* NULL is fine */

/* The view's field, of its camera, band and achieved_tau; and the request's region, the squares in which something
 * may be drawn, or all of the terrain (option cover). view_field.c */
int view_field(request *r, char **error);
/* How far the nearest piece of terrain that is drawn is from the eye, about; 0 when there is none. view_field.c */
int view_nearest(request *r, double *nearest, char **error);
/* The least tolerance of the ladder whose answer has no more than max_triangles, as what selects. budget.c */
int view_keep_within(request *r, char **error);
/* The token of the answer, whose patch this is; NULL without option previous. To be released with sqlite3_free. */
int view_token_of(request *r, const rqt_patch *patch, char **token, char **error);
/* Where vertices of the answer, whose patch this is, come from: heights in quanta, NaN for those that do not move,
 * and the ends of the edge that each halves, two a vertex (rqt_morph_heights). Both to be released with
 * sqlite3_free. The last answer's mesh is that of VIEW_MORPH; without option previous it is that of twice the
 * tolerance. The request then selects something else. */
int view_morph(request *r, const rqt_patch *patch, double **heights, uint32_t **ends, char **error);
/* The answer as an increment from the last one (FORMAT.md, "View increment"). told->token is there also on failure.
 */
int view_increment(request *r, mesh_told *told, uint8_t **bytes, size_t *size, char **error);

#endif
