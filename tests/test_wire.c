/* test_wire.c - the wire format gives back the patch of the query: the same vertices and triangles in the same
 * order, whole or step by step; and no bytes at all do it harm.
 *
 * The patches come from queries over blocks of every legal size, on random terrains with voids, of clamped sizes,
 * whole and in windows. Bytes to be read are in allocations of exactly their size, so that a sanitizer sees one too
 * far. */
#include "test_wire_support.h"

static void check_header(const rqt_wire_header *h, const answer *a) {
    const rqt_wire_header *w = &a->header;
    CHECK(!h->is_delta && h->from == 0 && h->eps_from == 0, "it is an increment");
    CHECK(h->lattice.width == w->lattice.width && h->lattice.height == w->lattice.height &&
              h->lattice.K == w->lattice.K && h->k == w->k,
          "lattice");
    CHECK(memcmp(&h->placement, &w->placement, sizeof h->placement) == 0, "placement");
    CHECK(h->unit.z0 == w->unit.z0 && h->unit.d == w->unit.d && h->unit.numerator == w->unit.numerator &&
              h->unit.denominator == w->unit.denominator && h->unit.scale == w->unit.scale &&
              h->unit.offset == w->unit.offset,
          "unit");
    CHECK(h->eps == w->eps && h->srid == w->srid, "eps, srid");
    CHECK(h->vertex_count == a->patch.vertex_count && h->triangle_count == a->patch.triangle_count, "counts");
}

static void check_round_trip(const answer *a, const char *what) {
    blob b = encode_as(a, NULL, what);
    for (int leaves = 0; leaves < 2; leaves++) {
        rqt_wire_header header;
        rqt_patch patch;
        rqt_message why;
        const rqt_status status = rqt_wire_decode(b.bytes, b.size, leaves, &test_allocator, &header, &patch, &why);
        CHECK(status == RQT_OK, "%s: status %d, %s", what, (int)status, why.text);
        CHECK((patch.leaves != NULL) == leaves, "%s: leaves", what);
        check_header(&header, a);
        check_same_patch(&patch, &a->patch, what);
        if (leaves) CHECK(rqt_wire_digest(&patch) == rqt_wire_digest(&a->patch), "%s: digest", what);
        rqt_patch_free(&patch);
    }
    free(b.bytes);
}

/* -------------------------------------------------------------------------------------- round trips -- */

typedef void check_one(const model *m, database *d, const rqt_region *region, rqt_outline outline,
                       const char *what);

static void for_terrains(const char *name, int count, check_one *check) {
    random_begin(name);
    for (int n = 0; n < count; n++) {
        model m;
        model_create(&m, random_raster(n));
        for (int k = smallest_k(&m.grid.lattice); k <= largest_k(&m.grid.lattice); k++) {
            database d;
            assert_int_equal(database_create(&d, &m, k, &test_allocator), RQT_OK);
            for (int e = 0; e < 5; e++) {
                window w = e == 0 ? window_all()
                                  : random_window(m.r.width, m.r.height, random_between(0, WINDOW_KINDS - 1));
                rqt_region *region = region_of(&w, &m.grid.lattice);
                char what[1200];
                (void)snprintf(what, sizeof what, "%s %d x %d, k=%d, window %s: %s", m.r.name, m.r.width,
                               m.r.height, k, w.kind, w.text);
                check(&m, &d, region, random_between(0, 1) ? RQT_OUTLINE_TOL : RQT_OUTLINE_EXACT, what);
                rqt_region_free(region);
            }
            database_free(&d, &test_allocator);
        }
        model_free(&m);
    }
}

static size_t meshes, empty_meshes, partial;

static void check_meshes(const model *m, database *d, const rqt_region *region, rqt_outline outline,
                         const char *what) {
    for (int e = 0; e < 3; e++) {
        answer a = ask(d, m, region, e == 0 ? 0 : (rqt_code)random_eps(m), outline);
        check_round_trip(&a, what);
        meshes++;
        empty_meshes += a.patch.triangle_count == 0;
        answer_free(&a);
    }
}

static void the_patch_of_the_query_comes_back_in_its_order(void **state) {
    (void)state;
    meshes = empty_meshes = 0;
    for_terrains("round trips", 84, check_meshes);
    printf("%zu meshes, %zu of them empty\n", meshes, empty_meshes);
    assert_true(meshes > 1000 && empty_meshes > 10 && meshes - empty_meshes > 1000);
}

