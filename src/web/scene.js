// scene.js - the space in which a terrain stands: that of ext/scene.c, so that a camera means the same here and there.
//
// Planar terrains (projected, or without CRS): x and y of the CRS in metres, z up. Terrains in degrees: geocentric
// metres on the ellipsoid of their CRS, heights above it. A *place* is [x, y, height] of the CRS, height in metres; a
// *point* is in the scene. Points are numbers in double precision throughout; only differences are given to the graphics
// card (geometry.js, terrain_layer.js).

const DEGREE = Math.PI / 180;
const WGS84 = {a: 6378137, f: 1 / 298.257223563};

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

function ellipsoidOf(wkt) {
    const match = /(?:SPHEROID|ELLIPSOID)\["[^"]*",\s*([0-9.eE+-]+),\s*([0-9.eE+-]+)/i.exec(wkt);
    if (!match) return WGS84;
    const inverse = Number(match[2]);
    return {a: Number(match[1]), f: inverse === 0 ? 0 : 1 / inverse};
}

/**
 * @param {string} wkt the CRS; '' where there is none.
 * @return the scene: `isSpace`: is it geocentric? `metre`: of a planar one, metres in a unit of x and y.
 */
export function createScene(wkt) {
    return isGeographic(wkt) ? geocentricScene(ellipsoidOf(wkt)) : planarScene(wkt ? metreOf(wkt) : 1);
}

function planarScene(metre) {
    const axes = {east: [1, 0, 0], north: [0, 1, 0], up: [0, 0, 1]};
    return {
        isSpace: false,
        metre,
        /** @return {Vector} the point of a place */
        point: ([x, y, height]) => [x * metre, y * metre, height],
        /** @return {Vector} the place of a point */
        place: ([x, y, z]) => [x / metre, y / metre, z],
        /** @return unit vectors east, north and up at a place */
        axes: () => axes,
    };
}

function geocentricScene({a, f}) {
    const e2 = f * (2 - f), b = a * (1 - f), second = e2 / (1 - e2);
    const point = ([lon, lat, height]) => {
        const sine = Math.sin(lat * DEGREE), n = a / Math.sqrt(1 - e2 * sine * sine);
        const across = (n + height) * Math.cos(lat * DEGREE);
        return [across * Math.cos(lon * DEGREE), across * Math.sin(lon * DEGREE), (n * (1 - e2) + height) * sine];
    };
    // Bowring's formula, repeated: what is left after three rounds is below a micrometre from the Earth's surface to the
    // distance of the moon.
    const place = ([x, y, z]) => {
        const across = Math.hypot(x, y);
        let beta = Math.atan2(z * a, across * b), lat = 0;
        for (let round = 0; round < 3; round++) {
            const s = Math.sin(beta), c = Math.cos(beta);
            lat = Math.atan2(z + second * b * s * s * s, across - e2 * a * c * c * c);
            beta = Math.atan2(b * Math.sin(lat), a * Math.cos(lat));
        }
        const s = Math.sin(lat), c = Math.cos(lat), n = a / Math.sqrt(1 - e2 * s * s);
        const height = across * c + z * s - a * a / n;
        return [Math.atan2(y, x) / DEGREE, lat / DEGREE, height];
    };
    const axes = ([lon, lat]) => {
        const sl = Math.sin(lon * DEGREE), cl = Math.cos(lon * DEGREE);
        const sp = Math.sin(lat * DEGREE), cp = Math.cos(lat * DEGREE);
        return {east: [-sl, cl, 0], north: [-sp * cl, -sp * sl, cp], up: [cp * cl, cp * sl, sp]};
    };
    return {isSpace: true, metre: 1, a, e2, point, place, axes};
}
