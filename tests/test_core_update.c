/* test_core_update.c - an update of a part is a build of the whole: every block and every summary, byte for byte.
 *
 * The oracle is the plain way: errors of the changed raster in memory, saturated, cut into blocks by rqt_pyramid.
 * The update sees encoded blocks and summaries alone, as a database has them. */
#include "test_core_support.h"

/* ------------------------------------------------------------------------------------------- a table of blocks --
 */
typedef struct row {
    rqt_block_number number;
    uint8_t summary[RQT_SUMMARY_BYTES];
    uint8_t *bytes;
    size_t size;
    int written; /* by the last update */
} row;

typedef struct table {
    rqt_lattice lattice;
    int k;
    rqt_unit unit;
    rqt_void_cost cost;
    rqt_statistics statistics;
    row *rows;
    size_t count;
    rqt_codec *codec;
    rqt_block block;
    size_t reads, summaries, blocks_written, summaries_written;
    size_t fail_read;               /* the read that fails, from 1; 0: none */
    size_t block_reads, alien_read; /* the read of a block that gives one of another width, from 1; 0: none */
    uint8_t *buffer;
} table;

static double quantum_of(const rqt_unit *unit) {
    const double f = rqt_unit_factor(unit);
    return (f < 0 ? -f : f) / unit->d;
}

static int64_t count_voids(const raster *r) {
    int64_t voids = 0;
    for (int n = 0; n < r->width * r->height; n++) voids += r->valid && !r->valid[n];
    return voids;
}

static void take_statistics(table *t, const raster *r, const rqt_pyramid *pyramid) {
    rqt_statistics *s = &t->statistics;
    *s = (rqt_statistics){.voids = count_voids(r)};
    bool any = false;
    for (int n = 0; n < r->width * r->height; n++) {
        if (r->valid && !r->valid[n]) continue;
        if (!any || r->q[n] < s->min_q) s->min_q = r->q[n];
        if (!any || r->q[n] > s->max_q) s->max_q = r->q[n];
        any = true;
    }
    const size_t side = ((size_t)1 << t->k) + 1;
    for (size_t n = 0; n < rqt_pyramid_count(pyramid); n++) {
        rqt_block_number number;
        rqt_summary summary;
        rqt_pyramid_block(pyramid, n, &number, &summary, &t->block);
        if (number == 1 && summary.tol.em > s->max_error) s->max_error = summary.tol.em;
        for (size_t i = 0; i < side * side; i++)
            if (t->block.error[i] != RQT_CODE_INFINITY && t->block.error[i] > s->max_error)
                s->max_error = t->block.error[i];
    }
}

static table table_build(const raster *r, int k) {
    table t = {.k = k, .unit = r->unit, .cost = r->cost};
    rqt_grid grid = {.q = r->q, .valid = r->valid};
    rqt_errors errors;
    rqt_pyramid *pyramid;
    assert_int_equal(rqt_lattice_init(&grid.lattice, r->width, r->height), RQT_OK);
    t.lattice = grid.lattice;
    if (t.k > t.lattice.K) t.k = t.lattice.K;
    assert_int_equal(rqt_errors_compute(&grid, &r->unit, &r->cost, &test_allocator, NULL, NULL, &errors), RQT_OK);
    rqt_errors_saturate(&errors);
    assert_int_equal(rqt_pyramid_create(&grid, &errors, t.k, &test_allocator, &pyramid), RQT_OK);
    assert_int_equal(rqt_codec_create(&test_allocator, &t.codec), RQT_OK);
    assert_int_equal(rqt_block_create(t.k, &test_allocator, &t.block), RQT_OK);
    t.buffer = malloc(rqt_block_bound(t.k));
    t.count = rqt_pyramid_count(pyramid);
    t.rows = calloc(t.count, sizeof *t.rows);
    assert_true(t.rows && t.buffer);
    for (size_t n = 0; n < t.count; n++) {
        rqt_summary summary;
        rqt_pyramid_block(pyramid, n, &t.rows[n].number, &summary, &t.block);
        rqt_summary_encode(&summary, t.rows[n].summary);
        assert_int_equal(rqt_block_encode(t.codec, &t.block, quantum_of(&t.unit), t.buffer, &t.rows[n].size),
                         RQT_OK);
        t.rows[n].bytes = malloc(t.rows[n].size);
        assert_non_null(t.rows[n].bytes);
        memcpy(t.rows[n].bytes, t.buffer, t.rows[n].size);
    }
    take_statistics(&t, r, pyramid);
    rqt_pyramid_free(pyramid);
    rqt_errors_free(&errors, &test_allocator);
    return t;
}

