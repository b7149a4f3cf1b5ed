/* digest.c - a number for what is stored of a terrain, by which two states of it are told apart wherever the file
 * is and whatever its time: a checkpoint of the log, VACUUM, a copy of the file, or another terrain beside it
 * change nothing.
 *
 * Of a block its number, its summary, its size and the header of its bytes, which holds a checksum over all of them
 * (FORMAT.md): so one page a block is read, and not the whole; bytes that their checksum does not fit are for
 * whoever decodes them to see. Columns of the terrain's row and the runs of what was filled go in as they are. The
 * index does not: it is made of what the summaries say.
 */
#include "internal.h"

#include <string.h>

enum { HEADER_BYTES = 40 }; /* of a block */

static uint64_t mix(uint64_t h, const void *bytes, size_t size) {
    const uint8_t *p = bytes;
    h = (h ^ size) * UINT64_C(0xC2B2AE3D27D4EB4F);
    for (size_t i = 0; i < size; i++) h = (h ^ p[i]) * UINT64_C(0x100000001B3);
    return h ^ h >> 32;
}

/* All columns of all rows of a statement, which is released; NULL is out of memory. */
static int mix_rows(store *s, char *sql, uint64_t *h, char **error) {
    sqlite3_stmt *rows = NULL;
    int code = sql ? sqlite3_prepare_v2(s->db, sql, -1, &rows, NULL) : SQLITE_NOMEM;
    sqlite3_free(sql);
    while (code == SQLITE_OK && (code = sqlite3_step(rows)) == SQLITE_ROW) {
        code = SQLITE_OK;
        for (int i = 0; i < sqlite3_column_count(rows); i++) {
            const int type = sqlite3_column_type(rows, i);
            const int64_t n = type == SQLITE_INTEGER ? sqlite3_column_int64(rows, i) : 0;
            const double x = type == SQLITE_FLOAT ? sqlite3_column_double(rows, i) : 0;
            const void *bytes = type == SQLITE_INTEGER ? &n : type == SQLITE_FLOAT ? (const void *)&x : NULL;
            if (!bytes) bytes = sqlite3_column_blob(rows, i); /* of a text its bytes */
            *h = mix(*h, &type, sizeof type);
            *h = mix(*h, bytes, bytes == &n || bytes == &x ? sizeof n : (size_t)sqlite3_column_bytes(rows, i));
        }
    }
    sqlite3_finalize(rows);
    return code == SQLITE_DONE || code == SQLITE_NOMEM ? code : store_fail_db(error, s->db, code, "reading");
}

/* The header of one block after the other through one handle, *blob, which is opened first. */
static int mix_block(store *s, const store_terrain *t, const char *table, int64_t number, sqlite3_blob **blob,
                     uint64_t *h) {
    uint8_t header[HEADER_BYTES];
    int code = *blob ? sqlite3_blob_reopen(*blob, number)
                     : sqlite3_blob_open(s->db, t->schema, table, "data", number, 0, blob);
    if (code != SQLITE_OK) return code;
    const int size = sqlite3_blob_bytes(*blob), n = size < HEADER_BYTES ? size : HEADER_BYTES;
    code = sqlite3_blob_read(*blob, header, n, 0);
    if (code == SQLITE_OK) *h = mix(mix(*h, &size, sizeof size), header, (size_t)n);
    return code;
}

static int mix_blocks(store *s, const store_terrain *t, uint64_t *h, char **error) {
    char table[64];
    sqlite3_stmt *rows = NULL;
    sqlite3_blob *blob = NULL;
    int64_t spoiled = 0;
    sqlite3_snprintf(sizeof table, table, "rqt_block_%lld", t->id);
    char *sql = sqlite3_mprintf("SELECT id, summary FROM \"%w\".%s ORDER BY id", t->schema, table);
    int code = sql ? sqlite3_prepare_v2(s->db, sql, -1, &rows, NULL) : SQLITE_NOMEM;
    sqlite3_free(sql);
    while (code == SQLITE_OK && (code = sqlite3_step(rows)) == SQLITE_ROW) {
        const int64_t number = sqlite3_column_int64(rows, 0);
        const void *summary = sqlite3_column_blob(rows, 1);
        *h = mix(mix(*h, &number, sizeof number), summary, (size_t)sqlite3_column_bytes(rows, 1));
        code = mix_block(s, t, table, number, &blob, h);
        if (code == SQLITE_ERROR) spoiled = number; /* not even bytes */
    }
    if (spoiled)
        code = store_fail(error, SQLITE_CORRUPT_VTAB, "terrain %s is damaged: block %lld", t->name, spoiled);
    else if (code != SQLITE_DONE && code != SQLITE_NOMEM)
        code = store_fail_db(error, s->db, code, "reading the blocks");
    sqlite3_blob_close(blob);
    sqlite3_finalize(rows);
    return code;
}

int store_digest(store *s, const store_terrain *t, uint64_t *digest, char **error) {
    uint64_t h = UINT64_C(0xCBF29CE484222325);
    int code = store_begin_on(s, t, error);
    if (code != SQLITE_OK) return code;
    code = mix_rows(s, sqlite3_mprintf("SELECT * FROM \"%w\".rqt_terrain WHERE id = %lld", t->schema, t->id), &h,
                    error);
    if (code == SQLITE_DONE && store_has_fill(s->db, t))
        code = mix_rows(s, sqlite3_mprintf("SELECT * FROM \"%w\".rqt_fill_%lld ORDER BY id", t->schema, t->id), &h,
                        error);
    if (code == SQLITE_DONE) code = mix_blocks(s, t, &h, error);
    store_end(s);
    *digest = h;
    return code == SQLITE_DONE ? SQLITE_OK : code;
}
