/* format.c - a mesh as bytes: names, coordinates, size and memory, and the formats that keep an index (obj, ply).
 *
 * Every format is written in two passes: what it takes, then the bytes, into one allocation of just that size. So a
 * result that SQLite could not return is refused before any memory is taken, and nothing is ever copied. The text
 * format pays for it by printing its numbers twice; text.c makes that cheap.
 *
 * A mesh comes from our own rooms, but its counts and indices are looked at all the same: a wrong one would make us
 * read somebody else's memory, in a process that holds a database. Coordinates that are not finite would make files
 * that others refuse; they arise from nothing but an absurd placement or unit, and are found as they are written.
 *
 * Compile with -ffp-contract=off: every place that computes a coordinate must get the same bits.
 */
#include "internal.h"

#include <math.h>

bool format_from_name(const char *name, format_kind *kind) {
    static const struct {
        const char *name;
        format_kind kind;
    } known[] = {{"obj", FORMAT_OBJ},
                 {"ply", FORMAT_PLY},
                 {"wkb", FORMAT_WKB},
                 {"gpkg", FORMAT_GPKG},
                 {"spatialite", FORMAT_SPATIALITE},
                 {"glb", FORMAT_GLB}};
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

bool mesh_coordinates(const format_mesh *mesh, size_t vertex, double xyz[3]) {
    mesh->coordinates(mesh->context, vertex, xyz);
    return isfinite(xyz[0]) && isfinite(xyz[1]) && isfinite(xyz[2]);
}

/* -------------------------------------------------------------------------------------------------- text -- */

/* What the file holds, a line each. A title stays on its line, whatever it contains. */
static void add_comments(sink *s, const format_mesh *mesh, const char *begin) {
    if (mesh->title) {
        add_text(s, begin);
        add_text(s, "terrain ");
        for (const char *c = mesh->title; *c; c++) add_bytes(s, (unsigned char)*c < ' ' || *c == 127 ? " " : c, 1);
        add_text(s, "\n");
    }
    add_text(s, begin);
    add_text(s, "eps ");
    add_double(s, mesh->eps);
    add_text(s, "\n");
    if (mesh->srid) {
        add_text(s, begin);
        add_text(s, "srid ");
        add_integer(s, mesh->srid);
        add_text(s, "\n");
    }
}

/* ------------------------------------------------------------------------------------------- obj and ply -- */

/* Stops when it knows that it is too long. False when a coordinate is not finite. */
static bool add_obj(sink *s, const format_mesh *mesh) {
    add_comments(s, mesh, "# ");
    for (size_t i = 0; i < mesh->vertex_count && s->size <= FORMAT_LIMIT; i++) {
        double xyz[3];
        char line[3 * 33 + 2], *p = line;
        if (!mesh_coordinates(mesh, i, xyz)) return false;
        *p++ = 'v';
        for (int axis = 0; axis < 3; axis++) {
            *p++ = ' ';
            p += format_double(xyz[axis], p);
        }
        *p++ = '\n';
        add_bytes(s, line, (size_t)(p - line));
    }
    for (size_t t = 0; t < mesh->triangle_count && s->size <= FORMAT_LIMIT; t++) {
        char line[3 * 21 + 2], *p = line;
        *p++ = 'f';
        for (size_t corner = 0; corner < 3; corner++) {
            *p++ = ' ';
            p += format_digits((uint64_t)mesh->triangles[3 * t + corner] + 1, p);
        }
        *p++ = '\n';
        add_bytes(s, line, (size_t)(p - line));
    }
    return true;
}

enum { PLY_VERTEX = 24, PLY_NORMAL = 12, PLY_FACE = 1 + 12 };

static void add_ply_header(sink *s, const format_mesh *mesh) {
    add_text(s, "ply\nformat binary_little_endian 1.0\n");
    add_comments(s, mesh, "comment ");
    if (mesh->srid > 0) { /* as QGIS (MDAL) reads it */
        add_text(s, "comment crs: EPSG:");
        add_count(s, (uint64_t)mesh->srid);
        add_text(s, "\n");
    }
    add_text(s, "element vertex ");
    add_count(s, mesh->vertex_count);
    add_text(s, "\nproperty double x\nproperty double y\nproperty double z\n");
    if (mesh->normals) add_text(s, "property float nx\nproperty float ny\nproperty float nz\n");
    add_text(s, "element face ");
    add_count(s, mesh->triangle_count);
    add_text(s, "\nproperty list uchar int vertex_indices\nend_header\n");
}

static bool write_ply_body(const format_mesh *mesh, uint8_t *p) {
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        double xyz[3];
        if (!mesh_coordinates(mesh, i, xyz)) return false;
        for (int axis = 0; axis < 3; axis++) p = put_double(p, xyz[axis]);
        for (size_t axis = 0; mesh->normals && axis < 3; axis++) p = put_float(p, mesh->normals[3 * i + axis]);
    }
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        p = put_byte(p, 3);
        for (size_t corner = 0; corner < 3; corner++) p = put_u32(p, mesh->triangles[3 * t + corner]);
    }
    return true;
}

