// legend.js - what the colours mean.

import {ERROR, LAND, SEA, rampCss} from './palette.js';
import {metres, plain} from './format.js';

const legend = document.getElementById('legend');

function show(ramps, ticks, note) {
    legend.querySelector('.note').textContent = note;
    legend.querySelector('.ramps').replaceChildren(...ramps.map(({stops, share}) => {
        const ramp = document.createElement('div');
        ramp.style.background = rampCss(stops);
        ramp.style.flex = String(share);
        return ramp;
    }));
    legend.querySelector('.ticks').replaceChildren(...ticks.map(text => {
        const tick = document.createElement('span');
        tick.textContent = text;
        return tick;
    }));
}

/** @param heights [lowest, highest] in metres @param errors the same of a mesh that has them */
export function showLegend(colouring, heights, errors) {
    legend.hidden = colouring === 'plain';
    if (legend.hidden) return;
    const [low, high] = colouring === 'relief' ? heights : errors;
    if (colouring === 'error')
        show([{stops: ERROR, share: 1}], [`under ${metres(low)}`, metres(Math.sqrt(low * high)), `over ${metres(high)}`],
            'What leaving out a vertex would cost at most');
    else if (low < 0 && high > 0)
        show([{stops: SEA, share: 0.5}, {stops: LAND, share: 0.5}], [plain(low), '0', metres(high)], 'Height');
    else
        show([{stops: low < 0 ? SEA : LAND, share: 1}], [plain(low), plain((low + high) / 2), metres(high)], 'Height');
}
