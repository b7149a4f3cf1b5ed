// cesium.test.mjs - Cesium itself as the judge of our tiles: what its sampleTerrain reads is the terrain, at every level; and
// the page /cesium, which flies over them and asks nobody else for anything.
//
// What is read is put beside rqt_height at full resolution. What a tile may be off stands in its metadata extension, which
// another decoder (HERE's) reads.
import assert from 'node:assert/strict';
import {execFileSync, spawnSync} from 'node:child_process';
import {mkdirSync, mkdtempSync, readFileSync, rmSync, symlinkSync} from 'node:fs';
import {join} from 'node:path';
import {after, before, test} from 'node:test';
import {PATIENCE, PHONE, SMALL, keepingShots, launch, openPage} from './browser.mjs';
import {Dice} from './oracle.mjs';
import {BUILD, ROOT, requirePackage} from './packages.mjs';
import {differingPixels, findGaps} from './picture.mjs';
import {Service, sql} from './serve.mjs';
import {vanishingPoint} from './space.mjs';

const {default: decode} = requirePackage('@here/quantized-mesh-decoder');
const RQT = process.env.RQT || join(BUILD, 'rqt');
const PLACES = 160; // in each terrain, a few of which are too near to its rim or to voids
const WINDOWS = 4, WINDOW = 100; // in which they are; samples a side
const UNSEEN = {width: 64, height: 64}; // where pictures do not matter
const data = name => join(ROOT, 'tests', 'data', name);

/** x0, y0: the first sample; step in degrees. */
const TERRAINS = {
    white: {sources: [join(ROOT, 'examples', 'N44W072.hgt.zip')], x0: -72, y0: 45, step: 1 / 1200, columns: 1201, rows: 1201},
    // Two sheets, one terrain; voids.
    pyrenees: {sources: [data('N42E001.hgt.zip'), data('N41E001.hgt.zip')], x0: 1, y0: 43, step: 1 / 1200, columns: 1201, rows: 2401, hasVoids: true},
    africa: {sources: [data('eastafrica.tif')], x0: 25, y0: 6.983333, step: 0.05, columns: 220, rows: 380},
    // Both tiles of level 0, both poles.
    world: {sources: [data('etopo1_1deg.tif')], x0: -180, y0: 90, step: 1, columns: 361, rows: 181},
};
const METRES = {sources: [data('glarus_alpine_25m_161.tif')]};

const home = mkdtempSync(join(ROOT, 'build', 'web-tests', 'cesium-'));
const database = join(home, 'terrains.gpkg');
let service, browser;
const views = [];
const dice = new Dice(20261126);
console.log(`RQT_SEED=${dice.seed}`);

before(async () => {
    for (const [name, {sources}] of Object.entries({...TERRAINS, metres: METRES}))
        execFileSync(RQT, ['import', '--name', name, ...sources, database], {stdio: 'pipe'});
    [service, browser] = await Promise.all([Service.start({databases: [database]}), launch()]);
});
after(async () => {
    await browser.close();
    const ended = await service.stop();
    rmSync(home, {recursive: true});
    assert.deepEqual(ended, {status: 0, said: ''});
});

async function open(path, options = SMALL) {
    const view = await openPage(browser, service, {...options, path: `cesium${path}`});
    views.splice(0, Infinity, view);
    // Software stands in for the graphics card.
    await view.page.evaluate(() => { if (window.rqtCesium.globe) window.rqtCesium.globe.scene.msaaSamples = 1; });
    return view;
}

/** Until every tile that the picture needs is in it. */
async function settled(view) {
    const is = await view.page.evaluate(patience => Promise.race([
        window.rqtCesium.settled().then(() => true), new Promise(resolve => setTimeout(resolve, patience, false)),
    ]), PATIENCE);
    assert.ok(is, `it settles: ${JSON.stringify(await state(view))}`);
}
const state = view => view.page.evaluate(() => window.rqtCesium.state());
const sentence = view => view.page.evaluate(() => document.querySelector('#excuse').innerText);

/** Shares of the picture that change when the terrain is not drawn. */
async function shareOfTerrain(view) {
    const show = is => view.page.evaluate(async shown => {
        const {globe} = window.rqtCesium;
        globe.surface.isShown = shown;
        for (let i = 0; i < 3; i++) {
            globe.scene.requestRender();
            await new Promise(resolve => requestAnimationFrame(resolve));
        }
    }, is);
    const picture = await view.picture();
    await show(false);
    const share = differingPixels(picture, await view.picture()) / picture.width / picture.height;
    await show(true);
    return share;
}

