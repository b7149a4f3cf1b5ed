/**
 * wire_walk.js - the walk of the wire format: from the streams of a payload to vertices and triangles.
 *
 * src/core/FORMAT.md, "Wire", is the specification. Cells come depth first, and those that answer are blocks of
 * (2^k + 1)^2 places, numbered row by row; the middle of two places is their mean. Of a block first all vertices are
 * read, scale by scale from the coarse to the fine: centres of squares, then the middles of their sides. Each needs
 * the vertices around it, so most places of a sparse block are never looked at: of each row the first and the last
 * vertex are kept, and candidates lie between. Then its triangles are walked, and give their corners indices in the
 * order in which they name them.
 *
 * Nothing of the streams is believed. Whatever the symbols are, the walk stays within the block's arrays; after each
 * block all streams are compared with their ends; the mesh grows block by block up to what its header claims, never
 * ahead of the bytes. What a block has touched is cleared behind it, so that a block of few vertices takes little time
 * whatever k is. So time and memory are those of the mesh that the bytes describe.
 */
import {SampleTable} from './sample_table.js';

/** Streams, and which of them are bits. */
const SHAPE = 0, PART = 1, LOOSE = 2, BITS_KNOWN = 3, BITS_SIDE = 4, EDGES = 5, BY_CLASS = 6;
const CLASSES = 40;
const RAW = BY_CLASS + 2 * CLASSES;
const STREAMS = RAW + 1;
const isBits = (i) => i === BITS_KNOWN || i === BITS_SIDE || i === RAW || i >= BY_CLASS && (i - BY_CLASS) % 2 === 1;

const NONE = -1;   // not a vertex
const CHOSEN = -2; // a vertex without an index as yet
const NOT = 0, TAKEN = 1, WAITS = 2;
const EMPTY = 0, WHOLE = 1, SOME = 2, QUARTER = 3;
const HEIGHT_LIMIT = 2 ** 30;
const NOWHERE = 2 ** 20; // of a row without vertices: the first one

/** Tokens: the number that one begins with, and how many bits follow it. */
const TOKEN_COUNT = 168;
const TOKEN_BASE = new Float64Array(256).fill(2 ** 32 - 2), TOKEN_BITS = new Uint8Array(256);
for (let t = 0; t < TOKEN_COUNT; t++) {
    TOKEN_BITS[t] = t < 64 ? 0 : (t - 64 >> 2) + 4;
    TOKEN_BASE[t] = t < 64 ? t : (4 + (t & 3)) * 2 ** TOKEN_BITS[t];
}

function bad() {
    throw new Error("the mesh's streams do not describe the mesh of its header");
}

/** Places of a block and what follows from k alone. */
class Places {
    constructor(k) {
        const n = (1 << k) + 1;
        this.column = new Uint16Array(n * n);
        this.row = new Uint16Array(n * n);
        this.isNorthWest = new Uint8Array(n * n);
        this.isSide = new Uint8Array(n * n);
        for (let p = 0; p < n * n; p++) {
            const u = p % n, v = (p - u) / n;
            this.column[p] = u;
            this.row[p] = v;
            this.isNorthWest[p] = u === 0 || v === 0 ? 1 : 0;
            this.isSide[p] = this.isNorthWest[p] || u === n - 1 || v === n - 1 ? 1 : 0;
        }
    }
}
const PLACES = [];

/**
 * What a mesh keeps of where its leaves are on the lattice, for increments: x and y of apex, left and right.
 * @typedef {Int32Array} Leaves
 */

