/* code.c - heights in metres, and errors as codes.
 *
 * A code is the upper half of a double, so to say: 9 bits of exponent, 7 of mantissa. Turning a double into the
 * smallest code above it is one addition and one shift. Where the double is only near the true rational, both ends
 * of its uncertainty are rounded; they differ once in some thousand cases, and then integers of 384 bits decide.
 */
#include "internal.h"

#include <math.h>

#define DROPPED 45               /* bits of a double's mantissa that a code has not */
#define BIAS ((int64_t)767 << 7) /* double's exponent bias less the code's, in code units */

/* Then every error has a finite code of its own, and every height is a finite number of metres. */
static bool quantum_is_usable(const rqt_unit *unit) {
    const double quantum = fabs(rqt_unit_factor(unit)) / unit->d;
    return quantum > 0x1p-200 && quantum < 0x1p200;
}

bool rqt_unit_is_valid(const rqt_unit *unit) {
    return unit->d >= 1 && unit->d <= 1 << 20 && unit->numerator > 0 && unit->numerator <= 1 << 20 &&
           unit->denominator > 0 && unit->denominator <= 1 << 20 && isfinite(unit->scale) && unit->scale != 0 &&
           isfinite(unit->offset) && quantum_is_usable(unit) && unit->z0 < (INT64_C(1) << 53) &&
           unit->z0 > -(INT64_C(1) << 53);
}

double rqt_unit_factor(const rqt_unit *unit) {
    return unit->scale * ((double)unit->numerator / (double)unit->denominator);
}

double rqt_unit_metres(const rqt_unit *unit, int32_t q) {
    return ((double)unit->z0 + (double)q / (double)unit->d) * rqt_unit_factor(unit) + unit->offset;
}

double rqt_code_metres(rqt_code code) {
    if (code == 0) return 0;
    if (code == RQT_CODE_INFINITY) return INFINITY;
    /* (128 + low 7 bits) * 2^(high bits - 263): 1.xxxxxxx times a power of two that every double has */
    return bits_double((uint64_t)((code >> 7) - 256 + 1023) << 52 | (uint64_t)(code & 127) << 45);
}

static int64_t bits_of(double v) {
    int64_t bits;
    memcpy(&bits, &v, sizeof bits);
    return bits;
}

static rqt_code code_clamp(int64_t code) {
    if (code < 1) return 1;
    return code > RQT_CODE_LARGEST ? RQT_CODE_LARGEST : (rqt_code)code;
}

/* bits: of a double > 0. */
static rqt_code code_above_bits(int64_t bits) {
    return code_clamp(((bits + (((int64_t)1 << DROPPED) - 1)) >> DROPPED) - BIAS);
}

rqt_code code_above(double metres) {
    return metres > 0 ? code_above_bits(bits_of(metres)) : 0;
}

rqt_code rqt_code_floor(double metres) {
    if (!(metres > 0)) return 0;
    const int64_t code = (bits_of(metres) >> DROPPED) - BIAS;
    if (code < 1) return 0;
    return code > RQT_CODE_LARGEST ? RQT_CODE_LARGEST : (rqt_code)code;
}

rqt_code rqt_code_eps(double eps, double quantum_error) {
    if (!(quantum_error > 0)) return rqt_code_floor(eps);
    if (eps <= quantum_error) return 0;
    double rest = eps - quantum_error;
    /* eps > quantum_error, so this recovers what the subtraction rounded away (Dekker's fast two-sum). */
    if ((eps - rest) - quantum_error < 0) rest = nextafter(rest, 0);
    return rqt_code_floor(rest);
}

/* ------------------------------------------------------------------------- integers wide enough to decide */
#define LIMBS 12
typedef struct wide {
    uint32_t limb[LIMBS]; /* little end first */
} wide;

static wide wide_of(uint64_t high, uint64_t low) {
    wide w = {{(uint32_t)low, (uint32_t)(low >> 32), (uint32_t)high, (uint32_t)(high >> 32)}};
    return w;
}

static void wide_multiply(wide *w, uint64_t by) {
    wide out = {{0}};
    for (int part = 0; part < 2; part++) {
        const uint64_t factor = part ? by >> 32 : (uint32_t)by;
        uint64_t carry = 0;
        for (int i = part; i < LIMBS; i++) {
            const uint64_t sum = (uint64_t)w->limb[i - part] * factor + out.limb[i] + carry;
            out.limb[i] = (uint32_t)sum;
            carry = sum >> 32;
        }
    }
    *w = out;
}

static int wide_length(const wide *w) {
    for (int i = LIMBS - 1; i >= 0; i--)
        if (w->limb[i]) return 32 * i + 32 - __builtin_clz(w->limb[i]);
    return 0;
}

static void wide_shift(wide *w, int bits) {
    for (; bits >= 31; bits -= 31) wide_multiply(w, UINT64_C(1) << 31);
    wide_multiply(w, UINT64_C(1) << bits);
}

