/* connection.c - what rqt keeps per connection, and how it lets the connection close.
 *
 * The store keeps prepared statements, and sqlite3_close refuses while there are any. SQLite disconnects virtual
 * tables before it looks, so the statements belong to one of ours, rqt_terrains: as long as it is connected they
 * may stay, and when it is disconnected they go. A scalar function that comes first connects it by preparing a
 * statement on it.
 */
#include "functions.h"

#include <stdarg.h>

struct connection {
    sqlite3 *db;
    store *store;
    places *kept;       /* NULL: none */
    known_views *views; /* NULL: none */
    int holders;
    bool owned; /* rqt_terrains is connected */
    bool busy;  /* a call of ours is under way */
};

connection *connection_create(sqlite3 *db) {
    connection *c = sqlite3_malloc(sizeof *c);
    if (!c) return NULL;
    *c = (connection){.db = db, .holders = 1};
    return c;
}

sqlite3 *connection_db(const connection *c) {
    return c->db;
}

places **connection_places(connection *c) {
    return &c->kept;
}

known_views **connection_views(connection *c) {
    return &c->views;
}

void connection_hold(connection *c) {
    c->holders++;
}

void connection_release(void *p) {
    connection *c = p;
    if (--c->holders > 0) return;
    places_release(c->kept);
    known_views_free(c->views);
    store_close(c->store);
    sqlite3_free(c);
}

void connection_owner(connection *c, bool owned) {
    c->owned = owned;
    if (!owned && c->store) store_release(c->store);
}

int connection_store(connection *c, store **s, char **error) {
    /* Arguments are worked out before a call begins, so calls never overlap, unless a table of a terrain or
     * of detail is really a view that calls us back: it would run the very statements that are running. */
    if (c->busy) return fail(error, "rqt is already at work: a table that it reads is a view that calls rqt");
    if (!c->store) {
        const int code = store_open(c->db, &c->store);
        if (code != SQLITE_OK) return code;
    }
    if (!c->owned) {
        sqlite3_stmt *connects = NULL;
        const int code = sqlite3_prepare_v2(c->db, "SELECT 1 FROM rqt_terrains WHERE 0", -1, &connects, NULL);
        sqlite3_finalize(connects);
        if ((code & 0xFF) == SQLITE_NOMEM) return SQLITE_NOMEM;
    }
    const int code = store_begin(c->store, error);
    if (code != SQLITE_OK) return code;
    *s = c->store;
    c->busy = true;
    return SQLITE_OK;
}

void connection_done(connection *c) {
    c->busy = false;
    store_end(c->store);
    if (!c->owned) store_release(c->store);
}

int fail(char **error, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    char *text = sqlite3_vmprintf(format, arguments);
    va_end(arguments);
    sqlite3_free(*error);
    *error = text;
    return text ? SQLITE_ERROR : SQLITE_NOMEM;
}
