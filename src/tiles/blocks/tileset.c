/* tileset.c - the kind 3d-tiles: tileset.json, subtrees/level/x/y.subtree, content/level/x/y.glb.
 *
 * An implicit quadtree over the root square of the lattice, which begins in the north-west and grows southward and
 * eastward; 3D Tiles count rows from the south, and divide a region in the middle of its longitudes and latitudes,
 * which is where the cells of blocks end. So the region of the root is the square, beyond the raster's end; of each
 * tile the subtrees tell what is in truth there, and what it is off.
 *
 * Clients that do not read the metadata of tiles take a tile's region for its part of the root's, and its error for
 * the root's halved for each level: the root's is the least for which that is not below what the level is off. A
 * square that reaches beyond a pole or around the globe is no region: then the root has what of it is on the
 * globe, and the regions of such clients are wrong; errors stay true.
 *
 * The error of a tile is the mesh's own, for leaves too: 3D Tiles ask there for what is "of or close to 0", and
 * half a quantum of height, and a millimetre of rounding, are what the last level is off.
 */
#include "blocks.h"
#include "earth.h"

#include <cjson/cJSON.h>
#include <math.h>

static int finest(const tiles *t) {
    return block_plan_of(t)->finest;
}

/* -------------------------------------------------------------------------------------------- availability -- */

static int is_available(tiles *t, int series, block_tile tile, bool *is_there, char **error) {
    store_relief relief;
    *is_there = true;
    if (series == SUBTREES) return SQLITE_OK;
    const int code = block_relief_from_root(t, tile, &relief, error);
    return code == SQLITE_OK ? block_has_content(t, tile, &relief, is_there, error) : code;
}

/* The tiles of a row up to column x1 that are there. */
static int add_row(tiles *t, int series, int z, int32_t y, int32_t x1, range_list *list, char **error) {
    int32_t first = -1;
    for (int32_t x = 0; x <= x1 + 1; x++) {
        bool is_there = false;
        int code = x <= x1 ? is_available(t, series, block_tile_of(z, x, y), &is_there, error) : SQLITE_OK;
        if (code == SQLITE_OK && !is_there && first >= 0) {
            code = tiles_add_range(list, (tile_range){first, x - 1, y, y});
            first = -1;
        }
        if (code != SQLITE_OK) return code;
        if (is_there && first < 0) first = x;
    }
    return SQLITE_OK;
}

static int list_ranges(tiles *t, int series, int z, range_list *list, char **error) {
    const store_terrain *terrain = t->terrain;
    const int scale = terrain->lattice.K - z;
    const int32_t last = (int32_t)((INT64_C(1) << z) - 1);
    const int32_t x1 = terrain->lattice.width > 1 ? (terrain->lattice.width - 2) >> scale : 0;
    const int32_t y0 = last - (terrain->lattice.height > 1 ? (terrain->lattice.height - 2) >> scale : 0);
    int code = tiles_add_range(list, (tile_range){0}); /* so that there is memory even for none */
    list->count = 0;
    if (series == SUBTREES && z % SUBTREE_LEVELS != 0) return code;
    if (code == SQLITE_OK && (series == SUBTREES || terrain->voids == 0)) {
        bool is_there;
        code = is_available(t, series, (block_tile){z, 0, 0}, &is_there, error);
        return code == SQLITE_OK && is_there ? tiles_add_range(list, (tile_range){0, x1, y0, last}) : code;
    }
    for (int32_t y = y0; y <= last && code == SQLITE_OK; y++) code = add_row(t, series, z, y, x1, list, error);
    return code;
}

static int available(tiles *t, int series, int z, const tile_range **ranges, size_t *count, char **error) {
    block_plan *plan = block_plan_of(t);
    if (!plan->ranges[series][z]) {
        range_list list = {0};
        const int code = list_ranges(t, series, z, &list, error);
        if (code != SQLITE_OK) {
            sqlite3_free(list.items);
            return code;
        }
        plan->ranges[series][z] = list.items;
        plan->range_count[series][z] = list.count;
    }
    *ranges = plan->ranges[series][z];
    *count = plan->range_count[series][z];
    return SQLITE_OK;
}

static int make(tiles *t, int series, int z, int32_t x, int32_t y, tile_bytes *out, char **error) {
    const block_tile tile = block_tile_of(z, x, y);
    if (!block_exists(t, tile)) return SQLITE_OK;
    if (series == SUBTREES) return z % SUBTREE_LEVELS == 0 ? subtree_make(t, tile, out, error) : SQLITE_OK;
    block_mesh mesh;
    block_skirt skirt = {0};
    int code = block_mesh_make(t, tile, &mesh, error);
    const bool has_content = code == SQLITE_OK && mesh.patch.triangle_count > 0;
    if (has_content) code = block_skirt_make(t, tile, &mesh, &skirt);
    if (has_content && code == SQLITE_OK) code = block_glb_make(t, tile, &mesh, &skirt, out, error);
    block_skirt_free(&skirt);
    block_mesh_free(t, &mesh);
    return code;
}

/* --------------------------------------------------------------------------------------------- tileset.json -- */

static cJSON *property(const char *semantic, const char *description) {
    cJSON *p = cJSON_CreateObject();
    cJSON_AddStringToObject(p, "description", description);
    cJSON_AddStringToObject(p, "type", "SCALAR");
    cJSON_AddStringToObject(p, "componentType", "FLOAT64");
    cJSON_AddStringToObject(p, "semantic", semantic);
    return p;
}

