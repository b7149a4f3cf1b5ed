/* database.c - a worker's connection to one database.
 *
 * Every request is answered inside one read transaction. Before it the path is looked at: another file there, or
 * the same one with another size or time, is opened anew, so that a database may be replaced by a rename, or even
 * overwritten, under a running service. A connection that has met damage is not used again either.
 *
 * The state of a database, of which entity tags are made, is what SQLite itself knows it by, and all workers see
 * the same: device and inode; the file's size and time; the change counter in its header, which every transaction
 * raises (FORMAT of SQLite, 1.3.7); and in WAL mode the header of the wal-index, which counts transactions and
 * holds a checksum over all frames of the log (2.4 there). The counter is read through SQLite's own file handle: a
 * second one, closed, would take the locks of the first with it. With a rollback journal the file cannot change
 * while we read. In WAL mode it can, so the state counts only if it was the same before the transaction began and
 * after.
 */
#include "internal.h"

#include "rqt_extension.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_STATEMENTS = 24, BUSY_MILLISECONDS = 2000, TRIES = 8 };
/* VM instructions between two looks at the clock; the walk over a mesh runs some at every block. */
enum { CLOCK_INTERVAL = 50 };
/* Bytes of SQLite's file header up to the change counter's end; of the wal-index's. */
enum { HEADER_BYTES = 28, HEADER_COUNTER = 24, HEADER_READ_VERSION = 19, WAL_VERSION = 2, INDEX_BYTES = 48 };
enum { INDEX_REGION = 32768 };

struct database {
    const service *service;
    const char *path, *label;
    sqlite3 *db;  /* NULL: not open */
    tiles *tiles; /* NULL: nobody has asked for one */
    struct stat file;
    uint64_t state; /* the last one seen; 0: none */
    bool is_damaged;
    double deadline;
    struct {
        const char *sql;
        sqlite3_stmt *statement;
    } kept[MOST_STATEMENTS];
    int kept_count;
};

static void close_database(database *d) {
    for (int i = 0; i < d->kept_count; i++) sqlite3_finalize(d->kept[i].statement);
    d->kept_count = 0;
    tiles_close(d->tiles);
    d->tiles = NULL;
    sqlite3_close(d->db);
    d->db = NULL;
    d->state = 0;
    d->is_damaged = false;
}

/* By the time of the last change, which nobody can set back as that of the last writing can be. */
static bool is_same_file(const struct stat *a, const struct stat *b) {
    return a->st_dev == b->st_dev && a->st_ino == b->st_ino && a->st_size == b->st_size &&
           a->st_ctim.tv_sec == b->st_ctim.tv_sec && a->st_ctim.tv_nsec == b->st_ctim.tv_nsec;
}

static int is_late(void *context) {
    const database *d = context;
    return now_seconds() > d->deadline || pool_is_hurried(d->service->pool);
}

/* The answers of this connection are of no more than so much. */
static int set_limits(database *d) {
    const serve_options *most = &d->service->options;
    sqlite3_stmt *limit = NULL;
    int code =
        sqlite3_prepare_v2(d->db, "SELECT rqt_limit('triangles', ?1), rqt_limit('samples', ?2)", -1, &limit, NULL);
    if (code != SQLITE_OK) return code;
    sqlite3_bind_int64(limit, 1, most->max_triangles);
    sqlite3_bind_int64(limit, 2, most->max_samples);
    code = sqlite3_step(limit);
    sqlite3_finalize(limit);
    return code == SQLITE_ROW ? SQLITE_OK : code;
}

static int configure(database *d) {
    const int64_t bytes = d->service->options.max_bytes;
    sqlite3_busy_timeout(d->db, BUSY_MILLISECONDS);
    sqlite3_db_config(d->db, SQLITE_DBCONFIG_DEFENSIVE, 1, NULL);
    sqlite3_db_config(d->db, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, NULL);
    sqlite3_limit(d->db, SQLITE_LIMIT_LENGTH, bytes < INT32_MAX ? (int)bytes : INT32_MAX);
    sqlite3_limit(d->db, SQLITE_LIMIT_ATTACHED, 0);
    sqlite3_progress_handler(d->db, CLOCK_INTERVAL, is_late, d);
    int code = sqlite3_exec(d->db, "PRAGMA cell_size_check = 1", NULL, NULL, NULL);
    if (code == SQLITE_OK) code = sqlite3_rqt_init(d->db, NULL, NULL);
    if (code == SQLITE_OK) code = set_limits(d);
    return code;
}

/* False: why is the answer. */
static bool open_database(database *d, request *r) {
    struct stat after;
    int code = SQLITE_CANTOPEN;
    /* Which file it is that was opened: the one that is there before and after. */
    for (int i = 0; i < TRIES; i++) {
        if (stat(d->path, &d->file)) {
            answer_problem(r, MHD_HTTP_INTERNAL_SERVER_ERROR, "the database %s: %s", d->label, strerror(errno));
            return false;
        }
        code = sqlite3_open_v2(d->path, &d->db, SQLITE_OPEN_READONLY | SQLITE_OPEN_NOMUTEX, NULL);
        if (code == SQLITE_OK) code = configure(d);
        if (code != SQLITE_OK || (stat(d->path, &after) == 0 && is_same_file(&d->file, &after))) break;
        close_database(d);
        code = SQLITE_BUSY; /* it changes all the time */
    }
    if (code == SQLITE_OK && d->db) return true;
    answer_failure(r, code, d->db ? sqlite3_errmsg(d->db) : sqlite3_errstr(code));
    close_database(d);
    return false;
}

