/* scalar.c - the functions that give one value. */
#include "model.h"

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

/* What argument `format` asks for. */
typedef struct mesh_format {
    enum { MESH_STRIP, MESH_INDEXED, MESH_WIRE, MESH_INCREMENT, MESH_OTHER } family;
    format_kind kind; /* of MESH_OTHER */
    bool quantized, normals, errors;
    char name[16]; /* without those; cut where it is none of ours */
} mesh_format;

#define KNOWN                                                                                                   \
    " strip indexed rqt obj ply wkb gpkg spatialite glb ply+normals rqt+normals rqt+errors rqt+normals+errors " \
    "glb+normals glb+quantized glb+quantized+normals, and increment of views"

/* Takes a suffix off the name. */
static bool take_suffix(const char *text, size_t *length, const char *suffix) {
    const size_t n = strlen(suffix);
    const bool is_there = *length > n && memcmp(text + *length - n, suffix, n) == 0;
    if (is_there) *length -= n;
    return is_there;
}

static int read_format(sqlite3_value *value, mesh_format *f, char **error) {
    static const char *const own[] = {"strip", "indexed", "rqt", "increment"};
    if (sqlite3_value_type(value) != SQLITE_TEXT) return fail(error, "format must be a text: one of%s", KNOWN);
    const char *text = (const char *)sqlite3_value_text(value);
    if (!text) return SQLITE_NOMEM;
    size_t length = strlen(text);
    *f = (mesh_format){.family = MESH_OTHER, .kind = FORMAT_OBJ};
    f->errors = take_suffix(text, &length, "+errors");
    f->normals = take_suffix(text, &length, "+normals");
    f->quantized = take_suffix(text, &length, "+quantized");
    sqlite3_snprintf(sizeof f->name, f->name, "%.*s", (int)length, text);
    for (int i = 0; i < 4; i++)
        if (strcmp(f->name, own[i]) == 0) f->family = i;
    if (f->family == MESH_OTHER && !format_from_name(f->name, &f->kind))
        return fail(error, "unknown format \"%s\"; there are%s", text, KNOWN);
    if (f->normals && f->family != MESH_WIRE && f->kind != FORMAT_PLY && f->kind != FORMAT_GLB)
        return fail(error, "format \"%s\" has no normals; ply, glb and rqt have", f->name);
    if (f->errors && f->family != MESH_WIRE)
        return fail(error, "format \"%s\" has no errors of vertices; rqt has", f->name);
    if (f->quantized && f->kind != FORMAT_GLB)
        return fail(error, "format \"%s\" is not quantized; glb can be", f->name);
    return SQLITE_OK;
}

static int format_failed(rqt_status status, char **error) {
    if (status == RQT_OK) return SQLITE_OK;
    if (status == RQT_NO_MEMORY) return SQLITE_NOMEM;
    return fail(error, "the mesh is larger than 2 GiB in this format; ask for less or a larger eps");
}

/* A mesh in the coordinates of the answer. */
static int write_mesh(const request *r, const format_mesh *mesh, const mesh_format *f, uint8_t **bytes,
                      size_t *size, char **error) {
    if (f->kind != FORMAT_GLB)
        return format_failed(format_write(mesh, f->kind, store_allocator(), bytes, size), error);
    model m;
    int code = model_create(r, mesh, f->quantized, &m, error);
    if (code == SQLITE_OK)
        code = format_failed(format_write(&m.mesh, f->kind, store_allocator(), bytes, size), error);
    model_free(&m);
    return code;
}

static void framed_coordinates(const void *context, size_t vertex, double xyz[3]) {
    memcpy(xyz, (const double *)context + 3 * vertex, 3 * sizeof *xyz);
}

/* In a frame of its own: geocentric has an SRID, east-north-up has none. */
static int framed_format(const request *r, rqt_patch *patch, const mesh_format *f, uint8_t **bytes, size_t *size,
                         char **error) {
    double *xyz = NULL;
    int code = frame_merge(r->frame, patch);
    if (code == SQLITE_OK) code = frame_places(r->frame, patch, &xyz, error);
    const format_mesh mesh = {.vertex_count = patch->vertex_count,
                              .triangle_count = patch->triangle_count,
                              .triangles = patch->triangles,
                              .coordinates = framed_coordinates,
                              .context = xyz,
                              .srid = request_srid(r),
                              .title = frame_title(r->frame),
                              .eps = r->achieved_eps};
    if (code == SQLITE_OK) code = write_mesh(r, &mesh, f, bytes, size, error);
    sqlite3_free(xyz);
    return code;
}

