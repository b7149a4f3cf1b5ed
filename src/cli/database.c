/* database.c - the connection: opened read-only, with the SQL functions, and its failures as sentences.
 *
 * The functions are linked in, not loaded: the same sources as rqt.so, compiled for plain calls of SQLite, so the
 * command works where loading extensions is not allowed.
 */
#include "cli.h"
#include "rqt_extension.h"

#include <errno.h>
#include <string.h>
#include <sys/stat.h>

/* A writer (an import, say) holds its lock for moments only. */
#define BUSY_MILLISECONDS 5000

/* "rqt_mesh(): eps ..." names the SQL function; who typed a command knows only the command. */
static const char *without_function(const char *text) {
    if (strncmp(text, "rqt_", 4) != 0) return text;
    const size_t name = strspn(text, "abcdefghijklmnopqrstuvwxyz_");
    return strncmp(text + name, "(): ", 4) ? text : text + name + 4;
}

int cli_fail_database(sqlite3 *db) {
    return cli_fail("%s", without_function(sqlite3_errmsg(db)));
}

int cli_fail_store(int code, char *sentence) {
    cli_fail("%s", sentence ? without_function(sentence) : sqlite3_errstr(code));
    sqlite3_free(sentence);
    return CLI_FAILED;
}

static int open_with(const char *path, int flags, sqlite3 **db) {
    const int code = sqlite3_open_v2(path, db, flags, NULL);
    if (code != SQLITE_OK) return code;
    sqlite3_busy_timeout(*db, BUSY_MILLISECONDS);
    /* The first look into the file: it finds out whether it is a database at all. */
    return sqlite3_exec(*db, "SELECT count(*) FROM sqlite_schema", NULL, NULL, NULL);
}

sqlite3 *cli_open(const char *path) {
    struct stat file;
    sqlite3 *db = NULL;
    char *sentence = NULL;
    if (stat(path, &file)) {
        cli_fail("%s: %s", path, strerror(errno));
        return NULL;
    }
    if (S_ISDIR(file.st_mode)) {
        cli_fail("%s is a folder and not a database", path);
        return NULL;
    }
    int code = open_with(path, SQLITE_OPEN_READONLY, &db);
    if (code == SQLITE_READONLY) {
        /* An import was killed while it wrote a new file: its journal is to be rolled back first, which takes a
         * connection that may write. */
        sqlite3_close(db);
        code = open_with(path, SQLITE_OPEN_READWRITE, &db);
        if (code == SQLITE_OK) code = sqlite3_exec(db, "PRAGMA query_only = 1", NULL, NULL, NULL);
    }
    if (code != SQLITE_OK) {
        if (code == SQLITE_NOTADB)
            cli_fail("%s is not an SQLite database", path);
        else
            cli_fail("%s: %s", path, db ? sqlite3_errmsg(db) : sqlite3_errstr(code));
    } else {
        code = sqlite3_rqt_init(db, &sentence, NULL);
        if (code != SQLITE_OK) cli_fail("%s", sentence ? sentence : sqlite3_errmsg(db));
        sqlite3_free(sentence);
    }
    if (code == SQLITE_OK) return db;
    sqlite3_close(db);
    return NULL;
}

bool cli_execute(sqlite3 *db, const char *sql) {
    if (sqlite3_exec(db, sql, NULL, NULL, NULL) == SQLITE_OK) return true;
    cli_fail_database(db);
    return false;
}

sqlite3_stmt *cli_prepare(sqlite3 *db, const char *sql) {
    sqlite3_stmt *statement = NULL;
    if (sqlite3_prepare_v2(db, sql, -1, &statement, NULL) != SQLITE_OK) cli_fail_database(db);
    return statement;
}

void cli_bind_query(sqlite3_stmt *statement, const char *region, double eps, const char *terrain) {
    sqlite3_bind_text(statement, 1, region, -1, SQLITE_STATIC);
    sqlite3_bind_double(statement, 2, eps);
    sqlite3_bind_text(statement, 3, terrain, -1, SQLITE_STATIC);
}

bool cli_find_terrain(sqlite3 *db, const char *name, store **s, const store_terrain **terrain) {
    char *sentence = NULL;
    *s = NULL;
    int code = store_open(db, s);
    if (code == SQLITE_OK) code = store_find(*s, name, terrain, &sentence);
    if (code == SQLITE_OK) return true;
    cli_fail_store(code, sentence);
    if (*s) store_close(*s);
    *s = NULL;
    return false;
}

bool cli_verify(sqlite3 *db, const char *region, double eps, const char *terrain, const char *options,
                picture_proof *proof) {
    char *sentence = NULL;
    const int code = picture_proof_read(db, region, eps, terrain, options, proof, &sentence);
    return code == SQLITE_OK || cli_fail_store(code, sentence) == CLI_OK;
}
