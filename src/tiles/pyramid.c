/* pyramid.c - all tiles of a terrain as files, FOLDER/z/x/y.terrain or as their kind names them, and its document,
 * as FOLDER/layer.json, when all are there.
 *
 * Workers take pieces of columns, each with a connection of its own; a tile's bytes depend on nothing but the
 * terrain, so it does not matter which makes it. Each file is written beside its place and renamed: it is there
 * whole or not at all, and what is there need not be made again. FOLDER/.rqt-tiles says of what the tiles are:
 * terrain, its state, options. A folder that says something else, or holds files and says nothing, is
 * another's, and is refused; while somebody works in it the file is locked. The document comes last, so a folder
 * that has it is complete.
 */
#include "kind.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#define CHANGED "the database has changed meanwhile"
enum { PIECE = 32, MOST_PATH = 4096, GZIP_LEVEL = 5, GZIP_WINDOW = 15 + 16, GZIP_MEMORY = 8 };

/* A range of tiles. Its pieces, PIECE tiles of a column or what is left of it, are counted over all ranges, not
 * listed: there may be more of them than memory. */
typedef struct stretch {
    int series, z;
    tile_range range;
    size_t first; /* number of its first piece */
} stretch;

/* Tiles y0..y1 of one column: files of one folder. */
typedef struct piece {
    int series, z;
    int32_t x, y0, y1;
} piece;

typedef struct pyramid {
    const tiles_job *job;
    char *description; /* of what the tiles are */
    int last;
    stretch *stretches;
    size_t stretch_count;
    size_t count; /* of pieces */
    atomic_size_t next;
    atomic_llong done, written, bytes;
    atomic_bool stop;
    pthread_mutex_t lock; /* of what follows */
    pthread_cond_t ended;
    int working;
    int code;
    char *error;
} pyramid;

/* ---------------------------------------------------------------------------------------------------- files -- */

static int fail_file(char **error, const char *path) {
    return tiles_fail(error, "%s: %s", path, strerror(errno));
}

static int make_folder(const char *path, char **error) {
    return mkdir(path, 0777) == 0 || errno == EEXIST ? SQLITE_OK : fail_file(error, path);
}

/* With those above it. */
static int make_path(const char *folder, char **error) {
    char path[MOST_PATH];
    snprintf(path, sizeof path, "%s", folder);
    for (char *slash = path + 1; (slash = strchr(slash, '/')) != NULL; slash++) {
        *slash = 0;
        const int code = make_folder(path, error);
        if (code != SQLITE_OK) return code;
        *slash = '/';
    }
    return make_folder(path, error);
}

static int open_new(const char *path) {
    return open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
}

static bool write_bytes(int file, const uint8_t *bytes, size_t size) {
    while (size > 0) {
        const ssize_t n = write(file, bytes, size);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) return false;
        bytes += n;
        size -= (size_t)n;
    }
    return true;
}

/* Whole or not at all. What a kill has left is made anew, not written to: it could be a link to elsewhere. */
static int write_file(const char *path, const void *bytes, size_t size, char **error) {
    char part[MOST_PATH + 8];
    snprintf(part, sizeof part, "%s.part", path);
    int f = open_new(part);
    if (f < 0 && errno == EEXIST && unlink(part) == 0) f = open_new(part);
    if (f < 0) return fail_file(error, part);
    const bool ok = write_bytes(f, bytes, size);
    if (close(f) == 0 && ok && rename(part, path) == 0) return SQLITE_OK;
    (void)fail_file(error, path);
    unlink(part);
    return SQLITE_IOERR;
}

/* The same bytes for the same bytes: no name and no time in it. */
static int pack(tile_bytes *b) {
    z_stream z = {0};
    if (b->size > INT32_MAX ||
        deflateInit2(&z, GZIP_LEVEL, Z_DEFLATED, GZIP_WINDOW, GZIP_MEMORY, Z_DEFAULT_STRATEGY) != Z_OK)
        return SQLITE_NOMEM;
    const uLong bound = deflateBound(&z, (uLong)b->size);
    uint8_t *packed = sqlite3_malloc64(bound);
    z.next_in = b->bytes;
    z.avail_in = (uInt)b->size;
    z.next_out = packed;
    z.avail_out = (uInt)bound;
    const bool ok = packed && deflate(&z, Z_FINISH) == Z_STREAM_END;
    const size_t size = z.total_out;
    deflateEnd(&z);
    if (!ok) {
        sqlite3_free(packed);
        return SQLITE_NOMEM;
    }
    sqlite3_free(b->bytes);
    *b = (tile_bytes){packed, size};
    return SQLITE_OK;
}

