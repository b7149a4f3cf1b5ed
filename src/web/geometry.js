// geometry.js - a mesh (wire.js) as what the graphics card and picking need.
//
// Positions are single-precision differences to an origin that is a point in double precision. The origin is near the eye
// for which the mesh was made: a difference is then as fine as its distance from the eye asks, by 2^-24 of it.

import {createScene} from './scene.js';

/** Triangles in a box of the picking structure: meshes come in the order of a walk, so that neighbours are together. */
export const CHUNK = 128;

const DEGREE = Math.PI / 180;

/**
 * Where the samples of one terrain are, quickly: sines and cosines are of columns and of rows.
 * @param terrain {crs, width, height, x0, y0, dx, dy}
 */
export class Places {
    constructor({crs, width, height, x0, y0, dx, dy}) {
        Object.assign(this, {x0, y0, dx, dy, scene: createScene(crs)});
        if (!this.scene.isSpace) return;
        const table = (count, start, step) => {
            const sine = new Float64Array(count), cosine = new Float64Array(count);
            for (let i = 0; i < count; i++) {
                sine[i] = Math.sin((start + i * step) * DEGREE);
                cosine[i] = Math.cos((start + i * step) * DEGREE);
            }
            return {sine, cosine};
        };
        this.columns = table(width, x0, dx);
        this.rows = table(height, y0, dy);
    }

    /** Positions of samples of these heights (metres, exaggerated here), as differences to origin. */
    positions(col, row, heights, exaggeration, origin) {
        const out = new Float32Array(3 * col.length), [ox, oy, oz] = origin;
        if (!this.scene.isSpace) {
            const {x0, y0, dx, dy} = this, {metre} = this.scene;
            for (let v = 0, i = 0; v < col.length; v++) {
                out[i++] = (x0 + col[v] * dx) * metre - ox;
                out[i++] = (y0 + row[v] * dy) * metre - oy;
                out[i++] = heights[v] * exaggeration - oz;
            }
            return out;
        }
        const {a, e2} = this.scene, {columns, rows} = this;
        for (let v = 0, i = 0; v < col.length; v++) {
            const sine = rows.sine[row[v]], height = heights[v] * exaggeration;
            const n = a / Math.sqrt(1 - e2 * sine * sine), across = (n + height) * rows.cosine[row[v]];
            out[i++] = across * columns.cosine[col[v]] - ox;
            out[i++] = across * columns.sine[col[v]] - oy;
            out[i++] = (n * (1 - e2) + height) * sine - oz;
        }
        return out;
    }
}

/** Metres of the heights q of a mesh (FORMAT.md, Mesh). */
export function metresOf(mesh, q) {
    const factor = mesh.scale * (mesh.numerator / mesh.denominator), out = new Float32Array(q.length);
    for (let v = 0; v < q.length; v++) out[v] = (mesh.z0 + q[v] / mesh.d) * factor + mesh.offset;
    return out;
}

/** Normals east, north and up in steps of 1/127, four bytes a vertex, out of the two that are kept (FORMAT.md, Wire). */
function unpackNormals(packed) {
    const count = packed.length / 2, out = new Int8Array(4 * count);
    for (let v = 0; v < count; v++) {
        const a = packed[2 * v] / 127, b = packed[2 * v + 1] / 127;
        const x = (a + b) / 2, y = (a - b) / 2, z = 1 - Math.max(Math.abs(a), Math.abs(b));
        const by = 127 / Math.hypot(x, y, z);
        out[4 * v] = Math.round(x * by);
        out[4 * v + 1] = Math.round(y * by);
        out[4 * v + 2] = Math.round(z * by);
    }
    return out;
}

/** The box of every CHUNK triangles: least x, y, z, then the greatest. */
function boxesOf(positions, triangles) {
    const count = Math.ceil(triangles.length / (3 * CHUNK)), boxes = new Float32Array(6 * count);
    for (let box = 0; box < count; box++) {
        const at = 6 * box, end = Math.min(triangles.length, (box + 1) * 3 * CHUNK);
        boxes.fill(Infinity, at, at + 3).fill(-Infinity, at + 3, at + 6);
        for (let i = box * 3 * CHUNK; i < end; i++)
            for (let axis = 0; axis < 3; axis++) {
                const value = positions[3 * triangles[i] + axis];
                if (value < boxes[at + axis]) boxes[at + axis] = value;
                if (value > boxes[at + 3 + axis]) boxes[at + 3 + axis] = value;
            }
    }
    return boxes;
}

/** Every edge of the mesh once, as pairs of vertices. */
export function edgesOf(triangles) {
    let size = 1024;
    while (size < triangles.length * 2) size *= 2;
    const slots = new Float64Array(size), edges = new Uint32Array(2 * triangles.length);
    let count = 0;
    for (let i = 0; i < triangles.length; i++) {
        const p = triangles[i], q = triangles[i % 3 === 2 ? i - 2 : i + 1];
        const low = Math.min(p, q), high = Math.max(p, q), key = low * 4294967296 + high + 1;
        let slot = (Math.imul(low, 0x9E3779B1) ^ Math.imul(high, 0x85EBCA77)) >>> 0 & size - 1;
        while (slots[slot] !== 0 && slots[slot] !== key) slot = slot + 1 & size - 1;
        if (slots[slot] === key) continue;
        slots[slot] = key;
        edges[count++] = low;
        edges[count++] = high;
    }
    return edges.slice(0, count);
}

/**
 * @param {Places} places
 * @param mesh of wire.js
 * @param origin a point of the scene
 * @return {{origin, positions, heights, normals, errors, triangles, boxes, edges}}: what terrain_layer.js shows
 */
export function buildGeometry(places, mesh, exaggeration, origin, withEdges) {
    const heights = metresOf(mesh, mesh.q);
    const positions = places.positions(mesh.col, mesh.row, heights, exaggeration, origin);
    return {
        origin,
        positions,
        heights,
        normals: mesh.normals && unpackNormals(mesh.normals),
        errors: mesh.errors && Float32Array.from(mesh.errors),
        triangles: mesh.triangles,
        boxes: boxesOf(positions, mesh.triangles),
        edges: withEdges ? edgesOf(mesh.triangles) : null,
    };
}
