/**
 * morph.js - two meshes of one terrain as one whose vertices have a height on the surface of each: a geomorph.
 *
 * A mesh is the leaves of a closed set of lattice vertices (ALGORITHMS: a triangle is a leaf iff its apex is in the set
 * and its split vertex, the middle of its hypotenuse, is not). Let U be the union of the sets A and B; it is closed.
 * Each leaf of U lies in a leaf of A and in one of B, and over it both surfaces are planes, and so is any mixture. So
 * U's mesh with the heights (1-t) zA + t zB is A's surface at t = 0, B's at t = 1, and has no crack in between: a
 * vertex has one height, and U has no T-junction.
 *
 * A vertex P that is not in A halves an edge whose ends come before it. Over that edge A is straight: zA(P) is the mean
 * of zA at the two ends. So one walk from the root over U's triangles, down to its leaves, meets the ends before P, and
 * needs to ask of each split vertex only whether it is in A or B. Heights are multiples of 2^-K: exact in doubles.
 *
 * What a mesh leaves out. Void corners and regions leave leaves out, and a vertex of the set that is no corner of a leaf
 * that is kept is not in the mesh. All split vertices on the way to a kept leaf follow from its corners, though: they
 * are what these depend on (closeSet). The walk knows of each triangle whether it is in a leaf of A, and whether that
 * one is kept; a leaf of U is kept that is in a kept leaf of A or of B. A vertex that has no place on one of the
 * surfaces takes the height that it has on the other.
 *
 * Where the raster ends. Of a triangle that reaches past the last column or row the corners are clamped, and its clamped
 * children do not lie in it; leaves of U are not in leaves of A. As src/core/morph.c does, vertices whose box (all that
 * depends on them lies in it) reaches past the last sample do not move: they have their own heights at once, as if they
 * had been in A and B all along. Such meshes have to be decoded with their leaves (decodeMesh(bytes, {leaves: true})):
 * their samples alone do not say which lattice vertices they are. Without, the answer is b as it is, not moving.
 */
import {SampleTable} from './sample_table.js';

const A = 0, B = 1;
const DIVIDED = 0, KEPT = 1, LEFT_OUT = 2; // how a triangle lies in a mesh: above its leaves, or in one

/**
 * @typedef {import('./wire.js').Mesh & {zFrom: Float64Array, zTo: Float64Array, from: Int32Array, to: Int32Array}} Morph
 * A mesh; zFrom and zTo are the heights of its vertices on a and b, in quanta as q is (header.js: metresOf); from and to
 * are their numbers in a and b, -1 where they are none. q is zTo, rounded.
 */

/**
 * The union of two meshes. At t the height of vertex i is (1-t) * zFrom[i] + t * zTo[i].
 * @param {import('./wire.js').Mesh} a  where the move begins
 * @param {import('./wire.js').Mesh} b  where it ends
 * @returns {Morph} triangles and order are of no mesh in particular; each triangle is counter-clockwise
 * @throws {Error} a sentence, when they are not meshes of one terrain
 */
export function morphMeshes(a, b) {
    for (const name of ['x0', 'y0', 'dx', 'dy', 'z0', 'd', 'numerator', 'denominator', 'scale', 'offset', 'width', 'height'])
        if (a[name] !== undefined && b[name] !== undefined && !Object.is(a[name], b[name]))
            throw new Error(`the meshes are not of one terrain: their ${name} is ${a[name]} and ${b[name]}`);
    const width = a.width ?? b.width ?? extentOf(a.col, b.col), height = a.height ?? b.height ?? extentOf(a.row, b.row);
    const longest = Math.max(width, height), K = longest > 2 ? 32 - Math.clz32(longest - 2) : 0;
    const union = new Union(K, width, height, a.vertexCount + b.vertexCount);
    if (union.isClamped && !(a.leaves && b.leaves)) return unmoved(b);
    union.addMesh(A, a);
    union.addMesh(B, b);
    union.walk();
    return union.meshOf(a, b);
}

function extentOf(...arrays) {
    let most = 0;
    for (const array of arrays) for (let i = 0; i < array.length; i++) if (array[i] > most) most = array[i];
    return most + 1;
}

