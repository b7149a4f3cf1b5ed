/* pixels.c - where the pixels of a tile lie, what their heights are told as, and what clients draw
 * between them.
 *
 * Places. Pixel (X,Y) of level z, counted over all tiles from 180 degrees west and from the north, has its centre
 * at
 *
 *     longitude (X + 1/2) 360 / 2^(z+8) - 180,    latitude atan(sinh(pi (1 - (2Y + 1) / 2^(z+8))))
 *
 * functions of X and of Y alone, the first of them exact: so whatever tile looks at a pixel, as its own or as a
 * neighbour's, looks at the same place. Clients draw what lies between four centres as bilinear interpolation in
 * Mercator's plane. Half a pixel of a tile lies beyond its own outermost centres; there they need the next tile's,
 * and take them (MapLibre copies them over the tile's border). Therefore a tile is looked at here with one pixel of
 * its neighbours around, and what is said of its error holds for all of its square.
 *
 * Heights. R * 256 + G + B / 256 - 32768 metres, in steps of the level. (128, 0, 0), which is 0 m, is for what has
 * no height, void or beyond the raster, as other terrain services have it; terrain at 0 m is told a step higher. So
 * whoever wants to can tell them apart, and those who cannot see the sea's level.
 */
#include "earth.h"
#include "terrarium.h"

#include <math.h>
#include <string.h>

enum { LOWEST = -32768, CODES = 1 << 24, PER_METRE = 256 };

void pixels_place(const tiles *t, int z, int32_t x, int32_t y, double step, pixel_grid *g) {
    const double count = ldexp(PIXELS, z), first_x = (double)x * PIXELS - 1, first_y = (double)y * PIXELS - 1;
    const rqt_placement *at = &t->terrain->placement;
    g->terrain = t->terrain;
    g->z = z;
    g->code_step = (int32_t)(step * PER_METRE);
    g->per_step = 1 / step; /* a power of two, as step is */
    g->most_steps = (double)CODES / g->code_step - 1;
    g->error = 0;
    for (int i = 0; i < GRID; i++) {
        g->lon[i] = (first_x + i + 0.5) * 360 / count - 180;
        g->lat[i] = atan(sinh(M_PI * (1 - (2 * (first_y + i) + 1) / count))) / DEGREE;
        g->row[i] = (g->lat[i] - at->y0) / at->dy;
    }
    for (int i = 0; i + 1 < GRID; i++) g->per_row[i] = 1 / (g->row[i + 1] - g->row[i]);
    g->per_row[GRID - 1] = 0;
    for (size_t i = 0; i < (size_t)GRID * GRID; i++) g->code[i] = UNKNOWN;
    /* Beyond the poles' side of the square that is the world there are no pixels. */
    if (y == 0)
        for (size_t i = 0; i < GRID; i++) g->code[i] = NO_HEIGHT;
    if (y == (1 << z) - 1)
        for (size_t i = 0; i < GRID; i++) g->code[(size_t)(GRID - 1) * GRID + i] = NO_HEIGHT;
}

void pixels_turns(const pixel_grid *g, int *first, int *last) {
    const geo_extent e = tiles_extent(g->terrain);
    *first = (int)floor((e.west - g->lon[GRID - 1]) / 360);
    *last = (int)ceil((e.east - g->lon[0]) / 360);
}

bool pixels_turn(pixel_grid *g, int turn) {
    const rqt_placement *at = &g->terrain->placement;
    const int32_t width = g->terrain->lattice.width, height = g->terrain->lattice.height;
    for (int i = 0; i < GRID; i++) g->col[i] = (g->lon[i] + 360.0 * turn - at->x0) / at->dx;
    g->per_col = 1 / (g->col[1] - g->col[0]);
    return width > 1 && height > 1 && g->col[GRID - 1] > 0 && g->col[0] < width - 1 && g->row[GRID - 1] > 0 &&
           g->row[0] < height - 1;
}

int32_t pixels_code(const pixel_grid *g, double metres) {
    const int32_t step = g->code_step;
    const double n = (metres - LOWEST) * g->per_step + 0.5, most = g->most_steps;
    const int32_t code = step * (int32_t)(n < 0 ? 0 : n > most ? most : n);
    if (code == NO_HEIGHT) return metres < 0 ? NO_HEIGHT - step : NO_HEIGHT + step;
    return code;
}

/* Loops that the compiler does many pixels of at once. */
void pixels_close(pixel_grid *g) {
    for (size_t i = 0; i < (size_t)GRID * GRID; i++) {
        g->code[i] = g->code[i] == UNKNOWN ? NO_HEIGHT : g->code[i];
        g->height[i] = (double)g->code[i] / PER_METRE + LOWEST;
    }
    for (size_t j = 0; j + 1 < GRID; j++) {
        const int32_t *c = g->code + j * GRID;
        uint8_t *is_whole = g->is_whole + j * GRID;
        for (size_t i = 0; i + 1 < GRID; i++)
            is_whole[i] = (c[i] != NO_HEIGHT) & (c[i + 1] != NO_HEIGHT) & (c[GRID + i] != NO_HEIGHT) &
                          (c[GRID + i + 1] != NO_HEIGHT);
        is_whole[GRID - 1] = 0;
    }
    memset(g->is_whole + (size_t)(GRID - 1) * GRID, 0, GRID);
}
