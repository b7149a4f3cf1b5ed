/* sweep.c - exact errors, saturated, of a raster that passes by in bands of tiles.
 *
 * Two bands are kept, each with its samples and a code for every lattice vertex in it. Tiles of the newer band
 * write their raw errors straight into it; of the column of vertices that two tiles share the left one has a copy
 * of its own, so no two tiles write the same place. When the band is complete the copies are merged, and so is the
 * row that the two bands share. Then both are saturated as far as they go: a vertex of scale q < 2^b lies at most
 * 2^b / 2 from its band's ends and its descendants at most 3q from it, so in the older band all is final - what it
 * owes to the band before it came in by their common row, which is final since then.
 *
 * The arrays are laid out as the lattice is, up to the end of the tile that follows the last one: further out no
 * error reaches a scale below b. South of the last band only the rows at distance q are reached, one for each
 * scale.
 */
#include "error_tile.h"

typedef struct band_store {
    int32_t *q;       /* 2^b + 1 rows of samples */
    uint8_t *valid;   /* NULL: all */
    rqt_code *code;   /* 2^b + 1 rows of `columns` vertices */
    uint8_t *outline; /* NULL without voids */
} band_store;

struct rqt_sweep {
    rqt_allocator allocator;
    rqt_sweep_plan plan;
    deviation_field field;
    coarse_lattice coarse;
    int32_t side;         /* 2^b */
    int32_t bands, tiles; /* down, across */
    size_t columns;       /* of the arrays of codes */
    band_store store[2];  /* band r is in store[r & 1] */
    int32_t band;         /* the newest one; -1 before the first */
    /* South of the last band: row 2^a past it for each scale a < b, and one row of zeros for all others. */
    rqt_code *past_code;
    uint8_t *past_outline;
    /* What a tile has to say beside its own part of the band. */
    rqt_code *right_code; /* tiles * (2^b + 1): the column shared with the next tile */
    uint8_t *right_outline;
    upper_part *upper; /* tiles * (K - b) */
    error_tile *tile;  /* one a worker */
};

static int levels_above(const rqt_sweep_plan *plan) {
    return plan->lattice.K - plan->b;
}

static size_t columns_of(const rqt_sweep_plan *plan) {
    const int64_t side = (int64_t)1 << plan->b, all = ((int64_t)1 << plan->lattice.K) + 1;
    const int64_t wanted = (tile_count(plan->lattice.width, plan->b) + 1) * side + 1;
    return (size_t)(wanted < all ? wanted : all);
}

/* Sizes of the arrays, in elements. */
typedef struct sweep_sizes {
    size_t samples, vertices, past, right, upper;
} sweep_sizes;

static sweep_sizes sizes_of(const rqt_sweep_plan *plan) {
    const size_t rows = ((size_t)1 << plan->b) + 1, tiles = (size_t)tile_count(plan->lattice.width, plan->b);
    return (sweep_sizes){.samples = rows * (size_t)plan->lattice.width,
                         .vertices = rows * columns_of(plan),
                         .past = (size_t)(plan->b + 1) * columns_of(plan),
                         .right = tiles * rows,
                         .upper = tiles * (size_t)(levels_above(plan) + 1)};
}

size_t rqt_sweep_bytes(const rqt_sweep_plan *plan) {
    const sweep_sizes n = sizes_of(plan);
    const size_t mask = plan->has_voids ? 1 : 0, vertex = sizeof(rqt_code) + mask;
    return sizeof(rqt_sweep) + 2 * (n.samples * (sizeof(int32_t) + mask) + n.vertices * vertex) +
           (n.past + n.right) * vertex + n.upper * sizeof(upper_part) +
           coarse_bytes(&plan->lattice, plan->b, plan->has_voids) +
           (size_t)plan->workers * (sizeof(error_tile) + tile_bytes(&plan->lattice, plan->b, plan->has_voids));
}

/* ------------------------------------------------------------------------------------------------ creation */

static bool plan_is_valid(const rqt_sweep_plan *plan) {
    const rqt_lattice *l = &plan->lattice;
    rqt_lattice right;
    if (rqt_lattice_init(&right, l->width, l->height) != RQT_OK || right.K != l->K) return false;
    if (!rqt_unit_is_valid(&plan->unit) || !(plan->cost.cell > 0) || !(plan->cost.c > 0)) return false;
    /* The lattice of a raster of 2 by 2 has no vertex but its corners. */
    return plan->b >= (l->K > 0 ? 1 : 0) && plan->b <= l->K && plan->workers >= 1;
}

