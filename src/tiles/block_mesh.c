/* block_mesh.c - the mesh of a tile: the terrain's own at the level's error, in the cell of a block, its corners
 * forced. And its vertices in space.
 *
 * The rule is lowered by rank by what curvature takes; a rank of which curvature takes more than the level has to
 * give, is in whatever its errors. On the last level only that is lowered: else what has any error is in. The cell
 * is a square of the lattice, so that nothing is cut: every vertex is a sample, and its place, step and normal
 * depend on the sample and the level alone. That is all that there is to seams.
 *
 * At a pole a row of samples is one place, at the antimeridian the first and the last column may be: both are
 * rounded to the same steps, but for one that lies on the very edge between two; sines and cosines are off by 1e-9
 * m there.
 */
#include "block.h"

#include <math.h>
#include <string.h>

#define DEGREE 0.017453292519943295
#define BEYOND_POLE (90 * (1 + 1e-9))
enum { NORMAL_UNITS = 127 };

/* ---------------------------------------------------------------------------------------------------- mesh -- */

static int make_rule(const tiles *t, block_tile tile, rqt_rule **rule) {
    const block_plan *plan = block_plan_of(t);
    const store_terrain *terrain = t->terrain;
    const double error = plan->level[tile.level].error;
    const int32_t side = 1 << (terrain->lattice.K - tile.level);
    double lowering[RQT_RANKS];
    for (int rank = 0; rank < RQT_RANKS; rank++) {
        const double sag = block_sag(plan, rank);
        const bool is_free = sag + terrain->quantum_error <= error;
        lowering[rank] = !is_free ? 2 * error + 1 : tile.level == plan->finest ? error : sag;
    }
    rqt_status status = rqt_rule_create(&terrain->lattice, terrain->quantum_error, store_allocator(), rule);
    if (status == RQT_OK) status = rqt_rule_set_lowering(*rule, lowering);
    for (int corner = 0; corner < 4 && status == RQT_OK; corner++)
        status =
            rqt_rule_force(*rule, (rqt_vertex){(tile.i + (corner & 1)) * side, (tile.j + (corner >> 1)) * side});
    return status == RQT_OK ? SQLITE_OK : SQLITE_NOMEM;
}

int block_query(tiles *t, block_tile tile, int64_t most, rqt_patch *patch, char **error) {
    const block_plan *plan = block_plan_of(t);
    const int32_t side = 1 << (t->terrain->lattice.K - tile.level);
    const rqt_square cell = {tile.i * side, tile.j * side, side};
    store_limits *limits = store_limits_of(t->store);
    const int64_t before = limits->triangles;
    store_query_options options = {.select = RQT_SELECT_THRESHOLD,
                                   .outline = tile.level == plan->finest ? RQT_OUTLINE_EXACT : RQT_OUTLINE_TOL,
                                   .metric = RQT_METRIC_EXACT,
                                   .product = RQT_PRODUCT_TRIANGLES};
    rqt_region *region = NULL;
    *patch = (rqt_patch){0};
    int code = make_rule(t, tile, &options.rule);
    if (code == SQLITE_OK &&
        rqt_region_of_squares(&cell, 1, &t->terrain->lattice, store_allocator(), &region) != RQT_OK)
        code = SQLITE_NOMEM;
    if (code == SQLITE_OK) {
        if (most > 0) limits->triangles = most;
        code =
            store_query(t->store, t->terrain, region, plan->level[tile.level].error, &options, patch, NULL, error);
        limits->triangles = before;
    }
    rqt_region_free(region);
    rqt_rule_free(options.rule);
    return code;
}

/* ------------------------------------------------------------------------------------------------ in space -- */

