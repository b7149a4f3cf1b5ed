/* wire_errors.c - the errors of a mesh's vertices behind it in wire format. FORMAT.md, "Errors".
 *
 * A reader has the mesh. So it knows for most vertices by how much the edge that a vertex halves misses it, and
 * that an error is at least that, and at least as large as those of the vertices that depend on it: it is
 * saturated. The larger of the two is the error in nine cases of ten; sent is which vertices err more, and by how
 * many codes. From fine to coarse, then: a settled vertex hands its code on to its parents.
 *
 * All is said of samples, as the mesh has them. In the last column and row of a raster that ends between lattice
 * lines these may stand for lattice vertices with other neighbours; there a prediction is worse, but still one.
 */
#include "wire_walk.h"

#include <math.h>

typedef struct errors {
    const rqt_patch *patch;
    rqt_lattice lattice;
    double factor, halves; /* metres of n halves of a quantum are n * factor / halves */
    wire_table table;      /* indices of the vertices, by sample */
    uint32_t *order;       /* they, from fine to coarse */
    rqt_code *children;    /* the largest code of those that depend on a vertex, as far as they are settled */
    rqt_code *residual;    /* in that order */
} errors;

static rqt_vertex vertex_of(const errors *e, uint32_t i) {
    return (rqt_vertex){e->patch->vertices[i].col, e->patch->vertices[i].row};
}

static int rank_of(const errors *e, uint32_t i) {
    return rqt_vertex_rank(&e->lattice, vertex_of(e, i));
}

static rqt_code larger(rqt_code a, rqt_code b) {
    return a > b ? a : b;
}

static rqt_code predict(const errors *e, uint32_t i, rqt_code least) {
    rqt_vertex ends[2];
    const rqt_code code = larger(e->children[i], least);
    if (rqt_vertex_ends(&e->lattice, vertex_of(e, i), ends) == 0) return code;
    const wire_entry *a = wire_table_find(&e->table, ends[0]), *b = wire_table_find(&e->table, ends[1]);
    if (!a || !b) return code;
    const int64_t off = 2 * (int64_t)e->patch->vertices[i].q - a->q - b->q;
    return larger(code, code_above((double)(off < 0 ? -off : off) * e->factor / e->halves));
}

static void settle(errors *e, uint32_t i, rqt_code code) {
    rqt_vertex parents[2];
    const int n = rqt_vertex_parents(&e->lattice, vertex_of(e, i), parents);
    for (int p = 0; p < n; p++) {
        const wire_entry *parent = wire_table_find(&e->table, parents[p]);
        if (parent) e->children[parent->index] = larger(e->children[parent->index], code);
    }
}

/* ------------------------------------------------------------------------------------------ the vertices */

static void errors_free(errors *e, const rqt_allocator *allocator) {
    memory_drop(allocator, e->table.entry);
    memory_drop(allocator, e->order);
    memory_drop(allocator, e->children);
    memory_drop(allocator, e->residual);
}

/* False: no memory; what there is, errors_free drops. */
static bool errors_create(errors *e, const rqt_patch *patch, const rqt_wire_header *header,
                          const rqt_allocator *allocator) {
    const size_t count = patch->vertex_count;
    *e = (errors){.patch = patch,
                  .lattice = header->lattice,
                  .factor = fabs(rqt_unit_factor(&header->unit)),
                  .halves = 2 * (double)header->unit.d,
                  .order = memory_take(allocator, (count + 1) * sizeof *e->order),
                  .children = memory_take(allocator, (count + 1) * sizeof *e->children),
                  .residual = memory_take(allocator, (count + 1) * sizeof *e->residual)};
    if (!e->order || !e->children || !e->residual || !wire_table_reserve(allocator, &e->table, count)) return false;
    memset(e->children, 0, count * sizeof *e->children);
    size_t begin[RQT_RANKS + 1] = {0};
    for (uint32_t i = 0; i < count; i++) {
        wire_table_insert(&e->table, vertex_of(e, i), patch->vertices[i].q, i);
        begin[rank_of(e, i) + 1]++;
    }
    for (int rank = 0; rank < RQT_RANKS; rank++) begin[rank + 1] += begin[rank];
    for (uint32_t i = 0; i < count; i++) e->order[begin[rank_of(e, i)]++] = i;
    return true;
}

