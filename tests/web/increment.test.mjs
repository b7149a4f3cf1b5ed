// increment.test.mjs - src/web/increment.js follows a camera: each step ends in the mesh that SQL gives for that camera.
import assert from 'node:assert/strict';
import {test} from 'node:test';
import {applyIncrement} from '../../src/web/increment.js';
import {sortMesh} from '../../src/web/order.js';
import {decodeMesh} from '../../src/web/wire.js';
import {decodeInC, isSame, recordsOf} from './oracle.mjs';

const records = recordsOf('views');
const steps = [];
for (let i = 0; i < records.length; i += 2) steps.push({name: records[i].name, bytes: records[i].bytes, whole: records[i + 1].bytes});

function assertSame(mesh, expected, name) {
    for (const field of ['vertexCount', 'triangleCount']) assert.equal(mesh[field], expected[field], `${name}: ${field}`);
    for (const field of ['col', 'row', 'q', 'triangles']) assert.ok(isSame(mesh[field], expected[field]), `${name}: ${field}`);
}

test('20 cameras: increments alone end in the mesh of each, numbered as both ends number it', () => {
    const answers = decodeInC(steps.flatMap(({name, bytes}) => name.endsWith(' 0') ? [{what: '0'}, {what: 'I', bytes}] : [{what: 'I', bytes}]));
    let mesh = null, changes = 0;
    steps.forEach(({name, bytes, whole}, i) => {
        if (name.endsWith(' 0')) mesh = null;
        const before = mesh, next = applyIncrement(mesh, bytes);
        mesh = next.mesh;
        assertSame(mesh, answers[i], `${name}, C`);
        const expected = decodeMesh(whole), sorted = sortMesh(expected);
        assertSame(mesh, sorted, `${name}, whole`);
        for (const field of ['x0', 'y0', 'dx', 'dy', 'z0', 'd', 'numerator', 'denominator', 'srid', 'scale', 'offset'])
            assert.equal(mesh[field], expected[field], `${name}: ${field}`);
        assert.match(next.note, /^\S+$/);
        changes += before !== null && mesh.vertexCount !== before.vertexCount;
    });
    assert.ok(changes > 20, `${changes} changes`);
});

test('an increment follows the mesh that came whole', () => {
    let followed = 0;
    for (let i = 1; i < steps.length; i++) {
        if (steps[i].name.endsWith(' 0')) continue;
        const whole = decodeMesh(steps[i - 1].whole), mesh = applyIncrement(whole, steps[i].bytes).mesh;
        assertSame(mesh, sortMesh(decodeMesh(steps[i].whole)), steps[i].name);
        assert.deepEqual([mesh.k, mesh.K, mesh.width, mesh.height], [whole.k, whole.K, whole.width, whole.height]);
        followed++;
    }
    assert.equal(followed, 57);
});

test('an increment of another mesh is refused', () => {
    const mesh = applyIncrement(null, steps[0].bytes).mesh, other = steps.find(({bytes}, i) => i > 1 && bytes[5] === 0 && bytes.length > 200);
    const from = applyIncrement(null, steps[20].bytes).mesh;
    assert.throws(() => applyIncrement(from, other.bytes), /belongs to another mesh/);
    assert.throws(() => applyIncrement(mesh, steps[0].bytes), /belongs to another mesh/);
    assert.throws(() => applyIncrement(null, steps[0].whole), /does not begin with RQTI/);
});
