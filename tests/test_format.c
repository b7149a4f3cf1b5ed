/* test_format.c - a patch as bytes, read back: by a reader of each format written from its specification, by OGR,
 * and by mod_spatialite where it is installed; and what cannot be written is refused.
 * Links: format.c, text.c, geometry.c, the core's code.c (or librqt.a), GDAL, SQLite, cmocka. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include <ogr_api.h>
#include <sqlite3.h>

#include "format.h"
#include "test_format_support.h"

/* ----------------------------------------------------------------------------------------------- comparing -- */

static int compare_doubles(const double *a, const double *b, size_t n) {
    for (size_t i = 0; i < n; i++)
        if (a[i] != b[i]) return a[i] < b[i] ? -1 : 1;
    return 0;
}

static int compare_triangles(const void *a, const void *b) {
    return compare_doubles(a, b, 9);
}

/* The smallest corner first, the direction kept; then all in order. */
static void normalize(triangles *t) {
    for (size_t i = 0; i < t->n; i++) {
        double(*c)[3] = t->corner + 3 * i, turned[3][3];
        size_t first = 0;
        for (size_t j = 1; j < 3; j++)
            if (compare_doubles(c[j], c[first], 3) < 0) first = j;
        for (size_t j = 0; j < 3; j++) memcpy(turned[j], c[(first + j) % 3], sizeof *c);
        memcpy(c, turned, sizeof turned);
    }
    qsort(t->corner, t->n, sizeof(double[3][3]), compare_triangles);
}

static void triangles_of(const sample_patch *s, triangles *t) {
    memset(t, 0, sizeof *t);
    triangles_begin(t, s->patch.triangle_count);
    for (size_t i = 0; i < 3 * t->n; i++)
        true_coordinates(&s->frame, &s->patch.vertices[s->patch.triangles[i]], t->corner[i]);
    for (size_t i = 0; i < 3 * t->n; i++)
        for (int axis = 0; axis < 2; axis++) {
            double v = t->corner[i][axis];
            t->box[axis] = i ? fmin(t->box[axis], v) : v;
            t->box[axis + 2] = i ? fmax(t->box[axis + 2], v) : v;
        }
}

static void check_equal(const sample_patch *s, triangles *read) {
    triangles right;
    triangles_of(s, &right);
    assert_int_equal(read->n, right.n);
    for (size_t i = 0; i < read->n; i++) {
        double(*c)[3] = read->corner + 3 * i;
        double twice = (c[1][0] - c[0][0]) * (c[2][1] - c[0][1]) - (c[2][0] - c[0][0]) * (c[1][1] - c[0][1]);
        assert_true(twice > 0);
    }
    normalize(read);
    normalize(&right);
    assert_memory_equal(read->corner, right.corner, (3 * right.n + 1) * sizeof *right.corner);
    if (read->has_box) assert_memory_equal(read->box, right.box, sizeof right.box);
    free(right.corner);
}

/* --------------------------------------------------------------------------------------------------- tests -- */

static const format_kind kinds[] = {FORMAT_OBJ, FORMAT_PLY, FORMAT_WKB, FORMAT_GPKG, FORMAT_SPATIALITE};
enum { KINDS = sizeof kinds / sizeof *kinds };

static void test_names(void **state) {
    (void)state;
    static const char *const names[] = {"obj", "ply", "wkb", "gpkg", "spatialite", "glb"};
    for (int i = 0; i <= KINDS; i++) {
        format_kind kind = (format_kind)99;
        assert_true(format_from_name(names[i], &kind));
        assert_int_equal(kind, i < KINDS ? kinds[i] : FORMAT_GLB);
    }
    format_kind kind = FORMAT_WKB;
    static const char *const none[] = {"",        "OBJ", "ob",          "objx", "strip",
                                       "indexed", "GLB", "glb+normals", " ply", NULL};
    for (size_t i = 0; i < sizeof none / sizeof *none; i++) assert_false(format_from_name(none[i], &kind));
    assert_int_equal(kind, FORMAT_WKB);
}

