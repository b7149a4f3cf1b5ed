/* wire_encode.c - a patch in the bytes of the wire format.
 *
 * For each block two passes over its leaves, which come in the order of the walk. The first finds out of each
 * triangle how much of it is in the patch; the second is the walk of the decoder, told the answers. It builds the
 * mesh that the decoder will build; if that is not the patch, the patch was not one of a query over these blocks.
 */
#define ZSTD_STATIC_LINKING_ONLY
#include "wire_walk.h"

#include <zstd.h>

enum {
    /* As for blocks (block_codec.c): residuals have an entropy and no repeats worth a match of less than 7. */
    ZSTD_LEVEL = 3,
    ZSTD_MATCH = 7,
    WORTH_A_TABLE = 256 /* bytes of a stream, below which it shares a zstd block with its neighbours */
};

enum { WIRE_WANTED = 1, WIRE_USED = 2 }; /* a vertex; a corner of a leaf, or its sample is */

/* ------------------------------------------------------------------------------------------ primitives */

static inline uint32_t canonical(const wire_walk *w, uint32_t p);

static bool grow(wire_walk *w, wire_stream *s, size_t need) {
    size_t capacity = s->end;
    void *p = s->p;
    if (!memory_grow(&w->allocator, &p, &capacity, need, 1)) {
        w->failed = w->bad = true;
        return false;
    }
    s->p = p;
    s->end = capacity;
    return true;
}

static void put_byte(wire_walk *w, int stream, uint32_t byte) {
    wire_stream *s = &w->stream[stream];
    if (s->at < s->end || grow(w, s, s->at + 1)) s->p[s->at++] = (uint8_t)byte;
}

static void put_bits(wire_walk *w, int stream, uint32_t v, int count) {
    wire_stream *s = &w->stream[stream];
    if ((s->at + (size_t)count + 7) / 8 > s->end && !grow(w, s, (s->at + (size_t)count + 7) / 8)) return;
    for (int i = 0; i < count; i++, s->at++) {
        uint8_t *byte = &s->p[s->at >> 3];
        if ((s->at & 7) == 0) *byte = 0;
        *byte = (uint8_t)(*byte | (v >> i & 1) << (s->at & 7));
    }
}

static bool is_at(rqt_vertex a, rqt_vertex b) {
    return a.x == b.x && a.y == b.y;
}

static bool is_wanted_leaf(const wire_walk *w, uint32_t a, uint32_t l, uint32_t r) {
    if (w->next >= w->wanted_count) return false;
    const rqt_triangle *t = &w->wanted[w->next];
    return is_at(t->apex, wire_at(w, a)) && is_at(t->left, wire_at(w, l)) && is_at(t->right, wire_at(w, r));
}

static uint64_t step_splits(wire_walk *w, int stream, uint64_t candidates, uint32_t first, uint32_t gap) {
    uint64_t chosen = 0;
    for (; candidates; candidates &= candidates - 1) {
        const int i = __builtin_ctzll(candidates);
        const bool wanted = w->want[first + (uint32_t)i * gap] & WIRE_WANTED;
        put_bits(w, stream, wanted, 1);
        chosen |= (uint64_t)wanted << i;
    }
    return chosen;
}

/* A vertex that no leaf of the block has is there because others depend on it: it costs least as it is guessed. */
static int32_t step_height(wire_walk *w, int stream, uint32_t p, int32_t guess) {
    int32_t q = guess;
    if (p >= (uint32_t)(w->n * w->n) || (w->want[canonical(w, p)] & WIRE_USED)) {
        const wire_entry *e = wire_table_find(w->heights, rqt_vertex_clamp(&w->lattice, wire_at(w, p)));
        if (e)
            q = e->q;
        else
            w->bad = true;
    }
    int bits;
    const uint32_t v = wire_zigzag((int32_t)((uint32_t)q - (uint32_t)guess));
    put_byte(w, stream, wire_token_of(v, &bits));
    put_bits(w, WIRE_RAW, v, bits);
    return q;
}

