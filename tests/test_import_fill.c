/* test_import_fill.c - promises of --fill and --sea: which voids become heights and which heights is what a slow
 * look at the whole raster says, for every radius, memory and number of jobs; planes are continued; and every
 * sample that was no data is found in rqt_fill_N, is checked, and goes with its terrain. */
#include "test_import_support.h"

#include <signal.h>

#include "parts.h"

enum { VALID, VOID, FILLED, SEA };

typedef struct land {
    int width, height;
    double *values; /* whole metres; NaN: void */
    int *kind;      /* what the oracle says of each sample */
    double *wanted;
} land;

/* ------------------------------------------------------------------------------------------------- the oracle --
 * One component after the other, by flooding the whole raster. */
static int flood(const land *l, int *mark, int number, int x, int y, int box[4]) {
    static int stack[2 * 100 * 100];
    int n = 0, cells = 0;
    stack[n++] = y * l->width + x;
    mark[y * l->width + x] = number;
    box[0] = box[2] = x;
    box[1] = box[3] = y;
    while (n) {
        const int at = stack[--n], u = at % l->width, v = at / l->width;
        cells++;
        box[0] = u < box[0] ? u : box[0];
        box[1] = v < box[1] ? v : box[1];
        box[2] = u > box[2] ? u : box[2];
        box[3] = v > box[3] ? v : box[3];
        for (int dy = -1; dy <= 1; dy++)
            for (int dx = -1; dx <= 1; dx++) {
                const int p = u + dx, q = v + dy;
                if (p < 0 || q < 0 || p >= l->width || q >= l->height) continue;
                if (!isnan(l->values[q * l->width + p]) || mark[q * l->width + p]) continue;
                mark[q * l->width + p] = number;
                stack[n++] = q * l->width + p;
            }
    }
    return cells;
}

/* The mean of the nearest valid samples in four directions, by exact fractions over a common denominator. */
static double filled_value(const land *l, int x, int y) {
    static const int dx[] = {-1, 1, 0, 0}, dy[] = {0, 0, -1, 1};
    __extension__ __int128 up = 0, down = 0, all = 1;
    int distance[4];
    double height[4];
    int n = 0;
    for (int way = 0; way < 4; way++)
        for (int step = 1;; step++) {
            const int u = x + dx[way] * step, v = y + dy[way] * step;
            if (u < 0 || v < 0 || u >= l->width || v >= l->height) break;
            if (isnan(l->values[v * l->width + u])) continue;
            distance[n] = step;
            height[n++] = l->values[v * l->width + u];
            break;
        }
    for (int i = 0; i < n; i++) all *= distance[i];
    for (int i = 0; i < n; i++) {
        up += all / distance[i] * (int64_t)height[i];
        down += all / distance[i];
    }
    /* The largest whole number not above up/down + 1/2. */
    __extension__ __int128 z = (2 * up + down) / (2 * down);
    while (z * 2 * down > 2 * up + down) z--;
    while ((z + 1) * 2 * down <= 2 * up + down) z++;
    return (double)z;
}

static void look_at_voids(land *l, int radius, bool sea, double sea_z) {
    int *mark = calloc((size_t)(l->width * l->height), sizeof *mark), number = 0;
    for (int i = 0; i < l->width * l->height; i++) {
        l->kind[i] = VALID;
        l->wanted[i] = l->values[i];
    }
    for (int y = 0; y < l->height; y++)
        for (int x = 0; x < l->width; x++) {
            int box[4];
            if (!isnan(l->values[y * l->width + x]) || mark[y * l->width + x]) continue;
            flood(l, mark, ++number, x, y, box);
            const bool opposite =
                (box[0] == 0 && box[2] == l->width - 1) || (box[1] == 0 && box[3] == l->height - 1);
            const bool small = radius > 0 && !opposite && box[2] - box[0] + 1 <= 2 * radius + 1 &&
                               box[3] - box[1] + 1 <= 2 * radius + 1;
            for (int i = 0; i < l->width * l->height; i++) {
                if (mark[i] != number) continue;
                l->kind[i] = small ? FILLED : sea ? SEA : VOID;
                l->wanted[i] = small ? filled_value(l, i % l->width, i / l->width) : sea ? sea_z : NAN;
            }
        }
    free(mark);
}

/* ------------------------------------------------------------------------------------------------- the promise --
 */
