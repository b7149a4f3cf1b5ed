/* subtree.c - some levels of tiles below one, as clients of implicit tilings ask for them (little-endian):
 *
 *   'subt', u32 1, u64 size of the text, u64 size of the buffer;  JSON, blanks to 8 bytes;  buffer, to 8 bytes
 *   buffer: errors of the tiles, a double each; their regions, six doubles each; and what of the availabilities of
 *   tiles, contents and subtrees below is not all or nothing, a bit each, each from a multiple of 8 bytes on
 *
 * Tiles come level by level, and in a level along the Morton curve, x in the even bits, y from the south in the
 * odd. Those that are there have the errors and regions of tile.c, in that order.
 *
 * A tile is there iff its block is stored, its content iff the mesh has a triangle. All of it is known from the
 * index, but for contents where there are voids: those are looked for, each up to the first triangle.
 */
#include "blocks.h"

#include <cjson/cJSON.h>
#include <string.h>

enum {
    LEVELS = SUBTREE_LEVELS,
    TILES = ((1 << 2 * LEVELS) - 1) / 3, /* of all levels */
    BELOW = 1 << 2 * LEVELS,
    REGION = 6,
    HEAD = 24,
    AVAILABLE = 3 /* bit strings */
};

typedef struct bits {
    int size, count; /* all; those that are 1 */
    uint8_t byte[(BELOW > TILES ? BELOW : TILES) / 8 + 1];
} bits;

static void set_bit(bits *b, int i) {
    b->byte[i / 8] |= (uint8_t)(1 << i % 8);
    b->count++;
}

typedef struct subtree {
    bits tiles, contents, below;
    double error[TILES], region[REGION * TILES]; /* of those that are there */
} subtree;

/* The m-th tile so many levels below: y counts from the south. */
static block_tile tile_below(block_tile root, int depth, int m) {
    int32_t x = 0, y = 0;
    for (int bit = 0; bit < depth; bit++) {
        x |= (m >> 2 * bit & 1) << bit;
        y |= (m >> (2 * bit + 1) & 1) << bit;
    }
    const int32_t side = 1 << depth;
    return (block_tile){root.level + depth, root.i * side + x, root.j * side + side - 1 - y};
}

static int add_tile(tiles *t, block_tile tile, int place, store_relief *relief, subtree *s, char **error) {
    bool has_content;
    int code = block_relief(t, tile, relief, error);
    if (code == SQLITE_OK) code = block_has_content(t, tile, relief, &has_content, error);
    if (code != SQLITE_OK) return code;
    s->error[s->tiles.count] = block_error(t, tile, relief);
    block_region(t, tile, relief, s->region + (size_t)REGION * (size_t)s->tiles.count);
    set_bit(&s->tiles, place);
    if (has_content) set_bit(&s->contents, place);
    return SQLITE_OK;
}

static int fill(tiles *t, block_tile root, subtree *s, char **error) {
    store_relief relief[TILES];
    const block_tile above = {root.level - 1, root.i >> 1, root.j >> 1};
    store_relief start = store_relief_of_all(t->terrain);
    int code = root.level > 0 ? block_relief_from_root(t, above, &start, error) : SQLITE_OK;
    for (int depth = 0, first = 0, before = 0; depth < LEVELS; before = first, first += 1 << 2 * depth++)
        for (int m = 0; m < 1 << 2 * depth && code == SQLITE_OK; m++) {
            const block_tile tile = tile_below(root, depth, m);
            relief[first + m] = depth ? relief[before + m / 4] : start;
            if (block_exists(t, tile)) code = add_tile(t, tile, first + m, &relief[first + m], s, error);
        }
    for (int m = 0; m < BELOW; m++)
        if (block_exists(t, tile_below(root, LEVELS, m))) set_bit(&s->below, m);
    return code;
}

/* ---------------------------------------------------------------------------------------------------- bytes -- */

typedef struct buffer {
    cJSON *views;
    uint8_t *bytes;
    size_t size;
} buffer;

static void put(uint8_t *p, uint64_t n, int size) {
    for (int i = 0; i < size; i++) p[i] = (uint8_t)(n >> 8 * i);
}

/* Room from a multiple of 8 bytes on, as a view: its number. */
static int add_view(buffer *b, size_t size, uint8_t **at) {
    cJSON *view = cJSON_CreateObject();
    cJSON_AddNumberToObject(view, "buffer", 0);
    cJSON_AddNumberToObject(view, "byteOffset", (double)b->size);
    cJSON_AddNumberToObject(view, "byteLength", (double)size);
    cJSON_AddItemToArray(b->views, view);
    *at = b->bytes + b->size;
    b->size += (size + 7) / 8 * 8;
    return cJSON_GetArraySize(b->views) - 1;
}