static void table_free(table *t) {
    for (size_t n = 0; n < t->count; n++) free(t->rows[n].bytes);
    free(t->rows);
    free(t->buffer);
    rqt_codec_free(t->codec);
    rqt_block_free(&t->block, &test_allocator);
}

static row *row_of(table *t, rqt_block_number number) {
    size_t low = 0, high = t->count;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (t->rows[middle].number < number)
            low = middle + 1;
        else
            high = middle;
    }
    CHECK(low < t->count && t->rows[low].number == number, "there is no block %llu", (unsigned long long)number);
    return &t->rows[low];
}

static bool fails(table *t) {
    t->reads++;
    return t->fail_read && t->reads == t->fail_read;
}

static const rqt_block *read_block(void *context, rqt_block_number number) {
    table *t = context;
    const row *r = row_of(t, number);
    rqt_summary summary;
    if (fails(t)) return NULL;
    CHECK(!r->written, "block %llu is read after it was written", (unsigned long long)number);
    rqt_block_header header;
    assert_int_equal(rqt_block_info(r->bytes, r->size, &header, NULL), RQT_OK);
    assert_int_equal(rqt_block_decode(t->codec, r->bytes, r->size, &t->block), RQT_OK);
    assert_int_equal(rqt_summary_decode(r->summary, RQT_SUMMARY_BYTES, &summary), RQT_OK);
    rqt_block_set_corners(&t->block, &summary);
    if (++t->block_reads == t->alien_read) t->block.width--;
    return &t->block;
}

static bool read_summary(void *context, rqt_block_number number, rqt_summary *summary) {
    table *t = context;
    const row *r = row_of(t, number);
    if (fails(t)) return false;
    CHECK(!r->written, "the summary of block %llu is read after it was written", (unsigned long long)number);
    t->summaries++;
    return rqt_summary_decode(r->summary, RQT_SUMMARY_BYTES, summary) == RQT_OK;
}

static bool write_block(void *context, rqt_block_number number, const rqt_summary *before, const rqt_summary *after,
                        const rqt_block *block) {
    table *t = context;
    row *r = row_of(t, number);
    uint8_t summary[RQT_SUMMARY_BYTES];
    CHECK(!r->written, "block %llu is written twice", (unsigned long long)number);
    r->written = 1;
    rqt_summary_encode(before, summary);
    assert_memory_equal(summary, r->summary, RQT_SUMMARY_BYTES);
    rqt_summary_encode(after, summary);
    CHECK(block || memcmp(summary, r->summary, sizeof summary), "block %llu is written, and was so",
          (unsigned long long)number);
    t->summaries_written += memcmp(summary, r->summary, sizeof summary) != 0;
    memcpy(r->summary, summary, sizeof summary);
    if (!block) return true;
    size_t size;
    assert_int_equal(rqt_block_encode(t->codec, block, quantum_of(&t->unit), t->buffer, &size), RQT_OK);
    CHECK(size != r->size || memcmp(t->buffer, r->bytes, size), "the bytes of block %llu are written, and were so",
          (unsigned long long)number);
    t->blocks_written++;
    free(r->bytes);
    r->bytes = malloc(size);
    assert_non_null(r->bytes);
    memcpy(r->bytes, t->buffer, size);
    r->size = size;
    return true;
}

typedef struct patch {
    int x, y, width, height;
    int32_t *q;
    uint8_t *valid;
} patch;

static rqt_status table_update(table *t, const patch *p, rqt_update_result *result) {
    const rqt_update update = {.lattice = t->lattice,
                               .k = t->k,
                               .unit = t->unit,
                               .cost = t->cost,
                               .before = t->statistics,
                               .x = p->x,
                               .y = p->y,
                               .width = p->width,
                               .height = p->height,
                               .q = p->q,
                               .valid = p->valid,
                               .read_block = read_block,
                               .read_summary = read_summary,
                               .write = write_block,
                               .context = t};
    for (size_t n = 0; n < t->count; n++) t->rows[n].written = 0;
    t->blocks_written = t->summaries_written = t->summaries = t->reads = t->block_reads = 0;
    const rqt_status status = rqt_update_run(&update, &test_allocator, result);
    if (status == RQT_OK) t->statistics = result->after;
    return status;
}

