/* test_geometry.c - geometries are read as they were written, and nothing hostile gets through.
 *
 * What was read is compared as one line of text: P point, L line, A polygon with its rings. The SpatiaLite and
 * GeoPackage samples named "golden" were written by SpatiaLite 5.0.1; the others are put together from small
 * programs (see build), in both byte orders. Every parse runs on a copy that ends where the sample ends, so that a
 * sanitizer sees the first byte read beyond it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "geometry.h"

#define COUNT(array) (sizeof(array) / sizeof *(array))

/* -------------------------------------------------------------------------------------------- heap -- */
typedef struct heap {
    size_t live, calls, fail_at; /* fail_at: the call that is refused, counted from 1; 0: none */
} heap;

static void *heap_resize(void *context, void *p, size_t bytes) {
    heap *h = context;
    if (bytes == 0) {
        h->live--;
        free(p);
        return NULL;
    }
    if (++h->calls == h->fail_at) return NULL;
    if (!p) h->live++;
    return realloc(p, bytes);
}

static heap test_heap;
static const rqt_allocator allocator = {heap_resize, &test_heap};

static int begin_test(void **state) {
    (void)state;
    memset(&test_heap, 0, sizeof test_heap);
    return 0;
}

static int end_test(void **state) {
    (void)state;
    return test_heap.live == 0 ? 0 : -1;
}

/* ------------------------------------------------------------------------------------------ helpers -- */
static char description[8192];
static rqt_message message;

static void describe_add(const char *text) {
    assert_true(strlen(description) + strlen(text) < sizeof description);
    strcat(description, text);
}

static const char *describe(const rqt_geometry *g) {
    static const char *const letters[] = {"?", "P", "L", "A"};
    char number[80];
    description[0] = 0;
    for (size_t i = 0; i < g->part_count; i++) {
        const geometry_part *part = &g->parts[i];
        if (i > 0) describe_add(" ");
        describe_add(letters[part->type]);
        for (size_t r = 0; r < part->count; r++) {
            const geometry_ring *ring = &g->rings[part->first + r];
            describe_add("(");
            for (size_t k = 0; k < ring->count; k++) {
                geometry_point p = g->points[ring->first + k];
                (void)snprintf(number, sizeof number, k ? ",%.17g %.17g" : "%.17g %.17g", p.x, p.y);
                describe_add(number);
            }
            describe_add(")");
        }
    }
    return description;
}

static rqt_status parse(const void *bytes, size_t n, bool text, rqt_geometry **g) {
    void *copy = malloc(n ? n : 1);
    assert_non_null(copy);
    if (n) memcpy(copy, bytes, n);
    memset(&message, 0, sizeof message);
    rqt_status status = rqt_geometry_parse(copy, n, text, &allocator, g, &message);
    free(copy);
    if (status == RQT_OK) {
        assert_non_null(*g);
    } else {
        assert_null(*g);
        assert_true(strlen(message.text) > 5);
    }
    return status;
}

static void expect_geometry(const void *bytes, size_t n, bool text, const char *expected, int32_t srid) {
    rqt_geometry *g;
    rqt_status status = parse(bytes, n, text, &g);
    if (status != RQT_OK) fail_msg("%s: %s", text ? (const char *)bytes : expected, message.text);
    assert_string_equal(describe(g), expected);
    assert_int_equal(rqt_geometry_srid(g), srid);
    rqt_geometry_free(g);
}

static void expect_text(const char *text, const char *expected, int32_t srid) {
    expect_geometry(text, strlen(text), true, expected, srid);
}

static void expect_no_geometry(const void *bytes, size_t n, bool text, rqt_status expected, const char *sentence) {
    rqt_geometry *g;
    rqt_status status = parse(bytes, n, text, &g);
    if (status == RQT_OK) rqt_geometry_free(g);
    if (status != expected || !strstr(message.text, sentence))
        fail_msg("%s: %d \"%s\"", text ? (const char *)bytes : sentence, (int)status, message.text);
}

static void expect_no_text(const char *text, rqt_status expected, const char *sentence) {
    expect_no_geometry(text, strlen(text), true, expected, sentence);
}

/* -------------------------------------------------------------------------------------------- blobs -- */
typedef struct bytes {
    uint8_t at[4096];
    size_t n;
} bytes;

static void put_ordered(bytes *b, uint64_t bits, size_t size, bool big) {
    for (size_t i = 0; i < size; i++) b->at[b->n + i] = (uint8_t)(bits >> 8 * (big ? size - 1 - i : i));
    b->n += size;
}

/* A program of words: bXX a byte in hexadecimal, o the byte order (0 or 1), t the same for a TinyPoint, iN an
 * integer of 32 bits, dX a double, fX a float, m 4 doubles of an envelope. */
static bytes build(const char *program, bool big) {
    bytes b = {{0}, 0};
    for (const char *p = program; *p;) {
        char *end = (char *)(uintptr_t)(p + 1);
        double d;
        float f;
        uint64_t bits = 0;
        switch (*p) {
        case ' ':
            break;
        case 'b':
            b.at[b.n++] = (uint8_t)strtoul(p + 1, &end, 16);
            break;
        case 'o':
            b.at[b.n++] = big ? 0 : 1;
            break;
        case 't':
            b.at[b.n++] = big ? 0x80 : 0x81;
            break;
        case 'i':
            put_ordered(&b, (uint64_t)strtoll(p + 1, &end, 0), 4, big);
            break;
        case 'd':
            d = strtod(p + 1, &end);
            memcpy(&bits, &d, 8);
            put_ordered(&b, bits, 8, big);
            break;
        case 'f':
            f = strtof(p + 1, &end);
            memcpy(&bits, &f, 4); /* tests run on little-endian machines */
            put_ordered(&b, bits, 4, big);
            break;
        case 'm':
            for (int i = 0; i < 4; i++) put_ordered(&b, 0x7FF8000000000000u, 8, big); /* NaN: must not matter */
            break;
        default:
            fail_msg("bad program %s", program);
        }
        p = end;
    }
    return b;
}