static void test_formats_read_back(void **state) {
    (void)state;
    static const int counts[] = {1, 2, 3, 10, 997};
    static const int32_t srids[] = {4326, 0, 2056, -1, INT32_MAX};
    for (size_t c = 0; c < sizeof counts / sizeof *counts; c++)
        for (int k = 0; k < KINDS; k++) {
            sample_patch s;
            patch_begin(&s, counts[c], srids[c]);
            size_t size;
            uint8_t *bytes = write_patch(&s, kinds[k], &size);
            triangles t;
            read_any(kinds[k], bytes, size, &t);
            check_equal(&s, &t);
            if (kinds[k] == FORMAT_GPKG) {
                assert_int_equal(t.srid, srids[c] ? srids[c] : -1);
                assert_true(t.has_box);
                assert_false(t.says_empty);
            }
            if (kinds[k] == FORMAT_SPATIALITE) {
                assert_int_equal(t.srid, srids[c]);
                assert_true(t.has_box);
            }
            free(t.corner);
            release(&s, bytes);
            patch_end(&s);
        }
}

/* South-up and west-left placements, feet, a metric CRS: other expressions and negative boxes. */
static void test_placements(void **state) {
    (void)state;
    for (int round = 0; round < 40; round++) {
        sample_patch s;
        patch_begin(&s, 50, 21781);
        int sign = round % 2 ? 1 : -1; /* both signs turned keep triangles counter-clockwise */
        s.frame.placement =
            (rqt_placement){random_between(-3000000, 3000000) / 8.0, random_between(-3000000, 3000000) + 0.1,
                            sign * (0.5 + round * 0.1), -sign * (0.25 + round * 0.37)};
        s.frame.unit = (rqt_unit){
            random_between(-500, 500), round % 3 ? 1024 : 100, 1200, 3937, round % 5 ? 1 : -0.01, round * 1.1};
        for (int k = 0; k < KINDS; k++) {
            size_t size;
            uint8_t *bytes = write_patch(&s, kinds[k], &size);
            triangles t;
            read_any(kinds[k], bytes, size, &t);
            check_equal(&s, &t);
            free(t.corner);
            release(&s, bytes);
        }
        patch_end(&s);
    }
}

/* A vertex that no triangle uses belongs to the lists of vertices, not to the geometry's box. */
static void test_box_is_of_the_triangles(void **state) {
    (void)state;
    sample_patch s;
    patch_begin(&s, 2, 0);
    s.patch.triangle_count = 1;
    s.patch.vertices[3].col = 1000000;
    s.patch.vertices[3].row = -5;
    for (int k = 2; k < KINDS; k++) {
        size_t size;
        uint8_t *bytes = write_patch(&s, kinds[k], &size);
        triangles t;
        read_any(kinds[k], bytes, size, &t);
        check_equal(&s, &t);
        free(t.corner);
        release(&s, bytes);
    }
    patch_end(&s);
}

static void test_empty_patch(void **state) {
    (void)state;
    sample_patch s;
    patch_begin(&s, 0, 4326);
    for (int k = 0; k < KINDS; k++) {
        size_t size;
        uint8_t *bytes = write_patch(&s, kinds[k], &size);
        triangles t;
        read_any(kinds[k], bytes, size, &t);
        assert_int_equal(t.n, 0);
        assert_false(t.has_box);
        if (kinds[k] == FORMAT_GPKG) assert_true(t.says_empty);
        if (kinds[k] == FORMAT_GPKG || kinds[k] == FORMAT_SPATIALITE) assert_int_equal(t.srid, 4326);
        free(t.corner);
        release(&s, bytes);
    }
    patch_end(&s);
}

