// viewer_faults.test.mjs - what the page does when the service says no, says nonsense, or is gone.
import assert from 'node:assert/strict';
import {execFileSync} from 'node:child_process';
import {mkdtempSync, rmSync, writeFileSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join} from 'node:path';
import {after, before, test} from 'node:test';
import {DESKTOP, keepingShots, launch, openPage} from './browser.mjs';
import {BUILD} from './packages.mjs';
import {differingPixels} from './picture.mjs';
import {Service, TERRAINS} from './serve.mjs';

let browser;
const views = [];
before(async () => { browser = await launch(); });
after(async () => {
    await browser.close();
    Service.endAll();
});

async function open(service, options = {}) {
    const view = await openPage(browser, service, {...DESKTOP, path: '#terrain=metres', ...options});
    views.splice(0, Infinity, view);
    await view.settled();
    return view;
}

/** The sentence that people see, or ''. */
const sentence = view => view.page.evaluate(() => {
    const problem = document.querySelector('#problem');
    return problem.checkVisibility() ? problem.querySelector('p').textContent : '';
});
const until = (view, is) => view.until(() => document.querySelector('#problem').checkVisibility(), is);
/** A camera a little further on each time. */
const camera = async (view, n) => {
    const {camera: {eye, yaw, pitch}} = await view.state();
    return {eye, yaw: yaw + n, pitch, position: 'crs'};
};

test('the service is gone: a sentence; it is back: the page goes on', keepingShots('gone', () => views, async () => {
    let service = await Service.start();
    const view = await open(service), {port} = service;
    await service.stop();
    const lost = await camera(view, 20);
    await view.setCamera(lost);
    await until(view, shown => shown);
    assert.match(await sentence(view), /does not answer/);
    const claim = () => view.page.evaluate(() => document.querySelector('#promise').textContent);
    assert.match(await claim(), /^Nothing is proved/);
    await view.page.selectOption('#terrain', 'degrees');
    assert.doesNotMatch(await claim(), /^Proved/);
    assert.equal(await view.page.isVisible('#triangles'), false);
    await view.page.selectOption('#terrain', 'metres');
    await view.setCamera(lost);
    await view.page.mouse.click(500, 420);
    await until(view, shown => shown);
    await view.shot('service-gone');
    service = await Service.start({port});
    await until(view, shown => !shown);
    await view.settled();
    const asked = JSON.parse(view.lastAsked('/view').parameters.camera), {camera: shown} = await view.state();
    assert.deepEqual(asked, shown);
    assert.ok(Math.abs(shown.yaw - lost.yaw % 360) < 1e-3);
    assert.deepEqual(view.problems.filter(p => !/ERR_CONNECTION_REFUSED|ERR_EMPTY_RESPONSE|ERR_CONNECTION_RESET|ERR_SOCKET_NOT_CONNECTED/.test(p)), []);
    await view.close();
    await service.stop();
}));

test('more than the service gives: its sentence is shown, and a coarser mesh comes', keepingShots('413', () => views, async () => {
    const service = await Service.start({options: ['--max-triangles', '3000']});
    const view = await open(service, {path: '#terrain=metres&ask=range&eps=0'});
    await until(view, shown => shown);
    assert.match(await sentence(view), /3000/);
    await view.shot('service-says-no');
    // Nothing is claimed of nothing.
    const claim = () => document.querySelector('#claim').innerText.trim();
    assert.equal(await view.page.evaluate(claim), 'Nothing is shown yet.');
    assert.equal(await view.page.evaluate(() => document.querySelector('#promise').checkVisibility()), false);
    await view.page.focus('#eps');
    await view.page.keyboard.press('End');
    await until(view, shown => !shown);
    await view.settled();
    const {triangles} = await view.state();
    assert.ok(triangles > 0 && triangles <= 3000, `${triangles}`);
    assert.match(await view.page.evaluate(claim), /triangles[^]*Proved: /);
    await view.close();
    await service.stop();
}));

