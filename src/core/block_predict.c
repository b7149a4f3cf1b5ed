/* block_predict.c - the predictors of the block codec (FORMAT.md, "Heights" and "Errors").
 *
 * Both were chosen by measuring real terrain, for size first and then for speed. A height is its left neighbour
 * plus what the row above says about the slope; so all but one addition per height is independent of the row's
 * other heights. Errors go from fine to coarse, as they are made: a vertex errs at least as much as its children,
 * and at least as much as it differs from the midpoint of its diamond, which for most vertices is the whole truth.
 *
 * Each scale q of the lattice splits the grid into pairs of rows. In units of q, and with even positions belonging
 * to the next coarser scale:
 *
 *        E---H---E---H---E     H and V are the sides: midpoints of an edge between two E
 *        |   |   |   |   |     C are the centres: children of theirs are none here, of H and V the C of half the
 * scale V---C---V---C---V |   |   |   |   | E---H---E---H---E
 *
 * Rows of E, H, V and C are kept apart, so that every loop runs over neighbours in memory. All arithmetic is on
 * unsigned integers, or floats that are rounded once per operation: the same on every machine. */
#include "block_predict.h"

#include <float.h>
#include <math.h>

_Static_assert(FLT_EVAL_METHOD == 0, "predictions are stored: float must be float");

/* What the row above adds to the left neighbour: a quarter of 2*(N - NW) + (NE - NW), rounded down. Differences
 * wrap around; for heights that far apart the prediction is poor, but the same for writer and reader. */
static inline uint32_t slope(uint32_t nw, uint32_t n, uint32_t ne) {
    return (uint32_t)((int32_t)(2 * n + ne - 3 * nw) >> 2);
}

void predict_height_row(const int32_t *row, const int32_t *above, int32_t width, uint32_t *residual) {
    const uint32_t *r = (const uint32_t *)row, *a = (const uint32_t *)above;
    residual[0] = zigzag32(r[0] - (a ? a[0] : 0));
    if (!a) {
        for (int32_t x = 1; x < width; x++) residual[x] = zigzag32(r[x] - r[x - 1]);
        return;
    }
    for (int32_t x = 1; x < width - 1; x++)
        residual[x] = zigzag32(r[x] - r[x - 1] - slope(a[x - 1], a[x], a[x + 1]));
    if (width > 1) {
        int32_t x = width - 1;
        residual[x] = zigzag32(r[x] - r[x - 1] - slope(a[x - 1], a[x], a[x]));
    }
}

/* Running sums of a row, four at a time: the chain from one to the next is what decoding waits for. Returns a
 * number with its top bit set when one is no height. */
typedef uint32_t four __attribute__((vector_size(16)));

INLINE uint32_t sum_up(uint32_t *r, int32_t n) {
    const uint32_t largest = RQT_HEIGHT_LIMIT - 1;
    const four none = {0}, limit = {largest, largest, largest, largest};
    four before = {0}, wrong = {0};
    int32_t x = 0;
    for (; x + 4 <= n; x += 4) {
        four v;
        memcpy(&v, r + x, sizeof v);
        v += __builtin_shufflevector(v, none, 4, 0, 1, 2);
        v += __builtin_shufflevector(v, none, 4, 4, 0, 1);
        v += before;
        memcpy(r + x, &v, sizeof v);
        before = __builtin_shufflevector(v, v, 3, 3, 3, 3);
        wrong |= (v + limit) | (limit - v);
    }
    uint32_t sum = before[3], bad = wrong[0] | wrong[1] | wrong[2] | wrong[3];
    for (; x < n; x++) {
        r[x] = sum += r[x];
        bad |= (sum + largest) | (largest - sum);
    }
    return bad;
}

VECTOR_CLONES uint32_t restore_heights(const uint8_t *planes, size_t stored, int count, int32_t width,
                                       int32_t height, int32_t side, int32_t *q) {
    uint32_t residual[LARGEST_N], bad = 0;
    for (int32_t y = 0; y < height; y++, planes += width) {
        uint32_t *r = (uint32_t *)q + (ptrdiff_t)y * side;
        get_planes(planes, stored, count, width, residual);
        if (y == 0) {
            /* get_planes has set `width` of them. NOLINTNEXTLINE(clang-analyzer-core.CallAndMessage) */
            for (int32_t x = 0; x < width; x++) r[x] = unzigzag32(residual[x]);
        } else {
            const uint32_t *above = r - side;
            r[0] = unzigzag32(residual[0]) + above[0]; /* as well. NOLINT(clang-analyzer-core.CallAndMessage) */
            for (int32_t x = 1; x < width - 1; x++)
                r[x] = unzigzag32(residual[x]) + slope(above[x - 1], above[x], above[x + 1]);
            if (width > 1) {
                const int32_t x = width - 1;
                r[x] = unzigzag32(residual[x]) + slope(above[x - 1], above[x], above[x]);
            }
        }
        bad |= sum_up(r, width);
    }
    return bad;
}

