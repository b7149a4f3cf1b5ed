/* table.c - tables for people. What programs read comes from SQL, or from info --json. */
#include "cli.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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
