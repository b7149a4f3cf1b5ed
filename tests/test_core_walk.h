/* test_core_walk.h - a raster, all of it: every legal block size, eps on and beside stored errors, windows of every
 * kind, each way of selecting, against the oracle's walk over the whole terrain. */
#ifndef TEST_CORE_WALK_H
#define TEST_CORE_WALK_H

#include "test_core_database.h"

enum { MOST_SIZES = RQT_MAX_BLOCK_K + 1 };

static inline int random_eps(const model *m) {
    switch (random_between(0, 5)) {
    case 0:
        return 0;
    case 1:
        return RQT_CODE_LARGEST;
    default: {
        unsigned code = oracle_at(&m->o, random_between(0, m->o.side - 1), random_between(0, m->o.side - 1))->code;
        int eps = (int)code + random_between(-1, 1);
        return eps < 0 ? 0 : eps > RQT_CODE_LARGEST ? RQT_CODE_LARGEST : eps;
    }
    }
}

/* ----------------------------------------------------------------------------------------- queries -- */

/* What the oracle wants: the triangles, and of each of their samples the largest error and the smallest level. */
typedef struct wanted {
    key *keys;
    size_t count;
    int64_t *code;
    int *level;
} wanted;

static inline void wanted_free(wanted *w) {
    free(w->keys);
    free(w->code);
    free(w->level);
}

static inline wanted wanted_of(const model *m, const oracle_list *leaves, const window *in) {
    size_t samples = (size_t)(m->r.width * m->r.height);
    wanted w = {calloc(leaves->count + 1, sizeof *w.keys), 0, calloc(samples, sizeof *w.code),
                calloc(samples, sizeof *w.level)};
    if (!w.keys || !w.code || !w.level) abort();
    for (size_t n = 0; n < samples; n++) w.code[n] = -1;
    for (size_t n = 0; n < leaves->count; n++) {
        const oracle_triangle *t = &leaves->triangle[n];
        int64_t sample[3];
        if (!window_meets(in, &m->o, t)) continue;
        for (int c = 0; c < 3; c++) {
            const oracle_point at = oracle_clamp(&m->o, t->corner[c]);
            const oracle_node *node = oracle_at(&m->o, t->corner[c].x, t->corner[c].y);
            sample[c] = (int64_t)at.y * m->r.width + at.x;
            int seen = w.code[sample[c]] >= 0;
            if (!seen || node->level < w.level[sample[c]]) w.level[sample[c]] = node->level;
            if (node->code > w.code[sample[c]]) w.code[sample[c]] = node->code;
        }
        w.keys[w.count++] = key_unwound(sample[0], sample[1], sample[2]);
    }
    if (w.count) qsort(w.keys, w.count, sizeof *w.keys, ordered_keys);
    return w;
}

