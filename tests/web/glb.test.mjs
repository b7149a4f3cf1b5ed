// glb.test.mjs - what the service sends as glb, judged by Khronos' validator of glTF: no error and no warning.
import assert from 'node:assert/strict';
import {after, before, test} from 'node:test';
import {requirePackage} from './packages.mjs';
import {Service, sql, TERRAINS} from './serve.mjs';

const validator = requirePackage('gltf-validator');
const FORMATS = ['glb', 'glb+normals', 'glb+quantized', 'glb+quantized+normals'];
const EPS = 25;

let service;
before(async () => { service = await Service.start(); });
after(async () => { await service.stop(); });

/** What the service sends for a terrain; `what` is range or view. */
async function fetchModel(terrain, what, parameters) {
    const response = await fetch(new URL(`/collections/${terrain}/${what}?${new URLSearchParams(parameters)}`, service.url));
    assert.equal(response.status, 200);
    assert.equal(response.headers.get('content-type'), 'model/gltf-binary');
    return new Uint8Array(await response.arrayBuffer());
}

/** The report of a file in which nothing is wrong. */
async function validate(bytes) {
    const report = await validator.validateBytes(bytes, {format: 'glb', maxIssues: 20});
    assert.deepEqual(report.issues.messages.filter(message => message.severity < 2), []);
    assert.deepEqual([report.issues.numErrors, report.issues.numWarnings], [0, 0]);
    return report;
}

/** A camera over the middle of a terrain, looking north-east and down. */
async function cameraOver(terrain) {
    const [{x, y, top, unit}] = await sql(
        `SELECT x0 + width * dx / 2 AS x, y0 + height * dy / 2 AS y, max_z AS top, cell_x AS unit FROM rqt_terrains WHERE name = :terrain`, {terrain});
    return JSON.stringify({eye: [x, y, top + 500], at: [x + 40 * unit, y + 30 * unit, top - 500], fovy: 50, width: 640, height: 480, tau: 3});
}

for (const terrain of Object.keys(TERRAINS)) {
    for (const f of FORMATS) {
        test(`${terrain}: a range as ${f} is valid glTF, with SQL's triangles`, async () => {
            const report = await validate(await fetchModel(terrain, 'range', {eps: EPS, f}));
            const [{triangles}] = await sql('SELECT count(*) AS triangles FROM rqt_triangles(NULL, :eps, :terrain)', {eps: EPS, terrain});
            assert.ok(triangles > 100);
            assert.equal(report.info.totalTriangleCount, triangles);
            assert.deepEqual(report.info.extensionsUsed ?? [], f.includes('quantized') ? ['KHR_mesh_quantization'] : []);
        });
        test(`${terrain}: a view as ${f} is valid glTF, with SQL's triangles`, async () => {
            const camera = await cameraOver(terrain);
            const report = await validate(await fetchModel(terrain, 'view', {camera, f}));
            const [{triangles}] = await sql('SELECT count(*) AS triangles FROM rqt_view_triangles(:camera, :terrain)', {camera, terrain});
            assert.ok(triangles > 10);
            assert.equal(report.info.totalTriangleCount, triangles);
        });
        test(`${terrain}: nothing as ${f} is valid glTF`, async () => {
            const report = await validate(await fetchModel(terrain, 'range', {wkt: 'POINT(0 0.5)', eps: EPS, f}));
            assert.equal(report.info.drawCallCount, 0);
        });
    }
}

for (const options of [{mode: 'cut', wkt: 'POLYGON((-71.4 44.2, -71.2 44.21, -71.3 44.3, -71.4 44.2))'}, {frame: 'enu'}, {frame: 'ecef'}]) {
    for (const f of ['glb', 'glb+quantized']) {
        test(`degrees: ${f} of ${JSON.stringify(options)} is valid glTF`, async () => {
            const report = await validate(await fetchModel('degrees', 'range', {eps: EPS, f, ...options}));
            assert.ok(report.info.totalTriangleCount > 100);
        });
    }
}

test('the judge sees a wrong box, a wrong index and a missing byte', async () => {
    const bytes = await fetchModel('metres', 'range', {eps: EPS, f: 'glb+quantized'});
    const spoil = async change => {
        const report = await validator.validateBytes(change(bytes.slice()), {format: 'glb'});
        return report.issues.numErrors;
    };
    const text = Buffer.from(bytes.buffer).toString('latin1'), at = text.indexOf('"max":[') + 7;
    assert.ok(await spoil(copy => { copy[at] ^= 1; return copy; }) > 0);
    assert.ok(await spoil(copy => { copy.fill(255, copy.length - 12); return copy; }) > 0);
    assert.ok(await spoil(copy => copy.subarray(0, copy.length - 4)) > 0);
});