static void expect_table(const char *database, const land *l) {
    sqlite3 *db;
    sqlite3_stmt *s;
    int *kind = calloc((size_t)(l->width * l->height), sizeof *kind);
    int row = -1, last = -1, any = 0;
    for (int i = 0; i < l->width * l->height; i++) any |= l->kind[i] >= FILLED;
    assert_int_equal(sqlite3_open_v2(database, &db, SQLITE_OPEN_READONLY, NULL), SQLITE_OK);
    const int code =
        sqlite3_prepare_v2(db, "SELECT row, col0, col1, kind FROM rqt_fill_1 ORDER BY id", -1, &s, NULL);
    assert_int_equal(code == SQLITE_OK, any); /* no table when there is nothing in it */
    while (s && sqlite3_step(s) == SQLITE_ROW) {
        const int y = sqlite3_column_int(s, 0), first = sqlite3_column_int(s, 1), end = sqlite3_column_int(s, 2);
        assert_true(y > row || (y == row && first > last));
        row = y, last = end;
        for (int x = first; x <= end; x++) kind[y * l->width + x] = sqlite3_column_int(s, 3);
    }
    sqlite3_finalize(s);
    for (int i = 0; i < l->width * l->height; i++) {
        const int wanted = l->kind[i] == FILLED ? STORE_FILLED : l->kind[i] == SEA ? STORE_SEA : 0;
        if (kind[i] != wanted) fail_msg("sample %d is noted as %d and not as %d", i, kind[i], wanted);
    }
    free(kind);
    sqlite3_close(db);
}

static bool find_nothing(void *context, const store_finding *finding) {
    snprintf(context, 300, "%s", finding->message);
    return true;
}

static void expect_sound(const char *database, const char *phrase) {
    terrain t = open_terrain(database, NULL);
    store_terrain *list;
    int n;
    char found[300] = "", *error = NULL;
    assert_int_equal(store_terrains(t.store, &list, &n, &error), SQLITE_OK);
    assert_int_equal(store_check(t.store, &list[0], find_nothing, found, &error), SQLITE_OK);
    store_terrains_free(list, n);
    if (*phrase ? !strstr(found, phrase) : *found) fail_msg("the check says '%s' and not '%s'", found, phrase);
    close_terrain(&t);
}

static land make_land(int width, int height) {
    const size_t n = (size_t)(width * height);
    land l = {.width = width, .height = height};
    l.values = malloc(n * sizeof *l.values);
    l.kind = malloc(n * sizeof *l.kind);
    l.wanted = malloc(n * sizeof *l.wanted);
    fill(l.values, width, height, 1);
    for (size_t i = 0; i < n; i++) l.values[i] -= 320; /* below zero, too */
    return l;
}

static void free_land(land *l) {
    free(l->values);
    free(l->kind);
    free(l->wanted);
}

static void write_land(const land *l, const char *name) {
    double *values = malloc(sizeof *values * (size_t)(l->width * l->height));
    for (int i = 0; i < l->width * l->height; i++) values[i] = isnan(l->values[i]) ? -9999 : l->values[i];
    raster r = {.name = name, .width = l->width, .height = l->height, .type = GDT_Int16, .nodata = "-9999"};
    write_raster(&r, values);
    free(values);
}

/* Two ways of reading, several sizes and numbers of everything: all as the oracle says, and alike. */
static void expect_filled(land *l, int radius, bool sea, double sea_z, unsigned way) {
    look_at_voids(l, radius, sea, sea_z);
    write_land(l, "a.tif");
    import_options o = defaults();
    const char *source = file("a.tif");
    o.k = 2;
    o.fill = radius;
    o.has_sea = sea;
    o.sea = sea_z;
    o.jobs = 1 + (int)(way % 3);
    rqt_lattice lattice;
    assert_int_equal(rqt_lattice_init(&lattice, l->width, l->height), RQT_OK);
    const import_force force = {.in_memory = way % 2,
                                .two_readings = !(way % 2),
                                .b = lattice.K >= 4 ? 2 + (int)(way % 3) : 0,
                                .strip_rows = 1 + (int)(way % 11),
                                .stage = -1,
                                .kept = -1};
    VSIUnlink(file("a.gpkg"));
    if (import_run_forced(&source, 1, file("a.gpkg"), &o, &force, &report, message, sizeof message))
        fail_msg("%s", message);
    int64_t counts[4] = {0};
    for (int i = 0; i < l->width * l->height; i++) counts[l->kind[i]]++;
    assert_int_equal(report.voids, counts[VOID]);
    assert_int_equal(report.filled, counts[FILLED]);
    assert_int_equal(report.sea, counts[SEA]);
    expect_file_metres(file("a.gpkg"), l->wanted);
    expect_table(file("a.gpkg"), l);
    terrain t = open_terrain(file("a.gpkg"), NULL);
    int64_t told[2];
    char *error = NULL;
    assert_int_equal(store_fill_counts(t.store, t.t, told, &error), SQLITE_OK);
    assert_int_equal(told[0], counts[FILLED]);
    assert_int_equal(told[1], counts[SEA]);
    assert_int_equal(t.t->voids, counts[VOID]);
    close_terrain(&t);
}