static bytes from_hex(const char *hex) {
    bytes b = {{0}, 0};
    for (; hex[0]; hex += 2) {
        char two[3] = {hex[0], hex[1], 0};
        b.at[b.n++] = (uint8_t)strtoul(two, NULL, 16);
    }
    return b;
}

typedef struct sample {
    const char *bytes; /* a program, or hexadecimal when it starts with a digit */
    const char *expected;
    int32_t srid;
} sample;

#define GP "b47 b50 b0 "
#define SPATIALITE "b0 o i4326 m b7C "
#define SQUARE "(0 0,10 0,10 10,0 10,0 0)"
#define HOLE "(2 2,4 2,4 4,2 2)"

static const sample golden[] = {
    {"0001E6100000000000000000F03F0000000000000040000000000000F03F00000000000000407C01000000000000000000F03F000000"
     "0000000040FE",
     "P(1 2)", 4326},
    {"47500003E6100000000000000000F03F000000000000F03F000000000000004000000000000000400101000000000000000000F03F00"
     "00000000000040",
     "P(1 2)", 4326},
    {"0001E610000000000000000000000000000000000000000000000000244000000000000024407C030000000200000005000000000000"
     "000000000000000000000000000000000000002440000000000000000000000000000024400000000000002440000000000000000000"
     "000000000024400000000000000000000000000000000004000000000000000000004000000000000000400000000000001040000000"
     "00000000400000000000001040000000000000104000000000000000400000000000000040FE",
     "A" SQUARE HOLE, 4326},
    {"47500003E610000000000000000000000000000000002440000000000000000000000000000024400103000000020000000500000000"
     "000000000000000000000000000000000000000000244000000000000000000000000000002440000000000000244000000000000000"
     "000000000000002440000000000000000000000000000000000400000000000000000000400000000000000040000000000000104000"
     "000000000000400000000000001040000000000000104000000000000000400000000000000040",
     "A" SQUARE HOLE, 4326},
    {"47500003E6100000000000000000000000000000000018400000000000000000000000000000184001BE0B00000200000001BB0B0000"
     "010000000400000000000000000000000000000000000000000000000000F03F00000000000000400000000000001040000000000000"
     "0000000000000000F03F000000000000004000000000000000000000000000001040000000000000F03F000000000000004000000000"
     "000000000000000000000000000000000000F03F000000000000004001BB0B0000010000000400000000000000000014400000000000"
     "001440000000000000F03F000000000000004000000000000018400000000000001440000000000000F03F0000000000000040000000"
     "00000018400000000000001840000000000000F03F000000000000004000000000000014400000000000001440000000000000F03F00"
     "00000000000040",
     "A(0 0,4 0,0 4,0 0) A(5 5,6 5,6 6,5 5)", 4326},
    {"0001E864000000000000000000000000000000000000000000000000084000000000000010407C070000000300000069010000000000"
     "00000000F03F000000000000004069020000000200000000000000000000000000000000000000000000000000084000000000000010"
     "406903000000010000000400000000000000000000000000000000000000000000000000F03F00000000000000000000000000000000"
     "000000000000F03F00000000000000000000000000000000FE",
     "P(1 2) L(0 0,3 4) A(0 0,1 0,0 1,0 0)", 25832},
    {"0001E6100000000000000000F03F0000000000000040000000000000104000000000000014407CEC0300000200000069E90300000000"
     "00000000F03F0000000000000040000000000000084069E9030000000000000000104000000000000014400000000000001840FE",
     "P(1 2) P(4 5)", 4326},
    {"0001E6100000000000000000F03F000000000000F03F0000000000001C4000000000000020407CD50700000200000069D20700000200"
     "0000000000000000F03F0000000000000040000000000000084000000000000010400000000000001440000000000000184069D20700"
     "00020000000000000000001C4000000000000020400000000000002240000000000000F03F000000000000F03F000000000000F03FFE",
     "L(1 2,4 5) L(7 8,1 1)", 4326},
    {"0001E6100000000000000000000000000000000000000000000000000C400000000000001C407C42420F000400000000000000000000"
     "0000000000000000000000803F0000803F0000803F000080400000000000000C400000000000001C40FE",
     "L(0 0,1 1,2 5,3.5 7)", 4326},
    {"0001E610000000000000000000000000000000000000000000000000244000000000000024407C2B460F000200000005000000000000"
     "00000000000000000000000000000000000000144000002041000000000000803F00000000000020410000803F000020C10000000000"
     "00803F0000000000000000000000000000000000000000000014400400000000000000000000400000000000000040000000000000F0"
     "3F00000040000000000000000000000000000000400000000000000000000000400000000000000040000000000000F03FFE",
     "A" SQUARE HOLE, 4326},
    {"0001E610000000000000000000000000000000000000000000000000244000000000000024407CFB4D0F000100000005000000000000"
     "000000000000000000000000000000000000001440000000000000F03F00002041000000000000803F000000000000F03F0000000000"
     "0020410000803F000000000000F03F000020C1000000000000803F000000000000F03F00000000000000000000000000000000000000"
     "0000001440000000000000F03FFE",
     "A" SQUARE, 4326},
    {"0001E610000000000000000000000000000000000000000000000000244000000000000024407C124A0F000300000000000000000000"
     "000000000000000000000000000000144000002041000000000000000000001840000000000000244000000000000024400000000000"
     "001C40FE",
     "L(0 0,10 0,10 10)", 4326},
    {"0081E610000004000000000000F03F000000000000004000000000000008400000000000001040FE", "P(1 2)", 4326},
    {"01010000A0E6100000000000000000F03F00000000000000400000000000000840", "P(1 2)", 4326},
};

