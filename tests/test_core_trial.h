/* test_core_trial.h - a terrain with a rule: the definition of what it selects, and all that must hold of what the
 * core makes of it.
 *
 * The oracle gives every vertex of the whole lattice its threshold by asking every place and every square of the
 * field, forces and closes by walking up to parents until nothing changes, finds mixed triangles by counting unit
 * half cells, and takes the leaves of what is then selected. The core has to give the same triangles from blocks of
 * every size, however it selects. The mesh itself is then looked at by the verifier, which knows neither, and
 * sample by sample. */
#ifndef TEST_CORE_TRIAL_H
#define TEST_CORE_TRIAL_H

#include "test_core_shapes.h"

#include "verify.h"

enum { MOST_PLACES = 5, MOST_FORCED = 3, MOST_SQUARES = 6000 };

/* Of a field: in Morton order. */
typedef struct square {
    int x, y, side;
    double eps, used; /* as told; eps_of_square, when the trial is complete */
} square;

typedef struct trial {
    model m;
    shape place[MOST_PLACES];
    double place_eps[MOST_PLACES];
    int places;
    square *square; /* NULL: no field */
    int squares;
    double factor; /* of the field; 0 counts as 1 */
    double eps, quantum_error, lowering[RQT_RANKS];
    oracle_point forced[MOST_FORCED];
    int forced_count;
    int has_border;
    shape border; /* as given; grown in `grown` when it is a rectangle */
    shape grown;
    int exact;
    unsigned char *set;
} trial;

/* -------------------------------------------------------------------------------------- definitions -- */

static inline int log2_of(int power) {
    int n = 0;
    while (1 << n < power) n++;
    return n;
}

/* The largest power of two that divides both coordinates; that of the side for the corners of the root. */
static inline int step_of(const oracle *o, int x, int y) {
    int q = 1;
    while (q < o->side - 1 && x % (2 * q) == 0 && y % (2 * q) == 0) q *= 2;
    return q;
}

static inline int is_centre(int x, int y, int q) {
    return x / q % 2 == 1 && y / q % 2 == 1;
}

/* eps less what is taken from it, as a code; -1 below 0. */
static inline int code_of_eps(const trial *t, double eps, int rank) {
    if (isinf(eps)) return ORACLE_LARGEST;
    mpq_t value, part;
    mpq_inits(value, part, NULL);
    mpq_set_d(value, eps);
    mpq_set_d(part, t->lowering[rank]);
    mpq_sub(value, value, part);
    int code = -1;
    if (mpq_sgn(value) >= 0) {
        mpq_set_d(part, t->quantum_error);
        mpq_sub(value, value, part);
        if (mpq_sgn(value) < 0) mpq_set_ui(value, 0, 1);
        code = (int)oracle_code_down(value);
    }
    mpq_clears(value, part, NULL);
    return code;
}

/* The eps of a square as the field uses it: the largest code below the float below it, scaled. */
static inline double eps_of_square(const trial *t, const square *s) {
    if (isinf(s->eps)) return INFINITY;
    mpq_t exact, factor;
    float f = (float)s->eps;
    if (f > s->eps) f = nextafterf(f, 0);
    mpq_inits(exact, factor, NULL);
    mpq_set_d(exact, f);
    mpq_set_d(factor, t->factor > 0 ? t->factor : 1);
    mpq_mul(exact, exact, factor);
    oracle_code_value(exact, oracle_code_down(exact));
    const double eps = mpq_get_d(exact);
    mpq_clears(exact, factor, NULL);
    return eps;
}

static inline int threshold_of(const trial *t, int x, int y) {
    const int q = step_of(&t->m.o, x, y), centre = is_centre(x, y, q), half = centre ? 3 * q : 2 * q;
    double eps = t->eps;
    for (int n = 0; n < t->places; n++)
        if (t->place_eps[n] < eps && shape_touches(&t->place[n], x - half, y - half, x + half, y + half))
            eps = t->place_eps[n];
    /* the closed square and the open box */
    for (const square *s = t->square; s < t->square + t->squares; s++)
        if (s->used < eps && s->x < x + half && s->x + s->side > x - half && s->y < y + half &&
            s->y + s->side > y - half)
            eps = s->used;
    return code_of_eps(t, eps, 2 * log2_of(q) + centre);
}

