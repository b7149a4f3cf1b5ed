/* source.c - one raster, described or refused.
 *
 * A description is everything that can be known without reading samples. Whatever makes a raster no terrain of ours
 * is refused here with a sentence that begins with its path: not there, not a raster, several bands, complex
 * numbers, rotated, no cell size. The dataset is closed again: read.c opens it when its turn comes.
 */
#define _LARGEFILE64_SOURCE /* VSIStatBufL is a struct stat64 */
#include "source.h"

#include <cpl_conv.h>
#include <cpl_error.h>
#include <cpl_string.h>
#include <cpl_vsi.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* How far, in cells, the far corner of a raster may lie off because of a rotation that is only rounding. */
#define ROTATION_SLACK 1e-6

static GDALDatasetH dataset_open(const char *path) {
    return GDALOpenEx(path, GDAL_OF_RASTER | GDAL_OF_READONLY | GDAL_OF_VERBOSE_ERROR, NULL, NULL, NULL);
}

/* A .zip that GDAL does not open as it is (it does open .hgt.zip): the one raster inside. NULL with the sentence
 * when there is none or a choice. */
static GDALDatasetH archive_open(const import_job *job, const char *path, char **opened) {
    GDALDatasetH found = NULL;
    char *archive = CPLStrdup(CPLSPrintf("/vsizip/{%s}", path));
    char **members = VSIReadDirRecursive(archive);
    int rasters = 0;
    for (char **member = members; member && *member; member++) {
        size_t length = strlen(*member);
        if (!length || (*member)[length - 1] == '/') continue;
        char *inside = CPLStrdup(CPLSPrintf("%s/%s", archive, *member));
        GDALDatasetH dataset =
            GDALIdentifyDriverEx(inside, GDAL_OF_RASTER, NULL, NULL) ? dataset_open(inside) : NULL;
        if (dataset && GDALGetRasterCount(dataset) > 0 && ++rasters == 1) {
            found = dataset;
            *opened = strdup(inside);
        } else if (dataset) {
            GDALClose(dataset);
        }
        CPLFree(inside);
    }
    CSLDestroy(members);
    CPLFree(archive);
    if (rasters == 1 && *opened) return found;
    if (found) GDALClose(found);
    free(*opened);
    *opened = NULL;
    if (rasters > 1)
        import_refuse(job, "%s: the archive holds %d rasters; name one as /vsizip/%s/FILE", path, rasters, path);
    else
        import_refuse(job, "%s: the archive holds no raster that GDAL reads", path);
    return NULL;
}

static bool ends_with(const char *text, const char *end) {
    size_t n = strlen(text), m = strlen(end);
    return n >= m && EQUAL(text + n - m, end);
}

/* What GDAL says about a file that it does not open, without what our sentence says already: the path, and that the
 * format is none it knows. Its `quotes' become plain ones. */
static char *reason_of(const char *said, const char *path) {
    static const char unknown[] = "not recognized as", format[] = "file format";
    const size_t length = strlen(path);
    const char *quoted = *said == '`' || *said == '\'' ? said + 1 : said;
    if (!strncmp(quoted, path, length)) said = quoted + length + strspn(quoted + length, "': ,");
    const char *known = strncmp(said, unknown, sizeof unknown - 1) ? NULL : strstr(said, format);
    if (known) said = known + sizeof format - 1;
    char *reason = CPLStrdup(said + strspn(said, ". "));
    for (char *at = reason; *at; at++)
        if (*at == '`') *at = '\'';
    size_t end = strlen(reason);
    while (end && (reason[end - 1] == '.' || reason[end - 1] == ' ')) reason[--end] = 0;
    return reason;
}

static GDALDatasetH source_open(const import_job *job, const char *path, char **opened) {
    *opened = NULL;
    CPLErrorReset();
    GDALDatasetH dataset = dataset_open(path);
    if (dataset) {
        *opened = strdup(path);
        if (*opened) return dataset;
        GDALClose(dataset);
        import_no_memory(job, "opening a source");
        return NULL;
    }
    char *why = reason_of(CPLGetLastErrorMsg(), path);
    VSIStatBufL file;
    errno = 0;
    bool there = VSIStatL(path, &file) == 0;
    if (there && ends_with(path, ".zip"))
        dataset = archive_open(job, path, opened);
    else if (there && VSI_ISDIR(file.st_mode))
        import_refuse(job, "%s is a folder and not a raster", path);
    else if (!there && !strchr(path, ':') && errno)
        import_refuse(job, "%s: %s", path, strerror(errno));
    else
        import_refuse(job, "%s is not a raster that GDAL reads%s%s", path, *why ? ": " : "", why);
    CPLFree(why);
    return dataset;
}

