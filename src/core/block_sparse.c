/* block_sparse.c - the kept vertices of a block of stride > 1, listed from coarse to fine (FORMAT.md, "Sparse
 * blocks").
 *
 * Such a block never answers an eps below its floor, so a vertex that errs no more is never selected in it, and
 * nothing is stored of it. The vertices that are kept form a closed set: each one's parents are kept. So one bit
 * for every vertex whose parents in the block are kept says which they are, and a vertex that is kept finds the
 * corners of its diamond kept too: its height is predicted by theirs. Errors go the other way, from fine to coarse,
 * each one handed on to the parents, which err at least as much.
 *
 * Work and bytes grow with the number of kept vertices, not with the grid. */
#include "block_predict.h"

#include <math.h>

/* Corners come first in the list: NW, NE, SW, SE. */
static void list_corners(kept_list *list, int32_t n) {
    const int32_t last = n - 1;
    for (int32_t c = 0; c < KEPT_CORNERS; c++) {
        const int32_t x = c & 1 ? last : 0, y = c & 2 ? last : 0;
        list->vertex[c] = (kept_vertex){y * n + x, (int16_t)x, (int16_t)y};
    }
    list->count = KEPT_CORNERS;
}

typedef struct bit_source {
    const uint8_t *kept; /* writing: by place */
    const uint8_t *bits; /* reading: so many */
    size_t limit;
} bit_source;

/* The next bit, if it is `due`, for the vertex dx, dy beside v: known by its place when writing, else read; past
 * the end all are 0. Whether it is due, and what it is, no processor can guess: so there are no branches. */
INLINE void offer(kept_list *list, const bit_source *from, kept_vertex v, int32_t at, int32_t dx, int32_t dy,
                  bool due) {
    const size_t bit = list->offered;
    unsigned kept;
    if (from->kept) {
        kept = due & from->kept[at];
        list->bits[bit / 8] = (uint8_t)(list->bits[bit / 8] | kept << bit % 8);
    } else {
        kept = bit < from->limit ? due & (unsigned)from->bits[bit / 8] >> bit % 8 : 0;
    }
    list->offered = bit + due;
    list->vertex[list->count] = (kept_vertex){at, (int16_t)(v.x + dx), (int16_t)(v.y + dy)};
    list->count += kept;
}

/* The same if both its parents are kept: each of them asks. A side on the block's border has only one there: its
 * other has been counted before we begin. */
INLINE void offer_child(kept_list *list, const bit_source *from, kept_vertex v, int32_t n, int32_t dx, int32_t dy) {
    const int32_t at = v.at + dy * n + dx;
    offer(list, from, v, at, dx, dy, ++list->seen[at] == 2);
}

INLINE void walk(kept_list *list, int k, const bit_source *from) {
    const int32_t n = (1 << k) + 1, last = n - 1;
    list_corners(list, n);
    list->offered = 0;
    list->scales = 0;
    if (k == 0) return;
    memset(list->seen, 0, (size_t)n * (size_t)n);
    memset(list->seen, 1, (size_t)n);
    memset(list->seen + (ptrdiff_t)n * last, 1, (size_t)n);
    for (int32_t y = 0; y < n; y++) list->seen[y * n] = list->seen[y * n + last] = 1;
    size_t at = KEPT_CORNERS;
    offer(list, from, list->vertex[0], last / 2 * n + last / 2, last / 2, last / 2, true);
    for (int32_t q = last / 2; q > 0; q /= 2) {
        const size_t centres = list->count;
        for (; at < centres; at++) {
            const kept_vertex v = list->vertex[at];
            offer_child(list, from, v, n, 0, -q);
            offer_child(list, from, v, n, -q, 0);
            offer_child(list, from, v, n, q, 0);
            offer_child(list, from, v, n, 0, q);
        }
        const size_t sides = list->count;
        list->end[list->scales][0] = centres;
        list->end[list->scales++][1] = sides;
        if (q == 1) break;
        for (const int32_t h = q / 2; at < sides; at++) {
            const kept_vertex v = list->vertex[at];
            if (v.y > 0 && v.x > 0) offer_child(list, from, v, n, -h, -h);
            if (v.y > 0 && v.x < last) offer_child(list, from, v, n, h, -h);
            if (v.y < last && v.x > 0) offer_child(list, from, v, n, -h, h);
            if (v.y < last && v.x < last) offer_child(list, from, v, n, h, h);
        }
    }
}

