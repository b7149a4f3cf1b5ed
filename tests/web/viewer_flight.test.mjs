// viewer_flight.test.mjs - every frame of a flight over a terrain without voids: no pixel of background inside its outline.
//
// Frames between a request and its answer count, and those of geomorphs. picture.mjs says what a gap is.
import assert from 'node:assert/strict';
import {after, before, test} from 'node:test';
import {SMALL, keepingShots, launch, openPage} from './browser.mjs';
import {differingPixels} from './picture.mjs';
import {Service, sql} from './serve.mjs';

let service, browser;
const views = [];
before(async () => [service, browser] = await Promise.all([Service.start(), launch()]));
after(async () => {
    await browser.close();
    await service.stop();
});

async function open(terrain, options) {
    const view = await openPage(browser, service, {...SMALL, path: `#terrain=${terrain}`, record: true, ...options});
    views.splice(0, Infinity, view);
    await view.settled();
    return view;
}

/** Moves without waiting for the mesh; over when so many frames more have been drawn or nothing is left to draw. */
async function moveOn(view, camera, frames) {
    await view.page.evaluate(async ([c, n]) => {
        const goal = window.recordedFrames.length + n;
        let over = false;
        window.rqtViewer.setCamera(c);
        window.rqtViewer.settled().then(() => over = true);
        while (window.recordedFrames.length < goal && !over) await new Promise(resolve => setTimeout(resolve, 5));
    }, [camera, frames]);
}

/**
 * Where the flight goes. A step: place in the terrain's box (0 to 1), metres above the ground there (above its highest, when
 * `over`), yaw, pitch, and how many frames to stay; without them, until the picture is final.
 */
function* steps() {
    for (let i = 0; i < 16; i++) // low over ridges and valleys, swaying
        yield {u: 0.3 + 0.025 * i, v: 0.35 + 0.02 * i + 0.03 * Math.sin(i), above: 120, yaw: 55 + 25 * Math.sin(i / 2), pitch: -6 + 6 * Math.cos(i), stay: i % 4 === 3 ? undefined : 2};
    for (let i = 0; i < 8; i++) // all around
        yield {u: 0.7, v: 0.67, above: 200, yaw: 80 + 45 * i, pitch: i % 2 ? 0 : -15, stay: i % 4 === 3 ? undefined : 2};
    for (const [i, pitch] of [-35, -60, -80, -89.9, -89.9, -70, -45].entries()) // down
        yield {u: 0.6 - 0.03 * i, v: 0.6, above: 1500 - 150 * i, yaw: 300 - 20 * i, pitch, stay: i === 3 ? undefined : 3};
    for (const [i, [u, v, above]] of [[0.2, 0.8, 900], [0.8, 0.2, 3000], [0.45, 0.5, 500], [0.15, 0.15, 5000], [0.85, 0.8, 700], [0.5, 0.3, 250],
        [0.5, 0.7, 1200], [0.3, 0.5, 400], [0.75, 0.5, 8000], [0.35, 0.35, 600]].entries()) // hither and thither
        yield {u, v, above, yaw: 137 * i % 360, pitch: -12 - 5 * (i % 4), stay: 1 + i % 3};
    for (const [i, pitch] of [-10, -25, -40].entries()) // from outside
        yield {u: 0.3 + 0.2 * i, v: -0.4, above: 800 + 1200 * i, over: true, yaw: 20 - 20 * i, pitch, stay: i === 2 ? undefined : 3};
}

async function camerasOver(terrain) {
    const [box] = await sql('SELECT x0, y0, dx, dy, width, height, max_z FROM rqt_terrains WHERE name = :terrain', {terrain});
    // Heights of the steps are for a hundred kilometres; a small terrain is flown over lower.
    const cameras = [], lower = above => above > 300 ? above * Math.min(1, box.height / 600) : above;
    for (const {u, v, above, over, yaw, pitch, stay} of steps()) {
        const x = box.x0 + u * (box.width - 1) * box.dx, y = box.y0 + (1 - v) * (box.height - 1) * box.dy;
        cameras.push({x, y, above: lower(above), over, stay, camera: {yaw, pitch, fovy: 45, position: 'crs'}});
    }
    const values = cameras.map(({x, y}) => `(${x}, ${y})`).join(', ');
    const heights = await sql(`SELECT rqt_height(column1, column2, 0, :terrain) AS z FROM (VALUES ${values})`, {terrain});
    // As the page's address keeps them: to a tenth of a millimetre and of a thousandth degree.
    const round = (value, digits) => Number(value.toFixed(digits)), places = terrain === 'degrees' ? 9 : 4;
    return cameras.map(({x, y, above, over, stay, camera}, i) => ({stay, camera: {
        ...camera, eye: [round(x, places), round(y, places), round((over ? box.max_z : heights[i].z) + above, 3)],
        yaw: round(camera.yaw, 4), pitch: round(camera.pitch, 4),
    }}));
}

