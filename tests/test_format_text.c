/* test_format_text.c - numbers as text: doubles as short as they can be and read back by the C library as the same
 * bits, an obj made of them to the letter, and all of it the same in every locale.
 * Links: format.c, text.c, geometry.c, the core's code.c (or librqt.a), cmocka. */
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

#include "format.h"
#include "test_format_support.h"

/* ------------------------------------------------------------------------------------------- text of an obj -- */

static void test_obj_text(void **state) {
    (void)state;
    rqt_patch_vertex vertices[] = {{0, 0, 5, 0, 0}, {0, 1, -25, 0, 0}, {1, 0, 0, 0, 0}};
    uint32_t indices[] = {0, 1, 2};
    heap h = {0};
    rqt_allocator allocator = {heap_resize, &h};
    rqt_patch patch = {
        .vertices = vertices, .vertex_count = 3, .triangles = indices, .triangle_count = 1, .allocator = allocator};
    format_frame frame = {.placement = {600000.5, 200000, 0.25, -0.5},
                          .unit = {400, 100, 1, 1, 1, 0},
                          .srid = 21781,
                          .title = "a\nv 1 2 3",
                          .eps = 0.5};
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

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(test_obj_text, begin),
        cmocka_unit_test_setup(test_known_texts, begin),
        cmocka_unit_test_setup(test_many_doubles, begin),
        cmocka_unit_test_setup(test_locales, begin),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
