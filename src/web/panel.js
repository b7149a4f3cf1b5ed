// panel.js - the panel's controls: settings in, settings out.
//
// Tolerances go by steps that read well (1, 1.5, 2, 3, ...): a slider is a place in a list.

import {count, metres, pixels, plain} from './format.js';

export const TAUS = [0.5, 0.7, 1, 1.5, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64];
export const EPSES = [0, 0.1, 0.2, 0.3, 0.5, 0.7, 1, 1.5, 2, 3, 5, 7, 10, 15, 20, 30, 50, 70, 100, 150, 200, 300, 500, 700, 1000];

const element = id => document.getElementById(id);
const nearest = (list, value) => list.reduce((best, step, i) => Math.abs(step - value) < Math.abs(list[best] - value) ? i : best, 0);

export class Panel {
    /** @param changed called with the settings that a person has changed, {key: value} */
    constructor(changed) {
        this.changed = changed;
        for (const id of ['ask', 'colour', 'mode', 'tool'])
            element(id).addEventListener('change', event => changed({[id]: event.target.value}));
        for (const id of ['wires', 'morph'])
            element(id).addEventListener('change', event => changed({[id]: event.target.checked}));
        // Who presses them with a pointer wants to move by keys next; who has come by Tab stays.
        element('panel').addEventListener('click', ({detail, target}) => {
            if (detail > 0 && target.matches('[type=radio], [type=checkbox]')) target.blur();
        });
        element('terrain').addEventListener('change', event => changed({terrain: event.target.value}));
        element('tau').max = TAUS.length - 1;
        element('eps').max = EPSES.length - 1;
        element('tau').addEventListener('input', event => changed({tau: TAUS[event.target.value]}));
        element('eps').addEventListener('input', event => changed({eps: EPSES[event.target.value]}));
        element('exaggeration').addEventListener('input', event => changed({exaggeration: Number(event.target.value)}));
        element('sheet').addEventListener('click', () => {
            const isOpen = element('panel').classList.toggle('open');
            element('sheet').setAttribute('aria-expanded', isOpen);
        });
    }

    fill(terrains) {
        element('terrain').replaceChildren(...terrains.map(({id}) => new Option(id, id)));
    }

    /** @param settings of main.js @param terrain as service.js has it */
    show(settings, terrain) {
        for (const id of ['ask', 'colour', 'mode', 'tool']) {
            const chosen = element(id).querySelector(`[value=${settings[id]}]`);
            if (chosen) chosen.checked = true;
        }
        element('wires').checked = settings.wires;
        element('morph').checked = settings.morph;
        element('terrain').value = settings.terrain;
        element('tau-row').hidden = settings.ask !== 'view';
        element('eps-row').hidden = settings.ask !== 'range';
        this.slide('tau', nearest(TAUS, settings.tau), pixels(settings.tau));
        this.slide('eps', nearest(EPSES, settings.eps), metres(settings.eps));
        this.slide('exaggeration', settings.exaggeration, `${plain(settings.exaggeration)}\u00a0\u00d7`);
        const {width, height, min_z: lowest, max_z: highest} = terrain.terrain;
        const heights = lowest === null ? 'all void' : `${plain(lowest)} to ${plain(highest)}\u00a0m`;
        element('facts').textContent = `${count(width)} \u00d7 ${count(height)} samples, ${heights}`;
    }

    slide(id, value, text) {
        element(id).value = value;
        element(id).setAttribute('aria-valuetext', text);
        document.querySelector(`output[for=${id}]`).textContent = text;
    }

    /** The next finer (-1) or coarser (1) tolerance of the settings. */
    static step(settings, by) {
        const key = settings.ask === 'view' ? 'tau' : 'eps', list = key === 'tau' ? TAUS : EPSES;
        return {[key]: list[Math.min(list.length - 1, Math.max(0, nearest(list, settings[key]) + by))]};
    }
}