// ------------------------------------------------------------------------------------------------------------- heights

/**
 * Places within a terrain, in a few windows so that they share tiles: samples, places between, and places on the sides of
 * tiles of its last level.
 */
function placesOf({x0, y0, step, columns, rows}, finest) {
    const side = 180 / 2 ** finest, places = [];
    let window = [];
    for (let i = 0; i < PLACES; i++) {
        if (i % (PLACES / WINDOWS) === 0) window = [columns, rows].map(count => 1 + dice.below(count - WINDOW - 2));
        const [column, row] = window.map(first => i % 2 ? first + WINDOW * dice.below(2 ** 30) / 2 ** 30 : first + dice.below(WINDOW));
        let x = x0 + step * column, y = y0 - step * row;
        if (i % 8 === 1) x = Math.round((x + 180) / side) * side - 180;
        if (i % 8 === 3) y = Math.round((y + 90) / side) * side - 90;
        if (x > x0 + step && x < x0 + (columns - 2) * step && y < y0 - step && y > y0 - (rows - 2) * step) places.push([x, y]);
    }
    return places;
}

/** Heights at full resolution; null where there is none. */
async function heightsAt(terrain, places) {
    const heights = [];
    for (let i = 0; i < places.length; i += 1000) {
        const rows = await sql("SELECT rqt_height(json_extract(value, '$[0]'), json_extract(value, '$[1]'), 0, :terrain) AS z FROM json_each(:places)",
            {terrain, places: JSON.stringify(places.slice(i, i + 1000))}, database);
        heights.push(...rows.map(({z}) => z));
    }
    return heights;
}

const stated = new Map();
/** What a tile says that it may be off, above and below; 0: there is none. */
async function statedBy(terrain, z, x, y) {
    const path = `collections/${terrain}/tiles/quantized-mesh/${z}/${x}/${y}.terrain`;
    if (!stated.has(path)) {
        const answer = await fetch(service.url + path), bytes = await answer.arrayBuffer();
        stated.set(path, answer.ok ? decode(bytes).extensions.metadata.verticalError || 0 : 0);
    }
    return stated.get(path);
}

/** The tiles of a level that a place is in: of a side, both. */
function tilesAt([longitude, latitude], z) {
    const side = 180 / 2 ** z, near = 1e-9, tiles = [];
    for (const x of new Set([-near, near].map(by => Math.floor((longitude + by + 180) / side))))
        for (const y of new Set([-near, near].map(by => Math.floor((latitude + by + 90) / side)))) tiles.push([x, y]);
    return tiles;
}

/** Fails where what Cesium has read is further from the terrain than the tile says; the share of that which the worst takes. */
async function judge(terrain, z, places, heights, read, mayMiss = false) {
    let worst = 0, above = 0, missed = 0;
    for (const [i, place] of places.entries()) {
        const allowed = Math.max(...await Promise.all(tilesAt(place, z).map(([x, y]) => statedBy(terrain, z, x, y))));
        assert.ok(allowed > 0, `${terrain}: a tile of level ${z} at ${place}`);
        if (read[i] === null && mayMiss) {
            missed++;
            continue;
        }
        assert.notEqual(read[i], null, `${terrain}: level ${z} has a height at ${place}, where it is ${heights[i]}`);
        const off = Math.abs(read[i] - heights[i]);
        assert.ok(off <= allowed + 1e-6, `${terrain}: level ${z} has ${read[i]} at ${place}, where it is ${heights[i]}, and states ${allowed}`);
        worst = Math.max(worst, off / allowed);
        above += read[i] > heights[i];
    }
    assert.ok(missed < places.length / 4, `${terrain}: level ${z} misses ${missed} of ${places.length}`);
    return {worst, above};
}

