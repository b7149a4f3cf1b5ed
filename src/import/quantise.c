/* quantise.c - values -> int32 heights, and the unit that makes metres of them.
 *
 *     metres = (z0 + q/d) * f + o,   |q| < 2^30
 *
 * Integers: q = raw - z0, d = 1; nothing is rounded. Others are metres already (f = 1, o = 0): d is the coarsest of
 * 1, 10, 100, 1000 for which z0 + q/d, evaluated as it will be evaluated for ever, is every single sample;
 * elevation models are written with few decimals, and then that decimal IS the sample. Otherwise d = 1024, and the
 * rounding is told as quantum_error. z0 is 0 unless heights are too far from 0 to be counted from there.
 *
 * The heights take the memory of the values: int32 is never wider, so that writing stays behind reading.
 */
#include "parts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define LIMIT ((double)RQT_HEIGHT_LIMIT)
#define ORIGIN_LIMIT 9007199254740992.0 /* 2^53: z0 and every value are exact doubles below it */

/* The origin that brings all of [min, max] within the limit at d quanta a unit of `step`. False: they are too wide.
 */
static bool choose_origin(double min, double max, double d, int64_t *z0) {
    *z0 = 0;
    if (!(fabs(min) < ORIGIN_LIMIT && fabs(max) < ORIGIN_LIMIT)) return false;
    if (fabs(min) * d + 1 < LIMIT && fabs(max) * d + 1 < LIMIT) return true;
    /* Whole numbers meet the limit exactly; decimals may round to it, hence the 1 above, which d = 1 does not need.
     */
    if (d == 1 && fabs(min) < LIMIT && fabs(max) < LIMIT && min == rint(min) && max == rint(max)) return true;
    double middle = floor(min / 2 + max / 2);
    *z0 = (int64_t)middle;
    return (max - middle) * d + 1 < LIMIT && (middle - min) * d + 1 < LIMIT;
}

static bool too_wide(const import_job *job, const import_survey *s, double quantum) {
    return import_refuse(job,
                         "heights from %.10g to %.10g are too wide for the quantum of %.10g: they may span 2^31 of "
                         "them; choose a coarser --quantum, or --nodata if one of the two marks voids",
                         s->min, s->max, quantum);
}

/* How values are counted: q = round((v / scale - z0) * d). */
typedef struct steps {
    int64_t z0;
    int32_t d;
    double scale;
} steps;

static inline int32_t height_of(const steps *s, double v) {
    if (s->scale != 1) v /= s->scale;
    return (int32_t)lrint((v - (double)s->z0) * s->d);
}

/* As rqt_unit_metres evaluates it; for integers, in their own unit. */
static inline double value_of(const steps *s, int32_t q) {
    return ((double)s->z0 + q / (double)s->d) * s->scale;
}

/* Does every sample come back from its height? */
static bool is_exact(const import_samples *samples, const steps *s, bool single) {
    size_t n = (size_t)samples->width * (size_t)samples->height;
    for (size_t i = 0; i < n; i++) {
        if (!samples->valid[i]) continue;
        double v = import_samples_at(samples, i), back = value_of(s, height_of(s, v));
        if (single ? (float)back != (float)v : back != v) return false;
    }
    return true;
}

/* The coarsest decimal steps that are exact, if any. */
static bool find_decimals(const import_samples *samples, const import_survey *survey, bool single, steps *s) {
    *s = (steps){.scale = 1};
    for (s->d = 1; s->d <= 1000; s->d *= 10)
        if (choose_origin(survey->min, survey->max, s->d, &s->z0) && is_exact(samples, s, single)) return true;
    return false;
}

/* Steps that the user chose, in metres: one of d parts of a metre where it is one, else a unit of its own. */
static steps steps_of(double quantum) {
    double parts = rint(1 / quantum);
    if (parts >= 1 && parts <= 1 << 20 && fabs(1 / quantum - parts) <= 1e-9 * parts)
        return (steps){.d = (int32_t)parts, .scale = 1};
    return (steps){.d = 1, .scale = quantum};
}

/* What rounding costs: half a step, or what it really was where floating point adds to that. */
static double rounding_error(const import_samples *samples, const steps *s) {
    size_t n = (size_t)samples->width * (size_t)samples->height;
    double largest = 0.5 * s->scale / s->d;
    for (size_t i = 0; i < n; i++) {
        if (!samples->valid[i]) continue;
        double v = import_samples_at(samples, i), off = fabs(value_of(s, height_of(s, v)) - v);
        if (off > largest) largest = off;
    }
    return largest;
}

/* The values' memory becomes the heights'; 0 where void. */
static void convert(import_samples *samples, const import_survey *survey, const steps *s, import_heights *h) {
    size_t n = (size_t)samples->width * (size_t)samples->height;
    char *memory = samples->values;
    int32_t low = INT32_MAX, high = INT32_MIN;
    if (samples->kind == IMPORT_I32 && s->z0 == 0) {
        /* Already heights, and void samples are 0 since the buffer was. */
        low = (int32_t)survey->min;
        high = (int32_t)survey->max;
    } else {
        for (size_t i = 0; i < n; i++) {
            int32_t q = samples->valid[i] ? height_of(s, import_samples_at(samples, i)) : 0;
            if (samples->valid[i] && q < low) low = q;
            if (samples->valid[i] && q > high) high = q;
            memcpy(memory + i * sizeof q, &q, sizeof q);
        }
    }
    if (import_kind_bytes(samples->kind) > sizeof(int32_t)) {
        char *smaller = realloc(memory, n * sizeof(int32_t));
        if (smaller) memory = smaller;
    }
    h->q = (int32_t *)(void *)memory;
    h->valid = samples->valid;
    h->min_q = survey->count ? low : 0;
    h->max_q = survey->count ? high : 0;
    if (samples->voids == 0) {
        free(h->valid);
        h->valid = NULL;
    }
    samples->values = NULL;
    samples->valid = NULL;
}

bool import_quantise(const import_job *job, import_samples *samples, const import_survey *survey,
                     const import_scheme *scheme, import_heights *heights) {
    bool whole = samples->kind == IMPORT_I32 || samples->kind == IMPORT_I64;
    steps s = {.d = 1, .scale = 1};
    *heights = (import_heights){.unit = scheme->unit};
    if (whole) {
        if (!choose_origin(survey->min, survey->max, 1, &s.z0)) return too_wide(job, survey, 1);
    } else if (scheme->quantum > 0 || !find_decimals(samples, survey, scheme->single, &s)) {
        s = scheme->quantum > 0 ? steps_of(scheme->quantum) : (steps){.d = 1024, .scale = 1};
        if (!choose_origin(survey->min / s.scale, survey->max / s.scale, s.d, &s.z0))
            return too_wide(job, survey, s.scale / s.d);
        if (!is_exact(samples, &s, scheme->single)) heights->quantum_error = rounding_error(samples, &s);
    }
    heights->unit.z0 = s.z0;
    heights->unit.d = s.d;
    if (!whole) heights->unit.scale = s.scale;
    convert(samples, survey, &s, heights);
    return true;
}
