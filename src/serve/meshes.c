/* meshes.c - meshes: of a region, of a view, and what makes one finer. As the bytes that rqt_mesh gives, unchanged;
 * as rows in JSON; as triangles in GeoJSON. Whatever the form, what is known of the whole mesh stands in the
 * headers.
 */
#include "internal.h"

#include "picture.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef enum shape { SHAPE_ROWS, SHAPE_FEATURES, SHAPE_BYTES, SHAPE_PICTURE } shape;

enum { PICTURE_WIDTH = 1200 };

typedef struct mesh_format {
    const char *name; /* of parameter f, and of SQL's format */
    const char *type;
    shape shape;
    bool packed; /* compressed already */
} mesh_format;

/* The first is the default. Where several have one media type, Accept means the first of them. */
static const mesh_format FORMATS[] = {
    {"json", "application/json", SHAPE_ROWS, false},
    {"geojson", "application/geo+json", SHAPE_FEATURES, false},
    {"rqt", "application/vnd.rqt.mesh", SHAPE_BYTES, true},
    {"rqt+normals", "application/vnd.rqt.mesh", SHAPE_BYTES, true},
    {"rqt+errors", "application/vnd.rqt.mesh", SHAPE_BYTES, true},
    {"rqt+normals+errors", "application/vnd.rqt.mesh", SHAPE_BYTES, true},
    {"glb", "model/gltf-binary", SHAPE_BYTES, false},
    {"glb+normals", "model/gltf-binary", SHAPE_BYTES, false},
    {"glb+quantized", "model/gltf-binary", SHAPE_BYTES, false},
    {"glb+quantized+normals", "model/gltf-binary", SHAPE_BYTES, false},
    {"obj", "model/obj", SHAPE_BYTES, false},
    {"ply", "application/x-ply", SHAPE_BYTES, false},
    {"ply+normals", "application/x-ply", SHAPE_BYTES, false},
    {"strip", "application/vnd.rqt.strip", SHAPE_BYTES, false},
    {"indexed", "application/vnd.rqt.indexed", SHAPE_BYTES, false},
    {"wkb", "application/vnd.rqt.wkb", SHAPE_BYTES, false},
    {"increment", "application/vnd.rqt.increment", SHAPE_BYTES, true},
    {"svg", "image/svg+xml", SHAPE_PICTURE, false},
};
enum { FORMAT_COUNT = sizeof FORMATS / sizeof *FORMATS };

/* What differs between a region and a view: the statements. */
typedef struct mesh_kind {
    const char *rows, *triangles, *bytes; /* SQL */
} mesh_kind;

/* The last columns tell of the whole mesh. */
enum { ROW_COLUMNS = 5, TRIANGLE_COLUMNS = 10 };
#define OF_RANGE "vertices, triangles, achieved_eps"
#define OF_VIEW "vertices, triangles, achieved_tau, guaranteed, token"
static const mesh_kind RANGE = {"SELECT x, y, z, error, level, " OF_RANGE
                                " FROM rqt_range(:region, :eps, :terrain, :options)",
                                "SELECT *, " OF_RANGE " FROM rqt_triangles(:region, :eps, :terrain, :options)",
                                "SELECT * FROM rqt_answer(:region, :eps, :format, :terrain, :options)"};
static const mesh_kind VIEW = {"SELECT x, y, z, error, level, " OF_VIEW
                               " FROM rqt_view(:camera, :terrain, :options)",
                               "SELECT *, " OF_VIEW " FROM rqt_view_triangles(:camera, :terrain, :options)",
                               "SELECT * FROM rqt_view_answer(:camera, :format, :terrain, :options)"};

static const mesh_format *by_name(request *r, const char *name) {
    for (int i = 0; i < FORMAT_COUNT; i++)
        if (strcmp(FORMATS[i].name, name) == 0) return &FORMATS[i];
    buffer known = {.most = 256};
    for (int i = 0; i < FORMAT_COUNT; i++) buffer_format(&known, " %s", FORMATS[i].name);
    answer_problem(r, MHD_HTTP_BAD_REQUEST, "there is no format \"%s\"; there are%.*s", name, (int)known.size,
                   known.bytes ? known.bytes : "");
    buffer_free(&known);
    return NULL;
}

