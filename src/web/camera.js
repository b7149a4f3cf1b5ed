// camera.js - the eye, where it looks, and the camera JSON of ext/camera.c that says the same.
//
// Yaw is clockwise from north, pitch upward, both in degrees and measured at the eye; there is no roll. The eye is a point
// of the scene and is not exaggerated; the ground is. Longitude, latitude and height as the CRS has them ("position":
// "crs") are what the service puts into its scene without any datum in between, so they are what is asked with.

import {add, clamp, cross, dot, scaled, subtract, unit} from './scene.js';

const DEGREE = Math.PI / 180;
const STEEPEST = 89.9; // degrees: straight down there would be no left and right
const round = (value, digits) => Number(value.toFixed(digits));

export class Camera {
    /** @param scene of scene.js */
    constructor(scene) {
        this.scene = scene;
        this.eye = [0, 0, 0];
        this.yaw = 0;
        this.pitch = -40;
        this.fovy = 40;
        this.exaggeration = 1;
        this.width = 1; // pixels of the drawing buffer
        this.height = 1;
    }

    /** The eye as [x, y, height] of the CRS. */
    get place() {
        return this.scene.place(this.eye);
    }

    /** Unit vectors of the scene: right, up (of the picture) and forward. */
    basis() {
        const {east, north, up} = this.scene.axes(this.place);
        const yaw = this.yaw * DEGREE, pitch = this.pitch * DEGREE;
        const ahead = add(scaled(east, Math.sin(yaw)), north, Math.cos(yaw));
        const forward = add(scaled(ahead, Math.cos(pitch)), up, Math.sin(pitch));
        const right = cross(ahead, up);
        return {right, up: cross(right, forward), forward, ahead, zenith: up};
    }

    /** Puts the eye at a point, looking along a direction of the scene. */
    set(eye, direction) {
        this.eye = eye;
        const {east, north, up} = this.scene.axes(this.place), d = unit(direction);
        const across = Math.hypot(dot(d, east), dot(d, north));
        if (across > 1e-9) this.yaw = (Math.atan2(dot(d, east), dot(d, north)) / DEGREE + 360) % 360;
        this.pitch = clamp(Math.atan2(dot(d, up), across) / DEGREE, -STEEPEST, STEEPEST);
    }

    turn(yaw, pitch) {
        this.yaw = (this.yaw + yaw + 360) % 360;
        this.pitch = clamp(this.pitch + pitch, -STEEPEST, STEEPEST);
    }

    /** The unit direction of a place in the picture; x and y from -1 to 1, right and up. */
    direction(x, y) {
        const {right, up, forward} = this.basis();
        const tangent = Math.tan(this.fovy / 2 * DEGREE);
        return unit(add(add(forward, right, x * tangent * this.width / this.height), up, y * tangent));
    }

    /** Where a point is in the picture, as above, and how far in front of the eye; null behind it. */
    project(point) {
        const {right, up, forward} = this.basis(), from = subtract(point, this.eye), depth = dot(from, forward);
        if (!(depth > 0)) return null;
        const tangent = Math.tan(this.fovy / 2 * DEGREE) * depth;
        return {x: dot(from, right) / (tangent * this.width / this.height), y: dot(from, up) / tangent, depth};
    }

    /** Looks so that a point is at a place of the picture, as near to it as a camera without roll can. */
    hold(point, [x, y]) {
        const tangent = Math.tan(this.fovy / 2 * DEGREE), ray = unit([x * tangent * this.width / this.height, y * tangent, 1]);
        const {east, north, up} = this.scene.axes(this.place), to = unit(subtract(point, this.eye));
        const [right, above, ahead] = ray, rise = clamp(dot(to, up) / Math.hypot(above, ahead), -1, 1);
        const pitch = Math.asin(rise) - Math.atan2(above, ahead);
        const aside = Math.atan2(right, ahead * Math.cos(pitch) - above * Math.sin(pitch));
        this.yaw = ((Math.atan2(dot(to, east), dot(to, north)) - aside) / DEGREE + 720) % 360;
        this.pitch = clamp(pitch / DEGREE, -STEEPEST, STEEPEST);
    }

    /** Degrees of the picture's height in which a landscape, or in portrait a portrait, looks natural. */
    static usualAngle(width, height) {
        return round(2 * Math.atan(Math.tan(20 * DEGREE) * clamp(height / width, 1, 1.7)) / DEGREE, 3);
    }

    /** Keeps a camera JSON short, and the same while nobody moves: to 0.1 mm and 0.0001 degrees. */
    json(tau) {
        const [x, y, height] = this.place, digits = this.scene.isSpace ? 9 : 4;
        return {
            eye: [round(x, digits), round(y, digits), round(height, 3)],
            yaw: round(this.yaw, 4) % 360,
            pitch: round(this.pitch, 4),
            fovy: this.fovy,
            width: this.width,
            height: this.height,
            tau,
            exaggeration: this.exaggeration,
            position: 'crs',
        };
    }

