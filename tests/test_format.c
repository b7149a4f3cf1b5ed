/* test_format.c - a patch as bytes, read back: by a reader of each format written here from its specification, by
 * OGR, and by mod_spatialite where it is installed. Text of doubles against the C library, in several locales.
 * Links: format.c, text.c, geometry.c, the core's code.c (or librqt.a), GDAL, SQLite, cmocka. */
#include <float.h>
#include <locale.h>
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

/* ------------------------------------------------------------------------------------------ random, memory -- */

static uint64_t random_state;

static uint64_t random_bits(void) {
    uint64_t z = random_state += 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

static int random_between(int low, int high) {
    return low + (int)(random_bits() % (uint64_t)((int64_t)high - low + 1));
}

typedef struct heap {
    int asked, held;
    size_t last;
    bool refuses;
} heap;

static void *heap_resize(void *context, void *p, size_t bytes) {
    heap *h = context;
    if (bytes == 0) {
        h->held -= p != NULL;
        free(p);
        return NULL;
    }
    h->asked++;
    h->last = bytes;
    if (h->refuses) return NULL;
    h->held += p == NULL;
    return realloc(p, bytes);
}

/* ------------------------------------------------------------------------------------------------- patches -- */

typedef struct sample_patch {
    rqt_patch patch;
    format_frame frame;
    heap heap;
    rqt_allocator allocator;
} sample_patch;

/* A strip of two rows, counter-clockwise seen from above where dx > 0 > dy; heights at random. */
static void patch_begin(sample_patch *s, int triangles, int32_t srid) {
    memset(s, 0, sizeof *s);
    s->allocator = (rqt_allocator){heap_resize, &s->heap};
    s->frame.placement = (rqt_placement){7.123456789, 47.1, 1.0 / 3600, -1.0 / 3600};
    s->frame.unit = (rqt_unit){-13, 10, 381, 1250, 1, 0.7};
    s->frame.srid = srid;
    s->frame.title = "alps";
    s->frame.eps = 2.5;
    s->patch.triangle_count = (size_t)triangles;
    s->patch.vertex_count = triangles ? (size_t)triangles + 2 : 0;
    if (!triangles) return;
    s->patch.vertices = calloc(s->patch.vertex_count, sizeof *s->patch.vertices);
    s->patch.triangles = calloc(3 * s->patch.triangle_count, sizeof *s->patch.triangles);
    assert_non_null(s->patch.vertices);
    assert_non_null(s->patch.triangles);
    int32_t col = random_between(0, 1000), row = random_between(0, 1000);
    for (size_t i = 0; i < s->patch.vertex_count; i++) {
        rqt_patch_vertex *v = &s->patch.vertices[i];
        v->col = col + (int32_t)(i / 2);
        v->row = row + (int32_t)(i % 2);
        v->q = random_between(-RQT_HEIGHT_LIMIT + 1, RQT_HEIGHT_LIMIT - 1) >> random_between(0, 28);
    }
    for (uint32_t t = 0; t < (uint32_t)triangles; t++) {
        uint32_t abc[3] = {t, t + 1 + t % 2, t + 2 - t % 2}, turn = (uint32_t)random_between(0, 2);
        for (uint32_t c = 0; c < 3; c++) s->patch.triangles[3 * t + c] = abc[(c + turn) % 3];
    }
}

static void patch_end(sample_patch *s) {
    assert_int_equal(s->heap.held, 0);
    free(s->patch.vertices);
    free(s->patch.triangles);
}

static uint8_t *write_patch(sample_patch *s, format_kind kind, size_t *size) {
    uint8_t *bytes = NULL;
    int before = s->heap.asked;
    assert_int_equal(format_patch(&s->patch, &s->frame, kind, &s->allocator, &bytes, size), RQT_OK);
    assert_int_equal(s->heap.asked, before + 1); /* one allocation, of just the size */
    assert_int_equal(s->heap.last, *size);
    return bytes;
}

static void release(sample_patch *s, uint8_t *bytes) {
    (void)heap_resize(&s->heap, bytes, 0);
}

/* What the patch is, by the contract's expression. */
static void true_coordinates(const format_frame *f, const rqt_patch_vertex *v, double xyz[3]) {
    volatile double x = v->col * f->placement.dx, y = v->row * f->placement.dy;
    volatile double factor = f->unit.scale * f->unit.numerator;
    factor = factor / f->unit.denominator;
    volatile double z = v->q / (double)f->unit.d;
    z = (double)f->unit.z0 + z;
    z = z * factor;
    xyz[0] = f->placement.x0 + x;
    xyz[1] = f->placement.y0 + y;
    xyz[2] = z + f->unit.offset;
}

/* ------------------------------------------------------------------------------------------------- readers -- */

typedef struct triangles {
    double (*corner)[3]; /* 3 per triangle */
    size_t n;
    int32_t srid;
    double box[4]; /* min x, min y, max x, max y */
    bool has_box, says_empty;
} triangles;

typedef struct reader {
    const uint8_t *p, *end;
} reader;

static const uint8_t *take(reader *r, size_t n) {
    assert_true((size_t)(r->end - r->p) >= n);
    r->p += n;
    return r->p - n;
}
static unsigned take_byte(reader *r) {
    return *take(r, 1);
}
static uint32_t take_u32(reader *r) {
    const uint8_t *p = take(r, 4);
    return p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}
static double take_double(reader *r) {
    uint64_t low = take_u32(r), high = take_u32(r), bits = high << 32 | low;
    double v;
    memcpy(&v, &bits, 8);
    return v;
}

static void triangles_begin(triangles *t, size_t n) {
    t->n = n;
    t->corner = calloc(3 * n + 1, sizeof *t->corner);
    assert_non_null(t->corner);
}

/* Bodies of WKB and SpatiaLite differ in the mark of a member only. */
static void read_members(reader *r, unsigned mark, triangles *t) {
    triangles_begin(t, take_u32(r));
    for (size_t i = 0; i < t->n; i++) {
        double closing[3];
        assert_int_equal(take_byte(r), mark);
        assert_int_equal(take_u32(r), 1003);
        assert_int_equal(take_u32(r), 1);
        assert_int_equal(take_u32(r), 4);
        for (int c = 0; c < 3; c++)
            for (int axis = 0; axis < 3; axis++) t->corner[3 * i + (size_t)c][axis] = take_double(r);
        for (int axis = 0; axis < 3; axis++) closing[axis] = take_double(r);
        assert_memory_equal(closing, t->corner[3 * i], sizeof closing);
    }
}

static void read_wkb(reader *r, triangles *t) {
    assert_int_equal(take_byte(r), 1);
    assert_int_equal(take_u32(r), 1006);
    read_members(r, 1, t);
}

static void read_gpkg(reader *r, triangles *t) {
    assert_memory_equal(take(r, 3), "GP", 3);
    unsigned flags = take_byte(r);
    assert_int_equal(flags & 1, 1);
    assert_int_equal(flags & 0xE0, 0);
    t->srid = (int32_t)take_u32(r);
    t->says_empty = flags & 0x10;
    t->has_box = (flags >> 1 & 7) == 1;
    if (t->has_box) {
        static const int places[] = {0, 2, 1, 3};
        for (int i = 0; i < 4; i++) t->box[places[i]] = take_double(r);
    } else
        assert_int_equal(flags >> 1 & 7, 0);
    read_wkb(r, t);
}

static void read_spatialite(reader *r, triangles *t) {
    assert_int_equal(take_byte(r), 0);
    assert_int_equal(take_byte(r), 1);
    t->srid = (int32_t)take_u32(r);
    for (int i = 0; i < 4; i++) t->box[i] = take_double(r);
    t->has_box = !isnan(t->box[0]);
    assert_int_equal(take_byte(r), 0x7C);
    assert_int_equal(take_u32(r), 1006);
    read_members(r, 0x69, t);
    assert_int_equal(take_byte(r), 0xFE);
}

static size_t line_length(const reader *r) {
    const uint8_t *newline = memchr(r->p, '\n', (size_t)(r->end - r->p));
    assert_non_null(newline);
    return (size_t)(newline - r->p);
}

static void take_line(reader *r, char *line, size_t room) {
    size_t n = line_length(r);
    assert_true(n < room);
    memcpy(line, take(r, n + 1), n);
    line[n] = 0;
}

static void read_ply(reader *r, triangles *t) {
    char line[200];
    unsigned vertices = 0, faces = 0, properties = 0;
    take_line(r, line, sizeof line);
    assert_string_equal(line, "ply");
    take_line(r, line, sizeof line);
    assert_string_equal(line, "format binary_little_endian 1.0");
    for (;;) {
        take_line(r, line, sizeof line);
        if (!strcmp(line, "end_header")) break;
        if (!strncmp(line, "comment ", 8)) continue;
        if (sscanf(line, "element vertex %u", &vertices) == 1 || sscanf(line, "element face %u", &faces) == 1)
            continue;
        properties++;
        if (!strcmp(line, "property list uchar int vertex_indices")) continue;
        assert_memory_equal(line, "property double ", 16);
        assert_int_equal(line[16], "xyz"[properties - 1]);
    }
    assert_int_equal(properties, 4);
    double(*xyz)[3] = calloc((size_t)vertices + 1, sizeof *xyz);
    assert_non_null(xyz);
    for (size_t i = 0; i < vertices; i++)
        for (int axis = 0; axis < 3; axis++) xyz[i][axis] = take_double(r);
    triangles_begin(t, faces);
    for (size_t i = 0; i < 3 * t->n; i++) {
        if (i % 3 == 0) assert_int_equal(take_byte(r), 3);
        uint32_t index = take_u32(r);
        assert_true(index < vertices);
        memcpy(t->corner[i], xyz[index], sizeof *xyz);
    }
    free(xyz);
}

static void read_obj(reader *r, triangles *t) {
    size_t vertices = 0, faces = 0;
    for (const uint8_t *p = r->p; p < r->end; p++)
        if (p == r->p || p[-1] == '\n') {
            vertices += *p == 'v';
            faces += *p == 'f';
        }
    double(*xyz)[3] = calloc(vertices + 1, sizeof *xyz);
    assert_non_null(xyz);
    triangles_begin(t, faces);
    size_t v = 0, f = 0;
    while (r->p < r->end) {
        char line[200], *rest = line + 1;
        take_line(r, line, sizeof line);
        if (line[0] == 'v') {
            for (int axis = 0; axis < 3; axis++) {
                assert_int_equal(*rest, ' ');
                xyz[v][axis] = strtod(rest, &rest);
            }
            assert_int_equal(*rest, 0);
            v++;
        } else if (line[0] == 'f') {
            for (size_t c = 0; c < 3; c++) {
                unsigned long index = strtoul(rest, &rest, 10);
                assert_true(index >= 1 && index <= v);
                memcpy(t->corner[3 * f + c], xyz[index - 1], sizeof *xyz);
            }
            assert_int_equal(*rest, 0);
            f++;
        } else
            assert_memory_equal(line, "# ", 2);
    }
    free(xyz);
}

static void read_any(format_kind kind, const uint8_t *bytes, size_t size, triangles *t) {
    reader r = {bytes, bytes + size};
    memset(t, 0, sizeof *t);
    if (kind == FORMAT_OBJ) read_obj(&r, t);
    if (kind == FORMAT_PLY) read_ply(&r, t);
    if (kind == FORMAT_WKB) read_wkb(&r, t);
    if (kind == FORMAT_GPKG) read_gpkg(&r, t);
    if (kind == FORMAT_SPATIALITE) read_spatialite(&r, t);
    assert_ptr_equal(r.p, r.end);
}

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
    static const char *const names[] = {"obj", "ply", "wkb", "gpkg", "spatialite"};
    for (int i = 0; i < KINDS; i++) {
        format_kind kind = (format_kind)99;
        assert_true(format_from_name(names[i], &kind));
        assert_int_equal(kind, kinds[i]);
    }
    format_kind kind = FORMAT_WKB;
    static const char *const none[] = {"", "OBJ", "ob", "objx", "strip", "indexed", "glb", " ply", NULL};
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

static void test_obj_text(void **state) {
    (void)state;
    rqt_patch_vertex vertices[] = {{0, 0, 5, 0, 0}, {0, 1, -25, 0, 0}, {1, 0, 0, 0, 0}};
    uint32_t indices[] = {0, 1, 2};
    heap h = {0};
    rqt_allocator allocator = {heap_resize, &h};
    rqt_patch patch = {vertices, 3, indices, 1, allocator};
    format_frame frame = {{600000.5, 200000, 0.25, -0.5}, {400, 100, 1, 1, 1, 0}, 21781, "a\nv 1 2 3", 0.5};
    uint8_t *bytes;
    size_t size;
    assert_int_equal(format_patch(&patch, &frame, FORMAT_OBJ, &allocator, &bytes, &size), RQT_OK);
    const char right[] = "# terrain a v 1 2 3\n# eps 0.5\n# srid 21781\n"
                         "v 600000.5 200000 400.05\nv 600000.5 199999.5 399.75\nv 600000.75 200000 400\nf 1 2 3\n";
    assert_int_equal(size, sizeof right - 1);
    assert_memory_equal(bytes, right, size);
    (void)heap_resize(&h, bytes, 0);
    frame.title = NULL;
    frame.srid = INT32_MIN;
    frame.eps = INFINITY;
    assert_int_equal(format_patch(&patch, &frame, FORMAT_OBJ, &allocator, &bytes, &size), RQT_OK);
    assert_memory_equal(bytes, "# eps inf\n# srid -2147483648\nv ", 31);
    (void)heap_resize(&h, bytes, 0);
    assert_int_equal(h.held, 0);
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
            assert_int_equal(s.heap.asked, 0);
            patch_end(&s);
        }
}