static const sample programs[] = {
    /* GeoPackage: each envelope, both header orders (flags hold the order: bit 0 set where little, so two lines) */
    {GP "b1 i4326 o i1 d1 d2", "P(1 2)", 4326},
    {GP "b1 i0 o i1001 d1 d2 d3", "P(1 2)", 0},
    {GP "b1 i-1 o i2001 d1 d2 d3", "P(1 2)", 0},
    {GP "b3 i-5 m o i3001 d1 d2 d3 d4", "P(1 2)", -5},
    {GP "b5 i25832 m d0 d0 o i1 d1 d2", "P(1 2)", 25832},
    {GP "b7 i4326 m d0 d0 o i1 d1 d2", "P(1 2)", 4326},
    {GP "b9 i4326 m m o i1 d1 d2", "P(1 2)", 4326},
    {GP "b11 i4326 o i1 dnan dnan", "", 4326},
    {GP "b11 i4326 o i3 i0", "", 4326},
    {GP "b11 i4326 o i7 i2 o i1 dnan dnan o i6 i0", "", 4326},
    {GP "b1 i0 o i0xA0000001 i4326 d1 d2 d3", "P(1 2)", 4326},
    {GP "b1 i25832 o i0x20000001 i4326 d1 d2", "P(1 2)", 25832},
    /* plain WKB, ISO and EWKB */
    {"o i1 d1 d2", "P(1 2)", 0},
    {"o i0x80000001 d1 d2 d3", "P(1 2)", 0},
    {"o i0x40000001 d1 d2 d3", "P(1 2)", 0},
    {"o i0xC0000001 d1 d2 d3 d4", "P(1 2)", 0},
    {"o i0xE0000001 i4326 d1 d2 d3 d4", "P(1 2)", 4326},
    {"o i1001 d1 d2 dnan", "P(1 2)", 0}, /* z is not looked at */
    {"o i2 i2 d0 d0 d3 d4", "L(0 0,3 4)", 0},
    {"o i2 i0", "", 0},
    {"o i3 i1 i4 d0 d0 d1 d0 d0 d1 d0 d0", "A(0 0,1 0,0 1,0 0)", 0},
    {"o i3 i1 i0", "", 0},
    {"o i1003 i1 i4 d0 d0 d5 d1 d0 d5 d0 d1 d5 d0 d0 d6", "A(0 0,1 0,0 1,0 0)", 0},
    {"o i4 i2 o i1 d1 d2 o i1 dnan dnan", "P(1 2)", 0},
    {"o i4 i2 b1 b1 b0 b0 b0 d0 d0 b0 b0 b0 b0 b1 d0 d0", "P(0 0) P(0 0)", 0}, /* each member its own order */
    {"o i5 i1 o i2 i2 d0 d0 d3 d4", "L(0 0,3 4)", 0},
    {"o i6 i2 o i3 i1 i4 d0 d0 d1 d0 d0 d1 d0 d0 o i3 i0", "A(0 0,1 0,0 1,0 0)", 0},
    {"o i7 i2 o i7 i1 o i4 i1 o i1 d1 d2 o i2 i2 d0 d0 d3 d4", "P(1 2) L(0 0,3 4)", 0},
    {"o i0x20000007 i4326 i1 o i0x20000001 i4326 d1 d2", "P(1 2)", 4326},
    /* SpatiaLite */
    {SPATIALITE "i1 d1 d2 bFE", "P(1 2)", 4326},
    {"b0 o i-1 m b7C i1 d1 d2 bFE", "P(1 2)", 0},
    {SPATIALITE "i3002 i2 d0 d0 d1 d1 d3 d4 d1 d1 bFE", "L(0 0,3 4)", 4326},
    {SPATIALITE "i3 i2 i5 d0 d0 d10 d0 d10 d10 d0 d10 d0 d0 i4 d2 d2 d4 d2 d4 d4 d2 d2 bFE", "A" SQUARE HOLE, 4326},
    {SPATIALITE "i1000002 i4 d0 d0 f1 f1 f1 f4 d3.5 d7 bFE", "L(0 0,1 1,2 5,3.5 7)", 4326},
    {SPATIALITE "i1003002 i3 d0 d0 d5 d6 f1 f2 f3 d4 d3.5 d7 d1 d1 bFE", "L(0 0,1 2,3.5 7)", 4326},
    {SPATIALITE "i7 i2 b69 i1000003 i1 i4 d0 d0 f4 f0 f-4 f4 d0 d0 b69 i1 d1 d2 bFE", "A(0 0,4 0,0 4,0 0) P(1 2)",
     4326},
    {SPATIALITE "i6 i0 bFE", "", 4326},
    {"b0 t i4326 b1 d1 d2 bFE", "P(1 2)", 4326},
    {"b0 t i0 b2 d1 d2 d3 bFE", "P(1 2)", 0},
    {"b0 t i4326 b3 d1 d2 d3 bFE", "P(1 2)", 4326},
    {"b0 t i4326 b4 d1 d2 d3 d4 bFE", "P(1 2)", 4326},
};

/* All samples, the programs in both byte orders; the GeoPackage flag follows. */
static size_t sample_count(void) {
    return COUNT(golden) + 2 * COUNT(programs);
}

static const sample *sample_at(size_t i, bytes *b) {
    if (i < COUNT(golden)) {
        *b = from_hex(golden[i].bytes);
        return &golden[i];
    }
    const sample *s = &programs[(i - COUNT(golden)) / 2];
    bool big = (i - COUNT(golden)) % 2;
    *b = build(s->bytes, big);
    if (b->at[0] == 'G' && big) b->at[3] &= 0xFE;
    return s;
}

