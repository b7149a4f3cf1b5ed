// page.test.mjs - the page's modules that need no browser: cameras, picking, edges, the stream of questions, the address.
import assert from 'node:assert/strict';
import {test} from 'node:test';
import {Camera, lookAtAll} from '../../src/web/camera.js';
import {promiseOf} from '../../src/web/figures.js';
import {Fly} from '../../src/web/fly.js';
import {CHUNK, buildGeometry, edgesOf} from '../../src/web/geometry.js';
import {Orbit} from '../../src/web/orbit.js';
import {groundBelow, pickPoint} from '../../src/web/pick.js';
import {Place} from '../../src/web/place.js';
import {runsOf, ticksOf} from '../../src/web/profile.js';
import {add, createScene, dot, length, subtract, unit} from '../../src/web/scene.js';
import {readFragment, writeFragment} from '../../src/web/state.js';
import {Dice} from './oracle.mjs';

const DEGREES = {lonlat: 1, semi_major: 6378137, inverse_flattening: 298.257223563}, FEET = {lonlat: 0, metre: 0.3048006096012192};
const SCENES = {degrees: createScene(DEGREES), feet: createScene(FEET), bare: createScene({})};
const near = (a, b, most, why) => assert.ok(a.every((v, i) => Math.abs(v - b[i]) <= most), `${why}: ${a} and ${b}`);

const dice = new Dice(20260);
const random = (low, high) => low + (high - low) * dice.below(2 ** 31) / 2 ** 31;
console.log(`RQT_SEED=${dice.seed}`);

function randomCamera(scene) {
    const camera = new Camera(scene);
    Object.assign(camera, {width: 640, height: 400, fovy: random(10, 90), yaw: random(0, 360), pitch: random(-80, 60)});
    camera.eye = scene.point(scene.isSpace ? [random(-180, 180), random(-85, 85), random(100, 1e6)] : [random(-1e6, 1e6), random(-1e6, 1e6), random(10, 9000)]);
    return camera;
}

/** A mesh with ridges: (n + 1)^2 samples, all of them vertices. */
function ridges(n, place) {
    const mesh = {...place, z0: 0, d: 1, numerator: 1, denominator: 1, scale: 1, offset: 0, vertexCount: (n + 1) ** 2, normals: null, errors: null};
    const grid = from => Int32Array.from({length: mesh.vertexCount}, (_, i) => from(i % (n + 1), Math.floor(i / (n + 1))));
    Object.assign(mesh, {col: grid(x => x), row: grid((x, y) => y), q: grid((x, y) => Math.round(300 * Math.sin(x / 3) * Math.cos(y / 5)) + dice.below(40))});
    mesh.triangles = new Uint32Array(6 * n * n);
    let at = 0;
    for (let y = 0; y < n; y++)
        for (let x = 0; x < n; x++) {
            const a = y * (n + 1) + x, b = a + 1, c = a + n + 1, d = c + 1;
            for (const v of (x + y) % 2 ? [a, c, b, b, c, d] : [a, d, b, a, c, d]) mesh.triangles[at++] = v;
        }
    return mesh;
}

test('a CRS in feet is metres in the scene, one in degrees is geocentric on its own ellipsoid', () => {
    near(SCENES.feet.point([1000, 2000, 30]), [304.8006096012192, 609.6012192024384, 30], 1e-9, 'feet');
    near(SCENES.bare.point([1000, 2000, 30]), [1000, 2000, 30], 0, 'no CRS');
    near(SCENES.degrees.point([90, 0, 30]), [0, 6378167, 0], 1e-8, 'equator');
    const clarke = createScene({lonlat: 1, semi_major: 6378206.4, inverse_flattening: 294.9786982139006}), sphere = createScene({lonlat: 1, semi_major: 6371000, inverse_flattening: 0});
    near(clarke.point([-100, 90, 30]), [0, 0, 6356583.8 + 30], 1e-6, 'Clarke 1866, pole');
    near(clarke.place(clarke.point([-100, 40, 30])), [-100, 40, 30], 1e-8, 'Clarke 1866, back');
    near(sphere.point([0, 90, 30]), [0, 0, 6371030], 1e-8, 'sphere, pole');
    near(new Place(clarke.how).positionsOf({x0: 0, y0: 90, dx: 1, dy: -1, z0: 0, d: 1, numerator: 1, denominator: 1, scale: 1, offset: 0, vertexCount: 1,
        col: [0], row: [0], q: [7]}, [0, 0, 6356583.8]), [0, 0, 7], 1e-5, 'Clarke 1866, a mesh');
});