/** b with its own heights. */
function unmoved(b) {
    const z = Float64Array.from(b.q), to = new Int32Array(b.vertexCount).map((_, i) => i);
    return {...b, zFrom: z, zTo: z, from: new Int32Array(b.vertexCount).fill(-1), to};
}

class Union {
    constructor(K, width, height, room) {
        Object.assign(this, {K, side: 2 ** K, width, height});
        this.isClamped = width - 1 < this.side || height - 1 < this.side;
        // Lattice vertices of both sets, by number.
        this.table = new SampleTable(room + 1024);
        this.count = 0;
        this.grow(room + 1024);
        this.rim = [new SampleTable(), new SampleTable()]; // of clamped rasters: vertices of both in the last column and row
        this.kept = [null, null]; // of those that leave something out: leavesByApex
        this.heights = [null, null];
        this.triangles = new Int32Array(0);
        this.triangleCount = 0;
    }

    grow(room) {
        const wider = (array, fill, type) => {
            const grown = new type(room).fill(fill);
            if (array) grown.set(array);
            return grown;
        };
        this.x = wider(this.x, 0, Int32Array);
        this.y = wider(this.y, 0, Int32Array);
        /** Numbers in the meshes, -1: none; heights on them, NaN: none; is it in the set: 1 of A, 2 of B? */
        this.number = [A, B].map((m) => wider(this.number?.[m], -1, Int32Array));
        this.z = [A, B].map((m) => wider(this.z?.[m], NaN, Float64Array));
        this.sets = wider(this.sets, 0, Uint8Array);
    }

    /** The number of a lattice vertex, which is made if it is new. */
    enter(x, y) {
        const v = this.table.indexOf(x, y, this.count);
        if (v < this.count) return v;
        if (this.count === this.x.length) this.grow(2 * this.count);
        this.x[v] = x;
        this.y[v] = y;
        this.count++;
        return v;
    }

    find(x, y) {
        const e = this.table.find(x, y);
        return e >= 0 ? this.table.index[e] : -1;
    }

    /* ---------------------------------------------------------------------------------------- the two sets -- */

    addMesh(m, mesh) {
        const add = (x, y, i) => {
            const v = this.enter(x, y);
            this.sets[v] |= 1 << m;
            this.number[m][v] = i;
            this.z[m][v] = mesh.q[i];
        };
        for (let i = 0; i < mesh.vertexCount; i++)
            if (this.isRim(mesh.col[i], mesh.row[i])) this.rim[m].add(mesh.col[i], mesh.row[i], mesh.q[i], i);
            else add(mesh.col[i], mesh.row[i], i);
        if (this.isClamped) { // which lattice vertices those on the rim are
            const {leaves} = mesh;
            for (let at = 0; at < 6 * mesh.triangleCount; at += 2) {
                const x = leaves[at], y = leaves[at + 1];
                if (!this.isRim(x, y)) continue;
                const e = this.rim[m].find(Math.min(x, this.width - 1), Math.min(y, this.height - 1));
                if (e >= 0) add(x, y, this.rim[m].index[e]);
            }
        }
        this.heights[m] = mesh.q;
        const isWhole = this.isWhole(mesh);
        if (!isWhole) this.kept[m] = leavesByApex(mesh);
        // Of a whole mesh only what lies past the raster may be missing.
        if (!isWhole || this.isClamped) this.closeSet(m, (v) => !isWhole || this.isNearEnd(this.x[v], this.y[v]));
    }

    /** Is a vertex in the last column or row of a clamped raster, or past them? */
    isRim(x, y) {
        return this.isClamped && (x >= this.width - 1 || y >= this.height - 1);
    }

    /** Do its triangles cover the whole raster? */
    isWhole({triangles, triangleCount, col, row}) {
        let twice = 0;
        for (let t = 0; t < 3 * triangleCount; t += 3) {
            const a = triangles[t], b = triangles[t + 1], c = triangles[t + 2];
            twice += Math.abs((col[b] - col[a]) * (row[c] - row[a]) - (col[c] - col[a]) * (row[b] - row[a]));
        }
        return twice === 2 * (this.width - 1) * (this.height - 1);
    }

