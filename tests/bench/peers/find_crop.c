/* find_crop.c - the crop of a raster that every peer can take: square, 2^k + 1 samples a side, without voids.
 *
 *     find_crop RASTER MOST_K
 *
 * Prints "COL ROW SIDE" of the largest such square with k <= MOST_K, the one nearest to the raster's middle. Exit
 * status 1 when the raster cannot be read, has no whole numbers or no such square of 65 samples or more.
 */
#include <cpl_conv.h>
#include <gdal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

/* voids[y * (width + 1) + x]: voids in the rows above y and the columns left of x. */
static uint32_t *count_voids(GDALRasterBandH band, int width, int height) {
    int has_void = 0;
    const double nodata = GDALGetRasterNoDataValue(band, &has_void);
    const size_t pitch = (size_t)width + 1;
    uint32_t *voids = calloc(pitch * ((size_t)height + 1), sizeof *voids);
    int32_t *row = malloc((size_t)width * sizeof *row);
    for (int y = 0; voids && row && y < height; y++) {
        if (GDALRasterIO(band, GF_Read, 0, y, width, 1, row, width, 1, GDT_Int32, 0, 0) != CE_None) {
            free(voids);
            voids = NULL;
            break;
        }
        uint32_t in_row = 0;
        const uint32_t *above = voids + (size_t)y * pitch;
        uint32_t *here = voids + ((size_t)y + 1) * pitch;
        for (int x = 0; x < width; x++) {
            in_row += has_void && row[x] == nodata;
            here[x + 1] = above[x + 1] + in_row;
        }
    }
    free(row);
    return voids;
}

static int find(const uint32_t *voids, int width, int height, int side) {
    const size_t pitch = (size_t)width + 1;
    int64_t best = INT64_MAX;
    int best_x = 0, best_y = 0;
    for (int y = 0; y + side <= height; y++)
        for (int x = 0; x + side <= width; x++) {
            const uint32_t *top = voids + (size_t)y * pitch + x, *bottom = top + (size_t)side * pitch;
            if (bottom[side] - bottom[0] != top[side] - top[0]) continue;
            const int64_t dx = 2 * x + side - width, dy = 2 * y + side - height, distance = dx * dx + dy * dy;
            if (distance >= best) continue;
            best = distance;
            best_x = x;
            best_y = y;
        }
    if (best == INT64_MAX) return 0;
    printf("%d %d %d\n", best_x, best_y, side);
    return 1;
}

int main(int argc, char **argv) {
    const int most = argc == 3 ? atoi(argv[2]) : 0;
    if (most < 6 || most > 14) {
        fprintf(stderr, "Usage: find_crop RASTER MOST_K; MOST_K from 6 to 14\n");
        return 2;
    }
    GDALAllRegister();
    GDALDatasetH raster = GDALOpen(argv[1], GA_ReadOnly);
    if (!raster || GDALGetRasterCount(raster) != 1) return 1;
    GDALRasterBandH band = GDALGetRasterBand(raster, 1);
    const GDALDataType type = GDALGetRasterDataType(band);
    if (!(type == GDT_Byte || type == GDT_Int16 || type == GDT_UInt16 || type == GDT_Int32)) {
        fprintf(stderr, "find_crop: %s: the heights are no whole numbers\n", argv[1]);
        return 1;
    }
    const int width = GDALGetRasterXSize(raster), height = GDALGetRasterYSize(raster);
    uint32_t *voids = count_voids(band, width, height);
    int found = 0;
    for (int k = most; voids && k >= 6 && !found; k--) {
        const int side = (1 << k) + 1;
        if (side <= width && side <= height) found = find(voids, width, height, side);
    }
    free(voids);
    GDALClose(raster);
    if (!found) fprintf(stderr, "find_crop: %s: no square of 65 samples or more without voids\n", argv[1]);
    return !found;
}