static void voids_are_filled_as_a_slow_look_says(void **unused) {
    (void)unused;
    const int seed = getenv("RQT_SEED") ? atoi(getenv("RQT_SEED")) : 1;
    print_message("RQT_SEED=%d\n", seed);
    state = (uint32_t)seed;
    static const double density[] = {0.02, 0.15, 0.35, 0.6};
    for (unsigned turn = 0; turn < 60; turn++) {
        land l = make_land(1 + (int)(uniform() * 50), 1 + (int)(uniform() * 50));
        const int blobs = (int)(uniform() * 6);
        for (int i = 0; i < l.width * l.height; i++)
            if (uniform() < density[turn % 4] * (turn % 5 ? 1 : 0)) l.values[i] = NAN;
        for (int b = 0; b < blobs; b++) {
            const double x = uniform() * l.width, y = uniform() * l.height, r = 1 + uniform() * 6;
            for (int i = 0; i < l.width * l.height; i++)
                if (hypot(i % l.width - x, i / l.width - y) < r) l.values[i] = NAN;
        }
        static const int radius[] = {0, 1, 2, 5, 9, 255};
        expect_filled(&l, radius[turn % 6], turn % 3 == 0, turn % 2 ? 0 : -1234, turn);
        if (turn % 4 == 0) expect_sound(file("a.gpkg"), "");
        free_land(&l);
    }
}

/* Squares of 2R + 1 are filled, one sample more is not; at the edge too, unless two opposite ones are met. */
static void a_void_of_radius_r_is_filled_and_no_larger_one(void **unused) {
    (void)unused;
    land l = make_land(70, 60);
    for (int y = 0; y < l.height; y++)
        for (int x = 0; x < l.width; x++) {
            const bool square = x >= 10 && x < 17 && y >= 10 && y < 17,
                       longer = x >= 30 && x < 38 && y >= 10 && y < 17, edge = x >= 66 && y >= 20 && y < 24,
                       corner = x < 3 && y < 3, diagonal = x - 20 == y - 40 && x >= 20 && x < 27,
                       line = y == 30 && x >= 40 && x < 48;
            if (square || longer || edge || corner || diagonal || line) l.values[y * l.width + x] = NAN;
        }
    expect_filled(&l, 3, false, 0, 0);
    const int at[][3] = {{13, 13, FILLED}, {33, 13, VOID},   {69, 22, FILLED},
                         {0, 0, FILLED},   {23, 43, FILLED}, {44, 30, VOID}};
    for (size_t i = 0; i < LENGTH(at); i++) assert_int_equal(l.kind[at[i][1] * l.width + at[i][0]], at[i][2]);
    expect_filled(&l, 4, true, 7, 1);
    for (int i = 0; i < l.width * l.height; i++) assert_true(l.kind[i] == VALID || l.kind[i] == FILLED);
    free_land(&l);
}

static void a_plane_is_continued_through_its_voids(void **unused) {
    (void)unused;
    land l = make_land(40, 40);
    for (int i = 0; i < 1600; i++) l.values[i] = 3 * (i % 40) - 7 * (i / 40);
    for (int i = 0; i < 1600; i++)
        if (hypot(i % 40 - 20, i / 40 - 19) < 6) l.values[i] = NAN;
    expect_filled(&l, 6, false, 0, 2);
    for (int i = 0; i < 1600; i++) assert_true(l.wanted[i] == 3 * (i % 40) - 7 * (i / 40));
    free_land(&l);
}

static void a_whole_sea_and_heights_between_steps(void **unused) {
    (void)unused;
    land l = make_land(20, 17);
    for (int i = 0; i < 20 * 17; i++) l.values[i] = NAN;
    expect_filled(&l, 255, true, 12, 0);
    expect_filled(&l, 255, false, 0, 1);
    write_land(&l, "a.tif");
    import_options o = defaults();
    o.has_sea = true;
    o.sea = 0.4;
    o.replace = true;
    import_fine(file("a.tif"), file("a.gpkg"), &o);
    if (!strstr(notices, "the sea lies at 0 m: the terrain's heights are steps of 1 m")) fail_msg("%s", notices);
    o.sea = 1e12;
    import_refused(file("a.tif"), file("a.gpkg"), &o, "is too far from the terrain's heights");
    o.has_sea = false;
    o.fill = 256;
    import_refused(file("a.tif"), file("a.gpkg"), &o, "voids of radius 256 cannot be filled: 0 to 255");
    free_land(&l);
}

