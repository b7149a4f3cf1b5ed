/* survey.c - one look at the values before they become heights: their range decides the quantum, and an extreme
 * that stands apart from everything else is most likely the mark of voids that nobody declared. */
#include "parts.h"

#include <math.h>

void import_survey_take(const import_samples *samples, import_survey *out) {
    import_survey s = {.min = INFINITY, .max = -INFINITY, .next_min = INFINITY, .next_max = -INFINITY};
    size_t n = (size_t)samples->width * (size_t)samples->height;
    for (size_t i = 0; i < n; i++) {
        if (!samples->valid[i]) continue;
        double v = import_samples_at(samples, i);
        s.count++;
        if (v <= s.min) {
            if (v < s.min) {
                s.next_min = s.min;
                s.min = v;
                s.min_count = 0;
            }
            s.min_count++;
        } else if (v < s.next_min) {
            s.next_min = v;
        }
        if (v >= s.max) {
            if (v > s.max) {
                s.next_max = s.max;
                s.max = v;
                s.max_count = 0;
            }
            s.max_count++;
        } else if (v > s.next_max) {
            s.next_max = v;
        }
    }
    if (!s.count) s.min = s.max = 0;
    if (!isfinite(s.next_min)) s.next_min = NAN;
    if (!isfinite(s.next_max)) s.next_max = NAN;
    *out = s;
}

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
