/* blocks.c - blocks by number: their bytes, decoded through the cache, and windows of full-resolution samples.
 * Bytes are hostile: what does not decode, or does not fit its place in the terrain, is an error that names the
 * block.
 */
#include "internal.h"

#include <string.h>

int store_block_bytes(store *s, const store_terrain *t, rqt_block_number number, const uint8_t **bytes, int *size,
                      char **error) {
    sqlite3_stmt **kept = &store_statements(s, t)->bytes;
    *bytes = NULL;
    *size = 0;
    if (!*kept) {
        const int code =
            store_prepare(s, t, kept,
                          sqlite3_mprintf("SELECT data, summary FROM \"%w\".rqt_block_%lld%s WHERE id = ?1",
                                          t->schema, t->id, t->suffix),
                          error);
        if (code != SQLITE_OK) return code;
    }
    sqlite3_reset(*kept);
    sqlite3_bind_int64(*kept, 1, (sqlite3_int64)number);
    const int code = sqlite3_step(*kept);
    if (code == SQLITE_ROW) {
        *bytes = sqlite3_column_blob(*kept, 0);
        *size = sqlite3_column_bytes(*kept, 0);
        return *bytes || *size == 0 ? SQLITE_OK : SQLITE_NOMEM;
    }
    if (code != SQLITE_DONE) {
        sqlite3_reset(*kept);
        return store_fail_db(error, s->db, code, "reading a block");
    }
    sqlite3_reset(*kept);
    return store_fail(error, SQLITE_CORRUPT_VTAB, "terrain %s is damaged: block %llu is missing", t->name, number);
}

static kept_summary *place_of(store *s, uint64_t key, rqt_block_number number) {
    return &s->summaries[(number ^ key * 2654435761U) % SUMMARY_PLACES];
}

void store_forget_block(store *s, const store_terrain *t, rqt_block_number number) {
    const uint64_t key = (uint64_t)(t - s->terrains);
    block_cache_forget(s->cache, key, number);
    if (s->summaries) place_of(s, key, number)->terrain = 0;
}

int store_get_summary(store *s, const store_terrain *t, rqt_block_number number, const rqt_summary **summary,
                      char **error) {
    const uint64_t key = (uint64_t)(t - s->terrains);
    *summary = NULL;
    if (!s->summaries) {
        const sqlite3_uint64 bytes = SUMMARY_PLACES * sizeof *s->summaries;
        s->summaries = sqlite3_malloc64(bytes);
        if (!s->summaries) return SQLITE_NOMEM;
        memset(s->summaries, 0, bytes);
    }
    kept_summary *kept = place_of(s, key, number);
    if (kept->terrain == key + 1 && kept->number == number) {
        *summary = &kept->summary;
        return SQLITE_OK;
    }
    sqlite3_stmt **row = &store_statements(s, t)->summary;
    int code = SQLITE_OK;
    if (!*row)
        code = store_prepare(s, t, row,
                             sqlite3_mprintf("SELECT summary FROM \"%w\".rqt_block_%lld%s WHERE id = ?1", t->schema,
                                             t->id, t->suffix),
                             error);
    if (code != SQLITE_OK) return code;
    sqlite3_bind_int64(*row, 1, (sqlite3_int64)number);
    code = sqlite3_step(*row);
    if (code == SQLITE_ROW) {
        const void *bytes = sqlite3_column_blob(*row, 0);
        const int size = sqlite3_column_bytes(*row, 0);
        kept->terrain = 0;
        if (bytes && rqt_summary_decode(bytes, (size_t)size, &kept->summary) == RQT_OK) {
            kept->terrain = key + 1;
            kept->number = number;
            *summary = &kept->summary;
            s->has_summaries = true;
            code = SQLITE_OK;
        } else {
            code = store_fail(error, SQLITE_CORRUPT_VTAB, "terrain %s is damaged: the summary of block %llu",
                              t->name, number);
        }
    } else if (code == SQLITE_DONE) {
        code =
            store_fail(error, SQLITE_CORRUPT_VTAB, "terrain %s is damaged: block %llu is missing", t->name, number);
    } else {
        code = store_fail_db(error, s->db, code, "reading a block");
    }
    sqlite3_reset(*row);
    return code;
}

/* What the block at hand in the statement lacks, out of its summary. */
static rqt_status set_corners(sqlite3_stmt *row, rqt_block *block) {
    rqt_summary summary;
    const void *bytes = sqlite3_column_blob(row, 1);
    const rqt_status status =
        bytes ? rqt_summary_decode(bytes, (size_t)sqlite3_column_bytes(row, 1), &summary) : RQT_CORRUPT;
    if (status == RQT_OK) rqt_block_set_corners(block, &summary);
    return status;
}

