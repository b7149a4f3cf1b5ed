/* block_codec.c - blocks in bytes and back (FORMAT.md, "Block").
 *
 * A block is a header of 40 bytes and one zstd frame. What is compressed are residuals (block_predict.c, and
 * block_sparse.c for blocks of stride > 1) as planes: all low bytes, then all high bytes. High bytes are nearly
 * constant, and apart from the low ones they cost nearly nothing, to store or to decode. Then come bits: of
 * validity and outline, where there are any, and of which vertices a sparse block keeps.
 *
 * A writer may say the same in only one way: bits that are all alike are a flag, padding is zero, what lies under a
 * void, beyond the raster or at a vertex that is not kept is not looked at. A reader believes nothing. It goes from
 * cheap to dear: the header's fields, the frame's own bookkeeping, the checksum, the decompressed bytes. After the
 * header has passed, all sizes are known and within the codec's buffers. */
#define ZSTD_STATIC_LINKING_ONLY /* contexts with an allocator: exported by every libzstd since 1.3 */
#include "block_predict.h"

#include <math.h>
#include <zstd.h>

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
    AT_FLOOR = 32,
    AT_GROUND = 34,
    AT_KEPT = 36,
    HEADER_BYTES = 40,

    HAS_VOIDS = 1,
    ALL_VOID = 2,
    HAS_OUTLINE = 4,
    IS_SPARSE = 8,
    KNOWN_FLAGS = 15,

    HEIGHT_PLANES = 4, /* at most */
    ERROR_PLANES = 2,

    /* Residuals of terrain have an entropy and hardly any repeats: level 15 takes ten times longer and saves 1 %.
     * Short matches are chance, and cost more than what they match, in bytes and in time: only long runs are worth
     * it. */
    ZSTD_LEVEL = 3,
    ZSTD_MATCH = 7,

    PIECES = 3,            /* of a payload: compress */
    ZSTD_BLOCK_HEADER = 3, /* bytes */
    WORTH_PIECES = 1024,   /* residuals, below which tables for each piece cost more than they save */
    READ_PAST = 16         /* bytes behind a payload that may be read */
};

#define BIT_BYTES(count) (((count) + 7) / 8)
#define PAYLOAD_BOUND(count) ((count) * (HEIGHT_PLANES + ERROR_PLANES) + 3 * BIT_BYTES(count))

struct rqt_codec {
    rqt_allocator allocator;
    ZSTD_CCtx *compressor;
    ZSTD_DCtx *decompressor;
    uint32_t residual[LARGEST_COUNT];
    int32_t q[LARGEST_COUNT]; /* a block of our own: to encode from, and to decode to for a check */
    rqt_code error[LARGEST_COUNT];
    uint8_t flags[LARGEST_COUNT];
    uint8_t bits[BIT_BYTES(LARGEST_COUNT)];
    error_scratch errors;
    flag_scratch marks;
    kept_list list;
    uint8_t payload[PAYLOAD_BOUND(LARGEST_COUNT) + READ_PAST];
};

static int32_t side_of(int k) {
    return (1 << k) + 1;
}
static size_t count_of(int k) {
    return (size_t)side_of(k) * (size_t)side_of(k);
}
/* How many vertices of the finest scale a block has: the first in coding order. */
static size_t finest_of(int k) {
    const size_t half = (size_t)1 << k >> 1;
    return half * (3 * half + 2);
}
static size_t stored_of(const rqt_block_header *h) {
    return (size_t)h->width * (size_t)h->height;
}

static void *zstd_take(void *opaque, size_t bytes) {
    return memory_take(opaque, bytes);
}
static void zstd_drop(void *opaque, void *p) {
    memory_drop(opaque, p);
}

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
    /* The frame says how long its content is, and leaves checking to our checksum. */
    (void)ZSTD_CCtx_setParameter(c->compressor, ZSTD_c_compressionLevel, ZSTD_LEVEL);
    (void)ZSTD_CCtx_setParameter(c->compressor, ZSTD_c_minMatch, ZSTD_MATCH);
    (void)ZSTD_CCtx_setParameter(c->compressor, ZSTD_c_contentSizeFlag, 1);
    (void)ZSTD_CCtx_setParameter(c->compressor, ZSTD_c_checksumFlag, 0);
    *codec = c;
    return RQT_OK;
}

