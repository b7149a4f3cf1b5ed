/* verify_tiles_implicit.h - an implicit tileset of 3D Tiles 1.1 as clients find it: tileset.json, then subtrees
 * from the root's on, by their availability. Written from the specification; nothing of src/tiles is in it.
 *
 * Whatever is not as the format has it is a sentence in Tileset::problem, and nothing beyond the bytes is read.
 */
#ifndef VERIFY_TILES_IMPLICIT_H
#define VERIFY_TILES_IMPLICIT_H

#include "verify_tiles.h"
#include "verify_tiles_gltf.h"

#include <tuple>

struct Place {
    int level = 0, x = 0, y = 0; /* y from the south */
    bool operator<(const Place &o) const { return std::tie(level, x, y) < std::tie(o.level, o.x, o.y); }
};
using Region = std::array<double, 6>; /* west, south, east, north: radians; lowest, highest: metres */
struct ImplicitTile {
    bool has_content = false;
    double error = NAN;
    Region region = {};
};

/* {level}, {x} and {y} of an address. */
static inline std::string address_of(std::string address, Place p) {
    for (const auto &[name, value] :
         {std::pair{"{level}", p.level}, std::pair{"{x}", p.x}, std::pair{"{y}", p.y}}) {
        const size_t at = address.find(name);
        if (at != std::string::npos) address.replace(at, strlen(name), std::to_string(value));
    }
    return address;
}

/* The bytes of a subtree. */
class Subtree {
  public:
    std::string problem;
    std::vector<bool> tiles, contents, below;
    std::vector<double> errors;
    std::vector<Region> regions; /* of the tiles that are there */

    /* properties: of the schema's class of tiles. */
    Subtree(const std::vector<uint8_t> &from, int levels, const cJSON *properties) : bytes(from) {
        uint64_t text = 0, binary = 0;
        if (bytes.size() >= 24) memcpy(&text, &bytes[8], 8), memcpy(&binary, &bytes[16], 8);
        if (bytes.size() < 24 || memcmp(bytes.data(), "subt\1\0\0\0", 8) != 0 || text % 8 != 0 || binary % 8 != 0 ||
            text > bytes.size() - 24 || binary != bytes.size() - 24 - text) {
            fail("no subtree of " + std::to_string(bytes.size()) + " bytes");
            return;
        }
        buffer = 24 + text;
        cJSON *read = cJSON_ParseWithLength((const char *)&bytes[24], text);
        json = read;
        const size_t below_count = (size_t)1 << 2 * levels;
        tiles = read_bits(member(json, "tileAvailability"), (below_count - 1) / 3);
        contents = read_bits(member(member(json, "contentAvailability"), 0.0), (below_count - 1) / 3);
        below = read_bits(member(json, "childSubtreeAvailability"), below_count);
        if (problem.empty()) read_metadata(properties);
        cJSON_Delete(read);
        json = nullptr;
    }

  private:
    const std::vector<uint8_t> &bytes;
    const cJSON *json = nullptr;
    size_t buffer = 0;

    void fail(const std::string &sentence) {
        if (problem.empty()) problem = sentence;
    }
    /* NULL: there is no such view, or not of this size. */
    const uint8_t *view(const cJSON *index, size_t size) {
        const cJSON *v = member(member(json, "bufferViews"), number(index, -1));
        const size_t from = (size_t)number_of(v, "byteOffset", 0);
        if (v && number_of(v, "byteLength", -1) == (double)size && from % 8 == 0 && from <= bytes.size() - buffer &&
            size <= bytes.size() - buffer - from)
            return bytes.data() + buffer + from;
        fail("no view of " + std::to_string(size) + " bytes where there must be one");
        return nullptr;
    }
    std::vector<bool> read_bits(const cJSON *availability, size_t count) {
        const double constant = number_of(availability, "constant", -1);
        std::vector<bool> bits(count, constant == 1);
        if (constant == 0 || constant == 1) return bits;
        const uint8_t *p = view(member(availability, "bitstream"), (count + 7) / 8);
        for (size_t i = 0; p && i < count; i++) bits[i] = p[i / 8] >> i % 8 & 1;
        if ((double)std::count(bits.begin(), bits.end(), true) != number_of(availability, "availableCount", -1))
            fail("another number is available than is told");
        return bits;
    }
    void read_metadata(const cJSON *properties) {
        const cJSON *table = member(member(json, "propertyTables"), number_of(json, "tileMetadata", -1)), *p;
        const size_t count = (size_t)std::count(tiles.begin(), tiles.end(), true);
        if (number_of(table, "count", -1) != (double)count) return fail("metadata of another number of tiles");
        errors.assign(count, NAN);
        regions.assign(count, {NAN, NAN, NAN, NAN, NAN, NAN});
        cJSON_ArrayForEach(p, properties) {
            const char *semantic = cJSON_GetStringValue(member(p, "semantic")),
                       *component = cJSON_GetStringValue(member(p, "componentType"));
            const cJSON *values = member(member(member(table, "properties"), p->string), "values");
            if (!semantic || !component || strcmp(component, "FLOAT64") != 0) continue;
            const bool is_error = strcmp(semantic, "TILE_GEOMETRIC_ERROR") == 0;
            if (!is_error && (strcmp(semantic, "TILE_BOUNDING_REGION") != 0 || number_of(p, "count", 0) != 6))
                continue;
            const uint8_t *at = view(values, (is_error ? 8 : 48) * count);
            if (at && count > 0)
                memcpy(is_error ? (void *)errors.data() : regions.data(), at, (is_error ? 8 : 48) * count);
        }
    }
};

