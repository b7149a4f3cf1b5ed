/* writer.c - one terrain into a database: its row, its tables, its blocks, and its place in a GeoPackage.
 *
 * The caller owns the transaction, so that nothing is ever half there: the row says complete = 0 until the last
 * call, and a crash before the commit leaves the database as it was.
 */
#include "internal.h"

#include "schema_sql.h"

#include <string.h>

struct store_writer {
    sqlite3 *db;
    int64_t id;
    const char *suffix; /* of the tables' names */
    int k;
    rqt_lattice lattice;
    int64_t blocks, bytes;
    sqlite3_stmt *put_block, *put_index, *put_fill; /* the last from the first run on */
};

/* Several statements, one after the other. */
static int run(sqlite3 *db, const char *sql, char **error, const char *doing) {
    const int code = sqlite3_exec(db, sql, NULL, NULL, NULL);
    return code == SQLITE_OK ? SQLITE_OK : store_fail_db(error, db, code, doing);
}

/* sql with every {N} replaced by the terrain's id and suffix. */
static char *with_id(const char *sql, int64_t id, const char *suffix) {
    sqlite3_str *out = sqlite3_str_new(NULL);
    for (const char *hole; (hole = strstr(sql, "{N}")) != NULL; sql = hole + 3)
        sqlite3_str_appendf(out, "%.*s%lld%s", (int)(hole - sql), sql, id, suffix);
    sqlite3_str_appendall(out, sql);
    return sqlite3_str_finish(out);
}

static bool has_table(sqlite3 *db, const char *name) {
    return sqlite3_table_column_metadata(db, "main", name, NULL, NULL, NULL, NULL, NULL, NULL) == SQLITE_OK;
}

int store_make_geopackage(sqlite3 *db, char **error) {
    sqlite3_stmt *s = NULL;
    int code = sqlite3_prepare_v2(db, "SELECT count(*) FROM main.sqlite_schema", -1, &s, NULL);
    if (code != SQLITE_OK) return store_fail_db(error, db, code, "reading the database");
    const bool empty = sqlite3_step(s) == SQLITE_ROW && sqlite3_column_int64(s, 0) == 0;
    code = sqlite3_finalize(s);
    if (code != SQLITE_OK) return store_fail_db(error, db, code, "reading the database");
    return empty ? run(db, sql_geopackage, error, "making a GeoPackage") : SQLITE_OK;
}

/* A table of ours in gpkg_contents: GIS hosts then list it as a table without geometry, and leave the others alone.
 */
static int register_attributes(sqlite3 *db, const char *table, const char *identifier, const char *description,
                               char **error) {
    if (!has_table(db, "gpkg_contents")) return SQLITE_OK;
    char *sql =
        sqlite3_mprintf("INSERT OR REPLACE INTO main.gpkg_contents(table_name, data_type, identifier, description) "
                        "VALUES(%Q, 'attributes', %Q, %Q)",
                        table, identifier, description);
    if (!sql) return SQLITE_NOMEM;
    const int code = run(db, sql, error, "registering the terrain in the GeoPackage");
    sqlite3_free(sql);
    return code;
}

static int drop_terrain(sqlite3 *db, int64_t id, char **error) {
    char *sql =
        sqlite3_mprintf("DROP TABLE IF EXISTS main.rqt_index_%lld; DROP TABLE IF EXISTS main.rqt_block_%lld; "
                        "DROP TABLE IF EXISTS main.rqt_index_%lld%s; DROP TABLE IF EXISTS main.rqt_block_%lld%s; "
                        "DROP TABLE IF EXISTS main.rqt_fill_%lld; DELETE FROM main.rqt_terrain WHERE id = %lld;",
                        id, id, id, STORE_MINIMAL, id, STORE_MINIMAL, id, id);
    char *contents = has_table(db, "gpkg_contents")
                         ? sqlite3_mprintf("DELETE FROM main.gpkg_contents WHERE table_name IN "
                                           "('rqt_block_%lld', 'rqt_block_%lld%s', 'rqt_fill_%lld')",
                                           id, id, STORE_MINIMAL, id)
                         : sqlite3_mprintf("");
    int code = sql && contents ? run(db, sql, error, "replacing a terrain") : SQLITE_NOMEM;
    if (code == SQLITE_OK) code = run(db, contents, error, "replacing a terrain");
    sqlite3_free(sql);
    sqlite3_free(contents);
    return code;
}

