/* fuzz_rule.c - rules: an eps of its own for places and for the squares of a field, eps lowered by rank, forced
 * vertices and borders; and what becomes of a patch: clipped, as heights along lines, and cells in which it has
 * triangles. Whichever way vertices
 * are selected the mesh is one; what a rule says of a vertex is what it says of its parts. */
#include "fuzz_terrain.h"

enum { PLACES = 4, POINTS = 12, SQUARES = 400, CELLS = 7, PARTS = 8 };

typedef struct ruling {
    rqt_rule *rule;
    rqt_region *regions[PLACES];
    rqt_rule_place places[PLACES];
    size_t count;
    double eps;
    rqt_field *field;
} ruling;

static bool at_once(void *context) {
    (void)context;
    return true;
}

static double take_tolerance(input *in) {
    return take_between(in, 0, 3) ? take_between(in, 0, 4000) / 16.0 : fabs(take_double(in));
}

static void drop(ruling *r) {
    rqt_rule_free(r->rule);
    rqt_field_free(r->field);
    for (size_t i = 0; i < PLACES; i++) rqt_region_free(r->regions[i]);
}

/* What the header refuses is refused, and changes nothing. */
static void refuse(input *in, ruling *r, const rqt_lattice *l) {
    const double bad = take_between(in, 0, 1) ? NAN : -1 - fabs(take_between(in, 0, 9) / 8.0);
    double lowering[RQT_RANKS] = {0};
    lowering[take_between(in, 0, RQT_RANKS - 2)] = take_between(in, 1, 9);
    HOLD(rqt_rule_set_eps(r->rule, bad) == RQT_INVALID, "eps %g", bad);
    HOLD(rqt_rule_set_lowering(r->rule, lowering) == RQT_INVALID, "a lowering that falls");
    HOLD(rqt_rule_force(r->rule, (rqt_vertex){-1, 0}) == RQT_INVALID &&
             rqt_rule_force(r->rule, (rqt_vertex){0, (1 << l->K) + 1}) == RQT_INVALID,
         "a vertex outside the lattice");
}

/* ------------------------------------------------------------------------------------------------ fields */
typedef struct deciding {
    input *in;
    const rqt_lattice *lattice;
    int asked;
    bool wrong; /* an answer that is none has been given */
} deciding;

static rqt_field_step decide(void *context, rqt_square s, double *eps) {
    deciding *d = context;
    HOLD(s.side >= 1 && (s.side & (s.side - 1)) == 0 && s.x % s.side == 0 && s.y % s.side == 0 && s.x >= 0 &&
             s.y >= 0 && (s.x == 0 || s.x < d->lattice->width - 1) && (s.y == 0 || s.y < d->lattice->height - 1),
         "(%d,%d), side %d, is no square of the raster", s.x, s.y, s.side);
    HOLD(!d->wrong, "asked after a wrong answer");
    if (d->asked++ < SQUARES && take_between(d->in, 0, 2) > 0) {
        d->wrong = s.side == 1;
        if (!d->wrong || take_between(d->in, 0, 30) == 0) return RQT_FIELD_SPLIT;
        d->wrong = false;
    }
    *eps = take_between(d->in, 0, 6) ? take_tolerance(d->in) : INFINITY;
    d->wrong = isnan(*eps);
    return RQT_FIELD_LEAF;
}

