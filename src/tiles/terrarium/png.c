/* png.c - pixels as PNG (ISO 15948): red, green, blue of 8 bits, without alpha, for browsers multiply
 * colours by it. What the tile is off and how many of its pixels are void stands in two tEXt chunks before the
 * pixels.
 *
 * The bytes of a row are differences from the row above (filter Up): heights are smooth in both directions, and the
 * differences of green and blue wrap as those of the heights do. Measured on real tiles beside the other filters:
 * `make bench-tiles`.
 */
#include "terrarium.h"

#include "format.h"

#include <libdeflate.h>
#include <stdio.h>
#include <string.h>

enum { ROW = 1 + 3 * PIXELS, FILTER_UP = 2, LEVEL = 1, RGB = 2, CHUNK = 12 };

static uint8_t *put_number(uint8_t *p, uint32_t n) {
    for (int i = 0; i < 4; i++) p[i] = (uint8_t)(n >> (24 - 8 * i));
    return p + 4;
}

/* data may be where it goes already. */
static uint8_t *put_chunk(uint8_t *p, const char *type, const void *data, size_t size) {
    uint8_t *begin = put_number(p, (uint32_t)size);
    memcpy(begin, type, 4);
    if (size > 0 && data != begin + 4) memcpy(begin + 4, data, size);
    return put_number(begin + 4 + size, libdeflate_crc32(0, begin, 4 + size));
}

static uint8_t *put_text(uint8_t *p, const char *keyword, const char *text) {
    char both[80];
    const int n = snprintf(both, sizeof both, "%s%c%s", keyword, 0, text);
    return put_chunk(p, "tEXt", both, (size_t)n);
}

/* Bytes first, then their differences: loops that the compiler does many bytes of at once. */
static void filter(const pixel_grid *g, uint8_t *rows) {
    uint8_t bytes[2][3 * PIXELS] = {{0}}; /* of a row and of the one above */
    for (int j = 0; j < PIXELS; j++) {
        const int32_t *code = g->code + (j + 1) * GRID + 1;
        uint8_t *now = bytes[j % 2], *p = rows + j * ROW + 1;
        const uint8_t *above = bytes[1 - j % 2];
        for (int i = 0; i < PIXELS; i++) {
            now[3 * i] = (uint8_t)(code[i] >> 16);
            now[3 * i + 1] = (uint8_t)(code[i] >> 8);
            now[3 * i + 2] = (uint8_t)code[i];
        }
        p[-1] = FILTER_UP;
        for (int n = 0; n < 3 * PIXELS; n++) p[n] = (uint8_t)(now[n] - above[n]);
    }
}

static int count_voids(const pixel_grid *g) {
    int count = 0;
    for (int j = 1; j <= PIXELS; j++)
        for (int i = 1; i <= PIXELS; i++) count += g->code[j * GRID + i] == NO_HEIGHT;
    return count;
}

static size_t put_all(const pixel_grid *g, struct libdeflate_compressor *packer, const uint8_t *rows, size_t bound,
                      uint8_t *bytes) {
    static const uint8_t signature[] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
    uint8_t header[13] = {0}, *p = bytes;
    char text[32];
    put_number(put_number(header, PIXELS), PIXELS);
    header[8] = 8;
    header[9] = RGB;
    memcpy(p, signature, sizeof signature);
    p = put_chunk(p + sizeof signature, "IHDR", header, sizeof header);
    format_double(g->error, text);
    p = put_text(p, "error_metres", text);
    snprintf(text, sizeof text, "%d", count_voids(g));
    p = put_text(p, "void_pixels", text);
    const size_t size = libdeflate_zlib_compress(packer, rows, ROW * PIXELS, p + 8, bound);
    p = put_chunk(p, "IDAT", p + 8, size);
    return (size_t)(put_chunk(p, "IEND", NULL, 0) - bytes);
}

int png_write(const pixel_grid *g, tile_bytes *out) {
    enum { AROUND = 8 + 5 * CHUNK + 13 + 2 * 80 };
    struct libdeflate_compressor *packer = libdeflate_alloc_compressor(LEVEL);
    const size_t bound = packer ? libdeflate_zlib_compress_bound(packer, ROW * PIXELS) : 0;
    uint8_t *rows = sqlite3_malloc(ROW * PIXELS), *bytes = sqlite3_malloc64(AROUND + bound);
    const bool ok = packer && rows && bytes;
    if (ok) {
        filter(g, rows);
        *out = (tile_bytes){bytes, put_all(g, packer, rows, bound, bytes)};
    } else {
        sqlite3_free(bytes);
    }
    libdeflate_free_compressor(packer);
    sqlite3_free(rows);
    return ok ? SQLITE_OK : SQLITE_NOMEM;
}
