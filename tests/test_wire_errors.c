/* test_wire_errors.c - errors behind a mesh in wire format: each vertex has its own again, whatever they are, the
 * mesh is as without them, and no bytes at all do harm. (That the bytes are those of FORMAT.md is
 * test_sql_errors.py's.) */
#include "test_wire_support.h"

static rqt_status add(blob *b, const rqt_patch *patch) {
    uint8_t *bytes = realloc(b->bytes, b->size + rqt_wire_errors_bound(patch->vertex_count));
    if (!bytes) abort();
    const size_t before = b->size;
    b->bytes = bytes;
    const rqt_status status = rqt_wire_add_errors(patch, &test_allocator, bytes, &b->size);
    CHECK(b->size <= before + rqt_wire_errors_bound(patch->vertex_count), "%zu bytes more", b->size - before);
    return status;
}

static rqt_status add_normals(blob *b, size_t count) {
    uint8_t *bytes = realloc(b->bytes, b->size + rqt_wire_normals_bound(count));
    float *normals = calloc(3 * count + 1, sizeof *normals);
    if (!bytes || !normals) abort();
    for (size_t i = 0; i < count; i++) normals[3 * i + 2] = 1;
    b->bytes = bytes;
    const rqt_status status = rqt_wire_add_normals(normals, count, &test_allocator, bytes, &b->size);
    free(normals);
    return status;
}

static void check_errors(const blob *b, const rqt_patch *patch, const char *what) {
    const blob exact = blob_of(b->bytes, b->size);
    for (int leaves = 0; leaves < 2; leaves++) {
        rqt_wire_header header;
        rqt_patch read;
        rqt_message why;
        assert_int_equal(rqt_wire_decode(exact.bytes, exact.size, leaves, &test_allocator, &header, &read, &why),
                         RQT_OK);
        CHECK(header.has_errors, "%s: has_errors", what);
        if (leaves) check_same_patch(&read, patch, what);
        assert_int_equal(read.vertex_count, patch->vertex_count);
        for (size_t i = 0; i < read.vertex_count; i++)
            CHECK(read.vertices[i].error == patch->vertices[i].error, "%s: vertex %zu (%d,%d) has code %d, had %d",
                  what, i, read.vertices[i].col, read.vertices[i].row, read.vertices[i].error,
                  patch->vertices[i].error);
        rqt_patch_free(&read);
    }
    free(exact.bytes);
}

static void check_corrupt(const blob *b, size_t size, int flags, const char *what) {
    blob copy = {calloc(size, 1), size};
    rqt_wire_header header;
    rqt_patch patch;
    rqt_message why;
    if (!copy.bytes) abort();
    memcpy(copy.bytes, b->bytes, size < b->size ? size : b->size);
    if (flags >= 0) copy.bytes[7] = (uint8_t)flags;
    seal(&copy);
    CHECK(rqt_wire_decode(copy.bytes, copy.size, true, &test_allocator, &header, &patch, &why) == RQT_CORRUPT &&
              why.text[0] && !patch.vertices && patch.vertex_count == 0,
          "%s (flags %d, %zu bytes)", what, flags, size);
    free(copy.bytes);
}

static void check_flags(const blob *with, const blob *without, const blob *both) {
    check_corrupt(with, with->size, 0, "errors that the header does not tell of");
    check_corrupt(with, with->size, 3, "errors but no normals");
    check_corrupt(without, without->size, 2, "no errors");
    check_corrupt(both, both->size, 1, "normals alone");
    check_corrupt(both, both->size, 2, "errors alone");
    for (int bit = 2; bit < 8; bit++) check_corrupt(with, with->size, 2 | 1 << bit, "a flag of the future");
    check_corrupt(with, with->size + 1, -1, "a byte behind");
    check_corrupt(with, with->size - 1, -1, "a byte missing");
    check_corrupt(both, both->size + 20, -1, "bytes behind");
}

