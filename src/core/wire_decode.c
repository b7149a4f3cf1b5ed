/* wire_decode.c - bytes of the wire format back into a patch; increments into a finer one.
 *
 * Nothing is believed. The header's counts are held against the size of the frame before memory is taken for them:
 * each vertex costs a byte of payload or comes from the state, and a mesh of triangles has at most twice as many
 * triangles as vertices. The walk itself does not look for the end of a stream at each symbol: after each block all
 * streams are compared with their ends, and the payload is followed by as many zero bytes as one block can read
 * beyond them. Whatever the symbols are, the walk stays within the block's arrays.
 */
#include "wire_walk.h"

typedef struct decoder {
    wire_walk walk;
    uint32_t base[256]; /* of tokens */
    uint8_t bits[256];
} decoder;

/* Bits of a word go where the mask has ones, in order. */
static uint64_t deposit(uint64_t bits, uint64_t mask, int *count) {
    uint64_t out = 0;
    *count = 0;
    for (; mask; mask &= mask - 1, bits >>= 1, ++*count) out |= mask & (0 - mask) & (0 - (bits & 1));
    return out;
}

/* Sanitizers have the portable one, so that the tests run both. */
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__SANITIZE_ADDRESS__) && !defined(RQT_SCALAR)
__attribute__((target("bmi2,popcnt"))) static uint64_t deposit_bmi2(uint64_t bits, uint64_t mask, int *count) {
    *count = __builtin_popcountll(mask);
    return __builtin_ia32_pdep_di(bits, mask);
}
#define HAS_BMI2 (__builtin_cpu_supports("bmi2") && __builtin_cpu_supports("popcnt"))
#else
#define deposit_bmi2 deposit
#define HAS_BMI2 false
#endif

static inline uint64_t step_splits(wire_walk *w, int stream, uint64_t candidates, uint32_t first, uint32_t gap) {
    (void)first, (void)gap;
    wire_stream *s = &w->stream[stream];
    const uint8_t *p = s->p + (s->at >> 3);
    const int shift = (int)(s->at & 7);
    const uint64_t bits = get64(p) >> shift | (uint64_t)p[8] << 1 << (63 - shift);
    int count;
    const uint64_t chosen =
        w->has_bmi2 ? deposit_bmi2(bits, candidates, &count) : deposit(bits, candidates, &count);
    s->at += (size_t)count;
    return chosen;
}

typedef struct reader {
    const decoder *d;
    const uint8_t *token, *raw;
    size_t at; /* bits of raw */
    bool bad;
} reader;

static inline int32_t read_height(reader *r, int32_t guess) {
    const uint8_t token = *r->token++;
    /* For most tokens no bits: but a branch costs more than reading them. */
    const int bits = r->d->bits[token];
    const uint32_t v =
        r->d->base[token] + ((uint32_t)(get64(r->raw + (r->at >> 3)) >> (r->at & 7)) & ((1U << bits) - 1));
    r->at += (size_t)bits;
    const int64_t q = (int64_t)guess + (int32_t)(v >> 1 ^ (0 - (v & 1)));
    r->bad |= !(q > -RQT_HEIGHT_LIMIT && q < RQT_HEIGHT_LIMIT);
    return (int32_t)q;
}

static inline reader open_reader(const wire_walk *w, int stream) {
    const wire_stream *s = &w->stream[stream], *raw = &w->stream[WIRE_RAW];
    return (reader){(const decoder *)(const void *)w, s->p + s->at, raw->p, raw->at, false}; /* its first member */
}

static inline void close_reader(wire_walk *w, int stream, const reader *r) {
    w->stream[stream].at = (size_t)(r->token - w->stream[stream].p);
    w->stream[WIRE_RAW].at = r->at;
    w->bad |= r->bad;
}

static int32_t step_height(wire_walk *w, int stream, uint32_t p, int32_t guess) {
    reader r = open_reader(w, stream);
    const int32_t q = read_height(&r, guess);
    (void)p;
    close_reader(w, stream, &r);
    return q;
}

