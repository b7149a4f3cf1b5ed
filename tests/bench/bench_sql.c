/* bench_sql.c - connections and statements of the benches: what fails ends the program with a sentence. */
#include "bench.h"

#include <sqlite3.h>
#include <stdlib.h>

_Noreturn void bench_stop(const char *what, const char *why) {
    fprintf(stderr, "bench: %s: %s\n", what, why);
    exit(1);
}

sqlite3 *bench_open(const char *path, const char *extension, bool writable) {
    sqlite3 *db = NULL;
    if (sqlite3_open_v2(path, &db, writable ? SQLITE_OPEN_READWRITE : SQLITE_OPEN_READONLY, NULL) != SQLITE_OK)
        bench_stop(path, sqlite3_errmsg(db));
    char *why = NULL;
    sqlite3_db_config(db, SQLITE_DBCONFIG_ENABLE_LOAD_EXTENSION, 1, NULL);
    if (sqlite3_load_extension(db, extension, NULL, &why) != SQLITE_OK) bench_stop(extension, why);
    return db;
}

sqlite3_stmt *bench_prepare(sqlite3 *db, const char *sql) {
    sqlite3_stmt *statement = NULL;
    if (sqlite3_prepare_v2(db, sql, -1, &statement, NULL) != SQLITE_OK) bench_stop(sql, sqlite3_errmsg(db));
    return statement;
}

int64_t bench_run(sqlite3_stmt *statement, int64_t *bytes) {
    int64_t rows = 0;
    int code;
    while ((code = sqlite3_step(statement)) == SQLITE_ROW)
        if (rows++ == 0 && bytes)
            *bytes = sqlite3_column_blob(statement, 0) ? sqlite3_column_bytes(statement, 0) : 0;
    if (code != SQLITE_DONE) bench_stop(sqlite3_sql(statement), sqlite3_errmsg(sqlite3_db_handle(statement)));
    sqlite3_reset(statement);
    return rows;
}