test('a camera is what its JSON says: read again it asks the same', () => {
    for (const scene of Object.values(SCENES))
        for (let i = 0; i < 200; i++) {
            const camera = randomCamera(scene), again = new Camera(scene), json = camera.json(1.5);
            again.read(json);
            Object.assign(again, {width: camera.width, height: camera.height});
            assert.deepEqual(again.json(1.5), json);
            assert.ok(length(subtract(again.eye, camera.eye)) < 1e-3);
        }
});

test('a direction of the picture leads to what is projected there', () => {
    for (const scene of Object.values(SCENES))
        for (let i = 0; i < 200; i++) {
            const camera = randomCamera(scene), at = [random(-1, 1), random(-1, 1)];
            const seen = camera.project(add(camera.eye, camera.direction(...at), random(1, 1e5)));
            near([seen.x, seen.y], at, 1e-6, 'there');
        }
});

test('a camera looks to the north and up where its angles say so', () => {
    const camera = new Camera(SCENES.bare);
    Object.assign(camera, {yaw: 90, pitch: 0});
    near(camera.basis().forward, [1, 0, 0], 1e-12, 'east');
    camera.turn(-90, 30);
    near(camera.basis().forward, [0, Math.cos(Math.PI / 6), 0.5], 1e-12, 'north and upward');
    camera.read({eye: [0, 0, 100], at: [0, 100, 0]});
    near([camera.yaw, camera.pitch], [0, -45], 1e-9, 'at');
});

/** What of the picture points take: {x, y, width, height}, x and y of the middle. */
function frameOf(camera, points) {
    const seen = points.map(point => camera.project(point));
    assert.ok(seen.every(one => one && Math.abs(one.x) < 1 && Math.abs(one.y) < 1), 'every point is in the picture');
    const [xs, ys] = ['x', 'y'].map(axis => seen.map(one => one[axis]));
    const [left, right, low, high] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    return {x: (left + right) / 2, y: (low + high) / 2, width: right - left, height: high - low};
}

test('the whole terrain is in the picture, in any shape of window', () => {
    const globe = [-180, -90, 180, 90], places = [[SCENES.degrees, [-72, 44, -71, 45]], [SCENES.degrees, [1, 41, 2, 43]],
        [SCENES.degrees, [-20, -35, 50, 37]], [SCENES.degrees, globe], [SCENES.bare, [0, 0, 4000, 4000]], [SCENES.feet, [5e5, 4e6, 9e5, 4.1e6]]];
    for (const [scene, box] of places)
        for (const [width, height, share] of [[1280, 800, 1], [360, 600, 1], [600, 360, 1], [360, 600, 0.58]])
            for (const highest of [2000, 300]) {
                const camera = new Camera(scene), points = [];
                Object.assign(camera, {width, height, fovy: Camera.usualAngle(width, height)});
                for (let i = 0; i <= 8; i++)
                    for (let j = 0; j <= 8; j++)
                        for (const z of [100, 100 + (highest - 100) * j / 8])
                            points.push(scene.point([box[0] + (box[2] - box[0]) * i / 8, box[1] + (box[3] - box[1]) * j / 8, z]));
                // A mesh may be anywhere between its lowest and highest height: it is its own picture that is in the middle.
                const origin = points[0], mesh = {origin, positions: points.flatMap(point => subtract(point, origin))};
                lookAtAll(camera, box, [100, 2000], mesh, share);
                const found = frameOf(camera, points), why = JSON.stringify({box, width, height, share, highest, ...found});
                near([found.x, found.y], [0, 0], 0.001, why);
                assert.ok(Math.max(found.width / 1.86, found.height / 1.8 / share) > 0.999, `it fills the picture: ${why}`);
                assert.ok(found.height < 1.8 * share + 1e-6, why);
                assert.equal(camera.yaw, 0);
                lookAtAll(camera, box, [100, 2000]);
                frameOf(camera, points);
            }
});

