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

/** Is the CRS of this WKT in degrees? */
function isGeographic(wkt) {
    return /^\s*(COMPD_CS|COMPOUNDCRS)?[^A-Z]*("[^"]*"\s*,\s*)?(GEOGCS|GEOGCRS|GEODCRS)\[/i.test(wkt);
}

/** Metres in a unit of x and y of a projected CRS: its last UNIT, for what is before belongs to its base. */
function metreOf(wkt) {
    const projected = wkt.replace(/VERT_?C(S|RS)\[.*$/i, '');
    const units = [...projected.matchAll(/(?:UNIT|LENGTHUNIT)\["[^"]*",\s*([0-9.eE+-]+)/gi)];
    const metre = units.length ? Number(units[units.length - 1][1]) : 1;
    return metre > 0 ? metre : 1;
}

/**
 * @param {string} wkt the CRS; '' where there is none.
 * @return the scene: `isSpace`: is it geocentric? `metre`: of a planar one, metres in a unit of x and y. Its points are at
 *     heights as they are given; whoever draws the ground has exaggerated them.
 */
export function createScene(wkt) {
    const isSpace = isGeographic(wkt), metre = isSpace || !wkt ? 1 : metreOf(wkt), place = new Place({lonlat: isSpace, metre});
    return {
        isSpace,
        metre,
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
