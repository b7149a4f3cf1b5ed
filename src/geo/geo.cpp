/* geo.cpp - the version, and the ellipsoid of a CRS. */
#include "internal.h"

#include <GeographicLib/Config.h>

#include <cmath>
#include <cstring>

extern "C" const char *geo_version(void) {
    return GEOGRAPHICLIB_VERSION_STRING;
}

/* A number as WKT writes it: with a point, whatever the locale. */
static bool read_number(const char **text, double *value) {
    const char *p = *text;
    double v = 0, unit = 1;
    bool any = false;
    for (; *p >= '0' && *p <= '9'; p++, any = true) v = 10 * v + (*p - '0');
    if (*p == '.')
        for (p++; *p >= '0' && *p <= '9'; p++, any = true) {
            v = 10 * v + (*p - '0');
            unit *= 10;
        }
    if (any && (*p == 'e' || *p == 'E')) return false;
    *text = p;
    *value = v / unit;
    return any;
}

extern "C" int geo_ellipsoid_of_wkt(const char *wkt, geo_ellipsoid *out) {
    const char *p = std::strstr(wkt, "SPHEROID[");
    const char *const q = std::strstr(wkt, "ELLIPSOID[");
    if (!p || (q && q < p)) p = q;
    if (p) p = std::strchr(p, '"');
    if (p) p = std::strchr(p + 1, '"');
    double a = 0, inverse = 0;
    if (!p || p[1] != ',') return 0;
    p += 2;
    if (!read_number(&p, &a) || *p++ != ',' || !read_number(&p, &inverse)) return 0;
    if (!(a > 1000 && a < 1e9) || (inverse != 0 && !(inverse > 10))) return 0;
    *out = geo_ellipsoid{a, inverse == 0 ? 0 : 1 / inverse};
    return 1;
}
