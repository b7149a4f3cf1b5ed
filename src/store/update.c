/* update.c - new samples into a terrain that is stored.
 *
 * Which blocks change, and to what, is core's business (rqt_update); here they are read, and those that differ
 * written. A large window goes in parts of at most PART samples a side, cut where blocks are, so that memory stays
 * bounded and a block is seldom written twice; each part finds what the one before has left, since what the store
 * keeps of a block is forgotten as it is written.
 *
 * Provenance: the row's `source` holds each name once, in the order in which they were last put in. So it does not
 * grow when the same files are applied again and again, and an undo says that it was one.
 */
#include "internal.h"

#include <string.h>

#define PART 1024

struct store_update {
    store *s;
    const store_terrain *t;
    store_amender *amender;
    rqt_statistics statistics;
    store_update_report report;
    int32_t *q; /* a part */
    uint8_t *valid;
    uint8_t *bytes; /* an encoded block */
    int code;       /* of a callback that failed */
    char **error;
    bool (*progress)(void *context, double done);
    void *context;
    double done, share; /* of the window, before this part and by it */
};

/* -------------------------------------------------------------------------------------------- what core asks for
 * -- */

static const rqt_block *read_block(void *context, rqt_block_number number) {
    store_update *u = context;
    const rqt_block *block;
    int read;
    u->code = store_get_block(u->s, u->t, number, &block, &read, u->error);
    if (u->code != SQLITE_OK) return NULL;
    u->report.blocks_read += read > 0;
    u->report.bytes_read += read;
    return block;
}

static bool read_summary(void *context, rqt_block_number number, rqt_summary *summary) {
    store_update *u = context;
    const rqt_summary *found;
    u->code = store_get_summary(u->s, u->t, number, &found, u->error);
    if (u->code == SQLITE_OK) *summary = *found;
    return u->code == SQLITE_OK;
}

static bool write_block(void *context, rqt_block_number number, const rqt_summary *before, const rqt_summary *after,
                        const rqt_block *block) {
    store_update *u = context;
    size_t size = 0;
    if (block)
        u->code =
            store_fail_core(u->error, rqt_block_encode(u->s->codec, block, store_quantum(u->t), u->bytes, &size),
                            "encoding a block");
    else
        u->code = SQLITE_OK;
    if (u->code == SQLITE_OK)
        u->code = store_amend_block(u->amender, number, before, after, block ? u->bytes : NULL, size, u->error);
    store_forget_block(u->s, u->t, number);
    u->report.blocks += block != NULL;
    u->report.summaries += block == NULL;
    u->report.bytes += (int64_t)size + RQT_SUMMARY_BYTES;
    return u->code == SQLITE_OK;
}

static bool is_interrupted(void *context) {
    store_update *u = context;
    u->code = SQLITE_INTERRUPT;
    return u->progress && !u->progress(u->context, u->done);
}

/* ----------------------------------------------------------------------------------------------------- the parts
 * -- */

int store_update_begin(sqlite3 *db, const char *name, store_update **update, const store_terrain **terrain,
                       char **error) {
    *update = NULL;
    store_update *u = sqlite3_malloc(sizeof *u);
    if (!u) return SQLITE_NOMEM;
    memset(u, 0, sizeof *u);
    int code = store_open(db, &u->s);
    if (code == SQLITE_OK) code = store_find(u->s, name, &u->t, error);
    if (code == SQLITE_OK && strcmp(u->t->schema, "main") != 0)
        code = store_fail(error, SQLITE_ERROR, "terrain %s is in an attached database: open that one to update it",
                          u->t->name);
    if (code == SQLITE_OK) {
        const store_terrain *t = u->t;
        u->statistics = (rqt_statistics){t->voids, t->min_q, t->max_q, t->max_error};
        u->q = sqlite3_malloc64((sqlite3_uint64)PART * PART * sizeof *u->q);
        u->valid = sqlite3_malloc64((sqlite3_uint64)PART * PART);
        u->bytes = sqlite3_malloc64(rqt_block_bound(t->k));
        code = u->q && u->valid && u->bytes ? store_amend_begin(db, t, &u->amender, error) : SQLITE_NOMEM;
    }
    if (code != SQLITE_OK) {
        store_update_free(u);
        return code;
    }
    *terrain = u->t;
    *update = u;
    return SQLITE_OK;
}

