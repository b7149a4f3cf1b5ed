// morph.test.mjs - what src/web/morph.js promises of the union of two meshes, by brute force at every sample.
import assert from 'node:assert/strict';
import {test} from 'node:test';
import {metresOf} from '../../src/web/header.js';
import {morphMeshes} from '../../src/web/morph.js';
import {decodeMesh} from '../../src/web/wire.js';
import {recordsOf} from './oracle.mjs';

const terrains = new Map();
for (const {name, bytes} of recordsOf('morph')) {
    const [, terrain, what, eps] = name.match(/^(.*) (eps|view) (\d+)$/);
    if (!terrains.has(terrain)) terrains.set(terrain, []);
    terrains.get(terrain).push({name, eps: what === 'eps' ? Number(eps) : NaN, mesh: decodeMesh(bytes, {leaves: true})});
}

/** Calls what(terrain, a, b, union, exact) for every pair of meshes of every terrain. */
function forPairs(what) {
    let pairs = 0, called = 0;
    for (const [terrain, meshes] of terrains)
        for (const a of meshes)
            for (const b of meshes) {
                if (a === b && a.eps !== 8) continue;
                if (pairs++ % 3) continue; // a third of them
                what(`${a.name} to ${b.name}`, a, b, morphMeshes(a.mesh, b.mesh), meshes[0].mesh, terrain);
                called++;
            }
    return called;
}

/**
 * The heights of a surface at every sample, NaN where it has none, and how far copies of one sample differ.
 * Triangles in whose boxes a sample of `without` is do not count.
 */
function surfaceOf({width, height, col, row, triangles}, z, without = null) {
    const heights = new Float64Array(width * height).fill(NaN), samples = Array.from(heights, (_, at) => at);
    const samplesIn = (x0, x1, y0, y1) => samples.slice(y0 * width, (y1 + 1) * width).filter((at) => at % width >= x0 && at % width <= x1);
    let most = 0;
    for (let t = 0; t < triangles.length; t += 3) {
        const [a, b, c] = triangles.subarray(t, t + 3);
        const area = (col[b] - col[a]) * (row[c] - row[a]) - (col[c] - col[a]) * (row[b] - row[a]);
        const lowX = Math.min(col[a], col[b], col[c]), highX = Math.max(col[a], col[b], col[c]);
        const lowY = Math.min(row[a], row[b], row[c]), highY = Math.max(row[a], row[b], row[c]);
        if (without && samplesIn(lowX, highX, lowY, highY).some((at) => without.has(at))) continue;
        const stepX = (row[c] - row[a]) / area, stepV = (row[a] - row[b]) / area;
        for (let y = lowY; y <= highY; y++)
            for (let x = lowX; x <= highX; x++) {
                const u = (x - col[a]) * stepX - (col[c] - col[a]) * (y - row[a]) / area;
                const v = (col[b] - col[a]) * (y - row[a]) / area + (x - col[a]) * stepV;
                if (u < -1e-12 || v < -1e-12 || u + v > 1 + 1e-12) continue;
                const here = z[a] + u * (z[b] - z[a]) + v * (z[c] - z[a]), at = y * width + x, off = Math.abs(here - heights[at]);
                if (off > most) most = off;
                heights[at] = here;
            }
    }
    return {heights, most};
}

const mixed = (union, t) => union.zFrom.map((z, i) => (1 - t) * z + t * union.zTo[i]);
const isClamped = ({width, height, K}) => width - 1 < 2 ** K || height - 1 < 2 ** K;

/** Does something that depends on a sample lie past the last column or row? */
function isNearEnd({width, height, K}, x, y) {
    const side = 2 ** K, q = (x | y) === 0 ? side : (x | y) & -(x | y), far = (x & q && y & q ? 3 : 2) * q;
    return width - 1 < side && x + far > width - 1 || height - 1 < side && y + far > height - 1;
}

test('F35_a_geomorph_is_continuous_at_both_ends: t = 0 is a\'s surface and t = 1 b\'s, at every sample; between them each is mixed with the other', () => {
    const pairs = forPairs((name, a, b, union, exact) => {
        if (isClamped(exact)) return;
        const before = surfaceOf(a.mesh, a.mesh.q).heights, after = surfaceOf(b.mesh, b.mesh.q).heights;
        for (const t of [0, 0.375, 1]) {
            const {heights, most} = surfaceOf(union, mixed(union, t));
            assert.ok(most < 1e-9, `${name} at ${t}: a crack of ${most}`);
            heights.forEach((z, i) => {
                const expected = Number.isNaN(before[i]) ? after[i] : Number.isNaN(after[i]) ? before[i] : (1 - t) * before[i] + t * after[i];
                // Where only one has a surface, its vertices may take part in the other's move.
                if (Math.abs(z - expected) >= 1e-9 && !Number.isNaN(before[i] + after[i]) || Number.isNaN(z) !== Number.isNaN(expected))
                    assert.fail(`${name} at ${t}, sample ${i}: ${z}, not ${expected}`);
            });
        }
    });
    assert.ok(pairs > 100, pairs);
});

test('no sample is ever further off than the mixture of what both promise', () => {
    let samples = 0;
    forPairs((name, a, b, union, exact) => {
        if (!(a.eps >= 0 && b.eps >= 0)) return;
        const truth = surfaceOf(exact, exact.q).heights, surfaces = [a, b].map(({mesh}) => surfaceOf(mesh, mesh.q).heights);
        for (const t of [0, 0.25, 1]) {
            const {heights, most} = surfaceOf(union, mixed(union, t)), allowed = (1 - t) * a.eps + t * b.eps;
            assert.ok(most < 1e-9, `${name} at ${t}: a crack of ${most}`);
            heights.forEach((z, i) => {
                if (Number.isNaN(truth[i] + surfaces[0][i] + surfaces[1][i])) return; // one of them promises nothing there
                const off = Math.abs(metresOf(exact, z) - metresOf(exact, truth[i]));
                if (!(off <= allowed + 1e-9)) assert.fail(`${name} at ${t}, sample ${i}: ${off}, not ${allowed}`);
                samples++;
            });
        }
    });
    assert.ok(samples > 100000, samples);
});