test('orbit: the ground that is held stays where it is in the picture, or under the pointer', () => {
    let moves = 0;
    for (const scene of Object.values(SCENES))
        for (let i = 0; i < 100; i++) {
            const camera = randomCamera(scene);
            camera.pitch = random(-70, -15);
            const distance = random(1.2, 4) * camera.place[2], at = [random(-0.6, 0.6), random(-0.6, 0.6)];
            const point = add(camera.eye, camera.direction(...at), distance), orbit = new Orbit(camera, () => point, 1e9);
            const seen = () => { const {x, y} = camera.project(point); return [x, y]; };
            orbit.begin(at);
            orbit.drag('turn', at, [at[0] + 0.2, at[1] - 0.1]);
            orbit.end();
            assert.ok(Math.abs(length(subtract(camera.eye, point)) / distance - 1) < 1e-9, 'as far away');
            // Straight down, a camera without roll cannot show everything anywhere.
            const {up} = scene.axes(scene.place(point)), isSteep = dot(unit(subtract(camera.eye, point)), up) > 0.6;
            if (!isSteep) near(seen(), at, 1e-6, 'turned');
            const held = seen();
            orbit.zoom(0.5, held);
            assert.ok(Math.abs(length(subtract(camera.eye, point)) / distance - 0.5) < 1e-9, 'half as far');
            if (!isSteep) near(seen(), held, 1e-6, 'nearer');
            const from = seen(), to = [from[0] + 0.05, from[1] - 0.05];
            const before = camera.eye;
            orbit.begin(from);
            orbit.drag('pan', from, to);
            const moved = length(subtract(camera.eye, before)) > 0;
            if (moved && !isSteep) near(seen(), to, 1e-6, 'moved');
            moves += moved && !isSteep;
        }
    assert.ok(moves > 100, `${moves}`);
});

test('orbit: nobody gets lost by zooming out', () => {
    const camera = randomCamera(SCENES.bare), point = add(camera.eye, camera.direction(0, 0), 1000), orbit = new Orbit(camera, () => point, 5000);
    for (let i = 0; i < 20; i++) orbit.zoom(1.5, [0, 0]);
    near([length(subtract(camera.eye, point))], [5000], 1e-6, 'as far as there is something to see');
});

test('flying is as fast as the ground is far, and level flight keeps its height round the Earth', () => {
    for (const scene of Object.values(SCENES)) {
        const camera = randomCamera(scene), fly = new Fly(camera, () => 500);
        camera.eye = scene.point(scene.isSpace ? [10, 45, 3000] : [1e5, 1e5, 3000]);
        Object.assign(camera, {yaw: 70, pitch: 0});
        const from = camera.eye;
        for (let i = 0; i < 100; i++) fly.step(0.1, {ahead: 1, right: 0, up: 0, yaw: 0, pitch: 0, fast: false});
        assert.ok(Math.abs(length(subtract(camera.eye, from)) - 5000) < 5, `${length(subtract(camera.eye, from))}`);
        near([camera.place[2]], [3000], 1e-6, 'the height');
    }
});

test('picking: the nearest triangle on the ray, as all of them say one by one', () => {
    for (const [name, how, frame] of [['metres', {lonlat: false}, {x0: 5e5, y0: 4e6, dx: 30, dy: -30}], ['degrees', {lonlat: true}, {x0: -71, y0: 45, dx: 0.0003, dy: -0.0003}]]) {
        const place = new Place(how), mesh = ridges(40, frame), scene = name === 'degrees' ? SCENES.degrees : SCENES.bare;
        const middle = [frame.x0 + 20 * frame.dx, frame.y0 + 20 * frame.dy], eye = scene.point([...middle, 900]);
        const geometry = buildGeometry(mesh, place, eye, false);
        assert.ok(geometry.boxes.length / 6 === Math.ceil(mesh.triangles.length / 3 / CHUNK));
        const corner = v => [0, 1, 2].map(axis => geometry.positions[3 * v + axis] + eye[axis]);
        let hits = 0, misses = 0;
        for (let i = 0; i < 60; i++) {
            const target = scene.point([frame.x0 + random(-10, 50) * frame.dx, frame.y0 + random(-10, 50) * frame.dy, random(-200, 200)]);
            const ray = unit(subtract(target, eye)), found = pickPoint(geometry, eye, ray);
            // Every triangle's plane, and on which sides of its edges the ray passes, by volumes.
            let nearest = Infinity;
            for (let t = 0; t < mesh.triangles.length; t += 3) {
                const [a, b, c] = [0, 1, 2].map(k => subtract(corner(mesh.triangles[t + k]), eye));
                const volume = (p, q) => dot([p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]], ray);
                const sides = [volume(a, b), volume(b, c), volume(c, a)], sum = sides[0] + sides[1] + sides[2];
                if (!(sides.every(s => s >= 0) || sides.every(s => s <= 0)) || sum === 0) continue;
                const at = [0, 1, 2].map(axis => (sides[1] * a[axis] + sides[2] * b[axis] + sides[0] * c[axis]) / sum), far = dot(at, ray);
                if (far > 0) nearest = Math.min(nearest, far);
            }
            if (nearest === Infinity) misses++;
            else hits++;
            assert.equal(found !== null, nearest < Infinity);
            if (found) near([length(subtract(found, eye))], [nearest], 1e-5 * nearest, name);
        }
        assert.ok(hits > 15 && misses > 5, `${hits} hits, ${misses} misses`);
        const ground = scene.place(groundBelow(geometry, scene, eye));
        near(ground, [...middle, mesh.q[20 * 41 + 20]], 0.01, 'the ground below the eye is its vertex');
        const under = scene.place(groundBelow(geometry, scene, scene.point([...middle, -900])));
        near(under, ground, 0.01, 'and is found from below, too');
    }
});

