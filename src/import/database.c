/* database.c - the SQLite file around an import.
 *
 * The probe, before a sample is read, finds everything that would make the end fail: no SQLite file, read-only,
 * locked, the terrain is there already. It writes nothing. The transaction begins only when the blocks are ready to
 * be written, so that other programs can write meanwhile, and it is one: BEGIN IMMEDIATE ... COMMIT.
 *
 * A file that we create has no readers, so a rollback journal is the cheapest. One that exists is put into WAL mode
 * for the import where that is possible, so that whoever reads it goes on reading, and back afterwards.
 */
#include "parts.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define BUSY_MILLISECONDS 3000

bool import_database_refuse(const import_job *job, int code, char *detail) {
    const char *path = job->database, *more = detail && *detail ? detail : sqlite3_errstr(code);
    switch (code & 0xFF) {
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
        import_refuse(job, "%s is locked: another program is reading or writing it (%s)", path, more);
        break;
    case SQLITE_READONLY:
        import_refuse(job, "%s is read-only (%s)", path, more);
        break;
    case SQLITE_FULL:
        import_refuse(job, "%s: the disk is full (%s)", path, more);
        break;
    case SQLITE_NOTADB:
        import_refuse(job, "%s is not an SQLite database", path);
        break;
    case SQLITE_CANTOPEN:
        import_refuse(job, "%s cannot be opened (%s)", path, more);
        break;
    case SQLITE_NOMEM:
        import_no_memory(job, "writing the database");
        break;
    default:
        import_refuse(job, "%s: %s", path, more);
    }
    sqlite3_free(detail);
    return false;
}

/* Run statements; a failure is refused with SQLite's own words. */
static bool run(const import_job *job, const import_database *d, const char *sql) {
    char *detail = NULL;
    int code = sqlite3_exec(d->db, sql, NULL, NULL, &detail);
    return code == SQLITE_OK || import_database_refuse(job, sqlite3_extended_errcode(d->db), detail);
}

static bool is_wal(sqlite3 *db) {
    sqlite3_stmt *statement = NULL;
    bool wal = sqlite3_prepare_v2(db, "PRAGMA journal_mode", -1, &statement, NULL) == SQLITE_OK &&
               sqlite3_step(statement) == SQLITE_ROW &&
               !sqlite3_stricmp((const char *)sqlite3_column_text(statement, 0), "wal");
    sqlite3_finalize(statement);
    return wal;
}

static bool open_file(const import_job *job, import_database *d, bool create) {
    int flags = SQLITE_OPEN_READWRITE | (create ? SQLITE_OPEN_CREATE : 0);
    int code = sqlite3_open_v2(job->database, &d->db, flags, NULL);
    if (code != SQLITE_OK) {
        char *detail = d->db ? sqlite3_mprintf("%s", sqlite3_errmsg(d->db)) : NULL;
        return import_database_refuse(job, code, detail);
    }
    sqlite3_extended_result_codes(d->db, 1);
    sqlite3_busy_timeout(d->db, BUSY_MILLISECONDS);
    if (sqlite3_db_readonly(d->db, "main") == 1) return import_refuse(job, "%s is read-only", job->database);
    return true;
}

/* A place where a file can be created. */
static bool probe_folder(const import_job *job) {
    const char *path = job->database, *slash = strrchr(path, '/');
    size_t length = slash ? (size_t)(slash - path) : 0;
    char *folder = length ? strndup(path, length) : strdup(slash ? "/" : ".");
    if (!folder) return import_no_memory(job, "opening the database");
    bool ok = access(folder, W_OK | X_OK) == 0;
    if (!ok) import_refuse(job, "%s cannot be created: %s", path, strerror(errno));
    free(folder);
    return ok;
}

static bool probe_terrain(const import_job *job, sqlite3 *db, const char *terrain) {
    store *s = NULL;
    store_terrain *terrains = NULL;
    int count = 0;
    char *detail = NULL;
    int code = store_open(db, &s);
    if (code == SQLITE_OK) code = store_terrains(s, &terrains, &count, &detail);
    bool ok = code == SQLITE_OK || import_database_refuse(job, code, detail);
    for (int i = 0; ok && i < count; i++)
        if (!strcmp(terrains[i].schema, "main") && !strcmp(terrains[i].name, terrain))
            ok = import_refuse(job,
                               "%s has a terrain '%s' already: --replace replaces it, --name gives another name",
                               job->database, terrain);
    if (code == SQLITE_OK) store_terrains_free(terrains, count);
    if (s) store_close(s);
    return ok;
}

