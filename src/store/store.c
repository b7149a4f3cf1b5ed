/* store.c - what a connection keeps between calls, and how long it may.
 *
 * The rows of rqt_terrain, prepared statements per terrain, and a cache of decoded blocks (at most 256 MiB). All of
 * it is dropped as soon as any database of the connection has changed: SQLite's data version sees commits of others
 * and our own. While this connection itself writes, nothing is kept from one call to the next, because a rollback
 * would not change the version back. During a call the databases are held as they are.
 */
#include "internal.h"

#include <string.h>

#define CACHE_BYTES \
    ((size_t)256 << 20) /* of decoded blocks: 36 million samples, a whole DEM of 4097 x 4097 twice */
#define SCRATCH_BYTES ((size_t)64 << 20) /* of memory kept from query to query: about 2 million triangles */

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
    s->method_memory = STORE_METHOD_MEMORY;
    s->cache = block_cache_create(store_allocator(), CACHE_BYTES);
    if (!s->cache || rqt_codec_create(store_allocator(), &s->codec) != RQT_OK ||
        rqt_scratch_create(store_allocator(), &s->scratch) != RQT_OK) {
        store_close(s);
        return SQLITE_NOMEM;
    }
    *out = s;
    return SQLITE_OK;
}

store_limits *store_limits_of(store *s) {
    return &s->limits;
}

sqlite3 *store_connection(const store *s) {
    return s->db;
}

void store_keep(store *s, rqt_patch *patch) {
    rqt_scratch_keep(s->scratch, patch, SCRATCH_BYTES);
}

static void finalize(statements *p) {
    sqlite3_finalize(p->answers[0]);
    sqlite3_finalize(p->answers[1]);
    sqlite3_finalize(p->bytes);
    sqlite3_finalize(p->summary);
    memset(p, 0, sizeof *p);
}

static void finalize_all(store *s) {
    for (int i = 0; i < 2 * s->count; i++) finalize(&s->statements[i]);
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
    s->state++;
    store_methods_free(s);
    block_cache_clear(s->cache);
    if (s->has_summaries) memset(s->summaries, 0, SUMMARY_PLACES * sizeof *s->summaries);
    s->has_summaries = false;
}

void store_close(store *s) {
    if (!s) return;
    store_release(s);
    if (s->cache) forget(s);
    block_cache_free(s->cache);
    rqt_codec_free(s->codec);
    rqt_scratch_free(s->scratch);
    sqlite3_free(s->summaries);
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
        const sqlite3_uint64 n = (sqlite3_uint64)s->count, bytes = 2 * n * sizeof *s->statements;
        s->statements = sqlite3_malloc64(bytes);
        store_terrain *both = sqlite3_realloc64(s->terrains, 2 * n * sizeof *both);
        if (both) {
            s->terrains = both;
            memcpy(both + n, both, n * sizeof *both);
            for (sqlite3_uint64 i = n; i < 2 * n; i++) both[i].suffix = STORE_MINIMAL;
        }
        if (!s->statements || !both) {
            sqlite3_free(s->statements);
            s->statements = NULL;
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

int store_name_means(const store_terrain *t, const char *name) {
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
                if (store_name_means(&s->terrains[i], name) != exact) continue;
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

uint64_t store_state(const store *s) {
    return s->known ? s->state : 0;
}

int store_terrains(store *s, store_terrain **terrains, int *count, char **error) {
    return store_read_terrains(s->db, terrains, count, error);
}

int store_begin_on(store *s, const store_terrain *t, char **error) {
    const int code = store_begin(s, error);
    bool writing;
    if (code != SQLITE_OK || version_of(s, &writing) == s->version) return code;
    store_end(s);
    return store_fail(error, SQLITE_BUSY, "terrain %s has just changed: ask again", t->name);
}

/* ------------------------------------------------------------------------------------------- statements */

int store_prepare(store *s, const store_terrain *t, sqlite3_stmt **out, char *sql, char **error) {
    if (!sql) return SQLITE_NOMEM;
    int code = sqlite3_prepare_v3(s->db, sql, -1, SQLITE_PREPARE_PERSISTENT, out, NULL);
    sqlite3_free(sql);
    if (code == SQLITE_OK) return code;
    char *doing = sqlite3_mprintf("terrain %s is damaged", t->name);
    code = doing ? store_fail_db(error, s->db, code, doing) : SQLITE_NOMEM;
    sqlite3_free(doing);
    return code;
}

statements *store_statements(store *s, const store_terrain *t) {
    return &s->statements[t - s->terrains];
}
