/* verify_tiles_decode.h - a quantized-mesh tile from its bytes alone, written from the format's description
 * (CesiumGS/quantized-mesh 1.0). Nothing of src/tiles is in it.
 *
 * Whatever is not as the format has it is a sentence in Tile::problem, and nothing beyond the bytes is read.
 */
#ifndef VERIFY_TILES_DECODE_H
#define VERIFY_TILES_DECODE_H

#include "verify_tiles_space.h"

#include <cjson/cJSON.h>

static constexpr int UNITS = 32767;
enum Side { WEST, SOUTH, EAST, NORTH, SIDES };

struct Tile {
    std::string problem; /* empty: it is as the format has it */
    int z = 0, x = 0, y = 0;
    double west = 0, south = 0, side = 0; /* degrees */
    Vec middle, centre, horizon;
    double low = 0, high = 0, radius = 0;
    std::vector<int> u, v, h;
    std::vector<uint32_t> triangles; /* three a triangle */
    std::array<std::vector<uint32_t>, SIDES> edges;
    std::vector<uint8_t> normals, water;
    double geometric_error = NAN, error = NAN, vertical_error = NAN, lowest = NAN, highest = NAN, step = NAN;

    size_t count() const { return u.size(); }
    double lon(size_t i) const { return west + side * u[i] / UNITS; }
    double lat(size_t i) const { return south + side * v[i] / UNITS; }
    /* As clients do: a linear interpolation. */
    double height(size_t i) const { return low + (high - low) * (h[i] / (double)UNITS); }
    Vec normal(size_t i) const {
        double nx = normals[2 * i] / 255.0 * 2 - 1, ny = normals[2 * i + 1] / 255.0 * 2 - 1;
        const double nz = 1 - std::fabs(nx) - std::fabs(ny);
        if (nz < 0) {
            const double fold = (1 - std::fabs(ny)) * (nx >= 0 ? 1 : -1);
            ny = (1 - std::fabs(nx)) * (ny >= 0 ? 1 : -1);
            nx = fold;
        }
        const Vec n = {nx, ny, nz};
        return n * (1 / length(n));
    }
};

class Decoder {
  public:
    Decoder(const std::vector<uint8_t> &from, int z, int x, int y) : bytes(from) {
        tile.z = z;
        tile.x = x;
        tile.y = y;
        tile.side = std::ldexp(180, -z);
        tile.west = -180 + x * tile.side;
        tile.south = -90 + y * tile.side;
        read_header();
        read_vertices();
        if (tile.problem.empty()) read_triangles();
        if (tile.problem.empty()) read_extensions();
    }
    Tile tile;

  private:
    const std::vector<uint8_t> &bytes;
    size_t at = 0, wide = 2;

    void fail(const std::string &sentence) {
        if (tile.problem.empty()) tile.problem = sentence;
    }
    /* Little-endian machines only, as everything that this program runs on is. */
    template <typename T> T take() {
        T value = 0;
        if (bytes.size() - at < sizeof value) {
            fail("the bytes end at " + std::to_string(bytes.size()));
            at = bytes.size();
            return value;
        }
        memcpy(&value, &bytes[at], sizeof value);
        at += sizeof value;
        return value;
    }
    Vec take_vec() {
        const double x = take<double>(), y = take<double>(), z = take<double>();
        return {x, y, z};
    }
    /* Are there so many numbers of so many bytes? */
    bool has(uint64_t n, uint64_t size) {
        if (n * size <= bytes.size() - at) return true;
        fail("it says " + std::to_string(n) + " numbers, and the bytes end before");
        return false;
    }
    uint32_t take_index() { return wide == 4 ? take<uint32_t>() : take<uint16_t>(); }

