/**
 * checksum.js - the project's 64-bit checksum and digests (src/core/FORMAT.md, "Checksum") in 32-bit halves.
 *
 * JavaScript has no fast 64-bit integers: a BigInt is an object. The running value is two numbers, low and high; a
 * product of the two low halves is made of 16-bit ones, as doubles hold it exactly.
 */

const FOLD_LOW = 0x27D4EB4F, FOLD_HIGH = 0xC2B2AE3D | 0;
const SIZE_LOW = 0xED558CCD | 0, SIZE_HIGH = 0xFF51AFD7 | 0;
const SEED_LOW = 0x7F4A7C15, SEED_HIGH = 0x9E3779B9 | 0;

/** The high half of the product of two unsigned 32-bit numbers. */
function multiplyHigh(a, b) {
    const a0 = a & 0xFFFF, a1 = a >>> 16, b0 = b & 0xFFFF, b1 = b >>> 16;
    const middle = a0 * b1 + (Math.imul(a0, b0) >>> 16); // below 2^32
    const other = a1 * b0 + (middle & 0xFFFF);           // too
    return a1 * b1 + (middle >>> 16) + (other >>> 16) | 0;
}

/** A running 64-bit value that words are folded into. */
export class Fold {
    /** @param {number} count  what the value begins with: a number of bytes or vertices, below 2^53 */
    constructor(count) {
        const low = count | 0, high = Math.floor(count / 2 ** 32) | 0;
        this.low = Math.imul(low, SIZE_LOW) ^ SEED_LOW;
        this.high = multiplyHigh(low, SIZE_LOW) + Math.imul(low, SIZE_HIGH) + Math.imul(high, SIZE_LOW) ^ SEED_HIGH;
    }

    /** Fold the word high * 2^32 + low into it; both are taken modulo 2^32. */
    add(high, low) {
        const l = this.low ^ low, h = this.high ^ high;
        const productLow = Math.imul(l, FOLD_LOW);
        const productHigh = multiplyHigh(l, FOLD_LOW) + Math.imul(l, FOLD_HIGH) + Math.imul(h, FOLD_LOW) | 0;
        this.high = productHigh << 29 | productLow >>> 3;
        this.low = productLow << 29 | productHigh >>> 3;
    }

    /** @returns {{high: number, low: number}} the result, in unsigned halves */
    end() {
        const l = this.low ^ this.high, h = this.high;
        const low = Math.imul(l, SIZE_LOW);
        const high = multiplyHigh(l, SIZE_LOW) + Math.imul(l, SIZE_HIGH) + Math.imul(h, SIZE_LOW) | 0;
        return {high: (high ^ high >>> 29) >>> 0, low: (low ^ (low >>> 29 | high << 3)) >>> 0};
    }
}

/**
 * Is the checksum that stands at `at` (a multiple of 8) the one of all bytes, that field taken as zero?
 * @param {Uint8Array} bytes
 * @param {number} at
 */
export function checksumIsRight(bytes, at) {
    const fold = new Fold(bytes.length);
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    const whole = bytes.length - bytes.length % 8;
    for (let i = 0; i < whole; i += 8)
        if (i === at) fold.add(0, 0);
        else fold.add(view.getInt32(i + 4, true), view.getInt32(i, true));
    if (whole < bytes.length) {
        const last = new Uint8Array(8);
        last.set(bytes.subarray(whole));
        const word = new DataView(last.buffer);
        fold.add(word.getInt32(4, true), word.getInt32(0, true));
    }
    const {high, low} = fold.end();
    return view.getUint32(at, true) === low && view.getUint32(at + 4, true) === high;
}