static void check_all(const answer *a) {
    const size_t count = a->patch.vertex_count;
    blob without = encode(a, NULL), with = blob_of(without.bytes, without.size),
         both = blob_of(without.bytes, without.size);
    assert_int_equal(add(&with, &a->patch), RQT_OK);
    assert_int_equal(add_normals(&both, count), RQT_OK);
    assert_int_equal(add(&both, &a->patch), RQT_OK);
    check_errors(&with, &a->patch, "errors");
    check_errors(&both, &a->patch, "errors behind normals");
    rqt_patch fewer = a->patch;
    fewer.vertex_count = count > 0 ? count - 1 : 0;
    assert_int_equal(add(&with, &a->patch), RQT_INVALID); /* twice */
    assert_int_equal(add_normals(&with, count), RQT_INVALID);
    if (count > 0) assert_int_equal(add(&without, &fewer), RQT_INVALID);
    check_flags(&with, &without, &both);
    free(without.bytes);
    free(with.bytes);
    free(both.bytes);
}

/* Codes as no terrain has them: they come back all the same. */
static void check_any_codes(const answer *a) {
    static const rqt_code often[] = {0, 1, RQT_CODE_LARGEST, RQT_CODE_INFINITY};
    rqt_patch other = a->patch;
    other.vertices = calloc(other.vertex_count + 1, sizeof *other.vertices);
    if (!other.vertices) abort();
    memcpy(other.vertices, a->patch.vertices, other.vertex_count * sizeof *other.vertices);
    for (size_t i = 0; i < other.vertex_count; i++)
        other.vertices[i].error = random_between(0, 2) ? (rqt_code)random_bits() : often[random_between(0, 3)];
    blob b = encode(a, NULL);
    assert_int_equal(add(&b, &other), RQT_OK);
    check_errors(&b, &other, "any codes");
    free(b.bytes);
    free(other.vertices);
}

/* It has none and takes none, not even those of the mesh that it ends in. */
static void check_increment(const answer *fine, const answer *coarse) {
    blob delta = encode(fine, coarse), mesh = encode(fine, NULL);
    const size_t without = mesh.size, before = delta.size;
    assert_int_equal(add(&delta, &fine->patch), RQT_INVALID);
    assert_int_equal(add(&mesh, &fine->patch), RQT_OK);
    uint8_t *longer = realloc(delta.bytes, before + mesh.size - without);
    if (!longer) abort();
    memcpy(longer + before, mesh.bytes + without, mesh.size - without);
    delta = (blob){longer, before + mesh.size - without};
    check_corrupt(&delta, delta.size, 2, "errors of an increment");
    free(delta.bytes);
    free(mesh.bytes);
}

static void errors_come_back_beside_an_unchanged_mesh(void **state) {
    (void)state;
    random_begin("errors");
    for (int n = 0; n < 60; n++) {
        model m;
        model_create(&m, random_raster(n));
        for (int k = smallest_k(&m.grid.lattice); k <= largest_k(&m.grid.lattice); k++) {
            database d;
            assert_int_equal(database_create(&d, &m, k, &test_allocator), RQT_OK);
            window w = window_all();
            rqt_region *region = region_of(&w, &m.grid.lattice);
            answer coarse = ask(&d, &m, region, (rqt_code)random_eps(&m), RQT_OUTLINE_EXACT),
                   fine = ask(&d, &m, region, 0, RQT_OUTLINE_EXACT),
                   rough = ask(&d, &m, region, (rqt_code)random_eps(&m), RQT_OUTLINE_TOL);
            check_all(&coarse);
            check_all(&fine);
            check_all(&rough);
            check_any_codes(&fine);
            check_increment(&fine, &coarse);
            answer_free(&rough);
            answer_free(&coarse);
            answer_free(&fine);
            rqt_region_free(region);
            database_free(&d, &test_allocator);
        }
        model_free(&m);
    }
}

/* The mesh of `with`, and behind it other errors under a right checksum. */
static blob with_errors(const blob *with, size_t mesh, const uint8_t *plain, size_t size) {
    blob b = {malloc(mesh + ZSTD_compressBound(size)), 0};
    if (!b.bytes) abort();
    memcpy(b.bytes, with->bytes, mesh);
    b.size = mesh + ZSTD_compress(b.bytes + mesh, ZSTD_compressBound(size), plain, size, 3);
    seal(&b);
    return b;
}

