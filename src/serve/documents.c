/* documents.c - what there is: the landing page, conformance, collections, one collection, in the forms of OGC API
 * - Common. A terrain is a collection.
 */
#include "internal.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const char JSON[] = "application/json";
static const char CRS84[] = "http://www.opengis.net/def/crs/OGC/1.3/CRS84";

/* What a document is known by that no database has a part in. */
enum { STATE_OF_PROGRAM = 1 };

static void add_link(cJSON *links, const char *rel, const char *type, const char *title, const char *format, ...)
    __attribute__((format(printf, 5, 6)));
static void add_link(cJSON *links, const char *rel, const char *type, const char *title, const char *format, ...) {
    char href[256];
    va_list list;
    va_start(list, format);
    vsnprintf(href, sizeof href, format, list);
    va_end(list);
    cJSON *link = cJSON_CreateObject();
    cJSON_AddStringToObject(link, "href", href);
    cJSON_AddStringToObject(link, "rel", rel);
    cJSON_AddStringToObject(link, "type", type);
    cJSON_AddStringToObject(link, "title", title);
    cJSON_AddItemToArray(links, link);
}

void answer_landing(worker *w, request *r) {
    static const char *const types[] = {"application/json", "text/html"};
    const char *f = request_parameter(r, "f");
    (void)w;
    const int which = !f                   ? negotiate_type(r->accept, types, 2)
                      : !strcmp(f, "json") ? 0
                      : !strcmp(f, "html") ? 1
                                           : 2;
    if (which < 0 || which > 1) {
        if (f)
            answer_problem(r, MHD_HTTP_BAD_REQUEST, "the parameter f is json or html here");
        else
            answer_problem(r, MHD_HTTP_NOT_ACCEPTABLE, "the landing page is application/json or text/html");
        return;
    }
    if (which == 1) {
        page_answer(r, "index.html");
        if (!f) r->answer.varies = "Accept, Accept-Encoding";
        return;
    }
    if (!endpoint_represent(r, STATE_OF_PROGRAM, JSON, false, !f)) return;
    cJSON *page = cJSON_CreateObject();
    cJSON_AddStringToObject(page, "title", "rqt");
    cJSON_AddStringToObject(page, "description",
                            "Terrain: meshes of a region or a view with a proven error, heights, profiles.");
    cJSON *links = cJSON_AddArrayToObject(page, "links");
    add_link(links, "self", JSON, "this document", "/?f=json");
    add_link(links, "alternate", "text/html", "the viewer", "/?f=html");
    add_link(links, "related", "text/html", "terrain on Cesium's globe", "/cesium");
    add_link(links, "service-desc", "application/vnd.oai.openapi+json;version=3.0", "the API", "/openapi.json");
    add_link(links, "conformance", JSON, "what the API conforms to", "/conformance");
    add_link(links, "data", JSON, "the terrains", "/collections");
    answer_json(r, JSON, page);
}

void answer_conformance(worker *w, request *r) {
    static const char *const classes[] = {"http://www.opengis.net/spec/ogcapi-common-1/1.0/conf/core",
                                          "http://www.opengis.net/spec/ogcapi-common-1/1.0/conf/json",
                                          "http://www.opengis.net/spec/ogcapi-common-1/1.0/conf/oas30",
                                          "http://www.opengis.net/spec/ogcapi-common-2/1.0/conf/collections"};
    (void)w;
    if (!endpoint_represent(r, STATE_OF_PROGRAM, JSON, false, false)) return;
    cJSON *page = cJSON_CreateObject();
    cJSON_AddItemToObject(page, "conformsTo", cJSON_CreateStringArray(classes, sizeof classes / sizeof *classes));
    answer_json(r, JSON, page);
}

/* ----------------------------------------------------------------------------------------------- collections -- */

