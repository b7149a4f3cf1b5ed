/* test_core_morph.c - geomorphs: heights of one mesh's vertices on another.
 *
 * Two rules, A and B, and the rule of the lesser threshold of both, U, on one terrain. Whatever rqt_morph_heights
 * says, here the meshes are only triangles: what moves is drawn at each sample and inside each triangle of U, in
 * exact rationals, and compared with A's triangle there and with the terrain. */
#include "test_core_database.h"

enum { MOST_PLACES = 3, STEPS = 4 };

typedef struct box {
    int x0, y0, x1, y1; /* samples, closed */
} box;

typedef struct side {
    int eps;
    box place[MOST_PLACES];
    int place_eps[MOST_PLACES], places;
    rqt_patch patch;
    double *height; /* of U's vertices on it */
} side;

typedef struct scene {
    model m;
    database d;
    side from, to;
    rqt_patch both;
    rqt_outline outline;
    bool has_rim; /* the mesh ends before a raster that ends within the lattice */
} scene;

/* ------------------------------------------------------------------------------------------ the meshes -- */

static rqt_region *region_of_box(const rqt_lattice *l, const box *b) {
    char text[200];
    rqt_geometry *geometry = NULL;
    rqt_region *region = NULL;
    const int n =
        snprintf(text, sizeof text,
                 b->x0 == b->x1 && b->y0 == b->y1 ? "POINT(%d %d)" : "POLYGON((%d %d, %d %d, %d %d, %d %d, %d %d))",
                 b->x0, b->y0, b->x1, b->y0, b->x1, b->y1, b->x0, b->y1, b->x0, b->y0);
    assert_int_equal(rqt_geometry_parse(text, (size_t)n, true, &test_allocator, &geometry, NULL), RQT_OK);
    assert_int_equal(rqt_region_create(geometry, &(rqt_placement){0, 0, 1, 1}, l, &test_allocator, &region),
                     RQT_OK);
    rqt_geometry_free(geometry);
    return region;
}

static void ask(scene *s, const side *const *sides, int count, const box *where, rqt_patch *patch) {
    const rqt_lattice *l = &s->m.grid.lattice;
    rqt_rule_place places[2 * MOST_PLACES];
    rqt_rule *rule = NULL;
    rqt_region *region = NULL;
    size_t n = 0;
    int eps = INT32_MAX;
    assert_int_equal(rqt_rule_create(l, 0, &test_allocator, &rule), RQT_OK);
    for (int i = 0; i < count; i++) {
        if (sides[i]->eps < eps) eps = sides[i]->eps;
        for (int p = 0; p < sides[i]->places; p++)
            places[n++] = (rqt_rule_place){region_of_box(l, &sides[i]->place[p]), sides[i]->place_eps[p]};
    }
    assert_int_equal(rqt_rule_set_eps(rule, eps), RQT_OK);
    assert_int_equal(rqt_rule_set_places(rule, places, n), RQT_OK);
    if (where)
        region = region_of_box(l, where);
    else
        assert_int_equal(rqt_region_create(NULL, &(rqt_placement){0, 0, 1, 1}, l, &test_allocator, &region),
                         RQT_OK);
    s->d.rule = rule;
    assert_int_equal(database_query_as(&s->d, region, 0, RQT_SELECT_THRESHOLD, s->outline, RQT_PRODUCT_TRIANGLES,
                                       true, NULL, &test_allocator, patch),
                     RQT_OK);
    s->d.rule = NULL;
    rqt_rule_free(rule);
    rqt_region_free(region);
    for (size_t i = 0; i < n; i++) rqt_region_free((rqt_region *)(uintptr_t)places[i].region);
}

static int eps_at(const side *a, int x, int y) {
    int eps = a->eps;
    for (int p = 0; p < a->places; p++) {
        const box *b = &a->place[p];
        if (x >= b->x0 && x <= b->x1 && y >= b->y0 && y <= b->y1 && a->place_eps[p] < eps) eps = a->place_eps[p];
    }
    return eps;
}

/* ------------------------------------------------------------------------------------------- geometry -- */
/* Places in thirds of a sample, heights in 2^-K quanta: whole numbers. */
typedef struct spot {
    long x, y;
} spot;

