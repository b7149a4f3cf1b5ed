/* fuzz_terrain.h - a terrain's whole pyramid in memory, and queries of it. */
#ifndef FUZZ_TERRAIN_H
#define FUZZ_TERRAIN_H

#include "fuzz.h"

typedef struct pyramid {
    rqt_block_number *number;
    rqt_summary *summary;
    rqt_block *block;
    size_t count;
} pyramid;

static inline void pyramid_free(pyramid *p, const rqt_allocator *a) {
    for (size_t i = 0; p->block && i < p->count; i++) rqt_block_free(&p->block[i], a);
    free(p->number);
    free(p->summary);
    free(p->block);
    *p = (pyramid){0};
}

static inline rqt_status pyramid_make(const fuzz_terrain *t, const rqt_errors *saturated, const rqt_allocator *a,
                                      pyramid *p) {
    rqt_pyramid *whole = NULL;
    *p = (pyramid){0};
    rqt_status status = rqt_pyramid_create(&t->grid, saturated, t->k, a, &whole);
    if (status != RQT_OK) return status;
    p->count = rqt_pyramid_count(whole);
    p->number = calloc(p->count, sizeof *p->number);
    p->summary = calloc(p->count, sizeof *p->summary);
    p->block = calloc(p->count, sizeof *p->block);
    if (!p->number || !p->summary || !p->block) abort();
    for (size_t i = 0; i < p->count && status == RQT_OK; i++) {
        status = rqt_block_create(t->k, a, &p->block[i]);
        if (status == RQT_OK) rqt_pyramid_block(whole, i, &p->number[i], &p->summary[i], &p->block[i]);
        HOLD(status != RQT_OK || i == 0 || p->number[i] > p->number[i - 1], "block numbers do not ascend");
    }
    rqt_pyramid_free(whole);
    if (status != RQT_OK) pyramid_free(p, a);
    return status;
}

static inline const rqt_block *pyramid_read(void *context, rqt_block_number number) {
    const pyramid *p = context;
    for (size_t i = 0; i < p->count; i++)
        if (p->number[i] == number) return &p->block[i];
    HOLD(false, "the query wants block %llu, which there is not", (unsigned long long)number);
    return NULL;
}

static inline bool never(void *context) {
    (void)context;
    return false;
}

/* The query with its answers, to be freed by the caller. */
static inline rqt_query pyramid_query(const fuzz_terrain *t, pyramid *p, const rqt_region *region, rqt_code eps,
                                      rqt_outline outline) {
    rqt_query query = {.lattice = t->grid.lattice,
                       .k = t->k,
                       .region = region,
                       .eps = eps,
                       .outline = outline,
                       .read_block = pyramid_read,
                       .is_interrupted = never,
                       .context = p};
    int32_t x0, y0, x1, y1;
    query.answers = calloc(p->count + 1, sizeof *query.answers);
    if (!query.answers) abort();
    if (!rqt_region_box(region, &x0, &y0, &x1, &y1)) return query;
    for (size_t i = 0; i < p->count; i++) {
        rqt_block_place at;
        HOLD(rqt_block_locate(&query.lattice, t->k, p->number[i], &at) == RQT_OK, "block %llu",
             (unsigned long long)p->number[i]);
        if (at.x > x1 || at.x + at.side < x0 || at.y > y1 || at.y + at.side < y0) continue;
        if (rqt_summary_answers(&p->summary[i], outline, eps))
            query.answers[query.answer_count++] = (rqt_answer){p->number[i], p->summary[i]};
    }
    return query;
}

/* Everything, a box, a line, a triangle, or rings and members over one another, somewhere. NULL: no memory. */
static inline rqt_region *take_region(input *in, const rqt_lattice *l, const rqt_allocator *a) {
    char text[400];
    rqt_geometry *g = NULL;
    rqt_region *region = NULL;
    rqt_message why;
    rqt_status status = RQT_OK;
    const int kind = take_between(in, 0, 5);
    const double x = take_between(in, -16, 200) / 8.0, y = take_between(in, -16, 200) / 8.0;
    const double u = take_between(in, -16, 200) / 8.0, v = take_between(in, -16, 200) / 8.0;
    if (kind == 1)
        (void)snprintf(text, sizeof text, "POLYGON((%g %g, %g %g, %g %g, %g %g, %g %g))", x, y, u, y, u, v, x, v, x,
                       y);
    if (kind == 2) (void)snprintf(text, sizeof text, "LINESTRING(%g %g, %g %g, %g %g)", x, y, u, v, v, y);
    if (kind == 3)
        (void)snprintf(text, sizeof text, "POLYGON((%g %g, %g %g, %g %g, %g %g))", x, y, u, y, v, u, x, y);
    /* thirds and sevenths: places that no double has */
    if (kind == 4)
        (void)snprintf(text, sizeof text,
                       "POLYGON((%.17g %.17g, %g %.17g, %.17g %g, %.17g %.17g), (%g %g, %g %g, %g %g, %g %g))",
                       x / 3, y / 7, u, v / 3, v / 7, y, x / 3, y / 7, y, x, v, y, u, v, y, x);
    if (kind == 5)
        (void)snprintf(text, sizeof text,
                       "GEOMETRYCOLLECTION(POLYGON((%g %g, %g %g, %.17g %g, %g %g)), LINESTRING(%g %.17g, %g %g), "
                       "POINT(%g %g))",
                       x, y, u, y, v / 3, u, x, y, y, u / 7, v, x, x, v);
    if (kind) status = rqt_geometry_parse(text, strlen(text), true, a, &g, &why);
    const rqt_placement origin = {0, 0, 1, 1};
    if (status == RQT_OK) status = rqt_region_create(g, &origin, l, a, &region);
    HOLD(status == RQT_OK || status == RQT_NO_MEMORY, "%s", text);
    rqt_geometry_free(g);
    return region;
}

#endif
