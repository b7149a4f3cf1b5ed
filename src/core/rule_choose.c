/* rule_choose.c - what a rule selects in a block by its field and by rank.
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
 * not above the threshold of its least code select nothing, and most cells end with that.
 *
 * Where none of the nine is cut any more, nothing is finer: six by six are then the nine twice over. A quarter's
 * centre has the two by two that are around it, the middle of a side those of the two quarters that it lies
 * between, and the nodes are not looked at again. Most cells are of that kind, for squares are cut about as far as
 * meshes go. */
#include "field.h"
#include "rule.h"

typedef struct choosing {
    const rqt_rule *rule;
    const rqt_field *field;
    const rqt_block *block;
    uint8_t *chosen;
    uint32_t n; /* vertices a side */
    uint8_t mask, all;
    const int32_t *by_rank; /* without a field: thresholds; else NULL */
    bool is_code;           /* thresholds are codes, cut off at `most` */
    int32_t most;
} choosing;

static inline int32_t threshold_of(const choosing *c, rqt_code code, int rank) {
    if (c->by_rank) return c->by_rank[rank];
    if (!c->is_code) return rule_field_threshold(c->rule, code, rank);
    return (int32_t)code < c->most ? (int32_t)code : c->most;
}

static inline bool may_be_selected(const choosing *c, uint32_t place, int32_t threshold) {
    return c->block->error[place] > threshold || (c->mask && (c->block->flags[place] & c->mask));
}

