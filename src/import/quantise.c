/* quantise.c - values -> int32 heights, and the unit that makes metres of them.
 *
 *     metres = (z0 + q/d) * f + o,   |q| < 2^30
 *
 * Integers: q = raw - z0, d = 1; nothing is rounded. Others are metres already (f = 1, o = 0): d is the coarsest of 1, 10,
 * 100, 1000 for which z0 + q/d, evaluated as it will be evaluated for ever, is every single sample; elevation models are
 * written with few decimals, and then that decimal IS the sample. Otherwise d = 1024, and the rounding is told as
 * quantum_error. z0 is 0 unless heights are too far from 0 to be counted from there.
 *
 * The heights take the memory of the values: int32 is never wider, so that writing stays behind reading.
 */
#include "parts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define LIMIT ((double)RQT_HEIGHT_LIMIT)
#define ORIGIN_LIMIT 9007199254740992.0 /* 2^53: z0 and every value are exact doubles below it */

/* The origin that brings all of [min, max] within the limit at d quanta a unit of `step`. False: they are too wide. */
static bool choose_origin(double min, double max, double d, int64_t *z0) {
    *z0 = 0;
    if (!(fabs(min) < ORIGIN_LIMIT && fabs(max) < ORIGIN_LIMIT)) return false;
    if (fabs(min) * d + 1 < LIMIT && fabs(max) * d + 1 < LIMIT) return true;
    /* Whole numbers meet the limit exactly; decimals may round to it, hence the 1 above, which d = 1 does not need. */
    if (d == 1 && fabs(min) < LIMIT && fabs(max) < LIMIT && min == rint(min) && max == rint(max)) return true;
    double middle = floor(min / 2 + max / 2);
    *z0 = (int64_t)middle;
    return (max - middle) * d + 1 < LIMIT && (middle - min) * d + 1 < LIMIT;
}

static bool too_wide(const import_job *job, const import_survey *s, double quantum) {
    return import_refuse(job, "heights from %.10g to %.10g are too wide for the quantum of %.10g: they may span 2^31 of "
                              "them; choose a coarser --quantum, or --nodata if one of the two marks voids",
                         s->min, s->max, quantum);
}

static int32_t height_at(const import_samples *samples, size_t n, int64_t z0, double d) {
    double v = import_samples_at(samples, n);
    return (int32_t)lrint((v - (double)z0) * d);
}

/* Does every sample come back from z0 + q/d? */
static bool is_exact(const import_samples *samples, int64_t z0, int32_t d, bool single) {
    size_t n = (size_t)samples->width * (size_t)samples->height;
    for (size_t i = 0; i < n; i++) {
        if (!samples->valid[i]) continue;
        double v = import_samples_at(samples, i);
        double back = (double)z0 + height_at(samples, i, z0, d) / (double)d;
        if (single ? (float)back != (float)v : back != v) return false;
    }
    return true;
}

/* The values' memory as heights: q = round((v - z0) * d), 0 where void. */
static void convert(import_samples *samples, const import_survey *survey, int64_t z0, double d, import_heights *h) {
    size_t n = (size_t)samples->width * (size_t)samples->height;
    char *memory = samples->values;
    int32_t low = INT32_MAX, high = INT32_MIN;
    if (samples->kind == IMPORT_I32 && z0 == 0) {
        /* Already there, and void samples are 0 since the buffer was. */
        low = (int32_t)survey->min;
        high = (int32_t)survey->max;
    } else {
        for (size_t i = 0; i < n; i++) {
            int32_t q = samples->valid[i] ? height_at(samples, i, z0, d) : 0;
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

/* Decimals: the coarsest that is exact. True with z0 and d when there is one. */
static bool find_decimals(const import_samples *samples, const import_survey *survey, bool single, rqt_unit *unit) {
    for (int32_t d = 1; d <= 1000; d *= 10)
        if (choose_origin(survey->min, survey->max, d, &unit->z0) && is_exact(samples, unit->z0, d, single)) {
            unit->d = d;
            return true;
        }
    return false;
}

/* A quantum that the user chose, in metres: one of d parts of a metre where it is one, else the unit itself. */
static void take_quantum(double quantum, rqt_unit *unit) {
    double parts = rint(1 / quantum);
    if (parts >= 1 && parts <= 1 << 20 && fabs(1 / quantum - parts) <= 1e-9 * parts) {
        unit->d = (int32_t)parts;
    } else {
        unit->d = 1;
        unit->scale = quantum;
    }
}

/* Metres -> multiples of a scale that is not 1: values are divided first, so that the rest is the same for all. */
static void divide(import_samples *samples, import_survey *survey, double scale) {
    size_t n = (size_t)samples->width * (size_t)samples->height;
    for (size_t i = 0; i < n; i++) {
        if (samples->kind == IMPORT_F32)
            ((float *)samples->values)[i] = (float)((double)((float *)samples->values)[i] / scale);
        else
            ((double *)samples->values)[i] /= scale;
    }
    survey->min /= scale;
    survey->max /= scale;
}
