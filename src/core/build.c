/* build.c - the blocks of all levels out of the bands of a sweep, in bounded memory.
 *
 * A block is gathered from where its vertices are: a final band holds all of those of blocks that fit into a tile;
 * of the coarser ones, every vertex is one of the kept lattice (every S-th vertex of every S-th row, S =
 * 2^(b-k+1)), which grows on a scratch file, a few rows per band. Vertices of scale >= b, the corners of tiles, are
 * known at the very end only: in blocks of tiles they are corners, which the bytes of a block do not hold, and
 * summaries are completed last.
 *
 * em of a block follows from its children as they are gathered. What a block's parent must know of it is its em and
 * the largest error of the vertices that the parent's grid lacks, those in odd columns or rows of the block's own.
 */
#include "internal.h"

typedef struct node {
    rqt_code em, below; /* below: the larger of em and the errors in odd columns and rows */
    uint8_t outline, outline_below;
} node;

typedef struct level_nodes {
    int32_t columns, rows; /* blocks */
    node *node;            /* row by row */
} level_nodes;

/* A vertex of the kept lattice, as it stands in the scratch file. */
typedef struct kept {
    int32_t q;
    rqt_code error;
    uint8_t flags, zero;
} kept;

struct rqt_build {
    rqt_allocator allocator;
    rqt_lattice lattice;
    int k, b;
    int levels, in_tile; /* levels; the coarsest whose blocks fit into a tile */
    rqt_scratch_file file;
    level_nodes level[RQT_MAX_K + 1];
    size_t count;
    int keep;              /* log2 of S */
    int32_t columns, rows; /* of the kept lattice */
    kept *row;             /* one row of it */
    rqt_code *codes;
    uint8_t *bits;
    rqt_code max_error;
};

/* Blocks that cells of `side` samples make along so many samples. */
static int32_t blocks_along(int32_t samples, int64_t side) {
    const int64_t last = samples > 1 ? samples - 1 : 1;
    return (int32_t)((last + side - 1) / side);
}

static int64_t side_of(const rqt_lattice *lattice, int level) {
    return (int64_t)1 << (lattice->K - level);
}

size_t rqt_build_bytes(const rqt_lattice *lattice, int k, int b) {
    size_t bytes = sizeof(rqt_build);
    for (int level = 0; level < rqt_block_levels(lattice, k); level++)
        bytes += (size_t)blocks_along(lattice->width, side_of(lattice, level)) *
                 (size_t)blocks_along(lattice->height, side_of(lattice, level)) * sizeof(node);
    const size_t columns = ((size_t)blocks_along(lattice->width, (int64_t)1 << b) << (k > 0 ? k - 1 : 0)) + 1;
    return bytes + columns * (sizeof(kept) + sizeof(rqt_code) + 1);
}

static bool take_memory(rqt_build *w) {
    for (int level = 0; level < w->levels; level++) {
        level_nodes *l = &w->level[level];
        l->columns = blocks_along(w->lattice.width, side_of(&w->lattice, level));
        l->rows = blocks_along(w->lattice.height, side_of(&w->lattice, level));
        const size_t n = (size_t)l->columns * (size_t)l->rows;
        l->node = memory_take(&w->allocator, n * sizeof *l->node);
        if (!l->node) return false;
        memset(l->node, 0, n * sizeof *l->node);
        w->count += n;
    }
    w->keep = w->b - w->k + 1;
    w->columns = (blocks_along(w->lattice.width, (int64_t)1 << w->b) << (w->k > 0 ? w->k - 1 : 0)) + 1;
    w->rows = (blocks_along(w->lattice.height, (int64_t)1 << w->b) << (w->k > 0 ? w->k - 1 : 0)) + 1;
    w->row = memory_take(&w->allocator, (size_t)w->columns * sizeof *w->row);
    w->codes = memory_take(&w->allocator, (size_t)w->columns * sizeof *w->codes);
    w->bits = memory_take(&w->allocator, (size_t)w->columns);
    return w->row && w->codes && w->bits;
}