/* NULL: why is the answer. */
static const mesh_format *choose_format(request *r, bool *by_accept) {
    const char *name = request_parameter(r, "f");
    *by_accept = !name;
    if (name) {
        char plain[32];
        /* A + that a form's encoding has made a blank of. */
        snprintf(plain, sizeof plain, "%s", name);
        for (char *p = plain; *p; p++)
            if (*p == ' ') *p = '+';
        return by_name(r, strlen(name) < sizeof plain ? plain : name);
    }
    const char *types[FORMAT_COUNT];
    for (int i = 0; i < FORMAT_COUNT; i++) types[i] = FORMATS[i].type;
    const int i = negotiate_type(r->accept, types, FORMAT_COUNT);
    if (i >= 0) return &FORMATS[i];
    answer_problem(r, MHD_HTTP_NOT_ACCEPTABLE, "no format of a mesh is among what Accept names; f chooses one");
    return NULL;
}

/* {"columns":[...],"rows":[[...],...],"achieved_eps":10} */
static int write_rows(request *r, sqlite3_stmt *rows) {
    buffer *b = &r->answer.body, told = {.most = 1024};
    const int columns = sqlite3_column_count(rows);
    int code, count = 0;
    buffer_text(b, "{\"columns\":[");
    for (int i = 0; i < ROW_COLUMNS; i++) buffer_format(b, "%s\"%s\"", i ? "," : "", sqlite3_column_name(rows, i));
    buffer_text(b, "],\"rows\":[");
    while ((code = sqlite3_step(rows)) == SQLITE_ROW && !b->is_over) {
        for (int i = ROW_COLUMNS; i < columns && count == 0; i++) {
            buffer_format(&told, ",\"%s\":", sqlite3_column_name(rows, i));
            answer_value(&told, rows, i);
        }
        if (count == 0) answer_tell(r, rows, ROW_COLUMNS);
        buffer_text(b, count++ ? ",\n" : "\n");
        answer_row(b, rows, 0, ROW_COLUMNS);
    }
    buffer_text(b, "]");
    buffer_add(b, told.bytes, told.size);
    buffer_text(b, "}\n");
    buffer_free(&told);
    return code;
}

/* A feature a triangle, closed. The CRS is told where it is none of longitude and latitude (as GeoJSON of 2008 did,
 * and OGR still does). */
static int write_features(request *r, sqlite3_stmt *rows, int srid) {
    buffer *b = &r->answer.body;
    int code, count = 0;
    buffer_text(b, "{\"type\":\"FeatureCollection\",");
    if (srid != 4326 && srid > 0)
        buffer_format(b, "\"crs\":{\"type\":\"name\",\"properties\":{\"name\":\"urn:ogc:def:crs:EPSG::%d\"}},",
                      srid);
    buffer_text(b, "\"features\":[");
    while ((code = sqlite3_step(rows)) == SQLITE_ROW && !b->is_over) {
        if (count == 0) answer_tell(r, rows, TRIANGLE_COLUMNS);
        buffer_format(b,
                      "%s{\"type\":\"Feature\",\"id\":%lld,\"properties\":null,\"geometry\":{\"type\":\"Polygon\","
                      "\"coordinates\":[[",
                      count++ ? ",\n" : "\n", sqlite3_column_int64(rows, 0));
        for (int corner = 0; corner < 4; corner++) {
            if (corner) buffer_text(b, ",");
            answer_row(b, rows, 1 + corner % 3 * 3, 4 + corner % 3 * 3);
        }
        buffer_text(b, "]]}}");
    }
    buffer_text(b, "]}\n");
    return code;
}

static int write_bytes(request *r, sqlite3_stmt *row) {
    const int code = sqlite3_step(row);
    if (code != SQLITE_ROW) return code;
    const void *bytes = sqlite3_column_blob(row, 0);
    buffer_add(&r->answer.body, bytes, (size_t)sqlite3_column_bytes(row, 0));
    answer_tell(r, row, 1);
    return SQLITE_DONE;
}