/* ---------------------------------------------------------------------------------------------- description -- */

/* What the tiles are of: bytes are a function of the terrain alone, wherever its file is and whatever its time. */
static int describe_job(const tiles_job *job, const tiles *t, int last, char **description, char **error) {
    uint64_t digest;
    const int code = store_digest(t->store, t->terrain, &digest, error);
    *description =
        code == SQLITE_OK
            ? sqlite3_mprintf("rqt %s\n%s of terrain %s of %.64s\nstate %016llx\nlevels %d to %d%s%s%s\n",
                              RQT_VERSION, job->kind->name, t->terrain->name, t->terrain->created,
                              (unsigned long long)digest, job->first, last, job->gzip ? ", gzip" : "",
                              job->url ? " at " : "", job->url ? job->url : "")
            : NULL;
    return code == SQLITE_OK && !*description ? SQLITE_NOMEM : code;
}

/* Does a connection that has begun to read see what the tiles are of? */
static int check_state(const pyramid *p, const tiles *t, char **error) {
    char *now;
    int code = describe_job(p->job, t, p->last, &now, error);
    if (code == SQLITE_OK && strcmp(now, p->description) != 0) code = tiles_fail(error, CHANGED);
    sqlite3_free(now);
    return code;
}

/* -------------------------------------------------------------------------------------------------- workers -- */

/* A folder is made when the first of its files is, and not asked for by the others of a piece. */
static int write_tile(pyramid *p, tiles *t, const piece *column, int32_t y, bool *has_folder, char **error) {
    char path[MOST_PATH];
    struct stat there;
    tile_bytes tile;
    const tile_series *series = &p->job->kind->series[column->series];
    const int folder =
        snprintf(path, sizeof path, "%s/%s%d/%d", p->job->folder, series->folder, column->z, (int)column->x);
    snprintf(path + folder, sizeof path - (size_t)folder, "/%d%s", (int)y, series->suffix);
    /* An empty one is what a cut of power may leave of a file that has its name already. */
    if (lstat(path, &there) == 0 && S_ISREG(there.st_mode) && there.st_size > 0) return SQLITE_OK;
    int code = tiles_make(t, column->series, column->z, column->x, y, &tile, error);
    if (code == SQLITE_OK && tile.size > 0) {
        if (p->job->gzip && !series->is_packed) code = pack(&tile);
        path[folder] = '\0';
        if (code == SQLITE_OK && !*has_folder) code = make_folder(path, error);
        path[folder] = '/';
        *has_folder = true;
        if (code == SQLITE_OK) code = write_file(path, tile.bytes, tile.size, error);
        if (code == SQLITE_OK) {
            p->written++;
            p->bytes += (long long)tile.size;
        }
    }
    sqlite3_free(tile.bytes);
    return code;
}

static piece find_piece(const pyramid *p, size_t n) {
    size_t low = 0, high = p->stretch_count; /* the last one that begins at or before n */
    while (high - low > 1) {
        const size_t middle = low + (high - low) / 2;
        if (p->stretches[middle].first <= n)
            low = middle;
        else
            high = middle;
    }
    const stretch *of = &p->stretches[low];
    const tile_range *r = &of->range;
    const size_t in_column = ((size_t)(r->y1 - r->y0) + PIECE) / PIECE;
    const int32_t y = r->y0 + PIECE * (int32_t)((n - of->first) % in_column);
    return (piece){.series = of->series,
                   .z = of->z,
                   .x = r->x0 + (int32_t)((n - of->first) / in_column),
                   .y0 = y,
                   .y1 = r->y1 - y < PIECE ? r->y1 : y + PIECE - 1};
}

static int write_pieces(pyramid *p, tiles *t, char **error) {
    int code = tiles_begin(t, p->job->kind, p->job->terrain, error);
    if (code != SQLITE_OK) return code;
    tiles_tell(t, p->last);
    code = check_state(p, t, error);
    for (size_t n; code == SQLITE_OK && !p->stop && (n = p->next++) < p->count;) {
        const piece column = find_piece(p, n);
        bool has_folder = false;
        for (int32_t y = column.y0; y <= column.y1 && code == SQLITE_OK && !p->stop; y++) {
            code = write_tile(p, t, &column, y, &has_folder, error);
            p->done++;
        }
    }
    tiles_end(t);
    return code;
}

