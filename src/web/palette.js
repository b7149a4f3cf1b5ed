// palette.js - ramps of colours for the graphics card, as textures.

import {ClampToEdgeWrapping, DataTexture, LinearFilter, NoColorSpace, RGBAFormat} from 'three';
import {colourAt} from './ramps.js';

const WIDTH = 256;

/** A texture one pixel high. */
export function rampTexture(stops) {
    const data = new Uint8Array(4 * WIDTH);
    for (let i = 0; i < WIDTH; i++) data.set([...colourAt(stops, i / (WIDTH - 1)), 255], 4 * i);
    const texture = new DataTexture(data, WIDTH, 1, RGBAFormat);
    texture.colorSpace = NoColorSpace;
    texture.minFilter = texture.magFilter = LinearFilter;
    texture.wrapS = texture.wrapT = ClampToEdgeWrapping;
    texture.needsUpdate = true;
    return texture;
}
