/* verify_tiles_gltf.h - the meshes of a binary glTF 2.0, written from its description: what clients of 3D Tiles get
 * in space of a tile's content. Nothing of src/tiles is in it.
 *
 * Each primitive of the scene is a surface: places are its positions times the node's matrix, in doubles, then
 * turned from glTF's y up into z up, as 3D Tiles say: (x, y, z) to (x, -z, y). Whatever is not as the format has it
 * is a sentence in Gltf::problem, and nothing beyond the bytes is read.
 */
#ifndef VERIFY_TILES_GLTF_H
#define VERIFY_TILES_GLTF_H

#include "verify_tiles_space.h"

#include <cjson/cJSON.h>

struct Surface {
    std::vector<Vec> places, normals;
    std::vector<uint32_t> triangles; /* three a triangle */
    double skirt = NAN;              /* metres: walls that hang down so far; else it is ground */
};

/* A member of an object, or of a list; NULL: there is none. */
static inline const cJSON *member(const cJSON *object, const char *name) {
    return cJSON_GetObjectItemCaseSensitive(object, name);
}
static inline const cJSON *member(const cJSON *list, double index) {
    return index >= 0 ? cJSON_GetArrayItem(list, (int)index) : nullptr;
}
static inline double number(const cJSON *item, double otherwise) {
    return cJSON_IsNumber(item) ? item->valuedouble : otherwise;
}
static inline double number_of(const cJSON *object, const char *name, double otherwise) {
    return number(member(object, name), otherwise);
}

class Gltf {
  public:
    std::string problem; /* empty: it is as the format has it */
    std::vector<Surface> surfaces;
    double error = NAN, step = NAN; /* what asset.extras.rqt tells */
    int level = -1;

    explicit Gltf(const std::vector<uint8_t> &from) : bytes(from) {
        cJSON *read = read_chunks();
        json = read;
        if (problem.empty()) read_extras();
        if (problem.empty()) read_scene();
        cJSON_Delete(read);
        json = nullptr;
    }

  private:
    const std::vector<uint8_t> &bytes;
    const cJSON *json = nullptr;
    size_t buffer_at = 0, buffer_size = 0;

    void fail(const std::string &sentence) {
        if (problem.empty()) problem = sentence;
    }
    uint32_t take(size_t at) const {
        uint32_t value;
        memcpy(&value, &bytes[at], sizeof value);
        return value;
    }
    cJSON *read_chunks() {
        if (bytes.size() < 20 || memcmp(bytes.data(), "glTF", 4) != 0 || take(4) != 2 || take(8) != bytes.size()) {
            fail("no binary glTF 2 of " + std::to_string(bytes.size()) + " bytes");
            return nullptr;
        }
        const size_t text = take(12), binary = 20 + text + 8;
        if (memcmp(&bytes[16], "JSON", 4) != 0 || text % 4 != 0 || binary > bytes.size() ||
            memcmp(&bytes[binary - 4], "BIN", 4) != 0 || take(binary - 8) != bytes.size() - binary) {
            fail("chunks are not JSON and BIN up to the end");
            return nullptr;
        }
        buffer_at = binary;
        cJSON *read = cJSON_ParseWithLength((const char *)&bytes[20], text);
        const cJSON *buffers = member(read, "buffers");
        buffer_size = (size_t)number_of(member(buffers, 0.0), "byteLength", 0);
        if (!read || cJSON_GetArraySize(buffers) != 1 || buffer_size > bytes.size() - binary ||
            buffer_size + 4 <= bytes.size() - binary)
            fail("the buffer is not the second chunk");
        return read;
    }
    void read_extras() {
        const cJSON *asset = member(json, "asset"), *told = member(member(asset, "extras"), "rqt"),
                    *version = member(asset, "version");
        if (!cJSON_IsString(version) || strcmp(version->valuestring, "2.0") != 0) fail("no glTF 2.0");
        error = number_of(told, "error", NAN);
        step = number_of(told, "step", NAN);
        level = (int)number_of(told, "level", -1);
    }

