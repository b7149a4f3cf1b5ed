/* leaves.c - pixels of the levels that have pixels larger than samples: on a mesh whose vertices are
 * about as far apart as pixels. proof.c tells how far it is from what is drawn.
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

/* Pixels whose square meets a leaf that is not kept are void. Squares reach to the middle between pixels, and a
 * little further, or a place on the line between two might be nobody's. */
static void void_leaf(const lattice *l, const corner leaf[3]) {
    pixel_grid *g = l->g;
    const lattice_box b = lattice_box_of(leaf);
    const double half = 0.5 / g->per_col + SLACK;
    for (int j = l->first_row[b.north] > 0 ? l->first_row[b.north] - 1 : 0; j < GRID; j++) {
        const double up = j > 0 ? g->row[j] - g->row[j - 1] : 0,
                     down = j + 1 < GRID ? g->row[j + 1] - g->row[j] : 0;
        /* The middle in Mercator's plane is not the one in latitude: a quarter more. */
        const double from = g->row[j] - 0.625 * up - SLACK, to = g->row[j] + 0.625 * down + SLACK;
        double west, east;
        if (from > l->row[b.south]) break;
        if (!triangle_span(leaf, from, to, &west, &east)) continue;
        for (int i = l->first_col[b.west] > 0 ? l->first_col[b.west] - 1 : 0; i < GRID; i++) {
            if (g->col[i] - half > east) break;
            if (g->col[i] + half >= west) g->code[j * GRID + i] = NO_HEIGHT;
        }
    }
}

static void void_triangle(const lattice *l, const corner triangle[3]) {
    corner children[2][3];
    plane p;
    if (lattice_misses(l, triangle)) return;
    if (lattice_split(l, triangle, children)) {
        void_triangle(l, children[0]);
        void_triangle(l, children[1]);
    } else if (!(triangle[0].valid && triangle[1].valid && triangle[2].valid) && triangle_plane(triangle, &p)) {
        void_leaf(l, triangle);
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
    if (!l->has_voids) return SQLITE_OK;
    lattice_halves(l, place, halves);
    void_triangle(l, halves[0]);
    void_triangle(l, halves[1]);
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
