/* minimal.c - minimal errors that are stored: a second pyramid of blocks beside a terrain's own.
 *
 * s is closed, as e_sat is, so blocks, summaries and index intervals are made of it in the same way, and a query by
 * metric minimal is a query over other tables: it reads what it answers and no more. The heights are there twice.
 * The errors are those of the outline `exact`; where there are no voids they are those of `tol` too.
 *
 * The check computes everything anew from the terrain's heights and compares what decodes, not bytes: another
 * version of the compressor may say the same in other words.
 */
#include "internal.h"

#include <string.h>

static bool has_table(sqlite3 *db, const store_terrain *t) {
    char table[64];
    sqlite3_snprintf(sizeof table, table, "rqt_block_%lld%s", t->id, STORE_MINIMAL);
    return sqlite3_table_column_metadata(db, t->schema, table, "data", NULL, NULL, NULL, NULL, NULL) == SQLITE_OK;
}

const store_terrain *store_minimal(store *s, const store_terrain *t) {
    const int n = (int)(t - s->terrains);
    return n < s->count && has_table(s->db, t) ? &s->terrains[s->count + n] : NULL;
}

/* ----------------------------------------------------------------------------------------------- writing */

/* What one block takes on its way. */
typedef struct workshop {
    rqt_codec *codec;
    rqt_block block, other;
    uint8_t *bytes;
    size_t size;
} workshop;

static int workshop_create(workshop *w, int k) {
    memset(w, 0, sizeof *w);
    w->bytes = sqlite3_malloc64(rqt_block_bound(k));
    return w->bytes && rqt_codec_create(store_allocator(), &w->codec) == RQT_OK &&
                   rqt_block_create(k, store_allocator(), &w->block) == RQT_OK &&
                   rqt_block_create(k, store_allocator(), &w->other) == RQT_OK
               ? SQLITE_OK
               : SQLITE_NOMEM;
}

static void workshop_free(workshop *w) {
    rqt_block_free(&w->block, store_allocator());
    rqt_block_free(&w->other, store_allocator());
    rqt_codec_free(w->codec);
    sqlite3_free(w->bytes);
}

static int write_all(sqlite3 *db, const store_terrain *t, const rqt_pyramid *pyramid, workshop *w,
                     bool (*progress)(void *context, double done), void *context, char **error) {
    store_writer *writer;
    int code = store_writer_beside(db, t, &writer, error);
    const size_t count = rqt_pyramid_count(pyramid);
    for (size_t n = 0; n < count && code == SQLITE_OK; n++) {
        rqt_block_number number;
        rqt_summary summary;
        rqt_pyramid_block(pyramid, n, &number, &summary, &w->block);
        code = store_fail_core(error, rqt_block_encode(w->codec, &w->block, store_quantum(t), w->bytes, &w->size),
                               "encoding a block");
        if (code == SQLITE_OK) code = store_writer_block(writer, number, &summary, w->bytes, w->size, error);
        if (code == SQLITE_OK && progress && !progress(context, (double)(n + 1) / (double)count))
            code = SQLITE_INTERRUPT;
    }
    store_writer_free(writer);
    return code;
}

int store_write_minimal(sqlite3 *db, const char *name, bool (*progress)(void *context, double done), void *context,
                        char **error) {
    store *s = NULL;
    const store_terrain *t;
    const rqt_pyramid *pyramid = NULL;
    workshop w = {0};
    int code = store_open(db, &s);
    if (code == SQLITE_OK) code = store_find(s, name, &t, error);
    if (code == SQLITE_OK && has_table(db, t))
        code = store_fail(error, SQLITE_ERROR, "terrain %s has its minimal errors stored already", t->name);
    if (code == SQLITE_OK) code = store_begin_on(s, t, error);
    if (code == SQLITE_OK) {
        code = store_take_pyramid(s, t, RQT_METRIC_MINIMAL, RQT_OUTLINE_EXACT, &pyramid, error);
        store_end(s);
    }
    if (code == SQLITE_OK && progress && !progress(context, 0)) code = SQLITE_INTERRUPT;
    if (code == SQLITE_OK) code = workshop_create(&w, t->k);
    if (code == SQLITE_OK) {
        store_release(s); /* its statements would keep tables from being made */
        code = write_all(db, t, pyramid, &w, progress, context, error);
    }
    workshop_free(&w);
    store_close(s);
    return code;
}

/* ---------------------------------------------------------------------------------------------- checking */

typedef struct check {
    store *store;
    const store_terrain *t; /* as store_find gives it */
    sqlite3_stmt *row, *index;
    workshop shop;
    bool (*tell)(void *context, const store_finding *finding);
    void *context;
    bool stopped;
    char **error;
} check;