static int other_format(const request *r, rqt_patch *patch, const mesh_format *f, const float *normals,
                        uint8_t **bytes, size_t *size, char **error) {
    if (r->frame) return framed_format(r, patch, f, bytes, size, error);
    const format_frame frame = {.placement = r->terrain->placement,
                                .unit = r->terrain->unit,
                                .srid = r->terrain->srid,
                                .title = r->terrain->name,
                                .eps = r->achieved_eps,
                                .normals = normals};
    const format_source source = {patch, &frame};
    const format_mesh mesh = format_mesh_of(&source);
    return write_mesh(r, &mesh, f, bytes, size, error);
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

static int cut_format(request *r, const mesh_format *f, mesh_told *told, uint8_t **bytes, size_t *size,
                      char **error) {
    rqt_cut cut;
    int code = request_cut(r, &cut, error);
    if (code == SQLITE_OK) code = request_tell(r, NULL, told, error);
    if (code != SQLITE_OK) return code;
    told->vertices = cut.vertex_count;
    told->triangles = cut.triangle_count;
    const cut_source source = {&cut, r->terrain};
    const format_mesh mesh = {.vertex_count = cut.vertex_count,
                              .triangle_count = cut.triangle_count,
                              .triangles = cut.triangles,
                              .coordinates = cut_coordinates,
                              .context = &source,
                              .srid = r->terrain->srid,
                              .title = r->terrain->name,
                              .eps = r->achieved_eps};
    code = write_mesh(r, &mesh, f, bytes, size, error);
    rqt_cut_free(&cut);
    return code;
}

/* A format that is not the wire's, out of a patch. */
static int patch_mesh(request *r, const mesh_format *f, mesh_told *told, uint8_t **bytes, size_t *size,
                      char **error) {
    rqt_patch patch = {0};
    float *normals = NULL;
    int code = store_begin(r->store, error); /* mesh and normals of one state of the database */
    if (code != SQLITE_OK) return code;
    code =
        request_patch(r, f->family == MESH_STRIP ? RQT_PRODUCT_STRIP : RQT_PRODUCT_TRIANGLES, &patch, NULL, error);
    if (code == SQLITE_OK && f->normals) code = store_normals(r->store, r->terrain, &patch, &normals, error);
    store_end(r->store);
    if (code == SQLITE_OK) code = request_tell(r, &patch, told, error);
    if (code == SQLITE_OK && f->family == MESH_OTHER)
        code = other_format(r, &patch, f, normals, bytes, size, error);
    else if (code == SQLITE_OK)
        code =
            own_format(r, &patch, f->family == MESH_STRIP ? RQT_MESH_STRIP : RQT_MESH_INDEXED, bytes, size, error);
    told->vertices = patch.vertex_count; /* in a frame some have become one */
    told->triangles = patch.triangle_count;
    sqlite3_free(normals);
    store_keep(r->store, &patch);
    return code;
}

/* A request that has been read, in a format. */
static int make_mesh(request *r, const mesh_format *f, mesh_bytes *out, char **error) {
    if (r->frame && f->family != MESH_OTHER)
        return fail(error, "format \"%s\" holds samples, not points in space: option \"frame\" must be crs",
                    f->name);
    if (r->frame && f->normals)
        return fail(error, "normals are those of the terrain's CRS: option \"frame\" must be crs");
    if (f->family != MESH_OTHER || f->normals) {
        char what[60];
        sqlite3_snprintf(sizeof what, what, "format \"%s%s%s\"", f->name, f->normals ? "+normals" : "",
                         f->errors ? "+errors" : "");
        const int code = request_refuse_cut(r, what, error);
        if (code != SQLITE_OK) return code;
    }
    if (f->family == MESH_INCREMENT) return view_increment(r, &out->told, &out->bytes, &out->size, error);
    if (f->family == MESH_WIRE)
        return wire_mesh(r, f->normals, f->errors, &out->told, &out->bytes, &out->size, error);
    if (r->mode == REQUEST_CUT) return cut_format(r, f, &out->told, &out->bytes, &out->size, error);
    return patch_mesh(r, f, &out->told, &out->bytes, &out->size, error);
}

int mesh_bytes_make(connection *c, bool is_view, sqlite3_value **arguments, mesh_bytes *out, char **error) {
    sqlite3_value *const *format = arguments + (is_view ? 1 : 2), *terrain = format[1], *options = format[2];
    request r = {0};
    mesh_format f = {.family = MESH_OTHER, .kind = FORMAT_OBJ};
    *out = (mesh_bytes){.is_text = false};
    int code = read_format(format[0], &f, error);
    if (code == SQLITE_OK)
        code = is_view ? request_follow_view(c, arguments[0], terrain, options,
                                             f.family == MESH_INCREMENT ? VIEW_INCREMENT : VIEW_ANSWER, &r, error)
                       : request_read(c, arguments[0], arguments[1], terrain, options, REQUEST_COVER, &r, error);
    if (code == SQLITE_OK && f.family == MESH_INCREMENT && !r.previous)
        code = fail(error,
                    "format \"increment\" is for views with option \"previous\"; \"\" begins a sequence of them");
    if (code == SQLITE_OK) code = make_mesh(&r, &f, out, error);
    request_free(&r);
    out->is_text = f.family == MESH_OTHER && f.kind == FORMAT_OBJ;
    if (code == SQLITE_OK) return code;
    sqlite3_free(out->bytes);
    sqlite3_free(out->told.token);
    *out = (mesh_bytes){.is_text = false};
    return code;
}

/* terrain and options are there as far as they are given. */
static void call_with_format(sqlite3_context *result, bool is_view, int count, sqlite3_value **given) {
    sqlite3_value *arguments[5] = {NULL};
    mesh_bytes mesh;
    char *error = NULL;
    for (int i = 0; i < count; i++) arguments[i] = given[i];
    const int code = mesh_bytes_make(sqlite3_user_data(result), is_view, arguments, &mesh, &error);
    if (code != SQLITE_OK)
        scalar_error(result, is_view ? "rqt_view_mesh" : "rqt_mesh", code, error);
    else if (mesh.is_text)
        sqlite3_result_text64(result, (const char *)mesh.bytes, mesh.size, sqlite3_free, SQLITE_UTF8);
    else
        sqlite3_result_blob64(result, mesh.bytes, mesh.size, sqlite3_free);
    sqlite3_free(mesh.told.token);
}

void call_mesh(sqlite3_context *result, int count, sqlite3_value **arguments) {
    call_with_format(result, false, count, arguments);
}

void call_view_mesh(sqlite3_context *result, int count, sqlite3_value **arguments) {
    call_with_format(result, true, count, arguments);
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
