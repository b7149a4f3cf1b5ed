/* mesh.c - the mesh of a tile: the terrain's own at the level's error, in the cell of a block, its corners
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
#include "blocks.h"
#include "earth.h"

#include <math.h>

#define BEYOND_POLE (90 * (1 + 1e-9)) /* a row at a pole, by a rounding */
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

/* What to ask for the mesh of a cell. Released by end_query, whatever came of it. */
typedef struct cell_query {
    rqt_region *region;
    store_query_options options;
} cell_query;

static int begin_query(const tiles *t, block_tile tile, cell_query *q) {
    const int32_t side = 1 << (t->terrain->lattice.K - tile.level);
    const rqt_square square = {tile.i * side, tile.j * side, side};
    const bool is_last = tile.level == block_plan_of(t)->finest;
    *q = (cell_query){.options = {.select = RQT_SELECT_THRESHOLD,
                                  .outline = is_last ? RQT_OUTLINE_EXACT : RQT_OUTLINE_TOL,
                                  .metric = RQT_METRIC_EXACT,
                                  .product = RQT_PRODUCT_TRIANGLES}};
    const int code = make_rule(t, tile, &q->options.rule);
    if (code != SQLITE_OK) return code;
    const rqt_status status =
        rqt_region_of_squares(&square, 1, &t->terrain->lattice, store_allocator(), &q->region);
    return status == RQT_OK ? SQLITE_OK : SQLITE_NOMEM;
}

static void end_query(cell_query *q) {
    rqt_region_free(q->region);
    rqt_rule_free(q->options.rule);
}

static int query(tiles *t, block_tile tile, rqt_patch *patch, char **error) {
    cell_query q;
    int code = begin_query(t, tile, &q);
    if (code == SQLITE_OK)
        code = store_query(t->store, t->terrain, q.region, block_plan_of(t)->level[tile.level].error, &q.options,
                           patch, NULL, error);
    end_query(&q);
    return code;
}

int block_has_triangle(tiles *t, block_tile tile, bool *has, char **error) {
    const int32_t side = 1 << (t->terrain->lattice.K - tile.level), x = tile.i * side, y = tile.j * side;
    const int32_t box[4] = {x, x + side, y, y + side};
    rqt_block_number last = 0;
    cell_query q;
    int code = begin_query(t, tile, &q);
    if (code == SQLITE_OK)
        code = tiles_has_triangle(t, box, block_plan_of(t)->level[tile.level].error, &q.options, &last, has, error);
    end_query(&q);
    return code;
}

/* ------------------------------------------------------------------------------------------------ in space -- */

typedef struct angles {
    earth_angles lon, lat;
} angles;

static double latitude(const rqt_placement *at, int32_t row) {
    const double degrees = at->y0 + row * at->dy;
    return fabs(degrees) > 90 && fabs(degrees) <= BEYOND_POLE ? copysign(90, degrees) : degrees;
}

static int place_vertex(const tiles *t, const rqt_patch_vertex *v, const earth_angle *lon, const earth_angle *lat,
                        double xyz[3], char **error) {
    const double place[3] = {lon->degrees, lat->degrees, rqt_unit_metres(&t->terrain->unit, v->q)};
    earth_place(lon, lat, geo_frame_height(block_plan_of(t)->frame, place), xyz);
    if (fabs(lat->degrees) <= 90 && isfinite(xyz[0]) && isfinite(xyz[1]) && isfinite(xyz[2])) return SQLITE_OK;
    return tiles_fail(error, "terrain %s has no place in space at %.15g, %.15g", t->terrain->name, lon->degrees,
                      lat->degrees);
}

static void turn_normal(const earth_angle *lon, const earth_angle *lat, const float enu[3], int8_t out[3]) {
    double normal[3];
    earth_turn(lon, lat, (const double[3]){(double)enu[0], (double)enu[1], (double)enu[2]}, normal);
    for (int k = 0; k < 3; k++) out[k] = (int8_t)rint(NORMAL_UNITS * normal[k]);
}

static int place_all(const tiles *t, const float *enu, angles *known, double *xyz, block_mesh *mesh, char **error) {
    const rqt_placement *at = &t->terrain->placement;
    int code = SQLITE_OK;
    earth_angles_clear(&known->lon);
    earth_angles_clear(&known->lat);
    for (size_t i = 0; i < mesh->patch.vertex_count && code == SQLITE_OK; i++) {
        const rqt_patch_vertex *v = &mesh->patch.vertices[i];
        const earth_angle *lon = earth_angle_of(&known->lon, v->col, at->x0 + v->col * at->dx),
                          *lat = earth_angle_of(&known->lat, v->row, latitude(at, v->row));
        code = place_vertex(t, v, lon, lat, xyz + 3 * i, error);
        turn_normal(lon, lat, enu + 3 * i, mesh->normal + 3 * i);
    }
    return code;
}

/* xyz: of each vertex. */
static void round_places(const double *xyz, size_t count, double step, block_mesh *mesh) {
    const double unit = fmax(step, 1);
    for (int k = 0; k < 3; k++) {
        double low = xyz[k], high = xyz[k];
        for (size_t i = 1; i < count; i++) {
            low = fmin(low, xyz[3 * i + (size_t)k]);
            high = fmax(high, xyz[3 * i + (size_t)k]);
        }
        mesh->origin[k] = rint((low + high) / 2 / unit) * unit + 0.0;
        for (size_t i = 0; i < count; i++)
            mesh->offset[3 * i + (size_t)k] =
                (int32_t)(rint(xyz[3 * i + (size_t)k] / step) - mesh->origin[k] / step);
    }
}

static int place_mesh(tiles *t, block_tile tile, block_mesh *mesh, char **error) {
    const size_t count = mesh->patch.vertex_count;
    double *xyz = sqlite3_malloc64(3 * count * sizeof *xyz);
    angles *known = sqlite3_malloc64(sizeof *known);
    float *enu = NULL;
    mesh->offset = sqlite3_malloc64(3 * count * sizeof *mesh->offset);
    mesh->normal = sqlite3_malloc64(3 * count * sizeof *mesh->normal);
    int code = xyz && known && mesh->offset && mesh->normal ? SQLITE_OK : SQLITE_NOMEM;
    if (code == SQLITE_OK) code = store_normals(t->store, t->terrain, &mesh->patch, &enu, error);
    if (code == SQLITE_OK) code = place_all(t, enu, known, xyz, mesh, error);
    if (code == SQLITE_OK) round_places(xyz, count, block_plan_of(t)->level[tile.level].step, mesh);
    sqlite3_free(enu);
    sqlite3_free(known);
    sqlite3_free(xyz);
    return code;
}

int block_mesh_make(tiles *t, block_tile tile, block_mesh *mesh, char **error) {
    *mesh = (block_mesh){0};
    int code = query(t, tile, &mesh->patch, error);
    if (code == SQLITE_OK && mesh->patch.triangle_count > 0) code = place_mesh(t, tile, mesh, error);
    return code;
}

void block_mesh_free(tiles *t, block_mesh *mesh) {
    store_keep(t->store, &mesh->patch);
    sqlite3_free(mesh->offset);
    sqlite3_free(mesh->normal);
    *mesh = (block_mesh){0};
}
