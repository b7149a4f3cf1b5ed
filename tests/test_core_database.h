/* test_core_database.h - a database that is an array: every block of a pyramid as encoded bytes, and the query run
 * over it as a store would run it. Windows with the text that the core parses and the exact coordinates that the
 * oracle clips with. */
#ifndef TEST_CORE_DATABASE_H
#define TEST_CORE_DATABASE_H

#include "test_core_support.h"

#include <math.h>

typedef struct stored {
    rqt_block_number number;
    rqt_summary summary;
    rqt_block_place place;
    uint8_t *bytes;
    size_t size;
} stored;

typedef struct database {
    rqt_lattice lattice;
    int k;
    stored *block;
    size_t count;
    rqt_codec *codec;
    rqt_block scratch;    /* the one block that read_block has room for */
    const rqt_rule *rule; /* of the queries to come; NULL: eps alone */
    const rqt_query *asking;
    size_t reads;
    int corrupt; /* read_block fails */
} database;

static inline void database_free(database *d, const rqt_allocator *allocator) {
    for (size_t n = 0; n < d->count; n++) free(d->block[n].bytes);
    free(d->block);
    rqt_codec_free(d->codec);
    rqt_block_free(&d->scratch, allocator);
    memset(d, 0, sizeof *d);
}

/* Everything goes through its stored bytes and back. Any status but RQT_OK is the first that the core gave. */
static inline rqt_status database_fill(database *d, const model *m, rqt_pyramid *pyramid, rqt_block *block,
                                       const rqt_allocator *allocator) {
    const double quantum = fabs(rqt_unit_factor(&m->r.unit)) / m->r.unit.d;
    size_t count = rqt_pyramid_count(pyramid);
    (void)allocator;
    d->block = calloc(count ? count : 1, sizeof *d->block);
    if (!d->block) abort();
    for (; d->count < count; d->count++) {
        stored *s = &d->block[d->count];
        rqt_summary summary;
        uint8_t bytes[RQT_SUMMARY_BYTES];
        rqt_pyramid_block(pyramid, d->count, &s->number, &summary, block);
        rqt_summary_encode(&summary, bytes);
        assert_int_equal(rqt_summary_decode(bytes, sizeof bytes, &s->summary), RQT_OK);
        assert_int_equal(rqt_block_locate(&d->lattice, d->k, s->number, &s->place), RQT_OK);
        s->bytes = malloc(rqt_block_bound(d->k));
        if (!s->bytes) abort();
        rqt_status status = rqt_block_encode(d->codec, block, quantum, s->bytes, &s->size);
        if (status != RQT_OK) {
            free(s->bytes);
            return status;
        }
        assert_true(s->size <= rqt_block_bound(d->k));
    }
    return RQT_OK;
}

static inline rqt_status database_create(database *d, const model *m, int k, const rqt_allocator *allocator) {
    rqt_pyramid *pyramid = NULL;
    rqt_block block = {0};
    memset(d, 0, sizeof *d);
    d->lattice = m->grid.lattice;
    d->k = k;
    rqt_status status = rqt_codec_create(allocator, &d->codec);
    if (status == RQT_OK) status = rqt_block_create(k, allocator, &d->scratch);
    if (status == RQT_OK) status = rqt_block_create(k, allocator, &block);
    if (status == RQT_OK) status = rqt_pyramid_create(&m->grid, &m->saturated, k, allocator, &pyramid);
    if (status == RQT_OK) status = database_fill(d, m, pyramid, &block, allocator);
    rqt_pyramid_free(pyramid);
    rqt_block_free(&block, allocator);
    if (status != RQT_OK) database_free(d, allocator);
    return status;
}

static inline const rqt_block *database_read(void *context, rqt_block_number number) {
    database *d = context;
    size_t vertices = ((size_t)(1 << d->k) + 1) * ((size_t)(1 << d->k) + 1);
    for (size_t n = 0; n < d->count; n++) {
        const stored *s = &d->block[n];
        if (s->number != number) continue;
        if (d->corrupt) return NULL;
        const rqt_answer answer = {number, s->summary};
        CHECK(d->asking->rule ? rqt_query_selects_inside(d->asking, &answer)
                              : rqt_summary_needs_block(&s->summary, d->asking->outline, d->asking->eps),
              "block %llu was read though its summary is enough", (unsigned long long)number);
        d->reads++;
        /* valid until the next call only: the block before is gone */
        memset(d->scratch.q, 0x5A, vertices * sizeof *d->scratch.q);
        memset(d->scratch.error, 0x5A, vertices * sizeof *d->scratch.error);
        memset(d->scratch.flags, 0x5A, vertices);
        if (rqt_block_decode(d->codec, s->bytes, s->size, &d->scratch) != RQT_OK) return NULL;
        rqt_block_set_corners(&d->scratch, &s->summary);
        return &d->scratch;
    }
    fail_msg("block %llu was asked for and does not exist", (unsigned long long)number);
    return NULL;
}

