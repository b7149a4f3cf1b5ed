/* test_wire_normals.c - normals beside a mesh in wire format: they come back, the mesh is as without them, and no
 * bytes at all do harm. */
#include "test_wire_support.h"

static float *random_normals(size_t count) {
    float *n = calloc(3 * count + 1, sizeof *n);
    if (!n) abort();
    for (size_t i = 0; i < count; i++) {
        const double x = random_unit() * 8 - 4, y = random_unit() * 8 - 4, length = sqrt(x * x + y * y + 1);
        n[3 * i] = (float)(x / length), n[3 * i + 1] = (float)(y / length), n[3 * i + 2] = (float)(1 / length);
    }
    return n;
}

static blob encode_with(const answer *a, const float *normals) {
    const size_t count = a->patch.vertex_count;
    blob mesh = encode(a, NULL);
    uint8_t *bytes = realloc(mesh.bytes, mesh.size + rqt_wire_normals_bound(count));
    if (!bytes) abort();
    size_t size = mesh.size;
    assert_int_equal(rqt_wire_add_normals(normals, count, &test_allocator, bytes, &size), RQT_OK);
    CHECK(size <= mesh.size + rqt_wire_normals_bound(count), "bound");
    blob b = blob_of(bytes, size);
    assert_int_equal(rqt_wire_add_normals(normals, count, &test_allocator, bytes, &size), RQT_INVALID);
    free(bytes);
    return b;
}

static void check_corrupt(const blob *b, size_t more, int flags) {
    blob copy = {calloc(b->size + more, 1), b->size + more};
    rqt_wire_header header;
    rqt_message why;
    if (!copy.bytes) abort();
    memcpy(copy.bytes, b->bytes, b->size);
    copy.bytes[7] = (uint8_t)flags;
    seal(&copy);
    CHECK(rqt_wire_info(copy.bytes, copy.size, &header, &why) == RQT_CORRUPT && why.text[0],
          "%zu bytes more, flags %d", more, flags);
    free(copy.bytes);
}

/* Normals that the header does not tell of, and the other way round; unknown flags; bytes behind the last. */
static void check_flags(const blob *with, const blob *without) {
    check_corrupt(with, 0, 0);
    check_corrupt(without, 0, 1);
    for (int bit = 1; bit < 8; bit++) {
        check_corrupt(with, 0, 1 | 1 << bit);
        check_corrupt(without, 0, 1 << bit);
    }
    check_corrupt(with, 1, 1);
    check_corrupt(without, 1, 0);
    check_corrupt(with, 20, 1);
}

static void check_normals(const answer *a) {
    const size_t count = a->patch.vertex_count;
    float *normals = random_normals(count), *read = random_normals(count + 1);
    blob with = encode_with(a, normals), without = encode(a, NULL);
    rqt_wire_header header;
    rqt_patch patch;
    rqt_message why;
    assert_int_equal(rqt_wire_decode(with.bytes, with.size, true, &test_allocator, &header, &patch, &why), RQT_OK);
    assert_true(header.has_normals);
    check_same_patch(&patch, &a->patch, "a mesh with normals");
    rqt_patch_free(&patch);
    assert_int_equal(rqt_wire_normals(with.bytes, with.size, count, &test_allocator, read, &why), RQT_OK);
    for (size_t i = 0; i < count; i++) {
        const float *n = normals + 3 * i, *m = read + 3 * i;
        const double dot = (double)n[0] * m[0] + (double)n[1] * m[1] + (double)n[2] * m[2];
        CHECK(dot > cos(0.56 * M_PI / 180), "normal %zu is (%g %g %g), was (%g %g %g)", i, m[0], m[1], m[2], n[0],
              n[1], n[2]);
    }
    static const size_t others[] = {1, (size_t)-1};
    for (int i = 0; i < 2; i++) {
        assert_int_equal(rqt_wire_normals(with.bytes, with.size, count + others[i], &test_allocator, read, &why),
                         RQT_INVALID);
        assert_true(why.text[0]);
    }
    assert_int_equal(rqt_wire_normals(without.bytes, without.size, count, &test_allocator, read, &why),
                     RQT_INVALID);
    CHECK(strstr(why.text, "without normals"), "%s", why.text);
    assert_int_equal(rqt_wire_info(without.bytes, without.size, &header, &why), RQT_OK);
    assert_false(header.has_normals);
    check_flags(&with, &without);
    free(with.bytes);
    free(without.bytes);
    free(normals);
    free(read);
}

