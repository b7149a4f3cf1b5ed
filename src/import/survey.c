/* survey.c - one look at the values before they become heights: their range and whether decimals hold them decide
 * the quantum, and an extreme that stands apart from everything else is most likely the mark of voids that nobody
 * declared.
 *
 * Several threads look at rows of their own; what they have found is merged, in any order, to what one look at
 * everything would find.
 */
#include "parts.h"

#include <math.h>
#include <string.h>

#define GROUP 64 /* values of which only the extremes are looked at, when those tell nothing new */

/* ------------------------------------------------------------------------------------------------ extremes -- */
static import_survey survey_empty(void) {
    return (import_survey){.min = INFINITY, .max = -INFINITY, .next_min = INFINITY, .next_max = -INFINITY};
}

static void add_low(import_survey *s, double v, int64_t times) {
    if (v < s->min) {
        s->next_min = s->min;
        s->min = v;
        s->min_count = times;
    } else if (v == s->min) {
        s->min_count += times;
    } else if (v < s->next_min) {
        s->next_min = v;
    }
}

static void add_high(import_survey *s, double v, int64_t times) {
    if (v > s->max) {
        s->next_max = s->max;
        s->max = v;
        s->max_count = times;
    } else if (v == s->max) {
        s->max_count += times;
    } else if (v > s->next_max) {
        s->next_max = v;
    }
}

static void survey_values(import_survey *s, const double *values, size_t n) {
    s->count += (int64_t)n;
    for (size_t from = 0; from < n; from += GROUP) {
        const size_t end = n - from < GROUP ? n : from + GROUP;
        double low = values[from], high = values[from];
        for (size_t i = from; i < end; i++) {
            low = values[i] < low ? values[i] : low;
            high = values[i] > high ? values[i] : high;
        }
        if (low < s->next_min)
            for (size_t i = from; i < end; i++) add_low(s, values[i], 1);
        if (high > s->next_max)
            for (size_t i = from; i < end; i++) add_high(s, values[i], 1);
    }
}

static void survey_merge(import_survey *into, const import_survey *from) {
    if (!from->count) return;
    into->count += from->count;
    add_low(into, from->min, from->min_count);
    add_high(into, from->max, from->max_count);
    if (isfinite(from->next_min)) add_low(into, from->next_min, 0);
    if (isfinite(from->next_max)) add_high(into, from->next_max, 0);
}

/* -------------------------------------------------------------------------------------------------- trials -- */
/* As rqt_unit_metres evaluates it; for integers, in their own unit. */
static inline double value_of(const import_steps *s, double q) {
    return ((double)s->z0 + q / (double)s->d) * s->scale;
}

static bool are_exact(const import_steps *s, bool single, const double *values, size_t n) {
    for (size_t from = 0; from < n; from += GROUP) {
        const size_t end = n - from < GROUP ? n : from + GROUP;
        int wrong = 0;
        for (size_t i = from; i < end; i++) {
            const double back = value_of(s, import_height(s, values[i]));
            wrong |= single ? (float)back != (float)values[i] : back != values[i];
        }
        if (wrong) return false;
    }
    return true;
}

static double largest_rounding(const import_steps *s, const double *values, size_t n, double largest) {
    for (size_t i = 0; i < n; i++) {
        const double off = fabs(value_of(s, import_height(s, values[i])) - values[i]);
        largest = off > largest ? off : largest;
    }
    return largest;
}

/* Rounding is only looked at where no decimals have held the values so far, for most rasters either have decimals
 * or show at once that they have none. Whole numbers lose nothing by it. */
static void try_values(import_look *look, const double *values, size_t n) {
    bool held = false;
    for (int i = 0; i < look->trials; i++) {
        import_trial *t = &look->trial[i];
        if (!t->possible) continue;
        if (t->exact) t->exact = are_exact(&t->steps, look->single, values, n);
        if (!t->wants_rounding) {
            if (t->exact && t->steps.d == 1) return;
            held = held || t->exact;
        } else if (!held) {
            t->rounding = largest_rounding(&t->steps, values, n, t->rounding);
        } else {
            t->knows_rounding = false;
        }
    }
}

/* ---------------------------------------------------------------------------------------------------- look -- */
void import_strip_doubles(const import_strip *strip, size_t at, size_t n, double *out) {
    switch (strip->kind) {
    case IMPORT_I32:
        for (size_t i = 0; i < n; i++) out[i] = ((const int32_t *)strip->values)[at + i];
        return;
    case IMPORT_I64:
        for (size_t i = 0; i < n; i++) out[i] = (double)((const int64_t *)strip->values)[at + i];
        return;
    case IMPORT_F32:
        for (size_t i = 0; i < n; i++) out[i] = (double)((const float *)strip->values)[at + i];
        return;
    case IMPORT_F64:
        memcpy(out, (const double *)strip->values + at, n * sizeof *out);
    }
}

/* The valid ones among n values, moved together. Returns their number. */
static size_t drop_voids(double *values, const uint8_t *valid, size_t n) {
    if (!memchr(valid, 0, n)) return n;
    size_t kept = 0;
    for (size_t i = 0; i < n; i++) {
        values[kept] = values[i];
        kept += valid[i];
    }
    return kept;
}

void import_look_rows(import_look *look, const import_strip *strip, int32_t first, int32_t rows, double *row) {
    const size_t width = (size_t)strip->width;
    for (int32_t y = first; y < first + rows; y++) {
        const size_t at = (size_t)y * width;
        import_strip_doubles(strip, at, width, row);
        const size_t n = drop_voids(row, strip->valid + at, width);
        if (look->wants_survey) survey_values(&look->survey, row, n);
        try_values(look, row, n);
    }
}

import_look import_look_empty(const import_look *look) {
    import_look empty = *look;
    empty.survey = survey_empty();
    return empty;
}

void import_look_merge(import_look *into, const import_look *from) {
    if (into->wants_survey) survey_merge(&into->survey, &from->survey);
    for (int i = 0; i < into->trials; i++) {
        import_trial *t = &into->trial[i];
        const import_trial *f = &from->trial[i];
        t->exact = t->exact && f->exact;
        t->knows_rounding = t->knows_rounding && f->knows_rounding;
        t->rounding = f->rounding > t->rounding ? f->rounding : t->rounding;
    }
}

/* ----------------------------------------------------------------------------------------------- suspicion -- */
/* Values that stand for "no data" in rasters of the wild. */
static bool is_usual_mark(double v) {
    static const double marks[] = {-32768, -32767, 32767, 65535, -9999, 9999, -99999, 99999, -9999999, -999};
    for (size_t i = 0; i < sizeof marks / sizeof *marks; i++)
        if (v == marks[i]) return true;
    return fabs(v) >= 1e9;
}

/* gap: from the extreme to the next value; rest: from there to the other extreme. NaN (one value only) is never. */
static bool stands_apart(double extreme, int64_t times, int64_t count, double gap, double rest) {
    bool usual = is_usual_mark(extreme) && ((double)times >= 0.01 * (double)count ? gap > 0 : gap > rest);
    /* Too few samples, or nothing but two values, tell nothing about a distribution. */
    bool far = count >= 100 && rest > 0 && gap > 10 * rest;
    return usual || far;
}

bool import_survey_min_is_suspicious(const import_survey *s) {
    return stands_apart(s->min, s->min_count, s->count, s->next_min - s->min, s->max - s->next_min);
}

bool import_survey_max_is_suspicious(const import_survey *s) {
    return stands_apart(s->max, s->max_count, s->count, s->max - s->next_max, s->next_max - s->min);
}