/* FNV-1a. */
static uint64_t add_to_hash(uint64_t hash, const void *bytes, size_t size) {
    for (const unsigned char *p = bytes, *end = p + size; p < end; p++)
        /* The analyser loses the second byte of an integer.
         * NOLINTNEXTLINE(clang-analyzer-core.UndefinedBinaryOperatorResult) */
        hash = (hash ^ *p) * 0x100000001B3u;
    return hash;
}

/* 0: not known. */
static uint64_t read_state(const database *d, bool *is_wal) {
    const int64_t file[] = {(int64_t)d->file.st_dev, (int64_t)d->file.st_ino, (int64_t)d->file.st_size,
                            (int64_t)d->file.st_ctim.tv_sec, (int64_t)d->file.st_ctim.tv_nsec};
    uint64_t hash = add_to_hash(0xCBF29CE484222325u, file, sizeof file);
    unsigned char header[HEADER_BYTES];
    sqlite3_file *handle = NULL;
    *is_wal = false;
    if (sqlite3_file_control(d->db, "main", SQLITE_FCNTL_FILE_POINTER, &handle) != SQLITE_OK || !handle->pMethods ||
        handle->pMethods->xRead(handle, header, HEADER_BYTES, 0) != SQLITE_OK)
        return 0;
    hash = add_to_hash(hash, header + HEADER_COUNTER, HEADER_BYTES - HEADER_COUNTER);
    *is_wal = header[HEADER_READ_VERSION] == WAL_VERSION;
    if (*is_wal) {
        void volatile *region = NULL;
        unsigned char index[INDEX_BYTES] = {0};
        if (handle->pMethods->iVersion < 2 ||
            handle->pMethods->xShmMap(handle, 0, INDEX_REGION, 0, &region) != SQLITE_OK || !region)
            return 0;
        for (int i = 0; i < INDEX_BYTES; i++) index[i] = ((volatile unsigned char *)region)[i];
        hash = add_to_hash(hash, index, INDEX_BYTES);
    }
    return hash ? hash : 1;
}

/* Begins, and reads, so that the state is settled. */
static int begin_reading(database *d) {
    int code = sqlite3_exec(d->db, "BEGIN", NULL, NULL, NULL);
    if (code == SQLITE_OK) code = sqlite3_exec(d->db, "SELECT 1 FROM sqlite_schema LIMIT 1", NULL, NULL, NULL);
    return code;
}

bool database_begin(database *d, request *r, uint64_t *state) {
    struct stat now;
    *state = 0;
    if (d->db && (d->is_damaged || stat(d->path, &now) || !is_same_file(&now, &d->file))) close_database(d);
    if (!d->db && !open_database(d, r)) return false;
    for (int i = 0; i < TRIES; i++) {
        bool is_wal;
        const int code = begin_reading(d);
        if (code != SQLITE_OK) {
            answer_failure(r, code, d->db ? sqlite3_errmsg(d->db) : sqlite3_errstr(code));
            close_database(d);
            return false;
        }
        const uint64_t before = d->state;
        d->state = read_state(d, &is_wal);
        if (!is_wal || (d->state && d->state == before)) {
            *state = d->state;
            return true;
        }
        if (i < TRIES - 1) database_end(d);
    }
    return true;
}

void database_end(database *d) {
    if (!d->db) return;
    for (int i = 0; i < d->kept_count; i++) {
        sqlite3_reset(d->kept[i].statement);
        sqlite3_clear_bindings(d->kept[i].statement);
    }
    if (!sqlite3_get_autocommit(d->db)) sqlite3_exec(d->db, "COMMIT", NULL, NULL, NULL);
    if (d->is_damaged) close_database(d);
}

sqlite3_stmt *database_prepare(database *d, request *r, const char *sql) {
    for (int i = 0; i < d->kept_count; i++)
        if (d->kept[i].sql == sql) return d->kept[i].statement;
    if (d->kept_count == MOST_STATEMENTS) sqlite3_finalize(d->kept[--d->kept_count].statement);
    sqlite3_stmt *statement = NULL;
    const int code = sqlite3_prepare_v3(d->db, sql, -1, SQLITE_PREPARE_PERSISTENT, &statement, NULL);
    if (code != SQLITE_OK) {
        database_failed(d, r, code, NULL);
        return NULL;
    }
    d->kept[d->kept_count].sql = sql;
    d->kept[d->kept_count++].statement = statement;
    return statement;
}

sqlite3 *database_handle(database *d) {
    return d->db;
}

void database_failed(database *d, request *r, int code, const char *sentence) {
    answer_failure(r, code, sentence ? sentence : sqlite3_errmsg(d->db));
    /* Also where memory ran out: what the connection keeps of blocks goes with it. */
    d->is_damaged = r->answer.status == MHD_HTTP_INTERNAL_SERVER_ERROR || (code & 0xFF) == SQLITE_NOMEM;
}

tiles *database_tiles(database *d, request *r) {
    const int code = d->tiles ? SQLITE_OK : tiles_open(d->db, &d->tiles);
    if (code == SQLITE_OK)
        tiles_limit(d->tiles, d->service->options.max_triangles);
    else
        database_failed(d, r, code, NULL);
    return d->tiles;
}

const char *database_label(const database *d) {
    return d->label;
}

database *databases_create(const service *s) {
    const int count = s->options.database_count;
    database *all = calloc((size_t)count, sizeof *all);
    for (int i = 0; all && i < count; i++) {
        const char *path = s->options.databases[i], *slash = strrchr(path, '/');
        all[i] = (database){.service = s, .path = path, .label = slash ? slash + 1 : path};
    }
    return all;
}

database *databases_at(database *all, int i) {
    return &all[i];
}

void databases_deadline(database *all, int count, double deadline) {
    for (int i = 0; i < count; i++) all[i].deadline = deadline;
}

void databases_free(database *all, int count) {
    for (int i = 0; all && i < count; i++) close_database(&all[i]);
    free(all);
}