/* Squares tile what there is, in Morton order; the least of a box is that of its squares, one by one. */
static void look_at_field(input *in, const rqt_field *f, const rqt_lattice *l) {
    const int32_t most = (1 << l->K) + 2, x0 = take_between(in, -3, most), y0 = take_between(in, -3, most),
                  x1 = x0 + take_between(in, 0, most), y1 = y0 + take_between(in, 0, most);
    double least = INFINITY, eps = 0;
    int64_t covered = 0;
    rqt_square s;
    const size_t count = rqt_field_count(f);
    for (size_t n = 0; n < count; n++) {
        HOLD(rqt_field_square(f, n, &s, &eps) && eps >= 0, "square %zu of %zu", n, count);
        const rqt_vertex end = rqt_vertex_clamp(l, (rqt_vertex){s.x + s.side, s.y + s.side});
        covered += (int64_t)(end.x - s.x) * (end.y - s.y);
        if (x0 < x1 && y0 < y1 && s.x < x1 && s.x + s.side > x0 && s.y < y1 && s.y + s.side > y0)
            least = fmin(least, eps);
    }
    HOLD(!rqt_field_square(f, count, &s, &eps), "there is no square %zu", count);
    HOLD(covered == (int64_t)(l->width - 1) * (l->height - 1), "squares cover %lld samples", (long long)covered);
    HOLD(rqt_field_least(f, x0, y0, x1, y1) == least, "the least is %g, not %g", rqt_field_least(f, x0, y0, x1, y1),
         least);
}

static bool give_field(input *in, ruling *r, const rqt_lattice *l, const rqt_allocator *a, fuzz_heap *h) {
    deciding d = {in, l, 0, false};
    const rqt_status status = rqt_field_create(l, a, decide, &d, &r->field);
    if (d.wrong) {
        HOLD((status == RQT_INVALID || status == RQT_NO_MEMORY) && !r->field, "status %d", (int)status);
        return true;
    }
    if (!went_well(status, h)) return false;
    look_at_field(in, r->field, l);
    HOLD(rqt_rule_set_field(r->rule, r->field) == RQT_OK, "field");
    return true;
}

/* ------------------------------------------------------------------------------------------------- rules */
static bool make_rule(input *in, const fuzz_terrain *t, const rqt_region *region, const rqt_allocator *a,
                      fuzz_heap *h, ruling *r) {
    const rqt_lattice *l = &t->grid.lattice;
    const double quantum_error = take_between(in, 0, 2) ? 0 : take_between(in, 0, 16) / 64.0;
    *r = (ruling){.eps = take_tolerance(in)};
    if (isnan(r->eps)) r->eps = 0;
    if (!went_well(rqt_rule_create(l, quantum_error, a, &r->rule), h)) return false;
    HOLD(rqt_rule_set_eps(r->rule, r->eps) == RQT_OK, "eps %g", r->eps);
    if (take_between(in, 0, 1)) {
        double lowering[RQT_RANKS] = {0};
        for (int rank = 1; rank < RQT_RANKS; rank++)
            lowering[rank] = lowering[rank - 1] + (take_between(in, 0, 1) ? 0 : take_between(in, 0, 64) / 8.0);
        HOLD(rqt_rule_set_lowering(r->rule, lowering) == RQT_OK, "lowering");
    }
    for (int n = take_between(in, 0, PLACES); n > 0; n--) {
        double eps = take_tolerance(in);
        rqt_region *place = take_region(in, l, a);
        if (!place) return false;
        if (isnan(eps)) eps = 1;
        r->regions[r->count] = place;
        r->places[r->count++] = (rqt_rule_place){place, eps};
    }
    if (!went_well(rqt_rule_set_places(r->rule, r->places, r->count), h)) return false;
    if (take_between(in, 0, 1) && !give_field(in, r, l, a, h)) return false;
    if (take_between(in, 0, 3) == 0) refuse(in, r, l);
    for (int n = take_between(in, 0, 3); n > 0; n--) {
        const rqt_vertex v = {take_between(in, 0, 1 << l->K), take_between(in, 0, 1 << l->K)};
        if (!went_well(rqt_rule_force(r->rule, v), h)) return false;
        HOLD(rqt_rule_selects(r->rule, v, 0, false) || rqt_vertex_level(l, v) == 0, "(%d,%d) was forced", v.x, v.y);
    }
    return take_between(in, 0, 2) || went_well(rqt_rule_force_border(r->rule, region, never, NULL), h);
}

/* Of any vertex: selected by threshold or by force, in which case whatever its error; and then so are its parents.
 */
