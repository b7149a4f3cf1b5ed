/* geo.cpp - geodesic circles.
 *
 * A point of the circle is the end of the geodesic of length `radius` that leaves the centre at some azimuth. This
 * is the boundary of the disc of that radius as long as no shorter way leads to the end, which holds up to pi times
 * the polar radius (19,970 km) on WGS 84; the refusal of poles keeps radii below 10,002 km, so nothing else has to
 * be refused. Geodesic::Direct with LONG_UNROLL tells the longitude without reducing it to one turn: it is lon plus
 * what the geodesic turned, and because no geodesic of the circle gets as far as a pole, that turn is continuous
 * all around.
 *
 * GeographicLib throws, and C cannot catch: whatever it throws ends here, as a sentence.
 */
#include "geo.h"

#include <GeographicLib/Config.h>
#include <GeographicLib/Geodesic.hpp>

#include <cmath>
#include <cstdio>
#include <exception>

namespace {

using GeographicLib::Geodesic;

constexpr double SMALLEST_RADIUS = 1e-3;
constexpr double POLE_MARGIN = 1e-3; /* metres; nearer than that, the ring's longitudes tell nothing */

int refuse(char *message, int message_size, const char *sentence) {
    if (message && message_size > 0) std::snprintf(message, static_cast<std::size_t>(message_size), "%s", sentence);
    return 1;
}

/* A number without decimals, so that the sentence does not depend on the locale. */
int refuse_radius(char *message, int message_size, double distance) {
    if (message && message_size > 0)
        std::snprintf(message, static_cast<std::size_t>(message_size),
                      "the circle reaches a pole, which is %.0f metres from its centre: the radius must be less",
                      std::floor(distance));
    return 1;
}

} // namespace

extern "C" int geo_circle(double lon, double lat, double radius, int n, double *lonlat, char *message,
                          int message_size) {
    try {
        /* Written so that NaN fails. */
        if (!(std::fabs(lon) <= 360))
            return refuse(message, message_size, "the longitude must be a number from -360 to 360");
        if (!(std::fabs(lat) <= 90))
            return refuse(message, message_size, "the latitude must be a number from -90 to 90");
        if (!(radius > 0) || std::isinf(radius))
            return refuse(message, message_size, "the radius must be a positive number of metres");
        if (radius < SMALLEST_RADIUS)
            return refuse(message, message_size, "the radius must be at least a millimetre");
        if (n < 3 || n > GEO_CIRCLE_POINTS || !lonlat)
            return refuse(message, message_size, "a circle is made of 3 to 1000000 points");

        const Geodesic &earth = Geodesic::WGS84();
        double to_pole = 0;
        earth.Inverse(lat, lon, std::copysign(90.0, lat), lon, to_pole);
        if (radius > to_pole - POLE_MARGIN) return refuse_radius(message, message_size, to_pole);

        for (int i = 0; i < n; i++) {
            double azimuth = 90 - 360.0 * i / n; /* clockwise from north, so falling is counter-clockwise */
            double point_lat = 0, point_lon = 0, unused = 0;
            earth.GenDirect(lat, lon, azimuth, false, radius,
                            Geodesic::LATITUDE | Geodesic::LONGITUDE | Geodesic::LONG_UNROLL, point_lat, point_lon,
                            unused, unused, unused, unused, unused, unused);
            lonlat[2 * i] = point_lon;
            lonlat[2 * i + 1] = point_lat;
        }
        return 0;
    } catch (const std::exception &e) {
        return refuse(message, message_size, e.what());
    } catch (...) {
        return refuse(message, message_size, "GeographicLib failed");
    }
}

extern "C" const char *geo_version(void) {
    return GEOGRAPHICLIB_VERSION_STRING;
}