enum { NOTHING = 1, ALL = 2 };

/* Which unit half cells of a triangle are in R'? NOTHING | ALL: some are, some are not. Forces the split vertices
 * of mixed ones. */
static inline int force_mixed(trial *t, const oracle_triangle *at) {
    const oracle *o = &t->m.o;
    const shape *s = &t->grown;
    oracle_triangle child[2];
    oracle_point p[3];
    int straddles = 0, x0 = INT32_MAX, y0 = INT32_MAX, x1 = 0, y1 = 0;
    for (int c = 0; c < 3; c++) {
        p[c] = oracle_clamp(o, at->corner[c]);
        straddles |= p[c].x != at->corner[c].x || p[c].y != at->corner[c].y;
        if (p[c].x < x0) x0 = p[c].x;
        if (p[c].y < y0) y0 = p[c].y;
        if (p[c].x > x1) x1 = p[c].x;
        if (p[c].y > y1) y1 = p[c].y;
    }
    if (oracle_area(o, at) == 0) return 0;
    if (!oracle_children(at, child)) return shape_meets_area(s, p) ? ALL : NOTHING;
    const int inside = force_mixed(t, &child[0]) | force_mixed(t, &child[1]);
    const int mixed = straddles ? !shape_holds_box(s, x0, y0, x1, y1) && shape_meets_box(s, x0, y0, x1, y1)
                                : inside == (NOTHING | ALL);
    if (mixed)
        t->set[(at->corner[1].y + at->corner[2].y) / 2 * o->side + (at->corner[1].x + at->corner[2].x) / 2] = 1;
    return inside;
}

static inline void select_by_definition(trial *t) {
    const oracle *o = &t->m.o;
    const size_t n = (size_t)(o->side * o->side);
    unsigned char *forced = oracle_set_create(o), *open = oracle_set_create(o);
    t->set = forced;
    for (int i = 0; i < t->forced_count; i++) forced[t->forced[i].y * o->side + t->forced[i].x] = 1;
    if (t->has_border) {
        const oracle_triangle half[2] = {oracle_root_half(o, 0), oracle_root_half(o, 1)};
        for (int h = 0; h < 2; h++) (void)force_mixed(t, &half[h]);
    }
    oracle_close(o, forced);
    for (int y = 0; y < o->side; y++)
        for (int x = 0; x < o->side; x++) {
            const oracle_node *v = oracle_at(o, x, y);
            open[y * o->side + x] = (int)v->code > threshold_of(t, x, y) || (t->exact && v->outline);
        }
    t->set = oracle_set_create(o);
    memcpy(t->set, open, n);
    oracle_close(o, t->set);
    /* the theory: thresholds do not rise from a vertex to what it depends on */
    CHECK(memcmp(t->set, open, n) == 0, "what thresholds select is not closed");
    for (size_t i = 0; i < n; i++) t->set[i] |= forced[i];
    free(forced);
    free(open);
}

/* ---------------------------------------------------------------------------------------- the core's -- */

typedef struct core_rule {
    rqt_rule *rule;
    rqt_rule_place place[MOST_PLACES];
    rqt_region *region[MOST_PLACES];
    rqt_region *border;
    int places;
    rqt_field *field;
} core_rule;

/* Says what the trial's squares are; they are asked for in their order, and no others. */
typedef struct deciding {
    const trial *t;
    int next, asked;
} deciding;

static inline rqt_field_step decide_square(void *context, rqt_square s, double *eps) {
    deciding *d = context;
    const trial *t = d->t;
    CHECK(d->next < t->squares, "square (%d,%d), side %d, is asked for when all are made", s.x, s.y, s.side);
    const square *want = &t->square[d->next];
    CHECK(want->x >= s.x && want->x < s.x + s.side && want->y >= s.y && want->y < s.y + s.side,
          "square (%d,%d), side %d, is asked for and (%d,%d) is next", s.x, s.y, s.side, want->x, want->y);
    d->asked++;
    if (want->side < s.side) return RQT_FIELD_SPLIT;
    *eps = want->eps;
    d->next++;
    return RQT_FIELD_LEAF;
}

