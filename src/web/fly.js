// fly.js - moving through the terrain: the pointer turns the head, keys move, as fast as the ground is far below.

import {add, scaled} from './scene.js';
import {moveAlongGround} from './orbit.js';

const TURN = 40; // degrees for a drag over half the picture
const LEAST_SPEED = 8; // metres a second

export class Fly {
    /**
     * @param camera of camera.js
     * @param clearance gives the metres between eye and ground, or NaN
     */
    constructor(camera, clearance) {
        Object.assign(this, {camera, clearance});
    }

    begin() {}

    drag(kind, from, to, isTouch) {
        const dx = to[0] - from[0], dy = to[1] - from[1];
        if (kind === 'turn') {
            const sign = isTouch ? -1 : 1; // a finger holds the picture, a mouse the head
            this.camera.turn(sign * dx * TURN, sign * dy * TURN / 2);
        } else {
            this.move(-dy, -dx, 0, 2);
        }
    }

    end() {}

    zoom(factor) {
        this.move(-Math.log(factor), 0, 0, 1);
    }

    step(seconds, wish) {
        this.camera.turn(wish.yaw * 60 * seconds, wish.pitch * 45 * seconds);
        this.move(wish.ahead * seconds, wish.right * seconds, wish.up * seconds / 2, wish.fast ? 3 : 1);
    }

    /** Moves along the line of sight, to the right and upward, in seconds at the speed of the place times `by`. */
    move(ahead, right, up, by) {
        const {camera} = this, clearance = this.clearance(), height = Math.abs(camera.place[2]);
        const speed = Math.max(LEAST_SPEED, Number.isNaN(clearance) ? height : clearance) * by;
        const {forward, ahead: level, right: side, zenith} = camera.basis(), pitch = camera.pitch * Math.PI / 180;
        const across = add(scaled(level, ahead * speed * Math.cos(pitch)), side, right * speed);
        camera.eye = add(camera.eye, zenith, ahead * speed * Math.sin(pitch) + up * speed);
        moveAlongGround(camera, across, forward);
    }
}