/* Step by step from infinity, some steps left out: each time the mesh as asked for at once. */
static void check_chain(const model *m, database *d, const rqt_region *region, rqt_outline outline,
                        const char *what) {
    rqt_code eps[6] = {RQT_CODE_LARGEST, 0, 0, 0, 0, 0};
    for (int i = 1; i < 5; i++) eps[i] = (rqt_code)random_eps(m);
    for (int i = 1; i < 5; i++)
        for (int j = i + 1; j < 5; j++)
            if (eps[j] > eps[i]) {
                const rqt_code swap = eps[i];
                eps[i] = eps[j];
                eps[j] = swap;
            }
    answer now = ask(d, m, region, eps[0], outline);
    blob b = encode(&now, NULL);
    rqt_wire_header header, finer;
    rqt_patch patch, next;
    rqt_message why;
    assert_int_equal(rqt_wire_decode(b.bytes, b.size, true, &test_allocator, &header, &patch, &why), RQT_OK);
    free(b.bytes);
    for (int i = 1; i < 6; i++) {
        if (random_between(0, 4) == 0 && i < 5) continue;
        answer then = ask(d, m, region, eps[i], outline);
        b = encode_as(&then, &now, what);
        const rqt_status status =
            rqt_wire_apply(&header, &patch, b.bytes, b.size, &test_allocator, &finer, &next, &why);
        CHECK(status == RQT_OK, "%s: eps code %d: status %d, %s", what, eps[i], (int)status, why.text);
        check_header(&finer, &then);
        check_same_patch(&next, &then.patch, what);
        assert_non_null(next.leaves);
        CHECK(rqt_wire_digest(&next) == rqt_wire_digest(&then.patch), "%s: digest", what);
        rqt_patch_free(&patch);
        patch = next;
        header = finer;
        free(b.bytes);
        answer_free(&now);
        now = then;
        partial++;
    }
    rqt_patch_free(&patch);
    answer_free(&now);
}

static void increments_end_in_the_mesh_as_asked_for_at_once(void **state) {
    (void)state;
    partial = 0;
    for_terrains("chains", 56, check_chain);
    printf("%zu increments\n", partial);
    assert_true(partial > 1000);
}

/* An increment holds what is new and no more: the sum over a chain is about the mesh at the end. */
static void a_chain_of_increments_costs_little_more_than_the_mesh(void **state) {
    (void)state;
    random_begin("sizes");
    static const double steps[] = {INFINITY, 100, 50, 20, 10, 5, 2, 1, 0};
    const rqt_unit unit = UNIT_METRE;
    raster r = raster_from_memory(129, 129, NULL, NULL, &unit, "hills");
    for (int y = 0; y < 129; y++)
        for (int x = 0; x < 129; x++)
            r.q[y * 129 + x] = (int32_t)(300 * sin(x / 19.0) * cos(y / 13.0)) + random_between(-8, 8);
    model m;
    database d;
    model_create(&m, r);
    assert_int_equal(database_create(&d, &m, 5, &test_allocator), RQT_OK);
    window w = window_all();
    rqt_region *region = region_of(&w, &m.grid.lattice);
    answer now = ask(&d, &m, region, rqt_code_eps(steps[0], 0), RQT_OUTLINE_EXACT);
    size_t sum = 0, headers = 0;
    for (size_t i = 1; i < sizeof steps / sizeof *steps; i++) {
        answer then = ask(&d, &m, region, rqt_code_eps(steps[i], 0), RQT_OUTLINE_EXACT);
        blob b = encode(&then, &now);
        sum += b.size;
        headers += RQT_WIRE_HEADER_BYTES;
        free(b.bytes);
        answer_free(&now);
        now = then;
    }
    blob b = encode(&now, NULL);
    printf("%zu bytes in steps, %zu at once, %zu vertices\n", sum - headers, b.size, now.patch.vertex_count);
    assert_true(sum - headers < b.size + b.size / 3);
    free(b.bytes);
    answer_free(&now);
    rqt_region_free(region);
    database_free(&d, &test_allocator);
    model_free(&m);
}

/* ------------------------------------------------------------------------------------------ refusals -- */

