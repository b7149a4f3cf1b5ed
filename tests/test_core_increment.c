/* test_core_increment.c - increments of views: whatever the two meshes, the increment makes the one of the other,
 * at any distance of history; and bytes that come from anywhere do no harm.
 *
 * What an increment has to give is known without any: the mesh, sorted here by qsort. */
#include "test_core_database.h"

/* ---------------------------------------------------------------------------------------------- meshes -- */

typedef struct world {
    model m;
    database d;
} world;

static void world_create(world *w, int width, int height, int voids) {
    raster r = raster_make((surface)random_between(0, SURFACE_COUNT - 1), width, height, voids);
    if (voids == 0) raster_add_lake(&r);
    model_create(&w->m, r);
    const int low = smallest_k(&w->m.grid.lattice), high = largest_k(&w->m.grid.lattice);
    assert_int_equal(database_create(&w->d, &w->m, random_between(low, high), &test_allocator), RQT_OK);
}

static void world_free(world *w) {
    database_free(&w->d, &test_allocator);
    model_free(&w->m);
}

/* The mesh of one eps in a window and of another elsewhere; an ordinary patch, not sorted. */
static void random_mesh(world *w, rqt_patch *patch) {
    const rqt_lattice *l = &w->m.grid.lattice;
    char text[200];
    rqt_geometry *geometry[2] = {NULL, NULL};
    rqt_region *region[2];
    rqt_rule *rule = NULL;
    for (int i = 0; i < 2; i++) {
        const int x0 = random_between(0, l->width - 1), y0 = random_between(0, l->height - 1),
                  x1 = random_between(x0, l->width - 1) + 1, y1 = random_between(y0, l->height - 1) + 1;
        const int n = snprintf(text, sizeof text, "POLYGON((%d %d, %d %d, %d %d, %d %d, %d %d))", x0, y0, x1, y0,
                               x1, y1, x0, y1, x0, y0);
        assert_int_equal(rqt_geometry_parse(text, (size_t)n, true, &test_allocator, &geometry[i], NULL), RQT_OK);
        assert_int_equal(rqt_region_create(i == 0 && random_between(0, 1) ? NULL : geometry[i], &AT_ORIGIN, l,
                                           &test_allocator, &region[i]),
                         RQT_OK);
    }
    assert_int_equal(rqt_rule_create(l, 0, &test_allocator, &rule), RQT_OK);
    assert_int_equal(rqt_rule_set_eps(rule, random_between(0, 300) / 2.0), RQT_OK);
    const rqt_rule_place place = {region[1], random_between(0, 50) / 4.0};
    assert_int_equal(rqt_rule_set_places(rule, &place, 1), RQT_OK);
    w->d.rule = rule;
    assert_int_equal(database_query_as(&w->d, region[0], 0, RQT_SELECT_THRESHOLD, RQT_OUTLINE_EXACT,
                                       RQT_PRODUCT_TRIANGLES, random_between(0, 1), NULL, &test_allocator, patch),
                     RQT_OK);
    w->d.rule = NULL;
    rqt_rule_free(rule);
    for (int i = 0; i < 2; i++) {
        rqt_region_free(region[i]);
        rqt_geometry_free(geometry[i]);
    }
}

/* Morton code, bit by bit. */
static uint64_t code_of(int32_t col, int32_t row) {
    uint64_t code = 0;
    for (int bit = 0; bit < 21; bit++)
        code |= (uint64_t)(col >> bit & 1) << (2 * bit) | (uint64_t)(row >> bit & 1) << (2 * bit + 1);
    return code;
}

typedef struct corner {
    uint64_t code;
    int32_t col, row, q;
} corner;

typedef struct plain {
    corner *vertex;
    corner (*triangle)[3];
    size_t vertices, triangles;
} plain;

static int by_code(const void *a, const void *b) {
    const corner *one = a, *other = b;
    return one->code < other->code ? -1 : one->code > other->code;
}

static int by_codes(const void *a, const void *b) {
    const corner *one = a, *other = b;
    for (int c = 0; c < 3; c++) {
        const int order = by_code(&one[c], &other[c]);
        if (order) return order;
    }
    return 0;
}

static corner corner_of(const rqt_patch_vertex *v) {
    return (corner){code_of(v->col, v->row), v->col, v->row, v->q};
}

