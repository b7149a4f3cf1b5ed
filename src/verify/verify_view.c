/* verify_view.c - how far a mesh is from the samples in a picture, by projecting both.
 *
 * The triangles are rasterised over the samples as for heights (verify_raster.c). For each sample S the *shift* to
 * its place M on the triangle is made of differences: the deviation in quanta as a fraction of integers where the
 * scene is linear, else the weighted sum of the corners' places less S, with weights that are integers. So a sample
 * that is a corner, or is coplanar in a linear scene, has a shift of exactly 0, and what an eye beside it sees is
 * 0, not a rounding that it is near enough to see. On the picture plane, too, only the shift is projected: with S
 * at (x, y, z) before the eye and the shift (u, v, w), the places f x / z and f (x + u) / (z + w) differ by f (u -
 * x w / z) / (z + w), which is small where the shift is, however far the eye or long the lens.
 */
#include "verify_internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* What a sample of the window may be instead of a distance in pixels. */
#define BARE (-2.0)   /* in no triangle */
#define UNSEEN (-1.0) /* in triangles, but neither S nor M is drawn */

typedef struct picture {
    const verify_samples *samples;
    const verify_scene *scene;
    const verify_camera *camera;
    double *pixels; /* per sample of the window */
    bool is_finite; /* all places so far */
} picture;

/* A triangle over the samples, and its corners in the scene. */
typedef struct facet {
    verify_plane plane;
    double place[3][3];
} facet;

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static bool is_finite_point(const double p[3]) {
    return isfinite(p[0]) && isfinite(p[1]) && isfinite(p[2]);
}

/* A direction of the scene as the camera has it: to the right, upward, ahead. */
static void turn_to_camera(const verify_camera *c, const double direction[3], double seen[3]) {
    seen[0] = dot(direction, c->right);
    seen[1] = dot(direction, c->up);
    seen[2] = dot(direction, c->forward);
}

static bool is_drawn(const verify_camera *c, const double seen[3]) {
    const double depth = seen[2];
    return depth > 0 && depth >= c->near && depth <= c->far && fabs(seen[0]) * c->focal <= c->width / 2 * depth &&
           fabs(seen[1]) * c->focal <= c->height / 2 * depth;
}

/* The distance in the picture of a point and the point at a shift from it; UNSEEN when neither is drawn. */
static double distance_in_picture(const verify_camera *c, const double seen[3], const double shift[3]) {
    const double moved[3] = {seen[0] + shift[0], seen[1] + shift[1], seen[2] + shift[2]};
    if (!is_drawn(c, seen) && !is_drawn(c, moved)) return UNSEEN;
    if (seen[2] <= 0 || moved[2] <= 0) return INFINITY;
    const double right = (shift[0] - seen[0] * (shift[2] / seen[2])) / moved[2],
                 up = (shift[1] - seen[1] * (shift[2] / seen[2])) / moved[2];
    return c->focal * hypot(right, up);
}

/* Plane less sample, in quanta: exact, then rounded once. */
static double deviation_at(const verify_plane *p, const verify_corner *sample) {
    const verify_corner *a = &p->corner[0];
    const int64_t right = (int64_t)sample->col - a->col, down = (int64_t)sample->row - a->row,
                  rise = (int64_t)sample->q - a->q;
    if (p->narrow)
        return (double)(p->slope_x * right + p->slope_y * down - p->twice_area * rise) / (double)p->twice_area;
    const verify_wide numerator =
        (verify_wide)p->slope_x * right + (verify_wide)p->slope_y * down - (verify_wide)p->twice_area * rise;
    return (double)numerator / (double)p->twice_area;
}

/* From the sample, which is at `from` in the scene, to its place on the triangle. */
static void shift_at(const picture *view, const facet *f, const verify_corner *sample, const double from[3],
                     double shift[3]) {
    if (view->scene->rise != 0) {
        shift[0] = shift[1] = 0;
        shift[2] = deviation_at(&f->plane, sample) * view->scene->rise;
        return;
    }
    const verify_corner *c = f->plane.corner;
    const double whole = (double)f->plane.twice_area,
                 weight[3] = {(double)verify_cross(sample, &c[1], &c[2]) / whole,
                              (double)verify_cross(&c[0], sample, &c[2]) / whole,
                              (double)verify_cross(&c[0], &c[1], sample) / whole};
    for (int axis = 0; axis < 3; axis++) {
        shift[axis] = 0;
        for (int k = 0; k < 3; k++) shift[axis] += weight[k] * (f->place[k][axis] - from[axis]);
    }
}

