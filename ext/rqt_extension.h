/* rqt_extension.h - the one door of rqt.so, for SQLite's loader and for programs that link the extension in. */
#ifndef RQT_EXTENSION_H
#define RQT_EXTENSION_H

#include "sqlite.h"

#ifdef __cplusplus
extern "C" {
#endif
/* Registers every function of functions.c in db. In a program that links it: api NULL. */
#ifdef _WIN32
__declspec(dllexport)
#else
__attribute__((visibility("default")))
#endif
    int sqlite3_rqt_init(sqlite3 *db, char **error, const sqlite3_api_routines *api);
#ifdef __cplusplus
}
#endif
#endif