/* What an index would return: in no particular order, chosen by summary and clamped extent. */
static inline size_t database_answers(const database *d, const rqt_region *region, rqt_code eps,
                                      rqt_outline outline, rqt_answer *answers) {
    int32_t x0, y0, x1, y1;
    size_t count = 0;
    if (!rqt_region_box(region, &x0, &y0, &x1, &y1)) return 0;
    for (size_t n = 0; n < d->count; n++) {
        const rqt_block_place *p = &d->block[n].place;
        int32_t last_x = d->lattice.width - 1, last_y = d->lattice.height - 1;
        int32_t right = p->x + p->side < last_x ? p->x + p->side : last_x;
        int32_t bottom = p->y + p->side < last_y ? p->y + p->side : last_y;
        if (p->x > x1 || right < x0 || p->y > y1 || bottom < y0) continue;
        const rqt_summary *summary = &d->block[n].summary;
        if (d->rule ? !rqt_rule_is_answered(d->rule, p, summary, outline) ||
                          rqt_rule_is_answered_above(d->rule, p, summary, outline)
                    : !rqt_summary_answers(summary, outline, eps))
            continue;
        answers[count++] = (rqt_answer){d->block[n].number, d->block[n].summary};
    }
    for (size_t n = count; n > 1; n--) {
        size_t other = (size_t)(random_bits() % n);
        rqt_answer swap = answers[n - 1];
        answers[n - 1] = answers[other];
        answers[other] = swap;
    }
    return count;
}

static inline rqt_status database_query_as(database *d, const rqt_region *region, rqt_code eps, rqt_select select,
                                           rqt_outline outline, rqt_product product, bool leaves,
                                           rqt_scratch *scratch, const rqt_allocator *allocator, rqt_patch *patch) {
    rqt_answer *answers = calloc(d->count ? d->count : 1, sizeof *answers);
    if (!answers) abort();
    rqt_query query = {.lattice = d->lattice,
                       .k = d->k,
                       .region = region,
                       .eps = eps,
                       .rule = d->rule,
                       .select = select,
                       .outline = outline,
                       .product = product,
                       .wants_leaves = leaves,
                       .scratch = scratch,
                       .answers = answers,
                       .answer_count = database_answers(d, region, eps, outline, answers),
                       .read_block = database_read,
                       .context = d};
    d->asking = &query;
    rqt_status status = rqt_query_run(&query, allocator, patch);
    d->asking = NULL;
    free(answers);
    return status;
}

static inline rqt_status database_query(database *d, const rqt_region *region, rqt_code eps, rqt_select select,
                                        rqt_outline outline, const rqt_allocator *allocator, rqt_patch *patch) {
    return database_query_as(d, region, eps, select, outline, RQT_PRODUCT_TRIANGLES, false, NULL, allocator, patch);
}

/* Legal block sizes of a terrain: 0 only where nothing else fits. */
static inline int smallest_k(const rqt_lattice *l) {
    return l->K == 0 ? 0 : 1;
}
static inline int largest_k(const rqt_lattice *l) {
    return l->K < RQT_MAX_BLOCK_K ? l->K : RQT_MAX_BLOCK_K;
}

/* ----------------------------------------------------------------------------------------- windows --
 * The union of rectangles, or a line or point (a rectangle without area is one, too). */
typedef struct window {
    char text[1024];
    const char *kind;
    int all;
    int rectangle_count, segment_count;
    long rectangle[2][4]; /* x0 y0 x1 y1 */
    long segment[3][4];
} window;

static inline int window_meets(const window *w, const oracle *o, const oracle_triangle *t) {
    int meets = w->all;
    for (int n = 0; n < w->rectangle_count && !meets; n++) meets = oracle_meets_rectangle(o, t, w->rectangle[n]);
    for (int n = 0; n < w->segment_count && !meets; n++) meets = oracle_meets_segment(o, t, w->segment[n]);
    return meets;
}

static inline double samples_of(long units) {
    return (double)units / (double)ORACLE_UNITS;
}

static inline void window_append(window *w, const char *format, ...) __attribute__((format(printf, 2, 3)));
static inline void window_append(window *w, const char *format, ...) {
    size_t used = strlen(w->text);
    va_list list;
    va_start(list, format);
    int n = vsnprintf(w->text + used, sizeof w->text - used, format, list);
    va_end(list);
    if (n < 0 || (size_t)n >= sizeof w->text - used) abort();
}