/* ---------------------------------------------------------------------------------------------- errors */

float half_of(double quantum) {
    double half = quantum * (0.5 - 0x1p-21);
    return (float)(half < 0x1p-90 ? 0x1p-90 : half > 0x1p90 ? 0x1p90 : half);
}

INLINE rqt_code larger(rqt_code a, rqt_code b) {
    return a > b ? a : b;
}

/* One row: predictions to residuals, or, in place, to codes. residual may then be NULL: the predictions are right.
 */
INLINE void settle(bool restoring, rqt_code *restrict p, int n, const rqt_code *restrict code,
                   uint16_t *restrict residual) {
    if (!restoring)
        for (int i = 0; i < n; i++) residual[i] = zigzag16((uint16_t)(code[i] - p[i]));
    else if (residual)
        for (int i = 0; i < n; i++) p[i] = (rqt_code)(p[i] + unzigzag16(residual[i]));
}

/* Every second element: of n + 1 + n, the even ones and the odd ones. */
INLINE void split(const int32_t *restrict row, int n, int32_t *restrict even, int32_t *restrict odd) {
    for (int i = 0; i < n; i++) {
        even[i] = row[2 * i];
        odd[i] = row[2 * i + 1];
    }
    even[n] = row[2 * n];
}

/* Raise the predictions of n sides of one row to their children's codes: two rows (NULL beyond the block) of 2n
 * centres of half the scale. The children of side i of an H row are the centres 2i and 2i+1. */
INLINE void raise_h(rqt_code *restrict prediction, int n, const rqt_code *restrict centres) {
    if (!centres) return;
    for (int i = 0; i < n; i++) prediction[i] = larger(prediction[i], larger(centres[2 * i], centres[2 * i + 1]));
}

/* The same for the n + 1 sides of a V row: the children of side i are the centres 2i-1 and 2i. */
INLINE void raise_v(rqt_code *restrict prediction, int n, const rqt_code *restrict centres) {
    prediction[0] = larger(prediction[0], centres[0]);
    for (int i = 1; i < n; i++) prediction[i] = larger(prediction[i], larger(centres[2 * i - 1], centres[2 * i]));
    prediction[n] = larger(prediction[n], centres[2 * n - 1]);
}

/* And that of n centres of a row: the sides around them. */
INLINE void raise_c(rqt_code *restrict p, int n, const rqt_code *restrict above, const rqt_code *restrict below,
                    const rqt_code *restrict beside) {
    for (int i = 0; i < n; i++)
        p[i] = larger(p[i], larger(larger(above[i], below[i]), larger(beside[i], beside[i + 1])));
}

INLINE void midpoints(rqt_code *restrict p, int n, const int32_t *restrict z, const int32_t *restrict a,
                      const int32_t *restrict b, float half) {
    for (int i = 0; i < n; i++) p[i] = midpoint_code(z[i], sum_of(a[i], b[i]), half);
}

/* The diagonal goes from above left where column and row are both even or both odd. */
INLINE void cross_midpoints(rqt_code *restrict p, int n, const int32_t *restrict z, const int32_t *restrict above,
                            const int32_t *restrict below, int odd_row, float half) {
    for (int i = 0; i < n; i++) {
        const uint32_t other = 0 - (uint32_t)((i ^ odd_row) & 1); /* a mask: a branch would be slower */
        const uint32_t sum = (sum_of(above[i], below[i + 1]) & ~other) | (sum_of(above[i + 1], below[i]) & other);
        p[i] = midpoint_code(z[i], sum, half);
    }
}

/* At the second scale a diamond holds few enough samples to look at all of them, and so to know the error exactly
 * where all of the diamond is in the block. Those on the legs are left to the children. In quarters of a quantum.
 */
INLINE uint32_t size_of(uint32_t difference) {
    return (int32_t)difference < 0 ? 0 - difference : difference;
}
INLINE uint32_t wider(uint32_t a, uint32_t b) {
    return a > b ? a : b;
}

