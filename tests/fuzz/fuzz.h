/* fuzz.h - what the fuzzers share: numbers out of the bytes that come in, a heap that counts and gives out,
 * terrains.
 *
 * A fuzzer is one door: LLVMFuzzerTestOneInput gets bytes, makes calls of them, and checks what must hold for any.
 * Its bytes are decisions (take_...), so that any bytes reach far in and none are wasted on a format that a
 * checksum protects; where the door itself takes bytes, some of the input goes there as it is. A crash, a
 * sanitizer's word or a failed HOLD is a finding. README.md says which public function has which fuzzer. */
#ifndef FUZZ_H
#define FUZZ_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "rqt.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
/* How many inputs the tests take: about a second's, sanitized. */
extern const long fuzz_runs;

#define HOLD(condition, ...)                                                                     \
    do {                                                                                         \
        if (!(condition)) {                                                                      \
            (void)fprintf(stderr, "%s:%d: does not hold: %s: ", __FILE__, __LINE__, #condition); \
            (void)fprintf(stderr, __VA_ARGS__);                                                  \
            (void)fputc('\n', stderr);                                                           \
            abort();                                                                             \
        }                                                                                        \
    } while (0)

/* ---------------------------------------------------------------------------------------------- decisions */
typedef struct input {
    const uint8_t *bytes;
    size_t size; /* that are left; zeros follow */
} input;

static inline uint64_t take_bits(input *in, int bytes) {
    uint64_t v = 0;
    for (int i = 0; i < bytes; i++) {
        v = v << 8 | (in->size ? *in->bytes : 0);
        if (in->size) in->bytes++, in->size--;
    }
    return v;
}

/* low .. high, both included. */
static inline int take_between(input *in, int low, int high) {
    const uint64_t n = (uint64_t)((int64_t)high - low) + 1;
    return (int)(low + (int64_t)(take_bits(in, n <= 256 ? 1 : n <= 65536 ? 2 : 4) % n));
}

/* Numbers as an enemy has them: special ones, round ones, and any bits at all. */
static inline double take_double(input *in) {
    static const double special[] = {0,        -0.0,      1,      -1,     0.5,    1e-3,       1e3,
                                     1e9,      1e18,      -1e18,  1e300,  -1e300, 1e-300,     5e-324,
                                     INFINITY, -INFINITY, NAN,    90,     180,    -180,       360,
                                     4326,     0x1p-20,   0x1p20, 0x1p40, 0x1p53, 2147483647, -2147483648.0};
    const int kind = take_between(in, 0, 7);
    if (kind < 2) return special[take_bits(in, 1) % (sizeof special / sizeof *special)];
    if (kind < 5) return take_between(in, -64, 64) / 8.0;
    if (kind < 7) return (double)(int32_t)take_bits(in, 4) / 65536;
    const uint64_t bits = take_bits(in, 8);
    double v;
    memcpy(&v, &bits, sizeof v);
    return v;
}

/* ------------------------------------------------------------------------------------------------- memory */
/* Counts, and refuses the request number `refuse` (0: none). */
typedef struct fuzz_heap {
    size_t live, calls, refuse;
} fuzz_heap;

static inline void *fuzz_resize(void *context, void *p, size_t bytes) {
    fuzz_heap *h = context;
    size_t before = 0;
    unsigned char *old = p ? (unsigned char *)p - 16 : NULL;
    if (old) memcpy(&before, old, sizeof before);
    if (bytes == 0) {
        h->live -= before;
        free(old);
        return NULL;
    }
    if (++h->calls == h->refuse || bytes > (size_t)1 << 30) return NULL;
    unsigned char *fresh = realloc(old, bytes + 16);
    if (!fresh) return NULL;
    memcpy(fresh, &bytes, sizeof bytes);
    h->live += bytes - before;
    return fresh + 16;
}

/* A heap for one input: now and then one of its requests is refused. */
static inline rqt_allocator fuzz_allocator(fuzz_heap *h, input *in) {
    const int kind = take_between(in, 0, 15);
    *h = (fuzz_heap){.refuse = kind == 0 ? (size_t)take_between(in, 1, 200) : 0};
    return (rqt_allocator){fuzz_resize, h};
}

/* OK, or no memory because some was refused; false: the input ends here. */
static inline bool went_well(rqt_status status, const fuzz_heap *h) {
    HOLD(status == RQT_OK || (status == RQT_NO_MEMORY && h->refuse && h->calls >= h->refuse), "status %d",
         (int)status);
    return status == RQT_OK;
}

/* ----------------------------------------------------------------------------------------------- terrains */
enum { FUZZ_SIDE = 24 };

typedef struct fuzz_terrain {
    rqt_grid grid;
    rqt_unit unit;
    rqt_void_cost cost;
    int k;
    int32_t q[FUZZ_SIDE * FUZZ_SIDE];
    uint8_t valid[FUZZ_SIDE * FUZZ_SIDE];
} fuzz_terrain;

static inline rqt_unit take_unit(input *in) {
    static const int32_t ratio[][2] = {{1, 1}, {381, 1250}, {1200, 3937}};
    static const int32_t d[] = {1, 10, 100, 1000, 1024, 7, 1 << 20};
    const int named = take_between(in, 0, 3);
    rqt_unit unit = {.z0 = take_between(in, -9000, 9000),
                     .d = d[take_between(in, 0, 6)],
                     .numerator = ratio[named % 3][0],
                     .denominator = ratio[named % 3][1],
                     .scale = named == 3 ? take_double(in) : 1,
                     .offset = take_between(in, 0, 3) == 0 ? take_double(in) : 0};
    if (!rqt_unit_is_valid(&unit)) unit.scale = 1, unit.offset = 0;
    return unit;
}

/* Up to FUZZ_SIDE samples a side; heights small, large or both, with voids or not. */
static inline void take_terrain(input *in, fuzz_terrain *t) {
    memset(t, 0, sizeof *t);
    const int shape = take_between(in, 0, 7);
    const int width = shape == 0 ? 1 : take_between(in, 1, FUZZ_SIDE),
              height = shape == 1 ? 1 : take_between(in, 1, FUZZ_SIDE);
    HOLD(rqt_lattice_init(&t->grid.lattice, width, height) == RQT_OK, "%d x %d", width, height);
    const int K = t->grid.lattice.K;
    t->k = K == 0 ? 0 : take_between(in, 1, K < 4 ? K : 4);
    t->unit = take_unit(in);
    t->cost = (rqt_void_cost){.cell = take_between(in, 1, 1000) / 8.0, .c = take_between(in, 1, 80) / 8.0};
    const int relief = take_between(in, 0, 3);
    const bool voids = take_between(in, 0, 1) != 0;
    uint32_t noise = (uint32_t)take_bits(in, 4);
    for (int i = 0; i < width * height; i++) {
        /* Few bytes a sample, or a whole terrain would eat every input: noise, with samples of the input's own. */
        noise = noise * 1664525u + 1013904223u;
        const int32_t rough = (int32_t)(noise >> 8);
        t->q[i] = relief == 0   ? 5
                  : relief == 1 ? rough % 64
                  : relief == 2 ? (i % width) * 3 - (i / width) * 2 + rough % 5
                                : (rough % 3 - 1) * (RQT_HEIGHT_LIMIT - 1);
        t->valid[i] = !voids || (noise >> 28) != 0;
    }
    for (int n = take_between(in, 0, 8); n > 0; n--) {
        const int at = take_between(in, 0, width * height - 1);
        t->q[at] =
            take_between(in, 0, 3) ? take_between(in, -500, 500) : (int32_t)(take_bits(in, 4) % RQT_HEIGHT_LIMIT);
        if (voids) t->valid[at] = (uint8_t)take_between(in, 0, 1);
    }
    t->grid.q = t->q;
    t->grid.valid = voids ? t->valid : NULL;
}

/* Any tolerance, often one that is small. */
static inline rqt_code take_eps(input *in) {
    return take_between(in, 0, 2) ? rqt_code_floor(take_between(in, 0, 4000) / 16.0)
                                  : (rqt_code)take_between(in, 0, RQT_CODE_LARGEST);
}

/* ------------------------------------------------------------------------------------ bytes with checksums */
/* FORMAT.md, "Checksum": what an enemy computes, too. */
static inline void fuzz_sign(uint8_t *bytes, size_t size, size_t field) {
    if (size < field + 8) return;
    memset(bytes + field, 0, 8);
    uint64_t h = UINT64_C(0x9E3779B97F4A7C15) ^ ((uint64_t)size * UINT64_C(0xFF51AFD7ED558CCD));
    for (size_t i = 0; i < size; i += 8) {
        uint64_t word = 0;
        memcpy(&word, bytes + i, size - i < 8 ? size - i : 8);
        h = (h ^ word) * UINT64_C(0xC2B2AE3D27D4EB4F);
        h = h << 29 | h >> 35;
    }
    h = (h ^ h >> 32) * UINT64_C(0xFF51AFD7ED558CCD);
    h ^= h >> 29;
    memcpy(bytes + field, &h, 8);
}

/* Up to four bytes changed. */
static inline void take_damage(input *in, uint8_t *bytes, size_t size) {
    for (int n = take_between(in, 0, 4); n > 0 && size > 0; n--) {
        const size_t at = (size_t)take_bits(in, 4) % (take_between(in, 0, 1) ? size : size < 160 ? size : 160);
        const unsigned changed =
            take_between(in, 0, 1) ? (unsigned)take_bits(in, 1) : bytes[at] ^ 1u << take_between(in, 0, 7);
        bytes[at] = (uint8_t)changed;
    }
}

/* A copy in an allocation of exactly its size, so that a sanitizer sees one too far. */
static inline uint8_t *exact_copy(const uint8_t *bytes, size_t size) {
    uint8_t *copy = malloc(size ? size : 1);
    if (!copy) abort();
    memcpy(copy, bytes, size);
    return copy;
}

#endif
