/* relief.c - heights as a picture: tint by height, shade by light from the north-west, voids blank.
 *
 * Samples are read in bands, so that a window of any size takes the memory of its pixels only. Where several
 * samples fall on a pixel they are averaged before shading (shading single samples would glitter); where pixels are
 * finer than samples the heights are interpolated by Catmull-Rom splines, which pass through the samples. The slope
 * is taken from the pixels' heights in metres of ground, and exaggerated so that a steep part of this window (its
 * 90th percentile) looks like 35 degrees: flat country and whole continents show their form, too.
 */
#include "internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define BAND_SAMPLES (1 << 20) /* read at once, or one row of cells */
#define STEEP 0.7              /* tangent that the 90th percentile becomes */
#define LEAST_FACTOR 0.6       /* the steepest country may look a little flatter than it is */

const double picture_void_rgb[3] = {0.902, 0.910, 0.918};

/* Dark to light with height, so that it reads in grey and for every kind of colour vision; hues from blue-green
 * over sand to near white differ in yellow and blue, not in red and green. */
void picture_tint(double share, double rgb[3]) {
    static const double stops[][4] = {{0.00, 0.518, 0.694, 0.702}, {0.18, 0.627, 0.769, 0.714},
                                      {0.38, 0.773, 0.843, 0.714}, {0.58, 0.898, 0.878, 0.729},
                                      {0.78, 0.949, 0.902, 0.824}, {1.00, 0.996, 0.988, 0.976}};
    const int n = sizeof stops / sizeof *stops;
    share = share < 0 ? 0 : share > 1 ? 1 : share;
    int i = 1;
    while (i < n - 1 && stops[i][0] < share) i++;
    const double part = (share - stops[i - 1][0]) / (stops[i][0] - stops[i - 1][0]);
    for (int c = 0; c < 3; c++) rgb[c] = stops[i - 1][c + 1] + part * (stops[i][c + 1] - stops[i - 1][c + 1]);
}

/* Heights on a grid of cells of `step` samples a side; NaN is void. */
typedef struct heights {
    float *z;
    int columns, rows, step;
} heights;

/* Averages of a band's cells. A cell is void when most of its samples are. */
static void average_row(const heights *h, const store_terrain *t, const int32_t *q, const uint8_t *valid,
                        int32_t width, int32_t rows, float *out, picture_relief *relief) {
    for (int c = 0; c < h->columns; c++) {
        const int32_t first = c * h->step, last = first + h->step < width ? first + h->step : width;
        double sum = 0;
        int n = 0, all = 0;
        for (int32_t row = 0; row < rows; row++)
            for (int32_t col = first; col < last; col++, all++) {
                const size_t at = (size_t)row * (size_t)width + (size_t)col;
                if (!valid[at]) continue;
                const double z = rqt_unit_metres(&t->unit, q[at]);
                sum += z;
                n++;
                if (!relief->any || z < relief->low) relief->low = z;
                if (!relief->any || z > relief->high) relief->high = z;
                relief->any = true;
            }
        out[c] = n && 2 * n >= all ? (float)(sum / n) : NAN;
    }
}

static int read_heights(store *s, const store_terrain *t, const picture_window *w, heights *h,
                        picture_relief *relief, char **error) {
    const int across = w->cols / w->pixel_width, down = w->rows / w->pixel_height;
    h->step = across < down ? across : down;
    if (h->step < 1) h->step = 1;
    h->columns = (w->cols + h->step - 1) / h->step;
    h->rows = (w->rows + h->step - 1) / h->step;
    h->z = malloc((size_t)h->columns * (size_t)h->rows * sizeof *h->z);
    int cell_rows = BAND_SAMPLES / w->cols / h->step; /* rows of cells in a band */
    if (cell_rows < 1) cell_rows = 1;
    const size_t band = (size_t)cell_rows * (size_t)h->step * (size_t)w->cols;
    int32_t *q = malloc(band * sizeof *q);
    uint8_t *valid = malloc(band);
    int code = h->z && q && valid ? SQLITE_OK : SQLITE_NOMEM;
    for (int first = 0; code == SQLITE_OK && first < h->rows; first += cell_rows) {
        const int32_t row = first * h->step, rest = w->rows - row;
        const int32_t rows = cell_rows * h->step < rest ? cell_rows * h->step : rest;
        code = store_window(s, t, w->col, w->row + row, w->cols, rows, q, valid, error);
        for (int32_t at = 0; code == SQLITE_OK && at < rows; at += h->step) {
            const size_t skip = (size_t)at * (size_t)w->cols;
            average_row(h, t, q + skip, valid + skip, w->cols, rows - at < h->step ? rows - at : h->step,
                        h->z + (size_t)((row + at) / h->step) * (size_t)h->columns, relief);
        }
    }
    free(q);
    free(valid);
    return code;
}

