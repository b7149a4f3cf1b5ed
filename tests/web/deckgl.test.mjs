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
// 15 blocks of 32 a side: the first subtree is full, and what is below it is not.
const SIDE = 471;
// A part of a degree square: Montserrat, with voids at its cliffs.
const SOURCE = join(ROOT, 'tests', 'data', 'N41E001.hgt.zip'), COLUMN = 700, ROW = 180, X0 = 1 + COLUMN * STEP, Y0 = 42 - ROW * STEP;
const VIEW = {longitude: 1.83, latitude: 41.57, zoom: 12.4, pitch: 60, bearing: -10};

/* What people would write: the README has both. */
async function terrainLayer({deck: {TerrainLayer}, url}) {
    const {tiles, bounds, minzoom, maxzoom} = await (await fetch(`${url}/terrarium/tile.json`)).json();
    return {layers: [new TerrainLayer({
        id: 'ground', elevationData: tiles, extent: bounds, minZoom: minzoom, maxZoom: maxzoom,
        elevationDecoder: {rScaler: 256, gScaler: 1, bScaler: 1 / 256, offset: -32768},
    })]};
}
// Shaders of glTF take directions of light for those to it.
function tile3DLayer({deck: {AmbientLight, DirectionalLight, LightingEffect, Tile3DLayer}, url}) {
    return {
        layers: [new Tile3DLayer({id: 'ground', data: `${url}/3d-tiles/tileset.json`})],
        effects: [new LightingEffect({ambient: new AmbientLight({intensity: 0.7}), sun: new DirectionalLight({intensity: 2, direction: [-1, 2, 1.5]})})],
    };
}

const home = mkdtempSync(join(ROOT, 'build', 'web-tests', 'deckgl-')), database = join(home, 'terrains.gpkg');
let service, server, browser, tilesUrl, heights;

before(async () => {
    const tif = join(home, 'montserrat.tif'), raw = join(home, 'raw');
    execFileSync('gdal_translate', ['-q', '-srcwin', COLUMN, ROW, SIDE, SIDE, SOURCE, tif]);
    execFileSync('gdal_translate', ['-q', '-of', 'ENVI', '-ot', 'Int16', tif, raw]);
    execFileSync(RQT, ['import', '--block', '5', tif, database], {stdio: 'pipe'});
    const bytes = readFileSync(raw);
    heights = new Int16Array(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
    server = createServer((request, response) => {
        const isScript = request.url === '/deck.js';
        response.writeHead(200, {'Content-Type': isScript ? 'text/javascript' : 'text/html'});
        response.end(isScript ? readFileSync(join(PACKAGES, 'dist.min.js')) : PAGE);
    });
    await new Promise(resolve => { server.listen(0, '127.0.0.1', resolve); });
    [service, browser] = await Promise.all([Service.start({databases: [database]}), launch()]);
    tilesUrl = `${service.url}collections/montserrat/tiles`;
});

after(async () => {
    await browser?.close();
    server?.close();
    await service?.stop();
    rmSync(home, {recursive: true});
});

/** A page with a layer, all of whose tiles are there: {page, problems, asked}. */
async function open(layer) {
    const page = await browser.newPage({viewport: {width: 320, height: 214}}), problems = [], asked = [];
    page.setDefaultTimeout(PATIENCE);
    const ours = [`http://127.0.0.1:${server.address().port}`, new URL(service.url).origin];
    // Where it is on the network, deck.gl has its worker from there: here it is from the package.
    const isWorker = ({pathname}) => pathname.endsWith('/terrain@4.4.3/dist/terrain-worker.js');
    await page.route(isWorker, route => route.fulfill({path: join(PACKAGES, 'dist', 'terrain-worker.js')}));
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
        const shown = await new Function(`return (${body})`)()({deck: window.deck, url});
        window.shown = new window.deck.Deck({parent: document.body, initialViewState, onError: error => console.error(String(error)), ...shown});
        window.layers = () => window.shown.layerManager?.getLayers() || [];
    }, {body: layer.toString(), url: tilesUrl, view: VIEW});
    await settled(page);
    return {page, problems, asked};
}

/** Until every tile that the picture needs is in it, for some frames: tiles make it ask for others. */
async function settled(page) {
    const left = await page.evaluate(async patience => {
        const isLoaded = () => window.layers().length > 1 && window.layers().every(layer => layer.isLoaded);
        for (let still = 0, end = Date.now() + patience; still < 5 && Date.now() < end; still = isLoaded() ? still + 1 : 0)
            await new Promise(resolve => requestAnimationFrame(resolve));
        return window.layers().filter(layer => !layer.isLoaded).map(layer => layer.id);
    }, PATIENCE);
    assert.deepEqual(left, [], 'it settles');
}