static void look(input *in, const ruling *r, const rqt_lattice *l, const rqt_errors *saturated) {
    for (int n = 0; n < 24; n++) {
        const rqt_vertex v = {take_between(in, 0, 1 << l->K), take_between(in, 0, 1 << l->K)};
        bool outline;
        const rqt_code error = rqt_errors_at(saturated, v, &outline);
        const int32_t threshold = rqt_rule_threshold(r->rule, v);
        HOLD(threshold >= -1 && threshold <= RQT_CODE_LARGEST, "threshold %d", threshold);
        const bool forced = rqt_rule_selects(r->rule, v, 0, false) && threshold >= 0,
                   selected = rqt_rule_selects(r->rule, v, error, false);
        HOLD(selected == (forced || error > threshold), "(%d,%d), error %u, threshold %d", v.x, v.y, error,
             threshold);
        HOLD(rqt_rule_selects(r->rule, v, error, true), "an outline bit selects");
        rqt_vertex parent[2];
        const int parents = rqt_vertex_parents(l, v, parent);
        for (int p = 0; p < parents; p++) {
            HOLD(rqt_rule_threshold(r->rule, parent[p]) <= threshold, "a threshold rises to the parent of (%d,%d)",
                 v.x, v.y);
            HOLD(!selected ||
                     rqt_rule_selects(r->rule, parent[p], rqt_errors_at(saturated, parent[p], &outline), false),
                 "(%d,%d) without its parent (%d,%d)", v.x, v.y, parent[p].x, parent[p].y);
        }
    }
}

/* The blocks that answer a rule, and that they tile the raster. */
static void find_answers(const fuzz_terrain *t, const pyramid *p, const ruling *r, rqt_query *query) {
    const rqt_lattice *l = &query->lattice;
    int64_t covered = 0;
    int32_t x0, y0, x1, y1;
    const bool meets = rqt_region_box(query->region, &x0, &y0, &x1, &y1);
    query->answer_count = 0;
    for (size_t i = 0; i < p->count; i++) {
        rqt_block_place at;
        const rqt_summary *summary = &p->summary[i];
        HOLD(rqt_block_locate(l, t->k, p->number[i], &at) == RQT_OK, "block %llu",
             (unsigned long long)p->number[i]);
        const bool answered = rqt_rule_is_answered(r->rule, &at, summary, query->outline),
                   above = rqt_rule_is_answered_above(r->rule, &at, summary, query->outline);
        HOLD(answered || !above, "block %llu is answered above and not here", (unsigned long long)p->number[i]);
        if (!answered || above) continue;
        const rqt_vertex end = rqt_vertex_clamp(l, (rqt_vertex){at.x + at.side, at.y + at.side});
        covered += (int64_t)(end.x - at.x) * (end.y - at.y);
        if (meets && end.x >= x0 && at.x <= x1 && end.y >= y0 && at.y <= y1)
            query->answers[query->answer_count++] = (rqt_answer){p->number[i], *summary};
    }
    HOLD(covered == (int64_t)(l->width - 1) * (l->height - 1), "the answers cover %lld samples",
         (long long)covered);
}

/* ---------------------------------------------------------------------------------------------------- cuts */
typedef struct edge {
    uint32_t from, to;
} edge;

static int by_ends(const void *a, const void *b) {
    const edge *one = a, *other = b;
    if (one->from != other->from) return one->from < other->from ? -1 : 1;
    return one->to < other->to ? -1 : one->to > other->to;
}

static void heights_of(const rqt_patch *patch, double *low, double *high) {
    *low = INFINITY, *high = -INFINITY;
    for (size_t i = 0; i < patch->vertex_count; i++) {
        *low = fmin(*low, patch->vertices[i].q);
        *high = fmax(*high, patch->vertices[i].q);
    }
    const double slack = 1e-9 * (1 + *high - *low);
    *low -= slack, *high += slack;
}

