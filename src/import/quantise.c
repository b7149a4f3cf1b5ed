/* quantise.c - values -> int32 heights, and the unit that makes metres of them.
 *
 *     metres = (z0 + q/d) * f + o,   |q| < 2^30
 *
 * Integers: q = raw - z0, d = 1; nothing is rounded. Others are metres already (f = 1, o = 0): d is the coarsest of
 * 1, 10, 100, 1000 for which z0 + q/d, evaluated as it will be evaluated for ever, is every single sample;
 * elevation models are written with few decimals, and then that decimal IS the sample. Otherwise d = 1024, and the
 * rounding is told as quantum_error. z0 is 0 unless heights are too far from 0 to be counted from there.
 *
 * The first look at the samples tries all of that with z0 = 0. Where the extremes, which it finds at the same time,
 * ask for another z0, a second look tries again.
 */
#include "parts.h"

#include <math.h>
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

/* Steps that the user chose, in metres: one of d parts of a metre where it is one, else a unit of its own. */
static import_steps steps_of(double quantum) {
    double parts = rint(1 / quantum);
    if (parts >= 1 && parts <= 1 << 20 && fabs(1 / quantum - parts) <= 1e-9 * parts)
        return (import_steps){.d = (int32_t)parts, .scale = 1};
    return (import_steps){.d = 1, .scale = quantum};
}

static bool is_whole(import_kind kind) {
    return kind == IMPORT_I32 || kind == IMPORT_I64;
}

/* What rounding costs is half a step, or what it really is where floating point adds to that. */
static import_trial trial_of(import_steps steps, bool rounds) {
    return (import_trial){.steps = steps,
                          .possible = true,
                          .exact = true,
                          .wants_rounding = rounds,
                          .knows_rounding = true,
                          .rounding = 0.5 * steps.scale / steps.d};
}

import_look import_look_begin(import_kind kind, const import_scheme *scheme) {
    import_look look = {.wants_survey = true, .single = scheme->single};
    if (is_whole(kind)) return import_look_empty(&look);
    if (scheme->quantum > 0) {
        look.trial[look.trials++] = trial_of(steps_of(scheme->quantum), true);
        return import_look_empty(&look);
    }
    for (int32_t d = 1; d <= 1000; d *= 10)
        look.trial[look.trials++] = trial_of((import_steps){.d = d, .scale = 1}, false);
    look.trial[look.trials++] = trial_of((import_steps){.d = 1024, .scale = 1}, true);
    return import_look_empty(&look);
}

/* The origin that this trial should have had. True: it had, or needs none; false: it has to be repeated. */
static bool settle_origin(import_trial *t, const import_survey *s) {
    int64_t z0;
    if (!choose_origin(s->min / t->steps.scale, s->max / t->steps.scale, t->steps.d, &z0)) {
        t->possible = t->exact = false;
        return true;
    }
    if (z0 == t->steps.z0) return true;
    t->steps.z0 = z0;
    *t = trial_of(t->steps, t->wants_rounding);
    return false;
}

static import_decision decided(const import_survey *s, const import_steps *steps, double quantum_error,
                               const import_scheme *scheme, bool whole, import_heights *heights) {
    *heights = (import_heights){.steps = *steps, .unit = scheme->unit, .quantum_error = quantum_error};
    heights->unit.z0 = steps->z0;
    heights->unit.d = steps->d;
    if (!whole) heights->unit.scale = steps->scale;
    heights->min_q = s->count ? (int32_t)import_height(steps, s->min) : 0;
    heights->max_q = s->count ? (int32_t)import_height(steps, s->max) : 0;
    return IMPORT_DECIDED;
}

/* Extremes of no value at all are 0, and values next to an only one are none. */
static void finish_survey(import_survey *s) {
    if (!s->count) s->min = s->max = 0;
    if (!isfinite(s->next_min)) s->next_min = NAN;
    if (!isfinite(s->next_max)) s->next_max = NAN;
}

import_decision import_decide(const import_job *job, import_kind kind, const import_scheme *scheme,
                              import_look *look, import_heights *heights) {
    import_survey *s = &look->survey;
    if (look->wants_survey) finish_survey(s);
    look->wants_survey = false;
    if (is_whole(kind)) {
        import_steps steps = {.d = 1, .scale = 1};
        if (!choose_origin(s->min, s->max, 1, &steps.z0)) {
            too_wide(job, s, 1);
            return IMPORT_REFUSED;
        }
        return decided(s, &steps, 0, scheme, true, heights);
    }
    bool again = false;
    for (int i = 0; i < look->trials; i++)
        if (!settle_origin(&look->trial[i], s)) again = true;
    if (again) {
        look->trial[look->trials - 1].knows_rounding = true;
        return IMPORT_LOOK_AGAIN;
    }
    for (int i = 0; i < look->trials; i++) {
        import_trial *t = &look->trial[i];
        if (!t->wants_rounding) {
            if (t->exact) return decided(s, &t->steps, 0, scheme, false, heights);
        } else if (!t->possible) {
            too_wide(job, s, t->steps.scale / t->steps.d);
        } else if (t->exact || t->knows_rounding) {
            return decided(s, &t->steps, t->exact ? 0 : t->rounding, scheme, false, heights);
        } else {
            t->knows_rounding = true;
            return IMPORT_LOOK_AGAIN;
        }
    }
    return IMPORT_REFUSED;
}

void import_quantise(const import_strip *strip, size_t at, size_t n, const import_steps *steps, double *values,
                     int32_t *q) {
    const uint8_t *valid = strip->valid + at;
    if (strip->kind == IMPORT_I32 && steps->z0 == 0) {
        memcpy(q, (const int32_t *)strip->values + at, n * sizeof *q);
    } else {
        import_strip_doubles(strip, at, n, values);
        for (size_t i = 0; i < n; i++) q[i] = valid[i] ? (int32_t)import_height(steps, values[i]) : 0;
    }
    if (memchr(valid, 0, n))
        for (size_t i = 0; i < n; i++)
            if (!valid[i]) q[i] = 0;
}
