/* fuzz_wire.c - meshes as bytes, 'rqt' with normals and errors or without, increments, 'strip' and 'indexed': those
 * of queries come back as they were; damaged ones, signed again, inside and outside the compressed frame, and any
 * bytes, are refused or are meshes. */
#include "fuzz_terrain.h"

#include <zstd.h>

typedef struct wire {
    rqt_patch patch;
    rqt_wire_header header;
    uint8_t *bytes;
    size_t size;
} wire;

static void check_mesh(const rqt_patch *p) {
    for (size_t i = 0; i < 3 * p->triangle_count; i++) HOLD(p->triangles[i] < p->vertex_count, "index %zu", i);
}

/* What there is: unit vectors that do not point down. */
static void read_normals(const uint8_t *bytes, size_t size, const rqt_wire_header *header, size_t vertices,
                         const rqt_allocator *a) {
    float *normals = malloc(3 * vertices * sizeof *normals + 1);
    if (!normals) abort();
    rqt_message why = {""};
    const rqt_status status = rqt_wire_normals(bytes, size, vertices, a, normals, &why);
    HOLD(status == RQT_OK || why.text[0], "status %d without a sentence", (int)status);
    HOLD(status == RQT_OK || status == RQT_CORRUPT || status == RQT_NO_MEMORY ||
             (status == RQT_INVALID && !header->has_normals),
         "status %d", (int)status);
    HOLD(status != RQT_OK || header->has_normals, "normals out of nothing");
    for (size_t i = 0; status == RQT_OK && i < vertices; i++) {
        const float *n = normals + 3 * i;
        HOLD(fabs(sqrt((double)n[0] * n[0] + (double)n[1] * n[1] + (double)n[2] * n[2]) - 1) < 1e-6 &&
                 n[2] > -1e-6f,
             "(%g,%g,%g)", n[0], n[1], n[2]);
    }
    HOLD(rqt_wire_normals(bytes, size, vertices + 1, a, normals, &why) != RQT_OK, "normals of another number");
    free(normals);
}

static void one_normal(input *in, float normal[3]) {
    double v[3] = {take_between(in, -99, 99), take_between(in, -99, 99), take_between(in, 0, 99)};
    const double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    if (length == 0) v[2] = 1;
    for (int c = 0; c < 3; c++) normal[c] = (float)(v[c] / (length > 0 ? length : 1));
}

static void decode(input *in, const uint8_t *bytes, size_t size, const wire *state, const rqt_allocator *a,
                   fuzz_heap *h) {
    uint8_t *exact = exact_copy(bytes, size);
    rqt_wire_header header, again;
    rqt_patch patch = {0};
    rqt_message why = {""};
    const rqt_status info = rqt_wire_info(exact, size, &header, &why);
    HOLD(info == RQT_OK || (info == RQT_CORRUPT && why.text[0]), "status %d", (int)info);
    why.text[0] = 0;
    rqt_status status = rqt_wire_decode(exact, size, take_between(in, 0, 1) != 0, a, &again, &patch, &why);
    HOLD(status == RQT_OK || status == RQT_NO_MEMORY ||
             ((status == RQT_CORRUPT || status == RQT_INVALID) && why.text[0]),
         "status %d", (int)status);
    HOLD(status != RQT_OK || info == RQT_OK, "decode knows better than info");
    HOLD(status != RQT_NO_MEMORY || h->refuse || info == RQT_OK, "no memory for nothing");
    if (status == RQT_OK) check_mesh(&patch);
    if (status == RQT_OK) read_normals(exact, size, &again, patch.vertex_count, a);
    rqt_patch_free(&patch);
    if (state) {
        why.text[0] = 0;
        status = rqt_wire_apply(&state->header, &state->patch, exact, size, a, &again, &patch, &why);
        HOLD(status == RQT_OK || status == RQT_NO_MEMORY || why.text[0], "status %d", (int)status);
        if (status == RQT_OK) {
            check_mesh(&patch);
            (void)rqt_wire_digest(&patch);
        }
        rqt_patch_free(&patch);
    }
    free(exact);
}

