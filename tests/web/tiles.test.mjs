// tiles.test.mjs - a decoder that others wrote reads our tiles, and what it reads is the terrain, at every sample.
import assert from 'node:assert/strict';
import {execFileSync} from 'node:child_process';
import {mkdtempSync, readFileSync, readdirSync, rmSync} from 'node:fs';
import {join} from 'node:path';
import {after, test} from 'node:test';
import {BUILD, ROOT, requirePackage} from './packages.mjs';
import {heightsUnder} from './samples.mjs';

const {default: decode} = requirePackage('@here/quantized-mesh-decoder');
const RQT = process.env.RQT || join(BUILD, 'rqt');
const UNITS = 32767;
// A degree square of 1201 x 1201 samples, its first one at 72 degrees west and 45 north.
const SIDE = 1201, WEST = -72, NORTH = 45, STEP = 1 / 1200;

const home = mkdtempSync(join(ROOT, 'build', 'web-tests', 'tiles-'));
after(() => rmSync(home, {recursive: true}));
const source = join(ROOT, 'examples', 'N44W072.hgt.zip');
execFileSync(RQT, ['import', source, join(home, 'terrain.gpkg')], {stdio: 'pipe'});
execFileSync(RQT, ['tiles', join(home, 'terrain.gpkg'), '-o', join(home, 'tiles')], {stdio: 'pipe'});
execFileSync('gdal_translate', ['-q', '-of', 'ENVI', '-ot', 'Int16', source, join(home, 'raw')]);
const raw = readFileSync(join(home, 'raw'));
const heights = new Int16Array(raw.buffer, raw.byteOffset, SIDE * SIDE);
const layer = JSON.parse(readFileSync(join(home, 'tiles', 'layer.json'), 'utf8'));

/** Every file of a level, decoded: {z, x, y, west, south, side, ...what the decoder gives}. */
function tilesOf(z) {
    const tiles = [];
    for (const x of readdirSync(join(home, 'tiles', `${z}`)))
        for (const name of readdirSync(join(home, 'tiles', `${z}`, x))) {
            const bytes = readFileSync(join(home, 'tiles', `${z}`, x, name)), side = 180 / 2 ** z, y = parseInt(name, 10);
            const tile = decode(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
            const count = tile.vertexData.length / 3;
            tiles.push({
                ...tile, z, x: Number(x), y, side, west: -180 + x * side, south: -90 + y * side, count,
                u: tile.vertexData.subarray(0, count), v: tile.vertexData.subarray(count, 2 * count), h: tile.vertexData.subarray(2 * count),
            });
        }
    return tiles;
}

/** The share of what the tile allows that its worst sample takes; samples that it covers. */
function measure(tile) {
    const {u, v, h, header, triangleIndices: triangles} = tile;
    const allowed = tile.extensions.metadata.verticalError, scale = tile.side / UNITS / STEP;
    const across = (tile.west - WEST) / STEP, down = (NORTH - tile.south) / STEP; // samples of the tile's south-west corner
    const x = Float64Array.from(u, n => across + n * scale), y = Float64Array.from(v, n => down - n * scale);
    const z = Float64Array.from(h, n => header.minHeight + (header.maxHeight - header.minHeight) * n / UNITS);
    let worst = 0, samples = 0;
    heightsUnder({x, y, z, triangles}, SIDE, SIDE, (col, row, height) => {
        worst = Math.max(worst, Math.abs(height - heights[row * SIDE + col]) / allowed);
        samples++;
    });
    return {worst, samples};
}

const edge = (tile, indices) => Array.from(indices, i => [tile.west + tile.side * tile.u[i] / UNITS, tile.south + tile.side * tile.v[i] / UNITS, tile.h[i]].join());

test('HERE\'s decoder reads every tile: within the stated error at every sample, edges shared, normals and metadata there', () => {
    layer.available.forEach((ranges, z) => {
        const tiles = tilesOf(z), places = new Map(tiles.map(tile => [`${tile.x}/${tile.y}`, tile]));
        const listed = ranges.reduce((sum, r) => sum + (r.endX - r.startX + 1) * (r.endY - r.startY + 1), 0);
        assert.equal(tiles.length, listed, `level ${z}`);
        let samples = 0;
        for (const tile of tiles) {
            if (z === 0 && tile.x === 1) { // both tiles of level 0 are there
                assert.equal(tile.count, 16);
                assert.deepEqual(Array.from(tile.triangleIndices), Array.from({length: 48}, (_, i) => Math.floor(i / 3)));
                assert.deepEqual(tile.extensions.metadata.available, layer.available.slice(1).map(() => []));
                continue;
            }
            const name = `${z}/${tile.x}/${tile.y}`, {worst, samples: seen} = measure(tile);
            assert.ok(worst <= 1, `${name}: ${worst} of what it allows`);
            samples += seen;
            assert.ok(tile.triangleIndices.length > 0 && tile.triangleIndices.every(i => i < tile.count), name);
            assert.equal(tile.extensions.vertexNormals.length, 2 * tile.count, name);
            assert.ok(tile.extensions.metadata.error <= tile.extensions.metadata.geometricError, name);
            assert.ok(tile.westIndices.every(i => tile.u[i] === 0) && tile.eastIndices.every(i => tile.u[i] === UNITS), name);
            assert.ok(tile.southIndices.every(i => tile.v[i] === 0) && tile.northIndices.every(i => tile.v[i] === UNITS), name);
            const east = places.get(`${tile.x + 1}/${tile.y}`), north = places.get(`${tile.x}/${tile.y + 1}`);
            if (east) assert.deepEqual(edge(tile, tile.eastIndices), edge(east, east.westIndices), name);
            if (north) assert.deepEqual(edge(tile, tile.northIndices), edge(north, north.southIndices), name);
        }
        if (z === 0) assert.deepEqual(places.get('0/0').extensions.metadata.available, layer.available.slice(1));
        // Of the rim, which moves by half a unit, samples may be outside.
        assert.ok(samples >= SIDE * SIDE - 4 * SIDE * Math.ceil(180 / 2 ** z / UNITS / STEP), `level ${z}: ${samples} samples`);
    });
});
