/* check.c - everything that can be known of a terrain without its source.
 *
 * One walk down the pyramid, parent before children, over the cells that the terrain's extent demands. It keeps the
 * decoded block of each level on the way, so that a block meets its parent; its eastern and southern neighbours
 * come from a small cache. On the way back up each cell tells its parent the largest error below, which is what em
 * must be. Two scans of ids find rows that no cell demands, and sums over the walk are held against the terrain's
 * row. Memory: one block per level and the cache, whatever the terrain's size.
 *
 * A block of stride > 1 holds its kept vertices only, and its corners' errors come from its summary. Where two
 * blocks share a vertex that one of them does not keep, the other's must be one that may be dropped there.
 *
 * A finding is told once, where it is: what cannot be read is not compared, and em is recomputed from the grids
 * below, never from what the children's summaries claim. A read transaction is held throughout, so a writer beside
 * us causes no findings.
 */
#include "internal.h"

#include "cache.h"

#include <string.h>

#define CACHE_BYTES ((size_t)16 << 20)

/* The block of one level that the walk is in. */
typedef struct frame {
    rqt_block_number number;
    rqt_block_place place;
    rqt_block block;
    rqt_summary summary;
    bool has_block, has_summary;
    /* The largest error strictly finer than the stride in the closed cell, gathered from the children. */
    rqt_code em;
    bool outline;  /* one of those vertices has the outline bit */
    bool em_known; /* all blocks below could be read */
} frame;

typedef struct check {
    sqlite3 *db;
    const store_terrain *t;
    rqt_codec *codec;
    block_cache *cache;
    sqlite3_stmt *held; /* keeps the read transaction */
    sqlite3_stmt *row, *index;
    frame frames[RQT_MAX_K + 1];
    double quantum;
    /* what the walk counts, to be held against the terrain's row */
    bool samples_known; /* every block of stride 1 could be read */
    int64_t voids;
    int32_t min_q, max_q;
    bool errors_known; /* every block could be read */
    rqt_code max_error;

    bool (*tell)(void *context, const store_finding *finding);
    void *context;
    bool stopped;
    int code;
    char **error;
} check;

static bool ended(const check *c) {
    return c->stopped || c->code != SQLITE_OK;
}

/* A finding as a sentence: number 0 is the terrain. */
static void tell(check *c, const char *severity, rqt_block_number number, const char *format, ...) {
    if (ended(c)) return;
    sqlite3_str *out = sqlite3_str_new(NULL);
    if (number)
        sqlite3_str_appendf(out, "block %llu ", number);
    else
        sqlite3_str_appendf(out, "terrain %s ", c->t->name);
    va_list arguments;
    va_start(arguments, format);
    sqlite3_str_vappendf(out, format, arguments);
    va_end(arguments);
    char *text = sqlite3_str_finish(out);
    if (!text) {
        c->code = SQLITE_NOMEM;
        return;
    }
    const store_finding finding = {severity, number, text};
    c->stopped = !c->tell(c->context, &finding);
    sqlite3_free(text);
}

#define FOUND(c, number, ...) tell(c, "error", number, __VA_ARGS__)

/* A statement failed. Damage is what we look for, and goes on the list; anything else ends the check. */
static void failed(check *c, int code, rqt_block_number number, const char *doing) {
    const int primary = code & 0xFF;
    if (primary == SQLITE_CORRUPT || primary == SQLITE_NOTADB || primary == SQLITE_ERROR)
        FOUND(c, number, "cannot be read: %s: %s", doing, sqlite3_errmsg(c->db));
    else
        c->code = store_fail_db(c->error, c->db, code, doing);
}

/* ------------------------------------------------------------------------------------------ places of damage */

/* How often, and where first. */
typedef struct tally {
    size_t count;
    rqt_vertex first;
} tally;

static void count(tally *t, rqt_vertex at) {
    if (t->count++ == 0) t->first = at;
}

static void tell_tally(check *c, const frame *f, const tally *t, const char *what) {
    if (t->count == 0) return;
    FOUND(c, f->number, "%s: at (%d,%d)%s", what, t->first.x, t->first.y, t->count > 1 ? " and elsewhere" : "");
}

/* What two blocks say of the vertices they share. */
typedef struct difference {
    tally heights, errors, flags;
} difference;

