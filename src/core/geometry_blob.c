/* geometry_blob.c - the reader of GeoPackage and SpatiaLite geometries, and of plain WKB.
 *
 * GeoPackage   "GP", version 0, flags, int32 srs_id, envelope, WKB. Flags: bit 0 little-endian header, bits 1-3 the
 *              kind of envelope (0 none, 1 xy, 2 xyz, 3 xym, 4 xyzm), bit 4 empty, bit 5 an extension's own format.
 * WKB          1 byte order, uint32 type, body. ISO adds 1000, 2000 or 3000 to the type for Z, M, ZM; EWKB sets the
 *              bits 0x80000000 and 0x40000000, and 0x20000000 when an int32 SRID follows. Both are read, each
 * member in its own byte order. A point with x and y NaN is an empty point. SpatiaLite   0x00, 0x00 or 0x01 byte
 * order, int32 srid, box of 4 doubles, 0x7C at offset 38, int32 class type, body, 0xFE last. Members of a
 * collection start with 0x69 and a class type. Class types are ISO's; 1000000 more for a compressed LINESTRING or
 * POLYGON: all points but the first and the last are float32 steps from the one before in x, y and z; m stays a
 * double. TinyPoint    0x00, 0x80 or 0x81 byte order, int32 srid, 1 .. 4 for XY, XYZ, XYM, XYZM, the doubles, 0xFE.
 *
 * Which one it is: "GP" is GeoPackage, 0x01 little-endian WKB. A leading 0x00 is big-endian WKB or SpatiaLite; its
 * second byte is then the top of the WKB type, 0x00 or flags from 0x20 up. So 0x01 and 0x81 there are SpatiaLite's;
 * 0x00 is when 0x7C and 0xFE are in place, and 0x80 when size, kind and end fit a TinyPoint. All else is WKB.
 *
 * Boxes and envelopes are skipped, not believed. Counts are hostile: each is checked against the bytes that are
 * left before anything is done with it, and arrays grow with what was really read. Sentences count bytes from 0. */
#include "geometry.h"

#include <math.h>

typedef struct blob {
    const uint8_t *bytes;
    size_t at, end;
    bool big;        /* the byte order at the cursor */
    bool spatialite; /* how members begin */
    rqt_geometry *geometry;
    rqt_message *message;
} blob;

typedef struct layout { /* of one entity */
    uint32_t type;
    bool z, m, compressed;
} layout;

#define TRY(step)                                    \
    do {                                             \
        rqt_status try_status = (step);              \
        if (try_status != RQT_OK) return try_status; \
    } while (0)

static rqt_status fail_at(const blob *b, const char *what, size_t at) {
    sentence_begin(b->message, what);
    sentence_add(b->message, " at byte ");
    sentence_add_integer(b->message, (int64_t)at);
    return RQT_INVALID;
}

static rqt_status need(const blob *b, size_t bytes) {
    return b->end - b->at >= bytes ? RQT_OK : fail_at(b, "the geometry is cut off", b->end);
}

/* -------------------------------------------------------------------------------------------- values -- */
/* These four trust that need() was asked. */
static uint32_t take32(blob *b) {
    uint32_t v = get32(b->bytes + b->at);
    b->at += 4;
    return b->big ? __builtin_bswap32(v) : v;
}

static double take_double(blob *b) {
    uint64_t bits = get64(b->bytes + b->at);
    double v;
    if (b->big) bits = __builtin_bswap64(bits);
    memcpy(&v, &bits, sizeof v);
    b->at += 8;
    return v;
}

static double take_float(blob *b) {
    uint32_t bits = take32(b);
    float v;
    memcpy(&v, &bits, sizeof v);
    return (double)v;
}

static int32_t take_srid(blob *b) {
    uint32_t v = take32(b);
    int32_t srid;
    memcpy(&srid, &v, sizeof srid);
    return srid;
}

static rqt_status take_count(blob *b, size_t smallest, size_t *count) {
    size_t start = b->at;
    TRY(need(b, 4));
    *count = take32(b);
    if (*count > (b->end - b->at) / smallest) return fail_at(b, "a count is larger than the geometry", start);
    return RQT_OK;
}

/* -------------------------------------------------------------------------------------------- bodies -- */
static size_t point_bytes(const layout *l) {
    return 16 + 8 * (size_t)l->z + 8 * (size_t)l->m;
}
static size_t step_bytes(const layout *l) {
    return 8 + 4 * (size_t)l->z + 8 * (size_t)l->m;
}

static rqt_status add_point(const blob *b, double x, double y, size_t at) {
    if (!isfinite(x) || !isfinite(y)) return fail_at(b, "a coordinate is not finite", at);
    return geometry_add_point(b->geometry, x, y, b->message);
}

