/* lattice.c - blocks as heights at all vertices of their lattice, and where those lie among the pixels.
 *
 * A leaf's plane, at the vertices in it, is what halving its sides again and again gives: so going from coarse to
 * fine, a vertex that is not kept is the middle between the ends of the hypotenuse that it halves. Numbers are
 * exact, being halves of halves of integers (until they become metres). A vertex so found has a height if both ends
 * have one: in a leaf with a void corner these are at most those on the side that the other two corners have.
 *
 * Beyond the raster the lattice's vertices are squeezed onto the last column and row. Triangles that reach there
 * have planes over squeezed corners, and the middle of a hypotenuse need not be on it: what it gets here is on one
 * of the two triangles, and what the cells of the lattice make of it is about the mesh, not quite. It does for
 * drawing, where any height will do; the proof looks at the triangles themselves.
 */
#include "leaves.h"

#include <math.h>

/* The first pixel that is at a place or beyond. */
static int next_pixel(const double *pixels, double place) {
    int from = 0, to = GRID;
    while (from < to) {
        const int middle = (from + to) / 2;
        if (pixels[middle] < place - SLACK)
            from = middle + 1;
        else
            to = middle;
    }
    return from;
}

/* Which pixels are next to the lattice's lines, from one to another: those at or beyond them, and the cells that
 * they are in. */
static void find_cells(const double *lines, int line, int last, const double *pixels, int *first, int *cells) {
    int next = next_pixel(pixels, lines[line]);
    for (; line <= last; line++) {
        while (next < GRID && pixels[next] < lines[line] - SLACK) next++;
        const int cell = next < GRID && pixels[next] <= lines[line] ? next : next - 1;
        first[line] = next;
        cells[line] = cell < GRID - 1 ? cell : -1;
    }
}

/* The lines that are around the pixels, and one more on either side. */
static void clip(const double *lines, const double *pixels, int *first, int *last) {
    while (*first < *last && lines[*first + 1] < pixels[0]) ++*first;
    while (*last > *first && lines[*last - 1] > pixels[GRID - 1]) --*last;
}

static void place_lines(int32_t first, int32_t stride, int32_t most, int line, int last, double *lines) {
    for (; line <= last; line++) {
        const int64_t place = first + (int64_t)line * stride;
        lines[line] = (double)(place < most ? place : most);
    }
}

/* The lattice's lines among those of pixels. Triangles that reach beyond the raster may be larger than the box. */
static void place_lattice(const rqt_block_place *p, lattice *l, lattice_box *box) {
    const pixel_grid *g = l->g;
    const int32_t last_col = g->terrain->lattice.width - 1, last_row = g->terrain->lattice.height - 1;
    const int last = l->n - 1;
    lattice_box placed = *box;
    l->is_squeezed = p->side > last_col - p->x || p->side > last_row - p->y;
    if (l->is_squeezed) placed = (lattice_box){0, last, 0, last};
    place_lines(p->x, p->stride, last_col, placed.west, placed.east, l->col);
    place_lines(p->y, p->stride, last_row, placed.north, placed.south, l->row);
    clip(l->col, g->col, &box->west, &box->east);
    clip(l->row, g->row, &box->north, &box->south);
    if (!l->is_squeezed) placed = *box;
    find_cells(l->col, placed.west, placed.east, g->col, l->first_col, l->cell_col);
    find_cells(l->row, placed.north, placed.south, g->row, l->first_row, l->cell_row);
    for (int n = box->west; n <= box->east; n++) {
        const int i = l->cell_col[n];
        l->u[n] = i < 0 ? 0 : (l->col[n] - g->col[i]) * g->per_col;
    }
    for (int n = box->north; n <= box->south; n++) {
        const int j = l->cell_row[n];
        l->v[n] = j < 0 ? 0 : (l->row[n] - g->row[j]) * g->per_row[j];
    }
}

/* ... and pixels from one to another between some of the lattice's: a line that is squeezed onto the one before has
 * no cell. */
static void find_pixels(const double *lines, int line, int last, const double *pixels, int first, int end, int *at,
                        double *f) {
    for (int i = first; i <= end; i++) {
        while (line + 1 < last && lines[line + 1] < pixels[i] && lines[line + 2] > lines[line + 1]) line++;
        at[i] = line;
        f[i] = smaller(larger((pixels[i] - lines[line]) / (lines[line + 1] - lines[line]), 0), 1);
    }
}

static void find_lines(const int *cells, const double *lines, int *first, int *last) {
    while (*first <= *last && cells[*first] < 0) ++*first;
    while (*last >= *first && (cells[*last] < 0 || (*last > 0 && lines[*last] == lines[*last - 1]))) --*last;
}

