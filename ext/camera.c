/* camera.c - the camera as JSON, and the camera that it makes in a terrain's scene.
 *
 *   {"eye": [x, y, z], "at": [x, y, z] or "yaw": degrees clockwise from north, "pitch": degrees upward,
 *    "roll": 0, "fovy": degrees, "width": pixels, "height": pixels, "tau": 1,
 *    "near": 0, "far": metres, "exaggeration": 1, "position": "crs"}
 *
 * Eye and at are places of the scene as it is drawn: their heights are not exaggerated, those of the ground are.
 * position says what they are: crs: x and y of the terrain's system, height in metres as the terrain's; lonlat: the
 * same height at longitude and latitude (WGS 84); ecef: geocentric. A place in another system than the terrain's
 * goes the way that regions go (geometry.c). North is grid north, and in degrees true north at the eye. Roll turns
 * the camera clockwise.
 */
#include "view.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <string.h>

#define DEGREE 0.017453292519943295
#define FURTHEST 1e15 /* metres: what is beyond cannot be told from what is not there */

/* ------------------------------------------------------------------------------------------------- JSON -- */

typedef enum number_range { ANY, NOT_NEGATIVE, POSITIVE, ANGLE_OF_VIEW } number_range;

static const struct number_key {
    const char *key;
    size_t at; /* in camera_words */
    double usual;
    bool needed;
    number_range range;
} numbers[] = {
    {"yaw", offsetof(camera_words, yaw), 0, false, ANY},
    {"pitch", offsetof(camera_words, pitch), 0, false, ANY},
    {"roll", offsetof(camera_words, roll), 0, false, ANY},
    {"fovy", offsetof(camera_words, fovy), 0, true, ANGLE_OF_VIEW},
    {"width", offsetof(camera_words, width), 0, true, POSITIVE},
    {"height", offsetof(camera_words, height), 0, true, POSITIVE},
    {"tau", offsetof(camera_words, tau), 1, false, POSITIVE},
    {"near", offsetof(camera_words, near), 0, false, NOT_NEGATIVE},
    {"far", offsetof(camera_words, far), INFINITY, false, POSITIVE},
    {"exaggeration", offsetof(camera_words, exaggeration), 1, false, POSITIVE},
};
#define NUMBERS (sizeof numbers / sizeof *numbers)

static double *number_of(camera_words *words, const struct number_key *key) {
    return (double *)(void *)((char *)words + key->at);
}

static int read_number(const cJSON *item, const struct number_key *key, camera_words *words, char **error) {
    static const char *const wants[] = {"a number", "a number, 0 or more", "a number above 0",
                                        "degrees, above 0 and below 180"};
    const double n = cJSON_IsNumber(item) ? item->valuedouble : NAN;
    const bool fits = fabs(n) <= FURTHEST &&
                      (key->range == ANY || n > 0 || (n == 0 && key->range == NOT_NEGATIVE)) &&
                      (key->range != ANGLE_OF_VIEW || n < 180);
    if (!fits) return fail(error, "camera: \"%s\" must be %s", key->key, wants[key->range]);
    *number_of(words, key) = n;
    return SQLITE_OK;
}

static int read_place(const cJSON *item, double place[3], char **error) {
    const cJSON *n = cJSON_IsArray(item) ? item->child : NULL;
    int count = 0;
    for (; n; n = n->next, count++) {
        if (count == 3 || !cJSON_IsNumber(n) || !(fabs(n->valuedouble) <= FURTHEST)) break;
        place[count] = n->valuedouble;
    }
    return count == 3 && !n
               ? SQLITE_OK
               : fail(error, "camera: \"%s\" must be three numbers [x, y, z], none beyond 1e15", item->string);
}

static int read_position(const cJSON *item, camera_words *words, char **error) {
    static const char *const names[] = {"crs", "lonlat", "ecef"};
    for (int i = 0; i < 3 && cJSON_IsString(item); i++)
        if (strcmp(item->valuestring, names[i]) == 0) {
            words->position = (camera_position)i;
            return SQLITE_OK;
        }
    return fail(error, "camera: \"position\" must be crs, lonlat or ecef");
}

static int read_item(const cJSON *item, camera_words *words, char **error) {
    if (strcmp(item->string, "eye") == 0) return read_place(item, words->eye, error);
    if (strcmp(item->string, "at") == 0) return read_place(item, words->at, error);
    if (strcmp(item->string, "position") == 0) return read_position(item, words, error);
    for (size_t i = 0; i < NUMBERS; i++)
        if (strcmp(item->string, numbers[i].key) == 0) return read_number(item, &numbers[i], words, error);
    return fail(error,
                "camera: unknown key \"%s\"; there are eye, at, yaw, pitch, roll, fovy, width, height, tau, near, "
                "far, exaggeration, position",
                item->string);
}

static bool has(const cJSON *root, const char *key) {
    return cJSON_GetObjectItemCaseSensitive(root, key) != NULL;
}