for (const [name, terrain] of Object.entries(TERRAINS))
    test(`${name}: sampleTerrainMostDetailed and sampleTerrain of every level are within what the tiles state`, keepingShots(`cesium-${name}`, () => views, async () => {
        const view = await open(`?terrain=${name}`, UNSEEN), {errors} = await state(view), finest = errors.length - 1;
        // Where all around are heights too: the outlines of voids move as vertices do.
        const all = placesOf(terrain, finest), around = terrain.step;
        const grid = await heightsAt(name, all.flatMap(([x, y]) => [-1, 0, 1].flatMap(i => [-1, 0, 1].map(j => [x + i * around, y + j * around]))));
        const places = [], heights = [];
        all.forEach((place, i) => {
            if (grid.slice(9 * i, 9 * i + 9).includes(null)) return;
            places.push(place);
            heights.push(grid[9 * i + 4]);
        });
        assert.ok(places.length >= 110, `${places.length} places`);
        const sample = level => view.page.evaluate(([p, z]) => window.rqtCesium.sample(p, z ?? undefined), [places, level]);
        const {worst} = await judge(name, finest, places, heights, await sample(null));
        assert.ok(worst > 0.01, `heights are rounded: ${worst}`);
        for (let z = 0; z <= finest; z++) {
            // The outlines of voids may be off by as much as heights: of a coarse level they hide more.
            const {above} = await judge(name, z, places, heights, await sample(z), terrain.hasVoids && z < finest);
            assert.ok(above > 0, `level ${z}`);
        }
        // Where there is no terrain, there is no height.
        if (name !== 'world') assert.deepEqual(await view.page.evaluate(() => window.rqtCesium.sample([[100, 10], [-100, -40]])), [null, null]);
        assert.deepEqual(view.problems, []);
        await view.close();
    }));

// ------------------------------------------------------------------------------------------------- Cesium with its checks

test('Cesium with its checks for developers cuts tiles that have terrain in part, or none: the picture is done', keepingShots('cesium-checks', () => views, async () => {
    const workers = ['createVerticesFromQuantizedTerrainMesh', 'upsampleQuantizedTerrainMesh', 'incrementallyBuildTerrainPicker', 'transferTypedArrayTest'];
    const out = join(home, 'checks'), packages = join(ROOT, 'build', 'cesium-packages');
    execFileSync(join(ROOT, 'src', 'web', 'cesium', 'bundle.sh'), ['--with-checks', out, packages, ...workers], {stdio: 'pipe'});
    assert.match(readFileSync(join(out, 'upsampleQuantizedTerrainMesh.js'), 'utf8'), /Rectangle width must be between 0 and 2 \* pi/);
    const served = new Set([...workers, 'cesium'].map(name => `${name}.js`));
    const prepare = page => page.route(url => served.has(url.pathname.slice(1)), route => route.fulfill({path: join(out, new URL(route.request().url()).pathname)}));
    // The northern rim, with voids before it; the tile of level 0 to the west has nothing.
    const view = await open('?terrain=pyrenees', {width: 160, height: 120, prepare});
    await settled(view);
    const {levels} = await state(view);
    assert.ok(levels.finest > 8, JSON.stringify(levels));
    assert.deepEqual(view.problems, []);
    await view.close();
}));

// ------------------------------------------------------------------------------------------------------------ 3D Tiles

/** What a subtree tells of its tiles: Map of level/x/y to {error, region}. */
async function readSubtree(terrain, level, x, y) {
    const answer = await fetch(`${service.url}collections/${terrain}/tiles/3d-tiles/subtrees/${level}/${x}/${y}.subtree`);
    const bytes = Buffer.from(await answer.arrayBuffer()), length = Number(bytes.readBigUInt64LE(8));
    const json = JSON.parse(bytes.toString('utf8', 24, 24 + length)), data = bytes.subarray(24 + length), told = new Map();
    const view = i => json.bufferViews[i].byteOffset, {error, region} = json.propertyTables[0].properties, {constant, bitstream} = json.tileAvailability;
    let place = 0, row = 0;
    for (let depth = 0; depth < 4; depth++)
        for (let morton = 0; morton < 4 ** depth; morton++, place++) {
            if (!(constant ?? data[view(bitstream) + (place >> 3)] >> place % 8 & 1)) continue;
            let i = 0, j = 0;
            for (let bit = 0; bit < depth; bit++) {
                i |= (morton >> 2 * bit & 1) << bit;
                j |= (morton >> (2 * bit + 1) & 1) << bit;
            }
            const from = view(region.values) + 48 * row;
            told.set([level + depth, (x << depth) + i, (y << depth) + j].join('/'),
                {error: data.readDoubleLE(view(error.values) + 8 * row), region: [0, 1, 2, 3, 4, 5].map(k => data.readDoubleLE(from + 8 * k))});
            row++;
        }
    return told;
}

