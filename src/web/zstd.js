/**
 * zstd.js - one zstd frame (RFC 8878) back into bytes.
 *
 * What comes over the network is hostile until it is decoded, and a decoder for the browser can be made to work for
 * seconds by a few dozen bytes when it believes the lengths of matches. This one believes nothing: a frame says what
 * it stands for, a byte of it for no more than the format lets it (frameOf walks the headers of its blocks, which is
 * cheap); that much is allocated and no more; each literal and match is held against the room that is left before it
 * is copied. So time and memory are proportional to what the frame says it is, and the caller decides whether that is
 * too much. Whatever is wrong ends in an Error with a sentence.
 *
 * Dictionaries are not known. A frame's own checksum, if there is one, is passed over: what is around the frames
 * (wire.js, increment.js) has one of all bytes.
 */

const MAGIC = 0xFD2FB528;
const BLOCK_MOST = 1 << 17;
const CONTENT_MOST = 2 ** 28;

const RAW = 0, RLE = 1, COMPRESSED = 2;
const PREDEFINED = 0, ONE_SYMBOL = 1, DESCRIBED = 2;

/** Bits and least values of the codes of literal lengths and match lengths. */
const LITERAL_BITS = new Uint8Array(36), LITERAL_BASE = new Int32Array(36);
const MATCH_BITS = new Uint8Array(53), MATCH_BASE = new Int32Array(53);
LITERAL_BITS.set([1, 1, 1, 1, 2, 2, 3, 3, 4, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16], 16);
MATCH_BITS.set([1, 1, 1, 1, 2, 2, 3, 3, 4, 4, 5, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16], 32);
for (let i = 0, at = 0; i < 36; at += 1 << LITERAL_BITS[i++]) LITERAL_BASE[i] = at;
for (let i = 0, at = 3; i < 53; at += 1 << MATCH_BITS[i++]) MATCH_BASE[i] = at;

const LITERAL_COUNTS = [4, 3, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2, 2, 2, 3, 2, 1, 1, 1, 1, 1, -1, -1, -1, -1];
const MATCH_COUNTS = [1, 4, 3, 2, 2, 2, 2, 2, 2, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1,
    1, 1, 1, 1, 1, 1, 1, 1, 1, 1, -1, -1, -1, -1, -1, -1, -1];
const OFFSET_COUNTS = [1, 1, 1, 1, 1, 1, 2, 2, 2, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, -1, -1, -1, -1, -1];

/** The three codes of sequences, in the order in which their tables stand. */
const CODES = [
    {counts: LITERAL_COUNTS, log: 6, mostLog: 9, symbols: 36},
    {counts: OFFSET_COUNTS, log: 5, mostLog: 8, symbols: 32},
    {counts: MATCH_COUNTS, log: 6, mostLog: 9, symbols: 53},
].map((code) => ({...code, table: tableOf(code.counts, code.log)}));
const OFFSET_CODE_MOST = 28; // others reach back further than any content

function bad() {
    throw new Error('the compressed bytes are not a zstd frame, or damaged');
}

function highestBit(v) {
    return 31 - Math.clz32(v);
}

function number32(bytes, at) {
    return (bytes[at] | bytes[at + 1] << 8 | bytes[at + 2] << 16 | bytes[at + 3] << 24) >>> 0;
}

/**
 * Where a frame ends and what it says about itself, from the headers of its blocks alone. Nothing is allocated.
 * @param {Uint8Array} bytes
 * @param {number} at  where the frame begins
 * @returns {{end: number, content: number, first: number, blockMost: number}} its end; the bytes it stands for; its first block
 */
export function frameOf(bytes, at) {
    if (bytes.length - at < 9 || number32(bytes, at) !== MAGIC) bad();
    const flags = bytes[at + 4];
    const single = flags >> 5 & 1, sizeFlag = flags >> 6;
    if (flags & 8 || flags & 3) bad(); // reserved; a dictionary
    const sizeBytes = sizeFlag ? 1 << sizeFlag : single;
    if (sizeBytes === 0) throw new Error('the zstd frame does not say how much it stands for');
    let p = at + 5, window = Infinity;
    if (!single) {
        const base = 2 ** (10 + (bytes[p] >> 3));
        window = base + base / 8 * (bytes[p] & 7);
        p++;
    }
    if (p + sizeBytes > bytes.length) bad();
    let content = sizeFlag === 1 ? 256 : 0;
    for (let i = 0; i < sizeBytes; i++) content += bytes[p + i] * 2 ** (8 * i);
    if (single) window = content;
    const first = p += sizeBytes;
    const blockMost = Math.min(BLOCK_MOST, window);
    let most = 0;
    for (let last = 0; !last;) {
        if (p + 3 > bytes.length) bad();
        const header = bytes[p] | bytes[p + 1] << 8 | bytes[p + 2] << 16;
        const type = header >> 1 & 3, size = header >> 3;
        last = header & 1;
        if (type > COMPRESSED || size > blockMost) bad();
        most += type === COMPRESSED ? blockMost : size;
        p += 3 + (type === RLE ? 1 : size);
        if (p > bytes.length) bad();
    }
    if (flags & 4) p += 4; // its checksum
    if (p > bytes.length || content > most) bad();
    return {end: p, content, first, blockMost};
}

