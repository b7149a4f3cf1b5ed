/* wire.c - what is around the walk of the wire format: the header, the frames behind it, worst cases, and the
 * digest by which an increment knows the mesh that it begins from. FORMAT.md, "Wire". */
#define ZSTD_STATIC_LINKING_ONLY
#include "wire_walk.h"

#include <zstd.h>
#include <zstd_errors.h>

enum {
    AT_VERSION = 4,
    AT_KIND = 5,
    AT_K = 6,
    AT_FLAGS = 7,
    AT_CHECKSUM = 8,
    AT_VERTEX_COUNT = 16,
    AT_TRIANGLE_COUNT = 24,
    AT_WIDTH = 112,
    AT_HEIGHT = 116,
    AT_PAYLOAD = 120,
    AT_EPS_FROM = 128,
    AT_FROM = 136,

    KIND_MESH = 1,
    KIND_DELTA = 2,
    FLAG_NORMALS = 1 << (WIRE_NORMALS - 1),
    FLAG_ERRORS = 1 << (WIRE_ERRORS - 1),

    ZSTD_LEVEL = 3,       /* of what follows a mesh */
    ZSTD_BLOCK = 1 << 17, /* what the least zstd block, of 4 bytes, can stand for */
    LEAST_ZSTD_BLOCK = 4
};

static rqt_status corrupt(rqt_message *message, const char *sentence) {
    sentence_begin(message, sentence);
    return RQT_CORRUPT;
}

size_t wire_slack(int k) {
    const size_t n = ((size_t)1 << k) + 1;
    return 4 * n * n + 64; /* of the bits after tokens at most 29 a place; of all others at most one byte */
}

void wire_put_header(const rqt_wire_header *h, uint64_t payload, uint8_t *bytes) {
    memset(bytes, 0, RQT_WIRE_HEADER_BYTES);
    memcpy(bytes, "RQTW", 4);
    bytes[AT_VERSION] = RQT_FORMAT_VERSION;
    bytes[AT_KIND] = h->is_delta ? KIND_DELTA : KIND_MESH;
    bytes[AT_K] = (uint8_t)h->k;
    put64(bytes + AT_VERTEX_COUNT, h->vertex_count);
    put64(bytes + AT_TRIANGLE_COUNT, h->triangle_count);
    mesh_frame_put(&(mesh_frame){h->placement, h->unit, h->srid, h->eps}, bytes);
    put32(bytes + AT_WIDTH, (uint32_t)h->lattice.width);
    put32(bytes + AT_HEIGHT, (uint32_t)h->lattice.height);
    put64(bytes + AT_PAYLOAD, payload);
    if (h->is_delta) {
        put_double(bytes + AT_EPS_FROM, h->eps_from);
        put64(bytes + AT_FROM, h->from);
    }
}

uint64_t wire_payload_of(const uint8_t *bytes) {
    return get64(bytes + AT_PAYLOAD);
}

/* ---------------------------------------------------------------------------------------------- frames */

/* The size of the frame at the beginning of room bytes, and for how many it stands; 0 when there is none, or one
 * that claims more than zstd can stand for. */
static size_t frame_size(const uint8_t *frame, size_t room, uint64_t *content) {
    if (room < 4 || get32(frame) != ZSTD_MAGICNUMBER) return 0;
    const size_t size = ZSTD_findFrameCompressedSize(frame, room);
    *content = ZSTD_getFrameContentSize(frame, size);
    if (ZSTD_isError(size) || *content == ZSTD_CONTENTSIZE_UNKNOWN || *content == ZSTD_CONTENTSIZE_ERROR) return 0;
    return *content / ZSTD_BLOCK > size / LEAST_ZSTD_BLOCK ? 0 : size;
}

/* Can a frame of this part stand for so many bytes? */
static bool content_is_possible(const uint8_t *bytes, int part, uint64_t content) {
    const uint64_t count = get64(bytes + AT_VERTEX_COUNT), least = wire_errors_least(count);
    if (part == WIRE_MESH) return content == wire_payload_of(bytes);
    if (part == WIRE_NORMALS) return content == 2 * count;
    return content >= least && content - least <= 2 * count && (content - least) % 2 == 0;
}

