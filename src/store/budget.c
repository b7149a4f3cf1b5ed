/* budget.c - the doors of a query: where its errors come from, and how large an eps keeps a budget.
 *
 * The sets {error > eps} are nested, so the patch of a larger eps has fewer vertices, and the smallest eps that
 * keeps within a budget is found by asking. Codes are the only eps there are: first from the largest error
 * downwards, half an eps at a time, until there are too many vertices or eps is what was asked for; then by
 * bisection between the last two. A question that finds too many stops early, so what is walked is a small multiple
 * of the budget. For the minimal errors this is the mesh with the smallest maximum error of all meshes within the
 * budget (METHODS.md). Where a region's rim makes the counts rise again, the budget still holds.
 */
#include "internal.h"

#include <math.h>
#include <string.h>

/* Infinite errors that are no corner's: codes that only say "in every mesh". */
static void show_infinite(rqt_patch *patch) {
    for (size_t i = 0; i < patch->vertex_count; i++)
        if (patch->vertices[i].error == RQT_CODE_LARGEST) patch->vertices[i].error = RQT_CODE_INFINITY;
}

static int answer(store *s, const store_terrain *t, store_question *question, rqt_patch *patch, store_reads *reads,
                  rqt_code *largest, char **error) {
    const rqt_metric metric = question->options->metric;
    if (largest) *largest = t->max_error;
    int code;
    const store_terrain *minimal = NULL;
    if (metric == RQT_METRIC_MINIMAL && (question->options->outline == RQT_OUTLINE_EXACT || t->voids == 0))
        minimal = store_minimal(s, t);
    if (metric == RQT_METRIC_EXACT)
        code = store_query_tables(s, t, question, patch, reads, error);
    else if (minimal)
        code = store_query_tables(s, minimal, question, patch, reads, error);
    else
        code = store_query_computed(s, t, question, patch, reads, largest, error);
    if (code == SQLITE_OK && metric == RQT_METRIC_MINIMAL) show_infinite(patch);
    /* Once more of the whole: the last block may have gone over. */
    if (code == SQLITE_OK && !question->over && !question->too_large) (void)store_is_enough(s, question, patch);
    if (code == SQLITE_OK && question->too_large && !question->over)
        code = store_fail(error, SQLITE_TOOBIG, "the mesh has more than %lld triangles or vertices, the limit here",
                          s->limits.triangles);
    if (code == SQLITE_TOOBIG || question->over) {
        rqt_patch_free(patch);
        if (reads) store_reads_free(reads);
    }
    return code;
}

static int begin(store *s, const store_terrain *t, double eps, const store_query_options *options, rqt_patch *patch,
                 store_reads *reads, char **error) {
    memset(patch, 0, sizeof *patch);
    if (reads) memset(reads, 0, sizeof *reads);
    if (!(eps >= 0)) return store_fail(error, SQLITE_ERROR, "eps must be a number of metres, 0 or more");
    if (options->rule && options->metric == RQT_METRIC_MINIMAL)
        return store_fail(error, SQLITE_ERROR,
                          "the metric minimal has no bound where vertices are added, as a rule does");
    return store_begin_on(s, t, error);
}

/* A rule knows its eps in metres, so that it can be lowered. */
static void set_eps(const store_query_options *options, double eps) {
    if (options->rule) (void)rqt_rule_set_eps(options->rule, eps);
}

int store_query(store *s, const store_terrain *t, const rqt_region *region, double eps,
                const store_query_options *options, rqt_patch *patch, store_reads *reads, char **error) {
    int code = begin(s, t, eps, options, patch, reads, error);
    if (code != SQLITE_OK) return code;
    store_question question = {.region = region, .eps = rqt_code_eps(eps, t->quantum_error), .options = options};
    set_eps(options, eps);
    code = answer(s, t, &question, patch, reads, NULL, error);
    store_end(s);
    return code;
}

/* ------------------------------------------------------------------------------------------------- budgets */

#define OCTAVE 128 /* codes from an eps to its double */

