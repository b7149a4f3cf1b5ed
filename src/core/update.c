/* update.c - new samples for a part of a terrain: whose error changes, and to what.
 *
 * Errors are settled by scales, fine to coarse, sides before centres, as saturation goes, but only where something
 * can have changed: at vertices whose diamond holds a sample that differs, or one of whose children has changed.
 * All of these lie within three times 2^scale of the rectangle, so each scale has a small window of its own, and
 * above the rectangle's size a window has some fifty vertices, whatever the terrain.
 *
 * Stored is e_sat, not e. Where the diamond is as it was, e need not be known: with c the maximum over the children
 * now and c' what it was, e_sat is c if c >= the old e_sat, and stays if c' was less than it (for then it was e).
 * Else, and where samples differ, both triangles are measured: small ones by their samples, with the same code as
 * an import's, those larger than a block of stride 1 by a search (update_search.c). A measurement is the exact
 * maximum, rounded up once, so every code equals an import's.
 *
 * Vertices whose diamonds have no area, past the raster, count as 0 here although descendants of theirs may err:
 * whoever depends on them has the same descendants on the near side, where the lattice is its own mirror image.
 *
 * What then has to be written follows from the vertices and samples that changed (update_blocks.c).
 */
#include "update.h"

bool update_fail(update *u, rqt_status status) {
    if (u->status == RQT_OK) u->status = status;
    return false;
}

static int32_t smaller(int32_t a, int32_t b) {
    return a < b ? a : b;
}
static int32_t larger(int32_t a, int32_t b) {
    return a > b ? a : b;
}

/* The block of a side 2^shift that holds a coordinate: not one past the last. */
static int32_t cell_of(int32_t x, int shift, int32_t samples) {
    const int32_t last = (samples > 1 ? samples - 2 : 0) >> shift, cell = x >> shift;
    return cell < last ? cell : last;
}

/* ---------------------------------------------------------------------------------------------- what differs */

/* The samples that are others now, and what of the terrain's statistics they had to do with. */
typedef struct difference {
    sample_window box;
    int64_t count, more_voids;
    bool had, has; /* valid ones before, now */
    int32_t old_low, old_high, low, high;
} difference;

static void note(difference *d, int32_t x, int32_t y, uint8_t old_valid, int32_t old_q, uint8_t valid, int32_t q) {
    if (d->count++ == 0) d->box = (sample_window){x, y, x, y};
    d->box =
        (sample_window){smaller(d->box.x0, x), smaller(d->box.y0, y), larger(d->box.x1, x), larger(d->box.y1, y)};
    d->more_voids += (valid ? 0 : 1) - (old_valid ? 0 : 1);
    if (old_valid) {
        d->old_low = d->had ? smaller(d->old_low, old_q) : old_q;
        d->old_high = d->had ? larger(d->old_high, old_q) : old_q;
        d->had = true;
    }
    if (valid) {
        d->low = d->has ? smaller(d->low, q) : q;
        d->high = d->has ? larger(d->high, q) : q;
        d->has = true;
    }
}

/* The samples that begin in block (i,j) of stride 1; the last column and row belong to the last block. */
static bool compare_block(update *u, int32_t i, int32_t j, difference *d) {
    const rqt_update *g = u->given;
    const int32_t x = i << u->k, y = j << u->k, n = (1 << u->k) + 1, width = u->lattice.width,
                  height = u->lattice.height;
    const int32_t x1 = i == cell_of(width, u->k, width) ? width - 1 : x + n - 2,
                  y1 = j == cell_of(height, u->k, height) ? height - 1 : y + n - 2;
    const rqt_block *block = g->read_block(g->context, rqt_block_number_of(u->levels - 1, i, j));
    if (!block) return update_fail(u, RQT_READ_FAILED);
    for (int32_t row = larger(y, g->y); row <= smaller(y1, g->y + g->height - 1); row++)
        for (int32_t column = larger(x, g->x); column <= smaller(x1, g->x + g->width - 1); column++) {
            const size_t at = (size_t)(row - y) * (size_t)n + (size_t)(column - x);
            const uint8_t old_valid = block->flags[at] & RQT_VALID;
            int32_t q;
            const uint8_t valid = update_sample(u, column, row, &q);
            if (valid && (q <= -RQT_HEIGHT_LIMIT || q >= RQT_HEIGHT_LIMIT)) return update_fail(u, RQT_INVALID);
            if (valid != old_valid || (valid && q != block->q[at]))
                note(d, column, row, old_valid, block->q[at], valid, q);
        }
    return true;
}