static void step_heights(wire_walk *w, int stream, const int from[4]) {
    reader r = open_reader(w, stream);
    uint32_t *restrict const memo = w->memo;
    const uint32_t *restrict const list = w->list;
    int32_t *const q = w->q;
    const int a = from[0], b = from[1], c = from[2], d = from[3];
    for (size_t i = 0; i < w->listed; i++) {
        const uint32_t p = list[i];
        const int32_t *const at = q + p;
        q[p] = read_height(&r, (int32_t)(((int64_t)at[a] + at[b] + at[c] + at[d]) >> 2));
        memo[p] = WIRE_CHOSEN;
    }
    close_reader(w, stream, &r);
}

static int step_some(wire_walk *w) {
    wire_stream *s = &w->stream[WIRE_PART];
    return s->at < s->end ? s->p[s->at++] : -1;
}

#include "wire_steps.h"

/* Has a stream been read beyond its end? */
static bool is_beyond(const wire_walk *w) {
    for (int i = 0; i < WIRE_STREAMS; i++)
        if (w->stream[i].at > (wire_is_bits(i) ? 8 * w->stream[i].end : w->stream[i].end)) return true;
    return false;
}

/* Is every stream read to its end, and what fills its last byte zero? */
static bool is_at_the_end(const wire_walk *w) {
    for (int i = 0; i < WIRE_STREAMS; i++) {
        const wire_stream *s = &w->stream[i];
        if (!wire_is_bits(i)) {
            if (s->at != s->end) return false;
        } else if ((s->at + 7) / 8 != s->end || (s->at % 8 && s->p[s->at / 8] >> s->at % 8)) {
            return false;
        }
    }
    return true;
}

/* The blocks of the cell (i,j) of a level, in Morton order. */
static void walk_cell(wire_walk *w, int level, int32_t i, int32_t j) {
    rqt_block_place place;
    const rqt_block_number number = rqt_block_number_of(level, i, j);
    if (rqt_block_locate(&w->lattice, w->k, number, &place) != RQT_OK) return; /* past the raster */
    wire_stream *s = &w->stream[WIRE_SHAPE];
    if (s->at >= s->end) {
        w->bad = true;
        return;
    }
    const int shape = s->p[s->at++];
    if (shape == 0) return;
    if (shape == 1) {
        if (level == w->lattice.K - w->k) w->bad = true;
        for (int c = 0; c < 4 && !w->bad && !w->failed; c++)
            walk_cell(w, level + 1, 2 * i + (c & 1), 2 * j + (c >> 1));
        return;
    }
    const int amount[2] = {(shape - 2) & 3, (shape - 2) >> 2};
    const size_t cells = (size_t)1 << 2 * w->k;
    if (shape > 17 || (shape - 2) == 0 || w->triangle_count + 2 * cells + 2 > w->triangle_room ||
        w->vertex_count + (size_t)w->n * (size_t)w->n + 6 > w->vertex_room) {
        w->bad = true;
        return;
    }
    if (!wire_block_begin(w, &place)) {
        w->failed = true;
        return;
    }
    walk_block(w, amount);
    if (is_beyond(w)) w->bad = true;
}

/* The streams of a payload; false when its directory makes no sense. */
static bool open_streams(wire_walk *w, const uint8_t *payload, size_t size) {
    size_t at = 2;
    if (size < 2 || payload[0] + payload[1] > WIRE_CLASSES) return false;
    const int first = WIRE_BY_CLASS + WIRE_PER_CLASS * payload[0], last = first + WIRE_PER_CLASS * payload[1];
    for (int i = 0; i < WIRE_RAW; i++) {
        if (i >= WIRE_BY_CLASS && (i < first || i >= last)) continue;
        uint64_t length = 0;
        for (int shift = 0;; shift += 7) {
            if (at >= size || shift > 28) return false;
            const uint8_t byte = payload[at++];
            length |= (uint64_t)(byte & 0x7F) << shift;
            if (byte < 0x80) break;
        }
        w->stream[i].end = (size_t)length;
    }
    for (int i = 0; i < WIRE_RAW; i++) {
        if (w->stream[i].end > size - at) return false;
        w->stream[i].p = (uint8_t *)(uintptr_t)(payload + at);
        at += w->stream[i].end;
    }
    w->stream[WIRE_RAW].p = (uint8_t *)(uintptr_t)(payload + at);
    w->stream[WIRE_RAW].end = size - at;
    return true;
}