/* Does the place lie in a triangle of the patch, with that triangle's height? Doubles are near enough. */
static bool is_on_mesh(const rqt_patch *patch, double col, double row, double q) {
    for (size_t i = 0; i < patch->triangle_count; i++) {
        const rqt_patch_vertex *v[3];
        for (int c = 0; c < 3; c++) v[c] = &patch->vertices[patch->triangles[3 * i + (size_t)c]];
        double share[3], whole = 0, height = 0, steep = 1;
        for (int c = 0; c < 3; c++) {
            const rqt_patch_vertex *a = v[(c + 1) % 3], *b = v[(c + 2) % 3];
            share[c] = (a->col - col) * (b->row - row) - (a->row - row) * (b->col - col);
            whole += share[c];
        }
        for (int c = 0; c < 3; c++) {
            share[c] /= whole;
            height += share[c] * v[c]->q;
            steep = fmax(steep, fabs((double)v[c]->q));
        }
        /* a place of the grid may lie 2^-20 sample beside a crossing */
        if (share[0] > -1e-5 && share[1] > -1e-5 && share[2] > -1e-5 && fabs(height - q) <= 1e-5 * steep)
            return true;
    }
    return false;
}

static double area_of_patch(const rqt_patch *patch) {
    double area = 0;
    for (size_t i = 0; i < patch->triangle_count; i++) {
        const rqt_patch_vertex *v[3];
        for (int c = 0; c < 3; c++) v[c] = &patch->vertices[patch->triangles[3 * i + (size_t)c]];
        area += 0.5 * ((v[1]->col - v[0]->col) * (v[0]->row - v[2]->row) -
                       (v[0]->row - v[1]->row) * (v[2]->col - v[0]->col));
    }
    return area;
}

/* Whole multiples of the grid's step, so that areas are exact. */
static int64_t steps_of(double place, int K) {
    const double steps = ldexp(place, 52 - K);
    HOLD(fabs(steps) < 0x1p60 && steps == floor(steps), "%.17g is no place of the grid", place);
    return (int64_t)steps;
}

static void clip(const rqt_patch *patch, const rqt_region *region, const rqt_lattice *l, const rqt_allocator *a,
                 fuzz_heap *h) {
    rqt_cut cut = {0};
    double low, high, area = 0;
    heights_of(patch, &low, &high);
    if (went_well(rqt_cut_make(patch, region, l, a, never, NULL, &cut), h)) {
        for (size_t i = 0; i < cut.vertex_count; i++) {
            const rqt_cut_vertex *v = &cut.vertices[i];
            HOLD(v->col >= 0 && v->col <= l->width - 1 && v->row >= 0 && v->row <= l->height - 1, "(%g,%g)", v->col,
                 v->row);
            HOLD(v->q >= low && v->q <= high, "height %g of %g .. %g", v->q, low, high);
            HOLD(is_on_mesh(patch, v->col, v->row, v->q), "(%g,%g,%g) is not on the mesh", v->col, v->row, v->q);
        }
        edge *edges = calloc(3 * cut.triangle_count + 1, sizeof *edges);
        if (!edges) abort();
        for (size_t i = 0; i < cut.triangle_count; i++) {
            int64_t x[3], y[3];
            for (size_t c = 0; c < 3; c++) {
                const uint32_t index = cut.triangles[3 * i + c];
                HOLD(index < cut.vertex_count, "triangle %zu", i);
                x[c] = steps_of(cut.vertices[index].col, l->K);
                y[c] = steps_of(cut.vertices[index].row, l->K);
                edges[3 * i + c] = (edge){index, cut.triangles[3 * i + (c + 1) % 3]};
            }
            const __int128 twice =
                (__int128)(x[1] - x[0]) * (y[0] - y[2]) - (__int128)(y[0] - y[1]) * (x[2] - x[0]);
            HOLD(twice > 0, "triangle %zu has no area, or turns clockwise", i);
            area += ldexp((double)twice, 2 * l->K - 105);
        }
        qsort(edges, 3 * cut.triangle_count, sizeof *edges, by_ends);
        for (size_t i = 1; i < 3 * cut.triangle_count; i++)
            HOLD(by_ends(&edges[i - 1], &edges[i]) != 0, "two triangles on one side of an edge");
        free(edges);
        const double whole = area_of_patch(patch);
        HOLD(area <= whole + 1e-6, "area %g of %g", area, whole);
        if (rqt_region_is_all(region))
            HOLD(cut.triangle_count == patch->triangle_count, "%zu triangles of %zu", cut.triangle_count,
                 patch->triangle_count);
        rqt_cut_free(&cut);
    }
    if (patch->triangle_count) {
        const rqt_status status = rqt_cut_make(patch, region, l, a, at_once, NULL, &cut);
        HOLD(status == RQT_OK || ((status == RQT_INTERRUPTED || status == RQT_NO_MEMORY) && !cut.vertices),
             "status %d", (int)status);
        rqt_cut_free(&cut);
    }
}