/* -------------------------------------------------------------------------------------------- tests -- */
static void test_text_is_read_as_written(void **state) {
    (void)state;
    expect_text("POINT(1 2)", "P(1 2)", 0);
    expect_text(" \t\r\n pOiNt \v\f ( 1   2 ) \n", "P(1 2)", 0);
    expect_text("LINESTRING(0 0,3 4,-1.5e1 +.25)", "L(0 0,3 4,-15 0.25)", 0);
    expect_text("polygon((0 0,10 0,10 10,0 10,0 0),(2 2,4 2,4 4,2 2))", "A" SQUARE HOLE, 0);
    expect_text("SRID=4326;POLYGON Z ((0 0 1,1 0 1,0 1 1,0 0 2))", "A(0 0,1 0,0 1,0 0)", 4326);
    expect_text("srid = 25832 ; POINT EMPTY", "", 25832);
    expect_text("SRID=-1;POINT(1 2)", "P(1 2)", 0);
    expect_text("SRID=0;POINT(1 2)", "P(1 2)", 0);
    expect_text("SRID=2147483647;POINT(1 2)", "P(1 2)", 2147483647);
    expect_text("POINTZ(1 2 3)", "P(1 2)", 0);
    expect_text("POINT Z(1 2 3)", "P(1 2)", 0);
    expect_text("POINT zm (1 2 3 4)", "P(1 2)", 0);
    expect_text("POINTM (1 2 3)", "P(1 2)", 0);
    expect_text("POINTZM(1 2 3 4)", "P(1 2)", 0);
    expect_text("POINT(1 2 3)", "P(1 2)", 0);
    expect_text("POINT(1 2 3 4)", "P(1 2)", 0);
    expect_text("MULTIPOINT(1 2,3 4)", "P(1 2) P(3 4)", 0);
    expect_text("MULTIPOINT((1 2),(3 4))", "P(1 2) P(3 4)", 0);
    expect_text("MULTIPOINT((1 2),EMPTY,3 4)", "P(1 2) P(3 4)", 0);
    expect_text("MULTIPOINT Z (1 2 3)", "P(1 2)", 0);
    expect_text("MULTILINESTRINGM((0 0 1,3 4 1),(1 1 2,2 2 2))", "L(0 0,3 4) L(1 1,2 2)", 0);
    expect_text("MULTILINESTRING(EMPTY,(1 1,2 2))", "L(1 1,2 2)", 0);
    expect_text("MULTIPOLYGON(((0 0,1 0,0 1,0 0)),EMPTY,((5 5,6 5,6 6,5 5)))",
                "A(0 0,1 0,0 1,0 0) A(5 5,6 5,6 6,5 5)", 0);
    expect_text("GEOMETRYCOLLECTION(POINT(1 2),GEOMETRYCOLLECTION(LINESTRING(0 0,3 4),POINT EMPTY),"
                "GEOMETRYCOLLECTION EMPTY,MULTIPOINT(5 6))",
                "P(1 2) L(0 0,3 4) P(5 6)", 0);
    expect_text("GEOMETRYCOLLECTION Z(POINT Z(1 2 3))", "P(1 2)", 0);
    static const char *const empty[] = {"POINT EMPTY",           "POINT Z EMPTY",      "LINESTRING empty",
                                        "POLYGONZM EMPTY",       "MULTIPOINT EMPTY",   "MULTIPOLYGON(EMPTY)",
                                        "MULTILINESTRING EMPTY", "MULTIPOLYGON EMPTY", "GEOMETRYCOLLECTION M EMPTY",
                                        "POLYGON(EMPTY)"};
    for (size_t i = 0; i < COUNT(empty); i++) expect_text(empty[i], "", 0);
}

static void test_text_errors_say_what_and_where(void **state) {
    (void)state;
    expect_no_text("", RQT_INVALID, "name of a geometry type is expected at character 1");
    expect_no_text("   ", RQT_INVALID, "at character 4");
    expect_no_text("POINT", RQT_INVALID, "'(' is expected at character 6");
    expect_no_text("POINTY(1 2)", RQT_INVALID, "name of a geometry type");
    expect_no_text("POINT(1)", RQT_INVALID, "a number is expected at character 8");
    expect_no_text("POINT(1 2", RQT_INVALID, "')' is expected at character 10");
    expect_no_text("POINT(1 2) x", RQT_INVALID, "goes on at character 12");
    expect_no_text("POINT(1,2)", RQT_INVALID, "a number is expected");
    expect_no_text("POINT(1 2 3 4 5)", RQT_INVALID, "more than 4 numbers at character 7");
    expect_no_text("POINT Z(1 2)", RQT_INVALID, "wrong number of ordinates at character 9");
    expect_no_geometry("POINT(1 2)\0", 11, true, RQT_INVALID, "goes on at character 11");
    expect_no_text("LINESTRING(1 2,3 4 5)", RQT_INVALID, "wrong number of ordinates at character 16");
    expect_no_text("LINESTRING(1 2)", RQT_INVALID, "line 1 has fewer than 2 points");
    expect_no_text("POINT(nan 2)", RQT_INVALID, "not finite at character 7");
    expect_no_text("POINT(1 -Inf)", RQT_INVALID, "not finite at character 9");
    expect_no_text("POINT(1 +Infinity)", RQT_INVALID, "not finite at character 9");
    expect_no_text("POINT(1e309 2)", RQT_INVALID, "too large at character 7");
    expect_no_text("POINT(1e99999999999999999999999 2)", RQT_INVALID, "too large");
    expect_no_text("POINT(1x 2)", RQT_INVALID, "malformed at character 7");
    expect_no_text("POINT(0x10 2)", RQT_INVALID, "malformed");
    expect_no_text("POINT(1.2.3 2)", RQT_INVALID, "malformed");
    expect_no_text("POINT(1e 2)", RQT_INVALID, "malformed");
    expect_no_text("POINT(1e+ 2)", RQT_INVALID, "malformed");
    expect_no_text("POINT(. 2)", RQT_INVALID, "a number is expected");
    expect_no_text("POINT(--1 2)", RQT_INVALID, "a number is expected");
    expect_no_text("SRID=4326 POINT(1 2)", RQT_INVALID, "';' is expected at character 11");
    expect_no_text("SRID=;POINT(1 2)", RQT_INVALID, "not a number");
    expect_no_text("SRID=2147483648;POINT(1 2)", RQT_INVALID, "too large");
    expect_no_text("SRID 4326;POINT(1 2)", RQT_INVALID, "'=' is expected");
    expect_no_text("POLYGON((0 0,1 0,1 1,0 1))", RQT_INVALID, "polygon 1: ring 1 is not closed");
    expect_no_text("POLYGON((0 0,1 0,0 0))", RQT_INVALID, "ring 1 has fewer than 4 points");
    expect_no_text("POLYGON((0 0))", RQT_INVALID, "ring 1 has fewer than 4 points");
    expect_no_text("MULTIPOLYGON(EMPTY,((0 0,9 0,0 9,0 0),(1 1,2 1,1 2,1 1.5)))", RQT_INVALID,
                   "polygon 2: ring 2 is not closed");
    expect_no_text("POLYGON(EMPTY,(0 0,9 0,0 9,0 0))", RQT_INVALID, "ring 1 is empty");
    expect_no_text("MULTIPOLYGON((0 0,1 0,0 1,0 0))", RQT_INVALID, "'(' is expected");
    expect_no_text("GEOMETRYCOLLECTION(1 2)", RQT_INVALID, "name of a geometry type");
    expect_no_text("GEOMETRYCOLLECTION(POINT(1 2),)", RQT_INVALID, "name of a geometry type");
    expect_no_text("CIRCULARSTRING(0 0,1 1,2 0)", RQT_UNSUPPORTED, "CIRCULARSTRING is not supported");
    expect_no_text("CurvePolygonZ((0 0,1 1,2 0))", RQT_UNSUPPORTED, "CURVEPOLYGON");
    expect_no_text("TIN Z(((0 0 0,0 1 0,1 0 0,0 0 0)))", RQT_UNSUPPORTED, "TIN is");
    expect_no_text("GEOMETRYCOLLECTION(POLYHEDRALSURFACE EMPTY)", RQT_UNSUPPORTED, "POLYHEDRALSURFACE");
}

