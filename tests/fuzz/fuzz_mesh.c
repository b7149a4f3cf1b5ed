/* fuzz_mesh.c - a terrain through the whole core: errors, in memory and in bands, metrics, selections, blocks,
 * queries, strips, single leaves. Two ways to one thing give one thing; a patch is a mesh whatever was asked. */
#include "fuzz_terrain.h"

static bool go_on(void *context, double done) {
    (void)context;
    return done >= 0 && done <= 1;
}

static void compute(const fuzz_terrain *t, const rqt_allocator *a, fuzz_heap *h, rqt_errors *raw,
                    rqt_errors *saturated) {
    memset(raw, 0, sizeof *raw);
    memset(saturated, 0, sizeof *saturated);
    if (!went_well(rqt_errors_compute(&t->grid, &t->unit, &t->cost, a, go_on, NULL, raw), h)) return;
    HOLD(h->live <= rqt_errors_bytes(&t->grid.lattice), "%zu bytes", h->live);
    if (!went_well(rqt_errors_compute(&t->grid, &t->unit, &t->cost, a, NULL, NULL, saturated), h)) return;
    rqt_errors_saturate(saturated);
}

/* ------------------------------------------------------------------------------------------------- sweeps */
typedef struct scratch {
    uint8_t *bytes;
    size_t size;
} scratch;

static bool scratch_write(void *context, uint64_t offset, const void *bytes, size_t size) {
    scratch *s = context;
    HOLD(offset + size <= 1 << 24, "offset %llu", (unsigned long long)offset);
    if (offset + size > s->size) {
        s->bytes = realloc(s->bytes, offset + size);
        if (!s->bytes) abort();
        s->size = offset + size;
    }
    memcpy(s->bytes + offset, bytes, size);
    return true;
}

static bool scratch_read(void *context, uint64_t offset, void *bytes, size_t size) {
    const scratch *s = context;
    HOLD(offset + size <= s->size, "reads past what was written");
    memcpy(bytes, s->bytes + offset, size);
    return true;
}

typedef struct built {
    const pyramid *right;
    size_t emitted;
} built;

static bool emit(void *context, rqt_block_number number, const rqt_summary *summary, const rqt_block *block) {
    built *b = context;
    (void)summary;
    const size_t n = (size_t)((1 << block->k) + 1) * (size_t)((1 << block->k) + 1);
    const rqt_block *right = pyramid_read((void *)(uintptr_t)b->right, number);
    HOLD(memcmp(right->q, block->q, n * sizeof *block->q) == 0 && right->sparse == block->sparse &&
             right->floor == block->floor,
         "block %llu of the build", (unsigned long long)number);
    b->emitted++;
    return true;
}

