// state.js - what the page shows, as its address: ?terrain=NAME&tiles=KIND#camera=longitude,latitude,height,heading,pitch&exaggeration=&contours&wires&fly

const number = (text, low, high) => {
    const value = Number(text);
    return text && value >= low && value <= high ? value : undefined;
};

/** What the address says; undefined where it says nothing of use. */
export function readAddress({search, hash}) {
    const asked = new URLSearchParams(search), given = new URLSearchParams(hash.slice(1));
    const [longitude, latitude, height, heading, pitch, more] = (given.get('camera') || '').split(',');
    const camera = {
        longitude: number(longitude, -180, 180), latitude: number(latitude, -90, 90), height: number(height, -1e5, 1e9),
        heading: number(heading, -360, 360), pitch: number(pitch, -90, 90),
    };
    return {
        terrain: asked.get('terrain') || undefined,
        tiles: asked.get('tiles') === '3d-tiles' ? '3d-tiles' : 'quantized-mesh',
        camera: more === undefined && Object.values(camera).every(value => value !== undefined) ? camera : undefined,
        exaggeration: number(given.get('exaggeration'), 1, 10),
        contours: given.has('contours'),
        wires: given.has('wires'),
        fly: given.has('fly'),
    };
}

/** The page of a terrain as tiles of a kind. */
export const addressOf = (terrain, tiles) => `cesium?terrain=${encodeURIComponent(terrain)}${tiles === 'quantized-mesh' ? '' : `&tiles=${tiles}`}`;

/** The fragment for the rest. */
export function writeFragment({camera: {longitude, latitude, height, heading, pitch}, exaggeration, contours, wires, fly}) {
    const parts = [`camera=${[longitude.toFixed(6), latitude.toFixed(6), height.toFixed(1), heading.toFixed(2), pitch.toFixed(2)]}`];
    if (exaggeration !== 1) parts.push(`exaggeration=${exaggeration}`);
    for (const [name, is] of Object.entries({contours, wires, fly})) if (is) parts.push(name);
    return `#${parts.join('&')}`;
}
