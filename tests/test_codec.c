/* test_codec.c - promises of the stored bytes: blocks, block summaries and meshes come back as they went in, equal
 * things have equal bytes, and nothing that is damaged or lies gets past a reader.
 *
 * Random numbers start anew for each test from RQT_SEED and the test's name, so a failure repeats with the seed
 * that is printed. Bytes to be read are always put into a heap allocation of exactly their size, so that a
 * sanitizer sees one byte too far. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>
#include <zstd.h>

#include "internal.h"

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
    HEADER_BYTES = 32,
    AT_SUMMARY_CHECKSUM = 8,
    AT_MESH_CHECKSUM = 8
};

typedef struct heap {
    size_t live, calls, refuse; /* refuse: the one request that is refused, counted from 1; 0: none */
} heap;
static heap the_heap;

/* ------------------------------------------------------------------------------------------- random -- */
static uint64_t random_seed, random_state;

static void random_begin(const char *test) {
    the_heap = (heap){0, 0, 0}; /* whatever a test before has left behind is that test's failure */
    random_state = random_seed;
    for (; *test; test++) random_state = random_state * 1099511628211U + (unsigned char)*test;
}

static uint64_t random_bits(void) {
    uint64_t z = random_state += 0x9E3779B97F4A7C15U;
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9U;
    z = (z ^ z >> 27) * 0x94D049BB133111EBU;
    return z ^ z >> 31;
}

static uint32_t random_below(uint32_t n) {
    return (uint32_t)(random_bits() % n);
}
static int32_t random_height(void) {
    return (int32_t)random_below(2 * (uint32_t)RQT_HEIGHT_LIMIT - 1) - (RQT_HEIGHT_LIMIT - 1);
}

/* --------------------------------------------------------------------------------------------- heap -- */
static void *heap_resize(void *context, void *p, size_t bytes) {
    heap *h = context;
    if (bytes == 0) {
        if (p) h->live--;
        free(p);
        return NULL;
    }
    if (++h->calls == h->refuse) return NULL;
    void *fresh = malloc(bytes);
    if (!fresh || p) abort(); /* these files never grow an array */
    memset(fresh, 0xA5, bytes);
    h->live++;
    return fresh;
}

static const rqt_allocator allocator = {heap_resize, &the_heap};

static void *take(size_t bytes) {
    void *p = malloc(bytes ? bytes : 1);
    if (!p) abort();
    return p;
}

/* An exact copy on the heap. */
static uint8_t *copy_of(const uint8_t *bytes, size_t size) {
    uint8_t *p = take(size);
    memcpy(p, bytes, size);
    return p;
}

static rqt_codec *new_codec(void) {
    rqt_codec *codec;
    assert_int_equal(rqt_codec_create(&allocator, &codec), RQT_OK);
    return codec;
}

static rqt_block new_block(int k) {
    rqt_block block;
    assert_int_equal(rqt_block_create(k, &allocator, &block), RQT_OK);
    return block;
}

/* ------------------------------------------------------------------------------------------- blocks -- */
typedef enum terrain { FLAT, SLOPE, TERRAIN, NOISE, FULL_RANGE, EXTREMES, KINDS } terrain;
typedef enum errors { NO_ERRORS, LIKELY_ERRORS, ANY_ERRORS, INFINITE_ERRORS, ERRORS } errors;

static int side_of(int k) {
    return (1 << k) + 1;
}
static size_t count_of(int k) {
    return (size_t)side_of(k) * (size_t)side_of(k);
}

static int32_t height_of(terrain what, int x, int y) {
    switch (what) {
    case FLAT:
        return 1234;
    case SLOPE:
        return 3 * x - 7 * y + 100;
    case TERRAIN:
        return (int32_t)(1500 + 800 * sin(x / 17.0) * cos(y / 23.0)) + (int32_t)random_below(9);
    case NOISE:
        return (int32_t)random_below(4001) - 2000;
    case FULL_RANGE:
        return random_height();
    default:
        return random_below(2) ? RQT_HEIGHT_LIMIT - 1 : 1 - RQT_HEIGHT_LIMIT;
    }
}

