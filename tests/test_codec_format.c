/* test_codec_format.c - promises of the stored bytes as FORMAT.md has them: a second decoder, written from it,
 * reads every block alike; block summaries and meshes come back as they went in, and none that is damaged or lies
 * gets past a reader; the checksum is what it has always been; and sentences fit their room. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <zstd.h>

#include "internal.h"
#include "test_codec_support.h"

enum { AT_SUMMARY_CHECKSUM = 8, AT_MESH_CHECKSUM = 8 };

/* ----------------------------------------------------------------------------------------- reference --
 * FORMAT.md once more, word by word and without a thought for speed. What is stored must stay readable: code that
 * predicts otherwise would still pass every round trip. */
static uint32_t plane_value(const uint8_t *p, size_t plane, int planes, size_t at) {
    uint32_t v = 0;
    for (int n = 0; n < planes; n++) v |= (uint32_t)p[(size_t)n * plane + at] << 8 * n;
    return v;
}

static uint32_t unzigzag(uint32_t v) {
    return v % 2 ? 0 - v / 2 - 1 : v / 2;
}

/* The smallest code that is not below `halves` half quanta (or quarters). */
static uint32_t reference_length(uint32_t t, double quantum, bool quarters) {
    double h = quantum * (0.5 - ldexp(1, -21));
    h = h < ldexp(1, -90) ? ldexp(1, -90) : h > ldexp(1, 90) ? ldexp(1, 90) : h;
    const float v = fabsf((float)(int32_t)t) * ((float)h / (quarters ? 2 : 1));
    uint32_t code = 0;
    if (v > 0) /* the smallest code c with (128 + c % 128) * 2^(c / 128 - 263) >= v */
        for (code = (uint32_t)(ilogb(v) + 256) * 128; ldexp(128 + code % 128, (int)(code / 128) - 263) < v;) code++;
    return code;
}

typedef struct reference {
    rqt_block_header h;
    rqt_block *b;
    int n;
    /* the vertex at hand */
    int x, y, q;
    bool centre, own; /* own: the block's */
    int end[2][2], apex[2][2], apexes;
    int child[4][2], children;
} reference;

static int at_of(const reference *r, const int p[2]) {
    return p[1] * r->n + p[0];
}
static bool in_block(const reference *r, int x, int y) {
    return x >= 0 && y >= 0 && x < r->n && y < r->n;
}

static void reference_vertex(reference *r, int x, int y, int q) {
    const int n = r->n;
    r->x = x, r->y = y, r->q = q;
    r->centre = x / q % 2 && y / q % 2;
    r->own = r->centre && 2 * q == n - 1;
    r->apexes = r->children = 0;
    int dx = x / q % 2 ? q : 0, dy = x / q % 2 ? 0 : q, ax = dy, ay = dx; /* to an end, to an apex */
    if (r->centre) {
        const bool alike = (x - q) / (2 * q) % 2 == (y - q) / (2 * q) % 2;
        dx = q, dy = alike ? q : -q, ax = q, ay = -dy;
    }
    for (int c = -1; c <= 1; c += 2) {
        r->end[c > 0][0] = x + c * dx, r->end[c > 0][1] = y + c * dy;
        if (!in_block(r, x + c * ax, y + c * ay)) continue;
        r->apex[r->apexes][0] = x + c * ax, r->apex[r->apexes++][1] = y + c * ay;
    }
    for (int c = 0; c < 4; c++) {
        static const int beside[4][2] = {{0, -1}, {-1, 0}, {1, 0}, {0, 1}};
        const int cx = r->centre ? x + q * beside[c][0] : x + (c % 2 ? q / 2 : -q / 2);
        const int cy = r->centre ? y + q * beside[c][1] : y + (c / 2 ? q / 2 : -q / 2);
        if ((!r->centre && q == 1) || !in_block(r, cx, cy)) continue;
        r->child[r->children][0] = cx, r->child[r->children++][1] = cy;
    }
}

static bool is_beyond(const reference *r) {
    return r->x - r->q >= r->h.width - 1 || r->y - r->q >= r->h.height - 1;
}

static bool expects_outline(const reference *r) {
    const uint8_t *flags = r->b->flags, own = flags[r->y * r->n + r->x];
    for (int c = 0; c < r->children; c++)
        if (flags[at_of(r, r->child[c])] & RQT_OUTLINE) return true;
    if (is_beyond(r)) return false;
    for (int c = 0; c < r->apexes + 2; c++) {
        const int *p = c < 2 ? r->end[c] : r->apex[c - 2];
        if ((flags[at_of(r, p)] ^ own) & RQT_VALID) return true;
    }
    return false;
}

