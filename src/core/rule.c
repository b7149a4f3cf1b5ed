/* rule.c - selection where one eps is not enough: rqt.h, "rules". What it selects, and why blocks can be asked
 * alone.
 *
 * Write q for the largest power of two that divides both coordinates of a vertex P. box(P) has the half-width 3q
 * for the centre of a cell, 2q for a vertex on sides of cells.
 *
 * Closed. The two parents of a centre lie q away in each coordinate and are vertices on sides of cells twice as
 * large: 2 * 2q >= 3q + q. The parents of a vertex on a side lie q away and are centres of cells of side 2q: 3q >=
 * 2q + q. So a box lies in those of the parents, what meets it meets them, and a rank rises from child to parent:
 * no threshold is above a child's. e_sat does not fall from child to parent, so {e_sat > threshold} is closed; so
 * are the outline's vertices and the forced ones with their ancestors, and unions of closed sets.
 *
 * The squares of a field count when they meet the inside of the box, which lies inside those of the parents' too.
 *
 * Bound. Let T be a kept leaf, P its split vertex, which is not selected: e_sat(P) <= threshold(P). Clamped or not,
 * T lies in the closed square of half-width q around P: as T has an area, P - q is before the last column and row.
 * That square is inside box(P), whose half-width is 2q at least. A place that holds a sample of T meets box(P); so
 * does a closed square of the field that holds one, and has a point in common with the inside: the sample itself.
 * Every sample is in a square that exists (field.c). So dev(T) <= e_sat(P) <= eps - lowering for the least of those
 * places and squares, and for the rule's own eps. A leaf without a split vertex holds no samples but its corners.
 * Why the sides of squares do not count, as those of places do: squares tile. A box that is a union of squares
 * would meet all those around it, which hold no sample of T that its own do not.
 *
 * Blocks. Every vertex of the closed cell of a block, except its corners, descends from the cell's centre C
 * (summary.c). So their thresholds are not below threshold(C), and one of them is a forced vertex or an ancestor of
 * one iff C is. Let em be the largest error of any vertex in the cell that is finer than the block's stride,
 * infinite where one of them has an outline bit that counts. A block of stride > 1 is *answered*, and can be walked
 * alone, iff em <= threshold(C) and C is not forced: then all that is selected in the cell is of the block's grid,
 * with an error above em or the outline bit, and that is what sparse blocks keep. Else its children are asked.
 *
 * And then C is selected: as e_sat(C) >= em > threshold(C), or by its outline bit, or as it is forced. That is what
 * walks rely on (query.c: the centre of an answer's parent is selected). em and being forced are inherited upwards
 * and thresholds fall, so above a block that is not answered there is none that is: over each place exactly one
 * block answers, and it is, or lies below, the one that answers eps alone. Unlike there, a block with em equal to
 * its parent's may answer. Why not by the places that meet the block's own extent, grown by one and a half strides,
 * as one might think: that is the reach of what is finer than the stride, but vertices of the grid are missing too.
 * Only the decoded block could tell whether one of them is wanted; and it would pay little. A view of 105,000
 * vertices reads 173 blocks of 129 a side as it is, and 157 if no block were asked for by reach alone.
 *
 * Thresholds are not stored. A question about one vertex goes through a tree of the places' boxes and stops at the
 * first place that selects it, and through the tree of squares; a block that is read goes down that tree once
 * (rule_choose.c). */
#include "field.h"
#include "region_edges.h"
#include "rule.h"

#include <math.h>

typedef struct kept_place {
    uint64_t order; /* along a space-filling curve */
    const rqt_region *region;
    double eps;
    int32_t code; /* of eps, not lowered */
} kept_place;