static float cell(const heights *h, int column, int row) {
    column = column < 0 ? 0 : column >= h->columns ? h->columns - 1 : column;
    row = row < 0 ? 0 : row >= h->rows ? h->rows - 1 : row;
    /* Every band has filled its rows. NOLINTNEXTLINE(clang-analyzer-core.uninitialized.UndefReturn) */
    return h->z[(size_t)row * (size_t)h->columns + (size_t)column];
}

static void spline(double f, double weight[4]) {
    weight[0] = f * (-0.5 + f * (1 - 0.5 * f));
    weight[1] = 1 + f * f * (-2.5 + 1.5 * f);
    weight[2] = f * (0.5 + f * (2 - 1.5 * f));
    weight[3] = f * f * (-0.5 + 0.5 * f);
}

/* Height between cells; NaN where the nearest cell is void. Beside voids, from the valid ones of the four around.
 */
static float height_at(const heights *h, double u, double v) {
    const double fu = floor(u), fv = floor(v);
    const int i = (int)fu, j = (int)fv;
    if (isnan(cell(h, (int)floor(u + 0.5), (int)floor(v + 0.5)))) return NAN;
    double a[4], b[4], sum = 0;
    spline(u - fu, a);
    spline(v - fv, b);
    for (int y = 0; y < 4; y++)
        for (int x = 0; x < 4; x++) sum += a[x] * b[y] * cell(h, i - 1 + x, j - 1 + y);
    if (!isnan(sum)) return (float)sum;
    double weights = 0;
    sum = 0;
    for (int y = 0; y < 2; y++)
        for (int x = 0; x < 2; x++) {
            const double z = cell(h, i + x, j + y), weight = (x ? u - fu : 1 - u + fu) * (y ? v - fv : 1 - v + fv);
            if (isnan(z)) continue;
            sum += weight * z;
            weights += weight;
        }
    return weights > 0 ? (float)(sum / weights) : NAN;
}

static float *pixel_heights(const heights *h, const picture_window *w) {
    float *z = malloc((size_t)w->pixel_width * (size_t)w->pixel_height * sizeof *z);
    if (!z) return NULL;
    const double sx = picture_span(w->cols) / w->pixel_width, sy = picture_span(w->rows) / w->pixel_height;
    const double shift = (h->step - 1) / 2.0; /* a cell's middle from its first sample */
    for (int y = 0; y < w->pixel_height; y++)
        for (int x = 0; x < w->pixel_width; x++)
            z[(size_t)y * (size_t)w->pixel_width + (size_t)x] =
                height_at(h, ((x + 0.5) * sx - shift) / h->step, ((y + 0.5) * sy - shift) / h->step);
    return z;
}

/* Rise per metre to the east and to the south, from the neighbours that are not void. */
static void slope_at(const float *z, const picture_window *w, int x, int y, double *east, double *south) {
    const int width = w->pixel_width, height = w->pixel_height;
    const float *at = z + (size_t)y * (size_t)width + (size_t)x;
    const double px = picture_span(w->cols) / width * w->across, py = picture_span(w->rows) / height * w->down;
    const bool has_l = x > 0 && !isnan(at[-1]), has_r = x < width - 1 && !isnan(at[1]);
    const bool has_u = y > 0 && !isnan(at[-width]), has_d = y < height - 1 && !isnan(at[width]);
    const float l = has_l ? at[-1] : *at, r = has_r ? at[1] : *at, u = has_u ? at[-width] : *at;
    const float d = has_d ? at[width] : *at;
    const int nx = has_l + has_r, ny = has_u + has_d;
    *east = nx ? (r - l) / (px * nx) : 0;
    *south = ny ? (d - u) / (py * ny) : 0;
}