/* 4 times the height at (x,y) from the plane through the ends and an apex, all heights weighed as FORMAT.md says.
 */
static void quarter(const reference *r, int x, int y, const int *apex, int of_e, int of_f, uint32_t *most) {
    const int32_t *q = r->b->q;
    uint32_t t = 4 * (uint32_t)q[y * r->n + x] - (uint32_t)of_e * (uint32_t)q[at_of(r, r->end[0])] -
                 (uint32_t)of_f * (uint32_t)q[at_of(r, r->end[1])];
    if (apex) t -= (uint32_t)(4 - of_e - of_f) * (uint32_t)q[at_of(r, apex)];
    if (t >> 31) t = 0 - t;
    if (t > *most) *most = t;
}

static uint32_t reference_own(const reference *r) {
    const int32_t *q = r->b->q;
    const int at = r->y * r->n + r->x, flags = r->b->flags[at];
    if (flags & RQT_OUTLINE) {
        uint32_t code = r->h.ground;
        for (int s = 1; s < r->q && code; s *= 2) code += 128;
        return code > 65535 ? 65535 : code;
    }
    const uint32_t least = r->h.sparse ? r->h.floor + 1u : 0;
    if (!(flags & RQT_VALID) || r->own || (!r->h.sparse && is_beyond(r))) return least;
    const int *e = r->end[0], *f = r->end[1];
    uint32_t code;
    if (r->q == 2 && !r->h.sparse) {
        uint32_t most = 0;
        quarter(r, r->x, r->y, NULL, 2, 2, &most);
        quarter(r, (r->x + e[0]) / 2, (r->y + e[1]) / 2, NULL, 3, 1, &most);
        quarter(r, (r->x + f[0]) / 2, (r->y + f[1]) / 2, NULL, 1, 3, &most);
        for (int c = 0; c < r->apexes; c++) {
            const int *a = r->apex[c];
            quarter(r, (r->x + a[0]) / 2, (r->y + a[1]) / 2, a, 1, 1, &most);
            if (!r->centre) continue;
            quarter(r, (a[0] + e[0]) / 2 + (f[0] - a[0]) / 4, (a[1] + e[1]) / 2 + (f[1] - a[1]) / 4, a, 2, 1,
                    &most);
            quarter(r, (a[0] + f[0]) / 2 + (e[0] - a[0]) / 4, (a[1] + f[1]) / 2 + (e[1] - a[1]) / 4, a, 1, 2,
                    &most);
        }
        code = reference_length(most, r->h.quantum, true);
    } else {
        code = reference_length(2 * (uint32_t)q[at] - (uint32_t)q[at_of(r, e)] - (uint32_t)q[at_of(r, f)],
                                r->h.quantum, false);
    }
    return code > least ? code : least;
}

static void reference_error(reference *r, uint32_t residual) {
    uint32_t p = reference_own(r);
    for (int c = 0; c < r->children; c++)
        if (r->b->error[at_of(r, r->child[c])] > p) p = r->b->error[at_of(r, r->child[c])];
    r->b->error[r->y * r->n + r->x] = (rqt_code)(p + unzigzag(residual));
}

