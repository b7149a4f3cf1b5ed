/* normals.c - unit normals of the terrain at the vertices of a patch, out of the full-resolution grid.
 *
 * At a sample with height z the slope along its row is (z east - z west) / 2 samples; where one of the two is void
 * or beyond the raster, the difference with the other one; 0 where both are. Along its column alike. Metres of
 * ground in a sample: in a projected CRS the cell in metres; in degrees, at the sample's latitude phi on WGS 84,
 *
 *     a column   dx * pi/180 * N cos(phi),   N = a / sqrt(1 - e2 sin(phi)^2)
 *     a row      dy * pi/180 * M,            M = a (1 - e2) / (1 - e2 sin(phi)^2)^(3/2)
 *
 * with a = 6378137, e2 = f (2 - f), f = 1/298.257223563; at a pole, where a column has no width, the slope along
 * the row is 0. The normal is (-slope east, -slope north, 1), of length 1.
 *
 * A vertex on a block's border has neighbours in several blocks. So vertices ask blocks, not the other way round:
 * every vertex names the block it begins, and those of its western and northern neighbours where they are others;
 * the requests are sorted, and each block is read once, whatever the order of the patch.
 */
#include "internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { OWN, WEST, EAST, NORTH, SOUTH, SIDES };

typedef struct request { /* of consecutive vertices of the patch */
    rqt_block_number block;
    uint32_t first, count;
} request;

typedef struct request_list {
    request *row;
    size_t count;
} request_list;

typedef struct cross { /* heights at a vertex and around it */
    int32_t q[SIDES];
    uint8_t known; /* bit n: q[n] is there, and no void */
} cross;

static void add_request(request_list *list, rqt_block_number block, uint32_t vertex) {
    request *last = list->count > 0 ? &list->row[list->count - 1] : NULL;
    if (last && last->block == block && last->first + last->count == vertex)
        last->count++;
    else
        list->row[list->count++] = (request){block, vertex, 1};
}

static int by_block(const void *a, const void *b) {
    const request *x = a, *y = b;
    if (x->block != y->block) return x->block < y->block ? -1 : 1;
    return x->first < y->first ? -1 : x->first > y->first;
}

/* Requests of one kind at a time, so that runs of vertices in one block stay runs. */
static void list_requests(const store_terrain *t, const rqt_patch *patch, request_list *list) {
    const int k = t->k, level = t->lattice.K - k;
    const int32_t last_i = t->lattice.width > 1 ? (t->lattice.width - 2) >> k : 0;
    const int32_t last_j = t->lattice.height > 1 ? (t->lattice.height - 2) >> k : 0;
    int32_t last[2] = {-1, -1};
    rqt_block_number number = 0;
    for (int side = OWN; side <= NORTH; side++) {
        if (side == EAST) continue;
        for (size_t v = 0; v < patch->vertex_count; v++) {
            const int32_t col = patch->vertices[v].col, row = patch->vertices[v].row;
            int32_t i = col >> k < last_i ? col >> k : last_i, j = row >> k < last_j ? row >> k : last_j;
            if (side == WEST && (col == 0 || i << k != col)) continue;
            if (side == NORTH && (row == 0 || j << k != row)) continue;
            if (side == WEST) i--;
            if (side == NORTH) j--;
            if (i != last[0] || j != last[1]) number = rqt_block_number_of(level, last[0] = i, last[1] = j);
            add_request(list, number, (uint32_t)v);
        }
    }
    qsort(list->row, list->count, sizeof *list->row, by_block);
}

/* What the block knows of the vertex's cross: all, but at its sides. */
static inline void look(const store_terrain *t, const rqt_block_place *place, const rqt_block *block,
                        const rqt_patch_vertex *v, cross *c) {
    static const int step[SIDES][2] = {{0, 0}, {-1, 0}, {1, 0}, {0, -1}, {0, 1}};
    const int32_t side = 1 << t->k, x = v->col - (place->i << t->k), y = v->row - (place->j << t->k);
    const bool is_inside =
        x > 0 && y > 0 && x < side && y < side && v->col < t->lattice.width - 1 && v->row < t->lattice.height - 1;
    const ptrdiff_t n = side + 1, own = y * n + x;
    for (int i = 0; i < SIDES; i++) {
        const int32_t dx = step[i][0], dy = step[i][1];
        const ptrdiff_t at = own + dy * n + dx;
        if (!is_inside) {
            if (x + dx < 0 || y + dy < 0 || x + dx > side || y + dy > side) continue;
            if (v->col + dx >= t->lattice.width || v->row + dy >= t->lattice.height) continue;
        }
        if (!(block->flags[at] & RQT_VALID)) continue;
        c->q[i] = block->q[at];
        c->known |= (uint8_t)(1 << i);
    }
}

