/* mesh.c - the mesh of a tile: the terrain's own at the level's error, in the cell of a block, its corners
 * forced. And its vertices in space. Normals: normals.c.
 *
 * The rule is lowered by rank by what curvature takes; a rank of which curvature takes more than the level has to
 * give, is in whatever its errors. On the last level only that is lowered: else what has any error is in. The cell
 * is a square of the lattice, so that nothing is cut: every vertex is a sample, and its place and step
 * depend on the sample and the level alone. That is all that there is to seams. What the corners of a cell bring
 * along are corners of cells: so a level has one rule, in which those are forced that are asked for.
 *
 * At a pole a row of samples is one place: all are rounded to the same steps, but for one that lies on the very
 * edge between two; sines and cosines are off by 1e-9 m there. Around the Earth the first and the last column are
 * one (../seam.c).
 */
#include "blocks.h"
#include "earth.h"

#include <math.h>
#include <string.h>

#define BEYOND_POLE (90 * (1 + 1e-9)) /* a row at a pole, by a rounding */
#define RIM 0.5                       /* samples: any triangle at a side meets it */

/* ---------------------------------------------------------------------------------------------------- mesh -- */

static int make_rule(const tiles *t, int l, rqt_rule **rule) {
    const block_plan *plan = block_plan_of(t);
    const store_terrain *terrain = t->terrain;
    const double error = plan->level[l].error;
    double lowering[RQT_RANKS];
    for (int rank = 0; rank < RQT_RANKS; rank++) {
        const double sag = block_sag(plan, rank);
        const bool is_free = sag + terrain->quantum_error <= error;
        lowering[rank] = !is_free ? 2 * error + 1 : l == plan->finest ? error : sag;
    }
    rqt_status status = rqt_rule_create(&terrain->lattice, terrain->quantum_error, store_allocator(), rule);
    if (status == RQT_OK) status = rqt_rule_set_lowering(*rule, lowering);
    return status == RQT_OK ? SQLITE_OK : SQLITE_NOMEM;
}

static int force_corners(const tiles *t, block_tile cell, rqt_rule *rule) {
    const int32_t side = 1 << (t->terrain->lattice.K - cell.level);
    rqt_status status = RQT_OK;
    for (int corner = 0; corner < 4 && status == RQT_OK; corner++)
        status =
            rqt_rule_force(rule, (rqt_vertex){(cell.i + (corner & 1)) * side, (cell.j + (corner >> 1)) * side});
    return status == RQT_OK ? SQLITE_OK : SQLITE_NOMEM;
}

/* What a query of a level asks for. */
static store_query_options options_of(const tiles *t, int l) {
    const block_plan *plan = block_plan_of(t);
    return (store_query_options){.select = RQT_SELECT_THRESHOLD,
                                 .outline = l == plan->finest ? RQT_OUTLINE_EXACT : RQT_OUTLINE_TOL,
                                 .metric = RQT_METRIC_EXACT,
                                 .product = RQT_PRODUCT_TRIANGLES,
                                 .rule = plan->level[l].rule};
}

/* All cells at both ends first: what is forced for the seam depends on them. */
static int close_seam(tiles *t, int l, char **error) {
    const block_level *level = &block_plan_of(t)->level[l];
    const rqt_lattice *lattice = &t->terrain->lattice;
    const int scale = lattice->K - l;
    const store_query_options options = options_of(t, l);
    int code = SQLITE_OK;
    for (int32_t j = 0; j <= (lattice->height - 2) >> scale && code == SQLITE_OK; j++) {
        code = force_corners(t, (block_tile){l, 0, j}, level->rule);
        if (code == SQLITE_OK)
            code = force_corners(t, (block_tile){l, (lattice->width - 2) >> scale, j}, level->rule);
    }
    return code == SQLITE_OK ? seam_close(t, level->error, &options, error) : code;
}