/* A side at z, its hypotenuse `along`, its apexes `across`: at 2 steps each. */
INLINE int32_t deep_side(const int32_t *z, ptrdiff_t along, ptrdiff_t across, bool before, bool after) {
    const uint32_t l = (uint32_t)z[-2 * along], r = (uint32_t)z[2 * along], ends = l + r;
    uint32_t most = size_of(4 * (uint32_t)z[0] - 2 * ends);
    most = wider(most, size_of(4 * (uint32_t)z[-along] - 2 * l - ends));
    most = wider(most, size_of(4 * (uint32_t)z[along] - 2 * r - ends));
    if (before) most = wider(most, size_of(4 * (uint32_t)z[-across] - 2 * (uint32_t)z[-2 * across] - ends));
    if (after) most = wider(most, size_of(4 * (uint32_t)z[across] - 2 * (uint32_t)z[2 * across] - ends));
    return (int32_t)most;
}

/* Half the diamond of a centre at z: apex at (2a, -2b), hypotenuse from (-2a, -2b) to (2a, 2b). */
INLINE uint32_t deep_half(const int32_t *z, ptrdiff_t a, ptrdiff_t b) {
    const uint32_t e = (uint32_t)z[-2 * a - 2 * b], f = (uint32_t)z[2 * a + 2 * b], t = (uint32_t)z[2 * a - 2 * b];
    const uint32_t all = e + f + t;
    const uint32_t inner = size_of(4 * (uint32_t)z[a - b] - t - all);
    return wider(inner, wider(size_of(4 * (uint32_t)z[-b] - e - all), size_of(4 * (uint32_t)z[a] - f - all)));
}

INLINE int32_t deep_centre(const int32_t *z, ptrdiff_t a, ptrdiff_t b) {
    const uint32_t e = (uint32_t)z[-2 * a - 2 * b], f = (uint32_t)z[2 * a + 2 * b], ends = e + f;
    const uint32_t middle = size_of(4 * (uint32_t)z[0] - 2 * ends);
    const uint32_t quarters =
        wider(size_of(4 * (uint32_t)z[-a - b] - 2 * e - ends), size_of(4 * (uint32_t)z[a + b] - 2 * f - ends));
    return (int32_t)wider(wider(middle, quarters), wider(deep_half(z, a, b), deep_half(z, -a, -b)));
}

INLINE void deep_codes(const int32_t *restrict t, int n, float quarter, rqt_code *restrict p) {
    for (int i = 0; i < n; i++) p[i] = code_near_above(fabsf((float)t[i]) * quarter);
}

/* n sides of an H row from z on, 4 apart; which of the rows of apexes are in the block does not change on the way.
 */
INLINE void deep_h(const int32_t *z, ptrdiff_t side, int n, bool before, bool after, int32_t *restrict t) {
    if (before && after)
        for (int i = 0; i < n; i++) t[i] = deep_side(z + 4 * i, 1, side, true, true);
    else if (after)
        for (int i = 0; i < n; i++) t[i] = deep_side(z + 4 * i, 1, side, false, true);
    else
        for (int i = 0; i < n; i++) t[i] = deep_side(z + 4 * i, 1, side, true, false);
}

INLINE void deep_v(const int32_t *z, ptrdiff_t side, int n, int last, int32_t *t) {
    if (n > 0) t[0] = deep_side(z, side, 1, false, true);
    for (int i = 1; i < n && i < last; i++) t[i] = deep_side(z + 4 * i, side, 1, true, true);
    if (n > last) t[last] = deep_side(z + 4 * last, side, 1, true, false);
}

INLINE void deep_c(const int32_t *z, ptrdiff_t side, int n, int odd_row, int32_t *t) {
    for (int i = odd_row; i < n; i += 2) t[i] = deep_centre(z + 4 * i, 1, side);
    for (int i = 1 - odd_row; i < n; i += 2) t[i] = deep_centre(z + 4 * i, -1, side);
}

/* What the flags know: a vertex with the outline bit errs as much as outlines cost, and of other voids nothing is
 * known. n vertices, `step` apart. */
INLINE rqt_code heed_flag(rqt_code p, int flags, rqt_code ground) {
    return flags == RQT_VALID ? p : flags & RQT_OUTLINE ? ground : 0;
}
INLINE void heed_flags(rqt_code *restrict p, int n, const uint8_t *restrict flags, ptrdiff_t step,
                       rqt_code ground) {
    if (step == 2)
        for (int i = 0; i < n; i++) p[i] = heed_flag(p[i], flags[2 * i], ground);
    else
        for (int i = 0; i < n; i++) p[i] = heed_flag(p[i], flags[i * step], ground);
}