static void tell_difference(check *c, const frame *f, const difference *d, const char *whom,
                            rqt_block_number number) {
    const tally *const tallies[] = {&d->heights, &d->errors, &d->flags};
    static const char *const names[] = {"height", "error", "flags"};
    for (int n = 0; n < 3; n++)
        if (tallies[n]->count)
            FOUND(c, f->number, "disagrees with %s, block %llu, about the %s at (%d,%d)%s", whom, number, names[n],
                  tallies[n]->first.x, tallies[n]->first.y, tallies[n]->count > 1 ? " and elsewhere" : "");
}

/* A run of vertices through a block's grid. */
typedef struct run {
    const rqt_block *block;
    int32_t u, v, du, dv;
} run;

/* A vertex of which the block holds everything. */
static bool is_kept(const rqt_block *b, size_t i) {
    const size_t n = ((size_t)1 << b->k) + 1, last = n - 1;
    return !b->sparse || b->error[i] > b->floor || b->flags[i] & RQT_OUTLINE ||
           (i % n % last == 0 && i / n % last == 0);
}

static bool is_root_corner(const rqt_lattice *lattice, rqt_vertex v) {
    const int32_t side = 1 << lattice->K;
    return (v.x == 0 || v.x == side) && (v.y == 0 || v.y == side);
}

static bool is_sample(const rqt_lattice *lattice, rqt_vertex v) {
    return v.x < lattice->width && v.y < lattice->height;
}

/* Has a triangle with this vertex for a corner an area? They all lie within the largest power of two that divides
 * both coordinates. Vertices without one, past the raster, have no error of their own. */
static bool has_area(const rqt_lattice *lattice, rqt_vertex v) {
    if (is_sample(lattice, v)) return true;
    int32_t reach = 1;
    while (reach < 1 << lattice->K && v.x % (2 * reach) == 0 && v.y % (2 * reach) == 0) reach *= 2;
    return is_root_corner(lattice, v) || (v.x - reach < lattice->width - 1 && v.y - reach < lattice->height - 1);
}

/* n vertices of the frame's block (run a) beside those of another. Heights count where there are any. */
static void compare(const check *c, const frame *f, run a, run b, int32_t n, difference *d) {
    const int32_t side = (1 << f->block.k) + 1;
    for (int32_t i = 0; i < n; i++) {
        const int32_t u = a.u + i * a.du, v = a.v + i * a.dv;
        const size_t p = (size_t)(v * side + u), q = (size_t)((b.v + i * b.dv) * side + b.u + i * b.du);
        const rqt_vertex at = {f->place.x + u * f->place.stride, f->place.y + v * f->place.stride};
        if (!has_area(&c->t->lattice, at)) continue;
        const bool kept = is_kept(a.block, p), kept_there = is_kept(b.block, q);
        if (!kept || !kept_there) {
            const rqt_code floor = kept ? b.block->floor : a.block->floor;
            const rqt_code error = kept ? a.block->error[p] : b.block->error[q];
            if ((kept || kept_there) && error > floor) count(&d->errors, at);
            if ((kept ? a.block->flags[p] : b.block->flags[q]) & RQT_OUTLINE) count(&d->flags, at);
            continue;
        }
        if (a.block->flags[p] != b.block->flags[q]) count(&d->flags, at);
        if (a.block->error[p] != b.block->error[q]) count(&d->errors, at);
        if ((a.block->flags[p] & b.block->flags[q] & RQT_VALID) && a.block->q[p] != b.block->q[q])
            count(&d->heights, at);
    }
}

/* --------------------------------------------------------------------------------------------- reading blocks */

/* Decode a block's bytes into the cache, with its corners from its summary; NULL when they are not that block's.
 * say: and tell why. */