rqt_status rqt_build_create(const rqt_lattice *lattice, int k, int b, const rqt_scratch_file *file,
                            const rqt_allocator *allocator, rqt_build **build) {
    *build = NULL;
    if (k < 0 || k > RQT_MAX_BLOCK_K || b < k || b > lattice->K || (k == 0 && lattice->K > 0) ||
        (!file && b < lattice->K))
        return RQT_INVALID;
    rqt_build *w = memory_take(allocator, sizeof *w);
    if (!w) return RQT_NO_MEMORY;
    memset(w, 0, sizeof *w);
    w->allocator = *allocator;
    w->lattice = *lattice;
    w->k = k;
    w->b = b;
    if (file) w->file = *file;
    w->levels = rqt_block_levels(lattice, k);
    w->in_tile = lattice->K - b;
    if (!take_memory(w)) {
        rqt_build_free(w);
        return RQT_NO_MEMORY;
    }
    *build = w;
    return RQT_OK;
}

void rqt_build_free(rqt_build *w) {
    if (!w) return;
    const rqt_allocator allocator = w->allocator;
    for (int level = 0; level < w->levels; level++) memory_drop(&allocator, w->level[level].node);
    memory_drop(&allocator, w->row);
    memory_drop(&allocator, w->codes);
    memory_drop(&allocator, w->bits);
    memory_drop(&allocator, w);
}

size_t rqt_build_count(const rqt_build *build) {
    return build->count;
}
int rqt_build_coarsest_in_tile(const rqt_build *build) {
    return build->in_tile;
}
int32_t rqt_build_cells(const rqt_build *build, int level) {
    return build->level[level].columns * build->level[level].rows;
}

/* ------------------------------------------------------------------------------------------------- em */

static node *node_at(const rqt_build *w, int level, int32_t i, int32_t j) {
    const level_nodes *l = &w->level[level];
    return i < l->columns && j < l->rows ? &l->node[(size_t)j * (size_t)l->columns + (size_t)i] : NULL;
}

/* em, from the children. */
static void settle_em(const rqt_build *w, const rqt_block_place *place, node *n) {
    for (int child = 0; child < 4 && place->stride > 1; child++) {
        const node *c = node_at(w, place->level + 1, 2 * place->i + (child & 1), 2 * place->j + (child >> 1));
        if (!c) continue;
        if (c->below > n->em) n->em = c->below;
        n->outline |= c->outline_below;
    }
}

/* What the parent must know: the errors of vertices that its grid lacks. */
static void settle_below(const rqt_block *block, node *n) {
    const int32_t side = (1 << block->k) + 1;
    rqt_code most = n->em;
    uint8_t flags = 0;
    for (int32_t v = 0; v < side; v++) {
        const rqt_code *error = block->error + (ptrdiff_t)v * side;
        const uint8_t *bits = block->flags + (ptrdiff_t)v * side;
        for (int32_t u = v & 1 ? 0 : 1; u < side; u += v & 1 ? 1 : 2) {
            most = error[u] > most ? error[u] : most;
            flags |= bits[u];
        }
    }
    n->below = most;
    n->outline_below = (uint8_t)(n->outline | ((flags & RQT_OUTLINE) != 0));
}

/* ------------------------------------------------------------------------------------------- summaries */

/* Vertices of a summary: four corners, two far ones. Returns their number; level 0 has no far ones. */
static int summary_places(const rqt_block_place *p, rqt_vertex at[6]) {
    for (int c = 0; c < 4; c++) at[c] = (rqt_vertex){p->x + (c & 1 ? p->side : 0), p->y + (c & 2 ? p->side : 0)};
    if (p->level == 0) return 4;
    /* c: the corner that is the parent's; a: the corners in the middle of the parent's sides. */
    const int32_t cx = p->i & 1 ? p->x + p->side : p->x, ax = p->i & 1 ? p->x : p->x + p->side;
    const int32_t cy = p->j & 1 ? p->y + p->side : p->y, ay = p->j & 1 ? p->y : p->y + p->side;
    at[4] = (rqt_vertex){2 * ax - cx, cy};
    at[5] = (rqt_vertex){cx, 2 * ay - cy};
    return 6;
}

