/* profile.c - rqt_profile: the heights of the mesh along a line.
 *
 * On a terrain in degrees the line goes along geodesics of the terrain's ellipsoid, cut into pieces that are
 * straight in lon,lat and at most a thousandth of a cell off them; elsewhere it is straight in the terrain's
 * coordinates. Distances are geodesic, else those coordinates in metres, as far as the CRS says what a metre is.
 */
#include "functions.h"

#include "geo.h"

#include <math.h>
#include <string.h>

/* A row of the answer. A gap is said by two rows without height: where the mesh ends, and where it begins again. */
typedef struct place {
    double distance, x, y, z;
    bool is_void;
} place;

static void profile_column(void *data, size_t row, int column, sqlite3_context *result) {
    const place *p = (const place *)data + row;
    if (column == 3 && p->is_void) return;
    const double value[] = {p->distance, p->x, p->y, p->z};
    sqlite3_result_double(result, value[column]);
}

/* A line in the plane as a path: nothing to follow, points repeated at once are dropped. */
static int plane_path(const line_set *lines, double metre, geo_path *path) {
    const size_t n = lines->points;
    path->lonlat = sqlite3_malloc64(2 * n * sizeof *path->lonlat);
    path->metres = sqlite3_malloc64(n * sizeof *path->metres);
    path->own = sqlite3_malloc64(n);
    path->ends = sqlite3_malloc64(n);
    path->line_points = sqlite3_malloc64(lines->count * sizeof *path->line_points);
    if (!path->lonlat || !path->metres || !path->own || !path->ends || !path->line_points) return SQLITE_NOMEM;
    memset(path->own, 1, n);
    memset(path->ends, 0, n);
    const double *xy = lines->xy;
    double gone = 0;
    for (size_t l = 0; l < lines->count; l++) {
        const size_t before = path->points;
        for (size_t i = 0; i < lines->counts[l]; i++, xy += 2) {
            if (i > 0) {
                const double step = hypot(xy[0] - xy[-2], xy[1] - xy[-1]);
                if (step == 0) continue;
                gone += step * metre;
            }
            memcpy(path->lonlat + 2 * path->points, xy, 2 * sizeof *xy);
            path->metres[path->points++] = gone;
        }
        path->ends[path->points - 1] = 1;
        path->line_points[path->lines++] = path->points - before;
    }
    return SQLITE_OK;
}

static void plane_path_free(geo_path *path) {
    sqlite3_free(path->lonlat);
    sqlite3_free(path->metres);
    sqlite3_free(path->own);
    sqlite3_free(path->ends);
    sqlite3_free(path->line_points);
    *path = (geo_path){0};
}

typedef struct measure {
    const store_terrain *t;
    const geo_path *path;
    geo_ellipsoid ellipsoid;
} measure;

static place place_of(const measure *m, const rqt_profile_row *row) {
    const rqt_placement *at = &m->t->placement;
    const double *from = m->path->lonlat + 2 * (size_t)row->point;
    place p = {.distance = m->path->metres[row->point]};
    if (row->at_point) {
        p.x = from[0] + 360.0 * row->turn;
        p.y = from[1];
    } else {
        p.x = at->x0 + row->col * at->dx;
        p.y = at->y0 + row->row * at->dy;
        const double end = m->path->metres[row->point + 1];
        const double to[2] = {p.x, p.y};
        if (m->t->lonlat)
            p.distance += geo_distance(&m->ellipsoid, from, to);
        else
            p.distance += row->t * (end - p.distance);
        p.distance = fmin(p.distance, end); /* rounding, and the piece's being straight */
    }
    const rqt_unit *u = &m->t->unit;
    p.z = ((double)u->z0 + row->q / (double)u->d) * rqt_unit_factor(u) + u->offset;
    return p;
}