/* Two terrains that differ in one height, and what an increment of one says to a mesh of the other. */
static void increments_that_belong_elsewhere_are_refused_with_a_reason(void **state) {
    (void)state;
    random_begin("elsewhere");
    raster r = raster_make(SURFACE_NOISE, 33, 29, -1);
    model m;
    database d;
    model_create(&m, r);
    assert_int_equal(database_create(&d, &m, 3, &test_allocator), RQT_OK);
    const long box[4] = {3 * ORACLE_UNITS, 3 * ORACLE_UNITS, 20 * ORACLE_UNITS, 21 * ORACLE_UNITS};
    window all = window_all(), part = window_of(box);
    rqt_region *whole = region_of(&all, &m.grid.lattice), *some = region_of(&part, &m.grid.lattice);
    const rqt_code middle = (rqt_code)(oracle_at(&m.o, 10, 10)->code - 1);
    answer coarse = ask(&d, &m, whole, RQT_CODE_LARGEST, RQT_OUTLINE_EXACT),
           window_between = ask(&d, &m, some, middle, RQT_OUTLINE_EXACT),
           fine = ask(&d, &m, whole, 0, RQT_OUTLINE_EXACT), between = ask(&d, &m, whole, middle, RQT_OUTLINE_EXACT);
    blob delta = encode(&fine, &coarse), later = encode(&fine, &between), mesh = encode(&fine, NULL);
    rqt_wire_header header, out;
    rqt_patch patch;
    rqt_message why;
    struct {
        const char *says;
        rqt_wire_header header;
        const rqt_patch *state;
        const blob *bytes;
    } cases[] = {
        {"another region", window_between.header, &window_between.patch, &later},
        {"another eps", between.header, &between.patch, &delta},
        {"another terrain", coarse.header, &coarse.patch, &delta},
        {"another terrain", coarse.header, &coarse.patch, &delta},
        {"another unit", coarse.header, &coarse.patch, &delta},
        {"not an increment", coarse.header, &coarse.patch, &mesh},
    };
    cases[2].header.placement.x0 += 1;
    cases[3].header.lattice.width--;
    cases[4].header.unit.z0++;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        memset(&patch, 0xA5, sizeof patch);
        const rqt_status status = rqt_wire_apply(&cases[i].header, cases[i].state, cases[i].bytes->bytes,
                                                 cases[i].bytes->size, &test_allocator, &out, &patch, &why);
        CHECK(status == RQT_INVALID && strstr(why.text, cases[i].says), "case %zu: status %d, %s", i, (int)status,
              why.text);
        assert_true(patch.vertex_count == 0 && patch.vertices == NULL);
        rqt_patch_free(&patch);
    }
    coarse.patch.vertices[0].q++;
    assert_int_equal(
        rqt_wire_apply(&coarse.header, &coarse.patch, delta.bytes, delta.size, &test_allocator, &out, &patch, &why),
        RQT_INVALID);
    coarse.patch.vertices[0].q--;
    assert_int_equal(rqt_wire_decode(delta.bytes, delta.size, false, &test_allocator, &header, &patch, &why),
                     RQT_INVALID);
    /* What is no mesh of these blocks is not coded. */
    uint8_t *room = malloc(rqt_wire_bound(fine.patch.vertex_count, fine.patch.triangle_count, fine.count));
    size_t size;
    if (!room) abort();
    fine.patch.triangles[4] ^= 1;
    assert_int_equal(
        rqt_wire_encode(&fine.header, fine.numbers, fine.count, &fine.patch, NULL, &test_allocator, room, &size),
        RQT_INVALID);
    fine.patch.triangles[4] ^= 1;
    assert_int_equal(rqt_wire_encode(&fine.header, fine.numbers, fine.count - 1, &fine.patch, NULL, &test_allocator,
                                     room, &size),
                     RQT_INVALID);
    assert_int_equal(rqt_wire_encode(&coarse.header, coarse.numbers, coarse.count, &coarse.patch, &fine.patch,
                                     &test_allocator, room, &size),
                     RQT_INVALID);
    /* Leaves finer than the blocks that are said to hold them, and vertices that are not there. */
    assert_int_equal(rqt_wire_encode(&fine.header, coarse.numbers, coarse.count, &fine.patch, NULL, &test_allocator,
                                     room, &size),
                     RQT_INVALID);
    const size_t fine_is_odd = fine.patch.vertex_count % 2;
    fine.patch.vertex_count /= 2;
    assert_int_equal(
        rqt_wire_encode(&fine.header, fine.numbers, fine.count, &fine.patch, NULL, &test_allocator, room, &size),
        RQT_INVALID);
    fine.patch.vertex_count = 2 * fine.patch.vertex_count + fine_is_odd;
    /* An increment wants the leaves of what it makes finer. */
    rqt_patch bare;
    assert_int_equal(rqt_wire_decode(mesh.bytes, mesh.size, false, &test_allocator, &header, &bare, &why), RQT_OK);
    assert_int_equal(rqt_wire_apply(&header, &bare, delta.bytes, delta.size, &test_allocator, &out, &patch, &why),
                     RQT_INVALID);
    CHECK(strstr(why.text, "without its leaves"), "it says: %s", why.text);
    rqt_patch_free(&bare);
    free(room);
    free(delta.bytes);
    free(later.bytes);
    free(mesh.bytes);
    answer_free(&coarse);
    answer_free(&window_between);
    answer_free(&fine);
    answer_free(&between);
    rqt_region_free(whole);
    rqt_region_free(some);
    database_free(&d, &test_allocator);
    model_free(&m);
}

