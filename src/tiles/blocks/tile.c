/* tile.c - what is known of a tile without a block being read: whether it is there, what it is off, where it
 * lies.
 *
 * Off. All vertices of a closed cell but its corners descend from its centre, so none has an error above the
 * centre's, e, which the index has (store_find_relief); and no leaf is larger than the two halves of the cell. So
 * the mesh of the tile is off by no more than
 *
 *     min( E(l), quantum_error + e + sag(rank of the centre) )  +  rounding
 *
 * which a tile of sea or plain has less of than its level. From tile to tile below neither part grows: E does not,
 * e is that of a vertex of the larger cell, and cells become smaller; nor does rounding.
 *
 * Where. Samples of the cell lie between the heights that its summary tells, above the geoid if it is that: those
 * of the geoid are within its slopes of the one in the middle. But a triangle that is flat in space sinks below
 * its corners, and bulges towards the pole, by what curvature takes: never more than `swell`, for a place of it is
 * within that of the same place on the mesh that is straight in longitude, latitude and height, which lies in the
 * box of its corners. It does not bulge to the east or west: a wedge between two meridians less than half a turn
 * apart is convex; a wider one counts as the whole turn. A skirt hangs further down, and leans to the north or
 * south by twice what a chord bulges, at most. Each of these widenings shrinks from a tile to those below it.
 */
#include "blocks.h"
#include "earth.h"

#include <math.h>

/* A move of m metres changes a latitude by less than m / this radians, while that is small; else any is possible.
 */
#define NARROW 4.0e6
#define FAR 1.0e6
#define ROUNDED 1e-9 /* degrees: a raster that ends at the antimeridian, but for its doubles */

block_tile block_tile_of(int level, int32_t x, int32_t y) {
    return (block_tile){level, x, (int32_t)((INT64_C(1) << level) - 1 - y)};
}

static rqt_block_number number_of(block_tile tile) {
    return rqt_block_number_of(tile.level, tile.i, tile.j);
}

bool block_exists(const tiles *t, block_tile tile) {
    rqt_block_place place;
    if (tile.level > block_plan_of(t)->finest || tile.i < 0 || tile.j < 0) return false;
    if (tile.i >> tile.level || tile.j >> tile.level) return false;
    return rqt_block_locate(&t->terrain->lattice, t->terrain->k, number_of(tile), &place) == RQT_OK;
}

block_cell block_cell_of(const tiles *t, block_tile tile) {
    const rqt_lattice *lattice = &t->terrain->lattice;
    const int32_t side = 1 << (lattice->K - tile.level);
    const rqt_vertex from = {tile.i * side, tile.j * side};
    return (block_cell){from, rqt_vertex_clamp(lattice, (rqt_vertex){from.x + side, from.y + side})};
}

int block_has_content(tiles *t, block_tile tile, const store_relief *relief, bool *has, char **error) {
    const rqt_lattice *lattice = &t->terrain->lattice;
    *has = relief->is_valid && lattice->width > 1 && lattice->height > 1;
    return relief->is_mixed ? block_has_triangle(t, tile, has, error) : SQLITE_OK;
}

int block_relief(tiles *t, block_tile tile, store_relief *relief, char **error) {
    return store_find_relief(t->store, t->terrain, number_of(tile), relief, error);
}

int block_relief_from_root(tiles *t, block_tile tile, store_relief *relief, char **error) {
    int code = SQLITE_OK;
    *relief = store_relief_of_all(t->terrain);
    for (int l = 0; l <= tile.level && code == SQLITE_OK; l++) {
        const int up = tile.level - l;
        code = block_relief(t, (block_tile){l, tile.i >> up, tile.j >> up}, relief, error);
    }
    return code;
}

double block_error(const tiles *t, block_tile tile, const store_relief *relief) {
    const block_level *level = &block_plan_of(t)->level[tile.level];
    const double own = t->terrain->quantum_error + rqt_code_metres(relief->error) + level->centre;
    return fmin(level->error, own) * (1 + 1e-12) + level->round;
}

void block_rectangle(double west, double south, double east, double north, double region[4]) {
    const double width = east - west;
    const bool is_around = width >= 360;
    if (west < -180 || west > 180) west -= 360 * floor((west + 180) / 360);
    east = west + width;
    if (east > 180) east = east < 180 + ROUNDED ? 180 : east - 360;
    region[0] = (is_around ? -180 : west) * DEGREE;
    region[1] = fmax(south, -90) * DEGREE;
    region[2] = (is_around ? 180 : east) * DEGREE;
    region[3] = fmin(north, 90) * DEGREE;
}

/* Heights of the geoid in a box: *low .. *high. */
static void find_geoid(const block_plan *plan, const double box[4], double *low, double *high) {
    const double middle[3] = {(box[0] + box[2]) / 2, (box[1] + box[3]) / 2, 0};
    const double at = geo_frame_height(plan->frame, middle);
    const double most = plan->geoid.most;
    const double by =
        plan->geoid.lon_slope * (box[2] - box[0]) / 2 + plan->geoid.lat_slope * (box[3] - box[1]) / 2 + 1e-9;
    *low = isfinite(at) ? fmax(at - by, -most) : -most;
    *high = isfinite(at) ? fmin(at + by, most) : most;
}

void block_region(const tiles *t, block_tile tile, const store_relief *relief, double region[6]) {
    const block_plan *plan = block_plan_of(t);
    const block_level *level = &plan->level[tile.level];
    const rqt_placement *at = &t->terrain->placement;
    const block_cell cell = block_cell_of(t, tile);
    const double box[4] = {at->x0 + cell.from.x * at->dx, at->y0 + cell.to.y * at->dy, at->x0 + cell.to.x * at->dx,
                           at->y0 + cell.from.y * at->dy};
    const double swell = fmin(level->centre, level->error), moved = swell + level->round;
    double low = 0, high = 0;
    if (plan->geoid.most > 0) find_geoid(plan, box, &low, &high);
    const double bulge = (2 * moved < FAR ? 2 * moved / NARROW : M_PI) / DEGREE;
    const bool is_wide = box[2] - box[0] > 180;
    block_rectangle(is_wide ? -180 : box[0], box[1] - bulge, is_wide ? 180 : box[2], box[3] + bulge, region);
    region[4] = relief->lowest + low - moved - block_skirt_depth(t, tile);
    region[5] = relief->highest + high + moved;
}
