/* test_core_build.c - blocks built band by band equal those of the pyramid that sees the whole terrain: every
 * summary, every vertex, every size of tile. */
#include "test_core_database.h"

enum { FILE_BYTES = 1 << 20 };

typedef struct built {
    rqt_summary summary;
    rqt_block block;
    int seen;
} built;

typedef struct builder {
    const model *m;
    int k;
    uint8_t *file; /* the scratch file */
    int refuses;   /* from this many writes on */
    int writes;
    built *blocks; /* as the pyramid counts them */
    rqt_pyramid *pyramid;
} builder;

static bool file_write(void *context, uint64_t offset, const void *bytes, size_t size) {
    builder *t = context;
    if (t->refuses && ++t->writes >= t->refuses) return false;
    assert_true(offset + size <= FILE_BYTES);
    memcpy(t->file + offset, bytes, size);
    return true;
}

static bool file_read(void *context, uint64_t offset, void *bytes, size_t size) {
    builder *t = context;
    assert_true(offset + size <= FILE_BYTES);
    memcpy(bytes, t->file + offset, size);
    return true;
}

static built *built_of(builder *t, rqt_block_number number) {
    for (size_t n = 0; n < rqt_pyramid_count(t->pyramid); n++) {
        rqt_block_number other;
        rqt_summary summary;
        rqt_pyramid_block(t->pyramid, n, &other, &summary, NULL);
        if (other == number) return &t->blocks[n];
    }
    fail_msg("block %llu is not one of the terrain", (unsigned long long)number);
    return NULL;
}

static bool keep_block(void *context, rqt_block_number number, const rqt_summary *summary, const rqt_block *block) {
    builder *t = context;
    built *out = built_of(t, number);
    size_t n = ((size_t)(1 << t->k) + 1) * ((size_t)(1 << t->k) + 1);
    assert_int_equal(out->seen, 0);
    out->seen = 1;
    out->summary = *summary;
    assert_int_equal(rqt_block_create(t->k, &test_allocator, &out->block), RQT_OK);
    out->block.k = block->k;
    out->block.width = block->width;
    out->block.height = block->height;
    out->block.sparse = block->sparse;
    out->block.floor = block->floor;
    memcpy(out->block.q, block->q, n * sizeof *block->q);
    memcpy(out->block.error, block->error, n * sizeof *block->error);
    memcpy(out->block.flags, block->flags, n);
    return true;
}

/* The whole way of an import. */
static rqt_status run(builder *t, int b, rqt_sweep **sweep, rqt_build **build, rqt_block *block) {
    const model *m = t->m;
    const rqt_lattice *l = &m->grid.lattice;
    int32_t low = INT32_MAX, high = INT32_MIN;
    for (int i = 0; i < m->r.width * m->r.height; i++) {
        if (m->r.valid && !m->r.valid[i]) continue;
        low = m->r.q[i] < low ? m->r.q[i] : low;
        high = m->r.q[i] > high ? m->r.q[i] : high;
    }
    if (low > high) low = high = 0;
    const rqt_sweep_plan plan = {*l, m->r.unit, m->r.cost, low, high, m->r.valid != NULL, b, 1};
    const rqt_scratch_file file = {file_write, file_read, t};
    rqt_status status = rqt_sweep_create(&plan, &test_allocator, sweep);
    if (status == RQT_OK) status = rqt_build_create(l, t->k, b, &file, &test_allocator, build);
    if (status != RQT_OK) return status;
    const size_t width = (size_t)l->width;
    for (int32_t y = 0; y < l->height; y++)
        if (rqt_sweep_wants(*sweep, y))
            rqt_sweep_first(*sweep, y, m->r.q + (size_t)y * width,
                            m->r.valid ? m->r.valid + (size_t)y * width : NULL);
    int32_t bands = rqt_sweep_bands(*sweep), tiles = rqt_sweep_tiles(*sweep);
    for (int32_t r = 0; r <= bands; r++) {
        if (r < bands) {
            int32_t first, count, *q;
            uint8_t *valid;
            rqt_sweep_begin(*sweep, r, &first, &count, &q, &valid);
            memcpy(q, m->r.q + (size_t)first * width, (size_t)count * width * sizeof *q);
            if (valid) memcpy(valid, m->r.valid + (size_t)first * width, (size_t)count * width);
            for (int32_t i = 0; i < tiles; i++) rqt_sweep_tile(*sweep, 0, i);
            rqt_sweep_end(*sweep);
        }
        if (r == 0) continue;
        const rqt_band band = rqt_sweep_band(*sweep, r - 1);
        for (int32_t i = tiles; i-- > 0;)
            assert_int_equal(rqt_build_tile(*build, &band, i, block, keep_block, t), RQT_OK);
        status = rqt_build_keep(*build, &band);
        if (status != RQT_OK) return status;
    }
    rqt_sweep_finish(*sweep);
    for (int level = rqt_build_coarsest_in_tile(*build) - 1; level >= 0; level--)
        for (int32_t cell = rqt_build_cells(*build, level); cell-- > 0;)
            assert_int_equal(rqt_build_coarse(*build, *sweep, level, cell, block, keep_block, t), RQT_OK);
    return RQT_OK;
}