/* ---------------------------------------------------------------------------------------- text of doubles -- */

static int digits_of(const char *text) {
    int n = 0, zeros = 0;
    bool begun = false, plain = !strchr(text, '.');
    for (; *text && *text != 'e'; text++) {
        if (*text < '0' || *text > '9') continue;
        begun |= *text != '0';
        zeros = *text == '0' ? zeros + 1 : 0;
        n += begun;
    }
    return plain || zeros ? n - zeros : n;
}

/* In the C locale: reads back as the same bits, no decimal of fewer digits does, and it has the form of a number
 * that every program reads. The neighbours of the nearest decimal are tried too, as one above can do where it
 * cannot. */
static void check_double(double v) {
    char text[32];
    memset(text, 'x', sizeof text);
    int n = format_double(v, text);
    assert_true(n < 32);
    assert_int_equal(strlen(text), n);
    char *end;
    double back = strtod(text, &end);
    if (*end || memcmp(&back, &v, sizeof v)) fail_msg("%.17g gives '%s', which is %.17g", v, text, back);
    if (v == 0) return;

    int digits = digits_of(text);
    if (digits > 17) fail_msg("%.17g gives '%s'", v, text);
    for (int fewer = digits - 1; fewer >= 1 && fewer >= digits - 3; fewer--) {
        char nearest[40];
        (void)snprintf(nearest, sizeof nearest, "%.*e", fewer - 1, v);
        if (strtod(nearest, NULL) == v) fail_msg("%.17g gives '%s', but '%s' is shorter", v, text, nearest);
        char *last = strchr(nearest, 'e') - 1;
        if (*last >= '0' && *last < '9') {
            ++*last;
            if (strtod(nearest, NULL) == v) fail_msg("%.17g gives '%s', but '%s' is shorter", v, text, nearest);
        }
    }
    /* %g with that precision, unless the nearest decimal does not read back, says the same. */
    char same[40];
    (void)snprintf(same, sizeof same, "%.*g", digits < 15 && fabs(v) >= DBL_MIN ? 15 : digits, v);
    if (strtod(same, NULL) == v) assert_string_equal(text, same);
}