/* Where two blocks differ. */
static void tell_difference(const table *t, const row *a, const row *b) {
    rqt_block x, y;
    assert_int_equal(rqt_block_create(t->k, &test_allocator, &x), RQT_OK);
    assert_int_equal(rqt_block_create(t->k, &test_allocator, &y), RQT_OK);
    assert_int_equal(rqt_block_decode(t->codec, a->bytes, a->size, &x), RQT_OK);
    assert_int_equal(rqt_block_decode(t->codec, b->bytes, b->size, &y), RQT_OK);
    const int n = (1 << t->k) + 1;
    print_error("floor %d, built %d; width %d, height %d\n", x.floor, y.floor, x.width, x.height);
    for (int i = 0; i < n * n; i++)
        if (x.q[i] != y.q[i] || x.error[i] != y.error[i] || x.flags[i] != y.flags[i])
            print_error("(%d,%d): q %d, error %d, flags %d, built %d, %d, %d\n", i % n, i / n, x.q[i], x.error[i],
                        x.flags[i], y.q[i], y.error[i], y.flags[i]);
    rqt_block_free(&x, &test_allocator);
    rqt_block_free(&y, &test_allocator);
}

/* Rows and statistics are those of a build of the raster. */
static void check_equals_build(const table *t, const raster *r, const char *what, const patch *p) {
    table fresh = table_build(r, t->k);
    for (size_t n = 0; n < t->count; n++) {
        const row *a = &t->rows[n], *b = &fresh.rows[n];
        const bool same_summary = !memcmp(a->summary, b->summary, RQT_SUMMARY_BYTES);
        if (a->number == b->number && same_summary && a->size == b->size && !memcmp(a->bytes, b->bytes, a->size))
            continue;
        rqt_block_place place;
        (void)rqt_block_locate(&t->lattice, t->k, a->number, &place);
        raster_print(r);
        for (int i = 0; i < RQT_SUMMARY_BYTES && !same_summary; i++)
            if (a->summary[i] != b->summary[i])
                print_error("byte %d of the summary: %d, built %d\n", i, a->summary[i], b->summary[i]);
        if (same_summary) tell_difference(t, a, b);
        fail_msg(
            "%s, %s %d x %d, k = %d: after new samples at (%d,%d) %d x %d block %llu (level %d, (%d,%d)) has %s",
            what, r->name, r->width, r->height, t->k, p->x, p->y, p->width, p->height,
            (unsigned long long)a->number, place.level, place.i, place.j,
            same_summary ? "other bytes than a build gives" : "another summary than a build gives");
    }
    const rqt_statistics *a = &t->statistics, *b = &fresh.statistics;
    CHECK(a->voids == b->voids && a->min_q == b->min_q && a->max_q == b->max_q && a->max_error == b->max_error,
          "%s, %s %d x %d: voids %lld, heights %d to %d, largest error %d; a build says %lld, %d to %d, %d", what,
          r->name, r->width, r->height, (long long)a->voids, a->min_q, a->max_q, a->max_error, (long long)b->voids,
          b->min_q, b->max_q, b->max_error);
    table_free(&fresh);
}

/* Puts the patch into the raster and takes what was there. */
static void exchange(raster *r, patch *p) {
    for (int y = 0; y < p->height; y++)
        for (int x = 0; x < p->width; x++) {
            const int at = (p->y + y) * r->width + p->x + x, n = y * p->width + x;
            const int32_t q = r->q[at];
            r->q[at] = p->q[n];
            p->q[n] = q;
            if (!r->valid) continue;
            const uint8_t valid = r->valid[at];
            r->valid[at] = p->valid[n];
            p->valid[n] = valid;
        }
}

static patch patch_make(const raster *r, int x, int y, int width, int height) {
    patch p = {x, y, width, height, malloc((size_t)(width * height) * sizeof(int32_t)), NULL};
    if (r->valid) p.valid = malloc((size_t)(width * height));
    assert_true(p.q && (p.valid || !r->valid));
    for (int n = 0; n < width * height; n++) {
        const int at = (y + n / width) * r->width + x + n % width;
        p.q[n] = r->q[at];
        if (r->valid) p.valid[n] = r->valid[at];
    }
    return p;
}

static void patch_free(patch *p) {
    free(p->q);
    free(p->valid);
}

