/* block.c - decoded blocks: three arrays in one piece of memory. The bytes of a block are block_codec.c's. */
#include "internal.h"

static size_t vertices_of(int k) {
    size_t n = ((size_t)1 << k) + 1;
    return n * n;
}

size_t rqt_block_bytes(int k) {
    if (k < 0 || k > RQT_MAX_BLOCK_K) return 0;
    return vertices_of(k) * (sizeof(int32_t) + sizeof(rqt_code) + sizeof(uint8_t));
}

/* The arrays stand in the order of their alignment, so none needs padding. A fresh block is all void, errors 0. */
rqt_status rqt_block_create(int k, const rqt_allocator *allocator, rqt_block *block) {
    memset(block, 0, sizeof *block);
    if (k < 0 || k > RQT_MAX_BLOCK_K) return RQT_INVALID;
    int32_t *memory = memory_take(allocator, rqt_block_bytes(k));
    if (!memory) return RQT_NO_MEMORY;
    memset(memory, 0, rqt_block_bytes(k));
    block->k = k;
    block->width = block->height = (1 << k) + 1;
    block->q = memory;
    block->error = (rqt_code *)(memory + vertices_of(k));
    block->flags = (uint8_t *)(block->error + vertices_of(k));
    return RQT_OK;
}

void rqt_block_free(rqt_block *block, const rqt_allocator *allocator) {
    memory_drop(allocator, block->q);
    memset(block, 0, sizeof *block);
}

void rqt_block_set_corners(rqt_block *block, const rqt_summary *summary) {
    const size_t n = ((size_t)1 << block->k) + 1, at[4] = {0, n - 1, (n - 1) * n, n * n - 1};
    for (int c = 0; c < 4; c++) {
        block->error[at[c]] = summary->corner[c].error;
        block->flags[at[c]] =
            (uint8_t)((block->flags[at[c]] & RQT_VALID) | (summary->corner[c].flags & RQT_OUTLINE));
    }
}

/* Vertices past the raster, in blocks that reach over its edge, have no error of their own: see lattice_has_area.
 * They take what those that depend on them in the block have, so that the vertices above any eps are a closed set
 * in the block as well. Fine to coarse: sides from centres of half their scale, centres from sides of their own. */
void block_settle_past(rqt_block *b) {
    const int32_t n = (1 << b->k) + 1;
    if (b->width == n && b->height == n) return;
    for (int32_t q = 1; q < n - 1; q *= 2) {
        for (int kind = q == 1 ? 1 : 0; kind < 2; kind++) { /* 0: sides, 1: centres */
            for (int32_t v = kind ? q : 0; v < n; v += kind ? 2 * q : q) {
                const bool odd = v / q & 1;
                for (int32_t u = kind || !odd ? q : 0; u < n; u += 2 * q) {
                    if (u - q < b->width - 1 && v - q < b->height - 1) continue;
                    const ptrdiff_t at = (ptrdiff_t)v * n + u;
                    for (int c = 0; c < 4; c++) {
                        const int32_t h = q / 2;
                        const int32_t x = u + (kind ? (c == 0 ? -q : c == 1 ? q : 0) : c & 1 ? h : -h);
                        const int32_t y = v + (kind ? (c == 2 ? -q : c == 3 ? q : 0) : c & 2 ? h : -h);
                        if (x < 0 || y < 0 || x >= n || y >= n) continue;
                        const ptrdiff_t from = (ptrdiff_t)y * n + x;
                        /* What a sparse block does not keep, its bytes do not depend on. */
                        if (b->sparse && b->error[from] <= b->floor && !(b->flags[from] & RQT_OUTLINE)) continue;
                        if (b->error[from] > b->error[at]) b->error[at] = b->error[from];
                        b->flags[at] = (uint8_t)(b->flags[at] | (b->flags[from] & RQT_OUTLINE));
                    }
                }
            }
        }
    }
}
