/* normals.c - normals of a tile's vertices, in space.
 *
 * On the last level, whose mesh has all samples, they are those of the full-resolution grid (store_normals); where
 * the terrain closes, the mean of both columns'.
 *
 * On the others the normal at a vertex is that of its star, the triangles of the level's mesh that have it: the sum
 * of their area vectors, which is the mean of their normals by area. Surfaces with the same rim have the same sum
 * of area vectors, whatever lies between. So that is the mean normal of the terrain itself over the star, but for
 * what the rim is off: the light that a vertex has to give to all samples around it. Slopes of the full-resolution
 * grid at the vertex would say what is true of one sample in thousands; and whoever wants them reads all blocks
 * of the last level for a tile of the first.
 *
 * A star is of the level's mesh and not of a tile: at the sides of a cell it has triangles of the cells next to
 * it, asked for along a rim, and where the terrain closes those at its other end. Places are whole steps, fewer
 * than 2^24 for what two places of a triangle differ by, so area vectors and their sums are exact in doubles, in
 * whatever order: both tiles have the same one.
 */
#include "blocks.h"
#include "earth.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { NORMAL_UNITS = 127 };

static void round_normal(const double n[3], int8_t out[3]) {
    const double unit = NORMAL_UNITS / sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int k = 0; k < 3; k++) out[k] = (int8_t)rint(unit * n[k]);
}

/* -------------------------------------------------------------------------------------------- the last level -- */

typedef struct angles {
    earth_angles lon, lat;
} angles;

/* Where the terrain closes: a vertex of one column, as one of the other. */
static bool find_twin(const tiles *t, const rqt_patch_vertex *v, rqt_patch_vertex *twin) {
    const int32_t last = t->terrain->lattice.width - 1;
    *twin = *v;
    twin->col = v->col == 0 ? last : 0;
    return block_plan_of(t)->seam.q && (v->col == 0 || v->col == last);
}

/* The mesh's vertices, and behind them their twins, in the same order. */
static int list_samples(const tiles *t, const rqt_patch *patch, rqt_patch *samples) {
    const size_t count = patch->vertex_count;
    samples->vertices = sqlite3_malloc64(2 * count * sizeof *samples->vertices);
    if (!samples->vertices) return SQLITE_NOMEM;
    memcpy(samples->vertices, patch->vertices, count * sizeof *samples->vertices);
    samples->vertex_count = count;
    for (size_t i = 0; i < count; i++)
        if (find_twin(t, &patch->vertices[i], &samples->vertices[samples->vertex_count])) samples->vertex_count++;
    return SQLITE_OK;
}

static int take_full_resolution(tiles *t, block_mesh *mesh, char **error) {
    const rqt_placement *at = &t->terrain->placement;
    const size_t count = mesh->patch.vertex_count;
    angles *known = sqlite3_malloc64(sizeof *known);
    rqt_patch samples = {0};
    float *enu = NULL;
    int code = known ? list_samples(t, &mesh->patch, &samples) : SQLITE_NOMEM;
    if (code == SQLITE_OK) code = store_normals(t->store, t->terrain, &samples, &enu, error);
    if (code == SQLITE_OK) {
        earth_angles_clear(&known->lon);
        earth_angles_clear(&known->lat);
    }
    const float *twins = code == SQLITE_OK ? enu + 3 * count : NULL;
    for (size_t i = 0; i < count && code == SQLITE_OK; i++) {
        const rqt_patch_vertex *v = &mesh->patch.vertices[i];
        rqt_patch_vertex twin;
        double n[3], normal[3];
        const bool has_twin = find_twin(t, v, &twin);
        for (int k = 0; k < 3; k++) n[k] = (double)enu[3 * i + (size_t)k] + (has_twin ? (double)*twins++ : 0);
        earth_turn(earth_angle_of(&known->lon, v->col, block_longitude(t, v->col)),
                   earth_angle_of(&known->lat, v->row, at->y0 + v->row * at->dy), n, normal);
        round_normal(normal, mesh->normal + 3 * i);
    }
    sqlite3_free(enu);
    sqlite3_free(samples.vertices);
    sqlite3_free(known);
    return code;
}

/* ------------------------------------------------------------------------------------------------- stars -- */

/* Twice the area vector of a triangle, in steps. */
static inline void area_vector(const int32_t *offset, const uint32_t corner[3], double n[3]) {
    const int32_t *a = offset + 3 * (size_t)corner[0], *b = offset + 3 * (size_t)corner[1],
                  *c = offset + 3 * (size_t)corner[2];
    const double u[3] = {(double)b[0] - a[0], (double)b[1] - a[1], (double)b[2] - a[2]},
                 v[3] = {(double)c[0] - a[0], (double)c[1] - a[1], (double)c[2] - a[2]};
    n[0] = u[1] * v[2] - u[2] * v[1];
    n[1] = u[2] * v[0] - u[0] * v[2];
    n[2] = u[0] * v[1] - u[1] * v[0];
}

static inline void add(double *sum, const double n[3]) {
    for (int k = 0; k < 3; k++) sum[k] += n[k];
}

/* A vertex at the sides of the tile's cell. */
typedef struct side_vertex {
    int32_t col, row;
    uint32_t vertex;
} side_vertex;

static int by_place(const void *a, const void *b) {
    const side_vertex *p = a, *q = b;
    if (p->row != q->row) return p->row < q->row ? -1 : 1;
    return (p->col > q->col) - (p->col < q->col);
}

