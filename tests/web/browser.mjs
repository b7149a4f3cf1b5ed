// browser.mjs - headless Chromium with software WebGL, and a page in it whose every complaint is kept.
import {mkdirSync, writeFileSync} from 'node:fs';
import {join} from 'node:path';
import {ROOT, requirePackage} from './packages.mjs';
import {decodePng, findGaps} from './picture.mjs';
import {vanishingPoint} from './space.mjs';

const {chromium} = requirePackage('playwright-core');
const SHOTS = process.env.WEB_SHOTS || join(ROOT, 'build', 'web-shots');
/** Milliseconds until a wait is given up: no measure of anything. */
export const PATIENCE = Number(process.env.WEB_PATIENCE || 60000);
/** What the terrain never has: the background of the pictures in which gaps are looked for. */
const BACKGROUND = [1, 0, 1];

export const DESKTOP = {width: 1280, height: 800}, PHONE = {width: 360, height: 640, touch: true}, SMALL = {width: 480, height: 320};

export function launch() {
    return chromium.launch({
        executablePath: process.env.CHROMIUM || '/usr/bin/chromium',
        args: ['--headless', '--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--disable-background-networking'],
    });
}

/**
 * Opens a page of the service and waits for the viewer.
 *
 * `problems` collects what a clean page has none of: errors and warnings of the console, exceptions, requests that failed (but
 * for those that the page took back itself) and requests to anyone but the service. `record`: after every frame, the gaps in
 * it are looked for (frames()). `slow`: so many times slower does the time of the page go, so that what takes a moment has many frames.
 */
export async function openPage(browser, service, {width, height, touch = false, path = '', record = false, slow = 1, prepare = async () => {}} = DESKTOP) {
    const context = await browser.newContext({viewport: {width, height}, hasTouch: touch, isMobile: touch, deviceScaleFactor: 1});
    const page = await context.newPage();
    page.setDefaultTimeout(PATIENCE);
    const problems = [], asked = [], told = [];
    const origin = new URL(service.url).origin;
    page.on('console', message => {
        if (['error', 'warning', 'assert'].includes(message.type())) problems.push(`console: ${message.text()}`);
    });
    page.on('pageerror', error => problems.push(`exception: ${error.stack}`));
    page.on('request', request => {
        const url = new URL(request.url());
        if (!['blob:', 'data:'].includes(url.protocol) && url.origin !== origin) problems.push(`request to ${request.url()}`);
        asked.push(url);
    });
    page.on('requestfailed', request => {
        const why = request.failure()?.errorText;
        if (why !== 'net::ERR_ABORTED') problems.push(`${request.url()}: ${why}`);
    });
    page.on('response', response => {
        told.push({url: new URL(response.url()), headers: response.headers()});
        if (response.status() >= 400) problems.push(`${response.url()}: ${response.status()}`);
    });
    if (record) await page.addInitScript(recordFrames, {findGaps: findGaps.toString(), vanishingPoint: vanishingPoint.toString(), background: BACKGROUND, slow});
    await prepare(page);
    await page.goto(service.url + path);
    await page.evaluate(() => (window.rqtViewer || window.rqtCesium).ready);
    return Object.assign(new View(), {page, context, problems, asked, told, touch});
}

export class View {
    /** The page's own account of what it shows: camera, terrain, settings and figures, in one. */
    async state() {
        const {settings, figures, ...state} = await this.page.evaluate(() => window.rqtViewer.state());
        return {...settings, ...figures, ...state};
    }

    async setCamera(camera) {
        await this.page.evaluate(c => window.rqtViewer.setCamera(c), camera);
    }

    /** Until nothing is under way: the mesh for this camera is there, and no vertex moves. */
    async settled() {
        const isSettled = await this.page.evaluate(patience => Promise.race([
            window.rqtViewer.settled().then(() => true), new Promise(resolve => setTimeout(resolve, patience, false)),
        ]), PATIENCE);
        if (!isSettled) throw new Error(`the page does not settle: ${JSON.stringify(await this.state())}`);
    }

