/* terrarium_leaves.c - pixels of the levels that have pixels larger than samples: on a mesh whose vertices are
 * about as far apart as pixels, and a proof of how far every sample is from what is drawn, without looking at
 * samples.
 *
 * The mesh. Blocks of one level of the pyramid tile the terrain. Each, of stride s, keeps the vertices of its
 * lattice whose error is above its em, and those of the outline, which with its corners are a closed set; no vertex
 * finer than s has an error above em. So a leaf of that set in the block's cell, with three valid corners, has each
 * of its valid samples within em of its plane. Which mesh that is depends on the place alone. (Two blocks need not
 * agree on what they have in common, for their em differ; each is within its own.)
 *
 * The proof. Let B be what clients draw. A sample in the leaf T is at most em + sup over T of |plane(T) - B| from
 * it. Instead of B we look at B', which has the same pixels and is bilinear between them in longitude and latitude:
 * on a strip between two rows of pixels the share of the lower row differs by at most
 *
 *     h^2 max|M''| / (8 (M1 - M0)),       M the Mercator ordinate, M'' = sin(phi) / cos(phi)^2, h the strip's
 * height
 *
 * which, times what the two rows differ by, is `bent`. On what a leaf has in common with a cell of four pixels,
 * plane - B' is k u v + linear in the cell's own u, v: a saddle, without extremes inside. So its extremes lie on
 * the border. On sides that run along u or v it is linear, so that they are at ends: at corners of the leaf, at
 * places where sides of the leaf cross lines of pixels, or at pixels, where the leaf's own height was rounded to
 * the code. On sides that slant it is a parabola, at most |k du dv| / 4 from the chord. So it is enough to walk
 * along the sides of leaves from line to line.
 *
 * em may be as much as all the rest. But it is only the largest sum that counts, and how large it is at least is
 * known: vertices are samples. So a block whose sum is more than TIGHT times that gives way to its children, whose
 * em are smaller, down to where there is nothing finer than vertices: branch and bound, as in core/update. Few
 * blocks do, and when it is noise, and there would be many, we stop after MOST_SPLITS.
 *
 * Voids. Samples in leaves that are not kept are within nothing of anything. So a pixel is void when its square,
 * half a pixel around its centre, meets such a leaf: then no sample in one has four pixels of terrain around it.
 */
#include "terrarium.h"

#include <math.h>
#include <string.h>

#define DEGREE 0.017453292519943295
/* Samples by which a pixel may be beyond a leaf's side and be taken for in it, so that none falls between two. */
#define SLACK 0x1p-30
/* Metres: that pixels lie on their leaves but for rounding, two steps at 0 m; and what doubles and SLACK are. */
#define ROUNDED 1e-4

typedef struct corner {
    double col, row, metres;
    bool valid;
    int i, j; /* on the block's lattice */
} corner;

#define TIGHT 1.2
enum { MOST_SPLITS = 48 };
enum { DRAW, MEASURE };
enum { MOST_SIDE = (1 << RQT_MAX_BLOCK_K) + 1 };

typedef struct walk {
    pixel_grid *g;
    const rqt_block *block;
    int what;
    size_t n;                                       /* vertices of the block's lattice a side */
    double col[MOST_SIDE], row[MOST_SIDE];          /* of its columns and rows, in samples */
    int first_col[MOST_SIDE], first_row[MOST_SIDE]; /* the pixels that are at them or next beyond */
    double worst; /* of |plane - B'| so far, for this block; < 0: none of it is between pixels of terrain */
    double seen;  /* of |sample - B'|, for all */
    int splits;
    struct measured *list; /* the blocks that were measured */
    size_t count, capacity;
} walk;

/* A block on a turn, and what its samples are off at most. */
typedef struct measured {
    rqt_block_number number;
    int turn;
    double bound;
} measured;

