/* geometry.c - the geometry that the readers build, and its public door.
 *
 * Both readers (geometry_wkt.c, geometry_blob.c) go through the same five steps, so what a valid geometry is gets
 * decided here once: lines of two points or more, rings that are closed and have four points or more. A ring is
 * never closed silently: whoever wrote it may have lost more than its last point. Empty members are dropped. */
#include "geometry.h"

#include <math.h>

static const char *const type_names[GEOMETRY_TYPES] = {
    "GEOMETRY",          "POINT",        "LINESTRING",         "POLYGON",        "MULTIPOINT",
    "MULTILINESTRING",   "MULTIPOLYGON", "GEOMETRYCOLLECTION", "CIRCULARSTRING", "COMPOUNDCURVE",
    "CURVEPOLYGON",      "MULTICURVE",   "MULTISURFACE",       "CURVE",          "SURFACE",
    "POLYHEDRALSURFACE", "TIN",          "TRIANGLE",
};

const char *geometry_type_name(uint32_t type) {
    return type < GEOMETRY_TYPES ? type_names[type] : "?";
}

geometry_type geometry_member_type(uint32_t type) {
    switch (type) {
    case GEOMETRY_MULTIPOINT:
        return GEOMETRY_POINT;
    case GEOMETRY_MULTILINE:
        return GEOMETRY_LINE;
    case GEOMETRY_MULTIPOLYGON:
        return GEOMETRY_POLYGON;
    default:
        return GEOMETRY_ANY;
    }
}

rqt_status geometry_refuse_type(uint32_t type, rqt_message *message) {
    if (type > GEOMETRY_COLLECTION && type < GEOMETRY_TYPES) {
        sentence_begin(message, geometry_type_name(type));
        sentence_add(message, " is not supported");
        return RQT_UNSUPPORTED;
    }
    sentence_begin(message, "unknown geometry type ");
    sentence_add_integer(message, type);
    return RQT_INVALID;
}

static rqt_status no_memory(rqt_message *message) {
    sentence_begin(message, "no memory for the geometry");
    return RQT_NO_MEMORY;
}

/* Room for one more; the array moves, so its new address comes back. NULL: no memory, nothing changed. */
static void *with_room(const rqt_geometry *g, void *array, size_t *capacity, size_t count, size_t size) {
    return memory_grow(&g->allocator, &array, capacity, count + 1, size) ? array : NULL;
}

rqt_status geometry_open_part(rqt_geometry *g, geometry_type type, rqt_message *message) {
    geometry_part *p = with_room(g, g->parts, &g->part_capacity, g->part_count, sizeof *p);
    if (!p) return no_memory(message);
    g->parts = p;
    g->parts[g->part_count++] = (geometry_part){type, g->ring_count, 0};
    g->opened++;
    return RQT_OK;
}

rqt_status geometry_open_ring(rqt_geometry *g, rqt_message *message) {
    geometry_ring *r = with_room(g, g->rings, &g->ring_capacity, g->ring_count, sizeof *r);
    if (!r) return no_memory(message);
    g->rings = r;
    g->rings[g->ring_count++] = (geometry_ring){g->point_count, 0};
    g->parts[g->part_count - 1].count++;
    return RQT_OK;
}

rqt_status geometry_add_point(rqt_geometry *g, double x, double y, rqt_message *message) {
    geometry_point *p = with_room(g, g->points, &g->point_capacity, g->point_count, sizeof *p);
    if (!p) return no_memory(message);
    g->points = p;
    g->points[g->point_count++] = (geometry_point){x, y};
    g->rings[g->ring_count - 1].count++;
    return RQT_OK;
}

/* "polygon 3: ring 2" and then what is wrong with it. */
static rqt_status bad_ring(const rqt_geometry *g, size_t ring, const char *what, rqt_message *message) {
    sentence_begin(message, "polygon ");
    sentence_add_integer(message, (int64_t)g->opened);
    sentence_add(message, ": ring ");
    sentence_add_integer(message, (int64_t)ring);
    sentence_add(message, what);
    return RQT_INVALID;
}

rqt_status geometry_close_ring(rqt_geometry *g, rqt_message *message) {
    const geometry_part *part = &g->parts[g->part_count - 1];
    const geometry_ring *ring = &g->rings[g->ring_count - 1];
    if (ring->count == 0 || part->type == GEOMETRY_POINT) return RQT_OK;
    if (part->type == GEOMETRY_LINE) {
        if (ring->count >= 2) return RQT_OK;
        sentence_begin(message, "line ");
        sentence_add_integer(message, (int64_t)g->opened);
        sentence_add(message, " has fewer than 2 points");
        return RQT_INVALID;
    }
    geometry_point first = g->points[ring->first], last = g->points[ring->first + ring->count - 1];
    if (first.x != last.x || first.y != last.y) return bad_ring(g, part->count, " is not closed", message);
    if (ring->count < 4) return bad_ring(g, part->count, " has fewer than 4 points", message);
    return RQT_OK;
}

