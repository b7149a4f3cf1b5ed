// deckgl.test.mjs - deck.gl as the judge of our tiles: its TerrainLayer on Terrarium, its Tile3DLayer on 3D Tiles, and the
// decoder of quantized-mesh that its loaders come with.
//
// What it makes of tiles is read out of its layers and put beside the raster: below its own thinning and placing, which are
// no matter of ours, are our heights and places.
import assert from 'node:assert/strict';
import {execFileSync} from 'node:child_process';
import {mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync} from 'node:fs';
import {createServer} from 'node:http';
import {join} from 'node:path';
import {after, before, test} from 'node:test';
import {PATIENCE, launch} from './browser.mjs';
import {BUILD, ROOT, requirePackage} from './packages.mjs';
import {colours, decodePng, differingPixels} from './picture.mjs';
import {heightsUnder} from './samples.mjs';
import {Service} from './serve.mjs';

const {default: decodeMesh} = requirePackage('@here/quantized-mesh-decoder');
const RQT = process.env.RQT || join(BUILD, 'rqt');
const PACKAGES = join(ROOT, 'build', 'web-tests', 'deckgl');
const SHOTS = process.env.WEB_SHOTS || join(ROOT, 'build', 'web-shots');
const PAGE = `<!doctype html><meta charset="utf-8"><title>terrain</title><link rel="icon" href="data:,">
<style>html, body { margin: 0; height: 100%; background: #b8d4e8 }</style><script src="deck.js"></script>`;
const VOID = -32768, PIXELS = 256, STEP = 1 / 1200, RADIANS = Math.PI / 180;
// Cells of 15/16 of a power of two: the first subtree is full, and the tiles below it are not.
const SIDE = 471;
/** Parts of degree squares. x0, y0: the first sample. */
const TERRAINS = {
    peak: {source: join(ROOT, 'examples', 'N44W072.hgt.zip'), column: 600, row: 640, x0: -72 + 600 * STEP, y0: 45 - 640 * STEP},
    holes: {source: join(ROOT, 'tests', 'data', 'N41E001.hgt.zip'), column: 700, row: 180, x0: 1 + 700 * STEP, y0: 42 - 180 * STEP},
};

/* What people would write: README has the same. */
async function terrainLayer({deck, url}) {
    const {tiles, bounds, minzoom, maxzoom} = await (await fetch(`${url}/terrarium/tile.json`)).json();
    return new deck.TerrainLayer({
        id: 'ground', elevationData: tiles, extent: bounds, minZoom: minzoom, maxZoom: maxzoom,
        elevationDecoder: {rScaler: 256, gScaler: 1, bScaler: 1 / 256, offset: -32768},
    });
}
async function tile3DLayer({deck, url}) {
    return new deck.Tile3DLayer({id: 'ground', data: `${url}/3d-tiles/tileset.json`});
}

const home = mkdtempSync(join(ROOT, 'build', 'web-tests', 'deckgl-')), database = join(home, 'terrains.gpkg');
let service, server, browser;