/* A count and its points, as one ring. */
static rqt_status read_ring(blob *b, const layout *l) {
    size_t count, whole = point_bytes(l), step = l->compressed ? step_bytes(l) : whole;
    TRY(take_count(b, step, &count));
    if (l->compressed && count > 0) TRY(need(b, count > 1 ? 2 * whole + (count - 2) * step : whole));
    TRY(geometry_open_ring(b->geometry, b->message));
    double x = 0, y = 0;
    for (size_t i = 0; i < count; i++) {
        size_t start = b->at;
        bool is_step = l->compressed && i > 0 && i + 1 < count;
        if (is_step) {
            x += take_float(b);
            y += take_float(b);
        } else {
            x = take_double(b);
            y = take_double(b);
        }
        b->at = start + (is_step ? step : whole);
        TRY(add_point(b, x, y, start));
    }
    return geometry_close_ring(b->geometry, b->message);
}

static rqt_status read_point(blob *b, const layout *l) {
    size_t start = b->at;
    TRY(need(b, point_bytes(l)));
    double x = take_double(b), y = take_double(b);
    b->at = start + point_bytes(l);
    if (!b->spatialite && isnan(x) && isnan(y)) return RQT_OK; /* empty, in WKB's way */
    TRY(geometry_open_ring(b->geometry, b->message));
    TRY(add_point(b, x, y, start));
    return geometry_close_ring(b->geometry, b->message);
}

static rqt_status read_simple(blob *b, const layout *l) {
    TRY(geometry_open_part(b->geometry, (geometry_type)l->type, b->message));
    if (l->type == GEOMETRY_POINT) {
        TRY(read_point(b, l));
    } else if (l->type == GEOMETRY_LINE) {
        TRY(read_ring(b, l));
    } else {
        size_t rings;
        TRY(take_count(b, 4, &rings));
        for (size_t i = 0; i < rings; i++) TRY(read_ring(b, l));
    }
    return geometry_close_part(b->geometry, b->message);
}

/* ISO's thousands. Takes them off the type. */
static rqt_status take_thousands(const blob *b, layout *l, size_t at) {
    uint32_t thousands = l->type / 1000;
    if (thousands > 3) return fail_at(b, "unknown geometry type", at);
    l->type %= 1000;
    l->z |= (thousands & 1) != 0;
    l->m |= (thousands & 2) != 0;
    return RQT_OK;
}

static rqt_status read_wkb_type(blob *b, layout *l, bool outermost) {
    TRY(need(b, 5));
    size_t start = b->at;
    uint8_t order = b->bytes[b->at++];
    if (order > 1) return fail_at(b, "a byte order is neither 0 nor 1", start);
    b->big = order == 0;
    uint32_t word = take32(b);
    *l = (layout){.type = word & 0x1FFFFFFFu, .z = (word & 0x80000000u) != 0, .m = (word & 0x40000000u) != 0};
    TRY(take_thousands(b, l, start + 1));
    if (!(word & 0x20000000u)) return RQT_OK;
    TRY(need(b, 4));
    int32_t srid = take_srid(b);
    int32_t *known = &b->geometry->srid; /* GeoPackage's header may have named one; that one rules */
    if (outermost && (*known == 0 || *known == -1)) *known = srid;
    if (!outermost && srid != *known) return fail_at(b, "a member has another SRID", start + 5);
    return RQT_OK;
}

static rqt_status read_class_type(blob *b, layout *l, bool outermost) {
    TRY(need(b, outermost ? 4 : 5));
    size_t start = b->at;
    if (!outermost && b->bytes[b->at++] != 0x69) return fail_at(b, "a member does not begin with 0x69", start);
    uint32_t word = take32(b);
    *l = (layout){.type = word, .compressed = word >= 1000000 && word < 1004000};
    if (l->compressed) l->type -= 1000000;
    TRY(take_thousands(b, l, b->at - 4));
    if (l->compressed && l->type != GEOMETRY_LINE && l->type != GEOMETRY_POLYGON)
        return fail_at(b, "only lines and polygons can be compressed, not the type", b->at - 4);
    return RQT_OK;
}