static int read_object(const cJSON *root, camera_words *words, char **error) {
    if (!cJSON_IsObject(root)) return fail(error, "camera must be a JSON object");
    for (size_t i = 0; i < NUMBERS; i++) *number_of(words, &numbers[i]) = numbers[i].usual;
    for (const cJSON *item = root->child; item; item = item->next) {
        for (const cJSON *other = item->next; other; other = other->next)
            if (strcmp(item->string, other->string) == 0)
                return fail(error, "camera: \"%s\" is given twice", item->string);
        const int code = read_item(item, words, error);
        if (code != SQLITE_OK) return code;
    }
    if (!has(root, "eye")) return fail(error, "camera: \"eye\" is missing");
    for (size_t i = 0; i < NUMBERS; i++)
        if (numbers[i].needed && !has(root, numbers[i].key))
            return fail(error, "camera: \"%s\" is missing", numbers[i].key);
    words->has_at = has(root, "at");
    const bool angles = has(root, "yaw") || has(root, "pitch");
    if (words->has_at && angles) return fail(error, "camera: \"at\" does not go with \"yaw\" and \"pitch\"");
    if (!words->has_at && !(has(root, "yaw") && has(root, "pitch")))
        return fail(error, "camera: it looks nowhere: \"at\", or \"yaw\" and \"pitch\", must be given");
    if (!(words->near < words->far)) return fail(error, "camera: \"near\" must be less than \"far\"");
    return SQLITE_OK;
}

int camera_read(sqlite3_value *json, camera_words *words, char **error) {
    *words = (camera_words){.position = CAMERA_CRS};
    if (!json || sqlite3_value_type(json) != SQLITE_TEXT)
        return fail(error, "camera must be a JSON object, as text");
    const char *text = (const char *)sqlite3_value_text(json), *end = NULL;
    if (!text) return SQLITE_NOMEM;
    cJSON *root = cJSON_ParseWithOpts(text, &end, true);
    if (!root) root = cJSON_ParseWithOpts(text, &end, true); /* as in options.c: bad text, or no memory? */
    if (!root) return fail(error, "camera is not JSON, from here: %.40s", end ? end : text);
    const int code = read_object(root, words, error);
    cJSON_Delete(root);
    return code;
}

/* ------------------------------------------------------------------------------------------------ places -- */

/* Longitude and latitude as x and y of the terrain. */
static int from_lonlat(connection *c, const store_terrain *t, double place[3], const char *what, char **error) {
    char *text = sqlite3_mprintf("SRID=4326;POINT(%!.17g %!.17g)", place[0], place[1]);
    if (!text) return SQLITE_NOMEM;
    char name[24];
    sqlite3_snprintf(sizeof name, name, "camera: \"%s\"", what);
    rqt_geometry *geometry = NULL;
    int code = request_geometry_bytes(c, t, text, strlen(text), true, name, &geometry, NULL, error);
    sqlite3_free(text);
    size_t points = 0;
    const double *xy = code == SQLITE_OK ? rqt_geometry_line(geometry, 0, &points) : NULL;
    if (xy && points == 1)
        place[0] = xy[0], place[1] = xy[1];
    else if (code == SQLITE_OK)
        code = fail(error, "%s has no place on terrain %s", name, t->name);
    rqt_geometry_free(geometry);
    return code;
}

/* The place in the terrain's coordinates. Geocentric places are those of the terrain's own datum, if it is in
 * degrees.
 */
static int to_terrain(connection *c, const scene *s, camera_position position, double place[3], const char *what,
                      char **error) {
    int code = SQLITE_OK;
    if (position == CAMERA_ECEF) code = scene_from_geocentric(s, place, what, error);
    if (code != SQLITE_OK) return code;
    if ((s->space || position != CAMERA_CRS) && fabs(place[1]) > 90)
        return fail(error, "camera: \"%s\": there is no latitude %!.15g", what, place[1]);
    const bool is_there = position == CAMERA_CRS || (s->space && (s->terrain->wgs84 || position == CAMERA_ECEF));
    return is_there ? SQLITE_OK : from_lonlat(c, s->terrain, place, what, error);
}

/* ------------------------------------------------------------------------------------------------ camera -- */

/* a * x + b * y */
static void combine(double a, const double x[3], double b, const double y[3], double out[3]) {
    for (int i = 0; i < 3; i++) out[i] = a * x[i] + b * y[i];
}

static void turn_by(rqt_camera *camera, double roll) {
    double right[3], up[3];
    combine(cos(roll), camera->right, -sin(roll), camera->up, right);
    combine(cos(roll), camera->up, sin(roll), camera->right, up);
    memcpy(camera->right, right, sizeof right);
    memcpy(camera->up, up, sizeof up);
}

int camera_make(connection *c, const scene *s, const camera_words *words, rqt_camera *camera, char **error) {
    double eye[3], at[3], point[3], direction[3], ahead[3], east[3], north[3], up[3];
    memcpy(eye, words->eye, sizeof eye);
    memcpy(at, words->at, sizeof at);
    int code = to_terrain(c, s, words->position, eye, "eye", error);
    if (code == SQLITE_OK && words->has_at) code = to_terrain(c, s, words->position, at, "at", error);
    if (code != SQLITE_OK) return code;
    scene_place(s, eye, 1, point);
    scene_axes(s, eye, east, up);
    for (int i = 0; i < 3; i++)
        north[i] = up[(i + 1) % 3] * east[(i + 2) % 3] - up[(i + 2) % 3] * east[(i + 1) % 3];
    const double yaw = words->yaw * DEGREE, pitch = words->pitch * DEGREE;
    combine(sin(yaw), east, cos(yaw), north, ahead);
    if (words->has_at) {
        scene_place(s, at, 1, direction);
        combine(1, direction, -1, point, direction);
    } else {
        combine(cos(pitch), ahead, sin(pitch), up, direction);
    }
    *camera = (rqt_camera){
        .near = words->near, .far = words->far, .width = words->width, .height = words->height, .tau = words->tau};
    rqt_message why = {""};
    if (rqt_camera_look(camera, point, direction, up, ahead, words->fovy, &why) != RQT_OK)
        return fail(error, "camera: %s", why.text);
    if (words->roll != 0) turn_by(camera, words->roll * DEGREE);
    return SQLITE_OK;
}