static void sweep(input *in, fuzz_terrain *t, const rqt_errors *saturated, const pyramid *right,
                  const rqt_allocator *a, fuzz_heap *h) {
    const rqt_lattice *l = &t->grid.lattice;
    int32_t low = 0, high = 0;
    bool first_valid = true;
    for (int i = 0; i < l->width * l->height; i++) {
        if (t->grid.valid && !t->valid[i]) continue;
        if (first_valid || t->q[i] < low) low = t->q[i];
        if (first_valid || t->q[i] > high) high = t->q[i];
        first_valid = false;
    }
    const rqt_sweep_plan plan = {.lattice = *l,
                                 .unit = t->unit,
                                 .cost = t->cost,
                                 .min_q = low,
                                 .max_q = high,
                                 .has_voids = t->grid.valid != NULL,
                                 .b = l->K ? take_between(in, t->k, l->K) : 0,
                                 .workers = 1};
    rqt_sweep *s = NULL;
    rqt_build *build = NULL;
    rqt_block block = {0};
    scratch file = {0};
    const rqt_scratch_file doors = {scratch_write, scratch_read, &file};
    built b = {.right = right};
    const size_t before = h->live;
    if (went_well(rqt_sweep_create(&plan, a, &s), h) && went_well(rqt_block_create(t->k, a, &block), h) &&
        went_well(rqt_build_create(l, t->k, plan.b, &doors, a, &build), h)) {
        HOLD(h->live - before <=
                 rqt_sweep_bytes(&plan) + rqt_build_bytes(l, t->k, plan.b) + rqt_block_bytes(t->k) + 256,
             "memory");
        HOLD(rqt_build_count(build) == right->count, "%zu blocks", rqt_build_count(build));
        rqt_status status = RQT_OK;
        for (int32_t y = 0; y < l->height; y++)
            if (rqt_sweep_wants(s, y))
                rqt_sweep_first(s, y, t->q + y * l->width, t->grid.valid ? t->valid + y * l->width : NULL);
        for (int32_t r = 0; r <= rqt_sweep_bands(s) && status == RQT_OK; r++) {
            if (r < rqt_sweep_bands(s)) {
                int32_t first, count, *q;
                uint8_t *valid;
                rqt_sweep_begin(s, r, &first, &count, &q, &valid);
                for (int32_t i = 0; i < count * l->width; i++) {
                    q[i] = t->q[first * l->width + i];
                    if (valid) valid[i] = t->grid.valid ? t->valid[first * l->width + i] : 1;
                }
                for (int32_t i = 0; i < rqt_sweep_tiles(s); i++) rqt_sweep_tile(s, 0, i);
                rqt_sweep_end(s);
            }
            const int32_t done[2] = {r - 1, r};
            for (int n = 0; n < 1 + (r == rqt_sweep_bands(s) - 1) && status == RQT_OK && r < rqt_sweep_bands(s);
                 n++) {
                if (done[n] < 0) continue;
                const rqt_band band = rqt_sweep_band(s, done[n]);
                for (int probe = 0; probe < 8; probe++) {
                    const int32_t y0 = done[n] << plan.b, y1 = y0 + (1 << plan.b);
                    const rqt_vertex v = {take_between(in, 0, 1 << l->K),
                                          take_between(in, y0, y1 < 1 << l->K ? y1 : 1 << l->K)};
                    bool outline, want;
                    rqt_code code[1];
                    uint8_t bit[1];
                    const rqt_code e = rqt_band_error(&band, v, &outline),
                                   wanted = rqt_errors_at(saturated, v, &want);
                    rqt_band_errors(&band, v.x, v.y, 1, 1, code, bit);
                    HOLD(code[0] == e && bit[0] == outline, "two readings of (%d,%d)", v.x, v.y);
                    if (rqt_vertex_scale(l, v) < plan.b)
                        HOLD(e == wanted && outline == want, "(%d,%d): %u in bands, %u in memory", v.x, v.y, e,
                             wanted);
                }
                for (int32_t i = 0; i < rqt_sweep_tiles(s) && status == RQT_OK; i++)
                    status = rqt_build_tile(build, &band, i, &block, emit, &b);
                if (status == RQT_OK) status = rqt_build_keep(build, &band);
            }
        }
        if (status == RQT_OK) {
            rqt_sweep_finish(s);
            int32_t q;
            uint8_t flags;
            const rqt_vertex corner = {0, 0};
            HOLD(rqt_sweep_coarse(s, corner, &q, &flags) == RQT_CODE_INFINITY, "a corner of the root");
            for (int level = rqt_build_coarsest_in_tile(build) - 1; level >= 0 && status == RQT_OK; level--)
                for (int32_t cell = 0; cell < rqt_build_cells(build, level) && status == RQT_OK; cell++)
                    status = rqt_build_coarse(build, s, level, cell, &block, emit, &b);
        }
        if (went_well(status, h)) {
            HOLD(b.emitted == right->count, "%zu of %zu blocks", b.emitted, right->count);
            for (size_t i = 0; i < right->count; i++) {
                rqt_summary summary = {0};
                uint8_t one[RQT_SUMMARY_BYTES], other[RQT_SUMMARY_BYTES];
                rqt_build_summary(build, s, right->number[i], &summary);
                rqt_summary_encode(&right->summary[i], other);
                rqt_summary_encode(&summary, one);
                /* tile by tile the rest came with emit: intervals are what only the end knows */
                HOLD(memcmp(&summary.tol, &right->summary[i].tol, sizeof summary.tol) == 0 &&
                         memcmp(&summary.exact, &right->summary[i].exact, sizeof summary.exact) == 0,
                     "interval of block %llu", (unsigned long long)right->number[i]);
            }
            (void)rqt_build_max_error(build);
        }
    }
    rqt_block_free(&block, a);
    rqt_build_free(build);
    rqt_sweep_free(s);
    free(file.bytes);
}

