/* tiles.c - kinds of tiles; a connection's tiles: the terrain that is meant, and what its kind has worked out of
 * it. */
#include "kind.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

const tile_kind *const tile_kinds[] = {&quantized_mesh, &tiles_3d, &terrarium, NULL};

const tile_kind *tiles_kind(const char *name) {
    for (const tile_kind *const *kind = tile_kinds; *kind; kind++)
        if (strcmp((*kind)->name, name) == 0) return *kind;
    return NULL;
}

/* ------------------------------------------------------------------------------- what kinds have in common -- */

int tiles_fail(char **error, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    char *text = sqlite3_vmprintf(format, arguments);
    va_end(arguments);
    sqlite3_free(*error);
    *error = text;
    return text ? SQLITE_ERROR : SQLITE_NOMEM;
}

int tiles_fail_database(char **error, sqlite3 *db, int code) {
    const int failed = tiles_fail(error, "%s", sqlite3_errmsg(db));
    return failed == SQLITE_NOMEM ? failed : code;
}

#define LEAST_CELL 1e-9 /* degrees; a tenth of a millimetre */
#define MOST_RATIO 1024.0

/* What it is in, and what to do. */
static int fail_crs(const store_terrain *t, char **error) {
    const char *name = strchr(t->crs, '"'), *end = name ? strchr(name + 1, '"') : NULL;
    if (!end)
        return tiles_fail(error,
                          "terrain %s has no tiles: they are of terrains in longitude and latitude on WGS 84, and "
                          "its raster has no CRS (gdal_translate -a_srs EPSG:4326 gives it one)",
                          t->name);
    return tiles_fail(
        error,
        "terrain %s has no tiles: they are of terrains in longitude and latitude on WGS 84, and it is "
        "in %.*s (gdalwarp -t_srs EPSG:4326 makes a raster that has them)",
        t->name, (int)(end - name - 1), name + 1);
}

int tiles_check_place(const store_terrain *t, char **error) {
    const double most = 1 + 1e-9; /* a rounding */
    const geo_extent e = tiles_extent(t);
    if (!t->lonlat || !t->wgs84) return fail_crs(t, error);
    if (t->placement.dx <= 0 || t->placement.dy >= 0)
        return tiles_fail(error, "terrain %s has no tiles: its rows do not go south, or its columns not east",
                          t->name);
    /* A longitude may be told with a turn too many, and no more: doubles far out have no digits left. */
    if (fabs(e.west) > 720 || fabs(e.east) > 720)
        return tiles_fail(error, "terrain %s has no tiles: it has longitudes beyond two turns of the Earth",
                          t->name);
    /* Tiles are square: their number would go by the shorter side of cells, and not by how many samples there are.
     */
    if (fmin(e.lon_step, e.lat_step) < LEAST_CELL || e.lon_step > MOST_RATIO * e.lat_step ||
        e.lat_step > MOST_RATIO * e.lon_step)
        return tiles_fail(error, "terrain %s has no tiles: its cells are too small or too long, %g by %g degrees",
                          t->name, e.lon_step, e.lat_step);
    if (e.east - e.west > 360 * most)
        return tiles_fail(error, "terrain %s has no tiles: it goes around the Earth more than once", t->name);
    if (e.north > 90 * most || e.south < -90 * most)
        return tiles_fail(error, "terrain %s has no tiles: it has latitudes beyond a pole", t->name);
    return SQLITE_OK;
}

int tiles_check_heights(const store_terrain *t, bool *is_above_geoid, char **error) {
    *is_above_geoid = sqlite3_strlike("%EGM96%", t->vertical, 0) == 0;
    if (*is_above_geoid || !t->vertical[0] || sqlite3_strlike("%ellipsoid%", t->vertical, 0) == 0) return SQLITE_OK;
    return tiles_fail(error,
                      "terrain %s has no tiles: its heights are \"%s\", and only those above the ellipsoid and "
                      "above EGM96 can be placed in space",
                      t->name, t->vertical);
}

geo_extent tiles_extent(const store_terrain *t) {
    const rqt_placement *at = &t->placement;
    const double low = rqt_unit_metres(&t->unit, t->min_q), high = rqt_unit_metres(&t->unit, t->max_q);
    return (geo_extent){.west = at->x0,
                        .east = at->x0 + (t->lattice.width - 1) * at->dx,
                        .south = at->y0 + (t->lattice.height - 1) * at->dy,
                        .north = at->y0,
                        .lon_step = at->dx,
                        .lat_step = -at->dy,
                        .lowest = fmin(low, high),
                        .highest = fmax(low, high)};
}