static void *take(rqt_sweep *sweep, size_t count, size_t size, bool *failed) {
    void *const p = memory_take(&sweep->allocator, count * size);
    if (p)
        memset(p, 0, count * size);
    else
        *failed = true;
    return p;
}

static rqt_status take_everything(rqt_sweep *sweep) {
    const rqt_sweep_plan *plan = &sweep->plan;
    const sweep_sizes n = sizes_of(plan);
    bool failed = false;
    for (int i = 0; i < 2; i++) {
        band_store *store = &sweep->store[i];
        store->q = take(sweep, n.samples, sizeof *store->q, &failed);
        store->code = take(sweep, n.vertices, sizeof *store->code, &failed);
        if (plan->has_voids) {
            store->valid = take(sweep, n.samples, 1, &failed);
            store->outline = take(sweep, n.vertices, 1, &failed);
        }
    }
    sweep->past_code = take(sweep, n.past, sizeof *sweep->past_code, &failed);
    sweep->right_code = take(sweep, n.right, sizeof *sweep->right_code, &failed);
    if (plan->has_voids) {
        sweep->past_outline = take(sweep, n.past, 1, &failed);
        sweep->right_outline = take(sweep, n.right, 1, &failed);
    }
    sweep->upper = take(sweep, n.upper, sizeof *sweep->upper, &failed);
    sweep->tile = take(sweep, (size_t)plan->workers, sizeof *sweep->tile, &failed);
    if (failed) return RQT_NO_MEMORY;
    rqt_status status = coarse_create(&sweep->coarse, &sweep->field, plan->b, plan->has_voids, &sweep->allocator);
    for (int i = 0; i < plan->workers && status == RQT_OK; i++)
        status = tile_create(&sweep->tile[i], &sweep->coarse, &sweep->allocator);
    return status;
}

rqt_status sweep_create(const rqt_sweep_plan *plan, const error_kernels *kernels, const rqt_allocator *allocator,
                        rqt_sweep **sweep) {
    *sweep = NULL;
    if (!plan_is_valid(plan)) return RQT_INVALID;
    rqt_sweep *s = memory_take(allocator, sizeof *s);
    if (!s) return RQT_NO_MEMORY;
    memset(s, 0, sizeof *s);
    s->allocator = *allocator;
    s->plan = *plan;
    s->side = 1 << plan->b;
    s->bands = tile_count(plan->lattice.height, plan->b);
    s->tiles = tile_count(plan->lattice.width, plan->b);
    s->columns = columns_of(plan);
    s->band = -1;
    s->field = (deviation_field){.lattice = plan->lattice,
                                 .width = plan->lattice.width,
                                 .height = plan->lattice.height,
                                 .stride = (size_t)plan->lattice.width,
                                 .cost = plan->cost,
                                 .relief = plan->max_q > plan->min_q ? (int64_t)plan->max_q - plan->min_q : 0,
                                 .kernels = kernels};
    code_scale_init(&s->field.scale, &plan->unit);
    const rqt_status status = take_everything(s);
    if (status == RQT_OK)
        *sweep = s;
    else
        rqt_sweep_free(s);
    return status;
}

rqt_status rqt_sweep_create(const rqt_sweep_plan *plan, const rqt_allocator *allocator, rqt_sweep **sweep) {
    return sweep_create(plan, error_kernels_best(), allocator, sweep);
}

void rqt_sweep_free(rqt_sweep *sweep) {
    if (!sweep) return;
    const rqt_allocator allocator = sweep->allocator;
    for (int i = 0; i < 2; i++) {
        memory_drop(&allocator, sweep->store[i].q);
        memory_drop(&allocator, sweep->store[i].valid);
        memory_drop(&allocator, sweep->store[i].code);
        memory_drop(&allocator, sweep->store[i].outline);
    }
    for (int i = 0; i < sweep->plan.workers && sweep->tile; i++) tile_free(&sweep->tile[i], &allocator);
    coarse_free(&sweep->coarse, &allocator);
    memory_drop(&allocator, sweep->past_code);
    memory_drop(&allocator, sweep->past_outline);
    memory_drop(&allocator, sweep->right_code);
    memory_drop(&allocator, sweep->right_outline);
    memory_drop(&allocator, sweep->upper);
    memory_drop(&allocator, sweep->tile);
    memory_drop(&allocator, sweep);
}

int32_t rqt_sweep_bands(const rqt_sweep *sweep) {
    return sweep->bands;
}

int32_t rqt_sweep_tiles(const rqt_sweep *sweep) {
    return sweep->tiles;
}