/* How many of `most` positions first, first + 2q ... have a diamond that begins before the last sample. Behind it
 * all of a diamond is one sample thick: it errs by nothing. */
INLINE int32_t within(int32_t samples, int32_t first, int32_t q, int32_t most) {
    const int32_t room = samples - 1 - (first - q);
    const int32_t fit = room <= 0 ? 0 : (room + 2 * q - 1) / (2 * q);
    return fit < most ? fit : most;
}

/* One scale, q = 1 << scale. The grid of heights has 2n + 1 rows and columns (stride between rows), n > 0; centres
 * are those of half the scale, 2n rows of 2n, or NULL at the finest. code and residual: H, V, H, V .. H, then the
 * rows of C. Writes every second row and column of heights to next. */
INLINE void code_one_scale(bool restoring, const error_field *f, int scale, const int32_t *heights, int stride,
                           int n, const rqt_code *centres, rqt_code *code, uint16_t *residual, int32_t *next) {
    enum { HALF_N = LARGEST_N / 2 + 1 };
    int32_t even[HALF_N], odd[HALF_N], t[HALF_N];
    rqt_code scratch[HALF_N];
    const ptrdiff_t pair = 2 * n + 1, first_centre = pair * n + n, side = (1 << f->k) + 1;
    const int32_t q = 1 << scale;
    const float half = half_of(f->quantum);
    const rqt_code ground = f->ground ? ground_at(f->ground, scale) : 0;
    const int32_t fit_h = within(f->width, q, q, n), fit_v = within(f->width, 0, q, n + 1);
    for (int j = 0; j <= n; j++) {
        const ptrdiff_t row = (ptrdiff_t)2 * j * q * side;
        const int32_t m = within(f->height, 2 * j * q, q, 1) ? fit_h : 0;
        int32_t *e = next + (ptrdiff_t)j * (n + 1);
        rqt_code *p = restoring ? code + j * pair : scratch;
        split(heights + (ptrdiff_t)2 * j * stride, n, e, odd);
        if (scale == 1) {
            deep_h(f->q + row + q, side, m, j > 0, j < n, t);
            deep_codes(t, m, half * 0.5f, p);
        } else {
            midpoints(p, m, odd, e, e + 1, half);
        }
        for (int i = m; i < n; i++) p[i] = 0;
        if (f->flags) heed_flags(p, n, f->flags + row + q, 2 * q, ground);
        if (centres) {
            raise_h(p, n, j > 0 ? centres + (ptrdiff_t)(2 * j - 1) * 2 * n : NULL);
            raise_h(p, n, j < n ? centres + (ptrdiff_t)(2 * j) * 2 * n : NULL);
        }
        settle(restoring, p, n, code + j * pair, residual ? residual + j * pair : NULL);
    }
    for (int j = 0; j < n; j++) {
        const ptrdiff_t row = (ptrdiff_t)(2 * j + 1) * q * side;
        const bool fits = within(f->height, (2 * j + 1) * q, q, 1);
        const int32_t m_v = fits ? fit_v : 0, m_c = !fits || n == 1 ? 0 : fit_h;
        const int32_t *above = next + (ptrdiff_t)j * (n + 1), *below = above + n + 1;
        rqt_code *h = code + j * pair, *v = h + n, *c = code + first_centre + (ptrdiff_t)j * n;
        rqt_code *p = restoring ? v : scratch;
        split(heights + (ptrdiff_t)(2 * j + 1) * stride, n, even, odd);
        if (scale == 1) {
            deep_v(f->q + row, side, m_v, n, t);
            deep_codes(t, m_v, half * 0.5f, p);
        } else {
            midpoints(p, m_v, even, above, below, half);
        }
        for (int i = m_v; i <= n; i++) p[i] = 0;
        if (f->flags) heed_flags(p, n + 1, f->flags + row, 2 * q, ground);
        if (centres) {
            raise_v(p, n, centres + (ptrdiff_t)(2 * j) * 2 * n);
            raise_v(p, n, centres + (ptrdiff_t)(2 * j + 1) * 2 * n);
        }
        settle(restoring, p, n + 1, v, residual ? residual + j * pair + n : NULL);
        /* The diagonal goes from above left where i and j are both even or both odd. The block's only centre has
         * the diagonal of its place in the lattice, which is not known here: it makes do with its children. */
        p = restoring ? c : scratch;
        if (scale == 1) {
            deep_c(f->q + row + q, side, m_c, j & 1, t);
            deep_codes(t, m_c, half * 0.5f, p);
        } else {
            cross_midpoints(p, m_c, odd, above, below, j & 1, half);
        }
        for (int i = m_c; i < n; i++) p[i] = 0;
        if (f->flags) heed_flags(p, n, f->flags + row + q, 2 * q, ground);
        const rqt_code *h_below = h + pair;
        raise_c(p, n, h, h_below, v);
        settle(restoring, p, n, c, residual ? residual + (c - code) : NULL);
    }
}

