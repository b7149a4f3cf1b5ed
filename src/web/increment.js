/**
 * increment.js - increments of views, RQTI (src/core/FORMAT.md, "View increment"): what turns the mesh of one camera
 * into that of the next.
 *
 * Both ends number meshes in one order (order.js), so what goes is named by its number, and what stays keeps its
 * order. A digest tells whether the mesh at hand is the one that the increment begins from, another whether what comes
 * out is what the sender has; so an error anywhere ends in an Error, never in another mesh.
 */
import {checksumIsRight, Fold} from './checksum.js';
import {FRAME_BYTES, readFrame} from './header.js';
import {codeOf, compareTriangles, sampleOf, sortMesh} from './order.js';
import {frameOf, inflate} from './zstd.js';

const HEADER_BYTES = 48, FLAG_FRAME = 1;
const BLOCK_OF_ZSTD = 2 ** 17, LEAST_BLOCK = 4;
const HEIGHT_LIMIT = 2 ** 30, LAST_SAMPLE = 2 ** 20;
const GONE = 2 ** 32 - 1;
const LEAST_VERTEX = 2, LEAST_TRIANGLE = 3; // bytes of what comes

const NOTHING = {kind: 'mesh', isSorted: true, vertexCount: 0, triangleCount: 0, col: new Int32Array(0), row: new Int32Array(0),
    q: new Int32Array(0), triangles: new Uint32Array(0), normals: null, errors: null, leaves: null};

function astray() {
    throw new Error('the increment does not lead to the mesh that it promises');
}

/** Numbers of a payload, LEB128. */
class Numbers {
    constructor(bytes) {
        this.bytes = bytes;
        this.at = 0;
    }

    next() {
        let v = 0;
        for (let scale = 1; scale < 2 ** 49; scale *= 128) {
            if (this.at >= this.bytes.length) astray();
            const byte = this.bytes[this.at++];
            v += (byte & 127) * scale;
            if (byte < 128) return v;
        }
        return astray();
    }

    nextSigned() {
        const v = this.next();
        return v % 2 === 0 ? v / 2 : -(v + 1) / 2;
    }

    /** A number above the one before, by what is there and 1; at most `most`. */
    nextAfter(before, most) {
        const v = before + 1 + this.next();
        if (v > most) astray();
        return v;
    }
}

function readHeader(bytes) {
    if (bytes.length < HEADER_BYTES) throw new Error('not an increment of a view: it is too short');
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    const number = (at) => view.getUint32(at, true);
    if (number(0) !== 0x49545152) throw new Error('not an increment of a view: it does not begin with RQTI');
    if (bytes[4] !== 1) throw new Error('an increment of unknown format version');
    if (bytes[5] > FLAG_FRAME || bytes[6] || bytes[7]) throw new Error('the increment has parts that this version does not know');
    if (!checksumIsRight(bytes, 8)) throw new Error("the increment's checksum is wrong: its bytes have changed");
    const header = {
        from: {low: number(16), high: number(20)}, to: {low: number(24), high: number(28)},
        vertexCount: number(32), triangleCount: number(36), payload: number(44), frame: {},
    };
    let at = HEADER_BYTES;
    if (bytes[5] & FLAG_FRAME) {
        if (at + FRAME_BYTES > bytes.length) throw new Error('the increment is cut off');
        header.frame = readFrame(view, at);
        if (!header.frame) throw new Error("the increment's placement, unit or tolerance is not one");
        at += FRAME_BYTES;
    }
    const end = at + number(40);
    if (end > bytes.length) throw new Error('the increment is cut off');
    header.note = new TextDecoder().decode(bytes.subarray(at, end));
    header.part = partAt(bytes, end, header);
    return header;
}

/** The frame of the payload; null when nothing changes. */
function partAt(bytes, at, {payload, from, to}) {
    const wrong = () => new Error("the increment's compressed bytes are not what its header says");
    const size = bytes.length - at;
    if (payload === 0) {
        if (size !== 0 || !isSame(from, to)) throw wrong();
        return null;
    }
    let part;
    try {
        part = frameOf(bytes, at);
    } catch {
        throw wrong();
    }
    if (part.end !== bytes.length || part.content !== payload || Math.floor(payload / BLOCK_OF_ZSTD) > size / LEAST_BLOCK) throw wrong();
    return part;
}

function isSame(a, b) {
    return a.low === b.low && a.high === b.high;
}

/** rqt_increment_digest of a sorted mesh. */
function digestOf({vertexCount, triangleCount, col, row, q, triangles}) {
    const fold = new Fold(vertexCount);
    for (let i = 0; i < vertexCount; i++) {
        fold.add(row[i], col[i]);
        fold.add(0, q[i]);
    }
    for (let t = 0; t < 3 * triangleCount; t += 3) {
        fold.add(triangles[t + 1], triangles[t]);
        fold.add(1, triangles[t + 2]);
    }
    return fold.end();
}