rqt_status geometry_close_part(rqt_geometry *g, rqt_message *message) {
    const geometry_part *part = &g->parts[g->part_count - 1];
    size_t empty = 0;
    for (size_t i = 0; i < part->count; i++) {
        if (g->rings[part->first + i].count > 0) continue;
        if (part->count > 1) return bad_ring(g, i + 1, " is empty", message);
        empty++;
    }
    if (empty == part->count) { /* also when there is no ring at all */
        g->ring_count = part->first;
        g->part_count--;
    }
    return RQT_OK;
}

rqt_status rqt_geometry_parse(const void *bytes, size_t n, bool text, const rqt_allocator *allocator,
                              rqt_geometry **geometry, rqt_message *message) {
    *geometry = NULL;
    rqt_geometry *g = memory_take(allocator, sizeof *g);
    if (!g) return no_memory(message);
    *g = (rqt_geometry){.allocator = *allocator};
    rqt_status status = text ? geometry_read_text(g, bytes, n, message) : geometry_read_bytes(g, bytes, n, message);
    if (status != RQT_OK) {
        rqt_geometry_free(g);
        return status;
    }
    if (g->srid == -1) g->srid = 0; /* GeoPackage: -1 and 0 are the undefined systems */
    *geometry = g;
    return RQT_OK;
}

rqt_status rqt_geometry_of_lines(const double *xy, const size_t *counts, size_t lines, int32_t srid,
                                 const rqt_allocator *allocator, rqt_geometry **geometry) {
    *geometry = NULL;
    rqt_geometry *g = memory_take(allocator, sizeof *g);
    if (!g) return RQT_NO_MEMORY;
    *g = (rqt_geometry){.allocator = *allocator, .srid = srid};
    rqt_status status = RQT_OK;
    for (size_t l = 0; l < lines && status == RQT_OK; l++) {
        if (counts[l] == 0) continue;
        status = geometry_open_part(g, counts[l] == 1 ? GEOMETRY_POINT : GEOMETRY_LINE, NULL);
        if (status == RQT_OK) status = geometry_open_ring(g, NULL);
        for (size_t i = 0; i < counts[l] && status == RQT_OK; i++, xy += 2)
            status = isfinite(xy[0]) && isfinite(xy[1]) ? geometry_add_point(g, xy[0], xy[1], NULL) : RQT_INVALID;
    }
    if (status == RQT_OK)
        *geometry = g;
    else
        rqt_geometry_free(g);
    return status;
}

void rqt_geometry_free(rqt_geometry *geometry) {
    if (!geometry) return;
    rqt_allocator a = geometry->allocator;
    memory_drop(&a, geometry->points);
    memory_drop(&a, geometry->rings);
    memory_drop(&a, geometry->parts);
    memory_drop(&a, geometry);
}

int32_t rqt_geometry_srid(const rqt_geometry *geometry) {
    return geometry->srid;
}

/* ------------------------------------------------------------------------------------------ lines, and turns */

size_t rqt_geometry_members(const rqt_geometry *geometry) {
    return geometry->part_count;
}

const double *rqt_geometry_line(const rqt_geometry *geometry, size_t n, size_t *points) {
    const geometry_part *part = &geometry->parts[n];
    *points = 0;
    if (part->type == GEOMETRY_POLYGON) return NULL;
    *points = geometry->rings[part->first].count;
    return &geometry->points[geometry->rings[part->first].first].x;
}

/* The part once more, moved in x. */
static rqt_status add_moved(rqt_geometry *g, size_t part, double by) {
    const geometry_part from = g->parts[part];
    rqt_status status = geometry_open_part(g, from.type, NULL);
    for (size_t r = 0; r < from.count && status == RQT_OK; r++) {
        const geometry_ring ring = g->rings[from.first + r];
        status = geometry_open_ring(g, NULL);
        for (size_t i = 0; i < ring.count && status == RQT_OK; i++) {
            const geometry_point p = g->points[ring.first + i];
            status = geometry_add_point(g, p.x + by, p.y, NULL);
        }
    }
    return status;
}

rqt_status rqt_geometry_repeat(rqt_geometry *g, double period, double low, double high) {
    const size_t parts = g->part_count;
    for (size_t p = 0; p < parts; p++) {
        double least = INFINITY, most = -INFINITY;
        const geometry_part part = g->parts[p];
        for (size_t r = 0; r < part.count; r++)
            for (size_t i = 0; i < g->rings[part.first + r].count; i++) {
                const double x = g->points[g->rings[part.first + r].first + i].x;
                least = fmin(least, x);
                most = fmax(most, x);
            }
        if (!(least >= -3 * period && most <= 3 * period)) continue;
        const double first = ceil((low - most) / period), last = floor((high - least) / period);
        /* Whole numbers. NOLINTNEXTLINE(clang-analyzer-security.FloatLoopCounter) */
        for (double turn = first; turn <= last; turn++) {
            if (turn == 0) continue; /* the part where it is */
            const rqt_status status = add_moved(g, p, turn * period);
            if (status != RQT_OK) return status;
        }
    }
    return RQT_OK;
}