static void step_heights(wire_walk *w, int stream, const int from[4]) {
    for (size_t i = 0; i < w->listed; i++) {
        const uint32_t p = w->list[i];
        const int32_t *q = w->q + p;
        const int64_t four = (int64_t)q[from[0]] + q[from[1]] + q[from[2]] + q[from[3]];
        w->q[p] = step_height(w, stream, p, (int32_t)(four >> 2));
        w->memo[p] = WIRE_CHOSEN;
    }
}

static int step_some(wire_walk *w) {
    if (w->some_next >= w->some_count) return -1;
    const int amounts = w->some[w->some_next++];
    put_byte(w, WIRE_PART, (uint32_t)amounts);
    return amounts;
}

#include "wire_steps.h"

/* ---------------------------------------------------------------------------------------------- survey */

static int64_t turn(rqt_vertex a, rqt_vertex b, int64_t x, int64_t y) {
    const int64_t cross = (3 * (int64_t)b.x - 3 * (int64_t)a.x) * (y - 3 * (int64_t)a.y) -
                          (3 * (int64_t)b.y - 3 * (int64_t)a.y) * (x - 3 * (int64_t)a.x);
    return cross > 0 ? 1 : cross < 0 ? -1 : 0;
}

/* Is the next leaf within the triangle? Triangles of the bintree are nested or apart: its centroid tells. */
static bool next_is_within(const wire_walk *w, uint32_t a, uint32_t l, uint32_t r) {
    if (w->next >= w->wanted_count) return false;
    const rqt_triangle *t = &w->wanted[w->next];
    const rqt_vertex va = wire_at(w, a), vl = wire_at(w, l), vr = wire_at(w, r);
    const int64_t x = (int64_t)t->apex.x + t->left.x + t->right.x, y = (int64_t)t->apex.y + t->left.y + t->right.y;
    const int64_t first = turn(va, vl, x, y);
    return first != 0 && turn(vl, vr, x, y) == first && turn(vr, va, x, y) == first;
}

/* How much of the triangle is in the patch; goes past its leaves, and notes the children of triangles in part. */
static int survey(wire_walk *w, uint32_t a, uint32_t l, uint32_t r, int splits) {
    if (!next_is_within(w, a, l, r)) return WIRE_EMPTY;
    if (is_wanted_leaf(w, a, l, r)) {
        w->next++;
        w->want[canonical(w, a)] |= WIRE_USED;
        w->want[canonical(w, l)] |= WIRE_USED;
        w->want[canonical(w, r)] |= WIRE_USED;
        return WIRE_FULL;
    }
    if (splits == 0) { /* a leaf finer than the block */
        w->bad = true;
        return WIRE_EMPTY;
    }
    const size_t slot = w->some_count;
    void *some = w->some;
    if (!memory_grow(&w->allocator, &some, &w->some_room, slot + 1, 1)) {
        w->failed = w->bad = true;
        return WIRE_EMPTY;
    }
    w->some = some;
    w->some_count++;
    const uint32_t m = (l + r) / 2;
    w->want[m] |= WIRE_WANTED;
    const int first = w->bad ? WIRE_EMPTY : survey(w, m, l, a, splits - 1);
    const int second = w->bad ? WIRE_EMPTY : survey(w, m, a, r, splits - 1);
    const bool first_is_whole = first == WIRE_FULL || (w->clamped && is_flat(w, m, l, a));
    const bool second_is_whole = second == WIRE_FULL || (w->clamped && is_flat(w, m, a, r));
    if (first_is_whole && second_is_whole) {
        w->some_count = slot;
        return WIRE_FULL;
    }
    w->some[slot] = (uint8_t)(3 * first + second);
    return WIRE_SOME;
}

