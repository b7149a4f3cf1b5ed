/* glb.c - a mesh as glTF 2.0, binary: a model in metres about an origin. FORMAT.md, "glb", has what its extras say.
 *
 *   'glTF', u32 2, u32 size;  u32 size, 'JSON', text, blanks to 4 bytes;  u32 size, 'BIN', the buffer, zeros to 4
 * bytes buffer: POSITION of all vertices, NORMAL of all where there are normals, the indices of the triangles
 *
 * Axes. glTF's Y is up: X is x, Y is z, Z is -y. That is a rotation: triangles keep the side that they show.
 *
 * Where it is. Floats have 24 bits, so a place in a country's coordinates would be known to a quarter of a metre.
 * The vertices are therefore about an origin amid the mesh, which is told in extras, in double, and not by the
 * node: a translation of millions of metres is done in float by most viewers, and would bring back what leaving it
 * out has avoided. Where coordinates are whole steps apart the origin is one of them: then differences of whole
 * metres stay exact. What is left is measured, vertex by vertex, and told as well.
 *
 * Quantized (KHR_mesh_quantization): positions are three u16, from the mesh's least corner on, with the node's
 * translation and scale to metres. Along an axis of whole steps, at most 65535 of them, the unit is the step, and
 * the numbers are columns, rows and heights as they are stored, but for their beginning; else it is the extent's
 * 65535th part. A scale that is not the same along the axes acts on normals by its inverse (so glTF has it), which
 * the normals kept here undo. That costs precision as the steps differ: i16 is off by up to 0.87 / 32767 times the
 * ratio of the largest step to the smallest, in radians; so they are i16 while that ratio is 256 at most (0.4
 * degrees), and else float.
 *
 * An empty mesh is a scene without nodes: glTF knows no empty accessor.
 */
#include "internal.h"

#include <float.h>
#include <math.h>

enum { HEAD = 12, CHUNK = 8, MOST_STEPS = 65535, MOST_SHORT_INDEX = 65535 };
enum { UNSIGNED_SHORT = 5123, SHORT = 5122, UNSIGNED_INT = 5125, FLOAT = 5126, ARRAY = 34962, ELEMENTS = 34963 };
#define LARGEST_RATIO 256

static bool is_empty(const format_mesh *mesh) {
    return mesh->triangle_count == 0;
}

static uint64_t padded(uint64_t size) {
    return (size + 3) / 4 * 4;
}

/* 65535 itself is kept free: it means restart in some libraries of graphics. */
static uint64_t index_bytes(const format_mesh *mesh) {
    return mesh->vertex_count <= MOST_SHORT_INDEX ? 2 : 4;
}

/* ---------------------------------------------------------------------------------------------------- plan -- */

/* The float nearest to it. By way of memory: gcc 12 at -O3 takes (double)(float)v of neighbours in an array, behind
 * a condition, for v itself (its vectoriser of straight-line code, x86-64). */
static double nearest_float(double v) {
    const volatile float f = (float)v;
    return f;
}

/* The model's coordinates of a place. */
static void to_model(const format_mesh *mesh, const double origin[3], const double xyz[3], double model[3]) {
    model[0] = (xyz[0] - origin[0]) * mesh->model->metre;
    model[1] = xyz[2] - origin[2];
    model[2] = (origin[1] - xyz[1]) * mesh->model->metre;
}

/* The middle, on the lattice if there is one. */
static double choose_origin(double low, double high, double step) {
    return step > 0 ? low + floor(rint((high - low) / step) / 2) * step : low / 2 + high / 2;
}

static double choose_step(double extent, double lattice) {
    if (lattice > 0 && rint(extent / lattice) <= MOST_STEPS) return lattice;
    return extent > 0 ? extent / MOST_STEPS : 1;
}