static void is_text(double v, const char *right) {
    char text[32];
    assert_int_equal(format_double(v, text), strlen(right));
    assert_string_equal(text, right);
}

static void test_known_texts(void **state) {
    (void)state;
    is_text(0, "0");
    is_text(-0.0, "-0");
    is_text(1, "1");
    is_text(-1, "-1");
    is_text(-0.25, "-0.25");
    is_text(0.1, "0.1");
    is_text(0.1 + 0.2, "0.30000000000000004");
    is_text(1.0 / 3, "0.3333333333333333");
    is_text(123456.789, "123456.789");
    is_text(2056.0, "2056");
    is_text(100000, "100000");
    is_text(999999999999999, "999999999999999");
    is_text(1e15, "1e+15");
    is_text(1234567890123456, "1234567890123456");
    is_text(9007199254740992, "9007199254740992");
    is_text(1e300, "1e+300");
    is_text(-1.5e-7, "-1.5e-07");
    is_text(0.0001, "0.0001");
    is_text(0.00001, "1e-05");
    is_text(1e-5 * (1 - DBL_EPSILON), "9.999999999999999e-06");
    is_text(0.00012345678901234567, "0.00012345678901234567");
    is_text(-0.00012345678901234567, "-0.00012345678901234567");
    is_text(DBL_MAX, "1.7976931348623157e+308");
    is_text(DBL_MIN, "2.2250738585072014e-308");
    is_text(DBL_EPSILON, "2.220446049250313e-16");
    is_text(DBL_TRUE_MIN, "5e-324");
    is_text(-3 * DBL_TRUE_MIN, "-1.5e-323");
    is_text(ldexp(1, -44), "5.684341886080802e-14"); /* the nearest 16 digits, ..801, do not read back */
    is_text(0.99999999999999989, "0.9999999999999999");
    is_text(9.9999999999999982, "9.999999999999998");
    is_text(INFINITY, "inf");
    is_text(-INFINITY, "-inf");
    is_text(NAN, "nan");
    is_text(copysign(NAN, -1), "nan");
}

