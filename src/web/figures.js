// figures.js - what is told of the mesh in the picture: how many triangles, what they cost, and what is proved of them.

import {bytes, count, metres, milliseconds, pixels, plain} from './format.js';

const element = id => document.getElementById(id);

/** Triangles of the mesh with all samples. */
const allTriangles = ({width, height}) => 2 * (width - 1) * (height - 1);

function share(shown, all) {
    if (!shown) return '';
    const percent = 100 * shown / all;
    return `${percent < 0.01 ? '< 0.01' : plain(percent)} % of the full mesh\u2019s ${count(all)}`;
}

/**
 * What the service proves of an answer, as a sentence; and does it prove anything?
 * @param rounding metres by which the terrain's heights were rounded at most: no eps below is kept
 */
export function promiseOf({wish, told, mesh}, rounding = 0) {
    if (!mesh.triangleCount)
        return {isProved: false, short: 'nothing to draw', text: 'There is nothing to draw: no three neighbours have heights.'};
    const isRange = wish.ask === 'range', unit = isRange ? metres : pixels;
    const reached = isRange ? told.achievedEps : told.achievedTau, answered = Number.isFinite(reached) ? reached : wish.asked;
    const tolerance = isRange ? Math.max(answered, rounding) : answered;
    const coarser = answered > wish.asked * 1.001 ? ` ${unit(wish.asked)} would take too many triangles.` : '';
    if (isRange) {
        const text = tolerance > 0 ? `nowhere more than ${unit(tolerance)} from any sample` : 'every sample is met exactly';
        return {isProved: true, short: unit(tolerance), text: `Proved: ${text}.${coarser}`};
    }
    if (told.guaranteed === 0)
        return {isProved: false, short: `about ${unit(tolerance)}`, text: `About ${unit(tolerance)} on screen, not proved.${coarser}`};
    const text = `Proved: no sample in the picture is off by more than ${unit(tolerance)}.${coarser}`;
    return {isProved: true, short: unit(tolerance), text};
}

export class Figures {
    constructor() {
        this.values = new Map();
        for (const name of ['Vertices', 'Received', 'Answer', 'Decoding', 'Frame', 'Above ground', 'Eye']) {
            const term = document.createElement('dt'), value = document.createElement('dd');
            term.textContent = name;
            value.textContent = '\u2013';
            element('figures').append(term, value);
            this.values.set(name, value);
        }
    }

    set(name, text) {
        const value = this.values.get(name);
        if (value.textContent !== text) value.textContent = text;
    }

    /** Of a terrain of which no mesh has come. */
    showNothing() {
        element('triangles').parentElement.hidden = true;
        element('share').textContent = element('summary').textContent = 'Nothing is shown yet.';
        element('promise').textContent = '';
        for (const name of ['Vertices', 'Received', 'Answer', 'Decoding']) this.set(name, '\u2013');
    }

    /** What is in the picture was made for another view, and the one that is wanted does not come. */
    showMissing() {
        if (element('triangles').parentElement.hidden) return; // nothing is claimed
        this.showPromise({isProved: false, short: 'not proved', text: 'Nothing is proved of this view: its mesh has not come.'});
    }

    /** Are they those of the view that is wanted now? Otherwise they are on their way. */
    showWait(isWaiting) {
        element('claim').setAttribute('aria-busy', isWaiting);
    }

    showPromise({isProved, short, text}, ...before) {
        element('promise').textContent = text;
        element('promise').classList.toggle('unproved', !isProved);
        element('summary').textContent = [...before, short].join(', ');
    }

    /** @param stage of stream.js @param terrain as service.js has it */
    showStage(stage, terrain) {
        const {vertexCount, triangleCount} = stage.mesh, promise = promiseOf(stage, terrain.terrain.quantum_error);
        element('triangles').parentElement.hidden = false;
        element('triangles').textContent = count(triangleCount);
        element('share').textContent = share(triangleCount, allTriangles(terrain.terrain));
        this.showPromise(promise, `${count(triangleCount)} triangles`);
        this.set('Vertices', count(vertexCount));
        this.set('Received', `${bytes(stage.bytes)}, ${(stage.bytes / Math.max(1, vertexCount)).toFixed(1)} B/vertex`);
        this.set('Answer', milliseconds(stage.milliseconds.answer));
        this.set('Decoding', milliseconds(stage.milliseconds.decode));
    }

    /** @param rate frames a second, or 0 when nothing moves @param cost milliseconds of a frame */
    showFrame(rate, cost) {
        const text = rate ? `${plain(rate)} a second` : 'at rest';
        this.set('Frame', cost ? `${milliseconds(cost)}, ${text}` : text);
    }

    showEye(clearance, place) {
        this.set('Above ground', Number.isNaN(clearance) ? '\u2013' : metres(clearance));
        this.set('Eye', place);
    }
}
