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
