/* block_codec.c - blocks in bytes (FORMAT.md, "Block"): first correct version. */
#define ZSTD_STATIC_LINKING_ONLY
#include "internal.h"

#include <math.h>
#include <zstd.h>
#include <zstd_errors.h>

enum {
    AT_VERSION = 4,
    AT_K = 5,
    AT_FLAGS = 6,
    AT_PLANES = 7,
    AT_WIDTH = 8,
    AT_HEIGHT = 10,
    AT_PAYLOAD = 12,
    AT_QUANTUM = 16,
    AT_CHECKSUM = 24,
    HEADER_BYTES = 32,
    HAS_VOIDS = 1,
    ALL_VOID = 2,
    HAS_OUTLINE = 4,
    LARGEST_N = (1 << RQT_MAX_BLOCK_K) + 1,
    LARGEST_COUNT = LARGEST_N * LARGEST_N,
    LARGEST_PAYLOAD = LARGEST_COUNT * 6 + 2 * ((LARGEST_COUNT + 7) / 8),
    LEVEL = 3
};

struct rqt_codec {
    rqt_allocator allocator;
    ZSTD_CCtx *compressor;
    ZSTD_DCtx *decompressor;
    int32_t q[LARGEST_COUNT];
    uint32_t residual[LARGEST_COUNT];
    rqt_code error[LARGEST_COUNT];
    uint8_t flags[LARGEST_COUNT];
    uint8_t payload[LARGEST_PAYLOAD];
};

static void *zstd_take(void *opaque, size_t bytes) { return memory_take(opaque, bytes); }
static void zstd_drop(void *opaque, void *p) { memory_drop(opaque, p); }

rqt_status rqt_codec_create(const rqt_allocator *allocator, rqt_codec **codec) {
    *codec = NULL;
    rqt_codec *c = memory_take(allocator, sizeof *c);
    if (!c) return RQT_NO_MEMORY;
    c->allocator = *allocator;
    ZSTD_customMem memory = {zstd_take, zstd_drop, &c->allocator};
    c->compressor = ZSTD_createCCtx_advanced(memory);
    c->decompressor = c->compressor ? ZSTD_createDCtx_advanced(memory) : NULL;
    if (!c->decompressor) {
        rqt_codec_free(c);
        return RQT_NO_MEMORY;
    }
    *codec = c;
    return RQT_OK;
}

void rqt_codec_free(rqt_codec *codec) {
    if (!codec) return;
    ZSTD_freeCCtx(codec->compressor);
    ZSTD_freeDCtx(codec->decompressor);
    rqt_allocator a = codec->allocator;
    memory_drop(&a, codec);
}

static size_t side_of(int k) { return ((size_t)1 << k) + 1; }

size_t rqt_block_bound(int k) {
    if (k < 0 || k > RQT_MAX_BLOCK_K) return 0;
    size_t count = side_of(k) * side_of(k);
    return HEADER_BYTES + ZSTD_COMPRESSBOUND(count * 6 + 2 * ((count + 7) / 8));
}

static size_t payload_of(const rqt_block_header *h) {
    size_t stored = (size_t)h->width * (size_t)h->height, count = side_of(h->k) * side_of(h->k);
    return stored * (size_t)h->height_planes + count * (size_t)h->error_planes +
           (h->has_voids ? (stored + 7) / 8 : 0) + (h->has_outline ? (count + 7) / 8 : 0);
}

