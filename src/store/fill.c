/* fill.c - which samples of a terrain were no data: rqt_fill_N, in runs along rows, north to south, west to east.
 *
 * The table is there only when there is something in it. kind 1: filled between neighbours (rqt import --fill),
 * kind 2: sea (--sea). What it says can be checked: runs in order, inside, of samples that are valid, the sea at
 * one height.
 */
#include "internal.h"

#include "schema_sql.h"

#include <string.h>

bool store_has_fill(sqlite3 *db, const store_terrain *t) {
    char table[64];
    sqlite3_snprintf(sizeof table, table, "rqt_fill_%lld", t->id);
    return sqlite3_table_column_metadata(db, t->schema, table, "kind", NULL, NULL, NULL, NULL, NULL) == SQLITE_OK;
}

int store_fill_counts(store *s, const store_terrain *t, int64_t counts[2], char **error) {
    counts[0] = counts[1] = 0;
    sqlite3 *db = store_connection(s);
    if (!store_has_fill(db, t)) return SQLITE_OK;
    sqlite3_stmt *rows = NULL;
    char *sql = sqlite3_mprintf("SELECT kind, sum(col1 - col0 + 1) FROM \"%w\".rqt_fill_%lld WHERE kind IN (1, 2) "
                                "GROUP BY kind",
                                t->schema, t->id);
    int code = sql ? sqlite3_prepare_v2(db, sql, -1, &rows, NULL) : SQLITE_NOMEM;
    sqlite3_free(sql);
    while (code == SQLITE_OK && (code = sqlite3_step(rows)) == SQLITE_ROW) {
        counts[sqlite3_column_int(rows, 0) - 1] = sqlite3_column_int64(rows, 1);
        code = SQLITE_OK;
    }
    sqlite3_finalize(rows);
    return code == SQLITE_DONE ? SQLITE_OK : store_fail_db(error, db, code, "counting what was filled");
}

/* ----------------------------------------------------------------------------------------------------- check -- */
typedef struct check {
    store *s;
    const store_terrain *t;
    bool (*tell)(void *context, const store_finding *finding);
    void *context;
    char **error;
    int32_t *q;
    uint8_t *valid;
    int32_t row, last; /* of the run before */
    bool has_sea, told;
    int32_t sea_q;
} check;

/* The first finding is the only one: the table is wrong. */
static int found(check *c, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    char *what = sqlite3_vmprintf(format, arguments);
    va_end(arguments);
    char *text = what ? sqlite3_mprintf("filled samples: %s", what) : NULL;
    sqlite3_free(what);
    if (!text) return SQLITE_NOMEM;
    const store_finding finding = {"error", 0, text};
    (void)c->tell(c->context, &finding);
    sqlite3_free(text);
    c->told = true;
    return SQLITE_OK;
}

static int check_run(check *c, int64_t row, int64_t first, int64_t last, int64_t kind) {
    const rqt_lattice *l = &c->t->lattice;
    if (row < 0 || row >= l->height || first < 0 || last < first || last >= l->width || kind < 1 || kind > 2)
        return found(c, "a run of kind %lld in row %lld, columns %lld to %lld, is none of this terrain", kind, row,
                     first, last);
    if (row < c->row || (row == c->row && first <= c->last))
        return found(c, "the run in row %lld, columns %lld to %lld, is out of order", row, first, last);
    c->row = (int32_t)row;
    c->last = (int32_t)last;
    const int32_t n = (int32_t)(last - first + 1);
    const int code = store_window(c->s, c->t, (int32_t)first, (int32_t)row, n, 1, c->q, c->valid, c->error);
    if (code != SQLITE_OK) return code;
    for (int32_t i = 0; i < n; i++) {
        if (!c->valid[i]) return found(c, "the sample in row %lld, column %lld, is void", row, first + i);
        if (kind != 2) continue;
        if (!c->has_sea) c->sea_q = c->q[i];
        c->has_sea = true;
        if (c->q[i] != c->sea_q)
            return found(c, "the sea has another height in row %lld, column %lld", row, first + i);
    }
    return SQLITE_OK;
}

int store_check_fill(store *s, const store_terrain *t, bool (*tell)(void *context, const store_finding *finding),
                     void *context, char **error) {
    sqlite3 *db = store_connection(s);
    if (!store_has_fill(db, t)) return SQLITE_OK;
    /* By a name of this moment, as the blocks are read through the store. */
    check c = {.s = s, .tell = tell, .context = context, .error = error, .row = -1, .last = -1};
    char *name = sqlite3_mprintf("%s.%s", t->schema, t->name), *why = NULL;
    int code = name ? store_find(s, name, &c.t, &why) : SQLITE_NOMEM;
    sqlite3_free(name);
    sqlite3_free(why);
    if (code == SQLITE_ERROR || code == SQLITE_CORRUPT_VTAB) return SQLITE_OK; /* has been told */
    if (code != SQLITE_OK || c.t->id != t->id) return code;
    code = store_begin_on(s, c.t, error);
    if (code != SQLITE_OK) return code;
    sqlite3_stmt *rows = NULL;
    char *sql =
        sqlite3_mprintf("SELECT row, col0, col1, kind FROM \"%w\".rqt_fill_%lld ORDER BY id", c.t->schema, c.t->id);
    c.q = sqlite3_malloc64((sqlite3_uint64)c.t->lattice.width * sizeof *c.q);
    c.valid = sqlite3_malloc64((sqlite3_uint64)c.t->lattice.width);
    code = sql && c.q && c.valid ? sqlite3_prepare_v2(db, sql, -1, &rows, NULL) : SQLITE_NOMEM;
    sqlite3_free(sql);
    bool reading = true;
    while (code == SQLITE_OK && !c.told && (code = sqlite3_step(rows)) == SQLITE_ROW) {
        code = check_run(&c, sqlite3_column_int64(rows, 0), sqlite3_column_int64(rows, 1),
                         sqlite3_column_int64(rows, 2), sqlite3_column_int64(rows, 3));
        reading = code == SQLITE_OK;
    }
    sqlite3_finalize(rows);
    sqlite3_free(c.q);
    sqlite3_free(c.valid);
    store_end(s);
    if (code == SQLITE_OK || code == SQLITE_DONE) return SQLITE_OK;
    if (code == SQLITE_CORRUPT_VTAB) { /* a block that the check of blocks has told of */
        sqlite3_free(*error);
        *error = NULL;
        return SQLITE_OK;
    }
    return reading ? store_fail_db(error, db, code, "reading what was filled") : code;
}