/* Extent in columns of what a leaf has between two rows; false: nothing. */
static bool find_span(const corner leaf[3], double from, double to, double *west, double *east) {
    *west = HUGE_VAL;
    *east = -HUGE_VAL;
    for (int a = 0; a < 3; a++) {
        const corner *p = &leaf[a], *q = &leaf[a == 2 ? 0 : a + 1];
        if (p->row >= from && p->row <= to) {
            *west = fmin(*west, p->col);
            *east = fmax(*east, p->col);
        }
        for (int b = 0; b < 2; b++) {
            const double row = b ? to : from;
            if ((p->row < row) == (q->row < row)) continue;
            const double col = p->col + (q->col - p->col) * ((row - p->row) / (q->row - p->row));
            *west = fmin(*west, col);
            *east = fmax(*east, col);
        }
    }
    return *west <= *east;
}

/* The leaf's box: columns and rows of the lattice. */
typedef struct box {
    int west, east, north, south;
} box;

static box box_of(const corner leaf[3]) {
    box b = {leaf[0].i, leaf[0].i, leaf[0].j, leaf[0].j};
    for (int a = 1; a < 3; a++) {
        if (leaf[a].i < b.west) b.west = leaf[a].i;
        if (leaf[a].i > b.east) b.east = leaf[a].i;
        if (leaf[a].j < b.north) b.north = leaf[a].j;
        if (leaf[a].j > b.south) b.south = leaf[a].j;
    }
    return b;
}

/* Pixels on a kept leaf get its height, if they have none. */
static void draw_leaf(const walk *w, const corner leaf[3]) {
    pixel_grid *g = w->g;
    const box b = box_of(leaf);
    const double south = w->row[b.south] + SLACK, x1 = leaf[1].col - leaf[0].col, x2 = leaf[2].col - leaf[0].col;
    const double y1 = leaf[1].row - leaf[0].row, y2 = leaf[2].row - leaf[0].row, area = x1 * y2 - x2 * y1;
    const double z1 = leaf[1].metres - leaf[0].metres, z2 = leaf[2].metres - leaf[0].metres;
    const double by_col = (z1 * y2 - z2 * y1) / area, by_row = (x1 * z2 - x2 * z1) / area;
    for (int j = w->first_row[b.north]; j < GRID && g->row[j] <= south; j++) {
        double west, east;
        if (!find_span(leaf, g->row[j] - SLACK, g->row[j] + SLACK, &west, &east)) continue;
        for (int i = w->first_col[b.west]; i < GRID && g->col[i] <= east + SLACK; i++) {
            int32_t *code = &g->code[j * GRID + i];
            if (*code != UNKNOWN || g->col[i] < west - SLACK) continue;
            *code = pixels_code(g, leaf[0].metres + (g->col[i] - leaf[0].col) * by_col +
                                       (g->row[j] - leaf[0].row) * by_row);
        }
    }
}

/* Pixels whose square meets a leaf that is not kept are void. Squares reach to the middle between pixels, and a
 * little further, or a place on the line between two might be nobody's. */
static void void_leaf(const walk *w, const corner leaf[3]) {
    pixel_grid *g = w->g;
    const box b = box_of(leaf);
    const double half = 0.5 / g->per_col + SLACK;
    for (int j = w->first_row[b.north] > 0 ? w->first_row[b.north] - 1 : 0; j < GRID; j++) {
        const double up = j > 0 ? g->row[j] - g->row[j - 1] : 0,
                     down = j + 1 < GRID ? g->row[j + 1] - g->row[j] : 0;
        /* The middle in Mercator's plane is not the one in latitude: a quarter more. */
        const double from = g->row[j] - 0.625 * up - SLACK, to = g->row[j] + 0.625 * down + SLACK;
        double west, east;
        if (from > w->row[b.south]) break;
        if (!find_span(leaf, from, to, &west, &east)) continue;
        for (int i = w->first_col[b.west] > 0 ? w->first_col[b.west] - 1 : 0; i < GRID; i++) {
            if (g->col[i] - half > east) break;
            if (g->col[i] + half >= west) g->code[j * GRID + i] = NO_HEIGHT;
        }
    }
}