static void *work(void *argument) {
    pyramid *p = argument;
    char *error = NULL;
    tiles *t = NULL;
    pthread_mutex_lock(&p->lock); /* connections are opened one at a time: they may speak */
    sqlite3 *db = p->stop ? NULL : p->job->connect(p->job->context);
    pthread_mutex_unlock(&p->lock);
    int code = db ? tiles_open(db, &t) : SQLITE_CANTOPEN;
    if (code == SQLITE_OK) code = write_pieces(p, t, &error);
    tiles_close(t);
    sqlite3_close(db);
    pthread_mutex_lock(&p->lock);
    if (code != SQLITE_OK) {
        p->stop = true;
        if (p->code == SQLITE_OK) {
            p->code = code;
            p->error = error;
            error = NULL;
        }
    }
    p->working--;
    pthread_cond_signal(&p->ended);
    pthread_mutex_unlock(&p->lock);
    sqlite3_free(error);
    return NULL;
}

/* Waits for the workers, and tells how far they are. */
static void watch(pyramid *p, int64_t all) {
    pthread_mutex_lock(&p->lock);
    while (p->working > 0) {
        struct timespec until;
        clock_gettime(CLOCK_REALTIME, &until);
        until.tv_nsec += 100000000;
        if (until.tv_nsec >= 1000000000) until.tv_sec++, until.tv_nsec -= 1000000000;
        pthread_cond_timedwait(&p->ended, &p->lock, &until);
        if (p->stop || !p->job->progress || p->job->progress(p->job->context, p->done, all)) continue;
        p->stop = true;
        if (p->code == SQLITE_OK) p->code = SQLITE_INTERRUPT;
    }
    pthread_mutex_unlock(&p->lock);
}

static int run_workers(pyramid *p, int64_t all, char **error) {
    pthread_t threads[MOST_WORKERS];
    int begun = 0;
    const int wanted = p->job->workers;
    pthread_mutex_init(&p->lock, NULL);
    pthread_cond_init(&p->ended, NULL);
    p->working = wanted;
    while (begun < wanted && pthread_create(&threads[begun], NULL, work, p) == 0) begun++;
    pthread_mutex_lock(&p->lock);
    p->working -= wanted - begun;
    if (begun == 0) p->code = SQLITE_NOMEM;
    pthread_mutex_unlock(&p->lock);
    watch(p, all);
    for (int i = 0; i < begun; i++) pthread_join(threads[i], NULL);
    pthread_cond_destroy(&p->ended);
    pthread_mutex_destroy(&p->lock);
    *error = p->error;
    return p->code;
}

/* ----------------------------------------------------------------------------------------------------- whole -- */

static int add_stretch(pyramid *p, int series, int z, const tile_range *r, size_t *capacity, int64_t *all) {
    const size_t rows = (size_t)(r->y1 - r->y0) + 1, columns = (size_t)(r->x1 - r->x0) + 1;
    if (p->stretch_count == *capacity) {
        *capacity = *capacity ? 2 * *capacity : 64;
        stretch *more = sqlite3_realloc64(p->stretches, *capacity * sizeof *more);
        if (!more) return SQLITE_NOMEM;
        p->stretches = more;
    }
    p->stretches[p->stretch_count++] = (stretch){series, z, *r, p->count};
    p->count += columns * ((rows + PIECE - 1) / PIECE);
    *all += (int64_t)(rows * columns);
    return SQLITE_OK;
}

static int list_series(pyramid *p, tiles *t, int series, size_t *capacity, int64_t *all, char **error) {
    const tiles_job *job = p->job;
    char path[MOST_PATH];
    snprintf(path, sizeof path, "%s/%s", job->folder, job->kind->series[series].folder);
    int code = make_folder(path, error);
    for (int z = job->first; z <= p->last && code == SQLITE_OK; z++) {
        const tile_range *ranges;
        size_t count;
        snprintf(path, sizeof path, "%s/%s%d", job->folder, job->kind->series[series].folder, z);
        code = tiles_available(t, series, z, &ranges, &count, error);
        if (code == SQLITE_OK && count > 0) code = make_folder(path, error);
        for (size_t i = 0; i < count && code == SQLITE_OK; i++)
            code = add_stretch(p, series, z, &ranges[i], capacity, all);
    }
    return code;
}

static int list_stretches(pyramid *p, tiles *t, int64_t *all, char **error) {
    size_t capacity = 0;
    int code = SQLITE_OK;
    for (int series = 0; series < p->job->kind->series_count && code == SQLITE_OK; series++)
        code = list_series(p, t, series, &capacity, all, error);
    return code;
}

/* Is there nothing in the folder but its description? Tiles that nobody says anything of would be taken for ours.
 */
