/* internal.h - what the files of the store share: sentences, and the rows of rqt_terrain. */
#ifndef RQT_STORE_INTERNAL_H
#define RQT_STORE_INTERNAL_H

#include "store.h"

#include <stdarg.h>

/* Set *error to a sentence and return code (SQLITE_NOMEM when there is no memory for the sentence). */
int store_fail(char **error, int code, const char *format, ...);
/* The same out of the connection's last error: "doing: what SQLite says". */
int store_fail_db(char **error, sqlite3 *db, int code, const char *doing);

/* All terrains of all databases of the connection. terrain.c */
int store_read_terrains(sqlite3 *db, store_terrain **terrains, int *count, char **error);
/* A new row with complete = 0. terrain.c */
int store_insert_terrain(sqlite3 *db, const store_terrain *t, int64_t *id, char **error);

sqlite3 *store_connection(const store *s);
/* A sentence for a status of the core. */
int store_fail_core(char **error, rqt_status status, const char *doing);

#endif
