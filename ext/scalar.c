/* scalar.c - the functions that give one value. */
#include "functions.h"

#include "format.h"
#include "geo.h"

#include <math.h>
#include <string.h>
#include <zstd.h>

void scalar_error(sqlite3_context *result, const char *name, int code, char *sentence) {
    if (code == SQLITE_NOMEM || !sentence) {
        if (code == SQLITE_NOMEM)
            sqlite3_result_error_nomem(result);
        else
            sqlite3_result_error_code(result, code);
    } else {
        char *whole = sqlite3_mprintf("%s(): %s", name, sentence);
        if (whole) {
            sqlite3_result_error(result, whole, -1);
            sqlite3_result_error_code(result, code);
        } else {
            sqlite3_result_error_nomem(result);
        }
        sqlite3_free(whole);
    }
    sqlite3_free(sentence);
}

void call_version(sqlite3_context *result, int count, sqlite3_value **arguments) {
    (void)count, (void)arguments;
    sqlite3_result_text(result, RQT_VERSION, -1, SQLITE_STATIC);
}

void call_build_info(sqlite3_context *result, int count, sqlite3_value **arguments) {
    (void)count, (void)arguments;
    char *info =
        sqlite3_mprintf("rqt %s, format %d, built with %s, SQLite %s (running %s), GeographicLib %s, zstd %s",
                        RQT_VERSION, RQT_FORMAT_VERSION,
#ifdef __clang__
                        "clang " __clang_version__,
#else
                        "gcc " __VERSION__,
#endif
                        SQLITE_VERSION, sqlite3_libversion(), geo_version(), ZSTD_versionString());
    if (info)
        sqlite3_result_text(result, info, -1, sqlite3_free);
    else
        sqlite3_result_error_nomem(result);
}

/* -------------------------------------------------------------------------------------------- rqt_mesh */

static int own_format(const request *r, const rqt_patch *patch, rqt_mesh_kind kind, uint8_t **bytes, size_t *size,
                      char **error) {
    const bool strip = kind == RQT_MESH_STRIP;
    const rqt_mesh_header header = {.kind = kind,
                                    .vertex_count = patch->vertex_count,
                                    .index_count = strip ? patch->strip_count : 3 * patch->triangle_count,
                                    .placement = r->terrain->placement,
                                    .unit = r->terrain->unit,
                                    .eps = r->achieved_eps,
                                    .srid = r->terrain->srid};
    *size = rqt_mesh_bytes(&header);
    int code = SQLITE_OK;
    if (*size > INT32_MAX)
        code = fail(error, "the mesh is larger than 2 GiB; ask for less or a larger eps");
    else
        *bytes = sqlite3_malloc64(*size);
    if (code == SQLITE_OK && !*bytes) code = SQLITE_NOMEM;
    if (code == SQLITE_OK)
        rqt_mesh_encode(&header, patch->vertices, strip ? patch->strip : patch->triangles, *bytes);
    return code;
}

static int format_failed(rqt_status status, char **error) {
    if (status == RQT_OK) return SQLITE_OK;
    if (status == RQT_NO_MEMORY) return SQLITE_NOMEM;
    return fail(error, "the mesh is larger than 2 GiB in this format; ask for less or a larger eps");
}

static void framed_coordinates(const void *context, size_t vertex, double xyz[3]) {
    memcpy(xyz, (const double *)context + 3 * vertex, 3 * sizeof *xyz);
}

/* In a frame of its own: geocentric has an SRID, east-north-up has none. */
static int framed_format(const request *r, rqt_patch *patch, format_kind kind, uint8_t **bytes, size_t *size,
                         char **error) {
    double *xyz = NULL;
    int code = frame_merge(r->frame, patch);
    if (code == SQLITE_OK) code = frame_places(r->frame, patch, &xyz, error);
    const format_mesh mesh = {.vertex_count = patch->vertex_count,
                              .triangle_count = patch->triangle_count,
                              .triangles = patch->triangles,
                              .coordinates = framed_coordinates,
                              .context = xyz,
                              .srid = r->frame_kind == FRAME_ECEF ? 4978 : 0,
                              .title = frame_title(r->frame),
                              .eps = r->achieved_eps};
    if (code == SQLITE_OK) code = format_failed(format_write(&mesh, kind, store_allocator(), bytes, size), error);
    sqlite3_free(xyz);
    return code;
}

static int other_format(const request *r, rqt_patch *patch, format_kind kind, uint8_t **bytes, size_t *size,
                        char **error) {
    if (r->frame) return framed_format(r, patch, kind, bytes, size, error);
    const format_frame frame = {.placement = r->terrain->placement,
                                .unit = r->terrain->unit,
                                .srid = r->terrain->srid,
                                .title = r->terrain->name,
                                .eps = r->achieved_eps};
    return format_failed(format_patch(patch, &frame, kind, store_allocator(), bytes, size), error);
}

typedef struct cut_source {
    const rqt_cut *cut;
    const store_terrain *terrain;
} cut_source;

