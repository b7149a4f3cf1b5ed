/* test_core_rule.c - rules: eps by place, eps lowered by rank, forced vertices, mode `border`, against their
 * definitions.
 *
 * The oracle gives every vertex of the whole lattice its threshold by asking every place, forces and closes by
 * walking up to parents until nothing changes, finds mixed triangles by counting unit half cells, and takes the
 * leaves of what is then selected. The core has to give the same triangles from blocks of every size, however it
 * selects. The mesh itself is then looked at by the verifier, which knows neither, and sample by sample. */
#include "test_core_shapes.h"

#include "verify.h"

#include <limits.h>

enum { MOST_PLACES = 5, MOST_FORCED = 3 };

typedef struct trial {
    model m;
    shape place[MOST_PLACES];
    double place_eps[MOST_PLACES];
    int places;
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

static int log2_of(int power) {
    int n = 0;
    while (1 << n < power) n++;
    return n;
}

/* The largest power of two that divides both coordinates; that of the side for the corners of the root. */
static int step_of(const oracle *o, int x, int y) {
    int q = 1;
    while (q < o->side - 1 && x % (2 * q) == 0 && y % (2 * q) == 0) q *= 2;
    return q;
}

static int is_centre(int x, int y, int q) {
    return x / q % 2 == 1 && y / q % 2 == 1;
}

/* eps less what is taken from it, as a code; -1 below 0. */
static int code_of_eps(const trial *t, double eps, int rank) {
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

static int threshold_of(const trial *t, int x, int y) {
    const int q = step_of(&t->m.o, x, y), centre = is_centre(x, y, q), half = centre ? 3 * q : 2 * q;
    double eps = t->eps;
    for (int n = 0; n < t->places; n++)
        if (t->place_eps[n] < eps && shape_touches(&t->place[n], x - half, y - half, x + half, y + half))
            eps = t->place_eps[n];
    return code_of_eps(t, eps, 2 * log2_of(q) + centre);
}

enum { NOTHING = 1, ALL = 2 };

/* Which unit half cells of a triangle are in R'? NOTHING | ALL: some are, some are not. Forces the split vertices
 * of mixed ones. */
static int force_mixed(trial *t, const oracle_triangle *at) {
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

static void select_by_definition(trial *t) {
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
} core_rule;

static void core_rule_create(core_rule *c, const trial *t) {
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
    for (int n = 0; n < t->forced_count; n++)
        assert_int_equal(rqt_rule_force(c->rule, (rqt_vertex){t->forced[n].x, t->forced[n].y}), RQT_OK);
    if (t->has_border) {
        c->border = region_of_shape(&t->border, l);
        rqt_region_grow_rectangle(c->border);
        assert_int_equal(rqt_rule_force_border(c->rule, c->border, NULL, NULL), RQT_OK);
    }
}

static void core_rule_free(core_rule *c) {
    rqt_rule_free(c->rule);
    for (int n = 0; n < c->places; n++) rqt_region_free(c->region[n]);
    rqt_region_free(c->border);
}

static void describe(const trial *t) {
    raster_print(&t->m.r);
    print_error("eps %.17g, quantum error %.17g, %s\n", t->eps, t->quantum_error, t->exact ? "exact" : "tol");
    for (int n = 0; n < t->places; n++) print_error("  eps %.17g in %s\n", t->place_eps[n], t->place[n].text);
    for (int n = 0; n < t->forced_count; n++) print_error("  forced %d,%d\n", t->forced[n].x, t->forced[n].y);
    for (int n = 0; n < RQT_RANKS; n++)
        if (t->lowering[n] > 0) print_error("  lowered by %.17g for rank %d\n", t->lowering[n], n);
    if (t->has_border) print_error("  border of %s\n", t->border.text);
}

/* ---------------------------------------------------------------------------------- what must hold -- */

/* Each valid sample of a leaf is within the eps of every place that holds it, less what is taken from it. */
static void check_bound(const trial *t, const oracle_triangle *leaf) {
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
static void check_mesh(const trial *t, const rqt_patch *patch, long wanted_area, const char *what) {
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
static long area_of_border(const trial *t) {
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
static void check_partition(const database *d, const rqt_rule *rule, rqt_outline outline) {
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

static wanted wanted_of_shape(const trial *t, const oracle_list *leaves, const shape *region) {
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
static void check_wire(const trial *t, database *d, const rqt_region *region, rqt_outline outline,
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
static void check_trial(trial *t) {
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

static double random_metres(const model *m) {
    const double metres = rqt_code_metres((rqt_code)random_eps(m));
    return metres > 1e12 ? 1e12 : metres * (random_between(0, 3) ? 1 : 0.5 + random_unit());
}

static trial *trial_create(int width, int height, int with_border) {
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

static void trial_free(trial *t) {
    model_free(&t->m);
    free(t);
}

static void rules_equal_their_definition_on_small_rasters(void **state) {
    (void)state;
    random_begin("small rules");
    for (int n = 0; n < 150; n++) {
        trial *t = trial_create(random_between(1, 12), random_between(1, 12), n % 2);
        check_trial(t);
        trial_free(t);
    }
}

static void rules_equal_their_definition_on_larger_rasters(void **state) {
    (void)state;
    random_begin("larger rules");
    for (int n = 0; n < 12; n++) {
        trial *t = trial_create(random_between(17, 40), random_between(17, 40), n % 2);
        check_trial(t);
        trial_free(t);
    }
}

/* Flat terrain and a coarse eps: what is selected is what the border forces. Cheap, so that rare cases come up:
 * clamped triangles that stick out of R' though their children do not, half cells that a line touches and no
 * polygon meets. */
static void borders_force_what_is_mixed_and_no_more(void **state) {
    (void)state;
    random_begin("forced by borders");
    static const int kinds[] = {SHAPE_RECTANGLE, SHAPE_RINGS, SHAPE_TRIANGLES,
                                SHAPE_TRIANGLES, SHAPE_BOTH,  SHAPE_BOTH};
    for (int n = 0; n < 300; n++) {
        const int width = random_between(2, 11), height = random_between(2, 11);
        trial *t = calloc(1, sizeof *t);
        if (!t) abort();
        model_create(&t->m, raster_make(SURFACE_CONSTANT, width, height, -1));
        t->eps = 1e9;
        t->has_border = 1;
        random_shape(&t->border, kinds[n % 6], width, height);
        t->grown = t->border;
        (void)shape_grow_rectangle(&t->grown);
        select_by_definition(t);
        core_rule c;
        core_rule_create(&c, t);
        for (int y = 0; y < t->m.o.side; y++)
            for (int x = 0; x < t->m.o.side; x++) {
                const bool got =
                    rqt_rule_selects(c.rule, (rqt_vertex){x, y},
                                     oracle_at(&t->m.o, x, y)->code > 65534 ? RQT_CODE_INFINITY : 0, false);
                if (got != t->set[y * t->m.o.side + x]) describe(t);
                CHECK(got == t->set[y * t->m.o.side + x], "(%d,%d) is %sselected", x, y, got ? "" : "not ");
            }
        core_rule_free(&c);
        free(t->set);
        trial_free(t);
    }
}

/* -------------------------------------------------------------------------------- of the catalogue -- */

static trial *trial_over(raster r, double eps) {
    trial *t = calloc(1, sizeof *t);
    if (!t) abort();
    model_create(&t->m, r);
    t->exact = 1;
    t->eps = eps;
    return t;
}

static void place_rectangle(trial *t, double eps, int x0, int y0, int x1, int y1) {
    const int r[1][4] = {{QUARTERS * x0, QUARTERS * y0, QUARTERS * x1, QUARTERS * y1}};
    shape *s = &t->place[t->places];
    shape_write(s, "POLYGON");
    shape_polygon_of_rectangles(s, r, 1);
    t->place_eps[t->places++] = eps;
}

static void give_border(trial *t, const char *text, int x0, int y0, int x1, int y1) {
    const int r[1][4] = {{x0, y0, x1, y1}};
    memset(&t->border, 0, sizeof t->border);
    t->has_border = 1;
    shape_polygon_of_rectangles(&t->border, r, 1);
    t->border.used = 0;
    if (text)
        shape_write(&t->border, "%s", text);
    else
        shape_write(&t->border, "POLYGON((%.17g %.17g, %.17g %.17g, %.17g %.17g, %.17g %.17g, %.17g %.17g))",
                    x0 / 4.0, y0 / 4.0, x1 / 4.0, y0 / 4.0, x1 / 4.0, y1 / 4.0, x0 / 4.0, y1 / 4.0, x0 / 4.0,
                    y0 / 4.0);
    t->grown = t->border;
    (void)shape_grow_rectangle(&t->grown);
}

/* How many levels lie between the coarsest and the finest block that answers. */
static int levels_between(const trial *t, int k) {
    core_rule c;
    database d;
    int low = 99, high = 0;
    core_rule_create(&c, t);
    assert_int_equal(database_create(&d, &t->m, k, &test_allocator), RQT_OK);
    for (size_t n = 0; n < d.count; n++) {
        const rqt_block_place *p = &d.block[n].place;
        if (!rqt_rule_is_answered(c.rule, p, &d.block[n].summary, RQT_OUTLINE_EXACT) ||
            rqt_rule_is_answered_above(c.rule, p, &d.block[n].summary, RQT_OUTLINE_EXACT))
            continue;
        if (p->level < low) low = p->level;
        if (p->level > high) high = p->level;
    }
    database_free(&d, &test_allocator);
    core_rule_free(&c);
    return high - low;
}

static void F19_four_eps_at_a_block_corner_meet_without_t_junctions(void **state) {
    (void)state;
    random_begin("F19");
    for (int n = 0; n < 2; n++) {
        trial *t = trial_over(raster_make(n ? SURFACE_TAKAGI : SURFACE_HILLS, 129, 129 - 32 * n, -1), 1e9);
        const double most = rqt_code_metres((rqt_code)oracle_at(&t->m.o, 64, 64)->code);
        const int x = 64, y = n ? 32 : 64; /* a corner of blocks of every size up to 32 */
        place_rectangle(t, most / 100, x, y, 70, y + 5);
        place_rectangle(t, most / 12, x - 7, y, x, y + 4);
        place_rectangle(t, most / 4, x, y - 9, x + 3, y);
        place_rectangle(t, 0, x, y, x + 1, y + 1);
        CHECK(levels_between(t, 1) >= 3, "only %d levels apart", levels_between(t, 1));
        check_trial(t);
        trial_free(t);
    }
}

static void F20_closure_is_transitive_across_blocks(void **state) {
    (void)state;
    random_begin("F20");
    for (int n = 0; n < 8; n++) {
        /* nothing but the forced vertices and what they depend on, directly or not */
        trial *t = trial_over(raster_make(SURFACE_CONSTANT, 33, 30, -1), 5);
        static const oracle_point deep[8] = {{1, 1}, {31, 2},  {16, 15}, {17, 16},
                                             {8, 7}, {32, 31}, {15, 0},  {5, 27}};
        t->forced[t->forced_count++] = deep[n];
        check_trial(t);
        core_rule c;
        core_rule_create(&c, t);
        database d;
        rqt_patch patch;
        assert_int_equal(database_create(&d, &t->m, 2, &test_allocator), RQT_OK);
        d.rule = c.rule;
        const window all = window_all();
        rqt_region *region = region_of(&all, &t->m.grid.lattice);
        assert_int_equal(
            database_query(&d, region, 0, RQT_SELECT_THRESHOLD, RQT_OUTLINE_EXACT, &test_allocator, &patch),
            RQT_OK);
        CHECK(patch.vertex_count > 8, "a vertex of level 5 depends on more than %d", (int)patch.vertex_count);
        rqt_patch_free(&patch);
        rqt_region_free(region);
        database_free(&d, &test_allocator);
        core_rule_free(&c);
        trial_free(t);
    }
}

static void F24_regions_thinner_than_a_cell_have_a_border_or_are_covered(void **state) {
    (void)state;
    random_begin("F24");
    for (int n = 0; n < 12; n++) {
        trial *t = trial_create(random_between(2, 14), random_between(2, 14), 1);
        const int x = random_between(0, 4 * t->m.r.width), y = random_between(0, 4 * t->m.r.height);
        switch (n % 4) {
        case 0:
            give_border(t, NULL, x, y, x + 1, y + random_between(1, 30)); /* a quarter of a sample wide */
            break;
        case 1: /* on a sample line; shapes of lines and points are covered */
            memset(&t->border, 0, sizeof t->border);
            shape_write(&t->border, "LINESTRING(%d %d, %d %d)", x / 4, y / 4, x / 4, y / 4 + 5);
            t->border.segment[0][0] = (oracle_point){x & -4, y & -4};
            t->border.segment[0][1] = (oracle_point){x & -4, (y & -4) + 20};
            t->border.segment_count = 1;
            t->grown = t->border;
            break;
        case 2:
            random_shape(&t->border, SHAPE_POINT, t->m.r.width, t->m.r.height);
            t->grown = t->border;
            break;
        default:
            give_border(t, NULL, 4 * t->m.r.width - 3, y, 4 * t->m.r.width + 9, y + 4); /* outside */
        }
        check_trial(t);
        trial_free(t);
    }
}

static void F26_polygons_with_holes_touching_themselves_or_covered(void **state) {
    (void)state;
    random_begin("F26");
    static const int kinds[] = {SHAPE_RINGS, SHAPE_TRIANGLES, SHAPE_COVERED};
    for (int n = 0; n < 36; n++) {
        trial *t = trial_create(random_between(3, 18), random_between(3, 18), 1);
        random_shape(&t->border, kinds[n % 3], t->m.r.width, t->m.r.height);
        t->grown = t->border;
        (void)shape_grow_rectangle(&t->grown);
        if (n % 2) { /* mode cover: the same region over a mesh that knows nothing of it */
            t->has_border = 0;
            if (t->places == 0) place_rectangle(t, t->eps / 2, 0, 0, 2, 2);
            t->place[0] = t->border;
        }
        check_trial(t);
        trial_free(t);
    }
}

/* The vertex of a patch of all by mode border: its area told by the verifier. */
static void F27_border_on_odd_coordinates_has_the_regions_area(void **state) {
    (void)state;
    random_begin("F27");
    for (int n = 0; n < 12; n++) {
        const int width = random_between(12, 40), height = random_between(12, 40);
        trial *t = trial_over(raster_make(n % 3 ? SURFACE_HILLS : SURFACE_CONSTANT, width, height, -1),
                              n % 2 ? 1e6 : 3); /* coarse all around */
        const int x0 = random_between(0, 4) * 2 + 1, y0 = random_between(0, 4) * 2 + 1,
                  x1 = x0 + random_between(2, width), y1 = y0 + random_between(2, height);
        const int off = n % 4 == 3; /* between samples: grown outward */
        give_border(t, NULL, 4 * x0 + off, 4 * y0 + 2 * off, 4 * x1 - off, 4 * y1 - 3 * off);
        const int right = x1 < width - 1 ? x1 : width - 1, bottom = y1 < height - 1 ? y1 : height - 1;
        CHECK(area_of_border(t) == 2L * (right - x0) * (bottom - y0), "the oracle's area is %ld",
              area_of_border(t));
        check_trial(t);
        trial_free(t);
    }
}

/* ------------------------------------------------------------------------------- meshes beside meshes -- */

static key *keys_of_rule(trial *t, int k, const rqt_rule *rule, rqt_code eps, size_t *count) {
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

static void detail_changes_nothing_beyond_its_reach(void **state) {
    (void)state;
    random_begin("reach");
    size_t same = 0, other = 0;
    for (int n = 0; n < 60; n++) {
        trial *t = trial_create(random_between(8, 40), random_between(8, 40), 0);
        t->forced_count = 0;
        memset(t->lowering, 0, sizeof t->lowering);
        core_rule c;
        core_rule_create(&c, t);
        const int k = random_between(1, t->m.o.K < 5 ? t->m.o.K : 5);
        size_t plain_count, count;
        key *plain = keys_of_rule(t, k, NULL, rqt_code_eps(t->eps, t->quantum_error), &plain_count);
        key *with = keys_of_rule(t, k, c.rule, 0, &count);
        /* a leaf of the plain mesh that is not in the other was split: its split vertex was in reach of a place */
        for (size_t i = 0, j = 0; i < plain_count; i++) {
            while (j < count && ordered_keys(&with[j], &plain[i]) < 0) j++;
            if (j < count && ordered_keys(&with[j], &plain[i]) == 0) {
                same++;
                continue;
            }
            other++;
            long x0 = LONG_MAX, y0 = LONG_MAX, x1 = 0, y1 = 0;
            for (int v = 0; v < 3; v++) {
                const long x = plain[i].v[v] % t->m.r.width, y = plain[i].v[v] / t->m.r.width;
                if (x < x0) x0 = x;
                if (x > x1) x1 = x;
                if (y < y0) y0 = y;
                if (y > y1) y1 = y;
            }
            /* the half-width of its box is at most three times the longer side of a clamped leaf at the raster's
             * edge may be cut, so take the lattice's: the next power of two */
            long side = 1, reach = 0;
            while (side < x1 - x0 || side < y1 - y0) side *= 2;
            if (x1 == t->m.r.width - 1 || y1 == t->m.r.height - 1) side = t->m.o.side;
            reach = 4 * side;
            int near = 0;
            for (int p = 0; p < t->places; p++)
                near |= t->place_eps[p] < t->eps &&
                        shape_touches(&t->place[p], x0 - reach, y0 - reach, x1 + reach, y1 + reach);
            if (!near) describe(t);
            CHECK(near, "a leaf far from every place has changed");
        }
        free(plain);
        free(with);
        core_rule_free(&c);
        trial_free(t);
    }
    CHECK(same > 100 && other > 20, "%zu leaves stayed and %zu changed: no test of either", same, other);
}

static void detail_over_everything_is_the_mesh_of_its_eps(void **state) {
    (void)state;
    random_begin("everything");
    for (int n = 0; n < 30; n++) {
        trial *t = trial_over(raster_make((surface)random_between(0, SURFACE_COUNT - 1), random_between(1, 40),
                                          random_between(1, 40), random_between(-1, 2)),
                              0);
        t->eps = random_metres(&t->m);
        const double eps = t->eps * random_unit(), above = t->eps * 2;
        place_rectangle(t, eps, -1, -1, t->m.o.side, t->m.o.side);
        place_rectangle(t, above, 0, 0, 5, 5); /* coarser than all: nothing */
        core_rule c;
        core_rule_create(&c, t);
        for (int k = smallest_k(&t->m.grid.lattice); k <= largest_k(&t->m.grid.lattice); k++) {
            size_t plain_count, count;
            key *plain = keys_of_rule(t, k, NULL, rqt_code_eps(eps, 0), &plain_count);
            key *with = keys_of_rule(t, k, c.rule, 0, &count);
            CHECK(count == plain_count && (count == 0 || memcmp(with, plain, count * sizeof *plain) == 0),
                  "%zu triangles by detail, %zu by eps", count, plain_count);
            free(plain);
            free(with);
        }
        core_rule_free(&c);
        trial_free(t);
    }
}

static void bad_arguments_are_refused(void **state) {
    (void)state;
    random_begin("refused");
    rqt_rule *rule;
    const rqt_lattice lattice = {9, 9, 3};
    double lowering[RQT_RANKS] = {0};
    assert_int_equal(rqt_rule_create(&lattice, 0, &test_allocator, &rule), RQT_OK);
    const double bad[] = {-1, NAN, -INFINITY};
    for (size_t n = 0; n < sizeof bad / sizeof *bad; n++) {
        rqt_rule_place place = {NULL, bad[n]};
        assert_int_equal(rqt_rule_set_eps(rule, bad[n]), RQT_INVALID);
        assert_int_equal(rqt_rule_set_places(rule, &place, 1), RQT_INVALID);
        lowering[3] = bad[n];
        assert_int_equal(rqt_rule_set_lowering(rule, lowering), RQT_INVALID);
    }
    lowering[3] = 1; /* falls after it */
    assert_int_equal(rqt_rule_set_lowering(rule, lowering), RQT_INVALID);
    for (int n = 4; n < RQT_RANKS; n++) lowering[n] = 2;
    assert_int_equal(rqt_rule_set_lowering(rule, lowering), RQT_OK);
    assert_int_equal(rqt_rule_set_eps(rule, 1.5), RQT_OK);
    assert_int_equal(rqt_rule_threshold(rule, (rqt_vertex){1, 0}), rqt_code_floor(1.5));
    assert_int_equal(rqt_rule_threshold(rule, (rqt_vertex){2, 2}), rqt_code_floor(0.5));
    assert_int_equal(rqt_rule_threshold(rule, (rqt_vertex){4, 0}), -1);
    assert_true(rqt_rule_selects(rule, (rqt_vertex){4, 0}, 0, false));
    assert_int_equal(rqt_rule_set_eps(rule, INFINITY), RQT_OK);
    assert_int_equal(rqt_rule_threshold(rule, (rqt_vertex){4, 0}), RQT_CODE_LARGEST);
    assert_int_equal(rqt_rule_force(rule, (rqt_vertex){9, 0}), RQT_INVALID);
    assert_int_equal(rqt_rule_force(rule, (rqt_vertex){0, -1}), RQT_INVALID);
    rqt_rule_free(rule);
    rqt_rule_free(NULL);
}

/* A code is 2^-8 of itself wide, so that a double's last bit seldom shows: eps just above a code, and the
 * difference in the middle between it and the double below. */
static void a_lowered_eps_is_rounded_down(void **state) {
    (void)state;
    const rqt_lattice lattice = {9, 9, 3};
    double lowering[RQT_RANKS];
    rqt_rule *rule;
    assert_int_equal(rqt_rule_create(&lattice, 0, &test_allocator, &rule), RQT_OK);
    for (int n = 0; n < RQT_RANKS; n++) lowering[n] = 0x1p-70;
    assert_int_equal(rqt_rule_set_lowering(rule, lowering), RQT_OK);
    for (int code = 1000; code < RQT_CODE_LARGEST; code += 977) {
        const double eps = rqt_code_metres((rqt_code)code);
        if (eps < 0x1p-10 || eps > 1e9) continue;
        assert_int_equal(rqt_rule_set_eps(rule, eps), RQT_OK); /* less a little: no longer this code */
        CHECK(rqt_rule_threshold(rule, (rqt_vertex){1, 1}) == code - 1, "eps %.17g less 2^-70 is code %d, not %d",
              eps, (int)rqt_rule_threshold(rule, (rqt_vertex){1, 1}), code - 1);
    }
    rqt_rule_free(rule);
}

static bool stop_at_once(void *context) {
    ++*(int *)context;
    return true;
}

static void a_long_border_can_be_interrupted(void **state) {
    (void)state;
    static const char text[] = "POLYGON((3.5 2, 30000 700, 22000 29000, 3.5 2))";
    const rqt_lattice lattice = {32769, 32769, 15};
    rqt_geometry *geometry;
    rqt_region *region;
    rqt_rule *rule;
    rqt_message why;
    int asked = 0;
    assert_int_equal(rqt_geometry_parse(text, sizeof text - 1, true, &test_allocator, &geometry, &why), RQT_OK);
    assert_int_equal(rqt_region_create(geometry, &AT_ORIGIN, &lattice, &test_allocator, &region), RQT_OK);
    assert_int_equal(rqt_rule_create(&lattice, 0, &test_allocator, &rule), RQT_OK);
    assert_int_equal(rqt_rule_force_border(rule, region, stop_at_once, &asked), RQT_INTERRUPTED);
    assert_int_equal(asked, 1);
    rqt_rule_free(rule);
    rqt_region_free(region);
    rqt_geometry_free(geometry);
}

/* Every request for memory refused, once and from then on. */
static void without_memory_nothing_is_lost(void **state) {
    (void)state;
    random_begin("memory");
    for (int lasting = 0; lasting < 2; lasting++)
        for (size_t at = 1;; at++) {
            const rqt_lattice lattice = {40, 33, 6};
            static const char text[] = "POLYGON((3.5 2, 30 7, 22 29, 3.5 2))";
            rqt_geometry *geometry = NULL;
            rqt_region *region = NULL;
            rqt_rule *rule = NULL;
            rqt_message why;
            test_heap.fail_from = 0;
            assert_int_equal(rqt_geometry_parse(text, sizeof text - 1, true, &test_allocator, &geometry, &why),
                             RQT_OK);
            assert_int_equal(rqt_region_create(geometry, &AT_ORIGIN, &lattice, &test_allocator, &region), RQT_OK);
            rqt_rule_place places[20];
            for (int n = 0; n < 20; n++) places[n] = (rqt_rule_place){region, n};
            test_heap.calls = test_heap.failures = 0;
            test_heap.fail_from = at;
            test_heap.fail_to = lasting ? SIZE_MAX : at;
            rqt_status status = rqt_rule_create(&lattice, 0, &test_allocator, &rule);
            assert_true((status == RQT_OK) == (rule != NULL));
            if (status == RQT_OK) status = rqt_rule_set_places(rule, places, 20);
            if (status == RQT_OK) status = rqt_rule_force_border(rule, region, NULL, NULL);
            assert_int_equal(status, test_heap.failures ? RQT_NO_MEMORY : RQT_OK);
            const bool reached = test_heap.failures > 0;
            test_heap.fail_from = 0;
            rqt_rule_free(rule);
            rqt_region_free(region);
            rqt_geometry_free(geometry);
            assert_int_equal(test_heap.live, 0);
            if (!reached) break;
        }
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(rules_equal_their_definition_on_small_rasters),
        TEST(rules_equal_their_definition_on_larger_rasters),
        TEST(borders_force_what_is_mixed_and_no_more),
        TEST(F19_four_eps_at_a_block_corner_meet_without_t_junctions),
        TEST(F20_closure_is_transitive_across_blocks),
        TEST(F24_regions_thinner_than_a_cell_have_a_border_or_are_covered),
        TEST(F26_polygons_with_holes_touching_themselves_or_covered),
        TEST(F27_border_on_odd_coordinates_has_the_regions_area),
        TEST(detail_changes_nothing_beyond_its_reach),
        TEST(detail_over_everything_is_the_mesh_of_its_eps),
        TEST(bad_arguments_are_refused),
        TEST(a_lowered_eps_is_rounded_down),
        TEST(a_long_border_can_be_interrupted),
        TEST(without_memory_nothing_is_lost),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
