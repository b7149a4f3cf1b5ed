/* text.c - numbers and tables for people. What programs read comes from SQL, or from info --json. */
#include "cli.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A printf may need a dozen texts at once. */
static char *next_text(void) {
    static char ring[32][64];
    static unsigned at;
    return ring[at++ % 32];
}

const char *cli_count(int64_t n) {
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

const char *cli_real(double value) {
    char *text = next_text();
    snprintf(text, 64, "%.6g", value == 0 ? 0 : value);
    return text;
}

const char *cli_metres(double value) {
    char *text = next_text();
    snprintf(text, 64, fabs(value) < 1000 ? "%.4g" : "%.1f", value == 0 ? 0 : value);
    return fabs(value) < 1000 ? text : trim_zeros(text);
}

const char *cli_place(double value, bool lonlat) {
    char *text = next_text();
    if (fabs(value) >= 1e15)
        snprintf(text, 64, "%.9g", value);
    else
        snprintf(text, 64, lonlat ? "%.6f" : "%.2f", value);
    return trim_zeros(text);
}

const char *cli_length(double metres) {
    char *text = next_text();
    const double km = metres / 1000;
    if (metres < 999.5)
        snprintf(text, 64, "%.3g m", metres);
    else
        snprintf(text, 64, km < 10 ? "%.2f km" : km < 100 ? "%.1f km" : "%.0f km", km);
    return text;
}

const char *cli_crs_name(const char *wkt) {
    const char *start = strchr(wkt, '"'), *end = start ? strchr(start + 1, '"') : NULL;
    if (!*wkt) return "none";
    if (!end || end == start + 1) return "unnamed";
    char *text = next_text();
    snprintf(text, 64, "%.*s", (int)(end - start - 1), start + 1);
    return text;
}

const char *cli_crs_label(const store_terrain *t) {
    const char *name = cli_crs_name(t->crs);
    if (t->srid <= 0 || (strcmp(name, "unnamed") && strcmp(name, "unknown"))) return name;
    char *text = next_text();
    snprintf(text, 64, "EPSG:%d", t->srid);
    return text;
}

void cli_table_begin(cli_table *table, int columns, const char *align) {
    *table = (cli_table){.columns = columns, .left = align};
}

void cli_table_add(cli_table *table, const char *const *cells) {
    const size_t columns = (size_t)table->columns, have = (size_t)table->rows * columns;
    char **more = realloc(table->cells, (have + columns) * sizeof *more);
    table->incomplete = table->incomplete || !more;
    if (!more) return;
    table->cells = more;
    for (size_t i = 0; i < columns; i++) {
        more[have + i] = strdup(cells[i]);
        table->incomplete = table->incomplete || !more[have + i];
    }
    table->rows++;
}

/* Places that a UTF-8 text takes. */
static int width_of(const char *text) {
    int n = 0;
    for (; *text; text++) n += ((unsigned char)*text & 0xC0) != 0x80;
    return n;
}

void cli_table_print(cli_table *table) {
    for (int row = 0; row < table->rows; row++) {
        for (int column = 0; column < table->columns; column++) {
            int widest = 0;
            for (int r = 0; r < table->rows; r++) {
                const char *cell = table->cells[r * table->columns + column];
                if (cell && width_of(cell) > widest) widest = width_of(cell);
            }
            const char *cell = table->cells[row * table->columns + column];
            if (!cell) cell = "";
            const bool left = table->left[column] == 'l', last = column == table->columns - 1;
            const int pad = widest - width_of(cell);
            printf("%*s%s%*s", left ? 0 : pad, "", cell, left && !last ? pad : 0, "");
            fputs(last ? "\n" : "  ", stdout);
        }
    }
    for (int i = 0; i < table->rows * table->columns; i++) free(table->cells[i]);
    free(table->cells);
    if (table->incomplete) cli_say("out of memory: the table is not complete");
    *table = (cli_table){0};
}

/* WGS 84 near enough for a size in kilometres and a scale bar; the CRS's own metres otherwise (cost.cell is metres
 * of the longer cell side). */
void cli_ground(const store_terrain *t, int32_t row0, int32_t rows, double *per_column, double *per_row) {
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
