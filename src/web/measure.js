// measure.js - clicks that ask: the height of a place, or the profile between two. Heights are the service's, of the
// full-resolution samples, whatever mesh is in the picture.

import {height as exactly, metres, place as placeText} from './format.js';
import {runsOf} from './profile.js';
import {askHeight, askProfile} from './service.js';

const reading = document.getElementById('reading');

export class Measure {
    /**
     * @param marks of marks.js @param profile of profile.js
     * @param hooks {terrain(): id, scene(), exaggeration(), fail(sentence), changed()}
     */
    constructor(marks, profile, hooks) {
        Object.assign(this, {marks, profile, hooks, ends: [], places: new Map(), rows: null, count: 0});
        this.tell('');
    }

    tell(html) {
        reading.innerHTML = html;
    }

    /** The point at which a place [x, y, metres] is drawn. */
    pointOf([x, y, z]) {
        return this.hooks.scene().point([x, y, z * this.hooks.exaggeration()]);
    }

    put(name, place, label) {
        if (place) this.places.set(name, {place, label});
        else this.places.delete(name);
        this.marks.pin(name, place && this.pointOf(place), label);
        this.hooks.changed();
    }

    /** Everything anew: the ground is exaggerated otherwise. */
    redraw() {
        for (const [name, {place, label}] of this.places) this.marks.pin(name, this.pointOf(place), label);
        this.drawLine();
    }

    drawLine() {
        this.marks.line(runsOf(this.rows || []).map(run => run.map(([, x, y, z]) => this.pointOf([x, y, z]))));
    }

    /** @param place [x, y, metres] on the mesh that was clicked @param tool height or profile */
    async click(place, tool) {
        const turn = ++this.count;
        try {
            if (tool === 'profile') await this.clickProfile(place, turn);
            else await this.clickHeight(place, turn);
        } catch (problem) {
            this.hooks.fail(problem.message);
        }
    }

    async clickHeight([x, y, z], turn) {
        this.put('height', [x, y, z], '');
        const height = await askHeight(this.hooks.terrain(), x, y);
        if (turn !== this.count) return;
        this.put('height', [x, y, height ?? z], height === null ? 'no data' : exactly(height));
        this.tell(`<strong>${height === null ? 'No data' : exactly(height)}</strong> at ${placeText(x, y, this.hooks.scene().isSpace, 6)}`);
    }

    async clickProfile(place, turn) {
        if (this.ends.length !== 1) {
            this.clear();
            this.ends = [place];
            this.put('A', place, 'A');
            this.tell('Profile from A: click its other end.');
            return;
        }
        this.ends.push(place);
        this.put('B', place, 'B');
        const rows = await askProfile(this.hooks.terrain(), ...this.ends);
        if (turn !== this.count) return;
        if (!rows.some(row => row[3] !== null)) throw new Error('There is no data along this line.');
        this.rows = rows;
        this.drawLine();
        this.profile.show(rows);
        this.tell(`Profile from A to B, ${metres(rows[rows.length - 1][0])}`);
        this.hooks.changed();
    }

    /** The chart is read there: a pin on the terrain. */
    point(row) {
        this.put('read', row && row.slice(1), row ? exactly(row[3]) : '');
    }

    /** Takes back the click that was last. */
    cancel() {
        this.count++;
        if (this.ends.length === 1) {
            this.clear();
        } else {
            this.put('height', null);
            this.tell('');
        }
    }

    clear() {
        this.count++;
        this.ends = [];
        this.rows = null;
        this.places.clear();
        this.marks.clear();
        this.profile.hide();
        this.tell('');
        this.hooks.changed();
    }
}
