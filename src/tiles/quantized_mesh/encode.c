/* encode.c - the bytes of a tile, quantized-mesh 1.0 (little-endian):
 *
 *     header      88 bytes: centre, heights, sphere, horizon point
 *     vertices    count; u, v, height, each as differences from the one before, zigzag, 16 bits
 *     triangles   padding to the size of an index; count; indices by high-water mark, 16 bits, 32 when there are
 *                 more than 65536 vertices
 *     sides       west, south, east, north: count, indices
 *     extensions  id (1 byte), length (4): 1 oct-encoded normals, 2 water mask (terrains with a sea), 4 metadata
 *
 * The cut has its vertices in the order of the triangles: each new one is the next, which is what the high-water
 * mark wants. Specks follow (speck.c).
 */
#include "quantized_mesh.h"

#include "format.h"

#include <stdio.h>
#include <string.h>

enum { HEADER = 88, SMALL_INDICES = 65536, NORMALS = 1, WATER = 2, METADATA = 4 };

typedef struct writer {
    uint8_t *bytes;
    size_t size, capacity;
    bool no_memory;
} writer;

/* bytes NULL: room for them. */
static void put(writer *w, const void *bytes, size_t size) {
    if (w->no_memory) return;
    if (w->size + size > w->capacity) {
        const size_t capacity = 2 * (w->size + size);
        uint8_t *more = sqlite3_realloc64(w->bytes, capacity);
        w->no_memory = !more;
        if (!more) return;
        w->bytes = more;
        w->capacity = capacity;
    }
    if (bytes) memcpy(w->bytes + w->size, bytes, size);
    w->size += size;
}

/* The low bytes of a number. */
static void put_number(writer *w, uint64_t n, size_t size) {
    uint8_t bytes[8];
    for (size_t i = 0; i < size; i++) bytes[i] = (uint8_t)(n >> 8 * i);
    put(w, bytes, size);
}

static void put_double(writer *w, double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    put_number(w, bits, sizeof bits);
}

static void put_float(writer *w, float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    put_number(w, bits, sizeof bits);
}

static void put_header(writer *w, const tile_plan *plan, const tile_globe *globe) {
    for (int k = 0; k < 3; k++) put_double(w, globe->centre[k]);
    put_float(w, (float)plan->lowest);
    put_float(w, (float)(plan->lowest + TILE_UNITS * plan->step));
    for (int k = 0; k < 3; k++) put_double(w, globe->centre[k]);
    put_double(w, globe->radius);
    for (int k = 0; k < 3; k++) put_double(w, globe->horizon[k]);
}

/* Room for so many numbers of so many bytes, to be written; NULL: no memory. */
static uint8_t *make_room(writer *w, size_t count, size_t size) {
    const size_t at = w->size;
    put(w, NULL, count * size);
    return w->no_memory ? NULL : w->bytes + at;
}

static uint8_t *write_number(uint8_t *p, uint32_t n, size_t size) {
    p[0] = (uint8_t)n;
    p[1] = (uint8_t)(n >> 8);
    if (size == 4) p[2] = (uint8_t)(n >> 16), p[3] = (uint8_t)(n >> 24);
    return p + size;
}

static void put_differences(writer *w, const uint16_t *values, size_t count) {
    uint8_t *p = make_room(w, count, 2);
    int before = 0;
    for (size_t i = 0; p && i < count; i++) {
        const int by = values[i] - before;
        p = write_number(p, (uint32_t)(by < 0 ? -2 * by - 1 : 2 * by), 2);
        before = values[i];
    }
}

static void put_triangles(writer *w, const tile_mesh *mesh, size_t index) {
    const rqt_cut *cut = &mesh->cut;
    uint32_t highest = 0;
    while (w->size % index) put_number(w, 0, 1);
    put_number(w, cut->triangle_count + mesh->specks, 4);
    uint8_t *p = make_room(w, 3 * cut->triangle_count, index);
    for (size_t i = 0; p && i < 3 * cut->triangle_count; i++) {
        p = write_number(p, highest - cut->triangles[i], index);
        highest += cut->triangles[i] == highest;
    }
    /* The next vertex, and itself again, twice. */
    for (uint32_t i = 0; i < 3 * mesh->specks; i++) put_number(w, i % 3 > 0, index);
}