/* Place of the north-west sample and the order of rows and columns. A geotransform speaks of pixel corners (GDAL
 * has moved rasters whose pixels are points), samples sit at pixel centres. */
static bool describe_place(const import_job *job, GDALDatasetH dataset, import_source *s) {
    double g[6] = {0, 1, 0, 0, 0, 1};
    static const double none[6] = {0, 1, 0, 0, 0, 1};
    /* Some drivers say "yes" and hand over the identity when they know of no place. */
    s->placed = GDALGetGeoTransform(dataset, g) == CE_None && memcmp(g, none, sizeof g) != 0;
    if (!s->placed) {
        s->placement = (rqt_placement){0, 0, 1, -1};
        if (GDALGetGCPCount(dataset) > 0)
            import_notice(job,
                          "%s has ground control points and no geotransform: samples are placed by column and row",
                          s->path);
        return true;
    }
    for (int i = 0; i < 6; i++)
        if (!isfinite(g[i])) return import_refuse(job, "%s: its geotransform is not finite", s->path);
    if (fabs(g[2]) * s->height > ROTATION_SLACK * fabs(g[1]) || fabs(g[4]) * s->width > ROTATION_SLACK * fabs(g[5]))
        return import_refuse(job,
                             "%s is rotated (its geotransform has the terms %g and %g); resample it first, for "
                             "example with gdalwarp",
                             s->path, g[2], g[4]);
    if (g[1] == 0 || g[5] == 0) return import_refuse(job, "%s: its cell size is 0 (%g x %g)", s->path, g[1], g[5]);
    s->flip_columns = g[1] < 0;
    s->flip_rows = g[5] > 0;
    double x = g[0] + g[1] / 2, y = g[3] + g[5] / 2;
    if (s->flip_columns) x += (s->width - 1) * g[1];
    if (s->flip_rows) y += (s->height - 1) * g[5];
    s->placement = (rqt_placement){x, y, fabs(g[1]), -fabs(g[5])};
    return true;
}

static bool describe_type(const import_job *job, GDALRasterBandH band, import_source *s) {
    s->type = GDALGetRasterDataType(band);
    if (GDALDataTypeIsComplex(s->type))
        return import_refuse(job, "%s has complex numbers (%s), heights are real", s->path,
                             GDALGetDataTypeName(s->type));
    int bits = GDALGetDataTypeSizeBits(s->type);
    s->is_float = GDALDataTypeIsFloating(s->type) != 0;
    if (!s->is_float && !GDALDataTypeIsInteger(s->type))
        return import_refuse(job, "%s has samples of an unknown type", s->path);
    s->is_single = s->is_float ? bits <= 32 : bits <= 16;
    s->is_wide = !s->is_float && (bits > 32 || s->type == GDT_UInt32);
    const char *pixels = GDALGetMetadataItem(band, "PIXELTYPE", "IMAGE_STRUCTURE");
    s->is_signed_byte = s->type == GDT_Byte && pixels && EQUAL(pixels, "SIGNEDBYTE");
    return true;
}

/* What one raw value is worth: the user's unit, else the band's, else the vertical CRS's, else the metre. */
static bool describe_unit(const import_job *job, GDALRasterBandH band, import_source *s) {
    int given = 0;
    double scale = GDALGetRasterScale(band, &given);
    s->scale = given ? scale : 1;
    double offset = GDALGetRasterOffset(band, &given);
    s->offset = given ? offset : 0;
    if (!isfinite(s->scale) || s->scale == 0 || !isfinite(s->offset))
        return import_refuse(job, "%s: its band has the scale %g and the offset %g", s->path, s->scale, s->offset);

    const char *name = GDALGetRasterUnitType(band);
    if (job->options->unit) {
        import_unit_parse(job->options->unit, &s->unit); /* the options were checked before */
    } else if (name && *name) {
        if (!import_unit_parse(name, &s->unit))
            import_notice(job, "%s: its unit of height, '%s', is unknown: taken as metres (--unit says otherwise)",
                          s->path, name);
    } else {
        import_unit_parse("", &s->unit);
        double metres = s->crs && OSRIsCompound(s->crs) ? OSRGetTargetLinearUnits(s->crs, "VERT_CS", NULL) : 1;
        if (isfinite(metres) && metres > 0) s->unit = import_unit_of_metres(metres);
        if (s->unit.plain != 1 || s->unit.numerator != 1)
            import_notice(job,
                          "%s: its heights are in the unit of its vertical CRS, %.10g m (--unit says otherwise)",
                          s->path, metres);
    }
    return true;
}