static rqt_summary_vertex *summary_vertex(rqt_summary *summary, int n) {
    return n < 4 ? &summary->corner[n] : &summary->far[n - 4];
}

static rqt_summary_vertex coarse_vertex(const rqt_build *w, const rqt_sweep *sweep, rqt_vertex v) {
    rqt_summary_vertex out;
    out.error = rqt_sweep_coarse(sweep, v, &out.q, &out.flags);
    if (!lattice_has_area(&w->lattice, v)) {
        out.error = 0;
        out.flags &= RQT_VALID;
    }
    if (!(out.flags & RQT_VALID)) out.q = 0;
    return out;
}

static void summarize_center(const rqt_block *block, rqt_summary *summary) {
    if (block->k == 0) return;
    const size_t half = (size_t)1 << block->k >> 1, at = half * (2 * half + 1) + half;
    summary->center_error = block->error[at];
    summary->center_flags = block->flags[at];
}

void rqt_build_summary(const rqt_build *w, const rqt_sweep *sweep, rqt_block_number number, rqt_summary *summary) {
    rqt_block_place place;
    rqt_vertex at[6];
    if (rqt_block_locate(&w->lattice, w->k, number, &place) != RQT_OK) return;
    const int n = summary_places(&place, at);
    for (int v = 0; v < n; v++)
        if (rqt_vertex_scale(&w->lattice, at[v]) >= w->b)
            *summary_vertex(summary, v) = coarse_vertex(w, sweep, at[v]);
    const node *own = node_at(w, place.level, place.i, place.j);
    const node *parent = place.level > 0 ? node_at(w, place.level - 1, place.i / 2, place.j / 2) : NULL;
    summary->tol = (rqt_interval){own->em, parent ? parent->em : RQT_CODE_INFINITY};
    summary->exact = (rqt_interval){own->outline ? RQT_CODE_INFINITY : own->em,
                                    parent && !parent->outline ? parent->em : RQT_CODE_INFINITY};
}

/* ---------------------------------------------------------------------------------- blocks out of a band */

static uint8_t validity(const rqt_band *band, size_t at) {
    return !band->valid || band->valid[at] ? RQT_VALID : 0;
}

/* n samples of the band at lattice row y, from lattice column x on, `step` apart, clamped. */
static void gather_samples(const rqt_build *w, const rqt_band *band, int32_t x, int32_t y, int32_t step, int32_t n,
                           int32_t *q, uint8_t *flags) {
    const int32_t width = w->lattice.width, last_row = w->lattice.height - 1;
    const size_t row = (size_t)((y < last_row ? y : last_row) - band->first_row) * (size_t)width;
    const int64_t inside = x < width ? ((int64_t)width - 1 - x) / step + 1 : 0;
    const int32_t direct = inside < n ? (int32_t)inside : n;
    const int32_t *from = band->q + row;
    for (int32_t i = 0; i < direct; i++) q[i] = from[x + i * step];
    for (int32_t i = direct; i < n; i++) q[i] = from[width - 1];
    if (!band->valid) {
        memset(flags, RQT_VALID, (size_t)n);
        return;
    }
    for (int32_t i = 0; i < n; i++) {
        flags[i] = validity(band, row + (size_t)(i < direct ? x + i * step : width - 1));
        if (!flags[i]) q[i] = 0; /* what lies under a void is nobody's business */
    }
}

/* n stored codes of lattice row y of the band. */
static void gather_errors(const rqt_build *w, const rqt_band *band, int32_t x, int32_t y, int32_t step, int32_t n,
                          rqt_code *codes, uint8_t *bits) {
    rqt_band_errors(band, x, y, step, n, codes, bits);
    /* Vertices past the last column or row: only those whose diamond has an area. */
    if (y < w->lattice.height && (int64_t)x + (int64_t)step * (n - 1) < w->lattice.width) return;
    for (int32_t i = 0; i < n; i++) {
        const rqt_vertex v = {x + i * step, y};
        if (v.x < w->lattice.width && v.y < w->lattice.height) continue;
        if (lattice_has_area(&w->lattice, v)) continue;
        codes[i] = 0;
        bits[i] = 0;
    }
}