/* Origin, box, steps. */
static bool plan_space(const format_mesh *mesh, glb_layout *l) {
    const format_model *m = mesh->model;
    double low[3] = {0, 0, 0}, high[3] = {0, 0, 0}, xyz[3];
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        if (!mesh_coordinates(mesh, i, xyz)) return false;
        for (int axis = 0; axis < 3; axis++) {
            if (i == 0 || xyz[axis] < low[axis]) low[axis] = xyz[axis];
            if (i == 0 || xyz[axis] > high[axis]) high[axis] = xyz[axis];
        }
    }
    for (int axis = 0; axis < 3; axis++)
        l->origin[axis] = m->is_about_place ? 0 : choose_origin(low[axis], high[axis], m->step[axis]);
    const double north_west[3] = {low[0], high[1], low[2]}, south_east[3] = {high[0], low[1], high[2]};
    to_model(mesh, l->origin, north_west, l->low);
    to_model(mesh, l->origin, south_east, l->high);
    const double lattice[3] = {m->step[0] * m->metre, m->step[2], m->step[1] * m->metre};
    double least = DBL_MAX, largest = 0;
    for (int axis = 0; axis < 3; axis++) {
        if (!(fabs(l->low[axis]) <= FLT_MAX && fabs(l->high[axis]) <= FLT_MAX)) return false;
        l->step[axis] = choose_step(l->high[axis] - l->low[axis], lattice[axis]);
        least = fmin(least, l->step[axis]);
        largest = fmax(largest, l->step[axis]);
    }
    l->normals_are_short = m->quantized && largest <= LARGEST_RATIO * least;
    return true;
}

static unsigned unit_of(const glb_layout *l, int axis, double metres) {
    return (unsigned)fmin(MOST_STEPS, fmax(0, rint((metres - l->low[axis]) / l->step[axis])));
}

static void plan_deviation(const format_mesh *mesh, glb_layout *l) {
    double xyz[3], at[3];
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        (void)mesh_coordinates(mesh, i, xyz);
        to_model(mesh, l->origin, xyz, at);
        for (int axis = 0; axis < 3; axis++) {
            const double kept = mesh->model->quantized ? l->low[axis] + unit_of(l, axis, at[axis]) * l->step[axis]
                                                       : nearest_float(at[axis]);
            l->deviation[axis] = fmax(l->deviation[axis], fabs(kept - at[axis]));
        }
    }
}

/* Bytes of the buffer's parts. */
static void plan_buffer(const format_mesh *mesh, bool normals_are_short, glb_layout *l) {
    l->positions = (uint64_t)mesh->vertex_count * (mesh->model->quantized ? 8 : 12);
    l->normals = mesh->normals ? (uint64_t)mesh->vertex_count * (normals_are_short ? 8 : 12) : 0;
    l->indices = 3 * (uint64_t)mesh->triangle_count * index_bytes(mesh);
}

uint64_t glb_size_from_counts(const format_mesh *mesh) {
    glb_layout l;
    if (is_empty(mesh)) return HEAD + CHUNK;
    plan_buffer(mesh, true, &l);
    return HEAD + 2 * CHUNK + l.positions + l.normals + l.indices;
}

/* ---------------------------------------------------------------------------------------------------- JSON -- */

static void add_numbers(sink *s, const char *name, const double *values, int n) {
    add_text(s, name);
    for (int i = 0; i < n; i++) {
        add_text(s, i ? "," : "[");
        add_double(s, values[i]);
    }
    add_text(s, "]");
}

static void add_member(sink *s, const char *name, double value) {
    add_text(s, name);
    if (isfinite(value))
        add_double(s, value);
    else
        add_text(s, "null");
}

/* In quotes. */
static void add_string(sink *s, const char *text) {
    static const char hex[] = "0123456789abcdef";
    add_text(s, "\"");
    for (const char *c = text; *c; c++) {
        const unsigned char byte = (unsigned char)*c;
        if (byte < ' ') {
            const char escape[] = {'\\', 'u', '0', '0', hex[byte >> 4], hex[byte & 15]};
            add_bytes(s, escape, sizeof escape);
        } else {
            if (byte == '"' || byte == '\\') add_text(s, "\\");
            add_bytes(s, c, 1);
        }
    }
    add_text(s, "\"");
}

