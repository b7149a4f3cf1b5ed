/* sources.c - what the user named -> the rasters that are meant.
 *
 * A name is a raster, or a folder, or @FILE: a list of names, one a line, from the list's own folder; empty lines
 * and those that begin with # are passed over. Of a folder, and of the folders in it, all files that GDAL
 * identifies as rasters are taken, in the order of their paths (as bytes), so that the order is the same wherever
 * they lie. Files that stand beside a raster (.aux.xml, .ovr, .msk), hidden ones and the database are none; a .vrt
 * in a folder would bring the tiles beside it a second time, and is only taken when it is named.
 */
#define _LARGEFILE64_SOURCE /* VSIStatBufL is a struct stat64 */
#include "source.h"

#include <cpl_conv.h>
#include <cpl_error.h>
#include <cpl_string.h>
#include <cpl_vsi.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define MOST_LINE 65536
#define BYTE_ORDER_MARK "\xef\xbb\xbf" /* before a list from Windows */
#define MOST_DEPTH 64                  /* of folders in folders */

static bool ends_with(const char *text, const char *end) {
    const size_t n = strlen(text), m = strlen(end);
    return n >= m && EQUAL(text + n - m, end);
}

static bool add(const import_job *job, import_paths *p, char *path, int argument, int line, bool found) {
    if ((size_t)p->count == p->room) {
        const size_t room = p->room ? 2 * p->room : 64;
        import_path *more = realloc(p->path, room * sizeof *more);
        if (!more) {
            free(path);
            return import_no_memory(job, "listing the sources");
        }
        p->path = more;
        p->room = room;
    }
    if (!path) return import_no_memory(job, "listing the sources");
    p->path[p->count++] = (import_path){.path = path, .argument = argument, .line = line, .found = found};
    return true;
}

/* -------------------------------------------------------------------------------------------------- folders -- */
static int by_bytes(const void *a, const void *b) {
    return strcmp(((const import_path *)a)->path, ((const import_path *)b)->path);
}

/* The folder of a path and its last part; "a/b" and "./a//b" may be the same file before it is there. */
static bool is_same_place(const char *a, const char *b) {
    struct stat x, y;
    if (strcmp(CPLGetFilename(a), CPLGetFilename(b)) != 0) return false;
    char *first = CPLStrdup(CPLGetDirname(a)), *second = CPLStrdup(CPLGetDirname(b));
    const bool same = !stat(first, &x) && !stat(second, &y) && x.st_dev == y.st_dev && x.st_ino == y.st_ino;
    CPLFree(first);
    CPLFree(second);
    return same;
}

bool import_is_same_file(const char *a, const char *b) {
    struct stat x, y;
    const bool first = !stat(a, &x), second = !stat(b, &y);
    if (first && second) return x.st_dev == y.st_dev && x.st_ino == y.st_ino;
    return !first && !second && is_same_place(a, b);
}

/* What stands beside rasters, or is of this import. */
static bool is_beside(const import_job *job, const char *path) {
    static const char *const ends[] = {".aux.xml", ".ovr", ".msk", ".hdr", ".prj", ".qpj", ".tfw", ".rqt-import"};
    for (size_t i = 0; i < sizeof ends / sizeof *ends; i++)
        if (ends_with(path, ends[i])) return true;
    return import_is_same_file(path, job->database);
}

static bool is_raster(const char *path) {
    if (ends_with(path, ".vrt")) return false;
    return ends_with(path, ".zip") || GDALIdentifyDriverEx(path, GDAL_OF_RASTER, NULL, NULL) != NULL;
}

bool import_is_folder(const char *path) {
    VSIStatBufL file;
    return VSIStatExL(path, &file, VSI_STAT_EXISTS_FLAG | VSI_STAT_NATURE_FLAG) == 0 && VSI_ISDIR(file.st_mode);
}

/* Everything below a folder, in no order. */
static bool walk(const import_job *job, import_paths *p, const char *folder, int argument, int line, int depth) {
    char **names = VSIReadDir(folder);
    bool ok = true;
    for (char **name = names; ok && name && *name; name++) {
        if (**name == '.') continue;
        char *path = CPLStrdup(CPLFormFilename(folder, *name, NULL));
        struct stat link;
        const bool linked = !lstat(path, &link) && S_ISLNK(link.st_mode);
        if (import_is_folder(path)) {
            if (!linked && depth < MOST_DEPTH) ok = walk(job, p, path, argument, line, depth + 1);
        } else if (is_beside(job, path)) {
            /* it speaks when its raster is opened */
        } else if (is_raster(path)) {
            ok = add(job, p, strdup(path), argument, line, true);
        } else {
            p->passed++;
        }
        CPLFree(path);
    }
    CSLDestroy(names);
    return ok;
}

/* ---------------------------------------------------------------------------------------------------- names -- */
/* A raster, or a folder of them. A folder that GDAL takes for one raster is one. */
static bool add_name(const import_job *job, import_paths *p, const char *name, int argument, int line) {
    if (!import_is_folder(name) || GDALIdentifyDriverEx(name, GDAL_OF_RASTER, NULL, NULL))
        return add(job, p, strdup(name), argument, line, false);
    const int before = p->count;
    if (!walk(job, p, name, argument, line, 0)) return false;
    if (p->count == before) return import_refuse(job, "%s is a folder without rasters", name);
    qsort(p->path + before, (size_t)(p->count - before), sizeof *p->path, by_bytes);
    return true;
}

