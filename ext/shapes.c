/* shapes.c - rqt_bbox, rqt_circle, rqt_corridor: regions out of numbers and lines. */
#include "functions.h"

#include "format.h"
#include "geo.h"

#include <math.h>

static void result_polygons(sqlite3_context *result, const char *name, const geo_polygons *p, int32_t srid) {
    uint8_t *bytes = NULL;
    size_t size = 0;
    const rqt_status status = format_polygons_gpkg(p->lonlat, p->ring_points, p->ring_is_shell, p->rings, srid,
                                                   store_allocator(), &bytes, &size);
    if (status == RQT_OK)
        sqlite3_result_blob64(result, bytes, size, sqlite3_free);
    else if (status == RQT_NO_MEMORY)
        sqlite3_result_error_nomem(result);
    else
        scalar_error(result, name, SQLITE_ERROR, sqlite3_mprintf("the polygons take more than 2 GiB"));
}

void call_bbox(sqlite3_context *result, int count, sqlite3_value **arguments) {
    static const char *const names[] = {"x0", "y0", "x1", "y1", "srid"};
    double v[5] = {0};
    char *error = NULL;
    for (int i = 0; i < count; i++) {
        if (i == 4 && sqlite3_value_type(arguments[4]) == SQLITE_NULL) continue;
        if (!request_number(arguments[i], names[i], &v[i], &error) || !isfinite(v[i])) {
            if (!error) (void)fail(&error, "%s must be finite", names[i]);
            scalar_error(result, "rqt_bbox", SQLITE_ERROR, error);
            return;
        }
    }
    /* As in GeoJSON (RFC 7946, 5.2): west greater than east is a box across the antimeridian. */
    const bool across = v[4] == 4326 && v[0] > v[2] && v[0] <= 180 && v[2] >= -180;
    if ((v[0] > v[2] && !across) || v[1] > v[3])
        (void)fail(&error, "%s is greater than %s: give the lesser corner first", v[1] > v[3] ? "y0" : "x0",
                   v[1] > v[3] ? "y1" : "x1");
    else if (v[4] != floor(v[4]) || fabs(v[4]) > INT32_MAX)
        (void)fail(&error, "srid must be an integer");
    if (error) {
        scalar_error(result, "rqt_bbox", SQLITE_ERROR, error);
        return;
    }
    double rings[16] = {v[0], v[1], v[2], v[1], v[2], v[3], v[0], v[3]};
    if (across) {
        const double two[16] = {v[0], v[1], 180,  v[1], 180,  v[3], v[0], v[3],
                                -180, v[1], v[2], v[1], v[2], v[3], -180, v[3]};
        for (int i = 0; i < 16; i++) rings[i] = two[i];
    }
    size_t four[2] = {4, 4};
    unsigned char shells[2] = {1, 1};
    const geo_polygons box = {
        .lonlat = rings, .points = 4, .ring_points = four, .ring_is_shell = shells, .rings = across ? 2 : 1};
    result_polygons(result, "rqt_bbox", &box, (int32_t)v[4]);
}

void call_circle(sqlite3_context *result, int count, sqlite3_value **arguments) {
    static const char *const names[] = {"lon", "lat", "metres"};
    double v[3];
    char *error = NULL;
    for (int i = 0; i < count; i++)
        if (!request_number(arguments[i], names[i], &v[i], &error)) {
            scalar_error(result, "rqt_circle", SQLITE_ERROR, error);
            return;
        }
    geo_polygons circle;
    char why[256] = "";
    int code = geo_circle(v[0], v[1], v[2], &circle, why, sizeof why);
    if (code == GEO_OK) {
        result_polygons(result, "rqt_circle", &circle, 4326);
        geo_polygons_free(&circle);
        return;
    }
    code = code == GEO_NO_MEMORY ? SQLITE_NOMEM : fail(&error, "%s", why);
    scalar_error(result, "rqt_circle", code, error);
}

void call_corridor(sqlite3_context *result, int count, sqlite3_value **arguments) {
    (void)count;
    char *error = NULL;
    double metres;
    line_set lines = {0};
    geo_polygons corridor = {0};
    int code = lines_read(NULL, NULL, arguments[0], &lines, &error);
    if (code == SQLITE_OK && lines.srid != 0 && lines.srid != 4326)
        code = fail(&error, "line must be in SRID 4326; it has SRID %d", lines.srid);
    if (code == SQLITE_OK && !request_number(arguments[1], "metres", &metres, &error))
        code = error ? SQLITE_ERROR : SQLITE_NOMEM;
    if (code == SQLITE_OK) {
        char why[256] = "";
        const int status = geo_corridor(lines.xy, lines.counts, lines.count, metres, &corridor, why, sizeof why);
        if (status != GEO_OK) code = status == GEO_NO_MEMORY ? SQLITE_NOMEM : fail(&error, "%s", why);
    }
    if (code == SQLITE_OK)
        result_polygons(result, "rqt_corridor", &corridor, 4326);
    else
        scalar_error(result, "rqt_corridor", code, error);
    geo_polygons_free(&corridor);
    lines_free(&lines);
}
