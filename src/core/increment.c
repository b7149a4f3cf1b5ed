/* increment.c - what turns one mesh into another: FORMAT.md, "View increment".
 *
 * A view that follows a camera has most of its mesh in common with the one before. Both ends number meshes in one
 * way (order.c), so that an increment can name what goes by its number, and what stays keeps its order: nothing has
 * to be said of it. What comes is in a neighbourhood, whose numbers are near each other: differences are small.
 * Neither end has to know more than the mesh before; a digest tells whether it is the right one, another whether
 * the result is.
 *
 * A triangle one vertex of which goes is gone, too: only others are named. */
#define ZSTD_STATIC_LINKING_ONLY
#include "order.h"
#include "wire_walk.h"

#include <zstd.h>
#include <zstd_errors.h>

enum {
    AT_VERSION = 4,
    AT_FLAGS = 5,
    AT_ZERO = 6,
    AT_CHECKSUM = 8,
    AT_FROM = 16,
    AT_TO = 24,
    AT_VERTEX_COUNT = 32,
    AT_TRIANGLE_COUNT = 36,
    AT_NOTE = 40,
    AT_PAYLOAD = 44,

    FLAG_FRAME = 1,
    FRAME_FIRST = 32, /* offset of mesh_frame in a mesh */
    FRAME_BYTES = 80,
    ZSTD_LEVEL = 3,
    ZSTD_BLOCK = 1 << 17, /* what the least zstd block, of 4 bytes, can stand for */
    LEAST_ZSTD_BLOCK = 4,
    LAST_SAMPLE = 1 << RQT_MAX_K,

    /* Bytes of numbers at most, and of what comes at least. */
    MOST_NUMBER = 5,
    MOST_KEY = 7,
    LEAST_VERTEX = 2,
    LEAST_TRIANGLE = 3
};

static rqt_status say(rqt_message *message, rqt_status status, const char *sentence) {
    sentence_begin(message, sentence);
    return status;
}

static inline uint64_t fold(uint64_t h, uint32_t high, uint32_t low) {
    const uint64_t v = (h ^ ((uint64_t)high << 32 | low)) * 0xC2B2AE3D27D4EB4FU;
    return v << 29 | v >> 35;
}

uint64_t rqt_increment_digest(const rqt_patch *mesh) {
    uint64_t h = 0x9E3779B97F4A7C15U ^ (uint64_t)mesh->vertex_count * 0xFF51AFD7ED558CCDU;
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        const rqt_patch_vertex *v = &mesh->vertices[i];
        h = fold(h, (uint32_t)v->row, (uint32_t)v->col);
        h = fold(h, 0, (uint32_t)v->q);
    }
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        h = fold(h, mesh->triangles[3 * t + 1], mesh->triangles[3 * t]);
        h = fold(h, 1, mesh->triangles[3 * t + 2]);
    }
    h = (h ^ h >> 32) * 0xFF51AFD7ED558CCDU;
    return h ^ h >> 29;
}

/* ------------------------------------------------------------------------------------------------- numbers -- */
/* LEB128: seven bits a byte, the lowest first; the last one is below 128. */

static uint8_t *put_number(uint8_t *p, uint64_t v) {
    for (; v >= 128; v >>= 7) *p++ = (uint8_t)(v | 128);
    *p++ = (uint8_t)v;
    return p;
}

static uint8_t *put_signed(uint8_t *p, int64_t v) {
    return put_number(p, (uint64_t)v << 1 ^ (uint64_t)(v >> 63));
}

typedef struct reader {
    const uint8_t *p, *end;
    bool bad;
} reader;

static uint64_t get_number(reader *r) {
    uint64_t v = 0;
    for (int shift = 0; shift < 7 * MOST_KEY; shift += 7) {
        if (r->p == r->end) break;
        const uint8_t byte = *r->p++;
        v |= (uint64_t)(byte & 127) << shift;
        if (byte < 128) return v;
    }
    r->bad = true;
    return 0;
}

static int64_t get_signed(reader *r) {
    const uint64_t v = get_number(r);
    return (int64_t)(v >> 1) ^ -(int64_t)(v & 1);
}

/* A number that is above the one before: by how much, less 1. `before` is -1 at first. At most `most`. */
static int64_t get_next(reader *r, int64_t before, uint64_t most) {
    const uint64_t step = get_number(r);
    if (step > most || before + 1 + (int64_t)step > (int64_t)most) r->bad = true;
    return r->bad ? before : before + 1 + (int64_t)step;
}