static void reference_whole(reference *r, const uint8_t *payload) {
    const rqt_block_header h = r->h;
    const int n = r->n;
    rqt_block *block = r->b;
    const size_t stored = (size_t)(h.width * h.height), count = count_of(h.k), half = (size_t)(n - 1) / 2;
    const size_t finest = half * (3 * half + 2), others = count - 4 - finest;
    const uint8_t *finest_at = payload + stored * (size_t)h.height_planes;
    const uint8_t *others_at = finest_at + finest * (size_t)h.finest_planes;
    const uint8_t *bits = others_at + others * (size_t)h.error_planes;
    int32_t *q = block->q;
    for (int y = 0; y < n; y++)
        for (int x = 0; x < n; x++) {
            const int at = y * n + x;
            if (x >= h.width || y >= h.height) {
                const int from = (y < h.height ? y : h.height - 1) * n + (x < h.width ? x : h.width - 1);
                q[at] = q[from];
                block->flags[at] = block->flags[from];
                continue;
            }
            int64_t p = x ? q[at - 1] : y ? q[at - n] : 0;
            if (x && y) {
                const int64_t above = q[at - n], left = q[at - n - 1],
                              right = x == h.width - 1 ? above : q[at - n + 1];
                const int64_t sum = (int32_t)(uint32_t)(2 * above - 3 * left + right);
                p += (sum - (sum % 4 + 4) % 4) / 4;
            }
            const size_t i = (size_t)(y * h.width + x);
            q[at] = (int32_t)((uint32_t)p + unzigzag(plane_value(payload, stored, h.height_planes, i)));
            block->flags[at] = (uint8_t)(h.has_voids ? bits[i / 8] >> i % 8 & 1 : !h.all_void);
        }
    if (h.has_voids) bits += (stored + 7) / 8;
    memset(block->error, 0, count * sizeof *block->error);
    size_t next = 0;
    for (int step = 1; step < n - 1; step *= 2)
        for (int centre = 0; centre < 2; centre++)
            for (int y = 0; y < n; y += step)
                for (int x = 0; x < n; x += step) {
                    if (x / step % 2 + y / step % 2 != 1 + centre) continue;
                    const int at = y * n + x;
                    reference_vertex(r, x, y, step);
                    if (h.has_outline && expects_outline(r) != (bits[at / 8] >> at % 8 & 1))
                        block->flags[at] |= RQT_OUTLINE;
                    reference_error(r, next < finest
                                           ? plane_value(finest_at, finest, h.finest_planes, next)
                                           : plane_value(others_at, others, h.error_planes, next - finest));
                    next++;
                }
    assert_int_equal(next, count - 4);
}

static void reference_sparse(reference *r, const uint8_t *payload) {
    const rqt_block_header h = r->h;
    rqt_block *block = r->b;
    const int n = r->n, last = n - 1;
    const size_t count = count_of(h.k);
    const uint8_t *errors_at = payload + h.kept * (size_t)h.height_planes;
    const uint8_t *valid = errors_at + (h.kept - 4) * (size_t)h.error_planes;
    const uint8_t *outline = valid + (h.has_voids ? (h.kept + 7) / 8 : 0);
    const uint8_t *bits = outline + (h.has_outline ? (h.kept - 4 + 7) / 8 : 0);
    int(*list)[3] = take((count + 4) * sizeof *list); /* x, y, q */
    int *offers = take(count * sizeof *offers);
    size_t listed = 0, bit = 0;
    memset(offers, 0, count * sizeof *offers);
    memset(block->q, 0, count * sizeof *block->q);
    memset(block->error, 0, count * sizeof *block->error);
    memset(block->flags, RQT_VALID, count);
    for (int c = 0; c < 4; c++, listed++) list[c][0] = c % 2 * last, list[c][1] = c / 2 * last, list[c][2] = 0;
#define OFFER(X, Y, Q)                                                 \
    do {                                                               \
        list[listed][0] = X, list[listed][1] = Y, list[listed][2] = Q; \
        if (bits[bit / 8] >> bit % 8 & 1) listed++;                    \
        bit++;                                                         \
    } while (0)
    if (h.k > 0) OFFER(last / 2, last / 2, last / 2);
    for (size_t at = 4; at < listed; at++) {
        reference_vertex(r, list[at][0], list[at][1], list[at][2]);
        for (int c = 0; c < r->children; c++) {
            const int *p = r->child[c];
            const bool border = p[0] == 0 || p[1] == 0 || p[0] == last || p[1] == last;
            if (++offers[at_of(r, p)] == (border ? 1 : 2)) OFFER(p[0], p[1], r->centre ? r->q : r->q / 2);
        }
    }
    assert_int_equal(listed, h.kept);
    assert_int_equal((bit + 7) / 8, payload + h.payload - bits);
    for (size_t i = 0; i < listed; i++) {
        const int at = list[i][1] * n + list[i][0];
        int64_t sum = 0, of = 1;
        if (i < 4) {
            sum = i == 0 ? 0 : i == 3 ? block->q[last] : block->q[0];
        } else {
            reference_vertex(r, list[i][0], list[i][1], list[i][2]);
            of = r->apexes == 2 ? 4 : 2;
            for (int c = 0; c < (int)of; c++) sum += block->q[at_of(r, c < 2 ? r->end[c] : r->apex[c - 2])];
        }
        const int64_t mean = (sum - (sum % of + of) % of) / of;
        block->q[at] = (int32_t)((uint32_t)mean + unzigzag(plane_value(payload, h.kept, h.height_planes, i)));
        block->flags[at] = (uint8_t)(h.has_voids ? valid[i / 8] >> i % 8 & 1 : !h.all_void);
        if (h.has_outline && i >= 4 && outline[(i - 4) / 8] >> (i - 4) % 8 & 1) block->flags[at] |= RQT_OUTLINE;
    }
    for (size_t i = listed; i-- > 4;) {
        reference_vertex(r, list[i][0], list[i][1], list[i][2]);
        reference_error(r, plane_value(errors_at, h.kept - 4, h.error_planes, i - 4));
    }
    free(list);
    free(offers);
}

