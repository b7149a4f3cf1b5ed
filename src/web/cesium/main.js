// main.js - begins the page /cesium, or says why there is nothing to see.
//
// For tests there is window.rqtCesium:
//   ready              Promise, kept when the globe stands: of true, or of false where the page says why not
//   state()            {terrain, tiles, camera, exaggeration, contours, wires, fly, levels, errors}
//   set(settings)      {exaggeration, contours, wires, fly}
//   setCamera(camera)  {longitude, latitude, height, heading, pitch}: degrees, metres above the ellipsoid
//   seek(share)        puts the flight at a share of its round
//   settled()          Promise, kept when every tile that the picture needs is in it
//   sample(places, z)  Promise of heights above the ellipsoid, of level z or of the finest that there is (Cesium's sampleTerrain)
//   sampleTileset(p)   the same, as 3D Tiles are seen from above (Cesium's sampleHeightMostDetailed)
//   pick(x, y)         {longitude, latitude, height} under CSS pixels, or null
//   globe              the TerrainGlobe (globe.js)

import {metres} from '../format.js';
import {askTerrains} from '../service.js';
import {Flight} from './flight.js';
import {TerrainGlobe} from './globe.js';
import {addressOf, readAddress, writeFragment} from './state.js';

const element = id => document.getElementById(id);
const WGS84 = {semi_major: 6378137, inverse_flattening: 298.257223563};

/** In place of the picture, where there cannot be one. */
function excuse(sentence) {
    element('excuse').querySelector('p').textContent = sentence;
    element('excuse').hidden = false;
    for (const id of ['stage', 'tools']) element(id).hidden = true;
    return undefined;
}

/** Terrains that may have tiles: the service knows for certain. */
const isOnGlobe = ({terrain}) => terrain.lonlat && terrain.semi_major === WGS84.semi_major && Math.abs(terrain.inverse_flattening - WGS84.inverse_flattening) < 1e-6;

function listTerrains(terrains, chosen, tiles) {
    element('terrain').replaceChildren(...terrains.map(({id}) => new Option(id, id, id === chosen, id === chosen)));
    element('terrain').onchange = event => { location.href = addressOf(event.target.value, tiles); };
    // The same view, of the other kind.
    element('tiles').value = tiles;
    element('tiles').onchange = event => { location.href = addressOf(chosen, event.target.value) + location.hash; };
    element('viewer').href = `./#terrain=${encodeURIComponent(chosen)}`;
    document.title = `${chosen} \u2013 rqt, Cesium`;
}

class Page {
    constructor(terrain, globe, flight, given) {
        Object.assign(this, {terrain, tiles: given.tiles, globe, flight, settings: {exaggeration: 1, contours: false, wires: false, fly: false}});
        globe.onProblem = sentence => this.complain(sentence);
        globe.onFrame = now => flight.step(now, this.settings.exaggeration);
        globe.scene.postRender.addEventListener(() => this.tell());
        globe.scene.camera.moveEnd.addEventListener(() => this.keep());
        const {exaggeration = 1, contours, wires, fly, camera} = given;
        this.set({exaggeration, contours, wires, fly});
        if (camera) globe.camera = camera;
        else flight.show(exaggeration);
        element('fly').onclick = () => this.set({fly: !this.settings.fly});
        element('home').onclick = () => this.home();
        element('exaggeration').oninput = event => this.set({exaggeration: Number(event.target.value)});
        for (const id of ['contours', 'wires']) element(id).onchange = event => this.set({[id]: event.target.checked});
        element('more').open = !matchMedia('(max-width: 520px)').matches;
        element('dismiss').onclick = () => { element('problem').hidden = true; };
        // Whoever takes hold of the globe flies no more.
        for (const kind of ['pointerdown', 'wheel']) globe.canvas.addEventListener(kind, () => this.set({fly: false}), {passive: true});
        addEventListener('keydown', event => this.press(event));
    }

    set(changes) {
        const {settings, globe, flight} = this;
        for (const [key, value] of Object.entries(changes)) if (key in settings && value !== undefined) settings[key] = value;
        for (const key of ['exaggeration', 'contours', 'wires']) if (key in changes) globe[key] = settings[key];
        flight.isOn = settings.fly;
        element('fly').setAttribute('aria-pressed', settings.fly);
        element('fly').querySelector('span').textContent = settings.fly ? 'Pause' : 'Fly';
        element('exaggeration').value = settings.exaggeration;
        element('exaggeration-told').textContent = `\u00d7${settings.exaggeration}`;
        for (const id of ['contours', 'wires']) element(id).checked = settings[id];
        if (!settings.fly) this.keep();
    }