/* ------------------------------------------------------------------------------------------------ encoding -- */

size_t rqt_increment_bound(const rqt_patch *old, const rqt_patch *fresh, size_t note_size) {
    const size_t before = old ? MOST_NUMBER * (old->vertex_count + old->triangle_count) : 0;
    const size_t payload = before + (MOST_KEY + MOST_NUMBER) * fresh->vertex_count +
                           3 * MOST_NUMBER * fresh->triangle_count + 4 * MOST_NUMBER;
    return RQT_INCREMENT_HEADER_BYTES + FRAME_BYTES + note_size + ZSTD_COMPRESSBOUND(payload);
}

/* What goes, what comes, and the new number of what stays. */
typedef struct difference {
    uint32_t *number; /* of an old vertex; RQT_NO_VERTEX: it goes */
    uint8_t *comes;   /* of a new vertex */
    size_t gone, come, gone_triangles, come_triangles;
} difference;

static void compare_vertices(const rqt_patch *old, const rqt_patch *fresh, difference *d) {
    size_t i = 0;
    for (size_t k = 0; k < fresh->vertex_count; k++) {
        const rqt_patch_vertex *v = &fresh->vertices[k];
        const uint64_t key = order_key(v->col, v->row);
        bool stays = false;
        for (; i < old->vertex_count && !stays; i++) {
            const rqt_patch_vertex *o = &old->vertices[i];
            const uint64_t own = order_key(o->col, o->row);
            if (own > key) break;
            stays = own == key && o->q == v->q;
            d->number[i] = stays ? (uint32_t)k : RQT_NO_VERTEX;
            d->gone += !stays;
        }
        d->comes[k] = !stays;
        d->come += !stays;
    }
    for (; i < old->vertex_count; i++, d->gone++) d->number[i] = RQT_NO_VERTEX;
}

/* An old triangle's new numbers; false: one of its vertices goes. */
static bool renumber(const uint32_t *number, const uint32_t *triangle, uint32_t out[3]) {
    for (int c = 0; c < 3; c++) {
        out[c] = number[triangle[c]];
        if (out[c] == RQT_NO_VERTEX) return false;
    }
    return true;
}

/* Triangles that are named: one way to count and to write them. p NULL: count. */
static uint8_t *put_gone_triangles(const rqt_patch *old, const rqt_patch *fresh, difference *d, uint8_t *p) {
    size_t k = 0;
    int64_t before = -1;
    for (size_t t = 0; t < old->triangle_count; t++) {
        uint32_t now[3];
        if (!renumber(d->number, &old->triangles[3 * t], now)) continue;
        while (k < fresh->triangle_count && order_compare(&fresh->triangles[3 * k], now) < 0) k++;
        if (k < fresh->triangle_count && order_compare(&fresh->triangles[3 * k], now) == 0) continue;
        if (p)
            p = put_number(p, (uint64_t)((int64_t)t - before - 1));
        else
            d->gone_triangles++;
        before = (int64_t)t;
    }
    return p;
}

static uint8_t *put_come_triangles(const rqt_patch *old, const rqt_patch *fresh, difference *d, uint8_t *p) {
    size_t t = 0;
    int64_t before = 0;
    for (size_t k = 0; k < fresh->triangle_count; k++) {
        const uint32_t *v = &fresh->triangles[3 * k];
        uint32_t now[3];
        int order = 1;
        while (t < old->triangle_count &&
               (!renumber(d->number, &old->triangles[3 * t], now) || (order = order_compare(now, v)) < 0))
            t++;
        if (t < old->triangle_count && order == 0) continue;
        if (p) {
            p = put_number(p, (uint64_t)((int64_t)v[0] - before));
            p = put_signed(p, (int64_t)v[1] - v[0]);
            p = put_signed(p, (int64_t)v[2] - v[0]);
        } else
            d->come_triangles++;
        before = v[0];
    }
    return p;
}