static inline void check_patch(const model *m, const rqt_patch *p, const wanted *w, const char *what) {
    int width = m->r.width;
    key *keys = keys_of_patch(p, width);
    size_t n = 0;
    while (n < p->triangle_count && n < w->count && ordered_keys(&keys[n], &w->keys[n]) == 0) n++;
    if (n < p->triangle_count || n < w->count) {
        raster_print(&m->r);
        print_error("%zu triangles, should be %zu\n", p->triangle_count, w->count);
        for (int which = 0; which < 2; which++) {
            const key *k = which ? w->keys : keys;
            size_t count = which ? w->count : p->triangle_count;
            if (n < count)
                print_error("first difference: %s (%d,%d) (%d,%d) (%d,%d)\n", which ? "wanted" : "got",
                            (int)(k[n].v[0] % width), (int)(k[n].v[0] / width), (int)(k[n].v[1] % width),
                            (int)(k[n].v[1] / width), (int)(k[n].v[2] % width), (int)(k[n].v[2] / width));
        }
        fail_msg("%s", what);
    }
    free(keys);
    unsigned char *seen = calloc((size_t)(width * m->r.height), 1), *used = calloc(p->vertex_count + 1, 1);
    if (!seen || !used) abort();
    for (size_t t = 0; t < p->triangle_count; t++) {
        const rqt_patch_vertex *v[3];
        for (size_t c = 0; c < 3; c++) {
            v[c] = &p->vertices[p->triangles[3 * t + c]];
            used[p->triangles[3 * t + c]] = 1;
        }
        int64_t area = (int64_t)(v[1]->col - v[0]->col) * (v[2]->row - v[0]->row) -
                       (int64_t)(v[2]->col - v[0]->col) * (v[1]->row - v[0]->row);
        CHECK(area < 0, "%s: triangle %zu is not counter-clockwise", what, t);
    }
    for (size_t v = 0; v < p->vertex_count; v++) {
        const rqt_patch_vertex *at = &p->vertices[v];
        CHECK(at->col >= 0 && at->row >= 0 && at->col < width && at->row < m->r.height, "%s: no such sample", what);
        int sample = at->row * width + at->col;
        CHECK(!seen[sample], "%s: sample (%d,%d) is a vertex twice", what, at->col, at->row);
        seen[sample] = 1;
        CHECK(used[v], "%s: vertex %zu is in no triangle", what, v);
        CHECK(at->q == m->r.q[sample], "%s: height of (%d,%d)", what, at->col, at->row);
        CHECK(at->error == w->code[sample] && at->level == w->level[sample],
              "%s: (%d,%d) has error %u level %u, should be %d %d", what, at->col, at->row, at->error, at->level,
              (int)w->code[sample], w->level[sample]);
    }
    free(seen);
    free(used);
}

/* Every block size and every way of selecting, at one eps, in one window. */
static inline void check_window(const model *m, database *d, int sizes, const window *w, const oracle_list *leaves,
                                rqt_code eps, rqt_outline outline) {
    wanted want = wanted_of(m, leaves, w);
    rqt_region *region = region_of(w, &m->grid.lattice);
    for (int n = 0; n < sizes; n++) {
        for (int select = 0; select < 3; select++) {
            rqt_patch patch;
            char what[1200];
            (void)snprintf(what, sizeof what, "k=%d eps code %u %s select %d, window %s: %s", d[n].k, eps,
                           outline == RQT_OUTLINE_EXACT ? "exact" : "tol", select, w->kind, w->text);
            rqt_status status =
                database_query(&d[n], region, eps, (rqt_select)select, outline, &test_allocator, &patch);
            CHECK(status == RQT_OK, "%s: status %d", what, (int)status);
            check_patch(m, &patch, &want, what);
            rqt_patch_free(&patch);
        }
    }
    rqt_region_free(region);
    wanted_free(&want);
}

static inline void check_queries(raster r, int eps_count, int window_count) {
    model m;
    database d[MOST_SIZES];
    int sizes = 0;
    model_create(&m, r);
    for (int k = smallest_k(&m.grid.lattice); k <= largest_k(&m.grid.lattice); k++, sizes++)
        assert_int_equal(database_create(&d[sizes], &m, k, &test_allocator), RQT_OK);
    unsigned char *set = oracle_set_create(&m.o);
    for (int e = 0; e < eps_count; e++) {
        rqt_code eps = e == 0 ? 0 : e == 1 ? RQT_CODE_LARGEST : (rqt_code)random_eps(&m);
        for (int exact = 0; exact < 2; exact++) {
            oracle_list leaves = {0};
            oracle_select(&m.o, eps, exact, set);
            oracle_leaves(&m.o, set, &leaves);
            for (int n = 0; n <= window_count; n++) {
                window w = n == 0 ? window_all()
                                  : random_window(m.r.width, m.r.height, random_between(0, WINDOW_KINDS - 1));
                check_window(&m, d, sizes, &w, &leaves, eps, exact ? RQT_OUTLINE_EXACT : RQT_OUTLINE_TOL);
            }
            oracle_list_free(&leaves);
        }
    }
    free(set);
    for (int n = 0; n < sizes; n++) database_free(&d[n], &test_allocator);
    model_free(&m);
}

#endif
