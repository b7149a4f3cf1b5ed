// scene.js - the space in which a terrain stands: that of ext/scene.c, so that a camera means the same here and there.
//
// Planar terrains (projected, or without CRS): x and y of the CRS in metres, z up. Terrains in degrees: geocentric
// metres (place.js). A *place* is [x, y, height] of the CRS, height in metres; a *point* is in the scene. Points are
// numbers in double precision throughout; only differences are given to the graphics card (geometry.js).

import {Place} from './place.js';

/** @typedef {[number, number, number]} Vector */

export const add = (p, q, by = 1) => [p[0] + by * q[0], p[1] + by * q[1], p[2] + by * q[2]];
export const subtract = (p, q) => [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
export const dot = (p, q) => p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
export const cross = (p, q) => [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
export const length = p => Math.hypot(p[0], p[1], p[2]);
export const scaled = (p, by) => [p[0] * by, p[1] * by, p[2] * by];
export const unit = p => scaled(p, 1 / length(p));
export const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

/** Turns `p` about the unit vector `axis` by `angle` radians, counter-clockwise seen from its tip. */
export function rotate(p, axis, angle) {
    const c = Math.cos(angle), s = Math.sin(angle);
    return add(add(scaled(p, c), cross(axis, p), s), axis, dot(axis, p) * (1 - c));
}

/**
 * @param terrain what the service tells of it: `lonlat` 1 where x and y are longitude and latitude, with `semi_major` and
 *     `inverse_flattening` of the ellipsoid; else `metre`, metres in a unit of x and y.
 * @return the scene: `isSpace`: is it geocentric? `how`: the places of its CRS, as place.js takes them. Its points are at
 *     heights as they are given; whoever draws the ground has exaggerated them.
 */
export function createScene(terrain) {
    const isSpace = Boolean(terrain.lonlat);
    const how = isSpace ? {lonlat: true, semiMajor: terrain.semi_major, inverseFlattening: terrain.inverse_flattening} :
        {lonlat: false, metre: terrain.metre};
    const place = new Place(how);
    return {
        isSpace,
        how,
        /** @return {Vector} the point of a place */
        point: ([x, y, height]) => place.pointOf(x, y, height),
        /** @return {Vector} the place of a point */
        place: point => place.crsOf(...point),
        /** @return unit vectors east, north and up at a place */
        axes: ([x, y]) => {
            const [east, north, up] = place.axesAt(x, y);
            return {east, north, up};
        },
    };
}