static inline rqt_field *core_field_create(const trial *t) {
    rqt_field *field;
    deciding d = {t, 0, 0};
    assert_int_equal(rqt_field_create(&t->m.grid.lattice, &test_allocator, decide_square, &d, &field), RQT_OK);
    CHECK(d.next == t->squares, "%d squares are made of %d", d.next, t->squares);
    if (t->factor > 0) assert_int_equal(rqt_field_scale(field, t->factor), RQT_OK);
    return field;
}

static inline void core_rule_create(core_rule *c, const trial *t) {
    memset(c, 0, sizeof *c);
    const rqt_lattice *l = &t->m.grid.lattice;
    assert_int_equal(rqt_rule_create(l, t->quantum_error, &test_allocator, &c->rule), RQT_OK);
    assert_int_equal(rqt_rule_set_lowering(c->rule, t->lowering), RQT_OK);
    assert_int_equal(rqt_rule_set_eps(c->rule, t->eps), RQT_OK);
    c->places = t->places;
    for (int n = 0; n < t->places; n++) {
        c->region[n] = region_of_shape(&t->place[n], l);
        c->place[n] = (rqt_rule_place){c->region[n], t->place_eps[n]};
    }
    assert_int_equal(rqt_rule_set_places(c->rule, c->place, (size_t)t->places), RQT_OK);
    if (t->square) {
        c->field = core_field_create(t);
        assert_int_equal(rqt_rule_set_field(c->rule, c->field), RQT_OK);
    }
    for (int n = 0; n < t->forced_count; n++)
        assert_int_equal(rqt_rule_force(c->rule, (rqt_vertex){t->forced[n].x, t->forced[n].y}), RQT_OK);
    if (t->has_border) {
        c->border = region_of_shape(&t->border, l);
        rqt_region_grow_rectangle(c->border);
        assert_int_equal(rqt_rule_force_border(c->rule, c->border, NULL, NULL), RQT_OK);
    }
}

static inline void core_rule_free(core_rule *c) {
    rqt_rule_free(c->rule);
    for (int n = 0; n < c->places; n++) rqt_region_free(c->region[n]);
    rqt_region_free(c->border);
    rqt_field_free(c->field);
}

static inline void describe(const trial *t) {
    raster_print(&t->m.r);
    print_error("eps %.17g, quantum error %.17g, %s\n", t->eps, t->quantum_error, t->exact ? "exact" : "tol");
    for (int n = 0; n < t->places; n++) print_error("  eps %.17g in %s\n", t->place_eps[n], t->place[n].text);
    for (int n = 0; n < t->forced_count; n++) print_error("  forced %d,%d\n", t->forced[n].x, t->forced[n].y);
    for (int n = 0; n < RQT_RANKS; n++)
        if (t->lowering[n] > 0) print_error("  lowered by %.17g for rank %d\n", t->lowering[n], n);
    if (t->has_border) print_error("  border of %s\n", t->border.text);
    if (t->square) print_error("  field, times %g:\n", t->factor > 0 ? t->factor : 1);
    for (int n = 0; n < t->squares; n++)
        print_error("    eps %.17g in (%d,%d), side %d\n", t->square[n].eps, t->square[n].x, t->square[n].y,
                    t->square[n].side);
}

/* ---------------------------------------------------------------------------------- what must hold -- */

