/* fuzz_block.c - bytes of blocks and summaries: any bytes, and those of sound blocks that were damaged and signed
 * again, outside or inside the compressed frame. */
#include "fuzz.h"

#include <zstd.h>

enum { AT_PAYLOAD = 12, AT_CHECKSUM = 24, HEADER = 40 };

static void decode(const uint8_t *bytes, size_t size, const rqt_allocator *a, rqt_codec *codec,
                   const fuzz_heap *h) {
    uint8_t *exact = exact_copy(bytes, size);
    rqt_block_header header;
    rqt_message why = {""};
    const rqt_status info = rqt_block_info(exact, size, &header, &why);
    HOLD(info == RQT_OK || (info == RQT_CORRUPT && why.text[0]), "status %d without a sentence", (int)info);
    memset(&why, 0, sizeof why);
    const rqt_status checked = rqt_block_check(codec, exact, size, &why);
    HOLD(checked == RQT_OK || (checked == RQT_CORRUPT && why.text[0]) || checked == RQT_NO_MEMORY, "status %d",
         (int)checked);
    rqt_block block;
    if (info == RQT_OK) {
        HOLD(header.k >= 0 && header.k <= RQT_MAX_BLOCK_K, "k %d", header.k);
        if (went_well(rqt_block_create(header.k, a, &block), h)) {
            const size_t n = (size_t)((1 << header.k) + 1);
            const rqt_status status = rqt_block_decode(codec, exact, size, &block);
            HOLD(status == RQT_OK || status == RQT_CORRUPT, "status %d", (int)status);
            HOLD(checked == RQT_NO_MEMORY || (status == RQT_OK) == (checked == RQT_OK), "decode and check differ");
            for (size_t i = 0; status == RQT_OK && i < n * n; i++)
                HOLD(block.q[i] > -RQT_HEIGHT_LIMIT && block.q[i] < RQT_HEIGHT_LIMIT && block.flags[i] <= 3,
                     "vertex %zu", i);
            rqt_summary corners = {.corner = {{1, 2, 3}, {1, 2, 3}, {1, 2, 3}, {1, 2, 3}}};
            if (status == RQT_OK) rqt_block_set_corners(&block, &corners);
            if (status == RQT_OK) HOLD(block.error[0] == 2 && block.error[n * n - 1] == 2, "corners");
        }
        rqt_block_free(&block, a);
    } else {
        HOLD(checked != RQT_OK, "check knows better than info");
    }
    free(exact);
}

static void summary(input *in) {
    uint8_t bytes[RQT_SUMMARY_BYTES + 8] = {0};
    rqt_summary s = {.tol = {take_eps(in), take_eps(in)}, .exact = {take_eps(in), take_eps(in)}};
    for (int i = 0; i < 4; i++)
        s.corner[i] = (rqt_summary_vertex){take_between(in, -9, 9), take_eps(in), (uint8_t)take_between(in, 0, 3)};
    rqt_summary_encode(&s, bytes);
    size_t size = RQT_SUMMARY_BYTES;
    rqt_summary back;
    take_damage(in, bytes, size);
    if (take_between(in, 0, 1)) fuzz_sign(bytes, size, 8);
    if (take_between(in, 0, 7) == 0) size = (size_t)take_between(in, 0, RQT_SUMMARY_BYTES + 8);
    uint8_t *exact = exact_copy(bytes, size);
    if (rqt_summary_decode(exact, size, &back) == RQT_OK) {
        uint8_t again[RQT_SUMMARY_BYTES];
        rqt_summary_encode(&back, again);
        HOLD(memcmp(again, bytes, sizeof again) == 0, "a summary has two spellings");
        for (int o = 0; o < 2; o++) {
            const rqt_code eps = take_eps(in);
            const bool answers = rqt_summary_answers(&back, (rqt_outline)o, eps);
            (void)rqt_summary_needs_block(&back, (rqt_outline)o, eps);
            const rqt_interval *i = o == RQT_OUTLINE_TOL ? &back.tol : &back.exact;
            HOLD(answers == (i->em <= eps && eps < i->em_parent), "interval");
        }
    }
    free(exact);
}