static void normals_come_back_beside_an_unchanged_mesh(void **state) {
    (void)state;
    random_begin("normals");
    const float up[3] = {0, 0, 1};
    float unpacked[3];
    int8_t packed[2];
    rqt_normal_pack(up, packed);
    rqt_normal_unpack(packed, unpacked);
    assert_memory_equal(up, unpacked, sizeof up);
    for (int u = -127; u <= 127; u++)
        for (int v = -127; v <= 127; v++) { /* what is packed already stays as it is */
            const int8_t first[2] = {(int8_t)u, (int8_t)v};
            rqt_normal_unpack(first, unpacked);
            rqt_normal_pack(unpacked, packed);
            CHECK(packed[0] == u && packed[1] == v, "(%d,%d) becomes (%d,%d)", u, v, packed[0], packed[1]);
            CHECK(unpacked[2] >= 0, "(%d,%d) points down", u, v);
        }
    for (int n = 0; n < 20; n++) {
        model m;
        database d;
        model_create(&m, random_raster(n));
        assert_int_equal(database_create(&d, &m, smallest_k(&m.grid.lattice), &test_allocator), RQT_OK);
        window w = window_all();
        rqt_region *region = region_of(&w, &m.grid.lattice);
        answer coarse = ask(&d, &m, region, (rqt_code)random_eps(&m), RQT_OUTLINE_EXACT),
               fine = ask(&d, &m, region, 0, RQT_OUTLINE_EXACT);
        check_normals(&coarse);
        check_normals(&fine);
        blob delta = encode(&fine, &coarse); /* has none, and takes none */
        float *normals = random_normals(fine.patch.vertex_count);
        size_t size = delta.size;
        assert_int_equal(
            rqt_wire_add_normals(normals, fine.patch.vertex_count, &test_allocator, delta.bytes, &size),
            RQT_INVALID);
        free(normals);
        free(delta.bytes);
        answer_free(&coarse);
        answer_free(&fine);
        rqt_region_free(region);
        database_free(&d, &test_allocator);
        model_free(&m);
    }
}

/* Normals of hostile bytes: unit vectors, or refused. Those that lie under a right checksum, too. */
static void mutate_normals(const answer *a, int rounds) {
    const size_t count = a->patch.vertex_count, head = RQT_WIRE_HEADER_BYTES;
    float *normals = random_normals(count), *read = random_normals(count);
    blob b = encode_with(a, normals);
    const size_t mesh = ZSTD_findFrameCompressedSize(b.bytes + head, b.size - head);
    for (int n = 0; n < rounds; n++) {
        blob copy = blob_of(b.bytes, b.size);
        const size_t at = random_between(0, 1) ? (size_t)random_between(0, (int)head - 1)
                                               : head + mesh + (size_t)(random_bits() % (b.size - head - mesh));
        if (random_between(0, 3) == 0) copy.size = (size_t)(random_bits() % b.size);
        if (at < copy.size) copy.bytes[at] = changed_byte(copy.bytes[at], n % 8);
        if (copy.size >= 16 && random_between(0, 9)) seal(&copy);
        blob exact = blob_of(copy.bytes, copy.size);
        rqt_message why;
        const rqt_status status = rqt_wire_normals(exact.bytes, exact.size, count, &test_allocator, read, &why);
        CHECK(status == RQT_OK || ((status == RQT_CORRUPT || status == RQT_INVALID) && why.text[0]), "status %d",
              (int)status);
        for (size_t i = 0; i < count && status == RQT_OK; i++) {
            const double dot = (double)read[3 * i] * read[3 * i] + (double)read[3 * i + 1] * read[3 * i + 1] +
                               (double)read[3 * i + 2] * read[3 * i + 2];
            CHECK(fabs(dot - 1) < 1e-5 && read[3 * i + 2] >= 0, "normal %zu", i);
        }
        read_hostile(&exact, NULL);
        free(exact.bytes);
        free(copy.bytes);
    }
    free(b.bytes);
    free(normals);
    free(read);
}