bool import_database_probe(const import_job *job, const char *terrain) {
    const char *path = job->database;
    import_database d = {0};
    struct stat file;
    if (!*path || !strcmp(path, ":memory:"))
        return import_refuse(job, "'%s' is not the name of a file: an import goes into a database file", path);
    if (stat(path, &file))
        return errno == ENOENT ? probe_folder(job) : import_refuse(job, "%s: %s", path, strerror(errno));
    if (S_ISDIR(file.st_mode)) return import_refuse(job, "%s is a folder and not a database", path);
    /* BEGIN IMMEDIATE finds out about locks; the look at the schema, about files that are something else. */
    bool ok = open_file(job, &d, false) && run(job, &d, "SELECT count(*) FROM sqlite_master; BEGIN IMMEDIATE");
    if (ok && !job->options->replace) ok = probe_terrain(job, d.db, terrain);
    if (d.db && !sqlite3_get_autocommit(d.db)) sqlite3_exec(d.db, "ROLLBACK", NULL, NULL, NULL);
    sqlite3_close(d.db);
    return ok;
}

/* Bytes of a page in a new file, for what blocks of this k weigh. Up to 33^2 samples that is less than 1 KB: many
 * share a large page. 65^2 are 1 to 3 KB, several to a page. 129^2 are 4 to 12 KB and take whole pages, of which
 * the last is half empty: so small ones (seven DEMs: 8.56 MB with 2 KB, 9.15 with 4, 12.3 with 16; a query takes
 * the same time). */
static int page_bytes(int k) {
    return k > 6 ? 2048 : k == 6 ? 8192 : 16384;
}

bool import_database_begin(const import_job *job, int k, int64_t page_cache, import_database *d) {
    struct stat file;
    bool there = stat(job->database, &file) == 0;
    *d = (import_database){.created = !there};
    if (!open_file(job, d, true)) return false;
    char sql[200];
    snprintf(sql, sizeof sql, "PRAGMA cache_size = -%lld; PRAGMA synchronous = NORMAL",
             (long long)(page_cache / 1024));
    if (!run(job, d, sql)) return false;
    if (!there || file.st_size == 0) {
        char page_size[40];
        snprintf(page_size, sizeof page_size, "PRAGMA page_size = %d", page_bytes(k));
        if (!run(job, d, page_size)) return false;
    } else if (!is_wal(d->db)) {
        /* Fails, harmlessly, while somebody is reading. (Who has the database open at the end keeps it in WAL
         * mode.) */
        sqlite3_exec(d->db, "PRAGMA journal_mode = WAL", NULL, NULL, NULL);
        d->made_wal = is_wal(d->db);
    }
    if (!run(job, d, "BEGIN IMMEDIATE")) return false;
    char *detail = NULL;
    int code = store_make_geopackage(d->db, &detail);
    return code == SQLITE_OK || import_database_refuse(job, code, detail);
}

bool import_database_change(const import_job *job, import_database *d) {
    struct stat file;
    *d = (import_database){0};
    if (stat(job->database, &file)) return import_refuse(job, "%s: %s", job->database, strerror(errno));
    if (S_ISDIR(file.st_mode)) return import_refuse(job, "%s is a folder and not a database", job->database);
    return open_file(job, d, false) && run(job, d, "SELECT count(*) FROM sqlite_master; BEGIN IMMEDIATE");
}

bool import_database_commit(const import_job *job, import_database *d) {
    if (!run(job, d, "COMMIT")) return false;
    d->created = false;
    return true;
}

void import_database_close(const import_job *job, import_database *d) {
    if (d->db) {
        if (!sqlite3_get_autocommit(d->db)) sqlite3_exec(d->db, "ROLLBACK", NULL, NULL, NULL);
        if (d->made_wal) {
            sqlite3_exec(d->db, "PRAGMA wal_checkpoint(TRUNCATE)", NULL, NULL, NULL);
            sqlite3_exec(d->db, "PRAGMA journal_mode = DELETE", NULL, NULL, NULL);
        }
        sqlite3_close(d->db);
    }
    if (d->created) {
        static const char *const parts[] = {"", "-journal", "-wal", "-shm"};
        for (size_t i = 0; i < sizeof parts / sizeof *parts; i++) {
            char name[4096 + 16]; /* no longer than what could be created; memory may be what is missing */
            const int n = snprintf(name, sizeof name, "%s%s", job->database, parts[i]);
            if (n > 0 && (size_t)n < sizeof name) unlink(name);
        }
    }
    *d = (import_database){0};
}