static bool make(const fuzz_terrain *t, pyramid *p, const rqt_region *region, rqt_code eps, const wire *from,
                 const rqt_allocator *a, fuzz_heap *h, wire *out) {
    *out = (wire){0};
    rqt_query query = pyramid_query(t, p, region, eps, RQT_OUTLINE_EXACT);
    query.wants_leaves = true;
    bool ok = went_well(rqt_query_run(&query, a, &out->patch), h);
    if (ok) {
        rqt_block_number *numbers = calloc(query.answer_count + 1, sizeof *numbers);
        if (!numbers) abort();
        for (size_t i = 0; i < query.answer_count; i++) numbers[i] = query.answers[i].number;
        out->header = (rqt_wire_header){.lattice = t->grid.lattice,
                                        .k = t->k,
                                        .placement = {0, 0, 1, 1},
                                        .unit = t->unit,
                                        .eps = rqt_code_metres(eps),
                                        .eps_from = from ? from->header.eps : 0};
        const size_t bound = rqt_wire_bound(out->patch.vertex_count, out->patch.triangle_count, query.answer_count);
        out->bytes = malloc(bound);
        if (!out->bytes) abort();
        ok = went_well(rqt_wire_encode(&out->header, numbers, query.answer_count, &out->patch,
                                       from ? &from->patch : NULL, a, out->bytes, &out->size),
                       h);
        HOLD(!ok || out->size <= bound, "%zu bytes, bound %zu", out->size, bound);
        free(numbers);
    }
    free(query.answers);
    return ok;
}

static void drop(wire *w) {
    rqt_patch_free(&w->patch);
    free(w->bytes);
    *w = (wire){0};
}

static void damage(input *in, wire *w) {
    enum { AT_CHECKSUM = 8, HEADER = RQT_WIRE_HEADER_BYTES };
    const unsigned long long room = ZSTD_getFrameContentSize(w->bytes + HEADER, w->size - HEADER);
    if (take_between(in, 0, 1) && room < 1 << 20) {
        uint8_t *inside = malloc(room + 1), *whole = malloc(HEADER + ZSTD_compressBound(room));
        if (!inside || !whole) abort();
        const size_t n = ZSTD_decompress(inside, room, w->bytes + HEADER, w->size - HEADER);
        if (!ZSTD_isError(n)) {
            take_damage(in, inside, n);
            memcpy(whole, w->bytes, HEADER);
            w->size = HEADER + ZSTD_compress(whole + HEADER, ZSTD_compressBound(n), inside, n, 1);
            free(w->bytes);
            w->bytes = whole;
            whole = NULL;
        }
        free(inside);
        free(whole);
    }
    take_damage(in, w->bytes, take_between(in, 0, 1) ? HEADER : w->size);
    if (take_between(in, 0, 7) == 0) w->size = (size_t)take_bits(in, 3) % (w->size + 1);
    fuzz_sign(w->bytes, w->size, AT_CHECKSUM);
}

/* Normals beside a mesh, which stays as it is; damaged, they are refused or are normals. */
static void add_normals(input *in, const wire *w, const rqt_allocator *a, fuzz_heap *h) {
    const size_t n = w->patch.vertex_count, bound = w->size + rqt_wire_normals_bound(n);
    float *normals = malloc(3 * n * sizeof *normals + 1), *back = malloc(3 * n * sizeof *back + 1);
    wire with = {.bytes = malloc(bound), .size = w->size};
    if (!normals || !back || !with.bytes) abort();
    memcpy(with.bytes, w->bytes, w->size);
    for (size_t i = 0; i < n; i++) one_normal(in, normals + 3 * i);
    HOLD(rqt_wire_add_normals(normals, n + 1, a, with.bytes, &with.size) == RQT_INVALID, "one too many");
    if (went_well(rqt_wire_add_normals(normals, n, a, with.bytes, &with.size), h)) {
        rqt_message why;
        HOLD(with.size <= bound, "%zu bytes, bound %zu", with.size, bound);
        HOLD(rqt_wire_add_normals(normals, n, a, with.bytes, &with.size) == RQT_INVALID, "twice");
        if (went_well(rqt_wire_normals(with.bytes, with.size, n, a, back, &why), h))
            for (size_t i = 0; i < n; i++) {
                double cosine = 0;
                for (size_t c = 0; c < 3; c++) cosine += (double)normals[3 * i + c] * back[3 * i + c];
                HOLD(cosine > 0.99995, "normal %zu comes back %g degrees off", i, acos(cosine) * 57.3);
                int8_t packed[2], again[2];
                float one[3];
                rqt_normal_pack(normals + 3 * i, packed);
                rqt_normal_unpack(packed, one);
                rqt_normal_pack(one, again);
                HOLD(memcmp(one, back + 3 * i, sizeof one) == 0 && memcmp(packed, again, sizeof packed) == 0,
                     "normal %zu is packed otherwise alone", i);
            }
        decode(in, with.bytes, with.size, NULL, a, h);
        /* the mesh's frame is left alone: what is hit is the header and the normals */
        take_damage(in, with.bytes + w->size, with.size - w->size);
        if (take_between(in, 0, 3) == 0) take_damage(in, with.bytes, RQT_WIRE_HEADER_BYTES);
        if (take_between(in, 0, 3) == 0) with.size -= (size_t)take_bits(in, 3) % (with.size - w->size + 1);
        fuzz_sign(with.bytes, with.size, 8);
        decode(in, with.bytes, with.size, NULL, a, h);
    }
    free(normals);
    free(back);
    free(with.bytes);
}

