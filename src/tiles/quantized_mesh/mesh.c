/* mesh.c - the mesh of a tile: the terrain's own at the level's eps, cut to the tile's rectangle, its vertices put
 * where quantized-mesh can have them. And how far that is from the terrain.
 *
 * The cut is exact (core/cut.c): what two tiles have in common of a leaf's side is the same place in both. Of a
 * vertex the number u depends on its column and the tile's two columns of longitude alone, v on its row and the two
 * latitudes, h on its height: so vertices that neighbours share decode to the same place. Those on a side have 0 or
 * TILE_UNITS, and no others have, so that whoever looks for the sides by these numbers finds what the lists say.
 * Nothing is dropped: a triangle that loses its area in rounding still joins its neighbours, and takes no part in
 * what is seen.
 *
 * In space. Let P = sum w_i F(v_i) be a point of a flat triangle in space with corners F(v_i); a sample is within
 * eps of such a P (geo/frame.cpp, the rule's lowering; parts of leaves are flat triangles of a smaller extent, of
 * which the same holds). Rounding takes v_i to v_i', and P to P' = sum w_i F(v_i') of the decoded triangle, so that
 *
 *     |P - P'|  <=  max |F(v_i) - F(v_i')|  <=  hypot( R cos(phi) dlon, R dlat, dh )
 *
 * with the largest moves in longitude, latitude, height of any vertex of the tile (the line between the two places
 * is no shorter than the chord), R no less than any radius of curvature and the height above it, phi the latitude
 * of the tile that is nearest to the equator. Whatever flips or folds: each sample has a point of the decoded mesh
 * within error = eps + that (for eps what heights were rounded by, where that is more), which is no more than the
 * level's geometric error, by the choice of levels and eps.
 *
 * Above or below. Clients that ask for a height (sampleTerrain) go straight down in longitude, latitude, height.
 * Rounding maps the cut onto the decoded mesh, linearly in each triangle: a place s that a decoded triangle covers
 * is the image of some place p of the cut, no further off than the largest moves. So its height there is that of
 * the cut at p but for half a step, and where the cut has all between p and s, which differ by at most dcol and
 * drow, the height at p is that at s but for
 *
 *     max over the leaves of  |slope along a row| dcol + |slope along a column| drow
 *
 * which eps completes to vertical_error, for the cut is within eps of the samples vertically too. With a geoid, the
 * heights of corners are H + G(place), and G is not linear in between: that adds what it may differ by within the
 * largest triangle, and along the move.
 */
#include "earth.h"
#include "quantized_mesh.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Samples are on a grid of 2^-20 with the sides; places where a side cuts an edge are within 2^-30 of it. */
#define ON_SIDE 0x1p-21
enum { WEST, SOUTH, EAST, NORTH, SIDES };

/* The largest leaf's columns and rows. */
typedef struct extent {
    double columns, rows;
} extent;

/* *most: metres that a leaf may rise in a move of so many columns and rows. */
static void measure_slopes(const tiles *t, const rqt_patch *patch, const double moves[2], extent *s, double *most) {
    const double quantum = fabs(rqt_unit_factor(&t->terrain->unit)) / t->terrain->unit.d;
    *s = (extent){0};
    *most = 0;
    for (size_t i = 0; i < patch->triangle_count; i++) {
        const uint32_t *corner = patch->triangles + 3 * i;
        const rqt_patch_vertex *a = &patch->vertices[corner[0]], *b = &patch->vertices[corner[1]],
                               *c = &patch->vertices[corner[2]];
        const double bx = b->col - a->col, by = b->row - a->row, bz = (double)b->q - a->q;
        const double cx = c->col - a->col, cy = c->row - a->row, cz = (double)c->q - a->q;
        const double area = bx * cy - cx * by;
        const double along = fabs((bz * cy - cz * by) / area) * quantum,
                     down = fabs((cz * bx - bz * cx) / area) * quantum;
        const double wide[3] = {fabs(bx), fabs(cx), fabs(bx - cx)}, high[3] = {fabs(by), fabs(cy), fabs(by - cy)};
        for (int k = 0; k < 3; k++) {
            if (wide[k] > s->columns) s->columns = wide[k];
            if (high[k] > s->rows) s->rows = high[k];
        }
        const double sloping = along * moves[0] + down * moves[1];
        if (sloping > *most) *most = sloping;
    }
}

