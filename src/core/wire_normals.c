/* wire_normals.c - normals beside a mesh in wire format: two bytes a vertex, in a second zstd frame behind the
 * mesh. FORMAT.md, "Normals".
 *
 * A normal of terrain never points down, so its hemisphere is unfolded onto a square: the octahedron's upper half,
 * projected along z, is the diamond |x| + |y| <= 1; turned by 45 degrees it fills the square (Cigolle, Donow,
 * Evangelakos, Mara, McGuire, Meyer, "A Survey of Efficient Representations for Independent Unit Vectors", 2014,
 * "hemi-oct"). With steps of 1/127 the worst direction is 0.56 degrees off, and straight up is exact.
 *
 * The mesh itself neither knows nor needs them: encoding appends, and decoding the mesh passes them over.
 */
#define ZSTD_STATIC_LINKING_ONLY
#include "wire_walk.h"

#include <math.h>
#include <zstd.h>
#include <zstd_errors.h>

enum { ZSTD_LEVEL = 3, STEPS = 127 };

static int8_t step_of(double v) {
    const double within = !(v > -1) ? -1 : v > 1 ? 1 : v; /* no number is -1 */
    return (int8_t)rint(within * STEPS);
}

void rqt_normal_pack(const float normal[3], int8_t packed[2]) {
    const double x = normal[0], y = normal[1], z = normal[2];
    const double sum = fabs(x) + fabs(y) + fabs(z);
    packed[0] = step_of((x + y) / sum);
    packed[1] = step_of((x - y) / sum);
}

void rqt_normal_unpack(const int8_t packed[2], float normal[3]) {
    const double u = packed[0] / (double)STEPS, v = packed[1] / (double)STEPS;
    const double x = (u + v) / 2, y = (u - v) / 2, far = fabs(u) > fabs(v) ? fabs(u) : fabs(v);
    const double z = 1 - far; /* 1 - |x| - |y| */
    const double length = sqrt(x * x + y * y + z * z);
    normal[0] = (float)(x / length);
    normal[1] = (float)(y / length);
    normal[2] = (float)(z / length);
}

size_t rqt_wire_normals_bound(size_t vertex_count) {
    return ZSTD_COMPRESSBOUND(2 * vertex_count) + 32;
}

/* The first bytes of all vertices, then the second ones: each by how far it is from the one before. */
static void put_planes(const float *normals, size_t count, uint8_t *planes) {
    int8_t before[2] = {0, 0};
    for (size_t i = 0; i < count; i++) {
        int8_t packed[2];
        rqt_normal_pack(normals + 3 * i, packed);
        for (size_t plane = 0; plane < 2; plane++) {
            planes[plane * count + i] = (uint8_t)(packed[plane] - before[plane]);
            before[plane] = packed[plane];
        }
    }
}

/* False when a byte is no step. */
static bool get_planes(const uint8_t *planes, size_t count, float *normals) {
    uint8_t at[2] = {0, 0};
    bool good = true;
    for (size_t i = 0; i < count; i++) {
        for (size_t plane = 0; plane < 2; plane++) at[plane] = (uint8_t)(at[plane] + planes[plane * count + i]);
        const int8_t packed[2] = {(int8_t)at[0], (int8_t)at[1]};
        good &= packed[0] >= -STEPS && packed[1] >= -STEPS;
        rqt_normal_unpack(packed, normals + 3 * i);
    }
    return good;
}

rqt_status rqt_wire_add_normals(const float *normals, size_t vertex_count, const rqt_allocator *allocator,
                                uint8_t *bytes, size_t *size) {
    rqt_wire_header header;
    const rqt_status status = rqt_wire_info(bytes, *size, &header, NULL);
    if (status != RQT_OK) return status;
    if (header.is_delta || header.has_normals || header.vertex_count != vertex_count) return RQT_INVALID;
    rqt_allocator copy = *allocator;
    const ZSTD_customMem memory = {wire_take, wire_drop, &copy};
    uint8_t *planes = memory_take(allocator, 2 * vertex_count + 1);
    ZSTD_CCtx *z = planes ? ZSTD_createCCtx_advanced(memory) : NULL;
    size_t frame = 0;
    if (z) {
        put_planes(normals, vertex_count, planes);
        frame = ZSTD_compressCCtx(z, bytes + *size, rqt_wire_normals_bound(vertex_count), planes, 2 * vertex_count,
                                  ZSTD_LEVEL);
    }
    const bool done = z && !ZSTD_isError(frame);
    (void)ZSTD_freeCCtx(z);
    memory_drop(allocator, planes);
    if (!done) return RQT_NO_MEMORY;
    *size += frame;
    wire_mark_normals(bytes, *size);
    return RQT_OK;
}

static rqt_status say(rqt_message *message, rqt_status status, const char *sentence) {
    sentence_begin(message, sentence);
    return status;
}

rqt_status rqt_wire_normals(const uint8_t *bytes, size_t size, size_t vertex_count, const rqt_allocator *allocator,
                            float *normals, rqt_message *message) {
    rqt_wire_header header;
    const rqt_status status = rqt_wire_info(bytes, size, &header, message);
    if (status != RQT_OK) return status;
    if (!header.has_normals) return say(message, RQT_INVALID, "the mesh was sent without normals");
    if (header.vertex_count != vertex_count)
        return say(message, RQT_INVALID, "the normals are those of another number of vertices");
    rqt_allocator copy = *allocator;
    const ZSTD_customMem memory = {wire_take, wire_drop, &copy};
    uint8_t *planes = memory_take(allocator, 2 * vertex_count + 1);
    ZSTD_DCtx *z = planes ? ZSTD_createDCtx_advanced(memory) : NULL;
    size_t got = 0;
    if (z) {
        const size_t at = RQT_WIRE_HEADER_BYTES + wire_mesh_frame(bytes, size);
        got = ZSTD_decompressDCtx(z, planes, 2 * vertex_count, bytes + at, size - at);
    }
    const bool no_memory = !z || (ZSTD_isError(got) && ZSTD_getErrorCode(got) == ZSTD_error_memory_allocation);
    (void)ZSTD_freeDCtx(z);
    const bool good = !no_memory && got == 2 * vertex_count && get_planes(planes, vertex_count, normals);
    memory_drop(allocator, planes);
    if (no_memory) return say(message, RQT_NO_MEMORY, "out of memory");
    return good ? RQT_OK : say(message, RQT_CORRUPT, "the mesh's normals do not decompress to one of each vertex");
}