/**
 * What a frame stands for, with `slack` zero bytes behind it.
 * @param {Uint8Array} bytes
 * @param {{first: number, content: number, blockMost: number}} frame  from frameOf
 * @param {number} [slack]
 * @returns {Uint8Array} content + slack bytes
 */
export function inflate(bytes, frame, slack = 0) {
    if (frame.content >= CONTENT_MOST) throw new Error('the compressed bytes stand for more than this reader takes: 256 MB');
    const out = new Uint8Array(frame.content + slack);
    const state = {huffman: null, tables: [null, null, null], recent: [1, 4, 8], literals: new Uint8Array(BLOCK_MOST)};
    let at = 0, p = frame.first;
    for (let last = 0; !last;) {
        const header = bytes[p] | bytes[p + 1] << 8 | bytes[p + 2] << 16;
        const type = header >> 1 & 3, size = header >> 3, end = Math.min(frame.content, at + frame.blockMost);
        last = header & 1;
        p += 3;
        if (type === COMPRESSED) {
            at = inflateBlock(bytes, p, p + size, out, at, end, state);
            p += size;
            continue;
        }
        if (at + size > end) bad();
        if (type === RAW) out.set(bytes.subarray(p, p + size), at);
        else out.fill(bytes[p], at, at + size);
        at += size;
        p += type === RAW ? size : 1;
    }
    if (at !== frame.content) bad();
    return out;
}

/* ------------------------------------------------------------------------------------------------ tables -- */

/** A decoding table of finite state entropy, from how often each of the symbols comes: symbol, bits and base of each state. */
function tableOf(counts, log) {
    const size = 1 << log, mask = size - 1, step = (size >> 1) + (size >> 3) + 3;
    const symbol = new Uint8Array(size), bits = new Uint8Array(size), base = new Uint16Array(size), next = new Uint16Array(counts.length);
    let high = size, at = 0;
    for (let s = 0; s < counts.length; s++)
        if (counts[s] === -1) {
            symbol[--high] = s;
            next[s] = 1;
        }
    for (let s = 0; s < counts.length; s++) {
        if (counts[s] < 1) continue;
        next[s] = counts[s];
        for (let i = 0; i < counts[s]; i++) {
            symbol[at] = s;
            do at = (at + step) & mask; while (at >= high);
        }
    }
    if (at !== 0) bad();
    for (let i = 0; i < size; i++) {
        const x = next[symbol[i]]++;
        bits[i] = log - highestBit(x);
        base[i] = (x << bits[i]) - size;
    }
    return {symbol, bits, base, log};
}

/** The table that is described at p, before `end`. */
function readTable(bytes, p, end, mostLog, symbols) {
    if (p >= end) bad();
    const log = (bytes[p] & 15) + 5, counts = [];
    if (log > mostLog) bad();
    let at = 8 * p + 4, left = 1 << log; // 8 * p: below 2^31 for what inflate takes; larger inputs come out as nonsense, in bounds
    while (left > 0 && counts.length < symbols) {
        const width = highestBit(left + 1) + 1, low = (1 << width - 1) - 1, short = (1 << width) - 1 - (left + 1);
        let v = word(bytes, at) & (1 << width) - 1;
        at += width;
        if ((v & low) < short) {
            v &= low;
            at--;
        } else if (v > low) v -= short;
        const count = v - 1;
        left -= Math.abs(count);
        counts.push(count);
        if (count !== 0) continue;
        for (let zeros = 3; zeros === 3;) {
            zeros = word(bytes, at) & 3;
            at += 2;
            for (let i = 0; i < zeros; i++) counts.push(0);
            if (counts.length > symbols) bad();
        }
    }
    const next = Math.floor((at + 7) / 8);
    if (left !== 0 || counts.length > symbols || next > end) bad();
    return {table: tableOf(counts, log), next};
}

/** At least 17 bits from a bit on; what is behind the bytes counts as zero. */
function word(bytes, bit) {
    const p = Math.floor(bit / 8);
    return (bytes[p] | bytes[p + 1] << 8 | bytes[p + 2] << 16) >>> bit % 8;
}

/** Where a stream that is read from its end begins: behind the highest bit of its last byte. In bits from `start`. */
function openBackwards(bytes, start, end) {
    if (start >= end || bytes[end - 1] === 0) bad();
    return 8 * (end - 1 - start) + highestBit(bytes[end - 1]);
}