/* In the order of `columns` below. */
enum { NAME, SRID, WIDTH, HEIGHT, X0, Y0, DX, DY, LONLAT, INVERSE_FLATTENING };
#define WGS84 298.257223563
#define COLUMNS                                                                                             \
    "name, srid, width, height, x0, y0, dx, dy, lonlat, inverse_flattening, cell_x, cell_y, min_z, max_z, " \
    "quantum, quantum_error, voids, "                                                                       \
    "blocks, bytes, max_error, k, crs, crs_name, metre, semi_major, vertical, created"

static void add_column(cJSON *object, sqlite3_stmt *row, int i) {
    const char *name = sqlite3_column_name(row, i);
    const int type = sqlite3_column_type(row, i);
    if (type == SQLITE_TEXT)
        cJSON_AddStringToObject(object, name, (const char *)sqlite3_column_text(row, i));
    else if (type != SQLITE_NULL)
        cJSON_AddNumberToObject(object, name, sqlite3_column_double(row, i));
}

static void add_extent(cJSON *collection, sqlite3_stmt *row) {
    const double x0 = sqlite3_column_double(row, X0), y0 = sqlite3_column_double(row, Y0);
    const double x1 = x0 + (sqlite3_column_int(row, WIDTH) - 1) * sqlite3_column_double(row, DX);
    const double y1 = y0 + (sqlite3_column_int(row, HEIGHT) - 1) * sqlite3_column_double(row, DY);
    const double box[4] = {fmin(x0, x1), fmin(y0, y1), fmax(x0, x1), fmax(y0, y1)};
    const int srid = sqlite3_column_int(row, SRID);
    char crs[80];
    snprintf(crs, sizeof crs, "http://www.opengis.net/def/crs/EPSG/0/%d", srid);
    cJSON *spatial = cJSON_AddObjectToObject(cJSON_AddObjectToObject(collection, "extent"), "spatial");
    cJSON_AddItemToArray(cJSON_AddArrayToObject(spatial, "bbox"), cJSON_CreateDoubleArray(box, 4));
    if (srid == 4326)
        cJSON_AddStringToObject(spatial, "crs", CRS84);
    else if (srid > 0)
        cJSON_AddStringToObject(spatial, "crs", crs);
}

/* Of terrains in longitude and latitude on WGS 84; which of them have no tiles all the same the tiles say. */
static void add_tiles(cJSON *links, sqlite3_stmt *row, const char *name) {
    if (!sqlite3_column_int(row, LONLAT) || fabs(sqlite3_column_double(row, INVERSE_FLATTENING) - WGS84) > 1e-8)
        return;
    for (const tile_kind *const *kind = tile_kinds; *kind; kind++) {
        char title[64];
        snprintf(title, sizeof title, "tiles for globes and maps: %s", (*kind)->name);
        add_link(links, "related", JSON, title, "/collections/%s/tiles/%s/%s", name, (*kind)->name,
                 (*kind)->document);
    }
}

static cJSON *collection_of(sqlite3_stmt *row) {
    const char *name = (const char *)sqlite3_column_text(row, NAME);
    cJSON *c = cJSON_CreateObject();
    cJSON_AddStringToObject(c, "id", name);
    cJSON_AddStringToObject(c, "title", name);
    add_extent(c, row);
    cJSON *told = cJSON_AddObjectToObject(c, "terrain");
    for (int i = SRID; i < sqlite3_column_count(row); i++) add_column(told, row, i);
    cJSON *links = cJSON_AddArrayToObject(c, "links");
    add_link(links, "self", JSON, "this terrain", "/collections/%s", name);
    add_link(links, "items", JSON, "mesh of a region; eps, bbox, wkt, f", "/collections/%s/range", name);
    static const struct {
        const char *path, *title;
    } others[] = {{"view", "mesh of a view; camera, f"},
                  {"delta", "what makes a mesh finer; eps_from, eps_to, bbox, wkt"},
                  {"height", "height at a place; x, y, eps"},
                  {"profile", "heights along a line; line, eps"},
                  {"verify", "proof of a mesh; eps, bbox, wkt"},
                  {"explain", "what a query reads; eps, bbox, wkt"},
                  {"area", "areas and volume; eps, bbox, wkt"}};
    for (size_t i = 0; i < sizeof others / sizeof *others; i++)
        add_link(links, "related", JSON, others[i].title, "/collections/%s/%s", name, others[i].path);
    add_tiles(links, row, name);
    return c;
}