void rqt_codec_free(rqt_codec *codec) {
    if (!codec) return;
    (void)ZSTD_freeCCtx(codec->compressor);
    (void)ZSTD_freeDCtx(codec->decompressor);
    const rqt_allocator allocator = codec->allocator;
    memory_drop(&allocator, codec);
}

size_t rqt_block_bound(int k) {
    if (k < 0 || k > RQT_MAX_BLOCK_K) return 0;
    return HEADER_BYTES + ZSTD_COMPRESSBOUND(PAYLOAD_BOUND(count_of(k))) + PIECES * ZSTD_BLOCK_HEADER;
}

/* ---------------------------------------------------------------------------------------------- header */

/* Bytes of the payload; of a sparse block without the bits that say what is kept, for only they know how many they
 * are. */
static size_t payload_of(const rqt_block_header *h) {
    const size_t heights = h->sparse ? h->kept : stored_of(h), finest = h->sparse ? 0 : finest_of(h->k);
    const size_t errors = (h->sparse ? h->kept : count_of(h->k)) - KEPT_CORNERS - finest;
    return heights * (size_t)h->height_planes + finest * (size_t)h->finest_planes +
           errors * (size_t)h->error_planes + (h->has_voids ? BIT_BYTES(heights) : 0) +
           (h->has_outline ? BIT_BYTES(h->sparse ? errors : count_of(h->k)) : 0);
}

static bool payload_fits(const rqt_block_header *h) {
    const size_t known = payload_of(h);
    if (!h->sparse) return h->payload == known;
    return h->payload >= known && h->payload - known <= BIT_BYTES(count_of(h->k) - KEPT_CORNERS);
}

static void put_header(const rqt_block_header *h, uint8_t *bytes) {
    memset(bytes, 0, HEADER_BYTES);
    memcpy(bytes, "RQTB", 4);
    bytes[AT_VERSION] = (uint8_t)h->version;
    bytes[AT_K] = (uint8_t)h->k;
    bytes[AT_FLAGS] = (uint8_t)((h->has_voids ? HAS_VOIDS : 0) | (h->all_void ? ALL_VOID : 0) |
                                (h->has_outline ? HAS_OUTLINE : 0) | (h->sparse ? IS_SPARSE : 0));
    bytes[AT_PLANES] = (uint8_t)(h->height_planes | h->finest_planes << 4 | h->error_planes << 6);
    put16(bytes + AT_WIDTH, (uint16_t)h->width);
    put16(bytes + AT_HEIGHT, (uint16_t)h->height);
    put32(bytes + AT_PAYLOAD, (uint32_t)h->payload);
    put_double(bytes + AT_QUANTUM, h->quantum);
    put16(bytes + AT_FLOOR, h->floor);
    put16(bytes + AT_GROUND, h->ground);
    put32(bytes + AT_KEPT, (uint32_t)h->kept);
}

static rqt_status corrupt(rqt_message *message, const char *sentence) {
    sentence_begin(message, sentence);
    return RQT_CORRUPT;
}

static rqt_status corrupt_number(rqt_message *message, const char *what, int64_t number) {
    sentence_begin(message, what);
    sentence_add_integer(message, number);
    return RQT_CORRUPT;
}

