/* plan.c - what all tiles of a terrain have in common: how far each level is off, and the steps in which its
 * vertices are placed.
 *
 * The mesh of a level. A tile is the cell of a stored block; the mesh of a level is one mesh of the terrain, by one
 * rule, in which the corners of all cells of the level are forced (mesh.c): then no leaf crosses the side of
 * a cell, and tiles of a level are parts of one mesh, edge for edge. What is forced by a cell's corners are corners
 * of cells, so each tile forces its own and nothing else. Vertices are samples as they are stored.
 *
 * How far it is off. In space a leaf whose split vertex has the rank r is off by its vertical error, and by sag(r),
 * what the Earth's curvature takes from flat triangles (geo_frame_sag), and where float heights were rounded by
 * quantum_error. The rule splits whatever would be off by more than the level's error,
 *
 *     E(l) = quantum_error + B(l) + max( em(l + 2), min( em(l), stride(l) / 4 ) )
 *
 *     em(l)      the largest error of any vertex finer than the grid of blocks of level l: by the index
 *     B(l)       what curvature may take: as much as from a quarter of a square of four strides, or half a quantum
 *                of heights; on the last level from half a square of one sample, or 5 cm if that is less than the
 *                first: sea and plain have no more triangles than they need
 *     stride(l)  metres between neighbours of that grid
 *
 * At em(l) the mesh of a tile is of its block's own grid, and part of that. But em(l) is that of the worst place: a
 * spike, a cliff, and the outline of voids, whose error is ground, would make all of a level coarse. So E is no
 * more than a quarter of a stride, a 512th of a tile's side with blocks of 128, and in such places the mesh goes on
 * to what is finer, as far as the grid of the blocks two levels below: a tile has at most so many vertices,
 * whatever the terrain. Less than em(l) is of no use to clients, who have the next level for that, and takes more
 * triangles than the grid has: at max( em(l + 1), em(l) / 4 ) a fractal of 4097 x 4097 took 53,000 for its root
 * instead of 16,000. Measured, triangles a tile on all levels but the last, the means of levels: 4200 to 16,000 for
 * that; of squares of one degree, 1201 x 1201 samples, 1000 to 2300 in New Hampshire and 6700 to 10,800 in the
 * Andes, which have no voids; 16,000 to 48,000 in the Alps, where 7 % of the samples are voids, scattered. The last
 * level is the terrain: every vertex with an error is in, and the outline of voids is exact. E does not grow from
 * level to level, as em, B and strides do not.
 *
 * em(l) only says what to ask for. That nothing is off by more than E(l) is what the rule sees to, block by block:
 * an index that lies changes how large tiles are, and not what is true.
 *
 * Steps. Geocentric coordinates of a level are whole multiples of one step, a power of two: then what two tiles
 * share is the same number in both, and floats hold the steps from a tile's origin exactly, as they are fewer than
 * 2^24. The step is the least, from 2^-13 m on, for which no tile of the level is larger than that. Rounding moves
 * a vertex by no more than sqrt(3)/2 step, and so any place of a triangle.
 */
#include "blocks.h"
#include "earth.h"

#include <math.h>
#include <string.h>

#define GEOID_HIGHEST 120.0 /* EGM96 lies between -107 and 86 */
enum { FIRST_STEP = -13, STEP_BITS = 24, FINER = 2 };
#define STRIDES_PER_ERROR 4
#define FREE 0.05 /* metres */
#define DEEPEST (EARTH_B / 2)
#define DOUBLES 1e-7 /* metres: doubles of places in space, a dozen operations */

double block_sag(const block_plan *plan, int rank) {
    return plan->sag[rank < -1 ? 1 : rank >= RQT_RANKS ? RQT_RANKS + 1 : rank + 2];
}

static void set_error(const store_terrain *t, const double em[TILES_LEVELS + FINER], int l, block_plan *plan) {
    const int scale = t->lattice.K - t->k - l; /* of the stride */
    const double quantum = fabs(rqt_unit_factor(&t->unit)) / t->unit.d;
    const double wide = block_sag(plan, 2 * scale + 2), least = block_sag(plan, 2 * scale - 1);
    const double curved = fmax(quantum / 2, l < plan->finest ? wide : fmax(least, fmin(wide, FREE)));
    const double ground = ldexp(t->cost.cell, scale) / STRIDES_PER_ERROR;
    const double terrain = l == plan->finest ? 0 : fmax(em[l + FINER], fmin(em[l], ground));
    plan->level[l].error = t->quantum_error + curved + terrain;
    plan->level[l].centre = block_sag(plan, 2 * (t->lattice.K - l - 1) + 1);
}

