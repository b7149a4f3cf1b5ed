/* terrarium_proof.c - how far every sample is from what clients draw, without looking at every sample.
 *
 * Let B be what is drawn. A sample in a triangle T of the mesh is no further from it than e + sup over T of
 * |plane(T) - B|, where e is em of the block for a leaf (terrarium_leaves.c), and for a triangle that is split the
 * error of its split vertex, which is no less than that of any sample in it. Instead of B we look at B', which has
 * the same pixels and is bilinear between them in longitude and latitude: on a strip between two rows of pixels the
 * share of the lower row differs by at most
 *
 *     h^2 max|M''| / (8 (M1 - M0)),       M the Mercator ordinate, M'' = sin(phi) / cos(phi)^2, h its height
 *
 * which, times what the two rows differ by, is `bent`. On what T has in common with a cell of four pixels, plane -
 * B' is k u v + linear in the cell's own u, v: a saddle, without extremes inside. So its extremes lie on the
 * border. On sides that run along u or v it is linear, so that they are at ends: at corners of T, at places where
 * sides of T cross lines of pixels, or at pixels. On sides that slant it is a parabola, at most |k du dv| / 4 from
 * the chord. So it is enough to walk along the sides of T from line to line, and to look at the pixels in it.
 *
 * Only the largest sum counts, and how large it is at least is known: vertices are samples. So this is a branch and
 * bound, as in core/update_bound. A triangle of a sum that is no more than TIGHT times what was seen at vertices is
 * done with; any other is split; and a block in which a leaf has a larger sum gives way to its children, whose em
 * are smaller, down to stride 1, where there is nothing but vertices. Few blocks do. When it is noise, and there
 * would be many, we stop after MOST_SPLITS, and what is told is larger than need be.
 */
#include "terrarium_leaves.h"

#include <math.h>
#include <string.h>

#define DEGREE 0.017453292519943295
#define ROUNDED 1e-4 /* metres: what doubles and SLACK are */
#define TIGHT 1.25
enum { MOST_SPLITS = 48, FEW_PIXELS = 8 };

typedef struct proof {
    lattice l;
    double seen;  /* of |sample - B'| at vertices, in all blocks so far */
    double bound; /* of all samples in triangles that are done with */
    double worst; /* of the block at hand; < 0: nothing of it is between pixels of terrain */
    int splits;
    bool may_split; /* the block at hand, and so need not be measured to the end */
} proof;

/* ---------------------------------------------------------------------------------------------- triangles -- */

/* Along a side of a triangle, from one line of pixels to the next: the most of |plane - B'|; < 0: it is nowhere
 * between pixels of terrain. */
static double measure_side(const lattice *l, const corner *a, const corner *b) {
    const pixel_grid *g = l->g;
    const double dc = b->col - a->col, dr = b->row - a->row, dz = b->metres - a->metres;
    int i = l->first_col[a->i], j = l->first_row[a->j]; /* the lines that come next */
    if (dc >= 0 && i < GRID && g->col[i] <= a->col) i++;
    if (dr >= 0 && j < GRID && g->row[j] <= a->row) j++;
    if (dc < 0) i--;
    if (dr < 0) j--;
    const int right = dc < 0 ? -1 : 1, down = dr < 0 ? -1 : 1;
    double most = -1;
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
            if (off > most) most = off;
        }
        if (next >= 1) break;
        if (at_col <= next) i += right;
        if (at_row <= next) j += down;
        t = next;
    }
    return most;
}

/* Is one of the four cells around a pixel whole? */
static bool is_needed(const pixel_grid *g, int i, int j) {
    const size_t at = (size_t)j * GRID + (size_t)i;
    return g->is_whole[at] || (i > 0 && g->is_whole[at - 1]) || (j > 0 && g->is_whole[at - GRID]) ||
           (i > 0 && j > 0 && g->is_whole[at - GRID - 1]);
}

/* sup over a triangle of |plane - B'|, likewise; where it is more than `most_wanted`, anything above that. */
static double measure_triangle(const lattice *l, const corner triangle[3], double most_wanted) {
    const pixel_grid *g = l->g;
    const lattice_box b = lattice_box_of(triangle);
    const double south = l->row[b.south] + SLACK;
    double most = -1;
    plane p;
    if (!triangle_plane(triangle, &p)) return -1;
    for (int a = 0; a < 3 && most <= most_wanted; a++) {
        const double off = measure_side(l, &triangle[a], &triangle[a == 2 ? 0 : a + 1]);
        if (off > most) most = off;
    }
    if (most > most_wanted) return most;
    for (int j = l->first_row[b.north]; j < GRID && g->row[j] <= south; j++) {
        double west, east;
        if (!triangle_span(triangle, g->row[j] - SLACK, g->row[j] + SLACK, &west, &east)) continue;
        for (int i = l->first_col[b.west]; i < GRID && g->col[i] <= east + SLACK; i++) {
            const size_t at = (size_t)j * GRID + (size_t)i;
            if (!is_needed(g, i, j) || g->col[i] < west - SLACK) continue;
            const double off = fabs(p.at + g->col[i] * p.by_col + g->row[j] * p.by_row - g->height[at]);
            if (off > most) most = off;
        }
    }
    return most;
}

static bool is_small(const lattice *l, const corner triangle[3]) {
    const lattice_box b = lattice_box_of(triangle);
    return l->first_col[b.east] - l->first_col[b.west] <= FEW_PIXELS &&
           l->first_row[b.south] - l->first_row[b.north] <= FEW_PIXELS;
}