static rqt_code error_of(errors what) {
    switch (what) {
    case NO_ERRORS:
        return 0;
    case LIKELY_ERRORS:
        return (rqt_code)(random_below(8) ? 32768 + random_below(900) : 0);
    case ANY_ERRORS:
        return (rqt_code)random_below(65536);
    default:
        return RQT_CODE_INFINITY;
    }
}

/* voids and outline: one in so many; 0 none, 1 all. */
static void fill(rqt_block *b, int width, int height, terrain what, uint32_t voids, errors error,
                 uint32_t outline) {
    const int n = side_of(b->k);
    b->width = width;
    b->height = height;
    for (int y = 0; y < n; y++)
        for (int x = 0; x < n; x++) {
            const int at = y * n + x, from = (y < height ? y : height - 1) * n + (x < width ? x : width - 1);
            if (from == at) {
                b->flags[at] = voids && random_below(voids) == 0 ? 0 : RQT_VALID;
                b->q[at] = b->flags[at] ? height_of(what, x, y) : INT32_MIN; /* not a height: nobody may look */
            } else {
                b->flags[at] = b->flags[from] & RQT_VALID;
                b->q[at] = b->q[from];
            }
            b->error[at] = error_of(error);
        }
    for (int at = 0; at < n * n; at++)
        if (outline && random_below(outline) == 0) b->flags[at] |= RQT_OUTLINE;
}

typedef struct bytes {
    uint8_t *data;
    size_t size;
} bytes;

static bytes encode(rqt_codec *codec, const rqt_block *block, double quantum) {
    const size_t bound = rqt_block_bound(block->k);
    uint8_t *buffer = take(bound);
    bytes b;
    assert_int_equal(rqt_block_encode(codec, block, quantum, buffer, &b.size), RQT_OK);
    assert_true(b.size > HEADER_BYTES && b.size <= bound);
    b.data = copy_of(buffer, b.size);
    free(buffer);
    return b;
}

static void assert_same_block(const rqt_block *a, const rqt_block *b) {
    assert_int_equal(a->k, b->k);
    assert_int_equal(a->width, b->width);
    assert_int_equal(a->height, b->height);
    for (size_t i = 0; i < count_of(a->k); i++) {
        assert_int_equal(a->flags[i], b->flags[i]);
        assert_int_equal(a->error[i], b->error[i]);
        if (a->flags[i] & RQT_VALID) assert_int_equal(a->q[i], b->q[i]);
        assert_true(b->q[i] > -RQT_HEIGHT_LIMIT && b->q[i] < RQT_HEIGHT_LIMIT);
    }
}

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

