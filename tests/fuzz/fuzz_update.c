/* fuzz_update.c - new samples for a rectangle of a terrain: its blocks become those of the changed raster, and
 * each is read before it is written, and written once. Hostile rectangles, heights, and blocks that are not the
 * terrain's. */
#include "fuzz_terrain.h"

typedef struct table {
    const fuzz_terrain *terrain;
    pyramid now;
    const rqt_allocator *a;
    bool *written;
    size_t reads, fails; /* the read that fails, or is a stranger's; 0: none */
    bool strange, writes_fail;
    size_t writes;
} table;

static size_t place_of(const table *t, rqt_block_number number) {
    size_t i = 0;
    while (i < t->now.count && t->now.number[i] != number) i++;
    HOLD(i < t->now.count, "block %llu, which there is not", (unsigned long long)number);
    return i;
}

static const rqt_block *read_block(void *context, rqt_block_number number) {
    table *t = context;
    const size_t i = place_of(t, number);
    HOLD(!t->written[i], "block %llu is read after it was written", (unsigned long long)number);
    if (++t->reads != t->fails) return &t->now.block[i];
    return t->strange ? &t->now.block[(i + 1) % t->now.count] : NULL;
}

static bool read_summary(void *context, rqt_block_number number, rqt_summary *summary) {
    table *t = context;
    const size_t i = place_of(t, number);
    HOLD(!t->written[i], "summary %llu is read after it was written", (unsigned long long)number);
    const bool hit = ++t->reads == t->fails;
    *summary = t->now.summary[hit ? (i + 1) % t->now.count : i];
    return !hit || t->strange;
}

static size_t vertices_of(const rqt_block *b) {
    return ((size_t)1 << b->k) * ((size_t)1 << b->k) + 2 * ((size_t)1 << b->k) + 1;
}

static bool write_block(void *context, rqt_block_number number, const rqt_summary *before, const rqt_summary *after,
                        const rqt_block *block) {
    table *t = context;
    const size_t i = place_of(t, number);
    (void)before;
    HOLD(!t->written[i], "block %llu is written twice", (unsigned long long)number);
    if (t->writes_fail) return false;
    t->written[i] = true;
    t->writes++;
    t->now.summary[i] = *after;
    rqt_block *mine = &t->now.block[i];
    rqt_block_set_corners(mine, after); /* which are no part of its bytes */
    if (!block) return true;
    HOLD(block->k == mine->k && block->width == mine->width && block->height == mine->height, "another shape");
    const size_t n = vertices_of(mine);
    memcpy(mine->q, block->q, n * sizeof *mine->q);
    memcpy(mine->error, block->error, n * sizeof *mine->error);
    memcpy(mine->flags, block->flags, n);
    mine->sparse = block->sparse;
    mine->floor = block->floor;
    rqt_block_set_corners(mine, after);
    return true;
}

static rqt_statistics statistics_of(const fuzz_terrain *t, const pyramid *p) {
    rqt_statistics s = {0};
    const int n = t->grid.lattice.width * t->grid.lattice.height;
    bool any = false;
    for (int i = 0; i < n; i++) {
        if (t->grid.valid && !t->valid[i]) {
            s.voids++;
            continue;
        }
        if (!any || t->q[i] < s.min_q) s.min_q = t->q[i];
        if (!any || t->q[i] > s.max_q) s.max_q = t->q[i];
        any = true;
    }
    for (size_t i = 0; i < p->count; i++) {
        if (p->number[i] == 1 && p->summary[i].tol.em > s.max_error) s.max_error = p->summary[i].tol.em;
        for (size_t v = 0; v < vertices_of(&p->block[i]); v++)
            if (p->block[i].error[v] != RQT_CODE_INFINITY && p->block[i].error[v] > s.max_error)
                s.max_error = p->block[i].error[v];
    }
    return s;
}