static inline void window_append_ring(window *w, double x0, double y0, double x1, double y1) {
    window_append(w, "((%.17g %.17g, %.17g %.17g, %.17g %.17g, %.17g %.17g, %.17g %.17g))", x0, y0, x1, y0, x1, y1,
                  x0, y1, x0, y0);
}

static inline window window_all(void) {
    window w = {.kind = "all", .all = 1};
    return w;
}

static inline window window_of(const long rectangle[4]) {
    window w = {.kind = "given", .rectangle_count = 1};
    memcpy(w.rectangle[0], rectangle, sizeof w.rectangle[0]);
    window_append(&w, "POLYGON");
    window_append_ring(&w, samples_of(rectangle[0]), samples_of(rectangle[1]), samples_of(rectangle[2]),
                       samples_of(rectangle[3]));
    return w;
}

/* A coordinate from a little before to a little after the raster, a multiple of `grain` units. */
static inline long random_coordinate(int samples, long grain) {
    long span = (samples + 3) * ORACLE_UNITS / grain;
    return ((long)(random_bits() % (uint64_t)(span + 1))) * grain - 2 * ORACLE_UNITS;
}

static inline void random_rectangle(int width, int height, long grain, long r[4]) {
    do {
        for (int n = 0; n < 4; n++) r[n] = random_coordinate(n % 2 ? height : width, grain);
        for (int n = 0; n < 2; n++)
            if (r[n] > r[n + 2]) {
                long swap = r[n];
                r[n] = r[n + 2];
                r[n + 2] = swap;
            }
    } while (r[0] == r[2] || r[1] == r[3]);
}

enum { WINDOW_KINDS = 12 };

static inline window random_window(int width, int height, int kind) {
    const long grains[] = {1, ORACLE_UNITS, ORACLE_UNITS / 2, ORACLE_UNITS / 4};
    window w = {.kind = "fractions"};
    long r[4], s[4];
    random_rectangle(width, height, 1, r);
    switch (kind) {
    case 1:
    case 2:
    case 3:
        random_rectangle(width, height, grains[kind], r);
        w = window_of(r);
        w.kind = kind == 1 ? "on samples" : kind == 2 ? "on halves" : "on quarters";
        break;
    case 4: /* thinner than a cell, down to one unit, beside a sample line or anywhere */
        if (random_between(0, 1)) r[0] = random_between(0, width) * ORACLE_UNITS - random_between(0, 1);
        r[2] = r[0] + (1L << random_between(0, 19));
        w = window_of(r);
        w.kind = "thin";
        break;
    case 5: /* outside, touching the border or not */
        r[0] = (width - 1) * ORACLE_UNITS + random_between(0, 1);
        r[2] = r[0] + random_between(1, 1 << 20);
        w = window_of(r);
        w.kind = "outside";
        break;
    case 6: { /* coordinates that no region keeps: each goes to the nearest unit, and the rectangle may collapse */
        double c[4];
        do
            for (int n = 0; n < 4; n++) c[n] = (random_unit() * 1.2 - 0.1) * (n % 2 ? height : width);
        while (fabs(c[0] - c[2]) < 1e-5 || fabs(c[1] - c[3]) < 1e-5);
        w.kind = "off the units";
        window_append(&w, "POLYGON");
        window_append_ring(&w, c[0], c[1], c[2], c[3]);
        for (int n = 0; n < 2; n++) {
            r[n] = oracle_round(c[n] < c[n + 2] ? c[n] : c[n + 2]);
            r[n + 2] = oracle_round(c[n] < c[n + 2] ? c[n + 2] : c[n]);
        }
        w.rectangle_count = 1;
        memcpy(w.rectangle[0], r, sizeof r);
        break;
    }
    case 7:
        random_rectangle(width, height, grains[random_between(0, 3)], s);
        w.kind = "two rectangles";
        w.rectangle_count = 2;
        memcpy(w.rectangle[0], r, sizeof r);
        memcpy(w.rectangle[1], s, sizeof s);
        window_append(&w, "MULTIPOLYGON(");
        for (int n = 0; n < 2; n++) {
            const long *a = w.rectangle[n];
            if (n) window_append(&w, ", ");
            window_append_ring(&w, samples_of(a[0]), samples_of(a[1]), samples_of(a[2]), samples_of(a[3]));
        }
        window_append(&w, ")");
        break;
    case 8: { /* often along sample lines and diagonals, where triangles meet */
        long grain = grains[random_between(0, 3)];
        int segments = random_between(1, 3);
        w.kind = "line";
        long x = random_coordinate(width, grain), y = random_coordinate(height, grain);
        window_append(&w, "LINESTRING(%.17g %.17g", samples_of(x), samples_of(y));
        for (int n = 0; n < segments; n++) {
            long to_x = random_coordinate(width, grain), to_y = random_coordinate(height, grain);
            int way = random_between(0, 3);
            if (way == 0)
                to_x = x;
            else if (way == 1)
                to_y = y;
            else if (way == 2)
                to_y = y + (to_x - x) * (random_between(0, 1) ? 1 : -1);
            const long segment[4] = {x, y, to_x, to_y};
            memcpy(w.segment[n], segment, sizeof segment);
            window_append(&w, ", %.17g %.17g", samples_of(to_x), samples_of(to_y));
            x = to_x;
            y = to_y;
        }
        window_append(&w, ")");
        w.segment_count = segments;
        break;
    }
    case 9: {
        long grain = grains[random_between(0, 3)];
        long x = random_coordinate(width, grain), y = random_coordinate(height, grain);
        const long segment[4] = {x, y, x, y};
        w.kind = "point";
        window_append(&w, "POINT(%.17g %.17g)", samples_of(x), samples_of(y));
        w.segment_count = 1;
        memcpy(w.segment[0], segment, sizeof segment);
        break;
    }
    case 10: { /* a rectangle that the rounding makes a line */
        long x = random_coordinate(width, grains[random_between(0, 3)]);
        const long segment[4] = {x, r[1], x, r[3]};
        w.kind = "collapsed";
        window_append(&w, "POLYGON");
        window_append_ring(&w, samples_of(x) - 0x1p-23, samples_of(r[1]), samples_of(x) + 0x1p-23,
                           samples_of(r[3]));
        w.segment_count = 1;
        memcpy(w.segment[0], segment, sizeof segment);
        break;
    }
    case 11:
        w.kind = "empty";
        window_append(&w, "POLYGON EMPTY");
        break;
    default:
        w = window_of(r);
        w.kind = "fractions";
    }
    return w;
}

