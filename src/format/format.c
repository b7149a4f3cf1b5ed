/* format.c - a patch as bytes: names, coordinates, size and memory, and the formats that keep an index (obj, ply).
 *
 * Every format is written in two passes: what it takes, then the bytes, into one allocation of just that size. So a
 * result that SQLite could not return is refused before any memory is taken, and nothing is ever copied. The text
 * format pays for it by printing its numbers twice; text.c makes that cheap.
 *
 * A patch comes from the core, but its counts and indices are looked at all the same: a wrong one would make us
 * read somebody else's memory, in a process that holds a database. So would coordinates that are not finite make
 * files that others refuse; they arise from nothing but an absurd placement or unit.
 *
 * Compile with -ffp-contract=off: every place that computes a coordinate must get the same bits.
 */
#include "internal.h"

#include <math.h>
#include <stdlib.h>

bool format_from_name(const char *name, format_kind *kind) {
    static const struct {
        const char *name;
        format_kind kind;
    } known[] = {{"obj", FORMAT_OBJ},
                 {"ply", FORMAT_PLY},
                 {"wkb", FORMAT_WKB},
                 {"gpkg", FORMAT_GPKG},
                 {"spatialite", FORMAT_SPATIALITE}};
    for (size_t i = 0; name && i < sizeof known / sizeof *known; i++)
        if (strcmp(name, known[i].name) == 0) {
            *kind = known[i].kind;
            return true;
        }
    return false;
}

void format_coordinates(const format_frame *frame, const rqt_patch_vertex *vertex, double xyz[3]) {
    /* Vertices are set. NOLINTNEXTLINE(clang-analyzer-core.UndefinedBinaryOperatorResult) */
    xyz[0] = frame->placement.x0 + vertex->col * frame->placement.dx;
    xyz[1] = frame->placement.y0 + vertex->row * frame->placement.dy;
    xyz[2] = rqt_unit_metres(&frame->unit, vertex->q);
}

/* ------------------------------------------------------------------------------------------------ extent -- */

/* The smallest and the largest col, row and q. Each coordinate grows or falls with its integer, rounding included:
 * so the two ends tell the box exactly, and whether everything in between is finite. */
typedef struct extent {
    rqt_patch_vertex low, high;
} extent;

static void extent_begin(extent *e, const rqt_patch_vertex *v) {
    e->low = e->high = *v;
}

static void extent_add(extent *e, const rqt_patch_vertex *v) {
    if (v->col < e->low.col) e->low.col = v->col;
    if (v->col > e->high.col) e->high.col = v->col;
    if (v->row < e->low.row) e->low.row = v->row;
    if (v->row > e->high.row) e->high.row = v->row;
    if (v->q < e->low.q) e->low.q = v->q;
    if (v->q > e->high.q) e->high.q = v->q;
}

static bool extent_box(const extent *e, const format_frame *frame, format_box *box) {
    double a[3], b[3];
    format_coordinates(frame, &e->low, a);
    format_coordinates(frame, &e->high, b);
    for (int i = 0; i < 3; i++)
        if (!isfinite(a[i]) || !isfinite(b[i])) return false;
    *box = (format_box){fmin(a[0], b[0]), fmin(a[1], b[1]), fmax(a[0], b[0]), fmax(a[1], b[1])};
    return true;
}

/* Are all indices those of vertices, and all coordinates finite? box: of the triangles' corners. */
static bool patch_is_sound(const rqt_patch *patch, const format_frame *frame, format_box *box) {
    extent e;
    *box = (format_box){0, 0, 0, 0};
    if (patch->vertex_count > 0) {
        extent_begin(&e, &patch->vertices[0]);
        for (size_t i = 1; i < patch->vertex_count; i++) extent_add(&e, &patch->vertices[i]);
        if (!extent_box(&e, frame, box)) return false;
    }
    for (size_t i = 0; i < 3 * patch->triangle_count; i++) {
        if (patch->triangles[i] >= patch->vertex_count) return false;
        const rqt_patch_vertex *corner = &patch->vertices[patch->triangles[i]];
        if (i == 0) extent_begin(&e, corner);
        extent_add(&e, corner);
    }
    return patch->triangle_count == 0 || extent_box(&e, frame, box);
}

/* -------------------------------------------------------------------------------------------------- text -- */

/* Text that is counted, and written too when there are bytes to write to. */
typedef struct sink {
    uint8_t *bytes; /* NULL: count only */
    uint64_t size;
} sink;

static void add_bytes(sink *s, const char *text, size_t n) {
    if (s->bytes) memcpy(s->bytes + s->size, text, n);
    s->size += n;
}
static void add_text(sink *s, const char *text) {
    add_bytes(s, text, strlen(text));
}
static void add_count(sink *s, uint64_t v) {
    char text[20];
    add_bytes(s, text, (size_t)format_digits(v, text));
}
static void add_double(sink *s, double v) {
    char text[32];
    add_bytes(s, text, (size_t)format_double(v, text));
}