static void add_extras(sink *s, const format_mesh *mesh, const glb_layout *l) {
    const format_model *m = mesh->model;
    add_text(s, ",\"extras\":{\"rqt\":{\"frame\":");
    add_string(s, m->frame);
    if (mesh->title) {
        add_text(s, ",\"terrain\":");
        add_string(s, mesh->title);
    }
    if (mesh->srid) {
        add_text(s, ",\"srid\":");
        add_integer(s, mesh->srid);
    }
    if (m->place) add_numbers(s, ",\"place\":", m->place, 3);
    if (!is_empty(mesh)) {
        const double deviation[3] = {l->deviation[0], l->deviation[2], l->deviation[1]};
        add_numbers(s, ",\"origin\":", l->origin, 3);
        add_member(s, ",\"metre\":", m->metre);
        add_numbers(s, ",\"deviation\":", deviation, 3);
    }
    add_member(s, ",\"eps\":", mesh->eps);
    add_member(s, ",\"quantum\":", m->quantum);
    if (m->tau > 0) {
        add_member(s, ",\"tau\":", m->tau);
        add_text(s, m->tau_is_guaranteed ? ",\"guaranteed\":true" : ",\"guaranteed\":false");
    }
    add_text(s, "}}");
}

static void add_view(sink *s, uint64_t at, uint64_t size, unsigned stride, unsigned target) {
    add_text(s, at ? ",{\"buffer\":0,\"byteOffset\":" : "{\"buffer\":0,\"byteOffset\":");
    add_count(s, at);
    add_text(s, ",\"byteLength\":");
    add_count(s, size);
    if (stride) {
        add_text(s, ",\"byteStride\":");
        add_count(s, stride);
    }
    add_text(s, ",\"target\":");
    add_count(s, target);
    add_text(s, "}");
}

static void add_accessor(sink *s, unsigned view, unsigned component, uint64_t count, const char *type) {
    add_text(s, view ? ",{\"bufferView\":" : "{\"bufferView\":");
    add_count(s, view);
    add_text(s, ",\"componentType\":");
    add_count(s, component);
    add_text(s, ",\"count\":");
    add_count(s, count);
    add_text(s, ",\"type\":");
    add_string(s, type);
}

static void add_node(sink *s, const format_mesh *mesh, const glb_layout *l) {
    add_text(s, ",\"nodes\":[{\"mesh\":0");
    if (mesh->title) {
        add_text(s, ",\"name\":");
        add_string(s, mesh->title);
    }
    if (mesh->model->quantized) {
        add_numbers(s, ",\"translation\":", l->low, 3);
        add_numbers(s, ",\"scale\":", l->step, 3);
    }
    add_extras(s, mesh, l);
    add_text(s, "}]");
}

static void add_accessors(sink *s, const format_mesh *mesh, const glb_layout *l) {
    const bool quantized = mesh->model->quantized;
    double low[3], high[3];
    for (int axis = 0; axis < 3; axis++) {
        low[axis] = quantized ? 0 : nearest_float(l->low[axis]);
        high[axis] = quantized ? unit_of(l, axis, l->high[axis]) : nearest_float(l->high[axis]);
    }
    add_text(s, ",\"accessors\":[");
    add_accessor(s, 0, quantized ? UNSIGNED_SHORT : FLOAT, mesh->vertex_count, "VEC3");
    add_numbers(s, ",\"min\":", low, 3);
    add_numbers(s, ",\"max\":", high, 3);
    add_text(s, "}");
    if (mesh->normals) {
        add_accessor(s, 1, l->normals_are_short ? SHORT : FLOAT, mesh->vertex_count, "VEC3");
        add_text(s, l->normals_are_short ? ",\"normalized\":true}" : "}");
    }
    add_accessor(s, mesh->normals ? 2 : 1, index_bytes(mesh) == 2 ? UNSIGNED_SHORT : UNSIGNED_INT,
                 3 * (uint64_t)mesh->triangle_count, "SCALAR");
    add_text(s, "}],\"bufferViews\":[");
    add_view(s, 0, l->positions, quantized ? 8 : 12, ARRAY);
    if (mesh->normals) add_view(s, l->positions, l->normals, l->normals_are_short ? 8 : 12, ARRAY);
    add_view(s, l->positions + l->normals, l->indices, 0, ELEMENTS);
    add_text(s, "],\"buffers\":[{\"byteLength\":");
    add_count(s, l->positions + l->normals + l->indices);
    add_text(s, "}]");
}