static bool compare(update *u, difference *d) {
    const rqt_update *g = u->given;
    const int32_t i1 = cell_of(g->x + g->width - 1, u->k, u->lattice.width),
                  j1 = cell_of(g->y + g->height - 1, u->k, u->lattice.height);
    for (int32_t j = cell_of(g->y, u->k, u->lattice.height); j <= j1; j++)
        for (int32_t i = cell_of(g->x, u->k, u->lattice.width); i <= i1; i++) {
            if (!compare_block(u, i, j, d)) return false;
            if (g->is_interrupted && g->is_interrupted(g->context)) return update_fail(u, RQT_INTERRUPTED);
        }
    return true;
}

/* -------------------------------------------------------------------------------------------------- vertices */

/* What is stored of a vertex whose diamond has an area: in a block of stride 1, or as the corner of a block of side
 * 2^scale. */
static bool stored(update *u, rqt_vertex v, int scale, rqt_code *code, uint8_t *outline) {
    const int shift = scale < u->k ? u->k : scale;
    const int32_t i = cell_of(v.x, shift, u->lattice.width), j = cell_of(v.y, shift, u->lattice.height);
    if (scale < u->k) {
        const update_item *item = update_load(u, i, j);
        if (!item) return false;
        const size_t n = ((size_t)1 << u->k) + 1,
                     at = (size_t)(v.y - item->place.y) * n + (size_t)(v.x - item->place.x);
        *code = item->block.error[at];
        *outline = (item->block.flags[at] & RQT_OUTLINE) != 0;
        return true;
    }
    rqt_summary summary;
    if (!update_summary(u, u->lattice.K - scale, i, j, &summary)) return false;
    const rqt_summary_vertex *corner = &summary.corner[((v.x >> scale) - i) | ((v.y >> scale) - j) << 1];
    *code = corner->error;
    *outline = (corner->flags & RQT_OUTLINE) != 0;
    return true;
}

/* Is there a sample that differs in the closed diamond? May say so of one near it. */
static bool diamond_touches(const update *u, rqt_vertex v, int scale) {
    const int32_t q = 1 << scale;
    const sample_window *a = &u->area;
    if (v.x - q > a->x1 || v.x + q < a->x0 || v.y - q > a->y1 || v.y + q < a->y0) return false;
    const bool side = ((v.x ^ v.y) >> scale) & 1;
    /* Clamped, a diamond is no longer one. */
    if (!side || v.x + q >= u->lattice.width || v.y + q >= u->lattice.height) return true;
    const int32_t dx = larger(larger(a->x0 - v.x, v.x - a->x1), 0),
                  dy = larger(larger(a->y0 - v.y, v.y - a->y1), 0);
    return dx + dy <= q;
}

/* The triangles that v splits; returns their number. */
static int diamond_of(const rqt_lattice *lattice, rqt_vertex v, int scale, rqt_triangle out[2]) {
    const int32_t q = 1 << scale;
    rqt_triangle cell[CELL_TRIANGLES];
    if ((v.x & v.y) >> scale & 1) {
        cell_triangles(v.x - q, v.y - q, scale + 1, cell);
        out[0] = cell[0];
        out[1] = cell[1];
        return 2;
    }
    rqt_vertex apex[2];
    const int n = rqt_vertex_parents(lattice, v, apex);
    for (int i = 0; i < n; i++) {
        cell_triangles(apex[i].x - q, apex[i].y - q, scale + 1, cell);
        out[i] = cell[v.y < apex[i].y ? 2 : v.x > apex[i].x ? 3 : v.y > apex[i].y ? 4 : 5];
    }
    return n;
}

/* The maximum over some vertices, now and before. */
typedef struct maximum {
    rqt_code code, old_code;
    uint8_t outline, old_outline;
} maximum;

static bool over_children(update *u, const rqt_vertex *child, int n, int scale, maximum *m) {
    for (int c = 0; c < n; c++) {
        if (!lattice_has_area(&u->lattice, child[c])) continue;
        updated_vertex v = {0};
        const updated_vertex *found = update_find(u, child[c]);
        if (found) {
            v = *found;
        } else {
            if (!stored(u, child[c], scale, &v.code, &v.outline)) return false;
            v.old_code = v.code;
            v.old_outline = v.outline;
        }
        if (v.code > m->code) m->code = v.code;
        if (v.old_code > m->old_code) m->old_code = v.old_code;
        m->outline |= v.outline;
        m->old_outline |= v.old_outline;
    }
    return true;
}