static int add_doubles(buffer *b, const double *values, int count) {
    uint8_t *at;
    const int view = add_view(b, 8 * (size_t)count, &at);
    for (int i = 0; i < count; i++) {
        uint64_t number;
        memcpy(&number, &values[i], sizeof number);
        put(at + 8 * (size_t)i, number, 8);
    }
    return view;
}

static bool is_constant(const bits *b) {
    return b->count == 0 || b->count == b->size;
}

static void add_availability(buffer *b, const bits *available, bool constant, cJSON *to) {
    if (constant) {
        cJSON_AddNumberToObject(to, "constant", available->count > 0);
        return;
    }
    uint8_t *at;
    const size_t size = (size_t)(available->size + 7) / 8;
    cJSON_AddNumberToObject(to, "bitstream", add_view(b, size, &at));
    cJSON_AddNumberToObject(to, "availableCount", available->count);
    memcpy(at, available->byte, size);
}

static void add_property(cJSON *properties, const char *name, int view) {
    cJSON_AddNumberToObject(cJSON_AddObjectToObject(properties, name), "values", view);
}

static cJSON *describe(const subtree *s, buffer *b) {
    cJSON *json = cJSON_CreateObject(), *table = cJSON_CreateObject(), *content = cJSON_CreateObject();
    cJSON *buffers = cJSON_AddArrayToObject(json, "buffers"), *whole = cJSON_CreateObject();
    b->views = cJSON_AddArrayToObject(json, "bufferViews");
    cJSON_AddItemToArray(cJSON_AddArrayToObject(json, "propertyTables"), table);
    cJSON_AddStringToObject(table, "class", "tile");
    cJSON_AddNumberToObject(table, "count", s->tiles.count);
    cJSON *properties = cJSON_AddObjectToObject(table, "properties");
    add_property(properties, "error", add_doubles(b, s->error, s->tiles.count));
    add_property(properties, "region", add_doubles(b, s->region, REGION * s->tiles.count));
    cJSON_AddNumberToObject(json, "tileMetadata", 0);
    /* deck.gl looks tiles below up here where there is no subtree of theirs, and finds them in a constant. */
    const bool ends = is_constant(&s->tiles) && is_constant(&s->below);
    add_availability(b, &s->tiles, ends, cJSON_AddObjectToObject(json, "tileAvailability"));
    cJSON_AddItemToArray(cJSON_AddArrayToObject(json, "contentAvailability"), content);
    add_availability(b, &s->contents, is_constant(&s->contents), content);
    add_availability(b, &s->below, is_constant(&s->below),
                     cJSON_AddObjectToObject(json, "childSubtreeAvailability"));
    cJSON_AddNumberToObject(whole, "byteLength", (double)b->size);
    cJSON_AddItemToArray(buffers, whole);
    return json;
}

static int encode(const subtree *s, tile_bytes *out) {
    uint8_t data[sizeof(subtree) + 8 * (AVAILABLE + 2)] = {0};
    buffer b = {.bytes = data};
    cJSON *json = describe(s, &b);
    char *text = cJSON_PrintUnformatted(json);
    cJSON_Delete(json);
    const size_t length = text ? strlen(text) : 0, padded = (length + 7) / 8 * 8;
    *out = (tile_bytes){.bytes = text ? sqlite3_malloc64(HEAD + padded + b.size) : NULL};
    if (text && out->bytes) {
        memcpy(out->bytes, "subt", 4);
        put(out->bytes + 4, 1, 4);
        put(out->bytes + 8, padded, 8);
        put(out->bytes + 16, b.size, 8);
        memset(out->bytes + HEAD, ' ', padded);
        memcpy(out->bytes + HEAD, text, length);
        memcpy(out->bytes + HEAD + padded, data, b.size);
        out->size = HEAD + padded + b.size;
    }
    cJSON_free(text);
    return out->bytes ? SQLITE_OK : SQLITE_NOMEM;
}

int subtree_make(tiles *t, block_tile root, tile_bytes *out, char **error) {
    subtree s = {.tiles = {.size = TILES}, .contents = {.size = TILES}, .below = {.size = BELOW}};
    const int code = fill(t, root, &s, error);
    return code == SQLITE_OK ? encode(&s, out) : code;
}