static plain plain_of(const rqt_patch *patch) {
    plain p = {.vertices = patch->vertex_count, .triangles = patch->triangle_count};
    p.vertex = malloc((p.vertices + 1) * sizeof *p.vertex);
    p.triangle = malloc((p.triangles + 1) * sizeof *p.triangle);
    if (!p.vertex || !p.triangle) abort();
    for (size_t i = 0; i < p.vertices; i++) p.vertex[i] = corner_of(&patch->vertices[i]);
    for (size_t t = 0; t < p.triangles; t++)
        for (size_t c = 0; c < 3; c++) p.triangle[t][c] = corner_of(&patch->vertices[patch->triangles[3 * t + c]]);
    return p;
}

static void plain_free(plain *p) {
    free(p->vertex);
    free(p->triangle);
}

/* In the order of increments, as it is. */
static void check_is(const rqt_patch *mesh, const plain *want, const char *what) {
    plain have = plain_of(mesh);
    CHECK(have.vertices == want->vertices && have.triangles == want->triangles,
          "%s: %zu vertices of %zu, %zu triangles of %zu", what, have.vertices, want->vertices, have.triangles,
          want->triangles);
    for (size_t i = 0; i < have.vertices; i++)
        CHECK(have.vertex[i].code == want->vertex[i].code && have.vertex[i].q == want->vertex[i].q,
              "%s: vertex %zu", what, i);
    for (size_t t = 0; t < have.triangles; t++)
        for (int c = 0; c < 3; c++)
            CHECK(have.triangle[t][c].code == want->triangle[t][c].code, "%s: triangle %zu", what, t);
    plain_free(&have);
}

static void sorted_mesh(world *w, rqt_patch *patch, plain *want) {
    random_mesh(w, patch);
    *want = plain_of(patch);
    qsort(want->vertex, want->vertices, sizeof *want->vertex, by_code);
    qsort(want->triangle, want->triangles, sizeof *want->triangle, by_codes);
    assert_int_equal(rqt_patch_sort(patch), RQT_OK);
    check_is(patch, want, "sorted");
}

static rqt_increment_header some_header(const world *w) {
    return (rqt_increment_header){.note = "a token",
                                  .note_size = 7,
                                  .placement = {1, 2, 3, -4},
                                  .unit = w->m.r.unit,
                                  .eps = 1.5,
                                  .srid = 2056};
}

static uint8_t *encode(const world *w, const rqt_patch *old, const rqt_patch *fresh, size_t *size) {
    const rqt_increment_header header = some_header(w);
    const size_t bound = rqt_increment_bound(old, fresh, header.note_size);
    uint8_t *bytes = malloc(bound);
    if (!bytes) abort();
    assert_int_equal(rqt_increment_encode(&header, old, fresh, &test_allocator, bytes, size), RQT_OK);
    assert_true(*size <= bound);
    return bytes;
}

/* --------------------------------------------------------------------------------------------- promises -- */

static void an_increment_makes_one_mesh_of_another_whatever_they_are(void **state) {
    (void)state;
    random_begin("increments");
    for (int round = 0; round < 120; round++) {
        world w;
        rqt_patch held = {.allocator = test_allocator}, old = {.allocator = test_allocator};
        plain last = {0};
        world_create(&w, random_between(1, 40), random_between(1, 40), random_between(-1, 1) * 5);
        for (int step = 0; step < 5; step++) { /* a client, who knows nothing but increments, follows */
            rqt_patch fresh, next;
            plain want;
            size_t size;
            rqt_increment_header told;
            rqt_message why = {""};
            sorted_mesh(&w, &fresh, &want);
            uint8_t *bytes = encode(&w, step ? &old : NULL, &fresh, &size);
            CHECK(rqt_increment_apply(step ? &held : NULL, bytes, size, &test_allocator, &told, &next, &why) ==
                      RQT_OK,
                  "%s", why.text);
            check_is(&next, &want, "followed");
            assert_int_equal(told.vertex_count, want.vertices);
            assert_int_equal(told.triangle_count, want.triangles);
            assert_memory_equal(told.note, "a token", 7);
            assert_int_equal(told.to, rqt_increment_digest(&fresh));
            assert_int_equal(told.has_frame, step == 0 || last.vertices == 0);
            if (told.has_frame)
                assert_true(told.placement.dy == -4 && told.eps == 1.5 && told.srid == 2056 &&
                            told.unit.d == w.m.r.unit.d);
            for (size_t i = 0; i < next.vertex_count; i++)
                assert_true(next.vertices[i].error == 0 && next.vertices[i].level == 0);
            free(bytes);
            plain_free(&last);
            last = want;
            rqt_patch_free(&held);
            rqt_patch_free(&old);
            held = next;
            old = fresh;
        }
        plain_free(&last);
        rqt_patch_free(&held);
        rqt_patch_free(&old);
        world_free(&w);
    }
}