char *tiles_attribution(const store_terrain *t) {
    char *text = sqlite3_mprintf("%s", t->source);
    for (char *p = text; p && *p; p++)
        if (*p == '\n') *p = p[1] ? ' ' : 0;
    return text;
}

void tiles_add_attribution(const store_terrain *t, cJSON *document) {
    char *line = tiles_attribution(t);
    sqlite3_str *text = sqlite3_str_new(NULL);
    for (const char *p = line; p && *p; p++) {
        if (strchr("<>&\"'", *p))
            sqlite3_str_appendf(text, "&#%d;", *p);
        else
            sqlite3_str_appendchar(text, 1, *p);
    }
    char *all = sqlite3_str_finish(text);
    cJSON_AddStringToObject(document, "attribution", all ? all : "");
    sqlite3_free(all);
    sqlite3_free(line);
}

void tiles_add_bounds(const store_terrain *t, double most_latitude, cJSON *document) {
    const geo_extent e = tiles_extent(t);
    const double turns = floor((e.west + 180) / 360), west = e.west - 360 * turns, east = e.east - 360 * turns;
    const bool is_across = east > 180;
    const double bounds[4] = {is_across ? -180 : west, fmin(fmax(e.south, -most_latitude), most_latitude),
                              is_across ? 180 : east, fmin(fmax(e.north, -most_latitude), most_latitude)};
    cJSON_AddItemToObject(document, "bounds", cJSON_CreateDoubleArray(bounds, 4));
}

int tiles_print(cJSON *document, tile_bytes *out) {
    char *text = cJSON_PrintUnformatted(document);
    const size_t size = text ? strlen(text) : 0;
    *out = (tile_bytes){.bytes = text ? sqlite3_malloc64(size + 1) : NULL};
    if (text && out->bytes) {
        memcpy(out->bytes, text, size);
        out->bytes[size] = '\n';
        out->size = size + 1;
    }
    cJSON_free(text);
    cJSON_Delete(document);
    return out->bytes ? SQLITE_OK : SQLITE_NOMEM;
}

int tiles_region(const tiles *t, const double (*boxes)[4], int count, rqt_region **region) {
    const rqt_placement as_it_is = {0, 0, 1, 1};
    sqlite3_str *text = sqlite3_str_new(NULL);
    for (int i = 0; i < count; i++) {
        char ring[256];
        const double x0 = boxes[i][0], x1 = boxes[i][1], y0 = boxes[i][2], y1 = boxes[i][3];
        snprintf(ring, sizeof ring, "((%.17g %.17g,%.17g %.17g,%.17g %.17g,%.17g %.17g,%.17g %.17g))", x0, y0, x1,
                 y0, x1, y1, x0, y1, x0, y0);
        sqlite3_str_appendf(text, "%s%s", i ? "," : "MULTIPOLYGON(", ring);
    }
    sqlite3_str_appendall(text, ")");
    const int size = sqlite3_str_length(text);
    char *wkt = sqlite3_str_finish(text);
    rqt_geometry *geometry = NULL;
    rqt_message why;
    rqt_status status =
        wkt ? rqt_geometry_parse(wkt, (size_t)size, true, store_allocator(), &geometry, &why) : RQT_NO_MEMORY;
    if (status == RQT_OK)
        status = rqt_region_create(geometry, &as_it_is, &t->terrain->lattice, store_allocator(), region);
    rqt_geometry_free(geometry);
    sqlite3_free(wkt);
    return status == RQT_OK ? SQLITE_OK : SQLITE_NOMEM;
}

int tiles_has_triangle(tiles *t, const int32_t box[4], double eps, const store_query_options *options,
                       rqt_block_number *last, bool *is_there, char **error) {
    const rqt_vertex from = {box[0], box[2]},
                     to = rqt_vertex_clamp(&t->terrain->lattice, (rqt_vertex){box[1], box[3]});
    const int64_t unit = INT64_C(1) << 20, x[2] = {from.x * unit, to.x * unit}, y[2] = {from.y * unit, to.y * unit};
    uint8_t mark = 0; /* of this call alone: none is interrupted after it has marked its only cell */
    rqt_cells cell = {x, y, 1, 1, &mark};
    const bool has_area = from.x < to.x && from.y < to.y;
    const int code = has_area ? store_mark(t->store, t->terrain, eps, options, &cell, last, error) : SQLITE_OK;
    *is_there = mark;
    return code;
}

