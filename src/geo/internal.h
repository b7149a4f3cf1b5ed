/* internal.h - what the files of this room share: how a call fails. C++; geo.h is the door. */
#ifndef RQT_GEO_INTERNAL_H
#define RQT_GEO_INTERNAL_H

#include "geo.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <new>
#include <stdexcept>
#include <vector>

struct geo_point {
    double lon, lat;
};

/* The longitude on the turn nearest to another. */
inline double geo_unroll(double lon, double near) {
    return near + std::remainder(lon - near, 360);
}

/* What ends a call with a sentence. */
struct geo_refusal : std::runtime_error {
    using std::runtime_error::runtime_error;
};

/* GeographicLib throws, and C cannot catch: every door runs its work in here. */
template <class Work> int geo_guard(char *message, int message_size, Work work) {
    auto say = [=](const char *sentence) {
        if (message && message_size > 0)
            std::snprintf(message, static_cast<std::size_t>(message_size), "%s", sentence);
    };
    try {
        work();
        return GEO_OK;
    } catch (const std::bad_alloc &) {
        say("out of memory");
        return GEO_NO_MEMORY;
    } catch (const std::exception &e) {
        say(e.what());
    } catch (...) {
        say("GeographicLib failed");
    }
    return GEO_REFUSED;
}

/* A vector's elements as memory that C can free. */
template <class T> T *geo_hand_out(const std::vector<T> &v) {
    T *p = static_cast<T *>(std::malloc(v.size() ? v.size() * sizeof(T) : 1));
    if (!p) throw std::bad_alloc();
    for (std::size_t i = 0; i < v.size(); i++) p[i] = v[i];
    return p;
}

#endif