rqt_status rqt_block_info(const uint8_t *bytes, size_t size, rqt_block_header *header, rqt_message *message) {
    memset(header, 0, sizeof *header);
    if (size < HEADER_BYTES)
        return corrupt_number(message, "not a block: its header takes 40 bytes, not ", (int64_t)size);
    if (memcmp(bytes, "RQTB", 4) != 0) return corrupt(message, "not a block: it does not begin with RQTB");
    if (bytes[AT_VERSION] != RQT_FORMAT_VERSION)
        return corrupt_number(message, "a block of unknown format version ", bytes[AT_VERSION]);
    const uint8_t flags = bytes[AT_FLAGS];
    const rqt_block_header h = {
        .version = bytes[AT_VERSION],
        .k = bytes[AT_K],
        .width = get16(bytes + AT_WIDTH),
        .height = get16(bytes + AT_HEIGHT),
        .has_voids = flags & HAS_VOIDS,
        .all_void = flags & ALL_VOID,
        .has_outline = flags & HAS_OUTLINE,
        .sparse = flags & IS_SPARSE,
        .height_planes = bytes[AT_PLANES] & 15,
        .finest_planes = bytes[AT_PLANES] >> 4 & 3,
        .error_planes = bytes[AT_PLANES] >> 6,
        .quantum = get_double(bytes + AT_QUANTUM),
        .payload = get32(bytes + AT_PAYLOAD),
        .floor = get16(bytes + AT_FLOOR),
        .ground = get16(bytes + AT_GROUND),
        .kept = get32(bytes + AT_KEPT),
    };
    if (h.k > RQT_MAX_BLOCK_K) return corrupt_number(message, "the block's k is too large: ", h.k);
    if (flags > KNOWN_FLAGS || (h.has_voids && h.all_void))
        return corrupt_number(message, "the block's flags make no sense: ", flags);
    if (h.height_planes > HEIGHT_PLANES || h.finest_planes > ERROR_PLANES || h.error_planes > ERROR_PLANES ||
        (h.all_void && h.height_planes) || (h.sparse && h.finest_planes))
        return corrupt_number(message, "the block's planes make no sense: ", bytes[AT_PLANES]);
    if (h.width < 1 || h.width > side_of(h.k))
        return corrupt_number(message, "the block's width does not fit its k: ", h.width);
    if (h.height < 1 || h.height > side_of(h.k))
        return corrupt_number(message, "the block's height does not fit its k: ", h.height);
    if (!isfinite(h.quantum) || !(h.quantum > 0)) return corrupt(message, "the block's quantum is not a length");
    if (h.sparse ? h.kept < KEPT_CORNERS || h.kept > count_of(h.k) : h.kept != 0)
        return corrupt_number(message, "the block cannot keep so many vertices: ", (int64_t)h.kept);
    if ((!h.sparse && h.floor) || (!h.has_outline && h.ground))
        return corrupt(message, "the block has a floor or an outline cost that its flags deny");
    if (!payload_fits(&h))
        return corrupt_number(message, "the block's payload does not fit its header: ", (int64_t)h.payload);
    /* zstd would also take frames of its older formats, frames to skip, and several frames in a row. */
    const uint8_t *frame = bytes + HEADER_BYTES;
    const size_t room = size - HEADER_BYTES;
    if (room < 4 || get32(frame) != ZSTD_MAGICNUMBER || ZSTD_findFrameCompressedSize(frame, room) != room)
        return corrupt(message, "the block's compressed bytes are cut off, or not what follows its header");
    *header = h;
    sentence_begin(message, "");
    return RQT_OK;
}

/* ------------------------------------------------------------------------------------- planes and bits */

static int put_planes(uint8_t **to, const uint32_t *v, size_t count) {
    uint32_t all = 0;
    for (size_t i = 0; i < count; i++) all |= v[i];
    int planes = 0;
    for (; all; all >>= 8, planes++) {
        uint8_t *p = *to;
        for (size_t i = 0; i < count; i++) p[i] = (uint8_t)(v[i] >> 8 * planes);
        *to += count;
    }
    return planes;
}

static int put_planes16(uint8_t **to, const uint16_t *v, size_t count) {
    uint16_t all = 0;
    for (size_t i = 0; i < count; i++) all |= v[i];
    int planes = 0;
    for (; all; all >>= 8, planes++) {
        uint8_t *p = *to;
        for (size_t i = 0; i < count; i++) p[i] = (uint8_t)(v[i] >> 8 * planes);
        *to += count;
    }
    return planes;
}