/* Each valid sample of a leaf is within the eps of every place that holds it, less what is taken from it. */
static inline void check_bound(const trial *t, const oracle_triangle *leaf) {
    const oracle *o = &t->m.o;
    oracle_point p[3];
    oracle_triangle child[2];
    int rank = -1, x0 = INT32_MAX, y0 = INT32_MAX, x1 = 0, y1 = 0;
    for (int c = 0; c < 3; c++) {
        p[c] = oracle_clamp(o, leaf->corner[c]);
        if (p[c].x < x0) x0 = p[c].x;
        if (p[c].y < y0) y0 = p[c].y;
        if (p[c].x > x1) x1 = p[c].x;
        if (p[c].y > y1) y1 = p[c].y;
    }
    if (oracle_children(leaf, child)) {
        const oracle_point m = child[0].corner[0];
        const int q = step_of(o, m.x, m.y);
        rank = 2 * log2_of(q) + is_centre(m.x, m.y, q);
    }
    const long area = (long)(p[1].x - p[0].x) * (p[2].y - p[0].y) - (long)(p[2].x - p[0].x) * (p[1].y - p[0].y);
    mpq_t deviation, allowed, part;
    mpq_inits(deviation, allowed, part, NULL);
    for (int y = y0; y <= y1; y++)
        for (int x = x0; x <= x1; x++) {
            long w[3], sum = 0;
            int outside = 0;
            for (int c = 0; c < 3; c++) {
                const oracle_point a = p[(c + 1) % 3], b = p[(c + 2) % 3];
                w[c] = (long)(a.x - x) * (b.y - y) - (long)(b.x - x) * (a.y - y);
                outside |= area > 0 ? w[c] < 0 : w[c] > 0;
            }
            const int at = y * t->m.r.width + x;
            if (outside || (t->m.r.valid && !t->m.r.valid[at])) continue;
            for (int c = 0; c < 3; c++) sum += w[c] * t->m.r.q[p[c].y * t->m.r.width + p[c].x];
            sum -= area * t->m.r.q[at];
            if (sum == 0) continue;
            double eps = t->eps;
            for (int n = 0; n < t->places; n++)
                if (t->place_eps[n] < eps && shape_touches(&t->place[n], x, y, x, y)) eps = t->place_eps[n];
            for (const square *s = t->square; s < t->square + t->squares; s++)
                if (s->used < eps && s->x <= x && x <= s->x + s->side && s->y <= y && y <= s->y + s->side)
                    eps = s->used;
            if (isinf(eps)) continue;
            mpq_set_si(deviation, labs(sum), (unsigned long)labs(area));
            mpq_canonicalize(deviation);
            mpq_mul(deviation, deviation, o->quantum);
            mpq_set_d(allowed, eps);
            mpq_set_d(part, rank < 0 ? 0 : t->lowering[rank]);
            mpq_sub(allowed, allowed, part);
            if (mpq_sgn(allowed) >= 0) {
                mpq_set_d(part, t->quantum_error);
                mpq_sub(allowed, allowed, part);
                if (mpq_sgn(allowed) < 0) mpq_set_ui(allowed, 0, 1);
            }
            if (mpq_cmp(deviation, allowed) > 0) describe(t);
            CHECK(mpq_cmp(deviation, allowed) <= 0, "sample (%d,%d) is %g off, allowed %g", x, y,
                  mpq_get_d(deviation), mpq_get_d(allowed));
        }
    mpq_clears(deviation, allowed, part, NULL);
}

/* No crack, no overlap; wanted_area: twice, in cells; -1: any. */
static inline void check_mesh(const trial *t, const rqt_patch *patch, long wanted_area, const char *what) {
    verify_triangle *triangles = calloc(patch->triangle_count + 1, sizeof *triangles);
    if (!triangles) abort();
    for (size_t n = 0; n < patch->triangle_count; n++)
        for (size_t c = 0; c < 3; c++) {
            const rqt_patch_vertex *v = &patch->vertices[patch->triangles[3 * n + c]];
            triangles[n].corner[c] = (verify_corner){v->col, v->row, v->q};
        }
    const verify_samples samples = {.width = t->m.r.width,
                                    .height = t->m.r.height,
                                    .q = t->m.r.q,
                                    .valid = t->m.r.valid,
                                    .quantum = 1,
                                    .cell_x = 1,
                                    .cell_y = 1};
    verify_report report;
    assert_int_equal(verify_mesh(&samples, triangles, patch->triangle_count, &report), VERIFY_OK);
    if (report.t_junctions || report.overlaps || report.void_touched) describe(t);
    CHECK(report.t_junctions == 0 && report.overlaps == 0 && report.void_touched == 0,
          "%s: %d T-junctions, %d overlaps, %d voids touched", what, (int)report.t_junctions, (int)report.overlaps,
          (int)report.void_touched);
    if (wanted_area >= 0 && (long)report.twice_area != wanted_area) describe(t);
    CHECK(wanted_area < 0 || (long)report.twice_area == wanted_area, "%s: twice the area is %ld, should be %ld",
          what, (long)report.twice_area, wanted_area);
    free(triangles);
}

