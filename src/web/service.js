// service.js - the questions that the page has for rqt serve, and its answers.

const MOST_TRIANGLES = 400000; // of an answer: a phone shows them. Of vertices there are half as many

/** Thrown with the sentence of a problem, or with one of our own where there was no answer. May it be over soon? */
export class Problem extends Error {
    constructor(sentence, mayPass) {
        super(sentence);
        this.mayPass = mayPass;
    }
}

async function ask(path) {
    let response;
    try {
        response = await fetch(path);
    } catch {
        throw new Problem('The service does not answer. Is rqt serve still running?', true);
    }
    if (response.ok) return response;
    let sentence = `${response.status} ${response.statusText}`;
    if ((response.headers.get('Content-Type') || '').includes('json'))
        sentence = await response.json().then(problem => problem.detail || sentence, () => sentence);
    // SQL's sentences begin with the function that says them.
    sentence = sentence.replace(/^rqt_\w+\(\): /, '');
    throw new Problem(sentence[0].toUpperCase() + sentence.slice(1), response.status === 503);
}

/** What comes of an answer's body, which may be cut off. */
async function bodyOf(response, read) {
    try {
        return await response[read]();
    } catch {
        throw new Problem('The answer of the service was cut off.', true);
    }
}

const askJson = async path => bodyOf(await ask(path), 'json');
const of = (terrain, endpoint, parameters) => {
    const query = Object.entries(parameters).filter(([, value]) => value !== undefined)
        .map(([key, value]) => `${key}=${encodeURIComponent(value)}`).join('&');
    return `collections/${encodeURIComponent(terrain)}/${endpoint}?${query}`;
};

/** What is known of every terrain: [{id, bbox, terrain: {width, height, min_z, crs, ...}}]. */
export async function askTerrains() {
    const {collections, problems} = await askJson('collections');
    if (!collections.length && problems?.length) throw new Problem(problems[0].detail || 'No database can be read.', false);
    // Heights that a terrain does not have, for all of it is void, are null.
    return collections.map(({id, extent, terrain}) =>
        ({id, bbox: extent.spatial.bbox[0], terrain: {min_z: null, max_z: null, ...terrain}}));
}

/** layer.json of a terrain's tiles for globes. */
export const askLayer = terrain => askJson(`${tilesPath(terrain, 'quantized-mesh')}/layer.json`);
export const tilesPath = (terrain, kind) => `collections/${encodeURIComponent(terrain)}/tiles/${kind}`;

/**
 * The path of the mesh that a camera needs (camera.js), with the rest of the terrain as coarse as may be, so that one that
 * turns sees no hole; or of a mesh that is nowhere further than eps from the data.
 */
export const viewPath = (terrain, camera, format) =>
    of(terrain, 'view', {camera: JSON.stringify(camera), f: format, cover: 'terrain', max_triangles: MOST_TRIANGLES});
export const rangePath = (terrain, eps, format) => of(terrain, 'range', {eps, f: format, max_vertices: MOST_TRIANGLES / 2});

/** The bytes of a mesh and what the headers tell of it; NaN where they do not. */
export async function askMesh(path) {
    const started = performance.now(), response = await ask(path);
    const bytes = new Uint8Array(await bodyOf(response, 'arrayBuffer'));
    const header = name => parseFloat(response.headers.get(name) ?? 'NaN');
    return {
        bytes,
        milliseconds: performance.now() - started,
        achievedTau: header('RQT-Achieved-Tau'),
        achievedEps: header('RQT-Achieved-Eps'),
        guaranteed: header('RQT-Guaranteed'),
    };
}

/** Metres at a place of the CRS, of the full-resolution samples; null over a void and outside. */
export const askHeight = async (terrain, x, y) => (await askJson(of(terrain, 'height', {x, y}))).z;

/** [[distance, x, y, z], ...] along the line between two places, all in metres but x and y; z null over a void. */
export const askProfile = async (terrain, [ax, ay], [bx, by]) =>
    (await askJson(of(terrain, 'profile', {line: `LINESTRING(${ax} ${ay},${bx} ${by})`, eps: 0}))).rows;
