/* text.c - the shortest decimal text of a double; text into a sink.
 *
 * Of all decimals that read back as v, the one with the fewest digits, and among those the nearest to v: at most 17
 * digits, 15 when v came from a decimal of 15 or fewer. It is laid out as printf's %g does: plain from 1e-4 to
 * below 1e15 (or as long as no zeros must be filled in), else d.ddde+XX.
 *
 * Coordinates are the bulk of all text we write, so the usual ones do not go through printf and strtod: integers
 * are printed as such, and for 1e-5 <= |v| < 1e15 the digits come from exact integers. There v = m * 2^-s with m <
 * 2^53 and 3 <= s <= 69, and with k decimals v is N / 2^s for N = m * 10^k, k <= 21: N < 2^123 fits 128 bits. The
 * candidate is D = N / 2^s rounded to nearest; it reads back as v iff it is within half a step of doubles, that is
 * iff |D * 2^s - N| is less than 10^k / 2 (equal will do when m is even: ties read to even). Below a power of two
 * doubles are twice as dense, but the powers in this range are decimals of at most 15 digits, so D is exact there.
 *
 * The rest (tiny, huge, subnormal) is printed and read back by the C library. There a power of two needs care: the
 * nearest 16 digits may lie below it and miss, while the next ones above, though further off, read back. Both sides
 * use the same locale, and only digits and the exponent are taken from the text, so it does not matter what the
 * locale's decimal point is.
 */
#include "internal.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

__extension__ typedef unsigned __int128 u128;

enum { FEWEST = 15, MOST = 17 }; /* digits that any double keeps, and that any double needs */

typedef struct decimal {
    char digits[24];
    int n;        /* digits, the first not 0 */
    int exponent; /* of the first digit */
} decimal;

/* clang-format off */
static const uint64_t POWERS[] = {
    1u, 10u, 100u, 1000u, 10000u, 100000u, 1000000u, 10000000u, 100000000u, 1000000000u, 10000000000u,
    100000000000u, 1000000000000u, 10000000000000u, 100000000000000u, 1000000000000000u};
/* clang-format on */

int format_digits(uint64_t v, char *text) {
    char backwards[20];
    int n = 0;
    do backwards[n++] = (char)('0' + v % 10);
    while ((v /= 10) != 0);
    for (int i = 0; i < n; i++) text[i] = backwards[n - 1 - i];
    return n;
}

/* Powers up to 10^21, in two factors that each are in the table. */
static u128 power_of_ten(int k) {
    return k < 16 ? POWERS[k] : (u128)POWERS[15] * POWERS[k - 15];
}

/* 1e-5 <= v < 1e15, by integers. */
static void shortest_usual(double v, decimal *out) {
    uint64_t bits;
    memcpy(&bits, &v, 8);
    uint64_t m = (bits & (((uint64_t)1 << 52) - 1)) | (uint64_t)1 << 52;
    int s = 1075 - (int)(bits >> 52);

    int exponent = 0; /* of the first digit of v */
    u128 one = (u128)1 << s;
    if (m >= one)
        while (exponent < 14 && m >= one * POWERS[exponent + 1]) exponent++;
    else
        do exponent--;
        while (m * (u128)POWERS[-exponent] < one);

    uint64_t D;
    int k;
    for (int wanted = FEWEST;; wanted++) {
        k = wanted - 1 - exponent;
        u128 step = power_of_ten(k), N = m * step;
        D = (uint64_t)(N >> s);
        u128 distance = N - ((u128)D << s);
        if (2 * distance > one || (2 * distance == one && D % 2)) {
            D++;
            distance = one - distance;
        }
        if (wanted == MOST || 2 * distance < step || (2 * distance == step && m % 2 == 0)) break;
    }
    out->n = format_digits(D, out->digits);
    out->exponent = out->n - 1 - k;
}

/* What printf wrote with %e, in whatever locale: the digits and the exponent. */
static void take_digits(const char *text, decimal *out) {
    out->n = 0;
    for (; *text && *text != 'e'; text++)
        if (*text >= '0' && *text <= '9' && out->n < MOST) out->digits[out->n++] = *text;
    out->exponent = *text ? (int)strtol(text + 1, NULL, 10) : 0;
}

/* Any finite v > 0, by the C library. A subnormal can need a single digit: start there. */
static void shortest_rare(double v, decimal *out) {
    char text[64];
    for (int wanted = v < DBL_MIN ? 1 : FEWEST; wanted <= MOST; wanted++) {
        (void)snprintf(text, sizeof text, "%.*e", wanted - 1, v);
        double back = strtod(text, NULL);
        if (back < v && wanted == MOST - 1) {
            /* The case of a power of two: try the next one above. A 9 cannot carry all the way, as then fewer
             * digits would have done. */
            char *last = strchr(text, 'e') - 1;
            while (*last == '9') *last-- = '0';
            if (*last >= '0' && *last < '9') ++*last;
            back = strtod(text, NULL);
        }
        if (back == v || wanted == MOST) break;
    }
    take_digits(text, out);
}

static int lay_out(const decimal *d, char *text) {
    char *p = text;
    int n = d->n, exponent = d->exponent;
    if (exponent < -4 || exponent >= (n > FEWEST ? n : FEWEST)) {
        *p++ = d->digits[0]; /* n >= 1. NOLINT(clang-analyzer-core.uninitialized.Assign) */
        if (n > 1) *p++ = '.';
        for (int i = 1; i < n; i++) *p++ = d->digits[i];
        *p++ = 'e';
        *p++ = exponent < 0 ? '-' : '+';
        unsigned size = (unsigned)abs(exponent);
        if (size < 10) *p++ = '0';
        return (int)(p - text) + format_digits(size, p);
    }
    if (exponent < 0) {
        *p++ = '0';
        *p++ = '.';
        for (int i = -1; i > exponent; i--) *p++ = '0';
    }
    for (int i = 0; i < n; i++) {
        if (i > 0 && i == exponent + 1) *p++ = '.';
        *p++ = d->digits[i];
    }
    for (int i = n; i <= exponent; i++) *p++ = '0';
    return (int)(p - text);
}

int format_double(double value, char text[32]) {
    char *p = text;
    double v = fabs(value);
    if (signbit(value) && !isnan(value)) *p++ = '-'; /* -0 too: it reads back as itself */
    if (!isfinite(v)) {
        memcpy(p, isnan(v) ? "nan" : "inf", 3);
        p += 3;
    } else if (v < 1e15 && v == (double)(uint64_t)v) {
        p += format_digits((uint64_t)v, p);
    } else {
        decimal d;
        if (v >= 1e-5 && v < 1e15)
            shortest_usual(v, &d);
        else
            shortest_rare(v, &d);
        while (d.n > 1 && d.digits[d.n - 1] == '0') d.n--;
        p += lay_out(&d, p);
    }
    *p = 0;
    return (int)(p - text);
}

/* -------------------------------------------------------------------------------------------------- sinks -- */

void add_bytes(sink *s, const char *text, size_t n) {
    if (s->bytes) memcpy(s->bytes + s->size, text, n);
    s->size += n;
}

void add_text(sink *s, const char *text) {
    add_bytes(s, text, strlen(text));
}

void add_count(sink *s, uint64_t v) {
    char text[20];
    add_bytes(s, text, (size_t)format_digits(v, text));
}

void add_integer(sink *s, int64_t v) {
    if (v < 0) add_text(s, "-");
    add_count(s, v < 0 ? 0 - (uint64_t)v : (uint64_t)v);
}

void add_double(sink *s, double v) {
    char text[32];
    add_bytes(s, text, (size_t)format_double(v, text));
}
