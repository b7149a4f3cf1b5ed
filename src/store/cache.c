/* cache.c - a hash table of entries that also hang in a ring, the most recently used behind the head. */
#include "cache.h"

#include <string.h>

typedef struct entry entry;
struct entry {
    entry *newer, *older; /* the ring */
    entry *next;          /* the chain of its bucket */
    uint64_t terrain;
    rqt_block_number number;
    rqt_block block;
};

#define BUCKETS 4096

struct block_cache {
    rqt_allocator allocator;
    size_t limit, bytes;
    entry head; /* of the ring: head.older is the newest, head.newer the oldest */
    entry *bucket[BUCKETS];
};

static size_t bucket_of(uint64_t terrain, rqt_block_number number) {
    uint64_t h = (number ^ terrain * UINT64_C(0xBF58476D1CE4E5B9)) * UINT64_C(0x9E3779B97F4A7C15);
    return (size_t)(h >> 40) % BUCKETS;
}

static void unlink_entry(entry *e) {
    e->newer->older = e->older;
    e->older->newer = e->newer;
}

static void link_newest(block_cache *c, entry *e) {
    e->older = c->head.older;
    e->newer = &c->head;
    e->older->newer = e;
    c->head.older = e;
}

static void drop(block_cache *c, entry *e) {
    entry **link = &c->bucket[bucket_of(e->terrain, e->number)];
    while (*link != e) link = &(*link)->next;
    *link = e->next;
    unlink_entry(e);
    c->bytes -= rqt_block_bytes(e->block.k);
    rqt_block_free(&e->block, &c->allocator);
    (void)c->allocator.resize(c->allocator.context, e, 0);
}

block_cache *block_cache_create(const rqt_allocator *allocator, size_t limit) {
    block_cache *c = allocator->resize(allocator->context, NULL, sizeof *c);
    if (!c) return NULL;
    memset(c, 0, sizeof *c);
    c->allocator = *allocator;
    c->limit = limit;
    c->head.newer = c->head.older = &c->head;
    return c;
}

void block_cache_clear(block_cache *c) {
    while (c->head.older != &c->head) drop(c, c->head.older);
}

void block_cache_free(block_cache *c) {
    if (!c) return;
    block_cache_clear(c);
    const rqt_allocator allocator = c->allocator;
    (void)allocator.resize(allocator.context, c, 0);
}

static entry *find(block_cache *c, uint64_t terrain, rqt_block_number number) {
    entry *e = c->bucket[bucket_of(terrain, number)];
    while (e && (e->terrain != terrain || e->number != number)) e = e->next;
    return e;
}

const rqt_block *block_cache_find(block_cache *c, uint64_t terrain, rqt_block_number number) {
    entry *e = find(c, terrain, number);
    if (!e) return NULL;
    unlink_entry(e);
    link_newest(c, e);
    return &e->block;
}

rqt_block *block_cache_add(block_cache *c, uint64_t terrain, rqt_block_number number, int k) {
    block_cache_forget(c, terrain, number);
    const size_t bytes = rqt_block_bytes(k);
    while (c->bytes + bytes > c->limit && c->head.newer != &c->head) drop(c, c->head.newer);
    entry *e = c->allocator.resize(c->allocator.context, NULL, sizeof *e);
    if (!e) return NULL;
    memset(e, 0, sizeof *e);
    if (rqt_block_create(k, &c->allocator, &e->block) != RQT_OK) {
        (void)c->allocator.resize(c->allocator.context, e, 0);
        return NULL;
    }
    e->terrain = terrain;
    e->number = number;
    entry **bucket = &c->bucket[bucket_of(terrain, number)];
    e->next = *bucket;
    *bucket = e;
    link_newest(c, e);
    c->bytes += bytes;
    return &e->block;
}

void block_cache_forget(block_cache *c, uint64_t terrain, rqt_block_number number) {
    entry *e = find(c, terrain, number);
    if (e) drop(c, e);
}
