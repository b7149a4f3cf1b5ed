/* terrain.c - the rows of rqt_terrain: one file knows its columns.
 *
 * Rows are hostile: a hand-edited or damaged number must not become an index out of bounds, so every field is
 * checked for the range that the code behind it relies on.
 */
#include "internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define COLUMNS                                                                                                  \
    "id, name, format, complete, width, height, k, x0, y0, dx, dy, z0, d, unit_numerator, unit_denominator, "    \
    "scale, height_offset, quantum_error, cell, void_tol, srid, lonlat, wgs84, crs, vertical, source, created, " \
    "voids, min_q, max_q, blocks, bytes, max_error"

static void *resize(void *context, void *p, size_t bytes) {
    (void)context;
    if (bytes) return sqlite3_realloc64(p, bytes);
    sqlite3_free(p);
    return NULL;
}

const rqt_allocator *store_allocator(void) {
    static const rqt_allocator sqlite_memory = {resize, NULL};
    return &sqlite_memory;
}

int store_fail(char **error, int code, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    char *text = sqlite3_vmprintf(format, arguments);
    va_end(arguments);
    if (error) {
        sqlite3_free(*error);
        *error = text;
    } else {
        sqlite3_free(text);
    }
    return text ? code : SQLITE_NOMEM;
}

int store_fail_db(char **error, sqlite3 *db, int code, const char *doing) {
    const int primary = code & 0xFF;
    if (primary == SQLITE_NOMEM || primary == SQLITE_INTERRUPT) return primary;
    return store_fail(error, primary, "%s: %s", doing, sqlite3_errmsg(db));
}

