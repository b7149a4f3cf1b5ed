/* verify_tiles_terrarium.cpp - the judge of a folder of Terrarium pictures: GDAL reads each, and what clients draw
 * between four pixels is put beside every sample of the raster, on every level.
 *
 * Pixel (X, Y) of level z has its centre at (X + 1/2, Y + 1/2) of 2^(z + 8) a side of Mercator's square; between
 * four centres clients interpolate bilinearly there, across the sides of tiles too. R * 256 + G + B / 256 - 32768
 * is its height in metres, and 0 m is none.
 *
 * What is looked at:
 *
 *     error     no valid sample whose four pixels have heights is further from what is drawn than the tile says
 *               that it lies in; the tiles on both sides of it when it lies on one
 *     idle      the most that tiles of a level say is no more than twice the most that is true, half a pixel
 *               beyond a tile too, a step and a centimetre. (How much more than the truth a single tile says is
 *               in the table alone: near voids it can be much.)
 *     heights   where pixels are about as large as samples, each has the height of the half cell of the grid
 *               that it is in, to half a step; ground at 0 m is told a step higher or lower
 *     voids     ... and none where a corner of that is void. On coarser levels: a height where no void is near,
 *               none where all is void. None beyond the raster. The picture says how many
 *     steps     heights are multiples of the level's
 *     tiles     are those that meet the raster; the last level is the first with pixels no wider than samples
 *     document  tile.json has the bounds and the levels
 *     listed    these are the files that there are
 */
#include "verify_tiles.h"

#include <cjson/cJSON.h>

namespace {

enum { PIXELS = 256, PER_METRE = 256, ZERO = 0x800000 };
constexpr double WORLD = 85.0511287798066; /* where the square ends */

struct Picture {
    std::vector<int32_t> codes; /* 256ths of a metre above -32768 */
    double states = NAN, off = 0;
    double around = 0; /* the same half a pixel beyond it too: between its pixels and the neighbours' */
    long counted = 0, voids = -1;
};
using Key = std::pair<int, int>; /* x, y */

/* Where a sample or a pixel lies among others, along one axis. */
struct Between {
    size_t first = 0, second = 0; /* of the tiles that the pixels before and behind are in: in a list */
    int before = 0, behind = 0;   /* which of their 256 */
    double share = 0;
    std::vector<size_t> tiles; /* that the sample is in: two on their side */
};

double metres(int32_t code) {
    return code / (double)PER_METRE - 32768;
}
double latitude(double y) { /* of a share of the square, from the north */
    return std::atan(std::sinh(M_PI * (1 - 2 * y))) / RADIAN;
}

struct LevelFigures {
    size_t tiles = 0;
    long voids = 0, counted = 0, across = 0;
    double states = 0, off = 0, share = 0, idle = 0;
};

class Judge {
  public:
    Judge(const Raster &source, const std::string &tiles) : raster(source), folder(tiles) {
        east = raster.x0 + (raster.width - 1) * raster.dx;
        south = raster.y0 + (raster.height - 1) * raster.dy;
    }
    bool run();

  private:
    const Raster &raster;
    const std::string folder;
    double east, south; /* of the last samples */
    int first = 0, last = -1;
    std::vector<double> steps;
    Verdict verdict;
    /* Of each pixel or sample. */
    Promise &heights = verdict.of("heights: pixels as large as samples have the ground's, to half a step");
    Promise &holes = verdict.of("voids: pixels have none where a corner of their half cell is void");
    Promise &outside = verdict.of("voids: pixels have no height beyond the raster");
    Promise &near = verdict.of("voids: pixels have a height where no void is near, none where all is void");
    Promise &error = verdict.of("error: no sample is further from what is drawn than its tile says");
    std::map<Key, Picture> level;
    LevelFigures figures;

    void read_document();
    std::set<Key> expected(int z) const;
    bool read_picture(const std::string &path, Picture &picture);
    void judge_levels();
    void judge_level(int z);
    void judge_samples(int z);
    void judge_row(int z, int r, double y, const std::vector<Between> &columns, const std::vector<int> &used);
    void judge_errors(int z);
    void judge_pixels(int z);
    template <typename Where>
    void judge_pixel(Where where, double lon, double lat, int32_t code, double step, double reach);
    template <typename Where> void judge_height(Where where, double c, double r, int32_t code, double step);

