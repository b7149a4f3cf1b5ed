/* test_store_mark.c - in which cells of a grid a mesh has triangles, as the store knows it without making the mesh:
 * beside the triangles of the mesh, clipped to each cell here. And that a search which is interrupted, again and
 * again, ends at the same. */
#include "test_store_support.h"

enum { WIDTH = 61, HEIGHT = 47, GRIDS = 6, RULES = 4, MOST_LINES = 12 };

static uint64_t seed, state;
static int below(int n) {
    state = state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (int)((state >> 33) % (uint64_t)n);
}

/* A slope without errors, so that coarse blocks answer too, but for a disc of cliffs, so that fine ones do beside
 * them at tolerances that drop leaves for a void corner; a half plane and discs of voids, or voids scattered. */
static raster make_coast(void) {
    raster r = {WIDTH, HEIGHT, malloc(sizeof(int32_t) * WIDTH * HEIGHT), malloc(WIDTH * HEIGHT)};
    assert_true(r.q && r.valid);
    const int scattered = below(3) ? 0 : below(70); /* percent */
    const int a = scattered ? 0 : below(7) - 3, b = scattered ? 0 : below(7) - 3,
              c = scattered ? 1 : below(200) - 100;
    const int discs[3][3] = {{below(WIDTH), below(HEIGHT), below(80)},
                             {below(WIDTH), below(HEIGHT), below(8)},
                             {below(WIDTH), below(HEIGHT), below(400)}};
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            const size_t at = (size_t)(y * WIDTH + x);
            r.q[at] = 3 * x - 2 * y;
            r.valid[at] = a * (x - WIDTH / 2) + b * (y - HEIGHT / 2) + c >= 0;
            if (below(100) < scattered) r.valid[at] = 0;
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

/* Lines in quarters of a sample: what clipping at them rounds is far less than what a triangle can have of a cell.
 */
static double area_in_cell(const rqt_patch *patch, const int32_t box[4]) {
    double area = 0;
    for (size_t t = 0; t < patch->triangle_count; t++) {
        place p[8], other[8];
        int n = 3;
        for (int i = 0; i < 3; i++) {
            const rqt_patch_vertex *v = &patch->vertices[patch->triangles[3 * t + (size_t)i]];
            p[i] = (place){v->col, v->row};
        }
        if (fmax(p[0].x, fmax(p[1].x, p[2].x)) * 4 <= box[0] || fmin(p[0].x, fmin(p[1].x, p[2].x)) * 4 >= box[1] ||
            fmax(p[0].y, fmax(p[1].y, p[2].y)) * 4 <= box[2] || fmin(p[0].y, fmin(p[1].y, p[2].y)) * 4 >= box[3])
            continue;
        n = clip(p, n, other, true, 1, box[0] / 4.0);
        n = clip(other, n, p, true, -1, box[1] / 4.0);
        n = clip(p, n, other, false, 1, box[2] / 4.0);
        n = clip(other, n, p, false, -1, box[3] / 4.0);
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
    for (int i = 0; i < 4 && kind == 3; i++)
        assert_int_equal(rqt_rule_force(rule, (rqt_vertex){below(WIDTH), below(HEIGHT)}), RQT_OK);
    return rule;
}

/* 2 .. MOST_LINES of them, in quarters of a sample: all over the raster, or near one another. */
static int make_lines(int samples, int32_t *quarters, int64_t *lines) {
    const int end = 4 * (samples - 1), few = below(2), n = 2 + below(MOST_LINES - 1);
    int at = few ? below(end - 1) : 0, count = 0;
    while (count < n && at <= end) {
        quarters[count] = at;
        lines[count++] = (int64_t)at << 18;
        at += 1 + below(few ? 6 : 2 * end / n);
    }
    if (count < 2) return make_lines(samples, quarters, lines);
    return count;
}

static int budget, asked;
static int is_over(void *unused) {
    (void)unused;
    return ++asked > budget;
}

typedef struct tally {
    int cells, marked, stops;
} tally;

/* The same in steps: as much as a budget allows, and again from there. */
static void check_steps(store *s, const store_terrain *t, double eps, const store_query_options *options,
                        const rqt_cells *whole, tally *seen) {
    uint8_t marks[MOST_LINES * MOST_LINES] = {0};
    rqt_cells cells = {whole->x, whole->y, whole->columns, whole->rows, marks};
    rqt_block_number last = 0, before;
    char *error = NULL;
    int code;
    sqlite3 *db = store_connection(s);
    sqlite3_progress_handler(db, 1, is_over, NULL);
    budget = 40;
    do {
        before = last;
        asked = 0;
        sqlite3_free(error);
        error = NULL;
        code = store_mark(s, t, eps, options, &cells, &last, &error);
        CHECK(code == SQLITE_OK || code == SQLITE_INTERRUPT, "%d: %s", code, error ? error : "");
        assert_true(last >= before);
        if (last == before) budget += 40; /* not enough to find the blocks and ask one */
        seen->stops += code == SQLITE_INTERRUPT && last > 0;
    } while (code != SQLITE_OK);
    sqlite3_progress_handler(db, 0, NULL, NULL);
    sqlite3_free(error);
    CHECK(memcmp(marks, whole->marks, (size_t)(whole->columns * whole->rows)) == 0,
          "seed %llu: other marks in steps, at %g", (unsigned long long)seed, eps);
}

static void check_grids(store *s, const store_terrain *t, double eps, const store_query_options *options,
                        tally *seen) {
    rqt_region *everything;
    rqt_patch patch;
    assert_int_equal(rqt_region_create(NULL, &t->placement, &t->lattice, store_allocator(), &everything), RQT_OK);
    assert_int_equal(store_query(s, t, everything, eps, options, &patch, NULL, NULL), SQLITE_OK);
    for (int g = 0; g < GRIDS; g++) {
        int32_t qx[MOST_LINES], qy[MOST_LINES];
        int64_t x[MOST_LINES], y[MOST_LINES];
        uint8_t marks[MOST_LINES * MOST_LINES] = {0};
        rqt_cells cells = {x, y, make_lines(WIDTH, qx, x) - 1, make_lines(HEIGHT, qy, y) - 1, marks};
        rqt_block_number last = 0;
        assert_int_equal(store_mark(s, t, eps, options, &cells, &last, NULL), SQLITE_OK);
        for (int j = 0; j < cells.rows; j++)
            for (int i = 0; i < cells.columns; i++) {
                const int32_t box[4] = {qx[i], qx[i + 1], qy[j], qy[j + 1]};
                const double area = area_in_cell(&patch, box);
                const uint8_t mark = marks[j * cells.columns + i];
                CHECK(mark == (area > 1e-9), "seed %llu: mark %d of %g..%g by %g..%g at %g, and triangles have %g",
                      (unsigned long long)seed, mark, box[0] / 4.0, box[1] / 4.0, box[2] / 4.0, box[3] / 4.0, eps,
                      area);
                seen->marked += mark;
                seen->cells++;
            }
        if (g == 0 && below(3) == 0) check_steps(s, t, eps, options, &cells, seen);
    }
    rqt_patch_free(&patch);
    rqt_region_free(everything);
}

static void cells_are_marked_where_the_mesh_has_triangles(void **unused) {
    (void)unused;
    static const double eps[] = {0, 4, 12, 20, 30, 45, 70, 110, 200, 400, 1e9};
    tally seen = {0};
    for (int n = 0; n < 20; n++) {
        raster r = make_coast();
        sqlite3 *db = open_database(":memory:");
        store *s;
        const store_terrain *t;
        run(db, "BEGIN IMMEDIATE");
        assert_int_equal(write_terrain(db, &r, "t", 1 + n % 4, false, true, NULL), SQLITE_OK);
        run(db, "COMMIT");
        assert_int_equal(store_open(db, &s), SQLITE_OK);
        assert_int_equal(store_find(s, "t", &t, NULL), SQLITE_OK);
        for (int kind = 0; kind < RULES; kind++) {
            rqt_rule *rule = make_rule(t, kind);
            const store_query_options options = {.outline = n % 2 ? RQT_OUTLINE_EXACT : RQT_OUTLINE_TOL,
                                                 .rule = rule};
            for (size_t e = 0; e < sizeof eps / sizeof *eps; e++) check_grids(s, t, eps[e], &options, &seen);
            rqt_rule_free(rule);
        }
        store_close(s);
        sqlite3_close(db);
        raster_free(&r);
    }
    print_message("%d cells, %d marked; %d times gone on with\n", seen.cells, seen.marked, seen.stops);
    assert_true(seen.marked > seen.cells / 5 && seen.marked < seen.cells / 5 * 4);
    assert_true(seen.stops > 100);
}

int main(void) {
    const char *given = getenv("RQT_SEED");
    seed = given ? strtoull(given, NULL, 10) : 1;
    state = seed * UINT64_C(0x9E3779B97F4A7C15);
    print_message("seed %llu\n", (unsigned long long)seed);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cells_are_marked_where_the_mesh_has_triangles),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
