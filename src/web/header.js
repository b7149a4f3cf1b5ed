/**
 * header.js - what makes places and metres of a mesh's integers: the 80 bytes that a mesh, a mesh in wire format and
 * an increment of a view have in common (src/core/FORMAT.md, "Mesh", offsets 32 to 111).
 */

/** Bytes of a frame, and the offset in a mesh at which it stands. */
export const FRAME_BYTES = 80;

/**
 * @typedef {Object} Frame
 * @property {number} x0     sample (col, row) is at (x0 + col*dx, y0 + row*dy)
 * @property {number} y0
 * @property {number} dx
 * @property {number} dy
 * @property {number} z0     metres = ((z0 + q / d) * (scale * (numerator / denominator)) + offset
 * @property {number} d
 * @property {number} numerator
 * @property {number} denominator
 * @property {number} srid   0 for none
 * @property {number} scale
 * @property {number} offset
 * @property {number} eps    may be infinite
 */

/**
 * The frame at a place of some bytes; null when it is not one. The caller has seen that the bytes are there.
 * @param {DataView} view
 * @param {number} at
 * @returns {Frame|null}
 */
export function readFrame(view, at) {
    const f = {
        x0: view.getFloat64(at, true), y0: view.getFloat64(at + 8, true),
        dx: view.getFloat64(at + 16, true), dy: view.getFloat64(at + 24, true),
        z0: Number(view.getBigInt64(at + 32, true)),
        d: view.getInt32(at + 40, true),
        numerator: view.getInt32(at + 44, true), denominator: view.getInt32(at + 48, true),
        srid: view.getInt32(at + 52, true),
        scale: view.getFloat64(at + 56, true), offset: view.getFloat64(at + 64, true),
        eps: view.getFloat64(at + 72, true),
    };
    const isPlace = [f.x0, f.y0, f.dx, f.dy].every(Number.isFinite) && f.dx !== 0 && f.dy !== 0;
    return isPlace && isUnit(f) && f.eps >= 0 ? f : null;
}

function isUnit(f) {
    const within = (v) => v >= 1 && v <= 2 ** 20;
    const quantum = Math.abs(factorOf(f)) / f.d;
    return within(f.d) && within(f.numerator) && within(f.denominator) && Number.isFinite(f.scale) &&
        Number.isFinite(f.offset) && quantum > 2 ** -200 && quantum < 2 ** 200 && Math.abs(f.z0) < 2 ** 53;
}

/** Metres of a whole unit of height. @param {Frame} f */
export function factorOf(f) {
    return f.scale * (f.numerator / f.denominator);
}

/** Metres of a height, to the last bit those of SQL. @param {Frame} f @param {number} q */
export function metresOf(f, q) {
    return (f.z0 + q / f.d) * factorOf(f) + f.offset;
}
