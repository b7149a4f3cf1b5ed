/* quantized_mesh.c - the kind quantized-mesh 1.0, for Cesium and others: tiles z/x/y.terrain, described by
 * layer.json. Its parts are told in quantized_mesh.h.
 */
#include "quantized_mesh.h"

static int finest(const tiles *t) {
    return plan_of(t)->finest;
}

static int available(tiles *t, int series, int z, const tile_range **ranges, size_t *count, char **error) {
    (void)series;
    return layer_available(t, z, ranges, count, error);
}

static int make(tiles *t, int series, int z, int32_t x, int32_t y, tile_bytes *out, char **error) {
    tile_place place;
    tile_mesh mesh = {0};
    (void)series;
    if (!plan_place(t, z, x, y, &place)) return SQLITE_OK;
    int code = mesh_make(t, &place, &mesh, error);
    if (code == SQLITE_OK && (mesh.cut.triangle_count > 0 || z == 0))
        code = encode_tile(t, &place, &mesh, out, error);
    mesh_free(&mesh);
    return code;
}

/* Its addresses are relative: clients take them as such. */
static int document(tiles *t, const char *root, int first, int last, tile_bytes *out, char **error) {
    (void)root;
    return layer_make(t, first, last, out, error);
}

static const tile_functions functions = {.plan_create = plan_create,
                                         .plan_free = plan_free,
                                         .finest = finest,
                                         .available = available,
                                         .make = make,
                                         .document = document};

const tile_kind quantized_mesh = {.name = "quantized-mesh",
                                  .document = "layer.json",
                                  .series_count = 1,
                                  .series = {{"", ".terrain", "application/vnd.quantized-mesh", false}},
                                  .functions = &functions};
