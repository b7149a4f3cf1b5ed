/* area.c - rqt_area: how large a region is, on the map and as terrain, and what lies above height 0.
 *
 * The mesh of the region, clipped to it, is measured triangle by triangle and summed in the order of the mesh, with
 * what each addition loses kept (Neumaier). In degrees a triangle is integrated over the terrain's ellipsoid
 * (src/geo/surface.cpp); elsewhere it is plane.
 */
#include "functions.h"

#include "geo.h"

#include <math.h>
#include <string.h>

typedef struct total {
    double sum, lost;
} total;

static void add(total *t, double v) {
    const double sum = t->sum + v;
    t->lost += fabs(t->sum) >= fabs(v) ? (t->sum - sum) + v : (v - sum) + t->sum;
    t->sum = sum;
}

typedef struct measurer {
    const store_terrain *terrain;
    geo_ellipsoid ellipsoid;
    double metre; /* in a unit of x and y */
    total of[3];  /* planimetric, surface, volume */
} measurer;

static geo_measure measure_plane(const measurer *m, double p[3][3]) {
    double u[3], v[3];
    for (int i = 0; i < 3; i++) {
        const double scale = i < 2 ? m->metre : 1;
        u[i] = (p[1][i] - p[0][i]) * scale;
        v[i] = (p[2][i] - p[0][i]) * scale;
    }
    const double n[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
    const double flat = fabs(n[2]) / 2;
    return (geo_measure){.planimetric = flat,
                         .surface = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) / 2,
                         .volume = flat * ((p[0][2] + p[1][2] + p[2][2]) / 3)};
}

static void measure_triangle(measurer *m, const double samples[3][3]) {
    const rqt_placement *at = &m->terrain->placement;
    const rqt_unit *u = &m->terrain->unit;
    double p[3][3];
    for (int i = 0; i < 3; i++) {
        p[i][0] = at->x0 + samples[i][0] * at->dx;
        p[i][1] = at->y0 + samples[i][1] * at->dy;
        p[i][2] = ((double)u->z0 + samples[i][2] / (double)u->d) * rqt_unit_factor(u) + u->offset;
    }
    const geo_measure one =
        m->terrain->lonlat ? geo_measure_triangle(&m->ellipsoid, (const double(*)[3])p) : measure_plane(m, p);
    add(&m->of[0], one.planimetric);
    add(&m->of[1], one.surface);
    add(&m->of[2], one.volume);
}

static void measure_patch(measurer *m, const rqt_patch *patch) {
    for (size_t t = 0; t < patch->triangle_count; t++) {
        double corner[3][3];
        for (size_t i = 0; i < 3; i++) {
            const rqt_patch_vertex *v = &patch->vertices[patch->triangles[3 * t + i]];
            corner[i][0] = v->col, corner[i][1] = v->row, corner[i][2] = v->q;
        }
        measure_triangle(m, (const double(*)[3])corner);
    }
}

static void measure_cut(measurer *m, const rqt_cut *cut) {
    for (size_t t = 0; t < cut->triangle_count; t++) {
        double corner[3][3];
        for (size_t i = 0; i < 3; i++) {
            const rqt_cut_vertex *v = &cut->vertices[cut->triangles[3 * t + i]];
            corner[i][0] = v->col, corner[i][1] = v->row, corner[i][2] = v->q;
        }
        measure_triangle(m, (const double(*)[3])corner);
    }
}

static void area_column(void *data, size_t row, int column, sqlite3_context *result) {
    (void)row;
    const double *value = data;
    sqlite3_result_double(result, value[column]);
}

/* The patch, or what of it lies in the region. */
static int measure_region(request *r, measurer *m, char **error) {
    if (r->mode == REQUEST_CUT && !rqt_region_is_all(r->region)) {
        rqt_cut cut;
        const int code = request_cut(r, &cut, error);
        if (code != SQLITE_OK) return code;
        measure_cut(m, &cut);
        rqt_cut_free(&cut);
        return SQLITE_OK;
    }
    rqt_patch patch;
    const int code = request_patch(r, RQT_PRODUCT_TRIANGLES, &patch, NULL, error);
    if (code == SQLITE_OK) measure_patch(m, &patch);
    store_keep(r->store, &patch);
    return code;
}

int fill_area(connection *c, sqlite3_value **arguments, row_set *rows, char **error) {
    request r;
    int code = request_read(c, arguments[0], arguments[1], arguments[2], arguments[3], REQUEST_CUT, &r, error);
    if (code != SQLITE_OK) return code;
    measurer m = {.terrain = r.terrain, .ellipsoid = GEO_WGS84, .metre = terrain_metre(r.terrain)};
    if (r.frame) code = fail(error, "areas are measured on the ellipsoid: option \"frame\" must be crs");
    if (code == SQLITE_OK && r.terrain->lonlat && !r.terrain->wgs84 &&
        !geo_ellipsoid_of_wkt(r.terrain->crs, &m.ellipsoid))
        code = fail(error, "the CRS of terrain %s names no ellipsoid", r.terrain->name);
    double *out = NULL;
    if (code == SQLITE_OK) code = (out = sqlite3_malloc(4 * sizeof *out)) ? SQLITE_OK : SQLITE_NOMEM;
    if (code == SQLITE_OK) code = measure_region(&r, &m, error);
    if (code == SQLITE_OK) {
        for (int i = 0; i < 3; i++) out[i] = m.of[i].sum + m.of[i].lost;
        out[3] = r.achieved_eps;
        *rows = (row_set){.count = 1, .data = out, .column = area_column, .release = sqlite3_free};
    } else {
        sqlite3_free(out);
    }
    request_free(&r);
    return code;
}
