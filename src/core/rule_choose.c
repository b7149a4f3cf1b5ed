/* rule_choose.c - what a rule with a field selects in a block.
 *
 * From the block's cell down, from cells whose centre is selected to the vertices on their sides and to the centres
 * of their quarters: what is selected is closed, and every vertex of a closed cell but its corners descends from
 * its centre (rule.c). So nothing is asked but what is selected and its children.
 *
 * Thresholds come down with it. Let the cell have the side 2q, its centre the box of half-width 3q: the cell and
 * the eight of its size around it. The squares of the field there (or larger ones that hold them) are at hand as
 * nine nodes of its tree. The vertex in the middle of a side has a box of half-width 2q, the centre of a quarter
 * one of 3q/2: both are made of cells of side q, of which the nine have six by six,
 *
 *     middle of the north side: columns 1 to 4, rows 0 to 3;  north-western centre: columns 1 to 3, rows 1 to 3;
 *
 * and what is around a quarter is nine of them. All those boxes lie in that of the cell's centre: errors that are
 * not above the threshold of its least code select nothing, and most cells end with that. */
#include "field.h"
#include "rule.h"

typedef struct choosing {
    const rqt_rule *rule;
    const rqt_field *field;
    const rqt_block *block;
    uint8_t *chosen;
    uint32_t n; /* vertices a side */
    uint8_t mask, all;
} choosing;

static inline bool may_be_selected(const choosing *c, uint32_t place, int32_t threshold) {
    return c->block->error[place] > threshold || (c->mask && (c->block->flags[place] & c->mask));
}

static inline bool choose_place(choosing *c, uint32_t place, rqt_code code, int rank) {
    if (c->chosen[place]) return true; /* from the other side */
    if (!may_be_selected(c, place, rule_field_threshold(c->rule, code, rank))) return false;
    c->chosen[place] = 1;
    c->all &= c->block->flags[place];
    __builtin_prefetch(&c->block->q[place]); /* is wanted when the walk is done */
    return true;
}

static inline rqt_code lesser(rqt_code a, rqt_code b) {
    return a < b ? a : b;
}

static rqt_code least_of_nine(const choosing *c, const field_node nine[9]) {
    rqt_code least = RQT_CODE_INFINITY;
    for (int i = 0; i < 9; i++) least = lesser(least, field_node_least(c->field, nine[i]));
    return least;
}

/* Least codes of columns, of these rows. */
typedef struct column_codes {
    rqt_code north, across, south; /* 0 to 3, 1 to 4, 2 to 5 */
    rqt_code quarter[2];           /* 1 to 3, 2 to 4 */
} column_codes;

static inline column_codes codes_of_column(const rqt_code column[6]) {
    const rqt_code upper = lesser(column[1], lesser(column[2], column[3])),
                   lower = lesser(column[4], lesser(column[2], column[3]));
    return (column_codes){
        lesser(column[0], upper), lesser(upper, column[4]), lesser(lower, column[5]), {upper, lower}};
}

#define LEAST4(c, first, of) \
    lesser(lesser((c)[first].of, (c)[(first) + 1].of), lesser((c)[(first) + 2].of, (c)[(first) + 3].of))
#define LEAST3(c, first, of) lesser(lesser((c)[first].of, (c)[(first) + 1].of), (c)[(first) + 2].of)

/* Of what is around a cell's centre. */
typedef struct child_codes {
    rqt_code side[4], quarter[4]; /* north, west, east, south; north-west, north-east, south-west, south-east */
} child_codes;

static child_codes codes_of_children(const rqt_field *field, const field_node nine[9]) {
    rqt_code halves[6][6]; /* column by column */
    field_halve(field, nine, halves);
    column_codes of[6];
    for (int u = 0; u < 6; u++) of[u] = codes_of_column(halves[u]);
    return (child_codes){{LEAST4(of, 1, north), LEAST4(of, 0, across), LEAST4(of, 2, across), LEAST4(of, 1, south)},
                         {LEAST3(of, 1, quarter[0]), LEAST3(of, 2, quarter[0]), LEAST3(of, 1, quarter[1]),
                          LEAST3(of, 2, quarter[1])}};
}

static inline bool are_one_square(const field_node nine[9]) {
    bool same = true;
    for (int j = 1; j < 9; j++) same &= nine[j] == nine[0];
    return same;
}

/* middle: the place of a cell's centre, of that rank, which is chosen; half: places from it to the sides. */
static void choose_around(choosing *c, uint32_t middle, uint32_t half, int rank, const field_node nine[9],
                          rqt_code least) {
    const uint32_t n = c->n, h = half / 2;
    const uint32_t side[4] = {middle - half * n, middle - half, middle + half, middle + half * n};
    const uint32_t centre[4] = {middle - h * n - h, middle - h * n + h, middle + h * n - h, middle + h * n + h};
    const int32_t threshold = rule_field_threshold(c->rule, least, rank - 1);
    bool may = false;
    for (int i = 0; i < 4; i++) may |= may_be_selected(c, side[i], threshold);
    /* A quarter's centre depends on the middles of two sides. */
    if (!may) return;
    for (int i = 0; i < 4; i++) {
        __builtin_prefetch(&c->block->error[centre[i]]);
        __builtin_prefetch(&c->block->flags[centre[i]]);
        __builtin_prefetch(&c->block->flags[side[i]]);
    }

    const bool is_one = are_one_square(nine);
    const child_codes codes = is_one ? (child_codes){{least, least, least, least}, {least, least, least, least}}
                                     : codes_of_children(c->field, nine);
    bool chosen[4];
    for (int i = 0; i < 4; i++) chosen[i] = choose_place(c, side[i], codes.side[i], rank - 1);
    if (half == 1) return;
    bool goes_on[4];
    for (int i = 0; i < 4; i++) {
        goes_on[i] = chosen[i & 2 ? 3 : 0] && chosen[i & 1 ? 2 : 1] &&
                     choose_place(c, centre[i], codes.quarter[i], rank - 2);
        if (!goes_on[i]) continue;
        __builtin_prefetch(&c->block->error[centre[i] - h * n]);
        __builtin_prefetch(&c->block->error[centre[i] + h * n]);
    }
    for (int i = 0; i < 4; i++) {
        if (!goes_on[i]) continue;
        field_node around[9];
        if (!is_one) field_around_quarter(c->field, nine, i, around);
        choose_around(c, centre[i], h, rank - 2, is_one ? nine : around, codes.quarter[i]);
    }
}

uint8_t rule_choose(const rqt_rule *rule, const rqt_block_place *place, const rqt_block *block, uint8_t mask,
                    uint8_t *chosen) {
    const uint32_t n = (UINT32_C(1) << block->k) + 1, half = n / 2, middle = half * n + half;
    choosing c = {rule, rule_field(rule), block, chosen, n, mask, 0xFF};
    memset(chosen, 0, (size_t)n * n);
    if (block->k == 0) return c.all;
    field_node nine[9];
    for (int j = 0; j < 9; j++)
        nine[j] = field_node_at(c.field, place->x + (j % 3 - 1) * place->side, place->y + (j / 3 - 1) * place->side,
                                place->side);
    const rqt_code least = least_of_nine(&c, nine);
    const int rank = 2 * __builtin_ctz((unsigned)place->side) - 1;
    if (choose_place(&c, middle, least, rank)) choose_around(&c, middle, half, rank, nine, least);
    return c.all;
}