/** What `see` gives in the page: as one text, since numbers one by one take long. */
const read = async (page, see) => JSON.parse(await page.evaluate(body => JSON.stringify(new Function(`return (${body})()`)()), see.toString()));

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

// ------------------------------------------------------------------------------------------------------------ 3D Tiles

/** What Tile3DLayer has of the tiles that it drew, and the addresses of all that it knows of. */
const blocksOf = page => read(page, () => {
    const {root, tiles} = window.layers().find(layer => layer.id === 'ground').state.tileset3d, known = [];
    const walk = header => {
        if (header.contentUrl) known.push(header.contentUrl);
        (header.children || []).forEach(walk);
    };
    walk(root.header);
    const numbers = matrix => Array.from(matrix);
    return {known, tiles: tiles.filter(({content}) => content?.gltf).map(({contentUrl, lodMetricValue, header, content}) => {
        const {gltf, cartesianModelMatrix, cartographicModelMatrix} = content, [node] = gltf.scene.nodes;
        return {
            contentUrl, bound: lodMetricValue, region: header.boundingVolume.region,
            told: gltf.asset.extras.rqt, node: numbers(node.matrix || [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, ...node.translation, 1]),
            toSpace: numbers(cartesianModelMatrix), toOrigin: numbers(cartographicModelMatrix),
            positions: numbers(gltf.meshes[0].primitives[0].attributes.POSITION.value),
        };
    })};
});

/** A matrix, column by column, times a place. */
const times = (m, [x, y, z], round = v => v) => [0, 1, 2].map(k => round(round(round(m[k] * x) + round(m[k + 4] * y)) + round(round(m[k + 8] * z) + m[k + 12])));

/** Longitudes, latitudes and heights above the ellipsoid to places in space, by PROJ. */
function inSpace(places) {
    const lines = execFileSync('gdaltransform', ['-s_srs', 'EPSG:4979', '-t_srs', 'EPSG:4978'], {input: places.map(place => place.join(' ')).join('\n'), encoding: 'utf8', maxBuffer: 2 ** 26});
    return lines.trim().split('\n').map(line => line.split(' ').map(Number));
}

test('Tile3DLayer: it knows of the tiles that there are, and their vertices are samples in space', async () => {
    const {page, problems} = await open(tile3DLayer), {known, tiles} = await blocksOf(page), seen = await look(page, 'deckgl-3d-tiles');
    assert.ok(seen.colours > 60 && seen.share > 0.5, JSON.stringify(seen));
    const files = join(home, 'blocks');
    execFileSync(RQT, ['tiles', database, '--kind', '3d-tiles', '-o', files], {stdio: 'pipe'});
    const written = readdirSync(join(files, 'content'), {recursive: true}).filter(path => path.endsWith('.glb'));
    assert.deepEqual(known.map(url => url.split('/content/')[1]).sort(), written.sort());
    const levels = new Set(tiles.map(({told}) => told.level));
    assert.ok(tiles.length > 5 && levels.size > 1, `${tiles.length} tiles of levels ${[...levels]}`);
    const places = [], vertices = [];
    let rounded = 0;
    for (const {contentUrl, bound, region, told, node, toSpace, toOrigin, positions} of tiles) {
        assert.ok(told.error <= bound, `${contentUrl}: off by ${told.error} m, and deck.gl takes it for ${bound}`);
        // In floats, as a graphics card has them: no worse than floats of the tile's own size.
        const corners = [], floats = {node: node.map(Math.fround), toOrigin: toOrigin.map(Math.fround)};
        let reach = 0, off = 0;
        for (let i = 0; i < positions.length; i += 3) {
            const position = positions.slice(i, i + 3), exact = times(toOrigin, times(node, position));
            const drawn = times(floats.toOrigin, times(floats.node, position, Math.fround), Math.fround);
            reach = Math.max(reach, Math.hypot(...exact));
            off = Math.max(off, Math.hypot(...drawn.map((v, k) => v - exact[k])));
            corners.push(times(toSpace, times(node, position)));
        }
        rounded = Math.max(rounded, off);
        assert.ok(off <= reach * 2 ** -21, `${contentUrl}: floats are ${off} m off, of ${reach} m`);
        for (const xyz of corners) {
            const [longitude, latitude] = geodetic(xyz);
            const col = Math.round((longitude - X0) / STEP), row = Math.round((Y0 - latitude) / STEP), sample = heights[SIDE * row + col];
            assert.ok(col >= 0 && col < SIDE && row >= 0 && row < SIDE && sample !== VOID, `${contentUrl}: ${longitude}, ${latitude} is no sample`);
            const [west, south, east, north] = region.map(r => r / RADIANS);
            assert.ok(longitude > west - 1e-7 && longitude < east + 1e-7 && latitude > south - 1e-7 && latitude < north + 1e-7, `${contentUrl}: ${longitude}, ${latitude} is beyond what deck.gl takes for its region`);
            places.push([X0 + col * STEP, Y0 - row * STEP, sample]);
            vertices.push({xyz, contentUrl, step: told.step});
        }
    }
    let worst = 0;
    inSpace(places).forEach((place, i) => {
        const off = Math.hypot(...place.map((v, k) => v - vertices[i].xyz[k])) - vertices[i].step * Math.sqrt(3) / 2;
        assert.ok(off < 1e-6, `${vertices[i].contentUrl}: ${vertices[i].xyz} is ${off} m off beyond its step`);
        worst = Math.max(worst, off + vertices[i].step * Math.sqrt(3) / 2);
    });
    console.log(`Tile3DLayer: ${tiles.length} tiles of levels ${[...levels].sort()}, ${places.length} vertices, off by ${worst} m at most; ${rounded} m in floats`);
    assert.deepEqual(problems, []);
    await page.close();
});

