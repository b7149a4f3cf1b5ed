/* reader.c - queries: which blocks answer, and their bytes.
 *
 * What a connection keeps between calls: the rows of rqt_terrain, a pair of prepared statements per terrain, and a
 * cache of decoded blocks. All of it is dropped as soon as any database of the connection has changed: SQLite's
 * data version sees commits of others and our own. While this connection itself writes, nothing is kept from one
 * call to the next, because a rollback would not change the version back.
 */
#include "internal.h"

#include "cache.h"

#include <math.h>
#include <string.h>

#define CACHE_BYTES ((size_t)64 << 20)
#define MOST_DATABASES 127 /* of a connection: main, temp, and SQLite's limit of 125 attached ones */

typedef struct statements {
    sqlite3_stmt *answers[2]; /* by rqt_outline */
    sqlite3_stmt *bytes;
} statements;

struct store {
    sqlite3 *db;
    store_terrain *terrains;
    statements *statements; /* one per terrain */
    int count;
    bool known;                         /* terrains are read, and the cache holds only what is theirs */
    uint64_t version;                   /* of all databases, when they were read */
    sqlite3_stmt *held[MOST_DATABASES]; /* statements that hold a database as it is */
    sqlite3_stmt *probe;                /* asks whether we are interrupted */
    int holders;                        /* calls of store_begin that have not ended */
    block_cache *cache;
    rqt_codec *codec;
};

int store_fail_core(char **error, rqt_status status, const char *doing) {
    switch (status) {
    case RQT_OK:
        return SQLITE_OK;
    case RQT_NO_MEMORY:
        return SQLITE_NOMEM;
    case RQT_INTERRUPTED:
        return SQLITE_INTERRUPT;
    case RQT_CORRUPT:
        return store_fail(error, SQLITE_CORRUPT_VTAB, "%s: damaged bytes", doing);
    case RQT_READ_FAILED:
        return SQLITE_ERROR; /* the callback has left its sentence */
    default:
        return store_fail(error, SQLITE_ERROR, "%s: unusable argument", doing);
    }
}

int store_open(sqlite3 *db, store **out) {
    *out = NULL;
    store *s = sqlite3_malloc(sizeof *s);
    if (!s) return SQLITE_NOMEM;
    memset(s, 0, sizeof *s);
    s->db = db;
    s->cache = block_cache_create(store_allocator(), CACHE_BYTES);
    if (!s->cache || rqt_codec_create(store_allocator(), &s->codec) != RQT_OK) {
        store_close(s);
        return SQLITE_NOMEM;
    }
    *out = s;
    return SQLITE_OK;
}

sqlite3 *store_connection(const store *s) {
    return s->db;
}

static void finalize(statements *p) {
    sqlite3_finalize(p->answers[0]);
    sqlite3_finalize(p->answers[1]);
    sqlite3_finalize(p->bytes);
    memset(p, 0, sizeof *p);
}

static void finalize_all(store *s) {
    for (int i = 0; i < s->count; i++) finalize(&s->statements[i]);
}

void store_release(store *s) {
    finalize_all(s);
    for (int i = 0; i < MOST_DATABASES; i++) {
        sqlite3_finalize(s->held[i]);
        s->held[i] = NULL;
    }
    sqlite3_finalize(s->probe);
    s->probe = NULL;
    s->known = false; /* nobody counts what happens from here on */
}

static void forget(store *s) {
    finalize_all(s);
    sqlite3_free(s->statements);
    store_terrains_free(s->terrains, s->count);
    s->statements = NULL;
    s->terrains = NULL;
    s->count = 0;
    s->known = false;
    block_cache_clear(s->cache);
}

void store_close(store *s) {
    if (!s) return;
    store_release(s);
    if (s->cache) forget(s);
    block_cache_free(s->cache);
    rqt_codec_free(s->codec);
    sqlite3_free(s);
}

/* Hold on to one state of every database of the connection, until the matching store_end: what is found, the index,
 * the bytes and the cache then belong together, whatever others commit. Where a statement of the host already holds
 * a database there is nothing to do. Beginning to read is also when SQLite looks whether others have changed it. */
