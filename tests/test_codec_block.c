/* test_codec_block.c - promises of stored blocks: they come back as they went in, equal blocks have equal bytes,
 * nothing that is damaged or lies gets past a reader, and memory that is refused is reported and not leaked. */
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

enum {
    AT_VERSION = 4,
    AT_K = 5,
    AT_FLAGS = 6,
    AT_PLANES = 7,
    AT_WIDTH = 8,
    AT_HEIGHT = 10,
    AT_PAYLOAD = 12,
    AT_QUANTUM = 16,
    AT_BLOCK_CHECKSUM = 24,
    AT_FLOOR = 32,
    AT_GROUND = 34,
    AT_KEPT = 36
};

/* -------------------------------------------------------------------------------------- round trips -- */
static void assert_round_trip(rqt_codec *codec, const rqt_block *block, double quantum) {
    bytes b = encode(codec, block, quantum);
    rqt_block_header h;
    rqt_message message;
    assert_int_equal(rqt_block_info(b.data, b.size, &h, &message), RQT_OK);
    assert_string_equal(message.text, "");
    assert_int_equal(h.version, RQT_FORMAT_VERSION);
    assert_int_equal(h.k, block->k);
    assert_int_equal(h.width, block->width);
    assert_int_equal(h.height, block->height);
    assert_true(h.quantum == quantum);
    assert_int_equal(rqt_block_check(codec, b.data, b.size, &message), RQT_OK);
    assert_string_equal(message.text, "");
    rqt_block back = new_block(block->k);
    memset(back.q, 0x77, count_of(block->k) * sizeof *back.q);
    memset(back.error, 0x77, count_of(block->k) * sizeof *back.error);
    memset(back.flags, 0x77, count_of(block->k));
    assert_int_equal(rqt_block_decode(codec, b.data, b.size, &back), RQT_OK);
    assert_same_block(block, &back);
    rqt_block_free(&back, &allocator);
    free(b.data);
}

static void a_block_comes_back_whatever_its_size_heights_voids_errors_and_outline(void **state) {
    (void)state;
    random_begin(__func__);
    static const uint32_t shares[] = {0, 1, 2, 7, 1000};
    rqt_codec *codec = new_codec();
    for (int k = 0; k <= RQT_MAX_BLOCK_K; k++) {
        rqt_block block = new_block(k);
        for (terrain what = FLAT; what < KINDS; what++)
            for (errors error = NO_ERRORS; error < ERRORS; error++)
                for (size_t voids = 0; voids < 5; voids++) {
                    const uint32_t outline = k < 5 ? shares[random_below(5)] : shares[voids];
                    fill(&block, side_of(k), side_of(k), what, shares[voids], error, outline);
                    assert_round_trip(codec, &block, 0.25);
                }
        rqt_block_free(&block, &allocator);
    }
    rqt_codec_free(codec);
    assert_int_equal(the_heap.live, 0);
}

static void a_cropped_block_repeats_its_last_heights_and_validity(void **state) {
    (void)state;
    random_begin(__func__);
    rqt_codec *codec = new_codec();
    for (int k = 0; k <= RQT_MAX_BLOCK_K; k++) {
        const int n = side_of(k);
        rqt_block block = new_block(k);
        for (int round = 0; round < (k < 6 ? 40 : 8); round++) {
            const int width = round < 2 ? 1 : 1 + (int)random_below((uint32_t)n);
            const int height = round % 2 ? 1 + (int)random_below((uint32_t)n) : round < 4 ? 1 : n;
            fill(&block, width, height, TERRAIN, round % 3 ? 6 : 0, LIKELY_ERRORS, 5);
            assert_round_trip(codec, &block, 1.0);
            /* And what the input holds past the last sample is not looked at. */
            rqt_block other = new_block(k);
            other.width = width;
            other.height = height;
            memcpy(other.error, block.error, count_of(k) * sizeof *block.error);
            for (int i = 0; i < n * n; i++) {
                const bool stored = i / n < height && i % n < width;
                other.q[i] = stored ? block.q[i] : INT32_MAX;
                other.flags[i] =
                    stored ? block.flags[i] : (uint8_t)((block.flags[i] & RQT_OUTLINE) | random_below(2));
            }
            bytes a = encode(codec, &block, 1.0), b = encode(codec, &other, 1.0);
            assert_int_equal(a.size, b.size);
            assert_memory_equal(a.data, b.data, a.size);
            free(a.data);
            free(b.data);
            rqt_block_free(&other, &allocator);
        }
        rqt_block_free(&block, &allocator);
    }
    rqt_codec_free(codec);
    assert_int_equal(the_heap.live, 0);
}

