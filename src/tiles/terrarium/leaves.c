/* leaves.c - pixels of the levels that have pixels larger than samples: on a mesh whose vertices are about as far
 * apart as pixels. proof.c tells how far it is from what is drawn.
 *
 * Blocks of one level of the pyramid tile the terrain. Each, of stride s, keeps the vertices of its lattice whose
 * error is above its em, and those of the outline, which with its corners are a closed set; no vertex finer than s
 * has an error above em. So a leaf of that set in the block's cell, with three valid corners, has each of its valid
 * samples within em of its plane. Which mesh that is depends on the place alone. (Two blocks need not agree on what
 * they have in common, for their em differ; each is within its own.)
 *
 * Voids. Samples in leaves that are not kept are within nothing of anything. So a pixel is void when its square,
 * half a pixel around its centre, meets such a leaf: then no sample in one has four pixels of terrain around it.
 */
#include "leaves.h"

#include <math.h>
#include <string.h>

/* Extent in columns of what a triangle has between two rows; false: nothing. */
bool triangle_span(const corner triangle[3], double from, double to, double *west, double *east) {
    *west = HUGE_VAL;
    *east = -HUGE_VAL;
    for (int a = 0; a < 3; a++) {
        const corner *p = &triangle[a], *q = &triangle[a == 2 ? 0 : a + 1];
        if (p->row >= from && p->row <= to) {
            *west = smaller(*west, p->col);
            *east = larger(*east, p->col);
        }
        for (int b = 0; b < 2; b++) {
            const double row = b ? to : from;
            if ((p->row < row) == (q->row < row)) continue;
            const double col = p->col + (q->col - p->col) * ((row - p->row) / (q->row - p->row));
            *west = smaller(*west, col);
            *east = larger(*east, col);
        }
    }
    return *west <= *east;
}

lattice_box lattice_box_of(const corner triangle[3]) {
    lattice_box b = {triangle[0].i, triangle[0].i, triangle[0].j, triangle[0].j};
    for (int a = 1; a < 3; a++) {
        if (triangle[a].i < b.west) b.west = triangle[a].i;
        if (triangle[a].i > b.east) b.east = triangle[a].i;
        if (triangle[a].j < b.north) b.north = triangle[a].j;
        if (triangle[a].j > b.south) b.south = triangle[a].j;
    }
    return b;
}

bool triangle_plane(const corner triangle[3], plane *p) {
    const corner *a = &triangle[0], *b = &triangle[1], *c = &triangle[2];
    const double x1 = b->col - a->col, x2 = c->col - a->col, y1 = b->row - a->row, y2 = c->row - a->row;
    const double z1 = b->metres - a->metres, z2 = c->metres - a->metres, area = x1 * y2 - x2 * y1;
    if (area == 0) return false;
    p->by_col = (z1 * y2 - z2 * y1) / area;
    p->by_row = (x1 * z2 - x2 * z1) / area;
    p->at = a->metres - a->col * p->by_col - a->row * p->by_row;
    return true;
}

bool lattice_misses(const lattice *l, const corner triangle[3]) {
    const lattice_box b = lattice_box_of(triangle);
    const pixel_grid *g = l->g;
    if (l->col[b.west] == l->col[b.east] || l->row[b.north] == l->row[b.south]) return true; /* no area */
    /* Pixels beyond the outermost need nothing, and void ones next to a leaf are within the strip around. */
    return l->first_col[b.west] == GRID || l->first_row[b.north] == GRID || l->col[b.east] < g->col[0] ||
           l->row[b.south] < g->row[0];
}

bool lattice_straddles(const lattice *l, const rqt_block_place *place, const corner triangle[3]) {
    const lattice_box b = lattice_box_of(triangle);
    return l->col[b.east] - l->col[b.west] != (double)(b.east - b.west) * place->stride ||
           l->row[b.south] - l->row[b.north] != (double)(b.south - b.north) * place->stride;
}

corner lattice_corner(const lattice *l, int i, int j) {
    const size_t at = (size_t)j * (size_t)l->n + (size_t)i;
    return (corner){.col = l->col[i],
                    .row = l->row[j],
                    .metres = l->metres[at],
                    .valid = l->what[at] & HAS_HEIGHT,
                    .i = i,
                    .j = j};
}

bool lattice_split(const lattice *l, const corner triangle[3], corner children[2][3]) {
    const corner *a = &triangle[0], *left = &triangle[1], *right = &triangle[2];
    const int i = left->i + right->i, j = left->j + right->j;
    if (i % 2 || j % 2 || !(l->what[(size_t)(j / 2) * (size_t)l->n + (size_t)(i / 2)] & IS_SAMPLE)) return false;
    children[0][0] = children[1][0] = lattice_corner(l, i / 2, j / 2);
    children[0][1] = *a;
    children[0][2] = *left;
    children[1][1] = *right;
    children[1][2] = *a;
    return true;
}