/* --------------------------------------------------------------------------------------------- selections */
static void select_all(input *in, const fuzz_terrain *t, const rqt_errors *raw, const rqt_allocator *a,
                       fuzz_heap *h) {
    rqt_selection *s[3] = {NULL};
    const rqt_code eps = take_eps(in);
    const rqt_lattice *l = &t->grid.lattice;
    rqt_vertex some[6];
    for (int i = 0; i < 6; i++)
        some[i] = (rqt_vertex){take_between(in, 0, 1 << l->K), take_between(in, 0, 1 << l->K)};
    bool ok = true;
    for (int i = 0; i < 3; i++) ok = ok && went_well(rqt_selection_create(l, a, &s[i]), h);
    ok = ok && went_well(rqt_select_top_down(raw, eps, s[0]), h) &&
         went_well(rqt_select_bottom_up(raw, eps, s[1]), h) &&
         went_well(rqt_selection_add_bottom_up(s[2], some, 6), h);
    if (ok) HOLD(rqt_selection_count(s[0]) == rqt_selection_count(s[1]), "algorithms 1 and 2");
    for (int i = 0; ok && i < 6; i++) HOLD(rqt_selection_has(s[2], some[i]), "a vertex that was added");
    if (ok) ok = went_well(rqt_selection_add_resolved(s[0], some[0]), h);
    if (ok) {
        rqt_vertex parent[2];
        const int n = rqt_vertex_parents(l, some[0], parent);
        for (int i = 0; i < n; i++) HOLD(rqt_selection_has(s[0], parent[i]), "a parent");
    }
    for (int i = 0; i < 3; i++) rqt_selection_free(s[i]);
}

/* ----------------------------------------------------------------------------------------------- queries */
static void check_patch(const rqt_query *query, const rqt_patch *p) {
    for (size_t i = 0; i < p->vertex_count; i++)
        HOLD(p->vertices[i].col >= 0 && p->vertices[i].col < query->lattice.width && p->vertices[i].row >= 0 &&
                 p->vertices[i].row < query->lattice.height,
             "vertex %zu", i);
    for (size_t i = 0; query->product == RQT_PRODUCT_TRIANGLES && i < p->triangle_count; i++) {
        const uint32_t *v = &p->triangles[3 * i];
        HOLD(v[0] < p->vertex_count && v[1] < p->vertex_count && v[2] < p->vertex_count, "triangle %zu", i);
        const rqt_patch_vertex *a = &p->vertices[v[0]], *b = &p->vertices[v[1]], *c = &p->vertices[v[2]];
        const int64_t area =
            (int64_t)(b->col - a->col) * (a->row - c->row) - (int64_t)(a->row - b->row) * (c->col - a->col);
        HOLD(area > 0, "triangle %zu is not counter-clockwise seen from above", i);
        HOLD(rqt_region_meets(query->region, (rqt_vertex){a->col, a->row}, (rqt_vertex){b->col, b->row},
                              (rqt_vertex){c->col, c->row}),
             "triangle %zu does not belong to the region", i);
    }
}

static size_t triangles_of(const uint32_t *strip, size_t n) {
    size_t count = 0;
    for (size_t i = 0; i + 2 < n; i++)
        count += strip[i] != strip[i + 1] && strip[i + 1] != strip[i + 2] && strip[i] != strip[i + 2];
    return count;
}