static uint8_t *put_vertices(const rqt_patch *old, const rqt_patch *fresh, const difference *d, uint8_t *p) {
    int64_t before = -1;
    for (size_t i = 0; i < old->vertex_count; i++)
        if (d->number[i] == RQT_NO_VERTEX) {
            p = put_number(p, (uint64_t)((int64_t)i - before - 1));
            before = (int64_t)i;
        }
    before = -1;
    for (size_t k = 0; k < fresh->vertex_count; k++)
        if (d->comes[k]) {
            const int64_t key = (int64_t)order_key(fresh->vertices[k].col, fresh->vertices[k].row);
            p = put_number(p, (uint64_t)(key - before - 1));
            before = key;
        }
    for (size_t k = 0; k < fresh->vertex_count; k++)
        if (d->comes[k]) p = put_signed(p, (int64_t)fresh->vertices[k].q - (k ? fresh->vertices[k - 1].q : 0));
    return p;
}

static size_t put_payload(const rqt_patch *old, const rqt_patch *fresh, difference *d, uint8_t *bytes) {
    uint8_t *p = bytes;
    (void)put_gone_triangles(old, fresh, d, NULL);
    (void)put_come_triangles(old, fresh, d, NULL);
    p = put_number(p, d->gone);
    p = put_number(p, d->come);
    p = put_number(p, d->gone_triangles);
    p = put_number(p, d->come_triangles);
    p = put_vertices(old, fresh, d, p);
    p = put_gone_triangles(old, fresh, d, p);
    p = put_come_triangles(old, fresh, d, p);
    return (size_t)(p - bytes);
}

rqt_status rqt_increment_encode(const rqt_increment_header *header, const rqt_patch *old, const rqt_patch *fresh,
                                const rqt_allocator *allocator, uint8_t *bytes, size_t *size) {
    static const rqt_patch nothing;
    *size = 0;
    if (!old) old = &nothing;
    const size_t bound = rqt_increment_bound(old, fresh, header->note_size);
    if (bound > UINT32_MAX) return RQT_INVALID; /* so that counts and sizes take 32 bits */
    const bool has_frame = old->vertex_count == 0 && old != fresh;
    memset(bytes, 0, RQT_INCREMENT_HEADER_BYTES);
    memcpy(bytes, "RQTI", 4);
    bytes[AT_VERSION] = RQT_FORMAT_VERSION;
    bytes[AT_FLAGS] = has_frame ? FLAG_FRAME : 0;
    const uint64_t from = rqt_increment_digest(old);
    put64(bytes + AT_FROM, from);
    put64(bytes + AT_TO, old == fresh ? from : rqt_increment_digest(fresh));
    put32(bytes + AT_VERTEX_COUNT, (uint32_t)fresh->vertex_count);
    put32(bytes + AT_TRIANGLE_COUNT, (uint32_t)fresh->triangle_count);
    put32(bytes + AT_NOTE, (uint32_t)header->note_size);
    uint8_t *p = bytes + RQT_INCREMENT_HEADER_BYTES;
    if (has_frame) {
        mesh_frame_put(&(mesh_frame){header->placement, header->unit, header->srid, header->eps}, p - FRAME_FIRST);
        p += FRAME_BYTES;
    }
    if (header->note_size) memcpy(p, header->note, header->note_size);
    p += header->note_size;
    if (old == fresh) {
        *size = (size_t)(p - bytes);
        put64(bytes + AT_CHECKSUM, checksum64(bytes, *size, AT_CHECKSUM));
        return RQT_OK;
    }

    rqt_allocator copy = *allocator;
    const ZSTD_customMem memory = {wire_take, wire_drop, &copy};
    difference d = {.number = memory_take(allocator, old->vertex_count * sizeof *d.number),
                    .comes = memory_take(allocator, fresh->vertex_count)};
    uint8_t *payload = memory_take(allocator, bound);
    ZSTD_CCtx *z = d.number && d.comes && payload ? ZSTD_createCCtx_advanced(memory) : NULL;
    rqt_status status = RQT_NO_MEMORY;
    if (z) {
        compare_vertices(old, fresh, &d);
        const size_t plain = put_payload(old, fresh, &d, payload);
        const bool differs = d.gone || d.come || d.gone_triangles || d.come_triangles;
        size_t packed = 0;
        if (differs) {
            put32(bytes + AT_PAYLOAD, (uint32_t)plain);
            packed = ZSTD_compressCCtx(z, p, bound - (size_t)(p - bytes), payload, plain, ZSTD_LEVEL);
        }
        if (!ZSTD_isError(packed)) {
            *size = (size_t)(p - bytes) + packed;
            put64(bytes + AT_CHECKSUM, checksum64(bytes, *size, AT_CHECKSUM));
            status = RQT_OK;
        }
    }
    (void)ZSTD_freeCCtx(z);
    memory_drop(allocator, payload);
    memory_drop(allocator, d.number);
    memory_drop(allocator, d.comes);
    return status;
}