static void a_sparse_block_comes_back_as_far_as_it_is_kept(void **state) {
    (void)state;
    random_begin(__func__);
    static const uint32_t shares[] = {0, 0, 3, 20, 1};
    rqt_codec *codec = new_codec();
    for (int k = 0; k <= RQT_MAX_BLOCK_K; k++) {
        const int n = side_of(k);
        rqt_block block = new_block(k);
        for (terrain what = FLAT; what < KINDS; what++)
            for (int round = 0; round < (k < 6 ? 10 : 5); round++) {
                fill(&block, 1 + (int)random_below((uint32_t)n), n, what, shares[round % 5],
                     round % 3 ? LIKELY_ERRORS : ANY_ERRORS, shares[(round / 5 + round) % 5]);
                /* few vertices far above the others, so that not all of them are kept */
                for (size_t i = 0; i < count_of(k); i++)
                    if (round % 3 != 2 && random_below(1u << round)) block.error[i] = (rqt_code)random_below(100);
                const rqt_code floors[] = {100, 33000, 0, 50, 65534};
                make_sparse(&block, floors[round % 5]);
                assert_round_trip(codec, &block, 0.25);
                /* What is not kept is not looked at. */
                bytes a = encode(codec, &block, 0.25);
                for (int i = 0; i < n * n; i++) {
                    if (is_block_corner(k, i)) {
                        block.error[i] = (rqt_code)random_bits();
                        block.flags[i] ^= (uint8_t)(random_below(2) * RQT_OUTLINE);
                    } else if (!is_kept(&block, i)) {
                        block.q[i] = (int32_t)(uint32_t)random_bits();
                        block.error[i] = (rqt_code)random_below(block.floor + 1u);
                        block.flags[i] = (uint8_t)(random_bits() & ~(uint64_t)RQT_OUTLINE);
                    } else if (!(block.flags[i] & RQT_VALID)) {
                        block.q[i] = (int32_t)(uint32_t)random_bits();
                    }
                }
                bytes b = encode(codec, &block, 0.25);
                assert_int_equal(a.size, b.size);
                assert_memory_equal(a.data, b.data, a.size);
                free(a.data);
                free(b.data);
            }
        rqt_block_free(&block, &allocator);
    }
    rqt_codec_free(codec);
    assert_int_equal(the_heap.live, 0);
}

static void a_block_gets_its_corners_from_its_summary(void **state) {
    (void)state;
    random_begin(__func__);
    for (int k = 0; k < 4; k++) {
        rqt_block block = new_block(k), before = new_block(k);
        const int n = side_of(k), last = n - 1;
        fill(&block, n, n, TERRAIN, 3, ANY_ERRORS, 3);
        memcpy(before.error, block.error, count_of(k) * sizeof *block.error);
        memcpy(before.flags, block.flags, count_of(k));
        rqt_summary s = {0};
        for (int c = 0; c < 4; c++) s.corner[c] = (rqt_summary_vertex){7, (rqt_code)(100 + c), (uint8_t)c};
        rqt_block_set_corners(&block, &s);
        for (int i = 0; i < n * n; i++) {
            const int c = i % n / last + 2 * (i / n / last);
            const bool corner = is_block_corner(k, i);
            assert_int_equal(block.error[i], corner ? 100 + c : before.error[i]);
            assert_int_equal(block.flags[i],
                             corner ? (before.flags[i] & RQT_VALID) | (c & RQT_OUTLINE) : before.flags[i]);
        }
        rqt_block_free(&block, &allocator);
        rqt_block_free(&before, &allocator);
    }
}

static void any_finite_quantum_above_zero_serves(void **state) {
    (void)state;
    random_begin(__func__);
    static const double quanta[] = {5e-324, 1e-300, 1e-30, 0.001, 0.1,
                                    0.3048, 1,      1e30,  1e300, 1.7976931348623157e308};
    static const double wrong[] = {0, -0.0, -1, INFINITY, -INFINITY, NAN};
    rqt_codec *codec = new_codec();
    rqt_block block = new_block(4);
    uint8_t *buffer = take(rqt_block_bound(4));
    for (size_t i = 0; i < sizeof quanta / sizeof *quanta; i++) {
        fill(&block, 17, 17, i % 2 ? FULL_RANGE : TERRAIN, 9, LIKELY_ERRORS, 9);
        assert_round_trip(codec, &block, quanta[i]);
        make_sparse(&block, 33000);
        assert_round_trip(codec, &block, quanta[i]);
        block.sparse = false;
        block.floor = 0;
    }
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        size_t size = 1;
        assert_int_equal(rqt_block_encode(codec, &block, wrong[i], buffer, &size), RQT_INVALID);
        assert_int_equal(size, 0);
    }
    free(buffer);
    rqt_block_free(&block, &allocator);
    rqt_codec_free(codec);
}

static void equal_blocks_give_equal_bytes_whatever_lies_under_their_voids(void **state) {
    (void)state;
    random_begin(__func__);
    for (int k = 0; k <= 6; k++) {
        rqt_codec *codec = new_codec(), *fresh = new_codec();
        rqt_block block = new_block(k);
        for (uint32_t voids = 0; voids < 6; voids++) {
            fill(&block, side_of(k), side_of(k), TERRAIN, voids, LIKELY_ERRORS, 3);
            bytes a = encode(codec, &block, 0.5);
            for (size_t i = 0; i < count_of(k); i++)
                if (!(block.flags[i] & RQT_VALID)) block.q[i] = (int32_t)(uint32_t)random_bits();
            bytes b = encode(codec, &block, 0.5), c = encode(fresh, &block, 0.5);
            assert_int_equal(a.size, b.size);
            assert_memory_equal(a.data, b.data, a.size);
            assert_int_equal(a.size, c.size);
            assert_memory_equal(a.data, c.data, a.size);
            free(a.data);
            free(b.data);
            free(c.data);
        }
        rqt_block_free(&block, &allocator);
        rqt_codec_free(codec);
        rqt_codec_free(fresh);
    }
}