/* The diagonal of a cell of the lattice passes through the corner whose coordinates are both odd multiples of its
 * side. */
void lattice_halves(const lattice *l, const rqt_block_place *place, corner halves[2][3]) {
    const int last = l->n - 1;
    const corner nw = lattice_corner(l, 0, 0), ne = lattice_corner(l, last, 0), sw = lattice_corner(l, 0, last),
                 se = lattice_corner(l, last, last);
    const bool is_main = (place->i + place->j) % 2 == 0;
    const corner all[2][3] = {{is_main ? ne : nw, is_main ? nw : sw, is_main ? se : ne},
                              {is_main ? sw : se, is_main ? se : ne, is_main ? nw : sw}};
    memcpy(halves, all, sizeof all);
}

static int visit_turn(tiles *t, int level, pixel_grid *g, int turn, visit_block *visit, void *context,
                      char **error) {
    const rqt_lattice *all = &t->terrain->lattice;
    const double side = ldexp(1, all->K - level);
    const int32_t i0 = (int32_t)floor(larger(g->col[0] - 1, 0) / side),
                  j0 = (int32_t)floor(larger(g->row[0] - 1, 0) / side);
    const int32_t i1 = (int32_t)floor(smaller(g->col[GRID - 1] + 1, all->width - 1) / side),
                  j1 = (int32_t)floor(smaller(g->row[GRID - 1] + 1, all->height - 1) / side);
    for (int32_t j = j0; j <= j1; j++)
        for (int32_t i = i0; i <= i1; i++) {
            const rqt_block_number number = rqt_block_number_of(level, i, j);
            rqt_block_place place;
            if (rqt_block_locate(all, t->terrain->k, number, &place) != RQT_OK) continue;
            const int code = visit(t, &place, number, turn, context, error);
            if (code != SQLITE_OK) return code;
        }
    return SQLITE_OK;
}

int lattice_visit(tiles *t, int level, pixel_grid *g, visit_block *visit, void *context, char **error) {
    int first, last, code = SQLITE_OK;
    pixels_turns(g, &first, &last);
    for (int turn = first; turn <= last && code == SQLITE_OK; turn++)
        if (pixels_turn(g, turn)) code = visit_turn(t, level, g, turn, visit, context, error);
    return code;
}

/* ------------------------------------------------------------------------------------------------ drawing -- */

/* Pixels on the mesh get its height, if they have none. */
static void draw_pixels(const lattice *l, const lattice_box *box) {
    pixel_grid *g = l->g;
    const lattice_box pixels = lattice_window_of(l, box).pixels;
    for (int j = pixels.north; j <= pixels.south; j++)
        for (int i = pixels.west; i <= pixels.east; i++) {
            int32_t *code = &g->code[j * GRID + i];
            double metres;
            if (*code != UNKNOWN) continue;
            if (lattice_height(l, l->at_col[i], l->at_row[j], l->fx[i], l->fy[j], &metres))
                *code = pixels_code(g, metres);
        }
}

/* The rows that a pixel's square takes, and a little more: the middle between rows in Mercator's plane is not the
 * one in latitude. */
static void reach(const pixel_grid *g, int j, double *from, double *to) {
    const int above = j > 0 ? j - 1 : 0, below = j < GRID - 1 ? j + 1 : GRID - 1;
    *from = g->row[j] - 0.625 * (g->row[j] - g->row[above]) - SLACK;
    *to = g->row[j] + 0.625 * (g->row[below] - g->row[j]) + SLACK;
}

/* Pixels whose square meets a triangle are void. Squares reach to the middle between pixels, and a little further,
 * or a place on the line between two might be nobody's. */
static void void_triangle(const lattice *l, const corner triangle[3]) {
    pixel_grid *g = l->g;
    const lattice_box b = lattice_box_of(triangle);
    const double half = 0.5 / g->per_col + SLACK;
    for (int j = l->first_row[b.north] > 0 ? l->first_row[b.north] - 1 : 0; j < GRID; j++) {
        double from, to, west, east;
        reach(g, j, &from, &to);
        if (from > l->row[b.south]) break;
        if (!triangle_span(triangle, from, to, &west, &east)) continue;
        for (int i = l->first_col[b.west] > 0 ? l->first_col[b.west] - 1 : 0; i < GRID; i++) {
            if (g->col[i] - half > east) break;
            if (g->col[i] + half >= west) g->code[j * GRID + i] = NO_HEIGHT;
        }
    }
}

/* ... or a run of cells in a row of the lattice. */
static void void_run(const lattice *l, int west, int east, int y) {
    pixel_grid *g = l->g;
    const double half = 0.5 / g->per_col + SLACK;
    int first = l->first_col[west] > 0 ? l->first_col[west] - 1 : 0, last = l->first_col[east];
    if (g->col[first] + half < l->col[west]) first++;
    if (last == GRID || g->col[last] - half > l->col[east]) last--;
    for (int j = l->first_row[y] > 0 ? l->first_row[y] - 1 : 0; j < GRID; j++) {
        double from, to;
        reach(g, j, &from, &to);
        if (from > l->row[y + 1]) break;
        if (to < l->row[y]) continue;
        for (int i = first; i <= last; i++) g->code[j * GRID + i] = NO_HEIGHT;
    }
}

