/* samples.c - pixels of the levels that have pixels about as large as samples: on the full-resolution
 * mesh, as rqt_height has it, and the error measured at every sample.
 *
 * Both are loops over what lies around the tile, one window of samples, some 512 x 512 of them at most.
 */
#include "earth.h"
#include "terrarium.h"

#include <math.h>
#include <string.h>

#define ROUNDED 1e-6 /* metres that doubles of places and heights may be off */

typedef struct window {
    int32_t col, row, width, height;
    int32_t *q;
    uint8_t *valid;
    double *metres; /* of the samples that are valid */
} window;

/* The samples around the pixels of the turn. */
static int read_window(tiles *t, const pixel_grid *g, window *w, char **error) {
    const int32_t width = t->terrain->lattice.width, height = t->terrain->lattice.height;
    const double west = larger(floor(g->col[0]), 0), east = smaller(ceil(g->col[GRID - 1]), width - 1);
    const double north = larger(floor(g->row[0]), 0), south = smaller(ceil(g->row[GRID - 1]), height - 1);
    *w = (window){.col = (int32_t)west,
                  .row = (int32_t)north,
                  .width = (int32_t)(east - west) + 1,
                  .height = (int32_t)(south - north) + 1};
    const size_t count = (size_t)w->width * (size_t)w->height;
    w->metres = sqlite3_malloc64(count * sizeof *w->metres);
    w->q = sqlite3_malloc64(count * sizeof *w->q);
    w->valid = sqlite3_malloc64(count);
    if (!w->metres || !w->q || !w->valid) return SQLITE_NOMEM;
    const int code = store_window(t->store, t->terrain, w->col, w->row, w->width, w->height, w->q, w->valid, error);
    if (code != SQLITE_OK) return code;
    /* rqt_unit_metres, of many at once. */
    const rqt_unit *unit = &t->terrain->unit;
    const double z0 = (double)unit->z0, d = (double)unit->d, factor = rqt_unit_factor(unit), offset = unit->offset;
    for (size_t i = 0; i < count; i++) w->metres[i] = (z0 + w->q[i] / d) * factor + offset;
    return code;
}

static void free_window(window *w) {
    sqlite3_free(w->metres);
    sqlite3_free(w->q);
    sqlite3_free(w->valid);
}

static double to_units(double samples) {
    return nearbyint(samples * 0x1p20) * 0x1p-20;
}

/* The height of the half cell that holds the place, if what has weight in it is valid. */
static bool find_height(const window *w, int32_t x, int32_t y, double fx, double fy, double *metres) {
    const size_t nw = (size_t)(y - w->row) * (size_t)w->width + (size_t)(x - w->col), below = (size_t)w->width;
    const size_t at[4] = {nw, nw + 1, nw + below, nw + below + 1};
    double weight[4];
    if ((x + y) % 2 == 0) { /* diagonal from north-west to south-east */
        weight[0] = 1 - (fx > fy ? fx : fy);
        weight[1] = fx > fy ? fx - fy : 0;
        weight[2] = fy > fx ? fy - fx : 0;
        weight[3] = fx < fy ? fx : fy;
    } else {
        const double sum = fx + fy;
        weight[0] = sum < 1 ? 1 - sum : 0;
        weight[1] = sum < 1 ? fx : 1 - fy;
        weight[2] = sum < 1 ? fy : 1 - fx;
        weight[3] = sum > 1 ? sum - 1 : 0;
    }
    *metres = 0;
    for (int c = 0; c < 4; c++) {
        if (weight[c] == 0) continue;
        if (!w->valid[at[c]]) return false;
        *metres += weight[c] * w->metres[at[c]];
    }
    return true;
}