/* What the file holds, a line each. A title stays on its line, whatever it contains. */
static void add_comments(sink *s, const format_frame *frame, const char *begin) {
    if (frame->title) {
        add_text(s, begin);
        add_text(s, "terrain ");
        for (const char *c = frame->title; *c; c++) add_bytes(s, (unsigned char)*c < ' ' || *c == 127 ? " " : c, 1);
        add_text(s, "\n");
    }
    add_text(s, begin);
    add_text(s, "eps ");
    add_double(s, frame->eps);
    add_text(s, "\n");
    if (frame->srid) {
        add_text(s, begin);
        add_text(s, frame->srid < 0 ? "srid -" : "srid ");
        add_count(s, (uint64_t)llabs(frame->srid));
        add_text(s, "\n");
    }
}

/* ------------------------------------------------------------------------------------------- obj and ply -- */

/* Stops when it knows that it is too long. */
static void add_obj(sink *s, const rqt_patch *patch, const format_frame *frame) {
    add_comments(s, frame, "# ");
    for (size_t i = 0; i < patch->vertex_count && s->size <= FORMAT_LIMIT; i++) {
        double xyz[3];
        char line[3 * 33 + 2], *p = line;
        format_coordinates(frame, &patch->vertices[i], xyz);
        *p++ = 'v';
        for (int axis = 0; axis < 3; axis++) {
            *p++ = ' ';
            p += format_double(xyz[axis], p);
        }
        *p++ = '\n';
        add_bytes(s, line, (size_t)(p - line));
    }
    for (size_t t = 0; t < patch->triangle_count && s->size <= FORMAT_LIMIT; t++) {
        char line[3 * 21 + 2], *p = line;
        *p++ = 'f';
        for (size_t corner = 0; corner < 3; corner++) {
            *p++ = ' ';
            p += format_digits((uint64_t)patch->triangles[3 * t + corner] + 1, p);
        }
        *p++ = '\n';
        add_bytes(s, line, (size_t)(p - line));
    }
}

enum { PLY_VERTEX = 24, PLY_FACE = 1 + 12 };

static void add_ply_header(sink *s, const rqt_patch *patch, const format_frame *frame) {
    add_text(s, "ply\nformat binary_little_endian 1.0\n");
    add_comments(s, frame, "comment ");
    add_text(s, "element vertex ");
    add_count(s, patch->vertex_count);
    add_text(s, "\nproperty double x\nproperty double y\nproperty double z\nelement face ");
    add_count(s, patch->triangle_count);
    add_text(s, "\nproperty list uchar int vertex_indices\nend_header\n");
}

static void write_ply_body(const rqt_patch *patch, const format_frame *frame, uint8_t *p) {
    for (size_t i = 0; i < patch->vertex_count; i++) {
        double xyz[3];
        format_coordinates(frame, &patch->vertices[i], xyz);
        for (int axis = 0; axis < 3; axis++) p = put_double(p, xyz[axis]);
    }
    for (size_t t = 0; t < patch->triangle_count; t++) {
        p = put_byte(p, 3);
        for (size_t corner = 0; corner < 3; corner++) p = put_u32(p, patch->triangles[3 * t + corner]);
    }
}

/* ------------------------------------------------------------------------------------------------- patch -- */

/* The size of a format but obj, from the counts alone. */
static uint64_t size_from_counts(const rqt_patch *patch, const format_frame *frame, format_kind kind) {
    if (kind != FORMAT_PLY) return geometry_size(kind, patch->triangle_count);
    sink s = {NULL, 0};
    add_ply_header(&s, patch, frame);
    return s.size + PLY_VERTEX * (uint64_t)patch->vertex_count + PLY_FACE * (uint64_t)patch->triangle_count;
}

rqt_status format_patch(const rqt_patch *patch, const format_frame *frame, format_kind kind,
                        const rqt_allocator *allocator, uint8_t **bytes, size_t *size) {
    *bytes = NULL;
    *size = 0;
    /* No format writes a vertex it keeps, or a triangle, in less than 8 bytes. With that the sums below cannot
     * overflow, and arrays that are too long are not looked at. */
    bool keeps_vertices = kind == FORMAT_OBJ || kind == FORMAT_PLY;
    if (patch->triangle_count > FORMAT_LIMIT / 8) return RQT_INVALID;
    if (keeps_vertices && patch->vertex_count > FORMAT_LIMIT / 8) return RQT_INVALID;
    if (kind != FORMAT_OBJ && size_from_counts(patch, frame, kind) > FORMAT_LIMIT) return RQT_INVALID;

    format_box box;
    if (!patch_is_sound(patch, frame, &box)) return RQT_INVALID;

    uint64_t total;
    if (kind == FORMAT_OBJ) {
        sink s = {NULL, 0};
        add_obj(&s, patch, frame);
        if (s.size > FORMAT_LIMIT) return RQT_INVALID;
        total = s.size;
    } else
        total = size_from_counts(patch, frame, kind);

    uint8_t *p = allocator->resize(allocator->context, NULL, (size_t)total);
    if (!p) return RQT_NO_MEMORY;
    *bytes = p;
    *size = (size_t)total;
    sink s = {p, 0};
    if (kind == FORMAT_OBJ)
        add_obj(&s, patch, frame);
    else if (kind == FORMAT_PLY) {
        add_ply_header(&s, patch, frame);
        write_ply_body(patch, frame, p + s.size);
    } else
        geometry_write(kind, patch, frame, &box, p);
    return RQT_OK;
}
