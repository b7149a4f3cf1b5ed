/* skirt.c - walls that hang from a tile's sides, so that nothing shows through where a client draws a tile beside
 * one of another level.
 *
 * Tiles of one level are parts of one mesh and need none. Those of two levels have the corners of cells in common,
 * and what lies between differs: each side is a line through samples, vertices of one of the two wherever it bends,
 * and there the other is no further off than it states. So along a side both differ by no more than one of them
 * states, and that is no more than
 *
 *     E(a) + 2 round(a)  <  wall(a) / 2  =  E(a) + 3 round(a)
 *
 * where a is the coarsest level whose cells have a side on that line of the lattice: no coarser tile ends there,
 * one would go on beyond. All walls on a line hang wall(a) down, whichever the tile. Half of all sides lie on lines
 * of the tile's own level, a quarter on those of the next, so that deep walls are few; and nobody needs to know
 * which levels a client draws beside each other.
 *
 * Of two sides one above the other the higher one's wall reaches beyond the lower one. But sides are not quite
 * above each other: along a parallel, chords lie nearer to the pole than the arc does, the longer the more. The
 * side that faces the equator then leaves a sliver open, through which one who is right above sees the background.
 * Such a wall leans out by twice as much as its chord is off the arc: half way down, at the latest, it passes below
 * the arc. Half way down it is below the neighbour's side, as that is less than wall(a) / 2 below its own, and not
 * below the lower end of the neighbour's wall, as that is less than wall(a) / 2 above its own. The two meet,
 * whichever side is higher. Along meridians chords lie in the plane of the arc.
 *
 * What is not closed: vertices of both levels are rounded to steps, sideways too, and walls do not lean for that.
 * It is round(a) at most for either, a small part of what the level is off. And no wall is deeper than half the
 * Earth's radius, whatever its level is off (plan.c).
 *
 * None hangs from the outline of the raster, nor around voids: nothing is beside them, and what one would see there
 * is no terrain. A raster that goes once around the Earth has no outline in the west and east.
 *
 * Walls begin at the surface's own vertices, with its normals, so that they are lit as the ground is beside them.
 */
#include "blocks.h"
#include "earth.h"

#include <math.h>
#include <string.h>

enum { WEST = 1, EAST = 2, NORTH = 4, SOUTH = 8 };
enum { OUTLINE = 0 };

/* A cell's sides: where they are, and how far down walls hang from each, 0: none. */
typedef struct cell_sides {
    int32_t west, east, north, south; /* columns and rows */
    double depth[4];                  /* of WEST, EAST, NORTH, SOUTH */
} cell_sides;

static bool is_around(const store_terrain *t) {
    return fabs((t->lattice.width - 1) * t->placement.dx - 360) < 1e-9 * 360;
}

/* The coarsest level whose cells have a side on a line, which is counted in cells of a level; OUTLINE. */
static int level_of_line(int level, int32_t line, int32_t cell, int32_t last) {
    if (line == 0 || (int64_t)line * cell >= last) return OUTLINE;
    while (line % 2 == 0) line /= 2, level--;
    return level;
}

static cell_sides sides_of(const tiles *t, block_tile tile) {
    const block_plan *plan = block_plan_of(t);
    const rqt_lattice *lattice = &t->terrain->lattice;
    const int32_t cell = 1 << (lattice->K - tile.level), columns = lattice->width - 1, rows = lattice->height - 1;
    const bool is_closed = tile.level > 0 && is_around(t->terrain);
    const int level[4] = {
        level_of_line(tile.level, tile.i, cell, columns), level_of_line(tile.level, tile.i + 1, cell, columns),
        level_of_line(tile.level, tile.j, cell, rows), level_of_line(tile.level, tile.j + 1, cell, rows)};
    cell_sides sides = {.west = tile.i * cell, .north = tile.j * cell};
    sides.east = sides.west + cell < columns ? sides.west + cell : columns;
    sides.south = sides.north + cell < rows ? sides.north + cell : rows;
    for (int s = 0; s < 4; s++) {
        const int a = is_closed && s < 2 && level[s] == OUTLINE ? 1 : level[s];
        sides.depth[s] = a == OUTLINE ? 0 : plan->level[a].wall;
    }
    return sides;
}

