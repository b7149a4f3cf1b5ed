/* wire_walk.h - what coder and decoder of the wire format share: streams, a block at hand, and the walk itself.
 *
 * FORMAT.md, "Wire", is the specification. The walk is one piece of text for both directions, so that they cannot
 * disagree: wire_encode.c and wire_decode.c include wire_steps.h, which is this walk over five primitives that
 * read or write one symbol each. The coder runs the same walk and only knows the answers beforehand; it even builds
 * the same mesh, and compares it with the one that it was given.
 *
 * A block's vertices have places 0 .. n*n - 1, row by row; the midpoint of two places is their mean, the apex
 * across a hypotenuse their sum less the other apex. Two more places are for the far vertices (query.c).
 */
#ifndef RQT_WIRE_WALK_H
#define RQT_WIRE_WALK_H

#include "internal.h"

#define WIRE_NONE UINT32_MAX
#define WIRE_CHOSEN (UINT32_MAX - 1)  /* a vertex that has no index as yet */
#define WIRE_MOST (UINT32_C(1) << 31) /* counts are less */

enum {
    WIRE_CLASSES = 2 * RQT_MAX_K, /* 2 * log2 of the step of a vertex, + 1 for centres */
    WIRE_WORDS = 3,               /* of a row of at most 129 bits */

    /* Streams. Of bits: those named so; of bytes: the others. */
    WIRE_SHAPE = 0,      /* which blocks there are, and of their halves how much */
    WIRE_PART = 1,       /* of triangles that are in the patch in part: which children */
    WIRE_LOOSE = 2,      /* heights of corners and far vertices */
    WIRE_BITS_KNOWN = 3, /* is it a vertex? of places on the block's north or west side */
    WIRE_BITS_SIDE = 4,  /* of those on its other sides */
    WIRE_EDGES = 5,      /* heights of vertices on the block's sides and past the last sample */
    WIRE_BY_CLASS = 6,   /* two for each class: */
    WIRE_TOKENS = 0,     /*   heights */
    WIRE_BITS = 1,       /*   is it a vertex? */
    WIRE_PER_CLASS = 2,
    WIRE_RAW = WIRE_BY_CLASS + WIRE_PER_CLASS * WIRE_CLASSES, /* bits that follow tokens */
    WIRE_STREAMS = WIRE_RAW + 1
};

static inline bool wire_is_bits(int stream) {
    if (stream == WIRE_BITS_KNOWN || stream == WIRE_BITS_SIDE || stream == WIRE_RAW) return true;
    return stream >= WIRE_BY_CLASS && (stream - WIRE_BY_CLASS) % WIRE_PER_CLASS == WIRE_BITS;
}

typedef struct wire_stream {
    uint8_t *p;
    size_t at;  /* bytes or bits so far */
    size_t end; /* decoding: bytes there are; coding: bytes there is room for */
} wire_stream;

/* A row of a bitmap of the block. */
typedef struct wire_row {
    uint64_t word[WIRE_WORDS];
} wire_row;

/* A sample in the last column or row, which several places of a block may be. */
typedef struct wire_slot {
    int32_t q;
    uint32_t index; /* in the patch, or WIRE_CHOSEN */
    bool has;       /* a height */
} wire_slot;

/* What is special about a place; 0 for most. */
enum {
    WIRE_EDGE = 1,       /* on a side of the block: other blocks may have it too */
    WIRE_NORTH_WEST = 2, /* on its north or west side: the block across comes earlier */
    WIRE_RIM = 4         /* at or past the last sample of the raster */
};

/* How much of a triangle is in the patch: of its leaves with an area none, all, some. WIRE_QUARTER, of a half only:
 * the leaf there is the parent's quarter. */
enum { WIRE_EMPTY = 0, WIRE_FULL = 1, WIRE_SOME = 2, WIRE_QUARTER = 3 };

/* A vertex that more than one block, or more than one lattice vertex, may want: by sample. */
typedef struct wire_entry {
    uint64_t key; /* row, col, + 1; 0: empty */
    int32_t q;
    uint32_t index; /* in the patch, or WIRE_NONE */
} wire_entry;