static void get_planes16(const uint8_t *p, size_t count, int planes, uint16_t *v) {
    const uint8_t *high = p + count;
    if (planes == 0) memset(v, 0, count * sizeof *v);
    if (planes == 1)
        for (size_t i = 0; i < count; i++) v[i] = p[i];
    if (planes == 2)
        for (size_t i = 0; i < count; i++) v[i] = (uint16_t)(p[i] | high[i] << 8);
}

/* One bit per element of a row, low bit first, from bit `at` on; returns how many were set. */
static size_t put_bits(uint8_t *bits, size_t at, const uint8_t *flags, int32_t n, int flag) {
    size_t set = 0;
    for (int32_t x = 0; x < n; x++, at++)
        if (flags[x] & flag) {
            bits[at / 8] = (uint8_t)(bits[at / 8] | 1 << at % 8);
            set++;
        }
    return set;
}

static bool padding_is_zero(const uint8_t *bits, size_t count) {
    return count % 8 == 0 || bits[count / 8] >> count % 8 == 0;
}

/* ---------------------------------------------------------------------------------------------- encode */

static bool has_shape(const rqt_block *b) {
    if (b->k < 0 || b->k > RQT_MAX_BLOCK_K) return false;
    const int32_t n = side_of(b->k);
    return b->width >= 1 && b->width <= n && b->height >= 1 && b->height <= n && (b->sparse || b->floor == 0);
}

/* Are these heights and flags that can be stored? Counts the valid heights. */
static bool is_sound(const rqt_block *b, size_t *valid) {
    const int32_t n = side_of(b->k);
    uint32_t bad = 0;
    int all = 0;
    *valid = 0;
    for (int32_t y = 0; y < b->height; y++)
        for (int32_t x = 0; x < b->width; x++) {
            const uint32_t q = (uint32_t)b->q[y * n + x], largest = RQT_HEIGHT_LIMIT - 1;
            const uint32_t is_valid = b->flags[y * n + x] & RQT_VALID;
            bad |= ((q + largest) | (largest - q)) & (0 - is_valid);
            *valid += is_valid;
        }
    for (size_t i = 0; i < count_of(b->k); i++) all |= b->flags[i];
    return bad >> 31 == 0 && all <= (RQT_VALID | RQT_OUTLINE);
}

static int64_t lesser(int64_t a, int64_t b) {
    return a < b ? a : b;
}
static int64_t greater(int64_t a, int64_t b) {
    return a > b ? a : b;
}

/* Heights for the voids of a row: the plane through what is left and above, but no further than these; so they cost
 * little, and no slope runs away over a wide void. start: a height of the block, to begin with. */
static void fill_voids(int32_t *row, const int32_t *above, const uint8_t *flags, int32_t width, int32_t start) {
    for (int32_t x = 0; x < width; x++) {
        if (flags[x] & RQT_VALID) continue;
        if (!above || x == 0) {
            row[x] = x > 0 ? row[x - 1] : above ? above[0] : start;
        } else {
            const int64_t w = row[x - 1], n = above[x], plane = w + n - above[x - 1];
            row[x] = (int32_t)greater(lesser(w, n), lesser(greater(w, n), plane));
        }
    }
}

/* The first valid height of a block, row by row; 0 when there is none. */
static int32_t first_height(const rqt_block *b) {
    const int32_t n = side_of(b->k);
    for (int32_t y = 0; y < b->height; y++)
        for (int32_t x = 0; x < b->width; x++)
            if (b->flags[y * n + x] & RQT_VALID) return b->q[y * n + x];
    return 0;
}

/* The stored rows of a block, with every void filled. */
static void copy_filled(const rqt_block *b, int32_t *q) {
    const int32_t n = side_of(b->k), start = first_height(b);
    for (int32_t y = 0; y < b->height; y++) {
        const ptrdiff_t at = (ptrdiff_t)y * n;
        memcpy(q + at, b->q + at, (size_t)b->width * sizeof *q);
        fill_voids(q + at, y ? q + at - n : NULL, b->flags + at, b->width, start);
    }
}

