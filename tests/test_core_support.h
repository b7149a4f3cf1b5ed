/* test_core_support.h - what the test programs of the core share: random numbers, a counting heap, rasters made in
 * memory, and a raster with everything that the oracle and the core say about it.
 *
 * Only headers, so that every test program is one source file plus oracle.c. Random numbers come from one
 * generator, started anew for each test from RQT_SEED and the test's own name: a test fails alike alone and among
 * others. */
#ifndef TEST_CORE_SUPPORT_H
#define TEST_CORE_SUPPORT_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "oracle.h"
#include "rqt.h"

/* A failed check says where and with what; nothing is formatted when it holds. */
#define CHECK(condition, ...)                        \
    do {                                             \
        if (!(condition)) {                          \
            print_error("failed: %s\n", #condition); \
            fail_msg(__VA_ARGS__);                   \
        }                                            \
    } while (0)

/* ------------------------------------------------------------------------------------------ random -- */
static uint64_t random_seed, random_state;

static inline void random_announce(void) {
    const char *text = getenv("RQT_SEED");
    random_seed = text ? strtoull(text, NULL, 0) : (uint64_t)time(NULL);
    printf("RQT_SEED=%llu\n", (unsigned long long)random_seed);
    (void)fflush(stdout);
}

static inline void random_begin(const char *test) {
    random_state = random_seed;
    for (; *test; test++) random_state = random_state * 1099511628211u + (unsigned char)*test;
}

static inline uint64_t random_bits(void) {
    uint64_t z = random_state += 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

/* low .. high, both included. */
static inline int random_between(int low, int high) {
    return low + (int)(random_bits() % (uint64_t)((int64_t)high - low + 1));
}

static inline double random_unit(void) {
    return (double)(random_bits() >> 11) / 9007199254740992.0;
}

/* -------------------------------------------------------------------------------------------- heap --
 * An allocator that counts what is alive, and says no when asked to. */
typedef struct heap {
    size_t live;      /* bytes not yet released */
    size_t calls;     /* requests for memory so far */
    size_t fail_from; /* the first request that is refused, counted from 1; 0: none */
    size_t fail_to;   /* the last one */
    size_t failures;  /* how many were refused */
} heap;

#define HEAP_HEAD 16 /* keeps the alignment of malloc */

static inline void *heap_resize(void *context, void *p, size_t bytes) {
    heap *h = context;
    unsigned char *old = p ? (unsigned char *)p - HEAP_HEAD : NULL;
    size_t old_bytes = 0;
    if (old) memcpy(&old_bytes, old, sizeof old_bytes);
    if (bytes == 0) {
        h->live -= old_bytes;
        free(old);
        return NULL;
    }
    h->calls++;
    if (h->fail_from && h->calls >= h->fail_from && h->calls <= h->fail_to) {
        h->failures++;
        return NULL;
    }
    unsigned char *fresh = malloc(bytes + HEAP_HEAD);
    if (!fresh) abort();
    memcpy(fresh, &bytes, sizeof bytes);
    /* What nobody wrote must not look like zeros. */
    memset(fresh + HEAP_HEAD, 0xA5, bytes);
    if (old) {
        memcpy(fresh + HEAP_HEAD, old + HEAP_HEAD, old_bytes < bytes ? old_bytes : bytes);
        free(old);
    }
    h->live += bytes - old_bytes;
    return fresh + HEAP_HEAD;
}

static heap test_heap;
static const rqt_allocator test_allocator = {heap_resize, &test_heap};

/* ----------------------------------------------------------------------------------------- rasters -- */
typedef struct raster {
    int width, height;
    int32_t *q;
    uint8_t *valid; /* NULL: no voids */
    rqt_unit unit;
    rqt_void_cost cost;
    const char *name;
} raster;

static const rqt_unit UNIT_METRE = {0, 1, 1, 1, 1.0, 0.0};
static const rqt_unit UNIT_FOOT = {0, 1, 381, 1250, 1.0, 0.0};
static const rqt_unit UNIT_SURVEY_FOOT = {-1000, 10, 1200, 3937, 1.0, 5.5};
static const rqt_unit UNIT_MILLIMETRE = {120, 1000, 1, 1, 1.0, 0.0};
static const rqt_unit UNIT_ODD = {7, 7, 1, 1, -0.1, -3.25};

static inline rqt_unit random_unit_of_height(void) {
    const rqt_unit units[] = {UNIT_METRE, UNIT_METRE, UNIT_FOOT, UNIT_SURVEY_FOOT, UNIT_MILLIMETRE, UNIT_ODD};
    return units[random_between(0, 5)];
}

/* A raster from heights and validity that somebody else keeps; both are copied. valid may be NULL. */
static inline raster raster_from_memory(int width, int height, const int32_t *q, const uint8_t *valid,
                                        const rqt_unit *unit, const char *name) {
    raster r = {width, height, NULL, NULL, *unit, {25.0, 1.0}, name};
    size_t n = (size_t)(width * height);
    r.q = malloc(n * sizeof *r.q);
    if (!r.q) abort();
    if (q)
        memcpy(r.q, q, n * sizeof *r.q);
    else
        memset(r.q, 0, n * sizeof *r.q);
    if (valid) {
        r.valid = malloc(n);
        if (!r.valid) abort();
        memcpy(r.valid, valid, n);
    }
    return r;
}

static inline void raster_free(raster *r) {
    free(r->q);
    free(r->valid);
    memset(r, 0, sizeof *r);
}

/* Small ones are shown whole, so that a failure can be made a test by hand. */
static inline void raster_print(const raster *r) {
    print_error("%s: %d x %d, unit d=%d %d/%d scale=%.17g, cell=%.17g c=%.17g\n", r->name, r->width, r->height,
                r->unit.d, r->unit.numerator, r->unit.denominator, r->unit.scale, r->cost.cell, r->cost.c);
    if (r->width > 24 || r->height > 24) return;
    for (int y = 0; y < r->height; y++) {
        for (int x = 0; x < r->width; x++) {
            int n = y * r->width + x;
            if (r->valid && !r->valid[n])
                print_error(" void");
            else
                print_error(" %d", (int)r->q[n]);
        }
        print_error("\n");
    }
}

typedef enum surface {
    SURFACE_NOISE,
    SURFACE_CONSTANT,
    SURFACE_PLANE,
    SURFACE_TAKAGI,
    SURFACE_SPIKE_CORNER,
    SURFACE_SPIKE_BORDER,
    SURFACE_SPIKE_INTERIOR,
    SURFACE_PIT,
    SURFACE_CLIFF,
    SURFACE_CLIFF_SLANTED,
    SURFACE_CHECKERBOARD,
    SURFACE_RIDGE,
    SURFACE_EXTREMES,
    SURFACE_HILLS,
    SURFACE_COUNT
} surface;

static const char *const surface_names[SURFACE_COUNT] = {
    "noise",    "constant", "plane", "takagi",        "spike at a corner", "spike at a border",
    "spike",    "pit",      "cliff", "slanted cliff", "checkerboard",      "ridge",
    "extremes", "hills"};

/* The surface on which errors against the next coarser edge mislead most: tents over tents, all heights even. */
static inline int takagi(int x, int y, int side) {
    int z = 0;
    for (int period = side; period >= 2; period /= 2) {
        int u = x % period, v = y % period;
        z += (u < period - u ? u : period - u) + (v < period - v ? v : period - v);
    }
    return 2 * z;
}

static inline int32_t surface_height(surface s, int x, int y, int width, int height, const int parameter[4]) {
    int spike = parameter[2];
    switch (s) {
    case SURFACE_NOISE:
        return random_between(-100, 100);
    case SURFACE_CONSTANT:
        return parameter[0];
    case SURFACE_PLANE:
        return parameter[2] + 2 * parameter[0] * x + x + 2 * parameter[1] * y - y;
    case SURFACE_TAKAGI:
        return takagi(x, y, 64);
    case SURFACE_SPIKE_CORNER:
        return x == (parameter[0] & 1) * (width - 1) && y == (parameter[1] & 1) * (height - 1) ? spike : 0;
    case SURFACE_SPIKE_BORDER:
        return x == (parameter[0] & 0xFF) % width && y == height - 1 ? spike : 0;
    case SURFACE_SPIKE_INTERIOR:
        return x == (parameter[0] & 0xFF) % width && y == (parameter[1] & 0xFF) % height ? spike : 0;
    case SURFACE_PIT:
        return x == (width | 1) / 2 + 1 && y == (height | 1) / 2 - 1 ? -1 : 1000;
    case SURFACE_CLIFF:
        return x > (parameter[0] & 0xFF) % width ? 500 : -3;
    case SURFACE_CLIFF_SLANTED:
        return 3 * x + (parameter[1] & 7) * y > 2 * width ? 800 : 0;
    case SURFACE_CHECKERBOARD:
        return ((x ^ y) & 1) * 77;
    case SURFACE_RIDGE:
        return -abs(x + y - width) * 13;
    case SURFACE_EXTREMES:
        return random_between(0, 1) ? RQT_HEIGHT_LIMIT - 1 : 1 - RQT_HEIGHT_LIMIT;
    case SURFACE_HILLS:
        return (takagi(x, y, 16) * 3 + takagi(x + 5, y + 11, 64) * 7 + x * y / 3) + random_between(0, 3);
    default:
        return 0;
    }
}

/* voids: the share of samples without data, in per cent; 100 leaves none. -1: NULL mask. */
static inline raster raster_make(surface s, int width, int height, int voids) {
    const rqt_unit unit = random_unit_of_height();
    const double cells[] = {25.0, 0.1, 1.0 / 3, 1000.0}, tolerances[] = {1.0, 0.1, 3.0, 1.0};
    raster r = raster_from_memory(width, height, NULL, NULL, &unit, surface_names[s]);
    int parameter[4];
    for (int n = 0; n < 4; n++) parameter[n] = random_between(-1000, 1000);
    if (parameter[2] == 0) parameter[2] = 1;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) r.q[y * width + x] = surface_height(s, x, y, width, height, parameter);
    int which = random_between(0, 3);
    r.cost.cell = cells[which];
    r.cost.c = tolerances[random_between(0, 3)];
    if (voids >= 0) {
        r.valid = malloc((size_t)(width * height));
        if (!r.valid) abort();
        for (int n = 0; n < width * height; n++) r.valid[n] = random_between(0, 99) >= voids;
    }
    return r;
}

/* A void as lakes are: a rectangle, and one sample elsewhere. Random samples alone leave no large kept leaf. */
static inline void raster_add_lake(raster *r) {
    if (!r->valid) {
        r->valid = malloc((size_t)(r->width * r->height));
        if (!r->valid) abort();
        memset(r->valid, 1, (size_t)(r->width * r->height));
    }
    int x0 = random_between(0, r->width - 1), y0 = random_between(0, r->height - 1);
    int x1 = random_between(x0, r->width - 1), y1 = random_between(y0, r->height - 1);
    for (int y = y0; y <= y1 && y <= y0 + r->height / 3; y++)
        for (int x = x0; x <= x1 && x <= x0 + r->width / 3; x++) r->valid[y * r->width + x] = 0;
    r->valid[random_between(0, r->width * r->height - 1)] = 0;
}

/* ------------------------------------------------------------------------------------------- model --
 * A raster, what the oracle says of it, and what the core says. */
typedef struct model {
    raster r;
    oracle o;
    rqt_grid grid;
    rqt_errors raw, saturated;
} model;

static inline void model_create(model *m, raster r) {
    const oracle_terrain terrain = {r.width,          r.height,           r.q,      r.valid,     r.unit.scale,
                                    r.unit.numerator, r.unit.denominator, r.unit.d, r.cost.cell, r.cost.c};
    memset(m, 0, sizeof *m);
    m->r = r;
    oracle_create(&m->o, &terrain);
    assert_int_equal(rqt_lattice_init(&m->grid.lattice, r.width, r.height), RQT_OK);
    m->grid.q = r.q;
    m->grid.valid = r.valid;
    assert_int_equal(rqt_errors_compute(&m->grid, &r.unit, &r.cost, &test_allocator, NULL, NULL, &m->raw), RQT_OK);
    assert_int_equal(rqt_errors_compute(&m->grid, &r.unit, &r.cost, &test_allocator, NULL, NULL, &m->saturated),
                     RQT_OK);
    rqt_errors_saturate(&m->saturated);
}

static inline void model_free(model *m) {
    rqt_errors_free(&m->raw, &test_allocator);
    rqt_errors_free(&m->saturated, &test_allocator);
    oracle_free(&m->o);
    raster_free(&m->r);
}

/* Raw errors, saturated errors and outline bits equal the oracle's at every lattice vertex. For a raster from
 * anywhere: takes it over. */
static inline void check_errors_equal_oracle(raster r) {
    model m;
    model_create(&m, r);
    CHECK(m.grid.lattice.K == m.o.K, "%s: K is %d, should be %d", r.name, m.grid.lattice.K, m.o.K);
    bool any = false;
    for (int y = 0; y < m.o.side; y++) {
        for (int x = 0; x < m.o.side; x++) {
            const oracle_node *n = oracle_at(&m.o, x, y);
            const rqt_vertex v = {x, y};
            bool raw_outline, outline;
            unsigned raw = rqt_errors_at(&m.raw, v, &raw_outline), code = rqt_errors_at(&m.saturated, v, &outline);
            any = any || n->raw_outline;
            if (raw == n->raw_code && code == n->code && raw_outline == (n->raw_outline != 0) &&
                outline == (n->outline != 0))
                continue;
            raster_print(&m.r);
            fail_msg("vertex (%d,%d): raw %u outline %d, saturated %u outline %d; should be %u %d, %u %d", x, y,
                     raw, raw_outline, code, outline, n->raw_code, n->raw_outline, n->code, n->outline);
        }
    }
    CHECK(m.raw.any_outline == any && m.saturated.any_outline == any, "any_outline is not %d", any);
    model_free(&m);
}

/* ------------------------------------------------------------------------------------ cmocka around -- */
static inline int begin_test(void **state) {
    (void)state;
    memset(&test_heap, 0, sizeof test_heap);
    return 0;
}

/* Every test gives back what it took. */
static inline int end_test(void **state) {
    (void)state;
    if (test_heap.live != 0) print_error("%zu bytes were never released\n", test_heap.live);
    return test_heap.live == 0 ? 0 : -1;
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, begin_test, end_test)

#endif