lattice_window lattice_window_of(const lattice *l, const lattice_box *box) {
    const pixel_grid *g = l->g;
    lattice_window w = {
        *box,
        {l->first_col[box->west], l->first_col[box->east], l->first_row[box->north], l->first_row[box->south]}};
    find_lines(l->cell_col, l->col, &w.lines.west, &w.lines.east);
    find_lines(l->cell_row, l->row, &w.lines.north, &w.lines.south);
    if (w.pixels.east == GRID || g->col[w.pixels.east] > l->col[box->east] + SLACK) w.pixels.east--;
    if (w.pixels.south == GRID || g->row[w.pixels.south] > l->row[box->south] + SLACK) w.pixels.south--;
    return w;
}

/* ---------------------------------------------------------------------------------------------- heights -- */

/* Where b is between a and c, 0 .. 1. */
static double share(double a, double b, double c) {
    return c > a ? (b - a) / (c - a) : 0;
}

enum { FEWEST = 8 }; /* of squares along a block's side */

/* What heights are made of, out of the lattice: stores to `what` change none of these. */
typedef struct filling {
    const int32_t *q;
    const rqt_code *error;
    const uint8_t *flags;
    rqt_code floor;
    bool keeps_all;
    double scale, zero;
    double *metres;
    uint8_t *what;
    size_t n;
} filling;

/* A vertex that is kept has the sample's height, any other `between`, which two others have made. Both are worked
 * out, for which it is cannot be guessed. */
static inline void fill_vertex(const filling *f, size_t at, size_t a, size_t b, double between) {
    const bool is_kept = (f->error[at] > f->floor) | ((f->flags[at] & RQT_OUTLINE) != 0) | f->keeps_all;
    const double heights[2] = {between, f->q[at] * f->scale + f->zero};
    const unsigned sample = IS_SAMPLE | (f->flags[at] & RQT_VALID ? HAS_HEIGHT : 0);
    const unsigned other = f->what[a] & f->what[b] & HAS_HEIGHT;
    f->metres[at] = heights[is_kept];
    f->what[at] = (uint8_t)(is_kept ? sample : other);
}

/* The middle of a square of the lattice, half its side away from each, where lines are squeezed: on the two
 * triangles that it is cut into. */
static double find_middle(const lattice *l, int x, int y, int half, bool is_main) {
    const size_t at = (size_t)y * (size_t)l->n + (size_t)x, up = (size_t)half * (size_t)l->n, by = (size_t)half;
    const size_t nw = at - up - by, ne = at - up + by, sw = at + up - by, se = at + up + by;
    const double *h = l->metres;
    const double fx = share(l->col[x - half], l->col[x], l->col[x + half]),
                 fy = share(l->row[y - half], l->row[y], l->row[y + half]);
    if (is_main)
        return fx > fy ? h[nw] + fx * (h[ne] - h[nw]) + fy * (h[se] - h[ne])
                       : h[nw] + fy * (h[sw] - h[nw]) + fx * (h[se] - h[sw]);
    return fx + fy < 1 ? h[nw] + fx * (h[ne] - h[nw]) + fy * (h[sw] - h[nw])
                       : h[se] + (1 - fx) * (h[sw] - h[se]) + (1 - fy) * (h[ne] - h[se]);
}

static inline double find_between(const double *h, size_t before, size_t after, double share_after) {
    return h[before] + share_after * (h[after] - h[before]);
}

/* The vertices inside the squares of side 2 half that meet the box; half their side away from their borders. */
static void fill_squares(const lattice *l, const filling *given, const lattice_box *box, int half, bool is_main) {
    const filling f = *given;
    const bool is_squeezed = l->is_squeezed;
    const int size = 2 * half;
    const size_t across = (size_t)half, down = (size_t)half * f.n;
    const int west = box->west / size * size, north = box->north / size * size;
    const int east = (box->east + size - 1) / size * size, south = (box->south + size - 1) / size * size;
    for (int y = north + half; y < south; y += size)
        for (int x = west + half; x < east; x += size) {
            const bool is_here = size == (int)f.n - 1 ? is_main : (x / size + y / size) % 2 == 0;
            const size_t at = (size_t)y * f.n + (size_t)x, by = is_here ? down + across : down - across;
            fill_vertex(&f, at, at - by, at + by,
                        is_squeezed ? find_middle(l, x, y, half, is_here)
                                    : find_between(f.metres, at - by, at + by, 0.5));
        }
    for (int y = north; y <= south; y += half) {
        const bool is_across = y / half % 2 == 0;
        const double below = is_across || !is_squeezed ? 0.5 : share(l->row[y - half], l->row[y], l->row[y + half]);
        const size_t by = is_across ? across : down;
        for (int x = is_across ? west + half : west; x <= east; x += size) {
            const size_t at = (size_t)y * f.n + (size_t)x;
            const double after =
                is_across && is_squeezed ? share(l->col[x - half], l->col[x], l->col[x + half]) : below;
            fill_vertex(&f, at, at - by, at + by, find_between(f.metres, at - by, at + by, after));
        }
    }
}

