/* amend.c - changes to a terrain that is there: rows of its blocks, of its index, and its own.
 *
 * Only what differs is written. A summary that changes without its block is changed in place, and SQLite leaves the
 * pages of the BLOB alone; an index row is changed, added or dropped as the block's intervals say. As with writer.c
 * the transaction is the caller's.
 */
#include "internal.h"

struct store_amender {
    sqlite3 *db;
    int64_t id;
    int k;
    rqt_lattice lattice;
    int64_t blocks, bytes;
    sqlite3_stmt *size, *put_block, *put_summary, *put_index, *drop_index;
};

static int run(sqlite3 *db, char *sql, const char *doing, char **error) {
    int code = sql ? sqlite3_exec(db, sql, NULL, NULL, NULL) : SQLITE_NOMEM;
    if (sql && code != SQLITE_OK) code = store_fail_db(error, db, code, doing);
    sqlite3_free(sql);
    return code;
}

static bool has_contents(sqlite3 *db) {
    return sqlite3_table_column_metadata(db, "main", "gpkg_contents", NULL, NULL, NULL, NULL, NULL, NULL) ==
           SQLITE_OK;
}

void store_amend_free(store_amender *a) {
    if (!a) return;
    sqlite3_finalize(a->size);
    sqlite3_finalize(a->put_block);
    sqlite3_finalize(a->put_summary);
    sqlite3_finalize(a->put_index);
    sqlite3_finalize(a->drop_index);
    sqlite3_free(a);
}

int store_amend_begin(sqlite3 *db, const store_terrain *t, store_amender **amender, char **error) {
    *amender = NULL;
    store_amender *a = sqlite3_malloc(sizeof *a);
    if (!a) return SQLITE_NOMEM;
    *a = (store_amender){
        .db = db, .id = t->id, .k = t->k, .lattice = t->lattice, .blocks = t->blocks, .bytes = t->bytes};
    const struct {
        sqlite3_stmt **out;
        const char *format;
    } wanted[] = {
        {&a->size, "SELECT length(data) FROM main.rqt_block_%lld WHERE id = ?1"},
        {&a->put_block, "UPDATE main.rqt_block_%lld SET summary = ?2, data = ?3 WHERE id = ?1"},
        {&a->put_summary, "UPDATE main.rqt_block_%lld SET summary = ?2 WHERE id = ?1"},
        {&a->put_index, "INSERT OR REPLACE INTO main.rqt_index_%lld VALUES(?1,?2,?3,?4,?5,?6,?7,?8,?9)"},
        {&a->drop_index, "DELETE FROM main.rqt_index_%lld WHERE id = ?1"},
    };
    int code = SQLITE_OK;
    for (size_t i = 0; i < sizeof wanted / sizeof *wanted && code == SQLITE_OK; i++) {
        char *sql = sqlite3_mprintf(wanted[i].format, t->id);
        code = sql ? sqlite3_prepare_v3(db, sql, -1, SQLITE_PREPARE_PERSISTENT, wanted[i].out, NULL) : SQLITE_NOMEM;
        if (sql && code != SQLITE_OK) code = store_fail_db(error, db, code, "preparing to change blocks");
        sqlite3_free(sql);
    }
    if (code != SQLITE_OK)
        store_amend_free(a);
    else
        *amender = a;
    return code;
}

/* Run a statement that changes the one row of a block. */
static int change_row(store_amender *a, sqlite3_stmt *s, rqt_block_number number, const char *doing, char **error) {
    sqlite3_bind_int64(s, 1, (sqlite3_int64)number);
    sqlite3_step(s);
    const int code = sqlite3_reset(s);
    sqlite3_clear_bindings(s);
    if (code != SQLITE_OK) return store_fail_db(error, a->db, code, doing);
    if (sqlite3_changes(a->db) == 1) return SQLITE_OK;
    return store_fail(error, SQLITE_CORRUPT_VTAB, "%s: block %llu has no row there", doing, number);
}