const withGaps = frames => frames.filter(f => f.count > 0).map(({count, at, camera}) => JSON.stringify({count, at, camera}));

for (const terrain of ['degrees', 'metres'])
    test(`flying over ${terrain}: no frame has a gap`, keepingShots(`flight ${terrain}`, () => views, async t => {
        const view = await open(terrain), cameras = await camerasOver(terrain);
        assert.ok(cameras.length >= 40);
        let frames = await view.frames(), land = 0;
        for (const {camera, stay} of cameras) {
            if (stay) await moveOn(view, camera, stay);
            else await view.see(camera);
            const seen = await view.frames();
            assert.ok(seen.length > 0, `a frame at ${JSON.stringify(camera)}`);
            land += seen.at(-1).terrain > 1000;
            frames = frames.concat(seen);
        }
        await view.settled();
        frames = frames.concat(await view.frames());
        const waiting = frames.filter(f => f.waits).length;
        t.diagnostic(`${frames.length} frames, ${waiting} of them between question and answer`);
        assert.deepEqual(withGaps(frames), []);
        assert.ok(frames.length >= 2 * cameras.length, `${frames.length} frames`);
        assert.ok(waiting >= 10, `${waiting} frames between question and answer`);
        assert.ok(land >= 0.75 * cameras.length, `terrain at ${land} cameras`);
        assert.deepEqual(view.problems, []);

        // The picture at the end is the one that a page has which was never elsewhere.
        const picture = await view.picture(), fragment = await view.fragment();
        await view.close();
        const fresh = await open(terrain, {path: fragment});
        assert.equal(differingPixels(picture, await fresh.picture()), 0);
        await fresh.close();
    }));

test('a triangle that is missing is seen', keepingShots('missing triangle', () => views, async () => {
    const view = await open('metres'), [{camera}] = (await camerasOver('metres')).slice(15);
    const {triangles} = await view.see(camera);
    await view.frames();
    let seen = 0;
    for (let i = 0; i < 40; i++) {
        await view.page.evaluate(n => { window.leaveOut = n; }, Math.floor(((i + 0.5) * triangles) / 40));
        await moveOn(view, camera, 1);
        seen += (await view.frames()).some(frame => frame.count > 0);
    }
    assert.ok(seen >= 5, `${seen} of 40`);
    await view.page.evaluate(() => { window.leaveOut = undefined; });
    await moveOn(view, camera, 1);
    assert.deepEqual(withGaps(await view.frames()), []);
    await view.close();
}));

test('a geomorph has pictures half-way, no gap, and ends in the picture of a page that was loaded there', keepingShots('geomorph', () => views, async () => {
    for (const terrain of ['degrees', 'metres']) {
        const view = await open(terrain, {slow: 5}), cameras = await camerasOver(terrain);
        await view.see({...cameras[24].camera, pitch: -30});
        await view.frames();
        await view.page.evaluate(() => { window.keepPictures = true; });
        await view.see({...cameras[27].camera, pitch: -30});
        const frames = await view.frames();
        const pictures = await view.page.evaluate(() => {
            window.keepPictures = false;
            const differing = (a, b) => a.reduce((sum, pixel, i) => sum + (pixel !== b[i]), 0), all = window.pictures.splice(0);
            return all.map(p => [differing(p, all[0]), differing(p, all.at(-1))]);
        });
        assert.deepEqual(withGaps(frames), []);
        // At the new camera with the old mesh, then between the two, then with the new one.
        const between = pictures.filter(([fromFirst, fromLast]) => fromFirst > 0 && fromLast > 0);
        assert.ok(between.length >= 3, `${between.length} pictures between, of ${pictures.length}: ${JSON.stringify(pictures)}`);
        const picture = await view.picture(), fragment = await view.fragment();
        await view.close();
        const fresh = await open(terrain, {path: fragment});
        assert.equal(differingPixels(picture, await fresh.picture()), 0, terrain);
        await fresh.close();
    }
}));
