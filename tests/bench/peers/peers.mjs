// peers.mjs - meshes of the same heights by two other programs, for verify_peers.c.
//
//     node peers.mjs NODE_MODULES HEIGHTS.bin SIDE MESHES.bin ERRORS
//
// greedy TIN (delatin, https://github.com/mapbox/delatin): inserts the worst sample until none is worse than asked; its
// time is that of everything from the first triangle on, as it has no state to keep. RTIN (@mapbox/martini): a right
// triangulated irregular network with the error of the literature, at each split's midpoint; its time is that of
// getMesh, the errors of the tile being computed before (told on stderr), as ours are by the import.
import {readFileSync, openSync, writeSync, closeSync} from 'node:fs';
import {resolve} from 'node:path';
import {pathToFileURL} from 'node:url';

const [modules, heightsPath, sideText, meshesPath, errorsText] = process.argv.slice(2);
const side = Number(sideText);
const errors = errorsText.split(',').map(Number);
const bytes = readFileSync(heightsPath);
const heights = Float32Array.from(new Int32Array(bytes.buffer, bytes.byteOffset, side * side));
const load = async (name) => (await import(pathToFileURL(resolve(modules, name)))).default;
const out = openSync(meshesPath, 'w');

function writeAll(array) {
    const view = new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
    for (let at = 0; at < view.length;) at += writeSync(out, view, at, view.length - at);
}

function writeMesh(series, asked, ms, vertices, triangles) {
    writeSync(out, `${series},${asked},${ms.toFixed(3)},${vertices.length / 2},${triangles.length / 3}\n`);
    writeAll(Int32Array.from(vertices));
    writeAll(Uint32Array.from(triangles));
}

function median(times) {
    times.sort((a, b) => a - b);
    return times[times.length >> 1];
}

const Delatin = await load('delatin/index.js');
{
    let spent = 0;
    let tin;
    for (const asked of [...errors].sort((a, b) => b - a)) {
        const begin = performance.now();
        tin ??= new Delatin(heights, side, side);
        tin.run(asked); // goes on where the larger error stopped: the same points as from the beginning
        spent += performance.now() - begin;
        writeMesh('greedy TIN (delatin)', asked, spent, tin.coords, tin.triangles);
    }
}

const Martini = await load('@mapbox/martini/index.js');
{
    const begin = performance.now();
    const tile = new Martini(side).createTile(heights);
    console.error(`RTIN (martini): ${(performance.now() - begin).toFixed(0)} ms for the errors of the tile`);
    for (const asked of [...errors].sort((a, b) => b - a)) {
        tile.getMesh(asked);
        const times = [];
        let mesh;
        for (let run = 0, end = performance.now() + 300; run < 5 || (run < 51 && performance.now() < end); run++) {
            const start = performance.now();
            mesh = tile.getMesh(asked);
            times.push(performance.now() - start);
        }
        writeMesh('RTIN (martini)', asked, median(times), mesh.vertices, mesh.triangles);
    }
}
closeSync(out);