/* The largest deviation, as a code, of the heights in the closed triangle of three places from its plane. */
static rqt_code deviation(const rqt_block *b, const rqt_unit *unit, const int p[3][2]) {
    const int n = side_of(b->k);
    const int64_t area =
        (int64_t)(p[1][0] - p[0][0]) * (p[2][1] - p[0][1]) - (int64_t)(p[2][0] - p[0][0]) * (p[1][1] - p[0][1]);
    int64_t most = 0;
    for (int y = 0; y < n; y++)
        for (int x = 0; x < n; x++) {
            int64_t sum = 0, least = INT64_MAX;
            for (int c = 0; c < 3; c++) {
                const int *u = p[(c + 1) % 3], *v = p[(c + 2) % 3];
                int64_t share = (int64_t)(u[0] - x) * (v[1] - y) - (int64_t)(v[0] - x) * (u[1] - y);
                if (area < 0) share = -share;
                if (share < least) least = share;
                sum += share * b->q[p[c][1] * n + p[c][0]];
            }
            const int64_t off = llabs(llabs(area) * b->q[y * n + x] - sum);
            if (least >= 0 && off > most) most = off;
        }
    return rqt_code_from_quanta(unit, 0, (uint64_t)most, (uint64_t)llabs(area));
}

static void errors_that_their_heights_imply_take_no_plane(void **state) {
    (void)state;
    random_begin(__func__);
    /* At the two finest scales the error of a vertex is what the heights in its diamond say, or a child's: those of
     * the vertices inside a block are known from the block. A quantum of a tenth is no binary fraction: prediction
     * must not slip. */
    rqt_codec *codec = new_codec();
    rqt_block block = new_block(3);
    const int n = 9;
    fill(&block, n, n, NOISE, 0, NO_ERRORS, 0);
    const rqt_unit unit = {0, 10, 1, 1, 1.0, 0.0};
    for (int q = 1; q <= 4; q *= 2)
        for (int centre = 0; centre < 2; centre++)
            for (int y = 0; y < n; y += q)
                for (int x = 0; x < n; x += q) {
                    if ((x / q % 2 + y / q % 2) != 1 + centre) continue;
                    const bool odd = x / q % 2;
                    int ax = odd ? q : 0, ay = odd ? 0 : q; /* from the vertex to an end of its hypotenuse */
                    if (centre) ax = q, ay = (x ^ y) / q & 2 ? -q : q;
                    for (int half = -1; half <= 1 && q < 4; half += 2) {
                        const int p[3][2] = {{x - half * ay, y + half * ax}, {x - ax, y - ay}, {x + ax, y + ay}};
                        if (p[0][0] < 0 || p[0][1] < 0 || p[0][0] >= n || p[0][1] >= n) continue;
                        const rqt_code code = deviation(&block, &unit, p);
                        if (code > block.error[y * n + x]) block.error[y * n + x] = code;
                    }
                    if (q == 4 && !centre) { /* of the third scale the midpoint alone is looked at */
                        const int64_t off = llabs(2LL * block.q[y * n + x] - block.q[(y - ay) * n + x - ax] -
                                                  block.q[(y + ay) * n + x + ax]);
                        const rqt_code code = rqt_code_from_quanta(&unit, 0, (uint64_t)off, 2);
                        if (code > block.error[y * n + x]) block.error[y * n + x] = code;
                    }
                    int parents[2];
                    for (int c = parents_of(3, y * n + x, parents); c-- > 0;)
                        if (block.error[parents[c]] < block.error[y * n + x])
                            block.error[parents[c]] = block.error[y * n + x];
                }
    bytes b = encode(codec, &block, 0.1);
    rqt_block_header h;
    assert_int_equal(rqt_block_info(b.data, b.size, &h, NULL), RQT_OK);
    assert_int_equal(h.finest_planes, 0);
    assert_int_equal(h.error_planes, 0);
    free(b.data);
    rqt_block_free(&block, &allocator);
    rqt_codec_free(codec);
}

static void what_cannot_be_stored_is_refused(void **state) {
    (void)state;
    random_begin(__func__);
    rqt_codec *codec = new_codec();
    rqt_block good = new_block(3);
    fill(&good, 9, 7, TERRAIN, 0, LIKELY_ERRORS, 0);
    uint8_t *buffer = take(rqt_block_bound(3));
    size_t size;
    rqt_block b = good;
#define REFUSED()                                                                     \
    do {                                                                              \
        assert_int_equal(rqt_block_encode(codec, &b, 1, buffer, &size), RQT_INVALID); \
        assert_int_equal(size, 0);                                                    \
        b = good;                                                                     \
    } while (0)
    b.k = -1;
    REFUSED();
    b.k = RQT_MAX_BLOCK_K + 1;
    REFUSED();
    b.width = 0;
    REFUSED();
    b.width = 10;
    REFUSED();
    b.height = -3;
    REFUSED();
    b.height = 10;
    REFUSED();
    const int32_t q = good.q[5];
    good.q[5] = RQT_HEIGHT_LIMIT;
    REFUSED();
    good.q[5] = -RQT_HEIGHT_LIMIT;
    REFUSED();
    good.q[5] = INT32_MIN;
    REFUSED();
    good.q[5] = q;
    good.flags[70] |= 4;
    REFUSED();
    good.flags[70] &= 3;
    b = good;
    b.floor = 1; /* of a block that is not sparse */
    REFUSED();
    good.sparse = true;
    b = good;
    b.floor = 40000;
    good.error[1] = 40001; /* kept, and its parent is not */
    REFUSED();
    good.error[1] = 0;
    good.sparse = false;
    b = good;
    assert_int_equal(rqt_block_encode(codec, &b, 1, buffer, &size), RQT_OK);
    assert_int_equal(rqt_block_bound(-1), 0);
    assert_int_equal(rqt_block_bound(RQT_MAX_BLOCK_K + 1), 0);
    assert_int_equal(rqt_block_bytes(-1), 0);
    assert_int_equal(rqt_block_bytes(RQT_MAX_BLOCK_K + 1), 0);
    rqt_block none;
    assert_int_equal(rqt_block_create(RQT_MAX_BLOCK_K + 1, &allocator, &none), RQT_INVALID);
    assert_null(none.q);
    assert_int_equal(rqt_block_create(-1, &allocator, &none), RQT_INVALID);
    free(buffer);
    rqt_block_free(&good, &allocator);
    rqt_codec_free(codec);
}

