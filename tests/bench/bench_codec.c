/* bench_codec.c - what the blocks of a raster weigh, part by part, and how fast they are coded.
 *
 *   bench_codec [-r RUNS] [-k FIRST,LAST] RASTER...
 *
 * For every raster and k: bits per source sample of the finest heights, of the errors, and of everything that the
 * coarser levels hold; of headers, summaries and all together; and millions of vertices coded per second, finest
 * blocks and sparse ones apart. A part weighs what the blocks shrink by when it is taken out of them: errors by
 * encoding blocks whose errors are what the decoder expects anyway, so the parts need not add up exactly.
 * Integers only: heights are taken as they are, the unit is a metre. */
#include "rqt.h"

#include <gdal.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <zstd.h>

static void *resize(void *context, void *p, size_t bytes) {
    (void)context;
    if (bytes) return realloc(p, bytes);
    free(p);
    return NULL;
}
static const rqt_allocator heap = {resize, NULL};

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void die(const char *what, const char *which) {
    fprintf(stderr, "bench_codec: %s: %s\n", which, what);
    exit(1);
}

typedef struct raster {
    rqt_grid grid;
    rqt_errors errors;
    int32_t *q;
    uint8_t *valid;
} raster;

static void load(const char *path, raster *r) {
    GDALDatasetH set = GDALOpen(path, GA_ReadOnly);
    if (!set) die("cannot be opened", path);
    const int width = GDALGetRasterXSize(set), height = GDALGetRasterYSize(set);
    GDALRasterBandH band = GDALGetRasterBand(set, 1);
    const size_t count = (size_t)width * (size_t)height;
    memset(r, 0, sizeof *r);
    r->q = malloc(count * sizeof *r->q);
    r->valid = malloc(count);
    if (!r->q || !r->valid || rqt_lattice_init(&r->grid.lattice, width, height) != RQT_OK)
        die("is too large", path);
    if (GDALRasterIO(band, GF_Read, 0, 0, width, height, r->q, width, height, GDT_Int32, 0, 0) != CE_None ||
        GDALRasterIO(GDALGetMaskBand(band), GF_Read, 0, 0, width, height, r->valid, width, height, GDT_Byte, 0,
                     0) != CE_None)
        die("cannot be read", path);
    GDALClose(set);
    bool voids = false;
    for (size_t i = 0; i < count; i++) {
        r->valid[i] = r->valid[i] != 0;
        voids |= !r->valid[i];
    }
    r->grid.q = r->q;
    r->grid.valid = voids ? r->valid : NULL;
    const rqt_unit metre = {0, 1, 1, 1, 1, 0};
    const rqt_void_cost cost = {30, 1};
    if (rqt_errors_compute(&r->grid, &metre, &cost, &heap, NULL, NULL, &r->errors) != RQT_OK)
        die("no memory for its errors", path);
    rqt_errors_saturate(&r->errors);
}

static void unload(raster *r) {
    rqt_errors_free(&r->errors, &heap);
    free(r->q);
    free(r->valid);
}

typedef struct kind { /* of blocks: finest, coarser */
    size_t blocks, vertices, kept;
    double bytes, without_errors;
    double encode, decode; /* seconds, the least of all runs */
} kind;

typedef struct encoded {
    uint8_t *bytes;
    size_t size;
    bool sparse;
} encoded;

/* What the block weighs when no error but what its heights imply is there: found by decoding a block of no error
 * residuals, which is the block of the same bytes with error planes 0. Its header says where they are; simpler is
 * to let the codec predict, by handing it errors that a decoder of zeros would get. Here: the size of the frame
 * with its error planes cut out of the payload. */
static size_t size_without_errors(const uint8_t *bytes, size_t size, ZSTD_CCtx *z) {
    rqt_block_header h;
    if (rqt_block_info(bytes, size, &h, NULL) != RQT_OK) die("is no block", "a block");
    uint8_t *payload = malloc(h.payload), *out = malloc(ZSTD_compressBound(h.payload));
    const size_t header = 40, half = (size_t)1 << h.k >> 1, side = ((size_t)1 << h.k) + 1;
    const size_t got = ZSTD_decompress(payload, h.payload, bytes + header, size - header);
    if (ZSTD_isError(got) || got != h.payload) die("does not decompress", "a block");
    const size_t stored = (size_t)h.width * (size_t)h.height, finest = h.sparse ? 0 : half * (3 * half + 2);
    const size_t heights = (h.sparse ? h.kept : stored) * (size_t)h.height_planes;
    const size_t errors = finest * (size_t)h.finest_planes +
                          ((h.sparse ? h.kept : side * side) - 4 - finest) * (size_t)h.error_planes;
    ZSTD_outBuffer to = {out, ZSTD_compressBound(h.payload), 0};
    ZSTD_CCtx_reset(z, ZSTD_reset_session_only);
    ZSTD_inBuffer from = {payload, heights, 0};
    ZSTD_compressStream2(z, &to, &from, ZSTD_e_flush);
    from = (ZSTD_inBuffer){payload + heights + errors, h.payload - heights - errors, 0};
    ZSTD_compressStream2(z, &to, &from, ZSTD_e_end);
    free(payload);
    free(out);
    return header + to.pos;
}