bool rqt_sweep_wants(const rqt_sweep *sweep, int32_t y) {
    return coarse_wants(&sweep->coarse, y);
}

void rqt_sweep_first(rqt_sweep *sweep, int32_t y, const int32_t *q, const uint8_t *valid) {
    coarse_take(&sweep->coarse, y, q, valid);
}

/* ------------------------------------------------------------------------------------------------- one band */

/* The samples of a band: its first row, and how many. */
static int32_t first_row_of(const rqt_sweep *sweep, int32_t band) {
    return band * sweep->side;
}

static int32_t rows_of(const rqt_sweep *sweep, int32_t band) {
    const int32_t rest = sweep->plan.lattice.height - first_row_of(sweep, band);
    return rest < sweep->side + 1 ? rest : sweep->side + 1;
}

void rqt_sweep_begin(rqt_sweep *sweep, int32_t band, int32_t *first, int32_t *count, int32_t **q, uint8_t **valid) {
    const size_t width = (size_t)sweep->plan.lattice.width;
    band_store *store = &sweep->store[band & 1];
    const band_store *before = &sweep->store[(band + 1) & 1];
    const int32_t known = band > 0 ? 1 : 0; /* the row that is shared with the band before */
    if (known) {
        memcpy(store->q, before->q + (size_t)sweep->side * width, width * sizeof *store->q);
        if (store->valid) memcpy(store->valid, before->valid + (size_t)sweep->side * width, width);
    }
    *first = first_row_of(sweep, band) + known;
    *count = rows_of(sweep, band) - known;
    *q = store->q + (size_t)known * width;
    *valid = store->valid ? store->valid + (size_t)known * width : NULL;
    sweep->band = band;
    sweep->field.first_row = first_row_of(sweep, band);
    sweep->field.q = store->q;
    sweep->field.valid = store->valid;
}

void rqt_sweep_tile(rqt_sweep *sweep, int worker, int32_t tile) {
    error_tile *t = &sweep->tile[worker];
    band_store *store = &sweep->store[sweep->band & 1];
    const size_t side = (size_t)sweep->side, left = (size_t)tile * side, right = (size_t)tile * (side + 1);
    const size_t levels = (size_t)levels_above(&sweep->plan);
    tile_measure(t, tile, sweep->band);
    for (size_t y = 0; y <= side; y++) {
        memcpy(store->code + y * sweep->columns + left, t->code + y * t->stride, side * sizeof *t->code);
        sweep->right_code[right + y] = t->code[y * t->stride + side];
        if (!t->outline) continue;
        memcpy(store->outline + y * sweep->columns + left, t->outline + y * t->stride, side);
        sweep->right_outline[right + y] = t->outline[y * t->stride + side];
    }
    memcpy(sweep->upper + (size_t)tile * (levels + 1), t->upper, levels * sizeof *t->upper);
}

static void raise_to(rqt_code *code, rqt_code other) {
    if (other > *code) *code = other;
}

/* The columns that tiles share, and the upper triangles. */
static void merge_tiles(rqt_sweep *sweep, band_store *store) {
    const size_t side = (size_t)sweep->side, levels = (size_t)levels_above(&sweep->plan);
    for (int32_t tile = 0; tile < sweep->tiles; tile++) {
        const size_t right = (size_t)tile * (side + 1), column = ((size_t)tile + 1) * side;
        const bool last = tile == sweep->tiles - 1;
        for (size_t y = 0; y <= side; y++) {
            rqt_code *const code = store->code + y * sweep->columns + column;
            /* Past the last tile lies what saturation has left there in an earlier band. */
            if (last) memset(code, 0, (sweep->columns - column) * sizeof *code);
            raise_to(code, sweep->right_code[right + y]);
            if (!store->outline) continue;
            uint8_t *const outline = store->outline + y * sweep->columns + column;
            if (last) memset(outline, 0, sweep->columns - column);
            *outline |= sweep->right_outline[right + y];
        }
        coarse_add(&sweep->coarse, tile, sweep->band, sweep->upper + (size_t)tile * (levels + 1));
    }
}

/* The row that two bands share, in both. */
static void merge_rows(rqt_sweep *sweep, band_store *above, band_store *below) {
    const size_t at = (size_t)sweep->side * sweep->columns;
    for (size_t x = 0; x < sweep->columns; x++) {
        raise_to(&above->code[at + x], below->code[x]);
        below->code[x] = above->code[at + x];
        if (above->outline) below->outline[x] = above->outline[at + x] |= below->outline[x];
    }
}