/* ------------------------------------------------------------------------------------------------ decoding -- */

static rqt_status corrupt(rqt_message *message, const char *sentence) {
    return say(message, RQT_CORRUPT, sentence);
}

/* Where the compressed payload is. */
static size_t frame_at(const uint8_t *bytes) {
    const size_t frame = bytes[AT_FLAGS] & FLAG_FRAME ? FRAME_BYTES : 0;
    return RQT_INCREMENT_HEADER_BYTES + frame + get32(bytes + AT_NOTE);
}

rqt_status rqt_increment_info(const uint8_t *bytes, size_t size, rqt_increment_header *header,
                              rqt_message *message) {
    memset(header, 0, sizeof *header);
    if (size < RQT_INCREMENT_HEADER_BYTES) return corrupt(message, "not an increment of a view: it is too short");
    if (memcmp(bytes, "RQTI", 4) != 0)
        return corrupt(message, "not an increment of a view: it does not begin with RQTI");
    if (bytes[AT_VERSION] != RQT_FORMAT_VERSION) return corrupt(message, "an increment of unknown format version");
    if (bytes[AT_FLAGS] > FLAG_FRAME || get16(bytes + AT_ZERO) != 0)
        return corrupt(message, "the increment has parts that this version does not know");
    if (get64(bytes + AT_CHECKSUM) != checksum64(bytes, size, AT_CHECKSUM))
        return corrupt(message, "the increment's checksum is wrong: its bytes have changed");
    rqt_increment_header h = {.from = get64(bytes + AT_FROM),
                              .to = get64(bytes + AT_TO),
                              .vertex_count = get32(bytes + AT_VERTEX_COUNT),
                              .triangle_count = get32(bytes + AT_TRIANGLE_COUNT),
                              .has_frame = bytes[AT_FLAGS] & FLAG_FRAME,
                              .note_size = get32(bytes + AT_NOTE)};
    const uint32_t payload = get32(bytes + AT_PAYLOAD);
    const size_t at = frame_at(bytes);
    if (at > size) return corrupt(message, "the increment is cut off");
    h.is_unchanged = payload == 0;
    h.note = bytes + at - h.note_size;
    if (h.has_frame) {
        const mesh_frame frame = mesh_frame_get(bytes + RQT_INCREMENT_HEADER_BYTES - FRAME_FIRST);
        h.placement = frame.placement;
        h.unit = frame.unit;
        h.srid = frame.srid;
        h.eps = frame.eps;
        if (!placement_is_valid(&h.placement) || !rqt_unit_is_valid(&h.unit) || !(h.eps >= 0))
            return corrupt(message, "the increment's placement, unit or tolerance is not one");
    }
    const size_t frame = size - at;
    if (h.is_unchanged ? frame != 0 || h.from != h.to
                       : frame < LEAST_ZSTD_BLOCK || get32(bytes + at) != ZSTD_MAGICNUMBER ||
                             ZSTD_findFrameCompressedSize(bytes + at, frame) != frame ||
                             ZSTD_getFrameContentSize(bytes + at, frame) != payload ||
                             payload / ZSTD_BLOCK > frame / LEAST_ZSTD_BLOCK)
        return corrupt(message, "the increment's compressed bytes are not what its header says");
    *header = h;
    sentence_begin(message, "");
    return RQT_OK;
}