void store_update_free(store_update *u) {
    if (!u) return;
    store_amend_free(u->amender);
    store_close(u->s);
    sqlite3_free(u->q);
    sqlite3_free(u->valid);
    sqlite3_free(u->bytes);
    sqlite3_free(u);
}

const store_update_report *store_update_told(const store_update *u) {
    return &u->report;
}

/* The samples of a part that are to stay, as they are stored. */
static int fill_kept(store_update *u, int32_t col, int32_t row, int32_t width, int32_t height, const uint8_t *state,
                     size_t stride) {
    const int shift = u->t->k, level = u->t->lattice.K - shift;
    const int32_t n = (1 << shift) + 1;
    const rqt_block *block = NULL;
    rqt_block_number at_hand = 0;
    for (int32_t y = 0; y < height; y++)
        for (int32_t x = 0; x < width; x++) {
            const size_t to = (size_t)y * (size_t)width + (size_t)x;
            if (state[(size_t)y * stride + (size_t)x] != STORE_KEEP) continue;
            int32_t i = (col + x) >> shift, j = (row + y) >> shift;
            /* The last column and row belong to the last blocks. */
            if (i > 0 && col + x == u->t->lattice.width - 1 && i << shift == col + x) i--;
            if (j > 0 && row + y == u->t->lattice.height - 1 && j << shift == row + y) j--;
            const rqt_block_number number = rqt_block_number_of(level, i, j);
            if (number != at_hand) {
                block = read_block(u, number);
                if (!block) return u->code;
                at_hand = number;
            }
            const size_t from = (size_t)(row + y - (j << shift)) * (size_t)n + (size_t)(col + x - (i << shift));
            /* No number is 0, so it was read. NOLINTNEXTLINE(clang-analyzer-core.NullDereference) */
            u->q[to] = block->q[from];
            u->valid[to] = block->flags[from] & RQT_VALID;
        }
    return SQLITE_OK;
}

static int update_part(store_update *u, int32_t col, int32_t row, int32_t width, int32_t height, const int32_t *q,
                       const uint8_t *state, size_t stride) {
    const store_terrain *t = u->t;
    bool any = false, keeps = false;
    for (int32_t y = 0; y < height; y++)
        for (int32_t x = 0; x < width; x++) {
            const size_t from = (size_t)y * stride + (size_t)x, to = (size_t)y * (size_t)width + (size_t)x;
            u->q[to] = q[from];
            u->valid[to] = state[from] == STORE_HEIGHT;
            any = any || state[from] != STORE_KEEP;
            keeps = keeps || state[from] == STORE_KEEP;
        }
    if (!any) return SQLITE_OK;
    if (keeps) {
        const int code = fill_kept(u, col, row, width, height, state, stride);
        if (code != SQLITE_OK) return code;
    }
    const rqt_update update = {.lattice = t->lattice,
                               .k = t->k,
                               .unit = t->unit,
                               .cost = t->cost,
                               .before = u->statistics,
                               .x = col,
                               .y = row,
                               .width = width,
                               .height = height,
                               .q = u->q,
                               .valid = u->valid,
                               .read_block = read_block,
                               .read_summary = read_summary,
                               .write = write_block,
                               .is_interrupted = is_interrupted,
                               .context = u};
    rqt_update_result result;
    const rqt_status status = rqt_update_run(&update, store_allocator(), &result);
    if (status == RQT_READ_FAILED || status == RQT_INTERRUPTED) return u->code;
    if (status == RQT_CORRUPT)
        return store_fail(u->error, SQLITE_CORRUPT_VTAB, "terrain %s is damaged; rqt check says more", t->name);
    if (status != RQT_OK) return store_fail_core(u->error, status, "updating a terrain");
    u->statistics = result.after;
    u->report.changed += result.changed;
    u->report.measured += result.measured;
    u->report.cells += result.cells;
    return SQLITE_OK;
}

/* The end of the part that begins at `from`: at a border of blocks where one is near. */
static int32_t part_end(int32_t from, int32_t end) {
    const int32_t next = (from / PART + 1) * PART;
    return next < end ? next : end;
}