static void gather_from_band(const rqt_build *w, const rqt_band *band, const rqt_block_place *p, rqt_block *block) {
    const int32_t side = (1 << w->k) + 1;
    uint8_t bits[(1 << RQT_MAX_BLOCK_K) + 1];
    for (int32_t v = 0; v < side; v++) {
        const ptrdiff_t at = (ptrdiff_t)v * side;
        const int32_t y = p->y + v * p->stride;
        gather_samples(w, band, p->x, y, p->stride, side, block->q + at, block->flags + at);
        gather_errors(w, band, p->x, y, p->stride, side, block->error + at, bits);
        for (int32_t u = 0; u < side; u++)
            block->flags[at + u] = (uint8_t)(block->flags[at + u] | (bits[u] ? RQT_OUTLINE : 0));
    }
}

/* The parts of a summary that the band knows. */
static void summarize_from_band(const rqt_build *w, const rqt_band *band, const rqt_block_place *p,
                                const rqt_block *block, rqt_summary *summary) {
    rqt_vertex at[6];
    memset(summary, 0, sizeof *summary);
    summarize_center(block, summary);
    const int n = summary_places(p, at);
    for (int v = 0; v < n; v++) {
        if (rqt_vertex_scale(&w->lattice, at[v]) >= w->b) continue;
        rqt_summary_vertex *out = summary_vertex(summary, v);
        uint8_t bit;
        gather_samples(w, band, at[v].x, at[v].y, 1, 1, &out->q, &out->flags);
        gather_errors(w, band, at[v].x, at[v].y, 1, 1, &out->error, &bit);
        if (bit) out->flags |= RQT_OUTLINE;
    }
}

static void begin_block(const rqt_build *w, const rqt_block_place *p, const node *n, rqt_block *block) {
    block->k = w->k;
    block->width = p->width;
    block->height = p->height;
    block->sparse = p->stride > 1;
    block->floor = block->sparse ? n->em : 0;
}

static void note_max_error(rqt_build *w, const rqt_block *block, const node *n) {
    const size_t side = ((size_t)1 << block->k) + 1;
    if (n->below > w->max_error) w->max_error = n->below;
    for (size_t i = 0; i < side * side; i++)
        if (block->error[i] > w->max_error && block->error[i] != RQT_CODE_INFINITY) w->max_error = block->error[i];
}

rqt_status rqt_build_tile(rqt_build *w, const rqt_band *band, int32_t tile, rqt_block *block, rqt_build_emit *emit,
                          void *context) {
    /* Fine to coarse, for em. */
    for (int level = w->levels - 1; level >= w->in_tile; level--) {
        const int32_t across = (int32_t)1 << (level - w->in_tile);
        for (int32_t j = band->band * across; j < (band->band + 1) * across; j++) {
            for (int32_t i = tile * across; i < (tile + 1) * across; i++) {
                node *n = node_at(w, level, i, j);
                if (!n) continue;
                const rqt_block_number number = rqt_block_number_of(level, i, j);
                rqt_block_place place;
                rqt_summary summary;
                (void)rqt_block_locate(&w->lattice, w->k, number, &place);
                settle_em(w, &place, n);
                begin_block(w, &place, n, block);
                gather_from_band(w, band, &place, block);
                block_settle_past(block);
                settle_below(block, n);
                if (level == 0) note_max_error(w, block, n);
                summarize_from_band(w, band, &place, block, &summary);
                if (!emit(context, number, &summary, block)) return RQT_INTERRUPTED;
            }
        }
    }
    return RQT_OK;
}

/* ----------------------------------------------------------------------------------- the kept lattice */

static uint64_t kept_offset(const rqt_build *w, int32_t column, int32_t row) {
    return ((uint64_t)row * (uint64_t)w->columns + (uint64_t)column) * sizeof(kept);
}