export class Walk {
    /**
     * @param {{k: number, K: number, width: number, height: number, vertexCount: number, triangleCount: number}} header
     * @param {Uint8Array} payload  with slackOf(k) zero bytes behind it
     * @param {number} size  of the payload itself
     * @param {boolean} wantsLeaves
     * @param {SampleTable|null} prior  of an increment: lattice vertices known beforehand, index 1, and samples, index 0
     */
    constructor(header, payload, size, wantsLeaves, prior) {
        const {k, K, width, height} = header, n = (1 << k) + 1;
        Object.assign(this, {k, K, width, height, n, payload, prior});
        this.begin = new Float64Array(STREAMS);
        this.at = new Float64Array(STREAMS); // bytes or bits so far
        this.size = new Float64Array(STREAMS);
        this.openStreams(size);

        this.vertexMost = header.vertexCount;
        this.triangleMost = header.triangleCount;
        this.vertexCount = this.triangleCount = 0;
        this.col = this.row = this.heights = this.triangles = new Int32Array(0);
        this.leaves = wantsLeaves ? new Int32Array(0) : null;
        this.table = new SampleTable();
        this.lastQ = 0;

        this.places = PLACES[k] ??= new Places(k);
        this.memo = new Int32Array(n * n).fill(NONE);
        this.touched = new Int32Array(n * n);
        this.touchedCount = 0;
        this.q = new Int32Array(n * n + 2);      // by place; then of the two far vertices
        this.far = new Int32Array(4);
        this.list = new Int32Array(n * n);       // places that wait for their heights
        this.slotHas = new Uint8Array(2 * n);    // samples of the last column, by row, and of the last row, by n + column
        this.slotQ = new Int32Array(2 * n);
        this.slotIndex = new Int32Array(2 * n);
        const rows = () => ({low: new Int32Array(n + 1), high: new Int32Array(n + 1)});
        this.grid = rows(), this.nextGrid = rows(), this.centres = rows(), this.across = rows(), this.down = rows();
        this.stack = new Int32Array(4 * (2 * k + 2));
    }

    /** The directory of the payload. */
    openStreams(size) {
        const payload = this.payload;
        let at = 2;
        if (size < 2 || payload[0] + payload[1] > CLASSES) bad();
        const first = BY_CLASS + 2 * payload[0], last = first + 2 * payload[1];
        for (let i = 0; i < RAW; i++) {
            if (i >= BY_CLASS && (i < first || i >= last)) continue;
            for (let scale = 1, byte = 128; byte >= 128; scale *= 128) {
                if (at >= size || scale > 2 ** 28) bad();
                byte = payload[at++];
                this.size[i] += (byte & 127) * scale;
            }
        }
        for (let i = 0; i <= RAW; i++) {
            if (i === RAW) this.size[i] = size - at;
            if (this.size[i] > size - at) bad();
            this.begin[i] = at;
            at += this.size[i];
        }
    }

    /** Walks all cells. Afterwards vertexCount, triangleCount, col, row, heights, triangles and leaves are the mesh's. */
    run() {
        this.walkCell(0, 0, 0);
        const {at, size, begin} = this;
        for (let i = 0; i < STREAMS; i++)
            if (!isBits(i)) {
                if (at[i] !== size[i]) bad();
            } else if (Math.ceil(at[i] / 8) !== size[i] ||
                at[i] % 8 && this.payload[begin[i] + Math.floor(at[i] / 8)] >> at[i] % 8) bad();
        if (this.vertexCount !== this.vertexMost || this.triangleCount !== this.triangleMost) bad();
    }

    walkCell(level, i, j) {
        const side = 2 ** (this.K - level);
        if (i * side >= Math.max(this.width - 1, 1) || j * side >= Math.max(this.height - 1, 1)) return;
        if (this.at[SHAPE] >= this.size[SHAPE]) bad();
        const shape = this.payload[this.begin[SHAPE] + this.at[SHAPE]++];
        if (shape === 0) return;
        if (shape === 1) {
            if (level === this.K - this.k) bad();
            for (let c = 0; c < 4; c++) this.walkCell(level + 1, 2 * i + (c & 1), 2 * j + (c >> 1));
            return;
        }
        if (shape > 17 || shape === 2) bad();
        this.beginBlock(level, i, j, side);
        this.takeVertices();
        this.walkBlock(level, i, j, shape - 2 & 3, shape - 2 >> 2);
        this.endBlock();
    }

