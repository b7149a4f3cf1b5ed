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
    const int32_t last = n - 1, corners[KEPT_CORNERS] = {0, last, last * n, last * n + last};
    for (int c = 0; c < KEPT_CORNERS; c++) list->place[c] = corners[c];
    list->count = KEPT_CORNERS;
}

/* Both parents kept? Asked once by each of them. A side on the block's border has only one there: its other has
 * been counted before we begin. */
static inline bool is_offered(kept_list *list, int32_t at) {
    return ++list->seen[at] == 2;
}

static inline void put_kept(kept_list *list, int32_t at, bool kept) {
    list->bits[list->offered / 8] = (uint8_t)(list->bits[list->offered / 8] | (unsigned)kept << list->offered % 8);
    list->offered++;
    list->place[list->count] = at;
    list->count += kept;
}

/* The next bit for the vertex at `at`: from `kept` when writing, else read. Past the end of the bits all are 0. */
static inline void offer(kept_list *list, int32_t at, const uint8_t *kept, const uint8_t *bits, size_t limit) {
    if (kept) {
        put_kept(list, at, kept[at]);
    } else {
        const size_t bit = list->offered++;
        list->place[list->count] = at;
        list->count += bit < limit && (bits[bit / 8] >> bit % 8 & 1);
    }
}

static inline void walk(kept_list *list, int k, const uint8_t *kept, const uint8_t *bits, size_t limit) {
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
    offer(list, last / 2 * n + last / 2, kept, bits, limit);
    for (int32_t q = last / 2; q > 0; q /= 2) {
        const size_t centres = list->count;
        for (; at < centres; at++) {
            const int32_t p = list->place[at], around[4] = {p - q * n, p - q, p + q, p + q * n};
            for (int s = 0; s < 4; s++)
                if (is_offered(list, around[s])) offer(list, around[s], kept, bits, limit);
        }
        const size_t sides = list->count;
        list->end[list->scales][0] = centres;
        list->end[list->scales++][1] = sides;
        if (q == 1) break;
        for (const int32_t h = q / 2; at < sides; at++) {
            const int32_t p = list->place[at], y = p / n, x = p - y * n;
            if (y > 0 && x > 0 && is_offered(list, p - h * n - h)) offer(list, p - h * n - h, kept, bits, limit);
            if (y > 0 && x < last && is_offered(list, p - h * n + h)) offer(list, p - h * n + h, kept, bits, limit);
            if (y < last && x > 0 && is_offered(list, p + h * n - h)) offer(list, p + h * n - h, kept, bits, limit);
            if (y < last && x < last && is_offered(list, p + h * n + h))
                offer(list, p + h * n + h, kept, bits, limit);
        }
    }
}

bool kept_list_make(kept_list *list, const rqt_block *b) {
    const size_t count = ((size_t)(1 << b->k) + 1) * ((size_t)(1 << b->k) + 1);
    size_t all = 0;
    for (size_t i = 0; i < count; i++)
        all += list->kept[i] = (uint8_t)((b->error[i] > b->floor) | ((b->flags[i] & RQT_OUTLINE) != 0));
    list_corners(list, (1 << b->k) + 1);
    for (int c = 0; c < KEPT_CORNERS; c++) all -= list->kept[list->place[c]];
    memset(list->bits, 0, sizeof list->bits);
    walk(list, b->k, list->kept, NULL, 0);
    return list->count == all + KEPT_CORNERS; /* else it is not closed */
}

bool kept_list_read(kept_list *list, int k, const uint8_t *bits, size_t bytes) {
    walk(list, k, NULL, bits, 8 * bytes);
    return (list->offered + 7) / 8 == bytes &&
           (list->offered % 8 == 0 || bits[bytes - 1] >> list->offered % 8 == 0);
}

/* ------------------------------------------------------------------------------------------ heights */