double block_skirt_depth(const tiles *t, block_tile tile) {
    const block_plan *plan = block_plan_of(t);
    const cell_sides sides = sides_of(t, tile);
    double depth = tile.level < plan->finest ? plan->level[tile.level + 1].wall : 0;
    for (int s = 0; s < 4; s++) depth = fmax(depth, sides.depth[s]);
    return depth;
}

/* ------------------------------------------------------------------------------------------------- on sides -- */

/* The sides with walls that a vertex is on. */
static int sides_at(const cell_sides *sides, const rqt_patch_vertex *v) {
    const bool is_on[4] = {v->col == sides->west, v->col == sides->east, v->row == sides->north,
                           v->row == sides->south};
    int at = 0;
    if (!(is_on[0] | is_on[1] | is_on[2] | is_on[3])) return 0;
    for (int s = 0; s < 4; s++) at |= is_on[s] && sides->depth[s] > 0 ? 1 << s : 0;
    return at;
}

/* The edges of a mesh that are on sides with walls. */
typedef struct rim {
    uint8_t *sides;   /* of each vertex of the mesh: WEST | ... */
    uint32_t *number; /* of those that such an edge ends in: which they are among them, from 1 on; 0: the others */
    double *lean;     /* of these, from 1 on: northward, metres */
    size_t edge_count, vertex_count;
} rim;

static void rim_free(rim *r) {
    sqlite3_free(r->sides);
    sqlite3_free(r->number);
    sqlite3_free(r->lean);
}

/* An edge on a side with walls. */
typedef struct rim_edge {
    size_t next;      /* where to look for the one after it */
    uint32_t ends[2]; /* seen from above, the tile is to the left */
    int side;
} rim_edge;

/* Begins with {0}; false: there are no more. */
static bool next_edge(const block_mesh *mesh, const rim *r, rim_edge *edge) {
    while (edge->next < 3 * mesh->patch.triangle_count) {
        const size_t corner = edge->next % 3;
        const uint32_t *of = mesh->patch.triangles + edge->next - corner;
        if (corner == 0 && !(r->sides[of[0]] | r->sides[of[1]] | r->sides[of[2]])) {
            edge->next += 3;
            continue;
        }
        edge->next++;
        edge->ends[0] = of[corner];
        edge->ends[1] = of[(corner + 1) % 3];
        edge->side = r->sides[edge->ends[0]] & r->sides[edge->ends[1]];
        if (edge->side) return true;
    }
    return false;
}

static int find_rim(const block_mesh *mesh, const cell_sides *sides, rim *r) {
    const size_t count = mesh->patch.vertex_count;
    r->sides = sqlite3_malloc64(count * sizeof *r->sides);
    r->number = sqlite3_malloc64(count * sizeof *r->number);
    if (!r->sides || !r->number) return SQLITE_NOMEM;
    for (size_t i = 0; i < count; i++) r->sides[i] = (uint8_t)sides_at(sides, &mesh->patch.vertices[i]);
    memset(r->number, 0, count * sizeof *r->number);
    for (rim_edge edge = {0}; next_edge(mesh, r, &edge); r->edge_count++)
        for (int e = 0; e < 2; e++)
            if (!r->number[edge.ends[e]]) r->number[edge.ends[e]] = (uint32_t)++r->vertex_count;
    r->lean = sqlite3_malloc64((r->vertex_count + 1) * sizeof *r->lean);
    for (size_t n = 0; r->lean && n <= r->vertex_count; n++) r->lean[n] = 0;
    return r->lean ? SQLITE_OK : SQLITE_NOMEM;
}

/* How far the middle of a chord along a parallel is from it, northward: no less than it is, by a hundredth. */
static double chord_off(const rqt_placement *at, const rqt_patch_vertex *u, const rqt_patch_vertex *v) {
    const double latitude = (at->y0 + u->row * at->dy) * DEGREE, half = (v->col - u->col) * at->dx * DEGREE / 2;
    const double across = sin(half / 2);
    return 1.01 * EARTH_CURVED * cos(latitude) * 2 * across * across * sin(latitude);
}

/* ---------------------------------------------------------------------------------------------------- walls -- */

static void lean_out(const tiles *t, const block_mesh *mesh, const rim_edge *edge, rim *r) {
    const rqt_patch_vertex *v = mesh->patch.vertices;
    const double off = chord_off(&t->terrain->placement, &v[edge->ends[0]], &v[edge->ends[1]]);
    if (edge->side & (WEST | EAST) || (edge->side == NORTH) == (off > 0)) return;
    for (int e = 0; e < 2; e++) {
        double *lean = &r->lean[r->number[edge->ends[e]]];
        if (fabs(*lean) < 2 * fabs(off)) *lean = -2 * off;
    }
}