/* The mesh again, with the errors that it is said to have. */
static void read_errors(const wire *with, const rqt_allocator *a, fuzz_heap *h) {
    rqt_wire_header header;
    rqt_patch patch = {0};
    rqt_message why;
    if (went_well(rqt_wire_decode(with->bytes, with->size, true, a, &header, &patch, &why), h)) {
        HOLD(header.has_errors && patch.vertex_count == with->patch.vertex_count, "%zu vertices",
             patch.vertex_count);
        for (size_t i = 0; i < patch.vertex_count; i++)
            HOLD(patch.vertices[i].error == with->patch.vertices[i].error, "vertex %zu: code %d, had %d", i,
                 patch.vertices[i].error, with->patch.vertices[i].error);
    }
    rqt_patch_free(&patch);
}

/* Errors behind a mesh, some of them as no terrain has them; damaged, plain or compressed, they are refused or
 * read. */
static void add_errors(input *in, const wire *w, const rqt_allocator *a, fuzz_heap *h) {
    const size_t n = w->patch.vertex_count, bound = w->size + rqt_wire_errors_bound(n);
    wire with = {.patch = w->patch, .bytes = malloc(bound), .size = w->size};
    with.patch.vertices = malloc(n * sizeof *with.patch.vertices + 1);
    if (!with.bytes || !with.patch.vertices) abort();
    memcpy(with.bytes, w->bytes, w->size);
    if (n > 0) memcpy(with.patch.vertices, w->patch.vertices, n * sizeof *with.patch.vertices);
    for (int odd = take_between(in, 0, 9); odd > 0 && n > 0; odd--)
        with.patch.vertices[take_bits(in, 2) % n].error = (rqt_code)take_bits(in, 2);
    if (went_well(rqt_wire_add_errors(&with.patch, a, with.bytes, &with.size), h)) {
        HOLD(with.size <= bound, "%zu bytes, bound %zu", with.size, bound);
        HOLD(rqt_wire_add_errors(&with.patch, a, with.bytes, &with.size) == RQT_INVALID || h->refuse, "twice");
        read_errors(&with, a, h);
        uint8_t *const frame = with.bytes + w->size;
        const size_t size = with.size - w->size, room = (size_t)ZSTD_getFrameContentSize(frame, size);
        uint8_t *plain = malloc(room + 1);
        if (!plain) abort();
        if (take_between(in, 0, 1)) {
            HOLD(ZSTD_decompress(plain, room, frame, size) == room, "no frame");
            take_damage(in, plain, room);
            const size_t again = ZSTD_compress(frame, bound - w->size, plain, room, 1);
            if (!ZSTD_isError(again)) with.size = w->size + again;
        } else {
            take_damage(in, frame, size);
            if (take_between(in, 0, 3) == 0) with.size -= (size_t)take_bits(in, 3) % (size + 1);
        }
        if (take_between(in, 0, 3) == 0) take_damage(in, with.bytes, RQT_WIRE_HEADER_BYTES);
        fuzz_sign(with.bytes, with.size, 8);
        decode(in, with.bytes, with.size, NULL, a, h);
        free(plain);
    }
    free(with.patch.vertices);
    free(with.bytes);
}

