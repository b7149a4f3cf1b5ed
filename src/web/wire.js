/**
 * wire.js - meshes in wire format, RQTW (src/core/FORMAT.md, "Wire"), back into arrays: the mesh that the C decoder
 * gives, to the last bit, with its vertices and triangles in the same order.
 *
 * This file knows the header and what is around the walk (wire_walk.js): frames, normals, errors (wire_errors.js), and
 * the digest by which an increment knows the mesh that it begins from. Bytes are believed when magic, version, lengths,
 * counts and checksum have been seen to fit; what does not fit ends in an Error with a sentence.
 */
import {checksumIsRight, Fold} from './checksum.js';
import {readFrame} from './header.js';
import {SampleTable} from './sample_table.js';
import {isErrorSize, readErrors} from './wire_errors.js';
import {slackOf, Walk} from './wire_walk.js';
import {frameOf, inflate} from './zstd.js';

const HEADER_BYTES = 144;
const KIND_MESH = 1, KIND_DELTA = 2;
const FLAG_NORMALS = 1, FLAG_ERRORS = 2;
const MOST_SAMPLES = 2 ** 20 + 1, MOST_BLOCK_K = 8, MOST_COUNT = 2 ** 31;
const BLOCK_OF_ZSTD = 2 ** 17, LEAST_BLOCK = 4; // no zstd block of 4 bytes stands for more

/**
 * A mesh. Vertex i is the sample (col[i], row[i]) with the height q[i] (header.js: metresOf); triangle t has the corners
 * triangles[3t .. 3t+2], counter-clockwise seen from above. All fields of the header have their names in FORMAT.md.
 * @typedef {Object} Mesh
 * @property {'mesh'} kind
 * @property {number} k       block size of the terrain; K: its root square has (2^K + 1)^2 samples
 * @property {number} K
 * @property {number} width   samples of the raster
 * @property {number} height
 * @property {number} x0      and y0, dx, dy, z0, d, numerator, denominator, srid, scale, offset, eps: header.js
 * @property {number} vertexCount
 * @property {number} triangleCount
 * @property {Int32Array} col
 * @property {Int32Array} row
 * @property {Int32Array} q
 * @property {Uint32Array} triangles
 * @property {Int8Array|null} normals  two a vertex, as sent (normalOf); null when none were
 * @property {Float64Array|null} errors  metres, one a vertex; null when none were sent
 * @property {Int32Array|null} leaves  x and y on the lattice of apex, left and right of each triangle; only on request
 */

/**
 * The header of a mesh or an increment in wire format, with all frames found.
 * @param {Uint8Array} bytes
 */
function readHeader(bytes) {
    if (bytes.length < HEADER_BYTES) throw new Error('not a mesh in wire format: it is too short');
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    if (view.getUint32(0, true) !== 0x57545152) throw new Error('not a mesh in wire format: it does not begin with RQTW');
    const version = bytes[4], kind = bytes[5], k = bytes[6], flags = bytes[7];
    if (version !== 1) throw new Error('a mesh of unknown format version');
    if (kind !== KIND_MESH && kind !== KIND_DELTA) throw new Error('the mesh is neither whole nor an increment');
    if (flags > (FLAG_NORMALS | FLAG_ERRORS) || flags && kind !== KIND_MESH)
        throw new Error('the mesh has parts that this version does not know');
    if (!checksumIsRight(bytes, 8)) throw new Error("the mesh's checksum is wrong: its bytes have changed");
    const width = view.getUint32(112, true), height = view.getUint32(116, true);
    const longest = Math.max(width, height);
    const K = longest > 1 ? 32 - Math.clz32(longest - 2) : 0;
    if (width < 1 || height < 1 || longest > MOST_SAMPLES || k > K || k > MOST_BLOCK_K)
        throw new Error("the mesh's raster has an impossible size");
    const frame = readFrame(view, 32);
    if (!frame) throw new Error("the mesh's placement, unit of height or eps is not one");
    const epsFrom = view.getFloat64(128, true), from = {low: view.getUint32(136, true), high: view.getUint32(140, true)};
    const isDelta = kind === KIND_DELTA;
    if (isDelta ? !(epsFrom >= frame.eps) : epsFrom !== 0 || from.low !== 0 || from.high !== 0)
        throw new Error("the mesh's eps is not one");
    const number = (at) => view.getUint32(at, true) + view.getUint32(at + 4, true) * 2 ** 32;
    const vertexCount = number(16), triangleCount = number(24), payload = number(120);
    if (vertexCount >= MOST_COUNT || triangleCount >= MOST_COUNT)
        throw new Error('the mesh has more vertices or triangles than indices reach');
    const parts = readParts(bytes, [(content) => content === payload, flags & FLAG_NORMALS && ((content) => content === 2 * vertexCount),
        flags & FLAG_ERRORS && ((content) => isErrorSize(content, vertexCount))]);
    return {kind: 'mesh', k, K, width, height, ...frame, vertexCount, triangleCount, isDelta, epsFrom, from, payload, parts};
}