static void put_sides(writer *w, const tile_mesh *mesh, size_t index) {
    for (int side = 0; side < 4; side++) {
        put_number(w, mesh->edge_count[side], 4);
        for (uint32_t i = 0; i < mesh->edge_count[side]; i++) put_number(w, mesh->edge[side][i], index);
    }
}

static int put_normals(writer *w, tiles *t, const tile_mesh *mesh, const tile_globe *globe, char **error) {
    const size_t size = 2 * mesh_vertices(mesh);
    uint8_t *packed = sqlite3_malloc64(size);
    const int code = packed ? globe_normals(t, mesh, globe, packed, error) : SQLITE_NOMEM;
    if (code == SQLITE_OK) {
        put_number(w, NORMALS, 1);
        put_number(w, size, 4);
        put(w, packed, size);
    }
    sqlite3_free(packed);
    return code;
}

static void put_water(writer *w, const tiles *t, const tile_place *place) {
    uint8_t mask[WATER_SIDE * WATER_SIDE];
    const size_t size = water_mask(t, place, mask);
    put_number(w, WATER, 1);
    put_number(w, size, 4);
    put(w, mask, size);
}

/* What the tile is off; and of level 0 which tiles there are below it (layer.c). */
static int put_metadata(writer *w, tiles *t, const tile_place *place, const tile_mesh *mesh, char **error) {
    const tile_plan *plan = plan_of(t);
    const tile_level *level = &plan->level[place->z];
    uint16_t low = TILE_UNITS, high = 0;
    for (size_t i = 0; i < mesh->cut.vertex_count; i++) {
        if (mesh->h[i] < low) low = mesh->h[i];
        if (mesh->h[i] > high) high = mesh->h[i];
    }
    enum { OF_LEVEL = 3, MEMBERS = 7 };
    const struct {
        const char *name;
        double value;
    } members[MEMBERS] = {{"geometricError", level->geometric_error},
                          {"eps", level->eps},
                          {"heightStep", plan->step},
                          /* of what is in it */
                          {"error", mesh->error},
                          {"verticalError", mesh->vertical_error},
                          {"minimumHeight", plan->lowest + low * plan->step},
                          {"maximumHeight", plan->lowest + high * plan->step}};
    char json[512], *end = json, *below = NULL;
    for (size_t i = 0; i < (mesh->cut.vertex_count > 0 ? MEMBERS : OF_LEVEL); i++) {
        char number[32];
        format_double(members[i].value, number);
        end += sprintf(end, "%s\"%s\":%s", i ? "," : "{", members[i].name, number);
    }
    if (place->z == 0) {
        const int code = layer_below(t, place->x, &below, error);
        if (code != SQLITE_OK) return code;
        end += sprintf(end, ",\"available\":");
    }
    const size_t told = (size_t)(end - json), listed = below ? strlen(below) : 0, size = told + listed + 1;
    put_number(w, METADATA, 1);
    put_number(w, size + 4, 4);
    put_number(w, size, 4);
    put(w, json, told);
    put(w, below, listed);
    put(w, "}", 1);
    sqlite3_free(below);
    return SQLITE_OK;
}

int encode_tile(tiles *t, const tile_place *place, const tile_mesh *mesh, tile_bytes *out, char **error) {
    const size_t count = mesh_vertices(mesh), index = count > SMALL_INDICES ? 4 : 2;
    tile_globe globe;
    int code = globe_make(mesh, &globe);
    if (code != SQLITE_OK) {
        globe_free(&globe);
        return code;
    }
    writer w = {.capacity = 4096 + HEADER + 8 * count + (3 * mesh->cut.triangle_count + 1024) * index};
    w.bytes = sqlite3_malloc64(w.capacity);
    w.no_memory = !w.bytes;
    put_header(&w, plan_of(t), &globe);
    put_number(&w, count, 4);
    put_differences(&w, mesh->u, count);
    put_differences(&w, mesh->v, count);
    put_differences(&w, mesh->h, count);
    put_triangles(&w, mesh, index);
    put_sides(&w, mesh, index);
    code = put_normals(&w, t, mesh, &globe, error);
    if (plan_of(t)->has_sea) put_water(&w, t, place);
    if (code == SQLITE_OK) code = put_metadata(&w, t, place, mesh, error);
    globe_free(&globe);
    if (code == SQLITE_OK && w.no_memory) code = SQLITE_NOMEM;
    if (code == SQLITE_OK)
        *out = (tile_bytes){w.bytes, w.size};
    else
        sqlite3_free(w.bytes);
    return code;
}