bool store_name_is_valid(const char *name) {
    size_t n = 0;
    for (; name[n]; n++) {
        const char c = name[n];
        const bool fits = (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' ||
                          c == '.' || c == '-';
        if (!fits || n >= 63) return false;
    }
    return n > 0 && strcmp(name, ".") != 0 && strcmp(name, "..") != 0;
}

static char *text_column(sqlite3_stmt *row, int column) {
    const unsigned char *text = sqlite3_column_text(row, column);
    return sqlite3_mprintf("%s", text ? (const char *)text : "");
}

static void free_texts(store_terrain *t) {
    sqlite3_free(t->crs);
    sqlite3_free(t->vertical);
    sqlite3_free(t->source);
    sqlite3_free(t->created);
    sqlite3_free(t->problem);
    t->crs = t->vertical = t->source = t->created = t->problem = NULL;
}

void store_terrains_free(store_terrain *terrains, int count) {
    for (int i = 0; i < count; i++) free_texts(&terrains[i]);
    sqlite3_free(terrains);
}

static bool in_range(int64_t value, int64_t low, int64_t high) {
    return value >= low && value <= high;
}

/* A row that cannot be used is remembered with a sentence: it must not keep anyone from the other terrains. */
static int unusable(store_terrain *t, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    t->problem = sqlite3_vmprintf(format, arguments);
    va_end(arguments);
    return t->problem ? SQLITE_OK : SQLITE_NOMEM;
}

static int read_row(sqlite3_stmt *row, const char *schema, store_terrain *t) {
    memset(t, 0, sizeof *t);
    t->suffix = "";
    const char *name = (const char *)sqlite3_column_text(row, 1);
    t->id = sqlite3_column_int64(row, 0);
    sqlite3_snprintf(sizeof t->schema, t->schema, "%s", schema);
    sqlite3_snprintf(sizeof t->name, t->name, "#%lld", t->id);
    if (!name || !store_name_is_valid(name))
        return unusable(t, "row %lld of rqt_terrain has no usable name", t->id);
    sqlite3_snprintf(sizeof t->name, t->name, "%s", name);
    if (strlen(schema) >= sizeof t->schema) return unusable(t, "terrain %s: its database's name is too long", name);
    const int64_t format = sqlite3_column_int64(row, 2);
    if (format != RQT_FORMAT_VERSION)
        return unusable(t, "terrain %s has format %lld; this version reads format %d", name, format,
                        RQT_FORMAT_VERSION);
    t->complete = sqlite3_column_int64(row, 3) == 1;
    const int64_t k = sqlite3_column_int64(row, 6);
    t->placement = (rqt_placement){sqlite3_column_double(row, 7), sqlite3_column_double(row, 8),
                                   sqlite3_column_double(row, 9), sqlite3_column_double(row, 10)};
    const int64_t d = sqlite3_column_int64(row, 12), numerator = sqlite3_column_int64(row, 13),
                  denominator = sqlite3_column_int64(row, 14), srid = sqlite3_column_int64(row, 20),
                  min_q = sqlite3_column_int64(row, 28), max_q = sqlite3_column_int64(row, 29),
                  max_error = sqlite3_column_int64(row, 32);
    const char *wrong = NULL;
    if (rqt_lattice_init(&t->lattice, sqlite3_column_int64(row, 4), sqlite3_column_int64(row, 5)) != RQT_OK)
        wrong = "width or height";
    else if (!in_range(k, t->lattice.K > 0, t->lattice.K < RQT_MAX_BLOCK_K ? t->lattice.K : RQT_MAX_BLOCK_K))
        wrong = "k";
    else if (!isfinite(t->placement.x0) || !isfinite(t->placement.y0) || !isfinite(t->placement.dx) ||
             !isfinite(t->placement.dy) || t->placement.dx == 0 || t->placement.dy == 0 ||
             !isfinite(t->placement.x0 + t->lattice.width * t->placement.dx) ||
             !isfinite(t->placement.y0 + t->lattice.height * t->placement.dy))
        wrong = "placement";
    else if (!in_range(d, 1, 1 << 20) || !in_range(numerator, 1, 1 << 20) || !in_range(denominator, 1, 1 << 20))
        wrong = "unit";
    else if (!in_range(srid, INT32_MIN, INT32_MAX))
        wrong = "srid";
    else if (!in_range(min_q, -RQT_HEIGHT_LIMIT + 1, max_q) || !in_range(max_q, min_q, RQT_HEIGHT_LIMIT - 1))
        wrong = "min_q or max_q";
    else if (!in_range(max_error, 0, RQT_CODE_LARGEST))
        wrong = "max_error";
    if (!wrong) {
        t->k = (int)k;
        t->unit = (rqt_unit){.z0 = sqlite3_column_int64(row, 11),
                             .d = (int32_t)d,
                             .numerator = (int32_t)numerator,
                             .denominator = (int32_t)denominator,
                             .scale = sqlite3_column_double(row, 15),
                             .offset = sqlite3_column_double(row, 16)};
        t->quantum_error = sqlite3_column_double(row, 17);
        t->cost = (rqt_void_cost){sqlite3_column_double(row, 18), sqlite3_column_double(row, 19)};
        if (!rqt_unit_is_valid(&t->unit))
            wrong = "scale or offset";
        else if (!(t->quantum_error >= 0) || !isfinite(t->quantum_error))
            wrong = "quantum_error";
        else if (!(t->cost.cell > 0) || !(t->cost.c > 0) || !isfinite(t->cost.cell) || !isfinite(t->cost.c))
            wrong = "cell or void_tol";
    }
    if (wrong) return unusable(t, "terrain %s: its row in rqt_terrain has an impossible %s", name, wrong);
    t->srid = (int32_t)srid;
    t->lonlat = sqlite3_column_int64(row, 21) != 0;
    t->wgs84 = sqlite3_column_int64(row, 22) != 0;
    t->crs = text_column(row, 23);
    t->vertical = text_column(row, 24);
    t->source = text_column(row, 25);
    t->created = text_column(row, 26);
    t->voids = sqlite3_column_int64(row, 27);
    t->min_q = (int32_t)min_q;
    t->max_q = (int32_t)max_q;
    t->blocks = sqlite3_column_int64(row, 30);
    t->bytes = sqlite3_column_int64(row, 31);
    t->max_error = (rqt_code)max_error;
    if (t->crs && t->vertical && t->source && t->created) return SQLITE_OK;
    free_texts(t);
    return SQLITE_NOMEM;
}

/* Append the terrains of one schema of the connection. A schema without the table, or with another program's table
 * of that name, has none. */
static int read_schema(sqlite3 *db, const char *schema, store_terrain **terrains, int *count, char **error) {
    if (sqlite3_table_column_metadata(db, schema, "rqt_terrain", "unit_numerator", NULL, NULL, NULL, NULL, NULL) !=
        SQLITE_OK)
        return SQLITE_OK;
    char *sql = sqlite3_mprintf("SELECT " COLUMNS " FROM \"%w\".rqt_terrain ORDER BY name", schema);
    if (!sql) return SQLITE_NOMEM;
    sqlite3_stmt *row = NULL;
    int code = sqlite3_prepare_v2(db, sql, -1, &row, NULL);
    sqlite3_free(sql);
    if (code != SQLITE_OK) return store_fail_db(error, db, code, "reading rqt_terrain");
    while ((code = sqlite3_step(row)) == SQLITE_ROW) {
        store_terrain *more = sqlite3_realloc64(*terrains, (sqlite3_uint64)(*count + 1) * sizeof **terrains);
        code = more ? SQLITE_OK : SQLITE_NOMEM;
        if (more) {
            *terrains = more;
            code = read_row(row, schema, &more[*count]);
        }
        if (code != SQLITE_OK) break;
        ++*count;
    }
    if (code == SQLITE_DONE)
        code = SQLITE_OK;
    else if (!error || !*error)
        code = store_fail_db(error, db, code, "reading rqt_terrain");
    sqlite3_finalize(row);
    return code;
}

double store_quantum(const store_terrain *t) {
    return fabs(rqt_unit_factor(&t->unit)) / t->unit.d;
}

int store_read_terrains(sqlite3 *db, store_terrain **terrains, int *count, char **error) {
    *terrains = NULL;
    *count = 0;
    int code = SQLITE_OK;
    for (int i = 0; code == SQLITE_OK; i++) {
        const char *schema = sqlite3_db_name(db, i);
        if (!schema) break;
        if (i != 1)
            code = read_schema(db, schema, terrains, count, error); /* 1 is temp: not watched, so not served */
    }
    if (code != SQLITE_OK) {
        store_terrains_free(*terrains, *count);
        *terrains = NULL;
        *count = 0;
    }
    return code;
}

int store_insert_terrain(sqlite3 *db, const store_terrain *t, int64_t *id, char **error) {
    sqlite3_stmt *s = NULL;
    int code =
        sqlite3_prepare_v2(db,
                           "INSERT INTO main.rqt_terrain(" COLUMNS ") VALUES(NULL,?1,?2,0,?3,?4,?5,?6,?7,?8,?9,?10,"
                           "?11,?12,?13,?14,?15,?16,?17,?18,?19,?20,?21,?22,?23,?24,?25,?26,?27,?28,0,0,0)",
                           -1, &s, NULL);
    if (code != SQLITE_OK) return store_fail_db(error, db, code, "adding a terrain");
    const double reals[] = {t->placement.x0, t->placement.y0, t->placement.dx, t->placement.dy};
    sqlite3_bind_text(s, 1, t->name, -1, SQLITE_STATIC);
    sqlite3_bind_int(s, 2, RQT_FORMAT_VERSION);
    sqlite3_bind_int(s, 3, t->lattice.width);
    sqlite3_bind_int(s, 4, t->lattice.height);
    sqlite3_bind_int(s, 5, t->k);
    for (int i = 0; i < 4; i++) sqlite3_bind_double(s, 6 + i, reals[i]);
    sqlite3_bind_int64(s, 10, t->unit.z0);
    sqlite3_bind_int(s, 11, t->unit.d);
    sqlite3_bind_int(s, 12, t->unit.numerator);
    sqlite3_bind_int(s, 13, t->unit.denominator);
    sqlite3_bind_double(s, 14, t->unit.scale);
    sqlite3_bind_double(s, 15, t->unit.offset);
    sqlite3_bind_double(s, 16, t->quantum_error);
    sqlite3_bind_double(s, 17, t->cost.cell);
    sqlite3_bind_double(s, 18, t->cost.c);
    sqlite3_bind_int(s, 19, t->srid);
    sqlite3_bind_int(s, 20, t->lonlat);
    sqlite3_bind_int(s, 21, t->wgs84);
    const char *texts[] = {t->crs, t->vertical, t->source, t->created};
    for (int i = 0; i < 4; i++) sqlite3_bind_text(s, 22 + i, texts[i] ? texts[i] : "", -1, SQLITE_STATIC);
    sqlite3_bind_int64(s, 26, t->voids);
    sqlite3_bind_int(s, 27, t->min_q);
    sqlite3_bind_int(s, 28, t->max_q);
    sqlite3_step(s);
    code = sqlite3_finalize(s);
    if (code != SQLITE_OK) return store_fail_db(error, db, code, "adding a terrain");
    *id = sqlite3_last_insert_rowid(db);
    return SQLITE_OK;
}
