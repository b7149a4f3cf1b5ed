/* verify_error.c - how far the triangles' planes are from the samples, and which samples they cover.
 *
 * Every triangle is walked row by row (verify_raster.c). For a triangle with corner heights qa, qb, qc and
 * twice-area D, the plane through the corners times D is an integer at every sample; the deviation there is the
 * fraction |D * (q - qa) - slope * offset| / D, and the numerators are kept as integers until the very end.
 */
#include "verify_internal.h"

#include <math.h>
#include <stdlib.h>

enum { MANTISSA_BITS = 53 }; /* of a double */

/* The largest deviation seen so far: numerator / denominator quanta, at an index of the window. */
typedef struct worst_sample {
    verify_uwide numerator; /* below 2^78: a deviation in quanta is below 2^33, a twice-area below 2^45 */
    uint64_t denominator;   /* 0 while no sample has been seen */
    size_t index;
} worst_sample;

typedef struct measurement {
    const verify_samples *samples;
    /* Per sample of the window its largest deviation in quanta; below zero when it is in no triangle. Doubles,
     * since a float could not tell the errors of a 2^30 range apart; only the RMS reads them, never the maximum. */
    double *deviation;
    worst_sample worst;
} measurement;

static void offer_worst(worst_sample *worst, verify_uwide numerator, uint64_t denominator, size_t index) {
    if (worst->denominator != 0) {
        /* Below 2^78 * 2^45: the products fit. */
        verify_uwide ours = numerator * worst->denominator, theirs = worst->numerator * denominator;
        if (ours < theirs || (ours == theirs && index >= worst->index)) return;
    }
    *worst = (worst_sample){.numerator = numerator, .denominator = denominator, .index = index};
}

/* A row of a narrow triangle: `count` samples from `index` on, `plane` D times the plane's height over qa at the
 * first. The largest numerator so far and its place are updated; a later sample must be larger, so the first of
 * equals stays. */
static void narrow_row(measurement *m, const verify_plane *p, size_t index, size_t count, int64_t plane,
                       int64_t *largest, size_t *place) {
    const int32_t *q = m->samples->q + index;
    const uint8_t *valid = m->samples->valid == NULL ? NULL : m->samples->valid + index;
    double *deviation = m->deviation + index;
    int64_t twice_area = p->twice_area, base = p->corner[0].q;
    double divisor = (double)twice_area;
    for (size_t k = 0; k < count; k++, plane += p->slope_x) {
        if (valid != NULL && !valid[k]) {
            deviation[k] = 0; /* covered, if not counted */
            continue;
        }
        int64_t off = twice_area * (q[k] - base) - plane;
        if (off < 0) off = -off;
        if (off > *largest) {
            *largest = off;
            *place = index + k;
        }
        double ours = (double)off / divisor;
        if (ours > deviation[k]) deviation[k] = ours;
    }
}

/* The same for a triangle too large for 64 bits. */
static void wide_row(measurement *m, const verify_plane *p, size_t index, size_t count, verify_wide plane,
                     verify_wide *largest, size_t *place) {
    const int32_t *q = m->samples->q;
    const uint8_t *valid = m->samples->valid;
    double divisor = (double)p->twice_area;
    for (size_t at = index; at < index + count; at++, plane += p->slope_x) {
        if (valid != NULL && !valid[at]) {
            m->deviation[at] = 0;
            continue;
        }
        verify_wide off = (verify_wide)p->twice_area * ((int64_t)q[at] - p->corner[0].q) - plane;
        if (off < 0) off = -off;
        if (off > *largest) {
            *largest = off;
            *place = at;
        }
        double ours = (double)off / divisor;
        if (ours > m->deviation[at]) m->deviation[at] = ours;
    }
}

static void measure_triangle(measurement *m, const verify_triangle *triangle) {
    verify_plane p;
    if (!verify_plane_of(triangle, &p)) return;
    const verify_corner *a = &p.corner[0];
    int64_t narrow_largest = -1;
    verify_wide wide_largest = -1;
    size_t place = 0;
    for (int64_t row = p.first_row; row <= p.last_row; row++) {
        int64_t first, last;
        verify_row_interval(&p, row, &first, &last);
        if (first > last) continue;
        size_t index = verify_index(m->samples, (int32_t)first, (int32_t)row);
        size_t count = (size_t)(last - first + 1);
        if (p.narrow) {
            int64_t plane = p.slope_x * (first - a->col) + p.slope_y * (row - a->row);
            narrow_row(m, &p, index, count, plane, &narrow_largest, &place);
        } else {
            verify_wide plane = (verify_wide)p.slope_x * (first - a->col) + (verify_wide)p.slope_y * (row - a->row);
            wide_row(m, &p, index, count, plane, &wide_largest, &place);
        }
    }
    verify_wide largest = p.narrow ? narrow_largest : wide_largest;
    if (largest >= 0) offer_worst(&m->worst, (verify_uwide)largest, (uint64_t)p.twice_area, place);
}

