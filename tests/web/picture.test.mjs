// picture.test.mjs - the judge of gaps, judged: on pictures drawn by hand.
import assert from 'node:assert/strict';
import {test} from 'node:test';
import {deflateSync} from 'node:zlib';
import {decodePng, findGaps} from './picture.mjs';

const WIDTH = 96, HEIGHT = 64;

/** Terrain where `is` says so. */
function draw(is) {
    const background = new Uint8Array(WIDTH * HEIGHT);
    for (let y = 0; y < HEIGHT; y++) for (let x = 0; x < WIDTH; x++) background[y * WIDTH + x] = is(x, y) ? 0 : 1;
    return background;
}
const gaps = (is, vanishing = null) => findGaps(draw(is), WIDTH, HEIGHT, vanishing).count;
const ridge = (x, y) => y > 20 + 8 * Math.sin(x / 9);

test('a skyline has no gap, nor has a terrain that floats, one that fills the picture, or none', () => {
    assert.equal(gaps(ridge), 0);
    assert.equal(gaps((x, y) => ridge(x, y) && y < 50 - x / 8 && x > 10 && x < 80), 0);
    assert.equal(gaps(() => true), 0);
    assert.equal(gaps(() => false), 0);
});

test('a pixel inside is a gap, and is said where', () => {
    const holed = (x, y) => ridge(x, y) && !(x === 40 && y === 45);
    assert.equal(gaps(holed), 1);
    assert.deepEqual(findGaps(draw(holed), WIDTH, HEIGHT, null).at, [[40, 45]]);
});

test('cracks of one pixel are gaps, level, steep and up to the skyline', () => {
    assert.equal(gaps((x, y) => ridge(x, y) && !(y === 40 && x > 20 && x < 60)), 39);
    assert.ok(gaps((x, y) => ridge(x, y) && !(x === 30 && y > 35 && y < 55)) >= 19);
    assert.ok(gaps((x, y) => ridge(x, y) && !(Math.abs(x - 40 - (y - 40) / 3) < 0.5 && y > 25 && y < 60)) >= 25);
});

test('a missing triangle is a gap', () => {
    assert.ok(gaps((x, y) => ridge(x, y) && !(x > 40 && y > 40 && x + y < 92)) > 40);
});

test('a silhouette along the lines is no gap', () => {
    const cliff = (x, y) => x > 30 + ((y * 7) % 3 === 0 ? 1 : 0) && y > 10;
    assert.equal(gaps(cliff), 0);
});

for (const [name, vanishing] of [['below the picture', [48, 200]], ['far above it', [48, -900]], ['in it', [48, 40]], ['beside its middle', [47.5, 63.2]]]) {
    test(`looking down or up, the vertical vanishing ${name}`, () => {
        const [vx, vy] = vanishing, round = vy > 0 && vy < HEIGHT;
        // What stands upright runs along the lines: a tower that leans outward, over a terrain that ends.
        const distance = (x, y) => Math.hypot(x + 0.5 - vx, y + 0.5 - vy), angle = (x, y) => Math.atan2(y + 0.5 - vy, x + 0.5 - vx);
        const base = round ? 22 : distance(48, 34), sign = round || vy > 0 ? 1 : -1;
        const tower = (x, y) => Math.abs(angle(x, y) - angle(62, 20)) < 4 / distance(62, 20);
        const land = (x, y) => sign * distance(x, y) < sign * base + (tower(x, y) ? 12 : 0);
        assert.equal(gaps(land, vanishing), 0);
        const holed = (x, y) => land(x, y) && !(x === 52 && y === (vy > 0 ? 45 : 50));
        assert.ok(gaps(holed, vanishing) >= 1, 'a pixel');
        const slit = (x, y) => land(x, y) && !(Math.abs(x - 44) < 0.6 && y > 42 && y < 58);
        assert.ok(gaps(slit, vanishing) >= 10, 'a slit');
    });
}

test('a PNG with every filter is read', () => {
    const width = 5, rows = [0, 1, 2, 3, 4].map(filter => [filter, ...Array.from({length: 3 * width}, (_, i) => (37 * i + 11 * filter) & 255)]);
    const chunk = (name, bytes) => {
        const head = Buffer.alloc(8);
        head.writeUInt32BE(bytes.length);
        head.write(name, 4, 'latin1');
        return Buffer.concat([head, bytes, Buffer.alloc(4)]);
    };
    const header = Buffer.alloc(13);
    header.writeUInt32BE(width, 0);
    header.writeUInt32BE(5, 4);
    header.set([8, 2, 0, 0, 0], 8);
    const picture = decodePng(Buffer.concat([Buffer.alloc(8), chunk('IHDR', header), chunk('IDAT', deflateSync(Buffer.from(rows.flat())))]));
    const row = y => Array.from({length: 3 * width}, (_, i) => picture.rgba[4 * (y * width + Math.floor(i / 3)) + (i % 3)]);
    assert.deepEqual(row(0), rows[0].slice(1));
    const sums = rows[1].slice(1);
    for (let i = 3; i < sums.length; i++) sums[i] = (sums[i] + sums[i - 3]) & 255;
    assert.deepEqual(row(1), sums);
    assert.deepEqual(row(2), rows[2].slice(1).map((v, i) => (v + sums[i]) & 255));
    const third = rows[3].slice(1);
    for (let i = 0; i < third.length; i++) third[i] = (third[i] + (((i < 3 ? 0 : third[i - 3]) + row(2)[i]) >> 1)) & 255;
    assert.deepEqual(row(3), third);
    assert.equal(row(4)[0], (rows[4][1] + third[0]) & 255);
});
