/* fault_vfs.h - a shim over SQLite's own file system in which the n-th call fails, once or from then on.
 *
 * Each call of the file system that can fail is counted, and the one that is chosen fails with the code that
 * SQLite's own file system would give: without having been made, as when the disk says no. In the other way of
 * failing, writing finds a full disk and locks are taken by somebody else; calls that know no such thing succeed.
 * Waiting for a lock takes no time. Memory mapping is left out, so that all reading passes here. One thread at a
 * time.
 *
 *   fault_vfs_install();  every connection opened from then on
 *   fault_vfs_begin(n, later, softly);  work;  fault_vfs_end();
 *   fault_vfs.hits: how often it failed; 0: n is past the last call */
#ifndef FAULT_VFS_H
#define FAULT_VFS_H

#include <sqlite3.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

static struct fault_vfs {
    sqlite3_vfs shim, *real;
    bool on, later, softly;
    long count, at, hits;
    const char *call; /* the first that failed */
} fault_vfs;

static inline void fault_vfs_begin(long n, bool later, bool softly) {
    fault_vfs.at = n;
    fault_vfs.later = later;
    fault_vfs.softly = softly;
    fault_vfs.count = fault_vfs.hits = 0;
    fault_vfs.call = "";
    fault_vfs.on = true;
}

static inline void fault_vfs_end(void) {
    fault_vfs.on = false;
}

/* The code that this call is to fail with, or SQLITE_OK. soft SQLITE_OK: cannot fail softly, and is not counted
 * then. */
static inline int fault_vfs_next(const char *call, int hard, int soft) {
    struct fault_vfs *f = &fault_vfs;
    if (!f->on || (f->softly && soft == SQLITE_OK)) return SQLITE_OK;
    f->count++;
    if (f->later ? f->count < f->at : f->count != f->at) return SQLITE_OK;
    if (f->hits++ == 0) f->call = call;
    return f->softly ? soft : hard;
}

/* ------------------------------------------------------------------------------------------------ one file */
typedef struct fault_file {
    sqlite3_file base;
    sqlite3_file *real;
    bool spared;
} fault_file;

static inline bool fault_spares(const char *name) {
    const size_t n = name ? strlen(name) : 0;
    return n >= 8 && strncmp(name + n - 8, "/proj.db", 8) == 0;
}

#define REAL(file) ((fault_file *)(file))->real
#define FAULT_METHOD(name, hard, soft, parameters, arguments)                                       \
    static int fault_##name parameters {                                                            \
        const int code = ((fault_file *)f)->spared ? SQLITE_OK : fault_vfs_next(#name, hard, soft); \
        return code != SQLITE_OK ? code : REAL(f)->pMethods->name arguments;                        \
    }

FAULT_METHOD(xRead, SQLITE_IOERR_READ, SQLITE_OK, (sqlite3_file * f, void *p, int n, sqlite3_int64 at),
             (REAL(f), p, n, at))
FAULT_METHOD(xWrite, SQLITE_IOERR_WRITE, SQLITE_FULL, (sqlite3_file * f, const void *p, int n, sqlite3_int64 at),
             (REAL(f), p, n, at))
FAULT_METHOD(xTruncate, SQLITE_IOERR_TRUNCATE, SQLITE_FULL, (sqlite3_file * f, sqlite3_int64 size), (REAL(f), size))
FAULT_METHOD(xSync, SQLITE_IOERR_FSYNC, SQLITE_FULL, (sqlite3_file * f, int flags), (REAL(f), flags))
FAULT_METHOD(xFileSize, SQLITE_IOERR_FSTAT, SQLITE_OK, (sqlite3_file * f, sqlite3_int64 *size), (REAL(f), size))
FAULT_METHOD(xLock, SQLITE_IOERR_LOCK, SQLITE_BUSY, (sqlite3_file * f, int lock), (REAL(f), lock))
FAULT_METHOD(xUnlock, SQLITE_IOERR_UNLOCK, SQLITE_OK, (sqlite3_file * f, int lock), (REAL(f), lock))
FAULT_METHOD(xCheckReservedLock, SQLITE_IOERR_CHECKRESERVEDLOCK, SQLITE_BUSY, (sqlite3_file * f, int *out),
             (REAL(f), out))
FAULT_METHOD(xShmMap, SQLITE_IOERR_SHMMAP, SQLITE_FULL,
             (sqlite3_file * f, int page, int size, int extend, void volatile **out),
             (REAL(f), page, size, extend, out))
FAULT_METHOD(xShmLock, SQLITE_IOERR_SHMLOCK, SQLITE_BUSY, (sqlite3_file * f, int from, int n, int flags),
             (REAL(f), from, n, flags))