static bool is_same(rqt_interval x, rqt_interval y) {
    return x.em == y.em && x.em_parent == y.em_parent;
}

static int change_index(store_amender *a, rqt_block_number number, const rqt_summary *before,
                        const rqt_summary *after, char **error) {
    rqt_block_place place;
    if (is_same(before->tol, after->tol) && is_same(before->exact, after->exact)) return SQLITE_OK;
    (void)rqt_block_locate(&a->lattice, a->k, number, &place);
    const bool answered = store_bind_index(a->put_index, &a->lattice, &place, number, before);
    if (store_bind_index(a->put_index, &a->lattice, &place, number, after))
        return change_row(a, a->put_index, number, "writing the index", error);
    return answered ? change_row(a, a->drop_index, number, "writing the index", error) : SQLITE_OK;
}

int store_amend_block(store_amender *a, rqt_block_number number, const rqt_summary *before,
                      const rqt_summary *after, const uint8_t *bytes, size_t size, char **error) {
    uint8_t encoded[RQT_SUMMARY_BYTES];
    sqlite3_stmt *s = bytes ? a->put_block : a->put_summary;
    rqt_summary_encode(after, encoded);
    if (bytes) {
        sqlite3_bind_int64(a->size, 1, (sqlite3_int64)number);
        if (sqlite3_step(a->size) == SQLITE_ROW) a->bytes += (int64_t)size - sqlite3_column_int64(a->size, 0);
        const int code = sqlite3_reset(a->size);
        if (code != SQLITE_OK) return store_fail_db(error, a->db, code, "reading a block");
        sqlite3_bind_blob64(s, 3, bytes, size, SQLITE_STATIC);
    }
    sqlite3_bind_blob(s, 2, encoded, sizeof encoded, SQLITE_STATIC);
    const int code = change_row(a, s, number, "writing a block", error);
    return code == SQLITE_OK ? change_index(a, number, before, after, error) : code;
}

int store_amend_terrain(store_amender *a, const rqt_statistics *statistics, const char *source, char **error) {
    int code = run(a->db,
                   sqlite3_mprintf("UPDATE main.rqt_terrain SET source = %Q, voids = %lld, min_q = %d, max_q = %d, "
                                   "blocks = %lld, bytes = %lld, max_error = %d WHERE id = %lld",
                                   source, statistics->voids, statistics->min_q, statistics->max_q, a->blocks,
                                   a->bytes, statistics->max_error, a->id),
                   "changing the terrain's row", error);
    if (code != SQLITE_OK || !has_contents(a->db)) return code;
    return run(
        a->db,
        sqlite3_mprintf("UPDATE main.gpkg_contents SET last_change = strftime('%%Y-%%m-%%dT%%H:%%M:%%fZ', 'now') "
                        "WHERE table_name IN ('rqt_terrain', 'rqt_block_%lld')",
                        a->id),
        "noting the change in the GeoPackage", error);
}

/* ------------------------------------------------------------------------------------------------ filled samples
 * -- */

typedef struct filled_run {
    sqlite3_int64 id, row, first, last, kind;
} filled_run;

static bool has_filled(const store_amender *a) {
    char table[64];
    sqlite3_snprintf(sizeof table, table, "rqt_fill_%lld", a->id);
    return sqlite3_table_column_metadata(a->db, "main", table, "kind", NULL, NULL, NULL, NULL, NULL) == SQLITE_OK;
}