test('3D Tiles: they are drawn, with the errors and regions of their subtrees, and heights within what is stated', keepingShots('cesium-3d-tiles', () => views, async () => {
    const view = await open('?terrain=pyrenees&tiles=3d-tiles', SMALL);
    await settled(view);
    await view.page.evaluate(() => { document.querySelector('#tools').hidden = true; });
    await view.shot('cesium-3d-tiles');
    const {tiles, levels, errors} = await state(view);
    assert.equal(tiles, '3d-tiles');
    assert.equal(await view.page.inputValue('#tiles'), '3d-tiles');
    assert.ok(levels.finest > 2 && levels.finest < errors.length, JSON.stringify(levels));
    assert.match(await view.page.textContent('#promise'), /^Levels? \d+( to \d+)?: proved to be off by no more than [\d.\u202f]+\u00a0k?m/);
    assert.ok(await shareOfTerrain(view) > 0.25);
    // What Cesium has of its tiles, down to those that it has looked at.
    const seen = await view.page.evaluate(() => {
        const found = [], walk = tile => {
            const {implicitCoordinates: at, boundingVolume: {rectangle: r, minimumHeight, maximumHeight}} = tile;
            if (at && !tile.implicitTileset) found.push([[at.level, at.x, at.y], tile.geometricError, [r.west, r.south, r.east, r.north, minimumHeight, maximumHeight]]);
            tile.children.forEach(walk);
        };
        walk(window.rqtCesium.globe.surface.tileset.root);
        return found;
    });
    const subtrees = new Map();
    assert.ok(seen.length > 50, `${seen.length} tiles`);
    for (const [[level, x, y], error, region] of seen) {
        const up = level % 4, root = [level - up, x >> up, y >> up], key = root.join('/');
        if (!subtrees.has(key)) subtrees.set(key, await readSubtree('pyrenees', ...root));
        assert.deepEqual({error, region}, subtrees.get(key).get([level, x, y].join('/')), `${level}/${x}/${y}`);
        assert.ok(error <= errors[level] * (1 + 1e-11), `${level}/${x}/${y}: ${error} of ${errors[level]}`);
    }
    // From above, of the finest tiles. What is seen comes out of depths that a graphics card rounds.
    const {x0, y0, step} = TERRAINS.pyrenees, all = Array.from({length: 70}, () => [x0 + step * (520.5 + dice.below(100)), y0 - step * (1200.5 + dice.below(100))]);
    const known = await heightsAt('pyrenees', all), places = all.filter((_, i) => known[i] !== null), heights = known.filter(z => z !== null);
    assert.ok(places.length >= 50, `${places.length} places`);
    const read = await view.page.evaluate(p => window.rqtCesium.sampleTileset(p), places);
    const off = read.map((z, i) => z === null ? Infinity : Math.abs(z - heights[i]));
    console.log(`3D Tiles: ${places.length} places, off by ${Math.max(...off)} m at most, ${errors.at(-1)} m stated`);
    assert.ok(Math.max(...off) <= errors.at(-1) + 0.05, `${Math.max(...off)} m at ${places[off.indexOf(Math.max(...off))]}`);
    const strange = view.asked.filter(({pathname}) => !/^\/(cesium|collections|[\w-]+\.(js|css))/.test(pathname));
    assert.deepEqual(strange.map(({href}) => href).filter(href => !/^(blob|data):/.test(href)), []);
    assert.deepEqual(view.problems, []);
    await view.close();
}));

test('3D Tiles of different levels beside each other: nothing shows through', keepingShots('cesium-skirts', () => views, async () => {
    const cameras = [
        {longitude: -71.7057, latitude: 44.7832, height: 948, heading: 119, pitch: -12},
        {longitude: -71.1006, latitude: 44.6298, height: 2202, heading: 227, pitch: -30},
    ];
    const view = await open(`?terrain=white&tiles=3d-tiles#camera=${Object.values(cameras[0])}`, {width: 240, height: 160});
    await onMagenta(view);
    const fovy = await view.page.evaluate(() => {
        const {scene, surface} = window.rqtCesium.globe;
        surface.tileset.maximumScreenSpaceError = 16; // as clients have it
        return scene.camera.frustum.fovy * 180 / Math.PI;
    });
    for (const camera of cameras) {
        await view.page.evaluate(c => window.rqtCesium.setCamera(c), camera);
        await settled(view);
        const {levels: {finest, coarsest}} = await state(view), picture = await view.picture(), {width, height} = picture;
        assert.ok(finest - coarsest >= 2, `levels ${coarsest} to ${finest}`);
        const {count, at, terrain} = findGaps(backgroundOf(picture), width, height, vanishingPoint({pitch: camera.pitch, fovy, width, height}));
        assert.equal(count, 0, `levels ${coarsest} to ${finest}: background at ${at.join('; ')}`);
        assert.ok(terrain > 0.7 * width * height && (camera.pitch < -20 || terrain < 0.9 * width * height), `${terrain} pixels of terrain`);
    }
    await view.shot('cesium-skirts');
    assert.deepEqual(view.problems, []);
    await view.close();
}));

