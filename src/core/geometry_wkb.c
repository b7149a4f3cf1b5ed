/* geometry_wkb.c - a geometry as well-known binary, to hand it to others. */
#include "geometry.h"

static uint8_t *put_head(uint8_t *p, uint32_t type, bool counts, size_t count) {
    *p++ = 1; /* little-endian */
    put32(p, type);
    if (counts) put32(p + 4, (uint32_t)count);
    return p + (counts ? 8 : 4);
}

static uint8_t *put_points(const rqt_geometry *g, const geometry_ring *ring, uint8_t *p) {
    for (size_t i = 0; i < ring->count; i++, p += 16) {
        put_double(p, g->points[ring->first + i].x);
        put_double(p + 8, g->points[ring->first + i].y);
    }
    return p;
}

static uint8_t *put_part(const rqt_geometry *g, const geometry_part *part, uint8_t *p) {
    const geometry_ring *ring = &g->rings[part->first];
    if (part->type == GEOMETRY_POINT) return put_points(g, ring, put_head(p, part->type, false, 0));
    if (part->type == GEOMETRY_LINE) return put_points(g, ring, put_head(p, part->type, true, ring->count));
    p = put_head(p, part->type, true, part->count);
    for (size_t r = 0; r < part->count; r++) {
        put32(p, (uint32_t)ring[r].count);
        p = put_points(g, &ring[r], p + 4);
    }
    return p;
}

rqt_status rqt_geometry_wkb(const rqt_geometry *g, const rqt_allocator *allocator, uint8_t **bytes, size_t *size) {
    *bytes = NULL;
    *size = 9 + 9 * g->part_count + 4 * g->ring_count + 16 * g->point_count; /* at most */
    uint8_t *p = memory_take(allocator, *size);
    if (!p) return RQT_NO_MEMORY;
    *bytes = p;
    if (g->part_count != 1) p = put_head(p, GEOMETRY_COLLECTION, true, g->part_count);
    for (size_t i = 0; i < g->part_count; i++) p = put_part(g, &g->parts[i], p);
    *size = (size_t)(p - *bytes);
    return RQT_OK;
}

bool rqt_geometry_is_empty(const rqt_geometry *geometry) {
    return geometry->part_count == 0;
}