/* Along a side of a leaf, from one line of pixels to the next. */
static void measure_side(walk *w, const corner *a, const corner *b) {
    const pixel_grid *g = w->g;
    const double dc = b->col - a->col, dr = b->row - a->row, dz = b->metres - a->metres;
    int i = w->first_col[a->i], j = w->first_row[a->j]; /* the lines that come next */
    if (dc >= 0 && i < GRID && g->col[i] <= a->col) i++;
    if (dr >= 0 && j < GRID && g->row[j] <= a->row) j++;
    if (dc < 0) i--;
    if (dr < 0) j--;
    const int right = dc < 0 ? -1 : 1, down = dr < 0 ? -1 : 1;
    for (double t = 0; t < 1;) {
        const double at_col = dc != 0 && i >= 0 && i < GRID ? (g->col[i] - a->col) / dc : 2;
        const double at_row = dr != 0 && j >= 0 && j < GRID ? (g->row[j] - a->row) / dr : 2;
        const int cell_col = dc < 0 ? i : i - 1, cell_row = dr < 0 ? j : j - 1;
        const double next = fmax(fmin(fmin(at_col, at_row), 1), t);
        const size_t at = (size_t)cell_row * GRID + (size_t)cell_col;
        if (cell_col >= 0 && cell_row >= 0 && cell_col + 1 < GRID && cell_row + 1 < GRID && g->is_whole[at]) {
            const double du = dc * g->per_col, dv = dr * g->per_row[cell_row];
            const double u = (a->col - g->col[cell_col]) * g->per_col,
                         v = (a->row - g->row[cell_row]) * g->per_row[cell_row];
            const double from = a->metres + t * dz - pixels_between(g, at, u + t * du, v + t * dv);
            const double to = a->metres + next * dz - pixels_between(g, at, u + next * du, v + next * dv);
            const double *h = g->height + at;
            const double bulge =
                fabs((h[0] - h[1] - h[GRID] + h[GRID + 1]) * du * dv) * (next - t) * (next - t) / 4;
            const double off = fmax(fabs(from), fabs(to)) + bulge;
            if (off > w->worst) w->worst = off;
            if (t == 0 && fabs(from) > w->seen) w->seen = fabs(from);
        }
        if (next >= 1) break;
        if (at_col <= next) i += right;
        if (at_row <= next) j += down;
        t = next;
    }
}

/* ------------------------------------------------------------------------------------------------- the walk -- */

static corner corner_at(const walk *w, int i, int j) {
    const size_t at = (size_t)j * w->n + (size_t)i;
    return (corner){.col = w->col[i],
                    .row = w->row[j],
                    .metres = rqt_unit_metres(&w->g->terrain->unit, w->block->q[at]),
                    .valid = w->block->flags[at] & RQT_VALID,
                    .i = i,
                    .j = j};
}

static bool misses(const walk *w, const corner leaf[3]) {
    const box b = box_of(leaf);
    const pixel_grid *g = w->g;
    if (w->col[b.west] == w->col[b.east] || w->row[b.north] == w->row[b.south]) return true; /* no area */
    /* Pixels beyond the outermost need nothing, and void ones next to a leaf are within the strip around. */
    return w->first_col[b.west] == GRID || w->first_row[b.north] == GRID || w->col[b.east] < g->col[0] ||
           w->row[b.south] < g->row[0];
}

/* Leaves with no area after clamping have nothing in them. */
static bool has_area(const corner leaf[3]) {
    return (leaf[1].col - leaf[0].col) * (leaf[2].row - leaf[0].row) !=
           (leaf[2].col - leaf[0].col) * (leaf[1].row - leaf[0].row);
}

