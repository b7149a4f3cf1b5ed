/* layer.c - which tiles there are, and what clients are told of them: layer.json.
 *
 * A tile is there iff a triangle of the level's mesh has inner points in it. Where no sample is void the mesh is
 * the raster's rectangle, so the tiles that overlap it are those. Elsewhere each of them is asked, by a query that
 * stops at the first block with a triangle.
 *
 * The two tiles of level 0 are always there, without a triangle where they have no terrain: Cesium begins with
 * both, and draws nothing below one that it does not get. Cesium also wants to be told which tiles there are by
 * tiles that have the metadata extension, and reads none of them unless layer.json has "metadataAvailability": that
 * after so many levels a tile tells of those below it. Here that is one more than there are, so that it is the
 * tiles of level 0 that do, of all levels (encode.c). Clients that go by "available" find the same there.
 */
#include "internal.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <string.h>

typedef struct range_list {
    tile_range *items;
    size_t count, capacity, row; /* row: where those that ended with the row before begin */
} range_list;

static int add_range(range_list *list, tile_range range) {
    for (size_t i = list->row; i < list->count; i++) {
        tile_range *r = &list->items[i];
        if (r->y1 != range.y0 - 1 || r->x0 != range.x0 || r->x1 != range.x1) continue;
        r->y1 = range.y1;
        return SQLITE_OK;
    }
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

/* Has the tile a triangle? */
static int probe(tiles *t, int z, int32_t x, int32_t y, bool *is_there, char **error) {
    store_limits *limits = store_limits_of(t->store);
    const int64_t before = limits->triangles;
    const store_query_options options = plan_options(t);
    rqt_region *region = NULL;
    rqt_patch patch = {0};
    tile_place place;
    *is_there = false;
    if (!plan_place(t, z, x, y, &place) || place.turns == 0) return SQLITE_OK;
    int code = plan_region(t, &place, &region);
    if (code == SQLITE_OK) {
        limits->triangles = 1; /* more is not looked for */
        code = store_query(t->store, t->terrain, region, plan_of(t)->level[z].eps, &options, &patch, NULL, error);
        limits->triangles = before;
        *is_there = code == SQLITE_TOOBIG || patch.triangle_count > 0;
    }
    if (code == SQLITE_TOOBIG) {
        sqlite3_free(*error);
        *error = NULL;
        code = SQLITE_OK;
    }
    store_keep(t->store, &patch);
    rqt_region_free(region);
    return code;
}

/* The tiles of a row from x0 to x1 that are there. */
static int add_row(tiles *t, int z, int32_t y, int32_t x0, int32_t x1, range_list *list, char **error) {
    int32_t first = -1;
    for (int32_t x = x0; x <= x1 + 1; x++) {
        bool is_there = x <= x1;
        int code = is_there ? probe(t, z, x, y, &is_there, error) : SQLITE_OK;
        if (code == SQLITE_OK && !is_there && first >= 0) {
            code = add_range(list, (tile_range){first, x - 1, y, y});
            first = -1;
        }
        if (code != SQLITE_OK) return code;
        if (is_there && first < 0) first = x;
    }
    return SQLITE_OK;
}

int layer_available(tiles *t, int z, const tile_range **ranges, size_t *count, char **error) {
    tile_plan *plan = t->plan;
    tile_range all[MOST_TURNS];
    range_list list = {0};
    *ranges = NULL;
    *count = 0;
    if (z < 0 || z > plan->finest) return SQLITE_OK;
    int code = SQLITE_OK;
    if (!plan->ranges[z]) {
        const int n = z > 0 ? plan_ranges(t, z, all) : 0;
        list.items = sqlite3_malloc(MOST_TURNS * sizeof *list.items);
        list.capacity = list.items ? MOST_TURNS : 0;
        if (!list.items) return SQLITE_NOMEM;
        for (int i = 0; i < n && t->terrain->voids == 0 && code == SQLITE_OK; i++) code = add_range(&list, all[i]);
        for (int32_t y = n ? all[0].y0 : 0; n && y <= all[0].y1 && t->terrain->voids && code == SQLITE_OK; y++) {
            const size_t row = list.count;
            for (int i = 0; i < n && code == SQLITE_OK; i++)
                code = add_row(t, z, y, all[i].x0, all[i].x1, &list, error);
            while (list.row < row && list.items[list.row].y1 < y) list.row++;
        }
        if (z == 0) code = add_range(&list, (tile_range){0, 1, 0, 0});
        if (code != SQLITE_OK) {
            sqlite3_free(list.items);
            return code;
        }
        plan->ranges[z] = list.items;
        plan->range_count[z] = list.count;
    }
    *ranges = plan->ranges[z];
    *count = plan->range_count[z];
    return SQLITE_OK;
}

/* ---------------------------------------------------------------------------------------------- layer.json -- */

/* The ranges as far as they are in columns x0..x1. */
static void add_ranges(const tile_range *ranges, size_t count, int32_t x0, int32_t x1, cJSON *list) {
    for (size_t i = 0; i < count; i++) {
        if (ranges[i].x1 < x0 || ranges[i].x0 > x1) continue;
        cJSON *range = cJSON_CreateObject();
        cJSON_AddNumberToObject(range, "startX", ranges[i].x0 > x0 ? ranges[i].x0 : x0);
        cJSON_AddNumberToObject(range, "startY", ranges[i].y0);
        cJSON_AddNumberToObject(range, "endX", ranges[i].x1 < x1 ? ranges[i].x1 : x1);
        cJSON_AddNumberToObject(range, "endY", ranges[i].y1);
        cJSON_AddItemToArray(list, range);
    }
}

static int add_available(tiles *t, int first, int last, cJSON *layer, char **error) {
    cJSON *levels = cJSON_AddArrayToObject(layer, "available");
    for (int z = 0; z <= last; z++) {
        const tile_range *ranges = NULL;
        size_t count = 0;
        const int code = z < first ? SQLITE_OK : layer_available(t, z, &ranges, &count, error);
        if (code != SQLITE_OK) return code;
        cJSON *list = cJSON_CreateArray();
        add_ranges(ranges, count, 0, (2 << z) - 1, list);
        cJSON_AddItemToArray(levels, list);
    }
    return SQLITE_OK;
}

int layer_below(tiles *t, int32_t x, char **text, char **error) {
    const int last = t->last < plan_of(t)->finest ? t->last : plan_of(t)->finest;
    cJSON *levels = cJSON_CreateArray();
    int code = SQLITE_OK;
    for (int z = 1; z <= last && code == SQLITE_OK; z++) {
        const tile_range *ranges = NULL;
        size_t count = 0;
        code = layer_available(t, z, &ranges, &count, error);
        cJSON *list = cJSON_CreateArray();
        add_ranges(ranges, count, x << z, ((x + 1) << z) - 1, list);
        cJSON_AddItemToArray(levels, list);
    }
    char *printed = code == SQLITE_OK ? cJSON_PrintUnformatted(levels) : NULL;
    *text = printed ? sqlite3_mprintf("%s", printed) : NULL;
    cJSON_free(printed);
    cJSON_Delete(levels);
    return code != SQLITE_OK ? code : *text ? SQLITE_OK : SQLITE_NOMEM;
}

/* Longitudes of -180..180. Across the antimeridian it is all of them: clients know no other way to say it. */
static void add_bounds(const store_terrain *t, cJSON *layer) {
    const rqt_placement *at = &t->placement;
    const double width = (t->lattice.width - 1) * at->dx, turns = floor((at->x0 + 180) / 360);
    const double west = at->x0 - 360 * turns, east = west + width;
    const bool is_across = east > 180;
    const double bounds[4] = {is_across ? -180 : west, at->y0 + (t->lattice.height - 1) * at->dy,
                              is_across ? 180 : east, at->y0};
    cJSON_AddItemToObject(layer, "bounds", cJSON_CreateDoubleArray(bounds, 4));
}

/* Where the terrain came from, in one line. */
static void add_attribution(const store_terrain *t, cJSON *layer) {
    char *text = sqlite3_mprintf("%s", t->source);
    for (char *p = text; p && *p; p++)
        if (*p == '\n') *p = p[1] ? ' ' : 0;
    cJSON_AddStringToObject(layer, "attribution", text ? text : "");
    sqlite3_free(text);
}

static cJSON *describe(const tiles *t, int first, int last) {
    const char *const templates[] = {"{z}/{x}/{y}.terrain"}, *const extensions[] = {"octvertexnormals", "metadata",
                                                                                    "watermask"};
    double eps[TILES_LEVELS], errors[TILES_LEVELS];
    cJSON *layer = cJSON_CreateObject();
    cJSON_AddStringToObject(layer, "tilejson", "2.1.0");
    cJSON_AddStringToObject(layer, "name", t->terrain->name);
    cJSON_AddStringToObject(layer, "version", "1.0.0");
    cJSON_AddStringToObject(layer, "format", "quantized-mesh-1.0");
    cJSON_AddStringToObject(layer, "scheme", "tms");
    cJSON_AddStringToObject(layer, "projection", "EPSG:4326");
    cJSON_AddItemToObject(layer, "tiles", cJSON_CreateStringArray(templates, 1));
    cJSON_AddItemToObject(layer, "extensions", cJSON_CreateStringArray(extensions, plan_of(t)->has_sea ? 3 : 2));
    cJSON_AddNumberToObject(layer, "minzoom", first);
    cJSON_AddNumberToObject(layer, "maxzoom", last);
    if (first == 0) cJSON_AddNumberToObject(layer, "metadataAvailability", last + 1);
    add_bounds(t->terrain, layer);
    add_attribution(t->terrain, layer);
    /* For people: what clients take each level to be off, and the part that the mesh has of it. */
    for (int z = 0; z <= last; z++) {
        errors[z] = plan_of(t)->level[z].geometric_error;
        eps[z] = plan_of(t)->level[z].eps;
    }
    cJSON_AddItemToObject(layer, "geometricErrors", cJSON_CreateDoubleArray(errors, last + 1));
    cJSON_AddItemToObject(layer, "eps", cJSON_CreateDoubleArray(eps, last + 1));
    return layer;
}

int layer_make(tiles *t, int first, int last, tile_bytes *out, char **error) {
    cJSON *layer = describe(t, first, last);
    const int code = add_available(t, first, last, layer, error);
    if (code == SQLITE_OK) return tiles_print(layer, out);
    cJSON_Delete(layer);
    return code;
}
