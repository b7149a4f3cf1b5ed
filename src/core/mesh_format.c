/* mesh_format.c - the formats 'strip' and 'indexed': a mesh with its placement and unit, in bytes that stand alone.
 *
 * The decoder checks everything before it lets go of a pointer, so that a reader may use each index and coordinate
 * without another look. It copies nothing: vertices and indices stay where they are. */
#include "internal.h"

#include <math.h>

enum {
    AT_VERSION = 4,
    AT_KIND = 5,
    AT_ZERO_1 = 6,
    AT_CHECKSUM = 8,
    AT_VERTEX_COUNT = 16,
    AT_INDEX_COUNT = 24,
    AT_PLACEMENT = 32,
    AT_Z0 = 64,
    AT_D = 72,
    AT_NUMERATOR = 76,
    AT_DENOMINATOR = 80,
    AT_SRID = 84,
    AT_SCALE = 88,
    AT_OFFSET = 96,
    AT_EPS = 104,
    AT_ZERO_2 = 112,
    VERTEX_BYTES = 12,
    INDEX_BYTES = 4,
    LAST_SAMPLE = 1 << RQT_MAX_K
};

size_t rqt_mesh_bytes(const rqt_mesh_header *header) {
    const uint64_t room = SIZE_MAX - RQT_MESH_HEADER_BYTES;
    if (header->vertex_count > room / VERTEX_BYTES) return SIZE_MAX;
    uint64_t left = room - header->vertex_count * VERTEX_BYTES;
    if (header->index_count > left / INDEX_BYTES) return SIZE_MAX;
    return (size_t)(RQT_MESH_HEADER_BYTES + header->vertex_count * VERTEX_BYTES +
                    header->index_count * INDEX_BYTES);
}

/* Where the formats of meshes, 'rqt' too, keep what makes places and metres of their integers. */
void mesh_frame_put(const mesh_frame *f, uint8_t *bytes) {
    put_double(bytes + AT_PLACEMENT, f->placement.x0);
    put_double(bytes + AT_PLACEMENT + 8, f->placement.y0);
    put_double(bytes + AT_PLACEMENT + 16, f->placement.dx);
    put_double(bytes + AT_PLACEMENT + 24, f->placement.dy);
    put64(bytes + AT_Z0, (uint64_t)f->unit.z0);
    put32(bytes + AT_D, (uint32_t)f->unit.d);
    put32(bytes + AT_NUMERATOR, (uint32_t)f->unit.numerator);
    put32(bytes + AT_DENOMINATOR, (uint32_t)f->unit.denominator);
    put32(bytes + AT_SRID, (uint32_t)f->srid);
    put_double(bytes + AT_SCALE, f->unit.scale);
    put_double(bytes + AT_OFFSET, f->unit.offset);
    put_double(bytes + AT_EPS, f->eps);
}

mesh_frame mesh_frame_get(const uint8_t *bytes) {
    return (mesh_frame){.placement = {get_double(bytes + AT_PLACEMENT), get_double(bytes + AT_PLACEMENT + 8),
                                      get_double(bytes + AT_PLACEMENT + 16), get_double(bytes + AT_PLACEMENT + 24)},
                        .unit = {.z0 = (int64_t)get64(bytes + AT_Z0),
                                 .d = (int32_t)get32(bytes + AT_D),
                                 .numerator = (int32_t)get32(bytes + AT_NUMERATOR),
                                 .denominator = (int32_t)get32(bytes + AT_DENOMINATOR),
                                 .scale = get_double(bytes + AT_SCALE),
                                 .offset = get_double(bytes + AT_OFFSET)},
                        .srid = (int32_t)get32(bytes + AT_SRID),
                        .eps = get_double(bytes + AT_EPS)};
}

bool placement_is_valid(const rqt_placement *p) {
    return isfinite(p->x0) && isfinite(p->y0) && isfinite(p->dx) && isfinite(p->dy) && p->dx != 0 && p->dy != 0;
}

