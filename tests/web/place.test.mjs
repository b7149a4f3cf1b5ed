// place.test.mjs - src/web/place.js puts vertices where SQL puts them, and finds its way back.
import assert from 'node:assert/strict';
import {test} from 'node:test';
import {metresOf} from '../../src/web/header.js';
import {Place} from '../../src/web/place.js';
import {decodeMesh} from '../../src/web/wire.js';
import {Dice, recordsOf} from './oracle.mjs';

const records = recordsOf('places'), terrains = [];
for (let i = 0; i < records.length; i += 2)
    terrains.push({name: records[i].name, lonlat: records[i].name !== 'plane', mesh: decodeMesh(records[i].bytes), rows: JSON.parse(Buffer.from(records[i + 1].bytes))});

const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);

test('F34_float32_far_from_the_origin: vertices are where SQL puts them, in double and as float32 about an origin', () => {
    for (const {name, lonlat, mesh, rows} of terrains) {
        const place = new Place({lonlat}), expected = new Map(rows.map(([col, row, ...point]) => [row * mesh.width + col, point]));
        const origin = expected.get(0), local = place.positionsOf(mesh, origin);
        assert.ok(expected.size >= mesh.vertexCount, name); // in space more are needed
        for (let i = 0; i < mesh.vertexCount; i++) {
            const {col: {[i]: col}, row: {[i]: row}, q: {[i]: q}} = mesh, seen = expected.get(row * mesh.width + col);
            const point = place.pointOf(mesh.x0 + col * mesh.dx, mesh.y0 + row * mesh.dy, metresOf(mesh, q));
            assert.ok(distance(point, seen) < 1e-8, `${name}: ${point}, not ${seen}`);
            const here = local.subarray(3 * i, 3 * i + 3).map((v) => v), there = seen.map((v, c) => v - origin[c]);
            assert.ok(distance(here, there) <= 1e-8 + distance(seen, origin) * 2 ** -23, `${name}: ${here}, not ${there}`);
        }
    }
});

test('heights are exaggerated before they are placed, and may be those of a geomorph', () => {
    for (const {name, lonlat, mesh} of terrains) {
        const place = new Place({lonlat, exaggeration: 3, metre: lonlat ? 1 : 0.3048}), heights = Float64Array.from(mesh.q, (q) => q + 0.25);
        const local = place.positionsOf(mesh, [0, 0, 0], heights, new Float32Array(3 * mesh.vertexCount));
        for (let i = 0; i < mesh.vertexCount; i++) {
            const x = mesh.x0 + mesh.col[i] * mesh.dx, y = mesh.y0 + mesh.row[i] * mesh.dy, z = metresOf(mesh, heights[i]);
            const point = place.pointOf(x, y, z);
            assert.deepEqual([...local.subarray(3 * i, 3 * i + 3)], point.map((v) => Math.fround(v)), name);
            const ground = place.pointOf(x, y, 0), [, , up] = place.axesAt(x, y);
            assert.ok(distance(point, ground.map((v, c) => v + 3 * z * up[c])) < 1e-8, name);
        }
    }
});

test('a point of the scene leads back to its place', () => {
    const dice = new Dice(7);
    for (let i = 0; i < 20000; i++) {
        const share = () => dice.below(2 ** 31) / 2 ** 31, place = new Place({lonlat: true, exaggeration: 1 + share()});
        const lon = 360 * share() - 180, lat = i % 10 ? 180 * share() - 90 : [90, -90, 0, 89.9999999][dice.below(4)], z = 20000 * share() - 9000;
        const point = place.pointOf(lon, lat, z), back = place.crsOf(...point);
        assert.ok(distance(place.pointOf(...back), point) < 1e-7 && Math.abs(back[2] - z) < 1e-7, `${lon} ${lat} ${z}: ${back}`);
        if (Math.abs(lat) < 89.9) assert.ok(Math.abs(back[0] - lon) < 1e-11 && Math.abs(back[1] - lat) < 1e-12 * 100, `${lon} ${lat}: ${back}`);
    }
    const plane = new Place({lonlat: false, metre: 0.3048, exaggeration: 2});
    assert.ok(distance(plane.crsOf(...plane.pointOf(100.5, -7, 11)), [100.5, -7, 11]) < 1e-12);
    assert.deepEqual(plane.axesAt(1, 2), [[1, 0, 0], [0, 1, 0], [0, 0, 1]]);
    const [east, north, up] = new Place({lonlat: true}).axesAt(10, 46), dot = (a, b) => a.reduce((sum, v, c) => sum + v * b[c], 0);
    for (const [a, b, expected] of [[east, east, 1], [north, north, 1], [up, up, 1], [east, north, 0], [north, up, 0], [east, up, 0]])
        assert.ok(Math.abs(dot(a, b) - expected) < 1e-15);
    assert.ok(north[2] > 0 && up[2] > 0 && east[1] > 0);
});