static const rqt_block *decode(check *c, rqt_block_number number, const rqt_block_place *place,
                               const rqt_summary *summary, const void *bytes, size_t size, bool say) {
    rqt_block_header header;
    rqt_message why = {""};
    if (rqt_block_info(bytes, size, &header, &why) != RQT_OK) {
        if (say) FOUND(c, number, "does not decode: %s", why.text);
        return NULL;
    }
    if (header.k != c->t->k || header.width != place->width || header.height != place->height) {
        if (say)
            FOUND(c, number, "does not fit its place: k %d, %d x %d heights instead of k %d, %d x %d", header.k,
                  header.width, header.height, c->t->k, place->width, place->height);
        return NULL;
    }
    if (header.sparse != (place->stride > 1)) {
        if (say)
            FOUND(c, number, "does not fit its place: it keeps %s",
                  header.sparse ? "some vertices" : "all vertices");
        return NULL;
    }
    if (say && header.sparse && header.floor != summary->tol.em)
        FOUND(c, number, "has the floor %d, and em %d in its summary", header.floor, summary->tol.em);
    if (say && header.quantum != c->quantum)
        FOUND(c, number, "has the height quantum %.17g, the terrain has %.17g", header.quantum, c->quantum);
    const rqt_block *block = block_cache_find(c->cache, 0, number);
    if (block) return block;
    rqt_block *fresh = block_cache_add(c->cache, 0, number, c->t->k);
    const rqt_status status = fresh ? rqt_block_decode(c->codec, bytes, size, fresh) : RQT_NO_MEMORY;
    if (status == RQT_OK) rqt_block_set_corners(fresh, summary);
    if (status == RQT_OK) return fresh;
    if (fresh) block_cache_forget(c->cache, 0, number);
    if (status == RQT_NO_MEMORY) {
        c->code = SQLITE_NOMEM;
    } else if (say) {
        (void)rqt_block_check(c->codec, bytes, size, &why);
        FOUND(c, number, "does not decode: %s", why.text);
    }
    return NULL;
}

/* Step to the row of a block; true when it is there. The caller resets the statement. */
static bool step_to(check *c, sqlite3_stmt *s, rqt_block_number number, bool say) {
    sqlite3_bind_int64(s, 1, (sqlite3_int64)number);
    const int code = sqlite3_step(s);
    if (code == SQLITE_ROW) return true;
    const int primary = code & 0xFF;
    const bool damage = primary == SQLITE_CORRUPT || primary == SQLITE_ERROR;
    if (code != SQLITE_DONE && (say || !damage)) failed(c, code, number, "reading its row");
    return false;
}

static const void *column_bytes(check *c, int column, size_t *size) {
    const void *bytes = sqlite3_column_blob(c->row, column);
    *size = bytes ? (size_t)sqlite3_column_bytes(c->row, column) : 0;
    if (!bytes && sqlite3_column_type(c->row, column) == SQLITE_BLOB && sqlite3_errcode(c->db) == SQLITE_NOMEM)
        c->code = SQLITE_NOMEM;
    return bytes;
}

/* The block and summary of a frame whose place is known. */
static void read_frame(check *c, frame *f) {
    f->has_block = f->has_summary = false;
    const bool there = step_to(c, c->row, f->number, true);
    if (there) {
        size_t size;
        const void *bytes = column_bytes(c, 0, &size);
        f->has_summary = bytes && rqt_summary_decode(bytes, size, &f->summary) == RQT_OK;
        if (!f->has_summary) FOUND(c, f->number, "has a damaged summary: its %d bytes do not decode", (int)size);
        bytes = column_bytes(c, 1, &size);
        const rqt_block *block =
            ended(c) || !f->has_summary ? NULL : decode(c, f->number, &f->place, &f->summary, bytes, size, true);
        if (block) {
            const size_t side = ((size_t)1 << block->k) + 1;
            memcpy(f->block.q, block->q, side * side * sizeof *block->q);
            memcpy(f->block.error, block->error, side * side * sizeof *block->error);
            memcpy(f->block.flags, block->flags, side * side);
            f->block.sparse = block->sparse;
            f->block.floor = block->floor;
            f->has_block = true;
        }
    }
    const int code = sqlite3_reset(c->row);
    if (!there && code == SQLITE_OK) FOUND(c, f->number, "is missing: it has no row");
}