rqt_status rqt_build_keep(rqt_build *w, const rqt_band *band) {
    if (w->in_tile == 0) return RQT_OK;
    const int32_t per_band = 1 << (w->k - 1), step = 1 << w->keep;
    /* The last row of a band is the first of the next, when there is one. */
    const int32_t first = band->band * per_band;
    const int32_t end = first + per_band + (first + per_band + 1 == w->rows ? 1 : 0);
    for (int32_t row = first; row < end; row++) {
        const int32_t y = row * step;
        uint8_t *flags = w->bits;
        /* Samples and errors through the row's own arrays, then into one record a vertex. */
        for (int32_t c = 0; c < w->columns; c++) {
            w->row[c].zero = 0;
            gather_samples(w, band, c * step, y, 1, 1, &w->row[c].q, &w->row[c].flags);
        }
        gather_errors(w, band, 0, y, step, w->columns, w->codes, flags);
        for (int32_t c = 0; c < w->columns; c++) {
            w->row[c].error = w->codes[c];
            if (flags[c]) w->row[c].flags |= RQT_OUTLINE;
        }
        if (!w->file.write(w->file.context, kept_offset(w, 0, row), w->row, (size_t)w->columns * sizeof *w->row))
            return RQT_READ_FAILED;
    }
    return RQT_OK;
}

/* One lattice row of a coarse block: of columns and rows past the kept ones the last one's sample, and no error but
 * that of a vertex of scale >= b. */
static bool gather_kept_row(const rqt_build *w, const rqt_sweep *sweep, const rqt_block_place *p, int32_t v,
                            kept *row, rqt_block *block) {
    const int32_t side = (1 << w->k) + 1, jump = p->stride >> w->keep;
    const int32_t y = p->y + v * p->stride;
    const int32_t first = p->x >> w->keep, wanted = first + (side - 1) * jump;
    const int32_t last = wanted < w->columns ? wanted : w->columns - 1;
    const int32_t at_row = y >> w->keep, kept_row = at_row < w->rows ? at_row : w->rows - 1;
    if (!w->file.read(w->file.context, kept_offset(w, first, kept_row), row,
                      (size_t)(last - first + 1) * sizeof *row))
        return false;
    for (int32_t u = 0; u < side; u++) {
        const ptrdiff_t at = (ptrdiff_t)v * side + u;
        const rqt_vertex here = {p->x + u * p->stride, y};
        const bool is_kept = at_row < w->rows && first + u * jump < w->columns;
        const kept *from = &row[first + u * jump < last ? u * jump : last - first];
        block->q[at] = from->q;
        block->flags[at] = is_kept ? from->flags : from->flags & RQT_VALID;
        block->error[at] = is_kept ? from->error : 0;
        if (rqt_vertex_scale(&w->lattice, here) < w->b) continue;
        const rqt_summary_vertex coarse = coarse_vertex(w, sweep, here);
        block->q[at] = coarse.q;
        block->flags[at] = coarse.flags;
        block->error[at] = coarse.error;
    }
    return true;
}

rqt_status rqt_build_coarse(rqt_build *w, const rqt_sweep *sweep, int level, int32_t cell, rqt_block *block,
                            rqt_build_emit *emit, void *context) {
    const int32_t i = cell % w->level[level].columns, j = cell / w->level[level].columns;
    const rqt_block_number number = rqt_block_number_of(level, i, j);
    const int32_t side = (1 << w->k) + 1;
    rqt_block_place place;
    rqt_summary summary;
    (void)rqt_block_locate(&w->lattice, w->k, number, &place);
    node *n = node_at(w, level, i, j);
    settle_em(w, &place, n);
    begin_block(w, &place, n, block);
    kept *row = memory_take(&w->allocator, ((size_t)(place.side >> w->keep) + 1) * sizeof *row);
    if (!row) return RQT_NO_MEMORY;
    bool ok = true;
    for (int32_t v = 0; v < side && ok; v++) ok = gather_kept_row(w, sweep, &place, v, row, block);
    memory_drop(&w->allocator, row);
    if (!ok) return RQT_READ_FAILED;
    block_settle_past(block);
    settle_below(block, n);
    if (level == 0) note_max_error(w, block, n);
    memset(&summary, 0, sizeof summary);
    summarize_center(block, &summary);
    return emit(context, number, &summary, block) ? RQT_OK : RQT_INTERRUPTED;
}

rqt_code rqt_build_max_error(const rqt_build *build) {
    return build->max_error;
}
