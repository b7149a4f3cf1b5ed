/* walk.h - what the three files of a query share: query.c picks the blocks and their halves, walk.c walks a half of
 * a block, patch.c makes vertices, triangles and the strip of what it meets. */
#ifndef RQT_WALK_H
#define RQT_WALK_H

#include "internal.h"

#define NO_PLACE UINT32_MAX

/* ------------------------------------------------------------------------------------------------ strip.c --
 * A strip under way. The last triangle waits until the next one is known: which edge they share decides how it is
 * said. */
typedef struct strip_writer {
    uint32_t *s; /* has room: the user sees to it */
    size_t count;
    bool waits;
    uint32_t waiting[3]; /* counter-clockwise */
} strip_writer;

#define STRIP_MOST_PER_TRIANGLE 5

/* Say the triangle `now`, counter-clockwise; the one after it holds `next` (three vertices), NULL: there is none.
 */
void strip_say(strip_writer *w, const uint32_t now[3], const uint32_t *next);
void strip_put(strip_writer *w, const uint32_t triangle[3]);
void strip_finish(strip_writer *w);

/* ------------------------------------------------------------------------------------------------ patch.c --
 * Vertices that blocks share are found by sample in a hash table. Entries of earlier queries are told by their
 * stamp. */
typedef struct shared_vertex {
    int32_t col, row;
    uint32_t index, stamp;
} shared_vertex;

/* A selected vertex of the block's border, and where the table is searched for it. */
typedef struct border_vertex {
    uint32_t place;
    size_t slot;
} border_vertex;

struct rqt_scratch {
    rqt_allocator allocator;
    int k; /* of the arrays for a block; -1: there are none */
    uint8_t *chosen;
    uint32_t *memo, *order;
    border_vertex *border;
    shared_vertex *table;
    size_t table_size;
    uint32_t stamp;
    rqt_patch spare; /* arrays only */
};

/* What is remembered of a place of the block, `memo`: 0, or the index of its vertex with bits above. An entry
 * counts when it is not below `live`, which is the first vertex of this block with FRESH: what earlier blocks left
 * behind needs no clearing. Vertices of earlier blocks, on the border, have KNOWN. */
#define FRESH UINT32_C(0x80000000)
#define KNOWN UINT32_C(0xC0000000)
#define INDEX UINT32_C(0x3FFFFFFF)

typedef struct walk {
    rqt_query *query;
    const rqt_allocator *allocator;
    rqt_patch *patch;
    rqt_scratch *scratch;
    size_t table_count;
    strip_writer strip;
    rqt_selection *selection; /* NULL: by threshold */
    int fine_levels;          /* number of block levels, for the Morton order */
    /* the block at hand */
    rqt_block_place place;
    const rqt_block *block; /* NULL: its summary is enough */
    int n;                  /* vertices a side */
    uint64_t inverse;       /* place * inverse >> 32 is place / n */
    uint8_t *chosen;        /* n * n: selected? */
    uint32_t *memo;         /* n * n */
    uint32_t live;
    uint32_t *order; /* places of the vertices that this block adds; their records are written when it is done */
    size_t first;    /* the first of them */
    size_t border_count;
    bool clamped; /* some of its vertices are past the last sample */
    bool aliased; /* another lattice vertex may be the same sample as one of its own */
    bool plain;   /* no leaf has a void corner or one past the last sample, and nobody asks for the leaves */
} walk;

static inline rqt_vertex place_vertex(const walk *w, uint32_t place) {
    const int32_t v = (int32_t)(place * w->inverse >> 32), u = (int32_t)place - v * w->n;
    return (rqt_vertex){w->place.x + u * w->place.stride, w->place.y + v * w->place.stride};
}

/* A corner of a leaf on its way into the patch. */
typedef struct corner {
    rqt_vertex at; /* lattice */
    int32_t q;
    rqt_code error;
    uint8_t flags;
    uint32_t place; /* in the block at hand; NO_PLACE: it is not of this block, or the block is not there */
} corner;

bool patch_begin(walk *w); /* takes what the scratch has */
void patch_end(walk *w, rqt_status status);
/* Room for all that one block can add, so that nothing can fail while it is walked. */
bool patch_reserve(walk *w);
/* Before and after the walk of a block that was read. */
void patch_enter_block(walk *w);
void patch_leave_block(walk *w);
/* The index of a corner in the patch, a new vertex if need be. */
uint32_t patch_vertex(walk *w, const corner *c);
/* Of a place of a block that is not aliased. */
static inline uint32_t patch_place(walk *w, uint32_t place) {
    const uint32_t memo = w->memo[place];
    if (memo >= w->live) return memo & INDEX;
    const size_t index = w->patch->vertex_count++;
    w->memo[place] = (uint32_t)index | FRESH;
    w->order[index - w->first] = place;
    return (uint32_t)index;
}
/* A leaf by the indices of apex, left and right; do they turn clockwise in (col,row)? Then they are
 * counter-clockwise from above, for rows grow south. */
void patch_triangle(walk *w, uint32_t a, uint32_t l, uint32_t r, bool clockwise);

/* ------------------------------------------------------------------------------------------------- walk.c -- */
/* Which vertices of the block are selected, and whether it needs care. */
void walk_choose(walk *w);
/* A half of the block at hand: places of apex, left, right. */
void walk_half_block(walk *w, uint32_t a, uint32_t l, uint32_t r, bool clockwise);
/* A leaf that may be void, without area, or none of the region's. */
void walk_emit(walk *w, const corner *a, const corner *l, const corner *r, bool inside);

#endif
