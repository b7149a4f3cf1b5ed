/* plan.c - what all tiles of a terrain have in common: levels and their tolerances, the steps of heights, and where
 * a tile lies on the raster.
 *
 * Levels. Clients do not ask how far a tile is off: they take level z to be off by
 *
 *     G(z) = 2 pi a / 4 / (65 * 2 * 2^z) = 77067 m / 2^z
 *
 * (a = 6378137 m; what a grid of 65 x 65 heights is reckoned to be off, with two tiles at level 0), and draw a tile
 * as long as that is no more than a pixel or two. So eps(z) = G(z) - move(z), where move(z) is the most that
 * quantisation moves a vertex (mesh.c): then what is promised is true at every level, whatever the terrain. The
 * last level, the first whose tiles are no more than 64 samples a side, is as fine as clients get to see: its eps
 * is LAST_EPS quanta of the terrain's heights where that is less, and the mesh is the terrain, to a rounding of
 * heights. Levels end before that where quantisation, or what the terrain's own heights were rounded by, would
 * leave a mesh no room in G(z). Voids may ask for less at the first levels (keep_ground).
 *
 * One eps at a level, one rule, one mesh: tiles are parts of it. The rule is lowered by what the Earth's curvature
 * takes from flat triangles (geo_frame_sag), as option frame does, for clients draw chords in space.
 *
 * Heights. All tiles of all levels have the same lowest height and the same step, a power of two: the least for
 * which TILE_UNITS steps hold the terrain. So a height that two tiles share is the same number in both, and
 * whatever decodes it gets the same double twice. Both ends of the range fit a float, as they are stored: they are
 * less than 2^24 steps.
 *
 * Where a tile lies. Its sides are at longitudes and latitudes that are doubles exactly; in samples they are
 * rounded, and once more to 2^-20 sample, as regions are: functions of the side alone, so that neighbours have it
 * in common.
 */
#include "earth.h"
#include "quantized_mesh.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define GEOID_HIGHEST 120.0 /* EGM96 lies between -107 and 86 */
#define ROOT_ERROR (EARTH_A * 2 * M_PI * 0.25 / (65 * 2))
enum { LARGEST_TILE = 64, FIRST_STEP = -10, UNIT_BITS = 20 };
#define LAST_EPS 0.625              /* quanta of height */
#define FARTHEST ((int64_t)1 << 60) /* units: as regions have it */

/* ------------------------------------------------------------------------------------------------- levels -- */

/* A rule like the plan's. */
static int make_plain_rule(const tiles *t, rqt_rule **rule, char **error) {
    rqt_status status = rqt_rule_create(&t->terrain->lattice, t->terrain->quantum_error, store_allocator(), rule);
    if (status == RQT_OK) status = rqt_rule_set_lowering(*rule, plan_of(t)->lowering);
    return status == RQT_OK          ? SQLITE_OK
           : status == RQT_NO_MEMORY ? SQLITE_NOMEM
                                     : tiles_fail(error, "terrain %s is too large for tiles", t->terrain->name);
}

/* The rule, lowered; what is known of the geoid. */
static int make_rule(tiles *t, bool is_above_geoid, char **error) {
    tile_plan *plan = plan_of(t);
    char why[256] = "";
    const geo_ellipsoid wgs84 = GEO_WGS84;
    const geo_extent extent = tiles_extent(t->terrain);
    geo_frame *frame = NULL;
    const int made = geo_frame_create(GEO_ECEF, &wgs84, 0, 0, is_above_geoid, &frame, why, sizeof why);
    if (made != GEO_OK)
        return made == GEO_NO_MEMORY ? SQLITE_NOMEM
                                     : tiles_fail(error, "terrain %s has no tiles: %s", t->terrain->name, why);
    geo_frame_sag(frame, &extent, RQT_RANKS, plan->lowering);
    plan->undulation = geo_frame_geoid(frame, &extent);
    if (is_above_geoid)
        plan->geoid = frame;
    else
        geo_frame_free(frame);
    return make_plain_rule(t, &plan->rule, error);
}

static void set_heights(const store_terrain *t, tile_plan *plan) {
    const geo_extent extent = tiles_extent(t);
    const double low = extent.lowest - plan->undulation.most, high = extent.highest + plan->undulation.most;
    plan->step = ldexp(1, FIRST_STEP);
    for (;; plan->step *= 2) {
        plan->lowest = floor(low / plan->step) * plan->step;
        if ((high - plan->lowest) / plan->step > TILE_UNITS) continue;
        if (fabs(plan->lowest) / plan->step + TILE_UNITS < 1 << 24) break;
    }
    plan->radius = EARTH_CURVED + fmax(fabs(low), fabs(high)) + (plan->geoid ? GEOID_HIGHEST : 0);
}

