/* rqt_extension.c - the entry point: registers the table of functions.c. */
#include "rqt_extension.h"

#include "functions.h"

#ifndef SQLITE_CORE
SQLITE_EXTENSION_INIT1
#endif

static int register_scalar(connection *c, const function *f) {
    int code = SQLITE_OK;
    for (int n = f->least; n <= f->most && code == SQLITE_OK; n++) {
        connection_hold(c);
        code = sqlite3_create_function_v2(connection_db(c), f->name, n, SQLITE_UTF8 | f->flags, c, f->call, NULL,
                                          NULL, connection_release);
    }
    return code;
}

int sqlite3_rqt_init(sqlite3 *db, char **error, const sqlite3_api_routines *api) {
#ifndef SQLITE_CORE
    SQLITE_EXTENSION_INIT2(api);
#else
    (void)api;
#endif
    if (sqlite3_libversion_number() < 3039000) {
        if (error)
            *error = sqlite3_mprintf("rqt needs SQLite 3.39 or newer; this program has %s", sqlite3_libversion());
        return SQLITE_ERROR;
    }
    connection *c = connection_create(db);
    if (!c) return SQLITE_NOMEM;
    int code = SQLITE_OK;
    for (int i = 0; i < rqt_function_count && code == SQLITE_OK; i++)
        code = rqt_functions[i].call ? register_scalar(c, &rqt_functions[i]) : table_register(c, &rqt_functions[i]);
    connection_release(c);
    if (code != SQLITE_OK && error) *error = sqlite3_mprintf("rqt: %s", sqlite3_errmsg(db));
    return code;
}