/* The smallest eps in metres for which codes are compared with this one. */
static double metres_of(rqt_code code, double quantum_error) {
    const double value = rqt_code_metres(code);
    double sum = value + quantum_error;
    while (rqt_code_eps(sum, quantum_error) < code) sum = nextafter(sum, INFINITY);
    return sum;
}

typedef struct search {
    store *store;
    const store_terrain *terrain;
    store_question question;
    rqt_patch *patch; /* of the last question that fitted */
    char **error;
    rqt_code low; /* that of the eps that was asked for */
    double eps;
    rqt_code largest;
} search;

static double eps_of(const search *f, rqt_code code) {
    return code > f->low ? metres_of(code, f->terrain->quantum_error) : f->eps;
}

/* Does the mesh of this code fit? The patch is then kept. */
static int try_code(search *f, rqt_code code, bool *fits) {
    rqt_patch patch;
    f->question.eps = code;
    set_eps(f->question.options, eps_of(f, code));
    const int result = answer(f->store, f->terrain, &f->question, &patch, NULL, &f->largest, f->error);
    *fits = result == SQLITE_OK && !f->question.over;
    if (!*fits) return result;
    rqt_patch_free(f->patch);
    *f->patch = patch;
    return SQLITE_OK;
}

/* The smallest code >= f->low that fits, in *found. */
static int find_code(search *f, rqt_code *found) {
    const rqt_code low = f->low;
    bool fits;
    int code = try_code(f, RQT_CODE_LARGEST, &fits);
    if (code != SQLITE_OK) return code;
    if (!fits)
        return store_fail(f->error, SQLITE_ERROR,
                          "max_vertices %llu is too few: the mesh has more vertices at every eps",
                          (sqlite3_uint64)f->question.most);
    const store_terrain *t = f->terrain;
    const double quantum = fabs(rqt_unit_factor(&t->unit)) / (double)t->unit.d;
    const rqt_code smallest = rqt_code_floor(quantum / 4);     /* below it little changes: down to low at once */
    int32_t high = RQT_CODE_LARGEST, under = (int32_t)low - 1; /* high fits; under does not, or is no choice */
    int32_t next = f->largest;
    while (high > (int32_t)low) {
        if (next >= high) next = high - 1;
        if (next < (int32_t)low || next < (int32_t)smallest) next = low;
        code = try_code(f, (rqt_code)next, &fits);
        if (code != SQLITE_OK) return code;
        if (!fits) {
            under = next;
            break;
        }
        high = next;
        next -= OCTAVE;
    }
    while (high - under > 1) {
        const int32_t middle = under + (high - under) / 2;
        code = try_code(f, (rqt_code)middle, &fits);
        if (code != SQLITE_OK) return code;
        if (fits)
            high = middle;
        else
            under = middle;
    }
    *found = (rqt_code)high;
    return SQLITE_OK;
}

int store_query_within(store *s, const store_terrain *t, const rqt_region *region, double eps,
                       const store_query_options *options, int64_t max_vertices, double *achieved, rqt_patch *patch,
                       store_reads *reads, char **error) {
    *achieved = eps;
    int code = begin(s, t, eps, options, patch, reads, error);
    if (code != SQLITE_OK) return code;
    const rqt_code low = rqt_code_eps(eps, t->quantum_error);
    rqt_code found = low;
    search f = {.store = s,
                .terrain = t,
                .question = {.region = region, .options = options, .most = (size_t)max_vertices},
                .patch = patch,
                .error = error,
                .low = low,
                .eps = eps};
    code = max_vertices < 4 ? store_fail(error, SQLITE_ERROR, "max_vertices must be 4 or more")
                            : find_code(&f, &found);
    if (code == SQLITE_OK) *achieved = eps_of(&f, found);
    if (code == SQLITE_OK && reads) {
        /* Once more, to tell what it reads. */
        rqt_patch_free(patch);
        store_question question = {.region = region, .eps = found, .options = options};
        set_eps(options, *achieved);
        code = answer(s, t, &question, patch, reads, NULL, error);
    }
    if (code != SQLITE_OK) rqt_patch_free(patch);
    store_end(s);
    return code;
}
