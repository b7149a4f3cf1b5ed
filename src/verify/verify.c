/* verify.c - the verifier's entry: checks its input, sums the areas, and asks the other files for the rest. */
#include "verify_internal.h"

#include <math.h>
#include <string.h>

static bool corner_is_sound(const verify_samples *samples, const verify_corner *corner) {
    if (corner->col <= -VERIFY_CORNER_LIMIT || corner->col >= VERIFY_CORNER_LIMIT) return false;
    if (corner->row <= -VERIFY_CORNER_LIMIT || corner->row >= VERIFY_CORNER_LIMIT) return false;
    if (corner->q <= -VERIFY_HEIGHT_LIMIT || corner->q >= VERIFY_HEIGHT_LIMIT) return false;
    int64_t col = (int64_t)corner->col - samples->col0;
    int64_t row = (int64_t)corner->row - samples->row0;
    return col >= 0 && col < samples->width && row >= 0 && row < samples->height;
}

bool verify_samples_are_sound(const verify_samples *samples) {
    if (samples->width < 0 || samples->height < 0) return false;
    /* So that every column and row of the window is an int32_t, as is_promised is given them. */
    if ((int64_t)samples->col0 + samples->width > INT32_MAX) return false;
    if ((int64_t)samples->row0 + samples->height > INT32_MAX) return false;
    if (samples->q == NULL && samples->width > 0 && samples->height > 0) return false;
    return isfinite(samples->quantum) && samples->quantum > 0;
}

static bool corners_are_sound(const verify_samples *samples, const verify_triangle *triangles, size_t n) {
    if (triangles == NULL && n > 0) return false;
    for (size_t t = 0; t < n; t++) {
        for (int k = 0; k < 3; k++) {
            if (!corner_is_sound(samples, &triangles[t].corner[k])) return false;
        }
    }
    return true;
}

/* Areas count as positive whichever way a triangle turns: a clockwise one is reported in overlaps, and letting it
 * cancel another here would hide how much ground the mesh claims. */
static uint64_t sum_twice_area(const verify_triangle *triangles, size_t n) {
    verify_uwide sum = 0;
    for (size_t t = 0; t < n; t++) {
        const verify_corner *c = triangles[t].corner;
        int64_t twice = verify_cross(&c[0], &c[1], &c[2]);
        sum += (uint64_t)(twice < 0 ? -twice : twice);
    }
    /* Only a pile of more than 2^19 window-filling triangles gets here; a pinned sum is less of a lie than a
     * wrapped one. */
    return sum > UINT64_MAX ? UINT64_MAX : (uint64_t)sum;
}

static verify_status judge(const verify_samples *samples, const verify_triangle *triangles, size_t n,
                           bool has_samples, verify_report *report) {
    verify_report found = {.triangles = n};
    found.twice_area = sum_twice_area(triangles, n);
    found.area = (double)found.twice_area / 2 * fabs(samples->cell_x * samples->cell_y);
    verify_status status = verify_measure_cracks(samples, triangles, n, &found);
    if (status == VERIFY_OK) status = verify_measure_overlaps(triangles, n, &found);
    if (status == VERIFY_OK && has_samples) status = verify_measure_error(samples, triangles, n, &found);
    /* A report is whole or all zeros, so that nobody reads half of one as a clean mesh's. */
    if (status == VERIFY_OK) *report = found;
    return status;
}

verify_status verify_mesh(const verify_samples *samples, const verify_triangle *triangles, size_t n,
                          verify_report *report) {
    if (samples == NULL || report == NULL) return VERIFY_INVALID;
    memset(report, 0, sizeof *report);
    if (!verify_samples_are_sound(samples) || !corners_are_sound(samples, triangles, n)) return VERIFY_INVALID;
    return judge(samples, triangles, n, true, report);
}

verify_status verify_topology(const verify_triangle *triangles, size_t n, verify_report *report) {
    /* A window that holds all places there can be, and no samples. */
    const int32_t from = -VERIFY_CORNER_LIMIT, side = 2 * VERIFY_CORNER_LIMIT;
    const verify_samples everywhere = {.col0 = from, .row0 = from, .width = side, .height = side};
    if (report == NULL) return VERIFY_INVALID;
    memset(report, 0, sizeof *report);
    if (!corners_are_sound(&everywhere, triangles, n)) return VERIFY_INVALID;
    return judge(&everywhere, triangles, n, false, report);
}
