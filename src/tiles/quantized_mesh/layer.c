/* layer.c - which tiles there are, and what clients are told of them: layer.json.
 *
 * A tile is there iff a triangle of the level's mesh has inner points in it. Where no sample is void the mesh is
 * the raster's rectangle, so the tiles that overlap it are those. Elsewhere the blocks that answer mark the tiles
 * in which they have a triangle (store_mark), square of tiles by square, in bands from the south on. Each block of
 * a square is read once for all of its tiles, and not at all when they are marked already or when it has no voids,
 * or nothing else.
 *
 * That may take longer than who asks has time. So it stops at any block, and what is found stays in the plan: the
 * bands that are done as ranges, the rest as marks. Who asks again goes on from there.
 *
 * The two tiles of level 0 are always there, with specks alone where they have no terrain: Cesium begins with
 * both, and draws nothing below one that it does not get. Cesium also wants to be told which tiles there are by
 * tiles that have the metadata extension, and reads none of them unless layer.json has "metadataAvailability": that
 * after so many levels a tile tells of those below it. Here that is one more than there are, so that it is the
 * tiles of level 0 that do, of all levels (encode.c). Clients that go by "available" find the same there.
 */
#include "quantized_mesh.h"

#include <cjson/cJSON.h>
#include <string.h>

enum { SQUARE = 16 }; /* tiles a side */

/* Ranges of a level, from the south on. */
typedef struct row_list {
    range_list all;
    size_t row; /* where those that ended with the row before begin */
} row_list;

/* How far the search for the tiles of a level is: the square at hand, of the band at hand. A band is as many rows
 * as a square is high, of the ranges that overlap the raster. */
struct layer_search {
    tile_range all[MOST_TURNS];
    int count;
    uint8_t *band[MOST_TURNS]; /* of each range, row by row from the south: which tiles are there */
    int32_t y;                 /* first row of the band */
    int range;
    int32_t x;
    int turn; /* longitudes are the same modulo 360: one after the other */
    uint8_t marks[SQUARE * SQUARE];
    rqt_block_number last; /* that has made its marks */
    row_list list;         /* of the bands before */
};

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

static int add_row(row_list *list, const uint8_t *row, const tile_range *r, int32_t y) {
    const int32_t width = r->x1 - r->x0 + 1;
    int code = SQLITE_OK;
    for (int32_t i = 0, end; i < width && code == SQLITE_OK; i = end) {
        for (end = i + 1; end < width && row[end] == row[i];) end++;
        if (row[i]) code = add_range(list, (tile_range){r->x0 + i, r->x0 + end - 1, y, y});
    }
    return code;
}

/* ------------------------------------------------------------------------------------------------- search -- */

void layer_search_free(layer_search *s) {
    if (!s) return;
    for (int i = 0; i < s->count; i++) sqlite3_free(s->band[i]);
    sqlite3_free(s->list.all.items);
    sqlite3_free(s);
}

static void begin_square(layer_search *s) {
    memset(s->marks, 0, sizeof s->marks);
    s->last = 0;
}

static void begin_band(const tiles *t, layer_search *s) {
    for (int i = 0; i < s->count; i++) memset(s->band[i], 0, (size_t)(s->all[i].x1 - s->all[i].x0 + 1) * SQUARE);
    s->range = 0;
    s->x = s->all[0].x0;
    s->turn = plan_turns(t).first;
    begin_square(s);
}

/* Does a level need one? The first has all tiles, and without voids all that meet the raster are there. */
static bool is_searched(const tiles *t, int z) {
    return z > 0 && t->terrain->voids > 0;
}

static int begin_search(const tiles *t, int z, layer_search **out) {
    layer_search *s = sqlite3_malloc(sizeof *s);
    if (!s) return SQLITE_NOMEM;
    *s = (layer_search){0};
    int code = tiles_add_range(&s->list.all, (tile_range){0}); /* so that there is memory even for none */
    s->list.all.count = 0;
    s->count = plan_ranges(t, z, s->all);
    for (int i = 0; i < s->count && is_searched(t, z); i++) {
        s->band[i] = sqlite3_malloc64((sqlite3_uint64)(s->all[i].x1 - s->all[i].x0 + 1) * SQUARE);
        if (!s->band[i]) code = SQLITE_NOMEM;
    }
    if (code == SQLITE_OK && s->count > 0 && is_searched(t, z)) {
        s->y = s->all[0].y0; /* all ranges have the same rows */
        begin_band(t, s);
    }
    if (code == SQLITE_OK)
        *out = s;
    else
        layer_search_free(s);
    return code;
}