    /** All that the vertices of a set depend on is in it, too; those asked about come first. */
    closeSet(m, isAsked) {
        const bit = 1 << m, waiting = [];
        for (let v = 0; v < this.count; v++) if (this.sets[v] & bit && isAsked(v)) waiting.push(v);
        const ask = (x, y) => {
            if (x < 0 || y < 0 || x > this.side || y > this.side) return;
            const v = this.enter(x, y);
            if (this.sets[v] & bit) return;
            this.sets[v] |= bit;
            waiting.push(v);
        };
        while (waiting.length > 0) {
            const v = waiting.pop(), x = this.x[v], y = this.y[v], q = (x | y) & -(x | y);
            if (q === 0 || q === this.side) continue; // the corners
            const isOddX = x & q, isOddY = y & q;
            if (isOddX && isOddY) { // the centre of a cell: the corners off its diagonal
                const dy = ((x - q ^ y - q) & 2 * q) === 0 ? -q : q;
                ask(x + q, y + dy);
                ask(x - q, y - dy);
            } else if (isOddX) {
                ask(x, y - q);
                ask(x, y + q);
            } else {
                ask(x - q, y);
                ask(x + q, y);
            }
        }
    }

    /** Does all that depends on a vertex lie before the last column and row, or does the lattice end with the raster? */
    isNearEnd(x, y) {
        const both = x | y, q = both === 0 ? this.side : both & -both;
        const half = (x & q && y & q ? 3 : 2) * q;
        return this.width - 1 < this.side && x + half > this.width - 1 || this.height - 1 < this.side && y + half > this.height - 1;
    }

    /* -------------------------------------------------------------------------------------------- the walk -- */

    walk() {
        const corner = [[0, 0], [this.side, 0], [0, this.side], [this.side, this.side]].map(([x, y]) => this.enter(x, y));
        this.visit(corner[1], corner[0], corner[3], DIVIDED, DIVIDED);
        this.visit(corner[2], corner[3], corner[0], DIVIDED, DIVIDED);
    }

    /** The triangle with this apex; inA, inB: how the one around it lies in the meshes. */
    visit(apex, left, right, inA, inB) {
        const {x, y, sets} = this;
        if (this.isClamped && this.isFlat(apex, left, right)) return;
        const sumX = x[left] + x[right], sumY = y[left] + y[right];
        const split = (sumX | sumY) & 1 ? -1 : this.find(sumX / 2, sumY / 2), set = split < 0 ? 0 : sets[split];
        if (inA === DIVIDED && !(set & 1)) inA = this.isKept(A, apex, left, right) ? KEPT : LEFT_OUT;
        if (inB === DIVIDED && !(set & 2)) inB = this.isKept(B, apex, left, right) ? KEPT : LEFT_OUT;
        if (inA !== DIVIDED && inB !== DIVIDED) { // then the split vertex is in neither
            if (inA === KEPT || inB === KEPT) this.addLeaf(apex, left, right);
            return;
        }
        if (inA === KEPT) this.settle(A, split, left, right);
        if (inB === KEPT) this.settle(B, split, left, right);
        this.visit(split, apex, left, inA, inB);
        this.visit(split, right, apex, inA, inB);
    }

    /** The height of a vertex on the edge between two others, in a leaf of a mesh. */
    settle(m, v, left, right) {
        const z = this.z[m];
        if (z[v] === z[v]) return;
        const own = this.isNearEnd(this.x[v], this.y[v]) ? this.ownHeight(v) : NaN;
        z[v] = Number.isNaN(own) ? (z[left] + z[right]) / 2 : own;
    }

    /** The number in a mesh of a lattice vertex, or of its sample; -1: none. */
    numberOf(m, v) {
        if (this.number[m][v] >= 0 || !this.isClamped) return this.number[m][v];
        const e = this.rim[m].find(Math.min(this.x[v], this.width - 1), Math.min(this.y[v], this.height - 1));
        return e >= 0 ? this.rim[m].index[e] : -1;
    }

    /** The height that a mesh has at it; NaN: it is a vertex of none. */
    ownHeight(v) {
        for (const m of [A, B]) {
            const i = this.numberOf(m, v);
            if (i >= 0) return this.heights[m][i];
        }
        return NaN;
    }