static void state_errors(const tiles *t, const tile_place *place, const rqt_patch *patch, tile_mesh *mesh) {
    const tile_plan *plan = t->plan;
    const rqt_placement *at = &t->terrain->placement;
    const double north = place->south + place->side;
    const double least = place->south <= 0 && north >= 0 ? 0 : fmin(fabs(place->south), fabs(north));
    const double eps = fmax(plan->level[place->z].eps, plan->rounded);
    const double moved = hypot(
        hypot(mesh->move[0] * DEGREE * plan->radius * cos(least * DEGREE), mesh->move[1] * DEGREE * plan->radius),
        mesh->move[2]);
    const double moves[2] = {mesh->move[0] / at->dx, mesh->move[1] / -at->dy};
    extent s;
    double sloping;
    measure_slopes(t, patch, moves, &s, &sloping);
    /* Doubles of places in space and of columns: nanometres. */
    mesh->error = eps + moved * (1 + 1e-9) + 1e-7;
    mesh->vertical_error = eps + mesh->move[2] + sloping * (1 + 1e-9) + 1e-7;
    if (plan->geoid)
        mesh->vertical_error += plan->undulation.lon_slope * (s.columns * at->dx / 2 + mesh->move[0]) +
                                plan->undulation.lat_slope * (s.rows * -at->dy / 2 + mesh->move[1]);
}

/* ------------------------------------------------------------------------------------------------ vertices -- */

static const tile_turn *turn_of(const tile_place *place, double col) {
    for (int i = 0; i < place->turns; i++) {
        const tile_turn *turn = &place->turn[i];
        if (col >= turn->cut[0] - ON_SIDE && col <= turn->cut[1] + ON_SIDE) return turn;
    }
    return &place->turn[0];
}

/* from, to: the tile's sides in samples; low, high: where the mesh ends. */
static uint16_t quantise(double at, double from, double to, double low, double high) {
    if (fabs(at - low) < ON_SIDE) return 0;
    if (fabs(at - high) < ON_SIDE) return TILE_UNITS;
    const double n = rint((at - from) / (to - from) * TILE_UNITS);
    return (uint16_t)(n < 1 ? 1 : n > TILE_UNITS - 1 ? TILE_UNITS - 1 : n);
}

/* What a client reads of a vertex. */
static void decode_vertex(const tile_plan *plan, const tile_place *place, tile_mesh *mesh, size_t i) {
    double *out = mesh->lonlath + 3 * i;
    out[0] = place->west + place->side * mesh->u[i] / TILE_UNITS;
    out[1] = place->south + place->side * mesh->v[i] / TILE_UNITS;
    out[2] = plan->lowest + mesh->h[i] * plan->step;
}

static void note_move(double *most, double by) {
    if (fabs(by) > *most) *most = fabs(by);
}

static int place_vertex(const tiles *t, const tile_place *place, tile_mesh *mesh, size_t i, char **error) {
    const tile_plan *plan = t->plan;
    const rqt_placement *at = &t->terrain->placement;
    const rqt_unit *unit = &t->terrain->unit;
    const rqt_cut_vertex *v = &mesh->cut.vertices[i];
    const tile_turn *turn = turn_of(place, v->col);
    double height = ((double)unit->z0 + v->q / (double)unit->d) * rqt_unit_factor(unit) + unit->offset;
    if (plan->geoid) {
        const double there[3] = {at->x0 + v->col * at->dx, at->y0 + v->row * at->dy, height};
        height = geo_frame_height(plan->geoid, there);
        if (!isfinite(height))
            return tiles_fail(error, "the geoid has no height at %.15g, %.15g", there[0], there[1]);
    }
    mesh->u[i] = quantise(v->col, turn->west, turn->east, turn->cut[0], turn->cut[1]);
    mesh->v[i] = quantise(v->row, turn->south, turn->north, turn->cut[3], turn->cut[2]);
    const double n = rint((height - plan->lowest) / plan->step);
    mesh->h[i] = (uint16_t)(n < 0 ? 0 : n > TILE_UNITS ? TILE_UNITS : n);
    decode_vertex(plan, place, mesh, i);
    note_move(&mesh->move[0],
              (v->col - (turn->west + (turn->east - turn->west) * mesh->u[i] / TILE_UNITS)) * at->dx);
    note_move(&mesh->move[1],
              (v->row - (turn->south + (turn->north - turn->south) * mesh->v[i] / TILE_UNITS)) * at->dy);
    note_move(&mesh->move[2], height - mesh->lonlath[3 * i + 2]);
    return SQLITE_OK;
}

/* -------------------------------------------------------------------------------------------------- sides -- */

/* Vertices that rounding puts into one place go by where they were: in both tiles the same way. */
typedef struct side_vertex {
    uint16_t along;
    double place; /* samples; grows with along */
    uint32_t vertex;
} side_vertex;