/* Weights of a place in a triangle, which sum up to its area; false: outside. */
static bool weights_of(const rqt_patch *patch, size_t t, spot at, long weight[3], long *area) {
    long x[3], y[3];
    for (size_t c = 0; c < 3; c++) {
        const rqt_patch_vertex *v = &patch->vertices[patch->triangles[3 * t + c]];
        x[c] = 3 * v->col - at.x;
        y[c] = 3 * v->row - at.y;
    }
    *area = 0;
    for (int c = 0; c < 3; c++) {
        const int a = (c + 1) % 3, b = (c + 2) % 3;
        weight[c] = x[b] * y[a] - x[a] * y[b]; /* y grows southward: counter-clockwise from above */
        if (weight[c] < 0) return false;
        *area += weight[c];
    }
    return true;
}

/* num / den: a patch's height at a place, in its own heights; false where it has none. */
static bool height_at(const rqt_patch *patch, spot at, __int128 *num, __int128 *den) {
    for (size_t t = 0; t < patch->triangle_count; t++) {
        long weight[3], area;
        if (!weights_of(patch, t, at, weight, &area)) continue;
        *num = 0;
        *den = area;
        for (size_t c = 0; c < 3; c++) *num += (__int128)weight[c] * patch->vertices[patch->triangles[3 * t + c]].q;
        return true;
    }
    return false;
}

static long binary(double height, int K) {
    const double whole = ldexp(height, K);
    CHECK(whole == floor(whole), "%.17g is no multiple of 2^-%d", height, K);
    return (long)whole;
}

static int scale_of(const rqt_lattice *l, rqt_vertex v) {
    int q = 1;
    while (q < 1 << l->K && v.x % (2 * q) == 0 && v.y % (2 * q) == 0) q *= 2;
    return q;
}

static bool is_near_end(const rqt_lattice *l, rqt_vertex v) {
    const int whole = 1 << l->K, q = scale_of(l, v);
    const int reach = v.x / q % 2 == 1 && v.y / q % 2 == 1 ? 3 * q : 2 * q;
    return (l->width <= whole && v.x + reach >= l->width) || (l->height <= whole && v.y + reach >= l->height);
}

static bool has_corner(const rqt_patch *patch, rqt_vertex v) {
    for (size_t t = 0; t < patch->triangle_count; t++) {
        const rqt_triangle *leaf = &patch->leaves[t];
        if ((leaf->apex.x == v.x && leaf->apex.y == v.y) || (leaf->left.x == v.x && leaf->left.y == v.y) ||
            (leaf->right.x == v.x && leaf->right.y == v.y))
            return true;
    }
    return false;
}

/* Is a place in the square around a vertex near the raster's end that U has and this mesh has not? There it jumps.
 */
static bool jumps(const scene *s, const rqt_patch *patch, spot at) {
    const rqt_lattice *l = &s->m.grid.lattice;
    for (size_t t = 0; t < s->both.triangle_count; t++) {
        const rqt_triangle *leaf = &s->both.leaves[t];
        const rqt_vertex corner[3] = {leaf->apex, leaf->left, leaf->right};
        for (int c = 0; c < 3; c++) {
            const int q = 3 * scale_of(l, corner[c]);
            if (labs(at.x - 3 * corner[c].x) <= q && labs(at.y - 3 * corner[c].y) <= q &&
                is_near_end(l, corner[c]) && !has_corner(patch, corner[c]))
                return true;
        }
    }
    return false;
}

/* ---------------------------------------------------------------------------------------- what must hold -- */

typedef struct tally {
    long moved, places, ends, apart, unknown;
} tally;

