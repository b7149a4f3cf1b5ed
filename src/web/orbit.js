// orbit.js - looking at the terrain from around it, as at a model on a table: the ground is held where the pointer took it.
//
// Places in the picture are [x, y] from -1 to 1, right and up.

import {add, clamp, cross, dot, length, rotate, scaled, subtract, unit} from './scene.js';

const TURN = 1.6; // radians for a drag over half the picture
const STEEP = [0.01, Math.PI / 2 - 0.005]; // radians above the horizon that the eye may be, seen from what it turns about

export class Orbit {
    /**
     * @param camera of camera.js
     * @param pick gives the point of the ground in the picture, or null
     * @param furthest metres from the ground beyond which there is nothing to see
     */
    constructor(camera, pick, furthest) {
        Object.assign(this, {camera, pick, furthest, anchor: null, at: [0, 0], distance: 0});
    }

    /** The ground there, or where nothing is, a point as far away as the last one was. */
    pointAt(at) {
        const point = this.pick(at), {camera} = this;
        if (point) this.distance = length(subtract(point, camera.eye));
        return point || add(camera.eye, camera.direction(...at), this.distance || camera.place[2]);
    }

    begin(at) {
        this.anchor = this.pointAt(at);
        this.at = at;
    }

    drag(kind, from, to) {
        if (!this.anchor) this.begin(from);
        if (kind === 'turn') this.turn(-(to[0] - from[0]) * TURN, -(to[1] - from[1]) * TURN / 2);
        else this.pan(to);
    }

    end() {
        this.anchor = null;
    }

    /** Turns the eye about the anchor: about its upright, and up or down. */
    turn(around, upward) {
        const {camera, anchor} = this, {up} = camera.scene.axes(camera.scene.place(anchor));
        const arm = subtract(camera.eye, anchor), height = Math.asin(clamp(dot(unit(arm), up), -1, 1));
        // Straight above the anchor the picture says what is aside.
        const side = Math.abs(height) > 1.56 ? camera.basis().right : unit(cross(up, arm));
        const tilt = clamp(height + upward, Math.min(height, STEEP[0]), STEEP[1]) - height;
        camera.eye = add(anchor, rotate(rotate(arm, side, -tilt), up, around));
        camera.hold(anchor, this.at);
    }

    /** Moves the eye so that the anchor is at a place of the picture. */
    pan(to) {
        const {camera, anchor} = this, ray = camera.direction(...to), most = 4 * length(subtract(anchor, camera.eye));
        if (camera.scene.isSpace) {
            // On the sphere through the anchor, about the Earth's centre.
            const radius = length(anchor), half = dot(ray, camera.eye);
            const root = half * half - dot(camera.eye, camera.eye) + radius * radius;
            if (!(root > 0)) return;
            const a = unit(add(camera.eye, ray, -half - Math.sqrt(root))), b = unit(anchor), axis = cross(a, b);
            const angle = Math.atan2(length(axis), dot(a, b));
            if (!(angle > 0 && angle * radius < most)) return;
            camera.eye = rotate(camera.eye, unit(axis), angle);
        } else {
            const t = (anchor[2] - camera.eye[2]) / ray[2], by = subtract(anchor, add(camera.eye, ray, t));
            // Near the horizon a pixel is kilometres: there the ground slips.
            if (!(t > 0 && length(by) < most)) return;
            camera.eye = add(camera.eye, by);
        }
        this.at = to;
        camera.hold(anchor, to);
    }

    /** Goes nearer (factor below 1) to what is at a place of the picture, or away from it. */
    zoom(factor, at) {
        const {camera} = this, point = this.anchor || this.pointAt(at), held = this.anchor ? this.at : at;
        const arm = subtract(camera.eye, point), most = Math.max(1, this.furthest / length(arm));
        camera.eye = add(point, scaled(arm, Math.min(factor, most)));
        camera.hold(point, held);
    }

    /**
     * Moves by keys: for `seconds`.
     * @param wish {ahead, right, up, yaw, pitch}, each -1, 0 or 1, and fast
     */
    step(seconds, wish) {
        const {camera} = this, speed = seconds * (wish.fast ? 3 : 1);
        this.begin([0, 0]);
        if (wish.yaw || wish.pitch) this.turn(wish.yaw * speed, wish.pitch * speed * 0.7);
        if (wish.up) this.zoom(Math.exp(wish.up * speed), [0, 0]);
        if (wish.ahead || wish.right) {
            const {ahead, right, forward} = camera.basis(), reach = length(subtract(camera.eye, this.anchor)) * speed * 0.6;
            const by = add(scaled(ahead, wish.ahead * reach), right, wish.right * reach);
            moveAlongGround(camera, by, forward);
        }
        this.end();
    }
}

/** Moves the eye by a vector that is level where it is, keeping its height and pitch: over a round Earth it goes round. */
export function moveAlongGround(camera, by, forward) {
    const {eye, scene} = camera;
    if (!scene.isSpace) {
        camera.eye = add(eye, by);
        return;
    }
    const height = camera.place[2], axis = cross(unit(eye), by), angle = length(by) / length(eye);
    if (!(angle > 0)) return;
    const [x, y] = scene.place(rotate(eye, unit(axis), angle)), {pitch} = camera;
    camera.set(scene.point([x, y, height]), rotate(forward, unit(axis), angle));
    camera.pitch = pitch;
}