/* Is a name to be taken from the folder of its list? */
static bool is_relative(const char *name) {
    return *name != '/' && strncmp(name, "/vsi", 4) != 0 && !strchr(name, ':');
}

static bool add_line(const import_job *job, import_paths *p, const char *list, char *text, int argument, int line) {
    char *end = text + strlen(text);
    while (end > text && strchr(" \t\r\n", end[-1])) *--end = 0;
    text += strspn(text, " \t");
    if (!*text || *text == '#') return true;
    char *folder = CPLStrdup(CPLGetPath(list));
    char *path = CPLStrdup(is_relative(text) && *folder ? CPLFormFilename(folder, text, NULL) : text);
    const bool ok = add_name(job, p, path, argument, line);
    CPLFree(path);
    CPLFree(folder);
    return ok;
}

/* A sentence about a line of a list begins with its place. */
static void place_sentence(const import_job *job, const char *list, int line) {
    char *said = strdup(job->message ? job->message : "");
    if (said) import_refuse(job, "%s, line %d: %s", list, line, said);
    free(said);
}

static bool add_list(const import_job *job, import_paths *p, const char *list, int argument) {
    VSILFILE *file = import_is_folder(list) ? NULL : VSIFOpenL(list, "rb");
    if (!file) return import_refuse(job, "%s, a list of sources, cannot be read", list);
    const int before = p->count;
    bool ok = true;
    char *text = NULL;
    for (int line = 1; ok && (text = (char *)(uintptr_t)CPLReadLine2L(file, MOST_LINE, NULL)) != NULL; line++) {
        if (line == 1 && !strncmp(text, BYTE_ORDER_MARK, 3)) text += 3;
        ok = add_line(job, p, list, text, argument, line);
        if (!ok) place_sentence(job, list, line);
    }
    if (ok && !VSIFEofL(file)) ok = import_refuse(job, "%s has a line that is too long for a path", list);
    CPLReadLineL(NULL);
    VSIFCloseL(file);
    if (ok && p->count == before) return import_refuse(job, "%s lists no sources", list);
    return ok;
}

bool import_paths_find(const import_job *job, const char *const *arguments, int count, import_paths *p) {
    *p = (import_paths){.argument = arguments, .arguments = count};
    bool ok = true;
    for (int i = 0; ok && i < count; i++)
        ok = *arguments[i] == '@' ? add_list(job, p, arguments[i] + 1, i) : add_name(job, p, arguments[i], i, 0);
    return ok;
}

/* A source that was only found in a folder, and is no terrain's: several bands, or none. */
static bool is_passed_over(const import_job *job, const import_path *path) {
    if (!path->found) return false;
    CPLPushErrorHandler(CPLQuietErrorHandler);
    GDALDatasetH d = GDALOpenEx(path->path, GDAL_OF_RASTER | GDAL_OF_READONLY, NULL, NULL, NULL);
    int bands = d ? GDALGetRasterCount(d) : -1;
    if (d) GDALClose(d);
    /* A GeoPackage of tables, say, is identified and has no raster. */
    if (!d && (d = GDALOpenEx(path->path, GDAL_OF_VECTOR | GDAL_OF_READONLY, NULL, NULL, NULL)) != NULL) {
        bands = 0;
        GDALClose(d);
    }
    CPLPopErrorHandler();
    if (bands < 0 || bands == 1) return false;
    if (bands)
        import_notice(job, "%s is passed over: it has %d bands, and a terrain has one", path->path, bands);
    else
        import_notice(job, "%s is passed over: it holds no raster", path->path);
    return true;
}

bool import_paths_describe(const import_job *job, const import_paths *p, int n, import_source *source) {
    import_path *path = &p->path[n];
    if (import_source_describe(job, path->path, source)) return true;
    import_source_free(source);
    path->passed = is_passed_over(job, path);
    if (path->passed)
        import_refuse(job, "%s", ""); /* it was none */
    else
        import_paths_place_sentence(job, p, n);
    return false;
}

void import_paths_place_sentence(const import_job *job, const import_paths *p, int n) {
    const import_path *path = &p->path[n];
    if (path->line) place_sentence(job, p->argument[path->argument] + 1, path->line);
}

void import_paths_tell_passed(const import_job *job, const import_paths *p) {
    if (!p->passed) return;
    import_notice(job, "%lld file%s in folders %s no raster%s: passed over", (long long)p->passed,
                  p->passed == 1 ? "" : "s", p->passed == 1 ? "is" : "are", p->passed == 1 ? "" : "s");
}

void import_paths_free(import_paths *p) {
    for (int i = 0; i < p->count; i++) free(p->path[i].path);
    free(p->path);
    *p = (import_paths){0};
}

char *import_base_of(const char *argument) {
    argument += *argument == '@';
    size_t end = strlen(argument);
    while (end > 1 && argument[end - 1] == '/') end--;
    size_t begin = end;
    while (begin > 0 && argument[begin - 1] != '/') begin--;
    return strndup(argument + begin, end - begin);
}