int store_get_block(store *s, const store_terrain *t, rqt_block_number number, const rqt_block **block, int *read,
                    char **error) {
    const uint64_t key = (uint64_t)(t - s->terrains);
    *read = 0;
    *block = block_cache_find(s->cache, key, number);
    if (*block) return SQLITE_OK;
    const uint8_t *bytes;
    int size;
    int code = store_block_bytes(s, t, number, &bytes, &size, error);
    if (code != SQLITE_OK) return code;
    rqt_block_header header;
    rqt_message why = {""};
    rqt_block_place place;
    rqt_block *fresh = NULL;
    if (rqt_block_info(bytes, (size_t)size, &header, &why) != RQT_OK) {
        code = store_fail(error, SQLITE_CORRUPT_VTAB, "terrain %s is damaged: block %llu: %s", t->name, number,
                          why.text);
    } else if (rqt_block_locate(&t->lattice, t->k, number, &place) != RQT_OK || header.k != t->k ||
               header.width != place.width || header.height != place.height) {
        code = store_fail(error, SQLITE_CORRUPT_VTAB, "terrain %s is damaged: block %llu does not fit its place",
                          t->name, number);
    } else {
        fresh = block_cache_add(s->cache, key, number, t->k);
        const rqt_status status = fresh ? rqt_block_decode(s->codec, bytes, (size_t)size, fresh) : RQT_NO_MEMORY;
        if (status == RQT_NO_MEMORY)
            code = SQLITE_NOMEM;
        else if (status != RQT_OK)
            code = store_fail(error, SQLITE_CORRUPT_VTAB,
                              "terrain %s is damaged: block %llu: its bytes do not decode", t->name, number);
        else if (set_corners(store_statements(s, t)->bytes, fresh) != RQT_OK)
            code = store_fail(error, SQLITE_CORRUPT_VTAB, "terrain %s is damaged: the summary of block %llu",
                              t->name, number);
        if (code != SQLITE_OK && fresh) block_cache_forget(s->cache, key, number);
    }
    sqlite3_reset(store_statements(s, t)->bytes);
    if (code == SQLITE_OK) {
        *block = fresh;
        *read = size;
    }
    return code;
}

int store_read_block(store *s, const store_terrain *t, rqt_block_number number, const rqt_block **block,
                     char **error) {
    int read;
    return store_get_block(s, t, number, block, &read, error);
}

static int window(store *s, const store_terrain *t, int32_t col, int32_t row, int32_t width, int32_t height,
                  int32_t *q, uint8_t *valid, char **error) {
    if (col < 0 || row < 0 || width < 1 || height < 1 || col > t->lattice.width - width ||
        row > t->lattice.height - height)
        return store_fail(error, SQLITE_ERROR, "a window outside the raster");
    const int shift = t->k, level = t->lattice.K - t->k;
    const int32_t n = (1 << shift) + 1;
    /* Blocks share borders: take each sample from the block it begins, the last column and row from the last one.
     */
    const int32_t last_i = t->lattice.width > 1 ? (t->lattice.width - 2) >> shift : 0;
    const int32_t last_j = t->lattice.height > 1 ? (t->lattice.height - 2) >> shift : 0;
    const int32_t first_i = col >> shift < last_i ? col >> shift : last_i,
                  first_j = row >> shift < last_j ? row >> shift : last_j;
    for (int32_t j = first_j; j <= last_j && j << shift < row + height; j++) {
        for (int32_t i = first_i; i <= last_i && i << shift < col + width; i++) {
            const rqt_block *block;
            int read;
            const int code = store_get_block(s, t, rqt_block_number_of(level, i, j), &block, &read, error);
            if (code != SQLITE_OK) return code;
            const int32_t x0 = i << shift, y0 = j << shift; /* of the block; then what it has of the window */
            const int32_t west = x0 > col ? x0 : col, east = x0 + n < col + width ? x0 + n : col + width;
            const int32_t north = y0 > row ? y0 : row, south = y0 + n < row + height ? y0 + n : row + height;
            for (int32_t y = north; y < south; y++) {
                const size_t to = (size_t)(y - row) * (size_t)width + (size_t)(west - col);
                const size_t from = (size_t)(y - y0) * (size_t)n + (size_t)(west - x0);
                for (size_t u = 0; u < (size_t)(east - west); u++) {
                    /* NOLINTNEXTLINE(clang-analyzer-core.NullDereference): a block, or a code */
                    q[to + u] = block->q[from + u];
                    valid[to + u] = block->flags[from + u] & RQT_VALID;
                }
            }
        }
    }
    return SQLITE_OK;
}

int store_window(store *s, const store_terrain *t, int32_t col, int32_t row, int32_t width, int32_t height,
                 int32_t *q, uint8_t *valid, char **error) {
    int code = store_begin_on(s, t, error);
    if (code != SQLITE_OK) return code;
    code = window(s, t, col, row, width, height, q, valid, error);
    store_end(s);
    return code;
}
