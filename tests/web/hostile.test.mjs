// hostile.test.mjs - bytes that nobody has written on purpose, or somebody has: src/web's decoders say no with a sentence, or
// give what the C decoder gives. They take no more memory than the bytes are worth. (That they end is seen by the tests' end.)
import assert from 'node:assert/strict';
import {test} from 'node:test';
import {applyIncrement} from '../../src/web/increment.js';
import {decodeMesh} from '../../src/web/wire.js';
import {frameOf, inflate} from '../../src/web/zstd.js';
import {decodeInC, Dice, isSame, recordsOf, sign} from './oracle.mjs';

Error.stackTraceLimit = 2; // they are made by the thousand

const dice = new Dice(20261126);
console.log(`RQT_SEED=${dice.seed}`);

const records = recordsOf('small'), meshes = records.filter(({what}) => what === 'M').map(({bytes}) => bytes);
const frames = recordsOf('zstd');

/** Bytes of typed arrays made while `what` runs. */
function memoryOf(what) {
    const types = ['Uint8Array', 'Int8Array', 'Uint16Array', 'Int32Array', 'Uint32Array', 'Float64Array'], own = types.map((name) => globalThis[name]);
    let taken = 0;
    types.forEach((name, i) => {
        globalThis[name] = new Proxy(own[i], {construct(type, given, as) {
            if (typeof given[0] === 'number') taken += given[0] * type.BYTES_PER_ELEMENT;
            return Reflect.construct(type, given, as === globalThis[name] ? type : as);
        }});
    });
    try {
        what();
    } finally {
        types.forEach((name, i) => { globalThis[name] = own[i]; });
    }
    return taken;
}

/** A zstd frame of raw blocks. */
function wrap(plain) {
    const parts = [Uint8Array.of(0x28, 0xB5, 0x2F, 0xFD, 0xA0, plain.length, plain.length >> 8, plain.length >> 16, 0)];
    for (let at = 0; at < plain.length || at === 0; at += 1 << 17) {
        const piece = plain.subarray(at, at + (1 << 17)), head = piece.length << 3 | (at + (1 << 17) >= plain.length ? 1 : 0);
        parts.push(Uint8Array.of(head, head >> 8, head >> 16), piece);
    }
    return new Uint8Array(Buffer.concat(parts));
}

/** Some bytes changed, put in, left out, or the end cut off; from `from` on. */
function change(bytes, from = 0) {
    let out = Uint8Array.from(bytes);
    const at = () => from + dice.below(Math.max(1, out.length - from));
    for (let n = 1 + dice.below(3); n > 0; n--)
        switch (dice.below(7)) {
        case 0: out = out.slice(0, at()); break;
        case 1: out[at()] ^= 1 << dice.below(8); break;
        case 2: out[at()] = [0, 1, 127, 128, 255][dice.below(5)]; break;
        case 3: out.fill(dice.below(256), at(), at()); break;
        case 4: out.copyWithin(at(), at(), at()); break;
        case 5: {
            const p = at();
            out = new Uint8Array(Buffer.concat([out.subarray(0, p), Uint8Array.of(dice.below(256)), out.subarray(p)]));
            break;
        }
        default: out[at()] = dice.below(256);
        }
    return out;
}

/** A mesh with something wrong in its header, its frames or its payload, and a checksum that is right but for a few. */
function spoil(bytes) {
    const way = dice.below(10);
    if (way === 0) return change(bytes);
    if (bytes.length < 160) return sign(change(bytes, 16));
    if (way < 3) return sign(Uint8Array.from(bytes, (b, i) => i > 3 && i < 144 && dice.below(60) === 0 ? dice.below(2) ? dice.below(256) : 0 : b));
    if (way < 6) return sign(change(bytes, 144));
    const frame = frameOf(bytes, 144), plain = change(inflate(bytes, frame));
    const out = new Uint8Array(Buffer.concat([bytes.subarray(0, 144), wrap(plain), bytes.subarray(frame.end)]));
    new DataView(out.buffer).setUint32(120, plain.length, true);
    return sign(out);
}