    /* -------------------------------------------------------------------------------------------- a block -- */

    beginBlock(level, i, j, side) {
        const cells = 4 ** this.k, n = this.n;
        this.x = i * side;
        this.y = j * side;
        this.shift = this.K - level - this.k;
        const rim = (from, last) => Math.max(0, Math.min(n, Math.ceil((last - from) / 2 ** this.shift)));
        this.rimU = rim(this.x, this.width - 1);  // the first column and row of places at or past the last sample
        this.rimV = rim(this.y, this.height - 1);
        this.isClamped = this.rimU < n || this.rimV < n;
        if (this.isClamped) this.slotHas.fill(0);
        this.vertexRoom = n * n + 6;
        this.triangleRoom = 2 * cells + 2;
        // More than the header says is found out behind the block; here is room for it.
        if (this.vertexCount > this.vertexMost || this.triangleCount > this.triangleMost) bad();
        const wider = (array, per, count, more, most) => {
            if (array.length >= per * (count + more)) return array;
            const grown = new Int32Array(per * Math.min(2 * (count + more), most + more));
            grown.set(array.subarray(0, per * count));
            return grown;
        };
        const {vertexCount, vertexRoom, vertexMost, triangleCount, triangleRoom, triangleMost} = this;
        this.col = wider(this.col, 1, vertexCount, vertexRoom, vertexMost);
        this.row = wider(this.row, 1, vertexCount, vertexRoom, vertexMost);
        this.heights = wider(this.heights, 1, vertexCount, vertexRoom, vertexMost);
        this.triangles = wider(this.triangles, 3, triangleCount, triangleRoom, triangleMost);
        if (this.leaves) this.leaves = wider(this.leaves, 6, triangleCount, triangleRoom, triangleMost);
    }

    endBlock() {
        for (let i = 0; i < this.touchedCount; i++) this.memo[this.touched[i]] = NONE;
        this.touchedCount = 0;
        for (let i = 0; i < STREAMS; i++) if (this.at[i] > (isBits(i) ? 8 * this.size[i] : this.size[i])) bad();
    }

    /* ------------------------------------------------------------------------------------------- heights -- */

    readBit(stream) {
        const at = this.at[stream]++;
        return this.payload[this.begin[stream] + (at >>> 3)] >> (at & 7) & 1;
    }

    /** The bits that follow a token. */
    readRaw(count) {
        const at = this.at[RAW], p = this.begin[RAW] + (at >>> 3), shift = at & 7, payload = this.payload;
        this.at[RAW] = at + count;
        const low = (payload[p] | payload[p + 1] << 8 | payload[p + 2] << 16 | payload[p + 3] << 24) >>> shift;
        const high = shift ? payload[p + 4] << 32 - shift : 0;
        return (low | high) & (1 << count) - 1;
    }

    /** guess and the residual of a token; the token's bits are read. */
    heightOf(token, guess) {
        const v = token < 64 ? token : TOKEN_BASE[token] + this.readRaw(TOKEN_BITS[token]);
        const q = guess + (v >>> 1 ^ -(v & 1));
        if (!(q > -HEIGHT_LIMIT && q < HEIGHT_LIMIT)) bad();
        return q;
    }

    readHeight(stream, guess) {
        return this.heightOf(this.payload[this.begin[stream] + this.at[stream]++], guess);
    }

    /** The heights of the places in the list, each from the four at these distances. */
    readHeights(stream, listed, a, b, c, d) {
        const {payload, list, q} = this;
        let token = this.begin[stream] + this.at[stream];
        this.at[stream] += listed;
        for (let i = 0; i < listed; i++) {
            const p = list[i], qa = q[p + a], qb = q[p + b], qc = q[p + c], qd = q[p + d], t = payload[token++];
            const guess = (qa >> 2) + (qb >> 2) + (qc >> 2) + (qd >> 2) + ((qa & 3) + (qb & 3) + (qc & 3) + (qd & 3) >> 2);
            q[p] = this.heightOf(t, guess);
        }
    }