/** The bits [at, at + count) of the bytes from `start` on; count <= 16. at may be negative: those are rejected afterwards. */
function bitsAt(bytes, start, at, count) {
    const p = start + (at >> 3);
    return ((bytes[p] | bytes[p + 1] << 8 | bytes[p + 2] << 16) >>> (at & 7)) & (1 << count) - 1;
}

/** The Huffman code described at p: for each word of `log` bits the symbol, and 256 times the bits it takes. */
function readHuffman(bytes, p, end) {
    if (p >= end) bad();
    const weights = new Uint8Array(256), header = bytes[p++];
    let count = 0;
    if (header < 128) {
        const stop = p + header;
        if (stop > end) bad();
        const {table, next} = readTable(bytes, p, stop, 6, 12);
        let at = openBackwards(bytes, next, stop) - 2 * table.log;
        if (at < 0) bad();
        let state = bitsAt(bytes, next, at + table.log, table.log), other = bitsAt(bytes, next, at, table.log);
        while (count < 255) {
            weights[count++] = table.symbol[state];
            at -= table.bits[state];
            if (at < 0) { // the last one: what the other state stands for
                weights[count++] = table.symbol[other];
                break;
            }
            const following = table.base[state] + bitsAt(bytes, next, at, table.bits[state]);
            state = other;
            other = following;
        }
        if (at >= 0 || count > 255) bad();
        p = stop;
    } else {
        count = header - 127;
        for (let i = 0; i < count; i++) weights[i] = i & 1 ? bytes[p + (i >> 1)] & 15 : bytes[p + (i >> 1)] >> 4;
        p += count + 1 >> 1;
        if (p > end) bad();
    }
    let sum = 0;
    for (let i = 0; i < count; i++) {
        if (weights[i] > 11) bad();
        sum += weights[i] ? 1 << weights[i] - 1 : 0;
    }
    if (sum === 0) bad();
    const log = highestBit(sum) + 1, rest = (1 << log) - sum;
    if (log > 11 || rest & rest - 1) bad();
    weights[count++] = highestBit(rest) + 1;
    const table = new Uint16Array(1 << log);
    let at = 0;
    for (let weight = 1; weight <= log; weight++)
        for (let symbol = 0; symbol < count; symbol++)
            if (weights[symbol] === weight) {
                table.fill(symbol | log + 1 - weight << 8, at, at + (1 << weight - 1));
                at += 1 << weight - 1;
            }
    if (at !== 1 << log) bad();
    return {code: {table, log}, next: p};
}

/* ------------------------------------------------------------------------------------------------ blocks -- */

/** One stream of Huffman codes, read from its end: exactly the literals from `at` to `stop`. */
function readLiterals(bytes, start, end, {table, log}, out, at, stop) {
    const mask = (1 << log) - 1;
    let pos = openBackwards(bytes, start, end) - log;
    for (; at < stop; at++) {
        const p = start + (pos >> 3);
        const entry = table[(bytes[p] | bytes[p + 1] << 8 | bytes[p + 2] << 16) >>> (pos & 7) & mask];
        out[at] = entry;
        pos -= entry >> 8;
        if (pos < -log) bad();
    }
    if (pos !== -log) bad();
}

/** The block's literals into state.literals; how many, and what follows them. */
function readLiteralsSection(bytes, p, end, most, state) {
    if (p >= end) bad();
    const type = bytes[p] & 3, format = bytes[p] >> 2 & 3;
    if (type < COMPRESSED) {
        const long = format & 1 ? format === 3 ? 3 : 2 : 1;
        if (p + long > end) bad();
        const count = long === 1 ? bytes[p] >> 3 : long === 2 ? (bytes[p] | bytes[p + 1] << 8) >> 4
            : (bytes[p] | bytes[p + 1] << 8 | bytes[p + 2] << 16) >> 4;
        p += long;
        const next = p + (type === RAW ? count : 1);
        if (count > most || next > end) bad();
        if (type === RAW) state.literals.set(bytes.subarray(p, next));
        else state.literals.fill(bytes[p], 0, count);
        return {count, next};
    }
    const width = format < 2 ? 10 : format === 2 ? 14 : 18, long = 2 + Math.max(1, format);
    if (p + long > end) bad();
    let header = 0;
    for (let i = 0; i < long; i++) header += bytes[p + i] * 2 ** (8 * i);
    header = Math.floor(header / 16);
    const count = header % (1 << width), next = p + long + Math.floor(header / (1 << width));
    p += long;
    if (count > most || next > end) bad();
    if (type === COMPRESSED) {
        const read = readHuffman(bytes, p, next);
        state.huffman = read.code;
        p = read.next;
    }
    if (!state.huffman) bad();
    if (format === 0) {
        readLiterals(bytes, p, next, state.huffman, state.literals, 0, count);
        return {count, next};
    }
    if (p + 6 > next) bad();
    const each = count + 3 >> 2;
    let from = p + 6;
    for (let i = 0; i < 4; i++) {
        const to = i === 3 ? next : from + (bytes[p + 2 * i] | bytes[p + 2 * i + 1] << 8);
        const stop = i === 3 ? count : (i + 1) * each;
        if (to > next || stop > count) bad();
        readLiterals(bytes, from, to, state.huffman, state.literals, i * each, stop);
        from = to;
    }
    return {count, next};
}

