/* test_codec_support.h - what the test programs of the stored bytes share: random numbers, a counting heap, and
 * blocks of many kinds with what encodes and compares them.
 *
 * Random numbers start anew for each test from RQT_SEED and the test's name, so a failure repeats with the seed
 * that is printed. Bytes to be read are always put into a heap allocation of exactly their size, so that a
 * sanitizer sees one byte too far. */
#ifndef TEST_CODEC_SUPPORT_H
#define TEST_CODEC_SUPPORT_H

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

#include "internal.h"

enum { HEADER_BYTES = 40 };

typedef struct heap {
    size_t live, calls, refuse; /* refuse: the one request that is refused, counted from 1; 0: none */
} heap;
static heap the_heap;

/* ------------------------------------------------------------------------------------------- random -- */
static uint64_t random_seed, random_state;

/* For main: every run says how to repeat it. */
static inline void random_seed_begin(void) {
    const char *text = getenv("RQT_SEED");
    random_seed = text ? strtoull(text, NULL, 0) : (uint64_t)time(NULL);
    printf("RQT_SEED=%llu\n", (unsigned long long)random_seed);
    (void)fflush(stdout);
}

static inline void random_begin(const char *test) {
    the_heap = (heap){0, 0, 0}; /* whatever a test before has left behind is that test's failure */
    random_state = random_seed;
    for (; *test; test++) random_state = random_state * 1099511628211U + (unsigned char)*test;
}

static inline uint64_t random_bits(void) {
    uint64_t z = random_state += 0x9E3779B97F4A7C15U;
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9U;
    z = (z ^ z >> 27) * 0x94D049BB133111EBU;
    return z ^ z >> 31;
}

static inline uint32_t random_below(uint32_t n) {
    return (uint32_t)(random_bits() % n);
}
static inline int32_t random_height(void) {
    return (int32_t)random_below(2 * (uint32_t)RQT_HEIGHT_LIMIT - 1) - (RQT_HEIGHT_LIMIT - 1);
}

/* --------------------------------------------------------------------------------------------- heap -- */
static inline void *heap_resize(void *context, void *p, size_t bytes) {
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

static inline void *take(size_t bytes) {
    void *p = malloc(bytes ? bytes : 1);
    if (!p) abort();
    return p;
}

/* An exact copy on the heap. */
static inline uint8_t *copy_of(const uint8_t *bytes, size_t size) {
    uint8_t *p = take(size);
    memcpy(p, bytes, size);
    return p;
}

static inline rqt_codec *new_codec(void) {
    rqt_codec *codec;
    assert_int_equal(rqt_codec_create(&allocator, &codec), RQT_OK);
    return codec;
}

static inline rqt_block new_block(int k) {
    rqt_block block;
    assert_int_equal(rqt_block_create(k, &allocator, &block), RQT_OK);
    return block;
}

static inline void flip(uint8_t *data, size_t bit) {
    data[bit / 8] = (uint8_t)(data[bit / 8] ^ 1U << bit % 8);
}

/* ------------------------------------------------------------------------------------------- blocks -- */
typedef enum terrain { FLAT, SLOPE, TERRAIN, NOISE, FULL_RANGE, EXTREMES, KINDS } terrain;
typedef enum errors { NO_ERRORS, LIKELY_ERRORS, ANY_ERRORS, INFINITE_ERRORS, ERRORS } errors;

static inline int side_of(int k) {
    return (1 << k) + 1;
}
static inline size_t count_of(int k) {
    return (size_t)side_of(k) * (size_t)side_of(k);
}

static inline int32_t height_of(terrain what, int x, int y) {
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

static inline rqt_code error_of(errors what) {
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
static inline void fill(rqt_block *b, int width, int height, terrain what, uint32_t voids, errors error,
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

/* The parents of a vertex within a block, by their places; corners are nobody's child here. */
static inline int parents_of(int k, int at, int parents[2]) {
    const int n = side_of(k), x = at % n, y = at / n, last = n - 1;
    int count = 0, q = 1;
    if (x % last == 0 && y % last == 0) return 0;
    while (x % (2 * q) == 0 && y % (2 * q) == 0) q *= 2;
    for (int c = 0; c < 4; c++) {
        int px = x, py = y;
        if (x % (2 * q) && y % (2 * q)) { /* a centre: the two corners of its cell that are sides themselves */
            px += c & 1 ? q : -q;
            py += c & 2 ? q : -q;
            if ((px / (2 * q) + py / (2 * q)) % 2 == 0 || 2 * q == last) continue;
        } else { /* a side: the centres beside it */
            if (c > 1) continue;
            *(x % (2 * q) ? &py : &px) += c ? q : -q;
            if (px < 0 || py < 0 || px > last || py > last) continue;
        }
        parents[count++] = py * n + px;
    }
    return count;
}

static inline bool is_block_corner(int k, int at) {
    const int n = side_of(k), last = n - 1;
    return at % n % last == 0 && at / n % last == 0;
}

static inline bool is_kept(const rqt_block *b, int at) {
    return !b->sparse || is_block_corner(b->k, at) || b->error[at] > b->floor || b->flags[at] & RQT_OUTLINE;
}

/* Errors and outline bits handed on to the parents, as those of a terrain are. */
static inline void make_sparse(rqt_block *b, rqt_code floor) {
    const int n = side_of(b->k);
    for (int q = 1; q < n - 1; q *= 2)
        for (int centre = 0; centre < 2; centre++)
            for (int y = 0; y < n; y += q)
                for (int x = 0; x < n; x += q) {
                    if ((x / q % 2 + y / q % 2) != 1 + centre) continue;
                    const int at = y * n + x;
                    int parents[2];
                    for (int c = parents_of(b->k, at, parents); c-- > 0;) {
                        if (b->error[parents[c]] < b->error[at]) b->error[parents[c]] = b->error[at];
                        b->flags[parents[c]] |= b->flags[at] & RQT_OUTLINE;
                    }
                }
    b->sparse = true;
    b->floor = floor;
}

typedef struct bytes {
    uint8_t *data;
    size_t size;
} bytes;

static inline bytes encode(rqt_codec *codec, const rqt_block *block, double quantum) {
    const size_t bound = rqt_block_bound(block->k);
    uint8_t *buffer = take(bound);
    bytes b;
    assert_int_equal(rqt_block_encode(codec, block, quantum, buffer, &b.size), RQT_OK);
    assert_true(b.size > HEADER_BYTES && b.size <= bound);
    b.data = copy_of(buffer, b.size);
    free(buffer);
    return b;
}

/* b is what decoding made of a. */
static inline void assert_same_block(const rqt_block *a, const rqt_block *b) {
    assert_int_equal(a->k, b->k);
    assert_int_equal(a->width, b->width);
    assert_int_equal(a->height, b->height);
    assert_int_equal(a->sparse, b->sparse);
    assert_int_equal(a->floor, b->floor);
    for (int i = 0; i < (int)count_of(a->k); i++) {
        const bool kept = is_kept(a, i), corner = is_block_corner(a->k, i);
        const uint8_t mask = corner ? RQT_VALID : 255;
        assert_int_equal(b->flags[i], kept ? a->flags[i] & mask : RQT_VALID);
        assert_int_equal(b->error[i], kept && !corner ? a->error[i] : 0);
        if (!kept || a->flags[i] & RQT_VALID) assert_int_equal(b->q[i], kept ? a->q[i] : 0);
        assert_true(b->q[i] > -RQT_HEIGHT_LIMIT && b->q[i] < RQT_HEIGHT_LIMIT);
    }
}

#endif