/* -------------------------------------------------------------------------------------------- damage -- */

/* decode and check must say RQT_CORRUPT, and check a sentence; info RQT_CORRUPT, or RQT_OK where only the checksum
 * could tell. */
static void assert_corrupt(rqt_codec *codec, const uint8_t *data, size_t size, rqt_block *scratch, bool info_too) {
    rqt_message message = {""};
    rqt_block_header h;
    assert_int_equal(rqt_block_decode(codec, data, size, scratch), RQT_CORRUPT);
    assert_int_equal(rqt_block_check(codec, data, size, &message), RQT_CORRUPT);
    assert_true(strlen(message.text) > 10);
    const rqt_status status = rqt_block_info(data, size, &h, &message);
    if (info_too) {
        assert_int_equal(status, RQT_CORRUPT);
        assert_true(strlen(message.text) > 10);
        assert_int_equal(h.payload, 0);
    } else {
        assert_true(status == RQT_OK || status == RQT_CORRUPT);
    }
}

static void F42_every_truncation_of_a_block_is_noticed(void **state) {
    (void)state;
    random_begin(__func__);
    rqt_codec *codec = new_codec();
    for (int k = 0; k <= 6; k += 3) {
        rqt_block block = new_block(k);
        fill(&block, side_of(k), side_of(k), TERRAIN, 8, LIKELY_ERRORS, 8);
        if (k == 3) make_sparse(&block, 33200);
        bytes b = encode(codec, &block, 1);
        for (size_t size = 0; size < b.size; size++) {
            uint8_t *cut = copy_of(b.data, size);
            assert_corrupt(codec, cut, size, &block, true);
            free(cut);
        }
        uint8_t *longer = take(b.size + 40);
        memcpy(longer, b.data, b.size);
        memset(longer + b.size, 0, 40);
        for (size_t more = 1; more <= 40; more++) assert_corrupt(codec, longer, b.size + more, &block, true);
        free(longer);
        free(b.data);
        rqt_block_free(&block, &allocator);
    }
    rqt_codec_free(codec);
}

static void F42_every_flipped_bit_of_a_block_is_noticed(void **state) {
    (void)state;
    random_begin(__func__);
    rqt_codec *codec = new_codec();
    for (int k = 0; k <= RQT_MAX_BLOCK_K; k++) {
        rqt_block block = new_block(k);
        fill(&block, side_of(k), side_of(k), k % 2 ? NOISE : TERRAIN, 8, LIKELY_ERRORS, 8);
        if (k % 3 == 2) make_sparse(&block, 33200);
        bytes b = encode(codec, &block, 1);
        const size_t bits = 8 * b.size, trials = k <= 3 ? bits : 300;
        for (size_t i = 0; i < trials; i++) {
            const size_t bit = k <= 3 ? i : (size_t)(random_bits() % bits);
            flip(b.data, bit);
            assert_corrupt(codec, b.data, b.size, &block, false);
            flip(b.data, bit);
        }
        assert_int_equal(rqt_block_decode(codec, b.data, b.size, &block), RQT_OK);
        free(b.data);
        rqt_block_free(&block, &allocator);
    }
    rqt_codec_free(codec);
}

static void sign(bytes b) {
    put64(b.data + AT_BLOCK_CHECKSUM, checksum64(b.data, b.size, AT_BLOCK_CHECKSUM));
}

/* A block with a payload of one's own, compressed and signed as it should be. */
static bytes forge(const uint8_t *header, const uint8_t *payload, size_t n) {
    uint8_t *buffer = take(HEADER_BYTES + ZSTD_compressBound(n));
    memcpy(buffer, header, HEADER_BYTES);
    put32(buffer + AT_PAYLOAD, (uint32_t)n);
    const size_t z = ZSTD_compress(buffer + HEADER_BYTES, ZSTD_compressBound(n), payload, n, 1);
    assert_false(ZSTD_isError(z));
    bytes b = {copy_of(buffer, HEADER_BYTES + z), HEADER_BYTES + z};
    free(buffer);
    sign(b);
    return b;
}