rqt_status rqt_block_info(const uint8_t *bytes, size_t size, rqt_block_header *header, rqt_message *message) {
    memset(header, 0, sizeof *header);
    sentence_begin(message, "the block's header is wrong");
    if (size <= HEADER_BYTES || memcmp(bytes, "RQTB", 4) != 0 || bytes[AT_VERSION] != RQT_FORMAT_VERSION)
        return RQT_CORRUPT;
    rqt_block_header h = {
        .version = bytes[AT_VERSION],
        .k = bytes[AT_K],
        .width = get16(bytes + AT_WIDTH),
        .height = get16(bytes + AT_HEIGHT),
        .has_voids = bytes[AT_FLAGS] & HAS_VOIDS,
        .all_void = bytes[AT_FLAGS] & ALL_VOID,
        .has_outline = bytes[AT_FLAGS] & HAS_OUTLINE,
        .height_planes = bytes[AT_PLANES] & 15,
        .error_planes = bytes[AT_PLANES] >> 4,
        .quantum = get_double(bytes + AT_QUANTUM),
        .payload = get32(bytes + AT_PAYLOAD),
    };
    if (h.k > RQT_MAX_BLOCK_K || bytes[AT_FLAGS] > 7 || (h.has_voids && h.all_void) || h.height_planes > 4 ||
        h.error_planes > 2 || (h.all_void && h.height_planes) || h.width < 1 || h.height < 1 ||
        (size_t)h.width > side_of(h.k) || (size_t)h.height > side_of(h.k) || !isfinite(h.quantum) ||
        !(h.quantum > 0) || h.payload != payload_of(&h))
        return RQT_CORRUPT;
    if (size - HEADER_BYTES < 4 || get32(bytes + HEADER_BYTES) != ZSTD_MAGICNUMBER ||
        ZSTD_findFrameCompressedSize(bytes + HEADER_BYTES, size - HEADER_BYTES) != size - HEADER_BYTES)
        return RQT_CORRUPT;
    *header = h;
    sentence_begin(message, "");
    return RQT_OK;
}

static uint32_t zigzag(uint32_t r) { return r << 1 ^ (0 - (r >> 31)); }
static uint32_t unzigzag(uint32_t v) { return v >> 1 ^ (0 - (v & 1)); }

static int32_t median_edge(const int32_t *q, int32_t n, int32_t x, int32_t y) {
    const int32_t *p = q + (ptrdiff_t)y * n + x;
    if (y == 0) return x ? p[-1] : 0;
    if (x == 0) return p[-n];
    int32_t w = p[-1], a = p[-n], c = p[-n - 1], low = w < a ? w : a, high = w < a ? a : w;
    if (c <= low) return high;
    if (c >= high) return low;
    return (int32_t)((uint32_t)w + (uint32_t)a - (uint32_t)c);
}

static uint32_t code_near_above(float v) {
    uint32_t bits;
    memcpy(&bits, &v, 4);
    return bits ? ((bits + 0xFFFF) >> 16) + 16512 : 0;
}

typedef struct errors_pass {
    int n, q;
    const int32_t *z;
    rqt_code *error;
    uint32_t *residual;
    float half;
    bool decode;
} errors_pass;

static void error_step(errors_pass *e, int x, int y, int reach_x, int reach_y, int ax, int ay, bool middle) {
    const int n = e->n;
    uint32_t p = 0;
    for (int c = 0; c < 4; c++) {
        /* centres one step finer lie on the diagonals of a side vertex, sides on the axes of a centre */
        int cx = reach_y ? (c & 1 ? reach_x : -reach_x) : (c == 0 ? -reach_x : c == 1 ? reach_x : 0);
        int cy = reach_y ? (c & 2 ? reach_y : -reach_y) : (c == 2 ? -reach_x : c == 3 ? reach_x : 0);
        if (x + cx < 0 || x + cx >= n || y + cy < 0 || y + cy >= n) continue;
        uint32_t code = e->error[(y + cy) * n + x + cx];
        if ((cx || cy) && code > p) p = code;
    }
    if (middle) {
        uint32_t d = 2 * (uint32_t)e->z[y * n + x] - (uint32_t)e->z[(y - ay) * n + x - ax] -
                     (uint32_t)e->z[(y + ay) * n + x + ax];
        uint32_t code = code_near_above(fabsf((float)(int32_t)d) * e->half);
        if (code > p) p = code;
    }
    rqt_code *at = &e->error[y * n + x];
    if (e->decode)
        *at = (rqt_code)(p + unzigzag(*e->residual++));
    else
        *e->residual++ = zigzag((uint32_t)(int32_t)(int16_t)(uint16_t)(*at - p)) & 0xFFFF;
}

static void code_errors(int k, const int32_t *z, rqt_code *error, uint32_t *residual, double quantum, bool decode) {
    errors_pass e = {.n = (int)side_of(k), .z = z, .error = error, .residual = residual, .decode = decode};
    double half = quantum * (0.5 - 0x1p-21);
    e.half = (float)(half < 0x1p-90 ? 0x1p-90 : half > 0x1p90 ? 0x1p90 : half);
    const int last = e.n - 1;
    for (int q = 1; q < last; q *= 2) {
        for (int y = 0; y <= last; y += q) {
            bool odd = y / q & 1;
            for (int x = odd ? 0 : q; x <= last; x += 2 * q)
                error_step(&e, x, y, q / 2, q / 2, odd ? 0 : q, odd ? q : 0, true);
        }
        for (int y = q; y < last; y += 2 * q)
            for (int x = q; x < last; x += 2 * q)
                error_step(&e, x, y, q, 0, q, (x ^ y) & 2 * q ? -q : q, 2 * q < last);
    }
    for (int c = 0; c < 4; c++) {
        rqt_code *at = &error[(c & 2 ? last * e.n : 0) + (c & 1 ? last : 0)];
        if (decode)
            *at = (rqt_code)unzigzag(*e.residual++);
        else
            *e.residual++ = zigzag((uint32_t)(int32_t)(int16_t)*at) & 0xFFFF;
    }
}

