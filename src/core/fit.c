/* fit.c - the plane that fits the samples of a triangle best, and what they are off it: the metric `plane`.
 *
 * Least squares over the valid samples of the closed triangle, which is clamped where the raster ends: three passes
 * over its rows, for the means, the moments about them, and the distances. In doubles, always in the same order, so
 * that the same samples give the same number everywhere. Rounding leaves about 2^-50 of the relief where the
 * samples are a plane; what is below 2^-40 of it counts as none. */
#include "deviation.h"

#include <math.h>

typedef struct fit {
    int64_t n, x, y, z; /* number and sums, from the first corner */
    double mx, my, mz;
    double xx, xy, yy, xz, yz;
    double gx, gy;
    double off; /* sum of distances */
} fit;

typedef void fit_pass(fit *f, const int32_t *z, int64_t base, int64_t x, int64_t y, int32_t n);

static void add_sums(fit *f, const int32_t *z, int64_t base, int64_t x, int64_t y, int32_t n) {
    for (int32_t i = 0; i < n; i++) f->z += z[i] - base;
    f->n += n;
    f->x += n * x + (int64_t)n * (n - 1) / 2;
    f->y += n * y;
}

static void add_moments(fit *f, const int32_t *z, int64_t base, int64_t x, int64_t y, int32_t n) {
    const double cy = (double)y - f->my;
    double sx = 0, sz = 0, xx = 0, xz = 0;
    for (int32_t i = 0; i < n; i++) {
        const double cx = (double)(x + i) - f->mx, cz = (double)(z[i] - base) - f->mz;
        sx += cx;
        sz += cz;
        xx += cx * cx;
        xz += cx * cz;
    }
    f->xx += xx;
    f->xz += xz;
    f->xy += cy * sx;
    f->yz += cy * sz;
    f->yy += cy * cy * n;
}

static void add_distances(fit *f, const int32_t *z, int64_t base, int64_t x, int64_t y, int32_t n) {
    const double start = f->mz + f->gy * ((double)y - f->my);
    double off = 0;
    for (int32_t i = 0; i < n; i++)
        off += fabs((double)(z[i] - base) - (start + f->gx * ((double)(x + i) - f->mx)));
    f->off += off;
}

static void pass_over(const deviation_field *s, const sample_triangle *t, fit_pass *pass, fit *f) {
    const rqt_vertex a = t->corner[0], b = t->corner[1], c = t->corner[2];
    const int32_t x0 = a.x < b.x ? (a.x < c.x ? a.x : c.x) : (b.x < c.x ? b.x : c.x),
                  x1 = a.x > b.x ? (a.x > c.x ? a.x : c.x) : (b.x > c.x ? b.x : c.x),
                  y0 = a.y < b.y ? (a.y < c.y ? a.y : c.y) : (b.y < c.y ? b.y : c.y),
                  y1 = a.y > b.y ? (a.y > c.y ? a.y : c.y) : (b.y > c.y ? b.y : c.y);
    for (int32_t y = y0; y <= y1; y++) {
        const row_span row = triangle_row(t, x0, x1, y);
        const int32_t *z = s->q + sample_index(s, 0, y);
        const uint8_t *valid = s->valid ? s->valid + sample_index(s, 0, y) : NULL;
        for (int32_t x = row.x0; x <= row.x1;) {
            int32_t end = row.x1 + 1;
            if (valid) {
                while (x < end && !valid[x]) x++;
                for (end = x; end <= row.x1 && valid[end];) end++;
            }
            if (x < end) pass(f, z + x, t->base, x - a.x, y - a.y, end - x);
            x = end;
        }
    }
}

double fitted_distance(const deviation_field *s, const rqt_triangle *triangle) {
    const plane_triangle p = triangle_of_samples(s, triangle);
    const sample_triangle t = sample_triangle_of(s, &p);
    fit f = {0};
    pass_over(s, &t, add_sums, &f);
    if (f.n == 0) return 0;
    f.mx = (double)f.x / (double)f.n;
    f.my = (double)f.y / (double)f.n;
    f.mz = (double)f.z / (double)f.n;
    pass_over(s, &t, add_moments, &f);
    const double area = f.xx * f.yy - f.xy * f.xy, length = f.xx + f.yy;
    if (area > 0x1p-40 * f.xx * f.yy) {
        f.gx = (f.xz * f.yy - f.yz * f.xy) / area;
        f.gy = (f.yz * f.xx - f.xz * f.xy) / area;
    } else if (length > 0) { /* in a row: every plane through the line that fits them does */
        f.gx = f.xz / length;
        f.gy = f.yz / length;
    }
    pass_over(s, &t, add_distances, &f);
    const double mean = f.off / (double)f.n;
    return mean < 0x1p-40 * (double)s->relief ? 0 : mean;
}