/* A vertex alone: with those that it hangs on, most of which are kept. */
static void fill_alone(const filling *f, int x, int y, bool is_main) {
    const size_t at = (size_t)y * f->n + (size_t)x;
    const int last = (int)f->n - 1, half = (x | y) & -(x | y), size = 2 * half;
    if ((x == 0 || x == last) && (y == 0 || y == last)) return; /* a corner of the block */
    int dx = x & half, dy = y & half;
    if (dx && dy && !(size == last ? is_main : (x / size + y / size) % 2 == 0)) dx = -dx;
    const size_t by = (size_t)dy * f->n + (size_t)dx;
    if (f->error[at] <= f->floor && !(f->flags[at] & RQT_OUTLINE) && !f->keeps_all) {
        fill_alone(f, x - dx, y - dy, is_main);
        fill_alone(f, x + dx, y + dy, is_main);
    }
    fill_vertex(f, at, at - by, at + by, find_between(f->metres, at - by, at + by, 0.5));
}

/* Only what the box hangs on is filled of coarser scales: from the corners of squares on that are about its size,
 * and not many times smaller than the block, or too many might have to be. */
static int fill_corners(const lattice *l, const filling *f, const lattice_box *box, bool is_main) {
    const int last = l->n - 1, wide = box->east - box->west, high = box->south - box->north;
    int size = last;
    if (l->is_squeezed) return size;
    while (size / 2 >= wide && size / 2 >= high && size > 1 && size > last / FEWEST) size /= 2;
    for (int y = box->north / size * size; y < box->south + size; y += size)
        for (int x = box->west / size * size; x < box->east + size; x += size)
            if (x <= last && y <= last) fill_alone(f, x, y, is_main);
    return size;
}

static void fill_samples(const filling *given, const lattice_box *box) {
    const filling f = *given;
    for (int y = box->north; y <= box->south; y++)
        for (int x = box->west; x <= box->east; x++) {
            const size_t at = (size_t)y * f.n + (size_t)x;
            f.metres[at] = f.q[at] * f.scale + f.zero;
            f.what[at] = IS_SAMPLE | (f.flags[at] & RQT_VALID ? HAS_HEIGHT : 0);
        }
}

static void fill(lattice *l, const lattice_box *box, bool has_all, bool is_main) {
    const rqt_unit *unit = &l->g->terrain->unit;
    const rqt_block *block = l->block;
    const filling f = {.q = block->q,
                       .error = block->error,
                       .flags = block->flags,
                       .floor = block->floor,
                       .keeps_all = !block->sparse,
                       .scale = rqt_unit_factor(unit) / unit->d,
                       .zero = rqt_unit_metres(unit, 0),
                       .metres = l->metres,
                       .what = l->what,
                       .n = (size_t)l->n};
    const int last = l->n - 1;
    unsigned what = HAS_HEIGHT;
    for (int i = 0; i < 4; i++) {
        const lattice_box here = {i % 2 * last, i % 2 * last, i / 2 * last, i / 2 * last};
        fill_samples(&f, &here);
    }
    if (has_all)
        fill_samples(&f, box);
    else
        for (int half = fill_corners(l, &f, box, is_main) / 2; half > 0; half /= 2)
            fill_squares(l, &f, box, half, is_main);
    for (int y = box->north; y <= box->south; y++)
        for (int x = box->west; x <= box->east; x++) what &= l->what[(size_t)y * f.n + (size_t)x];
    l->has_voids = !what;
}

int lattice_read(tiles *t, const rqt_block_place *place, rqt_block_number number, lattice *l, lattice_box *box,
                 char **error) {
    const int code = store_read_block(t->store, t->terrain, number, &l->block, error);
    if (code != SQLITE_OK) return code;
    const bool is_main = (place->i + place->j) % 2 == 0, has_all = place->stride == 1;
    l->n = (1 << t->terrain->k) + 1;
    l->stride = place->stride;
    l->turned = l->n == 2 && !is_main;
    l->floor = has_all ? 0 : rqt_code_metres(l->block->floor);
    place_lattice(place, l, box);
    fill(l, box, has_all, is_main);
    const lattice_box pixels = lattice_window_of(l, box).pixels;
    find_pixels(l->col, box->west, box->east, l->g->col, pixels.west, pixels.east, l->at_col, l->fx);
    find_pixels(l->row, box->north, box->south, l->g->row, pixels.north, pixels.south, l->at_row, l->fy);
    return code;
}