/* A neighbour's block, or NULL: its own turn to be told of comes elsewhere. */
static const rqt_block *read_neighbour(check *c, rqt_block_number number, const rqt_block_place *place) {
    const rqt_block *block = block_cache_find(c->cache, 0, number);
    if (block || ended(c)) return block;
    if (step_to(c, c->row, number, false)) {
        size_t size;
        rqt_summary summary;
        const void *bytes = column_bytes(c, 0, &size);
        const bool readable = bytes && rqt_summary_decode(bytes, size, &summary) == RQT_OK;
        bytes = column_bytes(c, 1, &size);
        if (!ended(c) && readable) block = decode(c, number, place, &summary, bytes, size, false);
    }
    sqlite3_reset(c->row);
    return block;
}

/* ------------------------------------------------------------------------------------------- inside one block */

/* The grid place of a lattice vertex in the frame's block, or -1. */
static ptrdiff_t place_in(const frame *f, rqt_vertex v) {
    const int32_t dx = v.x - f->place.x, dy = v.y - f->place.y;
    if (dx < 0 || dy < 0 || dx > f->place.side || dy > f->place.side) return -1;
    return (ptrdiff_t)(dy / f->place.stride) * ((1 << f->block.k) + 1) + dx / f->place.stride;
}

typedef struct inside {
    tally infinite, unsaturated, too_small, no_outline;
} inside;

/* One triangle that vertex m splits: apex p, its hypotenuse through m at a right angle to the way from m to p. Of
 * the samples it holds these four are at hand, which is enough to catch an error that is too good to be true. */
static void check_triangle(const check *c, const frame *f, rqt_vertex m, rqt_vertex p, inside *found) {
    const rqt_lattice *lattice = &c->t->lattice;
    const int32_t dx = p.x - m.x, dy = p.y - m.y;
    const rqt_vertex left = {m.x - dy, m.y + dx}, right = {m.x + dy, m.y - dx};
    const ptrdiff_t at = place_in(f, m), apex = place_in(f, p), l = place_in(f, left), r = place_in(f, right);
    if (l < 0 || r < 0 || !is_sample(lattice, p) || !is_sample(lattice, left) || !is_sample(lattice, right)) return;
    const rqt_block *b = &f->block;
    const int all = b->flags[at] & b->flags[apex] & b->flags[l] & b->flags[r] & RQT_VALID;
    const int any = (b->flags[at] | b->flags[apex] | b->flags[l] | b->flags[r]) & RQT_VALID;
    if (any && !all && !(b->flags[at] & RQT_OUTLINE)) count(&found->no_outline, m);
    if (!all) return;
    const int64_t twice = 2 * (int64_t)b->q[at] - b->q[l] - b->q[r];
    const uint64_t size = (uint64_t)(twice < 0 ? -twice : twice);
    /* The exact comparison is slow; nearly always a double is far enough from equality to decide. */
    if (rqt_code_metres(b->error[at]) > (double)size * 0.5 * c->quantum * (1 + 1e-9)) return;
    if (b->error[at] < rqt_code_from_quanta(&c->t->unit, 0, size, 2)) count(&found->too_small, m);
}

static void check_inside(check *c, frame *f) {
    const rqt_lattice *lattice = &c->t->lattice;
    const int32_t n = (1 << f->block.k) + 1;
    inside found = {0};
    for (int32_t v = 0; v < n; v++) {
        for (int32_t u = 0; u < n; u++) {
            const rqt_vertex at = {f->place.x + u * f->place.stride, f->place.y + v * f->place.stride};
            const size_t i = (size_t)(v * n + u);
            const rqt_code error = f->block.error[i];
            if (!is_kept(&f->block, i)) continue;
            const bool root_corner = is_root_corner(lattice, at);
            if ((error == RQT_CODE_INFINITY) != root_corner) count(&found.infinite, at);
            if (error != RQT_CODE_INFINITY && error > c->max_error) c->max_error = error;
            rqt_vertex parents[2];
            for (int p = rqt_vertex_parents(lattice, at, parents); p-- > 0;) {
                const ptrdiff_t above = place_in(f, parents[p]);
                if (above < 0) continue;
                const int outline = f->block.flags[i] & ~f->block.flags[above] & RQT_OUTLINE;
                if ((f->block.error[above] < error || outline) && has_area(lattice, parents[p]))
                    count(&found.unsaturated, parents[p]);
                check_triangle(c, f, at, parents[p], &found);
            }
        }
    }
    tell_tally(c, f, &found.infinite, "has infinite errors elsewhere than at the root's corners, or not there");
    tell_tally(c, f, &found.unsaturated, "has a vertex with less error or outline than one that depends on it");
    tell_tally(c, f, &found.too_small, "has an error smaller than what its vertex itself is off");
    tell_tally(c, f, &found.no_outline, "has a vertex between data and void without outline bit");
}

