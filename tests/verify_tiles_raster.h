/* verify_tiles_raster.h - the source of a terrain as GDAL reads it: heights above the ellipsoid in metres, places
 * in space, which samples are void, how far the next void is, what the terrain's mesh has to cover.
 */
#ifndef VERIFY_TILES_RASTER_H
#define VERIFY_TILES_RASTER_H

#include "verify_tiles_space.h"

#include <gdal.h>
#include <memory>
#include <ogr_srs_api.h>

class Raster {
  public:
    int width = 0, height = 0;
    double x0 = 0, y0 = 0, dx = 1, dy = -1;
    bool has_sea = false;
    double rounding =
        0; /* what storing may move a height by: a half of 1/1024 m where it has fractions of metres */

    /* sea: what voids are, NAN when they stay voids. False after a sentence on stderr. */
    bool open(const char *path, double sea) {
        GDALAllRegister();
        GDALDatasetH source = GDALOpen(path, GA_ReadOnly);
        double at[6];
        if (!source || GDALGetGeoTransform(source, at) != CE_None || at[2] != 0 || at[4] != 0) return false;
        width = GDALGetRasterXSize(source);
        height = GDALGetRasterYSize(source);
        const bool south_up = at[5] > 0;
        dx = at[1];
        dy = south_up ? -at[5] : at[5];
        x0 = at[0] + at[1] / 2;
        y0 = south_up ? at[3] + at[5] * (height - 0.5) : at[3] + at[5] / 2;
        const bool ok = read(GDALGetRasterBand(source, 1), south_up) && (fill_sea(sea), lift(source));
        GDALClose(source);
        if (!ok) return false;
        for (int c = 0; c < width; c++) lons.emplace_back(x0 + c * dx);
        for (int r = 0; r < height; r++) lats.emplace_back(y0 + r * dy);
        mark_promised();
        measure_voids();
        return true;
    }
    size_t index(int c, int r) const { return (size_t)r * (size_t)width + (size_t)c; }
    bool is_inside(int c, int r) const { return c >= 0 && r >= 0 && c < width && r < height; }
    bool is_valid(int c, int r) const { return is_inside(c, r) && !std::isnan(heights[index(c, r)]); }
    bool is_sea(int c, int r) const { return has_sea && is_inside(c, r) && filled[index(c, r)]; }
    /* A corner of one of the terrain's smallest triangles, with three valid corners. */
    bool is_promised(size_t i) const { return promised[i]; }
    /* However an outline moves by so many metres on the ground, it stays in the mesh. */
    bool must_be_covered(size_t i, double error) const { return promised[i] && distances[i] * cell() > error; }
    /* To the next void, along rows or columns, whichever is more; far when there is none. */
    int void_distance(size_t i) const { return distances[i]; }
    double sample(size_t i) const { return heights[i]; }
    /* Metres above what the raster has them above: the geoid mostly. */
    double source(size_t i) const { return unlifted.empty() ? heights[i] : unlifted[i]; }
    Vec place(int c, int r) const { return ecef(lons[(size_t)c], lats[(size_t)r], heights[index(c, r)]); }
    /* Metres of ground that a sample takes, at most. */
    double cell() const { return std::max(dx, -dy) * RADIAN * EQUATOR; }
    /* Voids among the samples c0..c1, r0..r1, as far as they are in the raster. */
    long voids(int c0, int r0, int c1, int r1) const {
        c0 = std::max(c0, 0), r0 = std::max(r0, 0), c1 = std::min(c1, width - 1), r1 = std::min(r1, height - 1);
        if (c0 > c1 || r0 > r1) return 0;
        const auto sum = [&](int c, int r) { return sums[(size_t)r * (size_t)(width + 1) + (size_t)c]; };
        return sum(c1 + 1, r1 + 1) - sum(c0, r1 + 1) - sum(c1 + 1, r0) + sum(c0, r0);
    }
    /* Of the two halves of the square whose north-western sample this is: those with three valid corners. */
    int half_cells(int c, int r) const {
        int count = 0;
        each_half(c, r, [&](size_t, size_t, size_t) { count++; });
        return count;
    }
    /* By central differences in space; false where a neighbour is void. */
    bool normal(int c, int r, Vec &n) const {
        if (!is_valid(c - 1, r) || !is_valid(c + 1, r) || !is_valid(c, r - 1) || !is_valid(c, r + 1) ||
            !is_valid(c, r))
            return false;
        n = cross(place(c + 1, r) - place(c - 1, r), place(c, r - 1) - place(c, r + 1));
        n = n * (1 / length(n));
        return true;
    }

  private:
    std::vector<double> heights, unlifted; /* empty: the same */
    std::vector<uint8_t> promised, filled;
    std::vector<int> distances;
    std::vector<long> sums;
    std::vector<Angle> lons, lats;