    home() {
        this.set({fly: false});
        this.flight.show(this.settings.exaggeration);
    }

    /** In the address, so that the view can be linked and loaded again. */
    keep() {
        if (this.flight.isOn) return;
        const fragment = writeFragment({...this.settings, camera: this.globe.camera});
        if (fragment !== location.hash) history.replaceState(null, '', fragment);
    }

    complain(sentence) {
        element('problem').querySelector('p').textContent = sentence;
        element('problem').hidden = false;
    }

    /** How far what is shown may be from the samples: layer.json's word for the levels that are in the picture. */
    tell() {
        const levels = this.globe.shownLevels(), {errors} = this.globe.levels;
        const text = levels === undefined ? 'Loading\u2026' : levels.finest === levels.coarsest ?
            `Level ${levels.finest}: proved to be off by no more than ${metres(errors[levels.finest])}` :
            `Levels ${levels.coarsest} to ${levels.finest}: proved to be off by no more than ${metres(errors[levels.finest])} near, ${metres(errors[levels.coarsest])} far`;
        if (element('promise').textContent !== text) element('promise').textContent = text;
    }

    press(event) {
        if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches?.('select')) return;
        const {settings, globe: {scene: {camera}}} = this, isControl = event.target.matches?.('input, button, a');
        const by = event.shiftKey ? 3 : 1, height = Math.max(camera.positionCartographic.height - this.flight.height * settings.exaggeration, 100);
        const move = (name, ...how) => () => {
            this.set({fly: false});
            camera[name](...how);
            this.globe.scene.requestRender();
            this.keep();
        };
        const stretch = step => () => this.set({exaggeration: Math.min(10, Math.max(1, settings.exaggeration + step))});
        const actions = {
            ' ': isControl ? null : () => this.set({fly: !settings.fly}),
            m: () => this.set({wires: !settings.wires}),
            c: () => this.set({contours: !settings.contours}),
            n: () => this.lookNorth(),
            '[': stretch(-0.5),
            ']': stretch(0.5),
            '+': move('zoomIn', 0.2 * by * height),
            '=': move('zoomIn', 0.2 * by * height),
            '-': move('zoomOut', 0.2 * by * height),
            ArrowLeft: isControl ? null : move('lookLeft', 0.05 * by),
            ArrowRight: isControl ? null : move('lookRight', 0.05 * by),
            ArrowUp: isControl ? null : move('moveForward', 0.1 * by * height),
            ArrowDown: isControl ? null : move('moveBackward', 0.1 * by * height),
            Home: isControl ? null : () => this.home(),
        };
        const action = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
        if (!action) return;
        action();
        event.preventDefault();
    }

    lookNorth() {
        this.set({fly: false});
        this.globe.camera = {...this.globe.camera, heading: 0};
    }

    hook() {
        const {globe, flight, settings} = this;
        return {
            state: () => ({terrain: this.terrain.id, tiles: this.tiles, camera: globe.camera, ...settings, levels: globe.shownLevels(), errors: globe.levels.errors}),
            set: changes => this.set(changes),
            setCamera: camera => { globe.camera = camera; },
            seek: share => { flight.at = share; flight.show(settings.exaggeration); },
            settled: () => globe.settled(),
            sample: (places, level) => globe.sample(places, level),
            sampleTileset: places => globe.surface.sample(places),
            pick: (x, y) => globe.pick(x, y),
            globe,
        };
    }
}

async function begin() {
    const given = readAddress(location);
    try {
        const terrains = await askTerrains(), onGlobe = terrains.filter(isOnGlobe);
        const terrain = given.terrain === undefined ? onGlobe[0] : terrains.find(({id}) => id === given.terrain);
        if (given.terrain !== undefined && !terrain) return excuse(`There is no terrain ${given.terrain}.`);
        if (!terrain) return excuse('There is no terrain in longitude and latitude on WGS 84 in the databases that are served: others have no tiles for globes.');
        listTerrains(onGlobe.includes(terrain) ? onGlobe : [terrain, ...onGlobe], terrain.id, given.tiles);
        if (!document.createElement('canvas').getContext('webgl2')) return excuse('This browser shows no WebGL 2, which Cesium draws with.');
        const stage = {canvas: element('picture'), credits: element('credits'), lightbox: element('stage')};
        const globe = await TerrainGlobe.create(stage, terrain, given.tiles);
        const page = new Page(terrain, globe, await Flight.round(globe, terrain.bbox, globe.heights), given);
        return page.hook();
    } catch (problem) {
        return excuse(problem.message);
    }
}

window.rqtCesium = {};
window.rqtCesium.ready = begin().then(hook => {
    Object.assign(window.rqtCesium, hook);
    return Boolean(hook);
});
