/* earth.c - places and directions on WGS 84 in space. What two tiles share goes through the same operations in the
 * same order in both, so that it has the same doubles. */
#include "earth.h"

#include <math.h>

#define E2 (EARTH_F * (2 - EARTH_F))

void earth_angles_clear(earth_angles *angles) {
    for (int i = 0; i < EARTH_KEPT; i++) angles->kept[i] = (earth_angle){.cosine = 1, .across = EARTH_A};
}

const earth_angle *earth_angle_of(earth_angles *angles, int number, double degrees) {
    earth_angle *k = &angles->kept[number % EARTH_KEPT];
    if (k->degrees == degrees) return k;
    const double sine = sin(degrees * DEGREE);
    *k = (earth_angle){degrees, sine, cos(degrees * DEGREE), EARTH_A / sqrt(1 - E2 * sine * sine)};
    return k;
}

void earth_place(const earth_angle *lon, const earth_angle *lat, double height, double xyz[3]) {
    const double n = lat->across;
    xyz[0] = (n + height) * lat->cosine * lon->cosine;
    xyz[1] = (n + height) * lat->cosine * lon->sine;
    xyz[2] = (n * (1 - E2) + height) * lat->sine;
}

void earth_turn(const earth_angle *lon, const earth_angle *lat, const double enu[3], double xyz[3]) {
    const double outward = lat->cosine * enu[2] - lat->sine * enu[1]; /* from the axis */
    xyz[0] = lon->cosine * outward - lon->sine * enu[0];
    xyz[1] = lon->sine * outward + lon->cosine * enu[0];
    xyz[2] = lat->cosine * enu[1] + lat->sine * enu[2];
}
