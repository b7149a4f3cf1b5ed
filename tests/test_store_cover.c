/* test_store_cover.c - how much of a box of samples a mesh covers, as the store knows it without making the mesh:
 * beside the triangles of the mesh, clipped to the box here. */
#include "test_store_support.h"

enum { WIDTH = 61, HEIGHT = 47, BOXES = 20, RULES = 3 };

static uint64_t seed, state;
static int below(int n) {
    state = state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (int)((state >> 33) % (uint64_t)n);
}

/* A slope without errors, so that coarse blocks answer too, but for a disc of cliffs, so that fine ones do beside
 * them at tolerances that drop leaves for a void corner; a half plane and discs of voids. */
static raster make_coast(void) {
    raster r = {WIDTH, HEIGHT, malloc(sizeof(int32_t) * WIDTH * HEIGHT), malloc(WIDTH * HEIGHT)};
    assert_true(r.q && r.valid);
    const int a = below(7) - 3, b = below(7) - 3, c = below(200) - 100;
    const int discs[3][3] = {{below(WIDTH), below(HEIGHT), below(80)},
                             {below(WIDTH), below(HEIGHT), below(8)},
                             {below(WIDTH), below(HEIGHT), below(400)}};
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            const size_t at = (size_t)(y * WIDTH + x);
            r.q[at] = 3 * x - 2 * y;
            r.valid[at] = a * (x - WIDTH / 2) + b * (y - HEIGHT / 2) + c >= 0;
            for (int d = 0; d < 3; d++) {
                const int dx = x - discs[d][0], dy = y - discs[d][1];
                if (dx * dx + dy * dy >= discs[d][2]) continue;
                if (d < 2) r.valid[at] = 0;
                if (d == 2) r.q[at] += below(4096);
            }
        }
    return r;
}

typedef struct place {
    double x, y;
} place;

/* What of a convex polygon lies where sign * coordinate >= sign * at. */
static int clip(const place *p, int n, place *out, bool by_x, int sign, double at) {
    int count = 0;
    for (int i = 0; i < n; i++) {
        const place a = p[i], b = p[(i + 1) % n];
        const double da = sign * ((by_x ? a.x : a.y) - at), db = sign * ((by_x ? b.x : b.y) - at);
        if (da >= 0) out[count++] = a;
        if ((da > 0 && db < 0) || (da < 0 && db > 0))
            out[count++] = (place){a.x + (b.x - a.x) * da / (da - db), a.y + (b.y - a.y) * da / (da - db)};
    }
    return count;
}

static double area_in_box(const rqt_patch *patch, const int32_t box[4]) {
    double area = 0;
    for (size_t t = 0; t < patch->triangle_count; t++) {
        place p[8], other[8];
        int n = 3;
        for (int i = 0; i < 3; i++) {
            const rqt_patch_vertex *v = &patch->vertices[patch->triangles[3 * t + (size_t)i]];
            p[i] = (place){v->col, v->row};
        }
        n = clip(p, n, other, true, 1, box[0]);
        n = clip(other, n, p, true, -1, box[1]);
        n = clip(p, n, other, false, 1, box[2]);
        n = clip(other, n, p, false, -1, box[3]);
        double twice = 0;
        for (int i = 0; i < n; i++) twice += p[i].x * p[(i + 1) % n].y - p[(i + 1) % n].x * p[i].y;
        area += fabs(twice) / 2;
    }
    return area;
}

static rqt_rule *make_rule(const store_terrain *t, int kind) {
    rqt_rule *rule = NULL;
    double lowering[RQT_RANKS];
    if (kind == 0) return NULL;
    for (int rank = 0; rank < RQT_RANKS; rank++) lowering[rank] = rank * rank * (kind == 1 ? 0.02 : 3);
    assert_int_equal(rqt_rule_create(&t->lattice, t->quantum_error, store_allocator(), &rule), RQT_OK);
    assert_int_equal(rqt_rule_set_lowering(rule, lowering), RQT_OK);
    return rule;
}

typedef struct tally {
    int all, nothing, boxes;
} tally;

static void check_boxes(store *s, const store_terrain *t, double eps, const store_query_options *options,
                        tally *seen) {
    rqt_region *everything;
    rqt_patch patch;
    assert_int_equal(rqt_region_create(NULL, &t->placement, &t->lattice, store_allocator(), &everything), RQT_OK);
    assert_int_equal(store_query(s, t, everything, eps, options, &patch, NULL, NULL), SQLITE_OK);
    for (int i = 0; i < BOXES; i++) {
        const int wide = 1 + below(i % 2 ? WIDTH - 1 : 4), high = 1 + below(i % 2 ? HEIGHT - 1 : 4);
        const int32_t x = below(WIDTH - wide), y = below(HEIGHT - high), box[4] = {x, x + wide, y, y + high};
        store_cover cover;
        assert_int_equal(store_covers(s, t, box, eps, options, &cover, NULL), SQLITE_OK);
        const double area = area_in_box(&patch, box);
        CHECK(cover != STORE_COVER_ALL || fabs(area - wide * high) < 1e-6,
              "seed %llu: all of (%d,%d) %d x %d at %g, and triangles have %g of it", (unsigned long long)seed, x,
              y, wide, high, eps, area);
        CHECK(cover != STORE_COVER_NOTHING || area == 0,
              "seed %llu: nothing of (%d,%d) %d x %d at %g, and triangles have %g of it", (unsigned long long)seed,
              x, y, wide, high, eps, area);
        seen->all += cover == STORE_COVER_ALL;
        seen->nothing += cover == STORE_COVER_NOTHING;
        seen->boxes++;
    }
    rqt_patch_free(&patch);
    rqt_region_free(everything);
}

static void boxes_are_covered_as_the_mesh_covers_them(void **unused) {
    (void)unused;
    static const double eps[] = {0, 4, 12, 20, 30, 45, 70, 110, 200, 400, 1e9};
    tally seen = {0};
    for (int n = 0; n < 120; n++) {
        raster r = make_coast();
        sqlite3 *db = open_database(":memory:");
        store *s;
        const store_terrain *t;
        run(db, "BEGIN IMMEDIATE");
        assert_int_equal(write_terrain(db, &r, "t", 1 + n % 3, false, true, NULL), SQLITE_OK);
        run(db, "COMMIT");
        assert_int_equal(store_open(db, &s), SQLITE_OK);
        assert_int_equal(store_find(s, "t", &t, NULL), SQLITE_OK);
        for (int kind = 0; kind < RULES; kind++) {
            rqt_rule *rule = make_rule(t, kind);
            const store_query_options options = {.outline = n % 2 ? RQT_OUTLINE_EXACT : RQT_OUTLINE_TOL,
                                                 .rule = rule};
            for (size_t e = 0; e < sizeof eps / sizeof *eps; e++) check_boxes(s, t, eps[e], &options, &seen);
            rqt_rule_free(rule);
        }
        store_close(s);
        sqlite3_close(db);
        raster_free(&r);
    }
    print_message("%d boxes: %d covered, %d not, known without the mesh\n", seen.boxes, seen.all, seen.nothing);
    assert_true(seen.all > seen.boxes / 20);
    assert_true(seen.nothing > seen.boxes / 20);
}

int main(void) {
    const char *given = getenv("RQT_SEED");
    seed = given ? strtoull(given, NULL, 10) : 1;
    state = seed * UINT64_C(0x9E3779B97F4A7C15);
    print_message("seed %llu\n", (unsigned long long)seed);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(boxes_are_covered_as_the_mesh_covers_them),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
