/* spool.c - the resume file beside the database: strips of values as they were read and put together.
 *
 * An import that does not fit in memory reads its sources once, spools every strip here, and takes its second
 * reading from here. The file has a name (DATABASE.NAME.rqt-import), so when the import ends before its time - a
 * kill, a full disk, Ctrl-C - the next run with the same sources finds it and goes on after its last sound strip.
 * It goes when the terrain is committed.
 *
 * Bytes (as the machine has its numbers: the file is never carried elsewhere; FORMAT.md, "Resume file"): a header,
 * a key a source, then records from strip 0 on without a break. Only appending ever happens, and what a kill or a
 * power failure has torn is no record: its header has a checksum and says how long it is, its frame has zstd's. So
 * there is nothing to flush, and nothing is trusted: a record that is not sound ends what is known, and everything
 * from there on is read from the sources.
 *
 * A source that has changed takes with it the strips from its first row on; another grid, type, list of sources or
 * --nodata all of them. Two imports at once do not share one file: it is locked.
 */
#include "spool.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#define MAGIC UINT64_C(0x4C4F4F5053545152) /* RQTSPOOL */
#define VERSION 1
#define MOST_CONFLICTS (1 << 20) /* of a strip */

typedef struct header {
    uint64_t magic;
    uint32_t version, kind;
    int32_t width, height, strip_rows, sources;
    uint64_t options;
    uint64_t checksum; /* of the header with 0 here, and of the keys */
} header;

typedef struct record {
    int32_t strip;
    uint32_t conflicts;
    uint64_t packed, plain;
    int64_t overlap, differ, samples;
    uint64_t checksum; /* of the record with 0 here; the packed bytes have their own */
} record;

struct import_spool {
    char *path;
    int file;
    bool ours; /* locked, and a resume file or new */
    header header;
    spool_codec *codec;
    int32_t strips, found; /* known now; found in the file when it was opened */
    uint64_t *offset;      /* of each record; [strips]: the end */
    int32_t grid_strips;
};

static uint64_t mixed(uint64_t h, const void *bytes, size_t size) {
    const uint8_t *b = bytes;
    for (size_t i = 0; i < size; i++) h = (h ^ b[i]) * UINT64_C(0x100000001B3);
    return h;
}

uint64_t import_mix(uint64_t h, const void *bytes, size_t size) {
    return mixed(h ? h : UINT64_C(0xCBF29CE484222325), bytes, size);
}

static uint64_t checksum_of(const record *r) {
    record plain = *r;
    plain.checksum = 0;
    return import_mix(0, &plain, sizeof plain);
}

static uint64_t checksum_of_header(const header *h, const import_spool_key *keys) {
    header plain = *h;
    plain.checksum = 0;
    return import_mix(import_mix(0, &plain, sizeof plain), keys, (size_t)h->sources * sizeof *keys);
}

/* ---------------------------------------------------------------------------------------------- the file -- */
static bool write_all(int file, uint64_t offset, const void *bytes, size_t size) {
    for (const uint8_t *from = bytes; size;) {
        const ssize_t n = pwrite(file, from, size, (off_t)offset);
        if (n <= 0 && errno != EINTR) {
            if (n == 0) errno = EIO;
            return false;
        }
        const size_t done = n > 0 ? (size_t)n : 0;
        from += done;
        size -= done;
        offset += done;
    }
    return true;
}

static bool read_all(int file, uint64_t offset, void *bytes, size_t size) {
    for (uint8_t *to = bytes; size;) {
        const ssize_t n = pread(file, to, size, (off_t)offset);
        if (n == 0 || (n < 0 && errno != EINTR)) return false;
        const size_t done = n > 0 ? (size_t)n : 0;
        to += done;
        size -= done;
        offset += done;
    }
    return true;
}

static bool refuse(const import_job *job, const char *path, const char *what) {
    const int why = errno;
    const bool full = why == ENOSPC || why == EFBIG || why == EDQUOT;
    return import_refuse(job, "the resume file %s %s: %s%s", path, what, full ? "the disk is full: " : "",
                         strerror(why));
}

/* One of ours, so that it may be overwritten: our magic, or nothing. */
static bool is_ours(const import_spool *s, const struct stat *file) {
    uint64_t magic = 0;
    return file->st_size == 0 ||
           (S_ISREG(file->st_mode) && read_all(s->file, 0, &magic, sizeof magic) && magic == MAGIC);
}