static void add_json(sink *s, const format_mesh *mesh, const glb_layout *l) {
    add_text(s, "{\"asset\":{\"version\":\"2.0\",\"generator\":\"rqt\"");
    add_extras(s, mesh, l);
    add_text(s, "}");
    if (is_empty(mesh)) {
        add_text(s, ",\"scene\":0,\"scenes\":[{}]}");
        return;
    }
    if (mesh->model->quantized)
        add_text(
            s,
            ",\"extensionsUsed\":[\"KHR_mesh_quantization\"],\"extensionsRequired\":[\"KHR_mesh_quantization\"]");
    add_text(s, ",\"scene\":0,\"scenes\":[{\"nodes\":[0]}]");
    add_node(s, mesh, l);
    add_text(s, ",\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0");
    add_text(s, mesh->normals ? ",\"NORMAL\":1},\"indices\":2" : "},\"indices\":1");
    add_text(s, ",\"material\":0,\"mode\":4}]}],\"materials\":[{\"doubleSided\":true,\"pbrMetallicRoughness\":{"
                "\"baseColorFactor\":[0.6,0.58,0.5,1],\"metallicFactor\":0,\"roughnessFactor\":1}}]");
    add_accessors(s, mesh, l);
    add_text(s, "}");
}

bool glb_plan(const format_mesh *mesh, glb_layout *l) {
    *l = (glb_layout){.total = HEAD + CHUNK};
    if (!is_empty(mesh)) {
        if (!plan_space(mesh, l)) return false;
        plan_deviation(mesh, l);
        plan_buffer(mesh, l->normals_are_short, l);
        l->total += CHUNK + padded(l->positions + l->normals + l->indices);
    }
    sink s = {NULL, 0};
    add_json(&s, mesh, l);
    l->text = s.size;
    l->total += padded(l->text);
    return true;
}

/* --------------------------------------------------------------------------------------------------- bytes -- */

static uint8_t *put_positions(uint8_t *p, const format_mesh *mesh, const glb_layout *l) {
    double xyz[3], at[3];
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        (void)mesh_coordinates(mesh, i, xyz);
        to_model(mesh, l->origin, xyz, at);
        for (int axis = 0; axis < 3; axis++)
            p = mesh->model->quantized ? put_u16(p, unit_of(l, axis, at[axis])) : put_float(p, (float)at[axis]);
        if (mesh->model->quantized) p = put_u16(p, 0);
    }
    return p;
}

static uint8_t *put_normals(uint8_t *p, const format_mesh *mesh, const glb_layout *l) {
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        const float *v = mesh->normals + 3 * i;
        double n[3] = {v[0], v[2], -v[1]};
        if (mesh->model->quantized) {
            for (int axis = 0; axis < 3; axis++) n[axis] *= l->step[axis];
            const double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
            for (int axis = 0; axis < 3; axis++) n[axis] /= length;
        }
        for (int axis = 0; axis < 3; axis++)
            p = l->normals_are_short ? put_u16(p, (unsigned)lrint(n[axis] * 32767) & 0xFFFF)
                                     : put_float(p, (float)n[axis]);
        if (l->normals_are_short) p = put_u16(p, 0);
    }
    return p;
}

static uint8_t *put_fill(uint8_t *p, uint64_t size, int fill) {
    const size_t n = (size_t)(padded(size) - size);
    memset(p, fill, n);
    return p + n;
}

static uint8_t *put_chunk(uint8_t *p, uint64_t size, const char name[4]) {
    p = put_u32(p, (uint32_t)padded(size));
    memcpy(p, name, 4);
    return p + 4;
}

void glb_write(const format_mesh *mesh, const glb_layout *l, uint8_t *p) {
    memcpy(p, "glTF", 4);
    p = put_u32(p + 4, 2);
    p = put_u32(p, (uint32_t)l->total);
    p = put_chunk(p, l->text, "JSON");
    sink s = {p, 0};
    add_json(&s, mesh, l);
    p = put_fill(p + l->text, l->text, ' ');
    if (is_empty(mesh)) return;
    const uint64_t size = l->positions + l->normals + l->indices;
    p = put_chunk(p, size, "BIN");
    p = put_positions(p, mesh, l);
    if (mesh->normals) p = put_normals(p, mesh, l);
    for (size_t i = 0; i < 3 * mesh->triangle_count; i++)
        p = index_bytes(mesh) == 2 ? put_u16(p, mesh->triangles[i]) : put_u32(p, mesh->triangles[i]);
    (void)put_fill(p, size, 0);
}