/* Whatever a vertex depends on is one too. */
static void close_wanted(wire_walk *w) {
    const size_t n = (size_t)w->n, last = n - 1;
    uint8_t *const want = w->want;
    for (size_t s = 1; s < last; s *= 2) {
        for (size_t v = 0; v < n; v += s)
            for (size_t u = v & s ? 0 : s; u < n; u += 2 * s) { /* sides */
                const size_t p = v * n + u;
                if (!(want[p] & WIRE_WANTED)) continue;
                if (u > 0) want[p - s] |= WIRE_WANTED;
                if (u < last) want[p + s] |= WIRE_WANTED;
                if (v > 0) want[p - s * n] |= WIRE_WANTED;
                if (v < last) want[p + s * n] |= WIRE_WANTED;
            }
        for (size_t v = s; v < n; v += 2 * s)
            for (size_t u = s; u < n; u += 2 * s) {
                const size_t p = v * n + u;
                if (want[p] & WIRE_WANTED) {
                    want[p - s * n - s] |= WIRE_WANTED;
                    want[p - s * n + s] |= WIRE_WANTED;
                    want[p + s * n - s] |= WIRE_WANTED;
                    want[p + s * n + s] |= WIRE_WANTED;
                }
            }
    }
}

/* Both halves of the block at hand; goes past their leaves. */
static void survey_block(wire_walk *w, int amount[2]) {
    const rqt_block_place *p = &w->place;
    const uint32_t n = (uint32_t)w->n, last = n - 1, corner[4] = {0, last, last * n, last * n + last};
    const int c = (p->i & 1) | (p->j & 1) << 1, center = 3 - c;
    w->some_count = w->some_next = 0;
    memset(w->want, 0, (size_t)n * n);
    for (int h = 0; h < 2 && !w->bad; h++) {
        int apex = c ^ (h + 1), from = h == 0 ? center : c, to = h == 0 ? c : center;
        if (p->level == 0) apex = h + 1, from = h == 0 ? 0 : 3, to = 3 - from;
        amount[h] = survey(w, corner[apex], corner[from], corner[to], 2 * w->k);
        if (amount[h] != WIRE_EMPTY || p->level == 0 || w->next >= w->wanted_count) continue;
        const rqt_vertex a = wire_at(w, corner[apex]), near = wire_at(w, corner[c]),
                         far = {2 * a.x - near.x, 2 * a.y - near.y};
        const rqt_triangle *t = &w->wanted[w->next];
        if (is_at(t->apex, wire_at(w, corner[center])) && is_at(t->left, near) && is_at(t->right, far)) {
            amount[h] = WIRE_QUARTER;
            w->want[canonical(w, corner[center])] |= WIRE_USED;
            w->want[canonical(w, corner[c])] |= WIRE_USED;
            w->next++;
        }
    }
    close_wanted(w);
}

/* ---------------------------------------------------------------------------------------------- blocks */

typedef struct blocks {
    const rqt_block_number *number; /* in Morton order */
    size_t count, next;
} blocks;

/* Does the next block lie in this cell? */
static bool next_block_is_in(const blocks *b, int level, rqt_block_number cell) {
    if (b->next >= b->count || b->number[b->next] == 0) return false;
    const int own = (63 - __builtin_clzll(b->number[b->next])) / 2;
    return own >= level && b->number[b->next] >> 2 * (own - level) == cell;
}

static bool room_for_block(wire_walk *w) {
    const size_t places = (size_t)w->n * (size_t)w->n;
    return memory_grow(&w->allocator, (void **)&w->vertices, &w->vertex_room, w->vertex_count + places + 6,
                       sizeof *w->vertices) &&
           memory_grow(&w->allocator, (void **)&w->triangles, &w->triangle_room, w->triangle_count + 2 * places + 2,
                       3 * sizeof *w->triangles);
}

/* True: something in the cell is in the patch; its symbols are written. A cell with nothing in it is one symbol. */
static bool code_cell(wire_walk *w, blocks *b, int level, int32_t i, int32_t j) {
    rqt_block_place place;
    const rqt_block_number cell = rqt_block_number_of(level, i, j);
    if (w->bad || rqt_block_locate(&w->lattice, w->k, cell, &place) != RQT_OK) return false;
    const size_t shape = w->stream[WIRE_SHAPE].at;
    put_byte(w, WIRE_SHAPE, 0);
    bool any = false;
    if (w->bad || !next_block_is_in(b, level, cell)) return false;
    if (b->number[b->next] == cell) {
        int amount[2] = {WIRE_EMPTY, WIRE_EMPTY};
        b->next++;
        if (!room_for_block(w) || !wire_block_begin(w, &place)) {
            w->failed = w->bad = true;
            return false;
        }
        survey_block(w, amount);
        any = amount[0] || amount[1];
        if (w->bad || !any) return false;
        w->stream[WIRE_SHAPE].p[shape] = (uint8_t)(2 + amount[0] + 4 * amount[1]);
        walk_block(w, amount);
        return true;
    }
    for (int c = 0; c < 4; c++) any = code_cell(w, b, level + 1, 2 * i + (c & 1), 2 * j + (c >> 1)) || any;
    if (any)
        w->stream[WIRE_SHAPE].p[shape] = 1;
    else
        w->stream[WIRE_SHAPE].at = shape + 1;
    return any;
}

