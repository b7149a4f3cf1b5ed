/* lattice.c - the lattice of a terrain: vertices, the graph of who depends on whom, and block numbers.
 *
 * Everything follows from coordinates. Let q be the largest power of two that divides both coordinates of a vertex.
 * If both are odd multiples of q the vertex is the *centre* of a cell of side 2q: it splits the cell's diagonal,
 * and depends on the two corners off that diagonal. Otherwise it is a *side* vertex: it splits a side of length 2q,
 * and depends on the centres of the cells on both sides. The diagonal of a cell of side s at (i*s, j*s) runs
 * through the corner whose coordinates are both odd multiples of s: north-west to south-east where i and j have
 * equal parity.
 *
 * Vertices past the last sample are few: errors reach a vertex of column x only from samples nearer than 3q, so for
 * each power of two at most two columns past the raster matter. lattice_slot gives those columns a place behind the
 * samples.
 */
#include "internal.h"

static int trailing_zeros(int32_t v) {
    return __builtin_ctz((unsigned)v);
}

rqt_status rqt_lattice_init(rqt_lattice *lattice, int64_t width, int64_t height) {
    const int64_t most = ((int64_t)1 << RQT_MAX_K) + 1;
    memset(lattice, 0, sizeof *lattice);
    if (width < 1 || height < 1 || width > most || height > most) return RQT_INVALID;
    lattice->width = (int32_t)width;
    lattice->height = (int32_t)height;
    const int64_t longest = width > height ? width : height;
    while (((int64_t)1 << lattice->K) + 1 < longest) lattice->K++;
    return RQT_OK;
}

static bool is_inside(const rqt_lattice *lattice, int32_t x, int32_t y) {
    const int32_t side = 1 << lattice->K;
    return x >= 0 && y >= 0 && x <= side && y <= side;
}

int rqt_vertex_scale(const rqt_lattice *lattice, rqt_vertex v) {
    const int32_t both = v.x | v.y;
    return both == 0 ? lattice->K : trailing_zeros(both);
}

int rqt_vertex_level(const rqt_lattice *lattice, rqt_vertex v) {
    return lattice->K - rqt_vertex_scale(lattice, v);
}

int rqt_vertex_rank(const rqt_lattice *lattice, rqt_vertex v) {
    const int scale = rqt_vertex_scale(lattice, v);
    return 2 * scale + ((v.x >> scale) & (v.y >> scale) & 1);
}

int rqt_vertex_parents(const rqt_lattice *lattice, rqt_vertex v, rqt_vertex parents[2]) {
    if (lattice_is_corner(lattice, v)) return 0;
    const int scale = rqt_vertex_scale(lattice, v);
    const int32_t q = 1 << scale;
    const bool x_odd = (v.x >> scale) & 1, y_odd = (v.y >> scale) & 1;
    rqt_vertex candidates[2];
    if (x_odd && y_odd) {
        const bool main_diagonal = ((((v.x - q) ^ (v.y - q)) >> (scale + 1)) & 1) == 0;
        const int32_t dy = main_diagonal ? -q : q;
        candidates[0] = (rqt_vertex){v.x + q, v.y + dy};
        candidates[1] = (rqt_vertex){v.x - q, v.y - dy};
    } else if (x_odd) {
        candidates[0] = (rqt_vertex){v.x, v.y - q};
        candidates[1] = (rqt_vertex){v.x, v.y + q};
    } else {
        candidates[0] = (rqt_vertex){v.x - q, v.y};
        candidates[1] = (rqt_vertex){v.x + q, v.y};
    }
    int n = 0;
    for (int i = 0; i < 2; i++)
        if (is_inside(lattice, candidates[i].x, candidates[i].y)) parents[n++] = candidates[i];
    return n;
}

int rqt_vertex_ends(const rqt_lattice *lattice, rqt_vertex v, rqt_vertex ends[2]) {
    if (lattice_is_corner(lattice, v)) return 0;
    const int scale = rqt_vertex_scale(lattice, v);
    const int32_t q = 1 << scale;
    const bool x_odd = (v.x >> scale) & 1, y_odd = (v.y >> scale) & 1;
    const bool main_diagonal = ((((v.x - q) ^ (v.y - q)) >> (scale + 1)) & 1) == 0;
    const int32_t dx = x_odd ? q : 0, dy = !y_odd ? 0 : x_odd && !main_diagonal ? -q : q;
    ends[0] = (rqt_vertex){v.x - dx, v.y - dy};
    ends[1] = (rqt_vertex){v.x + dx, v.y + dy};
    return 2;
}