static double read_number(const char *text) {
    char buffer[4000];
    rqt_geometry *g;
    (void)snprintf(buffer, sizeof buffer, "POINT(%s 0)", text);
    if (parse(buffer, strlen(buffer), true, &g) != RQT_OK) fail_msg("%s: %s", text, message.text);
    double v = g->points[0].x;
    rqt_geometry_free(g);
    return v;
}

static void test_numbers_are_the_nearest_doubles(void **state) {
    (void)state;
    static const char *const numbers[] = {"0",
                                          "-0.0",
                                          "1",
                                          "0.1",
                                          "1e308",
                                          "1.7976931348623157e308",
                                          "4.9e-324",
                                          "2e-324",
                                          "1e-400",
                                          "000123.4560",
                                          "9007199254740993",
                                          "1.00000000000000011102230246251565404236316680908203125",
                                          ".5E+1",
                                          "5.e-1",
                                          "0e999999999",
                                          "123456789012345678901234567890",
                                          "2.2250738585072011e-308",
                                          "0.000000000000000000000000000001e30"};
    for (size_t i = 0; i < COUNT(numbers); i++) assert_true(read_number(numbers[i]) == strtod(numbers[i], NULL));
    uint64_t bits = 0x9E3779B97F4A7C15u;
    char text[64];
    for (int i = 0; i < 20000; i++) {
        double v;
        bits = bits * 6364136223846793005u + 1442695040888963407u;
        memcpy(&v, &bits, 8);
        if (!isfinite(v)) continue;
        (void)snprintf(text, sizeof text, i % 2 ? "%.17g" : "%.25e", v);
        if (read_number(text) != v) fail_msg("%s", text);
    }
    /* a tie that only its 900th digit breaks: longer than what is kept */
    char tie[1200] = "1.00000000000000011102230246251565404236316680908203125";
    size_t n = strlen(tie);
    memset(tie + n, '0', 900);
    tie[n + 900] = 0;
    assert_true(read_number(tie) == 1.0);
    tie[n + 899] = '1';
    assert_true(read_number(tie) == 1.0000000000000002);
    memset(tie, '0', 1000); /* many digits before the point, and leading zeros */
    memcpy(tie + 1000, "7.5", 4);
    assert_true(read_number(tie) == 7.5);
    memset(tie, '1', 1000);
    memcpy(tie + 1000, "e-999", 6);
    assert_true(read_number(tie) == strtod(tie, NULL));
}

static void test_numbers_ignore_the_locale(void **state) {
    (void)state;
    static const char *const commas[] = {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "de_DE", "nl_NL.UTF-8"};
    bool found = false;
    for (size_t i = 0; i < COUNT(commas) && !found; i++) found = setlocale(LC_ALL, commas[i]) != NULL;
    rqt_geometry *g;
    static const char text[] = "POINT(1.5 -2.25e1)";
    rqt_status status = parse(text, strlen(text), true, &g);
    (void)setlocale(LC_ALL, "C");
    assert_int_equal(status, RQT_OK);
    assert_string_equal(describe(g), "P(1.5 -22.5)");
    rqt_geometry_free(g);
    if (!found) skip(); /* no such locale here */
}

static void test_blobs_are_read_as_written(void **state) {
    (void)state;
    for (size_t i = 0; i < sample_count(); i++) {
        bytes b;
        const sample *s = sample_at(i, &b);
        expect_geometry(b.at, b.n, false, s->expected, s->srid);
    }
}