static int put_planes(uint8_t **to, const uint32_t *v, size_t count) {
    uint32_t all = 0;
    for (size_t i = 0; i < count; i++) all |= v[i];
    int planes = 0;
    for (; all; all >>= 8, planes++) {
        for (size_t i = 0; i < count; i++) (*to)[i] = (uint8_t)(v[i] >> 8 * planes);
        *to += count;
    }
    return planes;
}

static void get_planes(const uint8_t **from, uint32_t *v, size_t count, int planes) {
    memset(v, 0, count * sizeof *v);
    for (int plane = 0; plane < planes; plane++, *from += count)
        for (size_t i = 0; i < count; i++) v[i] |= (uint32_t)(*from)[i] << 8 * plane;
}

rqt_status rqt_block_encode(rqt_codec *codec, const rqt_block *block, double quantum, uint8_t *bytes,
                            size_t *size) {
    *size = 0;
    if (block->k < 0 || block->k > RQT_MAX_BLOCK_K || !isfinite(quantum) || !(quantum > 0)) return RQT_INVALID;
    const int32_t n = (int32_t)side_of(block->k), width = block->width, height = block->height;
    if (width < 1 || width > n || height < 1 || height > n) return RQT_INVALID;
    const size_t count = (size_t)n * (size_t)n, stored = (size_t)width * (size_t)height;
    size_t valid = 0;
    uint32_t *r = codec->residual;
    for (int32_t y = 0; y < n; y++)
        for (int32_t x = 0; x < n; x++) {
            int32_t *at = &codec->q[y * n + x];
            if (y >= height || x >= width) {
                *at = y >= height ? at[-n] : at[-1];
                continue;
            }
            int32_t p = median_edge(codec->q, n, x, y), q = block->q[y * n + x];
            if (block->flags[y * n + x] & RQT_VALID) {
                if (q <= -RQT_HEIGHT_LIMIT || q >= RQT_HEIGHT_LIMIT) return RQT_INVALID;
                valid++;
            } else {
                q = p;
            }
            *r++ = zigzag((uint32_t)q - (uint32_t)p);
            *at = q;
        }
    uint8_t *p = codec->payload;
    int height_planes = put_planes(&p, codec->residual, stored);
    memcpy(codec->error, block->error, count * sizeof *codec->error);
    code_errors(block->k, codec->q, codec->error, codec->residual, quantum, false);
    int error_planes = put_planes(&p, codec->residual, count);
    int flags = valid == 0 ? ALL_VOID : valid < stored ? HAS_VOIDS : 0;
    if (flags & HAS_VOIDS) {
        memset(p, 0, (stored + 7) / 8);
        for (size_t i = 0; i < stored; i++) {
            size_t at = i / (size_t)width * (size_t)n + i % (size_t)width;
            if (block->flags[at] & RQT_VALID) p[i / 8] = (uint8_t)(p[i / 8] | 1 << i % 8);
        }
        p += (stored + 7) / 8;
    }
    memset(p, 0, (count + 7) / 8);
    for (size_t i = 0; i < count; i++)
        if (block->flags[i] & RQT_OUTLINE) {
            flags |= HAS_OUTLINE;
            p[i / 8] = (uint8_t)(p[i / 8] | 1 << i % 8);
        }
    if (flags & HAS_OUTLINE) p += (count + 7) / 8;
    memset(bytes, 0, HEADER_BYTES);
    memcpy(bytes, "RQTB", 4);
    bytes[AT_VERSION] = RQT_FORMAT_VERSION;
    bytes[AT_K] = (uint8_t)block->k;
    bytes[AT_FLAGS] = (uint8_t)flags;
    bytes[AT_PLANES] = (uint8_t)(height_planes | error_planes << 4);
    put16(bytes + AT_WIDTH, (uint16_t)width);
    put16(bytes + AT_HEIGHT, (uint16_t)height);
    size_t payload = (size_t)(p - codec->payload);
    put32(bytes + AT_PAYLOAD, (uint32_t)payload);
    put_double(bytes + AT_QUANTUM, quantum);
    size_t room = rqt_block_bound(block->k) - HEADER_BYTES;
    size_t z = ZSTD_compressCCtx(codec->compressor, bytes + HEADER_BYTES, room, codec->payload, payload, LEVEL);
    if (ZSTD_isError(z)) return RQT_NO_MEMORY;
    *size = HEADER_BYTES + z;
    put64(bytes + AT_CHECKSUM, checksum64(bytes, *size, AT_CHECKSUM));
    return RQT_OK;
}