static int check_empty(const char *folder, char **error) {
    DIR *files = opendir(folder);
    if (!files) return fail_file(error, folder);
    bool is_empty = true;
    for (const struct dirent *f; (f = readdir(files));)
        is_empty &= !strcmp(f->d_name, ".") || !strcmp(f->d_name, "..") || !strcmp(f->d_name, ".rqt-tiles");
    closedir(files);
    if (is_empty) return SQLITE_OK;
    return tiles_fail(error, "%s holds files that are not of rqt tiles: give another folder, or an empty one",
                      folder);
}

/* Makes the folder ours: *file holds its lock. */
static int claim_folder(const tiles_job *job, const char *description, int *file, char **error) {
    char path[MOST_PATH], there[MOST_PATH] = "";
    int code = make_path(job->folder, error);
    if (code != SQLITE_OK) return code;
    snprintf(path, sizeof path, "%s/.rqt-tiles", job->folder);
    *file = open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0666);
    if (*file < 0) return fail_file(error, path);
    if (flock(*file, LOCK_EX | LOCK_NB))
        return tiles_fail(error, "%s: another rqt tiles is at work there", job->folder);
    const size_t size = strlen(description);
    if (size >= sizeof there) return tiles_fail(error, "the address of the tiles is too long");
    const ssize_t n = read(*file, there, sizeof there);
    if (n < 0) return fail_file(error, path);
    if (n == 0) code = check_empty(job->folder, error);
    if (code != SQLITE_OK) unlink(path);
    if (code != SQLITE_OK) return code;
    if ((size_t)n < size && memcmp(there, description, (size_t)n) == 0) /* new, or killed at this very place */
        return pwrite(*file, description, size, 0) == (ssize_t)size ? SQLITE_OK : fail_file(error, path);
    if ((size_t)n == size && memcmp(there, description, size) == 0) return SQLITE_OK;
    return tiles_fail(error,
                      "%s holds tiles of another terrain, of another state of it or of other options: give "
                      "another folder, or remove it",
                      job->folder);
}

static int write_document(tiles *t, const tiles_job *job, int last, char **error) {
    char path[MOST_PATH];
    tile_bytes document;
    snprintf(path, sizeof path, "%s/%s", job->folder, job->kind->document);
    int code = tiles_document(t, job->url ? job->url : "", job->first, last, &document, error);
    if (code == SQLITE_OK) code = write_file(path, document.bytes, document.size, error);
    sqlite3_free(document.bytes);
    return code;
}

static int write_all(pyramid *p, tiles *t, tiles_report *report, char **error) {
    const tiles_job *job = p->job;
    int file = -1;
    const int finest = tiles_finest(t);
    p->last = job->last < finest ? job->last : finest;
    if (strlen(job->folder) > MOST_PATH - 64) return tiles_fail(error, "the folder's name is too long");
    if (job->first > p->last) return tiles_fail(error, "terrain %s has levels 0 to %d", t->terrain->name, finest);
    if (job->url && !job->kind->has_addresses)
        return tiles_fail(error, "%s needs no URL: its addresses are relative", job->kind->name);
    if (job->kind->is_whole && (job->first > 0 || p->last < finest))
        return tiles_fail(error, "%s has all levels, 0 to %d, or none", job->kind->name, finest);
    int code = describe_job(job, t, p->last, &p->description, error);
    if (code == SQLITE_OK) code = claim_folder(job, p->description, &file, error);
    if (code == SQLITE_OK) code = list_stretches(p, t, &report->tiles, error);
    if (code == SQLITE_OK) code = run_workers(p, report->tiles, error);
    if (code == SQLITE_OK) code = write_document(t, job, p->last, error);
    report->written = p->written;
    report->bytes = p->bytes;
    report->finest = p->last;
    if (file >= 0) close(file);
    sqlite3_free(p->stretches);
    sqlite3_free(p->description);
    return code;
}

int tiles_write(const tiles_job *job, tiles_report *report, char **error) {
    pyramid p = {.job = job};
    tiles *t = NULL;
    *report = (tiles_report){0};
    sqlite3 *db = job->connect(job->context);
    if (!db) return SQLITE_CANTOPEN;
    int code = tiles_open(db, &t);
    if (code == SQLITE_OK) code = tiles_begin(t, job->kind, job->terrain, error);
    if (code == SQLITE_OK) {
        code = write_all(&p, t, report, error);
        tiles_end(t);
    }
    tiles_close(t);
    sqlite3_close(db);
    return code;
}
