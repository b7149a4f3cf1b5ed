/* proof.c - how far every sample is from what clients draw, without looking at every sample.
 *
 * Let B be what is drawn. A valid sample in a leaf with three valid corners is no further from it than e + sup |F -
 * B|, e being em of the block (leaves.c) and F the mesh. Instead of B we look at B', which has the same
 * pixels and is bilinear between them in longitude and latitude: on a strip between two rows of pixels the share of
 * the lower row differs by at most
 *
 *     h^2 max|M''| / (8 (M1 - M0)),       M the Mercator ordinate, M'' = sin(phi) / cos(phi)^2, h its height
 *
 * which, times what the two rows differ by, is `bent`.
 *
 * F in place of the mesh of two triangles is in each cell of the lattice its bilinear Q, from which they are at
 * most |nw - ne - sw + se| / 4 (a row's `margins`). Q - B' is bilinear wherever a cell of the lattice and a cell of
 * pixels have something in common, a rectangle, and so has its extremes at that one's corners: vertices, pixels,
 * and where lines of the lattice cross lines of pixels. These are few loops over arrays. A cell of the lattice that
 * lies in one of pixels needs no Q: F - B' is linear on its sides, and on its diagonal a parabola (see below),
 * whose bulge is the less the smaller the cell. Half cells whose other half has no height, and leaves that reach
 * beyond the raster, are no such cells: they are looked at as triangles. There plane
 * - B' has no extremes inside a cell of pixels either, being a saddle; on sides that slant it is a parabola, at
 * most |k du dv| / 4 from the chord. So it is enough to walk along the sides from line to line, and to look at the
 * pixels inside.
 *
 * Only the largest sum counts, and how large it is at least is known: vertices are samples. So this is a branch and
 * bound, as in core/update_bound: of the boxes of blocks the one with the largest sum gives way to its children,
 * whose em are smaller, down to stride 1, where there is nothing but vertices; until that sum is no more than TIGHT
 * times what was seen at vertices. Few boxes do. When it is noise, and there would be many, we stop after
 * MOST_SPLITS, and what is told is larger than need be.
 *
 * In a child samples may be in leaves without a height though they are in one with three corners of its parent's:
 * then what was found for the parent holds.
 */
#include "earth.h"
#include "leaves.h"

#include <limits.h>
#include <math.h>
#include <string.h>

#define ROUNDED 1e-4 /* metres: what doubles and SLACK are */
#define TIGHT 1.25
enum { MOST_SPLITS = 1200, BOX = 8 };

/* A box of a block, BOX cells a side, or all of a smaller block; and what is known of the samples in it. */
typedef struct part {
    rqt_block_number number;
    int turn, x, y; /* first column and row */
    double bound;
} part;

