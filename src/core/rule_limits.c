/* rule_limits.c - what a rule with a field selects in a block: the limits of all its vertices at once.
 *
 * To ask the field for each vertex takes longer than the rest of the walk. But the boxes of vertices of one scale
 * are made of cells of side q, the largest power of two that divides their coordinates: four by four for a vertex
 * on the sides of cells, six by six for a centre. So the field is painted on a grid of such cells, the block's and
 * two more all around; then limits are minima over windows of that grid, first down, then across. A limit is the
 * least error that selects: a threshold and 1. Lowering does not change an order, so what is painted is lowered
 * already.
 *
 * Windows are taken over the whole grid as one row: what wraps around at its right end is not looked at. */
#include "field.h"
#include "rule.h"

enum { MARGIN = 2, WINDOW = 2 * MARGIN };

typedef struct asking {
    const rqt_rule *rule;
    int rank;
} asking;

static uint16_t limit_of(const void *context, rqt_code code) {
    const asking *a = context;
    return (uint16_t)(rule_field_threshold(a->rule, code, a->rank) + 1);
}

/* to[i] = the least of the values of a window, `step` apart from i on. */
static inline __attribute__((always_inline)) void least_of(const uint16_t *restrict from, size_t step, size_t count,
                                                           uint16_t *restrict to) {
    for (size_t i = 0; i < count; i++) {
        uint16_t least = from[i];
        for (size_t w = 1; w < WINDOW; w++) {
            const uint16_t other = from[i + w * step];
            least = other < least ? other : least;
        }
        to[i] = least;
    }
}

/* Four by four cells, by the first of them, of a grid of n by n. */
VECTOR_CLONES
static void take_windows(const uint16_t *grid, size_t n, uint16_t *room, uint16_t *windows) {
    const size_t rows = n - WINDOW + 1;
    least_of(grid, n, rows * n, room);
    least_of(room, 1, rows * n - (WINDOW - 1), windows);
}

/* Six by six: four windows that lie two cells apart. */
VECTOR_CLONES
static void take_wide_windows(const uint16_t *restrict windows, size_t n, uint16_t *restrict wide) {
    const size_t rows = n - WINDOW - 1, count = rows * n - (WINDOW + 1);
    for (size_t i = 0; i < count; i++) {
        const uint16_t a = windows[i], b = windows[i + 2], c = windows[i + 2 * n], d = windows[i + 2 * n + 2];
        const uint16_t one = a < b ? a : b, other = c < d ? c : d;
        wide[i] = one < other ? one : other;
    }
}

size_t rule_limits_room(int k) {
    const size_t n = ((size_t)1 << k) + 1 + 2 * MARGIN;
    return 3 * n * n;
}

void rule_limits(const rqt_rule *rule, const rqt_block_place *place, int k, uint16_t *limits, uint16_t *room) {
    const rqt_field *field = rule_field(rule);
    const size_t across = ((size_t)1 << k) + 1;
    for (int scale = 0; scale < k; scale++) {
        const size_t step = (size_t)1 << scale, cells = (size_t)1 << (k - scale), n = cells + 2 * MARGIN;
        uint16_t *const grid = room, *const columns = room + n * n, *const windows = room + 2 * n * n;
        const int q = __builtin_ctz((unsigned)place->stride) + scale;
        const field_cells where = {place->x - (MARGIN << q), place->y - (MARGIN << q), q, (int)n};
        asking a = {rule, 2 * q};
        field_paint(field, &where, limit_of, &a, grid);
        take_windows(grid, n, columns, windows);
        /* Even rows hold vertices on sides between those of coarser scales, which come later, odd ones centres
         * between vertices on sides. */
        for (size_t y = 0; y <= cells; y++) {
            uint16_t *const row = limits + y * step * across;
            const uint16_t *const from = windows + y * n;
            if (step == 1)
                memcpy(row, from, across * sizeof *row);
            else
                for (size_t x = y % 2 ? 0 : 1; x <= cells; x += 2) row[x * step] = from[x];
        }
        if (rule_lowers(rule)) {
            a.rank++;
            field_paint(field, &where, limit_of, &a, grid);
            take_windows(grid, n, columns, windows);
        }
        take_wide_windows(windows, n, columns);
        for (size_t y = 1; y < cells; y += 2) {
            uint16_t *const row = limits + y * step * across;
            const uint16_t *const from = columns + (y - 1) * n;
            for (size_t x = 1; x < cells; x += 2) row[x * step] = from[x - 1];
        }
    }
}