/* The blocks of a terrain's raster as it is; false: no memory. */
static bool build(const fuzz_terrain *t, const rqt_allocator *a, fuzz_heap *h, pyramid *p) {
    rqt_errors e = {0};
    *p = (pyramid){0};
    bool ok = went_well(rqt_errors_compute(&t->grid, &t->unit, &t->cost, a, NULL, NULL, &e), h);
    if (ok) {
        rqt_errors_saturate(&e);
        ok = went_well(pyramid_make(t, &e, a, p), h);
    }
    for (size_t i = 0; i < p->count && p->block[i].sparse; i++) {
        rqt_block *b = &p->block[i];
        const size_t side = ((size_t)1 << b->k) + 1;
        for (size_t v = 0; v < vertices_of(b); v++) { /* as decoded: what is not kept is not there */
            const bool corner = (v / side == 0 || v / side == side - 1) && (v % side == 0 || v % side == side - 1);
            if (corner || b->error[v] > b->floor || b->flags[v] & RQT_OUTLINE) continue;
            b->q[v] = 0;
            b->error[v] = 0;
            b->flags[v] = RQT_VALID;
        }
    }
    rqt_errors_free(&e, a);
    return ok;
}

static void compare(const table *t, const pyramid *right) {
    for (size_t i = 0; i < right->count; i++) {
        uint8_t one[RQT_SUMMARY_BYTES], other[RQT_SUMMARY_BYTES];
        rqt_summary_encode(&t->now.summary[i], one);
        rqt_summary_encode(&right->summary[i], other);
        HOLD(memcmp(one, other, sizeof one) == 0, "summary %llu", (unsigned long long)right->number[i]);
        const rqt_block *b = &t->now.block[i], *w = &right->block[i];
        HOLD(b->sparse == w->sparse && b->floor == w->floor, "block %llu: floor %u, built %u",
             (unsigned long long)right->number[i], b->floor, w->floor);
        for (size_t v = 0; v < vertices_of(w); v++) {
            if (w->sparse && w->error[v] <= w->floor && !(w->flags[v] & RQT_OUTLINE)) continue; /* is not kept */
            HOLD(b->error[v] == w->error[v] && b->flags[v] == w->flags[v] &&
                     (b->q[v] == w->q[v] || !(w->flags[v] & RQT_VALID)),
                 "block %llu, vertex %zu", (unsigned long long)right->number[i], v);
        }
    }
}