/* The one expression of the contract, between samples. */
static void cut_coordinates(const void *context, size_t vertex, double xyz[3]) {
    const cut_source *s = context;
    const rqt_cut_vertex *v = &s->cut->vertices[vertex];
    const rqt_placement *at = &s->terrain->placement;
    const rqt_unit *unit = &s->terrain->unit;
    xyz[0] = at->x0 + v->col * at->dx;
    xyz[1] = at->y0 + v->row * at->dy;
    xyz[2] = ((double)unit->z0 + v->q / (double)unit->d) * rqt_unit_factor(unit) + unit->offset;
}

static int cut_format(request *r, format_kind kind, uint8_t **bytes, size_t *size, char **error) {
    rqt_cut cut;
    int code = request_cut(r, &cut, error);
    if (code != SQLITE_OK) return code;
    const cut_source source = {&cut, r->terrain};
    const format_mesh mesh = {.vertex_count = cut.vertex_count,
                              .triangle_count = cut.triangle_count,
                              .triangles = cut.triangles,
                              .coordinates = cut_coordinates,
                              .context = &source,
                              .srid = r->terrain->srid,
                              .title = r->terrain->name,
                              .eps = r->achieved_eps};
    code = format_failed(format_write(&mesh, kind, store_allocator(), bytes, size), error);
    rqt_cut_free(&cut);
    return code;
}

void call_mesh(sqlite3_context *result, int count, sqlite3_value **arguments) {
    connection *c = sqlite3_user_data(result);
    char *error = NULL;
    request r = {0};
    rqt_patch patch = {0};
    uint8_t *bytes = NULL;
    size_t size = 0;
    format_kind kind = FORMAT_OBJ;
    const char *format =
        sqlite3_value_type(arguments[2]) == SQLITE_TEXT ? (const char *)sqlite3_value_text(arguments[2]) : "";
    const bool strip = strcmp(format, "strip") == 0, indexed = strcmp(format, "indexed") == 0;
    const bool wire = strcmp(format, "rqt") == 0;
    const bool other = !strip && !indexed && !wire && format_from_name(format, &kind);
    int code = SQLITE_OK;
    if (strcmp(format, "glb") == 0)
        code = fail(&error, "format \"%s\" is not in this version", format);
    else if (!strip && !indexed && !wire && !other)
        code =
            fail(&error, "unknown format \"%s\"; there are strip indexed rqt obj ply wkb gpkg spatialite", format);
    if (code == SQLITE_OK)
        code = request_read(c, arguments[0], arguments[1], count > 3 ? arguments[3] : NULL,
                            count > 4 ? arguments[4] : NULL, &r, &error);
    const bool cut = r.mode == REQUEST_CUT;
    if (code == SQLITE_OK && !other) {
        char what[40];
        sqlite3_snprintf(sizeof what, what, "format \"%s\"", format);
        code = request_refuse_cut(&r, what, &error);
    }
    if (code == SQLITE_OK && r.frame && !other)
        code =
            fail(&error, "format \"%s\" holds samples, not points in space: option \"frame\" must be crs", format);
    if (code == SQLITE_OK && wire)
        code = wire_mesh(&r, &bytes, &size, &error);
    else if (code == SQLITE_OK && cut)
        code = cut_format(&r, kind, &bytes, &size, &error);
    else if (code == SQLITE_OK)
        code = request_patch(&r, strip ? RQT_PRODUCT_STRIP : RQT_PRODUCT_TRIANGLES, &patch, NULL, &error);
    if (code == SQLITE_OK && !wire && !cut)
        code = other ? other_format(&r, &patch, kind, &bytes, &size, &error)
                     : own_format(&r, &patch, strip ? RQT_MESH_STRIP : RQT_MESH_INDEXED, &bytes, &size, &error);
    if (r.store) store_keep(r.store, &patch);
    request_free(&r);
    if (code != SQLITE_OK)
        scalar_error(result, "rqt_mesh", code, error);
    else if (kind == FORMAT_OBJ && other)
        sqlite3_result_text64(result, (const char *)bytes, size, sqlite3_free, SQLITE_UTF8);
    else
        sqlite3_result_blob64(result, bytes, size, sqlite3_free);
}

void call_height(sqlite3_context *result, int count, sqlite3_value **arguments) {
    connection *c = sqlite3_user_data(result);
    char *error = NULL;
    double x, y, eps = -1, metres = 0;
    bool found = false;
    store *s;
    const store_terrain *t;
    int code = SQLITE_OK;
    if (!request_number(arguments[0], "x", &x, &error) || !request_number(arguments[1], "y", &y, &error))
        code = SQLITE_ERROR;
    else if (count > 2 && !request_number(arguments[2], "eps", &eps, &error))
        code = SQLITE_ERROR;
    else if (count > 2 && eps < 0)
        code = fail(&error, "eps must be 0 or more");
    if (code == SQLITE_OK && (code = connection_store(c, &s, &error)) == SQLITE_OK) {
        code = request_terrain(s, count > 3 ? arguments[3] : NULL, &t, &error);
        if (code == SQLITE_OK) code = store_height(s, t, x, y, eps, &metres, &found, &error);
        connection_done(c);
    }
    if (code != SQLITE_OK)
        scalar_error(result, "rqt_height", code, error);
    else if (found)
        sqlite3_result_double(result, metres);
}