    isFlat(a, b, c) {
        const {x, y} = this, lastX = this.width - 1, lastY = this.height - 1;
        return x[a] >= lastX && x[b] >= lastX && x[c] >= lastX || y[a] >= lastY && y[b] >= lastY && y[c] >= lastY;
    }

    /** Is this leaf of a set one of its mesh? */
    isKept(m, apex, left, right) {
        const kept = this.kept[m];
        if (!kept) return true;
        const i = this.number[m][apex], clampX = (v) => Math.min(this.x[v], this.width - 1), clampY = (v) => Math.min(this.y[v], this.height - 1);
        if (i < 0) return false;
        const sumX = clampX(left) + clampX(right), sumY = clampY(left) + clampY(right);
        for (let at = kept.begin[i]; at < kept.begin[i + 1]; at++)
            if (kept.sumX[at] === sumX && kept.sumY[at] === sumY) return true;
        return false;
    }

    addLeaf(apex, left, right) {
        const at = 3 * this.triangleCount++;
        if (at + 3 > this.triangles.length) {
            const grown = new Int32Array(Math.max(3072, 2 * this.triangles.length));
            grown.set(this.triangles);
            this.triangles = grown;
        }
        this.triangles[at] = apex;
        this.triangles[at + 1] = left;
        this.triangles[at + 2] = right;
    }

    /* ------------------------------------------------------------------------------------------ the answer -- */

    /** Lattice vertices that are one sample are one vertex. */
    meshOf(a, b) {
        const {triangleCount} = this, triangles = new Uint32Array(3 * triangleCount);
        const index = new Int32Array(this.count).fill(-1), samples = new SampleTable(), chosen = new Int32Array(this.count);
        let vertexCount = 0;
        const indexOf = (v) => {
            const x = Math.min(this.x[v], this.width - 1), y = Math.min(this.y[v], this.height - 1);
            if (this.isRim(x, y)) {
                const e = samples.find(x, y);
                if (e >= 0) return samples.index[e];
                samples.add(x, y, 0, vertexCount);
            }
            chosen[vertexCount] = v;
            return vertexCount++;
        };
        for (let i = 0; i < 3 * triangleCount; i++) {
            const v = this.triangles[i];
            if (index[v] < 0) index[v] = indexOf(v);
            triangles[i] = index[v];
        }
        const col = new Int32Array(vertexCount), row = new Int32Array(vertexCount), q = new Int32Array(vertexCount);
        const zFrom = new Float64Array(vertexCount), zTo = new Float64Array(vertexCount);
        const from = new Int32Array(vertexCount), to = new Int32Array(vertexCount);
        for (let i = 0; i < vertexCount; i++) {
            const v = chosen[i];
            col[i] = Math.min(this.x[v], this.width - 1);
            row[i] = Math.min(this.y[v], this.height - 1);
            from[i] = this.numberOf(A, v);
            to[i] = this.numberOf(B, v);
            const before = from[i] < 0 ? this.z[A][v] : a.q[from[i]], after = to[i] < 0 ? this.z[B][v] : b.q[to[i]];
            zFrom[i] = before === before ? before : after;
            zTo[i] = after === after ? after : before;
            q[i] = Math.round(zTo[i]);
        }
        return {...a, ...b, vertexCount, triangleCount, col, row, q, triangles, normals: null, errors: null, leaves: null, zFrom, zTo, from, to};
    }
}

/** The triangles of a mesh by their apexes: where those of vertex i begin, and of each the sums of columns and rows of the others. */
function leavesByApex({vertexCount, triangleCount, triangles, col, row}) {
    const begin = new Int32Array(vertexCount + 1), filled = new Uint8Array(vertexCount);
    for (let t = 0; t < 3 * triangleCount; t += 3) begin[triangles[t] + 1]++;
    for (let i = 0; i < vertexCount; i++) begin[i + 1] += begin[i];
    const sumX = new Int32Array(triangleCount), sumY = new Int32Array(triangleCount);
    for (let t = 0; t < 3 * triangleCount; t += 3) {
        const apex = triangles[t], at = begin[apex] + filled[apex]++;
        sumX[at] = col[triangles[t + 1]] + col[triangles[t + 2]];
        sumY[at] = row[triangles[t + 1]] + row[triangles[t + 2]];
    }
    return {begin, sumX, sumY};
}