struct rqt_rule {
    rqt_lattice lattice;
    rqt_allocator allocator;
    double eps, quantum_error;
    bool lowers;
    double lowering[RQT_RANKS];
    int32_t base[RQT_RANKS]; /* the threshold where there is no place, by rank */
    kept_place *places;
    size_t place_count;
    region_box *nodes;      /* the tree of the places' boxes */
    const rqt_field *field; /* NULL: none */
    rqt_selection *forced;  /* closed; NULL: none */
};

/* ----------------------------------------------------------------------------------------------- making -- */

/* eps - by, rounded down, as a code. */
static int32_t lowered_code(double eps, double by, double quantum_error) {
    if (by > eps) return -1;
    double rest = eps - by;
    /* eps >= by: this recovers what the subtraction rounded away. */
    if ((eps - rest) - by < 0) rest = nextafter(rest, 0);
    return rqt_code_eps(rest, quantum_error);
}

static void set_base(rqt_rule *rule) {
    for (int rank = 0; rank < RQT_RANKS; rank++)
        rule->base[rank] = lowered_code(rule->eps, rule->lowering[rank], rule->quantum_error);
}

rqt_status rqt_rule_create(const rqt_lattice *lattice, double quantum_error, const rqt_allocator *allocator,
                           rqt_rule **rule) {
    *rule = NULL;
    rqt_rule *r = memory_take(allocator, sizeof *r);
    if (!r) return RQT_NO_MEMORY;
    *r = (rqt_rule){.lattice = *lattice, .allocator = *allocator, .quantum_error = quantum_error};
    set_base(r);
    *rule = r;
    return RQT_OK;
}

static void drop_places(rqt_rule *rule) {
    memory_drop(&rule->allocator, rule->places);
    memory_drop(&rule->allocator, rule->nodes);
    rule->places = NULL;
    rule->nodes = NULL;
    rule->place_count = 0;
}

void rqt_rule_free(rqt_rule *rule) {
    if (!rule) return;
    const rqt_allocator allocator = rule->allocator;
    drop_places(rule);
    rqt_selection_free(rule->forced);
    memory_drop(&allocator, rule);
}

rqt_status rqt_rule_set_eps(rqt_rule *rule, double eps) {
    if (!(eps >= 0)) return RQT_INVALID;
    rule->eps = eps;
    set_base(rule);
    return RQT_OK;
}

rqt_status rqt_rule_set_lowering(rqt_rule *rule, const double metres[RQT_RANKS]) {
    for (int rank = 0; rank < RQT_RANKS; rank++)
        if (!isfinite(metres[rank]) || metres[rank] < (rank > 0 ? metres[rank - 1] : 0)) return RQT_INVALID;
    memcpy(rule->lowering, metres, sizeof rule->lowering);
    rule->lowers = metres[RQT_RANKS - 1] > 0;
    set_base(rule);
    return RQT_OK;
}

/* A sample's place along the curve that goes round the quarters of quarters, the raster in the middle. */
static uint64_t order_of(const region_box *box) {
    const int64_t most = INT64_C(1) << 22;
    int64_t c[2] = {(box->x0 / 2 + box->x1 / 2) / REGION_UNIT, (box->y0 / 2 + box->y1 / 2) / REGION_UNIT};
    for (int i = 0; i < 2; i++) c[i] = (c[i] < -most ? -most : c[i] > most ? most : c[i]) + most;
    return morton_code((uint32_t)c[0], (uint32_t)c[1]);
}

/* Merge sort by order, with room for as many again; what is equal stays in order. The result is in `places`. */
static void sort_places(kept_place *places, kept_place *room, size_t n) {
    kept_place *from = places, *to = room;
    for (size_t run = 1; run < n; run *= 2) {
        for (size_t start = 0; start < n; start += 2 * run) {
            const size_t middle = n - start < run ? n : start + run,
                         end = n - start < 2 * run ? n : start + 2 * run;
            size_t i = start, j = middle;
            for (size_t k = start; k < end; k++)
                to[k] = j == end || (i < middle && from[i].order <= from[j].order) ? from[i++] : from[j++];
        }
        kept_place *const swap = from;
        from = to;
        to = swap;
    }
    if (from != places) memcpy(places, from, n * sizeof *places);
}

