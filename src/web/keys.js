// keys.js - keys that do something once; those that are held are for controls.js.

import {COLOURINGS} from './material.js';
import {Panel} from './panel.js';

const element = id => document.getElementById(id);

/** @param viewer of viewer.js @param event a keydown */
export function press(viewer, event) {
    if (event.ctrlKey || event.metaKey || event.altKey || element('help').open || event.target.matches?.('select')) return;
    const {settings} = viewer, set = changes => () => viewer.set(changes);
    const isSlider = event.target.matches?.('input'), canvas = element('picture');
    const actions = {
        o: set({mode: 'orbit'}),
        f: set({mode: 'fly'}),
        n: () => viewer.turnNorth(),
        m: set({wires: !settings.wires}),
        g: set({morph: !settings.morph}),
        v: set({ask: settings.ask === 'view' ? 'range' : 'view'}),
        c: set({colour: COLOURINGS[(COLOURINGS.indexOf(settings.colour) + 1) % COLOURINGS.length]}),
        p: set({tool: settings.tool === 'profile' ? 'height' : 'profile'}),
        x: () => viewer.click([canvas.clientWidth / 2, canvas.clientHeight / 2]),
        '[': () => viewer.set(Panel.step(settings, -1)),
        ']': () => viewer.set(Panel.step(settings, 1)),
        '?': () => element('help').showModal(),
        Escape: () => viewer.clear(),
        Home: isSlider ? null : () => viewer.lookAtAll(),
    };
    const action = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    action();
    event.preventDefault();
}
