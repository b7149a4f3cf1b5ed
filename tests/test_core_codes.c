/* test_core_codes.c - units and error codes keep their promises: exact, and rounded up only.
 *
 * Each value is compared with GMP rationals. Random values seldom come near a code's boundary, so most cases are
 * made backwards: take a code, find the number of quanta that is just it, and try that number and its neighbours.
 */
#include "test_core_support.h"

#include <float.h>
#include <math.h>

/* |scale| * numerator / (denominator * d) */
static void quantum_of(const rqt_unit *unit, mpq_t quantum) {
    mpq_t part;
    mpq_init(part);
    mpq_set_d(quantum, unit->scale);
    mpq_abs(quantum, quantum);
    mpq_set_si(part, unit->numerator, (unsigned long)unit->denominator);
    mpq_canonicalize(part);
    mpq_mul(quantum, quantum, part);
    mpq_set_si(part, 1, (unsigned long)unit->d);
    mpq_mul(quantum, quantum, part);
    mpq_clear(part);
}

static void set_wide(mpz_t z, uint64_t high, uint64_t low) {
    mpz_set_ui(z, high);
    mpz_mul_2exp(z, z, 64);
    mpz_add_ui(z, z, low);
}

static rqt_unit some_unit(void) {
    const double scales[] = {1.0, 0.1, 0.01, -1.0, 0.3048, 1e-3, 0.25, 3.0, 1.0 / 3, -7.77e5, 1e30, 1e-30, 0x1p-40};
    const int ds[] = {1, 10, 100, 1000, 1024, 1 << 20, 7, 999983};
    rqt_unit u = random_unit_of_height();
    if (random_between(0, 2)) u.scale = scales[random_between(0, (int)(sizeof scales / sizeof *scales) - 1)];
    if (random_between(0, 1)) u.d = ds[random_between(0, 7)];
    if (random_between(0, 9) == 0) u.scale = ldexp(0.5 + random_unit() / 2, random_between(-60, 60));
    return u;
}

static void check_quanta(const rqt_unit *unit, uint64_t high, uint64_t low, uint64_t denominator) {
    mpq_t metres, quantum;
    mpq_inits(metres, quantum, NULL);
    set_wide(mpq_numref(metres), high, low);
    mpz_set_ui(mpq_denref(metres), denominator);
    mpq_canonicalize(metres);
    quantum_of(unit, quantum);
    mpq_mul(metres, metres, quantum);
    unsigned code = rqt_code_from_quanta(unit, high, low, denominator), right = oracle_code_up(metres);
    CHECK(code == right,
          "(%llu * 2^64 + %llu) / %llu quanta of scale %.17g * %d / %d, d = %d: code %u, should be %u",
          (unsigned long long)high, (unsigned long long)low, (unsigned long long)denominator, unit->scale,
          unit->numerator, unit->denominator, unit->d, code, right);
    mpq_clears(metres, quantum, NULL);
}

/* All 16-bit codes mean what FORMAT.md says, and order as their values do. */
static void codes_mean_what_the_format_says(void **state) {
    (void)state;
    mpq_t value, core;
    mpq_inits(value, core, NULL);
    assert_true(rqt_code_metres(0) == 0.0);
    assert_true(isinf(rqt_code_metres(RQT_CODE_INFINITY)) && rqt_code_metres(RQT_CODE_INFINITY) > 0);
    double before = -1;
    for (unsigned code = 0; code <= RQT_CODE_LARGEST; code++) {
        double metres = rqt_code_metres((rqt_code)code);
        CHECK(isfinite(metres) && metres > before, "code %u is %.17g after %.17g", code, metres, before);
        oracle_code_value(value, code);
        mpq_set_d(core, metres);
        CHECK(mpq_equal(value, core), "code %u is %.17g", code, metres);
        before = metres;
    }
    mpq_clears(value, core, NULL);
}

static void F45_errors_in_quanta_round_up_only_at_random(void **state) {
    (void)state;
    random_begin("quanta at random");
    for (int n = 0; n < 20000; n++) {
        rqt_unit unit = some_unit();
        int bits = random_between(1, 80);
        uint64_t low = random_bits(), high = random_bits() & 0xFFFF;
        if (bits <= 64)
            high = 0, low >>= 64 - bits;
        else
            high &= (1u << (bits - 64)) - 1;
        uint64_t denominator = 1 + (random_bits() >> random_between(22, 63)) % (1ull << 42);
        if (random_between(0, 3) == 0) denominator = 1ull << random_between(0, 42);
        check_quanta(&unit, high, low, denominator);
    }
}