int store_begin(store *s, char **error) {
    if (s->holders++ > 0) return SQLITE_OK;
    int code = SQLITE_OK;
    for (int i = 0; i < MOST_DATABASES && code == SQLITE_OK; i++) {
        const char *name = sqlite3_db_name(s->db, i);
        if (!name) break;
        /* The main database's statement runs always: that a DETACH makes it prepare itself again is how we learn of
         * it. */
        if (i == 1 || (i > 1 && sqlite3_txn_state(s->db, name) != SQLITE_TXN_NONE)) continue; /* 1: temp */
        if (!s->held[i]) {
            char *sql = sqlite3_mprintf("SELECT 1 FROM \"%w\".sqlite_schema LIMIT 1", name);
            code = sql ? sqlite3_prepare_v3(s->db, sql, -1, SQLITE_PREPARE_PERSISTENT, &s->held[i], NULL)
                       : SQLITE_NOMEM;
            sqlite3_free(sql);
        }
        if (code == SQLITE_OK) code = sqlite3_step(s->held[i]);
        if (code == SQLITE_ROW || code == SQLITE_DONE) code = SQLITE_OK;
    }
    if (code == SQLITE_OK) return SQLITE_OK;
    code = store_fail_db(error, s->db, code, "reading the database");
    store_end(s);
    return code;
}

void store_end(store *s) {
    if (--s->holders > 0) return;
    sqlite3_reset(s->held[0]); /* the main database is asked often: its statement stays */
    for (int i = 2; i < MOST_DATABASES; i++) {
        sqlite3_finalize(s->held[i]);
        s->held[i] = NULL;
    }
}

static uint64_t mix_text(uint64_t h, const char *text) {
    while (text && *text) h = (h ^ (uint8_t)*text++) * UINT64_C(0x100000001B3);
    return (h ^ 0xFF) * UINT64_C(0xC2B2AE3D27D4EB4F);
}

/* A number that changes when any database of the connection does, or one is attached or detached. */
static uint64_t version_of(const store *s, bool *writing) {
    sqlite3 *db = s->db;
    uint64_t h = 0;
    *writing = false;
    for (int i = 0;; i++) {
        const char *name = sqlite3_db_name(db, i);
        if (!name) break;
        if (i == 1) continue; /* temp */
        unsigned version = 0;
        (void)sqlite3_file_control(db, name, SQLITE_FCNTL_DATA_VERSION, &version);
        h = (h ^ version) * UINT64_C(0x9E3779B97F4A7C15);
        h = mix_text(mix_text(h, name), sqlite3_db_filename(db, name));
        if (sqlite3_txn_state(db, name) == SQLITE_TXN_WRITE) *writing = true;
    }
    return h ^ (uint64_t)(s->held[0] ? sqlite3_stmt_status(s->held[0], SQLITE_STMTSTATUS_REPREPARE, 0) : 0);
}

static int refresh(store *s, char **error) {
    bool writing;
    const uint64_t version = version_of(s, &writing);
    if (s->known && !writing && version == s->version) return SQLITE_OK;
    forget(s);
    int code = store_read_terrains(s->db, &s->terrains, &s->count, error);
    if (code != SQLITE_OK) return code;
    if (s->count > 0) {
        const sqlite3_uint64 bytes = (sqlite3_uint64)s->count * sizeof *s->statements;
        s->statements = sqlite3_malloc64(bytes);
        if (!s->statements) {
            store_terrains_free(s->terrains, s->count);
            s->terrains = NULL;
            s->count = 0;
            return SQLITE_NOMEM;
        }
        memset(s->statements, 0, bytes);
    }
    s->version = version;
    s->known = !writing;
    return SQLITE_OK;
}

/* "a, b, c" */
static char *names_of(const store *s) {
    sqlite3_str *out = sqlite3_str_new(NULL);
    for (int i = 0; i < s->count; i++)
        sqlite3_str_appendf(out, "%s%s%s%s", i ? ", " : "",
                            strcmp(s->terrains[i].schema, "main") ? s->terrains[i].schema : "",
                            strcmp(s->terrains[i].schema, "main") ? "." : "", s->terrains[i].name);
    return sqlite3_str_finish(out);
}

/* Does the name mean this terrain? 2: by its own name; 1: as schema.name. */
static int meant(const store_terrain *t, const char *name) {
    if (strcmp(name, t->name) == 0) return 2;
    const size_t n = strlen(t->schema);
    return strncmp(name, t->schema, n) == 0 && name[n] == '.' && strcmp(name + n + 1, t->name) == 0;
}