/* --------------------------------------------------------------------------------------------- payload */

static size_t bytes_of(const wire_walk *w, int stream) {
    return wire_is_bits(stream) ? (w->stream[stream].at + 7) / 8 : w->stream[stream].at;
}

static size_t put_directory(const wire_walk *w, uint8_t *bytes) {
    int first = WIRE_CLASSES, last = -1;
    for (int i = WIRE_BY_CLASS; i < WIRE_RAW; i++) {
        const int class = (i - WIRE_BY_CLASS) / WIRE_PER_CLASS;
        if (w->stream[i].at == 0) continue;
        if (class < first) first = class;
        last = class;
    }
    if (last < 0) first = 0;
    size_t at = 2;
    bytes[0] = (uint8_t)first;
    bytes[1] = (uint8_t)(last - first + 1);
    for (int i = 0; i < WIRE_RAW; i++) {
        const int class = (i - WIRE_BY_CLASS) / WIRE_PER_CLASS;
        if (i >= WIRE_BY_CLASS && (class < first || class > last)) continue;
        size_t length = bytes_of(w, i);
        for (; length >= 0x80; length >>= 7) bytes[at++] = (uint8_t)(length | 0x80);
        bytes[at++] = (uint8_t)length;
    }
    return at;
}

/* Directory and streams as one frame; 0: no memory. A stream that is worth it begins a zstd block of its own. */
static size_t deflate(const wire_walk *w, uint8_t *bytes, size_t room, size_t *payload) {
    rqt_allocator copy = w->allocator;
    const ZSTD_customMem memory = {wire_take, wire_drop, &copy};
    uint8_t directory[WIRE_DIRECTORY];
    const size_t listed = put_directory(w, directory);
    *payload = listed;
    for (int i = 0; i < WIRE_STREAMS; i++) *payload += bytes_of(w, i);
    ZSTD_CCtx *z = ZSTD_createCCtx_advanced(memory);
    if (!z) return 0;
    (void)ZSTD_CCtx_setParameter(z, ZSTD_c_compressionLevel, ZSTD_LEVEL);
    (void)ZSTD_CCtx_setParameter(z, ZSTD_c_minMatch, ZSTD_MATCH);
    (void)ZSTD_CCtx_setParameter(z, ZSTD_c_contentSizeFlag, 1);
    (void)ZSTD_CCtx_setParameter(z, ZSTD_c_checksumFlag, 0);
    (void)ZSTD_CCtx_setPledgedSrcSize(z, *payload);
    ZSTD_outBuffer out = {bytes, room, 0};
    size_t since = listed, left = 1;
    for (int i = -1; i < WIRE_STREAMS; i++) {
        ZSTD_inBuffer in = {i < 0 ? directory : w->stream[i].p, i < 0 ? listed : bytes_of(w, i), 0};
        const bool is_last = i == WIRE_STREAMS - 1;
        if (i >= 0) since += in.size;
        const bool ends = since >= WORTH_A_TABLE;
        if (ends) since = 0;
        left = ZSTD_compressStream2(z, &out, &in, is_last ? ZSTD_e_end : ends ? ZSTD_e_flush : ZSTD_e_continue);
        if (ZSTD_isError(left) || in.pos != in.size) break;
    }
    (void)ZSTD_freeCCtx(z);
    return left == 0 ? out.pos : 0;
}

/* ------------------------------------------------------------------------------------------- the whole */

