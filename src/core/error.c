/* error.c - e(P) and the outline bit x(P) of every lattice vertex of a raster in memory: exact, over all samples.
 *
 * The same tiles as a sweep's (sweep.c), one after the other. What they find goes into one array; the few vertices
 * past the last sample sit in extra columns and rows.
 */
#include "error_tile.h"

#define TILE_B 8 /* 2^8 + 1 samples a side: 264 kB of heights, half of a small second-level cache */

static int smaller_b(const rqt_lattice *lattice) {
    return lattice->K < TILE_B ? lattice->K : TILE_B;
}

size_t rqt_errors_bytes(const rqt_lattice *lattice) {
    const int b = smaller_b(lattice);
    return (size_t)lattice_slots(lattice, lattice->width) * (size_t)lattice_slots(lattice, lattice->height) *
               (sizeof(rqt_code) + 1) +
           coarse_bytes(lattice, b, true) + tile_bytes(lattice, b, true);
}

static rqt_status take_errors(const rqt_lattice *lattice, const rqt_allocator *allocator, rqt_errors *errors) {
    errors->lattice = *lattice;
    errors->columns = lattice_slots(lattice, lattice->width);
    errors->rows = lattice_slots(lattice, lattice->height);
    const size_t n = (size_t)errors->columns * (size_t)errors->rows;
    errors->code = memory_take(allocator, n * sizeof *errors->code);
    errors->outline = memory_take(allocator, n);
    if (!errors->code || !errors->outline) return RQT_NO_MEMORY;
    memset(errors->code, 0, n * sizeof *errors->code);
    memset(errors->outline, 0, n);
    return RQT_OK;
}

static void raise_at(rqt_errors *errors, size_t at, rqt_code code, uint8_t outline) {
    if (code > errors->code[at]) errors->code[at] = code;
    errors->outline[at] |= outline;
}

/* The vertices of row `line` of a tile, from column x on. */
static void take_row(rqt_errors *errors, const error_tile *tile, int32_t line) {
    const int32_t side = 1 << tile->b, row = lattice_slot(tile->y + line, errors->lattice.height);
    if (row < 0) return;
    const rqt_code *const code = tile->code + (size_t)line * tile->stride;
    const uint8_t *const outline = tile->any_outline ? tile->outline + (size_t)line * tile->stride : NULL;
    const size_t to = (size_t)row * (size_t)errors->columns;
    int32_t x = 0;
    if (line > 0 && line < side &&
        tile->x + side < errors->lattice.width) { /* nobody else knows of its inner ones */
        const size_t first = to + (size_t)tile->x + 1, n = (size_t)side - 1;
        raise_at(errors, first - 1, code[0], outline ? outline[0] : 0);
        memcpy(errors->code + first, code + 1, n * sizeof *code);
        if (outline) memcpy(errors->outline + first, outline + 1, n);
        x = side;
    }
    for (; x <= side; x++) {
        const int32_t column = lattice_slot(tile->x + x, errors->lattice.width);
        if (column >= 0) raise_at(errors, to + (size_t)column, code[x], outline ? outline[x] : 0);
    }
}

static void take_tile(rqt_errors *errors, const error_tile *tile) {
    for (int32_t line = 0; line <= 1 << tile->b; line++) take_row(errors, tile, line);
    errors->any_outline = errors->any_outline || tile->any_outline;
}

/* The vertices of scale >= b. */
static void take_coarse(rqt_errors *errors, const coarse_lattice *coarse) {
    const int K = coarse->errors.lattice.K;
    for (int n = 1; n <= K; n++)
        for (int32_t j = 0; (int64_t)j << n < coarse->rows - 1; j++)
            for (int32_t i = 0; (int64_t)i << n < coarse->columns - 1; i++) {
                rqt_triangle triangle[CELL_TRIANGLES];
                cell_triangles(i << n, j << n, n, triangle);
                for (int t = 0; t < CELL_TRIANGLES; t++) {
                    const rqt_vertex v = split_vertex(&triangle[t]);
                    const int32_t column = lattice_slot(v.x << coarse->b, errors->lattice.width),
                                  row = lattice_slot(v.y << coarse->b, errors->lattice.height);
                    if (column < 0 || row < 0) continue;
                    bool outline;
                    const rqt_code code = rqt_errors_at(&coarse->errors, v, &outline);
                    raise_at(errors, (size_t)row * (size_t)errors->columns + (size_t)column, code, outline);
                }
            }
    errors->any_outline = errors->any_outline || coarse->errors.any_outline;
}