/* Twice the area of R', where it is valid. */
static inline long area_of_border(const trial *t) {
    oracle_list units = {0};
    long area = 0;
    oracle_unit_triangles(&t->m.o, &units);
    for (size_t n = 0; n < units.count; n++) {
        int valid = 1;
        for (int c = 0; c < 3; c++) valid &= oracle_is_valid(&t->m.o, units.triangle[n].corner[c]);
        if (valid) area += shape_meets_area(&t->grown, units.triangle[n].corner);
    }
    oracle_list_free(&units);
    return area;
}

/* Over every place of the raster one block answers, whatever the rule. */
static inline void check_partition(const database *d, const rqt_rule *rule, rqt_outline outline) {
    const int width = d->lattice.width - 1, height = d->lattice.height - 1;
    long area = 0;
    for (size_t n = 0; n < d->count; n++) {
        const rqt_block_place *p = &d->block[n].place;
        if (!rqt_rule_is_answered(rule, p, &d->block[n].summary, outline) ||
            rqt_rule_is_answered_above(rule, p, &d->block[n].summary, outline))
            continue;
        area += (long)((p->x + p->side < width ? p->x + p->side : width) - p->x) *
                ((p->y + p->side < height ? p->y + p->side : height) - p->y);
    }
    CHECK(area == (long)width * height, "blocks that answer cover %ld cells of %ld", area, (long)width * height);
}

static inline wanted wanted_of_shape(const trial *t, const oracle_list *leaves, const shape *region) {
    oracle_list mine = {0};
    const window all = window_all();
    mine.triangle = calloc(leaves->count + 1, sizeof *mine.triangle);
    if (!mine.triangle) abort();
    for (size_t n = 0; n < leaves->count; n++)
        if (!region || shape_meets_leaf(region, &t->m.o, &leaves->triangle[n]))
            mine.triangle[mine.count++] = leaves->triangle[n];
    const wanted want = wanted_of(&t->m, &mine, &all);
    free(mine.triangle);
    return want;
}

/* The mesh of a wire equals that of the patch. */
static inline void check_wire(const trial *t, database *d, const rqt_region *region, rqt_outline outline,
                              const char *what) {
    rqt_answer *answers = calloc(d->count, sizeof *answers);
    rqt_block_number *numbers = calloc(d->count, sizeof *numbers);
    if (!answers || !numbers) abort();
    rqt_patch patch, decoded;
    rqt_query query = {.lattice = d->lattice,
                       .k = d->k,
                       .region = region,
                       .rule = d->rule,
                       .outline = outline,
                       .wants_leaves = true,
                       .answers = answers,
                       .answer_count = database_answers(d, region, 0, outline, answers),
                       .read_block = database_read,
                       .context = d};
    d->asking = &query;
    assert_int_equal(rqt_query_run(&query, &test_allocator, &patch), RQT_OK);
    for (size_t n = 0; n < query.answer_count; n++) numbers[n] = query.answers[n].number;
    const rqt_wire_header header = {
        .lattice = d->lattice, .k = d->k, .placement = AT_ORIGIN, .unit = t->m.r.unit, .eps = t->eps};
    uint8_t *bytes = malloc(rqt_wire_bound(patch.vertex_count, patch.triangle_count, query.answer_count));
    size_t size;
    if (!bytes) abort();
    CHECK(rqt_wire_encode(&header, numbers, query.answer_count, &patch, NULL, &test_allocator, bytes, &size) ==
              RQT_OK,
          "%s: the wire refuses it", what);
    rqt_wire_header told;
    rqt_message why;
    CHECK(rqt_wire_decode(bytes, size, true, &test_allocator, &told, &decoded, &why) == RQT_OK, "%s: %s", what,
          why.text);
    assert_int_equal(decoded.vertex_count, patch.vertex_count);
    assert_int_equal(decoded.triangle_count, patch.triangle_count);
    for (size_t v = 0; v < patch.vertex_count; v++)
        assert_true(decoded.vertices[v].col == patch.vertices[v].col &&
                    decoded.vertices[v].row == patch.vertices[v].row &&
                    decoded.vertices[v].q == patch.vertices[v].q);
    if (patch.triangle_count)
        assert_memory_equal(decoded.triangles, patch.triangles, 3 * patch.triangle_count * sizeof *patch.triangles);
    free(bytes);
    free(numbers);
    free(answers);
    rqt_patch_free(&patch);
    rqt_patch_free(&decoded);
}