/* New samples of some kind: a few, all, raised, from another surface, voids. */
static patch random_patch(const raster *r) {
    int x0, y0, width, height;
    const int shape = random_between(0, 5);
    if (shape == 0) {
        x0 = y0 = 0, width = r->width, height = r->height;
    } else if (shape == 1) {
        x0 = random_between(0, r->width - 1), y0 = random_between(0, r->height - 1), width = height = 1;
    } else {
        x0 = random_between(0, r->width - 1), y0 = random_between(0, r->height - 1);
        width = random_between(1, r->width - x0), height = random_between(1, r->height - y0);
        if (shape == 2) { /* touches the corner of the raster that the edges meet in */
            x0 = r->width - width, y0 = r->height - height;
        } else if (shape == 3) {
            width = width < 4 ? width : 4, height = height < 4 ? height : 4;
        }
    }
    patch p = patch_make(r, x0, y0, width, height);
    const int kind = random_between(0, 4),
              parameter[4] = {random_between(-99, 99), random_between(-99, 99), 500, 3};
    const surface s = (surface)random_between(0, SURFACE_COUNT - 1);
    for (int n = 0; n < width * height; n++) {
        const bool here = kind != 0 || random_between(0, width * height - 1) == 0 || n == 0;
        if (!here) continue;
        if (s == SURFACE_EXTREMES)
            p.q[n] = random_between(-3000, 3000);
        else
            p.q[n] = kind == 1 ? (p.q[n] + 17) % RQT_HEIGHT_LIMIT
                               : surface_height(s, x0 + n % width, y0 + n / width, r->width, r->height, parameter);
        if (p.valid && kind != 1) p.valid[n] = kind == 2 ? 0 : kind == 3 ? 1 : random_between(0, 3) != 0;
    }
    return p;
}

static raster random_raster(int most) {
    const surface s = (surface)random_between(0, SURFACE_COUNT - 1);
    const int voids[] = {-1, -1, 0, 3, 30, 100};
    raster r = raster_make(s, random_between(1, most), random_between(1, most), voids[random_between(0, 5)]);
    if (random_between(0, 5) == 0) raster_add_lake(&r);
    return r;
}

/* -------------------------------------------------------------------------------------------------------- tests --
 */

static void F23_an_update_equals_a_build_in_every_block_and_summary(void **state) {
    (void)state;
    random_begin(__func__);
    for (int round = 0; round < 250; round++) {
        raster r = random_raster(round % 10 ? 40 : 70);
        table t = table_build(&r, random_between(1, 5));
        for (int again = 0; again < 2; again++) {
            patch p = random_patch(&r);
            rqt_update_result result;
            assert_int_equal(table_update(&t, &p, &result), RQT_OK);
            exchange(&r, &p);
            check_equals_build(&t, &r, "random", &p);
            patch_free(&p);
        }
        table_free(&t);
        raster_free(&r);
    }
}

/* Every extent has edges of its own, at which lattice and raster part. */
static void F40_an_update_equals_a_build_for_every_small_extent(void **state) {
    (void)state;
    random_begin(__func__);
    for (int height = 1; height <= 19; height++)
        for (int width = 1; width <= 19; width += 1 + (height > 10)) {
            raster r = raster_make((surface)random_between(0, SURFACE_COUNT - 1), width, height,
                                   random_between(0, 1) ? -1 : 10);
            table t = table_build(&r, random_between(1, 3));
            patch p = random_patch(&r);
            rqt_update_result result;
            assert_int_equal(table_update(&t, &p, &result), RQT_OK);
            exchange(&r, &p);
            check_equals_build(&t, &r, "extent", &p);
            patch_free(&p);
            table_free(&t);
            raster_free(&r);
        }
}

/* Where coarse blocks reach over the edge and voids touch it: vertices past the raster are kept for others' sake.
 */
static void voids_at_the_raster_s_edge_are_built_alike(void **state) {
    (void)state;
    random_begin(__func__);
    for (int round = 0; round < 400; round++) {
        raster r = raster_make(round % 2 ? SURFACE_HILLS : SURFACE_CLIFF, random_between(17, 40),
                               random_between(17, 40), 0);
        raster_add_lake(&r);
        table t = table_build(&r, random_between(1, 4));
        patch p = random_patch(&r);
        rqt_update_result result;
        assert_int_equal(table_update(&t, &p, &result), RQT_OK);
        exchange(&r, &p);
        check_equals_build(&t, &r, "edge", &p);
        patch_free(&p);
        table_free(&t);
        raster_free(&r);
    }
}