    /* ------------------------------------------------------------------------------------------ vertices -- */

    isRim(p) {
        return this.isClamped && (this.places.column[p] >= this.rimU || this.places.row[p] >= this.rimV);
    }

    /** Where the height and the index of a place on the rim are kept: with its sample. */
    slotOf(p) {
        const u = this.places.column[p], v = this.places.row[p];
        return u >= this.rimU ? Math.min(v, this.rimV) : this.n + u;
    }

    /** The first place of the block with the same sample. */
    firstOf(p) {
        return Math.min(this.places.row[p], this.rimV) * this.n + Math.min(this.places.column[p], this.rimU);
    }

    xOf(p) {
        return this.x + this.places.column[p] * 2 ** this.shift;
    }

    yOf(p) {
        return this.y + this.places.row[p] * 2 ** this.shift;
    }

    choose(p, mark) {
        this.memo[p] = mark;
        this.touched[this.touchedCount++] = p;
    }

    /** A vertex that may have its height from elsewhere: its sample, another block, the mesh before. */
    take(p, guess, stream, looksUp) {
        const rim = this.isRim(p), slot = rim ? this.slotOf(p) : 0;
        if (rim && this.slotHas[slot]) {
            this.q[p] = this.slotQ[slot];
            this.choose(p, CHOSEN);
            return;
        }
        const x = Math.min(this.xOf(p), this.width - 1), y = Math.min(this.yOf(p), this.height - 1);
        const isShared = looksUp || this.places.isNorthWest[rim ? this.firstOf(p) : p];
        const e = isShared ? this.table.find(x, y) : -1;
        const before = e < 0 && this.prior ? this.prior.find(x, y) : -1;
        this.q[p] = e >= 0 ? this.table.q[e] : before >= 0 ? this.prior.q[before] : this.readHeight(stream, guess);
        const index = e >= 0 ? this.table.index[e] : CHOSEN;
        this.choose(p, rim ? CHOSEN : index);
        if (!rim) return;
        this.slotHas[slot] = 1;
        this.slotQ[slot] = this.q[p];
        this.slotIndex[slot] = index;
    }

    /**
     * A candidate inside the block: no vertex (NOT), one that has its height (TAKEN), or one that waits for it in the list.
     */
    takeInside(p, bits, listed, a, b, c, d) {
        const isKnown = this.prior !== null && this.isPrior(p);
        if (!isKnown && !this.readBit(bits)) return NOT;
        if (isKnown || this.isRim(p)) {
            const q = this.q;
            this.take(p, Math.floor((q[p + a] + q[p + b] + q[p + c] + q[p + d]) / 4), EDGES, false);
            return TAKEN;
        }
        this.choose(p, CHOSEN);
        this.list[listed] = p;
        return WAITS;
    }

    isPrior(p) {
        const e = this.prior.find(this.xOf(p), this.yOf(p));
        return e >= 0 && this.prior.index[e] === 1;
    }

    /** A candidate on a side of the block, between the places at distances a and b. */
    takeSide(p, a, b) {
        const looksUp = this.places.isNorthWest[p] === 1, q = this.q;
        if (looksUp && !this.isRim(p)) {
            const e = this.table.find(this.xOf(p), this.yOf(p));
            if (e >= 0) {
                q[p] = this.table.q[e];
                this.choose(p, this.table.index[e]);
                return true;
            }
        }
        const isKnown = this.prior !== null && this.isPrior(p);
        if (!isKnown && !this.readBit(looksUp ? BITS_KNOWN : BITS_SIDE)) return false;
        this.take(p, Math.floor((q[p + a] + q[p + b]) / 2), EDGES, isKnown && looksUp);
        return true;
    }