/* One entity with its type; wanted: the only type it may have, or GEOMETRY_ANY. */
static rqt_status read_entity(blob *b, geometry_type wanted, int depth) {
    layout l;
    size_t start = b->at;
    if (b->spatialite)
        TRY(read_class_type(b, &l, depth == 0));
    else
        TRY(read_wkb_type(b, &l, depth == 0));
    if (l.type < GEOMETRY_POINT || l.type > GEOMETRY_COLLECTION) return geometry_refuse_type(l.type, b->message);
    if (wanted != GEOMETRY_ANY && l.type != (uint32_t)wanted)
        return fail_at(b, "a member has another type than its collection", start);
    if (l.type <= GEOMETRY_POLYGON) return read_simple(b, &l);
    if (depth == GEOMETRY_MAX_DEPTH) return fail_at(b, "collections are nested too deep", start);
    size_t members;
    TRY(take_count(b, 9, &members)); /* mark or byte order, type, and at least a count */
    for (size_t i = 0; i < members; i++) TRY(read_entity(b, geometry_member_type(l.type), depth + 1));
    return RQT_OK;
}

/* ----------------------------------------------------------------------------------------- containers -- */
static rqt_status read_wkb(blob *b) {
    TRY(read_entity(b, GEOMETRY_ANY, 0));
    return b->at == b->end ? RQT_OK : fail_at(b, "the geometry has ended, but the bytes go on", b->at);
}

static rqt_status read_geopackage(blob *b) {
    static const uint8_t envelope_bytes[8] = {0, 32, 48, 48, 64, 0, 0, 0};
    TRY(need(b, 8));
    uint8_t version = b->bytes[2], flags = b->bytes[3];
    int kind = flags >> 1 & 7;
    if (version != 0) {
        sentence_begin(b->message, "unknown version of the GeoPackage geometry: ");
        sentence_add_integer(b->message, version);
        return RQT_UNSUPPORTED;
    }
    if (kind > 4) return fail_at(b, "unknown kind of envelope", 3);
    if (flags & 0x20) {
        sentence_begin(b->message, "extended GeoPackage geometries are not supported");
        return RQT_UNSUPPORTED;
    }
    b->at = 4;
    b->big = !(flags & 1);
    b->geometry->srid = take_srid(b);
    TRY(need(b, envelope_bytes[kind]));
    b->at += envelope_bytes[kind];
    TRY(read_wkb(b));
    if ((flags & 0x10) && b->geometry->part_count > 0)
        return fail_at(b, "the geometry is not empty, against the flag", 3);
    return RQT_OK;
}

static rqt_status read_tiny_point(blob *b) {
    TRY(need(b, 7));
    b->big = b->bytes[1] == 0x80;
    b->at = 2;
    b->geometry->srid = take_srid(b);
    uint8_t kind = b->bytes[b->at++];
    if (kind < 1 || kind > 4) return fail_at(b, "unknown kind of TinyPoint", 6);
    layout l = {.type = GEOMETRY_POINT, .z = kind == 2 || kind == 4, .m = kind >= 3};
    TRY(read_simple(b, &l));
    if (b->end - b->at != 1 || b->bytes[b->at] != 0xFE) return fail_at(b, "the end mark 0xFE is missing", b->at);
    return RQT_OK;
}

static rqt_status read_spatialite(blob *b) {
    TRY(need(b, 44));
    if (b->bytes[38] != 0x7C) return fail_at(b, "the mark 0x7C is missing", 38);
    if (b->bytes[b->end - 1] != 0xFE) return fail_at(b, "the end mark 0xFE is missing", b->end - 1);
    b->end--;
    b->big = b->bytes[1] == 0;
    b->at = 2;
    b->geometry->srid = take_srid(b);
    b->at = 39;
    return read_wkb(b);
}

static bool is_tiny_point(const uint8_t *p, size_t n) {
    static const uint8_t size[5] = {0, 24, 32, 32, 40};
    return n >= 24 && p[6] >= 1 && p[6] <= 4 && n == size[p[6]] && p[n - 1] == 0xFE;
}

rqt_status geometry_read_bytes(rqt_geometry *g, const uint8_t *bytes, size_t n, rqt_message *message) {
    blob b = {.bytes = bytes, .end = n, .geometry = g, .message = message};
    if (n < 2) return fail_at(&b, "the geometry is cut off", n);
    if (bytes[0] == 'G' && bytes[1] == 'P') return read_geopackage(&b);
    if (bytes[0] == 0) {
        b.spatialite = true;
        if (bytes[1] == 0x81 || (bytes[1] == 0x80 && is_tiny_point(bytes, n))) return read_tiny_point(&b);
        if (bytes[1] == 0x01) return read_spatialite(&b);
        if (bytes[1] == 0x00 && n >= 44 && bytes[38] == 0x7C && bytes[n - 1] == 0xFE) return read_spatialite(&b);
        b.spatialite = false;
    }
    if (bytes[0] <= 1) return read_wkb(&b);
    return fail_at(&b, "neither a GeoPackage geometry nor a SpatiaLite one: wrong first byte", 0);
}
