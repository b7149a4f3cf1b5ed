// wire.test.mjs - src/web/wire.js gives the mesh that the C decoder gives.
import assert from 'node:assert/strict';
import {test} from 'node:test';
import {applyDelta, decodeMesh, normalOf} from '../../src/web/wire.js';
import {decodeInC, isSame, recordsOf} from './oracle.mjs';

const all = recordsOf('wire'), records = all.filter(({what}) => what !== 'X');
const meshes = decodeInC(records);

/** What differs between a mesh and the C decoder's; '' for nothing. */
function difference(mesh, expected) {
    if (!expected) return 'the C decoder says no';
    for (const name of ['vertexCount', 'triangleCount']) if (mesh[name] !== expected[name]) return `${name} ${mesh[name]}, not ${expected[name]}`;
    for (const name of ['col', 'row', 'q', 'triangles', 'errors']) if (!isSame(mesh[name], expected[name])) return name;
    if ((mesh.normals === null) !== (expected.normals === null)) return 'normals';
    for (let i = 0; mesh.normals && i < mesh.vertexCount; i++) {
        const normal = normalOf(mesh.normals[2 * i], mesh.normals[2 * i + 1]);
        for (let c = 0; c < 3; c++) if (Math.fround(normal[c]) !== expected.normals[3 * i + c]) return `normal of ${i}`;
    }
    return '';
}

test('every mesh is the C decoder\'s, bit for bit', () => {
    const whole = records.filter(({what}) => what === 'M'), again = decodeInC(whole.map(({bytes}) => ({what: 'W', bytes})));
    whole.forEach(({name, bytes}, i) => assert.equal(difference(decodeMesh(bytes), again[i]), '', `${name}, without leaves`));
    let vertices = 0, normals = 0, errors = 0;
    records.forEach(({what, name, bytes}, i) => {
        if (what !== 'M') return;
        const mesh = decodeMesh(bytes);
        assert.equal(difference(mesh, meshes[i]), '', name);
        vertices += mesh.vertexCount;
        normals += mesh.normals !== null;
        errors += mesh.errors !== null;
    });
    assert.ok(vertices > 200000 && normals > 20 && errors > 20, `${vertices} vertices, ${normals} ${errors}`);
});

test('increments of rqt_delta end in the C decoder\'s meshes, bit for bit', () => {
    let before = null, steps = 0;
    records.forEach(({what, name, bytes}, i) => {
        const mesh = what === 'M' ? decodeMesh(bytes, {leaves: true}) : applyDelta(before, bytes);
        assert.equal(difference(mesh, meshes[i]), '', name);
        steps += what === 'D';
        before = mesh;
    });
    assert.ok(steps > 50, steps);
});

test('triangles are those of the format indexed, one after the other', () => {
    let compared = 0;
    all.forEach(({what, name, bytes}, i) => {
        if (what !== 'X') return;
        const mesh = decodeMesh(all[i - 1].bytes), view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
        const vertices = view.getUint32(16, true), corners = view.getUint32(24, true);
        assert.deepEqual([vertices, corners], [mesh.vertexCount, 3 * mesh.triangleCount], name);
        for (let c = 0; c < corners; c++, compared++) {
            const v = mesh.triangles[c], at = 128 + 12 * view.getUint32(128 + 12 * vertices + 4 * c, true);
            const seen = [mesh.col[v], mesh.row[v], mesh.q[v]], expected = [0, 4, 8].map((offset) => view.getInt32(at + offset, true));
            if (!isSame(seen, expected)) assert.fail(`${name}, corner ${c}: ${seen}, not ${expected}`);
        }
    });
    assert.ok(compared > 10000, compared);
});