static bool measure_diamond(update *u, rqt_vertex v, int scale, rqt_code *code, uint8_t *outline) {
    rqt_triangle diamond[2];
    const int n = diamond_of(&u->lattice, v, scale, diamond);
    for (int i = 0; i < n; i++) {
        bool mixed = false;
        if (!triangle_has_area(&u->field, &diamond[i])) continue;
        if (!update_measure(u, &diamond[i], scale, code, &mixed)) return false;
        *outline |= mixed;
    }
    return true;
}

static bool settle(update *u, rqt_vertex v, int scale, updated_vertex *out) {
    rqt_vertex child[4];
    const int n = rqt_vertex_children(&u->lattice, v, child);
    const bool touched = diamond_touches(u, v, scale);
    bool changed = touched;
    for (int c = 0; c < n && !changed; c++) changed = update_find(u, child[c]) != NULL;
    if (!changed) return true;

    const bool center = (v.x & v.y) >> scale & 1;
    maximum below = {0};
    updated_vertex now = {0};
    if (!over_children(u, child, n, center ? scale : scale - 1, &below) ||
        !stored(u, v, scale, &now.old_code, &now.old_outline))
        return false;
    now.code = below.code;
    now.outline = below.outline;
    const bool own_code = below.old_code < now.old_code, own_outline = below.old_outline < now.old_outline;
    if (!touched && own_code && now.code < now.old_code) now.code = now.old_code;
    if (!touched && own_outline) now.outline = 1;
    const bool knows_code = own_code || now.code >= now.old_code;
    const bool knows_outline = own_outline || now.outline >= now.old_outline;
    if ((touched || !knows_code || !knows_outline) && !measure_diamond(u, v, scale, &now.code, &now.outline))
        return false;
    now.changed = now.code != now.old_code || now.outline != now.old_outline;
    *out = now;
    return true;
}

static bool open_level(update *u, int scale) {
    const int64_t q = (int64_t)1 << scale, end = (int64_t)1 << (u->lattice.K - scale);
    const sample_window *a = &u->area;
    update_level *l = &u->level[scale];
    const int64_t i0 = (a->x0 - 3 * q) >> scale, i1 = ((a->x1 + 3 * q) >> scale) + 1, j0 = (a->y0 - 3 * q) >> scale,
                  j1 = ((a->y1 + 3 * q) >> scale) + 1;
    l->i0 = (int32_t)(i0 < 0 ? 0 : i0);
    l->j0 = (int32_t)(j0 < 0 ? 0 : j0);
    l->columns = (int32_t)(i1 > end ? end : i1) - l->i0 + 1;
    l->rows = (int32_t)(j1 > end ? end : j1) - l->j0 + 1;
    const size_t bytes = (size_t)l->columns * (size_t)l->rows * sizeof *l->vertex;
    l->vertex = memory_take(u->allocator, bytes);
    if (!l->vertex) return update_fail(u, RQT_NO_MEMORY);
    memset(l->vertex, 0, bytes);
    return true;
}

/* Sides, then centres: a centre depends on its sides, and both on what is finer. */
static bool settle_level(update *u, int scale) {
    const rqt_update *g = u->given;
    update_level *l = &u->level[scale];
    if (!open_level(u, scale)) return false;
    for (int kind = 0; kind < 2; kind++)
        for (int32_t j = l->j0; j < l->j0 + l->rows; j++) {
            if (g->is_interrupted && g->is_interrupted(g->context)) return update_fail(u, RQT_INTERRUPTED);
            for (int32_t i = l->i0; i < l->i0 + l->columns; i++) {
                const rqt_vertex v = {i << scale, j << scale};
                if (kind ? !(i & j & 1) : !((i ^ j) & 1)) continue;
                if (!lattice_has_area(&u->lattice, v)) continue;
                if (!settle(u, v, scale,
                            &l->vertex[(size_t)(j - l->j0) * (size_t)l->columns + (size_t)(i - l->i0)]))
                    return false;
            }
        }
    return true;
}

/* The root's corners err infinitely; of the two that its centre depends on the outline bit is the centre's. */
static bool settle_corners(update *u) {
    const int K = u->lattice.K;
    if (K == 0) return true;
    const updated_vertex *center = update_find(u, (rqt_vertex){1 << (K - 1), 1 << (K - 1)});
    if (!center || center->outline == center->old_outline) return true;
    updated_vertex corner = *center;
    corner.code = corner.old_code = RQT_CODE_INFINITY;
    if (!open_level(u, K)) return false;
    u->level[K].vertex[1] = u->level[K].vertex[2] = corner; /* north-east, south-west */
    return true;
}