/* The decompressed payload with its slack of zeros. */
static rqt_status inflate(const wire_part *mesh, size_t slack, const rqt_allocator *allocator, uint8_t **out) {
    *out = memory_take(allocator, mesh->content + slack);
    if (!*out) return RQT_NO_MEMORY;
    memset(*out + mesh->content, 0, slack);
    return wire_part_get(mesh, allocator, *out);
}

static rqt_status make_room(wire_walk *w, const rqt_wire_header *h, bool wants_leaves) {
    const size_t places = (size_t)w->n * (size_t)w->n;
    w->vertex_room = (size_t)h->vertex_count + places + 6;
    w->triangle_room = (size_t)h->triangle_count + 2 * places + 2;
    w->vertices = memory_take(&w->allocator, w->vertex_room * sizeof *w->vertices);
    w->triangles = memory_take(&w->allocator, w->triangle_room * 3 * sizeof *w->triangles);
    if (wants_leaves) w->leaves = memory_take(&w->allocator, w->triangle_room * sizeof *w->leaves);
    return w->vertices && w->triangles && (w->leaves || !wants_leaves) ? RQT_OK : RQT_NO_MEMORY;
}

static rqt_status corrupt(rqt_message *message, const char *sentence) {
    sentence_begin(message, sentence);
    return RQT_CORRUPT;
}

static rqt_status run(decoder *d, const rqt_wire_header *h, const wire_part *mesh, const rqt_patch *state,
                      bool wants_leaves, rqt_message *message) {
    wire_walk *w = &d->walk;
    const size_t payload = mesh->content;
    uint8_t *plain = NULL;
    const size_t known = state ? 3 * state->triangle_count : 0;
    if (h->vertex_count > payload + known || h->triangle_count > 2 * h->vertex_count)
        return corrupt(message, "the mesh claims more vertices or triangles than its bytes can hold");
    rqt_status status = inflate(mesh, wire_slack(h->k), &w->allocator, &plain);
    if (status == RQT_CORRUPT) (void)corrupt(message, "the mesh's compressed bytes do not decompress");
    if (status == RQT_OK && !open_streams(w, plain, payload))
        status = corrupt(message, "the mesh's list of streams does not fit its payload");
    if (status == RQT_OK) status = make_room(w, h, wants_leaves);
    if (status == RQT_OK && state && !wire_prior_create(&w->allocator, &w->lattice, state, &w->prior))
        status = RQT_NO_MEMORY;
    if (status == RQT_OK) {
        for (uint32_t t = 0; t < 256; t++) {
            /* What is no token is a residual that no height can have. */
            d->base[t] = t < WIRE_TOKEN_COUNT ? wire_token_base(t) : UINT32_MAX - 1;
            d->bits[t] = t < WIRE_TOKEN_COUNT ? (uint8_t)wire_token_bits(t) : 0;
        }
        w->has_bmi2 = HAS_BMI2;
        walk_cell(w, 0, 0, 0);
        if (w->failed)
            status = RQT_NO_MEMORY;
        else if (w->bad || !is_at_the_end(w) || w->vertex_count != h->vertex_count ||
                 w->triangle_count != h->triangle_count)
            status = corrupt(message, "the mesh's streams do not describe the mesh of its header");
    }
    memory_drop(&w->allocator, plain);
    return status;
}

