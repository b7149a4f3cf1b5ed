/* cache.h - decoded blocks, least recently used first out. One per connection, for one thread. */
#ifndef RQT_CACHE_H
#define RQT_CACHE_H

#include "rqt.h"

typedef struct block_cache block_cache;

/* limit: bytes of decoded blocks to keep. NULL: no memory. */
block_cache *block_cache_create(const rqt_allocator *allocator, size_t limit);
void block_cache_free(block_cache *cache);
void block_cache_clear(block_cache *cache);
/* NULL when it is not there. Valid until the next call of block_cache_add or _clear. */
const rqt_block *block_cache_find(block_cache *cache, uint64_t terrain, rqt_block_number number);
/* A block to decode into, entered under its key: the oldest ones make room. NULL: no memory. When decoding fails,
 * block_cache_forget it. */
rqt_block *block_cache_add(block_cache *cache, uint64_t terrain, rqt_block_number number, int k);
void block_cache_forget(block_cache *cache, uint64_t terrain, rqt_block_number number);

#endif