/* Past the last sample stands the last sample again. */
static void repeat_heights(int32_t *q, int32_t n, int32_t width, int32_t height) {
    for (int32_t y = 0; y < height && width < n; y++)
        for (int32_t x = width; x < n; x++) q[y * n + x] = q[y * n + width - 1];
    for (int32_t y = height; y < n; y++) memcpy(q + y * n, q + (height - 1) * n, (size_t)n * sizeof *q);
}

/* Compress the payload into one frame; its pieces end at ends[]. Each is flushed, and so gets entropy tables of its
 * own: heights, errors and bits are too different to share theirs. Returns 0 when there is no memory. */
static size_t compress(rqt_codec *codec, const size_t ends[PIECES], bool in_pieces, uint8_t *bytes, size_t room) {
    ZSTD_CCtx *z = codec->compressor;
    ZSTD_outBuffer out = {bytes, room, 0};
    ZSTD_inBuffer in = {codec->payload, 0, 0};
    (void)ZSTD_CCtx_reset(z, ZSTD_reset_session_only);
    (void)ZSTD_CCtx_setPledgedSrcSize(z, ends[PIECES - 1]);
    for (int i = in_pieces ? 0 : PIECES - 1; i < PIECES; i++) {
        const bool last = i == PIECES - 1;
        in.size = ends[i];
        if (in.size == in.pos && !last) continue;
        if (ZSTD_compressStream2(z, &out, &in, last ? ZSTD_e_end : ZSTD_e_flush) != 0) return 0;
    }
    return out.pos;
}

/* The least error of an outline vertex of the finest scale; 0: there is none. */
static rqt_code ground_of(const rqt_block *b) {
    const int32_t n = side_of(b->k);
    rqt_code least = 0;
    for (int32_t y = 0; y < n; y++)
        for (int32_t x = 0; x < n; x++) {
            const ptrdiff_t at = (ptrdiff_t)y * n + x;
            if (((x | y) & 1) && b->flags[at] & RQT_OUTLINE && (!least || b->error[at] < least))
                least = b->error[at];
        }
    return least;
}

/* Validity as the decoder will know it: past the last sample stands the last sample's. */
static void copy_flags(const rqt_block *b, uint8_t *flags) {
    const int32_t n = side_of(b->k);
    for (int32_t y = 0; y < n; y++)
        for (int32_t x = 0; x < n; x++) {
            const ptrdiff_t from =
                (ptrdiff_t)(y < b->height ? y : b->height - 1) * n + (x < b->width ? x : b->width - 1);
            flags[y * n + x] = (uint8_t)((b->flags[from] & RQT_VALID) | (b->flags[y * n + x] & RQT_OUTLINE));
        }
    const int32_t last = n - 1;
    flags[0] &= RQT_VALID;
    flags[last] &= RQT_VALID;
    flags[last * n] &= RQT_VALID;
    flags[last * n + last] &= RQT_VALID;
}

/* Has a vertex other than a corner the outline bit? */
static bool has_outline(const rqt_block *b) {
    const size_t n = (size_t)side_of(b->k), count = n * n, corners[4] = {0, n - 1, count - n, count - 1};
    size_t bits = 0;
    for (size_t i = 0; i < count; i++) bits += (b->flags[i] & RQT_OUTLINE) != 0;
    for (int c = 0; c < 4; c++) bits -= (b->flags[corners[c]] & RQT_OUTLINE) != 0;
    return bits > 0;
}