static void what_has_not_changed_takes_a_header(void **state) {
    (void)state;
    random_begin("unchanged");
    world w;
    rqt_patch mesh, same;
    plain want;
    size_t size;
    rqt_increment_header told;
    world_create(&w, 33, 33, -1);
    sorted_mesh(&w, &mesh, &want);
    const rqt_increment_header header = {.note_size = 0};
    uint8_t *bytes = malloc(rqt_increment_bound(&mesh, &mesh, 0));
    if (!bytes) abort();
    assert_int_equal(rqt_increment_encode(&header, &mesh, &mesh, &test_allocator, bytes, &size), RQT_OK);
    assert_int_equal(size, RQT_INCREMENT_HEADER_BYTES);
    assert_int_equal(rqt_increment_info(bytes, size, &told, NULL), RQT_OK);
    assert_true(told.is_unchanged && told.from == told.to && told.note_size == 0);
    assert_int_equal(rqt_increment_apply(&mesh, bytes, size, &test_allocator, &told, &same, NULL), RQT_OK);
    check_is(&same, &want, "unchanged");
    rqt_patch_free(&same);
    /* and one height, the vertex's own */
    same = mesh;
    same.vertices = malloc(mesh.vertex_count * sizeof *same.vertices);
    if (!same.vertices) abort();
    memcpy(same.vertices, mesh.vertices, mesh.vertex_count * sizeof *same.vertices);
    same.vertices[mesh.vertex_count / 2].q++;
    want.vertex[mesh.vertex_count / 2].q++;
    assert_int_equal(rqt_increment_encode(&header, &mesh, &same, &test_allocator, bytes, &size), RQT_OK);
    assert_true(size < RQT_INCREMENT_HEADER_BYTES + 100);
    rqt_patch other;
    assert_int_equal(rqt_increment_apply(&mesh, bytes, size, &test_allocator, &told, &other, NULL), RQT_OK);
    check_is(&other, &want, "one height");
    rqt_patch_free(&other);
    free(same.vertices);
    free(bytes);
    plain_free(&want);
    rqt_patch_free(&mesh);
    world_free(&w);
}

static void an_increment_of_another_mesh_is_refused(void **state) {
    (void)state;
    random_begin("another mesh");
    world w;
    rqt_patch a, b, out;
    plain want_a, want_b;
    size_t size;
    rqt_increment_header told;
    rqt_message why;
    world_create(&w, 33, 33, -1);
    sorted_mesh(&w, &a, &want_a);
    do {
        sorted_mesh(&w, &b, &want_b);
        if (b.vertex_count != a.vertex_count) break;
        rqt_patch_free(&b);
        plain_free(&want_b);
    } while (true);
    uint8_t *bytes = encode(&w, &a, &b, &size);
    assert_int_equal(rqt_increment_apply(&b, bytes, size, &test_allocator, &told, &out, &why), RQT_INVALID);
    assert_string_equal(why.text, "the increment belongs to another mesh than this one");
    assert_int_equal(rqt_increment_apply(NULL, bytes, size, &test_allocator, &told, &out, &why), RQT_INVALID);
    const rqt_patch huge = {.vertex_count = (size_t)1 << 40};
    assert_int_equal(rqt_increment_encode(&told, NULL, &huge, &test_allocator, bytes, &size), RQT_INVALID);
    free(bytes);
    plain_free(&want_a);
    plain_free(&want_b);
    rqt_patch_free(&a);
    rqt_patch_free(&b);
    world_free(&w);
}

/* ---------------------------------------------------------------------------------------- hostile bytes -- */

