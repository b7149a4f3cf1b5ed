/* sqlite.h - the one way to SQLite. In rqt.so every call goes through the table that the host hands over
 * (sqlite3ext.h), because a host may carry an SQLite of its own; in the rqt command (SQLITE_CORE) it is a plain
 * call. */
#ifndef RQT_SQLITE_H
#define RQT_SQLITE_H

#include <sqlite3ext.h>
#ifndef SQLITE_CORE
extern const sqlite3_api_routines *sqlite3_api;
#endif

#endif