static int place_vertex(const tiles *t, const rqt_patch_vertex *v, double xyz[3], char **error) {
    const rqt_placement *at = &t->terrain->placement;
    double place[3] = {at->x0 + v->col * at->dx, at->y0 + v->row * at->dy,
                       rqt_unit_metres(&t->terrain->unit, v->q)};
    if (fabs(place[1]) > 90 && fabs(place[1]) <= BEYOND_POLE) place[1] = copysign(90, place[1]);
    geo_frame_place(block_plan_of(t)->frame, place, xyz);
    if (isfinite(xyz[0]) && isfinite(xyz[1]) && isfinite(xyz[2])) return SQLITE_OK;
    return tiles_fail(error, "terrain %s has no place in space at %.15g, %.15g", t->terrain->name, place[0],
                      place[1]);
}

/* xyz: of each vertex. */
static void round_places(const double *xyz, size_t count, double step, block_mesh *mesh) {
    const double unit = fmax(step, 1);
    double low[3] = {HUGE_VAL, HUGE_VAL, HUGE_VAL}, high[3] = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
    for (size_t i = 0; i < 3 * count; i++) {
        low[i % 3] = fmin(low[i % 3], xyz[i]);
        high[i % 3] = fmax(high[i % 3], xyz[i]);
    }
    for (int k = 0; k < 3; k++) mesh->origin[k] = rint((low[k] + high[k]) / 2 / unit) * unit + 0.0;
    for (size_t i = 0; i < 3 * count; i++)
        mesh->offset[i] = (int32_t)(rint(xyz[i] / step) - mesh->origin[i % 3] / step);
}

static void turn_normal(const tiles *t, const rqt_patch_vertex *v, const float enu[3], int8_t out[3]) {
    const rqt_placement *at = &t->terrain->placement;
    const double lon = (at->x0 + v->col * at->dx) * DEGREE, lat = (at->y0 + v->row * at->dy) * DEGREE;
    const double east = (double)enu[0], north = (double)enu[1], up = (double)enu[2];
    const double outward = cos(lat) * up - sin(lat) * north; /* from the axis */
    out[0] = (int8_t)rint(NORMAL_UNITS * (cos(lon) * outward - sin(lon) * east));
    out[1] = (int8_t)rint(NORMAL_UNITS * (sin(lon) * outward + cos(lon) * east));
    out[2] = (int8_t)rint(NORMAL_UNITS * (cos(lat) * north + sin(lat) * up));
}

static int place_mesh(tiles *t, block_tile tile, block_mesh *mesh, char **error) {
    const rqt_patch *patch = &mesh->patch;
    const size_t count = patch->vertex_count;
    double *xyz = sqlite3_malloc64(3 * count * sizeof *xyz);
    float *normals = NULL;
    mesh->offset = sqlite3_malloc64(3 * count * sizeof *mesh->offset);
    mesh->normal = sqlite3_malloc64(3 * count * sizeof *mesh->normal);
    int code = xyz && mesh->offset && mesh->normal ? SQLITE_OK : SQLITE_NOMEM;
    for (size_t i = 0; i < count && code == SQLITE_OK; i++)
        code = place_vertex(t, &patch->vertices[i], xyz + 3 * i, error);
    if (code == SQLITE_OK) code = store_normals(t->store, t->terrain, patch, &normals, error);
    if (code == SQLITE_OK) {
        round_places(xyz, count, block_plan_of(t)->level[tile.level].step, mesh);
        for (size_t i = 0; i < count; i++)
            turn_normal(t, &patch->vertices[i], normals + 3 * i, mesh->normal + 3 * i);
    }
    sqlite3_free(normals);
    sqlite3_free(xyz);
    return code;
}

int block_mesh_make(tiles *t, block_tile tile, block_mesh *mesh, char **error) {
    *mesh = (block_mesh){0};
    int code = block_query(t, tile, 0, &mesh->patch, error);
    if (code == SQLITE_OK && mesh->patch.triangle_count > 0) code = place_mesh(t, tile, mesh, error);
    return code;
}

void block_mesh_free(tiles *t, block_mesh *mesh) {
    store_keep(t->store, &mesh->patch);
    sqlite3_free(mesh->offset);
    sqlite3_free(mesh->normal);
    *mesh = (block_mesh){0};
}