/* FORMAT.md, "Checksum". */
static void sign(uint8_t *bytes, size_t size) {
    memset(bytes + 8, 0, 8);
    uint64_t h = UINT64_C(0x9E3779B97F4A7C15) ^ ((uint64_t)size * UINT64_C(0xFF51AFD7ED558CCD));
    for (size_t i = 0; i < size; i += 8) {
        uint64_t word = 0;
        memcpy(&word, bytes + i, size - i < 8 ? size - i : 8);
        h = (h ^ word) * UINT64_C(0xC2B2AE3D27D4EB4F);
        h = h << 29 | h >> 35;
    }
    h = (h ^ h >> 32) * UINT64_C(0xFF51AFD7ED558CCD);
    h ^= h >> 29;
    memcpy(bytes + 8, &h, 8);
}

static rqt_status try(const rqt_patch *old, const uint8_t *bytes, size_t size) {
    uint8_t *exact = malloc(size ? size : 1);
    if (!exact) abort();
    memcpy(exact, bytes, size);
    rqt_increment_header told;
    rqt_message why = {""};
    rqt_patch out;
    const rqt_status status = rqt_increment_apply(old, exact, size, &test_allocator, &told, &out, &why);
    if (status == RQT_OK) {
        assert_string_equal(why.text, "");
        rqt_patch_free(&out);
    } else {
        CHECK(why.text[0] && !out.vertices && !out.triangles, "status %d without a word", (int)status);
        CHECK(status == RQT_CORRUPT || status == RQT_INVALID, "status %d", (int)status);
    }
    free(exact);
    return status;
}

static void F42_damaged_increments_are_refused(void **state) {
    (void)state;
    random_begin("damaged increments");
    world w;
    rqt_patch a, b;
    plain want_a, want_b;
    size_t size;
    world_create(&w, 33, 33, -1);
    sorted_mesh(&w, &a, &want_a);
    sorted_mesh(&w, &b, &want_b);
    for (int kind = 0; kind < 2; kind++) {
        int silent = 0;
        uint8_t *bytes = encode(&w, kind ? &a : NULL, &b, &size), *bad = malloc(size + 1);
        if (!bad) abort();
        assert_int_equal(try(kind ? &a : NULL, bytes, size), RQT_OK);
        for (size_t n = 0; n < size; n++) { /* cut off, with and without a checksum that fits */
            memcpy(bad, bytes, n);
            assert_int_equal(try(kind ? &a : NULL, bad, n), RQT_CORRUPT);
            if (n >= 16) sign(bad, n);
            assert_int_equal(try(kind ? &a : NULL, bad, n), RQT_CORRUPT);
        }
        memcpy(bad, bytes, size);
        bad[size] = 0;
        sign(bad, size + 1);
        assert_int_equal(try(kind ? &a : NULL, bad, size + 1), RQT_CORRUPT);
        for (size_t n = 0; n < size; n++) { /* each byte changed */
            memcpy(bad, bytes, size);
            bad[n] = (uint8_t)(bad[n] ^ random_between(1, 255));
            assert_int_not_equal(try(kind ? &a : NULL, bad, size), RQT_OK);
            sign(bad, size);
            const rqt_status status = try(kind ? &a : NULL, bad, size);
            /* The note, and what places and heights are, are the sender's business; zstd has bits that say nothing.
             */
            if (status == RQT_OK && n >= RQT_INCREMENT_HEADER_BYTES + 80 + 7)
                silent++;
            else
                CHECK(status != RQT_OK ||
                          (n >= RQT_INCREMENT_HEADER_BYTES && n < RQT_INCREMENT_HEADER_BYTES + 80 + 7) ||
                          (n >= 8 && n < 16),
                      "byte %zu of %zu", n, size);
        }
        CHECK(silent < 5, "%d bytes of %zu say nothing", silent, size);
        free(bytes);
        free(bad);
    }
    plain_free(&want_a);
    plain_free(&want_b);
    rqt_patch_free(&a);
    rqt_patch_free(&b);
    world_free(&w);
}