typedef struct wire_table {
    wire_entry *entry;
    size_t size, count; /* size: a power of two, or 0 */
} wire_table;

typedef struct wire_walk {
    rqt_lattice lattice;
    int k, n;
    rqt_allocator allocator;
    wire_stream stream[WIRE_STREAMS];
    bool bad;    /* the bytes, or the patch to code, make no sense */
    bool failed; /* no memory */
    /* the patch that grows */
    rqt_patch_vertex *vertices;
    uint32_t *triangles;
    rqt_triangle *leaves; /* NULL: not wanted */
    size_t vertex_count, vertex_room, triangle_count, triangle_room;
    wire_table table;
    wire_table prior; /* vertices known beforehand, by lattice vertex; size 0: none */
    int32_t last_q;   /* the last height without a prediction */
    /* the block at hand */
    rqt_block_place place;
    int shift;            /* log2 of its stride */
    int32_t u_rim, v_rim; /* first column and row of its grid at or past the last sample */
    bool clamped;         /* some of them are past it */
    rqt_vertex far[2];    /* of the places n*n and n*n + 1 */
    uint32_t *memo;       /* by place: index in the patch, WIRE_CHOSEN, or WIRE_NONE: not a vertex */
    uint32_t *order;      /* places of the vertices that this block adds, from `first` on; WIRE_NONE: written */
    size_t first;
    int32_t *q;     /* by place */
    uint32_t *list; /* places that wait for their heights */
    size_t listed;
    wire_slot *slot; /* of samples in the last column, by row, and in the last row, by n + column */
    wire_row *grid, *centres, *across, *down; /* which vertices there are: squares' corners, centres, sides */
    uint8_t *kind;                            /* by place */
    uint16_t *column, *row;                   /* by place, in strides */
    uint32_t *where;    /* by place: column, row << 9, log2 of its step in strides << 18, on a side? << 22 */
    bool kind_is_plain; /* kind is as in a block that is not clamped */
    /* coding only */
    const rqt_triangle *wanted; /* leaves to code */
    size_t wanted_count, next;
    const wire_table *heights; /* of the patch to code, by sample */
    uint8_t *want;             /* by place: is it a vertex? */
    uint8_t *some;             /* of the triangles that are in the patch in part, in walk order: their children */
    size_t some_count, some_room, some_next;
    bool has_bmi2; /* decoding: the processor's */
} wire_walk;

static inline uint64_t wire_key(rqt_vertex v) {
    return ((uint64_t)(uint32_t)v.y << 32 | (uint32_t)v.x) + 1;
}

static inline size_t wire_key_place(uint64_t key, size_t size) {
    return (size_t)((key * UINT64_C(0x9E3779B97F4A7C15)) >> 24) & (size - 1);
}

static inline wire_entry *wire_table_find(const wire_table *table, rqt_vertex v) {
    if (table->size == 0) return NULL;
    const uint64_t key = wire_key(v);
    for (size_t at = wire_key_place(key, table->size); table->entry[at].key; at = (at + 1) & (table->size - 1))
        if (table->entry[at].key == key) return &table->entry[at];
    return NULL;
}

static inline rqt_vertex wire_sample(const wire_walk *w, rqt_vertex v) {
    return (rqt_vertex){v.x < w->lattice.width ? v.x : w->lattice.width - 1,
                        v.y < w->lattice.height ? v.y : w->lattice.height - 1};
}

/* wire_walk.c */
rqt_status wire_walk_create(wire_walk *w, const rqt_lattice *lattice, int k, const rqt_allocator *allocator);
void wire_walk_free(wire_walk *w);
bool wire_block_begin(wire_walk *w, const rqt_block_place *place); /* false: no memory */
void wire_block_end(wire_walk *w);
/* A triangle that is in the patch as a whole, in front of the last column and row: all of its leaves. */
void wire_list(wire_walk *w, uint32_t a, uint32_t l, uint32_t r, int splits, uint32_t clockwise);
void wire_leaf(wire_walk *w, uint32_t a, uint32_t l, uint32_t r, uint32_t clockwise);
bool wire_table_reserve(const rqt_allocator *allocator, wire_table *table, size_t more);
void wire_table_insert(wire_table *table, rqt_vertex v, int32_t q, uint32_t index);
bool wire_prior_create(const rqt_allocator *allocator, const rqt_lattice *lattice, const rqt_patch *state,
                       wire_table *prior);