/**
 * The mesh that an increment makes of the one before.
 * @param {import('./wire.js').Mesh|null} mesh  of the view before, from here or from decodeMesh; null: from nothing
 * @param {Uint8Array} bytes  of the service with f=increment, or rqt_view_mesh(..., 'increment', ...)
 * @returns {{mesh: import('./wire.js').Mesh, note: string}} the mesh, in the order of order.js; the note is the next token.
 *     The fields of the header are those of `mesh`; without one those that an increment has: k, K, width and height are missing.
 * @throws {Error} a sentence about what is wrong; `mesh` stays as it is
 */
export function applyIncrement(mesh, bytes) {
    const header = readHeader(bytes);
    const old = mesh === null ? NOTHING : mesh.isSorted ? mesh : sortMesh(mesh);
    if (!isSame(digestOf(old), header.from)) throw new Error('the increment belongs to another mesh than this one');
    const {vertexCount, triangleCount} = header;
    const parts = header.part ? merge(old, inflate(bytes, header.part), vertexCount, triangleCount) : {};
    const next = {...old, ...header.frame, ...parts};
    if (next.vertexCount !== vertexCount || next.triangleCount !== triangleCount || !isSame(digestOf(next), header.to)) astray();
    return {mesh: next, note: header.note};
}

function merge(old, payload, vertexMost, triangleMost) {
    const numbers = new Numbers(payload);
    const gone = numbers.next(), come = numbers.next(), goneTriangles = numbers.next(), comeTriangles = numbers.next();
    const left = payload.length - numbers.at;
    if (gone > old.vertexCount || goneTriangles > old.triangleCount || come > left / LEAST_VERTEX || comeTriangles > left / LEAST_TRIANGLE ||
        old.vertexCount - gone + come !== vertexMost || triangleMost > old.triangleCount - goneTriangles + comeTriangles) astray();
    const number = new Uint32Array(old.vertexCount);
    for (let i = 0, at = -1; i < gone; i++) number[at = numbers.nextAfter(at, old.vertexCount - 1)] = GONE;
    const vertices = mergeVertices(old, numbers, come, number, vertexMost);
    const goes = new Uint8Array(old.triangleCount);
    for (let i = 0, at = -1; i < goneTriangles; i++) goes[at = numbers.nextAfter(at, old.triangleCount - 1)] = 1;
    const triangles = mergeTriangles(old, numbers, comeTriangles, number, goes, vertexMost, triangleMost);
    if (numbers.at !== payload.length) astray();
    return {vertexCount: vertexMost, triangleCount: triangleMost, ...vertices, triangles, normals: null, errors: null, leaves: null};
}

/** The vertices of the new mesh; afterwards number[i] is the new number of an old one that stays. */
function mergeVertices(old, numbers, come, number, count) {
    const codes = new Float64Array(come), last = codeOf(LAST_SAMPLE, LAST_SAMPLE);
    for (let i = 0, at = -1; i < come; i++) codes[i] = at = numbers.nextAfter(at, last);
    const col = new Int32Array(count), row = new Int32Array(count), q = new Int32Array(count);
    for (let i = 0, k = 0, n = 0, before = 0; n < count; n++) {
        while (i < old.vertexCount && number[i] === GONE) i++;
        const code = i < old.vertexCount ? codeOf(old.col[i], old.row[i]) : Infinity;
        if (k < come && codes[k] <= code) { // heights go by the vertex before, in the new order
            const height = before + numbers.nextSigned();
            [col[n], row[n]] = sampleOf(codes[k]);
            if (codes[k] === code || Math.abs(height) >= HEIGHT_LIMIT || col[n] > LAST_SAMPLE || row[n] > LAST_SAMPLE) astray();
            q[n] = height;
            k++;
        } else {
            if (i >= old.vertexCount) astray();
            col[n] = old.col[i];
            row[n] = old.row[i];
            q[n] = old.q[i];
            number[i++] = n;
        }
        before = q[n];
    }
    return {col, row, q};
}

function mergeTriangles(old, numbers, come, number, goes, vertexCount, count) {
    const triangles = new Uint32Array(3 * count), next = new Float64Array(3), now = new Uint32Array(3), most = vertexCount - 1;
    const read = () => {
        next[0] += numbers.next();
        next[1] = next[0] + numbers.nextSigned();
        next[2] = next[0] + numbers.nextSigned();
        if (next.some((v) => v < 0 || v > most)) astray();
    };
    if (come > 0) read();
    let n = 0;
    for (let t = 0; t < old.triangleCount || come > 0;) {
        if (t < old.triangleCount) {
            for (let c = 0; c < 3; c++) now[c] = number[old.triangles[3 * t + c]];
            if (goes[t] || now[0] === GONE || now[1] === GONE || now[2] === GONE) {
                t++;
                continue;
            }
        }
        if (n === count) astray();
        const stays = t < old.triangleCount && (come === 0 || compareTriangles(now, 0, next, 0) < 0);
        triangles.set(stays ? now : next, 3 * n);
        if (n > 0 && compareTriangles(triangles, n - 1, triangles, n) >= 0) astray();
        n++;
        if (stays) t++;
        else if (--come > 0) read();
    }
    if (n !== count) astray();
    return triangles;
}