bool wire_parts_find(const uint8_t *bytes, size_t size, wire_part parts[WIRE_PARTS]) {
    size_t at = RQT_WIRE_HEADER_BYTES;
    memset(parts, 0, WIRE_PARTS * sizeof *parts);
    for (int i = 0; i < WIRE_PARTS; i++) {
        uint64_t content = 0;
        if (i != WIRE_MESH && !(bytes[AT_FLAGS] >> (i - 1) & 1)) continue;
        const size_t frame = frame_size(bytes + at, size - at, &content);
        if (frame == 0 || !content_is_possible(bytes, i, content)) return false;
        parts[i] = (wire_part){bytes + at, frame, (size_t)content};
        at += frame;
    }
    return at == size;
}

rqt_status wire_part_get(const wire_part *part, const rqt_allocator *allocator, uint8_t *plain) {
    rqt_allocator copy = *allocator;
    const ZSTD_customMem memory = {wire_take, wire_drop, &copy};
    ZSTD_DCtx *z = ZSTD_createDCtx_advanced(memory);
    if (!z) return RQT_NO_MEMORY;
    const size_t got = ZSTD_decompressDCtx(z, plain, part->content, part->frame, part->size);
    const bool no_memory = ZSTD_isError(got) && ZSTD_getErrorCode(got) == ZSTD_error_memory_allocation;
    (void)ZSTD_freeDCtx(z);
    if (no_memory) return RQT_NO_MEMORY;
    return got == part->content ? RQT_OK : RQT_CORRUPT;
}

rqt_status wire_part_add(int part, const uint8_t *plain, size_t content, const rqt_allocator *allocator,
                         uint8_t *bytes, size_t *size) {
    rqt_allocator copy = *allocator;
    const ZSTD_customMem memory = {wire_take, wire_drop, &copy};
    ZSTD_CCtx *z = ZSTD_createCCtx_advanced(memory);
    if (!z) return RQT_NO_MEMORY;
    const size_t frame = ZSTD_compressCCtx(z, bytes + *size, wire_part_bound(content), plain, content, ZSTD_LEVEL);
    (void)ZSTD_freeCCtx(z);
    if (ZSTD_isError(frame)) return RQT_NO_MEMORY;
    *size += frame;
    bytes[AT_FLAGS] = (uint8_t)(bytes[AT_FLAGS] | 1 << (part - 1));
    put64(bytes + AT_CHECKSUM, checksum64(bytes, *size, AT_CHECKSUM));
    return RQT_OK;
}

size_t wire_part_bound(size_t content) {
    return ZSTD_COMPRESSBOUND(content) + 32;
}

/* ---------------------------------------------------------------------------------------------- header */

static void get_header(const uint8_t *bytes, rqt_wire_header *h) {
    const mesh_frame frame = mesh_frame_get(bytes);
    *h = (rqt_wire_header){.is_delta = bytes[AT_KIND] == KIND_DELTA,
                           .has_normals = (bytes[AT_FLAGS] & FLAG_NORMALS) != 0,
                           .has_errors = (bytes[AT_FLAGS] & FLAG_ERRORS) != 0,
                           .k = bytes[AT_K],
                           .vertex_count = get64(bytes + AT_VERTEX_COUNT),
                           .triangle_count = get64(bytes + AT_TRIANGLE_COUNT),
                           .placement = frame.placement,
                           .unit = frame.unit,
                           .eps = frame.eps,
                           .srid = frame.srid,
                           .eps_from = get_double(bytes + AT_EPS_FROM),
                           .from = get64(bytes + AT_FROM)};
}