/* OGR's idea of the same bytes. It says MULTIPOLYGON Z in its own old code. */
static void check_with_ogr(const sample_patch *s, const uint8_t *wkb, size_t size) {
    OGRGeometryH g = NULL;
    assert_int_equal(OGR_G_CreateFromWkb(wkb, NULL, &g, (int)size), OGRERR_NONE);
    assert_int_equal(OGR_G_GetGeometryType(g), wkbMultiPolygon25D);
    assert_int_equal(OGR_G_IsEmpty(g), s->patch.triangle_count == 0);
    triangles t = {0};
    triangles_begin(&t, (size_t)OGR_G_GetGeometryCount(g));
    for (int i = 0; i < (int)t.n; i++) {
        OGRGeometryH polygon = OGR_G_GetGeometryRef(g, i);
        assert_int_equal(OGR_G_GetGeometryCount(polygon), 1);
        OGRGeometryH ring = OGR_G_GetGeometryRef(polygon, 0);
        assert_int_equal(OGR_G_GetPointCount(ring), 4);
        for (int c = 0; c < 3; c++) {
            double *xyz = t.corner[3 * i + c];
            OGR_G_GetPoint(ring, c, &xyz[0], &xyz[1], &xyz[2]);
        }
    }
    check_equal(s, &t);
    free(t.corner);
    OGR_G_DestroyGeometry(g);
}

static void test_ogr_reads_it(void **state) {
    (void)state;
    for (int n = 0; n < 300; n = n * 3 + 1) {
        sample_patch s;
        patch_begin(&s, n, 4326);
        size_t size;
        uint8_t *bytes = write_patch(&s, FORMAT_WKB, &size);
        check_with_ogr(&s, bytes, size);
        release(&s, bytes);
        bytes = write_patch(&s, FORMAT_GPKG, &size);
        size_t head = n ? 40 : 8;
        check_with_ogr(&s, bytes + head, size - head);
        release(&s, bytes);
        patch_end(&s);
    }
}

/* The one value of `sql`, with the bytes (if any) as ?1, as text; "" for NULL. */
static void ask(sqlite3 *db, const char *sql, const uint8_t *bytes, size_t size, const char *right) {
    sqlite3_stmt *statement;
    assert_int_equal(sqlite3_prepare_v2(db, sql, -1, &statement, NULL), SQLITE_OK);
    if (bytes) assert_int_equal(sqlite3_bind_blob(statement, 1, bytes, (int)size, SQLITE_STATIC), SQLITE_OK);
    assert_int_equal(sqlite3_step(statement), SQLITE_ROW);
    const char *text = (const char *)sqlite3_column_text(statement, 0);
    assert_string_equal(text ? text : "", right);
    assert_int_equal(sqlite3_finalize(statement), SQLITE_OK);
}