before(async () => {
    for (const [name, terrain] of Object.entries(TERRAINS)) {
        const tif = join(home, `${name}.tif`), raw = join(home, name);
        execFileSync('gdal_translate', ['-q', '-srcwin', terrain.column, terrain.row, SIDE, SIDE, terrain.source, tif]);
        execFileSync('gdal_translate', ['-q', '-of', 'ENVI', '-ot', 'Int16', tif, raw]);
        execFileSync(RQT, ['import', '--name', name, tif, database], {stdio: 'pipe'});
        const bytes = readFileSync(raw);
        terrain.heights = new Int16Array(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
    }
    server = createServer((request, response) => {
        const isScript = request.url === '/deck.js';
        response.writeHead(200, {'Content-Type': isScript ? 'text/javascript' : 'text/html'});
        response.end(isScript ? readFileSync(join(PACKAGES, 'deck.gl', 'dist.min.js')) : PAGE);
    });
    await new Promise(resolve => { server.listen(0, '127.0.0.1', resolve); });
    [service, browser] = await Promise.all([Service.start({databases: [database]}), launch()]);
});

after(async () => {
    await browser?.close();
    server?.close();
    await service?.stop();
    rmSync(home, {recursive: true});
});

const tilesUrl = terrain => `${service.url}collections/${terrain}/tiles`;

/** A page with a layer on a terrain, all of whose tiles are there: {page, problems, asked}. */
async function open(layer, terrain, view) {
    const page = await browser.newPage({viewport: {width: 480, height: 320}}), problems = [], asked = [];
    page.setDefaultTimeout(PATIENCE);
    const ours = [`http://127.0.0.1:${server.address().port}`, new URL(service.url).origin];
    // Where it is on the network, deck.gl has its worker from there: here it is from the package.
    const isWorker = ({pathname}) => pathname.endsWith('/terrain@4.4.3/dist/terrain-worker.js');
    await page.route(isWorker, route => route.fulfill({path: join(PACKAGES, 'loaders.gl-terrain', 'dist', 'terrain-worker.js')}));
    page.on('console', message => { if (['error', 'warning', 'assert'].includes(message.type())) problems.push(message.text()); });
    page.on('pageerror', error => problems.push(error.stack));
    page.on('request', request => {
        const url = new URL(request.url());
        if (!['blob:', 'data:'].includes(url.protocol) && !ours.includes(url.origin) && !isWorker(url)) problems.push(`request to ${url}`);
        asked.push(url.pathname);
    });
    page.on('requestfailed', request => problems.push(`${request.url()}: ${request.failure()?.errorText}`));
    page.on('response', response => { if (response.status() >= 400) problems.push(`${response.status()} ${response.url()}`); });
    await page.goto(ours[0]);
    await page.evaluate(async ({body, url, view: initialViewState}) => {
        const ground = await new Function(`return (${body})`)()({deck: window.deck, url});
        const onError = error => console.error(String(error));
        window.shown = new window.deck.Deck({parent: document.body, initialViewState: {maxPitch: 85, ...initialViewState}, layers: [ground], onError});
        window.layers = () => window.shown.layerManager?.getLayers() || [];
    }, {body: layer.toString(), url: tilesUrl(terrain), view});
    await settled(page);
    return {page, problems, asked};
}

/** Until every tile that the picture needs is in it, for some frames: tiles make it ask for others. */
async function settled(page) {
    await page.evaluate(async () => {
        for (let still = 0; still < 5; still++) {
            await new Promise(resolve => requestAnimationFrame(resolve));
            if (window.layers().length < 2 || !window.layers().every(layer => layer.isLoaded)) still = -1;
        }
    });
}

/** The picture, kept; shares of it that change when the terrain is not drawn. */
async function look(page, name) {
    mkdirSync(SHOTS, {recursive: true});
    const picture = decodePng(await page.screenshot({path: join(SHOTS, `${name}.png`)}));
    await page.evaluate(async () => {
        window.shown.setProps({layers: []});
        for (let i = 0; i < 3; i++) await new Promise(resolve => requestAnimationFrame(resolve));
    });
    const {width, height} = picture, empty = decodePng(await page.screenshot());
    return {colours: colours(picture), share: differingPixels(picture, empty) / width / height};
}

// ----------------------------------------------------------------------------------------------------------- Terrarium

/** A tile as it is served, decoded here: {height(column, row), error}. */
async function servedTile(terrain, z, x, y) {
    const response = await fetch(`${tilesUrl(terrain)}/terrarium/${z}/${x}/${y}.png`);
    assert.equal(response.status, 200);
    const bytes = Buffer.from(await response.arrayBuffer()), {rgba} = decodePng(bytes);
    const error = Number(/error_metres\0([0-9.e+-]+)/.exec(bytes.toString('latin1'))[1]);
    const height = (i, j) => rgba[4 * (PIXELS * j + i)] * 256 + rgba[4 * (PIXELS * j + i) + 1] + rgba[4 * (PIXELS * j + i) + 2] / 256 - 32768;
    return {height, error};
}

/** The meshes that TerrainLayer has, as arrays: of a position, x, y and height; of a place in the picture, u and v. */
const meshesOf = page => page.evaluate(() => {
    const {tileset} = window.layers().find(layer => layer.id === 'ground-tiles').state;
    return tileset.tiles.filter(tile => tile.content).map(({index: {z, x, y}, content: [{attributes, indices}]}) => ({
        z, x, y, positions: Array.from(attributes.POSITION.value), places: Array.from(attributes.TEXCOORD_0.value), indices: Array.from(indices.value),
    }));
});

for (const [name, view] of [['peak', {longitude: -71.303, latitude: 44.27}], ['holes', {longitude: 1.83, latitude: 41.65}]])
    test(`TerrainLayer, ${name}: the heights of its meshes are those of the pixels, and near the samples`, async () => {
        const {x0, y0, heights} = TERRAINS[name];
        const {page, problems, asked} = await open(terrainLayer, name, {...view, zoom: 12.2, pitch: 60, bearing: 20});
        const meshes = await meshesOf(page);
        if (name === 'peak') {
            const seen = await look(page, 'deckgl-terrain');
            assert.ok(seen.colours > 60 && seen.share > 0.5, JSON.stringify(seen));
        }
        const levels = new Set(), pictures = asked.filter(path => path.endsWith('.png'));
        assert.ok(meshes.length > 3 && pictures.length >= meshes.length, `${meshes.length} tiles`);
        let samples = 0, voids = 0, worst = 0, thinned = 0;
        for (const {z, x, y, positions, places, indices} of meshes) {
            const {height, error} = await servedTile(name, z, x, y), label = `${z}/${x}/${y}`, at = new Map(), world = 512 / 2 ** z;
            const pixel = (i, j) => height(Math.min(i, PIXELS - 1), Math.min(j, PIXELS - 1));
            for (let v = 0; v < places.length / 2; v++) {
                const [i, j] = [PIXELS * places[2 * v], PIXELS * places[2 * v + 1]], key = PIXELS * 2 * j + i;
                if (at.has(key)) continue; // of a skirt, below
                at.set(key, v);
                assert.equal(positions[3 * v + 2], pixel(i, j), `${label}: height of pixel ${i}, ${j}`);
                // Where the tile is, but for a pixel that neighbours overlap by.
                const off = Math.max(Math.abs(positions[3 * v] - world * (x + i / PIXELS)), Math.abs(512 - positions[3 * v + 1] - world * (y + j / PIXELS)));
                assert.ok(off <= world / PIXELS * 1.01, `${label}: pixel ${i}, ${j} is ${off * PIXELS / world} pixels off`);
            }
            // The mesh at every pixel; and what is interpolated of that at every sample.
            const mesh = new Float64Array((PIXELS + 1) ** 2).fill(NaN), count = Math.max(...at.values()) + 1;
            const of = (from, width, k, scale) => Float64Array.from({length: count}, (_, v) => from[width * v + k] * scale);
            const triangles = indices.filter((_, i) => indices.slice(i - i % 3, i - i % 3 + 3).every(v => v < count));
            heightsUnder({x: of(places, 2, 0, PIXELS), y: of(places, 2, 1, PIXELS), z: of(positions, 3, 2, 1), triangles}, PIXELS + 1, PIXELS + 1,
                (i, j, h) => { mesh[(PIXELS + 1) * j + i] = h; });
            let off = 0;
            mesh.forEach((h, k) => { off = Math.max(off, Math.abs(h - pixel(k % (PIXELS + 1), Math.floor(k / (PIXELS + 1))))); });
            assert.ok(off >= 0, `${label}: it covers all pixels`);
            thinned = Math.max(thinned, off);
            for (let row = 0; row < SIDE; row++) {
                const latitude = (y0 - row * STEP) * RADIANS, q = PIXELS * ((1 - Math.asinh(Math.tan(latitude)) / Math.PI) / 2 * 2 ** z - y) - 0.5;
                if (q < 0 || q >= PIXELS - 1) continue;
                for (let col = 0; col < SIDE; col++) {
                    const p = PIXELS * ((x0 + col * STEP + 180) / 360 * 2 ** z - x) - 0.5, sample = heights[SIDE * row + col];
                    if (p < 0 || p >= PIXELS - 1) continue;
                    const k = (PIXELS + 1) * Math.floor(q) + Math.floor(p), a = p % 1, b = q % 1;
                    const seen = (1 - b) * ((1 - a) * mesh[k] + a * mesh[k + 1]) + b * ((1 - a) * mesh[k + PIXELS + 1] + a * mesh[k + PIXELS + 2]);
                    const corners = [k, k + 1, k + PIXELS + 1, k + PIXELS + 2].map(c => pixel(c % (PIXELS + 1), Math.floor(c / (PIXELS + 1))));
                    if (sample === VOID) voids += corners.includes(0);
                    else if (!corners.includes(0)) {
                        const share = Math.abs(seen - sample) / (error + off);
                        assert.ok(share <= 1, `${label}: ${seen} m where it is ${sample}, ${error} m stated and ${off} m thinned`);
                        worst = Math.max(worst, share);
                        samples++;
                    }
                }
            }
            levels.add(z);
        }
        console.log(`${name}: ${meshes.length} tiles of levels ${[...levels]}, ${samples} samples, ${worst} of what is allowed, ${voids} voids; deck.gl leaves out up to ${thinned} m`);
        assert.ok(samples > 50000 && worst > 0.1);
        assert.equal(voids > 0, name === 'holes');
        assert.deepEqual(problems, []);
        await page.close();
    });
