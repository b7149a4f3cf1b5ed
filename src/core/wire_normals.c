/* wire_normals.c - normals beside a mesh in wire format: two bytes a vertex, in a zstd frame of their own behind
 * the mesh. FORMAT.md, "Normals".
 *
 * A normal of terrain never points down, so its hemisphere is unfolded onto a square: the octahedron's upper half,
 * projected along z, is the diamond |x| + |y| <= 1; turned by 45 degrees it fills the square (Cigolle, Donow,
 * Evangelakos, Mara, McGuire, Meyer, "A Survey of Efficient Representations for Independent Unit Vectors", 2014,
 * "hemi-oct"). With steps of 1/127 the worst direction is 0.56 degrees off, and straight up is exact.
 *
 * The mesh itself neither knows nor needs them: encoding appends, and decoding the mesh passes them over.
 */
#include "wire_walk.h"

#include <math.h>

enum { STEPS = 127 };

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
    return wire_part_bound(2 * vertex_count);
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
    rqt_status status = rqt_wire_info(bytes, *size, &header, NULL);
    if (status != RQT_OK) return status;
    if (header.is_delta || header.has_normals || header.has_errors || header.vertex_count != vertex_count)
        return RQT_INVALID;
    uint8_t *planes = memory_take(allocator, 2 * vertex_count + 1);
    if (!planes) return RQT_NO_MEMORY;
    put_planes(normals, vertex_count, planes);
    status = wire_part_add(WIRE_NORMALS, planes, 2 * vertex_count, allocator, bytes, size);
    memory_drop(allocator, planes);
    return status;
}

static rqt_status say(rqt_message *message, rqt_status status, const char *sentence) {
    sentence_begin(message, sentence);
    return status;
}

rqt_status rqt_wire_normals(const uint8_t *bytes, size_t size, size_t vertex_count, const rqt_allocator *allocator,
                            float *normals, rqt_message *message) {
    rqt_wire_header header;
    rqt_status status = rqt_wire_info(bytes, size, &header, message);
    if (status != RQT_OK) return status;
    if (!header.has_normals) return say(message, RQT_INVALID, "the mesh was sent without normals");
    if (header.vertex_count != vertex_count)
        return say(message, RQT_INVALID, "the normals are those of another number of vertices");
    wire_part parts[WIRE_PARTS];
    (void)wire_parts_find(bytes, size, parts); /* they are there: rqt_wire_info has looked */
    uint8_t *planes = memory_take(allocator, 2 * vertex_count + 1);
    status = planes ? wire_part_get(&parts[WIRE_NORMALS], allocator, planes) : RQT_NO_MEMORY;
    if (status == RQT_OK && !get_planes(planes, vertex_count, normals)) status = RQT_CORRUPT;
    memory_drop(allocator, planes);
    if (status == RQT_NO_MEMORY) return say(message, RQT_NO_MEMORY, "out of memory");
    return status == RQT_OK
               ? RQT_OK
               : say(message, RQT_CORRUPT, "the mesh's normals do not decompress to one of each vertex");
}
