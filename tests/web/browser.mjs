// browser.mjs - headless Chromium with software WebGL, and a page in it whose every complaint is kept.
import {mkdirSync, writeFileSync} from 'node:fs';
import {join} from 'node:path';
import {ROOT, requirePackage} from './packages.mjs';
import {decodePng, findGaps} from './picture.mjs';

const {chromium} = requirePackage('playwright-core');
const SHOTS = process.env.WEB_SHOTS || join(ROOT, 'build', 'web-shots');
/** Milliseconds until a wait is given up: no measure of anything. */
export const PATIENCE = 120000;
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
 * it are looked for (frames()).
 */
export async function openPage(browser, service, {width, height, touch = false, path = '', record = false, prepare = async () => {}} = DESKTOP) {
    const context = await browser.newContext({viewport: {width, height}, hasTouch: touch, isMobile: touch, deviceScaleFactor: 1});
    const page = await context.newPage();
    page.setDefaultTimeout(PATIENCE);
    const problems = [];
    const origin = new URL(service.url).origin;
    page.on('console', message => {
        if (['error', 'warning', 'assert'].includes(message.type())) problems.push(`console: ${message.text()}`);
    });
    page.on('pageerror', error => problems.push(`exception: ${error.stack}`));
    page.on('request', request => {
        const url = new URL(request.url());
        if (!['blob:', 'data:'].includes(url.protocol) && url.origin !== origin) problems.push(`request to ${request.url()}`);
    });
    page.on('requestfailed', request => {
        const why = request.failure()?.errorText;
        if (why !== 'net::ERR_ABORTED') problems.push(`${request.url()}: ${why}`);
    });
    page.on('response', response => {
        if (response.status() >= 400) problems.push(`${response.url()}: ${response.status()}`);
    });
    if (record) await page.addInitScript(recordFrames, {detector: findGaps.toString(), background: BACKGROUND});
    await prepare(page);
    await page.goto(service.url + path);
    await page.waitForFunction(() => window.rqtViewer?.ready);
    return Object.assign(new View(), {page, context, problems});
}

export class View {
    /** The page's own account of what it shows. */
    state() {
        return this.page.evaluate(() => window.rqtViewer.state());
    }

    async setCamera(camera) {
        await this.page.evaluate(c => window.rqtViewer.setCamera(c), camera);
    }

    /** Until nothing is under way: the mesh for this camera is there, and no vertex moves. */
    async settled() {
        await this.page.evaluate(() => window.rqtViewer.settled());
    }

    /** Moves, and is there. */
    async see(camera) {
        await this.setCamera(camera);
        await this.settled();
        return this.state();
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

    /** What recordFrames saw since the last call: [{count, at, terrain, ...}] with one entry a frame. */
    frames() {
        return this.page.evaluate(() => window.recordedFrames.splice(0));
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
            for (const [i, view] of views().entries()) await view.shot(`FAILED ${name} ${i}`.replace(/[^\w.-]+/g, '_')).catch(() => {});
            throw error;
        }
    };
}

export function keepText(name, text) {
    mkdirSync(SHOTS, {recursive: true});
    writeFileSync(join(SHOTS, name), text);
}

/**
 * In the page, before its own scripts: paints the background in a colour of its own and reads the canvas after each frame,
 * within the same task, as it will be shown. A pixel with a share of that colour counts as background: edges are smoothed.
 */
function recordFrames({detector, background}) {
    const findGaps = (0, eval)(`(${detector})`);
    const clearColor = WebGL2RenderingContext.prototype.clearColor;
    WebGL2RenderingContext.prototype.clearColor = function () { clearColor.call(this, ...background, 1); };
    window.recordedFrames = [];
    const copy = document.createElement('canvas');
    const request = window.requestAnimationFrame.bind(window);
    let drawn = false;
    for (const name of ['drawElements', 'drawArrays', 'clear']) {
        const draw = WebGL2RenderingContext.prototype[name];
        WebGL2RenderingContext.prototype[name] = function (...rest) { drawn = this.canvas; return draw.apply(this, rest); };
    }
    const look = () => {
        if (!drawn) return;
        const {width, height} = copy;
        if (width !== drawn.width || height !== drawn.height) Object.assign(copy, {width: drawn.width, height: drawn.height});
        const context = copy.getContext('2d', {willReadFrequently: true});
        context.drawImage(drawn, 0, 0);
        drawn = false;
        const {data} = context.getImageData(0, 0, copy.width, copy.height);
        const shows = new Uint8Array(copy.width * copy.height);
        for (let i = 0; i < shows.length; i++) shows[i] = Math.min(data[4 * i], data[4 * i + 2]) - data[4 * i + 1] > 24 ? 1 : 0;
        const vanishing = window.vanishingPoint?.(copy.width, copy.height) ?? null;
        const found = findGaps(shows, copy.width, copy.height, vanishing);
        window.recordedFrames.push({...found, width: copy.width, height: copy.height});
        window.lastFrame = {shows, data, width: copy.width, height: copy.height};
    };
    window.requestAnimationFrame = callback => request(time => { callback(time); look(); });
}