static rqt_status decode(rqt_codec *codec, const uint8_t *bytes, size_t size, rqt_block *block,
                         rqt_message *message) {
    rqt_block_header h;
    rqt_status status = rqt_block_info(bytes, size, &h, message);
    if (status != RQT_OK) return status;
    sentence_begin(message, "the block's bytes are damaged");
    if (h.k != block->k || get64(bytes + AT_CHECKSUM) != checksum64(bytes, size, AT_CHECKSUM)) return RQT_CORRUPT;
    size_t got = ZSTD_decompressDCtx(codec->decompressor, codec->payload, h.payload, bytes + HEADER_BYTES,
                                     size - HEADER_BYTES);
    if (ZSTD_isError(got) || got != h.payload) return RQT_CORRUPT;
    const int32_t n = (int32_t)side_of(h.k), width = h.width, height = h.height;
    const size_t count = (size_t)n * (size_t)n, stored = (size_t)width * (size_t)height;
    const uint8_t *p = codec->payload;
    get_planes(&p, codec->residual, stored, h.height_planes);
    const uint8_t *validity = p + count * (size_t)h.error_planes;
    const uint32_t *r = codec->residual;
    size_t valid = 0;
    for (int32_t y = 0; y < n; y++)
        for (int32_t x = 0; x < n; x++) {
            int32_t *at = &block->q[y * n + x];
            uint8_t *flags = &block->flags[y * n + x];
            if (y >= height || x >= width) {
                *at = y >= height ? at[-n] : at[-1];
                *flags = (uint8_t)((y >= height ? flags[-n] : flags[-1]) & RQT_VALID);
                continue;
            }
            *at = (int32_t)((uint32_t)median_edge(block->q, n, x, y) + unzigzag(*r));
            if (*at <= -RQT_HEIGHT_LIMIT || *at >= RQT_HEIGHT_LIMIT) return RQT_CORRUPT;
            size_t i = (size_t)(r - codec->residual);
            *flags = h.all_void ? 0 : !h.has_voids || validity[i / 8] >> i % 8 & 1;
            if (!*flags && *r) return RQT_CORRUPT;
            valid += *flags;
            r++;
        }
    if (h.has_voids && (valid == 0 || valid == stored || (stored % 8 && validity[stored / 8] >> stored % 8)))
        return RQT_CORRUPT;
    get_planes(&p, codec->residual, count, h.error_planes);
    code_errors(h.k, block->q, block->error, codec->residual, h.quantum, true);
    if (h.has_outline) {
        p += h.has_voids ? (stored + 7) / 8 : 0;
        bool any = false;
        for (size_t i = 0; i < count; i++)
            if (p[i / 8] >> i % 8 & 1) block->flags[i] |= RQT_OUTLINE, any = true;
        if (!any || (count % 8 && p[count / 8] >> count % 8)) return RQT_CORRUPT;
    }
    block->width = width;
    block->height = height;
    sentence_begin(message, "");
    return RQT_OK;
}

rqt_status rqt_block_decode(rqt_codec *codec, const uint8_t *bytes, size_t size, rqt_block *block) {
    return decode(codec, bytes, size, block, NULL);
}

rqt_status rqt_block_check(rqt_codec *codec, const uint8_t *bytes, size_t size, rqt_message *message) {
    rqt_block block = {.q = codec->q, .error = codec->error, .flags = codec->flags};
    rqt_block_header h;
    rqt_status status = rqt_block_info(bytes, size, &h, message);
    if (status != RQT_OK) return status;
    block.k = h.k;
    return decode(codec, bytes, size, &block, message);
}