static rqt_status decode_status(const blob *b) {
    const blob exact = blob_of(b->bytes, b->size);
    rqt_wire_header header;
    rqt_patch patch;
    rqt_message why;
    const rqt_status status =
        rqt_wire_decode(exact.bytes, exact.size, true, &test_allocator, &header, &patch, &why);
    assert_true(status == RQT_OK || why.text[0]);
    rqt_patch_free(&patch);
    free(exact.bytes);
    return status;
}

/* A mesh with errors, taken apart. */
typedef struct sample {
    blob with;
    size_t mesh;                    /* its bytes without them */
    size_t count, head, told, size; /* vertices; bytes before the list; residuals in it; bytes, plain */
    size_t room;
    uint8_t *plain; /* with room for a little more than the most */
} sample;

static void sample_take(sample *s, const answer *a) {
    s->with = encode(a, NULL);
    s->mesh = s->with.size;
    s->count = a->patch.vertex_count;
    s->head = 2 + (s->count + 7) / 8;
    assert_int_equal(add(&s->with, &a->patch), RQT_OK);
    s->size = (size_t)ZSTD_getFrameContentSize(s->with.bytes + s->mesh, s->with.size - s->mesh);
    s->told = (s->size - s->head) / 2;
    s->room = s->head + 2 * s->count + 64;
    s->plain = calloc(s->room, 1);
    if (!s->plain) abort();
    assert_int_equal(ZSTD_decompress(s->plain, s->size, s->with.bytes + s->mesh, s->with.size - s->mesh), s->size);
}

static void sample_free(sample *s) {
    free(s->with.bytes);
    free(s->plain);
}

static void check_plain(const sample *s, const uint8_t *plain, size_t size, rqt_status expected, const char *what) {
    blob b = with_errors(&s->with, s->mesh, plain, size);
    const rqt_status status = decode_status(&b);
    rqt_wire_header header;
    if (size > s->head + 2 * s->count) /* the header alone shows it */
        CHECK(rqt_wire_info(b.bytes, b.size, &header, NULL) == RQT_CORRUPT, "%s: info", what);
    CHECK(status == expected, "%s: status %d", what, (int)status);
    free(b.bytes);
}

/* Each thing that FORMAT.md rules out, alone. */
static void check_rules(const sample *s) {
    uint8_t *p = malloc(s->room);
    if (!p) abort();
#define AGAIN() memcpy(p, s->plain, s->room)
    AGAIN();
    check_plain(s, p, s->size, RQT_OK, "as it was");
    for (size_t more = 1; more <= 2; more++) {
        check_plain(s, p, s->size + more, RQT_CORRUPT, "more than the bits tell of");
        check_plain(s, p, s->size - more, RQT_CORRUPT, "less than the bits tell of");
    }
    check_plain(s, p, s->head - 1, RQT_CORRUPT, "not even all bits");
    check_plain(s, p, 0, RQT_CORRUPT, "nothing");
    for (size_t i = 0; i < s->count; i++)
        if (i % 7 == 0) {
            AGAIN();
            p[2 + i / 8] = (uint8_t)(p[2 + i / 8] ^ 1 << i % 8);
            check_plain(s, p, s->size, RQT_CORRUPT, "a bit more or less");
        }
    for (size_t i = s->count; i < 8 * (s->head - 2); i++) {
        AGAIN();
        p[2 + i / 8] = (uint8_t)(p[2 + i / 8] | 1 << i % 8);
        check_plain(s, p, s->size, RQT_CORRUPT, "a bit behind the last");
    }
    for (size_t i = 0; i < s->told; i++) {
        AGAIN();
        p[s->head + i] = p[s->head + s->told + i] = 0;
        if (i % 5 == 0) check_plain(s, p, s->size, RQT_CORRUPT, "a residual of 0");
    }
    memset(p, 0xFF, s->room);
    check_plain(s, p, s->head + 2 * s->count + 2, RQT_CORRUPT, "more than there are vertices");
#undef AGAIN
    free(p);
}