const long fuzz_runs = 400;

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    input in = {data, size};
    fuzz_heap heap;
    static fuzz_terrain t;
    static int32_t q[FUZZ_SIDE * FUZZ_SIDE];
    static uint8_t valid[FUZZ_SIDE * FUZZ_SIDE];
    const rqt_allocator a = fuzz_allocator(&heap, &in);
    take_terrain(&in, &t);
    const rqt_lattice *l = &t.grid.lattice;
    table kept = {.terrain = &t, .a = &a, .strange = take_between(&in, 0, 1) != 0};
    if (!build(&t, &a, &heap, &kept.now)) {
        pyramid_free(&kept.now, &a);
        HOLD(heap.live == 0, "%zu bytes leaked", heap.live);
        return 0;
    }
    kept.written = calloc(kept.now.count, sizeof *kept.written);
    if (!kept.written) abort();
    /* Now and then one too far. */
    const int slack = take_between(&in, 0, 15) == 0;
    const int x = take_between(&in, -slack, l->width - 1), y = take_between(&in, -slack, l->height - 1);
    const int width = take_between(&in, 1 - slack, l->width - x + slack),
              height = take_between(&in, 1 - slack, l->height - y + slack);
    const bool inside =
        x >= 0 && y >= 0 && width >= 1 && height >= 1 && x + width <= l->width && y + height <= l->height;
    const bool makes_voids = take_between(&in, 0, 3) == 0;
    const int relief = take_between(&in, 0, 2);
    bool high = false;
    for (int i = 0; i < width * height && i < FUZZ_SIDE * FUZZ_SIDE; i++) {
        const int at = inside ? (y + i / width) * l->width + x + i % width : 0;
        q[i] = take_between(&in, 0, 1) == 0 ? t.q[at] : take_between(&in, -500, 500);
        if (relief == 1 && take_between(&in, 0, 7) == 0)
            q[i] = (RQT_HEIGHT_LIMIT - 1) * (take_between(&in, 0, 1) ? 1 : -1);
        if (relief == 2 && take_between(&in, 0, 31) == 0) q[i] = RQT_HEIGHT_LIMIT;
        valid[i] = !makes_voids || take_between(&in, 0, 3) != 0;
        high |= q[i] >= RQT_HEIGHT_LIMIT && valid[i];
    }
    kept.fails = take_between(&in, 0, 7) == 0 ? (size_t)take_between(&in, 1, 60) : 0;
    kept.writes_fail = take_between(&in, 0, 31) == 0;
    const rqt_update update = {.lattice = *l,
                               .k = t.k,
                               .unit = t.unit,
                               .cost = t.cost,
                               .before = statistics_of(&t, &kept.now),
                               .x = x,
                               .y = y,
                               .width = width,
                               .height = height,
                               .q = q,
                               .valid = makes_voids ? valid : NULL,
                               .read_block = read_block,
                               .read_summary = read_summary,
                               .write = write_block,
                               .is_interrupted = take_between(&in, 0, 1) ? never : NULL,
                               .context = &kept};
    rqt_update_result result = {0};
    const rqt_status status = rqt_update_run(&update, &a, &result);
    const bool hit = kept.fails && kept.reads >= kept.fails;
    HOLD(inside || status == RQT_INVALID || status == RQT_NO_MEMORY, "%d x %d at (%d,%d): status %d", width, height,
         x, y, (int)status);
    HOLD((status != RQT_INVALID && status != RQT_INTERRUPTED) || kept.writes == 0,
         "%zu blocks are written in spite of status %d", kept.writes, (int)status);
    HOLD(status != RQT_INVALID || !inside || high, "a sound update is refused");
    HOLD(status != RQT_READ_FAILED || (hit && !kept.strange) || kept.writes_fail, "nothing failed");
    HOLD(status != RQT_CORRUPT || (hit && kept.strange), "nothing is damaged");
    HOLD(status != RQT_NO_MEMORY || heap.refuse, "no memory for nothing");
    if (status == RQT_OK && !hit) {
        int64_t changed = 0;
        HOLD(!high, "a height past the limit");
        if (makes_voids && !t.grid.valid) memset(t.valid, 1, sizeof t.valid), t.grid.valid = t.valid;
        for (int i = 0; i < width * height; i++) {
            const int at = (y + i / width) * l->width + x + i % width;
            const bool was = !t.grid.valid || t.valid[at], is = !makes_voids || valid[i];
            changed += was != is || (is && t.q[at] != q[i]);
            t.q[at] = is ? q[i] : t.q[at];
            t.valid[at] = is;
        }
        HOLD(changed == result.changed, "%lld changed, says %lld", (long long)changed, (long long)result.changed);
        HOLD(changed || kept.writes == 0, "nothing changes, and blocks are written");
        pyramid right;
        if (build(&t, &a, &heap, &right)) {
            compare(&kept, &right);
            const rqt_statistics after = statistics_of(&t, &right), *said = &result.after;
            HOLD(after.voids == said->voids && after.min_q == said->min_q && after.max_q == said->max_q &&
                     after.max_error == said->max_error,
                 "%lld voids, %d .. %d, error %u; says %lld, %d .. %d, %u", (long long)after.voids, after.min_q,
                 after.max_q, after.max_error, (long long)said->voids, said->min_q, said->max_q, said->max_error);
        }
        pyramid_free(&right, &a);
    }
    free(kept.written);
    pyramid_free(&kept.now, &a);
    HOLD(heap.live == 0, "%zu bytes leaked", heap.live);
    return 0;
}