static void F42_a_header_that_lies_is_found_out_under_a_good_checksum(void **state) {
    (void)state;
    random_begin(__func__);
    rqt_codec *codec = new_codec();
    rqt_block block = new_block(4), scratch = new_block(4);
    fill(&block, 12, 15, NOISE, 5, LIKELY_ERRORS, 5);
    bytes b = encode(codec, &block, 1);
    rqt_block_header h;
    assert_int_equal(rqt_block_info(b.data, b.size, &h, NULL), RQT_OK);
    assert_true(h.has_voids && h.has_outline && h.height_planes == 2 && h.finest_planes == 2 &&
                h.error_planes == 2);
    static const struct {
        size_t at;
        int bytes;
        uint32_t value;
    } lies[] = {{0, 1, 'r'},
                {AT_VERSION, 1, 0},
                {AT_VERSION, 1, 2},
                {AT_K, 1, 9},
                {AT_K, 1, 255},
                {AT_K, 1, 3},
                {AT_K, 1, 5},
                {AT_FLAGS, 1, 0},
                {AT_FLAGS, 1, 3},
                {AT_FLAGS, 1, 2},
                {AT_FLAGS, 1, 13},
                {AT_FLAGS, 1, 7},
                {AT_FLAGS, 1, 69},
                {AT_PLANES, 1, 0xA5},
                {AT_PLANES, 1, 0xB2},
                {AT_PLANES, 1, 0xF2},
                {AT_PLANES, 1, 0xA3},
                {AT_PLANES, 1, 0x92},
                {AT_PLANES, 1, 0x62},
                {AT_FLOOR, 2, 1},
                {AT_KEPT, 4, 1},
                {AT_KEPT, 4, 5},
                {AT_WIDTH, 2, 0},
                {AT_WIDTH, 2, 18},
                {AT_WIDTH, 2, 13},
                {AT_WIDTH, 2, 65535},
                {AT_WIDTH, 2, 11},
                {AT_HEIGHT, 2, 0},
                {AT_HEIGHT, 2, 18},
                {AT_HEIGHT, 2, 14},
                {AT_HEIGHT, 2, 65535},
                {AT_PAYLOAD, 4, 0},
                {AT_PAYLOAD, 4, 1},
                {AT_PAYLOAD, 4, 0xFFFFFFFF},
                {AT_QUANTUM + 4, 4, 0x7FF00000},
                {AT_QUANTUM + 4, 4, 0xFFF80000},
                {AT_QUANTUM + 4, 4, 0xBFF00000},
                {AT_QUANTUM + 4, 4, 0},
                {HEADER_BYTES, 1, 0x27},
                {HEADER_BYTES, 4, 0x184D2A50}};
    for (size_t i = 0; i < sizeof lies / sizeof *lies; i++) {
        bytes lie = {copy_of(b.data, b.size), b.size};
        for (int n = 0; n < lies[i].bytes; n++)
            lie.data[lies[i].at + (size_t)n] = (uint8_t)(lies[i].value >> 8 * n);
        sign(lie);
        assert_corrupt(codec, lie.data, lie.size, &scratch, true);
        free(lie.data);
    }
    /* Width and height exchanged fit the payload: another block, but a block. */
    bytes turned = {copy_of(b.data, b.size), b.size};
    put16(turned.data + AT_WIDTH, 15);
    put16(turned.data + AT_HEIGHT, 12);
    sign(turned);
    const rqt_status status = rqt_block_decode(codec, turned.data, turned.size, &scratch);
    assert_true(status == RQT_OK || status == RQT_CORRUPT);
    free(turned.data);
    /* A block of another k than the caller made room for. */
    rqt_block smaller = new_block(3);
    assert_int_equal(rqt_block_decode(codec, b.data, b.size, &smaller), RQT_CORRUPT);
    rqt_block_free(&smaller, &allocator);
    free(b.data);
    rqt_block_free(&block, &allocator);
    rqt_block_free(&scratch, &allocator);
    rqt_codec_free(codec);
}