static void test_spatialite_reads_it(void **state) {
    (void)state;
    sqlite3 *db;
    assert_int_equal(sqlite3_open(":memory:", &db), SQLITE_OK);
    (void)sqlite3_enable_load_extension(db, 1);
    if (sqlite3_load_extension(db, "mod_spatialite", NULL, NULL) != SQLITE_OK) {
        print_message("no mod_spatialite: left out\n");
        (void)sqlite3_close(db);
        skip();
    }
    for (int n = 0; n < 200; n = n * 5 + 1) {
        sample_patch s;
        char count[16];
        patch_begin(&s, n, 4326);
        (void)snprintf(count, sizeof count, "%d", n);
        size_t size;
        uint8_t *bytes = write_patch(&s, FORMAT_SPATIALITE, &size);
        ask(db, "SELECT ST_IsEmpty(?1)", bytes, size, n ? "0" : "1");
        ask(db, "SELECT ST_NumGeometries(?1)", bytes, size, count);
        ask(db, "SELECT SRID(?1)", bytes, size, "4326");
        ask(db, "SELECT ST_NDims(?1)", bytes, size, "3");
        if (n) {
            ask(db, "SELECT GeometryType(?1)", bytes, size, "MULTIPOLYGON Z");
            size_t wkb_size;
            uint8_t *wkb = write_patch(&s, FORMAT_WKB, &wkb_size);
            sqlite3_stmt *statement; /* mod_spatialite's own WKB of it is ours, byte for byte */
            assert_int_equal(sqlite3_prepare_v2(db, "SELECT AsBinary(?1)", -1, &statement, NULL), SQLITE_OK);
            (void)sqlite3_bind_blob(statement, 1, bytes, (int)size, SQLITE_STATIC);
            assert_int_equal(sqlite3_step(statement), SQLITE_ROW);
            assert_int_equal(sqlite3_column_bytes(statement, 0), wkb_size);
            assert_memory_equal(sqlite3_column_blob(statement, 0), wkb, wkb_size);
            (void)sqlite3_finalize(statement);
            release(&s, wkb);
        } else
            ask(db, "SELECT AsText(?1)", bytes, size, "GEOMETRYCOLLECTION Z()");
        release(&s, bytes);

        bytes = write_patch(&s, FORMAT_GPKG, &size);
        ask(db, "SELECT IsValidGPB(?1)", bytes, size, "1");
        if (n) ask(db, "SELECT ST_NumGeometries(GeomFromGPB(?1))", bytes, size, count);
        ask(db, "SELECT ST_IsEmpty(?1) <> 0", bytes, size, n ? "0" : "1"); /* 5.0 says 16, the flag itself */
        release(&s, bytes);
        patch_end(&s);
    }
    /* An empty geometry has its place in a column with an index, and no row in the index. */
    assert_int_equal(sqlite3_exec(db,
                                  "SELECT InitSpatialMetadata('NONE'); CREATE TABLE t (id INTEGER PRIMARY KEY);"
                                  "SELECT AddGeometryColumn('t', 'g', 0, 'MULTIPOLYGON', 'XYZ');"
                                  "SELECT CreateSpatialIndex('t', 'g')",
                                  NULL, NULL, NULL),
                     SQLITE_OK);
    for (int n = 0; n < 2; n++) {
        sample_patch s;
        patch_begin(&s, n, 0);
        size_t size;
        uint8_t *bytes = write_patch(&s, FORMAT_SPATIALITE, &size);
        sqlite3_stmt *statement;
        assert_int_equal(sqlite3_prepare_v2(db, "INSERT INTO t (g) VALUES (?1)", -1, &statement, NULL), SQLITE_OK);
        (void)sqlite3_bind_blob(statement, 1, bytes, (int)size, SQLITE_STATIC);
        assert_int_equal(sqlite3_step(statement), SQLITE_DONE);
        (void)sqlite3_finalize(statement);
        release(&s, bytes);
        patch_end(&s);
    }
    ask(db, "SELECT count(*) FROM t", NULL, 0, "2");
    ask(db, "SELECT count(*) FROM idx_t_g", NULL, 0, "1");
    ask(db, "SELECT CheckSpatialIndex('t', 'g')", NULL, 0, "1");
    assert_int_equal(sqlite3_close(db), SQLITE_OK);
}

/* Where the text ends that is in the bytes once. */
static size_t end_of(const uint8_t *bytes, size_t size, const char *text) {
    const size_t n = strlen(text);
    for (size_t at = 0; at + n <= size; at++)
        if (memcmp(bytes + at, text, n) == 0) return at + n;
    fail_msg("no %s", text);
    return 0;
}