static void reference_decode(bytes b, rqt_block *block) {
    rqt_block_header h;
    assert_int_equal(rqt_block_info(b.data, b.size, &h, NULL), RQT_OK);
    uint8_t *payload = take(h.payload);
    assert_int_equal(ZSTD_decompress(payload, h.payload, b.data + HEADER_BYTES, b.size - HEADER_BYTES), h.payload);
    reference r = {.h = h, .b = block, .n = side_of(h.k)};
    (h.sparse ? reference_sparse : reference_whole)(&r, payload);
    block->width = h.width;
    block->height = h.height;
    block->sparse = h.sparse;
    block->floor = h.floor;
    free(payload);
}

static void the_bytes_of_a_block_mean_what_the_format_says(void **state) {
    (void)state;
    random_begin(__func__);
    static const double quanta[] = {1, 0.1, 0.3048, 1e-40};
    rqt_codec *codec = new_codec();
    for (int k = 0; k <= RQT_MAX_BLOCK_K; k++) {
        const int n = side_of(k);
        rqt_block block = new_block(k), back = new_block(k), ours = new_block(k);
        for (terrain what = FLAT; what < KINDS; what++)
            for (int round = 0; round < 8; round++) {
                fill(&block, round % 4 < 2 ? n : 1 + (int)random_below((uint32_t)n),
                     round % 4 < 3 ? n : (n + 1) / 2, what, round ? 5 : 0, round % 2 ? LIKELY_ERRORS : ANY_ERRORS,
                     round % 3 ? 9 : 0);
                if (round > 3)
                    make_sparse(&block, round % 2 ? 33100 : 20000);
                else
                    block.sparse = false, block.floor = 0;
                bytes b = encode(codec, &block, quanta[round % 4]);
                reference_decode(b, &back);
                assert_same_block(&block, &back);
                /* under the voids too */
                assert_int_equal(rqt_block_decode(codec, b.data, b.size, &ours), RQT_OK);
                assert_memory_equal(ours.q, back.q, count_of(k) * sizeof *ours.q);
                assert_memory_equal(ours.error, back.error, count_of(k) * sizeof *ours.error);
                assert_memory_equal(ours.flags, back.flags, count_of(k));
                free(b.data);
            }
        rqt_block_free(&ours, &allocator);
        rqt_block_free(&back, &allocator);
        rqt_block_free(&block, &allocator);
    }
    rqt_codec_free(codec);
}

/* ----------------------------------------------------------------------------------------- summaries -- */

static rqt_summary random_summary(void) {
    rqt_summary s;
    memset(&s, 0, sizeof s);
    s.tol = (rqt_interval){(rqt_code)random_bits(), (rqt_code)random_bits()};
    s.exact = (rqt_interval){(rqt_code)random_bits(), (rqt_code)random_bits()};
    s.center_error = (rqt_code)random_bits();
    s.center_flags = (uint8_t)random_below(4);
    for (int n = 0; n < 6; n++) {
        rqt_summary_vertex *v = n < 4 ? &s.corner[n] : &s.far[n - 4];
        v->flags = (uint8_t)random_below(4);
        v->q = v->flags & RQT_VALID ? random_height() : 0;
        v->error = (rqt_code)random_bits();
    }
    return s;
}

static bool same_summary(const rqt_summary *a, const rqt_summary *b) {
    bool same = a->tol.em == b->tol.em && a->tol.em_parent == b->tol.em_parent && a->exact.em == b->exact.em &&
                a->exact.em_parent == b->exact.em_parent && a->center_error == b->center_error &&
                a->center_flags == b->center_flags;
    for (int n = 0; n < 6; n++) {
        const rqt_summary_vertex *v = n < 4 ? &a->corner[n] : &a->far[n - 4];
        const rqt_summary_vertex *w = n < 4 ? &b->corner[n] : &b->far[n - 4];
        same = same && v->q == w->q && v->error == w->error && v->flags == w->flags;
    }
    return same;
}