/* The surface at t = step / STEPS over a triangle of U, at a place in it. A and B have a mesh there. */
static void check_place(const scene *s, size_t t, spot at, tally *sum) {
    const rqt_lattice *l = &s->m.grid.lattice;
    const rqt_patch *u = &s->both;
    long weight[3], area;
    __int128 start = 0, end = 0, a_num = 0, a_den = 0, b_num = 0, b_den = 0;
    if (!weights_of(u, t, at, weight, &area)) return;
    if (!height_at(&s->from.patch, at, &a_num, &a_den)) {
        CHECK(jumps(s, &s->from.patch, at), "A has a mesh in a part of a triangle of U");
        sum->apart++;
        return;
    }
    if (!height_at(&s->to.patch, at, &b_num, &b_den)) {
        CHECK(jumps(s, &s->to.patch, at), "B has a mesh in a part of a triangle of U");
        sum->apart++;
        return;
    }
    for (size_t c = 0; c < 3; c++) {
        const uint32_t v = u->triangles[3 * t + c];
        if (isnan(s->from.height[v]) || isnan(s->to.height[v])) {
            CHECK(s->has_rim, "(%d,%d) has no height where both have a mesh", u->vertices[v].col,
                  u->vertices[v].row);
            sum->unknown++;
            return;
        }
        start += (__int128)weight[c] * binary(s->from.height[v], l->K);
        end += (__int128)weight[c] * binary(s->to.height[v], l->K);
    }
    sum->places++;
    if (start * a_den != (a_num * area) * (1L << l->K)) {
        CHECK(jumps(s, &s->from.patch, at), "at (%g,%g) it does not begin on A", (double)at.x / 3,
              (double)at.y / 3);
        sum->ends++;
    }
    if (end * b_den != (b_num * area) * (1L << l->K)) {
        CHECK(jumps(s, &s->to.patch, at), "at (%g,%g) it does not end on B", (double)at.x / 3, (double)at.y / 3);
        sum->ends++;
    }
    if (at.x % 3 || at.y % 3) return;
    const int x = (int)at.x / 3, y = (int)at.y / 3, n = y * l->width + x;
    if (s->m.r.valid && !s->m.r.valid[n]) return;
    const __int128 z = (__int128)s->m.r.q[n] * area * (1L << l->K);
    for (int step = 0; step <= STEPS; step++) {
        const __int128 off = (STEPS - step) * (start - z) + step * (end - z);
        const __int128 allowed =
            ((__int128)((STEPS - step) * (long)eps_at(&s->from, x, y) + step * (long)eps_at(&s->to, x, y)) * area)
            << l->K;
        CHECK((off < 0 ? -off : off) <= allowed, "%s: at t = %d/%d sample (%d,%d) is %g off, allowed %g",
              s->m.r.name, step, STEPS, x, y, (double)off / (double)area / STEPS / (double)(1 << l->K),
              (double)allowed / (double)area / STEPS / (double)(1 << l->K));
    }
}

static void check_ends(const scene *s, const uint32_t *ends) {
    const rqt_lattice *l = &s->m.grid.lattice;
    for (size_t i = 0; i < s->both.vertex_count; i++) {
        const rqt_patch_vertex *v = &s->both.vertices[i];
        const uint32_t a = ends[2 * i], b = ends[2 * i + 1];
        if (is_near_end(l, (rqt_vertex){v->col, v->row})) assert_true(a == RQT_NO_VERTEX && b == RQT_NO_VERTEX);
        if (a == RQT_NO_VERTEX || b == RQT_NO_VERTEX) continue;
        const rqt_patch_vertex *p = &s->both.vertices[a], *q = &s->both.vertices[b];
        CHECK(p->col + q->col == 2 * v->col && p->row + q->row == 2 * v->row, "(%d,%d) is not between its ends",
              v->col, v->row);
        CHECK(p->level < v->level && q->level < v->level, "an end of (%d,%d) is not coarser", v->col, v->row);
        const double one = s->from.height[a], other = s->from.height[b], own = s->from.height[i];
        CHECK(isnan(own) || own == v->q || own == (one + other) / 2,
              "(%d,%d) is on its edge neither before nor after", v->col, v->row);
    }
}

