// format.js - numbers for people, with their units.

const grouped = new Intl.NumberFormat('en', {maximumFractionDigits: 0});

/** 1442401 as 1 442 401, with narrow spaces that do not break. */
export const count = value => grouped.format(value).replace(/,/g, '\u202f');

/** To three significant digits, without an exponent. */
export function plain(value) {
    if (!Number.isFinite(value)) return '\u2013';
    const size = Math.abs(value);
    const text = size >= 100 ? count(Math.round(size)) : String(Number(size.toPrecision(size >= 1 ? 3 : 2)));
    return value < 0 ? `\u2212${text}` : text;
}

export const metres = value =>
    Math.abs(value) >= 10000 ? `${plain(value / 1000)}\u00a0km` : `${plain(value)}\u00a0m`;

export const pixels = value => `${plain(value)}\u00a0px`;

/** A height as a surveyor reads it: to the centimetre. */
export function height(value) {
    const [whole, part] = Math.abs(value).toFixed(2).split('.');
    return `${value < 0 ? '\u2212' : ''}${count(Number(whole))}.${part}\u00a0m`;
}

export function bytes(value) {
    if (value < 1000) return `${value}\u00a0B`;
    return value < 1e6 ? `${plain(value / 1e3)}\u00a0kB` : `${plain(value / 1e6)}\u00a0MB`;
}

export const milliseconds = value => `${plain(Math.max(value, 0.1))}\u00a0ms`;

/** x and y of the CRS: degrees with so many digits behind the point, or units to a tenth. */
export function place(x, y, isSpace, digits) {
    if (!isSpace) return `${x.toFixed(1)}, ${y.toFixed(1)}`;
    const degrees = (value, positive, negative) =>
        `${Math.abs(value).toFixed(digits)}\u00b0\u00a0${value < 0 ? negative : positive}`;
    return `${degrees(y, 'N', 'S')}, ${degrees(x, 'E', 'W')}`;
}
