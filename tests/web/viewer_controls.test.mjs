// viewer_controls.test.mjs - the page by keyboard and by its controls, the address that keeps a view, and what those need who
// cannot see well or at all.
import assert from 'node:assert/strict';
import {after, before, test} from 'node:test';
import {DESKTOP, PHONE, keepingShots, launch, openPage} from './browser.mjs';
import {differingPixels} from './picture.mjs';
import {Service} from './serve.mjs';

let service, browser;
const views = [];
before(async () => [service, browser] = await Promise.all([Service.start(), launch()]));
after(async () => {
    await browser.close();
    await service.stop();
});

async function open(terrain = 'metres', options = {}) {
    const view = await openPage(browser, service, {...DESKTOP, path: `#terrain=${terrain}`, ...options});
    views.splice(0, Infinity, view);
    await view.settled();
    return view;
}

/** Until the page's own account of itself is as `is` wants it; then settled. */
async function until(view, is) {
    await view.until(() => ({...window.rqtViewer.state().settings, ...window.rqtViewer.state()}), is);
    await view.settled();
    return view.state();
}

test('every control is reached by Tab', keepingShots('tab', () => views, async () => {
    const view = await open();
    // A group of radio buttons is one stop.
    const wanted = await view.page.evaluate(() => {
        const seen = new Set();
        window.controlName = e => e.type === 'radio' ? `radio ${e.name}` : e.id || e.getAttribute('aria-label') || e.textContent.trim();
        for (const e of document.querySelectorAll('a[href], button, input, select, [tabindex="0"]'))
            if (e.checkVisibility({checkVisibilityCSS: true}) && !e.disabled) seen.add(window.controlName(e));
        return [...seen];
    });
    const reached = new Set();
    for (let i = 0; i < 2 * wanted.length; i++) {
        await view.page.keyboard.press('Tab');
        reached.add(await view.page.evaluate(() => document.activeElement && window.controlName(document.activeElement)));
    }
    assert.ok(wanted.length >= 10, wanted.join());
    assert.deepEqual(wanted.filter(name => !reached.has(name)), []);
    await view.close();
}));

test('sliders change the mesh, by the arrow keys', keepingShots('sliders', () => views, async () => {
    const view = await open();
    let before = await view.state();
    await view.page.focus('#tau');
    for (let i = 0; i < 3; i++) await view.page.keyboard.press('ArrowRight');
    let now = await until(view, s => s.camera.tau > before.camera.tau);
    assert.ok(now.triangles < before.triangles, `${now.triangles} at ${now.camera.tau}, ${before.triangles} at ${before.camera.tau}`);
    assert.equal(JSON.parse(view.lastAsked('/view').parameters.camera).tau, now.camera.tau);
    await view.page.focus('#picture');
    await view.page.keyboard.press('v');
    before = await until(view, s => s.ask === 'range');
    await view.page.focus('#eps');
    for (let i = 0; i < 3; i++) await view.page.keyboard.press('ArrowRight');
    now = await until(view, s => s.eps > before.eps);
    assert.ok(now.triangles < before.triangles, `${now.triangles} at ${now.eps} m, ${before.triangles} at ${before.eps} m`);
    assert.equal(Number(view.lastAsked('/range').parameters.eps), now.eps);
    const picture = await view.picture();
    await view.page.focus('#exaggeration');
    for (let i = 0; i < 2; i++) await view.page.keyboard.press('ArrowRight');
    await until(view, s => s.camera.exaggeration === 2);
    assert.ok(differingPixels(picture, await view.picture()) > 5000);
    assert.deepEqual(view.problems, []);
    await view.close();
}));

test('keys fly, colour, draw edges and help', keepingShots('keys', () => views, async () => {
    const view = await open(), {keyboard} = view.page;
    await view.page.focus('#picture');
    const pictures = [await view.picture()];
    await keyboard.press('m');
    await view.settled();
    pictures.push(await view.picture());
    await view.shot('edges');
    await keyboard.press('c');
    await view.settled();
    pictures.push(await view.picture());
    await view.shot('errors');
    await keyboard.press('c');
    await view.settled();
    pictures.push(await view.picture());
    for (let i = 1; i < pictures.length; i++) assert.ok(differingPixels(pictures[i - 1], pictures[i]) > 5000, `picture ${i}`);
    await keyboard.press('f');
    const {camera} = await view.state();
    for (const [key, moves] of [['w', (a, b) => a.eye[0] !== b.eye[0] || a.eye[1] !== b.eye[1]], ['e', (a, b) => b.eye[2] > a.eye[2]],
        ['l', (a, b) => a.yaw !== b.yaw], ['i', (a, b) => b.pitch > a.pitch]]) {
        const {camera: from} = await view.state();
        await keyboard.down(key);
        await view.until(() => window.rqtViewer.state().camera, camera => moves(from, camera));
        await keyboard.up(key);
    }
    await view.settled();
    assert.notDeepEqual((await view.state()).camera, camera);
    await keyboard.press('?');
    await view.page.waitForSelector('#help[open]');
    await view.shot('help');
    await keyboard.press('Escape');
    await view.page.waitForFunction(() => !document.querySelector('#help').open);
    assert.deepEqual(view.problems, []);
    await view.close();
}));

