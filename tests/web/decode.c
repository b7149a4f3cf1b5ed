/* decode.c - the C decoder's answers, for the tests of src/web: records from the standard input, answers to the
 * standard output. Numbers are the machine's own.
 *
 * A record: 1 byte what, 4 bytes size, the bytes. What: 'M' a mesh in wire format, 'W' the same without its leaves,
 * 'D' an increment of rqt_delta on the mesh before, 'I' an increment of a view on the mesh before, '0' forgets the
 * mesh before and has no answer, 'Z' a zstd frame.
 *
 * An answer: 4 bytes status (rqt_status), and if it is 0: of a frame 4 bytes size and what it stands for; of a mesh
 * vertex and triangle count (4 bytes each); columns, rows, heights (int32); triangles (uint32); 4 bytes: are there
 * errors, and if so a double a vertex, metres; the same of normals, three floats a vertex. */
#include "rqt.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zstd.h>

enum { MOST_CONTENT = 1 << 28 };

static void *resize(void *context, void *p, size_t bytes) {
    (void)context;
    if (bytes) return realloc(p, bytes);
    free(p);
    return NULL;
}

static const rqt_allocator allocator = {resize, NULL};

static void put(const void *bytes, size_t size) {
    if (size && fwrite(bytes, size, 1, stdout) != 1) exit(2);
}

static void put_number(uint32_t v) {
    put(&v, sizeof v);
}

static void put_mesh(const rqt_patch *mesh) {
    put_number((uint32_t)mesh->vertex_count);
    put_number((uint32_t)mesh->triangle_count);
    for (size_t i = 0; i < mesh->vertex_count; i++) put(&mesh->vertices[i].col, sizeof(int32_t));
    for (size_t i = 0; i < mesh->vertex_count; i++) put(&mesh->vertices[i].row, sizeof(int32_t));
    for (size_t i = 0; i < mesh->vertex_count; i++) put(&mesh->vertices[i].q, sizeof(int32_t));
    put(mesh->triangles, 12 * mesh->triangle_count);
}

static void put_errors(const rqt_patch *mesh, bool has_errors) {
    put_number(has_errors);
    for (size_t i = 0; has_errors && i < mesh->vertex_count; i++) {
        const double metres = rqt_code_metres(mesh->vertices[i].error);
        put(&metres, sizeof metres);
    }
}

/* Of a mesh in wire format that has been decoded; RQT_OK without any, too. */
static rqt_status get_normals(const uint8_t *bytes, size_t size, const rqt_wire_header *header, float **normals) {
    rqt_message why;
    *normals = NULL;
    if (!header->has_normals) return RQT_OK;
    const size_t count = (size_t)header->vertex_count;
    *normals = malloc(12 * count + 1);
    return *normals ? rqt_wire_normals(bytes, size, count, &allocator, *normals, &why) : RQT_NO_MEMORY;
}

/* One record on the mesh before. */
static void answer(int what, const uint8_t *bytes, size_t size, rqt_wire_header *header, rqt_patch *before) {
    rqt_wire_header told = *header;
    rqt_increment_header step;
    rqt_patch mesh = {0};
    rqt_message why;
    float *normals = NULL;
    rqt_status status;
    if (what == 'I')
        status = rqt_increment_apply(before->vertices ? before : NULL, bytes, size, &allocator, &step, &mesh, &why);
    else if (what == 'D')
        status = rqt_wire_apply(header, before, bytes, size, &allocator, &told, &mesh, &why);
    else
        status = rqt_wire_decode(bytes, size, what == 'M', &allocator, &told, &mesh, &why);
    if (status == RQT_OK && what != 'D' && what != 'I') status = get_normals(bytes, size, &told, &normals);
    put_number((uint32_t)status);
    if (status == RQT_OK) {
        put_mesh(&mesh);
        put_errors(&mesh, what != 'D' && what != 'I' && told.has_errors);
        put_number(normals != NULL);
        if (normals) put(normals, 12 * mesh.vertex_count);
        rqt_patch_free(before);
        *before = mesh;
        *header = told;
    } else if (mesh.vertices) {
        rqt_patch_free(&mesh);
    }
    free(normals);
}

static void answer_frame(const uint8_t *bytes, size_t size) {
    const unsigned long long content = ZSTD_getFrameContentSize(bytes, size);
    const bool known = content < MOST_CONTENT && ZSTD_findFrameCompressedSize(bytes, size) == size;
    uint8_t *plain = malloc(known ? content + 1 : 1);
    if (!plain) exit(2);
    const bool good = known && ZSTD_decompress(plain, content, bytes, size) == content;
    put_number(good ? RQT_OK : RQT_CORRUPT);
    if (good) {
        put_number((uint32_t)content);
        put(plain, content);
    }
    free(plain);
}

int main(void) {
    rqt_wire_header header = {0};
    rqt_patch before = {.allocator = allocator};
    for (int what; (what = getchar()) != EOF;) {
        uint32_t size;
        if (fread(&size, sizeof size, 1, stdin) != 1) return 1;
        uint8_t *bytes = malloc(size + 1);
        if (!bytes || (size && fread(bytes, size, 1, stdin) != 1)) return 1;
        if (what == 'Z') {
            answer_frame(bytes, size);
        } else if (what == '0') {
            rqt_patch_free(&before);
            before = (rqt_patch){.allocator = allocator};
        } else {
            answer(what, bytes, size, &header, &before);
        }
        free(bytes);
    }
    rqt_patch_free(&before);
    return 0;
}