/* ------------------------------------------------------------------------------------- hostile bytes -- */

/* The same header over another payload. */
static blob with_payload(const blob *b, const uint8_t *payload, size_t size) {
    const size_t bound = ZSTD_compressBound(size);
    blob out = {malloc(RQT_WIRE_HEADER_BYTES + bound), 0};
    if (!out.bytes) abort();
    memcpy(out.bytes, b->bytes, RQT_WIRE_HEADER_BYTES);
    const size_t frame = ZSTD_compress(out.bytes + RQT_WIRE_HEADER_BYTES, bound, payload, size, 1);
    assert_false(ZSTD_isError(frame));
    out.size = RQT_WIRE_HEADER_BYTES + frame;
    const uint64_t count = size;
    memcpy(out.bytes + 120, &count, 8);
    seal(&out);
    blob exact = blob_of(out.bytes, out.size);
    free(out.bytes);
    return exact;
}

static void mutate(const blob *b, const answer *from, int rounds) {
    const size_t head = RQT_WIRE_HEADER_BYTES;
    uint8_t *payload = malloc(1 << 20);
    if (!payload) abort();
    const size_t size = ZSTD_decompress(payload, 1 << 20, b->bytes + head, b->size - head);
    assert_false(ZSTD_isError(size));
    uint8_t *changed = malloc(size + 64);
    if (!changed) abort();
    for (int n = 0; n < rounds; n++) {
        blob copy;
        if (n % 2) { /* in the payload, under a right checksum */
            size_t length = size;
            memcpy(changed, payload, size);
            const int changes = random_between(1, 4);
            for (int c = 0; c < changes; c++) {
                const size_t at = random_between(0, 2) ? (size_t)(random_bits() % size)
                                                       : (size_t)random_between(0, size < 80 ? (int)size - 1 : 79);
                changed[at] = changed_byte(changed[at], n / 2 % 8);
            }
            if (random_between(0, 5) == 0) length = (size_t)(random_bits() % size) + 1;
            copy = with_payload(b, changed, length);
        } else { /* anywhere */
            copy = blob_of(b->bytes, b->size);
            const size_t at =
                random_between(0, 1) ? (size_t)(random_bits() % head) : (size_t)(random_bits() % copy.size);
            copy.bytes[at] = changed_byte(copy.bytes[at], n / 2 % 8);
            if (random_between(0, 9)) seal(&copy);
        }
        read_hostile(&copy, from);
        free(copy.bytes);
    }
    for (size_t length = 0; length < b->size; length += 1 + b->size / 200) {
        blob copy = blob_of(b->bytes, length);
        if (length >= 16 && random_between(0, 1)) seal(&copy);
        read_hostile(&copy, from);
        free(copy.bytes);
    }
    free(changed);
    free(payload);
}

static void F42_hostile_bytes_are_refused_or_harmless(void **state) {
    (void)state;
    random_begin("hostile");
    taken = refused = 0;
    for (int n = 0; n < 24; n++) {
        raster r = random_raster(n);
        if (r.width < 3 || r.height < 3) {
            raster_free(&r);
            continue;
        }
        model m;
        database d;
        model_create(&m, r);
        const int k = random_between(smallest_k(&m.grid.lattice), largest_k(&m.grid.lattice));
        assert_int_equal(database_create(&d, &m, k, &test_allocator), RQT_OK);
        window w = random_between(0, 1) ? window_all() : random_window(m.r.width, m.r.height, 1);
        rqt_region *region = region_of(&w, &m.grid.lattice);
        answer coarse = ask(&d, &m, region, (rqt_code)random_eps(&m), RQT_OUTLINE_EXACT),
               fine = ask(&d, &m, region, 0, RQT_OUTLINE_EXACT);
        blob mesh = encode(&fine, NULL), delta = encode(&fine, &coarse);
        mutate(&mesh, NULL, 400);
        mutate(&delta, &coarse, 200);
        free(mesh.bytes);
        free(delta.bytes);
        answer_free(&coarse);
        answer_free(&fine);
        rqt_region_free(region);
        database_free(&d, &test_allocator);
        model_free(&m);
    }
    printf("%zu taken, %zu refused\n", taken, refused);
    assert_true(refused > 2000 && taken > 20);
}

