// space.test.mjs - the geometry of the tests, held against SQL's and against itself.
import assert from 'node:assert/strict';
import {test} from 'node:test';
import {sql} from './serve.mjs';
import {firstHit, frameOf, rayThrough, seenAt, toPlace, toPoint, vanishingPoint} from './space.mjs';

const near = (a, b, most, why) => assert.ok(a.every((v, i) => Math.abs(v - b[i]) <= most), `${why}: ${a} and ${b}`);
const CAMERA = {eye: [-71.3, 44.2, 3000], yaw: 33, pitch: -27, fovy: 50, width: 480, height: 320};

test('places in space are those of SQL, there and back', async () => {
    // A mesh in space has more vertices, for the Earth is round, and another order: they are paired by where they are.
    const places = await sql("SELECT x, y, z FROM rqt_range(NULL, 400, 'degrees')"), key = (x, y) => `${x.toFixed(4)} ${y.toFixed(4)}`;
    const at = new Map(places.map(({x, y, z}) => [key(x, y), [x, y, z]]));
    const points = await sql(`SELECT x, y, z FROM rqt_range(NULL, 400, 'degrees', '{"frame": "ecef"}')`);
    let pairs = 0;
    for (const point of points.map(Object.values)) {
        const found = toPlace(point, true), place = at.get(key(found[0], found[1]));
        if (!place) continue;
        pairs++;
        near(found, place, 1e-6, 'a place');
        near(toPoint(place, true), point, 1e-6, 'its point');
    }
    assert.ok(pairs > 100 && pairs > 0.9 * places.length, `${pairs}`);
});

test('a ray through a pixel leads to what is seen there', () => {
    for (const [degrees, eye] of [[true, CAMERA.eye], [false, [1000, 2000, 300]]])
        for (const [x, y] of [[240, 160], [0, 0], [480, 320], [17.5, 301.25]]) {
            const camera = {...CAMERA, eye}, ray = rayThrough(camera, x, y, degrees), from = frameOf(camera, degrees).eye;
            near(seenAt(camera, from.map((v, i) => v + 5000 * ray[i]), degrees), [x, y], 1e-6, 'there');
        }
    const level = frameOf({...CAMERA, eye: [0, 0, 0], yaw: 90, pitch: 0}, false);
    near(level.forward, [1, 0, 0], 1e-12, 'a yaw of 90 degrees looks east');
    near(level.right, [0, -1, 0], 1e-12, 'with the south at its right');
    near(level.above, [0, 0, 1], 1e-12, 'and the sky above');
});

test('what is straight below, or above, is seen where the vertical vanishes', () => {
    for (const pitch of [-80, -20, 35]) {
        const camera = {...CAMERA, eye: [0, 0, 0], pitch};
        near(seenAt(camera, [0, 0, pitch < 0 ? -1e3 : 1e3], false), vanishingPoint(camera), 1e-6, `${pitch}`);
    }
    assert.equal(vanishingPoint({...CAMERA, pitch: 0}), null);
});

test('a ray meets the nearest of the triangles that it passes', () => {
    const square = z => [[[0, 0, z], [4, 0, z], [4, 4, z]], [[0, 0, z], [4, 4, z], [0, 4, z]]], triangles = [...square(1), ...square(3), ...square(2)];
    const hit = firstHit([1, 2, 10], [0.1, 0, -1], triangles);
    assert.equal(hit.triangle, 3);
    near(hit.point, [1.7, 2, 3], 1e-12, 'point');
    assert.equal(firstHit([1, 2, 10], [0, 0, 1], triangles), null);
    assert.equal(firstHit([5, 2, 10], [0, 0, -1], triangles), null);
});