/* ------------------------------------------------------------------------------------------------- the whole */

static int64_t samples_of(const rqt_lattice *lattice) {
    return (int64_t)lattice->width * lattice->height;
}

/* The extremes now. Only where the old one has gone must another be looked for. */
static bool settle_extremes(update *u, const difference *d) {
    const rqt_statistics *before = &u->given->before;
    rqt_statistics *after = &u->result->after;
    const bool any_before = before->voids < samples_of(&u->lattice);
    bool any = after->voids < samples_of(&u->lattice);
    after->min_q = after->max_q = 0;
    if (!any) return true;
    after->min_q = any_before && !(d->has && d->low < before->min_q) ? before->min_q : d->low;
    after->max_q = any_before && !(d->has && d->high > before->max_q) ? before->max_q : d->high;
    if (any_before && d->had && d->old_low == before->min_q && !(d->has && d->low <= before->min_q) &&
        !update_extreme(u, -1, &after->min_q, &any))
        return false;
    if (any_before && d->had && d->old_high == before->max_q && !(d->has && d->high >= before->max_q) &&
        !update_extreme(u, 1, &after->max_q, &any))
        return false;
    return any || update_fail(u, RQT_CORRUPT);
}

/* The largest difference of heights, before or after. */
static int64_t relief_around(const update *u, const difference *d) {
    const rqt_statistics *b = &u->given->before;
    if (b->voids == samples_of(&u->lattice)) return d->has ? (int64_t)d->high - d->low : 0;
    const int32_t low = d->has ? smaller(d->low, b->min_q) : b->min_q;
    return (int64_t)(d->has ? larger(d->high, b->max_q) : b->max_q) - low;
}

static bool run(update *u) {
    const size_t n = ((size_t)1 << u->k) + 1;
    difference d = {0};
    u->result->after = u->given->before;
    if (!compare(u, &d)) return false;
    u->result->changed = d.count;
    if (d.count == 0) return true;
    u->area = d.box;
    u->result->after.voids += d.more_voids;
    u->has_voids = u->given->before.voids > 0 || u->result->after.voids > 0;
    u->field.relief = relief_around(u, &d);
    u->mask = memory_take(u->allocator, n * n);
    u->known = memory_take(u->allocator, n * n);
    if (!u->mask || !u->known) return update_fail(u, RQT_NO_MEMORY);
    for (int scale = 0; scale < u->lattice.K; scale++)
        if (!settle_level(u, scale)) return false;
    return settle_corners(u) && settle_extremes(u, &d) && update_blocks(u);
}

rqt_status rqt_update_run(const rqt_update *given, const rqt_allocator *allocator, rqt_update_result *result) {
    memset(result, 0, sizeof *result);
    const rqt_lattice *l = &given->lattice;
    if (!rqt_unit_is_valid(&given->unit) || !(given->cost.cell > 0) || !(given->cost.c > 0) || given->k < 0 ||
        given->k > RQT_MAX_BLOCK_K || given->k > l->K || (given->k == 0 && l->K > 0) || given->x < 0 ||
        given->y < 0 || given->width < 1 || given->height < 1 || given->width > l->width - given->x ||
        given->height > l->height - given->y)
        return RQT_INVALID;
    update *u = memory_take(allocator, sizeof *u);
    if (!u) return RQT_NO_MEMORY;
    memset(u, 0, sizeof *u);
    u->given = given;
    u->allocator = allocator;
    u->lattice = *l;
    u->k = given->k;
    u->levels = rqt_block_levels(l, given->k);
    u->result = result;
    u->field = (deviation_field){.lattice = *l,
                                 .width = l->width,
                                 .height = l->height,
                                 .cost = given->cost,
                                 .kernels = error_kernels_best()};
    code_scale_init(&u->field.scale, &given->unit);
    (void)run(u);
    const rqt_status status = u->status;
    update_blocks_free(u);
    for (int scale = 0; scale <= l->K; scale++) memory_drop(allocator, u->level[scale].vertex);
    memory_drop(allocator, u->mask);
    memory_drop(allocator, u->known);
    memory_drop(allocator, u->heap);
    memory_drop(allocator, u);
    if (status != RQT_OK) memset(result, 0, sizeof *result);
    return status;
}