void rqt_mesh_encode(const rqt_mesh_header *header, const rqt_patch_vertex *vertices, const uint32_t *indices,
                     uint8_t *bytes) {
    memset(bytes, 0, RQT_MESH_HEADER_BYTES);
    memcpy(bytes, "RQTM", 4);
    bytes[AT_VERSION] = RQT_FORMAT_VERSION;
    bytes[AT_KIND] = (uint8_t)header->kind;
    put64(bytes + AT_VERTEX_COUNT, header->vertex_count);
    put64(bytes + AT_INDEX_COUNT, header->index_count);
    mesh_frame_put(&(mesh_frame){header->placement, header->unit, header->srid, header->eps}, bytes);
    uint8_t *p = bytes + RQT_MESH_HEADER_BYTES;
    for (uint64_t i = 0; i < header->vertex_count; i++, p += VERTEX_BYTES) {
        put32(p, (uint32_t)vertices[i].col);
        put32(p + 4, (uint32_t)vertices[i].row);
        put32(p + 8, (uint32_t)vertices[i].q);
    }
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    if (header->index_count) memcpy(p, indices, header->index_count * INDEX_BYTES);
    p += header->index_count * INDEX_BYTES;
#else
    for (uint64_t i = 0; i < header->index_count; i++, p += INDEX_BYTES) put32(p, indices[i]);
#endif
    put64(bytes + AT_CHECKSUM, checksum64(bytes, (size_t)(p - bytes), AT_CHECKSUM));
}

static void get_header(const uint8_t *bytes, rqt_mesh_header *h) {
    h->kind = (rqt_mesh_kind)bytes[AT_KIND];
    h->vertex_count = get64(bytes + AT_VERTEX_COUNT);
    h->index_count = get64(bytes + AT_INDEX_COUNT);
    const mesh_frame frame = mesh_frame_get(bytes);
    h->placement = frame.placement;
    h->unit = frame.unit;
    h->srid = frame.srid;
    h->eps = frame.eps;
}

static bool header_is_sound(const rqt_mesh_header *h) {
    if (!placement_is_valid(&h->placement)) return false;
    if (!rqt_unit_is_valid(&h->unit) || !(h->eps >= 0)) return false; /* eps: infinity is sound, NaN is not */
    if (h->kind == RQT_MESH_STRIP) return h->index_count == 0 || h->index_count >= 3;
    return h->kind == RQT_MESH_INDEXED && h->index_count % 3 == 0;
}

static bool vertices_are_sound(const uint8_t *p, uint64_t count) {
    for (; count; count--, p += VERTEX_BYTES) {
        int32_t q = (int32_t)get32(p + 8);
        if (get32(p) > LAST_SAMPLE || get32(p + 4) > LAST_SAMPLE) return false;
        if (q <= -RQT_HEIGHT_LIMIT || q >= RQT_HEIGHT_LIMIT) return false;
    }
    return true;
}

static bool indices_are_sound(const uint8_t *p, uint64_t count, uint64_t vertices) {
    for (; count; count--, p += INDEX_BYTES)
        if (get32(p) >= vertices) return false;
    return true;
}

rqt_status rqt_mesh_decode(const uint8_t *bytes, size_t size, rqt_mesh_header *header, const uint8_t **vertices,
                           const uint8_t **indices) {
    memset(header, 0, sizeof *header);
    *vertices = *indices = NULL;
    if (size < RQT_MESH_HEADER_BYTES || memcmp(bytes, "RQTM", 4) != 0 || bytes[AT_VERSION] != RQT_FORMAT_VERSION ||
        get16(bytes + AT_ZERO_1) != 0 || get64(bytes + AT_ZERO_2) != 0 || get64(bytes + AT_ZERO_2 + 8) != 0)
        return RQT_CORRUPT;
    rqt_mesh_header h;
    get_header(bytes, &h);
    /* The counts first: they say where everything is. A size that does not fit is SIZE_MAX, which no buffer has. */
    if (rqt_mesh_bytes(&h) != size || !header_is_sound(&h)) return RQT_CORRUPT;
    if (get64(bytes + AT_CHECKSUM) != checksum64(bytes, size, AT_CHECKSUM)) return RQT_CORRUPT;
    const uint8_t *v = bytes + RQT_MESH_HEADER_BYTES, *i = v + h.vertex_count * VERTEX_BYTES;
    if (!vertices_are_sound(v, h.vertex_count) || !indices_are_sound(i, h.index_count, h.vertex_count))
        return RQT_CORRUPT;
    *header = h;
    *vertices = v;
    *indices = i;
    return RQT_OK;
}
