// decoder.js - the worker of the page: bytes of the service in, what can be shown out, so that the picture never waits.
//
// A job is {id, terrain, bytes, exaggeration, origin, withEdges, withMorph}. terrain: {isSpace, metre} when
// it is another than before, else null. bytes: a mesh in wire format, or null: the mesh of the job before, shown otherwise.
// The answer is {id, mesh, geometry, morph, milliseconds} or {id, problem}, a sentence.

import {buildGeometry} from './geometry.js';
import {Place} from './place.js';
import {decodeMesh} from './wire.js';

let terrain = null;
let last = null; // {mesh, exaggeration}: what is shown until the next answer

function run({terrain: other, bytes, exaggeration, origin, withEdges}) {
    if (other) {
        terrain = other;
        last = null;
    }
    const mesh = bytes ? decodeMesh(bytes) : last.mesh;
    const place = new Place({lonlat: terrain.isSpace, metre: terrain.metre, exaggeration});
    const geometry = buildGeometry(mesh, place, origin, withEdges);
    last = {mesh, exaggeration};
    return {mesh, geometry, morph: null};
}

self.onmessage = ({data: job}) => {
    const started = performance.now();
    try {
        const answer = run(job);
        const own = [answer.geometry, answer.morph].filter(Boolean)
            .flatMap(({positions, heights, boxes, edges}) => [positions, heights, boxes, edges]).filter(Boolean);
        const message = {id: job.id, ...answer, milliseconds: performance.now() - started};
        self.postMessage(message, own.map(array => array.buffer));
    } catch (error) {
        self.postMessage({id: job.id, problem: error.message});
    }
};