/** The frames behind the header, each of a content of a size that its test likes; no test: there is none. Nothing follows. */
function readParts(bytes, tests) {
    const wrong = () => new Error("the mesh's compressed bytes are cut off, or not what follows its header");
    let at = HEADER_BYTES;
    const parts = tests.map((isRight) => {
        if (!isRight) return null;
        let part;
        try {
            part = frameOf(bytes, at);
        } catch {
            throw wrong();
        }
        const size = part.end - at;
        if (!isRight(part.content) || Math.floor(part.content / BLOCK_OF_ZSTD) > size / LEAST_BLOCK) throw wrong();
        at = part.end;
        return part;
    });
    if (at !== bytes.length) throw wrong();
    return parts;
}

/** Walks a payload; `state` is the mesh that an increment begins from. */
function decode(header, bytes, state, wantsLeaves) {
    const {vertexCount, triangleCount, isDelta, epsFrom, from, payload, parts, ...fields} = header;
    const known = state ? 3 * state.triangleCount : 0;
    if (vertexCount > payload + known || triangleCount > 2 * vertexCount)
        throw new Error('the mesh claims more vertices or triangles than its bytes can hold');
    const walk = new Walk(header, inflate(bytes, parts[0], slackOf(header.k)), payload, wantsLeaves, state && priorOf(state));
    walk.run();
    const mesh = {
        ...fields, vertexCount, triangleCount,
        col: walk.col.slice(0, vertexCount), row: walk.row.slice(0, vertexCount), q: walk.heights.slice(0, vertexCount),
        triangles: new Uint32Array(walk.triangles.slice(0, 3 * triangleCount).buffer),
        normals: parts[1] ? readNormals(inflate(bytes, parts[1]), vertexCount) : null,
        errors: null,
        leaves: walk.leaves && walk.leaves.slice(0, 6 * triangleCount),
    };
    if (parts[2]) mesh.errors = readErrors(inflate(bytes, parts[2]), mesh);
    return mesh;
}

/** Two signed bytes of each vertex out of two planes of differences. */
function readNormals(planes, count) {
    const normals = new Int8Array(2 * count);
    for (let plane = 0; plane < 2; plane++)
        for (let i = 0, at = 0; i < count; i++) {
            at += planes[plane * count + i];
            normals[2 * i + plane] = at;
            if ((at & 255) === 128) throw new Error("the mesh's normals are none");
        }
    return normals;
}

/**
 * The unit vector of a normal as a mesh keeps it: x east, y north, z up.
 * @param {number} first  and second: the two of the vertex
 * @param {number} second
 * @returns {[number, number, number]}
 */
export function normalOf(first, second) {
    const u = first / 127, v = second / 127, x = (u + v) / 2, y = (u - v) / 2;
    const z = 1 - Math.max(Math.abs(u), Math.abs(v)), length = Math.sqrt(x * x + y * y + z * z);
    return [x / length, y / length, z / length];
}