static void ask(input *in, const fuzz_terrain *t, pyramid *p, const rqt_allocator *a, fuzz_heap *h) {
    rqt_region *region = take_region(in, &t->grid.lattice, a);
    rqt_scratch *memory = NULL;
    if (!region || !went_well(rqt_scratch_create(a, &memory), h)) {
        rqt_region_free(region);
        return;
    }
    const rqt_code eps = take_eps(in);
    const rqt_outline outline = take_between(in, 0, 1) ? RQT_OUTLINE_TOL : RQT_OUTLINE_EXACT;
    size_t count[3] = {0};
    bool ok = true;
    for (int select = 0; select < 3 && ok; select++) {
        rqt_query query = pyramid_query(t, p, region, eps, outline);
        rqt_patch patch = {0};
        query.select = (rqt_select)select;
        query.product = (rqt_product)take_between(in, 0, 2);
        query.wants_leaves = query.product == RQT_PRODUCT_TRIANGLES;
        query.scratch = take_between(in, 0, 1) ? memory : NULL;
        for (size_t i = 0; i < query.answer_count; i++)
            if (rqt_query_needs_block(&query, &query.answers[i]))
                HOLD(rqt_summary_needs_block(&query.answers[i].summary, outline, eps) ||
                         select != RQT_SELECT_THRESHOLD,
                     "needs");
        ok = went_well(rqt_query_run(&query, a, &patch), h);
        if (ok) {
            check_patch(&query, &patch);
            count[select] = patch.triangle_count;
            HOLD(count[select] == count[0], "%zu triangles, %zu by selection %d", count[0], count[select], select);
            if (query.product == RQT_PRODUCT_STRIP)
                HOLD(triangles_of(patch.strip, patch.strip_count) == patch.triangle_count, "strip");
        }
        for (int fans = 0; fans < 2 && ok && query.product == RQT_PRODUCT_TRIANGLES; fans++) {
            uint32_t *strip = NULL;
            size_t n = 0;
            ok = went_well((fans ? rqt_strip_build_fans : rqt_strip_build)(&patch, a, &strip, &n), h);
            if (ok) HOLD(triangles_of(strip, n) == patch.triangle_count, "strip of %zu", n);
            (void)a->resize(a->context, strip, 0);
        }
        if (ok && select == RQT_SELECT_THRESHOLD) {
            const int64_t x = take_between(in, -(1 << 20), FUZZ_SIDE << 20),
                          y = take_between(in, -(1 << 20), FUZZ_SIDE << 20);
            for (size_t i = 0; i < query.answer_count; i++) {
                rqt_block_place at;
                rqt_leaf_corner leaf[3];
                (void)rqt_block_locate(&query.lattice, t->k, query.answers[i].number, &at);
                if (x < (int64_t)at.x << 20 || x > (int64_t)(at.x + at.side) << 20 || y < (int64_t)at.y << 20 ||
                    y > (int64_t)(at.y + at.side) << 20)
                    continue;
                const bool needs = rqt_summary_needs_block(&query.answers[i].summary, outline, eps);
                (void)rqt_query_leaf_at(&query, &query.answers[i],
                                        needs ? pyramid_read(p, query.answers[i].number) : NULL, x, y, leaf);
            }
        }
        if (query.scratch)
            rqt_scratch_keep(memory, &patch, (size_t)take_between(in, 0, 1) << 20);
        else
            rqt_patch_free(&patch);
        free(query.answers);
    }
    rqt_scratch_free(memory);
    rqt_region_free(region);
}

static void metrics(input *in, const fuzz_terrain *t, const rqt_errors *saturated, const rqt_allocator *a,
                    fuzz_heap *h) {
    const rqt_metric metric = (rqt_metric)take_between(in, 0, RQT_METRICS - 1);
    const rqt_outline outline = take_between(in, 0, 1) ? RQT_OUTLINE_TOL : RQT_OUTLINE_EXACT;
    rqt_errors e = {0};
    HOLD(rqt_metric_name(metric) && !rqt_metric_name((rqt_metric)RQT_METRICS), "names");
    const size_t before = h->live;
    if (went_well(rqt_metric_compute(&t->grid, &t->unit, &t->cost, metric, outline, a, go_on, NULL, &e), h)) {
        HOLD(h->live - before <= rqt_metric_bytes(&t->grid.lattice, metric), "%zu bytes", h->live - before);
        for (int n = 0; n < 8; n++) {
            const rqt_vertex v = {take_between(in, 0, 1 << t->grid.lattice.K),
                                  take_between(in, 0, 1 << t->grid.lattice.K)};
            bool x, y;
            const rqt_code code = rqt_errors_at(&e, v, &x), exact = rqt_errors_at(saturated, v, &y);
            if (metric == RQT_METRIC_EXACT) HOLD(code == exact && x == y, "exact");
            if (metric == RQT_METRIC_WEDGIE && !t->grid.valid)
                HOLD(code >= exact, "wedgie bounds: %u, %u", code, exact);
        }
        (void)rqt_metric_is_bound(metric);
    }
    rqt_errors_free(&e, a);
}

const long fuzz_runs = 250;

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    input in = {data, size};
    fuzz_heap heap;
    static fuzz_terrain t;
    const rqt_allocator a = fuzz_allocator(&heap, &in);
    rqt_errors raw, saturated;
    pyramid p = {0};
    take_terrain(&in, &t);
    compute(&t, &a, &heap, &raw, &saturated);
    if (saturated.code) {
        select_all(&in, &t, &raw, &a, &heap);
        if (went_well(pyramid_make(&t, &saturated, &a, &p), &heap)) {
            ask(&in, &t, &p, &a, &heap);
            sweep(&in, &t, &saturated, &p, &a, &heap);
            pyramid_free(&p, &a);
        }
        metrics(&in, &t, &saturated, &a, &heap);
    }
    rqt_errors_free(&raw, &a);
    rqt_errors_free(&saturated, &a);
    HOLD(heap.live == 0, "%zu bytes leaked", heap.live);
    return 0;
}