    /** Which places of the block are vertices, and their heights. */
    takeVertices() {
        const n = this.n, last = n - 1;
        for (const p of [0, last, last * n, last * n + last]) {
            this.take(p, this.lastQ, LOOSE, true);
            this.lastQ = this.q[p];
        }
        this.grid.low[0] = this.grid.low[1] = 0;
        this.grid.high[0] = this.grid.high[1] = 1;
        for (let m = 1, s = last >> 1; s > 0; m *= 2, s >>= 1) {
            if (!this.takeCentres(m, s) || !this.takeMiddles(m, s) || s === 1) return;
            this.refineRows(m);
        }
    }

    /** The centres of m * m squares of side 2s. */
    takeCentres(m, s) {
        const {n, memo, grid} = this, {low, high} = this.centres, is = s * n;
        const stream = BY_CLASS + 2 * (2 * (this.shift + Math.log2(s)) + 1);
        let listed = 0, any = false;
        for (let r = 0; r < m; r++) {
            const from = Math.max(grid.low[r], grid.low[r + 1]), to = Math.min(grid.high[r], grid.high[r + 1]);
            low[r] = NOWHERE;
            high[r] = -1;
            for (let c = from, p = (2 * r + 1) * is + (2 * c + 1) * s; c < to; c++, p += 2 * s) {
                if (memo[p - is - s] === NONE || memo[p - is + s] === NONE || memo[p + is - s] === NONE || memo[p + is + s] === NONE) continue;
                const taken = this.takeInside(p, stream + 1, listed, -is - s, -is + s, is - s, is + s);
                if (taken === NOT) continue;
                if (taken === WAITS) listed++;
                if (low[r] === NOWHERE) low[r] = c;
                high[r] = c;
                any = true;
            }
        }
        this.readHeights(stream, listed, -is - s, -is + s, is - s, is + s);
        return any;
    }

    /** The middles of the sides of these squares. */
    takeMiddles(m, s) {
        const {n, memo, grid, centres, across, down} = this, is = s * n;
        const stream = BY_CLASS + 2 * 2 * (this.shift + Math.log2(s));
        let listed = 0, any = false;
        const note = (rows, r, c) => {
            if (rows.low[r] === NOWHERE) rows.low[r] = c;
            rows.high[r] = c;
            any = true;
        };
        for (let r = 0; r <= m; r++) {
            // Between the squares of rows r - 1 and r.
            const above = Math.max(r - 1, 0), below = Math.min(r, m - 1), isSide = r === 0 || r === m;
            const from = Math.max(centres.low[above], centres.low[below]), to = Math.min(centres.high[above], centres.high[below]);
            across.low[r] = down.low[r] = NOWHERE;
            across.high[r] = down.high[r] = -1;
            for (let c = from, p = 2 * r * is + (2 * c + 1) * s; c <= to; c++, p += 2 * s) {
                if (memo[p - s] === NONE || memo[p + s] === NONE) continue;
                if (isSide) {
                    if (memo[r === 0 ? p + is : p - is] === NONE || !this.takeSide(p, -s, s)) continue;
                } else {
                    if (memo[p - is] === NONE || memo[p + is] === NONE) continue;
                    const taken = this.takeInside(p, stream + 1, listed, -s, s, -is, is);
                    if (taken === NOT) continue;
                    if (taken === WAITS) listed++;
                }
                note(across, r, c);
            }
            if (r === m || centres.high[r] < 0) continue;
            // Of the squares of row r those on the west, and the last one's on the east.
            const first = centres.low[r] === 0 ? 0 : centres.low[r] + 1, last = centres.high[r] === m - 1 ? m : centres.high[r];
            for (let c = first, p = (2 * r + 1) * is + 2 * c * s; c <= last; c++, p += 2 * s) {
                if (memo[p - is] === NONE || memo[p + is] === NONE) continue;
                if (c > 0 && memo[p - s] === NONE || c < m && memo[p + s] === NONE) continue;
                if (c === 0 || c === m) {
                    if (!this.takeSide(p, -is, is)) continue;
                } else {
                    const taken = this.takeInside(p, stream + 1, listed, -s, s, -is, is);
                    if (taken === NOT) continue;
                    if (taken === WAITS) listed++;
                }
                note(down, r, c);
            }
        }
        this.readHeights(stream, listed, -s, s, -is, is);
        return any;
    }