/* A peak in the corner: in coarse blocks a vertex past the raster is kept that none of the quarters keeps, nor
 * another one that stands for the same sample. Both edges, with the sample in the rectangle and out of it. */
static void a_vertex_past_the_raster_has_the_sample_it_stands_for(void **state) {
    (void)state;
    const int extent[3][2] = {{17, 24}, {24, 17}, {25, 14}};
    for (int n = 0; n < 3; n++)
        for (int whole = 0; whole < 2; whole++) {
            const int width = extent[n][0], height = extent[n][1];
            raster r = raster_from_memory(width, height, NULL, NULL, &UNIT_METRE, "slope");
            for (int at = 0; at < width * height; at++) r.q[at] = 100 + at % width;
            table t = table_build(&r, 3);
            patch p = whole ? patch_make(&r, 0, 0, width, height) : patch_make(&r, width - 1, height - 1, 1, 1);
            for (int at = 0; at < p.width * p.height; at++) p.q[at]++;
            p.q[p.width * p.height - 1] += 50;
            rqt_update_result result;
            assert_int_equal(table_update(&t, &p, &result), RQT_OK);
            exchange(&r, &p);
            check_equals_build(&t, &r, whole ? "all" : "corner", &p);
            patch_free(&p);
            table_free(&t);
            raster_free(&r);
        }
}

static void check_same_rows(const table *a, const table *b, const char *what) {
    assert_int_equal(a->count, b->count);
    for (size_t n = 0; n < a->count; n++)
        CHECK(!memcmp(a->rows[n].summary, b->rows[n].summary, RQT_SUMMARY_BYTES) &&
                  a->rows[n].size == b->rows[n].size &&
                  !memcmp(a->rows[n].bytes, b->rows[n].bytes, a->rows[n].size),
              "%s: block %llu differs", what, (unsigned long long)a->rows[n].number);
    assert_memory_equal(&a->statistics, &b->statistics, sizeof a->statistics);
}

static void F22_an_update_back_restores_every_byte(void **state) {
    (void)state;
    random_begin(__func__);
    for (int round = 0; round < 120; round++) {
        raster r = random_raster(60);
        table t = table_build(&r, random_between(1, 5)), before = table_build(&r, t.k);
        patch p = random_patch(&r);
        rqt_update_result result;
        assert_int_equal(table_update(&t, &p, &result), RQT_OK);
        exchange(&r, &p);
        assert_int_equal(table_update(&t, &p, &result), RQT_OK);
        check_same_rows(&t, &before, "there and back");
        /* Once more changes nothing, and writes nothing. */
        assert_int_equal(table_update(&t, &p, &result), RQT_OK);
        assert_int_equal(result.changed, 0);
        assert_int_equal(t.blocks_written + t.summaries_written, 0);
        patch_free(&p);
        table_free(&t);
        table_free(&before);
        raster_free(&r);
    }
}

static void F44_the_order_of_two_updates_apart_does_not_matter(void **state) {
    (void)state;
    random_begin(__func__);
    for (int round = 0; round < 60; round++) {
        raster r = random_raster(60);
        if (r.width < 2) {
            raster_free(&r);
            continue;
        }
        const int at = random_between(1, r.width - 1);
        table one = table_build(&r, random_between(1, 5)), other = table_build(&r, one.k);
        patch west = patch_make(&r, 0, 0, at, r.height), east = patch_make(&r, at, 0, r.width - at, r.height);
        for (int n = 0; n < west.width * west.height; n++) west.q[n] = random_between(-50, 50);
        for (int n = 0; n < east.width * east.height; n++) east.q[n] = random_between(-500, 50);
        rqt_update_result result;
        assert_int_equal(table_update(&one, &west, &result), RQT_OK);
        assert_int_equal(table_update(&one, &east, &result), RQT_OK);
        assert_int_equal(table_update(&other, &east, &result), RQT_OK);
        assert_int_equal(table_update(&other, &west, &result), RQT_OK);
        check_same_rows(&one, &other, "order");
        patch_free(&west);
        patch_free(&east);
        table_free(&one);
        table_free(&other);
        raster_free(&r);
    }
}

