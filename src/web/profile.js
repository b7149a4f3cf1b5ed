// profile.js - the terrain along a line, as a chart: distance to the right and heights upward, both in metres.

import {height as exactly, metres, plain} from './format.js';

const NAMESPACE = 'http://www.w3.org/2000/svg';
const MARGIN = {left: 58, right: 10, top: 8, bottom: 22};

function svg(name, attributes, text) {
    const node = document.createElementNS(NAMESPACE, name);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    if (text !== undefined) node.textContent = text;
    return node;
}

/** Round numbers from low to high, about `many`. */
export function ticksOf(low, high, many) {
    const raw = (high - low) / many || 1, power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].find(factor => factor * power >= raw) * power, ticks = [];
    for (let i = Math.ceil(low / step); i * step <= high * (1 + 1e-12); i++) ticks.push(i * step);
    return ticks;
}

/** The runs of rows that have a height. */
export function runsOf(rows) {
    const runs = [[]];
    for (const row of rows)
        if (row[3] === null) runs.push([]);
        else runs[runs.length - 1].push(row);
    return runs.filter(run => run.length > 1);
}

/** The row at a distance: heights between two rows are those of the plane that they lie on. */
function rowAt(rows, distance) {
    let i = rows.findIndex(row => row[0] >= distance);
    if (i < 0) i = rows.length - 1;
    if (i === 0) return rows[0];
    const [a, b] = [rows[i - 1], rows[i]], t = b[0] > a[0] ? (distance - a[0]) / (b[0] - a[0]) : 0;
    if (a[3] === null || b[3] === null) return [distance, a[1] + (b[1] - a[1]) * t, a[2] + (b[2] - a[2]) * t, null];
    return a.map((value, column) => value + (b[column] - value) * t);
}

export class Profile {
    /**
     * @param section where the chart is
     * @param hooks {pointed(row or null), closed()}
     */
    constructor(section, hooks) {
        Object.assign(this, {section, hooks, rows: null, at: null});
        new ResizeObserver(() => this.rows && this.draw()).observe(section);
    }

    show(rows) {
        this.rows = rows;
        this.at = null;
        this.section.hidden = false;
        const close = document.createElement('button');
        close.setAttribute('aria-label', 'Close the profile');
        close.textContent = '\u00d7';
        close.addEventListener('click', () => this.hooks.closed());
        this.reading = document.createElement('span');
        this.reading.setAttribute('aria-live', 'polite');
        const head = document.createElement('div');
        head.className = 'head';
        head.append(this.reading, close);
        this.chart = svg('svg', {tabindex: 0, role: 'img', 'aria-label': 'Heights along the line; arrow keys read them'});
        this.chart.addEventListener('pointermove', event => this.pointTo(event.offsetX));
        this.chart.addEventListener('pointerdown', event => this.pointTo(event.offsetX));
        this.chart.addEventListener('pointerleave', () => this.point(null));
        this.chart.addEventListener('keydown', event => this.key(event));
        this.section.replaceChildren(head, this.chart);
        this.draw();
    }

    hide() {
        this.rows = null;
        this.section.hidden = true;
        this.section.replaceChildren();
    }

    draw() {
        const {width, height} = this.chart.getBoundingClientRect(), {rows} = this;
        if (!(width > 120 && height > 60)) return;
        const heights = rows.map(row => row[3]).filter(z => z !== null), length = rows[rows.length - 1][0];
        let low = Math.min(...heights), high = Math.max(...heights);
        const slack = Math.max(0.5, (high - low) * 0.06);
        low -= slack;
        high += slack;
        const x = distance => MARGIN.left + distance / length * (width - MARGIN.left - MARGIN.right);
        const y = z => MARGIN.top + (high - z) / (high - low) * (height - MARGIN.top - MARGIN.bottom);
        Object.assign(this, {x, y, width, height, length});
        const parts = [], foot = height - MARGIN.bottom;
        ticksOf(low, high, (height - 30) / 34).forEach((z, i, all) => {
            const label = i === all.length - 1 ? `${plain(z)}\u00a0m` : plain(z);
            parts.push(svg('line', {class: 'grid', x1: MARGIN.left, x2: width - MARGIN.right, y1: y(z), y2: y(z)}));
            parts.push(svg('text', {x: MARGIN.left - 6, y: y(z) + 4, 'text-anchor': 'end'}, label));
        });
        const inKilometres = length >= 3000;
        const ticks = ticksOf(0, length, width / 110);
        ticks.forEach((distance, i) => {
            const isLast = i === ticks.length - 1, label = plain(inKilometres ? distance / 1000 : distance);
            const anchor = i === 0 ? 'start' : x(distance) > width - 30 ? 'end' : 'middle';
            parts.push(svg('line', {class: 'grid', x1: x(distance), x2: x(distance), y1: foot, y2: foot + 4}));
            parts.push(svg('text', {x: x(distance), y: height - 6, 'text-anchor': anchor},
                isLast ? `${label}\u00a0${inKilometres ? 'km' : 'm'}` : label));
        });
        for (const run of runsOf(rows)) {
            const path = run.map(row => `${x(row[0]).toFixed(1)},${y(row[3]).toFixed(1)}`).join('L');
            const from = x(run[0][0]).toFixed(1), to = x(run[run.length - 1][0]).toFixed(1);
            parts.push(svg('path', {class: 'area', d: `M${from},${foot}L${path}L${to},${foot}Z`}));
            parts.push(svg('path', {class: 'curve', d: `M${path}`}));
        }
        this.hair = svg('g', {});
        this.chart.replaceChildren(...parts, this.hair);
        this.point(this.at);
    }

    pointTo(pixel) {
        const share = (pixel - MARGIN.left) / (this.width - MARGIN.left - MARGIN.right);
        this.point(Math.min(1, Math.max(0, share)) * this.length);
    }

    /** Reads the chart at a distance; null: as a whole. */
    point(distance) {
        this.at = distance;
        const row = distance === null ? null : rowAt(this.rows, distance);
        this.hooks.pointed(row && row[3] !== null ? row : null);
        if (!row) {
            const heights = this.rows.map(one => one[3]).filter(z => z !== null);
            const climbs = runsOf(this.rows).flatMap(run => run.slice(1).map((one, i) => one[3] - run[i][3]));
            const sum = sign => climbs.reduce((total, climb) => total + Math.max(0, sign * climb), 0);
            this.hair.replaceChildren();
            this.reading.textContent = `${metres(this.length)} long, ${plain(Math.min(...heights))} to ` +
                `${plain(Math.max(...heights))}\u00a0m, ${metres(sum(1))} up, ${metres(sum(-1))} down`;
            return;
        }
        const at = this.x(distance);
        this.hair.replaceChildren(svg('line', {class: 'hair', x1: at, x2: at, y1: MARGIN.top, y2: this.height - MARGIN.bottom}));
        if (row[3] !== null) this.hair.append(svg('circle', {class: 'dot', cx: at, cy: this.y(row[3]), r: 5}));
        this.reading.textContent = `${metres(distance)}: ${row[3] === null ? 'no data' : exactly(row[3])}`;
    }

    key(event) {
        const by = {ArrowLeft: -1, ArrowRight: 1}[event.key];
        if (!by) return;
        event.preventDefault();
        event.stopPropagation();
        const step = this.length / (event.shiftKey ? 20 : 200);
        this.point(Math.min(this.length, Math.max(0, (this.at ?? 0) + by * step)));
    }
}