static void F42_a_payload_that_lies_is_found_out_under_a_good_checksum(void **state) {
    (void)state;
    random_begin(__func__);
    rqt_codec *codec = new_codec();
    rqt_block block = new_block(1), scratch = new_block(1);
    fill(&block, 3, 3, FLAT, 0, NO_ERRORS, 0);
    bytes b = encode(codec, &block, 1);
    uint8_t header[HEADER_BYTES], payload[64] = {0};
    memcpy(header, b.data, HEADER_BYTES);
    free(b.data);
    rqt_block_header h;

    /* Four planes of heights: in range, at its ends, and just beyond. */
    header[AT_PLANES] = 4;
    static const struct {
        uint32_t residual;
        rqt_status status;
    } first[] = {{0, RQT_OK},
                 {2 * (uint32_t)(RQT_HEIGHT_LIMIT - 1), RQT_OK},
                 {2 * (uint32_t)(RQT_HEIGHT_LIMIT - 1) - 1, RQT_OK},
                 {2 * (uint32_t)RQT_HEIGHT_LIMIT, RQT_CORRUPT},
                 {2 * (uint32_t)RQT_HEIGHT_LIMIT - 1, RQT_CORRUPT},
                 {0xFFFFFFFF, RQT_CORRUPT},
                 {0xFFFFFFFE, RQT_CORRUPT}};
    for (size_t i = 0; i < sizeof first / sizeof *first; i++) {
        for (size_t plane = 0; plane < 4; plane++) payload[9 * plane] = (uint8_t)(first[i].residual >> 8 * plane);
        b = forge(header, payload, 36);
        assert_int_equal(rqt_block_info(b.data, b.size, &h, NULL), RQT_OK);
        assert_int_equal(rqt_block_decode(codec, b.data, b.size, &scratch), first[i].status);
        free(b.data);
    }
    memset(payload, 0, sizeof payload);

    /* Bits that contradict the flags, and padding that is not zero. */
    static const struct {
        uint8_t flags, bits[2];
        rqt_status status;
    } bits[] = {{1, {0xFE, 1}, RQT_OK},      {1, {0xFF, 1}, RQT_CORRUPT}, {1, {0, 0}, RQT_CORRUPT},
                {1, {0xFE, 3}, RQT_CORRUPT}, {1, {1, 0x80}, RQT_CORRUPT}, {4, {2, 0}, RQT_OK},
                {4, {0xBA, 0}, RQT_OK},      {4, {0, 0}, RQT_CORRUPT},    {4, {2, 2}, RQT_CORRUPT},
                {4, {2, 0x80}, RQT_CORRUPT}, {4, {3, 0}, RQT_CORRUPT},    {4, {2, 1}, RQT_CORRUPT},
                {4, {6, 0}, RQT_CORRUPT},    {4, {0x42, 0}, RQT_CORRUPT}, {6, {2, 0}, RQT_OK},
                {6, {2, 0x10}, RQT_CORRUPT}};
    header[AT_PLANES] = 0;
    for (size_t i = 0; i < sizeof bits / sizeof *bits; i++) {
        header[AT_FLAGS] = bits[i].flags;
        b = forge(header, bits[i].bits, 2);
        assert_int_equal(rqt_block_info(b.data, b.size, &h, NULL), RQT_OK);
        assert_int_equal(rqt_block_decode(codec, b.data, b.size, &scratch), bits[i].status);
        free(b.data);
    }
    header[AT_FLAGS] = 0;

    /* A sparse block: an error residual for every kept vertex, then bits for the centre and the four sides. */
    static const struct {
        uint32_t kept;
        size_t n;
        uint8_t payload[6];
        rqt_status status;
    } sparse[] = {{5, 2, {0, 1}, RQT_OK},
                  {5, 2, {8, 1}, RQT_OK},
                  {5, 2, {1, 1}, RQT_CORRUPT},
                  {5, 2, {0, 0}, RQT_CORRUPT},
                  {5, 2, {0, 3}, RQT_CORRUPT},
                  {5, 2, {0, 0x21}, RQT_CORRUPT},
                  {5, 2, {0, 0x81}, RQT_CORRUPT},
                  {4, 1, {0}, RQT_OK},
                  {4, 1, {1}, RQT_CORRUPT},
                  {4, 1, {2}, RQT_CORRUPT},
                  {6, 3, {0, 0, 3}, RQT_OK},
                  {6, 3, {0, 0, 0x11}, RQT_OK},
                  {6, 3, {0, 0, 6}, RQT_CORRUPT},
                  {6, 3, {0, 1, 3}, RQT_CORRUPT},
                  {6, 3, {0, 0, 0x23}, RQT_CORRUPT},
                  {5, 1, {1}, RQT_CORRUPT},
                  {9, 6, {0, 0, 0, 0, 0, 31}, RQT_OK}};
    header[AT_FLAGS] = 8;
    header[AT_PLANES] = 0x40;
    put16(header + AT_FLOOR, 500);
    for (size_t i = 0; i < sizeof sparse / sizeof *sparse; i++) {
        put32(header + AT_KEPT, sparse[i].kept);
        b = forge(header, sparse[i].payload, sparse[i].n);
        assert_int_equal(rqt_block_decode(codec, b.data, b.size, &scratch), sparse[i].status);
        free(b.data);
    }
    /* Of a larger block: bits for the centre alone, in one byte and in one too many. */
    rqt_block larger = new_block(2);
    const uint8_t bits_of_none[2] = {0, 0};
    header[AT_K] = 2;
    put32(header + AT_KEPT, 4);
    for (size_t n = 0; n <= 2; n++) {
        b = forge(header, bits_of_none, n);
        assert_int_equal(rqt_block_decode(codec, b.data, b.size, &larger), n == 1 ? RQT_OK : RQT_CORRUPT);
        free(b.data);
    }
    header[AT_K] = 1;
    rqt_block_free(&larger, &allocator);
    static const struct {
        size_t at;
        uint8_t value;
    } denied[] = {{AT_KEPT, 3},   {AT_KEPT, 10}, {AT_KEPT + 2, 1}, {AT_PLANES, 0x50}, {AT_PLANES, 0xC0},
                  {AT_GROUND, 1}, {AT_FLAGS, 0}, {AT_FLAGS, 11},   {AT_FLAGS, 24}};
    for (size_t i = 0; i < sizeof denied / sizeof *denied; i++) {
        uint8_t lie[HEADER_BYTES];
        put32(header + AT_KEPT, 5);
        memcpy(lie, header, sizeof lie);
        lie[denied[i].at] = denied[i].value;
        b = forge(lie, sparse[0].payload, 2);
        assert_corrupt(codec, b.data, b.size, &scratch, true);
        free(b.data);
    }
    header[AT_FLAGS] = 0;
    put16(header + AT_FLOOR, 0);
    put32(header + AT_KEPT, 0);

    /* A frame that is sound, but of another length than the header says; with content size and without. */
    header[AT_PLANES] = 1;
    ZSTD_CCtx *z = ZSTD_createCCtx();
    for (size_t n = 0; n <= 64; n++)
        for (int told = 0; told < 2; told++) {
            uint8_t buffer[HEADER_BYTES + 256];
            memcpy(buffer, header, HEADER_BYTES);
            put32(buffer + AT_PAYLOAD, 9);
            (void)ZSTD_CCtx_setParameter(z, ZSTD_c_contentSizeFlag, told);
            const size_t size = ZSTD_compress2(z, buffer + HEADER_BYTES, 256, payload, n);
            assert_false(ZSTD_isError(size));
            bytes wrong = {buffer, HEADER_BYTES + size};
            sign(wrong);
            assert_int_equal(rqt_block_decode(codec, wrong.data, wrong.size, &scratch),
                             n == 9 ? RQT_OK : RQT_CORRUPT);
        }
    /* Two frames in a row decompress to the sum of both. */
    uint8_t twice[HEADER_BYTES + 256];
    memcpy(twice, header, HEADER_BYTES);
    put32(twice + AT_PAYLOAD, 9);
    size_t used = ZSTD_compress2(z, twice + HEADER_BYTES, 128, payload, 4);
    used += ZSTD_compress2(z, twice + HEADER_BYTES + used, 128, payload, 5);
    bytes pair = {twice, HEADER_BYTES + used};
    sign(pair);
    assert_corrupt(codec, pair.data, pair.size, &scratch, true);
    (void)ZSTD_freeCCtx(z);
    rqt_block_free(&block, &allocator);
    rqt_block_free(&scratch, &allocator);
    rqt_codec_free(codec);
}