/* The id of the terrain of this name, 0 when there is none. */
static int find_id(sqlite3 *db, const char *name, int64_t *id, char **error) {
    sqlite3_stmt *s = NULL;
    *id = 0;
    int code = sqlite3_prepare_v2(db, "SELECT id FROM main.rqt_terrain WHERE name = ?1", -1, &s, NULL);
    if (code != SQLITE_OK) return store_fail_db(error, db, code, "looking for the terrain");
    sqlite3_bind_text(s, 1, name, -1, SQLITE_STATIC);
    if (sqlite3_step(s) == SQLITE_ROW) *id = sqlite3_column_int64(s, 0);
    code = sqlite3_finalize(s);
    return code == SQLITE_OK ? SQLITE_OK : store_fail_db(error, db, code, "looking for the terrain");
}

static int prepare(store_writer *w, sqlite3_stmt **out, const char *format, char **error) {
    char *sql = sqlite3_mprintf(format, w->id, w->suffix);
    if (!sql) return SQLITE_NOMEM;
    const int code = sqlite3_prepare_v3(w->db, sql, -1, SQLITE_PREPARE_PERSISTENT, out, NULL);
    sqlite3_free(sql);
    return code == SQLITE_OK ? SQLITE_OK : store_fail_db(error, w->db, code, "preparing to write blocks");
}

/* The two tables, and the statements that fill them. */
static int create_tables(store_writer *w, const store_terrain *info, const char *what, char **error) {
    char *sql = with_id(sql_terrain, w->id, w->suffix);
    int code = sql ? run(w->db, sql, error, "creating the terrain's tables") : SQLITE_NOMEM;
    sqlite3_free(sql);
    if (code == SQLITE_OK) {
        char *table = sqlite3_mprintf("rqt_block_%lld%s", w->id, w->suffix);
        char *about = sqlite3_mprintf("rqt: %s of terrain %s, %d x %d samples", what, info->name,
                                      info->lattice.width, info->lattice.height);
        code = table && about ? register_attributes(w->db, table, table, about, error) : SQLITE_NOMEM;
        sqlite3_free(table);
        sqlite3_free(about);
    }
    if (code == SQLITE_OK)
        code = prepare(w, &w->put_block, "INSERT INTO main.rqt_block_%lld%s(id, summary, data) VALUES(?1, ?2, ?3)",
                       error);
    if (code == SQLITE_OK)
        code = prepare(w, &w->put_index, "INSERT INTO main.rqt_index_%lld%s VALUES(?1,?2,?3,?4,?5,?6,?7,?8,?9)",
                       error);
    return code;
}

static int begin(store_writer *w, const store_terrain *info, bool replace, char **error) {
    if (!store_name_is_valid(info->name))
        return store_fail(error, SQLITE_ERROR, "%s is no name for a terrain: use 1 to 63 of A-Z a-z 0-9 _ . -",
                          info->name);
    int code = run(w->db, sql_schema, error, "creating rqt_terrain");
    if (code == SQLITE_OK)
        code = register_attributes(w->db, "rqt_terrain", "rqt_terrain", "rqt: one row per terrain", error);
    int64_t old = 0;
    if (code == SQLITE_OK) code = find_id(w->db, info->name, &old, error);
    if (code != SQLITE_OK) return code;
    if (old && !replace)
        return store_fail(error, SQLITE_ERROR, "terrain %s exists already; use --replace to replace it",
                          info->name);
    if (old) code = drop_terrain(w->db, old, error);
    if (code == SQLITE_OK) code = store_insert_terrain(w->db, info, &w->id, error);
    if (code != SQLITE_OK) return code;
    return create_tables(w, info, "blocks", error);
}

int store_writer_begin(sqlite3 *db, const store_terrain *info, bool replace, store_writer **writer, char **error) {
    *writer = NULL;
    store_writer *w = sqlite3_malloc(sizeof *w);
    if (!w) return SQLITE_NOMEM;
    *w = (store_writer){.db = db, .suffix = "", .k = info->k, .lattice = info->lattice};
    const int code = begin(w, info, replace, error);
    if (code != SQLITE_OK)
        store_writer_free(w);
    else
        *writer = w;
    return code;
}

int store_writer_beside(sqlite3 *db, const store_terrain *t, store_writer **writer, char **error) {
    *writer = NULL;
    store_writer *w = sqlite3_malloc(sizeof *w);
    if (!w) return SQLITE_NOMEM;
    *w = (store_writer){.db = db, .id = t->id, .suffix = STORE_MINIMAL, .k = t->k, .lattice = t->lattice};
    const int code = create_tables(w, t, "blocks with minimal errors", error);
    if (code != SQLITE_OK)
        store_writer_free(w);
    else
        *writer = w;
    return code;
}