/* *options: those of every query of a tile's level that asks for what lies in its cell. */
static int begin_query(tiles *t, block_tile tile, store_query_options *options, char **error) {
    block_plan *plan = block_plan_of(t);
    block_level *level = &plan->level[tile.level];
    int code = SQLITE_OK;
    if (!level->rule) {
        code = make_rule(t, tile.level, &level->rule);
        if (code == SQLITE_OK && plan->seam.q) code = close_seam(t, tile.level, error);
        if (code != SQLITE_OK) {
            rqt_rule_free(level->rule);
            level->rule = NULL;
        }
    }
    *options = options_of(t, tile.level);
    return code == SQLITE_OK ? force_corners(t, tile, level->rule) : code;
}

static int make_region(const tiles *t, block_tile tile, rqt_region **region) {
    const int32_t side = 1 << (t->terrain->lattice.K - tile.level);
    const rqt_square square = {tile.i * side, tile.j * side, side};
    const rqt_status status = rqt_region_of_squares(&square, 1, &t->terrain->lattice, store_allocator(), region);
    return status == RQT_OK ? SQLITE_OK : SQLITE_NOMEM;
}

static int query(tiles *t, block_tile tile, const rqt_region *region, rqt_patch *patch, char **error) {
    store_query_options options;
    int code = begin_query(t, tile, &options, error);
    if (code == SQLITE_OK)
        code = store_query(t->store, t->terrain, region, block_plan_of(t)->level[tile.level].error, &options, patch,
                           NULL, error);
    if (code == SQLITE_OK) (void)seam_merge(t, &block_plan_of(t)->seam, patch);
    return code;
}

int block_has_triangle(tiles *t, block_tile tile, bool *has, char **error) {
    const block_cell cell = block_cell_of(t, tile);
    const int32_t box[4] = {cell.from.x, cell.to.x, cell.from.y, cell.to.y};
    rqt_block_number last = 0;
    store_query_options options;
    const int code = begin_query(t, tile, &options, error);
    return code == SQLITE_OK
               ? tiles_has_triangle(t, box, block_plan_of(t)->level[tile.level].error, &options, &last, has, error)
               : code;
}

/* Where those triangles lie. Returns how many boxes. */
static int list_boxes(const tiles *t, block_tile tile, int part, double boxes[4][4]) {
    const block_cell cell = block_cell_of(t, tile);
    const double x0 = cell.from.x, x1 = cell.to.x, y0 = cell.from.y, y1 = cell.to.y, wide = RIM;
    const int32_t last = t->terrain->lattice.width - 1;
    const double rim[4][4] = {{x0 - wide, x1 + wide, y0 - wide, y0},
                              {x0 - wide, x0, y0, y1},
                              {x1, x1 + wide, y0, y1},
                              {x0 - wide, x1 + wide, y1, y1 + wide}};
    const double ends[2][4] = {{last - wide, last, y0 - wide, y1 + wide}, {0, wide, y0 - wide, y1 + wide}};
    if (part == AROUND_CELL) {
        memcpy(boxes, rim, sizeof rim);
        return 4;
    }
    if (!block_plan_of(t)->seam.q || (part == AT_LAST_COLUMN ? cell.from.x > 0 : cell.to.x < last)) return 0;
    memcpy(boxes, ends[part == AT_FIRST_COLUMN], sizeof ends[0]);
    return 1;
}

int block_mesh_around(tiles *t, block_tile tile, int part, rqt_patch *patch, char **error) {
    double boxes[4][4];
    rqt_region *region = NULL;
    const int count = list_boxes(t, tile, part, boxes);
    if (count == 0) return SQLITE_OK;
    int code = tiles_region(t, boxes, count, &region);
    for (int n = 0; n < 9 && code == SQLITE_OK; n++) {
        const block_tile near = {tile.level, tile.i + n % 3 - 1, tile.j + n / 3 - 1};
        if (block_exists(t, near)) code = force_corners(t, near, block_plan_of(t)->level[tile.level].rule);
    }
    if (code == SQLITE_OK) code = query(t, tile, region, patch, error);
    rqt_region_free(region);
    return code;
}