/* A finding; number 0 is the terrain. */
static int tell(check *c, rqt_block_number number, const char *format, ...) {
    sqlite3_str *out = sqlite3_str_new(NULL);
    if (number)
        sqlite3_str_appendf(out, "minimal errors: block %llu ", number);
    else
        sqlite3_str_appendf(out, "minimal errors: terrain %s ", c->t->name);
    va_list arguments;
    va_start(arguments, format);
    sqlite3_str_vappendf(out, format, arguments);
    va_end(arguments);
    char *text = sqlite3_str_finish(out);
    if (!text) return SQLITE_NOMEM;
    c->stopped = !c->tell(c->context, &(store_finding){"error", number, text});
    sqlite3_free(text);
    return SQLITE_OK;
}

/* The first vertex at which two decoded blocks differ; -1: none. What a sparse block does not keep is no matter. */
static int first_difference(const rqt_block *a, const rqt_block *b) {
    const int n = (1 << a->k) + 1;
    for (int i = 0; i < n * n; i++) {
        if (a->flags[i] != b->flags[i] || a->error[i] != b->error[i]) return i;
        if ((a->flags[i] & RQT_VALID) && a->q[i] != b->q[i]) return i;
    }
    return -1;
}

/* The stored bytes against the block that the heights give, which is in shop.block. */
static int check_bytes(check *c, rqt_block_number number, const uint8_t *bytes, size_t size) {
    workshop *w = &c->shop;
    const rqt_status status = rqt_block_encode(w->codec, &w->block, store_quantum(c->t), w->bytes, &w->size);
    if (status != RQT_OK) return store_fail_core(c->error, status, "encoding a block");
    if (size == w->size && memcmp(bytes, w->bytes, size) == 0) return SQLITE_OK;
    rqt_block_header header, expected;
    rqt_message why = {""};
    if (rqt_block_info(bytes, size, &header, &why) != RQT_OK)
        return tell(c, number, "does not decode: %s", why.text);
    if (rqt_block_info(w->bytes, w->size, &expected, NULL) != RQT_OK || header.k != expected.k ||
        header.width != expected.width || header.height != expected.height || header.quantum != expected.quantum)
        return tell(c, number, "does not fit its place");
    if (rqt_block_decode(w->codec, w->bytes, w->size, &w->block) != RQT_OK ||
        rqt_block_decode(w->codec, bytes, size, &w->other) != RQT_OK)
        return tell(c, number, "does not decode");
    const int n = (1 << c->t->k) + 1, at = first_difference(&w->block, &w->other);
    if (at < 0) return SQLITE_OK;
    return tell(c, number, "is not what the heights give, first in row %d, column %d of its grid", at / n, at % n);
}

static void expect_interval(int64_t out[2], rqt_code em, rqt_code em_parent) {
    out[0] = em < em_parent ? em : STORE_NEVER;
    out[1] = em < em_parent ? em_parent - 1 : STORE_NEVER;
}

/* *indexed counts the rows that there should be. */
static int check_index(check *c, rqt_block_number number, const rqt_summary *summary, int64_t *indexed) {
    const rqt_lattice *lattice = &c->t->lattice;
    rqt_block_place p;
    int64_t expected[8];
    if (rqt_block_locate(lattice, c->t->k, number, &p) != RQT_OK) return tell(c, number, "has no place");
    const rqt_vertex end = rqt_vertex_clamp(lattice, (rqt_vertex){p.x + p.side, p.y + p.side});
    expected[0] = p.x, expected[1] = end.x, expected[2] = p.y, expected[3] = end.y;
    expect_interval(expected + 4, summary->tol.em, summary->tol.em_parent);
    expect_interval(expected + 6, summary->exact.em, summary->exact.em_parent);
    const bool wanted = expected[4] != STORE_NEVER || expected[6] != STORE_NEVER;
    *indexed += wanted;
    sqlite3_bind_int64(c->index, 1, (sqlite3_int64)number);
    const int code = sqlite3_step(c->index);
    bool fits = wanted == (code == SQLITE_ROW);
    for (int i = 0; i < 8 && fits && wanted; i++) fits = sqlite3_column_int64(c->index, i) == expected[i];
    sqlite3_reset(c->index);
    if (code != SQLITE_ROW && code != SQLITE_DONE)
        return store_fail_db(c->error, c->store->db, code, "reading the index of minimal errors");
    return fits ? SQLITE_OK : tell(c, number, "has a wrong row in the index");
}

