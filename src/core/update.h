/* update.h - what the files of an update share: update.c, update_search.c, update_blocks.c. */
#ifndef RQT_UPDATE_H
#define RQT_UPDATE_H

#include "deviation.h"
#include "error_tile.h"

/* What has become of a vertex whose error or outline bit may be another one. */
typedef struct updated_vertex {
    rqt_code code, old_code;
    uint8_t outline, old_outline;
    uint8_t changed; /* else nothing else is filled in */
} updated_vertex;

/* The vertices of one scale that a change of the rectangle can reach, and those of coarser scales between them,
 * which are not used: places i0 + u, j0 + v, in steps of 2^scale. */
typedef struct update_level {
    int32_t i0, j0, columns, rows;
    updated_vertex *vertex;
} update_level;

/* A block that the update has to do with. */
typedef struct update_item update_item;
struct update_item {
    rqt_block_number number;
    rqt_block_place place;
    update_item *next; /* of the same level */
    rqt_block block;   /* q NULL: not there. Of stride 1: new samples, old errors until it is made anew */
    uint8_t *valid;    /* the mask of a block of stride 1; NULL: no voids */
    bool remake;       /* its bytes may change */
    bool differs;      /* they do */
    bool summarize;    /* its summary may change */
    bool has_before;   /* the summary has been read */
    rqt_summary before;
    rqt_code em; /* new, where remade */
    bool outline;
};

typedef struct update_cell_key {
    int64_t bound;
    int level;
    int32_t i, j;
} update_cell_key;

typedef struct update {
    const rqt_update *given;
    const rqt_allocator *allocator;
    rqt_lattice lattice;
    int k, levels;         /* levels of blocks */
    rqt_status status;     /* of the first thing that failed */
    bool has_voids;        /* before or after */
    sample_window area;    /* the samples that differ lie in here */
    deviation_field field; /* without samples */
    update_level level[RQT_MAX_K + 1];
    update_item *items[RQT_MAX_K + 1]; /* by level of blocks */
    update_item **table;               /* open addressing by number */
    size_t slots, count;
    update_item *last; /* found */
    uint8_t *mask;     /* of a block that is no item */
    uint8_t *known;    /* scratch of a block's size */
    update_cell_key *heap;
    size_t heap_count, heap_capacity;
    rqt_update_result *result;
} update;

/* Remember a failure; always false. */
bool update_fail(update *u, rqt_status status);

static inline bool update_touches(const update *u, int32_t x, int32_t y) {
    return x >= u->area.x0 && x <= u->area.x1 && y >= u->area.y0 && y <= u->area.y1;
}
/* The new sample of the rectangle: RQT_VALID or 0. */
static inline uint8_t update_sample(const update *u, int32_t x, int32_t y, int32_t *q) {
    const rqt_update *g = u->given;
    const size_t at = (size_t)(y - g->y) * (size_t)g->width + (size_t)(x - g->x);
    const uint8_t valid = !g->valid || g->valid[at] ? RQT_VALID : 0;
    *q = valid ? g->q[at] : 0;
    return valid;
}
/* What has become of a vertex; NULL: it is what it was. */
static inline const updated_vertex *update_find(const update *u, rqt_vertex v) {
    const int scale = rqt_vertex_scale(&u->lattice, v);
    const update_level *l = &u->level[scale];
    const int32_t i = (v.x >> scale) - l->i0, j = (v.y >> scale) - l->j0;
    if (!l->vertex || i < 0 || j < 0 || i >= l->columns || j >= l->rows) return NULL;
    const updated_vertex *found = &l->vertex[(size_t)j * (size_t)l->columns + (size_t)i];
    return found->changed ? found : NULL;
}

/* ------------------------------------------------------------------------------------------ update_blocks.c -- */
/* Is there a block of this level at cell (i,j)? */
bool update_exists(const update *u, int level, int32_t i, int32_t j);
/* The item of a block that exists, made if need be; NULL: no memory. */
update_item *update_take(update *u, int level, int32_t i, int32_t j);
/* With its block of stride 1, into which new samples have been put; NULL after a failure. */
update_item *update_load(update *u, int32_t i, int32_t j);
/* The summary as it was. */
bool update_summary(update *u, int level, int32_t i, int32_t j, rqt_summary *summary);
/* All blocks that change, to be written: errors of all vertices are known. */
bool update_blocks(update *u);
void update_blocks_free(update *u);

/* ------------------------------------------------------------------------------------------ update_search.c -- */
/* Largest deviation of a triangle with an area whose split vertex has this scale, given that nothing up to *code
 * matters: *code is raised to it, and to what an outline costs when the triangle is mixed, which sets *mixed. All
 * vertices of smaller scales are known. */
bool update_measure(update *u, const rqt_triangle *t, int scale, rqt_code *code, bool *mixed);
/* The largest and the smallest valid height of all; *any: is there one? sign 1: largest, -1: smallest. */
bool update_extreme(update *u, int sign, int32_t *q, bool *any);

#endif
