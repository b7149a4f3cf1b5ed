// geometry.js - a mesh (wire.js) as what the graphics card and picking need.
//
// Positions are single-precision differences to an origin that is a point in double precision. The origin is near the eye
// for which the mesh was made: a difference is then as fine as its distance from the eye asks, by 2^-24 of it.

import {metresOf} from './header.js';
import {normalOf} from './wire.js';

/** Triangles in a box of the picking structure: meshes come in the order of a walk, so that neighbours are together. */
export const CHUNK = 128;

/** Metres of heights in quanta. */
function metresAll(mesh, heights) {
    const out = new Float32Array(heights.length);
    for (let v = 0; v < heights.length; v++) out[v] = metresOf(mesh, heights[v]);
    return out;
}

/** Normals east, north and up in steps of 1/127, four bytes a vertex, out of the two that are kept (FORMAT.md, Wire). */
function unpackNormals(packed) {
    const count = packed.length / 2, out = new Int8Array(4 * count);
    for (let v = 0; v < count; v++) {
        const normal = normalOf(packed[2 * v], packed[2 * v + 1]);
        for (let axis = 0; axis < 3; axis++) out[4 * v + axis] = Math.round(127 * normal[axis]);
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
 * @param mesh of wire.js
 * @param {Place} place with the exaggeration to be shown
 * @param {Vector} origin a point of the scene
 * @return {{origin, positions, heights, normals, errors, triangles, boxes, edges}}: what terrain_layer.js shows
 */
export function buildGeometry(mesh, place, origin, withEdges) {
    const positions = place.positionsOf(mesh, origin);
    return {
        origin,
        positions,
        heights: metresAll(mesh, mesh.q),
        normals: mesh.normals && unpackNormals(mesh.normals),
        errors: mesh.errors && Float32Array.from(mesh.errors),
        triangles: mesh.triangles,
        boxes: boxesOf(positions, mesh.triangles),
        edges: withEdges ? edgesOf(mesh.triangles) : null,
    };
}

/**
 * What a geomorph shows: the union of two meshes, with where its vertices begin and end.
 * @param union of morph.js
 * @param a the mesh it begins with, b the one it ends with
 * @param {Place} placeFrom with the exaggeration at its beginning, placeTo with that at its end
 */
export function buildMorph(union, a, b, placeFrom, placeTo, origin, withEdges) {
    const {vertexCount, from, to, triangles} = union, ofA = a.normals && unpackNormals(a.normals);
    const ofB = b.normals && unpackNormals(b.normals), normals = new Int8Array(4 * vertexCount);
    const errors = a.errors && b.errors ? new Float32Array(vertexCount) : null;
    for (let v = 0; v < vertexCount; v++) {
        // A vertex has one normal and one error, whatever mesh it is in; one that is in neither is level with others.
        const source = to[v] >= 0 ? ofB : ofA, i = to[v] >= 0 ? to[v] : from[v];
        if (i < 0) {
            normals[4 * v + 2] = 127;
            continue;
        }
        for (let axis = 0; axis < 3; axis++) normals[4 * v + axis] = source[4 * i + axis];
        if (errors) errors[v] = (to[v] >= 0 ? b : a).errors[i];
    }
    return {
        origin,
        positions: placeTo.positionsOf(union, origin, union.zTo),
        positionsFrom: placeFrom.positionsOf(union, origin, union.zFrom),
        heights: metresAll(union, union.zTo),
        heightsFrom: metresAll(union, union.zFrom),
        normals,
        errors,
        triangles,
        edges: withEdges ? edgesOf(triangles) : null,
    };
}
