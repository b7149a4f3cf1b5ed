// martini.mjs - how many triangles a second @mapbox/martini's getMesh makes, for bench.sh.
//
//     node martini.mjs NODE_MODULES HEIGHTS.bin SIDE ERRORS
//
// HEIGHTS.bin: SIDE * SIDE little-endian int16. A line per error: error, triangles, millions of triangles a second, the
// best of seven runs. The errors of the tile are computed before, as ours are by the import.
import {readFileSync} from 'node:fs';
import {resolve} from 'node:path';
import {pathToFileURL} from 'node:url';

const [modules, path, sideText, errors] = process.argv.slice(2);
const side = Number(sideText);
const bytes = readFileSync(path);
const heights = Float32Array.from(new Int16Array(bytes.buffer, bytes.byteOffset, side * side));
const Martini = (await import(pathToFileURL(resolve(modules, '@mapbox/martini/index.js')))).default;
const tile = new Martini(side).createTile(heights);
for (const asked of errors.split(',').map(Number)) {
    let best = Infinity;
    let triangles = 0;
    for (let run = 0; run < 7; run++) {
        const begin = performance.now();
        triangles = tile.getMesh(asked).triangles.length / 3;
        best = Math.min(best, performance.now() - begin);
    }
    console.log(asked, triangles, (triangles / best / 1e3).toFixed(1));
}
