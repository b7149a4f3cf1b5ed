/* glb.c - a tile's mesh and its skirt as glTF 2.0, binary:
 *
 *   'glTF', u32 2, u32 size;  u32 size, 'JSON', text, blanks to 4 bytes;  u32 size, 'BIN', the buffer, zeros to 4
 *   buffer, for each primitive: positions of all vertices, three floats each; normals, three i8 and a zero each;
 *   indices, u16 where they fit, and zeros to 4 bytes
 *
 * Primitives. The first is the terrain, of which everything holds that is said of a tile. The second, which tiles
 * have that have neighbours, is its skirt (skirt.c): walls that hide what levels differ by, with vertices and
 * indices of its own. It has {"extras": {"skirt": DEPTH}}, in metres, so that whoever measures can leave it out.
 * Its vertices are in pairs: one of the mesh, and the lower end of the wall there.
 *
 * Axes. Clients of 3D Tiles turn glTF's y-up into their z-up, (x, y, z) to (x, -z, y): so a geocentric (X, Y, Z) is
 * (X, Z, -Y) here.
 *
 * Where it is. The node's matrix moves by the origin, whole metres and steps, which is a double there whatever it
 * is printed with: clients of 3D Tiles multiply it with their matrices in double, unlike viewers of models
 * (format/glb.c). Positions are whole steps from it, as floats exactly. What two tiles share is decoded to the same
 * doubles in both: origin + position is exact. A translation would say the same, but deck.gl leaves one of millions
 * of metres to the floats of its shaders, where it is off by a quarter of a metre.
 *
 * Extras have what the tile is off (tile.c), as the subtree does.
 */
#include "blocks.h"
#include "format.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <string.h>

enum { HEAD = 12, CHUNK = 8, POSITION_BYTES = 12, NORMAL_BYTES = 4, MOST_SHORT_INDEX = 65535 };
enum { UNSIGNED_SHORT = 5123, BYTE = 5120, UNSIGNED_INT = 5125, FLOAT = 5126, ARRAY = 34962, ELEMENTS = 34963 };

static size_t padded(size_t size) {
    return (size + 3) / 4 * 4;
}

/* A primitive. */
typedef struct part {
    size_t vertex_count, index_count;
    const int32_t *offset; /* and the rest as a block_mesh has them */
    const int8_t *normal;
    const uint32_t *indices;
} part;

enum { MOST_PARTS = 2 };
typedef struct parts {
    part of[MOST_PARTS];
    int count;
} parts;

static parts list_parts(const block_mesh *mesh, const block_skirt *skirt) {
    const rqt_patch *patch = &mesh->patch;
    return (parts){
        {{patch->vertex_count, 3 * patch->triangle_count, mesh->offset, mesh->normal, patch->triangles},
         {skirt->vertex_count, 3 * skirt->triangle_count, skirt->offset, skirt->normal, skirt->triangles}},
        skirt->triangle_count > 0 ? 2 : 1};
}

/* 65535 itself is kept free: it means restart in some libraries of graphics. */
static size_t index_bytes(const part *p) {
    return p->vertex_count <= MOST_SHORT_INDEX ? 2 : 4;
}

static size_t size_of_part(const part *p) {
    return (POSITION_BYTES + NORMAL_BYTES) * p->vertex_count + padded(index_bytes(p) * p->index_count);
}

/* ---------------------------------------------------------------------------------------------------- JSON -- */

/* Digits that read back equal; cJSON's are off by one in the last place at times. */
static cJSON *number(double value) {
    char digits[32];
    const int n = format_double(value, digits);
    digits[n] = 0;
    return cJSON_CreateRaw(digits);
}

static void add_numbers(cJSON *to, const char *name, const double *values, int count) {
    cJSON *list = cJSON_AddArrayToObject(to, name);
    for (int i = 0; i < count; i++) cJSON_AddItemToArray(list, number(values[i]));
}

static void add_asset(const tiles *t, block_tile tile, double error, cJSON *json) {
    cJSON *asset = cJSON_AddObjectToObject(json, "asset");
    cJSON_AddStringToObject(asset, "version", "2.0");
    cJSON_AddStringToObject(asset, "generator", "rqt " RQT_VERSION);
    char *source = tiles_attribution(t->terrain);
    if (source && *source) cJSON_AddStringToObject(asset, "copyright", source);
    sqlite3_free(source);
    cJSON *told = cJSON_AddObjectToObject(cJSON_AddObjectToObject(asset, "extras"), "rqt");
    cJSON_AddStringToObject(told, "terrain", t->terrain->name);
    cJSON_AddNumberToObject(told, "level", tile.level);
    cJSON_AddItemToObject(told, "error", number(error));
    cJSON_AddItemToObject(told, "step", number(block_plan_of(t)->level[tile.level].step));
}