/* A side that two leaves of the block have is measured with the one that goes along it eastward, or southward. */
static bool is_ours(const walk *w, const corner *p, const corner *q) {
    if (q->col > p->col || (q->col == p->col && q->row > p->row) || w->g->terrain->voids > 0) return true;
    const double *col = w->col, *row = w->row;
    return (p->col == q->col && (p->col == col[0] || p->col == col[w->n - 1])) ||
           (p->row == q->row && (p->row == row[0] || p->row == row[w->n - 1]));
}

static void visit(walk *w, const corner leaf[3]) {
    const bool kept = leaf[0].valid && leaf[1].valid && leaf[2].valid;
    if (!has_area(leaf)) return;
    if (w->what == DRAW) {
        if (kept)
            draw_leaf(w, leaf);
        else
            void_leaf(w, leaf);
    } else if (kept) {
        for (int a = 0; a < 3; a++) {
            const corner *p = &leaf[a], *q = &leaf[a == 2 ? 0 : a + 1];
            if (is_ours(w, p, q)) measure_side(w, p, q);
        }
    }
}

/* leaf: apex, left, right. */
static void walk_triangle(walk *w, const corner leaf[3]) {
    const corner *a = &leaf[0], *l = &leaf[1], *r = &leaf[2];
    if (misses(w, leaf)) return;
    if ((l->i + r->i) % 2 == 0 && (l->j + r->j) % 2 == 0) {
        const int i = (l->i + r->i) / 2, j = (l->j + r->j) / 2;
        const size_t at = (size_t)j * w->n + (size_t)i;
        if (w->block->error[at] > w->block->floor || (w->block->flags[at] & RQT_OUTLINE)) {
            const corner middle = corner_at(w, i, j);
            walk_triangle(w, (const corner[3]){middle, *a, *l});
            walk_triangle(w, (const corner[3]){middle, *r, *a});
            return;
        }
    }
    visit(w, leaf);
}

/* Both halves of a block. The diagonal of a cell of the lattice passes through the corner whose coordinates are
 * both odd multiples of its side. */
static void walk_block(walk *w, const rqt_block_place *p) {
    const int last = (int)w->n - 1;
    const corner nw = corner_at(w, 0, 0), ne = corner_at(w, last, 0), sw = corner_at(w, 0, last),
                 se = corner_at(w, last, last);
    if ((p->i + p->j) % 2 == 0) {
        walk_triangle(w, (const corner[3]){ne, nw, se});
        walk_triangle(w, (const corner[3]){sw, se, nw});
    } else {
        walk_triangle(w, (const corner[3]){nw, sw, ne});
        walk_triangle(w, (const corner[3]){se, ne, sw});
    }
}

/* Columns and rows of the block's lattice, and which pixels come next. */
static void place_lattice(walk *w, const rqt_block_place *p) {
    const pixel_grid *g = w->g;
    const int32_t last_col = g->terrain->lattice.width - 1, last_row = g->terrain->lattice.height - 1;
    int i = 0, j = 0;
    for (size_t n = 0; n < w->n; n++) {
        const int64_t by = (int64_t)n * p->stride, col = p->x + by, row = p->y + by;
        w->col[n] = (double)(col < last_col ? col : last_col);
        w->row[n] = (double)(row < last_row ? row : last_row);
        while (i < GRID && g->col[i] < w->col[n] - SLACK) i++;
        while (j < GRID && g->row[j] < w->row[n] - SLACK) j++;
        w->first_col[n] = i;
        w->first_row[n] = j;
    }
}