static void a_summary_comes_back_and_the_height_of_a_void_is_nothing(void **state) {
    (void)state;
    random_begin(__func__);
    for (int round = 0; round < 2000; round++) {
        const rqt_summary s = random_summary();
        rqt_summary t = s, back;
        uint8_t a[RQT_SUMMARY_BYTES], b[RQT_SUMMARY_BYTES];
        rqt_summary_encode(&s, a);
        assert_int_equal(rqt_summary_decode(a, sizeof a, &back), RQT_OK);
        assert_true(same_summary(&s, &back));
        for (int n = 0; n < 4; n++)
            if (!(t.corner[n].flags & RQT_VALID)) t.corner[n].q = (int32_t)(uint32_t)random_bits();
        rqt_summary_encode(&t, b);
        assert_memory_equal(a, b, sizeof a);
    }
}

static void F42_a_damaged_or_lying_summary_is_noticed(void **state) {
    (void)state;
    random_begin(__func__);
    const rqt_summary s = random_summary();
    uint8_t good[RQT_SUMMARY_BYTES + 1] = {0};
    rqt_summary back;
    rqt_summary_encode(&s, good);
    for (size_t size = 0; size <= sizeof good; size++) {
        uint8_t *cut = copy_of(good, size);
        assert_int_equal(rqt_summary_decode(cut, size, &back), size == RQT_SUMMARY_BYTES ? RQT_OK : RQT_CORRUPT);
        free(cut);
    }
    for (size_t bit = 0; bit < 8 * RQT_SUMMARY_BYTES; bit++) {
        flip(good, bit);
        assert_int_equal(rqt_summary_decode(good, RQT_SUMMARY_BYTES, &back), RQT_CORRUPT);
        flip(good, bit);
    }
    static const struct {
        size_t at;
        uint8_t value;
    } lies[] = {{0, 'r'},  {3, 'B'}, {4, 2},  {5, 4},  {30, 4},    {31, 1},
                {70, 255}, {71, 1},  {72, 1}, {79, 1}, {27, 0x40}, {27, 0x80}};
    for (size_t i = 0; i < sizeof lies / sizeof *lies; i++) {
        uint8_t lie[RQT_SUMMARY_BYTES];
        memcpy(lie, good, sizeof lie);
        lie[lies[i].at] = lies[i].value;
        put64(lie + AT_SUMMARY_CHECKSUM, checksum64(lie, sizeof lie, AT_SUMMARY_CHECKSUM));
        assert_int_equal(rqt_summary_decode(lie, sizeof lie, &back), RQT_CORRUPT);
    }
    assert_int_equal(rqt_summary_decode(good, RQT_SUMMARY_BYTES, &back), RQT_OK);
}

static void a_summary_answers_from_em_up_to_below_its_parents(void **state) {
    (void)state;
    rqt_summary s;
    memset(&s, 0, sizeof s);
    s.tol = (rqt_interval){100, 200};
    s.exact = (rqt_interval){RQT_CODE_INFINITY, RQT_CODE_INFINITY};
    static const struct {
        rqt_code eps;
        bool tol;
    } asked[] = {{0, false}, {99, false}, {100, true}, {199, true}, {200, false}, {RQT_CODE_LARGEST, false}};
    for (size_t i = 0; i < sizeof asked / sizeof *asked; i++) {
        assert_int_equal(rqt_summary_answers(&s, RQT_OUTLINE_TOL, asked[i].eps), asked[i].tol);
        assert_false(rqt_summary_answers(&s, RQT_OUTLINE_EXACT, asked[i].eps));
    }
    s.exact = (rqt_interval){0, RQT_CODE_INFINITY};
    assert_true(rqt_summary_answers(&s, RQT_OUTLINE_EXACT, 0));
    assert_true(rqt_summary_answers(&s, RQT_OUTLINE_EXACT, RQT_CODE_LARGEST));
    s.tol = (rqt_interval){50, 50};
    assert_false(rqt_summary_answers(&s, RQT_OUTLINE_TOL, 50));
}