int rqt_vertex_children(const rqt_lattice *lattice, rqt_vertex v, rqt_vertex children[4]) {
    static const int step[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
    const int scale = rqt_vertex_scale(lattice, v);
    const bool x_odd = (v.x >> scale) & 1, y_odd = (v.y >> scale) & 1;
    int n = 0;
    if (x_odd && y_odd) { /* a centre: the four sides of its cell */
        if (lattice_is_corner(lattice, v)) return 0;
        for (int i = 0; i < 4; i++)
            children[n++] = (rqt_vertex){v.x + step[i][0] * (1 << scale), v.y + step[i][1] * (1 << scale)};
    } else if ((x_odd || y_odd) && scale > 0) { /* on no diagonal: the centres of the four cells around it */
        const int32_t half = 1 << (scale - 1);
        for (int i = 0; i < 4; i++) {
            const int32_t x = v.x + (i & 1 ? half : -half), y = v.y + (i & 2 ? half : -half);
            if (is_inside(lattice, x, y)) children[n++] = (rqt_vertex){x, y};
        }
    }
    return n;
}

rqt_vertex rqt_vertex_clamp(const rqt_lattice *lattice, rqt_vertex v) {
    return (rqt_vertex){v.x < lattice->width ? v.x : lattice->width - 1,
                        v.y < lattice->height ? v.y : lattice->height - 1};
}

int32_t lattice_slots(const rqt_lattice *lattice, int32_t samples) {
    return samples + 2 * (lattice->K + 1);
}

int32_t lattice_slot(int32_t x, int32_t samples) {
    if (x < samples) return x;
    const int a = trailing_zeros(x);
    const int32_t last = samples - 1;
    if (((int64_t)x - last) >= ((int64_t)3 << a)) return -1;
    int32_t first = (last >> a) + 1; /* the first odd multiple of 2^a past the last sample */
    first |= 1;
    return samples + 2 * a + (((x >> a) - first) >> 1);
}

/* ---------------------------------------------------------------------------------------------- blocks */

/* The bits of v spread to the even places: half of a Morton code. */
static uint64_t spread(uint32_t v) {
    uint64_t x = v;
    x = (x | x << 16) & UINT64_C(0x0000FFFF0000FFFF);
    x = (x | x << 8) & UINT64_C(0x00FF00FF00FF00FF);
    x = (x | x << 4) & UINT64_C(0x0F0F0F0F0F0F0F0F);
    x = (x | x << 2) & UINT64_C(0x3333333333333333);
    return (x | x << 1) & UINT64_C(0x5555555555555555);
}

static uint32_t gather(uint64_t x) {
    x &= UINT64_C(0x5555555555555555);
    x = (x | x >> 1) & UINT64_C(0x3333333333333333);
    x = (x | x >> 2) & UINT64_C(0x0F0F0F0F0F0F0F0F);
    x = (x | x >> 4) & UINT64_C(0x00FF00FF00FF00FF);
    x = (x | x >> 8) & UINT64_C(0x0000FFFF0000FFFF);
    return (uint32_t)(x | x >> 16);
}

rqt_block_number rqt_block_number_of(int level, int32_t i, int32_t j) {
    return (UINT64_C(1) << (2 * level)) | spread((uint32_t)i) | spread((uint32_t)j) << 1;
}

int rqt_block_levels(const rqt_lattice *lattice, int k) {
    return lattice->K - k + 1;
}

rqt_status rqt_block_locate(const rqt_lattice *lattice, int k, rqt_block_number number, rqt_block_place *place) {
    memset(place, 0, sizeof *place);
    if (number == 0 || k < 0 || k > lattice->K || k > RQT_MAX_BLOCK_K) return RQT_INVALID;
    const int top_bit = 63 - __builtin_clzll(number);
    const int level = top_bit / 2;
    if (top_bit % 2 != 0 || level > lattice->K - k) return RQT_INVALID;
    const uint64_t morton = number ^ (UINT64_C(1) << top_bit);
    const int32_t i = (int32_t)gather(morton), j = (int32_t)gather(morton >> 1);
    const int32_t side = 1 << (lattice->K - level), stride = side >> k;
    const int32_t x = i * side, y = j * side;
    /* In a raster of one column or row the first block is the only one along it. */
    const int32_t last_x = lattice->width > 1 ? lattice->width - 1 : 1;
    const int32_t last_y = lattice->height > 1 ? lattice->height - 1 : 1;
    if (x >= last_x || y >= last_y) return RQT_INVALID;
    const int32_t n = (1 << k) + 1;
    const int32_t across = (lattice->width - 1 - x + stride - 1) / stride + 1;
    const int32_t down = (lattice->height - 1 - y + stride - 1) / stride + 1;
    *place = (rqt_block_place){.level = level,
                               .i = i,
                               .j = j,
                               .x = x,
                               .y = y,
                               .side = side,
                               .stride = stride,
                               .width = across < n ? across : n,
                               .height = down < n ? down : n};
    return RQT_OK;
}