static void see_sample(picture *view, const verify_corner *sample, double place[3], double seen[3]) {
    view->scene->place(view->scene->context, sample, place);
    view->is_finite = view->is_finite && is_finite_point(place);
    const double *eye = view->camera->eye, ray[3] = {place[0] - eye[0], place[1] - eye[1], place[2] - eye[2]};
    turn_to_camera(view->camera, ray, seen);
}

static verify_corner sample_at(const verify_samples *s, int32_t col, int32_t row) {
    return (verify_corner){.col = col, .row = row, .q = s->q[verify_index(s, col, row)]};
}

static void measure_sample(picture *view, const facet *f, int32_t col, int32_t row) {
    const verify_samples *s = view->samples;
    const size_t index = verify_index(s, col, row);
    double pixels = UNSEEN;
    if (s->valid == NULL || s->valid[index]) {
        const verify_corner sample = sample_at(s, col, row);
        double place[3], seen[3], shift[3], turned[3];
        see_sample(view, &sample, place, seen);
        shift_at(view, f, &sample, place, shift);
        view->is_finite = view->is_finite && is_finite_point(shift);
        turn_to_camera(view->camera, shift, turned);
        pixels = distance_in_picture(view->camera, seen, turned);
    }
    if (pixels > view->pixels[index]) view->pixels[index] = pixels;
}

static void measure_triangle(picture *view, const verify_triangle *triangle) {
    const verify_samples *s = view->samples;
    const int64_t south = (int64_t)s->row0 + s->height - 1, east = (int64_t)s->col0 + s->width - 1;
    facet f;
    if (!verify_plane_of(triangle, &f.plane)) return;
    if (f.plane.first_row > south || f.plane.last_row < s->row0) return;
    for (int k = 0; k < 3; k++) {
        view->scene->place(view->scene->context, &f.plane.corner[k], f.place[k]);
        view->is_finite = view->is_finite && is_finite_point(f.place[k]);
    }
    for (int64_t row = f.plane.first_row; row <= f.plane.last_row; row++) {
        if (row < s->row0 || row > south) continue;
        int64_t first, last;
        verify_row_interval(&f.plane, row, &first, &last);
        if (first < s->col0) first = s->col0;
        if (last > east) last = east;
        for (int64_t col = first; col <= last; col++) measure_sample(view, &f, (int32_t)col, (int32_t)row);
    }
}

/* The largest distance from a drawn point within which nothing is further than `pixels` from it in the picture. In
 * units of the focal length let it be t from the middle, and s what is allowed: seen from the eye, that is the
 * angle from atan(t) to atan(t + s), outward, where the picture stretches most; its sine is s / sqrt((1 + t^2) (1 +
 * (t + s)^2)), and a ball seen within that angle of its middle has a radius of the distance times that sine. */
static double metres_of(const verify_camera *c, const double seen[3], double pixels) {
    const double t = hypot(seen[0], seen[1]) / seen[2], s = pixels / c->focal;
    return sqrt(dot(seen, seen)) * s / sqrt((1 + t * t) * (1 + (t + s) * (t + s)));
}

/* Is a sample in no triangle a hole in the picture? */
static bool is_missed(picture *view, int32_t col, int32_t row) {
    if (view->scene->is_promised == NULL) return false;
    const verify_corner sample = sample_at(view->samples, col, row);
    double place[3], seen[3];
    see_sample(view, &sample, place, seen);
    return is_drawn(view->camera, seen) &&
           view->scene->is_promised(view->scene->context, col, row,
                                    metres_of(view->camera, seen, view->scene->slack));
}