/* ------------------------------------------------------------------------------------------- memory -- */

static rqt_status whole_way(const answer *coarse, const answer *fine) {
    const size_t bound = rqt_wire_bound(fine->patch.vertex_count, fine->patch.triangle_count, fine->count);
    uint8_t *bytes = malloc(bound);
    rqt_wire_header header, finer;
    rqt_patch patch = {0}, next = {0};
    rqt_message why;
    size_t size;
    if (!bytes) abort();
    rqt_status status = rqt_wire_encode(&coarse->header, coarse->numbers, coarse->count, &coarse->patch, NULL,
                                        &test_allocator, bytes, &size);
    if (status == RQT_OK) status = rqt_wire_decode(bytes, size, true, &test_allocator, &header, &patch, &why);
    rqt_wire_header h = fine->header;
    h.eps_from = coarse->header.eps;
    if (status == RQT_OK)
        status =
            rqt_wire_encode(&h, fine->numbers, fine->count, &fine->patch, &patch, &test_allocator, bytes, &size);
    if (status == RQT_OK)
        status = rqt_wire_apply(&header, &patch, bytes, size, &test_allocator, &finer, &next, &why);
    if (status == RQT_OK) check_same_patch(&next, &fine->patch, "memory");
    rqt_patch_free(&patch);
    rqt_patch_free(&next);
    free(bytes);
    return status;
}

static void F48_a_refused_allocation_is_reported_and_nothing_leaks(void **state) {
    (void)state;
    random_begin("memory");
    raster r = raster_make(SURFACE_HILLS, 65, 50, -1);
    raster_add_lake(&r);
    model m;
    database d;
    model_create(&m, r);
    assert_int_equal(database_create(&d, &m, 3, &test_allocator), RQT_OK);
    const long box[4] = {3 * ORACLE_UNITS, 3 * ORACLE_UNITS, 60 * ORACLE_UNITS, 41 * ORACLE_UNITS};
    window w = window_of(box);
    rqt_region *region = region_of(&w, &m.grid.lattice);
    answer coarse = ask(&d, &m, region, rqt_code_eps(30, 0), RQT_OUTLINE_EXACT),
           fine = ask(&d, &m, region, 0, RQT_OUTLINE_EXACT);
    const heap before = test_heap;
    assert_int_equal(whole_way(&coarse, &fine), RQT_OK);
    const size_t calls = test_heap.calls - before.calls;
    assert_true(calls > 30 && test_heap.live == before.live);
    for (size_t n = 1; n <= calls; n++)
        for (int from_then_on = 0; from_then_on < 2; from_then_on++) {
            test_heap = before;
            test_heap.fail_from = before.calls + n;
            test_heap.fail_to = from_then_on ? SIZE_MAX : test_heap.fail_from;
            const rqt_status status = whole_way(&coarse, &fine);
            CHECK(status == RQT_NO_MEMORY, "request %zu refused: status %d", n, (int)status);
            CHECK(test_heap.live == before.live, "request %zu refused: leaked", n);
        }
    test_heap = before;
    printf("%zu requests for memory\n", calls);
    answer_free(&coarse);
    answer_free(&fine);
    rqt_region_free(region);
    database_free(&d, &test_allocator);
    model_free(&m);
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(the_patch_of_the_query_comes_back_in_its_order),
        TEST(increments_end_in_the_mesh_as_asked_for_at_once),
        TEST(a_chain_of_increments_costs_little_more_than_the_mesh),
        TEST(increments_that_belong_elsewhere_are_refused_with_a_reason),
        TEST(F42_hostile_bytes_are_refused_or_harmless),
        TEST(F48_a_refused_allocation_is_reported_and_nothing_leaks),
    };
    return cmocka_run_group_tests_name("wire", tests, NULL, NULL);
}