static int find(store *s, const char *name, const store_terrain **terrain, char **error) {
    int code = refresh(s, error);
    if (code != SQLITE_OK) return code;
    const store_terrain *found = NULL;
    int matches = 0;
    if (!name) {
        if (s->count == 1) {
            found = s->terrains;
            matches = 1;
        }
    } else {
        for (int exact = 2; exact >= 1 && matches == 0; exact--)
            for (int i = 0; i < s->count; i++) {
                if (meant(&s->terrains[i], name) != exact) continue;
                /* main hides attached databases of the same name, as it does for tables */
                if (matches++ == 0 || strcmp(s->terrains[i].schema, "main") == 0) found = &s->terrains[i];
                if (strcmp(found->schema, "main") == 0) matches = 1;
            }
    }
    if (matches == 1 && found->problem) return store_fail(error, SQLITE_CORRUPT_VTAB, "%s", found->problem);
    if (matches == 1 && !found->complete)
        return store_fail(error, SQLITE_ERROR, "terrain %s is incomplete: its import did not finish", found->name);
    if (matches == 1) {
        *terrain = found;
        return SQLITE_OK;
    }
    if (s->count == 0)
        return store_fail(error, SQLITE_ERROR, "this database holds no terrain; rqt import makes one");
    char *names = names_of(s);
    if (!names) return SQLITE_NOMEM;
    if (!name)
        code = store_fail(error, SQLITE_ERROR, "which terrain? There are %d: %s", s->count, names);
    else if (matches > 1)
        code = store_fail(error, SQLITE_ERROR, "terrain %s is in %d databases; say which as database.%s", name,
                          matches, name);
    else
        code = store_fail(error, SQLITE_ERROR, "there is no terrain %s; there is %s", name, names);
    sqlite3_free(names);
    return code;
}

int store_find(store *s, const char *name, const store_terrain **terrain, char **error) {
    *terrain = NULL;
    int code = store_begin(s, error);
    if (code != SQLITE_OK) return code;
    code = find(s, name, terrain, error);
    store_end(s);
    return code;
}

int store_terrains(store *s, store_terrain **terrains, int *count, char **error) {
    return store_read_terrains(s->db, terrains, count, error);
}

/* ------------------------------------------------------------------------------------------- statements */

static int prepare(store *s, const store_terrain *t, sqlite3_stmt **out, char *sql, char **error) {
    if (!sql) return SQLITE_NOMEM;
    int code = sqlite3_prepare_v3(s->db, sql, -1, SQLITE_PREPARE_PERSISTENT, out, NULL);
    sqlite3_free(sql);
    if (code == SQLITE_OK) return code;
    char *doing = sqlite3_mprintf("terrain %s is damaged", t->name);
    code = doing ? store_fail_db(error, s->db, code, doing) : SQLITE_NOMEM;
    sqlite3_free(doing);
    return code;
}

static statements *statements_of(store *s, const store_terrain *t) {
    return &s->statements[t - s->terrains];
}

static int answers_statement(store *s, const store_terrain *t, rqt_outline outline, sqlite3_stmt **out,
                             char **error) {
    sqlite3_stmt **kept = &statements_of(s, t)->answers[outline == RQT_OUTLINE_TOL];
    int code = SQLITE_OK;
    if (!*kept) {
        const char *column = outline == RQT_OUTLINE_TOL ? "tol" : "exact";
        code = prepare(
            s, t, kept,
            sqlite3_mprintf("SELECT b.id, b.summary FROM \"%w\".rqt_index_%lld i "
                            "CROSS JOIN \"%w\".rqt_block_%lld b ON b.id = i.id WHERE i.x1 >= ?1 AND i.x0 <= ?2 "
                            "AND i.y1 >= ?3 AND i.y0 <= ?4 AND i.%s0 <= ?5 AND i.%s1 >= ?5",
                            t->schema, t->id, t->schema, t->id, column, column),
            error);
    }
    *out = *kept;
    return code;
}

