/* limit.c - rqt_limit: bounds for the answers of a connection, as sqlite3_limit has them for SQLite's own work. */
#include "functions.h"

#include <string.h>

/* SQLITE_OK, and in *limit where it is kept. */
static int find_limit(store *s, sqlite3_value *name, int64_t **limit, char **error) {
    const char *text = sqlite3_value_type(name) == SQLITE_TEXT ? (const char *)sqlite3_value_text(name) : NULL;
    store_limits *all = store_limits_of(s);
    if (text && strcmp(text, "triangles") == 0)
        *limit = &all->triangles;
    else if (text && strcmp(text, "samples") == 0)
        *limit = &all->samples;
    else
        return fail(error, "name must be triangles or samples");
    return SQLITE_OK;
}

void call_limit(sqlite3_context *result, int count, sqlite3_value **arguments) {
    connection *c = sqlite3_user_data(result);
    char *error = NULL;
    store *s;
    int64_t *limit = NULL, before = 0;
    int code = connection_store(c, &s, &error);
    if (code == SQLITE_OK) {
        code = find_limit(s, arguments[0], &limit, &error);
        if (code == SQLITE_OK && count > 1 &&
            (sqlite3_value_type(arguments[1]) != SQLITE_INTEGER || sqlite3_value_int64(arguments[1]) < 0))
            code = fail(&error, "most must be an integer of 0 or more");
        if (code == SQLITE_OK) before = *limit;
        if (code == SQLITE_OK && count > 1) *limit = sqlite3_value_int64(arguments[1]);
        connection_done(c);
    }
    if (code == SQLITE_OK)
        sqlite3_result_int64(result, before);
    else
        scalar_error(result, "rqt_limit", code, error);
}
