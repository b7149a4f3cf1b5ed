/* error_coarse.c - the vertices of scale >= b: their samples, and the errors that tiles add to them.
 *
 * Seen in units of tiles the coarse vertices are a lattice like any other, so their errors are an rqt_errors that
 * rqt_errors_saturate knows how to treat. An error code is a maximum, so tiles add up in any order; whether an
 * upper triangle is mixed is known when all have been added.
 */
#include "error_tile.h"

int32_t tile_count(int32_t samples, int b) {
    const int32_t count = (int32_t)(((int64_t)samples - 2 + ((int64_t)1 << b)) >> b);
    return count > 0 ? count : 1;
}

static rqt_lattice lattice_of_tiles(const rqt_lattice *lattice, int b) {
    return (rqt_lattice){tile_count(lattice->width, b) + 1, tile_count(lattice->height, b) + 1, lattice->K - b};
}

static size_t slot_count(const rqt_lattice *lattice) {
    return (size_t)lattice_slots(lattice, lattice->width) * (size_t)lattice_slots(lattice, lattice->height);
}

size_t coarse_bytes(const rqt_lattice *lattice, int b, bool has_voids) {
    const rqt_lattice tiles = lattice_of_tiles(lattice, b);
    return (size_t)tiles.width * (size_t)tiles.height * (sizeof(int32_t) + (has_voids ? 1 : 0)) +
           slot_count(&tiles) * (sizeof(rqt_code) + 2);
}

rqt_status coarse_create(coarse_lattice *coarse, const deviation_field *field, int b, bool has_voids,
                         const rqt_allocator *allocator) {
    memset(coarse, 0, sizeof *coarse);
    const rqt_lattice tiles = lattice_of_tiles(&field->lattice, b);
    coarse->field = field;
    coarse->b = b;
    coarse->columns = tiles.width;
    coarse->rows = tiles.height;
    const size_t n = (size_t)tiles.width * (size_t)tiles.height, slots = slot_count(&tiles);
    coarse->q = memory_take(allocator, n * sizeof *coarse->q);
    if (has_voids) coarse->valid = memory_take(allocator, n);
    coarse->states = memory_take(allocator, slots);
    rqt_errors *errors = &coarse->errors;
    errors->lattice = tiles;
    errors->columns = lattice_slots(&tiles, tiles.width);
    errors->rows = lattice_slots(&tiles, tiles.height);
    errors->code = memory_take(allocator, slots * sizeof *errors->code);
    errors->outline = memory_take(allocator, slots);
    if (!coarse->q || !coarse->states || !errors->code || !errors->outline || (has_voids && !coarse->valid)) {
        coarse_free(coarse, allocator);
        return RQT_NO_MEMORY;
    }
    memset(coarse->q, 0, n * sizeof *coarse->q);
    if (has_voids) memset(coarse->valid, 0, n);
    memset(coarse->states, 0, slots);
    memset(errors->code, 0, slots * sizeof *errors->code);
    memset(errors->outline, 0, slots);
    return RQT_OK;
}

void coarse_free(coarse_lattice *coarse, const rqt_allocator *allocator) {
    memory_drop(allocator, coarse->q);
    memory_drop(allocator, coarse->valid);
    memory_drop(allocator, coarse->states);
    rqt_errors_free(&coarse->errors, allocator);
    memset(coarse, 0, sizeof *coarse);
}

bool coarse_wants(const coarse_lattice *coarse, int32_t y) {
    return y == coarse->field->height - 1 || (y & ((1 << coarse->b) - 1)) == 0;
}

void coarse_take(coarse_lattice *coarse, int32_t y, const int32_t *q, const uint8_t *valid) {
    const int32_t last = coarse->field->width - 1, side = 1 << coarse->b;
    for (int32_t row = 0; row < coarse->rows; row++) {
        const int64_t at = (int64_t)row * side;
        if (at != y && (y != coarse->field->height - 1 || at < y)) continue;
        for (int32_t column = 0; column < coarse->columns; column++) {
            const int64_t x = (int64_t)column * side < last ? (int64_t)column * side : last;
            const size_t index = (size_t)row * (size_t)coarse->columns + (size_t)column;
            coarse->q[index] = q[x];
            if (coarse->valid) coarse->valid[index] = valid ? valid[x] != 0 : 1;
        }
    }
}

/* The place of the split vertex of a triangle of the lattice of tiles; one past the last sample that no error
 * reaches has none. */
static bool find_slot(const coarse_lattice *coarse, rqt_vertex v, size_t *at) {
    const int32_t column = lattice_slot(v.x, coarse->columns), row = lattice_slot(v.y, coarse->rows);
    if (column < 0 || row < 0) return false;
    *at = (size_t)row * (size_t)coarse->errors.columns + (size_t)column;
    return true;
}

/* Two triangles share a split vertex: the halves of a cell; the quarters of two cells at their common side. */
static int state_shift(int triangle) {
    static const int shift[CELL_TRIANGLES] = {0, 2, 2, 0, 0, 2};
    return shift[triangle];
}

void coarse_add(coarse_lattice *coarse, int32_t i, int32_t j, const upper_part *parts) {
    const int levels = coarse->errors.lattice.K;
    for (int n = 1; n <= levels; n++) {
        const upper_part *part = &parts[n - 1];
        rqt_triangle triangle[CELL_TRIANGLES];
        cell_triangles(i >> n << n, j >> n << n, n, triangle);
        for (int t = 0; t < CELL_TRIANGLES; t++) {
            size_t at;
            if (part->state[t] == 0 || !find_slot(coarse, split_vertex(&triangle[t]), &at)) continue;
            if (part->code[t] > coarse->errors.code[at]) coarse->errors.code[at] = part->code[t];
            coarse->states[at] = (uint8_t)(coarse->states[at] | part->state[t] << state_shift(t));
        }
    }
}

static void complete_cell(coarse_lattice *coarse, int32_t i, int32_t j, int n) {
    const int b = coarse->b;
    rqt_triangle in_tiles[CELL_TRIANGLES], triangle[CELL_TRIANGLES];
    cell_triangles(i << n, j << n, n, in_tiles);
    cell_triangles(i << (n + b), j << (n + b), n + b, triangle);
    for (int t = 0; t < CELL_TRIANGLES; t++) {
        size_t at;
        if (!find_slot(coarse, split_vertex(&in_tiles[t]), &at)) continue;
        if ((coarse->states[at] >> state_shift(t) & 3) != (HAS_VALID | HAS_VOID)) continue;
        const rqt_code ground = outline_code(coarse->field, &triangle[t]);
        if (ground > coarse->errors.code[at]) coarse->errors.code[at] = ground;
        coarse->errors.outline[at] = 1;
        coarse->errors.any_outline = true;
    }
}

void coarse_complete(coarse_lattice *coarse) {
    if (!coarse->valid) return;
    const int K = coarse->errors.lattice.K;
    for (int n = 1; n <= K; n++)
        for (int32_t j = 0; (int64_t)j << n < coarse->rows - 1; j++)
            for (int32_t i = 0; (int64_t)i << n < coarse->columns - 1; i++) complete_cell(coarse, i, j, n);
}