/* The longest that a tile's mesh can be in space. */
static double size_of_tiles(const store_terrain *t, const geo_extent *e, int l) {
    const int32_t side = 1 << (t->lattice.K - l);
    const double height = fmax(fabs(e->lowest), fabs(e->highest)) + GEOID_HIGHEST;
    const double columns = fmin(side, t->lattice.width - 1), rows = fmin(side, t->lattice.height - 1);
    const double ground = (EARTH_CURVED + height) * DEGREE * hypot(columns * e->lon_step, rows * e->lat_step);
    return fmin(ground, 2 * (EARTH_CURVED + height)) + e->highest - e->lowest + 2 * GEOID_HIGHEST;
}

/* What two sides on a line differ by is no more than a level's error and what rounding moves either; the end of a
 * wall is rounded too. Twice that: skirt.c. Levels whose triangles go through the Earth have walls that stay in it.
 */
static void set_step(block_level *level, double step, double merging) {
    const double rounding = step * sqrt(3) / 2 * (1 + 1e-9) + DOUBLES;
    level->step = step;
    level->round = rounding + merging;
    level->wall = fmin(2 * (level->error + 3 * rounding), DEEPEST); /* both columns have the same heights */
}

static void set_levels(const store_terrain *t, const rqt_code largest[RQT_MAX_K + 1], block_plan *plan) {
    const geo_extent e = tiles_extent(t);
    double em[TILES_LEVELS + FINER] = {0};
    for (int l = 0; l <= plan->finest; l++) em[l] = rqt_code_metres(largest[l]);
    for (int l = 0; l <= plan->finest; l++) {
        block_level *level = &plan->level[l];
        set_error(t, em, l, plan);
        const double size = size_of_tiles(t, &e, l);
        double step = ldexp(1, FIRST_STEP);
        set_step(level, step, plan->seam.merging);
        /* Half of it to either side; the origin may be off the middle by half a metre or a step; walls hang down
         * from there, and lean out by as much at most. */
        while ((size / 2 + 2 + 2 * step + (l > 0 ? 1.5 * plan->level[1].wall : 0)) / step >= ldexp(1, STEP_BITS))
            set_step(level, step *= 2, plan->seam.merging);
    }
}

static int make_frame(const store_terrain *t, bool is_above_geoid, block_plan *plan, char **error) {
    char why[256] = "";
    const geo_ellipsoid wgs84 = GEO_WGS84;
    geo_extent extent = tiles_extent(t);
    const int made = geo_frame_create(GEO_ECEF, &wgs84, 0, 0, is_above_geoid, &plan->frame, why, sizeof why);
    if (made != GEO_OK)
        return made == GEO_NO_MEMORY ? SQLITE_NOMEM
                                     : tiles_fail(error, "terrain %s has no tiles: %s", t->name, why);
    plan->geoid = geo_frame_geoid(plan->frame, &extent);
    extent.lon_step /= 2; /* all ranks are two more in a grid of half the step */
    extent.lat_step /= 2;
    geo_frame_sag(plan->frame, &extent, RQT_RANKS + 2, plan->sag);
    for (int rank = 0; rank < RQT_RANKS + 2; rank++)
        if (!isfinite(plan->sag[rank]))
            return tiles_fail(error, "terrain %s has no tiles: it is too large", t->name);
    return SQLITE_OK;
}

int block_plan_create(tiles *t, void **out, char **error) {
    const store_terrain *terrain = t->terrain;
    rqt_code largest[RQT_MAX_K + 1];
    bool is_above_geoid;
    int code = tiles_check_place(terrain, error);
    if (code == SQLITE_OK) code = tiles_check_heights(terrain, &is_above_geoid, error);
    if (code == SQLITE_OK) code = store_level_errors(t->store, terrain, largest, error);
    if (code != SQLITE_OK) return code;
    block_plan *plan = sqlite3_malloc(sizeof *plan);
    if (!plan) return SQLITE_NOMEM;
    *plan = (block_plan){.finest = terrain->lattice.K - terrain->k};
    code = make_frame(terrain, is_above_geoid, plan, error);
    if (code == SQLITE_OK) code = seam_read(t, &plan->seam, error);
    if (code == SQLITE_OK) {
        set_levels(terrain, largest, plan);
        *out = plan;
    } else {
        block_plan_free(plan);
    }
    return code;
}

void block_plan_free(void *made) {
    block_plan *plan = made;
    if (!plan) return;
    geo_frame_free(plan->frame);
    for (int l = 0; l < TILES_LEVELS; l++) rqt_rule_free(plan->level[l].rule);
    for (int series = 0; series < BLOCK_SERIES; series++)
        for (int l = 0; l < TILES_LEVELS; l++) sqlite3_free(plan->ranges[series][l]);
    seam_free(&plan->seam);
    sqlite3_free(plan);
}
