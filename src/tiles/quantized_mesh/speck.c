/* speck.c - what clients need where a tile has no terrain.
 *
 * Cesium makes the tiles below one that are not there by cutting it in quarters. Where a quarter has no vertex its
 * boxes are made of no number: its releases go on with them, but its modules as people build their programs with
 * them have checks that throw, and then the tile is never done and nothing below it is drawn
 * (upsampleQuantizedTerrainMesh, OrientedBoundingBox.fromRectangle). Nor may there be no triangle: WebGL's buffers
 * have no size 0 (Buffer). So does a tile without vertices end, which both tiles of level 0 have to be able to be.
 *
 * So where no triangle of the tile comes near the middle of a sixteenth there is a speck: a vertex, and a triangle
 * all of whose corners it is. It has no area, so there is nothing to see and no height to be asked for, on no side
 * of the tile, at a height that the tile has. Sixteenths are enough for terrain: of a tile that is cut Cesium looks
 * once more at the quarters, and stops where all four were cut.
 *
 * A triangle counts that meets the square about the middle: what clients round by is far less than what lies around
 * it, so that whatever they do a vertex remains of it. Tiles that the terrain covers have no speck.
 */
#include "quantized_mesh.h"

enum { CELLS = 4, CELL = (TILE_UNITS + 1) / CELLS, MARGIN = CELL / 8 };

typedef struct square {
    int64_t u[2], v[2];
} square;

static square middle_of(int i, int j) {
    const int64_t u = (int64_t)i * CELL, v = (int64_t)j * CELL;
    return (square){{u + MARGIN, u + CELL - MARGIN}, {v + MARGIN, v + CELL - MARGIN}};
}

/* Are all corners of the square on the outer side of the line from a to b, the corner c being on its inner? */
static bool is_beyond(const tile_mesh *mesh, uint32_t a, uint32_t b, uint32_t c, const square *s) {
    const int64_t au = mesh->u[a], av = mesh->v[a], du = mesh->u[b] - au, dv = mesh->v[b] - av;
    const int64_t inner = du * (mesh->v[c] - av) - dv * (mesh->u[c] - au);
    for (int k = 0; k < 4; k++) {
        const int64_t side = du * (s->v[k >> 1] - av) - dv * (s->u[k & 1] - au);
        if (inner >= 0 ? side >= 0 : side <= 0) return false;
    }
    return true;
}

static bool meets(const tile_mesh *mesh, const uint32_t *corner, const square *s) {
    int64_t u[2] = {TILE_UNITS, 0}, v[2] = {TILE_UNITS, 0};
    for (int k = 0; k < 3; k++) {
        const int64_t a = mesh->u[corner[k]], b = mesh->v[corner[k]];
        if (a < u[0]) u[0] = a;
        if (a > u[1]) u[1] = a;
        if (b < v[0]) v[0] = b;
        if (b > v[1]) v[1] = b;
    }
    if (u[0] > s->u[1] || u[1] < s->u[0] || v[0] > s->v[1] || v[1] < s->v[0]) return false;
    return !is_beyond(mesh, corner[0], corner[1], corner[2], s) &&
           !is_beyond(mesh, corner[1], corner[2], corner[0], s) &&
           !is_beyond(mesh, corner[2], corner[0], corner[1], s);
}

static bool is_bare(const tile_mesh *mesh, const square *s) {
    for (size_t i = 0; i < mesh->cut.triangle_count; i++)
        if (meets(mesh, mesh->cut.triangles + 3 * i, s)) return false;
    return true;
}

/* Where a vertex is in a square its triangles meet it: that settles most squares in one pass. */
static void note_vertices(const tile_mesh *mesh, bool has_vertex[CELLS * CELLS]) {
    for (size_t i = 0; i < mesh->cut.vertex_count; i++) {
        const int u = mesh->u[i] % CELL, v = mesh->v[i] % CELL;
        if (u >= MARGIN && u <= CELL - MARGIN && v >= MARGIN && v <= CELL - MARGIN)
            has_vertex[mesh->v[i] / CELL * CELLS + mesh->u[i] / CELL] = true;
    }
}

void specks_add(tile_mesh *mesh) {
    const size_t count = mesh->cut.vertex_count;
    bool has_vertex[CELLS * CELLS] = {false};
    note_vertices(mesh, has_vertex);
    mesh->specks = 0;
    for (int cell = 0; cell < CELLS * CELLS; cell++) {
        const square s = middle_of(cell % CELLS, cell / CELLS);
        if (has_vertex[cell] || !is_bare(mesh, &s)) continue;
        const size_t i = count + mesh->specks++;
        mesh->u[i] = (uint16_t)((s.u[0] + s.u[1]) / 2);
        mesh->v[i] = (uint16_t)((s.v[0] + s.v[1]) / 2);
        mesh->h[i] = count > 0 ? mesh->h[0] : 0;
    }
}
