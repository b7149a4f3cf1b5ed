/* globe.c - a tile in space: places of its vertices, the sphere around them, the point by which clients know that
 * all of it is below the horizon, normals.
 *
 * Horizon. In the space in which the ellipsoid is a sphere of radius 1 (x/a, y/a, z/b), a point at the distance m
 * from the centre, at the angle t from a direction D, is hidden from every camera from which the point r D is
 * hidden, where
 *
 *     r = 1 / cos(t + acos(1/m)),      m no less than 1, t + acos(1/m) below a right angle
 *
 * for the sphere hides a point at angle s from the camera's direction iff s > acos(1/m) + acos(1/camera). What is
 * hidden from a camera is convex (the part beyond the horizon's plane of a cone), so the largest r of all vertices
 * will do for the triangles between them, and points below the ellipsoid, taken as if they were on it, are hidden
 * later than they could be. Where a vertex is a right angle away no such point exists. Then it is put so far out
 * that the square of its distance is no double: the tests of clients, which divide by that, never find it hidden.
 *
 * Normals are the terrain's, from the full-resolution samples (store_normals), turned from east, north, up to
 * geocentric; between samples, where a side cuts a triangle, they are the mean of the four around by nearness. What
 * neighbours share depends on the place alone. Specks have the ellipsoid's.
 */
#include "earth.h"
#include "quantized_mesh.h"

#include <math.h>
#include <string.h>

#define NEVER_HIDDEN 1e200

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void place_all(const tile_mesh *mesh, tile_globe *globe) {
    earth_angles lons, lats;
    earth_angles_clear(&lons);
    earth_angles_clear(&lats);
    for (size_t i = 0; i < mesh_vertices(mesh); i++) {
        const double *p = mesh->lonlath + 3 * i;
        const earth_angle *lon = earth_angle_of(&lons, mesh->u[i], p[0] < 180 ? p[0] : p[0] - 360),
                          *lat = earth_angle_of(&lats, mesh->v[i], p[1]);
        globe->angles[i] = (tile_angles){*lon, *lat};
        earth_place(lon, lat, p[2], globe->xyz + 3 * i);
    }
}

static void find_sphere(const double *xyz, size_t count, tile_globe *globe) {
    double low[3] = {HUGE_VAL, HUGE_VAL, HUGE_VAL}, high[3] = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL}, most = 0;
    for (size_t i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) {
            const double x = xyz[3 * i + (size_t)k];
            if (x < low[k]) low[k] = x;
            if (x > high[k]) high[k] = x;
        }
    for (int k = 0; k < 3; k++) globe->centre[k] = (low[k] + high[k]) / 2;
    for (size_t i = 0; i < count; i++) {
        const double *p = xyz + 3 * i;
        const double from[3] = {p[0] - globe->centre[0], p[1] - globe->centre[1], p[2] - globe->centre[2]};
        const double square = dot(from, from);
        if (square > most) most = square;
    }
    globe->radius = sqrt(most) * (1 + 1e-9) + 1e-6;
}

static void find_horizon(const double *xyz, size_t count, tile_globe *globe) {
    double direction[3] = {globe->centre[0] / EARTH_A, globe->centre[1] / EARTH_A, globe->centre[2] / EARTH_B},
           most = 0;
    const double length = sqrt(dot(direction, direction));
    bool exists = length > 0;
    for (int k = 0; k < 3; k++) direction[k] = exists ? direction[k] / length : k == 0;
    for (size_t i = 0; i < count && exists; i++) {
        const double p[3] = {xyz[3 * i] / EARTH_A, xyz[3 * i + 1] / EARTH_A, xyz[3 * i + 2] / EARTH_B};
        const double square = dot(p, p), m2 = square > 1 ? square : 1, along = dot(p, direction) / sqrt(square);
        const double across = along < 1 ? sqrt(1 - along * along) : 0; /* of the angle t */
        /* cos(t + acos(1/m)) */
        const double cosine = (along - across * sqrt(m2 - 1)) / sqrt(m2);
        exists = cosine > 1e-6;
        if (exists && 1 / cosine > most) most = 1 / cosine;
    }
    /* Cosines near 1 lose digits: t is known to some 1e-8. */
    const double r = exists ? most * (1 + 1e-7) : NEVER_HIDDEN;
    for (int k = 0; k < 3; k++) globe->horizon[k] = direction[k] * r;
}