static int by_place(const void *a, const void *b) {
    const side_vertex *p = a, *q = b;
    if (p->along != q->along) return p->along < q->along ? -1 : 1;
    if (p->place != q->place) return p->place < q->place ? -1 : 1;
    return (p->vertex > q->vertex) - (p->vertex < q->vertex);
}

static int list_side(tile_mesh *mesh, int side) {
    const uint16_t *across = side == WEST || side == EAST ? mesh->u : mesh->v;
    const uint16_t *along = across == mesh->u ? mesh->v : mesh->u;
    const uint16_t there = side == WEST || side == SOUTH ? 0 : TILE_UNITS;
    size_t count = 0, n = 0;
    for (size_t i = 0; i < mesh->cut.vertex_count; i++) count += across[i] == there;
    side_vertex *list = sqlite3_malloc64((count + 1) * sizeof *list);
    mesh->edge[side] = sqlite3_malloc64((count + 1) * sizeof *mesh->edge[side]);
    if (list && mesh->edge[side]) {
        for (size_t i = 0; i < mesh->cut.vertex_count; i++)
            if (across[i] == there) {
                const rqt_cut_vertex *v = &mesh->cut.vertices[i];
                list[n++] = (side_vertex){along[i], along == mesh->v ? -v->row : v->col, (uint32_t)i};
            }
        qsort(list, count, sizeof *list, by_place);
        for (size_t i = 0; i < count; i++) mesh->edge[side][i] = list[i].vertex;
        mesh->edge_count[side] = (uint32_t)count;
    }
    const bool ok = list && mesh->edge[side];
    sqlite3_free(list);
    return ok ? SQLITE_OK : SQLITE_NOMEM;
}

/* -------------------------------------------------------------------------------------------------- whole -- */

static int cut_patch(tiles *t, const tile_place *place, rqt_patch *patch, tile_mesh *mesh, char **error) {
    const store_query_options options = plan_options(t, place->z);
    rqt_region *region = NULL;
    store_wait w = {t->store, SQLITE_INTERRUPT};
    int code = plan_region(t, place, &region);
    if (code == SQLITE_OK)
        code = store_query(t->store, t->terrain, region, plan_of(t)->level[place->z].eps, &options, patch, NULL,
                           error);
    if (code == SQLITE_OK) {
        mesh->merged = seam_merge(t, &plan_of(t)->seam, patch);
        const rqt_status status = rqt_cut_make(patch, region, &t->terrain->lattice, store_allocator(),
                                               store_wait_is_over, &w, &mesh->cut);
        code = status == RQT_OK ? SQLITE_OK : status == RQT_INTERRUPTED ? w.code : SQLITE_NOMEM;
    }
    rqt_region_free(region);
    return code;
}

int mesh_make(tiles *t, const tile_place *place, tile_mesh *mesh, char **error) {
    rqt_patch patch = {0};
    *mesh = (tile_mesh){0};
    int code = place->turns > 0 ? cut_patch(t, place, &patch, mesh, error) : SQLITE_OK;
    const size_t n = mesh->cut.vertex_count, most = n + MOST_SPECKS;
    if (code == SQLITE_OK) {
        mesh->u = sqlite3_malloc64(3 * most * sizeof *mesh->u);
        mesh->lonlath = sqlite3_malloc64(3 * most * sizeof *mesh->lonlath);
        code = mesh->u && mesh->lonlath ? SQLITE_OK : SQLITE_NOMEM;
    }
    if (code == SQLITE_OK) {
        mesh->v = mesh->u + most;
        mesh->h = mesh->v + most;
        for (size_t i = 0; i < n && code == SQLITE_OK; i++) code = place_vertex(t, place, mesh, i, error);
        specks_add(mesh);
        for (size_t i = n; i < mesh_vertices(mesh); i++) decode_vertex(t->plan, place, mesh, i);
    }
    for (int side = 0; side < SIDES && code == SQLITE_OK; side++) code = list_side(mesh, side);
    mesh->move[2] += mesh->merged;
    if (code == SQLITE_OK) state_errors(t, place, &patch, mesh);
    store_keep(t->store, &patch);
    return code;
}

void mesh_free(tile_mesh *mesh) {
    rqt_cut_free(&mesh->cut);
    sqlite3_free(mesh->u);
    sqlite3_free(mesh->lonlath);
    for (int side = 0; side < SIDES; side++) sqlite3_free(mesh->edge[side]);
    *mesh = (tile_mesh){0};
}