typedef struct side_list {
    side_vertex *items;
    size_t count;
} side_list;

static void list_sides(const tiles *t, block_tile tile, const rqt_patch *patch, side_list *sides) {
    const block_cell cell = block_cell_of(t, tile);
    for (size_t i = 0; i < patch->vertex_count; i++) {
        const rqt_patch_vertex *v = &patch->vertices[i];
        if (v->col == cell.from.x || v->col == cell.to.x || v->row == cell.from.y || v->row == cell.to.y)
            sides->items[sides->count++] = (side_vertex){v->col, v->row, (uint32_t)i};
    }
    qsort(sides->items, sides->count, sizeof *sides->items, by_place);
}

enum { OTHER = UINT32_MAX };
static uint32_t find_side(const side_list *sides, int32_t col, int32_t row) {
    const side_vertex wanted = {.col = col, .row = row};
    const side_vertex *found = bsearch(&wanted, sides->items, sides->count, sizeof *sides->items, by_place);
    return found ? found->vertex : OTHER;
}

/* The vertex of the tile that is the same as one of a part of block_mesh_around, or OTHER. */
static uint32_t find_own(const tiles *t, const side_list *sides, int part, const rqt_patch_vertex *v) {
    const int32_t last = t->terrain->lattice.width - 1;
    if (part == AROUND_CELL) return find_side(sides, v->col, v->row);
    return v->col == (part == AT_LAST_COLUMN ? last : 0) ? find_side(sides, last - v->col, v->row) : OTHER;
}

static int add_around(const tiles *t, block_tile tile, const block_mesh *mesh, int part, const rqt_patch *around,
                      const int32_t *offset, double *sums) {
    const size_t count = around->vertex_count;
    side_list sides = {.items = sqlite3_malloc64((mesh->patch.vertex_count + 1) * sizeof *sides.items)};
    uint32_t *own = sqlite3_malloc64((count + 1) * sizeof *own); /* the same vertex of the tile */
    const int code = sides.items && own ? SQLITE_OK : SQLITE_NOMEM;
    if (code == SQLITE_OK) {
        list_sides(t, tile, &mesh->patch, &sides);
        for (size_t i = 0; i < count; i++) own[i] = find_own(t, &sides, part, &around->vertices[i]);
        for (size_t i = 0; i < around->triangle_count; i++) {
            const uint32_t *corner = around->triangles + 3 * i;
            double n[3];
            area_vector(offset, corner, n);
            for (int c = 0; c < 3; c++)
                if (own[corner[c]] != OTHER) add(sums + 3 * (size_t)own[corner[c]], n);
        }
    }
    sqlite3_free(sides.items);
    sqlite3_free(own);
    return code;
}

static int sum_around(tiles *t, block_tile tile, block_mesh *mesh, int part, double *sums, char **error) {
    rqt_patch around = {0};
    int32_t *offset = NULL;
    int code = block_mesh_around(t, tile, part, &around, error);
    if (code == SQLITE_OK)
        code =
            block_places(t, &around, block_plan_of(t)->level[tile.level].step, mesh->origin, true, &offset, error);
    if (code == SQLITE_OK) code = add_around(t, tile, mesh, part, &around, offset, sums);
    sqlite3_free(offset);
    store_keep(t->store, &around);
    return code;
}

/* A star without area, at a pole, whose samples are one place. */
static void take_ellipsoid(const tiles *t, block_tile tile, const block_mesh *mesh, const int32_t offset[3],
                           double n[3]) {
    const double step = block_plan_of(t)->level[tile.level].step;
    for (int k = 0; k < 3; k++) n[k] = mesh->origin[k] + offset[k] * step;
    n[2] *= (EARTH_A / EARTH_B) * (EARTH_A / EARTH_B);
}

static int take_stars(tiles *t, block_tile tile, block_mesh *mesh, char **error) {
    const size_t count = mesh->patch.vertex_count;
    double *sums = sqlite3_malloc64(3 * count * sizeof *sums);
    if (!sums) return SQLITE_NOMEM;
    memset(sums, 0, 3 * count * sizeof *sums);
    for (size_t i = 0; i < mesh->patch.triangle_count; i++) {
        const uint32_t *corner = mesh->patch.triangles + 3 * i;
        double n[3];
        area_vector(mesh->offset, corner, n);
        for (int c = 0; c < 3; c++) add(sums + 3 * (size_t)corner[c], n);
    }
    int code = SQLITE_OK;
    for (int part = 0; part < BLOCK_PARTS && code == SQLITE_OK; part++)
        code = sum_around(t, tile, mesh, part, sums, error);
    for (size_t i = 0; i < count && code == SQLITE_OK; i++) {
        double *n = sums + 3 * i;
        if (n[0] == 0 && n[1] == 0 && n[2] == 0) take_ellipsoid(t, tile, mesh, mesh->offset + 3 * i, n);
        round_normal(n, mesh->normal + 3 * i);
    }
    sqlite3_free(sums);
    return code;
}

int block_normals(tiles *t, block_tile tile, block_mesh *mesh, char **error) {
    mesh->normal = sqlite3_malloc64(3 * mesh->patch.vertex_count * sizeof *mesh->normal);
    if (!mesh->normal) return SQLITE_NOMEM;
    return tile.level == block_plan_of(t)->finest ? take_full_resolution(t, mesh, error)
                                                  : take_stars(t, tile, mesh, error);
}