static inline rqt_vertex wire_at(const wire_walk *w, uint32_t p) {
    const uint32_t count = (uint32_t)(w->n * w->n);
    if (p >= count) return w->far[p - count];
    return (rqt_vertex){w->place.x + (w->column[p] << w->shift), w->place.y + (w->row[p] << w->shift)};
}

/* A number in a byte and some bits: up to 63 as it is; else the exponent, two bits after the first one, the rest.
 */
static inline uint32_t wire_token_of(uint32_t v, int *bits) {
    *bits = 0;
    if (v < 64) return v;
    const int e = 31 - __builtin_clz(v);
    *bits = e - 2;
    return 64 + (uint32_t)(e - 6) * 4 + ((v >> (e - 2)) & 3);
}
enum { WIRE_TOKEN_COUNT = 64 + 26 * 4 };
static inline int wire_token_bits(uint32_t token) {
    return token < 64 ? 0 : (int)(token - 64) / 4 + 4;
}
static inline uint32_t wire_token_base(uint32_t token) {
    if (token < 64) return token;
    return (4 + (token & 3)) << wire_token_bits(token);
}
static inline uint32_t wire_zigzag(int32_t r) {
    return (uint32_t)r << 1 ^ (uint32_t)(r >> 31);
}

/* zstd's memory is the allocator's. */
static inline void *wire_take(void *opaque, size_t bytes) {
    return memory_take(opaque, bytes);
}
static inline void wire_drop(void *opaque, void *p) {
    memory_drop(opaque, p);
}

/* wire.c: the payload's directory, header and frame */
enum { WIRE_DIRECTORY = 2 + 5 * (WIRE_STREAMS - 1) }; /* bytes at most */
size_t wire_slack(int k);                             /* readable bytes that must follow a payload */
void wire_put_header(const rqt_wire_header *header, uint64_t payload, uint8_t *bytes);
uint64_t wire_payload_of(const uint8_t *bytes);
/* What follows the header, a zstd frame each: the mesh, and behind it what its flags tell of, in this order. */
enum { WIRE_MESH, WIRE_NORMALS, WIRE_ERRORS, WIRE_PARTS };
typedef struct wire_part {
    const uint8_t *frame; /* NULL: it is not there */
    size_t size, content; /* bytes, and for how many they stand */
} wire_part;
/* False: the frames are not those that the header tells of, or something follows them. Then nothing is known. */
bool wire_parts_find(const uint8_t *bytes, size_t size, wire_part parts[WIRE_PARTS]);
/* plain has room for its content. RQT_CORRUPT: it does not decompress to just that. */
rqt_status wire_part_get(const wire_part *part, const rqt_allocator *allocator, uint8_t *plain);
/* Behind all others; bytes has room for wire_part_bound(content) more. RQT_OK or RQT_NO_MEMORY. */
rqt_status wire_part_add(int part, const uint8_t *plain, size_t content, const rqt_allocator *allocator,
                         uint8_t *bytes, size_t *size);
size_t wire_part_bound(size_t content);

/* wire_errors.c: the least that the errors of so many vertices are, plain; and the most less that is 2 a vertex */
static inline uint64_t wire_errors_least(uint64_t vertex_count) {
    return 2 + (vertex_count + 7) / 8;
}
/* The codes of the mesh's errors, into its vertices. RQT_OK, RQT_CORRUPT or RQT_NO_MEMORY. */
rqt_status wire_errors_read(const wire_part *part, const rqt_wire_header *header, const rqt_allocator *allocator,
                            rqt_patch *patch);

#endif