/* The same file, and 12 bytes more a vertex, whatever the count; other formats pass normals over. */
static void test_ply_normals(void **state) {
    (void)state;
    static const int counts[] = {0, 1, 2, 17, 300};
    static const char added[] = "property float nx\nproperty float ny\nproperty float nz\n";
    for (size_t c = 0; c < sizeof counts / sizeof *counts; c++) {
        sample_patch s;
        patch_begin(&s, counts[c], 2056);
        const size_t n = s.patch.vertex_count;
        float *normals = calloc(3 * n + 1, sizeof *normals);
        assert_non_null(normals);
        for (size_t i = 0; i < 3 * n; i++) normals[i] = (float)random_between(-1000, 1000) / 1000;
        uint8_t *bytes[FORMAT_SPATIALITE + 1][2];
        size_t size[FORMAT_SPATIALITE + 1][2];
        for (format_kind kind = FORMAT_OBJ; kind <= FORMAT_SPATIALITE; kind++)
            for (int with = 0; with < 2; with++) {
                s.frame.normals = with ? normals : NULL;
                assert_int_equal(
                    format_patch(&s.patch, &s.frame, kind, &s.allocator, &bytes[kind][with], &size[kind][with]),
                    RQT_OK);
            }
        for (format_kind kind = FORMAT_OBJ; kind <= FORMAT_SPATIALITE; kind++) {
            if (kind == FORMAT_PLY) continue;
            assert_int_equal(size[kind][0], size[kind][1]);
            assert_memory_equal(bytes[kind][0], bytes[kind][1], size[kind][0]);
        }
        const uint8_t *plain = bytes[FORMAT_PLY][0], *with = bytes[FORMAT_PLY][1];
        const size_t added_bytes = sizeof added - 1;
        assert_int_equal(size[FORMAT_PLY][1], size[FORMAT_PLY][0] + added_bytes + 12 * n);
        const size_t before = end_of(plain, size[FORMAT_PLY][0], "property double z\n");
        assert_memory_equal(with, plain, before);
        assert_memory_equal(with + before, added, added_bytes);
        const size_t head = end_of(plain, size[FORMAT_PLY][0], "end_header\n");
        assert_memory_equal(with + before + added_bytes, plain + before, head - before);
        for (size_t i = 0; i < n; i++) {
            const uint8_t *vertex = with + head + added_bytes + 36 * i;
            assert_memory_equal(vertex, plain + head + 24 * i, 24);
            assert_memory_equal(vertex + 24, normals + 3 * i, 12);
        }
        assert_memory_equal(with + head + added_bytes + 36 * n, plain + head + 24 * n,
                            size[FORMAT_PLY][0] - head - 24 * n);
        for (format_kind kind = FORMAT_OBJ; kind <= FORMAT_SPATIALITE; kind++)
            for (int k = 0; k < 2; k++) (void)s.allocator.resize(s.allocator.context, bytes[kind][k], 0);
        free(normals);
        patch_end(&s);
    }
}

static void test_point_gpkg(void **state) {
    (void)state;
    for (int round = 0; round < 50; round++) {
        const double xyz[3] = {random_between(-1000000, 1000000) / 7.0, random_between(-1000000, 1000000) / 7.0,
                               random_between(-1000000, 1000000) / 7.0};
        const int32_t srid = round % 2 ? 2056 : 0;
        uint8_t bytes[FORMAT_POINT_BYTES + 8];
        memset(bytes, 0xA5, sizeof bytes);
        const size_t size = format_point_gpkg(xyz, srid, bytes);
        assert_true(size <= FORMAT_POINT_BYTES);
        for (size_t i = size; i < sizeof bytes; i++) assert_int_equal(bytes[i], 0xA5);
        reader r = {bytes, bytes + size};
        assert_memory_equal(take(&r, 4), "GP\0\1", 4);
        assert_int_equal((int32_t)take_u32(&r), srid ? srid : -1);
        assert_int_equal(take_byte(&r), 1);
        assert_int_equal(take_u32(&r), 1001);
        for (int i = 0; i < 3; i++) assert_true(take_double(&r) == xyz[i]);
        assert_ptr_equal(r.p, r.end);
    }
}