    static double unit_of(const char *name) {
        const std::string unit = name ? name : "";
        if (unit == "ft" || unit == "foot") return 0.3048;
        if (unit == "us-ft" || unit == "US survey foot") return 1200.0 / 3937;
        return 1;
    }
    bool read(GDALRasterBandH band, bool south_up) {
        std::vector<uint8_t> mask((size_t)width);
        const double unit = unit_of(GDALGetRasterUnitType(band)), scale = GDALGetRasterScale(band, nullptr),
                     offset = GDALGetRasterOffset(band, nullptr);
        heights.resize((size_t)width * (size_t)height);
        for (int r = 0; r < height; r++) {
            double *row = &heights[index(0, r)];
            const int line = south_up ? height - 1 - r : r;
            if (GDALRasterIO(band, GF_Read, 0, line, width, 1, row, width, 1, GDT_Float64, 0, 0) != CE_None ||
                GDALRasterIO(GDALGetMaskBand(band), GF_Read, 0, line, width, 1, mask.data(), width, 1, GDT_Byte, 0,
                             0) != CE_None)
                return false;
            for (int c = 0; c < width; c++)
                row[c] = mask[(size_t)c] && std::isfinite(row[c]) ? (row[c] * scale + offset) * unit : NAN;
            for (int c = 0; c < width && rounding == 0 && GDALDataTypeIsFloating(GDALGetRasterDataType(band)); c++)
                if (std::floor(row[c]) < row[c]) rounding = 0.5 / 1024;
        }
        return true;
    }
    void fill_sea(double sea) {
        filled.resize(heights.size());
        for (size_t i = 0; i < heights.size() && !std::isnan(sea); i++)
            if (std::isnan(heights[i])) {
                heights[i] = sea;
                filled[i] = 1;
                has_sea = true;
            }
    }
    /* Heights above the geoid become heights above the ellipsoid, by PROJ. */
    bool lift(GDALDatasetH source) {
        OGRSpatialReferenceH from = GDALGetSpatialRef(source);
        if (!from || !OSRIsCompound(from)) return true;
        unlifted = heights;
        from = OSRClone(from);
        OGRSpatialReferenceH to = OSRNewSpatialReference(nullptr);
        OSRImportFromEPSG(to, 4979);
        OSRSetAxisMappingStrategy(from, OAMS_TRADITIONAL_GIS_ORDER);
        OSRSetAxisMappingStrategy(to, OAMS_TRADITIONAL_GIS_ORDER);
        OGRCoordinateTransformationH change = OCTNewCoordinateTransformation(from, to);
        bool ok = change;
        for (int r = 0; r < height && ok; r++) {
            std::vector<double> x((size_t)width), y((size_t)width, y0 + r * dy), z((size_t)width);
            for (int c = 0; c < width; c++)
                x[(size_t)c] = x0 + c * dx, z[(size_t)c] = is_valid(c, r) ? heights[index(c, r)] : 0;
            ok = OCTTransform(change, width, x.data(), y.data(), z.data());
            for (int c = 0; c < width && ok; c++)
                if (is_valid(c, r)) heights[index(c, r)] = z[(size_t)c];
        }
        OCTDestroyCoordinateTransformation(change);
        OSRRelease(to);
        OSRRelease(from);
        return ok;
    }
    /* The diagonal of a cell goes through its corner with two odd coordinates (the lattice of the algorithm). */
    template <typename Look> void each_half(int c, int r, Look look) const {
        const int odd_c = c | 1, odd_r = r | 1, even_c = 2 * c + 1 - odd_c, even_r = 2 * r + 1 - odd_r;
        if (!is_valid(odd_c, odd_r) || !is_valid(even_c, even_r)) return;
        if (is_valid(odd_c, even_r)) look(index(odd_c, odd_r), index(even_c, even_r), index(odd_c, even_r));
        if (is_valid(even_c, odd_r)) look(index(odd_c, odd_r), index(even_c, even_r), index(even_c, odd_r));
    }
    void mark_promised() {
        promised.resize(heights.size());
        for (int r = 0; r + 1 < height; r++)
            for (int c = 0; c + 1 < width; c++)
                each_half(c, r, [&](size_t i, size_t j, size_t k) { promised[i] = promised[j] = promised[k] = 1; });
    }
    void measure_voids() {
        const int far = 1 << 28;
        distances.resize(heights.size());
        sums.assign((size_t)(width + 1) * (size_t)(height + 1), 0);
        const auto at = [&](int c, int r) { return is_inside(c, r) ? distances[index(c, r)] : far; };
        for (int r = 0; r < height; r++)
            for (int c = 0; c < width; c++) {
                const size_t i = index(c, r), s = (size_t)(r + 1) * (size_t)(width + 1) + (size_t)(c + 1);
                const bool is_void = std::isnan(heights[i]);
                sums[s] = sums[s - 1] + sums[s - (size_t)width - 1] - sums[s - (size_t)width - 2] + is_void;
                distances[i] = is_void ? 0
                                       : std::min({far, at(c - 1, r) + 1, at(c - 1, r - 1) + 1, at(c, r - 1) + 1,
                                                   at(c + 1, r - 1) + 1});
            }
        for (int r = height - 1; r >= 0; r--)
            for (int c = width - 1; c >= 0; c--) {
                const size_t i = index(c, r);
                distances[i] = std::min(
                    {distances[i], at(c + 1, r) + 1, at(c + 1, r + 1) + 1, at(c, r + 1) + 1, at(c - 1, r + 1) + 1});
            }
    }
};

#endif