/* cols: the pixels' columns, as regions have them. */
static void draw_row(const window *w, const double cols[GRID], int j, pixel_grid *g) {
    const int32_t width = g->terrain->lattice.width, height = g->terrain->lattice.height;
    const double row = to_units(g->row[j]);
    if (row < 0 || row > height - 1) return;
    const int32_t y = row < height - 1 ? (int32_t)row : height - 2;
    for (int i = 0; i < GRID; i++) {
        int32_t *code = &g->code[j * GRID + i];
        double metres;
        if (*code != UNKNOWN || cols[i] < 0 || cols[i] > width - 1) continue;
        const int32_t x = cols[i] < width - 1 ? (int32_t)cols[i] : width - 2;
        if (find_height(w, x, y, cols[i] - x, row - y, &metres)) *code = pixels_code(g, metres);
    }
}

static void draw(const window *w, pixel_grid *g) {
    double cols[GRID];
    for (int i = 0; i < GRID; i++) cols[i] = to_units(g->col[i]);
    for (int j = 0; j < GRID; j++) draw_row(w, cols, j, g);
}

/* Where a row of samples lies among the pixels: the one above, and how far below it, as Mercator has it. */
static bool find_row(const pixel_grid *g, int32_t row, int *j, double *v) {
    const rqt_placement *at = &g->terrain->placement;
    const double lat = at->y0 + row * at->dy;
    if (lat > g->lat[0] || lat < g->lat[GRID - 1]) return false;
    /* Rows of pixels are the same distance apart in the plane. */
    const double top = asinh(tan(g->lat[0] * DEGREE)), next = asinh(tan(lat * DEGREE));
    const double n = (top - next) / (2 * M_PI) * ldexp(PIXELS, g->z);
    *j = (int)smaller(larger(floor(n), 0), GRID - 2);
    *v = smaller(larger(n - *j, 0), 1);
    return true;
}

/* The columns of samples that lie among the pixels: likewise. */
static int find_cols(const pixel_grid *g, const window *w, int32_t *from, int *i, double *u) {
    int count = 0;
    for (int32_t x = 0; x < w->width; x++) {
        const double n = (w->col + x - g->col[0]) * g->per_col;
        if (n < 0 || n > GRID - 1) continue;
        if (count == 0) *from = x;
        i[count] = (int)smaller(floor(n), GRID - 2);
        u[count] = n - i[count];
        count++;
    }
    return count;
}

static int measure(const window *w, pixel_grid *g) {
    double *u = sqlite3_malloc64((size_t)w->width * sizeof *u);
    int *i = sqlite3_malloc64((size_t)w->width * sizeof *i);
    int32_t from = 0;
    const int count = u && i ? find_cols(g, w, &from, i, u) : 0;
    double most = g->error;
    for (int32_t y = 0; y < w->height && count > 0; y++) {
        const size_t first = (size_t)y * (size_t)w->width + (size_t)from;
        int j;
        double v;
        if (!find_row(g, w->row + y, &j, &v)) continue;
        for (int n = 0; n < count; n++) {
            const size_t at = (size_t)j * GRID + (size_t)i[n];
            if (!g->is_whole[at] || !w->valid[first + (size_t)n]) continue;
            const double off = fabs(pixels_between(g, at, u[n], v) - w->metres[first + (size_t)n]);
            if (off > most) most = off;
        }
    }
    g->error = most;
    const bool ok = u && i;
    sqlite3_free(u);
    sqlite3_free(i);
    return ok ? SQLITE_OK : SQLITE_NOMEM;
}

int samples_draw(tiles *t, pixel_grid *g, char **error) {
    window windows[MOST_TURNS];
    int turns[MOST_TURNS], first, last, count = 0, code = SQLITE_OK;
    pixels_turns(g, &first, &last);
    for (int turn = first; turn <= last && count < MOST_TURNS && code == SQLITE_OK; turn++) {
        if (!pixels_turn(g, turn)) continue;
        turns[count] = turn;
        code = read_window(t, g, &windows[count], error);
        if (code == SQLITE_OK) draw(&windows[count], g);
        count++;
    }
    pixels_close(g);
    for (int i = 0; i < count; i++) {
        if (code == SQLITE_OK && pixels_turn(g, turns[i])) code = measure(&windows[i], g);
        free_window(&windows[i]);
    }
    g->error += t->terrain->quantum_error + ROUNDED;
    return code;
}