rqt_status rqt_rule_set_places(rqt_rule *rule, const rqt_rule_place *places, size_t n) {
    drop_places(rule);
    for (size_t i = 0; i < n; i++)
        if (!(places[i].eps >= 0)) return RQT_INVALID;
    if (n == 0) return RQT_OK;
    if (n > SIZE_MAX / 4 / sizeof(kept_place)) return RQT_NO_MEMORY;
    kept_place *own = memory_take(&rule->allocator, 2 * n * sizeof *own);
    region_box *nodes = memory_take(&rule->allocator, region_tree_size(n) * sizeof *nodes);
    if (!own || !nodes) {
        memory_drop(&rule->allocator, own);
        memory_drop(&rule->allocator, nodes);
        return RQT_NO_MEMORY;
    }
    rule->places = own;
    rule->nodes = nodes;
    region_box box;
    for (size_t i = 0; i < n; i++) {
        if (!region_extent(places[i].region, &box)) continue;
        own[rule->place_count++] = (kept_place){.order = order_of(&box),
                                                .region = places[i].region,
                                                .eps = places[i].eps,
                                                .code = rqt_code_eps(places[i].eps, rule->quantum_error)};
    }
    sort_places(own, own + n, rule->place_count);
    for (size_t i = 0; i < rule->place_count; i++) (void)region_extent(own[i].region, &nodes[i]);
    region_tree_build(nodes, rule->place_count);
    return RQT_OK;
}

rqt_status rqt_rule_set_field(rqt_rule *rule, const rqt_field *field) {
    if (field && !field_is_over(field, &rule->lattice)) return RQT_INVALID;
    rule->field = field;
    return RQT_OK;
}

rqt_status rqt_rule_force(rqt_rule *rule, rqt_vertex v) {
    const int32_t side = 1 << rule->lattice.K;
    if (v.x < 0 || v.y < 0 || v.x > side || v.y > side) return RQT_INVALID;
    if (!rule->forced) {
        const rqt_status status = rqt_selection_create(&rule->lattice, &rule->allocator, &rule->forced);
        if (status != RQT_OK) return status;
    }
    return rqt_selection_add_resolved(rule->forced, v);
}

/* ---------------------------------------------------------------------------------------------- vertices -- */

static region_box reach_of(rqt_vertex v, int rank) {
    const int64_t half = ((int64_t)(rank & 1 ? 3 : 2) << rank / 2) * REGION_UNIT;
    const int64_t x = v.x * REGION_UNIT, y = v.y * REGION_UNIT;
    return (region_box){x - half, y - half, x + half, y + half};
}

static int32_t code_at(const rqt_rule *rule, const kept_place *p, int rank) {
    return rule->lowers ? lowered_code(p->eps, rule->lowering[rank], rule->quantum_error) : p->code;
}

int32_t rule_field_threshold(const rqt_rule *rule, rqt_code code, int rank) {
    const int32_t lowered = rule->lowers || rule->quantum_error > 0
                                ? lowered_code(rqt_code_metres(code), rule->lowering[rank], rule->quantum_error)
                                : code;
    return lowered < rule->base[rank] ? lowered : rule->base[rank];
}

bool rule_takes_codes(const rqt_rule *rule, int32_t *most) {
    *most = rule->base[0];
    return !rule->lowers && !(rule->quantum_error > 0);
}

/* By the rule's own eps and the field. */
static int32_t threshold_without_places(const rqt_rule *rule, rqt_vertex v, int rank) {
    if (!rule->field) return rule->base[rank];
    const int32_t half = (rank & 1 ? 3 : 2) << rank / 2;
    return rule_field_threshold(rule, field_least(rule->field, v.x - half, v.y - half, v.x + half, v.y + half),
                                rank);
}

