// viewer.js - what belongs together, and what happens in a frame.
//
// service.js asks; stream.js has one question under way, and decoder.js, a worker, makes of its answer what
// terrain_layer.js shows; camera.js is the eye, moved by controls.js through orbit.js or fly.js; panel.js, figures.js,
// legend.js, marks.js, measure.js and profile.js are what people read and press; state.js keeps it all in the URL.

import {Camera, lookAtAll} from './camera.js';
import {Controls} from './controls.js';
import {Figures} from './figures.js';
import {Fly} from './fly.js';
import {Glide} from './glide.js';
import {press} from './keys.js';
import {showLegend} from './legend.js';
import {Marks} from './marks.js';
import {COLOURINGS} from './material.js';
import {Measure} from './measure.js';
import {Orbit} from './orbit.js';
import {Panel} from './panel.js';
import {groundBelow, pickPoint} from './pick.js';
import {Picture} from './picture.js';
import {Profile} from './profile.js';
import {add, clamp, createScene, dot, length, subtract} from './scene.js';
import {rangePath, viewPath} from './service.js';
import {readFragment, writeFragment} from './state.js';
import {Stream} from './stream.js';
import {TerrainLayer} from './terrain_layer.js';
import {place as placeText} from './format.js';

const HINT_MILLISECONDS = 10000;
const CLEARANCE = 1.7; // metres: the eye does not get into the ground
const USUAL = {ask: 'view', tau: 1, eps: 5, colour: 'relief', wires: false, morph: true, mode: 'orbit', tool: 'height', exaggeration: 1};

const element = id => document.getElementById(id);
const isStill = matchMedia('(prefers-reduced-motion: reduce)');

export class Viewer {
    constructor(terrains) {
        this.terrains = terrains;
        this.settings = {...USUAL};
        this.isCapture = readFragment(location.hash).capture;
        this.picture = new Picture(element('picture'), this.isCapture, lost => this.lose(lost));
        this.layer = new TerrainLayer(this.picture.scene);
        this.stream = new Stream(stage => this.show(stage), sentence => this.fail(sentence, true));
        this.marks = new Marks(element('pins'), this.picture.scene);
        this.profile = new Profile(element('profile'), {
            pointed: row => this.measure.point(row), closed: () => this.measure.clear(),
        });
        this.measure = new Measure(this.marks, this.profile, {
            terrain: () => this.terrain.id, scene: () => this.scene, exaggeration: () => this.settings.exaggeration,
            fail: sentence => this.fail(sentence), changed: () => this.redraw(),
        });
        this.figures = new Figures();
        this.panel = new Panel(settings => this.set(settings));
        this.panel.fill(terrains);
        this.controls = new Controls(element('picture'), {
            mode: () => this.move(), click: at => this.click(at), double: () => this.double(), changed: () => this.moved(),
        });
        this.stage = null;
        this.frames = {last: 0, shown: 0, since: 0, cost: 0};
        this.isWanted = true; // is there anything to draw?
        this.waiting = [];
        this.listen();
        this.load();
        requestAnimationFrame(now => this.frame(now));
    }