    /** First and last vertices of the rows of a grid with twice as many squares. */
    refineRows(m) {
        const {grid, nextGrid, centres, across, down} = this;
        for (let r = 0; r <= m; r++) {
            nextGrid.low[2 * r] = Math.min(2 * grid.low[r], 2 * across.low[r] + 1);
            nextGrid.high[2 * r] = Math.max(2 * grid.high[r], 2 * across.high[r] + 1);
            if (r === m) break;
            nextGrid.low[2 * r + 1] = Math.min(2 * down.low[r], 2 * centres.low[r] + 1);
            nextGrid.high[2 * r + 1] = Math.max(2 * down.high[r], 2 * centres.high[r] + 1);
        }
        this.grid = nextGrid;
        this.nextGrid = grid;
    }

    /* ----------------------------------------------------------------------------------------- triangles -- */

    addVertex(x, y, q) {
        const index = this.vertexCount++;
        this.col[index] = x;
        this.row[index] = y;
        this.heights[index] = q;
        return index;
    }

    /** The index of a sample that other blocks or lattice vertices may have had. */
    sharedIndex(x, y, q) {
        const e = this.table.find(x, y);
        if (e >= 0) return this.table.index[e];
        const index = this.addVertex(x, y, q);
        this.table.add(x, y, q, index);
        return index;
    }

    indexOf(p) {
        if (this.isRim(p)) {
            const slot = this.slotOf(p);
            if (this.slotIndex[slot] === CHOSEN) {
                const x = Math.min(this.xOf(p), this.width - 1), y = Math.min(this.yOf(p), this.height - 1);
                const isShared = this.places.isSide[this.firstOf(p)];
                this.slotIndex[slot] = isShared ? this.sharedIndex(x, y, this.q[p]) : this.addVertex(x, y, this.q[p]);
            }
            return this.slotIndex[slot];
        }
        if (this.memo[p] === CHOSEN) {
            const x = this.xOf(p), y = this.yOf(p);
            const index = this.memo[p] = this.addVertex(x, y, this.q[p]);
            if (this.places.isSide[p]) this.table.add(x, y, this.q[p], index);
        }
        return this.memo[p];
    }

    addLeaf(a, l, r, isClockwise) {
        if (this.leaves)
            this.leaves.set([this.xOf(a), this.yOf(a), this.xOf(l), this.yOf(l), this.xOf(r), this.yOf(r)], 6 * this.triangleCount);
        const out = 3 * this.triangleCount++;
        this.triangles[out] = this.indexOf(a);
        this.triangles[out + 2 - isClockwise] = this.indexOf(l);
        this.triangles[out + 1 + isClockwise] = this.indexOf(r);
    }

    /** Has the clamped triangle no area? */
    isFlat(a, l, r) {
        const {column, row} = this.places;
        return column[a] >= this.rimU && column[l] >= this.rimU && column[r] >= this.rimU ||
            row[a] >= this.rimV && row[l] >= this.rimV && row[r] >= this.rimV;
    }