/* Anything under a right checksum: errors, or refused. */
static void mutate(const sample *s, int rounds) {
    for (int n = 0; n < rounds; n++) {
        blob b;
        if (random_between(0, 1)) {
            uint8_t *p = malloc(s->size);
            if (!p) abort();
            memcpy(p, s->plain, s->size);
            const size_t at = (size_t)(random_bits() % s->size);
            p[at] = changed_byte(p[at], n % 8);
            b = with_errors(&s->with, s->mesh, p, s->size);
            free(p);
        } else {
            b = blob_of(s->with.bytes, s->with.size);
            const size_t at = random_between(0, 1) ? (size_t)random_between(0, RQT_WIRE_HEADER_BYTES - 1)
                                                   : s->mesh + (size_t)(random_bits() % (s->with.size - s->mesh));
            if (random_between(0, 3) == 0) b.size = (size_t)(random_bits() % b.size);
            if (at < b.size) b.bytes[at] = changed_byte(b.bytes[at], n % 8);
            if (b.size >= 16 && random_between(0, 9)) seal(&b);
        }
        blob exact = blob_of(b.bytes, b.size);
        read_hostile(&exact, NULL);
        free(exact.bytes);
        free(b.bytes);
    }
}

static void hostile_errors_are_refused_or_harmless(void **state) {
    (void)state;
    random_begin("hostile errors");
    taken = refused = 0;
    for (int n = 0; n < 12; n++) {
        model m;
        database d;
        model_create(&m, random_raster(n));
        assert_int_equal(database_create(&d, &m, largest_k(&m.grid.lattice), &test_allocator), RQT_OK);
        window w = window_all();
        rqt_region *region = region_of(&w, &m.grid.lattice);
        answer fine = ask(&d, &m, region, 0, RQT_OUTLINE_EXACT);
        sample s;
        sample_take(&s, &fine);
        check_rules(&s);
        mutate(&s, 250);
        sample_free(&s);
        answer_free(&fine);
        rqt_region_free(region);
        database_free(&d, &test_allocator);
        model_free(&m);
    }
    printf("%zu taken, %zu refused\n", taken, refused);
    assert_true(taken > 200 && refused > 500);
}

static rqt_status there_and_back(const rqt_patch *patch, const blob *mesh) {
    const size_t room = mesh->size + rqt_wire_errors_bound(patch->vertex_count);
    uint8_t *bytes = malloc(room);
    size_t size = mesh->size;
    if (!bytes) abort();
    memcpy(bytes, mesh->bytes, size);
    rqt_wire_header header;
    rqt_patch read;
    rqt_message why = {""};
    rqt_status status = rqt_wire_add_errors(patch, &test_allocator, bytes, &size);
    if (status == RQT_OK) {
        status = rqt_wire_decode(bytes, size, true, &test_allocator, &header, &read, &why);
        assert_true(status == RQT_OK || strcmp(why.text, "out of memory") == 0);
        rqt_patch_free(&read);
    }
    free(bytes);
    return status;
}

static void F48_a_refused_allocation_is_reported_and_nothing_leaks(void **state) {
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
    assert_int_equal(there_and_back(&fine.patch, &mesh), RQT_OK);
    const size_t calls = test_heap.calls - before.calls;
    assert_true(calls > 20 && test_heap.live == before.live);
    for (size_t n = 1; n <= calls; n++)
        for (int from_then_on = 0; from_then_on < 2; from_then_on++) {
            test_heap = before;
            test_heap.fail_from = before.calls + n;
            test_heap.fail_to = from_then_on ? SIZE_MAX : test_heap.fail_from;
            const rqt_status status = there_and_back(&fine.patch, &mesh);
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
        TEST(errors_come_back_beside_an_unchanged_mesh),
        TEST(hostile_errors_are_refused_or_harmless),
        TEST(F48_a_refused_allocation_is_reported_and_nothing_leaks),
    };
    return cmocka_run_group_tests_name("wire: errors", tests, NULL, NULL);
}
