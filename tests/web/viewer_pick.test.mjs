// viewer_pick.test.mjs - what clicks say: the place that a ray meets, its height, and profiles, against SQL and geometry of the
// tests' own (space.mjs).
import assert from 'node:assert/strict';
import {after, before, test} from 'node:test';
import {DESKTOP, PHONE, SMALL, keepingShots, launch, openPage} from './browser.mjs';
import {Service, sql} from './serve.mjs';
import {firstHit, frameOf, rayThrough, toPlace, toPoint} from './space.mjs';

let service, browser;
const views = [];
before(async () => [service, browser] = await Promise.all([Service.start(), launch()]));
after(async () => {
    await browser.close();
    await service.stop();
});

async function open(terrain, size) {
    const view = await openPage(browser, service, {...size, path: `#terrain=${terrain}`});
    views.splice(0, Infinity, view);
    await view.settled();
    return view;
}

/** The triangles that SQL says are in the picture, as points of the scene; heights exaggerated as the camera has them. */
async function trianglesOf(view, terrain, isDegrees) {
    const {camera, options} = view.question(), {exaggeration} = JSON.parse(camera);
    const rows = await sql('SELECT x0, y0, z0, x1, y1, z1, x2, y2, z2 FROM rqt_view_triangles(:camera, :terrain, :options)', {camera, terrain, options});
    return rows.map(Object.values).map(r => [0, 3, 6].map(i => toPoint([r[i], r[i + 1], exaggeration * r[i + 2]], isDegrees)));
}

const CAMERAS = {
    degrees: {eye: [-71.42, 44.12, 2600], yaw: 31, pitch: -14, fovy: 50, position: 'crs'},
    metres: {yaw: 10, pitch: -75, fovy: 30, exaggeration: 2, position: 'crs'},
};

for (const terrain of ['degrees', 'metres'])
    test(`30 clicks on ${terrain}: where the ray meets the mesh, and SQL's height there`, keepingShots(`pick ${terrain}`, () => views, async () => {
        const isDegrees = terrain === 'degrees', view = await open(terrain, SMALL);
        const [box] = await sql('SELECT x0 + dx * (width - 1) / 2 AS x, y0 + dy * height * 0.7 AS y, max_z AS z FROM rqt_terrains WHERE name = :terrain', {terrain});
        const {camera} = await view.see(isDegrees ? CAMERAS.degrees : {...CAMERAS.metres, eye: [box.x, box.y, 2 * box.z + 1000]});
        const triangles = await trianglesOf(view, terrain, isDegrees), {eye} = frameOf(camera, isDegrees);
        let hits = 0;
        for (let i = 0; i < 30; i++) {
            const px = camera.width * (((i * 7) % 30 + 0.5) / 30), py = camera.height * ((i + 0.5) / 30), ray = rayThrough(camera, px, py, isDegrees);
            const hit = firstHit(eye, ray, triangles), picked = await view.page.evaluate(at => window.rqtViewer.pick(...at), [px, py]);
            assert.equal(picked === null, hit === null, `at ${px}, ${py}: ${JSON.stringify(picked)}, ${JSON.stringify(hit)}`);
            if (!hit) continue;
            hits++;
            // Graphics cards have single precision: the place is right to 2^-20 of its distance.
            const [x, y] = toPlace(hit.point, isDegrees), metre = isDegrees ? 111e3 : 1, most = 2e-6 * hit.distance + 0.01;
            const off = Math.hypot((picked.x - x) * metre, (picked.y - y) * metre);
            assert.ok(off <= most, `at ${px}, ${py}: ${off} m`);
            const [{z}] = await sql('SELECT rqt_height(:x, :y, 0, :terrain) AS z', {x: picked.x, y: picked.y, terrain});
            assert.equal(picked.height, z, `height at ${px}, ${py}`);
        }
        assert.ok(hits >= 15, `${hits} hits`);
        await view.close();
    }));

const click = async (view, [px, py]) => {
    const {x, y} = await view.page.locator('#picture').boundingBox();
    if (view.touch) await view.page.touchscreen.tap(x + px, y + py);
    else await view.page.mouse.click(x + px, y + py);
};
/** Without the spaces that stand between groups of digits. */
const textOf = async (view, selector) => (await view.page.evaluate(s => document.querySelector(s).textContent, selector)).replace(/\s/g, '');