test('near the end of a clamped raster vertices have their own heights; all that none of these disturbs lie on both surfaces', () => {
    let own = 0, others = 0;
    forPairs((name, a, b, union, exact) => {
        if (!isClamped(exact)) return;
        const truth = surfaceOf(exact, exact.q).heights, near = new Set();
        const sampleOf = (i) => union.row[i] * exact.width + union.col[i];
        for (let i = 0; i < union.vertexCount; i++) {
            if (isNearEnd(exact, union.col[i], union.row[i])) near.add(i);
        }
        [[a.mesh, union.from, union.zFrom], [b.mesh, union.to, union.zTo]].forEach(([mesh, numbers, z]) => {
            const disturbed = new Set([...near].filter((i) => numbers[i] < 0).map(sampleOf));
            const surface = surfaceOf(mesh, mesh.q, disturbed).heights;
            for (let i = 0; i < union.vertexCount; i++) {
                const isOwn = near.has(i) && (union.from[i] >= 0 || union.to[i] >= 0); // it may be in neither where these leave something out
                const expected = isOwn ? truth[sampleOf(i)] : surface[sampleOf(i)];
                if (Number.isNaN(expected)) continue;
                if (Math.abs(z[i] - expected) >= 1e-9) assert.fail(`${name}, vertex ${union.col[i]} ${union.row[i]}: ${z[i]}, not ${expected}`);
                if (isOwn) own++;
                else others++;
            }
        });
    });
    assert.ok(own > 3000 && others > 3000, `${own} ${others}`);
});

test('the union has no crack, no overlap, no T-junction, and the area of both', () => {
    forPairs((name, a, b, union) => {
        const {width, height, col, row, triangles} = union, edges = new Map(), vertices = new Set();
        for (let i = 0; i < union.vertexCount; i++) vertices.add(row[i] * width + col[i]);
        assert.equal(vertices.size, union.vertexCount, `${name}: a sample is more than one vertex`);
        let twice = 0;
        for (let t = 0; t < triangles.length; t += 3) {
            const [i, j, k] = triangles.subarray(t, t + 3);
            const area = (col[k] - col[i]) * (row[j] - row[i]) - (col[j] - col[i]) * (row[k] - row[i]);
            if (!(area > 0)) assert.fail(`${name}: triangle ${t / 3} is not counter-clockwise`);
            twice += area;
            for (const [v, w] of [[i, j], [j, k], [k, i]]) {
                if (edges.has(v * union.vertexCount + w)) assert.fail(`${name}: two triangles on one side of an edge`);
                edges.set(v * union.vertexCount + w, [v, w]);
            }
        }
        for (const [i, j] of edges.values()) {
            if (edges.has(j * union.vertexCount + i)) continue; // on both sides
            const dx = col[j] - col[i], dy = row[j] - row[i];
            let steps = Math.abs(dx), rest = Math.abs(dy);
            while (rest) [steps, rest] = [rest, steps % rest];
            for (let s = 1; s < steps; s++)
                if (vertices.has((row[i] + dy / steps * s) * width + col[i] + dx / steps * s)) assert.fail(`${name}: a vertex in an edge at ${col[i]} ${row[i]}`);
        }
        const areaOf = (mesh) => mesh.triangles.reduce((sum, _, t) => t % 3 ? sum : sum + Math.abs(
            (mesh.col[mesh.triangles[t + 1]] - mesh.col[mesh.triangles[t]]) * (mesh.row[mesh.triangles[t + 2]] - mesh.row[mesh.triangles[t]]) -
            (mesh.col[mesh.triangles[t + 2]] - mesh.col[mesh.triangles[t]]) * (mesh.row[mesh.triangles[t + 1]] - mesh.row[mesh.triangles[t]])), 0);
        const areas = [areaOf(a.mesh), areaOf(b.mesh)];
        assert.ok(twice >= Math.max(...areas) && twice <= areas[0] + areas[1], `${name}: ${twice}, of ${areas}`);
        if (areas.every((area) => area === 2 * (width - 1) * (height - 1))) assert.equal(twice, areas[0], name);
    });
});

test('vertices of a and b are there, at their own heights', () => {
    forPairs((name, a, b, union) => {
        const {from, to} = union;
        for (const [mesh, numbers, z] of [[a.mesh, from, union.zFrom], [b.mesh, to, union.zTo]]) {
            const found = new Set(numbers.filter((v) => v >= 0)), isWhole = !/void|view|window/.test(name);
            for (let v = 0; v < mesh.vertexCount; v++) {
                // Where outlines meet the raster's end, the clamped leaves of the union are others.
                if (!found.has(v) && (isWhole || !isNearEnd(union, mesh.col[v], mesh.row[v]))) assert.fail(`${name}: vertex ${mesh.col[v]} ${mesh.row[v]} is not there`);
            }
            numbers.forEach((v, i) => {
                if (v < 0) return;
                if (union.col[i] !== mesh.col[v] || union.row[i] !== mesh.row[v] || z[i] !== mesh.q[v]) assert.fail(`${name}: vertex ${i} is not ${v}`);
            });
        }
    });
});