static void a_block_is_needed_iff_its_centre_is_selected(void **state) {
    (void)state;
    rqt_summary s;
    memset(&s, 0, sizeof s);
    for (int level = 0; level < 3; level++)
        for (uint8_t flags = 0; flags < 4; flags++) {
            s.center_error = 100;
            s.center_flags = flags;
            const bool outline = flags & RQT_OUTLINE;
            assert_true(rqt_summary_needs_block(&s, RQT_OUTLINE_TOL, 99));
            assert_false(rqt_summary_needs_block(&s, RQT_OUTLINE_TOL, 100));
            assert_true(rqt_summary_needs_block(&s, RQT_OUTLINE_EXACT, 99));
            assert_int_equal(rqt_summary_needs_block(&s, RQT_OUTLINE_EXACT, 100), outline);
            s.center_error = 0;
            assert_false(rqt_summary_needs_block(&s, RQT_OUTLINE_TOL, 0));
        }
}

/* -------------------------------------------------------------------------------------------- meshes -- */
enum { VERTICES = 5, INDICES = 6 };

static rqt_mesh_header mesh_header(rqt_mesh_kind kind) {
    rqt_mesh_header h;
    memset(&h, 0, sizeof h);
    h.kind = kind;
    h.vertex_count = VERTICES;
    h.index_count = INDICES;
    h.placement = (rqt_placement){500000.5, -3.25, 25, -25};
    h.unit = (rqt_unit){-1000, 10, 381, 1250, 1.5, -7};
    h.eps = 2.5;
    h.srid = 25832;
    return h;
}

static bytes mesh_bytes(const rqt_mesh_header *h, rqt_patch_vertex *vertices, uint32_t *indices) {
    for (int i = 0; i < VERTICES; i++) {
        vertices[i] = (rqt_patch_vertex){(int32_t)random_below((1 << RQT_MAX_K) + 1),
                                         (int32_t)random_below((1 << RQT_MAX_K) + 1), random_height(), 0, 0};
    }
    for (int i = 0; i < INDICES; i++) indices[i] = random_below(VERTICES);
    bytes b = {NULL, rqt_mesh_bytes(h)};
    b.data = take(b.size);
    rqt_mesh_encode(h, vertices, indices, b.data);
    return b;
}

static void a_mesh_comes_back(void **state) {
    (void)state;
    random_begin(__func__);
    for (int round = 0; round < 100; round++) {
        rqt_mesh_header h = mesh_header(round % 2 ? RQT_MESH_STRIP : RQT_MESH_INDEXED), back;
        if (round == 50) h.eps = INFINITY;
        rqt_patch_vertex vertices[VERTICES];
        uint32_t indices[INDICES];
        bytes b = mesh_bytes(&h, vertices, indices);
        assert_int_equal(b.size, 128 + 12 * VERTICES + 4 * INDICES);
        const uint8_t *v, *i;
        assert_int_equal(rqt_mesh_decode(b.data, b.size, &back, &v, &i), RQT_OK);
        assert_int_equal(back.kind, h.kind);
        assert_int_equal(back.vertex_count, VERTICES);
        assert_int_equal(back.index_count, INDICES);
        assert_memory_equal(&back.placement, &h.placement, sizeof h.placement);
        assert_true(back.unit.z0 == h.unit.z0 && back.unit.d == h.unit.d && back.unit.scale == h.unit.scale);
        assert_true(back.unit.numerator == 381 && back.unit.denominator == 1250 && back.unit.offset == -7);
        assert_true(back.eps == h.eps && back.srid == 25832);
        for (int n = 0; n < VERTICES; n++, v += 12) {
            assert_int_equal((int32_t)get32(v), vertices[n].col);
            assert_int_equal((int32_t)get32(v + 4), vertices[n].row);
            assert_int_equal((int32_t)get32(v + 8), vertices[n].q);
        }
        for (int n = 0; n < INDICES; n++, i += 4) assert_int_equal(get32(i), indices[n]);
        free(b.data);
    }
    /* Nothing at all is a mesh too. */
    rqt_mesh_header h = mesh_header(RQT_MESH_STRIP), back;
    h.vertex_count = h.index_count = 0;
    uint8_t *empty = take(RQT_MESH_HEADER_BYTES);
    const uint8_t *v, *i;
    assert_int_equal(rqt_mesh_bytes(&h), RQT_MESH_HEADER_BYTES);
    rqt_mesh_encode(&h, NULL, NULL, empty);
    assert_int_equal(rqt_mesh_decode(empty, RQT_MESH_HEADER_BYTES, &back, &v, &i), RQT_OK);
    free(empty);
}

