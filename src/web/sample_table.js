/**
 * sample_table.js - what is known of a sample, or of a lattice vertex, by its column and row: a height and an index.
 *
 * Open addressing over typed arrays: a Map would make an object of every key. Never more than half full.
 */

export class SampleTable {
    /** @param {number} [room]  entries expected */
    constructor(room = 128) {
        this.count = 0;
        this.take(2 ** Math.max(8, Math.ceil(Math.log2(2 * room))));
    }

    take(size) {
        this.mask = size - 1;
        this.col = new Int32Array(size).fill(-1); // -1: empty
        this.row = new Int32Array(size);
        this.q = new Int32Array(size);
        this.index = new Int32Array(size);
    }

    slot(col, row) {
        let h = Math.imul(col, 0x9E3779B1) ^ Math.imul(row, 0x85EBCA6B);
        h = Math.imul(h ^ h >>> 15, 0x2C1B3C6D);
        let at = (h ^ h >>> 13) & this.mask;
        while (this.col[at] !== -1 && (this.col[at] !== col || this.row[at] !== row)) at = at + 1 & this.mask;
        return at;
    }

    /** The place of an entry in q and index, -1 when there is none. It holds until the next add. */
    find(col, row) {
        const at = this.slot(col, row);
        return this.col[at] === -1 ? -1 : at;
    }

    /** Adds an entry, or overwrites the one that is there. */
    add(col, row, q, index) {
        const at = this.slot(col, row);
        if (this.col[at] === -1) this.count++;
        this.col[at] = col;
        this.row[at] = row;
        this.q[at] = q;
        this.index[at] = index;
        if (2 * this.count > this.mask) this.grow();
    }

    /** The index of an entry; when there is none it is added, with this index. */
    indexOf(col, row, index) {
        const at = this.slot(col, row);
        if (this.col[at] !== -1) return this.index[at];
        this.count++;
        this.col[at] = col;
        this.row[at] = row;
        this.index[at] = index;
        if (2 * this.count > this.mask) this.grow();
        return index;
    }

    grow() {
        const old = {...this};
        this.take(2 * (this.mask + 1));
        for (let i = 0; i < old.col.length; i++) {
            if (old.col[i] === -1) continue;
            const to = this.slot(old.col[i], old.row[i]);
            this.col[to] = old.col[i];
            this.row[to] = old.row[i];
            this.q[to] = old.q[i];
            this.index[to] = old.index[i];
        }
    }
}
