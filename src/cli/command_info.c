/* command_info.c - rqt info: what is in the database, for people; --json for programs.
 *
 * The figures come from SQL's rqt_terrains; what that table does not have (place, CRS, provenance) from the store.
 */
#include "cli.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char HELP[] =
    "rqt info: what is in the database?\n"
    "\n"
    "Usage: rqt info [--json] DATABASE\n"
    "\n"
    "A table of the terrains: samples, cell size, heights and quantum in metres, voids, blocks, bytes, and the\n"
    "largest error of a vertex (beside voids it counts the outline that would be lost without it). Then for each\n"
    "its extent, coordinate reference system and source.\n"
    "\n"
    "Options:\n"
    "  --json          the same for programs: an array with an object for each terrain\n"
    "  --help          this text\n"
    "\n"
    "Examples:\n"
    "  rqt info washington.gpkg\n"
    "  rqt info --json washington.gpkg | jq '.[].name'\n";

static const struct option OPTIONS[] = {
    {"json", no_argument, NULL, 'j'}, {"help", no_argument, NULL, 'h'}, {NULL, 0, NULL, 0}};

/* A row of rqt_terrains. */
typedef struct figures {
    double min_z, max_z, quantum, max_error;
    bool has_heights;
    int64_t voids, blocks, bytes;
    int64_t filled[2]; /* samples that were no data: between neighbours, sea */
} figures;

static bool read_figures(sqlite3 *db, const char *name, figures *f) {
    sqlite3_stmt *row = cli_prepare(db, "SELECT min_z, max_z, quantum, voids, blocks, bytes, max_error FROM "
                                        "rqt_terrains WHERE name = ?1");
    if (!row) return false;
    sqlite3_bind_text(row, 1, name, -1, SQLITE_STATIC);
    const int code = sqlite3_step(row);
    *f = (figures){0}; /* without memory nobody comes here. NOLINT(clang-analyzer-core.NullDereference) */
    if (code == SQLITE_ROW)
        *f = (figures){.has_heights = sqlite3_column_type(row, 0) != SQLITE_NULL,
                       .min_z = sqlite3_column_double(row, 0),
                       .max_z = sqlite3_column_double(row, 1),
                       .quantum = sqlite3_column_double(row, 2),
                       .voids = sqlite3_column_int64(row, 3),
                       .blocks = sqlite3_column_int64(row, 4),
                       .bytes = sqlite3_column_int64(row, 5),
                       .max_error = sqlite3_column_double(row, 6)};
    else if (code != SQLITE_DONE)
        cli_fail_database(db);
    sqlite3_finalize(row);
    return code == SQLITE_ROW || code == SQLITE_DONE;
}

static double samples_of(const store_terrain *t) {
    return (double)t->lattice.width * t->lattice.height;
}

/* West, south, east and north sample. */
static void extent_of(const store_terrain *t, double box[4]) {
    const rqt_placement *p = &t->placement;
    const double x = p->x0 + (t->lattice.width - 1) * p->dx, y = p->y0 + (t->lattice.height - 1) * p->dy;
    box[0] = fmin(p->x0, x);
    box[1] = fmin(p->y0, y);
    box[2] = fmax(p->x0, x);
    box[3] = fmax(p->y0, y);
}

static void add_row(cli_table *table, const store_terrain *t, const figures *f) {
    char samples[64], heights[80], bits[32], cell[80], percent[32];
    double across, down;
    text_ground(t, 0, t->lattice.height, &across, &down);
    snprintf(samples, sizeof samples, "%d x %d", t->lattice.width, t->lattice.height);
    if (!*t->crs)
        snprintf(cell, sizeof cell, "%s x %s", text_real(fabs(t->placement.dx)), text_real(fabs(t->placement.dy)));
    else if (fmax(across, down) < 999.5)
        snprintf(cell, sizeof cell, "%.3g x %.3g m", across, down);
    else
        snprintf(cell, sizeof cell, "%s x %s", text_length(across), text_length(down));
    snprintf(heights, sizeof heights, "%s .. %s m", text_real(f->min_z), text_real(f->max_z));
    snprintf(bits, sizeof bits, "%.2f", 8.0 * (double)f->bytes / samples_of(t));
    snprintf(percent, sizeof percent, "%.3g %%", 100.0 * (double)f->voids / samples_of(t));
    char *const quantum = sqlite3_mprintf("%s m", text_real(f->quantum));
    char *const error = sqlite3_mprintf("%s m", text_real(f->max_error));
    const char *cells[] = {t->name,
                           samples,
                           cell,
                           !t->complete     ? "INCOMPLETE"
                           : f->has_heights ? heights
                                            : "all void",
                           quantum ? quantum : "",
                           f->voids ? percent : "0",
                           text_count(f->blocks),
                           text_count(f->bytes),
                           bits,
                           error ? error : ""};
    cli_table_add(table, cells);
    sqlite3_free(quantum);
    sqlite3_free(error);
}