/* Stride 1: what is between vertices is no sample. */
static void measure_samples(walk *w) {
    const pixel_grid *g = w->g;
    const rqt_unit *unit = &g->terrain->unit;
    for (size_t y = 0; y < w->n; y++) {
        const int j = g->row[w->first_row[y] < GRID ? w->first_row[y] : 0] > w->row[y] ? w->first_row[y] - 1
                                                                                       : w->first_row[y];
        if (j < 0 || j >= GRID - 1) continue;
        const double v = (w->row[y] - g->row[j]) * g->per_row[j];
        for (size_t x = 0; x < w->n; x++) {
            int i = w->first_col[x];
            if (i < GRID && g->col[i] > w->col[x]) i--;
            if (i < 0 || i >= GRID - 1) continue;
            const size_t at = (size_t)j * GRID + (size_t)i, from = y * w->n + x;
            if (!g->is_whole[at] || !(w->block->flags[from] & RQT_VALID)) continue;
            const double u = (w->col[x] - g->col[i]) * g->per_col;
            const double off = fabs(pixels_between(g, at, u, v) - rqt_unit_metres(unit, w->block->q[from]));
            if (off > w->worst) w->worst = off;
        }
    }
    if (w->worst > w->seen) w->seen = w->worst;
}

/* *bound: what the samples of a block are off at most; < 0 where none is between pixels of terrain. */
static int measure_block(tiles *t, const rqt_block_place *p, rqt_block_number number, walk *w, double *bound,
                         char **error) {
    const int code = store_read_block(t->store, t->terrain, number, &w->block, error);
    if (code != SQLITE_OK) return code;
    place_lattice(w, p);
    w->worst = -1;
    if (p->stride == 1)
        measure_samples(w);
    else
        walk_block(w, p);
    *bound = w->worst;
    if (w->worst >= 0 && p->stride > 1)
        *bound = rqt_code_metres(w->block->floor) + fmax(w->worst, 1.5 * w->g->step);
    return SQLITE_OK;
}

/* A bound that is too large gives way to those of the block's children. */
static int tighten(tiles *t, rqt_block_number number, walk *w, double *bound, char **error) {
    rqt_block_place p;
    if (*bound <= TIGHT * w->seen || w->splits >= MOST_SPLITS) return SQLITE_OK;
    (void)rqt_block_locate(&t->terrain->lattice, t->terrain->k, number, &p);
    if (p.stride == 1) return SQLITE_OK;
    double bounds[4] = {-1, -1, -1, -1}, most = -1;
    rqt_block_number numbers[4];
    w->splits++;
    for (int c = 0; c < 4; c++) {
        rqt_block_place child;
        numbers[c] = rqt_block_number_of(p.level + 1, 2 * p.i + (c & 1), 2 * p.j + (c >> 1));
        if (rqt_block_locate(&t->terrain->lattice, t->terrain->k, numbers[c], &child) != RQT_OK) continue;
        const int code = measure_block(t, &child, numbers[c], w, &bounds[c], error);
        if (code != SQLITE_OK) return code;
    }
    for (int c = 0; c < 4; c++) {
        const int code = tighten(t, numbers[c], w, &bounds[c], error);
        if (code != SQLITE_OK) return code;
        most = fmax(most, bounds[c]);
    }
    *bound = fmin(*bound, most);
    return SQLITE_OK;
}

static int visit_block(tiles *t, const rqt_block_place *p, rqt_block_number number, int turn, walk *w,
                       char **error) {
    if (w->what == DRAW) {
        const int code = store_read_block(t->store, t->terrain, number, &w->block, error);
        if (code != SQLITE_OK) return code;
        place_lattice(w, p);
        walk_block(w, p);
        return SQLITE_OK;
    }
    if (w->count == w->capacity) {
        w->capacity = w->capacity ? 2 * w->capacity : 64;
        measured *list = sqlite3_realloc64(w->list, w->capacity * sizeof *list);
        if (!list) return SQLITE_NOMEM;
        w->list = list;
    }
    measured *m = &w->list[w->count++];
    *m = (measured){.number = number, .turn = turn};
    return measure_block(t, p, number, w, &m->bound, error);
}

