// main.js - begins the viewer of rqt serve, or says why there is none.
//
// For tests there is window.rqtViewer:
//   ready             Promise, kept when the viewer stands: of true, or of false where the page says why not
//   state()           {settings, camera, figures, terrain}: camera as it is asked with; figures of what is shown
//   setCamera(json)   stands the camera as ext/camera.c has it (eye, at or yaw and pitch, position crs or ecef, ...)
//   set(settings)     {terrain, ask, tau, eps, colour, wires, morph, mode, tool, exaggeration}
//   settled()         Promise, kept when the answer for the camera as it is is shown and nothing moves
//   pick(px, py)      Promise of {x, y, height} of the place under CSS pixels of the canvas, height the service's; or null
//   mesh()            the Mesh (wire.js) that is shown

import {askHeight, askTerrains} from './service.js';
import {Viewer} from './viewer.js';

const element = id => document.getElementById(id);

/** In place of the picture, where there cannot be one. */
function excuse(sentence) {
    const box = document.createElement('div');
    box.id = 'nothing';
    box.innerHTML = '<p></p><p><a href="collections">The terrains</a>, <a href="openapi.json">the API</a></p>';
    box.firstChild.textContent = sentence;
    element('stage').append(box);
    for (const id of ['hint', 'corner', 'panel']) element(id).hidden = true;
    document.body.className = 'bare';
}

function hookOf(viewer) {
    return {
        state: () => viewer.state(),
        setCamera: json => viewer.setCamera(json),
        set: settings => viewer.set(settings),
        settled: () => viewer.settled(),
        pick: async (px, py) => {
            const place = viewer.placeAt([px, py]);
            return place && {x: place[0], y: place[1], height: await askHeight(viewer.terrain.id, place[0], place[1])};
        },
        mesh: () => viewer.stage && viewer.stage.mesh,
    };
}

async function begin() {
    let terrains;
    try {
        terrains = await askTerrains();
    } catch (problem) {
        excuse(problem.message);
        return undefined;
    }
    if (!terrains.length) {
        excuse('There is no terrain in the databases that are served.');
        return undefined;
    }
    if (!document.createElement('canvas').getContext('webgl2')) {
        excuse('This browser shows no WebGL 2, which the viewer draws with. All else answers:');
        return undefined;
    }
    return hookOf(new Viewer(terrains));
}

window.rqtViewer = {};
window.rqtViewer.ready = begin().then(hook => {
    Object.assign(window.rqtViewer, hook);
    return Boolean(hook);
});