/* The payload of a block that keeps all vertices; ends of its pieces but the last. False: it cannot be stored. */
static bool put_whole(rqt_codec *codec, const rqt_block *block, rqt_block_header *h, uint8_t **p,
                      size_t ends[PIECES]) {
    const int32_t n = side_of(block->k), width = block->width, height = block->height;
    const size_t count = count_of(block->k), stored = stored_of(h), finest = finest_of(block->k);
    size_t valid;
    if (!is_sound(block, &valid)) return false;
    h->has_voids = valid > 0 && valid < stored;
    h->all_void = valid == 0;

    copy_filled(block, codec->q);
    for (int32_t y = 0; y < height; y++) {
        const int32_t *row = codec->q + (ptrdiff_t)y * n;
        predict_height_row(row, y ? row - n : NULL, width, codec->residual + (ptrdiff_t)y * width);
    }
    h->height_planes = put_planes(p, codec->residual, stored);
    ends[0] = (size_t)(*p - codec->payload);

    repeat_heights(codec->q, n, width, height);
    uint8_t *const outline = codec->bits;
    h->has_outline = has_outline(block);
    const bool flagged = h->has_voids || h->all_void || h->has_outline;
    if (flagged) copy_flags(block, codec->flags);
    if (h->has_outline) {
        predict_outline(&codec->marks, block->k, width, height, codec->flags, outline);
        const rqt_block known = {.k = block->k, .error = block->error, .flags = codec->flags};
        h->ground = ground_of(&known);
    }
    const error_field field = {block->k,  width,      height, codec->q, flagged ? codec->flags : NULL,
                               h->ground, h->quantum, false,  false};
    predict_errors(&codec->errors, &field, block->error);
    h->finest_planes = put_planes16(p, codec->errors.residual, finest);
    h->error_planes = put_planes16(p, codec->errors.residual + finest, count - KEPT_CORNERS - finest);
    ends[1] = (size_t)(*p - codec->payload);

    if (h->has_voids) {
        memset(*p, 0, BIT_BYTES(stored));
        for (int32_t y = 0; y < height; y++)
            put_bits(*p, (size_t)y * (size_t)width, block->flags + (ptrdiff_t)y * n, width, RQT_VALID);
        *p += BIT_BYTES(stored);
    }
    if (h->has_outline) {
        memcpy(*p, outline, BIT_BYTES(count));
        *p += BIT_BYTES(count);
    }
    return true;
}

/* The payload of a sparse block. */
static bool put_sparse(rqt_codec *codec, const rqt_block *block, rqt_block_header *h, uint8_t **p,
                       size_t ends[PIECES]) {
    kept_list *list = &codec->list;
    if (!kept_list_make(list, block)) return false;
    h->kept = list->count;
    size_t valid = 0, outline = 0;
    uint32_t bad = 0;
    for (size_t i = 0; i < list->count; i++) {
        const int32_t at = list->vertex[i].at;
        const uint8_t flags = block->flags[at];
        const uint32_t q = (uint32_t)block->q[at], largest = RQT_HEIGHT_LIMIT - 1;
        if (flags > (RQT_VALID | RQT_OUTLINE)) return false;
        if (flags & RQT_VALID) bad |= (q + largest) | (largest - q);
        valid += flags & RQT_VALID;
        outline += i >= KEPT_CORNERS && flags & RQT_OUTLINE;
        codec->q[at] = block->q[at];
        codec->flags[i] = flags;
    }
    if (bad >> 31) return false;
    h->has_voids = valid > 0 && valid < list->count;
    h->all_void = valid == 0;
    h->has_outline = outline > 0;
    h->ground = h->has_outline ? kept_ground(list, block) : 0;

    predict_kept_heights(list, block->k, block->flags, codec->q, codec->residual);
    if (h->all_void) memset(codec->residual, 0, list->count * sizeof *codec->residual);
    h->height_planes = put_planes(p, codec->residual, list->count);
    ends[0] = (size_t)(*p - codec->payload);
    predict_kept_errors(list, block, codec->q, h->quantum, h->ground, codec->error, codec->errors.residual);
    h->error_planes = put_planes16(p, codec->errors.residual, list->count - KEPT_CORNERS);
    ends[1] = (size_t)(*p - codec->payload);

    if (h->has_voids) {
        memset(*p, 0, BIT_BYTES(list->count));
        put_bits(*p, 0, codec->flags, (int32_t)list->count, RQT_VALID);
        *p += BIT_BYTES(list->count);
    }
    if (h->has_outline) {
        const size_t count = list->count - KEPT_CORNERS;
        memset(*p, 0, BIT_BYTES(count));
        put_bits(*p, 0, codec->flags + KEPT_CORNERS, (int32_t)count, RQT_OUTLINE);
        *p += BIT_BYTES(count);
    }
    memcpy(*p, list->bits, BIT_BYTES(list->offered));
    *p += BIT_BYTES(list->offered);
    return true;
}