/* ----------------------------------------------------------------------------------------------- saturation */

typedef struct row {
    rqt_code *code;
    uint8_t *outline; /* NULL without voids */
} row;

static row row_of_band(const rqt_sweep *sweep, int32_t band, int32_t y) {
    const band_store *store = &sweep->store[band & 1];
    const size_t at = (size_t)(y - first_row_of(sweep, band)) * sweep->columns;
    return (row){store->code + at, store->outline ? store->outline + at : NULL};
}

/* South of the last band. a: the scale of the row, b for one that no error reaches. */
static row row_past(const rqt_sweep *sweep, int a) {
    const size_t at = (size_t)a * sweep->columns;
    return (row){sweep->past_code + at, sweep->past_outline ? sweep->past_outline + at : NULL};
}

/* Row y in band `band`, the one after it, or past the last one. */
static row row_at(const rqt_sweep *sweep, int32_t band, int32_t y) {
    const int32_t end = first_row_of(sweep, band) + sweep->side;
    if (y <= end) return row_of_band(sweep, band, y);
    if (band < sweep->band) return row_of_band(sweep, band + 1, y);
    const int32_t past = y - end;
    return row_past(sweep,
                    (past & (past - 1)) == 0 && past < sweep->side ? __builtin_ctz((unsigned)past) : sweep->plan.b);
}

static void pull(const row *to, size_t at, const row *from, size_t x) {
    raise_to(&to->code[at], from->code[x]);
    if (to->outline) to->outline[at] |= from->outline[x];
}

/* Vertices first, first + step, ... of a row take the maximum over their four children, at distance `reach` along
 * both axes or both diagonals. A child outside the arrays has no error. */
static void pull_row(const rqt_sweep *sweep, const row rows[3], size_t first, size_t step, size_t reach,
                     bool diagonal) {
    const row *up = &rows[0], *at = &rows[1], *down = &rows[2];
    for (size_t x = first; x < sweep->columns; x += step) {
        const bool left = x >= reach, right = x + reach < sweep->columns;
        if (diagonal) {
            if (up->code && left) pull(at, x, up, x - reach);
            if (up->code && right) pull(at, x, up, x + reach);
            if (down->code && left) pull(at, x, down, x - reach);
            if (down->code && right) pull(at, x, down, x + reach);
        } else {
            if (left) pull(at, x, at, x - reach);
            if (right) pull(at, x, at, x + reach);
            if (up->code) pull(at, x, up, x);
            if (down->code) pull(at, x, down, x);
        }
    }
}

/* Rows y - reach, y and y + reach, as far as they are in the window. */
static void rows_around(const rqt_sweep *sweep, int32_t band, int32_t y, int32_t reach, int32_t y0, int32_t y1,
                        row out[3]) {
    out[0] = y - reach >= y0 ? row_at(sweep, band, y - reach) : (row){NULL, NULL};
    out[1] = row_at(sweep, band, y);
    out[2] = y + reach <= y1 ? row_at(sweep, band, y + reach) : (row){NULL, NULL};
}

/* Saturates bands `band` and band + 1, or what is past the last one, from all that is known of them. */
static void saturate_window(rqt_sweep *sweep, int32_t band) {
    const int32_t y0 = first_row_of(sweep, band), whole = 1 << sweep->plan.lattice.K;
    int32_t y1 = y0 + 2 * sweep->side;
    if (y1 > whole) y1 = whole;
    row rows[3];
    for (int scale = 0; scale < sweep->plan.b; scale++) {
        const int32_t q = 1 << scale;
        for (int32_t y = y0 + q; y <= y1; y += 2 * q) { /* centres from sides */
            if (row_at(sweep, band, y).code == row_past(sweep, sweep->plan.b).code) continue;
            rows_around(sweep, band, y, q, y0, y1, rows);
            pull_row(sweep, rows, (size_t)q, 2 * (size_t)q, (size_t)q, false);
        }
        if (scale + 1 == sweep->plan.b) break;
        for (int32_t y = y0; y <= y1; y += 2 * q) { /* sides of the next scale from centres of this one */
            if (row_at(sweep, band, y).code == row_past(sweep, sweep->plan.b).code) continue;
            rows_around(sweep, band, y, q, y0, y1, rows);
            const bool odd = ((y - y0) / (2 * q)) & 1;
            pull_row(sweep, rows, odd ? 0 : 2 * (size_t)q, 4 * (size_t)q, (size_t)q, true);
        }
    }
}