    /* Pixels of a level in samples: across, and down where they are widest. */
    double wide(int z) const { return std::ldexp(360, -z) / PIXELS / raster.dx; }
    double high(int z) const {
        const double nearest = south <= 0 && raster.y0 >= 0 ? 0 : std::min(std::fabs(south), std::fabs(raster.y0));
        return -std::ldexp(360, -z) / PIXELS * std::cos(std::min(nearest, WORLD) * RADIAN) / raster.dy;
    }
};

/* ----------------------------------------------------------------------------------------- what there must be --
 */

void Judge::read_document() {
    Promise &document = verdict.of("document: tile.json has the levels, and the bounds of the raster");
    const std::vector<uint8_t> text = read_file(folder + "/tile.json");
    cJSON *json = cJSON_ParseWithLength((const char *)text.data(), text.size());
    const auto number = [&](const char *name, double otherwise) {
        const cJSON *item = cJSON_GetObjectItem(json, name);
        return cJSON_IsNumber(item) ? item->valuedouble : otherwise;
    };
    const auto is = [&](const char *name, const char *value) {
        const char *string = cJSON_GetStringValue(cJSON_GetObjectItem(json, name));
        return string && strcmp(string, value) == 0;
    };
    const cJSON *item;
    std::vector<double> bounds;
    first = (int)number("minzoom", 0);
    last = (int)number("maxzoom", -1);
    cJSON_ArrayForEach(item, cJSON_GetObjectItem(json, "steps")) steps.push_back(item->valuedouble);
    cJSON_ArrayForEach(item, cJSON_GetObjectItem(json, "bounds")) bounds.push_back(item->valuedouble);
    const auto says = [&](bool fine, const char *what) { verdict.see(document, fine, [&] { return what; }); };
    says(is("encoding", "terrarium") && is("scheme", "xyz") && number("tileSize", 0) == PIXELS,
         "encoding, scheme or tileSize");
    says(first >= 0 && first <= last && last <= 24 && steps.size() == (size_t)last + 1,
         "minzoom, maxzoom or steps");
    says(bounds.size() == 4, "bounds");
    cJSON_Delete(json);
    if (bounds.size() != 4 || steps.size() != (size_t)last + 1) last = -1;
    if (last < 0) return;
    /* Bounds cannot go on beyond 180 degrees: those of what does are all longitudes. */
    const double west = std::remainder(raster.x0, 360), end = west + east - raster.x0;
    const double off =
        std::fabs(std::remainder(bounds[0] - west, 360)) + std::fabs(std::remainder(bounds[2] - end, 360));
    says(end > 180 + 1e-9 ? bounds[0] == -180 && bounds[2] == 180 : off < 1e-9 && bounds[0] < bounds[2],
         "bounds: west or east");
    says(std::fabs(bounds[1] - std::clamp(south, -WORLD, WORLD)) +
                 std::fabs(bounds[3] - std::clamp(raster.y0, -WORLD, WORLD)) <
             1e-9,
         "bounds: south or north");
}

/* The tiles that have a part of the rectangle of the samples. */
std::set<Key> Judge::expected(int z) const {
    const int n = 1 << z;
    std::set<Key> keys;
    std::vector<int> columns;
    const double side = 360.0 / n;
    const int from = (int)std::floor((raster.x0 + 180) / side) - 1, to = (int)std::ceil((east + 180) / side) + 1;
    for (int x = from; x <= to; x++)
        if (-180 + x * side < east && -180 + (x + 1) * side > raster.x0) columns.push_back((x % n + n) % n);
    for (int y = 0; y < n; y++)
        if (latitude((double)y / n) > south && latitude((y + 1.0) / n) < raster.y0)
            for (int x : columns) keys.emplace(x, y);
    return keys;
}

bool Judge::read_picture(const std::string &path, Picture &picture) {
    GDALDatasetH source = GDALOpen(path.c_str(), GA_ReadOnly);
    if (!source) return false;
    uint8_t rgb[3][PIXELS * PIXELS];
    bool ok = GDALGetRasterCount(source) == 3 && GDALGetRasterXSize(source) == PIXELS &&
              GDALGetRasterYSize(source) == PIXELS;
    for (int band = 0; band < 3 && ok; band++)
        ok = GDALRasterIO(GDALGetRasterBand(source, band + 1), GF_Read, 0, 0, PIXELS, PIXELS, rgb[band], PIXELS,
                          PIXELS, GDT_Byte, 0, 0) == CE_None;
    const char *states = GDALGetMetadataItem(source, "error_metres", nullptr),
               *voids = GDALGetMetadataItem(source, "void_pixels", nullptr);
    ok = ok && states && voids;
    if (ok) {
        picture.states = std::atof(states);
        picture.voids = std::atol(voids);
        for (size_t i = 0; i < (size_t)PIXELS * PIXELS; i++)
            picture.codes.push_back(rgb[0][i] << 16 | rgb[1][i] << 8 | rgb[2][i]);
    }
    GDALClose(source);
    return ok;
}

/* ------------------------------------------------------------------------------------------------- samples -- */

/* A sample at a place of an axis that has count pixels. */
Between between(double place, long count, bool goes_round, std::vector<int> &tiles) {
    const auto at = [&](long tile) {
        const long n = count / PIXELS, t = goes_round ? (tile % n + n) % n : tile;
        const auto found = std::find(tiles.begin(), tiles.end(), (int)t);
        if (found != tiles.end()) return (size_t)(found - tiles.begin());
        tiles.push_back((int)t);
        return tiles.size() - 1;
    };
    const auto floor_of = [](long pixel) { return (long)std::floor((double)pixel / PIXELS); };
    const long before = (long)std::floor(place - 0.5), own = (long)std::floor(place / PIXELS);
    Between b;
    b.share = place - 0.5 - (double)before;
    b.first = at(floor_of(before));
    b.second = at(floor_of(before + 1));
    b.before = (int)(before - PIXELS * floor_of(before));
    b.behind = (int)(before + 1 - PIXELS * floor_of(before + 1));
    b.tiles = {at(own)};
    if (place == (double)own * PIXELS) b.tiles.push_back(at(own - 1));
    return b;
}

void Judge::judge_samples(int z) {
    const long count = (long)PIXELS << z;
    std::vector<int> used; /* columns of tiles */
    std::vector<Between> columns;
    for (int c = 0; c < raster.width; c++) {
        double turns = (raster.x0 + c * raster.dx + 180) / 360;
        turns -= std::floor(turns);
        columns.push_back(between(turns * (double)count, count, true, used));
    }
    for (int r = 0; r < raster.height; r++) {
        const double lat = raster.y0 + r * raster.dy;
        if (std::fabs(lat) >= WORLD) continue;
        judge_row(z, r, (1 - std::asinh(std::tan(lat * RADIAN)) / M_PI) / 2 * (double)count, columns, used);
    }
}

void Judge::judge_row(int z, int r, double y, const std::vector<Between> &columns, const std::vector<int> &used) {
    std::vector<int> rows;
    const Between row = between(y, (long)PIXELS << z, false, rows);
    std::vector<Picture *> first_row, second_row;
    std::vector<const int32_t *> upper, lower;
    std::vector<std::vector<Picture *>> own;
    const auto find = [&](int x, size_t k) {
        const auto found = level.find({x, rows[k]});
        return found == level.end() ? nullptr : &found->second;
    };
    for (int x : used) {
        Picture *above = find(x, row.first), *below = find(x, row.second);
        first_row.push_back(above);
        second_row.push_back(below);
        upper.push_back(above ? &above->codes[(size_t)row.before * PIXELS] : nullptr);
        lower.push_back(below ? &below->codes[(size_t)row.behind * PIXELS] : nullptr);
        own.emplace_back();
        for (size_t k : row.tiles) own.back().push_back(find(x, k));
    }
    const auto code = [](const int32_t *pixels, int i) { return pixels ? pixels[i] : ZERO; };
    for (int c = 0; c < raster.width; c++) {
        const Between &b = columns[(size_t)c];
        const int32_t nw = code(upper[b.first], b.before), ne = code(upper[b.second], b.behind),
                      sw = code(lower[b.first], b.before), se = code(lower[b.second], b.behind);
        if (!raster.is_valid(c, r) || nw == ZERO || ne == ZERO || sw == ZERO || se == ZERO) continue;
        const double above = metres(nw) * (1 - b.share) + metres(ne) * b.share,
                     below = metres(sw) * (1 - b.share) + metres(se) * b.share;
        const double off =
            std::fabs(above * (1 - row.share) + below * row.share - raster.source(raster.index(c, r)));
        for (Picture *picture :
             {first_row[b.first], first_row[b.second], second_row[b.first], second_row[b.second]})
            picture->around = std::max(picture->around, off); /* there: they have heights */
        figures.counted++;
        figures.across += b.first != b.second || row.first != row.second;
        for (size_t x : b.tiles)
            for (Picture *picture : own[x]) {
                if (!picture) continue;
                picture->counted++;
                picture->off = std::max(picture->off, off);
                verdict.see(error, off <= picture->states, [&] {
                    return name_of(z, used[x], rows[row.tiles[0]]) + ": sample " + std::to_string(c) + "," +
                           std::to_string(r) + " is " + std::to_string(off) + " m off, and it says " +
                           std::to_string(picture->states);
                });
            }
    }
}

void Judge::judge_errors(int z) {
    Promise &idle =
        verdict.of("idle: the most that is said on a level is no more than twice the most that is true");
    const double step = steps[(size_t)z];
    double most = 0;
    for (const auto &[key, picture] : level) {
        if (picture.counted == 0) continue;
        most = std::max(most, picture.around);
        figures.states = std::max(figures.states, picture.states);
        figures.off = std::max(figures.off, picture.off);
        figures.share = std::max(figures.share, picture.off / picture.states);
        figures.idle = std::max(figures.idle, picture.states / std::max(picture.around, step));
    }
    verdict.see(idle, figures.states <= 2 * most + step + 0.01, [&] {
        return "level " + std::to_string(z) + ": " + std::to_string(figures.states) + " m, and it is " +
               std::to_string(most) + " m off";
    });
    error.worst = std::max(error.worst, figures.share);
}

/* ------------------------------------------------------------------------------------------------- pixels -- */

template <typename Where> void Judge::judge_height(Where where, double c, double r, int32_t code, double step) {
    const int x = std::clamp((int)std::floor(c), 0, raster.width - 2),
              y = std::clamp((int)std::floor(r), 0, raster.height - 2);
    const double fx = c - x, fy = r - y;
    /* north-west, north-east, south-west, south-east: the diagonal goes through the corner with two odd coordinates
     */
    double weight[4];
    if ((x + y) % 2 == 0) {
        weight[0] = 1 - std::max(fx, fy), weight[1] = std::max(fx - fy, 0.0);
        weight[2] = std::max(fy - fx, 0.0), weight[3] = std::min(fx, fy);
    } else {
        const double over = fx + fy - 1;
        weight[0] = std::max(-over, 0.0), weight[1] = over < 0 ? fx : 1 - fy;
        weight[2] = over < 0 ? fy : 1 - fx, weight[3] = std::max(over, 0.0);
    }
    double height = 0, low = HUGE_VAL, top = -HUGE_VAL;
    bool is_void = false;
    for (int k = 0; k < 4; k++) {
        if (weight[k] <= 0) continue;
        const int col = x + (k & 1), row = y + (k >> 1);
        if (raster.is_valid(col, row)) {
            const double corner = raster.source(raster.index(col, row));
            height += weight[k] * corner;
            low = std::min(low, corner);
            top = std::max(top, corner);
            continue;
        }
        if (weight[k] < 4e-6) return; /* on a side of it, or a rounding beside */
        is_void = true;
    }
    verdict.see(holes, is_void == (code == ZERO),
                [&] { return where() + (is_void ? " has a height" : " has none"); });
    if (is_void || code == ZERO) return;
    /* The program's places among samples are whole 2^-20. */
    const double told = metres(code), most = step / 2 + raster.rounding + 1e-9 + 2e-6 * (top - low),
                 nearest = std::clamp(height, -32768.0, 32768 - step);
    verdict.see(
        heights,
        std::fabs(told - nearest) <= most ||
            (std::fabs(height) <= most && std::fabs(std::fabs(told) - step) < 1e-9),
        [&] { return where() + " has " + std::to_string(told) + " m instead of " + std::to_string(height); });
}

/* reach: samples by which a coarse level's voids may be larger or smaller; 0 on levels of full resolution. */
template <typename Where>
void Judge::judge_pixel(Where where, double lon, double lat, int32_t code, double step, double reach) {
    const double turn = 360 / raster.dx, r = (lat - raster.y0) / raster.dy;
    double c = (lon - raster.x0) / raster.dx;
    c -= turn * std::floor(c / turn + 1e-12);
    const double beyond = std::max({-c, c - raster.width + 1, -r, r - raster.height + 1});
    if (std::fabs(beyond) < 1e-9) return; /* on the rim */
    if (beyond > 0) return verdict.see(outside, code == ZERO, where);
    if (reach == 0) return judge_height(where, c, r, code, step);
    const int c0 = (int)std::max(0.0, c - reach), c1 = (int)std::min(raster.width - 1.0, c + reach + 1),
              r0 = (int)std::max(0.0, r - reach), r1 = (int)std::min(raster.height - 1.0, r + reach + 1);
    const long voids = raster.voids(c0, r0, c1, r1);
    if (voids == 0) verdict.see(near, code != ZERO, [&] { return where() + " has none"; });
    if (voids == (long)(c1 - c0 + 1) * (r1 - r0 + 1))
        verdict.see(near, code == ZERO, [&] { return where() + " has one"; });
}

void Judge::judge_pixels(int z) {
    Promise &counted = verdict.of("voids: a picture says how many there are");
    Promise &multiples = verdict.of("steps: heights are multiples of the level's, a power of two");
    const double step = steps[(size_t)z], area = wide(z) * high(z), count = std::ldexp(256.0, z);
    /* A mesh with vertices 2^shift samples apart: leaves that are left out are no larger than two of its cells, and
     * a pixel is left out that they reach into. */
    const double apart = area < 4 ? 0 : std::exp2(std::floor(std::log2(area) / 2)),
                 reach = area < 4 ? 0 : 2 * apart + std::max(wide(z), high(z)) + 1;
    int exponent;
    verdict.see(multiples, std::frexp(step, &exponent) == 0.5 && step * PER_METRE >= 1,
                [&] { return std::to_string(step); });
    const auto per_step = (int32_t)std::max(1.0, step * PER_METRE);
    for (const auto &[key, picture] : level) {
        long voids = 0;
        for (int j = 0; j < PIXELS; j++) {
            const double lat = latitude((key.second * (double)PIXELS + j + 0.5) / count);
            for (int i = 0; i < PIXELS; i++) {
                const int32_t code = picture.codes[(size_t)(j * PIXELS + i)];
                const auto where = [&, &k = key] {
                    return name_of(z, k.first, k.second) + ": pixel " + std::to_string(i) + "," + std::to_string(j);
                };
                voids += code == ZERO;
                if (code % per_step != 0) verdict.see(multiples, false, where);
                judge_pixel(where, (key.first * (double)PIXELS + i + 0.5) * 360 / count - 180, lat, code, step,
                            reach);
            }
        }
        figures.voids += voids;
        verdict.see(counted, voids == picture.voids, [&, &k = key] { return name_of(z, k.first, k.second); });
    }
}

/* -------------------------------------------------------------------------------------------------- whole -- */

void Judge::judge_level(int z) {
    Promise &format =
        verdict.of("format: pictures are of 256 x 256 pixels of three bytes, and say what they are off");
    figures = {};
    level.clear();
    for (const Key &key : expected(z)) {
        const std::string name = name_of(z, key.first, key.second);
        Picture picture;
        const bool fine = read_picture(folder + "/" + name + ".png", picture);
        verdict.see(format, fine, [&] { return name; });
        if (fine) level[key] = picture;
    }
    figures.tiles = level.size();
    judge_samples(z);
    judge_errors(z);
    judge_pixels(z);
    std::printf("| %d | %zu | %ld | %ld | %ld | %.4g | %.4f | %.4f | %.4f | %.3f |\n", z, figures.tiles,
                figures.voids, figures.counted, figures.across, steps[(size_t)z], figures.states, figures.off,
                figures.share, figures.idle);
    std::fflush(stdout);
}

void Judge::judge_levels() {
    Promise &resolution = verdict.of("tiles: the last level is the first with pixels no wider than samples");
    for (int z = first; z <= last; z++)
        verdict.see(resolution, (wide(z) <= 1 + 1e-9 && high(z) <= 1 + 1e-9) == (z == last),
                    [&] { return "level " + std::to_string(z); });
    std::printf("| level | tiles | void pixels | samples between four pixels | of more than one tile | step, m | "
                "says at most, m | worst, m | "
                "of what it says | says / true at most |\n");
    std::printf("|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|\n");
    for (int z = first; z <= last; z++) judge_level(z);
    std::printf("\n");
}

bool Judge::run() {
    read_document();
    std::set<std::string> names = {"tile.json"};
    for (int z = first; z <= last; z++)
        for (const Key &key : expected(z)) names.insert(name_of(z, key.first, key.second) + ".png");
    judge_files(verdict, folder, names);
    if (last >= 0) judge_levels();
    return verdict.report();
}

} // namespace

bool judge_terrarium(const Raster &raster, const std::string &folder) {
    return Judge(raster, folder).run();
}