/* The mean of the corners of a diamond; where one is beyond the block, of the ends alone. */
static inline int32_t expect(const int32_t *q, int32_t p, int32_t along, int32_t across, bool before, bool after) {
    const int64_t ends = (int64_t)q[p - along] + q[p + along];
    return (int32_t)(before && after ? (ends + q[p - across] + q[p + across]) >> 2 : ends >> 1);
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
        const int32_t p = list->place[at];
        SETTLE(p, at == 0 ? 0 : at == 3 ? q[last] : q[0]);
    }
    int32_t s = last / 2;
    for (int scale = 0; scale < list->scales; scale++, s /= 2) {
        for (; at < list->end[scale][0]; at++) {
            const int32_t p = list->place[at];
            SETTLE(p, expect(q, p, s * n + s, s * n - s, true, true));
        }
        for (; at < list->end[scale][1]; at++) {
            const int32_t p = list->place[at], y = p / n, x = p - y * n;
            if (x & s)
                SETTLE(p, expect(q, p, s, s * n, y > 0, y < last));
            else
                SETTLE(p, expect(q, p, s * n, s, x > 0, x < last));
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
    const uint8_t *flags;
    rqt_code *error, floor, ground;
    float half;
    bool good;
} error_pass;

/* Settle the error of one vertex: error[p] is what its children have handed on. */
static inline void settle_error(bool restoring, error_pass *e, int32_t p, int32_t along, int scale,
                                uint16_t *residual, rqt_code own) {
    uint32_t expected = e->error[p];
    const bool outline = e->flags[p] & RQT_OUTLINE;
    if (outline) {
        if (e->ground && expected < ground_at(e->ground, scale)) expected = ground_at(e->ground, scale);
    } else {
        if (expected <= e->floor) expected = e->floor + 1u;
        if (along && e->flags[p] & RQT_VALID) {
            const rqt_code middle = midpoint_code(e->q[p], sum_of(e->q[p - along], e->q[p + along]), e->half);
            if (middle > expected) expected = middle;
        }
    }
    if (restoring)
        own = (rqt_code)(expected + unzigzag16(*residual));
    else
        *residual = zigzag16((uint16_t)(own - expected));
    e->error[p] = own;
    e->good &= outline | (own > e->floor);
}

static inline void hand_on(rqt_code *error, int32_t parent, rqt_code own) {
    if (error[parent] < own) error[parent] = own;
}

static inline bool code_kept_errors(bool restoring, const kept_list *list, int k, error_pass *e,
                                    const rqt_code *own, uint16_t *residual) {
    const int32_t n = (1 << k) + 1, last = n - 1;
    size_t at = list->count;
    e->good = true;
    for (int scale = 0; scale < list->scales; scale++) {
        const int level = list->scales - 1 - scale;
        const int32_t s = 1 << scale;
        for (; at > list->end[level][0]; at--) {
            const int32_t p = list->place[at - 1], y = p / n, x = p - y * n;
            const int32_t along = x & s ? s : s * n, across = x & s ? s * n : s;
            settle_error(restoring, e, p, along, scale, &residual[at - 1 - KEPT_CORNERS], restoring ? 0 : own[p]);
            if (x & s ? y > 0 : x > 0) hand_on(e->error, p - across, e->error[p]);
            if (x & s ? y < last : x < last) hand_on(e->error, p + across, e->error[p]);
        }
        const size_t begin = level ? list->end[level - 1][1] : KEPT_CORNERS;
        for (; at > begin; at--) {
            const int32_t p = list->place[at - 1], y = p / n, x = p - y * n;
            const bool down = ((x ^ y) >> (scale + 1) & 1) == 0; /* its diagonal goes from above left */
            const int32_t along = down ? s * n + s : s * n - s, across = down ? s * n - s : s * n + s;
            const bool whole = 2 * s == last;
            settle_error(restoring, e, p, whole ? 0 : along, scale, &residual[at - 1 - KEPT_CORNERS],
                         restoring ? 0 : own[p]);
            if (whole) continue;
            hand_on(e->error, p - across, e->error[p]);
            hand_on(e->error, p + across, e->error[p]);
        }
    }
    return e->good;
}

rqt_code kept_ground(const kept_list *list, const rqt_block *b) {
    rqt_code least = 0;
    if (list->scales == 0) return 0;
    const size_t begin = list->scales > 1 ? list->end[list->scales - 2][1] : KEPT_CORNERS;
    for (size_t at = begin; at < list->count; at++) {
        const int32_t p = list->place[at];
        if (b->flags[p] & RQT_OUTLINE && (!least || b->error[p] < least)) least = b->error[p];
    }
    return least;
}

void predict_kept_errors(const kept_list *list, const rqt_block *b, const int32_t *q, double quantum,
                         rqt_code ground, rqt_code *scratch, uint16_t *residual) {
    const int32_t n = (1 << b->k) + 1;
    memset(scratch, 0, (size_t)n * (size_t)n * sizeof *scratch);
    error_pass e = {q, b->flags, scratch, b->floor, ground, half_of(quantum), true};
    (void)code_kept_errors(false, list, b->k, &e, b->error, residual);
}

bool restore_kept_errors(const kept_list *list, const rqt_block *b, double quantum, rqt_code ground,
                         const uint16_t *residual) {
    error_pass e = {b->q, b->flags, b->error, b->floor, ground, half_of(quantum), true};
    return code_kept_errors(true, list, b->k, &e, NULL, (uint16_t *)residual);
}
