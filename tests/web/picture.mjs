// picture.mjs - pictures as the tests read them: PNG to pixels, and where the background shows through a terrain.
import {inflateSync} from 'node:zlib';

/** Pixels of a PNG (8 bits, RGB or RGBA, not interlaced), and its texts (tEXt) by their keywords: {width, height, rgba, texts}. */
export function decodePng(file) {
    const width = file.readUInt32BE(16), height = file.readUInt32BE(20), channels = file[25] === 6 ? 4 : 3;
    if (file[24] !== 8 || (file[25] !== 2 && file[25] !== 6) || file[28] !== 0) throw new Error('a PNG of another kind');
    const parts = [], texts = {};
    for (let at = 8; at < file.length; at += 12 + file.readUInt32BE(at)) {
        const kind = file.toString('latin1', at + 4, at + 8), data = file.subarray(at + 8, at + 8 + file.readUInt32BE(at));
        if (kind === 'IDAT') parts.push(data);
        if (kind === 'tEXt') texts[data.toString('latin1', 0, data.indexOf(0))] = data.toString('latin1', data.indexOf(0) + 1);
    }
    const raw = inflateSync(Buffer.concat(parts)), stride = width * channels;
    const rgba = new Uint8ClampedArray(4 * width * height).fill(255);
    let before = new Uint8Array(stride), line = new Uint8Array(stride);
    for (let y = 0; y < height; y++) {
        const filter = raw[y * (stride + 1)];
        for (let i = 0; i < stride; i++) {
            const left = i < channels ? 0 : line[i - channels], up = before[i], corner = i < channels ? 0 : before[i - channels];
            const paeth = () => {
                const p = left + up - corner, l = Math.abs(p - left), u = Math.abs(p - up), c = Math.abs(p - corner);
                return l <= u && l <= c ? left : u <= c ? up : corner;
            };
            const guess = [() => 0, () => left, () => up, () => (left + up) >> 1, paeth][filter]();
            line[i] = raw[y * (stride + 1) + 1 + i] + guess;
        }
        for (let x = 0; x < width; x++)
            for (let c = 0; c < channels; c++) rgba[4 * (y * width + x) + c] = line[x * channels + c];
        [before, line] = [line, before];
    }
    return {width, height, rgba, texts};
}

/** How many pixels of two pictures differ. */
export function differingPixels(a, b) {
    if (a.width !== b.width || a.height !== b.height) return Infinity;
    const one = new Uint32Array(a.rgba.buffer), other = new Uint32Array(b.rgba.buffer);
    return one.reduce((sum, pixel, i) => sum + (pixel !== other[i]), 0);
}

/** How many colours a picture has. */
export const colours = picture => new Set(new Uint32Array(picture.rgba.buffer)).size;

/**
 * Where the background shows through a terrain.
 *
 * A terrain is the graph of a height over a convex place, so a half-plane that stands on the vertical through the eye
 * meets it in one piece: along the line that the half-plane is in the picture, background, terrain, background follow
 * each other, once. Those lines run through the vanishing point of the vertical, which is far away for a level camera:
 * then they are the picture's columns. A background pixel with terrain on both sides of it on its line is a gap. Since
 * pixels have a size, its two neighbouring lines, a pixel to each side, must have terrain on both sides too: a silhouette that runs
 * along the lines is no gap.
 *
 * Self-contained: the page of the tests runs it from its text, after every frame.
 *
 * @param {Uint8Array} background 1 where the picture shows the background, row by row from the top
 * @param {[number, number]|null} vanishing in pixels, x to the right, y down; null: at infinity
 * @returns {{count: number, at: number[][], terrain: number}} gaps; the first of them; pixels of terrain
 */
export function findGaps(background, width, height, vanishing) {
    let terrain = 0;
    for (let i = 0; i < background.length; i++) terrain += 1 - background[i];
    let lines = width, steps = height, pixel = (line, step) => step * width + line, apart = () => 1, round = false;
    if (vanishing) {
        const [vx, vy] = vanishing, corners = [[0, 0], [width, 0], [0, height], [width, height]].map(([x, y]) => [x - vx, y - vy]);
        const furthest = Math.max(...corners.map(([x, y]) => Math.hypot(x, y)));
        round = vx > 0 && vx < width && vy > 0 && vy < height;
        const middle = Math.atan2(height / 2 - vy, width / 2 - vx);
        const angles = corners.map(([x, y]) => Math.atan2(y, x) - middle).map(a => Math.atan2(Math.sin(a), Math.cos(a)));
        const first = round ? 0 : middle + Math.min(...angles), range = round ? 2 * Math.PI : Math.max(...angles) - Math.min(...angles);
        const nearest = round ? 0 : Math.hypot(Math.max(0, -vx, vx - width), Math.max(0, -vy, vy - height));
        lines = Math.ceil((range * furthest) / 0.7);
        steps = Math.ceil((furthest - nearest) / 0.7);
        pixel = (line, step) => {
            const angle = first + (range * (line + 0.5)) / lines, distance = nearest + 0.7 * (step + 0.5);
            const x = Math.floor(vx + distance * Math.cos(angle)), y = Math.floor(vy + distance * Math.sin(angle));
            return x < 0 || y < 0 || x >= width || y >= height ? -1 : y * width + x;
        };
        apart = step => Math.ceil((1.5 * lines) / (range * (nearest + 0.7 * (step + 0.5))));
    }
    const first = new Int32Array(lines).fill(steps), last = new Int32Array(lines).fill(-1);
    for (let line = 0; line < lines; line++)
        for (let step = 0; step < steps; step++) {
            const p = pixel(line, step);
            if (p < 0 || background[p]) continue;
            if (first[line] === steps) first[line] = step;
            last[line] = step;
        }
    const found = new Set();
    for (let line = 0; line < lines; line++)
        for (let step = first[line] + 1; step < last[line]; step++) {
            const p = pixel(line, step);
            if (p < 0 || !background[p]) continue;
            const inside = [-apart(step), apart(step)].every(offset => {
                let other = line + offset;
                if (round) other = ((other % lines) + lines) % lines;
                else if (other < 0 || other >= lines) return true;
                return first[other] < step && step < last[other];
            });
            if (inside) found.add(p);
        }
    return {count: found.size, at: [...found].slice(0, 10).map(p => [p % width, Math.floor(p / width)]), terrain};
}