test('edges: every side of a triangle, once', () => {
    const mesh = ridges(23, {x0: 0, y0: 0, dx: 1, dy: 1}), edges = edgesOf(mesh.triangles), wanted = new Set(), got = new Set();
    for (let i = 0; i < mesh.triangles.length; i += 3)
        for (const [p, q] of [[0, 1], [1, 2], [2, 0]]) {
            const ends = [mesh.triangles[i + p], mesh.triangles[i + q]].sort((a, b) => a - b);
            wanted.add(ends.join());
        }
    for (let i = 0; i < edges.length; i += 2) got.add([edges[i], edges[i + 1]].sort((a, b) => a - b).join());
    assert.equal(edges.length, 2 * wanted.size);
    assert.deepEqual([...got].sort(), [...wanted].sort());
});

test('ticks are round numbers within the axis', () => {
    for (let i = 0; i < 200; i++) {
        const low = random(-5000, 5000), high = low + 10 ** random(-1, 5), many = random(2, 10), ticks = ticksOf(low, high, many);
        assert.ok(ticks.every(tick => tick >= low - 1e-9 && tick <= high * (1 + 1e-9) + 1e-9) && ticks.length <= many + 1, `${low} ${high}: ${ticks}`);
        const step = ticks[1] - ticks[0], digits = step / 10 ** Math.floor(Math.log10(step * (1 + 1e-9)));
        if (ticks.length > 1) assert.ok([1, 2, 5].some(d => Math.abs(digits - d) < 1e-6), `${step}`);
    }
});

test('a void ends a run of a profile, and a single height is none', () => {
    const rows = [5, 6, null, 7, null, null, 8, 9, 10].map((z, i) => [i, i, 0, z]);
    assert.deepEqual(runsOf(rows).map(run => run.map(([, , , z]) => z)), [[5, 6], [8, 9, 10]]);
});

test('what is proved is never less than what was rounded, and nothing of no triangle', () => {
    const answer = (ask, asked, achieved) => ({wish: {ask, asked}, told: {achievedEps: achieved, achievedTau: achieved, guaranteed: 1}, mesh: {triangleCount: 9}});
    const text = (...all) => promiseOf(...all).text.replaceAll('\u00a0', ' ');
    assert.match(text(answer('range', 0, 0), 0), /^Proved: every sample is met exactly\.$/);
    assert.match(text(answer('range', 0, 0), 0.00048828125), /^Proved: nowhere more than 0\.00049 m from any sample\.$/);
    assert.match(text(answer('range', 5, 5), 0.00048828125), /^Proved: nowhere more than 5 m from any sample\.$/);
    assert.match(text(answer('range', 5, 10.5), 0), /10\.5 m from any sample\. 5 m would take too many triangles\.$/);
    assert.match(text(answer('view', 1, 1), 0), /off by more than 1 px\.$/);
    assert.ok(promiseOf(answer('view', 1, 1)).isProved);
    for (const ask of ['view', 'range']) assert.equal(promiseOf({...answer(ask, 1, 1), mesh: {triangleCount: 0}}).isProved, false);
});

test('the address says what is shown, and nonsense in it nothing', () => {
    const state = {terrain: 'a b/&=c', eye: [-71.25, 44.5, 1234.567], yaw: 12.3456, pitch: -8, fovy: 40, exaggeration: 2.5, ask: 'view', tau: 1.5, colour: 'error', wires: true, mode: 'fly'};
    const {camera, ...read} = readFragment(writeFragment(state));
    assert.deepEqual(camera, {eye: state.eye, yaw: state.yaw, pitch: state.pitch, fovy: state.fovy});
    for (const key of ['terrain', 'exaggeration', 'ask', 'tau', 'colour', 'wires', 'mode']) assert.equal(read[key], state[key], key);
    assert.equal(read.capture, false);
    const nonsense = readFragment('#eye=1,2&tau=-3&eps=many&ask=all&colour=__proto__&mode=&exaggeration=NaN');
    for (const [key, value] of Object.entries(nonsense)) assert.ok(value === undefined || value === false, `${key}: ${value}`);
    for (const eye of [',,', '1,,2', '1e300,0,0', '1,2,NaN']) assert.equal(readFragment(`#eye=${eye}`).camera, undefined, eye);
});