static void execute(const char *sql) {
    sqlite3 *db;
    char *error = NULL;
    assert_int_equal(sqlite3_open(file("a.gpkg"), &db), SQLITE_OK);
    if (sqlite3_exec(db, sql, NULL, NULL, &error)) fail_msg("%s: %s", sql, error);
    sqlite3_close(db);
}

static void the_table_is_checked_and_goes_with_its_terrain(void **unused) {
    (void)unused;
    static const struct {
        const char *sql, *phrase;
    } lies[] = {{"UPDATE rqt_fill_1 SET col1 = 1000 WHERE id = 1", "is none of this terrain"},
                {"UPDATE rqt_fill_1 SET kind = 3 WHERE id = 2", "is none of this terrain"},
                {"UPDATE rqt_fill_1 SET row = -1 WHERE id = 1", "is none of this terrain"},
                {"UPDATE rqt_fill_1 SET row = 0, col0 = 0, col1 = 0 WHERE id = 3", "is out of order"},
                {"UPDATE rqt_fill_1 SET kind = 2", "the sea has another height"},
                {"UPDATE rqt_fill_1 SET row = 9, col0 = 5, col1 = 40 WHERE id = (SELECT max(id) FROM rqt_fill_1)",
                 "is void"},
                {"UPDATE rqt_fill_1 SET (row, col0, col1) = (SELECT row, col0, col1 FROM rqt_fill_1 WHERE id = 1) "
                 "WHERE id = 2",
                 "is out of order"}};
    land l = make_land(50, 40);
    for (int i = 0; i < 2000; i++)
        if ((i % 50 > 20 && i % 50 < 24 && i / 50 < 9) || (i / 50 == 9 && i % 50 >= 5 && i % 50 < 40))
            l.values[i] = NAN;
    for (int i = 0; i < 2000; i += 90) l.values[i] = i / 50 < 7 ? NAN : l.values[i];
    for (size_t i = 0; i < LENGTH(lies); i++) {
        expect_filled(&l, 2, false, 0, (unsigned)i);
        execute(lies[i].sql);
        expect_sound(file("a.gpkg"), lies[i].phrase);
    }
    /* Replaced by a terrain without: no table is left, nor a line about it. */
    import_options o = defaults();
    o.replace = true;
    import_fine(file("a.tif"), file("a.gpkg"), &o);
    char *left =
        dump(file("a.gpkg"), "SELECT count(*), count(*) FROM (SELECT name FROM sqlite_schema WHERE name LIKE "
                             "'rqt_fill%' UNION ALL SELECT table_name FROM gpkg_contents WHERE table_name "
                             "LIKE 'rqt_fill%')");
    assert_string_equal(left, "30 30 \n");
    sqlite3_free(left);
    free_land(&l);
}

/* ---------------------------------------------------------------------------------------------------- void-tol --
 */
/* Samples that the mesh of outline tol covers, by whole numbers: on the left of, or on, each side. */
static size_t cover(store *s, const store_terrain *t, double eps, bool *covered) {
    rqt_region *region = NULL;
    rqt_patch patch = {0};
    char *error = NULL;
    const store_query_options options = {.outline = RQT_OUTLINE_TOL};
    const int width = t->lattice.width, height = t->lattice.height;
    memset(covered, 0, (size_t)(width * height));
    assert_int_equal(rqt_region_create(NULL, &t->placement, &t->lattice, store_allocator(), &region), RQT_OK);
    if (store_query(s, t, region, eps, &options, &patch, NULL, &error)) fail_msg("%s", error);
    for (size_t i = 0; i < patch.triangle_count; i++) {
        const rqt_patch_vertex *v[3];
        for (int n = 0; n < 3; n++) v[n] = &patch.vertices[patch.triangles[3 * i + (size_t)n]];
        for (int y = 0; y < height; y++)
            for (int x = 0; x < width; x++) {
                bool inside = true;
                for (int n = 0; n < 3 && inside; n++) {
                    const rqt_patch_vertex *a = v[n], *b = v[(n + 1) % 3];
                    /* Rows grow south: counter-clockwise from above is clockwise in columns and rows. */
                    inside =
                        (int64_t)(b->col - a->col) * (y - a->row) - (int64_t)(b->row - a->row) * (x - a->col) <= 0;
                }
                if (inside) covered[y * width + x] = true;
            }
    }
    const size_t vertices = patch.vertex_count;
    rqt_patch_free(&patch);
    rqt_region_free(region);
    return vertices;
}