static int make_places(const measure *m, const rqt_profile_row *line, size_t count, row_set *rows) {
    size_t gaps = 0;
    for (size_t i = 0; i < count; i++) gaps += line[i].after_gap;
    place *out = sqlite3_malloc64((count + 2 * gaps + 1) * sizeof *out);
    if (!out) return SQLITE_NOMEM;
    size_t n = 0;
    for (size_t i = 0; i < count; i++) {
        place p = place_of(m, &line[i]);
        if (n > 0) p.distance = fmax(p.distance, out[n - 1].distance);
        if (line[i].after_gap) {
            out[n] = out[n - 1];
            out[n++].is_void = true;
            out[n] = p;
            out[n++].is_void = true;
        }
        out[n++] = p;
    }
    *rows = (row_set){.count = n, .data = out, .column = profile_column, .release = sqlite3_free};
    return SQLITE_OK;
}

/* The mesh that the path meets, and along it. */
static int walk_path(store *s, const measure *m, double eps, row_set *rows, char **error) {
    const store_terrain *t = m->t;
    rqt_geometry *geometry = NULL;
    rqt_region *region = NULL;
    rqt_patch patch = {0};
    rqt_profile_row *line = NULL;
    size_t count = 0;
    rqt_status status = rqt_geometry_of_lines(m->path->lonlat, m->path->line_points, m->path->lines, 0,
                                              store_allocator(), &geometry);
    const request where = {.terrain = t};
    int code = status == RQT_OK ? request_region(&where, geometry, "line", &region, error) : SQLITE_NOMEM;
    const store_query_options options = {
        .select = RQT_SELECT_THRESHOLD, .outline = RQT_OUTLINE_EXACT, .product = RQT_PRODUCT_TRIANGLES};
    if (code == SQLITE_OK) code = store_query(s, t, region, eps, &options, &patch, NULL, error);
    if (code == SQLITE_OK) {
        const rqt_profile_line path = {.xy = m->path->lonlat,
                                       .ends = m->path->ends,
                                       .own = m->path->own,
                                       .points = m->path->points,
                                       .placement = t->placement,
                                       .period = t->lonlat ? 360 : 0};
        status = rqt_profile_build(&patch, &t->lattice, &path, store_allocator(), &line, &count);
        code = status == RQT_OK ? make_places(m, line, count, rows) : SQLITE_NOMEM;
    }
    sqlite3_free(line);
    store_keep(s, &patch);
    rqt_region_free(region);
    rqt_geometry_free(geometry);
    return code;
}

int fill_profile(connection *c, sqlite3_value **arguments, row_set *rows, char **error) {
    double eps;
    if (!request_number(arguments[1], "eps", &eps, error)) return *error ? SQLITE_ERROR : SQLITE_NOMEM;
    if (eps < 0) return fail(error, "eps must be 0 or more; it is %!.15g", eps);
    line_set lines = {0};
    store *s;
    int code = connection_store(c, &s, error);
    if (code == SQLITE_OK) {
        measure m = {.ellipsoid = GEO_WGS84};
        code = request_terrain(s, arguments[2], &m.t, error);
        if (code == SQLITE_OK) code = lines_read(c, m.t, arguments[0], &lines, error);
        geo_path path = {0};
        m.path = &path;
        if (code == SQLITE_OK && m.t->lonlat) {
            char why[256] = "";
            if (!m.t->wgs84 && !geo_ellipsoid_of_wkt(m.t->crs, &m.ellipsoid))
                code = fail(error, "the CRS of terrain %s names no ellipsoid", m.t->name);
            if (code == SQLITE_OK) {
                const int status = geo_path_create(&m.ellipsoid, lines.xy, lines.counts, lines.count,
                                                   m.t->placement.dx, m.t->placement.dy, &path, why, sizeof why);
                if (status != GEO_OK) code = status == GEO_NO_MEMORY ? SQLITE_NOMEM : fail(error, "%s", why);
            }
        } else if (code == SQLITE_OK) {
            code = plane_path(&lines, terrain_metre(m.t), &path);
        }
        if (code == SQLITE_OK) code = walk_path(s, &m, eps, rows, error);
        if (m.t && m.t->lonlat)
            geo_path_free(&path);
        else
            plane_path_free(&path);
        connection_done(c);
    }
    lines_free(&lines);
    return code;
}