rqt_status rqt_block_encode(rqt_codec *codec, const rqt_block *block, double quantum, uint8_t *bytes,
                            size_t *size) {
    *size = 0;
    if (!isfinite(quantum) || !(quantum > 0) || !has_shape(block)) return RQT_INVALID;
    rqt_block_header h = {
        .version = RQT_FORMAT_VERSION,
        .k = block->k,
        .width = block->width,
        .height = block->height,
        .quantum = quantum,
        .sparse = block->sparse,
        .floor = block->floor,
    };
    uint8_t *p = codec->payload;
    size_t ends[PIECES];
    if (!(h.sparse ? put_sparse : put_whole)(codec, block, &h, &p, ends)) return RQT_INVALID;
    ends[PIECES - 1] = h.payload = (size_t)(p - codec->payload);
    put_header(&h, bytes);
    const size_t compressed = compress(codec, ends, (h.sparse ? h.kept : count_of(h.k)) >= WORTH_PIECES,
                                       bytes + HEADER_BYTES, rqt_block_bound(block->k) - HEADER_BYTES);
    if (compressed == 0) return RQT_NO_MEMORY;
    *size = HEADER_BYTES + compressed;
    put64(bytes + AT_CHECKSUM, checksum64(bytes, *size, AT_CHECKSUM));
    return RQT_OK;
}

/* ---------------------------------------------------------------------------------------------- decode */

/* A decoded payload of a block that keeps all vertices. NULL, or what is wrong with it. */
static const char *get_whole(rqt_codec *codec, const rqt_block_header *h, rqt_block *block) {
    const size_t finest = finest_of(h->k), others = count_of(h->k) - KEPT_CORNERS - finest;
    const uint8_t *p = codec->payload + stored_of(h) * (size_t)h->height_planes;
    const int32_t n = side_of(h->k);
    if (restore_heights(codec->payload, stored_of(h), h->height_planes, h->width, h->height, n, block->q) >> 31)
        return "heights that are out of range";
    repeat_heights(block->q, n, h->width, h->height);
    if (h->finest_planes) get_planes16(p, finest, h->finest_planes, codec->errors.residual);
    p += finest * (size_t)h->finest_planes;
    if (h->error_planes) get_planes16(p, others, h->error_planes, codec->errors.residual + finest);
    p += others * (size_t)h->error_planes;
    const flag_source from = {h->k,
                              h->width,
                              h->height,
                              h->all_void,
                              h->has_voids ? p : NULL,
                              h->has_outline ? p + (h->has_voids ? BIT_BYTES(stored_of(h)) : 0) : NULL};
    if ((from.validity && !padding_is_zero(from.validity, stored_of(h))) ||
        (from.outline && !padding_is_zero(from.outline, count_of(h->k))) ||
        !restore_flags(&codec->marks, &from, block->flags))
        return "validity or outline bits that are not what its flags promise";
    const error_field field = {h->k,
                               h->width,
                               h->height,
                               block->q,
                               h->has_voids || h->all_void || h->has_outline ? block->flags : NULL,
                               h->ground,
                               h->quantum,
                               h->finest_planes == 0,
                               h->error_planes == 0};
    restore_errors(&codec->errors, &field, block->error);
    return NULL;
}