static int compare_floats(const void *a, const void *b) {
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* What slopes are multiplied with: from every so-manieth pixel. */
static double exaggeration(const float *z, const picture_window *w) {
    enum { MOST = 20000 };
    const size_t n = (size_t)w->pixel_width * (size_t)w->pixel_height, step = n / MOST + 1;
    float *slopes = malloc((MOST + 1) * sizeof *slopes);
    size_t count = 0;
    if (!slopes) return 1;
    for (size_t i = 0; i < n && count < MOST; i += step) {
        double east, south;
        if (isnan(z[i])) continue; /* all are set. NOLINT(clang-analyzer-core.CallAndMessage) */
        slope_at(z, w, (int)(i % (size_t)w->pixel_width), (int)(i / (size_t)w->pixel_width), &east, &south);
        slopes[count++] = (float)hypot(east, south);
    }
    double factor = 1;
    if (count) {
        qsort(slopes, count, sizeof *slopes, compare_floats);
        const double steep = slopes[count * 9 / 10];
        if (steep > 0) factor = STEEP / steep;
    }
    free(slopes);
    return factor < LEAST_FACTOR ? LEAST_FACTOR : factor;
}

/* Light on a slope, 1 on level ground: most of it from the north-west at 45 degrees, some from west and north, so
 * that ridges along the main light keep their form. */
static double light(double east, double south) {
    static const double lamps[][4] = {/* east, south, up, share */
                                      {-0.5, -0.5, 0.70710678, 0.68},
                                      {-0.76604444, 0, 0.64278761, 0.16},
                                      {0, -0.76604444, 0.64278761, 0.16}};
    const double length = sqrt(1 + east * east + south * south);
    double sum = 0, level = 0;
    for (int i = 0; i < 3; i++) {
        const double lit = (-east * lamps[i][0] - south * lamps[i][1] + lamps[i][2]) / length;
        sum += lamps[i][3] * (lit > 0 ? lit : 0);
        level += lamps[i][3] * lamps[i][2];
    }
    return sum / level;
}

static uint32_t pixel(const double rgb[3], double lit) {
    uint32_t value = 0xFF;
    for (int c = 0; c < 3; c++) {
        /* Shadows keep two fifths of the colour and turn a little blue; lit slopes go towards white. */
        static const double shadow[3] = {0.92, 0.95, 1.06};
        double v = rgb[c];
        if (lit < 1)
            v *= (0.40 + 0.60 * lit) * (shadow[c] + (1 - shadow[c]) * lit);
        else
            v += (1 - v) * fmin(1, (lit - 1) * 0.95);
        value = value << 8 | (uint32_t)(fmin(fmax(v, 0), 1) * 255 + 0.5);
    }
    return value;
}

static void paint(const float *z, const picture_window *w, const picture_relief *relief, uint8_t *bytes,
                  int stride) {
    const double range = relief->high - relief->low, factor = exaggeration(z, w);
    for (int y = 0; y < w->pixel_height; y++)
        for (int x = 0; x < w->pixel_width; x++) {
            const float height = z[(size_t)y * (size_t)w->pixel_width + (size_t)x];
            uint32_t value;
            if (isnan(height)) {
                value = pixel(picture_void_rgb, 1);
            } else {
                double rgb[3], east, south;
                picture_tint(range > 0 ? (height - relief->low) / range : 0.5, rgb);
                slope_at(z, w, x, y, &east, &south);
                value = pixel(rgb, light(east * factor, south * factor));
            }
            memcpy(bytes + (size_t)y * (size_t)stride + (size_t)x * 4, &value, 4);
        }
}

int picture_relief_make(store *s, const store_terrain *t, const picture_window *w, picture_relief *relief,
                        char **error) {
    heights h = {0};
    *relief = (picture_relief){0};
    float *z = NULL;
    int code = read_heights(s, t, w, &h, relief, error);
    if (code == SQLITE_OK) {
        z = pixel_heights(&h, w);
        relief->image = cairo_image_surface_create(CAIRO_FORMAT_RGB24, w->pixel_width, w->pixel_height);
        if (!z || cairo_surface_status(relief->image) != CAIRO_STATUS_SUCCESS) code = SQLITE_NOMEM;
    }
    if (code == SQLITE_OK) {
        paint(z, w, relief, cairo_image_surface_get_data(relief->image),
              cairo_image_surface_get_stride(relief->image));
        cairo_surface_mark_dirty(relief->image);
    }
    free(z);
    free(h.z);
    return code;
}