// ---------------------------------------------------------------------------------------------------------------- page

for (const [name, options] of [['white', SMALL], ['pyrenees', PHONE], ['world', SMALL]])
    test(`${name}: a picture of it, its figures, and no complaint`, keepingShots(`cesium-${name}`, () => views, async () => {
        const view = await open(`?terrain=${name}`, options);
        await settled(view);
        await view.shot(`cesium-${name}`);
        const {terrain, levels, errors} = await state(view);
        assert.equal(terrain, name);
        assert.ok(levels.coarsest > 0 && levels.finest < errors.length, JSON.stringify(levels));
        const promise = await view.page.textContent('#promise');
        assert.match(promise, /^Levels? \d+( to \d+)?: proved to be off by no more than [\d.\u202f]+\u00a0k?m/);
        assert.match(await view.page.textContent('#credits'), /CesiumJS/);
        const share = await shareOfTerrain(view);
        assert.ok(share > 0.25, `terrain has ${share} of the picture`);
        assert.deepEqual(view.problems, []);
        // Nothing but its own files, and tiles that there are.
        const strange = view.asked.filter(({pathname}) => !/^\/(cesium|collections|[\w-]+\.(js|css))/.test(pathname));
        assert.deepEqual(strange.map(({href}) => href).filter(href => !/^(blob|data):/.test(href)), []);
        await view.close();
    }));

/** Nothing but the terrain, on a background of a colour that it never has. */
async function onMagenta(view) {
    await view.page.evaluate(() => {
        const {globe: {scene, globe, surface}} = window.rqtCesium;
        Object.assign(globe, {showSkirts: false, showGroundAtmosphere: false});
        scene.skyAtmosphere.show = scene.fog.enabled = false;
        for (let i = 0; i < scene.primitives.length; i++) scene.primitives.get(i).show = scene.primitives.get(i) === surface.tileset;
        Object.assign(scene.backgroundColor, {red: 1, green: 0, blue: 1});
    });
}
/** 1 where a picture shows the background. */
const backgroundOf = ({rgba}) => Uint8Array.from({length: rgba.length / 4}, (_, i) => Math.min(rgba[4 * i], rgba[4 * i + 2]) - rgba[4 * i + 1] > 60 ? 1 : 0);

test('neighbours of one level have no crack between them, without skirts', keepingShots('cesium-cracks', () => views, async () => {
    const view = await open('?terrain=white');
    await onMagenta(view);
    let seen = 0;
    for (const height of [30000, 36000, 42000]) {
        await view.page.evaluate(h => window.rqtCesium.setCamera({longitude: -71.45, latitude: 44.5, height: h, heading: 20, pitch: -90}), height);
        await settled(view);
        const {levels: {finest, coarsest}} = await state(view);
        if (finest !== coarsest) continue;
        const tiles = await view.page.evaluate(() => window.rqtCesium.globe.globe._surface._tilesToRender.length);
        const gaps = backgroundOf(await view.picture()).filter(is => is).length;
        assert.equal(gaps, 0, `from ${height} m, level ${finest}`);
        seen += tiles > 3;
        await view.shot('cesium-cracks');
    }
    assert.ok(seen > 0, 'a picture of several tiles, all of one level');
    // And the background would be seen.
    await view.page.evaluate(() => window.rqtCesium.setCamera({longitude: -71, latitude: 44.5, height: 40000, heading: 0, pitch: -90}));
    await settled(view);
    const {rgba} = await view.picture();
    assert.ok(rgba[4 * 470 + 1] < 30 && rgba[4 * 470] > 225, 'east of the terrain');
    assert.deepEqual(view.problems, []);
    await view.close();
}));