static void test_triangle_gpkg(void **state) {
    (void)state;
    for (int round = 0; round < 200; round++) {
        double xyz[3][3];
        for (int i = 0; i < 9; i++) xyz[i / 3][i % 3] = random_between(-1000000, 1000000) / 7.0;
        int32_t srid = round % 2 ? 2056 : 0;
        uint8_t bytes[FORMAT_TRIANGLE_BYTES + 8];
        memset(bytes, 0xA5, sizeof bytes);
        size_t size = format_triangle_gpkg((const double(*)[3])xyz, srid, bytes);
        assert_true(size <= FORMAT_TRIANGLE_BYTES);
        for (size_t i = size; i < sizeof bytes; i++) assert_int_equal(bytes[i], 0xA5);
        reader r = {bytes, bytes + size};
        assert_memory_equal(take(&r, 4), "GP\0\3", 4);
        assert_int_equal((int32_t)take_u32(&r), srid ? srid : -1);
        for (int axis = 0; axis < 2; axis++) {
            double low = fmin(xyz[0][axis], fmin(xyz[1][axis], xyz[2][axis]));
            double high = fmax(xyz[0][axis], fmax(xyz[1][axis], xyz[2][axis]));
            assert_true(take_double(&r) == low);
            assert_true(take_double(&r) == high);
        }
        assert_int_equal(take_byte(&r), 1);
        assert_int_equal(take_u32(&r), 1003);
        assert_int_equal(take_u32(&r), 1);
        assert_int_equal(take_u32(&r), 4);
        for (int i = 0; i < 12; i++) assert_true(take_double(&r) == xyz[i / 3 % 3][i % 3]);
        assert_ptr_equal(r.p, r.end);
    }
}

static void test_ring_gpkg(void **state) {
    (void)state;
    heap h = {0};
    rqt_allocator allocator = {heap_resize, &h};
    enum { MOST = 500 };
    double xy[2 * MOST];
    for (int i = 0; i < 2 * MOST; i++) xy[i] = random_between(-1800, 1800) / 10.0;
    uint8_t *bytes;
    size_t size;
    for (int n = 3; n <= MOST; n += 71) {
        assert_int_equal(format_ring_gpkg(xy, n, 4326, &allocator, &bytes, &size), RQT_OK);
        assert_int_equal(h.last, size);
        reader r = {bytes, bytes + size};
        assert_memory_equal(take(&r, 4), "GP\0\3", 4);
        assert_int_equal(take_u32(&r), 4326);
        for (int axis = 0; axis < 2; axis++) {
            double low = xy[axis], high = xy[axis];
            for (int i = 1; i < n; i++) {
                low = fmin(low, xy[2 * i + axis]);
                high = fmax(high, xy[2 * i + axis]);
            }
            assert_true(take_double(&r) == low);
            assert_true(take_double(&r) == high);
        }
        assert_int_equal(take_byte(&r), 1);
        assert_int_equal(take_u32(&r), 3);
        assert_int_equal(take_u32(&r), 1);
        assert_int_equal(take_u32(&r), n + 1);
        for (int i = 0; i < 2 * (n + 1); i++) assert_true(take_double(&r) == xy[i % (2 * n)]);
        assert_ptr_equal(r.p, r.end);
        OGRGeometryH g = NULL;
        assert_int_equal(OGR_G_CreateFromWkb(bytes + 40, NULL, &g, (int)size - 40), OGRERR_NONE);
        assert_int_equal(OGR_G_GetGeometryType(g), wkbPolygon);
        OGR_G_DestroyGeometry(g);
        (void)heap_resize(&h, bytes, 0);
    }
    int asked = h.asked;
    assert_int_equal(format_ring_gpkg(xy, 2, 0, &allocator, &bytes, &size), RQT_INVALID);
    assert_int_equal(format_ring_gpkg(xy, -7, 0, &allocator, &bytes, &size), RQT_INVALID);
    assert_int_equal(format_ring_gpkg(xy, INT32_MAX, 0, &allocator, &bytes, &size), RQT_INVALID);
    static const double bad[] = {NAN, INFINITY, -INFINITY};
    for (int i = 0; i < 6; i++) {
        double kept = xy[i];
        xy[i] = bad[i / 2];
        bytes = (uint8_t *)xy;
        size = 1;
        assert_int_equal(format_ring_gpkg(xy, 3, 0, &allocator, &bytes, &size), RQT_INVALID);
        assert_null(bytes);
        assert_int_equal(size, 0);
        xy[i] = kept;
    }
    assert_int_equal(h.asked, asked);
    h.refuses = true;
    assert_int_equal(format_ring_gpkg(xy, 3, 0, &allocator, &bytes, &size), RQT_NO_MEMORY);
    assert_null(bytes);
    assert_int_equal(h.held, 0);
}

