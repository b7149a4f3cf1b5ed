/* test_profile.c - the walk of a line over a mesh, under the sanitizers too. tests/test_sql_geodesy.py has the
 * oracle in fractions; here the meshes are grids, whose edges everybody knows. Links: core, cmocka. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "rqt.h"

enum { SIDE = 6 };

static int refuse_after; /* allocations; -1: never */
static long held;

static void *resize(void *context, void *p, size_t bytes) {
    (void)context;
    if (bytes == 0) {
        held -= p != NULL;
        free(p);
        return NULL;
    }
    if (refuse_after == 0) return NULL;
    if (refuse_after > 0) refuse_after--;
    held += p == NULL;
    return realloc(p, bytes);
}
static const rqt_allocator allocator = {resize, NULL};

/* All half cells of a grid with the diagonal from north-west to south-east; `hole`: the cells that are left out. */
static rqt_patch grid_patch(const bool hole[SIDE - 1][SIDE - 1]) {
    static rqt_patch_vertex vertices[SIDE * SIDE];
    static uint32_t triangles[6 * (SIDE - 1) * (SIDE - 1)];
    rqt_patch p = {.vertices = vertices, .vertex_count = SIDE * SIDE, .triangles = triangles};
    for (int i = 0; i < SIDE * SIDE; i++)
        vertices[i] = (rqt_patch_vertex){.col = i % SIDE, .row = i / SIDE, .q = 1000 * (i * i % 37)};
    for (uint32_t y = 0; y < SIDE - 1; y++)
        for (uint32_t x = 0; x < SIDE - 1; x++) {
            if (hole && hole[y][x]) continue;
            const uint32_t nw = y * SIDE + x, two[6] = {nw, nw + SIDE, nw + SIDE + 1, nw, nw + SIDE + 1, nw + 1};
            memcpy(triangles + 3 * p.triangle_count, two, sizeof two);
            p.triangle_count += 2;
        }
    return p;
}

static double height(double x, double y) {
    static rqt_patch_vertex all[SIDE * SIDE];
    const rqt_patch p = grid_patch(NULL);
    memcpy(all, p.vertices, sizeof all);
    int i = (int)x, j = (int)y;
    if (i > SIDE - 2) i = SIDE - 2;
    if (j > SIDE - 2) j = SIDE - 2;
    const double u = x - i, v = y - j, nw = all[j * SIDE + i].q, ne = all[j * SIDE + i + 1].q,
                 sw = all[(j + 1) * SIDE + i].q, se = all[(j + 1) * SIDE + i + 1].q;
    return u > v ? nw + u * (ne - nw) + v * (se - ne) : nw + v * (sw - nw) + u * (se - sw);
}

static rqt_status build(const rqt_patch *patch, const double *xy, const uint8_t *own, size_t points, double period,
                        rqt_profile_row **rows, size_t *count) {
    rqt_lattice lattice;
    assert_int_equal(rqt_lattice_init(&lattice, SIDE, SIDE), RQT_OK);
    uint8_t ends[64] = {0};
    ends[points - 1] = 1;
    const rqt_profile_line line = {
        .xy = xy, .ends = ends, .own = own, .points = points, .placement = {0, 0, 1, 1}, .period = period};
    return rqt_profile_build(patch, &lattice, &line, &allocator, rows, count);
}

static bool is_whole(double v) {
    return fabs(v - rint(v)) < 1e-9;
}

/* How often the segment's inside, and its first end, meet lines of the grid: places counted once. */
static int places_on(const double *a, const double *b) {
    double t[200];
    int n = 0;
    for (int k = -SIDE; k <= 2 * SIDE; k++) {
        const double from[3] = {a[0], a[1], a[0] - a[1]}, to[3] = {b[0], b[1], b[0] - b[1]};
        for (int i = 0; i < 3; i++) {
            if (from[i] == to[i]) continue;
            const double at = (k - from[i]) / (to[i] - from[i]);
            if (at < 0 || at >= 1) continue;
            const double x = a[0] + at * (b[0] - a[0]), y = a[1] + at * (b[1] - a[1]);
            if (x < -1e-12 || y < -1e-12 || x > SIDE - 1 + 1e-12 || y > SIDE - 1 + 1e-12) continue;
            bool known = at < 1e-12; /* the first end has a row anyway */
            for (int j = 0; j < n; j++) known = known || fabs(t[j] - at) < 1e-9;
            if (!known) t[n++] = at;
        }
    }
    return n;
}

static uint64_t dice_state = 5;
static int dice(int below) {
    dice_state = dice_state * 6364136223846793005u + 1442695040888963407u;
    return (int)((dice_state >> 33) % (uint64_t)below);
}