/* A hill in the corner, of some thousand blocks: what is far away is not read. */
static void an_update_reads_what_is_near_and_little_else(void **state) {
    (void)state;
    random_begin(__func__);
    const int side = 513;
    raster r = raster_from_memory(side, side, NULL, NULL, &UNIT_METRE, "hills");
    for (int y = 0; y < side; y++)
        for (int x = 0; x < side; x++)
            r.q[y * side + x] = (int32_t)(takagi(x, y, 512) + takagi(x + 37, y + 11, 128) + random_between(0, 3));
    table t = table_build(&r, 4);
    patch p = patch_make(&r, 70, 90, 20, 20);
    for (int n = 0; n < 400; n++) p.q[n] += 25;
    rqt_update_result result;
    assert_int_equal(table_update(&t, &p, &result), RQT_OK);
    const size_t reads = t.reads;
    CHECK(result.cells < (int64_t)t.count && t.blocks_written < t.count / 10 && reads < 2 * t.count,
          "%lld summaries looked at, %zu rows read, %zu blocks written, of %zu", (long long)result.cells, reads,
          t.blocks_written, t.count);
    CHECK(result.measured < side * side, "%lld samples measured", (long long)result.measured);
    exchange(&r, &p);
    check_equals_build(&t, &r, "hills", &p);
    patch_free(&p);
    table_free(&t);
    raster_free(&r);
}

/* On a plateau all that a triangle deviates is the same everywhere: bounds that are met must end the search. */
static void a_plateau_is_not_searched_through(void **state) {
    (void)state;
    const int side = 513;
    raster r = raster_from_memory(side, side, NULL, NULL, &UNIT_METRE, "plateau");
    for (int y = 0; y < side; y++)
        for (int x = 0; x < side; x++) r.q[y * side + x] = x % 64 == 0 && y % 64 == 0 ? 10 : 0;
    table t = table_build(&r, 3);
    patch p = patch_make(&r, 3, 3, 1, 1);
    p.q[0] = 1;
    rqt_update_result result;
    assert_int_equal(table_update(&t, &p, &result), RQT_OK);
    CHECK(result.cells < (int64_t)t.count, "%lld summaries of %zu looked at", (long long)result.cells, t.count);
    exchange(&r, &p);
    check_equals_build(&t, &r, "plateau", &p);
    patch_free(&p);
    table_free(&t);
    raster_free(&r);
}

static void check_failures(const raster *r, const patch *p) {
    rqt_update_result result;
    size_t failed = 0;
    for (size_t first = 1;; first++) {
        table fresh = table_build(r, 2);
        test_heap.calls = test_heap.failures = 0;
        /* One alone: what comes after it must not have to tell. */
        test_heap.fail_from = test_heap.fail_to = first;
        /* The codec is the table's: only rqt_update_run asks the heap. */
        const rqt_status status = table_update(&fresh, p, &result);
        test_heap.fail_from = 0;
        const bool refused = test_heap.failures > 0;
        assert_int_equal(status, refused ? RQT_NO_MEMORY : RQT_OK);
        table_free(&fresh);
        failed += refused;
        if (!refused) break;
    }
    CHECK(failed > 20, "only %zu requests for memory", failed);
    for (size_t read = 1;; read += 1 + read / 8) {
        table fresh = table_build(r, 2);
        fresh.fail_read = read;
        const rqt_status status = table_update(&fresh, p, &result);
        const bool refused = fresh.reads >= read;
        assert_int_equal(status, refused ? RQT_READ_FAILED : RQT_OK);
        table_free(&fresh);
        if (!refused) break;
    }
}

static void F48_every_allocation_and_every_read_may_fail(void **state) {
    (void)state;
    random_begin(__func__);
    raster r = raster_make(SURFACE_HILLS, 37, 41, 5);
    patch p = random_patch(&r);
    check_failures(&r, &p);
    patch_free(&p);
    raster_free(&r);
}

/* A bowl errs more the larger a triangle is, so every cell of one promises more than what is known: the heap of the
 * search is asked for. */
static void F48_a_search_without_memory_is_reported(void **state) {
    (void)state;
    raster r = raster_from_memory(37, 41, NULL, NULL, &UNIT_METRE, "bowl");
    for (int n = 0; n < 37 * 41; n++) r.q[n] = n % 37 * (n % 37) + n / 37 * (n / 37);
    patch p = patch_make(&r, 18, 20, 1, 1);
    p.q[0]++;
    table t = table_build(&r, 2);
    rqt_update_result result;
    assert_int_equal(table_update(&t, &p, &result), RQT_OK);
    CHECK(result.cells > 20, "only %lld cells were looked at", (long long)result.cells);
    table_free(&t);
    check_failures(&r, &p);
    patch_free(&p);
    raster_free(&r);
}

