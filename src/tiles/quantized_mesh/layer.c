/* layer.c - which tiles there are, and what clients are told of them: layer.json.
 *
 * A tile is there iff a triangle of the level's mesh has inner points in it. Where no sample is void the mesh is
 * the raster's rectangle, so the tiles that overlap it are those. Elsewhere squares of tiles are asked: where all
 * blocks that answer have no void, or nothing else, that holds for all of their tiles (store_covers). Other squares
 * are quartered, and a tile that is left is asked by a query that stops at the first block with a triangle. So it
 * takes as many queries as there are tiles near the outlines of voids.
 *
 * The two tiles of level 0 are always there, with specks alone where they have no terrain: Cesium begins with
 * both, and draws nothing below one that it does not get. Cesium also wants to be told which tiles there are by
 * tiles that have the metadata extension, and reads none of them unless layer.json has "metadataAvailability": that
 * after so many levels a tile tells of those below it. Here that is one more than there are, so that it is the
 * tiles of level 0 that do, of all levels (encode.c). Clients that go by "available" find the same there.
 */
#include "quantized_mesh.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <string.h>

/* Ranges of a level, from the south on. */
typedef struct row_list {
    range_list all;
    size_t row; /* where those that ended with the row before begin */
} row_list;

/* One range with that of the row before, if that has the same columns. */
static int add_range(row_list *list, tile_range range) {
    for (size_t i = list->row; i < list->all.count; i++) {
        tile_range *r = &list->all.items[i];
        if (r->y1 != range.y0 - 1 || r->x0 != range.x0 || r->x1 != range.x1) continue;
        r->y1 = range.y1;
        return SQLITE_OK;
    }
    return tiles_add_range(&list->all, range);
}

/* Has the tile a triangle? */
static int probe(tiles *t, int z, int32_t x, int32_t y, bool *is_there, char **error) {
    const store_query_options options = plan_options(t, z);
    rqt_region *region = NULL;
    tile_place place;
    *is_there = false;
    if (!plan_place(t, z, x, y, &place) || place.turns == 0) return SQLITE_OK;
    int code = plan_region(t, &place, &region);
    if (code == SQLITE_OK)
        code = tiles_has_triangle(t, region, plan_of(t)->level[z].eps, &options, is_there, error);
    rqt_region_free(region);
    return code;
}

/* How much of the tiles has triangles: all, nothing, or who knows. */
static int find_cover(tiles *t, int z, const tile_range *r, store_cover *cover, char **error) {
    const rqt_lattice *lattice = &t->terrain->lattice;
    const store_query_options options = plan_options(t, z);
    tile_place first, last; /* south-west, north-east */
    *cover = STORE_COVER_UNKNOWN;
    if (!plan_place(t, z, r->x0, r->y0, &first) || !plan_place(t, z, r->x1, r->y1, &last)) return SQLITE_OK;
    const tile_turn *a = &first.turn[0], *b = &last.turn[0];
    if (first.turns != 1 || last.turns != 1 || a->box[0] > b->box[0]) return SQLITE_OK; /* not of one turn */
    const int32_t box[4] = {(int32_t)fmax(0, floor(a->cut[0])), (int32_t)fmin(lattice->width - 1, ceil(b->cut[1])),
                            (int32_t)fmax(0, floor(b->cut[2])),
                            (int32_t)fmin(lattice->height - 1, ceil(a->cut[3]))};
    return store_covers(t->store, t->terrain, box, plan_of(t)->level[z].eps, &options, cover, error);
}

/* Rows of tiles, as many as a square is high, from x0, y0 on. */
enum { SQUARE = 16 };
typedef struct band {
    int32_t x0, y0;
    size_t width;
    bool *is_there;
} band;