    /**
     * Reads a camera JSON: all keys but width, height and tau, which are the page's; near, far and roll are not of this
     * viewer. Throws a sentence.
     */
    read(json) {
        const isVector = v => Array.isArray(v) && v.length === 3 && v.every(Number.isFinite);
        if (!isVector(json.eye)) throw new Error('camera: "eye" must be three numbers');
        const isPoint = json.position === 'ecef' && this.scene.isSpace;
        const toPoint = v => isPoint ? [...v] : this.scene.point(v);
        const eye = toPoint(json.eye);
        if (json.fovy > 0 && json.fovy < 180) this.fovy = json.fovy;
        if (json.exaggeration > 0) this.exaggeration = json.exaggeration;
        if (isVector(json.at)) {
            this.set(eye, subtract(toPoint(json.at), eye));
        } else {
            this.eye = eye;
            this.yaw = ((Number(json.yaw) || 0) % 360 + 360) % 360;
            this.pitch = clamp(Number(json.pitch) || 0, -STEEPEST, STEEPEST);
        }
    }
}

/** The points between which a terrain is, as geometry.js has those of a mesh. @param box, heights as below */
function pointsBetween(scene, [x0, y0, x1, y1], heights) {
    const origin = scene.point([(x0 + x1) / 2, (y0 + y1) / 2, heights[0]]), positions = [];
    for (let i = 0; i <= 8; i++)
        for (let j = 0; j <= 8; j++)
            for (const height of heights)
                positions.push(...subtract(scene.point([x0 + (x1 - x0) * i / 8, y0 + (y1 - y0) * j / 8, height]), origin));
    return {origin, positions};
}

/** What of the picture points take: [left, right, bottom, top] by the tangents of the angles; null when one is behind. */
function tangentsOf(camera, {origin, positions}) {
    const {right, up, forward} = camera.basis(), [x, y, z] = subtract(origin, camera.eye);
    const found = [Infinity, -Infinity, Infinity, -Infinity];
    for (let i = 0; i < positions.length; i += 3) {
        const a = x + positions[i], b = y + positions[i + 1], c = z + positions[i + 2];
        const depth = a * forward[0] + b * forward[1] + c * forward[2];
        if (!(depth > 0)) return null;
        const across = (a * right[0] + b * right[1] + c * right[2]) / depth, high = (a * up[0] + b * up[1] + c * up[2]) / depth;
        if (across < found[0]) found[0] = across;
        if (across > found[1]) found[1] = across;
        if (high < found[2]) found[2] = high;
        if (high > found[3]) found[3] = high;
    }
    return found;
}

/**
 * Stands the camera so that the whole terrain is in the middle of the picture, seen from the south; in a portrait from
 * higher up, and from above where much of the Earth is to be seen.
 * @param box [west, south, east, north] of the CRS
 * @param heights [lowest, highest], exaggerated
 * @param mesh {origin, positions} of geometry.js: what is to be in the picture; null or empty: all that may be between
 *     the heights
 * @param share of the picture's height, about its middle, that is not covered
 */
export function lookAtAll(camera, box, heights, mesh = null, share = 1) {
    const {scene} = camera, [x0, y0, x1, y1] = box, span = scene.isSpace ? Math.max(x1 - x0, y1 - y0) : 0;
    const points = mesh?.positions.length ? mesh : pointsBetween(scene, box, heights);
    const middle = [(x0 + x1) / 2, (y0 + y1) / 2, (heights[0] + heights[1]) / 2], target = scene.point(middle);
    const most = Math.tan(camera.fovy / 2 * DEGREE), aspect = camera.width / camera.height;
    const steep = 38 + 27 * clamp(share / aspect - 1, 0, 1);
    const pitch = -(steep + clamp((span - 5) / 30, 0, 1) * (84 - steep)) * DEGREE;
    const {east, north, up} = scene.axes(middle);
    const direction = add(scaled(north, Math.cos(pitch)), up, Math.sin(pitch)), above = cross(east, direction);
    let aside = 0, higher = 0; // of the eye, by its distance
    const seen = distance => {
        camera.set(add(add(add(target, direction, -distance), east, aside * distance), above, higher * distance), direction);
        camera.yaw = 0;
        return tangentsOf(camera, points);
    };
    const fits = found => found && found[1] - found[0] < 1.86 * most * aspect && found[3] - found[2] < 1.8 * most * share;
    // What is near is large: so the middle of the points is not that of their picture. Each round gets nearer to it.
    for (let round = 0; round < 6; round++) {
        let near = 0, far = 1;
        while (!fits(seen(far)) && far < 1e10) far *= 2;
        for (let halving = 0; halving < 24; halving++) {
            const half = (near + far) / 2;
            if (fits(seen(half))) far = half;
            else near = half;
        }
        const [left, right, bottom, top] = seen(far);
        if (round === 5) break;
        aside += (left + right) / 2;
        higher += (bottom + top) / 2;
    }
}