test('keys move the camera after a pointer has pressed a control, and not behind the help', keepingShots('keys after pointer', () => views, async () => {
    const view = await open(), {page} = view, {keyboard} = page;
    const moved = async key => {
        const {camera: from} = await view.state();
        await keyboard.down(key);
        await view.until(from => JSON.stringify(window.rqtViewer.state().camera.eye) !== JSON.stringify(from), Boolean, from.eye);
        await keyboard.up(key);
    };
    for (const control of ['#tau', '#wires', '#colour [value=plain]', '#mode [value=fly]']) {
        await page.locator(control).click();
        await moved('w');
    }
    await moved('ArrowUp');
    assert.equal((await view.state()).mode, 'fly');
    await view.settled();
    const {camera} = await view.state();
    await keyboard.press('?');
    await page.waitForSelector('#help[open]');
    await keyboard.down('w');
    await page.evaluate(() => new Promise(resolve => requestAnimationFrame(() => requestAnimationFrame(resolve))));
    await keyboard.up('w');
    assert.deepEqual((await view.state()).camera, camera);
    assert.deepEqual(view.problems, []);
    await view.close();
}));

test('an address that names an exaggeration alone is asked with it', keepingShots('address exaggeration', () => views, async () => {
    const view = await open();
    await view.page.evaluate(() => { location.hash = '#terrain=metres&exaggeration=5'; });
    await until(view, s => s.exaggeration === 5);
    assert.equal(JSON.parse(view.lastAsked('/view').parameters.camera).exaggeration, 5);
    assert.deepEqual(view.problems, []);
    await view.close();
}));

test('an address keeps a view: loaded again it is the same picture', keepingShots('address', () => views, async () => {
    const view = await open('degrees');
    await view.see({eye: [-71.42, 44.12, 2600], yaw: 31, pitch: -14, fovy: 50, position: 'crs'});
    await view.page.focus('#tau');
    await view.page.keyboard.press('ArrowRight');
    await view.page.focus('#picture');
    await view.page.keyboard.press('m');
    await view.settled();
    await view.shot('address');
    const [picture, state, path] = [await view.picture(), await view.state(), await view.fragment()];
    await view.close();
    const again = await open('', {path}), now = await again.state();
    for (const key of ['terrain', 'camera', 'triangles', 'achievedTau', 'guaranteed']) assert.deepEqual(now[key], state[key], key);
    assert.equal(differingPixels(picture, await again.picture()), 0);
    await again.close();
}));

test('names: every control says what it is', keepingShots('names', () => views, async () => {
    const view = await open();
    const session = await view.context.newCDPSession(view.page);
    const {nodes} = await session.send('Accessibility.getFullAXTree');
    const roles = ['button', 'link', 'slider', 'radio', 'checkbox', 'combobox', 'radiogroup', 'dialog', 'textbox', 'spinbutton', 'tab'];
    const controls = nodes.filter(n => !n.ignored && roles.includes(n.role?.value));
    assert.ok(controls.length >= 15, `${controls.length} controls`);
    assert.deepEqual(controls.filter(n => !n.name?.value?.trim()).map(n => `${n.role.value} ${JSON.stringify(n.properties)}`), []);
    assert.equal(await view.page.evaluate(() => document.documentElement.lang), 'en');
    await view.close();
}));