int tiles_add_range(range_list *list, tile_range range) {
    if (list->count == list->capacity) {
        const size_t capacity = list->capacity ? 2 * list->capacity : 16;
        tile_range *items = sqlite3_realloc64(list->items, capacity * sizeof *items);
        if (!items) return SQLITE_NOMEM;
        list->items = items;
        list->capacity = capacity;
    }
    list->items[list->count++] = range;
    return SQLITE_OK;
}

/* -------------------------------------------------------------------------------------------- a connection -- */

int tiles_open(sqlite3 *db, tiles **out) {
    tiles *t = sqlite3_malloc(sizeof *t);
    *out = NULL;
    if (!t) return SQLITE_NOMEM;
    *t = (tiles){.db = db};
    const int code = store_open(db, &t->store);
    if (code == SQLITE_OK)
        *out = t;
    else
        sqlite3_free(t);
    return code;
}

static void forget(kept_plan *kept) {
    if (kept->plan) kept->kind->functions->plan_free(kept->plan);
    *kept = (kept_plan){0};
}

void tiles_close(tiles *t) {
    if (!t) return;
    for (int i = 0; i < KEPT_PLANS; i++) forget(&t->kept[i]);
    store_close(t->store);
    sqlite3_free(t);
}

void tiles_limit(tiles *t, int64_t triangles) {
    store_limits_of(t->store)->triangles = triangles;
}

/* Where the plan of this terrain as it is now is kept; if there is none, the place of the oldest. */
static kept_plan *find_place(tiles *t) {
    const uint64_t state = store_state(t->store);
    for (int i = 0; i < KEPT_PLANS; i++) {
        kept_plan *kept = &t->kept[i];
        if (kept->kind == t->kind && state && kept->state == state && !strcmp(kept->name, t->terrain->name))
            return kept;
    }
    kept_plan *now = &t->kept[t->next];
    forget(now);
    *now = (kept_plan){.kind = t->kind, .state = state};
    snprintf(now->name, sizeof now->name, "%s", t->terrain->name);
    t->next = (t->next + 1) % KEPT_PLANS;
    return now;
}

static int find_plan(tiles *t, char **error) {
    kept_plan *kept = find_place(t);
    int code = SQLITE_OK;
    if (!kept->is_whole) code = t->kind->functions->plan_create(t, &kept->plan, error);
    kept->is_whole = code == SQLITE_OK;
    t->is_kept = kept->state != 0;
    if (kept->is_whole)
        t->plan = kept->plan;
    else if (kept->plan)
        t->goes_on = true;
    else
        forget(kept);
    return code;
}

int tiles_begin(tiles *t, const tile_kind *kind, const char *terrain, char **error) {
    int code = store_begin(t->store, error);
    if (code != SQLITE_OK) return code;
    t->kind = kind;
    t->last = TILES_LEVELS;
    t->goes_on = false;
    code = store_find(t->store, terrain, &t->terrain, error);
    if (code == SQLITE_OK) code = find_plan(t, error);
    if (code != SQLITE_OK) tiles_end(t);
    return code;
}

void tiles_end(tiles *t) {
    t->kind = NULL;
    t->terrain = NULL;
    t->plan = NULL;
    store_end(t->store);
}

void tiles_tell(tiles *t, int last) {
    t->last = last;
}

bool tiles_goes_on(const tiles *t) {
    return t->goes_on && t->is_kept;
}

int tiles_finest(const tiles *t) {
    return t->kind->functions->finest(t);
}

int tiles_available(tiles *t, int series, int z, const tile_range **ranges, size_t *count, char **error) {
    *ranges = NULL;
    *count = 0;
    t->goes_on = false;
    if (z < 0 || z > tiles_finest(t)) return SQLITE_OK;
    return t->kind->functions->available(t, series, z, ranges, count, error);
}

int tiles_document(tiles *t, const char *root, int first, int last, tile_bytes *out, char **error) {
    const int finest = tiles_finest(t);
    *out = (tile_bytes){0};
    t->goes_on = false;
    return t->kind->functions->document(t, root, first, last > finest ? finest : last, out, error);
}

int tiles_make(tiles *t, int series, int z, int32_t x, int32_t y, tile_bytes *out, char **error) {
    *out = (tile_bytes){0};
    t->goes_on = false;
    if (z < 0 || z > tiles_finest(t) || x < 0 || y < 0) return SQLITE_OK;
    return t->kind->functions->make(t, series, z, x, y, out, error);
}