    /* All numbers of an accessor, one after the other: normalized ones from -1 to 1. */
    std::vector<double> read_accessor(const cJSON *index, const char *type) {
        static const struct {
            int code;
            size_t size;
            double most;
        } components[] = {{5120, 1, 127},   {5121, 1, 255}, {5122, 2, 32767},
                          {5123, 2, 65535}, {5125, 4, 0},   {5126, 4, 0}};
        const cJSON *a = member(member(json, "accessors"), number(index, -1)),
                    *view = member(member(json, "bufferViews"), number_of(a, "bufferView", -1)),
                    *is = member(a, "type");
        const int code = (int)number_of(a, "componentType", 0);
        const size_t width = strcmp(type, "VEC3") == 0 ? 3 : 1, count = (size_t)number_of(a, "count", 0);
        for (const auto &component : components) {
            if (component.code != code || !view || !cJSON_IsString(is) || strcmp(is->valuestring, type) != 0)
                continue;
            const size_t stride = (size_t)number_of(view, "byteStride", (double)(width * component.size)),
                         from = (size_t)number_of(view, "byteOffset", 0),
                         room = (size_t)number_of(view, "byteLength", 0),
                         first = (size_t)number_of(a, "byteOffset", 0);
            const bool fits = from <= buffer_size && room <= buffer_size - from && first <= room &&
                              (count == 0 || (width * component.size <= room - first &&
                                              count - 1 <= (room - first - width * component.size) / stride));
            if (!fits || (from + first) % component.size != 0 || stride < width * component.size) break;
            const bool is_normalized = cJSON_IsTrue(member(a, "normalized"));
            std::vector<double> out(width * count);
            for (size_t i = 0; i < count; i++)
                for (size_t k = 0; k < width; k++) {
                    const double value =
                        component_of(code, buffer_at + from + first + i * stride + k * component.size);
                    out[width * i + k] = is_normalized ? std::max(value / component.most, -1.0) : value;
                }
            check_ends(a, out, width);
            return out;
        }
        fail("an accessor of " + std::string(type) + " that is none, or beyond its bytes");
        return {};
    }
    double component_of(int code, size_t at) const {
        const uint8_t *p = &bytes[at];
        int16_t signed_word;
        uint16_t word;
        float real;
        switch (code) {
        case 5120:
            return (int8_t)*p;
        case 5121:
            return *p;
        case 5122:
            memcpy(&signed_word, p, 2);
            return signed_word;
        case 5123:
            memcpy(&word, p, 2);
            return word;
        case 5125:
            return take(at);
        default:
            memcpy(&real, p, 4);
            return (double)real;
        }
    }
    void check_ends(const cJSON *accessor, const std::vector<double> &values, size_t width) {
        for (const char *end : {"min", "max"}) {
            const cJSON *told = member(accessor, end);
            for (size_t k = 0; told && k < width; k++) {
                double most = NAN;
                for (size_t i = k; i < values.size(); i += width)
                    most = *end == 'm' && end[1] == 'i' ? std::fmin(most, values[i]) : std::fmax(most, values[i]);
                if (number(member(told, (double)k), NAN) != most)
                    fail(std::string("an accessor's ") + end + " is another");
            }
        }
    }

    /* Column by column, as glTF has it: of translation, or of a matrix. */
    std::array<double, 16> read_matrix(const cJSON *node) {
        std::array<double, 16> m = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
        const cJSON *matrix = member(node, "matrix"), *translation = member(node, "translation");
        for (size_t k = 0; matrix && k < 16; k++) m[k] = number(member(matrix, (double)k), NAN);
        for (size_t k = 0; translation && k < 3; k++) m[12 + k] = number(member(translation, (double)k), NAN);
        for (double d : m)
            if (!std::isfinite(d)) fail("a node's matrix has no number");
        if (member(node, "rotation") || member(node, "scale") || member(node, "children"))
            fail("a node with more than a matrix or a translation");
        return m;
    }
    void read_scene() {
        const cJSON *scene = member(member(json, "scenes"), number_of(json, "scene", 0)), *index;
        cJSON_ArrayForEach(index, member(scene, "nodes")) {
            const cJSON *node = member(member(json, "nodes"), number(index, -1)),
                        *mesh = member(member(json, "meshes"), number_of(node, "mesh", -1)), *primitive;
            const auto matrix = read_matrix(node);
            cJSON_ArrayForEach(primitive, member(mesh, "primitives")) read_primitive(primitive, matrix);
        }
        if (surfaces.empty()) fail("no mesh");
    }
    void read_primitive(const cJSON *primitive, const std::array<double, 16> &m) {
        const cJSON *attributes = member(primitive, "attributes");
        const std::vector<double> places = read_accessor(member(attributes, "POSITION"), "VEC3"),
                                  normals = read_accessor(member(attributes, "NORMAL"), "VEC3"),
                                  indices = read_accessor(member(primitive, "indices"), "SCALAR");
        Surface s;
        if (number_of(primitive, "mode", 4) != 4) fail("a primitive that is no triangles");
        if (normals.size() != places.size()) fail("normals for another number of vertices");
        if (indices.size() % 3 != 0) fail("a part of a triangle");
        for (size_t i = 0; problem.empty() && i < places.size(); i += 3) {
            const double *p = &places[i], *n = &normals[i];
            const auto row = [&](size_t k, const double *v, double w) {
                return w * m[12 + k] + (m[k] * v[0] + m[4 + k] * v[1] + m[8 + k] * v[2]);
            };
            s.places.push_back({row(0, p, 1), -row(2, p, 1), row(1, p, 1)});
            s.normals.push_back({row(0, n, 0), -row(2, n, 0), row(1, n, 0)});
        }
        for (double i : indices) {
            if (i < 0 || i >= (double)s.places.size()) return fail("an index that is no vertex");
            s.triangles.push_back((uint32_t)i);
        }
        s.skirt = number_of(member(primitive, "extras"), "skirt", NAN);
        surfaces.push_back(s);
    }
};

#endif
