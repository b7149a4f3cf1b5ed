/**
 * place.js - from a mesh's integers to the scene that is drawn, and back from a point of the scene to the map.
 *
 * The scene is that of views (ext/scene.c): metres. Of a projected terrain x*m, y*m, z*e, where m is metres in a unit
 * of its coordinates and e the exaggeration of heights. Of one in longitude and latitude it is geocentric (ECEF) on
 * the ellipsoid of its CRS, heights times e above that.
 *
 * What is drawn is in float32, which is good for seven digits: so a scene has an origin near what is looked at, places
 * are computed in double, and only their differences from it are rounded.
 */
import {factorOf, metresOf} from './header.js';

const RADIAN = Math.PI / 180;

/** @typedef {[number, number, number]} Point */

/** How places of a terrain's CRS lie in the scene. */
export class Place {
    /**
     * @param {Object} how
     * @param {boolean} how.lonlat         longitude and latitude in degrees, not projected
     * @param {number} [how.metre]         metres in a unit of projected coordinates; 1
     * @param {number} [how.exaggeration]  of heights; 1
     * @param {number} [how.semiMajor]          of the ellipsoid, metres; that of WGS 84
     * @param {number} [how.inverseFlattening]  0: a sphere; that of WGS 84
     */
    constructor({lonlat, metre = 1, exaggeration = 1, semiMajor = 6378137, inverseFlattening = 298.257223563}) {
        this.lonlat = lonlat;
        this.metre = metre;
        this.exaggeration = exaggeration;
        this.ellipsoid = ellipsoidOf(semiMajor, inverseFlattening ? 1 / inverseFlattening : 0);
    }

    /**
     * The point of the scene at a place of the CRS with a height in metres.
     * @returns {Point} metres
     */
    pointOf(x, y, z) {
        const h = z * this.exaggeration;
        return this.lonlat ? geocentric(this.ellipsoid, x, y, h) : [x * this.metre, y * this.metre, h];
    }

    /**
     * The place of the CRS of a point of the scene, and its height (without exaggeration; exaggeration 0: 0).
     * @returns {Point} x, y (degrees where the terrain is in them) and metres
     */
    crsOf(x, y, z) {
        const [cx, cy, h] = this.lonlat ? geodetic(this.ellipsoid, x, y, z) : [x / this.metre, y / this.metre, z];
        return [cx, cy, this.exaggeration === 0 ? 0 : h / this.exaggeration];
    }

    /**
     * East, north and up at a place of the CRS, as unit vectors of the scene.
     * @returns {[Point, Point, Point]}
     */
    axesAt(x, y) {
        if (!this.lonlat) return [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
        const lon = x * RADIAN, lat = y * RADIAN, s = Math.sin(lon), c = Math.cos(lon);
        return [[-s, c, 0], [-Math.sin(lat) * c, -Math.sin(lat) * s, Math.cos(lat)], [Math.cos(lat) * c, Math.cos(lat) * s, Math.sin(lat)]];
    }

    /**
     * Where the vertices of a mesh are, about an origin.
     * @param {import('./wire.js').Mesh} mesh
     * @param {Point} origin  a point of the scene, in double
     * @param {ArrayLike<number>} [heights]  in quanta, in place of mesh.q: those of morph.js
     * @param {Float32Array} [out]  room for 3 a vertex; a new one otherwise
     * @returns {Float32Array} x, y, z of each vertex
     */
    positionsOf(mesh, origin, heights = mesh.q, out = new Float32Array(3 * mesh.vertexCount)) {
        const {vertexCount, col, row, x0, y0, dx, dy} = mesh, [ox, oy, oz] = origin;
        if (!this.lonlat) {
            const factor = factorOf(mesh), {metre, exaggeration} = this, {z0, d, offset} = mesh;
            for (let i = 0; i < vertexCount; i++) {
                out[3 * i] = (x0 + col[i] * dx) * metre - ox;
                out[3 * i + 1] = (y0 + row[i] * dy) * metre - oy;
                out[3 * i + 2] = ((z0 + heights[i] / d) * factor + offset) * exaggeration - oz;
            }
            return out;
        }
        const {a, e2} = this.ellipsoid;
        // Sines and cosines of each column and row once: terrain has many vertices in each.
        const lon = circle((c) => x0 + c * dx), lat = circle((r) => y0 + r * dy);
        for (let i = 0; i < vertexCount; i++) {
            const {sine: sl, cosine: cl} = lon(col[i]), {sine: sp, cosine: cp} = lat(row[i]);
            const n = a / Math.sqrt(1 - e2 * sp * sp), h = metresOf(mesh, heights[i]) * this.exaggeration;
            out[3 * i] = (n + h) * cp * cl - ox;
            out[3 * i + 1] = (n + h) * cp * sl - oy;
            out[3 * i + 2] = (n * (1 - e2) + h) * sp - oz;
        }
        return out;
    }
}

function circle(degreesOf) {
    const known = [];
    return (i) => known[i] ??= {sine: Math.sin(degreesOf(i) * RADIAN), cosine: Math.cos(degreesOf(i) * RADIAN)};
}

/** What formulas need: semi-major axis, flattening, the square of the eccentricity. */
const ellipsoidOf = (a, f) => ({a, f, e2: f * (2 - f)});

/** Degrees and metres. @returns {Point} */
function geocentric({a, e2}, lon, lat, h) {
    const sp = Math.sin(lat * RADIAN), cp = Math.cos(lat * RADIAN), n = a / Math.sqrt(1 - e2 * sp * sp);
    return [(n + h) * cp * Math.cos(lon * RADIAN), (n + h) * cp * Math.sin(lon * RADIAN), (n * (1 - e2) + h) * sp];
}

/**
 * The inverse: Bowring's latitude, then Newton's steps in it, which for heights between -5000 km and 100,000 km end in
 * what doubles can tell apart. At the Earth's centre the latitude is 90.
 * @returns {Point}
 */
function geodetic({a, f, e2}, x, y, z) {
    const p = Math.hypot(x, y), b = a * (1 - f), lon = Math.atan2(y, x) / RADIAN;
    let u = Math.atan2(z * a, p * b); // reduced latitude
    let lat = 0;
    for (let i = 0; i < 4; i++) {
        const s = Math.sin(u), c = Math.cos(u);
        lat = Math.atan2(z + e2 / (1 - e2) * b * s ** 3, p - e2 * a * c ** 3);
        u = Math.atan2((1 - f) * Math.sin(lat), Math.cos(lat));
    }
    const sp = Math.sin(lat), cp = Math.cos(lat);
    // Along the normal, wherever it points.
    return [lon, lat / RADIAN, p * cp + z * sp - a * Math.sqrt(1 - e2 * sp * sp)];
}