    listen() {
        window.addEventListener('hashchange', () => location.hash !== this.fragment && this.load());
        window.addEventListener('keydown', event => press(this, event));
        new ResizeObserver(() => this.redraw()).observe(element('picture'));
        element('compass').addEventListener('click', () => this.turnNorth());
        element('home').addEventListener('click', () => this.lookAtAll());
        element('keys').addEventListener('click', () => element('help').showModal());
        element('help').addEventListener('click', event => event.target === element('help') && element('help').close());
        element('problem').querySelector('button').addEventListener('click', () => this.fail(''));
        matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.restyle());
        setTimeout(() => element('hint').classList.add('gone'), HINT_MILLISECONDS);
        this.restyle();
    }

    restyle() {
        const isDark = matchMedia('(prefers-color-scheme: dark)').matches;
        this.layer.uniforms.hazeColour.value = isDark ? [0.14, 0.17, 0.2] : [0.84, 0.88, 0.91];
        this.marks.restyle();
        this.redraw();
    }

    /** Takes everything from the URL. */
    load() {
        const {camera, capture, terrain, ...given} = readFragment(location.hash);
        this.settings = {...this.settings, ...Object.fromEntries(Object.entries(given).filter(([, value]) => value !== undefined))};
        const chosen = this.terrains.find(({id}) => id === terrain) || this.terrain || this.terrains[0];
        if (terrain && chosen.id !== terrain) this.fail(`There is no terrain ${terrain}.`);
        this.open(chosen);
        this.camera.exaggeration = this.settings.exaggeration;
        if (camera) {
            this.camera.read(camera);
            this.glide.stop();
            this.isStandTaken = true;
        }
        this.changed();
    }

    /** Shows a terrain, whole. */
    open(terrain) {
        if (terrain === this.terrain) return;
        this.terrain = terrain;
        this.measure.clear();
        this.layer.clear();
        this.figures.showNothing();
        this.isMeshMissing = false;
        this.stage = null;
        this.scene = createScene(terrain.terrain);
        // The same object for the same terrain: by this the worker knows it.
        terrain.forWorker ||= this.scene.how;
        this.camera = new Camera(this.scene);
        this.extent = extentOf(this.scene, terrain);
        this.orbit = new Orbit(this.camera, at => this.pointAt(at), 4 * this.extent.radius);
        this.fly = new Fly(this.camera, () => this.clearance());
        this.glide = new Glide(this.camera);
        this.camera.exaggeration = this.settings.exaggeration;
        this.picture.fit(this.camera);
        this.stand();
        this.isStandTaken = false;
        document.title = `${terrain.id} \u2013 rqt`;
    }

    /** The heights of the ground as they are drawn; 0 where all is void. */
    heights() {
        const {min_z: lowest, max_z: highest} = this.terrain.terrain;
        return [lowest * this.settings.exaggeration, highest * this.settings.exaggeration];
    }

    stand() {
        this.camera.fovy = Camera.usualAngle(this.camera.width, this.camera.height);
        lookAtAll(this.camera, this.terrain.bbox, this.heights(), this.stage?.geometry, this.openShare());
    }

    /** How much of the picture's height a phone's sheet leaves: its middle is that of what is left (viewer.css). */
    openShare() {
        const canvas = element('picture').getBoundingClientRect();
        return clamp(1 + 2 * canvas.top / canvas.height, 0.2, 1);
    }

    lookAtAll() {
        this.isStandTaken = true;
        this.glide.to(() => this.stand(), performance.now(), isStill.matches);
        this.redraw();
    }

    turnNorth() {
        const yaw = this.camera.yaw > 180 ? this.camera.yaw - 360 : this.camera.yaw, isOrbit = this.settings.mode === 'orbit';
        const anchor = this.orbit.pointAt([0, 0]);
        let done = 0;
        this.glide.begin(t => {
            if (isOrbit) {
                Object.assign(this.orbit, {anchor, at: [0, 0]});
                this.orbit.turn((t - done) * yaw * Math.PI / 180, 0);
                this.orbit.end();
                if (t === 1) this.camera.yaw = 0;
            } else {
                this.camera.turn(-(t - done) * yaw, 0);
            }
            done = t;
        }, performance.now(), isStill.matches);
        this.redraw();
    }

    move() {
        return this.settings.mode === 'fly' ? this.fly : this.orbit;
    }

    /** Takes settings that a person, the URL or a test has changed. */
    set(settings) {
        const {terrain, ...others} = settings, before = this.settings.exaggeration;
        Object.assign(this.settings, others);
        const chosen = terrain && this.terrains.find(({id}) => id === terrain);
        if (chosen) this.open(chosen);
        if (this.settings.exaggeration !== before) this.exaggerate(before);
        if (settings.tool) this.measure.clear();
        this.changed();
    }

    /** The ground rises or sinks, and the eye with what it looks at. */
    exaggerate(before) {
        const {camera, settings: {exaggeration}} = this, ground = this.groundHeight();
        camera.exaggeration = exaggeration;
        if (!Number.isNaN(ground)) {
            const [x, y, height] = camera.place;
            camera.eye = this.scene.point([x, y, height + ground * (exaggeration / before - 1)]);
        }
    }

    changed() {
        const {uniforms} = this.layer, {settings, terrain} = this;
        this.panel.show({...settings, terrain: terrain.id}, terrain);
        uniforms.exaggeration.value = settings.exaggeration;
        uniforms.heightRange.value.set(terrain.terrain.min_z, terrain.terrain.max_z);
        element('picture').classList.toggle('measuring', settings.tool === 'profile');
        this.paint();
        this.measure.redraw();
        this.redraw();
    }

    /** Colours as they are wanted and can be: errors come with the next mesh only. */
    paint() {
        const {min_z: lowest, max_z: highest} = this.terrain.terrain, errors = this.stage?.errorRange;
        const colour = this.settings.colour === 'error' && !errors ? 'plain' : this.settings.colour;
        this.layer.uniforms.colouring.value = COLOURINGS.indexOf(colour);
        showLegend(colour, [lowest, highest], errors);
        if (errors) this.layer.uniforms.errorRange.value.set(Math.log2(errors[0]), Math.log2(errors[1]));
    }

    /** The camera has moved by hand. */
    moved() {
        this.glide.stop();
        this.isStandTaken = true;
        element('hint').classList.add('gone');
        this.redraw();
    }

    redraw() {
        this.isWanted = true;
    }

    // ------------------------------------------------------------------------------------------------- the ground

    /** The point of the mesh at a place of the picture, or null. */
    pointAt(at) {
        return this.stage && pickPoint(this.stage.geometry, this.camera.eye, this.camera.direction(...at));
    }

    /** Is the mesh at a place of the picture well in front of a depth? */
    hides(x, y, depth) {
        const point = this.pointAt([x, y]);
        return Boolean(point) && this.camera.project(point).depth < 0.98 * depth;
    }

    ground() {
        return this.stage && groundBelow(this.stage.geometry, this.scene, this.camera.eye);
    }

    groundHeight() {
        const ground = this.ground();
        return ground ? this.scene.place(ground)[2] : NaN;
    }

    /** Metres from the ground up to the eye; NaN where there is none. */
    clearance() {
        const ground = this.ground(), {up} = this.scene.axes(this.camera.place);
        return ground ? dot(subtract(this.camera.eye, ground), up) : NaN;
    }

    keepAboveGround() {
        const clearance = this.clearance();
        if (!(clearance < CLEARANCE)) return clearance;
        const {up} = this.scene.axes(this.camera.place);
        this.camera.eye = add(this.camera.eye, up, CLEARANCE - clearance);
        return CLEARANCE;
    }

    /** The place of the terrain at CSS pixels of the canvas: [x, y, metres on the mesh]; null beside it. */
    placeAt(pixels) {
        const point = this.pointAt(this.controls.placeOf(pixels));
        if (!point) return null;
        const [x, y, height] = this.scene.place(point);
        return [x, y, height / this.settings.exaggeration];
    }

    click(pixels) {
        const place = this.placeAt(pixels);
        element('hint').classList.add('gone');
        this.fail('');
        if (place) this.measure.click(place, this.settings.tool);
    }

    /** The first click of the two was none. */
    double() {
        this.measure.cancel();
        this.lookAtAll();
    }

    // ------------------------------------------------------------------------------------------------- the meshes

    /** What is to be shown, as the stream has it. */
    wish() {
        const {camera, terrain, settings: {ask, tau, eps, wires, morph, colour, exaggeration}} = this;
        const format = colour === 'error' ? 'rqt+normals+errors' : 'rqt+normals';
        return {
            path: ask === 'view' ? viewPath(terrain.id, camera.json(tau), format)
                : rangePath(terrain.id, eps, format),
            terrain: terrain.forWorker, exaggeration, origin: camera.eye, withEdges: wires,
            withMorph: morph && !isStill.matches, ask, asked: ask === 'view' ? tau : eps,
        };
    }

    /** Shows an answer; its promise is kept when the next may come. */
    async show(stage) {
        if (stage.wish.terrain !== this.terrain.forWorker) return;
        this.stage = {...stage, errorRange: rangeOf(stage.geometry.errors)};
        // How high the terrain is where is known by its first mesh: nobody has seen it from anywhere else yet.
        if (!this.isStandTaken) this.stand();
        this.isStandTaken = true;
        this.layer.show(stage, performance.now());
        this.figures.showStage(stage, this.terrain);
        element('bare').href = stage.wish.path;
        element('globe').href = `cesium?terrain=${encodeURIComponent(this.terrain.id)}`;
        element('globe').hidden = !this.terrain.terrain.lonlat;
        this.paint();
        if (this.isMeshMissing) this.fail('');
        this.isMeshMissing = false;
        this.redraw();
        while (this.layer.isMoving) await new Promise(resolve => requestAnimationFrame(resolve));
    }

    /** Says what is wrong; '': nothing is. What is said while a mesh does not come goes when one does. */
    fail(sentence, isMeshMissing = false) {
        if (isMeshMissing) {
            this.isMeshMissing = true;
            this.figures.showMissing();
        }
        element('problem').hidden = !sentence;
        element('problem').querySelector('p').textContent = sentence;
    }

    lose(isLost) {
        this.isLost = isLost;
        this.fail(isLost ? 'The graphics card has taken the picture away. It comes back by itself, or when the page is loaded anew.' : '');
        this.redraw();
    }

    // -------------------------------------------------------------------------------------------------- the frame

    frame(now) {
        requestAnimationFrame(next => this.frame(next));
        const {frames} = this, seconds = Math.min(0.2, (now - frames.last) / 1000);
        frames.last = now;
        const isKeyed = this.controls.step(seconds, this.settings.mode === 'fly');
        if (isKeyed) this.moved();
        const isGliding = this.glide.advance(now);
        if (this.picture.fit(this.camera)) this.redraw();
        if (!this.isWanted && !isKeyed && !isGliding && !this.layer.isMoving) {
            if (frames.since) this.rest();
            this.settle();
            return;
        }
        this.isWanted = false;
        this.layer.advance(now);
        this.draw(now);
        this.settle();
    }

    draw(now) {
        const clearance = this.keepAboveGround(), started = performance.now(), {frames, camera, extent} = this;
        // It is where its JSON and the address say, to the last bit: both show the same picture.
        camera.read(camera.json(this.settings.tau));
        this.layer.uniforms.hazeDistance.value = extent.radius * 3;
        if (!this.isLost) this.picture.draw(camera, Number.isNaN(clearance) ? extent.radius : clearance, extent);
        frames.cost = performance.now() - started;
        const wish = this.wish();
        this.stream.want(wish);
        this.figures.showWait(this.stage?.wish.path !== wish.path && !this.isMeshMissing);
        const {clientWidth, clientHeight} = element('picture');
        this.marks.place(camera, clientWidth, clientHeight, (x, y, depth) => this.hides(x, y, depth));
        element('needle').setAttribute('transform', `rotate(${-camera.yaw})`);
        const [x, y] = camera.place;
        this.figures.showEye(clearance, placeText(x, y, this.scene.isSpace, 4));
        frames.since ||= now;
        frames.shown++;
        if (now - frames.since > 500) {
            this.figures.showFrame((frames.shown - 1) * 1000 / (now - frames.since), frames.cost);
            frames.since = now;
            frames.shown = 1;
        }
        this.keep();
    }

    /** Nothing moves any more. */
    rest() {
        this.frames.since = this.frames.shown = 0;
        this.figures.showFrame(0, this.frames.cost);
    }

    /** Writes the URL, soon. */
    keep() {
        clearTimeout(this.keeping);
        this.keeping = setTimeout(() => {
            const {terrain, camera, settings, isCapture} = this, {eye, yaw, pitch, fovy, exaggeration} = camera.json(settings.tau);
            this.fragment = writeFragment({
                ...settings, terrain: terrain.id, eye, yaw, pitch, fovy, exaggeration, capture: isCapture,
                tau: settings.ask === 'view' && settings.tau, eps: settings.ask === 'range' && settings.eps,
                morph: settings.morph ? undefined : '0',
            });
            history.replaceState(null, '', this.fragment);
        }, 300);
    }

    // ------------------------------------------------------------------------------------- what others see of it

    /** See main.js. */
    state() {
        const {settings, camera, terrain, stage, frames} = this;
        return {
            settings: {...settings}, camera: camera.json(settings.tau), terrain: terrain.id,
            figures: stage && {
                triangles: stage.mesh.triangleCount, vertices: stage.mesh.vertexCount, bytes: stage.bytes,
                ...stage.told, ...stage.milliseconds, clearance: this.clearance(), frame: frames.cost,
            },
        };
    }

    setCamera(json) {
        this.glide.stop();
        this.isStandTaken = true;
        this.camera.read(json);
        if (json.tau > 0) this.settings.tau = json.tau;
        this.settings.exaggeration = this.camera.exaggeration;
        this.changed();
    }

    settled() {
        return new Promise(resolve => this.waiting.push(resolve));
    }

    clear() {
        this.measure.clear();
        this.fail('');
    }

    get isSettled() {
        return this.stream.isSettled && !this.layer.isMoving && !this.glide.isMoving && !this.isWanted;
    }

    settle() {
        if (!this.waiting.length || !this.isSettled) return;
        for (const resolve of this.waiting.splice(0)) resolve();
    }
}

/** Errors between which most of a mesh's vertices are, in metres; null where it has none. */
function rangeOf(errors) {
    if (!errors) return null;
    const sorted = errors.filter(error => error > 0 && error < Infinity).sort(), {length: many} = sorted;
    const low = sorted[Math.floor(many * 0.02)], high = sorted[Math.floor(many * 0.98)];
    return low < high ? [low, high] : [0.1, 1];
}

/** A ball around a terrain, at whatever exaggeration. */
function extentOf(scene, {bbox: [x0, y0, x1, y1], terrain: {min_z: lowest, max_z: highest}}) {
    const centre = scene.point([(x0 + x1) / 2, (y0 + y1) / 2, 0]), deepest = 10 * Math.max(Math.abs(lowest), Math.abs(highest));
    // Of more than a sixth of the Earth, all of it.
    const isEarth = scene.isSpace && (x1 - x0 > 60 || y1 - y0 > 60);
    return {centre, radius: isEarth ? 1.3e7 : length(subtract(scene.point([x0, y0, 0]), centre)) * 1.2 + deepest};
}
