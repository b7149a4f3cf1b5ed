/* units.c - names of units of height, as rasters and users write them. */
#include "parts.h"

#include <math.h>
#include <stdlib.h>
#include <strings.h>

static const struct {
    const char *name;
    int32_t numerator, denominator;
} names[] = {
    {"", 1, 1},
    {"m", 1, 1},
    {"metre", 1, 1},
    {"metres", 1, 1},
    {"meter", 1, 1},
    {"meters", 1, 1},
    {"ft", 381, 1250},
    {"foot", 381, 1250},
    {"feet", 381, 1250},
    {"international foot", 381, 1250},
    {"us-ft", 1200, 3937},
    {"ftUS", 1200, 3937},
    {"US survey foot", 1200, 3937},
};

bool import_unit_parse(const char *text, import_unit *unit) {
    *unit = (import_unit){1, 1, 1};
    if (!text) return true;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (!strcasecmp(text, names[i].name)) {
            unit->numerator = names[i].numerator;
            unit->denominator = names[i].denominator;
            return true;
        }
    char *end;
    double factor = strtod(text, &end);
    if (end == text || *end || !isfinite(factor) || factor == 0) return false;
    unit->plain = factor;
    return true;
}

import_unit import_unit_of_metres(double metres) {
    static const import_unit known[] = {{1, 1, 1}, {1, 381, 1250}, {1, 1200, 3937}};
    /* The two feet differ by 2e-6 of themselves; WKT carries at least nine digits. */
    for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
        double value = (double)known[i].numerator / known[i].denominator;
        if (fabs(metres - value) <= 1e-8 * value) return known[i];
    }
    return (import_unit){metres, 1, 1};
}