/**
 * libzstd does not look where some Huffman streams end (1.5.4: its fast loops for four of them, and the last symbol of codes
 * for two letters), so it takes a few damaged frames that zstd.js does not. All else is the same.
 */
const DAMAGED = 'the compressed bytes are not a zstd frame, or damaged';

/** The mesh, or the sentence of the Error. */
function attempt(what) {
    try {
        return what();
    } catch (error) {
        assert.ok(error.constructor === Error && /^[a-z][^\n]{20,}$/.test(error.message), `${error.stack}`);
        return error.message;
    }
}

test('20,000 spoiled meshes: what the C decoder takes comes out the same, and nothing else comes out', () => {
    let taken = 0, stricter = 0;
    const sentences = new Map();
    for (let round = 0; round < 4; round++) {
        const cases = Array.from({length: 5000}, () => spoil(meshes[dice.below(meshes.length)]));
        const expected = decodeInC(cases.flatMap((bytes) => [{what: '0'}, {what: 'M', bytes}]));
        cases.forEach((bytes, i) => {
            const mesh = attempt(() => decodeMesh(bytes)), where = () => `round ${round}, case ${i}: ${Buffer.from(bytes).toString('base64')}`;
            if (typeof mesh === 'string') {
                sentences.set(mesh, (sentences.get(mesh) || 0) + 1);
                if (mesh === DAMAGED) stricter += expected[i] !== null;
                else assert.equal(expected[i], null, `${mesh}: ${where()}`);
                return;
            }
            assert.ok(expected[i], where());
            for (const name of ['vertexCount', 'triangleCount']) assert.equal(mesh[name], expected[i][name], where());
            for (const name of ['col', 'row', 'q', 'triangles', 'errors']) assert.ok(isSame(mesh[name], expected[i][name]), where());
            taken++;
        });
    }
    console.log(`${taken} taken; ${stricter} by the C decoder alone; ${[...sentences].map(([sentence, count]) => `${count} ${sentence}`).join('; ')}`);
    assert.ok(taken > 100 && sentences.size > 8 && stricter < 40);
});

test('a mesh takes no more memory than its bytes are worth, whatever its header claims', () => {
    for (let i = 0; i < 1000; i++) {
        const bytes = spoil(meshes[dice.below(meshes.length)]);
        const taken = memoryOf(() => attempt(() => decodeMesh(bytes)));
        assert.ok(taken < 2 ** 25, `${taken} bytes for ${Buffer.from(bytes).toString('base64')}`);
    }
    // Counts that no payload can hold, and a payload that no frame can stand for.
    const bytes = Uint8Array.from(meshes.find((mesh) => mesh.length > 400)), view = new DataView(bytes.buffer);
    for (const [offset, value] of [[16, 2 ** 31 - 1], [24, 2 ** 31 - 1], [120, 2 ** 31], [124, 1], [112, 2 ** 20], [20, 5]]) {
        const before = view.getUint32(offset, true);
        view.setUint32(offset, value, true);
        assert.ok(memoryOf(() => assert.equal(typeof attempt(() => decodeMesh(sign(bytes))), 'string')) < 2 ** 24, offset);
        view.setUint32(offset, before, true);
    }
});

test('every truncation of a mesh is refused', () => {
    for (const bytes of meshes.filter((_, i) => i % 9 === 0))
        for (let size = 0; size < bytes.length; size += size < 200 ? 1 : 7) {
            const cut = bytes.slice(0, size);
            assert.equal(typeof attempt(() => decodeMesh(size < 16 ? cut : sign(cut))), 'string', size);
        }
});