static void F42_a_damaged_mesh_is_noticed(void **state) {
    (void)state;
    random_begin(__func__);
    rqt_mesh_header h = mesh_header(RQT_MESH_INDEXED), back;
    rqt_patch_vertex vertices[VERTICES];
    uint32_t indices[INDICES];
    bytes b = mesh_bytes(&h, vertices, indices);
    const uint8_t *v, *i;
    for (size_t size = 0; size < b.size; size++) {
        uint8_t *cut = copy_of(b.data, size);
        assert_int_equal(rqt_mesh_decode(cut, size, &back, &v, &i), RQT_CORRUPT);
        assert_null(v);
        assert_null(i);
        free(cut);
    }
    for (size_t bit = 0; bit < 8 * b.size; bit++) {
        flip(b.data, bit);
        assert_int_equal(rqt_mesh_decode(b.data, b.size, &back, &v, &i), RQT_CORRUPT);
        flip(b.data, bit);
    }
    assert_int_equal(rqt_mesh_decode(b.data, b.size, &back, &v, &i), RQT_OK);
    free(b.data);
}

static void F42_a_mesh_that_lies_is_found_out_under_a_good_checksum(void **state) {
    (void)state;
    random_begin(__func__);
    rqt_mesh_header h = mesh_header(RQT_MESH_INDEXED), back;
    rqt_patch_vertex vertices[VERTICES];
    uint32_t indices[INDICES];
    bytes b = mesh_bytes(&h, vertices, indices);
    enum { INDEX = 128 + 12 * VERTICES };
    const uint64_t nan = 0x7FF8000000000000, infinity = 0x7FF0000000000000, minus = 0xBFF0000000000000;
    const struct {
        size_t at;
        int bytes;
        uint64_t value;
    } lies[] = {{0, 1, 'r'},
                {4, 1, 0},
                {4, 1, 2},
                {5, 1, 0},
                {5, 1, 3},
                {6, 1, 1},
                {7, 1, 1},
                {112, 1, 1},
                {127, 1, 1},
                {16, 8, 4},
                {16, 8, 6},
                {24, 8, 3},
                {24, 8, 9},
                {16, 8, (uint64_t)1 << 62},
                {24, 8, (uint64_t)1 << 62},
                {16, 8, UINT64_MAX},
                {24, 8, UINT64_MAX},
                {16, 8, 0x1555555555555555},
                {24, 8, ((uint64_t)1 << 62) + INDICES},
                {32, 8, nan},
                {40, 8, infinity},
                {48, 8, 0},
                {56, 8, nan},
                {56, 8, (uint64_t)1 << 63},
                {64, 8, (uint64_t)1 << 53},
                {72, 4, 0},
                {76, 4, 0},
                {80, 4, 0},
                {88, 8, 0},
                {88, 8, nan},
                {96, 8, infinity},
                {104, 8, nan},
                {104, 8, minus},
                {128, 4, (1 << 20) + 1},
                {132, 4, 0xFFFFFFFF},
                {136, 4, 1 << 30},
                {136, 4, 0xC0000000},
                {INDEX, 4, VERTICES},
                {INDEX + 20, 4, 0xFFFFFFFF}};
    const uint8_t *v, *i;
    for (size_t n = 0; n < sizeof lies / sizeof *lies; n++) {
        uint8_t *lie = copy_of(b.data, b.size);
        for (int p = 0; p < lies[n].bytes; p++) lie[lies[n].at + (size_t)p] = (uint8_t)(lies[n].value >> 8 * p);
        put64(lie + AT_MESH_CHECKSUM, checksum64(lie, b.size, AT_MESH_CHECKSUM));
        assert_int_equal(rqt_mesh_decode(lie, b.size, &back, &v, &i), RQT_CORRUPT);
        free(lie);
    }
    free(b.data);
    /* Counts of indices that no list, or no strip, has. */
    static const struct {
        rqt_mesh_kind kind;
        uint64_t indices;
        rqt_status status;
    } counts[] = {{RQT_MESH_INDEXED, 5, RQT_CORRUPT}, {RQT_MESH_INDEXED, 4, RQT_CORRUPT},
                  {RQT_MESH_INDEXED, 3, RQT_OK},      {RQT_MESH_STRIP, 1, RQT_CORRUPT},
                  {RQT_MESH_STRIP, 2, RQT_CORRUPT},   {RQT_MESH_STRIP, 4, RQT_OK}};
    for (size_t n = 0; n < sizeof counts / sizeof *counts; n++) {
        h = mesh_header(counts[n].kind);
        h.index_count = counts[n].indices;
        b = mesh_bytes(&h, vertices, indices);
        assert_int_equal(rqt_mesh_decode(b.data, b.size, &back, &v, &i), counts[n].status);
        free(b.data);
    }
}

