/* limit.c - rqt_limit: bounds for the answers of a connection, as sqlite3_limit has them for SQLite's own work. */
#include "functions.h"

#include <string.h>

/* NULL after a sentence. */
static int64_t *find_limit(store *s, sqlite3_value *name, char **error) {
    const char *text = sqlite3_value_type(name) == SQLITE_TEXT ? (const char *)sqlite3_value_text(name) : NULL;
    store_limits *all = store_limits_of(s);
    if (text && strcmp(text, "triangles") == 0) return &all->triangles;
    if (text && strcmp(text, "samples") == 0) return &all->samples;
    (void)fail(error, "name must be triangles or samples");
    return NULL;
}

/* most: NULL when it is not given. */
static int change_limit(store *s, sqlite3_value *name, sqlite3_value *most, int64_t *before, char **error) {
    int64_t *limit = find_limit(s, name, error);
    if (!limit) return *error ? SQLITE_ERROR : SQLITE_NOMEM;
    *before = *limit;
    if (!most) return SQLITE_OK;
    if (sqlite3_value_type(most) != SQLITE_INTEGER || sqlite3_value_int64(most) < 0)
        return fail(error, "most must be an integer of 0 or more");
    *limit = sqlite3_value_int64(most);
    return SQLITE_OK;
}

void call_limit(sqlite3_context *result, int count, sqlite3_value **arguments) {
    connection *c = sqlite3_user_data(result);
    char *error = NULL;
    store *s;
    int64_t before = 0;
    int code = connection_store(c, &s, &error);
    if (code == SQLITE_OK) {
        code = change_limit(s, arguments[0], count > 1 ? arguments[1] : NULL, &before, &error);
        connection_done(c);
    }
    if (code == SQLITE_OK)
        sqlite3_result_int64(result, before);
    else
        scalar_error(result, "rqt_limit", code, error);
}