static int block_bytes(store *s, const store_terrain *t, rqt_block_number number, const uint8_t **bytes, int *size,
                       char **error) {
    sqlite3_stmt **kept = &statements_of(s, t)->bytes;
    *bytes = NULL;
    *size = 0;
    if (!*kept) {
        const int code = prepare(
            s, t, kept, sqlite3_mprintf("SELECT data FROM \"%w\".rqt_block_%lld WHERE id = ?1", t->schema, t->id),
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

/* The decoded block, from the cache or the database. *read: bytes read now, 0 when it was cached. */
static int get_block(store *s, const store_terrain *t, rqt_block_number number, const rqt_block **block, int *read,
                     char **error) {
    const uint64_t key = (uint64_t)(t - s->terrains);
    *read = 0;
    *block = block_cache_find(s->cache, key, number);
    if (*block) return SQLITE_OK;
    const uint8_t *bytes;
    int size;
    int code = block_bytes(s, t, number, &bytes, &size, error);
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
        if (code != SQLITE_OK && fresh) block_cache_forget(s->cache, key, number);
    }
    sqlite3_reset(statements_of(s, t)->bytes);
    if (code == SQLITE_OK) {
        *block = fresh;
        *read = size;
    }
    return code;
}

/* ------------------------------------------------------------------------------------------------ queries */

typedef struct answer_list {
    rqt_answer *rows;
    size_t count, capacity;
} answer_list;

/* The answering blocks that meet the box; and a proof that the index is whole: their cells tile the box. */
static int find_answers(store *s, const store_terrain *t, const int32_t box[4], rqt_outline outline, rqt_code eps,
                        answer_list *list, char **error) {
    sqlite3_stmt *row;
    int code = answers_statement(s, t, outline, &row, error);
    if (code != SQLITE_OK) return code;
    for (int i = 0; i < 4; i++) sqlite3_bind_int(row, i + 1, box[i]);
    sqlite3_bind_int(row, 5, eps);
    int64_t covered = 0;
    int32_t proof[4] = {box[0], box[1], box[2], box[3]};
    for (int a = 0; a < 4; a += 2) {
        const int32_t samples = a ? t->lattice.height : t->lattice.width;
        if (proof[a] != proof[a + 1]) continue;
        if (proof[a + 1] < samples - 1 || samples == 1)
            proof[a + 1]++;
        else
            proof[a]--;
    }
    const int64_t wanted = (int64_t)(proof[1] - proof[0]) * (proof[3] - proof[2]);
    while ((code = sqlite3_step(row)) == SQLITE_ROW) {
        if (list->count == list->capacity) {
            const size_t more = list->capacity ? 2 * list->capacity : 64;
            rqt_answer *rows = sqlite3_realloc64(list->rows, more * sizeof *rows);
            if (!rows) {
                code = SQLITE_NOMEM;
                break;
            }
            list->rows = rows;
            list->capacity = more;
        }
        rqt_answer *answer = &list->rows[list->count];
        answer->number = (rqt_block_number)sqlite3_column_int64(row, 0);
        const void *bytes = sqlite3_column_blob(row, 1);
        const int size = sqlite3_column_bytes(row, 1);
        rqt_block_place p;
        if (!bytes || rqt_summary_decode(bytes, (size_t)size, &answer->summary) != RQT_OK ||
            !rqt_summary_answers(&answer->summary, outline, eps) ||
            rqt_block_locate(&t->lattice, t->k, answer->number, &p) != RQT_OK) {
            code = store_fail(error, SQLITE_CORRUPT_VTAB, "terrain %s is damaged: the summary of block %lld",
                              t->name, (sqlite3_int64)answer->number);
            break;
        }
        const int64_t x0 = p.x > proof[0] ? p.x : proof[0], x1 = p.x + p.side < proof[1] ? p.x + p.side : proof[1];
        const int64_t y0 = p.y > proof[2] ? p.y : proof[2], y1 = p.y + p.side < proof[3] ? p.y + p.side : proof[3];
        if (x1 > x0 && y1 > y0) covered += (x1 - x0) * (y1 - y0);
        list->count++;
        if (covered > wanted) break; /* blocks over one another */
    }
    sqlite3_reset(row);
    if (code == SQLITE_DONE || (code == SQLITE_ROW && covered > wanted)) {
        if (covered == wanted) return SQLITE_OK; /* and the query sees that they are disjoint */
        return store_fail(error, SQLITE_CORRUPT_VTAB,
                          "terrain %s is damaged: its index does not cover the region; see rqt_check", t->name);
    }
    if (!*error && code != SQLITE_NOMEM) code = store_fail_db(error, s->db, code, "reading the index");
    return code;
}

typedef struct reading {
    store *store;
    const store_terrain *terrain;
    const rqt_query *query;
    store_reads *reads; /* may be NULL */
    size_t next;
    char **error;
    int code;
} reading;

static int64_t count_selected(const rqt_query *query, const rqt_block *block) {
    const size_t n = ((size_t)1 << block->k) + 1;
    int64_t count = 0;
    for (size_t i = 0; i < n * n; i++)
        count += block->error[i] > query->eps ||
                 (query->outline == RQT_OUTLINE_EXACT && (block->flags[i] & RQT_OUTLINE));
    return count;
}

/* A row per answer, as answered from its index row; the query has sorted them. */
static int begin_reads(const rqt_query *query, store_reads *reads) {
    reads->rows = sqlite3_malloc64((query->answer_count + 1) * sizeof *reads->rows);
    if (!reads->rows) return SQLITE_NOMEM;
    reads->count = query->answer_count;
    for (size_t i = 0; i < reads->count; i++) {
        const rqt_summary *summary = &query->answers[i].summary;
        int64_t selected = 0;
        for (int c = 0; c < 4; c++)
            selected += summary->corner[c].error > query->eps ||
                        (query->outline == RQT_OUTLINE_EXACT && (summary->corner[c].flags & RQT_OUTLINE));
        reads->rows[i] = (store_read){query->answers[i].number, false, false, 0, selected};
    }
    return SQLITE_OK;
}

static const rqt_block *read_block(void *context, rqt_block_number number) {
    reading *r = context;
    const rqt_block *block;
    int read;
    r->code = get_block(r->store, r->terrain, number, &block, &read, r->error);
    if (r->code != SQLITE_OK) return NULL;
    if (r->reads) {
        /* Blocks come in the order of the answers, once, or twice when a selection is closed first. */
        if (!r->reads->rows && (r->code = begin_reads(r->query, r->reads)) != SQLITE_OK) return NULL;
        while (r->reads->rows[r->next].number != number) r->next = (r->next + 1) % r->reads->count;
        store_read *row = &r->reads->rows[r->next];
        if (!row->needs_bytes) {
            const uint8_t *bytes;
            int size = read;
            if (!read) {
                r->code = block_bytes(r->store, r->terrain, number, &bytes, &size, r->error);
                sqlite3_reset(statements_of(r->store, r->terrain)->bytes);
                if (r->code != SQLITE_OK) return NULL;
            }
            *row = (store_read){number, true, read == 0, size, count_selected(r->query, block)};
        }
    }
    return block;
}

static bool is_interrupted(void *context) {
    /* SQLite 3.40 tells nobody that sqlite3_interrupt was called but a statement that runs: so run one. */
    reading *r = context;
    store *s = r->store;
    int code = SQLITE_OK;
    if (!s->probe) code = sqlite3_prepare_v3(s->db, "SELECT 1", -1, SQLITE_PREPARE_PERSISTENT, &s->probe, NULL);
    if (code == SQLITE_OK) code = sqlite3_step(s->probe);
    sqlite3_reset(s->probe);
    if (code == SQLITE_ROW) return false;
    r->code = code & 0xFF;
    return true;
}

void store_reads_free(store_reads *reads) {
    sqlite3_free(reads->rows);
    memset(reads, 0, sizeof *reads);
}

static int query(store *s, const store_terrain *t, const rqt_region *region, double eps,
                 const store_query_options *options, rqt_patch *patch, store_reads *reads, char **error) {
    memset(patch, 0, sizeof *patch);
    if (reads) memset(reads, 0, sizeof *reads);
    if (!(eps >= 0)) return store_fail(error, SQLITE_ERROR, "eps must be a number of metres, 0 or more");
    int32_t box[4];
    if (!rqt_region_box(region, &box[0], &box[2], &box[1], &box[3])) return SQLITE_OK;
    const rqt_code code_eps = rqt_code_eps(eps, t->quantum_error);
    answer_list list = {0};
    char *sentence = NULL;
    int code = find_answers(s, t, box, options->outline, code_eps, &list, &sentence);
    if (code == SQLITE_OK) {
        rqt_query query = {.lattice = t->lattice,
                           .k = t->k,
                           .region = region,
                           .eps = code_eps,
                           .select = options->select,
                           .outline = options->outline,
                           .answers = list.rows,
                           .answer_count = list.count,
                           .read_block = read_block,
                           .is_interrupted = is_interrupted};
        reading r = {
            .store = s, .terrain = t, .query = &query, .reads = reads, .error = &sentence, .code = SQLITE_OK};
        query.context = &r;
        const rqt_status status = rqt_query_run(&query, store_allocator(), patch);
        code = status == RQT_READ_FAILED || status == RQT_INTERRUPTED ? r.code
                                                                      : store_fail_core(&sentence, status, "query");
        if (code == SQLITE_OK && reads && !reads->rows) code = begin_reads(&query, reads);
    }
    sqlite3_free(list.rows);
    if (code != SQLITE_OK && reads) store_reads_free(reads);
    if (error && sentence) {
        *error = sentence;
        sentence = NULL;
    }
    sqlite3_free(sentence);
    return code;
}

/* store_begin, and the state is still the one in which store_find found the terrain. */
static int begin_on(store *s, const store_terrain *t, char **error) {
    const int code = store_begin(s, error);
    bool writing;
    if (code != SQLITE_OK || version_of(s, &writing) == s->version) return code;
    store_end(s);
    return store_fail(error, SQLITE_BUSY, "terrain %s has just changed: ask again", t->name);
}

int store_query(store *s, const store_terrain *t, const rqt_region *region, double eps,
                const store_query_options *options, rqt_patch *patch, store_reads *reads, char **error) {
    memset(patch, 0, sizeof *patch);
    if (reads) memset(reads, 0, sizeof *reads);
    int code = begin_on(s, t, error);
    if (code != SQLITE_OK) return code;
    code = query(s, t, region, eps, options, patch, reads, error);
    store_end(s);
    return code;
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
    for (int32_t j = row >> shift; j <= last_j && j << shift < row + height; j++) {
        for (int32_t i = col >> shift; i <= last_i && i << shift < col + width; i++) {
            const rqt_block *block;
            int read;
            const int code = get_block(s, t, rqt_block_number_of(level, i, j), &block, &read, error);
            if (code != SQLITE_OK) return code;
            for (int32_t v = 0; v < n; v++) {
                const int32_t y = (j << shift) + v;
                if (y < row || y >= row + height || y >= t->lattice.height) continue;
                for (int32_t u = 0; u < n; u++) {
                    const int32_t x = (i << shift) + u;
                    if (x < col || x >= col + width || x >= t->lattice.width) continue;
                    const size_t to = (size_t)(y - row) * (size_t)width + (size_t)(x - col);
                    const size_t from = (size_t)v * (size_t)n + (size_t)u;
                    q[to] = block->q[from];
                    valid[to] = block->flags[from] & RQT_VALID;
                }
            }
        }
    }
    return SQLITE_OK;
}

int store_window(store *s, const store_terrain *t, int32_t col, int32_t row, int32_t width, int32_t height,
                 int32_t *q, uint8_t *valid, char **error) {
    int code = begin_on(s, t, error);
    if (code != SQLITE_OK) return code;
    code = window(s, t, col, row, width, height, q, valid, error);
    store_end(s);
    return code;
}

/* ------------------------------------------------------------------------------------------------- heights */

static double metres_of(const rqt_unit *unit, double q) {
    return ((double)unit->z0 + q / (double)unit->d) * rqt_unit_factor(unit) + unit->offset;
}

/* The plane of the half cell that holds the place: what is valid and has weight counts. */
static int full_height(store *s, const store_terrain *t, double col, double row, double *metres, bool *found,
                       char **error) {
    const int32_t w = t->lattice.width, h = t->lattice.height;
    int32_t x = (int32_t)col, y = (int32_t)row;
    if (x > w - 2) x = w > 1 ? w - 2 : 0;
    if (y > h - 2) y = h > 1 ? h - 2 : 0;
    const double fx = col - x, fy = row - y;
    const rqt_block *block;
    int read;
    const int32_t i = x >> t->k, j = y >> t->k;
    const int code = get_block(s, t, rqt_block_number_of(t->lattice.K - t->k, i, j), &block, &read, error);
    if (code != SQLITE_OK) return code;
    const size_t n = ((size_t)1 << t->k) + 1;
    const size_t nw = (size_t)(y - (j << t->k)) * n + (size_t)(x - (i << t->k));
    const size_t at[4] = {nw, nw + 1, nw + n, nw + n + 1}; /* NW NE SW SE */
    double weight[4];
    if ((x + y) % 2 == 0) { /* diagonal NW-SE */
        weight[0] = 1 - (fx > fy ? fx : fy);
        weight[1] = fx > fy ? fx - fy : 0;
        weight[2] = fy > fx ? fy - fx : 0;
        weight[3] = fx < fy ? fx : fy;
    } else {
        const double sum = fx + fy;
        weight[0] = sum < 1 ? 1 - sum : 0;
        weight[1] = sum < 1 ? fx : 1 - fy;
        weight[2] = sum < 1 ? fy : 1 - fx;
        weight[3] = sum > 1 ? sum - 1 : 0;
    }
    double q = 0;
    for (int c = 0; c < 4; c++) {
        if (weight[c] == 0) continue;
        if (!(block->flags[at[c]] & RQT_VALID)) return SQLITE_OK;
        q += weight[c] * block->q[at[c]];
    }
    *metres = metres_of(&t->unit, q);
    *found = true;
    return SQLITE_OK;
}

/* The plane of a triangle of the patch of the point. */
static int mesh_height(store *s, const store_terrain *t, double x, double y, double col, double row, double eps,
                       double *metres, bool *found, char **error) {
    const uint32_t point = 1; /* also tells this machine's byte order, which the first byte of WKB names */
    uint8_t wkb[21] = {*(const uint8_t *)&point};
    memcpy(wkb + 1, &point, 4);
    memcpy(wkb + 5, &x, 8);
    memcpy(wkb + 13, &y, 8);
    rqt_geometry *geometry = NULL;
    rqt_region *region = NULL;
    rqt_message why = {""};
    rqt_status status = rqt_geometry_parse(wkb, sizeof wkb, false, store_allocator(), &geometry, &why);
    if (status == RQT_OK)
        status = rqt_region_create(geometry, &t->placement, &t->lattice, store_allocator(), &region);
    int code = store_fail_core(error, status, "the point");
    rqt_patch patch = {0};
    const store_query_options options = {RQT_SELECT_THRESHOLD, RQT_OUTLINE_EXACT};
    if (code == SQLITE_OK) code = store_query(s, t, region, eps, &options, &patch, NULL, error);
    if (code == SQLITE_OK && patch.triangle_count > 0) {
        const rqt_patch_vertex *a = &patch.vertices[patch.triangles[0]], *b = &patch.vertices[patch.triangles[1]],
                               *c = &patch.vertices[patch.triangles[2]];
        const double area =
            (double)(b->col - a->col) * (c->row - a->row) - (double)(c->col - a->col) * (b->row - a->row);
        const double wb = ((col - a->col) * (c->row - a->row) - (c->col - a->col) * (row - a->row)) / area;
        const double wc = ((b->col - a->col) * (row - a->row) - (col - a->col) * (b->row - a->row)) / area;
        *metres = metres_of(&t->unit, a->q + wb * ((double)b->q - a->q) + wc * ((double)c->q - a->q));
        *found = true;
    }
    rqt_patch_free(&patch);
    rqt_region_free(region);
    rqt_geometry_free(geometry);
    return code;
}

int store_height(store *s, const store_terrain *t, double x, double y, double eps, double *metres, bool *found,
                 char **error) {
    *metres = 0;
    *found = false;
    if (!isfinite(x) || !isfinite(y)) return store_fail(error, SQLITE_ERROR, "x and y must be finite numbers");
    /* Regions round coordinates to 2^-20 sample; so do we, or a place on the border would fall off it by an ulp. */
    const double col = nearbyint((x - t->placement.x0) / t->placement.dx * 0x1p20) * 0x1p-20;
    const double row = nearbyint((y - t->placement.y0) / t->placement.dy * 0x1p20) * 0x1p-20;
    if (!(col >= 0 && row >= 0 && col <= t->lattice.width - 1 && row <= t->lattice.height - 1)) return SQLITE_OK;
    int code = begin_on(s, t, error);
    if (code != SQLITE_OK) return code;
    code = eps < 0 ? full_height(s, t, col, row, metres, found, error)
                   : mesh_height(s, t, x, y, col, row, eps, metres, found, error);
    store_end(s);
    return code;
}