/* The double nearest to numerator / denominator * quantum, ties to even.
 *
 * Rounding to nearest never puts two numbers in the wrong order, and an eps that is a double is its own nearest, so
 * an exact value <= eps gives a double <= eps. That holds only for one rounding of the exact value - a rounded
 * quotient times a double could step over eps - hence the integers: quantum is mantissa * 2^exponent with a
 * mantissa of 53 bits, and the value is (whole + rest / denominator) * 2^exponent with whole and rest integers. (A
 * subnormal result is rounded a second time by ldexp; eps is then on that coarser grid too, and the order stands.)
 */
static double nearest_product(verify_uwide numerator, uint64_t denominator, double quantum) {
    int exponent;
    double fraction = frexp(quantum, &exponent);
    uint64_t mantissa = (uint64_t)ldexp(fraction, MANTISSA_BITS);
    exponent -= MANTISSA_BITS;

    /* quotient < 2^33, remainder < denominator < 2^45: the products stay below 2^98. */
    verify_uwide quotient = numerator / denominator, remainder = numerator % denominator;
    verify_uwide whole = quotient * mantissa + remainder * mantissa / denominator;
    verify_uwide rest = remainder * mantissa % denominator;
    if (whole >> 62 == 0) {
        /* Too few digits to round from: bring in 64 more. One such step will do, as a value that is not 0 is at
         * least 2^52 / 2^45, which makes `whole` at least 2^71. */
        whole = (whole << 64) + (rest << 64) / denominator;
        rest = (rest << 64) % denominator;
        exponent -= 64;
    }
    /* Keep 62 bits, the lowest of them set when anything was cut off: it can no longer look like a tie. */
    bool cut = rest != 0;
    while (whole >> 62 != 0) {
        cut = cut || (whole & 1) != 0;
        whole >>= 1;
        exponent++;
    }
    return ldexp((double)((uint64_t)whole | (uint64_t)cut), exponent);
}

void verify_sum_deviations(const verify_samples *s, const double *deviations, verify_report *report) {
    double sum = 0;
    size_t index = 0;
    for (int32_t row = 0; row < s->height; row++) {
        double row_sum = 0; /* by rows, so that a large total does not swallow small squares */
        for (int32_t col = 0; col < s->width; col++, index++) {
            double deviation = deviations[index];
            bool covered = deviation >= 0;
            if (s->is_promised != NULL && s->is_promised(s->context, s->col0 + col, s->row0 + row) && !covered) {
                report->uncovered++;
            }
            if (!covered || (s->valid != NULL && !s->valid[index])) continue;
            report->samples++;
            row_sum += deviation * deviation;
        }
        sum += row_sum;
    }
    if (report->samples > 0) report->rms_error = sqrt(sum / (double)report->samples) * s->quantum;
}

static void summarise(const measurement *m, verify_report *report) {
    const verify_samples *s = m->samples;
    verify_sum_deviations(s, m->deviation, report);
    if (report->samples == 0) return;
    report->max_error = nearest_product(m->worst.numerator, m->worst.denominator, s->quantum);
    report->worst_col = (int32_t)(s->col0 + (int64_t)(m->worst.index % (size_t)s->width));
    report->worst_row = (int32_t)(s->row0 + (int64_t)(m->worst.index / (size_t)s->width));
    /* A mean is no more than the maximum; rounding alone could make it so when all deviations are equal. */
    report->rms_error = fmin(report->rms_error, report->max_error);
}

verify_status verify_measure_error(const verify_samples *samples, const verify_triangle *triangles, size_t n,
                                   verify_report *report) {
    size_t count = (size_t)samples->width * (size_t)samples->height; /* both below 2^31 */
    if (count == 0) return VERIFY_OK;
    if (count > SIZE_MAX / sizeof(double)) return VERIFY_NO_MEMORY;
    measurement m = {.samples = samples, .deviation = malloc(count * sizeof(double))};
    if (m.deviation == NULL) return VERIFY_NO_MEMORY;
    for (size_t k = 0; k < count; k++) {
        m.deviation[k] = -1;
    }
    for (size_t t = 0; t < n; t++) {
        measure_triangle(&m, &triangles[t]);
    }
    summarise(&m, report);
    free(m.deviation);
    return VERIFY_OK;
}