static void F45_errors_in_quanta_round_up_only_next_to_every_code(void **state) {
    (void)state;
    random_begin("quanta next to codes");
    mpq_t boundary, quantum, part;
    mpz_t near;
    mpq_inits(boundary, quantum, part, NULL);
    mpz_init(near);
    int tried = 0;
    for (int n = 0; n < 20000; n++) {
        rqt_unit unit = some_unit();
        uint64_t denominator = random_between(0, 1) ? 1ull << random_between(0, 42)
                                                    : 1 + (random_bits() >> random_between(22, 63)) % (1ull << 42);
        quantum_of(&unit, quantum);
        /* A code in reach of numerators of up to 80 bits: that of a random numerator. */
        mpz_set_ui(mpq_numref(boundary), 1);
        mpz_mul_2exp(mpq_numref(boundary), mpq_numref(boundary), (unsigned)random_between(0, 78));
        mpz_set_ui(mpq_denref(boundary), denominator);
        mpq_canonicalize(boundary);
        mpq_mul(boundary, boundary, quantum);
        unsigned code = oracle_code_up(boundary) + (unsigned)random_between(0, 127);
        if (code > ORACLE_LARGEST) continue;
        oracle_code_value(boundary, code);
        mpq_div(boundary, boundary, quantum);
        mpq_set_ui(part, denominator, 1);
        mpq_mul(boundary, boundary, part);
        mpz_fdiv_q(near, mpq_numref(boundary), mpq_denref(boundary));
        mpz_sub_ui(near, near, 1);
        for (int step = 0; step < 4; step++, mpz_add_ui(near, near, 1)) {
            if (mpz_sgn(near) < 0 || mpz_sizeinbase(near, 2) > 80) continue;
            mpz_t high;
            mpz_init(high);
            mpz_fdiv_q_2exp(high, near, 64);
            uint64_t low = (uint64_t)mpz_getlimbn(near, 0);
            check_quanta(&unit, mpz_get_ui(high), low, denominator);
            mpz_clear(high);
            tried++;
        }
    }
    assert_true(tried > 10000);
    mpq_clears(boundary, quantum, part, NULL);
    mpz_clear(near);
}

static void exact_powers_of_feet_and_odd_scales_are_not_rounded_further(void **state) {
    (void)state;
    const rqt_unit units[] = {UNIT_METRE, UNIT_FOOT, UNIT_SURVEY_FOOT, UNIT_MILLIMETRE, UNIT_ODD};
    for (int u = 0; u < 5; u++) {
        for (int bit = 0; bit < 80; bit++) {
            /* 2^bit and its neighbours, whole and over the powers of two that planes have */
            for (int down = 0; down <= 42; down += 7) {
                uint64_t high = bit >= 64 ? 1ull << (bit - 64) : 0, low = bit < 64 ? 1ull << bit : 0;
                check_quanta(&units[u], high, low, 1ull << down);
                check_quanta(&units[u], high, low + 1, 1ull << down);
                check_quanta(&units[u], low == 0 ? high - 1 : high, low - 1, 1ull << down);
            }
        }
        check_quanta(&units[u], 0, 0, 1);
        check_quanta(&units[u], 0, 1, 1ull << 42);
        check_quanta(&units[u], 0xFFFF, UINT64_MAX, 1);
    }
}

static void scales_at_the_ends_of_double_neither_overflow_nor_vanish(void **state) {
    (void)state;
    rqt_unit unit = UNIT_METRE;
    const double scales[] = {DBL_MAX, -DBL_MAX,   DBL_MIN,  0x1p-1074, 0x1p-300,
                             0x1p250, 0x1.8p-264, 0x1p-263, 0x1p-256};
    for (size_t n = 0; n < sizeof scales / sizeof *scales; n++) {
        unit.scale = scales[n];
        for (int d = 1; d <= 1 << 20; d *= 32) {
            unit.d = d;
            const double quantum = fabs(unit.scale) / d; /* codes are exact even where units are refused */
            assert_int_equal(rqt_unit_is_valid(&unit), quantum > 0x1p-200 && quantum < 0x1p200);
            for (int bit = 0; bit < 80; bit += 5) {
                check_quanta(&unit, bit >= 64 ? 1ull << (bit - 64) : 0, bit < 64 ? 1ull << bit : 1, 1);
                check_quanta(&unit, bit >= 64 ? 1ull << (bit - 64) : 0, bit < 64 ? 1ull << bit : 1, 1ull << 42);
            }
        }
    }
}

