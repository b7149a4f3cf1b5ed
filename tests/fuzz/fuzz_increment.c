/* fuzz_increment.c - views that follow one another: increments from mesh to mesh, sound ones, damaged ones, signed
 * again, inside and outside the compressed frame, and any bytes; and the heights of one mesh's vertices on another.
 */
#include "fuzz_terrain.h"

#include <zstd.h>

enum { AT_CHECKSUM = 8, AT_NOTE = 40, AT_PAYLOAD = 44, FRAME = 80 };

/* Of a window at some eps; with leaves, not sorted. */
static bool take_mesh(input *in, const fuzz_terrain *t, pyramid *p, const rqt_allocator *a, fuzz_heap *h,
                      rqt_patch *patch) {
    *patch = (rqt_patch){0};
    rqt_region *region = take_region(in, &t->grid.lattice, a);
    if (!region) return false;
    rqt_query query =
        pyramid_query(t, p, region, take_eps(in), take_between(in, 0, 1) ? RQT_OUTLINE_EXACT : RQT_OUTLINE_TOL);
    query.wants_leaves = true;
    const bool ok = went_well(rqt_query_run(&query, a, patch), h);
    free(query.answers);
    rqt_region_free(region);
    return ok;
}

static void check_sorted(const rqt_patch *p) {
    for (size_t t = 0; t < p->triangle_count; t++)
        for (size_t c = 0; c < 3; c++) HOLD(p->triangles[3 * t + c] < p->vertex_count, "index of triangle %zu", t);
    for (size_t t = 1; t < p->triangle_count; t++)
        HOLD(p->triangles[3 * t - 3] <= p->triangles[3 * t], "triangle %zu comes before the one before", t);
}

static void check_same(const rqt_patch *a, const rqt_patch *b) {
    HOLD(a->vertex_count == b->vertex_count && a->triangle_count == b->triangle_count, "%zu, %zu", a->vertex_count,
         b->vertex_count);
    for (size_t i = 0; i < a->vertex_count; i++)
        HOLD(a->vertices[i].col == b->vertices[i].col && a->vertices[i].row == b->vertices[i].row &&
                 a->vertices[i].q == b->vertices[i].q,
             "vertex %zu", i);
    for (size_t i = 0; i < 3 * a->triangle_count; i++) HOLD(a->triangles[i] == b->triangles[i], "index %zu", i);
}

/* Whatever the bytes are. same: they are an increment that leads there. */
static void apply(const rqt_patch *old, const uint8_t *bytes, size_t size, const rqt_patch *same,
                  const rqt_allocator *a, fuzz_heap *h) {
    uint8_t *exact = exact_copy(bytes, size);
    rqt_increment_header header, again;
    rqt_patch patch = {0};
    rqt_message why = {""};
    const rqt_status info = rqt_increment_info(exact, size, &header, &why);
    HOLD(info == RQT_OK || (info == RQT_CORRUPT && why.text[0]), "status %d", (int)info);
    HOLD(info != RQT_OK || (const uint8_t *)header.note + header.note_size <= exact + size,
         "the note ends behind the bytes");
    const rqt_status status = rqt_increment_apply(old, exact, size, a, &again, &patch, &why);
    HOLD(status == RQT_OK || why.text[0], "status %d without a sentence", (int)status);
    HOLD(status != RQT_NO_MEMORY || h->refuse || info == RQT_OK, "no memory for nothing");
    HOLD(status != RQT_OK || info == RQT_OK, "apply knows better than info");
    HOLD(!same || went_well(status, h) == (status == RQT_OK), "a sound increment is refused");
    if (status == RQT_OK) check_sorted(&patch);
    if (status == RQT_OK && same) check_same(&patch, same);
    rqt_patch_free(&patch);
    free(exact);
}

static void damage(input *in, uint8_t **bytes, size_t *size, bool has_frame) {
    uint32_t note, plain;
    memcpy(&note, *bytes + AT_NOTE, 4);
    memcpy(&plain, *bytes + AT_PAYLOAD, 4);
    const size_t frame = has_frame ? FRAME : 0, at = RQT_INCREMENT_HEADER_BYTES + frame + note;
    if (plain > 0 && take_between(in, 0, 1)) { /* inside */
        uint8_t *inside = malloc(plain), *whole = malloc(at + ZSTD_compressBound(plain));
        if (!inside || !whole) abort();
        const size_t n = ZSTD_decompress(inside, plain, *bytes + at, *size - at);
        HOLD(n == plain, "%zu bytes of %u", n, plain);
        take_damage(in, inside, n);
        memcpy(whole, *bytes, at);
        *size = at + ZSTD_compress(whole + at, ZSTD_compressBound(n), inside, n, 1);
        free(*bytes);
        *bytes = whole;
        free(inside);
    } else {
        take_damage(in, *bytes, *size);
    }
    if (take_between(in, 0, 7) == 0) *size = (size_t)take_bits(in, 3) % (*size + 1);
    fuzz_sign(*bytes, *size, AT_CHECKSUM);
}

