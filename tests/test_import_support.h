/* test_import_support.h - what the test programs of the import share: a temporary folder, rasters made with GDAL,
 * imports that must be fine or must be refused with a phrase, and terrains read back as metres or byte for byte.
 * Each program has its own folder, so they may run at the same time. Links: import, store, core, GDAL, SQLite,
 * cmocka. */
#ifndef TEST_IMPORT_SUPPORT_H
#define TEST_IMPORT_SUPPORT_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <cmocka.h>

#include <cpl_conv.h>
#include <cpl_error.h>
#include <cpl_string.h>
#include <cpl_vsi.h>
#include <gdal.h>
#include <ogr_srs_api.h>

#include "import.h"

#define LENGTH(a) (sizeof(a) / sizeof *(a))

/* ---------------------------------------------------------------------------------------- temporary files -- */
static char folder[64];
static char notices[4096]; /* every notice of the last import, one a line */
static char message[1024];
static import_report report;

static inline const char *file(const char *name) {
    static char paths[64][256];
    static size_t next;
    char *path = paths[next++ % LENGTH(paths)];
    snprintf(path, sizeof paths[0], "%s/%s", folder, name);
    return path;
}

static inline int begin_all(void **state) {
    (void)state;
    GDALAllRegister();
    const char *base = getenv("TMPDIR");
    (void)snprintf(folder, sizeof folder, "%s/rqt_import_XXXXXX", base && strlen(base) < 40 ? base : "/tmp");
    return mkdtemp(folder) ? chmod(folder, 0777) : -1;
}

static inline int end_all(void **state) {
    (void)state;
    return VSIRmdirRecursive(folder);
}

/* Every test starts in an empty folder. */
static inline int begin(void **state) {
    (void)state;
    char **names = VSIReadDir(folder);
    for (char **name = names; name && *name; name++)
        if (strcmp(*name, ".") && strcmp(*name, "..")) VSIRmdirRecursive(file(*name)), VSIUnlink(file(*name));
    CSLDestroy(names);
    notices[0] = message[0] = 0;
    return 0;
}

static inline bool exists(const char *path) {
    struct stat s;
    return stat(path, &s) == 0;
}

/* ---------------------------------------------------------------------------------------------- rasters -- */
static const double north_up[6] = {500000, 10, 0, 4000000, 0, -10};

typedef struct raster {
    const char *name, *driver; /* NULL: GTiff */
    int width, height, bands;  /* 0 bands: 1 */
    GDALDataType type;
    const double *place; /* NULL: north_up */
    bool no_place;
    int epsg; /* 0: 32633, -1: none */
    const char *nodata, *unit, *options[3];
    double scale, offset;
    const uint8_t *mask;
} raster;

/* Write a raster of doubles, which GDAL makes numbers of its type. Returns its path. */
static inline const char *write_raster(const raster *r, const double *values) {
    const char *path = file(r->name);
    const char *const options[] = {r->options[0], r->options[1], NULL};
    GDALDriverH driver = GDALGetDriverByName(r->driver ? r->driver : "GTiff");
    GDALDatasetH d = GDALCreate(driver, path, r->width, r->height, r->bands ? r->bands : 1, r->type,
                                (CSLConstList)(r->options[0] ? options : NULL));
    assert_non_null(d);
    if (!r->no_place) {
        double g[6];
        memcpy(g, r->place ? r->place : north_up, sizeof g);
        assert_int_equal(GDALSetGeoTransform(d, g), CE_None);
    }
    if (r->epsg >= 0) {
        OGRSpatialReferenceH crs = OSRNewSpatialReference(NULL);
        assert_int_equal(OSRImportFromEPSG(crs, r->epsg ? r->epsg : 32633), OGRERR_NONE);
        GDALSetSpatialRef(d, crs);
        OSRDestroySpatialReference(crs);
    }
    for (int b = 1; b <= (r->bands ? r->bands : 1); b++) {
        GDALRasterBandH band = GDALGetRasterBand(d, b);
        if (r->nodata && r->type == GDT_Int64)
            GDALSetRasterNoDataValueAsInt64(band, strtoll(r->nodata, NULL, 10));
        else if (r->nodata)
            GDALSetRasterNoDataValue(band, CPLAtof(r->nodata));
        if (r->unit) GDALSetRasterUnitType(band, r->unit);
        if (r->scale != 0) GDALSetRasterScale(band, r->scale), GDALSetRasterOffset(band, r->offset);
        assert_int_equal(GDALRasterIO(band, GF_Write, 0, 0, r->width, r->height, (void *)(uintptr_t)values,
                                      r->width, r->height, GDT_Float64, 0, 0),
                         CE_None);
        if (r->mask) {
            assert_int_equal(GDALCreateMaskBand(band, GMF_PER_DATASET), CE_None);
            assert_int_equal(GDALRasterIO(GDALGetMaskBand(band), GF_Write, 0, 0, r->width, r->height,
                                          (void *)(uintptr_t)r->mask, r->width, r->height, GDT_Byte, 0, 0),
                             CE_None);
        }
    }
    GDALClose(d);
    return path;
}

static uint32_t state = 1;
static inline double uniform(void) {
    state = state * 1664525u + 1013904223u;
    return (state >> 8) / 16777216.0;
}