/* Two triangles for each edge, which face outwards. */
static void put_up(const tiles *t, const block_mesh *mesh, rim *r, block_skirt *skirt) {
    uint32_t *triangles = skirt->triangles;
    for (rim_edge edge = {0}; next_edge(mesh, r, &edge);) {
        const uint32_t u = 2 * (r->number[edge.ends[0]] - 1), v = 2 * (r->number[edge.ends[1]] - 1);
        const uint32_t two[6] = {u, u + 1, v + 1, u, v + 1, v};
        memcpy(triangles, two, sizeof two);
        triangles += 6;
        lean_out(t, mesh, &edge, r);
    }
}

/* From a vertex to the lower end of the wall below it. */
static void find_below(const rqt_placement *at, const rqt_patch_vertex *v, double lean, double depth,
                       double down[3]) {
    const double lon = (at->x0 + v->col * at->dx) * DEGREE, lat = (at->y0 + v->row * at->dy) * DEGREE;
    const earth_angle of_lon = {.sine = sin(lon), .cosine = cos(lon)},
                      of_lat = {.sine = sin(lat), .cosine = cos(lat)};
    earth_turn(&of_lon, &of_lat, (const double[3]){0, lean, -depth}, down);
}

static void hang(const tiles *t, const block_mesh *mesh, const cell_sides *sides, double step, const rim *r,
                 block_skirt *skirt) {
    for (size_t i = 0; i < mesh->patch.vertex_count; i++) {
        if (!r->number[i]) continue;
        double down[3], depth = 0;
        for (int s = 0; s < 4; s++)
            if (r->sides[i] & 1 << s) depth = fmax(depth, sides->depth[s]);
        const double lean = fmax(-depth, fmin(r->lean[r->number[i]], depth));
        find_below(&t->terrain->placement, &mesh->patch.vertices[i], lean, depth, down);
        const size_t top = 6 * ((size_t)r->number[i] - 1);
        for (size_t k = 0; k < 3; k++) {
            skirt->offset[top + k] = mesh->offset[3 * i + k];
            skirt->offset[top + 3 + k] = mesh->offset[3 * i + k] + (int32_t)rint(down[k] / step);
            skirt->normal[top + k] = skirt->normal[top + 3 + k] = mesh->normal[3 * i + k];
        }
        skirt->depth = fmax(skirt->depth, depth);
    }
}

static int make(const tiles *t, block_tile tile, const block_mesh *mesh, const cell_sides *sides, rim *r,
                block_skirt *skirt) {
    const int code = find_rim(mesh, sides, r);
    if (code != SQLITE_OK || r->edge_count == 0) return code;
    skirt->vertex_count = 2 * r->vertex_count;
    skirt->triangle_count = 2 * r->edge_count;
    skirt->offset = sqlite3_malloc64(3 * skirt->vertex_count * sizeof *skirt->offset);
    skirt->normal = sqlite3_malloc64(3 * skirt->vertex_count * sizeof *skirt->normal);
    skirt->triangles = sqlite3_malloc64(3 * skirt->triangle_count * sizeof *skirt->triangles);
    if (!skirt->offset || !skirt->normal || !skirt->triangles) return SQLITE_NOMEM;
    put_up(t, mesh, r, skirt);
    hang(t, mesh, sides, block_plan_of(t)->level[tile.level].step, r, skirt);
    return SQLITE_OK;
}

int block_skirt_make(const tiles *t, block_tile tile, const block_mesh *mesh, block_skirt *skirt) {
    const cell_sides sides = sides_of(t, tile);
    rim r = {0};
    *skirt = (block_skirt){0};
    bool has_walls = false;
    for (int s = 0; s < 4; s++) has_walls = has_walls || sides.depth[s] > 0;
    const int code = has_walls ? make(t, tile, mesh, &sides, &r, skirt) : SQLITE_OK;
    rim_free(&r);
    return code;
}

void block_skirt_free(block_skirt *skirt) {
    sqlite3_free(skirt->offset);
    sqlite3_free(skirt->normal);
    sqlite3_free(skirt->triangles);
    *skirt = (block_skirt){0};
}