/* Voids and heights, each sample in one block only: the one it begins, or the last. */
static void count_samples(check *c, const frame *f) {
    const int32_t n = (1 << f->block.k) + 1;
    const rqt_lattice *lattice = &c->t->lattice;
    for (int32_t v = 0; v < f->place.height; v++) {
        for (int32_t u = 0; u < f->place.width; u++) {
            const rqt_vertex at = {f->place.x + u, f->place.y + v};
            if ((u == n - 1 && at.x < lattice->width - 1) || (v == n - 1 && at.y < lattice->height - 1)) continue;
            const size_t i = (size_t)(v * n + u);
            if (!(f->block.flags[i] & RQT_VALID)) {
                c->voids++;
                continue;
            }
            if (f->block.q[i] < c->min_q) c->min_q = f->block.q[i];
            if (f->block.q[i] > c->max_q) c->max_q = f->block.q[i];
        }
    }
}

/* ------------------------------------------------------------------------- a block and those around and above */

static bool is_vertex(const rqt_summary_vertex *s, const rqt_block *b, int32_t u, int32_t v) {
    const size_t i = (size_t)(v * ((1 << b->k) + 1) + u);
    return s->error == b->error[i] && s->flags == b->flags[i] && (!(s->flags & RQT_VALID) || s->q == b->q[i]);
}

static void check_summary(check *c, const frame *f, const frame *parent) {
    const rqt_summary *s = &f->summary;
    const int32_t last = 1 << c->t->k, half = last / 2;
    static const char *const corners[] = {"north-west", "north-east", "south-west", "south-east"};
    if (f->has_block) {
        for (int n = 0; n < 4; n++)
            if (!is_vertex(&s->corner[n], &f->block, n & 1 ? last : 0, n & 2 ? last : 0))
                FOUND(c, f->number, "has another %s corner in its summary than in its data", corners[n]);
        const size_t center = (size_t)(half * (last + 1) + half);
        const rqt_code error = c->t->k > 0 ? f->block.error[center] : 0;
        const uint8_t flags = c->t->k > 0 ? f->block.flags[center] : 0;
        if (c->t->k > 0 && !is_kept(&f->block, center)
                ? s->center_error > f->block.floor || s->center_flags & RQT_OUTLINE
                : s->center_error != error || s->center_flags != flags)
            FOUND(c, f->number, "has another centre in its summary than in its data");
    }
    /* The far vertices are the parent's corners beside the one that the block shares with it. */
    const int shared = (f->place.i & 1) | (f->place.j & 1) << 1;
    for (int n = 0; n < 2; n++) {
        const rqt_summary_vertex *far = &s->far[n];
        const int corner = shared ^ (n ? 2 : 1);
        if (!parent) {
            if (far->q || far->error || far->flags) FOUND(c, f->number, "is the root, yet has far vertex %d", n);
        } else if (parent->has_block &&
                   !is_vertex(far, &parent->block, corner & 1 ? last : 0, corner & 2 ? last : 0)) {
            FOUND(c, f->number, "has another far vertex %d in its summary than the data of block %llu", n,
                  parent->number);
        }
    }
    const rqt_interval root = {0, RQT_CODE_INFINITY};
    const rqt_interval tol = parent ? parent->summary.tol : root, exact = parent ? parent->summary.exact : root;
    if (parent && !parent->has_summary) return;
    if (s->tol.em_parent != (parent ? tol.em : RQT_CODE_INFINITY) ||
        s->exact.em_parent != (parent ? exact.em : RQT_CODE_INFINITY))
        FOUND(c, f->number, "has another em_parent than its parent has em");
}