/* Its lines in one, with commas between them. */
static void print_lines(const char *text) {
    for (; *text; text++)
        if (*text == '\n')
            fputs(", ", stdout);
        else
            putchar(*text);
    putchar('\n');
}

static void print_details(const store_terrain *t, const figures *f) {
    double box[4], across, down;
    extent_of(t, box);
    text_ground(t, 0, t->lattice.height, &across, &down);
    printf("\n%s%s\n", t->name, t->complete ? "" : "  (INCOMPLETE: its import did not finish; queries refuse it)");
    printf("  extent   x %s .. %s, y %s .. %s", text_place(box[0], t->lonlat), text_place(box[2], t->lonlat),
           text_place(box[1], t->lonlat), text_place(box[3], t->lonlat));
    if (*t->crs)
        printf(" (%s x %s)", text_length(across * (t->lattice.width - 1)),
               text_length(down * (t->lattice.height - 1)));
    printf("\n  cell     %.10g x %.10g%s\n", fabs(t->placement.dx), fabs(t->placement.dy),
           t->lonlat ? " degrees" : "");
    const char *crs = text_crs_label(t);
    printf("  CRS      %s", crs);
    if (t->srid && strncmp(crs, "EPSG:", 5)) printf(" (SRID %d)", t->srid);
    if (*t->vertical) printf(", heights above %s", t->vertical);
    printf("\n  blocks   of %d x %d samples\n", (1 << t->k) + 1, (1 << t->k) + 1);
    if (f->filled[0])
        printf("  filled   %s void samples, from their neighbours (table rqt_fill_%lld)\n",
               text_count(f->filled[0]), (long long)t->id);
    if (f->filled[1])
        printf("  sea      %s void samples (table rqt_fill_%lld)\n", text_count(f->filled[1]), (long long)t->id);
    if (t->quantum_error > 0) printf("  rounded  by at most %s m on import\n", text_real(t->quantum_error));
    printf("  source   ");
    print_lines(t->source);
    printf("  imported %s\n", t->created);
}

static cJSON *object_of(const store_terrain *t, const figures *f) {
    cJSON *o = cJSON_CreateObject();
    double box[4];
    extent_of(t, box);
    cJSON_AddStringToObject(o, "name", t->name);
    cJSON_AddBoolToObject(o, "complete", t->complete);
    if (t->srid)
        cJSON_AddNumberToObject(o, "srid", t->srid);
    else
        cJSON_AddNullToObject(o, "srid");
    cJSON_AddStringToObject(o, "crs", t->crs);
    cJSON_AddStringToObject(o, "vertical", t->vertical);
    cJSON_AddNumberToObject(o, "width", t->lattice.width);
    cJSON_AddNumberToObject(o, "height", t->lattice.height);
    cJSON_AddNumberToObject(o, "cell_x", fabs(t->placement.dx));
    cJSON_AddNumberToObject(o, "cell_y", fabs(t->placement.dy));
    cJSON_AddItemToObject(o, "extent", cJSON_CreateDoubleArray(box, 4));
    if (f->has_heights) {
        cJSON_AddNumberToObject(o, "min_z", f->min_z);
        cJSON_AddNumberToObject(o, "max_z", f->max_z);
    }
    cJSON_AddNumberToObject(o, "quantum", f->quantum);
    cJSON_AddNumberToObject(o, "quantum_error", t->quantum_error);
    cJSON_AddNumberToObject(o, "voids", (double)f->voids);
    cJSON_AddNumberToObject(o, "filled", (double)f->filled[0]);
    cJSON_AddNumberToObject(o, "sea", (double)f->filled[1]);
    cJSON_AddNumberToObject(o, "block_k", t->k);
    cJSON_AddNumberToObject(o, "blocks", (double)f->blocks);
    cJSON_AddNumberToObject(o, "bytes", (double)f->bytes);
    cJSON_AddNumberToObject(o, "max_error", f->max_error);
    cJSON_AddStringToObject(o, "source", t->source);
    cJSON_AddStringToObject(o, "created", t->created);
    return o;
}