/** Longitude and latitude of a place in space, in degrees. */
function geodetic([x, y, z]) {
    const f = 1 / 298.257223563, e2 = f * (2 - f), flat = Math.hypot(x, y);
    let latitude = Math.atan2(z, flat * (1 - e2));
    for (let i = 0; i < 5; i++) latitude = Math.atan2(z + e2 * 6378137 / Math.sqrt(1 - e2 * Math.sin(latitude) ** 2) * Math.sin(latitude), flat);
    return [Math.atan2(y, x) / RADIANS, latitude / RADIANS];
}

// ------------------------------------------------------------------------------------------------------ quantized-mesh

/** What a script for pages that is also one for require() gives. */
function load(file) {
    const module = {exports: {}};
    new Function('module', 'exports', readFileSync(join(PACKAGES, file), 'utf8'))(module, module.exports);
    return module.exports;
}

test('the decoder of quantized-mesh that deck.gl has: heights are within the stated error at every sample', () => {
    const {QuantizedMeshLoader} = load(join('dist', 'dist.min.js')), files = join(home, 'meshes');
    execFileSync(RQT, ['tiles', database, '--levels', '8-11', '-o', files], {stdio: 'pipe'});
    let samples = 0, worst = 0, tiles = 0;
    for (const path of readdirSync(files, {recursive: true}).filter(file => file.endsWith('.terrain'))) {
        const [z, column, row] = path.split('/').map(text => parseInt(text, 10)), side = 180 / 2 ** z / STEP;
        const bytes = readFileSync(join(files, path)), data = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
        const {verticalError} = decodeMesh(data.slice(0)).extensions.metadata;
        if (!verticalError) continue; // without terrain
        const {attributes: {POSITION: {value: positions}}, indices: {value: triangles}} = QuantizedMeshLoader.parseSync(data);
        // It gives floats, of which units are made again.
        const of = (k, turn) => Float64Array.from({length: positions.length / 3}, (_, i) => turn(positions[3 * i + k]));
        const unit = v => Math.round(v * 32767) / 32767, west = (-180 - X0) / STEP + column * side, south = (Y0 + 90) / STEP - row * side;
        heightsUnder({x: of(0, u => west + side * unit(u)), y: of(1, v => south - side * unit(v)), z: of(2, v => v), triangles}, SIDE, SIDE, (col, line, height) => {
            const sample = heights[SIDE * line + col];
            if (sample === VOID) return; // outlines of voids move as vertices do
            const share = Math.abs(height - sample) / (verticalError + 1e-3);
            assert.ok(share <= 1, `${path}: ${height} m at ${col}, ${line}, where it is ${sample}`);
            worst = Math.max(worst, share);
            samples++;
        });
        tiles++;
    }
    console.log(`quantized-mesh: ${tiles} tiles, ${samples} samples, ${worst} of what is stated`);
    assert.ok(tiles > 20 && samples > 3.9 * SIDE * SIDE && worst > 0.1);
});

// ----------------------------------------------------------------------------------------------------------- Terrarium