    void read_header() {
        tile.middle = take_vec();
        tile.low = (double)take<float>();
        tile.high = (double)take<float>();
        tile.centre = take_vec();
        tile.radius = take<double>();
        tile.horizon = take_vec();
        for (double d : {tile.middle.x, tile.middle.y, tile.middle.z, tile.low, tile.high, tile.centre.x,
                         tile.centre.y, tile.centre.z, tile.radius, tile.horizon.x, tile.horizon.y, tile.horizon.z})
            if (!std::isfinite(d)) fail("a number of the header is none");
    }
    void read_differences(std::vector<int> &out, uint32_t n) {
        int value = 0;
        for (uint32_t i = 0; i < n; i++) {
            const uint16_t code = take<uint16_t>();
            value += (code >> 1) ^ -(code & 1);
            if (value < 0 || value > UNITS) fail("a coordinate of " + std::to_string(value));
            out.push_back(value);
        }
    }
    void read_vertices() {
        const uint32_t n = take<uint32_t>();
        if (!has(n, 6)) return;
        for (std::vector<int> *list : {&tile.u, &tile.v, &tile.h}) read_differences(*list, n);
        wide = n > 65536 ? 4 : 2;
        at += (wide - at % wide) % wide;
    }
    /* Where it has no terrain a tile has triangles of one vertex, behind all others: nothing is to be seen of them.
     */
    void drop_specks() {
        std::vector<uint32_t> &t = tile.triangles;
        while (t.size() >= 3 && t[t.size() - 3] == t.back() && t[t.size() - 2] == t.back() &&
               t.back() + 1 == tile.count()) {
            t.resize(t.size() - 3);
            for (std::vector<int> *list : {&tile.u, &tile.v, &tile.h}) list->pop_back();
            if (tile.normals.size() >= 2) tile.normals.resize(tile.normals.size() - 2);
        }
    }
    void read_triangles() {
        const uint64_t n = 3 * (uint64_t)take<uint32_t>();
        if (!has(n, wide)) return;
        uint32_t highest = 0;
        for (uint64_t i = 0; i < n; i++) {
            const uint32_t code = take_index();
            if (code > highest || highest - code >= tile.count()) return fail("an index that is no vertex");
            tile.triangles.push_back(highest - code);
            highest += code == 0;
        }
        if (highest != tile.count())
            fail(std::to_string(tile.count()) + " vertices, of which triangles use " + std::to_string(highest));
        if (n == 0 && tile.z > 0) fail("no triangle"); /* both tiles of level 0 are there */
        for (auto &edge : tile.edges) {
            const uint32_t m = take<uint32_t>();
            if (!has(m, wide)) return;
            for (uint32_t i = 0; i < m; i++) {
                edge.push_back(take_index());
                if (edge.back() >= tile.count()) return fail("a side's index that is no vertex");
            }
        }
    }
    void read_extensions() {
        while (at < bytes.size()) {
            const uint8_t id = take<uint8_t>();
            const uint32_t n = take<uint32_t>();
            if (!has(n, 1)) return;
            const std::vector<uint8_t> body(bytes.begin() + (long)at, bytes.begin() + (long)(at + n));
            at += n;
            if (id == 1) tile.normals = body;
            if (id == 2) tile.water = body;
            if (id == 4) read_metadata(body);
        }
        if (tile.normals.size() != 2 * tile.count()) fail("normals for another number of vertices");
        drop_specks();
        if (!tile.water.empty() && tile.water.size() != 1 && tile.water.size() != 65536)
            fail("a water mask of " + std::to_string(tile.water.size()) + " bytes");
        for (double d : {tile.geometric_error, tile.step})
            if (!std::isfinite(d)) fail("the metadata lack a number of the level");
        for (double d : {tile.error, tile.vertical_error, tile.lowest, tile.highest})
            if (tile.count() > 0 && !std::isfinite(d)) fail("the metadata lack a number");
    }
    void read_metadata(const std::vector<uint8_t> &body) {
        uint32_t n = 0;
        if (body.size() >= 4) memcpy(&n, body.data(), 4);
        if (body.size() < 4 || n != body.size() - 4) return fail("metadata of another length");
        cJSON *json = cJSON_ParseWithLength((const char *)body.data() + 4, n);
        const std::map<const char *, double *> members = {
            {"geometricError", &tile.geometric_error}, {"error", &tile.error},
            {"verticalError", &tile.vertical_error},   {"minimumHeight", &tile.lowest},
            {"maximumHeight", &tile.highest},          {"heightStep", &tile.step}};
        for (const auto &[name, value] : members) {
            const cJSON *number = cJSON_GetObjectItemCaseSensitive(json, name);
            if (cJSON_IsNumber(number)) *value = number->valuedouble;
        }
        cJSON_Delete(json);
    }
};

#endif
