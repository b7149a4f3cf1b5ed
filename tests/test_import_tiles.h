/* test_import_tiles.h - what the tests of imports of many tiles share: tiles of hills, written as GeoTIFF, imports
 * of them in a forced way, databases that must be equal, and reports read back. */
#ifndef TEST_IMPORT_TILES_H
#define TEST_IMPORT_TILES_H

#include "test_import_support.h"

#include <cjson/cJSON.h>

#include "parts.h"

/* ------------------------------------------------------------------------------------------------- tiles -- */
typedef struct tile {
    char path[300];
    int x, y, width, height;
    double *values; /* NaN: void */
} tile;

static tile tiles[2600];
static int count, epsg = 32633;
static const char *paths[2600];

static inline double hill(int x, int y) {
    return rint(300 + 90 * sin(x * 0.21) * cos(y * 0.17) + 31 * sin(x * 0.043 + y * 0.031) + (x * 7 + y * 13) % 5);
}

static inline void forget_tiles(void) {
    for (int i = 0; i < count; i++) free(tiles[i].values);
    count = 0;
}

/* A tile of hills; its file is written by write_tile. */
static inline tile *add_tile(const char *folder_name, int x, int y, int width, int height) {
    tile *t = &tiles[count];
    *t = (tile){.x = x, .y = y, .width = width, .height = height};
    snprintf(t->path, sizeof t->path, "%s/%st%04d.tif", folder, folder_name, count);
    t->values = malloc(sizeof(double) * (size_t)(width * height));
    for (int v = 0; v < height; v++)
        for (int u = 0; u < width; u++) t->values[v * width + u] = hill(x + u, y + v);
    paths[count++] = t->path;
    return t;
}

static inline void write_tile(const tile *t) {
    const double place[6] = {500000 + 10.0 * t->x, 10, 0, 4000000 - 10.0 * t->y, 0, -10};
    const size_t n = (size_t)t->width * (size_t)t->height;
    double *values = malloc(sizeof(double) * n);
    for (size_t i = 0; i < n; i++) values[i] = isnan(t->values[i]) ? -9999 : t->values[i];
    raster r = {.name = t->path + strlen(folder) + 1,
                .width = t->width,
                .height = t->height,
                .type = GDT_Int16,
                .nodata = "-9999",
                .epsg = epsg,
                .place = place};
    write_raster(&r, values);
    free(values);
}

static inline void write_tiles(void) {
    for (int i = 0; i < count; i++) write_tile(&tiles[i]);
}

static inline int64_t samples_of_tiles(void) {
    int64_t n = 0;
    for (int i = 0; i < count; i++) n += (int64_t)tiles[i].width * tiles[i].height;
    return n;
}

/* across x down tiles of side samples; neighbours share their border, or abut. */
static inline void make_grid(const char *folder_name, int across, int down, int side, bool shared) {
    const int step = shared ? side - 1 : side;
    for (int j = 0; j < down; j++)
        for (int i = 0; i < across; i++) add_tile(folder_name, i * step, j * step, side, side);
    write_tiles();
}

static import_report national;

static inline int import_forced(const char *const *sources, int n, const char *database, const import_options *o,
                                const import_force *force) {
    notices[0] = 0;
    return import_run_forced(sources, n, database, o, force, &national, message, sizeof message);
}

static inline void forced_fine(const char *const *sources, int n, const char *database, const import_options *o,
                               const import_force *force) {
    if (import_forced(sources, n, database, o, force)) fail_msg("%s", message);
}

static inline void says(const char *where, const char *phrase) {
    if (!strstr(where, phrase)) fail_msg("'%s' does not say '%s'", where, phrase);
}

static inline const char *spool_of(const char *database, const char *name) {
    static char path[400];
    snprintf(path, sizeof path, "%s.%s.rqt-import", database, name);
    return path;
}

static inline void expect_all_equal(const char *a, const char *b) {
    static const char *const queries[] = {"SELECT format, complete, width, height, k, x0, y0, dx, dy, z0, d, cell, "
                                          "voids, min_q, max_q, blocks, bytes, "
                                          "max_error FROM rqt_terrain"};
    expect_same_tables(a, b);
    for (size_t i = 0; i < LENGTH(queries); i++) {
        char *left = dump(a, queries[i]), *right = dump(b, queries[i]);
        if (strcmp(left, right)) fail_msg("%s differs:\n%s%s", queries[i], left, right);
        sqlite3_free(left);
        sqlite3_free(right);
    }
}

/* Two strips are read ahead at most: a stop comes before all is read. */
static const import_force two_readings = {
    .two_readings = true, .strip_rows = 5, .strips = 2, .stage = -1, .kept = -1};

static inline void expect_hills(const char *database, int width, int height) {
    double *wanted = malloc(sizeof(double) * (size_t)(width * height));
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) wanted[y * width + x] = hill(x, y);
    expect_file_metres(database, wanted);
    free(wanted);
}

static inline cJSON *read_json(const char *path) {
    FILE *f = fopen(path, "rb");
    assert_non_null(f);
    static char text[1 << 20];
    text[fread(text, 1, sizeof text - 1, f)] = 0;
    fclose(f);
    cJSON *json = cJSON_Parse(text);
    if (!json) fail_msg("no JSON: %.300s", text);
    return json;
}

static inline double number(const cJSON *o, const char *key) {
    const cJSON *n = cJSON_GetObjectItem(o, key);
    if (!cJSON_IsNumber(n)) fail_msg("%s is missing", key);
    return n->valuedouble;
}

static inline int begin_tiles(void **unused) {
    forget_tiles();
    return begin(unused);
}

#endif
