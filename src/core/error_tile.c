/* error_tile.c - the exact errors that one tile knows of.
 *
 * The tile is cut into quarters again and again. A cell inside the raster and without voids goes to the kernels as
 * a whole, all its depths at once, while its samples are near; of any other cell the six triangles are measured one
 * by one, and its quarters are looked at. So the edge of the raster and the outlines of voids cost more, and
 * nothing else does.
 */
#include "error_tile.h"

void cell_triangles(int32_t x, int32_t y, int n, rqt_triangle out[CELL_TRIANGLES]) {
    const int32_t side = 1 << n, half = side / 2;
    const rqt_vertex nw = {x, y}, ne = {x + side, y}, sw = {x, y + side}, se = {x + side, y + side};
    const rqt_vertex center = {x + half, y + half};
    if (((x ^ y) >> n & 1) == 0) { /* the diagonal runs from north-west to south-east */
        out[0] = (rqt_triangle){ne, nw, se};
        out[1] = (rqt_triangle){sw, se, nw};
    } else {
        out[0] = (rqt_triangle){nw, sw, ne};
        out[1] = (rqt_triangle){se, ne, sw};
    }
    out[2] = (rqt_triangle){center, nw, ne};
    out[3] = (rqt_triangle){center, ne, se};
    out[4] = (rqt_triangle){center, se, sw};
    out[5] = (rqt_triangle){center, sw, nw};
}

size_t tile_bytes(const rqt_lattice *lattice, int b, bool has_voids) {
    const size_t n = ((size_t)1 << b) + 1;
    return n * n * (sizeof(rqt_code) + (has_voids ? 1 : 0)) + (size_t)(lattice->K - b + 1) * sizeof(upper_part);
}

rqt_status tile_create(error_tile *tile, const coarse_lattice *coarse, const rqt_allocator *allocator) {
    memset(tile, 0, sizeof *tile);
    tile->field = coarse->field;
    tile->coarse = coarse;
    tile->b = coarse->b;
    tile->stride = ((size_t)1 << coarse->b) + 1;
    const size_t n = tile->stride * tile->stride;
    tile->code = memory_take(allocator, n * sizeof *tile->code);
    if (coarse->valid) tile->outline = memory_take(allocator, n);
    tile->upper = memory_take(allocator, (size_t)(coarse->field->lattice.K - coarse->b + 1) * sizeof *tile->upper);
    if (tile->code && tile->upper && (tile->outline || !coarse->valid)) return RQT_OK;
    tile_free(tile, allocator);
    return RQT_NO_MEMORY;
}

void tile_free(error_tile *tile, const rqt_allocator *allocator) {
    memory_drop(allocator, tile->code);
    memory_drop(allocator, tile->outline);
    memory_drop(allocator, tile->upper);
    memset(tile, 0, sizeof *tile);
}

static int32_t smaller(int32_t a, int32_t b) {
    return a < b ? a : b;
}

static void raise_error(error_tile *tile, rqt_vertex v, rqt_code code, bool mixed) {
    const size_t at = (size_t)(v.y - tile->y) * tile->stride + (size_t)(v.x - tile->x);
    if (code > tile->code[at]) tile->code[at] = code;
    if (mixed) {
        tile->outline[at] = 1; /* there are voids. NOLINT(clang-analyzer-core.NullDereference) */
        tile->any_outline = true;
    }
}

/* The samples of a cell. */
static sample_window window_of(const deviation_field *s, int32_t x, int32_t y, int n) {
    const int32_t side = 1 << n;
    return (sample_window){x, y, x + side < s->width ? x + side : s->width - 1,
                           y + side < s->height ? y + side : s->height - 1};
}

static int window_state(const deviation_field *s, const sample_window *w) {
    if (!s->valid) return HAS_VALID;
    const size_t n = (size_t)(w->x1 - w->x0 + 1);
    int state = 0;
    for (int32_t y = w->y0; y <= w->y1 && state != (HAS_VALID | HAS_VOID); y++) {
        const uint8_t *valid = s->valid + sample_index(s, w->x0, y);
        if (memchr(valid, 0, n)) state |= HAS_VOID;
        if (memchr(valid, 1, n)) state |= HAS_VALID;
    }
    return state;
}

/* The triangles of one cell, each by itself. */
static void measure_cell(error_tile *tile, int32_t x, int32_t y, int n) {
    const deviation_field *s = tile->field;
    const sample_window window = window_of(s, x, y, n);
    rqt_triangle triangle[CELL_TRIANGLES];
    cell_triangles(x, y, n, triangle);
    for (int i = 0; i < CELL_TRIANGLES; i++) {
        const rqt_triangle *t = &triangle[i];
        if (!triangle_has_area(s, t)) continue;
        const plane_triangle plane = triangle_of_samples(s, t);
        const triangle_part part = measure_triangle(s, &plane, &window);
        const bool mixed = part.state == (HAS_VALID | HAS_VOID);
        rqt_code code = part.code;
        if (mixed) {
            const rqt_code ground = outline_code(s, t);
            if (ground > code) code = ground;
        }
        raise_error(tile, split_vertex(t), code, mixed);
    }
}