/* A view of what comes next in the buffer. */
static void add_view(cJSON *views, size_t *at, size_t size, int stride, int target) {
    cJSON *view = cJSON_CreateObject();
    cJSON_AddNumberToObject(view, "buffer", 0);
    cJSON_AddNumberToObject(view, "byteOffset", (double)*at);
    cJSON_AddNumberToObject(view, "byteLength", (double)size);
    if (stride) cJSON_AddNumberToObject(view, "byteStride", stride);
    cJSON_AddNumberToObject(view, "target", target);
    cJSON_AddItemToArray(views, view);
    *at += padded(size);
}

static cJSON *add_accessor(cJSON *accessors, int component, size_t count, const char *type) {
    cJSON *accessor = cJSON_CreateObject();
    cJSON_AddNumberToObject(accessor, "bufferView", cJSON_GetArraySize(accessors));
    cJSON_AddNumberToObject(accessor, "componentType", component);
    cJSON_AddNumberToObject(accessor, "count", (double)count);
    cJSON_AddStringToObject(accessor, "type", type);
    cJSON_AddItemToArray(accessors, accessor);
    return accessor;
}

/* Geocentric to glTF's axes. */
static void turn(const double xyz[3], double out[3]) {
    out[0] = xyz[0];
    out[1] = xyz[2];
    out[2] = -xyz[1] + 0.0;
}

static void add_box(const part *p, double step, cJSON *positions) {
    double low[3] = {HUGE_VAL, HUGE_VAL, HUGE_VAL}, high[3] = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
    for (size_t i = 0; i < p->vertex_count; i++) {
        const int32_t *o = p->offset + 3 * i;
        const double xyz[3] = {o[0] * step, o[1] * step, o[2] * step};
        double at[3];
        turn(xyz, at);
        for (int k = 0; k < 3; k++) {
            if (at[k] < low[k]) low[k] = at[k];
            if (at[k] > high[k]) high[k] = at[k];
        }
    }
    add_numbers(positions, "min", low, 3);
    add_numbers(positions, "max", high, 3);
}

static void add_scene(const block_mesh *mesh, cJSON *json) {
    static const char *const extension = "KHR_mesh_quantization"; /* of normals in bytes */
    cJSON_AddItemToObject(json, "extensionsUsed", cJSON_CreateStringArray(&extension, 1));
    cJSON_AddItemToObject(json, "extensionsRequired", cJSON_CreateStringArray(&extension, 1));
    cJSON_AddNumberToObject(json, "scene", 0);
    cJSON_AddItemToObject(json, "scenes", cJSON_Parse("[{\"nodes\":[0]}]"));
    cJSON *nodes = cJSON_AddArrayToObject(json, "nodes"), *node = cJSON_CreateObject();
    double matrix[16] = {[0] = 1, [5] = 1, [10] = 1, [15] = 1}; /* column by column */
    turn(mesh->origin, matrix + 12);
    cJSON_AddNumberToObject(node, "mesh", 0);
    add_numbers(node, "matrix", matrix, 16);
    cJSON_AddItemToArray(nodes, node);
    cJSON_AddItemToObject(json, "materials",
                          cJSON_Parse("[{\"doubleSided\":true,\"pbrMetallicRoughness\":{\"baseColorFactor\":"
                                      "[0.6,0.58,0.5,1],\"metallicFactor\":0,\"roughnessFactor\":1}}]"));
}

/* With the accessors that come next. */
static void add_primitive(const cJSON *accessors, double skirt, cJSON *primitives) {
    const int first = cJSON_GetArraySize(accessors);
    cJSON *primitive = cJSON_CreateObject(), *attributes = cJSON_AddObjectToObject(primitive, "attributes");
    cJSON_AddNumberToObject(attributes, "POSITION", first);
    cJSON_AddNumberToObject(attributes, "NORMAL", first + 1);
    cJSON_AddNumberToObject(primitive, "indices", first + 2);
    cJSON_AddNumberToObject(primitive, "material", 0);
    cJSON_AddNumberToObject(primitive, "mode", 4);
    if (skirt > 0) cJSON_AddItemToObject(cJSON_AddObjectToObject(primitive, "extras"), "skirt", number(skirt));
    cJSON_AddItemToArray(primitives, primitive);
}

static void add_data(const part *p, double step, size_t *at, cJSON *accessors, cJSON *views) {
    add_box(p, step, add_accessor(accessors, FLOAT, p->vertex_count, "VEC3"));
    cJSON_AddTrueToObject(add_accessor(accessors, BYTE, p->vertex_count, "VEC3"), "normalized");
    add_accessor(accessors, index_bytes(p) == 2 ? UNSIGNED_SHORT : UNSIGNED_INT, p->index_count, "SCALAR");
    add_view(views, at, POSITION_BYTES * p->vertex_count, POSITION_BYTES, ARRAY);
    add_view(views, at, NORMAL_BYTES * p->vertex_count, NORMAL_BYTES, ARRAY);
    add_view(views, at, index_bytes(p) * p->index_count, 0, ELEMENTS);
}