const long fuzz_runs = 1500;

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    input in = {data, size};
    fuzz_heap heap;
    const rqt_allocator a = fuzz_allocator(&heap, &in);
    rqt_codec *codec = NULL;
    summary(&in);
    if (!went_well(rqt_codec_create(&a, &codec), &heap)) {
        HOLD(heap.live == 0, "%zu bytes leaked", heap.live);
        return 0;
    }
    const int way = take_between(&in, 0, 3), k = take_between(&in, 0, 4);
    rqt_block block = {0};
    if (way == 0) {
        decode(in.bytes, in.size, &a, codec, &heap);
    } else if (went_well(rqt_block_create(k, &a, &block), &heap)) {
        const int side = (1 << k) + 1;
        block.width = take_between(&in, 1, side);
        block.height = take_between(&in, 1, side);
        block.sparse = take_between(&in, 0, 2) == 0 && block.width == side && block.height == side;
        block.floor = block.sparse ? take_eps(&in) : 0;
        const int wild = take_between(&in, 0, 3);
        for (int i = 0; i < side * side; i++) {
            const int x = i % side < block.width ? i % side : block.width - 1,
                      y = i / side < block.height ? i / side : block.height - 1, from = y * side + x;
            if (from == i) {
                block.q[i] = wild == 0 ? take_between(&in, -RQT_HEIGHT_LIMIT + 1, RQT_HEIGHT_LIMIT - 1)
                                       : take_between(&in, -20, 20);
                block.flags[i] = (uint8_t)(wild == 1 ? take_between(&in, 0, 3) : RQT_VALID);
            } else { /* past the raster: the last sample again */
                block.q[i] = block.q[from];
                block.flags[i] = (uint8_t)((block.flags[from] & RQT_VALID) | (block.flags[i] & RQT_OUTLINE));
            }
            block.error[i] = take_eps(&in);
        }
        const size_t bound = rqt_block_bound(k);
        HOLD(bound > HEADER && rqt_block_bytes(k) >= (size_t)(side * side) * 7, "k %d", k);
        uint8_t *bytes = malloc(bound + 64);
        size_t n = 0;
        if (!bytes) abort();
        const rqt_status status = rqt_block_encode(codec, &block, take_between(&in, 1, 50) / 8.0, bytes, &n);
        if (status == RQT_OK) {
            HOLD(n <= bound, "%zu bytes, bound %zu", n, bound);
            decode(bytes, n, &a, codec, &heap);
            uint32_t payload;
            memcpy(&payload, bytes + AT_PAYLOAD, sizeof payload);
            uint8_t *inside = malloc((size_t)payload + 1);
            if (!inside) abort();
            if (way == 3 && ZSTD_decompress(inside, payload, bytes + HEADER, n - HEADER) == payload) {
                take_damage(&in, inside, payload);
                if (take_between(&in, 0, 7) == 0 && payload) payload--;
                uint8_t *whole = malloc(HEADER + ZSTD_compressBound(payload));
                if (!whole) abort();
                memcpy(whole, bytes, HEADER);
                n = HEADER + ZSTD_compress(whole + HEADER, ZSTD_compressBound(payload), inside, payload, 1);
                free(bytes);
                bytes = whole;
            } else {
                take_damage(&in, bytes, n);
                if (take_between(&in, 0, 7) == 0) n = (size_t)take_bits(&in, 3) % (n + 1);
            }
            free(inside);
            fuzz_sign(bytes, n, AT_CHECKSUM);
            decode(bytes, n, &a, codec, &heap);
        }
        free(bytes);
    }
    rqt_block_free(&block, &a);
    rqt_codec_free(codec);
    HOLD(heap.live == 0, "%zu bytes leaked", heap.live);
    return 0;
}