void answer_collection(worker *w, request *r) {
    terrain t;
    if (!terrain_begin(w, r, &t)) return;
    sqlite3_stmt *row = database_prepare(
        t.database, r, "SELECT " COLUMNS " FROM rqt_terrains WHERE name = ?1 AND +schema = 'main'");
    if (row && endpoint_represent(r, t.state, JSON, false, false)) {
        sqlite3_bind_text(row, 1, r->terrain, -1, SQLITE_STATIC);
        const int code = sqlite3_step(row);
        if (code == SQLITE_ROW)
            answer_json(r, JSON, collection_of(row));
        else
            database_failed(t.database, r, code, NULL);
    }
    terrain_end(&t);
}

static bool holds(const cJSON *collections, const char *name) {
    const cJSON *c;
    cJSON_ArrayForEach(c, collections) {
        const char *id = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(c, "id"));
        if (id && strcmp(id, name) == 0) return true;
    }
    return false;
}

/* The terrains of a database that can be asked for and are not there yet: of a name that two databases have, the
 * first one's is meant. False: why is the answer. */
static bool add_terrains(database *d, request *r, cJSON *collections) {
    sqlite3_stmt *rows = database_prepare(
        d, r, "SELECT " COLUMNS " FROM rqt_terrains WHERE +schema = 'main' AND complete ORDER BY name");
    if (!rows) return false;
    int code;
    while ((code = sqlite3_step(rows)) == SQLITE_ROW) {
        /* A database may have a view of this name, with whatever in it. */
        const char *name = (const char *)sqlite3_column_text(rows, NAME);
        if (name && !holds(collections, name)) cJSON_AddItemToArray(collections, collection_of(rows));
    }
    if (code == SQLITE_DONE) return true;
    database_failed(d, r, code, NULL);
    return false;
}

/* What is wrong with a database, instead of its terrains. */
static void add_problem(const database *d, request *r, cJSON *problems) {
    buffer *b = &r->answer.body;
    cJSON *told = b->bytes ? cJSON_ParseWithLength(b->bytes, b->size) : NULL;
    cJSON *problem = cJSON_CreateObject();
    cJSON_AddStringToObject(problem, "database", database_label(d));
    cJSON_AddItemToObject(problem, "detail", cJSON_DetachItemFromObject(told, "detail"));
    cJSON_AddItemToArray(problems, problem);
    cJSON_Delete(told);
}

/* One database that cannot be asked does not hide the others; all of them do. */
void answer_collections(worker *w, request *r) {
    cJSON *page = cJSON_CreateObject(), *links = cJSON_AddArrayToObject(page, "links"),
          *collections = cJSON_AddArrayToObject(page, "collections"), *problems = cJSON_CreateArray();
    uint64_t state = STATE_OF_PROGRAM;
    add_link(links, "self", JSON, "this document", "/collections");
    for (int i = 0; i < w->database_count; i++) {
        database *d = databases_at(w->databases, i);
        uint64_t one = 0;
        const bool ok = database_begin(d, r, &one) && add_terrains(d, r, collections);
        if (!ok) add_problem(d, r, problems);
        state = ok && one && state ? (state ^ one) * 0x100000001B3u : 0;
        database_end(d);
    }
    const int failed = cJSON_GetArraySize(problems);
    if (failed) cJSON_AddItemReferenceToObject(page, "problems", problems);
    if (failed < w->database_count) {
        answer_clear(r);
        if (endpoint_represent(r, state, JSON, false, false)) {
            answer_json(r, JSON, page);
            page = NULL;
        }
    }
    cJSON_Delete(page);
    cJSON_Delete(problems);
}
