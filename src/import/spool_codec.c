/* spool_codec.c - a strip of values as bytes, and back: quick, because a raster passes through it once each way.
 *
 * A value is taken as an unsigned integer of its width (floats by their bits). What is kept is its difference from
 * the value above, in the strip's first row from the value to the left, voids taking the value that they are
 * compared with; zigzag makes small differences of either sign small numbers. Their bytes go into planes, lowest
 * first, as many as the largest number needs: terrain takes one or two. Then zstd's entropy coder, with its
 * checksum.
 *
 * plain: byte 0 planes, byte 1 has there voids, bytes 2..7 zero; a byte 0 or 1 a sample where there are voids; the
 * planes, a byte a sample each; and what belongs to the strip as it is (conflicts).
 */
#include "spool.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#define ZSTD_STATIC_LINKING_ONLY /* literalCompressionMode */
#include <zstd.h>

/* Entropy coding alone: next to no search for matches. As small as level 1 here, and twice as quick. */
#define LEVEL (-100)
#define HEAD 8

struct spool_codec {
    ZSTD_CCtx *compressor;
    ZSTD_DCtx *expander;
    size_t samples, width, element;
    size_t plain_room, packed_room;
    uint8_t *plain, *packed;
    void *above; /* differences, or values, of the strip */
};

bool spool_codec_create(const import_job *job, import_kind kind, int32_t width, int32_t rows, spool_codec **codec) {
    spool_codec *c = *codec = calloc(1, sizeof *c);
    if (!c) return import_no_memory(job, "opening the resume file");
    c->width = (size_t)width;
    c->samples = (size_t)width * (size_t)rows;
    c->element = import_kind_bytes(kind);
    c->compressor = ZSTD_createCCtx();
    c->expander = ZSTD_createDCtx();
    c->above = malloc(c->samples * c->element);
    if (!c->compressor || !c->expander || !c->above) return import_no_memory(job, "opening the resume file");
    ZSTD_CCtx_setParameter(c->compressor, ZSTD_c_compressionLevel, LEVEL);
    ZSTD_CCtx_setParameter(c->compressor, ZSTD_c_literalCompressionMode, ZSTD_lcm_huffman);
    ZSTD_CCtx_setParameter(c->compressor, ZSTD_c_checksumFlag, 1);
    return true;
}

void spool_codec_free(spool_codec *c) {
    if (!c) return;
    ZSTD_freeCCtx(c->compressor);
    ZSTD_freeDCtx(c->expander);
    free(c->plain);
    free(c->packed);
    free(c->above);
    free(c);
}

size_t spool_codec_bytes(import_kind kind, int32_t width, int32_t rows) {
    const size_t n = (size_t)width * (size_t)rows, element = import_kind_bytes(kind);
    return n * element + 2 * (n * (element + 1) + HEAD) + ((size_t)2 << 20);
}

static bool make_room(uint8_t **bytes, size_t *room, size_t wanted) {
    if (wanted <= *room) return true;
    uint8_t *more = realloc(*bytes, wanted);
    if (!more) return false;
    *bytes = more;
    *room = wanted;
    return true;
}

