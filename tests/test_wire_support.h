/* test_wire_support.h - what the test programs of the wire format share: patches of queries over blocks, their
 * bytes, comparing patches, and bytes with a right checksum over what is wrong. */
#ifndef TEST_WIRE_SUPPORT_H
#define TEST_WIRE_SUPPORT_H

#include "test_core_walk.h"

#include <zstd.h>
static const rqt_placement SOMEWHERE = {12.5, -3, 0.25, -0.5};
#define EPS(code) rqt_code_metres((rqt_code)(code))

/* A patch with leaves, the blocks that it came from, and its header. */
typedef struct answer {
    rqt_patch patch;
    rqt_block_number *numbers;
    size_t count;
    rqt_wire_header header;
} answer;

static inline answer ask(database *d, const model *m, const rqt_region *region, rqt_code eps, rqt_outline outline) {
    rqt_answer *answers = calloc(d->count ? d->count : 1, sizeof *answers);
    answer out = {.numbers = calloc(d->count + 1, sizeof *out.numbers)};
    if (!answers || !out.numbers) abort();
    rqt_query query = {.lattice = d->lattice,
                       .k = d->k,
                       .region = region,
                       .eps = eps,
                       .outline = outline,
                       .wants_leaves = true,
                       .answers = answers,
                       .answer_count = database_answers(d, region, eps, outline, answers),
                       .read_block = database_read,
                       .context = d};
    d->asking = &query;
    assert_int_equal(rqt_query_run(&query, &test_allocator, &out.patch), RQT_OK);
    d->asking = NULL;
    out.count = query.answer_count;
    for (size_t i = 0; i < out.count; i++) out.numbers[i] = answers[i].number;
    free(answers);
    out.header = (rqt_wire_header){
        .lattice = d->lattice, .k = d->k, .placement = SOMEWHERE, .unit = m->r.unit, .eps = EPS(eps), .srid = 4711};
    return out;
}

static inline void answer_free(answer *a) {
    rqt_patch_free(&a->patch);
    free(a->numbers);
}

/* Bytes in an allocation of exactly their size. */
typedef struct blob {
    uint8_t *bytes;
    size_t size;
} blob;

static inline blob blob_of(const uint8_t *bytes, size_t size) {
    blob b = {malloc(size ? size : 1), size};
    if (!b.bytes) abort();
    memcpy(b.bytes, bytes, size);
    return b;
}

static inline blob encode_as(const answer *a, const answer *from, const char *what) {
    const size_t bound = rqt_wire_bound(a->patch.vertex_count, a->patch.triangle_count, a->count);
    rqt_wire_header header = a->header;
    uint8_t *bytes = malloc(bound);
    size_t size = 1;
    if (!bytes) abort();
    if (from) header.eps_from = from->header.eps;
    const rqt_status status = rqt_wire_encode(&header, a->numbers, a->count, &a->patch, from ? &from->patch : NULL,
                                              &test_allocator, bytes, &size);
    CHECK(status == RQT_OK, "%s: encode: status %d", what, (int)status);
    CHECK(size <= bound, "%zu bytes, bound %zu", size, bound);
    blob b = blob_of(bytes, size);
    free(bytes);
    return b;
}

static inline blob encode(const answer *a, const answer *from) {
    return encode_as(a, from, "a mesh");
}

static inline void check_same_patch(const rqt_patch *a, const rqt_patch *b, const char *what) {
    CHECK(a->vertex_count == b->vertex_count && a->triangle_count == b->triangle_count,
          "%s: %zu vertices, %zu triangles; should be %zu, %zu", what, a->vertex_count, a->triangle_count,
          b->vertex_count, b->triangle_count);
    for (size_t i = 0; i < a->vertex_count; i++) {
        const rqt_patch_vertex *v = &a->vertices[i], *w = &b->vertices[i];
        CHECK(v->col == w->col && v->row == w->row && v->q == w->q && v->level == w->level,
              "%s: vertex %zu is (%d,%d) %d level %d; should be (%d,%d) %d level %d", what, i, v->col, v->row, v->q,
              v->level, w->col, w->row, w->q, w->level);
    }
    for (size_t i = 0; i < 3 * a->triangle_count; i++)
        CHECK(a->triangles[i] == b->triangles[i], "%s: triangle %zu", what, i / 3);
    for (size_t i = 0; a->leaves && b->leaves && i < a->triangle_count; i++)
        CHECK(memcmp(&a->leaves[i], &b->leaves[i], sizeof *a->leaves) == 0, "%s: leaf %zu", what, i);
}

static inline raster random_raster(int n) {
    static const int sides[] = {1, 2, 3, 4, 5, 8, 9, 15, 16, 17, 18, 31, 33, 34};
    const int odd = random_between(0, 13), other = random_between(0, 2) ? odd : random_between(0, 13);
    const int voids[] = {-1, -1, 0, 2, 20, 100};
    raster r = raster_make((surface)(n % SURFACE_COUNT), sides[odd], sides[other], voids[random_between(0, 5)]);
    if (random_between(0, 2) == 0) raster_add_lake(&r);
    return r;
}

/* FORMAT.md, "Checksum", of bytes whose checksum is at 8. */
static inline void seal(blob *b) {
    memset(b->bytes + 8, 0, 8);
    uint64_t h = 0x9E3779B97F4A7C15U ^ (uint64_t)b->size * 0xFF51AFD7ED558CCDU;
    for (size_t at = 0; at < b->size; at += 8) {
        uint64_t word = 0;
        memcpy(&word, b->bytes + at, b->size - at < 8 ? b->size - at : 8);
        h = (h ^ word) * 0xC2B2AE3D27D4EB4FU;
        h = h << 29 | h >> 35;
    }
    h = (h ^ h >> 32) * 0xFF51AFD7ED558CCDU;
    h ^= h >> 29;
    memcpy(b->bytes + 8, &h, 8);
}

static size_t taken, refused;

/* Whatever they are: OK with a patch that is sound, or CORRUPT; of an increment INVALID too. */
static inline void read_hostile(const blob *b, const answer *from) {
    rqt_wire_header header;
    rqt_patch patch;
    rqt_message why;
    memset(&patch, 0xA5, sizeof patch);
    const rqt_status status =
        from
            ? rqt_wire_apply(&from->header, &from->patch, b->bytes, b->size, &test_allocator, &header, &patch, &why)
            : rqt_wire_decode(b->bytes, b->size, random_between(0, 1), &test_allocator, &header, &patch, &why);
    if (status == RQT_OK) {
        taken++;
        for (size_t i = 0; i < 3 * patch.triangle_count; i++)
            CHECK(patch.triangles[i] < patch.vertex_count, "index %zu", i);
        for (size_t i = 0; i < patch.vertex_count; i++) {
            const rqt_patch_vertex *v = &patch.vertices[i];
            CHECK(v->col >= 0 && v->row >= 0 && v->col < header.lattice.width && v->row < header.lattice.height &&
                      abs(v->q) < RQT_HEIGHT_LIMIT && v->level <= header.lattice.K,
                  "vertex %zu", i);
        }
    } else {
        refused++;
        CHECK(status == RQT_CORRUPT || status == RQT_INVALID, "status %d", (int)status);
        CHECK(why.text[0], "no sentence");
        assert_true(patch.vertices == NULL && patch.vertex_count == 0);
    }
    rqt_patch_free(&patch);
}

/* Another one, or one bit of it. */
static inline uint8_t changed_byte(uint8_t byte, int bit) {
    if (random_between(0, 1)) return (uint8_t)random_bits();
    return (uint8_t)(byte ^ 1 << bit);
}

#endif