static bool is_corner(int n, size_t i) {
    const size_t last = (size_t)n - 1, side = (size_t)n;
    return i == 0 || i == last || i == last * side || i == last * side + last;
}

static void compare(builder *t, int b, const rqt_sweep *sweep, const rqt_build *build, rqt_block *whole) {
    int n = (1 << t->k) + 1;
    assert_int_equal(rqt_build_count(build), rqt_pyramid_count(t->pyramid));
    for (size_t at = 0; at < rqt_pyramid_count(t->pyramid); at++) {
        rqt_block_number number;
        rqt_summary right;
        rqt_pyramid_block(t->pyramid, at, &number, &right, whole);
        built *got = &t->blocks[at];
        CHECK(got->seen == 1, "%dx%d k=%d b=%d: block %llu was not built", t->m->r.width, t->m->r.height, t->k, b,
              (unsigned long long)number);
        rqt_build_summary(build, sweep, number, &got->summary);
        uint8_t bytes[2][RQT_SUMMARY_BYTES];
        rqt_summary_encode(&right, bytes[0]);
        rqt_summary_encode(&got->summary, bytes[1]);
        if (memcmp(bytes[0], bytes[1], RQT_SUMMARY_BYTES)) raster_print(&t->m->r);
        CHECK(!memcmp(bytes[0], bytes[1], RQT_SUMMARY_BYTES), "%dx%d k=%d b=%d: the summary of block %llu differs",
              t->m->r.width, t->m->r.height, t->k, b, (unsigned long long)number);
        CHECK(got->block.width == whole->width && got->block.height == whole->height &&
                  got->block.sparse == whole->sparse && got->block.floor == whole->floor,
              "block %llu: another size or floor", (unsigned long long)number);
        for (size_t i = 0; i < (size_t)n * (size_t)n; i++) {
            const int mask = is_corner(n, i) ? RQT_VALID : RQT_VALID | RQT_OUTLINE;
            const bool same = (got->block.flags[i] & mask) == (whole->flags[i] & mask) &&
                              (!(whole->flags[i] & RQT_VALID) || got->block.q[i] == whole->q[i]) &&
                              (is_corner(n, i) || got->block.error[i] == whole->error[i]);
            if (!same) raster_print(&t->m->r);
            CHECK(same, "%dx%d k=%d b=%d block %llu vertex %zu: q %d error %u flags %d, should be %d %u %d",
                  t->m->r.width, t->m->r.height, t->k, b, (unsigned long long)number, i, (int)got->block.q[i],
                  got->block.error[i], got->block.flags[i], (int)whole->q[i], whole->error[i], whole->flags[i]);
        }
    }
}

static rqt_code largest_error(const rqt_errors *errors) {
    rqt_code most = 0;
    for (size_t i = 0; i < (size_t)errors->columns * (size_t)errors->rows; i++)
        if (errors->code[i] != RQT_CODE_INFINITY && errors->code[i] > most) most = errors->code[i];
    return most;
}