typedef struct watcher {
    bool (*progress)(void *context, double done);
    void *context;
} watcher;

static rqt_status measure_tiles(error_tile *tile, coarse_lattice *coarse, const watcher *watch,
                                rqt_errors *errors) {
    const rqt_lattice *lattice = &errors->lattice;
    const int32_t across = tile_count(lattice->width, tile->b), down = tile_count(lattice->height, tile->b);
    const double all = (double)across * down;
    double done = 0;
    for (int32_t j = 0; j < down; j++)
        for (int32_t i = 0; i < across; i++) {
            tile_measure(tile, i, j);
            take_tile(errors, tile);
            coarse_add(coarse, i, j, tile->upper);
            done++;
            if (watch->progress && !watch->progress(watch->context, done / all)) return RQT_INTERRUPTED;
        }
    coarse_complete(coarse);
    take_coarse(errors, coarse);
    return RQT_OK;
}

static rqt_status compute(const deviation_field *field, int b, const rqt_allocator *allocator, const watcher *watch,
                          rqt_errors *errors) {
    coarse_lattice coarse;
    error_tile tile;
    rqt_status status = coarse_create(&coarse, field, b, field->valid != NULL, allocator);
    if (status != RQT_OK) return status;
    for (int32_t y = 0; y < field->height; y++) {
        const size_t at = sample_index(field, 0, y);
        if (coarse_wants(&coarse, y))
            coarse_take(&coarse, y, field->q + at, field->valid ? field->valid + at : NULL);
    }
    status = tile_create(&tile, &coarse, allocator);
    if (status == RQT_OK) {
        status = measure_tiles(&tile, &coarse, watch, errors);
        tile_free(&tile, allocator);
    }
    coarse_free(&coarse, allocator);
    return status;
}

rqt_status errors_compute(const rqt_grid *grid, const rqt_unit *unit, const rqt_void_cost *cost, int b,
                          const error_kernels *kernels, const rqt_allocator *allocator,
                          bool (*progress)(void *context, double done), void *context, rqt_errors *errors) {
    memset(errors, 0, sizeof *errors);
    if (!rqt_unit_is_valid(unit) || !(cost->cell > 0) || !(cost->c > 0)) return RQT_INVALID;
    deviation_field field = {.lattice = grid->lattice,
                             .width = grid->lattice.width,
                             .height = grid->lattice.height,
                             .stride = (size_t)grid->lattice.width,
                             .q = grid->q,
                             .valid = grid->valid,
                             .cost = *cost,
                             .relief = relief_of(grid),
                             .kernels = kernels};
    code_scale_init(&field.scale, unit);
    rqt_status status = take_errors(&grid->lattice, allocator, errors);
    if (status == RQT_OK) status = compute(&field, b, allocator, &(watcher){progress, context}, errors);
    if (status != RQT_OK) rqt_errors_free(errors, allocator);
    return status;
}

rqt_status rqt_errors_compute(const rqt_grid *grid, const rqt_unit *unit, const rqt_void_cost *cost,
                              const rqt_allocator *allocator, bool (*progress)(void *context, double done),
                              void *context, rqt_errors *errors) {
    return errors_compute(grid, unit, cost, smaller_b(&grid->lattice), error_kernels_best(), allocator, progress,
                          context, errors);
}

void rqt_errors_free(rqt_errors *errors, const rqt_allocator *allocator) {
    memory_drop(allocator, errors->code);
    memory_drop(allocator, errors->outline);
    memset(errors, 0, sizeof *errors);
}

rqt_code rqt_errors_at(const rqt_errors *errors, rqt_vertex v, bool *outline) {
    const int32_t column = lattice_slot(v.x, errors->lattice.width),
                  row = lattice_slot(v.y, errors->lattice.height);
    *outline = false;
    if (column < 0 || row < 0) return 0;
    const size_t at = (size_t)row * (size_t)errors->columns + (size_t)column;
    *outline = errors->outline[at] != 0;
    return errors->code[at];
}