rqt_status rqt_wire_info(const uint8_t *bytes, size_t size, rqt_wire_header *header, rqt_message *message) {
    memset(header, 0, sizeof *header);
    if (size < RQT_WIRE_HEADER_BYTES) return corrupt(message, "not a mesh in wire format: it is too short");
    if (memcmp(bytes, "RQTW", 4) != 0)
        return corrupt(message, "not a mesh in wire format: it does not begin with RQTW");
    if (bytes[AT_VERSION] != RQT_FORMAT_VERSION) return corrupt(message, "a mesh of unknown format version");
    if (bytes[AT_KIND] != KIND_MESH && bytes[AT_KIND] != KIND_DELTA)
        return corrupt(message, "the mesh is neither whole nor an increment");
    if (bytes[AT_FLAGS] > (FLAG_NORMALS | FLAG_ERRORS) || (bytes[AT_FLAGS] && bytes[AT_KIND] != KIND_MESH))
        return corrupt(message, "the mesh has parts that this version does not know");
    if (get64(bytes + AT_CHECKSUM) != checksum64(bytes, size, AT_CHECKSUM))
        return corrupt(message, "the mesh's checksum is wrong: its bytes have changed");
    rqt_wire_header h;
    get_header(bytes, &h);
    const uint32_t width = get32(bytes + AT_WIDTH), height = get32(bytes + AT_HEIGHT);
    if (rqt_lattice_init(&h.lattice, width, height) != RQT_OK || h.k > h.lattice.K || h.k > RQT_MAX_BLOCK_K)
        return corrupt(message, "the mesh's raster has an impossible size");
    if (!placement_is_valid(&h.placement)) return corrupt(message, "the mesh's placement is not one");
    if (!rqt_unit_is_valid(&h.unit)) return corrupt(message, "the mesh's unit of height is not one");
    if (!(h.eps >= 0) || !(h.eps_from >= 0) || (h.is_delta ? h.eps_from < h.eps : h.eps_from != 0 || h.from != 0))
        return corrupt(message, "the mesh's eps is not one");
    if (h.vertex_count >= WIRE_MOST || h.triangle_count >= WIRE_MOST)
        return corrupt(message, "the mesh has more vertices or triangles than indices reach");
    wire_part parts[WIRE_PARTS];
    if (!wire_parts_find(bytes, size, parts))
        return corrupt(message, "the mesh's compressed bytes are cut off, or not what follows its header");
    *header = h;
    sentence_begin(message, "");
    return RQT_OK;
}

size_t rqt_wire_bound(size_t vertex_count, size_t triangle_count, size_t block_count) {
    /* A height: token and 29 bits. A triangle: on the way down to it at most one symbol a level of its block. What
     * its vertices depend on outside the patch: four vertices a level, a byte and six bits each, but no more than
     * the block has places. A block: its corners and far vertices, and on the way down four symbols a level, if no
     * other shares them. */
    const size_t side = (1 << RQT_MAX_BLOCK_K) + 1, levels = 2 * RQT_MAX_BLOCK_K + 1;
    const size_t by_triangle = 4 * levels * triangle_count, by_block = side * side * block_count;
    const size_t payload = WIRE_DIRECTORY + WIRE_STREAMS + 5 * vertex_count + triangle_count * levels +
                           2 * (by_triangle < by_block ? by_triangle : by_block) +
                           block_count * (4 * RQT_MAX_K + 1 + 6 * 5) + 1;
    return RQT_WIRE_HEADER_BYTES + ZSTD_COMPRESSBOUND(payload) + 4 * WIRE_STREAMS;
}

static inline uint64_t fold(uint64_t h, uint32_t high, uint32_t low) {
    const uint64_t v = (h ^ ((uint64_t)high << 32 | low)) * 0xC2B2AE3D27D4EB4FU;
    return v << 29 | v >> 35;
}

uint64_t rqt_wire_digest(const rqt_patch *patch) {
    uint64_t h = 0x9E3779B97F4A7C15U ^ (uint64_t)patch->vertex_count * 0xFF51AFD7ED558CCDU;
    for (size_t i = 0; i < patch->vertex_count; i++) {
        const rqt_patch_vertex *v = &patch->vertices[i];
        h = fold(h, (uint32_t)v->row, (uint32_t)v->col);
        h = fold(h, v->level, (uint32_t)v->q);
    }
    for (size_t t = 0; patch->leaves && t < patch->triangle_count; t++) {
        const rqt_triangle *leaf = &patch->leaves[t];
        h = fold(h, (uint32_t)leaf->apex.y, (uint32_t)leaf->apex.x);
        h = fold(h, (uint32_t)leaf->left.y, (uint32_t)leaf->left.x);
    }
    h = (h ^ h >> 32) * 0xFF51AFD7ED558CCDU;
    return h ^ h >> 29;
}