/* Heights go by the vertex before, in the new order: so all keys come first. */
static void merge_vertices(reader *r, const rqt_patch *old, const uint64_t *keys, size_t come, uint32_t *number,
                           rqt_patch *mesh) {
    int64_t q = 0;
    for (size_t i = 0, k = 0; !r->bad && (i < old->vertex_count || k < come);) {
        if (i < old->vertex_count && number[i] == RQT_NO_VERTEX) {
            i++;
            continue;
        }
        const rqt_patch_vertex *o = &old->vertices[i];
        const uint64_t key = i < old->vertex_count ? order_key(o->col, o->row) : UINT64_MAX;
        rqt_patch_vertex *v = &mesh->vertices[mesh->vertex_count];
        if (k < come && keys[k] <= key) {
            const rqt_vertex at = order_place(keys[k]);
            q += get_signed(r);
            if (keys[k] == key || q <= -RQT_HEIGHT_LIMIT || q >= RQT_HEIGHT_LIMIT || at.x > LAST_SAMPLE ||
                at.y > LAST_SAMPLE)
                r->bad = true;
            *v = (rqt_patch_vertex){.col = at.x, .row = at.y, .q = (int32_t)q};
            k++;
        } else {
            *v = (rqt_patch_vertex){.col = o->col, .row = o->row, .q = o->q};
            q = o->q;
            number[i++] = (uint32_t)mesh->vertex_count;
        }
        mesh->vertex_count++;
    }
}

/* The next triangle that comes. */
static void get_triangle(reader *r, uint32_t *first, size_t vertices, uint32_t triangle[3]) {
    const uint64_t step = get_number(r);
    const int64_t to_second = get_signed(r), to_third = get_signed(r), most = (int64_t)vertices - 1;
    if (step > (uint64_t)most - *first) r->bad = true;
    if (r->bad) return;
    *first += (uint32_t)step;
    const int64_t second = *first + to_second, third = *first + to_third;
    if (second < 0 || second > most || third < 0 || third > most) r->bad = true;
    triangle[0] = *first;
    triangle[1] = (uint32_t)second;
    triangle[2] = (uint32_t)third;
}

static void merge_triangles(reader *r, const rqt_patch *old, const uint8_t *goes, size_t come,
                            const uint32_t *number, rqt_patch *mesh) {
    uint32_t first = 0, next[3] = {0, 0, 0};
    if (come && mesh->vertex_count == 0) r->bad = true;
    if (come && !r->bad) get_triangle(r, &first, mesh->vertex_count, next);
    for (size_t t = 0; !r->bad && (t < old->triangle_count || come);) {
        uint32_t now[3], *out = &mesh->triangles[3 * mesh->triangle_count];
        if (t < old->triangle_count && (goes[t] || !renumber(number, &old->triangles[3 * t], now))) {
            t++;
            continue;
        }
        const bool stays = t < old->triangle_count && (!come || order_compare(now, next) < 0);
        memcpy(out, stays ? now : next, sizeof now);
        if (mesh->triangle_count && order_compare(out - 3, out) >= 0) r->bad = true;
        mesh->triangle_count++;
        if (stays)
            t++;
        else if (--come && !r->bad)
            get_triangle(r, &first, mesh->vertex_count, next);
    }
}

/* payload -> mesh, which has no arrays yet. Every count is below what its bytes can be. */
static rqt_status unpack(reader *r, const rqt_patch *old, rqt_patch *mesh) {
    const rqt_allocator *a = &mesh->allocator;
    const uint64_t gone = get_number(r), come = get_number(r), gone_triangles = get_number(r),
                   come_triangles = get_number(r), left = (uint64_t)(r->end - r->p);
    if (r->bad || gone > old->vertex_count || gone_triangles > old->triangle_count || come > left / LEAST_VERTEX ||
        come_triangles > left / LEAST_TRIANGLE)
        return RQT_CORRUPT;
    uint32_t *number = memory_take(a, old->vertex_count * sizeof *number);
    uint8_t *goes = memory_take(a, old->triangle_count);
    uint64_t *keys = memory_take(a, come * sizeof *keys);
    rqt_status status = RQT_NO_MEMORY;
    mesh->vertex_capacity = old->vertex_count - gone + come;
    mesh->triangle_capacity = old->triangle_count - gone_triangles + come_triangles;
    mesh->vertices = memory_take(a, mesh->vertex_capacity * sizeof *mesh->vertices);
    mesh->triangles = memory_take(a, 3 * mesh->triangle_capacity * sizeof *mesh->triangles);
    if (number && goes && keys && mesh->vertices && mesh->triangles) {
        memset(number, 0, old->vertex_count * sizeof *number);
        memset(goes, 0, old->triangle_count);
        int64_t at = -1;
        for (uint64_t i = 0; i < gone && !r->bad; i++) {
            at = get_next(r, at, old->vertex_count - 1);
            if (!r->bad) number[at] = RQT_NO_VERTEX;
        }
        at = -1;
        for (uint64_t i = 0; i < come && !r->bad; i++) {
            at = get_next(r, at, order_key(LAST_SAMPLE, LAST_SAMPLE));
            keys[i] = (uint64_t)at;
        }
        merge_vertices(r, old, keys, come, number, mesh);
        at = -1;
        for (uint64_t i = 0; i < gone_triangles && !r->bad; i++) {
            at = get_next(r, at, old->triangle_count - 1);
            if (!r->bad) goes[at] = 1;
        }
        merge_triangles(r, old, goes, come_triangles, number, mesh);
        status = r->bad || r->p != r->end ? RQT_CORRUPT : RQT_OK;
    }
    memory_drop(a, number);
    memory_drop(a, goes);
    memory_drop(a, keys);
    return status;
}