static int set_levels(const store_terrain *t, tile_plan *plan, char **error) {
    const double sample = fmin(t->placement.dx, -t->placement.dy);
    const double quantum = fabs(rqt_unit_factor(&t->unit)) / t->unit.d;
    for (int z = 0; z < TILES_LEVELS; z++) {
        tile_level *level = &plan->level[z];
        const double side = ldexp(180, -z), unit = side * DEGREE / TILE_UNITS * plan->radius;
        const double move = hypot(M_SQRT2 * unit, plan->step / 2 + plan->seam.merging);
        level->geometric_error = ldexp(ROOT_ERROR, -z);
        const double least = fmax(2 * move, plan->rounded + move);
        if (z > 0 && least > level->geometric_error) break; /* finer than heights are told */
        plan->finest = z;
        level->eps = level->geometric_error - move;
        if (side > LARGEST_TILE * sample) continue;
        level->eps = fmin(level->eps, quantum * LAST_EPS);
        break;
    }
    /* So it is at all levels if it is at the first. */
    if (plan->level[0].eps > 0) return SQLITE_OK;
    return tiles_fail(error, "terrain %s has no tiles: its heights, %g to %g m, are none of the Earth's", t->name,
                      plan->lowest, plan->lowest + TILE_UNITS * plan->step);
}

/* Voids: an eps as large as what is left of a terrain would leave no triangle of it, and clients who find nothing
 * at the first level look no further. So eps is halved until there is one. */
static int keep_ground(tiles *t, char **error) {
    tile_plan *plan = plan_of(t);
    const double cell = fmax(t->terrain->placement.dx, -t->terrain->placement.dy) * DEGREE * EARTH_A;
    const int32_t all[4] = {0, t->terrain->lattice.width - 1, 0, t->terrain->lattice.height - 1};
    const store_query_options options = plan_options(t, 0);
    bool is_there = false;
    if (t->terrain->voids == 0 || plan->ground.is_known) return SQLITE_OK;
    if (plan->ground.eps == 0) plan->ground.eps = plan->level[0].eps;
    for (;;) {
        const int code =
            tiles_has_triangle(t, all, plan->ground.eps, &options, &plan->ground.last, &is_there, error);
        if (code != SQLITE_OK) return code;
        if (is_there || plan->ground.eps <= cell / 2) break; /* finer outlines have no more */
        plan->ground.eps /= 2;
        plan->ground.last = 0;
    }
    for (int z = 0; z <= plan->finest && is_there; z++)
        plan->level[z].eps = fmin(plan->level[z].eps, plan->ground.eps);
    plan->ground.is_known = true;
    return SQLITE_OK;
}

/* Around the Earth levels have rules of their own: those that have none yet. */
static int close_seam(tiles *t, char **error) {
    tile_plan *plan = plan_of(t);
    int code = SQLITE_OK;
    for (int z = 0; z <= plan->finest && plan->seam.q && code == SQLITE_OK; z++) {
        store_query_options options = plan_options(t, z);
        rqt_rule *rule = NULL;
        if (plan->level[z].rule) continue;
        code = make_plain_rule(t, &rule, error);
        options.rule = rule;
        if (code == SQLITE_OK) code = seam_close(t, plan->level[z].eps, &options, error);
        if (code == SQLITE_OK)
            plan->level[z].rule = rule;
        else
            rqt_rule_free(rule);
    }
    return code;
}

/* What takes no time. */
static int begin_plan(tiles *t, tile_plan **out, char **error) {
    const store_terrain *terrain = t->terrain;
    bool is_above_geoid;
    int code = tiles_check_place(terrain, error);
    if (code == SQLITE_OK) code = tiles_check_heights(terrain, &is_above_geoid, error);
    if (code != SQLITE_OK) return code;
    tile_plan *plan = sqlite3_malloc(sizeof *plan);
    if (!plan) return SQLITE_NOMEM;
    *plan = (tile_plan){.rounded = terrain->quantum_error};
    t->plan = plan;
    code = make_rule(t, is_above_geoid, error);
    if (code == SQLITE_OK) code = seam_read(t, &plan->seam, error);
    if (code == SQLITE_OK) {
        set_heights(terrain, plan);
        code = set_levels(terrain, plan, error);
    }
    if (code == SQLITE_OK) code = water_read(t, plan, error);
    t->plan = NULL;
    if (code != SQLITE_OK)
        plan_free(plan);
    else
        *out = plan;
    return code;
}