/* Those that meet a window; *runs is to be released with sqlite3_free. */
static int find_filled(store_amender *a, const int32_t window[4], filled_run **runs, size_t *count, char **error) {
    sqlite3_stmt *s = NULL;
    char *sql = sqlite3_mprintf("SELECT id, row, col0, col1, kind FROM main.rqt_fill_%lld "
                                "WHERE row BETWEEN ?1 AND ?2 AND col0 <= ?4 AND col1 >= ?3",
                                a->id);
    int code = sql ? sqlite3_prepare_v2(a->db, sql, -1, &s, NULL) : SQLITE_NOMEM;
    sqlite3_free(sql);
    for (int i = 0; i < 4 && code == SQLITE_OK; i++) code = sqlite3_bind_int(s, i + 1, window[i]);
    while (code == SQLITE_OK && (code = sqlite3_step(s)) == SQLITE_ROW) {
        filled_run *more = sqlite3_realloc64(*runs, (*count + 1) * sizeof **runs);
        code = more ? SQLITE_OK : SQLITE_NOMEM;
        if (!more) break;
        *runs = more;
        more[(*count)++] =
            (filled_run){sqlite3_column_int64(s, 0), sqlite3_column_int64(s, 1), sqlite3_column_int64(s, 2),
                         sqlite3_column_int64(s, 3), sqlite3_column_int64(s, 4)};
    }
    sqlite3_finalize(s);
    return code == SQLITE_DONE ? SQLITE_OK : store_fail_db(error, a->db, code, "reading what was filled");
}

/* What stays of a run: the samples that the state keeps. */
static int cut_run(store_amender *a, const filled_run *r, int32_t col, int32_t row, int32_t width,
                   const uint8_t *state, bool *cut, char **error) {
    sqlite3_str *sql = sqlite3_str_new(NULL);
    const uint8_t *const line = state + (size_t)(r->row - row) * (size_t)width;
    bool same = true;
    sqlite3_str_appendf(sql, "DELETE FROM main.rqt_fill_%lld WHERE id = %lld;", a->id, r->id);
    for (sqlite3_int64 x = r->first, begin = x; x <= r->last + 1; x++) {
        const bool stays = x <= r->last && (x < col || x >= col + width || line[x - col] == STORE_KEEP);
        if (stays) continue;
        if (begin < x)
            sqlite3_str_appendf(
                sql, "INSERT INTO main.rqt_fill_%lld(row, col0, col1, kind) VALUES(%lld,%lld,%lld,%lld);", a->id,
                r->row, begin, x - 1, r->kind);
        same = same && x > r->last;
        begin = x + 1;
    }
    char *text = sqlite3_str_finish(sql);
    if (same) {
        sqlite3_free(text);
        return SQLITE_OK;
    }
    *cut = true;
    return run(a->db, text, "writing what was filled", error);
}

int store_amend_filled(store_amender *a, int32_t col, int32_t row, int32_t width, int32_t height,
                       const uint8_t *state, char **error) {
    const int32_t window[4] = {row, row + height - 1, col, col + width - 1};
    filled_run *runs = NULL;
    size_t count = 0;
    bool cut = false;
    if (!has_filled(a)) return SQLITE_OK;
    int code = find_filled(a, window, &runs, &count, error);
    for (size_t i = 0; i < count && code == SQLITE_OK; i++)
        code = cut_run(a, &runs[i], col, row, width, state, &cut, error);
    sqlite3_free(runs);
    if (code != SQLITE_OK || !cut) return code;
    /* By id they run from north to south and from west to east. */
    return run(
        a->db,
        sqlite3_mprintf("UPDATE main.rqt_fill_%lld AS f SET id = -o.n FROM (SELECT id, row_number() OVER (ORDER BY "
                        "row, col0) AS n FROM main.rqt_fill_%lld) AS o WHERE o.id = f.id; "
                        "UPDATE main.rqt_fill_%lld SET id = -id;",
                        a->id, a->id, a->id),
        "writing what was filled", error);
}

int store_drop_minimal(sqlite3 *db, int64_t id, char **error) {
    const int code = run(db,
                         sqlite3_mprintf("DROP TABLE main.rqt_index_%lld%s; DROP TABLE main.rqt_block_%lld%s", id,
                                         STORE_MINIMAL, id, STORE_MINIMAL),
                         "replacing minimal errors", error);
    if (code != SQLITE_OK || !has_contents(db)) return code;
    return run(
        db,
        sqlite3_mprintf("DELETE FROM main.gpkg_contents WHERE table_name = 'rqt_block_%lld%s'", id, STORE_MINIMAL),
        "replacing minimal errors", error);
}
