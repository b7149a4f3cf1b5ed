/* verify_raster.c - which samples a triangle covers, and its plane: what all measurements over samples share.
 *
 * Every triangle is walked row by row. A row's samples in the closed triangle are an interval whose ends come from
 * integer division, so no sample on an edge is gained or lost by rounding.
 */
#include "verify_internal.h"

/* Boxes with fewer cells than this keep all numerators in 64 bits, see verify_plane_of. */
enum { NARROW_BOX_LIMIT = 1 << 20 };

static int64_t floor_divide(int64_t a, int64_t b) { /* b > 0 */
    int64_t quotient = a / b;
    return quotient - (a % b < 0);
}

static int64_t least(int64_t a, int64_t b) {
    return a < b ? a : b;
}

static int64_t most(int64_t a, int64_t b) {
    return a > b ? a : b;
}

bool verify_plane_of(const verify_triangle *triangle, verify_plane *p) {
    p->corner[0] = triangle->corner[0];
    p->corner[1] = triangle->corner[1];
    p->corner[2] = triangle->corner[2];
    p->twice_area = verify_cross(&p->corner[0], &p->corner[1], &p->corner[2]);
    if (p->twice_area == 0) return false;
    if (p->twice_area < 0) {
        p->corner[1] = triangle->corner[2];
        p->corner[2] = triangle->corner[1];
        p->twice_area = -p->twice_area;
    }
    const verify_corner *a = &p->corner[0], *b = &p->corner[1], *c = &p->corner[2];
    int64_t bx = (int64_t)b->col - a->col, by = (int64_t)b->row - a->row, bq = (int64_t)b->q - a->q;
    int64_t cx = (int64_t)c->col - a->col, cy = (int64_t)c->row - a->row, cq = (int64_t)c->q - a->q;
    p->slope_x = bq * cy - cq * by;
    p->slope_y = cq * bx - bq * cx;
    p->first_row = least(a->row, least(b->row, c->row));
    p->last_row = most(a->row, most(b->row, c->row));
    int64_t first_col = least(a->col, least(b->col, c->col));
    int64_t last_col = most(a->col, most(b->col, c->col));
    /* In a box of w by h cells D <= w * h, |slope_x| < 2^32 * h, |slope_y| < 2^32 * w, and an offset is at most w
     * or h. So each product below is under 2^32 * w * h for a slope, and also for D * (q - qa), where q is any
     * 32-bit number; a sum of three stays in 64 bits up to w * h = 2^29. The limit is far lower so that 128 bits
     * are not a rarity that only a window of gigabytes, and no test, would ever see. */
    p->narrow = (last_col - first_col) * (p->last_row - p->first_row) < NARROW_BOX_LIMIT;
    return true;
}

void verify_row_interval(const verify_plane *p, int64_t row, int64_t *first, int64_t *last) {
    *first = INT64_MIN;
    *last = INT64_MAX;
    for (int k = 0; k < 3; k++) {
        const verify_corner *a = &p->corner[k], *b = &p->corner[k == 2 ? 0 : k + 1];
        int64_t dx = (int64_t)b->col - a->col, dy = (int64_t)b->row - a->row;
        int64_t reach = dx * (row - a->row);
        if (dy > 0) {
            *last = least(*last, a->col + floor_divide(reach, dy));
        } else if (dy < 0) {
            /* x - ax >= reach / dy, rounded up: the ceiling is minus the floor of the negated fraction. */
            *first = most(*first, a->col - floor_divide(reach, -dy));
        } /* a level edge bounds the rows, and the rows are already the triangle's */
    }
}