/* Does it answer anything? */
static bool put_interval(sqlite3_stmt *s, int at, rqt_interval interval) {
    const bool answers = interval.em < interval.em_parent;
    sqlite3_bind_int(s, at, answers ? interval.em : STORE_NEVER);
    sqlite3_bind_int(s, at + 1, answers ? interval.em_parent - 1 : STORE_NEVER);
    return answers;
}

bool store_bind_index(sqlite3_stmt *s, const rqt_lattice *lattice, const rqt_block_place *place,
                      rqt_block_number number, const rqt_summary *summary) {
    const int32_t last_x = lattice->width - 1, last_y = lattice->height - 1;
    sqlite3_bind_int64(s, 1, (sqlite3_int64)number);
    sqlite3_bind_int(s, 2, place->x);
    sqlite3_bind_int(s, 3, place->x + place->side < last_x ? place->x + place->side : last_x);
    sqlite3_bind_int(s, 4, place->y);
    sqlite3_bind_int(s, 5, place->y + place->side < last_y ? place->y + place->side : last_y);
    const bool tol = put_interval(s, 6, summary->tol), exact = put_interval(s, 8, summary->exact);
    return tol || exact;
}

int store_writer_block(store_writer *w, rqt_block_number number, const rqt_summary *summary, const uint8_t *bytes,
                       size_t size, char **error) {
    rqt_block_place place;
    if (rqt_block_locate(&w->lattice, w->k, number, &place) != RQT_OK)
        return store_fail(error, SQLITE_ERROR, "block %llu is not of this terrain", number);
    uint8_t encoded[RQT_SUMMARY_BYTES];
    rqt_summary_encode(summary, encoded);
    sqlite3_stmt *s = w->put_block;
    sqlite3_bind_int64(s, 1, (sqlite3_int64)number);
    sqlite3_bind_blob(s, 2, encoded, sizeof encoded, SQLITE_STATIC);
    sqlite3_bind_blob64(s, 3, bytes, size, SQLITE_STATIC);
    sqlite3_step(s);
    int code = sqlite3_reset(s);
    sqlite3_clear_bindings(s);
    if (code != SQLITE_OK) return store_fail_db(error, w->db, code, "writing a block");
    w->blocks++;
    w->bytes += (int64_t)size + RQT_SUMMARY_BYTES;

    s = w->put_index;
    if (!store_bind_index(s, &w->lattice, &place, number, summary)) return SQLITE_OK;
    sqlite3_step(s);
    code = sqlite3_reset(s);
    return code == SQLITE_OK ? SQLITE_OK : store_fail_db(error, w->db, code, "writing the index");
}

/* Its table, when there is something to write into it. */
static int begin_fill(store_writer *w, char **error) {
    char *sql = with_id(sql_fill, w->id, ""), *table = sqlite3_mprintf("rqt_fill_%lld", w->id);
    int code = sql && table ? run(w->db, sql, error, "creating the table of filled samples") : SQLITE_NOMEM;
    if (code == SQLITE_OK) code = register_attributes(w->db, table, table, "rqt: samples that were no data", error);
    if (code == SQLITE_OK)
        code = prepare(w, &w->put_fill,
                       "INSERT INTO main.rqt_fill_%lld%s(row, col0, col1, kind) VALUES(?1, ?2, ?3, ?4)", error);
    sqlite3_free(sql);
    sqlite3_free(table);
    return code;
}

int store_writer_fill(store_writer *w, int32_t row, int32_t first, int32_t last, int kind, char **error) {
    int code = w->put_fill ? SQLITE_OK : begin_fill(w, error);
    if (code != SQLITE_OK) return code;
    sqlite3_bind_int(w->put_fill, 1, row);
    sqlite3_bind_int(w->put_fill, 2, first);
    sqlite3_bind_int(w->put_fill, 3, last);
    sqlite3_bind_int(w->put_fill, 4, kind);
    sqlite3_step(w->put_fill);
    code = sqlite3_reset(w->put_fill);
    return code == SQLITE_OK ? SQLITE_OK : store_fail_db(error, w->db, code, "writing what was filled");
}

int store_writer_finish(store_writer *w, rqt_code max_error, char **error) {
    char *sql =
        sqlite3_mprintf("UPDATE main.rqt_terrain SET complete = 1, blocks = %lld, bytes = %lld, max_error = %d "
                        "WHERE id = %lld",
                        w->blocks, w->bytes, max_error, w->id);
    if (!sql) return SQLITE_NOMEM;
    const int code = run(w->db, sql, error, "completing the terrain");
    sqlite3_free(sql);
    return code;
}

void store_writer_free(store_writer *w) {
    if (!w) return;
    sqlite3_finalize(w->put_block);
    sqlite3_finalize(w->put_index);
    sqlite3_finalize(w->put_fill);
    sqlite3_free(w);
}