static void F45_outline_costs_round_up_only(void **state) {
    (void)state;
    random_begin("ground");
    const double special[] = {1.0, 0.1,       25.0, 1.0 / 3, DBL_MAX, DBL_MIN, 0x1p-1074, 30.922080775909325,
                              3.0, 0x1.fffp10};
    const int count = (int)(sizeof special / sizeof *special);
    mpq_t exact, part;
    mpq_inits(exact, part, NULL);
    for (int n = 0; n < 20000; n++) {
        int64_t extent = (int64_t)(random_bits() >> random_between(43, 63));
        double cell = random_between(0, 1) ? special[random_between(0, count - 1)]
                                           : ldexp(0.5 + random_unit(), random_between(-30, 30));
        double c = random_between(0, 1) ? special[random_between(0, count - 1)]
                                        : ldexp(0.5 + random_unit(), random_between(-30, 30));
        if (random_between(0, 3) == 0) { /* land on a code or one ulp beside it */
            extent = random_between(1, 127);
            c = 1.0;
            cell = rqt_code_metres((rqt_code)random_between(30000, 40000)) / (double)extent;
            if (random_between(0, 1)) cell = nextafter(cell, random_between(0, 1) ? 0.0 : INFINITY);
        }
        mpq_set_d(exact, cell);
        mpq_set_d(part, c);
        mpq_div(exact, exact, part);
        mpq_set_si(part, (long)extent, 1);
        mpq_mul(exact, exact, part);
        unsigned code = rqt_code_from_ground(extent, cell, c), right = oracle_code_up(exact);
        CHECK(code == right, "%lld * %.17g / %.17g: code %u, should be %u", (long long)extent, cell, c, code,
              right);
    }
    mpq_clears(exact, part, NULL);
}

static void every_tolerance_of_eight_significant_bits_is_a_code(void **state) {
    (void)state;
    for (int exponent = -263; exponent <= 248; exponent++) {
        for (int mantissa = 128; mantissa < 256; mantissa++) {
            if (exponent == -263 && mantissa == 128) continue; /* that code is 0 */
            if (exponent == 248 && mantissa == 255) continue;  /* that code is infinity */
            double eps = ldexp(mantissa, exponent);
            CHECK(rqt_code_metres(rqt_code_floor(eps)) == eps, "%d * 2^%d", mantissa, exponent);
            CHECK(rqt_code_eps(eps, 0) == rqt_code_floor(eps), "%d * 2^%d", mantissa, exponent);
        }
    }
    const double usual[] = {0.5, 1, 2, 5, 10, 20, 50, 100, 0.25, 7.5};
    for (int n = 0; n < 10; n++) assert_true(rqt_code_metres(rqt_code_floor(usual[n])) == usual[n]);
}

static void floor_is_the_largest_code_not_above(void **state) {
    (void)state;
    random_begin("floor");
    mpq_t exact;
    mpq_init(exact);
    assert_int_equal(rqt_code_floor(0.0), 0);
    assert_int_equal(rqt_code_floor(INFINITY), RQT_CODE_LARGEST);
    assert_int_equal(rqt_code_floor(DBL_MAX), RQT_CODE_LARGEST);
    assert_int_equal(rqt_code_floor(0x1p-1074), 0);
    for (unsigned code = 0; code <= RQT_CODE_LARGEST; code++) {
        double value = rqt_code_metres((rqt_code)code);
        assert_int_equal(rqt_code_floor(value), code);
        if (code > 0) assert_int_equal(rqt_code_floor(nextafter(value, 0)), code - 1);
        assert_int_equal(rqt_code_floor(nextafter(value, INFINITY)), code);
    }
    for (int n = 0; n < 20000; n++) {
        double metres = ldexp(random_unit(), random_between(-280, 280));
        mpq_set_d(exact, metres);
        assert_int_equal(rqt_code_floor(metres), oracle_code_down(exact));
    }
    mpq_clear(exact);
}