/* Each byte of the compressed frame, damaged and signed again. */
static void F42_a_frame_that_does_not_decompress_is_noticed(void **state) {
    (void)state;
    random_begin(__func__);
    rqt_codec *codec = new_codec();
    rqt_block block = new_block(3), scratch = new_block(3);
    fill(&block, 9, 9, NOISE, 0, LIKELY_ERRORS, 0);
    bytes b = encode(codec, &block, 1);
    int noticed = 0, broken = 0;
    for (size_t at = HEADER_BYTES; at < b.size; at++) {
        rqt_message why = {""};
        b.data[at] ^= 0x5A;
        sign(b);
        if (rqt_block_check(codec, b.data, b.size, &why) != RQT_OK) {
            assert_int_equal(rqt_block_decode(codec, b.data, b.size, &scratch), RQT_CORRUPT);
            noticed++;
            broken += strstr(why.text, "does not decompress") != NULL;
        }
        b.data[at] ^= 0x5A;
    }
    assert_true(noticed > 5 && broken > 0);
    free(b.data);
    rqt_block_free(&block, &allocator);
    rqt_block_free(&scratch, &allocator);
    rqt_codec_free(codec);
}

static void F42_random_payloads_under_a_good_checksum_do_no_harm(void **state) {
    (void)state;
    random_begin(__func__);
    rqt_codec *codec = new_codec();
    int sound[2] = {0, 0};
    for (int round = 0; round < 20000; round++) {
        const int k = (int)random_below(5), n = side_of(k);
        uint8_t header[HEADER_BYTES] = "RQTB";
        const size_t width = 1 + random_below((uint32_t)n), height = 1 + random_below((uint32_t)n);
        const bool sparse = round % 2;
        const size_t count = count_of(k), stored = width * height, half = (size_t)1 << k >> 1;
        const size_t kept = 4 + random_below(sparse && round % 3 ? 8 : (uint32_t)count - 3) % (count - 3);
        const size_t finest = sparse ? 0 : half * (3 * half + 2), others = (sparse ? kept : count) - 4 - finest;
        const uint32_t flags = random_below(8) & (round % 5 ? 4 : 7), heights = random_below(5),
                       fine = sparse ? 0 : random_below(3), error = random_below(3);
        header[AT_VERSION] = RQT_FORMAT_VERSION;
        header[AT_K] = (uint8_t)k;
        header[AT_FLAGS] = (uint8_t)(flags | (sparse ? 8 : 0));
        header[AT_PLANES] = (uint8_t)(heights | fine << 4 | error << 6);
        put16(header + AT_WIDTH, (uint16_t)width);
        put16(header + AT_HEIGHT, (uint16_t)height);
        put_double(header + AT_QUANTUM, ldexp(1, (int)random_below(2000) - 1000));
        if (sparse) put16(header + AT_FLOOR, (uint16_t)random_below(65536));
        if (flags & 4) put16(header + AT_GROUND, (uint16_t)random_below(65536));
        if (sparse) put32(header + AT_KEPT, (uint32_t)kept);
        const size_t listed = sparse ? kept : stored, known = listed * heights + finest * fine + others * error +
                                                              (flags & 1 ? (listed + 7) / 8 : 0) +
                                                              (flags & 4 ? ((sparse ? others : count) + 7) / 8 : 0);
        const size_t bits = sparse ? random_below((uint32_t)(count + 7) / 8 + 1) % 4 : 0;
        uint8_t *payload = take(known + bits);
        /* half of them mostly zeros: residuals that make sense, so that they come further */
        for (size_t i = 0; i < known + bits; i++)
            payload[i] = (uint8_t)(round % 4 < 2 || random_below(4) == 0 ? random_bits() : 0);
        bytes b = forge(header, payload, known + bits);
        rqt_block block = new_block(k);
        const rqt_status status = rqt_block_decode(codec, b.data, b.size, &block);
        assert_true(status == RQT_OK || status == RQT_CORRUPT);
        sound[sparse] += status == RQT_OK;
        if (status == RQT_OK) assert_round_trip(codec, &block, 1);
        rqt_block_free(&block, &allocator);
        free(payload);
        free(b.data);
    }
    assert_true(sound[0] > 100 && sound[1] > 100);
    rqt_codec_free(codec);
    assert_int_equal(the_heap.live, 0);
}