test('it flies, and nothing that it asks for on its way is missing', keepingShots('cesium-flight', () => views, async () => {
    const view = await open('?terrain=white');
    await settled(view);
    const {camera: before} = await state(view);
    await view.page.locator('#fly').click();
    await view.until(() => window.rqtCesium.state().camera.heading, heading => Math.abs(heading - before.heading) > 2);
    assert.equal(await view.page.getAttribute('#fly', 'aria-pressed'), 'true');
    await view.page.locator('#picture').focus();
    await view.page.keyboard.press('Space');
    assert.equal((await state(view)).fly, false);
    for (const share of [0.2, 0.7]) {
        await view.page.evaluate(at => window.rqtCesium.seek(at), share);
        await settled(view);
        const {camera, levels} = await state(view), [ground] = await view.page.evaluate(({longitude, latitude}) => window.rqtCesium.sample([[longitude, latitude]]), camera);
        assert.ok(camera.height > ground + 500, `${camera.height} m over ${ground} m`);
        assert.ok(levels.finest > 8);
        assert.ok(await shareOfTerrain(view) > 0.4);
    }
    assert.deepEqual(view.problems, []);
    await view.close();
}));

test('keys and the address: a view is loaded again as it was', keepingShots('cesium-keys', () => views, async () => {
    const view = await open('?terrain=white');
    await view.page.locator('#picture').focus();
    const from = (await state(view)).camera;
    for (const key of ['c', 'm', ']', ']', 'ArrowLeft', 'ArrowUp', '+']) await view.page.keyboard.press(key);
    const {contours, wires, exaggeration, camera} = await state(view);
    assert.deepEqual([contours, wires, exaggeration], [true, true, 2]);
    assert.ok(Math.abs(camera.heading - from.heading) > 1 && camera.latitude !== from.latitude);
    await settled(view);
    await view.shot('cesium-wires');
    const address = await view.until(() => location.search + location.hash, text => text.includes('wires'));
    const again = await open(address);
    const found = await state(again);
    assert.deepEqual([found.contours, found.wires, found.exaggeration, found.fly], [true, true, 2, false]);
    for (const key of ['longitude', 'latitude', 'heading', 'pitch']) assert.ok(Math.abs(found.camera[key] - camera[key]) < 0.02, `${key}: ${found.camera[key]}, ${camera[key]}`);
    // Another terrain is looked at from its own place.
    await Promise.all([again.page.waitForURL(/terrain=world/), again.page.selectOption('#terrain', 'world')]);
    await again.until(async () => window.rqtCesium && await window.rqtCesium.ready && window.rqtCesium.state(), seen => seen.terrain === 'world' && seen.camera.height > 1e5 && !seen.wires);
    for (const page of [view, again]) {
        assert.deepEqual(page.problems, []);
        await page.close();
    }
}));

test('where there is nothing to see, a sentence says why', keepingShots('cesium-nothing', () => views, async () => {
    const none = await open('?terrain=nowhere');
    assert.match(await sentence(none), /There is no terrain nowhere/);
    assert.deepEqual(none.problems, []);
    await none.close();
    const flat = await open('?terrain=metres');
    assert.match(await sentence(flat), /terrain metres has no tiles: they are of terrains in longitude and latitude/i);
    await flat.shot('cesium-nothing');
    await flat.close();
}));

test('without npm there are files that say so, for both pages', () => {
    const tools = join(home, 'tools'), out = join(home, 'out');
    mkdirSync(tools);
    for (const tool of ['dirname', 'mkdir', 'cp', 'touch', 'echo', 'cat', 'sh'])
        symlinkSync(execFileSync('sh', ['-c', `command -v ${tool} | grep / || echo /bin/${tool}`], {encoding: 'utf8'}).trim(), join(tools, tool));
    for (const [script, ...workers] of [['src/web/bundle.sh'], ['src/web/cesium/bundle.sh', 'transferTypedArrayTest']]) {
        const {status, stderr} = spawnSync('/bin/sh', [join(ROOT, script), out, join(home, 'packages'), ...workers], {encoding: 'utf8', env: {PATH: tools}});
        assert.equal(status, 0, stderr);
        assert.match(stderr, /node or npm is missing/);
    }
    for (const name of ['viewer.js', 'cesium.js', 'transferTypedArrayTest.js']) assert.match(readFileSync(join(out, name), 'utf8'), /npm registry was missing/);
});