/* The region of the query is the border's, or everything, or a shape beside. */
static inline void check_trial(trial *t) {
    core_rule c;
    oracle_list leaves = {0};
    select_by_definition(t);
    oracle_leaves(&t->m.o, t->set, &leaves);
    for (size_t n = 0; n < leaves.count; n++) check_bound(t, &leaves.triangle[n]);
    core_rule_create(&c, t);
    for (int y = 0; y < t->m.o.side; y++)
        for (int x = 0; x < t->m.o.side; x++) {
            const int q = step_of(&t->m.o, x, y), want = threshold_of(t, x, y);
            if (q == t->m.o.side - 1) continue;
            const int got = rqt_rule_threshold(c.rule, (rqt_vertex){x, y});
            if (got != want) describe(t);
            CHECK(got == want, "threshold of (%d,%d) is %d, should be %d", x, y, got, want);
        }
    const long area = t->has_border ? area_of_border(t) : -1;
    const rqt_outline outline = t->exact ? RQT_OUTLINE_EXACT : RQT_OUTLINE_TOL;
    shape beside;
    random_shape(&beside, random_between(0, SHAPE_KINDS - 1), t->m.r.width, t->m.r.height);
    for (int which = 0; which < 3; which++) {
        const shape *in = which == 0 ? NULL : which == 1 ? &beside : &t->grown;
        if (which == 2 && !t->has_border) continue;
        wanted want = wanted_of_shape(t, &leaves, in);
        const window all = window_all();
        rqt_region *region = which == 0 ? region_of(&all, &t->m.grid.lattice)
                                        : region_of_shape(which == 1 ? in : &t->border, &t->m.grid.lattice);
        if (which == 2) rqt_region_grow_rectangle(region);
        for (int k = smallest_k(&t->m.grid.lattice); k <= largest_k(&t->m.grid.lattice); k++) {
            database d;
            assert_int_equal(database_create(&d, &t->m, k, &test_allocator), RQT_OK);
            d.rule = c.rule;
            check_partition(&d, c.rule, outline);
            for (int select = 0; select < 3; select++) {
                char what[4800];
                rqt_patch patch;
                (void)snprintf(what, sizeof what, "k=%d select %d region %s", k, select, in ? in->text : "all");
                const rqt_status status =
                    database_query(&d, region, 0, (rqt_select)select, outline, &test_allocator, &patch);
                CHECK(status == RQT_OK, "%s: status %d", what, (int)status);
                if (patch.triangle_count != want.count) describe(t);
                check_patch(&t->m, &patch, &want, what);
                /* the lines of a collection are covered beside its border */
                check_mesh(t, &patch, which == 2 && t->exact && t->grown.segment_count == 0 ? area : -1, what);
                rqt_patch_free(&patch);
                if (select == 0) check_wire(t, &d, region, outline, what);
            }
            database_free(&d, &test_allocator);
        }
        rqt_region_free(region);
        wanted_free(&want);
    }
    core_rule_free(&c);
    oracle_list_free(&leaves);
    free(t->set);
    t->set = NULL;
}

/* ---------------------------------------------------------------------------------------- by chance -- */

static inline double random_metres(const model *m) {
    const double metres = rqt_code_metres((rqt_code)random_eps(m));
    return metres > 1e12 ? 1e12 : metres * (random_between(0, 3) ? 1 : 0.5 + random_unit());
}