INLINE void code_errors(bool restoring, error_scratch *s, const error_field *f) {
    const int32_t *heights = f->q;
    const rqt_code *centres = NULL;
    rqt_code *code = s->code;
    uint16_t *residual = s->residual;
    int stride = (1 << f->k) + 1;
    for (int n = 1 << f->k >> 1, scale = 0; n > 0; n >>= 1, scale++) {
        int32_t *next = s->heights[scale & 1];
        const bool exact = restoring && (scale ? f->others_exact : f->finest_exact);
        code_one_scale(restoring, f, scale, heights, stride, n, centres, code, exact ? NULL : residual, next);
        ptrdiff_t coded = (ptrdiff_t)n * (3 * n + 2);
        centres = code + (coded - (ptrdiff_t)n * n);
        code += coded;
        residual += coded;
        heights = next;
        stride = n + 1;
    }
}

/* From rows to coding order, finest scale first. */
VECTOR_CLONES static void code_by_prediction(error_scratch *s, const error_field *f) {
    code_errors(false, s, f);
}
VECTOR_CLONES static void decode_by_prediction(error_scratch *s, const error_field *f) {
    code_errors(true, s, f);
}

void predict_errors(error_scratch *s, const error_field *f, const rqt_code *error) {
    const int k = f->k;
    const rqt_code *grid = error;
    rqt_code *code = s->code;
    for (int n = 1 << k >> 1, scale = 0; n > 0; n >>= 1, scale++) {
        rqt_code *next = s->grid[scale & 1], *c = code + (ptrdiff_t)2 * n * (n + 1);
        for (int j = 0; j <= n; j++) {
            for (int i = 0; i < n; i++) {
                *next++ = grid[2 * i];
                *code++ = grid[2 * i + 1];
            }
            *next++ = grid[2 * n];
            grid += 2 * n + 1;
            if (j == n) break;
            for (int i = 0; i < n; i++) {
                *code++ = grid[2 * i];
                *c++ = grid[2 * i + 1];
            }
            *code++ = grid[2 * n];
            grid += 2 * n + 1;
        }
        code = c;
        grid = s->grid[scale & 1];
    }
    code_by_prediction(s, f);
}

INLINE void merge(rqt_code *row, int n, const rqt_code *even, const rqt_code *odd) {
    for (int i = 0; i < n; i++) {
        row[2 * i] = even[i];
        row[2 * i + 1] = odd[i];
    }
    row[2 * n] = even[n];
}

/* And back: from coding order to rows, coarsest scale first. */
VECTOR_CLONES void restore_errors(error_scratch *s, const error_field *f, rqt_code *error) {
    decode_by_prediction(s, f);
    const int k = f->k, side = (1 << k) + 1;
    static const rqt_code corners[4] = {0};
    const rqt_code *end = s->code + (ptrdiff_t)side * side - 4, *coarse = corners;
    if (k == 0) memcpy(error, corners, sizeof corners);
    for (int n = 1; n < side - 1; n *= 2) {
        rqt_code *grid = 2 * n == side - 1 ? error : s->grid[coarse == s->grid[0]];
        const ptrdiff_t pair = 2 * n + 1;
        end -= (ptrdiff_t)n * (3 * n + 2);
        const rqt_code *c = end + (ptrdiff_t)2 * n * (n + 1);
        for (int j = 0; j <= n; j++) {
            rqt_code *row = grid + 2 * j * pair;
            merge(row, n, coarse + (ptrdiff_t)j * (n + 1), end + j * pair);
            if (j < n) merge(row + pair, n, end + j * pair + n, c + (ptrdiff_t)j * n);
        }
        coarse = grid;
    }
}
