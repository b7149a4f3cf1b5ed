/* block_functions.c - looking into one block's bytes: rqt_block_info (header), _check (everything), _dump (text).
 */
#include "functions.h"

#include <string.h>

/* The BLOB of the only argument; false when it has been answered (NULL, or no BLOB). */
static bool take_blob(sqlite3_context *result, const char *name, sqlite3_value *value, const uint8_t **bytes,
                      size_t *size) {
    if (sqlite3_value_type(value) == SQLITE_NULL) return false;
    if (sqlite3_value_type(value) != SQLITE_BLOB) {
        char *error = NULL;
        const int code = fail(&error, "blob must be a BLOB: the data column of a block table");
        scalar_error(result, name, code, error);
        return false;
    }
    *bytes = sqlite3_value_blob(value);
    *size = (size_t)sqlite3_value_bytes(value);
    if (!*bytes) *bytes = (const uint8_t *)"";
    return true;
}

static void result_text(sqlite3_context *result, sqlite3_str *text) {
    char *out = sqlite3_str_finish(text);
    if (out)
        sqlite3_result_text(result, out, -1, sqlite3_free);
    else
        sqlite3_result_error_nomem(result);
}

static void append_header(sqlite3_str *out, const rqt_block_header *h, size_t size) {
    sqlite3_str_appendf(
        out,
        "{\"version\":%d,\"k\":%d,\"width\":%d,\"height\":%d,\"voids\":\"%s\",\"outline\":%s,\"sparse\":%s,"
        "\"floor\":%d,\"ground\":%d,\"kept\":%lld,\"height_planes\":%d,\"finest_planes\":%d,\"error_planes\":%d,"
        "\"quantum\":%!.17g,\"payload\":%lld,\"bytes\":%lld}",
        h->version, h->k, h->width, h->height, h->all_void ? "all" : (h->has_voids ? "some" : "none"),
        h->has_outline ? "true" : "false", h->sparse ? "true" : "false", h->floor, h->ground,
        (sqlite3_int64)(h->sparse ? h->kept : (size_t)((1 << h->k) + 1) * (size_t)((1 << h->k) + 1)),
        h->height_planes, h->finest_planes, h->error_planes, h->quantum, (sqlite3_int64)h->payload,
        (sqlite3_int64)size);
}

void call_block_info(sqlite3_context *result, int count, sqlite3_value **arguments) {
    (void)count;
    const uint8_t *bytes;
    size_t size;
    if (!take_blob(result, "rqt_block_info", arguments[0], &bytes, &size)) return;
    rqt_block_header header;
    rqt_message why = {""};
    if (rqt_block_info(bytes, size, &header, &why) != RQT_OK) {
        scalar_error(result, "rqt_block_info", SQLITE_ERROR, sqlite3_mprintf("%s", why.text));
        return;
    }
    sqlite3_str *out = sqlite3_str_new(NULL);
    append_header(out, &header, size);
    result_text(result, out);
}

void call_block_check(sqlite3_context *result, int count, sqlite3_value **arguments) {
    (void)count;
    const uint8_t *bytes;
    size_t size;
    if (!take_blob(result, "rqt_block_check", arguments[0], &bytes, &size)) return;
    rqt_codec *codec;
    rqt_message why = {""};
    rqt_status status = rqt_codec_create(store_allocator(), &codec);
    if (status == RQT_OK) status = rqt_block_check(codec, bytes, size, &why);
    rqt_codec_free(codec);
    if (status == RQT_NO_MEMORY)
        sqlite3_result_error_nomem(result);
    else
        sqlite3_result_text(result, status == RQT_OK ? "ok" : why.text, -1, SQLITE_TRANSIENT);
}

/* Is anything stored of vertex i? */
static bool is_kept(const rqt_block *b, size_t i) {
    const size_t n = ((size_t)1 << b->k) + 1, last = n - 1;
    return !b->sparse || b->error[i] > b->floor || b->flags[i] & RQT_OUTLINE ||
           (i % n % last == 0 && i / n % last == 0);
}

static void append_grid(sqlite3_str *out, const char *title, const rqt_block *b, int what) {
    const int n = (1 << b->k) + 1;
    sqlite3_str_appendf(out, "%s\n", title);
    for (int v = 0; v < n; v++) {
        for (int u = 0; u < n; u++) {
            const size_t i = (size_t)v * (size_t)n + (size_t)u;
            const char *gap = u ? " " : "";
            if (!is_kept(b, i))
                sqlite3_str_appendf(out, "%s.", gap);
            else if (what == 0 && !(b->flags[i] & RQT_VALID))
                sqlite3_str_appendf(out, "%s-", gap);
            else if (what == 1 && b->error[i] == RQT_CODE_INFINITY)
                sqlite3_str_appendf(out, "%sinf", gap);
            else
                sqlite3_str_appendf(out, "%s%d", gap,
                                    what == 0   ? b->q[i]
                                    : what == 1 ? b->error[i]
                                                : !!(b->flags[i] & RQT_OUTLINE));
        }
        sqlite3_str_appendall(out, "\n");
    }
}

void call_block_dump(sqlite3_context *result, int count, sqlite3_value **arguments) {
    (void)count;
    const uint8_t *bytes;
    size_t size;
    if (!take_blob(result, "rqt_block_dump", arguments[0], &bytes, &size)) return;
    rqt_block_header header;
    rqt_message why = {""};
    rqt_block block = {0};
    rqt_codec *codec = NULL;
    rqt_status status = rqt_block_info(bytes, size, &header, &why);
    if (status == RQT_OK) status = rqt_block_create(header.k, store_allocator(), &block);
    if (status == RQT_OK) status = rqt_codec_create(store_allocator(), &codec);
    if (status == RQT_OK && (status = rqt_block_decode(codec, bytes, size, &block)) == RQT_CORRUPT)
        (void)rqt_block_check(codec, bytes, size, &why);
    if (status == RQT_OK) {
        sqlite3_str *out = sqlite3_str_new(NULL);
        append_header(out, &header, size);
        append_grid(out, "\nheights in quanta, - is void, . is not kept", &block, 0);
        append_grid(out, "error codes; those of the corners are in the summary", &block, 1);
        if (header.has_outline) append_grid(out, "outline bits", &block, 2);
        result_text(result, out);
    } else if (status == RQT_NO_MEMORY) {
        sqlite3_result_error_nomem(result);
    } else {
        scalar_error(result, "rqt_block_dump", SQLITE_ERROR, sqlite3_mprintf("%s", why.text));
    }
    rqt_codec_free(codec);
    rqt_block_free(&block, store_allocator());
}
