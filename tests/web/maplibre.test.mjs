// maplibre.test.mjs - MapLibre draws our heights: its own decoder has the pixels that we wrote, and the elevation that it gives at
// samples of the raster is within what the tile states. Offline, without a complaint.
import assert from 'node:assert/strict';
import {execFileSync} from 'node:child_process';
import {mkdirSync, mkdtempSync, readFileSync, rmSync} from 'node:fs';
import {createServer} from 'node:http';
import {basename, join} from 'node:path';
import {after, before, test} from 'node:test';
import {PATIENCE, launch} from './browser.mjs';
import {ROOT} from './packages.mjs';
import {colours, decodePng} from './picture.mjs';
import {Service, TERRAINS} from './serve.mjs';

const DIST = join(ROOT, 'build', 'web-tests', 'node_modules', 'maplibre-gl', 'dist');
const SHOTS = process.env.WEB_SHOTS || join(ROOT, 'build', 'web-shots');
// A degree square of 1201 x 1201 samples, its first one at 72 degrees west and 45 north: the Presidential Range.
const SIDE = 1201, WEST = -72, NORTH = 45, STEP = 1 / 1200, CENTRE = [-71.31, 44.28];
const PAGE = `<!doctype html><meta charset="utf-8"><title>terrain</title><link rel="icon" href="data:,"><link rel="stylesheet" href="maplibre-gl.css">
<style>html, body, #map { margin: 0; height: 100%; background: #b8d4e8 }</style><div id="map"></div>`;

/** What people would write, with the address of the service. */
function show({maplibregl, url, center, zoom, pitch}) {
    const dem = {type: 'raster-dem', url};
    return new maplibregl.Map({
        container: 'map', center, zoom, pitch, bearing: 20, fadeDuration: 0, canvasContextAttributes: {preserveDrawingBuffer: true},
        style: {
            version: 8, sources: {dem, shade: dem}, terrain: {source: 'dem'},
            layers: [
                {id: 'ground', type: 'background', paint: {'background-color': '#dfe8d8'}},
                {id: 'shade', type: 'hillshade', source: 'shade', paint: {'hillshade-exaggeration': 0.7}},
            ],
        },
    });
}

let service, server, browser, page, heights;
const problems = [], told = new Map();

before(async () => {
    const home = mkdtempSync(join(ROOT, 'build', 'web-tests', 'maplibre-'));
    try {
        execFileSync('gdal_translate', ['-q', '-of', 'ENVI', '-ot', 'Int16', TERRAINS.degrees.source, join(home, 'raw')]);
        const raw = readFileSync(join(home, 'raw'));
        heights = new Int16Array(raw.buffer.slice(raw.byteOffset, raw.byteOffset + 2 * SIDE * SIDE));
    } finally {
        rmSync(home, {recursive: true});
    }
    service = await Service.start();
    server = createServer((request, response) => {
        const name = basename(new URL(request.url, 'http://here').pathname), type = name.endsWith('.mjs') ? 'text/javascript' : name.endsWith('.css') ? 'text/css' : 'text/html';
        response.writeHead(200, {'Content-Type': type});
        response.end(type === 'text/html' ? PAGE : readFileSync(join(DIST, name)));
    });
    await new Promise(resolve => { server.listen(0, '127.0.0.1', resolve); });
    browser = await launch();
    page = await browser.newPage({viewport: {width: 720, height: 450}});
    page.setDefaultTimeout(PATIENCE);
    const ours = [`http://127.0.0.1:${server.address().port}`, new URL(service.url).origin];
    page.on('console', message => { if (['error', 'warning', 'assert'].includes(message.type())) problems.push(message.text()); });
    page.on('pageerror', error => problems.push(error.stack));
    page.on('request', request => {
        const {origin, protocol} = new URL(request.url());
        if (!['blob:', 'data:'].includes(protocol) && !ours.includes(origin)) problems.push(`request to ${request.url()}`);
    });
    page.on('response', response => { if (response.status() >= 400) problems.push(`${response.status()} ${response.url()}`); });
    await page.goto(ours[0]);
    await page.evaluate(async ({body, question}) => {
        const maplibregl = await import('/maplibre-gl.mjs');
        window.map = new Function(`return (${body})`)()({maplibregl, ...question});
        window.complaints = [];
        window.map.on('error', event => window.complaints.push(String(event.error)));
        await new Promise(resolve => { window.map.once('idle', resolve); });
    }, {body: show.toString(), question: {url: `${service.url.replace(/\/$/, '')}/collections/degrees/tiles/terrarium/tile.json`, center: CENTRE, zoom: 11.5, pitch: 65}});
});