/* Quanta a sample from `low` to `high`, which are on either side of the cross. */
static double slope(const cross *c, int low, int high) {
    const bool own = c->known >> OWN & 1, before = c->known >> low & 1, after = c->known >> high & 1;
    if (before && after) return ((double)c->q[high] - c->q[low]) / 2;
    if (own && after) return (double)c->q[high] - c->q[OWN];
    if (own && before) return (double)c->q[OWN] - c->q[low];
    return 0;
}

/* Metres of ground in a column and a row, signed as dx and dy are: east and north. */
static void ground(const store_terrain *t, int32_t row, double *column_east, double *row_north) {
    const rqt_placement *p = &t->placement;
    if (!t->lonlat) {
        const double metres = t->cost.cell / fmax(fabs(p->dx), fabs(p->dy)); /* of one unit of the CRS */
        *column_east = p->dx * metres;
        *row_north = p->dy * metres;
        return;
    }
    const double a = 6378137, f = 1 / 298.257223563, e2 = f * (2 - f), degree = M_PI / 180;
    const double latitude = p->y0 + row * p->dy, phi = latitude * degree;
    const double w = 1 - e2 * sin(phi) * sin(phi);
    *column_east = fabs(latitude) < 90 - 1e-9 ? p->dx * degree * a / sqrt(w) * cos(phi) : 0;
    *row_north = p->dy * degree * a * (1 - e2) / (w * sqrt(w));
}

/* Vertices have few rows: what is known of one is kept for the next vertex that has it. */
enum { KEPT_ROWS = 256 };
typedef struct kept_row {
    int32_t row;
    double east, north;
} kept_row;

static const kept_row *find_row(const store_terrain *t, kept_row kept[KEPT_ROWS], int32_t row) {
    kept_row *k = &kept[row % KEPT_ROWS];
    if (k->row != row) {
        k->row = row;
        ground(t, row, &k->east, &k->north);
    }
    return k;
}

static void normal_of(const kept_row *at, double quantum, const cross *c, float normal[3]) {
    const double east = at->east, north = at->north;
    const double x = east != 0 ? -slope(c, WEST, EAST) * quantum / east : 0;
    const double y = -slope(c, NORTH, SOUTH) * quantum / north;
    const double length = sqrt(x * x + y * y + 1);
    normal[0] = (float)(x / length);
    normal[1] = (float)(y / length);
    normal[2] = (float)(1 / length);
}

static int answer_requests(store *s, const store_terrain *t, const rqt_patch *patch, const request_list *list,
                           cross *crosses, char **error) {
    const rqt_block *block = NULL;
    rqt_block_place place;
    for (size_t n = 0; n < list->count; n++) {
        const request *r = &list->row[n];
        if (!block || r->block != r[-1].block) {
            int read, code = SQLITE_OK;
            if (store_is_interrupted(s, &code)) return code;
            code = store_get_block(s, t, r->block, &block, &read, error);
            if (code != SQLITE_OK) return code;
            if (rqt_block_locate(&t->lattice, t->k, r->block, &place) != RQT_OK) return SQLITE_CORRUPT_VTAB;
        }
        for (uint32_t v = r->first; v < r->first + r->count; v++)
            look(t, &place, block, &patch->vertices[v], &crosses[v]);
    }
    return SQLITE_OK;
}

int store_normals(store *s, const store_terrain *t, const rqt_patch *patch, float **normals, char **error) {
    const size_t count = patch->vertex_count;
    request_list list = {sqlite3_malloc64((3 * count + 1) * sizeof *list.row), 0};
    cross *crosses = sqlite3_malloc64((count + 1) * sizeof *crosses);
    *normals = sqlite3_malloc64((count + 1) * 3 * sizeof **normals);
    int code = list.row && crosses && *normals ? store_begin_on(s, t, error) : SQLITE_NOMEM;
    if (code == SQLITE_OK) {
        memset(crosses, 0, (count + 1) * sizeof *crosses);
        list_requests(t, patch, &list);
        code = answer_requests(s, t, patch, &list, crosses, error);
        const double quantum = rqt_unit_factor(&t->unit) / (double)t->unit.d;
        kept_row rows[KEPT_ROWS];
        for (int i = 0; i < KEPT_ROWS; i++) rows[i].row = -1;
        for (size_t v = 0; v < count && code == SQLITE_OK; v++)
            normal_of(find_row(t, rows, patch->vertices[v].row), quantum, &crosses[v], *normals + 3 * v);
        store_end(s);
    }
    sqlite3_free(list.row);
    sqlite3_free(crosses);
    if (code != SQLITE_OK) {
        sqlite3_free(*normals);
        *normals = NULL;
    }
    return code;
}