static void own_formats(input *in, const wire *w) {
    const rqt_mesh_header header = {.kind = RQT_MESH_INDEXED,
                                    .vertex_count = w->patch.vertex_count,
                                    .index_count = 3 * w->patch.triangle_count,
                                    .placement = {0, 0, 1, 1},
                                    .unit = w->header.unit};
    size_t size = rqt_mesh_bytes(&header);
    uint8_t *bytes = malloc(size);
    if (!bytes) abort();
    rqt_mesh_header back;
    const uint8_t *vertices, *indices;
    rqt_mesh_encode(&header, w->patch.vertices, w->patch.triangles, bytes);
    HOLD(rqt_mesh_decode(bytes, size, &back, &vertices, &indices) == RQT_OK &&
             back.vertex_count == header.vertex_count,
         "own bytes");
    take_damage(in, bytes, size);
    if (take_between(in, 0, 7) == 0) size = (size_t)take_bits(in, 3) % (size + 1);
    fuzz_sign(bytes, size, 8);
    uint8_t *exact = exact_copy(bytes, size);
    if (rqt_mesh_decode(exact, size, &back, &vertices, &indices) == RQT_OK)
        for (uint64_t i = 0; i < back.index_count; i++) {
            uint32_t index;
            memcpy(&index, indices + 4 * i, 4);
            HOLD(index < back.vertex_count, "index %llu", (unsigned long long)i);
        }
    free(exact);
    free(bytes);
}

const long fuzz_runs = 600;

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    input in = {data, size};
    fuzz_heap heap;
    static fuzz_terrain t;
    const rqt_allocator a = fuzz_allocator(&heap, &in);
    if (take_between(&in, 0, 7) == 0) {
        decode(&in, in.bytes, in.size, NULL, &a, &heap);
        rqt_mesh_header header;
        const uint8_t *vertices, *indices;
        (void)rqt_mesh_decode(in.bytes, in.size, &header, &vertices, &indices);
    } else {
        rqt_errors e = {0};
        pyramid p = {0};
        rqt_region *region = NULL;
        take_terrain(&in, &t);
        if (went_well(rqt_errors_compute(&t.grid, &t.unit, &t.cost, &a, NULL, NULL, &e), &heap)) {
            rqt_errors_saturate(&e);
            if (went_well(pyramid_make(&t, &e, &a, &p), &heap)) region = take_region(&in, &t.grid.lattice, &a);
        }
        if (region) {
            wire coarse = {0}, fine = {0};
            const rqt_code one = take_eps(&in), two = take_eps(&in), high = one > two ? one : two,
                           low = one > two ? two : one;
            if (make(&t, &p, region, high, NULL, &a, &heap, &coarse) &&
                make(&t, &p, region, low, &coarse, &a, &heap, &fine)) {
                rqt_wire_header header;
                rqt_patch patch = {0};
                rqt_message why;
                if (went_well(rqt_wire_apply(&coarse.header, &coarse.patch, fine.bytes, fine.size, &a, &header,
                                             &patch, &why),
                              &heap))
                    HOLD(rqt_wire_digest(&patch) == rqt_wire_digest(&fine.patch),
                         "an increment ends somewhere else");
                rqt_patch_free(&patch);
                own_formats(&in, &fine);
                add_normals(&in, &coarse, &a, &heap);
                add_errors(&in, &coarse, &a, &heap);
                damage(&in, &coarse);
                decode(&in, coarse.bytes, coarse.size, NULL, &a, &heap);
                damage(&in, &fine);
                decode(&in, fine.bytes, fine.size, &coarse, &a, &heap);
            }
            drop(&coarse);
            drop(&fine);
        }
        rqt_region_free(region);
        pyramid_free(&p, &a);
        rqt_errors_free(&e, &a);
    }
    HOLD(heap.live == 0, "%zu bytes leaked", heap.live);
    return 0;
}