static void check_neighbours(check *c, const frame *f) {
    const int32_t last = 1 << c->t->k;
    for (int south = 0; south < 2; south++) {
        const rqt_block_number number =
            rqt_block_number_of(f->place.level, f->place.i + (south ? 0 : 1), f->place.j + (south ? 1 : 0));
        rqt_block_place place;
        /* Past the last cell the number wraps into another level, or the place is past the raster. */
        if (((south ? f->place.j : f->place.i) + 1) >> f->place.level) continue;
        if (rqt_block_locate(&c->t->lattice, c->t->k, number, &place) != RQT_OK) continue;
        const rqt_block *other = read_neighbour(c, number, &place);
        if (!other) continue;
        difference d = {0};
        if (south)
            compare(c, f, (run){&f->block, 0, last, 1, 0}, (run){other, 0, 0, 1, 0}, last + 1, &d);
        else
            compare(c, f, (run){&f->block, last, 0, 0, 1}, (run){other, 0, 0, 0, 1}, last + 1, &d);
        tell_difference(c, f, &d, south ? "its southern neighbour" : "its eastern neighbour", number);
    }
}

/* Every second vertex of a child is one of its parent. */
static void check_parent(check *c, const frame *f, const frame *parent) {
    const int32_t half = 1 << c->t->k >> 1;
    const int32_t u = f->place.i & 1 ? half : 0, v = f->place.j & 1 ? half : 0;
    difference d = {0};
    for (int32_t row = 0; row <= half; row++)
        compare(c, f, (run){&f->block, 0, 2 * row, 2, 0}, (run){&parent->block, u, v + row, 1, 0}, half + 1, &d);
    tell_difference(c, f, &d, "its parent", parent->number);
}

/* The ends of an index row's interval, said anew on purpose: shared with the writer, its mistakes would be ours. */
static void index_interval(rqt_interval interval, int32_t ends[2]) {
    const bool answers = interval.em < interval.em_parent;
    ends[0] = answers ? interval.em : STORE_NEVER;
    ends[1] = answers ? interval.em_parent - 1 : STORE_NEVER;
}

static void check_index(check *c, const frame *f) {
    if (!c->index) return;
    static const char *const names[] = {"extent",
                                        "extent",
                                        "extent",
                                        "extent",
                                        "interval of outline tol",
                                        "interval of outline tol",
                                        "interval of outline exact",
                                        "interval of outline exact"};
    const int32_t last_x = c->t->lattice.width - 1, last_y = c->t->lattice.height - 1;
    const rqt_block_place *p = &f->place;
    int32_t right[8] = {p->x, p->x + p->side < last_x ? p->x + p->side : last_x, p->y,
                        p->y + p->side < last_y ? p->y + p->side : last_y};
    index_interval(f->summary.tol, right + 4);
    index_interval(f->summary.exact, right + 6);
    const bool wanted = right[4] != STORE_NEVER || right[6] != STORE_NEVER;
    const bool there = step_to(c, c->index, f->number, true);
    const char *wrong = NULL;
    for (int n = 0; n < 8 && there && !wrong; n++)
        if (sqlite3_column_int64(c->index, n) != right[n]) wrong = names[n];
    const int code = sqlite3_reset(c->index);
    if (wanted && !there && code == SQLITE_OK) FOUND(c, f->number, "is missing in the index");
    if (!wanted && there) FOUND(c, f->number, "answers nothing, yet has a row in the index");
    if (wanted && wrong) FOUND(c, f->number, "has another %s in the index than it should", wrong);
}

/* -------------------------------------------------------------------------------------------------- the walk */

/* What a child adds to its parent's em: vertices of its grid that the parent's has not, and all below. */
static void fold(frame *parent, const frame *f) {
    if (!f->has_block || !f->em_known) parent->em_known = false;
    if (!parent->em_known) return;
    const int32_t n = (1 << f->block.k) + 1;
    rqt_code em = f->em > parent->em ? f->em : parent->em;
    int flags = f->outline || parent->outline ? RQT_OUTLINE : 0;
    for (int32_t v = 0; v < n; v++) {
        for (int32_t u = v & 1 ? 0 : 1; u < n; u += v & 1 ? 1 : 2) {
            const size_t i = (size_t)(v * n + u);
            if (f->block.error[i] > em) em = f->block.error[i];
            flags |= f->block.flags[i];
        }
    }
    parent->em = em;
    parent->outline = flags & RQT_OUTLINE;
}

/* Children past the raster are in no table, though their vertices can have errors, taken over from descendants on
 * this side. But up to the column (or row) where such a child begins the lattice is its own mirror image: the same
 * descendants are those of the mirrored vertex, in the child that is there. So nothing is missed. */
