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

enum { MARGIN = 2, SIDE_WINDOW = 2 * MARGIN, CENTRE_WINDOW = SIDE_WINDOW + 2 };

typedef struct asking {
    const rqt_rule *rule;
    int rank;
} asking;

static uint16_t limit_of(const void *context, rqt_code code) {
    const asking *a = context;
    return (uint16_t)(rule_field_threshold(a->rule, code, a->rank) + 1);
}

/* to[i] = the least of `width` values of from, `step` apart from i on. */
static inline __attribute__((always_inline)) void least_of(const uint16_t *restrict from, size_t step, int width,
                                                           size_t count, uint16_t *restrict to) {
    for (size_t i = 0; i < count; i++) {
        uint16_t least = from[i];
        for (int w = 1; w < width; w++) {
            const uint16_t other = from[i + (size_t)w * step];
            least = other < least ? other : least;
        }
        to[i] = least;
    }
}

/* Windows of side_cells squared, by their first cells. room: as large as the grid. */
VECTOR_CLONES
static void side_windows(const uint16_t *grid, size_t n, uint16_t *room, uint16_t *windows) {
    const size_t rows = n - SIDE_WINDOW + 1, last = SIDE_WINDOW - 1;
    least_of(grid, n, SIDE_WINDOW, rows * n, room);
    least_of(room, 1, SIDE_WINDOW, rows * n - last, windows);
}

VECTOR_CLONES
static void centre_windows(const uint16_t *grid, size_t n, uint16_t *room, uint16_t *windows) {
    const size_t rows = n - CENTRE_WINDOW + 1, last = CENTRE_WINDOW - 1;
    least_of(grid, n, CENTRE_WINDOW, rows * n, room);
    least_of(room, 1, CENTRE_WINDOW, rows * n - last, windows);
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
        const int32_t side = place->stride << scale;
        const field_cells where = {place->x - MARGIN * side, place->y - MARGIN * side, side, (int)n};
        asking a = {rule, 2 * __builtin_ctz((unsigned)side)};
        /* Vertices on sides; the others of the grid are those of coarser scales, and centres, which come later. */
        field_paint(field, &where, limit_of, &a, grid);
        side_windows(grid, n, columns, windows);
        for (size_t y = 0; y <= cells; y++) {
            uint16_t *const row = limits + y * step * across;
            for (size_t x = 0; x <= cells; x++) row[x * step] = windows[y * n + x];
        }
        a.rank++;
        if (rule_lowers(rule)) field_paint(field, &where, limit_of, &a, grid);
        centre_windows(grid, n, columns, windows);
        for (size_t y = 1; y < cells; y += 2) {
            uint16_t *const row = limits + y * step * across;
            for (size_t x = 1; x < cells; x += 2) row[x * step] = windows[(y - 1) * n + x - 1];
        }
    }
}