static int print_json(const store_terrain *terrains, const figures *f, int count) {
    cJSON *array = cJSON_CreateArray();
    for (int i = 0; i < count; i++) cJSON_AddItemToArray(array, object_of(&terrains[i], &f[i]));
    char *text = cJSON_Print(array);
    if (text) puts(text);
    cJSON_free(text);
    cJSON_Delete(array);
    return text ? CLI_OK : cli_fail("out of memory");
}

static void print_table(const store_terrain *terrains, const figures *f, int count) {
    static const char *const heads[] = {"name",  "samples", "cell",  "heights",     "quantum",
                                        "voids", "blocks",  "bytes", "bits/sample", "max error"};
    cli_table table;
    cli_table_begin(&table, 10, "llllrrrrrr");
    cli_table_add(&table, heads);
    for (int i = 0; i < count; i++) add_row(&table, &terrains[i], &f[i]);
    cli_table_print(&table);
    bool outline = false;
    for (int i = 0; i < count; i++)
        outline = outline || (f[i].voids && f[i].has_heights && f[i].max_error > f[i].max_z - f[i].min_z);
    if (outline) puts("max error counts what a void outline may cost");
    for (int i = 0; i < count; i++) print_details(&terrains[i], &f[i]);
}

static int info(sqlite3 *db, const char *path, bool json) {
    store *s = NULL;
    store_terrain *terrains = NULL;
    int count = 0, status = CLI_OK;
    char *sentence = NULL;
    int code = store_open(db, &s);
    if (code == SQLITE_OK) code = store_terrains(s, &terrains, &count, &sentence);
    if (code != SQLITE_OK) {
        if (s) store_close(s);
        return cli_fail_store(code, sentence);
    }
    /* Rows that cannot be used are told on stderr and fail the command; the others are shown all the same. */
    int usable = 0;
    for (int i = 0; i < count; i++) {
        if (terrains[i].problem) {
            cli_say("%s", terrains[i].problem);
            continue;
        }
        const store_terrain swap = terrains[usable];
        terrains[usable++] = terrains[i];
        terrains[i] = swap;
    }
    figures *f = calloc((size_t)count + 1, sizeof *f);
    if (!f) status = cli_fail("out of memory");
    for (int i = 0; i < usable && status == CLI_OK; i++)
        if (!read_figures(db, terrains[i].name, &f[i]))
            status = CLI_FAILED;
        else if ((code = store_fill_counts(s, &terrains[i], f[i].filled, &sentence)) != SQLITE_OK)
            status = cli_fail_store(code, sentence);
    if (status == CLI_OK && json) {
        status = print_json(terrains, f, usable);
    } else if (status == CLI_OK) {
        if (usable)
            print_table(terrains, f, usable);
        else if (count == 0)
            cli_say("%s has no terrain", path);
    }
    free(f);
    store_close(s);
    store_terrains_free(terrains, count);
    return status == CLI_OK && usable < count ? CLI_FAILED : status;
}

static int run(int argc, char **argv) {
    bool json = false;
    for (int option; (option = cli_option(argc, argv, "h", OPTIONS)) != -1;) {
        if (option == 'h') return cli_help(HELP);
        if (option == '?') return CLI_USAGE;
        json = true;
    }
    if (argc - optind != 1)
        return argc == optind ? cli_usage("a database is missing") : cli_usage("one database at a time");
    sqlite3 *db = cli_open(argv[optind]);
    if (!db) return CLI_FAILED;
    const int status = info(db, argv[optind], json);
    sqlite3_close(db);
    return status;
}

const cli_command command_info = {"info", "what is in the database", run};