/* Rows of the band at hand. */
static int32_t rows_of(const layer_search *s) {
    const int32_t left = s->all[0].y1 - s->y + 1;
    return left < SQUARE ? left : SQUARE;
}

/* The tiles of the square at hand that are there, by the turn at hand. */
static int mark_square(tiles *t, int z, layer_search *s, char **error) {
    const store_query_options options = plan_options(t, z);
    const tile_range *all = &s->all[s->range];
    tile_range r = {s->x, all->x1 - s->x < SQUARE ? all->x1 : s->x + SQUARE - 1, s->y, s->y + rows_of(s) - 1};
    int64_t x[SQUARE + 1], y[SQUARE + 1];
    if (!plan_cells(t, z, s->turn, &r, x, y)) return SQLITE_OK;
    rqt_cells cells = {x, y, r.x1 - r.x0 + 1, r.y1 - r.y0 + 1, s->marks};
    const int code = store_mark(t->store, t->terrain, plan_of(t)->level[z].eps, &options, &cells, &s->last, error);
    if (code != SQLITE_OK) return code;
    const size_t width = (size_t)(all->x1 - all->x0 + 1);
    for (int32_t j = 0; j < cells.rows; j++) /* from the north on */
        for (int32_t i = 0; i < cells.columns; i++)
            s->band[s->range][(size_t)(r.y1 - j - s->y) * width + (size_t)(r.x0 - all->x0 + i)] |=
                s->marks[j * cells.columns + i];
    return SQLITE_OK;
}

/* To the next turn, or the next square; false: it was the last one of the band. */
static bool step(const tiles *t, layer_search *s) {
    const turn_range on = plan_turns(t);
    begin_square(s);
    if (s->turn++ < on.last) return true;
    s->turn = on.first;
    if (s->x + SQUARE <= s->all[s->range].x1) {
        s->x += SQUARE;
        return true;
    }
    if (++s->range == s->count) return false;
    s->x = s->all[s->range].x0;
    return true;
}

/* The ranges of the band. */
static int end_band(const tiles *t, layer_search *s) {
    const int32_t rows = rows_of(s);
    int code = SQLITE_OK;
    for (int32_t j = 0; j < rows && code == SQLITE_OK; j++) {
        row_list *list = &s->list;
        const size_t before = list->all.count;
        for (int i = 0; i < s->count && code == SQLITE_OK; i++) {
            const size_t width = (size_t)(s->all[i].x1 - s->all[i].x0 + 1);
            code = add_row(list, s->band[i] + (size_t)j * width, &s->all[i], s->y + j);
        }
        while (list->row < before && list->all.items[list->row].y1 < s->y + j) list->row++;
    }
    s->y += rows;
    if (code == SQLITE_OK && s->y <= s->all[0].y1) begin_band(t, s);
    return code;
}

static int search(tiles *t, int z, layer_search *s, char **error) {
    int code = SQLITE_OK;
    while (code == SQLITE_OK && s->count > 0 && s->y <= s->all[0].y1) {
        code = mark_square(t, z, s, error);
        if (code == SQLITE_OK && !step(t, s)) code = end_band(t, s);
    }
    return code;
}

/* The tiles of a level of which nothing is known yet. */
static int find_tiles(tiles *t, int z, range_list *list, char **error) {
    layer_search **s = &plan_of(t)->search[z];
    int code = *s ? SQLITE_OK : begin_search(t, z, s);
    if (code != SQLITE_OK) return code;
    if (is_searched(t, z))
        code = search(t, z, *s, error);
    else if (z == 0)
        code = add_range(&(*s)->list, (tile_range){0, 1, 0, 0});
    else
        for (int i = 0; i < (*s)->count && code == SQLITE_OK; i++) code = add_range(&(*s)->list, (*s)->all[i]);
    if ((code & 0xFF) == SQLITE_INTERRUPT) {
        t->goes_on = true;
        return code;
    }
    if (code == SQLITE_OK) {
        *list = (*s)->list.all;
        (*s)->list.all = (range_list){0};
    }
    layer_search_free(*s);
    *s = NULL;
    return code;
}

int layer_available(tiles *t, int z, const tile_range **ranges, size_t *count, char **error) {
    tile_plan *plan = plan_of(t);
    *ranges = NULL;
    *count = 0;
    if (z < 0 || z > plan->finest) return SQLITE_OK;
    if (!plan->ranges[z]) {
        range_list list = {0};
        const int code = find_tiles(t, z, &list, error);
        if (code != SQLITE_OK) return code;
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