static int check_block(check *c, const rqt_pyramid *pyramid, size_t n, int64_t *indexed) {
    rqt_block_number number;
    rqt_summary summary;
    uint8_t expected[RQT_SUMMARY_BYTES];
    rqt_pyramid_block(pyramid, n, &number, &summary, &c->shop.block);
    rqt_summary_encode(&summary, expected);
    sqlite3_bind_int64(c->row, 1, (sqlite3_int64)number);
    int code = sqlite3_step(c->row);
    if (code == SQLITE_ROW) {
        const void *stored = sqlite3_column_blob(c->row, 0);
        const int size = sqlite3_column_bytes(c->row, 0);
        if (!stored || size != RQT_SUMMARY_BYTES || memcmp(stored, expected, RQT_SUMMARY_BYTES) != 0)
            code = tell(c, number, "has a summary that is not what the heights give");
        else
            code = SQLITE_OK;
        const uint8_t *bytes = sqlite3_column_blob(c->row, 1);
        if (code == SQLITE_OK && !c->stopped)
            code = check_bytes(c, number, bytes ? bytes : (const uint8_t *)"",
                               (size_t)sqlite3_column_bytes(c->row, 1));
    } else if (code == SQLITE_DONE) {
        code = tell(c, number, "is missing");
    } else {
        code = store_fail_db(c->error, c->store->db, code, "reading a block of minimal errors");
    }
    sqlite3_reset(c->row);
    return code == SQLITE_OK && !c->stopped ? check_index(c, number, &summary, indexed) : code;
}

/* A table must have this many rows. */
static int check_count(check *c, const char *table, int64_t expected) {
    sqlite3_stmt *rows = NULL;
    char *sql =
        sqlite3_mprintf("SELECT count(*) FROM \"%w\".%s_%lld%s", c->t->schema, table, c->t->id, STORE_MINIMAL);
    int code = sql ? sqlite3_prepare_v2(c->store->db, sql, -1, &rows, NULL) : SQLITE_NOMEM;
    sqlite3_free(sql);
    if (code == SQLITE_OK && (code = sqlite3_step(rows)) == SQLITE_ROW) {
        const int64_t count = sqlite3_column_int64(rows, 0);
        code = count == expected ? SQLITE_OK
                                 : tell(c, 0, "has %lld rows in %s_%lld%s; there are to be %lld", count, table,
                                        c->t->id, STORE_MINIMAL, expected);
    } else {
        code = store_fail_db(c->error, c->store->db, code, "reading the tables of minimal errors");
    }
    sqlite3_finalize(rows);
    return code;
}

static int check_all(check *c) {
    store *s = c->store;
    const store_terrain *t = c->t;
    const rqt_pyramid *pyramid = NULL;
    char *why = NULL;
    int code = store_take_pyramid(s, t, RQT_METRIC_MINIMAL, RQT_OUTLINE_EXACT, &pyramid, &why);
    if (code == SQLITE_ERROR || code == SQLITE_CORRUPT_VTAB) /* too large, or heights that the check has told of */
        code = tell(c, 0, "cannot be checked: %s", why ? why : "its heights cannot be read");
    sqlite3_free(why);
    if (code != SQLITE_OK || !pyramid) return code;
    code = workshop_create(&c->shop, t->k);
    if (code == SQLITE_OK)
        code = store_prepare(s, t, &c->row,
                             sqlite3_mprintf("SELECT summary, data FROM \"%w\".rqt_block_%lld%s WHERE id = ?1",
                                             t->schema, t->id, STORE_MINIMAL),
                             c->error);
    if (code == SQLITE_OK)
        code = store_prepare(s, t, &c->index,
                             sqlite3_mprintf("SELECT x0, x1, y0, y1, tol0, tol1, exact0, exact1 FROM "
                                             "\"%w\".rqt_index_%lld%s WHERE id = ?1",
                                             t->schema, t->id, STORE_MINIMAL),
                             c->error);
    int64_t indexed = 0;
    const size_t count = rqt_pyramid_count(pyramid);
    for (size_t n = 0; n < count && code == SQLITE_OK && !c->stopped; n++)
        code = check_block(c, pyramid, n, &indexed);
    if (code == SQLITE_OK && !c->stopped) code = check_count(c, "rqt_block", (int64_t)count);
    if (code == SQLITE_OK && !c->stopped) code = check_count(c, "rqt_index", indexed);
    return code;
}

int store_check_minimal(store *s, const store_terrain *t,
                        bool (*tell_one)(void *context, const store_finding *finding), void *context,
                        char **error) {
    if (t->problem || !t->complete || !has_table(s->db, t)) return SQLITE_OK;
    check c = {.store = s, .tell = tell_one, .context = context, .error = error};
    char *name = sqlite3_mprintf("%s.%s", t->schema, t->name), *why = NULL;
    int code = name ? store_find(s, name, &c.t, &why) : SQLITE_NOMEM;
    sqlite3_free(name);
    sqlite3_free(why);
    if (code == SQLITE_ERROR || code == SQLITE_CORRUPT_VTAB) return SQLITE_OK; /* has been told */
    if (code != SQLITE_OK || c.t->id != t->id) return code;
    code = store_begin_on(s, c.t, error);
    if (code != SQLITE_OK) return code;
    code = check_all(&c);
    sqlite3_finalize(c.row);
    sqlite3_finalize(c.index);
    workshop_free(&c.shop);
    store_methods_free(s); /* the heights of a whole terrain: not to be kept for a check */
    store_end(s);
    return code;
}