static void profile(input *in, const rqt_patch *patch, const rqt_lattice *l, const rqt_allocator *a, fuzz_heap *h) {
    double xy[2 * POINTS];
    uint8_t ends[POINTS], own[POINTS];
    const bool wild = take_between(in, 0, 3) == 0;
    rqt_profile_line line = {.xy = xy,
                             .ends = ends,
                             .own = own,
                             .points = (size_t)take_between(in, 1, POINTS),
                             .placement = {0, 0, 1, 1},
                             .period = take_between(in, 0, 3) ? 0 : take_between(in, 8, 400) / 8.0};
    if (take_between(in, 0, 3) == 0) line.placement = (rqt_placement){take_between(in, -99, 99), 7, 0.125, -0.5};
    for (size_t i = 0; i < line.points; i++) {
        for (size_t c = 0; c < 2; c++) {
            double at = wild ? take_double(in) : take_between(in, -16, 200) / (take_between(in, 0, 1) ? 8.0 : 7.0);
            if (!isfinite(at)) at = 0;
            xy[2 * i + c] = wild ? at
                            : c  ? line.placement.y0 + at * line.placement.dy
                                 : line.placement.x0 + at * line.placement.dx;
        }
        ends[i] = i + 1 == line.points || take_between(in, 0, 4) == 0;
        own[i] = take_between(in, 0, 4) != 0;
    }
    rqt_profile_row *rows = NULL;
    size_t count = 0;
    double low, high;
    heights_of(patch, &low, &high);
    if (!went_well(rqt_profile_build(patch, l, &line, a, &rows, &count), h)) return;
    for (size_t i = 0; i < count; i++) {
        const rqt_profile_row *r = &rows[i];
        HOLD(r->point < line.points && r->t >= 0 && r->t <= 1 && (!r->at_point || r->t == 0 || r->t == 1),
             "row %zu", i);
        HOLD(r->col >= 0 && r->col <= l->width - 1 && r->row >= 0 && r->row <= l->height - 1, "(%g,%g)", r->col,
             r->row);
        HOLD(r->q >= low && r->q <= high, "height %g of %g .. %g", r->q, low, high);
        HOLD(is_on_mesh(patch, r->col, r->row, r->q), "(%g,%g,%g) is not on the mesh", r->col, r->row, r->q);
        HOLD(line.period > 0 || r->turn == 0, "turn %d", r->turn);
        if (i > 0)
            HOLD(rows[i - 1].point < r->point || (rows[i - 1].point == r->point && rows[i - 1].t <= r->t),
                 "row %zu is not in the order of the line", i);
    }
    (void)a->resize(a->context, rows, 0);
}

/* --------------------------------------------------------------------------------------------------- cells */