/* ------------------------------------------------------------------------------------------------ in space -- */

typedef struct angles {
    earth_angles lon, lat;
} angles;

double block_longitude(const tiles *t, int32_t col) {
    const rqt_placement *at = &t->terrain->placement;
    const bool is_first = block_plan_of(t)->seam.q && col == t->terrain->lattice.width - 1;
    return is_first ? at->x0 : at->x0 + col * at->dx;
}

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

static int place_all(const tiles *t, const rqt_patch *patch, double *xyz, char **error) {
    const rqt_placement *at = &t->terrain->placement;
    angles *known = sqlite3_malloc64(sizeof *known);
    if (!known) return SQLITE_NOMEM;
    int code = SQLITE_OK;
    earth_angles_clear(&known->lon);
    earth_angles_clear(&known->lat);
    for (size_t i = 0; i < patch->vertex_count && code == SQLITE_OK; i++) {
        const rqt_patch_vertex *v = &patch->vertices[i];
        const earth_angle *lon = earth_angle_of(&known->lon, v->col, block_longitude(t, v->col)),
                          *lat = earth_angle_of(&known->lat, v->row, latitude(at, v->row));
        code = place_vertex(t, v, lon, lat, xyz + 3 * i, error);
    }
    sqlite3_free(known);
    return code;
}

/* xyz: of each vertex. */
static void choose_origin(const double *xyz, size_t count, double step, double origin[3]) {
    const double unit = fmax(step, 1);
    double low[3], high[3];
    memcpy(low, xyz, sizeof low);
    memcpy(high, xyz, sizeof high);
    for (size_t i = 1; i < count; i++)
        for (int k = 0; k < 3; k++) {
            const double x = xyz[3 * i + (size_t)k];
            if (x < low[k]) low[k] = x;
            if (x > high[k]) high[k] = x;
        }
    for (int k = 0; k < 3; k++) origin[k] = rint((low[k] + high[k]) / 2 / unit) * unit + 0.0;
}

int block_places(const tiles *t, const rqt_patch *patch, double step, double *origin, bool has_origin,
                 int32_t **offset, char **error) {
    const size_t count = patch->vertex_count;
    double *xyz = sqlite3_malloc64((3 * count + 1) * sizeof *xyz);
    *offset = sqlite3_malloc64((3 * count + 1) * sizeof **offset);
    int code = xyz && *offset ? place_all(t, patch, xyz, error) : SQLITE_NOMEM;
    if (code == SQLITE_OK && !has_origin) choose_origin(xyz, count, step, origin);
    const double steps = 1 / step, from[3] = {origin[0] * steps, origin[1] * steps, origin[2] * steps};
    for (size_t i = 0; i < count && code == SQLITE_OK; i++)
        for (size_t k = 0; k < 3; k++) (*offset)[3 * i + k] = (int32_t)(rint(xyz[3 * i + k] * steps) - from[k]);
    sqlite3_free(xyz);
    return code;
}

int block_mesh_make(tiles *t, block_tile tile, block_mesh *mesh, char **error) {
    rqt_region *region = NULL;
    *mesh = (block_mesh){0};
    int code = make_region(t, tile, &region);
    if (code == SQLITE_OK) code = query(t, tile, region, &mesh->patch, error);
    rqt_region_free(region);
    if (code != SQLITE_OK || mesh->patch.triangle_count == 0) return code;
    code = block_places(t, &mesh->patch, block_plan_of(t)->level[tile.level].step, mesh->origin, false,
                        &mesh->offset, error);
    if (code == SQLITE_OK) code = block_normals(t, tile, mesh, error);
    return code;
}

void block_mesh_free(tiles *t, block_mesh *mesh) {
    store_keep(t->store, &mesh->patch);
    sqlite3_free(mesh->offset);
    sqlite3_free(mesh->normal);
    *mesh = (block_mesh){0};
}
