/* frame.cpp - points in space, and what a flat triangle in space is off.
 *
 * A mesh is straight in longitude, latitude and height: within a triangle, height is linear in lon,lat. Drawn in
 * space, its triangles are flat between their corners, and the Earth is not. Let F map (lon,lat,h) into space, p a
 * place of a triangle with corners v_i, p = sum w_i v_i. By Taylor about p, whose linear terms cancel,
 *
 *     | sum w_i F(v_i) - F(p) |  <=  1/2 sum w_i max |D2F[d_i,d_i]|,   d_i = v_i - p
 *
 * With the radii of curvature M along the meridian and N across it, and the frame east, north, up of a place:
 *
 *     F_lon,lon = (N+h) cos(lat), north and up      F_lon,lat = (M+h) sin(lat), east
 *     F_lat,lat = M+h up, and M' north              F_lon,h = cos(lat) east,  F_lat,h = 1 north,  F_h,h = 0
 *
 * (lengths of vectors; of F_lat,lat the length is B = sqrt((M+h)^2 + M'^2)). East is at a right angle to the rest:
 *
 *     |D2F[d,d]|  <=  min( A x^2 + B y^2 + 2 C x y,  (A x^2 + B y^2) sqrt(1 + C^2/(A B)) ) + 2 (cos x + y) z
 *
 * for x, y, z = |d_lon|, |d_lat|, |d_h| in radians and metres and A, B, C the largest (N+h) cos, B, (M+h) sin of
 * the extent; the second form because 4 x^2 y^2 A B <= (A x^2 + B y^2)^2. A weighted mean of squares about the mean
 * is at most a quarter of the squared range (Popoviciu), one of products at most the root of two such (Cauchy). So
 * with the ranges X, Y, Z of a triangle in lon, lat, h the whole is at most
 *
 *     1/8 ( min( A X^2 + B Y^2 + 2 C X Y,  (A X^2 + B Y^2) sqrt(1 + C^2/(A B)) ) + 2 (cos X + Y) Z )
 *
 * which holds for triangles of any shape: those clamped at the end of the raster too. Z is the range of all heights
 * of the extent, for the bound must not depend on which triangle it is. With a geoid, h = H + G(lon,lat), not
 * linear: let G' be linear between the corners. Then the above holds for H + G', with the range of G added to Z,
 * and G - G', which is a height, is at most sum w_i |G(p) - G(v_i)| <= (g_lon X + g_lat Y) / 2, g the steepest
 * slopes of G's grid along each axis (bilinear between nodes, so no slope is steeper) and the mean distance from a
 * mean at most half the range.
 *
 * What is measured at a sample is its distance from the triangle over it: at most the vertical error of the mesh in
 * lon,lat,height, which is a length along the normal, plus this. So the sum being at most eps is what a query asks
 * for, by lowering eps.
 */
#include "internal.h"

#include <GeographicLib/Geocentric.hpp>
#include <GeographicLib/LocalCartesian.hpp>
#include <proj.h>

#include <algorithm>
#include <cmath>
#include <mutex>

namespace {

constexpr double DEGREE = 0.017453292519943295, NODES = 4; /* of the geoid's grid, a degree */
constexpr double GEOID_HIGHEST = 120;                      /* metres: EGM96 lies between -107 and 86 */
constexpr double ROUNDING = 1e-8;                          /* metres: doubles at 6.4e6 metres, a dozen operations */

/* Slopes of the geoid, metres per degree, and its range. */
struct relief {
    double lon, lat, low, high;
};

} // namespace

struct geo_frame {
    geo_frame_kind kind;
    geo_ellipsoid ellipsoid;
    GeographicLib::Geocentric geocentric;
    GeographicLib::LocalCartesian local;
    PJ_CONTEXT *context;
    PJ *geoid; /* NULL: heights are the ellipsoid's */

    geo_frame(geo_frame_kind k, const geo_ellipsoid &e, double lon, double lat)
        : kind(k), ellipsoid(e), geocentric(e.a, e.f), local(lat, lon, 0, geocentric), context(nullptr),
          geoid(nullptr) {}
    ~geo_frame() {
        proj_destroy(geoid);
        proj_context_destroy(context);
    }
    geo_frame(const geo_frame &) = delete;
    geo_frame &operator=(const geo_frame &) = delete;

    /* Height of the geoid above the ellipsoid; HUGE_VAL where it has none. */
    double undulation(double lon, double lat) const {
        return proj_trans(
                   geoid, PJ_FWD,
                   proj_coord(std::remainder(lon, 360) * DEGREE, std::clamp(lat, -90.0, 90.0) * DEGREE, 0, 0))
            .xyz.z;
    }

    void open_geoid() {
        context = proj_context_create();
        if (!context) throw std::bad_alloc();
        proj_log_level(context, PJ_LOG_NONE);
        geoid = proj_create(context, "+proj=vgridshift +grids=egm96_15.gtx +multiplier=1");
        if (!geoid || !std::isfinite(undulation(0, 0)))
            throw geo_refusal(
                "heights are above the geoid EGM96, and PROJ does not find its grid egm96_15.gtx (Debian: "
                "package proj-data)");
    }

    /* Of the nodes from column i0 to i1, row j0 to j1, both included. */
    relief measure(int i0, int i1, int j0, int j1) const {
        relief r{0, 0, HUGE_VAL, -HUGE_VAL};
        std::vector<double> before, row(static_cast<std::size_t>(i1 - i0 + 1));
        for (int j = j0; j <= j1; j++) {
            for (int i = i0; i <= i1; i++) {
                const auto at = static_cast<std::size_t>(i - i0);
                row[at] = undulation(i / NODES, j / NODES);
                r.low = std::min(r.low, row[at]);
                r.high = std::max(r.high, row[at]);
                if (i > i0) r.lon = std::max(r.lon, std::fabs(row[at] - row[at - 1]) * NODES);
                if (j > j0) r.lat = std::max(r.lat, std::fabs(row[at] - before[at]) * NODES);
            }
            before = row;
        }
        return r;
    }

