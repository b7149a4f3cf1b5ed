// oracle.mjs - what the tests of src/web's modules are held against: meshes that SQL gives (meshes.py), and the C
// decoder's reading of any bytes (decode.c).
import {spawnSync} from 'node:child_process';
import {mkdtempSync, readFileSync, rmSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {dirname, join, resolve} from 'node:path';
import {fileURLToPath} from 'node:url';
import {Fold} from '../../src/web/checksum.js';

const HERE = dirname(fileURLToPath(import.meta.url)), ROOT = join(HERE, '..', '..');
const BUILD = resolve(ROOT, process.env.BUILD || 'build');

function run(command, args, input) {
    const done = spawnSync(command, args, {input, maxBuffer: 2 ** 30, cwd: ROOT});
    if (done.error) throw done.error;
    if (done.status !== 0) throw new Error(`${command} ${args.join(' ')}: ${done.status} ${done.signal} ${done.stderr}`);
    return done.stdout;
}

/**
 * The records of `meshes.py WHAT`.
 * @returns {{what: string, name: string, bytes: Uint8Array}[]}
 */
export function recordsOf(what) {
    const directory = mkdtempSync(join(tmpdir(), 'rqt_web_')), path = join(directory, 'records'), records = [];
    try {
        run('/usr/bin/python3', [join(HERE, 'meshes.py'), path, what]);
        const all = readFileSync(path);
        for (let at = 0; at < all.length;) {
            const name = all.readUInt32LE(at + 1), size = all.readUInt32LE(at + 5), begin = at + 9 + name;
            records.push({what: String.fromCharCode(all[at]), name: all.toString('utf8', at + 9, begin), bytes: new Uint8Array(all.subarray(begin, begin + size))});
            at = begin + size;
        }
    } finally {
        rmSync(directory, {recursive: true});
    }
    return records;
}

let isMade = false;

/**
 * What the C decoder makes of records: for each a mesh, of a frame its content, or null where it says no. '0' forgets the mesh before, and has no answer.
 * @param {{what: string, bytes?: Uint8Array}[]} records
 */
export function decodeInC(records) {
    isMade ||= Boolean(run('make', ['-s', `BUILD=${BUILD}`, join(BUILD, 'tests', 'web', 'decode')]));
    const input = [];
    for (const {what, bytes = new Uint8Array(0)} of records) {
        const head = Buffer.alloc(5);
        head.write(what, 0, 'latin1');
        head.writeUInt32LE(bytes.length, 1);
        input.push(head, bytes);
    }
    const answers = run(join(BUILD, 'tests', 'web', 'decode'), [], Buffer.concat(input));
    let at = 0;
    const number = () => answers.readUInt32LE((at += 4) - 4);
    const numbers = (type, count) => {
        const bytes = Uint8Array.prototype.slice.call(answers, at, at += count * type.BYTES_PER_ELEMENT);
        return new type(bytes.buffer, bytes.byteOffset, count);
    };
    const found = records.filter(({what}) => what !== '0').map(({what}) => {
        if (number() !== 0) return null;
        if (what === 'Z') return numbers(Uint8Array, number());
        const vertexCount = number(), triangleCount = number();
        const mesh = {vertexCount, triangleCount, col: numbers(Int32Array, vertexCount), row: numbers(Int32Array, vertexCount),
            q: numbers(Int32Array, vertexCount), triangles: numbers(Uint32Array, 3 * triangleCount)};
        mesh.errors = number() ? numbers(Float64Array, vertexCount) : null;
        mesh.normals = number() ? numbers(Float32Array, 3 * vertexCount) : null;
        return mesh;
    });
    if (at !== answers.length) throw new Error('the C decoder said more than was asked');
    return found;
}

/** A small generator of random numbers, the same on every machine; RQT_SEED begins another row of them. */
export class Dice {
    constructor(seed) {
        this.seed = Number(process.env.RQT_SEED || seed) >>> 0;
        this.state = this.seed;
    }

    /** 0 <= number < n */
    below(n) {
        this.state = this.state + 0x9E3779B9 >>> 0;
        let h = Math.imul(this.state ^ this.state >>> 16, 0x85EBCA6B);
        h = Math.imul(h ^ h >>> 13, 0xC2B2AE35);
        return Math.floor(((h ^ h >>> 16) >>> 0) / 2 ** 32 * n);
    }
}

/** Sets the checksum at offset 8, so that a change is not found by it. */
export function sign(bytes) {
    bytes.fill(0, 8, 16);
    const fold = new Fold(bytes.length), padded = new DataView(new ArrayBuffer(bytes.length + 8));
    new Uint8Array(padded.buffer).set(bytes);
    for (let i = 0; i < bytes.length; i += 8) fold.add(padded.getUint32(i + 4, true), padded.getUint32(i, true));
    const {high, low} = fold.end(), view = new DataView(bytes.buffer, bytes.byteOffset);
    view.setUint32(8, low, true);
    view.setUint32(12, high, true);
    return bytes;
}

/** Are two arrays of numbers equal? Quicker, and of fewer words where they are not, than a deep comparison. */
export function isSame(a, b) {
    if (a === null || b === null || a.length !== b.length) return a === b;
    for (let i = 0; i < a.length; i++) if (a[i] !== b[i]) return false;
    return true;
}
