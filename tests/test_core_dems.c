/* test_core_dems.c - real terrain: the core equals the oracle on every 161 x 161 DEM of tests/data, in every block
 * size.
 *
 * The files come from GDAL, so heights, voids and units are what users have. RQT_DATA names another folder. */
#include "test_core_walk.h"

#include <dirent.h>
#include <gdal.h>

/* The heights as integers: metres where the band is integer, tenths of a metre where it is not. */
static raster read_dem(const char *path) {
    GDALDatasetH file = GDALOpen(path, GA_ReadOnly);
    assert_non_null(file);
    GDALRasterBandH band = GDALGetRasterBand(file, 1);
    const int width = GDALGetRasterXSize(file), height = GDALGetRasterYSize(file);
    const size_t count = (size_t)width * (size_t)height;
    double *z = malloc(count * sizeof *z);
    int32_t *q = malloc(count * sizeof *q);
    uint8_t *valid = malloc(count);
    if (!z || !q || !valid) abort();
    assert_int_equal(GDALRasterIO(band, GF_Read, 0, 0, width, height, z, width, height, GDT_Float64, 0, 0),
                     CE_None);
    int has_nodata;
    const double nodata = GDALGetRasterNoDataValue(band, &has_nodata);
    const bool whole = GDALDataTypeIsInteger(GDALGetRasterDataType(band));
    for (size_t i = 0; i < count; i++) {
        valid[i] = !(isnan(z[i]) || (has_nodata && z[i] == nodata));
        q[i] = valid[i] ? (int32_t)lrint(whole ? z[i] : z[i] * 10) : 0;
    }
    GDALClose(file);
    const rqt_unit tenths = {0, 10, 1, 1, 1.0, 0.0};
    raster r = raster_from_memory(width, height, q, valid, whole ? &UNIT_METRE : &tenths, "a DEM");
    free(z);
    free(q);
    free(valid);
    return r;
}

static int for_each_dem(void (*check)(raster r)) {
    const char *folder = getenv("RQT_DATA") ? getenv("RQT_DATA") : "tests/data";
    DIR *list = opendir(folder);
    assert_non_null(list);
    int count = 0;
    for (const struct dirent *entry; (entry = readdir(list)) != NULL;) {
        char path[1024];
        const char *ending = strstr(entry->d_name, "161.tif");
        if (!ending || ending[7]) continue;
        (void)snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        printf("%s\n", entry->d_name);
        check(read_dem(path));
        count++;
    }
    (void)closedir(list);
    return count;
}

static void check_errors(raster r) {
    check_errors_equal_oracle(r);
}
static void check_walks(raster r) {
    check_queries(r, 3, 1);
}

static void errors_of_real_terrain_equal_the_oracles(void **state) {
    (void)state;
    assert_true(for_each_dem(check_errors) >= 3);
}

static void meshes_of_real_terrain_equal_the_oracles_in_every_block_size(void **state) {
    (void)state;
    random_begin("real terrain");
    assert_true(for_each_dem(check_walks) >= 3);
}

int main(void) {
    random_announce();
    GDALAllRegister();
    const struct CMUnitTest tests[] = {
        TEST(errors_of_real_terrain_equal_the_oracles),
        TEST(meshes_of_real_terrain_equal_the_oracles_in_every_block_size),
    };
    return cmocka_run_group_tests_name("real terrain", tests, NULL, NULL);
}
