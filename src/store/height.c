/* height.c - the height at one place: on the full-resolution half cell that holds it, or on the mesh of an eps.
 */
#include "internal.h"

#include <math.h>

static double metres_of(const rqt_unit *unit, double q) {
    return ((double)unit->z0 + q / (double)unit->d) * rqt_unit_factor(unit) + unit->offset;
}

/* The plane of the half cell that holds the place: what is valid and has weight counts. */
static int full_height(store *s, const store_terrain *t, double col, double row, double *metres, bool *found,
                       char **error) {
    const int32_t w = t->lattice.width, h = t->lattice.height;
    int32_t x = (int32_t)col, y = (int32_t)row;
    if (x > w - 2) x = w > 1 ? w - 2 : 0;
    if (y > h - 2) y = h > 1 ? h - 2 : 0;
    const double fx = col - x, fy = row - y;
    const rqt_block *block;
    int read;
    const int32_t i = x >> t->k, j = y >> t->k;
    const int code = store_get_block(s, t, rqt_block_number_of(t->lattice.K - t->k, i, j), &block, &read, error);
    if (code != SQLITE_OK) return code;
    const size_t n = ((size_t)1 << t->k) + 1;
    const size_t nw = (size_t)(y - (j << t->k)) * n + (size_t)(x - (i << t->k));
    const size_t at[4] = {nw, nw + 1, nw + n, nw + n + 1}; /* NW NE SW SE */
    double weight[4];
    if ((x + y) % 2 == 0) { /* diagonal NW-SE */
        weight[0] = 1 - (fx > fy ? fx : fy);
        weight[1] = fx > fy ? fx - fy : 0;
        weight[2] = fy > fx ? fy - fx : 0;
        weight[3] = fx < fy ? fx : fy;
    } else {
        const double sum = fx + fy;
        weight[0] = sum < 1 ? 1 - sum : 0;
        weight[1] = sum < 1 ? fx : 1 - fy;
        weight[2] = sum < 1 ? fy : 1 - fx;
        weight[3] = sum > 1 ? sum - 1 : 0;
    }
    double q = 0;
    for (int c = 0; c < 4; c++) {
        if (weight[c] == 0) continue;
        if (!(block->flags[at[c]] & RQT_VALID)) return SQLITE_OK;
        q += weight[c] * block->q[at[c]];
    }
    *metres = metres_of(&t->unit, q);
    *found = true;
    return SQLITE_OK;
}

/* On the plane of a triangle, counter-clockwise from its apex. */
static double plane_height(const rqt_unit *unit, const rqt_leaf_corner leaf[3], double col, double row) {
    const rqt_leaf_corner *a = &leaf[0], *b = &leaf[1], *c = &leaf[2];
    const double area =
        (double)(b->col - a->col) * (c->row - a->row) - (double)(c->col - a->col) * (b->row - a->row);
    const double wb = ((col - a->col) * (c->row - a->row) - (c->col - a->col) * (row - a->row)) / area;
    const double wc = ((b->col - a->col) * (row - a->row) - (col - a->col) * (b->row - a->row)) / area;
    return metres_of(unit, a->q + wb * ((double)b->q - a->q) + wc * ((double)c->q - a->q));
}

/* The block of the place that answers: em falls from level to level, so the levels are searched by halves. Number 0
 * where none does, in a damaged terrain. */
static int find_answer(store *s, const store_terrain *t, int32_t x, int32_t y, rqt_code eps, rqt_outline outline,
                       rqt_answer *answer, char **error) {
    const int K = t->lattice.K;
    int low = 0, high = K - t->k;
    answer->number = 0;
    while (low <= high) {
        const int level = (low + high) / 2;
        const rqt_block_number number = rqt_block_number_of(level, x >> (K - level), y >> (K - level));
        const rqt_summary *summary;
        const int code = store_get_summary(s, t, number, &summary, error);
        if (code != SQLITE_OK) return code;
        const rqt_interval *i = outline == RQT_OUTLINE_EXACT ? &summary->exact : &summary->tol;
        if (i->em > eps) {
            low = level + 1;
        } else if (eps >= i->em_parent) {
            high = level - 1;
        } else {
            *answer = (rqt_answer){number, *summary};
            break;
        }
    }
    return SQLITE_OK;
}