static bool open_locked(const import_job *job, import_spool *s) {
    struct stat file;
    s->file = open(s->path, O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (s->file < 0) return refuse(job, s->path, "cannot be made");
    if (flock(s->file, LOCK_EX | LOCK_NB))
        return import_refuse(job, "%s is in use: another import into %s is under way", s->path, job->database);
    if (fstat(s->file, &file)) return refuse(job, s->path, "cannot be read");
    s->ours = is_ours(s, &file);
    return s->ours ||
           import_refuse(job, "%s is in the way: it is no resume file of an import, and this one would be there",
                         s->path);
}

/* Forget the strips from this one on, in the file too. */
static bool cut(import_spool *s, int32_t strips) {
    if (strips < s->strips) s->strips = strips;
    if (strips < s->found) s->found = strips;
    return ftruncate(s->file, (off_t)s->offset[s->strips]) == 0;
}

/* ---------------------------------------------------------------------------------------------- the beginning --
 */
/* The records that are there, by their headers. What they hold is looked at when it is read. */
static void find_records(import_spool *s, uint64_t end) {
    record r;
    while (s->strips < s->grid_strips && read_all(s->file, s->offset[s->strips], &r, sizeof r)) {
        const uint64_t begin = s->offset[s->strips] + sizeof r;
        if (r.strip != s->strips || r.checksum != checksum_of(&r) || r.packed > end || begin + r.packed > end ||
            r.conflicts > MOST_CONFLICTS)
            break;
        s->offset[++s->strips] = begin + r.packed;
    }
}

static bool begin_anew(const import_job *job, import_spool *s, const import_spool_key *keys) {
    s->strips = s->found = 0;
    if (ftruncate(s->file, 0) || !write_all(s->file, 0, &s->header, sizeof s->header) ||
        !write_all(s->file, sizeof s->header, keys, (size_t)s->header.sources * sizeof *keys))
        return refuse(job, s->path, "cannot be written");
    return true;
}

/* How many strips of the file are of these sources; -1: none, and why. */
static int32_t usable_strips(const import_spool *s, const import_spool_key *keys, const import_spool_key *old,
                             const header *h, const char **why) {
    const header *mine = &s->header;
    *why = "has another grid or type of numbers";
    if (h->kind != mine->kind || h->width != mine->width || h->height != mine->height ||
        h->strip_rows != mine->strip_rows)
        return -1;
    *why = "was made with another --nodata or --unit";
    if (h->options != mine->options) return -1;
    *why = "is of other sources";
    int32_t first = mine->height;
    for (int32_t i = 0; i < mine->sources; i++) {
        if (keys[i].place != old[i].place) return -1;
        if (keys[i].content != old[i].content && keys[i].row < first) first = keys[i].row;
    }
    *why = "is of a source that has changed";
    return first < mine->height ? first / mine->strip_rows : s->grid_strips;
}

static bool take_up(const import_job *job, import_spool *s, const import_spool_key *keys, uint64_t end) {
    header h;
    const char *why = "is damaged";
    int32_t usable = -1;
    const size_t size = (size_t)s->header.sources * sizeof *keys;
    import_spool_key *old = malloc(size);
    if (!old) return import_no_memory(job, "opening the resume file");
    if (read_all(s->file, 0, &h, sizeof h) && h.version == VERSION) {
        if (h.sources != s->header.sources)
            why = "is of other sources";
        else if (read_all(s->file, sizeof h, old, size) && h.checksum == checksum_of_header(&h, old))
            usable = usable_strips(s, keys, old, &h, &why);
    }
    const bool alike = usable >= 0 && !memcmp(old, keys, size);
    free(old);
    if (usable >= 0) find_records(s, end);
    if (usable >= 0 && usable < s->strips) {
        import_notice(job, "the resume file %s %s: of its %d strips of rows the first %d are used", s->path, why,
                      s->strips, usable);
        if (!cut(s, usable)) return refuse(job, s->path, "cannot be written");
    }
    if (usable < 0 || s->strips == 0) {
        if (usable < 0) import_notice(job, "the resume file %s %s: reading begins anew", s->path, why);
        return begin_anew(job, s, keys);
    }
    s->found = s->strips;
    /* Sources behind the last strip may have changed. */
    if ((!alike &&
         (!write_all(s->file, 0, &s->header, sizeof s->header) || !write_all(s->file, sizeof h, keys, size))) ||
        !cut(s, s->strips))
        return refuse(job, s->path, "cannot be written");
    return true;
}

char *import_spool_path(const char *database, const char *terrain) {
    static const char end[] = ".rqt-import";
    const size_t n = strlen(database), m = strlen(terrain);
    char *path = malloc(n + 1 + m + sizeof end);
    if (path) {
        memcpy(path, database, n);
        path[n] = '.';
        memcpy(path + n + 1, terrain, m);
        memcpy(path + n + 1 + m, end, sizeof end);
    }
    return path;
}

bool import_spool_open(const import_job *job, const char *path, const import_spool_grid *grid,
                       const import_spool_key *keys, import_spool **spool) {
    struct stat file;
    import_spool *s = *spool = calloc(1, sizeof *s);
    if (!s) return import_no_memory(job, "opening the resume file");
    s->file = -1;
    s->header = (header){.magic = MAGIC,
                         .version = VERSION,
                         .kind = (uint32_t)grid->kind,
                         .width = grid->width,
                         .height = grid->height,
                         .strip_rows = grid->strip_rows,
                         .sources = grid->sources,
                         .options = grid->options};
    s->header.checksum = checksum_of_header(&s->header, keys);
    s->grid_strips = (grid->height + grid->strip_rows - 1) / grid->strip_rows;
    s->path = strdup(path);
    s->offset = calloc((size_t)s->grid_strips + 1, sizeof *s->offset);
    if (!s->path || !s->offset) return import_no_memory(job, "opening the resume file");
    s->offset[0] = sizeof s->header + (size_t)grid->sources * sizeof *keys;
    if (!spool_codec_create(job, grid->kind, grid->width, grid->strip_rows, &s->codec) || !open_locked(job, s))
        return false;
    if (fstat(s->file, &file)) return refuse(job, s->path, "cannot be read");
    return file.st_size ? take_up(job, s, keys, (uint64_t)file.st_size) : begin_anew(job, s, keys);
}

/* ---------------------------------------------------------------------------------------------------- strips -- */
int32_t import_spool_strips(const import_spool *s) {
    return s->strips;
}

int32_t import_spool_found(const import_spool *s) {
    return s->found;
}

uint64_t import_spool_bytes(const import_spool *s) {
    return s->offset[s->strips];
}

/* Pairs that can be: of these sources, at places of this strip. */
static bool are_possible(const import_spool *s, const import_strip *strip, const import_conflict *c, size_t n) {
    for (size_t i = 0; i < n; i++)
        if (c[i].a < 0 || c[i].a >= c[i].b || c[i].b >= s->header.sources || c[i].differ < 1 ||
            !(c[i].largest >= 0) || c[i].row < strip->first_row || c[i].row >= strip->first_row + strip->rows ||
            c[i].first_row < strip->first_row || c[i].first_row >= strip->first_row + strip->rows ||
            c[i].column < 0 || c[i].column >= strip->width || c[i].first_column < 0 ||
            c[i].first_column >= strip->width)
            return false;
    return true;
}

static bool read_record(import_spool *s, int32_t n, import_strip *strip, record *r, import_conflict **conflicts) {
    if (!read_all(s->file, s->offset[n], r, sizeof *r) || r->checksum != checksum_of(r) || r->strip != n)
        return false;
    const size_t pairs = r->conflicts, size = pairs * sizeof **conflicts;
    if (pairs > MOST_CONFLICTS || s->offset[n] + sizeof *r + r->packed != s->offset[n + 1]) return false;
    uint8_t *packed = spool_packed_room(s->codec, (size_t)r->packed);
    *conflicts = malloc(size ? size : 1);
    return packed && *conflicts && read_all(s->file, s->offset[n] + sizeof *r, packed, (size_t)r->packed) &&
           spool_decode(s->codec, (size_t)r->packed, (size_t)r->plain, strip, *conflicts, size) &&
           are_possible(s, strip, *conflicts, pairs);
}

bool import_spool_read(import_spool *s, int32_t n, import_strip *strip, import_counts *counts,
                       import_conflicts *conflicts) {
    record r;
    import_conflict *pair = NULL;
    bool ok = read_record(s, n, strip, &r, &pair);
    for (size_t i = 0; ok && conflicts && i < r.conflicts; i++) ok = import_conflicts_add(conflicts, &pair[i]);
    free(pair);
    if (!ok) {
        cut(s, n);
        return false;
    }
    const size_t samples = (size_t)strip->rows * (size_t)strip->width;
    int64_t data = 0;
    for (size_t i = 0; i < samples; i++) data += strip->valid[i];
    counts->voids += (int64_t)samples - data;
    counts->overlap += r.overlap;
    counts->overlap_differs += r.differ;
    if (n < s->found) counts->resumed += r.samples;
    return true;
}

bool import_spool_append(const import_job *job, import_spool *s, const import_strip *strip,
                         const import_counts *counts, const import_conflicts *conflicts) {
    if (conflicts->count > MOST_CONFLICTS)
        return import_refuse(job, "more than %d pairs of sources differ at rows %d to %d: is one grid meant?",
                             MOST_CONFLICTS, strip->first_row, strip->first_row + strip->rows - 1);
    const spool_bytes b =
        spool_encode(s->codec, strip, conflicts->pair, conflicts->count * sizeof *conflicts->pair);
    if (!b.packed) return import_no_memory(job, "writing the resume file");
    record r = {.strip = s->strips,
                .conflicts = (uint32_t)conflicts->count,
                .packed = b.size,
                .plain = b.plain,
                .overlap = counts->overlap,
                .differ = counts->overlap_differs,
                .samples = counts->samples};
    r.checksum = checksum_of(&r);
    const uint64_t at = s->offset[s->strips];
    if (!write_all(s->file, at, &r, sizeof r) || !write_all(s->file, at + sizeof r, b.packed, b.size)) {
        const int why = errno;
        cut(s, s->strips);
        errno = why;
        return refuse(job, s->path, "cannot be written");
    }
    s->offset[++s->strips] = at + sizeof r + b.size;
    return true;
}

bool import_spool_close(import_spool *s, bool keep) {
    if (!s) return false;
    keep = keep && s->strips > 0;
    if (s->file >= 0) {
        if (s->ours && !keep) unlink(s->path);
        close(s->file);
    }
    spool_codec_free(s->codec);
    free(s->offset);
    free(s->path);
    free(s);
    return keep;
}