    /** Moves, and is there. */
    async see(camera) {
        await this.setCamera(camera);
        await this.settled();
        return this.state();
    }

    /** Until what `see` gives in the page, with an argument, is as `is` wants it; that. */
    async until(see, is, argument) {
        for (const end = Date.now() + PATIENCE; ;) {
            const seen = await this.page.evaluate(see, argument);
            if (is(seen)) return seen;
            if (Date.now() > end) throw new Error(`in vain waited for ${is}: ${JSON.stringify(seen)}`);
            await new Promise(resolve => setTimeout(resolve, 30));
        }
    }

    /** The fragment of the address, when it says what the page shows: it is written a moment later. */
    async fragment() {
        const {camera, wires, ask} = await this.state();
        return this.until(() => location.hash, hash => {
            const kept = new URLSearchParams(hash.slice(1));
            return kept.get('eye') === camera.eye.join() && Number(kept.get('yaw')) === camera.yaw && Number(kept.get('pitch')) === camera.pitch &&
                kept.has('wires') === wires && (ask !== 'view' || Number(kept.get('tau')) === camera.tau);
        });
    }

    /** The canvas alone, without what lies over it: a picture. */
    async picture() {
        const style = 'body * { visibility: hidden !important } canvas { visibility: visible !important }';
        return decodePng(await this.page.screenshot({style}));
    }

    /** The page as people see it, kept in build/web-shots. */
    async shot(name) {
        mkdirSync(SHOTS, {recursive: true});
        await this.page.screenshot({path: join(SHOTS, `${name}.png`)});
    }

    /** Keeps the first frames that had gaps, too. */
    async keepGaps(name) {
        const found = await this.page.evaluate(() => window.withGaps || []);
        found.forEach((url, i) => writeFileSync(join(SHOTS, `${name}-gap${i}.png`), Buffer.from(url.split(',')[1], 'base64')));
    }

    /** What recordFrames saw since the last call: [{count, at, terrain, ...}] with one entry a frame. */
    frames() {
        return this.page.evaluate(() => window.recordedFrames.splice(0));
    }

    /** The mesh that is shown, as the page's decoder made it: its arrays of numbers, and what stands in its header. */
    async mesh() {
        const found = await this.page.evaluate(() => {
            const base64 = array => {
                const bytes = new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
                let text = '';
                for (let i = 0; i < bytes.length; i += 8192) text += String.fromCharCode(...bytes.subarray(i, i + 8192));
                return {kind: array.constructor.name, base64: btoa(text)};
            };
            return Object.entries(window.rqtViewer.mesh()).map(([name, value]) => [name, ArrayBuffer.isView(value) ? base64(value) : value]);
        });
        const kinds = {Int8Array, Uint8Array, Int32Array, Uint32Array, Float32Array, Float64Array};
        return Object.fromEntries(found.map(([name, value]) => {
            if (!value?.base64) return [name, value];
            const bytes = Uint8Array.from(Buffer.from(value.base64, 'base64'));
            return [name, new kinds[value.kind](bytes.buffer)];
        }));
    }

    /** What the page last asked for at an endpoint: {url, parameters}, and what it was last told there: {headers}. */
    lastAsked(endpoint) {
        const url = this.asked.filter(({pathname}) => pathname.endsWith(endpoint)).at(-1);
        const told = this.told.filter(({url: {pathname}}) => pathname.endsWith(endpoint)).at(-1);
        return {url: url.href, parameters: Object.fromEntries(url.searchParams), headers: told?.headers};
    }

    /** The camera and the options with which the page asked for what it shows, as SQL takes them. */
    question() {
        const {camera, f, ...options} = this.lastAsked('/view').parameters;
        return {camera, format: f, options: JSON.stringify(options, (key, value) => key === 'max_triangles' ? Number(value) : value)};
    }

    async close() {
        await this.context.close();
    }
}