class Tileset {
  public:
    std::string problem;
    int levels = 0;
    double error = NAN, root_error = NAN;
    Region root = {};
    std::map<Place, ImplicitTile> tiles;
    std::set<std::string> names; /* of the files that there must be */

    explicit Tileset(const std::string &from) : folder(from) {
        const std::vector<uint8_t> text = read_file(folder + "/tileset.json");
        cJSON *json = cJSON_ParseWithLength((const char *)text.data(), text.size());
        read(json);
        cJSON_Delete(json);
    }
    std::string content(Place p) const { return address_of(content_uri, p); }

  private:
    const std::string folder;
    std::string content_uri, subtree_uri;
    int depth = 0;

    void fail(const std::string &sentence) {
        if (problem.empty()) problem = sentence;
    }
    static std::string string_of(const cJSON *item) { return cJSON_IsString(item) ? item->valuestring : ""; }
    void read(const cJSON *json) {
        const cJSON *at = member(json, "root"), *tiling = member(at, "implicitTiling"),
                    *region = member(member(at, "boundingVolume"), "region");
        names.insert("tileset.json");
        error = number_of(json, "geometricError", NAN);
        root_error = number_of(at, "geometricError", NAN);
        content_uri = string_of(member(member(at, "content"), "uri"));
        subtree_uri = string_of(member(member(tiling, "subtrees"), "uri"));
        levels = (int)number_of(tiling, "availableLevels", 0);
        depth = (int)number_of(tiling, "subtreeLevels", 0);
        for (size_t k = 0; k < 6; k++) root[k] = number(member(region, (double)k), NAN);
        if (string_of(member(member(json, "asset"), "version")) != "1.1" ||
            string_of(member(at, "refine")) != "REPLACE" ||
            string_of(member(tiling, "subdivisionScheme")) != "QUADTREE" || depth < 1 || depth > 8 || levels < 1 ||
            levels > 24 || content_uri.empty() || subtree_uri.empty())
            return fail("tileset.json has no implicit quadtree that replaces");
        const cJSON *classes = member(member(json, "schema"), "classes");
        const cJSON *properties = member(member(classes, "tile"), "properties");
        std::vector<Place> waiting = {{0, 0, 0}};
        while (!waiting.empty() && problem.empty()) {
            const Place p = waiting.back();
            waiting.pop_back();
            read_subtree(p, properties, waiting);
        }
    }
    static Place below(Place p, int by, size_t morton) {
        Place q = {p.level + by, p.x << by, p.y << by};
        for (int bit = 0; bit < by; bit++) {
            q.x |= (int)(morton >> 2 * bit & 1) << bit;
            q.y |= (int)(morton >> (2 * bit + 1) & 1) << bit;
        }
        return q;
    }
    void read_subtree(Place p, const cJSON *properties, std::vector<Place> &waiting) {
        const std::string name = address_of(subtree_uri, p);
        names.insert(name);
        const std::vector<uint8_t> bytes = read_file(folder + "/" + name);
        const Subtree s(bytes, depth, properties);
        if (!s.problem.empty()) return fail(name + ": " + s.problem);
        size_t first = 0, row = 0;
        for (int by = 0; by < depth; first += (size_t)1 << 2 * by++)
            for (size_t m = 0; m < (size_t)1 << 2 * by; m++) {
                const Place q = below(p, by, m);
                if (!s.tiles[first + m]) {
                    if (s.contents[first + m]) fail(name + ": content of a tile that is not there");
                    continue;
                }
                tiles[q] = {s.contents[first + m], s.errors[row], s.regions[row]};
                row++;
                if (s.contents[first + m]) names.insert(content(q));
                if (q.level >= levels) fail(name + ": a tile below the last level");
                if (q.level > 0 && tiles.count({q.level - 1, q.x / 2, q.y / 2}) == 0)
                    fail(name + ": a tile whose parent is not there");
            }
        for (size_t m = 0; m < s.below.size(); m++)
            if (s.below[m]) waiting.push_back(below(p, depth, m));
    }
};

#endif
