// pick.js - where a ray meets the mesh that is shown: its triangles in boxes of a hundred or so (geometry.js), each box and
// then each triangle against the ray, in double precision.

import {add, subtract} from './scene.js';
import {CHUNK} from './geometry.js';

function meetsBox(boxes, at, from, inverse, nearest) {
    let enter = 0, leave = nearest;
    for (let axis = 0; axis < 3; axis++) {
        const a = (boxes[at + axis] - from[axis]) * inverse[axis], b = (boxes[at + 3 + axis] - from[axis]) * inverse[axis];
        // A ray within a side of the box makes 0 * infinity here, which no comparison takes.
        if (a < b) {
            if (a > enter) enter = a;
            if (b < leave) leave = b;
        } else {
            if (b > enter) enter = b;
            if (a < leave) leave = a;
        }
    }
    return enter <= leave;
}

/** How far along the ray a triangle is (Moeller and Trumbore 1997), Infinity where it is not. */
function meetTriangle(p, a, b, c, from, ray) {
    const ax = p[a], ay = p[a + 1], az = p[a + 2];
    const ux = p[b] - ax, uy = p[b + 1] - ay, uz = p[b + 2] - az;
    const vx = p[c] - ax, vy = p[c + 1] - ay, vz = p[c + 2] - az;
    const hx = ray[1] * vz - ray[2] * vy, hy = ray[2] * vx - ray[0] * vz, hz = ray[0] * vy - ray[1] * vx;
    const det = ux * hx + uy * hy + uz * hz;
    if (det === 0) return Infinity;
    const sx = from[0] - ax, sy = from[1] - ay, sz = from[2] - az, u = (sx * hx + sy * hy + sz * hz) / det;
    if (!(u >= -1e-9 && u <= 1 + 1e-9)) return Infinity;
    const qx = sy * uz - sz * uy, qy = sz * ux - sx * uz, qz = sx * uy - sy * ux;
    const v = (ray[0] * qx + ray[1] * qy + ray[2] * qz) / det;
    if (!(v >= -1e-9 && u + v <= 1 + 1e-9)) return Infinity;
    const t = (vx * qx + vy * qy + vz * qz) / det;
    return t > 0 ? t : Infinity;
}

/**
 * @param geometry of geometry.js
 * @param eye a point of the scene
 * @param ray a unit direction
 * @return the nearest point of the mesh on the ray, or null
 */
export function pickPoint(geometry, eye, ray) {
    const {origin, positions, triangles, boxes} = geometry, from = subtract(eye, origin);
    const inverse = ray.map(component => 1 / component);
    let nearest = Infinity;
    for (let box = 0; 6 * box < boxes.length; box++) {
        if (!meetsBox(boxes, 6 * box, from, inverse, nearest)) continue;
        const end = Math.min(triangles.length, (box + 1) * 3 * CHUNK);
        for (let i = box * 3 * CHUNK; i < end; i += 3) {
            const t = meetTriangle(positions, 3 * triangles[i], 3 * triangles[i + 1], 3 * triangles[i + 2], from, ray);
            if (t < nearest) nearest = t;
        }
    }
    return nearest < Infinity ? add(eye, ray, nearest) : null;
}

/** The point of the mesh under a point of the scene, or over it where it is below; null where there is none. */
export function groundBelow(geometry, scene, point) {
    const {up} = scene.axes(scene.place(point));
    const above = 1e7; // metres: no ground is higher above any eye that has got below it, ten- or a hundredfold
    return pickPoint(geometry, add(point, up, above), up.map(component => -component));
}