/* What is handed to others reads back as what it was, byte for byte the same again; empty ones too. */
static void test_wkb_is_read_back(void **state) {
    (void)state;
    for (size_t i = 0; i < sample_count(); i++) {
        bytes b;
        const sample *s = sample_at(i, &b);
        rqt_geometry *g, *again;
        uint8_t *wkb[2];
        size_t size[2];
        assert_int_equal(parse(b.at, b.n, false, &g), RQT_OK);
        assert_int_equal(rqt_geometry_is_empty(g), s->expected[0] == 0);
        assert_int_equal(rqt_geometry_wkb(g, &allocator, &wkb[0], &size[0]), RQT_OK);
        expect_geometry(wkb[0], size[0], false, s->expected, 0);
        assert_int_equal(parse(wkb[0], size[0], false, &again), RQT_OK);
        assert_int_equal(rqt_geometry_wkb(again, &allocator, &wkb[1], &size[1]), RQT_OK);
        assert_int_equal(size[0], size[1]);
        assert_memory_equal(wkb[0], wkb[1], size[0]);
        test_heap.fail_at = test_heap.calls + 1;
        uint8_t *none = (uint8_t *)&b;
        assert_int_equal(rqt_geometry_wkb(g, &allocator, &none, &size[1]), RQT_NO_MEMORY);
        assert_null(none);
        test_heap.fail_at = 0;
        for (int k = 0; k < 2; k++) heap_resize(&test_heap, wkb[k], 0);
        rqt_geometry_free(g);
        rqt_geometry_free(again);
    }
}

static void test_blob_errors_say_what_and_where(void **state) {
    (void)state;
    static const struct {
        const char *program;
        rqt_status status;
        const char *sentence;
    } bad[] = {
        {"", RQT_INVALID, "cut off at byte 0"},
        {"b47 b50", RQT_INVALID, "cut off"},
        {"b50 b47 b0 b1", RQT_INVALID, "wrong first byte"},
        {"b47 b50 b1 b1 i0 o i1 d1 d2", RQT_UNSUPPORTED, "version of the GeoPackage geometry: 1"},
        {GP "bB i0 o i1 d1 d2", RQT_INVALID, "kind of envelope at byte 3"},
        {GP "b21 i0 o i1 d1 d2", RQT_UNSUPPORTED, "extended"},
        {GP "b11 i0 o i1 d1 d2", RQT_INVALID, "against the flag"},
        {"o i8 i0", RQT_UNSUPPORTED, "CIRCULARSTRING"},
        {"o i1010 i0", RQT_UNSUPPORTED, "CURVEPOLYGON"},
        {"o i1015 i0", RQT_UNSUPPORTED, "POLYHEDRALSURFACE"},
        {"o i16 i0", RQT_UNSUPPORTED, "TIN"},
        {"o i17 i0", RQT_UNSUPPORTED, "TRIANGLE"},
        {"o i7 i1 o i11 i0", RQT_UNSUPPORTED, "MULTICURVE"},
        {"o i18 i0", RQT_INVALID, "unknown geometry type 18"},
        {"o i0 i0", RQT_INVALID, "unknown geometry type 0"},
        {"o i4001 d1 d2", RQT_INVALID, "unknown geometry type at byte 1"},
        {"o i1 d1 d2 b0", RQT_INVALID, "go on at byte 21"},
        {"o i1 dnan d2", RQT_INVALID, "not finite at byte 5"},
        {"o i1 dinf d2", RQT_INVALID, "not finite"},
        {"o i2 i2 d0 d0 dnan dnan", RQT_INVALID, "not finite at byte 25"},
        {"o i2 i1 d0 d0", RQT_INVALID, "fewer than 2 points"},
        {"o i3 i1 i4 d0 d0 d1 d0 d0 d1 d0 d1", RQT_INVALID, "ring 1 is not closed"},
        {"o i3 i1 i3 d0 d0 d1 d0 d0 d0", RQT_INVALID, "fewer than 4 points"},
        {"o i3 i2 i0 i4 d0 d0 d1 d0 d0 d1 d0 d0", RQT_INVALID, "ring 1 is empty"},
        {"o i4 i1 o i2 i0 d0", RQT_INVALID, "another type than its collection at byte 9"},
        {"o i4 i1 b2 i1 d0 d0", RQT_INVALID, "neither 0 nor 1 at byte 9"},
        {"o i0x20000007 i4326 i1 o i0x20000001 i4327 d1 d2", RQT_INVALID, "another SRID"},
        {SPATIALITE "i1 d1 dinf bFE", RQT_INVALID, "not finite at byte 43"},
        {SPATIALITE "i1 dnan dnan bFE", RQT_INVALID, "not finite at byte 43"},
        {SPATIALITE "i1 d1 d2 b0 bFE", RQT_INVALID, "go on"},
        {SPATIALITE "i4 i1 b70 i1 d1 d2 bFE", RQT_INVALID, "0x69"},
        {SPATIALITE "i1000001 d1 d2 bFE", RQT_INVALID, "compressed"},
        {SPATIALITE "i1000002 i3 d0 d0 finf f1 d1 d1 bFE", RQT_INVALID, "not finite"},
        {SPATIALITE "i1000002 i3 d0 d0 d0 d0 bFE", RQT_INVALID, "cut off"},
        {"b0 b1 b0 b0 b0 b0 m b7D b1 b0 b0 b0 d1 d2 bFE", RQT_INVALID, "0x7C is missing at byte 38"},
        {"b0 b1 b0 b0 b0 b0 m b7C b1 b0 b0 b0 d1 d2 bFF", RQT_INVALID, "0xFE is missing"},
        {"b0 b81 b0 b0 b0 b0 b5 d1 d2 bFE", RQT_INVALID, "kind of TinyPoint"},
        {"b0 b81 b0 b0 b0 b0 b1 d1 d2 bFF", RQT_INVALID, "0xFE is missing"},
        /* hostile counts: nothing may be made of them */
        {"o i2 i0xFFFFFFFF d0 d0", RQT_INVALID, "a count is larger than the geometry at byte 5"},
        {"o i3 i0xFFFFFFFF i0", RQT_INVALID, "count"},
        {"o i3 i1 i0x10000000 d0 d0", RQT_INVALID, "count"},
        {"o i7 i0x7FFFFFFF o i1 d0 d0", RQT_INVALID, "count"},
        {"o i1004 i0x10000001 d0 d0", RQT_INVALID, "count"},
        {SPATIALITE "i1000002 i0xFFFFFFFF d0 d0 bFE", RQT_INVALID, "count"},
        {SPATIALITE "i1000003 i1 i0x80000000 d0 d0 bFE", RQT_INVALID, "count"},
    };
    for (size_t i = 0; i < COUNT(bad); i++) {
        bytes b = build(bad[i].program, false);
        expect_no_geometry(b.at, b.n, false, bad[i].status, bad[i].sentence);
    }
    assert_true(test_heap.calls < 2000);
}