/* An increment by hand: any payload, in a frame that holds it as it is. */
static size_t raw_increment(const rqt_patch *old, const uint8_t *payload, size_t n, uint32_t vertices,
                            uint32_t triangles, uint8_t *bytes) {
    const uint64_t from = rqt_increment_digest(old);
    memset(bytes, 0, RQT_INCREMENT_HEADER_BYTES);
    memcpy(bytes, "RQTI\1", 5);
    memcpy(bytes + 16, &from, 8);
    memcpy(bytes + 32, &vertices, 4);
    memcpy(bytes + 36, &triangles, 4);
    const uint32_t size = (uint32_t)n;
    memcpy(bytes + 44, &size, 4);
    uint8_t *p = bytes + RQT_INCREMENT_HEADER_BYTES;
    const uint8_t head[] = {0x28, 0xB5, 0x2F, 0xFD, 0xA0};
    memcpy(p, head, 5);
    memcpy(p + 5, &size, 4);
    p[9] = (uint8_t)(1 | (n << 3 & 0xFF)); /* the last block, as it is */
    p[10] = (uint8_t)(n >> 5);
    p[11] = (uint8_t)(n >> 13);
    memcpy(p + 12, payload, n);
    const size_t all = RQT_INCREMENT_HEADER_BYTES + 12 + n;
    sign(bytes, all);
    return all;
}

static void F42_payloads_that_lie_are_refused(void **state) {
    (void)state;
    random_begin("payloads that lie");
    const rqt_patch nothing = {.allocator = test_allocator};
    rqt_patch_vertex three_corners[3] = {{.col = 0, .row = 0}, {.col = 1, .row = 0}, {.col = 0, .row = 1}};
    uint32_t triangle[3] = {0, 2, 1};
    const rqt_patch three = {.vertices = three_corners,
                             .vertex_count = 3,
                             .triangles = triangle,
                             .triangle_count = 1,
                             .allocator = test_allocator};
    static const struct {
        const char *what;
        uint8_t bytes[24];
        size_t n;
    } lies[] = {
        {"no counts", {0, 0, 0}, 3},
        {"a number that does not end", {0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0}, 8},
        {"more goes than there is", {4, 0, 0, 0, 0, 0, 0, 0}, 8},
        {"more triangles go than there are", {0, 0, 2, 0, 0, 0}, 6},
        {"more comes than there are bytes", {0, 9, 0, 0, 0, 0}, 6},
        {"more triangles come than there are bytes", {0, 0, 0, 9, 0, 0}, 6},
        {"one goes that is not there", {1, 0, 0, 0, 3}, 5},
        {"a second one goes that is not there", {2, 0, 0, 0, 1, 1}, 6},
        {"a step that is too far", {1, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF, 0x7F}, 9},
        {"a triangle goes that is not there", {0, 0, 1, 0, 1}, 5},
        {"one comes that is there", {0, 1, 0, 0, 0, 0}, 6},
        {"one comes off the grid", {0, 1, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x1F, 0}, 11},
        {"one comes past the last sample", {0, 1, 0, 0, 0x82, 0x80, 0x80, 0x80, 0x80, 0x20, 0}, 11},
        {"one comes past the last row", {0, 1, 0, 0, 0x81, 0x80, 0x80, 0x80, 0x80, 0x40, 0}, 11},
        {"too high", {0, 1, 0, 0, 2, 0x80, 0x80, 0x80, 0x80, 0x08}, 10},
        {"too low", {0, 1, 0, 0, 2, 0xFF, 0xFF, 0xFF, 0xFF, 0x07}, 10},
        {"a triangle comes that is there", {0, 0, 0, 1, 0, 4, 2}, 7},
        {"a triangle comes twice", {0, 0, 0, 2, 1, 2, 1, 0, 2, 1}, 10},
        {"a triangle before the first vertex", {0, 0, 0, 1, 0, 1, 2}, 7},
        {"a triangle past the last vertex", {0, 0, 0, 1, 3, 0, 0}, 7},
        {"a second corner past the last vertex", {0, 0, 0, 1, 0, 6, 2}, 7},
        {"a third corner before the first", {0, 0, 0, 1, 0, 2, 1}, 7},
        {"a third corner past the last vertex", {0, 0, 0, 1, 0, 2, 6}, 7},
        {"bytes are left over", {0, 0, 0, 0, 0}, 5},
        {"a height is missing", {0, 1, 0, 0, 2, 0x80}, 6},
        {"a triangle is missing", {0, 0, 0, 1, 0, 4, 0x80}, 7},
        {"all as promised, but for the digest", {0, 1, 0, 0, 2, 0}, 6},
    };
    uint8_t bytes[200];
    for (size_t n = 0; n < sizeof lies / sizeof *lies; n++) {
        const size_t size = raw_increment(&three, lies[n].bytes, lies[n].n, 4, 1, bytes);
        CHECK(try(&three, bytes, size) == RQT_CORRUPT, "%s", lies[n].what);
    }
    /* from nothing: there is no vertex for a triangle */
    size_t size = raw_increment(&nothing, (const uint8_t[]){0, 0, 0, 1, 0, 0, 0}, 7, 0, 1, bytes);
    assert_int_equal(try(&nothing, bytes, size), RQT_CORRUPT);
    size = raw_increment(&nothing, (const uint8_t[]){0, 0, 0, 0}, 4, 0, 1, bytes);
    assert_int_equal(try(NULL, bytes, size), RQT_CORRUPT);
    /* counts that are not the mesh's */
    size = raw_increment(&three, (const uint8_t[]){0, 0, 0, 0}, 4, 3, 2, bytes);
    assert_int_equal(try(&three, bytes, size), RQT_CORRUPT);
    /* a promise and its fulfilment, by hand: the way the others are made is right */
    size = raw_increment(&three, (const uint8_t[]){0, 0, 0, 0}, 4, 3, 1, bytes);
    memcpy(bytes + 24, bytes + 16, 8);
    sign(bytes, size);
    assert_int_equal(try(&three, bytes, size), RQT_OK);
    bytes[RQT_INCREMENT_HEADER_BYTES + 9] = 7; /* a block of a kind there is none of */
    sign(bytes, size);
    assert_int_equal(try(&three, bytes, size), RQT_CORRUPT);
}

