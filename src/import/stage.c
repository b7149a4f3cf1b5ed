/* stage.c - encoded blocks between the band that made them and their turn in the database.
 *
 * Blocks are made band by band, all levels together, but are written in ascending order of number, which is level
 * by level and in Morton order: that is what keeps the tables small and quick. A summary is complete only when the
 * last band is done. So a block is put down as it comes, behind the one before: its summary, then its bytes; a
 * directory of one offset per block, by level and cell, finds it again.
 */
#include "parts.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#define NOWHERE UINT64_MAX

typedef struct record {
    rqt_summary summary;
    uint32_t size; /* of the bytes that follow */
} record;

typedef struct level_cells {
    int32_t columns, rows;
    uint64_t *offset; /* row by row */
} level_cells;

struct import_stage {
    pthread_mutex_t lock;
    rqt_lattice lattice;
    int k;
    import_scratch *scratch;
    uint64_t end;
    level_cells level[RQT_MAX_K + 1];
};

/* Cells of a level that have a block. */
static void extent(const rqt_lattice *lattice, int level, int32_t *columns, int32_t *rows) {
    const int64_t side = (int64_t)1 << (lattice->K - level);
    const int64_t last_x = lattice->width > 1 ? lattice->width - 1 : 1;
    const int64_t last_y = lattice->height > 1 ? lattice->height - 1 : 1;
    *columns = (int32_t)((last_x + side - 1) / side);
    *rows = (int32_t)((last_y + side - 1) / side);
}

size_t import_stage_bytes(const rqt_lattice *lattice, int k) {
    size_t bytes = sizeof(import_stage);
    for (int level = 0; level < rqt_block_levels(lattice, k); level++) {
        int32_t columns, rows;
        extent(lattice, level, &columns, &rows);
        bytes += (size_t)columns * (size_t)rows * sizeof(uint64_t);
    }
    return bytes;
}

bool import_stage_create(const import_job *job, const rqt_lattice *lattice, int k, uint64_t memory,
                         import_stage **stage) {
    import_stage *s = *stage = calloc(1, sizeof *s);
    if (!s) return import_no_memory(job, "keeping blocks");
    pthread_mutex_init(&s->lock, NULL);
    s->lattice = *lattice;
    s->k = k;
    for (int level = 0; level < rqt_block_levels(lattice, k); level++) {
        level_cells *l = &s->level[level];
        extent(lattice, level, &l->columns, &l->rows);
        const size_t n = (size_t)l->columns * (size_t)l->rows;
        l->offset = malloc(n * sizeof *l->offset);
        if (!l->offset) return import_no_memory(job, "keeping blocks");
        memset(l->offset, 0xFF, n * sizeof *l->offset);
    }
    return import_scratch_create(job, memory, &s->scratch);
}

void import_stage_free(import_stage *s) {
    if (!s) return;
    for (int level = 0; level <= RQT_MAX_K; level++) free(s->level[level].offset);
    import_scratch_free(s->scratch);
    pthread_mutex_destroy(&s->lock);
    free(s);
}

import_scratch *import_stage_scratch(import_stage *stage) {
    return stage->scratch;
}

/* Where the directory has this block; NULL when there is no such block. */
static uint64_t *entry(const import_stage *s, rqt_block_number number) {
    rqt_block_place place;
    if (rqt_block_locate(&s->lattice, s->k, number, &place) != RQT_OK) return NULL;
    const level_cells *l = &s->level[place.level];
    return &l->offset[(size_t)place.j * (size_t)l->columns + (size_t)place.i];
}

bool import_stage_put(import_stage *s, rqt_block_number number, const rqt_summary *summary, const uint8_t *bytes,
                      size_t size) {
    uint64_t *where = entry(s, number);
    record r;
    if (!where) return false;
    memset(&r, 0, sizeof r);
    r.summary = *summary;
    r.size = (uint32_t)size;
    pthread_mutex_lock(&s->lock);
    const uint64_t offset = s->end;
    s->end += sizeof r + size;
    pthread_mutex_unlock(&s->lock);
    if (!import_scratch_write(s->scratch, offset, &r, sizeof r) ||
        !import_scratch_write(s->scratch, offset + sizeof r, bytes, size))
        return false;
    *where = offset;
    return true;
}

bool import_stage_take(import_stage *s, rqt_block_number number, rqt_summary *summary, uint8_t *bytes,
                       size_t *size) {
    const uint64_t *where = entry(s, number);
    record r;
    if (!where || *where == NOWHERE || !import_scratch_read(s->scratch, *where, &r, sizeof r)) return false;
    if (r.size > rqt_block_bound(s->k)) return false;
    *summary = r.summary;
    *size = r.size;
    return import_scratch_read(s->scratch, *where + sizeof r, bytes, r.size);
}