/* a * 2^a_exponent <= b * 2^b_exponent, both a and b > 0 */
static bool wide_not_above(wide a, int a_exponent, wide b, int b_exponent) {
    const int a_top = wide_length(&a) + a_exponent, b_top = wide_length(&b) + b_exponent;
    if (a_top != b_top) return a_top < b_top;
    if (a_exponent > b_exponent)
        wide_shift(&a, a_exponent - b_exponent);
    else
        wide_shift(&b, b_exponent - a_exponent);
    for (int i = LIMBS - 1; i >= 0; i--)
        if (a.limb[i] != b.limb[i]) return a.limb[i] < b.limb[i];
    return true;
}

/* value = mantissa * 2^exponent with an integer mantissa below 2^53 */
static uint64_t take_apart(double value, int *exponent) {
    const double mantissa = frexp(value, exponent);
    *exponent -= 53;
    return (uint64_t)ldexp(mantissa, 53);
}

/* The smallest code not below top*2^exponent / bottom, which `near` approximates to within 2^-46 of itself. */
static rqt_code decide(wide top, int exponent, wide bottom, double near) {
    const int64_t slack = 1 << 7;
    const int64_t bits = bits_of(near);
    rqt_code code = code_above_bits(bits > slack ? bits - slack : 1);
    const rqt_code high = code_above_bits(bits + slack);
    while (code < high) {
        wide right = bottom;
        wide_multiply(&right, 128 + (code & 127));
        if (wide_not_above(top, exponent, right, (code >> 7) - 263)) break;
        code++;
    }
    return code;
}

rqt_code rqt_code_from_quanta(const rqt_unit *unit, uint64_t numerator_high, uint64_t numerator_low,
                              uint64_t denominator) {
    if (numerator_high == 0 && numerator_low == 0) return 0;
    int exponent;
    const uint64_t mantissa = take_apart(fabs(unit->scale), &exponent);
    /* The mantissa alone, then its exponent: no step overflows that the result does not. */
    const double near = ldexp((ldexp((double)numerator_high, 64) + (double)numerator_low) / (double)denominator *
                                  (double)mantissa * unit->numerator / unit->denominator / unit->d,
                              exponent);
    if (near >= 0x1p256) return RQT_CODE_LARGEST;
    if (near < 0x1p-257) return 1;
    wide top = wide_of(numerator_high, numerator_low);
    wide_multiply(&top, mantissa);
    wide_multiply(&top, (uint64_t)unit->numerator);
    wide bottom = wide_of(0, denominator);
    wide_multiply(&bottom, (uint64_t)unit->d);
    wide_multiply(&bottom, (uint64_t)unit->denominator);
    return decide(top, exponent, bottom, near);
}

rqt_code rqt_code_from_ground(int64_t extent, double cell, double c) {
    if (extent <= 0) return 0;
    int cell_exponent, c_exponent;
    const uint64_t cell_mantissa = take_apart(cell, &cell_exponent), c_mantissa = take_apart(c, &c_exponent);
    const double near =
        ldexp((double)extent * (double)cell_mantissa / (double)c_mantissa, cell_exponent - c_exponent);
    if (near >= 0x1p256) return RQT_CODE_LARGEST;
    if (near < 0x1p-257) return 1;
    wide top = wide_of(0, (uint64_t)extent);
    wide_multiply(&top, cell_mantissa);
    wide bottom = wide_of(0, c_mantissa);
    return decide(top, cell_exponent - c_exponent, bottom, near);
}

/* ----------------------------------------------------------------------------- many errors of one terrain */

void code_scale_init(code_scale *scale, const rqt_unit *unit) {
    int exponent;
    scale->unit = *unit;
    scale->factor = fabs(rqt_unit_factor(unit)) / (double)unit->d;
    /* A power of two: then every product below is exact. */
    scale->exact = unit->numerator == unit->denominator && (unit->d & (unit->d - 1)) == 0 &&
                   frexp(scale->factor, &exponent) == 0.5 && scale->factor > 0x1p-100 && scale->factor < 0x1p100;
}

rqt_code code_of_binary(const code_scale *scale, uint64_t numerator, int shift) {
    if (numerator == 0) return 0;
    if (numerator >> 53 == 0) {
        /* numerator is exact; 2^-shift is exact; factor is near within three roundings. */
        const double near = (double)numerator * scale->factor * bits_double((uint64_t)(1023 - shift) << 52);
        const int64_t bits = bits_of(near);
        if (scale->exact) return code_above_bits(bits);
        const rqt_code low = code_above_bits(bits - 64), high = code_above_bits(bits + 64);
        if (low == high && near > 0x1p-257 && near < 0x1p249) return low;
    }
    return rqt_code_from_quanta(&scale->unit, 0, numerator, UINT64_C(1) << shift);
}