/* Lines in parts of a sample; between any two there is some of the raster. How many cells; 0: there are none. */
static int32_t take_lines(input *in, int32_t samples, int64_t lines[CELLS + 1]) {
    const int64_t end = PARTS * ((int64_t)samples - 1);
    const int32_t most = take_between(in, 1, CELLS), size = (int32_t)(end / most) + 2;
    int32_t count = 0;
    lines[0] = take_between(in, -PARTS, 2 * PARTS);
    if (lines[0] >= end) return 0;
    while (count < most && (count == 0 || lines[count] < end)) {
        const int64_t from = lines[count] > 0 ? lines[count] : 0;
        lines[++count] = from + take_between(in, 1, size);
    }
    return count;
}

/* Have a triangle and a box inner points in common? Iff no side of one of them parts them. */
static bool meets_inside(const rqt_patch *patch, size_t triangle, const int64_t box[4]) {
    int64_t x[3], y[3];
    for (size_t c = 0; c < 3; c++) {
        const rqt_patch_vertex *v = &patch->vertices[patch->triangles[3 * triangle + c]];
        x[c] = PARTS * (int64_t)v->col, y[c] = PARTS * (int64_t)v->row;
    }
    if ((x[0] <= box[0] && x[1] <= box[0] && x[2] <= box[0]) ||
        (x[0] >= box[1] && x[1] >= box[1] && x[2] >= box[1]) ||
        (y[0] <= box[2] && y[1] <= box[2] && y[2] <= box[2]) ||
        (y[0] >= box[3] && y[1] >= box[3] && y[2] >= box[3]))
        return false;
    for (int c = 0; c < 3; c++) {
        const int64_t ex = x[(c + 1) % 3] - x[c], ey = y[(c + 1) % 3] - y[c];
        const int64_t third = ex * (y[(c + 2) % 3] - y[c]) - ey * (x[(c + 2) % 3] - x[c]);
        bool is_parted = true;
        for (int corner = 0; corner < 4; corner++) {
            const int64_t side = ex * (box[2 + (corner >> 1)] - y[c]) - ey * (box[corner & 1] - x[c]);
            is_parted &= third > 0 ? side <= 0 : side >= 0;
        }
        if (is_parted) return false;
    }
    return true;
}

/* A cell is marked iff the mesh has a triangle in it, as far as the patch is the whole mesh. */
static void mark(input *in, const fuzz_terrain *t, pyramid *p, const rqt_query *query, const rqt_patch *patch) {
    int64_t lines[2][CELLS + 1], places[2][CELLS + 1];
    uint8_t marks[CELLS * CELLS] = {0};
    const int32_t columns = take_lines(in, query->lattice.width, lines[0]),
                  rows = take_lines(in, query->lattice.height, lines[1]);
    rqt_cells cells = {places[0], places[1], columns, rows, marks};
    if (columns == 0 || rows == 0) return;
    for (int axis = 0; axis < 2; axis++)
        for (int i = 0; i <= (axis ? rows : columns); i++) places[axis][i] = lines[axis][i] * (1 << 20) / PARTS;
    for (size_t i = 0; i < query->answer_count; i++) {
        const rqt_answer *answer = &query->answers[i];
        rqt_block_place at;
        (void)rqt_block_locate(&query->lattice, t->k, answer->number, &at);
        const rqt_block *block = NULL;
        if (rqt_query_selects_inside(query, answer)) block = pyramid_read(p, answer->number);
        if (rqt_cells_lack(&cells, &query->lattice, &at)) rqt_query_mark(query, answer, block, &cells);
    }
    for (int32_t y = 0; y < rows; y++)
        for (int32_t x = 0; x < columns; x++) {
            const int64_t box[4] = {lines[0][x], lines[0][x + 1], lines[1][y], lines[1][y + 1]};
            bool is_met = false;
            for (size_t i = 0; i < patch->triangle_count && !is_met; i++) is_met = meets_inside(patch, i, box);
            const bool is_marked = marks[y * columns + x];
            HOLD(is_marked || !is_met, "cell (%d,%d) has a triangle and no mark", x, y);
            HOLD(is_met || !is_marked || !rqt_region_is_all(query->region),
                 "cell (%d,%d) has a mark and no triangle", x, y);
        }
    for (size_t i = 0; i < query->answer_count; i++) {
        rqt_block_place at;
        (void)rqt_block_locate(&query->lattice, t->k, query->answers[i].number, &at);
        rqt_cells_fill(&cells, &query->lattice, &at);
        HOLD(!rqt_cells_lack(&cells, &query->lattice, &at), "cells of a block lack marks when they have them");
    }
}