/**
 * Bytes of rqt_mesh(..., 'rqt'), or of the service with f=rqt.
 * @param {Uint8Array} bytes
 * @param {{leaves?: boolean}} [wants]  leaves: needed to apply increments of rqt_delta
 * @returns {Mesh}
 * @throws {Error} a sentence about what is wrong with the bytes
 */
export function decodeMesh(bytes, wants = {}) {
    const header = readHeader(bytes);
    if (header.isDelta) throw new Error('these bytes are an increment: apply them to the mesh that they begin from');
    return decode(header, bytes, null, Boolean(wants.leaves));
}

/**
 * Bytes of rqt_delta on the mesh that they begin from, which was decoded with its leaves.
 * @param {Mesh} mesh
 * @param {Uint8Array} bytes
 * @returns {Mesh} another one, with its leaves; `mesh` stays as it is
 */
export function applyDelta(mesh, bytes) {
    const header = readHeader(bytes);
    if (!header.isDelta) throw new Error('these bytes are a whole mesh, not an increment');
    if (!mesh.leaves) throw new Error('the mesh to refine was decoded without its leaves');
    const differs = (...names) => names.some((name) => !Object.is(mesh[name], header[name]));
    if (differs('width', 'height', 'k', 'srid', 'x0', 'y0', 'dx', 'dy')) throw new Error('the increment is one of another terrain');
    if (differs('z0', 'd', 'numerator', 'denominator', 'scale', 'offset'))
        throw new Error('the increment has heights in another unit');
    if (!Object.is(mesh.eps, header.epsFrom)) throw new Error('the increment begins from another eps');
    const digest = digestOf(mesh);
    if (digest.low !== header.from.low || digest.high !== header.from.high)
        throw new Error('the increment begins from the mesh of another region or other data');
    return decode(header, bytes, mesh, true);
}

/** Lattice vertices of a mesh with their heights (index 1), and their samples where these are none (index 0). */
function priorOf(mesh) {
    const prior = new SampleTable(mesh.vertexCount);
    forCorners(mesh, (i, x, y) => {
        const e = prior.find(x, y);
        if (e < 0) prior.add(x, y, mesh.q[i], 1);
        else prior.index[e] = 1;
        if (prior.find(mesh.col[i], mesh.row[i]) < 0) prior.add(mesh.col[i], mesh.row[i], mesh.q[i], 0);
    });
    return prior;
}

/** Calls what(vertex, x, y) for each corner of each leaf: apex, left, right. */
function forCorners({leaves, triangles, triangleCount, col, row, width, height}, what) {
    for (let t = 0; t < triangleCount; t++)
        for (let c = 0; c < 3; c++) {
            const x = leaves[6 * t + 2 * c], y = leaves[6 * t + 2 * c + 1];
            const sampleX = Math.min(x, width - 1), sampleY = Math.min(y, height - 1);
            for (let i = 0; i < 3; i++) {
                const v = triangles[3 * t + i];
                if (col[v] !== sampleX || row[v] !== sampleY) continue;
                what(v, x, y);
                break;
            }
        }
}

/** rqt_wire_digest: of col, row, q and level of each vertex, and apex and left of each leaf. */
function digestOf(mesh) {
    const {K, vertexCount, triangleCount, col, row, q, leaves} = mesh;
    const level = new Uint8Array(vertexCount).fill(K);
    forCorners(mesh, (v, x, y) => {
        const both = x | y;
        level[v] = Math.min(level[v], both === 0 ? 0 : K - (31 - Math.clz32(both & -both)));
    });
    const fold = new Fold(vertexCount);
    for (let i = 0; i < vertexCount; i++) {
        fold.add(row[i], col[i]);
        fold.add(level[i], q[i]);
    }
    for (let t = 0; t < triangleCount; t++) {
        fold.add(leaves[6 * t + 1], leaves[6 * t]);
        fold.add(leaves[6 * t + 3], leaves[6 * t + 2]);
    }
    return fold.end();
}