static void test_every_truncation_is_refused(void **state) {
    (void)state;
    for (size_t i = 0; i < sample_count(); i++) {
        bytes b;
        (void)sample_at(i, &b);
        for (size_t n = 0; n < b.n; n++) {
            rqt_geometry *g;
            rqt_status status = parse(b.at, n, false, &g);
            if (status != RQT_INVALID && status != RQT_UNSUPPORTED)
                fail_msg("sample %zu, %zu bytes of %zu: status %d", i, n, b.n, (int)status);
        }
    }
    static const char text[] = "SRID=1;GEOMETRYCOLLECTION ZM(POLYGON((0 0,1 0,0 1,0 0)),MULTIPOINT((1 2),3 4e1))";
    for (size_t n = 0; n + 1 < sizeof text; n++) expect_no_geometry(text, n, true, RQT_INVALID, " at character ");
}

static void try_any(const void *b, size_t n, bool text) {
    rqt_geometry *g;
    rqt_status status = parse(b, n, text, &g);
    if (status == RQT_OK)
        (void)describe(g);
    else
        assert_true(status == RQT_INVALID || status == RQT_UNSUPPORTED);
    rqt_geometry_free(g);
}

static void test_no_flipped_byte_does_harm(void **state) {
    (void)state;
    for (size_t i = 0; i < sample_count(); i++) {
        bytes b;
        (void)sample_at(i, &b);
        for (size_t n = 0; n < b.n; n++) {
            uint8_t good = b.at[n];
            for (int flip = 1; flip < 256; flip += flip < 16 ? 1 : 5) {
                b.at[n] = good ^ (uint8_t)flip;
                try_any(b.at, b.n, false);
            }
            b.at[n] = good;
        }
    }
    char text[] = "SRID=1;GEOMETRYCOLLECTION ZM(POLYGON((0 0 1 2,1 0 1 2,0 1 1 2,0 0 1 2)),MULTIPOINT((1e3 2)))";
    for (size_t n = 0; n + 1 < sizeof text; n++) {
        char good = text[n];
        for (int c = 0; c < 256; c++) {
            text[n] = (char)c;
            try_any(text, sizeof text - 1, true);
        }
        text[n] = good;
    }
}

static void test_junk_does_no_harm(void **state) {
    (void)state;
    uint64_t bits = 12345;
    uint8_t junk[200];
    static const char words[] =
        "POINT\0Z\0(\0)\0,\0EMPTY\0 1\0 2.5e\0MULTIPOLYGON\0GEOMETRYCOLLECTION\0SRID=1;\0 \0.";
    for (int round = 0; round < 100000; round++) {
        size_t n = 0, wanted = (size_t)(round % 90);
        bool text = round % 3 == 0;
        while (n < wanted) {
            bits = bits * 6364136223846793005u + 1442695040888963407u;
            const char *word = words + (bits >> 40) % (sizeof words - 1);
            if (text) {
                for (; *word && n < wanted; word++) junk[n++] = (uint8_t)*word;
                if (!*word && n < wanted && bits >> 60 == 0) junk[n++] = ' ';
            } else {
                junk[n++] = (uint8_t)(bits >> 33) & (bits >> 62 ? 7 : 255);
            }
        }
        if (round % 3 == 1 && n > 40) { /* past the first checks */
            junk[0] = 0;
            junk[1] &= 1;
            junk[38] = 0x7C;
            junk[n - 1] = 0xFE;
        }
        try_any(junk, n, text);
    }
}

static void test_nesting_is_limited(void **state) {
    (void)state;
    static char text[24 * 5000];
    static uint8_t blob[9 * 5000 + 30];
    for (int depth = 1; depth <= 5000; depth = depth < 40 ? depth + 1 : depth * 5) {
        size_t n = 0, m = 0;
        for (int i = 0; i < depth; i++) n += (size_t)sprintf(text + n, "GEOMETRYCOLLECTION(");
        n += (size_t)sprintf(text + n, "POINT(1 2)");
        for (int i = 0; i < depth; i++) text[n++] = ')';
        for (int i = 0; i < depth; i++, m += 9) {
            blob[m] = 1;
            put32(blob + m + 1, 7);
            put32(blob + m + 5, 1);
        }
        bytes point = build("o i1 d1 d2", false);
        memcpy(blob + m, point.at, point.n);
        m += point.n;
        if (depth <= GEOMETRY_MAX_DEPTH) {
            expect_geometry(text, n, true, "P(1 2)", 0);
            expect_geometry(blob, m, false, "P(1 2)", 0);
        } else {
            expect_no_geometry(text, n, true, RQT_INVALID, "nested too deep at character");
            expect_no_geometry(blob, m, false, RQT_INVALID, "nested too deep at byte");
        }
    }
}

static void test_every_refused_allocation_is_reported(void **state) {
    (void)state;
    char text[4000] = "GEOMETRYCOLLECTION(POINT(1 2)";
    for (int i = 0; i < 80; i++) strcat(text, ",POLYGON((0 0,1 0,0 1,0 0))");
    strcat(text, ")");
    for (size_t fail = 1;; fail++) {
        rqt_geometry *g;
        test_heap.calls = 0;
        test_heap.fail_at = fail;
        rqt_status status = parse(text, strlen(text), true, &g);
        if (status == RQT_OK) {
            assert_true(fail > 6);
            rqt_geometry_free(g);
            break;
        }
        assert_int_equal(status, RQT_NO_MEMORY);
        assert_int_equal(test_heap.live, 0);
    }
    test_heap.fail_at = 0;
    rqt_geometry_free(NULL);
    rqt_geometry *g;
    assert_int_equal(rqt_geometry_parse("POINT", 5, true, &allocator, &g, NULL),
                     RQT_INVALID); /* no message wanted */
}

