/* budget.c - option max_triangles of a view: the best view within a number of triangles.
 *
 * Tolerances are those of a ladder: tau * 2^(i / STEPS), i = 0, 1, 2 ... With more tolerance the squares of the
 * field stay those of tau, none gets less, and none that is not shown is (view_field.c): so what is selected is
 * part of what was, the region is the same, and there are no more triangles. The least step that fits is found by
 * doubling and halving, and is what asking every step would find. */
#include "view.h"

#include <math.h>

#define STEPS 128       /* to the double tolerance */
#define MOST_TAU 0x1p30 /* pixels: no picture is as wide */

/* What selects, with the tolerance of a step; *count: triangles of the answer. */
static int ask(request *r, int64_t step, int64_t *count, char **error) {
    r->view->achieved_tau = r->view->camera.tau * exp2((double)step / STEPS);
    store_query_options options;
    rqt_patch patch = {0};
    int code = request_select_view(r, error);
    if (code != SQLITE_OK) return code;
    options = r->options;
    options.product = RQT_PRODUCT_VERTICES;
    code = store_query(r->store, r->terrain, r->region, r->eps, &options, &patch, NULL, error);
    *count = (int64_t)patch.triangle_count;
    store_keep(r->store, &patch);
    return code;
}

int view_keep_within(request *r, char **error) {
    const double octaves = ceil(log2(MOST_TAU / r->view->camera.tau));
    const int64_t last = octaves > 0 ? (int64_t)octaves * STEPS : 0;
    int64_t count = 0, most = r->max_triangles, low = 0, high = 0;
    int code = ask(r, 0, &count, error);
    if (count <= most) return code;
    /* low does not fit */
    for (int64_t by = STEPS; code == SQLITE_OK && count > most && low < last; by *= 2) {
        high = low + by < last ? low + by : last;
        code = ask(r, high, &count, error);
        if (count > most) low = high;
    }
    if (code == SQLITE_OK && count > most)
        return fail(error, "option \"max_triangles\": even the coarsest mesh of this view has %lld triangles",
                    (long long)count);
    int64_t at = high;
    while (code == SQLITE_OK && high - low > 1) {
        at = low + (high - low) / 2;
        code = ask(r, at, &count, error);
        *(count > most ? &low : &high) = at;
    }
    return code == SQLITE_OK && at != high ? ask(r, high, &count, error) : code;
}