static rqt_status normals_way(const rqt_patch *patch, const uint8_t *bytes, size_t size) {
    const size_t count = patch->vertex_count, room = size + rqt_wire_normals_bound(count);
    float *normals = random_normals(count);
    uint8_t *longer = malloc(room);
    if (!longer) abort();
    memcpy(longer, bytes, size);
    rqt_status status = rqt_wire_add_normals(normals, count, &test_allocator, longer, &size);
    if (status == RQT_OK) status = rqt_wire_normals(longer, size, count, &test_allocator, normals, NULL);
    free(longer);
    free(normals);
    return status;
}

static void hostile_normals_are_refused_or_harmless(void **state) {
    (void)state;
    random_begin("hostile normals");
    taken = refused = 0;
    for (int n = 0; n < 12; n++) {
        model m;
        database d;
        model_create(&m, random_raster(n));
        assert_int_equal(database_create(&d, &m, largest_k(&m.grid.lattice), &test_allocator), RQT_OK);
        window w = window_all();
        rqt_region *region = region_of(&w, &m.grid.lattice);
        answer fine = ask(&d, &m, region, 0, RQT_OUTLINE_EXACT);
        mutate_normals(&fine, 300);
        answer_free(&fine);
        rqt_region_free(region);
        database_free(&d, &test_allocator);
        model_free(&m);
    }
    printf("%zu taken, %zu refused\n", taken, refused);
    assert_true(refused > 500);
}

static void a_refused_allocation_is_reported_and_nothing_leaks(void **state) {
    (void)state;
    random_begin("memory");
    model m;
    database d;
    model_create(&m, raster_make(SURFACE_HILLS, 33, 20, -1));
    assert_int_equal(database_create(&d, &m, 3, &test_allocator), RQT_OK);
    window w = window_all();
    rqt_region *region = region_of(&w, &m.grid.lattice);
    answer fine = ask(&d, &m, region, 0, RQT_OUTLINE_EXACT);
    blob mesh = encode(&fine, NULL);
    const heap before = test_heap;
    assert_int_equal(normals_way(&fine.patch, mesh.bytes, mesh.size), RQT_OK);
    const size_t calls = test_heap.calls - before.calls;
    assert_true(calls > 4 && test_heap.live == before.live);
    for (size_t n = 1; n <= calls; n++)
        for (int from_then_on = 0; from_then_on < 2; from_then_on++) {
            test_heap = before;
            test_heap.fail_from = before.calls + n;
            test_heap.fail_to = from_then_on ? SIZE_MAX : test_heap.fail_from;
            const rqt_status status = normals_way(&fine.patch, mesh.bytes, mesh.size);
            CHECK(status == RQT_NO_MEMORY, "request %zu refused: status %d", n, (int)status);
            CHECK(test_heap.live == before.live, "request %zu refused: leaked", n);
        }
    test_heap = before;
    free(mesh.bytes);
    answer_free(&fine);
    rqt_region_free(region);
    database_free(&d, &test_allocator);
    model_free(&m);
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(normals_come_back_beside_an_unchanged_mesh),
        TEST(hostile_normals_are_refused_or_harmless),
        TEST(a_refused_allocation_is_reported_and_nothing_leaks),
    };
    return cmocka_run_group_tests_name("wire: normals", tests, NULL, NULL);
}
