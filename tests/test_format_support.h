/* test_format_support.h - what the test programs of the formats share: random numbers, a counting heap, patches
 * made in memory, and a reader of each format, written here from its specification.
 *
 * Every test starts the random numbers anew (begin), so it fails alike alone and among others. */
#ifndef TEST_FORMAT_SUPPORT_H
#define TEST_FORMAT_SUPPORT_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "format.h"

/* ------------------------------------------------------------------------------------------ random, memory -- */

static uint64_t random_state;

static inline uint64_t random_bits(void) {
    uint64_t z = random_state += 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

/* The setup of every test. */
static inline int begin(void **state) {
    (void)state;
    random_state = 20240607;
    return 0;
}

static inline int random_between(int low, int high) {
    return low + (int)(random_bits() % (uint64_t)((int64_t)high - low + 1));
}

typedef struct heap {
    int asked, held;
    size_t last;
    bool refuses;
} heap;

static inline void *heap_resize(void *context, void *p, size_t bytes) {
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
static inline void patch_begin(sample_patch *s, int triangles, int32_t srid) {
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

static inline void patch_end(sample_patch *s) {
    assert_int_equal(s->heap.held, 0);
    free(s->patch.vertices);
    free(s->patch.triangles);
}

static inline uint8_t *write_patch(sample_patch *s, format_kind kind, size_t *size) {
    uint8_t *bytes = NULL;
    int before = s->heap.asked;
    assert_int_equal(format_patch(&s->patch, &s->frame, kind, &s->allocator, &bytes, size), RQT_OK);
    assert_int_equal(s->heap.asked, before + 1); /* one allocation, of just the size */
    assert_int_equal(s->heap.last, *size);
    return bytes;
}

static inline void release(sample_patch *s, uint8_t *bytes) {
    (void)heap_resize(&s->heap, bytes, 0);
}

/* What the patch is, by the contract's expression. */
static inline void true_coordinates(const format_frame *f, const rqt_patch_vertex *v, double xyz[3]) {
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

static inline const uint8_t *take(reader *r, size_t n) {
    assert_true((size_t)(r->end - r->p) >= n);
    r->p += n;
    return r->p - n;
}
static inline unsigned take_byte(reader *r) {
    return *take(r, 1);
}
static inline uint32_t take_u32(reader *r) {
    const uint8_t *p = take(r, 4);
    return p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}
static inline double take_double(reader *r) {
    uint64_t low = take_u32(r), high = take_u32(r), bits = high << 32 | low;
    double v;
    memcpy(&v, &bits, 8);
    return v;
}

static inline void triangles_begin(triangles *t, size_t n) {
    t->n = n;
    t->corner = calloc(3 * n + 1, sizeof *t->corner);
    assert_non_null(t->corner);
}

/* Bodies of WKB and SpatiaLite differ in the mark of a member only. */
static inline void read_members(reader *r, unsigned mark, triangles *t) {
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

static inline void read_wkb(reader *r, triangles *t) {
    assert_int_equal(take_byte(r), 1);
    assert_int_equal(take_u32(r), 1006);
    read_members(r, 1, t);
}

static inline void read_gpkg(reader *r, triangles *t) {
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

static inline void read_spatialite(reader *r, triangles *t) {
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

static inline size_t line_length(const reader *r) {
    const uint8_t *newline = memchr(r->p, '\n', (size_t)(r->end - r->p));
    assert_non_null(newline);
    return (size_t)(newline - r->p);
}

static inline void take_line(reader *r, char *line, size_t room) {
    size_t n = line_length(r);
    assert_true(n < room);
    memcpy(line, take(r, n + 1), n);
    line[n] = 0;
}

static inline void read_ply(reader *r, triangles *t) {
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

static inline void read_obj(reader *r, triangles *t) {
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

static inline void read_any(format_kind kind, const uint8_t *bytes, size_t size, triangles *t) {
    reader r = {bytes, bytes + size};
    memset(t, 0, sizeof *t);
    if (kind == FORMAT_OBJ) read_obj(&r, t);
    if (kind == FORMAT_PLY) read_ply(&r, t);
    if (kind == FORMAT_WKB) read_wkb(&r, t);
    if (kind == FORMAT_GPKG) read_gpkg(&r, t);
    if (kind == FORMAT_SPATIALITE) read_spatialite(&r, t);
    assert_ptr_equal(r.p, r.end);
}

#endif