bool kept_list_make(kept_list *list, const rqt_block *b) {
    const size_t count = ((size_t)(1 << b->k) + 1) * ((size_t)(1 << b->k) + 1);
    size_t all = 0;
    for (size_t i = 0; i < count; i++)
        all += list->kept[i] = (uint8_t)((b->error[i] > b->floor) | ((b->flags[i] & RQT_OUTLINE) != 0));
    list_corners(list, (1 << b->k) + 1);
    for (int c = 0; c < KEPT_CORNERS; c++) all -= list->kept[list->vertex[c].at];
    memset(list->bits, 0, sizeof list->bits);
    const bit_source from = {list->kept, NULL, 0};
    walk(list, b->k, &from);
    return list->count == all + KEPT_CORNERS; /* else it is not closed */
}

bool kept_list_read(kept_list *list, int k, const uint8_t *bits, size_t bytes) {
    const bit_source from = {NULL, bits, 8 * bytes};
    walk(list, k, &from);
    return (list->offered + 7) / 8 == bytes &&
           (list->offered % 8 == 0 || bits[bytes - 1] >> list->offered % 8 == 0);
}

/* ------------------------------------------------------------------------------------------ heights */

/* The mean of the corners of a diamond; where one is beyond the block, of the ends alone. */
INLINE int32_t expect(const int32_t *q, int32_t p, int32_t along, int32_t across, bool whole) {
    const int64_t ends = (int64_t)q[p - along] + q[p + along];
    return (int32_t)(whole ? (ends + q[p - across] + q[p + across]) >> 2 : ends >> 1);
}

static inline uint32_t settle_height(bool restoring, int32_t *q, int32_t p, int32_t expected, bool is_void,
                                     uint32_t *residual) {
    const uint32_t largest = RQT_HEIGHT_LIMIT - 1;
    if (restoring)
        q[p] = (int32_t)((uint32_t)expected + unzigzag32(*residual));
    else if (is_void)
        q[p] = expected, *residual = 0;
    else
        *residual = zigzag32((uint32_t)q[p] - (uint32_t)expected);
    return ((uint32_t)q[p] + largest) | (largest - (uint32_t)q[p]);
}

static inline uint32_t code_kept_heights(bool restoring, const kept_list *list, int k, const uint8_t *flags,
                                         int32_t *q, uint32_t *residual) {
    const int32_t n = (1 << k) + 1, last = n - 1;
    uint32_t bad = 0;
    size_t at = 0;
#define SETTLE(p, expected) \
    bad |= settle_height(restoring, q, p, expected, !restoring && !(flags[p] & RQT_VALID), &residual[at])
    for (; at < KEPT_CORNERS; at++) {
        const int32_t p = list->vertex[at].at;
        SETTLE(p, at == 0 ? 0 : at == 3 ? q[last] : q[0]);
    }
    int32_t s = last / 2;
    for (int scale = 0; scale < list->scales; scale++, s /= 2) {
        for (; at < list->end[scale][0]; at++) {
            const int32_t p = list->vertex[at].at;
            SETTLE(p, expect(q, p, s * n + s, s * n - s, true));
        }
        for (; at < list->end[scale][1]; at++) {
            const kept_vertex v = list->vertex[at];
            /* Inside, it does not matter which of its neighbours are the ends. */
            if (v.x > 0 && v.x < last && v.y > 0 && v.y < last)
                SETTLE(v.at, expect(q, v.at, s, s * n, true));
            else
                SETTLE(v.at, expect(q, v.at, v.x & s ? s : s * n, 0, false));
        }
    }
#undef SETTLE
    return bad;
}

void predict_kept_heights(const kept_list *list, int k, const uint8_t *flags, int32_t *q, uint32_t *residual) {
    (void)code_kept_heights(false, list, k, flags, q, residual);
}
uint32_t restore_kept_heights(const kept_list *list, int k, const uint32_t *residual, int32_t *q) {
    return code_kept_heights(true, list, k, NULL, q, (uint32_t *)residual);
}

/* ------------------------------------------------------------------------------------------- errors */

typedef struct error_pass {
    const int32_t *q;
    const uint8_t *flags; /* NULL: all valid, and no outline */
    rqt_code *error;      /* what the children hand on, then what the vertex has */
    rqt_code floor, ground;
    float half;
} error_pass;

