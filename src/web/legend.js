// legend.js - what the colours mean.

import {metres, plain} from './format.js';
import {ERROR, LAND, SEA, rampCss} from './ramps.js';
import {clamp} from './scene.js';

const legend = document.getElementById('legend');

/** @param ramps [{stops, share}] from left to right @param ticks [{at: 0 to 1, text}] */
function show(note, ramps, ticks) {
    legend.querySelector('.note').textContent = note;
    legend.querySelector('.ramps').replaceChildren(...ramps.map(({stops, share}) => {
        const ramp = document.createElement('div');
        ramp.style.background = rampCss(stops);
        ramp.style.flex = String(share);
        return ramp;
    }));
    legend.querySelector('.ticks').replaceChildren(...ticks.map(({at, text}) => {
        const tick = document.createElement('span');
        tick.style.left = `${100 * at}%`;
        tick.style.transform = `translateX(${-100 * at}%)`;
        tick.textContent = text;
        return tick;
    }));
}

/** @param heights [lowest, highest] in metres, null where all is void @param errors the same of a mesh that has them */
export function showLegend(colouring, heights, errors) {
    legend.hidden = colouring === 'plain' || colouring === 'relief' && heights[0] === null;
    if (legend.hidden) return;
    const [low, high] = colouring === 'relief' ? heights : errors;
    const ends = (first, middle, last) => [{at: 0, text: first}, {at: 0.5, text: middle}, {at: 1, text: last}];
    if (colouring === 'error') {
        show('Error without the vertex, at most', [{stops: ERROR, share: 1}],
            ends(`under ${metres(low)}`, metres(Math.sqrt(low * high)), `over ${metres(high)}`));
    } else if (low < 0 && high > 0) {
        const shore = clamp(-low / (high - low), 0.25, 0.75);
        show('Height', [{stops: SEA, share: shore}, {stops: LAND, share: 1 - shore}],
            [{at: 0, text: plain(low)}, {at: shore, text: '0'}, {at: 1, text: `${plain(high)}\u00a0m`}]);
    } else {
        show('Height', [{stops: low < 0 ? SEA : LAND, share: 1}], ends(plain(low), plain((low + high) / 2), `${plain(high)}\u00a0m`));
    }
}