static void eps_gives_up_the_quantum_error_and_rounds_down(void **state) {
    (void)state;
    random_begin("eps");
    mpq_t exact, part;
    mpq_inits(exact, part, NULL);
    assert_int_equal(rqt_code_eps(0.0, 0.0), 0);
    assert_int_equal(rqt_code_eps(1.0, 1.0), 0);
    assert_int_equal(rqt_code_eps(0.5, 1.0), 0);
    assert_int_equal(rqt_code_eps(INFINITY, 0.0), RQT_CODE_LARGEST);
    assert_int_equal(rqt_code_eps(INFINITY, 12.5), RQT_CODE_LARGEST);
    for (int n = 0; n < 40000; n++) {
        double eps = ldexp(random_unit(), random_between(-30, 30));
        double lost = ldexp(random_unit(), random_between(-60, 30));
        if (random_between(0, 2) == 0) eps = rqt_code_metres((rqt_code)random_between(30000, 36000));
        if (random_between(0, 2) == 0) lost = 0.5 / 1024;
        if (random_between(0, 3) == 0) lost = ldexp(eps, -random_between(50, 60)); /* the difference is no double */
        if (random_between(0, 5) == 0) lost = 0;
        mpq_set_d(exact, eps);
        mpq_set_d(part, lost);
        mpq_sub(exact, exact, part);
        if (mpq_sgn(exact) < 0) mpq_set_ui(exact, 0, 1);
        unsigned code = rqt_code_eps(eps, lost), right = oracle_code_down(exact);
        CHECK(code == right, "eps %.17g less %.17g: code %u, should be %u", eps, lost, code, right);
    }
    mpq_clears(exact, part, NULL);
}

static void heights_are_one_double_expression(void **state) {
    (void)state;
    random_begin("metres");
    for (int n = 0; n < 20000; n++) {
        rqt_unit u = some_unit();
        u.z0 = (int64_t)(random_bits() >> random_between(11, 60)) * (random_between(0, 1) ? 1 : -1);
        u.offset = ldexp(random_unit() - 0.5, random_between(-10, 20));
        int32_t q = random_between(1 - RQT_HEIGHT_LIMIT, RQT_HEIGHT_LIMIT - 1);
        /* volatile: no fused operation, no extra precision */
        volatile double f = (double)u.numerator / u.denominator;
        f = u.scale * f;
        volatile double z = q / (double)u.d;
        z = (double)u.z0 + z;
        z = z * f;
        z = z + u.offset;
        assert_true(rqt_unit_factor(&u) == f);
        assert_true(rqt_unit_metres(&u, q) == z);
    }
}

static void only_sound_units_are_valid(void **state) {
    (void)state;
    const rqt_unit good[] = {UNIT_METRE, UNIT_FOOT, UNIT_SURVEY_FOOT, UNIT_MILLIMETRE, UNIT_ODD};
    for (int n = 0; n < 5; n++) assert_true(rqt_unit_is_valid(&good[n]));
    rqt_unit u = UNIT_METRE;
    u.scale = 0;
    assert_false(rqt_unit_is_valid(&u));
    u.scale = (double)NAN;
    assert_false(rqt_unit_is_valid(&u));
    u.scale = (double)INFINITY;
    assert_false(rqt_unit_is_valid(&u));
    u = UNIT_METRE;
    u.offset = (double)NAN;
    assert_false(rqt_unit_is_valid(&u));
    u.offset = -(double)INFINITY;
    assert_false(rqt_unit_is_valid(&u));
    u = UNIT_METRE;
    u.d = 0;
    assert_false(rqt_unit_is_valid(&u));
    u.d = -1;
    assert_false(rqt_unit_is_valid(&u));
    u.d = (1 << 20) + 1;
    assert_false(rqt_unit_is_valid(&u));
    u.d = 1 << 20;
    assert_true(rqt_unit_is_valid(&u));
    u = UNIT_METRE;
    u.denominator = 0;
    assert_false(rqt_unit_is_valid(&u));
    u = UNIT_METRE;
    u.numerator = 0;
    assert_false(rqt_unit_is_valid(&u));
    u = UNIT_METRE;
    u.z0 = 1ll << 53;
    assert_false(rqt_unit_is_valid(&u));
    u.z0 = -(1ll << 53);
    assert_false(rqt_unit_is_valid(&u));
    u.z0 = (1ll << 53) - 1;
    assert_true(rqt_unit_is_valid(&u));
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(codes_mean_what_the_format_says),
        TEST(F45_errors_in_quanta_round_up_only_at_random),
        TEST(F45_errors_in_quanta_round_up_only_next_to_every_code),
        TEST(exact_powers_of_feet_and_odd_scales_are_not_rounded_further),
        TEST(scales_at_the_ends_of_double_neither_overflow_nor_vanish),
        TEST(F45_outline_costs_round_up_only),
        TEST(every_tolerance_of_eight_significant_bits_is_a_code),
        TEST(floor_is_the_largest_code_not_above),
        TEST(eps_gives_up_the_quantum_error_and_rounds_down),
        TEST(heights_are_one_double_expression),
        TEST(only_sound_units_are_valid),
    };
    return cmocka_run_group_tests_name("error codes", tests, NULL, NULL);
}