int globe_make(const tile_mesh *mesh, tile_globe *globe) {
    const size_t count = mesh_vertices(mesh);
    *globe = (tile_globe){.xyz = sqlite3_malloc64(3 * count * sizeof *globe->xyz),
                          .angles = sqlite3_malloc64(count * sizeof *globe->angles)};
    if (!globe->xyz || !globe->angles) return SQLITE_NOMEM;
    place_all(mesh, globe);
    find_sphere(globe->xyz, count, globe);
    find_horizon(globe->xyz, count, globe);
    return SQLITE_OK;
}

void globe_free(tile_globe *globe) {
    sqlite3_free(globe->xyz);
    sqlite3_free(globe->angles);
    *globe = (tile_globe){0};
}

/* ------------------------------------------------------------------------------------------------ normals -- */

/* The samples around a place and how much each counts; 1 where the place is one. */
typedef struct around {
    uint8_t count;
    float weight[4];
} around;

static around list_samples(const tiles *t, const rqt_cut_vertex *v, rqt_patch *samples) {
    around a = {0};
    const int32_t last = t->terrain->lattice.width - 1;
    const double col = floor(v->col), row = floor(v->row), right = v->col - col, down = v->row - row;
    /* On a seam: the mean of both columns. */
    const bool is_seam = plan_of(t)->seam.q && (v->col <= 0 || v->col >= last);
    for (int i = 0; i < 4; i++) {
        const double weight = (is_seam ? 0.5 : i & 1 ? right : 1 - right) * (i & 2 ? down : 1 - down);
        if (weight <= 0) continue;
        samples->vertices[samples->vertex_count++] = (rqt_patch_vertex){
            .col = is_seam ? (i & 1 ? last : 0) : (int32_t)col + (i & 1), .row = (int32_t)row + (i >> 1)};
        a.weight[a.count++] = (float)weight;
    }
    return a;
}

static uint8_t to_byte(double x) {
    return (uint8_t)((x < -1 ? 0 : x > 1 ? 1 : x * 0.5 + 0.5) * 255 + 0.5);
}

/* "A Survey of Efficient Representations for Independent Unit Vectors" (Cigolle and others, 2014): oct, 16 bits. */
static void pack(const double n[3], uint8_t packed[2]) {
    const double sum = fabs(n[0]) + fabs(n[1]) + fabs(n[2]);
    double x = n[0] / sum, y = n[1] / sum;
    if (n[2] < 0) {
        const double folded = (1 - fabs(y)) * (x < 0 ? -1 : 1);
        y = (1 - fabs(x)) * (y < 0 ? -1 : 1);
        x = folded;
    }
    packed[0] = to_byte(x);
    packed[1] = to_byte(y);
}

int globe_normals(tiles *t, const tile_mesh *mesh, const tile_globe *globe, uint8_t *packed, char **error) {
    const size_t count = mesh->cut.vertex_count;
    rqt_patch samples = {.vertices = sqlite3_malloc64((4 * count + 1) * sizeof *samples.vertices)};
    around *all = sqlite3_malloc64((count + 1) * sizeof *all);
    float *normals = NULL;
    int code = samples.vertices && all ? SQLITE_OK : SQLITE_NOMEM;
    if (code == SQLITE_OK) {
        for (size_t i = 0; i < count; i++) all[i] = list_samples(t, &mesh->cut.vertices[i], &samples);
        code = store_normals(t->store, t->terrain, &samples, &normals, error);
    }
    const float *next = normals;
    for (size_t i = 0; i < count && code == SQLITE_OK; i++) {
        double enu[3] = {0}, n[3];
        for (int k = 0; k < all[i].count; k++, next += 3)
            for (int c = 0; c < 3; c++) enu[c] += (double)all[i].weight[k] * (double)next[c];
        earth_turn(&globe->angles[i].lon, &globe->angles[i].lat, enu, n);
        pack(n, packed + 2 * i);
    }
    for (size_t i = count; i < mesh_vertices(mesh) && code == SQLITE_OK; i++) {
        double n[3];
        earth_turn(&globe->angles[i].lon, &globe->angles[i].lat, (const double[3]){0, 0, 1}, n);
        pack(n, packed + 2 * i);
    }
    sqlite3_free(normals);
    sqlite3_free(all);
    sqlite3_free(samples.vertices);
    return code;
}