    relief measure(const geo_extent &e) const {
        if (!geoid) return {0, 0, 0, 0};
        const int i0 = static_cast<int>(std::floor(e.west * NODES)),
                  i1 = static_cast<int>(std::ceil(e.east * NODES));
        const int j0 = std::max(-360, static_cast<int>(std::floor(e.south * NODES)));
        const int j1 = std::min(360, static_cast<int>(std::ceil(e.north * NODES)));
        if (static_cast<double>(i1 - i0 + 1) * (j1 - j0 + 1) <= 20000) return measure(i0, i1, j0, j1);
        static std::once_flag once; /* of the whole Earth: a million nodes, looked at once */
        static relief whole;
        std::call_once(once, [this] { whole = measure(-720, 720, -360, 360); });
        return whole;
    }
};

extern "C" int geo_frame_create(geo_frame_kind kind, const geo_ellipsoid *ellipsoid, double lon, double lat,
                                int geoid, geo_frame **out, char *message, int message_size) {
    *out = nullptr;
    return geo_guard(message, message_size, [&] {
        geo_frame *frame = new geo_frame(kind, *ellipsoid, lon, lat);
        try {
            if (geoid) frame->open_geoid();
        } catch (...) {
            delete frame;
            throw;
        }
        *out = frame;
    });
}

extern "C" void geo_frame_free(geo_frame *frame) {
    delete frame;
}

extern "C" double geo_frame_height(const geo_frame *frame, const double lonlath[3]) {
    return lonlath[2] + (frame->geoid ? frame->undulation(lonlath[0], lonlath[1]) : 0);
}

extern "C" void geo_frame_place(const geo_frame *frame, const double lonlath[3], double xyz[3]) {
    const double lon = lonlath[0], lat = lonlath[1], h = geo_frame_height(frame, lonlath);
    if (frame->kind == GEO_ECEF)
        frame->geocentric.Forward(lat, lon, h, xyz[0], xyz[1], xyz[2]);
    else
        frame->local.Forward(lat, lon, h, xyz[0], xyz[1], xyz[2]);
}

extern "C" void geo_frame_lonlath(const geo_frame *frame, const double xyz[3], double lonlath[3]) {
    double lon, lat, h;
    if (frame->kind == GEO_ECEF)
        frame->geocentric.Reverse(xyz[0], xyz[1], xyz[2], lat, lon, h);
    else
        frame->local.Reverse(xyz[0], xyz[1], xyz[2], lat, lon, h);
    lonlath[0] = lon;
    lonlath[1] = lat;
    lonlath[2] = h - (frame->geoid ? frame->undulation(lon, lat) : 0);
}

extern "C" geo_geoid geo_frame_geoid(const geo_frame *frame, const geo_extent *e) {
    const relief geoid = frame->measure(*e);
    return {geoid.lon, geoid.lat, std::max(std::fabs(geoid.low), std::fabs(geoid.high))};
}

extern "C" void geo_frame_sag(const geo_frame *frame, const geo_extent *e, int ranks, double *metres) {
    const geo_ellipsoid &ellipsoid = frame->ellipsoid;
    const double e2 = ellipsoid.f * (2 - ellipsoid.f);
    const double least_lat =
        e->south <= 0 && e->north >= 0 ? 0 : std::min(std::fabs(e->south), std::fabs(e->north));
    const double most_lat = std::min(90.0, std::max(std::fabs(e->south), std::fabs(e->north)));
    const double cosine = std::cos(least_lat * DEGREE), sine = std::sin(most_lat * DEGREE);
    const double w2 = 1 - e2 * sine * sine, n = ellipsoid.a / std::sqrt(w2), m = n * (1 - e2) / w2;
    const double h = std::max(std::fabs(e->lowest), std::fabs(e->highest)) + (frame->geoid ? GEOID_HIGHEST : 0);
    const double A = (n + h) * cosine, C = (m + h) * sine;
    const double B = std::hypot(m + h, 1.5 * ellipsoid.a * e2 / (w2 * w2 * std::sqrt(w2)));
    const relief geoid = frame->measure(*e);
    const double heights = e->highest - e->lowest + geoid.high - geoid.low;
    const double widest = (e->east - e->west) * DEGREE, tallest = (e->north - e->south) * DEGREE;
    for (int rank = 0; rank < ranks; rank++) {
        double most = 0;
        const double side = std::ldexp(1.0, rank / 2 + 1);
        for (int turned = 0; turned < 2; turned++) { /* a triangle on a side of a square is half as high */
            const double half = rank % 2 ? 1 : 0.5;
            const double x = std::min(widest, side * e->lon_step * DEGREE * (turned ? half : 1));
            const double y = std::min(tallest, side * e->lat_step * DEGREE * (turned ? 1 : half));
            const double squares = A * x * x + B * y * y;
            const double curved =
                std::min(squares + 2 * C * x * y, A > 0 ? squares * std::sqrt(1 + C * C / (A * B)) : HUGE_VAL);
            const double sag =
                (curved + 2 * (cosine * x + y) * heights) / 8 + (geoid.lon * x + geoid.lat * y) / DEGREE / 2;
            most = std::max(most, sag * (1 + 1e-9) + ROUNDING);
        }
        metres[rank] = most;
    }
}
