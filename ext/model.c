/* model.c - where a glb is. A model is in metres, so the coordinates of the answer will do but for degrees:
 *
 *   projected, or no CRS   x, y as they are, their unit in metres beside; whole steps apart, but for mode cut
 *   option frame           points in space as they are
 *   degrees                metres east, north and up about the middle of the mesh, at its middle height
 *
 * In degrees the mesh is that of the terrain, straight in longitude, latitude and height between its vertices;
 * drawn flat, a large triangle leaves the ground by what the Earth curves below it. Option frame is for those who
 * want eps to hold in space. Heights are taken as above the ellipsoid of the CRS, as in the scenes of views
 * (scene.c).
 *
 * Normals are about each vertex's own east, north and up. They are turned to those of the middle. */
#include "model.h"

#include <math.h>
#include <string.h>

static void placed_coordinates(const void *context, size_t vertex, double xyz[3]) {
    memcpy(xyz, (const double *)context + 3 * vertex, 3 * sizeof *xyz);
}

/* The middle of the mesh's box; longitude, latitude, height. */
static void find_middle(const format_mesh *mesh, double middle[3]) {
    double low[3] = {0, 0, 0}, high[3] = {0, 0, 0}, at[3];
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        mesh->coordinates(mesh->context, i, at);
        for (int axis = 0; axis < 3; axis++) {
            low[axis] = i ? fmin(low[axis], at[axis]) : at[axis];
            high[axis] = i ? fmax(high[axis], at[axis]) : at[axis];
        }
    }
    for (int axis = 0; axis < 3; axis++) middle[axis] = low[axis] / 2 + high[axis] / 2;
}

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* East, north and up of a place, geocentric. */
static void find_axes(const scene *s, const double place[3], double axes[3][3]) {
    double *east = axes[0], *north = axes[1], *up = axes[2];
    scene_axes(s, place, east, up);
    north[0] = up[1] * east[2] - up[2] * east[1];
    north[1] = up[2] * east[0] - up[0] * east[2];
    north[2] = up[0] * east[1] - up[1] * east[0];
}

static void turn_normal(const scene *s, const double place[3], const double axes[3][3], const float *from,
                        float *to) {
    double own[3][3], n[3];
    find_axes(s, place, own);
    for (int i = 0; i < 3; i++) n[i] = from[0] * own[0][i] + from[1] * own[1][i] + from[2] * own[2][i];
    for (int i = 0; i < 3; i++) to[i] = (float)dot(n, axes[i]);
}

static int place_vertices(const request *r, const format_mesh *mesh, const scene *s, const geo_frame *frame,
                          model *m, char **error) {
    double axes[3][3];
    find_axes(s, m->place, axes);
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        double at[3], *p = m->xyz + 3 * i;
        mesh->coordinates(mesh->context, i, at);
        /* A row at a pole may be beyond it, by a rounding. */
        if (fabs(at[1]) > 90 && fabs(at[1]) < 90 * (1 + 1e-9)) at[1] = copysign(90, at[1]);
        geo_frame_place(frame, at, p);
        p[2] -= m->place[2];
        if (!isfinite(p[0]) || !isfinite(p[1]) || !isfinite(p[2]))
            return fail(error, "terrain %s has no place in space at %!.15g, %!.15g", r->terrain->name, at[0],
                        at[1]);
        if (mesh->normals) turn_normal(s, at, (const double(*)[3])axes, mesh->normals + 3 * i, m->normals + 3 * i);
    }
    return SQLITE_OK;
}

/* Degrees into metres. */
static int place_degrees(const request *r, const format_mesh *mesh, model *m, char **error) {
    scene s;
    geo_frame *frame = NULL;
    find_middle(mesh, m->place);
    m->xyz = sqlite3_malloc64((3 * (sqlite3_uint64)mesh->vertex_count + 1) * sizeof *m->xyz);
    if (mesh->normals)
        m->normals = sqlite3_malloc64((3 * (sqlite3_uint64)mesh->vertex_count + 1) * sizeof *m->normals);
    if (!m->xyz || (mesh->normals && !m->normals)) return SQLITE_NOMEM;
    int code = scene_create(&s, r->terrain, 1, false, error);
    if (code != SQLITE_OK) return code;
    char why[256] = "";
    const int status =
        geo_frame_create(GEO_ENU, &s.ellipsoid, m->place[0], m->place[1], 0, &frame, why, sizeof why);
    if (status != GEO_OK) code = status == GEO_NO_MEMORY ? SQLITE_NOMEM : fail(error, "%s", why);
    if (code == SQLITE_OK) code = place_vertices(r, mesh, &s, frame, m, error);
    geo_frame_free(frame);
    scene_free(&s);
    m->mesh.coordinates = placed_coordinates;
    m->mesh.context = m->xyz;
    m->mesh.normals = m->normals;
    m->how.frame = "enu";
    m->how.place = m->place;
    m->how.is_about_place = true;
    return code;
}

int model_create(const request *r, const format_mesh *mesh, bool quantized, model *m, char **error) {
    const store_terrain *t = r->terrain;
    const double quantum = fabs(rqt_unit_factor(&t->unit) / (double)t->unit.d);
    *m = (model){.mesh = *mesh, .how = {.frame = "crs", .metre = 1, .quantum = quantum, .quantized = quantized}};
    m->mesh.model = &m->how;
    m->mesh.title = t->name;
    m->mesh.srid = r->frame_kind == FRAME_ECEF ? request_srid(r) : t->srid;
    if (r->view) m->how.tau = r->view->achieved_tau, m->how.tau_is_guaranteed = r->view->guaranteed;
    if (r->frame) {
        m->how.frame = r->frame_kind == FRAME_ECEF ? "ecef" : "enu";
        if (r->frame_kind == FRAME_ENU) m->how.place = frame_zero(r->frame);
        return SQLITE_OK;
    }
    if (t->lonlat) return mesh->triangle_count ? place_degrees(r, mesh, m, error) : SQLITE_OK;
    m->how.metre = terrain_metre(t);
    if (r->mode == REQUEST_CUT) return SQLITE_OK;
    m->how.step[0] = fabs(t->placement.dx);
    m->how.step[1] = fabs(t->placement.dy);
    m->how.step[2] = quantum;
    return SQLITE_OK;
}

void model_free(model *m) {
    sqlite3_free(m->xyz);
    sqlite3_free(m->normals);
}