static void check_em(check *c, const frame *f) {
    if (!f->em_known || !f->has_summary) return;
    const rqt_interval *stored[2] = {&f->summary.tol, &f->summary.exact};
    static const char *const names[] = {"tol", "exact"};
    for (int exact = 0; exact < 2; exact++) {
        const rqt_code seen = exact && f->outline ? RQT_CODE_INFINITY : f->em;
        if (stored[exact]->em != seen)
            FOUND(c, f->number, "has em %d for outline %s; the blocks below say %d", stored[exact]->em,
                  names[exact], seen);
    }
}

static void visit(check *c, int level, int32_t i, int32_t j) {
    frame *f = &c->frames[level], *parent = level > 0 ? f - 1 : NULL;
    f->number = rqt_block_number_of(level, i, j);
    if (rqt_block_locate(&c->t->lattice, c->t->k, f->number, &f->place) != RQT_OK) return;
    f->em = 0;
    f->outline = false;
    f->em_known = true;
    read_frame(c, f);
    if (f->has_block) {
        check_inside(c, f);
        if (f->place.stride == 1) count_samples(c, f);
        check_neighbours(c, f);
        if (parent && parent->has_block) check_parent(c, f, parent);
    } else {
        c->errors_known = false;
        if (f->place.stride == 1) c->samples_known = false;
    }
    if (f->has_summary) {
        check_summary(c, f, parent);
        check_index(c, f);
    }
    for (int child = 0; child < 4 && f->place.stride > 1 && !ended(c); child++)
        visit(c, level + 1, 2 * i + (child & 1), 2 * j + (child >> 1));
    check_em(c, f);
    if (parent) fold(parent, f);
}

/* --------------------------------------------------------------------------------------------- tables and row */

/* sql is taken over. A table that is not there is a finding; *out stays NULL. */
static void prepare(check *c, sqlite3_stmt **out, char *sql, const char *doing) {
    if (ended(c)) {
        sqlite3_free(sql);
        return;
    }
    const int code = sql ? sqlite3_prepare_v2(c->db, sql, -1, out, NULL) : SQLITE_NOMEM;
    sqlite3_free(sql);
    if (code == SQLITE_NOMEM)
        c->code = code;
    else if (code != SQLITE_OK)
        failed(c, code, 0, doing);
}

/* Rows that no cell demands. sizes: sum up rows and bytes too. */
static void scan_ids(check *c, char *sql, const char *what, int64_t *rows, int64_t *bytes) {
    sqlite3_stmt *s = NULL;
    prepare(c, &s, sql, what);
    int code = SQLITE_DONE;
    while (s && !ended(c) && (code = sqlite3_step(s)) == SQLITE_ROW) {
        const rqt_block_number number = (rqt_block_number)sqlite3_column_int64(s, 0);
        rqt_block_place place;
        ++*rows;
        *bytes += sqlite3_column_int64(s, 1);
        if (rqt_block_locate(&c->t->lattice, c->t->k, number, &place) != RQT_OK)
            FOUND(c, number, "has a row in %s, but the terrain has no such block", what);
    }
    if (code != SQLITE_DONE && code != SQLITE_ROW) failed(c, code, 0, what);
    sqlite3_finalize(s);
}

/* SQLite's own check of the R-tree's nodes, where it is compiled in. */
static void check_rtree(check *c) {
    sqlite3_stmt *s = NULL;
    char *sql = sqlite3_mprintf("SELECT rtreecheck(%Q, 'rqt_index_%lld')", c->t->schema, c->t->id);
    if (!sql) {
        c->code = SQLITE_NOMEM;
        return;
    }
    int code = sqlite3_prepare_v2(c->db, sql, -1, &s, NULL);
    sqlite3_free(sql);
    if (code == SQLITE_NOMEM) c->code = code;
    if (!s) return;
    code = sqlite3_step(s);
    if (code == SQLITE_ROW) {
        const char *said = (const char *)sqlite3_column_text(s, 0);
        if (!said || strcmp(said, "ok") != 0)
            FOUND(c, 0, "has a damaged index: %s", said ? said : "rtreecheck fails");
    } else {
        failed(c, code, 0, "rtreecheck");
    }
    sqlite3_finalize(s);
}