static void add_parts(const parts *all, double step, double skirt, cJSON *json) {
    cJSON *mesh = cJSON_CreateObject(), *primitives = cJSON_AddArrayToObject(mesh, "primitives");
    cJSON_AddItemToArray(cJSON_AddArrayToObject(json, "meshes"), mesh);
    cJSON *accessors = cJSON_AddArrayToObject(json, "accessors"),
          *views = cJSON_AddArrayToObject(json, "bufferViews");
    size_t size = 0;
    for (int i = 0; i < all->count; i++) {
        add_primitive(accessors, i > 0 ? skirt : 0, primitives);
        add_data(&all->of[i], step, &size, accessors, views);
    }
    cJSON *buffers = cJSON_AddArrayToObject(json, "buffers"), *buffer = cJSON_CreateObject();
    cJSON_AddNumberToObject(buffer, "byteLength", (double)size);
    cJSON_AddItemToArray(buffers, buffer);
}

/* NULL: no memory. */
static char *describe(const tiles *t, block_tile tile, double error, const block_mesh *mesh, const parts *all,
                      double skirt) {
    cJSON *json = cJSON_CreateObject();
    add_asset(t, tile, error, json);
    add_scene(mesh, json);
    add_parts(all, block_plan_of(t)->level[tile.level].step, skirt, json);
    char *text = cJSON_PrintUnformatted(json);
    cJSON_Delete(json);
    return text;
}

/* --------------------------------------------------------------------------------------------------- bytes -- */

static uint8_t *put_u32(uint8_t *p, uint32_t n) {
    for (int i = 0; i < 4; i++) *p++ = (uint8_t)(n >> 8 * i);
    return p;
}

static uint8_t *put_u16(uint8_t *p, uint32_t n) {
    *p++ = (uint8_t)n;
    *p++ = (uint8_t)(n >> 8);
    return p;
}

static uint8_t *put_float(uint8_t *p, float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return put_u32(p, bits);
}

static uint8_t *put_chunk(uint8_t *p, size_t size, const char name[4]) {
    p = put_u32(p, (uint32_t)padded(size));
    memcpy(p, name, 4);
    return p + 4;
}

static uint8_t *put_part(uint8_t *p, const part *all, double step) {
    const size_t count = all->vertex_count;
    for (size_t i = 0; i < count; i++) {
        const int32_t *o = all->offset + 3 * i;
        p = put_float(p, (float)(o[0] * step));
        p = put_float(p, (float)(o[2] * step));
        p = put_float(p, (float)(-o[1] * step));
    }
    for (size_t i = 0; i < count; i++) {
        const int8_t *n = all->normal + 3 * i;
        *p++ = (uint8_t)n[0];
        *p++ = (uint8_t)n[2];
        *p++ = (uint8_t)-n[1];
        *p++ = 0;
    }
    const size_t bytes = index_bytes(all) * all->index_count;
    for (size_t i = 0; i < all->index_count; i++)
        p = index_bytes(all) == 2 ? put_u16(p, all->indices[i]) : put_u32(p, all->indices[i]);
    memset(p, 0, padded(bytes) - bytes);
    return p + padded(bytes) - bytes;
}

int block_glb_make(tiles *t, block_tile tile, const block_mesh *mesh, const block_skirt *skirt, tile_bytes *out,
                   char **error) {
    store_relief relief;
    int code = block_relief_from_root(t, tile, &relief, error);
    if (code != SQLITE_OK) return code;
    const parts all = list_parts(mesh, skirt);
    char *text = describe(t, tile, block_error(t, tile, &relief), mesh, &all, skirt->depth);
    const size_t length = text ? strlen(text) : 0;
    size_t data = 0;
    for (int i = 0; i < all.count; i++) data += size_of_part(&all.of[i]);
    const size_t size = HEAD + 2 * CHUNK + padded(length) + data;
    uint8_t *bytes = text && size <= UINT32_MAX ? sqlite3_malloc64(size) : NULL;
    if (bytes) {
        uint8_t *p = bytes;
        memcpy(p, "glTF", 4);
        p = put_u32(put_u32(p + 4, 2), (uint32_t)size);
        p = put_chunk(p, length, "JSON");
        memset(p, ' ', padded(length));
        memcpy(p, text, length);
        p = put_chunk(p + padded(length), data, "BIN");
        for (int i = 0; i < all.count; i++) p = put_part(p, &all.of[i], block_plan_of(t)->level[tile.level].step);
        *out = (tile_bytes){bytes, size};
    }
    cJSON_free(text);
    return bytes ? SQLITE_OK : SQLITE_NOMEM;
}