/* Is the half of a cell that has its right angle at a corner of it, 0 or 1 right and down, on a triangle of the
 * lattice (whose sides are longer)? Its centre tells. */
static bool is_in(const corner triangle[3], int x, int y, int right, int down) {
    const int cx = 3 * x + 1 + right, cy = 3 * y + 1 + down;
    int signs = 0;
    for (int a = 0; a < 3; a++) {
        const corner *p = &triangle[a], *q = &triangle[a == 2 ? 0 : a + 1];
        signs += (q->i - p->i) * (cy - 3 * p->j) > (q->j - p->j) * (cx - 3 * p->i) ? 1 : -1;
    }
    return signs == 3 || signs == -3;
}

/* What of a triangle of the lattice has no height: halves of cells. */
static void void_cells(const lattice *l, const lattice_box *box, const corner triangle[3]) {
    lattice_box b = lattice_box_of(triangle);
    if (b.west < box->west) b.west = box->west;
    if (b.east > box->east) b.east = box->east;
    if (b.north < box->north) b.north = box->north;
    if (b.south > box->south) b.south = box->south;
    for (int y = b.north; y < b.south; y++) {
        int begun = b.west; /* the run that ends here */
        for (int x = b.west; x < b.east; x++) {
            const uint8_t *up = l->what + (size_t)y * (size_t)l->n + (size_t)x, *down = up + l->n;
            const int is_main = (x + y + l->turned) % 2 == 0;
            const int nw = up[0], ne = up[1], sw = down[0], se = down[1];
            bool is_void[2] = {false, false}; /* of the upper and the lower half */
            if (!(nw & ne & sw & se & HAS_HEIGHT))
                for (int half = 0; half < 2; half++)
                    is_void[half] =
                        !((is_main ? nw & se & (half ? sw : ne) : ne & sw & (half ? se : nw)) & HAS_HEIGHT) &&
                        is_in(triangle, x, y, is_main ? !half : half, half);
            if (is_void[0] && is_void[1]) continue;
            if (begun < x) void_run(l, begun, x, y);
            begun = x + 1;
            if (!is_void[0] && !is_void[1]) continue;
            const int half = is_void[1];
            const corner found[3] = {lattice_corner(l, is_main ? x : x + 1, y),
                                     lattice_corner(l, is_main ? x + 1 : x, y + 1),
                                     lattice_corner(l, is_main ? x + !half : x + half, y + half)};
            void_triangle(l, found);
        }
        if (begun < b.east) void_run(l, begun, b.east, y);
    }
}

/* What of a triangle of the block has no height: leaves, where cells of the lattice are not parts of them. */
static void void_leaves(const lattice *l, const rqt_block_place *place, const lattice_box *box,
                        const corner triangle[3]) {
    corner children[2][3];
    if (!l->is_squeezed || !lattice_straddles(l, place, triangle)) {
        void_cells(l, box, triangle);
    } else if (!lattice_misses(l, triangle)) {
        if (lattice_split(l, triangle, children)) {
            void_leaves(l, place, box, children[0]);
            void_leaves(l, place, box, children[1]);
        } else if (!(triangle[0].valid && triangle[1].valid && triangle[2].valid)) {
            void_triangle(l, triangle);
        }
    }
}

static int draw_block(tiles *t, const rqt_block_place *place, rqt_block_number number, int turn, void *context,
                      char **error) {
    lattice *l = context;
    corner halves[2][3];
    (void)turn;
    lattice_box box = {0, 1 << t->terrain->k, 0, 1 << t->terrain->k};
    const int code = lattice_read(t, place, number, l, &box, error);
    if (code != SQLITE_OK) return code;
    draw_pixels(l, &box);
    if (!l->has_voids && !l->is_squeezed) return SQLITE_OK;
    lattice_halves(l, place, halves);
    void_leaves(l, place, &box, halves[0]);
    void_leaves(l, place, &box, halves[1]);
    return SQLITE_OK;
}

int leaves_draw(tiles *t, int shift, pixel_grid *g, char **error) {
    const int levels = t->terrain->lattice.K - t->terrain->k, level = levels > shift ? levels - shift : 0;
    lattice *l = sqlite3_malloc64(sizeof *l);
    if (!l) return SQLITE_NOMEM;
    l->g = g;
    int code = lattice_visit(t, level, g, draw_block, l, error);
    sqlite3_free(l);
    pixels_close(g);
    if (code == SQLITE_OK) code = leaves_prove(t, level, g, error);
    return code;
}