static rqt_status decode(const rqt_wire_header *h, const uint8_t *bytes, size_t size, const rqt_patch *state,
                         bool wants_leaves, const rqt_allocator *allocator, rqt_patch *patch,
                         rqt_message *message) {
    wire_part parts[WIRE_PARTS];
    (void)wire_parts_find(bytes, size, parts); /* they are there: rqt_wire_info has looked */
    decoder *d = memory_take(allocator, sizeof *d);
    if (!d) {
        sentence_begin(message, "out of memory");
        return RQT_NO_MEMORY;
    }
    rqt_status status = wire_walk_create(&d->walk, &h->lattice, h->k, allocator);
    if (status == RQT_OK) status = run(d, h, &parts[WIRE_MESH], state, wants_leaves, message);
    if (status == RQT_OK) {
        *patch = (rqt_patch){.vertices = d->walk.vertices,
                             .vertex_count = d->walk.vertex_count,
                             .triangles = d->walk.triangles,
                             .triangle_count = d->walk.triangle_count,
                             .leaves = d->walk.leaves,
                             .allocator = *allocator};
        d->walk.vertices = NULL;
        d->walk.triangles = NULL;
        d->walk.leaves = NULL;
    }
    wire_walk_free(&d->walk);
    memory_drop(allocator, d);
    if (status == RQT_OK && h->has_errors) {
        status = wire_errors_read(&parts[WIRE_ERRORS], h, allocator, patch);
        if (status == RQT_CORRUPT) (void)corrupt(message, "the mesh's errors are not one of each vertex");
        if (status != RQT_OK) rqt_patch_free(patch);
    }
    if (status == RQT_NO_MEMORY) sentence_begin(message, "out of memory");
    return status;
}

rqt_status rqt_wire_decode(const uint8_t *bytes, size_t size, bool wants_leaves, const rqt_allocator *allocator,
                           rqt_wire_header *header, rqt_patch *patch, rqt_message *message) {
    memset(patch, 0, sizeof *patch);
    sentence_begin(message, "");
    rqt_status status = rqt_wire_info(bytes, size, header, message);
    if (status == RQT_OK && header->is_delta) {
        sentence_begin(message, "these bytes are an increment: apply them to the mesh that they begin from");
        status = RQT_INVALID;
    }
    if (status == RQT_OK) status = decode(header, bytes, size, NULL, wants_leaves, allocator, patch, message);
    if (status != RQT_OK) memset(header, 0, sizeof *header);
    return status;
}

static bool same_double(double a, double b) {
    return memcmp(&a, &b, sizeof a) == 0;
}

/* Why an increment does not belong to a state; NULL when it does. */
static const char *why_not(const rqt_wire_header *state, const rqt_patch *patch, const rqt_wire_header *h,
                           uint64_t from) {
    const rqt_placement *p = &state->placement, *o = &h->placement;
    const rqt_unit *u = &state->unit, *v = &h->unit;
    if (!h->is_delta) return "these bytes are a whole mesh, not an increment";
    if (state->lattice.width != h->lattice.width || state->lattice.height != h->lattice.height ||
        state->k != h->k || state->srid != h->srid || !same_double(p->x0, o->x0) || !same_double(p->y0, o->y0) ||
        !same_double(p->dx, o->dx) || !same_double(p->dy, o->dy))
        return "the increment is one of another terrain";
    if (u->z0 != v->z0 || u->d != v->d || u->numerator != v->numerator || u->denominator != v->denominator ||
        !same_double(u->scale, v->scale) || !same_double(u->offset, v->offset))
        return "the increment has heights in another unit";
    if (!same_double(state->eps, h->eps_from)) return "the increment begins from another eps";
    if (rqt_wire_digest(patch) != from) return "the increment begins from the mesh of another region or other data";
    return NULL;
}

rqt_status rqt_wire_apply(const rqt_wire_header *state_header, const rqt_patch *state, const uint8_t *bytes,
                          size_t size, const rqt_allocator *allocator, rqt_wire_header *header, rqt_patch *patch,
                          rqt_message *message) {
    memset(patch, 0, sizeof *patch);
    sentence_begin(message, "");
    rqt_status status = rqt_wire_info(bytes, size, header, message);
    if (status == RQT_OK && state->triangle_count > 0 && !state->leaves) {
        sentence_begin(message, "the mesh to refine was decoded without its leaves");
        status = RQT_INVALID;
    }
    if (status == RQT_OK) {
        const char *why = why_not(state_header, state, header, header->from);
        if (why) {
            sentence_begin(message, why);
            status = RQT_INVALID;
        }
    }
    if (status == RQT_OK) status = decode(header, bytes, size, state, true, allocator, patch, message);
    if (status == RQT_OK) {
        header->is_delta = false; /* what there is now is a mesh */
        header->eps_from = 0;
        header->from = 0;
    } else {
        memset(header, 0, sizeof *header);
    }
    return status;
}