for (const [size, viewport] of Object.entries({desktop: DESKTOP, phone: PHONE}))
    test(`a click says the height, two make a profile: ${size}`, keepingShots(`measure ${size}`, () => views, async () => {
        const view = await open('metres', viewport), {camera} = await view.state();
        const at = (u, v) => [Math.round(camera.width * u), Math.round(camera.height * v)], [a, b, c] = [at(0.4, 0.45), at(0.55, 0.6), at(0.5, 0.5)];
        const place = p => view.page.evaluate(q => window.rqtViewer.pick(...q), p);
        await click(view, c); // a, twice soon after another, would be a double tap
        await view.page.waitForFunction(() => /\d/.test(document.querySelector('#reading').textContent));
        const {x, y, height} = await place(c);
        assert.equal(height, (await sql("SELECT rqt_height(:x, :y, 0, 'metres') AS z", {x, y}))[0].z);
        assert.ok((await textOf(view, '#reading')).includes(height.toFixed(2)), await textOf(view, '#reading'));
        await view.shot(`height-${size}`);

        if (view.touch) await view.page.evaluate(() => window.rqtViewer.set({tool: 'profile'}));
        else await view.page.keyboard.press('p');
        await click(view, a);
        await view.page.waitForFunction(() => /A/.test(document.querySelector('#reading').textContent));
        await click(view, b);
        await view.page.waitForSelector('#profile path.curve');
        await view.shot(`profile-${size}`);
        const {line} = view.lastAsked('/profile').parameters, [from, to] = [await place(a), await place(b)];
        assert.equal(line, `LINESTRING(${from.x} ${from.y},${to.x} ${to.y})`);
        const rows = await sql('SELECT distance, z FROM rqt_profile(:line, 0, :terrain)', {line, terrain: 'metres'});
        // The curve has a point for every row: upward by height, to the right by distance, in one scale each.
        const points = (await view.page.getAttribute('#profile path.curve', 'd')).slice(1).split('L').map(p => p.split(',').map(Number));
        assert.equal(points.length, rows.length);
        const fit = (pixels, values) => {
            const [low, high] = [values.indexOf(Math.min(...values)), values.indexOf(Math.max(...values))];
            const scale = (pixels[high] - pixels[low]) / (values[high] - values[low]);
            assert.ok(Math.abs(scale) > 0);
            values.forEach((value, i) => assert.ok(Math.abs(pixels[low] + scale * (value - values[low]) - pixels[i]) < 0.2, `row ${i}`));
            return scale;
        };
        assert.ok(fit(points.map(p => p[0]), rows.map(r => r.distance)) > 0);
        assert.ok(fit(points.map(p => p[1]), rows.map(r => r.z)) < 0);
        const said = await textOf(view, '#profile');
        assert.ok(said.includes(String(Math.round(rows.at(-1).distance))), said);
        assert.ok(said.includes(String(Math.round(Math.max(...rows.map(r => r.z))))), said);
        await view.page.focus('#profile svg');
        await view.page.keyboard.press('ArrowRight');
        await view.page.waitForFunction(() => /^[\d.\u202f\u00a0]+.*m: [\d.\u202f\u00a0]+\s?m$/.test(document.querySelector('#profile .head span').textContent));
        assert.deepEqual(view.problems, []);
        await view.close();
    }));

test('a height behind the mountain is faint', keepingShots('behind', () => views, async () => {
    const view = await open('metres', DESKTOP), {camera} = await view.state();
    await click(view, [Math.round(camera.width * 0.55), Math.round(camera.height * 0.5)]);
    await view.page.waitForFunction(() => /\d/.test(document.querySelector('#pins text')?.textContent));
    const opacity = () => view.page.evaluate(() => Number(getComputedStyle(document.querySelector('#pins g')).opacity));
    await view.settled();
    assert.equal(await opacity(), 1);
    await view.see({eye: [camera.eye[0] + 100, 1211500, 3200], yaw: 180, pitch: -15, position: 'crs'});
    await view.shot('behind');
    assert.ok(await opacity() < 0.5);
    await view.see({...camera, yaw: camera.yaw + 3});
    assert.equal(await opacity(), 1);
    await view.close();
}));