test('on a phone the open sheet leaves the terrain to be seen, and what its sliders do', keepingShots('sheet', () => views, async () => {
    const view = await open('metres', PHONE);
    await view.page.click('#sheet');
    await view.settled();
    const top = await view.page.evaluate(() => document.querySelector('#panel').getBoundingClientRect().top);
    assert.ok(top > 0.5 * PHONE.height, `the sheet begins at ${top}`);
    const before = await view.picture(), pixels = new Uint32Array(before.rgba.buffer), ground = pixels[0];
    const rows = Array.from({length: before.height}, (none, y) => pixels.subarray(y * before.width, (y + 1) * before.width));
    const shown = rows.map((row, y) => row.some(pixel => pixel !== ground) ? y : -1).filter(y => y >= 0);
    const middle = (shown[0] + shown.at(-1)) / 2;
    assert.ok(middle > top / 4 && middle < 3 * top / 4, `the terrain is from ${shown[0]} to ${shown.at(-1)}, the sheet begins at ${top}`);
    const {triangles} = await view.state();
    await view.page.focus('#tau');
    await view.page.keyboard.press('End');
    await until(view, s => s.camera.tau === 64);
    assert.ok((await view.state()).triangles < triangles / 2);
    await view.shot('sheet');
    const after = new Uint32Array((await view.picture()).rgba.buffer), end = Math.floor(top) * before.width;
    const changed = after.subarray(0, end).reduce((sum, pixel, i) => sum + (pixel !== pixels[i]), 0);
    assert.ok(changed > 5000, `${changed} pixels above the sheet change`);
    assert.deepEqual(view.problems, []);
    await view.close();
}));

/**
 * In the page: the contrast of every text that is seen, by WCAG's formula. Where what is behind it is not known (the terrain),
 * the least of that over black and over white.
 */
function contrasts() {
    const parse = text => {
        const canvas = window.oneColour ??= new OffscreenCanvas(1, 1).getContext('2d', {willReadFrequently: true});
        canvas.clearRect(0, 0, 1, 1);
        canvas.fillStyle = text;
        canvas.fillRect(0, 0, 1, 1);
        const [r, g, b, a] = canvas.getImageData(0, 0, 1, 1).data;
        return [r, g, b, a / 255];
    };
    const over = ([r, g, b, a], [R, G, B]) => [r * a + R * (1 - a), g * a + G * (1 - a), b * a + B * (1 - a), 1];
    const luminance = c => {
        const [r, g, b] = c.slice(0, 3).map(v => v / 255).map(v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
        return 0.2126 * r + 0.7152 * g + 0.0722 * b;
    };
    const ratio = (a, b) => {
        const [x, y] = [luminance(a), luminance(b)];
        return (Math.max(x, y) + 0.05) / (Math.min(x, y) + 0.05);
    };
    const found = [];
    for (const element of document.querySelectorAll('body *')) {
        const text = [...element.childNodes].filter(n => n.nodeType === Node.TEXT_NODE).map(n => n.data.trim()).join(' ').trim();
        const box = element.getBoundingClientRect();
        if (!text || element.closest('option, script, style, noscript') || !element.checkVisibility({checkOpacity: true, checkVisibilityCSS: true})) continue;
        if (box.width < 2 || box.height < 2 || element.closest('fieldset, label')?.querySelector('input:disabled')) continue;
        const layers = [];
        let opacity = 1;
        for (let e = element; e; e = e.parentElement) {
            const style = getComputedStyle(e);
            opacity *= Number(style.opacity);
            layers.unshift(e.id === 'stage' ? 'terrain' : parse(style.backgroundColor));
        }
        const isUnknown = layers.includes('terrain'), style = getComputedStyle(element);
        const colour = parse(element.namespaceURI.endsWith('svg') ? style.fill : style.color);
        const least = Math.min(...[[0, 0, 0], [255, 255, 255]].map(ground => {
            const behind = layers.reduce((below, layer) => layer === 'terrain' ? [...ground, 1] : over(layer, below), isUnknown ? [...ground, 1] : [255, 255, 255, 1]);
            return ratio(over([colour[0], colour[1], colour[2], colour[3] * opacity], behind), behind);
        }));
        const isLarge = parseFloat(style.fontSize) >= 24 || (parseFloat(style.fontSize) >= 18.66 && Number(style.fontWeight) >= 700);
        found.push({text: text.slice(0, 40), least: Math.round(100 * least) / 100, wanted: isLarge ? 3 : 4.5});
    }
    return found;
}

for (const [name, size] of Object.entries({desktop: DESKTOP, phone: PHONE}))
    test(`contrast: every text can be read, in the light and in the dark, on a ${name}`, keepingShots(`contrast ${name}`, () => views, async () => {
        const view = await open('metres', size);
        if (size.touch) await view.page.click('#sheet');
        for (const scheme of ['light', 'dark']) {
            await view.page.emulateMedia({colorScheme: scheme});
            await view.shot(`${scheme}-${name}`);
            let found = await view.page.evaluate(contrasts);
            await view.page.evaluate(() => document.querySelector('#help').showModal());
            await view.shot(`help-${scheme}-${name}`);
            found = found.concat(await view.page.evaluate(contrasts));
            await view.page.keyboard.press('Escape');
            assert.ok(found.length > 20, `${found.length} texts`);
            assert.deepEqual(found.filter(f => f.least < f.wanted), [], scheme);
        }
        await view.close();
    }));