static void measure(const char *name, const raster *r, int k, int runs) {
    rqt_pyramid *pyramid;
    rqt_codec *codec;
    rqt_block block;
    if (rqt_pyramid_create(&r->grid, &r->errors, k, &heap, &pyramid) != RQT_OK) return;
    if (rqt_codec_create(&heap, &codec) != RQT_OK || rqt_block_create(k, &heap, &block) != RQT_OK)
        die("no memory for its blocks", name);
    ZSTD_CCtx *z = ZSTD_createCCtx();
    ZSTD_CCtx_setParameter(z, ZSTD_c_compressionLevel, 3);
    ZSTD_CCtx_setParameter(z, ZSTD_c_minMatch, 7);
    const size_t count = rqt_pyramid_count(pyramid);
    encoded *all = calloc(count, sizeof *all);
    uint8_t *bytes = malloc(rqt_block_bound(k));
    if (!all || !bytes) die("no memory for its blocks", name);
    const size_t n = ((size_t)1 << k) + 1;
    kind kinds[2] = {{.encode = 0, .decode = INFINITY}, {.encode = 0, .decode = INFINITY}};
    double most = 0;
    for (size_t i = 0; i < count; i++) {
        rqt_block_number number;
        rqt_summary summary;
        size_t size;
        rqt_pyramid_block(pyramid, i, &number, &summary, &block);
        kind *c = &kinds[block.sparse];
        const double begin = now();
        if (rqt_block_encode(codec, &block, 1, bytes, &size) != RQT_OK) die("a block is refused", name);
        c->encode += now() - begin;
        c->blocks++;
        c->vertices += n * n;
        c->bytes += (double)size;
        c->without_errors += (double)size_without_errors(bytes, size, z);
        if ((double)size > most) most = (double)size;
        rqt_block_header h;
        (void)rqt_block_info(bytes, size, &h, NULL);
        c->kept += h.sparse ? h.kept : n * n;
        all[i] = (encoded){malloc(size), size, block.sparse};
        memcpy(all[i].bytes, bytes, size);
    }
    for (int run = 0; run < runs; run++)
        for (int sparse = 0; sparse < 2; sparse++) {
            const double begin = now();
            for (size_t i = 0; i < count; i++)
                if (all[i].sparse == sparse && rqt_block_decode(codec, all[i].bytes, all[i].size, &block) != RQT_OK)
                    die("a block does not come back", name);
            const double taken = now() - begin;
            if (taken < kinds[sparse].decode) kinds[sparse].decode = taken;
        }
    const double samples = (double)r->grid.lattice.width * (double)r->grid.lattice.height;
    const kind *fine = &kinds[0], *coarse = &kinds[1];
    const double bits = 8 / samples, blocks = (double)count;
    printf(
        "%-14.14s %d %6zu %7.0f %6.0f | %6.3f %6.3f | %6.3f %6.3f | %5.1f%% | %6.3f %6.3f | %6.3f | %5.0f %5.0f | "
        "%5.0f %5.0f\n",
        name, k, count, (fine->bytes + coarse->bytes) / blocks, most, bits * fine->without_errors,
        bits * (fine->bytes - fine->without_errors), bits * coarse->without_errors,
        bits * (coarse->bytes - coarse->without_errors),
        coarse->vertices ? 100.0 * (double)coarse->kept / (double)coarse->vertices : 0.0,
        bits * (fine->bytes - fine->without_errors + coarse->bytes - coarse->without_errors),
        bits * blocks * RQT_SUMMARY_BYTES, bits * (fine->bytes + coarse->bytes + blocks * RQT_SUMMARY_BYTES),
        (double)fine->vertices / fine->encode * 1e-6, (double)fine->vertices / fine->decode * 1e-6,
        (double)coarse->vertices / coarse->encode * 1e-6, (double)coarse->vertices / coarse->decode * 1e-6);
    for (size_t i = 0; i < count; i++) free(all[i].bytes);
    free(all);
    free(bytes);
    ZSTD_freeCCtx(z);
    rqt_block_free(&block, &heap);
    rqt_codec_free(codec);
    rqt_pyramid_free(pyramid);
}

int main(int count, char **arguments) {
    int runs = 5, first = 5, last = 8, at = 1;
    for (; at + 1 < count && arguments[at][0] == '-'; at += 2) {
        if (!strcmp(arguments[at], "-r"))
            runs = atoi(arguments[at + 1]);
        else if (strcmp(arguments[at], "-k") != 0 || sscanf(arguments[at + 1], "%d,%d", &first, &last) != 2)
            die("is no option", arguments[at]);
    }
    if (at == count) die("name rasters", "usage");
    GDALAllRegister();
    printf(
        "bits per source sample; blocks: number, mean and most bytes; finest: heights (headers and masks with "
        "them), errors;\ncoarser: the same, and how many vertices are kept; all errors; summaries; all; encode and "
        "decode, million vertices/s: finest, coarser\n");
    for (; at < count; at++) {
        raster r;
        load(arguments[at], &r);
        const char *name = strrchr(arguments[at], '/');
        name = name ? name + 1 : arguments[at];
        for (int k = first; k <= last; k++) measure(name, &r, k, runs);
        unload(&r);
    }
    return 0;
}