    /** A triangle that is in the mesh as a whole: all of its leaves that have an area. */
    walkWhole(a, l, r, splits, isClockwise) {
        const stack = this.stack, memo = this.memo, turn = isClockwise ^ splits & 1;
        let top = 0;
        for (;;) {
            let isFlat = this.isClamped && this.isFlat(a, l, r);
            while (!isFlat && splits > 0) {
                const m = l + r >> 1;
                if (memo[m] === NONE) break;
                stack[top] = m, stack[top + 1] = a, stack[top + 2] = r, stack[top + 3] = --splits;
                top += 4;
                r = a;
                a = m;
                isFlat = this.isClamped && this.isFlat(a, l, r);
            }
            if (!isFlat) this.addLeaf(a, l, r, turn ^ splits & 1);
            if (top === 0) return;
            top -= 4;
            a = stack[top], l = stack[top + 1], r = stack[top + 2], splits = stack[top + 3];
        }
    }

    walkChild(amount, a, l, r, splits, isClockwise) {
        if (amount === EMPTY) return;
        if (this.isClamped && this.isFlat(a, l, r)) bad();
        if (amount === SOME) this.walkSome(a, l, r, splits, isClockwise);
        else this.walkWhole(a, l, r, splits, isClockwise);
    }

    /** A triangle of which some leaves are in the mesh and some are not: it is split. */
    walkSome(a, l, r, splits, isClockwise) {
        const m = l + r >> 1;
        if (splits === 0 || this.memo[m] === NONE || this.at[PART] >= this.size[PART]) bad();
        const amounts = this.payload[this.begin[PART] + this.at[PART]++];
        if (amounts < 1 || amounts > 8 || amounts === 4) bad();
        this.walkChild(Math.floor(amounts / 3), m, l, a, splits - 1, 1 - isClockwise);
        this.walkChild(amounts % 3, m, a, r, splits - 1, 1 - isClockwise);
    }

    /** The parent's quarter over a half with this apex: its far vertex is none of the block's. */
    walkQuarter(level, apex, center, near) {
        const bx = this.xOf(near), by = this.yOf(near), tx = this.xOf(center), ty = this.yOf(center);
        const fx = 2 * this.xOf(apex) - bx, fy = 2 * this.yOf(apex) - by, side = 2 ** this.K;
        if (level === 0 || fx < 0 || fy < 0 || fx > side || fy > side) bad();
        const x = Math.min(fx, this.width - 1), y = Math.min(fy, this.height - 1);
        const e = this.table.find(x, y), before = e < 0 && this.prior ? this.prior.find(x, y) : -1;
        const q = e >= 0 ? this.table.q[e] : before >= 0 ? this.prior.q[before] : this.readHeight(LOOSE, this.q[near]);
        const isClockwise = (bx - tx) * (fy - ty) - (fx - tx) * (by - ty) < 0 ? 1 : 0;
        if (this.leaves) this.leaves.set([tx, ty, bx, by, fx, fy], 6 * this.triangleCount);
        const out = 3 * this.triangleCount++;
        this.triangles[out] = this.indexOf(center);
        this.triangles[out + 2 - isClockwise] = this.indexOf(near);
        this.triangles[out + 1 + isClockwise] = this.sharedIndex(x, y, q);
    }

    walkBlock(level, i, j, ...amounts) {
        const n = this.n, last = n - 1, corner = [0, last, last * n, last * n + last];
        const c = i & 1 | (j & 1) << 1, center = 3 - c;
        const halves = level === 0 ? [[1, 0, 3], [2, 3, 0]] : [[c ^ 1, center, c], [c ^ 2, c, center]];
        halves.forEach(([a, from, to], h) => {
            if (amounts[h] === QUARTER) {
                this.walkQuarter(level, corner[a], corner[center], corner[c]);
                return;
            }
            const x = (v) => v & 1, y = (v) => v >> 1;
            const cross = (x(from) - x(a)) * (y(to) - y(a)) - (x(to) - x(a)) * (y(from) - y(a));
            this.walkChild(amounts[h], corner[a], corner[from], corner[to], 2 * this.k, cross < 0 ? 1 : 0);
        });
    }
}

/** Zero bytes that must follow a payload: what one block can read beyond it. */
export function slackOf(k) {
    return 4 * (2 ** k + 1) ** 2 + 64;
}