/* The last block that is read is the root's, which is made anew: it comes with the width of another place. */
static void a_block_of_another_place_is_damage(void **state) {
    (void)state;
    raster r = raster_from_memory(37, 41, NULL, NULL, &UNIT_METRE, "bowl");
    for (int n = 0; n < 37 * 41; n++) r.q[n] = n % 37 * (n % 37) + n / 37 * (n / 37);
    patch p = patch_make(&r, 0, 0, 37, 41);
    for (int n = 0; n < 37 * 41; n++) p.q[n] *= 3;
    table t = table_build(&r, 2), alien = table_build(&r, 2);
    rqt_update_result result;
    assert_int_equal(table_update(&t, &p, &result), RQT_OK);
    CHECK(row_of(&t, 1)->written, "the root is written");
    alien.alien_read = t.block_reads;
    assert_int_equal(table_update(&alien, &p, &result), RQT_CORRUPT);
    assert_int_equal(alien.blocks_written + alien.summaries_written, 0);
    table_free(&t);
    table_free(&alien);
    patch_free(&p);
    raster_free(&r);
}

static bool always(void *context) {
    (void)context;
    return true;
}

static void what_cannot_be_is_refused(void **state) {
    (void)state;
    random_begin(__func__);
    raster r = raster_make(SURFACE_HILLS, 20, 20, -1);
    table t = table_build(&r, 2);
    int32_t q[400] = {0};
    rqt_update update = {.lattice = t.lattice,
                         .k = t.k,
                         .unit = t.unit,
                         .cost = t.cost,
                         .before = t.statistics,
                         .x = 0,
                         .y = 0,
                         .width = 20,
                         .height = 20,
                         .q = q,
                         .read_block = read_block,
                         .read_summary = read_summary,
                         .write = write_block,
                         .context = &t};
    rqt_update_result result;
    rqt_update wrong = update;
    wrong.x = 1;
    assert_int_equal(rqt_update_run(&wrong, &test_allocator, &result), RQT_INVALID);
    wrong = update, wrong.height = 21;
    assert_int_equal(rqt_update_run(&wrong, &test_allocator, &result), RQT_INVALID);
    wrong = update, wrong.y = -1;
    assert_int_equal(rqt_update_run(&wrong, &test_allocator, &result), RQT_INVALID);
    wrong = update, wrong.width = 0;
    assert_int_equal(rqt_update_run(&wrong, &test_allocator, &result), RQT_INVALID);
    wrong = update, wrong.k = 0;
    assert_int_equal(rqt_update_run(&wrong, &test_allocator, &result), RQT_INVALID);
    wrong = update, wrong.unit.d = 0;
    assert_int_equal(rqt_update_run(&wrong, &test_allocator, &result), RQT_INVALID);
    q[7] = RQT_HEIGHT_LIMIT;
    assert_int_equal(rqt_update_run(&update, &test_allocator, &result), RQT_INVALID);
    q[7] = 1 - RQT_HEIGHT_LIMIT;
    wrong = update, wrong.is_interrupted = always;
    assert_int_equal(rqt_update_run(&wrong, &test_allocator, &result), RQT_INTERRUPTED);
    assert_int_equal(t.blocks_written + t.summaries_written, 0);
    assert_int_equal(rqt_update_run(&update, &test_allocator, &result), RQT_OK);
    table_free(&t);
    raster_free(&r);
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(F23_an_update_equals_a_build_in_every_block_and_summary),
        TEST(F40_an_update_equals_a_build_for_every_small_extent),
        TEST(voids_at_the_raster_s_edge_are_built_alike),
        TEST(a_vertex_past_the_raster_has_the_sample_it_stands_for),
        TEST(F22_an_update_back_restores_every_byte),
        TEST(F44_the_order_of_two_updates_apart_does_not_matter),
        TEST(an_update_reads_what_is_near_and_little_else),
        TEST(a_plateau_is_not_searched_through),
        TEST(F48_every_allocation_and_every_read_may_fail),
        TEST(F48_a_search_without_memory_is_reported),
        TEST(a_block_of_another_place_is_damage),
        TEST(what_cannot_be_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