static bool is_same_mesh(const wire_walk *w, const rqt_patch *patch) {
    if (w->vertex_count != patch->vertex_count || w->triangle_count != patch->triangle_count) return false;
    for (size_t i = 0; i < w->vertex_count; i++) {
        const rqt_patch_vertex *a = &w->vertices[i], *b = &patch->vertices[i];
        if (a->col != b->col || a->row != b->row || a->q != b->q || a->level != b->level) return false;
    }
    return w->triangle_count == 0 ||
           memcmp(w->triangles, patch->triangles, 3 * w->triangle_count * sizeof *w->triangles) == 0;
}

static rqt_status run(wire_walk *w, const rqt_wire_header *header, blocks *b, const rqt_patch *patch,
                      const rqt_patch *state, uint8_t *bytes, size_t room, size_t *size) {
    wire_table heights = {0};
    rqt_status status = RQT_OK;
    if (!wire_table_reserve(&w->allocator, &heights, patch->vertex_count)) return RQT_NO_MEMORY;
    for (size_t i = 0; i < patch->vertex_count; i++) {
        const rqt_vertex at = {patch->vertices[i].col, patch->vertices[i].row};
        if (!wire_table_find(&heights, at)) wire_table_insert(&heights, at, patch->vertices[i].q, WIRE_NONE);
    }
    w->heights = &heights;
    w->wanted = patch->leaves;
    w->wanted_count = patch->triangle_count;
    if (state && !wire_prior_create(&w->allocator, &w->lattice, state, &w->prior)) status = RQT_NO_MEMORY;
    if (status == RQT_OK) {
        (void)code_cell(w, b, 0, 0, 0);
        if (w->failed)
            status = RQT_NO_MEMORY;
        else if (w->bad || w->next != w->wanted_count || !is_same_mesh(w, patch))
            status = RQT_INVALID;
    }
    if (status == RQT_OK) {
        size_t payload;
        const size_t frame = deflate(w, bytes + RQT_WIRE_HEADER_BYTES, room - RQT_WIRE_HEADER_BYTES, &payload);
        if (frame == 0) {
            status = RQT_NO_MEMORY;
        } else {
            rqt_wire_header h = *header;
            h.vertex_count = patch->vertex_count;
            h.triangle_count = patch->triangle_count;
            h.is_delta = state != NULL;
            h.from = state ? rqt_wire_digest(state) : 0;
            wire_put_header(&h, payload, bytes);
            *size = RQT_WIRE_HEADER_BYTES + frame;
            put64(bytes + 8, checksum64(bytes, *size, 8));
        }
    }
    memory_drop(&w->allocator, heights.entry);
    return status;
}

rqt_status rqt_wire_encode(const rqt_wire_header *header, const rqt_block_number *numbers, size_t block_count,
                           const rqt_patch *patch, const rqt_patch *state, const rqt_allocator *allocator,
                           uint8_t *bytes, size_t *size) {
    *size = 0;
    if (header->k < 0 || header->k > header->lattice.K || header->k > RQT_MAX_BLOCK_K ||
        patch->vertex_count >= WIRE_MOST || patch->triangle_count >= WIRE_MOST ||
        (patch->triangle_count > 0 && !patch->leaves) || (state && state->triangle_count > 0 && !state->leaves))
        return RQT_INVALID;
    wire_walk *w = memory_take(allocator, sizeof *w);
    if (!w) return RQT_NO_MEMORY;
    blocks b = {numbers, block_count, 0};
    rqt_status status = wire_walk_create(w, &header->lattice, header->k, allocator);
    w->want = memory_take(allocator, (size_t)w->n * (size_t)w->n);
    if (!w->want) status = RQT_NO_MEMORY;
    if (status == RQT_OK)
        status = run(w, header, &b, patch, state, bytes,
                     rqt_wire_bound(patch->vertex_count, patch->triangle_count, block_count), size);
    for (int i = 0; i < WIRE_STREAMS; i++) memory_drop(allocator, w->stream[i].p);
    memory_drop(allocator, w->some);
    memory_drop(allocator, w->want);
    wire_walk_free(w);
    memory_drop(allocator, w);
    return status;
}