int store_update_samples(store_update *u, int32_t col, int32_t row, int32_t width, int32_t height, const int32_t *q,
                         const uint8_t *state, bool (*progress)(void *context, double done), void *context,
                         char **error) {
    const rqt_lattice *l = &u->t->lattice;
    if (col < 0 || row < 0 || width < 1 || height < 1 || col > l->width - width || row > l->height - height)
        return store_fail(error, SQLITE_ERROR, "a window outside the raster");
    u->error = error;
    u->progress = progress;
    u->context = context;
    u->done = 0;
    for (int32_t y = row, next_y; y < row + height; y = next_y) {
        next_y = part_end(y, row + height);
        for (int32_t x = col, next_x; x < col + width; x = next_x) {
            next_x = part_end(x, col + width);
            const size_t from = (size_t)(y - row) * (size_t)width + (size_t)(x - col);
            const int code = update_part(u, x, y, next_x - x, next_y - y, q + from, state + from, (size_t)width);
            if (code != SQLITE_OK) return code;
            u->done += (double)(next_x - x) * (next_y - y) / ((double)width * height);
        }
    }
    return store_amend_filled(u->amender, col, row, width, height, state, error);
}

/* ------------------------------------------------------------------------------------------------------- the end
 * -- */

/* Is this line among those of a text? */
static bool has_line(const char *text, const char *line, size_t length) {
    while (*text) {
        const size_t n = strcspn(text, "\n");
        if (n == length && memcmp(text, line, n) == 0) return true;
        text += n + (text[n] == '\n');
    }
    return false;
}

/* Lines of `old` that are not in `fresh`, then those of fresh, each once: the last one counts. */
static char *join_lines(const char *old, const char *fresh) {
    sqlite3_str *out = sqlite3_str_new(NULL);
    for (int pass = 0; pass < 2; pass++)
        for (const char *at = pass ? fresh : old; *at;) {
            const size_t n = strcspn(at, "\n");
            const char *next = at + n + (at[n] == '\n');
            if (n > 0 && !has_line(pass ? next : fresh, at, n)) {
                if (sqlite3_str_length(out) > 0) sqlite3_str_appendchar(out, 1, '\n');
                sqlite3_str_append(out, at, (int)n);
            }
            at = next;
        }
    if (sqlite3_str_errcode(out) == SQLITE_OK && sqlite3_str_length(out) == 0) {
        sqlite3_free(sqlite3_str_finish(out));
        return sqlite3_mprintf("");
    }
    return sqlite3_str_finish(out);
}

/* They depend on the whole terrain: computed anew, or the update does not happen. */
static int renew_minimal(store_update *u, sqlite3 *db, bool (*progress)(void *context, double done), void *context,
                         char **error) {
    const store_terrain *t = u->t;
    const size_t need = store_minimal_bytes(&t->lattice, t->k, u->statistics.voids > 0);
    if (need > STORE_METHOD_MEMORY)
        return store_fail(
            error, SQLITE_ERROR,
            "the minimal errors that terrain %s stores have to be computed anew, which takes %llu MiB of "
            "memory; %llu are allowed: import it again without --minimal",
            t->name, (sqlite3_uint64)(need >> 20) + 1, (sqlite3_uint64)(STORE_METHOD_MEMORY >> 20));
    char name[sizeof t->name];
    memcpy(name, t->name, sizeof name);
    const int64_t id = t->id;
    store_release(u->s); /* its statements would keep the tables */
    int code = store_drop_minimal(db, id, error);
    if (code == SQLITE_OK) code = store_write_minimal(db, name, progress, context, error);
    u->report.minimal = true;
    return code;
}

int store_update_finish(store_update *u, const char *sources, bool (*progress)(void *context, double done),
                        void *context, char **error) {
    if (u->report.changed == 0) return SQLITE_OK;
    const bool minimal = store_minimal(u->s, u->t) != NULL;
    char *source = join_lines(u->t->source, sources);
    int code = source ? store_amend_terrain(u->amender, &u->statistics, source, error) : SQLITE_NOMEM;
    sqlite3_free(source);
    if (code == SQLITE_OK && minimal) code = renew_minimal(u, store_connection(u->s), progress, context, error);
    return code;
}