/* What outline exact covers: samples of unit half cells with three valid corners. The diagonal of a cell goes
 * through the corner whose coordinates are both odd. */
static void cover_exactly(const land *l, bool *covered) {
    memset(covered, 0, (size_t)(l->width * l->height));
    for (int y = 0; y + 1 < l->height; y++)
        for (int x = 0; x + 1 < l->width; x++) {
            const int nw = y * l->width + x, ne = nw + 1, sw = nw + l->width, se = sw + 1;
            const bool main_diagonal = x % 2 == y % 2;
            const int halves[2][3] = {{main_diagonal ? nw : ne, main_diagonal ? se : sw, main_diagonal ? ne : nw},
                                      {main_diagonal ? nw : ne, main_diagonal ? se : sw, main_diagonal ? sw : se}};
            for (int h = 0; h < 2; h++) {
                const int *v = halves[h];
                if (isnan(l->values[v[0]]) || isnan(l->values[v[1]]) || isnan(l->values[v[2]])) continue;
                covered[v[0]] = covered[v[1]] = covered[v[2]] = true;
            }
        }
}

/* A sample that the mesh gains or loses lies within c * eps metres of one of the other kind: the outline has moved
 * by no more. Cells are 10 m. And it is worth having: with a larger c there are fewer vertices. */
static void void_tol_moves_an_outline_by_at_most_c_eps(void **unused) {
    (void)unused;
    static const double c[] = {0.5, 1, 4}, eps[] = {0, 10, 40, 160};
    enum { SIDE = 65 };
    static bool covered[SIDE * SIDE], exact[SIDE * SIDE];
    int moved = 0;
    land l = make_land(SIDE, SIDE);
    for (int i = 0; i < SIDE * SIDE; i++) {
        l.values[i] /= 20; /* gentle: the outline is what counts */
        l.values[i] = rint(l.values[i]);
        const int x = i % SIDE, y = i / SIDE;
        if (hypot(x - 20, y - 30) < 9 + 3 * sin(x * 0.9) || x + y > 105 + 4 * sin(y * 0.7)) l.values[i] = NAN;
    }
    write_land(&l, "a.tif");
    cover_exactly(&l, exact);
    for (size_t e = 0; e < LENGTH(eps); e++) {
        size_t before = SIZE_MAX;
        for (size_t n = 0; n < LENGTH(c); n++) {
            import_options o = defaults();
            o.void_tol = c[n];
            o.replace = true;
            import_fine(file("a.tif"), file("a.gpkg"), &o);
            terrain t = open_terrain(file("a.gpkg"), NULL);
            assert_true(t.t->cost.c == c[n] && fabs(t.t->cost.cell - 10) < 1e-9);
            const size_t vertices = cover(t.store, t.t, eps[e], covered);
            assert_true(vertices <= before);
            before = vertices;
            const int reach = (int)floor(c[n] * eps[e] / 10);
            for (int i = 0; i < SIDE * SIDE; i++) {
                if (covered[i] == exact[i]) continue;
                moved++;
                bool near = false;
                for (int y = i / SIDE - reach; y <= i / SIDE + reach && !near; y++)
                    for (int x = i % SIDE - reach; x <= i % SIDE + reach && !near; x++)
                        near = x >= 0 && y >= 0 && x < SIDE && y < SIDE &&
                               (exact[y * SIDE + x] != exact[i] ||
                                isnan(l.values[y * SIDE + x]) != isnan(l.values[i]));
                if (!near)
                    fail_msg("c %g, eps %g: sample %d, %d is %scovered, and farther than %d from the outline", c[n],
                             eps[e], i % SIDE, i / SIDE, covered[i] ? "" : "not ", reach);
            }
            close_terrain(&t);
        }
    }
    assert_true(moved > 100);
    free_land(&l);
}

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(name) cmocka_unit_test_setup(name, begin)
        TEST(voids_are_filled_as_a_slow_look_says),           TEST(a_void_of_radius_r_is_filled_and_no_larger_one),
        TEST(a_plane_is_continued_through_its_voids),         TEST(a_whole_sea_and_heights_between_steps),
        TEST(the_table_is_checked_and_goes_with_its_terrain), TEST(void_tol_moves_an_outline_by_at_most_c_eps),
    };
    alarm(600); /* threads that wait for each other for ever are a failure too */
    return cmocka_run_group_tests(tests, begin_all, end_all);
}