/* False: the block is to be split. */
static bool prove_triangle(proof *p, const corner triangle[3]) {
    const lattice *l = &p->l;
    const double enough = TIGHT * p->seen;
    const bool is_valid = triangle[0].valid && triangle[1].valid && triangle[2].valid;
    corner children[2][3];
    if (lattice_misses(l, triangle)) return true;
    if (!lattice_split(l, triangle, children)) {
        if (!is_valid) return true;
        const double off = measure_triangle(l, triangle, HUGE_VAL);
        if (off >= 0) p->worst = fmax(p->worst, off + rqt_code_metres(l->block->floor));
        return !p->may_split || p->worst <= enough;
    }
    const corner *middle = &children[0][0];
    const double error = rqt_code_metres(l->block->error[(size_t)middle->j * (size_t)l->n + (size_t)middle->i]);
    if (is_valid && error < enough && is_small(l, triangle)) {
        const double off = measure_triangle(l, triangle, enough - error);
        if (off + error <= enough) {
            if (off >= 0) p->worst = fmax(p->worst, off + error);
            return true;
        }
    }
    return prove_triangle(p, children[0]) && prove_triangle(p, children[1]);
}

/* ------------------------------------------------------------------------------------------------- blocks -- */

/* The pixel before a place of the lattice, of those that come next; -1 or GRID - 1: there is no cell. */
static int cell_of(int first, const double *pixels, double place) {
    return first < GRID && pixels[first] <= place ? first : first - 1;
}

/* What the vertices of the block at hand are off. */
static double see(const lattice *l) {
    const pixel_grid *g = l->g;
    const rqt_block *block = l->block;
    const rqt_unit *unit = &g->terrain->unit;
    const double scale = rqt_unit_factor(unit) / unit->d, zero = rqt_unit_metres(unit, 0);
    int cell[MOST_SIDE], from = l->n, to = 0;
    double u[MOST_SIDE], most = -1;
    for (int x = 0; x < l->n; x++) {
        cell[x] = cell_of(l->first_col[x], g->col, l->col[x]);
        if (cell[x] < 0 || cell[x] >= GRID - 1) continue;
        u[x] = (l->col[x] - g->col[cell[x]]) * g->per_col;
        if (x < from) from = x;
        to = x + 1;
    }
    for (int y = 0; y < l->n; y++) {
        const int j = cell_of(l->first_row[y], g->row, l->row[y]);
        if (j < 0 || j >= GRID - 1) continue;
        const double v = (l->row[y] - g->row[j]) * g->per_row[j];
        const size_t first = (size_t)y * (size_t)l->n, row = (size_t)j * GRID;
        for (int x = from; x < to; x++) {
            const size_t vertex = first + (size_t)x, at = row + (size_t)cell[x];
            if (block->sparse && block->error[vertex] <= block->floor && !(block->flags[vertex] & RQT_OUTLINE))
                continue;
            if (!(block->flags[vertex] & RQT_VALID) || !g->is_whole[at]) continue;
            const double off = fabs(pixels_between(g, at, u[x], v) - (block->q[vertex] * scale + zero));
            if (off > most) most = off;
        }
    }
    return most;
}

static int see_block(tiles *t, const rqt_block_place *place, rqt_block_number number, int turn, void *context,
                     char **error) {
    proof *p = context;
    (void)turn;
    const int code = lattice_read(t, place, number, &p->l, error);
    if (code == SQLITE_OK) p->seen = fmax(p->seen, see(&p->l));
    return code;
}

static int prove_block(tiles *t, const rqt_block_place *place, rqt_block_number number, int turn, void *context,
                       char **error);

static int prove_children(tiles *t, const rqt_block_place *place, int turn, proof *p, char **error) {
    int code = SQLITE_OK;
    p->splits++;
    for (int what = 0; what < 2; what++)
        for (int c = 0; c < 4 && code == SQLITE_OK; c++) {
            const rqt_block_number number =
                rqt_block_number_of(place->level + 1, 2 * place->i + (c & 1), 2 * place->j + (c >> 1));
            rqt_block_place child;
            if (rqt_block_locate(&t->terrain->lattice, t->terrain->k, number, &child) != RQT_OK) continue;
            code = (what ? prove_block : see_block)(t, &child, number, turn, p, error);
        }
    return code;
}

static int prove_block(tiles *t, const rqt_block_place *place, rqt_block_number number, int turn, void *context,
                       char **error) {
    proof *p = context;
    corner halves[2][3];
    if (place->stride == 1) return SQLITE_OK; /* all of its samples were seen */
    const int code = lattice_read(t, place, number, &p->l, error);
    if (code != SQLITE_OK) return code;
    lattice_halves(&p->l, place, halves);
    p->worst = -1;
    p->may_split = p->splits < MOST_SPLITS;
    if (!prove_triangle(p, halves[0]) || !prove_triangle(p, halves[1]))
        return prove_children(t, place, turn, p, error);
    p->bound = fmax(p->bound, p->worst);
    return SQLITE_OK;
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

int leaves_prove(tiles *t, int level, pixel_grid *g, char **error) {
    proof *p = sqlite3_malloc64(sizeof *p);
    if (!p) return SQLITE_NOMEM;
    *p = (proof){.l = {.g = g}};
    int code = lattice_visit(t, level, g, see_block, p, error);
    if (code == SQLITE_OK) code = lattice_visit(t, level, g, prove_block, p, error);
    g->error = fmax(p->bound, p->seen) + find_bent(g) + t->terrain->quantum_error + ROUNDED;
    sqlite3_free(p);
    return code;
}