static inline bool choose_place(choosing *c, uint32_t place, rqt_code code, int rank) {
    if (c->chosen[place]) return true; /* from the other side */
    if (!may_be_selected(c, place, threshold_of(c, code, rank))) return false;
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

static child_codes codes_among_leaves(const rqt_code nine[9]) {
    rqt_code two[4]; /* by two */
    for (int i = 0; i < 4; i++) {
        const rqt_code *at = nine + (i & 1) + 3 * (i >> 1);
        two[i] = lesser(lesser(at[0], at[1]), lesser(at[3], at[4]));
    }
    return (child_codes){
        {lesser(two[0], two[1]), lesser(two[0], two[2]), lesser(two[1], two[3]), lesser(two[2], two[3])},
        {two[0], two[1], two[2], two[3]}};
}

/* Places of a cell: the middles of its sides, the centres of its quarters. */
typedef struct cell_places {
    uint32_t side[4], centre[4], half; /* half: from a quarter's centre to its sides */
} cell_places;

/* middle: the place of the cell's centre; half: places from it to the sides. */
static inline cell_places places_around(const choosing *c, uint32_t middle, uint32_t half) {
    const uint32_t n = c->n, h = half / 2;
    return (cell_places){{middle - half * n, middle - half, middle + half, middle + half * n},
                         {middle - h * n - h, middle - h * n + h, middle + h * n - h, middle + h * n + h},
                         h};
}

/* May a side be selected, by the least code of the cell? A quarter's centre depends on the middles of two sides. */
static inline bool goes_on(const choosing *c, const cell_places *at, rqt_code least, int rank) {
    const int32_t threshold = threshold_of(c, least, rank - 1);
    bool may = false;
    for (int i = 0; i < 4; i++) may |= may_be_selected(c, at->side[i], threshold);
    if (!may) return false;
    for (int i = 0; i < 4; i++) {
        __builtin_prefetch(&c->block->error[at->centre[i]]);
        __builtin_prefetch(&c->block->flags[at->centre[i]]);
        __builtin_prefetch(&c->block->flags[at->side[i]]);
    }
    return true;
}

/* rank: of the cell's centre, which is chosen. Bit i: the centre of the quarter i is, too. */
static inline unsigned choose_children(choosing *c, const cell_places *at, const child_codes *codes, int rank) {
    bool chosen[4];
    unsigned quarters = 0;
    for (int i = 0; i < 4; i++) chosen[i] = choose_place(c, at->side[i], codes->side[i], rank - 1);
    if (at->half == 0) return 0;
    for (int i = 0; i < 4; i++) {
        if (!chosen[i & 2 ? 3 : 0] || !chosen[i & 1 ? 2 : 1] ||
            !choose_place(c, at->centre[i], codes->quarter[i], rank - 2))
            continue;
        quarters |= 1U << i;
        __builtin_prefetch(&c->block->error[at->centre[i] - at->half * c->n]);
        __builtin_prefetch(&c->block->error[at->centre[i] + at->half * c->n]);
    }
    return quarters;
}

/* nine: codes of squares that are not cut, least the least of them. */
static void choose_among_leaves(choosing *c, uint32_t middle, uint32_t half, int rank, const rqt_code nine[9],
                                rqt_code least) {
    const cell_places at = places_around(c, middle, half);
    if (!goes_on(c, &at, least, rank)) return;
    const child_codes codes = codes_among_leaves(nine);
    const unsigned quarters = choose_children(c, &at, &codes, rank);
    for (int i = 0; i < 4; i++) {
        if (!(quarters >> i & 1)) continue;
        const rqt_code *two = nine + (i & 1) + 3 * (i >> 1);
        const int x = i & 1 ? 0 : 1, y = i & 2 ? 0 : 3; /* the column and row that is there twice */
        const rqt_code around[9] = {two[0],     two[x], two[1],     two[y], two[y + x],
                                    two[y + 1], two[3], two[3 + x], two[4]};
        choose_among_leaves(c, at.centre[i], at.half, rank - 2, around, codes.quarter[i]);
    }
}

static void choose_around(choosing *c, uint32_t middle, uint32_t half, int rank, const field_node nine[9],
                          rqt_code least) {
    rqt_code leaf[9];
    if (field_are_leaves(c->field, nine, leaf)) {
        choose_among_leaves(c, middle, half, rank, leaf, least);
        return;
    }
    const cell_places at = places_around(c, middle, half);
    if (!goes_on(c, &at, least, rank)) return;
    const child_codes codes = codes_of_children(c->field, nine);
    const unsigned quarters = choose_children(c, &at, &codes, rank);
    for (int i = 0; i < 4; i++) {
        if (!(quarters >> i & 1)) continue;
        field_node around[9];
        field_around_quarter(c->field, nine, i, around);
        choose_around(c, at.centre[i], at.half, rank - 2, around, codes.quarter[i]);
    }
}

/* Without a field. */
static void choose_below(choosing *c, uint32_t middle, uint32_t half, int rank) {
    static const child_codes none;
    const cell_places at = places_around(c, middle, half);
    if (!goes_on(c, &at, 0, rank)) return;
    const unsigned quarters = choose_children(c, &at, &none, rank);
    for (int i = 0; i < 4; i++)
        if (quarters >> i & 1) choose_below(c, at.centre[i], at.half, rank - 2);
}

uint8_t rule_choose(const rqt_rule *rule, const rqt_block_place *place, const rqt_block *block, uint8_t mask,
                    uint8_t *chosen) {
    const uint32_t n = (UINT32_C(1) << block->k) + 1, half = n / 2, middle = half * n + half;
    choosing c = {.rule = rule,
                  .field = rule_field(rule),
                  .block = block,
                  .chosen = chosen,
                  .n = n,
                  .mask = mask,
                  .all = 0xFF};
    c.is_code = rule_takes_codes(rule, &c.most);
    memset(chosen, 0, (size_t)n * n);
    if (block->k == 0) return c.all;
    const int rank = 2 * __builtin_ctz((unsigned)place->side) - 1;
    if (!c.field) {
        c.by_rank = rule_thresholds(rule);
        if (choose_place(&c, middle, 0, rank)) choose_below(&c, middle, half, rank);
        return c.all;
    }
    field_node nine[9];
    for (int j = 0; j < 9; j++)
        nine[j] = field_node_at(c.field, place->x + (j % 3 - 1) * place->side, place->y + (j / 3 - 1) * place->side,
                                place->side);
    const rqt_code least = least_of_nine(&c, nine);
    if (choose_place(&c, middle, least, rank)) choose_around(&c, middle, half, rank, nine, least);
    return c.all;
}