static void test_many_doubles(void **state) {
    (void)state;
    for (int e = -1074; e <= 1023; e++) /* powers of two and their neighbours */
        for (int side = -1; side <= 1; side++) {
            double v = ldexp(1, e);
            if (side) v = nextafter(v, side < 0 ? 0 : INFINITY);
            check_double(v);
            check_double(-v);
        }
    for (int e = -323; e <= 308; e++) {
        char text[16];
        (void)snprintf(text, sizeof text, "1e%d", e);
        double v = strtod(text, NULL);
        check_double(v);
        check_double(nextafter(v, 0));
        check_double(nextafter(v, INFINITY));
        check_double(v * 3);
    }
    for (int i = 0; i < 200000; i++) {
        uint64_t bits = random_bits();
        if (i % 10 == 0) bits &= (((uint64_t)1 << random_between(1, 52)) - 1) | (uint64_t)1 << 63; /* subnormal */
        double v;
        memcpy(&v, &bits, 8);
        if (isfinite(v)) check_double(v);
        /* What coordinates are like. */
        check_double((double)(int64_t)random_bits() / ldexp(1, random_between(0, 70)));
        check_double((double)random_between(-100000000, 100000000) / pow(10, random_between(0, 9)));
        check_double(7.1 + random_between(0, 100000) / 3600.0);
        check_double((double)(random_between(0, 1 << 30) % 1000003) * 0.1 * pow(10, random_between(-8, 8)));
        check_double((double)(int64_t)(random_bits() >> random_between(0, 63)));
    }
}