static rqt_status copy_mesh(const rqt_patch *old, rqt_patch *mesh) {
    const rqt_allocator *a = &mesh->allocator;
    mesh->vertices = memory_take(a, old->vertex_count * sizeof *mesh->vertices);
    mesh->triangles = memory_take(a, 3 * old->triangle_count * sizeof *mesh->triangles);
    if (!mesh->vertices || !mesh->triangles) return RQT_NO_MEMORY;
    for (size_t i = 0; i < old->vertex_count; i++)
        mesh->vertices[i] =
            (rqt_patch_vertex){.col = old->vertices[i].col, .row = old->vertices[i].row, .q = old->vertices[i].q};
    if (old->triangle_count)
        memcpy(mesh->triangles, old->triangles, 3 * old->triangle_count * sizeof *mesh->triangles);
    mesh->vertex_count = mesh->vertex_capacity = old->vertex_count;
    mesh->triangle_count = mesh->triangle_capacity = old->triangle_count;
    return RQT_OK;
}

/* The payload of an increment, in memory of its own; *plain NULL with RQT_CORRUPT or RQT_NO_MEMORY. */
static rqt_status expand(const uint8_t *bytes, size_t size, const rqt_allocator *allocator, uint8_t **plain) {
    rqt_allocator copy = *allocator;
    const ZSTD_customMem memory = {wire_take, wire_drop, &copy};
    const uint32_t payload = get32(bytes + AT_PAYLOAD);
    const size_t at = frame_at(bytes);
    *plain = memory_take(allocator, payload);
    ZSTD_DCtx *z = *plain ? ZSTD_createDCtx_advanced(memory) : NULL;
    if (!z) return RQT_NO_MEMORY;
    const size_t got = ZSTD_decompressDCtx(z, *plain, payload, bytes + at, size - at);
    (void)ZSTD_freeDCtx(z);
    if (got == payload) return RQT_OK;
    return ZSTD_isError(got) && ZSTD_getErrorCode(got) == ZSTD_error_memory_allocation ? RQT_NO_MEMORY
                                                                                       : RQT_CORRUPT;
}

rqt_status rqt_increment_apply(const rqt_patch *old, const uint8_t *bytes, size_t size,
                               const rqt_allocator *allocator, rqt_increment_header *header, rqt_patch *mesh,
                               rqt_message *message) {
    static const rqt_patch nothing;
    if (!old) old = &nothing;
    *mesh = (rqt_patch){.allocator = *allocator};
    rqt_status status = rqt_increment_info(bytes, size, header, message);
    if (status != RQT_OK) return status;
    if (header->from != rqt_increment_digest(old))
        return say(message, RQT_INVALID, "the increment belongs to another mesh than this one");
    uint8_t *plain = NULL;
    if (header->is_unchanged) {
        status = copy_mesh(old, mesh);
    } else {
        status = expand(bytes, size, allocator, &plain);
        reader r = {.p = plain, .end = plain + get32(bytes + AT_PAYLOAD)};
        if (status == RQT_OK) status = unpack(&r, old, mesh);
    }
    memory_drop(allocator, plain);
    if (status == RQT_OK &&
        (mesh->vertex_count != header->vertex_count || mesh->triangle_count != header->triangle_count ||
         rqt_increment_digest(mesh) != header->to))
        status = RQT_CORRUPT;
    if (status == RQT_OK) return RQT_OK;
    rqt_patch_free(mesh);
    *mesh = (rqt_patch){.allocator = *allocator};
    return say(message, status,
               status == RQT_NO_MEMORY ? "out of memory"
                                       : "the increment does not lead to the mesh that it promises");
}
