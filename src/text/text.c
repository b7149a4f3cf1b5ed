/* text.c - see text.h. */
#include "text.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* A printf may need a dozen texts at once. */
static char *next_text(void) {
    static _Thread_local char ring[32][64];
    static _Thread_local unsigned at;
    return ring[at++ % 32];
}

const char *text_count(int64_t n) {
    char digits[24], *text = next_text(), *end = text;
    const int length = snprintf(digits, sizeof digits, "%lld", (long long)n);
    for (int i = 0; i < length; i++) {
        *end++ = digits[i];
        const int rest = length - 1 - i;
        if (rest && rest % 3 == 0 && digits[i] != '-') *end++ = ' ';
    }
    *end = 0;
    return text;
}

static char *trim_zeros(char *text) {
    if (!strchr(text, '.')) return text;
    size_t n = strlen(text);
    while (text[n - 1] == '0') n--;
    if (text[n - 1] == '.') n--;
    text[n] = 0;
    return strcmp(text, "-0") ? text : text + 1;
}

const char *text_real(double value) {
    char *text = next_text();
    snprintf(text, 64, "%.6g", value == 0 ? 0 : value);
    return text;
}

const char *text_metres(double value) {
    char *text = next_text();
    snprintf(text, 64, fabs(value) < 1000 ? "%.4g" : "%.1f", value == 0 ? 0 : value);
    return fabs(value) < 1000 ? text : trim_zeros(text);
}

const char *text_place(double value, bool lonlat) {
    char *text = next_text();
    if (fabs(value) >= 1e15)
        snprintf(text, 64, "%.9g", value);
    else
        snprintf(text, 64, lonlat ? "%.6f" : "%.2f", value);
    return trim_zeros(text);
}

const char *text_length(double metres) {
    char *text = next_text();
    const double km = metres / 1000;
    if (metres < 999.5)
        snprintf(text, 64, "%.3g m", metres);
    else
        snprintf(text, 64, km < 10 ? "%.2f km" : km < 100 ? "%.1f km" : "%.0f km", km);
    return text;
}

const char *text_crs_name(const char *wkt) {
    const char *start = strchr(wkt, '"'), *end = start ? strchr(start + 1, '"') : NULL;
    if (!*wkt) return "none";
    if (!end || end == start + 1) return "unnamed";
    char *text = next_text();
    snprintf(text, 64, "%.*s", (int)(end - start - 1), start + 1);
    return text;
}

const char *text_crs_label(const store_terrain *t) {
    const char *name = text_crs_name(t->crs);
    if (t->srid <= 0 || (strcmp(name, "unnamed") && strcmp(name, "unknown"))) return name;
    char *text = next_text();
    snprintf(text, 64, "EPSG:%d", t->srid);
    return text;
}

/* WGS 84 near enough for a size in kilometres and a scale bar; the CRS's own metres otherwise (cost.cell is metres
 * of the longer cell side). */
void text_ground(const store_terrain *t, int32_t row0, int32_t rows, double *per_column, double *per_row) {
    const double dx = fabs(t->placement.dx), dy = fabs(t->placement.dy);
    if (t->lonlat) {
        double latitude = t->placement.y0 + (row0 + (rows - 1) / 2.0) * t->placement.dy;
        if (fabs(latitude) > 89) latitude = 89; /* a width of nothing is no use to anyone */
        const double phi = latitude * M_PI / 180;
        *per_column = dx * (111412.84 * cos(phi) - 93.5 * cos(3 * phi));
        *per_row = dy * (111132.92 - 559.82 * cos(2 * phi));
        return;
    }
    const double metres = t->cost.cell / fmax(dx, dy);
    *per_column = dx * metres;
    *per_row = dy * metres;
}