int32_t rqt_rule_threshold(const rqt_rule *rule, rqt_vertex v) {
    const int rank = rqt_vertex_rank(&rule->lattice, v);
    int32_t least = threshold_without_places(rule, v, rank);
    const region_box reach = reach_of(v, rank);
    region_search s;
    region_search_begin(&s, rule->nodes, rule->place_count, &reach);
    for (size_t i; region_search_next(&s, &i);) {
        const int32_t code = code_at(rule, &rule->places[i], rank);
        if (code < least && region_touches(rule->places[i].region, &reach)) least = code;
    }
    return least;
}

static bool is_forced(const rqt_rule *rule, rqt_vertex v) {
    return rule->forced && rqt_selection_has(rule->forced, v);
}

bool rqt_rule_selects(const rqt_rule *rule, rqt_vertex v, rqt_code error, bool outline) {
    const int rank = rqt_vertex_rank(&rule->lattice, v);
    if (outline || error > rule->base[rank]) return true;
    if (is_forced(rule, v)) return true;
    if (error > threshold_without_places(rule, v, rank)) return true;
    const region_box reach = reach_of(v, rank);
    region_search s;
    region_search_begin(&s, rule->nodes, rule->place_count, &reach);
    for (size_t i; region_search_next(&s, &i);)
        if (error > code_at(rule, &rule->places[i], rank) && region_touches(rule->places[i].region, &reach))
            return true;
    return false;
}

/* ------------------------------------------------------------------------------------------------ blocks -- */

const rqt_lattice *rule_lattice(const rqt_rule *rule) {
    return &rule->lattice;
}

const rqt_field *rule_field(const rqt_rule *rule) {
    return rule->field;
}

const int32_t *rule_thresholds(const rqt_rule *rule) {
    return rule->base;
}

/* A place or square that holds the whole cell meets every box in it. */
rule_range rule_range_below(const rqt_rule *rule, rqt_vertex centre) {
    const int rank = rqt_vertex_rank(&rule->lattice, centre);
    const int32_t half = 1 << rank / 2;
    const region_box reach = reach_of(centre, rank);
    rule_range range = {
        .least = rqt_rule_threshold(rule, centre), .most = rule->base[0], .forced = is_forced(rule, centre)};
    if (rule->field) {
        const rqt_code square =
            field_holding(rule->field, centre.x - half, centre.y - half, centre.x + half, centre.y + half);
        range.most = rule_field_threshold(rule, square, 0);
    }
    region_search s;
    region_search_begin(&s, rule->nodes, rule->place_count, &reach);
    for (size_t i; region_search_next(&s, &i);) {
        const int32_t code = code_at(rule, &rule->places[i], 0);
        range.places = true;
        if (code < range.most && region_area_relation(rule->places[i].region, centre.x - half, centre.y - half,
                                                      centre.x + half, centre.y + half) == RQT_INSIDE)
            range.most = code;
    }
    return range;
}

static bool is_answered(const rqt_rule *rule, int32_t x, int32_t y, int32_t side, rqt_code em) {
    return !rqt_rule_selects(rule, (rqt_vertex){x + side / 2, y + side / 2}, em, false);
}

bool rqt_rule_is_answered(const rqt_rule *rule, const rqt_block_place *place, const rqt_summary *summary,
                          rqt_outline outline) {
    const rqt_interval *interval = outline == RQT_OUTLINE_EXACT ? &summary->exact : &summary->tol;
    return place->stride == 1 || is_answered(rule, place->x, place->y, place->side, interval->em);
}

bool rqt_rule_is_answered_above(const rqt_rule *rule, const rqt_block_place *place, const rqt_summary *summary,
                                rqt_outline outline) {
    const rqt_interval *interval = outline == RQT_OUTLINE_EXACT ? &summary->exact : &summary->tol;
    const int32_t side = 2 * place->side;
    return place->level > 0 && is_answered(rule, place->x & -side, place->y & -side, side, interval->em_parent);
}
