/* test_store_normals.c - normals at the vertices of a patch: what the definition says at each, worked out here from
 * the raster itself, and each block read once. (Degrees, units and files are tests/test_sql_normals.py's.) */
#include "test_store_support.h"

static bool is_valid(const raster *r, int col, int row) {
    return col >= 0 && row >= 0 && col < r->width && row < r->height &&
           (!r->valid || r->valid[row * r->width + col]);
}

/* Quanta a sample, doubled. */
static int slope_of(const raster *r, int col, int row, int east, int south) {
    const int here = row * r->width + col, step = south * r->width + east;
    const bool before = is_valid(r, col - east, row - south), after = is_valid(r, col + east, row + south);
    if (before && after) return r->q[here + step] - r->q[here - step];
    if (after) return 2 * (r->q[here + step] - r->q[here]);
    if (before) return 2 * (r->q[here] - r->q[here - step]);
    return 0;
}

static void check_normals(const raster *r, const rqt_patch *patch, const float *normals) {
    for (size_t v = 0; v < patch->vertex_count; v++) {
        const int col = patch->vertices[v].col, row = patch->vertices[v].row;
        /* A quarter of a metre a quantum, cells of 10 m; rows grow south. */
        const double x = -slope_of(r, col, row, 1, 0) / 80.0, y = slope_of(r, col, row, 0, 1) / 80.0;
        const double length = sqrt(x * x + y * y + 1), wanted[3] = {x / length, y / length, 1 / length};
        for (int axis = 0; axis < 3; axis++)
            CHECK(fabs(normals[3 * v + (size_t)axis] - wanted[axis]) < 1e-6, "(%d,%d): axis %d is %g, should be %g",
                  col, row, axis, normals[3 * v + (size_t)axis], wanted[axis]);
    }
}

static int count_statement(unsigned kind, void *context, void *statement, void *text) {
    (void)kind, (void)text;
    if (strstr(sqlite3_sql(statement), "SELECT data")) ++*(int *)context;
    return 0;
}

static void normals_are_those_of_the_grid_and_each_block_is_read_once(void **state) {
    (void)state;
    static const int sizes[][3] = {{33, 33, 2}, {41, 34, 3}, {17, 5, 1}, {9, 40, 2},
                                   {2, 2, 0},   {1, 7, 1},   {30, 30, 4}};
    for (int n = 0; n < 2 * (int)(sizeof sizes / sizeof *sizes); n++) {
        const int *size = sizes[n / 2];
        raster r = make_raster(size[0], size[1], 1, n % 2);
        sqlite3 *db = memory_terrain(size[0], size[1], size[2], n % 2);
        for (int eps = 0; eps < 12; eps += 5) {
            store *s;
            const store_terrain *t;
            rqt_region *region;
            rqt_patch patch = {0};
            float *normals;
            int reads = 0;
            const store_query_options options = {.outline = RQT_OUTLINE_EXACT};
            assert_int_equal(store_open(db, &s), SQLITE_OK);
            assert_int_equal(store_find(s, "t", &t, NULL), SQLITE_OK);
            assert_int_equal(rqt_region_create(NULL, &t->placement, &t->lattice, store_allocator(), &region),
                             RQT_OK);
            assert_int_equal(store_query(s, t, region, eps, &options, &patch, NULL, NULL), SQLITE_OK);
            store_close(s); /* and with it the cache */
            assert_int_equal(store_open(db, &s), SQLITE_OK);
            assert_int_equal(store_find(s, "t", &t, NULL), SQLITE_OK);
            sqlite3_trace_v2(db, SQLITE_TRACE_STMT, count_statement, &reads);
            assert_int_equal(store_normals(s, t, &patch, &normals, NULL), SQLITE_OK);
            sqlite3_trace_v2(db, 0, NULL, NULL);
            const int across = size[0] > 1 ? ((size[0] - 2) >> size[2]) + 1 : 1,
                      down = size[1] > 1 ? ((size[1] - 2) >> size[2]) + 1 : 1;
            CHECK(reads <= across * down, "%d reads of %d blocks", reads, across * down);
            check_normals(&r, &patch, normals);
            sqlite3_free(normals);
            rqt_patch_free(&patch);
            rqt_region_free(region);
            store_close(s);
        }
        raster_free(&r);
        sqlite3_close(db);
    }
}

/* Vertices in any order, and twice: the answer is the same for each. */
static void the_order_of_vertices_does_not_matter(void **state) {
    (void)state;
    sqlite3 *db = memory_terrain(41, 34, 3, true);
    raster r = make_raster(41, 34, 1, true);
    store *s;
    const store_terrain *t;
    rqt_patch_vertex vertices[500];
    rqt_patch patch = {.vertices = vertices};
    float *normals;
    while (patch.vertex_count < 500) {
        const uint32_t h = noise((uint32_t)patch.vertex_count, 7, 9);
        const int col = (int)(h % 41), row = (int)(h / 64 % 34);
        vertices[patch.vertex_count++] =
            is_valid(&r, col, row) ? (rqt_patch_vertex){.col = col, .row = row} : (rqt_patch_vertex){.col = 40};
    }
    assert_true(is_valid(&r, 40, 0));
    assert_int_equal(store_open(db, &s), SQLITE_OK);
    assert_int_equal(store_find(s, "t", &t, NULL), SQLITE_OK);
    assert_int_equal(store_normals(s, t, &patch, &normals, NULL), SQLITE_OK);
    check_normals(&r, &patch, normals);
    sqlite3_free(normals);
    store_close(s);
    sqlite3_close(db);
    raster_free(&r);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(normals_are_those_of_the_grid_and_each_block_is_read_once),
        cmocka_unit_test(the_order_of_vertices_does_not_matter),
    };
    return cmocka_run_group_tests_name("store: normals", tests, NULL, NULL);
}