/* Hills with some roughness, whole numbers when step is 1. */
static inline void fill(double *values, int width, int height, double step) {
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++)
            values[y * width + x] = rint((300 + 90 * sin(x * 0.21) * cos(y * 0.17) + 8 * uniform()) / step) * step;
}

/* ---------------------------------------------------------------------------------------------- imports -- */
static inline void notice(void *context, const char *sentence) {
    (void)context;
    size_t n = strlen(notices);
    snprintf(notices + n, sizeof notices - n, "%s\n", sentence);
}

static inline import_options defaults(void) {
    import_options o;
    import_options_init(&o);
    o.notice = notice;
    o.k = 3;
    return o;
}

static inline int import_many(const char *const *sources, int count, const char *database,
                              const import_options *o) {
    notices[0] = 0;
    return import_run(sources, count, database, o, &report, message, sizeof message);
}

static inline void import_fine(const char *source, const char *database, const import_options *o) {
    if (import_many(&source, 1, database, o)) fail_msg("%s", message);
    assert_string_equal(message, "");
}

static inline void import_refused(const char *source, const char *database, const import_options *o,
                                  const char *phrase) {
    assert_int_equal(import_many(&source, 1, database, o), 1);
    if (!strstr(message, phrase)) fail_msg("'%s' does not say '%s'", message, phrase);
}

/* ------------------------------------------------------------------------------------------ reading back -- */
typedef struct terrain {
    sqlite3 *db;
    store *store;
    const store_terrain *t;
    int32_t *q;
    uint8_t *valid;
} terrain;

static inline terrain open_terrain(const char *path, const char *name) {
    terrain r = {0};
    char *error = NULL;
    assert_int_equal(sqlite3_open_v2(path, &r.db, SQLITE_OPEN_READONLY, NULL), SQLITE_OK);
    assert_int_equal(store_open(r.db, &r.store), SQLITE_OK);
    if (store_find(r.store, name, &r.t, &error)) fail_msg("%s", error);
    size_t n = (size_t)r.t->lattice.width * (size_t)r.t->lattice.height;
    r.q = calloc(n, sizeof *r.q);
    r.valid = calloc(n, 1);
    if (store_window(r.store, r.t, 0, 0, r.t->lattice.width, r.t->lattice.height, r.q, r.valid, &error))
        fail_msg("%s", error);
    return r;
}

static inline void close_terrain(terrain *r) {
    free(r->q);
    free(r->valid);
    store_close(r->store);
    assert_int_equal(sqlite3_close(r->db), SQLITE_OK);
}

/* Metres of sample n, by the contract's expression written out here; NaN for a void. */
static inline double metres(const terrain *r, size_t n) {
    const rqt_unit *u = &r->t->unit;
    if (!r->valid[n]) return NAN;
    double f = u->scale * u->numerator / u->denominator;
    return ((double)u->z0 + r->q[n] / (double)u->d) * f + u->offset;
}

static inline void expect_metres(const terrain *r, const double *wanted) {
    size_t n = (size_t)r->t->lattice.width * (size_t)r->t->lattice.height;
    for (size_t i = 0; i < n; i++) {
        double z = metres(r, i);
        if (isnan(wanted[i]) ? !isnan(z) : z != wanted[i])
            fail_msg("sample %zu is %.17g and not %.17g", i, z, wanted[i]);
    }
}

static inline void expect_file_metres(const char *database, const double *wanted) {
    terrain r = open_terrain(database, NULL);
    expect_metres(&r, wanted);
    close_terrain(&r);
}

/* Every value of a query as one text, so that tables can be compared byte for byte. */
static inline char *dump(const char *database, const char *sql) {
    sqlite3 *db;
    sqlite3_stmt *s;
    assert_int_equal(sqlite3_open_v2(database, &db, SQLITE_OPEN_READONLY, NULL), SQLITE_OK);
    assert_int_equal(sqlite3_prepare_v2(db, sql, -1, &s, NULL), SQLITE_OK);
    sqlite3_str *out = sqlite3_str_new(NULL);
    while (sqlite3_step(s) == SQLITE_ROW) {
        for (int i = 0; i < sqlite3_column_count(s); i++) {
            const unsigned char *bytes = sqlite3_column_blob(s, i);
            int n = sqlite3_column_bytes(s, i);
            for (int b = 0; b < n; b++) sqlite3_str_appendf(out, "%02x", bytes[b]);
            sqlite3_str_appendchar(out, 1, ' ');
        }
        sqlite3_str_appendchar(out, 1, '\n');
    }
    assert_int_equal(sqlite3_finalize(s), SQLITE_OK);
    sqlite3_close(db);
    char *text = sqlite3_str_finish(out);
    return text ? text : sqlite3_mprintf("");
}

static inline void expect_same_tables(const char *a, const char *b) {
    static const char *const queries[] = {
        "SELECT id, summary, data FROM rqt_block_1 ORDER BY id", "SELECT * FROM rqt_index_1 ORDER BY id",
        "SELECT width, height, k, blocks, bytes, max_error, voids FROM rqt_terrain"};
    for (size_t i = 0; i < LENGTH(queries); i++) {
        char *left = dump(a, queries[i]), *right = dump(b, queries[i]);
        assert_true(strlen(left) > 0);
        if (strcmp(left, right)) fail_msg("%s differs", queries[i]);
        sqlite3_free(left);
        sqlite3_free(right);
    }
}

#endif