/* Settle the error of one vertex, whose midpoint counts unless `along` is 0. Returns it. */
INLINE rqt_code settle_error(bool restoring, const error_pass *e, int32_t p, int32_t along, rqt_code ground,
                             uint16_t *residual, rqt_code own, bool *good) {
    const uint32_t handed = e->error[p], least = e->floor + 1u;
    const uint32_t middle = midpoint_code(e->q[p], sum_of(e->q[p - along], e->q[p + along]), e->half);
    const int flags = e->flags ? e->flags[p] : RQT_VALID;
    const bool outline = flags & RQT_OUTLINE, heard = along != 0 && flags & RQT_VALID;
    uint32_t expected = outline ? ground : least;
    expected = heard && !outline && middle > expected ? middle : expected;
    expected = handed > expected ? handed : expected;
    if (restoring)
        own = (rqt_code)(expected + unzigzag16(*residual));
    else
        *residual = zigzag16((uint16_t)(own - expected));
    e->error[p] = own;
    *good &= outline | (own > e->floor);
    return own;
}

INLINE void hand_on(rqt_code *error, int32_t parent, rqt_code own) {
    error[parent] = error[parent] < own ? own : error[parent];
}

INLINE bool code_kept_errors(bool restoring, const kept_list *list, int k, error_pass e, const rqt_code *own,
                             uint16_t *residual) {
    const int32_t n = (1 << k) + 1, last = n - 1;
    size_t at = list->count;
    bool good = true;
    for (int scale = 0; scale < list->scales; scale++) {
        const int level = list->scales - 1 - scale;
        const int32_t s = 1 << scale, row = s * n;
        const rqt_code ground = e.ground ? ground_at(e.ground, scale) : 0;
        for (; at > list->end[level][0]; at--) {
            const kept_vertex v = list->vertex[at - 1];
            const bool level_ends = v.x & s;
            const int32_t p = v.at, along = level_ends ? s : row, across = level_ends ? row : s;
            const int32_t place = level_ends ? v.y : v.x;
            const rqt_code code = settle_error(restoring, &e, p, along, ground, &residual[at - 1 - KEPT_CORNERS],
                                               restoring ? 0 : own[p], &good);
            if (place > 0) hand_on(e.error, p - across, code);
            if (place < last) hand_on(e.error, p + across, code);
        }
        const size_t begin = level ? list->end[level - 1][1] : KEPT_CORNERS;
        const bool whole = 2 * s == last;
        for (; at > begin; at--) {
            const kept_vertex v = list->vertex[at - 1];
            const bool down = ((v.x ^ v.y) >> (scale + 1) & 1) == 0; /* its diagonal goes from above left */
            const int32_t p = v.at, along = down ? row + s : row - s, across = down ? row - s : row + s;
            const rqt_code code = settle_error(restoring, &e, p, whole ? 0 : along, ground,
                                               &residual[at - 1 - KEPT_CORNERS], restoring ? 0 : own[p], &good);
            if (whole) continue;
            hand_on(e.error, p - across, code);
            hand_on(e.error, p + across, code);
        }
    }
    return good;
}

rqt_code kept_ground(const kept_list *list, const rqt_block *b) {
    rqt_code least = 0;
    if (list->scales == 0) return 0;
    const size_t begin = list->scales > 1 ? list->end[list->scales - 2][1] : KEPT_CORNERS;
    for (size_t at = begin; at < list->count; at++) {
        const int32_t p = list->vertex[at].at;
        if (b->flags[p] & RQT_OUTLINE && (!least || b->error[p] < least)) least = b->error[p];
    }
    return least;
}

void predict_kept_errors(const kept_list *list, const rqt_block *b, const int32_t *q, double quantum,
                         rqt_code ground, rqt_code *scratch, uint16_t *residual) {
    const int32_t n = (1 << b->k) + 1;
    memset(scratch, 0, (size_t)n * (size_t)n * sizeof *scratch);
    const error_pass e = {q, b->flags, scratch, b->floor, ground, half_of(quantum)};
    (void)code_kept_errors(false, list, b->k, e, b->error, residual);
}

bool restore_kept_errors(const kept_list *list, const rqt_block *b, bool flagged, double quantum, rqt_code ground,
                         uint16_t *residual) {
    error_pass e = {b->q, NULL, b->error, b->floor, ground, half_of(quantum)};
    if (!flagged) return code_kept_errors(true, list, b->k, e, NULL, residual);
    e.flags = b->flags;
    return code_kept_errors(true, list, b->k, e, NULL, residual);
}