static const rqt_placement AT_ORIGIN = {0, 0, 1, 1};

static inline rqt_region *region_of(const window *w, const rqt_lattice *lattice) {
    rqt_geometry *geometry = NULL;
    rqt_region *region = NULL;
    rqt_message message = {""};
    if (!w->all)
        CHECK(rqt_geometry_parse(w->text, strlen(w->text), true, &test_allocator, &geometry, &message) == RQT_OK,
              "%s: %s", w->text, message.text);
    assert_int_equal(rqt_region_create(geometry, &AT_ORIGIN, lattice, &test_allocator, &region), RQT_OK);
    rqt_geometry_free(geometry);
    return region;
}

/* ----------------------------------------------------------------------------------------- patches --
 * A triangle as its three samples (row * width + col), lowest first; the winding is kept or dropped. */
typedef struct key {
    int64_t v[3];
} key;

static inline int ordered_keys(const void *a, const void *b) {
    const key *x = a, *y = b;
    for (int n = 0; n < 3; n++)
        if (x->v[n] != y->v[n]) return x->v[n] < y->v[n] ? -1 : 1;
    return 0;
}

/* Rotated until the lowest comes first: equal keys are equal triangles of equal winding. */
static inline key key_wound(int64_t a, int64_t b, int64_t c) {
    key k = {{a, b, c}};
    while (k.v[0] > k.v[1] || k.v[0] > k.v[2]) {
        int64_t first = k.v[0];
        k.v[0] = k.v[1];
        k.v[1] = k.v[2];
        k.v[2] = first;
    }
    return k;
}

static inline key key_unwound(int64_t a, int64_t b, int64_t c) {
    key k = key_wound(a, b, c);
    if (k.v[1] > k.v[2]) {
        int64_t swap = k.v[1];
        k.v[1] = k.v[2];
        k.v[2] = swap;
    }
    return k;
}

static inline key *keys_of_patch(const rqt_patch *p, int width) {
    key *keys = calloc(p->triangle_count ? p->triangle_count : 1, sizeof *keys);
    if (!keys) abort();
    for (size_t n = 0; n < p->triangle_count; n++) {
        int64_t v[3];
        for (int m = 0; m < 3; m++) {
            CHECK(p->triangles[3 * n + (size_t)m] < p->vertex_count, "triangle %zu: index out of range", n);
            const rqt_patch_vertex *at = &p->vertices[p->triangles[3 * n + (size_t)m]];
            v[m] = (int64_t)at->row * width + at->col;
        }
        keys[n] = key_unwound(v[0], v[1], v[2]);
    }
    if (p->triangle_count) qsort(keys, p->triangle_count, sizeof *keys, ordered_keys);
    return keys;
}

#endif