/* What rqt_geometry_repeat makes of a text, as a line of text. */
static const char *repeated(const char *text, double period, double low, double high) {
    rqt_geometry *g;
    assert_int_equal(parse(text, strlen(text), true, &g), RQT_OK);
    assert_int_equal(rqt_geometry_repeat(g, period, low, high), RQT_OK);
    const char *said = describe(g);
    rqt_geometry_free(g);
    return said;
}

static void F25_a_geometry_is_repeated_around_the_world(void **state) {
    (void)state;
    assert_string_equal(repeated("POINT(10 50)", 360, 0, 360), "P(10 50)");
    assert_string_equal(repeated("POINT(-10 50)", 360, 0, 360), "P(-10 50) P(350 50)");
    assert_string_equal(repeated("POINT(350 50)", 360, -180, 180), "P(350 50) P(-10 50)");
    /* The interval is closed, and a box that touches it is on it. */
    assert_string_equal(repeated("POINT(-180 1)", 360, -180, 180), "P(-180 1) P(180 1)");
    assert_string_equal(repeated("LINESTRING(-20 1,0 2)", 360, 360, 361), "L(-20 1,0 2) L(340 1,360 2)");
    assert_string_equal(repeated("LINESTRING(-20 1,-1 2)", 360, 360, 361), "L(-20 1,-1 2)");
    /* The box counts, not the points: the line passes over the interval. */
    assert_string_equal(repeated("LINESTRING(-20 1,20 2)", 360, 355, 357), "L(-20 1,20 2) L(340 1,380 2)");
    /* As often as it meets, west to east, with holes; members behind the members that were read, each by itself. */
    assert_string_equal(
        repeated("GEOMETRYCOLLECTION(POLYGON((1 0,9 0,9 8,1 0),(7 1,8 1,8 2,7 1)),POINT(15 3))", 20, -20, 30),
        "A(1 0,9 0,9 8,1 0)(7 1,8 1,8 2,7 1) P(15 3) A(-19 0,-11 0,-11 8,-19 0)(-13 1,-12 1,-12 2,-13 1) "
        "A(21 0,29 0,29 8,21 0)(27 1,28 1,28 2,27 1) P(-5 3)");
    /* Nobody's longitude. */
    assert_string_equal(repeated("MULTIPOINT((1080 1),(1081 1),(-1080 1),(-1081 1))", 360, 0, 0),
                        "P(1080 1) P(1081 1) P(-1080 1) P(-1081 1) P(0 1) P(0 1)");
    assert_string_equal(repeated("POINT EMPTY", 360, -180, 180), "");
}

/* All turns are tried, in integers. */
static void copies_are_at_every_multiple_that_meets(void **state) {
    (void)state;
    uint64_t bits = 4711;
    char text[100], expected[8192];
    for (int round = 0; round < 3000; round++) {
        int number[4];
        for (int n = 0; n < 4; n++) {
            bits = bits * 6364136223846793005u + 1442695040888963407u;
            number[n] = (int)(bits >> 33) % 73 - 36;
        }
        const int period = 1 + round % 12, a = number[0], b = number[1];
        const int low = number[2] < number[3] ? number[2] : number[3], high = number[2] + number[3] - low;
        const int least = a < b ? a : b, most = a < b ? b : a;
        (void)sprintf(text, "LINESTRING(%d 5,%d 6)", a, b);
        size_t n = (size_t)sprintf(expected, "L(%d 5,%d 6)", a, b);
        for (int turn = -100; turn <= 100; turn++) {
            const int by = turn * period;
            const bool meets = least + by <= high && most + by >= low;
            if (turn == 0 || !meets || least < -3 * period || most > 3 * period) continue;
            n += (size_t)sprintf(expected + n, " L(%d 5,%d 6)", a + by, b + by);
        }
        assert_string_equal(repeated(text, period, low, high), expected);
    }
}

static void a_repetition_without_memory_is_reported(void **state) {
    (void)state;
    static const char text[] = "POLYGON((1 0,9 0,9 8,1 0),(7 1,8 1,8 2,7 1))";
    for (size_t fail = 1;; fail++) {
        rqt_geometry *g;
        test_heap.fail_at = 0;
        assert_int_equal(parse(text, strlen(text), true, &g), RQT_OK);
        test_heap.calls = 0;
        test_heap.fail_at = fail;
        const rqt_status status = rqt_geometry_repeat(g, 1000, -100000, 100000);
        const bool refused = test_heap.calls >= fail;
        assert_int_equal(status, refused ? RQT_NO_MEMORY : RQT_OK);
        if (!refused) assert_int_equal(rqt_geometry_members(g), 200);
        rqt_geometry_free(g);
        if (!refused) {
            assert_true(fail > 6);
            break;
        }
    }
    test_heap.fail_at = 0;
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, begin_test, end_test)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(test_text_is_read_as_written),
        TEST(test_text_errors_say_what_and_where),
        TEST(test_numbers_are_the_nearest_doubles),
        TEST(test_numbers_ignore_the_locale),
        TEST(test_blobs_are_read_as_written),
        TEST(test_wkb_is_read_back),
        TEST(test_blob_errors_say_what_and_where),
        TEST(test_every_truncation_is_refused),
        TEST(test_no_flipped_byte_does_harm),
        TEST(test_junk_does_no_harm),
        TEST(test_nesting_is_limited),
        TEST(test_every_refused_allocation_is_reported),
        TEST(F25_a_geometry_is_repeated_around_the_world),
        TEST(copies_are_at_every_multiple_that_meets),
        TEST(a_repetition_without_memory_is_reported),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