static inline trial *trial_create(int width, int height, int with_border) {
    trial *t = calloc(1, sizeof *t);
    if (!t) abort();
    raster r = raster_make((surface)random_between(0, SURFACE_COUNT - 1), width, height, random_between(-1, 2));
    if (random_between(0, 3) == 0) raster_add_lake(&r);
    model_create(&t->m, r);
    t->exact = random_between(0, 3) != 0;
    t->eps = random_metres(&t->m);
    t->places = random_between(with_border ? 0 : 1, MOST_PLACES);
    for (int n = 0; n < t->places; n++) {
        random_shape(&t->place[n], random_between(0, SHAPE_KINDS - 1), width, height);
        t->place_eps[n] = random_between(0, 1) ? random_metres(&t->m) : t->eps * random_unit();
    }
    if (random_between(0, 4) == 0) t->quantum_error = t->eps * random_unit() / 4;
    if (random_between(0, 3) == 0) {
        const double step = t->eps * random_unit() / 3;
        for (int n = random_between(0, 5); n < RQT_RANKS; n++)
            t->lowering[n] = (n > 0 ? t->lowering[n - 1] : 0) + step;
    }
    t->forced_count = random_between(0, 2) ? 0 : random_between(1, MOST_FORCED);
    for (int n = 0; n < t->forced_count; n++)
        t->forced[n] = (oracle_point){random_between(0, t->m.o.side - 1), random_between(0, t->m.o.side - 1)};
    if (with_border) {
        t->has_border = 1;
        random_shape(&t->border, random_between(0, SHAPE_KINDS - 1), width, height);
        t->grown = t->border;
        (void)shape_grow_rectangle(&t->grown);
    }
    return t;
}

/* A square, or its quarters: those that begin before the raster's last column and row. */
static inline void random_squares(trial *t, int x, int y, int side, int finest, int share) {
    if ((x > 0 && x >= t->m.r.width - 1) || (y > 0 && y >= t->m.r.height - 1)) return;
    const int quarters = side > finest && random_between(0, 99) < share;
    if (quarters && t->squares < MOST_SQUARES - 64) {
        for (int c = 0; c < 4; c++)
            random_squares(t, x + c % 2 * (side / 2), y + c / 2 * (side / 2), side / 2, finest, share);
        return;
    }
    double eps = random_metres(&t->m);
    switch (random_between(0, 11)) {
    case 0:
        eps = 0;
        break;
    case 1:
        eps = INFINITY;
        break;
    case 2:
    case 3:
        eps *= 16 * random_unit();
        break;
    default:
        break;
    }
    assert_true(t->squares < MOST_SQUARES);
    t->square[t->squares++] = (square){x, y, side, eps, 0};
}

static inline void give_field(trial *t, int finest, int share) {
    t->square = calloc(MOST_SQUARES, sizeof *t->square);
    if (!t->square) abort();
    random_squares(t, 0, 0, t->m.o.side - 1, finest, share);
    for (int n = 0; n < t->squares; n++) t->square[n].used = eps_of_square(t, &t->square[n]);
}

static inline void trial_free(trial *t) {
    model_free(&t->m);
    free(t->square);
    free(t);
}

static inline trial *trial_over(raster r, double eps) {
    trial *t = calloc(1, sizeof *t);
    if (!t) abort();
    model_create(&t->m, r);
    t->exact = 1;
    t->eps = eps;
    return t;
}

static inline void place_rectangle(trial *t, double eps, int x0, int y0, int x1, int y1) {
    const int r[1][4] = {{QUARTERS * x0, QUARTERS * y0, QUARTERS * x1, QUARTERS * y1}};
    shape *s = &t->place[t->places];
    shape_write(s, "POLYGON");
    shape_polygon_of_rectangles(s, r, 1);
    t->place_eps[t->places++] = eps;
}

/* The triangles of a terrain by a rule, or by an eps alone. */
static inline key *keys_of_rule(trial *t, int k, const rqt_rule *rule, rqt_code eps, size_t *count) {
    database d;
    rqt_patch patch;
    const window all = window_all();
    rqt_region *region = region_of(&all, &t->m.grid.lattice);
    assert_int_equal(database_create(&d, &t->m, k, &test_allocator), RQT_OK);
    d.rule = rule;
    assert_int_equal(
        database_query(&d, region, eps, RQT_SELECT_THRESHOLD, RQT_OUTLINE_EXACT, &test_allocator, &patch), RQT_OK);
    key *keys = keys_of_patch(&patch, t->m.r.width);
    *count = patch.triangle_count;
    rqt_patch_free(&patch);
    rqt_region_free(region);
    database_free(&d, &test_allocator);
    return keys;
}

#endif