static void add_schema(cJSON *tileset) {
    cJSON *schema = cJSON_AddObjectToObject(tileset, "schema");
    cJSON_AddStringToObject(schema, "id", "rqt");
    cJSON *tile = cJSON_AddObjectToObject(cJSON_AddObjectToObject(schema, "classes"), "tile");
    cJSON *properties = cJSON_AddObjectToObject(tile, "properties");
    cJSON_AddItemToObject(properties, "error",
                          property("TILE_GEOMETRIC_ERROR",
                                   "no sample that the tile covers is further from its mesh in space: metres"));
    cJSON *region = property("TILE_BOUNDING_REGION", "where samples, mesh and skirt of the tile are");
    cJSON_AddTrueToObject(region, "array");
    cJSON_AddNumberToObject(region, "count", 6);
    cJSON_AddItemToObject(properties, "region", region);
}

/* What clients that know of no tile's own error take: halved from level to level. */
static double error_of_root(const block_plan *plan) {
    double most = 0;
    for (int l = 0; l <= plan->finest; l++)
        most = fmax(most, ldexp(plan->level[l].error * (1 + 1e-12) + plan->level[l].round, l));
    return most * (1 + 1e-12);
}

/* The root's square. */
static int find_region(tiles *t, double region[6], char **error) {
    const rqt_placement *at = &t->terrain->placement;
    const rqt_lattice *lattice = &t->terrain->lattice;
    const block_tile root = {0, 0, 0};
    store_relief relief;
    const int code = block_relief_from_root(t, root, &relief, error);
    if (code != SQLITE_OK) return code;
    const double side = ldexp(1, lattice->K);
    block_region(t, root, &relief, region); /* for its heights */
    block_rectangle(at->x0, at->y0 + side * at->dy, at->x0 + side * at->dx, at->y0, region);
    return SQLITE_OK;
}

static void add_root(const tiles *t, const double region[6], double error, cJSON *tileset) {
    cJSON *root = cJSON_AddObjectToObject(tileset, "root");
    cJSON_AddItemToObject(cJSON_AddObjectToObject(root, "boundingVolume"), "region",
                          cJSON_CreateDoubleArray(region, 6));
    cJSON_AddNumberToObject(root, "geometricError", error);
    cJSON_AddStringToObject(root, "refine", "REPLACE");
    cJSON_AddStringToObject(cJSON_AddObjectToObject(root, "content"), "uri", "content/{level}/{x}/{y}.glb");
    cJSON *tiling = cJSON_AddObjectToObject(root, "implicitTiling");
    cJSON_AddStringToObject(tiling, "subdivisionScheme", "QUADTREE");
    cJSON_AddNumberToObject(tiling, "subtreeLevels", SUBTREE_LEVELS);
    cJSON_AddNumberToObject(tiling, "availableLevels", finest(t) + 1);
    cJSON_AddStringToObject(cJSON_AddObjectToObject(tiling, "subtrees"), "uri", "subtrees/{level}/{x}/{y}.subtree");
}

/* For people: what the levels are off, in which steps their vertices are placed, and how far walls hang down. */
static void add_extras(const tiles *t, cJSON *tileset) {
    const block_plan *plan = block_plan_of(t);
    double errors[TILES_LEVELS], steps[TILES_LEVELS], walls[TILES_LEVELS];
    cJSON *extras = cJSON_AddObjectToObject(cJSON_AddObjectToObject(tileset, "extras"), "rqt");
    char *source = tiles_attribution(t->terrain);
    cJSON_AddStringToObject(extras, "terrain", t->terrain->name);
    cJSON_AddStringToObject(extras, "attribution", source ? source : "");
    sqlite3_free(source);
    for (int l = 0; l <= plan->finest; l++) {
        errors[l] = plan->level[l].error + plan->level[l].round;
        steps[l] = plan->level[l].step;
        walls[l] = plan->level[l].wall;
    }
    cJSON_AddItemToObject(extras, "errors", cJSON_CreateDoubleArray(errors, plan->finest + 1));
    cJSON_AddItemToObject(extras, "steps", cJSON_CreateDoubleArray(steps, plan->finest + 1));
    cJSON_AddItemToObject(extras, "skirts", cJSON_CreateDoubleArray(walls, plan->finest + 1));
}

/* Its addresses are relative: clients take them as such. Levels are there all or not at all. */
static int document(tiles *t, const char *root, int first, int last, tile_bytes *out, char **error) {
    (void)root, (void)first, (void)last;
    double region[6];
    const int code = find_region(t, region, error);
    if (code != SQLITE_OK) return code;
    const double off = error_of_root(block_plan_of(t));
    const geo_extent e = tiles_extent(t->terrain);
    cJSON *tileset = cJSON_CreateObject();
    cJSON *asset = cJSON_AddObjectToObject(tileset, "asset");
    cJSON_AddStringToObject(asset, "version", "1.1");
    /* What is off without any of it: all that there is. */
    cJSON_AddNumberToObject(tileset, "geometricError",
                            fmax(off, EARTH_A * DEGREE * hypot(e.east - e.west, e.north - e.south)));
    add_schema(tileset);
    add_root(t, region, off, tileset);
    add_extras(t, tileset);
    return tiles_print(tileset, out);
}

static const tile_functions functions = {.plan_create = block_plan_create,
                                         .plan_free = block_plan_free,
                                         .finest = finest,
                                         .available = available,
                                         .make = make,
                                         .document = document};

const tile_kind tiles_3d = {.name = "3d-tiles",
                            .document = "tileset.json",
                            .is_whole = true,
                            .series_count = BLOCK_SERIES,
                            .series = {[CONTENT] = {"content/", ".glb", "model/gltf-binary", false},
                                       [SUBTREES] = {"subtrees/", ".subtree", "application/octet-stream", false}},
                            .functions = &functions};