/* --------------------------------------------------------------------------------------------- the bytes */

/* Bytes written, at most wire_errors_least(count) + 2 * count. */
static size_t put_residuals(const rqt_code *residual, size_t count, rqt_code least, uint8_t *plain) {
    const size_t head = (size_t)wire_errors_least(count);
    size_t told = 0, at = head;
    memset(plain, 0, head);
    put16(plain, least);
    for (size_t i = 0; i < count; i++) {
        if (residual[i] == 0) continue;
        plain[2 + i / 8] = (uint8_t)(plain[2 + i / 8] | 1 << i % 8);
        told++;
    }
    for (size_t i = 0; i < count; i++) {
        if (residual[i] == 0) continue;
        plain[at] = (uint8_t)residual[i];
        plain[told + at++] = (uint8_t)(residual[i] >> 8);
    }
    return head + 2 * told;
}

/* False: the bits and the list do not fit each other, or the vertices. */
static bool get_residuals(const uint8_t *plain, size_t size, size_t count, rqt_code *residual) {
    const size_t head = (size_t)wire_errors_least(count), told = (size - head) / 2;
    size_t at = 0;
    for (size_t i = 0; i < count; i++) {
        residual[i] = 0;
        if (!(plain[2 + i / 8] >> i % 8 & 1)) continue;
        if (at == told) return false;
        residual[i] = (rqt_code)(plain[head + at] | plain[head + told + at] << 8);
        if (residual[i] == 0) return false;
        at++;
    }
    return at == told && (count % 8 == 0 || plain[head - 1] >> count % 8 == 0);
}

size_t rqt_wire_errors_bound(size_t vertex_count) {
    return wire_part_bound((size_t)wire_errors_least(vertex_count) + 2 * vertex_count);
}

rqt_status rqt_wire_add_errors(const rqt_patch *patch, const rqt_allocator *allocator, uint8_t *bytes,
                               size_t *size) {
    const size_t count = patch->vertex_count;
    rqt_wire_header header;
    rqt_status status = rqt_wire_info(bytes, *size, &header, NULL);
    if (status != RQT_OK) return status;
    if (header.is_delta || header.has_errors || header.vertex_count != count) return RQT_INVALID;
    errors e;
    const bool created = errors_create(&e, patch, &header, allocator);
    uint8_t *plain = created ? memory_take(allocator, (size_t)wire_errors_least(count) + 2 * count) : NULL;
    if (plain) {
        rqt_code least = count > 0 ? RQT_CODE_INFINITY : 0;
        for (size_t i = 0; i < count; i++)
            if (patch->vertices[i].error < least) least = patch->vertices[i].error;
        for (size_t n = 0; n < count; n++) {
            const rqt_code code = patch->vertices[e.order[n]].error;
            e.residual[n] = (rqt_code)(code - predict(&e, e.order[n], least));
            settle(&e, e.order[n], code);
        }
        status = wire_part_add(WIRE_ERRORS, plain, put_residuals(e.residual, count, least, plain), allocator, bytes,
                               size);
    } else {
        status = RQT_NO_MEMORY;
    }
    memory_drop(allocator, plain);
    errors_free(&e, allocator);
    return status;
}

rqt_status wire_errors_read(const wire_part *part, const rqt_wire_header *header, const rqt_allocator *allocator,
                            rqt_patch *patch) {
    const size_t count = patch->vertex_count;
    errors e;
    const bool created = errors_create(&e, patch, header, allocator);
    uint8_t *plain = created ? memory_take(allocator, part->content) : NULL;
    rqt_status status = plain ? wire_part_get(part, allocator, plain) : RQT_NO_MEMORY;
    if (status == RQT_OK && !get_residuals(plain, part->content, count, e.residual)) status = RQT_CORRUPT;
    for (size_t n = 0; n < count && status == RQT_OK; n++) {
        const rqt_code code = (rqt_code)(predict(&e, e.order[n], get16(plain)) + e.residual[n]);
        patch->vertices[e.order[n]].error = code;
        settle(&e, e.order[n], code);
    }
    memory_drop(allocator, plain);
    errors_free(&e, allocator);
    return status;
}