test('frames of libzstd come out as what went in', () => {
    for (let i = 0; i < frames.length; i += 2) {
        const {name, bytes} = frames[i], frame = frameOf(bytes, 0);
        assert.deepEqual([frame.end, frame.content], [bytes.length, frames[i + 1].bytes.length], name);
        assert.ok(isSame(inflate(bytes, frame), frames[i + 1].bytes), name);
        const behind = new Uint8Array(Buffer.concat([Buffer.from('before'), bytes, Buffer.from('after')])), again = frameOf(behind, 6);
        assert.equal(again.end, 6 + bytes.length, name);
        assert.ok(isSame(inflate(behind, again, 3), new Uint8Array(Buffer.concat([frames[i + 1].bytes, Buffer.alloc(3)]))), name);
    }
});

test('2000 spoiled frames: what libzstd takes comes out the same, and nothing else comes out', () => {
    const small = frames.filter(({what, bytes}) => what === 'Z' && bytes.length < 6000);
    const cases = Array.from({length: 2000}, () => change(small[dice.below(small.length)].bytes, dice.below(3) ? 9 : 0));
    const expected = decodeInC(cases.map((bytes) => ({what: 'Z', bytes})));
    let taken = 0, stricter = 0;
    cases.forEach((bytes, i) => {
        const plain = attempt(() => {
            const frame = frameOf(bytes, 0);
            if (frame.end !== bytes.length) throw new Error('something follows the frame, or it is cut off');
            return inflate(bytes, frame);
        });
        const where = () => `case ${i}: ${plain} ${Buffer.from(bytes).toString('base64').slice(0, 2000)}`;
        if (typeof plain !== 'string') assert.ok(isSame(plain, expected[i]), where());
        else if (plain === DAMAGED) stricter += expected[i] !== null;
        else assert.equal(expected[i], null, where());
        taken += typeof plain !== 'string';
    });
    console.log(`${taken} taken; ${stricter} by libzstd alone`);
    assert.ok(taken > 50 && stricter < 40, `${taken} ${stricter}`);
});

test('24 bytes that stand for matches of 4 GB are refused at once', () => {
    // One literal; 32,000 sequences by tables of one symbol each: a match of 65,539 to 131,074 bytes, no literals, the offset before.
    const block = Uint8Array.of(0x08, 0x61, 0xFF, 0x00, 0x00, 0x54, 0x00, 0x00, 0x34, 0xFF, 0xFF, 0x01), head = block.length << 3 | 2 << 1 | 1;
    const bytes = Uint8Array.of(0x28, 0xB5, 0x2F, 0xFD, 0xA0, 0x00, 0x00, 0x02, 0x00, head, head >> 8, head >> 16, ...block);
    const frame = frameOf(bytes, 0);
    assert.equal(frame.content, 1 << 17);
    assert.throws(() => inflate(bytes, frame), /not a zstd frame, or damaged/);
    assert.equal(decodeInC([{what: 'Z', bytes}])[0], null);
});

test('1000 spoiled increments: the C decoder\'s answer', () => {
    const first = records.filter(({what}) => what === 'I');
    const cases = Array.from({length: 1000}, () => {
        const {bytes} = first[dice.below(first.length)], way = dice.below(4), at = 48 + 80 + new DataView(bytes.buffer, bytes.byteOffset).getUint32(40, true);
        if (way === 0) return sign(change(bytes, 16));
        if (way === 1) return sign(change(bytes, at));
        const plain = change(inflate(bytes, frameOf(bytes, at))), out = new Uint8Array(Buffer.concat([bytes.subarray(0, at), wrap(plain)]));
        new DataView(out.buffer).setUint32(44, plain.length, true);
        return sign(out);
    });
    const expected = decodeInC(cases.flatMap((bytes) => [{what: '0'}, {what: 'I', bytes}]));
    let stricter = 0;
    cases.forEach((bytes, i) => {
        const found = attempt(() => applyIncrement(null, bytes).mesh), where = () => `case ${i}: ${found} ${Buffer.from(bytes).toString('base64')}`;
        if (found === DAMAGED) stricter += expected[i] !== null;
        else if (typeof found === 'string') assert.equal(expected[i], null, where());
        else for (const name of ['col', 'row', 'q', 'triangles']) assert.ok(isSame(found[name], expected[i][name]), where());
    });
    assert.ok(stricter < 20, stricter);
});