/* Whatever the host has set, the text is the same. */
static void test_locales(void **state) {
    (void)state;
    static const char *const names[] = {"de_DE.UTF-8", "de_DE.utf8",  "de_DE",
                                        "fr_FR.UTF-8", "ps_AF.UTF-8", "ps_AF"};
    int tried = 0;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        if (!setlocale(LC_ALL, names[i])) continue;
        char comma[16];
        (void)snprintf(comma, sizeof comma, "%.1f", 0.5);
        tried += strcmp(comma, "0.5") != 0;
        test_known_texts(NULL);
        for (int j = 0; j < 20000; j++) {
            uint64_t bits = random_bits();
            double v;
            memcpy(&v, &bits, 8);
            if (j % 2) v = ldexp(frexp(v, &(int){0}), random_between(-30, 60));
            char here[32], there[32];
            (void)format_double(v, here);
            (void)setlocale(LC_ALL, "C");
            (void)format_double(v, there);
            (void)setlocale(LC_ALL, names[i]);
            assert_string_equal(here, there);
        }
        test_obj_text(NULL);
        (void)setlocale(LC_ALL, "C");
    }
    if (!tried) {
        print_message("no locale with another decimal point: left out\n");
        skip();
    }
}

static int begin(void **state) {
    (void)state;
    random_state = 20240607;
    return 0;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(test_names, begin),
        cmocka_unit_test_setup(test_formats_read_back, begin),
        cmocka_unit_test_setup(test_placements, begin),
        cmocka_unit_test_setup(test_box_is_of_the_triangles, begin),
        cmocka_unit_test_setup(test_obj_text, begin),
        cmocka_unit_test_setup(test_empty_patch, begin),
        cmocka_unit_test_setup(test_ogr_reads_it, begin),
        cmocka_unit_test_setup(test_spatialite_reads_it, begin),
        cmocka_unit_test_setup(test_triangle_gpkg, begin),
        cmocka_unit_test_setup(test_ring_gpkg, begin),
        cmocka_unit_test_setup(test_too_large, begin),
        cmocka_unit_test_setup(test_obj_too_large, begin),
        cmocka_unit_test_setup(test_no_memory, begin),
        cmocka_unit_test_setup(test_unsound_patches, begin),
        cmocka_unit_test_setup(test_known_texts, begin),
        cmocka_unit_test_setup(test_many_doubles, begin),
        cmocka_unit_test_setup(test_locales, begin),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