static bool put_bytes(void *context, const void *bytes, size_t size) {
    buffer *b = context;
    buffer_add(b, bytes, size);
    return !b->is_over && !b->no_memory;
}

/* What `rqt mesh -o x.svg` draws. */
static void draw(request *r, const terrain *t, const query *q) {
    double eps = 0;
    char *sentence = NULL;
    (void)number_read(request_parameter(r, "eps"), &eps);
    const picture_request picture = {.region = q->region,
                                     .eps = &eps,
                                     .count = 1,
                                     .terrain = r->terrain,
                                     .options = q->options,
                                     .width = PICTURE_WIDTH,
                                     .svg = true};
    const int code = picture_write(database_handle(t->database), &picture, put_bytes, &r->answer.body, &sentence);
    if (code != SQLITE_OK && !r->answer.body.is_over && !r->answer.body.no_memory)
        database_failed(t->database, r, code, sentence ? sentence : sqlite3_errstr(code));
    sqlite3_free(sentence);
}

/* A mesh without rows has told nothing; as a file it does. */
static int tell_of_nothing(request *r, const terrain *t, const mesh_kind *kind, query q) {
    q.format = "obj";
    sqlite3_stmt *row = database_prepare(t->database, r, kind->bytes);
    if (!row) return SQLITE_DONE; /* why is the answer */
    query_bind(&q, row);
    const int code = sqlite3_step(row);
    if (code == SQLITE_ROW) answer_tell(r, row, 1);
    return code;
}

static void run(request *r, const terrain *t, const mesh_kind *kind, const mesh_format *f, const query *q) {
    const char *sql = f->shape == SHAPE_ROWS       ? kind->rows
                      : f->shape == SHAPE_FEATURES ? kind->triangles
                                                   : kind->bytes;
    sqlite3_stmt *statement = database_prepare(t->database, r, sql);
    if (!statement) return;
    query_bind(q, statement);
    int code = f->shape == SHAPE_ROWS       ? write_rows(r, statement)
               : f->shape == SHAPE_FEATURES ? write_features(r, statement, t->srid)
                                            : write_bytes(r, statement);
    if (code == SQLITE_DONE && f->shape != SHAPE_BYTES && !*r->answer.told[0])
        code = tell_of_nothing(r, t, kind, *q);
    if (code != SQLITE_DONE && code != SQLITE_ROW) database_failed(t->database, r, code, NULL);
}

static void answer_mesh(worker *w, request *r, const mesh_kind *kind) {
    terrain t;
    query q;
    bool by_accept;
    const mesh_format *f = choose_format(r, &by_accept);
    if (f && f->shape == SHAPE_PICTURE && kind == &VIEW) {
        answer_problem(r, MHD_HTTP_BAD_REQUEST, "a view has no format \"svg\": a range has");
        return;
    }
    if (!f || !terrain_begin(w, r, &t)) return;
    if (query_read(r, &t, &q)) {
        q.format = f->name;
        if (endpoint_represent(r, t.state, f->type, f->packed, by_accept)) {
            if (f->shape == SHAPE_PICTURE)
                draw(r, &t, &q);
            else
                run(r, &t, kind, f, &q);
        }
        query_free(&q);
    }
    terrain_end(&t);
}

void answer_range(worker *w, request *r) {
    answer_mesh(w, r, &RANGE);
}

void answer_view(worker *w, request *r) {
    answer_mesh(w, r, &VIEW);
}

void answer_delta(worker *w, request *r) {
    static const mesh_kind delta = {.bytes = "SELECT rqt_delta(:region, :eps_from, :eps_to, :terrain)"};
    static const mesh_format format = {"delta", "application/vnd.rqt.delta", SHAPE_BYTES, true};
    terrain t;
    query q;
    if (!terrain_begin(w, r, &t)) return;
    if (query_read(r, &t, &q)) {
        if (endpoint_represent(r, t.state, format.type, format.packed, false)) run(r, &t, &delta, &format, &q);
        query_free(&q);
    }
    terrain_end(&t);
}