/* Counts that cannot be returned are refused from the counts: the arrays are not that long. */
static void test_too_large(void **state) {
    (void)state;
    static const size_t counts[] = {2147483647u / 8 + 1, 2147483648u, SIZE_MAX / 3, SIZE_MAX / 109 + 1, SIZE_MAX};
    sample_patch s;
    patch_begin(&s, 1, 0);
    for (int k = 0; k < KINDS; k++)
        for (int which = 0; which < 2; which++)
            for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
                if (which == 1 && k >= 2) continue; /* their size does not depend on the vertices */
                rqt_patch patch = s.patch;
                *(which ? &patch.vertex_count : &patch.triangle_count) = counts[i];
                uint8_t *bytes = (uint8_t *)&s;
                size_t size = 1;
                assert_int_equal(format_patch(&patch, &s.frame, kinds[k], &s.allocator, &bytes, &size),
                                 RQT_INVALID);
                assert_null(bytes);
                assert_int_equal(size, 0);
            }
    /* Just past the limit: 109 bytes a triangle in a multipolygon, 24 a vertex in a ply. */
    rqt_patch patch = s.patch;
    uint8_t *bytes;
    size_t size;
    patch.triangle_count = (2147483647u - 9) / 109 + 1;
    for (int k = 2; k < KINDS; k++)
        assert_int_equal(format_patch(&patch, &s.frame, kinds[k], &s.allocator, &bytes, &size), RQT_INVALID);
    patch.triangle_count = 1;
    patch.vertex_count = 2147483647u / 24;
    assert_int_equal(format_patch(&patch, &s.frame, FORMAT_PLY, &s.allocator, &bytes, &size), RQT_INVALID);
    assert_int_equal(s.heap.asked, 0);
    patch_end(&s);
}

/* An obj is as long as its digits (here 74 a line): known only by printing, and still refused before memory is
 * asked for. */
static void test_obj_too_large(void **state) {
    (void)state;
    enum { VERTICES = 29100000 };
    sample_patch s;
    patch_begin(&s, 1, 0);
    rqt_patch_vertex *vertices = calloc(VERTICES, sizeof *vertices);
    if (!vertices) skip();
    free(s.patch.vertices);
    s.patch.vertices = vertices;
    s.patch.vertex_count = VERTICES;
    const double longest = -0.00012345678901234567;
    s.frame.placement = (rqt_placement){longest, longest, 1, -1};
    s.frame.unit = (rqt_unit){0, 1, 1, 1, 1, longest};
    uint8_t *bytes;
    size_t size;
    assert_int_equal(format_patch(&s.patch, &s.frame, FORMAT_OBJ, &s.allocator, &bytes, &size), RQT_INVALID);
    assert_int_equal(s.heap.asked, 0);
    patch_end(&s);
}

static void test_no_memory(void **state) {
    (void)state;
    for (int n = 0; n < 2; n++)
        for (int k = 0; k < KINDS; k++) {
            sample_patch s;
            patch_begin(&s, n, 0);
            s.heap.refuses = true;
            uint8_t *bytes = (uint8_t *)&s;
            size_t size = 1;
            assert_int_equal(format_patch(&s.patch, &s.frame, kinds[k], &s.allocator, &bytes, &size),
                             RQT_NO_MEMORY);
            assert_null(bytes);
            assert_int_equal(size, 0);
            assert_int_equal(s.heap.asked, 1);
            patch_end(&s);
        }
}

