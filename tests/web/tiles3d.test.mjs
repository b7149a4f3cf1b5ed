// tiles3d.test.mjs - the contents of 3D Tiles, judged by Khronos' validator of glTF: no error and no warning in any tile.
import assert from 'node:assert/strict';
import {execFileSync} from 'node:child_process';
import {mkdtempSync, readFileSync, readdirSync, rmSync} from 'node:fs';
import {join} from 'node:path';
import {after, test} from 'node:test';
import {BUILD, ROOT, requirePackage} from './packages.mjs';

const validator = requirePackage('gltf-validator');
const RQT = process.env.RQT || join(BUILD, 'rqt');
const home = mkdtempSync(join(ROOT, 'build', 'web-tests', 'tiles3d-'));
after(() => rmSync(home, {recursive: true}));

for (const [name, levels] of [['eastafrica.tif', 3], ['etopo1_1deg.tif', 3], ['glarus_1arc_native_161.tif', 2]])
    test(`${name}: every tile is valid glTF`, async () => {
        const database = join(home, `${name}.gpkg`), folder = join(home, name);
        execFileSync(RQT, ['import', join(ROOT, 'tests', 'data', name), database], {stdio: 'pipe'});
        execFileSync(RQT, ['tiles', database, '--kind', '3d-tiles', '-o', folder], {stdio: 'pipe'});
        const files = readdirSync(join(folder, 'content'), {recursive: true}).filter(path => path.endsWith('.glb'));
        assert.equal(new Set(files.map(path => path.split('/')[0])).size, levels);
        for (const path of files) {
            const report = await validator.validateBytes(new Uint8Array(readFileSync(join(folder, 'content', path))), {format: 'glb', maxIssues: 20});
            assert.deepEqual(report.issues.messages.filter(message => message.severity < 2), [], path);
            assert.deepEqual([report.issues.numErrors, report.issues.numWarnings], [0, 0], path);
            assert.ok(report.info.totalTriangleCount > 0 && report.info.hasDefaultScene, path);
            assert.deepEqual(report.info.extensionsUsed, ['KHR_mesh_quantization'], path);
        }
    });