/* All blocks of a level that meet the pixels of the turn. */
static int walk_blocks(tiles *t, int level, int turn, walk *w, char **error) {
    const rqt_lattice *lattice = &t->terrain->lattice;
    const pixel_grid *g = w->g;
    const double side = ldexp(1, lattice->K - level);
    const int32_t i0 = (int32_t)floor(fmax(g->col[0] - 1, 0) / side),
                  j0 = (int32_t)floor(fmax(g->row[0] - 1, 0) / side);
    const int32_t i1 = (int32_t)floor(fmin(g->col[GRID - 1] + 1, lattice->width - 1) / side),
                  j1 = (int32_t)floor(fmin(g->row[GRID - 1] + 1, lattice->height - 1) / side);
    for (int32_t j = j0; j <= j1; j++)
        for (int32_t i = i0; i <= i1; i++) {
            const rqt_block_number number = rqt_block_number_of(level, i, j);
            rqt_block_place place;
            if (rqt_block_locate(lattice, t->terrain->k, number, &place) != RQT_OK) continue;
            const int code = visit_block(t, &place, number, turn, w, error);
            if (code != SQLITE_OK) return code;
        }
    return SQLITE_OK;
}

static int look(tiles *t, int level, walk *w, char **error) {
    int first, last, code = SQLITE_OK;
    pixels_turns(w->g, &first, &last);
    for (int turn = first; turn <= last && code == SQLITE_OK; turn++)
        if (pixels_turn(w->g, turn)) code = walk_blocks(t, level, turn, w, error);
    return code;
}

/* The largest bound of all, when those that were too large have given way: the largest first, so that `seen` is
 * soon what it can be. */
static int find_error(tiles *t, walk *w, char **error) {
    for (;;) {
        measured *most = NULL;
        for (size_t i = 0; i < w->count; i++)
            if (!most || w->list[i].bound > most->bound) most = &w->list[i];
        if (!most || most->bound < 0) return SQLITE_OK;
        const double before = most->bound;
        (void)pixels_turn(w->g, most->turn);
        const int code = tighten(t, most->number, w, &most->bound, error);
        if (code != SQLITE_OK) return code;
        if (most->bound < before) continue;
        w->g->error = before;
        return SQLITE_OK;
    }
}

/* The most that B and B' differ by. */
static double find_bent(const pixel_grid *g) {
    const double strip = 2 * M_PI / ldexp(PIXELS, g->z);
    double most = 0;
    for (int j = 0; j + 1 < GRID; j++) {
        const double a = fabs(g->lat[j]) * DEGREE, b = fabs(g->lat[j + 1]) * DEGREE, far = fmax(a, b);
        const double h = (g->lat[j] - g->lat[j + 1]) * DEGREE;
        const double share = h * h * sin(far) / (cos(far) * cos(far)) / (8 * strip);
        double differ = 0;
        for (int i = 0; i + 1 < GRID; i++) {
            const size_t at = (size_t)j * GRID + (size_t)i;
            if (!g->is_whole[at]) continue;
            const double *p = g->height + at;
            differ = fmax(differ, fmax(fabs(p[0] - p[GRID]), fabs(p[1] - p[GRID + 1])));
        }
        most = fmax(most, share * differ);
    }
    return most;
}

int leaves_draw(tiles *t, int shift, pixel_grid *g, char **error) {
    const int levels = t->terrain->lattice.K - t->terrain->k, level = levels > shift ? levels - shift : 0;
    walk *w = sqlite3_malloc64(sizeof *w);
    if (!w) return SQLITE_NOMEM;
    *w = (walk){.g = g, .what = DRAW, .n = ((size_t)1 << t->terrain->k) + 1};
    int code = look(t, level, w, error);
    pixels_close(g);
    w->what = MEASURE;
    if (code == SQLITE_OK) code = look(t, level, w, error);
    if (code == SQLITE_OK) code = find_error(t, w, error);
    g->error += find_bent(g) + t->terrain->quantum_error + ROUNDED;
    sqlite3_free(w->list);
    sqlite3_free(w);
    return code;
}
