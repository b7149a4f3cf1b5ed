/**
 * wire_errors.js - the errors of a mesh's vertices, which may stand behind it in wire format (src/core/FORMAT.md,
 * "Wire", Errors).
 *
 * An error is a code of 16 bits, whose order is that of the errors. Who has the mesh knows for most vertices by how much
 * the edge that a vertex halves misses it, and that its error is no smaller than those of the vertices that depend on
 * it: so vertices are settled from the finest to the coarsest, each hands its code on to its parents, and sent is what
 * the larger of the two falls short by.
 */
import {factorOf} from './header.js';
import {SampleTable} from './sample_table.js';

const CLASSES = 2 * 20 + 2;
const INFINITE = 65535;

const double = new Float64Array(1), halves = new Uint32Array(double.buffer);
const LOW = new Uint8Array(new Uint16Array([1]).buffer)[0] === 1 ? 0 : 1; // where the low half of a double is

/** The least code that is not below a number of metres, 0 only for 0. */
function codeAbove(v) {
    if (v === 0) return 0;
    double[0] = v;
    const high = halves[1 - LOW], isMore = (high & 0x1FFF) !== 0 || halves[LOW] !== 0;
    return Math.min(Math.max((high >>> 13) + (isMore ? 1 : 0) - 98176, 1), INFINITE - 1);
}

/** Metres of a code. */
export function metresOfCode(code) {
    return code === 0 ? 0 : code === INFINITE ? Infinity : (128 + (code & 127)) * 2 ** ((code >> 7) - 263);
}

/** May the errors of so many vertices take so many bytes? */
export function isErrorSize(content, vertexCount) {
    const more = content - headOf(vertexCount);
    return more >= 0 && more <= 2 * vertexCount && more % 2 === 0;
}

/** The least code, and a bit each vertex. */
function headOf(vertexCount) {
    return 2 + Math.ceil(vertexCount / 8);
}

function bad() {
    throw new Error("the mesh's errors are not one of each vertex");
}

/**
 * @param {Uint8Array} plain  the frame's content, of a size that isErrorSize likes
 * @param {import('./wire.js').Mesh} mesh
 * @returns {Float64Array} metres, one a vertex; Infinity where every mesh has the vertex
 */
export function readErrors(plain, mesh) {
    const {vertexCount, col, row, q, K} = mesh, side = 2 ** K, head = headOf(vertexCount), told = (plain.length - head) / 2;
    const least = plain[0] | plain[1] << 8, factor = Math.abs(factorOf(mesh)), parts = 2 * mesh.d;
    const table = new SampleTable(vertexCount), codes = new Uint16Array(vertexCount), errors = new Float64Array(vertexCount);
    const order = orderOf(mesh, table);
    let at = 0;
    for (let n = 0; n < vertexCount; n++) {
        const i = order[n], x = col[i], y = row[i];
        let code = Math.max(codes[i], least);
        const s = (x | y) & -(x | y); // 0 at the origin
        const isCorner = (x === 0 || x === side) && (y === 0 || y === side);
        // The ends of the edge that it halves are at (+-dx, +-dy), its parents at (+-dy, -+dx).
        const isOddX = (x & s) !== 0, isOddY = (y & s) !== 0;
        const dx = isOddX ? s : 0, dy = !isOddY ? 0 : isOddX && (x + y & 2 * s) === 0 ? -s : s;
        if (!isCorner) {
            const a = table.find(x - dx, y - dy), b = table.find(x + dx, y + dy);
            if (a >= 0 && b >= 0) code = Math.max(code, codeAbove(Math.abs(2 * q[i] - table.q[a] - table.q[b]) * factor / parts));
        }
        if (plain[2 + (n >> 3)] >> (n & 7) & 1) {
            if (at === told) bad();
            const residual = plain[head + at] | plain[head + told + at] << 8;
            if (residual === 0) bad();
            code = code + residual & 0xFFFF;
            at++;
        }
        codes[i] = code;
        errors[i] = metresOfCode(code);
        if (isCorner) continue;
        for (const sign of [1, -1]) {
            const parent = table.find(x - sign * dy, y + sign * dx);
            if (parent >= 0 && codes[table.index[parent]] < code) codes[table.index[parent]] = code;
        }
    }
    if (at !== told || vertexCount % 8 && plain[head - 1] >> vertexCount % 8) bad();
    return errors;
}

/** The numbers of the vertices from the finest class to the coarsest; the table gets them all. */
function orderOf({vertexCount, col, row, q, K}, table) {
    const begin = new Uint32Array(CLASSES + 1), classes = new Uint8Array(vertexCount), order = new Uint32Array(vertexCount);
    for (let i = 0; i < vertexCount; i++) {
        const x = col[i], y = row[i], scale = (x | y) === 0 ? K : 31 - Math.clz32((x | y) & -(x | y));
        classes[i] = 2 * scale + (x >> scale & y >> scale & 1);
        begin[classes[i] + 1]++;
        table.add(x, y, q[i], i);
    }
    for (let c = 0; c < CLASSES; c++) begin[c + 1] += begin[c];
    for (let i = 0; i < vertexCount; i++) order[begin[classes[i]]++] = i;
    return order;
}