static void summarise(picture *view, verify_view_report *report) {
    const verify_samples *s = view->samples;
    size_t index = 0;
    for (int32_t row = s->row0; row < s->row0 + s->height; row++) {
        double squares = 0; /* by rows, so that a large total does not swallow small squares */
        for (int32_t col = s->col0; col < s->col0 + s->width; col++, index++) {
            const double pixels = view->pixels[index];
            if (s->valid != NULL && !s->valid[index]) continue;
            if (pixels == BARE) {
                report->uncovered += is_missed(view, col, row);
                continue;
            }
            report->samples++;
            if (pixels == UNSEEN) continue;
            if (report->drawn == 0 || pixels > report->max_pixels) {
                report->max_pixels = pixels;
                report->worst_col = col;
                report->worst_row = row;
            }
            report->drawn++;
            squares += pixels * pixels;
        }
        report->squares += squares;
    }
    /* A mean is no more than the maximum; rounding alone could make it so when all distances are equal. */
    if (report->drawn > 0)
        report->rms_pixels = fmin(sqrt(report->squares / (double)report->drawn), report->max_pixels);
}

static bool is_about(double a, double b) {
    return fabs(a - b) <= 1e-9;
}

static bool camera_is_sound(const verify_camera *c) {
    if (!is_finite_point(c->eye)) return false;
    if (!is_about(dot(c->forward, c->forward), 1) || !is_about(dot(c->right, c->right), 1) ||
        !is_about(dot(c->up, c->up), 1))
        return false;
    if (!is_about(dot(c->forward, c->right), 0) || !is_about(dot(c->right, c->up), 0) ||
        !is_about(dot(c->up, c->forward), 0))
        return false;
    return c->focal > 0 && isfinite(c->focal) && c->width > 0 && isfinite(c->width) && c->height > 0 &&
           isfinite(c->height) && c->near >= 0 && c->far > c->near;
}

static bool triangles_are_sound(const verify_triangle *triangles, size_t n) {
    if (triangles == NULL && n > 0) return false;
    for (size_t i = 0; i < 3 * n; i++) {
        const verify_corner *c = &triangles[i / 3].corner[i % 3];
        if (c->col <= -VERIFY_CORNER_LIMIT || c->col >= VERIFY_CORNER_LIMIT || c->row <= -VERIFY_CORNER_LIMIT ||
            c->row >= VERIFY_CORNER_LIMIT || c->q <= -VERIFY_HEIGHT_LIMIT || c->q >= VERIFY_HEIGHT_LIMIT)
            return false;
    }
    return true;
}

/* The samples of a window are corners, too. */
static bool window_is_sound(const verify_samples *s) {
    if (s->width < 0 || s->height < 0 || (s->q == NULL && s->width > 0 && s->height > 0)) return false;
    return s->col0 > -VERIFY_CORNER_LIMIT && s->row0 > -VERIFY_CORNER_LIMIT &&
           (int64_t)s->col0 + s->width <= VERIFY_CORNER_LIMIT &&
           (int64_t)s->row0 + s->height <= VERIFY_CORNER_LIMIT;
}

verify_status verify_view(const verify_samples *samples, const verify_scene *scene, const verify_camera *camera,
                          const verify_triangle *triangles, size_t n, verify_view_report *report) {
    if (samples == NULL || scene == NULL || scene->place == NULL || camera == NULL || report == NULL)
        return VERIFY_INVALID;
    if (!window_is_sound(samples) || !isfinite(scene->rise) || !(scene->slack >= 0) || !camera_is_sound(camera) ||
        !triangles_are_sound(triangles, n))
        return VERIFY_INVALID;
    const size_t count = (size_t)samples->width * (size_t)samples->height; /* both below 2^22 */
    picture view = {samples, scene, camera, malloc((count + 1) * sizeof(double)), true};
    if (view.pixels == NULL) return VERIFY_NO_MEMORY;
    for (size_t i = 0; i < count; i++) view.pixels[i] = BARE;
    for (size_t t = 0; t < n; t++) measure_triangle(&view, &triangles[t]);
    verify_view_report sum = *report;
    summarise(&view, &sum);
    free(view.pixels);
    if (!view.is_finite) return VERIFY_INVALID;
    *report = sum;
    return VERIFY_OK;
}