/** A tile as it is served, decoded here: {height(column, row), error}. */
async function servedTile(z, x, y) {
    const response = await fetch(`${tilesUrl}/terrarium/${z}/${x}/${y}.png`);
    assert.equal(response.status, 200);
    const {rgba, texts} = decodePng(Buffer.from(await response.arrayBuffer()));
    const error = Number(texts.error_metres);
    const height = (i, j) => rgba[4 * (PIXELS * j + i)] * 256 + rgba[4 * (PIXELS * j + i) + 1] + rgba[4 * (PIXELS * j + i) + 2] / 256 - 32768;
    return {height, error};
}

/** The meshes that TerrainLayer has, as arrays: of a position, x, y and height; of a place in the picture, u and v. */
const meshesOf = page => read(page, () => {
    const {tileset} = window.layers().find(layer => layer.id === 'ground-tiles').state;
    return tileset.tiles.filter(tile => tile.content).map(({index: {z, x, y}, content: [{attributes, indices}]}) => ({
        z, x, y, positions: Array.from(attributes.POSITION.value), places: Array.from(attributes.TEXCOORD_0.value), indices: Array.from(indices.value),
    }));
});

test('TerrainLayer: the heights of its meshes are those of the pixels, and near the samples', async () => {
    const {page, problems, asked} = await open(terrainLayer), meshes = await meshesOf(page), seen = await look(page, 'deckgl-terrain');
    assert.ok(seen.colours > 60 && seen.share > 0.5, JSON.stringify(seen));
    const levels = new Set(), pictures = asked.filter(path => path.endsWith('.png'));
    assert.ok(meshes.length > 2 && pictures.length >= meshes.length, `${meshes.length} tiles`);
    let samples = 0, voids = 0, worst = 0, thinned = 0;
    for (const {z, x, y, positions, places, indices} of meshes) {
        const {height, error} = await servedTile(z, x, y), label = `${z}/${x}/${y}`, at = new Map(), world = 512 / 2 ** z;
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
        const triangles = indices.filter((_, i) => Math.max(...[0, 1, 2].map(k => indices[i - i % 3 + k])) < count);
        heightsUnder({x: of(places, 2, 0, PIXELS), y: of(places, 2, 1, PIXELS), z: of(positions, 3, 2, 1), triangles}, PIXELS + 1, PIXELS + 1,
            (i, j, h) => { mesh[(PIXELS + 1) * j + i] = h; });
        let off = 0;
        mesh.forEach((h, k) => { off = Math.max(off, Math.abs(h - pixel(k % (PIXELS + 1), Math.floor(k / (PIXELS + 1))))); });
        assert.ok(off >= 0 && off < 20, `${label}: a mesh ${off} m off its own pixels`); // NaN: it does not cover them
        thinned = Math.max(thinned, off);
        for (let row = 0; row < SIDE; row++) {
            const latitude = (Y0 - row * STEP) * RADIANS, q = PIXELS * ((1 - Math.asinh(Math.tan(latitude)) / Math.PI) / 2 * 2 ** z - y) - 0.5;
            if (q < 0 || q >= PIXELS - 1) continue;
            for (let col = 0; col < SIDE; col++) {
                const p = PIXELS * ((X0 + col * STEP + 180) / 360 * 2 ** z - x) - 0.5, sample = heights[SIDE * row + col];
                if (p < 0 || p >= PIXELS - 1) continue;
                const k = (PIXELS + 1) * Math.floor(q) + Math.floor(p), a = p % 1, b = q % 1;
                const interpolated = (1 - b) * ((1 - a) * mesh[k] + a * mesh[k + 1]) + b * ((1 - a) * mesh[k + PIXELS + 1] + a * mesh[k + PIXELS + 2]);
                const corners = [k, k + 1, k + PIXELS + 1, k + PIXELS + 2].map(c => pixel(c % (PIXELS + 1), Math.floor(c / (PIXELS + 1))));
                if (sample === VOID) voids += corners.includes(0);
                else if (!corners.includes(0)) {
                    const share = Math.abs(interpolated - sample) / (error + off);
                    assert.ok(share <= 1, `${label}: ${interpolated} m where it is ${sample}, ${error} m stated and ${off} m thinned`);
                    worst = Math.max(worst, share);
                    samples++;
                }
            }
        }
        levels.add(z);
    }
    console.log(`TerrainLayer: ${meshes.length} tiles of levels ${[...levels]}, ${samples} samples, ${worst} of what is allowed, ${voids} voids; deck.gl leaves out up to ${thinned} m`);
    assert.ok(samples > 50000 && worst > 0.1);
    assert.ok(voids > 0);
    assert.deepEqual(problems, []);
    await page.close();
});