static void check_row(check *c, const char *what, int64_t stored, int64_t real) {
    if (stored != real) FOUND(c, 0, "has %s %lld in its row; its blocks say %lld", what, stored, real);
}

static void check_tables(check *c) {
    const store_terrain *t = c->t;
    int64_t blocks = 0, bytes = 0, indexed = 0, none = 0;
    scan_ids(c,
             sqlite3_mprintf(
                 "SELECT id, ifnull(length(summary), 0) + ifnull(length(data), 0) FROM \"%w\".rqt_block_%lld",
                 t->schema, t->id),
             "the block table", &blocks, &bytes);
    scan_ids(c, sqlite3_mprintf("SELECT id, 0 FROM \"%w\".rqt_index_%lld", t->schema, t->id), "the index", &indexed,
             &none);
    check_rtree(c);
    check_row(c, "blocks", t->blocks, blocks);
    check_row(c, "bytes", t->bytes, bytes);
    if (c->samples_known) {
        const bool any = c->min_q <= c->max_q;
        check_row(c, "voids", t->voids, c->voids);
        check_row(c, "min_q", t->min_q, any ? c->min_q : 0);
        check_row(c, "max_q", t->max_q, any ? c->max_q : 0);
    }
    if (c->errors_known) check_row(c, "max_error", t->max_error, c->max_error);
}

static bool create(check *c) {
    c->cache = block_cache_create(store_allocator(), CACHE_BYTES);
    if (!c->cache || rqt_codec_create(store_allocator(), &c->codec) != RQT_OK) return false;
    const int levels = rqt_block_levels(&c->t->lattice, c->t->k);
    for (int level = 0; level < levels; level++)
        if (rqt_block_create(c->t->k, store_allocator(), &c->frames[level].block) != RQT_OK) return false;
    return true;
}

static void destroy(check *c) {
    sqlite3_finalize(c->row);
    sqlite3_finalize(c->index);
    sqlite3_finalize(c->held);
    for (int level = 0; level <= RQT_MAX_K; level++) rqt_block_free(&c->frames[level].block, store_allocator());
    block_cache_free(c->cache);
    rqt_codec_free(c->codec);
}

int store_check(store *s, const store_terrain *t, bool (*tell_one)(void *context, const store_finding *finding),
                void *context, char **error) {
    check c = {.db = store_connection(s),
               .t = t,
               .quantum = store_quantum(t),
               .samples_known = true,
               .min_q = INT32_MAX,
               .max_q = INT32_MIN,
               .errors_known = true,
               .tell = tell_one,
               .context = context,
               .error = error};
    if (t->problem) {
        const store_finding unusable = {"error", 0, t->problem};
        (void)tell_one(context, &unusable);
        return SQLITE_OK;
    }
    if (!t->complete) {
        /* Nothing more is promised of it. */
        tell(&c, "error", 0, "is incomplete: its import did not finish");
        return c.code;
    }
    if (!create(&c)) c.code = SQLITE_NOMEM;
    prepare(&c, &c.held, sqlite3_mprintf("SELECT id FROM \"%w\".rqt_terrain", t->schema), "reading rqt_terrain");
    const int code = c.held ? sqlite3_step(c.held) : SQLITE_ROW;
    if (code != SQLITE_ROW) failed(&c, code, 0, "reading rqt_terrain");
    prepare(&c, &c.row,
            sqlite3_mprintf("SELECT summary, data FROM \"%w\".rqt_block_%lld WHERE id = ?1", t->schema, t->id),
            "its block table");
    prepare(&c, &c.index,
            sqlite3_mprintf(
                "SELECT x0, x1, y0, y1, tol0, tol1, exact0, exact1 FROM \"%w\".rqt_index_%lld WHERE id = ?1",
                t->schema, t->id),
            "its index");
    if (c.row && !ended(&c)) visit(&c, 0, 0, 0);
    if (c.row && !ended(&c)) check_tables(&c);
    destroy(&c);
    if (!ended(&c)) c.code = store_check_fill(s, t, tell_one, context, error);
    if (!ended(&c)) c.code = store_check_minimal(s, t, tell_one, context, error);
    return c.code;
}
