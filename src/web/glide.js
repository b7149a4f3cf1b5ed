// glide.js - a camera that goes by itself from one stand to another, in less than a second.

import {clamp} from './scene.js';

const MILLISECONDS = 600;

const standOf = camera => ({place: camera.place, yaw: camera.yaw, pitch: camera.pitch, fovy: camera.fovy});

export class Glide {
    constructor(camera) {
        this.camera = camera;
        this.steps = null;
    }

    get isMoving() {
        return this.steps !== null;
    }

    stop() {
        this.steps = null;
    }

    /**
     * @param step called with t from 0 to 1, smoothly; the last time with 1
     * @param isInstant at once: for people who want no motion
     */
    begin(step, now, isInstant) {
        if (isInstant) {
            this.steps = null;
            step(1);
        } else {
            this.steps = {step, start: now};
        }
    }

    /** To where `stand` puts the camera. */
    to(stand, now, isInstant) {
        const {camera} = this, from = standOf(camera);
        stand();
        const end = standOf(camera), turn = ((end.yaw - from.yaw) % 360 + 540) % 360 - 180;
        const mix = (a, b, t) => a + (b - a) * t;
        this.begin(t => {
            const place = from.place.map((value, axis) => mix(value, end.place[axis], t));
            camera.eye = camera.scene.point(place);
            camera.yaw = (from.yaw + turn * t + 360) % 360;
            camera.pitch = mix(from.pitch, end.pitch, t);
            camera.fovy = t < 1 ? mix(from.fovy, end.fovy, t) : end.fovy;
        }, now, isInstant);
    }

    /** Goes on to the time `now`; has anything moved? */
    advance(now) {
        if (!this.steps) return false;
        const {step, start} = this.steps, t = clamp((now - start) / MILLISECONDS, 0, 1);
        if (t === 1) this.steps = null;
        step(t * t * (3 - 2 * t));
        return true;
    }
}