static void check_scene(scene *s, tally *sum) {
    const rqt_lattice *l = &s->m.grid.lattice;
    const size_t n = s->both.vertex_count;
    uint32_t *ends = malloc((2 * n + 1) * sizeof *ends);
    s->from.height = malloc((n + 1) * sizeof *s->from.height);
    s->to.height = malloc((n + 1) * sizeof *s->to.height);
    if (!ends || !s->from.height || !s->to.height) abort();
    assert_int_equal(rqt_morph_heights(l, &s->from.patch, &s->both, &test_allocator, s->from.height, ends), RQT_OK);
    assert_int_equal(rqt_morph_heights(l, &s->to.patch, &s->both, &test_allocator, s->to.height, NULL), RQT_OK);
    for (size_t i = 0; i < n; i++) sum->moved += s->from.height[i] != s->to.height[i] && !isnan(s->from.height[i]);
    check_ends(s, ends);
    for (size_t t = 0; t < s->both.triangle_count; t++) {
        int x0 = INT32_MAX, y0 = INT32_MAX, x1 = 0, y1 = 0;
        spot middle = {0, 0};
        for (size_t c = 0; c < 3; c++) {
            const rqt_patch_vertex *v = &s->both.vertices[s->both.triangles[3 * t + c]];
            if (v->col < x0) x0 = v->col;
            if (v->col > x1) x1 = v->col;
            if (v->row < y0) y0 = v->row;
            if (v->row > y1) y1 = v->row;
            middle.x += v->col;
            middle.y += v->row;
        }
        __int128 num = 0, den = 0;
        if (!height_at(&s->from.patch, middle, &num, &den) || !height_at(&s->to.patch, middle, &num, &den)) {
            sum->apart++;
            continue;
        }
        check_place(s, t, middle, sum);
        for (int y = y0; y <= y1; y++)
            for (int x = x0; x <= x1; x++) check_place(s, t, (spot){3 * x, 3 * y}, sum);
    }
    free(ends);
    free(s->from.height);
    free(s->to.height);
}

/* ---------------------------------------------------------------------------------------------- by chance -- */

static box random_box(const rqt_lattice *l) {
    box b = {.x0 = random_between(0, l->width - 1), .y0 = random_between(0, l->height - 1)};
    b.x1 = random_between(b.x0, l->width - 1);
    b.y1 = random_between(b.y0, l->height - 1);
    if ((b.x0 == b.x1) != (b.y0 == b.y1)) { /* no line */
        b.x1 = b.x0;
        b.y1 = b.y0;
    }
    return b;
}

static int random_eps(void) {
    static const int eps[] = {0, 1, 2, 3, 5, 8, 20, 60, 100, 200, 1000};
    return eps[random_between(0, 10)];
}

static side random_side(const rqt_lattice *l) {
    side a = {.eps = random_eps(), .places = random_between(0, MOST_PLACES)};
    for (int p = 0; p < a.places; p++) {
        a.place[p] = random_box(l);
        a.place_eps[p] = random_eps();
    }
    return a;
}

static void scene_create(scene *s, int width, int height, int voids) {
    memset(s, 0, sizeof *s);
    raster r = raster_make((surface)random_between(0, SURFACE_COUNT - 1), width, height, voids);
    r.unit = UNIT_METRE;
    if (voids == 0) raster_add_lake(&r);
    model_create(&s->m, r);
    const int low = smallest_k(&s->m.grid.lattice), high = largest_k(&s->m.grid.lattice);
    assert_int_equal(database_create(&s->d, &s->m, random_between(low, high), &test_allocator), RQT_OK);
    s->outline = random_between(0, 1) ? RQT_OUTLINE_TOL : RQT_OUTLINE_EXACT;
    s->from = random_side(&s->m.grid.lattice);
    s->to = random_side(&s->m.grid.lattice);
}

static void scene_ask(scene *s, const box *from, const box *to) {
    const side *const both[] = {&s->from, &s->to};
    ask(s, both, 1, from, &s->from.patch);
    ask(s, both + 1, 1, to, &s->to.patch);
    ask(s, both, 2, to, &s->both);
}

static void scene_free(scene *s) {
    rqt_patch_free(&s->from.patch);
    rqt_patch_free(&s->to.patch);
    rqt_patch_free(&s->both);
    database_free(&s->d, &test_allocator);
    model_free(&s->m);
}

static void run(int rounds, bool squares, bool voids, bool windows, tally *sum) {
    for (int round = 0; round < rounds; round++) {
        scene s;
        const int whole = (1 << random_between(1, 4)) + 1;
        scene_create(&s, squares ? whole : random_between(2, 21), squares ? whole : random_between(2, 21),
                     voids ? random_between(0, 1) * 4 : -1);
        const box from = random_box(&s.m.grid.lattice), to = random_box(&s.m.grid.lattice);
        s.has_rim = (voids || windows) && !squares;
        scene_ask(&s, windows && random_between(0, 2) ? &from : NULL, windows && random_between(0, 2) ? &to : NULL);
        check_scene(&s, sum);
        scene_free(&s);
    }
}

