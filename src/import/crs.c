/* crs.c - what the terrain needs to know of a coordinate reference system. */
#include "source.h"

#include <cpl_conv.h>
#include <cpl_string.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define DEGREE (M_PI / 180)
#define EQUATOR 6378137.0 /* metres: one constant for every ellipsoid, the cost of an outline needs no better */

bool import_crs_is_same(OGRSpatialReferenceH a, OGRSpatialReferenceH b) {
    static const char *const how[] = {"IGNORE_DATA_AXIS_TO_SRS_AXIS_MAPPING=YES",
                                      "CRITERION=EQUIVALENT_EXCEPT_AXIS_ORDER_GEOGCRS", NULL};
    if (a == b) return true;
    if (!a || !b) return false;
    return OSRIsSameEx(a, b, how) != 0;
}

const char *import_crs_name(OGRSpatialReferenceH crs) {
    if (!crs) return "none";
    const char *name = OSRGetName(crs);
    return name && *name ? name : "unnamed";
}

static bool is_degrees(OGRSpatialReferenceH crs) {
    return fabs(OSRGetAngularUnits(crs, NULL) - DEGREE) < 1e-12;
}

/* Geographic, on WGS 84, in degrees from Greenwich: alike EPSG:4326 but for the order of the axes and for heights.
 */
static bool is_wgs84(OGRSpatialReferenceH crs) {
    OGRSpatialReferenceH flat = OSRCloneGeogCS(crs), epsg = OSRNewSpatialReference(NULL);
    bool same = false;
    if (flat && epsg && OSRImportFromEPSG(epsg, 4326) == OGRERR_NONE) {
        OSRDemoteTo2D(flat, NULL);
        same = import_crs_is_same(flat, epsg);
    }
    if (flat && !same) {
        /* The same datum under the names that WKT dialects give it. */
        const char *datum = OSRGetAttrValue(flat, "DATUM", 0);
        same =
            datum && is_degrees(flat) && fabs(OSRGetPrimeMeridian(flat, NULL)) < 1e-12 &&
            (EQUAL(datum, "WGS_1984") || EQUAL(datum, "D_WGS_1984") || EQUAL(datum, "World Geodetic System 1984"));
    }
    if (flat) OSRDestroySpatialReference(flat);
    if (epsg) OSRDestroySpatialReference(epsg);
    return same;
}

/* The EPSG code of the horizontal part: regions and results are x and y, the vertical part has a column of its own.
 */
static int32_t srid_of(OGRSpatialReferenceH crs) {
    const char *part = OSRIsProjected(crs) ? "PROJCS" : OSRIsGeographic(crs) ? "GEOGCS" : NULL;
    const char *authority = OSRGetAuthorityName(crs, part), *code = OSRGetAuthorityCode(crs, part);
    if (!authority || !EQUAL(authority, "EPSG") || !code) return 0;
    long value = strtol(code, NULL, 10);
    return value > 0 && value <= INT32_MAX ? (int32_t)value : 0;
}

static int32_t srid_find(OGRSpatialReferenceH crs) {
    int32_t srid = srid_of(crs);
    if (srid) return srid;
    OGRSpatialReferenceH guess = OSRClone(crs);
    if (guess && OSRAutoIdentifyEPSG(guess) == OGRERR_NONE) srid = srid_of(guess);
    if (guess) OSRDestroySpatialReference(guess);
    return srid;
}

bool import_crs_describe(OGRSpatialReferenceH crs, import_crs *out) {
    *out = (import_crs){.metres = 1};
    if (crs) {
        char *wkt = NULL;
        bool exported = OSRExportToWkt(crs, &wkt) == OGRERR_NONE && wkt;
        out->wkt = strdup(exported ? wkt : "");
        CPLFree(wkt);
        const char *vertical = OSRIsCompound(crs) ? OSRGetAttrValue(crs, "VERT_CS", 0) : NULL;
        out->vertical = strdup(vertical ? vertical : "");
        bool angles = OSRIsGeographic(crs) != 0;
        out->lonlat = angles && is_degrees(crs);
        out->wgs84 = out->lonlat && is_wgs84(crs);
        out->srid = srid_find(crs);
        if (!out->srid && out->wgs84)
            out->srid = 4326; /* OGC:CRS84 and the like: the same coordinates, as we order them */
        double metres = angles ? OSRGetAngularUnits(crs, NULL) * EQUATOR : OSRGetLinearUnits(crs, NULL);
        if (isfinite(metres) && metres > 0) out->metres = metres;
    } else {
        out->wkt = strdup("");
        out->vertical = strdup("");
    }
    if (out->wkt && out->vertical) return true;
    import_crs_free(out);
    return false;
}

double import_crs_cell(const import_crs *crs, const rqt_placement *placement) {
    double step = fmax(fabs(placement->dx), fabs(placement->dy));
    /* Degrees by the expression of the format's own description, so that every importer gets the same double. */
    return crs->lonlat ? step * M_PI / 180 * EQUATOR : step * crs->metres;
}

void import_crs_free(import_crs *crs) {
    free(crs->wkt);
    free(crs->vertical);
    *crs = (import_crs){0};
}