int plan_create(tiles *t, void **out, char **error) {
    tile_plan *plan = *out;
    int code = plan ? SQLITE_OK : begin_plan(t, &plan, error);
    if (code != SQLITE_OK) return code;
    t->plan = *out = plan;
    code = keep_ground(t, error);
    if (code == SQLITE_OK) code = close_seam(t, error);
    t->plan = NULL;
    if (code == SQLITE_OK || (code & 0xFF) == SQLITE_INTERRUPT) return code;
    plan_free(plan);
    *out = NULL;
    return code;
}

void plan_free(void *made) {
    tile_plan *plan = made;
    if (!plan) return;
    rqt_rule_free(plan->rule);
    geo_frame_free(plan->geoid);
    sqlite3_free(plan->sea);
    seam_free(&plan->seam);
    for (int z = 0; z < TILES_LEVELS; z++) {
        rqt_rule_free(plan->level[z].rule);
        sqlite3_free(plan->ranges[z]);
        layer_search_free(plan->search[z]);
    }
    sqlite3_free(plan);
}

store_query_options plan_options(const tiles *t, int z) {
    const tile_plan *plan = plan_of(t);
    return (store_query_options){.select = RQT_SELECT_THRESHOLD,
                                 .outline = RQT_OUTLINE_TOL,
                                 .metric = RQT_METRIC_EXACT,
                                 .product = RQT_PRODUCT_TRIANGLES,
                                 .rule = plan->level[z].rule ? plan->level[z].rule : plan->rule};
}

/* ------------------------------------------------------------------------------------------------- places -- */

static double samples(double coordinate, double origin, double step) {
    return (coordinate - origin) / step;
}

/* As regions round. */
static int64_t units(double of_samples) {
    const double n = ldexp(of_samples, UNIT_BITS);
    return n >= (double)FARTHEST ? FARTHEST : n <= -(double)FARTHEST ? -FARTHEST : (int64_t)rint(n);
}

static bool overlaps(int64_t from, int64_t to, int32_t count) {
    const int64_t last = (int64_t)(count - 1) << UNIT_BITS;
    return (from > 0 ? from : 0) < (to < last ? to : last);
}

static void place_columns(const tiles *t, double side, int32_t x, int turn, tile_turn *out) {
    const rqt_placement *at = &t->terrain->placement;
    out->west = samples(-180 + x * side + 360.0 * turn, at->x0, at->dx);
    out->east = samples(-180 + (x + 1.0) * side + 360.0 * turn, at->x0, at->dx);
    out->box[0] = units(out->west);
    out->box[1] = units(out->east);
    for (int i = 0; i < 2; i++) out->cut[i] = ldexp((double)out->box[i], -UNIT_BITS);
}

static void place_rows(const tiles *t, double side, int32_t y, tile_turn *out) {
    const rqt_placement *at = &t->terrain->placement;
    out->south = samples(-90 + y * side, at->y0, at->dy);
    out->north = samples(-90 + (y + 1.0) * side, at->y0, at->dy);
    out->box[2] = units(out->north);
    out->box[3] = units(out->south);
    for (int i = 2; i < 4; i++) out->cut[i] = ldexp((double)out->box[i], -UNIT_BITS);
}

turn_range plan_turns(const tiles *t) {
    const geo_extent e = tiles_extent(t->terrain);
    return (turn_range){(int)floor((e.west - 180) / 360), (int)ceil((e.east + 180) / 360)};
}

bool plan_place(const tiles *t, int z, int32_t x, int32_t y, tile_place *place) {
    if (z < 0 || z > plan_of(t)->finest || x < 0 || y < 0 || x >= 2 << z || y >= 1 << z) return false;
    const double side = ldexp(180, -z);
    const turn_range on = plan_turns(t);
    *place = (tile_place){.z = z, .x = x, .y = y, .west = -180 + x * side, .south = -90 + y * side, .side = side};
    for (int turn = on.first; turn <= on.last && place->turns < MOST_TURNS; turn++) {
        tile_turn *new = &place->turn[place->turns];
        place_columns(t, side, x, turn, new);
        place_rows(t, side, y, new);
        place->turns += overlaps(new->box[0], new->box[1], t->terrain->lattice.width) &&
                        overlaps(new->box[2], new->box[3], t->terrain->lattice.height);
    }
    return true;
}