after(async () => {
    await browser?.close();
    server?.close();
    await service?.stop();
});

/** A tile as its bytes say, decoded here: {height(column, row), error}. */
async function tileOf(z, x, y) {
    const key = `${z}/${x}/${y}`;
    if (!told.has(key)) {
        const response = await fetch(`${service.url.replace(/\/$/, '')}/collections/degrees/tiles/terrarium/${key}.png`);
        assert.equal(response.status, 200, key);
        const {rgba, texts} = decodePng(Buffer.from(await response.arrayBuffer()));
        const error = Number(texts.error_metres);
        const height = (i, j) => rgba[4 * (256 * j + i)] * 256 + rgba[4 * (256 * j + i) + 1] + rgba[4 * (256 * j + i) + 2] / 256 - 32768;
        told.set(key, {height, error});
    }
    return told.get(key);
}

test('MapLibre has decoded the pixels that were written, all of them', async () => {
    const tiles = await page.evaluate(() => {
        const manager = window.map.terrain.tileManager.tileManager;
        return manager.getIds().map(id => manager.getTileByID(id)).filter(tile => tile.dem).map(({dem, tileID: {canonical: {z, x, y}}}) =>
            ({z, x, y, dim: dem.dim, heights: Array.from({length: 256 * 256}, (_, i) => dem.get(i % 256, i >> 8))}));
    });
    assert.ok(tiles.length > 3, `${tiles.length} tiles`);
    for (const {z, x, y, dim, heights: seen} of tiles) {
        const {height} = await tileOf(z, x, y);
        assert.equal(dim, 256);
        assert.equal(seen.findIndex((h, i) => h !== height(i % 256, i >> 8)), -1, `${z}/${x}/${y}`);
    }
});

test('the elevation that it gives at samples is within what the tile states', async () => {
    const samples = [];
    for (let row = 780; row < 950; row += 9) for (let col = 740; col < 920; col += 7) samples.push([WEST + col * STEP, NORTH - row * STEP, heights[row * SIDE + col]]);
    const zooms = [];
    for (const zoom of [11.5, 8.4]) {
        const {seen, z} = await page.evaluate(async ({samples: places, zoom: to}) => {
            const idle = new Promise(resolve => { window.map.once('idle', resolve); });
            window.map.jumpTo({zoom: to, pitch: 0});
            await idle;
            return {seen: places.map(([lng, lat]) => window.map.queryTerrainElevation([lng, lat])), z: [...new Set(window.map.terrain.tileManager.getRenderableTiles().map(tile => tile.tileID.canonical.z))]};
        }, {samples, zoom});
        let worst = 0;
        // A tile of the mesh may be drawn with heights of a level or so before it: what the coarsest of them states has to do.
        for (const [i, [lng, lat, sample]] of samples.entries()) {
            let error = 0;
            for (const level of new Set(z.flatMap(n => [Math.min(n, 11), Math.max(Math.min(n, 11) - 1, 0)]))) {
                const n = 2 ** level, x = Math.floor((lng + 180) / 360 * n), y = Math.floor((1 - Math.asinh(Math.tan(lat * Math.PI / 180)) / Math.PI) / 2 * n);
                error = Math.max(error, (await tileOf(level, x, y)).error);
            }
            worst = Math.max(worst, Math.abs(seen[i] - sample) / error);
        }
        assert.ok(worst > 0 && worst <= 1, `zoom ${zoom}: ${worst} of what is allowed`);
        zooms.push(Math.max(...z));
    }
    assert.ok(new Set(zooms).size > 1, `levels ${zooms}`);
});

test('it looks like mountains, and nothing complains', async () => {
    await page.evaluate(async () => {
        const idle = new Promise(resolve => { window.map.once('idle', resolve); });
        window.map.jumpTo({zoom: 11.2, pitch: 70, bearing: 30});
        await idle;
    });
    mkdirSync(SHOTS, {recursive: true});
    const shot = await page.screenshot({path: join(SHOTS, 'maplibre.png')});
    assert.ok(colours(decodePng(shot)) > 200, `${colours(decodePng(shot))} colours`);
    assert.deepEqual([...problems, ...await page.evaluate(() => window.complaints)], []);
});
