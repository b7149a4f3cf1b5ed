/* minimal.c - s(P), the error that gives the smallest mesh for every eps.
 *
 *     s(P) = max( max over T in diamond(P) of min(dev(T), s(apex T)), max over children of s ),  corners infinity
 *
 * In words: P is in the smallest mesh of eps when it splits a triangle that is there (its apex is in the mesh) and
 * deviates by more than eps, or when something that depends on P is. The least solution is found by passes that
 * only raise: coarse to fine the first part, fine to coarse the second (rqt_errors_saturate), until the first
 * changes nothing. Each pass is O(n); terrain takes about five. Codes are what is compared; rounding up commutes
 * with maximum and minimum, so this is also the code of the real-valued solution.
 */
#include "metric.h"

typedef struct field {
    rqt_errors *errors;
    const rqt_code *deviation;
    int32_t side, width, height;
    bool changed;
} field;

static rqt_code least(rqt_code a, rqt_code b) {
    return a < b ? a : b;
}

static rqt_code code_at(const field *f, int32_t x, int32_t y) {
    if (x < 0 || y < 0 || x > f->side || y > f->side) return 0;
    bool outline;
    return rqt_errors_at(f->errors, (rqt_vertex){x, y}, &outline);
}

/* The vertex at a place of the arrays, from the codes of its two apexes. */
static void raise_at(field *f, size_t at, rqt_code apex0, rqt_code apex1) {
    const rqt_code a = least(f->deviation[2 * at], apex0), b = least(f->deviation[2 * at + 1], apex1),
                   most = a > b ? a : b;
    if (most <= f->errors->code[at]) return;
    f->errors->code[at] = most;
    f->changed = true;
}

/* The vertices (x,y), x = first + i*step, whose apexes 0 and 1 are at +-(dx,dy): (dx0,dy0) for even i, (dx1,dy1)
 * for odd ones. */
typedef struct reach {
    int32_t dx, dy;
} reach;

static void raise_row(field *f, int32_t y, int32_t first, int32_t step, reach even, reach odd) {
    rqt_errors *e = f->errors;
    const int32_t row = lattice_slot(y, f->height);
    if (row < 0) return;
    const int32_t far_x = even.dx < 0 ? -even.dx : even.dx, far_y = even.dy < 0 ? -even.dy : even.dy;
    int32_t x = first, i = 0;
    for (; x <= f->side; x += step, i++) {
        const bool fast = x >= far_x && x + far_x < f->width && y >= far_y && y + far_y < f->height;
        if (fast) { /* samples all: their places are their coordinates */
            const ptrdiff_t columns = e->columns;
            const ptrdiff_t to[2] = {even.dy * columns + even.dx, odd.dy * columns + odd.dx};
            for (; x + far_x < f->width; x += step, i++) {
                const size_t at = (size_t)row * (size_t)columns + (size_t)x;
                const rqt_code *c = e->code + at;
                const ptrdiff_t jump = to[i & 1];
                raise_at(f, at, c[jump], c[-jump]);
            }
            if (x > f->side) break;
        }
        const int32_t column = lattice_slot(x, f->width);
        if (column < 0) break; /* further out than any error of this scale reaches */
        const reach to = i & 1 ? odd : even;
        raise_at(f, (size_t)row * (size_t)e->columns + (size_t)column, code_at(f, x + to.dx, y + to.dy),
                 code_at(f, x - to.dx, y - to.dy));
    }
}

/* Coarse to fine; within a scale the centres, then the sides that depend on them. */
static void pass_down(field *f) {
    for (int scale = f->errors->lattice.K - 1; scale >= 0; scale--) {
        const int32_t q = 1 << scale;
        const int64_t end = (int64_t)f->height + 6 * (int64_t)q;
        for (int64_t y = q; y <= f->side && y < end; y += 2 * (int64_t)q) {
            /* Where cell (i,j) has an even sum its diagonal runs from north-west to south-east. */
            const bool odd_row = ((y - q) / (2 * (int64_t)q)) & 1;
            const reach north_east = {q, -q}, south_east = {q, q};
            raise_row(f, (int32_t)y, q, 2 * q, odd_row ? south_east : north_east,
                      odd_row ? north_east : south_east);
        }
        for (int64_t y = 0; y <= f->side && y < end; y += q) {
            const bool odd_row = (y / q) & 1;
            const reach to = odd_row ? (reach){-q, 0} : (reach){0, -q};
            raise_row(f, (int32_t)y, odd_row ? 0 : q, 2 * q, to, to);
        }
    }
}

void minimal_solve(rqt_errors *s, const rqt_code *deviation) {
    field f = {.errors = s,
               .deviation = deviation,
               .side = 1 << s->lattice.K,
               .width = s->lattice.width,
               .height = s->lattice.height};
    const size_t n = (size_t)s->columns * (size_t)s->rows;
    do {
        rqt_errors_saturate(s); /* makes the corners infinite, too */
        f.changed = false;
        pass_down(&f);
    } while (f.changed);
    /* In every mesh: the outline bit says so, as for exact errors; infinite are the corners alone. */
    for (size_t i = 0; i < n; i++) {
        if (s->code[i] != RQT_CODE_INFINITY) continue;
        s->code[i] = RQT_CODE_LARGEST;
        s->outline[i] = 1;
    }
    for (int corner = 0; corner < 4; corner++) {
        const int32_t column = lattice_slot(corner & 1 ? f.side : 0, f.width),
                      row = lattice_slot(corner & 2 ? f.side : 0, f.height);
        const size_t at = (size_t)row * (size_t)s->columns + (size_t)column;
        s->code[at] = RQT_CODE_INFINITY;
        s->outline[at] = 0;
    }
    for (size_t i = 0; i < n && !s->any_outline; i++) s->any_outline = s->outline[i] != 0;
}