/** The block [p, end) to out[at .. stop) at most; where it ends there. */
function inflateBlock(bytes, p, end, out, at, stop, state) {
    const literals = readLiteralsSection(bytes, p, end, stop - at, state);
    p = literals.next;
    if (p >= end) bad();
    let sequences = bytes[p++];
    if (sequences === 255) {
        sequences = (bytes[p] | bytes[p + 1] << 8) + 0x7F00;
        p += 2;
    } else if (sequences > 127) sequences = (sequences - 128 << 8) + bytes[p++];
    let used = 0;
    if (sequences > 0) {
        if (p >= end || bytes[p] & 3) bad();
        const modes = bytes[p++];
        for (let i = 0; i < 3; i++) {
            const mode = modes >> 6 - 2 * i & 3, code = CODES[i];
            if (mode === PREDEFINED) state.tables[i] = code.table;
            else if (mode === ONE_SYMBOL) {
                if (p >= end || bytes[p] >= code.symbols) bad();
                state.tables[i] = {symbol: bytes.slice(p, p + 1), bits: new Uint8Array(1), base: new Uint16Array(1), log: 0};
                p++;
            } else if (mode === DESCRIBED) {
                const read = readTable(bytes, p, end, code.mostLog, code.symbols);
                state.tables[i] = read.table;
                p = read.next;
            } else if (!state.tables[i]) bad();
        }
        const done = runSequences(bytes, p, end, sequences, out, at, stop, literals.count, state);
        at = done.at;
        used = done.used;
    } else if (p !== end) bad();
    const rest = literals.count - used;
    if (rest > stop - at) bad();
    out.set(state.literals.subarray(used, used + rest), at);
    return at + rest;
}

function runSequences(bytes, start, end, count, out, at, stop, available, state) {
    const [lengths, offsets, matches] = state.tables, literals = state.literals;
    let pos = openBackwards(bytes, start, end) - lengths.log;
    let l = bitsAt(bytes, start, pos, lengths.log);
    let o = bitsAt(bytes, start, pos -= offsets.log, offsets.log);
    let m = bitsAt(bytes, start, pos -= matches.log, matches.log);
    let [recent, second, third] = state.recent, used = 0;
    for (let i = 0; i < count; i++) {
        const offsetCode = offsets.symbol[o], matchCode = matches.symbol[m], lengthCode = lengths.symbol[l];
        if (offsetCode > OFFSET_CODE_MOST) bad();
        let more = offsetCode, value = 1 << offsetCode;
        if (more > 14) {
            more -= 14;
            value += bitsAt(bytes, start, pos -= 14, 14) << more;
        }
        value += bitsAt(bytes, start, pos -= more, more);
        const match = MATCH_BASE[matchCode] + bitsAt(bytes, start, pos -= MATCH_BITS[matchCode], MATCH_BITS[matchCode]);
        const length = LITERAL_BASE[lengthCode] + bitsAt(bytes, start, pos -= LITERAL_BITS[lengthCode], LITERAL_BITS[lengthCode]);
        if (i < count - 1) {
            l = lengths.base[l] + bitsAt(bytes, start, pos -= lengths.bits[l], lengths.bits[l]);
            m = matches.base[m] + bitsAt(bytes, start, pos -= matches.bits[m], matches.bits[m]);
            o = offsets.base[o] + bitsAt(bytes, start, pos -= offsets.bits[o], offsets.bits[o]);
        }
        if (pos < 0) bad();

        let offset;
        if (value > 3) {
            offset = value - 3;
            third = second;
            second = recent;
        } else {
            const which = value - 1 + (length === 0 ? 1 : 0);
            offset = which === 0 ? recent : which === 1 ? second : which === 2 ? third : recent - 1;
            if (which > 1) third = second;
            if (which > 0) second = recent;
        }
        recent = offset;
        if (used + length > available || length + match > stop - at || offset < 1 || offset > at + length) bad();
        for (const to = at + length; at < to;) out[at++] = literals[used++];
        if (match > 64 && offset >= match) {
            out.copyWithin(at, at - offset, at - offset + match);
            at += match;
        } else for (const to = at + match; at < to; at++) out[at] = out[at - offset];
    }
    if (pos !== 0) bad();
    state.recent = [recent, second, third];
    return {at, used};
}