static const char *get_sparse(rqt_codec *codec, const rqt_block_header *h, rqt_block *block) {
    kept_list *list = &codec->list;
    const size_t kept = h->kept, count = kept - KEPT_CORNERS, vertices = count_of(h->k);
    const uint8_t *errors = codec->payload + kept * (size_t)h->height_planes;
    const uint8_t *validity = errors + count * (size_t)h->error_planes;
    const uint8_t *outline = validity + (h->has_voids ? BIT_BYTES(kept) : 0);
    const uint8_t *bits = outline + (h->has_outline ? BIT_BYTES(count) : 0);
    if (!kept_list_read(list, h->k, bits, h->payload - payload_of(h)) || list->count != kept)
        return "another number of kept vertices than it says";
    memset(block->q, 0, vertices * sizeof *block->q);
    memset(block->error, 0, vertices * sizeof *block->error);
    memset(block->flags, RQT_VALID, vertices);
    get_planes(codec->payload, kept, h->height_planes, (int32_t)kept, codec->residual);
    if (restore_kept_heights(list, h->k, codec->residual, block->q) >> 31) return "heights that are out of range";
    const bool flagged = h->has_voids || h->all_void || h->has_outline;
    if (flagged) {
        size_t valid = 0, outlines = 0;
        for (size_t i = 0; i < kept; i++) {
            const size_t j = i - KEPT_CORNERS;
            const unsigned v = h->has_voids ? (unsigned)validity[i / 8] >> i % 8 & 1 : !h->all_void;
            const unsigned o = h->has_outline && i >= KEPT_CORNERS ? (unsigned)outline[j / 8] >> j % 8 & 1 : 0;
            valid += v;
            outlines += o;
            block->flags[list->vertex[i].at] = (uint8_t)(v * RQT_VALID | o * RQT_OUTLINE);
        }
        if (h->has_voids && (valid == 0 || valid == kept || !padding_is_zero(validity, kept)))
            return "validity bits that are not what its flags promise";
        if (h->has_outline && (outlines == 0 || !padding_is_zero(outline, count)))
            return "outline bits that are not what its flags promise";
    }
    get_planes16(errors, count, h->error_planes, codec->errors.residual);
    if (!restore_kept_errors(list, block, flagged, h->quantum, h->ground, codec->errors.residual))
        return "a vertex that is kept although its error is not above the floor";
    return NULL;
}

/* The header has passed rqt_block_info and is of block's k. */
static rqt_status decode(rqt_codec *codec, const uint8_t *bytes, size_t size, const rqt_block_header *h,
                         rqt_block *block, rqt_message *message) {
    if (get64(bytes + AT_CHECKSUM) != checksum64(bytes, size, AT_CHECKSUM))
        return corrupt(message, "the block's bytes have changed: its checksum differs");
    /* Into the whole buffer: zstd is faster where it may write past the end. */
    const size_t got = ZSTD_decompressDCtx(codec->decompressor, codec->payload, sizeof codec->payload,
                                           bytes + HEADER_BYTES, size - HEADER_BYTES);
    if (ZSTD_isError(got)) {
        sentence_begin(message, "the block does not decompress: ");
        sentence_add(message, ZSTD_getErrorName(got));
        return RQT_CORRUPT;
    }
    if (got != h->payload)
        return corrupt_number(message, "the block decompresses to another length than it says: ", (int64_t)got);
    block->width = h->width;
    block->height = h->height;
    block->sparse = h->sparse;
    block->floor = h->floor;
    const char *wrong = (h->sparse ? get_sparse : get_whole)(codec, h, block);
    if (!wrong) return RQT_OK;
    sentence_begin(message, "the block holds ");
    sentence_add(message, wrong);
    return RQT_CORRUPT;
}

rqt_status rqt_block_decode(rqt_codec *codec, const uint8_t *bytes, size_t size, rqt_block *block) {
    rqt_block_header h;
    const rqt_status status = rqt_block_info(bytes, size, &h, NULL);
    if (status != RQT_OK) return status;
    return h.k == block->k ? decode(codec, bytes, size, &h, block, NULL) : RQT_CORRUPT;
}

rqt_status rqt_block_check(rqt_codec *codec, const uint8_t *bytes, size_t size, rqt_message *message) {
    rqt_block_header h;
    const rqt_status status = rqt_block_info(bytes, size, &h, message);
    if (status != RQT_OK) return status;
    rqt_block block = {.k = h.k, .q = codec->q, .error = codec->error, .flags = codec->flags};
    return decode(codec, bytes, size, &h, &block, message);
}