static void check_build(const model *m, int k, int b, int refuses) {
    builder t = {.m = m, .k = k, .refuses = refuses};
    rqt_sweep *sweep = NULL;
    rqt_build *build = NULL;
    rqt_block block;
    t.file = malloc(FILE_BYTES);
    assert_non_null(t.file);
    assert_int_equal(rqt_block_create(k, &test_allocator, &block), RQT_OK);
    assert_int_equal(rqt_pyramid_create(&m->grid, &m->saturated, k, &test_allocator, &t.pyramid), RQT_OK);
    t.blocks = calloc(rqt_pyramid_count(t.pyramid), sizeof *t.blocks);
    assert_non_null(t.blocks);
    const rqt_status status = run(&t, b, &sweep, &build, &block);
    if (refuses) {
        assert_int_equal(status, RQT_READ_FAILED);
    } else {
        assert_int_equal(status, RQT_OK);
        compare(&t, b, sweep, build, &block);
        assert_int_equal(rqt_build_max_error(build), largest_error(&m->saturated));
    }
    for (size_t n = 0; n < rqt_pyramid_count(t.pyramid); n++)
        if (t.blocks[n].seen) rqt_block_free(&t.blocks[n].block, &test_allocator);
    rqt_build_free(build);
    rqt_sweep_free(sweep);
    rqt_pyramid_free(t.pyramid);
    rqt_block_free(&block, &test_allocator);
    free(t.blocks);
    free(t.file);
}

static void blocks_of_bands_are_those_of_the_pyramid(void **state) {
    (void)state;
    random_begin("build");
    for (int n = 0; n < 120; n++) {
        model m;
        int most = n % 12 == 0 ? 70 : 24;
        raster r = raster_make((surface)random_between(0, SURFACE_COUNT - 1), random_between(1, most),
                               random_between(1, most), random_between(-1, 3));
        if (n % 3 == 0) raster_add_lake(&r);
        model_create(&m, r);
        const int K = m.grid.lattice.K;
        for (int k = smallest_k(&m.grid.lattice); k <= largest_k(&m.grid.lattice); k++)
            for (int b = k; b <= K; b++) check_build(&m, k, b, 0);
        model_free(&m);
    }
}

static void a_scratch_file_that_refuses_stops_the_build(void **state) {
    (void)state;
    model m;
    random_begin("refused");
    model_create(&m, raster_make((surface)0, 40, 40, 0));
    for (int writes = 1; writes < 6; writes++) check_build(&m, 2, 3, writes);
    model_free(&m);
}

static void a_build_takes_what_it_announced_or_refuses(void **state) {
    (void)state;
    rqt_lattice l;
    rqt_build *build = (rqt_build *)&l; /* anything */
    const rqt_scratch_file file = {0};
    assert_int_equal(rqt_lattice_init(&l, 100, 70), RQT_OK);
    const struct {
        int k, b;
        const rqt_scratch_file *file;
    } refused[] = {{3, 2, &file}, {3, 8, &file}, {-1, 3, &file}, {9, 9, &file}, {0, 3, &file}, {3, 4, NULL}};
    for (size_t i = 0; i < sizeof refused / sizeof *refused; i++) {
        assert_int_equal(rqt_build_create(&l, refused[i].k, refused[i].b, refused[i].file, &test_allocator, &build),
                         RQT_INVALID);
        assert_null(build);
    }
    memset(&test_heap, 0, sizeof test_heap);
    assert_int_equal(rqt_build_create(&l, 3, 4, &file, &test_allocator, &build), RQT_OK);
    CHECK(test_heap.live <= rqt_build_bytes(&l, 3, 4), "%zu bytes, %zu announced", test_heap.live,
          rqt_build_bytes(&l, 3, 4));
    rqt_build_free(build);
    assert_int_equal(test_heap.live, 0);
    const size_t calls = test_heap.calls;
    for (size_t n = 1; n <= calls; n++) {
        memset(&test_heap, 0, sizeof test_heap);
        test_heap.fail_from = test_heap.fail_to = n;
        assert_int_equal(rqt_build_create(&l, 3, 4, &file, &test_allocator, &build), RQT_NO_MEMORY);
        assert_null(build);
        assert_int_equal(test_heap.live, 0);
    }
    memset(&test_heap, 0, sizeof test_heap);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(blocks_of_bands_are_those_of_the_pyramid),
        TEST(a_scratch_file_that_refuses_stops_the_build),
        TEST(a_build_takes_what_it_announced_or_refuses),
    };
    return cmocka_run_group_tests_name("build", tests, NULL, NULL);
}