typedef struct proof {
    lattice l;
    double seen; /* of |sample - B'| at vertices, in all blocks so far */
    part *parts; /* a heap: none has a larger bound than the one at half its place */
    size_t count, room;
    int splits;
    int turn; /* of the pixels; INT_MIN: any */
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
        const double next = larger(smaller(smaller(at_col, at_row), 1), t);
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
            const double off = larger(fabs(from), fabs(to)) + bulge;
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

/* sup over a triangle of |plane - B'|. */
static double measure_triangle(const lattice *l, const corner triangle[3]) {
    const pixel_grid *g = l->g;
    const lattice_box b = lattice_box_of(triangle);
    const double south = l->row[b.south] + SLACK;
    double most = -1;
    plane p;
    if (!triangle_plane(triangle, &p)) return -1;
    for (int a = 0; a < 3; a++) most = larger(most, measure_side(l, &triangle[a], &triangle[a == 2 ? 0 : a + 1]));
    for (int j = l->first_row[b.north]; j < GRID && g->row[j] <= south; j++) {
        double west, east;
        if (!triangle_span(triangle, g->row[j] - SLACK, g->row[j] + SLACK, &west, &east)) continue;
        for (int i = l->first_col[b.west]; i < GRID && g->col[i] <= east + SLACK; i++) {
            const size_t at = (size_t)j * GRID + (size_t)i;
            if (!is_needed(g, i, j) || g->col[i] < west - SLACK) continue;
            most = larger(most, fabs(p.at + g->col[i] * p.by_col + g->row[j] * p.by_row - g->height[at]));
        }
    }
    return most;
}

/* Leaves of which the cells of the lattice are not parts; has_holes: one has no height. */
static double measure_straddling(const lattice *l, const rqt_block_place *place, const lattice_box *box,
                                 const corner triangle[3], bool *has_holes) {
    const lattice_box b = lattice_box_of(triangle);
    corner children[2][3];
    if (b.west >= box->east || b.east <= box->west || b.north >= box->south || b.south <= box->north) return -1;
    if (lattice_misses(l, triangle) || !lattice_straddles(l, place, triangle)) return -1;
    if (lattice_split(l, triangle, children))
        return larger(measure_straddling(l, place, box, children[0], has_holes),
                      measure_straddling(l, place, box, children[1], has_holes));
    if (triangle[0].valid && triangle[1].valid && triangle[2].valid) return measure_triangle(l, triangle);
    *has_holes = true;
    return -1;
}

/* Is there such a leaf in a box, or one like it without a height? Few boxes have one. */
static bool has_straddling(const lattice *l, const rqt_block_place *place, const lattice_box *box,
                           const corner triangle[3]) {
    const lattice_box b = lattice_box_of(triangle);
    corner children[2][3];
    if (b.west >= box->east || b.east <= box->west || b.north >= box->south || b.south <= box->north) return false;
    if (lattice_misses(l, triangle) || !lattice_straddles(l, place, triangle)) return false;
    return !lattice_split(l, triangle, children) || has_straddling(l, place, box, children[0]) ||
           has_straddling(l, place, box, children[1]);
}

static bool is_straddled(const lattice *l, const rqt_block_place *place, const lattice_box *box) {
    corner halves[2][3];
    if (!l->is_squeezed) return false;
    lattice_halves(l, place, halves);
    return has_straddling(l, place, box, halves[0]) || has_straddling(l, place, box, halves[1]);
}

/* Has half a cell a height though the other has none? Then the most along the diagonal. (The rest of its border,
 * and the pixels in it, are looked at with all others.) */
static double measure_diagonal(const lattice *l, int x, int y) {
    const bool is_main = (x + y + l->turned) % 2 == 0;
    const corner a = lattice_corner(l, is_main ? x : x + 1, y), b = lattice_corner(l, is_main ? x + 1 : x, y + 1);
    const bool has_half =
        lattice_corner(l, is_main ? x + 1 : x, y).valid || lattice_corner(l, is_main ? x : x + 1, y + 1).valid;
    return a.valid && b.valid && has_half ? measure_side(l, &a, &b) : -1;
}

/* ------------------------------------------------------------------------------------------------- blocks -- */

/* Is a vertex on the border of a cell of pixels that is whole, its own being not? */
static bool is_beside(const pixel_grid *g, size_t at, double u, double v) {
    const bool is_left = u == 0 && at > 0, is_up = v == 0 && at >= GRID;
    return (is_left && g->is_whole[at - 1]) || (is_up && g->is_whole[at - GRID]) ||
           (is_left && is_up && at > GRID && g->is_whole[at - GRID - 1]);
}

/* What F may be further from B' than Q is, for each row of cells of a box, and 0 around: row y has y - north + 1.
 */
typedef struct margins {
    double of[BOX + 2];
} margins;

/* Does a cell of the lattice meet one of pixels that is whole? */
static bool is_drawn(const lattice *l, int x, int y) {
    const int west = l->first_col[x] - 1, north = l->first_row[y] - 1;
    for (int j = north < 0 ? 0 : north; j < l->first_row[y + 1]; j++)
        for (int i = west < 0 ? 0 : west; i < l->first_col[x + 1]; i++)
            if (l->g->is_whole[j * GRID + i]) return true;
    return false;
}

/* Cells of the lattice that are small in those of pixels: how far F - B' is from its chord along a diagonal. */
static double find_bulge(const lattice *l, const lattice_box *box) {
    const pixel_grid *g = l->g;
    const int west = l->first_col[box->west], north = l->first_row[box->north];
    double most = 0;
    for (int j = north > 0 ? north - 1 : 0; j < l->first_row[box->south] && j + 1 < GRID; j++)
        for (int i = west > 0 ? west - 1 : 0; i < l->first_col[box->east] && i + 1 < GRID; i++) {
            const double *h = g->height + (size_t)j * GRID + (size_t)i;
            if (!g->is_whole[(size_t)j * GRID + (size_t)i]) continue;
            most = larger(most, fabs(h[0] - h[1] - h[GRID] + h[GRID + 1]) * g->per_row[j]);
        }
    return most * g->per_col * l->stride * l->stride / 4;
}

/* Margins of the cells that have heights at all corners. Of others: the most along diagonals; and whether samples
 * may be there that are between pixels, but in leaves without a height. */
static double measure_cells(const lattice *l, const lattice_box *box, margins *m, bool *has_holes) {
    const bool are_small = l->stride * l->g->per_col <= 0.5;
    const double bulge = are_small ? find_bulge(l, box) : 0, *h = l->metres;
    const uint8_t *what = l->what;
    double most = -1;
    *m = (margins){{0}};
    *has_holes = false;
    for (int y = box->north; y < box->south; y++) {
        const bool is_flat = l->row[y + 1] == l->row[y] || l->first_row[y + 1] == 0 || l->first_row[y] == GRID;
        if (is_flat) continue;
        const bool is_crossed = !are_small || l->first_row[y] != l->first_row[y + 1];
        double *margin = &m->of[y - box->north + 1];
        for (int x = box->west; x < box->east; x++) {
            const size_t nw = (size_t)y * (size_t)l->n + (size_t)x, sw = nw + (size_t)l->n;
            if (!l->has_voids || what[nw] & what[nw + 1] & what[sw] & what[sw + 1] & HAS_HEIGHT) {
                const bool is_inside = !is_crossed && l->first_col[x] == l->first_col[x + 1];
                *margin = larger(*margin, is_inside ? bulge : fabs(h[nw] - h[nw + 1] - h[sw] + h[sw + 1]) / 4);
            } else if (l->col[x + 1] > l->col[x] && is_drawn(l, x, y)) {
                *has_holes = true;
                most = larger(most, measure_diagonal(l, x, y));
            }
        }
    }
    return most;
}

static double with_margin(double most, double margin) {
    return most < 0 ? most : most + margin;
}

/* Vertices: with their margins, and what those that are samples are off. */
static double see(const lattice *l, const lattice_box *box, const lattice_window *w, const margins *m,
                  double *seen) {
    const pixel_grid *g = l->g;
    double most = -1, most_samples = *seen;
    for (int y = w->lines.north; y <= w->lines.south; y++) {
        const size_t row = (size_t)l->cell_row[y] * GRID, first = (size_t)y * (size_t)l->n;
        const double v = l->v[y];
        double here = -1;
        for (int x = w->lines.west; x <= w->lines.east; x++) {
            const size_t at = row + (size_t)l->cell_col[x], vertex = first + (size_t)x;
            if (!(l->what[vertex] & HAS_HEIGHT)) continue;
            if (!g->is_whole[at] && !is_beside(g, at, l->u[x], v)) continue;
            const double off = fabs(pixels_between(g, at, l->u[x], v) - l->metres[vertex]);
            if (off > most_samples && (l->what[vertex] & IS_SAMPLE)) most_samples = off;
            here = larger(here, off);
        }
        most = larger(most, with_margin(here, larger(m->of[y - box->north], m->of[y - box->north + 1])));
    }
    *seen = most_samples;
    return most;
}

/* Rows of the lattice where columns of pixels cross them. */
static double measure_rows(const lattice *l, const lattice_box *box, const lattice_window *w, const margins *m) {
    const pixel_grid *g = l->g;
    double most = -1;
    for (int y = w->lines.north; y <= w->lines.south; y++) {
        const size_t row = (size_t)l->cell_row[y] * GRID;
        const double *h = l->metres + (size_t)y * (size_t)l->n, v = l->v[y];
        const uint8_t *what = l->what + (size_t)y * (size_t)l->n;
        double here = -1;
        for (int i = w->pixels.west; i <= w->pixels.east; i++) {
            const int x = l->at_col[i];
            const size_t at = row + (size_t)i;
            if (!(what[x] & what[x + 1] & HAS_HEIGHT)) continue;
            if (!g->is_whole[at] && !(i > 0 && g->is_whole[at - 1])) continue;
            const double drawn = g->height[at] + v * (g->height[at + GRID] - g->height[at]);
            const double off = fabs(h[x] + l->fx[i] * (h[x + 1] - h[x]) - drawn);
            here = larger(here, off);
        }
        most = larger(most, with_margin(here, larger(m->of[y - box->north], m->of[y - box->north + 1])));
    }
    return most;
}

/* Rows of pixels where columns of the lattice cross them. */
static double measure_cols(const lattice *l, const lattice_box *box, const lattice_window *w, const margins *m) {
    const pixel_grid *g = l->g;
    double most = -1;
    for (int j = w->pixels.north; j <= w->pixels.south; j++) {
        const int y = l->at_row[j];
        const size_t up = (size_t)y * (size_t)l->n, down = up + (size_t)l->n, row = (size_t)j * GRID;
        const double *h = l->metres, fy = l->fy[j];
        double here = -1;
        for (int x = w->lines.west; x <= w->lines.east; x++) {
            const size_t at = row + (size_t)l->cell_col[x], a = up + (size_t)x, b = down + (size_t)x;
            if (!(l->what[a] & l->what[b] & HAS_HEIGHT)) continue;
            if (!g->is_whole[at] && !(j > 0 && g->is_whole[at - GRID])) continue;
            const double drawn = g->height[at] + l->u[x] * (g->height[at + 1] - g->height[at]);
            const double off = fabs(h[a] + fy * (h[b] - h[a]) - drawn);
            here = larger(here, off);
        }
        most = larger(most, with_margin(here, m->of[y - box->north + 1]));
    }
    return most;
}

static double measure_pixels(const lattice *l, const lattice_box *box, const lattice_window *w, const margins *m) {
    const pixel_grid *g = l->g;
    double most = -1;
    for (int j = w->pixels.north; j <= w->pixels.south; j++) {
        const int y = l->at_row[j];
        double here = -1;
        for (int i = w->pixels.west; i <= w->pixels.east; i++) {
            const size_t at = (size_t)j * GRID + (size_t)i;
            double metres;
            if (g->code[at] == NO_HEIGHT || !is_needed(g, i, j)) continue;
            if (!lattice_height(l, l->at_col[i], y, l->fx[i], l->fy[j], &metres)) continue;
            here = larger(here, fabs(metres - g->height[at]));
        }
        most = larger(most, with_margin(here, m->of[y - box->north + 1]));
    }
    return most;
}

/* The same four of a whole box that has heights everywhere, between pixels of terrain: rows of vertices, with
 * columns of pixels in them, and rows of pixels, with columns of the lattice in them, from north to south. */
enum { ACROSS = BOX + 1 };
typedef struct strip_rows {
    int row[2];              /* of pixels: an even and an odd one that are known */
    double drawn[2][ACROSS]; /* at the lattice's columns */
    double height[2][GRID];  /* of an even and an odd row of the lattice at the columns of pixels */
} strip_rows;

static const double *draw_row(const lattice *l, int west, int j, strip_rows *s) {
    double *drawn = s->drawn[j % 2];
    if (s->row[j % 2] == j) return drawn;
    s->row[j % 2] = j;
    for (int x = 0; x < ACROSS; x++) {
        const double *h = l->g->height + (size_t)j * GRID + l->cell_col[west + x];
        drawn[x] = h[0] + l->u[west + x] * (h[1] - h[0]);
    }
    return drawn;
}

/* Of the rows a and b, with `share` of b, and one between them. */
static double compare(const double *a, const double *b, double share, const double *other, int n, double most) {
    for (int i = 0; i < n; i++) most = larger(most, fabs(a[i] + share * (b[i] - a[i]) - other[i]));
    return most;
}

/* Heights of the lattice's row where columns of pixels cross it. */
static double *cross_row(const lattice *l, const lattice_window *w, int y, strip_rows *s) {
    double *height = s->height[y % 2];
    const double *h = l->metres + (size_t)y * (size_t)l->n;
    for (int i = w->pixels.west; i <= w->pixels.east; i++) {
        const int x = l->at_col[i];
        height[i] = h[x] + l->fx[i] * (h[x + 1] - h[x]);
    }
    return height + w->pixels.west;
}

static double measure_row(const lattice *l, const lattice_box *box, const lattice_window *w, int y,
                          const double *height, strip_rows *s, double *seen) {
    const int j = l->cell_row[y];
    const size_t begin = (size_t)y * (size_t)l->n + (size_t)box->west;
    const double *vertices = l->metres + begin, *pixels = l->g->height + (size_t)j * GRID + w->pixels.west;
    const double *above = draw_row(l, box->west, j, s), *below = draw_row(l, box->west, j + 1, s), v = l->v[y];
    const double most = compare(above, below, v, vertices, ACROSS, 0);
    for (int x = 0; x < ACROSS && most > *seen; x++)
        if (l->what[begin + (size_t)x] & IS_SAMPLE)
            *seen = larger(*seen, fabs(above[x] + v * (below[x] - above[x]) - vertices[x]));
    return compare(pixels, pixels + GRID, v, height, w->pixels.east - w->pixels.west + 1, most);
}

static double measure_whole(const lattice *l, const lattice_box *box, const lattice_window *w, const margins *m,
                            double *seen) {
    const int count = w->pixels.east - w->pixels.west + 1;
    const double *up = NULL;
    strip_rows s = {.row = {-1, -1}};
    double most = 0;
    int j = w->pixels.north;
    while (j <= w->pixels.south && l->at_row[j] < box->north) j++; /* on the first row of vertices */
    for (int y = box->north; y <= box->south; y++) {
        const double *margin = &m->of[y - box->north], *down = cross_row(l, w, y, &s);
        for (; j <= w->pixels.south && l->at_row[j] < y; j++) {
            const double *vertices = l->metres + (size_t)(y - 1) * (size_t)l->n + box->west, fy = l->fy[j];
            const double *pixels = l->g->height + (size_t)j * GRID + w->pixels.west;
            double here = compare(vertices, vertices + l->n, fy, draw_row(l, box->west, j, &s), ACROSS, 0);
            here = compare(up, down, fy, pixels, count, here);
            most = larger(most, here + margin[0]);
        }
        most = larger(most, measure_row(l, box, w, y, down, &s, seen) + larger(margin[0], margin[1]));
        up = down;
    }
    return most;
}

/* Has a box, whole, heights everywhere, and lies between pixels of terrain? */
static bool is_whole(const lattice *l, const lattice_box *box) {
    const int west = l->cell_col[box->west], east = l->cell_col[box->east];
    const int north = l->cell_row[box->north], south = l->cell_row[box->south];
    if (l->has_voids || l->col[box->east] == l->col[box->east - 1] || l->row[box->south] == l->row[box->south - 1])
        return false;
    if (box->east - box->west != BOX || box->south - box->north != BOX) return false;
    if (west < 0 || east < 0 || north < 0 || south < 0) return false;
    for (int j = north; j <= south; j++)
        if (memchr(l->g->is_whole + (size_t)j * GRID + west, 0, (size_t)(east - west) + 1)) return false;
    return true;
}

/* sup |F - B'|; and what samples at vertices are off. */
static double measure(const lattice *l, const rqt_block_place *place, const lattice_box *box, bool may_straddle,
                      double *seen, bool *has_holes) {
    const lattice_window w = lattice_window_of(l, box);
    corner halves[2][3];
    margins m = {{0}};
    *has_holes = false;
    if (place->stride == 1) return see(l, box, &w, &m, seen);
    double most = measure_cells(l, box, &m, has_holes);
    const bool straddles = may_straddle && is_straddled(l, place, box);
    if (!straddles && is_whole(l, box)) return larger(most, measure_whole(l, box, &w, &m, seen));
    most = larger(most, see(l, box, &w, &m, seen));
    most = larger(most, measure_rows(l, box, &w, &m));
    most = larger(most, measure_cols(l, box, &w, &m));
    most = larger(most, measure_pixels(l, box, &w, &m));
    if (!straddles) return most;
    lattice_halves(l, place, halves);
    for (int i = 0; i < 2; i++) most = larger(most, measure_straddling(l, place, box, halves[i], has_holes));
    return most;
}

/* -------------------------------------------------------------------------------------- branch and bound -- */

static int put(proof *p, part new) {
    if (p->count == p->room) {
        const size_t room = p->room ? 2 * p->room : 256;
        part *parts = sqlite3_realloc64(p->parts, room * sizeof *parts);
        if (!parts) return SQLITE_NOMEM;
        p->parts = parts;
        p->room = room;
    }
    size_t at = p->count++;
    for (; at > 0 && p->parts[(at - 1) / 2].bound < new.bound; at = (at - 1) / 2)
        p->parts[at] = p->parts[(at - 1) / 2];
    p->parts[at] = new;
    return SQLITE_OK;
}

/* The one of the largest bound. There is one. */
static part take(proof *p) {
    const part largest = p->parts[0], last = p->parts[--p->count];
    size_t at = 0;
    for (size_t below = 1; below < p->count; below = 2 * at + 1) {
        if (below + 1 < p->count && p->parts[below + 1].bound > p->parts[below].bound) below++;
        if (p->parts[below].bound <= last.bound) break;
        p->parts[at] = p->parts[below];
        at = below;
    }
    p->parts[at] = last;
    return largest;
}

static int box_side(const lattice *l) {
    return l->n - 1 < BOX ? l->n - 1 : BOX;
}

/* A box of the block at hand. If it is of stride 1, all of its samples are seen and it is done with. */
static int add(const rqt_block_place *place, part here, const lattice_box *box, bool may_straddle, double inherited,
               proof *p) {
    bool has_holes;
    const double off = measure(&p->l, place, box, may_straddle, &p->seen, &has_holes);
    if (place->stride == 1) return SQLITE_OK;
    here.bound = off < 0 ? -1 : off + p->l.floor;
    if (has_holes && inherited > here.bound) here.bound = inherited;
    return here.bound < 0 ? SQLITE_OK : put(p, here);
}

/* The boxes of some of a block. */
static int add_all(tiles *t, const rqt_block_place *place, rqt_block_number number, int turn, lattice_box all,
                   double inherited, proof *p, char **error) {
    int code = lattice_read(t, place, number, &p->l, &all, error);
    if (code != SQLITE_OK) return code;
    const int side = box_side(&p->l);
    const bool may_straddle = place->stride > 1 && is_straddled(&p->l, place, &all);
    for (int y = all.north / side * side; y < all.south && code == SQLITE_OK; y += side)
        for (int x = all.west / side * side; x < all.east && code == SQLITE_OK; x += side) {
            const lattice_box box = {x < all.west ? all.west : x, x + side > all.east ? all.east : x + side,
                                     y < all.north ? all.north : y, y + side > all.south ? all.south : y + side};
            code = add(place, (part){.number = number, .turn = turn, .x = x, .y = y}, &box, may_straddle, inherited,
                       p);
        }
    return code;
}

static int add_block(tiles *t, const rqt_block_place *place, rqt_block_number number, int turn, void *context,
                     char **error) {
    const int last = 1 << t->terrain->k;
    return add_all(t, place, number, turn, (lattice_box){0, last, 0, last}, -1, context, error);
}

/* The same place in the next finer level: four boxes, in one block or in four. */
static int split(tiles *t, part parent, proof *p, char **error) {
    const rqt_lattice *all = &t->terrain->lattice;
    const int cells = 1 << t->terrain->k, most = 2 * box_side(&p->l), size = most < cells ? most : cells;
    rqt_block_place place, child;
    int code = SQLITE_OK;
    p->splits++;
    if (rqt_block_locate(all, t->terrain->k, parent.number, &place) != RQT_OK) return SQLITE_OK;
    if (p->turn != parent.turn) pixels_turn(p->l.g, p->turn = parent.turn);
    for (int y = 2 * parent.y; y < 2 * parent.y + most && code == SQLITE_OK; y += size)
        for (int x = 2 * parent.x; x < 2 * parent.x + most && code == SQLITE_OK; x += size) {
            const rqt_block_number number =
                rqt_block_number_of(place.level + 1, 2 * place.i + x / cells, 2 * place.j + y / cells);
            if (rqt_block_locate(all, t->terrain->k, number, &child) != RQT_OK) continue;
            const lattice_box box = {x % cells, x % cells + size, y % cells, y % cells + size};
            code = add_all(t, &child, number, parent.turn, box, parent.bound, p, error);
        }
    return code;
}

/* The most that B and B' differ by. */
static double find_bent(const pixel_grid *g) {
    const double strip = 2 * M_PI / ldexp(PIXELS, g->z);
    double most = 0;
    for (int j = 0; j + 1 < GRID; j++) {
        const double a = fabs(g->lat[j]) * DEGREE, b = fabs(g->lat[j + 1]) * DEGREE, far = larger(a, b);
        const double h = (g->lat[j] - g->lat[j + 1]) * DEGREE;
        const double share = h * h * sin(far) / (cos(far) * cos(far)) / (8 * strip);
        double differ = 0;
        for (int i = 0; i + 1 < GRID; i++) {
            const size_t at = (size_t)j * GRID + (size_t)i;
            if (!g->is_whole[at]) continue;
            const double *p = g->height + at;
            differ = larger(differ, larger(fabs(p[0] - p[GRID]), fabs(p[1] - p[GRID + 1])));
        }
        most = larger(most, share * differ);
    }
    return most;
}

int leaves_prove(tiles *t, int level, pixel_grid *g, char **error) {
    proof *p = sqlite3_malloc64(sizeof *p);
    if (!p) return SQLITE_NOMEM;
    p->l.g = g;
    p->seen = 0;
    p->parts = NULL;
    p->count = p->room = 0;
    p->splits = 0;
    p->turn = INT_MIN;
    int code = lattice_visit(t, level, g, add_block, p, error);
    while (code == SQLITE_OK && p->count > 0 && p->splits < MOST_SPLITS && p->parts[0].bound > TIGHT * p->seen)
        code = split(t, take(p), p, error);
    g->error =
        larger(p->count > 0 ? p->parts[0].bound : 0, p->seen) + find_bent(g) + t->terrain->quantum_error + ROUNDED;
    sqlite3_free(p->parts);
    sqlite3_free(p);
    return code;
}