static int fault_xClose(sqlite3_file *f) {
    return REAL(f)->pMethods ? REAL(f)->pMethods->xClose(REAL(f)) : SQLITE_OK;
}
static int fault_xFileControl(sqlite3_file *f, int op, void *argument) {
    return REAL(f)->pMethods->xFileControl(REAL(f), op, argument);
}
static int fault_xSectorSize(sqlite3_file *f) {
    return REAL(f)->pMethods->xSectorSize(REAL(f));
}
static int fault_xDeviceCharacteristics(sqlite3_file *f) {
    return REAL(f)->pMethods->xDeviceCharacteristics(REAL(f));
}
static void fault_xShmBarrier(sqlite3_file *f) {
    REAL(f)->pMethods->xShmBarrier(REAL(f));
}
static int fault_xShmUnmap(sqlite3_file *f, int remove) {
    return REAL(f)->pMethods->xShmUnmap(REAL(f), remove);
}

/* ------------------------------------------------------------------------------------------ the file system */
static int fault_xOpen(sqlite3_vfs *vfs, sqlite3_filename name, sqlite3_file *file, int flags, int *out) {
    static const sqlite3_io_methods methods = {.iVersion = 2,
                                               .xClose = fault_xClose,
                                               .xRead = fault_xRead,
                                               .xWrite = fault_xWrite,
                                               .xTruncate = fault_xTruncate,
                                               .xSync = fault_xSync,
                                               .xFileSize = fault_xFileSize,
                                               .xLock = fault_xLock,
                                               .xUnlock = fault_xUnlock,
                                               .xCheckReservedLock = fault_xCheckReservedLock,
                                               .xFileControl = fault_xFileControl,
                                               .xSectorSize = fault_xSectorSize,
                                               .xDeviceCharacteristics = fault_xDeviceCharacteristics,
                                               .xShmMap = fault_xShmMap,
                                               .xShmLock = fault_xShmLock,
                                               .xShmBarrier = fault_xShmBarrier,
                                               .xShmUnmap = fault_xShmUnmap};
    (void)vfs;
    fault_file *f = (fault_file *)file;
    f->base.pMethods = NULL;
    f->real = (sqlite3_file *)(f + 1);
    f->spared = fault_spares(name);
    int code = f->spared ? SQLITE_OK : fault_vfs_next("xOpen", SQLITE_CANTOPEN, SQLITE_OK);
    if (code != SQLITE_OK) return code;
    code = fault_vfs.real->xOpen(fault_vfs.real, name, f->real, flags, out);
    if (f->real->pMethods) f->base.pMethods = &methods;
    return code;
}
static int fault_xDelete(sqlite3_vfs *vfs, const char *name, int sync) {
    (void)vfs;
    const int code = fault_spares(name) ? SQLITE_OK : fault_vfs_next("xDelete", SQLITE_IOERR_DELETE, SQLITE_OK);
    return code != SQLITE_OK ? code : fault_vfs.real->xDelete(fault_vfs.real, name, sync);
}
static int fault_xAccess(sqlite3_vfs *vfs, const char *name, int flags, int *out) {
    (void)vfs;
    const int code = fault_spares(name) ? SQLITE_OK : fault_vfs_next("xAccess", SQLITE_IOERR_ACCESS, SQLITE_OK);
    return code != SQLITE_OK ? code : fault_vfs.real->xAccess(fault_vfs.real, name, flags, out);
}
static int fault_xFullPathname(sqlite3_vfs *vfs, const char *name, int n, char *out) {
    (void)vfs;
    const int code = fault_spares(name) ? SQLITE_OK : fault_vfs_next("xFullPathname", SQLITE_CANTOPEN, SQLITE_OK);
    return code != SQLITE_OK ? code : fault_vfs.real->xFullPathname(fault_vfs.real, name, n, out);
}
static int fault_xSleep(sqlite3_vfs *vfs, int microseconds) {
    (void)vfs;
    return microseconds;
}

/* Before the first connection. */
static inline bool fault_vfs_install(void) {
    struct fault_vfs *f = &fault_vfs;
    f->real = sqlite3_vfs_find(NULL);
    if (!f->real) return false;
    f->shim = *f->real; /* what is not ours is passed on as it is: the real one's functions do not look at it */
    f->shim.szOsFile = (int)sizeof(fault_file) + f->real->szOsFile;
    f->shim.zName = "fault";
    f->shim.pNext = NULL;
    f->shim.xOpen = fault_xOpen;
    f->shim.xDelete = fault_xDelete;
    f->shim.xAccess = fault_xAccess;
    f->shim.xFullPathname = fault_xFullPathname;
    f->shim.xSleep = fault_xSleep;
    return sqlite3_vfs_register(&f->shim, 1) == SQLITE_OK;
}

#endif
