// decoder.js - the worker of the page: bytes of the service in, what can be shown out, so that the picture never waits.
//
// A job is {id, terrain, bytes, exaggeration, origin, withEdges, withMorph}. terrain: how its places
// are taken (place.js) when it is another than before, else null. bytes: a mesh in wire format, or null: the mesh of the job before, shown otherwise.
// The answer is {id, mesh, geometry, morph, milliseconds} or {id, problem}, a sentence.

import {buildGeometry, buildMorph} from './geometry.js';
import {morphMeshes} from './morph.js';
import {Place} from './place.js';
import {decodeMesh} from './wire.js';

const MOST_MORPHED = 150000; // vertices of both meshes: beyond, the picture would wait for the union longer than it moves

let terrain = null;
let last = null; // {mesh, exaggeration}: what is shown until the next answer

function run({terrain: other, bytes, exaggeration, origin, withEdges, withMorph}) {
    if (other) {
        terrain = other;
        last = null;
    }
    const placeOf = exaggerated => new Place({...terrain, exaggeration: exaggerated});
    const mesh = bytes ? decodeMesh(bytes, {leaves: true}) : last.mesh, place = placeOf(exaggeration), before = last;
    last = {mesh, exaggeration};
    const isMoving = withMorph && before && (before.mesh !== mesh || before.exaggeration !== exaggeration) &&
        before.mesh.vertexCount + mesh.vertexCount <= MOST_MORPHED;
    const geometry = buildGeometry(mesh, place, origin, withEdges);
    const morph = isMoving && buildMorph(
        morphMeshes(before.mesh, mesh), before.mesh, mesh, placeOf(before.exaggeration), place, origin, withEdges);
    return {mesh, geometry, morph: morph || null};
}

self.onmessage = ({data: job}) => {
    const started = performance.now();
    try {
        const answer = run(job);
        const own = new Set([answer.geometry, answer.morph].flatMap(arrays => Object.values(arrays || {})));
        // The mesh is needed here again: it is copied, all else is handed over.
        for (const kept of Object.values(answer.mesh)) own.delete(kept);
        const given = [...own].filter(ArrayBuffer.isView).map(array => array.buffer);
        self.postMessage({id: job.id, ...answer, milliseconds: performance.now() - started}, given);
    } catch (error) {
        self.postMessage({id: job.id, problem: error.message});
    }
};