test('damaged answers: a sentence, the mesh before stays, and the page goes on', keepingShots('damaged', () => views, async () => {
    const service = await Service.start();
    let damage = null;
    const prepare = page => page.route('**/view?*', async route => {
        if (!damage) return route.continue();
        const response = await route.fetch();
        return route.fulfill({response, body: damage(Buffer.from(await response.body()))});
    });
    const view = await open(service, {prepare}), {triangles} = await view.state();
    const turn = await camera(view, 15);
    for (const [name, how] of Object.entries({
        'cut off': bytes => bytes.subarray(0, bytes.length / 2),
        'one bit': bytes => { bytes[bytes.length >> 1] ^= 4; return bytes; },
        'empty': () => Buffer.alloc(0),
        'noise': bytes => Buffer.from(bytes.map((b, i) => b ^ (i * 37))),
        'a page': () => Buffer.from('<!doctype html><title>captive portal</title>'),
    })) {
        damage = how;
        await view.setCamera({...turn, yaw: turn.yaw + name.length});
        await until(view, shown => shown);
        assert.match(await sentence(view), /^.{10,}/, name);
        assert.doesNotMatch(await sentence(view), /undefined|null|properties|function|NaN/, name);
        assert.equal((await view.state()).triangles, triangles, name);
        damage = null;
        await view.setCamera({...turn, yaw: turn.yaw - name.length});
        await until(view, shown => !shown);
        await view.see(await camera(view, 0));
        await view.see({...turn, yaw: turn.yaw - 15});
        assert.equal((await view.state()).triangles, triangles, `${name}: the view before`);
    }
    assert.deepEqual(view.problems.filter(p => !/ERR_|Failed to load/.test(p)), []);
    await view.close();
    await service.stop();
}));

test('the graphics card takes the picture away: a sentence; it is back: the same picture', keepingShots('lost', () => views, async () => {
    const service = await Service.start(), view = await open(service, {path: '#terrain=metres&wires'}), picture = await view.picture();
    await view.page.evaluate(() => {
        window.card = document.querySelector('#picture').getContext('webgl2').getExtension('WEBGL_lose_context');
        window.card.loseContext();
    });
    await until(view, shown => shown);
    assert.match(await sentence(view), /graphics card/);
    await view.page.evaluate(() => window.card.restoreContext());
    await until(view, shown => !shown);
    await view.settled();
    assert.equal(differingPixels(picture, await view.picture()), 0);
    await view.see(await camera(view, 5));
    assert.deepEqual(view.problems, []);
    await view.close();
    await service.stop();
}));

test('a terrain that is not there: a sentence, and another one', keepingShots('atlantis', () => views, async () => {
    const service = await Service.start(), view = await open(service, {path: '#terrain=atlantis'});
    assert.match(await sentence(view), /atlantis/);
    assert.ok(Object.keys(TERRAINS).includes((await view.state()).terrain));
    assert.ok((await view.state()).triangles > 100);
    await view.close();
    await service.stop();
}));

test('a terrain that is all void: it says so, without a complaint', keepingShots('all void', () => views, async () => {
    const folder = mkdtempSync(join(tmpdir(), 'rqt_web_')), database = join(folder, 'void.gpkg'), raster = join(folder, 'void.asc');
    writeFileSync(raster, `ncols 3\nnrows 3\nxllcorner 0\nyllcorner 0\ncellsize 10\nNODATA_value -1\n${'-1 -1 -1\n'.repeat(3)}`);
    execFileSync(join(BUILD, 'rqt'), ['import', '--name', 'void', raster, database], {stdio: 'pipe'});
    const service = await Service.start({databases: [database]}), view = await open(service, {path: ''});
    assert.match(await view.page.textContent('#facts'), /all void/);
    assert.match(await view.page.textContent('#promise'), /nothing to draw/);
    assert.equal((await view.state()).triangles, 0);
    assert.deepEqual(view.problems, []);
    await view.close();
    await service.stop();
    rmSync(folder, {recursive: true});
}));

test('databases without a terrain: a sentence', keepingShots('nothing', () => views, async () => {
    const folder = mkdtempSync(join(tmpdir(), 'rqt_web_')), database = join(folder, 'empty.gpkg');
    execFileSync('sqlite3', [database, 'CREATE TABLE empty (x)']);
    const service = await Service.start({databases: [database]});
    const view = await openPage(browser, service, DESKTOP);
    views.splice(0, Infinity, view);
    assert.match(await view.page.evaluate(() => document.body.innerText), /no terrain|nothing|no rqt|No database/i);
    await view.shot('no-terrain');
    assert.deepEqual(view.problems, []);
    await view.close();
    await service.stop();
    rmSync(folder, {recursive: true});
}));