static int32_t clamp_tile(double n, int32_t count) {
    return n < 0 ? 0 : n > count - 1 ? count - 1 : (int32_t)n;
}

/* The columns of tiles that meet the raster on a turn; false: none. */
static bool range_of_columns(const tiles *t, double side, int turn, int32_t count, tile_range *range) {
    const geo_extent e = tiles_extent(t->terrain);
    const int32_t width = t->terrain->lattice.width;
    tile_turn at;
    range->x0 = clamp_tile(floor((e.west - 360.0 * turn + 180) / side) - 1, count);
    range->x1 = clamp_tile(floor((e.east - 360.0 * turn + 180) / side) + 1, count);
    for (; range->x0 <= range->x1; range->x0++) {
        place_columns(t, side, range->x0, turn, &at);
        if (overlaps(at.box[0], at.box[1], width)) break;
    }
    for (; range->x1 >= range->x0; range->x1--) {
        place_columns(t, side, range->x1, turn, &at);
        if (overlaps(at.box[0], at.box[1], width)) break;
    }
    return range->x0 <= range->x1;
}

static bool range_of_rows(const tiles *t, double side, int32_t count, tile_range *range) {
    const geo_extent e = tiles_extent(t->terrain);
    const int32_t height = t->terrain->lattice.height;
    tile_turn at;
    range->y0 = clamp_tile(floor((e.south + 90) / side) - 1, count);
    range->y1 = clamp_tile(floor((e.north + 90) / side) + 1, count);
    for (; range->y0 <= range->y1; range->y0++) {
        place_rows(t, side, range->y0, &at);
        if (overlaps(at.box[2], at.box[3], height)) break;
    }
    for (; range->y1 >= range->y0; range->y1--) {
        place_rows(t, side, range->y1, &at);
        if (overlaps(at.box[2], at.box[3], height)) break;
    }
    return range->y0 <= range->y1;
}

int plan_ranges(const tiles *t, int z, tile_range ranges[MOST_TURNS]) {
    const double side = ldexp(180, -z);
    const turn_range on = plan_turns(t);
    int count = 0;
    tile_range next;
    if (!range_of_rows(t, side, 1 << z, &next)) return 0;
    /* A later turn lies further west on the globe. */
    for (int turn = on.last; turn >= on.first && count < MOST_TURNS; turn--) {
        if (!range_of_columns(t, side, turn, 2 << z, &next)) continue;
        if (count > 0 && next.x0 <= ranges[count - 1].x1 + 1) {
            if (next.x1 > ranges[count - 1].x1) ranges[count - 1].x1 = next.x1;
            continue;
        }
        ranges[count++] = next;
    }
    return count;
}

static int64_t cut_at(int64_t at, int32_t count) {
    const int64_t last = (int64_t)(count - 1) << UNIT_BITS;
    return at < 0 ? 0 : at > last ? last : at;
}

bool plan_cells(const tiles *t, int z, int turn, tile_range *range, int64_t *x, int64_t *y) {
    const rqt_lattice *lattice = &t->terrain->lattice;
    const double side = ldexp(180, -z);
    tile_range there;
    tile_turn at;
    if (!range_of_columns(t, side, turn, 2 << z, &there)) return false;
    if (there.x0 > range->x0) range->x0 = there.x0;
    if (there.x1 < range->x1) range->x1 = there.x1;
    if (range->x0 > range->x1) return false;
    for (int32_t i = range->x0; i <= range->x1; i++, x++) {
        place_columns(t, side, i, turn, &at);
        x[0] = cut_at(at.box[0], lattice->width);
        x[1] = cut_at(at.box[1], lattice->width);
    }
    for (int32_t j = range->y1; j >= range->y0; j--, y++) {
        place_rows(t, side, j, &at);
        y[0] = cut_at(at.box[2], lattice->height);
        y[1] = cut_at(at.box[3], lattice->height);
    }
    return true;
}

int plan_region(const tiles *t, const tile_place *place, rqt_region **region) {
    double boxes[MOST_TURNS][4];
    for (int i = 0; i < place->turns; i++) memcpy(boxes[i], place->turn[i].cut, sizeof boxes[i]);
    return tiles_region(t, boxes, place->turns, region);
}