static void counts_beyond_all_memory_have_no_size(void **state) {
    (void)state;
    rqt_mesh_header h = mesh_header(RQT_MESH_INDEXED);
    static const uint64_t counts[] = {(uint64_t)1 << 62, UINT64_MAX, UINT64_MAX / 12 + 1, (uint64_t)1 << 63};
    for (size_t n = 0; n < sizeof counts / sizeof *counts; n++) {
        h.vertex_count = counts[n];
        h.index_count = 0;
        assert_true(rqt_mesh_bytes(&h) == SIZE_MAX);
        h.vertex_count = 0;
        h.index_count = counts[n];
        if (counts[n] > UINT64_MAX / 4) assert_true(rqt_mesh_bytes(&h) == SIZE_MAX);
        h.vertex_count = (uint64_t)1 << 60;
        assert_true(rqt_mesh_bytes(&h) == SIZE_MAX);
    }
}

/* ----------------------------------------------------------------------------- checksum and sentences -- */

static void a_checksum_ignores_its_field_and_sees_everything_else(void **state) {
    (void)state;
    random_begin(__func__);
    uint8_t data[48];
    for (size_t i = 0; i < sizeof data; i++) data[i] = (uint8_t)random_bits();
    for (size_t size = 16; size <= sizeof data; size++) {
        const uint64_t sum = checksum64(data, size, 8);
        for (size_t bit = 0; bit < 8 * size; bit++) {
            flip(data, bit);
            assert_int_equal(checksum64(data, size, 8) == sum, bit / 64 == 1);
            flip(data, bit);
        }
        if (size > 16) assert_true(checksum64(data, size - 1, 8) != sum);
    }
    /* Worked out from FORMAT.md by another program: bytes are stored, so this may never change. */
    uint8_t count[32];
    for (int i = 0; i < 32; i++) count[i] = (uint8_t)i;
    assert_true(checksum64(count, 32, 8) == 0xC68F4BD81E12CD32U);
    assert_true(checksum64(count, 29, 8) == 0x86A1F0A799E86B13U);
    /* A field that is not there changes nothing. */
    assert_true(checksum64(count, 16, 16) == checksum64(count, 16, 800) &&
                checksum64(count, 5, 8) == checksum64(count, 5, 800));
    assert_true(checksum64(count, 16, 16) != checksum64(count, 16, 8));
}

static void a_sentence_is_cut_where_it_must_and_between_characters(void **state) {
    (void)state;
    rqt_message m;
    sentence_begin(&m, "k is ");
    sentence_add_integer(&m, -42);
    sentence_add(&m, ", not ");
    sentence_add_integer(&m, INT64_MIN);
    assert_string_equal(m.text, "k is -42, not -9223372036854775808");
    sentence_begin(&m, "");
    sentence_add_integer(&m, 0);
    assert_string_equal(m.text, "0");
    sentence_add_integer(&m, INT64_MAX);
    assert_string_equal(m.text, "09223372036854775807");
    sentence_begin(&m, "");
    for (int i = 0; i < 200; i++) sentence_add(&m, "\xC3\xBC"); /* a character of two bytes into an odd room */
    assert_int_equal(strlen(m.text), 254);
    sentence_begin(NULL, "nobody");
    sentence_add(NULL, "listens");
    sentence_add_integer(NULL, 1);
}

int main(void) {
    random_seed_begin();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_bytes_of_a_block_mean_what_the_format_says),
        cmocka_unit_test(a_summary_comes_back_and_the_height_of_a_void_is_nothing),
        cmocka_unit_test(F42_a_damaged_or_lying_summary_is_noticed),
        cmocka_unit_test(a_summary_answers_from_em_up_to_below_its_parents),
        cmocka_unit_test(a_block_is_needed_iff_its_centre_is_selected),
        cmocka_unit_test(a_mesh_comes_back),
        cmocka_unit_test(F42_a_damaged_mesh_is_noticed),
        cmocka_unit_test(F42_a_mesh_that_lies_is_found_out_under_a_good_checksum),
        cmocka_unit_test(counts_beyond_all_memory_have_no_size),
        cmocka_unit_test(a_checksum_ignores_its_field_and_sees_everything_else),
        cmocka_unit_test(a_sentence_is_cut_where_it_must_and_between_characters),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
