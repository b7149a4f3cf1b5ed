/**
 * order.js - the one order in which both ends of an increment number a mesh (src/core/FORMAT.md, "View increment"):
 * vertices along the Morton curve, triangles by their vertices' numbers.
 *
 * A code has 42 bits: bit 2n is bit n of the column, bit 2n + 1 bit n of the row. A double holds it.
 */

/** The low 16 bits of v, two apart. */
function spread(v) {
    v &= 0xFFFF;
    v = (v | v << 8) & 0x00FF00FF;
    v = (v | v << 4) & 0x0F0F0F0F;
    v = (v | v << 2) & 0x33333333;
    return (v | v << 1) & 0x55555555;
}

/** Every other bit of v, from the lowest on. */
function gather(v) {
    v &= 0x55555555;
    v = (v | v >>> 1) & 0x33333333;
    v = (v | v >>> 2) & 0x0F0F0F0F;
    v = (v | v >>> 4) & 0x00FF00FF;
    return (v | v >>> 8) & 0xFFFF;
}

/** The Morton code of a sample, columns and rows below 2^21. */
export function codeOf(col, row) {
    return ((spread(col) | spread(row) << 1) >>> 0) + (spread(col >>> 16) | spread(row >>> 16) << 1) * 2 ** 32;
}

/** The sample of a code. @returns {[number, number]} column and row */
export function sampleOf(code) {
    const low = code % 2 ** 32 >>> 0, high = Math.floor(code / 2 ** 32);
    return [gather(low) | gather(high) << 16, gather(low >>> 1) | gather(high >>> 1) << 16];
}

/** < 0, 0, > 0: how triangle i of one list stands to triangle j of another. */
export function compareTriangles(one, i, other, j) {
    return one[3 * i] - other[3 * j] || one[3 * i + 1] - other[3 * j + 1] || one[3 * i + 2] - other[3 * j + 2];
}

/**
 * A mesh in this order, with the same triangles (each begins with its apex as before). Normals and errors go with their
 * vertices; leaves are dropped.
 * @param {import('./wire.js').Mesh} mesh
 * @returns {import('./wire.js').Mesh} another mesh
 */
export function sortMesh(mesh) {
    const {vertexCount, triangleCount, triangles} = mesh, codes = new Float64Array(vertexCount);
    for (let i = 0; i < vertexCount; i++) codes[i] = codeOf(mesh.col[i], mesh.row[i]);
    const order = new Uint32Array(vertexCount).map((_, i) => i).sort((i, j) => codes[i] - codes[j]);
    const number = new Uint32Array(vertexCount);
    order.forEach((old, i) => { number[old] = i; });
    const pick = (array, per) => {
        if (!array) return null;
        const picked = new array.constructor(array.length);
        for (let i = 0; i < vertexCount; i++)
            for (let c = 0; c < per; c++) picked[per * i + c] = array[per * order[i] + c];
        return picked;
    };
    // By first vertex: where its triangles begin; then those of one vertex, which are few, by the others.
    const begin = new Uint32Array(vertexCount + 1), sorted = new Uint32Array(3 * triangleCount);
    for (let t = 0; t < triangleCount; t++) begin[number[triangles[3 * t]] + 1]++;
    for (let i = 0; i < vertexCount; i++) begin[i + 1] += begin[i];
    const filled = new Uint8Array(vertexCount), now = new Uint32Array(3);
    for (let t = 0; t < triangleCount; t++) {
        for (let c = 0; c < 3; c++) now[c] = number[triangles[3 * t + c]];
        let at = begin[now[0]] + filled[now[0]]++;
        for (; at > begin[now[0]] && compareTriangles(now, 0, sorted, at - 1) < 0; at--) sorted.copyWithin(3 * at, 3 * at - 3, 3 * at);
        sorted.set(now, 3 * at);
    }
    return {...mesh, isSorted: true, col: pick(mesh.col, 1), row: pick(mesh.row, 1), q: pick(mesh.q, 1), triangles: sorted,
        normals: pick(mesh.normals, 2), errors: pick(mesh.errors, 1), leaves: null};
}