static void ask(input *in, const fuzz_terrain *t, pyramid *p, const ruling *r, const rqt_region *region,
                const rqt_allocator *a, fuzz_heap *h) {
    const rqt_lattice *l = &t->grid.lattice;
    const rqt_outline outline = take_between(in, 0, 1) ? RQT_OUTLINE_TOL : RQT_OUTLINE_EXACT;
    size_t triangles = 0;
    bool ok = true;
    for (int select = 0; select < 3 && ok; select++) {
        rqt_query query = pyramid_query(t, p, region, rqt_code_floor(r->eps), outline);
        rqt_patch patch = {0};
        query.rule = r->rule;
        query.select = (rqt_select)select;
        find_answers(t, p, r, &query);
        for (size_t i = 0; i < query.answer_count; i++) {
            const rqt_summary *s = &query.answers[i].summary;
            rqt_block_place at;
            (void)rqt_block_locate(l, t->k, query.answers[i].number, &at);
            const rqt_vertex centre = {at.x + at.side / 2, at.y + at.side / 2};
            HOLD(at.stride == at.side || rqt_query_selects_inside(&query, &query.answers[i]) ||
                     !rqt_query_selects(&query, centre, s->center_error, s->center_flags),
                 "its centre is selected");
            (void)rqt_query_needs_block(&query, &query.answers[i]);
        }
        ok = went_well(rqt_query_run(&query, a, &patch), h);
        if (ok && select == 0) triangles = patch.triangle_count;
        if (ok) HOLD(patch.triangle_count == triangles, "%zu triangles, %zu", triangles, patch.triangle_count);
        if (ok && select == 0) {
            clip(&patch, region, l, a, h);
            profile(in, &patch, l, a, h);
            if (take_between(in, 0, 1)) mark(in, t, p, &query, &patch);
        }
        rqt_patch_free(&patch);
        free(query.answers);
    }
}

const long fuzz_runs = 400;

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    input in = {data, size};
    fuzz_heap heap;
    static fuzz_terrain t;
    const rqt_allocator a = fuzz_allocator(&heap, &in);
    rqt_errors saturated = {0};
    pyramid p = {0};
    take_terrain(&in, &t);
    if (went_well(rqt_errors_compute(&t.grid, &t.unit, &t.cost, &a, NULL, NULL, &saturated), &heap)) {
        rqt_errors_saturate(&saturated);
        rqt_region *region = take_region(&in, &t.grid.lattice, &a);
        if (region && take_between(&in, 0, 2) == 0) rqt_region_grow_rectangle(region);
        ruling rule = {0};
        if (region && went_well(pyramid_make(&t, &saturated, &a, &p), &heap) &&
            make_rule(&in, &t, region, &a, &heap, &rule)) {
            look(&in, &rule, &t.grid.lattice, &saturated);
            ask(&in, &t, &p, &rule, region, &a, &heap);
            const rqt_status status = rqt_rule_force_border(rule.rule, region, at_once, NULL);
            HOLD(status == RQT_OK || status == RQT_INTERRUPTED || (status == RQT_NO_MEMORY && heap.refuse),
                 "status %d", (int)status);
        }
        drop(&rule);
        rqt_region_free(region);
        pyramid_free(&p, &a);
    }
    rqt_errors_free(&saturated, &a);
    HOLD(heap.live == 0, "%zu bytes leaked", heap.live);
    return 0;
}