static int ask_square(tiles *t, int z, const tile_range *r, band *b, char **error) {
    store_cover cover;
    bool is_there;
    int code = find_cover(t, z, r, &cover, error);
    if (code != SQLITE_OK) return code;
    if (cover == STORE_COVER_UNKNOWN && (r->x0 < r->x1 || r->y0 < r->y1)) {
        const int32_t x = r->x0 + (r->x1 - r->x0) / 2, y = r->y0 + (r->y1 - r->y0) / 2;
        const tile_range quarter[4] = {
            {r->x0, x, r->y0, y}, {x + 1, r->x1, r->y0, y}, {r->x0, x, y + 1, r->y1}, {x + 1, r->x1, y + 1, r->y1}};
        for (int i = 0; i < 4 && code == SQLITE_OK; i++)
            if (quarter[i].x0 <= quarter[i].x1 && quarter[i].y0 <= quarter[i].y1)
                code = ask_square(t, z, &quarter[i], b, error);
        return code;
    }
    is_there = cover == STORE_COVER_ALL;
    if (cover == STORE_COVER_UNKNOWN) code = probe(t, z, r->x0, r->y0, &is_there, error);
    for (int32_t y = r->y0; y <= r->y1; y++)
        for (int32_t x = r->x0; x <= r->x1; x++)
            b->is_there[(size_t)(y - b->y0) * b->width + (size_t)(x - b->x0)] = is_there;
    return code;
}

static int add_row(const band *b, int32_t y, row_list *list) {
    const bool *row = b->is_there + (size_t)(y - b->y0) * b->width;
    int code = SQLITE_OK;
    for (size_t i = 0, end; i < b->width && code == SQLITE_OK; i = end) {
        for (end = i + 1; end < b->width && row[end] == row[i];) end++;
        if (row[i]) code = add_range(list, (tile_range){b->x0 + (int32_t)i, b->x0 + (int32_t)end - 1, y, y});
    }
    return code;
}

/* The tiles of rows that are there, of the ranges that overlap the raster. */
static int add_band(tiles *t, int z, const tile_range *all, int n, int32_t y0, int32_t y1, row_list *list,
                    char **error) {
    band bands[MOST_TURNS] = {{0}};
    int code = SQLITE_OK;
    for (int i = 0; i < n && code == SQLITE_OK; i++) {
        const tile_range *r = &all[i];
        bands[i] = (band){r->x0, y0, (size_t)(r->x1 - r->x0) + 1, NULL};
        bands[i].is_there = sqlite3_malloc64(bands[i].width * SQUARE);
        if (!bands[i].is_there) code = SQLITE_NOMEM;
        for (int32_t x = r->x0; x <= r->x1 && code == SQLITE_OK; x += SQUARE) {
            const tile_range square = {x, r->x1 - x < SQUARE ? r->x1 : x + SQUARE - 1, y0, y1};
            code = ask_square(t, z, &square, &bands[i], error);
        }
    }
    for (int32_t y = y0; y <= y1 && code == SQLITE_OK; y++) {
        const size_t before = list->all.count;
        for (int i = 0; i < n && code == SQLITE_OK; i++) code = add_row(&bands[i], y, list);
        while (list->row < before && list->all.items[list->row].y1 < y) list->row++;
    }
    for (int i = 0; i < n; i++) sqlite3_free(bands[i].is_there);
    return code;
}

int layer_available(tiles *t, int z, const tile_range **ranges, size_t *count, char **error) {
    tile_plan *plan = t->plan;
    tile_range all[MOST_TURNS];
    row_list list = {0};
    *ranges = NULL;
    *count = 0;
    if (z < 0 || z > plan->finest) return SQLITE_OK;
    int code = SQLITE_OK;
    if (!plan->ranges[z]) {
        const int n = z > 0 ? plan_ranges(t, z, all) : 0;
        code = tiles_add_range(&list.all, (tile_range){0}); /* so that there is memory even for none */
        list.all.count = 0;
        for (int i = 0; i < n && t->terrain->voids == 0 && code == SQLITE_OK; i++) code = add_range(&list, all[i]);
        const int32_t y1 = n ? all[0].y1 : -1; /* all ranges have the same rows */
        for (int32_t y = n ? all[0].y0 : 0; y <= y1 && t->terrain->voids && code == SQLITE_OK; y += SQUARE)
            code = add_band(t, z, all, n, y, y1 - y < SQUARE ? y1 : y + SQUARE - 1, &list, error);
        if (z == 0 && code == SQLITE_OK) code = add_range(&list, (tile_range){0, 1, 0, 0});
        if (code != SQLITE_OK) {
            sqlite3_free(list.all.items);
            return code;
        }
        plan->ranges[z] = list.all.items;
        plan->range_count[z] = list.all.count;
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
    tiles_add_bounds(t->terrain, 90, layer);
    tiles_add_attribution(t->terrain, layer);
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