/* -------------------------------------------------------------------------------------------- memory -- */

/* Everything that allocates, once. */
static rqt_status use_memory(void) {
    rqt_codec *codec = NULL;
    rqt_block block, back;
    uint8_t *buffer = take(rqt_block_bound(5));
    size_t size = 0;
    memset(&back, 0, sizeof back);
    rqt_status status = rqt_block_create(5, &allocator, &block);
    if (status == RQT_OK) status = rqt_block_create(5, &allocator, &back);
    if (status == RQT_OK) status = rqt_codec_create(&allocator, &codec);
    if (status == RQT_OK) {
        fill(&block, 33, 33, TERRAIN, 4, LIKELY_ERRORS, 4);
        status = rqt_block_encode(codec, &block, 1, buffer, &size);
        if (status != RQT_OK) {
            assert_int_equal(size, 0);
            /* And a codec that ran out of memory once works again. */
            the_heap.refuse = 0;
            assert_int_equal(rqt_block_encode(codec, &block, 1, buffer, &size), RQT_OK);
        }
        const rqt_status read = rqt_block_decode(codec, buffer, size, &back);
        if (status == RQT_OK) status = read;
        if (read == RQT_OK) assert_same_block(&block, &back);
    }
    rqt_codec_free(codec);
    rqt_block_free(&back, &allocator);
    rqt_block_free(&block, &allocator);
    free(buffer);
    return status;
}

static void F48_a_refused_allocation_is_no_memory_and_no_leak(void **state) {
    (void)state;
    random_begin(__func__);
    the_heap.calls = 0;
    assert_int_equal(use_memory(), RQT_OK);
    const size_t calls = the_heap.calls;
    assert_true(calls >= 5);
    for (size_t refuse = 1; refuse <= calls; refuse++) {
        the_heap.calls = 0;
        the_heap.refuse = refuse;
        assert_int_equal(use_memory(), RQT_NO_MEMORY);
        the_heap.refuse = 0;
        assert_int_equal(the_heap.live, 0);
    }
    rqt_codec_free(NULL);
    rqt_block empty;
    memset(&empty, 0, sizeof empty);
    rqt_block_free(&empty, &allocator);
}

static void a_block_takes_the_memory_that_it_says(void **state) {
    (void)state;
    assert_int_equal(rqt_block_bytes(0), 4 * 7);
    assert_int_equal(rqt_block_bytes(6), 65 * 65 * 7);
    rqt_block block = new_block(6);
    assert_int_equal(block.k, 6);
    assert_int_equal(block.width, 65);
    assert_int_equal(block.height, 65);
    for (int i = 0; i < 65 * 65; i++) assert_true(block.q[i] == 0 && block.error[i] == 0 && block.flags[i] == 0);
    rqt_block_free(&block, &allocator);
    assert_null(block.q);
}

int main(void) {
    random_seed_begin();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_block_comes_back_whatever_its_size_heights_voids_errors_and_outline),
        cmocka_unit_test(a_cropped_block_repeats_its_last_heights_and_validity),
        cmocka_unit_test(a_sparse_block_comes_back_as_far_as_it_is_kept),
        cmocka_unit_test(a_block_gets_its_corners_from_its_summary),
        cmocka_unit_test(any_finite_quantum_above_zero_serves),
        cmocka_unit_test(equal_blocks_give_equal_bytes_whatever_lies_under_their_voids),
        cmocka_unit_test(errors_that_their_heights_imply_take_no_plane),
        cmocka_unit_test(what_cannot_be_stored_is_refused),
        cmocka_unit_test(F42_every_truncation_of_a_block_is_noticed),
        cmocka_unit_test(F42_every_flipped_bit_of_a_block_is_noticed),
        cmocka_unit_test(F42_a_header_that_lies_is_found_out_under_a_good_checksum),
        cmocka_unit_test(F42_a_payload_that_lies_is_found_out_under_a_good_checksum),
        cmocka_unit_test(F42_a_frame_that_does_not_decompress_is_noticed),
        cmocka_unit_test(F42_random_payloads_under_a_good_checksum_do_no_harm),
        cmocka_unit_test(F48_a_refused_allocation_is_no_memory_and_no_leak),
        cmocka_unit_test(a_block_takes_the_memory_that_it_says),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