static void errors_that_their_heights_imply_take_no_plane(void **state) {
    (void)state;
    random_begin(__func__);
    /* At stride 1 the error of a side of the finest scale is its distance from its midpoint, and that of a centre
     * the largest of its own and its sides'. A quantum of a tenth is no binary fraction: prediction must not slip.
     */
    rqt_codec *codec = new_codec();
    rqt_block block = new_block(2);
    fill(&block, 5, 5, TERRAIN, 0, NO_ERRORS, 0);
    for (int i = 0; i < 25; i++) block.q[i] = 10 * i * i;
    const rqt_unit unit = {0, 10, 1, 1, 1.0, 0.0};
#define SIDE(at, a, b) \
    rqt_code_from_quanta(&unit, 0, (uint64_t)llabs(2LL * block.q[at] - block.q[a] - block.q[b]), 2)
#define RAISE(at, by) block.error[at] = block.error[by] > block.error[at] ? block.error[by] : block.error[at]
    for (int scale = 1; scale <= 2; scale++) {
        for (int y = 0; y < 5; y += scale)
            for (int x = y / scale % 2 ? 0 : scale; x < 5; x += 2 * scale) {
                const int at = y * 5 + x, step = y / scale % 2 ? 5 * scale : scale;
                block.error[at] = SIDE(at, at - step, at + step);
                for (int c = 0; c < 4 && scale == 2; c++) {
                    const int cx = x + (c % 2 ? 1 : -1), cy = y + (c / 2 ? 1 : -1);
                    if (cx >= 0 && cx < 5 && cy >= 0 && cy < 5) RAISE(at, cy * 5 + cx);
                }
            }
        for (int y = scale; y < 5; y += 2 * scale)
            for (int x = scale; x < 5; x += 2 * scale) {
                const int at = y * 5 + x, turn = (x - scale) / (2 * scale) % 2 != (y - scale) / (2 * scale) % 2;
                const int step = scale * (turn ? 4 : 6);
                block.error[at] = scale == 1 ? SIDE(at, at - step, at + step) : 0;
                RAISE(at, at - scale);
                RAISE(at, at + scale);
                RAISE(at, at - 5 * scale);
                RAISE(at, at + 5 * scale);
            }
    }
    bytes b = encode(codec, &block, 0.1);
    rqt_block_header h;
    assert_int_equal(rqt_block_info(b.data, b.size, &h, NULL), RQT_OK);
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

static uint32_t reference_midpoint(const int32_t *q, int n, double quantum, int x, int y, int dx, int dy) {
    const uint32_t t =
        2 * (uint32_t)q[y * n + x] - (uint32_t)q[(y - dy) * n + x - dx] - (uint32_t)q[(y + dy) * n + x + dx];
    double h = quantum * (0.5 - ldexp(1, -21));
    h = h < ldexp(1, -90) ? ldexp(1, -90) : h > ldexp(1, 90) ? ldexp(1, 90) : h;
    const float v = fabsf((float)(int32_t)t) * (float)h;
    uint32_t code = 0;
    if (v > 0) /* the smallest code c with (128 + c % 128) * 2^(c / 128 - 263) >= v */
        for (code = (uint32_t)(ilogb(v) + 256) * 128; ldexp(128 + code % 128, (int)(code / 128) - 263) < v;) code++;
    return code;
}

static void reference_code(const rqt_block_header *h, const int32_t *q, rqt_code *error, int x, int y, int q_step,
                           bool centre, uint32_t residual) {
    const int n = side_of(h->k), half = q_step / 2;
    uint32_t p = 0;
    for (int c = 0; c < 4; c++) {
        int cx = x, cy = y;
        if (centre) {
            cx += c == 0 ? -q_step : c == 1 ? q_step : 0;
            cy += c == 2 ? -q_step : c == 3 ? q_step : 0;
        } else {
            cx += c % 2 ? half : -half;
            cy += c / 2 ? half : -half;
        }
        if ((centre || half) && cx >= 0 && cx < n && cy >= 0 && cy < n && error[cy * n + cx] > p)
            p = error[cy * n + cx];
    }
    uint32_t middle = 0;
    if (!centre) {
        const bool even = y / q_step % 2 == 0;
        middle = reference_midpoint(q, n, h->quantum, x, y, even ? q_step : 0, even ? 0 : q_step);
    } else if (2 * q_step != n - 1) {
        const bool alike = (x - q_step) / (2 * q_step) % 2 == (y - q_step) / (2 * q_step) % 2;
        middle = reference_midpoint(q, n, h->quantum, x, y, q_step, alike ? q_step : -q_step);
    }
    error[y * n + x] = (rqt_code)((middle > p ? middle : p) + unzigzag(residual));
}

static void reference_decode(bytes b, rqt_block *block) {
    rqt_block_header h;
    assert_int_equal(rqt_block_info(b.data, b.size, &h, NULL), RQT_OK);
    const int n = side_of(h.k);
    const size_t stored = (size_t)(h.width * h.height), count = count_of(h.k);
    uint8_t *payload = take(h.payload);
    assert_int_equal(ZSTD_decompress(payload, h.payload, b.data + HEADER_BYTES, b.size - HEADER_BYTES), h.payload);
    const uint8_t *errors_at = payload + stored * (size_t)h.height_planes;
    const uint8_t *bits = errors_at + count * (size_t)h.error_planes;
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
    if (h.has_outline)
        for (size_t i = 0; i < count; i++)
            if (bits[i / 8] >> i % 8 & 1) block->flags[i] |= RQT_OUTLINE;
    size_t next = 0;
#define NEXT() plane_value(errors_at, count, h.error_planes, next++)
    for (int step = 1; step < n - 1; step *= 2) {
        for (int y = 0; y < n; y += step)
            for (int x = y / step % 2 ? 0 : step; x < n; x += 2 * step)
                reference_code(&h, q, block->error, x, y, step, false, NEXT());
        for (int y = step; y < n; y += 2 * step)
            for (int x = step; x < n; x += 2 * step) reference_code(&h, q, block->error, x, y, step, true, NEXT());
    }
    for (int c = 0; c < 4; c++)
        block->error[(c / 2 ? (n - 1) * n : 0) + (c % 2 ? n - 1 : 0)] = (rqt_code)unzigzag(NEXT());
    assert_int_equal(next, count);
    block->width = h.width;
    block->height = h.height;
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
            for (int round = 0; round < 4; round++) {
                fill(&block, round < 2 ? n : 1 + (int)random_below((uint32_t)n), round < 3 ? n : (n + 1) / 2, what,
                     round ? 5 : 0, round % 2 ? LIKELY_ERRORS : ANY_ERRORS, 9);
                bytes b = encode(codec, &block, quanta[round]);
                reference_decode(b, &back);
                assert_same_block(&block, &back);
                /* under the voids too */
                assert_int_equal(rqt_block_decode(codec, b.data, b.size, &ours), RQT_OK);
                assert_memory_equal(ours.q, back.q, count_of(k) * sizeof *ours.q);
                free(b.data);
            }
        rqt_block_free(&ours, &allocator);
        rqt_block_free(&back, &allocator);
        rqt_block_free(&block, &allocator);
    }
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

static void every_truncation_of_a_block_is_noticed(void **state) {
    (void)state;
    random_begin(__func__);
    rqt_codec *codec = new_codec();
    for (int k = 0; k <= 6; k += 3) {
        rqt_block block = new_block(k);
        fill(&block, side_of(k), side_of(k), TERRAIN, 8, LIKELY_ERRORS, 8);
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

static void flip(uint8_t *data, size_t bit) {
    data[bit / 8] = (uint8_t)(data[bit / 8] ^ 1U << bit % 8);
}

static void every_flipped_bit_of_a_block_is_noticed(void **state) {
    (void)state;
    random_begin(__func__);
    rqt_codec *codec = new_codec();
    for (int k = 0; k <= RQT_MAX_BLOCK_K; k++) {
        rqt_block block = new_block(k);
        fill(&block, side_of(k), side_of(k), k % 2 ? NOISE : TERRAIN, 8, LIKELY_ERRORS, 8);
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

static void a_header_that_lies_is_found_out_under_a_good_checksum(void **state) {
    (void)state;
    random_begin(__func__);
    rqt_codec *codec = new_codec();
    rqt_block block = new_block(4), scratch = new_block(4);
    fill(&block, 12, 15, NOISE, 5, LIKELY_ERRORS, 5);
    bytes b = encode(codec, &block, 1);
    rqt_block_header h;
    assert_int_equal(rqt_block_info(b.data, b.size, &h, NULL), RQT_OK);
    assert_true(h.has_voids && h.has_outline && h.height_planes == 2 && h.error_planes == 2);
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
                {AT_PLANES, 1, 0x25},
                {AT_PLANES, 1, 0x32},
                {AT_PLANES, 1, 0xF2},
                {AT_PLANES, 1, 0x23},
                {AT_PLANES, 1, 0x12},
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

static void a_payload_that_lies_is_found_out_under_a_good_checksum(void **state) {
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
                {1, {0xFE, 3}, RQT_CORRUPT}, {1, {1, 0x80}, RQT_CORRUPT}, {4, {1, 0}, RQT_OK},
                {4, {0xFF, 1}, RQT_OK},      {4, {0, 0}, RQT_CORRUPT},    {4, {1, 2}, RQT_CORRUPT},
                {4, {0, 0x80}, RQT_CORRUPT}, {6, {1, 1}, RQT_OK},         {6, {1, 0x10}, RQT_CORRUPT}};
    header[AT_PLANES] = 0;
    for (size_t i = 0; i < sizeof bits / sizeof *bits; i++) {
        header[AT_FLAGS] = bits[i].flags;
        b = forge(header, bits[i].bits, 2);
        assert_int_equal(rqt_block_info(b.data, b.size, &h, NULL), RQT_OK);
        assert_int_equal(rqt_block_decode(codec, b.data, b.size, &scratch), bits[i].status);
        free(b.data);
    }
    header[AT_FLAGS] = 0;

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

static void random_payloads_under_a_good_checksum_do_no_harm(void **state) {
    (void)state;
    random_begin(__func__);
    rqt_codec *codec = new_codec();
    for (int round = 0; round < 3000; round++) {
        const int k = (int)random_below(5), n = side_of(k);
        uint8_t header[HEADER_BYTES] = "RQTB";
        const size_t width = 1 + random_below((uint32_t)n), height = 1 + random_below((uint32_t)n);
        const size_t stored = width * height, count = count_of(k);
        const uint32_t flags = random_below(8), heights = random_below(5), error = random_below(3);
        header[AT_VERSION] = RQT_FORMAT_VERSION;
        header[AT_K] = (uint8_t)k;
        header[AT_FLAGS] = (uint8_t)flags;
        header[AT_PLANES] = (uint8_t)(heights | error << 4);
        put16(header + AT_WIDTH, (uint16_t)width);
        put16(header + AT_HEIGHT, (uint16_t)height);
        put_double(header + AT_QUANTUM, ldexp(1, (int)random_below(2000) - 1000));
        const size_t size = stored * heights + count * error + (flags & 1 ? (stored + 7) / 8 : 0) +
                            (flags & 4 ? (count + 7) / 8 : 0);
        uint8_t *payload = take(size);
        for (size_t i = 0; i < size; i++) payload[i] = (uint8_t)random_bits();
        bytes b = forge(header, payload, size);
        rqt_block block = new_block(k);
        const rqt_status status = rqt_block_decode(codec, b.data, b.size, &block);
        assert_true(status == RQT_OK || status == RQT_CORRUPT);
        if (status == RQT_OK) assert_round_trip(codec, &block, 1);
        rqt_block_free(&block, &allocator);
        free(payload);
        free(b.data);
    }
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

static void a_refused_allocation_is_no_memory_and_no_leak(void **state) {
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

static void a_damaged_or_lying_summary_is_noticed(void **state) {
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

static void a_damaged_mesh_is_noticed(void **state) {
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

static void a_mesh_that_lies_is_found_out_under_a_good_checksum(void **state) {
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
    const char *text = getenv("RQT_SEED");
    random_seed = text ? strtoull(text, NULL, 0) : (uint64_t)time(NULL);
    printf("RQT_SEED=%llu\n", (unsigned long long)random_seed);
    (void)fflush(stdout);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_block_comes_back_whatever_its_size_heights_voids_errors_and_outline),
        cmocka_unit_test(a_cropped_block_repeats_its_last_heights_and_validity),
        cmocka_unit_test(any_finite_quantum_above_zero_serves),
        cmocka_unit_test(equal_blocks_give_equal_bytes_whatever_lies_under_their_voids),
        cmocka_unit_test(errors_that_their_heights_imply_take_no_plane),
        cmocka_unit_test(the_bytes_of_a_block_mean_what_the_format_says),
        cmocka_unit_test(what_cannot_be_stored_is_refused),
        cmocka_unit_test(every_truncation_of_a_block_is_noticed),
        cmocka_unit_test(every_flipped_bit_of_a_block_is_noticed),
        cmocka_unit_test(a_header_that_lies_is_found_out_under_a_good_checksum),
        cmocka_unit_test(a_payload_that_lies_is_found_out_under_a_good_checksum),
        cmocka_unit_test(random_payloads_under_a_good_checksum_do_no_harm),
        cmocka_unit_test(a_refused_allocation_is_no_memory_and_no_leak),
        cmocka_unit_test(a_block_takes_the_memory_that_it_says),
        cmocka_unit_test(a_summary_comes_back_and_the_height_of_a_void_is_nothing),
        cmocka_unit_test(a_damaged_or_lying_summary_is_noticed),
        cmocka_unit_test(a_summary_answers_from_em_up_to_below_its_parents),
        cmocka_unit_test(a_block_is_needed_iff_its_centre_is_selected),
        cmocka_unit_test(a_mesh_comes_back),
        cmocka_unit_test(a_damaged_mesh_is_noticed),
        cmocka_unit_test(a_mesh_that_lies_is_found_out_under_a_good_checksum),
        cmocka_unit_test(counts_beyond_all_memory_have_no_size),
        cmocka_unit_test(a_checksum_ignores_its_field_and_sees_everything_else),
        cmocka_unit_test(a_sentence_is_cut_where_it_must_and_between_characters),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