/* The same for both widths of a value. Signed shifts are avoided: zigzag of d is (d << 1) ^ -(d >> top). */
#define FOR_WIDTH(bits)                                                                                           \
    static uint64_t differ_##bits(const import_strip *s, size_t width, uint##bits##_t *out) {                     \
        const uint##bits##_t *v = s->values;                                                                      \
        uint##bits##_t all = 0, before = 0;                                                                       \
        for (size_t i = 0; i < width; i++) {                                                                      \
            const uint##bits##_t value = s->valid[i] ? v[i] : before, d = (uint##bits##_t)(value - before);       \
            out[i] = (uint##bits##_t)(d << 1) ^ (uint##bits##_t) - (d >> ((bits)-1));                             \
            all |= out[i];                                                                                        \
            before = value;                                                                                       \
        }                                                                                                         \
        for (size_t y = 1; y < (size_t)s->rows; y++) {                                                            \
            const uint##bits##_t *row = v + y * width, *up = row - width;                                         \
            const uint8_t *valid = s->valid + y * width, *over = valid - width;                                   \
            uint##bits##_t *to = out + y * width, any = 0;                                                        \
            for (size_t i = 0; i < width; i++) {                                                                  \
                const uint##bits##_t d = valid[i] ? (uint##bits##_t)(row[i] - (over[i] ? up[i] : 0)) : 0;         \
                to[i] = (uint##bits##_t)(d << 1) ^ (uint##bits##_t) - (d >> ((bits)-1));                          \
                any |= to[i];                                                                                     \
            }                                                                                                     \
            all |= any;                                                                                           \
        }                                                                                                         \
        return all;                                                                                               \
    }                                                                                                             \
    static void restore_##bits(import_strip *s, size_t width, const uint##bits##_t *in) {                         \
        uint##bits##_t *v = s->values, before = 0;                                                                \
        for (size_t i = 0; i < width; i++) {                                                                      \
            before = (uint##bits##_t)(before + ((in[i] >> 1) ^ (uint##bits##_t) - (in[i] & 1)));                  \
            v[i] = before;                                                                                        \
        }                                                                                                         \
        for (size_t y = 1; y < (size_t)s->rows; y++) {                                                            \
            uint##bits##_t *row = v + y * width;                                                                  \
            const uint##bits##_t *up = row - width, *d = in + y * width;                                          \
            const uint8_t *over = s->valid + (y - 1) * width;                                                     \
            for (size_t i = 0; i < width; i++)                                                                    \
                row[i] = (uint##bits##_t)((over[i] ? up[i] : 0) + ((d[i] >> 1) ^ (uint##bits##_t) - (d[i] & 1))); \
        }                                                                                                         \
    }                                                                                                             \
    static void split_##bits(const uint##bits##_t *in, size_t n, int planes, uint8_t *out) {                      \
        for (int p = 0; p < planes; p++, out += n)                                                                \
            for (size_t i = 0; i < n; i++) out[i] = (uint8_t)(in[i] >> (8 * p));                                  \
    }                                                                                                             \
    static void unite_##bits(const uint8_t *in, size_t n, int planes, uint##bits##_t *out) {                      \
        if (planes == 0) memset(out, 0, n * sizeof *out);                                                         \
        for (size_t i = 0; planes > 0 && i < n; i++) out[i] = in[i];                                              \
        for (int p = 1; p < planes; p++) {                                                                        \
            const uint8_t *plane = in + (size_t)p * n;                                                            \
            for (size_t i = 0; i < n; i++) out[i] |= (uint##bits##_t)((uint##bits##_t)plane[i] << (8 * p));       \
        }                                                                                                         \
    }

FOR_WIDTH(32)
FOR_WIDTH(64)

spool_bytes spool_encode(spool_codec *c, const import_strip *strip, const void *more, size_t more_size) {
    const spool_bytes none = {NULL, 0, 0};
    const size_t n = (size_t)strip->rows * c->width;
    const bool voids = memchr(strip->valid, 0, n) != NULL;
    const uint64_t all =
        c->element == 4 ? differ_32(strip, c->width, c->above) : differ_64(strip, c->width, c->above);
    int planes = 0;
    while (planes < 8 && all >> (8 * planes)) planes++;
    const size_t size = HEAD + (voids ? n : 0) + n * (size_t)planes + more_size;
    if (!make_room(&c->plain, &c->plain_room, size) ||
        !make_room(&c->packed, &c->packed_room, ZSTD_compressBound(size)))
        return none;
    memset(c->plain, 0, HEAD);
    c->plain[0] = (uint8_t)planes;
    c->plain[1] = voids;
    uint8_t *to = c->plain + HEAD;
    if (voids) {
        memcpy(to, strip->valid, n);
        to += n;
    }
    if (c->element == 4)
        split_32(c->above, n, planes, to);
    else
        split_64(c->above, n, planes, to);
    to += n * (size_t)planes;
    if (more_size) memcpy(to, more, more_size);
    const size_t packed = ZSTD_compress2(c->compressor, c->packed, c->packed_room, c->plain, size);
    return ZSTD_isError(packed) ? none : (spool_bytes){c->packed, packed, size};
}

uint8_t *spool_packed_room(spool_codec *c, size_t size) {
    return make_room(&c->packed, &c->packed_room, size) ? c->packed : NULL;
}

size_t spool_plain_most(const spool_codec *c, int32_t rows, size_t more_size) {
    return HEAD + (size_t)rows * c->width * (c->element + 1) + more_size;
}

/* Floats that no source would have given. */
static bool are_finite(const import_strip *s, size_t n) {
    bool fine = true;
    if (s->kind == IMPORT_F32)
        for (size_t i = 0; i < n; i++) fine &= !s->valid[i] || isfinite(((const float *)s->values)[i]);
    if (s->kind == IMPORT_F64)
        for (size_t i = 0; i < n; i++) fine &= !s->valid[i] || isfinite(((const double *)s->values)[i]);
    return fine;
}

bool spool_decode(spool_codec *c, size_t packed, size_t size, import_strip *strip, void *more, size_t more_size) {
    const size_t n = (size_t)strip->rows * c->width;
    if (size < HEAD || size > spool_plain_most(c, strip->rows, more_size) ||
        !make_room(&c->plain, &c->plain_room, size))
        return false;
    if (ZSTD_decompressDCtx(c->expander, c->plain, size, c->packed, packed) != size) return false;
    const uint8_t *from = c->plain + HEAD;
    const size_t planes = c->plain[0];
    const bool voids = c->plain[1] != 0;
    if (planes > c->element || size != HEAD + (voids ? n : 0) + n * planes + more_size) return false;
    for (size_t i = 0; i < n; i++) strip->valid[i] = voids ? from[i] & 1 : 1;
    if (voids) from += n;
    if (c->element == 4) {
        unite_32(from, n, (int)planes, c->above);
        restore_32(strip, c->width, c->above);
    } else {
        unite_64(from, n, (int)planes, c->above);
        restore_64(strip, c->width, c->above);
    }
    if (more_size) memcpy(more, from + n * planes, more_size);
    return are_finite(strip, n);
}