/* ------------------------------------------------------------------------------------------------- whole -- */

/* The size of a format but obj, from the counts alone; of a glb not quite all of it. */
static uint64_t size_from_counts(const format_mesh *mesh, format_kind kind) {
    if (kind == FORMAT_GLB) return glb_size_from_counts(mesh);
    if (kind != FORMAT_PLY) return geometry_size(kind, mesh->triangle_count);
    sink s = {NULL, 0};
    add_ply_header(&s, mesh);
    const uint64_t vertex = mesh->normals ? PLY_VERTEX + PLY_NORMAL : PLY_VERTEX;
    return s.size + vertex * (uint64_t)mesh->vertex_count + PLY_FACE * (uint64_t)mesh->triangle_count;
}

static bool indices_are_sound(const format_mesh *mesh) {
    for (size_t i = 0; i < 3 * mesh->triangle_count; i++)
        if (mesh->triangles[i] >= mesh->vertex_count) return false;
    return true;
}

static bool write_whole(const format_mesh *mesh, format_kind kind, const glb_layout *layout, uint8_t *bytes) {
    sink s = {bytes, 0};
    if (kind == FORMAT_GLB) {
        glb_write(mesh, layout, bytes);
        return true;
    }
    if (kind == FORMAT_OBJ) return add_obj(&s, mesh);
    if (kind != FORMAT_PLY) return geometry_write(kind, mesh, bytes);
    add_ply_header(&s, mesh);
    return write_ply_body(mesh, bytes + s.size);
}

rqt_status format_write(const format_mesh *mesh, format_kind kind, const rqt_allocator *allocator, uint8_t **bytes,
                        size_t *size) {
    *bytes = NULL;
    *size = 0;
    /* No format writes a vertex it keeps, or a triangle, in less than 8 bytes, but a glb the triangles of less than
     * 65536 vertices, of which there are not so many. With that the sums below cannot
     * overflow, and arrays that are too long are not looked at. */
    bool keeps_vertices = kind == FORMAT_OBJ || kind == FORMAT_PLY || kind == FORMAT_GLB;
    glb_layout layout;
    if (kind == FORMAT_GLB && !mesh->model) return RQT_INVALID;
    if (mesh->triangle_count > FORMAT_LIMIT / 8) return RQT_INVALID;
    if (keeps_vertices && mesh->vertex_count > FORMAT_LIMIT / 8) return RQT_INVALID;
    if (kind != FORMAT_OBJ && size_from_counts(mesh, kind) > FORMAT_LIMIT) return RQT_INVALID;
    if (!indices_are_sound(mesh)) return RQT_INVALID;

    uint64_t total;
    if (kind == FORMAT_OBJ) {
        sink s = {NULL, 0};
        if (!add_obj(&s, mesh) || s.size > FORMAT_LIMIT) return RQT_INVALID;
        total = s.size;
    } else if (kind == FORMAT_GLB) {
        if (!glb_plan(mesh, &layout) || layout.total > FORMAT_LIMIT) return RQT_INVALID;
        total = layout.total;
    } else
        total = size_from_counts(mesh, kind);

    uint8_t *p = allocator->resize(allocator->context, NULL, (size_t)total);
    if (!p) return RQT_NO_MEMORY;
    if (!write_whole(mesh, kind, &layout, p)) {
        (void)allocator->resize(allocator->context, p, 0);
        return RQT_INVALID;
    }
    *bytes = p;
    *size = (size_t)total;
    return RQT_OK;
}

/* ------------------------------------------------------------------------------------------------- patch -- */

static void patch_coordinates(const void *context, size_t vertex, double xyz[3]) {
    const format_source *source = context;
    format_coordinates(source->frame, &source->patch->vertices[vertex], xyz);
}

format_mesh format_mesh_of(const format_source *source) {
    const rqt_patch *patch = source->patch;
    const format_frame *frame = source->frame;
    return (format_mesh){.vertex_count = patch->vertex_count,
                         .triangle_count = patch->triangle_count,
                         .triangles = patch->triangles,
                         .coordinates = patch_coordinates,
                         .context = source,
                         .srid = frame->srid,
                         .title = frame->title,
                         .eps = frame->eps,
                         .normals = frame->normals};
}

rqt_status format_patch(const rqt_patch *patch, const format_frame *frame, format_kind kind,
                        const rqt_allocator *allocator, uint8_t **bytes, size_t *size) {
    const format_source source = {patch, frame};
    const format_mesh mesh = format_mesh_of(&source);
    return format_write(&mesh, kind, allocator, bytes, size);
}