static void refused_memory_is_said_and_nothing_is_kept(void **state) {
    (void)state;
    random_begin("increments without memory");
    world w;
    rqt_patch a, b;
    plain want_a, want_b;
    size_t size = 0;
    world_create(&w, 33, 33, -1);
    sorted_mesh(&w, &a, &want_a);
    sorted_mesh(&w, &b, &want_b);
    uint8_t *bytes = malloc(rqt_increment_bound(&a, &b, 7));
    if (!bytes) abort();
    const rqt_increment_header header = some_header(&w);
    for (size_t n = 1;; n++) {
        rqt_patch fresh, out = {.allocator = test_allocator}, again = {.allocator = test_allocator};
        rqt_increment_header told;
        random_begin("the mesh to sort");
        random_mesh(&w, &fresh);
        const size_t live = test_heap.live, patch_live = live;
        test_heap.fail_from = test_heap.calls + n;
        test_heap.fail_to = test_heap.fail_from;
        test_heap.failures = 0;
        rqt_status status = rqt_patch_sort(&fresh);
        assert_true((status == RQT_OK) == (test_heap.failures == 0) && (status == RQT_OK || !fresh.vertices));
        if (status == RQT_OK) status = rqt_increment_encode(&header, &a, &b, &test_allocator, bytes, &size);
        if (status == RQT_OK) status = rqt_increment_apply(&a, bytes, size, &test_allocator, &told, &out, NULL);
        if (status == RQT_OK) {
            size_t small;
            uint8_t same[200];
            status = rqt_increment_encode(&header, &a, &a, &test_allocator, bytes, &small);
            if (status == RQT_OK) {
                memcpy(same, bytes, small);
                status = rqt_increment_apply(&a, same, small, &test_allocator, &told, &again, NULL);
            }
        }
        assert_int_equal(status, test_heap.failures ? RQT_NO_MEMORY : RQT_OK);
        const bool all = test_heap.failures == 0;
        test_heap.fail_from = test_heap.fail_to = 0;
        rqt_patch_free(&fresh);
        rqt_patch_free(&out);
        rqt_patch_free(&again);
        assert_true(test_heap.live <= patch_live);
        if (all) break;
    }
    free(bytes);
    plain_free(&want_a);
    plain_free(&want_b);
    rqt_patch_free(&a);
    rqt_patch_free(&b);
    world_free(&w);
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(an_increment_makes_one_mesh_of_another_whatever_they_are),
        TEST(what_has_not_changed_takes_a_header),
        TEST(an_increment_of_another_mesh_is_refused),
        TEST(F42_damaged_increments_are_refused),
        TEST(F42_payloads_that_lie_are_refused),
        TEST(refused_memory_is_said_and_nothing_is_kept),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
