/* geometry.h - a geometry as it came, private to the core: what the readers of text and of bytes fill, and what
 * region.c compiles.
 *
 * Nested collections are flattened: a region is the union of its members, however deep they sat. So a geometry is
 * three flat arrays: parts (points, lines, polygons) own consecutive rings, rings own consecutive points. A point
 * or a line has exactly one ring, of one point or of at least two; the rings of a polygon are closed and have at
 * least four points, the first ring is its shell. Empty members leave no part. Coordinates are finite. */
#ifndef RQT_GEOMETRY_H
#define RQT_GEOMETRY_H

#include "internal.h"

/* The codes of ISO WKB, which SpatiaLite shares. Those above a collection are known by name and refused. */
typedef enum geometry_type {
    GEOMETRY_ANY = 0,
    GEOMETRY_POINT = 1,
    GEOMETRY_LINE = 2,
    GEOMETRY_POLYGON = 3,
    GEOMETRY_MULTIPOINT = 4,
    GEOMETRY_MULTILINE = 5,
    GEOMETRY_MULTIPOLYGON = 6,
    GEOMETRY_COLLECTION = 7,
    GEOMETRY_TYPES = 18 /* one more than the last name */
} geometry_type;

/* Collections within collections, at most; the readers recurse once for each. */
#define GEOMETRY_MAX_DEPTH 32

typedef struct geometry_point {
    double x, y;
} geometry_point;

typedef struct geometry_ring {
    size_t first, count; /* points */
} geometry_ring;

typedef struct geometry_part {
    geometry_type type;  /* GEOMETRY_POINT, _LINE or _POLYGON */
    size_t first, count; /* rings */
} geometry_part;

struct rqt_geometry {
    rqt_allocator allocator;
    int32_t srid;
    size_t opened; /* parts begun, the empty ones too: the number that sentences name */
    geometry_point *points;
    geometry_ring *rings;
    geometry_part *parts;
    size_t point_count, point_capacity;
    size_t ring_count, ring_capacity;
    size_t part_count, part_capacity;
};

/* The upper-case name of a type, 1 .. GEOMETRY_TYPES-1. */
const char *geometry_type_name(uint32_t type);
/* A member type of MULTI...: the type of what it holds; GEOMETRY_ANY for a collection. */
geometry_type geometry_member_type(uint32_t type);
/* RQT_UNSUPPORTED for a type that has a name but no reader, else RQT_INVALID; with the sentence. */
rqt_status geometry_refuse_type(uint32_t type, rqt_message *message);

/* The steps of both readers: open a part, open and close its rings with points between, close the part. The
 * closing ones check what the head of this file promises. x and y must be finite. */
rqt_status geometry_open_part(rqt_geometry *g, geometry_type type, rqt_message *message);
rqt_status geometry_open_ring(rqt_geometry *g, rqt_message *message);
rqt_status geometry_add_point(rqt_geometry *g, double x, double y, rqt_message *message);
rqt_status geometry_close_ring(rqt_geometry *g, rqt_message *message);
rqt_status geometry_close_part(rqt_geometry *g, rqt_message *message);

/* The readers. g is empty and stays releasable when they fail. */
rqt_status geometry_read_text(rqt_geometry *g, const char *text, size_t n, rqt_message *message);
rqt_status geometry_read_bytes(rqt_geometry *g, const uint8_t *bytes, size_t n, rqt_message *message);

#endif