static void rows_are_where_a_line_meets_edges(void **state) {
    (void)state;
    const char *seed = getenv("RQT_SEED");
    if (seed) dice_state = strtoull(seed, NULL, 10);
    print_message("RQT_SEED=%llu\n", (unsigned long long)dice_state);
    const rqt_patch patch = grid_patch(NULL);
    for (int n = 0; n < 2000; n++) {
        double xy[8];
        uint8_t own[4];
        const int grain = n % 2 ? 4 : 64; /* coarse ones pass through vertices, along edges, and bend on edges */
        for (int i = 0; i < 8; i++) xy[i] = dice((SIDE - 1) * grain + 1) / (double)grain;
        for (int i = 0; i < 4; i++) own[i] = i == 0 || i == 3 || n % 3 == 0;
        rqt_profile_row *rows;
        size_t count;
        assert_int_equal(build(&patch, xy, own, 4, 0, &rows, &count), RQT_OK);
        int expected = 0;
        for (int i = 0; i < 4; i++) {
            const double *p = xy + 2 * i, *q = i < 3 ? p + 2 : p;
            const bool on_edge = is_whole(p[0]) || is_whole(p[1]) || is_whole(p[0] - p[1]);
            /* A bend inside an edge that the line runs along would have no row: both pieces are of the grid's
             * lines. */
            bool along = on_edge && !own[i] && !(is_whole(p[0]) && is_whole(p[1]));
            if (along) {
                const bool x = is_whole(p[0]) && p[0] == q[0], y = is_whole(p[1]) && p[1] == q[1],
                           d = is_whole(p[0] - p[1]) && p[0] - p[1] == q[0] - q[1];
                along = (x || y || d) && !(p[0] == q[0] && p[1] == q[1]);
            }
            expected += (own[i] || (on_edge && !along)) + places_on(p, q);
        }
        if ((int)count != expected) fail_msg("line %d: %zu rows, not %d", n, count, expected);
        for (size_t i = 0; i < count; i++) {
            assert_false(rows[i].after_gap);
            if (fabs(rows[i].q - height(rows[i].col, rows[i].row)) > 1e-6)
                fail_msg("line %d row %zu: %g at %g %g", n, i, rows[i].q, rows[i].col, rows[i].row);
            assert_true(i == 0 || rows[i].point > rows[i - 1].point ||
                        (rows[i].point == rows[i - 1].point && rows[i].t >= rows[i - 1].t));
        }
        resize(NULL, rows, 0);
    }
    assert_int_equal(held, 0);
}

static void gaps_are_where_there_is_no_mesh(void **state) {
    (void)state;
    bool hole[SIDE - 1][SIDE - 1] = {{false}};
    hole[2][1] = hole[2][2] = true;
    const rqt_patch patch = grid_patch((const bool(*)[SIDE - 1]) hole);
    const uint8_t own[3] = {1, 1, 1};
    static const struct {
        double xy[4];
        int gaps;
    } lines[] = {{{0, 2.5, 5, 2.5}, 1},       {{1.5, 0, 1.5, 5}, 1},  {{0, 2, 5, 2}, 0}, {{0, 3, 5, 3}, 0},
                 {{1.25, 2.5, 2.75, 2.5}, 0}, {{-3, 2.5, 9, 2.5}, 1}, {{1, 0, 1, 5}, 0}, {{4, 0, 4, 9}, 0}};
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++) {
        rqt_profile_row *rows;
        size_t count;
        assert_int_equal(build(&patch, lines[i].xy, own, 2, 0, &rows, &count), RQT_OK);
        int gaps = 0;
        for (size_t k = 0; k < count; k++) gaps += rows[k].after_gap;
        if (gaps != lines[i].gaps) fail_msg("line %zu: %d gaps", i, gaps);
        resize(NULL, rows, 0);
    }
    /* on the next turn it is the same */
    rqt_profile_row *rows, *turned;
    size_t count, turned_count;
    const double here[4] = {0.5, 0.25, 4.5, 4.75}, there[4] = {100.5, 0.25, 104.5, 4.75};
    assert_int_equal(build(&patch, here, own, 2, 0, &rows, &count), RQT_OK);
    assert_int_equal(build(&patch, there, own, 2, 100, &turned, &turned_count), RQT_OK);
    assert_int_equal(count, turned_count);
    for (size_t i = 0; i < count; i++) {
        assert_int_equal(turned[i].turn, -1);
        assert_true(rows[i].col == turned[i].col && rows[i].q == turned[i].q && rows[i].t == turned[i].t);
    }
    resize(NULL, rows, 0);
    resize(NULL, turned, 0);
    assert_int_equal(held, 0);
}

static void F48_refused_memory_is_reported_and_nothing_leaks(void **state) {
    (void)state;
    const rqt_patch patch = grid_patch(NULL);
    const double xy[6] = {0, 0.25, 5, 4, 0, 3};
    const uint8_t own[3] = {1, 1, 1};
    rqt_status status = RQT_NO_MEMORY;
    int n = 0;
    for (; status == RQT_NO_MEMORY; n++) {
        rqt_profile_row *rows;
        size_t count;
        refuse_after = n;
        status = build(&patch, xy, own, 3, 0, &rows, &count);
        refuse_after = -1;
        if (status == RQT_OK)
            resize(NULL, rows, 0);
        else
            assert_null(rows);
        assert_int_equal(held, 0);
    }
    assert_int_equal(status, RQT_OK);
    assert_true(n > 4);
}

int main(void) {
    refuse_after = -1;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rows_are_where_a_line_meets_edges),
        cmocka_unit_test(gaps_are_where_there_is_no_mesh),
        cmocka_unit_test(F48_refused_memory_is_reported_and_nothing_leaks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
