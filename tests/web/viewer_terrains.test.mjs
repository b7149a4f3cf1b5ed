// viewer_terrains.test.mjs - terrains of each kind in the page: no complaint, a picture, and the mesh that SQL gives.
import assert from 'node:assert/strict';
import {after, before, test} from 'node:test';
import {DESKTOP, PHONE, SMALL, keepingShots, launch, openPage} from './browser.mjs';
import {decodeInC, isSame} from './oracle.mjs';
import {colours} from './picture.mjs';
import {Service, TERRAINS, sql} from './serve.mjs';

let service, browser;
const views = [];
before(async () => [service, browser] = await Promise.all([Service.start(), launch()]));
after(async () => {
    await browser.close();
    assert.deepEqual(await service.stop(), {status: 0, said: ''});
});

async function open(terrain, size) {
    const view = await openPage(browser, service, {...size, path: `#terrain=${terrain}`});
    views.splice(0, Infinity, view);
    await view.settled();
    return view;
}

for (const terrain of Object.keys(TERRAINS))
    for (const [size, viewport] of Object.entries({desktop: DESKTOP, phone: PHONE})) {
        const name = `${terrain} on a ${size}`;
        test(`${name}: a picture, its figures, and no complaint`, keepingShots(name, () => views, async () => {
            const view = await open(terrain, viewport), state = await view.state(), {camera, options} = view.question();
            await view.shot(`${terrain}-${size}`);
            assert.equal(state.terrain, terrain);
            assert.deepEqual(JSON.parse(camera), state.camera, 'the camera that is told is the one that was asked with');
            assert.deepEqual([state.camera.width, state.camera.height], await view.page.evaluate(() => {
                const {clientWidth, clientHeight} = document.querySelector('canvas');
                return [clientWidth, clientHeight];
            }));
            assert.equal(JSON.parse(options).cover, 'terrain');
            const [told] = await sql(
                `SELECT count(*) AS triangles, max(achieved_tau) AS tau, min(guaranteed) AS guaranteed
                 FROM rqt_view_triangles(:camera, :terrain, :options)`, {camera, terrain, options});
            assert.equal(state.triangles, told.triangles);
            assert.equal(state.achievedTau, told.tau);
            assert.equal(Number(state.guaranteed), told.guaranteed);
            const picture = await view.picture();
            assert.ok(colours(picture) > 100, `${colours(picture)} colours`);
            assert.deepEqual(view.problems, []);
            await view.close();
        }));
    }

test('what is achieved: the header, the figure, its sentence and SQL say one thing', keepingShots('achieved', () => views, async () => {
    // Every second answer has a budget that its camera needs more than.
    let budget = null;
    const prepare = page => page.route('**/view?*', route => {
        const url = new URL(route.request().url());
        if (budget) url.searchParams.set('max_triangles', budget);
        return route.continue({url: url.href});
    });
    const view = await openPage(browser, service, {...DESKTOP, path: '#terrain=metres&tau=2', prepare});
    views.splice(0, Infinity, view);
    await view.settled();
    const {camera: {eye}} = await view.state(), seen = new Set();
    for (let i = 0; i < 10; i++) {
        budget = i % 2 ? String(1500 + 100 * i) : null;
        const state = await view.see({eye, yaw: 350 + 3 * i, pitch: -20 - i, position: 'crs', exaggeration: 1});
        const {camera, options} = view.question(), {headers} = view.lastAsked('/view');
        const [{tau, guaranteed}] = await sql('SELECT achieved_tau AS tau, guaranteed FROM rqt_view_triangles(:camera, :terrain, :options) LIMIT 1',
            {camera, terrain: 'metres', options: JSON.stringify({...JSON.parse(options), ...(budget && {max_triangles: Number(budget)})})});
        assert.equal(Number(headers['rqt-achieved-tau']), tau);
        assert.equal(state.achievedTau, tau);
        assert.equal(state.guaranteed, guaranteed);
        const sentence = await view.page.evaluate(() => document.querySelector('#promise').textContent);
        const [said] = /[\d.]+(?=\s*px)/.exec(sentence.replaceAll('\u202f', '')) ?? [];
        assert.ok(Math.abs(Number(said) - tau) <= 0.006 * tau, `${sentence} where it is ${tau}`);
        seen.add(tau);
    }
    assert.ok(seen.size > 3 && Math.max(...seen) > 2, [...seen].join());
    await view.close();
}));

test('the mesh in the page is the C decoder\'s, and that of SQL, vertex by vertex and triangle by triangle', keepingShots('mesh', () => views, async () => {
    for (const terrain of Object.keys(TERRAINS)) {
        const view = await open(terrain, SMALL), mesh = await view.mesh(), {camera, options} = view.question();
        const bytes = new Uint8Array(await (await fetch(view.lastAsked('/view').url)).arrayBuffer()), [inC] = decodeInC([{what: 'M', bytes}]);
        for (const name of ['col', 'row', 'q', 'triangles']) assert.ok(isSame(mesh[name], inC[name]), `${name} of ${terrain}`);
        const rows = await sql('SELECT col, row, q FROM rqt_view(:camera, :terrain, :options) ORDER BY 1, 2', {camera, terrain, options});
        const order = Array.from(mesh.col.keys()).sort((a, b) => mesh.col[a] - mesh.col[b] || mesh.row[a] - mesh.row[b]);
        assert.deepEqual(order.map(v => [mesh.col[v], mesh.row[v], mesh.q[v]]), rows.map(r => [r.col, r.row, r.q]), terrain);
        // Corners as SQL says them, in degrees or metres: numbers, not about the same numbers.
        const expected = await sql('SELECT x0, y0, z0, x1, y1, z1, x2, y2, z2 FROM rqt_view_triangles(:camera, :terrain, :options)', {camera, terrain, options});
        const places = await sql('SELECT col, row, x, y, z FROM rqt_view(:camera, :terrain, :options)', {camera, terrain, options});
        const at = new Map(places.map(p => [`${p.col} ${p.row}`, `${p.x} ${p.y} ${p.z}`]));
        const turned = corners => {
            const least = corners.indexOf([...corners].sort()[0]);
            return [0, 1, 2].map(i => corners[(least + i) % 3]).join(', ');
        };
        const mine = [];
        for (let i = 0; i < mesh.triangles.length; i += 3)
            mine.push(turned([0, 1, 2].map(c => at.get(`${mesh.col[mesh.triangles[i + c]]} ${mesh.row[mesh.triangles[i + c]]}`))));
        const theirs = expected.map(t => turned([`${t.x0} ${t.y0} ${t.z0}`, `${t.x1} ${t.y1} ${t.z1}`, `${t.x2} ${t.y2} ${t.z2}`]));
        assert.ok(mine.length > 100);
        assert.deepEqual(mine.sort(), theirs.sort(), terrain);
        await view.close();
    }
}));