static void describe_voids(GDALRasterBandH band, import_source *s) {
    int given = 0;
    if (s->type == GDT_Int64) {
        s->nodata_integer = GDALGetRasterNoDataValueAsInt64(band, &given);
        s->nodata = (double)s->nodata_integer;
        s->has_nodata = given != 0;
    } else if (s->type == GDT_UInt64) {
        uint64_t value = GDALGetRasterNoDataValueAsUInt64(band, &given);
        /* Read as int64, where GDAL clamps: what lies beyond is the largest. */
        s->nodata_integer = value > INT64_MAX ? INT64_MAX : (int64_t)value;
        s->nodata = (double)value;
        s->has_nodata = given != 0;
    } else {
        s->nodata = GDALGetRasterNoDataValue(band, &given);
        /* A value that an integer band cannot hold (NaN, -9999.5, 1e300) marks nothing. */
        bool fits = fabs(s->nodata) < 9e15 && s->nodata == rint(s->nodata);
        s->has_nodata = given && (s->is_float || fits);
        if (fits) s->nodata_integer = (int64_t)s->nodata;
    }
    int flags = GDALGetMaskFlags(band);
    s->has_mask = !(flags & (GMF_ALL_VALID | GMF_NODATA));
}

/* The files of a dataset, and what opened it (the member of an archive): is the database, which is written, among
 * those that are read? And a hash of their sizes and times. */
static bool look_at_files(const import_job *job, GDALDatasetH dataset, import_source *s) {
    struct stat database, file;
    const bool there = !stat(job->database, &database);
    bool same = false;
    char **files = GDALGetFileList(dataset);
    files = CSLAddString(files, s->path);
    files = CSLAddString(files, s->opened);
    for (char **name = files; name && *name; name++) {
        VSIStatBufL any;
        int64_t facts[3] = {0};
        if (!stat(*name, &file)) {
            same = same || (there && file.st_dev == database.st_dev && file.st_ino == database.st_ino);
            facts[0] = file.st_size;
            facts[1] = file.st_mtim.tv_sec;
            facts[2] = file.st_mtim.tv_nsec;
        } else if (!VSIStatL(*name, &any)) {
            facts[0] = (int64_t)any.st_size;
            facts[1] = any.st_mtime;
        }
        s->content = import_mix(import_mix(s->content, *name, strlen(*name)), facts, sizeof facts);
    }
    CSLDestroy(files);
    return !same;
}

bool import_source_describe(const import_job *job, const char *path, import_source *s) {
    *s = (import_source){.path = path, .unit = {1, 1, 1}};
    GDALDatasetH dataset = source_open(job, path, &s->opened);
    if (!dataset) return false;
    bool ok = false;
    s->base = strdup(CPLGetFilename(path));
    int bands = GDALGetRasterCount(dataset);
    if (!s->base) {
        import_no_memory(job, "describing a source");
    } else if (!look_at_files(job, dataset, s)) {
        import_refuse(job, "%s is part of the source %s and cannot be the database too", job->database, path);
    } else if (bands == 0) {
        bool parts = GDALGetMetadata(dataset, "SUBDATASETS") != NULL;
        import_refuse(job, "%s holds no raster band%s", path,
                      parts ? " of its own; name one of its subdatasets (gdalinfo lists them)" : "");
    } else if (bands > 1) {
        import_refuse(job, "%s has %d bands; a terrain is one band (pick it with gdal_translate -b N)", path,
                      bands);
    } else {
        GDALRasterBandH band = GDALGetRasterBand(dataset, 1);
        s->width = GDALGetRasterXSize(dataset);
        s->height = GDALGetRasterYSize(dataset);
        GDALGetBlockSize(band, &s->block_columns, &s->block_rows);
        OGRSpatialReferenceH crs = GDALGetSpatialRef(dataset);
        if (crs) {
            s->crs = OSRClone(crs);
            if (s->crs) OSRSetAxisMappingStrategy(s->crs, OAMS_TRADITIONAL_GIS_ORDER);
        }
        ok = describe_type(job, band, s) && describe_place(job, dataset, s) && describe_unit(job, band, s);
        if (ok) describe_voids(band, s);
    }
    GDALClose(dataset);
    return ok;
}

void import_source_free(import_source *s) {
    free(s->opened);
    free(s->base);
    if (s->crs) OSRRelease(s->crs);
    *s = (import_source){0};
}

void import_source_share_crs(import_source *s, const import_source *other) {
    static const char *const how[] = {"CRITERION=STRICT", NULL};
    if (!s->crs || !other->crs || s->crs == other->crs || !OSRIsSameEx(s->crs, other->crs, how)) return;
    OSRRelease(s->crs);
    s->crs = other->crs;
    OSRReference(s->crs);
}

rqt_unit import_source_unit(const import_source *s) {
    return (rqt_unit){.d = 1,
                      .numerator = s->unit.numerator,
                      .denominator = s->unit.denominator,
                      .scale = s->scale * s->unit.plain,
                      .offset = s->offset * s->unit.plain * s->unit.numerator / s->unit.denominator};
}