/* The centre of a tile is a child of two of its corners. */
static void push_centers(rqt_sweep *sweep, int32_t band, int32_t row_of_tiles) {
    if (sweep->plan.b == 0) return;
    const int32_t side = sweep->side, y = row_of_tiles * side + side / 2;
    if (y > 1 << sweep->plan.lattice.K) return;
    const row from = row_at(sweep, band, y);
    rqt_errors *errors = &sweep->coarse.errors;
    for (size_t x = (size_t)side / 2; x < sweep->columns; x += (size_t)side) {
        rqt_vertex parents[2];
        const int n = rqt_vertex_parents(&sweep->plan.lattice, (rqt_vertex){(int32_t)x, y}, parents);
        for (int i = 0; i < n; i++) {
            const int32_t column = lattice_slot(parents[i].x / side, errors->lattice.width),
                          line = lattice_slot(parents[i].y / side, errors->lattice.height);
            if (column < 0 || line < 0) continue;
            const size_t at = (size_t)line * (size_t)errors->columns + (size_t)column;
            raise_to(&errors->code[at], from.code[x]);
            if (from.outline && from.outline[x]) {
                errors->outline[at] = 1;
                errors->any_outline = true;
            }
        }
    }
}

void rqt_sweep_end(rqt_sweep *sweep) {
    const int32_t band = sweep->band;
    merge_tiles(sweep, &sweep->store[band & 1]);
    if (band > 0) {
        merge_rows(sweep, &sweep->store[(band + 1) & 1], &sweep->store[band & 1]);
        saturate_window(sweep, band - 1);
        merge_rows(sweep, &sweep->store[(band + 1) & 1], &sweep->store[band & 1]);
        push_centers(sweep, band - 1, band - 1);
    }
    if (band == sweep->bands - 1) {
        saturate_window(sweep, band);
        push_centers(sweep, band, band);
        push_centers(sweep, band, band + 1);
    }
}

void rqt_sweep_finish(rqt_sweep *sweep) {
    coarse_complete(&sweep->coarse);
    rqt_errors_saturate(&sweep->coarse.errors);
}

/* ------------------------------------------------------------------------------------------------- results */

rqt_band rqt_sweep_band(const rqt_sweep *sweep, int32_t band) {
    const band_store *store = &sweep->store[band & 1];
    return (rqt_band){.first_row = first_row_of(sweep, band),
                      .rows = rows_of(sweep, band),
                      .q = store->q,
                      .valid = store->valid,
                      .sweep = sweep,
                      .band = band};
}

void rqt_band_errors(const rqt_band *band, int32_t x, int32_t y, int32_t step, int32_t n, rqt_code *codes,
                     uint8_t *outline) {
    const rqt_sweep *sweep = band->sweep;
    const int32_t mask = sweep->side - 1;
    const int32_t end = first_row_of(sweep, band->band) + sweep->side;
    const bool last = band->band == sweep->bands - 1;
    const row from = y <= end ? row_of_band(sweep, band->band, y)
                     : last   ? row_at(sweep, band->band, y)
                              : row_past(sweep, sweep->plan.b);
    for (int32_t i = 0; i < n; i++) {
        const int64_t at = (int64_t)x + (int64_t)i * step;
        const bool known = at < (int64_t)sweep->columns && ((at | y) & mask) != 0;
        codes[i] = known ? from.code[at] : 0;
        if (outline) outline[i] = known && from.outline ? from.outline[at] : 0;
    }
}

rqt_code rqt_band_error(const rqt_band *band, rqt_vertex v, bool *outline) {
    rqt_code code;
    uint8_t bit;
    rqt_band_errors(band, v.x, v.y, 1, 1, &code, &bit);
    *outline = bit != 0;
    return code;
}

rqt_code rqt_sweep_coarse(const rqt_sweep *sweep, rqt_vertex v, int32_t *q, uint8_t *flags) {
    const coarse_lattice *coarse = &sweep->coarse;
    const rqt_vertex tile = {v.x / sweep->side, v.y / sweep->side};
    const int32_t column = tile.x < coarse->columns ? tile.x : coarse->columns - 1;
    const int32_t line = tile.y < coarse->rows ? tile.y : coarse->rows - 1;
    const size_t at = (size_t)line * (size_t)coarse->columns + (size_t)column;
    bool outline;
    const rqt_code code = rqt_errors_at(&coarse->errors, tile, &outline);
    *q = coarse->q[at];
    *flags = (uint8_t)((!coarse->valid || coarse->valid[at] ? RQT_VALID : 0) | (outline ? RQT_OUTLINE : 0));
    return code;
}