/** A test's body that keeps a picture of the page when it fails. */
export function keepingShots(name, views, body) {
    return async t => {
        try {
            await body(t);
        } catch (error) {
            const file = `FAILED-${name}`.replace(/[^\w.-]+/g, '-');
            for (const view of views()) await view.shot(file).then(() => view.keepGaps(file)).catch(() => {});
            throw error;
        }
    };
}

/**
 * In the page, before its own scripts: paints the background in a colour of its own and reads the canvas after each frame,
 * within the same task, as it will be shown. A pixel with a share of that colour counts as background: edges are smoothed.
 *
 * The software that stands in for a graphics card cuts triangles off at the picture's border, each for itself: the two sides
 * of an edge across the border then differ by a subpixel, and now and then the background shines through. Graphics cards
 * have a guard band, in which nothing is cut off; here a viewport twice as large under half the projection is one.
 *
 * window.leaveOut = n leaves the n-th triangle out of what is drawn.
 */
function recordFrames({findGaps, vanishingPoint, background, slow}) {
    const make = text => new Function(`return (${text})`)();
    const gapsOf = make(findGaps), vanishing = make(vanishingPoint), gl = WebGL2RenderingContext.prototype;
    const {clearColor, drawElements, getUniformLocation, uniformMatrix4fv, viewport} = gl, projections = new WeakSet(), copy = document.createElement('canvas');
    const request = window.requestAnimationFrame.bind(window), now = performance.now.bind(performance);
    let drawn = null;
    let underWay = 0;
    const fetch = window.fetch.bind(window);
    window.fetch = (...question) => {
        underWay++;
        return fetch(...question).finally(() => underWay--);
    };
    window.recordedFrames = [];
    window.withGaps = [];
    window.pictures = [];
    performance.now = () => now() / slow;
    gl.clearColor = function () {
        clearColor.call(this, ...background, 1);
    };
    gl.viewport = function (x, y, width, height) {
        viewport.call(this, x - width / 2, y - height / 2, 2 * width, 2 * height);
    };
    gl.getUniformLocation = function (program, name) {
        const location = getUniformLocation.call(this, program, name);
        if (location && name === 'projectionMatrix') projections.add(location);
        return location;
    };
    gl.uniformMatrix4fv = function (location, transpose, matrix) {
        const halved = projections.has(location) ? matrix.map((v, i) => i % 4 < 2 ? v / 2 : v) : matrix;
        uniformMatrix4fv.call(this, location, transpose, halved);
    };
    gl.drawElements = function (mode, count, type, offset) {
        drawn = this.canvas;
        if (mode !== this.TRIANGLES || !(window.leaveOut < count / 3)) return drawElements.call(this, mode, count, type, offset);
        const before = 3 * window.leaveOut, size = type === this.UNSIGNED_INT ? 4 : 2;
        if (before) drawElements.call(this, mode, before, type, offset);
        if (before + 3 < count) drawElements.call(this, mode, count - before - 3, type, offset + (before + 3) * size);
    };
    const look = () => {
        if (!drawn) return;
        const {width, height} = drawn;
        if (width !== copy.width || height !== copy.height) Object.assign(copy, {width, height});
        const context = copy.getContext('2d', {willReadFrequently: true});
        context.drawImage(drawn, 0, 0);
        drawn = null;
        const {data} = context.getImageData(0, 0, width, height), shows = new Uint8Array(width * height);
        for (let i = 0; i < shows.length; i++) shows[i] = Math.min(data[4 * i], data[4 * i + 2]) - data[4 * i + 1] > 24 ? 1 : 0;
        const camera = window.rqtViewer.state?.().camera;
        if (!camera) return;
        const found = gapsOf(shows, width, height, vanishing({...camera, width, height}));
        window.recordedFrames.push({...found, camera, waits: underWay > 0});
        if (found.count && window.withGaps.length < 3) window.withGaps.push(copy.toDataURL());
        if (window.keepPictures) window.pictures.push(new Uint32Array(data.buffer));
    };
    window.requestAnimationFrame = callback => request(() => {
        callback(performance.now());
        look();
    });
}
