/* saturate.c - e_sat: every vertex takes the maximum over its descendants, so that a threshold alone gives closed
 * sets.
 *
 * Fine to coarse, each vertex pulls from its children: the centres of scale q from the four sides of their cell,
 * then the sides of scale 2q from the four centres around them. Saturated codes decide alone: no dependency is
 * looked up at query time ([RQT] equation 3). The outline bit travels the same way, with "or" as its maximum.
 */
#include "internal.h"

typedef struct field {
    rqt_errors *errors;
    int32_t side;
} field;

static void pull(const field *f, size_t at, int32_t x, int32_t y) {
    if (x < 0 || y < 0 || x > f->side || y > f->side) return;
    const int32_t column = lattice_slot(x, f->errors->lattice.width),
                  row = lattice_slot(y, f->errors->lattice.height);
    if (column < 0 || row < 0) return;
    const size_t from = (size_t)row * (size_t)f->errors->columns + (size_t)column;
    if (f->errors->code[from] > f->errors->code[at]) f->errors->code[at] = f->errors->code[from];
    f->errors->outline[at] |= f->errors->outline[from];
}

/* All vertices (x,y) = (first_x + i*step, y): pull from four vertices at +-dx, +-dy (crosswise or along the axes).
 */
static void pull_row(const field *f, int32_t y, int32_t first_x, int32_t step, int32_t reach, bool diagonal) {
    rqt_errors *e = f->errors;
    const int32_t width = e->lattice.width, height = e->lattice.height;
    const int32_t row = lattice_slot(y, height);
    if (row < 0) return;
    int32_t x = first_x;
    /* The quick way where all four are samples. */
    if (y - reach >= 0 && y + reach < height) {
        const size_t columns = (size_t)e->columns;
        rqt_code *const code = e->code + (size_t)row * columns;
        uint8_t *const outline = e->outline + (size_t)row * columns;
        const size_t jump = (size_t)reach * columns, r = (size_t)reach;
        if (x < reach) {
            pull(f, (size_t)row * columns + (size_t)x, x - reach, diagonal ? y - reach : y);
            pull(f, (size_t)row * columns + (size_t)x, x + reach, diagonal ? y - reach : y);
            pull(f, (size_t)row * columns + (size_t)x, diagonal ? x - reach : x, y + reach);
            pull(f, (size_t)row * columns + (size_t)x, diagonal ? x + reach : x, diagonal ? y + reach : y - reach);
            x += step;
        }
        for (; x + reach < width; x += step) {
            const size_t at = (size_t)x;
            rqt_code *c = code + at;
            const rqt_code a = diagonal ? c[-(ptrdiff_t)jump - (ptrdiff_t)r] : c[-(ptrdiff_t)r];
            const rqt_code b = diagonal ? c[-(ptrdiff_t)jump + (ptrdiff_t)r] : c[r];
            const rqt_code d = diagonal ? c[jump - r] : c[jump];
            const rqt_code g = diagonal ? c[jump + r] : c[-(ptrdiff_t)jump];
            const rqt_code ab = a > b ? a : b, dg = d > g ? d : g, most = ab > dg ? ab : dg;
            if (most > *c) *c = most;
            if (e->any_outline) {
                uint8_t *o = outline + at;
                if (diagonal)
                    *o |= (uint8_t)(o[-(ptrdiff_t)jump - (ptrdiff_t)r] | o[-(ptrdiff_t)jump + (ptrdiff_t)r] |
                                    o[jump - r] | o[jump + r]);
                else
                    *o |= (uint8_t)(o[-(ptrdiff_t)r] | o[r] | o[jump] | o[-(ptrdiff_t)jump]);
            }
        }
    }
    for (; x <= f->side; x += step) {
        const int32_t column = lattice_slot(x, width);
        if (column < 0) break; /* further out than any error of this scale reaches */
        const size_t at = (size_t)row * (size_t)e->columns + (size_t)column;
        if (diagonal) {
            pull(f, at, x - reach, y - reach);
            pull(f, at, x + reach, y - reach);
            pull(f, at, x - reach, y + reach);
            pull(f, at, x + reach, y + reach);
        } else {
            pull(f, at, x - reach, y);
            pull(f, at, x + reach, y);
            pull(f, at, x, y - reach);
            pull(f, at, x, y + reach);
        }
    }
}

void rqt_errors_saturate(rqt_errors *errors) {
    const rqt_lattice *lattice = &errors->lattice;
    const field f = {errors, 1 << lattice->K};
    /* One past the furthest coordinate that an error of scale q can reach. */
    for (int scale = 0; scale < lattice->K; scale++) {
        const int32_t q = 1 << scale;
        const int64_t end = (int64_t)lattice->height + 6 * (int64_t)q;
        for (int64_t y = q; y <= f.side && y < end; y += 2 * q) pull_row(&f, (int32_t)y, q, 2 * q, q, false);
        const int64_t far_end = (int64_t)lattice->height + 12 * (int64_t)q;
        for (int64_t y = 0; y <= f.side && y < far_end; y += 2 * q) {
            const bool odd = (y / (2 * q)) & 1;
            pull_row(&f, (int32_t)y, odd ? 0 : 2 * q, 4 * q, q, true);
        }
    }
    for (int corner = 0; corner < 4; corner++) {
        const int32_t x = corner & 1 ? f.side : 0, y = corner & 2 ? f.side : 0;
        const int32_t column = lattice_slot(x, lattice->width), row = lattice_slot(y, lattice->height);
        errors->code[(size_t)row * (size_t)errors->columns + (size_t)column] = RQT_CODE_INFINITY;
    }
}