/* One mesh after another, as a client follows; then damage. */
static void follow(input *in, const fuzz_terrain *t, const rqt_patch *old, const rqt_patch *fresh,
                   const rqt_allocator *a, fuzz_heap *h) {
    const rqt_increment_header header = {.note = "a note",
                                         .note_size = (size_t)take_between(in, 0, 6),
                                         .placement = {0, 0, 1, 1},
                                         .unit = t->unit,
                                         .eps = take_between(in, 0, 9)};
    const size_t bound = rqt_increment_bound(old, fresh, header.note_size);
    uint8_t *bytes = malloc(bound);
    size_t size;
    if (!bytes) abort();
    if (went_well(rqt_increment_encode(&header, old, fresh, a, bytes, &size), h)) {
        HOLD(size <= bound, "%zu bytes, bound %zu", size, bound);
        apply(old, bytes, size, fresh, a, h);
        apply(fresh, bytes, size, NULL, a, h);
        damage(in, &bytes, &size, !old || old->vertex_count == 0);
        apply(old, bytes, size, NULL, a, h);
    }
    free(bytes);
}

/* Within the heights of the mesh, or none; its own are its own. */
static void morph(const fuzz_terrain *t, const rqt_patch *from, const rqt_patch *patch, const rqt_allocator *a,
                  fuzz_heap *h) {
    const size_t n = patch->vertex_count;
    double *heights = malloc((n + 1) * sizeof *heights);
    uint32_t *ends = malloc((2 * n + 1) * sizeof *ends);
    if (!heights || !ends) abort();
    if (went_well(rqt_morph_heights(&t->grid.lattice, from, patch, a, heights, ends), h))
        for (size_t i = 0; i < n; i++) {
            HOLD(isnan(heights[i]) || fabs(heights[i]) < RQT_HEIGHT_LIMIT, "height %g", heights[i]);
            HOLD(from != patch || heights[i] == patch->vertices[i].q, "vertex %zu is not on its own mesh", i);
            for (int e = 0; e < 2; e++)
                HOLD(ends[2 * i + (size_t)e] < n || ends[2 * i + (size_t)e] == RQT_NO_VERTEX, "end of vertex %zu",
                     i);
        }
    free(heights);
    free(ends);
}

const long fuzz_runs = 400;

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    input in = {data, size};
    fuzz_heap heap;
    static fuzz_terrain t;
    const rqt_allocator a = fuzz_allocator(&heap, &in);
    rqt_errors saturated = {0};
    rqt_patch old = {0}, fresh = {0};
    pyramid p = {0};
    take_terrain(&in, &t);
    if (went_well(rqt_errors_compute(&t.grid, &t.unit, &t.cost, &a, NULL, NULL, &saturated), &heap)) {
        rqt_errors_saturate(&saturated);
        if (went_well(pyramid_make(&t, &saturated, &a, &p), &heap) && take_mesh(&in, &t, &p, &a, &heap, &old) &&
            take_mesh(&in, &t, &p, &a, &heap, &fresh)) {
            morph(&t, &old, &fresh, &a, &heap);
            morph(&t, &fresh, &fresh, &a, &heap);
            if (went_well(rqt_patch_sort(&old), &heap) && went_well(rqt_patch_sort(&fresh), &heap)) {
                check_sorted(&fresh);
                HOLD(rqt_increment_digest(&old) == rqt_increment_digest(&old), "a digest changes");
                follow(&in, &t, take_between(&in, 0, 2) ? &old : NULL, &fresh, &a, &heap);
                apply(&old, in.bytes, in.size, NULL, &a, &heap);
            }
        }
        pyramid_free(&p, &a);
    }
    rqt_patch_free(&old);
    rqt_patch_free(&fresh);
    rqt_errors_free(&saturated, &a);
    HOLD(heap.live == 0, "%zu bytes leaked", heap.live);
    return 0;
}