/* The cells of sides up to 2^levels that are inside the raster and without voids. */
static void measure_small_cells(error_tile *tile, int levels) {
    const deviation_field *s = tile->field;
    const int32_t side = 1 << tile->b, rows = 1 << levels;
    for (int32_t y = 0; y < side && tile->y + y < s->height - 1; y += rows)
        for (int32_t x = 0; x < side && tile->x + x < s->width - 1; x += STRIP_COLUMNS) {
            const sample_window window = {tile->x + x, tile->y + y,
                                          smaller(tile->x + smaller(x + STRIP_COLUMNS, side), s->width - 1),
                                          smaller(tile->y + y + rows, s->height - 1)};
            const int state = window_state(s, &window);
            if (state == HAS_VOID) continue;
            const size_t at = sample_index(s, window.x0, window.y0);
            const cell_strip strip = {.z = s->q + at,
                                      .valid = state == HAS_VALID ? NULL : s->valid + at,
                                      .stride = (size_t)s->width,
                                      .columns = window.x1 - window.x0 + 1,
                                      .rows = window.y1 - window.y0 + 1,
                                      .x = window.x0,
                                      .y = window.y0,
                                      .levels = levels,
                                      .code = tile->code + (size_t)y * tile->stride + (size_t)x,
                                      .code_stride = tile->stride};
            s->kernels->cells(&strip, &s->scale);
        }
}

/* All triangles of a cell of side 2^n with n > 0, but for the cells that are done: small, inside and without voids.
 * pure: this one is inside and without voids. */
static void measure_cells(error_tile *tile, int32_t x, int32_t y, int n, int levels, bool pure) {
    const deviation_field *s = tile->field;
    const int32_t side = 1 << n, half = side / 2;
    if (x >= s->width - 1 || y >= s->height - 1) return; /* no area */
    if (!pure) {
        const sample_window window = window_of(s, x, y, n);
        const int state = window_state(s, &window);
        if (state == HAS_VOID) return;
        pure = state == HAS_VALID && x + side < s->width && y + side < s->height;
    }
    if (pure && n <= levels) return;
    measure_cell(tile, x, y, n);
    if (n == 1) return;
    for (int i = 0; i < 4; i++)
        measure_cells(tile, x + (i & 1 ? half : 0), y + (i & 2 ? half : 0), n - 1, levels, pure);
}

/* ------------------------------------------------------------------------------------- upper triangles */

static plane_triangle triangle_of_coarse(const coarse_lattice *coarse, const rqt_triangle *t) {
    plane_triangle out = {.t = *t, .has_plane = true};
    const rqt_vertex corner[3] = {t->apex, t->left, t->right};
    int32_t *const height[3] = {&out.apex, &out.left, &out.right};
    for (int i = 0; i < 3; i++) {
        const int32_t x = corner[i].x >> coarse->b, y = corner[i].y >> coarse->b;
        const size_t column = (size_t)(x < coarse->columns ? x : coarse->columns - 1);
        const size_t row = (size_t)(y < coarse->rows ? y : coarse->rows - 1);
        const size_t at = row * (size_t)coarse->columns + column;
        *height[i] = coarse->q[at];
        if (coarse->valid && !coarse->valid[at]) out.has_plane = false;
    }
    return out;
}

/* Samples that a tile shares with a triangle that it only touches belong to a tile inside the triangle, too. */
static void measure_upper(error_tile *tile) {
    const deviation_field *s = tile->field;
    const sample_window window = window_of(s, tile->x, tile->y, tile->b);
    for (int n = tile->b + 1; n <= s->lattice.K; n++) {
        upper_part *part = &tile->upper[n - tile->b - 1];
        rqt_triangle triangle[CELL_TRIANGLES];
        cell_triangles(tile->x >> n << n, tile->y >> n << n, n, triangle);
        for (int i = 0; i < CELL_TRIANGLES; i++) {
            triangle_part found = {0, 0};
            if (triangle_has_area(s, &triangle[i])) {
                const plane_triangle plane = triangle_of_coarse(tile->coarse, &triangle[i]);
                found = measure_triangle(s, &plane, &window);
            }
            part->code[i] = found.code;
            part->state[i] = (uint8_t)found.state;
        }
    }
}

void tile_measure(error_tile *tile, int32_t i, int32_t j) {
    const size_t n = tile->stride * tile->stride;
    tile->x = i << tile->b;
    tile->y = j << tile->b;
    tile->any_outline = false;
    memset(tile->code, 0, n * sizeof *tile->code);
    if (tile->outline) memset(tile->outline, 0, n);
    /* Small cells in 32 bits, where that is enough. */
    const int levels = tile->field->relief < CELL_RELIEF ? smaller(tile->b, CELL_LEVELS) : 0;
    if (levels > 0) measure_small_cells(tile, levels);
    if (tile->b > 0) measure_cells(tile, tile->x, tile->y, tile->b, levels, false);
    measure_upper(tile);
}