static void test_unsound_patches(void **state) {
    (void)state;
    for (int fault = 0; fault < 9; fault++)
        for (int k = 0; k < KINDS; k++) {
            sample_patch s;
            patch_begin(&s, 3, 0);
            if (fault == 0) s.patch.triangles[8] = (uint32_t)s.patch.vertex_count;
            if (fault == 1) s.patch.triangles[4] = UINT32_MAX;
            if (fault == 2) s.frame.placement.x0 = NAN;
            if (fault == 3) s.frame.placement.dx = INFINITY;
            if (fault == 4) s.frame.placement.dy = 1e308;
            if (fault == 5) s.frame.placement.y0 = -INFINITY;
            if (fault == 6) s.frame.unit.offset = NAN;
            if (fault == 7) s.frame.unit.scale = INFINITY;
            if (fault == 8) s.frame.unit.d = 0;
            for (size_t i = 0; i < s.patch.vertex_count; i++) s.patch.vertices[i].row += 2;
            uint8_t *bytes;
            size_t size;
            assert_int_equal(format_patch(&s.patch, &s.frame, kinds[k], &s.allocator, &bytes, &size), RQT_INVALID);
            assert_null(bytes);
            assert_int_equal(s.heap.held, 0);
            patch_end(&s);
        }
}

/* A mesh between samples, far from any raster: the same bytes as the patch has, with other coordinates. */
static void between_samples(const void *context, size_t vertex, double xyz[3]) {
    for (int i = 0; i < 3; i++) xyz[i] = ((const double *)context)[3 * vertex + (size_t)i];
}

static void test_meshes_between_samples(void **state) {
    (void)state;
    const double xyz[12] = {0.1, 1.0 / 3, -2e-7, 6378137.5, -0.25, 1e-300, 2.75, 4e6, 0.5, NAN, NAN, NAN};
    const uint32_t triangle[3] = {0, 1, 2}, hole[3] = {0, 1, 3};
    heap h = {0};
    const rqt_allocator a = {heap_resize, &h};
    for (int k = 0; k < KINDS; k++) {
        format_mesh mesh = {.vertex_count = 3,
                            .triangle_count = 1,
                            .triangles = triangle,
                            .coordinates = between_samples,
                            .context = xyz,
                            .srid = 4978,
                            .eps = 1};
        uint8_t *bytes;
        size_t size;
        assert_int_equal(format_write(&mesh, kinds[k], &a, &bytes, &size), RQT_OK);
        /* all nine numbers are there, as text or as the bits of a double */
        for (int i = 0; i < 9; i++) {
            char text[34] = " ";
            const int n = kinds[k] == FORMAT_OBJ ? 1 + format_double(xyz[i], text + 1) : 8;
            const void *wanted = kinds[k] == FORMAT_OBJ ? (const void *)text : &xyz[i];
            bool found = false;
            for (size_t at = 0; at + (size_t)n <= size; at++) found |= memcmp(bytes + at, wanted, (size_t)n) == 0;
            assert_true(found);
        }
        heap_resize(&h, bytes, 0);
        mesh.vertex_count = 4;
        mesh.triangles = hole;
        assert_int_equal(format_write(&mesh, kinds[k], &a, &bytes, &size), RQT_INVALID);
        assert_null(bytes);
        assert_int_equal(h.held, 0);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(test_names, begin),
        cmocka_unit_test_setup(test_meshes_between_samples, begin),
        cmocka_unit_test_setup(test_formats_read_back, begin),
        cmocka_unit_test_setup(test_placements, begin),
        cmocka_unit_test_setup(test_box_is_of_the_triangles, begin),
        cmocka_unit_test_setup(test_empty_patch, begin),
        cmocka_unit_test_setup(test_ogr_reads_it, begin),
        cmocka_unit_test_setup(test_spatialite_reads_it, begin),
        cmocka_unit_test_setup(test_triangle_gpkg, begin),
        cmocka_unit_test_setup(test_ply_normals, begin),
        cmocka_unit_test_setup(test_point_gpkg, begin),
        cmocka_unit_test_setup(test_ring_gpkg, begin),
        cmocka_unit_test_setup(test_too_large, begin),
        cmocka_unit_test_setup(test_obj_too_large, begin),
        cmocka_unit_test_setup(test_no_memory, begin),
        cmocka_unit_test_setup(test_unsound_patches, begin),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