/* Straight to the leaf. RQT_FOUND_UNSURE: the patch has to say. */
static int leaf_height(store *s, const store_terrain *t, double col, double row, double eps, rqt_found *what,
                       double *metres, char **error) {
    rqt_query query = {.lattice = t->lattice,
                       .k = t->k,
                       .eps = rqt_code_eps(eps, t->quantum_error),
                       .select = RQT_SELECT_THRESHOLD,
                       .outline = RQT_OUTLINE_EXACT};
    const int32_t w = t->lattice.width, h = t->lattice.height;
    int32_t x = (int32_t)col, y = (int32_t)row;
    if (x > w - 2) x = w > 1 ? w - 2 : 0;
    if (y > h - 2) y = h > 1 ? h - 2 : 0;
    rqt_answer answer;
    const rqt_block *block = NULL;
    int read;
    *what = RQT_FOUND_UNSURE;
    int code = find_answer(s, t, x, y, query.eps, query.outline, &answer, error);
    if (code != SQLITE_OK || answer.number == 0) return code;
    if (rqt_summary_needs_block(&answer.summary, query.outline, query.eps))
        code = store_get_block(s, t, answer.number, &block, &read, error);
    if (code != SQLITE_OK) return code;
    rqt_leaf_corner leaf[3];
    *what = rqt_query_leaf_at(&query, &answer, block, (int64_t)(col * 0x1p20), (int64_t)(row * 0x1p20), leaf);
    if (*what == RQT_FOUND_LEAF) *metres = plane_height(&t->unit, leaf, col, row);
    return SQLITE_OK;
}

/* The plane of a triangle of the patch of the point. */
static int mesh_height(store *s, const store_terrain *t, double x, double y, double col, double row, double eps,
                       double *metres, bool *found, char **error) {
    rqt_found what;
    int code = leaf_height(s, t, col, row, eps, &what, metres, error);
    if (code != SQLITE_OK || what != RQT_FOUND_UNSURE) {
        *found = code == SQLITE_OK && what == RQT_FOUND_LEAF;
        return code;
    }
    rqt_geometry *geometry = NULL;
    rqt_region *region = NULL;
    const double point[2] = {x, y};
    const size_t one = 1;
    rqt_status status = rqt_geometry_of_lines(point, &one, 1, 0, store_allocator(), &geometry);
    if (status == RQT_OK)
        status = rqt_region_create(geometry, &t->placement, &t->lattice, store_allocator(), &region);
    code = store_fail_core(error, status, "the point");
    rqt_patch patch = {0};
    const store_query_options options = {.select = RQT_SELECT_THRESHOLD, .outline = RQT_OUTLINE_EXACT};
    if (code == SQLITE_OK) code = store_query(s, t, region, eps, &options, &patch, NULL, error);
    if (code == SQLITE_OK && patch.triangle_count > 0) {
        rqt_leaf_corner leaf[3];
        for (int c = 0; c < 3; c++) {
            const rqt_patch_vertex *v = &patch.vertices[patch.triangles[c]];
            leaf[c] = (rqt_leaf_corner){v->col, v->row, v->q};
        }
        *metres = plane_height(&t->unit, leaf, col, row);
        *found = true;
    }
    store_keep(s, &patch);
    rqt_region_free(region);
    rqt_geometry_free(geometry);
    return code;
}

/* Longitudes are the same modulo 360: the one on the turn that holds terrain; as it is when no turn does. */
static double turned(const store_terrain *t, double x) {
    const double first = t->placement.x0, last = first + (t->lattice.width - 1) * t->placement.dx;
    const double low = fmin(first, last), high = fmax(first, last);
    if (!t->lonlat || (x >= low && x <= high) || fabs(x) > 3 * 360.0) return x;
    const double turn = x < low ? ceil((low - x) / 360) : floor((high - x) / 360);
    const double there = x + turn * 360;
    return there >= low && there <= high ? there : x;
}

int store_height(store *s, const store_terrain *t, double x, double y, double eps, double *metres, bool *found,
                 char **error) {
    *metres = 0;
    *found = false;
    if (!isfinite(x) || !isfinite(y)) return store_fail(error, SQLITE_ERROR, "x and y must be finite numbers");
    x = turned(t, x);
    /* Regions round coordinates to 2^-20 sample; so do we, or a place on the border would fall off it by an ulp. */
    const double col = nearbyint((x - t->placement.x0) / t->placement.dx * 0x1p20) * 0x1p-20;
    const double row = nearbyint((y - t->placement.y0) / t->placement.dy * 0x1p20) * 0x1p-20;
    if (!(col >= 0 && row >= 0 && col <= t->lattice.width - 1 && row <= t->lattice.height - 1)) return SQLITE_OK;
    int code = store_begin_on(s, t, error);
    if (code != SQLITE_OK) return code;
    code = eps < 0 ? full_height(s, t, col, row, metres, found, error)
                   : mesh_height(s, t, x, y, col, row, eps, metres, found, error);
    store_end(s);
    return code;
}