static void F35_a_geomorph_begins_on_one_mesh_ends_on_the_other_and_stays_within_both_tolerances(void **state) {
    (void)state;
    random_begin("geomorphs of lattices");
    tally sum = {0};
    run(150, true, false, false, &sum);
    CHECK(sum.moved > 500 && sum.places > 10000 && sum.ends == 0 && sum.apart == 0, "%ld %ld %ld %ld", sum.moved,
          sum.places, sum.ends, sum.apart);
}

static void F35_where_the_raster_ends_within_the_lattice_the_tolerances_hold(void **state) {
    (void)state;
    random_begin("geomorphs of rasters");
    tally sum = {0};
    run(250, false, false, false, &sum);
    CHECK(sum.moved > 100 && sum.ends > 1000 && sum.places > 2 * sum.ends && sum.apart == 0, "%ld %ld %ld %ld",
          sum.moved, sum.places, sum.ends, sum.apart);
}

static void F35_voids_and_windows_leave_the_rest_as_it_is(void **state) {
    (void)state;
    random_begin("geomorphs with voids");
    tally sum = {0};
    run(150, true, true, true, &sum);
    run(150, false, true, true, &sum);
    CHECK(sum.moved > 50 && sum.places > 10000 && sum.apart > 300 && sum.unknown < sum.places / 10,
          "%ld %ld %ld %ld %ld", sum.moved, sum.places, sum.ends, sum.apart, sum.unknown);
}

/* ------------------------------------------------------------------------------------------------- doors -- */

static void heights_of_a_mesh_on_itself_are_its_own_and_without_leaves_there_are_none(void **state) {
    (void)state;
    random_begin("heights on itself");
    scene s;
    scene_create(&s, 17, 13, -1);
    scene_ask(&s, NULL, NULL);
    double *height = malloc((s.both.vertex_count + 1) * sizeof *height);
    if (!height) abort();
    assert_int_equal(rqt_morph_heights(&s.m.grid.lattice, &s.both, &s.both, &test_allocator, height, NULL), RQT_OK);
    for (size_t i = 0; i < s.both.vertex_count; i++) assert_true(height[i] == s.both.vertices[i].q);
    rqt_patch bare = s.from.patch;
    bare.leaves = NULL;
    assert_int_equal(rqt_morph_heights(&s.m.grid.lattice, &bare, &s.both, &test_allocator, height, NULL),
                     RQT_INVALID);
    const rqt_patch nothing = {.allocator = test_allocator};
    assert_int_equal(rqt_morph_heights(&s.m.grid.lattice, &nothing, &nothing, &test_allocator, height, NULL),
                     RQT_OK);
    free(height);
    scene_free(&s);
}

static void refused_memory_is_said_and_nothing_is_kept(void **state) {
    (void)state;
    random_begin("geomorphs without memory");
    scene s;
    scene_create(&s, 33, 33, -1);
    s.from.eps = 1000;
    s.to.eps = 0;
    s.from.places = s.to.places = 0;
    const box all = {0, 0, 32, 32}, one = {9, 9, 9, 9};
    scene_ask(&s, &all, &one);
    double *height = malloc((s.both.vertex_count + 1) * sizeof *height);
    if (!height) abort();
    const size_t live = test_heap.live;
    size_t refused = 0;
    for (size_t n = 1;; n++) {
        test_heap.fail_from = test_heap.calls + n;
        test_heap.fail_to = test_heap.fail_from;
        test_heap.failures = 0;
        const rqt_status status =
            rqt_morph_heights(&s.m.grid.lattice, &s.from.patch, &s.both, &test_allocator, height, NULL);
        assert_int_equal(status, test_heap.failures ? RQT_NO_MEMORY : RQT_OK);
        assert_int_equal(test_heap.live, live);
        if (!test_heap.failures) break;
        refused++;
    }
    test_heap.fail_from = test_heap.fail_to = 0;
    assert_true(refused > 0);
    free(height);
    scene_free(&s);
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(F35_a_geomorph_begins_on_one_mesh_ends_on_the_other_and_stays_within_both_tolerances),
        TEST(F35_where_the_raster_ends_within_the_lattice_the_tolerances_hold),
        TEST(F35_voids_and_windows_leave_the_rest_as_it_is),
        TEST(heights_of_a_mesh_on_itself_are_its_own_and_without_leaves_there_are_none),
        TEST(refused_memory_is_said_and_nothing_is_kept),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
